//! Scenes, and what was derived from them, swapped, mixed, cloned, changed, reverted and dropped under live
//! cullers.
//!
//! A culler that keeps anything must tell apart what it was made from. The harness gives live cullers one
//! source after another and holds each answer against that of a fresh culler which has never seen anything
//! else.

use crate::Random;
use std::collections::BTreeSet;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{
    Aabb, Culler, Object, ObjectId, OccluderMesh, Pose, Scene, View, VisibleSet, scene::Triangle,
};

/// How a kind of culler is made, and what it is made from besides the scene.
pub trait Swapped {
    /// The culler under test.
    type Culler: Culler;
    /// What is derived from a scene and given to the culler: sets, occluders, a hierarchy. Empty for a culler
    /// that needs a scene alone.
    type Source: Clone;

    /// Makes a source from a scene as it is now.
    fn derive(&self, scene: &Scene, rng: &mut Random) -> Self::Source;

    /// A culler that has seen no scene.
    fn make(&self, source: &Self::Source) -> Self::Culler;

    /// Gives a source to a culler, and lets it take in what changed in the scene.
    fn give(&self, culler: &mut Self::Culler, source: &Self::Source, scene: &Scene);

    /// A culler that knows all that can be known: what it sees must not be hidden.
    fn truth(&self, source: &Self::Source) -> Self::Culler {
        self.make(source)
    }

    /// Whether a culler that was just given its source answers as a fresh one, whatever it has seen before.
    fn is_free_of_memory(&self) -> bool {
        true
    }
}

/// Goes through random swaps. Returns how many objects live cullers have hidden.
pub fn hold_against_fresh<S: Swapped>(kind: &S, seed: u64, frames: usize) -> usize {
    let mut rng = Random(seed);
    let mut scenes: Vec<Scene> = (0..3).map(|_| scene(&mut rng)).collect();
    scenes.push(scenes[0].clone());
    let mut sources: Vec<S::Source> = scenes.iter().map(|scene| kind.derive(scene, &mut rng)).collect();
    let mut given = sources[0].clone();
    let (mut live, mut visible) = (kind.make(&given), VisibleSet::with_changes());
    let (mut at, mut hidden) = (0, 0);
    let views: Vec<View> = (0..6).map(|_| view(&mut rng)).collect();
    for frame in 0..frames {
        let other = rng.below(scenes.len());
        match rng.below(16) {
            // A change under the culler, and one that is taken back.
            0..5 => change(&mut scenes[at], &mut rng),
            5 => change_and_revert(&mut scenes[at], &mut rng),
            6 => change(&mut scenes[other], &mut rng),
            // A level that is loaded again in the place of one that is dropped; one that is undone to a copy.
            7 => scenes[other] = scene(&mut rng),
            8 => scenes[other] = scenes[at].clone(),
            9 => scenes.swap(at, other),
            10 => sources[other] = sources[at].clone(),
            11 => sources[other] = kind.derive(&scenes[other], &mut rng),
            12 => scenes[at].rebuild(),
            _ => {}
        }
        if rng.one_in(3) {
            at = other;
        }
        let is_given = !rng.one_in(4);
        if is_given {
            // Now and then what was made from another scene.
            let from = if rng.one_in(5) { other } else { at };
            if rng.one_in(2) {
                sources[from] = kind.derive(&scenes[from], &mut rng);
            }
            given = sources[from].clone();
            kind.give(&mut live, &given, &scenes[at]);
        }
        let (scene, view) = (&scenes[at], &views[rng.below(views.len())]);
        let seen = cull(&mut live, scene, view, &mut visible);
        let fresh = |mut culler: S::Culler| {
            kind.give(&mut culler, &given, scene);
            cull(&mut culler, scene, view, &mut VisibleSet::new())
        };
        let truth = fresh(kind.truth(&given));
        let lost: Vec<_> = truth.difference(&seen).collect();
        assert!(lost.is_empty(), "seed {seed}, frame {frame}: {} hides {lost:?}", live.name());
        if is_given && kind.is_free_of_memory() {
            let fresh = fresh(kind.make(&given));
            let more: Vec<_> = seen.symmetric_difference(&fresh).collect();
            assert!(more.is_empty(), "seed {seed}, frame {frame}: {} differs in {more:?}", live.name());
        }
        hidden += scene.len() - seen.len();
    }
    hidden
}

fn cull(
    culler: &mut impl Culler,
    scene: &Scene,
    view: &View,
    visible: &mut VisibleSet,
) -> BTreeSet<ObjectId> {
    visible.fill(scene, view);
    culler.cull(scene, view, visible);
    visible.finish(scene);
    visible.iter(scene).collect()
}

fn view(rng: &mut Random) -> View {
    let eye = rng.vector(12.0);
    View::perspective(Pose::look_at(eye, rng.vector(3.0), DVec3::Z), 1.2, 1.5, 0.1, 1e3).unwrap()
}

/// Some 150 objects about the origin with a triangle each, and ten walls that hide with boxes. All such
/// scenes have the same ids.
pub fn scene(rng: &mut Random) -> Scene {
    let mut scene = Scene::new();
    for _ in 0..150 {
        let triangle = random_triangle(rng);
        let id = scene.insert(Aabb::from_points(triangle));
        scene.set_triangles(id, [triangle]).unwrap();
    }
    for _ in 0..10 {
        let wall = random_wall(rng);
        let id = scene.insert(Object { occluder: true, ..Object::new(wall) });
        give_mesh(&mut scene, id, &wall);
    }
    scene
}

fn random_triangle(rng: &mut Random) -> Triangle {
    let at = rng.vector(15.0);
    core::array::from_fn(|_| (at + rng.vector(1.0)).as_vec3())
}

fn random_wall(rng: &mut Random) -> Aabb {
    let at = rng.vector(8.0).as_vec3();
    let half = *[Vec3::new(0.2, 4.0, 4.0), Vec3::new(4.0, 0.2, 4.0)].get(rng.below(2)).unwrap();
    Aabb::new(at - half, at + half)
}

fn give_mesh(scene: &mut Scene, id: ObjectId, bounds: &Aabb) {
    let mesh = scene.add_mesh(OccluderMesh::cuboid(bounds).unwrap());
    scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
}

fn change(scene: &mut Scene, rng: &mut Random) {
    let ids: Vec<_> = scene.ids().collect();
    for _ in 0..rng.below(4) {
        let id = ids[rng.below(ids.len())];
        if !scene.contains(id) {
            continue;
        }
        match rng.below(8) {
            0 => {
                // The index is used again.
                scene.remove(id).unwrap();
                scene.insert(Aabb::from_points(random_triangle(rng)));
            }
            1 => {
                // Turned round where it is.
                let turned: Vec<_> =
                    scene.triangles(id).unwrap().iter().map(|[a, b, c]| [*a, *c, *b]).collect();
                scene.set_triangles(id, turned).unwrap();
            }
            2 => scene.set_layers(id, rng.pick(&[0, 1, u32::MAX])).unwrap(),
            3 => scene.set_never_cull(id, rng.one_in(2)).unwrap(),
            4 => scene.set_origin(rng.vector(1.0)).unwrap(),
            _ if scene.has_mesh(id) => {
                let wall = random_wall(rng);
                scene.set_occluder(id, !rng.one_in(4)).unwrap();
                scene.set_bounds(id, wall).unwrap();
                give_mesh(scene, id, &wall);
            }
            _ => {
                let triangle = random_triangle(rng);
                scene.set_bounds(id, Aabb::from_points(triangle)).unwrap();
                scene.set_triangles(id, [triangle]).unwrap();
            }
        }
    }
    scene.maintain(rng.below(4));
}

fn change_and_revert(scene: &mut Scene, rng: &mut Random) {
    let ids: Vec<_> = scene.ids().collect();
    let id = ids[rng.below(ids.len())];
    let (bounds, triangles) = (scene.bounds(id).unwrap(), scene.triangles(id).unwrap().to_vec());
    let other = random_triangle(rng);
    scene.set_bounds(id, Aabb::from_points(other)).unwrap();
    scene.set_triangles(id, [other]).unwrap();
    scene.set_bounds(id, bounds).unwrap();
    scene.set_triangles(id, triangles).unwrap();
}
