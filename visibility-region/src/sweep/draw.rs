//! Extended projections of occluders: which pixels of a plane no ray from the viewcell passes unblocked.
//!
//! After Durand, Drettakis, Thollot and Puech, "Conservative Visibility Preprocessing Using Extended
//! Projections", 2000, sections 3.2 and 3.3, with a rule for coverage that holds for concave, open and thin
//! meshes as well:
//!
//! The *chain* of a mesh are those of its triangles that face the whole viewcell, cut at the plane. For a ray
//! from viewpoint v to point p of the plane, count the triangles of the chain that it crosses. The count can
//! change with v and p only where the ray crosses an edge that bounds the chain: an edge with one drawn
//! triangle, or a cut. (Across an edge of two drawn triangles the ray leaves one and enters the other, since
//! both face the viewpoint.) So if from no viewpoint such an edge, the *contour*, is seen in a pixel, then
//! the count is the same for all rays through the pixel; and if one ray certainly crosses a triangle, all do.
//! A pixel is covered if one ray from the middle of the cell's front crosses a drawn triangle in it, and no
//! contour edge, swept over all viewpoints and widened by the bound on rounding, meets it.
//!
//! Chains are split at contours into pieces that share no inner edge. Each piece is a chain by itself, so the
//! contour of one leaf does not cut what another covers.

use super::direction::{Direction, LocalBox};
use super::facing::facing;
use super::pieces::{Piece, Pieces};
use super::ray_map::{PixelRect, RayMap, SIDE};
use super::surfaces::Surfaces;
use super::window::{SLACK, Window};
use alloc::vec::Vec;
use visibility_core::OccluderMesh;
use visibility_core::glam::{Affine3A, DVec3};

/// Pixel coordinates beyond this are not computed with: 2^30, whose rounding errors are below
/// `SLACK / 2^10`.
const FARTHEST_PIXEL: f64 = 1_073_741_824.0;

/// An occluder placed in local coordinates of a direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Occluder<'a> {
    shape: Shape<'a>,
    /// Map from mesh coordinates to local coordinates.
    rows: [DVec3; 3],
    offset: DVec3,
    /// Bound on the error of each local coordinate of a vertex, in metres.
    error: f64,
    /// True if the map mirrors, so that front faces run clockwise in local coordinates.
    mirrored: bool,
    pub(crate) bounds: LocalBox,
}

/// What an occluder is drawn from.
#[derive(Clone, Copy, Debug)]
enum Shape<'a> {
    /// A mesh, or one part of a mesh, in coordinates of its own.
    Mesh(&'a OccluderMesh),
    /// A piece of surfaces: its triangles, all of which face the cell, and the segments that bound it.
    Piece { surfaces: &'a Surfaces, triangles: &'a [u32], contour: &'a [u32] },
}

impl<'a> Occluder<'a> {
    /// Places a mesh. `None` if its transform flattens it, or if numbers are not finite.
    pub(crate) fn new(direction: &Direction, mesh: &'a OccluderMesh, transform: &Affine3A) -> Option<Self> {
        let columns = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis]
            .map(|column| DVec3::from_array(column.to_array().map(f64::from)));
        let translation = DVec3::from_array(transform.translation.to_array().map(f64::from));
        let rows = direction.rows.map(|row| DVec3::from_array(columns.map(|column| row.dot(column))));
        let offset = DVec3::from_array(direction.rows.map(|row| row.dot(translation)))
            - DVec3::from_array(direction.offset);
        let (min, max) = (mesh.bounds().min.as_dvec3(), mesh.bounds().max.as_dvec3());
        let far = min.abs().max(max.abs());
        let magnitude = translation.abs().element_sum()
            + (0..3).map(|axis| columns[axis].abs().element_sum() * far[axis]).sum::<f64>();
        // The products of rows and columns round three products and two sums, those with a vertex as many,
        // and the offset is added: with u = EPSILON / 2, less than 16 u of the magnitude, and the offset's
        // own error is the direction's.
        let error = 16.0 * f64::EPSILON * magnitude + direction.error;
        let determinant = rows[0].cross(rows[1]).dot(rows[2]);
        let size: f64 = rows.iter().map(|row| row.abs().element_sum()).product();
        // Each of the six products of the determinant rounds by some u of at most `size`.
        if !(determinant.abs() > 32.0 * f64::EPSILON * size && error.is_finite()) {
            return None;
        }
        let (mut lo, mut hi) = (offset, offset);
        for axis in 0..3 {
            let (a, b) = (rows[axis] * min, rows[axis] * max);
            lo[axis] += a.min(b).element_sum();
            hi[axis] += a.max(b).element_sum();
        }
        let bounds = LocalBox { lo, hi };
        let shape = Shape::Mesh(mesh);
        Some(Self { shape, rows, offset, error, mirrored: determinant < 0.0, bounds })
    }

    /// Places a piece.
    pub(crate) fn piece(
        direction: &Direction,
        surfaces: &'a Surfaces,
        pieces: &'a Pieces,
        piece: &'a Piece,
    ) -> Self {
        let far = piece.bounds.min.abs().max(piece.bounds.max.abs()).as_dvec3().element_sum();
        let (triangles, contour) = (pieces.triangles(piece), pieces.contour(piece));
        Self {
            shape: Shape::Piece { surfaces, triangles, contour },
            rows: direction.rows,
            offset: -DVec3::from_array(direction.offset),
            // As above, with a transform that does not round.
            error: 16.0 * f64::EPSILON * far + direction.error,
            mirrored: false,
            bounds: direction.local_box(&piece.bounds),
        }
    }

    fn local(&self, p: visibility_core::glam::Vec3) -> DVec3 {
        let p = p.as_dvec3();
        DVec3::new(self.rows[0].dot(p), self.rows[1].dot(p), self.rows[2].dot(p)) + self.offset
    }

    /// Returns whether the error of vertices is no more than planes and occludees allow for: at most 4 times
    /// that of points of the scene. Meshes of which a transform cancels nearly all are not.
    pub(crate) fn is_precise(&self, direction: &Direction) -> bool {
        self.error <= 4.0 * direction.error
    }

    /// Returns the pixels that may be within all views of what this occluder has between depth `near` and the
    /// plane. `None` if there are none: the occluder then covers no pixel.
    pub(crate) fn pixels_behind(
        &self,
        direction: &Direction,
        window: &Window,
        near: f64,
    ) -> Option<PixelRect> {
        let (near, far) = (self.bounds.lo.z.max(near), self.bounds.hi.z.min(window.d));
        (near <= far).then_some(())?;
        let along = |lat| {
            let [left, right] = direction.common_view(window.d, &self.bounds, [near, far], lat);
            let (left, right) = (window.pixel(left, lat).max(0.0), window.pixel(right, lat).min(SIDE as f64));
            (right - left >= 1.0).then_some(())?;
            let first = left as usize + usize::from(left > (left as usize) as f64);
            (first < right as usize).then_some([first, right as usize - 1])
        };
        Some(PixelRect { x: along(0)?, y: along(1)? })
    }
}

/// Scratch memory for drawing.
#[derive(Clone, Debug)]
pub(crate) struct Pen {
    brush: Brush,
    vertices: Vec<DVec3>,
    /// For each triangle, 1 if it faces the whole cell, -1 if its back does, 0 if neither; twice that once
    /// it is in a piece.
    facing: Vec<i8>,
    stack: Vec<u32>,
    piece: Vec<u32>,
}

/// The two maps that one piece is drawn on.
#[derive(Clone, Debug)]
struct Brush {
    inside: RayMap,
    contour: RayMap,
}

/// A part of the contour, swept: the rectangle of the pixels that it may be seen in, in pixel coordinates
/// that include the slack. Minimum and maximum x, then y.
type Spread = [[f64; 2]; 2];

/// What the drawing of one occluder needs in every step.
struct Target<'a> {
    direction: &'a Direction,
    window: &'a Window,
    /// Depth at which the chain is cut, on the side of the viewcell.
    near: f64,
    /// Pixels that the occluder may cover. Nothing is drawn outside of them.
    rect: PixelRect,
}

impl Pen {
    pub(crate) fn new() -> Self {
        Self {
            brush: Brush { inside: RayMap::new(), contour: RayMap::new() },
            vertices: Vec::new(),
            facing: Vec::new(),
            stack: Vec::new(),
            piece: Vec::new(),
        }
    }

    /// Adds to `map` the pixels that an occluder covers. What is nearer than `near` does not count. Returns
    /// whether the occluder was drawn at all.
    pub(crate) fn draw(
        &mut self,
        map: &mut RayMap,
        direction: &Direction,
        window: &Window,
        occluder: &Occluder<'_>,
        near: f64,
    ) -> bool {
        let Some(rect) = occluder.pixels_behind(direction, window, near) else { return false };
        if map.all_set(rect) || !Self::decides(direction, window, occluder, near) {
            return false;
        }
        let target = Target { direction, window, near, rect };
        match occluder.shape {
            Shape::Mesh(mesh) => self.draw_mesh(map, &target, occluder, mesh),
            Shape::Piece { surfaces, triangles, contour } => {
                let triangles = triangles
                    .iter()
                    .map(|&t| surfaces.triangles[t as usize].corners.map(|p| occluder.local(p)));
                let contour =
                    contour.iter().map(|&s| surfaces.segments[s as usize].map(|p| occluder.local(p)));
                self.brush.draw(map, &target, triangles, contour);
            }
        }
        true
    }

    fn draw_mesh(
        &mut self,
        map: &mut RayMap,
        target: &Target<'_>,
        occluder: &Occluder<'_>,
        mesh: &OccluderMesh,
    ) {
        self.vertices.clear();
        self.vertices.extend(mesh.positions().iter().map(|&p| occluder.local(p)));
        let (fronts, backs) = self.classify(target.direction, occluder, mesh);
        if fronts {
            self.draw_chain(map, target, mesh, 1);
        }
        if backs && mesh.is_two_sided() && !(fronts && mesh.is_closed()) {
            self.draw_chain(map, target, mesh, -1);
        }
    }

    /// Returns whether the errors of vertices stay below the slack in pixels on this plane.
    fn decides(direction: &Direction, window: &Window, occluder: &Occluder<'_>, near: f64) -> bool {
        // A vertex at (x, z) is seen at x + (x - v) (d - z) / (z + w). With w >= 0 and |v| <= h its
        // derivative by x is at most d / z, that by z at most (|x| + h) d / z^2.
        let LocalBox { lo, hi } = occluder.bounds;
        let z = lo.z.max(near);
        (0..2).all(|lat| {
            let x = lo[lat].abs().max(hi[lat].abs()) + direction.half[lat];
            occluder.error * window.scale(lat) * (window.d / z) * (1.0 + x / z) < SLACK * 0.25
        })
    }

    /// Classifies the triangles by the side that faces the viewcell. Returns whether there are any that show
    /// it their front, and their back.
    fn classify(
        &mut self,
        direction: &Direction,
        occluder: &Occluder<'_>,
        mesh: &OccluderMesh,
    ) -> (bool, bool) {
        let half = DVec3::new(direction.half[0], direction.half[1], direction.depth * 0.5);
        let center = DVec3::new(0.0, 0.0, -half.z);
        let (mut fronts, mut backs) = (false, false);
        self.facing.clear();
        for t in mesh.triangles() {
            let corners = t.map(|i| self.vertices[i as usize]);
            let side = facing(corners, center, half, occluder.error, occluder.mirrored);
            fronts |= side > 0;
            backs |= side < 0;
            self.facing.push(side);
        }
        (fronts, backs)
    }

    /// Draws the triangles whose `facing` is `side`, piece by piece.
    fn draw_chain(&mut self, map: &mut RayMap, target: &Target<'_>, mesh: &OccluderMesh, side: i8) {
        for first in 0..self.facing.len() {
            if self.facing[first] != side {
                continue;
            }
            self.collect_piece(mesh, first as u32, side);
            let (vertices, facing, piece) = (&self.vertices, &self.facing, &self.piece);
            let corners = |t: u32| mesh.triangles()[t as usize].map(|i| vertices[i as usize]);
            let contour = piece.iter().flat_map(|&t| {
                let (edges, corners) = (mesh.triangle_edges()[t as usize], corners(t));
                (0..3).filter_map(move |corner| {
                    let other = neighbour(mesh, edges[corner], t);
                    let inner = other.is_some_and(|other| facing[other as usize] == 2 * side);
                    (!inner).then_some([corners[corner], corners[(corner + 1) % 3]])
                })
            });
            self.brush.draw(map, target, piece.iter().map(|&t| corners(t)), contour);
        }
    }

    /// Collects the drawn triangles that are joined to `first` across inner edges.
    fn collect_piece(&mut self, mesh: &OccluderMesh, first: u32, side: i8) {
        self.piece.clear();
        self.stack.push(first);
        self.facing[first as usize] = 2 * side;
        while let Some(triangle) = self.stack.pop() {
            self.piece.push(triangle);
            for edge in mesh.triangle_edges()[triangle as usize] {
                if let Some(other) = neighbour(mesh, edge, triangle)
                    && self.facing[other as usize] == side
                {
                    self.facing[other as usize] = 2 * side;
                    self.stack.push(other);
                }
            }
        }
    }
}

impl Brush {
    /// Adds to `map` the pixels that a piece covers. `contour` are the edges that bound it, before it is cut.
    fn draw(
        &mut self,
        map: &mut RayMap,
        target: &Target<'_>,
        triangles: impl Iterator<Item = [DVec3; 3]> + Clone,
        contour: impl Iterator<Item = [DVec3; 2]>,
    ) {
        let Target { window, near, rect, .. } = *target;
        let mut filled = false;
        for triangle in triangles.clone() {
            if triangle.iter().any(|p| p.z < window.d) && triangle.iter().any(|p| p.z > near) {
                filled |= fill(&mut self.inside, map, &Polygon::cut(triangle, near, window.d), window, rect);
            }
        }
        if !filled {
            return;
        }
        if map.lacks(&self.inside, rect) {
            let known = triangles.into_iter().all(|triangle| self.sweep_cuts(target, triangle))
                && contour.into_iter().all(|[a, b]| self.sweep_edge(target, a, b));
            if known {
                map.add_difference(&self.inside, &self.contour, rect);
            }
            self.contour.clear_rect(rect);
        }
        self.inside.clear_rect(rect);
    }

    /// Draws the edges that the plane and the near cut leave of a triangle. Returns false if a position is
    /// too far away to compute with.
    fn sweep_cuts(&mut self, target: &Target<'_>, triangle: [DVec3; 3]) -> bool {
        let Target { window, near, .. } = *target;
        if triangle.iter().all(|p| p.z > near && p.z < window.d) {
            return true;
        }
        let polygon = Polygon::cut(triangle, near, window.d);
        let points = polygon.points();
        points.iter().enumerate().all(|(i, &a)| {
            let b = points[(i + 1) % points.len()];
            let cut = (a.z == near && b.z == near) || (a.z == window.d && b.z == window.d);
            !cut || self.sweep_edge(target, a, b)
        })
    }

    /// Marks the pixels in which a contour edge is seen from any viewpoint of the cell, as far as the edge is
    /// between the near cut and the plane. Returns false if a position is too far away to compute with.
    fn sweep_edge(&mut self, target: &Target<'_>, a: DVec3, b: DVec3) -> bool {
        let Target { direction, window, near, rect } = *target;
        let (mut a, mut b) = if a.z <= b.z { (a, b) } else { (b, a) };
        if b.z < near || a.z > window.d {
            return true;
        }
        if b.z > window.d {
            b = cut(a, b, window.d);
        }
        if a.z < near {
            a = cut(a, b, near);
        }
        let spread = |p: DVec3| -> Spread {
            let factors = direction.beyond(p.z, window.d);
            [0, 1].map(|lat| {
                let [low, high] = direction.spread(p[lat], lat, factors);
                [window.pixel(low, lat) - SLACK, window.pixel(high, lat) + SLACK]
            })
        };
        let (p, q) = (spread(a), spread(b));
        if !p.iter().chain(&q).flatten().all(|x| x.abs() < FARTHEST_PIXEL) {
            return false;
        }
        draw_hull(&mut self.contour, &p, &q, rect);
        true
    }
}

/// Returns the triangle on the other side of an edge, if the edge has exactly two.
#[inline]
fn neighbour(mesh: &OccluderMesh, edge: u32, triangle: u32) -> Option<u32> {
    let edge = &mesh.edges()[edge as usize];
    edge.right.map(|right| if edge.left == triangle { right } else { edge.left })
}

/// Returns the point at depth `z` of the segment from `a` to `b`, where `a.z < z < b.z`.
fn cut(a: DVec3, b: DVec3, z: f64) -> DVec3 {
    let p = a + (b - a) * ((z - a.z) / (b.z - a.z));
    DVec3::new(p.x, p.y, z)
}

/// A triangle, and what two cuts leave of it.
struct Polygon {
    points: [DVec3; 5],
    count: usize,
}

impl Polygon {
    /// Returns the part of a triangle between two depths.
    fn cut([a, b, c]: [DVec3; 3], near: f64, far: f64) -> Self {
        let mut polygon = Self { points: [a, b, c, c, c], count: 3 };
        polygon.clip(near, 1.0);
        polygon.clip(far, -1.0);
        polygon
    }

    fn points(&self) -> &[DVec3] {
        &self.points[..self.count]
    }

    /// Keeps the part with `z` at least `at` (`side` 1) or at most `at` (`side` -1).
    fn clip(&mut self, at: f64, side: f64) {
        let behind = |p: DVec3| (p.z - at) * side < 0.0;
        if !self.points().iter().any(|&p| behind(p)) {
            return;
        }
        let mut kept = Self { points: self.points, count: 0 };
        let mut push = |p| {
            // A convex polygon of three corners has at most one more after each of two cuts.
            if kept.count < kept.points.len() {
                kept.points[kept.count] = p;
                kept.count += 1;
            }
        };
        for (i, &a) in self.points().iter().enumerate() {
            let b = self.points[(i + 1) % self.count];
            if !behind(a) {
                push(a);
            }
            // The same point whichever way the edge runs: neighbours are cut at the same points.
            let (low, high) = if a.z <= b.z { (a, b) } else { (b, a) };
            if low.z < at && high.z > at {
                push(cut(low, high, at));
            }
        }
        *self = kept;
    }
}

/// Sets the pixels of `rect` in which a polygon, seen from the middle of the cell's front, meets the middle
/// line of the pixel's row. Returns whether there are any.
fn fill(inside: &mut RayMap, map: &RayMap, polygon: &Polygon, window: &Window, rect: PixelRect) -> bool {
    let count = polygon.count;
    if count < 3 {
        return false;
    }
    let mut p = [[0.0; 2]; 5];
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    for (p, at) in p.iter_mut().zip(polygon.points()) {
        let scale = window.d / at.z;
        *p = [window.pixel(at.x * scale, 0), window.pixel(at.y * scale, 1)];
        (low, high) = (low.min(p[1]), high.max(p[1]));
        (left, right) = (left.min(p[0]), right.max(p[0]));
    }
    let (first, last) = (low.max(rect.y[0] as f64), high.min(rect.y[1] as f64 + 1.0));
    // NaN fills nothing, too.
    let (left, right) = (left.max(rect.x[0] as f64), right.min(rect.x[1] as f64 + 0.5));
    let meets = first <= last && left <= right;
    if !meets {
        return false;
    }
    let (first, last) = (first as usize, (last as usize).min(rect.y[1]));
    if map.all_set(PixelRect { x: [left as usize, right as usize], y: [first, last] }) {
        return false;
    }
    let mut any = false;
    for row in first..=last {
        let y = row as f64 + 0.5;
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in 0..count {
            let (a, b) = (p[i], p[if i + 1 == count { 0 } else { i + 1 }]);
            if (a[1] <= y) != (b[1] <= y) {
                let x = a[0] + (b[0] - a[0]) * ((y - a[1]) / (b[1] - a[1]));
                (left, right) = (left.min(x), right.max(x));
            }
        }
        let (left, right) = (left.max(rect.x[0] as f64), right.min(rect.x[1] as f64 + 0.5));
        if left <= right {
            inside.set_span(row, left as usize, right as usize);
            any = true;
        }
    }
    any
}

/// Sets the pixels of `rect` that the convex hull of two rectangles meets: all that is between two rectangles
/// which the ends of an edge may be seen in.
fn draw_hull(map: &mut RayMap, p: &Spread, q: &Spread, rect: PixelRect) {
    let (low, high) = (p[1][0].min(q[1][0]), p[1][1].max(q[1][1]));
    let (left, right) = (p[0][0].min(q[0][0]), p[0][1].max(q[0][1]));
    let (first, last) = (low.max(rect.y[0] as f64), high.min(rect.y[1] as f64 + 1.0));
    if first > last || right < rect.x[0] as f64 || left >= rect.x[1] as f64 + 1.0 {
        return;
    }
    let left = Side::new([p[0][0], p[1][0], p[1][1]], [q[0][0], q[1][0], q[1][1]]);
    // The right side is the left one of the mirror image.
    let right = Side::new([-p[0][1], p[1][0], p[1][1]], [-q[0][1], q[1][0], q[1][1]]);
    for row in first as usize..=(last as usize).min(rect.y[1]) {
        let band = [(row as f64).max(low), (row as f64 + 1.0).min(high)];
        let (a, b) =
            (left.least(band).max(rect.x[0] as f64), (-right.least(band)).min(rect.x[1] as f64 + 0.5));
        if a <= b {
            map.set_span(row, a as usize, b as usize);
        }
    }
}

/// The left side of the hull of two upright segments: a convex function of y.
struct Side {
    /// The segment farther to the left: x and both ends.
    x: f64,
    ends: [f64; 2],
    /// x of the other segment, and the slopes from this segment's ends to that one's.
    other: f64,
    slopes: [f64; 2],
}

impl Side {
    /// From two segments as x, least y and greatest y.
    fn new(p: [f64; 3], q: [f64; 3]) -> Self {
        let ([x, low, high], [other, other_low, other_high]) = if p[0] <= q[0] { (p, q) } else { (q, p) };
        let slope = |from: f64, to: f64| if from == to { 0.0 } else { (other - x) / (to - from) };
        Self { x, ends: [low, high], other, slopes: [slope(low, other_low), slope(high, other_high)] }
    }

    /// Returns the least x within a band of y, which must meet the hull.
    #[inline]
    fn least(&self, [low, high]: [f64; 2]) -> f64 {
        let x = if low > self.ends[1] {
            self.x + (low - self.ends[1]) * self.slopes[1]
        } else if high < self.ends[0] {
            self.x + (high - self.ends[0]) * self.slopes[0]
        } else {
            self.x
        };
        // Where a slope is infinite or NaN, the whole side counts.
        if x > self.x { x.min(self.other) } else { self.x }
    }
}
