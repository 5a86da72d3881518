//! Hardware occlusion queries of the engine as an occlusion map. The graphics card answers some frames late.
//!
//! The graphics card compares boxes with the depth buffer that it has drawn (Cohen-Or, Chrysanthou, Silva and
//! Durand, "A Survey of Visibility for Walkthrough Applications", 2003, sections 6.4 and 6.5: the HP
//! occlusion-culling test, and Meissner et al.). Waiting for an answer would stall the card, so answers are
//! collected when they arrive.

use super::{OccluderMesh, Occlusion, Occlusion64, OcclusionMap};
use crate::binary_format::Fingerprint;
use crate::{
    Aabb, Accuracy, View,
    scene::Boxes64,
    view::{ViewPlane, ViewPlanes},
};
use alloc::vec::Vec;
use glam::{Affine3A, DVec3};
use hashbrown::HashMap;

/// Hardware occlusion queries, implemented by the engine over its graphics API.
///
/// ```
/// use visibility_core::{occlusion::QueryDevice, Aabb};
/// /// A device that never answers.
/// struct Silent;
/// impl QueryDevice for Silent {
///     fn ask(&mut self, _query: u64, _bounds: &Aabb) {}
///     fn answers(&mut self, _each: &mut dyn FnMut(u64, bool)) {}
/// }
/// ```
pub trait QueryDevice {
    /// Issues the query with number `query`: does any sample of the box pass the depth test against what has
    /// been drawn this frame? `bounds` are relative to the scene's origin and never reach the near plane.
    fn ask(&mut self, query: u64, bounds: &Aabb);

    /// Calls `each` for every answer that has arrived since the last call, with the number of the query and
    /// whether any sample passed (true: visible).
    fn answers(&mut self, each: &mut dyn FnMut(u64, bool));

    /// Draws an occluder into the depth buffer. `transform` takes mesh coordinates to scene-relative
    /// coordinates. The default does nothing, for engines that draw their occluders themselves before
    /// culling.
    fn draw(&mut self, _occluder: &OccluderMesh, _transform: &Affine3A) {}
}

/// Policy for query answers that refer to an earlier frame: whether they may hide boxes.
///
/// ```
/// use visibility_core::{occlusion::LateAnswers, Accuracy};
/// assert_eq!(LateAnswers::Visible.accuracy(), Accuracy::Conservative);
/// assert_eq!(LateAnswers::Trusted { frames: 2 }.accuracy(), Accuracy::Approximate);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LateAnswers {
    /// An answer is used only if view and occluders are the same as when its query was issued; otherwise the
    /// box counts as visible. Nothing visible is ever hidden. A still camera culls every hidden box. A moving
    /// camera culls nothing, since answers arrive at least one frame late.
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
    /// picture.
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
/// #     fn ask(&mut self, _: u64, _: &visibility_core::Aabb) {}
/// #     fn answers(&mut self, _: &mut dyn FnMut(u64, bool)) {}
/// # }
/// # let device = Silent;
/// let culler = OcclusionCuller::new(HardwareQueries::new(device, LateAnswers::Visible));
/// # let _ = culler;
/// ```
#[derive(Debug)]
pub struct HardwareQueries<D> {
    late: LateAnswers,
    /// Number of frames begun so far, which is also the number of the present frame.
    frame: u64,
    /// Number of the frame in which view or occluders last changed: they have been the same from that frame
    /// on.
    since: u64,
    view: Option<View>,
    /// Origin of the scene, to which the boxes of `State::questions` are relative; NaN before the first
    /// frame.
    origin: DVec3,
    near: Option<ViewPlane>,
    /// Clip planes of the view. `None` if `f64` cannot represent one of them.
    clip_planes: Option<ViewPlanes>,
    /// Hashes of the occluders added in the present frame and in the frame before.
    drawn: [Fingerprint; 2],
    state: State<D>,
}

#[derive(Debug)]
struct State<D> {
    device: D,
    /// Maps each known box, by the bits of its six coordinates, to its slot in `questions`.
    indices: HashMap<[u32; 6], usize>,
    questions: Vec<Question>,
    free: Vec<usize>,
}

/// A box for which a query was issued.
#[derive(Clone, Copy, Debug)]
struct Question {
    bits: [u32; 6],
    /// Reuse count of this slot in `questions`, the upper half of the query number. Distinguishes the query
    /// from those for earlier boxes in the slot.
    serial: u32,
    /// Whether this slot of `State::questions` is in use: `State::indices` then maps a box to it.
    known: bool,
    /// Number of the frame in which the newest query for the box was issued.
    asked: u64,
    /// Whether a query for the box was issued and has no answer yet.
    under_way: bool,
    /// Newest answer: the number of the frame in which its query was issued, and whether the box was hidden.
    /// `None` without an answer.
    answer: Option<(u64, bool)>,
}

/// Age of a query without an answer, in frames, beyond which the map forgets the box: the device has lost the
/// query.
const MAX_FRAMES_UNDER_WAY: u64 = 64;

/// Number of frames after the last question about a box that is not tested any more, beyond which the map
/// forgets the box once it has an answer: its object has moved on. The node above it may have been hidden, or
/// visible as a whole, meanwhile.
const MAX_IDLE_FRAMES: u64 = 8;

impl<D: QueryDevice> HardwareQueries<D> {
    /// Makes a map over a device without any answers, with a policy for answers that arrive late.
    pub fn new(device: D, late: LateAnswers) -> Self {
        let state = State { device, indices: HashMap::new(), questions: Vec::new(), free: Vec::new() };
        let (origin, drawn) = (DVec3::NAN, [Fingerprint::new(); 2]);
        let (near, clip_planes) = (None, None);
        Self { late, frame: 0, since: 0, view: None, origin, near, clip_planes, drawn, state }
    }

    /// Returns the query device that the map asks.
    pub fn device_mut(&mut self) -> &mut D {
        &mut self.state.device
    }

    /// Tells the map that the depth buffer will differ from the frame before for reasons that the map cannot
    /// see, such as occluders drawn by the engine. To be called before [`begin`](OcclusionMap::begin).
    /// Answers for earlier frames are then no longer used under [`LateAnswers::Visible`].
    /// [`LateAnswers::Trusted`] is not affected.
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

    /// Returns the result of a test in the present frame, given the box's newest [answer](Question::answer).
    /// Visible for `None`, a box without an answer.
    fn judge(&self, answer: Option<(u64, bool)>) -> Occlusion {
        match answer {
            Some((about, true)) if about >= self.first_that_counts() => Occlusion::Hidden,
            Some((about, false)) if about >= self.first_that_counts() => Occlusion::Partial,
            // Unanswered boxes count as wholly visible, so that no queries are issued for the boxes inside.
            _ => Occlusion::Visible,
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

impl<D: QueryDevice> State<D> {
    /// Returns the newest answer for a box: the number of the frame in which its query was issued, and
    /// whether the box was hidden. `None` without an answer.
    fn known(&self, bounds: &Aabb) -> Option<(u64, bool)> {
        self.questions[*self.indices.get(&key(bounds))?].answer
    }

    /// Forgets boxes that were not tested in the last frame and whose answers are too old, for the policy or
    /// by [`MAX_IDLE_FRAMES`], and boxes whose queries were lost. Then collects the answers that have
    /// arrived. `frame` is the number of the present frame, `first` that of the first frame whose answers
    /// count.
    fn listen(&mut self, frame: u64, first: u64) {
        let Self { device, indices, questions, free } = self;
        for (index, question) in questions.iter_mut().enumerate() {
            let age = frame - question.asked;
            // A test of an answered box asks again, so a box without a query under way was not tested.
            let is_forgotten = match question.under_way {
                true => age > MAX_FRAMES_UNDER_WAY,
                false => question.asked < first || age > MAX_IDLE_FRAMES,
            };
            if question.known && is_forgotten {
                *question = Question { known: false, under_way: false, answer: None, ..*question };
                indices.remove(&question.bits);
                free.push(index);
            }
        }
        device.answers(&mut |query, passed| {
            let (index, serial) = (query as u32 as usize, (query >> 32) as u32);
            if let Some(question) = questions.get_mut(index)
                && question.under_way
                && question.serial == serial
            {
                question.under_way = false;
                question.answer = Some((question.asked, !passed));
            }
        });
    }

    /// Returns the newest answer about a box relative to the scene's origin: the number of the frame in which
    /// its query was issued, and whether the box was hidden. `None` without an answer. Issues a query for
    /// `frame` unless a query is under way or the newest answer is already for `frame`.
    fn answer(&mut self, bounds: &Aabb, frame: u64) -> Option<(u64, bool)> {
        let bits = key(bounds);
        let Self { device, indices, questions, free } = self;
        let index = *indices.entry(bits).or_insert_with(|| {
            let index = free.pop().unwrap_or(questions.len());
            let serial = questions.get(index).map_or(0, |question| question.serial.wrapping_add(1));
            let question =
                Question { bits, serial, known: true, asked: frame, under_way: false, answer: None };
            match questions.get_mut(index) {
                Some(old) => *old = question,
                None => questions.push(question),
            }
            index
        });
        let question = &mut questions[index];
        if !question.under_way && question.answer.is_none_or(|(about, _)| about < frame) {
            question.under_way = true;
            question.asked = frame;
            device.ask(index as u64 | u64::from(question.serial) << 32, bounds);
        }
        question.answer
    }
}

/// Returns the six coordinates of a box as bits.
fn key(bounds: &Aabb) -> [u32; 6] {
    let [x0, y0, z0] = bounds.min.to_array().map(f32::to_bits);
    let [x1, y1, z1] = bounds.max.to_array().map(f32::to_bits);
    [x0, y0, z0, x1, y1, z1]
}

impl<D: QueryDevice> OcclusionMap for HardwareQueries<D> {
    fn name(&self) -> &str {
        "hardware queries"
    }

    fn accuracy(&self) -> Accuracy {
        self.late.accuracy()
    }

    fn answers_at_once(&self) -> bool {
        false
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        self.frame += 1;
        self.drawn = [Fingerprint::new(), self.drawn[0]];
        if self.origin != origin {
            // The origin has moved, so boxes of equal coordinates are now other boxes.
            self.reset();
            self.origin = origin;
        }
        if self.view != Some(*view) {
            self.view = Some(*view);
            self.since = self.frame;
        }
        self.near = view.near_plane(origin);
        let planes = view.clip_planes_from(origin);
        self.clip_planes = (planes.as_slice().len() == view.clip_planes().len()).then_some(planes);
        let first = self.first_that_counts();
        self.state.listen(self.frame, first);
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        let numbers = transform.to_cols_array().map(f32::to_bits).into_iter();
        let hash = numbers.fold(self.drawn[0], Fingerprint::with);
        self.drawn[0] = hash.with_u64(occluder.fingerprint().value());
        self.state.device.draw(occluder, transform);
    }

    fn flush(&mut self) {
        if self.drawn[0] != self.drawn[1] {
            self.since = self.frame;
        }
    }

    /// Tests a box by the answers that the map has. Issues no query, unlike
    /// [`test_mut`](OcclusionMap::test_mut).
    fn test(&self, bounds: &Aabb) -> Occlusion {
        self.decided(bounds).unwrap_or_else(|| self.judge(self.state.known(bounds)))
    }

    fn test_mut(&mut self, bounds: &Aabb) -> Occlusion {
        self.decided(bounds).unwrap_or_else(|| {
            let answer = self.state.answer(bounds, self.frame);
            self.judge(answer)
        })
    }

    fn test_64_mut(&mut self, boxes: &Boxes64, candidates: u64) -> Occlusion64 {
        Occlusion64::of_each(candidates, |lane| self.test_mut(&boxes.get(lane)))
    }

    fn reset(&mut self) {
        self.view = None;
        for question in &mut self.state.questions {
            // The new serial number makes the map ignore answers to queries still under way.
            *question = Question {
                serial: question.serial.wrapping_add(1),
                under_way: false,
                answer: None,
                ..*question
            };
        }
    }
}
