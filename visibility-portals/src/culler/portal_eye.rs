//! One view through portals: its settings, its memory, and what can be asked of its last frame.

use super::mirror::NONE;
use super::portal_stats::{NotCulled, PortalStats};
use super::portal_view::PortalView;
use super::portal_walk::{Narrowing, PortalPath, PortalWalk};
use super::reflection::{Reflection, Reflections};
use super::scene_cells::SceneCells;
use super::seen_objects::Seen;
use super::start_cells::StartCells;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{
    CullStats, Scene, View, VisibleSet,
    cells::{CellId, PortalId},
    scene::Changes,
};

/// One view through portals: settings, scratch memory, and what the last frame saw.
///
/// Conservative, whatever the rounding: an object is hidden only if no line of sight reaches its bounds
/// through open portals. Time is in proportion to what is seen: about 0.1 us for each portal looked at, 10 ns
/// for each object and [path](Self::path_to) to its cell, and a few ns for each object that earlier stages
/// have left. No allocation once warm.
///
/// ```
/// use visibility_core::glam::DVec3;
/// use visibility_core::{cells::{CellGraph, CellId}, geometry::ConvexPolygon, Pose, Scene, View};
/// use visibility_core::{pvs::{Viewcell, Viewcells}, VisibleSet};
/// use visibility_portals::{PortalEye, SceneCells};
/// let corners = [[4.0, 1.0, 0.0], [4.0, 2.0, 0.0], [4.0, 2.0, 2.0], [4.0, 1.0, 2.0]];
/// let door = ConvexPolygon::new(corners.map(DVec3::from))?;
/// let graph = CellGraph::new(2, [(door, [CellId(0), CellId(1)])])?;
/// let room = |x: f64| Viewcell::from_box(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 4.0, 4.0, 3.0));
/// let mut cells = SceneCells::new(graph, Viewcells::new([room(0.0), room(4.0)]), 1e-6)?;
/// let (scene, mut eye, mut visible) = (Scene::new(), PortalEye::new(), VisibleSet::new());
/// let pose = Pose::look_at(DVec3::new(1.0, 1.5, 1.0), DVec3::new(5.0, 1.5, 1.0), DVec3::Z);
/// let view = View::perspective(pose, 1.0, 1.5, 0.1, 100.0)?;
/// // Each frame:
/// cells.sync(&scene);
/// visible.fill(&scene, &view);
/// eye.cull(&cells, &scene, &view, &mut visible);
/// assert!(eye.sees(CellId(1)));
/// assert_eq!(eye.path_to(CellId(1)).count(), 1, "through one portal");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct PortalEye {
    narrowing: Narrowing,
    /// The most portals to look at in one walk.
    steps: u64,
    walk: PortalWalk,
    start_cells: StartCells,
    reflections: Reflections,
    stats: PortalStats,
    /// World position that the corners of the last walk are relative to.
    anchor: DVec3,
    /// By index of an object: the last frame in which it had changed since the cells were synced.
    unknown: Vec<u64>,
    /// Number of the last frame, from 1.
    frame: u64,
}

impl Default for PortalEye {
    fn default() -> Self {
        Self::new()
    }
}

impl PortalEye {
    /// The defaults: [`Narrowing::Polygon`], at most 20,000 portals a walk, at most 8 reflections, and
    /// mirrors seen in mirrors (a depth of 2).
    pub fn new() -> Self {
        Self {
            narrowing: Narrowing::Polygon,
            steps: 20_000,
            walk: PortalWalk::default(),
            start_cells: StartCells::default(),
            reflections: Reflections::new(),
            stats: PortalStats::default(),
            anchor: DVec3::ZERO,
            unknown: Vec::new(),
            frame: 0,
        }
    }

    /// Sets what each portal narrows the view to.
    pub fn with_narrowing(self, narrowing: Narrowing) -> Self {
        Self { narrowing, ..self }
    }

    /// Sets the most portals that are looked at in a frame, and again in each reflection. A frame that needs
    /// more hides nothing and [says so](PortalStats::fallback).
    pub fn with_step_limit(self, steps: u64) -> Self {
        Self { steps, ..self }
    }

    /// Sets the most reflections of a frame, and the most mirrors that one line of sight may meet: 1 for none
    /// in mirrors, 0 for no reflections.
    pub fn with_reflections(mut self, most: usize, deepest: u32) -> Self {
        self.reflections.limit(most, deepest);
        self
    }

    /// Forgets the last frame and keeps the settings. Only frees the answer to questions of it: other cells,
    /// another PVS, another scene and cuts of the camera are noticed without.
    pub fn reset(&mut self) {
        *self = Self {
            narrowing: self.narrowing,
            steps: self.steps,
            reflections: self.reflections.anew(),
            ..Self::new()
        };
    }

    /// Removes from `visible` what cannot be seen through open portals.
    ///
    /// Objects that changed since `cells` were last [synced](SceneCells::sync) stay. Where nothing can be
    /// told (the view begins outside all cells, `cells` were never synced with this scene, the limit of steps
    /// is reached) all objects stay, and [`PortalStats::fallback`] says why.
    pub fn cull(
        &mut self,
        cells: &SceneCells,
        scene: &Scene,
        view: &View,
        visible: &mut VisibleSet,
    ) -> CullStats {
        self.frame += 1;
        self.stats = PortalStats::default();
        self.reflections.clear();
        self.walk.begin(cells);
        let Some(eye_view) = PortalView::new(view) else {
            return self.fall_back(NotCulled::View, scene, visible);
        };
        self.anchor = eye_view.anchor;
        let synced = self.follow(cells, scene);
        let walk = &mut self.walk;
        let why = if !synced {
            Some(NotCulled::NotSynced)
        } else if !self.start_cells.find(cells, view, eye_view.anchor, |cell| walk.start_whole(cell)) {
            Some(NotCulled::OutsideCells)
        } else if !walk.go(cells, &eye_view, self.narrowing, self.steps, &mut self.stats) {
            Some(NotCulled::Steps)
        } else {
            None
        };
        let mut result = match why {
            Some(why) => {
                self.walk.look_at_all_mirrors(cells, &eye_view);
                self.fall_back(why, scene, visible)
            }
            None => {
                let seen = Seen { cells, scene, walk: &self.walk, eye_view: &eye_view };
                seen.retain(&self.unknown, self.frame, visible, &mut self.stats.tests)
            }
        };
        self.stats.paths = self.walk.paths.len() as u64;
        if !self.walk.mirrors.is_empty() {
            let known = (self.unknown.as_slice(), self.frame);
            let settings = (self.narrowing, self.steps);
            self.reflections.look(
                cells,
                scene,
                view,
                &eye_view,
                &self.walk,
                known,
                settings,
                &mut self.stats,
            );
        }
        result.nodes = self.stats.paths;
        result.tests = self.stats.tests;
        result
    }

    /// Notes why the frame hides nothing.
    fn fall_back(&mut self, why: NotCulled, scene: &Scene, visible: &VisibleSet) -> CullStats {
        self.stats.fallback = Some(why);
        CullStats { visible: visible.count(scene) as u64, ..CullStats::default() }
    }

    /// Marks the objects that have changed since the cells were synced. False if they were synced with
    /// another scene, or so long ago that the changes are no longer listed.
    fn follow(&mut self, cells: &SceneCells, scene: &Scene) -> bool {
        let Changes::Objects(changed) = cells.cursor.peek(scene) else { return false };
        if !changed.is_empty() && self.unknown.len() < scene.index_limit() {
            self.unknown.resize(scene.index_limit(), 0);
        }
        for id in changed {
            // One that is not there any more may be beyond the end.
            if let Some(unknown) = self.unknown.get_mut(id.index()) {
                *unknown = self.frame;
            }
        }
        true
    }

    /// Counters of the last frame, and why it hid nothing, if so.
    pub fn stats(&self) -> PortalStats {
        self.stats
    }

    /// Whether a cell may have been seen in the last frame. True for every cell, also an unknown one, if that
    /// frame [fell back](PortalStats::fallback).
    pub fn sees(&self, cell: CellId) -> bool {
        self.stats.fallback.is_some() || self.walk.paths_to(cell).next().is_some()
    }

    /// The cells seen in the last frame, each once, in the order in which the walk came to them. Empty if
    /// that frame [fell back](PortalStats::fallback).
    pub fn seen_cells(&self) -> impl Iterator<Item = CellId> + '_ {
        let known = self.stats.fallback.is_none();
        let paths = self.walk.paths.iter().filter(move |_| known);
        // The last way in the list of a cell is the first that was found.
        paths
            .filter(|path| {
                self.walk.paths_to(path.cell).last().is_some_and(|first| core::ptr::eq(first, *path))
            })
            .map(|path| path.cell)
    }

    /// The portals between the eye and a cell that was seen in the last frame: from the cell back to the eye,
    /// along the path with the fewest. Empty for the cells where lines of sight begin, for cells that were
    /// not seen, and if that frame [fell back](PortalStats::fallback).
    pub fn path_to(&self, cell: CellId) -> impl Iterator<Item = PortalId> + '_ {
        let from = |path| {
            core::iter::successors(Some(path), |path: &&PortalPath| self.walk.paths.get(path.parent as usize))
        };
        let known = self.stats.fallback.is_none();
        let paths = self.walk.paths_to(cell).filter(move |_| known);
        let shortest = paths.min_by_key(|&path| from(path).count());
        shortest.into_iter().flat_map(from).filter(|path| path.parent != NONE).map(|path| path.portal)
    }

    /// The part of each portal that was seen through in the last frame, once for each path through it, for
    /// debug drawing: the portal, the cell behind it, and the corners in world space, in order around the
    /// portal.
    pub fn windows(&self) -> impl Iterator<Item = (PortalId, CellId, impl Iterator<Item = DVec3> + '_)> + '_ {
        let paths = self.walk.paths.iter().filter(|path| path.parent != NONE);
        paths.map(|path| {
            let corners = &self.walk.corners[path.corners.start as usize..path.corners.end as usize];
            (path.portal, path.cell, corners.iter().map(|&corner| corner + self.anchor))
        })
    }

    /// The reflections of the last frame: one for each mirror that was seen, and for each mirror that was
    /// seen in one. A reflection comes after the one that its mirror is [seen in](Reflection::parent).
    pub fn reflections(&self) -> &[Reflection] {
        self.reflections.as_slice()
    }
}
