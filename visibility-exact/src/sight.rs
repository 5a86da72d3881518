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
        grazed |= c > 0.0 && highest > c / 16.0 - c && highest <= pad;
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

/// Returns a triangle shrunk towards the centre of its inscribed circle, so that no corner moves by more than
/// 2 c and the triangle does not vanish. No side moves by more than `c` metres then: the corner with the
/// least angle, of at most 60 degrees, is at least twice the circle's radius from its centre.
fn inset(t: &[DVec3; 3], c: f64) -> [DVec3; 3] {
    let opposite = [0, 1, 2].map(|k| t[(k + 1) % 3].distance(t[(k + 2) % 3]));
    let around: f64 = opposite.iter().sum();
    let center = (t[0] * opposite[0] + t[1] * opposite[1] + t[2] * opposite[2]) / around;
    let farthest = t.iter().map(|v| v.distance(center)).fold(0.0, f64::max);
    let part = (2.0 * c / farthest).min(0.5);
    t.map(|v| v + (center - v) * part)
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

    #[test]
    fn viewcells_that_cannot_be_used_are_refused() {
        let new = |min: DVec3, max: DVec3| CellBox::new(&Viewcell::from_box(min, max), DVec3::ZERO);
        let (low, high) = (DVec3::splat(-2.0), DVec3::splat(3.0));
        for k in 0..3 {
            let with = |mut v: DVec3, x: f64| {
                v[k] = x;
                v
            };
            for [a, b] in [[1.0, 1.0], [-LIMIT, 1.0], [1.0, LIMIT], [-LIMIT, LIMIT]] {
                let (min, max) = (with(low, a), with(high, b));
                assert_eq!(new(min, max), Some(CellBox { min, max }), "axis {k} from {a} to {b}");
            }
            let (under, over) = ((-LIMIT).next_down(), LIMIT.next_up());
            for [a, b] in [[1.0, 0.5], [under, 1.0], [1.0, over], [f64::NAN, 1.0], [1.0, f64::NAN]] {
                assert_eq!(new(with(low, a), with(high, b)), None, "axis {k} from {a} to {b}");
            }
        }
    }

    /// A box that touches the viewcell in a side meets it. A box that is farther away on one axis does not.
    #[test]
    fn boxes_that_touch_the_viewcell_meet_it() {
        for axis in DVec3::AXES {
            for side in [axis, -axis] {
                assert!(unit_cell().meets(side, side + 1.0), "a box that touches the side {side}");
                let apart = side * 1f64.next_up();
                assert!(!unit_cell().meets(apart, apart + 1.0), "a box that is beyond the side {side}");
            }
        }
    }

    /// The bound on the error of positions holds for the greatest coordinate of the triangles, the viewcell
    /// and a target box, whichever has it and on whichever side. A clearance of 64 errors is the least.
    #[test]
    fn the_greatest_coordinate_bounds_the_error() {
        let near = Target::Box { min: DVec3::splat(-2.0), max: DVec3::splat(2.0) };
        let triangles = |far: f32| prepared(vec![[Vec3::X, Vec3::Y * far, Vec3::Z]]);
        for far in [DVec3::splat(-64.0), DVec3::splat(64.0), DVec3::Y * 64.0, DVec3::Z * -64.0] {
            let (min, max) = (far.min(DVec3::ZERO), far.max(DVec3::ZERO));
            let (cell, target) = (CellBox { min, max }, Target::Box { min, max });
            let bound = Some(triangles(1.0).position_error(64.0));
            for (cell, target) in [(cell, near), (unit_cell(), target), (cell, Target::Triangle(0))] {
                let found = position_error(&triangles(1.0), &cell, target, 0.0);
                assert_eq!(found, bound, "{cell:?} {target:?}");
            }
            assert_eq!(cell.magnitude(), 64.0, "the greatest coordinate of {cell:?}");
        }
        let error = |c: f64| position_error(&triangles(64.0), &unit_cell(), Target::Triangle(0), c);
        let bound = triangles(64.0).position_error(0.0);
        let least = 64.0 * bound;
        for (c, found) in
            [(0.0, Some(bound)), (least.next_down(), None), (least, Some(bound)), (1.0, Some(bound))]
        {
            assert_eq!(error(c), found, "clearance {c}");
        }
    }

    /// Returns a square of the plane x = 0 as the viewcell polygon, with one beyond it as the target polygon,
    /// whose plane is said to be the one with this normal and offset.
    fn sight_before(normal: DVec3, offset: f64) -> Sight {
        let [p, q] = [0.0, 9.0].map(|x| {
            Polygon::new(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[y, z]| DVec3::new(x, y, z)))
        });
        let before_p = Half { normal: DVec3::X, offset: 0.0 };
        Sight { p, q, before_p, before_q: Half { normal, offset }, near: None }
    }

    /// With a clearance, a polygon that touches the plane of a one-sided triangle which is perpendicular to
    /// an axis is before it or behind it. Without one, and at a tilted plane, it must be farther away.
    #[test]
    fn polygons_at_the_plane_of_a_one_sided_triangle_are_before_it_if_that_is_exact() {
        let (axis, tilted) = (DVec3::Y, DVec3::new(0.0, 0.8, 0.6));
        let (c, pad) = (1.0, 0.01);
        let facing = |normal: DVec3, offset: f64, c: f64| {
            sight_before(axis, 0.0).facing(&Half { normal, offset }, c, pad)
        };
        for (c, normal) in [(0.0, axis), (0.0, tilted), (c, axis), (c, tilted)] {
            let is_exact = c > 0.0 && normal == axis;
            let (touching, behind) = (facing(normal, 0.0, c), -normal.dot(DVec3::new(0.0, 1.0, 1.0)));
            let expected = if is_exact { Facing::Before } else { Facing::Across };
            assert_eq!(touching, expected, "{normal} with clearance {c}: a polygon that touches the plane");
            assert_eq!(facing(normal, behind, c), Facing::Behind, "{normal} with clearance {c}: on the back");
            assert_eq!(facing(normal, -0.5, c), Facing::Across, "{normal} with clearance {c}: on both sides");
            let lifted = [0.9, 1.1].map(|part| facing(normal, part * pad, c) == Facing::Before);
            assert_eq!(lifted, [is_exact, true], "{normal} with clearance {c}: 0.9 and 1.1 errors before it");
            // What is split needs no further split.
            let front = Half { normal, offset: -0.5 };
            let parts = sight_before(axis, 0.0).split(&front, c, pad).unwrap();
            let found = parts.map(|part| part.facing(&front, c, pad));
            assert_eq!(found, [Facing::Before, Facing::Behind], "{normal} with clearance {c}: parts");
            let area = parts.map(|part| part.p.normal().length()).into_iter().sum::<f64>();
            let overlap = if is_exact { 0.0 } else { 2.0 * pad };
            assert!(
                (area - 2.0 - overlap).abs() <= overlap + 1e-12,
                "{normal}: the parts have twice the area {area}"
            );
            let beside = Half { normal, offset: -2.0 };
            assert_eq!(sight_before(axis, 0.0).split(&beside, c, pad), None, "{normal}: no part before it");
        }
    }

    /// A triangle behind a plane of the viewcell, tilted so that its plane meets the viewcell or not, or
    /// perpendicular to an axis.
    #[test]
    fn points_near_the_plane_of_a_target_count_as_in_it_where_heights_are_rounded() {
        let tilted = |x: f32| [Vec3::new(x, 0.0, 3.0), Vec3::new(x, 1.0, 3.0), Vec3::new(x + 1.0, 0.0, 4.0)];
        let level = [Vec3::new(3.0, 0.0, 0.5), Vec3::new(4.0, 0.0, 0.5), Vec3::new(3.0, 1.0, 0.5)];
        let pad = 1.0 / 64.0;
        for (t, is_met, is_level) in
            [(tilted(3.0), true, false), (tilted(9.0), false, false), (level, true, true)]
        {
            let triangles = prepared(vec![t]);
            for c in [0.0, 0.25] {
                let all = sights(&triangles, &unit_cell(), Target::Triangle(0), c, pad).unwrap();
                assert!(!all.is_empty(), "{t:?} is seen with clearance {c}");
                let mut least = f64::MAX;
                for sight in all {
                    let lowest = sight.p.corners().iter().map(|p| sight.before_q.height(*p));
                    let lowest = lowest.fold(f64::MAX, f64::min);
                    least = least.min(lowest);
                    let near = if !is_level && lowest < pad { pad / 32.0 } else { 0.0 };
                    assert_eq!(sight.near, (c > 0.0).then_some(near), "{t:?} with clearance {c}");
                    let error = if c > 0.0 { 2.0 * near } else { 1e-3 };
                    assert_eq!(sight.side_error(1e-3), error, "{t:?} with clearance {c}: errors of sides");
                    let zeros = sight.q.zero[..sight.q.corners().len()].iter().any(|zero| *zero != 0);
                    assert_eq!(zeros, c == 0.0, "{t:?} with clearance {c}: corners of the target");
                    let [on, beside] = [0.0, 0.75].map(|part| {
                        let normal = sight.before_q.normal;
                        let corner = sight.q.corners()[0];
                        let on_plane = corner - normal * sight.before_q.height(corner);
                        let point = on_plane + normal * (part * pad / 32.0);
                        [point, point + normal * pad].map(|x| sight.is_in_plane_of_q(x))
                    });
                    let is_near = c > 0.0 && near > 0.0;
                    assert_eq!([on[1], beside[1]], [false; 2], "{t:?} with clearance {c}: far points");
                    assert_eq!(on[0], is_near || is_level, "{t:?} with clearance {c}: a point in the plane");
                    assert_eq!(beside[0], is_near, "{t:?} with clearance {c}: a point near the plane");
                    let cut = sight.before_q.offset - sight.cut_before_q(pad).offset;
                    let expected = if is_level || near > 0.0 && c > 0.0 { 0.0 } else { pad };
                    assert!((cut - expected).abs() < 1e-9, "{t:?} with clearance {c}: cut at {cut}");
                }
                // Without clearance, viewpoints count that rounding may have put behind the plane.
                if is_met {
                    let expected = if c > 0.0 || is_level { 0.0 } else { -pad };
                    assert!((least - expected).abs() < 1e-9, "{t:?} with clearance {c}: P begins at {least}");
                }
            }
        }
    }

    /// A target below the viewcell's highest viewpoint by `height`. With a clearance, it is hidden up to a
    /// sixteenth of the clearance, and decided beyond the clearance.
    #[test]
    fn targets_that_no_viewpoint_is_a_clearance_above_are_left_open() {
        let pad = 1.0 / 128.0;
        for (c, height, is_decided) in [
            (0.25, -0.5, true),
            (0.25, 0.0, true),
            (0.25, 1.0 / 64.0, true),
            (0.25, 1.0 / 32.0, false),
            (0.25, 0.125, false),
            (0.25, 0.25, false),
            (0.25, 0.25 + pad, false),
            (0.25, 0.25 + 2.0 * pad, true),
            (0.0, -pad, true),
            (0.0, 0.0, true),
            (0.0, 0.5 * pad, true),
            (0.0, pad, true),
        ] {
            let z = 1.0 - height as f32;
            // Sides of 3, 4 and 5 m, so that the shrunk triangle is exactly in its plane.
            let t = [Vec3::new(3.0, 0.0, z), Vec3::new(6.0, 0.0, z), Vec3::new(3.0, 4.0, z)];
            let target = Target::Triangle(0);
            let found = sights(&prepared(vec![t]), &unit_cell(), target, c, pad);
            assert_eq!(found.is_some(), is_decided, "height {height}, clearance {c}");
        }
    }

    /// Faces of a target box are moved outwards by the clearance, and shrunk by it or by a quarter.
    #[test]
    fn faces_of_a_target_box_are_shrunk_but_not_away() {
        let (min, max) = (DVec3::new(4.0, -3.0, -2.0), DVec3::new(8.0, 4.0, -1.75));
        let (triangles, c) = (prepared(vec![[Vec3::X, Vec3::Y, Vec3::Z]]), 0.125);
        let all = sights(&triangles, &unit_cell(), Target::Box { min, max }, c, 1e-9).unwrap();
        let mut found = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for sight in all.iter().filter(|sight| sight.before_q.normal == DVec3::NEG_X) {
            for q in sight.q.corners() {
                found = (found.0.min(*q), found.1.max(*q));
            }
        }
        let low = DVec3::new(4.0 - c, -3.0 + c, -2.0 + 0.0625);
        let high = DVec3::new(4.0 - c, 4.0 - c, -1.75 - 0.0625);
        assert_eq!(found, (low, high), "the face towards the viewcell");
    }

    /// A corner of a shrunk triangle moves by twice the clearance, unless the triangle would lose more than
    /// half. No side moves by more than the clearance.
    #[test]
    fn shrunk_triangles_are_as_large_as_they_may_be() {
        let mut random = Random(12);
        let mut limits = [0; 2];
        for round in 0..1000 {
            let flat = 10f64.powf(random.range(-3.0, 0.0));
            let t: [DVec3; 3] =
                core::array::from_fn(|_| random.fine_vector(4.0) * DVec3::new(1.0, flat, 1.0));
            let c = 10f64.powf(random.range(-3.0, 0.0));
            let inner = inset(&t, c);
            let moved = (0..3).map(|k| t[k].distance(inner[k])).fold(0.0, f64::max);
            let side = |k: usize| {
                let (a, along) = (t[k], (t[(k + 1) % 3] - t[k]).normalize());
                (inner[k] - a).reject_from_normalized(along).length()
            };
            let inwards = (0..3).map(side).fold(0.0, f64::max);
            let part = inner[0].distance(inner[1]) / t[0].distance(t[1]);
            let bounds = [moved / (2.0 * c), (1.0 - part) / 0.5];
            let most = bounds[0].max(bounds[1]);
            assert!((most - 1.0).abs() < 1e-6, "{round}: {bounds:?}");
            assert!(inwards < c * (1.0 + 1e-9), "{round}: a side moves by {inwards} with clearance {c}");
            limits[usize::from(bounds[1] == most)] += 1;
        }
        assert!(limits.iter().all(|limit| *limit > 20), "triangles at each limit: {limits:?}");
    }

    /// Every segment from the viewcell to a point of a target leaves the viewcell by a polygon P and meets
    /// the target first in a polygon Q that belongs to it.
    #[test]
    fn each_segment_has_its_polygons() {
        let mut random = Random(13);
        let holds = |polygon: &Polygon, normal: DVec3, x: DVec3| {
            let corners = polygon.corners();
            let turn = polygon.normal().dot(normal).signum();
            (0..corners.len()).all(|k| {
                let along = corners[(k + 1) % corners.len()] - corners[k];
                (normal * turn).cross(along).dot(x - corners[k]) >= -1e-9
            })
        };
        let triangles = prepared(vec![[Vec3::X * 8.0, Vec3::Y, Vec3::Z]]);
        let mut found = [0; 2];
        for round in 0..4000 {
            // A target beside the viewcell, with coordinates on the planes of the viewcell's faces.
            let at = DVec3::from_array([(); 3].map(|()| f64::from(random.between(-4, 4)) / 2.0));
            let size = DVec3::from_array([(); 3].map(|()| f64::from(random.between(1, 4)) / 2.0));
            let (min, max) = (at, at + size);
            if unit_cell().meets(min, max) {
                continue;
            }
            let corner = |random: &mut Random, min: DVec3, max: DVec3| {
                DVec3::from_array([0, 1, 2].map(|k| match random.below(4) {
                    0 => min[k],
                    1 => max[k],
                    _ => random.fine_range(min[k], max[k]),
                }))
            };
            let p = corner(&mut random, DVec3::ZERO, DVec3::ONE);
            let inside = |x: f64, low: f64, high: f64| low + (high - low) * (0.05 + 0.9 * x);
            let q = DVec3::from_array([0, 1, 2].map(|k| inside(random.fine_unit(), min[k], max[k])));
            let all = sights(&triangles, &unit_cell(), Target::Box { min, max }, 0.0, 1e-9).unwrap();
            let d = q - p;
            let is_on_way = all.iter().any(|sight| {
                let [from, to] = [(sight.p, sight.before_p, 1.0), (sight.q, sight.before_q, -1.0)].map(
                    |(polygon, plane, towards)| {
                        let part = -plane.height(p) / plane.normal.dot(d);
                        let x = p + d * part;
                        let is_passed = plane.normal.dot(d) * towards > 0.0 && (-1e-9..=1.0).contains(&part);
                        is_passed && holds(&polygon, plane.normal, x)
                    },
                );
                from && to
            });
            assert!(is_on_way, "{round}: from {p} to {q} in the box from {min} to {max}");
            found[usize::from(all.len() > 2)] += 1;
        }
        assert!(found.iter().all(|count| *count > 20), "targets with few and many polygons: {found:?}");
    }
}
