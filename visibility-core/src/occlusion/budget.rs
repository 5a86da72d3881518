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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn searches_end_with_their_credit_or_with_their_part_of_the_limit() {
        assert!(!Budget::new(0, 10_000).has_credit(), "a price of 0 buys no occluder");
        assert!(!Budget::new(0, 10_000).is_spent_in_vain(), "nothing was searched for");
        let mut budget = Budget::new(24, 10_000);
        budget.spend(2071.0);
        assert!(budget.has_credit() && !budget.is_spent_in_vain(), "the credit is 2048 and one price");
        budget.spend(1.0);
        assert!(!budget.has_credit() && budget.is_spent_in_vain(), "the credit is spent");
        budget.earn(21.0);
        assert!(budget.has_credit() && !budget.is_spent_in_vain(), "21 hidden objects give new credit");
        budget.spend(504.0);
        assert!(budget.is_spent_in_vain(), "504 triangles are nearly nothing beside 2048");
        budget.earn(1.0);
        budget.spend(24.0);
        assert!(!budget.has_credit() && !budget.is_spent_in_vain(), "528 triangles are more");
        let mut budget = Budget::new(24, 100);
        budget.spend(49.0);
        assert!(budget.has_credit(), "half of the limit is left to the search");
        budget.spend(1.0);
        assert!(!budget.has_credit() && !budget.is_at_limit(), "the other half is for tests");
        budget.spend_outside_search(49.0);
        assert!(!budget.is_at_limit(), "one triangle is left");
        budget.lower_limit(1.0);
        assert!(budget.is_at_limit() && budget.spent() == 99.0, "the limit was lowered, but not spent");
        let budget = Budget::new(24, 100);
        assert!(budget.can_test(499) && !budget.can_test(501), "two tests for each of 500 objects");
    }

    #[test]
    fn costly_occluders_are_bought_by_what_is_behind_them() {
        let budget = Budget::new(24, 1 << 15);
        assert!(budget.can_pay(512.0, 0.0, 0.0), "a cheap occluder is paid from the credit");
        assert!(!budget.can_pay(513.0, 0.0, 0.0), "a costlier one is not");
        assert!(budget.can_pay(513.0, 0.0, 1026.0), "unless twice its cost is behind it");
        assert!(!budget.can_pay(513.0, 0.0, 1025.0), "no less than twice");
        assert!(budget.can_pay(2072.0, 0.0, 1e9) && !budget.can_pay(2073.0, 0.0, 1e9), "up to the credit");
        assert!(budget.can_pay(3000.0, 0.5, 24_000.0), "on a loan that comes back four times");
        assert!(!budget.can_pay(3000.0, 0.5, 23_999.0), "no less than four times");
        assert!(budget.can_pay(16_384.0, 1.0, 1e9), "up to half of the limit");
        assert!(!budget.can_pay(16_385.0, 1.0, 1e9), "no more");
        let mut rich = budget;
        rich.earn(10.0);
        assert!(rich.can_pay(752.0, 0.0, 0.0) && !rich.can_pay(753.0, 0.0, 0.0), "what was earned counts");
        let mut lent = budget;
        lent.pay(3000.0);
        assert_eq!(
            (lent.debt, lent.credit, lent.spent),
            (3000.0, 2072.0, 3000.0),
            "a loan leaves the credit"
        );
        assert!(!lent.can_pay(3000.0, 0.5, 24_000.0), "a second loan needs as much more");
        lent.earn(100.0);
        assert_eq!((lent.debt, lent.credit), (600.0, 2072.0), "what is earned pays back first");
        lent.earn(100.0);
        assert_eq!((lent.debt, lent.credit), (0.0, 3872.0), "the rest is credit");
        let mut paid = budget;
        paid.pay(2072.0);
        assert_eq!((paid.debt, paid.credit), (0.0, 0.0), "the whole credit is no loan");
    }

    #[test]
    fn occlusion_maps_draw_what_objects_are_worth() {
        let budget = Budget::new(24, 10_000);
        assert_eq!(budget.for_own_occluders(10.0), 240.0, "the worth of ten objects");
        assert_eq!(budget.for_own_occluders(1e6), 3750.0, "three quarters of half of the limit");
        assert_eq!(Budget::new(0, 10_000).for_own_occluders(1.0), 3750.0, "without a price");
    }

    /// Returns the experience of eight frames in a row with 100 objects that spent `spent` triangles in vain.
    fn after_losses(spent: f32) -> Experience {
        let mut budget = Budget::new(24, 10_000);
        budget.spend(spent);
        let mut experience = Experience::default();
        for frame in 0..MAX_LOSSES {
            assert!(!experience.leaves_out(100, DVec3::X * 3.0), "frame {frame} is searched");
            experience.record(&budget, 0);
        }
        experience
    }

    #[test]
    fn frames_are_left_out_after_losses_as_long_as_they_are_alike() {
        let experience = after_losses(1000.0);
        let is_left_out = |objects: usize, forward: DVec3| {
            let mut trial = experience;
            trial.leaves_out(objects, forward)
        };
        assert!(is_left_out(199, DVec3::X) && !is_left_out(200, DVec3::X), "twice as many objects");
        let turned = |degrees: f64| {
            let angle = degrees.to_radians();
            DVec3::new(angle.cos(), angle.sin(), 0.0) * 5.0
        };
        assert!(is_left_out(100, turned(29.9)) && !is_left_out(100, turned(30.1)), "30 degrees");
        assert!(is_left_out(100, DVec3::ZERO), "a parallel view does not turn");
        let frames = |mut experience: Experience, objects: usize| {
            (0..1000).take_while(|_| experience.leaves_out(objects, DVec3::X)).count()
        };
        assert_eq!(frames(experience, 1), 64, "frames in a row");
        assert_eq!(frames(after_losses(10.0), 100), 5, "frames that save the work of 10 triangles");
        let mut paying = experience;
        let mut budget = Budget::new(24, 10_000);
        budget.spend(240.0);
        paying.record(&budget, 10);
        assert!(!paying.leaves_out(100, DVec3::X), "ten objects are worth 240 triangles");
        budget.spend(1000.0);
        paying.record(&budget, 0);
        assert!(!paying.leaves_out(100, DVec3::X), "a loss after a frame that paid for itself is the first");
    }

    #[test]
    fn fewer_and_fewer_leaves_are_tested() {
        let mut sampling = LeafSampling::default();
        let mut gaps = alloc::vec::Vec::new();
        for _ in 0..45 {
            gaps.push((0..1000).take_while(|_| !sampling.tests_next()).count());
            sampling.record(false);
        }
        let expected = (0..45).map(|test: usize| test.saturating_sub(8).min(32));
        assert!(gaps.iter().copied().eq(expected), "leaves left out before each test: {gaps:?}");
        sampling.record(true);
        assert!((0..9).all(|_| sampling.tests_next()), "a hidden object begins anew");
    }
}
