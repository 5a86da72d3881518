//! Viewpoints in a viewcell: random ones, and those on a given line.

use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::random::Random;

/// Distance of viewpoints from the sides of a viewcell, as a fraction of its extent. At the sides themselves,
/// rounding would decide whether a viewpoint sees a surface in the plane of the side, such as a wall.
const INSET: f64 = 1e-6;

/// Number of random points that are tried for a viewpoint, in a viewcell with planes.
const TRIES: usize = 64;

/// The viewpoints of a viewcell, in metres relative to the scene's origin.
#[derive(Clone, Debug)]
pub(super) struct Eyes<'a> {
    min: DVec3,
    max: DVec3,
    origin: DVec3,
    planes: &'a [Plane],
}

impl<'a> Eyes<'a> {
    /// Returns the possible viewpoints of a viewcell. `None` if its box is inverted or not finite.
    pub(super) fn new(cell: &'a Viewcell, origin: DVec3) -> Option<Self> {
        let (min, max) = (cell.min - origin, cell.max - origin);
        let inset = (max - min) * INSET;
        let (min, max) = (min + inset, max - inset);
        // The inset of a corner that is not finite is not finite, and makes `min` so too.
        let usable = min.is_finite() && cell.min.cmple(cell.max).all();
        // The inset rounds, and may invert a box that is flat or a point.
        usable.then(|| Self { min: min.min(max), max: min.max(max), origin, planes: &cell.planes })
    }

    fn contains(&self, p: DVec3) -> bool {
        self.planes.iter().all(|plane| plane.signed_distance(p + self.origin) >= 0.0)
    }

    /// Returns the point at the fractions `part`, from 0 to 1, of the box along each axis. `None` if the
    /// point is outside one of the viewcell's planes.
    pub(super) fn at(&self, part: DVec3) -> Option<DVec3> {
        let p = (self.min + (self.max - self.min) * part).clamp(self.min, self.max);
        self.contains(p).then_some(p)
    }

    /// Returns a random viewpoint, with probability 1/2 on a side of the box. `None` if the planes leave too
    /// little of the box for the tries.
    pub(super) fn random(&self, random: &mut Random) -> Option<DVec3> {
        (0..TRIES).find_map(|_| {
            let mut part = random.point();
            let side = random.below(12);
            if side < 6 {
                part[side % 3] = (side / 3) as f64;
            }
            self.at(part)
        })
    }

    /// Returns a random viewpoint on the line from `x` through `gap`, at or beyond `gap`. `None` if that part
    /// of the line misses the viewcell.
    pub(super) fn on_line(&self, x: DVec3, gap: DVec3, random: &mut Random) -> Option<DVec3> {
        let along = gap - x;
        let (mut least, mut most) = (1.0f64, f64::INFINITY);
        for axis in 0..3 {
            if along[axis] == 0.0 {
                if x[axis] < self.min[axis] || x[axis] > self.max[axis] {
                    return None;
                }
                continue;
            }
            let ends = [self.min[axis], self.max[axis]].map(|side| (side - x[axis]) / along[axis]);
            least = least.max(ends[0].min(ends[1]));
            most = most.min(ends[0].max(ends[1]));
        }
        if !(least <= most && most.is_finite()) {
            return None;
        }
        let p = (x + along * (least + (most - least) * random.unit())).clamp(self.min, self.max);
        self.contains(p).then_some(p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn eyes(cell: &Viewcell) -> Option<Eyes<'_>> {
        Eyes::new(cell, DVec3::ZERO)
    }

    #[test]
    fn viewcells_have_eyes_if_they_are_finite_and_not_inverted() {
        let (low, high) = (DVec3::new(-1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0));
        let mut random = Random(3);
        for axis in 0..3 {
            let (mut flat, mut beyond) = (high, low);
            flat[axis] = low[axis];
            beyond[axis] = f64::INFINITY;
            let cell = Viewcell::from_box(low, flat);
            let eye = eyes(&cell).unwrap().random(&mut random).unwrap();
            assert!(cell.contains(eye), "an eye at {eye} of a viewcell that is flat across axis {axis}");
            assert!(eyes(&Viewcell::from_box(low, beyond)).is_none(), "no end along axis {axis}");
            assert!(eyes(&Viewcell::from_box(-beyond, high)).is_none(), "no beginning along axis {axis}");
            let mut cell = Viewcell::from_box(low, high);
            cell.max[axis] = low[axis] - 1.0;
            assert!(eyes(&cell).is_none(), "inverted along axis {axis}");
        }
        let point = Viewcell::from_box(DVec3::splat(0.1), DVec3::splat(0.1));
        assert_eq!(eyes(&point).unwrap().at(DVec3::ONE), Some(point.min), "the eye of a point");
    }

    /// Eyes are on the side of each plane that its normal points to, also of a moved origin.
    #[test]
    fn eyes_are_within_the_planes_of_a_viewcell() {
        let mut cell = Viewcell::from_box(DVec3::splat(10.0), DVec3::splat(14.0));
        cell.planes.push(Plane::new(DVec3::X, -12.0));
        let eyes = Eyes::new(&cell, DVec3::splat(8.0)).unwrap();
        let mut random = Random(6);
        for _ in 0..200 {
            let eye = eyes.random(&mut random).unwrap() + 8.0;
            assert!(cell.contains(eye) && eye.x >= 12.0, "{eye} is beyond the plane");
        }
        assert_eq!(eyes.at(DVec3::new(0.4, 0.5, 0.5)), None, "a point before the plane");
        let gap = DVec3::new(3.0, 4.0, 4.0);
        assert_eq!(eyes.on_line(gap.with_y(20.0), gap, &mut random), None, "a line before the plane");
    }

    /// Eyes on a line are in the viewcell, on the line, at the gap or beyond it.
    #[test]
    fn eyes_on_a_line_are_beyond_the_gap_and_in_the_viewcell() {
        let (low, high) = (DVec3::new(-1.0, -2.0, -3.0), DVec3::new(3.0, 2.0, 1.0));
        let cell = Viewcell::from_box(low, high);
        let eyes = eyes(&cell).unwrap();
        let (mut random, mut points) = (Random(4), visibility_testing::Random(5));
        let (mut found, mut missed) = (0, 0);
        for round in 0..1000 {
            let x = points.vector(9.0);
            let aim = points.vector(3.0);
            let mut gap = x + (aim - x) * random.unit() * 1.2;
            let flat = random.below(6);
            if flat < 3 {
                gap[flat] = x[flat];
            }
            let along = gap - x;
            // The parameters of the line in the viewcell, by sampling.
            let is_inside = |t: f64| {
                let p = x + along * t;
                p.cmpge(low + 0.01).all() && p.cmple(high - 0.01).all()
            };
            let is_crossed = (0..1500u16).any(|i| is_inside(1.0 + f64::from(i) * 0.015));
            match eyes.on_line(x, gap, &mut random) {
                Some(eye) => {
                    found += 1;
                    assert!(cell.contains(eye), "{round}: {eye} is in the viewcell");
                    let t = (eye - x).dot(along) / along.length_squared();
                    assert!(t >= 1.0 - 1e-5, "{round}: {eye} is before the gap");
                    assert!((x + along * t).distance(eye) < 1e-5, "{round}: {eye} is beside the line");
                }
                None => {
                    missed += 1;
                    assert!(!is_crossed, "{round}: the line from {x} through {gap} crosses the viewcell");
                }
            }
        }
        assert!(found > 100 && missed > 100, "{found} {missed}");
        let [x, gap] = [9.0, 6.0].map(|y| DVec3::new(high.x, y, 0.0));
        assert_eq!(eyes.on_line(x, gap, &mut random), None, "a line along a side, outside of the inset");
        let [x, gap] = [9.0, 6.0].map(|y| DVec3::new(eyes.max.x, y, 0.0));
        assert!(eyes.on_line(x, gap, &mut random).is_some(), "a line along the inset");
        let [x, gap] = [9.0, 6.0].map(|y| DVec3::new(eyes.min.x, y, 0.0));
        assert!(eyes.on_line(x, gap, &mut random).is_some(), "a line along the inset, at the least corner");
        assert_eq!(
            eyes.on_line(DVec3::ZERO, DVec3::ZERO, &mut random),
            None,
            "no direction, in the viewcell"
        );
        assert_eq!(eyes.on_line(low, low, &mut random), None, "no direction, outside of the inset");
    }
}
