//! Occluders in local coordinates of a direction.

use super::direction::{Direction, LocalBox};
use super::pieces::{Piece, Pieces};
use super::ray_map::{PixelRect, SIDE};
use super::surfaces::Surfaces;
use super::window::Window;
use visibility_core::geometry::keeps_orientation;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{ObjectId, OccluderMesh};

/// Identifies an occluder in the scene or among the pieces of a viewcell.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Source {
    /// Index of a piece among the [`Pieces`] of the viewcell.
    Piece(u32),
    /// A part of an object's mesh, by the object's id and the part's index.
    Part(ObjectId, u32),
}

/// An occluder in local coordinates of a direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Occluder<'a> {
    pub(super) shape: Shape<'a>,
    /// Rows of the map from mesh coordinates to local coordinates, before `offset` is added.
    rows: [DVec3; 3],
    offset: DVec3,
    /// Bound on the error of each local coordinate of a vertex, in metres.
    pub(super) error: f64,
    /// True if the map mirrors: front faces then run clockwise in local coordinates.
    pub(super) mirrored: bool,
    pub(crate) bounds: LocalBox,
}

/// Geometry from which an occluder is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape<'a> {
    /// A mesh, or a part of a mesh, in mesh coordinates.
    Mesh(&'a OccluderMesh),
    /// A piece of joined surfaces: its triangles, all of which face the viewcell, and the segments of its
    /// boundary.
    Piece { surfaces: &'a Surfaces, triangles: &'a [u32], contour: &'a [u32] },
}

impl<'a> Occluder<'a> {
    /// Makes the occluder of a mesh. `None` if its transform flattens it, or if coordinates are not finite.
    pub(crate) fn new(direction: &Direction, mesh: &'a OccluderMesh, transform: &Affine3A) -> Option<Self> {
        let columns = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis]
            .map(|column| DVec3::from_array(column.to_array().map(f64::from)));
        let translation = DVec3::from_array(transform.translation.to_array().map(f64::from));
        let rows = direction.rows.map(|row| DVec3::from_array(columns.map(|column| row.dot(column))));
        let offset = DVec3::from_array(direction.rows.map(|row| row.dot(translation)))
            - DVec3::from_array(direction.offset);
        let (min, max) = (mesh.bounds().min.as_dvec3(), mesh.bounds().max.as_dvec3());
        let far = min.abs().max(max.abs());
        let magnitude = translation.abs().element_sum()
            + (0..3).map(|axis| columns[axis].abs().element_sum() * far[axis]).sum::<f64>();
        // The products of rows and columns round three products and two sums, those with a vertex as many,
        // and the offset is added. With u = EPSILON / 2 this is less than 16 u of the magnitude. The error of
        // the offset is that of the direction.
        let error = 16.0 * f64::EPSILON * magnitude + direction.error;
        // The transform itself is asked whether it mirrors: the rows have rounded, so the sign of their
        // determinant is unknown where the mesh is flattened along one of them.
        let [x, y, z] = direction.rows;
        let mirrored = keeps_orientation(transform)? != (x.cross(y).dot(z) > 0.0);
        if !error.is_finite() {
            return None;
        }
        let (mut lo, mut hi) = (offset, offset);
        for axis in 0..3 {
            let (a, b) = (rows[axis] * min, rows[axis] * max);
            lo[axis] += a.min(b).element_sum();
            hi[axis] += a.max(b).element_sum();
        }
        let bounds = LocalBox { lo, hi };
        let shape = Shape::Mesh(mesh);
        Some(Self { shape, rows, offset, error, mirrored, bounds })
    }

    /// Makes the occluder of a piece, in local coordinates of a direction.
    pub(crate) fn piece(
        direction: &Direction,
        surfaces: &'a Surfaces,
        pieces: &'a Pieces,
        piece: &'a Piece,
    ) -> Self {
        let far = piece.bounds.min.abs().max(piece.bounds.max.abs()).as_dvec3().element_sum();
        let (triangles, contour) = (pieces.triangles(piece), pieces.contour(piece));
        Self {
            shape: Shape::Piece { surfaces, triangles, contour },
            rows: direction.rows,
            offset: -DVec3::from_array(direction.offset),
            // The same bound as for a mesh that has the identity as its transform, which does not round.
            error: 16.0 * f64::EPSILON * far + direction.error,
            mirrored: false,
            bounds: direction.local_box(&piece.bounds),
        }
    }

    /// Converts a vertex from mesh coordinates to local coordinates.
    pub(super) fn local(&self, p: Vec3) -> DVec3 {
        let p = p.as_dvec3();
        DVec3::new(self.rows[0].dot(p), self.rows[1].dot(p), self.rows[2].dot(p)) + self.offset
    }

    /// Returns whether the error of the occluder's vertices is within the margins that planes and occludees
    /// keep: at most 4 times the error of points of the scene. False for a mesh whose transform cancels
    /// nearly all digits.
    pub(crate) fn is_precise(&self, direction: &Direction) -> bool {
        self.error <= 4.0 * direction.error
    }
}

/// Returns the rectangle of all pixels that the part of an occluder between depth `near` and the plane can
/// cover. They are within the projections of `bounds`, which contain the occluder, from all viewpoints.
/// `None` if the rectangle contains no whole pixel.
pub(super) fn pixels_behind(
    bounds: &LocalBox,
    direction: &Direction,
    window: &Window,
    near: f64,
) -> Option<PixelRect> {
    let (near, far) = (bounds.lo.z.max(near), bounds.hi.z.min(window.d));
    (near <= far).then_some(())?;
    let along = |lat| {
        let [left, right] = direction.common_view(window.d, bounds, [near, far], lat);
        let [left, right] = window.widened([left, right], lat);
        let (left, right) = (left.max(0.0), right.min(SIDE as f64));
        (right - left >= 1.0).then_some(())?;
        let first = left as usize + usize::from(left > (left as usize) as f64);
        (first < right as usize).then_some([first, right as usize - 1])
    };
    Some(PixelRect { x: along(0)?, y: along(1)? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Aabb;
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::glam::{Mat3A, Vec3A};
    use visibility_testing::Random;

    fn direction(rows: [DVec3; 3], offset: DVec3) -> Direction {
        let (offset, half) = (offset.to_array(), [0.5; 2]);
        Direction { rows, offset, half, exact: [None; 2], depth: 1.0, error: 1e-12 }
    }

    /// Vertices of placed meshes are right up to the error that they have, beside that of the direction.
    /// Compared in double-double numbers.
    #[test]
    fn vertices_are_within_their_error() {
        let mut random = Random(1);
        // Corners at the origin have no magnitude of their own.
        let meshes = [[-1.0, 1.0], [0.0, 1.0], [-1.0, 0.0]]
            .map(|[a, b]| OccluderMesh::cuboid(&Aabb::new(Vec3::splat(a), Vec3::splat(b))).unwrap());
        for trial in 0..4_000 {
            let mesh = &meshes[trial % 3];
            let first = random.direction();
            let second = first.cross(random.direction()).normalize();
            // The error of the direction is added to that of the vertices.
            let rows = [first, second, first.cross(second)];
            let direction = Direction { error: 1.0, ..direction(rows, random.vector(1e6)) };
            let columns = [0; 3].map(|_| Vec3A::from(random.vec3(-1e3, 1e3)));
            let matrix3 = Mat3A::from_cols(columns[0], columns[1], columns[2]);
            let far = [1e6, 0.0][trial % 2];
            let transform = Affine3A { matrix3, translation: random.vec3(-far, far).into() };
            let Some(occluder) = Occluder::new(&direction, mesh, &transform) else { continue };
            for &vertex in mesh.positions() {
                let local = occluder.local(vertex);
                let in_scene = [0, 1, 2].map(|k| {
                    let terms =
                        [0, 1, 2].map(|i| DoubleDouble::product(columns[i][k].into(), vertex[i].into()));
                    terms[0].plus(terms[1]).plus(terms[2]).plus(f64::from(transform.translation[k]).into())
                });
                for (k, row) in direction.rows.iter().enumerate() {
                    let [x, y, z] = [0, 1, 2].map(|i| DoubleDouble::from(row[i]).times(in_scene[i]));
                    let exact = x.plus(y).plus(z).plus(DoubleDouble::from(-direction.offset[k]));
                    // The error of the direction is for the offset.
                    let off = exact.plus(DoubleDouble::from(-local[k])).hi.abs()
                        - direction.offset[k].abs() * f64::EPSILON;
                    assert!(off <= occluder.error - direction.error, "trial {trial}: {vertex} off by {off}");
                    let reach = occluder.error;
                    let is_held =
                        (occluder.bounds.lo[k] - reach..=occluder.bounds.hi[k] + reach).contains(&local[k]);
                    assert!(is_held, "trial {trial}: {local} within {:?}", occluder.bounds);
                }
            }
        }
    }

    /// Whether a transform mirrors is told rightly, or the mesh is no occluder. Compared in integers: the
    /// third column is nearly a sum of the other two.
    #[test]
    fn flat_transforms_are_not_said_to_mirror() {
        let mut random = Random(2);
        let cube = Aabb::new(Vec3::splat(-1.0), Vec3::splat(1.0));
        let mesh = OccluderMesh::cuboid(&cube).unwrap();
        let direction = direction([DVec3::X, DVec3::Y, DVec3::Z], DVec3::ZERO);
        let mut counts = [0; 2];
        for trial in 0..40_000 {
            let most = 1 << 22;
            let mut vector = |most: i64| [0; 3].map(|_| (random.bits() >> 10) as i64 % (2 * most + 1) - most);
            let (a, b) = (vector(most), vector(most));
            let off = vector([0, 1, 1 << 12][trial % 3]);
            let c = [0, 1, 2].map(|k| a[k] + b[k] + off[k]);
            let [a, b, c] = [a, b, c].map(|v| v.map(i128::from));
            let exact: i128 = (0..3)
                .map(|k| (a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]) * c[k])
                .sum();
            let [x, y, z] = [a, b, c].map(|v| Vec3A::from(v.map(|x| x as f32)));
            let transform = Affine3A { matrix3: Mat3A::from_cols(x, y, z), translation: Vec3A::ZERO };
            let found = Occluder::new(&direction, &mesh, &transform);
            counts[usize::from(found.is_some())] += 1;
            if let Some(found) = found {
                assert!(exact != 0 && found.mirrored == (exact < 0), "trial {trial}: {a:?} {b:?} {c:?}");
            }
        }
        assert!(counts.iter().all(|&count| count > 5_000), "refused and placed: {counts:?}");
    }

    /// A transform that flattens a mesh along an axis of the direction: rows and columns are orthogonal, so
    /// that the determinant of their products is made of rounding alone. The third column is the sum of the
    /// other two, exactly.
    #[test]
    fn flat_transforms_across_the_direction_have_no_occluder() {
        let mut random = Random(3);
        let cube = Aabb::new(Vec3::splat(-1.0), Vec3::splat(1.0));
        let mesh = OccluderMesh::cuboid(&cube).unwrap();
        for trial in 0..2_000 {
            let mut integers = || random.vector(1e3).round();
            let (a, b) = (integers(), integers());
            let (first, across) = (a.normalize_or_zero(), a.cross(b).normalize_or_zero());
            let direction = direction([first, across.cross(first), across], DVec3::ZERO);
            let [x, y, z] = [a, b, a + b].map(|v| Vec3A::from(v.as_vec3()));
            let transform = Affine3A { matrix3: Mat3A::from_cols(x, y, z), translation: Vec3A::ZERO };
            let found = Occluder::new(&direction, &mesh, &transform).map(|occluder| occluder.mirrored);
            assert_eq!(found, None, "trial {trial}: {a} {b}");
        }
    }

    /// Whether an occluder is mirrored depends on its transform and on the direction, three of which have
    /// left-handed coordinates.
    #[test]
    fn an_occluder_is_mirrored_by_its_transform_or_by_the_direction() {
        let cube = Aabb::new(Vec3::splat(-1.0), Vec3::splat(1.0));
        let mesh = OccluderMesh::cuboid(&cube).unwrap();
        for (z, back) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
            let direction = direction([DVec3::X, DVec3::Y, DVec3::Z * back], DVec3::ZERO);
            let transform = Affine3A::from_scale(Vec3::new(1.0, 1.0, z));
            let found = Occluder::new(&direction, &mesh, &transform).map(|occluder| occluder.mirrored);
            assert_eq!(found, Some(f64::from(z) * back < 0.0), "scaled by {z}, a direction along {back}");
        }
        let direction = direction([DVec3::X, DVec3::Y, DVec3::Z], DVec3::ZERO);
        let far = Affine3A::from_translation(Vec3::new(f32::INFINITY, 0.0, 0.0));
        assert!(Occluder::new(&direction, &mesh, &far).is_none(), "a mesh that is infinitely far");
    }

    /// Vertices of pieces, whose triangles are in scene coordinates, are right up to the error that they
    /// have. One corner is at the origin, which has no magnitude of its own.
    #[test]
    fn vertices_of_pieces_are_within_their_error() {
        use crate::sweep::cell_extent::CellExtent;
        use crate::sweep::direction::CellBox;
        use crate::sweep::effort::Effort;
        use visibility_core::pvs::Viewcell;
        use visibility_core::{Object, Scene, VisibleSet};
        let (mut random, mut found) = (Random(4), 0);
        for trial in 0..2_000 {
            let [least, most] = if trial % 2 == 0 { [0.0, 1e6] } else { [-1e6, 0.0] };
            let corners = [Vec3::ZERO, random.vec3(least, most), random.vec3(least, most)];
            let Ok(mesh) = OccluderMesh::from_triangles(&[corners]) else { continue };
            let mut scene = Scene::new();
            let id = scene.insert(Object { occluder: true, ..Object::new(*mesh.bounds()) });
            let mesh = scene.add_mesh(mesh.with_two_sided(true));
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
            let viewcell = Viewcell::from_box(DVec3::new(7.0, 3.0, 2.0), DVec3::new(8.0, 4.0, 3.0));
            let extent = CellExtent::new(&viewcell, DVec3::ZERO).unwrap();
            let cell = CellBox::new(&extent, scene.bounds(id).as_ref().unwrap(), DVec3::AXES).unwrap();
            let (surfaces, mut pieces) = (Surfaces::new(&scene), Pieces::default());
            pieces.begin(&surfaces, &Effort::FULL, &viewcell);
            let occluding = crate::solids::occluding(&scene, &VisibleSet::new());
            let range = pieces.find(&surfaces, 0, &occluding, &cell);
            let first = random.direction();
            let second = first.cross(random.direction()).normalize();
            let rows = [first, second, first.cross(second)];
            let direction = Direction { error: 1.0, ..direction(rows, DVec3::ZERO) };
            for piece in range {
                let occluder = Occluder::piece(&direction, &surfaces, &pieces, pieces.get(piece));
                found += 1;
                for corner in corners {
                    let local = occluder.local(corner);
                    for (k, row) in direction.rows.iter().enumerate() {
                        let [x, y, z] = [0, 1, 2].map(|i| DoubleDouble::product(row[i], corner[i].into()));
                        let off = x.plus(y).plus(z).plus(DoubleDouble::from(-local[k])).hi.abs();
                        assert!(off <= occluder.error - 1.0, "trial {trial}: {corner} off by {off}");
                    }
                }
            }
        }
        assert!(found > 1_000, "{found} pieces");
    }

    #[test]
    fn occluders_with_more_than_four_times_the_error_of_the_direction_are_imprecise() {
        let mesh = OccluderMesh::cuboid(&Aabb::new(Vec3::splat(-1.0), Vec3::splat(1.0))).unwrap();
        let direction = direction([DVec3::X, DVec3::Y, DVec3::Z], DVec3::ZERO);
        let occluder = Occluder::new(&direction, &mesh, &Affine3A::IDENTITY).unwrap();
        for (times, is_precise) in [(1.0, true), (3.0, true), (4.0, true), (5.0, false), (7.0, false)] {
            let occluder = Occluder { error: times * direction.error, ..occluder };
            assert_eq!(occluder.is_precise(&direction), is_precise, "{times} times the error");
        }
    }

    /// The rectangle of an occluder holds the whole pixels that all viewpoints see behind its bounds, and no
    /// other. A pixel is a metre wide. Compared with rays from the corners of the viewcell.
    #[test]
    fn pixels_behind_bounds_are_those_that_all_viewpoints_see_behind_them() {
        use alloc::vec::Vec;
        let (mut random, mut counts) = (Random(5), [0; 2]);
        let direction = direction([DVec3::X, DVec3::Y, DVec3::Z], DVec3::ZERO);
        let d = 16.0;
        let window = Window::from_zero(d, [[0.0, SIDE as f64]; 2]);
        for trial in 0..20_000 {
            let near = random.pick(&[0.5, 2.0, 8.0]);
            let depths = [random.range(0.1, 30.0), random.range(0.1, 30.0)];
            // Boxes across the corner of the window.
            let size = [6.0, 40.0][trial % 2];
            let (p, q) = (random.vector(size) + 3.0, random.vector(size) + 3.0);
            let bounds = LocalBox {
                lo: p.min(q).with_z(depths[0].min(depths[1])),
                hi: p.max(q).with_z(depths[0].max(depths[1])),
            };
            let ends = [bounds.lo.z.max(near), bounds.hi.z.min(d)];
            // Whether all viewpoints see a pixel behind the bounds, which are widened on the plane.
            let is_behind = |lat: usize, pixel: usize, by: f64| {
                ends[0] <= ends[1]
                    && [[-0.5, 0.0], [0.5, 0.0], [-0.5, 1.0], [0.5, 1.0]].iter().all(|&[v, w]| {
                        let at = |x: f64| ends.map(|z| (v * (z - d) + x * (d + w)) / (z + w));
                        let (low, high) = (at(bounds.lo[lat]), at(bounds.hi[lat]));
                        low[0].min(low[1]) - by <= pixel as f64
                            && (pixel + 1) as f64 <= high[0].max(high[1]) + by
                    })
            };
            let pixels = |lat: usize, by: f64| -> Vec<usize> {
                (0..SIDE).filter(|&pixel| is_behind(lat, pixel, by)).collect()
            };
            // Ends are widened by the slack, 1/1024 of a pixel.
            let (sure, may) = ([0, 1].map(|lat| pixels(lat, 0.5e-3)), [0, 1].map(|lat| pixels(lat, 1.5e-3)));
            let found = pixels_behind(&bounds, &direction, &window, near);
            counts[usize::from(found.is_some())] += 1;
            let Some(rect) = found else {
                assert!(sure.iter().any(Vec::is_empty), "trial {trial}: nothing of {sure:?}");
                continue;
            };
            for (lat, [first, last]) in [rect.x, rect.y].into_iter().enumerate() {
                let holds = |pixel: &usize| (first..=last).contains(pixel);
                assert!(first <= last && sure[lat].iter().all(holds), "trial {trial}: {rect:?} of {sure:?}");
                assert!(last - first < may[lat].len(), "trial {trial}: {rect:?} is more than {may:?}");
            }
        }
        assert!(counts.iter().all(|&count| count > 1_000), "without and with pixels: {counts:?}");
    }
}
