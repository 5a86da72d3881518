//! The six directions out of a viewcell, each with local coordinates.
//!
//! Extended projections onto planes across one of these directions split into two 2D problems, since a ray
//! can be followed along each lateral axis independently (Durand, Drettakis, Thollot and Puech, "Conservative
//! Visibility Preprocessing Using Extended Projections", 2000, sections 3.1 and 4.3).
//!
//! Local coordinates are an affine image of scene coordinates. Affine maps preserve lines, so the axes need
//! not be exactly orthogonal or of unit length. It is enough that the mapped viewcell lies within the box of
//! [`Direction::half`] and [`Direction::depth`].

use super::cell_extent::CellExtent;
use visibility_core::Aabb;
use visibility_core::glam::DVec3;

/// A box around a viewcell along its own axes, relative to the scene's origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellBox {
    /// Rows of the map from scene coordinates to the axes of the box.
    axes: [DVec3; 3],
    /// Centre of the box along `axes`, in metres relative to the scene's origin.
    center: DVec3,
    /// Half the extent of the box along `axes`, in metres.
    half: DVec3,
    /// For each axis of the box: the scene axis (0 to 2) that it equals, and the ends of the viewcell along
    /// it, rounded outwards. `None` if the axis is no scene axis.
    exact: [Option<(usize, [f64; 2])>; 3],
    /// Bound on the error of every local coordinate, in metres; see [`Direction::error`].
    error: f64,
}

impl CellBox {
    /// Encloses a viewcell in a box along `axes`, which have about unit length. `bounds` contains all objects
    /// that can be culled. `None` for a viewcell that is empty, or so large that coordinates overflow.
    pub(crate) fn new(cell: &CellExtent, bounds: &Aabb, axes: [DVec3; 3]) -> Option<Self> {
        let reach = |p: DVec3, q: DVec3| p.abs().max(q.abs()).element_sum();
        let magnitude = reach(cell.min, cell.max) + reach(bounds.min.as_dvec3(), bounds.max.as_dvec3());
        // With u = EPSILON / 2: a row times a point rounds three products and two sums, each of at most the
        // magnitude above. The offset, subtracted below, rounds as much: less than 16 u of the magnitude in
        // all.
        let error = 16.0 * f64::EPSILON * magnitude + f64::MIN_POSITIVE;
        // Subtracting the origin rounds by half an EPSILON of the result. The corners round as other points
        // do.
        let (low, high) = cell.along(axes);
        if !low.cmple(high).all() {
            return None;
        }
        let (center, half) = (low * 0.5 + high * 0.5, (high * 0.5 - low * 0.5) + DVec3::splat(error));
        let exact = axes.map(|row| {
            let axis = (0..3).find(|&axis| row == DVec3::AXES[axis])?;
            Some((axis, cell.ends(axis)))
        });
        error.is_finite().then_some(Self { axes, center, half, exact, error })
    }

    /// Converts a point from scene coordinates to coordinates along the axes of the box, relative to the
    /// box's centre.
    pub(crate) fn to_axes(self, p: DVec3) -> DVec3 {
        DVec3::from_array(self.axes.map(|axis| axis.dot(p))) - self.center
    }

    /// Returns half the extent of the box along its axes.
    pub(crate) fn half(&self) -> DVec3 {
        self.half
    }

    /// Returns a bound, in metres, on the error of coordinates along the box's axes.
    pub(crate) fn error(&self) -> f64 {
        self.error
    }

    /// Returns whether the axes of the box are left-handed.
    pub(crate) fn is_mirrored(&self) -> bool {
        self.axes[0].cross(self.axes[1]).dot(self.axes[2]) < 0.0
    }

    /// Returns direction `index`, 0 to 5: along axis `index % 3` of the box, forwards for indices below 3 and
    /// backwards for others.
    pub(crate) fn direction(&self, index: usize) -> Direction {
        let (outward, a, b) = (index % 3, (index + 1) % 3, (index + 2) % 3);
        let sign = if index < 3 { 1.0 } else { -1.0 };
        Direction {
            rows: [self.axes[a], self.axes[b], self.axes[outward] * sign],
            offset: [self.center[a], self.center[b], self.center[outward] * sign + self.half[outward]],
            half: [self.half[a], self.half[b]],
            exact: [self.exact[a], self.exact[b]],
            depth: 2.0 * self.half[outward],
            error: self.error,
        }
    }
}

/// Local coordinates of one direction: x and y across it, with 0 in the middle of the viewcell, and z along
/// it, with 0 at the front of the viewcell's box. The box extends in z from `-depth` to 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Direction {
    /// Rows of the map from scene coordinates to local ones, before `offset` is subtracted.
    pub(crate) rows: [DVec3; 3],
    pub(crate) offset: [f64; 3],
    /// Half the extent of the viewcell along local x and y, in metres.
    pub(crate) half: [f64; 2],
    /// For local x and local y: the scene axis that it runs along, and the ends of the viewcell along that
    /// axis, relative to the scene's origin and rounded outwards. `None` if it does not run along a scene
    /// axis.
    pub(crate) exact: [Option<(usize, [f64; 2])>; 2],
    /// Extent of the viewcell along local z, in metres.
    pub(crate) depth: f64,
    /// Bound on the error of each local coordinate of a point of the scene, in metres.
    pub(crate) error: f64,
}

/// A box in local coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalBox {
    pub(crate) lo: DVec3,
    pub(crate) hi: DVec3,
}

impl Direction {
    /// Returns the local bounds of a box in scene coordinates, correct up to [`error`](Self::error).
    #[inline]
    pub(crate) fn local_box(&self, bounds: &Aabb) -> LocalBox {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let [x, y, z] = self.rows.map(|row| {
            let (a, b) = (row * min, row * max);
            (a.min(b).element_sum(), a.max(b).element_sum())
        });
        let offset = DVec3::from_array(self.offset);
        LocalBox { lo: DVec3::new(x.0, y.0, z.0) - offset, hi: DVec3::new(x.1, y.1, z.1) - offset }
    }

    /// Returns whether the viewcell is certainly outside a local box whose coordinates have errors up to
    /// `error`.
    pub(crate) fn is_outside(&self, b: &LocalBox, error: f64) -> bool {
        let ends = [self.half[0], self.half[1], 0.0];
        let begins = [-self.half[0], -self.half[1], -self.depth];
        (0..3).any(|axis| b.lo[axis] > ends[axis] + error || b.hi[axis] < begins[axis] - error)
    }

    /// Returns a distance in metres: an object that is at least this far from a plane by its local
    /// coordinates is certainly behind or in front of the plane. Local coordinates are wrong by up to 4
    /// [`error`](Self::error) for occluders and up to 1 `error` for occludees. A plane's own distance is
    /// exact.
    pub(crate) fn guard(&self) -> f64 {
        8.0 * self.error
    }

    /// Returns the greater of the viewcell's half extents along local x and y, in metres.
    pub(crate) fn widest(&self) -> f64 {
        self.half[0].max(self.half[1])
    }

    /// Returns the least and greatest coordinate along lateral axis `lat` (0 or 1), in metres, where rays
    /// from the viewcell through a point meet a plane. `x` is the point's lateral position. `near` and `far`
    /// are the factors that [`beyond`](Self::beyond) returns for the point's depth and the plane.
    #[inline]
    pub(crate) fn spread(&self, x: f64, lat: usize, [near, far]: [f64; 2]) -> [f64; 2] {
        let (a, b) = (x - self.half[lat], x + self.half[lat]);
        [x + (a * near).min(a * far), x + (b * near).max(b * far)]
    }

    /// Returns two factors for [`spread`](Self::spread): one for viewpoints on the front of the cell, one for
    /// those on its back. A factor is the distance from a point at depth `z` to the plane at depth `d`,
    /// divided by the distance from the viewpoint to the point, both along local z.
    #[inline]
    pub(crate) fn beyond(&self, z: f64, d: f64) -> [f64; 2] {
        [(d - z) / z, (d - z) / (z + self.depth)]
    }

    /// Returns the ranges along local x and y, in metres, where rays from the viewcell to a box behind the
    /// plane at `d` meet that plane: the extended projection of an occludee.
    #[inline]
    pub(crate) fn occludee(&self, d: f64, b: &LocalBox) -> [[f64; 2]; 2] {
        // A ray from viewpoint v, at depth w behind the front, to x at depth z meets the plane at v + (x - v)
        // t with t = (d + w) / (z + w). t is least for w = 0 and the far z, and greatest for the near z.
        let (least, most) = (d / b.hi.z, (d + self.depth) / (b.lo.z + self.depth));
        [0, 1].map(|lat| {
            let h = self.half[lat];
            let (low, high) = (b.lo[lat] + h, b.hi[lat] - h);
            [(low * least).min(low * most) - h, (high * least).max(high * most) + h]
        })
    }

    /// Tests whether the box `b` may meet a segment from the viewcell to the box `other`, at a depth between
    /// 0, the front of the viewcell's box, and the least depth of `other`. Both boxes are in local
    /// coordinates. True may also mean undecided. False may be wrong for rays that rounding makes steeper:
    /// the caller then leaves out an occluder.
    pub(crate) fn is_between(&self, b: &LocalBox, other: &LocalBox) -> bool {
        let (near, far) = (b.lo.z.max(0.0), b.hi.z.min(other.lo.z));
        // The ends of the projection are convex functions of the plane's distance, so the greatest are at
        // either plane.
        let (first, last) = (self.occludee(near, other), self.occludee(far, other));
        near <= far
            && (0..2).all(|lat| {
                let (low, high) = (first[lat][0].min(last[lat][0]), first[lat][1].max(last[lat][1]));
                b.lo[lat] <= high + self.guard() && b.hi[lat] >= low - self.guard()
            })
    }

    /// Returns the least width in metres, along lateral axis `lat` (0 or 1), that the projection of an
    /// occludee at depth `z` or more has on the plane at `d`. It is the width of the projection of a point at
    /// depth `z`.
    pub(crate) fn least_width(&self, d: f64, z: f64, lat: usize) -> f64 {
        2.0 * self.half[lat] * (1.0 - d / z)
    }

    /// Returns a range along lateral axis `lat` (0 or 1), in metres, that contains all points of the plane at
    /// depth `d` that a box covers as seen from every viewpoint. Only the part of the box between the depths
    /// `near > 0` and `far <= d` counts. If the range is empty, its end is below its start.
    pub(crate) fn common_view(&self, d: f64, b: &LocalBox, [near, far]: [f64; 2], lat: usize) -> [f64; 2] {
        let (mut left, mut right) = (f64::NEG_INFINITY, f64::INFINITY);
        for w in [0.0, self.depth] {
            let (t, s) = ((d + w) / (near + w), (d + w) / (far + w));
            for v in [-self.half[lat], self.half[lat]] {
                let (low, high) = (b.lo[lat] - v, b.hi[lat] - v);
                left = left.max(v + (low * t).min(low * s));
                right = right.min(v + (high * t).max(high * s));
            }
        }
        [left, right]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::glam::Vec3;
    use visibility_core::pvs::Viewcell;
    use visibility_testing::Random;

    /// Local coordinates of points, and the box that holds the viewcell, are right up to the error that they
    /// have. Compared in double-double numbers.
    #[test]
    fn local_coordinates_are_within_their_error() {
        let mut random = Random(1);
        for trial in 0..4_000 {
            let first = random.direction();
            let second = first.cross(random.direction()).normalize();
            let axes = [first, second, first.cross(second)];
            let far = [1.0, 1e6][trial % 2];
            let (middle, half) = (random.fine_vector(far), random.fine_vector(1.0).abs());
            // Sides at the origin have no magnitude of their own.
            let cell = match trial % 3 {
                0 => Viewcell::from_box(middle - half, middle + half),
                1 => Viewcell::from_box(DVec3::ZERO, middle.abs()),
                _ => Viewcell::from_box(-middle.abs(), DVec3::ZERO),
            };
            let side = [[-1e6f32, 1e6], [0.0, 1e6], [-1e6, 0.0]][trial / 3 % 3];
            let bounds = Aabb::new(Vec3::splat(side[0]), Vec3::splat(side[1]));
            let extent = CellExtent::new(&cell, DVec3::ZERO).unwrap();
            let found = CellBox::new(&extent, &bounds, axes).unwrap();
            // The exact image of a point along an axis of the box, relative to the middle of the box.
            let exact = |axis: usize, p: DVec3| {
                let [x, y, z] = [0, 1, 2].map(|k| DoubleDouble::product(axes[axis][k], p[k]));
                x.plus(y).plus(z).plus(DoubleDouble::from(-found.center[axis]))
            };
            for corner in 0..8 {
                let at = [0, 1, 2].map(|k| if corner >> k & 1 == 0 { cell.min[k] } else { cell.max[k] });
                let at = [0, 1, 2].map(|axis| exact(axis, DVec3::from(at)).hi);
                let is_held = DVec3::from(at).abs().cmple(found.half).all();
                assert!(is_held, "trial {trial}: a corner of the viewcell at {at:?}, {:?}", found.half);
            }
            let point = random.vec3(side[0].into(), side[1].into());
            for index in 0..6 {
                let direction = found.direction(index);
                assert_eq!(direction.error, found.error, "the error of direction {index}");
                let local = direction.local_box(&Aabb::new(point, point)).lo;
                let order = [(index + 1) % 3, (index + 2) % 3, index % 3];
                for (k, axis) in order.into_iter().enumerate() {
                    let at = exact(axis, point.as_dvec3());
                    let back = k == 2 && index >= 3;
                    let at = if back { at.negated() } else { at };
                    let front = if k == 2 { -found.half[axis] } else { 0.0 };
                    let off = at.plus(DoubleDouble::from(front)).plus(DoubleDouble::from(-local[k])).hi.abs();
                    assert!(off <= direction.error, "trial {trial}: off by {off} along {k} of {index}");
                }
            }
        }
    }

    /// A direction of a viewcell of 2 by 2 by 1, whose coordinates are off by 1/64.
    fn direction() -> Direction {
        let rows = [DVec3::X, DVec3::Y, DVec3::Z];
        Direction { rows, offset: [0.0; 3], half: [1.0; 2], exact: [None; 2], depth: 1.0, error: 1.0 / 64.0 }
    }

    #[test]
    fn a_viewcell_is_outside_of_boxes_farther_away_than_the_error() {
        let direction = direction();
        for axis in DVec3::AXES {
            for (by, is_outside) in [(0.0625, false), (0.1, false), (0.125, false), (0.15, true)] {
                let middle = DVec3::new(0.0, 0.0, -0.5);
                let half = DVec3::new(1.0, 1.0, 0.5);
                for sign in [1.0, -1.0] {
                    let at = middle + axis * sign * (half.dot(axis) + by);
                    let b = LocalBox { lo: at, hi: at };
                    assert_eq!(
                        direction.is_outside(&b, 0.125),
                        is_outside,
                        "{by} beside along {axis}, {sign}"
                    );
                }
            }
        }
    }

    /// Boxes beside the way to another box, by less than the margin, may be between.
    #[test]
    fn what_is_between_is_told_up_to_the_margin() {
        let direction = direction();
        let other = LocalBox { lo: DVec3::new(-1.0, -1.0, 8.0), hi: DVec3::new(1.0, 1.0, 9.0) };
        for lat in 0..2 {
            for sign in [1.0, -1.0] {
                for (by, is_between) in [(0.05, true), (0.1, true), (0.125, true), (0.15, false)] {
                    let mut at = DVec3::new(0.0, 0.0, 4.0);
                    at[lat] = sign * (1.0 + by);
                    let b = LocalBox { lo: at, hi: at };
                    assert_eq!(direction.is_between(&b, &other), is_between, "{by} beside along {lat}");
                }
            }
        }
        for (z, is_between) in [(-0.1, false), (0.0, true), (8.0, true), (8.1, false)] {
            let at = DVec3::new(0.0, 0.0, z);
            assert_eq!(
                direction.is_between(&LocalBox { lo: at, hi: at }, &other),
                is_between,
                "a box at {z}"
            );
        }
    }

    /// The position on the plane at depth `d` of the ray from a viewpoint at `v`, `w` behind the front, to a
    /// point at `x` and depth `z`.
    fn arrival([v, w]: [f64; 2], [x, z]: [f64; 2], d: f64) -> f64 {
        (v * (z - d) + x * (d + w)) / (z + w)
    }

    /// Returns the least and the greatest of some numbers.
    fn ends(of: impl Iterator<Item = f64>) -> [f64; 2] {
        of.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    }

    /// Ranges of positions on a plane are those of the rays from the corners of the viewcell to corners of a
    /// box: the outermost where a ray may be, the innermost where all viewpoints see the box.
    #[test]
    fn ranges_on_a_plane_are_those_of_the_outermost_rays() {
        let mut random = Random(5);
        let direction = Direction { half: [1.0, 0.25], ..direction() };
        assert_eq!(direction.widest(), 1.0, "the greater half");
        assert_eq!(Direction { half: [0.25, 1.0], ..direction }.widest(), 1.0, "the greater half");
        let is_close =
            |a: [f64; 2], b: [f64; 2]| (0..2).all(|i| (a[i] - b[i]).abs() <= 1e-12 * (1.0 + b[i].abs()));
        for trial in 0..10_000 {
            let d = random.range(0.5, 9.0);
            let (p, q) = (random.vector(8.0), random.vector(8.0));
            let (lo, hi) = (p.min(q), p.max(q));
            for lat in 0..2 {
                let (h, sides) = (direction.half[lat], [lo[lat], hi[lat]]);
                let eyes = [[-h, 0.0], [h, 0.0], [-h, direction.depth], [h, direction.depth]];
                // A point in front of the plane.
                let (x, z) = (lo[lat], random.range(0.01, 1.0) * d);
                let rays = ends(eyes.into_iter().map(|eye| arrival(eye, [x, z], d)));
                let found = direction.spread(x, lat, direction.beyond(z, d));
                assert!(is_close(found, rays), "trial {trial}: {found:?}, rays to {x} at {z}: {rays:?}");
                // A box behind the plane.
                let depths = [random.range(1.0, 3.0), random.range(3.0, 9.0)].map(|by| by * d);
                let rays = |eye, depths: [f64; 2]| {
                    ends(sides.into_iter().flat_map(|x| depths.map(|z| arrival(eye, [x, z], d))))
                };
                let all = ends(eyes.into_iter().flat_map(|eye| rays(eye, depths)));
                let b = LocalBox { lo: lo.with_z(depths[0]), hi: hi.with_z(depths[1]) };
                let found = direction.occludee(d, &b)[lat];
                assert!(is_close(found, all), "trial {trial}: {found:?}, rays to {b:?}: {all:?}");
                // A box in front of the plane: what all viewpoints see covered lies within the projection
                // from each of them.
                let depths = [random.range(0.01, 0.3), random.range(0.3, 1.0)].map(|by| by * d);
                let common = eyes.into_iter().map(|eye| rays(eye, depths));
                let common = common.fold([f64::NEG_INFINITY, f64::INFINITY], |[low, high], seen| {
                    [low.max(seen[0]), high.min(seen[1])]
                });
                let b = LocalBox { lo: lo.with_z(depths[0]), hi: hi.with_z(depths[1]) };
                let found = direction.common_view(d, &b, depths, lat);
                assert!(is_close(found, common), "trial {trial}: {found:?} of {b:?}, {common:?}");
            }
        }
    }

    /// Points that a segment from the viewcell to a box meets are between, however the box lies beside the
    /// viewcell.
    #[test]
    fn what_segments_meet_is_between() {
        let mut random = Random(6);
        let (direction, mut counts) = (direction(), [0; 2]);
        for trial in 0..20_000 {
            let (p, q) = (random.vector(12.0), random.vector(12.0));
            let other = LocalBox { lo: p.min(q).with_z(8.0), hi: p.max(q).with_z(random.range(8.0, 20.0)) };
            let eye = DVec3::new(random.range(-1.0, 1.0), random.range(-1.0, 1.0), random.range(-1.0, 0.0));
            let part = DVec3::new(random.unit(), random.unit(), random.unit());
            let target = other.lo + (other.hi - other.lo) * part;
            let at = eye + (target - eye) * ((random.range(0.0, 8.0) - eye.z) / (target.z - eye.z));
            let is_between = |at: DVec3| direction.is_between(&LocalBox { lo: at, hi: at }, &other);
            // A post along the depth that holds the point.
            let long = LocalBox { lo: at.with_z(random.range(-1.0, at.z)), hi: at.with_z(9.0) };
            assert!(direction.is_between(&long, &other), "trial {trial}: {long:?} holds {at}, {other:?}");
            assert!(is_between(at), "trial {trial}: {at} on the way from {eye} to {target}");
            counts[usize::from(is_between(random.vector(12.0).with_z(4.0)))] += 1;
        }
        assert!(counts.iter().all(|&count| count > 1_000), "beside and between: {counts:?}");
    }

    #[test]
    fn a_box_tells_its_error() {
        let cell = Viewcell::from_box(-DVec3::ONE, DVec3::ONE);
        let extent = CellExtent::new(&cell, DVec3::ZERO).unwrap();
        let bounds = Aabb::new(Vec3::splat(-9.0), Vec3::splat(9.0));
        let found = CellBox::new(&extent, &bounds, DVec3::AXES).unwrap();
        assert_eq!(CellBox { error: 0.5, ..found }.error(), 0.5, "the error of the box");
    }
}
