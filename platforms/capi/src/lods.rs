//! Levels of detail of the visible objects of a view.

use crate::error::{Error, border, vis_status};
use crate::handle::Guarded;
use crate::numbers::{finite, not_negative};
use crate::object_data::MOST_SIZES;
use crate::pointer::{array, buffer, create, destroy, out, reference};
use crate::scene::{State, VIS_NO_OBJECT, vis_scene};
use crate::view::{optional_point, vis_view};
use crate::visible::vis_visible;
use std::sync::RwLockReadGuard;
use visibility_core::ObjectId;
use visibility_frame::lod::{Lod, LodSelector};

/// Levels of detail of the visible objects of one view, chosen once per frame, with the levels of the frame
/// before.
pub struct vis_lods(Guarded<LodSelector>);

impl vis_lods {
    /// Returns the levels of the last frame.
    pub(crate) fn read(&self) -> Result<RwLockReadGuard<'_, LodSelector>, Error> {
        self.0.read()
    }
}

/// Level of detail to draw for a visible object. While `fade` is less than 1, `previous` is drawn too: the
/// weight of `level` is `fade * opacity`, that of `previous` is `(1 - fade) * opacity`.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct vis_lod {
    /// Id of the object.
    pub object: u64,
    /// Level of detail to draw: 0 for the finest.
    pub level: u32,
    /// Level that `level` replaces; equal to `level` while no cross-fade is in progress.
    pub previous: u32,
    /// Weight of `level` in the cross-fade from `previous`, from 0 to 1; 1 while none is in progress.
    pub fade: f32,
    /// Opacity of the object by its draw range, from 0 to 1: less than 1 only for an object that fades (see
    /// `vis_scene_set_draw_range_with_margin`), and not towards its HLOD parent.
    pub opacity: f32,
}

impl vis_lod {
    fn new(id: ObjectId, lod: Lod) -> Self {
        let Lod { level, previous, fade, opacity } = lod;
        let [level, previous] = [level, previous].map(u32::from);
        Self { object: id.to_bits(), level, previous, fade, opacity }
    }
}

/// Creates levels of detail for one view, whose pictures are `picture_height` pixels high: 0 or more; with 0
/// all objects have level 0. `hysteresis` is the fraction of a size by which an object must be beyond it
/// before its level changes, 0 to 0.9; 0.1 is usual. `fade_seconds` is the duration of a cross-fade from one
/// level to the next; 0 for none, 0.25 is usual. Two views, or two eyes, need two of these.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_lods_create(
    picture_height: f64,
    hysteresis: f64,
    fade_seconds: f32,
    lods: *mut *mut vis_lods,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let place = unsafe { out(lods, "lods") }?;
        let selector = LodSelector::new(not_negative(picture_height, "the picture height")?);
        if !(0.0..=0.9).contains(&hysteresis) {
            let message = format_args!("the hysteresis cannot be {hysteresis}");
            return Err(Error::argument(message));
        }
        not_negative(fade_seconds.into(), "the fade")?;
        create(place, vis_lods(Guarded::new(selector.with_hysteresis(hysteresis).with_fade(fade_seconds))));
        Ok(())
    })
}

/// Destroys levels of detail. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_lods_destroy(lods: *mut vis_lods) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(lods) }
}

/// Sets the height in pixels of the pictures of later frames, 0 or more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_lods_set_picture_height(lods: *mut vis_lods, picture_height: f64) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let lods = unsafe { reference(lods, "lods") }?;
        let height = not_negative(picture_height, "the picture height")?;
        lods.0.write()?.set_picture_height(height);
        Ok(())
    })
}

/// Sets the point of the world, 3 finite coordinates, from which the distances of draw ranges are measured in
/// later frames; null for the view's own eye. For views of lights and mirrors, which show what the camera
/// shows. Sizes are always those in the view.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_lods_set_distance_eye(lods: *mut vis_lods, eye: *const f64) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 numbers of `eye`.
        let (lods, eye) = unsafe { (reference(lods, "lods")?, optional_point(eye, "eye")?) };
        let eye = eye.map(|eye| finite(eye, "`eye`")).transpose()?;
        lods.0.write()?.set_distance_eye(eye);
        Ok(())
    })
}

/// Gives `count` objects the same levels of detail, those of their mesh, for `vis_lods_select`: `sizes` are
/// the sizes in pixels that divide the levels, at most 255, positive and finite. With 200 and 50, level 0 is
/// for 200 pixels and more, level 1 for 50 and more, level 2 for all below. Without sizes, as for new
/// objects, the level is 0. Each different list of sizes that an object is given is kept as long as the
/// scene, also once no object has it. If an id is unknown, nothing changes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_lod_sizes(
    scene: *mut vis_scene,
    ids: *const u64,
    count: usize,
    sizes: *const f32,
    size_count: usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, ids) = unsafe { (reference(scene, "scene")?, array(ids, count, "ids")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let sizes = unsafe { array(sizes, size_count, "sizes") }?;
        if sizes.len() > MOST_SIZES {
            return Err(Error::argument(format_args!("{size_count} sizes are more than {MOST_SIZES}")));
        }
        if let Some(wrong) = sizes.iter().position(|&size| !(size > 0.0 && size.is_finite())) {
            let size = sizes[wrong];
            return Err(Error::argument(format_args!("size {wrong} cannot be {size}")));
        }
        let State { scene, data, .. } = &mut *scene.write()?;
        Ok(data.set_sizes(scene, ids, sizes)?)
    })
}

/// Chooses the level of each object of `visible`, the set of this view's frame, by its size in pixels and the
/// sizes of `vis_scene_set_lod_sizes`. The size of an object is the diameter in pixels of the sphere around
/// its bounds, as if the whole sphere were at the nearest point of the bounds in the middle of the picture,
/// so that turning the camera changes no level. Once per frame; `elapsed_seconds` is the time since the frame
/// before, by which cross-fades advance. An object that was not visible in the frame before has the level of
/// its size at once.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_lods_select(
    lods: *mut vis_lods,
    scene: *const vis_scene,
    view: *const vis_view,
    visible: *const vis_visible,
    elapsed_seconds: f32,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (lods, scene) = unsafe { (reference(lods, "lods")?, reference(scene, "scene")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (view, visible) = unsafe { (reference(view, "view")?, reference(visible, "visible")?) };
        not_negative(elapsed_seconds.into(), "the elapsed time")?;
        let (view, state, visible) = (view.get()?, scene.read()?, visible.finished()?);
        lods.0.write()?.select(&state.scene, &view, &visible, elapsed_seconds, |id| state.data.sizes(id));
        Ok(())
    })
}

/// Writes the level of each object that was visible in the last frame, in the order of the visible set, like
/// `vis_visible_ids`. None before the first frame.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_lods_selected(
    lods: *const vis_lods,
    list: *mut vis_lod,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (lods, list) = unsafe { (reference(lods, "lods")?, buffer(list, capacity, count)?) };
        let lods = lods.read()?;
        let selected = lods.selected();
        list.fill(selected.len(), selected.iter().map(|&(id, lod)| vis_lod::new(id, lod)))
    })
}

/// Writes the level of one object in the last frame. The id in `lod` is `VIS_NO_OBJECT`, and all else 0, if
/// the object was not visible.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_lods_lod(lods: *const vis_lods, object: u64, lod: *mut vis_lod) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (lods, mut place) = unsafe { (reference(lods, "lods")?, out(lod, "lod")?) };
        let id = ObjectId::from_bits(object);
        let none = vis_lod { object: VIS_NO_OBJECT, level: 0, previous: 0, fade: 0.0, opacity: 0.0 };
        place.set(lods.read()?.lod(id).map_or(none, |lod| vis_lod::new(id, lod)));
        Ok(())
    })
}

/// Forgets earlier frames, so that the next one begins without cross-fades: after a cut of the camera.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_lods_reset(lods: *mut vis_lods) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let lods = unsafe { reference(lods, "lods") }?;
        lods.0.write()?.reset();
        Ok(())
    })
}
