//! Boxes that a map of hardware queries has asked about, and the queries that are under way.
//!
//! Scheduling follows Mattausch, Bittner and Wimmer, "CHC++: Coherent Hierarchical Culling Revisited", 2008:
//!
//! - *Multiqueries*: one query asks about a group of siblings that were hidden or are new. If no sample
//!   passes, all of them are hidden. If samples pass, the query tells nothing about any one of them, and the
//!   next queries ask about the halves of the group. Boxes that are found hidden join groups of twice the
//!   size again. The paper asks about each box of the group alone, and sizes groups by an estimate of how
//!   long boxes stay hidden. On three stored scenes, its rule took 1.3 to 1.5 times as many queries. Trusted
//!   answers then missed 15 to 36 % fewer objects and drew 2 to 10 % more; with a look ahead, 15 % fewer to
//!   2 % more were drawn.
//! - *Tight bounds*: a group of all children stands for a node whose own box is visible though none of its
//!   children is. The paper tests such a proxy in place of the box.
//! - *Random reuse*: a visible box is asked about again after a random number of frames, which spreads the
//!   queries about visible boxes over the frames.

use super::device::QueryDevice;
use crate::Aabb;
use crate::random::Random;
use alloc::vec::Vec;
use hashbrown::HashMap;

/// Age of a query without an answer, in frames, beyond which the device has lost it.
const MAX_FRAMES_UNDER_WAY: u64 = 64;

/// Number of frames after the last test of a box beyond which the map forgets the box: its object has moved
/// on. The node above it may have been hidden, or visible as a whole, meanwhile.
const MAX_IDLE_FRAMES: u64 = 8;

/// Greatest number of boxes in a query. When a box comes into view, its whole group may count as visible for
/// a frame: larger groups take fewer queries and report more.
const MAX_GROUP: usize = 16;

/// Greatest number of frames from an answer that a box is visible to the next query about the box.
const MAX_REUSE: usize = 8;

/// Newest answer about a box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answer {
    /// Number of the frame in which the query was issued.
    pub frame: u64,
    /// Whether the box was hidden.
    pub is_hidden: bool,
}

/// A box that was tested, in a slot that is reused.
#[derive(Clone, Copy, Debug)]
struct Question {
    /// The six coordinates of the box.
    bits: [u32; 6],
    /// Reuse count of this slot in `Boxes::questions`, by which answers about earlier boxes are told apart.
    serial: u32,
    /// Number of the frame of the last test.
    tested: u64,
    /// Whether a query for the box was issued and has no answer yet.
    under_way: bool,
    /// Greatest number of boxes of a query that may include the box, from 1 to [`MAX_GROUP`].
    max_group: usize,
    /// Number of the frame from which a visible box is asked about again.
    due: u64,
    answer: Option<Answer>,
}

/// A query, in a slot that is reused.
#[derive(Debug)]
struct Query {
    /// Reuse count of this slot in `Boxes::queries`, the upper half of the query's number.
    serial: u32,
    /// Number of the frame in which the query was issued.
    asked: u64,
    /// Slot and serial number of each question that the query is about. Empty if the slot is free.
    members: Vec<(usize, u32)>,
}

/// All boxes that were tested of late, and the device that answers questions about them.
#[derive(Debug)]
pub(super) struct Boxes<D> {
    pub device: D,
    /// Greatest number of passed samples of a query whose boxes count as hidden.
    pub max_samples: u32,
    /// Maps each known box, by the bits of its six coordinates, to its slot in `questions`.
    indices: HashMap<[u32; 6], usize>,
    questions: Vec<Question>,
    /// Slots of `questions` that are in use: few, after a frame of many boxes.
    known_questions: Vec<usize>,
    free_questions: Vec<usize>,
    queries: Vec<Query>,
    /// Slots of `queries` that have no answer yet.
    open_queries: Vec<usize>,
    free_queries: Vec<usize>,
    /// Boxes to be asked about at the next [`ask`](Self::ask), each with the slot of its question.
    pending: Vec<(usize, Aabb)>,
    /// Boxes of the query that is being formed, with the slots of their questions beside them.
    group: Vec<Aabb>,
    group_slots: Vec<usize>,
}

impl<D: QueryDevice> Boxes<D> {
    pub(super) fn new(device: D) -> Self {
        Self {
            device,
            max_samples: 0,
            indices: HashMap::new(),
            questions: Vec::new(),
            known_questions: Vec::new(),
            free_questions: Vec::new(),
            queries: Vec::new(),
            open_queries: Vec::new(),
            free_queries: Vec::new(),
            pending: Vec::new(),
            group: Vec::new(),
            group_slots: Vec::new(),
        }
    }

    /// Returns the newest answer about a box, relative to the scene's origin. `None` without an answer.
    pub(super) fn known(&self, bounds: &Aabb) -> Option<Answer> {
        self.questions.get(*self.indices.get(&key(bounds))?)?.answer
    }

    /// Forgets boxes that were not tested for some frames, and queries that were lost. Then collects the
    /// answers that have arrived. `frame` is the number of the present frame.
    pub(super) fn listen(&mut self, frame: u64) {
        let Self { device, indices, questions, known_questions, free_questions, .. } = self;
        let Self { queries, open_queries, free_queries, .. } = self;
        for &index in open_queries.iter() {
            let Some(query) = queries.get_mut(index) else { continue };
            if frame - query.asked > MAX_FRAMES_UNDER_WAY {
                query.close(questions, |_| {});
                free_queries.push(index);
            }
        }
        known_questions.retain(|&index| {
            let Some(question) = questions.get_mut(index) else { return false };
            let is_idle = !question.under_way && frame - question.tested > MAX_IDLE_FRAMES;
            if is_idle {
                question.answer = None;
                indices.remove(&question.bits);
                free_questions.push(index);
            }
            !is_idle
        });
        let max_samples = self.max_samples;
        device.answers(&mut |number, samples| {
            let (index, serial) = (number as u32 as usize, (number >> 32) as u32);
            let Some(query) = queries.get_mut(index) else { return };
            if query.members.is_empty() || query.serial != serial {
                return;
            }
            let (frame, count, is_hidden) = (query.asked, query.members.len(), samples <= max_samples);
            query.close(questions, |question| {
                question.max_group =
                    if is_hidden { (2 * question.max_group).min(MAX_GROUP) } else { count.div_ceil(2) };
                if is_hidden || count == 1 {
                    question.answer = Some(Answer { frame, is_hidden });
                    // Different boxes are due in different frames.
                    let seed = question
                        .bits
                        .iter()
                        .fold(frame, |seed, &bits| seed.rotate_left(11) ^ u64::from(bits));
                    question.due = frame + 1 + Random(seed).below(MAX_REUSE) as u64;
                }
            });
            free_queries.push(index);
        });
        open_queries.retain(|&index| queries.get(index).is_some_and(|query| !query.members.is_empty()));
    }

    /// Returns the newest answer about a box relative to the scene's origin. `None` without an answer. Notes
    /// the box for the next [`ask`](Self::ask), unless a query is under way or the answer need not be
    /// renewed. `frame` is the number of the present frame. Hidden answers for frame `renewed` and later ones
    /// are not renewed.
    pub(super) fn answer(&mut self, bounds: &Aabb, frame: u64, renewed: u64) -> Option<Answer> {
        let bits = key(bounds);
        let Self { indices, questions, known_questions, free_questions, pending, .. } = self;
        let index = *indices.entry(bits).or_insert_with(|| {
            let index = free_questions.pop().unwrap_or(questions.len());
            let serial = questions.get(index).map_or(0, |question| question.serial.wrapping_add(1));
            let question = Question {
                bits,
                serial,
                tested: frame,
                under_way: false,
                max_group: MAX_GROUP,
                due: 0,
                answer: None,
            };
            match questions.get_mut(index) {
                Some(old) => *old = question,
                None => questions.push(question),
            }
            known_questions.push(index);
            index
        });
        let question = questions.get_mut(index)?;
        question.tested = frame;
        // `renewed` is not after `frame`, and a visible box is due after the frame of its answer: none is
        // asked about twice in a frame.
        let is_due = question.answer.is_none_or(|answer| {
            if answer.is_hidden { answer.frame < renewed } else { question.due <= frame }
        });
        if is_due && !question.under_way {
            question.under_way = true;
            pending.push((index, *bounds));
        }
        question.answer
    }

    /// Issues queries in frame `frame` about the boxes noted since the last call, which should be siblings,
    /// in their order.
    pub(super) fn ask(&mut self, frame: u64) {
        let mut pending = core::mem::take(&mut self.pending);
        let mut most = MAX_GROUP;
        for (slot, bounds) in pending.drain(..) {
            let Some(question) = self.questions.get(slot) else { continue };
            let own = question.max_group;
            if own == 1 {
                self.send(&[bounds], &[slot], frame);
                continue;
            }
            if self.group.len() >= most.min(own) {
                self.send_group(frame);
                most = own;
            }
            most = most.min(own);
            self.group.push(bounds);
            self.group_slots.push(slot);
        }
        self.send_group(frame);
        self.pending = pending;
    }

    /// Issues a query about the boxes in `group`, unless there are none.
    fn send_group(&mut self, frame: u64) {
        if self.group.is_empty() {
            return;
        }
        let (group, slots) = (core::mem::take(&mut self.group), core::mem::take(&mut self.group_slots));
        self.send(&group, &slots, frame);
        (self.group, self.group_slots) = (group, slots);
        self.group.clear();
        self.group_slots.clear();
    }

    /// Issues a query about boxes whose questions are in `slots`.
    fn send(&mut self, boxes: &[Aabb], slots: &[usize], frame: u64) {
        let Self { device, questions, queries, open_queries, free_queries, .. } = self;
        let index = free_queries.pop().unwrap_or(queries.len());
        if index == queries.len() {
            queries.push(Query { serial: 0, asked: 0, members: Vec::new() });
        }
        let Some(query) = queries.get_mut(index) else { return };
        query.asked = frame;
        open_queries.push(index);
        let serial = |&slot: &usize| Some((slot, questions.get(slot)?.serial));
        query.members.extend(slots.iter().filter_map(serial));
        device.ask(index as u64 | u64::from(query.serial) << 32, boxes);
    }

    /// Forgets all answers, also to queries that are under way.
    pub(super) fn reset(&mut self) {
        for question in &mut self.questions {
            // The new serial number makes the map ignore answers to queries still under way.
            *question = Question {
                serial: question.serial.wrapping_add(1),
                under_way: false,
                max_group: MAX_GROUP,
                answer: None,
                ..*question
            };
        }
    }
}

impl Query {
    /// Ends the query, and calls `each` for its questions that are still about the same boxes.
    fn close(&mut self, questions: &mut [Question], mut each: impl FnMut(&mut Question)) {
        self.serial = self.serial.wrapping_add(1);
        for (slot, serial) in self.members.drain(..) {
            if let Some(question) = questions.get_mut(slot)
                && question.serial == serial
            {
                question.under_way = false;
                each(question);
            }
        }
    }
}

/// Returns the six coordinates of a box as bits.
fn key(bounds: &Aabb) -> [u32; 6] {
    let [x0, y0, z0] = bounds.min.to_array().map(f32::to_bits);
    let [x1, y1, z1] = bounds.max.to_array().map(f32::to_bits);
    [x0, y0, z0, x1, y1, z1]
}
