//! The segments from a viewcell to a target that the search asks about, as pairs of polygons.
//!
//! Every segment from the viewcell to a target outside leaves the viewcell at a face, and the point of exit
//! is itself a viewpoint. So a target is visible exactly if it is visible from the boundary of the viewcell,
//! and geometry inside the viewcell does not matter. Lines of sight run from a point p of P, the exit face,
//! to a point q of Q, a face of the target. Both are cut to the parts that can face each other.
//!
//! With a clearance c > 0, each face of the target is first moved towards the viewcell by c and shrunk by at
//! most 2 c, so that occluders that touch the target along an edge do not touch Q. Take a segment to a point
//! of the target from a viewpoint at least c over the target's plane: a neighbouring segment ends at a point
//! of Q and is at most sqrt(5) c away everywhere. A target is not decided if some viewpoint is more than c /
//! 16 over its plane, but none by more than c; up to c / 16, which covers errors of heights, it is hidden. If
//! only some viewpoints are lower than c, segments from these, at grazing angles, are not asked about.

use crate::half::Half;
use crate::polygon::Polygon;
use crate::triangles::{LIMIT, SceneTriangles, unit_normal};
use alloc::vec::Vec;
use visibility_core::geometry::DoubleDouble;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;

/// The box of a viewcell in scene coordinates, rounded outwards.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct CellBox {
    pub(crate) min: DVec3,
    pub(crate) max: DVec3,
}

impl CellBox {
    /// Returns the box of a viewcell relative to `origin`. `None` if the box is empty or NaN, or if a
    /// coordinate is beyond [`LIMIT`].
    pub(crate) fn new(cell: &Viewcell, origin: DVec3) -> Option<Self> {
        // The difference is exact for most origins, such as (0, 0, 0).
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

    /// Returns the corner of the box that is farthest in front of a plane.
    pub(crate) fn farthest(&self, half: &Half) -> DVec3 {
        DVec3::select(half.normal.cmpgt(DVec3::ZERO), self.max, self.min)
    }

    pub(crate) fn meets(&self, min: DVec3, max: DVec3) -> bool {
        self.min.cmple(max).all() && min.cmple(self.max).all()
    }
}

/// The part of an object that segments from the viewcell are to reach.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Target {
    /// All points in a box, in scene coordinates. The box does not meet the viewcell.
    Box { min: DVec3, max: DVec3 },
    /// A triangle, given by its index in the scene's triangles.
    Triangle(u32),
}

/// Returns the bound in metres on the errors of positions in a search for a target. Polygons are cut from
/// faces of the viewcell and of the target, so coordinates are at most those of triangles, viewcell and
/// target box, plus the clearance. `None` if the clearance `c` is above 0 but less than 64 times this bound,
/// too small to keep touching surfaces apart.
pub(crate) fn position_error(
    triangles: &SceneTriangles,
    cell: &CellBox,
    target: Target,
    c: f64,
) -> Option<f64> {
    let magnitude = match target {
        Target::Box { min, max } => min.abs().max(max.abs()).max_element(),
        Target::Triangle(_) => 0.0,
    };
    let delta = triangles.position_error(cell.magnitude().max(magnitude) + 3.0 * c);
    (c == 0.0 || c >= 64.0 * delta).then_some(delta)
}

/// Position of the viewcell polygon P relative to a one-sided triangle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Facing {
    /// All of the viewcell polygon is in front of the triangle, which occludes for all points of the polygon.
    Before,
    /// The viewcell polygon is on both sides of the triangle's plane.
    Across,
    /// All of the viewcell polygon is behind the triangle's plane, up to rounding.
    Behind,
}

/// Viewcell polygon P (`p`) and target polygon Q (`q`) between which lines of sight run.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Sight {
    pub(crate) p: Polygon,
    pub(crate) q: Polygon,
    /// Half-space outside the viewcell, beyond the face that holds `p`.
    pub(crate) before_p: Half,
    /// Half-space in front of the target polygon's plane, from which the polygon is seen.
    pub(crate) before_q: Half,
    /// Height in metres over the target polygon's plane below which points count as in the plane. 0 if
    /// heights are exact, since the plane is perpendicular to an axis, and if the plane does not meet the
    /// viewcell polygon. `None` without a clearance.
    pub(crate) near: Option<f64>,
}

impl Sight {
    /// Returns the position error in metres, on each axis, that tests of the sides of edges must allow for.
    /// `delta` is the bound on the error of computed positions.
    ///
    /// Without clearance the result is `delta`, since an answer must hold for all segments. With a clearance,
    /// which is at least 64 errors, positions count as exact, but points near the target polygon's plane are
    /// moved into the plane, by less than the result. An answer can then be wrong only for a segment that has
    /// a segment for which it is right within one error of positions.
    #[inline]
    pub(crate) fn side_error(&self, delta: f64) -> f64 {
        // Heights are computed with an error of half of `near`.
        self.near.map_or(delta, |near| 2.0 * near)
    }

    /// Returns whether a point lies in the target polygon's plane, exactly or within `near`.
    #[inline]
    pub(crate) fn is_in_plane_of_q(&self, x: DVec3) -> bool {
        self.before_q.holds(x) || self.near.is_some_and(|near| self.before_q.height(x).abs() < near)
    }

    /// Returns where the viewcell polygon is relative to a one-sided triangle. `front` is the half-space in
    /// front of the triangle, `c` the clearance. Heights have errors up to `pad` metres.
    ///
    /// Without clearance an answer must hold for all segments, so the polygon must certainly be in front of
    /// the triangle. With a clearance, positions count as exact, and so do their heights over a plane that is
    /// perpendicular to an axis: a segment that starts on such a plane does not cross it.
    pub(crate) fn facing(&self, front: &Half, c: f64, pad: f64) -> Facing {
        let heights = || self.p.corners().iter().map(|x| front.height(*x));
        let is_exact = c > 0.0 && front.axis().is_some();
        let (before, apart) = if is_exact { (0.0, 0.0) } else { (pad, 4.0 * pad) };
        if heights().all(|height| height >= before) {
            Facing::Before
        } else if heights().any(|height| height > apart) {
            Facing::Across
        } else {
            Facing::Behind
        }
    }

    /// Returns two copies with the viewcell polygon cut by the plane of a one-sided triangle: first the part
    /// that is certainly in front of the triangle, then the rest, which reaches a little in front of the
    /// plane. `None` if one part has no area.
    pub(crate) fn split(&self, front: &Half, c: f64, pad: f64) -> Option<[Self; 2]> {
        let [near, far] = if c > 0.0 && front.axis().is_some() { [0.0; 2] } else { [2.0 * pad, 3.0 * pad] };
        let before = Half { offset: front.offset - near, ..*front };
        let behind = Half { normal: -front.normal, offset: far - front.offset };
        let with = |half: &Half| self.p.clip(half).map(|p| Self { p, ..*self });
        Some([with(&before)?, with(&behind)?])
    }

    /// Returns the half-space in front of the target polygon to which occluders are clipped. Its boundary is
    /// the polygon's plane if points near that plane count as in it (`near` above 0), or if heights over the
    /// plane are exact. Otherwise its boundary is `pad` metres in front of the plane.
    pub(crate) fn cut_before_q(&self, pad: f64) -> Half {
        if self.near.is_some_and(|near| near > 0.0) { self.before_q } else { self.before_q.padded(-pad) }
    }
}

/// Returns each face of a box with the half-space outside it.
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

/// Returns the pairs of a viewcell polygon and a target polygon between which all segments in question run.
/// Cuts leave a margin of `pad` metres. Empty if the target cannot be seen or has no area. `None` if some
/// viewpoints are over the plane of one of the target's faces by more than a sixteenth of the clearance, but
/// none by more than the clearance.
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
        // The target polygon is the target's face moved by c, so heights over the polygon's plane are c less
        // than those over the target's plane. As c is at least 64 errors of positions, c / 16 covers the
        // errors of heights: a viewcell that is flush with the target does not see it.
        let highest = before_q.height(cell.farthest(&before_q));
        grazed |= c > 0.0 && highest > pad.max(c / 16.0) - c && highest <= pad;
        for (face, before_p) in faces(cell.min, cell.max) {
            let Some(q) = q.clip(&before_p) else { continue };
            // With a clearance, viewpoints behind the target polygon's plane are less than c over the
            // target's plane, and are not asked about.
            let behind = if c > 0.0 { before_q } else { before_q.padded(pad) };
            let Some(p) = face.clip(&behind) else { continue };
            let meets = before_q.axis().is_none() && p.corners().iter().any(|p| before_q.height(*p) < pad);
            let near = if meets { pad / 32.0 } else { 0.0 };
            all.push(Sight { p, q, before_p, before_q, near: (c > 0.0).then_some(near) });
        }
    };
    match target {
        Target::Triangle(number) => {
            let t = triangles.corners(number);
            let Some(normal) = unit_normal(&t) else { return Some(all) };
            // A one-sided triangle is not seen from behind.
            let sides = if triangles.front(number).is_some() { 1 } else { 2 };
            for normal in [normal, -normal].into_iter().take(sides) {
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
            // Each side shrinks by at most a quarter at either end, so that an area is left.
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

/// Returns a triangle shrunk towards the centre of its inscribed circle. Each side moves inwards by `c`
/// metres, or less, so that no corner moves by more than 2 c and the triangle does not vanish.
fn inset(t: &[DVec3; 3], c: f64) -> [DVec3; 3] {
    let opposite = [0, 1, 2].map(|k| t[(k + 1) % 3].distance(t[(k + 2) % 3]));
    let around: f64 = opposite.iter().sum();
    let radius = (t[1] - t[0]).cross(t[2] - t[0]).length() / around;
    let center = (t[0] * opposite[0] + t[1] * opposite[1] + t[2] * opposite[2]) / around;
    let farthest = t.iter().map(|v| v.distance(center)).fold(0.0, f64::max);
    let part = (c / radius).min(2.0 * c / farthest).min(0.5);
    if part > 0.0 { t.map(|v| v + (center - v) * part) } else { *t }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{vec, vec::Vec};
    use visibility_core::glam::Vec3;
    use visibility_core::{Aabb, Object, Scene};
    use visibility_testing::{Random, orientation_sign};

    fn unit_cell() -> CellBox {
        CellBox { min: DVec3::ZERO, max: DVec3::ONE }
    }

    fn prepared(triangles: Vec<[Vec3; 3]>) -> SceneTriangles {
        let mut scene = Scene::new();
        let bounds = Aabb::from_points(triangles.iter().flatten().copied());
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, triangles).unwrap();
        SceneTriangles::new(&scene)
    }

    #[test]
    fn viewcells_are_rounded_outwards() {
        let mut random = Random(1);
        for _ in 0..1000 {
            let (origin, size) = (random.fine_vector(1e6), random.fine_vector(1.0).abs());
            let min = random.fine_vector(10.0);
            let cell = CellBox::new(&Viewcell::from_box(min, min + size), origin).unwrap();
            for k in 0..3 {
                let [low, high] = [min, min + size].map(|x| DoubleDouble::difference(x[k], origin[k]));
                assert!(
                    cell.min[k] - low.hi <= low.lo && cell.max[k] - high.hi >= high.lo,
                    "axis {k}: {cell:?} holds {min} and its size {size} from {origin}"
                );
            }
        }
    }

    /// A target box up to 1e20 metres wide below the viewcell, in a scene of small triangles. Where the plane
    /// of the viewcell's face cuts the box's top, the cut is exactly in this plane, though rounding of other
    /// coordinates may be metres.
    #[test]
    fn what_is_cut_from_a_huge_box_ends_in_the_plane_exactly() {
        let mut random = Random(5);
        let triangles = prepared(vec![[Vec3::X, Vec3::Y, Vec3::Z]]);
        let mut cuts = 0;
        for _ in 0..2000 {
            let far = 10f64.powf(random.range(0.0, 20.0));
            let mut side = || far * random.fine_range(0.5, 1.0);
            let (a, b, c, d) = (side(), side(), side(), side());
            let (min, max) = (DVec3::new(-a, -b, -3.0), DVec3::new(c, d, -2.0));
            let target = Target::Box { min, max };
            for sight in sights(&triangles, &unit_cell(), target, 0.0, 4.0).unwrap() {
                let corners = sight.q.corners().iter().map(|q| sight.before_p.height(*q));
                let least = corners.fold(f64::MAX, f64::min);
                if sight.before_p.normal.z == 0.0 && c > 2.0 && d > 2.0 && sight.before_q.normal.z > 0.0 {
                    assert_eq!(least, 0.0, "{far}: a corner of Q is off the plane");
                    cuts += 1;
                }
            }
        }
        assert!(cuts > 1000, "{cuts}");
    }

    /// Triangles as thin as their coordinates allow. A point that is behind a triangle's plane by exact
    /// arithmetic does not count as certainly in front.
    #[test]
    fn planes_of_slivers_are_right() {
        let mut random = Random(6);
        for round in 0..3000 {
            let along = random.vec3(-1.0, 1.0);
            let thin = 10f64.powf(random.range(-6.0, -1.0)) as f32;
            let base = random.vec3(-1.0, 1.0) * 10f64.powf(random.range(-9.0, 0.0)) as f32;
            let t = [base, base + along * 8.0, base + along * 4.0 + random.vec3(-1.0, 1.0) * thin];
            let triangles = prepared(vec![t]);
            let target = Target::Triangle(0);
            let delta = position_error(&triangles, &unit_cell(), target, 0.0).unwrap();
            let cell = CellBox { min: DVec3::splat(20.0), max: DVec3::splat(21.0) };
            let t = t.map(Vec3::as_dvec3);
            for sight in sights(&triangles, &cell, target, 0.0, 4.0 * delta).unwrap() {
                // The triangle's own corners are on its plane, up to rounding.
                for v in t {
                    let height = sight.before_q.height(v);
                    assert!(height.abs() <= delta, "{round}: a corner is off by {} bounds", height / delta);
                }
                let x = random.vec3(-8.0, 8.0).as_dvec3();
                let height = sight.before_q.height(x);
                let is_front = sight.before_q.normal.dot(unit_normal(&t).unwrap()) > 0.0;
                let exact = orientation_sign(t[0], t[1], t[2], x) * if is_front { 1 } else { -1 };
                assert!(height.abs() <= 4.0 * delta || (height > 0.0) == (exact > 0), "{round}: {height}");
            }
        }
    }
}
