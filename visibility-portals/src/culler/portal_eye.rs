//! One view through portals: what it keeps from frame to frame, and what can be asked of the last one.

use super::mirror::NONE;
use super::portal_stats::{NotCulled, PortalStats};
use super::portal_view::PortalView;
use super::portal_walk::{Narrowing, PortalWalk, Way};
use super::reflection::{Reflection, Reflections};
use super::scene_cells::SceneCells;
use super::seen_objects::Seen;
use super::start_cells::StartCells;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{CellId, Changes, CullStats, PortalId, Scene, View, VisibleSet};

/// The memory of one view through portals, its settings, and what it saw in the last frame.
///
/// Conservative, whatever the rounding: an object is hidden only if no line of sight reaches its box through
/// open portals. Cost follows what is seen: about 0.1 us a portal that is looked at, 10 ns an object and way
/// by which its cell is seen, and a few for each object that the stages before have left. No allocation once
/// warm.
///
/// ```
/// use visibility_core::{CellGraph, CellId, ConvexPolygon, Pose, Scene, View, Viewcell, Viewcells, VisibleSet, glam::DVec3};
/// use visibility_portals::{PortalEye, SceneCells};
/// let door = ConvexPolygon::new([[4.0, 1.0, 0.0], [4.0, 2.0, 0.0], [4.0, 2.0, 2.0], [4.0, 1.0, 2.0]].map(DVec3::from))?;
/// let graph = CellGraph::new(2, [(door, [CellId(0), CellId(1)])])?;
/// let room = |x: f64| Viewcell::from_box(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 4.0, 4.0, 3.0));
/// let mut cells = SceneCells::new(graph, Viewcells::new([room(0.0), room(4.0)]), 1e-6)?;
/// let (scene, mut eye, mut visible) = (Scene::new(), PortalEye::new(), VisibleSet::new());
/// let view = View::perspective(Pose::look_at(DVec3::new(1.0, 1.5, 1.0), DVec3::new(5.0, 1.5, 1.0), DVec3::Z), 1.0, 1.5, 0.1, 100.0)?;
/// // Each frame:
/// cells.sync(&scene);
/// visible.fill(&scene, &view);
/// eye.cull(&cells, &scene, &view, &mut visible);
/// assert!(eye.sees(CellId(1)));
/// assert_eq!(eye.way_to(CellId(1)).count(), 1, "through one portal");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct PortalEye {
    narrowing: Narrowing,
    steps: u64,
    walk: PortalWalk,
    start_cells: StartCells,
    reflections: Reflections,
    stats: PortalStats,
    anchor: DVec3,
    /// By index of an object: the frame in which it was last found changed since the cells were told.
    unknown: Vec<u64>,
    frame: u64,
}

impl Default for PortalEye {
    fn default() -> Self {
        Self::new()
    }
}

impl PortalEye {
    /// Narrows to polygons, looks at up to 20,000 portals a frame, and returns up to 8 reflections, of
    /// mirrors in mirrors too.
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

    /// What each portal narrows the view to.
    pub fn with_narrowing(self, narrowing: Narrowing) -> Self {
        Self { narrowing, ..self }
    }

    /// The most portals to look at in a frame, in each reflection again. A frame that needs more is not
    /// culled by portals, and [says so](PortalStats::fallback).
    pub fn with_step_limit(self, steps: u64) -> Self {
        Self { steps, ..self }
    }

    /// The most reflections a frame, and how many mirrors one after another a line of sight may meet.
    pub fn with_reflections(mut self, most: usize, deepest: u32) -> Self {
        self.reflections.limit(most, deepest);
        self
    }

    /// Forgets the last frame and keeps the settings. Needed for nothing but to start anew: other cells,
    /// another PVS, another scene and cuts of the camera are noticed.
    pub fn reset(&mut self) {
        *self = Self {
            narrowing: self.narrowing,
            steps: self.steps,
            reflections: self.reflections.anew(),
            ..Self::new()
        };
    }

    /// Removes from `visible` what cannot be seen through open portals. An object that changed after the
    /// cells were last [told](SceneCells::sync) stays.
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
        self.stats.ways = self.walk.ways.len() as u64;
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
        result.nodes = self.stats.ways;
        result.tests = self.stats.tests;
        result
    }

    fn fall_back(&mut self, why: NotCulled, scene: &Scene, visible: &VisibleSet) -> CullStats {
        self.stats.fallback = Some(why);
        CullStats { visible: visible.count(scene) as u64, ..CullStats::default() }
    }

    /// Notes what has changed since the cells were told. False if that cannot be known.
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

    /// What the last frame had to look at, and whether it was culled by portals at all.
    pub fn stats(&self) -> PortalStats {
        self.stats
    }

    /// Whether a cell may be seen in the last frame. True for every cell where that could not be told.
    pub fn sees(&self, cell: CellId) -> bool {
        self.stats.fallback.is_some() || self.walk.ways_into(cell).next().is_some()
    }

    /// The cells seen in the last frame, nearest first along the ways that were walked, each once; none where
    /// that could not be told.
    pub fn seen_cells(&self) -> impl Iterator<Item = CellId> + '_ {
        let known = self.stats.fallback.is_none();
        let ways = self.walk.ways.iter().filter(move |_| known);
        // The last way in the list of a cell is the first that was found.
        ways.filter(|way| {
            self.walk.ways_into(way.cell).last().is_some_and(|first| core::ptr::eq(first, *way))
        })
        .map(|way| way.cell)
    }

    /// The portals that are crossed on a way to a cell that is seen, from that cell back to the eye: of
    /// several ways one with the fewest. None if lines of sight begin in it, or if it is not seen.
    pub fn way_to(&self, cell: CellId) -> impl Iterator<Item = PortalId> + '_ {
        let from =
            |way| core::iter::successors(Some(way), |way: &&Way| self.walk.ways.get(way.parent as usize));
        let known = self.stats.fallback.is_none();
        let ways = self.walk.ways_into(cell).filter(move |_| known);
        let shortest = ways.min_by_key(|&way| from(way).count());
        shortest.into_iter().flat_map(from).filter(|way| way.parent != NONE).map(|way| way.portal)
    }

    /// The part of each portal that is seen through, once for every way: the portal, the cell that is seen,
    /// and the corners in the world, in the order that they were found. For pictures.
    pub fn windows(&self) -> impl Iterator<Item = (PortalId, CellId, impl Iterator<Item = DVec3> + '_)> + '_ {
        let ways = self.walk.ways.iter().filter(|way| way.parent != NONE);
        ways.map(|way| {
            let corners = &self.walk.corners[way.corners.start as usize..way.corners.end as usize];
            (way.portal, way.cell, corners.iter().map(|&corner| corner + self.anchor))
        })
    }

    /// What the mirrors show that are seen in the last frame, and what mirrors show in them: each with a view
    /// and a set of its own.
    pub fn reflections(&self) -> &[Reflection] {
        self.reflections.as_slice()
    }
}
