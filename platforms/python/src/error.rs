//! Errors at the border: each names the argument that is wrong.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use visibility_2d::cdt::PlanError;

/// Makes a `ValueError` of an argument's name and what is wrong with it.
pub(crate) fn refused(name: &str, what: impl core::fmt::Display) -> PyErr {
    PyValueError::new_err(format!("{name}: {what}"))
}

/// What an error is about, by the arguments of a query.
pub(crate) fn named(name: &'static str) -> impl Fn(PlanError) -> PyErr {
    move |error| match error {
        PlanError::UnknownWall { .. } => refused("wall", error),
        PlanError::Heights => refused("heights", error),
        PlanError::VisibilityGraph => refused("plan", error),
        _ => refused(name, error),
    }
}
