//! Regions: neighbouring faces that are flat together, or nearly so, to be drawn as one polygon.

use crate::faces::{Face, Faces, Side};
use alloc::vec::Vec;
use visibility_core::geometry::sqrt;
use visibility_core::glam::DVec3;

/// Least cosine of the angle between the normals of a region's first face and of any other face in it. The
/// angle is less than half a right angle, so that all faces are on the front side of a mean of their normals.
/// Wider angles would join few more faces.
const MIN_COSINE: f64 = 0.85;

/// Maximum number of sides at an edge across which regions grow. Faces at more crowded edges are not
/// neighbours there: to look at each pair of them takes the square of their number.
const MAX_SIDES_OF_EDGE: usize = 32;

/// Faces that are connected through edges, face alike, and lie within a slab.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    /// Range of the region's faces in [`Regions::members`], half-open.
    pub(crate) members: [u32; 2],
    /// Unit normal of the two planes between which the faces lie.
    pub(crate) normal: DVec3,
    /// Least and greatest coordinate along `normal` of the region's vertices, in metres, without a margin for
    /// rounding.
    pub(crate) extent: [f64; 2],
    /// Sum of the areas of the faces in square metres.
    pub(crate) area: f64,
    /// Least cosine of the angle between `normal` and the normals of the faces. The normals of
    /// [turned](Member::turned) faces are reversed.
    pub(crate) min_cosine: f64,
    /// True if all faces are two-sided, false if none is.
    pub(crate) two_sided: bool,
}

/// A face of a region.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Member {
    /// Index of the face.
    pub(crate) face: u32,
    /// True if the front of the face is the back of the region. Only two-sided faces are turned.
    pub(crate) turned: bool,
}

/// A partition of all faces into regions.
#[derive(Clone, Debug, Default)]
pub(crate) struct Regions {
    /// All regions. Each face is in exactly one.
    pub(crate) regions: Vec<Region>,
    /// Faces of all regions, region by region.
    pub(crate) members: Vec<Member>,
}

impl Region {
    /// Computes extent, area and least cosine from the `normal` and the faces with their orientations.
    pub(crate) fn measure(&mut self, faces: &Faces, members: &[Member]) {
        (self.extent, self.area) = ([f64::INFINITY, f64::NEG_INFINITY], 0.0);
        self.min_cosine = 1.0;
        for member in members {
            let face = &faces.faces[member.face as usize];
            self.area += face.area;
            self.min_cosine = self.min_cosine.min(self.normal.dot(member.normal(face)));
            for &vertex in faces.corners_of(face) {
                let along = self.normal.dot(faces.at(vertex));
                self.extent = [self.extent[0].min(along), self.extent[1].max(along)];
            }
        }
    }

    /// Replaces the `normal` by the mean of the normals of `members`, weighted by area, if that makes the
    /// layer that holds the faces thinner.
    fn fit(&mut self, faces: &Faces, members: &[Member]) {
        let mean = members.iter().fold(DVec3::ZERO, |sum, member| {
            let face = &faces.faces[member.face as usize];
            sum + member.normal(face) * face.area
        });
        let mut other = Self { normal: mean.normalize_or(self.normal), ..self.clone() };
        other.measure(faces, members);
        let thickness = |region: &Self| region.extent[1] - region.extent[0];
        if thickness(&other) < thickness(self) {
            *self = other;
        }
    }
}

impl Member {
    /// Returns the normal of the member's face, reversed if the face is [turned](Self::turned).
    fn normal(&self, face: &Face) -> DVec3 {
        if self.turned { -face.normal } else { face.normal }
    }
}

impl Regions {
    /// Grows regions from the largest faces on. A face joins a region if it shares an edge with it, is close
    /// to the plane of the region's first face, hides from the same sides, and faces the same way up to
    /// [`MIN_COSINE`]. Close is within `flatness` metres, or within `bulge` times the square root of the
    /// region's area. `sides` are all sides of the faces, sorted by edge. Regions do not grow across an edge
    /// of more than [`MAX_SIDES_OF_EDGE`] sides.
    pub(crate) fn find(faces: &Faces, sides: &[Side], flatness: f64, bulge: f64) -> Self {
        // For each corner, the range of the sides at the edge that begins at the corner; empty if there are
        // too many.
        let mut sides_of_edge = alloc::vec![[0u32; 2]; faces.corners.len()];
        let mut at = 0;
        for same in sides.chunk_by(|a, b| a.edge == b.edge) {
            let range = [at, at + same.len() as u32];
            if same.len() <= MAX_SIDES_OF_EDGE {
                same.iter().for_each(|side| sides_of_edge[side.corner as usize] = range);
            }
            at = range[1];
        }
        let neighbours = |corner: u32| {
            let [first, end] = sides_of_edge[corner as usize];
            sides[first as usize..end as usize].iter()
        };
        // Regions begin with the largest faces, whose planes are the most certain.
        let mut order: Vec<u32> = (0..faces.faces.len() as u32).collect();
        order.sort_by(|&a, &b| {
            faces.faces[b as usize].area.total_cmp(&faces.faces[a as usize].area).then(a.cmp(&b))
        });
        let mut taken = alloc::vec![false; faces.faces.len()];
        let mut found = Self::default();
        for seed in order {
            if core::mem::replace(&mut taken[seed as usize], true) {
                continue;
            }
            let first = found.members.len();
            found.members.push(Member { face: seed, turned: false });
            let mut region = Region {
                members: [first as u32; 2],
                normal: faces.faces[seed as usize].normal,
                extent: [f64::INFINITY, f64::NEG_INFINITY],
                area: faces.faces[seed as usize].area,
                min_cosine: 1.0,
                two_sided: faces.faces[seed as usize].two_sided,
            };
            let plane = region.normal.dot(faces.at(faces.corners_of(&faces.faces[seed as usize])[0]));
            let mut next = first;
            // Breadth-first search from the region's first face.
            while let Some(&member) = found.members.get(next) {
                next += 1;
                let face = &faces.faces[member.face as usize];
                for corner in face.corners[0]..face.corners[1] {
                    let own = neighbours(corner).find(|side| side.corner == corner);
                    let Some(own) = own else { continue };
                    for side in neighbours(corner) {
                        if taken[side.face as usize] {
                            continue;
                        }
                        let Some(turned) = turn(faces, &region, member, own, side) else { continue };
                        let area = region.area + faces.faces[side.face as usize].area;
                        let limit = flatness.max(bulge * sqrt(area));
                        let flat = |v: u32| {
                            #[cfg(test)]
                            visibility_testing::step();
                            (region.normal.dot(faces.at(v)) - plane).abs() <= limit
                        };
                        // The other corners lie between these, and `measure` takes the extent of all.
                        // Neighbours do not test all, since there may be as many corners as neighbours.
                        if faces.faces[side.face as usize].triangle.into_iter().all(flat) {
                            taken[side.face as usize] = true;
                            region.area = area;
                            found.members.push(Member { face: side.face, turned });
                        }
                    }
                }
            }
            region.members[1] = found.members.len() as u32;
            region.measure(faces, &found.members[first..]);
            region.fit(faces, &found.members[first..]);
            found.regions.push(region);
        }
        found
    }
}

/// Returns whether the face of `side` must be turned over to continue a region. It shares an edge with the
/// region's face `member`, whose side of the edge is `own`. `None` if the face cannot continue the region:
/// its normal is too far from the region's, it would traverse the edge in the same direction as `member`, or
/// it occludes from other sides.
fn turn(faces: &Faces, region: &Region, member: Member, own: &Side, side: &Side) -> Option<bool> {
    let face = &faces.faces[side.face as usize];
    let cosine = face.normal.dot(region.normal);
    let turned = cosine < 0.0;
    // Neighbours, once turned, must traverse their common edge in opposite directions.
    let is_opposite = (own.forward != member.turned) != (side.forward != turned);
    (cosine.abs() >= MIN_COSINE
        && is_opposite
        && face.two_sided == region.two_sided
        && (!turned || face.two_sided))
        .then_some(turned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::LevelTriangle;
    use crate::t_junctions::insert_t_junctions;
    use visibility_core::glam::Vec3;
    use visibility_testing::steps_of;

    /// Returns the regions of triangles, sorted by edge.
    fn found(triangles: &[([[f32; 3]; 3], bool)], flatness: f64, bulge: f64) -> (Faces, Regions) {
        let triangle = |&(corners, two_sided): &([[f32; 3]; 3], bool)| LevelTriangle {
            corners: corners.map(Vec3::from_array),
            two_sided,
        };
        let faces = Faces::weld(&triangles.iter().map(triangle).collect::<Vec<_>>());
        let regions = Regions::find(&faces, &faces.sides(), flatness, bulge);
        (faces, regions)
    }

    /// Two triangles at one edge are a region if they are flat enough, hide from the same sides, and traverse
    /// the edge in opposite directions, once one that faces the other way is turned. Those of one side that
    /// face different ways are none.
    #[test]
    fn neighbours_that_face_alike_are_one_region() {
        let [a, b, c] = [[0.0; 3], [4.0, 0.0, 0.0], [2.0, 4.0, 0.0]];
        let (beyond, above, upright) = ([2.0, -4.0, 0.0], [2.0, 3.0, 0.0], [2.0, 0.0, 4.0]);
        for (other, sides, expected) in [
            ([b, a, beyond], [true, true], 1),
            ([b, a, beyond], [false, false], 1),
            ([b, a, beyond], [true, false], 2),
            ([b, a, beyond], [false, true], 2),
            ([a, b, beyond], [true, true], 1),
            ([a, b, beyond], [false, false], 2),
            ([a, b, above], [true, true], 2),
            ([a, b, above], [false, false], 2),
            ([b, a, above], [true, true], 2),
            ([b, a, upright], [true, true], 2),
        ] {
            let (_, regions) = found(&[([a, b, c], sides[0]), (other, sides[1])], 0.0, 9.0);
            assert_eq!(regions.regions.len(), expected, "regions with {other:?}, two sides: {sides:?}");
        }
    }

    /// A face joins if it is within the flatness or the bulge of the plane, whichever is more, and exactly in
    /// the plane if both are nothing. The region measures how far its vertices and normals are apart.
    #[test]
    fn regions_are_as_flat_as_asked_for() {
        let corners = |height: f32| {
            let [a, b, c, d] = [[0.0; 3], [4.0, 0.0, 0.0], [2.0, 4.0, 0.0], [2.0, -3.0, height]];
            [([a, b, c], false), ([b, a, d], false)]
        };
        for (height, flatness, bulge, expected) in [
            (0.0, 0.0, 0.0, 1),
            (0.25, 0.0, 0.0, 2),
            (0.25, 0.25, 0.0, 1),
            (0.25, 0.24, 0.0, 2),
            (-0.25, 0.0, 0.1, 1),
            (-0.25, 0.0, 0.06, 2),
            (-0.25, 0.25, 0.01, 1),
        ] {
            let (_, regions) = found(&corners(height), flatness, bulge);
            let case = (height, flatness, bulge);
            assert_eq!(regions.regions.len(), expected, "height, flatness, bulge {case:?}");
            if expected == 1 {
                let Region { normal, extent, min_cosine, .. } = regions.regions[0];
                let along =
                    corners(height).map(|(t, _)| t.map(|p| normal.dot(Vec3::from_array(p).as_dvec3())));
                let along = along.as_flattened();
                let expected = [
                    along.iter().copied().fold(f64::INFINITY, f64::min),
                    along.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                ];
                assert_eq!(extent, expected, "the extent of {case:?}");
                // The normals of the faces are (0, 0, 1) and (0, height, 3), scaled to a length of 1.
                let height = f64::from(height);
                let second = DVec3::new(0.0, height, 3.0).normalize().dot(normal);
                let least = normal.z.min(second);
                assert!((min_cosine - least).abs() < 1e-15, "{case:?}: {min_cosine} instead of {least}");
            }
        }
    }

    #[test]
    fn faces_at_one_edge_are_neighbours_unless_there_are_too_many() {
        // Pages of a book, all at the same edge, and two of them in one plane.
        let book = |pages: usize| {
            let page =
                |i: usize| ([[0.0; 3], [0.0, 0.0, 1.0], [10.0 + i as f32, 1.0 + (i * i) as f32, 0.0]], false);
            let opposite = ([[0.0, 0.0, 1.0], [0.0; 3], [-10.0, -1.0, 0.0]], false);
            let pages: Vec<_> = (0..pages - 1).map(page).chain([opposite]).collect();
            found(&pages, 0.0, 0.0).1.regions.len()
        };
        assert_eq!(book(32), 31, "of 32 pages at one edge, the two in one plane are one polygon");
        assert_eq!(book(33), 33, "of 33 pages at one edge, none are joined");
    }

    /// A sliver at whose long side very many larger triangles end, none of them in its plane.
    #[test]
    fn steps_grow_as_triangles_do() {
        let steps = [250, 500, 1000].map(|count| {
            let size = count as f32;
            let sliver = [Vec3::ZERO, Vec3::X * size, Vec3::new(size, 1.0, 0.5)];
            let neighbour = |i: usize| {
                let x = Vec3::X * i as f32;
                [x + Vec3::X, x, x + Vec3::new(0.5, -2.0 * size, 0.0)]
            };
            let triangles: Vec<LevelTriangle> = core::iter::once(sliver)
                .chain((0..count).map(neighbour))
                .map(|corners| LevelTriangle { corners, two_sided: true })
                .collect();
            let mut faces = Faces::weld(&triangles);
            let sides = faces.sides();
            assert_eq!(insert_t_junctions(&mut faces, &sides), [count - 1, 0], "corners inserted");
            let sides = faces.sides();
            let mut regions = 0;
            let steps = steps_of(|| regions = Regions::find(&faces, &sides, 0.0, 0.0).regions.len());
            assert_eq!(regions, count + 1, "no two faces lie in one plane");
            assert!(steps >= count as u64, "each neighbour tests the sliver: {steps}");
            steps as f64
        });
        std::println!("steps for 250, 500 and 1000 neighbours: {steps:?}");
        assert!(steps[1] < 2.6 * steps[0] && steps[2] < 2.6 * steps[1], "{steps:?}");
    }
}
