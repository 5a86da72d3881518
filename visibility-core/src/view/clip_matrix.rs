//! The clip matrix in the types that engines use, and the check whether it is usable.

use crate::view::ViewError;
use glam::{DMat4, Mat4};

/// A 4x4 matrix from world space to clip space. It converts from glam's matrices and from plain arrays in
/// column-major order, in `f32` or `f64`, without any check.
///
/// ```
/// use visibility_core::{glam::Mat4, view::ClipMatrix};
/// let _from_glam = ClipMatrix::from(Mat4::IDENTITY);
/// let _from_array = ClipMatrix::from([0.0f32; 16]);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ClipMatrix(pub(super) DMat4);

impl ClipMatrix {
    /// Returns an error for a matrix that has a NaN or infinite element, or that is singular within the
    /// rounding error of its `f64` determinant.
    pub(super) fn check(&self) -> Result<(), ViewError> {
        for row in 0..4 {
            for column in 0..4 {
                if !self.0.col(column)[row].is_finite() {
                    return Err(ViewError::Matrix { row, column });
                }
            }
        }
        // Scaling rows changes neither the rank nor what is in view, and prevents overflow. The determinant
        // is expanded by pairs of rows. `size` sums the magnitudes of all terms. Each term passes at most
        // fourteen roundings: of four quotients, three products, two differences and five sums. So a
        // determinant below 16u of `size` cannot be told from zero.
        let rows = [0, 1, 2, 3].map(|i| self.0.row(i)).map(|r| r / r.abs().max_element());
        let (mut determinant, mut size) = (0.0, 0.0);
        for (sign, i, j, k, l) in PAIRS {
            let product = |a: usize, b: usize, i: usize, j: usize| rows[a][i] * rows[b][j];
            let upper = product(0, 1, i, j) - product(0, 1, j, i);
            let lower = product(2, 3, k, l) - product(2, 3, l, k);
            determinant += sign * upper * lower;
            size += (product(0, 1, i, j).abs() + product(0, 1, j, i).abs())
                * (product(2, 3, k, l).abs() + product(2, 3, l, k).abs());
        }
        // Written so that NaN, which the division above makes of a zero row, counts as singular.
        if determinant.abs() > 8.0 * f64::EPSILON * size { Ok(()) } else { Err(ViewError::NotInvertible) }
    }
}

/// Terms of the Laplace expansion of a 4x4 determinant by complementary 2x2 minors: the sign, the two columns
/// taken from rows 0 and 1, and the two columns taken from rows 2 and 3.
const PAIRS: [(f64, usize, usize, usize, usize); 6] = [
    (1.0, 0, 1, 2, 3),
    (-1.0, 0, 2, 1, 3),
    (1.0, 0, 3, 1, 2),
    (1.0, 1, 2, 0, 3),
    (-1.0, 1, 3, 0, 2),
    (1.0, 2, 3, 0, 1),
];

impl From<Mat4> for ClipMatrix {
    fn from(m: Mat4) -> Self {
        Self(m.as_dmat4())
    }
}

impl From<DMat4> for ClipMatrix {
    fn from(m: DMat4) -> Self {
        Self(m)
    }
}

impl From<[f32; 16]> for ClipMatrix {
    fn from(m: [f32; 16]) -> Self {
        Mat4::from_cols_array(&m).into()
    }
}

impl From<[f64; 16]> for ClipMatrix {
    fn from(m: [f64; 16]) -> Self {
        DMat4::from_cols_array(&m).into()
    }
}

impl From<[[f32; 4]; 4]> for ClipMatrix {
    fn from(m: [[f32; 4]; 4]) -> Self {
        Mat4::from_cols_array_2d(&m).into()
    }
}

impl From<[[f64; 4]; 4]> for ClipMatrix {
    fn from(m: [[f64; 4]; 4]) -> Self {
        DMat4::from_cols_array_2d(&m).into()
    }
}
