//! Occluders that are parts of one wall, each a mesh of its own. A z-buffer fills only pixels that one
//! occluder covers altogether, so pixels crossed by the common edge (the seam) of two occluders stay empty.

use crate::geometry::Containment;
use crate::scene::{FAN_OUT, Scene, lanes};
use crate::walk::{BoxHierarchy, Child, SceneHierarchy, unculled_blocks};
use crate::{Aabb, ObjectId};

/// Greatest number of occluders that are inspected. If a scene has more, only every second, third or n-th one
/// is inspected.
const MAX_INSPECTED: usize = 256;

/// Counts the occluders of `scene` that another occluder continues, as with the panels of a wall or the tiles
/// of a floor: the two boxes have the same thinnest axis and the same extent along it, and meet end to end
/// along another axis, up to a thousandth of their size. Inspects all occluders if there are at most 256,
/// otherwise every second, third or n-th one, so the result is at most 256. Takes some microseconds for each
/// occluder inspected.
///
/// ```
/// use visibility_core::{glam::Affine3A, occlusion::occluders_with_seams, Aabb, Object, OccluderMesh, Scene};
/// let mut scene = Scene::new();
/// for y in [0.0, 4.0, 9.0] {
///     let bounds = Aabb::from_arrays([0.0, y, 0.0], [0.2, y + 4.0, 3.0]);
///     let panel = scene.insert(Object { occluder: true, ..Object::new(bounds) });
///     let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds)?);
///     scene.set_mesh(panel, mesh, Affine3A::IDENTITY)?;
/// }
/// assert_eq!(occluders_with_seams(&scene), 2, "the third panel stands a metre from the second");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn occluders_with_seams(scene: &Scene) -> usize {
    let is_occluder = |id: ObjectId| scene.occluder(id).is_some();
    let step = scene.occluder_count().div_ceil(MAX_INSPECTED).max(1);
    let inspected = scene.ids().filter(|&id| is_occluder(id)).step_by(step).take(MAX_INSPECTED);
    let has_seam = inspected.filter(|&id| {
        let Ok(bounds) = scene.bounds(id) else { return false };
        let continues = |other: ObjectId| {
            other != id
                && is_occluder(other)
                && scene.bounds(other).is_ok_and(|beside| is_continued(&bounds, &beside))
        };
        let in_block = |ids: &[ObjectId; FAN_OUT], mask| lanes(mask).any(|lane| continues(ids[lane]));
        any_touching(scene, None, &grown(&bounds), &continues)
            || unculled_blocks(scene)
                .any(|block| block.leaf().is_some_and(|(_, ids)| in_block(ids, block.occupied())))
    });
    has_seam.count()
}

/// Returns whether `test` is true for at least one object below a node (`None`: in the whole hierarchy of the
/// scene) whose bounds touch `area`.
fn any_touching(scene: &Scene, node: Option<usize>, area: &Aabb, test: &impl Fn(ObjectId) -> bool) -> bool {
    let mut any = false;
    SceneHierarchy.for_each_child(scene, node, &mut |child, bounds| {
        any = any
            || area.classify_aabb(&bounds) != Containment::Outside
                && match child {
                    Child::Node(below) => any_touching(scene, Some(below), area, test),
                    Child::Object(id) => test(id),
                };
    });
    any
}

/// Returns the tolerance for sides that meet: a thousandth of the longest side of the box.
fn tolerance(bounds: &Aabb) -> f32 {
    (bounds.max - bounds.min).max_element() * 1e-3
}

fn grown(bounds: &Aabb) -> Aabb {
    let by = tolerance(bounds);
    Aabb::new(bounds.min - by, bounds.max + by)
}

/// Tests whether the box of a flat object continues in the box `beside`: both have the same thinnest axis and
/// the same extent along it, meet end to end along a second axis, and overlap along the third, up to the
/// [`tolerance`].
fn is_continued(bounds: &Aabb, beside: &Aabb) -> bool {
    let thinnest = |b: &Aabb| (b.max - b.min).min_position();
    let (axis, tolerance) = (thinnest(bounds), tolerance(bounds));
    let meets = |a: f32, b: f32| (a - b).abs() <= tolerance;
    let lies_in_plane = axis == thinnest(beside)
        && meets(bounds.min[axis], beside.min[axis])
        && meets(bounds.max[axis], beside.max[axis]);
    let ends_meet = |k: usize| meets(bounds.max[k], beside.min[k]) || meets(bounds.min[k], beside.max[k]);
    let overlaps = |k: usize| bounds.max[k].min(beside.max[k]) - bounds.min[k].max(beside.min[k]) > tolerance;
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    lies_in_plane && (ends_meet(u) && overlaps(v) || ends_meet(v) && overlaps(u))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A panel of 4 m by 3 m, 0.2 m thick along x, beside others that lie from `min` to `max`.
    fn continues(min: [f32; 3], max: [f32; 3]) -> bool {
        let panel = Aabb::from_arrays([0.0; 3], [0.2, 4.0, 3.0]);
        is_continued(&panel, &Aabb::from_arrays(min, max))
    }

    #[test]
    fn panels_continue_where_they_meet_end_to_end_in_one_plane() {
        assert!(continues([0.0, 4.0, 0.0], [0.2, 8.0, 3.0]), "beside it, along y");
        assert!(continues([0.0, -4.0, 0.0], [0.2, 0.0, 3.0]), "before it, along y");
        assert!(continues([0.0, 0.0, 3.0], [0.2, 4.0, 6.0]), "above it");
        assert!(continues([0.0, 0.0, -3.0], [0.2, 4.0, 0.0]), "below it");
        assert!(
            continues([0.002, 4.003, 2.9], [0.203, 8.0, 5.0]),
            "off by less than 4 mm, overlapping by 0.1 m"
        );
        assert!(!continues([0.0, 4.005, 0.0], [0.2, 8.0, 3.0]), "5 mm apart");
        assert!(!continues([0.0, 3.99, 0.0], [0.2, 8.0, 3.0]), "overlapping by 1 cm");
        assert!(!continues([0.01, 4.0, 0.0], [0.2, 8.0, 3.0]), "thinner in front");
        assert!(!continues([0.0, 4.0, 0.0], [0.21, 8.0, 3.0]), "thicker behind");
        assert!(!continues([0.0, 4.0, 2.999], [0.2, 8.0, 6.0]), "overlapping by 1 mm");
        assert!(!continues([0.0, 4.0, 3.0], [0.2, 8.0, 6.0]), "corner to corner");
        assert!(!continues([0.0, 4.0, 0.0], [0.2, 4.1, 3.0]), "thinnest along another axis");
        assert!(!continues([0.0, 0.0, 0.0], [0.2, 4.0, 3.0]), "the panel itself");
    }

    #[test]
    fn seams_are_found_within_a_thousandth() {
        let bounds = Aabb::from_arrays([0.0; 3], [0.2, 4.0, 3.0]);
        let grown = grown(&bounds);
        assert_eq!((grown.min.y, grown.max.y), (-0.004, 4.004), "grown by a thousandth of the longest side");
    }
}
