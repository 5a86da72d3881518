//! Fitting a cone to planes: an elliptic cone within the set of eyes that are behind all of the planes.
//!
//! An eye is behind every plane of a cluster exactly if it lies in the intersection of the half-spaces behind
//! the planes. Anchored cones (Shirman and Abi-Ezzi, "The Cone of Normals Technique for Fast Processing of
//! Curved Patches", 1993) bound that polyhedron from within by an apex behind all planes and the directions
//! that point away from every normal. Their cones are circular. The cones here are elliptic, because the
//! normals of man-made objects (pipes, rounded edges, window frames) are spread along arcs.
//!
//! The search for a good axis, ellipse and apex is in plain floating point and proves nothing. The last step
//! scales the ellipse and moves the apex until each plane is satisfied with all possible rounding.
//! Correctness rests on that step alone.

use super::facing::U;
use alloc::vec::Vec;
use visibility_core::glam::{DVec2, DVec3};
use visibility_core::scene::Triangle;

/// Greatest error of a facet's unit normal, as the length of a difference of unit vectors, from all causes:
/// `2^-17`. Covers
/// - the normal of a triangle; a triangle is refused if rounding of its normal may reach half of this bound,
/// - the `f32` rows of a cone from which another cone is made (see `NormalCone::facets`),
/// - the rounding of all `f64` computations in this module, less than `2^-40`.
pub(super) const SLACK: f64 = 1.0 / 131072.0;

/// Least cosine of the angle between a facet's normal and the axis of the fitted cone. Cones wider than 83
/// degrees cull next to nothing (0.4 % of all directions). The limit also bounds the elements of the cone's
/// matrix.
const MIN_COSINE: f64 = 0.12;

/// Least half-axis of an ellipse in the gnomonic plane (the plane at distance 1 along the cone's axis, onto
/// which unit normals are projected from the centre of their sphere): about 0.1 degrees, so that [`SLACK`] is
/// small beside the half-axis.
const MIN_AXIS: f64 = 1.0 / 512.0;

/// A plane in the fit of a cone, in the coordinates of the triangles from which the cone is made. An eye sees
/// only backs if it is behind the planes of all facets, and only fronts if it is in front of the planes of
/// all facets.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Facet {
    /// Unit normal, pointing to the side from which the front of the triangle is seen.
    pub(super) normal: DVec3,
    /// Two points in the facet's plane. The apex of the back-facing cone must be behind the plane through
    /// `points[0]` with this normal; the apex of the front-facing cone must be in front of the plane through
    /// `points[1]`. For a triangle both points are its first corner; for a facet of a cone, the cone's two
    /// apexes.
    pub(super) points: [DVec3; 2],
    /// Approximate extent of the triangle or cluster that the plane stands for, in units of the coordinates.
    pub(super) extent: f64,
}

/// Bounds on the errors of the normals and points of all facets in a fit.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Doubt {
    /// Greatest error of a facet's unit normal, as the length of its difference from the true unit normal.
    pub(super) slack: f64,
    /// Greatest distance of a facet's points from their true positions, in units of the coordinates: 0
    /// unless the facets were transformed.
    pub(super) blur: f64,
}

impl Doubt {
    /// Errors of facets made directly from triangles or cones. A transform of facets can only add to them.
    pub(super) const MIN: Self = Self { slack: SLACK, blur: 0.0 };
}

/// Classification of a triangle for the fit of a cone.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Surface {
    /// The triangle has an area, and its normal is known to within half of [`SLACK`].
    Facet(Facet),
    /// The triangle has exactly zero area: it is invisible from everywhere and is ignored in the fit.
    Nothing,
    /// The triangle is not finite, or so thin that rounding leaves its normal uncertain: the cone must be
    /// open.
    Unknown,
}

impl Surface {
    pub(super) fn of(triangle: &Triangle) -> Self {
        let [a, b, c] = triangle.map(|p| p.as_dvec3());
        if !(a.is_finite() && b.is_finite() && c.is_finite()) {
            return Self::Unknown;
        }
        let (p, q) = (b - a, c - a);
        // Nothing here over- or underflows: differences of `f32` are zero or from 2^-149 to 2^129.
        let cross = p.cross(q);
        let (area, size) = (cross.length(), p.length() * q.length());
        if area == 0.0 {
            // Zero is certain only if no step was rounded: each difference must be exact, and short enough
            // for exact products.
            let exact = [(b, a, p), (c, a, q)].iter().all(|(x, y, d)| {
                (0..3).all(|i| is_exact_difference(x[i], y[i], d[i]) && d[i].to_bits().trailing_zeros() >= 27)
            });
            return if exact { Self::Nothing } else { Self::Unknown };
        }
        // A component of the cross product is two products of differences: off by at most 4u of their
        // magnitudes. Over three components the error is less than 12u |p| |q|.
        if 16.0 * U * size < area * (SLACK / 4.0) {
            Self::Facet(Facet { normal: cross / area, points: [a; 2], extent: p.length().max(q.length()) })
        } else {
            Self::Unknown
        }
    }
}

/// Tests whether `d`, the rounded value of `x - y`, is exact (the error term of Knuth's two-sum is zero).
fn is_exact_difference(x: f64, y: f64, d: f64) -> bool {
    let z = d - x;
    (x - (d - z)) + (-y - z) == 0.0
}

/// A fitted cone in `f64`, in the coordinates of the facets from which it was fitted, before its rows are
/// rounded to `f32`. With `v` the vector from the apex `behind` to an eye, the eye sees only backs if
/// `rows[2] . v + |(rows[0] . v, rows[1] . v)| <= 0`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Fit {
    /// Rows of the cone's matrix. They describe an ellipse around the facets' normals, projected onto the
    /// plane at distance 1 along the cone's axis: the first two rows are its half-axes, the third is the
    /// direction to its centre. No component is greater than 16.
    pub(super) rows: [DVec3; 3],
    /// Apex, in the coordinates of the facets, that is behind the planes of all facets or on them: an eye
    /// there sees all facets from behind or edge-on.
    pub(super) behind: [f32; 3],
    /// Apex, in the coordinates of the facets, that is in front of the planes of all facets or on them: an
    /// eye there sees all facets from the front or edge-on.
    pub(super) ahead: [f32; 3],
    /// Approximate radius of all facets together around the mean of their points, in units of the
    /// coordinates.
    pub(super) size: f64,
}

/// Fits a cone to facets whose errors are at most `doubt`. `None` if there are no facets, if the normals do
/// not fit into a cone of 83 degrees around one axis, if the ellipse would be too wide, if no apex is found,
/// or if `doubt` is too large or NaN. On `None` the caller uses an open cone, which culls nothing.
///
/// Cost: some 0.5 microseconds a facet.
pub(super) fn fit(facets: &[Facet], doubt: Doubt) -> Option<Fit> {
    // The bound derived at `grown` requires `slack <= 1/64`. The comparison also refuses NaN.
    if !(doubt.slack <= 1.0 / 64.0 && doubt.blur >= 0.0) {
        return None;
    }
    let axis = axis(facets)?;
    let (x, y) = axis.any_orthonormal_pair();
    let ellipse = Ellipse::around(&gnomonic(facets, axis, x, y), doubt.slack)?;
    let plane = |v: DVec2| x * v.x + y * v.y;
    let rows = [
        plane(ellipse.direction * ellipse.axes[0]),
        plane(ellipse.direction.perp() * ellipse.axes[1]),
        axis + plane(ellipse.center),
    ];
    let count = facets.len() as f64;
    let center = facets.iter().map(|f| (f.points[0] * 0.5 + f.points[1] * 0.5) / count).sum::<DVec3>();
    let far = |f: &Facet| (f.points[0] - center).abs().max((f.points[1] - center).abs()).max_element();
    let size = facets.iter().map(|f| far(f) + f.extent).fold(0.0, f64::max);
    let apex = |side: usize| Apex { facets, doubt, axis, sides: [x, y], center, size, side }.find();
    Some(Fit { rows, behind: apex(0)?, ahead: apex(1)?, size })
}

/// Returns the unit centre of an approximately smallest circle around the facets' normals on the sphere. Each
/// step moves towards the farthest normal, by ever smaller amounts (Badoiu and Clarkson, "Smaller Core-Sets
/// for Balls", 2003). `None` without facets, if the normals cancel out, or if some normal has a cosine of
/// [`MIN_COSINE`] or less with the centre.
fn axis(facets: &[Facet]) -> Option<DVec3> {
    let mut middle = facets.iter().map(|f| f.normal).sum::<DVec3>().try_normalize()?;
    let (mut best, mut best_cosine) = (middle, f64::NEG_INFINITY);
    for step in 0..64 {
        let direction = middle.try_normalize()?;
        let (mut farthest, mut cosine) = (direction, f64::INFINITY);
        for facet in facets {
            let c = facet.normal.dot(direction);
            if c < cosine {
                (farthest, cosine) = (facet.normal, c);
            }
        }
        if cosine > best_cosine {
            (best, best_cosine) = (direction, cosine);
        }
        middle += (farthest - middle) / f64::from(step + 2);
    }
    (best_cosine > MIN_COSINE).then_some(best)
}

/// Projects the facets' normals onto the gnomonic plane, at distance 1 along `axis`, and returns their
/// coordinates along `x` and `y` there. No coordinate is greater than 9.
fn gnomonic(facets: &[Facet], axis: DVec3, x: DVec3, y: DVec3) -> Vec<DVec2> {
    facets.iter().map(|f| DVec2::new(f.normal.dot(x), f.normal.dot(y)) / f.normal.dot(axis)).collect()
}

#[derive(Clone, Copy, Debug)]
struct Ellipse {
    center: DVec2,
    /// Unit vector along the first half-axis of the ellipse, in coordinates of the gnomonic plane (the plane
    /// at distance 1 along the cone's axis). The second half-axis is perpendicular.
    direction: DVec2,
    axes: [f64; 2],
}

impl Ellipse {
    /// Returns a small ellipse around `points`, the projections of unit normals onto the gnomonic plane (the
    /// plane at distance 1 along the cone's axis). The unit normals may differ from the true ones by `slack`.
    /// Chooses the better of a circle around the origin and the ellipse of least area. `None` if the ellipse
    /// is NaN or too wide: a component of the cone's matrix would exceed 16.
    fn around(points: &[DVec2], slack: f64) -> Option<Self> {
        let circle = Self { center: DVec2::ZERO, direction: DVec2::X, axes: [1.0; 2] }.grown(points, slack);
        let ellipse = Self::least(points).grown(points, slack);
        let best = if ellipse.share() > circle.share() { ellipse } else { circle };
        // The comparison is false for NaN.
        (best.axes[0].max(best.axes[1]) + best.center.length() < 15.0).then_some(best)
    }

    /// Returns the shape of an approximate ellipse of least area around `points`, the projections of unit
    /// normals onto the gnomonic plane (at distance 1 along the cone's axis). The half-axes are those of the
    /// weighted covariance; [`grown`](Self::grown) must scale them until the ellipse contains the points.
    /// Weights of points grow with their distance from the mean (Titterington, "Estimation of Correlation
    /// Coefficients by Ellipsoidal Trimming", 1978).
    fn least(points: &[DVec2]) -> Self {
        let mut weights = alloc::vec![1.0 / points.len() as f64; points.len()];
        let mut moments = Moments::of(points, &weights);
        for _ in 0..32 {
            let [xx, xy, yy] = moments.inverse();
            let mut sum = 0.0;
            for (p, weight) in points.iter().zip(&mut weights) {
                let d = *p - moments.mean;
                // Adding 1 treats the points as points of space with third coordinate 1, for which the method
                // fits ellipsoids around the origin.
                *weight *= 1.0 + (xx * d.x * d.x + 2.0 * xy * d.x * d.y + yy * d.y * d.y);
                sum += *weight;
            }
            weights.iter_mut().for_each(|weight| *weight /= sum);
            moments = Moments::of(points, &weights);
        }
        let Moments { mean, xx, xy, yy } = moments;
        // Eigenvectors of the covariance matrix, without trigonometry: of the two candidate rows, the longer
        // is the eigenvector of the greater eigenvalue.
        let (middle, half) = ((xx + yy) * 0.5, (xx - yy) * 0.5);
        let radius = DVec2::new(half, xy).length();
        let (one, two) = (DVec2::new(half + radius, xy), DVec2::new(xy, radius - half));
        let longer = if one.length_squared() > two.length_squared() { one } else { two };
        let axes = DVec2::new(middle + radius, middle - radius).max(DVec2::ZERO).sqrt().to_array();
        Self { center: mean, direction: longer.normalize_or(DVec2::X), axes }
    }

    /// Returns the ellipse scaled so that it contains `points` and their errors: `points` are the projections
    /// of unit normals onto the gnomonic plane (the plane at distance 1 along the cone's axis), and the true
    /// normals differ from these by at most `slack`.
    ///
    /// Let `c` be the component of a unit normal along the cone's axis and `p` its projection, so that
    /// `c = (1 + |p|^2)^-1/2`. If the normal is off by `slack`, its projection is within
    /// `slack (1 + |p|) / (c - slack)` of `p`. With `c > 0.12` and `slack <= 1/64` this is less than
    /// `2 slack (1 + |p|^2)`.
    fn grown(mut self, points: &[DVec2], slack: f64) -> Self {
        let far = |e: &Self, p: DVec2| {
            let d = p - e.center;
            DVec2::new(d.dot(e.direction) / e.axes[0], d.dot(e.direction.perp()) / e.axes[1]).length()
        };
        self.axes = self.axes.map(|axis| axis.max(1e-9));
        let most = points.iter().map(|&p| far(&self, p)).fold(0.0, f64::max);
        self.axes = self.axes.map(|axis| (axis * most).max(MIN_AXIS));
        let least = self.axes[0].min(self.axes[1]);
        let reach = |p: DVec2| far(&self, p) + 2.0 * slack * (1.0 + p.length_squared()) / least;
        let most = points.iter().map(|&p| reach(p)).fold(0.0, f64::max);
        self.axes = self.axes.map(|axis| axis * most);
        self
    }

    /// Returns a score by which ellipses are compared: it grows with the fraction of directions that the cone
    /// culls. The score is the mean, over directions around the ellipse, of one minus the sine of the cone's
    /// half angle there, divided by one plus the squared distance of the ellipse's centre from the origin.
    fn share(&self) -> f64 {
        // Cosines of odd multiples of 9 degrees: by symmetry, a quarter of the ellipse suffices.
        const COSINES: [f64; 5] = [0.9877, 0.8910, core::f64::consts::FRAC_1_SQRT_2, 0.4540, 0.1564];
        let mut share = 0.0;
        for i in 0..5 {
            let along = DVec2::new(COSINES[i] * self.axes[0], COSINES[4 - i] * self.axes[1]).length();
            share += 1.0 - along / DVec2::new(1.0, along).length();
        }
        share / (1.0 + self.center.length_squared())
    }
}

/// Weighted mean of points in the gnomonic plane, and the elements of their covariance matrix.
#[derive(Clone, Copy, Debug)]
struct Moments {
    mean: DVec2,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Moments {
    fn of(points: &[DVec2], weights: &[f64]) -> Self {
        let mean = points.iter().zip(weights).map(|(&p, &w)| p * w).sum::<DVec2>();
        // A small covariance in every direction keeps the matrix invertible.
        let mut moments = Self { mean, xx: 1e-7, xy: 0.0, yy: 1e-7 };
        for (&p, &w) in points.iter().zip(weights) {
            let d = p - mean;
            moments.xx += w * d.x * d.x;
            moments.xy += w * d.x * d.y;
            moments.yy += w * d.y * d.y;
        }
        moments
    }

    fn inverse(&self) -> [f64; 3] {
        let determinant = self.xx * self.yy - self.xy * self.xy;
        [self.yy / determinant, -self.xy / determinant, self.xx / determinant]
    }
}

/// The search for an apex: a point as close to the planes of all facets as can be found, behind all planes
/// (side 0) or in front of all planes (side 1).
struct Apex<'a> {
    facets: &'a [Facet],
    doubt: Doubt,
    axis: DVec3,
    sides: [DVec3; 2],
    center: DVec3,
    size: f64,
    side: usize,
}

impl Apex<'_> {
    /// Returns how far the point `p` must be moved along the search direction: against the axis to be behind
    /// all planes (side 0), or along the axis to be in front of all planes (side 1), with errors of at most
    /// `doubt`. Negative if `p` may be moved the opposite way. A convex function of `p`; NaN if a plane's
    /// height is NaN.
    fn depth(&self, p: DVec3, doubt: Doubt) -> f64 {
        let sign = if self.side == 0 { 1.0 } else { -1.0 };
        let mut depth = f64::NEG_INFINITY;
        for facet in self.facets {
            let d = p - facet.points[self.side];
            let above = sign * facet.normal.dot(d) + (doubt.slack * d.length() + doubt.blur);
            let along = facet.normal.dot(self.axis);
            if above.is_nan() {
                return f64::NAN;
            }
            depth = if above <= depth * along { depth } else { above / along };
        }
        depth
    }

    /// Returns a starting point for the apex: the point that, for exact facets, has the least `depth`
    /// (distance to be moved) in a square around `center` perpendicular to the axis with half-side `size`, in
    /// the units of the facets' coordinates. Nested golden-section searches over the two coordinates in the
    /// square.
    fn search(&self) -> DVec3 {
        let sign = if self.side == 0 { 1.0 } else { -1.0 };
        // Without errors, the depth is the maximum of functions that are linear in the position on the
        // square.
        let linear = |f: &Facet| {
            let scale = sign / f.normal.dot(self.axis);
            let [x, y] = self.sides.map(|side| f.normal.dot(side) * scale);
            [f.normal.dot(self.center - f.points[self.side]) * scale, x, y]
        };
        let functions: Vec<[f64; 3]> = self.facets.iter().map(linear).collect();
        let depth = |x: f64, y: f64| {
            let greatest = |most: f64, [f, fx, fy]: &[f64; 3]| {
                let value = f + (fx * x + fy * y);
                if value > most { value } else { most }
            };
            functions.iter().fold(f64::NEG_INFINITY, greatest)
        };
        let line = |x: f64| golden(self.size, |y| depth(x, y));
        let (x, _) = golden(self.size, |x| line(x).1);
        let (y, _) = line(x);
        self.center + self.sides[0] * x + self.sides[1] * y
    }

    /// Returns an apex in `f32`, in the coordinates of the facets, that is proved to be behind all planes
    /// (side 0) or in front of them (side 1) for all errors within `doubt`. `None` if the apex overflows
    /// `f32` or 64 attempts fail.
    fn find(&self) -> Option<[f32; 3]> {
        let start = self.search();
        let down = if self.side == 0 { -self.axis } else { self.axis };
        let mut depth = self.depth(start, self.doubt);
        for _ in 0..64 {
            let apex = (start + down * depth).as_vec3();
            if !apex.is_finite() {
                return None;
            }
            let missing = self.depth(apex.as_dvec3(), self.doubt);
            if missing <= 0.0 {
                return Some(apex.to_array());
            }
            // Moves the apex half as far again as needed, and at least as far as rounding to `f32` may have
            // moved it.
            let rounding = f64::from(apex.abs().max_element()) * f64::from(f32::EPSILON);
            depth += missing * 1.5 + rounding * 0.25;
        }
        None
    }
}

/// Minimizes the convex function `value` over arguments from `-reach` to `reach` by golden-section search.
/// Returns the argument of the least value found, and that value. 14 steps narrow the interval to about a
/// thousandth.
fn golden(reach: f64, mut value: impl FnMut(f64) -> f64) -> (f64, f64) {
    const RATIO: f64 = 0.618_033_988_749_894_9;
    let (mut low, mut high) = (-reach, reach);
    let (mut x, mut y) = (high - RATIO * (high - low), low + RATIO * (high - low));
    let (mut at_x, mut at_y) = (value(x), value(y));
    for _ in 0..14 {
        if at_x < at_y {
            (high, y, at_y) = (y, x, at_x);
            x = high - RATIO * (high - low);
            at_x = value(x);
        } else {
            (low, x, at_x) = (x, y, at_y);
            y = low + RATIO * (high - low);
            at_y = value(y);
        }
    }
    if at_x < at_y { (x, at_x) } else { (y, at_y) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Vec3;
    use visibility_testing::Random;

    /// Returns a unit normal within `most` radians of the z axis.
    fn normal(random: &mut Random, most: f64) -> DVec3 {
        let (turn, tilt) = (random.range(0.0, 7.0), most * random.unit());
        DVec3::new(tilt.sin() * turn.cos(), tilt.sin() * turn.sin(), tilt.cos())
    }

    /// Normals that are off by the slack, in any direction, project into the ellipse. Those that are turned
    /// away from the axis move by more than the slack in the gnomonic plane, and by most of what is added.
    #[test]
    fn ellipses_hold_normals_that_are_off_by_the_slack() {
        let mut random = Random(51);
        for round in 0..20_000 {
            let slack = [SLACK, 1.0 / 64.0][round % 2];
            let normals: Vec<DVec3> = (0..1 + round % 3).map(|_| normal(&mut random, 1.44)).collect();
            let points: Vec<DVec2> = normals.iter().map(|n| n.truncate() / n.z).collect();
            let circle = Ellipse { center: DVec2::ZERO, direction: DVec2::X, axes: [1.0; 2] };
            for ellipse in [circle, Ellipse::least(&points)].map(|shape| shape.grown(&points, slack)) {
                for &n in &normals {
                    let away = (n * n.z - DVec3::Z).normalize();
                    let turned = random.direction().cross(n).normalize();
                    for towards in [away, turned] {
                        // Unit vectors whose difference has the length of the slack.
                        let sine = slack * (1.0 - slack * slack / 4.0).sqrt() * (1.0 - 1e-12);
                        let off = n * (1.0 - slack * slack / 2.0) + towards * sine;
                        let d = off.truncate() / off.z - ellipse.center;
                        let [a, b] = ellipse.axes;
                        let share =
                            DVec2::new(d.dot(ellipse.direction) / a, d.dot(ellipse.direction.perp()) / b);
                        assert!(share.length() <= 1.0, "{round}: {off} beside {n}, slack {slack}: {share}");
                    }
                }
            }
        }
    }

    /// No element of a cone's matrix is greater than 16: wider ellipses are refused, whichever axis is long.
    #[test]
    fn wide_ellipses_are_refused() {
        let (mut random, mut refused, mut wide) = (Random(52), 0, 0);
        for round in 0..2_000 {
            let along = normal(&mut random, 9.0).truncate().normalize();
            let points: Vec<DVec2> = (0..6).map(|_| along * random.range(-8.2, 8.2)).collect();
            let slack = SLACK * random.range(1.0, 4.0);
            let Some(ellipse) = Ellipse::around(&points, slack) else {
                refused += 1;
                continue;
            };
            let most = ellipse.axes.into_iter().fold(0.0, f64::max) + ellipse.center.length();
            assert!(most < 15.0, "{round}: {ellipse:?}");
            wide += u32::from(most > 13.0);
        }
        assert!(refused > 50 && wide > 50, "{refused} are refused, {wide} nearly so");
    }

    /// The apex is behind or in front of the planes of all facets, whichever way their normals and points are
    /// off by the errors told.
    #[test]
    fn apexes_are_beyond_planes_that_are_off_by_their_errors() {
        let (mut random, mut near) = (Random(53), 0);
        for round in 0..3_000 {
            let doubt = Doubt {
                slack: [SLACK, 1e-3, 1.0 / 64.0][round % 3],
                blur: if round % 2 == 0 { 0.0 } else { random.range(0.0, 0.1) },
            };
            let size = 2f64.powi(random.between(-4, 8));
            let place = random.vector(size).round();
            let facets: Vec<Facet> = (0..1 + round % 5)
                .map(|_| {
                    let point = (place + random.vector(1.0)).as_vec3().as_dvec3();
                    Facet { normal: normal(&mut random, 1.2), points: [point; 2], extent: 1.0 }
                })
                .collect();
            for side in 0..2 {
                let (axis, sides, center) = (DVec3::Z, [DVec3::X, DVec3::Y], place);
                let apex = Apex { facets: &facets, doubt, axis, sides, center, size: 2.0, side };
                let Some(apex) = apex.find() else { continue };
                let sign = [1.0, -1.0][side];
                let mut highest = f64::NEG_INFINITY;
                for facet in &facets {
                    let d = DVec3::from_array(apex.map(f64::from)) - facet.points[side];
                    let off = facet.normal + sign * d.normalize_or_zero() * doubt.slack;
                    let height = sign * off.dot(d) + doubt.blur;
                    assert!(
                        height <= 1e-15 * d.length(),
                        "{round}, side {side}: {height} above a plane, {doubt:?}"
                    );
                    highest = highest.max(height / (doubt.slack * d.length() + doubt.blur));
                }
                near += u32::from(highest > -0.01);
            }
        }
        assert!(near > 1_000, "{near} apexes are as near to a plane as they may be");
    }

    /// Errors beyond the bound that the growth of ellipses needs, and errors that are unknown, give no cone.
    #[test]
    fn facets_of_great_errors_have_no_cone() {
        let facet = Facet { normal: DVec3::Z, points: [DVec3::ZERO; 2], extent: 1.0 };
        let is_fitted = |slack: f64, blur: f64| fit(&[facet], Doubt { slack, blur }).is_some();
        let slacks = [SLACK, 1.0 / 64.0, 1.0 / 63.0, f64::NAN].map(|slack| is_fitted(slack, 0.0));
        assert_eq!(slacks, [true, true, false, false], "by slack");
        assert_eq!([0.0, 1.0, f64::NAN].map(|blur| is_fitted(SLACK, blur)), [true, true, false], "by blur");
        assert!(fit(&[], Doubt::MIN).is_none(), "no facet");
    }

    /// Slivers whose corners have coordinates of very different magnitudes, so that differences and products
    /// are rounded. The normal in whole numbers of 128 bits is within half of the slack of a facet's.
    #[test]
    fn normals_of_slivers_are_known_or_unknown() {
        const UNIT: f64 = 1.0 / 1_048_576.0;
        let (mut random, mut counts, mut off) = (Random(54), [0; 3], 0);
        for round in 0..200_000 {
            let mut corner =
                |bits: usize, scale: i32| [0; 3].map(|_| random.magnitude(bits) as f64 * 2f64.powi(scale));
            let (few, far) = (1 + round % 24, [8, 24][round / 4 % 2]);
            let a = if round % 16 == 0 { [0.0; 3] } else { corner(few, 4 - few as i32) };
            let p = corner(10, far);
            // A multiple of the first side, and a little beside it or nothing.
            let beside =
                if round % 4 == 0 { [0.0; 3] } else { corner(1 + round % 8, -20 + (round % 28) as i32) };
            let (b, c) = (p, [0, 1, 2].map(|k| 3.0 * p[k] + beside[k]));
            let mut corners = [a, b, c];
            if round % 8 == 5 {
                // A first corner so near the middle of the others that products are equal by rounding alone,
                // and in every other case the differences are.
                let whole = 128 + (round / 16 % 120) as i32;
                let size = [24, 27][round / 8 % 2];
                let p = [0, 1, 2].map(|k: i32| f64::from(whole + k * k) * 2f64.powi(size));
                corners = [[UNIT; 3], p, p.map(|x| -x)];
            }
            let triangle = corners.map(|corner| Vec3::from_array(corner.map(|x| x as f32)));
            let whole = triangle.map(|corner| corner.to_array().map(|x| (f64::from(x) / UNIT) as i128));
            assert_eq!(
                whole.map(|corner| corner.map(|x| (x as f64 * UNIT) as f32)),
                triangle.map(|corner| corner.to_array()),
                "{round}: corners are multiples of the unit"
            );
            let [p, q] = [1, 2].map(|i| [0, 1, 2].map(|k| whole[i][k] - whole[0][k]));
            let cross = [[1, 2], [2, 0], [0, 1]].map(|[i, j]| p[i] * q[j] - p[j] * q[i]);
            let normal = DVec3::from_array(cross.map(|x| x as f64)).normalize_or_zero();
            match Surface::of(&triangle) {
                Surface::Facet(facet) => {
                    counts[0] += 1;
                    let error = (facet.normal - normal).length();
                    assert!(error <= SLACK / 2.0, "{round}: {triangle:?} is off by {error}");
                    off += u32::from(error > SLACK / 2048.0);
                }
                Surface::Nothing => {
                    counts[1] += 1;
                    assert_eq!(cross, [0; 3], "{round}: {triangle:?} counts as nothing");
                }
                Surface::Unknown => counts[2] += 1,
            }
        }
        assert!(counts.iter().all(|&count| count > 1_000), "facets, nothing and unknown: {counts:?}");
        assert!(off > 20, "{off} of {counts:?} normals are off by a thousandth of the bound");
    }

    #[test]
    fn a_plane_that_is_nan_has_no_apex_wherever_it_is_listed() {
        let facet = |height: f64| Facet { normal: DVec3::Z, points: [DVec3::Z * height; 2], extent: 1.0 };
        for (count, nan) in [(1, 0), (3, 0), (3, 1), (3, 2)] {
            for side in 0..2 {
                let mut facets: Vec<Facet> = (0..count).map(|i| facet(f64::from(i))).collect();
                let (axis, sides) = (DVec3::Z, [DVec3::X, DVec3::Y]);
                let apex = |facets: &[Facet]| {
                    let (doubt, center) = (Doubt::MIN, DVec3::ZERO);
                    let apex = Apex { facets, doubt, axis, sides, center, size: 1.0, side };
                    (apex.depth(DVec3::ZERO, Doubt::MIN), apex.find())
                };
                let (depth, found) = apex(&facets);
                assert!(depth.is_finite() && found.is_some(), "side {side} of {count} planes: {depth}");
                facets[nan].points = [DVec3::NAN; 2];
                let (depth, found) = apex(&facets);
                assert!(depth.is_nan() && found.is_none(), "side {side}, plane {nan} of {count}: {depth}");
            }
        }
    }
}
