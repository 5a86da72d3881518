//! A plain octree over the objects of a scene, as a second box hierarchy for tests of the occlusion driver.

use visibility_core::glam::Vec3;
use visibility_core::{
    Aabb, ObjectId, Scene,
    walk::{BoxHierarchy, Child},
};

/// Octree with boxes around up to eight children per node and objects at the leaves. Node 0 is the root.
pub struct Octree {
    /// All nodes, parents before their children.
    nodes: Vec<Node>,
}

/// Node of the octree: an inner node has children, a leaf has objects.
struct Node {
    /// Box around all objects below the node, relative to the scene's origin.
    bounds: Aabb,
    /// Indices of the child nodes; empty for a leaf.
    children: Vec<usize>,
    /// Objects of a leaf; empty for an inner node.
    objects: Vec<ObjectId>,
}

impl Octree {
    /// Builds the octree of the objects whose bounds are finite: leaves of at most four objects, except at
    /// the depth limit of `depth` levels below the root.
    pub fn new(scene: &Scene, depth: u32) -> Self {
        let objects: Vec<ObjectId> =
            scene.ids().filter(|&id| scene.bounds(id).is_ok_and(|bounds| bounds.is_finite())).collect();
        let mut octree = Self { nodes: Vec::new() };
        octree.add(scene, objects, depth);
        octree
    }

    /// Appends the subtree of some objects and returns the index of its root. `depth` is the number of levels
    /// that may still be split.
    fn add(&mut self, scene: &Scene, objects: Vec<ObjectId>, depth: u32) -> usize {
        let bounds_of = |id: &ObjectId| scene.bounds(*id).unwrap();
        let bounds = objects.iter().map(bounds_of).fold(Aabb::EMPTY, |all, one| all.union(&one));
        let place = self.nodes.len();
        self.nodes.push(Node { bounds, children: Vec::new(), objects: Vec::new() });
        if depth == 0 || objects.len() <= 4 {
            self.nodes[place].objects = objects;
            return place;
        }
        let middle = bounds.center();
        let octant = |p: Vec3| {
            usize::from(p.x > middle.x) | usize::from(p.y > middle.y) << 1 | usize::from(p.z > middle.z) << 2
        };
        let mut parts: [Vec<ObjectId>; 8] = Default::default();
        for id in objects {
            parts[octant(bounds_of(&id).center())].push(id);
        }
        for part in parts.into_iter().filter(|part| !part.is_empty()) {
            let child = self.add(scene, part, depth - 1);
            self.nodes[place].children.push(child);
        }
        place
    }
}

impl BoxHierarchy for Octree {
    fn for_each_child(&self, scene: &Scene, node: Option<usize>, each: &mut dyn FnMut(Child, Aabb)) {
        let Some(node) = node else {
            each(Child::Node(0), self.nodes[0].bounds);
            return;
        };
        for &child in &self.nodes[node].children {
            each(Child::Node(child), self.nodes[child].bounds);
        }
        for &id in &self.nodes[node].objects {
            if let Ok(bounds) = scene.bounds(id) {
                each(Child::Object(id), bounds);
            }
        }
    }
}
