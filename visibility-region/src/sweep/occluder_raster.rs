//! Draws occluders: their triangles that face the viewcell, in pieces that are connected across edges. Each
//! piece is drawn with its own contour, so that the contour of one leaf of a tree does not remove what
//! another leaf covers.

use super::coverage::{PieceMaps, Target};
use super::direction::{Direction, LocalBox};
use super::effort::Work;
use super::facing::facing;
use super::occluder::{Occluder, Shape, pixels_behind};
use super::ray_map::RayMap;
use super::window::{SLACK, Window};
use alloc::vec::Vec;
use visibility_core::OccluderMesh;
use visibility_core::glam::DVec3;

/// Cost of an occluder that cannot cover a pixel, in nanoseconds of [`Work`].
const OCCLUDER: u64 = 80;
/// Cost of a triangle or contour edge of an occluder, without its rows of pixels, in nanoseconds of [`Work`].
const SIDE_WORK: u64 = 80;

/// Result of drawing an occluder.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Drawn {
    /// The occluder was not drawn: it cannot cover a further pixel, or is too imprecise.
    LeftOut,
    /// The occluder was drawn, and covers no pixel that was not set before; or a projected position is too
    /// far away for its precision.
    Nothing,
    /// The occluder has added pixels to the map.
    Pixels,
}

/// Scratch memory for drawing occluders.
#[derive(Clone, Debug)]
pub(crate) struct OccluderRaster {
    maps: PieceMaps,
    vertices: Vec<DVec3>,
    /// Facing of each triangle of the present mesh: 1 if its front faces the whole viewcell, -1 if its back
    /// does, 0 if neither. 2 or -2 once the triangle is in a piece.
    facing: Vec<i8>,
    stack: Vec<u32>,
    piece: Vec<u32>,
}

impl OccluderRaster {
    pub(crate) fn new() -> Self {
        Self {
            maps: PieceMaps::new(),
            vertices: Vec::new(),
            facing: Vec::new(),
            stack: Vec::new(),
            piece: Vec::new(),
        }
    }

    /// Adds to `map` the pixels that an occluder covers. Parts nearer than depth `near` do not count.
    /// Subtracts the cost from `work`.
    pub(crate) fn draw(
        &mut self,
        map: &mut RayMap,
        direction: &Direction,
        window: &Window,
        occluder: &Occluder<'_>,
        near: f64,
        work: &mut Work,
    ) -> Drawn {
        work.use_up(1, OCCLUDER);
        let Some(rect) = pixels_behind(&occluder.bounds, direction, window, near) else {
            return Drawn::LeftOut;
        };
        if map.all_set(rect) || !Self::decides(direction, window, occluder, near) {
            return Drawn::LeftOut;
        }
        let target = Target { direction, window, near, rect };
        let sides = match occluder.shape {
            Shape::Mesh(mesh) => 4 * mesh.triangles().len(),
            Shape::Piece { triangles, contour, .. } => triangles.len() + contour.len(),
        };
        work.use_up(sides, SIDE_WORK + 3 * (rect.y[1] - rect.y[0]) as u64 / 2);
        let adds = match occluder.shape {
            Shape::Mesh(mesh) => self.draw_mesh(map, &target, occluder, mesh),
            Shape::Piece { surfaces, triangles, contour } => {
                let triangles = triangles.iter().map(|&t| {
                    let corners = &surfaces.triangles[t as usize].corners;
                    (corners.map(|p| occluder.local(p)), Some(corners.as_slice()))
                });
                let contour = contour.iter().map(|&s| {
                    let ends = &surfaces.segments[s as usize];
                    (ends.map(|p| occluder.local(p)), Some(ends.as_slice()))
                });
                self.maps.draw(map, &target, triangles, contour)
            }
        };
        if adds { Drawn::Pixels } else { Drawn::Nothing }
    }

    /// Draws a mesh as [`draw`](Self::draw) does. Returns whether it added pixels.
    fn draw_mesh(
        &mut self,
        map: &mut RayMap,
        target: &Target<'_>,
        occluder: &Occluder<'_>,
        mesh: &OccluderMesh,
    ) -> bool {
        let mut adds = false;
        self.vertices.clear();
        self.vertices.extend(mesh.positions().iter().map(|&p| occluder.local(p)));
        let (fronts, backs) = self.classify(target.direction, occluder, mesh);
        if fronts {
            adds |= self.draw_chain(map, target, mesh, 1);
        }
        // Seen from outside a convex solid, everything that its back faces cover is covered by the solid: see
        // `pieces`. Backs of other closed meshes cannot be seen from outside.
        let is_solid = mesh.is_convex() && target.direction.is_outside(&occluder.bounds, occluder.error);
        if backs && (is_solid || mesh.is_two_sided() && !(fronts && mesh.is_closed())) {
            adds |= self.draw_chain(map, target, mesh, -1);
        }
        adds
    }

    /// Returns whether the errors of vertices, projected onto this plane, are below a quarter of [`SLACK`]
    /// pixels. If not, the occluder is not drawn.
    fn decides(direction: &Direction, window: &Window, occluder: &Occluder<'_>, near: f64) -> bool {
        // A vertex at (x, z) is seen at x + (x - v) (d - z) / (z + w). With w >= 0 and |v| <= h its
        // derivative by x is at most d / z, that by z at most (|x| + h) d / z^2.
        let LocalBox { lo, hi } = occluder.bounds;
        let z = lo.z.max(near);
        (0..2).all(|lat| {
            let x = lo[lat].abs().max(hi[lat].abs()) + direction.half[lat];
            occluder.error * window.scale(lat) * (window.d / z) * (1.0 + x / z) < SLACK * 0.25
        })
    }

    /// Finds out which side of each triangle faces the viewcell. Returns two flags: whether any triangle
    /// shows its front, and whether any shows its back.
    fn classify(
        &mut self,
        direction: &Direction,
        occluder: &Occluder<'_>,
        mesh: &OccluderMesh,
    ) -> (bool, bool) {
        let half = DVec3::new(direction.half[0], direction.half[1], direction.depth * 0.5);
        let center = DVec3::new(0.0, 0.0, -half.z);
        let (mut fronts, mut backs) = (false, false);
        self.facing.clear();
        for t in mesh.triangles() {
            let corners = t.map(|i| self.vertices[i as usize]);
            let side = facing(corners, center, half, occluder.error, occluder.mirrored);
            fronts |= side > 0;
            backs |= side < 0;
            self.facing.push(side);
        }
        (fronts, backs)
    }

    /// Draws the triangles whose `facing` equals `side`, piece by piece. `side` is 1 for triangles that show
    /// their front, -1 for those that show their back. Returns whether any added pixels.
    fn draw_chain(&mut self, map: &mut RayMap, target: &Target<'_>, mesh: &OccluderMesh, side: i8) -> bool {
        let mut adds = false;
        for first in 0..self.facing.len() {
            if self.facing[first] != side {
                continue;
            }
            self.collect_piece(mesh, first as u32, side);
            let (vertices, facing, piece) = (&self.vertices, &self.facing, &self.piece);
            let corners = |t: u32| mesh.triangles()[t as usize].map(|i| vertices[i as usize]);
            // Most leaves of a tree are narrower than the viewcell, and so cover no pixel.
            let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            for corner in piece.iter().flat_map(|&t| corners(t)) {
                (lo, hi) = (lo.min(corner), hi.max(corner));
            }
            let Target { direction, window, near, .. } = *target;
            let rect = pixels_behind(&LocalBox { lo, hi }, direction, window, near);
            let Some(rect) = rect.filter(|&rect| !map.all_set(rect)) else { continue };
            let target = &Target { rect, ..*target };
            let contour = piece.iter().flat_map(|&t| {
                let (edges, corners) = (mesh.triangle_edges()[t as usize], corners(t));
                (0..3).filter_map(move |corner| {
                    let other = neighbour(mesh, edges[corner], t);
                    let inner = other.is_some_and(|other| facing[other as usize] == 2 * side);
                    (!inner).then_some(([corners[corner], corners[(corner + 1) % 3]], None))
                })
            });
            adds |= self.maps.draw(map, target, piece.iter().map(|&t| (corners(t), None)), contour);
        }
        adds
    }

    /// Collects into `piece` the triangles with facing `side` that are connected to `first` across edges.
    fn collect_piece(&mut self, mesh: &OccluderMesh, first: u32, side: i8) {
        self.piece.clear();
        self.stack.push(first);
        self.facing[first as usize] = 2 * side;
        while let Some(triangle) = self.stack.pop() {
            self.piece.push(triangle);
            for edge in mesh.triangle_edges()[triangle as usize] {
                if let Some(other) = neighbour(mesh, edge, triangle)
                    && self.facing[other as usize] == side
                {
                    self.facing[other as usize] = 2 * side;
                    self.stack.push(other);
                }
            }
        }
    }
}

/// Returns the other triangle at an edge. `None` unless the edge has exactly two triangles.
#[inline]
fn neighbour(mesh: &OccluderMesh, edge: u32, triangle: u32) -> Option<u32> {
    let edge = &mesh.edges()[edge as usize];
    edge.right.map(|right| if edge.left == triangle { right } else { edge.left })
}
