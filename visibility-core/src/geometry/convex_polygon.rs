//! Convex polygons in space, and clipping them (Sutherland and Hodgman, "Reentrant Polygon Clipping", 1974).

use crate::geometry::{Containment, Plane};
use core::fmt;
use glam::DVec3;
use smallvec::SmallVec;

/// A planar convex polygon in `f64` metres, for portals, occluders and the faces of cells. The coordinate
/// space is that of the given vertices. Up to eight vertices are stored inline without allocation. The
/// default polygon is empty.
///
/// ```
/// use visibility_core::{geometry::{ConvexPolygon, Plane}, glam::DVec3};
/// let square = ConvexPolygon::new([DVec3::ZERO, DVec3::X, DVec3::ONE.with_z(0.0), DVec3::Y])?;
/// let mut half = ConvexPolygon::default();
/// square.clip(&Plane::new(DVec3::X, -0.5), &mut half);
/// assert_eq!(half.area(), 0.5);
/// # Ok::<(), visibility_core::geometry::PolygonError>(())
/// ```
#[derive(Clone, PartialEq, Debug, Default)]
pub struct ConvexPolygon {
    vertices: SmallVec<[DVec3; 8]>,
}

/// The reason why a list of vertices is not a convex polygon.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum PolygonError {
    /// The list has fewer than three vertices.
    TooFewVertices {
        /// Number of vertices that were given, less than three.
        count: usize,
    },
    /// A coordinate is NaN or infinite.
    Vertex {
        /// Index of the first vertex with a NaN or infinite coordinate.
        vertex: usize,
    },
    /// The polygon has no area, or almost none relative to its size: all vertices lie (almost) on one line.
    NoPlane,
    /// A vertex is farther from the plane of the polygon than [`ConvexPolygon::TOLERANCE`] allows.
    NotPlanar {
        /// Index of the vertex that is farthest from the polygon's plane, the first of equally far ones.
        vertex: usize,
        /// Distance of the farthest vertex from the polygon's plane, in metres.
        distance: f64,
    },
    /// The boundary has a reflex corner or winds around more than once.
    NotConvex {
        /// Index of a vertex that lies more than the tolerance outside of an edge: on the side of the edge's
        /// line away from the polygon's interior.
        vertex: usize,
    },
}

impl fmt::Display for PolygonError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewVertices { count } => write!(f, "a polygon needs 3 vertices, there are {count}"),
            Self::Vertex { vertex } => write!(f, "vertex {vertex} of the polygon is not finite"),
            Self::NoPlane => write!(f, "the polygon has no area"),
            Self::NotPlanar { vertex, distance } => {
                write!(f, "vertex {vertex} of the polygon is {distance} off its plane")
            }
            Self::NotConvex { vertex } => {
                write!(f, "the polygon is not convex: vertex {vertex} is outside one of its edges")
            }
        }
    }
}

impl core::error::Error for PolygonError {}

/// Least area of a polygon, as a fraction of its squared size (see [`ConvexPolygon::TOLERANCE`]): 90 times
/// the unit round-off of `f64`. Rounding changes the area of a polygon of about ten vertices by less than 20
/// times the round-off, so a polygon without area does not reach this value.
const AREA_ROUNDING: f64 = 1e-14;

impl ConvexPolygon {
    /// Greatest distance of a vertex from the polygon's plane, and greatest distance of a vertex outside the
    /// line of an edge. Both are fractions of the polygon's size: its greatest extent from the first vertex
    /// along an axis.
    pub const TOLERANCE: f64 = 1e-6;

    /// Makes a polygon of vertices in order around the boundary, clockwise or counter-clockwise. Collinear
    /// and repeated vertices are allowed. Time is quadratic in the number of vertices.
    ///
    /// # Errors
    /// [`PolygonError`] if there are fewer than three vertices, a vertex is not finite, the polygon has no
    /// area, or is not planar or not convex up to [`TOLERANCE`](Self::TOLERANCE).
    pub fn new(vertices: impl IntoIterator<Item = DVec3>) -> Result<Self, PolygonError> {
        let polygon = Self { vertices: vertices.into_iter().collect() };
        polygon.validate()?;
        Ok(polygon)
    }

    fn validate(&self) -> Result<(), PolygonError> {
        let v = &self.vertices;
        if v.len() < 3 {
            return Err(PolygonError::TooFewVertices { count: v.len() });
        }
        if let Some(vertex) = v.iter().position(|p| !p.is_finite()) {
            return Err(PolygonError::Vertex { vertex });
        }
        let size = v.iter().map(|p| (*p - v[0]).abs().max_element()).fold(0.0, f64::max);
        let plane = self.plane().ok_or(PolygonError::NoPlane)?;
        if plane.normal.dot(self.area_vector()) < AREA_ROUNDING * size * size {
            return Err(PolygonError::NoPlane);
        }
        let allowed = Self::TOLERANCE * size;
        let off = |i: usize| plane.normal.dot(v[i] - v[0]).abs();
        let mut farthest = 0;
        for i in 1..v.len() {
            if off(i) > off(farthest) {
                farthest = i;
            }
        }
        if off(farthest) > allowed {
            return Err(PolygonError::NotPlanar { vertex: farthest, distance: off(farthest) });
        }
        // Convex: every vertex lies on the inner side of every edge. The quadratic test also refuses
        // boundaries that wind around twice, which tests of successive corners would accept.
        for i in 0..v.len() {
            let (a, b) = (v[i], v[(i + 1) % v.len()]);
            let Some(inward) = plane.normal.cross(b - a).try_normalize() else { continue };
            if let Some(vertex) = (0..v.len()).find(|&k| inward.dot(v[k] - a) < -allowed) {
                return Err(PolygonError::NotConvex { vertex });
            }
        }
        Ok(())
    }

    /// Returns the vertices in order around the boundary, in the coordinates of the polygon. The slice is
    /// empty if the polygon is empty.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Tests whether the polygon has fewer than three vertices: the default polygon, or one that was clipped
    /// away.
    pub fn is_empty(&self) -> bool {
        self.vertices.len() < 3
    }

    /// Turns the polygon over: the vertices run the other way, and the normal is the opposite.
    pub(crate) fn reverse(&mut self) {
        self.vertices.reverse();
    }

    /// Returns the area times the unit normal, which points to the side from which the vertices run
    /// counter-clockwise. Computed as half the sum of cross products over a triangle fan from the first
    /// vertex. Zero for an empty polygon.
    fn area_vector(&self) -> DVec3 {
        let v = &self.vertices;
        let mut sum = DVec3::ZERO;
        for i in 2..v.len() {
            sum += (v[i - 1] - v[0]).cross(v[i] - v[0]);
        }
        sum * 0.5
    }

    /// Returns the area in square metres, 0 for an empty polygon.
    pub fn area(&self) -> f64 {
        self.area_vector().length()
    }

    /// Returns the plane of the polygon with a unit normal on the side from which the vertices run
    /// counter-clockwise. `None` if the polygon is empty or has no area.
    pub fn plane(&self) -> Option<Plane> {
        let normal = self.area_vector().try_normalize()?;
        // The plane goes through the mean of the vertices, so that all are about equally near to it.
        let mut center = DVec3::ZERO;
        for &p in &self.vertices {
            center += p / self.vertices.len() as f64;
        }
        Some(Plane::through(center, normal))
    }

    /// Writes the part of the polygon inside the half-space of `plane` (the side that its normal points to)
    /// to `out`, replacing its vertices and reusing its memory. Returns the classification of the whole
    /// polygon. `out` is empty if the polygon is `Outside`, or if fewer than three vertices remain.
    ///
    /// Vertices within the rounding error of the plane are kept unchanged, so that a cut along an existing
    /// edge adds no vertices.
    pub fn clip(&self, plane: &Plane, out: &mut Self) -> Containment {
        out.vertices.clear();
        let side = plane.classify_polygon(self);
        match side {
            Containment::Outside => return side,
            Containment::Inside => {
                out.vertices.extend_from_slice(&self.vertices);
                return side;
            }
            Containment::Crossing => {}
        }
        let Some(mut a) = self.vertices.last().copied() else { return side };
        let mut a_side = plane.classify_point(a);
        for &b in &self.vertices {
            let b_side = plane.classify_point(b);
            let crosses = matches!(
                (a_side, b_side),
                (Containment::Inside, Containment::Outside) | (Containment::Outside, Containment::Inside)
            );
            if crosses {
                // The cut point is computed from the inner to the outer end, so that the two polygons that
                // share an edge cut it in the same point.
                let (inner, outer) = if a_side == Containment::Inside { (a, b) } else { (b, a) };
                let (di, d_o) = (plane.signed_distance(inner), plane.signed_distance(outer));
                out.vertices.push(inner + (outer - inner) * (di / (di - d_o)));
            }
            if b_side != Containment::Outside {
                out.vertices.push(b);
            }
            (a, a_side) = (b, b_side);
        }
        if out.vertices.len() < 3 {
            out.vertices.clear();
        }
        side
    }
}

impl Plane {
    /// Classifies a convex polygon against the half-space. A polygon with a vertex within rounding error of
    /// the boundary is `Crossing`. An empty polygon is `Outside`.
    fn classify_polygon(&self, polygon: &ConvexPolygon) -> Containment {
        let (mut inside, mut outside) = (true, true);
        for &v in polygon.vertices() {
            match self.classify_point(v) {
                Containment::Inside => outside = false,
                Containment::Outside => inside = false,
                Containment::Crossing => (inside, outside) = (false, false),
            }
        }
        match (inside, outside) {
            (_, true) => Containment::Outside,
            (true, false) => Containment::Inside,
            (false, false) => Containment::Crossing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    fn square() -> ConvexPolygon {
        ConvexPolygon::new([DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]).unwrap()
    }

    #[test]
    fn both_halves_of_a_cut_add_up() {
        let (mut a, mut b) = (ConvexPolygon::default(), ConvexPolygon::default());
        let plane = Plane::through(DVec3::new(0.3, 0.0, 0.0), DVec3::new(1.0, 0.2, 0.0));
        assert_eq!(square().clip(&plane, &mut a), Containment::Crossing, "the cut goes through the square");
        assert_eq!(
            square().clip(&plane.flipped(), &mut b),
            Containment::Crossing,
            "the cut goes through the square"
        );
        assert!(
            (a.area() + b.area() - 1.0).abs() < 1e-14 && a.area() > 0.1 && b.area() > 0.1,
            "the halves of a unit square have the areas {} and {}",
            a.area(),
            b.area()
        );
    }

    #[test]
    fn clipping_away_leaves_nothing_and_touching_keeps_all() {
        let mut out = square();
        assert_eq!(
            square().clip(&Plane::new(DVec3::X, -2.0), &mut out),
            Containment::Outside,
            "a square wholly behind the plane"
        );
        assert!(out.is_empty(), "clipping all away empties the output, which held a square before");
        square().clip(&Plane::new(DVec3::X, 0.0), &mut out);
        assert_eq!(out.area(), 1.0, "a plane along an edge cuts nothing off the unit square");
    }

    #[test]
    fn polygons_of_three_vertices_are_not_empty() {
        let triangle = ConvexPolygon::new([DVec3::ZERO, DVec3::X, DVec3::Y]).unwrap();
        assert!(!triangle.is_empty(), "a triangle");
        let mut out = ConvexPolygon::default();
        let corner = Plane::through(DVec3::X * 0.5, DVec3::new(-1.0, -1.0, 0.0));
        assert_eq!(square().clip(&corner, &mut out), Containment::Crossing, "a corner of the square is kept");
        assert_eq!(out.vertices().len(), 3, "the corner of a square: {out:?}");
    }

    /// Polygons that deviate from a flat, convex one of an extent of 1 m by the tolerance, and by a tenth
    /// less and more.
    #[test]
    fn polygons_are_flat_and_convex_up_to_the_tolerance() {
        let limit = ConvexPolygon::TOLERANCE;
        for (off, is_allowed) in [(0.9 * limit, true), (limit, true), (1.1 * limit, false)] {
            // The area vector points along z, and the first and the third vertex lie in its plane.
            let h = 0.5 * off;
            let bent = [[0.0, 0.0, h], [1.0, 0.0, -h], [1.0, 1.0, h], [0.0, 1.0, -h]];
            let expected = PolygonError::NotPlanar { vertex: 1, distance: off };
            let found = ConvexPolygon::new(bent.map(DVec3::from)).err();
            assert_eq!(found, (!is_allowed).then_some(expected), "a square bent by {off} m");
        }
        for (off, is_allowed) in [(0.9 * limit, true), (1.1 * limit, false)] {
            // The line of the first edge passes the third vertex at a distance of twice the dent.
            let dent = 0.5 * off;
            let dented =
                [[0.0, 0.0, 0.0], [0.5, dent, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
            let found = ConvexPolygon::new(dented.map(DVec3::from)).err();
            let expected = PolygonError::NotConvex { vertex: 2 };
            assert_eq!(found, (!is_allowed).then_some(expected), "a square dented by {dent} m");
        }
        for (area, is_allowed) in [(0.7, false), (1.0, true), (1.3, true)] {
            let height = 2.0 * area * AREA_ROUNDING;
            let sliver = [DVec3::ZERO, DVec3::X, DVec3::new(0.5, height, 0.0)];
            let found = ConvexPolygon::new(sliver).err();
            let expected = (!is_allowed).then_some(PolygonError::NoPlane);
            assert_eq!(found, expected, "a sliver of {area} times the least area");
        }
    }

    #[test]
    fn bad_polygons_are_refused_with_the_reason() {
        let new =
            |points: &[[f64; 3]]| ConvexPolygon::new(points.iter().map(|&p| p.into()).collect::<Vec<_>>());
        assert_eq!(new(&[[0.0; 3]]), Err(PolygonError::TooFewVertices { count: 1 }), "one vertex");
        assert_eq!(
            new(&[[0.0; 3], [1.0, 0.0, 0.0], [f64::NAN; 3]]),
            Err(PolygonError::Vertex { vertex: 2 }),
            "the index of the vertex that is NaN"
        );
        assert_eq!(
            new(&[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]),
            Err(PolygonError::NoPlane),
            "collinear vertices"
        );
        let bent = new(&[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.3], [0.0, 1.0, 0.0]]);
        assert!(matches!(bent, Err(PolygonError::NotPlanar { .. })), "{bent:?}");
        let dart = new(&[[0.0; 3], [2.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 2.0, 0.0]]);
        assert_eq!(dart, Err(PolygonError::NotConvex { vertex: 3 }), "the index of the reflex vertex");
    }
}
