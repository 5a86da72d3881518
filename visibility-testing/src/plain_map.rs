//! Simple reference occlusion map for tests of the others: a grid of pixels, in which each pixel is clipped
//! against every triangle of every occluder in homogeneous coordinates.
//!
//! A mesh covers a pixel if one of its drawn triangles meets the pixel and none of its contours does. The
//! pixel's depth is that of the farthest point of the mesh's drawn triangles in the pixel. If several meshes
//! cover a pixel, the nearest depth wins.

use visibility_core::glam::{Affine3A, DMat4, DVec3, DVec4};
use visibility_core::{
    Aabb, Accuracy, OccluderMesh, OcclusionMap, View,
    occlusion::Occlusion,
    view::{Eye, ViewPlanes},
};

/// Margin, in normalised device coordinates and in relative depth, by which pixels are enlarged for clipping
/// and depths are increased. Far above rounding, far below a pixel.
const SLACK: f64 = 1e-9;

/// Occlusion map that holds, for each pixel, an upper bound on the depth of the surface that covers the
/// pixel. Conservative and slow, as a reference in tests.
pub struct PlainMap {
    /// Number of columns.
    width: usize,
    /// Number of rows.
    height: usize,
    /// View of the present frame; `None` before the first.
    view: Option<View>,
    /// Clip matrix for points relative to the scene's origin.
    clip: DMat4,
    /// Eye of the view, relative to the scene's origin.
    eye: Eye,
    /// Clip planes of the view, relative to the scene's origin; none before the first frame.
    clip_planes: ViewPlanes,
    /// For each pixel, row by row from the top, the depth at which it is certainly covered: clip w for
    /// perspective views, clip z for parallel views. Infinite in uncovered pixels.
    depth: Vec<f64>,
    /// Same as `depth`, but including occluders that were added and not flushed yet.
    pending: Vec<f64>,
}

impl PlainMap {
    /// Makes an empty map of the given numbers of columns and rows.
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            view: None,
            clip: DMat4::IDENTITY,
            eye: Eye::Point(DVec3::ZERO),
            clip_planes: ViewPlanes::NONE,
            depth: vec![f64::INFINITY; width * height],
            pending: vec![f64::INFINITY; width * height],
        }
    }

    /// Returns the number of covered pixels.
    pub fn covered(&self) -> usize {
        self.depth.iter().filter(|depth| depth.is_finite()).count()
    }

    /// Projects a point, relative to the scene's origin, to clip space.
    fn project(&self, p: DVec3) -> DVec4 {
        self.clip * p.extend(1.0)
    }

    /// Returns a depth of a clip-space point that increases along every view ray: distance along the viewing
    /// direction (w) for perspective views, clip depth for parallel views.
    fn distance(&self, p: DVec4) -> f64 {
        match self.eye {
            Eye::Point(_) => p.w,
            Eye::Direction(_) if self.view.is_some_and(|view| view.depth().is_reversed()) => -p.z / p.w,
            Eye::Direction(_) => p.z / p.w,
        }
    }

    /// Returns the signed distance of a clip-space point from the near plane, in clip units: positive beyond
    /// the plane, negative between the eye and the plane and behind the eye.
    fn beyond_near(&self, p: DVec4) -> f64 {
        use visibility_core::view::Depth::*;
        match self.view.map(|view| view.depth()) {
            Some(NegativeOneToOne | NegativeOneToOneInfinite) => p.w + p.z,
            Some(ZeroToOne | ZeroToOneInfinite) | None => p.z,
            Some(Reversed | ReversedInfinite) => p.w - p.z,
        }
    }

    /// Returns the sides of a pixel in normalised device coordinates: left, right, bottom, top.
    fn sides(&self, column: usize, row: usize) -> [f64; 4] {
        let x = |i: usize| i as f64 / self.width as f64 * 2.0 - 1.0;
        let y = |i: usize| 1.0 - i as f64 / self.height as f64 * 2.0;
        [x(column), x(column + 1), y(row + 1), y(row)]
    }

    /// Returns the part of a polygon or segment, in clip space, inside a pixel whose sides are moved outwards
    /// by `slack`. The sides are left, right, bottom, top in normalised device coordinates. Empty if the
    /// polygon is outside of the pixel.
    fn clip_to_pixel(
        &self,
        points: &[DVec4],
        [left, right, bottom, top]: [f64; 4],
        slack: f64,
    ) -> Vec<DVec4> {
        let mut points = points.to_vec();
        points = clip(&points, |p| p.x - (left - slack) * p.w);
        points = clip(&points, |p| (right + slack) * p.w - p.x);
        points = clip(&points, |p| p.y - (bottom - slack) * p.w);
        clip(&points, |p| (top + slack) * p.w - p.y)
    }

    /// Returns the pixels that points beyond the near plane may reach: first column, end of the columns,
    /// first row, end of the rows, with exclusive ends. The range is empty outside of the image.
    fn reach(&self, points: &[DVec4]) -> [usize; 4] {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for p in points {
            let at =
                [(p.x / p.w + 1.0) * 0.5 * self.width as f64, (1.0 - p.y / p.w) * 0.5 * self.height as f64];
            for axis in 0..2 {
                low[axis] = low[axis].min(at[axis]);
                high[axis] = high[axis].max(at[axis]);
            }
        }
        // Casts to integers saturate.
        let first = |x: f64| (x - 0.01).floor().max(0.0) as usize;
        let end = |x: f64, size: usize| ((x + 0.01).ceil().max(0.0) as usize).min(size);
        [first(low[0]), end(high[0], self.width), first(low[1]), end(high[1], self.height)]
    }
}

/// Clips a polygon, or a segment as a polygon of two corners, by one plane (Sutherland and Hodgman). Keeps
/// the part where `inside`, a linear function, is not negative.
fn clip(points: &[DVec4], inside: impl Fn(&DVec4) -> f64) -> Vec<DVec4> {
    let mut kept = Vec::new();
    for (i, b) in points.iter().enumerate() {
        let a = &points[(i + points.len() - 1) % points.len()];
        let (da, db) = (inside(a), inside(b));
        if (da < 0.0) != (db < 0.0) {
            kept.push(*a + (*b - *a) * (da / (da - db)));
        }
        if db >= 0.0 {
            kept.push(*b);
        }
    }
    kept
}

impl OcclusionMap for PlainMap {
    fn name(&self) -> &str {
        "plain"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        self.view = Some(*view);
        self.clip = view.clip_from(origin);
        self.eye = view.eye(origin);
        self.clip_planes = view.clip_planes_from(origin);
        self.depth.fill(f64::INFINITY);
        self.pending.fill(f64::INFINITY);
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        if !occluder.is_inside(&self.clip_planes, transform) {
            return;
        }
        let at = |i: u32| transform.transform_point3(occluder.positions()[i as usize]).as_dvec3();
        // For each triangle: 1 if drawn from its front, -1 if drawn from its back, 0 if not drawn.
        let mirrored = transform.matrix3.determinant() < 0.0;
        let facing: Vec<i8> = occluder
            .triangles()
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(at);
                let normal = (b - a).cross(c - a);
                let seen = match self.eye {
                    Eye::Point(eye) => normal.dot((eye - a).normalize_or_zero()),
                    Eye::Direction(along) => -normal.dot(along),
                } * if mirrored { -1.0 } else { 1.0 };
                let certain = 1e-6 * normal.length();
                match seen {
                    s if s > certain => 1,
                    s if s < -certain && occluder.is_two_sided() => -1,
                    _ => 0,
                }
            })
            .collect();
        let in_front = |polygon: &[DVec4]| clip(polygon, |p| self.beyond_near(*p));

        let mut contours: Vec<Vec<DVec4>> = Vec::new();
        for edge in occluder.edges() {
            let left = facing[edge.left as usize];
            let right = edge.right.map_or(0, |triangle| facing[triangle as usize]);
            // Two drawn triangles that traverse an edge in opposite directions, as drawn, join there. Every
            // other edge of a drawn triangle is a contour.
            if (left != 0 || right != 0) && left != right {
                contours.push(in_front(&edge.vertices.map(|i| self.project(at(i)))));
            }
        }
        let mut polygons = Vec::new();
        for (t, facing) in occluder.triangles().iter().zip(&facing) {
            if *facing == 0 {
                continue;
            }
            let whole = t.map(|i| self.project(at(i)));
            let polygon = in_front(&whole);
            // The line where the near plane cuts a triangle is a contour.
            for (i, b) in polygon.iter().enumerate() {
                let a = &polygon[(i + polygon.len() - 1) % polygon.len()];
                let cut = |p: &DVec4| !whole.contains(p);
                if cut(a) && cut(b) {
                    contours.push(vec![*a, *b]);
                }
            }
            polygons.push(polygon);
        }

        let mut farthest = vec![f64::NEG_INFINITY; self.width * self.height];
        for polygon in polygons.iter().filter(|polygon| polygon.len() > 2) {
            let [x0, x1, y0, y1] = self.reach(polygon);
            for row in y0..y1 {
                for column in x0..x1 {
                    let part = self.clip_to_pixel(polygon, self.sides(column, row), SLACK);
                    let far = part.iter().map(|p| self.distance(*p)).fold(f64::NEG_INFINITY, f64::max);
                    let pixel = &mut farthest[row * self.width + column];
                    *pixel = pixel.max(far);
                }
            }
        }
        for contour in contours.iter().filter(|contour| !contour.is_empty()) {
            let [x0, x1, y0, y1] = self.reach(contour);
            // A contour along the side of a pixel also meets the neighbour on the other side.
            for row in y0.saturating_sub(1)..(y1 + 1).min(self.height) {
                for column in x0.saturating_sub(1)..(x1 + 1).min(self.width) {
                    if !self.clip_to_pixel(contour, self.sides(column, row), SLACK).is_empty() {
                        farthest[row * self.width + column] = f64::INFINITY;
                    }
                }
            }
        }
        for (pixel, far) in self.pending.iter_mut().zip(farthest) {
            if far != f64::NEG_INFINITY {
                *pixel = pixel.min(far * (1.0 + SLACK.copysign(far)));
            }
        }
    }

    fn flush(&mut self) {
        for (depth, pending) in self.depth.iter_mut().zip(&self.pending) {
            *depth = depth.min(*pending);
        }
    }

    fn test(&self, bounds: &Aabb) -> Occlusion {
        if !bounds.is_finite() {
            return Occlusion::Visible;
        }
        let corners = bounds.corners().map(|corner| self.project(corner.as_dvec3()));
        if corners.iter().any(|p| self.beyond_near(*p) <= 0.0 || p.w <= 0.0) {
            // The box crosses the near plane, but objects inside it may still be hidden.
            return Occlusion::Partial;
        }
        let nearest = corners.iter().map(|p| self.distance(*p)).fold(f64::INFINITY, f64::min);
        let [x0, x1, y0, y1] = self.reach(&corners);
        let pixels = || (y0..y1).flat_map(|row| (x0..x1).map(move |column| row * self.width + column));
        if x0 >= x1 || y0 >= y1 {
            return Occlusion::Partial;
        }
        if pixels().all(|pixel| self.depth[pixel] < nearest) {
            Occlusion::Hidden
        } else if pixels().all(|pixel| self.depth[pixel] == f64::INFINITY) {
            Occlusion::Visible
        } else {
            Occlusion::Partial
        }
    }
}
