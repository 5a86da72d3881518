//! Conversions of the types of `mint`, which math libraries share, wherever arrays of numbers are taken. By
//! arrays, since not every version of glam has conversions of its own.

use crate::Aabb;
use crate::scene::ToAffine;
use crate::view::ClipMatrix;
use glam::{Affine3A, DMat4, Mat4};
use mint::{ColumnMatrix3x4, ColumnMatrix4, Point3, RowMatrix3x4, RowMatrix4};

impl From<[Point3<f32>; 2]> for Aabb {
    /// Takes the minimum and the maximum corner, unchecked as by [`Aabb::new`].
    fn from([min, max]: [Point3<f32>; 2]) -> Self {
        Self::from_arrays(min.into(), max.into())
    }
}

impl From<Aabb> for [Point3<f32>; 2] {
    /// Returns the minimum and the maximum corner.
    fn from(bounds: Aabb) -> Self {
        [bounds.min, bounds.max].map(|corner| corner.to_array().into())
    }
}

impl From<ColumnMatrix4<f32>> for ClipMatrix {
    fn from(matrix: ColumnMatrix4<f32>) -> Self {
        <[[f32; 4]; 4]>::from(matrix).into()
    }
}

impl From<ColumnMatrix4<f64>> for ClipMatrix {
    fn from(matrix: ColumnMatrix4<f64>) -> Self {
        <[[f64; 4]; 4]>::from(matrix).into()
    }
}

impl From<RowMatrix4<f32>> for ClipMatrix {
    fn from(matrix: RowMatrix4<f32>) -> Self {
        Mat4::from_cols_array_2d(&matrix.into()).transpose().into()
    }
}

impl From<RowMatrix4<f64>> for ClipMatrix {
    fn from(matrix: RowMatrix4<f64>) -> Self {
        DMat4::from_cols_array_2d(&matrix.into()).transpose().into()
    }
}

impl ToAffine for ColumnMatrix3x4<f32> {
    /// Converts three axes, then the translation.
    fn to_affine(&self) -> Affine3A {
        [self.x, self.y, self.z, self.w].map(<[f32; 3]>::from).to_affine()
    }
}

impl ToAffine for RowMatrix3x4<f32> {
    /// Converts three rows, the translation last in each.
    fn to_affine(&self) -> Affine3A {
        [self.x, self.y, self.z].map(<[f32; 4]>::from).to_affine()
    }
}
