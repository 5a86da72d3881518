//! Serialisation by `serde`, with the checks of the settings' own methods: `visibility-core` has the macros.

use crate::from_geometry::WallSettings;
use crate::{BakerSettings, ChainTest, Narrowing};

visibility_core::__serde_variants!(ChainTest as "ChainTest" { Separators, Pluecker });
visibility_core::__serde_variants!(Narrowing as "Narrowing" { Polygon, Rectangle });
visibility_core::__serde_record!(settings BakerSettings as "BakerSettings" |s| {
    clearance: Option<f64> = s.clearance,
    steps_per_cell: Option<u64> = (s.steps_per_cell < u64::MAX).then_some(s.steps_per_cell),
    depth: u32 = s.depth,
    chain_test: ChainTest = s.chain_test,
} => BakerSettings::default()
    .with_clearance(clearance)
    .with_steps_per_cell(steps_per_cell.unwrap_or(u64::MAX))
    .with_depth(depth)
    .with_chain_test(chain_test));
visibility_core::__serde_record!(settings WallSettings as "WallSettings" |s| {
    tolerance: f64 = s.tolerance,
    min_share: f64 = s.min_share,
    min_area: Option<f64> = s.min_area,
    margin: f64 = s.margin,
    max_cells: usize = s.max_cells,
} => WallSettings::default()
    .with_tolerance(tolerance)
    .with_min_share(min_share)
    .with_min_area(min_area)
    .with_margin(margin)
    .with_max_cells(max_cells));
