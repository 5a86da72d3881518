//! Views: the camera in the engine's own depth convention.

use crate::error::{Error, border, vis_status};
use crate::handle::Guarded;
use crate::numbers::finite;
use crate::pointer::{array, buffer, create, destroy, out, reference};
use crate::scene::VIS_ALL_LAYERS;
use vis_depth::*;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;
use visibility_core::view::{ClipMatrix, Depth, Reach, ViewRegion, Window};
use visibility_core::{Pose, View};

/// View: a camera and the layers that it shows. Created once, and set in each frame.
pub struct vis_view(Guarded<State>);

struct State {
    /// Camera of the view; `None` until the caller has set one.
    camera: Option<View>,
    layers: u32,
}

impl vis_view {
    /// Returns the camera as a view of core, or an error if none is set yet.
    pub(crate) fn get(&self) -> Result<View, Error> {
        let no_camera = || Error::new(vis_status::VIS_ERROR_STATE, "the view has no camera yet");
        self.0.read()?.camera.ok_or_else(no_camera)
    }

    /// Sets the camera and the layers, for a view that is the library's own.
    #[cfg(feature = "whole")]
    pub(crate) fn put(&self, camera: View) -> Result<(), Error> {
        *self.0.write()? = State { camera: Some(camera), layers: camera.layers() };
        Ok(())
    }

    fn set(&self, camera: View) -> Result<(), Error> {
        let mut state = self.0.write()?;
        state.camera = Some(camera.with_layers(state.layers));
        Ok(())
    }
}

/// Depth convention of a clip matrix: which clip-space depths z are in view, relative to clip-space w.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum vis_depth {
    /// z is -w at the near plane and w at the far plane: OpenGL.
    VIS_DEPTH_NEGATIVE_ONE_TO_ONE = 0,
    /// z is -w at the near plane; there is no far plane.
    VIS_DEPTH_NEGATIVE_ONE_TO_ONE_INFINITE = 1,
    /// z is 0 at the near plane and w at the far plane: Direct3D, Vulkan, Metal, WebGPU.
    VIS_DEPTH_ZERO_TO_ONE = 2,
    /// z is 0 at the near plane; there is no far plane.
    VIS_DEPTH_ZERO_TO_ONE_INFINITE = 3,
    /// z is w at the near plane and 0 at the far plane.
    VIS_DEPTH_REVERSED = 4,
    /// z is w at the near plane; there is no far plane.
    VIS_DEPTH_REVERSED_INFINITE = 5,
}

const DEPTHS: [(vis_depth, Depth); 6] = [
    (VIS_DEPTH_NEGATIVE_ONE_TO_ONE, Depth::NegativeOneToOne),
    (VIS_DEPTH_NEGATIVE_ONE_TO_ONE_INFINITE, Depth::NegativeOneToOneInfinite),
    (VIS_DEPTH_ZERO_TO_ONE, Depth::ZeroToOne),
    (VIS_DEPTH_ZERO_TO_ONE_INFINITE, Depth::ZeroToOneInfinite),
    (VIS_DEPTH_REVERSED, Depth::Reversed),
    (VIS_DEPTH_REVERSED_INFINITE, Depth::ReversedInfinite),
];

/// Creates a view without a camera, on all layers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_create(view: *mut *mut vis_view) -> vis_status {
    border(|| {
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let place = unsafe { out(view, "view") }?;
        create(place, vis_view(Guarded::new(State { camera: None, layers: VIS_ALL_LAYERS })));
        Ok(())
    })
}

/// Destroys a view. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_destroy(view: *mut vis_view) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(view) }
}

/// Makes a view from a clip matrix, its depth convention (a `vis_depth`) and the 3 coordinates of the point
/// that the matrix is relative to; null for the origin of the world.
fn camera(matrix: impl Into<ClipMatrix>, depth: u32, origin: Option<&[f64; 3]>) -> Result<View, Error> {
    let known = DEPTHS.iter().find(|(number, _)| *number as u32 == depth);
    let &(_, depth) = known.ok_or_else(|| Error::argument(format_args!("{depth} is no vis_depth")))?;
    let view = View::from_clip_from_world(matrix, depth)?;
    Ok(origin.map_or(Ok(view), |&origin| view.relative_to(DVec3::from_array(origin)))?)
}

/// Borrows 3 optional coordinates. `None` for a null pointer.
///
/// # Safety
/// The same as for [`reference`].
pub(crate) unsafe fn optional_point<'a>(
    point: *const f64,
    name: &str,
) -> Result<Option<&'a [f64; 3]>, Error> {
    if point.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller of this function makes the same promise.
    unsafe { reference(point.cast(), name) }.map(Some)
}

/// Sets the camera of a view from the engine's matrix from world to clip space: 16 numbers, column-major.
/// `depth` is the `vis_depth` of the matrix. `origin` is the point of the world that the matrix is relative
/// to (3 coordinates), for engines that draw relative to the camera; null for the origin of the world. The
/// view keeps its layers and loses its clip planes.
///
/// Occlusion culling relies on two conditions that every camera meets and that are not checked: clip-space w
/// does not decrease away from the eye, and the near plane is not behind the eye.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_set_matrix(
    view: *mut vis_view,
    matrix: *const f32,
    depth: u32,
    origin: *const f64,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (view, origin) = unsafe { (reference(view, "view")?, optional_point(origin, "origin")?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 16 numbers.
        let matrix = unsafe { reference(matrix.cast::<[f32; 16]>(), "matrix") }?;
        view.set(camera(*matrix, depth, origin)?)
    })
}

/// Like `vis_view_set_matrix`, for a matrix in double precision.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_set_matrix_f64(
    view: *mut vis_view,
    matrix: *const f64,
    depth: u32,
    origin: *const f64,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (view, origin) = unsafe { (reference(view, "view")?, optional_point(origin, "origin")?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 16 numbers.
        let matrix = unsafe { reference(matrix.cast::<[f64; 16]>(), "matrix") }?;
        view.set(camera(*matrix, depth, origin)?)
    })
}

/// Position and directions of a camera, in world coordinates.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct vis_pose {
    /// Position of the eye.
    pub eye: [f64; 3],
    /// Point that the camera looks at.
    pub target: [f64; 3],
    /// Direction that points upwards in the picture.
    pub up: [f64; 3],
}

impl From<&vis_pose> for Pose {
    fn from(pose: &vis_pose) -> Self {
        let [eye, target, up] = [pose.eye, pose.target, pose.up].map(DVec3::from_array);
        Self::look_at(eye, target, up)
    }
}

/// Sets the camera of a view from its pose and lens, for programs without a matrix. `fov_y` is the vertical
/// field of view in radians, `aspect` width over height, `near_plane` and `far_plane` the distances of the
/// planes; `far_plane` may be infinite. The view keeps its layers and loses its clip planes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_set_perspective(
    view: *mut vis_view,
    pose: *const vis_pose,
    fov_y: f64,
    aspect: f64,
    near_plane: f64,
    far_plane: f64,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (view, pose) = unsafe { (reference(view, "view")?, reference(pose, "pose")?) };
        view.set(View::perspective(pose.into(), fov_y, aspect, near_plane, far_plane)?)
    })
}

/// Sets the camera of a view with parallel lines of sight, for shadow cascades, maps and plans. The picture
/// is `width` by `height` metres around the viewing axis; `near_plane` and `far_plane` are distances from the
/// eye along the axis, and `near_plane` may be negative. The view keeps its layers and loses its clip planes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_set_orthographic(
    view: *mut vis_view,
    pose: *const vis_pose,
    width: f64,
    height: f64,
    near_plane: f64,
    far_plane: f64,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (view, pose) = unsafe { (reference(view, "view")?, reference(pose, "pose")?) };
        let window = Window::centered(width * 0.5, height * 0.5);
        view.set(View::orthographic(pose.into(), window, near_plane, far_plane)?)
    })
}

/// Sets the layers that a view shows, one bit per layer. A change of the camera keeps them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_set_layers(view: *mut vis_view, layers: u32) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let view = unsafe { reference(view, "view") }?;
        let mut state = view.0.write()?;
        state.layers = layers;
        state.camera = state.camera.map(|camera| camera.with_layers(layers));
        Ok(())
    })
}

/// Restricts a view to one side of each of `count` planes, at most 10. A plane has 4 numbers a, b, c, d and
/// keeps the points with a x + b y + c z + d >= 0, relative to the origin of the matrix, or to the eye of a
/// view set from a pose. Replaces earlier planes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_set_clip_planes(
    view: *mut vis_view,
    planes: *const f64,
    count: usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 4 numbers for each of `count`.
        let planes = unsafe { array(planes.cast::<[f64; 4]>(), count, "planes") }?;
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let view = unsafe { reference(view, "view") }?;
        let camera = view.get()?;
        let planes: Vec<Plane> = planes.iter().map(plane).collect();
        view.set(camera.with_clip_planes(&planes)?)
    })
}

/// Writes the matrix of a view, from the world relative to the point `origin` (3 finite coordinates; null for
/// the origin of the world) to clip space, in the depth convention of the view: 16 numbers, column-major. For
/// views that the library makes: those of mirrors.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_matrix(
    view: *const vis_view,
    origin: *const f64,
    matrix: *mut f64,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 numbers of `origin`.
        let (view, origin) = unsafe { (reference(view, "view")?, optional_point(origin, "origin")?) };
        // SAFETY: by rule P2 of `visibility.h`, null or valid to write: 16 numbers.
        let mut place = unsafe { out(matrix.cast::<[f64; 16]>(), "matrix") }?;
        let origin = finite(origin.unwrap_or(&[0.0; 3]), "`origin`")?;
        place.set(view.get()?.clip_from(origin).to_cols_array());
        Ok(())
    })
}

/// Writes the clip planes of a view, relative to the point `origin` (3 finite coordinates; null for the
/// origin of the world): 4 numbers a, b, c, d each, whose side with a x + b y + c z + d >= 0 is seen.
/// `capacity` and `count` are in numbers. A null or too short `planes` is handled as in `vis_visible_ids`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_clip_planes(
    view: *const vis_view,
    origin: *const f64,
    planes: *mut f64,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 numbers of `origin`.
        let (view, origin) = unsafe { (reference(view, "view")?, optional_point(origin, "origin")?) };
        // SAFETY: by rule P2 of `visibility.h`, each pointer is null or valid to write.
        let planes = unsafe { buffer(planes, capacity, count) }?;
        let origin = finite(origin.unwrap_or(&[0.0; 3]), "`origin`")?;
        let view = view.get()?;
        let numbers = view.clip_planes().iter().flat_map(|plane| {
            let offset = plane.signed_distance(origin - view.origin());
            [plane.normal.x, plane.normal.y, plane.normal.z, offset]
        });
        planes.fill(4 * view.clip_planes().len(), numbers)
    })
}

/// Writes whether an answer that a pipeline has made for the view `of` with a reach (see
/// `vis_pipeline_set_reach`) is good for `view`: its eye is within `metres` of that of `of`, it is turned by
/// at most `radians`, and lens, near and far plane and layers are the same. With this, an answer that another
/// thread or process has made for an older view is used only where it holds. False for parallel views and for
/// views with clip planes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_is_within_reach(
    view: *const vis_view,
    of: *const vis_view,
    metres: f64,
    radians: f64,
    within: *mut bool,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (view, of) = unsafe { (reference(view, "view")?, reference(of, "of")?) };
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let mut place = unsafe { out(within, "within") }?;
        let region = ViewRegion::around(&of.get()?, Reach::new(metres, radians));
        let view = view.get()?;
        place.set(region.is_some_and(|region| region.contains(&view)));
        Ok(())
    })
}

/// Returns the half-space `a x + b y + c z + d >= 0`.
pub(crate) fn plane(&[a, b, c, d]: &[f64; 4]) -> Plane {
    Plane::new(DVec3::new(a, b, c), d)
}
