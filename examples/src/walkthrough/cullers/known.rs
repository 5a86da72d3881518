//! An entry in the tables of cullers.

use crate::walkthrough::World;
use visibility_core::Culler;

/// A culler that can be asked for by name.
pub struct Known {
    /// The name, without its dial.
    pub name: &'static str,
    /// What it is, and what its dial means if it has one.
    pub what: &'static str,
    /// Settings of the dial that are worth comparing, from the most accurate to the fastest; empty if there
    /// is no dial.
    pub dials: &'static [&'static str],
    /// Makes one for a world, with the dial's setting: what stands after the colon in `name:dial`.
    pub(super) make: fn(dial: Option<&str>, world: &World) -> Made,
}

/// A culler, or why it does not go with the dial or the scene.
pub(super) type Made = Result<Box<dyn Culler + Send>, String>;

/// For cullers without a dial.
pub(super) fn no_dial(dial: Option<&str>) -> Result<(), String> {
    dial.map_or(Ok(()), |dial| Err(format!("it has no dial to set to `{dial}`")))
}
