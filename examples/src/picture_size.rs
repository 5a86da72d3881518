//! Picture sizes on the command line.

use std::fmt::Display;
use std::str::FromStr;

/// Reads a width and a height in pixels from text such as `640x360`. The error is a message for a person: the
/// `x` is missing, or a side is not a number.
pub fn parse_size<T: FromStr<Err: Display>>(text: &str) -> Result<[T; 2], String> {
    let (width, height) = text.split_once('x').ok_or("a size looks like 640x360")?;
    let side = |text: &str| text.parse().map_err(|error| format!("{text}: {error}"));
    Ok([side(width)?, side(height)?])
}
