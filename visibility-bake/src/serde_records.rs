//! Serialisation by `serde`, with the checks of the settings' own methods: `visibility-core` has the macros.

use crate::{SandwichSettings, ViewcellBudget};
use visibility_core::glam::DVec3;

visibility_core::__serde_record!(settings SandwichSettings as "SandwichSettings" |s| {
    gap: f64 = s.gap,
    clearance: f64 = s.clearance,
    rays: u32 = s.rays,
} => SandwichSettings::default().with_gap(gap).with_clearance(clearance).with_rays(rays));
visibility_core::__serde_record!(ViewcellBudget as "ViewcellBudget" |b| {
    cost: u64 = b.cost,
    least: DVec3 = b.least,
    agreement: f64 = b.agreement,
} => ViewcellBudget::new(cost, least).with_agreement(agreement));
