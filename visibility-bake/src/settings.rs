//! Settings of a bake.

/// Settings of a [`SandwichBaker`](crate::SandwichBaker).
///
/// ```
/// use visibility_bake::SandwichSettings;
/// assert_ne!(SandwichSettings::default().with_gap(0.0), SandwichSettings::default());
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
#[must_use]
pub struct SandwichSettings {
    pub(crate) gap: f64,
    pub(crate) clearance: f64,
    pub(crate) rays: u32,
}

impl Default for SandwichSettings {
    /// Returns settings with a gap of 5 %, a clearance of 0.1 mm, and 200 rays for each object.
    fn default() -> Self {
        Self { gap: 0.05, clearance: 1e-4, rays: 200 }
    }
}

impl SandwichSettings {
    /// Sets when the proofs for a viewcell end: when the [cost](visibility_core::Object::cost) of the open
    /// objects is at most `gap`, a fraction from 0 to 1, of the cost of all seen and open objects. With 0, a
    /// proof is tried for every object that is not seen; with 1, for none. NaN and negative numbers count as
    /// 0.
    pub fn with_gap(self, gap: f64) -> Self {
        Self { gap, ..self }
    }

    /// Sets the clearance in metres. An object counts as hidden if each line of sight to it comes closer to
    /// some occluder than six times this distance. A clearance of 0 gives a conservative bake, see
    /// [`Effort::Exact`](visibility_exact::Effort::Exact).
    pub fn with_clearance(self, clearance: f64) -> Self {
        Self { clearance, ..self }
    }

    /// Returns the clearance in metres, see [`with_clearance`](Self::with_clearance).
    pub fn clearance(&self) -> f64 {
        self.clearance
    }

    /// Sets the number of rays aimed at each object before any proof is tried. From each viewcell, 64 times
    /// this number of rays is also cast in all directions.
    pub fn with_rays(self, rays: u32) -> Self {
        Self { rays, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clearance_is_as_it_was_set() {
        for clearance in [0.0, 0.25, 1e-4] {
            let settings = SandwichSettings::default().with_clearance(clearance);
            assert_eq!(settings.clearance(), clearance, "the clearance of {settings:?}");
        }
    }
}
