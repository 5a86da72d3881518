//! Conversions of the types of `mint`: no element changes its place.

use mint::{ColumnMatrix3x4, ColumnMatrix4, Point3, RowMatrix3x4, RowMatrix4};
use visibility_culling::Aabb;
use visibility_culling::scene::ToAffine;
use visibility_culling::view::ClipMatrix;

/// Sixteen different numbers, by column, then row.
const COLUMNS: [[f32; 4]; 4] =
    [[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0], [9.0, 10.0, 11.0, 12.0], [13.0, 14.0, 15.0, 16.0]];

/// Returns the element of a row and a column of a matrix given by columns.
fn transposed<const R: usize, const C: usize>(columns: [[f32; R]; C]) -> [[f32; C]; R] {
    std::array::from_fn(|row| std::array::from_fn(|column| columns[column][row]))
}

#[test]
fn boxes_keep_their_corners() {
    let corners = [Point3 { x: 1.0, y: 2.0, z: 3.0 }, Point3 { x: 4.0, y: 5.0, z: 6.0 }];
    let bounds = Aabb::from(corners);
    assert_eq!(bounds, Aabb::from_arrays([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]), "the box of two points");
    assert_eq!(<[Point3<f32>; 2]>::from(bounds), corners, "the two points of the box");
}

#[test]
fn clip_matrices_keep_their_elements() {
    let expected = ClipMatrix::from(COLUMNS);
    let wide = COLUMNS.map(|column| column.map(f64::from));
    let rows = transposed(COLUMNS);
    let wide_rows = rows.map(|row| row.map(f64::from));
    assert_eq!(ClipMatrix::from(ColumnMatrix4::<f32>::from(COLUMNS)), expected, "columns in f32");
    assert_eq!(ClipMatrix::from(ColumnMatrix4::<f64>::from(wide)), expected, "columns in f64");
    assert_eq!(ClipMatrix::from(RowMatrix4::<f32>::from(rows)), expected, "rows in f32");
    assert_eq!(ClipMatrix::from(RowMatrix4::<f64>::from(wide_rows)), expected, "rows in f64");
}

#[test]
fn transforms_keep_their_elements() {
    let columns = COLUMNS.map(|[x, y, z, _]| [x, y, z]);
    let rows: [[f32; 4]; 3] = transposed(columns);
    let expected = columns.to_affine();
    assert_eq!(expected.translation.x, 13.0, "the translation of the expected transform");
    assert_eq!(ColumnMatrix3x4::<f32>::from(columns).to_affine(), expected, "columns");
    assert_eq!(RowMatrix3x4::<f32>::from(rows).to_affine(), expected, "rows");
}
