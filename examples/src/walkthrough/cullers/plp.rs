//! Command-line entries of prioritized-layered projection, of its conservative form, and of sorting by
//! distance as their baseline.

use super::known::Known;
use crate::walkthrough::World;
use std::sync::Arc;
use visibility_core::{Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet, view::Eye};
use visibility_hzb::Hzb;
use visibility_plp::{Budget, ConservativePlpCuller, DelaunayTessellation, OctreeTessellation, PlpCuller};

/// Budgets that are worth comparing, as percentages of all triangles.
const SHARES: &[&str] = &["10%", "5%", "2%", "1%"];

pub(super) const KNOWN: &[Known] = &[
    Known {
        name: "plp",
        what: "what is most likely visible, up to a share of all triangles (plp:10%)",
        dials: SHARES,
        make: |dial, world| Ok(Box::new(PlpCuller::new(octree_of(world)?, budget(dial, world)?))),
    },
    Known {
        name: "plp-delaunay",
        what: "the same by tetrahedra instead of cubes (plp-delaunay:10%)",
        dials: SHARES,
        make: |dial, world| {
            world.check_copies()?;
            let make = || Ok(DelaunayTessellation::new(&world.scene));
            let cells = world.prepared.get("tetrahedra", make)?;
            Ok(Box::new(PlpCuller::new(cells, budget(dial, world)?)))
        },
    },
    Known {
        name: "cplp",
        what: "a share of all triangles as plp (cplp:1%), then all that a z-buffer of 512x288 of them does not hide",
        dials: SHARES,
        make: |dial, world| {
            // With 1 %, the culler needs a tenth of the tests of the front-to-back order, for hardly more
            // triangles, as `plp --conservative` shows.
            let budget = budget(dial.or(Some("1%")), world)?;
            let map = Hzb::new(512, 288).map_err(|error| error.to_string())?.with_simd(world.simd);
            Ok(Box::new(ConservativePlpCuller::new(octree_of(world)?, budget, map)))
        },
    },
    Known {
        name: "centroid",
        what: "the nearest objects, up to a share of all triangles (centroid:10%)",
        dials: SHARES,
        make: |dial, world| {
            let Budget::Cost(budget) = budget(dial, world)? else { return Err("no budget".to_owned()) };
            Ok(Box::new(Centroid { budget, order: Vec::new() }))
        },
    },
];

/// Returns the world's octree of default fineness, built on the first call. Never returns an error.
fn octree_of(world: &World) -> Result<Arc<OctreeTessellation>, String> {
    world.check_copies()?;
    world.prepared.get("an octree", || Ok(OctreeTessellation::new(&world.scene)))
}

/// Returns a budget in triangles from a setting such as `10%` of all triangles. Without a setting, the budget
/// is `10%`. Returns an error unless the percentage is from 0 to 100.
fn budget(dial: Option<&str>, world: &World) -> Result<Budget, String> {
    let dial = dial.unwrap_or("10%");
    let share = dial.strip_suffix('%').and_then(|number| number.trim().parse::<f64>().ok());
    let share = share.filter(|share| (0.0..=100.0).contains(share));
    let share = share.ok_or_else(|| format!("`{dial}` is no share of all triangles, such as `10%`"))?;
    Ok(Budget::Cost((world.source.triangle_count() as f64 * share / 100.0) as u64))
}

/// Culler that keeps the nearest objects, by the centre of their bounds, until the next object would exceed a
/// budget of triangles.
struct Centroid {
    budget: u64,
    order: Vec<(f64, ObjectId)>,
}

impl Culler for Centroid {
    fn name(&self) -> &str {
        "centroid"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Approximate
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let eye = view.eye(scene.origin());
        let distance = |id| {
            let center = scene.bounds(id).map_or(glam::DVec3::ZERO, |bounds| bounds.center().as_dvec3());
            match eye {
                Eye::Point(eye) => center.distance_squared(eye),
                Eye::Direction(along) => center.dot(along),
            }
        };
        self.order.clear();
        self.order.extend(visible.iter(scene).map(|id| (distance(id), id)));
        self.order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut left = self.budget;
        let cost = |id| scene.object(id).map_or(0, |object| u64::from(object.cost));
        let fits = |&(_, id): &(f64, ObjectId)| {
            let cost = cost(id);
            let fits = cost <= left;
            left = if fits { left - cost } else { 0 };
            fits
        };
        let kept: Vec<ObjectId> = self.order.iter().copied().take_while(fits).map(|(_, id)| id).collect();
        visible.keep_in_order(scene, &kept);
        CullStats::default().with_tests(self.order.len() as u64).with_visible(kept.len() as u64)
    }
}
