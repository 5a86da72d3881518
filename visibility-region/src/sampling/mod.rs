//! Visibility from a region by sampling: rays from the viewcell, sent where they are likely to find objects.
//! Objects that no ray meets count as hidden, so the result is a lower bound of the visible set.
//!
//! This work is based on: Wonka, Wimmer, Zhou, Maierhofer, Hesina and Reshetov, "Guided Visibility Sampling",
//! 2006, and on Gotsman, Sudarsky and Fayman, "Optimized Occlusion Culling Using Five-Dimensional
//! Subdivision", 1999, for the idea of sampling a viewcell.
//!
//! 1. Cubes of rays from the corners and the middle of the viewcell, and random rays.
//! 2. Border sampling: rays just past the corners and edges of a found triangle, from the viewpoint that
//!    found it. Triangles that these rays find are sampled in turn.
//! 3. Reverse sampling: where a blocker ends a ray before its target point, a ray is sent from the target
//!    point past an edge of the blocker back to the viewcell. This finds gaps that are visible only from a
//!    small part of the viewcell.
//! 4. Rays to objects that are not found yet. Reverse sampling follows each ray that is blocked.

mod eyes;
mod random;
mod ray;
mod tree;

use alloc::collections::VecDeque;
use alloc::vec::Vec;
use eyes::Eyes;
use ray::Ray;
use tree::{Cast, TriangleIndex, TriangleTree};
use visibility_core::bits::Bits;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::random::Random;
use visibility_core::{Accuracy, CullStats, ObjectId, RegionCuller, Scene, VisibleSet};

/// Default number of rays in a call, see [`SamplingCuller::with_rays`]. In a city they take a tenth of a
/// second.
const RAYS: usize = 100_000;

/// Number of rows, and of columns, of the rays through each face of a cube around a viewpoint.
const CUBE: usize = 16;

/// Greatest number of further rays to a target after a blocked one. Each is aimed past an edge of the
/// triangle that blocked the ray before.
const DETOURS: usize = 4;

/// A proof that an object can be seen: a segment from a viewpoint of the viewcell to a point of the object,
/// in world space and metres. No occluder meets the segment, up to the rounding of its two ends.
///
/// ```
/// use visibility_core::{glam::DVec3, pvs::Viewcell, Aabb, RegionCuller, Scene, VisibleSet};
/// use visibility_region::SamplingCuller;
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([5.0, 0.0, 0.0], [6.0, 1.0, 1.0]));
/// let mut culler = SamplingCuller::new();
/// let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
/// culler.cull(&scene, &cell, &mut VisibleSet::new());
/// let line = culler.sight_lines()[0];
/// assert!(line.id == id && cell.contains(line.eye) && line.point.x >= 4.99);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub struct SightLine {
    /// Object that the line reaches.
    pub id: ObjectId,
    /// Viewpoint in the viewcell, in world space.
    pub eye: DVec3,
    /// Point of the object's surface, in world space.
    pub point: DVec3,
}

/// Keeps only the objects that a fixed number of rays from the viewcell finds. Aggressive: a lower bound with
/// which to judge conservative cullers.
///
/// A ray meets the [triangles](Scene::set_triangles) of an object, front or back unless the object is
/// [one-sided](visibility_core::Object::one_sided); without triangles its occluder mesh; without either its
/// bounds. Objects that are flagged as occluders, are [always drawn](Scene::is_always_drawn) and can be
/// [culled](visibility_core::Object::is_unculled) block rays with their triangles or mesh, on whichever
/// layers they are. All other objects, such as glass and doors, can be seen but do not block. There is no
/// near plane. An object counts as seen only if a ray certainly meets it and certainly passes all blockers:
/// at an edge that two objects share, or at faces that coincide, nothing counts as seen.
///
/// # Cost
/// About a microsecond per ray in a city of 10,000 triangles, growing logarithmically. The first call for a
/// scene, and the first after a change of the scene, sorts all triangles. Memory is 60 bytes per triangle.
///
/// ```
/// use visibility_core::{glam::{Affine3A, DVec3}, pvs::Viewcell};
/// use visibility_core::{Aabb, OccluderMesh, RegionCuller, Scene, VisibleSet};
/// use visibility_region::SamplingCuller;
/// let mut scene = Scene::new();
/// let bounds = Aabb::from_arrays([4.0, -9.0, -9.0], [5.0, 9.0, 9.0]);
/// let wall = scene.insert(bounds);
/// let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds)?);
/// scene.set_mesh(wall, mesh, Affine3A::IDENTITY)?;
/// scene.set_occluder(wall, true)?;
/// let behind = scene.insert(Aabb::from_arrays([6.0, -1.0, -1.0], [7.0, 1.0, 1.0]));
/// let mut visible = VisibleSet::new();
/// let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
/// SamplingCuller::new().cull(&scene, &cell, &mut visible);
/// assert!(visible.contains(&scene, wall) && !visible.contains(&scene, behind));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct SamplingCuller {
    rays: usize,
    seed: u64,
    tree: TriangleTree,
    cast: Cast,
    sight_lines: Vec<SightLine>,
}

impl Default for SamplingCuller {
    fn default() -> Self {
        Self::new()
    }
}

impl SamplingCuller {
    /// Makes a culler that sends 100,000 rays in each call.
    pub const fn new() -> Self {
        Self { rays: RAYS, seed: 0, tree: TriangleTree::new(), cast: Cast::new(), sight_lines: Vec::new() }
    }

    /// Sets the greatest number of rays in a call. More rays find more objects; with 0 only objects that are
    /// never culled stay. A call ends earlier once all candidates are found.
    #[must_use]
    pub fn with_rays(self, rays: usize) -> Self {
        Self { rays, ..self }
    }

    /// Sets the seed of the pseudorandom numbers. Equal seeds give equal results. The union of results with
    /// several seeds is a valid result too.
    #[must_use]
    pub fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// Returns a line of sight for each object that the last call found, in the order of finding, including
    /// objects that were not candidates. Empty before the first call.
    pub fn sight_lines(&self) -> &[SightLine] {
        &self.sight_lines
    }
}

impl RegionCuller for SamplingCuller {
    /// Returns [`Accuracy::Aggressive`].
    fn accuracy(&self) -> Accuracy {
        Accuracy::Aggressive
    }

    /// Removes the candidates that no ray meets. `tests` in the counters is the number of rays plus the
    /// number of candidates. A viewcell that is inverted or not finite sees nothing.
    fn cull(&mut self, scene: &Scene, cell: &Viewcell, visible: &mut VisibleSet) -> CullStats {
        self.tree.sync(scene);
        self.sight_lines.clear();
        let mut search = Search {
            tree: &self.tree,
            cast: &mut self.cast,
            random: Random(self.seed),
            rays: self.rays,
            found: Bits::new(scene.index_limit()),
            explored: Bits::new(self.tree.len()),
            found_triangles: Vec::new(),
            queue: VecDeque::new(),
            wanted: Bits::new(scene.index_limit()),
            missing: 0,
            lines: Vec::new(),
        };
        let mut candidates = Vec::new();
        // The search ends early once every candidate with triangles is found.
        visible.retain(scene, |id, _| {
            if !search.tree.triangles_of(id.index()).is_empty() {
                search.wanted.insert(id.index());
                candidates.push(id.index());
            }
            true
        });
        search.missing = candidates.len();
        if let Some(eyes) = Eyes::new(cell, scene.origin()) {
            search.run(&eyes, &candidates);
        }
        let Search { found, lines, rays, .. } = search;
        let origin = scene.origin();
        // Lines of sight were found in scene coordinates, and are reported in world coordinates.
        self.sight_lines.extend(lines.into_iter().filter_map(|(object, eye, point)| {
            let id = scene.id_at(object as usize)?;
            Some(SightLine { id, eye: eye + origin, point: point + origin })
        }));
        let mut stats = visible.retain(scene, |id, _| found.contains(id.index()));
        stats.tests += (self.rays - rays) as u64;
        stats
    }
}

/// State of a call. Points are in metres relative to the scene's origin.
struct Search<'a> {
    tree: &'a TriangleTree,
    cast: &'a mut Cast,
    random: Random,
    /// Number of rays that may still be cast.
    rays: usize,
    /// Indices of the objects that rays have met.
    found: Bits,
    /// Indices of the candidates that have triangles, which the search tries to meet.
    wanted: Bits,
    /// Number of objects in `wanted` that no ray has met so far.
    missing: usize,
    /// Triangles that rays have met.
    explored: Bits,
    /// The triangles of `explored`, in the order in which rays met them.
    found_triangles: Vec<TriangleIndex>,
    /// Triangles whose borders are still to be sampled, each with the viewpoint that found it.
    queue: VecDeque<(DVec3, TriangleIndex)>,
    /// For each object found: its index, a viewpoint that sees it, and the seen point of the object.
    lines: Vec<(u32, DVec3, DVec3)>,
}

/// End of a ray: the triangle and the point, relative to the scene's origin, where the ray ends. `blocked`:
/// whether the ray ends in front of the point at which it was aimed.
struct End {
    triangle: TriangleIndex,
    point: DVec3,
    blocked: bool,
}

impl Search<'_> {
    fn run(&mut self, eyes: &Eyes<'_>, candidates: &[usize]) {
        let all = self.rays;
        // Numbers of remaining rays at which the stages of cubes, of random rays and of borders end. The rest
        // of the rays go to objects not found yet.
        let parts = [1, 2, 6].map(|eighths| all - all / 8 * eighths);
        self.cubes(eyes, parts[0]);
        while self.goes_on(parts[1]) {
            let Some(eye) = eyes.random(&mut self.random) else { return };
            let direction = random::direction(&mut self.random);
            self.send(eye, eye + direction);
        }
        let mut before = usize::MAX;
        while self.goes_on(parts[2]) && self.rays < before {
            before = self.rays;
            self.borders(eyes, parts[2]);
            // Borders of all found triangles are sampled again, from other viewpoints.
            for triangle in self.found_triangles.clone() {
                let Some(eye) = eyes.random(&mut self.random) else { return };
                self.queue.push_back((eye, triangle));
            }
        }
        self.directed(eyes, candidates);
        self.borders(eyes, 0);
    }

    /// Returns whether more than `reserve` rays are left and some candidate has not been met yet.
    fn goes_on(&self, reserve: usize) -> bool {
        self.rays > reserve && self.missing > 0
    }

    /// Sends rays through the pixels of cubes around the middle and the corners of the viewcell, until only
    /// `reserve` rays are left.
    fn cubes(&mut self, eyes: &Eyes<'_>, reserve: usize) {
        let corner = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64);
        let middle = core::iter::once(DVec3::splat(0.5));
        for eye in middle.chain((0..8).map(corner)).filter_map(|part| eyes.at(part)) {
            for pixel in 0..6 * CUBE * CUBE {
                if !self.goes_on(reserve) {
                    return;
                }
                let (face, column, row) = (pixel % 6, pixel / 6 % CUBE, pixel / 6 / CUBE);
                let mut across = |i: usize| (i as f64 + self.random.unit()) * (2.0 / CUBE as f64) - 1.0;
                let (u, v) = (across(column), across(row));
                let mut direction = DVec3::ZERO;
                direction[face % 3] = if face < 3 { 1.0 } else { -1.0 };
                direction[(face + 1) % 3] = u;
                direction[(face + 2) % 3] = v;
                self.send(eye, eye + direction);
            }
        }
    }

    /// Casts rays past the borders of the triangles in the queue, and of triangles that these rays find,
    /// until only `reserve` rays are left.
    fn borders(&mut self, eyes: &Eyes<'_>, reserve: usize) {
        while self.goes_on(reserve) {
            let Some((eye, triangle)) = self.queue.pop_front() else { return };
            for side in 0..3 {
                let inside = self.inside(triangle);
                let beyond = self.past_edge(triangle, side, inside);
                if let Some(end) = self.send(eye, beyond) {
                    // Either a nearer triangle blocks the ray past the edge, or the ray goes through a gap
                    // behind the edge.
                    let (x, blocker) =
                        if end.blocked { (beyond, end.triangle) } else { (end.point, triangle) };
                    self.reverse(eyes, x, blocker, if end.blocked { end.point } else { beyond });
                }
            }
        }
    }

    /// Casts rays to random points of objects not found yet, one object after another.
    fn directed(&mut self, eyes: &Eyes<'_>, candidates: &[usize]) {
        while self.goes_on(0) {
            let before = self.rays;
            for &object in candidates {
                if self.found.contains(object) || !self.goes_on(0) {
                    continue;
                }
                let triangles = self.tree.triangles_of(object);
                let triangle = triangles.start + self.random.below(triangles.len()) as u32;
                let Some(eye) = eyes.random(&mut self.random) else { return };
                let x = self.inside(triangle);
                let mut end = self.send(eye, x);
                for _ in 0..DETOURS {
                    let Some(End { triangle: blocker, blocked: true, point }) = end else { break };
                    if self.found.contains(object) {
                        break;
                    }
                    end = self.reverse(eyes, x, blocker, point);
                }
            }
            if self.rays == before {
                return;
            }
        }
    }

    /// Casts a ray to `x` from a viewpoint from which `x` appears just past a random edge of a triangle. The
    /// triangle blocked an earlier ray to `x` at the point `near`. `None` if the viewcell has no such
    /// viewpoint.
    fn reverse(&mut self, eyes: &Eyes<'_>, x: DVec3, triangle: TriangleIndex, near: DVec3) -> Option<End> {
        let side = self.random.below(3);
        let gap = self.past_edge(triangle, side, near);
        let eye = eyes.on_line(x, gap, &mut self.random)?;
        self.send(eye, x)
    }

    /// Returns a random point of a triangle.
    fn inside(&mut self, triangle: TriangleIndex) -> DVec3 {
        let [a, b, c] = self.tree.corners(triangle).map(|p| p.as_dvec3());
        let (mut u, mut v) = (self.random.unit(), self.random.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        a + (b - a) * u + (c - a) * v
    }

    /// Returns a point in the plane of a triangle, slightly outside its edge `side` (0 to 2). With
    /// probability 3/4 it is beside the place on the edge that is nearest to the point `near`, otherwise
    /// beside a random place on the edge.
    fn past_edge(&mut self, triangle: TriangleIndex, side: usize, near: DVec3) -> DVec3 {
        let corners = self.tree.corners(triangle).map(|p| p.as_dvec3());
        let [a, b, c] = [0, 1, 2].map(|i| corners[(side + i) % 3]);
        let edge = b - a;
        let along = |p: DVec3| (p - a).dot(edge) / edge.length_squared().max(f64::MIN_POSITIVE);
        let part = match self.random.below(4) {
            // The place may be a hundredth of the edge beyond its ends, so that rays pass the corners too.
            0 => self.random.unit() * 1.02 - 0.01,
            _ => along(near).clamp(-0.01, 1.01),
        };
        let outwards = a + edge * along(c) - c;
        a + edge * part + outwards * random::small(&mut self.random)
    }

    /// Casts a ray from `eye` through `target`, and records the objects seen. `None` if the two points are
    /// equal or not finite, if no ray is left, or if it is uncertain where the ray ends.
    fn send(&mut self, eye: DVec3, target: DVec3) -> Option<End> {
        self.rays = self.rays.checked_sub(1)?;
        let ray = Ray::through(eye, target)?;
        self.tree.cast(&ray, self.cast);
        for &(object, triangle, at) in &self.cast.seen {
            if self.found.insert(object as usize) {
                self.missing -= usize::from(self.wanted.contains(object as usize));
                self.lines.push((object, eye, ray.at(at)));
            }
            if self.explored.insert(triangle as usize) {
                self.found_triangles.push(triangle);
                self.queue.push_back((eye, triangle));
            }
        }
        let (triangle, at) = self.cast.end?;
        let point = ray.at(at);
        let blocked = (point - eye).length_squared() < (target - eye).length_squared() * (1.0 - 1e-9);
        Some(End { triangle, point, blocked })
    }
}
