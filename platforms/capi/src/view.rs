//! Views: the camera in the engine's own convention.

use crate::error::{Error, border, vis_status};
use crate::handle::Guarded;
use crate::pointer::{array, create, destroy, out, reference};
use crate::scene::VIS_ALL_LAYERS;
use vis_depth::*;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;
use visibility_core::view::{ClipMatrix, Depth, Window};
use visibility_core::{Pose, View};

/// A view: a camera and the layers that it shows. Created once, set each frame.
pub struct vis_view(Guarded<State>);

struct State {
    /// The camera, as a view of core; `None` until the caller has set one.
    camera: Option<View>,
    layers: u32,
}

impl vis_view {
    /// Returns the view, or an error if it has no camera yet.
    pub(crate) fn get(&self) -> Result<View, Error> {
        let no_camera = || Error::new(vis_status::VIS_ERROR_STATE, "the view has no camera yet");
        self.0.read()?.camera.ok_or_else(no_camera)
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
        // SAFETY: rule P2 of `visibility.h`.
        let place = unsafe { out(view, "view") }?;
        create(place, vis_view(Guarded::new(State { camera: None, layers: VIS_ALL_LAYERS })));
        Ok(())
    })
}

/// Destroys a view. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_destroy(view: *mut vis_view) {
    // SAFETY: rule P3 of `visibility.h`.
    unsafe { destroy(view) }
}

/// Makes a view of a clip matrix, its depth convention (a `vis_depth`) and the 3 coordinates of the point
/// that the matrix is relative to; null for the origin of the world.
fn camera(matrix: impl Into<ClipMatrix>, depth: u32, origin: Option<&[f64; 3]>) -> Result<View, Error> {
    let known = DEPTHS.iter().find(|(number, _)| *number as u32 == depth);
    let &(_, depth) = known.ok_or_else(|| Error::argument(format_args!("{depth} is no vis_depth")))?;
    let view = View::from_clip_from_world(matrix, depth)?;
    Ok(origin.map_or(Ok(view), |&origin| view.relative_to(DVec3::from_array(origin)))?)
}

/// Borrows 3 coordinates that may be absent.
///
/// # Safety
/// That of [`reference`].
unsafe fn optional_point<'a>(point: *const f64, name: &str) -> Result<Option<&'a [f64; 3]>, Error> {
    if point.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's promise.
    unsafe { reference(point.cast(), name) }.map(Some)
}

/// Sets the camera of a view by the matrix that the engine draws with: 16 numbers, column-major, from the
/// world to clip space. `depth` is the `vis_depth` that the matrix was made for. `origin` has the 3
/// coordinates of the point of the world that the matrix is relative to, for engines that draw relative to
/// the camera; null for the origin of the world. The view keeps its layers and loses its clip planes.
///
/// Two conditions, which every camera meets, are not checked: clip-space w does not decrease away from the
/// eye, and the near plane is not behind the eye. Occlusion culling relies on them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_set_matrix(
    view: *mut vis_view,
    matrix: *const f32,
    depth: u32,
    origin: *const f64,
) -> vis_status {
    border(|| {
        // SAFETY: rule P1 of `visibility.h`.
        let (view, origin) = unsafe { (reference(view, "view")?, optional_point(origin, "origin")?) };
        // SAFETY: rule P1 of `visibility.h`; 16 numbers.
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
        // SAFETY: rule P1 of `visibility.h`.
        let (view, origin) = unsafe { (reference(view, "view")?, optional_point(origin, "origin")?) };
        // SAFETY: rule P1 of `visibility.h`; 16 numbers.
        let matrix = unsafe { reference(matrix.cast::<[f64; 16]>(), "matrix") }?;
        view.set(camera(*matrix, depth, origin)?)
    })
}

/// Place and directions of a camera, in world coordinates.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct vis_pose {
    /// Position of the eye.
    pub eye: [f64; 3],
    /// A point that the camera looks at.
    pub target: [f64; 3],
    /// A direction that is upwards in the picture.
    pub up: [f64; 3],
}

impl From<&vis_pose> for Pose {
    fn from(pose: &vis_pose) -> Self {
        let [eye, target, up] = [pose.eye, pose.target, pose.up].map(DVec3::from_array);
        Self::look_at(eye, target, up)
    }
}

/// Sets the camera of a view by its pose and lens, for programs that have no matrix. `fov_y` is the vertical
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
        // SAFETY: rule P1 of `visibility.h`.
        let (view, pose) = unsafe { (reference(view, "view")?, reference(pose, "pose")?) };
        view.set(View::perspective(pose.into(), fov_y, aspect, near_plane, far_plane)?)
    })
}

/// Sets the camera of a view with parallel lines of sight: shadow cascades, maps, plans. The picture is
/// `width` by `height` metres around the viewing axis; `near_plane` and `far_plane` are distances from the
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
        // SAFETY: rule P1 of `visibility.h`.
        let (view, pose) = unsafe { (reference(view, "view")?, reference(pose, "pose")?) };
        let window = Window::centered(width * 0.5, height * 0.5);
        view.set(View::orthographic(pose.into(), window, near_plane, far_plane)?)
    })
}

/// Sets the layers that a view shows, one bit per layer. They outlast changes of the camera.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_set_layers(view: *mut vis_view, layers: u32) -> vis_status {
    border(|| {
        // SAFETY: rule P1 of `visibility.h`.
        let view = unsafe { reference(view, "view") }?;
        let mut state = view.0.write()?;
        state.layers = layers;
        state.camera = state.camera.map(|camera| camera.with_layers(layers));
        Ok(())
    })
}

/// Restricts a view to one side of each of `count` planes: 4 numbers a, b, c, d each, of the points with
/// a x + b y + c z + d >= 0, relative to the origin of the matrix, or to the eye of a view that was set by a
/// pose. They replace former ones. At most 10.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_view_set_clip_planes(
    view: *mut vis_view,
    planes: *const f64,
    count: usize,
) -> vis_status {
    border(|| {
        // SAFETY: rule P1 of `visibility.h`; 4 numbers for each of `count`.
        let planes = unsafe { array(planes.cast::<[f64; 4]>(), count, "planes") }?;
        // SAFETY: rule P1 of `visibility.h`.
        let view = unsafe { reference(view, "view") }?;
        let camera = view.get()?;
        let planes: Vec<Plane> = planes.iter().map(plane).collect();
        view.set(camera.with_clip_planes(&planes)?)
    })
}

/// Returns the half-space `a x + b y + c z + d >= 0`.
pub(crate) fn plane(&[a, b, c, d]: &[f64; 4]) -> Plane {
    Plane::new(DVec3::new(a, b, c), d)
}
