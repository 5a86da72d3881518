//! Checks of numbers from C, which name the parameter that is wrong.

use crate::error::Error;
use visibility_core::glam::DVec3;

/// Returns a point. An error that names the parameter unless it is finite.
pub(crate) fn finite(point: &[f64; 3], name: &str) -> Result<DVec3, Error> {
    let point = DVec3::from_array(*point);
    if point.is_finite() { Ok(point) } else { Err(Error::argument(format_args!("{name} is not finite"))) }
}

/// Returns a number that is finite and not negative. An error that names the parameter for any other.
pub(crate) fn not_negative(number: f64, name: &str) -> Result<f64, Error> {
    if number >= 0.0 && number.is_finite() {
        return Ok(number);
    }
    Err(Error::argument(format_args!("{name} cannot be {number}")))
}
