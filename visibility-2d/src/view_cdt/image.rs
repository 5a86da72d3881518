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

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    /// Lines of a shape, its depth planes, its outline and its floor.
    type Parts<'a> = (&'a [[f64; 3]], &'a [[f64; 3]], &'a [[f64; 2]], f64);

    /// Returns shapes that cover the inner sides of their lines.
    fn shapes(list: &[Parts<'_>]) -> Shapes {
        let mut shapes = Shapes::default();
        for &(lines, planes, outline, floor) in list {
            let starts = [shapes.lines.len(), shapes.planes.len(), shapes.outlines.len()];
            shapes.lines.extend(lines);
            shapes.planes.extend(planes);
            shapes.outlines.extend(outline);
            shapes.list.push(Shape {
                lines: starts[0]..shapes.lines.len(),
                planes: starts[1]..shapes.planes.len(),
                outline: starts[2]..shapes.outlines.len(),
                floor,
            });
        }
        shapes
    }

    /// Returns the lines and the outline of a square of the image.
    fn square(low: [f64; 2], high: [f64; 2]) -> (Vec<[f64; 3]>, Vec<[f64; 2]>) {
        let lines =
            vec![[1.0, 0.0, -low[0]], [-1.0, 0.0, high[0]], [0.0, 1.0, -low[1]], [0.0, -1.0, high[1]]];
        let inner = |x: f64, y: f64| {
            [x + (if x == low[0] { 1.0 } else { -1.0 }), y + (if y == low[1] { 1.0 } else { -1.0 })]
        };
        let outline = vec![
            inner(low[0], low[1]),
            inner(high[0], low[1]),
            inner(high[0], high[1]),
            inner(low[0], high[1]),
        ];
        (lines, outline)
    }

    /// Returns a box whose corners are the corners of a rectangle of the image, all with one depth key.
    fn flat_box(low: [f64; 2], high: [f64; 2], key: f64) -> ProjectedBox {
        let corners = core::array::from_fn(|i| {
            [0, 1].map(|axis| if i >> axis & 1 == 0 { low[axis] } else { high[axis] })
        });
        ProjectedBox { corners, low, high, keys: [key; 8], nearest: key }
    }

    /// A search visits all triangles that it finds, in whatever order it finds them, and each once.
    #[test]
    fn a_search_visits_all_that_it_finds() {
        let mut search = Search::new();
        let mut visited = Vec::new();
        for found in [&[300, 5][..], &[70, 300, 6], &[0, 8191, 5], &[]] {
            assert!(found.iter().all(|&t| search.push(t)), "{found:?} are within the limit");
            visited.extend(search.pop());
        }
        visited.extend(core::iter::from_fn(|| search.pop()));
        visited.sort_unstable();
        assert_eq!(visited, [0, 5, 6, 70, 300, 8191], "triangles visited");
        assert!(!search.push(MAX_TRIANGLES as u32), "a triangle beyond the limit");
    }

    #[test]
    fn triangles_meet_rectangles_that_they_touch() {
        let region = Region { low: [10.0, 20.0], high: [30.0, 40.0], hull: &[] };
        let at = |x: f64, y: f64| region.meets_rectangle(&[[x, y], [x + 5.0, y], [x, y + 5.0]]);
        for (x, y, meets) in [
            (5.0, 25.0, true),
            (4.0, 25.0, false),
            (30.0, 25.0, true),
            (31.0, 25.0, false),
            (15.0, 15.0, true),
            (15.0, 14.0, false),
            (15.0, 40.0, true),
            (15.0, 41.0, false),
        ] {
            assert_eq!(at(x, y), meets, "a triangle from {x}, {y}");
        }
    }

    /// A point that is off by half a unit on each axis meets the triangles that it is in or on.
    #[test]
    fn triangles_meet_points_that_are_off_by_half_a_unit() {
        let triangle = [[0.0, 0.0], [70.0, 20.0], [10.0, 90.0]];
        for k in 0..3 {
            let [a, b] = [triangle[k], triangle[(k + 1) % 3]];
            for off in [[0.5, 0.5], [0.5, -0.5], [-0.5, 0.5], [-0.5, -0.5]] {
                let hull = [[0.3 * a[0] + 0.7 * b[0] + off[0], 0.3 * a[1] + 0.7 * b[1] + off[1]]];
                let region = Region { low: [0.0; 2], high: [99.0; 2], hull: &hull };
                assert!(region.meets_hull(&triangle), "side {k}, off by {off:?}");
            }
            let hull = [[a[1] - b[1], b[0] - a[0]].map(|across| -9.0 * across)];
            let region = Region { low: [0.0; 2], high: [99.0; 2], hull: &hull };
            assert!(!region.meets_hull(&triangle), "far beyond side {k}");
        }
    }

    /// A box is behind a plane if its corners are, a quarter of a unit from where they are computed.
    #[test]
    fn boxes_are_behind_planes_with_the_errors_of_their_corners() {
        let plane = [0.5, -0.25, 8.0];
        let of = shapes(&[(&[], &[[0.0, 0.0, 99.0], plane], &[], 0.0), (&[], &[], &[], 0.0)]);
        let key = at(plane, [30.0, 40.0]);
        // The plane falls by as much from the computed corner to the worst one.
        let slack = 0.25 * 0.5 + 0.25 * 0.25;
        for (key, is_hidden) in [
            (key - slack, false),
            ((key - slack).next_down(), true),
            (key - 0.6 * slack, false),
            (key - 2.0 * slack, true),
        ] {
            let bounds = flat_box([30.0, 40.0], [30.0, 40.0], key);
            assert_eq!(is_behind(&of, &of.list[0], &bounds), is_hidden, "a key of {key}");
            assert!(!is_behind(&of, &of.list[1], &bounds), "a shape without planes");
        }
        for (x, is_known) in
            [(-RIM, false), ((-RIM).next_up(), true), (0.0, true), (REACH.next_down(), true), (REACH, false)]
        {
            for place in [[x, 5.0], [5.0, x]] {
                let bounds = flat_box(place, place, -1e9);
                assert_eq!(is_behind(&of, &of.list[0], &bounds), is_known, "a corner at {place:?}");
            }
        }
    }

    #[test]
    fn least_keys_are_those_of_the_intersection() {
        let triangle = [[10.0, 0.0], [30.0, 0.0], [10.0, 30.0]];
        let rectangle = [[20.0, -5.0], [50.0, -5.0], [50.0, 50.0], [20.0, 50.0]];
        let (rising, falling) = ([1.0, 0.0, 0.0], [-1.0, 0.0, 60.0]);
        let of = shapes(&[
            (&[], &[rising], &[], 0.0),
            (&[], &[falling], &[], 0.0),
            (&[], &[rising, falling], &[], 0.0),
            (&[], &[rising], &[], 15.0),
            (&[], &[], &[], 3.0),
        ]);
        for (at, whole, part) in
            [(0, 10.0, 20.0), (1, 30.0, 30.0), (2, 10.0, 20.0), (3, 15.0, 20.0), (4, 3.0, 3.0)]
        {
            assert_eq!(least_key(&of, &of.list[at], &triangle, &[]), whole, "shape {at}");
            assert_eq!(
                least_key(&of, &of.list[at], &triangle, &rectangle),
                part,
                "shape {at} in a rectangle"
            );
        }
    }

    /// Boxes are hidden where shapes cover all that they meet and are nearer; equally near is not nearer.
    #[test]
    fn boxes_are_hidden_by_nearer_shapes_that_cover_them() {
        let (left, right) = (square([100.0; 2], [200.0; 2]), square([150.0, 100.0], [300.0, 200.0]));
        let level = [[0.0, 0.0, 5.0]];
        let of = shapes(&[(&left.0, &level, &left.1, f64::NEG_INFINITY), (&right.0, &level, &right.1, 5.0)]);
        let mut image = Image::default();
        image.clear();
        assert!(image.is_empty(), "an image without shapes");
        image.add(&of, 0);
        assert!(!image.is_empty(), "an image with a shape");
        let hides = |image: &Image, low: [f64; 2], high: [f64; 2], key: f64| {
            image.hides(&of, &flat_box(low, high, key))
        };
        for key in [4.0, 5.0f64.next_down(), 5.0, 6.0] {
            assert_eq!(hides(&image, [120.0; 2], [180.0; 2], key), key < 5.0, "behind one shape, at {key}");
            assert!(!hides(&image, [120.0; 2], [250.0, 180.0], key), "beside one shape, at {key}");
        }
        image.add(&of, 1);
        for key in [4.0, 5.0f64.next_down(), 5.0, 6.0] {
            assert_eq!(hides(&image, [120.0; 2], [250.0, 180.0], key), key < 5.0, "behind both, at {key}");
            assert_eq!(hides(&image, [220.0, 120.0], [250.0, 180.0], key), key < 5.0, "the second, at {key}");
        }
        // Outlines are moved inwards by a unit here, boxes outwards by one, and their corners are off by one.
        for (low, is_hidden) in [(103.0, true), (102.0, false), (100.0, false)] {
            assert_eq!(hides(&image, [low, 120.0], [180.0; 2], 1.0), is_hidden, "from column {low}");
            assert_eq!(hides(&image, [120.0, low], [180.0; 2], 1.0), is_hidden, "from row {low}");
        }
        for (high, is_hidden) in [(197.0, true), (198.0, false), (200.0, false)] {
            assert_eq!(hides(&image, [120.0; 2], [180.0, high], 1.0), is_hidden, "to row {high}");
        }
        image.clear();
        assert!(image.is_empty() && !hides(&image, [120.0; 2], [180.0; 2], 1.0), "an image that was cleared");
    }

    /// The nearer of two shapes fills the triangles that both shapes cover, whichever is added first.
    #[test]
    fn nearer_shapes_fill_what_several_cover() {
        let (left, right) = (square([100.0; 2], [300.0; 2]), square([150.0, 100.0], [400.0, 300.0]));
        let [far, near] = [[[0.0, 0.0, 2.0]], [[0.0, 0.0, 5.0]]];
        let floor = f64::NEG_INFINITY;
        let of = shapes(&[(&left.0, &far, &left.1, floor), (&right.0, &near, &right.1, floor)]);
        for order in [[0, 1], [1, 0]] {
            let mut image = Image::default();
            image.clear();
            order.iter().for_each(|&number| image.add(&of, number));
            for key in [1.0, 4.0, 5.5] {
                let both = flat_box([160.0, 120.0], [290.0; 2], key);
                assert_eq!(image.hides(&of, &both), key < 5.0, "{order:?}: in both shapes, at {key}");
                let either = flat_box([110.0, 120.0], [390.0, 290.0], key);
                assert_eq!(image.hides(&of, &either), key < 2.0, "{order:?}: in one of them, at {key}");
            }
        }
    }
}
