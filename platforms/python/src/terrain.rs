//! Viewsheds of rasters of heights.

use crate::arrays::{self, Input, POINTS_2D, RASTER};
use crate::error::refused;
use numpy::{
    Element, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use std::num::NonZero;
use visibility_2d::viewshed::{HeightRaster, Observer, Viewshed, ViewshedError};

/// Heights of one of the types that are taken as they are.
enum Heights<'py> {
    Double(Input<'py, f64>),
    Single(Input<'py, f32>),
    Short(Input<'py, i16>),
}

/// What all observers of a call share.
#[derive(Clone, Copy)]
struct Sight {
    cell: [f64; 2],
    observer_height: f64,
    target_height: f64,
    max_distance: f64,
    curvature: f64,
}

/// A side of all cells, or their sides between rows and between columns.
#[derive(FromPyObject)]
pub(crate) enum CellSize {
    Square(f64),
    Sides([f64; 2]),
}

impl Sight {
    fn observer(&self, [row, column]: [f64; 2]) -> Observer {
        Observer::new(row, column)
            .with_height(self.observer_height)
            .with_target_height(self.target_height)
            .with_max_distance(self.max_distance)
            .with_curvature(self.curvature)
    }
}

impl CellSize {
    fn sides(&self) -> [f64; 2] {
        match *self {
            Self::Square(side) => [side; 2],
            Self::Sides(sides) => sides,
        }
    }
}

impl<'py> Heights<'py> {
    fn new(value: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(array) = value.cast::<PyUntypedArray>() {
            let (py, dtype) = (value.py(), array.dtype());
            if dtype.is_equiv_to(&numpy::dtype::<f32>(py)) {
                return Ok(Self::Single(arrays::array("heights", value, RASTER)?));
            }
            if dtype.is_equiv_to(&numpy::dtype::<i16>(py)) {
                return Ok(Self::Short(arrays::array("heights", value, RASTER)?));
            }
            if !dtype.is_equiv_to(&numpy::dtype::<f64>(py)) {
                let given = arrays::given_text(value);
                let what = format!("expected (rows, columns) float64, float32 or int16, got {given}");
                return Err(refused("heights", what));
            }
        }
        Ok(Self::Double(arrays::floats("heights", value, RASTER)?))
    }

    fn shape(&self) -> [usize; 2] {
        let shape = match self {
            Self::Double(heights) => heights.shape(),
            Self::Single(heights) => heights.shape(),
            Self::Short(heights) => heights.shape(),
        };
        [0, 1].map(|axis| shape.get(axis).copied().unwrap_or(0))
    }

    /// Calls `work` with the numbers, whatever their type, without the interpreter's lock.
    fn run<R: Send>(&self, py: Python<'_>, work: impl Work<R>) -> R {
        match self {
            Self::Double(heights) => with(py, heights.numbers(), work),
            Self::Single(heights) => with(py, heights.numbers(), work),
            Self::Short(heights) => with(py, heights.numbers(), work),
        }
    }
}

/// Work on heights of any type.
trait Work<R>: Send {
    fn on<T: Copy + Into<f64> + Sync>(self, heights: &[T]) -> R;
}

fn with<T: Element + Copy + Into<f64>, R: Send>(py: Python<'_>, heights: &[T], work: impl Work<R>) -> R {
    py.detach(|| work.on(heights))
}

/// Fills `out`, sample by sample, for one observer.
struct Look<'a, O> {
    shape: [usize; 2],
    sight: Sight,
    observer: [f64; 2],
    out: &'a mut [O],
}

impl Work<Result<(), ViewshedError>> for Look<'_, bool> {
    fn on<T: Copy + Into<f64> + Sync>(self, heights: &[T]) -> Result<(), ViewshedError> {
        let raster = HeightRaster::new(heights, self.shape[0], self.shape[1], self.sight.cell)?;
        Viewshed::new().look(&raster, &self.sight.observer(self.observer), self.out)
    }
}

impl Work<Result<(), ViewshedError>> for Look<'_, f64> {
    fn on<T: Copy + Into<f64> + Sync>(self, heights: &[T]) -> Result<(), ViewshedError> {
        let raster = HeightRaster::new(heights, self.shape[0], self.shape[1], self.sight.cell)?;
        Viewshed::new().hidden_heights(&raster, &self.sight.observer(self.observer), self.out)
    }
}

/// Counts for each sample the observers that see it, on several threads.
struct Count<'a> {
    shape: [usize; 2],
    sight: Sight,
    observers: &'a [[f64; 2]],
    threads: usize,
}

impl Work<Result<Vec<u32>, ViewshedError>> for Count<'_> {
    fn on<T: Copy + Into<f64> + Sync>(self, heights: &[T]) -> Result<Vec<u32>, ViewshedError> {
        let raster = HeightRaster::new(heights, self.shape[0], self.shape[1], self.sight.cell)?;
        let count_some = |observers: &[[f64; 2]]| {
            let (mut viewshed, mut visible) = (Viewshed::new(), vec![false; heights.len()]);
            let mut counts = vec![0_u32; heights.len()];
            for &observer in observers {
                viewshed.look(&raster, &self.sight.observer(observer), &mut visible)?;
                for (count, &seen) in counts.iter_mut().zip(&visible) {
                    *count += u32::from(seen);
                }
            }
            Ok(counts)
        };
        let share = self.observers.len().div_ceil(self.threads).max(1);
        std::thread::scope(|scope| {
            let mut chunks = self.observers.chunks(share);
            let first = chunks.next().unwrap_or_default();
            // Where no further thread can be had, its observers are looked from here.
            let others: Vec<_> = chunks
                .map(|observers| {
                    let work = move || count_some(observers);
                    std::thread::Builder::new().spawn_scoped(scope, work).map_err(|_| observers)
                })
                .collect();
            let mut counts = count_some(first)?;
            for other in others {
                let more = match other {
                    Ok(thread) => match thread.join() {
                        Ok(more) => more?,
                        Err(panic) => std::panic::resume_unwind(panic),
                    },
                    Err(observers) => count_some(observers)?,
                };
                for (count, more) in counts.iter_mut().zip(more) {
                    *count += more;
                }
            }
            Ok(counts)
        })
    }
}

/// Names the argument that an error is about.
fn named(error: ViewshedError) -> PyErr {
    let name = match error {
        ViewshedError::Count { .. } => "heights",
        ViewshedError::Cell { .. } => "cell_size",
        ViewshedError::Observer { .. } => "observer",
        ViewshedError::Distance { .. } => "max_distance",
        _ => "observer_height, target_height or curvature",
    };
    refused(name, error)
}

/// Which samples of a raster of heights an observer sees: bool (rows, columns).
///
/// heights: (rows, columns) float64, float32 or int16, in metres; NaN is no ground. Taken without a copy if
///     contiguous.
/// observer: (row, column) of the observer, fractional values allowed.
/// cell_size: distance between samples in metres, or (between rows, between columns).
/// observer_height: height of the eye above the surface, in metres.
/// target_height: height of the targets above the ground at their samples, in metres.
/// max_distance: samples farther than this along the plan, in metres, are False.
/// curvature: each sample is lowered by this times its squared distance; 6.7e-8 for the earth with
///     refraction.
///
/// The surface is made of two triangles per square of four samples, divided from (row, column) to
/// (row + 1, column + 1). The result is exact on this surface, but for ties within rounding, which are True.
#[pyfunction]
#[pyo3(signature = (heights, observer, *, cell_size=CellSize::Square(1.0), observer_height=1.8, target_height=0.0, max_distance=f64::INFINITY, curvature=0.0), text_signature = "(heights, observer, *, cell_size=1.0, observer_height=1.8, target_height=0.0, max_distance=1e999, curvature=0.0)")]
#[expect(clippy::too_many_arguments, reason = "named arguments of Python")]
pub(crate) fn viewshed<'py>(
    py: Python<'py>,
    heights: &Bound<'py, PyAny>,
    observer: [f64; 2],
    cell_size: CellSize,
    observer_height: f64,
    target_height: f64,
    max_distance: f64,
    curvature: f64,
) -> PyResult<Bound<'py, PyArray2<bool>>> {
    let heights = Heights::new(heights)?;
    let sight = Sight { cell: cell_size.sides(), observer_height, target_height, max_distance, curvature };
    let shape = heights.shape();
    let mut visible = vec![false; shape[0] * shape[1]];
    heights.run(py, Look { shape, sight, observer, out: &mut visible[..] }).map_err(named)?;
    PyArray1::from_vec(py, visible).reshape(shape)
}

/// Up to which height above its ground each sample is hidden, in metres: float64 (rows, columns).
///
/// 0 where the ground is visible; NaN beyond max_distance and where there is no ground. A target at height h
/// is visible where the result is at most h. The arguments are those of viewshed.
#[pyfunction]
#[pyo3(signature = (heights, observer, *, cell_size=CellSize::Square(1.0), observer_height=1.8, max_distance=f64::INFINITY, curvature=0.0), text_signature = "(heights, observer, *, cell_size=1.0, observer_height=1.8, max_distance=1e999, curvature=0.0)")]
pub(crate) fn hidden_heights<'py>(
    py: Python<'py>,
    heights: &Bound<'py, PyAny>,
    observer: [f64; 2],
    cell_size: CellSize,
    observer_height: f64,
    max_distance: f64,
    curvature: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let heights = Heights::new(heights)?;
    let sight =
        Sight { cell: cell_size.sides(), observer_height, target_height: 0.0, max_distance, curvature };
    let shape = heights.shape();
    let mut hidden = vec![0.0; shape[0] * shape[1]];
    heights.run(py, Look { shape, sight, observer, out: &mut hidden[..] }).map_err(named)?;
    PyArray1::from_vec(py, hidden).reshape(shape)
}

/// How many of many observers see each sample: uint32 (rows, columns).
///
/// observers: (n, 2) float64, row and column of each. threads: None for all cores. The other arguments are
/// those of viewshed.
#[pyfunction]
#[pyo3(signature = (heights, observers, *, cell_size=CellSize::Square(1.0), observer_height=1.8, target_height=0.0, max_distance=f64::INFINITY, curvature=0.0, threads=None), text_signature = "(heights, observers, *, cell_size=1.0, observer_height=1.8, target_height=0.0, max_distance=1e999, curvature=0.0, threads=None)")]
#[expect(clippy::too_many_arguments, reason = "named arguments of Python")]
pub(crate) fn viewshed_count<'py>(
    py: Python<'py>,
    heights: &Bound<'py, PyAny>,
    observers: &Bound<'py, PyAny>,
    cell_size: CellSize,
    observer_height: f64,
    target_height: f64,
    max_distance: f64,
    curvature: f64,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray2<u32>>> {
    let heights = Heights::new(heights)?;
    let observers = arrays::floats("observers", observers, POINTS_2D)?;
    let sight = Sight { cell: cell_size.sides(), observer_height, target_height, max_distance, curvature };
    let shape = heights.shape();
    let threads =
        threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, NonZero::get)).clamp(1, 256);
    let work = Count { shape, sight, observers: observers.groups::<2>(), threads };
    let counts = heights.run(py, work).map_err(named)?;
    PyArray1::from_vec(py, counts).reshape(shape)
}
