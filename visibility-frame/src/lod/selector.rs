//! Levels of detail of the visible objects of a view, with hysteresis and cross-fades.

use super::PixelScale;
use super::eye_box::EyeBox;
use alloc::vec::Vec;
use core::ops::RangeInclusive;
use visibility_core::glam::DVec3;
use visibility_core::scene::{DrawRange, SceneCursor};
use visibility_core::{Aabb, ObjectId, Scene, View, VisibleSet};

/// Level of detail to draw for a visible object.
///
/// ```
/// use visibility_frame::lod::Lod;
/// # let mut drawn = Vec::new();
/// # let mut draw = |level: u8, weight: f32| drawn.push((level, weight));
/// let lod = Lod { level: 2, previous: 1, fade: 0.25, opacity: 1.0 };
/// draw(lod.level, lod.fade * lod.opacity);
/// if lod.fade < 1.0 {
///     draw(lod.previous, (1.0 - lod.fade) * lod.opacity);
/// }
/// # assert_eq!(drawn, [(2, 0.25), (1, 0.75)]);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Lod {
    /// Level of detail to draw: 0 for the finest.
    pub level: u8,
    /// Level that `level` replaces; equal to `level` while no cross-fade is in progress.
    pub previous: u8,
    /// Weight of `level` in the cross-fade from `previous`, from 0 to 1; 1 while none is in progress.
    pub fade: f32,
    /// Opacity of the object by its [draw range](visibility_core::scene::DrawRange::opacity), from 0 to 1. An
    /// object and its [HLOD parent](Scene::set_hlod_parent) do not fade towards each other: 1 for either,
    /// since a `ContributionCuller` leaves only the one that is drawn. 1 also for a range without a margin,
    /// which that culler alone keeps, with its hysteresis, and for an object that is never culled. So it is 1
    /// for every object that [can occlude](Scene::can_occlude).
    pub opacity: f32,
}

/// Chooses the level of detail of each visible object of one view by its size in pixels, which the
/// [module](super) defines. A selector belongs to one view, as a culler does, and runs once per frame after
/// the view's cullers.
///
/// The levels of an object are divided by sizes in pixels, from large to small: with `[200.0, 50.0]`, level 0
/// is for 200 pixels and more, level 1 for 50 and more, level 2 for all below. Without sizes the level is 0.
/// The level of an object that was visible in the frame before changes only when its size passes a limit by
/// more than the [hysteresis](Self::with_hysteresis), so that a trembling camera causes no flicker. It does
/// not change during a cross-fade. An object that has just become visible gets the level of its size, without
/// a fade.
///
/// # Cost
/// About 20 ns per visible object. Memory: 24 bytes per object index and 20 bytes per object of the scene.
///
/// ```
/// use visibility_core::glam::DVec3;
/// use visibility_frame::lod::LodSelector;
/// use visibility_core::{Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
/// let mut scene = Scene::new();
/// let statue = scene.insert(Aabb::from_arrays([9.0, -1.0, -1.0], [11.0, 1.0, 1.0]));
/// let mut pipeline = Pipeline::new().with(FrustumCuller::new());
/// let (mut visible, mut lods) = (VisibleSet::new(), LodSelector::new(1080.0));
/// // Each frame: the closure returns the level sizes of an object, usually those of its mesh.
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.0, 1.5, 0.1, 100.0)?;
/// pipeline.cull(&scene, &view, &mut visible);
/// lods.select(&scene, &view, &visible, 1.0 / 60.0, |_id| &[500.0, 120.0]);
/// for &(id, lod) in lods.selected() {
///     assert_eq!((id, lod.level), (statue, 1));
/// }
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
#[derive(Clone, Debug)]
pub struct LodSelector {
    picture_height: f64,
    hysteresis: f64,
    fade_seconds: f32,
    /// World-space point that distances are measured from. `None` for the view's own eye.
    distance_eye: Option<DVec3>,
    /// The scene that `states` belongs to.
    scene: SceneCursor,
    /// Number of the last frame; 1 before the first. Entries of `states` carry such numbers.
    frame: u64,
    /// State of each object, indexed by object index.
    states: Vec<State>,
    selected: Vec<(ObjectId, Lod)>,
}

/// The level of an object in the last frame in which the object was visible.
#[derive(Clone, Copy, Debug)]
struct State {
    /// Generation of the id of the object.
    generation: u32,
    level: u8,
    previous: u8,
    fade: f32,
    opacity: f32,
    /// Number of the last frame in which the object was visible; 0 if there was none.
    frame: u64,
}

impl State {
    const NONE: Self = Self { generation: 0, level: 0, previous: 0, fade: 1.0, opacity: 1.0, frame: 0 };

    fn lod(&self) -> Lod {
        Lod { level: self.level, previous: self.previous, fade: self.fade, opacity: self.opacity }
    }

    /// Advances a cross-fade by `step`, a fraction of its duration. If no cross-fade is in progress after
    /// that, changes to the level in `levels` that is nearest to the present one, and begins a cross-fade to
    /// it. An infinite step changes without a cross-fade.
    fn advance(&mut self, levels: RangeInclusive<u8>, step: f32) {
        self.fade = (self.fade + step).min(1.0);
        if self.fade < 1.0 {
            return;
        }
        self.previous = self.level;
        self.level = self.level.clamp(*levels.start(), *levels.end());
        if self.level != self.previous {
            self.fade = 0.0;
            if step == f32::INFINITY {
                (self.previous, self.fade) = (self.level, 1.0);
            }
        }
    }
}

/// Returns the number of `sizes` in pixels, each multiplied by `factor`, that are greater than the square
/// root of `squared`. Sizes that are NaN or not positive are never greater.
fn level_of(squared: f64, sizes: &[f32], factor: f64) -> u8 {
    let is_smaller = |&&size: &&f32| {
        let size = f64::from(size) * factor;
        size > 0.0 && squared < size * size
    };
    sizes.iter().filter(is_smaller).count() as u8
}

/// Returns the opacity of an object by its draw range. An object and its HLOD parent do not fade towards each
/// other: exactly one of them is drawn at every distance, and would be transparent there.
fn opacity(scene: &Scene, id: ObjectId, bounds: &Aabb, eye: &EyeBox) -> f32 {
    let Ok(range) = scene.draw_range(id) else { return 1.0 };
    if range.margin == 0.0 || scene.object(id).is_ok_and(|object| object.is_unculled()) {
        return 1.0;
    }
    // The begin of the draw range is measured to the object's own bounds and the end to the bounds of its
    // parent, so that no distance is left without either.
    let stand_in = scene.stand_in(id);
    let fade_in = if scene.is_hlod_parent(id) {
        1.0
    } else {
        DrawRange { end: f32::INFINITY, ..range }.opacity(eye.distance(bounds) as f32)
    };
    let is_replaced = |parent| scene.draw_range(parent).is_ok_and(|above| above.begin <= range.end);
    let fade_out = match stand_in {
        Some((parent, _)) if is_replaced(parent) => 1.0,
        _ => {
            let around = stand_in.map_or(*bounds, |(_, around)| around);
            DrawRange { begin: 0.0, ..range }.opacity(eye.distance(&around) as f32)
        }
    };
    fade_in.min(fade_out)
}

impl LodSelector {
    /// Makes a selector for pictures that are `picture_height` pixels high, with a hysteresis of 10 % and
    /// cross-fades of a quarter of a second. With a height that is NaN, zero or negative, all objects get
    /// level 0.
    pub fn new(picture_height: f64) -> Self {
        Self {
            picture_height,
            hysteresis: 0.1,
            fade_seconds: 0.25,
            distance_eye: None,
            scene: SceneCursor::START,
            frame: 1,
            states: Vec::new(),
            selected: Vec::new(),
        }
    }

    /// Sets the hysteresis: the fraction of a limit by which an object's size must be beyond the limit before
    /// the level changes, from 0 to 0.9. Other numbers are clamped, NaN counts as 0.
    #[must_use]
    pub fn with_hysteresis(self, share: f64) -> Self {
        Self { hysteresis: share.clamp(0.0, 0.9).max(0.0), ..self }
    }

    /// Sets the duration of a cross-fade in seconds. With 0, a negative number or NaN, levels change at once.
    #[must_use]
    pub fn with_fade(self, seconds: f32) -> Self {
        Self { fade_seconds: seconds, ..self }
    }

    /// Sets the height in pixels of the pictures of later frames.
    pub fn set_picture_height(&mut self, picture_height: f64) {
        self.picture_height = picture_height;
    }

    /// Sets the point of the world that distances for draw ranges are measured from, as
    /// [`ContributionCuller::set_distance_eye`](super::ContributionCuller::set_distance_eye) does. `None` is
    /// the view's own eye.
    pub fn set_distance_eye(&mut self, eye: Option<DVec3>) {
        self.distance_eye = eye;
    }

    /// Chooses the level of every object of `visible`, the set of this view's frame. `elapsed` is the time
    /// since the frame before in seconds, by which cross-fades advance; negative or NaN counts as 0. `sizes`
    /// returns the sizes in pixels that divide an object's levels; only the first 255 count. The level is the
    /// number of these sizes that exceed the object's size.
    ///
    /// No [`reset`](Self::reset) is needed for another scene: its objects start at the levels of their sizes.
    pub fn select<'a>(
        &mut self,
        scene: &Scene,
        view: &View,
        visible: &VisibleSet,
        elapsed: f32,
        mut sizes: impl FnMut(ObjectId) -> &'a [f32],
    ) {
        if !self.scene.is_in(scene) {
            self.reset();
        }
        self.scene = SceneCursor::at(scene);
        self.frame += 1;
        self.states.resize(scene.index_limit().max(self.states.len()), State::NONE);
        self.selected.clear();
        self.selected.reserve(scene.len());
        let scale = PixelScale::new(view, scene.origin(), self.picture_height);
        let eye = self.distance_eye.map_or(*scale.eye(), |eye| EyeBox::of_point(eye, scene.origin()));
        let step = if self.fade_seconds > 0.0 { elapsed.max(0.0) / self.fade_seconds } else { f32::INFINITY };
        visible.iter(scene).for_each(|id| {
            let Ok(bounds) = scene.bounds(id) else { return };
            let size = scale.diameter_squared(&bounds);
            let sizes = sizes(id);
            let level = |factor: f64| level_of(size, &sizes[..sizes.len().min(255)], factor);
            // An object that was selected in the frame before keeps its level within the hysteresis, and goes
            // on with its fade. Any other object starts at the level of its size.
            let state = &mut self.states[id.index()];
            if state.frame + 1 == self.frame && state.generation == id.generation() {
                let levels = level(1.0 - self.hysteresis)..=level(1.0 + self.hysteresis);
                state.advance(levels, step);
            } else {
                let level = level(1.0);
                *state = State { generation: id.generation(), level, previous: level, ..State::NONE };
            }
            state.frame = self.frame;
            state.opacity = opacity(scene, id, &bounds, &eye);
            self.selected.push((id, state.lod()));
        });
    }

    /// Returns the level of detail to draw for an object, for draw lists that ask by id. `None` if the object
    /// was not visible in the last frame. Takes constant time.
    ///
    /// ```
    /// use visibility_frame::draw_list::DrawList;
    /// use visibility_core::glam::DVec3;
    /// use visibility_frame::lod::LodSelector;
    /// use visibility_core::{Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
    /// let mut scene = Scene::new();
    /// let statue = |x| Aabb::from_arrays([x, -1.0, -1.0], [x + 1.0, 1.0, 1.0]);
    /// scene.insert_batch([3.0, 30.0, 31.0].map(statue));
    /// let (mut visible, mut lods) = (VisibleSet::new(), LodSelector::new(1080.0));
    /// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    /// let view = View::perspective(pose, 1.0, 1.5, 0.1, 100.0)?;
    /// Pipeline::new().with(FrustumCuller::new()).cull(&scene, &view, &mut visible);
    /// lods.select(&scene, &view, &visible, 1.0 / 60.0, |_id| &[300.0]);
    /// // One mesh with two levels: objects are grouped by level.
    /// let mut list = DrawList::new();
    /// list.group(visible.iter(&scene), |id| lods.lod(id).map_or(0, |lod| u32::from(lod.level)));
    /// assert_eq!(list.groups().iter().map(|group| group.count).collect::<Vec<_>>(), [1, 2]);
    /// # Ok::<(), visibility_core::view::ViewError>(())
    /// ```
    pub fn lod(&self, id: ObjectId) -> Option<Lod> {
        let state = self.states.get(id.index())?;
        (state.frame == self.frame && state.generation == id.generation()).then(|| state.lod())
    }

    /// Returns the visible objects of the last frame, each with the level to draw, in the order of the
    /// visible set.
    pub fn selected(&self) -> &[(ObjectId, Lod)] {
        &self.selected
    }

    /// Forgets all earlier frames, so that the next frame begins without cross-fades. To be called after a
    /// camera cut.
    pub fn reset(&mut self) {
        self.scene = SceneCursor::START;
        self.states.fill(State::NONE);
        self.selected.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Pose;

    #[test]
    fn levels_are_counted_by_sizes_that_are_sizes() {
        let level = |pixels: f64, sizes: &[f32]| level_of(pixels * pixels, sizes, 1.0);
        let found = [201.0, 200.0, 199.0, 50.0, 49.0].map(|pixels| level(pixels, &[200.0, 50.0]));
        assert_eq!(found, [0, 0, 1, 1, 2], "200 pixels and 50");
        assert_eq!(level(10.0, &[-300.0, f32::NAN, 0.0, 20.0]), 1, "sizes that are none");
    }

    #[test]
    fn a_change_of_level_fades_to_its_end() {
        let mut state = State { level: 1, previous: 1, ..State::NONE };
        let mut step = |levels: RangeInclusive<u8>, step: f32| {
            state.advance(levels, step);
            (state.level, state.previous, state.fade)
        };
        assert_eq!(step(0..=2, 0.5), (1, 1, 1.0), "within the hysteresis");
        assert_eq!(step(2..=3, 0.5), (2, 1, 0.0), "the next level begins to fade in");
        assert_eq!(step(0..=0, 0.5), (2, 1, 0.5), "no change while it fades");
        assert_eq!(step(2..=2, 0.5), (2, 2, 1.0), "faded in");
        assert_eq!(step(0..=0, f32::INFINITY), (0, 0, 1.0), "a change at once");
    }

    #[test]
    fn opacities_are_those_of_ranges_with_a_margin() {
        let mut scene = Scene::new();
        let pole = Aabb::from_arrays([0.0; 3], [0.0, 0.0, 1.0]);
        let ids = scene.insert_batch([pole; 5]);
        let [fading, hard, kept, child, parent] = ids[..] else { unreachable!("5 ids") };
        let range = DrawRange { begin: 10.0, end: 20.0, margin: 4.0 };
        for (id, range) in [
            (fading, range),
            (hard, DrawRange { margin: 0.0, ..range }),
            (kept, range),
            (child, DrawRange { begin: 0.0, ..range }),
            (parent, DrawRange { begin: 20.0, end: 40.0, ..range }),
        ] {
            scene.set_draw_range(id, range).unwrap();
        }
        scene.set_never_cull(kept, true).unwrap();
        scene.set_hlod_parent(child, Some(parent)).unwrap();
        let at = |id: ObjectId, distance: f64| {
            let eye = EyeBox::of_point(DVec3::X * -distance, DVec3::ZERO);
            opacity(&scene, id, &pole, &eye)
        };
        for (distance, expected) in [
            (5.0, [0.0, 1.0, 1.0, 1.0, 1.0]),
            (12.0, [0.5, 1.0, 1.0, 1.0, 1.0]),
            (15.0, [1.0, 1.0, 1.0, 1.0, 1.0]),
            (19.0, [0.25, 1.0, 1.0, 1.0, 1.0]),
            (39.0, [0.0, 1.0, 1.0, 1.0, 0.25]),
        ] {
            let found = [fading, hard, kept, child, parent].map(|id| at(id, distance));
            let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 1e-6, "{distance} m away: {found:?} instead of {expected:?}");
        }
    }

    /// Levels of an object that was seen in the frame before fade, those of others are set at once.
    #[test]
    fn levels_fade_for_what_was_seen_in_the_frame_before() {
        let pose = |x: f64| Pose::look_at(DVec3::X * x, DVec3::X * (x + 1.0), DVec3::Z);
        let view = |x: f64| View::perspective(pose(x), 1.0, 1.0, 0.1, 1e4).unwrap();
        let pole = Aabb::from_arrays([0.0; 3], [0.0, 0.0, 1.0]);
        let mut scene = Scene::new();
        let [id, other] = [(); 2].map(|()| scene.insert(pole));
        let (mut lods, mut visible) = (LodSelector::new(1000.0).with_fade(1.0), VisibleSet::new());
        let shares = [0.5, 2.0, -1.0, f64::NAN].map(|share| LodSelector::new(1.0).with_hysteresis(share));
        assert_eq!(shares.map(|lods| lods.hysteresis), [0.5, 0.9, 0.0, 0.0], "hysteresis");
        let mut see = |scene: &Scene, x: f64, elapsed: f32, lods: &mut LodSelector| {
            visible.fill(scene, &view(x));
            lods.select(scene, &view(x), &visible, elapsed, |_| &[50.0]);
        };
        see(&scene, -1.0, 0.1, &mut lods);
        see(&scene, -1000.0, 0.1, &mut lods);
        let lod =
            |lods: &LodSelector, id: ObjectId| lods.lod(id).map(|lod| (lod.level, lod.previous, lod.fade));
        assert_eq!(lod(&lods, id), Some((1, 0, 0.0)), "it begins to fade");
        see(&scene, -1000.0, 0.25, &mut lods);
        see(&scene, -1000.0, -3.0, &mut lods);
        assert_eq!(
            lod(&lods, id),
            Some((1, 0, 0.25)),
            "a quarter of a second later, and time that runs back"
        );
        // Another object with its index is as it is at once, as is one that was not seen in the frame before.
        scene.remove(id).unwrap();
        let new = scene.insert(pole);
        assert_eq!(new.index(), id.index(), "the index is used again");
        see(&scene, -1.0, 0.1, &mut lods);
        assert_eq!([lod(&lods, new), lod(&lods, id)], [Some((0, 0, 1.0)), None], "another object");
        see(&Scene::clone(&scene), -1.0, 0.1, &mut lods);
        see(&scene, -1.0, 0.1, &mut lods);
        let mut away = VisibleSet::new();
        away.fill(&scene, &view(-1.0).with_layers(0));
        lods.select(&scene, &view(-1.0), &away, 0.1, |_| &[50.0]);
        assert_eq!(lod(&lods, other), None, "an object that is not seen");
        see(&scene, -1000.0, 0.1, &mut lods);
        assert_eq!(lod(&lods, other), Some((1, 1, 1.0)), "an object that was not seen in the frame before");
        // Levels that change at once, and more sizes than count.
        let mut sudden = LodSelector::new(1000.0).with_fade(0.0);
        see(&scene, -1.0, 0.0, &mut sudden);
        see(&scene, -1000.0, 0.0, &mut sudden);
        assert_eq!(lod(&sudden, other), Some((1, 1, 1.0)), "without a fade");
        // A scene with fewer objects.
        let mut small = Scene::new();
        small.insert(pole);
        see(&small, -1.0, 0.1, &mut lods);
        assert_eq!(lods.selected().len(), 1, "objects of a smaller scene");
        visible.fill(&scene, &view(-1000.0));
        sudden.reset();
        sudden.select(&scene, &view(-1000.0), &visible, 0.1, |_| &[50.0; 300]);
        assert_eq!(lod(&sudden, other), Some((255, 255, 1.0)), "300 sizes");
    }
}
