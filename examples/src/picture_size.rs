//! The size of a picture, as programs take it on the command line.

use std::fmt::Display;
use std::str::FromStr;

/// Width and height from text such as `640x360`.
pub fn parse_size<T: FromStr<Err: Display>>(text: &str) -> Result<[T; 2], String> {
    let (width, height) = text.split_once('x').ok_or("a size looks like 640x360")?;
    let side = |text: &str| text.parse().map_err(|error| format!("{text}: {error}"));
    Ok([side(width)?, side(height)?])
}
