//! The chain of portals that a depth-first search is in, shared by the bakers of cells and of objects.
//!
//! Two polygons bound the lines of a chain: the part of its first portal from which they can come, and the
//! part of its last portal that they can pass. The planes that [separate](crate::separating_planes) the two
//! polygons bound everything that the lines can reach beyond.

use crate::clip_polygon::clip_range;
use crate::directed_portals::DirectedPortals;
use crate::separating_planes::{Facing, push_separating_planes};
use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;

/// One portal of the current chain of directed portals, with the parts of the chain's lists that belong to
/// this portal.
#[derive(Clone, Debug)]
pub(crate) struct ChainFrame {
    /// Index of the directed portal in `DirectedPortals::all`.
    pub(crate) portal: u32,
    /// The part of the chain's first portal that lines of the chain can come from, a range of
    /// `PortalChain::points`.
    pub(crate) source: Range<usize>,
    /// The part of this portal that lines of the chain can pass, a range of `PortalChain::points`.
    pub(crate) pass: Range<usize>,
    /// The planes that bound everything that the lines reach beyond this portal, on the side of their
    /// normals: a range of `PortalChain::planes`.
    pub(crate) planes: Range<usize>,
    /// Offset in `PortalChain::sets` of this frame's bitset: the portals that lines through this portal can
    /// still reach.
    pub(crate) set: usize,
    /// Range of bit numbers, in this frame's bitset, of the portals that lead from the cell behind this
    /// portal and were not inspected yet.
    pub(crate) children: Range<u32>,
    /// Length of `PortalChain::points` before this frame was pushed, restored when the frame is popped.
    pub(crate) points: usize,
}

/// The current chain of directed portals, with the polygons, planes and bitsets of its frames. In world
/// space.
#[derive(Clone, Debug, Default)]
pub(crate) struct PortalChain {
    pub(crate) frames: Vec<ChainFrame>,
    pub(crate) points: Vec<DVec3>,
    pub(crate) planes: Vec<Plane>,
    /// Stack of bitsets of portals, one for each frame. `ChainFrame::set` is the offset of a frame's bitset.
    /// The baker decides which list the bits index.
    pub(crate) sets: Vec<u64>,
}

impl PortalChain {
    pub(crate) fn clear(&mut self) {
        self.frames.clear();
        self.points.clear();
        self.planes.clear();
        self.sets.clear();
    }

    /// Returns the next portal by which to extend the chain, as a bit number in the last frame's bitset, and
    /// pops the frames that have no such portal left. `None` when the chain is empty.
    pub(crate) fn next_child(&mut self) -> Option<u32> {
        while let Some(frame) = self.frames.last_mut() {
            let set = &self.sets[frame.set..];
            let child = frame.children.find(|&child| set[child as usize / 64] >> (child % 64) & 1 != 0);
            if child.is_some() {
                return child;
            }
            self.points.truncate(frame.points);
            self.planes.truncate(frame.planes.start);
            self.sets.truncate(frame.set);
            self.frames.pop();
        }
        None
    }

    /// Returns the parts of two portals between which lines can pass `last`, the last portal of the chain:
    /// the part of directed portal `first`, where the lines come from, and the part of directed portal
    /// `next`, where they go. Both are ranges of `points`. `None` if either part is empty. Clipped polygons
    /// are appended to `points`, also if the result is `None`.
    ///
    /// `meets_first` tells whether the plane of `first` may cut portal `next`. If `false`, `next` is known to
    /// lie in front of that plane and is not clipped to it.
    pub(crate) fn narrow(
        &mut self,
        portals: &DirectedPortals,
        first: u32,
        last: &ChainFrame,
        next: u32,
        meets_first: bool,
    ) -> Option<(Range<usize>, Range<usize>)> {
        let (all, margins) = (&portals.all, &portals.margins);
        let portal = &all[next as usize];
        let start = self.points.len();
        self.points.extend_from_slice(portals.vertices_of(portal));
        let mut pass = start..self.points.len();
        // The next portal, clipped to the front of the first one and to the planes of the chain: only that
        // part can lines reach.
        if meets_first {
            let ahead = outward(&all[first as usize].plane, margins.keep);
            pass = clip_range(&mut self.points, pass, &ahead, margins.merge)?;
        }
        for plane in &self.planes[last.planes.clone()] {
            pass = clip_range(&mut self.points, pass, plane, margins.merge)?;
        }
        // The source, clipped to the back of the next portal and to planes that separate it from the part
        // reached.
        let behind = outward(&portal.plane.flipped(), margins.keep);
        let mut source = clip_range(&mut self.points, last.source.clone(), &behind, margins.merge)?;
        if last.portal != first {
            let facing = |part: &Range<usize>, of: u32| Facing {
                vertices: &self.points[part.clone()],
                normal: all[of as usize].plane.normal,
                sense: -1.0,
            };
            let own_planes = self.planes.len();
            let (target, middle) = (facing(&pass, next), facing(&last.pass, last.portal));
            push_separating_planes(target, middle, margins, &mut self.planes);
            let clipped = self.planes[own_planes..]
                .iter()
                .try_fold(source, |source, plane| clip_range(&mut self.points, source, plane, margins.merge));
            self.planes.truncate(own_planes);
            source = clipped?;
        }
        Some((source, pass))
    }

    /// Appends to `planes` the planes that bound everything beyond directed portal `last` that lines of the
    /// chain can reach. The lines come from the part `source` of directed portal `first` and pass the part
    /// `pass` of `last`. Both parts are ranges of `points`.
    pub(crate) fn push_planes(
        &mut self,
        portals: &DirectedPortals,
        (first, source): (u32, &Range<usize>),
        (last, pass): (u32, &Range<usize>),
    ) {
        let [from, through] = [(first, source), (last, pass)].map(|(portal, part)| Facing {
            vertices: &self.points[part.clone()],
            normal: portals.all[portal as usize].plane.normal,
            sense: 1.0,
        });
        push_separating_planes(from, through, &portals.margins, &mut self.planes);
    }
}

/// Returns the half-space enlarged: its boundary moved by `by` world units against its unit normal.
pub(crate) fn outward(plane: &Plane, by: f64) -> Plane {
    Plane::new(plane.normal, plane.offset + by)
}

/// Tests whether all vertices of directed portal `portal` are on the outer side of one of the planes,
/// opposite to the plane's normal. `false` if some vertex is inside or on each plane, and without planes.
/// `ball` is the centre and the radius, in world space, of a ball that contains the portal.
pub(crate) fn is_outside(
    portals: &DirectedPortals,
    planes: &[Plane],
    portal: u32,
    ball: (DVec3, f64),
) -> bool {
    let (center, radius) = ball;
    // The least distance over all planes decides nearly always. Without branches the loop handles several
    // planes at once.
    let signed_distance = |plane: &Plane| {
        plane.normal.x * center.x + plane.normal.y * center.y + plane.normal.z * center.z + plane.offset
    };
    let least = planes.iter().fold(f64::INFINITY, |least, plane| {
        let distance = signed_distance(plane);
        if distance < least { distance } else { least }
    });
    // At least one vertex is as far inside as the mean of the vertices.
    if least >= 0.0 || least < -radius {
        return least < 0.0;
    }
    let vertices = portals.vertices_of(&portals.all[portal as usize]);
    planes
        .iter()
        .any(|plane| signed_distance(plane) < 0.0 && vertices.iter().all(|&v| plane.signed_distance(v) < 0.0))
}

/// Scratch memory of a flood fill through cells, in which each cell is reached once.
#[derive(Clone, Debug, Default)]
pub(crate) struct CellFlood {
    /// By cell index: number of the last fill that reached the cell, compared with `fill`.
    stamps: Vec<u32>,
    /// Number of the current flood fill. 0 before the first fill.
    fill: u32,
    queue: Vec<u32>,
}

impl CellFlood {
    /// Starts a flood fill from the cell of index `cell`, in a graph of `cells` cells.
    pub(crate) fn begin(&mut self, cells: usize, cell: u32) {
        self.stamps.resize(cells, 0);
        if self.fill == u32::MAX {
            self.stamps.fill(0);
            self.fill = 0;
        }
        self.fill += 1;
        self.queue.clear();
        self.reach(cell);
    }

    /// Adds `cell` to the fill. Returns `false` if the cell has been reached before.
    pub(crate) fn reach(&mut self, cell: u32) -> bool {
        let is_new = core::mem::replace(&mut self.stamps[cell as usize], self.fill) != self.fill;
        if is_new {
            self.queue.push(cell);
        }
        is_new
    }

    /// Returns a reached cell whose portals have not been inspected. `None` at the end of the fill.
    pub(crate) fn next_cell(&mut self) -> Option<u32> {
        self.queue.pop()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::cells::{CellGraph, CellId};
    use visibility_core::geometry::ConvexPolygon;

    #[test]
    fn portals_are_outside_only_with_all_vertices() {
        let corners = [[1.0, 0.0], [9.0, 0.0], [9.0, 4.0], [1.0, 4.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        let portal = (ConvexPolygon::new(corners).unwrap(), [CellId(0), CellId(1)]);
        let portals = DirectedPortals::new(&CellGraph::new(2, [portal]).unwrap(), 1e-3, 9.0);
        let vertices = portals.vertices_of(&portals.all[0]);
        let [low, high] = [f64::min as fn(f64, f64) -> f64, f64::max]
            .map(|pick| vertices.iter().map(|v| v.x).reduce(pick).unwrap());
        let ball = (portals.all[0].center, portals.all[0].radius);
        let right_of = |x: f64| Plane::new(DVec3::X, -x);
        let outside = |planes: &[Plane]| is_outside(&portals, planes, 0, ball);
        assert!(!outside(&[]), "no planes");
        // At its middle, between its middle and its end, at its end, and beyond.
        for x in [low - 1.0, low, 3.0, ball.0.x, 7.0, high] {
            assert!(!outside(&[right_of(x)]), "a plane at {x}");
            assert!(!outside(&[right_of(low), right_of(x)]), "planes at {low} and {x}");
        }
        let just_beyond = high.next_up();
        for x in [just_beyond, 9.5, ball.0.x + ball.1, 100.0] {
            assert!(outside(&[right_of(x)]), "a plane at {x}");
            assert!(outside(&[right_of(0.0), right_of(x)]), "planes at 0 and {x}");
        }
        // Outside of two planes by half of it each, and of none by all of it.
        assert!(!outside(&[right_of(7.0), right_of(3.0).flipped()]), "two planes with nothing between them");
        // The mean of the vertices is on the plane: so are vertices, or inside.
        let middle = Plane::new(DVec3::Y, -ball.0.y);
        assert!(!outside(&[middle]) && !outside(&[middle.flipped()]), "planes through the middle");
    }
}
