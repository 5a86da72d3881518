//! The Python package `visibility`: numpy arrays in and out, on the visibility crates.
//!
//! All work is done without the interpreter's lock. What is wrong with an argument is a `ValueError` that
//! begins with the argument's name. The documentation for users is in `python/visibility/_visibility.pyi` and
//! in the docstrings here.

mod arrays;
mod baked;
mod cells;
mod cullers;
mod error;
mod measure;
mod plan;
mod region;
mod scene;
mod scene_methods;
mod terrain;
mod unseen;
mod view;

use pyo3::prelude::*;

/// Native part of the package; import `visibility` instead.
#[pymodule]
fn _visibility(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<plan::Plan>()?;
    module.add_class::<unseen::UnseenRegion>()?;
    module.add_class::<scene::Scene>()?;
    module.add_class::<view::View>()?;
    module.add_class::<baked::BakedSet>()?;
    module.add_class::<cells::Cells>()?;
    module.add_function(wrap_pyfunction!(terrain::viewshed, module)?)?;
    module.add_function(wrap_pyfunction!(terrain::viewshed_count, module)?)?;
    module.add_function(wrap_pyfunction!(terrain::hidden_heights, module)?)?;
    Ok(())
}
