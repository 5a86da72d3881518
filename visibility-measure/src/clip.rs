//! Projection and clipping of triangles, from world space through homogeneous clip space to the image.
//!
//! Polygons are clipped plane by plane (Sutherland and Hodgman, "Reentrant Polygon Clipping", 1974) before
//! division by `w` (Blinn and Newell, "Clipping Using Homogeneous Coordinates", 1978). An edge shared by two
//! triangles is clipped in both by the same sums in the same order, from its inner to its outer end, so the
//! two cut points agree to the last bit.
//!
//! The planes of clip space and the depth conventions are repeated here, although core has them. An oracle
//! must share no projection, clipping or raster code with the code that it judges, so that a mistake there
//! cannot hide itself.

use crate::raster::{Corner, DEPTH_TIE, EDGE_TIE, Image, first_center};
use smallvec::SmallVec;
use visibility_core::glam::{DMat4, DVec2, DVec3, DVec4, Vec3};
use visibility_core::scene::Triangles;
use visibility_core::view::{Depth, Eye};
use visibility_core::{View, geometry::Plane};

/// Guard band: greatest |x / w| and |y / w| (NDC, where the image spans -1 to 1) up to which triangles are
/// not clipped by the sides of the image. With 16, few triangles need to be clipped. The coordinates become
/// at most 16 times as large, and so does their rounding error of 1e-16 times the coordinate, which is still
/// negligible.
const GUARD: f64 = 16.0;

/// Polygon in homogeneous coordinates, with inline capacity for nine vertices. Clipping a triangle by near,
/// far and four guard planes adds at most six vertices; a polygon cut by further clip planes may spill to the
/// heap.
type Polygon = SmallVec<[DVec4; 9]>;

/// Mapping of one view from points in space to one image, with the view's clip planes.
pub(crate) struct ImageProjection {
    /// Clip matrix for points in metres relative to the origin of the triangles.
    pub(crate) clip_from_local: DMat4,
    /// Near plane in clip space: a point with clip coordinates `z` and `w` has the signed distance
    /// `near.x * z + near.y * w`, which is not negative in view.
    pub(crate) near: DVec2,
    /// Far plane in clip space: a point with clip coordinates `z` and `w` has the signed distance
    /// `far.x * z + far.y * w`, which is not negative in view. An infinite far plane is replaced by the plane
    /// `w = 0`.
    pub(crate) far: DVec2,
    /// Coefficients of the depth key: a point with clip coordinates `z` and `w` has the key
    /// `(depth_key.x * z + depth_key.y) / w`.
    pub(crate) depth_key: DVec2,
    /// True if the view is parallel (the clip w is the same for all points), false if it is perspective.
    pub(crate) parallel: bool,
    /// Half the image's width and height in pixels.
    pub(crate) half_size: DVec2,
    /// Eye of the view, relative to the origin of the triangles.
    eye: Eye,
    /// Greatest distance in metres from the origin of the triangles to one of the planes on which clip x, y,
    /// z or w is 0.
    reach: f64,
    /// Clip planes of the view, in metres relative to the origin of the triangles. The side that a plane's
    /// normal points to is drawn.
    pub(crate) clip_planes: SmallVec<[Plane; 1]>,
}

impl ImageProjection {
    /// Makes the mapping of `view` to `image` for triangles relative to `origin`, a point of the world in
    /// metres.
    pub(crate) fn new(view: &View, origin: DVec3, image: &Image) -> Self {
        let clip_from_local = view.clip_from(origin);
        let near = match view.depth() {
            Depth::NegativeOneToOne | Depth::NegativeOneToOneInfinite => DVec2::new(1.0, 1.0),
            Depth::ZeroToOne | Depth::ZeroToOneInfinite => DVec2::new(1.0, 0.0),
            Depth::Reversed | Depth::ReversedInfinite => DVec2::new(-1.0, 1.0),
        };
        let far = match view.depth() {
            Depth::NegativeOneToOne | Depth::ZeroToOne => DVec2::new(-1.0, 1.0),
            Depth::Reversed => DVec2::new(1.0, 0.0),
            // Without a far plane, the condition w >= 0 takes its place, which all visible points satisfy.
            _ => DVec2::new(0.0, 1.0),
        };
        let parallel = clip_from_local.row(3).truncate() == DVec3::ZERO;
        let depth_key = match (parallel, view.depth().is_reversed()) {
            (false, _) => DVec2::new(0.0, 1.0),
            (true, true) => DVec2::new(1.0, 0.0),
            (true, false) => DVec2::new(-1.0, 0.0),
        };
        let half_size = DVec2::new(image.width as f64, image.height as f64) * 0.5;
        let shift = origin - view.origin();
        let moved = |p: &Plane| Plane::new(p.normal, p.normal.dot(shift) + p.offset);
        let clip_planes = view.clip_planes().iter().map(moved).collect();
        let eye = view.eye(origin);
        let distances =
            [0, 1, 2, 3].map(|i| clip_from_local.row(i)).map(|row| row.w / row.truncate().length());
        // A coordinate that is equal for all points has no plane where it is 0, so its distance is skipped.
        let reach = distances.iter().map(|d| d.abs()).filter(|d| d.is_finite()).fold(0.0, f64::max);
        Self { clip_from_local, near, far, depth_key, parallel, half_size, eye, reach, clip_planes }
    }

    /// Returns the absolute difference of two depth keys up to which they count as equal. 1e-10 for parallel
    /// views: their keys are spread evenly over -1 to 1 or 0 to 1, so that a tolerance relative to the key
    /// alone would vanish near 0. 0 for perspective views, whose key `1 / w` is zero only at infinity.
    pub(crate) fn least_difference(&self) -> f64 {
        if self.parallel { DEPTH_TIE } else { 0.0 }
    }

    /// Tests whether the eye is in front of a triangle: its corners are counter-clockwise as seen from the
    /// eye. False in the plane of the triangle, where it is edge-on, and for NaN.
    pub(crate) fn sees_front(&self, triangle: &[Vec3; 3]) -> bool {
        let [a, b, c] = triangle.map(|p| p.as_dvec3());
        let normal = (b - a).cross(c - a);
        match self.eye {
            Eye::Point(eye) => normal.dot(eye - a) > 0.0,
            Eye::Direction(forward) => normal.dot(forward) < 0.0,
        }
    }

    /// Returns whether triangles may cover a pixel's centre or come within [`EDGE_TIE`] of one. False only if
    /// the box around the triangles is known, and is outside of a plane of the view or clear of all pixel
    /// centres.
    ///
    /// To cover rounding, the box is enlarged by 2^-40 of the sum of its greatest absolute coordinate and
    /// [`reach`](Self::reach). Each clip coordinate of a point is a sum of four products, with an error below
    /// 2^-50 of the sum of their magnitudes. Divided by the length of the matrix row, that sum is at most
    /// three times the first sum.
    pub(crate) fn may_show(&self, triangles: Triangles<'_>, image: &Image) -> bool {
        let Some(bounds) = triangles.known_bounds().filter(|bounds| bounds.is_finite()) else { return true };
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let margin = (min.abs().max(max.abs()).max_element() + self.reach) / (1u64 << 40) as f64;
        let clip: [DVec4; 8] = core::array::from_fn(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { min[axis] - margin } else { max[axis] + margin };
            self.clip_from_local * DVec4::new(pick(0), pick(1), pick(2), 1.0)
        });
        if clip.iter().fold(u32::MAX, |all, &v| all & self.outside(v)) != 0 {
            return false;
        }
        if !clip.iter().all(|&v| self.is_drawable(v)) {
            return true;
        }
        let corners = clip.map(|v| self.corner(v));
        let meets = |of: fn(&Corner) -> f64, limit: usize| {
            let (low, high) = corners
                .iter()
                .map(of)
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
            first_center(low - EDGE_TIE, limit) < first_center(high + EDGE_TIE, limit)
        };
        meets(|corner| corner.x, image.width) && meets(|corner| corner.y, image.height)
    }

    /// Draws the part of a triangle that lies in the view, as triangle number `item`. The triangle is
    /// relative to the mapping's origin, in metres. Nothing for NaN or infinite coordinates.
    #[inline]
    pub(crate) fn draw(&self, triangle: &[Vec3; 3], item: u32, image: &mut Image) {
        if !self.clip_planes.is_empty() {
            return self.draw_clipped(triangle, item, image);
        }
        let clip = triangle.map(|p| self.clip_from_local * p.as_dvec3().extend(1.0));
        let outside = clip.map(|v| self.outside(v));
        // All corners lie beyond one plane. False for NaN, which the slower path below handles.
        if outside[0] & outside[1] & outside[2] != 0 {
            return;
        }
        if clip.iter().all(|&v| self.is_drawable(v)) {
            image.fill(clip.map(|v| self.corner(v)), item);
        } else {
            self.draw_cut(Polygon::from_slice(&clip), item, image);
        }
    }

    /// Draws a triangle like [`draw`](Self::draw), after clipping it by the view's clip planes, before
    /// projection, since clip planes are given in space.
    #[cold]
    #[inline(never)]
    fn draw_clipped(&self, triangle: &[Vec3; 3], item: u32, image: &mut Image) {
        let mut polygon: Polygon = triangle.iter().map(|p| p.as_dvec3().extend(1.0)).collect();
        let mut cut = Polygon::new();
        for plane in &self.clip_planes {
            clip_polygon(&polygon, |v| plane.signed_distance(v.truncate()), |v| v.with_w(1.0), &mut cut);
            core::mem::swap(&mut polygon, &mut cut);
        }
        self.draw_cut(polygon.iter().map(|&v| self.clip_from_local * v).collect(), item, image);
    }

    /// Returns the planes of the view volume that a clip-space point is outside of, as a bit mask: left,
    /// right, bottom, top, near, far from bit 0 on. A point on a plane is inside. 0 for NaN.
    #[inline]
    pub(crate) fn outside(&self, v: DVec4) -> u32 {
        u32::from(v.x < -v.w)
            | u32::from(v.x > v.w) << 1
            | u32::from(v.y < -v.w) << 2
            | u32::from(v.y > v.w) << 3
            | u32::from(distance(self.near, v) < 0.0) << 4
            | u32::from(distance(self.far, v) < 0.0) << 5
    }

    /// Tests whether a clip-space point needs no clipping: the point lies inside the near and far planes, |x|
    /// and |y| are at most [`GUARD`] times w, and w is positive and finite. False for NaN.
    #[inline]
    fn is_drawable(&self, v: DVec4) -> bool {
        let guard = GUARD * v.w;
        v.w > 0.0
            && guard < f64::INFINITY
            && v.x.abs() <= guard
            && v.y.abs() <= guard
            && distance(self.near, v) >= 0.0
            && distance(self.far, v) >= 0.0
    }

    /// Divides a clip-space point with positive w by w and maps it to image coordinates and depth key.
    #[inline]
    pub(crate) fn corner(&self, v: DVec4) -> Corner {
        Corner {
            x: (v.x / v.w + 1.0) * self.half_size.x,
            y: (1.0 - v.y / v.w) * self.half_size.y,
            depth_key: (self.depth_key.x * v.z + self.depth_key.y) / v.w,
        }
    }

    /// Clips a clip-space polygon by the near and far planes and the guard band [`GUARD`], and draws the rest
    /// as a triangle fan. Draws nothing if a vertex is NaN or infinite.
    #[cold]
    #[inline(never)]
    fn draw_cut(&self, mut polygon: Polygon, item: u32, image: &mut Image) {
        if !polygon.iter().all(|v| v.is_finite()) {
            return;
        }
        let mut cut = Polygon::new();
        for plane in [self.near, self.far] {
            clip_polygon(&polygon, |v| distance(plane, v), |v| v, &mut cut);
            core::mem::swap(&mut polygon, &mut cut);
        }
        // Vertices cut by a guard plane are put exactly on the plane. Between ends at -1e30 and 1e30,
        // rounding would leave them 1e14 away.
        for side in [-GUARD, GUARD] {
            let beyond = side.signum();
            clip_polygon(&polygon, |v| GUARD * v.w - beyond * v.x, |v| v.with_x(side * v.w), &mut cut);
            clip_polygon(&cut, |v| GUARD * v.w - beyond * v.y, |v| v.with_y(side * v.w), &mut polygon);
        }
        // Between opposite guard planes, w is not negative. It is only zero at the eye, which a near plane in
        // front of the eye has cut off.
        if !polygon.iter().all(|v| v.w > 0.0) {
            return;
        }
        let corners: SmallVec<[Corner; 9]> = polygon.iter().map(|&v| self.corner(v)).collect();
        // Coordinates of 1e150 and more overflow in the computation; such polygons are dropped.
        if !corners.iter().all(Corner::is_finite) {
            return;
        }
        if let Some((&first, rest)) = corners.split_first() {
            for pair in rest.windows(2) {
                image.fill([first, pair[0], pair[1]], item);
            }
        }
    }
}

/// Returns the signed distance of a clip-space point `v` from a near or far plane, in clip units:
/// `plane.x * v.z + plane.y * v.w`. It is not negative in view.
#[inline]
fn distance(plane: DVec2, v: DVec4) -> f64 {
    plane.x * v.z + plane.y * v.w
}

/// Replaces `out` by the part of a polygon where `plane`, a linear function of the vertex, is not negative.
/// Rounding may leave a new vertex beside the plane, so `place` moves it onto the plane. `out` is empty if no
/// vertex is inside; a vertex with a NaN distance is outside.
fn clip_polygon(
    polygon: &[DVec4],
    plane: impl Fn(DVec4) -> f64,
    place: impl Fn(DVec4) -> DVec4,
    out: &mut Polygon,
) {
    out.clear();
    let Some(&(mut a)) = polygon.last() else { return };
    let mut a_distance = plane(a);
    for &b in polygon {
        let b_distance = plane(b);
        if (a_distance >= 0.0) != (b_distance >= 0.0) {
            let (inner, outer, di, d_o) = if a_distance >= 0.0 {
                (a, b, a_distance, b_distance)
            } else {
                (b, a, b_distance, a_distance)
            };
            out.push(place(inner + (outer - inner) * (di / (di - d_o))));
        }
        if b_distance >= 0.0 {
            out.push(b);
        }
        (a, a_distance) = (b, b_distance);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shared_edge_is_cut_alike_from_both_sides() {
        let v = [
            DVec4::new(0.1, 0.2, 0.3, 0.7),
            DVec4::new(0.9, -3.1, 0.1, -0.77),
            DVec4::new(0.3, 0.3, 0.1, 1.3),
        ];
        let (mut forth, mut back) = (Polygon::new(), Polygon::new());
        clip_polygon(&[v[0], v[1], v[2]], |v| v.w - v.z, |v| v, &mut forth);
        clip_polygon(&[v[1], v[0], DVec4::ONE], |v| v.w - v.z, |v| v, &mut back);
        assert_eq!(forth.len(), 4, "corners of a triangle cut across");
        assert!(back.iter().any(|p| forth.contains(p) && !v.contains(p)), "{forth:?} {back:?}");
    }

    #[test]
    fn nothing_is_left_beyond_a_plane() {
        let mut out = Polygon::from_slice(&[DVec4::ONE]);
        clip_polygon(&[DVec4::X, DVec4::Y, DVec4::Z], |_| -1.0, |v| v, &mut out);
        assert!(out.is_empty(), "a triangle beyond the plane leaves nothing");
        clip_polygon(&[DVec4::X, DVec4::Y, DVec4::NAN], |v| v.x, |v| v, &mut out);
        clip_polygon(&[], |v| v.x, |v| v, &mut out);
        assert!(out.is_empty(), "no corners leave nothing");
    }
}
