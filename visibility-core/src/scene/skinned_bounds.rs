//! Bounds of skinned meshes in any pose: one box for each bone, around the vertices that the bone moves.
//!
//! Linear blend skinning (Magnenat-Thalmann, Laperriere and Thalmann, "Joint-Dependent Local Deformations
//! for Hand Animation and Object Grasping", 1988) places a vertex `v` at the sum of `w_i M_i v` over its
//! bones. If no weight is negative, that is the sum of the weights times a point in the convex hull of the
//! `M_i v`, and each `M_i v` lies in the transformed box of bone `i`.

use super::ToAffine;
use crate::Aabb;
use alloc::vec::Vec;
use core::fmt;
use glam::Vec3;

/// The boxes of a skinned mesh's bones, from which the bounds of the mesh follow in any pose.
///
/// Made once for a mesh. Each pose then costs one transformed box per bone.
///
/// ```
/// use visibility_core::{glam::{Affine3A, Vec3}, scene::SkinnedBounds};
/// let positions = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]];
/// let joints = [[0, 0], [0, 1], [1, 0]];
/// let weights = [[1.0, 0.0], [0.5, 0.5], [1.0, 0.0]];
/// let arm = SkinnedBounds::new(&positions, &joints, &weights)?;
/// let bounds = arm.bounds(&[Affine3A::IDENTITY, Affine3A::from_translation(Vec3::X)]);
/// assert!(bounds.contains_point(Vec3::new(1.0, 2.0, 0.0)) && bounds.max.x < 1.1);
/// # Ok::<(), visibility_core::scene::SkinError>(())
/// ```
#[derive(Clone, Debug)]
pub struct SkinnedBounds {
    /// Indexed by bone: box of the vertices with a positive weight for the bone, in the mesh's coordinates;
    /// [`Aabb::EMPTY`] for a bone without such vertices.
    bones: Vec<Aabb>,
    /// Least and greatest, over all vertices, of the sum of a vertex's weights, rounded outwards.
    sums: [f32; 2],
    /// Upper bound on the rounding error of a vertex skinned in `f32`, as a fraction of the sum of the
    /// magnitudes of its terms (weight times matrix element times coordinate).
    rounding: f32,
    /// Upper bound on what underflows take off a coordinate of a vertex whose coordinates and weights are at
    /// most 1.
    underflow: f32,
}

/// Why [`SkinnedBounds::new`] failed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum SkinError {
    /// The slices of positions, joints and weights differ in length.
    Lengths,
    /// A weight of this vertex is negative, NaN or infinite.
    Weight(usize),
    /// A coordinate of this vertex is NaN or infinite.
    Position(usize),
}

impl fmt::Display for SkinError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lengths => write!(f, "positions, joints and weights are not equally many"),
            Self::Weight(vertex) => write!(f, "a weight of vertex {vertex} is negative or not finite"),
            Self::Position(vertex) => write!(f, "the position of vertex {vertex} is not finite"),
        }
    }
}

impl core::error::Error for SkinError {}

impl SkinnedBounds {
    /// Computes the boxes of the bones from the vertices of a mesh in its bind pose. `joints` holds `N` bones
    /// for each vertex, by their index, and `weights` the weight of each. A bone with weight 0 is ignored.
    /// Weights need not sum to 1: they are used as they are, as most shaders do.
    ///
    /// # Errors
    /// [`SkinError`] if the slices differ in length, a weight is negative, or a number is not finite.
    pub fn new<const N: usize>(
        positions: &[[f32; 3]],
        joints: &[[u16; N]],
        weights: &[[f32; N]],
    ) -> Result<Self, SkinError> {
        if positions.len() != joints.len() || positions.len() != weights.len() {
            return Err(SkinError::Lengths);
        }
        let mut bones = Vec::new();
        let (mut least, mut greatest) = (f64::INFINITY, 0.0f64);
        for (vertex, ((&position, joints), weights)) in positions.iter().zip(joints).zip(weights).enumerate()
        {
            let position = Vec3::from_array(position);
            if !position.is_finite() {
                return Err(SkinError::Position(vertex));
            }
            if !weights.iter().all(|weight| (0.0..f32::INFINITY).contains(weight)) {
                return Err(SkinError::Weight(vertex));
            }
            for (&joint, _) in joints.iter().zip(weights).filter(|&(_, &weight)| weight > 0.0) {
                let joint = usize::from(joint);
                if joint >= bones.len() {
                    bones.resize(joint + 1, Aabb::EMPTY);
                }
                bones[joint] = bones[joint].union(&Aabb::new(position, position));
            }
            let sum = weights.iter().map(|&weight| f64::from(weight)).sum::<f64>();
            (least, greatest) = (least.min(sum), greatest.max(sum));
        }
        // The step to the neighbouring f32 covers the rounding of the sum in f64 and of the conversion.
        let sums = [(least as f32).next_down().max(0.0), (greatest as f32).next_up()];
        // With u = 2^-24: each term of a vertex skinned in `f32` is a product of weight, coefficient and
        // coordinate, rounded twice. It then goes through at most N + 2 additions, whether matrices or points
        // are blended. The rest of N + 8 covers rounding in `bounds` below and second-order terms.
        let rounding = (N as f32 + 8.0) * 0.5 * f32::EPSILON;
        // Two products of each of the N bones and their sum, on three axes, may each lose the least number.
        Ok(Self { bones, sums, rounding, underflow: (8.0 + 9.0 * N as f32) * f32::MIN_POSITIVE })
    }

    /// Returns a box that certainly contains every vertex of the mesh in a pose, also as computed in `f32`:
    /// local bounds for [`set_local_bounds`](crate::Scene::set_local_bounds), or bounds for
    /// [`set_bounds`](crate::Scene::set_bounds) if the matrices lead to scene coordinates. `bones` holds the
    /// skinning matrix of each bone, from the mesh's bind pose to the pose: the bone's matrix times its
    /// inverse bind matrix.
    ///
    /// The box is improper, so that the object is never culled, if `bones` lacks the matrix of a joint with a
    /// weight, if the image of a bone's box is not finite, or if the mesh has no vertices. A vertex whose
    /// weights sum to 0 is taken to be at the origin, where skinning puts it.
    pub fn bounds<T: ToAffine>(&self, bones: &[T]) -> Aabb {
        let improper = Aabb::new(Vec3::NAN, Vec3::NAN);
        let Some(bones) = bones.get(..self.bones.len()) else { return improper };
        let mut hull = Aabb::EMPTY;
        let (mut size, mut farthest) = (Vec3::ZERO, 0.0f32);
        for (bone, matrix) in self.bones.iter().zip(bones).filter(|(bone, _)| bone.is_proper()) {
            let matrix = matrix.to_affine();
            let image = bone.transformed(&matrix);
            if !image.is_finite() {
                return improper;
            }
            hull = hull.union(&image);
            let corner = bone.min.abs().max(bone.max.abs());
            farthest = farthest.max(corner.max_element());
            let [x, y, z] = [matrix.matrix3.x_axis, matrix.matrix3.y_axis, matrix.matrix3.z_axis]
                .map(|column| Vec3::from(column.abs()));
            let magnitude = x * corner.x + y * corner.y + z * corner.z + Vec3::from(matrix.translation.abs());
            size = size.max(magnitude);
        }
        let [least, greatest] = self.sums;
        if hull == Aabb::EMPTY {
            return if least <= greatest { Aabb::new(Vec3::ZERO, Vec3::ZERO) } else { improper };
        }
        // An underflow of a blended matrix is multiplied by a coordinate.
        let underflow = self.underflow * (1.0 + farthest) * greatest.max(1.0);
        let margin = size * (greatest * self.rounding) + Vec3::splat(underflow);
        Aabb::new(
            (hull.min * least).min(hull.min * greatest) - margin,
            (hull.max * least).max(hull.max * greatest) + margin,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Affine3A, DVec3};
    use visibility_testing::Random;

    fn holds(bounds: &Aabb, p: DVec3) -> bool {
        p.cmpge(bounds.min.as_dvec3()).all() && p.cmple(bounds.max.as_dvec3()).all()
    }

    /// Vertices of two bones, in double precision and as `f32` computes them, with weights of other sums
    /// than 1, in poses in which terms cancel.
    #[test]
    fn vertices_in_poses_are_within_the_bounds() {
        let mut random = Random(31);
        for round in 0..3000 {
            let sums = [random.pick(&[0.5, 1.0]), random.pick(&[1.0, 2.0])];
            let positions = [(); 2].map(|()| random.vec3(-2.0, 2.0));
            let shares = [(); 2].map(|()| random.pick(&[0.0, 0.3, 1.0]) as f32);
            let weights = [0, 1].map(|i| [shares[i] * sums[i], (1.0 - shares[i]) * sums[i]]);
            let skin =
                SkinnedBounds::new(&positions.map(|p| p.to_array()), &[[0u16, 1]; 2], &weights).unwrap();
            let pose = [(); 2].map(|()| {
                let turn =
                    glam::Quat::from_axis_angle(random.direction().as_vec3(), random.unit() as f32 * 3.0);
                Affine3A::from_rotation_translation(turn, random.vec3(-3.0, 3.0))
            });
            let bounds = skin.bounds(&pose);
            for (position, weights) in positions.iter().zip(&weights) {
                let (mut exact, mut rounded) = (DVec3::ZERO, Vec3::ZERO);
                for (matrix, &weight) in pose.iter().zip(weights) {
                    let [x, y, z] = [matrix.matrix3.x_axis, matrix.matrix3.y_axis, matrix.matrix3.z_axis];
                    let p = position.as_dvec3();
                    let at = x.as_dvec3() * p.x + y.as_dvec3() * p.y + z.as_dvec3() * p.z;
                    exact += (at + matrix.translation.as_dvec3()) * f64::from(weight);
                    rounded += matrix.transform_point3(*position) * weight;
                }
                assert!(holds(&bounds, exact), "{round}: {exact} is outside of {bounds:?}");
                assert!(holds(&bounds, rounded.as_dvec3()), "{round}: {rounded} is outside of {bounds:?}");
            }
        }
    }

    /// Sums of many equal terms are all rounded one way; the exact sum is farther from the origin.
    #[test]
    fn sums_of_many_bones_are_within_the_bounds() {
        let mut random = Random(32);
        let mut off = 0;
        for round in 0..300 {
            let weight = random.range(0.8, 1.6) as f32 / 64.0;
            let skin = SkinnedBounds::new(&[[0.0; 3]], &[[0u16; 64]], &[[weight; 64]]).unwrap();
            let pose = [Affine3A::from_translation(random.vec3(1.0, 2.0))];
            let bounds = skin.bounds(&pose);
            let term = pose[0].translation * weight;
            let sum = (0..64).fold(glam::Vec3A::ZERO, |sum, _| sum + term);
            let exact = pose[0].translation.as_dvec3() * (64.0 * f64::from(weight));
            for p in [sum.as_dvec3(), exact] {
                assert!(holds(&bounds, p), "{round}: {p} is outside of {bounds:?}");
            }
            let rounding = f64::from(f32::EPSILON) * 0.5 * exact.x.abs();
            off += usize::from((sum.as_dvec3().x - exact.x).abs() > 8.0 * rounding);
        }
        assert!(off > 10, "{off} sums are off by many roundings");
    }

    #[test]
    fn boxes_and_sums_are_those_of_the_vertices() {
        let positions = [[1.0, 2.0, 3.0], [-4.0, 5.0, 6.0], [9.0, 9.0, 9.0]];
        // The last vertex has no weight for the bone 2, and bone 1 has no vertex.
        let joints = [[0u16, 2], [0, 2], [0, 2]];
        let weights = [[0.25, 0.25], [1.0, 0.5], [1.0, 0.0]];
        let skin = SkinnedBounds::new(&positions, &joints, &weights).unwrap();
        assert_eq!(skin.bones.len(), 3, "bones up to the greatest number");
        assert_eq!(skin.bones[0], Aabb::from_arrays([-4.0, 2.0, 3.0], [9.0; 3]), "all vertices");
        assert_eq!(skin.bones[1], Aabb::EMPTY, "a bone without a vertex");
        assert_eq!(skin.bones[2], Aabb::from_arrays([-4.0, 2.0, 3.0], [1.0, 5.0, 6.0]), "two vertices");
        assert!(skin.sums[0] < 0.5 && skin.sums[0] > 0.4999, "the least sum: {}", skin.sums[0]);
        assert!(skin.sums[1] > 1.5 && skin.sums[1] < 1.5001, "the greatest sum: {}", skin.sums[1]);
        let lengths = |joints: &[[u16; 1]], weights: &[[f32; 1]]| {
            SkinnedBounds::new(&[[0.0; 3]], joints, weights).map(|_| ()).err()
        };
        assert_eq!(lengths(&[[0]; 2], &[[1.0]]), Some(SkinError::Lengths), "two lists of joints");
        assert_eq!(lengths(&[[0]], &[[1.0]; 2]), Some(SkinError::Lengths), "two lists of weights");
        // Vertices of which all weights are 0 are at the origin, whatever the pose; no vertices are nowhere.
        let still = SkinnedBounds::new(&[[7.0; 3]], &[[0u16]], &[[0.0]]).unwrap();
        let bounds = still.bounds(&[Affine3A::from_translation(Vec3::splat(99.0))]);
        assert!(bounds.contains_point(Vec3::ZERO) && bounds.is_finite(), "no weights: {bounds:?}");
        assert_eq!(still.sums[0], 0.0, "a sum of weights is not negative");
        let none = SkinnedBounds::new::<1>(&[], &[], &[]).unwrap();
        assert!(!none.bounds::<Affine3A>(&[]).is_proper(), "no vertices");
    }

    /// Underflows are multiplied by coordinates and weights, and each axis has the rounding of its own terms.
    #[test]
    fn margins_grow_with_coordinates_and_weights() {
        let bounds = |x: f32, weight: f32, scale: f32| {
            let skin = SkinnedBounds::new(&[[x, 0.0, 0.0]], &[[0u16, 0]], &[[weight * 0.5; 2]]).unwrap();
            skin.bounds(&[Affine3A::from_scale(Vec3::splat(scale))])
        };
        for (x, weight) in [(1e30, 1.0), (-1e30, 1.0), (1.0, 1e6), (1e20, 1e6)] {
            let lost = 2.0 * f32::MIN_POSITIVE * weight * f32::max(f32::abs(x), 1.0);
            let own = bounds(x, weight, 0.0);
            assert!(own.min.x <= -lost && own.max.x >= lost, "{x}, {weight}: {own:?} holds {lost}");
        }
        // Two bones: one far away along x, one along y.
        let positions = [[1000.0, 0.0, 0.0], [0.0, 1000.0, 0.0], [0.0; 3]];
        let skin = SkinnedBounds::new(&positions, &[[0u16], [1], [2]], &[[1.0]; 3]).unwrap();
        let own = skin.bounds(&[Affine3A::from_translation(Vec3::ZERO); 3]);
        let rounding = 8.0 * f32::EPSILON * 0.5 * 1000.0;
        assert!(own.min.x < -rounding && own.min.y < -rounding && own.min.z > -rounding, "{own:?}");
        // A bone whose box reaches from the origin to 1000 m: the rounding is that of its greatest corner.
        let skin = SkinnedBounds::new(&[[0.0; 3], [1000.0, 0.0, 0.0]], &[[0u16]; 2], &[[1.0]; 2]).unwrap();
        let own = skin.bounds(&[Affine3A::IDENTITY]);
        assert!(own.max.x > 1000.0 + rounding && own.min.x < -rounding, "{own:?}");
    }
}
