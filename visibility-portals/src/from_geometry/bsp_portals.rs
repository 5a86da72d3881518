//! Portals between the leaves of a BSP tree.
//!
//! The plane of each node, clipped to the region of the node, is divided among the leaves that it bounds on
//! both sides (Naylor, Amanatides and Thibault, "Merging BSP Trees Yields Polyhedral Set Operations", 1990,
//! call the clipped plane the sub-hyperplane). The part that two leaves on opposite sides share, minus the
//! opaque polygons, is a portal.

use super::merge_pieces::{convex_polygons, hull, merge_pieces};
use super::subtract_polygons::{Lengths, bounds, subtract, widened_sides, width};
use crate::clip_polygon::clip_into;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{
    cells::CellId,
    geometry::{ConvexPolygon, Plane},
    pvs::Viewcell,
};

/// A child of a node: the index of another node, or of a leaf.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Child {
    Node(u32),
    Leaf(u32),
}

/// An inner node of the BSP tree, with the world-space plane that splits its region.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) plane: Plane,
    /// Index of the parent node, and `true` if this node is on the parent's front side, `false` if behind.
    /// `None` for the root.
    pub(super) parent: Option<(u32, bool)>,
    pub(super) front: Child,
    pub(super) back: Child,
    /// Opaque polygons in the node's plane.
    pub(super) covers: Vec<NodeCover>,
}

/// An opaque polygon in the plane of a node.
#[derive(Clone, Debug)]
pub(super) struct NodeCover {
    /// Vertices of the polygon in world space.
    pub(super) vertices: Vec<DVec3>,
    /// True if the polygon faces the front of the plane, false if it faces the back.
    pub(super) faces_front: bool,
    /// True if lines from behind pass the polygon.
    pub(super) one_sided: bool,
}

/// An opaque polygon in world space, prepared for subtraction from a portal in the same plane. `planes` run
/// through the polygon's edges, perpendicular to the polygon, with normals to the inside, and are moved
/// outwards so that the polygon is widened. `min` and `max` are the polygon's bounds, widened at least as
/// much. A cover is *one-sided* if only its front stops lines.
struct Cover {
    planes: Vec<Plane>,
    min: DVec3,
    max: DVec3,
    /// True if the polygon faces the front of the plane, false if it faces the back.
    faces_front: bool,
    /// True if lines from behind pass the polygon.
    one_sided: bool,
}

impl Cover {
    /// Prepares a polygon in the plane of a node, widened by `widen` world units.
    fn new(cover: &NodeCover, node: &Node, widen: f64, lengths: &Lengths) -> Self {
        let NodeCover { ref vertices, faces_front, one_sided } = *cover;
        let mut planes = Vec::new();
        widened_sides(vertices, node.plane.normal, widen, &mut planes);
        let (min, max) = bounds(vertices);
        // Covers the widening and the distance off the plane.
        let slack = 2.0 * (widen + lengths.plane);
        Self { planes, min: min - slack, max: max + slack, faces_front, one_sided }
    }

    /// Returns whether the polygon stops lines that come from one side of the plane: from the front if
    /// `is_front`, from the back if not.
    fn blocks_from(&self, is_front: bool) -> bool {
        !self.one_sided || self.faces_front == is_front
    }
}

/// Maximum number of covers that are subtracted from a whole piece. A piece with more is halved first.
const MAX_COVERS: usize = 32;
/// Maximum number of times that a piece of a portal with more than [`MAX_COVERS`] covers is halved.
const MAX_HALVINGS: u32 = 8;

/// Subtracts the covers from a convex piece of a portal, and appends what is left, the open parts, to `open`.
/// Adds to `covered` the areas, in square world units, that were covered by covers facing the front of the
/// plane (index 0) and its back (index 1). A piece with many covers is halved along its longest side, so that
/// the time is nearly proportional to the number of covers. `halvings` is how often the piece has been
/// halved.
fn subtract_covers(
    piece: Vec<DVec3>,
    covers: &[&Cover],
    normal: DVec3,
    lengths: &Lengths,
    halvings: u32,
    open: &mut Vec<Vec<DVec3>>,
    covered: &mut [f64; 2],
) {
    let (min, max) = bounds(&piece);
    let meets = |cover: &&&Cover| cover.min.cmple(max).all() && min.cmple(cover.max).all();
    let near: Vec<&Cover> = covers.iter().filter(meets).copied().collect();
    if near.len() > MAX_COVERS && halvings < MAX_HALVINGS {
        let size = max - min;
        let axis = (0..3).fold(0, |longest, axis| if size[axis] > size[longest] { axis } else { longest });
        let half = Plane::new(DVec3::AXES[axis], -(min[axis] + max[axis]) * 0.5);
        for side in [half, half.flipped()] {
            let mut part = Vec::new();
            clip_into(&piece, &side, 0.0, &mut part);
            if !part.is_empty() {
                subtract_covers(part, &near, normal, lengths, halvings + 1, open, covered);
            }
        }
        return;
    }
    let mut parts = alloc::vec![piece];
    for cover in near {
        covered[usize::from(!cover.faces_front)] += subtract(&mut parts, &cover.planes, normal, lengths);
    }
    open.append(&mut parts);
}

/// Returns whether lines from one side of the plane pass `piece` through the backs of one-sided covers, where
/// no other cover stops them. The side is the front if `is_front` is true, else the back. `exact` are the
/// covers without their widening.
///
/// Parts whose widths have a sum of at most half of the tolerance do not count. No disc of a greater diameter
/// lies in their union, whatever their number and places (Bang, "A Solution of the 'Plank Problem'", 1951),
/// so that lines that pass them are near to something else. In a piece that is narrow itself, parts side by
/// side with those of the next pieces would be wider: there half of the width of the piece is the limit. More
/// than 12 pieces that meet in one point, each with a part there, are not told from fewer.
fn leaks(
    piece: &[DVec3],
    covers: &[Cover],
    exact: &[Cover],
    is_front: bool,
    normal: DVec3,
    lengths: &Lengths,
) -> bool {
    let blocking: Vec<&Cover> = covers.iter().filter(|cover| cover.blocks_from(is_front)).collect();
    let mut passed = Vec::new();
    subtract_covers(piece.to_vec(), &blocking, normal, lengths, 0, &mut passed, &mut [0.0; 2]);
    let passing_width = |cover: &Cover| {
        let meets = |part: &&Vec<DVec3>| {
            let (min, max) = bounds(part.iter());
            cover.min.cmple(max).all() && min.cmple(cover.max).all()
        };
        let parts = passed.iter().filter(meets).map(|part| {
            let mut common = part.clone();
            cover.planes.iter().for_each(|plane| clip_in_place(&mut common, plane, lengths));
            common
        });
        width(&hull(parts.flatten(), normal), normal)
    };
    let limit = (2.0 * lengths.sliver).min(0.5 * width(piece, normal)).max(8.0 * lengths.merge);
    let mut sum = 0.0;
    exact.iter().filter(|cover| !cover.blocks_from(is_front)).any(|cover| {
        sum += passing_width(cover);
        sum > limit
    })
}

/// A BSP tree that divides the box from `min` to `max`, in world space.
#[derive(Clone, Debug)]
pub(super) struct Bsp {
    pub(super) nodes: Vec<Node>,
    pub(super) leaves: usize,
    pub(super) min: DVec3,
    pub(super) max: DVec3,
}

/// A leaf region of the BSP tree: its world-space volume, and the opaque area on its boundary.
#[derive(Clone, Debug)]
pub(super) struct Leaf {
    pub(super) body: Viewcell,
    /// Whether the leaf touches the boundary of the box that the tree divides; false for an inner leaf.
    pub(super) outside: bool,
    /// Area, in square world units, of the opaque polygons on the leaf's boundary whose front faces the
    /// leaf.
    pub(super) fronts: f64,
    /// Area, in square world units, of the opaque polygons on the leaf's boundary whose back faces the leaf.
    pub(super) backs: f64,
    /// Whether lines leave the leaf through the backs of one-sided polygons, where no portal is.
    pub(super) leaks: bool,
}

/// A portal between two leaves, by leaf index. The polygon's normal points into the second leaf.
pub(super) type LeafPortal = (ConvexPolygon, [u32; 2]);

/// Returns the polygon in which a plane cuts the box from `min` to `max`, all in world space. Empty if the
/// plane misses the box. Points within `lengths.merge` of a side of the box count as on it.
pub(super) fn section_of_box(plane: &Plane, min: DVec3, max: DVec3, lengths: &Lengths) -> Vec<DVec3> {
    let middle = (min + max) * 0.5;
    let reach = (max - min).length();
    let center = middle - plane.normal * plane.signed_distance(middle);
    let u = plane.normal.any_orthonormal_vector() * reach;
    let v = plane.normal.cross(u);
    let mut polygon = alloc::vec![center - u - v, center + u - v, center + u + v, center - u + v];
    for axis in DVec3::AXES {
        clip_in_place(&mut polygon, &Plane::new(axis, -axis.dot(min)), lengths);
        clip_in_place(&mut polygon, &Plane::new(-axis, axis.dot(max)), lengths);
    }
    polygon
}

/// Clips a convex polygon (world space) in place to the side of a plane that its normal points to; points on
/// the plane are kept. Empty if nothing is left.
pub(super) fn clip_in_place(polygon: &mut Vec<DVec3>, plane: &Plane, lengths: &Lengths) {
    let mut inner = Vec::new();
    clip_into(polygon, plane, lengths.merge, &mut inner);
    *polygon = inner;
}

impl Bsp {
    /// Returns the world-space polygon in which a plane cuts the region of one child of a node. `at` holds
    /// the node's index, and `true` for the node's front child, `false` for its back child. With `None`, the
    /// region is the whole box that the tree divides. Empty if the plane misses the region.
    pub(super) fn section(
        &self,
        plane: &Plane,
        mut at: Option<(u32, bool)>,
        lengths: &Lengths,
    ) -> Vec<DVec3> {
        let mut polygon = section_of_box(plane, self.min, self.max, lengths);
        while let Some((node, front)) = at.filter(|_| !polygon.is_empty()) {
            let node = &self.nodes[node as usize];
            let side = if front { node.plane } else { node.plane.flipped() };
            clip_in_place(&mut polygon, &side, lengths);
            at = node.parent;
        }
        polygon
    }

    /// Returns the leaves of the tree, by leaf index, and the portals between leaves.
    pub(super) fn portals(&self, lengths: &Lengths) -> (Vec<Leaf>, Vec<LeafPortal>) {
        let empty = Viewcell { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY, planes: Vec::new() };
        let leaf = Leaf { body: empty, outside: false, fronts: 0.0, backs: 0.0, leaks: false };
        let mut leaves = alloc::vec![leaf; self.leaves];
        let root = if self.nodes.is_empty() { Child::Leaf(0) } else { Child::Node(0) };
        let (mut ahead, mut behind) = (Vec::new(), Vec::new());
        // The faces of the box around everything bound the outermost leaves.
        for axis in DVec3::AXES {
            for plane in [Plane::new(axis, -axis.dot(self.min)), Plane::new(-axis, axis.dot(self.max))] {
                let face = section_of_box(&plane, self.min, self.max, lengths);
                self.split_among_leaves(face, root, lengths, &mut ahead);
                for (leaf, piece) in ahead.drain(..) {
                    leaves[leaf as usize].bound(&piece, None);
                    leaves[leaf as usize].outside = true;
                }
            }
        }
        let mut portals = Vec::new();
        for node in &self.nodes {
            // The node's plane within its region, divided among the leaves in front and then among those
            // behind: each piece separates two leaves.
            let section = self.section(&node.plane, node.parent, lengths);
            if section.is_empty() {
                continue;
            }
            let widened = |by: f64| -> Vec<Cover> {
                node.covers.iter().map(|cover| Cover::new(cover, node, by, lengths)).collect()
            };
            let covers = widened(lengths.widen);
            let has_backs = covers.iter().any(|cover| cover.one_sided);
            let exact = if has_backs { widened(0.0) } else { Vec::new() };
            self.split_among_leaves(section, node.front, lengths, &mut ahead);
            for (front, piece) in ahead.drain(..) {
                self.split_among_leaves(piece, node.back, lengths, &mut behind);
                for (back, piece) in behind.drain(..) {
                    leaves[front as usize].bound(&piece, Some(node.plane));
                    leaves[back as usize].bound(&piece, Some(node.plane.flipped()));
                    // Polygons in the plane cover parts of the piece. The open rest is a portal.
                    let (mut open, mut covered) = (Vec::new(), [0.0; 2]);
                    let all: Vec<&Cover> = covers.iter().collect();
                    let normal = node.plane.normal;
                    subtract_covers(piece.clone(), &all, normal, lengths, 0, &mut open, &mut covered);
                    for (leaf, is_front) in [(front, true), (back, false)].into_iter().filter(|_| has_backs) {
                        leaves[leaf as usize].leaks |=
                            leaks(&piece, &covers, &exact, is_front, normal, lengths);
                    }
                    for ([sees_front, sees_back], area) in
                        [[front, back], [back, front]].into_iter().zip(covered)
                    {
                        leaves[sees_front as usize].fronts += area;
                        leaves[sees_back as usize].backs += area;
                    }
                    merge_pieces(&mut open, normal);
                    let polygons = convex_polygons(open, &piece, normal, lengths.sliver * 0.25);
                    portals.extend(polygons.map(|polygon| (polygon, [back, front])));
                }
            }
        }
        (leaves, portals)
    }

    /// Splits a world-space polygon among the leaves below `child`. Appends to `out`, for each leaf, the
    /// leaf's index and the polygon's part in that leaf. A polygon that lies in the plane of a node is passed
    /// on whole to both children of the node.
    fn split_among_leaves(
        &self,
        polygon: Vec<DVec3>,
        child: Child,
        lengths: &Lengths,
        out: &mut Vec<(u32, Vec<DVec3>)>,
    ) {
        let mut waiting = alloc::vec![(child, polygon)];
        while let Some((child, polygon)) = waiting.pop() {
            let node = match child {
                Child::Leaf(leaf) => {
                    out.push((leaf, polygon));
                    continue;
                }
                Child::Node(node) => &self.nodes[node as usize],
            };
            let distances = || polygon.iter().map(|&p| node.plane.signed_distance(p));
            let (least, most) = (distances().fold(0.0, f64::min), distances().fold(0.0, f64::max));
            let (is_ahead, is_behind) = (most > lengths.merge, least < -lengths.merge);
            if is_ahead && is_behind {
                for (child, plane) in [(node.back, node.plane.flipped()), (node.front, node.plane)] {
                    let mut part = polygon.clone();
                    clip_in_place(&mut part, &plane, lengths);
                    if !part.is_empty() {
                        waiting.push((child, part));
                    }
                }
                continue;
            }
            if !is_ahead {
                waiting.push((node.back, polygon.clone()));
            }
            if !is_behind {
                waiting.push((node.front, polygon));
            }
        }
    }
}

impl Leaf {
    fn bound(&mut self, face: &[DVec3], plane: Option<Plane>) {
        let body = &mut self.body;
        face.iter().for_each(|&p| (body.min, body.max) = (body.min.min(p), body.max.max(p)));
        body.planes.extend(plane.filter(|plane| !body.planes.contains(plane)));
    }
}

/// Renumbers the leaves to be kept (`keep`, by leaf index) from 0. Returns their number, and the portals with
/// the new numbers. Portals of a leaf that is not kept are dropped.
pub(super) fn renumber_leaves(
    portals: Vec<LeafPortal>,
    keep: &[bool],
) -> (usize, Vec<(ConvexPolygon, [CellId; 2])>) {
    let mut count = 0;
    let numbers: Vec<Option<CellId>> = keep
        .iter()
        .map(|&keep| {
            count += usize::from(keep);
            keep.then(|| CellId(count as u32 - 1))
        })
        .collect();
    let portals = portals
        .into_iter()
        .filter_map(|(polygon, [a, b])| Some((polygon, [numbers[a as usize]?, numbers[b as usize]?])));
    (count, portals.collect())
}

#[cfg(test)]
mod tests {
    use super::super::subtract_polygons::area as area_of;
    use super::*;

    /// With a tolerance of 0.1 m, a back 0.04 m wide is no leak of a piece of a portal, but for a piece that
    /// is as narrow: the next pieces may leak as well.
    #[test]
    fn narrow_backs_leak_where_they_are_half_of_a_piece() {
        let lengths = Lengths::new(0.1, 10.0);
        let strip = |width: f64| {
            [[0.0, 0.0], [width, 0.0], [width, 3.0], [0.0, 3.0]].map(|[y, z]| DVec3::new(0.0, y, z)).to_vec()
        };
        let [front, back] = [0, 1].map(Child::Leaf);
        let plane = Plane::new(DVec3::X, 0.0);
        let node = Node { plane, parent: None, front, back, covers: Vec::new() };
        for (piece, back, is_leak) in
            [(1.0, 0.04, false), (1.0, 0.06, true), (0.04, 0.04, true), (0.04, 0.015, false)]
        {
            let cover = NodeCover { vertices: strip(back), faces_front: true, one_sided: true };
            let [covers, exact] =
                [lengths.widen, 0.0].map(|by| alloc::vec![Cover::new(&cover, &node, by, &lengths)]);
            let found = leaks(&strip(piece), &covers, &exact, false, DVec3::X, &lengths);
            assert_eq!(found, is_leak, "a back {back} m wide in a piece {piece} m wide");
            let found = leaks(&strip(piece), &covers, &exact, true, DVec3::X, &lengths);
            assert!(!found, "a front {back} m wide in a piece {piece} m wide");
        }
    }

    fn rectangle(x: f64, y: [f64; 2], z: [f64; 2]) -> Vec<DVec3> {
        [[y[0], z[0]], [y[1], z[0]], [y[1], z[1]], [y[0], z[1]]].map(|[y, z]| DVec3::new(x, y, z)).to_vec()
    }

    fn node(plane: Plane, covers: Vec<NodeCover>) -> Node {
        let [front, back] = [0, 1].map(Child::Leaf);
        Node { plane, parent: None, front, back, covers }
    }

    /// Covers may be off the plane by half of the tolerance, here 0.05 m, and are found even so.
    #[test]
    fn covers_off_the_plane_cover_it_and_leak() {
        let lengths = Lengths::new(0.1, 10.0);
        let piece = rectangle(0.0, [0.0, 4.0], [0.0, 3.0]);
        for off in [-0.049, 0.049] {
            let vertices = rectangle(off, [1.0, 2.0], [-1.0, 4.0]);
            let cover = NodeCover { vertices, faces_front: true, one_sided: true };
            let node = node(Plane::new(DVec3::X, 0.0), Vec::new());
            let [covers, exact] =
                [lengths.widen, 0.0].map(|by| alloc::vec![Cover::new(&cover, &node, by, &lengths)]);
            assert!(
                leaks(&piece, &covers, &exact, false, DVec3::X, &lengths),
                "a back {off} m off the plane"
            );
            let both = NodeCover { one_sided: false, ..cover.clone() };
            let [two_sided, bare] =
                [lengths.widen, 0.0].map(|by| alloc::vec![Cover::new(&both, &node, by, &lengths)]);
            for is_front in [true, false] {
                let found = leaks(&piece, &two_sided, &bare, is_front, DVec3::X, &lengths);
                assert!(!found, "a two-sided cover {off} m off the plane");
            }
            let (mut open, mut covered) = (Vec::new(), [0.0; 2]);
            let all: Vec<&Cover> = covers.iter().collect();
            subtract_covers(piece.clone(), &all, DVec3::X, &lengths, 0, &mut open, &mut covered);
            assert_eq!(open.len(), 2, "{off} m off: the open parts on both sides of the cover: {open:?}");
            assert!((covered[0] - 1.1 * 3.0).abs() < 1e-9 && covered[1] == 0.0, "{off} m off: {covered:?}");
        }
    }

    /// A piece with more than 32 covers in one place is halved no more often than it may be.
    #[test]
    fn many_covers_in_one_place_end() {
        let lengths = Lengths::new(1e-3, 10.0);
        let piece = rectangle(0.0, [0.0, 8.0], [0.0, 3.0]);
        let cover = NodeCover {
            vertices: rectangle(0.0, [1.0, 7.0], [1.0, 2.0]),
            faces_front: false,
            one_sided: false,
        };
        let node = node(Plane::new(DVec3::X, 0.0), Vec::new());
        for count in [1, 32, 33, 100] {
            let covers: Vec<Cover> =
                (0..count).map(|_| Cover::new(&cover, &node, lengths.widen, &lengths)).collect();
            let (mut open, mut covered) = (Vec::new(), [0.0; 2]);
            let all: Vec<&Cover> = covers.iter().collect();
            subtract_covers(piece.clone(), &all, DVec3::X, &lengths, 0, &mut open, &mut covered);
            let left: f64 = open.iter().map(|part| area_of(part, DVec3::X)).sum();
            let hidden = 6.001 * 1.001;
            assert!((left - (24.0 - hidden)).abs() < 1e-6, "{count} covers leave {left}");
            assert!((covered[1] - hidden).abs() < 1e-6 && covered[0] == 0.0, "{count} covers: {covered:?}");
        }
    }

    #[test]
    fn sections_of_a_box_are_what_a_plane_has_in_common_with_it() {
        let lengths = Lengths::new(1e-3, 10.0);
        let (min, max) = (DVec3::new(-1.0, -2.0, -3.0), DVec3::new(4.0, 5.0, 6.0));
        let area = |plane: Plane| {
            let section = section_of_box(&plane, min, max, &lengths);
            area_of(&section, plane.normal)
        };
        for (plane, expected) in [
            (Plane::new(DVec3::X, -1.0), 63.0),
            (Plane::new(-DVec3::X, -1.0), 63.0),
            (Plane::new(DVec3::X, 1.0), 63.0),
            (Plane::new(DVec3::Y, 1.0), 45.0),
            (Plane::new(DVec3::Z, -6.0), 35.0),
            (Plane::new(DVec3::X, -4.5), 0.0),
            (Plane::new(DVec3::new(0.6, 0.8, 0.0), 0.0), 9.0 * (8.0 / 3.0 + 1.0) / 0.8),
        ] {
            assert!((area(plane) - expected).abs() < 1e-9, "{plane:?}: {}", area(plane));
        }
    }

    /// A polygon across a plane is divided, one beside it goes to its side, and one in it to both sides.
    #[test]
    fn polygons_are_split_among_the_leaves_that_they_are_in() {
        let lengths = Lengths::new(1e-3, 10.0);
        let bsp = Bsp {
            nodes: alloc::vec![node(Plane::new(DVec3::Y, -2.0), Vec::new())],
            leaves: 2,
            min: DVec3::ZERO,
            max: DVec3::splat(4.0),
        };
        let split = |y: [f64; 2]| {
            let mut out = Vec::new();
            bsp.split_among_leaves(rectangle(1.0, y, [0.0, 3.0]), Child::Node(0), &lengths, &mut out);
            out.sort_by_key(|&(leaf, _)| leaf);
            out.iter().map(|(leaf, part)| (*leaf, part.len())).collect::<Vec<_>>()
        };
        let near = 0.9 * lengths.merge;
        for (y, expected) in [
            ([0.0, 4.0], alloc::vec![(0, 4), (1, 4)]),
            ([2.0, 4.0], alloc::vec![(0, 4)]),
            ([2.0 - near, 4.0], alloc::vec![(0, 4)]),
            ([0.0, 2.0], alloc::vec![(1, 4)]),
            ([0.0, 2.0 + near], alloc::vec![(1, 4)]),
        ] {
            assert_eq!(split(y), expected, "from {} to {}", y[0], y[1]);
        }
        let mut out = Vec::new();
        let flat: Vec<DVec3> =
            rectangle(1.0, [0.0, 3.0], [0.0, 3.0]).iter().map(|p| DVec3::new(p.y, 2.0, p.z)).collect();
        bsp.split_among_leaves(flat.clone(), Child::Node(0), &lengths, &mut out);
        out.sort_by_key(|&(leaf, _)| leaf);
        assert_eq!(out, [(0, flat.clone()), (1, flat)], "a polygon in the plane");
    }
}
