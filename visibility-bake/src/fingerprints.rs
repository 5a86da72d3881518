//! Hashes of the input of a bake.

use crate::settings::SandwichSettings;
use crate::tiled_scene::TiledScene;
use visibility_core::binary_format::Fingerprint;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};

/// Version of the baking methods, a part of the hash of each viewcell's input. It is increased with each
/// change of the methods, so that results of earlier methods are not taken from a cache.
pub(crate) const METHODS: u32 = 13;

/// Returns a hash of the input of a bake: the level, all viewcells and the settings. Time is linear in the
/// numbers of triangles and viewcells.
pub(crate) fn level_fingerprint(
    level: &TiledScene<'_>,
    viewcells: &Viewcells,
    settings: &SandwichSettings,
) -> u64 {
    let hash = Fingerprint::new().with(METHODS).with_u64(level.version());
    viewcells.cells().iter().fold(with_settings(hash, settings), with_viewcell).value()
}

/// Adds the settings to a hash.
pub(crate) fn with_settings(hash: Fingerprint, settings: &SandwichSettings) -> Fingerprint {
    hash.with_u64(settings.gap.to_bits()).with_u64(settings.clearance.to_bits()).with(settings.rays)
}

/// Adds a viewcell to a hash.
pub(crate) fn with_viewcell(hash: Fingerprint, cell: &Viewcell) -> Fingerprint {
    let vector =
        |hash: Fingerprint, v: DVec3| v.to_array().iter().fold(hash, |hash, x| hash.with_u64(x.to_bits()));
    let hash = vector(vector(hash, cell.min), cell.max).with(cell.planes.len() as u32);
    cell.planes.iter().fold(hash, |hash, plane| vector(hash, plane.normal).with_u64(plane.offset.to_bits()))
}
