//! How solid what lies before a cell is, and so how likely it hides the cell.

use crate::sight::Sight;
use crate::{Face, Tessellation};
use visibility_core::Eye;
use visibility_core::glam::{DVec3, Vec2, Vec3};

/// How the solidity of cells in the front is estimated, and handed on from a cell to those behind it.
///
/// ```
/// use visibility_plp::Solidity;
/// assert_eq!(Solidity::default(), Solidity::Coverage);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Solidity {
    /// What light from the eye would not reach: each cell stops as much of it as its content covers of the cell, seen from the eye, and hands
    /// the rest on through its far faces, to each by the share that the face has of the next cell as seen from the eye. The transfer
    /// `v . n` of the paper's figure 5, so weighed that shares add up to one, with what came through several faces added up; a cell that
    /// is reached otherwise than along lines of sight gets little light by itself, and needs no penalty. What a cell holds waits for its turn
    /// in layers: what is small, seen at a slant, or has something close before it shows less for its cost with as much light.
    ///
    /// The paper names normals of the content as future work: how much it covers seen along each axis stands for them.
    #[default]
    Coverage,
    /// The paper's own (Klosowski and Silva, "The Prioritized-Layered Projection Algorithm for Visible Set Estimation", 2000, figure 5):
    /// `|A| / rho_max + (v . n) rho_A`, doubled, with a constant added, for cells not star-shaped to the eye. From the face last crossed
    /// alone.
    Count,
}

/// What the penalty for cells that are not star-shaped adds to twice their solidity. The paper leaves it open.
const PENALTY: f32 = 0.05;

/// The solid angle, in steradians, of a primitive that is worth half of its light: three pixels across, of a thousand across a radian.
const LARGE: f32 = 1e-5;

/// A cell that is handed on from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct From {
    pub(crate) cell: u32,
    /// Unit direction of sight to its centre.
    pub(crate) direction: DVec3,
    /// The light that reaches it, from 0 to 1, or its solidity by [`Solidity::Count`].
    pub(crate) value: f32,
}

/// The share of light along a direction that the content of a cell stops.
#[inline]
pub(crate) fn stopped(cover: [f64; 3], direction: DVec3) -> f64 {
    let d = direction.abs();
    let sum = d.x + d.y + d.z;
    if sum > 0.0 { (d.x * cover[0] + d.y * cover[1] + d.z * cover[2]) / sum } else { 0.0 }
}

/// The share of a cell's light that comes through a face of the cell before it, by the cell's area seen along the light's direction, and the
/// normal and area of the face.
#[inline]
pub(crate) fn share(whole: f64, direction: DVec3, normal: DVec3, area: f64) -> f64 {
    let across = normal.dot(direction);
    if across > 0.0 && whole > 0.0 { (across * area / whole).min(1.0) } else { 0.0 }
}

/// The solid angle that a square metre takes up on average, turned every way, at a cell of that area seen from the eye.
#[inline]
pub(crate) fn nearness(sight: &Sight, center: DVec3, area: f64) -> f32 {
    match sight.eye {
        // No nearer than the cell's own size.
        Eye::Point(eye) => (0.5 / center.distance_squared(eye).max(area)) as f32,
        // Large and small are no matter of distance.
        Eye::Direction(_) => f32::INFINITY,
    }
}

/// How much of its light a primitive is worth that takes up that solid angle: less where it is small, but always something.
#[inline]
pub(crate) fn worth(angle: f32) -> f32 {
    if angle < f32::MAX { (angle / (angle + LARGE)).max(1e-6) } else { 1.0 }
}

/// The chance that something is seen which so much light reaches. Light is handed on from cell to cell, and where it was thought to be
/// stopped it often was not; its square root counts for as much as what is known of surfaces.
#[inline]
pub(crate) fn chance(light: f32) -> f32 {
    // Without `std` there is no other.
    Vec2::splat(light).sqrt().x
}

/// How much larger than on average a primitive appears that faces along an axis, upwards or downwards, or anywhere, seen along a direction.
pub(crate) fn shown(direction: Vec3, is_around: bool, one_sided: bool) -> [f32; 7] {
    let mut shown = [1.0; 7];
    // About the eye there is no one direction.
    if is_around {
        return shown;
    }
    for (side, shown) in shown.iter_mut().take(6).enumerate() {
        let along = direction[side / 2];
        let toward = if side % 2 == 0 { -along } else { along };
        let toward = if one_sided { toward } else { toward.abs() };
        // Normals of a side are up to half a right angle off its axis.
        *shown = ((toward + SPREAD) * (2.0 / (1.0 + SPREAD))).max(0.02);
    }
    shown
}

/// By how much the cosine to the axis may differ from that to a normal, or nearly.
const SPREAD: f32 = 0.35;

/// The paper's solidity of a cell, from that of the one before it.
pub(crate) fn count_solidity<T: Tessellation + ?Sized>(
    tessellation: &T,
    sight: &Sight,
    from: &From,
    face: &Face,
    center: DVec3,
) -> f32 {
    let content = tessellation.content();
    let filled = f64::from(content.count(from.cell)) / f64::from(content.max_count().max(1));
    let across = face.normal.dot(from.direction).max(0.0);
    let solidity = (filled + across * f64::from(from.value)) as f32;
    if is_star_shaped(tessellation, sight, from.cell, face, center) {
        solidity
    } else {
        2.0 * solidity + PENALTY
    }
}

/// Whether the line of sight to the centre of the next cell goes through the cell before it, just before the face that they share.
fn is_star_shaped<T: Tessellation + ?Sized>(
    tessellation: &T,
    sight: &Sight,
    cell: u32,
    face: &Face,
    center: DVec3,
) -> bool {
    let direction = sight.direction(center);
    let across = face.normal.dot(direction);
    if across <= 0.0 {
        return false;
    }
    // The plane of the face lies between the centres; where it is crossed, the point must still be in the cell before.
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
        let one_sided = shown(Vec3::X, false, true);
        // Along x, what faces against it shows its front, what faces along it its back, and the others their edges.
        assert!(one_sided[1] > 1.5 && one_sided[0] < 0.1 && one_sided[2] < 1.0 && one_sided[6] == 1.0);
        let two_sided = shown(Vec3::X, false, false);
        assert!(two_sided[0] == two_sided[1] && two_sided[0] > two_sided[4]);
        assert_eq!(shown(Vec3::X, true, true), [1.0; 7]);
    }
}
