//! Work that a frame may spend on occlusion, counted in triangles and paid by the objects found hidden.
//!
//! Terms, all of them work in triangles. The *price* is what hiding one object is worth. The *worth* of a
//! number of objects is the price times this number. The *credit* is what the search for occluders may still
//! spend: it begins with [`INITIAL_CREDIT`] and one price, and each object found hidden adds the price. The
//! *earnings* are the worth of all objects found hidden so far in the frame. An occluder that costs more than
//! the credit may be drawn on a *loan*: objects found hidden pay loans back before they add to the credit.
//! The objects *behind* an occluder are those that it may hide: all objects not found hidden so far.
//!
//! The budget does not measure time. It counts work in *triangles*, the cost of drawing one triangle of an
//! occluder: with the z-buffer about a tenth of a microsecond. The same frame therefore spends the same on
//! every machine.

use glam::DVec3;

/// Work in triangles that the search for occluders may spend in a frame before any object is found hidden, in
/// addition to the price of one object. Enough to draw the first batch of occluders and to test the boxes
/// behind them.
const INITIAL_CREDIT: f32 = 2048.0;

/// Work, in triangles, of testing one box of a block of 64 against the map. Measured with the z-buffer:
/// testing 64 boxes takes as long as drawing six triangles. A value three times as great ends the search too
/// early in frames of real levels.
const TEST_WORK: f32 = 0.1;

/// An occluder can be paid from the credit, whatever is behind it, if its cost is at most this number of
/// triangles plus the worth of all objects found hidden in the frame. A costlier occluder must cost at most
/// half of what hiding all objects behind it is worth, or be drawn on a [loan](LOAN_SAFETY). This keeps a
/// frame of few objects from drawing a costly mesh that cannot pay.
const UNPROVEN_COST: f32 = 512.0;

/// An occluder that costs more than the search may still spend can be drawn on a *loan*. The worth of the
/// objects that it is expected to hide must then be at least this many times the sum of its cost and of all
/// loans not paid back yet.
const LOAN_SAFETY: f32 = 4.0;

/// Share of the search's remaining work that an occlusion map may spend, at most, on occluders that it draws
/// by itself.
const OWN_SHARE: f32 = 0.75;

/// A search was in vain if the worth of all objects found hidden in the frame is at most this share of
/// [`INITIAL_CREDIT`].
const NEARLY_NOTHING: f32 = 0.25;

/// Account of one frame's work, in triangles: what was spent, what may still be spent, and what the objects
/// found hidden are worth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    /// Price: the work in triangles that hiding one object is worth.
    price: f32,
    /// Work in triangles that the search for occluders may still spend before more objects are found hidden.
    /// The search ends when it is 0 or less.
    credit: f32,
    /// Earnings: the price times the number of objects found hidden so far in the frame, in triangles.
    earned: f32,
    /// Cost in triangles of the occluders that were drawn on loan (beyond the credit), less what objects
    /// found hidden since have paid back.
    debt: f32,
    /// Work in triangles that the frame may still spend.
    limit: f32,
    /// Part of `limit`, in triangles of work, that the search for occluders must leave for testing objects
    /// after it.
    reserve: f32,
    /// Work of this frame so far, in triangles.
    spent: f32,
}

impl Budget {
    /// Creates the budget of a frame. `price` is the work in triangles that hiding one object is worth,
    /// `limit` the most work in triangles that the frame may spend. With a price of 0 the search for
    /// occluders may spend nothing.
    pub(super) fn new(price: u32, limit: u32) -> Self {
        let credit = if price > 0 { INITIAL_CREDIT + price as f32 } else { 0.0 };
        let limit = limit as f32;
        Self { price: price as f32, credit, earned: 0.0, debt: 0.0, limit, reserve: 0.5 * limit, spent: 0.0 }
    }

    /// Returns the work in triangles that hiding `objects` objects is worth: the price times this number.
    pub(super) fn worth(&self, objects: f32) -> f32 {
        self.price * objects
    }

    /// Returns whether the search for occluders may go on: neither its credit nor its part of the limit is
    /// spent.
    pub(super) fn has_credit(&self) -> bool {
        self.credit > 0.0 && self.limit > self.reserve
    }

    /// Returns whether the frame has spent all that it may.
    pub(super) fn is_at_limit(&self) -> bool {
        self.limit <= 0.0
    }

    /// Returns whether the search has spent its credit and found nearly nothing hidden (see
    /// [`NEARLY_NOTHING`]), as in a bird's-eye view.
    pub(super) fn is_spent_in_vain(&self) -> bool {
        self.price > 0.0 && self.credit <= 0.0 && self.earned <= NEARLY_NOTHING * INITIAL_CREDIT
    }

    /// Adds `work`, in triangles, to the work of this frame.
    pub(super) fn spend(&mut self, work: f32) {
        self.credit -= work;
        self.limit -= work;
        self.spent += work;
    }

    /// Adds `work`, in triangles, to the work of this frame, but does not take it from the credit of the
    /// search.
    pub(super) fn spend_outside_search(&mut self, work: f32) {
        self.limit -= work;
        self.spent += work;
    }

    /// Lowers the work that the frame may still spend by `work`, in triangles, without counting it as spent.
    pub(super) fn lower_limit(&mut self, work: f32) {
        self.limit -= work;
    }

    /// Returns the work in triangles that an occlusion map may spend on occluders that the map draws by
    /// itself. The result is the lesser of two bounds: the worth of hiding `objects` objects, and
    /// [`OWN_SHARE`] of the work that the search may still spend. With a price of 0 only the second bound
    /// counts.
    pub(super) fn for_own_occluders(&self, objects: f32) -> f32 {
        let worth = if self.price > 0.0 { self.worth(objects) } else { f32::INFINITY };
        worth.min(OWN_SHARE * (self.limit - self.reserve))
    }

    /// Returns the work spent so far in this frame, in triangles.
    pub(super) fn spent(&self) -> f32 {
        self.spent
    }

    /// Adds the work of testing `boxes` boxes of a block of siblings to the work of this frame.
    pub(super) fn spend_tests(&mut self, boxes: u32) {
        self.spend(TEST_WORK * boxes as f32);
    }

    /// Returns whether the frame may test the boxes of `objects` objects, and of the nodes above them.
    pub(super) fn can_test(&self, objects: usize) -> bool {
        2.0 * TEST_WORK * objects as f32 <= self.limit
    }

    /// Records that `objects` more objects were found hidden. Their worth first pays back loans (for
    /// occluders drawn beyond the credit); the rest is added to the credit.
    pub(super) fn earn(&mut self, objects: f32) {
        let earned = self.worth(objects);
        let paid_back = self.debt.min(earned);
        self.earned += earned;
        self.debt -= paid_back;
        self.credit += earned - paid_back;
    }

    /// Returns whether the budget allows to draw an occluder. `cost` is in triangles, `share` the part of the
    /// view that the occluder covers, 0 to 1, and `behind` the worth of all objects behind it. An occluder is
    /// paid from the credit, or on a loan if what it is expected to hide is worth [much more](LOAN_SAFETY)
    /// than its cost and the open loans.
    pub(super) fn can_pay(&self, cost: f32, share: f32, behind: f32) -> bool {
        let is_in_proportion = cost <= UNPROVEN_COST + self.earned || 2.0 * cost <= behind;
        let is_on_loan = LOAN_SAFETY * (cost + self.debt) <= behind * share;
        cost <= self.limit - self.reserve && (cost <= self.credit && is_in_proportion || is_on_loan)
    }

    /// Spends `cost`, in triangles, on drawing an occluder that [the budget allows](Self::can_pay). If `cost`
    /// exceeds the credit, the occluder is drawn on a loan.
    pub(super) fn pay(&mut self, cost: f32) {
        if cost > self.credit {
            self.debt += cost;
            self.credit += cost;
        }
        self.spend(cost);
    }
}

/// Number of frames in a row whose search for hidden objects cost more than it was worth, after which the
/// search is skipped in some frames: see [`Experience`].
const MAX_LOSSES: u32 = 8;

/// Work, in triangles, that a frame saves for each object in view if it skips the search for hidden objects:
/// about three times the work of frustum culling (measured).
const PAID_BACK: f32 = 0.02;

/// Greatest number of frames in a row that skip the search for hidden objects.
const MAX_FRAMES_LEFT_OUT: u32 = 64;

/// A frame searches for hidden objects again if it has at least this many times as many objects in view as
/// the last frame that searched.
const MORE_IN_VIEW: usize = 2;

/// Cosine of 30 degrees: a frame searches for hidden objects again if the camera has turned by more since the
/// last frame that searched.
const OTHER_DIRECTION: f64 = 0.866;

/// Balance of the past frames of a culler: whether the search for hidden objects pays. A frame *pays* if the
/// objects that it found hidden are worth at least the work spent on it. A frame that is *left out* skips the
/// search: all of its objects stay visible.
///
/// After [`MAX_LOSSES`] frames in a row that did not pay, as in a bird's-eye view, frames skip the search. A
/// frame searches again when the skipped searches have saved the work spent in vain, when the camera has
/// turned, or when many more objects are in view, as after a step back from a wall.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Experience {
    /// Number of frames in a row whose search for hidden objects did not pay.
    losses: u32,
    /// Loss of the last frame that searched, in triangles: its work, less the worth of the objects found
    /// hidden, less the work saved by the frames that skipped the search since. Frames skip the search only
    /// while the loss is positive.
    debt: f32,
    /// Number of frames in a row that skipped the search.
    left_out: u32,
    /// Number of objects in view in the last frame that searched.
    objects: usize,
    /// Direction of the camera in the last frame that searched, as a unit vector; zero if that was a parallel
    /// view.
    forward: DVec3,
}

impl Experience {
    /// Returns whether the next frame skips the search for hidden objects. `objects` is the number of objects
    /// in view. `forward` is the camera's direction, of any length, or zero in parallel views. After false,
    /// the caller must [`record`](Self::record) the frame.
    pub(super) fn leaves_out(&mut self, objects: usize, forward: DVec3) -> bool {
        let forward = forward.normalize_or_zero();
        let is_alike = objects < MORE_IN_VIEW * self.objects
            && (forward == DVec3::ZERO || forward.dot(self.forward) > OTHER_DIRECTION);
        let is_left_out =
            self.losses >= MAX_LOSSES && self.debt > 0.0 && self.left_out < MAX_FRAMES_LEFT_OUT && is_alike;
        if is_left_out {
            self.debt -= PAID_BACK * objects as f32;
            self.left_out += 1;
        } else {
            *self = Self { left_out: 0, objects, forward, ..*self };
        }
        is_left_out
    }

    /// Records a frame that searched for hidden objects: the `budget` it spent from, and the number `hidden`
    /// of objects that it found hidden.
    pub(super) fn record(&mut self, budget: &Budget, hidden: usize) {
        self.debt = budget.spent() - budget.worth(hidden as f32);
        self.losses = if self.debt > 0.0 { self.losses.saturating_add(1) } else { 0 };
    }
}

/// After this number of tested leaves in a row without a hidden object, only some of the following leaves are
/// tested: see [`LeafSampling`].
const MAX_MISSES: u32 = 8;

/// Greatest number of leaves in a row that are not tested. The next leaf is tested.
const MAX_LEFT_OUT: u32 = 32;

/// Choice of the leaves whose objects are tested after a search that was [in vain](Budget::is_spent_in_vain).
///
/// First, [`MAX_MISSES`] leaves without a hidden object are tested in a row; then fewer and fewer: one of
/// two, one of three, down to one of 33. A hidden object in a tested leaf starts the sequence again. Objects
/// in untested leaves stay visible.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LeafSampling {
    /// Number of tested leaves in a row in which no object was hidden.
    misses: u32,
    /// Number of leaves not tested since the last tested leaf.
    left_out: u32,
}

impl LeafSampling {
    /// Returns whether the next leaf is to be tested. If so, the caller must [`record`](Self::record) its
    /// result.
    pub(super) fn tests_next(&mut self) -> bool {
        let tests = self.left_out >= self.misses.saturating_sub(MAX_MISSES).min(MAX_LEFT_OUT);
        self.left_out = if tests { 0 } else { self.left_out + 1 };
        tests
    }

    /// Records the result of a tested leaf. `is_any_hidden`: true if at least one of its objects was found
    /// hidden, false if none was.
    pub(super) fn record(&mut self, is_any_hidden: bool) {
        self.misses = if is_any_hidden { 0 } else { self.misses.saturating_add(1) };
    }
}
