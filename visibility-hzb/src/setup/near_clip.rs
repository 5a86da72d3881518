//! Clipping of triangles and edges at the near plane, in homogeneous screen coordinates. Corners have the
//! five values of [`ObjectProjection::at`](super::screen_projection::ObjectProjection::at): `x`, `y`, `w`,
//! `n` and the distance beyond the near plane. All cuts are where that distance is `near_limit`.

/// Index of the distance beyond the near plane among the five values of a corner.
pub(crate) const NEAR: usize = 4;

/// Returns the point of an edge at which value number `of` of its five values equals `limit`. For a cut at a
/// distance beyond the near plane, `of` is [`NEAR`]. The ends `a` and `b`, in homogeneous screen coordinates,
/// lie on different sides of the cut: the value is less than `limit` at one, greater at the other. The point
/// is interpolated from the end of lesser value in both orders of the arguments, so that all triangles that
/// share the edge get the identical point.
#[inline(always)]
pub(crate) fn cut_edge(a: &[f64; 5], b: &[f64; 5], of: usize, limit: f64) -> [f64; 5] {
    let (a, b) = if a[of] < b[of] { (a, b) } else { (b, a) };
    let share = ((limit - a[of]) / (b[of] - a[of])).clamp(0.0, 1.0);
    let mut out = [0.0; 5];
    for i in 0..5 {
        out[i] = a[i] * (1.0 - share) + b[i] * share;
    }
    out
}

/// The part of a triangle that is farther beyond the near plane than `near_limit` (the distance at which
/// geometry is cut).
pub(crate) struct ClippedTriangle {
    /// Corners of the clipped triangle, in the same turning sense as the triangle. Each is a point in
    /// homogeneous screen coordinates, `[x, y, w, n, near]` as in
    /// [`ObjectProjection`](super::screen_projection::ObjectProjection). The first `count` are in use.
    pub(crate) corners: [[f64; 5]; 4],
    /// Number of corners: 3 or 4, or 0 if the whole triangle is nearer than `near_limit`.
    pub(crate) count: usize,
    /// Start and end, in homogeneous screen coordinates, of the new edge that the cut makes, directed as an
    /// edge of the clipped triangle. `None` if the triangle lies wholly on one side of the cut.
    pub(crate) edge: Option<[[f64; 5]; 2]>,
}

/// Clips a triangle to the part farther beyond the near plane than `near_limit`. Corners are in homogeneous
/// screen coordinates, whose fifth value is the distance beyond the near plane. A corner exactly at
/// `near_limit` counts as nearer.
pub(crate) fn clip_triangle(t: [&[f64; 5]; 3], near_limit: f64) -> ClippedTriangle {
    let mut out = ClippedTriangle { corners: [[0.0; 5]; 4], count: 0, edge: None };
    let mut push = |p: [f64; 5]| {
        if out.count < 4 {
            out.corners[out.count] = p;
            out.count += 1;
        }
    };
    let (mut leaves, mut enters) = (None, None);
    for i in 0..3 {
        let (a, b) = (t[i], t[(i + 1) % 3]);
        if a[4] > near_limit {
            push(*a);
        }
        if (a[4] > near_limit) != (b[4] > near_limit) {
            let p = cut_edge(a, b, NEAR, near_limit);
            push(p);
            *(if a[4] > near_limit { &mut leaves } else { &mut enters }) = Some(p);
        }
    }
    out.edge = leaves.zip(enters).map(|(a, b)| [a, b]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::random;
    use crate::setup::screen_projection::ScreenProjection;
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::glam::{Affine3A, DVec3};
    use visibility_core::{Pose, View};

    /// The true point of a cut lies beyond the near plane even if the distances of both ends are computed too
    /// great by their whole error bound.
    #[test]
    fn cuts_lie_beyond_the_near_plane() {
        let mut random = random(4);
        let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 900.0);
        let projection = ScreenProjection::new(&view.unwrap(), DVec3::ZERO, [64, 64], [64, 64]);
        for trial in 0..100_000 {
            let object = projection.project_object(&Affine3A::IDENTITY, [random(1.0, 100.0); 3]);
            let (limit, size) = (object.near_limit(), object.size[4]);
            let near = limit - random(0.0, 1.0).powi(9) * size;
            let far = limit + random(1e-18, 1.0).powi(9) * size;
            // The first value of the cut is its fraction of the way from `a` to `b`.
            let (a, b) = ([0.0, 0.0, 0.0, 0.0, near], [1.0, 0.0, 0.0, 0.0, far]);
            let [share, ..] = cut_edge(&a, &b, NEAR, limit);
            let step = DoubleDouble::difference(far, near).times(share.into());
            let distance = step.plus(near.into()).plus((-object.error[4]).into()).hi;
            assert!(distance > 0.0, "trial {trial}: {distance} between {near} and {far}");
        }
    }

    /// A corner at the limit counts as nearer: the clipped triangle begins and ends at it.
    #[test]
    fn a_corner_at_the_limit_is_cut_off() {
        let corner = |at: f64, near: f64| [at, 0.0, 1.0, 1.0, near];
        let corners = [corner(0.0, 5.0), corner(1.0, 6.0), corner(2.0, 7.0)];
        for first in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|i| corners[(first + i) % 3]);
            let clipped = clip_triangle([&a, &b, &c], 5.0);
            assert_eq!(clipped.count, 4, "corners of a triangle that begins with {a:?}");
            let at_limit = clipped.corners.iter().filter(|corner| corner[4] == 5.0).count();
            assert_eq!(at_limit, 2, "both ends of the cut of a triangle that begins with {a:?}");
            assert_eq!(clipped.edge, Some([corners[0]; 2]), "the cut of a triangle that begins with {a:?}");
        }
        let nearer = [corner(0.0, 5.0), corner(1.0, 4.0), corner(2.0, 3.0)];
        let clipped = clip_triangle(nearer.each_ref(), 5.0);
        assert_eq!((clipped.count, clipped.edge), (0, None), "a triangle that touches the limit");
    }
}
