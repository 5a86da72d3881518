//! Decides all objects of a scene as seen from one viewcell: by rays first, then by proofs for groups of
//! objects that no ray has found, for single objects, and for their triangles.
//!
//! This work is based on: Shaun Nirenstein, Edwin Blake and James Gain, "Exact From-Region Visibility
//! Culling", 2002: its query architecture, which samples first, tests groups before their members and ends
//! early.

mod prices;
mod search_again;
#[cfg(test)]
mod tests;

use crate::chain_scratch::ChainScratch;
use crate::half::Half;
use crate::polygon::Polygon;
use crate::proof::Proof;
use crate::rays::{in_triangle, on_cube};
use crate::search::{Answer, Budget, Search, Segment};
use crate::settings::ExactSettings;
use crate::sight::{CellBox, Target};
use crate::triangles::SceneTriangles;
use crate::verdict::{CellVerdicts, ProvenHidden, Verdict, Witness};
use alloc::{vec, vec::Vec};
use prices::Prices;
use visibility_core::ObjectId;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::random::Random;

/// Budget of the search for a line of sight or a proof for one triangle of an object.
const TRIANGLE: Budget = Budget { nodes: 1500, divided: 200, halvings: 12 };
/// Number of search nodes after which no further triangle of an object gets a first look.
const ALL_TRIANGLES: u32 = 8000;
/// Budget of a first look at each triangle of an object in a quick search, which gives up an object early.
const QUICK: Budget = Budget { nodes: 400, ..TRIANGLE };
/// Budget of the proof that a box around a part of an object's triangles is hidden. Few boxes hide a large
/// mesh behind several walls; its triangles one by one would take more nodes than are granted.
const PART: Budget = Budget { nodes: 100, divided: 50, halvings: 12 };
/// Greatest number of search nodes for boxes around the parts of one object, in a quick search.
const QUICK_PARTS: u32 = 1000;
/// Greatest number of search nodes for boxes around the parts of one object, in a full search.
const ALL_PARTS: u32 = 4000;
/// Greatest number of search nodes for boxes around parts of an object while no part is proven hidden. Most
/// objects that no ray finds are seen through a gap and have no hidden part.
const FIRST_PARTS: u32 = 400;
/// Search nodes granted for further parts of an object, for each triangle of a part proven hidden.
const PART_TRIANGLE: u32 = 16;
/// Least number of triangles in a part of an object that is tried by its bounding box.
const PART_TRIANGLES: usize = 16;
/// Budget of a second look at each triangle of an object whose other triangles are all hidden. Where
/// occluders meet in a corner and overlap by little more than the clearance, segments must be divided finely
/// before a proof succeeds.
const PATIENT: Budget = Budget { nodes: 600, divided: 1500, halvings: 30 };
/// Number of search nodes after which no further triangle of an object gets a second look.
const ALL_PATIENT: u32 = 4000;
/// Number of rays that are cast past the box of an object when a ray has just found it, since the next
/// visible object is often beside it.
const PAST: u32 = 32;
/// Greatest number of search nodes for the bound on the visible share of one object (the share of the
/// segments to its box that are unblocked).
const SHARE: u32 = 2000;

/// Query of the objects that one viewcell sees, in steps: rays, proofs for boxes, proofs for triangles. Each
/// step works on the objects that its caller asks about and that are still [open](Verdict::Open).
/// [`ExactCuller`](crate::ExactCuller) takes all steps for all objects; a bake with a budget chooses.
///
/// ```
/// use visibility_core::{glam::{DVec3, Vec3}, pvs::Viewcell, Aabb, Object, Scene};
/// use visibility_exact::{CellQuery, Effort, SceneTriangles, ExactSettings, Verdict};
/// let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|v| v + Vec3::Z * 9.0);
/// let mut scene = Scene::new();
/// let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points(triangle)) });
/// scene.set_triangles(id, [triangle])?;
/// let triangles = SceneTriangles::new(&scene);
/// let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
/// let mut query = CellQuery::new(&triangles, &cell, ExactSettings::new(Effort::Exact(1e-4))).unwrap();
/// query.look(&|_| true);
/// assert!(query.verdicts().all(|(_, verdict)| matches!(verdict, Verdict::Seen(_))));
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
pub struct CellQuery<'a> {
    pub(crate) search: Search<'a>,
    settings: ExactSettings,
    random: Random,
    pub(crate) verdicts: Vec<Verdict>,
    pub(crate) proofs: Vec<ProvenHidden>,
    proof_count: u64,
    rays: u64,
    refused: u64,
    prices: Prices,
}

impl core::fmt::Debug for CellQuery<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("CellQuery").field("settings", &self.settings).finish_non_exhaustive()
    }
}

impl<'a> CellQuery<'a> {
    /// Prepares a query. All objects are open. `None` for a viewcell that is empty, not finite, or beyond
    /// 1e30 metres from the scene's origin.
    pub fn new(triangles: &'a SceneTriangles, cell: &Viewcell, settings: ExactSettings) -> Option<Self> {
        Some(Self::with_scratch(triangles, CellBox::new(cell, triangles.origin)?, settings, None))
    }

    /// Prepares a query that reuses `scratch`, memory of an earlier query of the same triangles.
    pub(crate) fn with_scratch(
        triangles: &'a SceneTriangles,
        cell: CellBox,
        settings: ExactSettings,
        scratch: Option<ChainScratch>,
    ) -> Self {
        // A clearance within the error of positions counts as 0, since it would not part touching surfaces.
        // This is safe: an object hidden with clearance 0 is hidden with any clearance.
        let c = settings.clearance;
        let is_usable = c >= 64.0 * triangles.position_error(cell.magnitude() + 3.0 * c);
        let search = Search::new(triangles, cell, if is_usable { c } else { 0.0 }, scratch);
        let seed = cell.min.to_array().into_iter().chain(cell.max.to_array());
        let seed = seed.fold(1, |seed, x| Random(seed ^ x.to_bits()).bits());
        let verdicts = vec![Verdict::Open; triangles.objects.len()];
        Self {
            search,
            settings,
            random: Random(seed),
            verdicts,
            proofs: Vec::new(),
            proof_count: 0,
            rays: 0,
            refused: 0,
            prices: Prices::default(),
        }
    }

    /// Sets a function that the query calls many times a second while it works. Once `stop` has returned
    /// true, the query ends, and undecided objects stay open.
    #[must_use]
    pub fn with_stop(mut self, stop: &'a dyn Fn() -> bool) -> Self {
        self.search.stop = stop;
        self
    }

    /// Returns whether the query has ended because its [stop function](Self::with_stop) returned true.
    pub fn is_stopped(&self) -> bool {
        self.search.is_stopped
    }

    /// Marks open objects as seen if they reach into the viewcell or if a ray from the viewcell meets them
    /// first. Works on the objects for which `is_asked` is true, with as many rays as the settings say.
    pub fn look(&mut self, is_asked: &dyn Fn(ObjectId) -> bool) {
        let open = self.asked(is_asked);
        self.look_at(open);
    }

    /// Tries to prove the open objects for which `is_asked` is true hidden by their bounding boxes: first by
    /// boxes around groups, then by the box of each object. Objects that this search happens to see are
    /// marked as seen.
    pub fn prove_boxes(&mut self, is_asked: &dyn Fn(ObjectId) -> bool) {
        let open = self.asked(is_asked);
        self.groups(open);
    }

    /// Decides the open objects for which `is_asked` is true by their triangles, the largest first. Parts of
    /// objects with many triangles are first tried by boxes around the parts. Takes some hundred times the
    /// work of [`prove_boxes`](Self::prove_boxes), so that step should come first.
    pub fn prove_triangles(&mut self, is_asked: &dyn Fn(ObjectId) -> bool) {
        let open = self.asked(is_asked);
        self.triangles(&open, false);
    }

    /// Decides objects by their triangles as [`prove_triangles`](Self::prove_triangles) does, but leaves an
    /// object open at the first triangle that is not decided quickly. Takes a tenth of the work where nothing
    /// can be proven.
    pub fn try_triangles(&mut self, is_asked: &dyn Fn(ObjectId) -> bool) {
        let open = self.asked(is_asked);
        self.triangles(&open, true);
    }

    /// Returns the objects and the verdict on each: in ascending order of index, until a
    /// [`sync`](SceneTriangles::sync) has added objects.
    pub fn verdicts(&self) -> impl Iterator<Item = (ObjectId, Verdict)> {
        let verdicts = self.search.triangles.objects.iter().zip(self.verdicts.iter().copied());
        verdicts.filter(|(object, _)| !object.is_removed).map(|(object, verdict)| (object.id, verdict))
    }

    /// Returns the work done so far: the number of rays plus the number of nodes of the search for proofs.
    pub fn steps(&self) -> u64 {
        self.rays + self.nodes()
    }

    /// Takes all steps that the settings ask for, for the objects for which `is_asked` is true. `is_asked`
    /// gets the position of an object in the list of objects of the [`SceneTriangles`]. The other objects,
    /// and objects undecided at the end, are [`Verdict::Open`]. Returns the verdicts, and scratch memory for
    /// the next query.
    pub(crate) fn run(mut self, is_asked: &dyn Fn(usize) -> bool) -> (CellVerdicts, ChainScratch) {
        let asked = self.usable(is_asked);
        let mut open = self.look_at(asked);
        if self.settings.proves {
            let not_seen = open.iter().copied().filter(|&o| self.is_open(o)).collect();
            let single = self.groups(not_seen);
            if self.settings.share > 0.0 {
                open.retain(|&o| self.verdicts[o as usize] != Verdict::Hidden);
                self.hardly_visible(&open);
            } else {
                self.triangles(&single, false);
            }
        }
        let (nodes, is_decided) = (self.nodes(), !self.is_stopped());
        let Self { search, verdicts, proofs, proof_count, rays, refused, .. } = self;
        (CellVerdicts { verdicts, proofs, proof_count, rays, nodes, refused, is_decided }, search.chain)
    }

    fn nodes(&self) -> u64 {
        self.search.stats.nodes + self.search.stats.divided_nodes
    }

    /// Returns the indices in `verdicts` of the objects that are open and for which `is_asked` is true.
    fn asked(&self, is_asked: &dyn Fn(ObjectId) -> bool) -> Vec<u32> {
        self.usable(|place| {
            self.verdicts[place] == Verdict::Open && is_asked(self.search.triangles.objects[place].id)
        })
    }

    /// Returns the indices in `verdicts` of the objects for which `is_asked` is true and whose coordinates
    /// are all finite and in range.
    fn usable(&self, is_asked: impl Fn(usize) -> bool) -> Vec<u32> {
        let objects = &self.search.triangles.objects;
        (0..objects.len() as u32).filter(|&o| is_asked(o as usize) && !objects[o as usize].is_open).collect()
    }

    /// Marks the objects of `open` that reach into the viewcell as seen, and casts rays at the remaining
    /// objects of `open`. Returns these remaining objects, whether a ray has seen them or not.
    fn look_at(&mut self, mut open: Vec<u32>) -> Vec<u32> {
        open.retain(|&o| !self.find_inside(o as usize));
        if !open.is_empty() {
            self.uniform_rays();
            self.aimed_rays(&open, self.settings.aimed_rays);
        }
        open
    }

    fn is_open(&self, object: u32) -> bool {
        self.verdicts[object as usize] == Verdict::Open
    }

    /// Looks for a point of an object in the viewcell. Marks the object as seen and returns true if such a
    /// point is found.
    fn find_inside(&mut self, object: usize) -> bool {
        let entry = &self.search.triangles.objects[object];
        if !self.search.cell.meets(entry.min, entry.max) {
            return false;
        }
        for t in entry.first..entry.end {
            let (triangles, cell) = (self.search.triangles, self.search.cell);
            let is_before = |front: &Half| front.height(cell.farthest(front)) > 0.0;
            if triangles.front(t).is_none_or(is_before)
                && let Some(point) = point_inside(&cell, &triangles.corners(t))
            {
                self.verdicts[object] = Verdict::Seen(Witness { from: point, to: point, triangle: t });
                return true;
            }
        }
        false
    }

    /// Casts rays in uniform directions. When a ray finds a new object, casts further rays from the same
    /// start past the object's box, since the next visible object is often beside it.
    fn uniform_rays(&mut self) {
        let mut left = self.settings.rays;
        let mut found = Vec::new();
        while left > 0 && !self.search.must_stop() {
            left -= 1;
            self.rays += 1;
            let (p, d) = self.search.cell.uniform_ray(&mut self.random);
            found.extend(self.see_first(p, d).map(|object| (p, object)));
            while let Some((p, object)) = found.pop() {
                if self.search.must_stop() {
                    return;
                }
                let entry = &self.search.triangles.objects[object];
                let (center, half) = ((entry.min + entry.max) * 0.5, (entry.max - entry.min) * 0.5);
                for _ in 0..PAST.min(left) {
                    left -= 1;
                    self.rays += 1;
                    let part = self.random.unit();
                    let wider = 1.05 + 2.0 * part * part;
                    let to = center + half * wider * on_cube(&mut self.random);
                    let from = self.search.cell.exit(p, to);
                    found.extend(self.see_first(from, to - from).map(|object| (from, object)));
                }
            }
        }
    }

    /// Casts a ray from `p` along `d`, marks the object that the ray meets first as seen, and returns the
    /// object's index in `verdicts`. `None` if no object is newly seen: the ray meets nothing, may be
    /// blocked, or meets an object that has a verdict.
    fn see_first(&mut self, p: DVec3, d: DVec3) -> Option<usize> {
        let (distance, t) = self.search.triangles.tree.nearest(p, d)?;
        self.see(p, p + d * distance, t).then(|| self.search.triangles.object_of(t))
    }

    /// Marks the object of triangle `t` as seen from `from`, unless it was seen before or the segment to `to`
    /// may meet another triangle. Returns whether the object was marked.
    fn see(&mut self, from: DVec3, to: DVec3, t: u32) -> bool {
        let object = self.search.triangles.object_of(t);
        if self.verdicts[object] != Verdict::Open || !self.search.triangles.shows(t, from) {
            return false;
        }
        // The search for one crossed triangle ends uncertain if it finds one.
        let is_clear = !self.search.triangles.tree.crossed(from, to, t, 1, &mut self.search.hits);
        if is_clear {
            self.verdicts[object] = Verdict::Seen(Witness { from, to, triangle: t });
        }
        is_clear
    }

    /// Casts up to `rays` rays at each of the objects `open`, until one sees it.
    fn aimed_rays(&mut self, open: &[u32], rays: u32) {
        for &object in open {
            if self.search.must_stop() {
                return;
            }
            let entry = &self.search.triangles.objects[object as usize];
            let (first, count) = (entry.first, (entry.end - entry.first) as usize);
            for _ in 0..rays {
                if count == 0 || !self.is_open(object) {
                    break;
                }
                self.rays += 1;
                let t = first + self.random.below(count) as u32;
                let to = in_triangle(&mut self.random, &self.search.triangles.corners(t));
                let from = self.search.cell.towards(to, &mut self.random);
                self.see(from, to, t);
            }
        }
    }

    /// Computes a bound on the visible share of each object, and marks the object as hardly visible if the
    /// bound is at most the share in the settings. Skips an object without a bound if more than twice that
    /// share of the rays aimed at it see it, since its bound would then hardly be small enough.
    fn hardly_visible(&mut self, objects: &[u32]) {
        for &object in objects {
            if self.search.must_stop() {
                return;
            }
            let entry = &self.search.triangles.objects[object as usize];
            let (min, max, first, count) = (entry.min, entry.max, entry.first, entry.end - entry.first);
            if self.meets_cell(min, max) || count == 0 {
                continue;
            }
            let mut reached = 0;
            for _ in 0..self.settings.aimed_rays {
                self.rays += 1;
                let t = first + self.random.below(count as usize) as u32;
                let to = in_triangle(&mut self.random, &self.search.triangles.corners(t));
                let from = self.search.cell.towards(to, &mut self.random);
                let is_clear = !self.search.triangles.tree.crossed(from, to, t, 1, &mut self.search.hits);
                reached += u32::from(is_clear && self.search.triangles.shows(t, from));
            }
            if f64::from(reached) <= 2.0 * self.settings.share * f64::from(self.settings.aimed_rays) {
                let share = self.search.share(Target::Box { min, max }, self.settings.share, SHARE);
                if share <= self.settings.share {
                    self.verdicts[object as usize] = Verdict::Hardly(share);
                }
            }
        }
    }

    /// Returns whether a box meets the viewcell, or is too close to it to be a target: within two clearances
    /// on each axis.
    ///
    /// Two clearances, since a search moves the faces of its target towards the viewcell by one clearance,
    /// and must find them outside of the viewcell still. The second clearance is a margin for rounding: it is
    /// at least 64 times the error of positions. Without a clearance, it is enough that the boxes do not
    /// touch: their faces are exact, and the search and the check of proofs have margins of their own.
    fn meets_cell(&self, min: DVec3, max: DVec3) -> bool {
        let pad = DVec3::splat(2.0 * self.search.clearance);
        self.search.cell.meets(min - pad, max + pad)
    }

    /// Tries to prove the objects of `list` hidden, in groups, by a box around each group. A group that is
    /// not proven hidden is halved. Returns the objects that are still open after their own box was tried.
    fn groups(&mut self, mut list: Vec<u32>) -> Vec<u32> {
        let mut left = Vec::new();
        let mut stack = vec![(0, list.len())];
        while let Some((start, end)) = stack.pop() {
            if self.search.must_stop() {
                break;
            }
            // Objects that an earlier step marked as seen or hidden leave the group.
            let group = &mut list[start..end];
            group.sort_by_key(|&o| !self.is_open(o));
            let count = group.partition_point(|&o| self.is_open(o));
            let group = &mut group[..count];
            let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            for &o in group.iter() {
                let object = &self.search.triangles.objects[o as usize];
                (min, max) = (min.min(object.min), max.max(object.max));
            }
            if count == 0 || self.prove_box(group, min, max) {
                continue;
            }
            if let &mut [single] = group {
                left.extend(self.is_open(single).then_some(single));
                continue;
            }
            // The group is halved at the median of its box centres, along the longest axis of its box.
            let extent = max - min;
            let axis = extent.max_position();
            let objects = &self.search.triangles.objects;
            let key = |o: u32| objects[o as usize].min[axis] + objects[o as usize].max[axis];
            group.sort_by(|&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
            stack.push((start, start + count / 2));
            stack.push((start + count / 2, start + count));
        }
        left
    }

    /// Tries to prove a group hidden by the box from `min` to `max`, which holds all its objects. Returns
    /// true if the group is proven hidden. If the search finds a line of sight instead, the first object on
    /// that line is marked as seen.
    fn prove_box(&mut self, group: &[u32], min: DVec3, max: DVec3) -> bool {
        if self.meets_cell(min, max) {
            return false;
        }
        let target = Target::Box { min, max };
        let budget = self.prices.budget(group.len());
        let (answer, used) = self.solve(target, budget);
        self.prices.add(group.len(), budget, used, answer);
        match answer {
            Answer::Hidden => {
                self.hide(group, &[target]);
                true
            }
            Answer::Visible(line) => {
                self.see_first(line.p, line.q - line.p);
                false
            }
            Answer::Undecided => false,
        }
    }

    /// Decides a target, and returns the answer and the number of search nodes used. A target counts as
    /// hidden only if the proof passes its check, which shares no code with the search. A refused proof is
    /// counted, and leaves the target undecided.
    fn solve(&mut self, target: Target, budget: Budget) -> (Answer, u32) {
        let (answer, used) = self.search.solve_target(target, budget);
        (self.checked(target, answer), used)
    }

    /// Checks the proof that the last search, for `target`, has ended with, if its answer is hidden. Returns
    /// the answer, or undecided after a refused proof.
    fn checked(&mut self, target: Target, mut answer: Answer) -> Answer {
        if answer == Answer::Hidden {
            let proof = self.proof(target);
            match proof.check(self.search.triangles) {
                Ok(()) => self.proof_count += 1,
                Err(_) => {
                    self.refused += 1;
                    answer = Answer::Undecided;
                }
            }
            self.search.steps = proof.steps;
        }
        answer
    }

    /// Marks the objects of `group` as hidden. `targets` must be the one target of the last search, whose
    /// proof is stored if the settings keep proofs.
    fn hide(&mut self, group: &[u32], targets: &[Target]) {
        if self.settings.keep_proofs {
            let proofs = targets.iter().map(|&target| self.proof(target)).collect();
            self.proofs.push(ProvenHidden { objects: group.into(), proofs });
        }
        for &o in group {
            self.verdicts[o as usize] = Verdict::Hidden;
        }
    }

    fn proof(&mut self, target: Target) -> Proof {
        let steps = core::mem::take(&mut self.search.steps);
        Proof { cell: self.search.cell, target, clearance: self.search.clearance, steps }
    }

    /// Decides open objects one by one, by their triangles, the largest triangle first. `is_quick`: true for
    /// a small budget per triangle, and an object is given up at its first undecided triangle; false for the
    /// full budget.
    fn triangles(&mut self, objects: &[u32], is_quick: bool) {
        for &object in objects {
            if self.is_open(object) && !self.search.must_stop() {
                self.object_by_triangles(object, is_quick);
            }
        }
    }

    fn object_by_triangles(&mut self, object: u32, is_quick: bool) {
        let entry = &self.search.triangles.objects[object as usize];
        if entry.first == entry.end {
            return;
        }
        let triangles = self.search.triangles;
        let mut order: Vec<u32> = (entry.first..entry.end).collect();
        let mut proofs = Vec::new();
        self.hide_parts(&mut order, &mut proofs, if is_quick { QUICK_PARTS } else { ALL_PARTS });
        if !self.is_open(object) {
            return;
        }
        order.sort_unstable_by(|&a, &b| triangles.area(b).total_cmp(&triangles.area(a)).then(a.cmp(&b)));
        let (cell, c) = (self.search.cell, self.search.clearance);
        let pad = 4.0 * triangles.position_error(cell.magnitude() + 3.0 * c) + 2.0 * c;
        let first = if is_quick { QUICK } else { TRIANGLE };
        for (budget, most) in [(first, ALL_TRIANGLES), (PATIENT, ALL_PATIENT)] {
            let mut spent = 0;
            let mut left = Vec::new();
            for t in order {
                let corners = triangles.corners(t);
                if spent > most || self.search.is_stopped || !is_apart(&cell, &corners, pad) {
                    return;
                }
                let (answer, used) = self.solve(Target::Triangle(t), budget);
                spent += used;
                match answer {
                    // A triangle without area is a segment, which may be on the side of no other triangle: it
                    // stays undecided.
                    Answer::Hidden if triangles.area(t) > 0.0 => {
                        if self.settings.keep_proofs {
                            proofs.push(self.proof(Target::Triangle(t)));
                        }
                    }
                    Answer::Visible(Segment { p, q }) if triangles.shows(t, p) => {
                        let witness = Witness { from: p, to: q, triangle: t };
                        self.verdicts[object as usize] = Verdict::Seen(witness);
                        return;
                    }
                    _ if is_quick => return,
                    _ => left.push(t),
                }
            }
            if left.is_empty() {
                self.verdicts[object as usize] = Verdict::Hidden;
                if self.settings.keep_proofs {
                    self.proofs.push(ProvenHidden { objects: [object].into(), proofs });
                }
                return;
            }
            order = left;
        }
    }

    /// Tries to prove parts of an object hidden, by boxes around groups of its triangles. A part that is not
    /// proven hidden is halved. Tries no further part once more than `most` search nodes are used. Removes
    /// the triangles of hidden parts from `order`, and appends the proofs to `proofs`.
    fn hide_parts(&mut self, order: &mut Vec<u32>, proofs: &mut Vec<Proof>, most: u32) {
        let triangles = self.search.triangles;
        let count = order.len();
        let (mut stack, mut spent, mut left) = (vec![(0, count)], 0, Vec::new());
        let (all, mut most) = (most, most.min(FIRST_PARTS));
        while let Some((start, end)) = stack.pop() {
            let part = &mut order[start..end];
            let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            for corner in part.iter().flat_map(|&t| triangles.corners(t)) {
                (min, max) = (min.min(corner), max.max(corner));
            }
            // The box around all triangles of the object has been tried before, without success.
            let is_part = part.len() < count;
            let is_asked = is_part && spent <= most && !self.search.is_stopped && !self.meets_cell(min, max);
            if is_asked {
                let target = Target::Box { min, max };
                let (answer, used) = self.solve(target, PART);
                spent += used;
                // Each part proven hidden earns nodes for further parts. Without success the search soon
                // ends.
                match answer {
                    Answer::Hidden => {
                        if self.settings.keep_proofs {
                            proofs.push(self.proof(target));
                        }
                        most = all.min(most.saturating_add(PART_TRIANGLE.saturating_mul(part.len() as u32)));
                        continue;
                    }
                    Answer::Visible(line) => {
                        self.see_first(line.p, line.q - line.p);
                    }
                    Answer::Undecided => {}
                }
            }
            // Small parts are left to the search triangle by triangle.
            if part.len() < 2 * PART_TRIANGLES || spent > most {
                left.extend_from_slice(part);
                continue;
            }
            let axis = (max - min).max_position();
            let key = |t: u32| triangles.corners(t).iter().map(|p| p[axis]).sum::<f64>();
            part.sort_by(|&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
            let middle = start + part.len() / 2;
            stack.extend([(start, middle), (middle, end)]);
        }
        *order = left;
    }
}

/// Returns a point of triangle `t` that lies in the viewcell, up to rounding. `None` if none is found.
fn point_inside(cell: &CellBox, t: &[DVec3; 3]) -> Option<DVec3> {
    let inside = |p: &DVec3| p.cmpge(cell.min).all() && p.cmple(cell.max).all();
    if let Some(corner) = t.iter().find(|p| inside(p)) {
        return Some(*corner);
    }
    let mut polygon = Polygon::new(t);
    for axis in 0..3 {
        polygon = polygon.clip(&Half { normal: DVec3::AXES[axis], offset: -cell.min[axis] })?;
        polygon = polygon.clip(&Half { normal: -DVec3::AXES[axis], offset: cell.max[axis] })?;
    }
    let center = polygon.center();
    inside(&center).then_some(center)
}

/// Returns whether a triangle is certainly farther than `pad` from the viewcell.
fn is_apart(cell: &CellBox, t: &[DVec3; 3], pad: f64) -> bool {
    let (min, max) = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
    if !cell.meets(min - pad, max + pad) {
        return true;
    }
    let corners: [DVec3; 8] = core::array::from_fn(|i| {
        let at = |axis: usize| if i >> axis & 1 == 1 { cell.max[axis] } else { cell.min[axis] };
        DVec3::new(at(0), at(1), at(2))
    });
    // The axes of the box were tried above. Next come the triangle's normal and the cross products of its
    // sides with the axes.
    let normal = (t[1] - t[0]).cross(t[2] - t[0]);
    let sides = [t[1] - t[0], t[2] - t[1], t[0] - t[2]];
    let crosses = sides.iter().flat_map(|side| DVec3::AXES.map(|axis| axis.cross(*side)));
    crosses.chain([normal]).any(|normal| {
        let normal = normal.normalize_or_zero();
        let range = |points: &[DVec3]| {
            points.iter().map(|x| normal.dot(*x)).fold((f64::MAX, f64::MIN), |(a, b), h| (a.min(h), b.max(h)))
        };
        let ((a, b), (c, d)) = (range(&corners), range(t));
        a > d + pad || b < c - pad
    })
}
