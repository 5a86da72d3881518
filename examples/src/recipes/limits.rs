//! Bounds on the sizes of a recipe.

use crate::error::SourceError;

/// The most triangles that a recipe may make, about a gigabyte.
const MOST_TRIANGLES: u64 = 1 << 25;

/// Checks of the sizes asked for, before anything is allocated.
pub(super) struct Limits {
    spec: String,
}

impl Limits {
    pub(super) fn new(spec: String) -> Self {
        Self { spec }
    }

    pub(super) fn at_least_one(&self, what: &str, size: u32) -> Result<(), SourceError> {
        if size == 0 {
            return Err(SourceError::recipe(&self.spec, format!("there must be at least one of the {what}")));
        }
        Ok(())
    }

    /// `units` parts of the scene with about `each` triangles must stay below the bound.
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
