//! Extent of a scene, without the few objects that reach much farther than the others, such as a sky, an
//! endless floor or a misplaced object. Error margins grow with the magnitude of coordinates, and maps and
//! octrees divide a range in proportion to its size, so one such object would cost precision for all others.

use alloc::vec::Vec;
use visibility_core::glam::Vec3;
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Scene};

/// Greatest number of objects from which the usual reach is estimated. The reach of an object is the greatest
/// magnitude of a coordinate of its bounds, in metres from the scene's origin.
const SAMPLE: usize = 1024;

/// Greatest reach of objects that can be found hidden, as a multiple of the reach within which nine in ten
/// objects stay: 2^14. Objects with a greater reach count as visible.
const FARTHEST: f64 = 16_384.0;

/// Returns the quantile at `part`, from 0 (least number) to 1 (greatest), without interpolation. Reorders the
/// numbers. `None` if there are no numbers.
pub(crate) fn quantile(numbers: &mut [f64], part: f64) -> Option<f64> {
    let last = numbers.len().checked_sub(1)?;
    Some(*numbers.select_nth_unstable_by((last as f64 * part) as usize, f64::total_cmp).1)
}

/// Returns a box around a scene's objects, relative to the scene's origin. It is cut off at [`FARTHEST`]
/// times the reach of nine in ten objects, or of the viewcell if that is greater. Objects that reach out of
/// the box count as visible. Occluders hide nothing if their coordinates are several times as large as the
/// greatest coordinate of the box. `None` if the scene has no objects that can be culled.
pub(crate) fn usable_bounds(scene: &Scene, cell: &Viewcell) -> Option<Aabb> {
    let bounds = scene.culled_bounds()?;
    let step = scene.len() / SAMPLE + 1;
    let bounds_of = scene.ids().step_by(step).filter_map(|id| scene.bounds(id).ok()).filter(Aabb::is_proper);
    let reach = |min: Vec3, max: Vec3| f64::from(min.abs().max(max.abs()).max_element());
    let mut reaches: Vec<f64> = bounds_of.map(|bounds| reach(bounds.min, bounds.max)).collect();
    let own = (cell.min - scene.origin()).abs().max((cell.max - scene.origin()).abs()).max_element();
    // None of the sampled objects may have proper bounds.
    let usual = quantile(&mut reaches, 0.9).unwrap_or_else(|| reach(bounds.min, bounds.max));
    let most = FARTHEST * usual.max(own);
    let most = Vec3::splat(most.min(f64::from(f32::MAX)) as f32);
    Some(Aabb::new(bounds.min.max(-most), bounds.max.min(most)))
}

/// Tests whether `bounds` contains the box `inner`, which may touch its sides.
pub(crate) fn contains(bounds: &Aabb, inner: &Aabb) -> bool {
    bounds.min.cmple(inner.min).all() && inner.max.cmple(bounds.max).all()
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Object;
    use visibility_core::glam::DVec3;

    /// Bounds are cut off at 2^14 times the reach of most objects or of the viewcell, on either side.
    #[test]
    fn bounds_end_far_beyond_most_objects() {
        let mut scene = Scene::new();
        scene.set_origin(DVec3::splat(1e3)).unwrap();
        for i in 0..30 {
            let (low, high) = if i % 2 == 0 { (-2.0, 1.0) } else { (-1.0, 2.0) };
            scene.insert(Object::new(Aabb::new(Vec3::splat(low), Vec3::splat(high))));
        }
        let cell =
            |low: f64, high: f64| Viewcell::from_box(DVec3::splat(1e3 + low), DVec3::splat(1e3 + high));
        let bounds = |scene: &Scene, cell: &Viewcell| {
            usable_bounds(scene, cell).map(|bounds| [bounds.min.x, bounds.max.y])
        };
        assert_eq!(bounds(&scene, &cell(0.0, 1.0)), Some([-2.0, 2.0]), "bounds of the objects");
        let sky = scene.insert(Object::new(Aabb::new(Vec3::splat(-1e9), Vec3::splat(2e9))));
        assert_eq!(bounds(&scene, &cell(0.0, 1.0)), Some([-32_768.0, 32_768.0]), "most objects reach 2 m");
        assert_eq!(bounds(&scene, &cell(-4.0, 1.0)), Some([-65_536.0, 65_536.0]), "the viewcell reaches 4 m");
        assert_eq!(bounds(&scene, &cell(-1.0, 4.0)), Some([-65_536.0, 65_536.0]), "the viewcell reaches 4 m");
        assert_eq!(bounds(&scene, &cell(-1.0, 1e36)), Some([-1e9, 2e9]), "a limit beyond all numbers of f32");
        scene.set_bounds(sky, Aabb::new(Vec3::ZERO, Vec3::splat(1e9))).unwrap();
        assert_eq!(bounds(&scene, &cell(0.0, 1.0)), Some([-2.0, 32_768.0]), "a sky on one side");
    }

    #[test]
    fn boxes_contain_what_touches_their_sides() {
        let outer = Aabb::new(Vec3::ZERO, Vec3::ONE);
        assert!(contains(&outer, &outer), "the box itself");
        for axis in Vec3::AXES {
            assert!(!contains(&outer, &Aabb::new(axis * -0.1, Vec3::ONE)), "beyond the least corner");
            assert!(!contains(&outer, &Aabb::new(Vec3::ZERO, Vec3::ONE + axis * 0.1)), "beyond the greatest");
        }
    }

    /// A scene that each third of 2,048 objects has left: a sample of each third index would meet no object.
    #[test]
    fn a_scene_of_which_objects_have_left_has_usable_bounds() {
        let mut scene = Scene::new();
        let ids: Vec<_> =
            (0..2048u16).map(|i| scene.insert(Aabb::new(Vec3::ZERO, Vec3::splat(f32::from(i))))).collect();
        for id in ids.iter().step_by(3) {
            scene.remove(*id).unwrap();
        }
        let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
        assert_eq!(usable_bounds(&scene, &cell), scene.culled_bounds(), "all objects are near each other");
    }
}
