//! What is asked: the segments from a viewcell to a target, as pairs of polygons.
//!
//! Every segment from the viewcell to a target outside leaves the viewcell at a face, and the point where it
//! leaves is itself a viewpoint. So a target is visible exactly if it is visible from the boundary of the
//! viewcell, and geometry inside the viewcell does not matter. Lines run from a point p of P, the exit face,
//! to a point q of Q, a face of the target, both cut to the parts that can face each other.
//!
//! With a clearance c > 0 the target is first advanced by c towards the viewcell and each of its faces shrunk
//! by at most 2 c, so that occluders that touch the target along an edge do not touch Q. A segment to a point
//! of the target from a viewpoint at least c over the target's plane has a neighbour to a point of Q that is
//! at most sqrt(5) c away from it everywhere. Of a target over whose plane no viewpoint is higher than c, but
//! some are over it, nothing is said. Where only some viewpoints are lower, segments from these, at grazing
//! angles, are not asked about.

use crate::polygon::Polygon;
use crate::triangles::{LIMIT, SceneTriangles};
use alloc::vec::Vec;
use visibility_core::geometry::DoubleDouble;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;

/// A half-space: the points x with `normal . x + offset >= 0`, in front of its plane. The normal is a unit
/// vector.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Half {
    pub(crate) normal: DVec3,
    pub(crate) offset: f64,
}

impl Half {
    #[inline]
    pub(crate) fn height(&self, x: DVec3) -> f64 {
        self.normal.dot(x) + self.offset
    }
}

/// The box of a viewcell in scene coordinates, rounded outwards.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct CellBox {
    pub(crate) min: DVec3,
    pub(crate) max: DVec3,
}

impl CellBox {
    /// Returns the box of a viewcell. `None` if the box is empty, NaN or beyond the coordinates that are
    /// used.
    pub(crate) fn new(cell: &Viewcell, origin: DVec3) -> Option<Self> {
        // The difference is exact for most origins, (0, 0, 0) above all.
        let local = |x: DVec3, outwards: fn(f64) -> f64| {
            DVec3::from_array(core::array::from_fn(|k| match DoubleDouble::difference(x[k], origin[k]) {
                DoubleDouble { hi, lo: 0.0 } => hi,
                DoubleDouble { hi, .. } => outwards(hi),
            }))
        };
        let (min, max) = (local(cell.min, f64::next_down), local(cell.max, f64::next_up));
        let is_usable = cell.min.cmple(cell.max).all() && min.abs().max(max.abs()).max_element() <= LIMIT;
        is_usable.then_some(Self { min, max })
    }

    pub(crate) fn magnitude(&self) -> f64 {
        self.min.abs().max(self.max.abs()).max_element()
    }

    pub(crate) fn meets(&self, min: DVec3, max: DVec3) -> bool {
        self.min.cmple(max).all() && min.cmple(self.max).all()
    }
}

/// What may be seen.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Target {
    /// Anything inside a box, in scene coordinates. The box does not meet the viewcell.
    Box { min: DVec3, max: DVec3 },
    /// A triangle, by its number.
    Triangle(u32),
}

/// A pair of polygons between which lines of sight run.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Sight {
    pub(crate) p: Polygon,
    pub(crate) q: Polygon,
    /// The outside of the viewcell's face that holds `p`.
    pub(crate) before_p: Half,
    /// The side of Q's plane from which `q` is seen.
    pub(crate) before_q: Half,
}

/// Returns the faces of a box and the half-spaces outside them.
fn faces(min: DVec3, max: DVec3) -> impl Iterator<Item = (Polygon, Half)> {
    (0..6).map(move |face| {
        let (axis, is_upper) = (face / 2, face % 2 == 1);
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        let at = if is_upper { max[axis] } else { min[axis] };
        let corner = |a: f64, b: f64| {
            let mut v = DVec3::ZERO;
            (v[axis], v[i], v[j]) = (at, a, b);
            v
        };
        let polygon = Polygon::new(&[
            corner(min[i], min[j]),
            corner(max[i], min[j]),
            corner(max[i], max[j]),
            corner(min[i], max[j]),
        ]);
        let out = if is_upper { 1.0 } else { -1.0 };
        (polygon, Half { normal: DVec3::AXES[axis] * out, offset: -at * out })
    })
}

/// Returns the pairs of polygons that hold all segments from the viewcell to the target that are asked about.
/// Cuts keep `pad` more than they must. Empty if the target cannot be seen because it has no area. `None` if
/// one of its faces is seen from less than the clearance over its plane alone.
pub(crate) fn sights(
    triangles: &SceneTriangles,
    cell: &CellBox,
    target: Target,
    c: f64,
    pad: f64,
) -> Option<Vec<Sight>> {
    let mut all = Vec::new();
    let mut grazed = false;
    let mut add = |q: Polygon, before_q: Half| {
        // Heights over Q's plane are c less than those over the target's. As c is at least 64 delta, c / 16
        // covers their errors: a viewcell that is flush with the target does not see it.
        let farthest = DVec3::select(before_q.normal.cmpgt(DVec3::ZERO), cell.max, cell.min);
        let highest = before_q.height(farthest);
        grazed |= c > 0.0 && highest > pad.max(c / 16.0) - c && highest <= pad;
        for (face, before_p) in faces(cell.min, cell.max) {
            let Some(q) = q.clip(before_p.normal, before_p.offset + pad) else { continue };
            let Some(p) = face.clip(before_q.normal, before_q.offset + pad) else { continue };
            all.push(Sight { p, q, before_p, before_q });
        }
    };
    match target {
        Target::Triangle(number) => {
            let t = triangles.corners(number);
            let Some(normal) = (t[1] - t[0]).cross(t[2] - t[0]).try_normalize() else { return Some(all) };
            for normal in [normal, -normal] {
                let q = if c > 0.0 {
                    Polygon::new(&inset(&t, c).map(|v| v + normal * c))
                } else {
                    Polygon::target(&t)
                };
                let offset = q.corners().iter().map(|v| -normal.dot(*v)).fold(f64::MIN, f64::max);
                add(q, Half { normal, offset });
            }
        }
        Target::Box { min, max } => {
            // Less than a quarter of each side, so that something is left.
            let shrink = DVec3::splat(c).min((max - min) * 0.25);
            for (axis, is_upper) in (0..6).map(|face| (face / 2, face % 2 == 1)) {
                let (mut low, mut high) = (min + shrink, max - shrink);
                let at = if is_upper { max[axis] + c } else { min[axis] - c };
                (low[axis], high[axis]) = (at, at);
                let (q, before_q) = match faces(low, high).nth(2 * axis + usize::from(is_upper)) {
                    Some(face) => face,
                    None => continue,
                };
                add(q, before_q);
            }
        }
    }
    (!grazed).then_some(all)
}

/// Returns a triangle shrunk towards the centre of its inscribed circle: each side moves inwards by `c`, or
/// by less where a corner would move by more than 2 c or the triangle would vanish.
fn inset(t: &[DVec3; 3], c: f64) -> [DVec3; 3] {
    let opposite = [0, 1, 2].map(|k| t[(k + 1) % 3].distance(t[(k + 2) % 3]));
    let around: f64 = opposite.iter().sum();
    let radius = (t[1] - t[0]).cross(t[2] - t[0]).length() / around;
    let center = (t[0] * opposite[0] + t[1] * opposite[1] + t[2] * opposite[2]) / around;
    let farthest = t.iter().map(|v| v.distance(center)).fold(0.0, f64::max);
    let part = (c / radius).min(2.0 * c / farthest).min(0.5);
    if part > 0.0 { t.map(|v| v + (center - v) * part) } else { *t }
}
