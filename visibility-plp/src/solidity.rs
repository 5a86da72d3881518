//! Solidity of cells: how likely the content of the cells before them hides them.

use crate::cell_frustum::CellFrustum;
use crate::tessellation::{Face, Tessellation};
use visibility_core::glam::{DVec3, Vec2, Vec3};
use visibility_core::view::Eye;

/// Estimate of the solidity of cells in the front, by which the next cell is chosen: least solid first.
///
/// ```
/// use visibility_plp::Solidity;
/// assert_eq!(Solidity::default(), Solidity::Coverage);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Solidity {
    /// One minus the share of light from the eye that reaches a cell.
    ///
    /// A cell stops the share of its light that its content covers of it, seen from the eye. It passes the
    /// rest on through its far faces; each neighbour receives the share of its own silhouette that the common
    /// face covers. This is the transfer `v . n` of the paper's figure 5, normalised so that the shares of a
    /// cell add up to 1, and summed over faces. A cell that is reached off the lines of sight receives little
    /// light, so there is no penalty. The layers of a cell wait for their turn one by one: what is small,
    /// seen at a slant, or has something close before it is worth less light.
    ///
    /// The paper names normals of the content as future work; the cover along each axis stands for them.
    #[default]
    Coverage,
    /// As published (Klosowski and Silva, "The Prioritized-Layered Projection Algorithm for Visible Set
    /// Estimation", 2000, figure 5): `|A| / rho_max + (v . n) rho_A` from the face last crossed, where `|A|`
    /// is the number of objects in the cell before. Doubled, plus a constant, for cells that are not
    /// star-shaped to the eye.
    Count,
}

/// Added to twice the solidity of cells that are not star-shaped. The paper leaves it open.
const PENALTY: f32 = 0.05;

/// Solid angle, in steradians, of a primitive that is worth half of its light: three pixels across, of a
/// thousand a radian.
const HALF_WORTH_ANGLE: f32 = 1e-5;

/// The cell that a face leads out of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct From {
    pub(crate) cell: u32,
    /// Unit direction of sight to the cell's centre.
    pub(crate) direction: DVec3,
    /// Light that reaches the cell, 0 to 1; or its solidity for [`Solidity::Count`].
    pub(crate) value: f32,
}

/// Share of light along a unit direction that a cell stops, from the shares along x, y and z: their mean,
/// weighted by the direction's components. 0 for a zero direction.
#[inline]
pub(crate) fn stopped_share(cover: [f64; 3], direction: DVec3) -> f64 {
    let d = direction.abs();
    let sum = d.x + d.y + d.z;
    if sum > 0.0 { (d.x * cover[0] + d.y * cover[1] + d.z * cover[2]) / sum } else { 0.0 }
}

/// Share of a cell's silhouette, of area `silhouette` along `direction`, that light enters through a face
/// with the given normal, pointing into the cell, and area. 0 for a face that the light leaves through; at
/// most 1.
#[inline]
pub(crate) fn light_share(silhouette: f64, direction: DVec3, normal: DVec3, area: f64) -> f64 {
    let across = normal.dot(direction);
    if across > 0.0 && silhouette > 0.0 { (across * area / silhouette).min(1.0) } else { 0.0 }
}

/// Mean solid angle, in steradians, of a square metre of surface in a cell, over all orientations.
/// `silhouette` is the cell's area seen from the eye; the distance counts as no less than the cell's size.
/// Infinite for parallel views, where size does not depend on distance.
#[inline]
pub(crate) fn solid_angle_per_area(frustum: &CellFrustum, center: DVec3, silhouette: f64) -> f32 {
    match frustum.eye {
        Eye::Point(eye) => (0.5 / center.distance_squared(eye).max(silhouette)) as f32,
        Eye::Direction(_) => f32::INFINITY,
    }
}

/// Share of its light that a primitive of that solid angle is worth, from 1e-6 to 1. 1 for an infinite angle
/// and for NaN.
#[inline]
pub(crate) fn worth(angle: f32) -> f32 {
    if angle < f32::MAX { (angle / (angle + HALF_WORTH_ANGLE)).max(1e-6) } else { 1.0 }
}

/// Estimated chance that something in a cell is seen, from the light that reaches the cell: the square root.
/// Errors of light add up from cell to cell, so it counts for less than what is known of surfaces.
#[inline]
pub(crate) fn chance(light: f32) -> f32 {
    // Without `std` there is no other square root.
    Vec2::splat(light).sqrt().x
}

/// Factor by which a primitive appears larger than on average, for each of the six axis sides that it may
/// face and, last, for any side. `direction` is the direction of sight to it. All 1 if `is_around`: the eye
/// is in or near the cell, so that there is no one direction. Sides that face away appear small if the scene
/// is drawn `one_sided`.
pub(crate) fn side_factors(direction: Vec3, is_around: bool, one_sided: bool) -> [f32; 7] {
    let mut factors = [1.0; 7];
    if is_around {
        return factors;
    }
    for (side, factor) in factors.iter_mut().take(6).enumerate() {
        let along = direction[side / 2];
        let toward = if side % 2 == 0 { -along } else { along };
        let toward = if one_sided { toward } else { toward.abs() };
        // Normals of a side are up to half a right angle off its axis.
        *factor = ((toward + SPREAD) * (2.0 / (1.0 + SPREAD))).max(0.02);
    }
    factors
}

/// Typical difference between the cosine to a side's axis and the cosine to a normal that faces the side.
const SPREAD: f32 = 0.35;

/// Solidity of a face's neighbour as published, from that of the cell before it. `center` is the neighbour's
/// centre.
pub(crate) fn count_solidity<T: Tessellation + ?Sized>(
    tessellation: &T,
    frustum: &CellFrustum,
    from: &From,
    face: &Face,
    center: DVec3,
) -> f32 {
    let content = tessellation.content();
    let filled = f64::from(content.count(from.cell)) / f64::from(content.max_count().max(1));
    let across = face.normal.dot(from.direction).max(0.0);
    let solidity = (filled + across * f64::from(from.value)) as f32;
    if is_star_shaped(tessellation, frustum, from.cell, face, center) {
        solidity
    } else {
        2.0 * solidity + PENALTY
    }
}

/// Whether the line of sight to the centre of a face's neighbour passes through `cell`, the cell before it,
/// where it meets the plane of the face.
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
    // The plane of the face lies between the centres; where it is crossed, the point must still be in the
    // cell before.
    let bounds = tessellation.cell_bounds(cell);
    let far = DVec3::select(face.normal.cmpge(DVec3::ZERO), bounds.max.as_dvec3(), bounds.min.as_dvec3());
    let distance = face.normal.dot(center - far) / across;
    tessellation.contains(cell, center - direction * distance.max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_faces_the_eye_shows_most() {
        let one_sided = side_factors(Vec3::X, false, true);
        // Along x, what faces against it shows its front, what faces along it its back, and the others their
        // edges.
        assert!(one_sided[1] > 1.5 && one_sided[0] < 0.1 && one_sided[2] < 1.0 && one_sided[6] == 1.0);
        let two_sided = side_factors(Vec3::X, false, false);
        assert!(two_sided[0] == two_sided[1] && two_sided[0] > two_sided[4]);
        assert_eq!(side_factors(Vec3::X, true, true), [1.0; 7]);
    }
}
