//! Convex polygons in space, and clipping them (Sutherland and Hodgman, "Reentrant Polygon Clipping", 1974).

use crate::geometry::{Containment, Plane};
use core::fmt;
use glam::DVec3;
use smallvec::SmallVec;

/// A planar convex polygon: portals, occluders, the faces of cells. Up to eight vertices are held in place.
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

/// Why vertices do not make a convex polygon.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum PolygonError {
    /// Fewer than three vertices.
    TooFewVertices {
        /// How many there are.
        count: usize,
    },
    /// A coordinate is NaN or infinite.
    NonFinite {
        /// Index of the first such vertex.
        vertex: usize,
    },
    /// All vertices lie on one line.
    Degenerate,
    /// A vertex is off the plane of the others.
    NotPlanar {
        /// Index of the vertex farthest from the plane.
        vertex: usize,
        /// Its distance from the plane.
        distance: f64,
    },
    /// The boundary turns the other way, or around more than once.
    NotConvex {
        /// Index of a vertex that lies on the outer side of some edge.
        vertex: usize,
    },
}

impl fmt::Display for PolygonError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewVertices { count } => write!(f, "a polygon needs 3 vertices, there are {count}"),
            Self::NonFinite { vertex } => write!(f, "vertex {vertex} of the polygon is not finite"),
            Self::Degenerate => write!(f, "the polygon has no area"),
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

impl ConvexPolygon {
    /// How far a vertex may be off the plane, and a corner turn the wrong way, relative to the polygon's
    /// size.
    pub const TOLERANCE: f64 = 1e-6;

    /// Checks that the vertices, in order around the boundary, are finite, planar and convex up to
    /// [`TOLERANCE`](Self::TOLERANCE). Collinear and repeated vertices are allowed.
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
            return Err(PolygonError::NonFinite { vertex });
        }
        let size = v.iter().map(|p| (*p - v[0]).abs().max_element()).fold(0.0, f64::max);
        let plane = self.plane().ok_or(PolygonError::Degenerate)?;
        if plane.normal.dot(self.area_vector()) < 1e-14 * size * size {
            return Err(PolygonError::Degenerate);
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
        // Convex: every vertex lies on the inner side of every edge. Quadratic, and it also refuses
        // boundaries that go around twice, which local turns alone do not.
        for i in 0..v.len() {
            let (a, b) = (v[i], v[(i + 1) % v.len()]);
            let Some(inward) = plane.normal.cross(b - a).try_normalize() else { continue };
            if let Some(vertex) = (0..v.len()).find(|&k| inward.dot(v[k] - a) < -allowed) {
                return Err(PolygonError::NotConvex { vertex });
            }
        }
        Ok(())
    }

    /// The vertices in order around the boundary; none when the polygon is empty.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Whether clipping has left nothing.
    pub fn is_empty(&self) -> bool {
        self.vertices.len() < 3
    }

    /// Half the sum of the cross products of successive edges: the normal (counter-clockwise) times the area.
    fn area_vector(&self) -> DVec3 {
        let v = &self.vertices;
        let mut sum = DVec3::ZERO;
        for i in 2..v.len() {
            sum += (v[i - 1] - v[0]).cross(v[i] - v[0]);
        }
        sum * 0.5
    }

    /// The area, in square metres.
    pub fn area(&self) -> f64 {
        self.area_vector().length()
    }

    /// The plane of the polygon, its unit normal on the side from which the vertices run counter-clockwise.
    /// `None` without area.
    pub fn plane(&self) -> Option<Plane> {
        let normal = self.area_vector().try_normalize()?;
        // Through the mean of the vertices: each is then about equally near.
        let mut center = DVec3::ZERO;
        for &p in &self.vertices {
            center += p / self.vertices.len() as f64;
        }
        Some(Plane::through(center, normal))
    }

    /// The part inside the half-space, written to `out` (whose memory is reused); says where the whole lay.
    ///
    /// Vertices within rounding error of the plane are kept as they are, so that a cut along an existing
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
                // Always from the inner to the outer end, so that both neighbours of an edge cut it in the
                // same point.
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
    /// Where a convex polygon lies. An empty polygon is `Outside`.
    pub fn classify_polygon(&self, polygon: &ConvexPolygon) -> Containment {
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
        assert_eq!(square().clip(&plane, &mut a), Containment::Crossing);
        assert_eq!(square().clip(&plane.flipped(), &mut b), Containment::Crossing);
        assert!((a.area() + b.area() - 1.0).abs() < 1e-14 && a.area() > 0.1 && b.area() > 0.1);
    }

    #[test]
    fn clipping_away_leaves_nothing_and_touching_keeps_all() {
        let mut out = square();
        assert_eq!(square().clip(&Plane::new(DVec3::X, -2.0), &mut out), Containment::Outside);
        assert!(out.is_empty());
        square().clip(&Plane::new(DVec3::X, 0.0), &mut out);
        assert_eq!(out.area(), 1.0);
    }

    #[test]
    fn bad_polygons_are_refused_with_the_reason() {
        let new =
            |points: &[[f64; 3]]| ConvexPolygon::new(points.iter().map(|&p| p.into()).collect::<Vec<_>>());
        assert_eq!(new(&[[0.0; 3]]), Err(PolygonError::TooFewVertices { count: 1 }));
        assert_eq!(
            new(&[[0.0; 3], [1.0, 0.0, 0.0], [f64::NAN; 3]]),
            Err(PolygonError::NonFinite { vertex: 2 })
        );
        assert_eq!(new(&[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), Err(PolygonError::Degenerate));
        let bent = new(&[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.3], [0.0, 1.0, 0.0]]);
        assert!(matches!(bent, Err(PolygonError::NotPlanar { .. })), "{bent:?}");
        let dart = new(&[[0.0; 3], [2.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 2.0, 0.0]]);
        assert_eq!(dart, Err(PolygonError::NotConvex { vertex: 3 }));
    }
}
