//! Projection to the grid of the image, with bounds on rounding.
//!
//! Corners are homogeneous: `x`, `y` and `w`, where `x / w` and `y / w` are grid coordinates; `n`, where `n /
//! w` is the depth key (greater is nearer); and the distance beyond the near plane. Each of the five is a
//! linear function of points, a [`ClipRow`] of core, which comes with a bound on its error.

use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::view::{ClipRow, ViewProjection};
use visibility_core::{Aabb, View};

/// Unit round-off of `f64`: 2^-53.
pub(crate) const U: f64 = f64::EPSILON / 2.0;

/// Width and height of the image in units of the grid.
pub(crate) const GRID: f64 = 1_048_576.0;

/// Width in grid units of the rim around the image that is triangulated too. Outlines are clipped in the
/// middle of the rim, so that no vertex lies on the border of the triangulation.
pub(crate) const RIM: f64 = 8.0;

/// Greatest magnitude of a grid coordinate in the triangulated rectangle.
pub(crate) const REACH: f64 = GRID + RIM;

/// Homogeneous corner: `x`, `y`, `w`, `n` and the distance beyond the near plane. `x / w` and `y / w` are
/// grid coordinates, and `n / w` is the depth key (greater is nearer).
pub(crate) type Corner = [f64; 5];

/// Projection of a view to the grid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Screen {
    /// Linear functions of a point relative to `anchor` that give the five values of a [`Corner`].
    rows: [ClipRow; 5],
    /// Origin of the points that `rows` take, in metres relative to the scene's origin.
    anchor: DVec3,
    /// Sign of the determinant of a triangle's corners `(x, y, w)` if the triangle faces the eye and its
    /// transform does not mirror. 0 if this sign is unknown.
    facing: f64,
}

/// Projected corners of an object, with one error bound for all.
#[derive(Clone, Debug, Default)]
pub(crate) struct Projected {
    /// Projected points, in the order in which they were given to [`Screen::project`].
    pub(crate) corners: alloc::vec::Vec<Corner>,
    /// Bound on the absolute error of each of the five values of a corner. It also holds for points
    /// interpolated between two corners with up to four roundings.
    pub(crate) error: Corner,
    /// Upper bound on the magnitude of each of the five values, errors included.
    pub(crate) size: Corner,
}

/// Grid rectangle and depth of a box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ProjectedBox {
    /// Column and row of each corner in grid units, in the order of [`Aabb::corners`]. Each value has an
    /// error of at most a quarter of a grid unit.
    pub(crate) corners: [[f64; 2]; 8],
    /// Least column and row that the box may reach, in grid units, rounded outwards.
    pub(crate) low: [f64; 2],
    /// Greatest column and row that the box may reach, in grid units, rounded outwards.
    pub(crate) high: [f64; 2],
    /// Upper bound on the depth key (greater is nearer) of each corner, in the order of `corners`.
    pub(crate) keys: [f64; 8],
    /// Upper bound on the depth keys (greater is nearer) of all points of the box.
    pub(crate) nearest: f64,
}

/// Position of a box relative to the view.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "matched at once, never stored")]
pub(crate) enum BoxPlace {
    /// The box certainly misses the image.
    Outside,
    /// The box may reach the near plane, or rounding leaves its position on the image undecided.
    Unknown,
    /// The box is certainly beyond the near plane and may meet the image.
    Inside(ProjectedBox),
}

impl Screen {
    /// Screen on which every box is [`BoxPlace::Unknown`] and no triangle faces the eye.
    pub(crate) const BLIND: Self = Self {
        rows: [ClipRow { linear: DVec3::ZERO, constant: 0.0, error: f64::INFINITY }; 5],
        anchor: DVec3::ZERO,
        facing: 0.0,
    };

    pub(crate) fn new(view: &View, origin: DVec3) -> Self {
        let projection = ViewProjection::new(view, origin);
        let [x, y] = projection.pixels(GRID, GRID);
        Self {
            rows: [x, y, projection.w(), projection.depth_key(), projection.near()],
            anchor: projection.anchor(),
            // Rows run downwards, which mirrors. Normals of visible triangles point towards the eye, which
            // mirrors again.
            facing: projection.orientation(),
        }
    }

    /// Returns the sign of the determinant of a triangle's corners `(x, y, w)` if the triangle, placed by
    /// `transform`, faces the eye. `None` if rounding leaves open whether the transform mirrors.
    pub(crate) fn facing(&self, transform: &Affine3A) -> Option<f64> {
        let [x, y, z] = axes(transform);
        let determinant = x.cross(y).dot(z);
        let size = x.abs().element_sum() * y.abs().element_sum() * z.abs().element_sum();
        (determinant.abs() > 16.0 * U * size && self.facing != 0.0)
            .then_some(determinant.signum() * self.facing)
    }

    /// Projects points under a transform. Returns false, and an invalid result, if a value is not finite.
    ///
    /// Products of two `f32` are exact in `f64`, and three sums round, so a coordinate has an error below `4
    /// u` of the sum of magnitudes. Another `4 u` of each value allows for the interpolation of points.
    pub(crate) fn project(&self, points: &[Vec3], transform: &Affine3A, out: &mut Projected) -> bool {
        let mut is_finite = true;
        out.corners.clear();
        (out.error, out.size) = ([0.0; 5], [0.0; 5]);
        let axes = axes(transform);
        let shift = Vec3::from(transform.translation).as_dvec3();
        for p in points {
            let p = p.as_dvec3();
            let place = axes[0] * p.x + axes[1] * p.y + axes[2] * p.z + shift;
            let size = axes[0].abs() * p.x.abs()
                + axes[1].abs() * p.y.abs()
                + axes[2].abs() * p.z.abs()
                + shift.abs();
            let mut corner = [0.0; 5];
            for (i, row) in self.rows.iter().enumerate() {
                let (value, error) = row.at(place - self.anchor);
                let error = error + 4.0 * U * (row.linear.abs().dot(size) + value.abs());
                corner[i] = value;
                out.error[i] = out.error[i].max(error);
                out.size[i] = out.size[i].max(value.abs() + error);
                is_finite &= error.is_finite() && value.is_finite();
            }
            out.corners.push(corner);
        }
        is_finite
    }

    /// Returns the position of a box relative to the view. The box must be [proper](Aabb::is_proper).
    ///
    /// A quotient `q = a / w` with errors `e_a` and `e_w` has an error of `(e_a + |q| e_w) / w` to first
    /// order, and two roundings. The factor 2 covers higher orders, since `w` exceeds `1024 e_w`.
    pub(crate) fn place(&self, bounds: &Aabb) -> BoxPlace {
        let (mut corners, mut low, mut high) = ([[0.0; 2]; 8], [f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let (mut nearest, mut is_known) = (f64::NEG_INFINITY, true);
        let mut keys = [0.0; 8];
        for ((corner, key), p) in corners.iter_mut().zip(&mut keys).zip(bounds.corners()) {
            let values = self.rows.map(|row| row.at(p.as_dvec3() - self.anchor));
            let (w, of_w) = values[2];
            is_known &= values[4].0 > values[4].1 && w > 1024.0 * of_w;
            let quotient = |(a, of_a): (f64, f64)| {
                let q = a / w;
                (q, 2.0 * ((of_a + q.abs() * of_w) / w + 4.0 * U * q.abs()))
            };
            for axis in 0..2 {
                let (q, margin) = quotient(values[axis]);
                corner[axis] = q;
                low[axis] = low[axis].min(q - margin);
                high[axis] = high[axis].max(q + margin);
                is_known &= margin < 0.25;
            }
            let (q, margin) = quotient(values[3]);
            *key = q + margin;
            nearest = nearest.max(*key);
        }
        if !is_known {
            return BoxPlace::Unknown;
        }
        if (0..2).any(|axis| high[axis] < 0.0 || low[axis] > GRID) {
            return BoxPlace::Outside;
        }
        BoxPlace::Inside(ProjectedBox { corners, low, high, keys, nearest })
    }
}

fn axes(transform: &Affine3A) -> [DVec3; 3] {
    let m = transform.matrix3;
    [m.x_axis, m.y_axis, m.z_axis].map(|axis| Vec3::from(axis).as_dvec3())
}
