//! Which way single triangles face, coarsely: a byte each, so that most of those that turn their backs are passed over unread.
//!
//! Normals fall into bins over the sphere; a bin knows the middle of its normals and how far they stray from it. A triangle that meets a cell
//! has a point of its plane in the cell's box, and so bin and box together bound the side on which the eye lies.

use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, Eye, Scene, Triangle};

/// Bins along each side of the six faces of a cube; odd, so that the axes lie in the middle of theirs.
const SIDE: usize = 5;

const BINS: usize = 6 * SIDE * SIDE;

/// The code of what has no single normal.
const NONE: u8 = u8::MAX;

/// The normals in a bin: all within `spread` of `normal`.
#[derive(Clone, Copy, Debug)]
struct Bin {
    normal: [f32; 3],
    spread: f32,
}

/// The bins of all objects, by index.
#[derive(Clone, Debug, Default)]
pub(crate) struct Facing {
    codes: Vec<u8>,
    bins: Vec<Bin>,
}

/// What is known of a triangle in a cell.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Side {
    Front,
    Back,
    Unknown,
}

/// The unit normal of a triangle; none where rounding has a say in it.
fn unit_normal(triangle: &Triangle) -> Option<DVec3> {
    let [a, b, c] = triangle.map(|p| p.as_dvec3());
    let (u, v) = (b - a, c - a);
    let normal = u.cross(v);
    // Its error is some 1e-15 of the product of lengths, so no more than 1e-9 of what is let through here.
    let length = normal.length();
    (length > 1e-6 * u.length() * v.length() && length.is_finite()).then(|| normal / length)
}

fn bin_of(normal: DVec3) -> usize {
    let size = normal.abs();
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    let step = |other: usize| {
        let place = normal[(axis + other) % 3] / size[axis];
        (((place + 1.0) * (0.5 * SIDE as f64)) as usize).min(SIDE - 1)
    };
    ((axis * 2 + usize::from(normal[axis] < 0.0)) * SIDE + step(1)) * SIDE + step(2)
}

impl Facing {
    pub(crate) fn new(scene: &Scene) -> Self {
        let single = |id| match scene.triangles(id) {
            Ok([triangle]) => unit_normal(triangle),
            _ => None,
        };
        let mut codes = alloc::vec![NONE; scene.index_limit()];
        let mut sums = [DVec3::ZERO; BINS];
        for id in scene.ids() {
            if let Some(normal) = single(id) {
                let bin = bin_of(normal);
                codes[id.index()] = bin as u8;
                sums[bin] += normal;
            }
        }
        let middle = |sum: DVec3| sum.normalize_or_zero().as_vec3().to_array();
        let mut bins: Vec<Bin> = sums.map(|sum| Bin { normal: middle(sum), spread: 0.0 }).to_vec();
        for id in scene.ids() {
            if let Some(normal) = single(id) {
                let bin = &mut bins[codes[id.index()] as usize];
                let away = (normal - DVec3::from_array(bin.normal.map(f64::from))).length();
                bin.spread = bin.spread.max((away as f32).next_up());
            }
        }
        Self { codes, bins }
    }

    pub(crate) fn memory(&self) -> usize {
        size_of_val(&self.codes[..]) + size_of_val(&self.bins[..])
    }

    /// On which side of an object's triangle the eye lies, if the triangle meets the cell that `toward` is of.
    #[inline]
    pub(crate) fn side(&self, object: usize, toward: &Toward) -> Side {
        let code = self.codes.get(object).copied().unwrap_or(NONE);
        let Some(Bin { normal: n, spread }) = self.bins.get(code as usize) else { return Side::Unknown };
        let (v, h) = (&toward.eye, &toward.half);
        let middle = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
        // For the triangle's normal m and a point q of it in the box, m . (eye - q) is n . (eye - center), and the three of (m - n) . (eye - center),
        // n . (center - q) and (m - n) . (center - q); the first and last are no more than the spread times both lengths. Each f32 is rounded
        // by 2^-24 of no more than both lengths, a dozen times in all: less than 1e-6 of them.
        let reach = n[0].abs() * h[0] + n[1].abs() * h[1] + n[2].abs() * h[2];
        let reach = reach + (spread + 1e-5) * toward.lengths + f32::MIN_POSITIVE;
        // What is not finite compares as false.
        if middle + reach < 0.0 {
            Side::Back
        } else if middle - reach > 0.0 {
            Side::Front
        } else {
            Side::Unknown
        }
    }
}

/// A cell's box as seen from the eye.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Toward {
    /// From the centre of the box to the eye.
    eye: [f32; 3],
    half: [f32; 3],
    /// How long these two are together.
    lengths: f32,
}

impl Toward {
    #[inline]
    pub(crate) fn new(eye: Eye, bounds: &Aabb) -> Self {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (to_eye, half) = match eye {
            Eye::Point(eye) => (eye - (min + max) * 0.5, (max - min) * 0.5),
            // The same for all points of the box.
            Eye::Direction(along) => (-along, DVec3::ZERO),
        };
        let lengths = (to_eye.length() + half.length()) as f32;
        Self { eye: to_eye.as_vec3().to_array(), half: half.as_vec3().to_array(), lengths }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Object;
    use visibility_core::glam::Vec3;

    /// Triangles facing everywhere, each through a point of the unit box, and eyes near and far: never the wrong side.
    #[test]
    fn sides_are_those_of_the_triangles() {
        let mut state = 7u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 23) as f32 - 1.0
        };
        let mut scene = Scene::new();
        for i in 0..6000 {
            let mut point = || Vec3::new(random(), random(), random());
            let (q, u, v) = (point(), point(), point());
            let triangle = match i % 3 {
                // Corners in the box; a corner alone, of a large one; nearly along an axis.
                0 => [q, u, v],
                1 => [q, q + u * 100.0, q + v * 100.0],
                _ => [q, q + Vec3::new(u.x, u.y, u.z * 1e-3), q + Vec3::new(v.x, v.y, v.z * 1e-3)],
            };
            let id = scene.insert(Object::new(Aabb::from_points(triangle)));
            scene.set_triangles(id, [triangle]).unwrap();
        }
        let facing = Facing::new(&scene);
        let cell = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
        let mut counts = [0; 3];
        for eye in [[1.1, 0.2, 0.3], [3.0, 4.0, -2.0], [-50.0, 30.0, 1.7], [900.0, 1.0, 800.0], [0.1; 3]] {
            let toward = Toward::new(Eye::Point(DVec3::from_array(eye)), &cell);
            for id in scene.ids() {
                let [a, b, c] = scene.triangles(id).unwrap()[0].map(|p| p.as_dvec3());
                let distance = (b - a).cross(c - a).dot(DVec3::from_array(eye) - a);
                let side = facing.side(id.index(), &toward);
                match side {
                    Side::Front => assert!(distance > 0.0, "{id}: {distance}"),
                    Side::Back => assert!(distance < 0.0, "{id}: {distance}"),
                    Side::Unknown => (),
                }
                counts[side as usize] += 1;
            }
        }
        assert!(counts[0] > 4000 && counts[1] > 4000, "{counts:?}");
        assert_eq!(facing.side(usize::MAX, &Toward::new(Eye::Direction(DVec3::X), &cell)), Side::Unknown);
    }

    #[test]
    fn what_cannot_be_told_is_unknown() {
        let mut scene = Scene::new();
        let flat = [Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
        let odd = [Vec3::NAN, Vec3::X, Vec3::Y];
        let huge = [Vec3::ZERO, Vec3::X * 3e38, Vec3::Y * 3e38];
        let sides = |scene: &Scene, object, eye: f64| {
            let cell = Aabb::from_arrays([0.0; 3], [eye as f32; 3]);
            Facing::new(scene).side(object, &Toward::new(Eye::Point(DVec3::splat(eye)), &cell))
        };
        for triangles in [&[flat][..], &[odd], &[huge, huge]] {
            let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
            scene.set_triangles(id, triangles).unwrap();
            for eye in [0.0, 1.0, 1e30, 3e38, f64::INFINITY, f64::NAN] {
                assert_eq!(sides(&scene, id.index(), eye), Side::Unknown);
            }
        }
    }
}
