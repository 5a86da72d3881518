//! Viewcells, and a tree to find the viewcells at a point or in a box.

use crate::cells::CellId;
use crate::geometry::{Plane, longest_axis};
use alloc::vec::Vec;
use glam::{BVec3, DVec3};
use smallvec::SmallVec;

/// Number of a viewcell, from 0: the index of the region in [`Viewcells`], and the index of the row in a
/// [`Pvs`](super::Pvs).
///
/// Viewcells need not be cells of a [`CellGraph`](crate::cells::CellGraph). Where they are, viewcell and cell
/// have the same number.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct ViewcellId(pub u32);

impl ViewcellId {
    /// Returns the number of the viewcell as an array index.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

impl From<CellId> for ViewcellId {
    /// Converts the number of a cell to the viewcell with the same number.
    fn from(cell: CellId) -> Self {
        Self(cell.0)
    }
}

/// A convex region of viewpoints in world space: the part of a box inside some half-spaces, boundaries
/// included.
#[derive(Clone, PartialEq, Debug)]
pub struct Viewcell {
    /// Minimum corner of the box in world space, in metres, inclusive.
    pub min: DVec3,
    /// Maximum corner of the box in world space, in metres, inclusive.
    pub max: DVec3,
    /// Half-spaces in world space that cut parts of the box off, with normals of any length pointing
    /// inwards. Empty if the viewcell is the whole box.
    pub planes: Vec<Plane>,
}

impl Viewcell {
    /// Makes a viewcell that is a whole box, given its minimum and maximum corners in world space.
    pub fn from_box(min: DVec3, max: DVec3) -> Self {
        Self { min, max, planes: Vec::new() }
    }

    /// Tests whether a point in world space lies in the viewcell or on its boundary. False for NaN. The
    /// distance from the planes is subject to rounding.
    pub fn contains(&self, p: DVec3) -> bool {
        in_box(p, self.min, self.max) && self.planes.iter().all(|plane| plane.signed_distance(p) >= 0.0)
    }

    /// Returns whether [`faces`](Self::faces) yields a plane for every face.
    pub(crate) fn has_all_faces(&self) -> bool {
        self.planes.iter().all(|plane| plane.normalized().is_some())
    }

    /// Returns the planes of the faces, relative to `anchor`, with unit normals pointing inwards: six of the
    /// box, then those of [`planes`](Self::planes). Planes that cannot be normalized are left out, which
    /// enlarges the viewcell.
    pub(crate) fn faces(&self, anchor: DVec3) -> impl Iterator<Item = Plane> + '_ {
        let (min, max) = (self.min - anchor, self.max - anchor);
        let sides = (0..3).flat_map(move |axis| {
            let normal = DVec3::AXES[axis];
            [Plane::new(normal, -min[axis]), Plane::new(-normal, max[axis])]
        });
        let planes = self.planes.iter().filter_map(Plane::normalized);
        sides.chain(planes.map(move |plane| Plane::new(plane.normal, plane.signed_distance(anchor))))
    }
}

fn in_box(p: DVec3, min: DVec3, max: DVec3) -> bool {
    min.cmple(p).all() && p.cmple(max).all()
}

/// Viewcells in a binary tree of bounding boxes, split at the median. A point is located in logarithmic time,
/// as long as the boxes overlap little.
///
/// ```
/// use visibility_core::{glam::DVec3, pvs::{Viewcell, ViewcellId, Viewcells}};
/// let room = |x: f64| Viewcell::from_box(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 4.0, 3.0, 3.0));
/// let viewcells = Viewcells::new([room(0.0), room(4.0), room(8.0)]);
/// assert_eq!(viewcells.locate(DVec3::new(9.0, 1.0, 1.0)), Some(ViewcellId(2)));
/// assert_eq!(viewcells.locate(DVec3::new(9.0, 7.0, 1.0)), None);
/// ```
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Viewcells {
    cells: Vec<Viewcell>,
    /// Numbers of the viewcells in the order of the tree's leaves. Viewcells with inverted or NaN boxes
    /// are left out.
    order: Vec<u32>,
    /// Nodes in depth-first order: the first child follows its parent, the second child follows all
    /// descendants of the first.
    nodes: Vec<Node>,
    /// `None` unless the viewcells are [of a divided box](Viewcells::of_divided_box).
    divided: Option<DividedBox>,
}

/// The box that viewcells divide, in world space, and the distance that they may be misplaced by.
#[derive(Clone, Copy, PartialEq, Debug)]
struct DividedBox {
    min: DVec3,
    max: DVec3,
    misplacement: f64,
}

impl DividedBox {
    /// Returns by axis whether the box from `min` to `max` reaches beyond the side at lesser coordinates, and
    /// beyond the side at greater ones. False for NaN.
    fn passed_sides(&self, min: DVec3, max: DVec3) -> [BVec3; 2] {
        [min.cmplt(self.min - self.misplacement), max.cmpgt(self.max + self.misplacement)]
    }

    /// Tests whether the box from `min` to `max` lies at one of `sides`, given as by
    /// [`passed_sides`](Self::passed_sides).
    fn is_at(&self, [low, high]: [BVec3; 2], min: DVec3, max: DVec3) -> bool {
        let at_low = low & min.cmple(self.min + self.misplacement);
        let at_high = high & max.cmpge(self.max - self.misplacement);
        (at_low | at_high).any()
    }
}

#[derive(Clone, Copy, PartialEq, Debug)]
struct Node {
    min: DVec3,
    max: DVec3,
    /// Index in `Viewcells::nodes` of the first node after all descendants of this node: the next node of a
    /// search that does not descend below this node.
    next: u32,
    /// First viewcell of a leaf, as an index into `Viewcells::order`.
    start: u32,
    /// End of the leaf's range in `Viewcells::order`, exclusive. Equal to `start` for an inner node.
    end: u32,
}

/// Greatest number of parts of a box that [`Viewcells::cover`] looks at, as a multiple of the viewcells that
/// touch the box. A grid of viewcells needs one part for each.
const PARTS_PER_CELL: usize = 64;

/// Greatest number of viewcells in a leaf.
const LEAF: usize = 4;

impl Viewcells {
    /// Builds the tree. Viewcells are numbered in the given order. A viewcell with a NaN corner, or whose
    /// minimum exceeds its maximum on an axis, contains no point and is never found. Time is O(n log n).
    pub fn new(cells: impl IntoIterator<Item = Viewcell>) -> Self {
        let cells: Vec<Viewcell> = cells.into_iter().collect();
        let usable = |cell: &Viewcell| cell.min.cmple(cell.max).all();
        let order = (0..cells.len() as u32).filter(|&i| usable(&cells[i as usize])).collect();
        let mut all = Self { cells, order, nodes: Vec::new(), divided: None };
        if !all.order.is_empty() {
            all.build(0, all.order.len());
        }
        all
    }

    /// Like [`new`](Self::new), for the cells of the box from `min` to `max` (world space) that was divided
    /// along walls. Lines of sight leave the box through the cells at its sides, so that what reaches out of
    /// the box [touches](Self::for_each_touching) these cells. Cells, and the openings between them, may be
    /// misplaced by `misplacement` metres: what is that near to a cell touches it and is
    /// [reached](Self::reached). A `misplacement` of NaN or less than 0 counts as 0.
    pub fn of_divided_box(
        cells: impl IntoIterator<Item = Viewcell>,
        min: DVec3,
        max: DVec3,
        misplacement: f64,
    ) -> Self {
        let divided = DividedBox { min, max, misplacement: misplacement.max(0.0) };
        Self { divided: Some(divided), ..Self::new(cells) }
    }

    /// Returns the distance, in metres, that the viewcells and the openings between them may be misplaced by.
    /// 0 unless they are [of a divided box](Self::of_divided_box).
    pub fn misplacement(&self) -> f64 {
        self.divided.map_or(0.0, |divided| divided.misplacement)
    }

    /// Returns the minimum and the maximum corner, in world space, of the box that the viewcells divide.
    /// `None` unless they are [of a divided box](Self::of_divided_box).
    pub fn divided_box(&self) -> Option<[DVec3; 2]> {
        self.divided.map(|divided| [divided.min, divided.max])
    }

    /// Returns whether the box from `min` to `max` (world space) reaches out of the divided box beyond a side
    /// at which the viewcell lies. False for viewcells of no divided box, and for an unknown viewcell.
    pub(crate) fn is_left_through(&self, viewcell: ViewcellId, min: DVec3, max: DVec3) -> bool {
        self.divided
            .zip(self.cells.get(viewcell.index()))
            .is_some_and(|(divided, cell)| divided.is_at(divided.passed_sides(min, max), cell.min, cell.max))
    }

    fn build(&mut self, start: usize, end: usize) {
        let cells = &self.cells;
        let boxes = self.order[start..end].iter().map(|&i| &cells[i as usize]);
        let (min, max) = boxes.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), cell| {
            (min.min(cell.min), max.max(cell.max))
        });
        let node = self.nodes.len();
        self.nodes.push(Node { min, max, next: 0, start: start as u32, end: end as u32 });
        if end - start > LEAF {
            let axis = longest_axis((max - min).to_array());
            let middle = start + (end - start) / 2;
            let key = |i: u32| cells[i as usize].min[axis] * 0.5 + cells[i as usize].max[axis] * 0.5;
            let compare = |a: &u32, b: &u32| key(*a).total_cmp(&key(*b)).then(a.cmp(b));
            self.order[start..end].select_nth_unstable_by(middle - start, compare);
            self.nodes[node].end = start as u32;
            self.build(start, middle);
            self.build(middle, end);
        }
        self.nodes[node].next = self.nodes.len() as u32;
    }

    /// Returns all viewcells, indexed by [`ViewcellId`].
    pub fn cells(&self) -> &[Viewcell] {
        &self.cells
    }

    /// Returns the viewcell that contains a point in world space; of several, the viewcell with the least
    /// number. `None` if no viewcell contains the point, or for NaN. On the boundary between two viewcells
    /// both are valid answers, since the PVS of each viewcell includes what is seen from its boundary.
    pub fn locate(&self, p: DVec3) -> Option<ViewcellId> {
        let (mut at, mut found) = (0, None);
        while let Some(node) = self.nodes.get(at) {
            if !in_box(p, node.min, node.max) {
                at = node.next as usize;
                continue;
            }
            for &i in &self.order[node.start as usize..node.end as usize] {
                if found.is_none_or(|ViewcellId(least)| i < least) && self.cells[i as usize].contains(p) {
                    found = Some(ViewcellId(i));
                }
            }
            at += 1;
        }
        found
    }

    /// Walks down the tree as long as `accepts` returns true for the minimum and maximum corners of a node's
    /// bounding box, and calls `each` with the viewcells of the leaves that it reaches.
    pub(super) fn for_each_accepted(
        &self,
        mut accepts: impl FnMut(DVec3, DVec3) -> bool,
        mut each: impl FnMut(&Viewcell, ViewcellId),
    ) {
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if !accepts(node.min, node.max) {
                at = node.next as usize;
                continue;
            }
            for &i in &self.order[node.start as usize..node.end as usize] {
                each(&self.cells[i as usize], ViewcellId(i));
            }
            at += 1;
        }
    }

    /// Calls `each` with the viewcells that may touch the box from `min` to `max` in world space, boundaries
    /// included. `each` gets a viewcell if its own box meets the given box and, for each of its planes, a
    /// corner of the given box is inside or within rounding error. A box with a NaN touches no viewcell, but
    /// for those at the sides of a divided box. The order of the calls is unspecified. Time is proportional
    /// to the number of calls, and logarithmic in the number of all viewcells.
    ///
    /// Of viewcells [of a divided box](Self::of_divided_box), `each` also gets those that are nearer than
    /// their misplacement. If the given box reaches out of the divided box, `each` gets all viewcells at the
    /// sides that it reaches beyond, since what is outside may be seen through any of these.
    pub fn for_each_touching(&self, min: DVec3, max: DVec3, mut each: impl FnMut(ViewcellId)) {
        let passed = self.divided.map(|divided| (divided, divided.passed_sides(min, max)));
        let is_at_passed =
            |low: DVec3, high: DVec3| passed.is_some_and(|(divided, sides)| divided.is_at(sides, low, high));
        let (min, max) = (min - self.misplacement(), max + self.misplacement());
        let meets = |low: DVec3, high: DVec3| low.cmple(max).all() && min.cmple(high).all();
        let magnitude = min.abs().max(max.abs());
        let accepts = |low: DVec3, high: DVec3| meets(low, high) || is_at_passed(low, high);
        self.for_each_accepted(accepts, |cell, id| {
            // A NaN distance, from an infinite box, excludes nothing.
            let beyond = |plane: &Plane| {
                let far = DVec3::select(plane.normal.cmpge(DVec3::ZERO), max, min);
                plane.signed_distance(far) < -plane.error_bound(magnitude)
            };
            let touches = meets(cell.min, cell.max) && !cell.planes.iter().any(beyond);
            if touches || is_at_passed(cell.min, cell.max) {
                each(id);
            }
        });
    }

    /// Appends the numbers of the viewcells that may touch the box from `min` to `max` in world space, as
    /// [`for_each_touching`](Self::for_each_touching) finds them. Returns whether these cover the box: each
    /// point of it is in one of the viewcells without planes. False for a box with a NaN. Compares
    /// coordinates, and computes none. Time is that of the search, and in proportion to the square of the
    /// number of viewcells found: the box is divided into parts at the faces of viewcells, and false is
    /// returned, too, if there are more than 64 parts for each viewcell. Those of a grid need one each.
    pub fn cover(&self, min: DVec3, max: DVec3, found: &mut Vec<u32>) -> bool {
        let start = found.len();
        self.for_each_touching(min, max, |cell| found.push(cell.0));
        let found = &found[start..];
        // Parts of the box not covered yet, each with the index in `found` of the first viewcell that may
        // still cover it.
        let mut parts: SmallVec<[(DVec3, DVec3, usize); 8]> = smallvec::smallvec![(min, max, 0)];
        let mut parts_left = PARTS_PER_CELL * found.len();
        while let Some((mut low, mut high, first)) = parts.pop() {
            if parts_left == 0 {
                return false;
            }
            parts_left -= 1;
            let is_of_use = |&cell: &u32| {
                let cell = &self.cells[cell as usize];
                // A viewcell that only touches a side of the part is needed for none of its points: those
                // next to the side are left to others, which are closed as well.
                let overlaps = cell.min.cmplt(high) & low.cmplt(cell.max);
                let is_across = low.cmpeq(high) & cell.min.cmple(high) & low.cmple(cell.max);
                cell.planes.is_empty() && (overlaps | is_across).all()
            };
            let Some(at) = found[first..].iter().position(is_of_use) else { return false };
            let next = first + at + 1;
            let cell = &self.cells[found[next - 1] as usize];
            // The parts of the box beside this viewcell must be covered by the viewcells after it.
            for axis in 0..3 {
                if low[axis] < cell.min[axis] {
                    let mut part = high;
                    part[axis] = cell.min[axis];
                    parts.push((low, part, next));
                    low[axis] = cell.min[axis];
                }
                if cell.max[axis] < high[axis] {
                    let mut part = low;
                    part[axis] = cell.max[axis];
                    parts.push((part, high, next));
                    high[axis] = cell.max[axis];
                }
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlapping_viewcells_are_given_up_before_their_cube_of_parts() {
        let cover = |cells: Vec<Viewcell>| {
            Viewcells::new(cells).cover(DVec3::ZERO, DVec3::splat(16.0), &mut Vec::new())
        };
        let mut grid: Vec<Viewcell> = Vec::new();
        for i in 0..16 * 16 * 16u32 {
            let min = DVec3::new(f64::from(i % 16), f64::from(i / 16 % 16), f64::from(i / 256));
            grid.push(Viewcell::from_box(min, min + 1.0));
        }
        assert!(cover(grid), "a grid covers its bounds");
        // Slabs across each axis that leave gaps between them, and a viewcell over all.
        let slabs = |count: usize| {
            let mut cells = Vec::new();
            for (axis, i) in (0..3).flat_map(|axis| (0..count).map(move |i| (axis, i))) {
                let (mut min, mut max) = (DVec3::ZERO, DVec3::splat(16.0));
                min[axis] = 16.0 * (i as f64 + 0.25) / count as f64;
                max[axis] = 16.0 * (i as f64 + 0.75) / count as f64;
                cells.push(Viewcell::from_box(min, max));
            }
            cells.push(Viewcell::from_box(DVec3::ZERO, DVec3::splat(16.0)));
            cells
        };
        assert!(cover(slabs(2)), "two slabs across each axis, and a viewcell over all");
        assert!(!cover(slabs(100)), "a hundred slabs across each axis make a million parts");
    }

    #[test]
    fn boxes_touch_the_viewcells_that_they_reach() {
        let mut cells: Vec<Viewcell> = (0..40)
            .map(|i| {
                Viewcell::from_box(
                    DVec3::new(f64::from(i), 0.0, 0.0),
                    DVec3::new(f64::from(i) + 1.0, 1.0, 1.0),
                )
            })
            .collect();
        // Cuts off one corner of the fourth viewcell: x + y <= 3.5 remains.
        cells[3].planes.push(Plane::new(DVec3::new(-1.0, -1.0, 0.0), 3.5));
        let viewcells = Viewcells::new(cells);
        let touching = |min: [f64; 3], max: [f64; 3]| {
            let mut found = Vec::new();
            viewcells.for_each_touching(min.into(), max.into(), |cell| found.push(cell.0));
            found.sort_unstable();
            found
        };
        assert_eq!(touching([7.5, 0.1, 0.1], [9.0, 0.2, 0.2]), [7, 8, 9], "touching counts");
        assert_eq!(touching([3.2, 0.1, 0.1], [3.3, 0.2, 0.2]), [3], "a box before the cut corner");
        assert_eq!(touching([3.7, 0.7, 0.1], [3.8, 0.8, 0.2]), [], "a box in the cut corner");
        assert_eq!(touching([3.75, 0.2, 0.1], [9.0, 0.3, 0.2])[..2], [4, 5], "beyond the corner");
        assert_eq!(touching([f64::NAN; 3], [9.0; 3]), [], "a box whose minimum is NaN touches none");
        assert_eq!(
            touching([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]).len(),
            40,
            "the box of all space touches all"
        );
    }

    #[test]
    fn what_leaves_a_divided_box_touches_the_viewcells_at_the_sides_that_it_passes() {
        // Three by three columns, 1 m wide and 3 m high; only the one in the middle is at no upright side.
        let cells = (0..9).map(|i| DVec3::new(f64::from(i % 3), f64::from(i / 3), 0.0));
        let cells = cells.map(|min| Viewcell::from_box(min, min + DVec3::new(1.0, 1.0, 3.0)));
        let viewcells = Viewcells::of_divided_box(cells, DVec3::ZERO, DVec3::splat(3.0), 0.01);
        assert_eq!(viewcells.misplacement(), 0.01, "the misplacement as given");
        assert_eq!(viewcells.divided_box(), Some([DVec3::ZERO, DVec3::splat(3.0)]), "the box as given");
        let touching = |min: [f64; 3], max: [f64; 3]| {
            let mut found = Vec::new();
            viewcells.for_each_touching(min.into(), max.into(), |cell| found.push(cell.0));
            found.sort_unstable();
            found
        };
        assert_eq!(touching([1.2; 3], [1.8; 3]), [4], "a box in the middle column");
        assert_eq!(touching([1.2, 1.2, 1.0], [1.8, 1.8, 3.0]), [4], "a box up to the top, not beyond");
        assert_eq!(touching([1.2, 1.2, 1.0], [1.8, 1.8, 3.02]).len(), 9, "a box beyond the top");
        assert_eq!(touching([1.2, 1.2, -9.0], [1.8, 1.8, -8.0]).len(), 9, "a box below");
        assert_eq!(touching([1.2; 3], [3.02, 1.8, 1.8]), [2, 4, 5, 8], "a box beyond the east side");
        assert_eq!(touching([-2.0, -2.0, 1.0], [-1.0, -1.0, 2.0]), [0, 1, 2, 3, 6], "a box beyond two sides");
        assert_eq!(
            touching([0.2, 0.2, 1.0], [0.8, 0.991, 2.0]),
            [0, 3],
            "a box nearer than the misplacement"
        );
        assert_eq!(touching([0.2, 0.2, 1.0], [0.8, 0.989, 2.0]), [0], "a box farther than the misplacement");
        let mut reached = Vec::new();
        for (y, count) in [(0.991, 2), (0.989, 1)] {
            let covered = viewcells.reached(&[DVec3::new(0.5, y, 1.0)], DVec3::ZERO, 0.0, &mut reached);
            assert!(covered && reached.len() == count, "a point at {y} is in {reached:?}");
        }
        let left = |cell: u32, max: f64| {
            viewcells.is_left_through(ViewcellId(cell), DVec3::splat(1.2), DVec3::new(max, 1.8, 1.8))
        };
        assert!(left(5, 3.02) && !left(4, 3.02), "east of the box one comes through the eastern column");
        assert!(!left(5, 3.0) && !left(9, 3.02), "not within the box, nor through an unknown cell");
        let nan = Viewcells::of_divided_box([], DVec3::ZERO, DVec3::ONE, f64::NAN);
        assert_eq!(nan.misplacement(), 0.0, "a misplacement of NaN");
    }

    #[test]
    fn points_are_located_in_the_first_viewcell_that_holds_them() {
        let cell = |min: [f64; 3], max: [f64; 3]| Viewcell::from_box(min.into(), max.into());
        let mut cut = cell([0.0; 3], [4.0; 3]);
        cut.planes.push(Plane::new(DVec3::new(-1.0, -1.0, 0.0), 4.0));
        for (p, is_inside) in [
            ([1.0, 1.0, 1.0], true),
            ([0.0, 4.0, 4.0], true),
            ([4.0, 0.0, 0.0], true),
            ([3.0, 3.0, 1.0], false),
            ([-0.1, 1.0, 1.0], false),
            ([1.0, 1.0, 4.1], false),
        ] {
            assert_eq!(cut.contains(p.into()), is_inside, "{p:?}");
        }
        // Thirty rooms in a row, and from both ends rooms that overlap them all.
        let rooms = (0..30).map(f64::from).map(|x| cell([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]));
        let first = cell([10.0, 0.0, 0.0], [12.0, 0.5, 1.0]);
        let last = cell([0.0, 0.0, 0.0], [31.0, 1.0, 1.0]);
        let flat = cell([50.0, 0.0, 0.0], [50.0, 1.0, 1.0]);
        let cells = Viewcells::new([first].into_iter().chain(rooms).chain([last, flat]));
        for (p, expected) in [
            ([0.0, 0.0, 0.0], Some(1)),
            ([5.5, 0.5, 0.5], Some(6)),
            ([10.5, 0.5, 0.5], Some(0)),
            ([10.5, 0.6, 0.5], Some(11)),
            ([12.0, 0.5, 1.0], Some(0)),
            ([30.0, 1.0, 1.0], Some(30)),
            ([30.5, 1.0, 1.0], Some(31)),
            ([50.0, 1.0, 1.0], Some(32)),
            ([50.1, 1.0, 1.0], None),
        ] {
            assert_eq!(cells.locate(p.into()), expected.map(ViewcellId), "{p:?}");
        }
    }

    #[test]
    fn flat_boxes_are_covered_by_viewcells_that_touch_them() {
        let cells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
        let cover = |cells: &Viewcells, min: [f64; 3], max: [f64; 3]| {
            cells.cover(min.into(), max.into(), &mut Vec::new())
        };
        assert!(cover(&cells, [0.0, 0.2, 0.2], [0.0, 0.8, 0.8]), "at the side of lesser coordinates");
        assert!(cover(&cells, [1.0, 0.2, 0.2], [1.0, 0.8, 0.8]), "at the side of greater coordinates");
        assert!(!cover(&cells, [1.1, 0.2, 0.2], [1.1, 0.8, 0.8]), "beside the viewcell");
        assert!(!cover(&cells, [0.5, 0.2, 0.2], [1.1, 0.8, 0.8]), "a part beside the viewcell");
        let mut cut = cells.cells()[0].clone();
        cut.planes.push(Plane::new(DVec3::X, -0.5));
        let cut = Viewcells::new([cut]);
        assert!(!cover(&cut, [0.4, 0.2, 0.2], [0.8, 0.8, 0.8]), "a viewcell that a plane cuts");
    }

    /// A box of a point that is on a plane of whole numbers, but for rounding.
    #[test]
    fn boxes_touch_planes_within_rounding() {
        let mut random = visibility_testing::Random(41);
        let mut beyond = 0;
        for round in 0..2000 {
            let [a, b] = [(); 2].map(|()| f64::from(random.between(1, 1 << 20)));
            let times = f64::from(random.between(1, 1 << 20)) / 3.0;
            let (x, y) = (b * times, -a * times);
            // The exact value of the plane at the point, by products without rounding.
            use crate::geometry::DoubleDouble;
            let normal = DVec3::new(a / 7.0, b / 7.0, 0.0);
            let exact = DoubleDouble::product(normal.x, x).plus(DoubleDouble::product(normal.y, y));
            let plane = Plane::new(normal, -exact.hi);
            let value = exact.plus((-exact.hi).into());
            if value.hi < 0.0 {
                continue;
            }
            let p = DVec3::new(x, y, 0.0);
            beyond += usize::from(plane.signed_distance(p) < 0.0);
            let cell = Viewcell { planes: alloc::vec![plane], ..Viewcell::from_box(p - 1.0, p + 1.0) };
            // The farthest corner of the box is the point, and another corner is nearer to the origin.
            for size in [0.0, 0.5, x] {
                let (min, max) = (p - DVec3::new(size, size, 0.0), p);
                let mut count = 0;
                Viewcells::new([cell.clone()]).for_each_touching(min, max, |_| count += 1);
                assert_eq!(count, 1, "{round}: the point {p} is inside {plane:?} by {}", value.hi);
            }
        }
        assert!(beyond > 100, "{beyond} points are rounded outwards");
        // All four roundings of a distance go one way: see the tests of `Plane`.
        let (small, u) = (2.0f64.powi(-27), f64::EPSILON / 2.0);
        let (a, lost) = (1.0 + small, u * (1.0 - small));
        let p = DVec3::new(a, lost, lost);
        let plane = Plane::new(DVec3::new(a, 1.0, 1.0), -(1.0 + 2.0 * small) - 3.0 * u);
        let cell = Viewcell { planes: alloc::vec![plane], ..Viewcell::from_box(p - 1.0, p + 1.0) };
        let mut count = 0;
        Viewcells::new([cell]).for_each_touching(p, p, |_| count += 1);
        assert_eq!(count, 1, "a point {} outside as computed", plane.signed_distance(p));
    }

    #[test]
    fn the_sides_of_a_divided_box_are_as_wide_as_its_misplacement() {
        let cell = |min: [f64; 3], max: [f64; 3]| Viewcell::from_box(min.into(), max.into());
        // The first viewcell is just as near to the side at 0 as the box may be misplaced, the second at 4.
        let cells = [cell([0.25, 1.0, 1.0], [1.0, 2.0, 2.0]), cell([2.0, 1.0, 1.0], [3.75, 2.0, 2.0])];
        let cells = Viewcells::of_divided_box(cells, DVec3::ZERO, DVec3::splat(4.0), 0.25);
        let touching = |min: [f64; 3], max: [f64; 3]| {
            let mut found = Vec::new();
            cells.for_each_touching(min.into(), max.into(), |cell| found.push(cell.0));
            found
        };
        assert_eq!(touching([-0.25, 3.0, 3.0], [0.1, 3.1, 3.1]), [], "up to the side");
        assert_eq!(touching([-0.26, 3.0, 3.0], [0.1, 3.1, 3.1]), [0], "beyond the side");
        assert_eq!(touching([3.0, 3.0, 3.0], [4.25, 3.1, 3.1]), [], "up to the other side");
        assert_eq!(touching([3.0, 3.0, 3.0], [4.26, 3.1, 3.1]), [1], "beyond the other side");
        assert_eq!(touching([1.25, 1.0, 1.0], [1.5, 2.0, 2.0]), [0], "just as near as the misplacement");
        assert_eq!(touching([1.5, 1.0, 1.0], [1.75, 2.0, 2.0]), [1], "just as near from the other side");
    }
}
