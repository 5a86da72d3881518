//! Tests of scenes and tessellations that are swapped, mixed, cloned, changed, reverted and dropped under
//! live cullers: each frame's answer equals that of a new culler, and no object in view is lost.

use crate::common::{Blank, Random, run, triangles, views};
use std::collections::BTreeSet;
use std::sync::Arc;
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, Culler, ObjectId, Scene, View};
use visibility_plp::{
    Budget, ConservativePlpCuller, DelaunayTessellation, Fineness, OctreeTessellation, PlpCuller, Solidity,
    Tessellation,
};

/// Two sizes of cells, so that swapped tessellations differ in their number of cells.
const FINENESS: [Fineness; 2] =
    [Fineness { vertices: 24, halvings: 5 }, Fineness { vertices: 60, halvings: 4 }];

/// Octree or Delaunay tessellation of a scene.
#[derive(Clone)]
enum Cells {
    Octree(Arc<OctreeTessellation>),
    Delaunay(Arc<DelaunayTessellation>),
}

impl Cells {
    /// Partitions a scene; `number` chooses the kind (even: octree, odd: tetrahedra) and the fineness.
    fn new(scene: &Scene, number: usize) -> Self {
        let fineness = FINENESS[number / 2 % 2];
        if number.is_multiple_of(2) {
            Self::Octree(Arc::new(OctreeTessellation::from_scene(scene, fineness)))
        } else {
            Self::Delaunay(Arc::new(DelaunayTessellation::from_scene(scene, fineness)))
        }
    }

    /// Returns the tessellation as a shared trait object.
    fn shared(&self) -> Arc<dyn Tessellation> {
        match self {
            Self::Octree(cells) => cells.clone(),
            Self::Delaunay(cells) => cells.clone(),
        }
    }

    /// Syncs the tessellation with a scene, cloning it first if it is shared. False if a rebuild is due.
    fn sync(&mut self, scene: &Scene) -> bool {
        match self {
            Self::Octree(cells) => Arc::make_mut(cells).sync(scene),
            Self::Delaunay(cells) => Arc::make_mut(cells).sync(scene),
        }
    }
}

type Shared = Arc<dyn Tessellation>;

/// Culler under test, kept while its scene and tessellation are changed or replaced.
enum Live {
    Plp(PlpCuller<Shared>),
    Conservative(ConservativePlpCuller<Shared, Blank>),
}

impl Live {
    /// Number of culler configurations that `new` can make.
    const KINDS: usize = 4;

    /// Makes the culler of a configuration, 0 to `KINDS` - 1.
    fn new(cells: Shared, kind: usize) -> Self {
        let all = Budget::Objects(usize::MAX);
        match kind {
            0 => Self::Plp(PlpCuller::new(cells, all).with_one_sided()),
            1 => Self::Plp(PlpCuller::new(cells, Budget::Objects(60)).with_solidity(Solidity::Count)),
            2 => Self::Plp(PlpCuller::new(cells, Budget::Cost(50)).with_all_kept()),
            _ => Self::Conservative(ConservativePlpCuller::new(cells, Budget::Objects(20), Blank)),
        }
    }

    fn shared_mut(&mut self) -> &mut Shared {
        match self {
            Self::Plp(culler) => culler.shared_mut(),
            Self::Conservative(culler) => culler.shared_mut(),
        }
    }

    /// Returns the objects that the culler keeps of all objects of a scene, in the set's order.
    fn run(&mut self, scene: &Scene, view: &View) -> Vec<ObjectId> {
        let culler: &mut dyn Culler = match self {
            Self::Plp(culler) => culler,
            Self::Conservative(culler) => culler,
        };
        run(culler, scene, view)
    }
}

/// Returns the objects with a triangle that faces the eye and whose centre is at least a millimetre inside of
/// all view planes. Empty for parallel views.
fn surely_in_view(scene: &Scene, view: &View) -> Vec<ObjectId> {
    let planes = view.planes(scene.origin());
    let visibility_core::view::Eye::Point(eye) = view.eye(scene.origin()) else { return Vec::new() };
    let shows = |id: &ObjectId| {
        scene.triangles(*id).unwrap().iter().any(|t| {
            let [a, b, c] = t.map(|p| p.as_dvec3());
            let center = (a + b + c) / 3.0;
            (b - a).cross(c - a).normalize().dot((eye - a).normalize()) > 1e-6
                && planes.as_slice().iter().all(|plane| plane.plane.signed_distance(center) > 1e-3)
        })
    };
    scene.ids().filter(shows).collect()
}

/// Removes, adds, moves or turns over one random object.
fn change(scene: &mut Scene, random: &mut Random) {
    let ids: Vec<_> = scene.ids().collect();
    let id = random.pick(&ids);
    let middle = random.fine_vector(30.0);
    let triangle = [(); 3].map(|()| (middle + random.fine_vector(3.0)).as_vec3());
    let moved = match random.below(4) {
        0 => {
            scene.remove(id).unwrap();
            return;
        }
        1 => scene.insert(Aabb::from_points(triangle)),
        2 => {
            // Keeps the bounds and reverses the triangles.
            let turned: Vec<_> = scene.triangles(id).unwrap().iter().map(|[a, b, c]| [a, c, b]).collect();
            scene.set_triangles(id, turned).unwrap();
            return;
        }
        _ => {
            scene.set_bounds(id, Aabb::from_points(triangle)).unwrap();
            id
        }
    };
    scene.set_triangles(moved, [triangle]).unwrap();
}

#[test]
fn live_cullers_answer_as_fresh_ones_whatever_is_swapped() {
    let mut random = Random(2024);
    // Scenes with equal numbers of objects. The last one is a clone of the first.
    let mut scenes: Vec<Scene> = (0..3).map(|seed| triangles(seed, 500)).collect();
    scenes.push(scenes[0].clone());
    let saved = scenes.clone();
    let mut cells: Vec<Cells> = (0..6).map(|i| Cells::new(&scenes[i % 4], i)).collect();
    let mut live: Vec<Live> = (0..Live::KINDS).map(|kind| Live::new(cells[0].shared(), kind)).collect();
    let views = views();
    let (mut culled, mut left, mut wanted_in_all) = (0, 0, 0);
    for step in 0..600 {
        let (s, c) = (random.below(scenes.len()), random.below(cells.len()));
        match random.below(10) {
            // Several changes at once, which may or may not be synced to a tessellation.
            0..=2 => (0..1 + random.below(40)).for_each(|_| change(&mut scenes[s], &mut random)),
            3 => scenes[s] = scenes[random.below(4)].clone(),
            4 => scenes[s] = saved[random.below(4)].clone(),
            5 | 6 => cells[c] = Cells::new(&scenes[s], step),
            7 => cells[c] = cells[random.below(6)].clone(),
            8 if step % 4 == 0 => drop(scenes.swap_remove(s)),
            _ => {
                cells[c].sync(&scenes[s]);
            }
        }
        if scenes.len() < 4 {
            scenes.push(triangles(step as u64, 500));
        }
        let (c, s) = if step % 2 == 0 { (c, s) } else { (random.below(6), random.below(4)) };
        let view = &views[random.below(views.len())];
        for scene in [&scenes[s], &scenes[(s + 1) % 4], &scenes[s]] {
            let wanted = surely_in_view(scene, view);
            for (kind, culler) in live.iter_mut().enumerate() {
                *culler.shared_mut() = cells[c].shared();
                let answer = culler.run(scene, view);
                let fresh = Live::new(cells[c].shared(), kind).run(scene, view);
                assert_eq!(answer, fresh, "step {step}, culler {kind}");
                if kind != 1 {
                    let set: BTreeSet<_> = answer.iter().collect();
                    let lost: Vec<_> = wanted.iter().filter(|id| !set.contains(id)).collect();
                    assert!(lost.is_empty(), "step {step}: culler {kind} lost {} objects", lost.len());
                    wanted_in_all += wanted.len();
                } else if answer.len() < scene.len() {
                    culled += 1;
                } else {
                    left += 1;
                }
            }
        }
    }
    assert!(culled > 100 && left > 100 && wanted_in_all > 10_000, "{culled} {left} {wanted_in_all}");
}

/// After a failed sync with another scene or with a clone of its own scene, a tessellation still follows its
/// own scene.
#[test]
fn cells_are_of_one_scene_at_a_time() {
    let mut scene = triangles(5, 300);
    let clone = scene.clone();
    let mut cells = OctreeTessellation::from_scene(&scene, FINENESS[0]);
    assert!(
        cells.sync(&scene) && !cells.sync(&clone) && cells.sync(&scene),
        "cells know one of the scene and its clone at a time"
    );
    let stamp = cells.content().stamp();
    let id = scene.ids().next().unwrap();
    scene.set_bounds(id, Aabb::from_arrays([0.0; 3], [1.0; 3])).unwrap();
    let view = View::perspective(
        visibility_core::Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z),
        1.0,
        1.0,
        0.1,
        f64::INFINITY,
    )
    .unwrap();
    let mut of_clone = Live::new(Arc::new(cells.clone()), 1);
    assert_eq!(
        of_clone.run(&clone, &view).len(),
        clone.len(),
        "objects of the clone, of which nothing is known"
    );
    assert!(cells.sync(&scene), "the cells know the scene");
    assert_eq!(cells.content().strays(), [id], "the changed object is a stray");
    assert_eq!(cells.content().stamp(), stamp, "changes of objects leave the cells as they are");
    cells.rebuild(&scene);
    assert_ne!(cells.content().stamp(), stamp, "cells made anew have another stamp");
}
