//! Whether a transform mirrors: the fronts of triangles are then on the side from which their corners run
//! clockwise.

use glam::{Affine3A, DMat3, DVec3};

/// Returns whether a transform keeps the orientation of triangles (true) or mirrors them (false). `None` if
/// rounding leaves the sign of its determinant uncertain, as for a transform that flattens, and for NaN.
///
/// The determinant is computed in `f64`. In `f32` it underflows to zero where axes are shorter than about
/// 1e-15, and rounding may turn its sign where axes are nearly in a plane.
///
/// ```
/// use visibility_core::geometry::keeps_orientation;
/// use visibility_core::glam::{Affine3A, Vec3};
/// let scaled = |x, y, z| keeps_orientation(&Affine3A::from_scale(Vec3::new(x, y, z)));
/// assert_eq!(scaled(1e-16, 1e-16, 1e-16), Some(true));
/// assert_eq!(scaled(-1e-16, 1e-16, 1e-16), Some(false));
/// assert_eq!(scaled(1.0, 0.0, 1.0), None);
/// ```
#[inline(always)]
pub fn keeps_orientation(transform: &Affine3A) -> Option<bool> {
    let axes = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
    sign_of_volume(axes.map(|axis| DVec3::from_array(axis.to_array().map(f64::from))))
}

/// Returns what [`keeps_orientation`] does, for a matrix in `f64`. Where the volume of its axes might
/// overflow or underflow, they are divided by their greatest coordinates before.
#[inline]
pub(crate) fn keeps_orientation_64(matrix: &DMat3) -> Option<bool> {
    let axes = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    let lengths = axes.map(|axis| axis.abs().max_element());
    let is_usual = lengths.iter().all(|length| (1e-60..1e60).contains(length));
    sign_of_volume(if is_usual { axes } else { axes.map(|axis| axis / axis.abs().max_element()) })
}

/// Returns whether the volume spanned by three axes is positive. `None` if rounding leaves its sign
/// uncertain, and for NaN.
#[inline(always)]
fn sign_of_volume([a, b, c]: [DVec3; 3]) -> Option<bool> {
    let (volume, most) = (
        a.dot(b.cross(c)),
        a.abs().dot(b.abs().cross(c.abs()).abs() + b.abs().max_element() * c.abs().max_element()),
    );
    // The volume is a sum of six products of three factors, each rounded a few times.
    (volume.abs() > 32.0 * f64::EPSILON * most).then_some(volume > 0.0)
}

#[cfg(test)]
mod tests {
    use super::{DMat3, DVec3, keeps_orientation_64};
    use crate::geometry::DoubleDouble;
    use visibility_testing::Random;

    /// Returns the determinant of a matrix in double-double arithmetic.
    fn determinant(m: &DMat3) -> DoubleDouble {
        let m = [m.x_axis, m.y_axis, m.z_axis].map(|axis| axis.to_array().map(DoubleDouble::from));
        let product = |i: usize, j: usize, k: usize| m[0][i].times(m[1][j]).times(m[2][k]);
        let [even, odd] = [[[0, 1, 2], [1, 2, 0], [2, 0, 1]], [[0, 2, 1], [1, 0, 2], [2, 1, 0]]]
            .map(|all| all.into_iter().fold(DoubleDouble::ZERO, |sum, [i, j, k]| sum.plus(product(i, j, k))));
        even.plus(odd.negated())
    }

    /// A sign that is told is the exact one, for three axes that rounding has moved out of a plane and at all
    /// scales. The sign of the determinant computed in `f64` would often be wrong.
    #[test]
    fn signs_of_flat_matrices_are_certain_or_not_told() {
        let (mut random, mut counts, mut wrong_without) = (Random(1), [0; 3], 0);
        for round in 0..30_000 {
            let [x, y, off] = [(); 3].map(|()| random.vector(1.0));
            let away = [0.0, 1e-16, 1e-15, 1e-14, 1.0][round % 5];
            let flat = DMat3::from_cols(x, y, x / 3.0 + y / 7.0 + away * off);
            let exact = determinant(&flat).hi;
            wrong_without += usize::from(exact != 0.0 && (flat.determinant() > 0.0) != (exact > 0.0));
            let told = keeps_orientation_64(&flat);
            assert!(told.is_none_or(|keeps| keeps == (exact > 0.0)), "round {round}: {flat} has {exact}");
            counts[told.map_or(2, usize::from)] += 1;
            for scale in [1e-120, 1e120] {
                let other = keeps_orientation_64(&(flat * scale));
                assert!(other.is_none() || told.is_none() || other == told, "round {round} times {scale}");
            }
        }
        assert!(counts.iter().all(|&count| count > 3_000), "{counts:?} mirror, do not, are not told");
        assert!(wrong_without > 1_000, "{wrong_without} computed determinants have the wrong sign");
        for flat in [DMat3::ZERO, DMat3::NAN, DMat3::from_diagonal(DVec3::new(1.0, 0.0, 1.0))] {
            assert_eq!(keeps_orientation_64(&flat), None, "{flat}");
        }
        let tiny = DMat3::from_diagonal(DVec3::splat(-1e-200));
        assert_eq!(keeps_orientation_64(&tiny), Some(false), "the determinant of {tiny} underflows");
    }
}
