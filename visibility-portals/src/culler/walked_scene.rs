//! The test of objects against the windows (views through chains of portals) of a walk.

use super::portal_walk::PortalWalk;
use super::scene_cells::SceneCells;
use super::view_planes::PortalView;
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, CullStats, Scene, VisibleSet};

/// A finished walk, with the cells, the scene and the view that it was made for.
pub(super) struct WalkedScene<'a> {
    pub(super) cells: &'a SceneCells,
    pub(super) scene: &'a Scene,
    pub(super) walk: &'a PortalWalk,
    pub(super) eye_view: &'a PortalView,
}

impl WalkedScene<'_> {
    /// Removes from `visible` the objects whose bounds lie outside all windows of all cells that they belong
    /// to. Undecided objects stay, and so do objects in no cell, and objects that changed since the cells
    /// were synced: those whose entry in `unknown`, by object index, equals `frame`. Adds the number of
    /// windows tested to `tests`.
    pub(super) fn retain(
        &self,
        unknown: &[u64],
        frame: u64,
        visible: &mut VisibleSet,
        tests: &mut u64,
    ) -> CullStats {
        let shift = Shift::new(self.scene.origin(), self.eye_view);
        visible.retain(self.scene, |id, bounds| {
            if unknown.get(id.index()) == Some(&frame) {
                return true;
            }
            let of = self.cells.cells_of(id);
            let (min, max, error) = shift.relative(bounds);
            of.is_empty() || of.iter().any(|&cell| self.walk.shows(cell, min, max, error, tests))
        })
    }
}

/// The way from the coordinates of a scene to those relative to the anchor of a view.
struct Shift {
    origin: DVec3,
    /// Bound on the distance between `origin` and its exact value relative to the exact eye, in world units.
    error: f64,
}

impl Shift {
    /// Makes the shift from a scene with the given origin, in world space.
    fn new(scene_origin: DVec3, eye_view: &PortalView) -> Self {
        // The difference of the origins rounds by half an EPSILON of itself on each axis.
        let size = scene_origin.abs().max_element() + eye_view.anchor.abs().max_element();
        Self { origin: scene_origin - eye_view.anchor, error: eye_view.error + 4.0 * f64::EPSILON * size }
    }

    /// Returns the least and the greatest corner of a box, anchor-relative, and a bound in world units on
    /// the distance of each from the exact corner relative to the exact eye.
    fn relative(&self, bounds: &Aabb) -> (DVec3, DVec3, f64) {
        let (min, max) = (bounds.min.as_dvec3() + self.origin, bounds.max.as_dvec3() + self.origin);
        // Each coordinate rounds by half an EPSILON of itself, which is at most 3^1/2 / 2 EPSILON in all.
        (min, max, self.error + f64::EPSILON * min.abs().max(max.abs()).max_element())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::{Pose, View};

    /// All coordinates are multiples of 1 up to 2^60, where rounding loses up to 2^7. Compared in integers.
    #[test]
    fn corners_of_boxes_are_within_their_error_of_the_exact_ones() {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
        let view = PortalView::new(&view).unwrap();
        let far = 1i64 << 60;
        for (origin, anchor, corner) in [
            (128, 0, far),
            (far, -128, -far),
            (-128, 0, -far),
            (far, -128, 1),
            (0, far + (1 << 8), 128),
            (far, -far, 1 << 20),
            (far - (1 << 10), far, 128),
        ] {
            for eye in [0.0, 1e3] {
                let view = PortalView { anchor: DVec3::splat(anchor as f64), error: eye, ..view.clone() };
                let shift = Shift::new(DVec3::splat(origin as f64), &view);
                // A point, and a box that reaches from there to the scene's origin.
                for other in [corner, 0] {
                    let [low, high] = [corner.min(other), corner.max(other)].map(|x| [x as f32; 3]);
                    let (min, max, error) = shift.relative(&Aabb::from_arrays(low, high));
                    let found = if corner < other { min } else { max };
                    let exact = [origin, -anchor, corner].map(i128::from).iter().sum::<i128>();
                    let off = (exact - found.x as i128).unsigned_abs() as f64 * 3f64.sqrt();
                    assert!(error >= off + eye, "off by {off}, {error} known: {origin}, {anchor}, {corner}");
                }
            }
        }
    }
}
