//! Cameras of all depth conventions and scales, points near their planes, and an oracle in exact arithmetic
//! that tells whether a camera sees a point.
//!
//! The oracle takes only the names of the depth conventions from the crate under test. It decides in clip
//! space, directly from the elements of the matrix, by [`sign_of_sum`].

use crate::Random;
use crate::exact::sign_of_sum;
use visibility_core::glam::{DMat4, DQuat, DVec3, DVec4};
use visibility_core::{Aabb, Pose, View, view::Depth};

/// All six depth conventions.
pub const DEPTHS: [Depth; 6] = [
    Depth::NegativeOneToOne,
    Depth::NegativeOneToOneInfinite,
    Depth::ZeroToOne,
    Depth::ZeroToOneInfinite,
    Depth::Reversed,
    Depth::ReversedInfinite,
];

/// Returns the view of frame `frame` of a walk that circles around the origin at 30 metres and looks around.
pub fn circling(frame: usize) -> View {
    let angle = frame as f64 * 0.07;
    let eye = DVec3::new(angle.sin(), 0.0, 1.0) * 30.0;
    let pose = Pose::look_at(eye, eye + DVec3::new(angle.cos(), angle.sin(), 0.1), DVec3::Z);
    View::perspective(pose, 1.0, 1.6, 0.1, f64::INFINITY).expect("a usual view")
}

/// Returns `2^exponent`.
pub fn power_of_two(exponent: i32) -> f64 {
    2.0f64.powi(exponent)
}

/// Returns the clip-space planes of a depth convention: left, right, bottom, top, near, far; no far plane for
/// an infinite convention. A plane is a list of (matrix row, sign) pairs, and its signed distance is the sum
/// of the signed rows. A point is in view if no distance is negative.
pub fn clip_planes(depth: Depth) -> Vec<Vec<(usize, f64)>> {
    let sides = [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)].map(|row| vec![(3, 1.0), row]);
    let (minus_w, zero, w) = (vec![(3, 1.0), (2, 1.0)], vec![(2, 1.0)], vec![(3, 1.0), (2, -1.0)]);
    let ends = match depth {
        Depth::NegativeOneToOne => vec![minus_w, w],
        Depth::NegativeOneToOneInfinite => vec![minus_w],
        Depth::ZeroToOne => vec![zero, w],
        Depth::ZeroToOneInfinite => vec![zero],
        Depth::Reversed => vec![w, zero],
        Depth::ReversedInfinite => vec![w],
    };
    sides.into_iter().chain(ends).collect()
}

/// Clip matrix with its depth convention, and the origins that the matrix and the scene are relative to.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Clip matrix, column-major, for positions in metres relative to `origin`.
    pub matrix: [f64; 16],
    /// Depth convention of the matrix.
    pub depth: Depth,
    /// Origin of the matrix: a point of the world, in metres.
    pub origin: DVec3,
    /// Origin of the scene's coordinates: a point of the world, in metres.
    pub scene_origin: DVec3,
}

impl Camera {
    /// Makes a camera whose matrix and scene are both relative to the origin of the world.
    pub fn new(matrix: [f64; 16], depth: Depth) -> Self {
        Self { matrix, depth, origin: DVec3::ZERO, scene_origin: DVec3::ZERO }
    }

    /// Returns the clip matrix rounded to `f32`, column-major.
    pub fn matrix_f32(&self) -> [f32; 16] {
        self.matrix.map(|x| x as f32)
    }

    /// Tests exactly whether a point is in view, boundary included. `p` is relative to the scene's origin.
    pub fn sees(&self, p: DVec3) -> bool {
        clip_planes(self.depth).iter().all(|plane| self.side(plane, p) >= 0)
    }

    /// Returns the exact sign of a point's distance from a plane of [`clip_planes`]: 1 inside, 0 on the
    /// plane, -1 outside. `p` is relative to the scene's origin.
    pub fn side(&self, plane: &[(usize, f64)], p: DVec3) -> i32 {
        let parts = [p, self.scene_origin, -self.origin];
        sign_of_sum(plane.iter().flat_map(|&(row, sign)| {
            let moved =
                (0..3).flat_map(move |c| parts.map(|part| (sign * self.matrix[4 * c + row], part[c])));
            moved.chain([(sign * self.matrix[12 + row], 1.0)])
        }))
    }

    /// Tests exactly whether any corner of a box is in view, boundary included. `bounds` is relative to the
    /// scene's origin.
    pub fn sees_a_corner(&self, bounds: &Aabb) -> bool {
        bounds.corners().iter().any(|corner| self.sees(corner.as_dvec3()))
    }

    /// Returns the normal and offset of a plane of [`clip_planes`], relative to the scene's origin, rounded
    /// and not normalised. Suitable for choosing points near the plane, and for distances well above
    /// rounding.
    pub fn coefficients(&self, plane: &[(usize, f64)]) -> (DVec3, f64) {
        let sum = |column: usize| plane.iter().map(|&(row, sign)| sign * self.matrix[4 * column + row]).sum();
        let n = DVec3::new(sum(0), sum(1), sum(2));
        let shift = self.scene_origin - self.origin;
        let sum_w: f64 = sum(3);
        (n, n.x * shift.x + n.y * shift.y + n.z * shift.z + sum_w)
    }

    /// Returns how far a box lies outside of a plane (the one that it is farthest outside of), in units of
    /// the error bound that the frustum culler documents at `TestPlane`. The bound is the sum of `2^-21`
    /// times the magnitudes of the terms of the distance, `2^-125` times the sum of the coordinates,
    /// `2^-122`, and the error of the plane's offset. Above 1, the box is outside by more than that error. 0
    /// if the box is outside of no plane. `bounds` is relative to the scene's origin.
    pub fn error_bounds_outside(&self, bounds: &Aabb) -> f64 {
        let mut worst: f64 = 0.0;
        for plane in clip_planes(self.depth) {
            let (n, d) = self.coefficients(&plane);
            // Scaled by a power of two first, since squares could overflow.
            let scale = n.abs().max_element();
            let (n, d) = (n / scale, d / scale);
            let length = n.length();
            let (n, d) = (n / length, d / length);
            let far = DVec3::select(n.cmpge(DVec3::ZERO), bounds.max.as_dvec3(), bounds.min.as_dvec3());
            let size = n.abs().dot(far.abs()) + d.abs();
            let shift = (self.scene_origin - self.origin).abs();
            let offset_error = 8.0 * f64::EPSILON * (n.abs().dot(shift) + d.abs() + n.abs().dot(shift));
            let error = power_of_two(-21) * size
                + power_of_two(-125) * far.abs().element_sum()
                + power_of_two(-122)
                + offset_error;
            worst = worst.max(-(n.dot(far) + d) / error);
        }
        worst
    }
}

/// Returns a projection matrix in the given depth convention, from camera space (x right, y up, z forward) to
/// clip space. `window` is left, right, bottom, top: at distance 1 for perspective, in metres if `parallel`.
/// `near` and `far` are distances along z; `far` is ignored by infinite conventions.
pub fn projection(depth: Depth, window: [f64; 4], near: f64, far: f64, parallel: bool) -> DMat4 {
    let [left, right, bottom, top] = window;
    let (width, height) = (right - left, top - bottom);
    let (cx, cy) = ((right + left) / width, (top + bottom) / height);
    // Clip z divided by w at the near and at the far plane.
    let (at_near, at_far) = match depth {
        Depth::NegativeOneToOne | Depth::NegativeOneToOneInfinite => (-1.0, 1.0),
        Depth::ZeroToOne | Depth::ZeroToOneInfinite => (0.0, 1.0),
        Depth::Reversed | Depth::ReversedInfinite => (1.0, 0.0),
    };
    let rows = if parallel {
        let slope = (at_far - at_near) / (far - near);
        [
            DVec4::new(2.0 / width, 0.0, 0.0, -cx),
            DVec4::new(0.0, 2.0 / height, 0.0, -cy),
            DVec4::new(0.0, 0.0, slope, at_near - slope * near),
            DVec4::W,
        ]
    } else {
        // a z + b is w times the depth: `at_near * near` at the near plane, and correspondingly at the far
        // plane.
        let a = if depth.is_infinite() { at_far } else { (at_far * far - at_near * near) / (far - near) };
        let b = (at_near - a) * near;
        [
            DVec4::new(2.0 / width, 0.0, -cx, 0.0),
            DVec4::new(0.0, 2.0 / height, -cy, 0.0),
            DVec4::new(0.0, 0.0, a, b),
            DVec4::Z,
        ]
    };
    DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose()
}

/// Returns the clip matrix of a random camera. Each coordinate of the eye is within `reach` metres of 0. The
/// orientation is random. Perspective or, for finite conventions, parallel; off-centre in half of the calls.
pub fn random_projection(rng: &mut Random, depth: Depth, reach: f64) -> DMat4 {
    let turn =
        DQuat::from_xyzw(rng.unit() - 0.5, rng.unit() - 0.5, rng.unit() - 0.5, rng.unit() + 0.01).normalize();
    let look = DMat4::from_quat(turn) * DMat4::from_translation(rng.vector(reach));
    let size = rng.range(0.05, 2.0);
    let (dx, dy) =
        if rng.one_in(2) { (0.0, 0.0) } else { (rng.range(-2.0, 2.0) * size, rng.range(-2.0, 2.0) * size) };
    let window = [dx - size, dx + size, dy - size * 0.6, dy + size * 0.6];
    // An infinite far plane exists in perspective views only.
    let parallel = !depth.is_infinite() && rng.one_in(3);
    let near = if parallel { rng.range(-2.0, 1.0) } else { power_of_two(rng.between(-10, 0)) };
    projection(depth, window, near, near + power_of_two(rng.between(-3, 10)), parallel) * look
}

/// Returns a random camera that sees coordinates of about `2^exponents[i]` on axis i, and its clip matrix
/// before the scaling by the exponents and rounding to `f32`.
pub fn random_camera(rng: &mut Random, exponents: [i32; 3]) -> (Camera, DMat4) {
    let depth = rng.pick(&DEPTHS);
    let base = match rng.below(4) {
        // A random matrix, since any matrix is a valid camera.
        0 => DMat4::from_cols_array(&core::array::from_fn(|_| rng.range(-1.0, 1.0))),
        // A camera with its eye exactly at the origin, so that planes have no offset.
        1 => random_projection(rng, depth, 0.0),
        _ => random_projection(rng, depth, 3.0),
    };
    let uniform = (exponents.iter().max().unwrap() + exponents.iter().min().unwrap()) / 2 / 2;
    let uniform = power_of_two(uniform + rng.between(-3, 3));
    let shrink = exponents.map(|e| power_of_two(-e));
    let scaled = base * DMat4::from_scale(DVec3::from_array(shrink)) * uniform;
    let matrix = scaled.to_cols_array().map(|x| f64::from(x as f32));
    (Camera::new(matrix, depth), base)
}

/// Returns a point within a few units in the last place of one plane of a camera, and that plane's normal and
/// offset from [`Camera::coefficients`]. The point is relative to the scene's origin. `base` is the camera's
/// matrix before the scaling by `exponents`, both as for [`random_camera`]. `None` if the point is infinite
/// or far from the scale of `exponents`.
pub fn aimed_point(
    rng: &mut Random,
    camera: &Camera,
    base: &DMat4,
    exponents: [i32; 3],
) -> Option<([f32; 3], DVec3, f64)> {
    let planes = clip_planes(camera.depth);
    let which = rng.below(planes.len());
    let (least_depth, sign) = match camera.depth {
        Depth::NegativeOneToOne | Depth::NegativeOneToOneInfinite => (-1.0, 1.0),
        Depth::ZeroToOne | Depth::ZeroToOneInfinite => (0.0, 1.0),
        Depth::Reversed | Depth::ReversedInfinite => (0.0, -1.0),
    };
    let mut clip =
        DVec4::new(rng.range(-0.99, 0.99), rng.range(-0.99, 0.99), rng.range(least_depth + 0.01, 0.99), 1.0);
    match which {
        0..4 => clip[which / 2] = [-1.0, 1.0][which % 2],
        _ => clip.z = if (which == 4) == (sign > 0.0) { least_depth } else { 1.0 },
    }
    let world = base.inverse() * clip;
    let scale = DVec3::from_array(exponents.map(power_of_two));
    let mut p = (world.truncate() / world.w * scale + (camera.origin - camera.scene_origin)).as_vec3();
    let (n, d) = camera.coefficients(&planes[which]);
    let q = p.as_dvec3();
    // Moves the coordinate with the greatest influence on the distance, or a random one.
    let say = (n * q).abs();
    let axis = match rng.below(2) {
        0 => rng.below(3),
        _ => (0..3).max_by(|&a, &b| say[a].total_cmp(&say[b])).unwrap(),
    };
    if n[axis] != 0.0 {
        let others: f64 = (0..3).filter(|&i| i != axis).map(|i| n[i] * q[i]).sum();
        let mut x = (-(others + d) / n[axis]) as f32;
        for _ in 0..rng.below(4) {
            x = if n[axis] > 0.0 { x.next_up() } else { x.next_down() };
        }
        p[axis] = x;
    }
    // Points with infinite coordinates are refused, and points far from the target scale, which inverting the
    // matrix may give.
    (p.is_finite() && (p.as_dvec3() / scale).abs().max_element() < 1e7).then(|| (p.to_array(), n, d))
}

/// Returns a random box with corner `p`, all of whose points are at most as far as `p` along `n`, the inward
/// normal of a plane. The size on axis i is at most `2^exponents[i]`; some boxes are flat on some or all
/// axes. If the box would be infinite, it is only the point `p`.
pub fn box_behind(rng: &mut Random, p: [f32; 3], n: DVec3, exponents: [i32; 3]) -> Aabb {
    let (mut min, mut max) = (p, p);
    let flat = rng.one_in(4);
    for axis in 0..3 {
        let size = (power_of_two(exponents[axis] - rng.between(0, 20)) * rng.unit()) as f32;
        if flat || rng.one_in(8) {
            continue;
        }
        let away = if n[axis] == 0.0 { rng.one_in(2) } else { n[axis] > 0.0 };
        if away { min[axis] -= size } else { max[axis] += size }
    }
    let bounds = Aabb::from_arrays(min, max);
    if bounds.is_finite() { bounds } else { Aabb::from_arrays(p, p) }
}
