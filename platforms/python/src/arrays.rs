//! Arrays at the border: what is accepted, by name, and how points are read from them.

use crate::error::refused;
use core::fmt::Write;
use numpy::{
    Element, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

/// An array that was accepted: contiguous and aligned, which numpy has copied it for if it was not.
pub(crate) struct Input<'py, T: Element + Copy>(PyReadonlyArrayDyn<'py, T>);

impl<T: Element + Copy> Input<'_, T> {
    /// Returns all numbers, the last axis fastest.
    pub(crate) fn numbers(&self) -> &[T] {
        self.0.as_slice().unwrap_or_default()
    }

    /// Returns the lengths of the axes.
    pub(crate) fn shape(&self) -> &[usize] {
        self.0.shape()
    }

    /// Returns all numbers in groups of `N`, which the last axis, or the last axes together, must be long.
    pub(crate) fn groups<const N: usize>(&self) -> &[[T; N]] {
        self.numbers().as_chunks::<N>().0
    }
}

/// A shape that an argument must have: a number, or the name of a length that is free.
#[derive(Clone, Copy)]
pub(crate) enum Axis {
    Is(usize),
    Any(&'static str),
}

use Axis::{Any, Is};

/// Points of the plan, `(n, 2)`.
pub(crate) const POINTS_2D: &[Axis] = &[Any("n"), Is(2)];
/// Points of space, `(n, 3)`.
pub(crate) const POINTS_3D: &[Axis] = &[Any("n"), Is(3)];
/// Boxes, `(n, 2, 3)`.
pub(crate) const BOXES: &[Axis] = &[Any("n"), Is(2), Is(3)];
/// One list of numbers, `(n,)`.
pub(crate) const LIST: &[Axis] = &[Any("n")];
/// Heights of terrain, `(rows, columns)`.
pub(crate) const RASTER: &[Axis] = &[Any("rows"), Any("columns")];

/// Accepts an array of `float64`, or lists of numbers, which are copied.
pub(crate) fn floats<'py>(
    name: &str,
    value: &Bound<'py, PyAny>,
    shape: &[Axis],
) -> PyResult<Input<'py, f64>> {
    if value.cast::<PyUntypedArray>().is_ok() {
        return array(name, value, shape);
    }
    // Numbers in lists and tuples. What has no numbers is refused below, by its type.
    let made = value.py().import("numpy")?.call_method1("asarray", (value, "float64"));
    let made = made.map_err(|_| refused(name, expected::<f64>(value, shape)))?;
    array(name, &made, shape)
}

/// Accepts indices: an array of `uint32`, `int64`, `int32` or `uint64`, or lists of numbers, of which all but
/// the first kind are copied.
pub(crate) fn indices<'py>(
    name: &str,
    value: &Bound<'py, PyAny>,
    shape: &[Axis],
) -> PyResult<Input<'py, u32>> {
    refuse_masked(name, value)?;
    if let Ok(array) = value.cast::<PyUntypedArray>() {
        if array.dtype().is_equiv_to(&numpy::dtype::<u32>(value.py())) {
            return self::array(name, value, shape);
        }
        let kind: char = array.dtype().kind().into();
        if kind != 'i' && kind != 'u' {
            return Err(refused(name, expected::<u32>(value, shape)));
        }
    }
    let numpy = value.py().import("numpy")?;
    let wide = numpy.call_method1("asarray", (value,))?;
    let kind: String = wide.getattr("dtype")?.getattr("kind")?.extract()?;
    let is_empty = wide.len()? == 0;
    if kind != "i" && kind != "u" && !is_empty {
        return Err(refused(name, expected::<u32>(&wide, shape)));
    }
    if !is_empty && wide.getattr("size")?.extract::<usize>()? > 0 {
        for (limit, extreme) in [("min", 0_i128), ("max", i128::from(u32::MAX))] {
            let found: i128 = wide.call_method0(limit)?.call_method0("item")?.extract()?;
            if (limit == "min" && found < extreme) || (limit == "max" && found > extreme) {
                return Err(refused(name, format!("{found} is no index")));
            }
        }
    }
    array(name, &wide.call_method1("astype", ("uint32",))?, shape)
}

/// Accepts an array of one type and shape.
pub(crate) fn array<'py, T: Element + Copy>(
    name: &str,
    value: &Bound<'py, PyAny>,
    shape: &[Axis],
) -> PyResult<Input<'py, T>> {
    refuse_masked(name, value)?;
    let Ok(array) = value.cast::<PyArrayDyn<T>>() else {
        return Err(refused(name, expected::<T>(value, shape)));
    };
    let given = array.shape();
    let fits =
        |(axis, length): (&Axis, &usize)| matches!(axis, Any(_)) || matches!(axis, Is(n) if n == length);
    if given.len() != shape.len() || !shape.iter().zip(given).all(fits) {
        return Err(refused(name, expected::<T>(value, shape)));
    }
    // Fields of packed records and views of bytes may be strided by parts of numbers, or not aligned: numpy
    // copies what is not as a slice is.
    let numpy = value.py().import("numpy")?;
    let plain = numpy.call_method1("require", (array, value.py().None(), ["C_CONTIGUOUS", "ALIGNED"]))?;
    let plain = plain.cast_into::<PyArrayDyn<T>>().map_err(|error| refused(name, error))?;
    let plain = plain.try_readonly().map_err(|error| refused(name, error))?;
    // Never so after `require`, and no error may pass for an empty array.
    plain.as_slice().map_err(|error| refused(name, error))?;
    Ok(Input(plain))
}

/// Refuses an array of `numpy.ma` with masked numbers: whatever stands behind a mask is no number.
fn refuse_masked(name: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
    let is_masked = value.py().import("numpy.ma")?.call_method1("is_masked", (value,))?.extract()?;
    if is_masked {
        return Err(refused(name, "has masked numbers: fill them, heights by `filled(numpy.nan)`"));
    }
    Ok(())
}

/// Says what was expected and what was given, such as `expected (n, 3) float64, got (n, 2) float32`.
pub(crate) fn expected<T: Element>(value: &Bound<'_, PyAny>, shape: &[Axis]) -> String {
    let dtype = numpy::dtype::<T>(value.py());
    format!("expected {} {}, got {}", shape_text(shape), type_text(dtype.as_any()), given_text(value))
}

/// Writes a shape, such as `(n, 3)`.
fn shape_text(shape: &[Axis]) -> String {
    let mut text = String::from("(");
    for (number, axis) in shape.iter().enumerate() {
        let separator = if number > 0 { ", " } else { "" };
        // Writing to a string does not fail.
        let _ = match axis {
            Is(length) => write!(text, "{separator}{length}"),
            Any(name) => write!(text, "{separator}{name}"),
        };
    }
    text.push_str(if shape.len() == 1 { ",)" } else { ")" });
    text
}

/// Writes shape and type of an array, or the type of what is none.
pub(crate) fn given_text(value: &Bound<'_, PyAny>) -> String {
    match value.cast::<PyUntypedArray>() {
        Ok(array) => {
            let lengths: Vec<Axis> = array.shape().iter().map(|&length| Is(length)).collect();
            format!("{} {}", shape_text(&lengths), type_text(array.dtype().as_any()))
        }
        Err(_) => value.get_type().name().map_or_else(|_| "an object".into(), |name| name.to_string()),
    }
}

fn type_text(dtype: &Bound<'_, PyAny>) -> String {
    dtype.str().map_or_else(|_| "?".into(), |text| text.to_string())
}

/// Makes an array `(n, 2)` of points.
pub(crate) fn points_array<'py>(py: Python<'py>, points: &[[f64; 2]]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_slice(py, points.as_flattened()).reshape([points.len(), 2])
}
