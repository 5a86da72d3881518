//! The image: a constrained Delaunay triangulation of occluder outlines, with the shape that covers each
//! triangle.
//!
//! Whether a shape fills a triangle is decided from the triangle's corners: if all three are strictly inside
//! the shape's half-planes, the triangle is covered, since half-planes are convex. Outlines and their
//! crossings are rounded to the grid, which only affects the choice of triangles, not this proof.

use super::screen::{GRID, ProjectedBox, REACH, RIM};
use super::shape::{Shape, Shapes, at};
use crate::cdt::constrain::Constrainer;
use crate::cdt::triangulation::{NONE, NOWHERE, Place, Triangulation};
use alloc::vec::Vec;

/// Maximum number of triangles that may be filled. Further triangles stay open.
pub(crate) const MAX_TRIANGLES: usize = 1 << 13;

/// Value of `BuildEdge::walls` for every edge of an outline. It only marks the edge: the image has no lists
/// of walls for it to index.
const OUTLINE: u32 = 0;

/// Region that covers the whole image plane, as least and greatest coordinates.
const EVERYWHERE: [[f64; 2]; 2] = [[f64::NEG_INFINITY; 2], [f64::INFINITY; 2]];

/// Search through neighbouring triangles: those found so far, and those of them that must still be visited.
/// The memory has a fixed size, so that a test, which only borrows the image, allocates nothing.
struct Search {
    /// One bit for each triangle, set once the search has found it: bit t % 64 of word t / 64 for triangle t.
    seen: [u64; MAX_TRIANGLES / 64],
    /// One bit for each triangle in the order of `seen`, set while the triangle must still be visited.
    waiting: [u64; MAX_TRIANGLES / 64],
    /// Index of a word of `waiting`. All words before it are 0.
    first: usize,
}

impl Search {
    fn new() -> Self {
        Self { seen: [0; MAX_TRIANGLES / 64], waiting: [0; MAX_TRIANGLES / 64], first: 0 }
    }

    /// Adds triangle `t` to the waiting ones, unless it was added before. Returns false, and adds nothing, if
    /// `t` is not below [`MAX_TRIANGLES`].
    fn push(&mut self, t: u32) -> bool {
        let (word, bit) = (t as usize / 64, 1 << (t % 64));
        let Some(seen) = self.seen.get_mut(word) else { return false };
        if *seen & bit == 0 {
            *seen |= bit;
            self.waiting[word] |= bit;
            self.first = self.first.min(word);
        }
        true
    }

    fn pop(&mut self) -> Option<u32> {
        while let Some(word) = self.waiting.get_mut(self.first) {
            if *word != 0 {
                let bit = word.trailing_zeros();
                *word &= *word - 1;
                return Some(64 * self.first as u32 + bit);
            }
            self.first += 1;
        }
        None
    }
}

/// Convex region of the image, in grid units: the intersection of the rectangle from `low` to `high` with the
/// hull of points that have an error of at most one unit.
#[derive(Clone, Copy)]
struct Region<'a> {
    /// Least column and row of the rectangle, in grid units.
    low: [f64; 2],
    /// Greatest column and row of the rectangle, in grid units.
    high: [f64; 2],
    /// Points whose convex hull bounds the region, in grid units.
    hull: &'a [[f64; 2]],
}

impl Region<'_> {
    /// Returns whether a triangle may meet the rectangle: whether their ranges of x and of y overlap.
    fn meets_rectangle(&self, corners: &[[f64; 2]; 3]) -> bool {
        (0..2).all(|axis| {
            corners.iter().any(|p| p[axis] >= self.low[axis])
                && corners.iter().any(|p| p[axis] <= self.high[axis])
        })
    }

    /// Returns whether a triangle may meet the hull. False only if the hull is entirely beyond one of the
    /// triangle's sides.
    ///
    /// The test computes the cross product of a side and the vector to a point of the hull. A point has an
    /// error of up to half a unit on each axis, which changes the product by half the sum of the side's
    /// extents along x and y. Coordinates are below 2^48 and sides shorter than 2^21, so rounding changes it
    /// by less than a quarter of that sum. The test allows the whole sum.
    fn meets_hull(&self, corners: &[[f64; 2]; 3]) -> bool {
        (0..3).all(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let (x, y) = (b[0] - a[0], b[1] - a[1]);
            let limit = -(x.abs() + y.abs());
            self.hull.iter().any(|p| x * (p[1] - a[1]) - y * (p[0] - a[0]) >= limit)
        })
    }
}

/// Returns whether a box is certainly behind all planes of a shape. The points behind a plane are a
/// half-space, so it suffices to test the corners.
///
/// A corner has an error of up to a quarter of a unit on each axis, which `slack` covers. The planes are
/// bounds on the depth key only in the triangulated rectangle, so all corners must lie in it.
fn is_behind(shapes: &Shapes, shape: &Shape, bounds: &ProjectedBox) -> bool {
    let is_inside = |p: &[f64; 2]| p.iter().all(|x| -RIM < *x && *x < REACH);
    let planes = &shapes.planes[shape.planes.clone()];
    !planes.is_empty()
        && bounds.corners.iter().all(is_inside)
        && planes.iter().all(|&plane| {
            let slack = 0.25 * (plane[0].abs() + plane[1].abs());
            bounds.corners.iter().zip(bounds.keys).all(|(&p, key)| at(plane, p) - slack > key)
        })
}

/// Returns a lower bound on the depth key (greater is nearer) of a shape in the intersection of a triangle
/// and a rectangle. `rectangle` has the corners of the rectangle; if it is empty, the bound holds in the
/// whole triangle.
fn least_key(shapes: &Shapes, shape: &Shape, triangle: &[[f64; 2]; 3], rectangle: &[[f64; 2]]) -> f64 {
    let least =
        |plane, points: &[[f64; 2]]| points.iter().map(|&p| at(plane, p)).fold(f64::INFINITY, f64::min);
    let planes = shapes.planes[shape.planes.clone()].iter().map(|&plane| {
        let (in_triangle, in_rectangle) = (least(plane, triangle), least(plane, rectangle));
        if rectangle.is_empty() { in_triangle } else { in_triangle.max(in_rectangle) }
    });
    planes.reduce(f64::min).map_or(shape.floor, |key| key.max(shape.floor))
}

/// Triangulated image of a frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct Image {
    /// Triangles of the image. The label of a triangle is the index, in [`Shapes::list`], of the shape that
    /// covers it.
    triangulation: Triangulation,
    constrainer: Constrainer,
    /// Scratch: vertices of the outline that is being added, as indices into the triangulation's points.
    outline: Vec<u32>,
    /// Scratch: indices of the triangles that a polygon may meet.
    found: Vec<u32>,
    /// Whether a triangle was filled in this frame.
    is_filled: bool,
}

impl Image {
    /// Clears the image, so that no triangle hides anything.
    pub(crate) fn clear(&mut self) {
        self.triangulation.restart([-RIM; 2], [REACH; 2]);
        self.is_filled = false;
    }

    /// Returns the number of vertices, the corners of the image among them.
    pub(crate) fn len(&self) -> usize {
        self.triangulation.points.len()
    }

    /// Returns whether no triangle was filled since the image was last emptied.
    pub(crate) fn is_empty(&self) -> bool {
        !self.is_filled
    }

    /// Adds a shape, given by its index in the list of `shapes`: its outline as edges, and its index as the
    /// label of the triangles that it fills. Does nothing if all triangles within the outline are already
    /// filled.
    pub(crate) fn add(&mut self, shapes: &Shapes, number: u32) {
        let shape = &shapes.list[number as usize];
        let outline = &shapes.outlines[shape.outline.clone()];
        self.collect(outline, EVERYWHERE);
        let labels = &self.triangulation.labels;
        if self.found.iter().all(|&t| labels[t as usize] != NONE) {
            return;
        }
        let of = &mut self.triangulation;
        self.outline.clear();
        for &point in outline {
            self.outline.push(of.insert(point));
        }
        let count = self.outline.len();
        for k in 0..count {
            let (from, to) = (self.outline[k], self.outline[(k + 1) % count]);
            // The only possible error is too many vertices. The outline then stays open, which hides less.
            let _ = self.constrainer.insert_list(of, from, to, OUTLINE);
        }
        self.fill(shapes, number, EVERYWHERE);
        // Crossings may have re-triangulated areas of other shapes, so their triangles are filled again.
        let bounds = core::mem::replace(&mut self.triangulation.erased_bounds, NOWHERE);
        while let Some(label) = self.triangulation.erased.pop() {
            if label != number {
                self.fill(shapes, label, bounds);
                self.triangulation.erased.retain(|&other| other != label);
            }
        }
    }

    /// Labels triangles with `number` if the shape with this number certainly fills them and no nearer shape
    /// does. Only looks at triangles within `bounds`: least corner, then greatest corner, in grid units.
    fn fill(&mut self, shapes: &Shapes, number: u32, bounds: [[f64; 2]; 2]) {
        let shape = &shapes.list[number as usize];
        self.collect(&shapes.outlines[shape.outline.clone()], bounds);
        for &t in &self.found {
            let corners = self.corners(t);
            let lines = &shapes.lines[shape.lines.clone()];
            if !corners.iter().all(|&p| lines.iter().all(|&line| at(line, p) > 0.0)) {
                continue;
            }
            let least = |number: u32| least_key(shapes, &shapes.list[number as usize], &corners, &[]);
            let label = self.triangulation.labels[t as usize];
            if label == NONE || least(number) > least(label) {
                self.triangulation.labels[t as usize] = number;
                self.is_filled = true;
            }
        }
    }

    /// Lists in `found` the triangles that a polygon meets within `bounds`, and possibly some beside them.
    /// `bounds` has the least corner, then the greatest corner. All coordinates are in grid units.
    fn collect(&mut self, polygon: &[[f64; 2]], bounds: [[f64; 2]; 2]) {
        let mut found = core::mem::take(&mut self.found);
        found.clear();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in polygon {
            for axis in 0..2 {
                (low[axis], high[axis]) = (low[axis].min(p[axis]), high[axis].max(p[axis]));
            }
        }
        for axis in 0..2 {
            (low[axis], high[axis]) = (low[axis].max(bounds[0][axis]), high[axis].min(bounds[1][axis]));
        }
        self.visit(Region { low, high, hull: polygon }, |t, _| {
            found.push(t);
            true
        });
        self.found = found;
    }

    /// Tests whether every triangle that a box meets is filled by a shape that is certainly nearer.
    pub(crate) fn hides(&self, shapes: &Shapes, bounds: &ProjectedBox) -> bool {
        // Enlarged by a unit so that the region has an area, then clamped to the image.
        let region = Region {
            low: bounds.low.map(|x| (x - 1.0).max(0.0)),
            high: bounds.high.map(|x| (x + 1.0).min(GRID)),
            hull: &bounds.corners,
        };
        let ([x0, y0], [x1, y1]) = (region.low, region.high);
        let rectangle = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
        // Shape that filled the last triangle, and whether the box is behind it.
        let mut last = (NONE, false);
        self.visit(region, |t, corners| {
            let label = self.triangulation.labels[t as usize];
            let Some(shape) = shapes.list.get(label as usize) else { return false };
            if last.0 != label {
                last = (label, shape.floor > bounds.nearest || is_behind(shapes, shape, bounds));
            }
            last.1 || least_key(shapes, shape, corners, &rectangle) > bounds.nearest
        })
    }

    /// Calls `each` for the triangles that meet a region, until `each` returns false. Returns whether all
    /// were visited. The triangles are connected, so all are found from the one in the region's middle.
    fn visit(&self, region: Region<'_>, mut each: impl FnMut(u32, &[[f64; 2]; 3]) -> bool) -> bool {
        let middle = [0, 1].map(|axis| 0.5 * (region.low[axis] + region.high[axis]));
        let first = match self.triangulation.locate(middle) {
            Place::Triangle(t) => t,
            Place::Edge(h) | Place::Vertex(h) => h / 3,
            Place::Outside => return false,
        };
        let mut search = Search::new();
        if !search.push(first) {
            return false;
        }
        while let Some(t) = search.pop() {
            let corners = self.corners(t);
            if !region.meets_rectangle(&corners) {
                continue;
            }
            if region.meets_hull(&corners) && !each(t, &corners) {
                return false;
            }
            for h in 3 * t..3 * t + 3 {
                let twin = self.triangulation.edges[h as usize].twin;
                if twin != NONE && !search.push(twin / 3) {
                    return false;
                }
            }
        }
        true
    }

    fn corners(&self, t: u32) -> [[f64; 2]; 3] {
        core::array::from_fn(|k| self.triangulation.start(3 * t + k as u32))
    }
}
