//! Serialisation by `serde`, with the checks of the settings' own methods: `visibility-core` has the macros.

use crate::LevelSettings;

visibility_core::__serde_record!(settings LevelSettings as "LevelSettings" |s| {
    flatness: f64 = s.flatness,
    bulge: f64 = s.bulge,
    kept_area: f64 = s.kept_area,
    max_cluster_edges: usize = s.max_cluster_edges,
} => LevelSettings::default()
    .with_flatness(flatness)
    .with_bulge(bulge)
    .with_kept_area(kept_area)
    .with_max_cluster_edges(max_cluster_edges),
    if !s.kept_area.is_nan(), else "a share is NaN");
