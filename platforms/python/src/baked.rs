//! Baked sets: what is seen from each of many boxes, for lookup.

use crate::arrays::{self, BOXES, POINTS_3D};
use crate::error::refused;
use crate::scene::Scene;
use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use visibility_bake::{Grid, SandwichBaker, SandwichSettings};
use visibility_core::bake::Bake;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, ViewcellId, Viewcells};

/// For each of many boxes the objects that may be seen from it. Made by Scene.bake, or read from a file.
#[pyclass(module = "visibility", frozen)]
pub(crate) struct BakedSet {
    baked: visibility_bake::BakedSet,
}

impl BakedSet {
    /// Bakes the boxes of a scene.
    pub(crate) fn of_scene(
        scene: &Scene,
        py: Python<'_>,
        cells: &Bound<'_, PyAny>,
        clearance: f64,
        gap: f64,
    ) -> PyResult<Self> {
        let cells = arrays::floats("cells", cells, BOXES)?;
        let cells = cells.groups::<6>();
        for (name, value) in [("clearance", clearance), ("gap", gap)] {
            if !(0.0..=1e6).contains(&value) {
                return Err(refused(name, format!("{value} is not a number in 0 to 1e6")));
            }
        }
        let mut boxes = Vec::with_capacity(cells.len());
        for (row, &[a, b, c, d, e, f]) in cells.iter().enumerate() {
            let (min, max) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
            if !(min.is_finite() && max.is_finite() && min.cmple(max).all()) {
                return Err(refused(
                    "cells",
                    format!("row {row} has its corners in the wrong order, or is not finite"),
                ));
            }
            boxes.push(Viewcell::from_box(min, max));
        }
        let baked = py.detach(|| {
            let cells = Viewcells::new(boxes);
            let settings = SandwichSettings::default().with_clearance(clearance).with_gap(gap);
            let outcome = Bake::new(SandwichBaker::new(scene.scene(), &cells, settings)).run();
            visibility_bake::BakedSet::new(scene.scene(), cells, outcome.source, &outcome.cells)
        });
        Ok(Self { baked: baked.map_err(|error| refused("cells", error))? })
    }
}

/// Returns the boxes of a grid that cover a box.
pub(crate) fn grid_cells(
    py: Python<'_>,
    region: [[f64; 3]; 2],
    size: [f64; 3],
) -> PyResult<Bound<'_, PyArray3<f64>>> {
    let [min, max] = region.map(DVec3::from_array);
    let grid = Grid::new(DVec3::ZERO, DVec3::from_array(size)).map_err(|error| refused("size", error))?;
    let cells = grid.over(min, max).map_err(|error| refused("region", error))?;
    let corners: Vec<[[f64; 3]; 2]> =
        cells.iter().map(|cell| [cell.min.to_array(), cell.max.to_array()]).collect();
    PyArray1::from_slice(py, corners.as_flattened().as_flattened()).reshape([corners.len(), 2, 3])
}

#[pymethods]
impl BakedSet {
    /// Reads what to_bytes wrote.
    #[staticmethod]
    fn from_bytes(data: &[u8]) -> PyResult<Self> {
        let baked = visibility_bake::BakedSet::from_bytes(data).map_err(|error| refused("data", error))?;
        Ok(Self { baked })
    }

    /// The bytes of a file that the program's engine reads, in any language of this library.
    fn to_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let bytes = py.detach(|| self.baked.to_bytes());
        PyBytes::new(py, &bytes)
    }

    fn __len__(&self) -> usize {
        self.baked.viewcells().cells().len()
    }

    fn __repr__(&self) -> String {
        format!("BakedSet({} cells, {} bytes)", self.__len__(), self.baked.set_bytes())
    }

    /// Numbers of the objects that may be seen from a cell, ascending: uint32 (k,).
    fn row<'py>(&self, py: Python<'py>, cell: u32) -> PyResult<Bound<'py, PyArray1<u32>>> {
        if cell as usize >= self.__len__() {
            return Err(refused("cell", format!("{cell} is beyond the {} cells", self.__len__())));
        }
        Ok(PyArray1::from_vec(py, self.baked.row(ViewcellId(cell))))
    }

    /// In which cell each point is, -1 for none: int64 (n,) for points (n, 3) float64.
    fn locate<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let points = arrays::floats("points", points, POINTS_3D)?;
        let points = points.groups::<3>();
        let cells = self.baked.viewcells();
        let found = py.detach(|| {
            let cell = |&point: &[f64; 3]| {
                cells.locate(DVec3::from_array(point)).map_or(-1, |cell| i64::from(cell.0))
            };
            points.iter().map(cell).collect::<Vec<i64>>()
        });
        Ok(PyArray1::from_vec(py, found))
    }
}
