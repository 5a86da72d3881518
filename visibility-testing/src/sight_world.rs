//! Occluders, an eye and a target in integers, with the exact answer whether a line of sight is free; for
//! climbs (`climb.rs`) towards what a culler hides wrongly.
//!
//! All coordinates are integers of at most 24 bits: exact in `f32` at any power of two as their unit. A line
//! of sight is judged by signs of determinants of their differences, which are exact in `i128`.

use crate::climb::ClimbInput;
use crate::slots::{Point, orientation};
use crate::{Random, cameras::power_of_two};
use std::fmt;
use visibility_core::glam::{Affine3A, DMat4, DVec3, DVec4, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Object, ObjectId, OccluderMesh, Scene, View, view::Depth};

/// Greatest magnitude of a coordinate in units.
const FARTHEST: i64 = 1 << 24;

/// A camera whose matrix is exact: clip `x`, `y` and `w` are the rows times the difference of a point and the
/// eye. The near plane is at `w = near`, there is no far plane.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Clip `x`, `y` and `w` for one unit along each axis.
    pub rows: [Point; 3],
    /// Clip `w` of the near plane.
    pub near: i64,
}

/// Occluding triangles between an eye (or a box of eyes) and a target box. What `Debug` prints of a world is
/// an expression of it, to be pasted into a test.
#[derive(Clone)]
pub struct SightWorld {
    /// Coordinates: of the corners, then of the target's and of the eyes' least corner.
    pub numbers: Vec<i64>,
    /// Number of leading coordinates that a climb keeps.
    pub fixed: usize,
    /// Corners of each triangle, counter-clockwise from its front.
    pub faces: Vec<[usize; 3]>,
    /// Whether backs occlude as well.
    pub two_sided: bool,
    /// Extent of the target in units; one without extent is a point.
    pub target_size: Point,
    /// Extent of the eyes' box in units.
    pub eyes_size: Point,
    /// `None` for a viewcell.
    pub camera: Option<Camera>,
    /// Metres in a unit, as a power of two.
    pub unit: i32,
    /// Origin of the scene in units.
    pub origin: Point,
    /// Whether clearance is how far the target is behind the occluder, or how far from the outline.
    pub in_depth: bool,
}

impl fmt::Debug for SightWorld {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { numbers, fixed, faces, two_sided, target_size, eyes_size, camera, unit, origin, in_depth } =
            self;
        write!(f, "SightWorld {{ numbers: vec!{numbers:?}, fixed: {fixed}, faces: vec!{faces:?}, ")?;
        write!(f, "two_sided: {two_sided}, target_size: {target_size:?}, eyes_size: {eyes_size:?}, ")?;
        write!(f, "camera: {camera:?}, unit: {unit}, origin: {origin:?}, in_depth: {in_depth} }}")
    }
}

fn minus(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|k| a[k] - b[k])
}

fn dot(a: Point, b: Point) -> i64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dvec3(p: Point) -> DVec3 {
    DVec3::from_array(p.map(|x| x as f64))
}

/// Returns the eight corners of a box, or the one point of a box without extent.
fn corners(min: Point, size: Point) -> Vec<Point> {
    let count = if size == [0; 3] { 1 } else { 8 };
    (0..count).map(|i| [0, 1, 2].map(|k| min[k] + if i >> k & 1 == 1 { size[k] } else { 0 })).collect()
}

impl SightWorld {
    /// Makes a world seen by a camera. Its rows may be sheared and mirrored.
    pub fn seen_by_camera(random: &mut Random) -> Self {
        let (rows, ahead) = loop {
            let rows: [Point; 3] = match random.below(3) {
                0 => {
                    let first = random.below(3);
                    let axes = [first, (first + 1) % 3, (first + 2) % 3];
                    axes.map(|axis| [0, 1, 2].map(|k| i64::from(k == axis) * random.pick(&[-1, 1])))
                }
                _ => [0; 3].map(|_| [0; 3].map(|_| i64::from(random.between(-5, 5)))),
            };
            let ahead = cross(rows[0], rows[1]);
            match dot(ahead, rows[2]) {
                0 => continue,
                w => break (rows, ahead.map(|x| x * w.signum())),
            }
        };
        let near = random.magnitude(16);
        let mut world = Self::around(random, ahead, [0; 3]);
        world.camera = Some(Camera { rows, near });
        world
    }

    /// Makes a world seen from a viewcell.
    pub fn seen_from_cell(random: &mut Random) -> Self {
        let ahead = loop {
            let ahead = [0; 3].map(|_| i64::from(random.between(-3, 3)));
            if ahead != [0; 3] {
                break ahead;
            }
        };
        let size = [0; 3].map(|_| random.magnitude(19));
        Self::around(random, ahead, size)
    }

    /// Makes a world whose occluder and target lie in the direction `ahead` from the eyes.
    fn around(random: &mut Random, ahead: Point, eyes_size: Point) -> Self {
        let longest = ahead.map(i64::abs).into_iter().max().unwrap_or(1).max(1);
        let along = |distance: i64| ahead.map(|x| x * (distance / longest).max(1));
        let reach = 1i64 << (18 + random.below(4));
        let eye = [0; 3].map(|_| i64::from(random.between(-(1 << 21), 1 << 21)));
        let middle = minus(eye, along(reach).map(|x| -x));
        let some =
            |random: &mut Random, by: i64| [0; 3].map(|_| i64::from(random.between(-by as i32, by as i32)));
        let wide = reach / random.pick(&[1, 2, 8]);
        let mut points: Vec<Point>;
        let faces: Vec<[usize; 3]>;
        let is_closed = random.one_in(3);
        if is_closed {
            // A parallelepiped, which is upright in one case of two, and a box along the axes in one of four.
            let mut half = [0; 3].map(|_| some(random, wide));
            let kind = random.below(4);
            for (axis, half) in half.iter_mut().enumerate().filter(|_| kind > 1) {
                for (k, x) in half.iter_mut().enumerate() {
                    *x *= i64::from(k == axis || (kind == 2 && k < 2 && axis < 2));
                }
            }
            let sign = if dot(cross(half[0], half[1]).map(|x| x >> 20), half[2]) < 0 { 1 } else { 0 };
            points = (0..8usize)
                .map(|i| {
                    [0, 1, 2].map(|k| {
                        (0..3).fold(middle[k], |sum, axis| {
                            sum + if i >> axis & 1 == 1 { half[axis][k] } else { -half[axis][k] }
                        })
                    })
                })
                .collect();
            faces = OccluderMesh::CUBOID
                .iter()
                .map(|t| t.map(|i| i as usize))
                .map(|[a, b, c]| if sign == 1 { [a, c, b] } else { [a, b, c] })
                .collect();
        } else {
            // A fan around a corner: from one triangle to six.
            let count = 1 + random.below(6);
            points = (0..count + 2).map(|_| some(random, wide)).collect();
            points = points.into_iter().map(|p| minus(middle, p)).collect();
            // Corners of the fan wind around the direction ahead.
            let [u, v] = [(); 2].map(|()| cross(ahead, some(random, wide)));
            let length = |p: Point| p.map(i64::abs).into_iter().max().unwrap_or(1).max(1);
            for (i, point) in points.iter_mut().enumerate().skip(1) {
                let angle = std::f64::consts::TAU * (i as f64 + random.unit()) / (count + 3) as f64;
                let [s, t] = [angle.sin(), angle.cos()];
                *point = [0, 1, 2].map(|k| {
                    let across = s * u[k] as f64 / length(u) as f64 + t * v[k] as f64 / length(v) as f64;
                    middle[k] + (wide as f64 * across) as i64 + i64::from(random.between(-9, 9))
                });
            }
            faces = (0..count).map(|i| [0, i + 1, i + 2]).collect();
        }
        // The target is behind a random point of a triangle.
        let face = random.pick(&faces);
        let [a, b, c] = face.map(|i| points[i]);
        let (s, t) = (random.unit(), random.unit());
        let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
        let far = random.pick(&[1.001, 1.1, 2.0, 4.0]);
        let target = [0, 1, 2].map(|k| {
            let at = a[k] as f64 + s * (b[k] - a[k]) as f64 + t * (c[k] - a[k]) as f64;
            (eye[k] as f64 + far * (at - eye[k] as f64)) as i64
        });
        let target_size = match random.below(3) {
            0 => [0; 3],
            _ => [0; 3].map(|_| random.magnitude(14)),
        };
        let numbers = points.into_iter().chain([target, eye]).flatten().collect();
        let unit: i32 = random.pick(&[-120, -60, -15, -11, 0, 40, 100]);
        let is_moved = unit.abs() < 20 && random.one_in(3);
        let origin = if is_moved { [0; 3].map(|_| random.bits() as i64 >> 17) } else { [0; 3] };
        let [two_sided, in_depth] = [!is_closed && random.one_in(2), random.one_in(4)];
        Self {
            numbers,
            fixed: 0,
            faces,
            two_sided,
            target_size,
            eyes_size,
            camera: None,
            unit,
            origin,
            in_depth,
        }
    }

    /// Keeps the corners of the triangles in climbs: only eyes and target move.
    #[must_use]
    pub fn with_fixed_triangles(self) -> Self {
        Self { fixed: self.numbers.len() - 6, ..self }
    }

    fn point(&self, index: usize) -> Point {
        [0, 1, 2].map(|k| self.numbers[3 * index + k])
    }

    fn corner_count(&self) -> usize {
        self.numbers.len() / 3 - 2
    }

    fn triangles(&self) -> impl Iterator<Item = [Point; 3]> {
        self.faces.iter().map(|face| face.map(|index| self.point(index)))
    }

    fn metres(&self, p: Point) -> DVec3 {
        dvec3(p) * power_of_two(self.unit)
    }

    fn vec3(&self, p: Point) -> Vec3 {
        self.metres(p).as_vec3()
    }

    /// Returns the scene's origin, a point of the world in metres.
    pub fn origin(&self) -> DVec3 {
        self.metres(self.origin)
    }

    /// Returns the occluder in metres relative to the scene's origin. `None` if the triangles are degenerate.
    pub fn mesh(&self) -> Option<OccluderMesh> {
        let mesh = OccluderMesh::from_triangles(&self.mesh_triangles()).ok()?;
        Some(mesh.with_two_sided(self.two_sided))
    }

    /// Returns the triangles of the occluder in metres relative to the scene's origin.
    pub fn mesh_triangles(&self) -> Vec<[Vec3; 3]> {
        self.triangles().map(|t| t.map(|p| self.vec3(p))).collect()
    }

    /// Returns whether backs of the triangles occlude as well.
    pub fn is_two_sided(&self) -> bool {
        self.two_sided
    }

    /// Returns the target in metres relative to the scene's origin.
    pub fn target(&self) -> Aabb {
        let min = self.point(self.corner_count());
        let max = [0, 1, 2].map(|k| min[k] + self.target_size[k]);
        Aabb::new(self.vec3(min), self.vec3(max))
    }

    /// Returns a scene of the occluder and the target. `None` if the triangles are degenerate.
    pub fn scene(&self) -> Option<(Scene, ObjectId)> {
        let mesh = self.mesh()?;
        let mut scene = Scene::new();
        scene.set_origin(self.origin()).ok()?;
        let bounds = self.target();
        let target = scene.insert(bounds);
        if self.target_size.iter().all(|&size| size > 0) {
            let corners = bounds.corners();
            let sides = OccluderMesh::CUBOID.map(|t| t.map(|i| corners[i as usize]));
            scene.set_triangles(target, sides.to_vec()).ok()?;
        }
        let id = scene.insert(Object { occluder: true, ..Object::new(*mesh.bounds()) });
        scene.set_triangles(id, self.mesh_triangles()).ok()?;
        scene.set_one_sided(id, !self.two_sided).ok()?;
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).ok()?;
        Some((scene, target))
    }

    /// Returns the viewcell of the eyes, in metres of the world.
    pub fn cell(&self) -> Viewcell {
        let min = self.point(self.corner_count() + 1);
        let at = |p: Point| self.metres(p) + self.origin();
        Viewcell::from_box(at(min), at([0, 1, 2].map(|k| min[k] + self.eyes_size[k])))
    }

    /// Returns the view of the camera, whose matrix is exact. `None` for a world with a viewcell, and for a
    /// matrix that views do not take.
    pub fn view(&self) -> Option<View> {
        let Camera { rows, near } = self.camera.as_ref()?;
        let eye = self.point(self.corner_count() + 1);
        // Coordinates in units of the world, from metres.
        let row = |row: Point| {
            let back = [0, 1, 2].map(|k| eye[k] + self.origin[k]);
            (dvec3(row) * power_of_two(-self.unit)).extend(-dot(row, back) as f64)
        };
        let [x, y, w] = rows.map(row);
        let rows = [x, y, DVec4::new(0.0, 0.0, 0.0, *near as f64), w];
        let matrix = DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
        View::from_clip_from_world(matrix, Depth::ReversedInfinite).ok()
    }

    /// Returns by how much the line of sight from `eye` to `target` is blocked: at most 0 if and only if it
    /// meets no triangle that occludes for the eye. `None` if the target is not in the picture.
    fn blocked_by(&self, eye: Point, target: Point) -> Option<f64> {
        let along = minus(target, eye);
        let mut ahead = None;
        if let Some(Camera { rows, near }) = &self.camera {
            let [x, y, w] = rows.map(|row| dot(row, along));
            if w < *near || x.abs() > w || y.abs() > w {
                return None;
            }
            ahead = Some([i128::from(w), i128::from(*near)]);
        }
        let mut blocked = 0.0f64;
        for t @ [a, b, c] in self.triangles() {
            let (of_eye, of_target) = (volume(t, eye), volume(t, target));
            if (!self.two_sided && of_eye <= 0) || of_eye.signum() * of_target.signum() > 0 {
                continue;
            }
            // The line crosses the plane at the share `of_eye / (of_eye - of_target)` of its way. Before the
            // near plane nothing occludes.
            let behind = (of_eye - of_target).abs();
            let is_drawn = ahead.is_none_or(|[w, near]| of_eye.abs() * w >= near * behind);
            let sides = [(a, b), (b, c), (c, a)].map(|(a, b)| orientation(eye, target, a, b));
            if !is_drawn || (sides.contains(&1) && sides.contains(&-1)) {
                continue;
            }
            let depth = if behind == 0 { 0.0 } else { of_target.abs() as f64 / behind as f64 };
            blocked = blocked.max(depth.max(f64::MIN_POSITIVE));
        }
        if blocked > 0.0 && !self.in_depth {
            blocked = self.aside(eye, target).max(f64::MIN_POSITIVE);
        }
        Some(blocked)
    }

    /// Returns the least distance in units between a line of sight and the outline of the occluder.
    fn aside(&self, eye: Point, target: Point) -> f64 {
        let facing: Vec<i128> = self.triangles().map(|t| volume(t, eye).signum()).collect();
        let along = dvec3(minus(target, eye)).normalize_or_zero();
        let mut least = f64::INFINITY;
        for (face, facing_here) in self.faces.iter().zip(&facing) {
            for k in 0..3 {
                let [a, b] = [face[k], face[(k + 1) % 3]];
                let is_inner = self.faces.iter().zip(&facing).any(|(other, facing)| {
                    facing == facing_here && (0..3).any(|k| other[k] == b && other[(k + 1) % 3] == a)
                });
                if is_inner || (!self.two_sided && *facing_here < 0) {
                    continue;
                }
                let across = |p: Point| {
                    let p = dvec3(minus(p, eye));
                    p - along * p.dot(along)
                };
                let (a, b) = (across(self.point(a)), across(self.point(b)));
                let share = (-a.dot(b - a) / (b - a).length_squared().max(1e-9)).clamp(0.0, 1.0);
                least = least.min((a + (b - a) * share).length());
            }
        }
        least
    }
}

/// Returns six times the volume of the tetrahedron of a triangle and a point: positive in front of the
/// triangle.
fn volume([a, b, c]: [Point; 3], p: Point) -> i128 {
    let [u, v, w] = [b, c, p].map(|x| minus(x, a).map(i128::from));
    u[0] * (v[1] * w[2] - v[2] * w[1])
        + u[1] * (v[2] * w[0] - v[0] * w[2])
        + u[2] * (v[0] * w[1] - v[1] * w[0])
}

impl ClimbInput for SightWorld {
    fn numbers(&mut self) -> &mut [i64] {
        &mut self.numbers[self.fixed..]
    }

    /// The least clearance of the lines of sight between corners of the eyes' box and corners of the target.
    fn clearance(&self) -> Option<f64> {
        let [target, eyes] = [0, 1].map(|k| self.point(self.corner_count() + k));
        let most = self.numbers.iter().map(|x| x.abs()).max()?;
        let most = most + self.target_size.into_iter().chain(self.eyes_size).max()?;
        if most > FARTHEST {
            return None;
        }
        let (eyes, targets) = (corners(eyes, self.eyes_size), corners(target, self.target_size));
        let lines = eyes.iter().flat_map(|&eye| targets.iter().map(move |&target| (eye, target)));
        lines.filter_map(|(eye, target)| self.blocked_by(eye, target)).min_by(f64::total_cmp)
    }

    /// A world without one of its triangles, whose corners stay.
    fn without(&self, part: usize) -> Option<Self> {
        let mut less = self.clone();
        (self.fixed == 0 && part < self.faces.len()).then(|| less.faces.remove(part))?;
        Some(less)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    macro_rules! with_source {
        ($expression:expr) => {
            ($expression, stringify!($expression))
        };
    }

    #[test]
    fn a_world_is_printed_as_an_expression() {
        let (world, source) = with_source!(SightWorld {
            numbers: vec![0, 0, 9, 1, 0, 9, 0, 1, 9, 0, 0, 20, 0, 0, 0],
            fixed: 0,
            faces: vec![[0, 1, 2]],
            two_sided: true,
            target_size: [1, 1, 1],
            eyes_size: [0, 0, 0],
            camera: Some(Camera { rows: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], near: 1 }),
            unit: -3,
            origin: [0, 0, 0],
            in_depth: false,
        });
        let dense = |text: &str| text.split_whitespace().collect::<String>().replace(",}", "}");
        assert_eq!(dense(&format!("{world:?}")), dense(source), "what is printed, and the expression");
    }

    #[test]
    fn triangles_are_left_out_unless_they_are_fixed() {
        let world = SightWorld::seen_by_camera(&mut Random(1));
        let count = world.faces.len();
        assert_eq!(
            world.without(count - 1).map(|less| less.faces.len()),
            Some(count - 1),
            "without the last"
        );
        assert!(world.without(count).is_none(), "{count} triangles");
        assert!(world.with_fixed_triangles().without(0).is_none(), "fixed triangles stay");
    }
}
