//! Upper and lower bounds on the sizes that a recipe accepts.

use crate::error::SourceError;

/// Maximum number of triangles of a recipe's scene. 2^25 triangles take about a gigabyte.
const MOST_TRIANGLES: u64 = 1 << 25;

/// Checker of the sizes of one recipe, used before the recipe allocates memory.
pub(super) struct Limits {
    spec: String,
}

impl Limits {
    /// Creates a checker whose errors quote `spec`, the recipe with its sizes as the user wrote it.
    pub(super) fn new(spec: String) -> Self {
        Self { spec }
    }

    /// Returns an error when `size` is 0. `what` names the counted things in the message, as a plural.
    pub(super) fn at_least_one(&self, what: &str, size: u32) -> Result<(), SourceError> {
        if size == 0 {
            return Err(SourceError::recipe(&self.spec, format!("there must be at least one of the {what}")));
        }
        Ok(())
    }

    /// Returns an error when `units` parts of a scene, with about `each` triangles per part, exceed
    /// [`MOST_TRIANGLES`]. Exactly that many triangles are accepted.
    pub(super) fn triangles(&self, units: u64, each: u64) -> Result<(), SourceError> {
        let total = u128::from(units) * u128::from(each);
        if total > u128::from(MOST_TRIANGLES) {
            return Err(SourceError::recipe(
                &self.spec,
                format!(
                    "about {total} triangles are more than the {MOST_TRIANGLES} that recipes are bounded to"
                ),
            ));
        }
        Ok(())
    }
}
