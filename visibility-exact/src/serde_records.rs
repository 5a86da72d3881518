//! Serialisation by `serde`, with the checks of the settings' own methods: `visibility-core` has the macros.

use crate::{Effort, ExactSettings};

visibility_core::__serde_variants!(Effort as "Effort" { Rays(u32), Share(f64), Exact(f64) });
visibility_core::__serde_record!(ExactSettings as "ExactSettings" |s| {
    rays: u32 = s.rays,
    aimed_rays: u32 = s.aimed_rays,
    proves: bool = s.proves,
    share: f64 = s.share,
    clearance: f64 = s.clearance,
    keep_proofs: bool = s.keep_proofs,
} => ExactSettings { rays, aimed_rays, proves, share, clearance: 0.0, keep_proofs }.with_clearance(clearance),
    if s.share >= 0.0 && (s.proves || s.share == 0.0), else "no effort has this visible share");
