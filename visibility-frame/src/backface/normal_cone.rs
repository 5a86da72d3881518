//! The normal cone: a bound on the eyes that see only back faces of a cluster of triangles.

use super::facing::Facing;
use super::fit::{Doubt, Facet, Fit, SLACK, Surface, fit};
use super::split_eye::{NUMBERS, SplitEye, inside};
use alloc::vec::Vec;
use visibility_core::glam::{DAffine3, DVec3};
use visibility_core::{scene::Triangle, view::Eye};

/// A conservative bound on the eyes that see only back faces of a set of triangles, and on the eyes that see
/// only front faces.
///
/// The cone has an apex, so that it is valid for eyes at any distance, and an elliptic cross-section: see the
/// [module](crate::backface). An *open* cone decides nothing. A cone is open if no axis is within 83 degrees
/// of all normals. Coordinates are those of the triangles. Size: 64 bytes.
///
/// # Representation
/// Let `v` be the eye minus the apex `behind`, and `w` the product of the matrix `rows` with `v`. The eye
/// sees only back faces if `w.z + |(w.x, w.y)| < 0`, by a margin that covers rounding. It sees only front
/// faces if the same holds with `v` the apex `ahead` minus the eye. Eyes that satisfy neither are undecided.
///
/// ```
/// use visibility_frame::backface::{Facing, NormalCone};
/// use visibility_core::{glam::{DVec3, Vec3}, view::Eye};
/// // Two slopes of a roof.
/// let (a, b, ridge) = (Vec3::new(-1.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 1.0));
/// let back = Vec3::new(0.0, 5.0, 0.0);
/// let roof = NormalCone::from_triangles(&[[a, ridge, a + back], [b, b + back, ridge]]);
/// assert_eq!(roof.facing(&Eye::Point(DVec3::new(0.0, 2.0, -9.0))), Facing::Back);
/// assert_eq!(roof.facing(&Eye::Point(DVec3::new(0.0, 2.0, 9.0))), Facing::Front);
/// assert_eq!(roof.facing(&Eye::Point(DVec3::new(9.0, 2.0, 0.0))), Facing::Undecided);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct NormalCone {
    /// Matrix that is applied to the eye's offset from an apex, row by row; see the type.
    pub(super) rows: [[f32; 3]; 3],
    /// Apex of the cone of eyes that see only back faces.
    pub(super) behind: [f32; 3],
    /// Apex of the cone of eyes that see only front faces.
    pub(super) ahead: [f32; 3],
    /// Factor of the rounding margin: `32u` times the greatest element of `rows`, with `u = 2^-24`; see
    /// [`inside`]. 0 for an open cone, which decides nothing.
    pub(super) margin: f32,
}

impl Default for NormalCone {
    fn default() -> Self {
        Self::OPEN
    }
}

/// Number of corners of the regular polygon that replaces a cone's ellipse in [`NormalCone::transformed`].
/// The polygon is 2 % wider than the ellipse.
const CORNERS: usize = 16;

impl NormalCone {
    /// The open cone: every eye is undecided.
    pub const OPEN: Self = Self { rows: [[0.0; 3]; 3], behind: [0.0; 3], ahead: [0.0; 3], margin: 0.0 };

    /// Returns the cone of a set of triangles. Triangles of exactly zero area are never seen and are ignored.
    /// The cone is open if there are no triangles, if a triangle is not finite or too thin for its normal to
    /// be certain, or if some normal would deviate from the cone's axis by more than 83 degrees.
    ///
    /// Cost: some 0.5 microseconds a triangle.
    pub fn from_triangles<'a>(triangles: impl IntoIterator<Item = &'a Triangle>) -> Self {
        let mut facets = Vec::new();
        for triangle in triangles {
            match Surface::of(triangle) {
                Surface::Facet(facet) => facets.push(facet),
                Surface::Nothing => {}
                Surface::Unknown => return Self::OPEN,
            }
        }
        Self::new(fit(&facets, Doubt::MIN))
    }

    pub(super) fn new(fit: Option<Fit>) -> Self {
        let Some(Fit { rows, behind, ahead, size }) = fit else { return Self::OPEN };
        // Lengths are measured in units of the cluster's size, so that squares stay in the range of `f32` at
        // any scale.
        let exponent = (size.to_bits() >> 52) as i64 - 1023;
        let scale = f64::from_bits(((1023 - exponent.clamp(-90, 90)) as u64) << 52);
        let greatest = rows.iter().map(|row| row.abs().max_element()).fold(0.0, f64::max);
        Self {
            rows: rows.map(|row| (row * scale).as_vec3().to_array()),
            behind,
            ahead,
            // 2^-19, that is 32u. The factor `1 + SLACK` rounds upwards.
            margin: (greatest * scale * (1.0 / 524288.0) * (1.0 + SLACK)) as f32,
        }
    }

    /// Tests whether the cone is open: it answers [`Facing::Undecided`] for every eye.
    pub fn is_open(&self) -> bool {
        self.margin == 0.0
    }

    /// Returns the cone of the same triangles under the opposite winding rule: fronts become backs and backs
    /// fronts.
    #[must_use]
    pub fn flipped(&self) -> Self {
        let rows = self.rows.map(|row| row.map(|x| -x));
        Self { rows, behind: self.ahead, ahead: self.behind, margin: self.margin }
    }

    /// Returns the side that the eye sees of all triangles: `Back` or `Front` if certain for every triangle,
    /// otherwise `Undecided`. The eye is in the coordinates of the triangles.
    ///
    /// Cost: some 20 ns. [`Cones`](super::Cones) test 64 cones in that time.
    pub fn facing(&self, eye: &Eye) -> Facing {
        let eye = SplitEye::new(eye);
        if self.holds(&eye) {
            Facing::Back
        } else if self.flipped().holds(&eye) {
            Facing::Front
        } else {
            Facing::Undecided
        }
    }

    /// Returns the numbers of the cone that decide whether an eye sees only backs, in the order of
    /// [`inside`]: rows, apex `behind`, margin. The apex `ahead` is not among them.
    pub(super) fn numbers(&self) -> [f32; NUMBERS] {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.rows;
        let [x, y, z] = self.behind;
        [a, b, c, d, e, f, g, h, i, x, y, z, self.margin]
    }

    fn holds(&self, eye: &SplitEye) -> bool {
        let numbers = self.numbers().map(|number| [number]);
        inside::<1>(numbers.each_ref(), eye)[0] < 0.0
    }

    /// Returns 16 facets that represent this cone in the fit of another cone. An eye behind all 16 planes
    /// through the apex `behind` is certain to see only backs. An eye in front of all 16 planes through the
    /// apex `ahead` is certain to see only fronts.
    fn facets(&self) -> impl Iterator<Item = Facet> {
        // The cone holds every eye that is behind all planes with normals `rows[2] + cos(a) rows[0] + sin(a)
        // rows[1]`, for all angles `a`. The rows were rounded by up to `6u` of the greatest element, which is
        // at most 16 times as long as the part of these normals along the axis: 96u, less than `SLACK`. A
        // polygon around the ellipse of normals suffices: an eye behind the planes of its corners is behind
        // all planes.
        const COSINES: [f64; 5] =
            [1.0, 0.923_879_532_511_286_7, core::f64::consts::FRAC_1_SQRT_2, 0.382_683_432_365_089_8, 0.0];
        // The corners are moved outwards by slightly more than one over the cosine of half the angle between
        // corners.
        const OUT: f64 = 1.019_591_2;
        let [x, y, z] = self.rows.map(|row| DVec3::from_array(row.map(f64::from)));
        let points = [self.behind, self.ahead].map(|p| DVec3::from_array(p.map(f64::from)));
        // Rows are scaled by one over the cluster's extent.
        let extent = 1.0 / z.length();
        (0..CORNERS).map(move |i| {
            let (c, s) = (COSINES[i % 4], COSINES[4 - i % 4]);
            let (c, s) = [(c, s), (-s, c), (-c, -s), (s, -c)][i / 4];
            let normal = z + (x * c + y * s) * OUT;
            Facet { normal: normal / normal.length(), points, extent }
        })
    }

    /// Returns the cone of the triangles after an affine transform, in the coordinates that `transform` maps
    /// to. The result is conservative for any scaling or shear.
    ///
    /// A mirroring transform (negative determinant) makes counter-clockwise triangles clockwise: fronts, as
    /// [`Facing`](super::Facing) defines them, become backs. Engines that reverse their winding rule for
    /// mirrored objects, so that the outside stays outside, add [`flipped`](Self::flipped). A transform that
    /// flattens, or is not finite, gives an open cone.
    ///
    /// The result is about 2 % wider than the original, and repeated transforms add up: always transform the
    /// original cone. Cost: some 15 microseconds.
    ///
    /// ```
    /// use visibility_frame::backface::{Facing, NormalCone};
    /// use visibility_core::{glam::{DAffine3, DVec3, Vec3}, view::Eye};
    /// let cone = NormalCone::from_triangles(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    /// let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    /// let above = Eye::Point(DVec3::Z);
    /// assert_eq!(cone.facing(&above), Facing::Front);
    /// assert_eq!(cone.transformed(&mirror).facing(&above), Facing::Back);
    /// assert_eq!(cone.transformed(&mirror).flipped().facing(&above), Facing::Front);
    /// ```
    #[must_use]
    pub fn transformed(&self, transform: &DAffine3) -> Self {
        let facets = self.transformed_facets(transform);
        facets.map_or(Self::OPEN, |(facets, doubt)| Self::new(fit(&facets, doubt)))
    }

    /// Returns the [`facets`](Self::facets) of this cone in the coordinates that `transform` maps to, and
    /// bounds on their errors. `None` for an open cone, and for a transform that flattens or is not finite.
    fn transformed_facets(&self, transform: &DAffine3) -> Option<(Vec<Facet>, Doubt)> {
        if self.is_open() || !transform.is_finite() {
            return None;
        }
        let [x, y, z] = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
        // Normals are transformed by the cofactor matrix. The matrix is first divided by its greatest
        // element, or the cofactors might overflow.
        let greatest = x.abs().max(y.abs()).max(z.abs()).max_element();
        let [a, b, c] = [x / greatest, y / greatest, z / greatest];
        let cofactors = [b.cross(c), c.cross(a), a.cross(b)];
        let determinant = a.dot(cofactors[0]);
        // All elements are at most 1: a cofactor is off by at most 8u, the determinant by at most 40u.
        const U: f64 = f64::EPSILON;
        let flat = determinant.abs() <= 64.0 * U || determinant.is_nan();
        if flat {
            return None;
        }
        let norm = cofactors.map(|row| row.length()).iter().sum::<f64>();
        let mirrored = determinant < 0.0;
        let mut doubt = Doubt::MIN;
        let mut facets = Vec::with_capacity(CORNERS);
        for Facet { normal: n, points, extent } in self.facets() {
            let normal = cofactors[0] * n.x + cofactors[1] * n.y + cofactors[2] * n.z;
            let length = normal.length();
            // The error of the normals, as the cofactors stretch it, plus the rounding of the cofactors
            // themselves.
            doubt.slack = doubt.slack.max((SLACK * norm + 64.0 * U) / length * 1.01 + SLACK * 0.125);
            for p in points {
                let size = greatest * p.abs().element_sum() + transform.translation.abs().max_element();
                doubt.blur = doubt.blur.max(16.0 * U * size);
            }
            // The cofactors of a mirroring transform turn normals inside out, as the transform turns its
            // triangles.
            let points = points.map(|p| transform.transform_point3(p));
            let points = if mirrored { [points[1], points[0]] } else { points };
            facets.push(Facet { normal: normal / length, points, extent: extent * greatest });
        }
        Some((facets, doubt))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::glam::{DMat3, Vec3};
    use visibility_testing::Random;

    /// Returns a random matrix: of any elements, nearly flat, or of lengths that differ.
    fn matrix(random: &mut Random, kind: usize) -> DMat3 {
        let [mut a, mut b, mut c] = [(); 3].map(|()| random.fine_vector(1.0));
        match kind {
            0 => {}
            1 => c = a * 0.7 + b * 0.4 + c * 2f64.powi(-random.between(4, 30)),
            _ => {
                let scale = 2f64.powi(random.between(-9, 9));
                (a, b) = (a * scale, b + a * 2f64.powi(random.between(-3, 3)));
            }
        }
        DMat3::from_cols(a, b, c) * 2f64.powi(random.between(-20, 20))
    }

    /// A flipped cone has the margin of the cone, and the numbers that decide end in it. An eye in the plane
    /// of a triangle is in neither cone.
    #[test]
    fn flipped_cones_keep_the_margin() {
        let cone = NormalCone::from_triangles(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]);
        let flipped = cone.flipped();
        assert!(cone.margin > 0.0 && !cone.is_open(), "{cone:?}");
        assert_eq!([flipped.margin, flipped.numbers()[NUMBERS - 1]], [cone.margin; 2], "{flipped:?}");
        let seen = [0.0, 3.0, -3.0].map(|z| cone.facing(&Eye::Point(DVec3::new(0.2, 0.2, z))));
        assert_eq!(seen, [Facing::Undecided, Facing::Front, Facing::Back], "beside, before and behind");
    }

    /// Facets of a transformed cone, in double-double arithmetic: normals that are off by the slack before
    /// are within the error told after, and so are the apexes.
    #[test]
    fn transformed_facets_are_within_their_errors() {
        let (mut random, mut tight, mut moved) = (Random(61), 0, 0);
        for round in 0..3_000 {
            let size = 2f64.powi(random.between(-4, 12));
            let place = random.vector(size).as_vec3();
            let triangles = [(); 2].map(|()| {
                let flat = random.vec3(-0.3, 0.3);
                [place, place + Vec3::X + flat, place + Vec3::Y + Vec3::Z * flat.x]
            });
            let cone = NormalCone::from_triangles(&triangles);
            let transform =
                DAffine3 { matrix3: matrix(&mut random, round % 3), translation: random.fine_vector(9.0) };
            let Some((facets, doubt)) = cone.transformed_facets(&transform) else { continue };
            let columns = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
            let is_mirrored = transform.matrix3.determinant() < 0.0;
            for (before, after) in cone.facets().zip(&facets) {
                for _ in 0..4 {
                    let off = before.normal + random.direction() * SLACK;
                    // The cofactors times the normal, each component to twice the digits of `f64`.
                    let exact = DVec3::from_array([0, 1, 2].map(|k| {
                        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                        let terms = [0, 1, 2].map(|n| {
                            let (p, q) = (columns[(n + 1) % 3], columns[(n + 2) % 3]);
                            DoubleDouble::product(p[i], q[j])
                                .plus(DoubleDouble::product(p[j], q[i]).negated())
                                .times(off[n].into())
                        });
                        terms[0].plus(terms[1]).plus(terms[2]).hi
                    }));
                    let distance = (exact.normalize() - after.normal).length();
                    assert!(distance <= doubt.slack, "{round}: off by {distance}, {doubt:?}, {transform:?}");
                    tight += u32::from(distance > 0.5 * doubt.slack);
                }
                for side in 0..2 {
                    let p = before.points[if is_mirrored { 1 - side } else { side }];
                    let off = DVec3::from_array([0, 1, 2].map(|k| {
                        let start = DoubleDouble::difference(transform.translation[k], after.points[side][k]);
                        let terms = [0, 1, 2].map(|n| DoubleDouble::product(columns[n][k], p[n]));
                        terms.into_iter().fold(start, DoubleDouble::plus).hi
                    }));
                    let distance = off.length();
                    assert!(
                        distance <= doubt.blur,
                        "{round}: an apex is off by {distance} of {}",
                        doubt.blur
                    );
                    moved += u32::from(distance > 0.0);
                }
            }
        }
        assert!(
            tight > 1_000 && moved > 1_000,
            "{tight} normals off by half of the error, {moved} apexes off"
        );
    }

    /// The sign of a determinant that is made of rounding does not tell which side is the front.
    #[test]
    fn flat_transforms_open_the_cone() {
        let cone =
            NormalCone::from_triangles(&[[Vec3::ZERO, Vec3::new(1.0, 0.1, 0.2), Vec3::new(0.3, 1.0, 0.0)]]);
        let (mut random, mut doubtful) = (Random(62), 0);
        for round in 0..10_000 {
            let mut whole =
                || DVec3::from_array([(); 3].map(|()| f64::from(random.between(-1 << 22, 1 << 22))));
            let (a, b) = (whole(), whole());
            let matrix = DMat3::from_cols(a, b, a + b);
            doubtful += u32::from(matrix.determinant() != 0.0);
            let transform = DAffine3 { matrix3: matrix, translation: DVec3::ZERO };
            assert!(cone.transformed(&transform).is_open(), "{round}: {transform:?}");
        }
        assert!(doubtful > 1_000, "{doubtful} have a determinant that rounding makes");
    }
}
