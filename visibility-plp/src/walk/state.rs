//! What a walk remembers: the frame's settings, the cells and objects that it has reached, the budget that is
//! left.

use crate::cell_frustum::CellFrustum;
use crate::content::bit;
use crate::front::Front;
use crate::normal_bins::{BoxFromEye, EyeSide};
use crate::solidity::Solidity;
use crate::tessellation::{Face, Tessellation};
use alloc::vec::Vec;
use visibility_core::glam::Vec3;
use visibility_core::{Aabb, ObjectId, Scene, VisibleSet, scene::Triangle, stamp::Stamp};

/// Limit on what is projected in a frame.
///
/// ```
/// use visibility_plp::Budget;
/// assert_ne!(Budget::Objects(100), Budget::Cost(100));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Budget {
    /// Maximum number of objects.
    Objects(usize),
    /// Maximum sum of the objects' [costs](visibility_core::Object::cost), usually triangles. The first
    /// object that does not fit ends the frame.
    Cost(u64),
}

/// Settings of a culler.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlpSettings {
    pub(crate) budget: Budget,
    pub(crate) solidity: Solidity,
    /// Whether objects whose triangles all face away from the eye are left out.
    pub(crate) one_sided: bool,
}

/// Everything that a frame reads but does not change.
pub(crate) struct FrameContext<'a, T: ?Sized> {
    pub(crate) tessellation: &'a T,
    pub(crate) scene: &'a Scene,
    /// Objects that may be projected.
    pub(crate) visible: &'a VisibleSet,
    pub(crate) frustum: CellFrustum,
    pub(crate) settings: PlpSettings,
}

impl<T: Tessellation + ?Sized> FrameContext<'_, T> {
    /// A cell's box relative to the eye, for back-face tests; `None` if the scene is drawn two-sided.
    #[inline]
    pub(super) fn box_from_eye(&self, bounds: &Aabb) -> Option<BoxFromEye> {
        self.settings.one_sided.then(|| BoxFromEye::new(self.frustum.eye, bounds))
    }
}

impl<T: ?Sized> FrameContext<'_, T> {
    /// Share of the budget that an object takes; 0 for an unknown object and a budget by cost.
    pub(super) fn cost(&self, id: ObjectId) -> u64 {
        match self.settings.budget {
            Budget::Objects(_) => 1,
            Budget::Cost(_) => self.scene.object(id).map_or(0, |object| object.cost.into()),
        }
    }
}

/// How the projection of a cell ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Projected {
    /// All that was asked for is projected.
    Complete,
    /// The budget ran out before.
    OutOfBudget,
}

/// State of a cell that the frame has reached.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct CellState {
    /// Bits of [`CellPlace::Crossing`](crate::cell_frustum::CellPlace::Crossing).
    pub(super) crossed: u16,
    /// Light that reaches the cell, 0 to 1; or its solidity for [`Solidity::Count`]. NaN before it is in the
    /// front.
    pub(super) value: f32,
    /// First of the cell's sides that are not fully projected, an index into `Walk::sides`.
    pub(super) first_side: u32,
    /// End of that range, exclusive. [`UNOPENED`] before the sides are looked up, `first_side` or less if
    /// nothing is left.
    pub(super) end_side: u32,
    /// Unit direction of sight to the cell's centre.
    pub(super) direction: Vec3,
    /// Area of the cell's silhouette along that direction, in square metres.
    pub(super) area: f32,
    /// Share of its light that the cell's best layer is worth; 1 for a cell without content.
    pub(super) worth: f32,
    /// See [`solid_angle_per_area`](crate::solidity::solid_angle_per_area).
    pub(super) solid_angle_per_area: f32,
}

/// In place of `CellState::end_side`: the cell's sides have not been looked up in this frame.
pub(super) const UNOPENED: u32 = u32::MAX;

impl CellState {
    pub(super) const UNKNOWN: Self = Self {
        crossed: 0,
        value: f32::NAN,
        first_side: 0,
        end_side: 0,
        direction: Vec3::ZERO,
        area: 0.0,
        solid_angle_per_area: 0.0,
        worth: 1.0,
    };

    /// Whether the eye is in the cell or near it, so that there is no one direction to it.
    #[inline]
    pub(super) fn is_around_eye(&self) -> bool {
        self.solid_angle_per_area * self.area > 0.45
    }
}

/// Layers of one side of a cell that are not projected yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct RemainingLayers {
    /// Share of the cell's light that the first of these layers is worth.
    pub(super) worth: f32,
    /// Mean solid angle of a square metre that faces this side, in steradians.
    pub(super) solid_angle_per_area: f32,
    /// Where they begin, in bytes before the end of the cell's list.
    pub(super) from: u32,
    /// Where they end, in bytes before the end of the cell's list.
    pub(super) to: u32,
    /// Axis side, see [`Layers::side`](crate::layers::Layers).
    pub(super) side: u8,
}

/// An object that is next in order of projection.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) index: u32,
    pub(super) eye_side: EyeSide,
    /// Planes that the cell crosses in which the object was found.
    pub(super) crossed: u16,
}

impl Candidate {
    pub(super) const NONE: Self = Self { index: 0, eye_side: EyeSide::Unknown, crossed: 0 };
}

/// Number of candidates that are looked up in the scene together, so that cache misses overlap.
pub(super) const BATCH: usize = 256;

/// Objects of more triangles are not tested for facing away or lying outside of the view.
pub(super) const MAX_TESTED_TRIANGLES: usize = 4;

/// The walk through the cells of a tessellation. Buffers are kept from frame to frame; nothing else is.
#[derive(Clone, Debug)]
pub(crate) struct Walk {
    /// Content that the buffers are large enough for, whatever the view.
    reserved_for: Stamp,
    /// By cell. Valid only for cells whose bit in `known` is set.
    pub(super) cells: Vec<CellState>,
    /// One bit for each cell that the frame has reached. Checked before `cells`, which is 512 times larger
    /// and misses the cache.
    pub(super) known: Vec<u64>,
    /// One bit for each cell that is outside of the view or has passed its light on to its neighbours. Most
    /// faces lead to such cells and need nothing else.
    pub(super) closed: Vec<u64>,
    pub(super) front: Front,
    /// One bit for each object index that has been a candidate.
    pub(super) taken: Vec<u64>,
    /// Projected objects, highest priority first.
    pub(crate) order: Vec<ObjectId>,
    /// Remaining budget, in objects or cost.
    pub(super) budget_left: u64,
    /// Number of cells that were put into the front.
    pub(crate) reached: u64,
    /// Number of cells that were taken from the front and passed their light on.
    pub(crate) projected: u64,
    /// Faces of the cell that passes its light on.
    pub(super) faces: Vec<Face>,
    /// Remaining layers of all opened cells.
    pub(super) sides: Vec<RemainingLayers>,
    /// Room for candidates; the first `candidate_count` are in use.
    pub(super) candidates: Vec<Candidate>,
    pub(super) candidate_count: usize,
    /// See [`NormalBins::eye_offsets`](crate::normal_bins::NormalBins::eye_offsets).
    pub(super) eye_offsets: Vec<[f64; 2]>,
    /// Candidates that are in the visible set, with eye side and crossed planes.
    pub(super) seen: Vec<(ObjectId, EyeSide, u16)>,
    /// Triangles to test, each with its object's index in `seen`.
    pub(super) tested: Vec<(u32, Triangle)>,
}

impl Default for Walk {
    fn default() -> Self {
        Self {
            reserved_for: Stamp::NONE,
            cells: Vec::new(),
            known: Vec::new(),
            closed: Vec::new(),
            front: Front::default(),
            taken: Vec::new(),
            order: Vec::new(),
            budget_left: 0,
            reached: 0,
            projected: 0,
            faces: Vec::new(),
            sides: Vec::new(),
            candidates: Vec::new(),
            candidate_count: 0,
            eye_offsets: Vec::new(),
            seen: Vec::new(),
            tested: Vec::new(),
        }
    }
}

/// Sets a bit.
pub(super) fn set(words: &mut [u64], index: u32) {
    words[index as usize / 64] |= 1 << (index % 64);
}

/// Clears a bit.
pub(super) fn clear(words: &mut [u64], index: u32) {
    words[index as usize / 64] &= !(1 << (index % 64));
}

/// Makes room for `count` items in all.
fn make_room<T>(items: &mut Vec<T>, count: usize) {
    items.reserve(count.saturating_sub(items.len()));
}

impl Walk {
    /// Forgets the frame before, and makes room in all buffers for the greatest frame that the tessellation
    /// allows, so that later frames of the same content allocate nothing, whatever the view.
    pub(super) fn clear<T: Tessellation + ?Sized>(&mut self, frame: &FrameContext<'_, T>) {
        let content = frame.tessellation.content();
        let cells = content.cell_count();
        self.cells.resize(cells, CellState::UNKNOWN);
        for bits in [&mut self.known, &mut self.closed] {
            bits.clear();
            bits.resize(cells.div_ceil(64), 0);
        }
        self.front.clear();
        self.sides.clear();
        self.order.clear();
        self.candidates.clear();
        self.candidates.resize(content.max_count() as usize + BATCH, Candidate::NONE);
        self.candidate_count = 0;
        (self.reached, self.projected) = (0, 0);
        self.taken.clear();
        self.taken.resize(frame.scene.index_limit().max(content.index_limit()).div_ceil(64), 0);
        let at_once = self.candidates.len();
        make_room(&mut self.seen, at_once);
        make_room(&mut self.tested, at_once * MAX_TESTED_TRIANGLES);
        make_room(&mut self.order, frame.scene.len());
        if self.reserved_for == content.stamp() {
            return;
        }
        self.front.reserve(cells);
        make_room(&mut self.sides, content.side_count);
        let mut most_faces = 0;
        for cell in 0..cells as u32 {
            let mut count = 0;
            frame.tessellation.for_each_face(cell, &|_| true, &mut |_| count += 1);
            most_faces = most_faces.max(count);
        }
        make_room(&mut self.faces, most_faces);
        self.reserved_for = content.stamp();
    }

    /// Whether a cell has passed its light on, or is outside of the view.
    #[inline]
    pub(super) fn is_closed(&self, cell: u32) -> bool {
        bit(&self.closed, cell as usize)
    }

    /// Whether a cell that the frame has reached holds objects that are not projected yet, as far as is
    /// known.
    pub(crate) fn has_content(&self, cell: u32) -> bool {
        let state = &self.cells[cell as usize];
        state.first_side < state.end_side
    }

    /// Removes a cell from the frame: its content is not projected, and its light is not passed on.
    pub(crate) fn shut(&mut self, cell: u32) {
        self.cells[cell as usize].end_side = 0;
        set(&mut self.closed, cell);
    }
}
