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
