//! Solidity of cells: estimates of how likely the objects in earlier cells hide a cell.

use crate::cell_frustum::CellFrustum;
use crate::tessellation::{Face, Tessellation};
use visibility_core::glam::{DVec3, Vec2, Vec3};
use visibility_core::view::Eye;

/// Estimate of a cell's solidity, the likelihood that objects in earlier cells hide the cell. The cell with
/// the least solidity is projected (its objects kept) next.
///
/// ```
/// use visibility_plp::Solidity;
/// assert_eq!(Solidity::default(), Solidity::Coverage);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Solidity {
    /// One minus the transmittance, the estimated share of view rays from the eye that reach a cell
    /// unobstructed.
    ///
    /// The objects of a cell stop a share of the rays that enter the cell, given by how much of the cell's
    /// silhouette the objects cover. The remaining rays leave through the cell's far faces. Each neighbour
    /// receives transmittance in proportion to the share of its own silhouette that the common face covers.
    /// This is the transfer `v . n` of Klosowski and Silva, 2000, figure 5, normalised so that the shares of
    /// a cell add up to 1, and summed over faces. A cell away from the direct view rays receives little
    /// transmittance, so the penalty that the figure adds for cells that are not star-shaped with respect to
    /// the eye is not needed. Groups of similar objects in a cell are projected separately: small objects,
    /// objects seen at a slant and objects with another surface close in front, compared with the eye's
    /// distance, have lower priority. Of these groups, each object is kept in the order of its own size,
    /// slant and distance. In parallel views, size and slant make no difference.
    ///
    /// Instead of the objects' normals, which that paper names as future work, the covered share along each
    /// axis makes the estimate depend on direction.
    #[default]
    Coverage,
    /// As published (Klosowski and Silva, "The Prioritized-Layered Projection Algorithm for Visible Set
    /// Estimation", 2000, figure 5): `|A| / rho_max + (v . n) rho_A` for the face crossed last. `|A|` is the
    /// number of objects in the cell `A` before the face, `rho_A` that cell's solidity, `rho_max` the largest
    /// number of objects in a cell, `v` the direction of view and `n` the face's normal. Doubled, plus a
    /// constant, for cells that are not star-shaped with respect to the eye.
    Count,
}

/// Constant added to twice the solidity of cells that are not star-shaped with respect to the eye. Klosowski
/// and Silva, 2000, leave its value open.
const PENALTY: f32 = 0.05;

/// Solid angle, in steradians, at which the [`priority_factor`] of an object is 1/2: about three by three
/// pixels, at a thousand pixels per radian.
const HALF_PRIORITY_ANGLE: f32 = 1e-5;

/// Cell from which a face leads to a neighbour, with the values from which the neighbour's solidity is
/// computed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SourceCell {
    /// Number of the cell on the near side of the face.
    pub(crate) cell: u32,
    /// Unit direction from the eye to the cell's centre, in scene axes.
    pub(crate) direction: DVec3,
    /// The cell's transmittance (share of view rays that reach the cell, 0 to 1); its solidity with
    /// [`Solidity::Count`].
    pub(crate) transmittance_or_solidity: f32,
}

/// Returns the share of rays along a direction that a cell's objects stop, 0 to 1: the mean of the shares
/// along x, y and z in `cover`, weighted by the absolute components of `direction`. 0 for a zero direction.
#[inline]
pub(crate) fn stopped_share(cover: [f64; 3], direction: DVec3) -> f64 {
    let d = direction.abs();
    let sum = d.x + d.y + d.z;
    if sum > 0.0 { (d.x * cover[0] + d.y * cover[1] + d.z * cover[2]) / sum } else { 0.0 }
}

/// Returns the share of a cell's silhouette through which rays enter by one face, 0 to 1. `silhouette` is the
/// silhouette's area along the unit vector `direction`, and `area` the face's, both in square metres.
/// `normal` is the face's unit normal, pointing into the cell. 0 if the rays leave through the face or run
/// along it.
#[inline]
pub(crate) fn entering_share(silhouette: f64, direction: DVec3, normal: DVec3, area: f64) -> f64 {
    let across = normal.dot(direction).max(0.0);
    if silhouette > 0.0 { (across * area / silhouette).min(1.0) } else { 0.0 }
}

/// Returns the mean solid angle, in steradians, of a square metre of surface in a cell, over all
/// orientations. `center` is the cell's scene-relative centre, and `silhouette` its silhouette's area in
/// square metres, whose square root is the least distance assumed. Infinite for parallel views, where
/// apparent size does not depend on distance.
#[inline]
pub(crate) fn solid_angle_per_area(frustum: &CellFrustum, center: DVec3, silhouette: f64) -> f32 {
    match frustum.eye {
        Eye::Point(eye) => (0.5 / center.distance_squared(eye).max(silhouette)) as f32,
        Eye::Direction(_) => f32::INFINITY,
    }
}

/// Returns the priority factor of an object that covers `angle` steradians: `angle / (angle + 1e-5)`, at
/// least 1e-6. 1 for an infinite angle and for NaN.
#[inline]
pub(crate) fn priority_factor(angle: f32) -> f32 {
    if angle.is_finite() { (angle / (angle + HALF_PRIORITY_ANGLE)).max(1e-6) } else { 1.0 }
}

/// Returns the estimated probability that a surface in view is not hidden by what stands close in front of
/// it, 0 to 1: `openness / (openness + sqrt(distance))`. `openness` is the surface's mean free distance and
/// `distance` the eye's distance from it, both in units of the free distance that counts as an openness of 1.
/// A distance that is infinite or NaN counts as 1. An openness of NaN gives 1.
///
/// A free distance of a metre says nothing against a surface half a metre from the eye, and much against one
/// a hundred metres away. Openness without the distance put far roofs and slopes, which are open, before the
/// walls and the ground around the eye. The free distance along the eye's own line differs from the mean over
/// all lines, so the eye's distance counts by the geometric mean with that of an average eye, which is 1.
#[inline]
pub(crate) fn free_share(openness: f32, distance: f32) -> f32 {
    let distance = if distance.is_finite() { Vec2::splat(distance).sqrt().x } else { 1.0 };
    let share = openness / (openness + distance);
    if share.is_nan() { 1.0 } else { share }
}

/// Returns the estimated probability that some object in a cell is seen, 0 to 1: `transmittance`, the cell's
/// transmittance, to the power of 3/4. Errors of transmittance accumulate from cell to cell, so the power
/// gives transmittance less weight than an object's own size and openness.
#[inline]
pub(crate) fn visibility_chance(transmittance: f32) -> f32 {
    // `sqrt` of f32 needs `std`; glam's vectors have one without.
    let root = Vec2::splat(transmittance).sqrt();
    root.x * root.sqrt().x
}

/// Returns, for each of the six axis sides and last for objects without a side, the factor by which a surface
/// facing that side appears larger than a surface of mean orientation. Side i is twice the axis, plus one
/// towards negative coordinates. `direction` is the unit direction from the eye to the surface. All factors
/// are 1 if `is_around` (the eye is in or near the cell). With `one_sided`, sides that face away from the eye
/// get small factors; without, a side counts alike whether its front or back is seen.
pub(crate) fn side_factors(direction: Vec3, is_around: bool, one_sided: bool) -> [f32; 7] {
    let mut factors = [1.0; 7];
    if is_around {
        return factors;
    }
    for (side, factor) in factors.iter_mut().take(6).enumerate() {
        let along = direction[side / 2];
        let toward = if side % 2 == 0 { -along } else { along };
        let toward = if one_sided { toward } else { toward.abs() };
        // Normals of a side deviate from its axis by up to half a right angle.
        *factor = ((toward + SPREAD) * (2.0 / (1.0 + SPREAD))).max(0.02);
    }
    factors
}

/// Typical difference between the cosine of the view direction to a side's axis and to a normal of that side.
const SPREAD: f32 = 0.35;

/// Returns the solidity of a face's neighbour by the formula of [`Solidity::Count`],
/// from the solidity of the cell `source` on the near side of the face. `center` is the neighbour's
/// scene-relative centre. Cost: proportional to the number of objects in the cell `source`.
pub(crate) fn count_solidity<T: Tessellation + ?Sized>(
    tessellation: &T,
    frustum: &CellFrustum,
    source: &SourceCell,
    face: &Face,
    center: DVec3,
) -> f32 {
    let content = tessellation.content();
    let filled = f64::from(content.count(source.cell)) / f64::from(content.max_count().max(1));
    let across = face.normal.dot(source.direction).max(0.0);
    let solidity = (filled + across * f64::from(source.transmittance_or_solidity)) as f32;
    if is_star_shaped(tessellation, frustum, source.cell, face, center) {
        solidity
    } else {
        2.0 * solidity + PENALTY
    }
}

/// Tests whether the view ray to `center`, the centre of a face's neighbour, lies in `cell` where the ray
/// meets the plane of the face. False if the ray does not cross the face outwards.
fn is_star_shaped<T: Tessellation + ?Sized>(
    tessellation: &T,
    frustum: &CellFrustum,
    cell: u32,
    face: &Face,
    center: DVec3,
) -> bool {
    let direction = frustum.direction(center);
    let across = face.normal.dot(direction);
    if across <= 0.0 {
        return false;
    }
    // The plane of the face lies between the centres. Where the ray meets the plane, its point must be in the
    // cell before the face.
    let bounds = tessellation.cell_bounds(cell);
    let far = DVec3::select(face.normal.cmpge(DVec3::ZERO), bounds.max.as_dvec3(), bounds.min.as_dvec3());
    let distance = face.normal.dot(center - far) / across;
    tessellation.contains(cell, center - direction * distance.max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::octree::{Fineness, OctreeTessellation};
    use visibility_core::{Aabb, Pose, Scene, View};

    #[test]
    fn free_distance_counts_by_the_distance_of_the_eye() {
        // A wall across a street from the eye, before an open roof far away; and the other way round if both
        // are as far.
        assert!(free_share(0.05, 0.001) > free_share(0.5, 0.5), "a near wall and a far roof");
        assert!(free_share(0.05, 0.5) < free_share(0.5, 0.5), "a wall and a roof at one distance");
        assert_eq!(free_share(0.25, 0.0625), 0.5, "the free distance is the root of the eye's distance");
        assert_eq!(free_share(0.25, f32::INFINITY), 0.2, "an eye at infinity is an average eye");
        for (openness, distance) in [(0.0, 0.0), (f32::NAN, 1.0), (0.5, f32::NAN)] {
            let share = free_share(openness, distance);
            assert!((0.0..=1.0).contains(&share), "{openness} {distance}: {share}");
        }
    }

    #[test]
    fn shares_and_factors_keep_within_their_limits() {
        assert_eq!(stopped_share([0.5, 0.25, 1.0], DVec3::new(-0.5, 0.25, 0.25)), 0.5625, "weighted by axis");
        assert_eq!(stopped_share([1.0; 3], DVec3::ZERO), 0.0, "a zero direction");
        let share = |silhouette, along: f64| entering_share(silhouette, DVec3::X, DVec3::X * along, 2.0);
        assert_eq!(share(8.0, 0.5), 0.125, "an eighth of the silhouette");
        assert_eq!(share(8.0, -0.5), 0.0, "a face that rays leave by");
        assert_eq!((share(1.0, 1.0), share(0.0, 1.0)), (1.0, 0.0), "a small silhouette, and one of nothing");
        assert_eq!(priority_factor(HALF_PRIORITY_ANGLE), 0.5, "the middle");
        assert_eq!((priority_factor(1e-30), priority_factor(f32::NAN)), (1e-6, 1.0), "the limits");
        assert_eq!(visibility_chance(0.0625), 0.125, "the power of 3/4");
    }

    /// Two cells beside each other: of eyes behind the first one, the line to the middle of the second one
    /// enters it through the common face if it leaves the first one there.
    #[test]
    fn published_solidity_counts_objects_and_lines_that_miss_the_face() {
        let mut scene = Scene::new();
        scene.insert(Aabb::from_arrays([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]));
        scene.insert(Aabb::from_arrays([-1.0, -1.0, -1.0], [-0.9, -0.9, -0.9]));
        let cells = OctreeTessellation::from_scene(&scene, Fineness { vertices: 1, halvings: 1 });
        let (cell, far) = (cells.locate(DVec3::splat(-0.5)).unwrap(), DVec3::new(0.5, -0.5, -0.5));
        let next = cells.locate(far).unwrap();
        assert_eq!((cells.content().count(cell), cells.content().max_count()), (2, 2), "objects");
        let of = |eye: DVec3, from_far: bool| {
            let view = View::perspective(Pose::look_at(eye, far, DVec3::Z), 1.0, 1.0, 0.1, 100.0).unwrap();
            let frustum = CellFrustum::new(&view, DVec3::ZERO, &cells.bounds());
            let (cell, next) = if from_far { (next, cell) } else { (cell, next) };
            let (mut solidity, center) = (f32::NAN, cells.center(next));
            cells.for_each_face(cell, &|neighbour| neighbour == next, &mut |face| {
                let direction = frustum.direction(cells.center(cell));
                let source = SourceCell { cell, direction, transmittance_or_solidity: 0.25 };
                solidity = count_solidity(&cells, &frustum, &source, face, center);
            });
            solidity
        };
        let along = DVec3::new(-9.0, cells.center(cell).y, cells.center(cell).z);
        assert_eq!(of(along, false), 1.25, "a line through both middles: 2 of 2 objects, and the cell's own");
        assert_eq!(of(along, true), 2.0 * 0.5 + PENALTY, "against the face: 1 of 2 objects, twice, and more");
        let aside = DVec3::new(-0.5, -9.0, -0.5);
        let solidity = of(aside, false);
        assert!(solidity >= 2.0 + PENALTY, "a line beside the face: {solidity}");
    }

    #[test]
    fn what_faces_the_eye_shows_most() {
        let one_sided = side_factors(Vec3::X, false, true);
        // Along x, a surface facing against x shows its front, a surface facing along x its back, and all
        // other surfaces their edges.
        assert!(
            one_sided[1] > 1.5 && one_sided[0] < 0.1 && one_sided[2] < 1.0 && one_sided[6] == 1.0,
            "factors by side, along x, one-sided: {one_sided:?}"
        );
        let two_sided = side_factors(Vec3::X, false, false);
        assert!(
            two_sided[0] == two_sided[1] && two_sided[0] > two_sided[4],
            "factors by side, along x, two-sided: {two_sided:?}"
        );
        assert_eq!(side_factors(Vec3::X, true, true), [1.0; 7], "factors without a direction");
    }
}
