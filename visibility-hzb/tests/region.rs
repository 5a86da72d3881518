//! Buffers drawn for a ball of eyes and a cone of turns: what lies behind a covered pixel is hidden from
//! every eye of the ball, by segments against all faces. Boxes that the buffer hides are hidden from every
//! view.

use crate::common::{Face, Occluder, covered_pixels, faces, occluder, view};
use crate::level::triangles;
use crate::rays::{room, sheets};
use visibility_core::glam::{DMat4, DQuat, DVec3, DVec4, Vec3};
use visibility_core::view::{Reach, ViewRegion};
use visibility_core::{Aabb, OcclusionMap, View, view::Eye};
use visibility_hzb::Hzb;
use visibility_occluders::{LevelOccluders, LevelSettings};
use visibility_testing::job_systems::Reversed;
use visibility_testing::{Random, judged, told_enough};

/// Returns whether the segment between two points meets a face, from the front if it is one-sided. Faces are
/// enlarged by 1e-6 of their size, so that no segment slips between two faces that share an edge.
fn is_blocked(from: DVec3, to: DVec3, faces: &[Face]) -> bool {
    const SLIP: f64 = -1e-6;
    let along = to - from;
    faces.iter().any(|&Face { corners: [a, b, c], one_sided }| {
        let (u, v) = (b - a, c - a);
        let normal = u.cross(v);
        let slope = along.dot(normal);
        if slope == 0.0 || (one_sided && slope > 0.0) {
            return false;
        }
        let t = (a - from).dot(normal) / slope;
        if !(-1e-9..=1.0 + 1e-7).contains(&t) {
            return false;
        }
        let p = from + along * t - a;
        let over = 1.0 / normal.length_squared();
        let (s, r) = (p.cross(v).dot(normal) * over, u.cross(p).dot(normal) * over);
        s >= SLIP && r >= SLIP && s + r <= 1.0 - SLIP
    })
}

/// Returns a view that is moved and turned by at most the reach: half of all by the whole of it.
fn moved(view: &View, reach: Reach, random: &mut Random) -> View {
    let part = |random: &mut Random| if random.one_in(2) { 1.0 - 1e-7 } else { random.fine_unit() };
    let by = random.direction() * (reach.metres() * part(random));
    let turn = DQuat::from_axis_angle(random.direction(), reach.radians() * part(random));
    let Eye::Point(eye) = view.eye(DVec3::ZERO) else { return *view };
    // Points go to where the first view had them: turned back about the eye.
    let back =
        DMat4::from_translation(eye) * DMat4::from_quat(turn.inverse()) * DMat4::from_translation(-eye - by);
    let matrix = view.clip_from(DVec3::ZERO) * back;
    View::from_clip_from_world(matrix, view.depth()).unwrap()
}

/// Returns the point at which sight of `p` begins if the view has `p` in its picture.
fn sight_start(view: &View, p: DVec3) -> Option<DVec3> {
    let matrix = view.clip_from(DVec3::ZERO);
    let clip = matrix * p.extend(1.0);
    let Eye::Point(eye) = view.eye(DVec3::ZERO) else { return None };
    let inside = clip.w > 0.0 && clip.x.abs() <= clip.w && clip.y.abs() <= clip.w;
    let near = view.planes(DVec3::ZERO).as_slice()[4].plane;
    let (from_eye, from_p) = (near.signed_distance(eye), near.signed_distance(p));
    (inside && from_eye < 0.0 && from_p > 0.0).then(|| eye.lerp(p, -from_eye / (from_p - from_eye)))
}

/// Returns a perspective view without a far plane, close to the occluders around the origin.
fn near_view(random: &mut Random) -> View {
    loop {
        let view = view(random);
        let is_near = random.one_in(4) || view.planes(DVec3::ZERO).as_slice()[4].plane.offset.abs() < 7.0;
        if matches!(view.eye(DVec3::ZERO), Eye::Point(_)) && is_near {
            return view;
        }
    }
}

fn some_reach(random: &mut Random) -> Reach {
    Reach::new([0.01, 0.1, 0.4, 1.0][random.below(4)], [0.0, 0.05, 0.15][random.below(3)])
}

/// Counts of segments cast, and of those that no face blocks.
#[derive(Default, Debug)]
struct Counts {
    cast: usize,
    free: usize,
    pixels: usize,
    /// Boxes found hidden.
    hidden: usize,
    /// Sights of hidden boxes that no face blocks.
    seen: usize,
}

fn some_occluders(random: &mut Random) -> Vec<Occluder> {
    match random.below(4) {
        0 => room(random),
        1 => sheets(random),
        _ => (0..random.below(4) + 1).map(|_| occluder(random)).collect(),
    }
}

/// Draws occluders for a region and casts segments from eyes of `truth` to points behind covered pixels and
/// to points of hidden boxes. `drawn` is the region that is drawn, whose views `truth` must hold.
fn cast(
    hzb: &mut Hzb,
    occluders: &[Occluder],
    faces: &[Face],
    view: &View,
    [drawn, truth]: [Reach; 2],
    random: &mut Random,
    counts: &mut Counts,
) {
    let Some(region) = ViewRegion::around(view, drawn) else { return };
    let jobs: Option<&dyn visibility_core::jobs::Jobs> =
        if random.one_in(3) { Some(&Reversed) } else { None };
    if hzb.begin_region(&region, DVec3::ZERO, f32::INFINITY, jobs).is_none() {
        return;
    }
    for occluder in occluders {
        hzb.add(&occluder.mesh, &occluder.transform);
    }
    hzb.flush();
    let (width, height) = (hzb.width() as f64, hzb.height() as f64);
    let inverse = region.picture().clip_from(DVec3::ZERO).inverse();
    let Eye::Point(eye) = region.picture().eye(DVec3::ZERO) else { return };
    let forward = region.picture().planes(DVec3::ZERO).as_slice()[4].plane.normal;
    let pixels: Vec<_> = covered_pixels(hzb).collect();
    let views: Vec<View> = (0..12).map(|_| moved(view, truth, random)).collect();
    for &(column, row, key) in &pixels {
        let lonely = [
            (column.wrapping_sub(1), row),
            (column + 1, row),
            (column, row.wrapping_sub(1)),
            (column, row + 1),
        ]
        .iter()
        .any(|&(c, r)| hzb.depth_key(c, r) == f32::NEG_INFINITY);
        if !lonely && !random.one_in(16) {
            continue;
        }
        counts.pixels += 1;
        let [x, y] = [(column, width), (row, height)]
            .map(|(at, size)| (at as f64 + [1e-6, 1.0 - 1e-6, random.unit()][random.below(3)]) / size);
        let at = inverse * DVec4::new(2.0 * x - 1.0, 1.0 - 2.0 * y, 0.5, 1.0);
        let ray = (at.truncate() / at.w - eye).normalize();
        // Just behind the pixel's depth, a little behind, or far behind.
        let depth =
            1.0 / key * [1.0 + 1e-5, 1.0 + random.unit(), 1.0 + 50.0 * random.unit()][random.below(3)];
        let p = eye + ray * (depth / ray.dot(forward));
        for view in &views {
            if let Some(start) = sight_start(view, p) {
                counts.cast += 1;
                counts.free += usize::from(!is_blocked(start, p, faces));
            }
        }
    }
    for _ in 0..60 {
        let (middle, half) = (random.vec3(-9.0, 9.0), random.vec3(0.01, 0.5));
        let middle = if random.one_in(3) { eye.as_vec3() + random.vec3(-1.5, 1.5) } else { middle };
        let bounds = Aabb::new(middle - half, middle + half);
        if hzb.test(&bounds) != visibility_core::occlusion::Occlusion::Hidden {
            continue;
        }
        counts.hidden += 1;
        let outside = region.planes(DVec3::ZERO).iter().any(|plane| {
            bounds.corners().iter().all(|corner| plane.plane.signed_distance(corner.as_dvec3()) < -1e-6)
        });
        for view in &views {
            for p in random.points_of(&bounds) {
                if let Some(start) = sight_start(view, p) {
                    // The region's own planes come before the buffer. They hold all that its views see.
                    counts.seen += usize::from(outside || !is_blocked(start, p, faces));
                }
            }
        }
    }
}

fn run(trials: usize, seed: u64, drawn: impl Fn(Reach) -> Reach) -> Counts {
    let (mut random, mut counts) = (Random(seed), Counts::default());
    let mut hzb = Hzb::new(160, 96).unwrap();
    for _ in 0..trials {
        let occluders = some_occluders(&mut random);
        let faces = faces(&occluders);
        let (view, reach) = (near_view(&mut random), some_reach(&mut random));
        cast(&mut hzb, &occluders, &faces, &view, [drawn(reach), reach], &mut random, &mut counts);
    }
    counts
}

#[test]
fn nothing_behind_covered_pixels_is_seen_from_the_ball() {
    let counts = run(600, 1, |reach| reach);
    judged(counts.cast as u64);
    told_enough(
        counts.cast > 100_000 && counts.hidden > 500,
        format_args!("too little was tested: {counts:?}"),
    );
    assert_eq!((counts.free, counts.seen), (0, 0), "free segments, and hidden boxes seen: {counts:?}");
}

/// The oracle finds regions that are drawn too small.
#[test]
fn too_small_a_ball_or_cone_is_found() {
    let halved = run(600, 1, |reach| Reach::new(0.5 * reach.metres(), reach.radians()));
    assert!(halved.free > 10, "half of the parallax: {halved:?}");
    let unturned = run(600, 1, |reach| Reach::new(reach.metres(), 0.0));
    assert!(unturned.seen > 10, "no turn: {unturned:?}");
}

/// An eye in a ball that touches no occluder keeps hiding what a large wall hides.
#[test]
fn a_wall_still_hides() {
    let wall = visibility_core::OccluderMesh::cuboid(&Aabb::from_arrays([5.0, -4.0, -4.0], [5.2, 4.0, 4.0]))
        .unwrap();
    let pose = visibility_core::Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).unwrap();
    let mut hzb = Hzb::default();
    let mut hidden = |metres: f64| {
        let region = ViewRegion::around(&view, Reach::new(metres, 0.1)).unwrap();
        hzb.begin_region(&region, DVec3::ZERO, f32::INFINITY, None).unwrap();
        hzb.add(&wall, &visibility_core::glam::Affine3A::IDENTITY);
        hzb.flush();
        let at = |y: f32| Aabb::new(Vec3::new(9.9, y - 0.01, -0.01), Vec3::new(10.0, y + 0.01, 0.01));
        (0..100)
            .filter(|&i| hzb.test(&at(0.1 * i as f32)) == visibility_core::occlusion::Occlusion::Hidden)
            .count()
    };
    // The wall's edge is 4 m beside its middle, 5 m ahead. At 9.9 m that is 7.92 m from the eye. From the
    // ball it appears at 7.67 m for 10 cm, at 6.95 m for 40 cm and 5.63 m for 1 m. A pixel is 6 cm wide
    // there.
    let counts = [0.0, 0.1, 0.4, 1.0].map(&mut hidden);
    for (count, beside) in counts.into_iter().zip([7.92, 7.67, 6.95, 5.63]) {
        assert!(
            f64::from(count as u32) * 0.1 - beside < 0.2 && beside - f64::from(count as u32) * 0.1 < 0.2,
            "{counts:?}"
        );
    }
}

/// A buffer with a level has no answers for regions. An answer holds until somebody may have changed the map.
#[test]
fn levels_have_no_answers_and_changed_maps_drop_theirs() {
    use visibility_core::{Culler, OcclusionCuller, Scene, VisibleSet};
    let pose = visibility_core::Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).unwrap();
    let region = ViewRegion::around(&view, Reach::new(0.1, 0.1)).unwrap();
    let (scene, mut set) = (Scene::new(), VisibleSet::new());
    set.fill(&scene, &view);
    let mut culler = OcclusionCuller::new(Hzb::default());
    assert!(!culler.answer_holds(), "no answer yet");
    assert!(culler.cull_region(None, &scene, &region, &mut set).is_some(), "without a level");
    assert!(culler.answer_holds(), "nothing has changed");
    culler.map_mut();
    assert!(!culler.answer_holds(), "the map may have changed");
    let level = loop {
        let triangles = triangles(&mut Random(1));
        if let Ok(level) = LevelOccluders::new(&triangles, LevelSettings::default()) {
            break std::sync::Arc::new(level);
        }
    };
    let mut culler = OcclusionCuller::new(Hzb::default().with_level(level, DVec3::ZERO));
    assert!(culler.cull_region(None, &scene, &region, &mut set).is_none(), "with a level");
}
