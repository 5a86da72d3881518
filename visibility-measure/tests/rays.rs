//! Tests of the item buffer by rays through all pixel centres (Möller and Trumbore, "Fast, Minimum Storage
//! Ray-Triangle Intersection", 1997). Rays are made from the pose and the window, without a matrix, and are
//! limited by the distance along the viewing direction, so the test uses no code under test.

use visibility_core::glam::{DMat4, DVec3, DVec4, Vec3};
use visibility_core::{
    Pose, View,
    view::{Depth, Window},
};
use visibility_measure::{ItemBuffer, NONE};
use visibility_testing::Random;

/// Camera from which both the rays and the clip matrices of a picture are made.
pub(crate) struct Camera {
    /// Position (in metres) and axes of the camera in world space.
    pub(crate) pose: Pose,
    /// Window at distance 1 along the viewing direction (perspective) or in metres (parallel).
    pub(crate) window: Window,
    /// Distance of the near plane along the viewing direction, in metres; negative behind the eye.
    pub(crate) near: f64,
    /// Distance of the far plane along the viewing direction, in metres; may be infinite.
    pub(crate) far: f64,
    /// True if the camera is orthographic, false if it is perspective.
    pub(crate) parallel: bool,
}

impl Camera {
    /// Returns the start of the ray through a pixel's centre, and its direction. The direction's component
    /// along the viewing direction is 1, so ray parameters are distances along the viewing direction.
    pub(crate) fn ray(&self, column: usize, row: usize, width: usize, height: usize) -> (DVec3, DVec3) {
        let Window { left, right, bottom, top } = self.window;
        let x = left + (right - left) * (column as f64 + 0.5) / width as f64;
        let y = top + (bottom - top) * (row as f64 + 0.5) / height as f64;
        let across = self.pose.right * x + self.pose.up * y;
        if self.parallel {
            (self.pose.eye + across, self.pose.forward)
        } else {
            (self.pose.eye, self.pose.forward + across)
        }
    }

    /// Returns the clip matrix of the picture in the given depth convention, for points relative to the eye.
    pub(crate) fn matrix(&self, depth: Depth) -> DMat4 {
        let (n, f) = (self.near, self.far);
        // Clip z divided by w at the near and the far plane. Clip z is slope * distance + constant.
        let (at_near, at_far) = match depth {
            Depth::NegativeOneToOne | Depth::NegativeOneToOneInfinite => (-1.0, 1.0),
            Depth::ZeroToOne | Depth::ZeroToOneInfinite => (0.0, 1.0),
            Depth::Reversed | Depth::ReversedInfinite => (1.0, 0.0),
        };
        let (slope, constant) = if self.parallel {
            ((at_far - at_near) / (f - n), at_near - (at_far - at_near) / (f - n) * n)
        } else if depth.is_infinite() {
            (at_far, (at_near - at_far) * n)
        } else {
            ((at_far * f - at_near * n) / (f - n), (at_near - at_far) * n * f / (f - n))
        };
        let Window { left, right, bottom, top } = self.window;
        let (sx, sy) = (2.0 / (right - left), 2.0 / (top - bottom));
        let (cx, cy) = ((right + left) / (right - left), (top + bottom) / (top - bottom));
        // Projects from camera space (right, up, forward) to clip space.
        let project = if self.parallel {
            DMat4::from_cols(
                DVec4::X * sx,
                DVec4::Y * sy,
                DVec4::Z * slope,
                DVec4::new(-cx, -cy, constant, 1.0),
            )
        } else {
            DMat4::from_cols(
                DVec4::X * sx,
                DVec4::Y * sy,
                DVec4::new(-cx, -cy, slope, 1.0),
                DVec4::Z * constant,
            )
        };
        let Pose { right, up, forward, .. } = self.pose;
        let turn =
            DMat4::from_cols(right.extend(0.0), up.extend(0.0), forward.extend(0.0), DVec4::W).transpose();
        project * turn
    }
}

/// Intersection of a ray with the plane of a triangle.
struct Hit {
    /// Distance of the intersection from the eye along the viewing direction, in metres.
    distance: f64,
    /// Least barycentric coordinate of the point, relative to the triangle's size. Not negative inside the
    /// triangle.
    inside: f64,
}

/// Intersects a ray with the plane of a triangle. `None` for a ray parallel to the plane and a triangle
/// without area.
fn intersect(start: DVec3, direction: DVec3, triangle: &[Vec3; 3]) -> Option<Hit> {
    let [a, b, c] = triangle.map(|p| p.as_dvec3());
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let t = start - a;
    let u = t.dot(p) / determinant;
    let q = t.cross(e1);
    let v = direction.dot(q) / determinant;
    Some(Hit { distance: e2.dot(q) / determinant, inside: u.min(v).min(1.0 - u - v) })
}

/// Draws a picture, casts a ray through each pixel's centre, and asserts that the pixel shows the triangle
/// that its ray hits first. Returns the number of pixels that show a triangle, and the number of pixels that
/// were skipped, since the ray passes within 1e-9 of an edge, a clip plane or a second triangle.
fn check(camera: &Camera, view: &View, triangles: &[[Vec3; 3]], what: &str) -> (usize, usize) {
    let (width, height) = (48, 36);
    let mut buffer = ItemBuffer::new(width as u32, height as u32).unwrap();
    buffer.draw(view, DVec3::ZERO, [(0, triangles)]).unwrap();
    let (mut covered, mut close) = (0, 0);
    for row in 0..height {
        for column in 0..width {
            let (start, direction) = camera.ray(column, row, width, height);
            let mut nearest = (f64::INFINITY, NONE);
            let mut doubtful = false;
            let mut second = f64::INFINITY;
            for (i, triangle) in triangles.iter().enumerate() {
                let Some(hit) = intersect(start, direction, triangle) else { continue };
                let in_range = camera.near <= hit.distance && hit.distance <= camera.far;
                let at_an_end = [camera.near, camera.far]
                    .iter()
                    .any(|end| (hit.distance - end).abs() < 1e-9 * end.abs().max(1.0));
                if hit.inside.abs() < 1e-9 && in_range || at_an_end && hit.inside > -1e-9 {
                    doubtful |= hit.distance <= nearest.0 * (1.0 + 1e-9);
                }
                if hit.inside >= 0.0 && in_range {
                    if hit.distance < nearest.0 {
                        second = nearest.0;
                        nearest = (hit.distance, i as u32);
                    } else {
                        second = second.min(hit.distance);
                    }
                }
            }
            doubtful |= second - nearest.0 < 1e-9 * nearest.0.abs();
            let drawn = buffer.items()[row * width + column];
            covered += usize::from(drawn != NONE);
            if doubtful {
                close += 1;
            } else {
                assert_eq!(drawn, nearest.1, "{what}: column {column}, row {row}, hit at {}", nearest.0);
            }
        }
    }
    (covered, close)
}

/// Returns triangles of all sizes around the eye. Many cross the near plane or are behind the eye.
fn soup(random: &mut Random, eye: DVec3, count: usize) -> Vec<[Vec3; 3]> {
    (0..count)
        .map(|_| {
            let center = eye + random.vector(12.0);
            let size = 10f64.powf(random.range(-1.0, 1.4));
            core::array::from_fn(|_| (center + random.vector(size)).as_vec3())
        })
        .collect()
}

/// Returns a camera near the origin in a random direction, off-centre in odd rounds.
pub(crate) fn camera(random: &mut Random, round: usize, near: f64, far: f64, parallel: bool) -> Camera {
    let eye = random.vector(5.0);
    let pose = Pose::look_at(eye, eye + random.vector(1.0), DVec3::Z);
    let (w, h) = if parallel { (8.0, 6.0) } else { (0.8, 0.6) };
    // Every second camera is off-centre, as for the eyes of a headset.
    let mut window = Window::centered(w, h);
    if round % 2 == 1 {
        (window.left, window.top) = (-0.3 * w, 1.9 * h);
    }
    Camera { pose, window, near, far, parallel }
}

#[test]
fn perspective_in_all_conventions_equals_rays() {
    let mut random = Random(5);
    let (mut covered, mut close) = (0, 0);
    for round in 0..12 {
        let camera = camera(&mut random, round, 0.5, 14.0, false);
        // Every third round has only few triangles, which leave gaps.
        let triangles = soup(&mut random, camera.pose.eye, if round % 3 == 0 { 8 } else { 120 });
        let endless = Camera { far: f64::INFINITY, ..camera };
        for depth in [Depth::NegativeOneToOne, Depth::ZeroToOne, Depth::Reversed] {
            let view = View::from_clip_from_world(camera.matrix(depth), depth).unwrap();
            let view = view.relative_to(camera.pose.eye).unwrap();
            let (a, b) = check(&camera, &view, &triangles, "finite");
            (covered, close) = (covered + a, close + b);
        }
        for depth in [Depth::NegativeOneToOneInfinite, Depth::ZeroToOneInfinite, Depth::ReversedInfinite] {
            let view = View::from_clip_from_world(camera.matrix(depth), depth).unwrap();
            check(&endless, &view.relative_to(camera.pose.eye).unwrap(), &triangles, "infinite");
        }
        let Camera { pose, window, near, far, .. } = camera;
        for (camera, far) in [(&camera, far), (&endless, f64::INFINITY)] {
            let view = View::perspective_off_center(pose, window, near, far).unwrap();
            check(camera, &view, &triangles, "built");
        }
    }
    assert!(covered > 20_000 && close < 20, "{covered} pixels covered, {close} too close to call");
}

#[test]
fn orthographic_in_all_conventions_equals_rays() {
    let mut random = Random(6);
    let (mut covered, mut close) = (0, 0);
    for round in 0..12 {
        // The near plane lies behind the eye, as for shadow cameras.
        let camera = camera(&mut random, round, -3.0, 9.0, true);
        let triangles = soup(&mut random, camera.pose.eye, if round % 3 == 0 { 8 } else { 120 });
        for depth in [Depth::NegativeOneToOne, Depth::ZeroToOne, Depth::Reversed] {
            let view = View::from_clip_from_world(camera.matrix(depth), depth).unwrap();
            let view = view.relative_to(camera.pose.eye).unwrap();
            let (a, b) = check(&camera, &view, &triangles, "parallel");
            (covered, close) = (covered + a, close + b);
        }
        let Camera { pose, window, near, far, .. } = camera;
        let view = View::orthographic(pose, window, near, far).unwrap();
        check(&camera, &view, &triangles, "parallel, built");
    }
    assert!(covered > 20_000 && close < 20, "{covered} pixels covered, {close} too close to call");
}

#[test]
fn distant_depths_are_told_apart_in_every_convention() {
    // A staircase of walls from 1 m to 1e9 m, each a millionth farther and wider than the wall before. z/w in
    // [0, 1] with near = 0.01 differs by 1e-17 between the last ones, which f64 cannot resolve.
    let camera = Camera {
        pose: Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z),
        window: Window::centered(0.8, 0.6),
        near: 0.01,
        far: f64::INFINITY,
        parallel: false,
    };
    for scale in [1.0, 1e3, 1e9] {
        let strip = |i: i32| {
            let d = scale * (1.0 + f64::from(i) * 1e-6);
            let y = d * (-0.8 + 0.1 * f64::from(i + 1));
            let corner = |y: f64, z: f64| DVec3::new(d, y, z).as_vec3();
            // Asymmetric, so that the diagonal passes between pixel centres.
            let [a, b] = [corner(-d, -2.03 * d), corner(y, -2.03 * d)];
            let [c, e] = [corner(y, 2.1 * d), corner(-d, 2.1 * d)];
            [[a, b, c], [a, c, e]]
        };
        // Farthest first, so that ties of depth would change the image.
        let triangles: Vec<_> = (0..16).rev().flat_map(strip).collect();
        for depth in [Depth::NegativeOneToOneInfinite, Depth::ZeroToOneInfinite, Depth::ReversedInfinite] {
            let view = View::from_clip_from_world(camera.matrix(depth), depth).unwrap();
            let (covered, close) = check(&camera, &view, &triangles, "strips");
            assert!(covered == 48 * 36 && close == 0, "{covered} {close}");
        }
    }
}
