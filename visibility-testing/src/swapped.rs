//! Test harness that swaps, mixes, clones, changes, reverts and drops scenes, and the data derived from them,
//! under live cullers.
//!
//! A culler that keeps state between frames must recognise when the state no longer fits its inputs. The
//! harness gives live cullers one source after another and compares each answer with that of a fresh culler
//! that has seen no other source.

use crate::Random;
use crate::slabs::misses;
use std::collections::BTreeSet;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::scene::Triangle;
use visibility_core::view::Eye;
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, Object, ObjectId, OccluderMesh, Pose, RegionCuller, Scene, View,
    VisibleSet,
};

/// Describes a kind of culler to the harness: how the culler is made and which data it takes besides the
/// scene.
pub trait Swapped {
    /// Culler under test.
    type Culler: Culler;
    /// Data derived from a scene and given to the culler, such as a PVS, occluders or a hierarchy. Empty for
    /// a culler that needs a scene alone.
    type Source: Clone;

    /// Derives a source (data for the culler, such as a PVS or occluders) from the present state of a scene.
    fn derive(&self, scene: &Scene, rng: &mut Random) -> Self::Source;

    /// Makes a culler from a source. The culler has seen no scene yet.
    fn make(&self, source: &Self::Source) -> Self::Culler;

    /// Gives a source to a culler and lets the culler sync with the present state of the scene. The source
    /// may be derived from another scene or an earlier state.
    fn give(&self, culler: &mut Self::Culler, source: &Self::Source, scene: &Scene);

    /// Makes the reference culler for a source: a live culler must not hide any object that the reference
    /// keeps. By default, [`make`](Self::make).
    fn truth(&self, source: &Self::Source) -> Self::Culler {
        self.make(source)
    }

    /// Gives objects what the culler asks of a scene and the harness does not set, such as draw ranges.
    /// Called for each new scene, and for a scene after changes. Does nothing by default.
    fn prepare(&self, _: &mut Scene) {}

    /// Returns whether a culler that was just given its source must answer like a fresh culler, whatever
    /// scenes and sources the culler has seen before. True by default.
    fn is_free_of_memory(&self) -> bool {
        true
    }

    /// Returns whether what the live culler hides is judged by segments from the eye, in place of the
    /// reference. So judged is a culler that may hide more when it knows fewer occluders, as one whose
    /// picture has room for a few of them. False by default.
    fn is_judged_by_segments(&self) -> bool {
        false
    }
}

/// Runs `frames` frames of random swaps and changes with one live culler. Asserts that the live culler keeps
/// every object that the reference keeps and, where required, answers like a fresh culler. Returns the number
/// of objects that the live culler hid, summed over all frames.
pub fn hold_against_fresh<S: Swapped>(kind: &S, seed: u64, frames: usize) -> usize {
    let mut rng = Random(seed);
    let mut scenes: Vec<Scene> = (0..3).map(|_| scene(&mut rng)).collect();
    scenes.iter_mut().for_each(|scene| kind.prepare(scene));
    scenes.push(scenes[0].clone());
    let mut sources: Vec<S::Source> = scenes.iter().map(|scene| kind.derive(scene, &mut rng)).collect();
    let mut given = sources[0].clone();
    let (mut live, mut visible) = (kind.make(&given), VisibleSet::new().with_changes());
    let (mut at, mut hidden) = (0, 0);
    let views: Vec<View> = (0..6).map(|_| view(&mut rng)).collect();
    for frame in 0..frames {
        let other = rng.below(scenes.len());
        match rng.below(16) {
            // The scene changes under the culler, or changes and is reverted.
            0..5 => change(&mut scenes[at], &mut rng),
            5 => change_and_revert(&mut scenes[at], &mut rng),
            6 => change(&mut scenes[other], &mut rng),
            // A level is loaded again in place of a dropped one, or reset to a copy of another.
            7 => scenes[other] = scene(&mut rng),
            8 => scenes[other] = scenes[at].clone(),
            9 => scenes.swap(at, other),
            10 => sources[other] = sources[at].clone(),
            11 => sources[other] = kind.derive(&scenes[other], &mut rng),
            12 => scenes[at].rebuild(),
            _ => {}
        }
        kind.prepare(&mut scenes[at]);
        kind.prepare(&mut scenes[other]);
        if rng.one_in(3) {
            at = other;
        }
        let is_given = !rng.one_in(4);
        if is_given {
            // One time in five, the source belongs to another scene.
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
        let lost: Vec<ObjectId> = if kind.is_judged_by_segments() {
            let mut random = Random(frame as u64);
            hidden_objects_that_are_seen(scene, view, &seen, &mut random)
        } else {
            fresh(kind.truth(&given)).difference(&seen).copied().collect()
        };
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

/// Returns the objects that a culler keeps of all objects of a scene that the view's layers admit.
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

/// Casts segments from the near plane to random points of each object that a culler hid, as far as the points
/// are in the view. Returns the objects that a segment reaches past all occluders on the view's layers. The
/// occluders must fill their bounds, as those of [`scene`] do.
fn hidden_objects_that_are_seen(
    scene: &Scene,
    view: &View,
    seen: &BTreeSet<ObjectId>,
    random: &mut Random,
) -> Vec<ObjectId> {
    let mut all = VisibleSet::new();
    all.fill(scene, view);
    let origin = scene.origin();
    let Eye::Point(eye) = view.eye(origin) else { panic!("the views of this harness have an eye") };
    let clip = view.clip_from(origin);
    let occluders: Vec<ObjectId> = all.iter(scene).filter(|&id| scene.occluder(id).is_some()).collect();
    let mut is_reached = |id: ObjectId| {
        let bounds = scene.bounds(id).unwrap();
        let others = || occluders.iter().filter(|&&other| other != id).map(|&id| scene.bounds(id).unwrap());
        (0..40).any(|_| {
            let at = DVec3::new(random.unit(), random.unit(), random.unit());
            let p = bounds.min.as_dvec3() + (bounds.max - bounds.min).as_dvec3() * at;
            let q = clip * p.extend(1.0);
            let in_view = q.w > NEAR && q.x.abs() < q.w && q.y.abs() < q.w;
            in_view && misses(others(), eye + (p - eye) * (NEAR / q.w), p)
        })
    };
    all.iter(scene).filter(|id| !seen.contains(id)).filter(|&id| is_reached(id)).collect()
}

/// Distance in metres of the near plane of the harness's views.
const NEAR: f64 = 0.1;

/// Returns a perspective view from a random eye near the origin, towards the origin.
fn view(rng: &mut Random) -> View {
    let eye = rng.vector(12.0);
    View::perspective(Pose::look_at(eye, rng.vector(3.0), DVec3::Z), 1.2, 1.5, NEAR, 1e3).unwrap()
}

/// Returns a scene of 150 objects around the origin with one triangle each, and ten walls with box-shaped
/// occluder meshes. All such scenes have the same object ids.
pub fn scene(rng: &mut Random) -> Scene {
    let mut scene = Scene::new();
    for number in 0..150 {
        let triangle = random_triangle(rng);
        let one_sided = number % 2 == 0;
        let id = scene.insert(Object { one_sided, ..Object::new(Aabb::from_points(triangle)) });
        scene.set_triangles(id, [triangle]).unwrap();
    }
    for _ in 0..10 {
        let wall = random_wall(rng);
        let id = scene.insert(Object { occluder: true, ..Object::new(wall) });
        give_mesh(&mut scene, id, &wall);
    }
    scene
}

/// Returns a random small triangle within 16 m of the origin on each axis.
fn random_triangle(rng: &mut Random) -> Triangle {
    let at = rng.vector(15.0);
    core::array::from_fn(|_| (at + rng.vector(1.0)).as_vec3())
}

/// Returns the box of a random thin wall near the origin.
fn random_wall(rng: &mut Random) -> Aabb {
    let at = rng.vector(8.0).as_vec3();
    let half = *[Vec3::new(0.2, 4.0, 4.0), Vec3::new(4.0, 0.2, 4.0)].get(rng.below(2)).unwrap();
    Aabb::new(at - half, at + half)
}

/// Gives an object an occluder mesh and triangles: the surface of a box with the object's bounds. The mesh is
/// removed with the object, so that later meshes reuse its index under live cullers.
fn give_mesh(scene: &mut Scene, id: ObjectId, bounds: &Aabb) {
    let mesh = scene.add_mesh(OccluderMesh::cuboid(bounds).unwrap());
    scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
    scene.remove_mesh(mesh).unwrap();
    let corners = bounds.corners();
    scene.set_triangles(id, OccluderMesh::CUBOID.map(|t| t.map(|i| corners[i as usize]))).unwrap();
}

/// Culler of views made from a [`RegionCuller`]: it culls for a cubic viewcell with sides of 20 cm around the
/// eye.
pub struct AroundEye<R>(pub R);

impl<R: RegionCuller> Culler for AroundEye<R> {
    fn name(&self) -> &str {
        "from a viewcell"
    }

    fn accuracy(&self) -> Accuracy {
        self.0.accuracy()
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let Eye::Point(eye) = view.eye(DVec3::ZERO) else { panic!("the views of this harness have an eye") };
        self.0.cull(scene, &Viewcell::from_box(eye - 0.1, eye + 0.1), visible)
    }
}

/// Makes up to three random changes: removal, insertion, new bounds, triangles, layers, flags, occluders or
/// origin. Then maintains the hierarchy.
fn change(scene: &mut Scene, rng: &mut Random) {
    let ids: Vec<_> = scene.ids().collect();
    for _ in 0..rng.below(4) {
        let id = ids[rng.below(ids.len())];
        if !scene.contains(id) {
            continue;
        }
        match rng.below(9) {
            0 => {
                // A new object reuses the index of the removed one.
                scene.remove(id).unwrap();
                scene.insert(Aabb::from_points(random_triangle(rng)));
            }
            1 => {
                // The bounds stay the same, and the triangles are reversed.
                let turned: Vec<_> = scene.triangles(id).unwrap().iter().map(|[a, b, c]| [a, c, b]).collect();
                scene.set_triangles(id, turned).unwrap();
            }
            2 => scene.set_layers(id, rng.pick(&[0, 1, u32::MAX])).unwrap(),
            3 => scene.set_never_cull(id, rng.one_in(2)).unwrap(),
            4 => scene.set_origin(rng.vector(1.0)).unwrap(),
            5 => scene.set_one_sided(id, rng.one_in(2)).unwrap(),
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

/// Changes the bounds and triangles of one object and restores both.
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
