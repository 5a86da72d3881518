//! What single objects are like that counts for when they are seen: how large they are, which side they face, and how exposed they are; in
//! classes, so that like ones go together.

use visibility_core::glam::DVec3;
use visibility_core::{ObjectId, Scene};

/// What the objects of a layer are like.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct Kind {
    /// The class of their areas: each holds areas up to four times its least. Greater areas have greater classes; NaN the greatest.
    pub(crate) area: u8,
    /// Along which axis of the scene they face most, twice, and one more if downwards; or [`ANYWHERE`].
    pub(crate) facing: u8,
    /// How exposed they are: two steps are twice as much, and [`OPEN`] is 1.
    pub(crate) exposure: u8,
}

/// How far normals lean from the axis that they face: no component along another axis is greater than this many [`LEANS`]ths of that along it;
/// or [`ANYHOW`].
pub(crate) type Lean = u8;

/// Steps of leaning as far as any that face a side.
pub(crate) const LEANS: f32 = 14.0;

/// Leaning who knows how.
pub(crate) const ANYHOW: Lean = 15;

/// Sides that can be faced.
pub(crate) const SIDES: usize = 6;

/// Facing no side above all.
pub(crate) const ANYWHERE: u8 = SIDES as u8;

/// The greatest exposure.
const OPEN: u8 = 31;

/// The class of an area.
fn class_of(area: f32) -> u8 {
    // The sign bit is clear, and the exponent without its lowest bit is left.
    if area.is_nan() { 0x7f } else { (area.max(0.0).to_bits() >> 24) as u8 }
}

/// An area in the middle of a class.
fn area_of(class: u8) -> f32 {
    f32::from_bits(u32::from(class) << 24 | 1 << 23)
}

/// How many half octaves an exposure is below 1: by the exponent, and the highest bit of the fraction.
pub(crate) fn below_open(exposure: f32) -> u8 {
    let below = (1.0f32.to_bits() >> 22).saturating_sub(exposure.clamp(0.0, 1.0).to_bits() >> 22);
    below.min(u8::MAX.into()) as u8
}

/// The exposure so many half octaves below 1.
#[inline]
pub(crate) fn open_less(halves: u8) -> f32 {
    f32::from_bits(((1.0f32.to_bits() >> 22) - u32::from(halves)) << 22)
}

impl Kind {
    /// The kind of an object by itself, from its exposure, 0 to 1: by the area of its triangles, or of its box if it has none. And how far it
    /// leans.
    pub(crate) fn of_object(scene: &Scene, id: ObjectId, exposure: f32) -> (Self, Lean) {
        let triangles = scene.triangles(id).unwrap_or(&[]);
        // In single precision, squares of areas come to an end before coordinates do.
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
        let (facing, lean) = match triangles {
            [[a, b, c]] => facing(b.as_dvec3() - a.as_dvec3(), c.as_dvec3() - a.as_dvec3()),
            _ => (ANYWHERE, ANYHOW),
        };
        (Self { area: class_of(area), facing, exposure: OPEN - below_open(exposure).min(OPEN) }, lean)
    }

    /// An area in the middle of its class.
    #[inline]
    pub(crate) fn area(self) -> f32 {
        area_of(self.area)
    }

    /// An exposure in its class.
    #[inline]
    pub(crate) fn exposure(self) -> f32 {
        open_less(OPEN - self.exposure.min(OPEN))
    }

    /// How much there is of it to be seen, in half octaves.
    pub(crate) fn rank(self) -> u32 {
        u32::from(self.area) * 4 + u32::from(self.exposure)
    }

    /// One kind for many.
    pub(crate) fn mean(kinds: impl Iterator<Item = Self> + Clone) -> Self {
        let count = kinds.clone().count().max(1);
        let area: f32 = kinds.clone().map(Self::area).sum();
        let exposure: usize = kinds.clone().map(|kind| usize::from(kind.exposure)).sum();
        let first = kinds.clone().next().map_or(ANYWHERE, |kind| kind.facing);
        let facing = if kinds.clone().all(|kind| kind.facing == first) { first } else { ANYWHERE };
        Self { area: class_of(area / count as f32), facing, exposure: (exposure / count) as u8 }
    }
}

/// The side that a triangle faces most, from two of its edges, and how far its normal leans from it.
fn facing(u: DVec3, v: DVec3) -> (u8, Lean) {
    let normal = u.cross(v);
    let size = normal.abs();
    let axis = size.max_position();
    if size[axis].is_nan() || size[axis] <= 0.0 {
        return (ANYWHERE, ANYHOW);
    }
    let side = axis as u8 * 2 + u8::from(normal[axis] < 0.0);
    let lean = size[(axis + 1) % 3].max(size[(axis + 2) % 3]) / size[axis];
    // The error of the normal is some 1e-15 of the product of lengths, so no more than 1e-8 of what is let through here.
    let known = size[axis] > 1e-7 * u.length() * v.length() && size[axis] < f64::INFINITY;
    let steps = (lean - 1e-7).max(0.0) * f64::from(LEANS);
    // Casts round towards zero.
    (side, if known { steps as u8 + u8::from(steps > f64::from(steps as u8)) } else { ANYHOW })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::facing::Toward;
    use crate::whole::{Random, Whole, cross, minus};

    #[test]
    fn classes_are_in_order_and_hold_their_middle() {
        let areas = [0.0, 1e-45, 1e-30, 0.02, 0.1, 0.3, 1.9, 2.1, 7.9, 8.1, 1e30, f32::MAX, f32::INFINITY];
        assert!(areas.windows(2).all(|pair| class_of(pair[0]) <= class_of(pair[1])));
        for area in areas {
            assert_eq!(class_of(area_of(class_of(area))), class_of(area), "{area}");
        }
        assert!(class_of(2.1) < class_of(8.1) && class_of(f32::NAN) >= class_of(f32::INFINITY));
        assert_eq!(class_of(-1.0), 0);
    }

    #[test]
    fn kinds_tell_sides_and_exposures() {
        let kind = |exposure: f32, t: [[f32; 3]; 3]| {
            let mut scene = Scene::new();
            let t = t.map(visibility_core::glam::Vec3::from_array);
            let id = scene.insert(visibility_core::Aabb::from_points(t));
            scene.set_triangles(id, [t]).unwrap();
            Kind::of_object(&scene, id, exposure).0
        };
        let up = [[0.0; 3], [1.0, 0.0, 0.2], [0.0, 1.0, -0.2]];
        assert_eq!((kind(1.0, up).facing, kind(1.0, [up[0], up[2], up[1]]).facing), (4, 5));
        assert_eq!(kind(1.0, [up[0], up[1], up[1]]).facing, ANYWHERE);
        for exposure in [1.0, 0.7, 0.5, 0.3, 0.02, 1e-4] {
            let told = kind(exposure, up).exposure();
            assert!(told <= exposure && exposure < told * 1.51, "{exposure}: {told}");
        }
        assert!(kind(0.0, up).exposure() < 1e-4 && kind(f32::NAN, up).exposure() == 1.0);
    }

    /// Triangles in a box, facing everywhere, and eyes around it: never behind what faces it.
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
            let (side, lean) = facing(b - a, c - a);
            let toward = Toward::new(visibility_core::Eye::Point(eye), &cell);
            if lean < ANYHOW && toward.is_behind(side, f32::from(lean) / LEANS) {
                assert!((b - a).cross(c - a).dot(eye - a) < 0.0, "{a} {b} {c} from {eye}: {side} {lean}");
                behind += 1;
                leaning += u32::from(lean > 4);
            }
        }
        assert!(behind > 500 && leaning > 200, "{behind} {leaning}");
    }

    /// Slivers whose normals are lost in rounding, all or in part: what is said of them is so.
    #[test]
    fn of_slivers_nothing_wrong_is_said() {
        let mut random = Random(51);
        let (mut told, mut untold) = (0, 0);
        for round in 0..40_000 {
            // Corners a, B 2^n and C 2^n, these along one line from the origin: the normal is a x (B - C), times 2^n.
            let a = random.vector(1 << 20);
            let (direction, farther) = (random.vector(1 << 10), 5 + random.whole(4));
            let scale = 2f64.powi(round % 60);
            let (b, c) = (direction.map(|x| x * 3), direction.map(|x| x * farther));
            let float = |p: Whole, scale: f64| DVec3::from_array(p.map(|x| x as f64 * scale));
            let (u, v) = (float(b, scale) - float(a, 1.0), float(c, scale) - float(a, 1.0));
            let exact = cross(a, minus(b, c));
            let (side, lean) = facing(u, v);
            if lean == ANYHOW {
                untold += 1;
                continue;
            }
            told += 1;
            let axis = usize::from(side / 2);
            let along = exact[axis] * if side % 2 == 0 { 1 } else { -1 };
            assert!(along > 0, "{u} {v}: {side}");
            for other in [(axis + 1) % 3, (axis + 2) % 3] {
                let most = (f64::from(lean) / f64::from(LEANS) + 1e-6) * along as f64;
                assert!(exact[other].abs() as f64 <= most, "{u} {v}: {side}, {lean}");
            }
        }
        assert!(told > 5_000 && untold > 5_000, "{told} {untold}");
    }
}
