//! From triangles in space to triangles on the screen, by way of homogeneous clip space.
//!
//! Polygons are cut plane by plane (Sutherland and Hodgman, "Reentrant Polygon Clipping", 1974) before they
//! are divided by `w`, as Blinn and Newell do ("Clipping Using Homogeneous Coordinates", 1978). An edge that
//! two triangles share is cut in both by the same sums in the same order, from its inner to its outer end,
//! and stays shared to the last bit.
//!
//! The planes of clip space and the meaning of its depth stand here once more, though core has them: an
//! oracle shares no projection, clipping or raster code with what it judges, or a mistake there would excuse
//! itself.

use crate::raster::{Corner, DEPTH_TIE, Image};
use smallvec::SmallVec;
use visibility_core::glam::{DMat4, DVec2, DVec3, DVec4, Vec3};
use visibility_core::{View, geometry::Plane, view::Depth};

/// How far beyond the sides of the image, in images, triangles are left uncut. The raster loses 1e-16 of the
/// coordinates, so 16 images cost it nothing, and few triangles are large enough to need the sides cut.
const GUARD: f64 = 16.0;

/// A triangle can gain one vertex at each of six planes, and more at clip planes of the view's own.
type Polygon = SmallVec<[DVec4; 9]>;

/// How one view maps points onto one image.
pub(crate) struct ImageProjection {
    clip_from_local: DMat4,
    /// Signed distances from the near and far planes, as factors of `z` and `w`.
    near: DVec2,
    far: DVec2,
    /// Factor of `z`, and constant, that make the numerator over `w` of the nearness.
    nearness: DVec2,
    parallel: bool,
    half_size: DVec2,
    /// The view's own clip planes, for points as the triangles have them.
    clip_planes: SmallVec<[Plane; 1]>,
}

impl ImageProjection {
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
            // Without a far plane: that w is not negative, which holds for all that can be seen.
            _ => DVec2::new(0.0, 1.0),
        };
        let parallel = clip_from_local.row(3).truncate() == DVec3::ZERO;
        let nearness = match (parallel, view.depth().is_reversed()) {
            (false, _) => DVec2::new(0.0, 1.0),
            (true, true) => DVec2::new(1.0, 0.0),
            (true, false) => DVec2::new(-1.0, 0.0),
        };
        let half_size = DVec2::new(image.width as f64, image.height as f64) * 0.5;
        let shift = origin - view.origin();
        let moved = |p: &Plane| Plane::new(p.normal, p.normal.dot(shift) + p.offset);
        let clip_planes = view.clip_planes().iter().map(moved).collect();
        Self { clip_from_local, near, far, nearness, parallel, half_size, clip_planes }
    }

    /// Difference between two values of nearness that counts as none, however small both are. Depth of a
    /// parallel view is spread evenly over -1 to 1, or 0 to 1, so its zero is as good as any other value; `1
    /// / w` of a perspective view is zero only at infinity.
    pub(crate) fn least_difference(&self) -> f64 {
        if self.parallel { DEPTH_TIE } else { 0.0 }
    }

    /// Draws what is in view of a triangle.
    #[inline]
    pub(crate) fn draw(&self, triangle: &[Vec3; 3], item: u32, image: &mut Image) {
        if !self.clip_planes.is_empty() {
            return self.draw_clipped(triangle, item, image);
        }
        let clip = triangle.map(|p| self.clip_from_local * p.as_dvec3().extend(1.0));
        let outside = clip.map(|v| self.outside(v));
        // Beyond one plane with all corners. False for NaN, which is dealt with where it is rare.
        if outside[0] & outside[1] & outside[2] != 0 {
            return;
        }
        if clip.iter().all(|&v| self.is_drawable(v)) {
            image.fill(clip.map(|v| self.corner(v)), item);
        } else {
            self.draw_cut(Polygon::from_slice(&clip), item, image);
        }
    }

    /// As [`draw`](Self::draw), after cutting by the view's own planes, which is done before projection: they
    /// are given in space.
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

    /// The planes of the view that a point is beyond, as bits.
    #[inline]
    fn outside(&self, v: DVec4) -> u32 {
        u32::from(v.x < -v.w)
            | u32::from(v.x > v.w) << 1
            | u32::from(v.y < -v.w) << 2
            | u32::from(v.y > v.w) << 3
            | u32::from(distance(self.near, v) < 0.0) << 4
            | u32::from(distance(self.far, v) < 0.0) << 5
    }

    /// Whether a corner needs no cut: within near, far and guard planes, and divisible.
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

    #[inline]
    fn corner(&self, v: DVec4) -> Corner {
        Corner {
            x: (v.x / v.w + 1.0) * self.half_size.x,
            y: (1.0 - v.y / v.w) * self.half_size.y,
            nearness: (self.nearness.x * v.z + self.nearness.y) / v.w,
        }
    }

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
        // What a guard cuts is put exactly on it: between ends at -1e30 and 1e30, rounding would leave it
        // 1e14 away.
        for side in [-GUARD, GUARD] {
            let beyond = side.signum();
            clip_polygon(&polygon, |v| GUARD * v.w - beyond * v.x, |v| v.with_x(side * v.w), &mut cut);
            clip_polygon(&cut, |v| GUARD * v.w - beyond * v.y, |v| v.with_y(side * v.w), &mut polygon);
        }
        // Between opposite guards w is not negative; it is zero in the eye only, which a view that has a near
        // plane before the eye has cut off.
        if !polygon.iter().all(|v| v.w > 0.0) {
            return;
        }
        let corners: SmallVec<[Corner; 9]> = polygon.iter().map(|&v| self.corner(v)).collect();
        // Overflow on the way, at coordinates of 1e150 and more: not a triangle any more.
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

#[inline]
fn distance(plane: DVec2, v: DVec4) -> f64 {
    plane.x * v.z + plane.y * v.w
}

/// The part of a polygon where `plane` is not negative; `place` has the last word on where the plane is met.
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
        assert_eq!(forth.len(), 4);
        assert!(back.iter().any(|p| forth.contains(p) && !v.contains(p)), "{forth:?} {back:?}");
    }

    #[test]
    fn nothing_is_left_beyond_a_plane() {
        let mut out = Polygon::from_slice(&[DVec4::ONE]);
        clip_polygon(&[DVec4::X, DVec4::Y, DVec4::Z], |_| -1.0, |v| v, &mut out);
        assert!(out.is_empty());
        clip_polygon(&[DVec4::X, DVec4::Y, DVec4::NAN], |v| v.x, |v| v, &mut out);
        clip_polygon(&[], |v| v.x, |v| v, &mut out);
        assert!(out.is_empty());
    }
}
