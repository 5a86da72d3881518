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
        let usable = min.is_finite() && max.is_finite() && cell.min.cmple(cell.max).all();
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
