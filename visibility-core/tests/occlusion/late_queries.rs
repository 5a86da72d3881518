//! Tests of the occlusion driver over a device whose answers come frames late, as those of a graphics card
//! do.

use super::{Street, along_x, pipeline, street, view_from, visible};
use visibility_core::geometry::Plane;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::occlusion::{HardwareQueries, LateAnswers, Occlusion, QueryDevice};
use visibility_core::{
    Aabb, Culler, FrustumCuller, OccluderMesh, OcclusionCuller, OcclusionMap, Scene, View, VisibleSet,
};
use visibility_testing::PlainMap;

/// A simulated GPU whose query answers arrive some frames late: a plain depth map and a queue of answers.
struct SimulatedCard {
    map: PlainMap,
    /// Occluders that the engine draws itself at the start of each frame.
    own: Vec<OccluderMesh>,
    latency: u32,
    frame: u32,
    view: View,
    under_way: Vec<(u32, u64, bool)>,
    asked: usize,
}

impl SimulatedCard {
    fn new(latency: u32) -> Self {
        Self {
            map: PlainMap::new(96, 60),
            own: Vec::new(),
            latency,
            frame: 0,
            view: along_x(),
            under_way: Vec::new(),
            asked: 0,
        }
    }
}

impl QueryDevice for SimulatedCard {
    fn ask(&mut self, query: u64, boxes: &[Aabb]) {
        self.map.flush();
        self.asked += 1;
        let passed = boxes.iter().any(|bounds| self.map.test(bounds) != Occlusion::Hidden);
        self.under_way.push((self.frame, query, passed));
    }

    fn answers(&mut self, each: &mut dyn FnMut(u64, u32)) {
        let (frame, latency) = (self.frame, self.latency);
        self.under_way.retain(|&(asked, query, passed)| {
            let due = frame >= asked + latency;
            if due {
                each(query, u32::from(passed));
            }
            !due
        });
        // The driver asks for answers once per frame, before it draws anything.
        self.frame += 1;
        self.map.begin(&self.view, DVec3::ZERO);
        self.own.iter().for_each(|mesh| self.map.add(mesh, &Affine3A::IDENTITY));
    }

    fn draw(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        self.map.add(occluder, transform);
    }
}

/// Culls one frame from each eye by late queries alone. Returns, for each frame, the number of objects
/// reported and whether a visible object was missing.
fn by_queries(latency: u32, late: LateAnswers, eyes: &[DVec3]) -> Vec<(usize, bool)> {
    by_looks(latency, late, 0, eyes)
}

/// As [`by_queries`], with a number of looks ahead at each frame. With a latency of 0, answers arrive before
/// the next look.
fn by_looks(latency: u32, late: LateAnswers, looks_ahead: u32, eyes: &[DVec3]) -> Vec<(usize, bool)> {
    let Street { scene, .. } = street();
    let mut culler = OcclusionCuller::new(HardwareQueries::new(SimulatedCard::new(latency), late));
    let mut visible_set = VisibleSet::new();
    let mut result = Vec::new();
    for &eye in eyes {
        let view = view_from(eye, eye + DVec3::X);
        culler.map_mut().device_mut().view = view;
        for look in 0..=looks_ahead {
            visible_set.fill(&scene, &view);
            FrustumCuller::new().cull(&scene, &view, &mut visible_set);
            if look < looks_ahead {
                culler.look_ahead(&scene, &view, &mut visible_set, look);
            } else {
                culler.cull(&scene, &view, &mut visible_set);
            }
        }
        let exact = visible(&mut pipeline(), &scene, &view);
        let lost = exact.iter().any(|&id| !visible_set.contains(&scene, id));
        result.push((visible_set.count(&scene), lost));
    }
    result
}

#[test]
fn late_answers_count_as_visible_until_they_are_there() {
    for latency in [1, 3] {
        let frames = by_queries(latency, LateAnswers::Visible, &[DVec3::ZERO; 64]);
        assert_eq!(frames[0], (503, false), "nothing is answered yet");
        assert_eq!(frames[63], (3, false), "a still camera culls all in the end, latency {latency}");
        assert!(
            frames.windows(2).all(|pair| pair[0].0 >= pair[1].0),
            "latency {latency}: objects visible by frame, never more than before: {frames:?}"
        );
    }
}

/// Returns the number of objects that a frame along x leaves, by frustum and `culler`.
fn visible_along_x(culler: &mut dyn Culler, visible: &mut VisibleSet, scene: &Scene) -> usize {
    visible.fill(scene, &along_x());
    FrustumCuller::new().cull(scene, &along_x(), visible);
    culler.cull(scene, &along_x(), visible);
    visible.count(scene)
}

#[test]
fn answers_about_other_occluders_do_not_count() {
    let Street { mut scene, wall, .. } = street();
    let map = HardwareQueries::new(SimulatedCard::new(2), LateAnswers::Visible);
    let mut culler = OcclusionCuller::new(map);
    let mut visible = VisibleSet::new();
    let mut frame = |scene: &Scene| visible_along_x(&mut culler, &mut visible, scene);
    let still = (0..64).map(|_| frame(&scene)).last();
    assert_eq!(still, Some(3), "objects visible after 64 still frames");
    // The wall stops being an occluder between two frames; all known and pending answers are about the
    // old state.
    scene.set_occluder(wall, false).unwrap();
    assert!((0..20).all(|_| frame(&scene) == 503), "the wall's old answers hide objects");
}

/// Tests a change of scene where the engine draws its occluders itself, so that the occluders given to the
/// map do not reveal the change: answers about the old scene must not be used.
#[test]
fn answers_about_another_scene_do_not_count() {
    let Street { mut scene, wall, .. } = street();
    let mut card = SimulatedCard::new(1);
    card.own.push(scene.occluder(wall).unwrap().0.clone());
    scene.set_occluder(wall, false).unwrap();
    let mut culler = OcclusionCuller::new(HardwareQueries::new(card, LateAnswers::Visible));
    let mut visible = VisibleSet::new();
    let mut frame = |scene: &Scene| visible_along_x(&mut culler, &mut visible, scene);
    assert_eq!((0..64).map(|_| frame(&scene)).last(), Some(3), "objects visible after 64 still frames");
    let copy = scene.clone();
    assert_eq!(frame(&copy), 503, "no answer is about the other scene");
}

#[test]
fn a_device_that_loses_queries_is_asked_again() {
    struct Deaf {
        asked: Vec<u64>,
    }
    impl QueryDevice for Deaf {
        fn ask(&mut self, query: u64, _: &[Aabb]) {
            self.asked.push(query);
        }

        fn answers(&mut self, _: &mut dyn FnMut(u64, u32)) {}
    }
    let mut map = HardwareQueries::new(Deaf { asked: Vec::new() }, LateAnswers::Visible);
    let far = Aabb::from_arrays([20.0, 0.0, 0.0], [21.0, 1.0, 1.0]);
    let at_the_eye = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
    for _ in 0..200 {
        map.begin(&along_x(), DVec3::ZERO);
        map.flush();
        assert_eq!(map.test_mut(&far), Occlusion::Visible, "a query without an answer");
        assert_eq!(map.test_mut(&at_the_eye), Occlusion::Partial, "never asked about");
    }
    let asked = &map.device_mut().asked;
    assert!((3..=5).contains(&asked.len()), "{asked:?}");
    assert!(
        asked.windows(2).all(|pair| pair[0] != pair[1]),
        "late answers to the first are not taken for the second's"
    );
}

#[test]
fn a_moving_camera_loses_nothing_unless_old_answers_are_trusted() {
    let eyes: Vec<DVec3> = (0..40).map(|i| DVec3::new(0.0, f64::from(i) * 0.4, 0.0)).collect();
    let safe = by_queries(2, LateAnswers::Visible, &eyes);
    assert!(safe.iter().all(|(_, lost)| !lost), "frames in which a visible thing is lost: {safe:?}");
    let trusting = by_queries(2, LateAnswers::Trusted { frames: 4 }, &eyes);
    assert!(trusting.iter().any(|(_, lost)| *lost), "what comes into view pops in late");
    let sum = |frames: &[(usize, bool)]| frames.iter().map(|(count, _)| count).sum::<usize>();
    assert!(sum(&trusting) < sum(&safe), "and that is what it gains");
}

#[test]
fn looks_ahead_cull_under_a_moving_camera_and_lose_nothing() {
    // From all of these eyes the wall hides the 500 boxes behind it.
    let eyes: Vec<DVec3> = (0..40).map(|i| DVec3::Y * (f64::from(i) * 0.15 - 3.0)).collect();
    let [none, one, two] = [0, 1, 2].map(|looks| by_looks(0, LateAnswers::Visible, looks, &eyes));
    for frames in [&none, &one, &two] {
        assert!(frames.iter().all(|(_, lost)| !lost), "frames in which a visible thing is lost: {frames:?}");
    }
    assert!(none.iter().all(|&(left, _)| left > 500), "objects left without a look ahead: {none:?}");
    assert!(one[10..].iter().all(|&(left, _)| left < 10), "objects left by one look ahead: {one:?}");
    assert!(two[5..].iter().all(|&(left, _)| left < 10), "objects left by two looks ahead: {two:?}");
}

/// Two walls, one farther away than the other, that meet in the picture of one eye hide any box behind them,
/// however large. From an eye beside, a point in all of these boxes shows through the gap between the walls.
/// So an answer for one eye proves nothing for another.
#[test]
fn an_answer_for_one_eye_proves_nothing_for_another() {
    const NEAR_END: f32 = 0.2;
    const FAR_END: f32 = -0.4;
    let wall = |x: f32, [a, b]: [f32; 2]| {
        let corners = [[x, a, -400.0], [x, b, -400.0], [x, b, 400.0], [x, a, 400.0]].map(Vec3::from_array);
        OccluderMesh::from_indexed(&corners, &[[0, 1, 2], [0, 2, 3]]).unwrap().with_two_sided(true)
    };
    let walls = [wall(10.0, [-400.0, NEAR_END]), wall(20.0, [FAR_END, 800.0])];
    let (here, beside, point) = (DVec3::ZERO, DVec3::Y, DVec3::new(40.0, -2.0, 0.0));
    // A segment to the point is free if it passes the near wall above its end, and the far wall below its
    // end.
    let sees = |eye: DVec3| {
        let y_at = |x: f64| eye.y + (point.y - eye.y) * (x - eye.x) / (point.x - eye.x);
        y_at(10.0) > f64::from(NEAR_END) && y_at(20.0) < f64::from(FAR_END)
    };
    assert_eq!([here, beside].map(sees), [false, true], "eyes that see the point");
    for (late, expected) in
        [(LateAnswers::Visible, Occlusion::Visible), (LateAnswers::Trusted { frames: 4 }, Occlusion::Hidden)]
    {
        for half in [0.1, 1.0, 8.0, 30.0] {
            let center = point.as_vec3() + Vec3::X * half;
            let bounds = Aabb::new(center - half, center + half);
            let mut card = SimulatedCard::new(0);
            card.own = walls.to_vec();
            let mut map = HardwareQueries::new(card, late);
            let mut look = |eye: DVec3| {
                let view = view_from(eye, eye + DVec3::X);
                map.device_mut().view = view;
                map.begin(&view, DVec3::ZERO);
                map.flush();
                map.test_mut(&bounds)
            };
            let answers = [look(here), look(here), look(beside)];
            let all = [Occlusion::Visible, Occlusion::Hidden, expected];
            assert_eq!(answers, all, "a box of {half} m about the point, {late:?}");
        }
    }
}

/// A graphics card that reports every box as hidden.
struct HidesAll(Vec<u64>);

impl QueryDevice for HidesAll {
    fn ask(&mut self, query: u64, _: &[Aabb]) {
        self.0.push(query);
    }

    fn answers(&mut self, each: &mut dyn FnMut(u64, u32)) {
        self.0.drain(..).for_each(|query| each(query, 0));
    }

    fn draw(&mut self, _: &OccluderMesh, _: &Affine3A) {}
}

/// The remaining part of a clipped box may be hidden although the whole box is not.
#[test]
fn boxes_that_the_near_plane_or_a_clip_plane_cuts_are_never_hidden() {
    let clip = Plane::through(DVec3::X * 10.0, DVec3::X);
    let [near, both] = [&[][..], &[clip][..]].map(|planes| along_x().with_clip_planes(planes).unwrap());
    for (from, to, hidden) in [(-1.0, 2.0, [false; 2]), (8.0, 12.0, [true, false]), (11.0, 12.0, [true; 2])] {
        let bounds = Aabb::from_arrays([from, -1.0, -1.0], [to, 1.0, 1.0]);
        for (view, hidden) in [near, both].iter().zip(hidden) {
            let mut map = HardwareQueries::new(HidesAll(Vec::new()), LateAnswers::Visible);
            let answers = [0, 1].map(|_| {
                map.begin(view, DVec3::ZERO);
                map.flush();
                map.test_mut(&bounds) == Occlusion::Hidden
            });
            assert_eq!(answers, [false, hidden], "{from} to {to}, {} clip planes", view.clip_planes().len());
        }
    }
}

/// A graphics card that counts the occluders that it draws.
struct CountsDraws(usize);

impl QueryDevice for CountsDraws {
    fn ask(&mut self, _: u64, _: &[Aabb]) {}

    fn answers(&mut self, _: &mut dyn FnMut(u64, u32)) {}

    fn draw(&mut self, _: &OccluderMesh, _: &Affine3A) {
        self.0 += 1;
    }
}

/// The parts of an occluder that a clip plane cuts away hide nothing.
#[test]
fn occluders_that_a_clip_plane_cuts_are_not_drawn() {
    let clip = Plane::through(DVec3::X * 10.0, DVec3::X);
    for (planes, from, drawn) in [(&[][..], 9.0, 1), (&[clip][..], 9.0, 0), (&[clip][..], 11.0, 1)] {
        let mut map = HardwareQueries::new(CountsDraws(0), LateAnswers::Visible);
        map.begin(&along_x().with_clip_planes(planes).unwrap(), DVec3::ZERO);
        let wall = Aabb::from_arrays([from, -1.0, -1.0], [from + 2.0, 1.0, 1.0]);
        map.add(&OccluderMesh::cuboid(&wall).unwrap(), &Affine3A::IDENTITY);
        map.flush();
        assert_eq!(map.device_mut().0, drawn, "a wall from {from} and {} clip planes", planes.len());
    }
}

/// Boxes that move each frame are new boxes without answers, and their queries take few slots. A query's slot
/// is the lower half of its number.
#[test]
fn boxes_that_move_each_frame_take_few_slots() {
    for (is_still, late, slots) in [
        (false, LateAnswers::Visible, 2),
        (false, LateAnswers::Trusted { frames: 2 }, 4),
        (true, LateAnswers::Visible, 10),
    ] {
        let mut map = HardwareQueries::new(HidesAll(Vec::new()), late);
        let stays = Aabb::from_arrays([90.0, 0.0, 0.0], [91.0, 1.0, 1.0]);
        let mut most = 0;
        for frame in 0..100 {
            let eye = DVec3::Y * if is_still { 0.0 } else { f64::from(frame) };
            map.begin(&view_from(eye, eye + DVec3::X), DVec3::ZERO);
            map.flush();
            for mover in 0..20 {
                let at = [10.0 + mover as f32, frame as f32, 0.0];
                let answer = map.test_mut(&Aabb::from_arrays(at, at.map(|x| x + 1.0)));
                assert_eq!(answer, Occlusion::Visible, "frame {frame}: a box that has moved");
            }
            // A box that is tested again after a few frames keeps its answer.
            if is_still && frame % 6 < 2 {
                let expected = if frame == 0 { Occlusion::Visible } else { Occlusion::Hidden };
                assert_eq!(map.test_mut(&stays), expected, "frame {frame}: a box that stays");
            }
            let queries = &map.device_mut().0;
            most = queries.iter().map(|&query| query as u32 + 1).fold(most, u32::max);
        }
        assert!(most <= 20 * slots + 1, "{most} slots for 20 movers, {late:?}");
    }
}
