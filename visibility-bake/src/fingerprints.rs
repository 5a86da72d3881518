//! Hashes of the input of a bake.

use crate::settings::SandwichSettings;
use crate::tiled_scene::TiledScene;
use visibility_core::binary_format::Fingerprint;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};

/// Version of the baking methods, a part of the hash of each viewcell's input. It is increased with each
/// change of the methods, so that results of earlier methods are not taken from a cache.
pub(crate) const METHODS: u32 = 15;

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

/// The level and the viewcells that the result of a bake is of, as hashes. A [`BakedSet`](crate::BakedSet) is
/// made of results whose source is the level as it is now; results of another are refused.
///
/// ```
/// use visibility_bake::{BakedSet, BakedSetError, SandwichBaker, SandwichSettings};
/// use visibility_core::pvs::{Viewcell, Viewcells};
/// use visibility_core::{Aabb, Scene, bake::Bake, glam::DVec3};
/// let mut scene = Scene::new();
/// let bounds = Aabb::from_arrays([5.0; 3], [6.0; 3]);
/// let id = scene.insert(bounds);
/// let cells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
/// let found = Bake::new(SandwichBaker::new(&scene, &cells, SandwichSettings::default())).run();
/// assert!(BakedSet::new(&scene, cells.clone(), found.source, &found.cells).is_ok());
/// scene.set_bounds(id, Aabb::from_arrays([7.0; 3], [8.0; 3]))?;
/// let refused = BakedSet::new(&scene, cells, found.source, &found.cells);
/// assert_eq!(refused, Err(BakedSetError::OtherScene));
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct BakeSource {
    /// [Version](crate::level_version()) of the level.
    pub(crate) level: u64,
    /// Hash of the viewcells, in their order, and of the box that they divide and by how much they are
    /// misplaced in it.
    pub(crate) viewcells: u64,
}

impl BakeSource {
    /// Returns the source of results for the level with version `level` and for all of `viewcells`.
    pub(crate) fn new(level: u64, viewcells: &Viewcells) -> Self {
        let hash = viewcells.cells().iter().fold(Fingerprint::new(), with_viewcell);
        let hash = match viewcells.divided_box() {
            Some([min, max]) => hash.with(1).with_dvec3(min).with_dvec3(max),
            None => hash.with(0),
        };
        Self { level, viewcells: hash.with_u64(viewcells.misplacement().to_bits()).value() }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A cache must not answer for other settings: a clearance hides more than none.
    #[test]
    fn hashes_of_other_settings_differ() {
        let hash = |settings: SandwichSettings| with_settings(Fingerprint::new(), &settings).value();
        let settings = SandwichSettings::default();
        for other in [settings.with_clearance(0.0), settings.with_gap(0.0), settings.with_rays(1)] {
            assert_ne!(hash(other), hash(settings), "{other:?}");
        }
    }
}
