//! Functions shared by cullers of viewcells: the box of a viewcell, and the removal of objects inside umbrae.

use crate::umbra::Umbra;
use alloc::vec::Vec;
use visibility_core::geometry::Containment;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::walk::{Child, SceneHierarchy, Walk};
use visibility_core::{Aabb, CullStats, Scene, VisibleSet};

/// Returns the least and greatest corner of a viewcell's box relative to a scene's origin, rounded outwards.
/// `None` if the box is inverted or not finite.
pub(crate) fn cell_box(cell: &Viewcell, origin: DVec3) -> Option<(DVec3, DVec3)> {
    if !cell.min.cmple(cell.max).all() {
        return None;
    }
    // A difference of zero is exact, so it is not rounded outwards.
    let outwards = |x: f64, step: fn(f64) -> f64| if x == 0.0 { x } else { step(x) };
    let (min, max) = (cell.min - origin, cell.max - origin);
    let (min, max) = if origin == DVec3::ZERO {
        (min, max)
    } else {
        let low = min.to_array().map(|x| outwards(x, f64::next_down));
        let high = max.to_array().map(|x| outwards(x, f64::next_up));
        (DVec3::from_array(low), DVec3::from_array(high))
    };
    (min.is_finite() && max.is_finite()).then_some((min, max))
}

/// Test of a box in scene coordinates: true if the box is certainly hidden from every point of the viewcell.
pub(crate) type IsHidden<'a> = &'a dyn Fn(&Aabb) -> bool;

/// Removes the candidates whose bounds are inside one of `umbrae`, or for whose bounds the test `or` returns
/// true. Nodes of the hierarchy are tested too: if a node is hidden, all candidates below it are removed.
pub(crate) fn remove_hidden(
    scene: &Scene,
    visible: &mut VisibleSet,
    umbrae: &[Umbra],
    or: Option<IsHidden<'_>>,
) -> CullStats {
    let mut walk = Walk::new(scene, &SceneHierarchy, visible);
    let all: Vec<u32> = (0..umbrae.len() as u32).collect();
    remove_below(&mut walk, None, umbrae, &all, or);
    walk.finish()
}

/// Removes hidden candidates below a node (`None`: the root), as [`remove_hidden`] does. `live` are the
/// indices of the umbrae that may reach into the node. Returns whether any candidate below it is left.
fn remove_below(
    walk: &mut Walk<SceneHierarchy>,
    node: Option<usize>,
    umbrae: &[Umbra],
    live: &[u32],
    or: Option<IsHidden<'_>>,
) -> bool {
    walk.visit(node, |walk, block, candidates| {
        let (mut kept, mut below) = (candidates, Vec::new());
        for lane in (0..64).filter(|lane| candidates >> lane & 1 != 0) {
            let bounds = block.boxes().get(lane);
            below.clear();
            let mut is_hidden = false;
            for &umbra in live {
                walk.stats.tests += 1;
                match umbrae[umbra as usize].classify(&bounds) {
                    Containment::Inside => {
                        is_hidden = true;
                        break;
                    }
                    Containment::Crossing => below.push(umbra),
                    Containment::Outside => {}
                }
            }
            is_hidden |= or.is_some_and(|or| or(&bounds));
            let stays = !is_hidden
                && match block.child(lane) {
                    Child::Object(_) => true,
                    Child::Node(node) if below.is_empty() && or.is_none() => walk.accept(node),
                    Child::Node(node) => remove_below(walk, Some(node), umbrae, &below, or),
                };
            kept &= !(u64::from(!stays) << lane);
        }
        kept
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blocker::Blocker;
    use visibility_testing::{Random, sign_of_sum};

    /// The box of a viewcell relative to an origin holds the exact one, and is that one without an origin. It
    /// is known unless it is inverted or not finite.
    #[test]
    fn boxes_of_viewcells_are_rounded_outwards() {
        let mut random = Random(3);
        for round in 0..5_000 {
            let (a, b) = (random.fine_vector(9.0), random.fine_vector(9.0));
            let cell = Viewcell::from_box(a.min(b), a.max(b));
            assert_eq!(cell_box(&cell, DVec3::ZERO), Some((cell.min, cell.max)), "round {round}");
            let origin = random.fine_vector([1e-9, 1.0, 1e6][round % 3]);
            let (min, max) = cell_box(&cell, origin).unwrap();
            for axis in 0..3 {
                let sign = |at: f64, end: f64| sign_of_sum([(at, 1.0), (origin[axis], -1.0), (end, -1.0)]);
                let is_in = sign(cell.min[axis], min[axis]) >= 0 && sign(cell.max[axis], max[axis]) <= 0;
                assert!(is_in, "round {round}, axis {axis}: {min} to {max} of {cell:?} and {origin}");
            }
        }
        let of = |min: f64, max: f64, origin: f64| {
            let [min, max, origin] = [min, max, origin].map(|x| DVec3::new(1.0, x, 1.0));
            cell_box(&Viewcell::from_box(min, max), origin).is_some()
        };
        assert!(of(1.0, 1.0, 0.0) && of(1.0, 1.0, 1.0), "a viewcell of one point");
        assert!(!of(1.0, 0.5, 0.0) && !of(f64::NAN, 0.5, 0.0), "inverted, and without a number");
        assert!(!of(-1e308, 1e308, 1e308) && !of(-1e308, 1e308, -1e308), "beyond all numbers on one side");
        assert!(!of(f64::NEG_INFINITY, 1.0, 0.0) && !of(1.0, f64::INFINITY, 0.0), "infinite on one side");
    }

    /// Objects in an umbra are removed, and objects that the other test names, below whatever nodes of the
    /// hierarchy.
    #[test]
    fn objects_in_umbrae_are_removed_one_by_one() {
        let (mut random, mut scene) = (Random(4), Scene::new());
        for _ in 0..3_000 {
            let at = random.vec3(-20.0, 20.0);
            scene.insert(Aabb::new(at, at + random.vec3(0.0, 1.0)));
        }
        let umbra = |x: f64, y: f64| {
            let wall = Blocker::cuboid(DVec3::new(x, y - 5.0, -5.0), DVec3::new(x + 0.5, y + 5.0, 5.0));
            Umbra::new(&wall, DVec3::splat(-0.5), DVec3::splat(0.5)).unwrap()
        };
        let umbrae = [umbra(3.0, 0.0), umbra(5.0, 8.0), umbra(-4.0, 0.0)];
        let beyond = |bounds: &Aabb| bounds.min.z > 6.0;
        for (count, or) in [(3, None), (0, Some(&beyond as IsHidden<'_>)), (2, Some(&beyond)), (0, None)] {
            let umbrae = &umbrae[..count];
            let mut visible = VisibleSet::new();
            let stats = remove_hidden(&scene, &mut visible, umbrae, or);
            let mut hidden = 0;
            for id in scene.ids() {
                let bounds = scene.bounds(id).unwrap();
                let is_hidden = umbrae.iter().any(|umbra| umbra.classify(&bounds) == Containment::Inside)
                    || or.is_some_and(|or| or(&bounds));
                assert_eq!(visible.contains(&scene, id), !is_hidden, "{count} umbrae, or {}", or.is_some());
                hidden += usize::from(is_hidden);
            }
            assert_eq!(stats.visible as usize, scene.len() - hidden, "objects counted, {count} umbrae");
            assert!(hidden > 200 || count == 0 && or.is_none(), "{hidden} objects are hidden");
        }
    }
}
