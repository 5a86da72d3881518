//! Time that each method of a bake has taken.

use std::iter::Sum;
use std::time::Duration;
use visibility_core::binary_format::{FormatError, Reader, Writer};

/// Time spent by each method on one viewcell or on several.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[non_exhaustive]
pub struct MethodTimes {
    /// Time of the sweeps of extended projections.
    pub sweep: Duration,
    /// Time of the rays, and of preparing the triangles for them.
    pub rays: Duration,
    /// Time of the proofs, including failed searches for proofs.
    pub proofs: Duration,
}

impl MethodTimes {
    /// Returns the time of all methods together.
    pub fn total(&self) -> Duration {
        self.sweep.saturating_add(self.rays).saturating_add(self.proofs)
    }

    pub(crate) fn save(&self, to: &mut Writer) {
        for time in [self.sweep, self.rays, self.proofs] {
            to.u64(u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
        }
    }

    pub(crate) fn load(from: &mut Reader<'_>) -> Result<Self, FormatError> {
        let mut time = || from.u64().map(Duration::from_nanos);
        Ok(Self { sweep: time()?, rays: time()?, proofs: time()? })
    }
}

impl<'a> Sum<&'a MethodTimes> for MethodTimes {
    fn sum<I: Iterator<Item = &'a Self>>(all: I) -> Self {
        all.fold(Self::default(), |sum, times| Self {
            sweep: sum.sweep.saturating_add(times.sweep),
            rays: sum.rays.saturating_add(times.rays),
            proofs: sum.proofs.saturating_add(times.proofs),
        })
    }
}
