//! Beams among discs through the triangulation of their centres: a fast superset of the discs seen.
//!
//! A beam is the set of directions that reach an edge of the triangulation. At the edge it loses the
//! directions that cross the edge inside the disc around either end: those lines of sight have met that disc
//! there, or another one before. No other disc closes anything, so discs may overlap. A line of sight ends in
//! a triangle that its beam enters, and the disc that it meets touches this triangle. Most discs that touch a
//! triangle are those of its corners; the others, which reach into it from elsewhere, are listed by triangle.
//!
//! (The expansion through triangles is that of "Efficient Computation of Visibility Polygons" by Francisc
//! Bungiu et al., 2014, with windows that are narrower than the edges.)
//!
//! # Rounding
//! Unit vectors from the eye are off by less than `8u`, `u = 2^-53`, and their cross products by as much
//! again. A beam ends only if it is narrower than [`NARROWEST`], which is negative and some ten times that.
//! The discs close with radii that are less by `1e-12` of the radius and of the distance.

use super::ROUNDING;
use super::tree::{Disc, DiscError};
use crate::cdt::predicates::GREATEST;
use crate::cdt::predicates::checked;
use crate::cdt::triangulation::{NONE, Place, next, previous};
use crate::cdt::{Plan, Wall};
use alloc::vec::Vec;
use smallvec::SmallVec;
use visibility_core::geometry::sqrt;

/// Cross product of a beam's right and left unit vector below which the beam counts as empty.
const NARROWEST: f64 = -1e-14;

/// Cosine of the angle between an edge's ends, seen from the eye, below which the eye counts as on the edge.
const STRAIGHT: f64 = -0.999_999;

/// Greatest number of triangles that are searched for the parts of one disc. A larger disc is reported to all
/// eyes.
const MOST_TRIANGLES: usize = 128;

/// Greatest number of triangles that the beams of one look enter. Beyond it all discs are reported.
const MOST_STEPS: usize = 1 << 24;

/// Discs and the triangulation of their centres, for [`look`](Self::look). Immutable, and shared by all eyes.
///
/// ```
/// use visibility_2d::discs::{BeamScratch, Disc, DiscBeams};
/// let disc = |x: f64, radius: f64| Disc { center: [x, 0.0], radius };
/// let beams = DiscBeams::new(&[disc(5.0, 1.0), disc(9.0, 1.0)])?;
/// let mut seen = Vec::new();
/// beams.look([0.0, 0.0], &mut BeamScratch::new(), &mut seen);
/// assert!(seen.contains(&0));
/// # Ok::<(), visibility_2d::discs::DiscError>(())
/// ```
#[derive(Clone, Debug)]
pub struct DiscBeams {
    plan: Plan,
    discs: Vec<Disc>,
    /// Widest disc around each vertex. [`NONE`] at the corners of the rectangle.
    disc_of: Vec<u32>,
    /// Radius in metres of the disc in `disc_of`, 0 without one.
    radius_of: Vec<f64>,
    /// First element of `others` of each triangle; then the end of the last.
    first_other: Vec<u32>,
    /// Discs that touch a triangle and are not in `disc_of` of its corners.
    others: Vec<u32>,
    /// Discs that touch more than [`MOST_TRIANGLES`] triangles.
    large: Vec<u32>,
}

/// Working memory of [`DiscBeams::look`]. Keeps its memory from look to look.
///
/// ```
/// let scratch = visibility_2d::discs::BeamScratch::new();
/// # let _ = scratch;
/// ```
#[derive(Clone, Debug, Default)]
pub struct BeamScratch {
    /// Number of the last look that reported each disc.
    marks: Vec<u32>,
    look: u32,
    beams: Vec<Beam>,
}

/// Directions that leave a triangle by a half-edge, from `right` counter-clockwise to `left`.
#[derive(Clone, Copy, Debug)]
struct Beam {
    edge: u32,
    right: [f64; 2],
    left: [f64; 2],
}

impl BeamScratch {
    /// Makes empty working memory. It grows with the first queries.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a disc unless this look has reported it.
    fn report(&mut self, disc: u32, seen: &mut Vec<u32>) {
        if core::mem::replace(&mut self.marks[disc as usize], self.look) != self.look {
            seen.push(disc);
        }
    }
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn unit([x, y]: [f64; 2]) -> [f64; 2] {
    let length = sqrt(x * x + y * y);
    [x / length, y / length]
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

impl DiscBeams {
    /// Triangulates the centres of discs, which may overlap.
    ///
    /// # Errors
    /// [`DiscError::Disc`] for a disc that is not finite, has a negative radius or a number beyond 1e60,
    /// [`DiscError::TooMany`] for more centres than a [`Plan`] takes.
    pub fn new(discs: &[Disc]) -> Result<Self, DiscError> {
        let is_good = |disc: &Disc| {
            disc.center.iter().all(|x| x.abs() <= GREATEST) && (0.0..=GREATEST).contains(&disc.radius)
        };
        if let Some(index) = discs.iter().position(|disc| !is_good(disc)) {
            return Err(DiscError::Disc { index });
        }
        let walls: Vec<_> = discs.iter().map(|disc| Wall::new(disc.center, disc.center)).collect();
        let plan = Plan::new(&walls).map_err(|_| DiscError::TooMany)?;
        let vertices = plan.points.len();
        let mut made = Self {
            discs: discs.to_vec(),
            disc_of: alloc::vec![NONE; vertices],
            radius_of: alloc::vec![0.0; vertices],
            first_other: alloc::vec![0; plan.triangle_count() + 1],
            others: Vec::new(),
            large: Vec::new(),
            plan,
        };
        made.list();
        Ok(made)
    }

    /// Lists for each vertex its disc, and for each triangle the other discs that touch it.
    fn list(&mut self) {
        let mut edges = Vec::with_capacity(self.discs.len());
        for (index, disc) in (0u32..).zip(&self.discs) {
            let place = self.plan.locate(disc.center, self.plan.near(disc.center));
            let Place::Vertex(edge) = place else {
                // Coordinates below the least one of a plan.
                self.large.push(index);
                edges.push(NONE);
                continue;
            };
            edges.push(edge);
            // Several discs may have the same centre. The largest is the disc of the vertex.
            let vertex = self.plan.edges[edge as usize].origin as usize;
            if self.disc_of[vertex] == NONE || self.radius_of[vertex] < disc.radius {
                (self.disc_of[vertex], self.radius_of[vertex]) = (index, disc.radius);
            }
        }
        let mut touched: Vec<(u32, u32)> = Vec::new();
        let mut found = Vec::new();
        for (index, &edge) in (0u32..).zip(&edges) {
            if edge == NONE {
                continue;
            }
            let vertex = self.plan.edges[edge as usize].origin;
            // Each disc is listed by the triangles that it touches, found from the centre outward through the
            // edges that the disc reaches. Triangles with the centre as a corner know the vertex's own disc
            // already.
            let is_first = self.disc_of[vertex as usize] == index;
            found.clear();
            found.extend(self.plan.fan(edge).map(|h| h / 3));
            let mut at = 0;
            while at < found.len() && found.len() <= MOST_TRIANGLES {
                let triangle = found[at];
                let is_corner =
                    (3 * triangle..3 * triangle + 3).any(|h| self.plan.edges[h as usize].origin == vertex);
                if !(is_corner && is_first) {
                    touched.push((triangle, index));
                }
                for h in 3 * triangle..3 * triangle + 3 {
                    let twin = self.plan.edges[h as usize].twin().map(|twin| twin / 3);
                    if let Some(twin) = twin.filter(|twin| !found.contains(twin))
                        && self.reaches(index, h)
                    {
                        found.push(twin);
                    }
                }
                at += 1;
            }
            // Too large for lists: such a disc is reported by every query.
            if found.len() > MOST_TRIANGLES {
                self.large.push(index);
            }
        }
        // Counts by triangle, then their sums: the start of each triangle's list.
        touched.sort_unstable();
        for &(triangle, _) in &touched {
            self.first_other[triangle as usize + 1] += 1;
        }
        for triangle in 1..self.first_other.len() {
            self.first_other[triangle] += self.first_other[triangle - 1];
        }
        self.others = touched.into_iter().map(|(_, disc)| disc).collect();
    }

    /// Returns whether a disc may reach an edge.
    fn reaches(&self, disc: u32, h: u32) -> bool {
        let Disc { center, radius } = self.discs[disc as usize];
        let [a, b] = self.plan.ends(h).map(|end| minus(end, center));
        let along = minus(b, a);
        let squared = along[0] * along[0] + along[1] * along[1];
        let t = (-(a[0] * along[0] + a[1] * along[1]) / squared).clamp(0.0, 1.0);
        let [x, y] = [0, 1].map(|k| a[k] + t * along[k]);
        let size = sqrt(a[0] * a[0] + a[1] * a[1]) + sqrt(squared);
        // Not less or equal, so that NaN counts as touching.
        let is_beyond = sqrt(x * x + y * y) > radius * (1.0 + ROUNDING) + ROUNDING * size;
        !is_beyond
    }

    /// Returns the number of discs.
    pub fn len(&self) -> usize {
        self.discs.len()
    }

    /// Returns whether there are no discs.
    pub fn is_empty(&self) -> bool {
        self.discs.is_empty()
    }

    /// Replaces `seen` with the discs that an eye may see in any direction, each once, as their indices in
    /// the order that [`DiscBeams::new`] was given them. Conservative: each disc that is seen is
    /// reported, and some that are not. All discs for an eye outside of [`Plan::bounds`] of the centres,
    /// or NaN. Time is in proportion to the triangles that beams enter.
    pub fn look(&self, eye: [f64; 2], scratch: &mut BeamScratch, seen: &mut Vec<u32>) {
        seen.clear();
        scratch.look = scratch.look.wrapping_add(1);
        if scratch.look == 0 || scratch.marks.len() != self.discs.len() {
            scratch.marks.clear();
            scratch.marks.resize(self.discs.len(), 0);
            scratch.look = 1;
        }
        scratch.beams.clear();
        let expanded = checked(eye, 0).ok().and_then(|eye| self.expand(eye, scratch, seen));
        if expanded.is_none() {
            seen.clear();
            seen.extend(0..self.discs.len() as u32);
        }
    }

    /// Follows beams from the eye. `None` if they enter too many triangles.
    fn expand(&self, eye: [f64; 2], scratch: &mut BeamScratch, seen: &mut Vec<u32>) -> Option<()> {
        let plan = &self.plan;
        self.large.iter().for_each(|&disc| scratch.report(disc, seen));
        // The edges opposite the eye in the triangles around it: each begins a beam. An edge so close that it
        // spans nearly half a turn is replaced by the two edges beyond it, since a beam must be narrower.
        let mut around: SmallVec<[u32; 16]> = SmallVec::new();
        match plan.locate(eye, plan.near(eye)) {
            Place::Triangle(t) => around.extend(3 * t..3 * t + 3),
            Place::Edge(h) => {
                let twin = plan.edges[h as usize].twin();
                around.extend([Some(h), twin].into_iter().flatten().flat_map(|h| [next(h), previous(h)]));
            }
            Place::Vertex(h) => around.extend(plan.fan(h).map(next)),
            Place::Outside => return None,
        }
        for h in around {
            self.report_triangle(h / 3, scratch, seen);
            let [right, left] = plan.ends(h).map(|end| unit(minus(end, eye)));
            if right[0] * left[0] + right[1] * left[1] > STRAIGHT {
                self.push(h, eye, None, scratch);
            } else if let Some(twin) = plan.edges[h as usize].twin() {
                self.report_triangle(twin / 3, scratch, seen);
                self.push(next(twin), eye, None, scratch);
                self.push(previous(twin), eye, None, scratch);
            }
        }
        let mut steps = 0;
        // A beam that crosses an edge is divided among the two far edges of the triangle beyond; `push`
        // narrows each part by the discs at its ends, or drops it.
        while let Some(beam) = scratch.beams.pop() {
            let Some(twin) = plan.edges[beam.edge as usize].twin() else { continue };
            steps += 1;
            if steps > MOST_STEPS {
                return None;
            }
            self.report_entered(twin, eye, beam, scratch, seen);
            self.push(next(twin), eye, Some(beam), scratch);
            self.push(previous(twin), eye, Some(beam), scratch);
        }
        Some(())
    }

    /// Reports the discs that touch a triangle.
    fn report_triangle(&self, triangle: u32, scratch: &mut BeamScratch, seen: &mut Vec<u32>) {
        for h in 3 * triangle..3 * triangle + 3 {
            let disc = self.disc_of[self.plan.edges[h as usize].origin as usize];
            if disc != NONE {
                scratch.report(disc, seen);
            }
        }
        self.report_others(triangle, scratch, seen);
    }

    fn report_others(&self, triangle: u32, scratch: &mut BeamScratch, seen: &mut Vec<u32>) {
        let [first, end] = [0, 1].map(|k| self.first_other[triangle as usize + k] as usize);
        self.others[first..end].iter().for_each(|&disc| scratch.report(disc, seen));
    }

    /// Reports the discs that touch a triangle and may touch the beam that enters it by the half-edge `twin`.
    /// Discs around the ends of `twin` have been reported with the triangle before.
    fn report_entered(
        &self,
        twin: u32,
        eye: [f64; 2],
        beam: Beam,
        scratch: &mut BeamScratch,
        seen: &mut Vec<u32>,
    ) {
        let vertex = self.plan.edges[previous(twin) as usize].origin as usize;
        if self.disc_of[vertex] != NONE {
            let to = minus(self.plan.points[vertex], eye);
            let reach = self.radius_of[vertex] * (1.0 + ROUNDING) + ROUNDING * (to[0].abs() + to[1].abs());
            if cross(beam.right, to) >= -reach && cross(to, beam.left) >= -reach {
                scratch.report(self.disc_of[vertex], seen);
            }
        }
        self.report_others(twin / 3, scratch, seen);
    }

    /// Narrows a beam (`None`: all directions) by the discs at the ends of an edge, and pushes the rest as a
    /// beam beyond the edge. Pushes nothing if no direction is left.
    fn push(&self, h: u32, eye: [f64; 2], beam: Option<Beam>, scratch: &mut BeamScratch) {
        let [a, b] = self.plan.ends(h);
        let [to_a, to_b] = [a, b].map(|end| minus(end, eye));
        if let Some(Beam { right, left, .. }) = beam {
            let slack = |to: [f64; 2]| NARROWEST * (to[0].abs() + to[1].abs());
            if cross(right, to_b) < slack(to_b) || cross(to_a, left) < slack(to_a) {
                return;
            }
        }
        let along = minus(b, a);
        let length = sqrt(along[0] * along[0] + along[1] * along[1]);
        // How much of the edge the disc at an end closes. A disc around the eye closes nothing.
        let closed = |to: [f64; 2], h: u32| {
            let radius = self.radius_of[self.plan.edges[h as usize].origin as usize];
            let is_outside = to[0] * to[0] + to[1] * to[1] > radius * radius * (1.0 + ROUNDING);
            let closed = radius * (1.0 - ROUNDING) - ROUNDING * (to[0].abs() + to[1].abs());
            if is_outside { closed.max(0.0) } else { 0.0 }
        };
        let (by_a, by_b) = (closed(to_a, h), closed(to_b, next(h)));
        if by_a + by_b >= length * (1.0 + ROUNDING) {
            return;
        }
        let past = |to: [f64; 2], by: f64| [to[0] + by / length * along[0], to[1] + by / length * along[1]];
        let (past_a, past_b) = (past(to_a, by_a), past(to_b, -by_b));
        // Not turned further than the beam goes.
        let right = match beam {
            Some(beam) if cross(past_a, beam.right) > 0.0 => beam.right,
            _ => unit(past_a),
        };
        let left = match beam {
            Some(beam) if cross(beam.left, past_b) > 0.0 => beam.left,
            _ => unit(past_b),
        };
        // Not less, so that NaN, of an eye on a vertex, leaves the beam open.
        let is_empty = cross(right, left) < NARROWEST;
        if !is_empty {
            scratch.beams.push(Beam { edge: h, right, left });
        }
    }
}
