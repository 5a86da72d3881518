//! `ExactCuller`: the region culler that decides each object by lines of sight and proofs.

use crate::cell_query::CellQuery;
use crate::chain_scratch::ChainScratch;
use crate::settings::ExactSettings;
use crate::sight::CellBox;
use crate::triangles::{SceneTriangles, TargetObject};
use crate::verdict::{CellVerdicts, Verdict};
use alloc::{boxed::Box, sync::Arc, vec, vec::Vec};
use visibility_core::pvs::Viewcell;
use visibility_core::{Accuracy, CullStats, RegionCuller, Scene, VisibleSet};

/// Region culler that finds, for each object of a scene, a line of sight from a viewcell or a proof that
/// there is none.
///
/// Works on [`SceneTriangles`] collected from the scene. Nothing is removed if the scene has changed since or
/// is another one, or if an occluder is on none of the [layers of all views](VisibleSet::common_layers) of
/// the set, since such a view does not draw that occluder. Never-culled objects stay. The same viewcell,
/// triangles and settings give the same answer on every machine.
///
/// A viewcell with [planes](Viewcell::planes) counts as its whole box. An object that is seen only from the
/// part cut off by the planes may be kept: the accuracy is then conservative instead of exact.
///
/// ```
/// use std::sync::Arc;
/// use visibility_core::{glam::{DVec3, Vec3}, pvs::Viewcell, Aabb, Object, Scene};
/// use visibility_exact::{Effort, ExactCuller, SceneTriangles, ExactSettings};
/// // A wall, and a plate behind it.
/// let square = |x: f32, r: f32| {
///     let [a, b, c, d] = [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(y, z)| Vec3::new(x, y, z));
///     [[a, b, c], [a, c, d]]
/// };
/// let mut scene = Scene::new();
/// for triangles in [square(5.0, 10.0), square(9.0, 1.0)] {
///     let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
///     let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
///     scene.set_triangles(id, triangles)?;
/// }
/// let triangles = Arc::new(SceneTriangles::new(&scene));
/// let mut culler = ExactCuller::new(triangles, ExactSettings::new(Effort::Exact(1e-4)));
/// let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
/// assert_eq!(culler.verdicts(&cell).counts(), [1, 1, 0]);
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
pub struct ExactCuller {
    triangles: Arc<SceneTriangles>,
    settings: ExactSettings,
    scratch: Option<ChainScratch>,
    last: Option<CellVerdicts>,
    stop: Option<Stop>,
}

impl core::fmt::Debug for ExactCuller {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("ExactCuller").field("settings", &self.settings).finish_non_exhaustive()
    }
}

/// Function that is called many times during a search. The search ends once it returns true.
type Stop = Box<dyn Fn() -> bool + Send + Sync>;

impl ExactCuller {
    /// Makes a culler for the triangles of a scene.
    pub fn new(triangles: Arc<SceneTriangles>, settings: ExactSettings) -> Self {
        Self { triangles, settings, scratch: None, last: None, stop: None }
    }

    /// Sets a function that the culler calls many times a second while it works, or removes it. Once the
    /// function has returned true, the culler ends: objects that are neither seen nor proven hidden by then
    /// are open, and stay.
    pub fn set_stop(&mut self, stop: Option<Box<dyn Fn() -> bool + Send + Sync>>) {
        self.stop = stop;
    }

    /// Returns the settings that the culler was made with.
    pub fn settings(&self) -> &ExactSettings {
        &self.settings
    }

    /// Decides all objects from a viewcell. All objects are open if the viewcell is empty, not finite, or
    /// beyond 1e30 metres from the scene's origin.
    pub fn verdicts(&mut self, cell: &Viewcell) -> CellVerdicts {
        self.decide(cell, &|_| true)
    }

    /// Returns the triangles that the culler works on.
    pub fn triangles(&self) -> &Arc<SceneTriangles> {
        &self.triangles
    }

    /// Returns the result of the last [`cull`](RegionCuller::cull): a verdict for each candidate, and open
    /// for other objects. `None` before the first call, and after a call that removed nothing because the
    /// scene had changed or an occluder is on none of the layers of all views of the set.
    pub fn last(&self) -> Option<&CellVerdicts> {
        self.last.as_ref()
    }

    fn decide(&mut self, cell: &Viewcell, is_asked: &dyn Fn(usize) -> bool) -> CellVerdicts {
        let Some(cell) = CellBox::new(cell, self.triangles.origin) else {
            return CellVerdicts::undecided(&self.triangles);
        };
        let query = CellQuery::with_scratch(&self.triangles, cell, self.settings, self.scratch.take());
        let never = || false;
        let stop: &dyn Fn() -> bool = self.stop.as_deref().map_or(&never, |stop| stop);
        let (found, scratch) = query.with_stop(stop).run(is_asked);
        self.scratch = Some(scratch);
        found
    }
}

impl CellVerdicts {
    /// Makes verdicts in which every object is open.
    fn undecided(triangles: &SceneTriangles) -> Self {
        let verdicts = vec![Verdict::Open; triangles.objects.len()];
        Self {
            verdicts,
            proofs: Vec::new(),
            proof_count: 0,
            rays: 0,
            nodes: 0,
            refused: 0,
            is_decided: false,
        }
    }

    /// Returns whether an object stays in the set. Seen objects stay. With settings that need a proof, open
    /// objects stay too. With other settings, an open object stays in three cases: the viewcell could not be
    /// used, the query did not run to its end, or the object has no triangles or unusable coordinates.
    fn keeps(&self, place: usize, object: &TargetObject, settings: &ExactSettings) -> bool {
        match self.verdicts[place] {
            Verdict::Seen(_) => true,
            Verdict::Hidden | Verdict::Hardly(_) => false,
            // An object that could not be judged is not removed.
            Verdict::Open => {
                settings.proves || !self.is_decided || object.is_open || object.first == object.end
            }
        }
    }
}

impl RegionCuller for ExactCuller {
    fn accuracy(&self) -> Accuracy {
        let ExactSettings { proves, share, clearance, .. } = self.settings;
        match (proves, share > 0.0, clearance > 0.0) {
            (_, true, _) => Accuracy::Approximate,
            (false, false, _) => Accuracy::Aggressive,
            (true, false, false) => Accuracy::Conservative,
            (true, false, true) => Accuracy::Exact,
        }
    }

    fn cull(&mut self, scene: &Scene, cell: &Viewcell, visible: &mut VisibleSet) -> CullStats {
        self.last = None;
        let draws_all = self.triangles.layers.keys().all(|mask| mask & visible.common_layers() != 0);
        if !(draws_all && self.triangles.is_current(scene)) {
            return visible.retain(scene, |_, _| true);
        }
        let mut marks = vec![false; scene.index_limit()];
        visible.retain(scene, |id, _| {
            marks[id.index()] = true;
            true
        });
        let triangles = self.triangles.clone();
        let found = self.decide(cell, &|place| marks[triangles.objects[place].id.index()]);
        marks.fill(true);
        for (place, object) in triangles.objects.iter().enumerate() {
            marks[object.id.index()] = found.keeps(place, object, &self.settings);
        }
        let mut stats = visible.retain(scene, |id, _| marks[id.index()]);
        stats.nodes += found.nodes;
        stats.tests += found.rays;
        self.last = Some(found);
        stats
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Effort;
    use std::format;
    use visibility_core::glam::{DVec3, Vec3};
    use visibility_core::{Aabb, Object, Pose, View};

    /// A scene of a wall, object 0, and a plate behind it.
    fn wall_and_plate() -> Scene {
        let mut scene = Scene::new();
        for (x, r) in [(5.0, 10.0), (9.0, 1.0)] {
            let [a, b, c, d] = [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(y, z)| Vec3::new(x, y, z));
            let triangles = [[a, b, c], [a, c, d]];
            let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            scene.set_triangles(id, triangles).unwrap();
        }
        scene
    }

    #[test]
    fn the_accuracy_follows_from_the_settings() {
        for (effort, expected) in [
            (Effort::Rays(8), Accuracy::Aggressive),
            (Effort::Share(0.1), Accuracy::Approximate),
            (Effort::Exact(0.0), Accuracy::Conservative),
            (Effort::Exact(1e-4), Accuracy::Exact),
        ] {
            let triangles = Arc::new(SceneTriangles::new(&Scene::new()));
            let culler = ExactCuller::new(triangles, ExactSettings::new(effort));
            assert_eq!(culler.accuracy(), expected, "accuracy with {effort:?}");
        }
    }

    /// An open object is removed by a query without proofs that ran to its end, if it has triangles and can
    /// be judged, and in no other case.
    #[test]
    fn open_objects_stay_unless_rays_have_judged_them() {
        let triangles = SceneTriangles::new(&wall_and_plate());
        let mut found = CellVerdicts::undecided(&triangles);
        for case in 0..16 {
            let [proves, is_decided, is_open, is_empty] = [1, 2, 4, 8].map(|bit| case & bit != 0);
            found.is_decided = is_decided;
            let settings = ExactSettings { proves, ..ExactSettings::new(Effort::Rays(8)) };
            let mut object = triangles.objects[1].clone();
            object.is_open = is_open;
            object.end = if is_empty { object.first } else { object.end };
            let is_removed = !proves && is_decided && !is_open && !is_empty;
            let what = format!("proofs {proves}, decided {is_decided}, open {is_open}, empty {is_empty}");
            assert_eq!(found.keeps(1, &object, &settings), !is_removed, "{what}");
        }
    }

    /// The wall hides the plate in a set whose views all draw it, of the scene as it was prepared.
    #[test]
    fn nothing_is_removed_from_other_scenes_and_for_other_layers() {
        let mut scene = wall_and_plate();
        scene.set_layers(scene.id_at(0).unwrap(), 2).unwrap();
        let triangles = Arc::new(SceneTriangles::new(&scene));
        let settings = ExactSettings::new(Effort::Exact(1e-4)).with_rays(100).with_aimed_rays(10);
        let mut culler = ExactCuller::new(triangles, settings);
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let mut keeps = |scene: &Scene, layers: u32| {
            let mut visible = VisibleSet::new();
            visible.fill(scene, &View::perspective(pose, 1.0, 1.0, 0.1, 100.0).unwrap().with_layers(layers));
            culler.cull(scene, &Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5)), &mut visible);
            visible.contains(scene, scene.id_at(1).unwrap())
        };
        assert!(!keeps(&scene, 3) && !keeps(&scene, 2 | 1 << 31), "views that draw the wall");
        assert!(keeps(&scene, 1), "views that do not draw the wall");
        assert!(keeps(&scene.clone(), 3), "a clone of the scene");
        scene.set_layers(scene.id_at(1).unwrap(), 1).unwrap();
        assert!(keeps(&scene, 3), "a scene that has changed");
    }
}
