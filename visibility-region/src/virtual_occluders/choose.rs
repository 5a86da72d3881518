//! Choice of virtual occluders: candidates from the maps of a sweep, then the few that hide most.

use super::rectangles::largest;
use super::{VirtualOccluder, VirtualOccluders};
use crate::ExtendedProjectionCuller;
use crate::solids::occluding;
use crate::sweep::direction::Direction;
use crate::sweep::window::Window;
use alloc::vec::Vec;
use visibility_core::bits::Bits;
use visibility_core::pvs::Viewcell;
use visibility_core::scene::SceneCursor;
use visibility_core::{Aabb, Scene, VisibleSet};

/// Greatest number of candidate rectangles of each map. With twice as many, ten virtual occluders hide 1 %
/// more in a city (measured), but take more time to find.
const A_PLANE: usize = 8;
/// Approximate number of objects, evenly chosen by index, by which candidates are compared.
const SAMPLE: usize = 4096;

/// A rectangle on a plane of a sweep.
struct Candidate {
    direction: Direction,
    /// Distance in metres of the plane from the front of the viewcell.
    d: f64,
    /// Least and greatest coordinate of the rectangle along local x, then along local y, in metres.
    ends: [[f64; 2]; 2],
    /// Positions, in the list of tested objects, of the objects that the rectangle hides.
    hides: Bits,
}

impl Candidate {
    fn new(direction: &Direction, window: &Window, ends: [[f64; 2]; 2]) -> Self {
        Self { direction: *direction, d: window.d, ends, hides: Bits::EMPTY }
    }

    /// Finds the objects that the rectangle hides.
    fn test(&mut self, objects: &[Aabb]) {
        self.hides = Bits::new(objects.len());
        for (i, bounds) in objects.iter().enumerate() {
            let b = self.direction.local_box(bounds);
            if b.lo.z > self.d + self.direction.guard() {
                let [x, y] = self.direction.occludee(self.d, &b);
                let within = |[low, high]: [f64; 2], ends: [f64; 2]| low >= ends[0] && high <= ends[1];
                self.hides.set(i, within(x, self.ends[0]) && within(y, self.ends[1]));
            }
        }
    }
}

impl ExtendedProjectionCuller {
    /// Makes the virtual occluders of a viewcell, at most [`VirtualOccluders::MAX`]. They are chosen one by
    /// one: each hides the most objects that those before do not hide. All occluders of the scene that are on
    /// a layer count, so that a view must draw all of them. Empty if the viewcell is empty or not finite, or
    /// if nothing is hidden.
    ///
    /// Takes a few times as long as [culling](visibility_core::RegionCuller::cull), plus time in proportion
    /// to the number of objects.
    pub fn virtual_occluders(&mut self, scene: &Scene, cell: &Viewcell) -> VirtualOccluders {
        let mut candidates: Vec<Candidate> = Vec::new();
        // Candidates: the largest covered rectangles of the map on each plane of the sweep.
        self.sweep_open(scene, cell, |direction, window, map| {
            let rects = largest(map, A_PLANE).into_iter();
            candidates.extend(rects.map(|rect| Candidate::new(direction, window, window.inside(rect))));
        });
        let mut chosen = Vec::new();
        // At most `SAMPLE` objects, evenly chosen by index, stand for all.
        let step = scene.len() / SAMPLE + 1;
        let objects: Vec<Aabb> = scene.ids().step_by(step).filter_map(|id| scene.bounds(id).ok()).collect();
        candidates.iter_mut().for_each(|candidate| candidate.test(&objects));
        let mut hidden = Bits::new(objects.len());
        while chosen.len() < VirtualOccluders::MAX {
            // Of equal ones the nearest, since more may move behind it.
            let best = candidates
                .iter()
                .map(|candidate| (candidate.hides.count_without(&hidden), candidate))
                .filter(|(gain, _)| *gain > 0)
                .max_by(|a, b| a.0.cmp(&b.0).then(b.1.d.total_cmp(&a.1.d)));
            let Some((_, best)) = best else { break };
            hidden.unite(&best.hides);
            let direction = &best.direction;
            let [x, y, z] = direction.offset;
            chosen.push(VirtualOccluder {
                axes: direction.rows,
                anchor: scene.origin(),
                distance: best.d + z,
                ends: [best.ends[0].map(|end| end + x), best.ends[1].map(|end| end + y)],
            });
        }
        let occluding = occluding(scene, &VisibleSet::new());
        let occluders = scene.ids().filter(|id| occluding.contains(id.index()));
        let mut layers: Vec<u32> =
            occluders.filter_map(|id| scene.object(id).ok()).map(|object| object.layers).collect();
        layers.sort_unstable();
        layers.dedup();
        VirtualOccluders {
            cell: cell.clone(),
            occluders: chosen,
            cursor: SceneCursor::at(scene),
            occluding,
            layers,
            confirmed: false,
            active: Vec::new(),
        }
    }
}
