//! Tests of where view rays begin, against rays followed in exact integer arithmetic.
//!
//! The camera's rows, eye and clip planes are whole numbers, so the first point of each view ray in the view
//! is a fraction of whole numbers. It is found without rounding and without any code of the crate except the
//! names of the depth conventions.

use visibility_core::glam::{DMat4, DVec3, DVec4};
use visibility_core::{View, geometry::Plane, view::Depth};
use visibility_testing::cameras::{DEPTHS, power_of_two};
use visibility_testing::{Random, judged, told_enough};

type Whole = [i128; 3];

fn dot(a: Whole, b: Whole) -> i128 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Whole, b: Whole) -> Whole {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn to_f64(a: Whole) -> DVec3 {
    DVec3::from_array(a.map(|x| x as f64))
}

/// A half-space of whole numbers: the points `p` with `normal . (p - eye) + constant >= 0`.
#[derive(Clone, Copy, Debug)]
struct Row {
    normal: Whole,
    constant: i128,
}

/// A camera with whole-number coefficients. For a parallel camera, `eye` is an arbitrary point and `w` is
/// constant.
#[derive(Clone, Debug)]
struct Camera {
    eye: Whole,
    x: Row,
    y: Row,
    w: Row,
    near: Row,
    clips: Vec<Row>,
    depth: Depth,
    /// Power of two by which all rows of the clip matrix are multiplied.
    scale: f64,
}

/// The view ray through NDC point `(a, b) / 8`: its direction, and a point on it relative to the eye, times
/// `whole`.
struct Line {
    direction: Whole,
    start: Whole,
    whole: i128,
}

fn random_whole(rng: &mut Random, most: i32) -> Whole {
    core::array::from_fn(|_| i128::from(rng.between(-most, most)))
}

impl Camera {
    fn random(rng: &mut Random) -> Self {
        let parallel = rng.one_in(4);
        let row = |normal, constant| Row { normal, constant };
        let far_off = rng.pick(&[0, 10, 1000, 1_000_000_000]);
        let eye = random_whole(rng, far_off);
        let w = if parallel {
            row([0; 3], i128::from(rng.between(1, 30)))
        } else {
            row(random_whole(rng, 20), 0)
        };
        let (x, y) = (row(random_whole(rng, 20), 0), row(random_whole(rng, 20), 0));
        let off = |rng: &mut Random| if parallel { i128::from(rng.between(-20, 20)) } else { 0 };
        let (x, y) = (row(x.normal, off(rng)), row(y.normal, off(rng)));
        let near = match rng.below(4) {
            // An ordinary near plane, parallel to the picture.
            0 | 1 if !parallel => {
                let times = i128::from(rng.between(1, 9));
                row(w.normal.map(|n| n * times), -i128::from(rng.between(1, 60)))
            }
            // An oblique near plane, as for mirrors; the eye may be on either side.
            2 => row(random_whole(rng, 20), i128::from(rng.between(-20, 2))),
            // A near plane that is slightly oblique.
            _ => {
                let turn = random_whole(rng, 3);
                let normal = core::array::from_fn(|i| 9 * w.normal[i] + turn[i]);
                row(normal, -i128::from(rng.between(1, 60)))
            }
        };
        let mut camera = Self { eye, x, y, w, near, clips: Vec::new(), depth: rng.pick(&DEPTHS), scale: 1.0 };
        camera.scale = power_of_two(rng.between(-40, 40));
        for _ in 0..rng.pick(&[0, 0, 0, 1, 2]) {
            let grazed = camera.line(rng.pick(&[-8, 8]), rng.pick(&[-8, 8]));
            let clip = match (rng.below(4), grazed) {
                (0, _) => row(random_whole(rng, 20), i128::from(rng.between(-30, 30))),
                // A clip plane that keeps one edge of the picture on the near plane, and little else.
                (1, _) => {
                    let (side, sign) = (rng.pick(&[camera.x, camera.y]), rng.pick(&[-1, 1]));
                    let (more, most) = (i128::from(rng.between(1, 5)), i128::from(rng.between(1, 5)));
                    let sum = |side: i128, w: i128, near: i128| most * (sign * side - w) + more * near;
                    let normal = core::array::from_fn(|i| {
                        sum(side.normal[i], camera.w.normal[i], camera.near.normal[i])
                    });
                    row(normal, sum(side.constant, camera.w.constant, camera.near.constant))
                }
                // A clip plane less than the rounding error in front of the eye, or across a parallel view. A
                // corner of the picture meets the plane far away.
                (2, Some(line)) if far_off == 0 => {
                    let (across, turn) = (cross(line.direction, random_whole(rng, 9)), random_whole(rng, 3));
                    // Scales the normal to the largest whole numbers that `f64` holds exactly.
                    let most = across.iter().fold(1, |most: i128, n| most.max(n.abs()));
                    let times = (1i128 << 51) / most;
                    row(core::array::from_fn(|i| across[i] * times + turn[i]), -1)
                }
                // A clip plane through the eye.
                _ => row(random_whole(rng, 20), 0),
            };
            if clip.normal != [0; 3] {
                camera.clips.push(clip);
            }
        }
        camera
    }

    fn is_parallel(&self) -> bool {
        self.w.normal == [0; 3]
    }

    fn view(&self) -> Option<View> {
        let plus = |a: Row, b: Row, times: i128| Row {
            normal: core::array::from_fn(|i| a.normal[i] + times * b.normal[i]),
            constant: a.constant + times * b.constant,
        };
        // The depth row that gives this near plane. The far plane follows from it and is arbitrary.
        let z = match self.depth {
            Depth::NegativeOneToOne | Depth::NegativeOneToOneInfinite => plus(self.near, self.w, -1),
            Depth::ZeroToOne | Depth::ZeroToOneInfinite => self.near,
            Depth::Reversed | Depth::ReversedInfinite => {
                plus(self.w, Row { normal: self.near.normal.map(|n| -n), constant: -self.near.constant }, 1)
            }
        };
        let rows = [self.x, self.y, z, self.w].map(|row| {
            let normal = to_f64(row.normal) * self.scale;
            normal.extend((row.constant - dot(row.normal, self.eye)) as f64 * self.scale)
        });
        let matrix = DMat4::from_cols_array_2d(&rows.map(|row: DVec4| row.to_array())).transpose();
        let view = View::from_clip_from_world(matrix, self.depth).ok()?;
        let clips: Vec<Plane> = self
            .clips
            .iter()
            .map(|row| Plane::new(to_f64(row.normal), (row.constant - dot(row.normal, self.eye)) as f64))
            .collect();
        view.with_clip_planes(&clips).ok()
    }

    /// Returns the view ray through NDC point `(a, b) / 8`, with `a` and `b` from -8 to 8. `None` if the ray
    /// is not defined.
    fn line(&self, a: i128, b: i128) -> Option<Line> {
        let (x, y, w) = (self.x.normal, self.y.normal, self.w.normal);
        if self.is_parallel() {
            // The ray runs along the edge in which the side planes meet, in the sense that crosses the near
            // plane inwards.
            let along = cross(x, y);
            let inwards = dot(along, self.near.normal).signum();
            let square = dot(along, along);
            // 8 (x . p + cx) = a w: the point with this property in the plane perpendicular to the ray.
            let (u, v) =
                (a * self.w.constant - 8 * self.x.constant, b * self.w.constant - 8 * self.y.constant);
            let (p, q) = (cross(y, along), cross(along, x));
            let start = core::array::from_fn(|i| u * p[i] + v * q[i]);
            return (inwards != 0).then(|| Line {
                direction: along.map(|n| n * inwards),
                start,
                whole: 8 * square,
            });
        }
        let (yw, wx, xy) = (cross(y, w), cross(w, x), cross(x, y));
        let determinant = dot(x, yw);
        let sum: Whole = core::array::from_fn(|i| a * yw[i] + b * wx[i] + 8 * xy[i]);
        (determinant != 0).then(|| Line {
            direction: sum.map(|n| n * determinant.signum()),
            start: [0; 3],
            whole: 1,
        })
    }

    /// Returns the first point of a view ray that is inside the near plane and all clip planes, relative to
    /// the eye. `None` if there is no such point, or if a parallel ray is inside from infinity on.
    fn first(&self, line: &Line) -> Option<DVec3> {
        // At parameter t of the ray, the value of a plane is (whole * constant + normal . start) / whole + t
        // (normal . direction).
        let mut first = if self.is_parallel() { None } else { Some((0, 1)) };
        let mut last: Option<(i128, i128)> = None;
        let later = |a: (i128, i128), b: (i128, i128)| a.0 * b.1 > b.0 * a.1;
        for row in self.clips.iter().chain([&self.near]) {
            let at = line.whole * row.constant + dot(row.normal, line.start);
            let speed = line.whole * dot(row.normal, line.direction);
            if speed > 0 {
                let t = (-at, speed);
                if first.is_none_or(|first| later(t, first)) {
                    first = Some(t);
                }
            } else if speed < 0 {
                let t = (at, -speed);
                if last.is_none_or(|last| later(last, t)) {
                    last = Some(t);
                }
            } else if at < 0 {
                return None;
            }
        }
        let first = first?;
        if last.is_some_and(|last| later(first, last)) {
            return None;
        }
        let t = first.0 as f64 / first.1 as f64;
        Some(to_f64(line.start) / line.whole as f64 + to_f64(line.direction) * t)
    }

    /// Returns whether rounding leaves certain what an ordinary view is. Planes of an eye's view are off by
    /// some units of rounding of the eye's coordinates. Where they meet, that is divided by the volume that
    /// the unit normals span, and it must stay below the distance of the near plane; in a parallel view,
    /// whose near plane meets the sides, below the extent of the picture.
    fn is_sure(&self) -> bool {
        let length = |a: Whole| to_f64(a).length();
        let [x, y, w, near] = [self.x, self.y, self.w, self.near].map(|row| row.normal);
        let (spanned, extent) = if self.is_parallel() {
            let sides = length(x) * length(y) * length(near);
            (dot(near, cross(x, y)) as f64 / sides, 1.0 / length(x).max(length(y)))
        } else {
            let sides = (length(x) + length(w)) * (length(y) + length(w)) * length(w);
            (dot(x, cross(y, w)) as f64 / sides, self.near.constant as f64 / length(near))
        };
        (spanned * extent).abs() > 1e-11 * length(self.eye)
    }

    /// Returns whether the view is ordinary: no clip planes, and all four edges of the view meet the near
    /// plane in front of the eye.
    fn is_by_the_book(&self) -> bool {
        self.clips.is_empty()
            && (self.is_parallel() || self.near.constant < 0)
            && [(-8, -8), (-8, 8), (8, -8), (8, 8)]
                .iter()
                .all(|&(a, b)| self.line(a, b).is_some_and(|line| dot(self.near.normal, line.direction) > 0))
    }
}

/// Returns the distance of `p` from a triangle, by the region of the triangle that `p` projects to (Ericson,
/// "Real-Time Collision Detection", 2005, 5.1.5).
fn distance_to_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let to_segment = |a: DVec3, b: DVec3| {
        let square = (b - a).length_squared();
        let t = if square > 0.0 { ((p - a).dot(b - a) / square).clamp(0.0, 1.0) } else { 0.0 };
        p.distance(a + (b - a) * t)
    };
    let edges = to_segment(a, b).min(to_segment(b, c)).min(to_segment(c, a));
    let normal = (b - a).cross(c - a);
    let inside = |a: DVec3, b: DVec3| (b - a).cross(p - a).dot(normal) >= 0.0;
    if normal.length() > 0.0 && inside(a, b) && inside(b, c) && inside(c, a) {
        edges.min((p - a).dot(normal.normalize()).abs())
    } else {
        edges
    }
}

fn distance(p: DVec3, polygon: &[DVec3]) -> f64 {
    let last = polygon.len() - 1;
    (0..last.max(1))
        .map(|i| distance_to_triangle(p, [polygon[0], polygon[i.min(last)], polygon[(i + 1).min(last)]]))
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn lines_of_sight_begin_in_the_polygons() {
    let mut rng = Random(17);
    let (mut told, mut by_the_book, mut lines, mut tight) = (0, 0, 0, 0);
    for trial in 0..60_000 {
        let camera = Camera::random(&mut rng);
        let Some(view) = camera.view() else { continue };
        let most = rng.pick(&[0, 0, 50, 5000]);
        let shift = random_whole(&mut rng, most);
        let anchor = to_f64(core::array::from_fn(|i| camera.eye[i] + shift[i]));
        let mut polygons: Vec<(Vec<DVec3>, f64)> = Vec::new();
        if !view.for_each_sight_start(anchor, |corners, error| polygons.push((corners.to_vec(), error))) {
            // Rounding leaves nothing undecided in an ordinary view.
            assert!(!camera.is_by_the_book() || !camera.is_sure(), "{trial}: {camera:?}");
            continue;
        }
        told += 1;
        by_the_book += usize::from(camera.is_by_the_book() && camera.is_sure());
        for _ in 0..20 {
            let (a, b) = match rng.below(3) {
                0 => (rng.pick(&[-8, 8]), rng.pick(&[-8, 8])),
                1 => (rng.pick(&[-8, 8]), i128::from(rng.between(-8, 8))),
                _ => (i128::from(rng.between(-8, 8)), i128::from(rng.between(-8, 8))),
            };
            let Some(first) = camera.line(a, b).and_then(|line| camera.first(&line)) else { continue };
            let first = first - to_f64(shift);
            // Rounding error of the oracle itself, in fractions and distances.
            let own = 16.0 * f64::EPSILON * (first.length() + to_f64(shift).length());
            let off = polygons
                .iter()
                .map(|(corners, error)| (distance(first, corners) - own).max(0.0) / error.max(1e-300))
                .fold(f64::INFINITY, f64::min);
            assert!(
                off <= 1.0,
                "{trial}: a line begins {off} error bounds off at {first}: {camera:?} {polygons:?}"
            );
            lines += 1;
            tight += usize::from(off > 1.0 / 256.0);
        }
    }
    judged(lines as u64);
    told_enough(
        told > 20_000 && by_the_book > 10_000 && lines > 200_000 && tight > 0,
        format_args!("told {told}, by the book {by_the_book}, lines {lines}, nearly off {tight}"),
    );
}
