//! Cameras.

use crate::arrays::{self, Axis};
use crate::error::refused;
use pyo3::prelude::*;
use visibility_core::glam::DVec3;
use visibility_core::view::{Depth, Window};
use visibility_core::{Pose, view};

/// A camera. Worlds are right-handed unless a matrix says otherwise; lengths are in metres, angles in
/// radians.
#[pyclass(module = "visibility", frozen)]
pub(crate) struct View {
    pub(crate) view: view::View,
}

fn named(error: view::ViewError) -> PyErr {
    match error {
        view::ViewError::Parameter { name, .. } => refused(name, error),
        _ => refused("matrix", error),
    }
}

/// Checks three numbers, which must be finite.
fn finite(name: &str, point: [f64; 3]) -> PyResult<DVec3> {
    let point = DVec3::from_array(point);
    if point.is_finite() { Ok(point) } else { Err(refused(name, format!("{point} is not finite"))) }
}

fn pose(eye: [f64; 3], target: [f64; 3], up: [f64; 3]) -> PyResult<Pose> {
    Ok(Pose::look_at(finite("eye", eye)?, finite("target", target)?, finite("up", up)?))
}

#[pymethods]
impl View {
    /// A perspective camera at eye that looks towards target; the picture's upper edge is towards up, +z by
    /// default.
    ///
    /// fov_y: vertical field of view in radians. aspect: width over height. near, far: distances of the
    /// planes in metres; far may be infinite.
    #[staticmethod]
    #[pyo3(signature = (eye, target, *, up=[0.0, 0.0, 1.0], fov_y=1.0, aspect=16.0 / 9.0, near=0.1, far=f64::INFINITY), text_signature = "(eye, target, *, up=(0, 0, 1), fov_y=1.0, aspect=1.7777777777777777, near=0.1, far=1e999)")]
    fn perspective(
        eye: [f64; 3],
        target: [f64; 3],
        up: [f64; 3],
        fov_y: f64,
        aspect: f64,
        near: f64,
        far: f64,
    ) -> PyResult<Self> {
        let view =
            view::View::perspective(pose(eye, target, up)?, fov_y, aspect, near, far).map_err(named)?;
        Ok(Self { view })
    }

    /// A camera with parallel lines of sight, such as a map or a shadow of the sun: the picture is width by
    /// height metres, and holds what is near to far metres in front of eye.
    #[staticmethod]
    #[pyo3(signature = (eye, target, width, height, *, up=[0.0, 0.0, 1.0], near=0.1, far=1000.0), text_signature = "(eye, target, width, height, *, up=(0, 0, 1), near=0.1, far=1000.0)")]
    fn orthographic(
        eye: [f64; 3],
        target: [f64; 3],
        width: f64,
        height: f64,
        up: [f64; 3],
        near: f64,
        far: f64,
    ) -> PyResult<Self> {
        let window = Window::centered(width / 2.0, height / 2.0);
        let view = view::View::orthographic(pose(eye, target, up)?, window, near, far).map_err(named)?;
        Ok(Self { view })
    }

    /// The camera of a matrix from world to clip space, (4, 4) float64, for column vectors: clip = matrix @
    /// world, so that the last column translates. depth: "negative_one_to_one" (OpenGL), "zero_to_one" or
    /// "reversed" (near plane at 1).
    #[staticmethod]
    #[pyo3(signature = (matrix, *, depth="negative_one_to_one"))]
    fn from_matrix(matrix: &Bound<'_, PyAny>, depth: &str) -> PyResult<Self> {
        let matrix = arrays::floats("matrix", matrix, &[Axis::Is(4), Axis::Is(4)])?;
        let depth = match depth {
            "negative_one_to_one" => Depth::NegativeOneToOne,
            "zero_to_one" => Depth::ZeroToOne,
            "reversed" => Depth::Reversed,
            other => {
                let what = format!("{other:?} is not negative_one_to_one, zero_to_one or reversed");
                return Err(refused("depth", what));
            }
        };
        // Rows of numpy become columns.
        let mut columns = [[0.0; 4]; 4];
        for (row, numbers) in matrix.groups::<4>().iter().enumerate() {
            for (column, number) in columns.iter_mut().zip(numbers) {
                if let Some(place) = column.get_mut(row) {
                    *place = *number;
                }
            }
        }
        let view = view::View::from_clip_from_world(columns, depth).map_err(named)?;
        Ok(Self { view })
    }

    fn __repr__(&self) -> String {
        format!("View({})", self.view)
    }
}
