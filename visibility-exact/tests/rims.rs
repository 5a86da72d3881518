//! Targets that are seen only from a corner or edge of the viewcell, and only just inside a corner or edge of
//! the target triangle. An exact oracle in integers confirms that the segment is clear.

use crate::common::grid::{FINE, misses_box, misses_triangle, on_grid, rounded, triangle_on_grid};
use crate::common::{Triangle, check, cuboid, prepared, quad};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_exact::{Effort, ExactCuller, ExactSettings, Verdict};
use visibility_testing::{Random, judged, told_enough};

/// A world with a clear segment from p to q, a point of object 0. Every other clear segment is close to this
/// one.
struct World {
    cell: Viewcell,
    objects: Vec<Vec<Triangle>>,
    p: DVec3,
    q: DVec3,
}

/// Returns the viewcell; its corner, or a point on one of its edges; a triangle; and a point just inside a
/// corner or an edge of the triangle, at 1 to `depth` parts of 1024.
fn ends(random: &mut Random, depth: i32) -> (Viewcell, DVec3, Triangle, DVec3) {
    let (min, max) = (DVec3::new(-4.0, -2.0, -2.0), DVec3::new(-1.0, 2.0, 1.0));
    let mut p = DVec3::from_array(core::array::from_fn(|k| if random.one_in(2) { min[k] } else { max[k] }));
    if random.one_in(2) {
        let axis = random.below(3);
        p[axis] = f64::from(random.between(4 * min[axis] as i32, 4 * max[axis] as i32)) / 4.0;
    }
    let t: [DVec3; 3] = loop {
        let mut int = |a: i32, b: i32| f64::from(random.between(a, b));
        let t = core::array::from_fn(|_| DVec3::new(int(21, 27), int(-14, 14), int(-14, 14)));
        let sides = [(0, 1), (1, 2), (2, 0)].map(|(i, j): (usize, usize)| t[i].distance(t[j]));
        let area = (t[1] - t[0]).cross(t[2] - t[0]).length();
        if area > 4.0 && sides.into_iter().all(|side| side < 6.0) {
            break t;
        }
    };
    // Barycentric coordinates in parts of 1024, with integer corners: q and the quarter points of the segment
    // are on the grid.
    let mut parts = [0, random.between(1, depth), random.between(1, depth)];
    if random.one_in(2) {
        parts[1] = random.between(100, 900);
    }
    parts[0] = 1024 - parts[1] - parts[2];
    parts.rotate_left(random.below(3));
    let q = (0..3).map(|k| t[k] * f64::from(parts[k])).sum::<DVec3>() / 1024.0;
    (Viewcell::from_box(min, max), p, t.map(|v| v.as_vec3()), q)
}

/// Makes a viewcell, a target, and two walls of four planks each. The segment between them passes the planks'
/// edges at a distance of `hole` grid units or more on each axis.
fn world(random: &mut Random, depth: i32, hole: i64) -> World {
    let (cell, p, target, q) = ends(random, depth);
    let h = hole as f64 / FINE;
    let mut objects = vec![vec![target]];
    for part in [0.25, 0.75] {
        for (k, sides) in (0..).zip([
            [-1.0, -h, -1.0, 1.0],
            [h, 1.0, -1.0, 1.0],
            [-1.0, 1.0, -1.0, -h],
            [-1.0, 1.0, h, 1.0],
        ]) {
            let x = p.x + (q.x - p.x) * part + f64::from(k) * 4.0 / FINE;
            let at = rounded(p + (q - p) * ((x - p.x) / (q.x - p.x)));
            let [y0, y1, z0, z1] = sides.map(|side| if side.abs() == 1.0 { side * 40.0 } else { side });
            let corner = |y: f64, z: f64| DVec3::new(x, at.y + y, at.z + z);
            objects.push(quad(corner(y0, z0), corner(y1, z0), corner(y1, z1), corner(y0, z1)));
        }
    }
    World { cell, objects, p, q }.turned(random)
}

impl World {
    /// Permutes and mirrors the axes at random.
    fn turned(self, random: &mut Random) -> Self {
        let (by, signs) = (random.below(3), random.below(8));
        let turn = |v: DVec3| {
            DVec3::from_array(core::array::from_fn(|k| {
                let x = v[(k + by) % 3];
                if signs >> k & 1 == 1 { -x } else { x }
            }))
        };
        let turn_single = |v: Vec3| turn(v.as_dvec3()).as_vec3();
        let (a, b) = (turn(self.cell.min), turn(self.cell.max));
        Self {
            cell: Viewcell::from_box(a.min(b), a.max(b)),
            objects: self
                .objects
                .into_iter()
                .map(|o| o.into_iter().map(|t| t.map(turn_single)).collect())
                .collect(),
            p: turn(self.p),
            q: turn(self.q),
        }
    }

    /// Returns whether the segment misses all occluders and, unless `clearance` is 0, the boxes of their
    /// triangles enlarged by `clearance` grid units.
    fn is_clear(&self, clearance: i64) -> bool {
        let (p, q) = (on_grid(self.p), on_grid(self.q));
        self.objects[1..].iter().flatten().map(triangle_on_grid).all(|t| {
            let bound = |k: usize, f: fn(i64, i64) -> i64| f(f(t[0][k], t[1][k]), t[2][k]);
            let min = core::array::from_fn(|k| bound(k, i64::min) - clearance);
            let max = core::array::from_fn(|k| bound(k, i64::max) + clearance);
            misses_triangle(p, q, &t) && (clearance == 0 || misses_box(p, q, min, max))
        })
    }

    /// Decides object 0 without rays, and returns whether it is seen. Panics if it is proven hidden, or if a
    /// proof does not hold.
    fn is_seen(&self, c: f64) -> bool {
        let triangles = prepared(&self.objects);
        let settings =
            ExactSettings::new(Effort::Exact(c)).with_rays(0).with_aimed_rays(0).with_kept_proofs();
        let found = ExactCuller::new(triangles.clone(), settings).verdicts(&self.cell);
        check(&self.objects, &triangles, &found);
        let verdict = found.iter(&triangles).next().unwrap().1;
        assert_ne!(verdict, Verdict::Hidden, "{} to {} of {:?}, c = {c}", self.p, self.q, self.objects[0]);
        matches!(verdict, Verdict::Seen(_))
    }
}

/// Returns the numbers of seen and of open targets, among `count` targets.
fn decide(count: u64, depth: i32, hole: i64, c: f64) -> [usize; 2] {
    let mut counts = [0; 2];
    for number in 0..count {
        let world = world(&mut Random(number), depth, hole);
        assert!(world.is_clear((6.0 * c * FINE).ceil() as i64), "world {number}");
        counts[usize::from(!world.is_seen(c))] += 1;
    }
    judged(counts.iter().sum::<usize>() as u64);
    counts
}

#[test]
fn rims_are_seen_without_clearance() {
    let counts = decide(50, 6, 8, 0.0);
    told_enough(counts[0] > 40, format_args!("{counts:?}"));
}

#[test]
fn rims_are_seen_with_clearance() {
    let counts = decide(50, 4, 48, 1e-3);
    told_enough(counts[0] > 40, format_args!("{counts:?}"));
}

/// A target that passes through a closed shell around the viewcell and touches the viewcell at a point, along
/// an edge, or with a part of its area.
#[test]
fn targets_that_touch_the_viewcell_are_not_hidden() {
    let mut random = Random(3);
    for round in 0..60 {
        let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
        let corner = |random: &mut Random| {
            DVec3::from_array(core::array::from_fn(|_| f64::from(random.between(0, 4)) / 4.0))
        };
        // A point on the boundary of the viewcell, and points outside, beyond the face with this point.
        let (mut touching, axis) = (corner(&mut random), random.below(3));
        touching[axis] = f64::from(random.between(0, 1));
        let out = if touching[axis] == 0.0 { -1.0 } else { 1.0 };
        let mut beyond = || {
            let mut v = DVec3::from_array(core::array::from_fn(|_| f64::from(random.between(-3, 4))));
            v[axis] = touching[axis] + out * f64::from(random.between(1, 5));
            v
        };
        let (a, mut b) = (beyond(), beyond());
        if round % 3 == 0 {
            // The target touches the viewcell along a segment in the face.
            b = corner(&mut random);
            b[axis] = touching[axis];
        }
        if (a - touching).cross(b - touching) == DVec3::ZERO {
            continue;
        }
        for gap in [1.0, 1.0 / 64.0] {
            let shell = cuboid(DVec3::splat(-gap), DVec3::splat(1.0 + gap));
            let objects = vec![vec![[touching, a, b].map(|v| v.as_vec3())], shell];
            for c in [0.0, 1e-3] {
                World { cell: cell.clone(), objects: objects.clone(), p: touching, q: touching }.is_seen(c);
            }
        }
    }
}

/// A box that passes through a closed shell around the viewcell and ends in front of a face of the viewcell.
/// The distance is above 0, and at or below the error of positions.
#[test]
fn boxes_at_a_distance_within_rounding_are_not_hidden() {
    let mut random = Random(4);
    for round in 0..30 {
        let (axis, steps) = (random.below(3), [1.0, 2.0, 40.0, 1000.0, 9000.0][round % 5]);
        let mut max = DVec3::ONE;
        max[axis] -= steps * f64::EPSILON;
        let mut int = |a: i32, b: i32| f64::from(random.between(a, b)) / 4.0;
        let low = DVec3::from_array(core::array::from_fn(|_| int(-3, 3)));
        let size = DVec3::from_array(core::array::from_fn(|_| int(1, 9)));
        let (mut from, mut to) = (low, low + size);
        (from[axis], to[axis]) = (1.0, 1.0 + size[axis]);
        for gap in [1.0, 1.0 / 64.0] {
            let shell = cuboid(DVec3::splat(-gap), DVec3::splat(1.0 + gap));
            let objects = vec![cuboid(from, to), shell];
            let cell = Viewcell::from_box(DVec3::ZERO, max);
            let is_seen = from.cmple(max + f64::EPSILON * 1e4).all() && to.cmpge(DVec3::ZERO).all();
            let settings =
                ExactSettings::new(Effort::Exact(0.0)).with_rays(0).with_aimed_rays(0).with_kept_proofs();
            let triangles = prepared(&objects);
            let found = ExactCuller::new(triangles.clone(), settings).verdicts(&cell);
            check(&objects, &triangles, &found);
            let verdict = found.iter(&triangles).next().unwrap().1;
            assert!(!is_seen || verdict != Verdict::Hidden, "{round}: {from} to {to}");
        }
    }
}
