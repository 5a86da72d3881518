//! The shadow volume that a convex polygon casts from the eye, bounded by the planes through the eye and its
//! edges and by the polygon's own plane (Crow, "Shadow Algorithms for Computer Graphics", 1977; Chin and
//! Feiner, "Near Real-Time Shadow Generation Using BSP Trees", 1989).
//!
//! # Why it is sound, also for polygons that are not quite flat
//! An occluder is a patch of triangles whose boundary is one closed loop. A view ray that passes every edge
//! of the loop on its left is encircled by the loop, and so meets the patch. All vertices, those inside the
//! loop too, lie on the eye's side of the *back plane*, which is moved away from the eye until they do. So a
//! point strictly beyond the back plane on such a ray lies beyond the patch. Neither argument requires the
//! patch to be flat or rounding to be favourable: the edges run between the exact vertices.
//!
//! # The near plane
//! Geometry in front of the near plane is not drawn, so it must not hide. A patch that crosses the near plane
//! is cut a little beyond it. The other edges keep their exact ends, and the cut becomes an edge of its own.
//! The plane of the cut must surely divide the vertices that are cut off from those that are not. A view ray
//! inside the cut and the other edges is then encircled by the loop with the cut in place of what is cut off,
//! and so by the loop itself. Of an uneven patch that is seen almost edge on, a vertex that is cut off may
//! project inside the cut; such a patch casts no shadow.
//! A view ray may meet an uneven patch nearer to the eye than its outline suggests; see
//! `ClipProjection::near_unevenness`.

use crate::clip_projection::{ClipProjection, Direction, Line, U, slack_of};
use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::glam::DVec3;

/// Maximum number of edges of an occluder polygon; polygons with more cast no shadow.
pub(crate) const MAX_EDGES: usize = 16;

/// A shadow edge: an edge of an occluder polygon and the plane through this edge and the eye.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadowEdge {
    /// Plane through the edge and the eye, positive inside the shadow.
    pub(crate) line: Line,
    /// Ends of the edge in metres relative to `Scene::origin`; NaN for the edge at which the near plane cuts
    /// the polygon off. Two edges with the same ends, in either order, have the same plane up to its sign.
    pub(crate) ends: [DVec3; 2],
    /// View rays through the two ends of the edge.
    pub(crate) directions: [Direction; 2],
}

/// A corner of the part of a polygon beyond the near plane, which outlines the polygon's shadow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadowCorner {
    /// Position of the corner in metres relative to `Scene::origin`.
    pub(crate) p: DVec3,
    /// Clip-space `(x, y, w)` of the position divided by `size`: the largest component is 1 in magnitude.
    pub(crate) v: [f64; 3],
    /// Largest magnitude among the position's clip-space x, y and w, by which they were divided to make `v`.
    pub(crate) size: f64,
    /// Index among the shadow's edges of the edge to the next corner; `u8::MAX` if the outline follows no
    /// polygon edge there.
    pub(crate) edge: u8,
}

/// The shadow of one occluder polygon: hidden points are inside all edges and behind the back plane.
#[derive(Clone, Debug)]
pub(crate) struct Shadow {
    /// Range of the shadow's edges in `Shadows::edges`.
    pub(crate) edges: Range<usize>,
    /// Range of the outline's corners in `Shadows::corners`, in boundary order.
    pub(crate) corners: Range<usize>,
    /// Back plane of the polygon. Only points behind it are hidden.
    pub(crate) back: BackPlane,
}

/// The plane through or just behind all vertices of an occluder polygon as seen from the eye, in metres
/// relative to `Scene::origin`: `normal . p + offset = 0`. Only points behind it can be hidden by the
/// polygon.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BackPlane {
    /// Unit normal, pointing to the eye's side.
    pub(crate) normal: DVec3,
    /// Plane offset in metres: `normal . p + offset` is the signed distance of `p`.
    pub(crate) offset: f64,
}

impl BackPlane {
    /// Returns the side of the plane on which the box from `min` to `max` lies: -1 if all of it is surely
    /// behind the plane, 1 if all of it is surely in front. 0 if it crosses or touches the plane, or if
    /// rounding leaves the side undecided. Corners are in metres relative to `Scene::origin`.
    #[inline]
    pub(crate) fn side(&self, min: DVec3, max: DVec3) -> i32 {
        let n = self.normal;
        let (far, near) =
            (DVec3::select(n.cmpge(DVec3::ZERO), max, min), DVec3::select(n.cmpge(DVec3::ZERO), min, max));
        let greatest = n.x * far.x + n.y * far.y + n.z * far.z + self.offset;
        let least = n.x * near.x + n.y * near.y + n.z * near.z + self.offset;
        // Rounding of three products and three sums, as in `Plane::error_bound`.
        let size = n.abs().dot(min.abs().max(max.abs())) + self.offset.abs();
        let error = 6.0 * U * size + f64::MIN_POSITIVE;
        i32::from(least > error) - i32::from(greatest < -error)
    }

    /// Returns the signed distance in metres from the plane of a point relative to `Scene::origin`, positive
    /// on the eye's side. Its rounding error is not bounded.
    pub(crate) fn at(&self, p: DVec3) -> f64 {
        self.normal.dot(p) + self.offset
    }
}

/// A convex, almost flat occluder polygon in metres relative to `Scene::origin`, from which a shadow can be
/// cast.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OccluderPolygon<'a> {
    /// Vertices in metres relative to `Scene::origin`, in boundary order; a polygon with more than
    /// [`MAX_EDGES`] casts no shadow.
    pub(crate) vertices: &'a [DVec3],
    /// Unit normal of the front, the side from which the vertices run counter-clockwise.
    pub(crate) normal: DVec3,
    /// Least and greatest coordinate of the surface along `normal`, in metres from `Scene::origin`, rounded
    /// outwards.
    pub(crate) extent_along_normal: [f64; 2],
    /// Bound on the error of each coordinate of the vertices, in metres, from placing them in the scene.
    pub(crate) placing_error: f64,
    /// Whether the polygon also hides for eyes behind its front; if false, only for eyes in front.
    pub(crate) two_sided: bool,
}

/// Returns three properties of a loop of vertices in metres relative to `Scene::origin`: the unit normal of
/// the side from which the loop runs counter-clockwise; the least and greatest coordinate along this normal,
/// in metres and rounded outwards, of the vertices and of the points `inner` of the surface inside the loop;
/// and the area in square metres. Each coordinate of a point may be off by `placing_error` metres. `None` if
/// the loop has no area or a point is not finite.
pub(crate) fn plane_of(
    vertices: &[DVec3],
    inner: &[DVec3],
    placing_error: f64,
) -> Option<(DVec3, [f64; 2], f64)> {
    let (&first, rest) = vertices.split_first()?;
    let mut sum = DVec3::ZERO;
    for pair in rest.windows(2) {
        sum += (pair[0] - first).cross(pair[1] - first);
    }
    // The normal is NaN without an area, or with an infinite one; so are then all distances along it.
    let scale = sum.abs().max_element();
    let area = 0.5 * scale * (sum / scale).length();
    let normal = (sum / scale).normalize();
    let mut extent_along_normal = [f64::INFINITY, f64::NEG_INFINITY];
    for v in vertices.iter().chain(inner) {
        let along = normal.dot(*v);
        let error = 8.0 * U * normal.abs().dot(v.abs()) + 2.0 * placing_error + f64::MIN_POSITIVE;
        let [low, high] = [along - error, along + error];
        if !(high - low).is_finite() {
            return None;
        }
        extent_along_normal = [extent_along_normal[0].min(low), extent_along_normal[1].max(high)];
    }
    Some((normal, extent_along_normal, area))
}

/// Returns the mean of some points, in the points' own space; zero for none.
pub(crate) fn mean_of(points: impl ExactSizeIterator<Item = DVec3>) -> DVec3 {
    let count = points.len() as f64;
    points.fold(DVec3::ZERO, |sum, p| sum + p / count)
}

/// Returns the mean of the corners' clip-space directions `v`; zero without corners.
pub(crate) fn mean_direction(corners: &[ShadowCorner]) -> [f64; 3] {
    let mut mean = [0.0; 3];
    for corner in corners {
        for (sum, v) in mean.iter_mut().zip(corner.v) {
            *sum += v / corners.len() as f64;
        }
    }
    mean
}

/// The shadows of one frame. Memory is kept from frame to frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shadows {
    /// Shadows of the frame, in the order in which they were cast.
    pub(crate) list: Vec<Shadow>,
    /// Edges of all shadows in `list`; each shadow has a range.
    pub(crate) edges: Vec<ShadowEdge>,
    /// Outline corners of all shadows in `list`; each shadow has a range.
    pub(crate) corners: Vec<ShadowCorner>,
    /// Scratch: near-plane function at each vertex of the polygon being cast, positive beyond the near
    /// plane.
    near: Vec<f64>,
    /// Scratch: view ray through each vertex of the polygon being cast, `None` if undetermined.
    directions: Vec<Option<Direction>>,
}

impl Shadows {
    /// Removes all shadows and keeps the allocated memory.
    pub(crate) fn clear(&mut self) {
        self.list.clear();
        self.edges.clear();
        self.corners.clear();
    }

    /// Returns the edges of `shadow`, which must be an element of this set's `list`.
    pub(crate) fn edges_of(&self, shadow: &Shadow) -> &[ShadowEdge] {
        &self.edges[shadow.edges.clone()]
    }

    /// Appends the shadow of a polygon to this set's shadows, `list`. Returns true if a shadow was appended.
    ///
    /// Returns false and appends nothing if the polygon casts no shadow, for one of these reasons: the eye is
    /// not surely in front of the polygon (for a two-sided polygon, neither surely in front nor surely
    /// behind); all of the polygon is on the eye's side of the near plane; the polygon has fewer than three
    /// or more than [`MAX_EDGES`] edges; rounding leaves the plane of an edge uncertain.
    pub(crate) fn cast(
        &mut self,
        projection: &ClipProjection,
        occluder_polygon: &OccluderPolygon<'_>,
    ) -> bool {
        let (edges, corners) = (self.edges.len(), self.corners.len());
        let cast = self.try_cast(projection, occluder_polygon);
        match cast {
            Some(back) => self.list.push(Shadow {
                edges: edges..self.edges.len(),
                corners: corners..self.corners.len(),
                back,
            }),
            None => {
                self.edges.truncate(edges);
                self.corners.truncate(corners);
            }
        }
        cast.is_some()
    }

    /// Appends the edges and corners of a polygon's shadow and returns the shadow's back plane. `None` if the
    /// polygon casts no shadow; the caller must then remove what was appended.
    fn try_cast(
        &mut self,
        projection: &ClipProjection,
        occluder_polygon: &OccluderPolygon<'_>,
    ) -> Option<BackPlane> {
        let count = occluder_polygon.vertices.len();
        if !(3..=MAX_EDGES).contains(&count) {
            return None;
        }
        let &OccluderPolygon { vertices, normal, extent_along_normal: [low, high], placing_error, .. } =
            occluder_polygon;
        let front = projection.is_before(normal, -high);
        let (normal, front_offset, back_offset) = if front {
            (normal, -high, -low)
        } else if occluder_polygon.two_sided && projection.is_before(-normal, low) {
            (-normal, low, high)
        } else {
            return None;
        };

        // The near plane comes first: a point in front of it may project anywhere.
        self.near.clear();
        let (mut farthest, mut nearest, mut doubt) = (f64::NEG_INFINITY, f64::INFINITY, 0.0f64);
        for &p in vertices {
            let (value, error) = projection.beyond_near(p, placing_error);
            self.near.push(value);
            farthest = farthest.max(value);
            nearest = nearest.min(value);
            doubt = doubt.max(error);
        }
        // Value of the near-plane function at which the polygon is cut: beyond the near plane by more than
        // rounding, or the unevenness of a patch, can undo.
        let uneven = projection.near_unevenness(normal, front_offset, back_offset);
        let limit = (farthest * 1e-4).max(1024.0 * doubt).max(2.0 * uneven);
        if !(farthest > limit) {
            return None;
        }
        self.directions.clear();
        self.directions.extend(vertices.iter().map(|&p| projection.direction(p, placing_error)));
        let whole = nearest > doubt + 2.0 * uneven;
        let first_edge = self.edges.len();
        let first_corner = self.corners.len();
        for i in 0..count {
            let j = (i + 1) % count;
            let (a, b) = (vertices[i], vertices[j]);
            let (na, nb) = (self.near[i], self.near[j]);
            let (keeps_a, keeps_b) = (whole || na > limit, whole || nb > limit);
            let number = (self.edges.len() - first_edge) as u8;
            if keeps_a || keeps_b {
                let (da, db) = (self.directions[i]?, self.directions[j]?);
                let line = Line::through(&da, &db)?;
                self.edges.push(ShadowEdge { line, ends: [a, b], directions: [da, db] });
            }
            if keeps_a {
                let Direction { v, size, .. } = self.directions[i]?;
                self.corners.push(ShadowCorner { p: a, v, size, edge: number });
            }
            if keeps_a != keeps_b {
                let (inner, outer, ni, no) = if keeps_a { (a, b, na, nb) } else { (b, a, nb, na) };
                let p = inner + (outer - inner) * ((ni - limit) / (ni - no));
                let Direction { v, size, .. } = projection.direction(p, placing_error)?;
                // The cut's edge begins where the outline leaves the polygon; it is added once all corners
                // are known.
                self.corners.push(ShadowCorner { p, v, size, edge: if keeps_a { u8::MAX } else { number } });
            }
        }
        let mut cut = None;
        if !whole {
            // A convex loop is cut by the near plane once or not at all.
            let corners = &self.corners[first_corner..];
            if let Some(out) = corners.iter().position(|c| c.edge == u8::MAX) {
                let (a, b) = (corners[out].p, corners[(out + 1) % corners.len()].p);
                let (da, db) =
                    (projection.direction(a, placing_error)?, projection.direction(b, placing_error)?);
                let line = Line::through(&da, &db)?;
                let number = (self.edges.len() - first_edge) as u8;
                cut = Some(self.edges.len());
                self.edges.push(ShadowEdge { line, ends: [DVec3::NAN; 2], directions: [da, db] });
                self.corners[first_corner + out].edge = number;
                if self.corners[first_corner..].iter().any(|c| c.edge == u8::MAX) {
                    return None;
                }
            }
        }
        let corners = &self.corners[first_corner..];
        if corners.len() < 3 {
            return None;
        }

        // All edges must have the outline's mean inside. For a polygon seen from its front, the inner side is
        // always on the same hand, known from the projection's orientation.
        let middle = mean_direction(corners);
        let certain = |line: &Line| line.slack + slack_of(64.0 * U);
        let turn = projection.turn * if front { -1.0 } else { 1.0 };
        for edge in &mut self.edges[first_edge..] {
            if turn < 0.0 {
                edge.line = edge.line.flipped();
            }
            if !(edge.line.at(middle) > certain(&edge.line)) || turn == 0.0 {
                return None;
            }
        }
        if let Some(cut) = cut {
            let line = self.edges[cut].line;
            for (direction, &near) in self.directions.iter().zip(&self.near) {
                let &Direction { v, error, .. } = direction.as_ref()?;
                let inside = if near > limit { line.at(v) } else { -line.at(v) };
                if !(inside > line.slack + slack_of(error)) {
                    return None;
                }
            }
        }
        Some(BackPlane { normal, offset: back_offset })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_behind_or_before_a_plane_only_if_they_exactly_are() {
        // Whole numbers whose products exceed the precision of a double, but fit in 128 bits.
        let mut random = visibility_testing::Random(7);
        let mut whole = |bits: u32| (random.bits() >> (63 - bits)) as i64 - (1 << bits);
        let (mut decided, mut boxes) = (0, 0);
        for round in 0..100_000 {
            let (n, p) = ([whole(50), whole(50), whole(50)], [whole(23), whole(23), whole(23)]);
            let [normal, point] = [n, p].map(|v| DVec3::from_array(v.map(|x| x as f64)));
            let offset = -normal.dot(point) * (1.0 + f64::from(round % 64 - 32) * U);
            let plane = BackPlane { normal, offset };
            let exact = (0..3).map(|i| i128::from(n[i]) * i128::from(p[i])).sum::<i128>() + offset as i128;
            let side = plane.side(point, point);
            assert!(side == 0 || side == exact.signum() as i32, "{side}: {exact} at {point} of {plane:?}");
            decided += i32::from(side != 0);
            // A box from the point to near the origin, on the side on which the point is.
            let other = [0, 1, 2].map(|i| if (n[i] > 0) == (p[i] > 0) { 1 } else { p[i] });
            let [a, b] = [p, other].map(|p| DVec3::from_array(p.map(|x| x as f64)));
            let side = plane.side(a.min(b), a.max(b));
            for corner in 0..8 {
                let corner = [0, 1, 2].map(|i| if corner >> i & 1 == 0 { p[i] } else { other[i] });
                let exact =
                    (0..3).map(|i| i128::from(n[i]) * i128::from(corner[i])).sum::<i128>() + offset as i128;
                assert!(
                    side == 0 || side == exact.signum() as i32,
                    "{side}: {exact}, a box at {point}, {plane:?}"
                );
            }
            boxes += i32::from(side != 0);
        }
        assert!(decided > 10_000 && boxes > 10_000, "{decided} points decided, {boxes} boxes");
    }

    #[test]
    fn the_extent_of_a_polygon_holds_its_vertices_wherever_they_are_placed() {
        let mut random = visibility_testing::Random(8);
        let mut whole = |bits: u32| (random.bits() >> (63 - bits)) as i64 - (1 << bits);
        // Whole multiples of 2^-80 hold a unit normal of `f64`, but for components below 2^-28.
        let scaled = |x: f64| (x * 2f64.powi(80)) as i128;
        let mut rounded = 0;
        for round in 0..20_000 {
            let points = [(); 5].map(|()| [whole(23), whole(23), whole(23)]);
            let [a, b, c, d, e] = points.map(|p| DVec3::from_array(p.map(|x| x as f64)));
            let placing_error = [0.0, 0.5, 64.0][round % 3];
            let Some((normal, [low, high], _)) = plane_of(&[a, b, c], &[d, e], placing_error) else {
                continue;
            };
            if normal.abs().min_element() < 2f64.powi(-28) {
                continue;
            }
            // The farthest that an error of each coordinate moves a point along the normal.
            let moved = scaled(placing_error * normal.abs().element_sum());
            for point in points {
                let terms = point.iter().zip(normal.to_array());
                let exact: i128 = terms.map(|(&x, n)| i128::from(x) * scaled(n)).sum();
                let [low, high] = [low, high].map(scaled);
                assert!(low <= exact - moved && exact + moved <= high, "round {round}: {point:?}, {normal}");
                let near = normal.dot(DVec3::from_array(point.map(|x| x as f64)));
                rounded += usize::from(scaled(near) != exact);
            }
        }
        assert!(rounded > 50_000, "distances that are rounded: {rounded}");
    }

    #[test]
    fn polygons_without_area_or_with_infinite_points_have_no_plane() {
        let [a, b, c] = [DVec3::ZERO, DVec3::X, DVec3::Y];
        assert!(plane_of(&[a, b, c], &[], 0.0).is_some_and(|(normal, ..)| normal == DVec3::Z), "a triangle");
        assert!(plane_of(&[a, b, c], &[], 0.0).is_some_and(|(.., area)| area == 0.5), "area of a triangle");
        for bad in [DVec3::NAN, DVec3::INFINITY, DVec3::new(0.0, 0.0, f64::NEG_INFINITY)] {
            assert!(plane_of(&[a, b, bad], &[], 0.0).is_none(), "{bad} in the outline");
            assert!(plane_of(&[a, b, c], &[bad], 0.0).is_none(), "{bad} inside");
        }
        assert!(plane_of(&[a, b, 2.0 * b], &[], 0.0).is_none(), "no area");
        assert!(plane_of(&[], &[], 0.0).is_none(), "no vertices");
        assert!(plane_of(&[a, b, c], &[], f64::INFINITY).is_none(), "placed anywhere");
        // Products of huge coordinates overflow.
        assert!(plane_of(&[1e200 * a, 1e200 * b, 1e200 * c], &[], 0.0).is_none(), "area beyond all numbers");
    }

    /// Casts the shadow of a flat polygon to the eye of [`ClipProjection::along_z`], whose near plane is
    /// z = 0.1. Unevenness is a distance along the normal.
    fn cast(vertices: &[DVec3], placing_error: f64, unevenness: f64) -> Option<Shadows> {
        let (normal, [low, high], _) = plane_of(vertices, &[], 0.0)?;
        let extent_along_normal = [low - unevenness, high];
        let polygon =
            OccluderPolygon { vertices, normal, extent_along_normal, placing_error, two_sided: false };
        let mut shadows = Shadows::default();
        let projection = ClipProjection::along_z(0.0, 0.0, 0.0, 0.0);
        shadows.cast(&projection, &polygon).then_some(shadows)
    }

    #[test]
    fn edges_have_the_errors_of_their_vertices() {
        let placing = 5e-9;
        let triangle = [[-1.0, -1.0], [0.0, 1.0], [1.0, -1.0]].map(|[x, y]| DVec3::new(x, y, 1.0));
        let shadows = cast(&triangle, placing, 0.0).expect("a shadow");
        assert_eq!((shadows.edges.len(), shadows.corners.len()), (3, 3), "edges and corners");
        for edge in &shadows.edges {
            for direction in edge.directions {
                assert!((direction.error / placing - 1.0).abs() < 1e-3, "error of {direction:?}");
            }
        }
    }

    #[test]
    fn a_polygon_is_whole_only_surely_beyond_the_near_plane_and_cut_well_beyond_it() {
        // Near ends of a floor, which the eye sees a metre below.
        let floor = |beyond: f64, far: f64| {
            [[-1.0, 0.1 + beyond], [-1.0, far], [1.0, far], [1.0, 0.1 + beyond]]
                .map(|[x, z]| DVec3::new(x, -1.0, z))
        };
        let placing = 5e-9;
        for (share, edges) in [(1.02, 4), (0.98, 4), (0.4, 4)] {
            let shadows = cast(&floor(share * placing, 2.0), placing, 0.0).expect("a shadow");
            let cut = shadows.edges.iter().filter(|edge| edge.ends[0].is_nan()).count();
            assert_eq!(cut, usize::from(share < 1.0), "cuts at {share} of the error");
            assert_eq!(shadows.edges.len(), edges, "edges at {share} of the error");
        }
        // The far end, the error of the near ends, and the unevenness of the floor decide where it is cut.
        for (far, placing, uneven, limit) in
            [(2.1, 0.0, 0.0, 2e-4), (0.16, 1e-8, 0.0, 1024e-8), (2.1, 0.0, 0.1, 2.0 * 0.1 * 0.1)]
        {
            let triangle = [[-1.0, 0.09], [0.0, far], [1.0, 0.09]].map(|[x, z]| DVec3::new(x, -1.0, z));
            let shadows = cast(&triangle, placing, uneven).expect("a shadow");
            assert_eq!(
                (shadows.edges.len(), shadows.corners.len()),
                (3, 3),
                "edges and corners, cut at {limit}"
            );
            let nearest =
                shadows.corners.iter().fold(f64::INFINITY, |least, corner| least.min(corner.p.z - 0.1));
            assert!((nearest / limit - 1.0).abs() < 1e-3, "cut at {nearest} instead of {limit}");
        }
        assert!(cast(&floor(-0.05, 0.09), 0.0, 0.0).is_none(), "all before the near plane");
    }

    /// A vertex that is cut off is that far before the cut.
    #[test]
    fn a_cut_must_surely_divide_the_vertices() {
        let limit = 2e-4;
        for (placing, gap, is) in
            [(1e-9, 3.06e-9, false), (1e-9, 1.3e-8, true), (0.0, 88.0 * U, false), (0.0, 102.0 * U, true)]
        {
            let near = 0.1 + limit - gap;
            let floor =
                [[-1.0, 0.05], [-1.0, 2.1], [1.0, 2.1], [1.0, near]].map(|[x, z]| DVec3::new(x, -1.0, z));
            assert_eq!(cast(&floor, placing, 0.0).is_some(), is, "{gap} before the cut, errors of {placing}");
        }
    }

    /// Thin triangles, whose middle is within the slack of their edges.
    #[test]
    fn a_polygon_has_a_shadow_only_if_its_middle_is_surely_inside_its_edges() {
        for (placing, height, is) in [
            (5e-9, 18.4 * 5e-9, false),
            (5e-9, 19.1 * 5e-9, true),
            (0.0, 790.0 * U, false),
            (0.0, 825.0 * U, true),
        ] {
            let triangle = [[-1.0, 0.0], [0.0, height], [1.0, 0.0]].map(|[x, y]| DVec3::new(x, y, 1.0));
            assert_eq!(cast(&triangle, placing, 0.0).is_some(), is, "{height} high, errors of {placing}");
        }
    }

    #[test]
    fn only_an_eye_surely_on_one_side_makes_a_shadow() {
        let vertices = [[-1.0, -1.0], [0.0, 1.0], [1.0, -1.0]].map(|[x, y]| DVec3::new(x, y, 1.0));
        let (normal, extent_along_normal, _) = plane_of(&vertices, &[], 0.0).expect("a plane");
        let mut shadows = Shadows::default();
        for turn in [1.0, 0.0] {
            for (two_sided, flipped, eye_error) in [
                (false, false, 0.0),
                (false, true, 0.0),
                (true, true, 0.0),
                (true, false, 2.0),
                (true, true, 2.0),
            ] {
                let mut projection = ClipProjection::along_z(0.0, 0.0, eye_error, 0.0);
                projection.turn *= turn;
                let [low, high] = extent_along_normal;
                let (mut loop_of, mut front) = (vertices, normal);
                let mut extent_along_normal = extent_along_normal;
                if flipped {
                    loop_of.reverse();
                    (front, extent_along_normal) = (-normal, [-high, -low]);
                }
                let polygon = OccluderPolygon {
                    vertices: &loop_of,
                    normal: front,
                    extent_along_normal,
                    placing_error: 0.0,
                    two_sided,
                };
                let is = turn != 0.0 && eye_error == 0.0 && (two_sided || !flipped);
                assert_eq!(
                    shadows.cast(&projection, &polygon),
                    is,
                    "two-sided: {two_sided}, from behind: {flipped}, eye known to {eye_error}, turn {turn}"
                );
            }
        }
    }
}
