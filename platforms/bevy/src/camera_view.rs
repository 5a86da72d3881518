//! Conversion of bevy's cameras, frusta and layers to the types of `visibility-core`.
//!
//! Vectors and matrices are converted through arrays, so that bevy and core may use different versions of
//! glam.

use bevy_camera::primitives::Frustum;
use bevy_camera::visibility::RenderLayers;
use bevy_camera::{Camera, Projection};
use bevy_math::Affine3A;
use bevy_shape::ViewFrustum;
use bevy_transform::components::GlobalTransform;
use visibility_core::frustum::ConvexVolume;
use visibility_core::geometry::Plane;
use visibility_core::glam::{self, DMat3, DMat4, DVec3};
use visibility_core::simd::Simd;
use visibility_core::view::{Depth, Eye, ViewError, ViewPlane, ViewProjection, Window};
use visibility_core::{Aabb, Pose, View};

/// Bit of a layer mask that stands for all layers from 31 on. If an object and a view share this bit, their
/// [`RenderLayers`] must be compared.
pub(crate) const OTHER_LAYERS: u32 = 1 << 31;

/// Returns the view of a camera, or of its part named by `sub_camera_view`. The matrix is relative to the
/// camera's position, so that it stays precise far from the origin.
///
/// # Errors
/// Those of [`View::from_clip_from_world`], for a degenerate or non-finite camera.
pub(crate) fn camera_view(
    camera: &Camera,
    projection: &Projection,
    transform: &GlobalTransform,
) -> Result<View, ViewError> {
    let place = transform.affine();
    let view_from_world = DMat3::from_cols_array(&place.matrix3.to_cols_array().map(f64::from)).inverse();
    let clip_from_view = match &camera.sub_camera_view {
        Some(part) => projection.get_clip_from_view_for_sub(part),
        None => projection.get_clip_from_view(),
    };
    let clip_from_view = clip_from_view.to_cols_array().map(f64::from);
    let matrix = DMat4::from_cols_array(&clip_from_view) * DMat4::from_mat3(view_from_world);
    let eye = DVec3::from_array(place.translation.to_array().map(f64::from));
    // Objects beyond the far plane of an orthographic camera are not drawn. bevy's perspective cameras have
    // no far plane.
    let depth = match projection {
        Projection::Orthographic(_) => Depth::Reversed,
        Projection::Perspective(_) | Projection::Custom(_) => Depth::ReversedInfinite,
    };
    View::from_clip_from_world(matrix, depth)?.relative_to(eye)
}

/// Returns whether the fronts of meshes, and the nearest of them, are what the camera draws: by these,
/// occluders hide. A mirrored camera draws the backs, and so does one that inverts culling, but not one that
/// is both. An eye beyond the near plane, as of a mirror seen from behind, has depth the wrong way round.
pub(crate) fn draws_nearest_fronts(camera: &Camera, view: &View) -> bool {
    let projection = ViewProjection::new(view, view.origin());
    let turn = if camera.invert_culling { 1.0 } else { -1.0 };
    let is_parallel = matches!(projection.eye(), Eye::Direction(_));
    projection.orientation() == turn && (is_parallel || projection.near().constant < 0.0)
}

/// Returns a view for cullers that look at its layers alone.
pub(crate) fn any_view() -> View {
    let window = Window::centered(1.0, 1.0);
    let pose = Pose { eye: DVec3::ZERO, forward: DVec3::NEG_Z, up: DVec3::Y, right: DVec3::X };
    View::orthographic(pose, window, 0.0, 1.0).expect("a plain view has no degenerate or infinite part")
}

/// Returns the half-spaces of a frustum as a volume. `with_near` and `with_far` tell whether to include the
/// near and the far plane. Planes that are not finite, as in bevy's frusta without a far plane, are left out.
pub(crate) fn volume(frustum: &Frustum, with_near: bool, with_far: bool) -> ConvexVolume {
    let mut planes = [ViewPlane { plane: Plane::new(DVec3::ZERO, 0.0), error: 0.0 }; 6];
    let mut count = 0;
    for (i, half_space) in frustum.half_spaces.iter().enumerate() {
        let [x, y, z, d] = half_space.normal_d().to_array().map(f64::from);
        let is_wanted = match i {
            ViewFrustum::NEAR_PLANE_IDX => with_near,
            ViewFrustum::FAR_PLANE_IDX => with_far,
            _ => true,
        };
        if is_wanted && half_space.normal_d().is_finite() {
            planes[count].plane = Plane::new(DVec3::new(x, y, z), d);
            count += 1;
        }
    }
    ConvexVolume::new(Simd::best(), &planes[..count])
}

/// Returns the layer mask of an entity or a view: bits 0 to 30 for the layers with these numbers, and
/// [`OTHER_LAYERS`]. Layer 0 if the component is absent.
pub(crate) fn layer_mask(layers: Option<&RenderLayers>) -> u32 {
    let Some(layers) = layers else { return 1 };
    let bits = layers.bits();
    let first = bits.first().map_or(0, |&word| word);
    let has_others = first >> 31 != 0 || bits.iter().skip(1).any(|&word| word != 0);
    first as u32 & !OTHER_LAYERS | if has_others { OTHER_LAYERS } else { 0 }
}

/// Converts a transform from bevy to core.
#[inline]
pub(crate) fn affine(transform: &Affine3A) -> glam::Affine3A {
    // Converts coordinate by coordinate, in registers. Going through one array would cost a store and a load.
    let vector = |v: bevy_math::Vec3A| glam::Vec3A::new(v.x, v.y, v.z);
    let [x, y, z] = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
    let matrix3 = glam::Mat3A::from_cols(vector(x), vector(y), vector(z));
    glam::Affine3A { matrix3, translation: vector(transform.translation) }
}

/// Greatest distance of a side of a mesh from where its `Aabb` has it, as a share of the sum of half extent
/// and distance of the centre from the origin, along each axis. bevy rounds centre and half extent to
/// nearest, by 2^-24 of that sum together; the difference and the margin below are rounded by as much again.
/// A half extent of 0 is exact, and so is the centre beside it.
const BOX_ROUNDING: f32 = 1.0 / (1 << 22) as f32;

/// Returns the half extents of an `Aabb` less and more what its rounding may make of a mesh's box.
#[inline]
fn half_extents(aabb: &bevy_camera::primitives::Aabb) -> [bevy_math::Vec3A; 2] {
    let half = aabb.half_extents;
    let margin = (aabb.center.abs() + half) * BOX_ROUNDING;
    let margin = bevy_math::Vec3A::select(half.cmpeq(bevy_math::Vec3A::ZERO), half, margin);
    [half - margin, half + margin]
}

/// Returns the box of an `Aabb` with given half extents, inverted where these are below 0.
#[inline]
fn box_of(aabb: &bevy_camera::primitives::Aabb, half: bevy_math::Vec3A) -> Aabb {
    let vector = |v: bevy_math::Vec3A| glam::Vec3::new(v.x, v.y, v.z);
    Aabb::new(vector(aabb.center - half), vector(aabb.center + half))
}

/// Converts a local box from bevy to core: contains the box of the mesh, which bevy has rounded.
#[inline]
pub(crate) fn local_box(aabb: &bevy_camera::primitives::Aabb) -> Aabb {
    let [_, outer] = half_extents(aabb);
    box_of(aabb, outer)
}

/// Returns a box that is contained in the box of the mesh. `None` if its sides are nearer than rounding
/// tells.
pub(crate) fn solid_box(aabb: &bevy_camera::primitives::Aabb) -> Option<Aabb> {
    let [inner, _] = half_extents(aabb);
    Some(box_of(aabb, inner)).filter(Aabb::is_proper)
}

/// Returns the world box around a local box.
#[inline]
pub(crate) fn world_box(aabb: &bevy_camera::primitives::Aabb, transform: &Affine3A) -> Aabb {
    local_box(aabb).transformed(&affine(transform))
}
