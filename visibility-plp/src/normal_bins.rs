//! Facing directions of single-triangle objects in three bytes each, so that most back faces are skipped
//! without reading their corners.
//!
//! Unit normals are sorted into bins over the sphere. A bin stores the mean direction of its normals and
//! their greatest distance from that mean. A triangle that meets a cell has a point of its plane in the
//! cell's box, so the bin and the box together bound the side of the plane on which the eye lies. If all
//! normals of a bin agree (walls and floors), two more bytes per triangle store the plane's offset along that
//! normal, in steps of 1/65,535 of the range of all such offsets in the scene.

use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, ObjectId, Scene, scene::Triangle, view::Eye};

/// Number of bins along each edge of the six faces of a cube around the sphere of unit normals. Odd, so that
/// each axis direction lies in the middle of a bin.
const BINS_PER_EDGE: usize = 5;

/// Number of bins that normals are sorted into.
const BINS: usize = 6 * BINS_PER_EDGE * BINS_PER_EDGE;

/// Maximum spread (distance between unit vectors) of a flat bin, whose normals are treated as one normal.
const FLAT: f32 = 1e-6;

/// Bin number of objects that do not have exactly one triangle, or whose triangle has no reliable normal.
const NO_BIN: u8 = u8::MAX;

/// Bounds of the unit normals in one bin: each is within the Euclidean distance `spread` of `normal`.
/// `normal` and `spread` are NaN in the bin with number [`NO_BIN`].
#[derive(Clone, Copy, Debug)]
struct NormalBin {
    normal: [f32; 3],
    spread: f32,
}

/// One object's normal bin and plane offset. The first byte is the bin's number. The other two are the offset
/// of the triangle's plane along the normal of a flat bin, in steps of [`NormalBins::step`], low byte first;
/// 0 in other bins. Three bytes in one array, so that a look-up misses the cache at most once.
type Mark = [u8; 3];

/// Facing directions of all single-triangle objects of a scene, as of the time of construction.
#[derive(Clone, Debug, Default)]
pub(crate) struct NormalBins {
    /// Bin number and plane offset (in steps) of each object, indexed by object index.
    marks: Vec<Mark>,
    /// Normal bins, indexed by bin number up to [`NO_BIN`].
    bins: Vec<NormalBin>,
    /// Plane offset along a flat bin's normal that the stored step 0 stands for, in metres from the scene's
    /// origin.
    base: f64,
    /// Length in metres of the steps in which plane offsets are stored.
    step: f64,
}

/// Side of a triangle's plane on which the eye lies. `Front`: the eye is certainly on the side from which the
/// corners run anticlockwise. `Back`: certainly on the opposite side. `Unknown`: undecided, counts as
/// visible.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum EyeSide {
    Front,
    Back,
    Unknown,
}

/// Returns the unit normal of a triangle. `None` if rounding could change the normal by more than 1e-9, as
/// for degenerate triangles, slivers and NaN.
fn unit_normal(triangle: &Triangle) -> Option<DVec3> {
    let [a, b, c] = triangle.map(|p| p.as_dvec3());
    let (u, v) = (b - a, c - a);
    let normal = u.cross(v);
    // The cross product's error is about 1e-15 times the product of the edge lengths, so at most 1e-9 of the
    // lengths accepted here.
    let length = normal.length();
    (length > 1e-6 * u.length() * v.length()).then(|| normal / length)
}

/// Returns the bin number of a unit normal, 0 to `BINS` - 1.
fn bin_of(normal: DVec3) -> usize {
    let size = normal.abs();
    let axis = size.max_position();
    let step = |other: usize| {
        let place = normal[(axis + other) % 3] / size[axis];
        (((place + 1.0) * (0.5 * BINS_PER_EDGE as f64)) as usize).min(BINS_PER_EDGE - 1)
    };
    ((axis * 2 + usize::from(normal[axis] < 0.0)) * BINS_PER_EDGE + step(1)) * BINS_PER_EDGE + step(2)
}

impl NormalBins {
    /// Sorts the normals of all objects of one triangle into bins. Other objects get [`NO_BIN`]. O(n) in the
    /// number of objects.
    pub(crate) fn new(scene: &Scene) -> Self {
        let single = |id| match scene.triangles(id) {
            Ok(triangles) if triangles.len() == 1 && triangles.has_certain_fronts() => {
                unit_normal(&triangles.first()?)
            }
            _ => None,
        };
        let mut marks = alloc::vec![[NO_BIN, 0, 0]; scene.index_limit()];
        let mut sums = [DVec3::ZERO; BINS];
        for id in scene.ids() {
            if let Some(normal) = single(id) {
                let bin = bin_of(normal);
                marks[id.index()][0] = bin as u8;
                sums[bin] += normal;
            }
        }
        let middle = |sum: DVec3| sum.normalize_or_zero().as_vec3().to_array();
        let mut bins: Vec<NormalBin> =
            sums.map(|sum| NormalBin { normal: middle(sum), spread: 0.0 }).to_vec();
        for id in scene.ids() {
            if let Some(normal) = single(id) {
                let bin = &mut bins[marks[id.index()][0] as usize];
                let away = (normal - DVec3::from_array(bin.normal.map(f64::from))).length();
                bin.spread = bin.spread.max(away as f32);
            }
        }
        bins.resize(usize::from(NO_BIN) + 1, NormalBin { normal: [f32::NAN; 3], spread: f32::NAN });
        let mut made = Self { marks, bins, ..Self::default() };
        made.measure_offsets(scene);
        made
    }

    /// Computes the plane offsets of all objects in flat bins (bins of one normal), and the fields `base` and
    /// `step`.
    fn measure_offsets(&mut self, scene: &Scene) {
        let along = |bins: &Self, id: ObjectId| {
            let bin = bins.flat_bin(bins.marks[id.index()][0])?;
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

    /// Returns the bin with a number if the bin is flat, that is, its normals agree up to [`FLAT`]. `None`
    /// otherwise and for an unknown number.
    fn flat_bin(&self, number: u8) -> Option<&NormalBin> {
        self.bins.get(usize::from(number)).filter(|bin| bin.spread <= FLAT)
    }

    /// Replaces `offsets` by one pair for each bin, for one frame. The first number is the eye's offset along
    /// the bin's normal, in steps. The second is the minimum difference, in steps, between the eye's and a
    /// triangle's offset that makes the eye's side certain. Bins that are not flat and all bins of a parallel
    /// view get infinity. `eye` and `bounds`, the box around all triangles, are relative to the scene's
    /// origin; `eye_error` is a bound on the error of the eye in metres.
    pub(crate) fn eye_offsets(&self, eye: Eye, eye_error: f64, bounds: &Aabb, offsets: &mut Vec<[f64; 2]>) {
        offsets.clear();
        offsets.resize(self.bins.len(), [0.0, f64::INFINITY]);
        let Eye::Point(eye) = eye else { return };
        let farthest = eye.length() + bounds.min.abs().max(bounds.max.abs()).as_dvec3().length();
        for (number, of_bin) in (0..NO_BIN).zip(offsets) {
            if let Some(bin) = self.flat_bin(number) {
                let offset = DVec3::from_array(bin.normal.map(f64::from)).dot(eye) - self.base;
                // Let m be the triangle's normal and a its corner. Then m . (eye - a) is the sum of n . eye -
                // n . a and (m - n) . (eye - a). The second term is at most the spread times the greatest
                // distance. The spread is that of the computed m, which for slivers has an error of up to
                // 1e-9: see `unit_normal`, which accepts at most half of that. Products with n are rounded by
                // 1e-15 of the distance, and the spread by 2^-24 of at most `FLAT`. Offsets in steps are
                // rounded down by up to one step; the division by the step preserves order. An eye off by its
                // error changes the offset by at most as much, and the second term by less than a thousandth
                // of that.
                let sure = ((f64::from(bin.spread) + 1e-9) * farthest + 1.001 * eye_error) / self.step + 1.0;
                *of_bin = [offset / self.step, sure];
            }
        }
    }

    /// Returns the heap memory of the bins and of the objects' bin numbers in bytes, without spare capacity.
    pub(crate) fn memory(&self) -> usize {
        size_of_val(&self.marks[..]) + size_of_val(&self.bins[..])
    }

    /// Returns the side of an object's triangle on which the eye lies. `object` is the object's index. `cell`
    /// is the box, relative to the eye, of a cell that the triangle meets. `offsets` comes from
    /// [`eye_offsets`](Self::eye_offsets) for the same eye. [`EyeSide::Unknown`] for an unknown object and
    /// for an object without a bin.
    #[inline]
    pub(crate) fn eye_side(&self, object: usize, cell: &BoxFromEye, offsets: &[[f64; 2]]) -> EyeSide {
        let [number, offset @ ..] = self.marks.get(object).copied().unwrap_or([NO_BIN, 0, 0]);
        if let Some(&[eye_offset, sure]) = offsets.get(number as usize)
            && sure < f64::INFINITY
        {
            let before = eye_offset - f64::from(u16::from_le_bytes(offset));
            // Comparisons with NaN are false.
            let (front, back) = (before > sure, before < -sure);
            return if front {
                EyeSide::Front
            } else if back {
                EyeSide::Back
            } else {
                EyeSide::Unknown
            };
        }
        let Some(NormalBin { normal: n, spread }) = self.bins.get(number as usize) else {
            return EyeSide::Unknown;
        };
        let (v, h) = (&cell.to_eye, &cell.half);
        let middle = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
        // Let m be the triangle's normal and q a point of the triangle in the box. Then m . (eye - q) is the
        // sum of n . (eye - center), n . (center - q) and (m - n) . (eye - q). The last term is at most the
        // spread, which is rounded by 2^-24, times the distance from the eye to the farthest point of the
        // box. A dozen f32 operations are
        // each rounded by 2^-24 of at most twice that distance: less than 2e-6 of the distance in all.
        let reach = n[0].abs() * h[0] + n[1].abs() * h[1] + n[2].abs() * h[2];
        let reach = reach + (spread + 1e-5) * cell.farthest + f32::MIN_POSITIVE;
        // Comparisons with NaN are false.
        if middle + reach < 0.0 {
            EyeSide::Back
        } else if middle - reach > 0.0 {
            EyeSide::Front
        } else {
            EyeSide::Unknown
        }
    }
}

/// Box of a cell relative to the eye, for tests whether triangles in the box face away.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoxFromEye {
    /// Vector from the box's centre to the eye, in metres. For a parallel view, the unit vector opposite to
    /// the viewing direction.
    to_eye: [f32; 3],
    /// Half the box's size along each axis, in metres, plus the error of the eye: each difference of the
    /// eye and a point of the box is within `half` of `to_eye`. The error alone for a parallel view.
    half: [f32; 3],
    /// Distance in metres from the eye to the farthest point of the box. 1 for a parallel view.
    farthest: f32,
}

impl BoxFromEye {
    #[inline]
    /// Converts the scene-relative box `bounds` to a box relative to `eye`, which is relative to the scene's
    /// origin as well. `eye_error` bounds the error of each coordinate of the eye in metres, or of each
    /// component of the direction; if it is infinite or NaN, nothing is certain.
    pub(crate) fn new(eye: Eye, eye_error: f64, bounds: &Aabb) -> Self {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (to_eye, half) = match eye {
            Eye::Point(eye) => (eye - (min + max) * 0.5, (max - min) * 0.5),
            // The vector to an eye at infinity is equal for all points of the box.
            Eye::Direction(along) => (-along, DVec3::ZERO),
        };
        let half = half + DVec3::splat(eye_error);
        let farthest = (to_eye.abs() + half).length() as f32;
        Self { to_eye: to_eye.as_vec3().to_array(), half: half.as_vec3().to_array(), farthest }
    }

    /// Tests whether the eye is certainly behind every triangle that meets the box and faces an axis side
    /// with a bounded lean. `side` is twice the axis, plus one towards negative coordinates. `lean` bounds
    /// the normals: no component across the axis exceeds `lean` times the component along the axis. False if
    /// undecided and for NaN.
    #[inline]
    pub(crate) fn is_behind(&self, side: u8, lean: f32) -> bool {
        let axis = usize::from(side / 2) % 3;
        let others = [(axis + 1) % 3, (axis + 2) % 3];
        let along = if side & 1 == 0 { self.to_eye[axis] } else { -self.to_eye[axis] };
        let across: f32 = others.map(|other| self.to_eye[other].abs() + self.half[other]).iter().sum();
        // The bound of `NormalBins::eye_side` for the normal (1, s, t) and a point q of the triangle in the
        // box. The rounding is as derived there. An error of 1e-6 in the lean is less than the rest of the
        // margin. Comparisons with NaN are false.
        along + self.half[axis] + lean * across + 1e-5 * self.farthest + f32::MIN_POSITIVE < 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_exact::{Random, RandomExact, cross, dot, fine, minus};
    use visibility_core::Object;
    use visibility_core::glam::{DAffine3, Vec3};
    use visibility_core::scene::SharedTriangles;

    /// Triangles of all directions, each through a point of a box, and near and far eyes: a front or back
    /// reported by `eye_side` never contradicts the exact side.
    #[test]
    fn sides_are_those_of_the_triangles() {
        let mut random = Random(7);
        let mut scene = Scene::new();
        for i in 0..6000 {
            let mut point = || DVec3::new(random.float(), random.float(), random.float()).as_vec3();
            let (q, u, v) = (point(), point(), point());
            let triangle = match i % 3 {
                // Successive rounds test: all corners in the box; one corner of a large triangle in the box;
                // the normal almost along an axis.
                0 => [q, u, v],
                1 => [q, q + u * 100.0, q + v * 100.0],
                _ => [q, q + Vec3::new(u.x, u.y, u.z * 1e-3), q + Vec3::new(v.x, v.y, v.z * 1e-3)],
            };
            let id = scene.insert(Object::new(Aabb::from_points(triangle)));
            scene.set_triangles(id, [triangle]).unwrap();
        }
        let bins = NormalBins::new(&scene);
        let cell = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
        let all = Aabb::from_arrays([-101.0; 3], [101.0; 3]);
        let (mut counts, mut offsets) = ([0; 3], Vec::new());
        for eye in [[1.1, 0.2, 0.3], [3.0, 4.0, -2.0], [-50.0, 30.0, 1.7], [900.0, 1.0, 800.0], [0.1; 3]] {
            let toward = BoxFromEye::new(Eye::Point(DVec3::from_array(eye)), 0.0, &cell);
            bins.eye_offsets(Eye::Point(DVec3::from_array(eye)), 0.0, &all, &mut offsets);
            for id in scene.ids() {
                let [a, b, c] = scene.triangles(id).unwrap().get(0).unwrap().map(|p| p.as_dvec3());
                let distance = (b - a).cross(c - a).dot(DVec3::from_array(eye) - a);
                let side = bins.eye_side(id.index(), &toward, &offsets);
                match side {
                    EyeSide::Front => assert!(distance > 0.0, "{id}: {distance}"),
                    EyeSide::Back => assert!(distance < 0.0, "{id}: {distance}"),
                    EyeSide::Unknown => (),
                }
                counts[side as usize] += 1;
            }
        }
        assert!(counts[0] > 4000 && counts[1] > 4000, "{counts:?}");
        assert_eq!(
            bins.eye_side(usize::MAX, &BoxFromEye::new(Eye::Direction(DVec3::X), 0.0, &cell), &offsets),
            EyeSide::Unknown,
            "an object that does not exist"
        );
    }

    /// Axis-aligned floors, many of them within one offset step of each other, and eyes in or just beside
    /// their planes: `eye_side` never reports the wrong side, and `Unknown` for fewer than one in thirty.
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
        let (bins, mut offsets) = (NormalBins::new(&scene), Vec::new());
        let cell = Aabb::from_arrays([-600.0; 3], [600.0; 3]);
        let (mut sure, mut all) = (0, 0);
        for step in 0..200 {
            for beside in [0.0, 1e-9, -1e-9, 0.003, -0.003] {
                let eye = DVec3::new(0.3, 0.2, f64::from(step as f32 * 10.0 * 0.0007 - 0.3) + beside);
                bins.eye_offsets(Eye::Point(eye), 0.0, &cell, &mut offsets);
                let toward = BoxFromEye::new(Eye::Point(eye), 0.0, &cell);
                for id in scene.ids() {
                    let [a, b, c] = scene.triangles(id).unwrap().get(0).unwrap().map(|p| p.as_dvec3());
                    let distance = (b - a).cross(c - a).dot(eye - a);
                    match bins.eye_side(id.index(), &toward, &offsets) {
                        EyeSide::Front => assert!(distance > 0.0, "{id}: {distance}"),
                        EyeSide::Back => assert!(distance < 0.0, "{id}: {distance}"),
                        EyeSide::Unknown => all += 1,
                    }
                    sure += 1;
                }
            }
        }
        assert!(all * 30 < sure, "{all} of {sure} unknown");
    }

    /// Tests that a bin never reports an eye to be behind its triangles' planes unless the eye is. The case
    /// is the hardest for rounding: two triangles in a bin, equally far from its mean normal, each with a
    /// point in a corner of a small box, and distant eyes in or just beside the triangles' planes.
    #[test]
    fn eyes_far_away_beside_a_plane_are_not_on_its_wrong_side() {
        let mut random = Random(61);
        let (mut told, mut offsets) = (0, Vec::new());
        let all = Aabb::from_arrays([-1500.0; 3], [1500.0; 3]);
        for round in 0..2000 {
            let normal = random.direction();
            // Rounds alternate between normals far enough apart for a bin that is not flat, and close enough
            // for a flat bin.
            let lean = if round % 2 == 0 { 3e-6 } else { 5e-7 } * (1.0 + 0.5 * random.float());
            let lean = normal.any_orthonormal_vector() * lean;
            let mut scene = Scene::new();
            for m in [normal + lean, normal - lean].map(DVec3::normalize) {
                // A large triangle around the origin, so that its normal is known to ten digits.
                let (u, v) = m.any_orthonormal_pair();
                let t = [u * 1e3, v * 1e3, -(u + v) * 1e3].map(|p| p.as_vec3());
                let id = scene.insert(Object::new(Aabb::from_points(t)));
                scene.set_triangles(id, [t]).unwrap();
            }
            let bins = NormalBins::new(&scene);
            for id in scene.ids() {
                let triangle = scene.triangles(id).unwrap().get(0).unwrap();
                let (Some(m), bin) = (unit_normal(&triangle), bins.bins[bins.marks[id.index()][0] as usize])
                else {
                    continue;
                };
                let n = DVec3::from_array(bin.normal.map(f64::from));
                if bin.spread == 0.0 || (bin.spread <= FLAT) != (round % 2 == 1) {
                    // The round is skipped, since the two normals fell into different bins.
                    continue;
                }
                let away = (m - n).normalize() * 1000.0;
                let q = triangle[0].as_dvec3() / 3.0
                    + triangle[1].as_dvec3() / 3.0
                    + triangle[2].as_dvec3() / 3.0;
                for (sign, corner) in [(1.0, -1.0), (-1.0, 1.0)] {
                    // One corner of the box is at a point of the triangle: the corner farthest along the
                    // normal, or the opposite one.
                    let half = Vec3::splat(0.001);
                    let center = q.as_vec3() - n.as_vec3().signum() * half * corner;
                    let cell = Aabb::new(center - half, center + half);
                    let eye = q + away * sign;
                    let eye = eye - m * (m.dot(eye - q) - sign * 1e-7);
                    bins.eye_offsets(Eye::Point(eye), 0.0, &all, &mut offsets);
                    let side =
                        bins.eye_side(id.index(), &BoxFromEye::new(Eye::Point(eye), 0.0, &cell), &offsets);
                    assert_ne!(
                        side,
                        if sign > 0.0 { EyeSide::Back } else { EyeSide::Front },
                        "{triangle:?} {eye}"
                    );
                    told += 1;
                }
            }
        }
        assert!(told > 2000, "{told}");
    }

    /// Slivers whose normals keep about ten digits after rounding, and distant eyes in the direction in which
    /// the true normal differs most from the bin's. Each eye lies just before or just behind the plane, and
    /// the wrong side is never reported. The spread of the computed normals alone would be too small a
    /// margin.
    #[test]
    fn eyes_far_away_beside_slivers_are_not_on_their_wrong_side() {
        let mut random = Random(63);
        let (mut told, mut wrong_without, mut offsets) = (0, 0, Vec::new());
        for _ in 0..30_000 {
            // Coordinates are in units of 2^-30. The first corner is near the origin and in finer steps than
            // the others, so that products of edges have more digits than f64. The last corner is so close to
            // the middle of the others that `unit_normal` just accepts or just rejects the triangle.
            let (a, b) = (random.integers(1 << 14), random.integers(1 << 22));
            let beside = random.integers(4);
            let c = [0, 1, 2].map(|i| (b[i] / 2 + beside[i]) << 14);
            let b = b.map(|x| x << 14);
            let triangle = [a, b, c].map(|p| fine(p).as_vec3());
            if unit_normal(&triangle).is_none() {
                continue;
            }
            // One triangle per scene, so that offset steps are as small as possible and the tolerance of one
            // step does not hide errors.
            let mut scene = Scene::new();
            let bounds = Aabb::from_points(triangle);
            let id = scene.insert(Object::new(bounds));
            scene.set_triangles(id, [triangle]).unwrap();
            let bins = NormalBins::new(&scene);
            let code = bins.marks[id.index()][0];
            let bin = bins.flat_bin(code).unwrap();
            let n = DVec3::from_array(bin.normal.map(f64::from));
            let exact = cross(minus(b, a), minus(c, a));
            let m = DVec3::from_array(exact.map(|x| x as f64)).normalize();
            // A direction in the plane, as close to the direction of `m - n` as possible.
            let away = (m - n).reject_from_normalized(m).normalize_or_zero() * 2f64.powi(52);
            for sign in [1.0, -1.0] {
                let way = away * sign;
                let way = (way - m * (m.dot(way) - sign * 64.0)).to_array();
                let eye = [0, 1, 2].map(|i| a[i] + way[i] as i64);
                // The eye's distance from the plane exceeds the rounding of its coordinates.
                let before = dot(exact, minus(eye, a));
                assert!(
                    if sign > 0.0 { before > 0 } else { before < 0 },
                    "the eye {eye:?} is {before} before the plane, with the sign {sign}"
                );
                let eye = fine(eye);
                bins.eye_offsets(Eye::Point(eye), 0.0, &bounds, &mut offsets);
                let side =
                    bins.eye_side(id.index(), &BoxFromEye::new(Eye::Point(eye), 0.0, &bounds), &offsets);
                assert_ne!(
                    side,
                    if sign > 0.0 { EyeSide::Back } else { EyeSide::Front },
                    "{triangle:?} {eye}"
                );
                let [place, sure] = offsets[usize::from(code)];
                assert!(
                    place.is_finite() && sure.is_finite(),
                    "{triangle:?}: the offset {place} and its bound {sure} are finite"
                );
                let farthest = eye.length() + bounds.min.abs().max(bounds.max.abs()).as_dvec3().length();
                wrong_without += u32::from(place * sign < -(f64::from(bin.spread) * farthest / bins.step));
                told += 1;
            }
        }
        assert!(told > 5000 && wrong_without > 100, "{wrong_without} of {told} wrong without a margin");
    }

    /// Triangles whose normals lean from an axis by exactly the given bound, and distant eyes just in front
    /// of a triangle through a corner of the box: `is_behind` is never true, although it would be without its
    /// rounding margin.
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
            // The box is flat along the axis in which the normal has no component, so that the bound has no
            // slack there.
            let mut half = random.direction().abs().as_vec3() * 0.01;
            half[3 - axis - across] = 0.0;
            let center = random.direction().as_vec3();
            let cell = Aabb::new(center - half, center + half);
            let (min, max) = (cell.min.as_dvec3(), cell.max.as_dvec3());
            let q = DVec3::select(normal.cmpgt(DVec3::ZERO), min, max);
            // The eye is before the plane through the corner `q`, by 1e-7 up to rounding.
            let mut eye = (min + max) * 0.5;
            eye[across] += normal[across].signum() * 1000.0 * random.float().abs();
            eye[axis] = q[axis] - (normal[across] * (eye[across] - q[across]) - 1e-7) / normal[axis];
            assert!(normal.dot(eye - q) > 0.0, "the eye {eye} is before the plane");
            let toward = BoxFromEye::new(Eye::Point(eye), 0.0, &cell);
            assert!(!toward.is_behind(side, lean), "{side} {lean} {cell:?} {eye}");
            let bare = BoxFromEye { farthest: 0.0, ..toward };
            wrong_without += u32::from(bare.is_behind(side, lean));
        }
        assert!(wrong_without > 100, "{wrong_without}");
    }

    /// Eyes 1 m behind and before two triangles, or parallel views from either side: the side is known only
    /// if the error of the eye, or of the direction, is less.
    #[test]
    fn the_error_of_the_eye_leaves_its_side_unknown() {
        let mut scene = Scene::new();
        for lean in [0.02, -0.02] {
            let triangle = [Vec3::ZERO, Vec3::new(1.0, 0.0, lean), Vec3::Y];
            let id = scene.insert(Object::new(Aabb::from_points(triangle)));
            scene.set_triangles(id, [triangle]).unwrap();
        }
        let (bins, cell) = (NormalBins::new(&scene), Aabb::from_arrays([0.0; 3], [0.01; 3]));
        assert!(bins.flat_bin(bins.marks[0][0]).is_none(), "the bin of both triangles is not flat");
        for (z, side) in [(-1.0, EyeSide::Back), (1.0, EyeSide::Front)] {
            for eye in [Eye::Point(DVec3::Z * z), Eye::Direction(DVec3::Z * -z)] {
                for error in [0.0, 0.4, 1.5, f64::INFINITY, f64::NAN] {
                    let mut offsets = Vec::new();
                    bins.eye_offsets(eye, error, &cell, &mut offsets);
                    let toward = BoxFromEye::new(eye, error, &cell);
                    let told = bins.eye_side(0, &toward, &offsets);
                    let expected = if error < 1.0 { side } else { EyeSide::Unknown };
                    assert_eq!(told, expected, "{eye:?}, {error} m off");
                    let is_behind = error < 1.0 && side == EyeSide::Back;
                    assert_eq!(toward.is_behind(4, 0.02), is_behind, "{eye:?}, {error} m off: faces up");
                }
            }
        }
    }

    /// Two floors, and eyes 1 m below or above one of them: the side is known only if the error of the eye is
    /// less, which offsets of planes in steps of less than 0.1 mm do not hide.
    #[test]
    fn the_error_of_the_eye_leaves_its_side_of_floors_unknown() {
        let mut scene = Scene::new();
        for z in [0.0, 5.0] {
            let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + Vec3::Z * z);
            let id = scene.insert(Object::new(Aabb::from_points(triangle)));
            scene.set_triangles(id, [triangle]).unwrap();
        }
        let bins = NormalBins::new(&scene);
        assert!(bins.flat_bin(bins.marks[0][0]).is_some(), "the bin of both floors is flat");
        let mut offsets = Vec::new();
        for (z, side) in [(-1.0, EyeSide::Back), (1.0, EyeSide::Front)] {
            let eye = Eye::Point(DVec3::Z * z);
            for error in [0.0, 0.4, 1.5] {
                // The far end of the bounds counts on either side of the origin.
                for bounds in [[[0.0; 3], [5.0; 3]], [[-5.0; 3], [0.0; 3]]] {
                    let bounds = Aabb::from_arrays(bounds[0], bounds[1]);
                    bins.eye_offsets(eye, error, &bounds, &mut offsets);
                    let [_, sure] = offsets[usize::from(bins.marks[0][0])];
                    let least = 0.99e-9 * (1.0 + 5.0 * 3f64.sqrt()) / bins.step + 1.0;
                    assert!(sure >= least, "{bounds:?}: sure from {sure} steps of {least}");
                    let told = bins.eye_side(0, &BoxFromEye::new(eye, error, &bounds), &offsets);
                    let expected = if error < 1.0 { side } else { EyeSide::Unknown };
                    assert_eq!(told, expected, "{eye:?}, {error} m off, {bounds:?}");
                }
            }
        }
    }

    /// Slivers from those that have a normal to those that have none: a normal is right to nine digits.
    #[test]
    fn normals_of_slivers_are_right_or_missing() {
        let mut random = Random(64);
        let (mut found, mut missing) = (0, 0);
        for round in 0..30_000 {
            let a = random.integers(1 << 14);
            let b = random.integers(1 << 22);
            let beside = random.integers(1 << (1 + round % 6));
            let c = [0, 1, 2].map(|i| (b[i] / 2 + beside[i]) << 14);
            let b = b.map(|x| x << 14);
            let exact = cross(minus(b, a), minus(c, a));
            let exact = DVec3::from_array(exact.map(|x| x as f64)).normalize_or_zero();
            match unit_normal(&[a, b, c].map(|p| fine(p).as_vec3())) {
                Some(normal) => {
                    let off = (normal - exact).length();
                    assert!(off < 1e-9, "{a:?} {b:?} {c:?}: the normal is off by {off}");
                    found += 1;
                }
                None => missing += 1,
            }
        }
        assert!(found > 5_000 && missing > 500, "{found} {missing}");
    }

    /// A triangle that rounding may have mirrored has no certain front.
    #[test]
    fn triangles_without_a_certain_front_have_no_side() {
        let is_without_bin = |scale: f64| {
            let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
            let mut scene = Scene::new();
            let id = scene.insert(Object::new(Aabb::from_arrays([0.0; 3], [1.0; 3])));
            let placed = DAffine3::from_scale(DVec3::new(1.0, 1.0, scale));
            scene.set_triangles(id, SharedTriangles::from([triangle]).placed(placed)).unwrap();
            let bins = NormalBins::new(&scene);
            bins.marks[id.index()][0] == NO_BIN
        };
        assert!(
            !is_without_bin(1.0) && is_without_bin(0.0),
            "a triangle placed as it is, and one that may be mirrored"
        );
    }

    #[test]
    fn what_cannot_be_told_is_unknown() {
        let mut scene = Scene::new();
        let flat = [Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
        let odd = [Vec3::NAN, Vec3::X, Vec3::Y];
        let huge = [Vec3::ZERO, Vec3::X * 3e38, Vec3::Y * 3e38];
        let sides = |scene: &Scene, object, eye: f64| {
            let cell = Aabb::from_arrays([0.0; 3], [eye as f32; 3]);
            let (bins, eye, mut offsets) =
                (NormalBins::new(scene), Eye::Point(DVec3::splat(eye)), Vec::new());
            bins.eye_offsets(eye, 0.0, &cell, &mut offsets);
            bins.eye_side(object, &BoxFromEye::new(eye, 0.0, &cell), &offsets)
        };
        for triangles in [&[flat][..], &[odd], &[huge, huge]] {
            let id = scene.insert(Aabb::from_arrays([0.0; 3], [3e38; 3]));
            scene.set_triangles(id, triangles).unwrap();
            for eye in [0.0, 1.0, 1e30, 3e38, f64::INFINITY, f64::NAN] {
                assert_eq!(sides(&scene, id.index(), eye), EyeSide::Unknown, "{triangles:?} from {eye}");
            }
        }
    }
}
