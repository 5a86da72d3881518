//! Openness of the objects of a scene: mean free distance in front of their surfaces, as a fraction of half
//! the scene's radius.
//!
//! All triangles are intersected with evenly spaced parallel lines in each of 16 directions. The free
//! distance of a triangle along a line is the length from the triangle to the next surface on its front side.
//! An eye somewhere in the scene sees a point of a surface along a line only from within that length. The
//! mean over all directions therefore estimates how likely the surface is seen from an arbitrary eye. Engines
//! under hoods and the inner sides of double walls have low openness from every eye (such lines: Sbert, "An
//! integral geometry based method for fast form-factor computation", 1993).

use crate::shape::for_each_shape;
use alloc::vec::Vec;
use visibility_core::Scene;
use visibility_core::glam::{DVec2, Vec2, Vec3};

/// Number of directions of the parallel lines along which free distances are measured.
const DIRECTIONS: usize = 16;

/// Maximum number of parallel lines along each side of the square grid of lines of one direction.
const MAX_LINES_PER_SIDE: u32 = 2048;

/// Number of parallel lines along each side of the square grid of lines of one direction up to which
/// [`MAX_LINES_PER_TRIANGLE`] sets no limit.
const FREE_LINES_PER_SIDE: u32 = 256;

/// Maximum number of lines of one direction per triangle of the scene, so that the time stays proportional to
/// the number of triangles, however small they are compared with the scene.
const MAX_LINES_PER_TRIANGLE: f64 = 64.0;

/// Target number of lines of one direction that intersect a triangle, on average over all triangles.
const LINES_PER_TRIANGLE: f64 = 3.0;

/// Free distance (length from a triangle to the next surface in front) that counts as an openness of 1, as a
/// fraction of the scene's radius. Longer distances count as 1 too.
const FAR: f32 = 0.5;

/// Least cosine between a triangle's normal and the direction of sampling lines for which those lines count
/// in the triangle's openness. Lines that meet the triangle at a flatter angle (more than 78 degrees off its
/// normal) are left out of the mean, since their free distance says little about the surface.
const MIN_MEASURED_COSINE: f32 = 0.2;

/// Least cosine between a triangle's normal and the direction of sampling lines for which the triangle blocks
/// those lines. A triangle seen closer to edge-on (by 0.06 degrees or less) is taken as absent.
const MIN_BLOCKING_COSINE: f32 = 1e-3;

/// Distance from a triangle, in units of the spacing of the sampling lines, up to which another surface
/// counts as the same surface.
const SAME_SURFACE: f32 = 0.25;

/// Returns the openness of every object, indexed by [`ObjectId::index`](visibility_core::ObjectId::index):
/// from 0 (enclosed) to 1 (no surface in front within half the scene's radius). Also returns that half radius
/// in metres, infinite where all objects have 1.
///
/// An object has the openness of its most open triangle. Objects without triangles are measured by the faces
/// of their bounds. A triangle edge-on to all directions has 1/2. The openness is 1 for objects without
/// finite bounds and for unused indices. All objects have 1 if the scene's extent is zero or its size
/// overflows or underflows f32.
///
/// Cost: O(n log n) in the number of triangles, about a microsecond each.
pub(crate) fn openness_by_index(scene: &Scene) -> (Vec<f32>, f32) {
    let mut triangles: Vec<(u32, [Vec3; 3])> = Vec::new();
    for id in scene.ids() {
        for_each_shape(scene, id, &mut |part| {
            part.for_each_triangle(|t| triangles.push((id.index() as u32, t.map(|p| p.as_vec3()))));
        });
    }
    let mut by_index = alloc::vec![1.0; scene.index_limit()];
    let corners = || triangles.iter().flat_map(|(_, t)| t);
    let (min, max) = corners().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), &p| (a.min(p), b.max(p)));
    let center = min * 0.5 + max * 0.5;
    // The length is in f64, since squares overflow f32 before coordinates do.
    let radius = (max - center).as_dvec3().length();
    let wide = |v: Vec3| v.as_dvec3();
    let area: f64 =
        triangles.iter().map(|(_, [a, b, c])| wide(b - a).cross(wide(c - a)).length() * 0.5).sum();
    // A triangle of random orientation shows half its area along a line, on average.
    let count = triangles.len() as f64;
    let [wanted, most] =
        DVec2::new(area * 0.5 / (LINES_PER_TRIANGLE * count), MAX_LINES_PER_TRIANGLE * count)
            .sqrt()
            .to_array();
    let most = most.clamp(f64::from(FREE_LINES_PER_SIDE), f64::from(MAX_LINES_PER_SIDE));
    let spacing = (radius * 2.0 / most).max(wanted);
    let side = (radius * 2.0 / spacing) as u32;
    let (radius, spacing) = (radius as f32, spacing as f32);
    // Neither is normal without triangles and without extent.
    if !(radius.is_normal() && spacing.is_normal()) {
        return (by_index, f32::INFINITY);
    }
    // For each triangle, the sum of its weighted free distances and the sum of the weights.
    let mut sums = alloc::vec![(0.0f32, 0.0f32); triangles.len()];
    let mut lines = Lines { side: side.min(MAX_LINES_PER_SIDE) + 2, ..Lines::default() };
    for direction in 0..DIRECTIONS {
        let axes = axes(direction);
        let to_lines = |p: Vec3| {
            let p = (p - center) / spacing;
            Vec3::from_array(axes.map(|axis| axis.dot(p))) + lines.side as f32 * 0.5
        };
        let local: Vec<[Vec3; 3]> = triangles.iter().map(|(_, t)| t.map(to_lines)).collect();
        lines.intersect(&local);
        for (t, (sum, weight)) in local.iter().zip(&mut sums) {
            if let Some(slope) = Slope::new(t, MIN_MEASURED_COSINE) {
                let length = lines.free_distance(t, &slope) * spacing;
                *sum += slope.cosine * (length / (radius * FAR)).min(1.0);
                *weight += slope.cosine;
            }
        }
    }
    let mut last = u32::MAX;
    for ((object, _), (sum, weight)) in triangles.iter().zip(sums) {
        let openness = if weight > 0.0 { sum / weight } else { 0.5 };
        let of_object = &mut by_index[*object as usize];
        // The triangles of an object are adjacent in the list.
        *of_object = if *object == last { of_object.max(openness) } else { openness };
        last = *object;
    }
    (by_index, radius * FAR)
}

/// Cosine and sine of the golden angle, by which each direction of sampling lines is turned about the z axis
/// from the direction before.
const GOLDEN_ANGLE: Vec2 = Vec2::new(-0.737_368_9, 0.675_490_3);

/// Returns the orthonormal axes of the sampling lines with direction number `direction`, below
/// [`DIRECTIONS`]. The last axis runs along the lines. The directions are spread over the upper hemisphere,
/// and none is parallel to an axis of the scene.
fn axes(direction: usize) -> [Vec3; 3] {
    // Points on a spiral with the golden angle.
    let mut around = Vec2::new(0.8, 0.6);
    for _ in 0..direction {
        around = GOLDEN_ANGLE.rotate(around);
    }
    let z = (direction as f32 + 0.5) / DIRECTIONS as f32;
    let along = (around * Vec2::splat(1.0 - z * z).sqrt()).extend(z).normalize();
    let u = along.any_orthonormal_vector();
    [u, along.cross(u), along]
}

/// Slope of a triangle's plane against the sampling lines, in coordinates with z along the lines and x and y
/// across them, and lengths in spacings of the lines.
struct Slope {
    /// Change of the plane's z (along the sampling lines) for each unit of x across the lines.
    x: f32,
    /// Change of the plane's z (along the sampling lines) for each unit of y across the lines.
    y: f32,
    /// Absolute cosine of the angle between the triangle's normal and the sampling lines, 0 (edge-on) to 1.
    cosine: f32,
    /// True if the triangle's front faces towards greater z (along the lines), false if it faces towards
    /// lesser z.
    up: bool,
}

impl Slope {
    /// Returns the slope of a triangle given in the lines' coordinates (z along the lines, lengths in line
    /// spacings). `None` if the cosine between its normal and the lines is at most `min_cosine`, or the
    /// triangle has no normal.
    fn new([a, b, c]: &[Vec3; 3], min_cosine: f32) -> Option<Self> {
        let normal = (*b - *a).cross(*c - *a);
        let cosine = normal.z.abs() / normal.length();
        (cosine > min_cosine).then(|| Self {
            x: -normal.x / normal.z,
            y: -normal.y / normal.z,
            cosine,
            up: normal.z > 0.0,
        })
    }
}

/// Parallel lines of one direction, with the depths at which triangles intersect them. In the lines'
/// coordinates, line (i, j) runs along z at x = i + 1/2, y = j + 1/2, so lengths are in line spacings. Line
/// (i, j) has the number `j * side + i`.
#[derive(Default)]
struct Lines {
    /// Number of parallel lines along each side of the square grid of lines.
    side: u32,
    /// CSR offsets: the index in `depths` of each line's first intersection, then the end of the last line
    /// and one scratch entry.
    starts: Vec<u32>,
    /// Depth (z in line spacings) of every intersection, line by line; ascending within each line of `long`,
    /// otherwise in the order of the triangles.
    depths: Vec<f32>,
    /// Numbers of the sampling lines with more than [`MAX_SCANNED`] intersections, whose depths are sorted.
    /// Line (i, j) has the number `j * side + i`.
    long: Vec<u32>,
    /// Number of the sampling line and depth (z in line spacings) of every intersection, in the order of the
    /// triangles. Line (i, j) has the number `j * side + i`.
    intersections: Vec<(u32, f32)>,
}

impl Lines {
    /// Replaces the intersections of all lines by the lines' intersections with `triangles`, given in the
    /// lines' coordinates (z along the lines, lengths in line spacings).
    fn intersect(&mut self, triangles: &[[Vec3; 3]]) {
        self.intersections.clear();
        for t in triangles {
            if let Some(slope) = Slope::new(t, MIN_BLOCKING_COSINE) {
                self.intersect_triangle(t, &slope);
            }
        }
        // Counting sort by line. `starts` is shifted by two entries, so that after the depths are sorted in,
        // `starts[line]` is the start of this line's depths.
        let count = (self.side * self.side) as usize;
        self.starts.clear();
        self.starts.resize(count + 2, 0);
        for &(line, _) in &self.intersections {
            self.starts[line as usize + 2] += 1;
        }
        self.long.clear();
        for line in 2..count + 2 {
            if self.starts[line] as usize > MAX_SCANNED {
                self.long.push(line as u32 - 2);
            }
            self.starts[line] += self.starts[line - 1];
        }
        self.depths.clear();
        self.depths.resize(self.intersections.len(), 0.0);
        for &(line, depth) in &self.intersections {
            let place = &mut self.starts[line as usize + 1];
            self.depths[*place as usize] = depth;
            *place += 1;
        }
        // Short lists are scanned linearly; long lists are sorted, for bisection.
        for &line in &self.long {
            let (start, end) = (self.starts[line as usize], self.starts[line as usize + 1]);
            self.depths[start as usize..end as usize].sort_unstable_by(f32::total_cmp);
        }
    }

    /// Appends the intersections of one triangle with the lines to `intersections`. `t` and `slope` are in
    /// the lines' coordinates (z along the lines, lengths in line spacings).
    fn intersect_triangle(&mut self, t: &[Vec3; 3], slope: &Slope) {
        let (min, max) = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
        let end = |x: f32| ((x + 0.5) as u32).min(self.side);
        let (x0, x1, y0, y1) = (end(min.x), end(max.x), end(min.y), end(max.y));
        if x0 >= x1 {
            return;
        }
        for j in y0..y1 {
            let y = j as f32 + 0.5;
            let (mut from, mut to) = (f32::INFINITY, f32::NEG_INFINITY);
            for (p, q) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                if (p.y <= y) != (q.y <= y) {
                    let x = p.x + (q.x - p.x) * ((y - p.y) / (q.y - p.y));
                    (from, to) = (from.min(x), to.max(x));
                }
            }
            for i in end(from)..end(to) {
                let depth = t[0].z + slope.x * (i as f32 + 0.5 - t[0].x) + slope.y * (y - t[0].y);
                // NaN is skipped, since an ascending list cannot hold it.
                if !depth.is_nan() {
                    self.intersections.push((j * self.side + i, depth));
                }
            }
        }
    }

    /// Returns the free distance of a triangle in line spacings: the length to the next surface on its front
    /// side, along the line nearest to its centre. Surfaces within [`SAME_SURFACE`] are skipped. Infinite if
    /// no surface follows.
    fn free_distance(&self, t: &[Vec3; 3], slope: &Slope) -> f32 {
        let center = (t[0] + t[1] + t[2]) / 3.0;
        let place = |x: f32| (x as u32).min(self.side - 1);
        let (i, j) = (place(center.x), place(center.y));
        let depth = center.z + slope.x * (i as f32 + 0.5 - center.x) + slope.y * (j as f32 + 0.5 - center.y);
        let line = (j * self.side + i) as usize;
        let depths = &self.depths[self.starts[line] as usize..self.starts[line + 1] as usize];
        let distance = |other: f32| if slope.up { other - depth } else { depth - other };
        if depths.len() > MAX_SCANNED {
            return first_beyond(depths, slope.up, distance);
        }
        let beyond = depths.iter().map(|&other| distance(other)).filter(|&distance| distance > SAME_SURFACE);
        beyond.fold(f32::INFINITY, f32::min)
    }
}

/// Maximum number of surfaces met by one sampling line that are searched linearly. The surfaces of lines with
/// more are sorted by depth and bisected.
const MAX_SCANNED: usize = 32;

/// Returns the least value of `distance` (in line spacings) over a list of depths that is greater than
/// [`SAME_SURFACE`], or infinity if none is. `distance` must increase along the list if `grows`, else
/// decrease. Calls `distance` O(log n) times.
fn first_beyond(depths: &[f32], grows: bool, mut distance: impl FnMut(f32) -> f32) -> f32 {
    let found = if grows {
        let end = depths.partition_point(|&other| distance(other) <= SAME_SURFACE);
        depths.get(end)
    } else {
        let end = depths.partition_point(|&other| distance(other) > SAME_SURFACE);
        end.checked_sub(1).and_then(|last| depths.get(last))
    };
    // `min` of infinity and NaN is infinity.
    found.map_or(f32::INFINITY, |&other| f32::INFINITY.min(distance(other)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Quat;
    use visibility_core::{Aabb, Object, OccluderMesh};

    /// Inserts the twelve outward-facing triangles of a cube into the scene, each as an object. `half` is
    /// half the cube's side, `turn` its rotation.
    fn cube(scene: &mut Scene, center: Vec3, half: f32, turn: Quat) {
        let corners = Aabb::new(Vec3::splat(-half), Vec3::splat(half)).corners();
        for triangle in OccluderMesh::CUBOID {
            let t = triangle.map(|corner| center + turn * corners[corner as usize]);
            let id = scene.insert(Object::new(Aabb::from_points(t)));
            scene.set_triangles(id, [t]).unwrap();
        }
    }

    /// All faces of a cube inside a slightly larger cube have low openness (mean free distance in front of an
    /// object's surface). Faces of the larger cube and of a
    /// separate cube have high openness. The same holds for 40 copies of the scene, where lines have so many
    /// intersections that depths are bisected.
    #[test]
    fn enclosed_objects_have_low_openness() {
        for (turn, copies) in [
            (Quat::IDENTITY, 1),
            (Quat::from_rotation_x(0.7) * Quat::from_rotation_z(1.9), 1),
            (Quat::from_rotation_x(0.7) * Quat::from_rotation_z(1.9), 40),
        ] {
            for center in [Vec3::ZERO, Vec3::new(300.0, -20.0, 7.0)] {
                let mut scene = Scene::new();
                for _ in 0..copies {
                    for half in [0.8, 1.0] {
                        cube(&mut scene, center, half, turn);
                    }
                    cube(&mut scene, center + turn * Vec3::X * 12.0, 1.0, turn);
                }
                let openness = openness_by_index(&scene).0;
                for of_copy in openness.chunks(36) {
                    let most_inside = of_copy[..12].iter().copied().fold(0.0, f32::max);
                    let least_outside = of_copy[12..].iter().copied().fold(1.0, f32::min);
                    assert!(most_inside < 0.15 && least_outside > 0.6, "{most_inside} {least_outside}");
                }
            }
        }
    }

    #[test]
    fn an_object_is_as_open_as_its_most_open_triangle() {
        let mut scene = Scene::new();
        cube(&mut scene, Vec3::ZERO, 1.0, Quat::IDENTITY);
        let both = scene.insert(Aabb::from_arrays([-0.9, -0.9, -0.9], [0.9, 0.9, 9.0]));
        let triangle = |z: f32| [Vec3::new(-0.5, -0.5, z), Vec3::new(0.5, -0.5, z), Vec3::new(0.0, 0.5, z)];
        scene.set_triangles(both, [triangle(0.9), triangle(9.0), triangle(0.8)]).unwrap();
        let boxed = scene.insert(Aabb::from_arrays([-0.1; 3], [0.1; 3]));
        let openness = openness_by_index(&scene).0;
        assert!(openness[both.index()] > 0.9, "{openness:?}");
        assert!(openness[boxed.index()] < 0.6, "{openness:?}");
    }

    /// The radius overflows, or the distance of two lines underflows.
    #[test]
    fn scenes_of_sizes_beyond_f32_are_open() {
        for size in [0.0, 2e-38, f32::MAX] {
            let mut scene = Scene::new();
            for size in [size, size * 0.5] {
                scene.insert(Aabb::from_arrays([-size; 3], [size; 3]));
            }
            assert_eq!(openness_by_index(&scene), (alloc::vec![1.0; 2], f32::INFINITY), "a size of {size}");
        }
    }

    /// A corner exactly as high as the middle of a row of lines ends the same edges in whatever order the
    /// corners come. Lines at the lower end of a row of a triangle are not met, those at the upper end are.
    #[test]
    fn lines_through_corners_are_met_once() {
        let t = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(6.5, 2.5, 0.0), Vec3::new(2.0, 5.0, 0.0)];
        for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let t = order.map(|i| t[i]);
            let mut lines = Lines { side: 8, ..Lines::default() };
            lines.intersect(&[t]);
            let met: Vec<_> = lines.intersections.iter().map(|&(line, _)| (line / 8, line % 8)).collect();
            let row = |j: u32, columns: core::ops::Range<u32>| columns.map(move |i| (j, i));
            let expected = [row(0, 1..2), row(1, 1..4), row(2, 2..7), row(3, 2..5), row(4, 2..3)];
            assert_eq!(
                met,
                expected.into_iter().flatten().collect::<Vec<_>>(),
                "rows and columns, {order:?}"
            );
        }
    }

    /// Lists of as many surfaces as are scanned, and of one more, which are sorted. Neighbours count as the
    /// same surface.
    #[test]
    fn long_and_short_lists_have_the_same_next_surface() {
        for count in MAX_SCANNED - 1..MAX_SCANNED + 2 {
            let corners = [(0.0, 0.0), (2.0, 0.0), (0.0, 2.0)];
            let at = |z: usize| corners.map(|(x, y)| Vec3::new(x, y, z as f32 * SAME_SURFACE));
            let triangles: Vec<_> = (0..count).map(|i| at(i * 7 % count)).collect();
            let mut lines = Lines { side: 2, ..Lines::default() };
            lines.intersect(&triangles);
            for (i, t) in triangles.iter().enumerate() {
                let slope = Slope::new(t, MIN_MEASURED_COSINE).unwrap();
                let expected = if i * 7 % count + 2 < count { 2.0 * SAME_SURFACE } else { f32::INFINITY };
                assert_eq!(lines.free_distance(t, &slope), expected, "surface {i} of {count}");
            }
        }
    }

    #[test]
    fn openness_is_within_its_range_for_any_scene() {
        assert!(openness_by_index(&Scene::new()).0.is_empty(), "an empty scene has no openness");
        for size in [0.0, 1e-30, 1e25, f32::MAX, f32::INFINITY, f32::NAN] {
            let mut scene = Scene::new();
            scene.insert(Aabb::from_arrays([-size; 3], [size; 3]));
            scene.insert(Aabb::from_arrays([0.0; 3], [0.0; 3]));
            let id = scene.insert(Aabb::from_arrays([-1.0; 3], [1.0; 3]));
            scene.set_triangles(id, [[Vec3::ZERO, Vec3::X, Vec3::X], [Vec3::NAN; 3]]).unwrap();
            for openness in openness_by_index(&scene).0 {
                assert!((0.0..=1.0).contains(&openness), "{size}: {openness}");
            }
        }
    }

    /// Many coincident surfaces on one line: bisection finds the same next surface as a linear scan, in at
    /// most 15 steps.
    #[test]
    fn the_next_surface_is_found_in_logarithmically_many_steps() {
        let mut depths: Vec<f32> = (0..4096).map(|i| (i / 1000) as f32 * 7.0).collect();
        depths.insert(0, f32::NEG_INFINITY);
        depths.push(f32::INFINITY);
        for depth in [-100.0, -SAME_SURFACE, SAME_SURFACE, 0.0, 0.1, 6.9, 7.0, 7.3, 20.0, 28.0, 1e9, f32::NAN]
        {
            for up in [true, false] {
                let distance = |other: f32| if up { other - depth } else { depth - other };
                let scanned = depths.iter().map(|&other| distance(other));
                let scanned = scanned.filter(|&d| d > SAME_SURFACE).fold(f32::INFINITY, f32::min);
                let mut calls = 0;
                let found = first_beyond(&depths, up, |other| {
                    calls += 1;
                    distance(other)
                });
                assert_eq!(found, scanned, "{depth} {up}");
                assert!(calls <= 15, "{calls} steps");
            }
        }
    }
}
