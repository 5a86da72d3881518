//! Entry in the tables of cullers that can be chosen on the command line.

use crate::walkthrough::World;
use visibility_core::Culler;

/// Culler that can be asked for by name on the command line.
pub struct Known {
    /// Name of the culler, without a setting.
    pub name: &'static str,
    /// Description of the culler and of its setting, for help texts.
    pub what: &'static str,
    /// Settings that are worth comparing, from the most accurate to the fastest. Empty if the
    /// culler has no setting.
    pub dials: &'static [&'static str],
    /// Function that makes the culler for a world. `dial` is the setting after the colon in `name:dial`,
    /// `None` without a colon.
    pub(super) make: fn(dial: Option<&str>, world: &World) -> Made,
}

/// Culler, or the reason why it does not suit the setting or the scene.
pub(super) type Made = Result<Box<dyn Culler + Send + Sync>, String>;

/// Returns an error if a setting is given, for cullers that have none.
pub(super) fn no_dial(dial: Option<&str>) -> Result<(), String> {
    dial.map_or(Ok(()), |dial| Err(format!("it has no dial to set to `{dial}`")))
}
