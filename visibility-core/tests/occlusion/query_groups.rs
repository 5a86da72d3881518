//! Tests of which boxes hardware queries ask about, when, and with which others.

use super::along_x;
use visibility_core::glam::DVec3;
use visibility_core::occlusion::{HardwareQueries, LateAnswers, Occlusion, QueryDevice};
use visibility_core::{Aabb, Accuracy, OcclusionCuller, OcclusionMap, Scene, VisibleSet};
use visibility_core::{Culler, View};

/// Number of samples of a box that pass.
type Samples = fn(&Aabb) -> u32;

/// Device that answers each query at the next chance, with the sum of the passed samples of its boxes.
struct Counting {
    /// Number of passed samples of a box.
    samples: Samples,
    under_way: Vec<(u64, u32)>,
    /// Boxes of each query, in a list for each call of `answers` since the first.
    asked: Vec<Vec<Vec<Aabb>>>,
}

impl Counting {
    fn new(samples: Samples) -> Self {
        Self { samples, under_way: Vec::new(), asked: Vec::new() }
    }

    /// Returns the numbers of boxes of the queries of a frame, in descending order.
    fn sizes(&self, frame: usize) -> Vec<usize> {
        let mut sizes: Vec<usize> = self.asked[frame].iter().map(Vec::len).collect();
        sizes.sort_by(|a, b| b.cmp(a));
        sizes
    }
}

impl QueryDevice for Counting {
    fn ask(&mut self, query: u64, boxes: &[Aabb]) {
        let samples = boxes.iter().map(self.samples).sum();
        self.under_way.push((query, samples));
        self.asked.last_mut().expect("a frame has begun").push(boxes.to_vec());
    }

    fn answers(&mut self, each: &mut dyn FnMut(u64, u32)) {
        self.under_way.drain(..).for_each(|(query, samples)| each(query, samples));
        self.asked.push(Vec::new());
    }
}

/// Returns a scene of `count` boxes before the camera that looks along x, in one block of the hierarchy: box
/// `i` begins at y = i / 8.
fn row(count: usize) -> Scene {
    let mut scene = Scene::new();
    scene.insert_batch((0..count).map(|i| {
        let min = [40.0, i as f32 / 8.0, 0.0];
        Aabb::from_arrays(min, min.map(|x| x + 0.1))
    }));
    scene
}

/// Culls one frame. Returns the number of objects left.
fn cull(culler: &mut OcclusionCuller<HardwareQueries<Counting>>, scene: &Scene, view: &View) -> usize {
    let mut visible = VisibleSet::new();
    visible.fill(scene, view);
    culler.cull(scene, view, &mut visible);
    visible.count(scene)
}

fn culler(samples: Samples, late: LateAnswers) -> OcclusionCuller<HardwareQueries<Counting>> {
    OcclusionCuller::new(HardwareQueries::new(Counting::new(samples), late)).with_price(0)
}

#[test]
fn groups_are_halved_until_the_visible_box_is_found() {
    let scene = row(16);
    let mut culler = culler(|bounds| u32::from(bounds.min.y == 0.5), LateAnswers::Visible);
    let left: Vec<usize> = (0..12).map(|_| cull(&mut culler, &scene, &along_x())).collect();
    // The node above the boxes has a query of its own, as long as it is not known to be visible.
    let device = culler.map_mut().device_mut();
    let sizes: Vec<Vec<usize>> =
        (0..12).map(|frame| device.sizes(frame)).filter(|sizes| sizes != &[1]).collect();
    let groups: Vec<&[usize]> = sizes.iter().map(Vec::as_slice).filter(|sizes| !sizes.is_empty()).collect();
    assert_eq!(groups.first(), Some(&&[16][..]), "all are asked about at once: {groups:?}");
    assert!(groups.contains(&&[8, 8][..]) && groups.contains(&&[4, 4][..]), "halves: {groups:?}");
    assert!(groups.contains(&&[2, 2][..]), "quarters: {groups:?}");
    assert_eq!(left.last(), Some(&1), "objects left in each frame: {left:?}");
    assert!(left.windows(2).all(|pair| pair[1] <= pair[0]), "objects left in each frame: {left:?}");
    let queries: usize = device.asked.iter().map(Vec::len).sum();
    assert!(queries <= 16, "{queries} queries for 16 boxes and 12 frames");
}

#[test]
fn hidden_siblings_take_few_queries_each_frame() {
    let scene = row(64);
    let late = LateAnswers::Trusted { frames: 2 };
    let mut culler = culler(|bounds| u32::from(bounds.max.y > bounds.min.y + 1.0), late);
    let left: Vec<usize> = (0..20).map(|_| cull(&mut culler, &scene, &along_x())).collect();
    assert_eq!(left[19], 0, "the node is visible, its objects are not: {left:?}");
    let device = culler.map_mut().device_mut();
    for frame in 10..20 {
        let groups = device.asked[frame].iter().filter(|boxes| boxes[0].max.y < boxes[0].min.y + 1.0).count();
        assert_eq!(groups, 4, "queries of frame {frame} about 64 boxes: {:?}", device.sizes(frame));
    }
}

#[test]
fn visible_boxes_are_asked_about_in_turn() {
    let scene = row(64);
    let mut culler = culler(|_| 1, LateAnswers::Trusted { frames: 2 });
    for _ in 0..120 {
        assert_eq!(cull(&mut culler, &scene, &along_x()), 64, "objects left");
    }
    let device = culler.map_mut().device_mut();
    let late: Vec<usize> = (40..120).map(|frame| device.asked[frame].len()).collect();
    // Boxes wait for 1 to 8 frames, 4.5 on average: 14 of 65 boxes a frame.
    let mean = late.iter().sum::<usize>() as f64 / 80.0;
    assert!((11.0..18.0).contains(&mean), "queries a frame: {late:?}");
    assert!(late.iter().all(|&count| count < 30), "no frame asks about most boxes: {late:?}");
    for object in 0..64 {
        let is_asked =
            |frame: usize| device.asked[frame].iter().any(|boxes| boxes[0].min.y == object as f32 / 8.0);
        let longest = (40..112).all(|frame| (frame..frame + 8).any(is_asked));
        assert!(longest, "box {object} is asked about in any 8 frames");
    }
}

#[test]
fn few_samples_may_be_disregarded() {
    for (max_samples, is_hidden, accuracy) in [
        (0, false, Accuracy::Conservative),
        (2, false, Accuracy::Approximate),
        (3, true, Accuracy::Approximate),
    ] {
        let device = Counting::new(|_| 3);
        let mut map = HardwareQueries::new(device, LateAnswers::Visible).with_max_samples(max_samples);
        assert_eq!(map.accuracy(), accuracy, "{max_samples} samples");
        let bounds = Aabb::from_arrays([20.0, 0.0, 0.0], [21.0, 1.0, 1.0]);
        let answers = [0, 1].map(|_| {
            map.begin(&along_x(), DVec3::ZERO);
            map.flush();
            map.test_mut(&bounds) == Occlusion::Hidden
        });
        assert_eq!(answers, [false, is_hidden], "{max_samples} samples");
    }
}

#[test]
fn a_look_ahead_withholds_and_the_next_look_decides() {
    let other = super::view_from(DVec3::Y, DVec3::Y + DVec3::X);
    // For each box: whether samples pass; whether the frame ends with another view; objects left by the look
    // ahead and by the end of the frame.
    let cases: [(Samples, bool, [usize; 2]); 3] =
        [(|_| 0, false, [0, 0]), (|_| 1, false, [0, 1]), (|_| 0, true, [0, 1])];
    for (samples, is_elsewhere, expected) in cases {
        let scene = row(1);
        let mut culler = culler(samples, LateAnswers::Visible);
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &along_x());
        culler.look_ahead(&scene, &along_x(), &mut visible, 0);
        let ahead = visible.count(&scene);
        let view = if is_elsewhere { other } else { along_x() };
        let end = cull(&mut culler, &scene, &view);
        assert_eq!([ahead, end], expected, "ends with another view: {is_elsewhere}");
        // Without another look ahead, a frame of another view has no answers.
        let next = super::view_from(DVec3::Z, DVec3::Z + DVec3::X);
        assert_eq!(cull(&mut culler, &scene, &next), 1, "a frame without a look ahead");
    }
}

/// A device that hides all boxes of the queries that the test lets it answer.
#[derive(Default)]
struct OnDemand {
    asked: Vec<u64>,
    answered: Vec<u64>,
}

impl QueryDevice for OnDemand {
    fn ask(&mut self, query: u64, _: &[Aabb]) {
        self.asked.push(query);
    }

    fn answers(&mut self, each: &mut dyn FnMut(u64, u32)) {
        self.answered.drain(..).for_each(|query| each(query, 0));
    }
}

/// Begins a frame that looks along x, and tests a box.
fn test_one(map: &mut HardwareQueries<OnDemand>, bounds: &Aabb) -> Occlusion {
    map.begin(&along_x(), DVec3::ZERO);
    map.flush();
    map.test_mut(bounds)
}

#[test]
fn answers_to_queries_of_before_do_not_count() {
    type End = fn(&mut HardwareQueries<OnDemand>, &Aabb);

    let bounds = Aabb::from_arrays([20.0, 0.0, 0.0], [21.0, 1.0, 1.0]);
    let late = LateAnswers::Trusted { frames: 1000 };
    // Each case ends what the first query was about. The first answer must then not count, the second must.
    let ends: [(&str, End); 2] = [
        ("the map is reset", |map, _| map.reset()),
        ("the query is lost, and its number's slot has another", |map, bounds| {
            while map.device_mut().asked.len() < 2 {
                test_one(map, bounds);
            }
        }),
    ];
    for (name, end) in ends {
        let mut map = HardwareQueries::new(OnDemand::default(), late);
        assert_eq!(test_one(&mut map, &bounds), Occlusion::Visible, "{name}: without an answer");
        end(&mut map, &bounds);
        let first = map.device_mut().asked[0];
        map.device_mut().answered.push(first);
        assert_eq!(test_one(&mut map, &bounds), Occlusion::Visible, "{name}: the first answer");
        let second = map.device_mut().asked[1];
        map.device_mut().answered.push(second);
        assert_eq!(test_one(&mut map, &bounds), Occlusion::Hidden, "{name}: the second answer");
    }
}

#[test]
fn boxes_that_are_not_tested_are_forgotten() {
    let bounds = Aabb::from_arrays([20.0, 0.0, 0.0], [21.0, 1.0, 1.0]);
    let other = Aabb::from_arrays([30.0, 0.0, 0.0], [31.0, 1.0, 1.0]);
    for (idle, expected) in [(7, Occlusion::Hidden), (8, Occlusion::Visible), (30, Occlusion::Visible)] {
        let mut map = HardwareQueries::new(OnDemand::default(), LateAnswers::Trusted { frames: 1000 });
        for frame in 0..3 {
            test_one(&mut map, &bounds);
            let asked = map.device_mut().asked.clone();
            map.device_mut().answered.push(asked[asked.len() - 1]);
            assert!(asked.len() > frame, "a query each frame: {asked:?}");
        }
        // The answer to the last query arrives in the first idle frame.
        for _ in 0..idle {
            test_one(&mut map, &other);
        }
        assert_eq!(test_one(&mut map, &bounds), expected, "after {idle} frames without a test");
    }
}
