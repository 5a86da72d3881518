//! Classes of objects by area, facing direction and openness, coarse enough that similar objects share a
//! layer (group of objects of a cell that are projected together).

use visibility_core::glam::DVec3;
use visibility_core::{ObjectId, Scene};

/// Class of an object's surface by area, facing direction and openness, or mean class of a group of objects
/// (layer).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct SurfaceClass {
    /// Area class, on a logarithmic scale of the area in square metres: each class spans a factor of four.
    /// Larger areas have larger classes, NaN the largest (127).
    pub(crate) area: u8,
    /// Axis side that the surface faces most: twice the axis (0, 1, 2), plus one towards negative
    /// coordinates. [`ANY_SIDE`] for objects that do not have exactly one triangle.
    pub(crate) side: u8,
    /// Class of the openness (mean free distance in front of the surface, 0 to 1), on a logarithmic scale of
    /// two steps per factor of two: an openness of 1 is [`FULLY_OPEN`], 1/2 two less. 0 stands for the least
    /// representable openness and all smaller ones.
    pub(crate) openness: u8,
}

/// Upper bound on how far normals lean from the axis of their side, in units of 1/[`LEAN_AT_45_DEGREES`]: no
/// component across the axis exceeds `lean / LEAN_AT_45_DEGREES` times the component along the axis.
/// [`UNKNOWN_LEAN`] is no bound.
pub(crate) type MaxLean = u8;

/// Number of units of [`MaxLean`] for a normal at 45 degrees to its axis. No normal leans farther, since a
/// normal is assigned to the axis of its largest component.
pub(crate) const LEAN_AT_45_DEGREES: f32 = 14.0;

/// Value of [`MaxLean`] for objects without a reliable normal: no bound on the direction of their normals.
pub(crate) const UNKNOWN_LEAN: MaxLean = 15;

/// Number of axis sides that a surface can face: two for each of x, y and z.
pub(crate) const SIDES: usize = 6;

/// Side number of objects that do not have exactly one triangle with a normal.
pub(crate) const ANY_SIDE: u8 = SIDES as u8;

/// Openness class of an openness of 1, the largest class.
const FULLY_OPEN: u8 = 31;

/// Returns the area class of an area in square metres, 0 to 127. Negative areas have class 0, NaN has 127.
fn class_of(area: f32) -> u8 {
    // The sign bit is clear; what remains is the exponent without its lowest bit.
    if area.is_nan() { 0x7f } else { (area.max(0.0).to_bits() >> 24) as u8 }
}

/// Returns the area in square metres in the middle of an area class, on a logarithmic scale.
fn area_of(class: u8) -> f32 {
    f32::from_bits(u32::from(class) << 24 | 1 << 23)
}

/// Returns approximately how many steps of a factor of sqrt 2 (half octaves) `openness` lies below 1, taken
/// from the float's exponent and the highest bit of its fraction, rounded up. `openness` is clamped to the
/// range from 0 to 1; NaN counts as 1.
fn halves_below_one(openness: f32) -> u8 {
    let below = (1.0f32.to_bits() >> 22).saturating_sub(openness.clamp(0.0, 1.0).to_bits() >> 22);
    below.min(u8::MAX.into()) as u8
}

/// Returns the least openness (greater than 0, at most 1) of an openness class.
#[inline]
pub(crate) fn openness_of(class: u8) -> f32 {
    let halves = u32::from(FULLY_OPEN - class.min(FULLY_OPEN));
    f32::from_bits(((1.0f32.to_bits() >> 22) - halves) << 22)
}

impl SurfaceClass {
    /// Returns an object's class and the lean of its normal. The area is that of the object's triangles, or
    /// of its bounds' six faces if it has no triangles. `openness` is 0 to 1, NaN counts as 1. Objects that
    /// do not have exactly one triangle get [`ANY_SIDE`] and [`UNKNOWN_LEAN`].
    pub(crate) fn of_object(scene: &Scene, id: ObjectId, openness: f32) -> (Self, MaxLean) {
        let triangles = scene.triangles(id).unwrap_or_default();
        // The sum is in f64, since squared areas overflow f32 before coordinates do.
        let mut area = 0.0;
        for [a, b, c] in triangles {
            area += (b - a).as_dvec3().cross((c - a).as_dvec3()).length() * 0.5;
        }
        let mut area = area as f32;
        if triangles.is_empty()
            && let Ok(bounds) = scene.bounds(id)
        {
            let size = bounds.max - bounds.min;
            area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
        }
        let (side, lean) = match (triangles.first(), triangles.len()) {
            (Some([a, b, c]), 1) if triangles.has_certain_fronts() => {
                side_of(b.as_dvec3() - a.as_dvec3(), c.as_dvec3() - a.as_dvec3())
            }
            _ => (ANY_SIDE, UNKNOWN_LEAN),
        };
        let openness = FULLY_OPEN - halves_below_one(openness).min(FULLY_OPEN);
        (Self { area: class_of(area), side, openness }, lean)
    }

    /// Returns the area in square metres in the middle of the area class, on a logarithmic scale.
    #[inline]
    pub(crate) fn area(self) -> f32 {
        area_of(self.area)
    }

    /// Returns the least openness (mean free distance in front of the surface, greater than 0, at most 1) of
    /// the openness class.
    #[inline]
    pub(crate) fn openness(self) -> f32 {
        openness_of(self.openness)
    }

    /// Returns the rank of the class: area times openness on a logarithmic scale, in steps of a factor of
    /// sqrt 2. Objects of higher rank are more likely visible.
    pub(crate) fn rank(self) -> u32 {
        u32::from(self.area) * 4 + u32::from(self.openness)
    }

    /// Returns the mean class of many objects: class of the mean area, mean openness class, and the side if
    /// all objects have the same side, else [`ANY_SIDE`]. No objects give area and openness class 0.
    pub(crate) fn mean(classes: impl Iterator<Item = Self> + Clone) -> Self {
        let count = classes.clone().count().max(1);
        let area: f32 = classes.clone().map(Self::area).sum();
        let openness: usize = classes.clone().map(|class| usize::from(class.openness)).sum();
        let first = classes.clone().next().map_or(ANY_SIDE, |class| class.side);
        let side = if classes.clone().all(|class| class.side == first) { first } else { ANY_SIDE };
        Self { area: class_of(area / count as f32), side, openness: (openness / count) as u8 }
    }
}

/// Returns the axis side that a triangle faces most, and the lean of its normal. `u` and `v` are the edges
/// from the first corner to the second and third, anticlockwise seen from the front. [`ANY_SIDE`] for a
/// triangle without a normal; [`UNKNOWN_LEAN`] if rounding makes the normal unreliable.
fn side_of(u: DVec3, v: DVec3) -> (u8, MaxLean) {
    let normal = u.cross(v);
    let size = normal.abs();
    let axis = size.max_position();
    if size[axis].is_nan() || size[axis] <= 0.0 {
        return (ANY_SIDE, UNKNOWN_LEAN);
    }
    let side = axis as u8 * 2 + u8::from(normal[axis] < 0.0);
    let lean = size[(axis + 1) % 3].max(size[(axis + 2) % 3]) / size[axis];
    // The normal's error is about 1e-15 times the product of the edge lengths, so at most 1e-8 of the lengths
    // accepted here. Where the product overflows, so do the lengths, and nothing is known.
    let known = size[axis] > 1e-7 * u.length() * v.length();
    let steps = (lean - 1e-7).max(0.0) * f64::from(LEAN_AT_45_DEGREES);
    // Casts round towards zero.
    (side, if known { steps as u8 + u8::from(steps > f64::from(steps as u8)) } else { UNKNOWN_LEAN })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::normal_bins::BoxFromEye;
    use crate::test_exact::{IntVector, Random, RandomExact, cross, minus};

    #[test]
    fn classes_are_in_order_and_hold_their_middle() {
        let areas = [0.0, 1e-45, 1e-30, 0.02, 0.1, 0.3, 1.9, 2.1, 7.9, 8.1, 1e30, f32::MAX, f32::INFINITY];
        assert!(
            areas.windows(2).all(|pair| class_of(pair[0]) <= class_of(pair[1])),
            "larger areas are of no lower class"
        );
        for area in areas {
            assert_eq!(class_of(area_of(class_of(area))), class_of(area), "{area}");
        }
        assert!(
            class_of(2.1) < class_of(8.1) && class_of(f32::NAN) >= class_of(f32::INFINITY),
            "classes four times apart in area, and that of NaN"
        );
        assert_eq!(class_of(-1.0), 0, "the class of a negative area");
    }

    #[test]
    fn classes_tell_sides_and_openness() {
        let class = |openness: f32, t: [[f32; 3]; 3]| {
            let mut scene = Scene::new();
            let t = t.map(visibility_core::glam::Vec3::from_array);
            let id = scene.insert(visibility_core::Aabb::from_points(t));
            scene.set_triangles(id, [t]).unwrap();
            SurfaceClass::of_object(&scene, id, openness).0
        };
        let up = [[0.0; 3], [1.0, 0.0, 0.2], [0.0, 1.0, -0.2]];
        assert_eq!(
            (class(1.0, up).side, class(1.0, [up[0], up[2], up[1]]).side),
            (4, 5),
            "sides of a triangle and of its back"
        );
        assert_eq!(class(1.0, [up[0], up[1], up[1]]).side, ANY_SIDE, "the side of a triangle without area");
        for openness in [1.0, 0.7, 0.5, 0.3, 0.02, 1e-4] {
            let told = class(openness, up).openness();
            assert!(told <= openness && openness < told * 1.51, "{openness}: {told}");
        }
        assert!(
            class(0.0, up).openness() < 1e-4 && class(f32::NAN, up).openness() == 1.0,
            "openness of 0 and of NaN"
        );
    }

    /// Triangles of all directions in a box and eyes around the box: where `is_behind` is true for a
    /// triangle's side and lean, the eye is behind the triangle.
    #[test]
    fn what_is_behind_a_side_is_behind_its_triangles() {
        let mut random = Random(5);
        let cell = visibility_core::Aabb::from_arrays([-1.0; 3], [1.0; 3]);
        let (mut behind, mut leaning) = (0, 0);
        for i in 0..20_000 {
            let mut point = || DVec3::new(random.float(), random.float(), random.float());
            let (a, mut b, mut c) = (point(), point(), point());
            if i % 2 == 0 {
                (b.x, c.x) = (a.x, a.x + (c.x - a.x) * 0.3);
            }
            let eye = point() * 8.0;
            let (side, lean) = side_of(b - a, c - a);
            let toward = BoxFromEye::new(visibility_core::view::Eye::Point(eye), 0.0, &cell);
            if lean < UNKNOWN_LEAN && toward.is_behind(side, f32::from(lean) / LEAN_AT_45_DEGREES) {
                assert!((b - a).cross(c - a).dot(eye - a) < 0.0, "{a} {b} {c} from {eye}: {side} {lean}");
                behind += 1;
                leaning += u32::from(lean > 4);
            }
        }
        assert!(behind > 500 && leaning > 200, "{behind} {leaning}");
    }

    /// Normals along an axis lean by nothing; normals that are NaN, infinite or nothing have no side that is
    /// told.
    #[test]
    fn normals_at_their_limits_have_a_side_or_none() {
        assert_eq!(side_of(DVec3::X, DVec3::Y), (4, 0), "a normal along z");
        assert_eq!(side_of(DVec3::Y, DVec3::X), (5, 0), "a normal against z");
        assert_eq!(side_of(DVec3::X, DVec3::X), (ANY_SIDE, UNKNOWN_LEAN), "no normal");
        assert_eq!(side_of(DVec3::NAN, DVec3::X), (ANY_SIDE, UNKNOWN_LEAN), "a normal of NaN");
        let [u, v] = [DVec3::new(1.3, 1.3, 0.0), DVec3::new(-1.4, 1.4, 0.0)].map(|p| p * 1e154);
        assert_eq!(side_of(u, v).1, UNKNOWN_LEAN, "a normal that overflows");
    }

    /// The mean of equal classes is that class, and the mean of none has no area.
    #[test]
    fn means_are_those_of_their_classes() {
        let class = SurfaceClass { area: class_of(2.5), side: 3, openness: 20 };
        assert_eq!(SurfaceClass::mean([class; 8].into_iter()), class, "eight equal classes");
        let other = SurfaceClass { side: 4, openness: 10, ..class };
        let mean = SurfaceClass::mean([class, other].into_iter());
        assert_eq!((mean.side, mean.openness), (ANY_SIDE, 15), "two classes of different sides");
        assert_eq!(SurfaceClass::mean([].into_iter()).area, 0, "no class");
    }

    /// Slivers whose normals are lost in rounding, wholly or partly: a reported side and lean always agree
    /// with exact arithmetic.
    #[test]
    fn of_slivers_nothing_wrong_is_said() {
        let mut random = Random(51);
        let (mut told, mut untold) = (0, 0);
        for round in 0..40_000 {
            // The corners are a, B 2^n and C 2^n; B and C lie on one line through the origin, so the normal
            // is a x (B - C) times 2^n.
            let a = random.integers(1 << 20);
            let (direction, farther) = (random.integers(1 << 10), 5 + random.whole(4));
            let scale = 2f64.powi(round % 60);
            let (b, c) = (direction.map(|x| x * 3), direction.map(|x| x * farther));
            let float = |p: IntVector, scale: f64| DVec3::from_array(p.map(|x| x as f64 * scale));
            let (u, v) = (float(b, scale) - float(a, 1.0), float(c, scale) - float(a, 1.0));
            let exact = cross(a, minus(b, c));
            let (side, lean) = side_of(u, v);
            if lean == UNKNOWN_LEAN {
                untold += 1;
                continue;
            }
            told += 1;
            let axis = usize::from(side / 2);
            let along = exact[axis] * if side % 2 == 0 { 1 } else { -1 };
            assert!(along > 0, "{u} {v}: {side}");
            for other in [(axis + 1) % 3, (axis + 2) % 3] {
                let most = (f64::from(lean) / f64::from(LEAN_AT_45_DEGREES) + 1e-6) * along as f64;
                assert!(exact[other].abs() as f64 <= most, "{u} {v}: {side}, {lean}");
            }
        }
        assert!(told > 5_000 && untold > 5_000, "{told} {untold}");
    }
}
