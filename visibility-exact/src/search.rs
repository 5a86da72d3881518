//! The search for an unblocked segment from P, a face of the viewcell, to Q, a face of the target. Depth
//! first over halves of P and Q, and lazily: a pair is halved only where no surface through its middle
//! segment blocks all its segments. A *node* is a pair of parts of P and Q, with all segments between them.

use crate::chain_scratch::{ChainScratch, Obstacle};
use crate::matrix_game::{Matrix, MatrixGame};
use crate::proof::{Proof, Step};
use crate::shaft::Shaft;
use crate::sight::{CellBox, Facing, Sight, Target, position_error, sights};
use crate::triangles::SceneTriangles;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// A segment from a point `p` of the viewcell to a point `q` of the target, in scene coordinates.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Segment {
    pub(crate) p: DVec3,
    pub(crate) q: DVec3,
}

/// Answer of the search for a target, or for a node (a set of segments to the target).
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Answer {
    /// The target is proven hidden. The proof is in [`Search::steps`].
    Hidden,
    /// The target is visible along this segment, which certainly misses all occluders.
    Visible(Segment),
    /// Neither a line of sight nor a proof was found within the budget.
    Undecided,
}

/// Counters of the work done by a [`Search`].
#[derive(Clone, Copy, Default, Debug)]
pub(crate) struct SearchStats {
    /// Number of nodes of searches by halving polygons.
    pub(crate) nodes: u64,
    /// Number of nodes of attempts to divide by edges of occluders.
    pub(crate) divided_nodes: u64,
    pub(crate) surfaces: u64,
    /// Number of linear programs that were solved.
    pub(crate) programs: u64,
}

/// Limits of the work for one target.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Budget {
    /// Greatest number of nodes of the search by halving polygons.
    pub(crate) nodes: u32,
    /// Greatest number of nodes of each attempt to divide a node by edges of occluders.
    pub(crate) divided: u32,
    /// Greatest number of halvings, within an attempt to divide by edges of occluders, on the way to any
    /// node.
    pub(crate) halvings: u32,
}

/// Number of halvings, of the viewcell or target polygon, after which a node is not halved further and stays
/// undecided.
pub(crate) const DEPTH: u32 = 28;
/// Number of halvings after which a node is first divided by occluder edges too, and then again after every
/// third further halving.
const DIVIDE_FROM: u32 = 3;
/// Greatest number of cuts of the viewcell polygon by planes of one-sided triangles on the way to a node.
/// Each cut rounds a corner four more times, which [`SceneTriangles::position_error`] allows for.
pub(crate) const SPLITS: u32 = 8;
/// Greatest number of triangles from which surfaces are grown at each node, among those that the node's
/// sample line crosses.
const STARTS: usize = 4;
/// Greatest number of triangles that are collected along a line that crosses them. With 8, viewcells in a
/// building took up to a third more nodes.
const HITS: usize = 16;

/// Index that stands for no triangle or no vertex.
pub(crate) const NONE: u32 = u32::MAX;

/// Searches for lines of sight from one viewcell to one target after the other. The target or node *at work*
/// is the one that the search is deciding.
pub(crate) struct Search<'a> {
    pub(crate) triangles: &'a SceneTriangles,
    pub(crate) cell: CellBox,
    /// Clearance of the settings in metres. 0 for none.
    pub(crate) clearance: f64,
    /// Bound in metres on the error of each coordinate of a position, for the target at work.
    pub(crate) delta: f64,
    /// Index of the target triangle in searches without clearance, which must not block lines to itself.
    /// [`NONE`] in other searches.
    pub(crate) skip: u32,
    /// Indices of the vertices at the corners of triangle `skip`. [`NONE`] in other searches.
    pub(crate) target_vertices: [u32; 3],
    /// Limits of the work for the target at work.
    pub(crate) budget: Budget,
    /// Number of nodes of `budget` used so far.
    used: u32,
    pub(crate) chain: ChainScratch,
    pub(crate) game: MatrixGame,
    /// Scratch memory for the matrix of a linear program.
    pub(crate) matrix: Matrix,
    /// Scratch memory for the indices of the triangles that a line crosses.
    pub(crate) hits: Vec<u32>,
    /// Nodes of the proof for the target at work, as far as it is found: see
    /// [`Proof::steps`](crate::proof::Proof).
    pub(crate) steps: Vec<Step>,
    pub(crate) stats: SearchStats,
    /// Index of the triangle from which the last surface that blocked a node was grown. The next node tries
    /// it first. [`NONE`] before the first such surface.
    pub(crate) hint: u32,
    /// Index of a one-sided triangle that blocks for only a part of the node's viewcell polygon, since the
    /// polygon is on both sides of its plane. [`NONE`] if there is none.
    pub(crate) across: u32,
    /// Function that is called at each node. The search ends once it returns true.
    pub(crate) stop: &'a dyn Fn() -> bool,
    /// Whether `stop` has returned true. Every further answer is then undecided.
    pub(crate) is_stopped: bool,
}

impl<'a> Search<'a> {
    /// Makes a search that has no target yet. `chain` is scratch memory of an earlier search in the same
    /// triangles.
    pub(crate) fn new(
        triangles: &'a SceneTriangles,
        cell: CellBox,
        clearance: f64,
        chain: Option<ChainScratch>,
    ) -> Self {
        let (count, edges) = (triangles.index_limit(), triangles.edge_count());
        Self {
            triangles,
            cell,
            clearance,
            delta: triangles.position_error(cell.magnitude() + 3.0 * clearance),
            skip: NONE,
            target_vertices: [NONE; 3],
            budget: Budget { nodes: 0, divided: 0, halvings: 0 },
            used: 0,
            chain: chain.unwrap_or_else(|| ChainScratch::new(count, edges)),
            game: MatrixGame::default(),
            matrix: Matrix::default(),
            hits: Vec::new(),
            steps: Vec::new(),
            stats: SearchStats::default(),
            hint: NONE,
            across: NONE,
            stop: &|| false,
            is_stopped: false,
        }
    }

    /// Decides a target. Returns the answer and the number of nodes used. After [`Answer::Hidden`] the proof
    /// is in [`steps`](Self::steps).
    pub(crate) fn solve_target(&mut self, target: Target, budget: Budget) -> (Answer, u32) {
        if !self.begin(target, budget) {
            return (Answer::Undecided, 0);
        }
        let mut answer = Answer::Hidden;
        let all = sights(self.triangles, &self.cell, target, self.clearance, self.pad());
        let Some(all) = all else { return (Answer::Undecided, self.used) };
        for sight in all {
            match self.node(&sight, 0, 0) {
                Answer::Hidden => {}
                Answer::Visible(line) => return (Answer::Visible(line), self.used),
                Answer::Undecided => {
                    answer = Answer::Undecided;
                    if self.used >= budget.nodes {
                        break;
                    }
                }
            }
        }
        (answer, self.used)
    }

    /// Returns whether the search must end because `stop` has returned true.
    pub(crate) fn must_stop(&mut self) -> bool {
        self.is_stopped = self.is_stopped || (self.stop)();
        self.is_stopped
    }

    /// Returns the height over a plane, in metres, up to which a computed point may be on the plane. See
    /// [`Shaft`].
    pub(crate) fn pad(&self) -> f64 {
        4.0 * self.delta
    }

    /// Prepares the search for a target. Returns false if the clearance is within the error of positions.
    pub(crate) fn begin(&mut self, target: Target, budget: Budget) -> bool {
        (self.skip, self.target_vertices) = (NONE, [NONE; 3]);
        if let Target::Triangle(t) = target
            && self.clearance == 0.0
        {
            (self.skip, self.target_vertices) = (t, self.triangles.vertices(t));
        }
        (self.budget, self.used) = (budget, 0);
        self.steps.clear();
        let delta = position_error(self.triangles, &self.cell, target, self.clearance);
        self.delta = delta.unwrap_or(f64::INFINITY);
        delta.is_some()
    }

    /// Decides the target of a proof again, of which some steps no longer hold: those whose position in the
    /// proof is set in `fallen`. Only the smallest nodes without further edges that contain such a step are
    /// searched; all other steps are taken from the proof. The answer and the steps are as those of
    /// [`solve_target`](Self::solve_target).
    pub(crate) fn mend(&mut self, proof: &Proof, fallen: &[bool], budget: Budget) -> (Answer, u32) {
        if !self.begin(proof.target, budget) {
            return (Answer::Undecided, 0);
        }
        let all = sights(self.triangles, &self.cell, proof.target, self.clearance, self.pad());
        let Some(all) = all else { return (Answer::Undecided, 0) };
        let mut rest = Steps { steps: &proof.steps, fallen };
        for sight in all {
            match self.mend_node(&sight, &mut rest, 0, 0) {
                Answer::Hidden => {}
                answer => return (answer, self.used),
            }
        }
        (Answer::Hidden, self.used)
    }

    /// Decides a node whose steps are the first of `rest`, and removes these from `rest`.
    fn mend_node(&mut self, sight: &Sight, rest: &mut Steps<'_>, depth: u32, splits: u32) -> Answer {
        let (Some(step), Some(is_fallen)) = (rest.steps.first(), rest.fallen.first()) else {
            return Answer::Undecided;
        };
        let node = rest.peek_node();
        if !node.fallen.contains(&true) {
            self.steps.extend_from_slice(node.steps);
            rest.skip(node.steps.len());
            return Answer::Hidden;
        }
        let parts = match step {
            _ if *is_fallen => None,
            Step::Halves { of_p, across } => Some((sight.halves(*of_p, *across), [depth + 1, splits])),
            Step::Split { triangle } => {
                let front = self.triangles.front(*triangle);
                let parts = front.and_then(|front| sight.split(front, self.clearance, self.pad()));
                parts.map(|parts| (parts, [depth, splits + 1]))
            }
            _ => None,
        };
        let Some((parts, [depth, splits])) = parts else {
            rest.skip(node.steps.len());
            return self.node(sight, depth, splits);
        };
        self.steps.push(step.clone());
        rest.skip(1);
        for part in &parts {
            match self.mend_node(part, rest, depth, splits) {
                Answer::Hidden => {}
                answer => return answer,
            }
        }
        Answer::Hidden
    }

    /// Decides a node, which `depth` halvings and `splits` cuts of the viewcell polygon have led to.
    fn node(&mut self, sight: &Sight, depth: u32, splits: u32) -> Answer {
        if self.used >= self.budget.nodes || self.must_stop() {
            return Answer::Undecided;
        }
        self.used += 1;
        self.stats.nodes += 1;
        let mut hits = core::mem::take(&mut self.hits);
        // A sample line that misses all triangles is a line of sight. Otherwise a surface that blocks the
        // node is grown from each triangle that the line crosses.
        let line = self.crossed_line(sight, &mut hits);
        let mut obstacle = None;
        let mut answer = None;
        self.across = NONE;
        match line {
            Err(clear) => answer = Some(Answer::Visible(clear)),
            Ok(line) if !hits.is_empty() => {
                self.sort_starts(&mut hits);
                let shaft = Shaft::new(&sight.p, &sight.q, self.pad());
                for &start in hits.iter().take(STARTS) {
                    self.stats.surfaces += 1;
                    match self.close(sight, &shaft, start, line) {
                        Ok(step) => {
                            self.hint = start;
                            self.steps.push(step);
                            answer = Some(Answer::Hidden);
                            break;
                        }
                        Err(edge) => obstacle = obstacle.or(Some((edge, line))),
                    }
                }
            }
            Ok(_) => {}
        }
        self.hits = hits;
        if let Some(answer) = answer {
            return answer;
        }
        // A one-sided triangle blocks only segments from its front. A viewcell polygon on both sides of the
        // triangle's plane is cut along the plane.
        let triangle = self.across;
        if splits < SPLITS
            && triangle != NONE
            && let Some(front) = self.triangles.front(triangle)
            && let Some(parts) = sight.split(front, self.clearance, self.pad())
        {
            let step = Step::Split { triangle };
            return self.parts(step, parts, |search, part| search.node(part, depth, splits + 1));
        }
        // At some depths, the lines are divided by loops of edges, which can prove more than surfaces alone.
        if self.budget.divided > 0 && depth >= DIVIDE_FROM && (depth - DIVIDE_FROM).is_multiple_of(3) {
            let mut left = self.budget.divided;
            match self.divide(sight, &mut left) {
                Answer::Undecided => {}
                answer => return answer,
            }
        }
        if depth >= DEPTH {
            return Answer::Undecided;
        }
        self.halve(sight, depth, splits, obstacle)
    }

    /// Orders the triangles that a line crosses: first the one that blocked the last node, then by descending
    /// area.
    pub(crate) fn sort_starts(&self, hits: &mut [u32]) {
        hits.sort_unstable_by(|&a, &b| {
            self.triangles.area(b).total_cmp(&self.triangles.area(a)).then(a.cmp(&b))
        });
        if let Some(at) = hits.iter().position(|&hit| hit == self.hint) {
            hits.swap(0, at);
        }
    }

    /// Decides the halves of a node. `obstacle`: an edge that kept a surface from blocking the node, and the
    /// line from which the surface was grown. `None` if no surface was grown.
    fn halve(
        &mut self,
        sight: &Sight,
        depth: u32,
        splits: u32,
        obstacle: Option<(Obstacle, Segment)>,
    ) -> Answer {
        let Halving { of_p, across } = best_halving(sight, obstacle);
        let halves = sight.halves(of_p, across);
        let step = Step::Halves { of_p, across };
        self.parts(step, halves, |search, half| search.node(half, depth + 1, splits))
    }

    /// Decides both parts of a node. `step` is the step of the proof that divides the node; `node` decides a
    /// part.
    fn parts(&mut self, step: Step, parts: [Sight; 2], node: impl Fn(&mut Self, &Sight) -> Answer) -> Answer {
        let mark = self.steps.len();
        self.steps.push(step);
        let mut all = Answer::Hidden;
        for part in &parts {
            match node(self, part) {
                Answer::Hidden => {}
                Answer::Visible(line) => return Answer::Visible(line),
                Answer::Undecided => {
                    all = Answer::Undecided;
                    if self.used >= self.budget.nodes {
                        break;
                    }
                }
            }
        }
        if all != Answer::Hidden {
            self.steps.truncate(mark);
        }
        all
    }

    /// Returns whether a triangle blocks segments from all points of the viewcell polygon. Stores the
    /// triangle in [`across`](Self::across) if it is one-sided and the polygon is on both sides of its plane.
    pub(crate) fn blocks(&mut self, sight: &Sight, t: u32) -> bool {
        let Some(front) = self.triangles.front(t) else { return true };
        let facing = sight.facing(front, self.clearance, self.pad());
        if facing == Facing::Across {
            self.across = t;
        }
        facing == Facing::Before
    }

    /// Returns a segment through the middle of a node, and puts the triangles that it certainly crosses into
    /// `hits`. If the middle segment only touches edges, nearby segments are tried. `Err` with a segment that
    /// certainly misses all triangles.
    pub(crate) fn crossed_line(&self, sight: &Sight, hits: &mut Vec<u32>) -> Result<Segment, Segment> {
        let (p, q) = (sight.p.corners(), sight.q.corners());
        let mut line = self.middle(sight);
        for attempt in 0..3 {
            let unsure = self.probe(line, hits);
            if hits.is_empty() && !unsure {
                return Err(line);
            }
            if !hits.is_empty() {
                break;
            }
            let (k, m) = ((2 * attempt + 1) % p.len(), (attempt + 1) % q.len());
            line = self.segment(sight.p.center() * 0.9 + p[k] * 0.1, sight.q.center() * 0.87 + q[m] * 0.13);
        }
        Ok(line)
    }

    pub(crate) fn middle(&self, sight: &Sight) -> Segment {
        self.segment(sight.p.center(), sight.q.center())
    }

    /// Returns the segment from a point `p` of the viewcell to a point `q` of the target. `p` is moved into
    /// the viewcell if rounding has put it outside.
    pub(crate) fn segment(&self, p: DVec3, q: DVec3) -> Segment {
        Segment { p: p.clamp(self.cell.min, self.cell.max), q }
    }

    /// Collects up to [`HITS`] triangles that a segment certainly crosses. Returns whether the segment may
    /// meet other triangles.
    pub(crate) fn probe(&self, line: Segment, hits: &mut Vec<u32>) -> bool {
        self.triangles.tree.crossed(line.p, line.q, self.skip, HITS, hits)
    }
}

/// The steps of a proof that have not been visited, and for each whether it no longer holds.
#[derive(Clone, Copy)]
struct Steps<'a> {
    steps: &'a [Step],
    fallen: &'a [bool],
}

impl Steps<'_> {
    /// Returns the steps of the first node: its own, and those of all its parts.
    fn peek_node(self) -> Self {
        let (mut nodes, mut count) = (1, 0);
        while nodes > 0
            && let Some(step) = self.steps.get(count)
        {
            nodes = nodes - 1 + step.parts();
            count += 1;
        }
        Self { steps: &self.steps[..count], fallen: self.fallen.get(..count).unwrap_or(&[true]) }
    }

    fn skip(&mut self, count: usize) {
        self.steps = self.steps.get(count..).unwrap_or_default();
        self.fallen = self.fallen.get(count..).unwrap_or_default();
    }
}

/// A way to halve a node: which polygon, and in which direction.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Halving {
    pub(crate) of_p: bool,
    pub(crate) across: bool,
}

/// Chooses how to halve a node so that the lines of each half are more likely to pass an obstacle's edge on
/// one side only: halves the polygon that looks wider from the obstacle, in the direction in which the
/// polygon is wider across the obstacle's edge. Without an obstacle, halves the polygon with the longest
/// side.
pub(crate) fn best_halving(sight: &Sight, obstacle: Option<(Obstacle, Segment)>) -> Halving {
    let (mut at, mut edge) = (0.5, DVec3::ZERO);
    if let Some(([a, b], line)) = obstacle {
        let along = line.q - line.p;
        let place = |x: DVec3| ((x - line.p).dot(along) / along.length_squared()).clamp(0.02, 0.98);
        let mean = (place(a) + place(b) + place((a + b) * 0.5)) / 3.0;
        (at, edge) = (if mean.is_nan() { 0.5 } else { mean }, (b - a).normalize_or_zero());
    }
    let (p, q) = (sight.p.extent_across(edge), sight.q.extent_across(edge));
    let of_p = p.0 * (1.0 - at) >= q.0 * at;
    Halving { of_p, across: if of_p { p.1 } else { q.1 } }
}

impl Sight {
    /// Returns the node with one of its polygons halved: the viewcell polygon if `of_p`, else the target
    /// polygon. For `across` see [`Polygon::halves`](crate::polygon::Polygon::halves).
    pub(crate) fn halves(&self, of_p: bool, across: bool) -> [Self; 2] {
        if of_p {
            self.p.halves(across).map(|p| Self { p, ..*self })
        } else {
            self.q.halves(across).map(|q| Self { q, ..*self })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::half::Half;
    use crate::polygon::Polygon;
    use std::{vec, vec::Vec};
    use visibility_core::glam::Vec3;
    use visibility_core::{Aabb, Object, Scene};

    type Triangle = [Vec3; 3];

    /// Returns the two triangles of a rectangle across x.
    fn wall(x: f32, y: [f32; 2], z: [f32; 2]) -> Vec<Triangle> {
        let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| Vec3::new(x, y[i], z[j]));
        [[a, b, c], [a, c, d]].to_vec()
    }

    fn prepared(objects: &[Vec<Triangle>]) -> SceneTriangles {
        let mut scene = Scene::new();
        for triangles in objects {
            let bounds = Aabb::from_points(triangles.iter().flatten().copied());
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            scene.set_triangles(id, triangles.clone()).unwrap();
        }
        SceneTriangles::new(&scene)
    }

    const CELL: CellBox = CellBox { min: DVec3::ZERO, max: DVec3::ONE };

    /// A target behind a fence of slats in two rows that overlap by a hair.
    fn fence() -> SceneTriangles {
        let slats = (0..24u8).map(|k| {
            let y = f32::from(k) * 0.5 - 6.0;
            wall(5.0 + f32::from(k % 2) * 0.01, [y, y + 0.52], [-9.0, 9.0])
        });
        prepared(&[vec![wall(12.0, [0.0, 1.0], [0.0, 1.0])], slats.collect()].concat())
    }

    /// The search takes no more nodes than it is granted, and as many as it tells. What it cannot decide
    /// with them stays undecided.
    #[test]
    fn no_more_nodes_are_searched_than_granted() {
        let triangles = fence();
        let target = Target::Box { min: DVec3::new(12.0, 0.0, 0.0), max: DVec3::new(12.0, 1.0, 1.0) };
        let mut search = Search::new(&triangles, CELL, 1e-4, None);
        let mut needed = 0;
        for nodes in 0..200 {
            let before = search.stats.nodes;
            let (answer, used) = search.solve_target(target, Budget { nodes, divided: 0, halvings: 0 });
            assert_eq!(u64::from(used), search.stats.nodes - before, "nodes counted of {nodes}");
            assert!(used <= nodes, "{used} nodes of {nodes}");
            match answer {
                Answer::Hidden => {
                    assert!(
                        [0, used].contains(&needed),
                        "{used} nodes and {needed} nodes with fewer granted"
                    );
                    needed = used;
                }
                Answer::Undecided => assert_eq!((used, needed), (nodes, 0), "all nodes are used"),
                Answer::Visible(line) => panic!("the target is not seen along {line:?}"),
            }
        }
        assert!(needed > 1, "the target takes {needed} nodes");
    }

    /// After a stop, all is undecided.
    #[test]
    fn a_stop_ends_the_search() {
        let triangles = fence();
        for stop in [false, true] {
            let is_stopped = || stop;
            let mut search = Search::new(&triangles, CELL, 1e-4, None);
            search.stop = &is_stopped;
            let budget = Budget { nodes: 1000, divided: 100, halvings: 12 };
            let (answer, used) = search.solve_target(Target::Triangle(0), budget);
            assert_eq!(answer, if stop { Answer::Undecided } else { Answer::Hidden }, "stopped: {stop}");
            assert_eq!(used == 0, stop, "{used} nodes, stopped: {stop}");
        }
        // What has said stop once need not say so again.
        let calls = core::cell::Cell::new(0);
        let is_stopped = || {
            calls.set(calls.get() + 1);
            calls.get() == 2
        };
        let mut search = Search::new(&triangles, CELL, 1e-4, None);
        search.stop = &is_stopped;
        let stops = [(); 4].map(|()| search.must_stop());
        assert_eq!(stops, [false, true, true, true], "after one stop");
    }

    /// A line along the edge between two walls, or through a wall, is no line of sight.
    #[test]
    fn lines_that_touch_edges_are_no_lines_of_sight() {
        let walls = [wall(5.0, [-9.0, 0.5], [-9.0, 9.0]), wall(6.0, [0.5, 9.0], [-9.0, 9.0])];
        let triangles = prepared(&walls);
        let square = |x: f64, h: f64| {
            let corners = [[0.5, -h], [0.5, h], [0.5, 0.0]].map(|[y, z]| DVec3::new(x, y, 0.5 + z));
            Polygon::new(&corners)
        };
        let half = Half { normal: DVec3::X, offset: 0.0 };
        let search = Search::new(&triangles, CELL, 0.0, None);
        let mut hits = Vec::new();
        // All lines between the two polygons pass the walls along their edges.
        let sight =
            Sight { p: square(1.0, 0.25), q: square(12.0, 0.25), before_p: half, before_q: half, near: None };
        let found = search.crossed_line(&sight, &mut hits);
        assert!(
            found.is_ok() && hits.is_empty(),
            "lines along edges cross nothing, and see nothing: {found:?}"
        );
        let beside = |y: f64| Sight {
            q: Polygon::new(
                &square(12.0, 0.25).corners().iter().map(|q| *q + DVec3::Y * y).collect::<Vec<_>>(),
            ),
            ..sight
        };
        assert!(search.crossed_line(&beside(1.0), &mut hits).is_ok() && hits.len() == 1, "a wall is crossed");
        let open = Search::new(&triangles, CELL, 0.0, None);
        let above = |y: f64| Sight { p: square(5.5, 0.25), ..beside(y) };
        let clear = open.crossed_line(&above(-1.0), &mut hits);
        assert!(clear.is_ok(), "the start of a line of sight is moved into the viewcell: {clear:?}");
    }

    /// The polygon that looks wider from an obstacle is halved, in the direction across the obstacle's edge.
    #[test]
    fn halves_part_the_lines_on_either_side_of_an_obstacle() {
        let square = |x: f64, y: f64, z: f64| {
            let corners = [[0.0, 0.0], [y, 0.0], [y, z], [0.0, z]].map(|[y, z]| DVec3::new(x, y, z));
            Polygon::new(&corners)
        };
        let half = Half { normal: DVec3::X, offset: 0.0 };
        let sight = |p: Polygon, q: Polygon| Sight { p, q, before_p: half, before_q: half, near: None };
        let line = Segment { p: DVec3::ZERO, q: DVec3::X * 10.0 };
        let edge = |x: f64, along: DVec3| Some(([DVec3::X * x - along, DVec3::X * x + along], line));
        let halving = |of_p: bool, across: bool| Halving { of_p, across };
        let same = sight(square(0.0, 2.0, 1.0), square(10.0, 2.0, 1.0));
        // An edge near to one polygon looks past the other, which is halved across the edge.
        for (x, along, expected) in [
            (1.0, DVec3::Z, halving(true, false)),
            (1.0, DVec3::Y, halving(true, true)),
            (9.0, DVec3::Z, halving(false, false)),
            (9.0, DVec3::Y, halving(false, true)),
        ] {
            assert_eq!(best_halving(&same, edge(x, along)), expected, "an edge along {along} at {x}");
        }
        let [wide_p, wide_q] = [(9.0, 2.0), (2.0, 9.0)]
            .map(|(p, q)| best_halving(&sight(square(0.0, p, 1.0), square(10.0, q, 1.0)), None).of_p);
        assert_eq!([wide_p, wide_q], [true, false], "without an edge, the longer polygon is halved");
    }
}
