//! Spans of `tracing`: a subscriber gets one for each frame, stage, round, item and stage of a viewcell, with
//! the counts that the calls return.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::{Mutex, MutexGuard, Once, PoisonError};
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Metadata, Subscriber};
use visibility_culling::bake::{Bake, SandwichBaker, SandwichSettings};
use visibility_culling::glam::{Affine3A, DVec3, Vec3};
use visibility_culling::hzb::{Hzb, HzbCuller};
use visibility_culling::pvs::{Viewcell, Viewcells};
use visibility_culling::view::Reach;
use visibility_culling::{
    Aabb, Accuracy, CullStats, Culler, FrustumCuller, Object, OccluderMesh, Pipeline, Pose, Scene, View,
    VisibleSet,
};

/// A span that was opened: its name, the number of its parent, and its fields as text.
#[derive(Clone, Debug, Default)]
struct Opened {
    name: &'static str,
    parent: Option<usize>,
    fields: BTreeMap<&'static str, String>,
}

impl Opened {
    fn number(&self, field: &str) -> Option<u64> {
        self.fields.get(field)?.parse().ok()
    }
}

impl Visit for Opened {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        self.fields.insert(field.name(), format!("{value:?}"));
    }
}

/// Spans in the order in which they were opened, on all threads. The id of a span is its number plus 1.
static OPENED: Mutex<Vec<Opened>> = Mutex::new(Vec::new());

thread_local! {
    /// Ids of the spans that this thread is in, outermost first.
    static ENTERED: RefCell<Vec<u64>> = const { RefCell::new(Vec::new()) };
}

struct Recorder;

fn opened() -> MutexGuard<'static, Vec<Opened>> {
    OPENED.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Subscriber for Recorder {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target() == "visibility"
    }

    fn new_span(&self, attributes: &Attributes<'_>) -> Id {
        let current = ENTERED.with_borrow(|entered| entered.last().copied());
        let parent = attributes.parent().map(Id::into_u64).or(current).map(|id| id as usize - 1);
        let mut span = Opened { name: attributes.metadata().name(), parent, ..Opened::default() };
        attributes.record(&mut span);
        let mut all = opened();
        all.push(span);
        Id::from_u64(all.len() as u64)
    }

    fn record(&self, id: &Id, values: &Record<'_>) {
        values.record(&mut opened()[id.into_u64() as usize - 1]);
    }

    fn enter(&self, id: &Id) {
        ENTERED.with_borrow_mut(|entered| entered.push(id.into_u64()));
    }

    fn exit(&self, _: &Id) {
        ENTERED.with_borrow_mut(|entered| entered.pop());
    }

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, _: &Event<'_>) {}
}

/// Records the spans of all threads from now on. The tests of this file have spans of different names.
fn record() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| tracing::subscriber::set_global_default(Recorder).expect("the only subscriber"));
}

/// Returns the recorded spans of a name with their numbers.
fn spans(name: &str) -> Vec<(usize, Opened)> {
    opened().iter().cloned().enumerate().filter(|(_, span)| span.name == name).collect()
}

/// A culler that keeps all objects and counts what no culler counts.
struct Counter;

impl Culler for Counter {
    fn name(&self) -> &str {
        "counter"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn cull(&mut self, _: &Scene, _: &View, _: &mut VisibleSet) -> CullStats {
        CullStats::default().with_nodes(11).with_tests(22).with_visible(33)
    }
}

#[test]
fn frames_and_stages_are_recorded() {
    record();
    let mut scene = Scene::new();
    let bounds = Aabb::from_arrays([5.0, -4.0, -4.0], [5.5, 4.0, 4.0]);
    let wall = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).expect("a cuboid"));
    scene.set_mesh(wall, mesh, Affine3A::IDENTITY).expect("a wall");
    scene.insert_batch(
        (0..9).map(|i| Aabb::from_arrays([8.0 + i as f32, -1.0, -1.0], [9.0 + i as f32, 1.0, 1.0])),
    );
    scene.insert(Aabb::from_arrays([-6.0, -1.0, -1.0], [-5.0, 1.0, 1.0]));
    let mut pipeline = Pipeline::new()
        .with(FrustumCuller::new())
        .with(HzbCuller::new(Hzb::new(64, 64).expect("a small map")))
        .with_reach(Some(Reach::new(0.0, 0.0)));
    let mut visible = VisibleSet::new();
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.25, f64::INFINITY).expect("a camera");
    pipeline.cull(&scene, &view, &mut visible);
    let stages: Vec<(String, CullStats)> =
        pipeline.stages().map(|(name, stats)| (name.to_owned(), stats)).collect();
    assert!(
        stages[1].1.occluders > 0 && stages[0].1.visible == 10,
        "the scene has work for both: {stages:?}"
    );
    while !pipeline.is_kept() {
        pipeline.cull(&scene, &view, &mut visible);
    }
    let frames = spans("cull");
    let (first, last) = (&frames[0], &frames[frames.len() - 1]);
    let results = [first, last].map(|(_, frame)| (frame.fields["kept"].as_str(), frame.number("visible")));
    assert_eq!(results, [("false", Some(1)), ("true", Some(1))], "the first frame and the one that was kept");
    let recorded = spans("stage");
    let of = |frame: usize| recorded.iter().filter(move |(_, stage)| stage.parent == Some(frame));
    assert_eq!(of(last.0).count(), 0, "stages of a frame that keeps its answer");
    assert_eq!(of(first.0).count(), 2, "stages of the first frame");
    for ((_, span), (name, stats)) in of(first.0).zip(stages) {
        assert_eq!(span.fields["name"], format!("{name:?}"), "the name of a stage");
        let counts = ["nodes", "accepted_subtrees", "tests", "occluders", "visible"];
        let expected = [stats.nodes, stats.accepted_subtrees, stats.tests, stats.occluders, stats.visible];
        assert_eq!(counts.map(|field| span.number(field)), expected.map(Some), "the counts of {name}");
    }
    Pipeline::new().with(Counter).cull(&scene, &view, &mut visible);
    let counter = spans("stage").into_iter().find(|(_, span)| span.fields["name"] == "\"counter\"");
    let (_, counter) = counter.expect("a span of the last stage");
    let counts = ["nodes", "tests", "occluders", "visible"].map(|field| counter.number(field));
    assert_eq!(counts, [11, 22, 0, 33].map(Some), "the counts of a stage that makes them up");
}

#[test]
fn rounds_and_viewcells_are_recorded() {
    record();
    // A wall, a plate before it and one behind it, in triangles.
    let square = |x: f32, r: f32| {
        let [a, b, c, d] = [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(y, z)| Vec3::new(x, y, z));
        [[a, b, c], [a, c, d]]
    };
    let mut scene = Scene::new();
    for triangles in [square(5.0, 10.0), square(4.0, 1.0), square(9.0, 1.0)] {
        let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, triangles).expect("triangles in the bounds");
    }
    let cell = |at: f64| Viewcell::from_box(DVec3::new(0.0, at, 0.0), DVec3::new(1.0, at + 1.0, 1.0));
    let cells = Viewcells::new((0..7).map(|at| cell(f64::from(at))));
    let mut bake = Bake::new(SandwichBaker::new(&scene, &cells, SandwichSettings::default().with_gap(0.0)));
    let mut progress = Vec::new();
    while let Some(after) = bake.advance() {
        progress.push(after);
    }
    let outcome = bake.finish();
    let rounds = spans("bake_round");
    assert_eq!(rounds.len(), progress.len(), "one span for each round");
    let mut done = 0;
    for ((number, round), after) in rounds.iter().zip(&progress) {
        let counts = ["done", "total", "steps"].map(|field| round.number(field));
        assert_eq!(counts, [after.done as u64, after.total as u64, after.steps].map(Some), "round {number}");
        let items: Vec<u64> = spans("bake_item")
            .iter()
            .filter(|(_, item)| item.parent == Some(*number))
            .filter_map(|(_, item)| item.number("item"))
            .collect();
        assert_eq!(items.len(), after.done - done, "items of round {number}");
        assert_eq!(round.number("items"), Some(items.len() as u64), "the count of items of round {number}");
        done = after.done;
    }
    let steps = spans("viewcell");
    let items = spans("bake_item");
    assert!(
        steps.iter().all(|(_, step)| items.iter().any(|(item, _)| Some(*item) == step.parent)),
        "{steps:?}"
    );
    for (number, cell) in outcome.cells.iter().enumerate() {
        let of_cell = steps.iter().rfind(|(_, step)| step.number("viewcell") == Some(number as u64));
        let (_, last) = of_cell.expect("a span of the viewcell");
        let counts = ["swept", "seen", "proven", "open", "steps"].map(|field| last.number(field));
        let expected =
            [cell.swept.into(), cell.seen.len() as u64, cell.proven.into(), cell.open.len() as u64];
        let expected = [expected[0], expected[1], expected[2], expected[3], cell.steps];
        assert_eq!(counts, expected.map(Some), "the counts of the last stage of viewcell {number}");
    }
    let first = steps.iter().find(|(_, step)| step.number("viewcell") == Some(0));
    assert_eq!(
        first.map(|(_, step)| step.fields["stage"].as_str()),
        Some("\"group sweep\""),
        "the first stage"
    );
    let seen: u64 = outcome.cells.iter().map(|cell| cell.seen.len() as u64).sum();
    assert_eq!(seen, 14, "wall and near plate are seen from each of seven viewcells");
}
