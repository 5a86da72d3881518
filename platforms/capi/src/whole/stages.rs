//! Stages of pipelines that only the whole library has.

use super::cells::vis_cells;
use super::horizon::FollowingHorizon;
use super::level::vis_level;
use super::online::{SharedOnline, vis_online};
use super::pvs::vis_scene_pvs;
use crate::error::{Error, border, vis_status};
use crate::numbers::finite;
use crate::pipeline::{push, vis_pipeline, z_buffer};
use crate::pointer::reference;
use vis_light_kind::*;
use visibility_2d::horizon::UpAxis;
use visibility_core::glam::DVec3;
use visibility_core::pvs::PvsCuller;
use visibility_frame::casters::{CasterCuller, Light};
use visibility_hzb::HzbCuller;
use visibility_portals::SharedPortalCuller;

/// Appends portal culling, which removes objects that cannot be seen through the open portals of a building.
/// Several pipelines may share the cells, which live as long as a pipeline uses them, even if destroyed.
/// Conservative.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_portals(
    pipeline: *mut vis_pipeline,
    cells: *const vis_cells,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let cells = unsafe { reference(cells, "cells") }?;
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        unsafe { push(pipeline, SharedPortalCuller::new(cells.shared())) }
    })
}

/// Appends culling by a baked set. It removes objects that the set excludes for the viewcells around the eye.
/// Several pipelines may share the set, which lives as long as a pipeline uses it, even if destroyed.
/// Conservative if the set is.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_pvs(
    pipeline: *mut vis_pipeline,
    pvs: *const vis_scene_pvs,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let pvs = unsafe { reference(pvs, "pvs") }?;
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        unsafe { push(pipeline, PvsCuller::new(pvs.shared())) }
    })
}

/// Appends culling by sets made ahead of an eye on the move. It removes objects that are hidden from the box
/// around the eye and its near plane; nothing while no box is ready. The sets live as long as a pipeline uses
/// them, even if destroyed. Both eyes of a headset may share them; `vis_online_answer` and the lists of what
/// came and went are then those of the last frame of either. Conservative.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_online(
    pipeline: *mut vis_pipeline,
    online: *const vis_online,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let online = unsafe { reference(online, "online") }?;
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        unsafe { push(pipeline, SharedOnline(online.shared())) }
    })
}

/// Appends culling by a horizon: it removes objects hidden behind upright solids, walls and hills of the
/// objects that have a mesh and the flag `VIS_OBJECT_OCCLUDER`. For cities and terrain seen from near the
/// ground. `is_z_up` is whether the z axis points up, otherwise the y axis does. The solids of each scene are
/// found in the first frame, and follow its changes. Conservative.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_horizon(pipeline: *mut vis_pipeline, is_z_up: bool) -> vis_status {
    let up = if is_z_up { UpAxis::Z } else { UpAxis::Y };
    // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
    border(|| unsafe { push(pipeline, FollowingHorizon::new(up)) })
}

/// Kind of a light that casts shadows.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum vis_light_kind {
    /// Parallel light, such as the sun. `direction` leads from lit points towards the light.
    VIS_LIGHT_DIRECTIONAL = 0,
    /// Light in all directions from `position`, as far as `range`.
    VIS_LIGHT_POINT = 1,
    /// Light from `position` within a cone around `direction`, which leads away from the light, as far as
    /// `range`.
    VIS_LIGHT_SPOT = 2,
}

/// Light that casts shadows, in world space and metres. Fields that its kind does not have are not read.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct vis_light {
    /// A `vis_light_kind`.
    pub kind: u32,
    /// Position of a point or spot light.
    pub position: [f64; 3],
    /// Direction towards a directional light, or away from a spot light: any finite length but zero.
    pub direction: [f64; 3],
    /// Distance beyond which a point or spot light casts no shadow: more than 0, may be infinite.
    pub range: f64,
    /// Angle in radians between the axis and the side of a spot light's cone: more than 0, at most pi.
    pub half_angle: f64,
}

/// Returns the light that a description stands for.
fn light_of(given: &vis_light) -> Result<Light, Error> {
    let [position, direction] = [given.position, given.direction].map(DVec3::from_array);
    let vis_light { kind, range, half_angle, .. } = *given;
    if kind == VIS_LIGHT_DIRECTIONAL as u32 {
        Ok(Light::Directional { toward_light: direction })
    } else if kind == VIS_LIGHT_POINT as u32 {
        Ok(Light::Point { position, range })
    } else if kind == VIS_LIGHT_SPOT as u32 {
        Ok(Light::Spot { position, direction, half_angle, range })
    } else {
        Err(Error::argument(format_args!("{kind} is no vis_light_kind")))
    }
}

/// Appends culling of shadow casters: it removes objects whose shadow from a light cannot fall on any point
/// that the view shows. The first stage of the pipeline that selects objects for the light's shadow map; the
/// view is the camera's, or that of one cascade, on the layers of all casters. No frustum stage belongs in
/// that pipeline, since casters may be outside the view. Conservative for shadows.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_casters(
    pipeline: *mut vis_pipeline,
    light: *const vis_light,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let light = light_of(unsafe { reference(light, "light") }?)?;
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        unsafe { push(pipeline, CasterCuller::new(light)?) }
    })
}

/// Appends a z-buffer as `vis_pipeline_add_z_buffer` does, into which the occluders of a level are drawn,
/// beside those of the scene's objects. `origin` is the point of the world, 3 finite coordinates, that the
/// level's triangles are relative to. The level may be destroyed afterwards. Conservative for views that draw
/// the whole level: its triangles have no layers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_z_buffer_of_level(
    pipeline: *mut vis_pipeline,
    width: usize,
    height: usize,
    level: *const vis_level,
    origin: *const f64,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read: 3 numbers of `origin`.
        let (level, origin) =
            unsafe { (reference(level, "level")?, reference(origin.cast::<[f64; 3]>(), "origin")?) };
        let origin = finite(origin, "`origin`")?;
        let map = z_buffer(width, height)?.with_level(level.0.clone(), origin);
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        unsafe { push(pipeline, HzbCuller::new(map)) }
    })
}
