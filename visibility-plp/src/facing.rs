//! Which way single triangles face, coarsely: a byte each, so that most of those that turn their backs are passed over unread.
//!
//! Normals fall into bins over the sphere; a bin knows the middle of its normals and how far they stray from it. A triangle that meets a cell
//! has a point of its plane in the cell's box, and so bin and box together bound the side on which the eye lies. Where all normals of a bin
//! are one (walls and floors), two bytes more say where the plane of each triangle lies, to a 65,000th of the scene.

use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, Eye, ObjectId, Scene, Triangle};

/// Bins along each side of the six faces of a cube; odd, so that the axes lie in the middle of theirs.
const SIDE: usize = 5;

const BINS: usize = 6 * SIDE * SIDE;

/// Normals that stray no more than this are one.
const FLAT: f32 = 1e-6;

/// The code of what has no single normal.
const NONE: u8 = u8::MAX;

/// The normals in a bin: all within `spread` of `normal`.
#[derive(Clone, Copy, Debug)]
struct Bin {
    normal: [f32; 3],
    spread: f32,
}

/// The code of a triangle's bin, and how far along the normal of its flat bin it lies: so many steps, the lower byte first. Together in three
/// bytes, so that memory is asked once.
type Mark = [u8; 3];

/// The bins of all objects, by index.
#[derive(Clone, Debug, Default)]
pub(crate) struct Facing {
    marks: Vec<Mark>,
    bins: Vec<Bin>,
    /// What offset 0 stands for, and how long a step is.
    base: f64,
    step: f64,
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
    let axis = size.max_position();
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
        let mut marks = alloc::vec![[NONE, 0, 0]; scene.index_limit()];
        let mut sums = [DVec3::ZERO; BINS];
        for id in scene.ids() {
            if let Some(normal) = single(id) {
                let bin = bin_of(normal);
                marks[id.index()][0] = bin as u8;
                sums[bin] += normal;
            }
        }
        let middle = |sum: DVec3| sum.normalize_or_zero().as_vec3().to_array();
        let mut bins: Vec<Bin> = sums.map(|sum| Bin { normal: middle(sum), spread: 0.0 }).to_vec();
        for id in scene.ids() {
            if let Some(normal) = single(id) {
                let bin = &mut bins[marks[id.index()][0] as usize];
                let away = (normal - DVec3::from_array(bin.normal.map(f64::from))).length();
                bin.spread = bin.spread.max((away as f32).next_up());
            }
        }
        // What has no bin is given one that says nothing.
        bins.resize(usize::from(NONE) + 1, Bin { normal: [f32::NAN; 3], spread: f32::NAN });
        let mut facing = Self { marks, bins, ..Self::default() };
        facing.measure_offsets(scene);
        facing
    }

    fn measure_offsets(&mut self, scene: &Scene) {
        let along = |facing: &Self, id: ObjectId| {
            let bin = facing.flat(facing.marks[id.index()][0])?;
            let corner = scene.triangles(id).ok()?.first()?[0].as_dvec3();
            Some(DVec3::from_array(bin.normal.map(f64::from)).dot(corner))
        };
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for distance in scene.ids().filter_map(|id| along(self, id)) {
            (least, most) = (least.min(distance), most.max(distance));
        }
        if least > most {
            return;
        }
        let step = ((most - least) / f64::from(u16::MAX)).max(f64::MIN_POSITIVE);
        for id in scene.ids() {
            if let Some(distance) = along(self, id) {
                // Casts round towards zero.
                let [low, high] = (((distance - least) / step) as u16).to_le_bytes();
                let [_, offset @ ..] = &mut self.marks[id.index()];
                *offset = [low, high];
            }
        }
        (self.base, self.step) = (least, step);
    }

    /// The bin of a code, if all its normals are one.
    fn flat(&self, code: u8) -> Option<&Bin> {
        self.bins.get(usize::from(code)).filter(|bin| bin.spread <= FLAT)
    }

    /// What a frame has to know of the bins, by code: where the eye lies along the normal, in steps, and by how much a triangle's offset must
    /// differ from that for its side to be sure. Infinite for those that are not flat.
    pub(crate) fn planes(&self, eye: Eye, bounds: &Aabb, planes: &mut Vec<[f64; 2]>) {
        planes.clear();
        planes.resize(self.bins.len(), [0.0, f64::INFINITY]);
        let Eye::Point(eye) = eye else { return };
        let farthest = eye.length() + bounds.min.abs().max(bounds.max.abs()).as_dvec3().length();
        for (code, plane) in (0..NONE).zip(planes) {
            if let Some(bin) = self.flat(code) {
                let place = DVec3::from_array(bin.normal.map(f64::from)).dot(eye) - self.base;
                // For the triangle's normal m and corner a, m . (eye - a) is n . eye - n . a and (m - n) . (eye - a), which is no more than
                // the spread times the farthest way. But the spread is that of m as it was computed, which for slivers is known to 1e-9 and no
                // better: see `unit_normal`, which lets through no more than half of that. Products with n are rounded by 1e-15 of the way, and
                // the spread was rounded up. Steps are rounded down by up to one; the division by them keeps the order of what is divided.
                let sure = (f64::from(bin.spread) + 1e-9) * farthest / self.step + 1.0;
                *plane = [place / self.step, sure];
            }
        }
    }

    pub(crate) fn memory(&self) -> usize {
        size_of_val(&self.marks[..]) + size_of_val(&self.bins[..])
    }

    /// On which side of an object's triangle the eye lies, if the triangle meets the cell that `toward` is of. `planes` are of the same eye.
    #[inline]
    pub(crate) fn side(&self, object: usize, toward: &Toward, planes: &[[f64; 2]]) -> Side {
        let [code, offset @ ..] = self.marks.get(object).copied().unwrap_or([NONE, 0, 0]);
        if let Some(&[place, sure]) = planes.get(code as usize)
            && sure < f64::INFINITY
        {
            let before = place - f64::from(u16::from_le_bytes(offset));
            // What is not a number compares as false.
            let (front, back) = (before > sure, before < -sure);
            return if front {
                Side::Front
            } else if back {
                Side::Back
            } else {
                Side::Unknown
            };
        }
        let Some(Bin { normal: n, spread }) = self.bins.get(code as usize) else { return Side::Unknown };
        let (v, h) = (&toward.eye, &toward.half);
        let middle = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
        // For the triangle's normal m and a point q of it in the box, m . (eye - q) is the sum of n . (eye - center), n . (center - q) and
        // (m - n) . (eye - q); the last is no more than the spread times the way to the farthest point. Each f32 is rounded by 2^-24 of no
        // more than twice that way, a dozen times in all: less than 2e-6 of it.
        let reach = n[0].abs() * h[0] + n[1].abs() * h[1] + n[2].abs() * h[2];
        let reach = reach + (spread + 1e-5) * toward.farthest + f32::MIN_POSITIVE;
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
    /// How far the eye is from the farthest point of the box.
    farthest: f32,
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
        let farthest = (to_eye.abs() + half).length() as f32;
        Self { eye: to_eye.as_vec3().to_array(), half: half.as_vec3().to_array(), farthest }
    }

    /// Whether the eye lies behind all triangles that meet the box, face a side (an axis, twice, and one more if downwards), and whose
    /// normals lean from it no farther than so: the other components are no greater than that share of the one along it.
    #[inline]
    pub(crate) fn is_behind(&self, side: u8, lean: f32) -> bool {
        let axis = usize::from(side / 2) % 3;
        let others = [(axis + 1) % 3, (axis + 2) % 3];
        let along = if side & 1 == 0 { self.eye[axis] } else { -self.eye[axis] };
        let across: f32 = others.map(|other| self.eye[other].abs() + self.half[other]).iter().sum();
        // For the normal (1, s, t) and a point q of the triangle in the box, as in `Facing::side`; rounding is as there, and leaning by 1e-6
        // more is less than what is left of the margin. What is not finite compares as false.
        along + self.half[axis] + lean * across + 1e-5 * self.farthest + f32::MIN_POSITIVE < 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::whole::{Random, cross, dot, fine, minus};
    use visibility_core::Object;
    use visibility_core::glam::Vec3;

    /// Triangles facing everywhere, each through a point of the unit box, and eyes near and far: never the wrong side.
    #[test]
    fn sides_are_those_of_the_triangles() {
        let mut random = Random(7);
        let mut scene = Scene::new();
        for i in 0..6000 {
            let mut point = || DVec3::new(random.float(), random.float(), random.float()).as_vec3();
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
        let all = Aabb::from_arrays([-101.0; 3], [101.0; 3]);
        let (mut counts, mut planes) = ([0; 3], Vec::new());
        for eye in [[1.1, 0.2, 0.3], [3.0, 4.0, -2.0], [-50.0, 30.0, 1.7], [900.0, 1.0, 800.0], [0.1; 3]] {
            let toward = Toward::new(Eye::Point(DVec3::from_array(eye)), &cell);
            facing.planes(Eye::Point(DVec3::from_array(eye)), &all, &mut planes);
            for id in scene.ids() {
                let [a, b, c] = scene.triangles(id).unwrap()[0].map(|p| p.as_dvec3());
                let distance = (b - a).cross(c - a).dot(DVec3::from_array(eye) - a);
                let side = facing.side(id.index(), &toward, &planes);
                match side {
                    Side::Front => assert!(distance > 0.0, "{id}: {distance}"),
                    Side::Back => assert!(distance < 0.0, "{id}: {distance}"),
                    Side::Unknown => (),
                }
                counts[side as usize] += 1;
            }
        }
        assert!(counts[0] > 4000 && counts[1] > 4000, "{counts:?}");
        assert_eq!(
            facing.side(usize::MAX, &Toward::new(Eye::Direction(DVec3::X), &cell), &planes),
            Side::Unknown
        );
    }

    /// Floors and walls of which many lie within a step, and eyes in their planes and just beside them: never the wrong side, and mostly sure.
    #[test]
    fn sides_of_flat_bins_are_those_of_the_triangles() {
        let mut scene = Scene::new();
        for i in 0..4000u32 {
            let at = (i / 2) as f32 * 0.0007 - 0.3;
            let (u, v) = if i % 2 == 0 { (Vec3::X, Vec3::Y) } else { (Vec3::Y, Vec3::X) };
            let q = Vec3::Z * if i < 3990 { at } else { 500.0 - i as f32 * 0.25 };
            let id = scene.insert(Object::new(Aabb::from_points([q, q + u, q + v])));
            scene.set_triangles(id, [[q, q + u, q + v]]).unwrap();
        }
        let (facing, mut planes) = (Facing::new(&scene), Vec::new());
        let cell = Aabb::from_arrays([-600.0; 3], [600.0; 3]);
        let (mut sure, mut all) = (0, 0);
        for step in 0..200 {
            for beside in [0.0, 1e-9, -1e-9, 0.003, -0.003] {
                let eye = DVec3::new(0.3, 0.2, f64::from(step as f32 * 10.0 * 0.0007 - 0.3) + beside);
                facing.planes(Eye::Point(eye), &cell, &mut planes);
                let toward = Toward::new(Eye::Point(eye), &cell);
                for id in scene.ids() {
                    let [a, b, c] = scene.triangles(id).unwrap()[0].map(|p| p.as_dvec3());
                    let distance = (b - a).cross(c - a).dot(eye - a);
                    match facing.side(id.index(), &toward, &planes) {
                        Side::Front => assert!(distance > 0.0, "{id}: {distance}"),
                        Side::Back => assert!(distance < 0.0, "{id}: {distance}"),
                        Side::Unknown => all += 1,
                    }
                    sure += 1;
                }
            }
        }
        assert!(all * 30 < sure, "{all} of {sure} unknown");
    }

    /// Two triangles in a bin, as far from its middle as each other, in the corner of a small box, and eyes far away in their planes and just beside
    /// them: there the bound is as tight as it gets, and numbers of 24 bits are too coarse for it.
    #[test]
    fn eyes_far_away_beside_a_plane_are_not_on_its_wrong_side() {
        let mut random = Random(61);
        let (mut told, mut planes) = (0, Vec::new());
        let all = Aabb::from_arrays([-1500.0; 3], [1500.0; 3]);
        for round in 0..2000 {
            let normal = random.direction();
            // So much that they are two normals, or so little that they are one.
            let lean = if round % 2 == 0 { 3e-6 } else { 5e-7 } * (1.0 + 0.5 * random.float());
            let lean = normal.any_orthonormal_vector() * lean;
            let mut scene = Scene::new();
            for m in [normal + lean, normal - lean].map(DVec3::normalize) {
                // Large, so that its normal is known to ten digits, and about the origin.
                let (u, v) = m.any_orthonormal_pair();
                let t = [u * 1e3, v * 1e3, -(u + v) * 1e3].map(|p| p.as_vec3());
                let id = scene.insert(Object::new(Aabb::from_points(t)));
                scene.set_triangles(id, [t]).unwrap();
            }
            let facing = Facing::new(&scene);
            for id in scene.ids() {
                let triangle = scene.triangles(id).unwrap()[0];
                let (Some(m), bin) =
                    (unit_normal(&triangle), facing.bins[facing.marks[id.index()][0] as usize])
                else {
                    continue;
                };
                let n = DVec3::from_array(bin.normal.map(f64::from));
                if bin.spread == 0.0 || (bin.spread <= FLAT) != (round % 2 == 1) {
                    // Not in one bin.
                    continue;
                }
                let away = (m - n).normalize() * 1000.0;
                let q = triangle[0].as_dvec3() / 3.0
                    + triangle[1].as_dvec3() / 3.0
                    + triangle[2].as_dvec3() / 3.0;
                for (sign, corner) in [(1.0, -1.0), (-1.0, 1.0)] {
                    // A box whose corner, towards the normal or against it, is a point of the triangle.
                    let half = Vec3::splat(0.001);
                    let center = q.as_vec3() - n.as_vec3().signum() * half * corner;
                    let cell = Aabb::new(center - half, center + half);
                    let eye = q + away * sign;
                    let eye = eye - m * (m.dot(eye - q) - sign * 1e-7);
                    facing.planes(Eye::Point(eye), &all, &mut planes);
                    let side = facing.side(id.index(), &Toward::new(Eye::Point(eye), &cell), &planes);
                    assert_ne!(side, if sign > 0.0 { Side::Back } else { Side::Front }, "{triangle:?} {eye}");
                    told += 1;
                }
            }
        }
        assert!(told > 2000, "{told}");
    }

    /// Slivers, of whose normals rounding leaves ten digits or so, and eyes far away, where the true normal strays the most from the bin's: before the
    /// plane or behind it by a hair, never on the wrong side. How far the computed normal strays is too little to go by.
    #[test]
    fn eyes_far_away_beside_slivers_are_not_on_their_wrong_side() {
        let mut random = Random(63);
        let (mut told, mut wrong_without, mut planes) = (0, 0, Vec::new());
        for _ in 0..30_000 {
            // In units of 2^-30. The first corner is about the origin and in finer steps than the others, so that products of edges have more digits
            // than f64. The last is so near to the middle of the others that the triangle is just let through, or just not.
            let (a, b) = (random.vector(1 << 14), random.vector(1 << 22));
            let beside = random.vector(4);
            let c = [0, 1, 2].map(|i| (b[i] / 2 + beside[i]) << 14);
            let b = b.map(|x| x << 14);
            let triangle = [a, b, c].map(|p| fine(p).as_vec3());
            if unit_normal(&triangle).is_none() {
                continue;
            }
            // No more than one in the scene: steps are as small as they get, and being unsure by one of them helps nobody.
            let mut scene = Scene::new();
            let bounds = Aabb::from_points(triangle);
            let id = scene.insert(Object::new(bounds));
            scene.set_triangles(id, [triangle]).unwrap();
            let facing = Facing::new(&scene);
            let code = facing.marks[id.index()][0];
            let bin = facing.flat(code).unwrap();
            let n = DVec3::from_array(bin.normal.map(f64::from));
            let exact = cross(minus(b, a), minus(c, a));
            let m = DVec3::from_array(exact.map(|x| x as f64)).normalize();
            // In the plane, and in it as much along `m - n` as may be.
            let away = (m - n).reject_from_normalized(m).normalize_or_zero() * 2f64.powi(52);
            for sign in [1.0, -1.0] {
                let way = away * sign;
                let way = (way - m * (m.dot(way) - sign * 64.0)).to_array();
                let eye = [0, 1, 2].map(|i| a[i] + way[i] as i64);
                // The hair is more than what is rounded here.
                let before = dot(exact, minus(eye, a));
                assert!(if sign > 0.0 { before > 0 } else { before < 0 });
                let eye = fine(eye);
                facing.planes(Eye::Point(eye), &bounds, &mut planes);
                let side = facing.side(id.index(), &Toward::new(Eye::Point(eye), &bounds), &planes);
                assert_ne!(side, if sign > 0.0 { Side::Back } else { Side::Front }, "{triangle:?} {eye}");
                let [place, sure] = planes[usize::from(code)];
                assert!(place.is_finite() && sure.is_finite());
                let farthest = eye.length() + bounds.min.abs().max(bounds.max.abs()).as_dvec3().length();
                wrong_without += u32::from(place * sign < -(f64::from(bin.spread) * farthest / facing.step));
                told += 1;
            }
        }
        assert!(told > 5000 && wrong_without > 100, "{wrong_without} of {told} wrong without a margin");
    }

    /// The same of all that lean one way no farther than so.
    #[test]
    fn eyes_far_away_are_not_behind_what_faces_them() {
        let mut random = Random(62);
        let mut wrong_without = 0;
        for round in 0..20_000 {
            let (side, axis) = ((round % 6) as u8, round % 6 / 2);
            let lean = (round / 6 % 15) as f32 / 14.0;
            let mut normal = [0.0; 3];
            normal[axis] = if side % 2 == 0 { 1.0 } else { -1.0 };
            let across = (axis + 1 + round % 2) % 3;
            normal[across] = f64::from(lean) * if random.float() < 0.0 { 1.0 } else { -1.0 };
            let normal = DVec3::from_array(normal);
            // Flat where the normal has no part, so that no more is given away there.
            let mut half = random.direction().abs().as_vec3() * 0.01;
            half[3 - axis - across] = 0.0;
            let center = random.direction().as_vec3();
            let cell = Aabb::new(center - half, center + half);
            let (min, max) = (cell.min.as_dvec3(), cell.max.as_dvec3());
            let q = DVec3::select(normal.cmpgt(DVec3::ZERO), min, max);
            // In the plane through that corner, but for what rounding does and a hair.
            let mut eye = (min + max) * 0.5;
            eye[across] += normal[across].signum() * 1000.0 * random.float().abs();
            eye[axis] = q[axis] - (normal[across] * (eye[across] - q[across]) - 1e-7) / normal[axis];
            assert!(normal.dot(eye - q) > 0.0);
            let toward = Toward::new(Eye::Point(eye), &cell);
            assert!(!toward.is_behind(side, lean), "{side} {lean} {cell:?} {eye}");
            let bare = Toward { farthest: 0.0, ..toward };
            wrong_without += u32::from(bare.is_behind(side, lean));
        }
        assert!(wrong_without > 100, "{wrong_without}");
    }

    #[test]
    fn what_cannot_be_told_is_unknown() {
        let mut scene = Scene::new();
        let flat = [Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
        let odd = [Vec3::NAN, Vec3::X, Vec3::Y];
        let huge = [Vec3::ZERO, Vec3::X * 3e38, Vec3::Y * 3e38];
        let sides = |scene: &Scene, object, eye: f64| {
            let cell = Aabb::from_arrays([0.0; 3], [eye as f32; 3]);
            let (facing, eye, mut planes) = (Facing::new(scene), Eye::Point(DVec3::splat(eye)), Vec::new());
            facing.planes(eye, &cell, &mut planes);
            facing.side(object, &Toward::new(eye, &cell), &planes)
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
