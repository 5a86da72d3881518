//! Climbs towards boxes that a horizon hides and a line of sight reaches, with cameras, solids and lines of
//! sight in exact arithmetic: any exact matrix, any power of two as the unit of coordinates, moved origins.

use visibility_2d::horizon::{Horizon, HorizonCuller, HorizonOccluders, UpAxis};
use visibility_core::glam::Affine3A;
use visibility_core::occlusion::Occlusion;
use visibility_core::{Culler, OcclusionMap, VisibleSet};
use visibility_testing::{Camera, Random, SightWorld, climb, judged, told_enough};

#[test]
fn no_climb_ends_at_a_box_that_a_horizon_hides_and_a_line_reaches() {
    let mut random = Random(1);
    let (mut started, mut all) = (0, 0);
    for number in 0..3000 {
        let world = SightWorld::seen_by_camera(&mut random);
        let up = if random.one_in(4) { UpAxis::Y } else { UpAxis::Z };
        let mut horizon = Horizon::new(up).with_columns(random.pick(&[1, 7, 64, 360]));
        let end = climb(world, &mut random, 60, |world| {
            let (Some(view), Some(mesh)) = (world.view(), world.mesh()) else { return false };
            horizon.begin(&view, world.origin());
            horizon.add(&mesh, &Affine3A::IDENTITY);
            horizon.flush();
            horizon.test(&world.target()) == Occlusion::Hidden
        });
        let Some(end) = end else { continue };
        assert!(end.least > 0.0, "world {number}, {up:?} up: hidden and seen: {:?}", end.input);
        started += 1;
        all += end.judged;
    }
    judged(all);
    told_enough(started > 100 && all > 8 * started, format_args!("{started} worlds, {all} inputs"));
}

/// Quadrilaterals along each side of the ground.
const SIDE: usize = 5;

/// Makes ground of integer heights around the origin, an eye above one border that looks across it, and a
/// target that is lower, above the other border.
fn ground(random: &mut Random, up: UpAxis) -> SightWorld {
    let step = 1i64 << (8 + random.below(11));
    let steep = (step / random.pick(&[1, 4, 16])).min(1 << 18);
    let some = |random: &mut Random, by: i64| i64::from(random.between(-by as i32, by as i32));
    let middle = (SIDE as i64 * step) / 2;
    let mut points = Vec::new();
    for [row, column] in (0..=SIDE).flat_map(|row| (0..=SIDE).map(move |column| [row, column])) {
        let is_crest = row == SIDE / 2 && random.below(4) > 0;
        let height = if is_crest { 2 * steep } else { 0 } + some(random, steep);
        points.push([row as i64 * step - middle, column as i64 * step - middle, height]);
    }
    let corner = |row: usize, column: usize| row * (SIDE + 1) + column;
    let quads = (0..SIDE * SIDE).map(|k| (k / SIDE, k % SIDE)).flat_map(|(row, column)| {
        let [a, b] = [corner(row, column), corner(row + 1, column)];
        [[a, b, b + 1], [a, b + 1, a + 1]]
    });
    let faces = quads.collect();
    let height = steep + some(random, steep) / 2;
    let eye = [-middle + some(random, step / 2), some(random, middle / 2), height];
    let target = [middle + some(random, step / 2), some(random, middle / 2), height - 2 * steep];
    points.extend([target, eye]);
    let ahead = random.pick(&[[1, 0, 0], [3, 1, 0], [3, 0, 1], [4, -1, -1]]);
    let aside = random.pick(&[[0, -1, 0], [1, -3, 0]]);
    let mut rows = [aside, [0, 0, random.pick(&[1, 2])], ahead];
    // Cyclic exchanges of axes mirror nothing.
    if up == UpAxis::Y {
        points.iter_mut().chain(&mut rows).for_each(|p: &mut [i64; 3]| p.rotate_left(1));
    }
    SightWorld {
        fixed: 0,
        numbers: points.into_iter().flatten().collect(),
        faces,
        two_sided: random.one_in(2),
        target_size: if random.one_in(3) { [0; 3] } else { [0; 3].map(|_| random.magnitude(10)) },
        eyes_size: [0; 3],
        camera: Some(Camera { rows, near: random.magnitude(8) }),
        unit: random.pick(&[-60, -15, -11, 0, 40]),
        origin: if random.one_in(3) { [0; 3].map(|_| random.bits() as i64 >> 17) } else { [0; 3] },
        in_depth: random.one_in(4),
    }
    .with_fixed_triangles()
}

#[test]
fn no_climb_ends_at_a_box_that_ground_hides_and_a_line_reaches() {
    let mut random = Random(2);
    let (mut started, mut all) = (0, 0);
    for number in 0..400 {
        let up = random.pick(&[UpAxis::Y, UpAxis::Z]);
        let world = ground(&mut random, up);
        let Some((mut scene, target)) = world.scene() else { continue };
        let occluders = HorizonOccluders::new(&scene, up);
        assert_eq!(occluders.solid_count(), 0, "the ground alone hides");
        let mut culler = HorizonCuller::new(occluders.into()).with_columns(random.pick(&[1, 7, 64, 360]));
        let end = climb(world, &mut random, 40, |world| {
            let Some(view) = world.view() else { return false };
            let mut visible = VisibleSet::new();
            if scene.set_bounds(target, world.target()).is_err() {
                return false;
            }
            visible.fill(&scene, &view);
            culler.cull(&scene, &view, &mut visible);
            !visible.contains(&scene, target)
        });
        let Some(end) = end else { continue };
        assert!(end.least > 0.0, "ground {number}, {up:?} up: hidden and seen: {:?}", end.input);
        started += 1;
        all += end.judged;
    }
    judged(all);
    told_enough(started > 40 && all > 8 * started, format_args!("{started} grounds, {all} inputs"));
}
