//! Location of a point in a plan: a binary search along the curve, then a walk of some steps.

use super::plan::Plan;
use super::predicates::{Point, orient};
use super::triangulation::{NONE, Place, next, place_in};
use alloc::vec::Vec;

/// Maximum number of steps of a walk from the last eye's triangle. A longer walk would take as long as a
/// binary search.
const MAX_STEPS: u32 = 16;

impl Plan {
    /// Returns the [`Place`] of a point: the triangle, half-edge or vertex that it lies on. Walks there from
    /// half-edge `from` in at most [`MAX_STEPS`] steps. If that does not suffice, or `from` is [`NONE`],
    /// walks from a vertex found by binary search along the curve. The result does not depend on `from`.
    pub(crate) fn locate_near(&self, point: Point, from: u32) -> Place {
        match self.walk_to(point, from) {
            // A vertex or an edge has several half-edges. Picks a fixed one, so that the result does not
            // depend on the walk.
            Place::Vertex(h) => Place::Vertex(self.out[self.edges[h as usize].origin as usize]),
            Place::Edge(h) => Place::Edge(self.edges[h as usize].twin().map_or(h, |twin| h.min(twin))),
            place => place,
        }
    }

    fn walk_to(&self, point: Point, from: u32) -> Place {
        let near = if from == NONE { None } else { self.walk(point, from, MAX_STEPS) };
        near.unwrap_or_else(|| self.locate(point, self.near(point)))
    }

    /// Returns the triangle, half-edge or vertex that a point lies on, [`Place::Outside`] if there is none.
    /// Walks there from the triangle of half-edge `from`. A walk that goes in a circle, which is very rare,
    /// is stopped after as many steps as there are half-edges, and then all triangles are searched.
    pub(crate) fn locate(&self, point: Point, from: u32) -> Place {
        let found = self.walk(point, from, self.edges.len() as u32 + 16);
        let mut triangles = 0..self.edges.len() as u32 / 3;
        let search = || triangles.find_map(|t| self.place_in(t, point));
        found.or_else(search).unwrap_or(Place::Outside)
    }

    /// Walks from the triangle of half-edge `from` to that of a point. Each step crosses an edge that has the
    /// point on its other side. The steps test the edges in varying order, so that the walk hardly ever goes
    /// in a circle. `None` if the point is not reached in `most` steps.
    fn walk(&self, point: Point, from: u32, most: u32) -> Option<Place> {
        let mut t = from / 3;
        'walk: for step in 0..most {
            for turn in 0..3 {
                let h = 3 * t + (turn + step) % 3;
                if orient(self.start(h), self.start(next(h)), point) < 0.0 {
                    match self.edges[h as usize].twin() {
                        Some(twin) => t = twin / 3,
                        None => return Some(Place::Outside),
                    }
                    continue 'walk;
                }
            }
            return Some(self.place_in(t, point).unwrap_or(Place::Outside));
        }
        None
    }

    fn place_in(&self, t: u32, point: Point) -> Option<Place> {
        place_in(self.corners(t), t, point)
    }

    /// Appends the triangles that contain a point at `place`, outlines included. None outside the rectangle.
    pub(super) fn push_triangles_at(&self, place: Place, out: &mut Vec<u32>) {
        match place {
            Place::Triangle(t) => out.push(t),
            Place::Edge(h) => {
                let twin = self.edges[h as usize].twin();
                out.extend([Some(h), twin].into_iter().flatten().map(|h| h / 3));
            }
            Place::Vertex(h) => out.extend(self.fan(h).map(|h| h / 3)),
            Place::Outside => {}
        }
    }

    /// Returns the half-edges that begin at the vertex of `h`, counter-clockwise. At a corner of the outer
    /// rectangle, they begin with the most clockwise one. Elsewhere they go all around and begin with `h`.
    pub(crate) fn fan(&self, h: u32) -> impl Iterator<Item = u32> + '_ {
        let mut first = h;
        // Goes clockwise until there is no triangle.
        while let Some(twin) = self.edges[first as usize].twin() {
            first = next(twin);
            if first == h {
                break;
            }
        }
        let mut at = Some(first);
        core::iter::from_fn(move || {
            let h = at?;
            at = self.turned(h).filter(|&next| next != first);
            Some(h)
        })
    }
}
