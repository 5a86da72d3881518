//! What nobody has seen of a plan yet.

use crate::arrays::{self, POINTS_2D, points_array};
use crate::error::{named, refused};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use std::sync::Arc;
use visibility_2d::cdt;

/// What of a plan has not been seen, as convex polygons. Made by Plan.unseen.
#[pyclass(module = "visibility")]
#[derive(Clone)]
pub(crate) struct UnseenRegion {
    plan: Arc<cdt::Plan>,
    region: cdt::UnseenRegion,
}

impl UnseenRegion {
    pub(crate) fn reachable(
        py: Python<'_>,
        plan: &Arc<cdt::Plan>,
        starts: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let starts = arrays::floats("starts", starts, POINTS_2D)?;
        let starts = starts.groups::<2>();
        let region = py.detach(|| cdt::UnseenRegion::reachable(plan, starts)).map_err(named("starts"))?;
        Ok(Self { plan: plan.clone(), region })
    }
}

#[pymethods]
impl UnseenRegion {
    /// Area in square metres.
    #[getter]
    fn area(&self) -> f64 {
        self.region.area()
    }

    /// Takes away what an eye, x and y, sees.
    fn look(&mut self, py: Python<'_>, eye: [f64; 2]) -> PyResult<()> {
        let (plan, region) = (self.plan.as_ref(), &mut self.region);
        py.detach(|| region.look(plan, eye)).map_err(named("eye"))
    }

    /// Area that each of many eyes would take away, in square metres: float64 (n,) for eyes (n, 2) float64.
    fn gains<'py>(&self, py: Python<'py>, eyes: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let eyes = arrays::floats("eyes", eyes, POINTS_2D)?;
        let (plan, region, eyes) = (self.plan.as_ref(), &self.region, eyes.groups::<2>());
        let gains = py.detach(|| {
            let all = region.area();
            eyes.iter()
                .enumerate()
                .map(|(row, &eye)| {
                    let mut left = region.clone();
                    left.look(plan, eye).map(|()| all - left.area()).map_err(|error| (row, error))
                })
                .collect::<Result<Vec<f64>, _>>()
        });
        let gains = gains.map_err(|(row, error)| refused("eyes", format!("row {row}: {error}")))?;
        Ok(PyArray1::from_vec(py, gains))
    }

    /// Convex polygons that make up the region, each (k, 2) float64, in metres.
    fn polygons<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        self.region.polygons().map(|polygon| points_array(py, &polygon)).collect()
    }

    /// Whether the region contains points: bool (n,) for points (n, 2) float64.
    fn contains<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let points = arrays::floats("points", points, POINTS_2D)?;
        let (plan, region, points) = (self.plan.as_ref(), &self.region, points.groups::<2>());
        let found = py.detach(|| {
            let contains = |&point: &[f64; 2]| region.contains(plan, point);
            points.iter().map(contains).collect::<Result<Vec<bool>, _>>()
        });
        Ok(PyArray1::from_vec(py, found.map_err(named("points"))?))
    }

    /// A copy that can be looked at separately.
    fn copy(&self) -> Self {
        self.clone()
    }

    fn __repr__(&self) -> String {
        format!("UnseenRegion({:.6} square metres)", self.region.area())
    }
}
