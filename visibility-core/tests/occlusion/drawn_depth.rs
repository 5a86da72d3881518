//! Tests of hardware queries over a simulated card whose depth buffer holds what the engine has drawn, and
//! nothing else. The expected results follow from the positions of two boxes, one of which hides the other.

use super::along_x;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::occlusion::{HardwareQueries, LateAnswers, Occlusion, QueryDevice};
use visibility_core::{Aabb, Culler, ObjectId, OccluderMesh, OcclusionCuller, OcclusionMap};
use visibility_core::{Scene, View, VisibleSet};
use visibility_testing::PlainMap;

/// Number of frames after which each group of boxes is down to one box, and all answers have arrived.
const SETTLING: usize = 16;

/// Graphics card whose queries see what was drawn before [`submit`](Self::submit).
struct Card {
    depth: PlainMap,
    /// Number of submissions from a query's own to the one before its answer is delivered, at least 1.
    latency: u64,
    submitted: u64,
    asked: Vec<(u64, Vec<Aabb>)>,
    /// Submission, number and passed samples of each query that is answered and not delivered.
    under_way: Vec<(u64, u64, u32)>,
    /// Boxes of the last submission.
    boxes_of_last: Vec<Aabb>,
    /// Whether the next submission is lost.
    loses_next: bool,
}

impl Card {
    fn draw(&mut self, bounds: &Aabb) {
        self.depth.add(&OccluderMesh::cuboid(bounds).unwrap(), &Affine3A::IDENTITY);
    }

    fn submit(&mut self) {
        self.depth.flush();
        self.submitted += 1;
        self.boxes_of_last = self.asked.iter().flat_map(|(_, boxes)| boxes.clone()).collect();
        let is_lost = std::mem::take(&mut self.loses_next);
        for (query, boxes) in self.asked.drain(..).filter(|_| !is_lost) {
            let passed = boxes.iter().filter(|bounds| self.depth.test(bounds) != Occlusion::Hidden).count();
            self.under_way.push((self.submitted, query, passed as u32));
        }
    }
}

impl QueryDevice for Card {
    fn ask(&mut self, query: u64, boxes: &[Aabb]) {
        self.asked.push((query, boxes.to_vec()));
    }

    fn answers(&mut self, each: &mut dyn FnMut(u64, u32)) {
        let due = (self.submitted + 1).saturating_sub(self.latency);
        self.under_way.retain(|&(submission, query, passed)| {
            if submission <= due {
                each(query, passed);
            }
            submission > due
        });
    }
}

/// An engine that draws what its culler leaves: a wall, a box behind the wall, and a box beside.
struct Engine {
    scene: Scene,
    view: View,
    culler: OcclusionCuller<HardwareQueries<Card>>,
    wall: ObjectId,
    behind: ObjectId,
    /// Whether the engine takes the wall out of the set by hand.
    leaves_out_wall: bool,
    drawn: Vec<ObjectId>,
}

impl Engine {
    fn new(latency: u64) -> Self {
        let mut scene = Scene::new();
        let wall = scene.insert(Aabb::from_arrays([10.0, -4.0, -4.0], [10.5, 4.0, 4.0]));
        let behind = scene.insert(Aabb::from_arrays([20.0, -0.2, -0.2], [20.4, 0.2, 0.2]));
        scene.insert(Aabb::from_arrays([12.0, 7.0, -0.2], [12.4, 7.4, 0.2]));
        let card = Card {
            depth: PlainMap::new(32, 20),
            latency,
            submitted: 0,
            asked: Vec::new(),
            under_way: Vec::new(),
            boxes_of_last: Vec::new(),
            loses_next: false,
        };
        let culler = OcclusionCuller::new(HardwareQueries::new(card, LateAnswers::Visible)).with_price(0);
        Self { scene, view: along_x(), culler, wall, behind, leaves_out_wall: false, drawn: Vec::new() }
    }

    fn begin(&mut self) {
        let card = self.culler.map_mut().device_mut();
        card.depth.begin(&self.view, self.scene.origin());
        self.drawn.clear();
    }

    /// Culls, and draws what is left and was not drawn in this frame. `look`: number of the look ahead.
    fn look(&mut self, look: Option<u32>) {
        let Self { scene, view, culler, drawn, .. } = self;
        let mut visible = VisibleSet::new();
        visible.fill(scene, view);
        if self.leaves_out_wall {
            let wall = self.wall;
            visible.retain(scene, |id, _| id != wall);
        }
        match look {
            Some(look) => culler.look_ahead(scene, view, &mut visible, look),
            None => culler.cull(scene, view, &mut visible),
        };
        let card = culler.map_mut().device_mut();
        for id in visible.iter(scene) {
            if !drawn.contains(&id) {
                drawn.push(id);
                card.draw(&scene.bounds(id).unwrap());
            }
        }
        card.submit();
    }

    /// Draws a frame with `looks` looks ahead. Returns whether it drew the box behind the wall.
    fn frame(&mut self, looks: u32) -> bool {
        self.begin();
        (0..looks).for_each(|look| self.look(Some(look)));
        self.look(None);
        self.drawn.contains(&self.behind)
    }

    fn set_wall(&mut self, y: f32) {
        let bounds = Aabb::from_arrays([10.0, y - 4.0, -4.0], [10.5, y + 4.0, 4.0]);
        self.scene.set_bounds(self.wall, bounds).unwrap();
    }
}

type Change = fn(&mut Engine);

/// Changes between two frames that bring the box behind the wall into view.
const CHANGES: [(&str, Change); 6] = [
    ("the wall moves", |engine| engine.set_wall(-20.0)),
    ("the wall is removed", |engine| engine.scene.remove(engine.wall).unwrap()),
    ("the wall leaves the layers of the view", |engine| engine.scene.set_layers(engine.wall, 0).unwrap()),
    ("the scene is replaced by a copy without the wall", |engine| {
        engine.scene = engine.scene.clone();
        engine.scene.remove(engine.wall).unwrap();
    }),
    ("the engine leaves the wall out, and says so", |engine| {
        engine.leaves_out_wall = true;
        engine.culler.map_mut().invalidate();
    }),
    // The box is at y / x = 0.45, and the wall begins at 0.5.
    ("the origin moves", |engine| {
        engine.scene.set_origin(DVec3::Y * 9.0).unwrap();
    }),
];

#[test]
fn a_still_camera_sees_every_change_between_frames() {
    for (name, change) in CHANGES {
        for (looks, latency) in [(0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (2, 1), (2, 2)] {
            let case = format!("{name}, {looks} looks ahead, answers after {latency} looks");
            let mut engine = Engine::new(latency);
            let before: Vec<bool> = (0..SETTLING).map(|_| engine.frame(looks)).collect();
            // Answers that miss the looks of their frame do not count in the next.
            let is_too_late = looks > 0 && latency > u64::from(looks);
            assert_eq!(before[SETTLING - 1], is_too_late, "{case}: the hidden box is drawn: {before:?}");
            change(&mut engine);
            let after: Vec<bool> = (0..SETTLING).map(|_| engine.frame(looks)).collect();
            assert_eq!(after, [true; SETTLING], "{case}: the box in view is drawn");
        }
    }
}

#[test]
fn a_frame_that_looks_ahead_uses_its_own_answers_alone() {
    for looks in [1, 2] {
        let mut engine = Engine::new(1);
        (0..SETTLING).for_each(|_| _ = engine.frame(looks));
        assert!(!engine.frame(looks), "{looks} looks ahead: the hidden box is drawn");
        // The map is told nothing.
        engine.leaves_out_wall = true;
        assert!(engine.frame(looks), "{looks} looks ahead: the wall is no longer drawn");
        engine.leaves_out_wall = false;
        (0..SETTLING).for_each(|_| _ = engine.frame(looks));
        assert!(!engine.frame(looks), "{looks} looks ahead: the wall is drawn again");
    }
}

#[test]
fn a_frame_may_change_or_fail_between_its_looks() {
    for (name, change) in CHANGES {
        // The frame goes on after its first look.
        let mut engine = Engine::new(1);
        (0..SETTLING).for_each(|_| _ = engine.frame(1));
        engine.begin();
        engine.look(Some(0));
        let new = Aabb::from_arrays([30.0, -0.2, -0.2], [30.4, 0.2, 0.2]);
        let answer = engine.culler.map().test(&new);
        assert_eq!(answer, Occlusion::Visible, "a box without an answer, when the look ahead is over");
        change(&mut engine);
        engine.look(None);
        assert!(engine.drawn.contains(&engine.behind), "{name} after a look ahead");
    }
    for looks in [0, 1, 2] {
        // The frame is abandoned after its first look, and another begins.
        let mut engine = Engine::new(1);
        (0..SETTLING).for_each(|_| _ = engine.frame(looks));
        engine.begin();
        engine.look(Some(0));
        engine.leaves_out_wall = true;
        if looks == 0 {
            engine.culler.map_mut().invalidate();
        }
        assert!(engine.frame(looks), "a frame with {looks} looks ahead after an abandoned frame");
    }
    // The queries of the first look are lost, and the wall moves before it.
    for moves in [false, true] {
        let mut engine = Engine::new(1);
        (0..SETTLING).for_each(|_| _ = engine.frame(1));
        assert!(!engine.frame(1), "the hidden box is drawn");
        if moves {
            engine.set_wall(-20.0);
        }
        engine.culler.map_mut().device_mut().loses_next = true;
        assert!(engine.frame(1), "queries lost, the wall moves: {moves}");
        let later: Vec<bool> = (0..100).map(|_| engine.frame(1)).collect();
        assert_eq!(later[99], moves, "100 frames after queries were lost, the wall moves: {moves}");
        assert!(!moves || later.iter().all(|&is_drawn| is_drawn), "the box in view is drawn: {later:?}");
    }
}

#[test]
fn a_second_look_ahead_asks_only_about_what_the_first_left_open() {
    let mut engine = Engine::new(1);
    (0..SETTLING).for_each(|_| _ = engine.frame(2));
    let hidden = engine.scene.bounds(engine.behind).unwrap();
    engine.begin();
    let asks = [0, 1].map(|look| {
        engine.look(Some(look));
        engine.culler.map_mut().device_mut().boxes_of_last.contains(&hidden)
    });
    assert_eq!(asks, [true, false], "looks that ask about the hidden box");
}

#[test]
fn a_still_camera_sees_every_change_of_the_candidates() {
    for latency in 1..=3 {
        let mut engine = Engine::new(latency);
        for round in 0..2 {
            let hidden: Vec<bool> = (0..SETTLING).map(|_| engine.frame(0)).collect();
            let case = format!("round {round}, answers after {latency} looks");
            assert!(!hidden[SETTLING - 1], "{case}: the hidden box is drawn: {hidden:?}");
            // An earlier stage removes the wall. The map is told nothing.
            engine.leaves_out_wall = true;
            let shown: Vec<bool> = (0..SETTLING).map(|_| engine.frame(0)).collect();
            assert_eq!(shown, [true; SETTLING], "{case}: the box in view is drawn");
            engine.leaves_out_wall = false;
        }
        // Another layout of the same objects costs some frames, and hides again.
        engine.scene.rebuild();
        let hidden: Vec<bool> = (0..SETTLING).map(|_| engine.frame(0)).collect();
        assert!(!hidden[SETTLING - 1], "after a rebuild, the hidden box is drawn: {hidden:?}");
    }
}

/// What a look at a frame left was drawn in that frame alone.
#[test]
fn candidates_that_change_between_looks_are_others_in_the_next_frame() {
    for looks in [1, 2] {
        let mut engine = Engine::new(1);
        (0..SETTLING).for_each(|_| _ = engine.frame(looks));
        engine.begin();
        (0..looks).for_each(|look| engine.look(Some(look)));
        // An earlier stage removes the wall, which has been drawn.
        engine.leaves_out_wall = true;
        engine.look(None);
        assert!(!engine.drawn.contains(&engine.behind), "{looks} looks ahead: hidden by the wall");
        let later: Vec<bool> = (0..SETTLING).map(|_| engine.frame(0)).collect();
        assert_eq!(later, [true; SETTLING], "{looks} looks ahead: frames without the wall");
        engine.leaves_out_wall = false;
        let hidden: Vec<bool> = (0..SETTLING).map(|_| engine.frame(0)).collect();
        assert!(!hidden[SETTLING - 1], "{looks} looks ahead: the wall is drawn again: {hidden:?}");
    }
}
