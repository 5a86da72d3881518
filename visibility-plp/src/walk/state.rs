//! State of one frame's walk: settings, states of the reached cells, projected objects and the remaining
//! budget.

use super::ready::Ready;
use crate::cell_frustum::CellFrustum;
use crate::front::Front;
use crate::normal_bins::{BoxFromEye, EyeSide};
use crate::solidity::{Solidity, visibility_chance};
use crate::tessellation::{Face, Tessellation};
use alloc::vec::Vec;
use visibility_core::glam::Vec3;
use visibility_core::{Aabb, ObjectId, Scene, VisibleSet, bits::Bits, scene::Triangle, stamp::Stamp};

/// Limit on the objects that a culler keeps per frame without an occlusion test.
///
/// ```
/// use visibility_plp::Budget;
/// assert_ne!(Budget::Objects(100), Budget::Cost(100));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Budget {
    /// Maximum number of objects; 0 keeps only objects that are in no cell.
    Objects(usize),
    /// Maximum sum of the objects' [costs](visibility_core::Object::cost), usually triangle counts. The frame
    /// ends at the first object whose cost exceeds the remaining budget, even if later objects would fit. Of
    /// a budget above 0 of which nothing is spent yet, one object is kept whatever its cost: otherwise an
    /// object too expensive for the whole budget would leave the picture empty.
    Cost(u64),
}

impl Budget {
    /// Returns the number of objects, or the sum of costs.
    pub(super) fn amount(self) -> u64 {
        match self {
            Self::Objects(count) => count as u64,
            Self::Cost(cost) => cost,
        }
    }
}

/// Settings that `PlpCuller` and `ConservativePlpCuller` have in common.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlpSettings {
    /// Limit on the objects kept per frame without an occlusion test.
    pub(crate) budget: Budget,
    /// Estimate of how likely a cell is hidden, which orders the queue of cells.
    pub(crate) solidity: Solidity,
    /// Whether objects whose triangles all certainly face away from the eye are dropped. If false, all
    /// objects count as facing the eye. Never true for `ConservativePlpCuller`, since this setting would
    /// treat two-sided objects as one-sided too.
    pub(crate) one_sided: bool,
}

impl PlpSettings {
    /// Returns the default settings with a budget: [`Solidity::Coverage`], back faces count as visible.
    pub(crate) fn new(budget: Budget) -> Self {
        Self { budget, solidity: Solidity::default(), one_sided: false }
    }
}

/// Inputs of one frame, which the walk reads and does not change.
pub(crate) struct FrameContext<'a, T: ?Sized> {
    /// Cells to visit, with the objects in each cell.
    pub(crate) tessellation: &'a T,
    /// Scene that is culled.
    pub(crate) scene: &'a Scene,
    /// Candidates of the frame: only objects of this set are kept.
    pub(crate) visible: &'a VisibleSet,
    /// Eye and view planes, relative to the scene's origin.
    pub(crate) frustum: CellFrustum,
    /// Budget, solidity estimate and back-face setting of the culler.
    pub(crate) settings: PlpSettings,
}

impl<T: ?Sized> FrameContext<'_, T> {
    /// Returns a cell's box relative to the eye, for back-face tests. `bounds` is relative to the scene's
    /// origin. `None` if back faces are not culled.
    #[inline]
    pub(super) fn box_from_eye(&self, bounds: &Aabb) -> Option<BoxFromEye> {
        self.settings.one_sided.then(|| BoxFromEye::new(self.frustum.eye, self.frustum.eye_error, bounds))
    }

    /// Returns the free distance in metres that counts as an openness of 1.
    #[inline]
    pub(super) fn far(&self) -> f32
    where
        T: Tessellation,
    {
        self.tessellation.content().far()
    }

    /// Returns how much of the budget an object takes: 1 for a budget in objects, the object's cost for a
    /// budget by cost. With a budget by cost, an id that is not in the scene takes 0.
    pub(super) fn cost(&self, id: ObjectId) -> u64 {
        match self.settings.budget {
            Budget::Objects(_) => 1,
            Budget::Cost(_) => self.scene.object(id).map_or(0, |object| object.cost.into()),
        }
    }
}

/// Closure that is asked, with an object and its priority (0 to 1), whether the object is kept. The frame
/// ends when it returns false.
pub(crate) type Keep<'a> = &'a mut dyn FnMut(ObjectId, f32) -> bool;

/// Result of projecting objects, that is, of appending them to the frame's result: whether the budget
/// sufficed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Projected {
    /// All requested objects were checked and, if visible, appended to the frame's result.
    Complete,
    /// The budget ran out first; some of the requested objects were not appended to the frame's result.
    OutOfBudget,
}

/// Per-frame state of a cell that the walk has reached.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct CellState {
    /// View planes that the cell may cross. Bit i stands for plane i of [`CellFrustum`]. It is 0 only if the
    /// cell is certainly on the inner side of that plane, the side that its normal points to. All bits for
    /// the eye's cell if that cell is outside of the view.
    pub(super) crossed: u16,
    /// With [`Solidity::Coverage`], the transmittance: estimated share of view rays to the cell that no
    /// earlier cell stops, 0 to 1. With [`Solidity::Count`], the cell's solidity. NaN until the cell is
    /// first put into the front, the queue of cells to project.
    pub(super) transmittance_or_solidity: f32,
    /// Start of the cell's range in `Walk::sides`, which has an entry for each axis side of the cell (plus or
    /// minus x, y or z, or none: the side that the objects face) with objects that are not all projected yet.
    /// Set when the sides are looked up, 0 before.
    pub(super) first_side: u32,
    /// End of the cell's range in `Walk::sides`, exclusive. [`UNOPENED`] before the sides are looked up. At
    /// most `first_side` if no objects are left to project.
    pub(super) end_side: u32,
    /// Unit direction from the eye to the cell's centre (the viewing direction for a parallel view). Zero
    /// with [`Solidity::Count`].
    pub(super) direction: Vec3,
    /// Area in square metres of the cell's silhouette along `direction`. 0 with [`Solidity::Count`].
    pub(super) area: f32,
    /// Highest priority of the cell's groups of objects (layers) when the cell was reached, about 0 to 1. 1
    /// for a cell without objects and with [`Solidity::Count`].
    pub(super) priority: f32,
    /// Mean solid angle in steradians of one square metre of surface in the cell, from
    /// [`solid_angle_per_area`](crate::solidity::solid_angle_per_area). Infinite for parallel views, 0 with
    /// [`Solidity::Count`].
    pub(super) solid_angle_per_area: f32,
}

/// Value of `CellState::end_side` for a cell whose axis sides have not been looked up in this frame.
pub(super) const UNOPENED: u32 = u32::MAX;

impl CellState {
    /// State of a cell that the frame has not reached.
    pub(super) const UNKNOWN: Self = Self {
        crossed: 0,
        transmittance_or_solidity: f32::NAN,
        first_side: 0,
        end_side: 0,
        direction: Vec3::ZERO,
        area: 0.0,
        solid_angle_per_area: 0.0,
        priority: 1.0,
    };

    /// Returns the estimated probability that view rays reach the cell, 0 to 1. 1 with [`Solidity::Count`].
    #[inline]
    pub(super) fn chance(&self, solidity: Solidity) -> f32 {
        match solidity {
            Solidity::Coverage => visibility_chance(self.transmittance_or_solidity),
            Solidity::Count => 1.0,
        }
    }

    /// Tests whether the eye is in or near the cell: the silhouette's area exceeds 0.9 times the squared
    /// distance from the eye to the cell's centre. The direction to the cell's centre then says little about
    /// the cell's surfaces. Also true for parallel views with [`Solidity::Coverage`].
    #[inline]
    pub(super) fn is_around_eye(&self) -> bool {
        self.solid_angle_per_area * self.area > 0.45
    }
}

/// Groups of similar objects (layers) on one axis side of a cell that are not projected yet, as a range of
/// bytes of the cell's encoded list.
#[derive(Clone, Copy, Debug)]
pub(super) struct RemainingLayers {
    /// Priority of the first remaining layer, about 0 to 1: the share of its surface that is estimated
    /// visible if the cell is.
    pub(super) priority: f32,
    /// Mean solid angle in steradians of one square metre of surface that faces this side. Infinite for
    /// parallel views.
    pub(super) solid_angle_per_area: f32,
    /// Distance in metres from the eye to the cell's box, divided by the free distance that counts as an
    /// openness of 1. Infinite or NaN for parallel views, which [`free_share`](crate::solidity::free_share)
    /// counts as 1.
    pub(super) distance: f32,
    /// Start of the remaining layers, in bytes before the end of the cell's list.
    pub(super) from: u32,
    /// End of the remaining layers, in bytes before the end of the cell's list; at most `from`.
    pub(super) to: u32,
    /// Axis side that the objects face, 0 to 5 (twice the axis, plus one towards negative coordinates), or 6
    /// for objects without a single normal.
    pub(super) side: u8,
}

/// Object of a layer that is being projected, not yet looked up in the visible set.
#[derive(Clone, Copy, Debug)]
pub(super) struct LayerObject {
    /// Index of the object in the scene.
    pub(super) index: u32,
    /// Side of the object's triangle on which the eye lies; `Front` if back faces are not culled.
    pub(super) eye_side: EyeSide,
}

impl LayerObject {
    /// Filler of the unused end of `Walk::layer_objects`.
    pub(super) const NONE: Self = Self { index: 0, eye_side: EyeSide::Unknown };
}

/// Maximum number of triangles of an object that is tested triangle by triangle for facing away or lying
/// outside of the view. Objects with more triangles are kept untested.
pub(super) const MAX_TESTED_TRIANGLES: usize = 4;

/// One view's walk through the cells of a tessellation. Buffers keep their capacity from frame to frame; no
/// values carry over.
#[derive(Clone, Debug, Default)]
pub(crate) struct Walk {
    /// Stamp of the cells' object lists for which the buffers were last enlarged. No frame with these lists
    /// needs more capacity, whatever the view. `None` before the first frame.
    reserved_for: Option<Stamp>,
    /// Per-frame state of each cell. Valid only for cells whose bit in `reached_bits` is set.
    pub(super) cells: Vec<CellState>,
    /// One bit for each cell, set once the frame has reached the cell. Checked before `cells`, which is 512
    /// times larger and misses the cache.
    pub(super) reached_bits: Bits,
    /// One bit for each cell that is outside of the view or whose neighbours were already put into the
    /// front. Most faces lead to such cells and need no further test.
    pub(super) closed: Bits,
    /// Front of the projection: priority queue of the cells to project next, least solidity (likelihood of
    /// being hidden) first.
    pub(super) front: Front,
    /// One bit for each object index, set once this frame has looked the object up.
    pub(super) taken: Bits,
    /// Ids of the objects kept so far in this frame, about highest priority first.
    pub(crate) order: Vec<ObjectId>,
    /// Objects that were looked up and not kept yet.
    pub(crate) ready: Ready,
    /// How much of the budget the objects kept so far in this frame take, in objects or in cost.
    pub(crate) spent: u64,
    /// Number of cells that were put into the front, the queue of cells to project, in this frame.
    pub(crate) reached: u64,
    /// Number of cells taken from the front whose neighbours were put into the front, in this frame.
    pub(crate) projected: u64,
    /// Scratch list of the faces through which view rays leave the cell that is being projected.
    pub(super) faces: Vec<Face>,
    /// Axis sides with objects left to project, of all cells whose lists were looked up in this frame;
    /// consecutive for each cell.
    pub(super) sides: Vec<RemainingLayers>,
    /// Scratch list of the objects of the layer that is being projected. As long as the longest list of a
    /// cell; the layer's objects are at its start.
    pub(super) layer_objects: Vec<LayerObject>,
    /// For each normal bin, the eye's offset along the bin's normal and the tolerance of that offset, in the
    /// bins' offset steps: see [`NormalBins::eye_offsets`](crate::normal_bins::NormalBins::eye_offsets).
    pub(super) eye_offsets: Vec<[f64; 2]>,
    /// Scratch list of the layer's objects that are in the visible set: object, and side of its triangle on
    /// which the eye lies.
    pub(super) seen: Vec<(ObjectId, EyeSide)>,
    /// Scratch list of triangles to test, relative to the scene's origin, each with its object's index in
    /// `seen`.
    pub(super) tested: Vec<(u32, Triangle)>,
}

/// Reserves capacity for `count` items in total, including the items already there.
fn make_room<T>(items: &mut Vec<T>, count: usize) {
    items.reserve(count.saturating_sub(items.len()));
}

impl Walk {
    /// Clears the previous frame's state and reserves capacity for the largest frame that the tessellation
    /// allows, so that later frames with the same content allocate nothing, whatever the view. O(cells +
    /// objects / 64); also visits all faces when the content's stamp has changed.
    pub(super) fn clear<T: Tessellation + ?Sized>(&mut self, frame: &FrameContext<'_, T>) {
        let content = frame.tessellation.content();
        let cells = content.cell_count();
        self.cells.resize(cells, CellState::UNKNOWN);
        self.reached_bits.reset(cells);
        self.closed.reset(cells);
        self.front.clear();
        self.sides.clear();
        self.order.clear();
        self.layer_objects.clear();
        self.layer_objects.resize(content.max_count() as usize, LayerObject::NONE);
        self.ready.clear(frame.scene.len());
        (self.reached, self.projected) = (0, 0);
        self.taken.reset(frame.scene.index_limit());
        let at_once = self.layer_objects.len();
        make_room(&mut self.seen, at_once);
        make_room(&mut self.tested, at_once * MAX_TESTED_TRIANGLES);
        make_room(&mut self.order, frame.scene.len());
        if self.reserved_for == Some(content.stamp()) {
            return;
        }
        self.front.reserve(cells);
        make_room(&mut self.sides, content.side_count);
        // The cell with the most faces determines the capacity for faces. Faces are counted once for each
        // content.
        let mut most_faces = 0;
        for cell in 0..cells as u32 {
            let mut count = 0;
            frame.tessellation.for_each_face(cell, &|_| true, &mut |_| count += 1);
            most_faces = most_faces.max(count);
        }
        make_room(&mut self.faces, most_faces);
        self.reserved_for = Some(content.stamp());
    }

    /// Tests whether a cell's neighbours need not be put into the front any more: the cell is outside of the
    /// view, or they were already put there in this frame. False for a cell still to be propagated.
    #[inline]
    pub(super) fn is_closed(&self, cell: u32) -> bool {
        self.closed.contains(cell as usize)
    }

    /// Tests whether a reached cell may have objects left to project. True for a cell with objects whose list
    /// has not been looked up yet.
    pub(crate) fn has_content(&self, cell: u32) -> bool {
        let state = &self.cells[cell as usize];
        state.first_side < state.end_side
    }

    /// Drops a reached cell from the frame: its remaining objects are not projected, and its neighbours are
    /// not put into the front because of it.
    #[cfg(feature = "papers")]
    pub(crate) fn drop_cell(&mut self, cell: u32) {
        self.cells[cell as usize].end_side = 0;
        self.closed.insert(cell as usize);
    }
}
