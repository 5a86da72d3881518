//! Tests of walls in meshes that are not convex: what they hide, and what stays visible through a gap, under
//! a raised wall, and past a leaning wall.

use visibility_2d::horizon::{Horizon, UpAxis};
use visibility_core::glam::{Affine3A, DVec3, Mat3, Quat, Vec3};
use visibility_core::occlusion::Occlusion;
use visibility_core::{Aabb, OccluderMesh, OcclusionMap, Pose, View};

/// Makes panels from corner to corner of a plan, each with its lower and upper height. The front is to the
/// right of the direction of the corners.
fn panels(plan: &[[f32; 2]], heights: impl Fn(usize) -> [f32; 2]) -> Vec<[Vec3; 3]> {
    let panel = |(i, ends): (usize, &[[f32; 2]])| {
        let at = |end: usize, height: usize| Vec3::new(ends[end][0], ends[end][1], heights(i)[height]);
        [[at(0, 0), at(1, 0), at(1, 1)], [at(0, 0), at(1, 1), at(0, 1)]]
    };
    plan.windows(2).enumerate().flat_map(panel).collect()
}

/// Plan of a crooked wall in front of the eye, from left to right, whose front faces the eye. No two
/// neighbouring panels are coplanar, and no corner is on the boundary of a column.
const CROOKED: [[f32; 2]; 5] = [[9.0, 7.3], [11.0, 3.1], [8.0, 0.07], [12.0, -3.3], [9.0, -7.1]];

/// Low box behind the middle of the wall, which spans the wall's three inner corners in the picture.
const BEHIND: [[f32; 3]; 2] = [[20.0, -8.0, 0.5], [22.0, 8.0, 1.0]];

/// Returns whether triangles, placed by `transform`, hide a box from an eye at a height of 1.6 m that looks
/// along x.
fn hides(triangles: &[[Vec3; 3]], two_sided: bool, transform: Affine3A, bounds: [[f32; 3]; 2]) -> bool {
    let mesh = OccluderMesh::from_triangles(triangles).unwrap().with_two_sided(two_sided);
    let eye = DVec3::new(0.0, 0.0, 1.6);
    let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.2, 1.5, 0.1, f64::INFINITY).unwrap();
    let mut horizon = Horizon::new(UpAxis::Z);
    horizon.begin(&view, DVec3::ZERO);
    horizon.add(&mesh, &transform);
    horizon.flush();
    horizon.test(&Aabb::from_arrays(bounds[0], bounds[1])) == Occlusion::Hidden
}

fn stands(_: usize) -> [f32; 2] {
    [0.0, 3.0]
}

#[test]
fn panels_around_corners_hide_as_one_wall() {
    let wall = panels(&CROOKED, stands);
    assert!(hides(&wall, true, Affine3A::IDENTITY, BEHIND), "the wall, two-sided");
    assert!(hides(&wall, false, Affine3A::IDENTITY, BEHIND), "the wall, from its front");
    // A box whose upper part is above the wall is visible.
    assert!(
        !hides(&wall, true, Affine3A::IDENTITY, [[20.0, -8.0, 0.5], [22.0, 8.0, 6.0]]),
        "what stands out above the wall"
    );
    // Panels of different heights hide what is within the common range of heights.
    let uneven = |i: usize| [[-0.5, 0.0, -0.2, 0.1][i], [3.0, 2.5, 4.0, 3.5][i]];
    assert!(hides(&panels(&CROOKED, uneven), true, Affine3A::IDENTITY, BEHIND), "panels of several heights");
    let low = |i: usize| [0.0, [3.0, 1.2, 4.0, 3.5][i]];
    assert!(!hides(&panels(&CROOKED, low), true, Affine3A::IDENTITY, BEHIND), "a panel that is too low");
}

#[test]
fn a_wall_of_one_side_hides_what_is_behind_its_front() {
    let back: Vec<_> = panels(&CROOKED, stands).iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    assert!(!hides(&back, false, Affine3A::IDENTITY, BEHIND), "the wall from its back");
    assert!(hides(&back, true, Affine3A::IDENTITY, BEHIND), "the wall from its back, two-sided");
    // A mirroring transform keeps the fronts of triangles.
    let mirrored = Affine3A::from_mat3(Mat3::from_diagonal(Vec3::new(1.0, -1.0, 1.0)));
    assert!(hides(&panels(&CROOKED, stands), false, mirrored, BEHIND), "a mirrored wall from its front");
    assert!(!hides(&back, false, mirrored, BEHIND), "a mirrored wall from its back");
    let upside_down =
        Affine3A::from_mat3_translation(Mat3::from_diagonal(Vec3::new(1.0, 1.0, -1.0)), Vec3::Z * 3.0);
    assert!(
        hides(&panels(&CROOKED, stands), false, upside_down, BEHIND),
        "a wall upside down from its front"
    );
    assert!(!hides(&back, false, upside_down, BEHIND), "a wall upside down from its back");
}

#[test]
fn a_wall_with_a_gap_hides_nothing_behind_the_gap() {
    let wall = panels(&CROOKED, stands);
    for missing in 2..6 {
        let mut open = wall.clone();
        open.remove(missing);
        assert!(!hides(&open, true, Affine3A::IDENTITY, BEHIND), "without triangle {missing}");
    }
    // A wall with a gap narrower than a column, between two corners.
    let mut left = panels(&CROOKED[..3], stands);
    let right = CROOKED.map(|[x, y]| [x, if y == 0.07 { 0.069 } else { y }]);
    left.extend(panels(&right[2..], stands));
    assert!(!hides(&left, true, Affine3A::IDENTITY, BEHIND), "a gap narrower than a column");
}

/// Lines of sight can pass beneath a raised panel, so a box below stays visible unless other panels hide it.
#[test]
fn a_raised_panel_hides_nothing_beneath_it() {
    for raised in 0..4 {
        let wall = panels(&CROOKED, |i| [if i == raised { 1.2 } else { 0.0 }, 3.0]);
        assert!(!hides(&wall, true, Affine3A::IDENTITY, BEHIND), "panel {raised}");
        let high = [[20.0, -8.0, 1.7], [22.0, 8.0, 2.0]];
        assert!(hides(&wall, true, Affine3A::IDENTITY, high), "panel {raised}");
    }
    // Behind the wall the ground is lower, so the box is below the wall's foot.
    let wall = panels(&CROOKED, stands);
    assert!(
        !hides(&wall, true, Affine3A::IDENTITY, [[20.0, -8.0, -4.0], [22.0, 8.0, -3.5]]),
        "a box lower than the wall's foot"
    );
}

#[test]
fn what_leans_is_no_wall() {
    let wall = panels(&CROOKED, stands);
    let lean = Affine3A::from_quat(Quat::from_rotation_y(1e-3));
    assert!(!hides(&wall, true, lean, BEHIND), "a wall that leans by 1e-3 rad");
    // A rotation about the vertical keeps the wall upright.
    let turned = Affine3A::from_rotation_translation(Quat::from_rotation_z(0.05), Vec3::new(0.3, 0.1, 0.0));
    assert!(hides(&wall, true, turned, BEHIND), "a wall turned about the vertical");
    // A corner moved by a millimetre at its top makes the wall lean.
    let moved: Vec<_> = wall
        .iter()
        .map(|t| t.map(|p| if p.y == 0.07 && p.z == 3.0 { p + Vec3::X * 1e-3 } else { p }))
        .collect();
    assert!(!hides(&moved, true, Affine3A::IDENTITY, BEHIND), "a corner moved by 1 mm");
    // Two triangles folded onto each other cover only half of their panel.
    let mut folded = wall.clone();
    folded[3] = [folded[3][0], folded[3][1], Vec3::new(8.0, 0.07, 2.0)];
    assert!(!hides(&folded, true, Affine3A::IDENTITY, BEHIND), "a panel of folded triangles");
}

/// Coordinates and transforms at the limits of `f32`: no panic, and an invalid wall hides nothing.
#[test]
fn hostile_walls_hide_nothing() {
    let bad = [f32::NAN, f32::INFINITY, f32::MAX, 0.0];
    for value in bad {
        for entry in 0..12 {
            let mut columns = Affine3A::IDENTITY.to_cols_array();
            columns[entry] = value;
            // With a zero scale or position along one axis, the wall may still hide.
            let transform = Affine3A::from_cols_array(&columns);
            let is_hidden = hides(&panels(&CROOKED, stands), true, transform, BEHIND);
            assert!(!is_hidden || value == 0.0, "{value} as entry {entry}");
        }
    }
    for scale in [1e-44, 1e-38, 1e-20, 1e18, 1e37] {
        let wall: Vec<_> = panels(&CROOKED, stands).iter().map(|t| t.map(|p| p * scale)).collect();
        if OccluderMesh::from_triangles(&wall).is_ok() {
            assert!(!hides(&wall, true, Affine3A::IDENTITY, BEHIND), "{scale}");
        }
    }
    // Hundreds of panels of equal height that meet at one point of the plan.
    let star: Vec<_> = (0..400)
        .flat_map(|i| {
            let angle = i as f32 * 0.0157;
            panels(&[[9.0, 0.0], [9.0 + 5.0 * angle.cos(), 5.0 * angle.sin()]], stands)
        })
        .collect();
    assert!(!hides(&star, true, Affine3A::IDENTITY, BEHIND), "hundreds of panels over one point");
}
