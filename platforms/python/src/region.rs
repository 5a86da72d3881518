//! What can be seen from a box.

use crate::arrays::{self, Axis};
use crate::error::refused;
use crate::scene::{Scene, ids_array};
use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use std::sync::Arc;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::{ObjectId, RegionCuller, VisibleSet};
use visibility_exact::{Effort, ExactCuller, ExactSettings, SceneTriangles, Verdict};
use visibility_region::ExtendedProjectionCuller;

/// Accepts the least and the greatest corner of a box.
fn viewcell(value: &Bound<'_, PyAny>) -> PyResult<Viewcell> {
    let corners = arrays::floats("region", value, &[Axis::Is(2), Axis::Is(3)])?;
    let [min, max] = match corners.groups::<3>() {
        [min, max] => [*min, *max].map(DVec3::from_array),
        _ => return Err(refused("region", "a box has two corners")),
    };
    if !(min.is_finite() && max.is_finite() && min.cmple(max).all()) {
        return Err(refused(
            "region",
            format!("the least corner {min} is not below {max}, or one is not finite"),
        ));
    }
    Ok(Viewcell::from_box(min, max))
}

/// Returns the objects that may be seen from a box.
pub(crate) fn seen<'py>(
    scene: &Scene,
    py: Python<'py>,
    region: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<u32>>> {
    let cell = viewcell(region)?;
    let visible = py.detach(|| {
        let mut visible = VisibleSet::new();
        ExtendedProjectionCuller::new().cull(scene.scene(), &cell, &mut visible);
        visible
    });
    Ok(ids_array(py, visible.iter(scene.scene())))
}

/// Numbers of the objects seen, hidden and undecided, and lines of sight to those seen.
pub(crate) type Verdicts<'py> = (
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray3<f64>>,
);

/// Decides each object from a box.
pub(crate) fn prove<'py>(
    scene: &Scene,
    py: Python<'py>,
    region: &Bound<'py, PyAny>,
    clearance: f64,
) -> PyResult<Verdicts<'py>> {
    let cell = viewcell(region)?;
    if !(0.0..=1e6).contains(&clearance) {
        return Err(refused("clearance", format!("{clearance} is not a number in 0 to 1e6")));
    }
    let scene = scene.scene();
    let (mut seen, hidden, open) = py.detach(|| {
        let triangles = Arc::new(SceneTriangles::new(scene));
        let settings = ExactSettings::new(Effort::Exact(clearance));
        let found = ExactCuller::new(triangles.clone(), settings).verdicts(&cell);
        let (mut seen, mut hidden, mut open): (Vec<(ObjectId, _)>, Vec<_>, Vec<_>) = Default::default();
        for (id, verdict) in found.iter(&triangles) {
            match verdict {
                Verdict::Seen(sight) => seen.push((id, [sight.from.to_array(), sight.to.to_array()])),
                Verdict::Hidden => hidden.push(id),
                _ => open.push(id),
            }
        }
        (seen, hidden, open)
    });
    seen.sort_by_key(|(id, _)| id.index());
    let lines: Vec<[[f64; 3]; 2]> = seen.iter().map(|(_, line)| *line).collect();
    let lines = PyArray1::from_slice(py, lines.as_flattened().as_flattened()).reshape([seen.len(), 2, 3])?;
    let seen = ids_array(py, seen.iter().map(|(id, _)| *id));
    Ok((seen, ids_array(py, hidden), ids_array(py, open), lines))
}
