//! Work that a frame may spend on occlusion, counted in triangles and paid by the objects found hidden.
//!
//! The budget never knows the time. It counts work in *triangles*, the cost of drawing one triangle of an
//! occluder: with the z-buffer about a tenth of a microsecond. Tests of boxes and estimates are counted at
//! what they cost in this unit. The same frame therefore spends the same on every machine.
//!
//! A frame begins with an [advance](Budget::new) that is in proportion to the price of an object and grows
//! slowly with the number of candidates. Each object found hidden earns the price. So a frame in which
//! nothing is hidden, as seen by a bird, spends the advance and no more, and any frame spends at most the
//! advance, the price of the objects that it hides, and its [loans](Budget::can_afford).

/// Work of testing one box of a block of siblings, in triangles (measured with the z-buffer in scenes in
/// which boxes are partly hidden, where tests take longest).
pub(super) const TEST_WORK: f32 = 0.3;

/// Work of testing or refusing one occluder by itself, in triangles (measured).
pub(super) const SINGLE_WORK: f32 = 1.0;

/// Advance of a frame before the first object is found hidden, in objects. It must last until the first batch
/// of occluders has been drawn and the boxes behind have been tested.
const ADVANCE_OBJECTS: f32 = 40.0;

/// Share of the candidates that is added to the advance: the walk down the hierarchy to the first occluders
/// grows with their number.
const ADVANCE_SHARE: f32 = 1.0 / 2048.0;

/// Greatest share of the candidates that the advance may pay for, for frames of few candidates.
const MOST_ADVANCE_SHARE: f32 = 0.25;

/// Expected gain of an occluder, as a multiple of its cost and of all loans that are open, from which it is
/// drawn on a loan.
const LOAN_SAFETY: f32 = 4.0;

/// Work of one frame, in triangles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    /// Work that hiding one object is worth.
    price: f32,
    /// Work that the search for occluders may still spend before more objects are found hidden. The search
    /// ends when it is 0 or less.
    credit: f32,
    /// Credit beyond which objects found hidden add nothing: otherwise what hides much would pay for many
    /// occluders that hide nothing.
    most_credit: f32,
    /// Cost of the occluders drawn on loans that objects found hidden have not paid back yet.
    debt: f32,
    /// Advance and earnings of the frame less all work spent, loans included.
    surplus: f32,
    /// Work that the frame may still spend at all.
    limit: f32,
}

impl Budget {
    /// Creates the budget of a frame: the price of an object, the number of objects that may be found hidden,
    /// and the most work that the frame may spend.
    pub(super) fn new(price: u32, candidates: u64, limit: u32) -> Self {
        let (price, candidates) = (price as f32, candidates as f32);
        let most_credit = price * (ADVANCE_OBJECTS + ADVANCE_SHARE * candidates);
        let advance = most_credit.min(price * MOST_ADVANCE_SHARE * candidates);
        Self { price, credit: advance, most_credit, debt: 0.0, surplus: advance, limit: limit as f32 }
    }

    /// Returns the work that hiding `objects` is worth.
    pub(super) fn worth(&self, objects: f32) -> f32 {
        self.price * objects
    }

    /// Returns whether the search for occluders may go on.
    pub(super) fn has_credit(&self) -> bool {
        self.credit > 0.0 && !self.is_at_limit()
    }

    /// Returns whether the frame has earned, or been advanced, more than it has spent.
    pub(super) fn has_surplus(&self) -> bool {
        self.surplus > 0.0
    }

    /// Returns whether the frame has spent all that it may.
    pub(super) fn is_at_limit(&self) -> bool {
        self.limit <= 0.0
    }

    /// Spends work.
    pub(super) fn spend(&mut self, work: f32) {
        self.credit -= work;
        self.surplus -= work;
        self.limit -= work;
    }

    /// Enters objects found hidden. They pay loans back first.
    pub(super) fn earn(&mut self, objects: u64) {
        let earned = self.worth(objects as f32);
        let paid_back = self.debt.min(earned);
        self.debt -= paid_back;
        self.surplus += earned;
        self.credit = (self.credit + earned - paid_back).min(self.most_credit);
    }

    /// Returns whether an occluder of `cost` that is expected to hide objects worth `gain` may be drawn: from
    /// the credit, or on a loan if the gain is [large](LOAN_SAFETY) against the cost and the open loans. So
    /// no first occluder is too expensive for what lies behind it.
    pub(super) fn can_afford(&self, cost: f32, gain: f32) -> bool {
        cost <= gain
            && cost <= self.limit
            && (cost <= self.credit || LOAN_SAFETY * (cost + self.debt) <= gain)
    }

    /// Pays for an occluder that [can be afforded](Self::can_afford).
    pub(super) fn pay(&mut self, cost: f32) {
        if cost > self.credit {
            self.debt += cost;
            self.credit += cost;
        }
        self.spend(cost);
    }
}

/// Number of consecutive leaves without a hidden object after which leaves are left out.
const MOST_MISSES: u32 = 8;

/// Greatest number of leaves left out between two that are tested.
const MOST_LEFT_OUT: u32 = 32;

/// Choice of the leaves whose objects are tested, by what the tests before have found.
///
/// All leaves are tested while the frame has a surplus. After that, [`MOST_MISSES`] leaves in a row without a
/// hidden object are tested, and then fewer and fewer: one of two, one of three, down to one of 33. A hidden
/// object in a tested leaf makes the choice begin anew. Objects in leaves left out stay visible.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LeafSampling {
    /// Number of tested leaves in a row in which no object was hidden.
    misses: u32,
    /// Number of leaves left out since the last tested one.
    left_out: u32,
}

impl LeafSampling {
    /// Returns whether the next leaf is to be tested, which [`record`](Self::record) is then told of.
    pub(super) fn tests_next(&mut self, budget: &Budget) -> bool {
        if budget.is_at_limit() {
            return false;
        }
        let most = self.misses.saturating_sub(MOST_MISSES).min(MOST_LEFT_OUT);
        let tests = budget.has_surplus() || self.left_out >= most;
        self.left_out = if tests { 0 } else { self.left_out + 1 };
        tests
    }

    /// Enters whether any object of a tested leaf was hidden.
    pub(super) fn record(&mut self, is_any_hidden: bool) {
        self.misses = if is_any_hidden { 0 } else { self.misses.saturating_add(1) };
    }
}
