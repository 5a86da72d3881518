//! One view through portals: its settings, its state, and the queries of its last frame.

use super::NONE;
use super::mirror_reflections::{Reflection, Reflections};
use super::portal_stats::{NotCulled, PortalStats};
use super::portal_walk::{Narrowing, PortalPath, PortalWalk};
use super::scene_cells::SceneCells;
use super::start_cells::StartCells;
use super::view_planes::PortalView;
use super::walked_scene::WalkedScene;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{
    CullStats, Culler, Scene, View, VisibleSet,
    cells::{CellId, PortalId},
    culler::Lack,
    scene::Changes,
    view::ViewRegion,
};

/// One view through portals: settings, scratch memory, and the results of the last frame.
///
/// Conservative, whatever the rounding: an object is removed only if no line of sight reaches its bounds
/// through open portals. Time is proportional to what is seen: about 0.1 us for each portal inspected, 10 ns
/// for each pair of an object and a [path](Self::path_to) to its cell, and a few ns for each object that
/// earlier stages have left. No allocation once warm.
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
    /// Maximum number of portals inspected in one walk. A walk that needs more is abandoned, and all objects
    /// that earlier stages left stay visible.
    steps: u64,
    walk: PortalWalk,
    start_cells: StartCells,
    reflections: Reflections,
    stats: PortalStats,
    /// World-space position of the anchor of the last walk (the eye of a perspective view): the origin of
    /// anchor-relative coordinates.
    anchor: DVec3,
    /// By object index: the number of the last frame in which the object had changed since the cells were
    /// last synced. The object is not culled in the frame of that number.
    unknown: Vec<u64>,
    /// Number of the last frame. The first frame is 1; 0 before it.
    frame: u64,
}

/// The views that a walk is for.
#[derive(Clone, Copy)]
enum Views<'a> {
    One(&'a View),
    /// All views of a region.
    Of(&'a ViewRegion),
}

impl Default for PortalEye {
    fn default() -> Self {
        Self::new()
    }
}

impl PortalEye {
    /// Returns an eye with the default settings: [`Narrowing::Polygon`], at most 20,000 portals per walk, at
    /// most 8 reflections per frame, and at most 2 mirrors along one line of sight.
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

    /// Sets the shape to which each portal narrows the view. Both shapes are conservative.
    #[must_use]
    pub fn with_narrowing(self, narrowing: Narrowing) -> Self {
        Self { narrowing, ..self }
    }

    /// Sets the maximum number of portals inspected in the walk of a frame, and again in the walk of each
    /// reflection. A frame that needs more removes no object; [`PortalStats::fallback`] of that frame is then
    /// [`NotCulled::Steps`](super::NotCulled::Steps).
    #[must_use]
    pub fn with_step_limit(self, steps: u64) -> Self {
        Self { steps, ..self }
    }

    /// Sets `max_count`, the maximum number of reflections per frame, and `max_depth`, the maximum number of
    /// mirrors along one line of sight. A `max_depth` of 1 leaves out mirrors seen in mirrors; 0 for either
    /// disables reflections.
    #[must_use]
    pub fn with_reflections(mut self, max_count: usize, max_depth: u32) -> Self {
        self.reflections.set_limits(max_count, max_depth);
        self
    }

    /// Forgets the last frame and keeps the settings. Never needed for correctness: changed cells, another
    /// PVS, another scene and camera cuts are detected without a call. Queries of the last frame then answer
    /// as before the first frame.
    pub fn reset(&mut self) {
        *self = Self {
            narrowing: self.narrowing,
            steps: self.steps,
            reflections: self.reflections.cleared(),
            ..Self::new()
        };
    }

    /// Removes from `visible` the objects that cannot be seen through open portals, and computes the
    /// reflections in mirrors.
    ///
    /// Objects that changed since the last [`sync`](SceneCells::sync) of `cells` stay visible. All objects
    /// stay visible where the walk cannot decide: lines of sight begin outside all cells, `cells` were never
    /// synced with this scene, or the walk reaches the limit of steps. [`PortalStats::fallback`] then tells
    /// the reason.
    pub fn cull(
        &mut self,
        cells: &SceneCells,
        scene: &Scene,
        view: &View,
        visible: &mut VisibleSet,
    ) -> CullStats {
        self.cull_views(cells, scene, Views::One(view), visible)
    }

    /// Removes from `visible` the objects that no view of a region can see through open portals. Otherwise
    /// like [`cull`](Self::cull). Returns `None`, and removes nothing, where `cull` would
    /// [fall back](PortalStats::fallback), and if `cells` have mirrors.
    ///
    /// Each portal narrows the view by planes through its edges that are turned outwards about the edge, by
    /// the angle at which the ball of eyes appears from the edge.
    pub fn cull_region(
        &mut self,
        cells: &SceneCells,
        scene: &Scene,
        region: &ViewRegion,
        visible: &mut VisibleSet,
    ) -> Option<CullStats> {
        let stats = self.cull_views(cells, scene, Views::Of(region), visible);
        self.stats.fallback.is_none().then_some(stats)
    }

    /// Removes from the [objects](Reflection::visible) of each reflection of the last frame what `culler`
    /// removes in the reflected view. Stages of the eye's own pipeline do not reach reflections: this is for
    /// objects that are too small, or out of their draw range, in mirrors as well. The accuracy of the sets
    /// is then that of `culler`.
    ///
    /// Call it after [`cull`](Self::cull), before the scene changes. If the layout of the scene has changed,
    /// `culler` alone decides what is in the sets. Does nothing without reflections.
    pub fn cull_reflections(&mut self, scene: &Scene, culler: &mut dyn Culler) {
        self.reflections.cull(scene, culler);
    }

    fn cull_views(
        &mut self,
        cells: &SceneCells,
        scene: &Scene,
        views: Views,
        visible: &mut VisibleSet,
    ) -> CullStats {
        self.frame += 1;
        self.stats = PortalStats::default();
        self.reflections.clear(scene);
        self.walk.begin(cells);
        let (eye_view, narrowing) = match views {
            Views::One(view) => (PortalView::new(view), self.narrowing),
            Views::Of(region) if cells.mirrors.is_empty() => {
                (PortalView::of_region(region), Narrowing::Polygon)
            }
            Views::Of(_) => (None, self.narrowing),
        };
        let Some(eye_view) = eye_view else {
            return self.fall_back(NotCulled::View, scene, visible);
        };
        self.anchor = eye_view.anchor;
        let synced = self.mark_changed_objects(cells, scene);
        let walk = &mut self.walk;
        // The first reason, if any, why all objects must stay visible.
        let (starts, anchor) = (&mut self.start_cells, eye_view.anchor);
        let mut begin = || match views {
            Views::One(view) => starts.find(cells, view, anchor, |cell| walk.start_in_full_view(cell)),
            Views::Of(region) => {
                starts.find_around(cells, region, anchor, |cell| walk.start_in_full_view(cell))
            }
        };
        let why = if !synced {
            Some(NotCulled::NotSynced)
        } else if !begin() {
            Some(NotCulled::OutsideCells)
        } else if !walk.run(cells, &eye_view, narrowing, self.steps, &mut self.stats) {
            Some(NotCulled::Steps)
        } else {
            None
        };
        let mut result = match why {
            Some(why) => {
                self.walk.try_all_mirrors(cells, &eye_view);
                self.fall_back(why, scene, visible)
            }
            None => {
                let seen = WalkedScene { cells, scene, walk: &self.walk, eye_view: &eye_view };
                seen.retain(&self.unknown, self.frame, visible, &mut self.stats.tests)
            }
        };
        self.stats.paths = self.walk.paths.len() as u64;
        if let Views::One(view) = views
            && !self.walk.mirrors.is_empty()
        {
            let known = (self.unknown.as_slice(), self.frame);
            let settings = (self.narrowing, self.steps);
            self.reflections.reflect_all(
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

    /// Records in `stats` the reason `why` the frame removes no object. Returns the frame's counters: all
    /// objects of `visible` count as visible.
    fn fall_back(&mut self, why: NotCulled, scene: &Scene, visible: &VisibleSet) -> CullStats {
        self.stats.fallback = Some(why);
        CullStats::default().with_visible(visible.count(scene) as u64)
    }

    /// Marks in `unknown` the objects that have changed since the last sync of `cells`; these are not culled
    /// in this frame. Returns `true` if all of them are marked. Returns `false`, and marks none, if the
    /// changes are unknown: the cells were never synced, were synced with another scene, or were synced so
    /// long ago that the scene no longer lists the changes.
    fn mark_changed_objects(&mut self, cells: &SceneCells, scene: &Scene) -> bool {
        let Changes::Objects(changed) = cells.cursor.peek(scene) else { return false };
        if !changed.is_empty() && self.unknown.len() < scene.index_limit() {
            self.unknown.resize(scene.index_limit(), 0);
        }
        for id in changed {
            // A removed object may have an index beyond the end; it needs no mark.
            if let Some(unknown) = self.unknown.get_mut(id.index()) {
                *unknown = self.frame;
            }
        }
        true
    }

    /// Calls `each` for each reason why this eye may hide no objects of `scene`, or too many: the reason why
    /// the last call of [`cull`](Self::cull) hid nothing, and a PVS of `cells` that may be of another graph.
    /// See [`Culler::for_each_lack`](visibility_core::Culler::for_each_lack).
    pub fn for_each_lack(&self, cells: &SceneCells, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        let what = self.stats.fallback.map(|why| match why {
            NotCulled::OutsideCells => "objects not culled, the eye being outside all cells",
            NotCulled::Steps => "objects not culled, the limit of inspected portals being reached",
            NotCulled::View => "objects not culled, the place of the eye being unknown",
            NotCulled::NotSynced => "objects not culled, the cells not being synced with the scene",
        });
        if let Some(what) = what.filter(|_| !scene.is_empty()) {
            each(Lack { what, count: scene.len() });
        }
        if !cells.is_pvs_checked() {
            let count = cells.graph.cell_count().max(1);
            each(Lack { what: "cells with a PVS that may be of another graph", count });
        }
    }

    /// Returns the counters of the last call of [`cull`](Self::cull), and in [`PortalStats::fallback`] the
    /// reason if that call could not cull and left all objects visible. Before the first call all counters
    /// are 0 and `fallback` is `None`.
    pub fn stats(&self) -> PortalStats {
        self.stats
    }

    /// Tests whether a line of sight may have reached `cell` in the last frame. `true` for every cell, also
    /// an unknown one, if the last frame [fell back](PortalStats::fallback); `false` for every cell before
    /// the first frame.
    pub fn sees(&self, cell: CellId) -> bool {
        self.stats.fallback.is_some() || self.walk.paths_to(cell).next().is_some()
    }

    /// Returns the cells seen in the last frame, each once, in the order in which the walk first reached
    /// them. Empty before the first frame and if the last frame [fell back](PortalStats::fallback).
    pub fn seen_cells(&self) -> impl Iterator<Item = CellId> + '_ {
        let known = self.stats.fallback.is_none();
        let paths = self.walk.paths.iter().filter(move |_| known);
        // The list of a cell's paths runs from the last found to the first found. A cell is reported at the
        // first path.
        paths
            .filter(|path| {
                self.walk.paths_to(path.cell).last().is_some_and(|first| core::ptr::eq(first, *path))
            })
            .map(|path| path.cell)
    }

    /// Returns the portals between `cell` and the eye in the last frame, in order from the cell back to the
    /// eye, along the path with the fewest portals. Empty for a cell in which lines of sight begin, for a
    /// cell that was not seen, and if the last frame [fell back](PortalStats::fallback).
    pub fn path_to(&self, cell: CellId) -> impl Iterator<Item = PortalId> + '_ {
        let from = |path| {
            core::iter::successors(Some(path), |path: &&PortalPath| self.walk.paths.get(path.parent as usize))
        };
        let known = self.stats.fallback.is_none();
        let paths = self.walk.paths_to(cell).filter(move |_| known);
        let shortest = paths.min_by_key(|&path| from(path).count());
        shortest.into_iter().flat_map(from).filter(|path| path.parent != NONE).map(|path| path.portal)
    }

    /// Returns, for debug drawing, the part of each portal that was seen through in the last frame, once for
    /// each path through the portal. Each entry is the portal, the cell behind it, and the corners of the
    /// visible part in world space, in order around the portal. After a [fallback](PortalStats::fallback) the
    /// entries are incomplete, or there are none.
    pub fn windows(&self) -> impl Iterator<Item = (PortalId, CellId, impl Iterator<Item = DVec3> + '_)> + '_ {
        let paths = self.walk.paths.iter().filter(|path| path.parent != NONE);
        paths.map(|path| {
            let corners = &self.walk.corners[path.corners.start as usize..path.corners.end as usize];
            (path.portal, path.cell, corners.iter().map(|&corner| corner + self.anchor))
        })
    }

    /// Returns the reflections of the last frame: one for each mirror that was seen from the eye, and one for
    /// each mirror that was seen in a reflection. A reflection comes after its [parent](Reflection::parent).
    /// Empty before the first frame.
    pub fn reflections(&self) -> &[Reflection] {
        self.reflections.as_slice()
    }
}
