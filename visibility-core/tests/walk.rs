//! Tests of the walk from outside: a frustum culler written against the public interface gives the results of
//! core's own.

use visibility_core::glam::DVec3;
use visibility_core::walk::{BoxHierarchy, Child, SceneHierarchy, Walk};
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, FrustumCuller, ObjectId, Pipeline, Pose, Scene, View, VisibleSet,
    frustum::ConvexVolume, simd::Simd, view::MAX_PLANES,
};
use visibility_testing::Random;

/// A frustum culler over any hierarchy.
struct Frustum<H>(H);

impl<H: BoxHierarchy> Frustum<H> {
    fn visit(volume: &ConvexVolume, walk: &mut Walk<H>, node: Option<usize>, active: u32) -> bool {
        walk.visit(node, |walk, block, candidates| {
            let mut mask = candidates & !volume.outside(block.boxes(), active);
            walk.stats.tests += u64::from(candidates.count_ones()) * u64::from(active.count_ones());
            let inside: [u64; MAX_PLANES] = core::array::from_fn(|plane| match active >> plane & 1 {
                0 => 0,
                _ => volume.inside(block.boxes(), plane),
            });
            let mut nodes = mask & !block.objects(mask);
            while nodes != 0 {
                let lane = nodes.trailing_zeros() as usize;
                nodes &= nodes - 1;
                let Child::Node(child) = block.child(lane) else { unreachable!("not among the objects") };
                let crossing = (0..MAX_PLANES)
                    .filter(|&plane| active >> plane & 1 != 0 && inside[plane] >> lane & 1 == 0)
                    .fold(0, |set, plane| set | 1 << plane);
                let any = match crossing {
                    0 => walk.accept(child),
                    _ => Self::visit(volume, walk, Some(child), crossing),
                };
                mask &= !(u64::from(!any) << lane);
            }
            mask
        })
    }
}

impl<H: BoxHierarchy> Culler for Frustum<H> {
    fn name(&self) -> &str {
        "frustum outside core"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let volume = ConvexVolume::new(Simd::best(), view.planes(scene.origin()).as_slice());
        let mut walk = Walk::new(scene, &self.0, visible);
        Self::visit(&volume, &mut walk, None, volume.all());
        walk.finish()
    }
}

/// A hierarchy whose nodes have more children than a block has lanes: a root with nodes of a hundred objects
/// each.
struct Hundreds(Vec<ObjectId>);

impl BoxHierarchy for Hundreds {
    fn for_each_child(&self, scene: &Scene, node: Option<usize>, each: &mut dyn FnMut(Child, Aabb)) {
        let objects = |ids: &[ObjectId], each: &mut dyn FnMut(Child, Aabb)| {
            ids.iter().for_each(|&id| each(Child::Object(id), scene.bounds(id).unwrap()));
        };
        match node {
            Some(node) => objects(&self.0[node * 100..(node * 100 + 100).min(self.0.len())], each),
            None => {
                for (node, ids) in self.0.chunks(100).enumerate() {
                    let hull =
                        ids.iter().fold(Aabb::EMPTY, |hull, &id| hull.union(&scene.bounds(id).unwrap()));
                    each(Child::Node(node), hull);
                }
            }
        }
    }
}

fn views() -> impl Iterator<Item = View> {
    (0..24).map(|i| {
        let (sin, cos) = (f64::from(i) * 0.7).sin_cos();
        let eye = DVec3::new(f64::from(i) - 12.0, 0.0, 1.0);
        let pose = Pose::look_at(eye, eye + DVec3::new(cos, sin, 0.1), DVec3::Z);
        View::perspective(pose, 1.0, 1.5, 0.1, 40.0).unwrap()
    })
}

fn scene() -> (Scene, Vec<ObjectId>) {
    let mut random = Random(5);
    let boxes = (0..9000).map(|_| {
        let at = [(); 3].map(|()| (random.unit() as f32 - 0.5) * 120.0);
        Aabb::from_arrays(at, at.map(|least| least + 1.0))
    });
    let mut scene = Scene::new();
    let ids = scene.insert_batch(boxes);
    (scene, ids)
}

#[test]
fn a_culler_outside_core_does_as_much_as_the_one_inside() {
    let (scene, _) = scene();
    let [mut own, mut outside] = [VisibleSet::new(), VisibleSet::new()];
    let mut inside = Pipeline::new().with(FrustumCuller::new());
    let mut copy = Pipeline::new().with(Frustum(SceneHierarchy));
    // Twice in a row, so that the second culler walks the set that the first has left.
    let mut twice = Pipeline::new().with(Frustum(SceneHierarchy)).with(Frustum(SceneHierarchy));
    for view in views() {
        let stats = inside.cull(&scene, &view, &mut own);
        assert!(stats.visible > 0 && stats.accepted_subtrees + stats.nodes > 1);
        assert_eq!(copy.cull(&scene, &view, &mut outside), stats);
        assert!(outside.iter(&scene).eq(own.iter(&scene)));
        twice.cull(&scene, &view, &mut outside);
        assert!(outside.iter(&scene).eq(own.iter(&scene)));
    }
}

#[test]
fn another_hierarchy_gives_the_same_set() {
    let (scene, ids) = scene();
    let [mut own, mut outside] = [VisibleSet::new(), VisibleSet::new()];
    let mut inside = Pipeline::new().with(FrustumCuller::new());
    // Objects that the hierarchy does not list stay.
    let listed = ids[..8950].to_vec();
    let mut other = Pipeline::new().with(Frustum(Hundreds(listed)));
    let mut after = Pipeline::new().with(FrustumCuller::new()).with(Frustum(Hundreds(ids.clone())));
    for view in views() {
        inside.cull(&scene, &view, &mut own);
        let stats = other.cull(&scene, &view, &mut outside);
        assert_eq!(stats.visible, outside.count(&scene) as u64);
        for &id in &ids {
            let expected = id.index() >= 8950 || own.contains(&scene, id);
            assert_eq!(outside.contains(&scene, id), expected, "{id}");
        }
        after.cull(&scene, &view, &mut outside);
        assert!(outside.iter(&scene).eq(own.iter(&scene)));
    }
}
