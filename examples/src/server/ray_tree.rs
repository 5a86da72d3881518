//! Test of segments against triangles, with a binary tree of boxes.

use glam::DVec3;

/// Greatest number of triangles in a leaf.
const LEAF: usize = 4;

/// Triangles in world space that stop segments from both sides. Edges are rounded: a segment that passes
/// within rounding of an edge may be stopped or not.
#[derive(Debug)]
pub(super) struct RayTree {
    /// For each triangle, one corner and the vectors from it to the other two, in the order of the leaves.
    triangles: Vec<[DVec3; 3]>,
    /// Nodes in depth-first order: the first child follows its parent.
    nodes: Vec<Node>,
}

#[derive(Debug)]
struct Node {
    min: DVec3,
    max: DVec3,
    /// Index of the first node after this node's descendants.
    next: usize,
    /// Range of a leaf's triangles. Empty for inner nodes.
    triangles: std::ops::Range<usize>,
}

impl RayTree {
    /// Builds the tree over triangles, which are given by their corners.
    pub(super) fn new(mut triangles: Vec<[DVec3; 3]>) -> Self {
        let mut nodes = Vec::new();
        let count = triangles.len();
        if count > 0 {
            build(&mut triangles, 0..count, &mut nodes);
        }
        triangles.iter_mut().for_each(|[a, b, c]| (*b, *c) = (*b - *a, *c - *a));
        Self { triangles, nodes }
    }

    /// Returns whether the segment between two points meets no triangle.
    pub(super) fn is_free(&self, from: DVec3, to: DVec3) -> bool {
        let along = to - from;
        let inverse = along.recip();
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            let (a, b) = ((node.min - from) * inverse, (node.max - from) * inverse);
            let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element().min(1.0));
            if enter > leave {
                at = node.next;
                continue;
            }
            if self.triangles[node.triangles.clone()].iter().any(|triangle| is_met(from, along, triangle)) {
                return false;
            }
            at += 1;
        }
        true
    }
}

/// Returns whether the segment from `from` to `from + along` meets a triangle. T. Moeller and B. Trumbore,
/// "Fast, Minimum Storage Ray/Triangle Intersection", 1997.
fn is_met(from: DVec3, along: DVec3, &[corner, b, c]: &[DVec3; 3]) -> bool {
    let across = along.cross(c);
    let inverse = b.dot(across).recip();
    let to = from - corner;
    let u = to.dot(across) * inverse;
    let turned = to.cross(b);
    let v = along.dot(turned) * inverse;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (0.0..=1.0).contains(&(c.dot(turned) * inverse))
}

fn build(triangles: &mut [[DVec3; 3]], range: std::ops::Range<usize>, nodes: &mut Vec<Node>) {
    let part = &mut triangles[range.clone()];
    let min = part.iter().flatten().fold(DVec3::INFINITY, |min, &p| min.min(p));
    let max = part.iter().flatten().fold(DVec3::NEG_INFINITY, |max, &p| max.max(p));
    let node = nodes.len();
    let is_leaf = part.len() <= LEAF;
    nodes.push(Node { min, max, next: 0, triangles: if is_leaf { range.clone() } else { 0..0 } });
    if !is_leaf {
        let axis = (max - min).max_position();
        let middle = part.len() / 2;
        let key = |[a, b, c]: &[DVec3; 3]| a[axis] + b[axis] + c[axis];
        part.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)));
        build(triangles, range.start..range.start + middle, nodes);
        build(triangles, range.start + middle..range.end, nodes);
    }
    nodes[node].next = nodes.len();
}
