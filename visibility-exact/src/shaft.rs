//! The shaft of two polygons: planes that bound the convex hull of all segments between them. They quickly
//! tell that an edge or a box is met by none of the segments.

use crate::polygon::{MAX_CORNERS, Polygon};
use visibility_core::glam::DVec3;

/// Greatest number of planes of a [`Shaft`]: one for each side of each polygon, and one for each polygon's
/// plane.
const PLANES: usize = 2 * MAX_CORNERS + 2;

/// Planes around two polygons. A point whose height over one of the planes is below `-pad` metres is outside.
///
/// A rounded normal does no harm: the offset of each plane is chosen so that no corner of either polygon is
/// behind the plane, whatever its normal is. Heights are sums of three products and an offset, with unit
/// normals and coordinates of magnitude M. With U the unit round-off of `f64` and delta the error of
/// positions, heights are wrong by 12 U M at the corners, by 12 U M at the tested point, and by 2 delta from
/// the corners' positions. As delta is at least 128 U M, the pad of 4 delta covers these errors.
pub(crate) struct Shaft {
    /// Unit normal and offset of each plane: a point x has the height `normal . x + offset` over it, in
    /// metres.
    planes: [(DVec3, f64); PLANES],
    /// Number of `planes` in use, the first ones.
    count: usize,
    /// Height in metres by which a point must be behind a plane to be certainly outside.
    pub(crate) pad: f64,
}

impl Shaft {
    pub(crate) fn new(p: &Polygon, q: &Polygon, pad: f64) -> Self {
        let mut shaft = Self { planes: [(DVec3::ZERO, 0.0); PLANES], count: 0, pad };
        for (one, other) in [(p, q), (q, p)] {
            let normal = one.normal().normalize_or_zero();
            let towards = normal.dot(other.center() - one.center()) >= 0.0;
            shaft.add(if towards { normal } else { -normal }, one, other);
            let corners = one.corners();
            for (i, &u) in corners.iter().enumerate() {
                let v = corners[(i + 1) % corners.len()];
                for &w in other.corners() {
                    let normal = (v - u).cross(w - u).normalize_or_zero();
                    let heights = corners.iter().chain(other.corners()).map(|x| normal.dot(*x - u));
                    let (least, greatest) = heights.fold((0.0f64, 0.0f64), |(a, b), h| (a.min(h), b.max(h)));
                    // A plane through an edge of one polygon and a corner of the other, with both polygons on
                    // one side.
                    if least >= -shaft.pad || greatest <= shaft.pad {
                        shaft.add(if least >= -shaft.pad { normal } else { -normal }, one, other);
                        break;
                    }
                }
            }
        }
        shaft
    }

    fn add(&mut self, normal: DVec3, one: &Polygon, other: &Polygon) {
        if normal != DVec3::ZERO {
            let corners = one.corners().iter().chain(other.corners());
            let offset = corners.map(|x| -normal.dot(*x)).fold(f64::NEG_INFINITY, f64::max);
            self.planes[self.count] = (normal, offset);
            self.count += 1;
        }
    }

    /// Returns whether all points are certainly outside the same plane of the shaft.
    #[inline]
    pub(crate) fn misses(&self, points: &[DVec3]) -> bool {
        self.planes().any(|(n, d)| points.iter().all(|x| n.dot(*x) + d < -self.pad))
    }

    #[inline]
    fn planes(&self) -> impl Iterator<Item = &(DVec3, f64)> {
        self.planes[..self.count].iter()
    }
}

#[cfg(test)]
mod tests {
    use crate::half::Half;
    use crate::search::Search;
    use crate::sight::{CellBox, Sight, Target};
    use crate::triangles::SceneTriangles;
    use crate::{
        chain::apart, line_side::Edge, line_side::NO_CORNER, polygon::Polygon, search::Budget, shaft::Shaft,
    };
    use std::vec;
    use visibility_core::glam::{DVec3, Vec3};
    use visibility_core::{Aabb, Object, Scene};
    use visibility_testing::Random;

    fn prepared(triangle: [Vec3; 3]) -> SceneTriangles {
        let mut scene = Scene::new();
        let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points(triangle)) });
        scene.set_triangles(id, vec![triangle]).unwrap();
        SceneTriangles::new(&scene)
    }

    /// Corners of the polygons are moved by the error of positions. Points that touch the exact polygons, or
    /// a segment between these, are still not outside of the shaft and not apart from the polygons.
    #[test]
    fn what_touches_by_less_than_the_error_is_not_missed() {
        let mut random = Random(9);
        for round in 0..4000 {
            let mut int =
                |r: i32| DVec3::from_array(core::array::from_fn(|_| f64::from(random.between(-r, r))));
            let (a, b) = (int(40), int(40) + DVec3::X * 100.0);
            let (u, v, w, x) = (int(8), int(8), int(8), int(8));
            if u.cross(v) == DVec3::ZERO || w.cross(x) == DVec3::ZERO {
                continue;
            }
            let exact = [[a, a + u, a + u + v, a + v], [b, b + w, b + w + x, b + x]];
            let triangles = prepared([Vec3::X, Vec3::Y, Vec3::Z]);
            let cell = CellBox { min: DVec3::splat(-150.0), max: DVec3::splat(150.0) };
            let mut search = Search::new(&triangles, cell, 0.0, None);
            assert!(
                search.begin(Target::Triangle(0), Budget { nodes: 0, divided: 0, halvings: 0 }),
                "{round}: the search begins"
            );
            let delta = search.delta;
            let [p, q] = exact.map(|corners| {
                let move_corner = |v: DVec3| {
                    v + DVec3::from_array(core::array::from_fn(
                        |_| if random.one_in(2) { delta } else { -delta },
                    ))
                };
                Polygon::new(&corners.map(move_corner))
            });
            let plane = |polygon: &Polygon| {
                let normal = polygon.normal().normalize();
                let offset = polygon.corners().iter().map(|v| -normal.dot(*v)).fold(f64::MIN, f64::max);
                Half { normal, offset }
            };
            let sight = Sight { p, q, before_p: plane(&p), before_q: plane(&q), near: None };
            let shaft = Shaft::new(&p, &q, search.pad());
            for k in 0..4 {
                // Points of the convex hull of the exact polygons, mostly on its boundary.
                let (x, y) = (exact[0][k], exact[1][(k + round) % 4]);
                for part in [0.0, 0.25, 0.5, 1.0] {
                    assert!(!shaft.misses(&[x + (y - x) * part]), "{round}");
                }
                // Triangles that touch a polygon at a corner, from any side.
                for (at, polygon, plane) in [(x, &p, &sight.before_p), (y, &q, &sight.before_q)] {
                    let touching = [at, at + random.fine_vector(5.0), at + random.fine_vector(5.0)];
                    assert!(!search.apart(&touching, [NO_CORNER; 3], &sight), "{round}");
                    assert!(!apart(&touching, polygon, plane, search.pad()), "{round}");
                }
            }
        }
    }

    /// An edge from a corner of the target triangle through the triangle, in its plane up to rounding, does
    /// not count as behind the target.
    #[test]
    fn edges_in_the_plane_of_the_target_are_met() {
        let mut random = Random(11);
        for round in 0..500 {
            // The viewcell sees the triangle through one face only, so that the target polygon is the whole
            // triangle.
            let t: [Vec3; 3] = core::array::from_fn(|_| random.vec3(0.1, 0.9) + Vec3::X * 30.0);
            let triangles = prepared(t);
            let cell = CellBox { min: DVec3::ZERO, max: DVec3::ONE };
            let mut search = Search::new(&triangles, cell, 0.0, None);
            let target = Target::Triangle(0);
            assert!(
                search.begin(target, Budget { nodes: 0, divided: 0, halvings: 0 }),
                "{round}: the search begins"
            );
            let t = t.map(Vec3::as_dvec3);
            // The edge passes through the middle of the opposite side, so it also crosses any part of the
            // target polygon that is left when the polygon is cut.
            let far = t[0] + ((t[1] - t[0]) + (t[2] - t[0])) * random.fine_range(0.6, 3.0);
            let edge = Edge { ends: [t[0], far], tags: [0, NO_CORNER] };
            for sight in crate::sight::sights(&triangles, &cell, target, 0.0, search.pad()).unwrap() {
                let shaft = Shaft::new(&sight.p, &sight.q, search.pad());
                assert!(!search.edge_misses(&edge, &sight, &shaft), "{round}");
            }
        }
    }
}
