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

#[cfg(test)]
mod tests {
    use super::super::ray_map::{PixelRect, SIDE};
    use super::*;
    use visibility_core::Aabb;
    use visibility_core::glam::{Affine3A, Vec3};
    use visibility_core::scene::Triangle;

    /// A direction of a viewcell of 2 by 2 by 1 metres.
    fn direction() -> Direction {
        let rows = [DVec3::X, DVec3::Y, DVec3::Z];
        Direction { rows, offset: [0.0; 3], half: [1.0; 2], exact: [None; 2], depth: 1.0, error: 1e-12 }
    }

    fn window(d: f64, reach: f64) -> Window {
        Window::from_zero(d, [[-reach, reach]; 2])
    }

    /// Draws a mesh on the plane at depth 60, with vertices that are off by `error`.
    fn draws(mesh: &OccluderMesh, error: f64) -> bool {
        let (direction, window) = (direction(), window(60.0, 128.0));
        let mut occluder = Occluder::new(&direction, mesh, &Affine3A::IDENTITY).unwrap();
        occluder.error = error;
        let rect = PixelRect { x: [0, SIDE - 1], y: [0, SIDE - 1] };
        let target = Target { direction: &direction, window: &window, near: 0.1, rect };
        let mut map = RayMap::new();
        let adds = OccluderRaster::new().draw_mesh(&mut map, &target, &occluder, mesh);
        assert_eq!(adds, map.any_set(), "whether pixels are added");
        adds
    }

    /// A quadrangle at depth `z` that shows its front to the viewcell, or its back.
    fn wall(half: f32, z: f32, is_front: bool) -> [Triangle; 2] {
        let [a, b, c, d] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| Vec3::new(x * half, y * half, z));
        if is_front { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] }
    }

    fn cuboid(half: f32, z: [f32; 2]) -> OccluderMesh {
        let [a, b] = z.map(|z| Vec3::new(half, half, z));
        OccluderMesh::cuboid(&Aabb::new(a * Vec3::new(-1.0, -1.0, 1.0), b)).unwrap()
    }

    /// Triangles of several meshes, as one mesh.
    fn together(meshes: &[OccluderMesh]) -> OccluderMesh {
        let corners = |mesh: &OccluderMesh| -> Vec<Triangle> {
            let corner = |i: u32| mesh.positions()[i as usize];
            mesh.triangles().iter().map(|t| t.map(corner)).collect()
        };
        OccluderMesh::from_triangles(&meshes.iter().flat_map(corners).collect::<Vec<_>>()).unwrap()
    }

    /// Fronts hide; backs hide if they are two-sided and not of a closed mesh that shows fronts, or if they
    /// are of a convex solid seen from outside. The front of what is narrow and near covers no pixel of the
    /// plane.
    #[test]
    fn backs_hide_where_they_are_seen_or_where_fronts_were_met_before() {
        let one = |triangles: &[Triangle]| OccluderMesh::from_triangles(triangles).unwrap();
        let [front, back] = [true, false].map(|is_front| one(&wall(9.0, 50.0, is_front)));
        // A narrow front before a wide back.
        let both = one(&[wall(0.5, 1.0, true), wall(9.0, 50.0, false)].concat());
        let solid = cuboid(0.9, [1.0, 59.0]);
        let pair = together(&[solid.clone(), cuboid(0.1, [62.0, 63.0])]);
        let room = OccluderMesh::cuboid(&Aabb::new(Vec3::splat(-50.0), Vec3::splat(50.0))).unwrap();
        assert!(
            solid.is_convex() && room.is_convex() && pair.is_closed(),
            "solids are convex, a pair is closed"
        );
        assert!(!pair.is_convex() && !both.is_closed(), "a pair is not convex, two walls are not closed");
        let cases = [
            ("a front", front, [true, true]),
            ("a back", back, [false, true]),
            ("a front and a back", both, [false, true]),
            ("a convex solid", solid, [true, true]),
            ("two solids", pair, [false, false]),
            ("a room from within", room, [false, true]),
        ];
        for (name, mesh, expected) in cases {
            for (two_sided, expected) in [false, true].into_iter().zip(expected) {
                let mesh = mesh.clone().with_two_sided(two_sided);
                assert_eq!(draws(&mesh, 1e-12), expected, "{name}, two-sided: {two_sided}");
            }
        }
    }

    /// A solid that is nearer to the viewcell than its vertices are off may hold a part of it.
    #[test]
    fn backs_of_a_solid_do_not_hide_if_it_may_hold_the_viewcell() {
        for (error, is_outside) in [(0.25, false), (0.15, true)] {
            let solid = cuboid(50.0, [0.2, 50.2]);
            assert_eq!(
                draws(&solid, error),
                is_outside,
                "0.2 m before a solid whose vertices are off by {error}"
            );
        }
    }

    /// Triangles whose vertices may be off so much that the viewcell is on both sides of them face nothing.
    #[test]
    fn walls_nearer_than_their_error_face_nothing() {
        let mesh = OccluderMesh::from_triangles(&wall(50.0, 0.2, true)).unwrap();
        for (error, expected) in [(1e-12, true), (0.3, false)] {
            assert_eq!(draws(&mesh, error), expected, "a wall at 0.2 m that is off by {error}");
        }
    }

    /// An occluder is drawn if its vertices are off by less than a quarter of the slack on the plane: at the
    /// corner of its bounds that is nearest and farthest to the side, as seen from the opposite corner of the
    /// viewcell's front. Derivatives of the position on the plane tell how much.
    #[test]
    fn occluders_are_drawn_if_their_errors_are_less_than_a_quarter_of_the_slack() {
        let (direction, mesh) = (direction(), cuboid(1.0, [1.0, 2.0]));
        let mut occluder = Occluder::new(&direction, &mesh, &Affine3A::IDENTITY).unwrap();
        let (d, near) = (16.0, 2.0);
        let window = window(d, 64.0);
        for (lo, hi) in [([-9.0, -1.0], [3.0, 2.0]), ([-1.0, -2.0], [1.0, 9.0]), ([1.0, 2.0], [1.5, 9.0])] {
            for depths in [[1.0, 9.0], [2.0, 9.0], [4.0, 9.0]] {
                let bounds = LocalBox {
                    lo: DVec3::new(lo[0], lo[1], depths[0]),
                    hi: DVec3::new(hi[0], hi[1], depths[1]),
                };
                let z = f64::max(depths[0], near);
                let off = [0, 1].map(|lat: usize| {
                    let x = f64::max(f64::abs(lo[lat]), f64::abs(hi[lat])) + 1.0;
                    (d / z + x * d / (z * z)) * SIDE as f64 / 128.0
                });
                // Twice the slack in halves: what is twice as much, or half, is decided the other way.
                for (part, decides) in [(0.9, true), (1.1, false)] {
                    let error = part * SLACK * 0.25 / off[0].max(off[1]);
                    (occluder.error, occluder.bounds) = (error, bounds);
                    let found = OccluderRaster::decides(&direction, &window, &occluder, near);
                    assert_eq!(found, decides, "{part} of a quarter of the slack at {bounds:?}");
                }
            }
        }
    }

    #[test]
    fn occluders_that_add_nothing_or_are_imprecise_are_left_out() {
        let (direction, window, mesh) = (direction(), window(60.0, 128.0), cuboid(9.0, [40.0, 50.0]));
        let occluder = Occluder::new(&direction, &mesh, &Affine3A::IDENTITY).unwrap();
        let (mut raster, mut map, mut work) = (OccluderRaster::new(), RayMap::new(), Work::UNLIMITED);
        let mut draw = |map: &mut RayMap, occluder: &Occluder<'_>| {
            raster.draw(map, &direction, &window, occluder, 0.1, &mut work)
        };
        let mut imprecise = occluder;
        imprecise.error = 0.01;
        assert_eq!(draw(&mut map, &imprecise), Drawn::LeftOut, "vertices are off by a centimetre");
        assert!(!map.any_set(), "pixels of an imprecise occluder");
        assert_eq!(draw(&mut map, &occluder), Drawn::Pixels, "the first time");
        assert_ne!(draw(&mut map, &occluder), Drawn::Pixels, "the second time");
        (0..SIDE).for_each(|row| map.set_span(row, 0, SIDE - 1));
        assert_eq!(draw(&mut map, &occluder), Drawn::LeftOut, "on a full map");
    }
}
