//! Affine transforms in the layouts of other math libraries.

use glam::{Affine3A, Vec3};

/// An affine transform in some layout, for functions that take the transforms of many objects as an engine
/// stores them.
///
/// | type | layout |
/// |---|---|
/// | `Affine3A` | of the version of glam that this crate uses |
/// | `[f32; 12]` | three axes, then the translation, x, y and z of each: `to_cols_array` of any version of glam |
/// | `[[f32; 3]; 4]` | the same as four columns: `to_cols_array_2d` of any version of glam |
/// | `[[f32; 4]; 3]` | three rows, the translation last in each: `VkTransformMatrixKHR` and DXR instances |
///
/// ```
/// use visibility_core::{glam::{Affine3A, Vec3}, scene::ToAffine};
/// let moved = Affine3A::from_translation(Vec3::new(1.0, 2.0, 3.0));
/// assert_eq!(moved.to_cols_array().to_affine(), moved);
/// assert_eq!([[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0]].to_affine(), moved);
/// ```
pub trait ToAffine {
    /// Converts the transform. The coefficients are copied without rounding.
    fn to_affine(&self) -> Affine3A;
}

impl ToAffine for Affine3A {
    #[inline]
    fn to_affine(&self) -> Affine3A {
        *self
    }
}

impl ToAffine for [f32; 12] {
    #[inline]
    fn to_affine(&self) -> Affine3A {
        Affine3A::from_cols_array(self)
    }
}

impl ToAffine for [[f32; 3]; 4] {
    #[inline]
    fn to_affine(&self) -> Affine3A {
        Affine3A::from_cols_array_2d(self)
    }
}

impl ToAffine for [[f32; 4]; 3] {
    #[inline]
    fn to_affine(&self) -> Affine3A {
        let column = |i: usize| Vec3::new(self[0][i], self[1][i], self[2][i]);
        Affine3A {
            matrix3: glam::Mat3A::from_cols(column(0).into(), column(1).into(), column(2).into()),
            translation: column(3).into(),
        }
    }
}
