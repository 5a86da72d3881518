//! Tests of BSP trees of whole scenes: the trees have bounded size. Naylor's exact culling reports every
//! object that an item buffer of 2560 x 1440 sees, and every other reported object is visible at its witness
//! point.

use crate::shared_scenes::scene;
use glam::{DMat4, DQuat, DVec3};
use std::collections::HashSet;
use visibility_bsp::{BspOrderCuller, NaylorCuller, SceneTree, VisiblePoint};
use visibility_core::{Culler, ObjectId, View, VisibleSet};
use visibility_examples::walkthrough::World;
use visibility_examples::{SceneSource, built_in};
use visibility_measure::{Comparison, ItemBuffer};

/// Width and height in pixels of the item buffer that judges the culler.
const JUDGE: (u32, u32) = (2560, 1440);

/// Returns a view zoomed in on a witness of visibility: the witness is at the centre, and its width fills 0.3
/// of half the picture.
fn close_up(view: &View, world: &World, witness: VisiblePoint) -> View {
    let scale = 0.3 / witness.width;
    let shift = DVec3::new(-witness.x * scale, -witness.y * scale, 0.0);
    let zoom = DMat4::from_scale_rotation_translation(DVec3::new(scale, scale, 1.0), DQuat::IDENTITY, shift);
    let matrix = zoom * view.clip_from(world.origin());
    View::from_clip_from_world(matrix, view.depth()).unwrap().relative_to(world.origin()).unwrap()
}

/// Counts of the reasons why an object is reported that has no pixel in the item buffer.
#[derive(Default, Debug, PartialEq)]
struct Reasons {
    /// Number of objects that are the nearest of all objects at a position between the pixels.
    between_pixels: usize,
    /// Number of objects that are the nearest once non-opaque objects are left out.
    behind_glass: usize,
    /// Number of objects that tie in depth with the object that the item buffer shows.
    in_one_plane: usize,
    /// Number of objects without a witness: they have no triangle, or an invalid one.
    unknown: usize,
    /// Number of objects with none of these reasons. Each such object is an error of the culler.
    wrong: usize,
}

/// Finds the reason why the object `id` is reported although the item buffer does not show it, and counts the
/// reason in `reasons`.
fn explain(
    world: &World,
    view: &View,
    culler: &NaylorCuller<&SceneTree>,
    id: ObjectId,
    reasons: &mut Reasons,
) {
    let Some(witness) = culler.witness(id) else {
        reasons.unknown += 1;
        return;
    };
    let key = id.index() as u32;
    let mut crop = ItemBuffer::new(63, 63).unwrap();
    let close = close_up(view, world, witness);
    let is_opaque = |key: u32| world.source.objects[key as usize].opaque;
    let own = world.items().nth(id.index()).unwrap();
    let mut shows = |glass: bool| {
        let others = world.items().filter(|of| of.key != key && (glass || is_opaque(of.key)));
        let exact = crop.draw(&close, world.origin(), others.chain([own])).unwrap();
        *exact.objects().last().unwrap()
    };
    match () {
        () if shows(true).pixels > 0 => reasons.between_pixels += 1,
        () if shows(false).pixels > 0 => reasons.behind_glass += 1,
        () if shows(false).is_visible() || is_tied(world, view, id, witness) => reasons.in_one_plane += 1,
        () => reasons.wrong += 1,
    }
}

/// Tests whether the object is, on the view ray through the witness, no farther than the nearest opaque
/// surface of another object, up to the rounding of the scene's f32 coordinates.
fn is_tied(world: &World, view: &View, id: ObjectId, witness: VisiblePoint) -> bool {
    let inverse = view.clip_from(world.origin()).inverse();
    let [near, far] = [0.9, 0.1].map(|depth| inverse.project_point3(DVec3::new(witness.x, witness.y, depth)));
    let direction = far - near;
    let depth = |key: u32| {
        let hits = world.source.objects[key as usize].triangles.iter().filter_map(|triangle| {
            let [a, b, c] = triangle.map(|v| v.as_dvec3());
            let normal = (b - a).cross(c - a);
            let t = normal.dot(a - near) / normal.dot(direction);
            let p = near + direction * t;
            let inside =
                [(a, b), (b, c), (c, a)].iter().all(|&(a, b)| (b - a).cross(p - a).dot(normal) >= 0.0);
            (inside && t.is_finite()).then_some(t * direction.length())
        });
        hits.filter(|t| *t > 0.0).fold(f64::INFINITY, f64::min)
    };
    let own = depth(id.index() as u32);
    let least = world
        .items()
        .map(|of| of.key)
        .filter(|&key| key != id.index() as u32 && world.source.objects[key as usize].opaque)
        .map(depth)
        .fold(f64::INFINITY, f64::min);
    own.is_finite() && own <= least + 1e-5 * own.max(1.0)
}

/// Compares exact culling with the item buffer in up to `frames` frames of a scene, and fails on a false
/// hidden object or an unexplained reported object.
fn check(source: SceneSource, frames: usize) {
    let keys = source.walks.iter().map(|walk| walk.keys.len()).sum();
    let world = World::new(source, JUDGE, Some(frames.min(keys))).unwrap();
    let tree = SceneTree::new(&world.scene).unwrap();
    let mut culler = NaylorCuller::new(&tree);
    let mut order = BspOrderCuller::new(&tree);
    let mut buffer = ItemBuffer::new(JUDGE.0, JUDGE.1).unwrap();
    let (mut set, mut in_view) = (VisibleSet::new(), VisibleSet::new());
    let mut comparison = Comparison::default();
    let (mut seen_sum, mut reported_sum, mut tied_sum, mut reasons) = (0, 0, 0, Reasons::default());
    for (frame, view) in world.views.iter().enumerate() {
        set.fill(&world.scene, view);
        culler.cull(&world.scene, view, &mut set);
        in_view.fill(&world.scene, view);
        order.cull(&world.scene, view, &mut in_view);
        let exact = buffer.draw(view, world.origin(), world.items()).unwrap();
        let seen: HashSet<u32> =
            exact.objects().iter().filter(|object| object.is_visible()).map(|object| object.key).collect();
        let reported: Vec<ObjectId> = set.iter(&world.scene).collect();
        let keys: HashSet<u32> = reported.iter().map(|id| id.index() as u32).collect();
        exact.compare(|_, key| keys.contains(&key), &mut comparison);
        let hidden = &comparison.false_hidden_keys;
        assert!(hidden.is_empty(), "{}, frame {frame}: {hidden:?} hidden", world.source.name);
        tied_sum += comparison.tied_hidden_objects;
        assert!(
            reported.iter().all(|&id| in_view.contains(&world.scene, id)),
            "frame {frame}: a reported object is out of view"
        );
        for &id in reported.iter().filter(|id| !seen.contains(&(id.index() as u32))) {
            explain(&world, view, &culler, id, &mut reasons);
        }
        seen_sum += seen.len();
        reported_sum += reported.len();
    }
    let name = &world.source.name;
    println!(
        "{name}: {seen_sum} seen, {tied_sum} of them hidden in ties; {reported_sum} reported, the others: {reasons:?}"
    );
    assert_eq!(reasons.wrong, 0, "{}: {reasons:?}", world.source.name);
}

#[test]
fn exact_culling_is_exact_in_built_in_scenes() {
    for name in ["town", "office", "london"] {
        check(built_in(name).unwrap(), 3);
    }
}

#[test]
#[ignore = "more frames, and forests: minutes"]
fn exact_culling_is_exact_in_all_built_in_scenes() {
    for name in ["town", "office", "london", "plpcity", "forest"] {
        check(built_in(name).unwrap(), 9);
    }
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn exact_culling_is_exact_in_an_arena() {
    check(scene("oa_dm2"), 12);
}

#[test]
#[ignore = "large scenes: minutes"]
fn exact_culling_is_exact_in_all_reference_scenes() {
    for name in ["clinic", "denhaag", "alpine1", "oa_dm2"] {
        check(scene(name), 9);
    }
    check(scene("cars5"), 3);
    check(scene("clinic and its pipes"), 9);
}

#[test]
#[ignore = "every frame of the walks: minutes"]
fn exact_culling_is_exact_along_the_walks() {
    for name in ["plpcity", "office", "london"] {
        check(built_in(name).unwrap(), usize::MAX);
    }
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn an_arena_is_cut_into_few_fragments() {
    let world = World::new(scene("oa_dm2"), (64, 36), Some(1)).unwrap();
    let triangles: usize = world.items().map(|of| of.triangles.len()).sum();
    let tree = SceneTree::new(&world.scene).unwrap();
    let (fragments, nodes) = (tree.tree().fragment_count(), tree.tree().node_count());
    println!("{triangles} triangles, {fragments} fragments, {nodes} nodes, {} levels", tree.tree().depth());
    assert_eq!(triangles, 11_917, "triangles of the arena");
    assert!(fragments <= 3 * triangles, "{fragments} fragments of {triangles} triangles");
}

#[test]
#[ignore = "a million triangles: half a minute"]
fn a_town_of_a_million_triangles_has_a_tree() {
    let world = World::new(built_in("town:8").unwrap(), (64, 36), Some(1)).unwrap();
    let start = std::time::Instant::now();
    let tree = SceneTree::new(&world.scene).unwrap();
    println!("{} fragments, {:.1} s", tree.tree().fragment_count(), start.elapsed().as_secs_f64());
    assert!(tree.tree().fragment_count() > 1_027_034, "fragments of the town");
}
