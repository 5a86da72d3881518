//! Settings of the exact culler: how much work it does, and what its answers guarantee.

/// Kind of answer that an [`ExactCuller`](crate::ExactCuller) looks for.
///
/// ```
/// use visibility_exact::{Effort, ExactSettings};
/// let settings = ExactSettings::new(Effort::Exact(1e-4));
/// assert_eq!(settings.clearance(), 1e-4);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Effort {
    /// Rays alone, without proofs: this many rays aimed at each object, and 64 times as many in all
    /// directions. Aggressive: objects that no ray finds are removed. An aimed ray goes from a point of the
    /// viewcell to a random point of a random triangle of the object; each triangle is equally likely,
    /// whatever its area. If `n` such rays were all blocked, less than `3 / n` of all such rays are
    /// unblocked, with a confidence of 95 %. Only for triangles of equal areas is this also a bound on the
    /// visible share of the object's area.
    Rays(u32),
    /// Rays and proofs for boxes, then for each remaining object a certified bound on its visible share. The
    /// visible share is the share of the segments from faces of the viewcell to faces of the object's box,
    /// measured by area, that is not proven blocked. An object is removed if it is hidden, or if the bound is
    /// at most the given share, even if a ray has seen it. Approximate. The clearance is 1e-4 metres unless
    /// the [`ExactSettings`] change it. A share that is negative or NaN counts as 0.
    Share(f64),
    /// Rays, then proofs. An object that is neither seen nor proven hidden stays. The number is the clearance
    /// in metres: an object is removed if every segment to it comes closer to some occluder than six times
    /// the clearance, or begins less than the clearance over the plane that it ends in. Exact up to these
    /// distances. With a clearance of 0, conservative: an object is removed if
    /// every segment to the inside of any of its triangles touches an occluder on the way.
    Exact(f64),
}

/// Settings of an [`ExactCuller`](crate::ExactCuller), made from an [`Effort`].
#[derive(Clone, Copy, PartialEq, Debug)]
#[must_use]
pub struct ExactSettings {
    pub(crate) rays: u32,
    pub(crate) aimed_rays: u32,
    /// Whether an object is removed only with a proof. If false, all objects that no ray has found are
    /// removed.
    pub(crate) proves: bool,
    /// Visible share at or below which [`Effort::Share`] removes an object, from 0 to 1. 0 for other efforts.
    pub(crate) share: f64,
    pub(crate) clearance: f64,
    pub(crate) keep_proofs: bool,
}

impl ExactSettings {
    /// Returns the settings for an effort. A clearance that is negative, NaN or infinite counts as 0.
    pub fn new(effort: Effort) -> Self {
        let (rays, aimed_rays, proves, clearance, share) = match effort {
            Effort::Rays(n) => (n.saturating_mul(64), n, false, 0.0, 0.0),
            Effort::Share(share) => (100_000, 200, true, 1e-4, share.max(0.0)),
            Effort::Exact(c) => (100_000, 200, true, c, 0.0),
        };
        let settings = Self { rays, aimed_rays, proves, share, clearance: 0.0, keep_proofs: false };
        settings.with_clearance(clearance)
    }

    /// Sets the number of rays in all directions.
    pub fn with_rays(self, rays: u32) -> Self {
        Self { rays, ..self }
    }

    /// Sets the greatest number of rays aimed at each object that no ray has found.
    pub fn with_aimed_rays(self, aimed_rays: u32) -> Self {
        Self { aimed_rays, ..self }
    }

    /// Sets the clearance in metres, see [`Effort::Exact`]. A clearance counts as 0 if it is negative, NaN,
    /// infinite, or within the error of positions: less than about 1e-12 of the greatest coordinate.
    pub fn with_clearance(self, clearance: f64) -> Self {
        Self { clearance: if clearance.is_finite() { clearance.max(0.0) } else { 0.0 }, ..self }
    }

    /// Returns the clearance in metres.
    pub fn clearance(&self) -> f64 {
        self.clearance
    }

    /// Makes the culler keep its proofs, in [`CellVerdicts::proofs`](crate::CellVerdicts::proofs).
    pub fn with_kept_proofs(self) -> Self {
        Self { keep_proofs: true, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_are_out_of_range_count_as_0() {
        for (given, kept) in [(2.5, 2.5), (0.0, 0.0), (-1.0, 0.0), (f64::INFINITY, 0.0), (f64::NAN, 0.0)] {
            let exact = ExactSettings::new(Effort::Exact(given));
            let changed = ExactSettings::new(Effort::Share(0.5)).with_clearance(given);
            assert_eq!([exact, changed].map(|settings| settings.clearance()), [kept; 2], "clearance {given}");
        }
        for (given, kept) in [(0.25, 0.25), (0.0, 0.0), (-1.0, 0.0), (f64::NAN, 0.0)] {
            assert_eq!(ExactSettings::new(Effort::Share(given)).share, kept, "share {given}");
        }
    }
}
