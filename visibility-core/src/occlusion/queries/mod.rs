//! Hardware occlusion queries of the engine as an occlusion map. The graphics card answers some frames late.
//!
//! The graphics card compares boxes with the depth buffer that it has drawn (Cohen-Or, Chrysanthou, Silva and
//! Durand, "A Survey of Visibility for Walkthrough Applications", 2003, sections 6.4 and 6.5: the HP
//! occlusion-culling test, and Meissner et al.). Waiting for each answer would stall the card, so answers are
//! collected when they arrive. `boxes.rs` decides which boxes are asked about, and together with which
//! others.
//!
//! # Late answers
//! An answer for one view proves nothing in another, however near:
//!
//! - The eye has moved. Two walls, one farther away than the other, that meet in the picture of the first eye
//!   hide everything behind both, of any size, while the least step of the eye opens a gap between them
//!   through which all of it shows. A third wall, seen edge-on, may close that gap and leaves the first depth
//!   buffer as it is, so that no enlargement of boxes, and no bound on the step, tells from the depths which
//!   case holds.
//! - The camera has turned about its eye. The other picture has other samples, and what falls between samples
//!   of the first may cover one of the second. (A map that used such answers missed .07 objects a frame,
//!   on average over two scenes.)
//!
//! So a moving camera culls without errors only by answers for the present view.
//! [`OcclusionCuller::look_ahead`] gets these: answers for earlier views decide what is drawn *first*, not
//! what is drawn.
//!
//! The depth buffer holds what the engine has drawn, which may be any object. So an answer also proves
//! nothing about another state of the scene, nor about other candidates: a still camera uses answers only
//! until the scene or the incoming set changes.

mod boxes;
mod device;

pub use self::device::QueryDevice;

use self::boxes::{Answer, Boxes};
use super::{OccluderMesh, Occlusion, Occlusion64, OcclusionCuller, OcclusionMap};
use crate::binary_format::Fingerprint;
use crate::{
    Aabb, Accuracy, CullStats, Culler, Scene, View, VisibleSet,
    scene::Boxes64,
    view::{ViewPlane, ViewPlanes},
    walk::BoxHierarchy,
};
use glam::{Affine3A, DVec3};

/// Policy for query answers that refer to an earlier frame: whether they may hide boxes.
///
/// ```
/// use visibility_core::{occlusion::LateAnswers, Accuracy};
/// assert_eq!(LateAnswers::Visible.accuracy(), Accuracy::Conservative);
/// assert_eq!(LateAnswers::Trusted { frames: 2 }.accuracy(), Accuracy::Approximate);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LateAnswers {
    /// An answer is used only if view, scene, candidates and occluders are the same as when its query was
    /// issued; otherwise the box counts as visible. Candidates are the objects that earlier stages have left
    /// in the set. A still camera culls every hidden box, until the scene or the candidates change. A moving
    /// camera, or one whose scene changes in each frame, culls nothing, since answers arrive at least one
    /// frame late, unless the engine [looks ahead](OcclusionCuller::look_ahead). Nothing visible is ever
    /// hidden, if [`HardwareQueries::invalidate`] reports what the culler cannot see: other levels of detail,
    /// fading, animation, materials, and the like.
    Visible,
    /// Answers for a frame at most `frames` frames old are used. An object that comes into view may appear
    /// late by that number of frames.
    Trusted {
        /// Greatest age of a used answer, in frames.
        frames: u32,
    },
}

impl LateAnswers {
    /// Returns the accuracy of a map with this policy, if the device samples at least as finely as the
    /// picture and no [samples](HardwareQueries::with_max_samples) are disregarded.
    pub const fn accuracy(self) -> Accuracy {
        match self {
            Self::Visible => Accuracy::Conservative,
            Self::Trusted { .. } => Accuracy::Approximate,
        }
    }
}

/// An occlusion map over hardware queries, in which boxes count as visible until the device has answered.
///
/// Boxes are identified by their exact coordinates: a box that has moved counts as a new box without an
/// answer, and so does every box once the scene's origin has moved. A box that falls between the samples of
/// the device counts as hidden, so the map is only as accurate as the resolution of the device.
///
/// ```
/// use visibility_core::{occlusion::{HardwareQueries, LateAnswers}, OcclusionCuller};
/// # struct Silent;
/// # impl visibility_core::occlusion::QueryDevice for Silent {
/// #     fn ask(&mut self, _: u64, _: &[visibility_core::Aabb]) {}
/// #     fn answers(&mut self, _: &mut dyn FnMut(u64, u32)) {}
/// # }
/// # let device = Silent;
/// let culler = OcclusionCuller::new(HardwareQueries::new(device, LateAnswers::Visible));
/// # let _ = culler;
/// ```
#[derive(Debug)]
pub struct HardwareQueries<D> {
    late: LateAnswers,
    /// Number of frames begun so far, which is also the number of the present frame. All looks at a frame
    /// share its number.
    frame: u64,
    /// Number of the first frame whose answers are about the present depth buffer: view, scene, candidates
    /// and occluders have been the same since. The present frame, if it began with a look ahead.
    since: u64,
    /// Least value of `since` in the next frame: that frame's number, if this frame's depth buffer holds what
    /// only its earlier looks left or added.
    least_since: u64,
    /// Whether the present look is not the first of its frame.
    is_later_look: bool,
    /// View of the present frame. `None` before the first frame, and when the depth buffer will differ for
    /// another reason.
    view: Option<View>,
    /// Origin of the scene, to which the boxes of `boxes` are relative; NaN before the first
    /// frame.
    origin: DVec3,
    near: Option<ViewPlane>,
    /// Clip planes of the view. `None` if `f64` cannot represent one of them.
    clip_planes: Option<ViewPlanes>,
    /// Hashes of the occluders added in the present frame and in the frame before.
    drawn: [Fingerprint; 2],
    /// Whether a look ahead is running.
    is_ahead: bool,
    /// Whether the last look was a look ahead, so that the next look may be at the same frame.
    is_frame_open: bool,
    /// Number, from 0 in each frame, of the look ahead that begins next. `None` outside of
    /// [`OcclusionCuller::look_ahead`].
    next_look_ahead: Option<u32>,
    boxes: Boxes<D>,
}

impl<D: QueryDevice> HardwareQueries<D> {
    /// Makes a map over a device without any answers, with a policy for answers that arrive late.
    pub fn new(device: D, late: LateAnswers) -> Self {
        Self {
            late,
            frame: 0,
            since: 0,
            least_since: 0,
            is_later_look: false,
            view: None,
            origin: DVec3::NAN,
            near: None,
            clip_planes: None,
            drawn: [Fingerprint::new(); 2],
            is_ahead: false,
            is_frame_open: false,
            next_look_ahead: None,
            boxes: Boxes::new(device),
        }
    }

    /// Returns the query device that the map asks.
    pub fn device_mut(&mut self) -> &mut D {
        &mut self.boxes.device
    }

    /// Sets the number of samples up to which a query counts as hidden. 0 by default. A greater number hides
    /// objects of which little shows, and makes the map [approximate](Accuracy::Approximate): each query may
    /// lose as many pixels. It needs a device that counts samples.
    #[must_use]
    pub fn with_max_samples(mut self, samples: u32) -> Self {
        self.boxes.max_samples = samples;
        self
    }

    /// Tells the map that the depth buffer will differ from the frame before for reasons that the culler
    /// cannot see. To be called before the frame is culled. [`LateAnswers::Visible`] then uses no answer for
    /// an earlier frame. The reasons are:
    ///
    /// - Something has moved, gone or appeared that is drawn but is no object of the scene.
    /// - Objects are left out of the set, or put into it, after the cull: by later stages or by hand.
    /// - An object is drawn otherwise, within the same bounds: at another level of detail or opacity, in
    ///   another pose, with another material, mask or displacement.
    /// - The samples of the picture are others with an equal view: another resolution, or a jitter that is
    ///   not in the view's matrix.
    ///
    /// - The frame before was abandoned after a [look ahead](OcclusionCuller::look_ahead), the frame to come
    ///   has the same view and does not look ahead, and it does not draw all that the abandoned frame drew.
    ///
    /// But for an abandoned frame, there is no need to call it for another view, scene or origin, nor for
    /// changes of the scene or of the candidates that the earlier stages leave. A frame that looks ahead does
    /// not need it either: it uses no answers for earlier frames. [`LateAnswers::Trusted`] is not affected.
    pub fn invalidate(&mut self) {
        self.view = None;
    }

    /// Returns the result for a box that needs no query: visible if it is not finite, partially visible if it
    /// reaches the near plane or a clip plane. `None` for all other boxes.
    fn decided(&self, bounds: &Aabb) -> Option<Occlusion> {
        if !bounds.is_finite() {
            return Some(Occlusion::Visible);
        }
        // A plane that crosses the box clips it when it is drawn. The remaining part may be hidden by walls
        // that do not hide the whole box.
        let is_whole = |plane: &ViewPlane| plane.contains_box(bounds);
        let unclipped = self.near.is_some_and(|near| is_whole(&near))
            && self.clip_planes.is_some_and(|planes| planes.as_slice().iter().all(is_whole));
        (!unclipped).then_some(Occlusion::Partial)
    }

    /// Returns the result of a test in the present frame, given the newest answer about the box. Visible for
    /// `None`, a box without an answer.
    fn judge(&self, answer: Option<Answer>) -> Occlusion {
        match answer {
            // If the newest answer about a box is visible, of whatever age, the boxes inside are tested.
            Some(answer) if !answer.is_hidden => Occlusion::Partial,
            Some(answer) if answer.frame >= self.first_that_counts() => Occlusion::Hidden,
            // A look ahead leaves out hidden and new boxes: the device is asked about them first.
            _ if self.is_ahead => Occlusion::Hidden,
            // Unanswered boxes count as wholly visible, so that no queries are issued for the boxes inside.
            _ => Occlusion::Visible,
        }
    }

    /// Tests a box by the answers that the map has, and notes the box for the next query if one is due.
    fn note(&mut self, bounds: &Aabb) -> Occlusion {
        // Trusted answers are always renewed, since `invalidate` need not be called for them.
        let renewed = if self.late == LateAnswers::Visible { self.since } else { self.frame };
        self.decided(bounds).unwrap_or_else(|| {
            let answer = self.boxes.answer(bounds, self.frame, renewed);
            self.judge(answer)
        })
    }

    /// Notes that candidates or occluders are not those of the look before. Answers to earlier looks of this
    /// frame still count: what these looks left has been drawn. The next frame does not draw it, if its
    /// candidates are those of the present look, so it uses no answer of this frame.
    fn picture_changed(&mut self) {
        self.since = self.frame;
        if self.is_later_look {
            self.least_since = self.frame + 1;
        }
    }

    /// Returns the number of the first frame whose answers may be used in the present frame.
    fn first_that_counts(&self) -> u64 {
        match self.late {
            LateAnswers::Visible => self.since,
            LateAnswers::Trusted { frames } => self.frame.saturating_sub(u64::from(frames)),
        }
    }
}

impl<D: QueryDevice> OcclusionMap for HardwareQueries<D> {
    fn name(&self) -> &str {
        "hardware queries"
    }

    fn accuracy(&self) -> Accuracy {
        if self.boxes.max_samples > 0 { Accuracy::Approximate } else { self.late.accuracy() }
    }

    fn answers_at_once(&self) -> bool {
        false
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        if self.origin != origin {
            // The origin has moved, so boxes of equal coordinates are now other boxes.
            self.reset();
            self.origin = origin;
        }
        // A look ahead is followed by another look at the same frame, unless something has changed or the
        // frame was abandoned.
        let look_ahead = self.next_look_ahead.take();
        let is_same_frame = self.is_frame_open && look_ahead != Some(0) && self.view == Some(*view);
        self.frame += u64::from(!is_same_frame);
        self.is_ahead = look_ahead.is_some();
        self.is_frame_open = self.is_ahead;
        self.drawn = [Fingerprint::new(), self.drawn[0]];
        // A frame that begins with a look ahead gets answers about all that it draws, so it needs no others.
        // Its later looks find `since` at their frame already.
        if self.view != Some(*view) || self.is_ahead {
            self.view = Some(*view);
            self.since = self.frame;
        }
        self.is_later_look = is_same_frame;
        if !is_same_frame {
            self.since = self.since.max(self.least_since);
        }
        self.near = view.near_plane(origin);
        let planes = view.clip_planes_from(origin);
        self.clip_planes = (planes.as_slice().len() == view.clip_planes().len()).then_some(planes);
        self.boxes.listen(self.frame);
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        if !self.clip_planes.is_some_and(|planes| occluder.is_inside(&planes, transform)) {
            return;
        }
        let numbers = transform.to_cols_array().map(f32::to_bits).into_iter();
        let hash = numbers.fold(self.drawn[0], Fingerprint::with);
        self.drawn[0] = hash.with_u64(occluder.fingerprint().value());
        self.boxes.device.draw(occluder, transform);
    }

    fn flush(&mut self) {
        if self.drawn[0] != self.drawn[1] {
            self.picture_changed();
        }
    }

    /// Tests a box by the answers that the map has. Issues no query, unlike
    /// [`test_mut`](OcclusionMap::test_mut).
    fn test(&self, bounds: &Aabb) -> Occlusion {
        self.decided(bounds).unwrap_or_else(|| self.judge(self.boxes.known(bounds)))
    }

    fn test_mut(&mut self, bounds: &Aabb) -> Occlusion {
        let answer = self.note(bounds);
        self.boxes.ask(self.frame);
        answer
    }

    fn test_64_mut(&mut self, boxes: &Boxes64, candidates: u64) -> Occlusion64 {
        let answer = Occlusion64::of_each(candidates, |lane| self.note(&boxes.get(lane)));
        self.boxes.ask(self.frame);
        answer
    }

    fn scene_changed(&mut self) {
        self.invalidate();
    }

    fn candidates_changed(&mut self) {
        self.picture_changed();
    }

    fn reset(&mut self) {
        self.view = None;
        self.boxes.reset();
    }
}

impl<D: QueryDevice, H: BoxHierarchy> OcclusionCuller<HardwareQueries<D>, H> {
    /// Looks ahead at a frame: leaves the objects to draw first in `visible`. These are all objects but those
    /// whose newest answer was hidden, whatever its view and age, and new ones. The map asks about both, and
    /// the device compares them with what has been drawn. [`cull`](Culler::cull) with the same view ends the
    /// frame. It leaves what remains to be drawn, and hides by answers for this frame alone under
    /// [`LateAnswers::Visible`].
    ///
    /// In between, the engine draws what the look ahead left, and waits for the answers. Answers that arrive
    /// later do not count. Where a node or a group of boxes comes into view, all objects in it count as
    /// visible for that frame. A second look ahead asks about each part of these. `look` is the number of the
    /// look in its frame, from 0.
    ///
    /// The [accuracy](Culler::accuracy) of the culler is that of `cull`: what a look ahead leaves out may be
    /// visible. A look ahead only affects the cull that ends its frame, and no other cull:
    ///
    /// - Look 0 begins a frame. If the frame before it was abandoned after a look ahead, its answers do not
    ///   count, even if the view is the same.
    /// - A frame without a look ahead that follows an abandoned frame of the same view counts as its end.
    ///   Call [`HardwareQueries::invalidate`] before it unless the same objects are drawn again, also if
    ///   earlier stages have removed them from the set.
    /// - If scene, view or origin change between the looks at a frame, the next look begins a frame. The
    ///   engine then clears the depth buffer, and draws this frame anew.
    ///
    /// ```
    /// # use visibility_core::{Aabb, Culler, FrustumCuller, ObjectId, Pose, Scene, View, VisibleSet};
    /// # use visibility_core::glam::DVec3;
    /// # use visibility_core::{OcclusionCuller, occlusion::{HardwareQueries, LateAnswers, QueryDevice}};
    /// # struct Card;
    /// # impl QueryDevice for Card {
    /// #     fn ask(&mut self, _: u64, _: &[Aabb]) {}
    /// #     fn answers(&mut self, _: &mut dyn FnMut(u64, u32)) {}
    /// # }
    /// # impl Card { fn wait(&mut self) {} }
    /// fn frame(
    ///     culler: &mut OcclusionCuller<HardwareQueries<Card>>, scene: &Scene, view: &View,
    ///     visible: &mut VisibleSet, mut draw_once: impl FnMut(ObjectId),
    /// ) {
    ///     for is_ahead in [true, false] {
    ///         visible.fill(scene, view);
    ///         FrustumCuller::new().cull(scene, view, visible);
    ///         if is_ahead {
    ///             culler.look_ahead(scene, view, visible, 0);
    ///         } else {
    ///             culler.cull(scene, view, visible);
    ///         }
    ///         visible.iter(scene).for_each(&mut draw_once); // but for what the frame has drawn
    ///         culler.map_mut().device_mut().wait();
    ///     }
    /// }
    /// # let mut culler = OcclusionCuller::new(HardwareQueries::new(Card, LateAnswers::Visible));
    /// # let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 9.0);
    /// # frame(&mut culler, &Scene::new(), &view.unwrap(), &mut VisibleSet::new(), |_| {});
    /// ```
    pub fn look_ahead(
        &mut self,
        scene: &Scene,
        view: &View,
        visible: &mut VisibleSet,
        look: u32,
    ) -> CullStats {
        // The cull begins a look of the map, which takes the number.
        self.map_mut().next_look_ahead = Some(look);
        let stats = self.cull(scene, view, visible);
        self.map_mut().is_ahead = false;
        stats
    }
}
