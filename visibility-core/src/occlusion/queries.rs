//! An engine's own occlusion queries as a map: the graphics card answers, some frames late.
//!
//! The card compares boxes with the depth buffer that it has drawn (Cohen-Or, Chrysanthou, Silva and Durand,
//! "A Survey of Visibility for Walkthrough Applications", 2003, sections 6.4 and 6.5: the HP
//! occlusion-culling test, and Meissner et al.). Asking and waiting would stall it, so answers are taken when
//! they come.

use super::mesh::fnv;
use super::{OccluderMesh, Occlusion, OcclusionMap};
use crate::{Aabb, Accuracy, View, geometry::Containment, view::ViewPlane};
use alloc::vec::Vec;
use core::cell::RefCell;
use glam::{Affine3A, DVec3};
use hashbrown::HashMap;

/// What an engine implements over its graphics API.
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
    /// Issues a query, never about a box that reaches the near plane: is any sample of this box, relative to
    /// the scene's origin, in front of what has been drawn this frame?
    fn ask(&mut self, query: u64, bounds: &Aabb);

    /// Hands over the answers that have come since the last call: the query, and whether any sample passed.
    fn answers(&mut self, each: &mut dyn FnMut(u64, bool));

    /// Draws an occluder into the depth buffer, where the engine does not do that itself before culling.
    fn draw(&mut self, _occluder: &OccluderMesh, _transform: &Affine3A) {}
}

/// What becomes of answers that are about an earlier frame.
///
/// ```
/// use visibility_core::{occlusion::LateAnswers, Accuracy};
/// assert_eq!(LateAnswers::Visible.accuracy(), Accuracy::Conservative);
/// assert_eq!(LateAnswers::Trusted { frames: 2 }.accuracy(), Accuracy::Approximate);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LateAnswers {
    /// They count as visible, unless neither the view nor the occluders have changed since. Nothing ever
    /// pops; a still camera culls all, a moving one nothing, since answers come a frame late at the
    /// earliest.
    Visible,
    /// They are believed for so many frames: what comes into view may pop in that much late.
    Trusted {
        /// Frames.
        frames: u32,
    },
}

impl LateAnswers {
    /// What a map with this setting promises, if the device samples no coarser than the picture.
    pub const fn accuracy(self) -> Accuracy {
        match self {
            Self::Visible => Accuracy::Conservative,
            Self::Trusted { .. } => Accuracy::Approximate,
        }
    }
}

/// A map that asks a device, and takes boxes for visible until it answers.
///
/// A box is known again by its coordinates: one that moves is a new question. What the picture cannot show (a
/// box between samples of the device) counts as hidden, so the promise of the map is relative to the
/// picture's own resolution.
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
    /// Frames begun so far.
    frame: u64,
    /// The first frame that saw what this one sees: same view, same occluders.
    since: u64,
    view: Option<(View, DVec3)>,
    near: Option<ViewPlane>,
    /// A hash of the occluders added in this frame, and of those of the frame before.
    drawn: [u64; 2],
    /// Testing asks, and asking changes the device.
    state: RefCell<State<D>>,
}

#[derive(Debug)]
struct State<D> {
    device: D,
    /// Where in `questions` a box is, by its bits.
    places: HashMap<[u32; 6], usize>,
    questions: Vec<Question>,
    free: Vec<usize>,
}

/// A box that was asked about.
#[derive(Clone, Copy, Debug)]
struct Question {
    bits: [u32; 6],
    /// Tells queries about this box from those about others that had its place before.
    serial: u32,
    /// Whether `places` leads here.
    known: bool,
    /// The frame of the newest query.
    asked: u64,
    under_way: bool,
    /// The frame that the newest answer is about, and whether it said hidden.
    answer: Option<(u64, bool)>,
}

/// A box that was not asked about for so many frames is forgotten: its object has moved on, or the device has
/// lost the query.
const FORGET: u64 = 64;

impl<D: QueryDevice> HardwareQueries<D> {
    /// Over a device.
    pub fn new(device: D, late: LateAnswers) -> Self {
        let state = State { device, places: HashMap::new(), questions: Vec::new(), free: Vec::new() };
        Self { late, frame: 0, since: 0, view: None, near: None, drawn: [0; 2], state: RefCell::new(state) }
    }

    /// The device.
    pub fn device_mut(&mut self) -> &mut D {
        &mut self.state.get_mut().device
    }

    /// Says that the device's depth buffer will hold something else than in the frame before, for reasons
    /// that the map cannot see: the engine draws occluders of its own. What is answered about earlier
    /// frames no longer counts.
    pub fn invalidate(&mut self) {
        self.view = None;
    }

    /// Whether an answer about a frame says anything about this one.
    fn counts(&self, about: u64) -> bool {
        match self.late {
            LateAnswers::Visible => about >= self.since,
            LateAnswers::Trusted { frames } => self.frame - about <= u64::from(frames),
        }
    }
}

impl<D: QueryDevice> State<D> {
    /// Takes the answers that have come, and forgets what is no longer asked.
    fn listen(&mut self, frame: u64) {
        let Self { device, places, questions, free } = self;
        device.answers(&mut |query, passed| {
            let (place, serial) = (query as u32 as usize, (query >> 32) as u32);
            if let Some(question) = questions.get_mut(place)
                && question.under_way
                && question.serial == serial
            {
                question.under_way = false;
                question.answer = Some((question.asked, !passed));
            }
        });
        for (place, question) in questions.iter_mut().enumerate() {
            if question.known && frame - question.asked > FORGET {
                *question = Question { known: false, under_way: false, answer: None, ..*question };
                places.remove(&question.bits);
                free.push(place);
            }
        }
    }

    /// What is known of a box, which is asked about unless it is known for this frame or being asked.
    fn answer(&mut self, bounds: &Aabb, frame: u64) -> Option<(u64, bool)> {
        let [x0, y0, z0] = bounds.min.to_array().map(f32::to_bits);
        let [x1, y1, z1] = bounds.max.to_array().map(f32::to_bits);
        let bits = [x0, y0, z0, x1, y1, z1];
        let Self { device, places, questions, free } = self;
        let place = *places.entry(bits).or_insert_with(|| {
            let place = free.pop().unwrap_or(questions.len());
            let serial = questions.get(place).map_or(0, |question| question.serial.wrapping_add(1));
            let question =
                Question { bits, serial, known: true, asked: frame, under_way: false, answer: None };
            match questions.get_mut(place) {
                Some(old) => *old = question,
                None => questions.push(question),
            }
            place
        });
        let question = &mut questions[place];
        if !question.under_way && question.answer.is_none_or(|(about, _)| about < frame) {
            question.under_way = true;
            question.asked = frame;
            device.ask(place as u64 | u64::from(question.serial) << 32, bounds);
        }
        question.answer
    }
}

impl<D: QueryDevice> OcclusionMap for HardwareQueries<D> {
    fn name(&self) -> &str {
        "hardware queries"
    }

    fn accuracy(&self) -> Accuracy {
        self.late.accuracy()
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        self.frame += 1;
        self.drawn = [0, self.drawn[0]];
        if self.view != Some((*view, origin)) {
            self.view = Some((*view, origin));
            self.since = self.frame;
        }
        self.near = view.near_plane(origin);
        self.state.get_mut().listen(self.frame);
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        let print = occluder.fingerprint();
        let numbers = transform.to_cols_array().map(f32::to_bits).into_iter();
        self.drawn[0] = numbers.chain([print as u32, (print >> 32) as u32, 1]).fold(self.drawn[0], fnv);
        self.state.get_mut().device.draw(occluder, transform);
    }

    fn flush(&mut self) {
        if self.drawn[0] != self.drawn[1] {
            self.since = self.frame;
        }
    }

    fn test(&self, bounds: &Aabb) -> Occlusion {
        if !bounds.is_finite() {
            return Occlusion::Visible;
        }
        // A box that reaches the near plane is clipped when it is drawn, and what is left of it may lie
        // behind walls that it is not behind.
        let surely_before = |plane: &ViewPlane| plane.plane.classify_aabb(bounds) == Containment::Inside;
        if !self.near.is_some_and(|near| surely_before(&near)) {
            return Occlusion::Partial;
        }
        match self.state.borrow_mut().answer(bounds, self.frame) {
            Some((about, true)) if self.counts(about) => Occlusion::Hidden,
            Some((about, false)) if self.counts(about) => Occlusion::Partial,
            // Taken whole until the answer is there, rather than asking about everything inside as well.
            _ => Occlusion::Visible,
        }
    }

    fn reset(&mut self) {
        self.view = None;
        for question in &mut self.state.get_mut().questions {
            // What is under way is no longer waited for.
            *question = Question {
                serial: question.serial.wrapping_add(1),
                under_way: false,
                answer: None,
                ..*question
            };
        }
    }
}
