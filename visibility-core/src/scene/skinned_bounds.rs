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
