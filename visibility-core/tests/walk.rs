//! Tests of the walk from outside: a frustum culler written against the public interface gives the results of
//! core's own.

use visibility_core::glam::{DVec3, Vec3};
use visibility_core::walk::{BoxHierarchy, Child, SceneHierarchy, Walk, first_misplaced};
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
        assert!(
            stats.visible > 0 && stats.accepted_subtrees + stats.nodes > 1,
            "the walk is no test: {stats:?}"
        );
        assert_eq!(copy.cull(&scene, &view, &mut outside), stats, "what the copy counts");
        assert!(outside.iter(&scene).eq(own.iter(&scene)), "the copy finds other objects");
        twice.cull(&scene, &view, &mut outside);
        assert!(outside.iter(&scene).eq(own.iter(&scene)), "a second walk changes the set");
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
        assert_eq!(stats.visible, outside.count(&scene) as u64, "objects counted and in the set");
        for &id in &ids {
            let expected = id.index() >= 8950 || own.contains(&scene, id);
            assert_eq!(outside.contains(&scene, id), expected, "{id}");
        }
        after.cull(&scene, &view, &mut outside);
        assert!(
            outside.iter(&scene).eq(own.iter(&scene)),
            "walking the set that is left over another hierarchy finds other objects"
        );
    }
}

/// Two levels of nodes: the top lists node 0, which lists node 1, which lists the objects.
struct Chain {
    boxes: [Aabb; 2],
    objects: Vec<(ObjectId, Aabb)>,
    /// Node that node 1 lists beside its objects.
    extra: Option<usize>,
}

impl BoxHierarchy for Chain {
    fn for_each_child(&self, _: &Scene, node: Option<usize>, each: &mut dyn FnMut(Child, Aabb)) {
        match node {
            None => each(Child::Node(0), self.boxes[0]),
            Some(0) => each(Child::Node(1), self.boxes[1]),
            Some(1) => {
                self.objects.iter().for_each(|&(id, bounds)| each(Child::Object(id), bounds));
                self.extra.iter().for_each(|&node| each(Child::Node(node), self.boxes[1]));
            }
            Some(_) => {}
        }
    }
}

#[test]
fn hierarchies_whose_boxes_do_not_hold_what_is_below_are_found_out() {
    let cube = |from: f32, to: f32| Aabb::from_arrays([from; 3], [to; 3]);
    let mut random = Random(4);
    let mut scene = Scene::new();
    for _ in 0..3000 {
        let min = random.vec3(-90.0, 90.0);
        scene.insert(Aabb::new(min, min + random.vec3(0.0, 9.0)));
    }
    assert_eq!(first_misplaced(&scene, &SceneHierarchy), None, "core's hierarchy");
    assert_eq!(first_misplaced(&scene, &visibility_testing::Octree::new(&scene, 4)), None, "an octree");
    let mut scene = Scene::new();
    let ids = scene.insert_batch([cube(0.0, 1.0), cube(1.0, 2.0), Aabb::new(Vec3::NAN, Vec3::NAN)]);
    let chain = |boxes: [Aabb; 2], own: Aabb, extra| {
        let objects = vec![(ids[0], cube(0.0, 1.0)), (ids[1], own), (ids[2], cube(9.0, 9.5))];
        first_misplaced(&scene, &Chain { boxes, objects, extra })
    };
    let (held, object) = (cube(1.0, 2.0), Some(Child::Object(ids[1])));
    assert_eq!(chain([cube(0.0, 2.0); 2], held, None), None, "boxes that fit exactly");
    assert_eq!(chain([cube(0.0, 2.0), cube(-9.0, 9.0)], held, None), None, "a box may be larger than needed");
    assert_eq!(chain([Aabb::EMPTY, cube(0.0, 2.0)], held, None), None, "an inverted box hides nothing");
    assert_eq!(chain([cube(0.0, 1.5), cube(0.0, 2.0)], held, None), object, "the node above its node");
    assert_eq!(chain([cube(0.0, 2.0), cube(0.0, 1.5)], held, None), object, "its node");
    assert_eq!(chain([cube(0.0, 2.0); 2], cube(1.0, 1.5), None), object, "its own box");
    assert_eq!(chain([cube(0.0, 2.0); 2], cube(1.5, 2.0), None), object, "its own box");
    assert_eq!(chain([cube(0.0, 2.0); 2], held, Some(0)), Some(Child::Node(0)), "a ring of nodes");
}

/// A node has blocks of at most 64 children, and none without children.
#[test]
fn a_node_without_children_has_no_block() {
    let bounds = Aabb::from_arrays([0.0; 3], [1.0; 3]);
    let scene = Scene::new();
    for (count, expected) in [(0, &[][..]), (1, &[1]), (64, &[64]), (65, &[64, 1]), (128, &[64, 64])] {
        let objects = vec![(ObjectId::PLACEHOLDER, bounds); count];
        let chain = Chain { boxes: [bounds; 2], objects, extra: None };
        let mut blocks = Vec::new();
        chain.for_each_block(&scene, Some(1), |block| blocks.push(block.occupied().count_ones()));
        assert_eq!(blocks, expected, "children in each block of {count}");
    }
}

/// A degenerate tree: each node lists one object and the next node.
struct Line(Vec<(ObjectId, Aabb)>);

impl BoxHierarchy for Line {
    fn for_each_child(&self, _: &Scene, node: Option<usize>, each: &mut dyn FnMut(Child, Aabb)) {
        let place = node.map_or(0, |node| node + 1);
        if let Some(&(id, bounds)) = self.0.get(place) {
            each(Child::Object(id), bounds);
            each(Child::Node(place), bounds);
        }
    }
}

/// Drops all objects that the walk comes to.
fn drop_each(walk: &mut Walk<Line>, node: Option<usize>) -> bool {
    walk.visit(node, |walk, block, candidates| {
        let mut mask = candidates & !block.objects(candidates);
        for lane in 0..64 {
            if let (1, Child::Node(child)) = (mask >> lane & 1, block.child(lane)) {
                mask &= !(u64::from(!drop_each(walk, Some(child))) << lane);
            }
        }
        mask
    })
}

#[test]
fn a_tree_of_any_depth_is_walked_in_little_stack() {
    let bounds = Aabb::from_arrays([0.0; 3], [1.0; 3]);
    let mut scene = Scene::new();
    let ids = scene.insert_batch(vec![bounds; 100_000]);
    let line = Line(ids.iter().map(|&id| (id, bounds)).collect());
    let kept = |how: &mut dyn FnMut(&mut Walk<Line>)| {
        let mut visible = VisibleSet::new();
        let mut walk = Walk::new(&scene, &line, &mut visible);
        how(&mut walk);
        let count = walk.finish().visible;
        let is_deep = |id: ObjectId| visible.contains(&scene, id);
        (count, ids.iter().position(|&id| is_deep(id)))
    };
    let each = kept(&mut |walk| _ = drop_each(walk, None));
    assert_eq!(each, (100_000 - 128, Some(128)), "dropped one by one, down to a level");
    let at_once = kept(&mut |walk| _ = walk.visit(None, |_, _, _| 0));
    assert_eq!(at_once, (100_000 - 129, Some(129)), "dropped at the top, down to a level");
    // A second walk from the top begins at the first level again.
    let twice = kept(&mut |walk| {
        drop_each(walk, None);
        drop_each(walk, None);
    });
    assert_eq!(twice, each, "walked twice");
}
