//! The walk through the cells of a tessellation that both cullers share: the rendering loop of the paper's figure 4.

mod projection;
mod sides;

use crate::content::bit;
use crate::facing::{Side, Toward};
use crate::front::Front;
use crate::sight::{Place, Sight};
use crate::solidity::{From, chance, count_solidity, nearness, share, stopped};
use crate::{Face, Solidity, Tessellation};
use alloc::vec::Vec;
use projection::{BATCH, FEW, Sifted};
use sides::{ALL, Rest};
use visibility_core::glam::Vec3;
use visibility_core::{Aabb, Changes, Eye, ObjectId, Scene, Stamp, Triangle, VisibleSet};

/// How much may be projected in a frame.
///
/// ```
/// use visibility_plp::Budget;
/// assert_ne!(Budget::Objects(100), Budget::Cost(100));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Budget {
    /// So many objects.
    Objects(usize),
    /// Objects whose [costs](visibility_core::Object::cost) add up to no more than this: triangles, usually.
    Cost(u64),
}

/// What a frame knows of a cell.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
struct Cell {
    /// Planes of the view that not all of it is inside of, by bit.
    crossed: u16,
    /// The light that reaches it, or its solidity; NaN before it is in the front.
    value: f32,
    /// Which of the sides are its own, as far as they hold what is not projected yet: from here on, and up to there; [`ALL`] before it is opened.
    from: u32,
    to: u32,
    /// Unit direction of sight to its centre.
    direction: Vec3,
    /// Its area seen along that direction.
    area: f32,
    /// What part of its light its best layer is worth.
    worth: f32,
    /// What part of the directions a square metre in it takes up.
    nearness: f32,
}

impl Cell {
    const UNKNOWN: Self = Self {
        crossed: 0,
        value: f32::NAN,
        from: 0,
        to: 0,
        direction: Vec3::ZERO,
        area: 0.0,
        nearness: 0.0,
        worth: 1.0,
    };
}

impl Cell {
    /// Whether the eye is in the cell or near it, so that there is no one direction to it.
    #[inline]
    fn is_around(&self) -> bool {
        self.nearness * self.area > 0.45
    }
}

/// What is asked of the objects that are projected.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rules {
    pub(crate) budget: Budget,
    pub(crate) solidity: Solidity,
    /// Whether objects that turn their backs are left out.
    pub(crate) one_sided: bool,
}

/// One frame's view of what is walked through.
pub(crate) struct Stage<'a, T: ?Sized> {
    pub(crate) tessellation: &'a T,
    pub(crate) scene: &'a Scene,
    pub(crate) visible: &'a VisibleSet,
    pub(crate) sight: Sight,
    pub(crate) rules: Rules,
}

impl<T: Tessellation + ?Sized> Stage<'_, T> {
    /// The box of a cell as seen from the eye, if it is asked what turns its back.
    #[inline]
    fn toward(&self, bounds: &Aabb) -> Option<Toward> {
        self.rules.one_sided.then(|| Toward::new(self.sight.eye, bounds))
    }
}

/// How a cell's projection ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Projected {
    Whole,
    /// The budget did not last for all of it.
    Cut,
}

/// The memory of a walk, kept from frame to frame.
#[derive(Clone, Debug)]
pub(crate) struct Walk {
    /// Content that the buffers are large enough for, whatever the view.
    reserved_for: Stamp,
    /// What the frame knows of those cells that it has come to; of others, nothing.
    cells: Vec<Cell>,
    /// By cell, a bit for those that the frame has come to: memory is slow, and these few bits are near.
    known: Vec<u64>,
    /// By cell, a bit for those that are open (what they were reached by has been handed on) or outside: most faces lead there, and need no more
    /// than this.
    closed: Vec<u64>,
    front: Front,
    /// By object index.
    taken: Vec<u64>,
    /// What was projected, in order.
    pub(crate) order: Vec<ObjectId>,
    /// What is left of the budget.
    left: u64,
    /// Cells that came to be in the front, and those that the walk went through.
    pub(crate) reached: u64,
    pub(crate) projected: u64,
    /// Faces of the cell at hand.
    faces: Vec<Face>,
    /// What is left of the cells that were opened, by the side that it faces.
    sides: Vec<Rest>,
    /// Objects that are next in order, the first so many of these: new ones that do not turn their backs.
    sifted: Vec<Sifted>,
    waiting: usize,
    /// Where the eye lies before planes, as [`Facing::planes`](crate::facing::Facing::planes) tells.
    planes: Vec<[f64; 2]>,
    /// Those of them that are in the set, with the planes that their cells cross.
    seen: Vec<(ObjectId, Side, u16)>,
    /// The triangles of some of these, by place.
    asked: Vec<(u32, Triangle)>,
}

fn set(words: &mut [u64], index: u32) {
    words[index as usize / 64] |= 1 << (index % 64);
}

fn clear(words: &mut [u64], index: u32) {
    words[index as usize / 64] &= !(1 << (index % 64));
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
            left: 0,
            reached: 0,
            projected: 0,
            faces: Vec::new(),
            sides: Vec::new(),
            sifted: Vec::new(),
            waiting: 0,
            planes: Vec::new(),
            seen: Vec::new(),
            asked: Vec::new(),
        }
    }
}

/// Makes room for `count` items in all.
fn make_room<T>(items: &mut Vec<T>, count: usize) {
    items.reserve(count.saturating_sub(items.len()));
}

impl Walk {
    /// Makes room in all buffers for the greatest frame that a tessellation allows, so that later frames allocate nothing.
    /// Once for each content.
    fn reserve<T: Tessellation + ?Sized>(&mut self, tessellation: &T) {
        let content = tessellation.content();
        if self.reserved_for == content.stamp() {
            return;
        }
        let cells = content.cell_count() as u32;
        self.front.reserve(cells as usize);
        make_room(&mut self.sides, content.side_count);
        let mut most_faces = 0;
        for cell in 0..cells {
            let mut count = 0;
            tessellation.for_each_face(cell, &|_| true, &mut |_| count += 1);
            most_faces = most_faces.max(count);
        }
        make_room(&mut self.faces, most_faces);
        self.reserved_for = content.stamp();
    }

    /// Begins a frame: strays are projected, and the cells put into the front from which the walk begins. False if the tessellation is of another
    /// scene, or of one of which too much has changed to tell what is where.
    pub(crate) fn begin<T: Tessellation + ?Sized>(&mut self, stage: &Stage<'_, T>) -> bool {
        let content = stage.tessellation.content();
        self.reserve(stage.tessellation);
        self.cells.resize(content.cell_count(), Cell::UNKNOWN);
        for bits in [&mut self.known, &mut self.closed] {
            bits.clear();
            bits.resize(content.cell_count().div_ceil(64), 0);
        }
        self.front.clear();
        self.sides.clear();
        self.order.clear();
        self.sifted.clear();
        self.sifted.resize(content.max_count() as usize + BATCH, Sifted::NONE);
        let at_once = self.sifted.len();
        make_room(&mut self.seen, at_once);
        make_room(&mut self.asked, at_once * FEW);
        make_room(&mut self.order, stage.scene.len());
        self.waiting = 0;
        if stage.rules.one_sided {
            content.facing.planes(stage.sight.eye, &stage.tessellation.bounds(), &mut self.planes);
        }
        (self.reached, self.projected) = (0, 0);
        self.taken.clear();
        self.taken.resize(stage.scene.index_limit().max(content.index_limit()).div_ceil(64), 0);
        self.left = match stage.rules.budget {
            Budget::Objects(count) => count as u64,
            Budget::Cost(cost) => cost,
        };
        let Changes::Objects(changed) = content.changes(stage.scene) else { return false };
        for &id in content.strays().iter().chain(changed) {
            if stage.scene.contains(id) && !bit(&self.taken, id.index()) {
                set(&mut self.taken, id.index() as u32);
                if stage.visible.contains(stage.scene, id) {
                    self.order.push(id);
                    self.left = self.left.saturating_sub(self.cost(stage, id));
                }
            }
        }
        self.seed(stage);
        true
    }

    /// Puts the first cells into the front: the one that the eye is in, or, for an eye outside, those on the surface that are in view.
    fn seed<T: Tessellation + ?Sized>(&mut self, stage: &Stage<'_, T>) {
        if let Eye::Point(eye) = stage.sight.eye
            && let Some(cell) = stage.tessellation.locate(eye)
        {
            // Whatever the planes say: all lines of sight begin here.
            if !self.enter(stage, cell) {
                self.know(stage, cell, u16::MAX, &stage.tessellation.cell_bounds(cell));
                clear(&mut self.closed, cell);
            }
            let first = match stage.rules.solidity {
                Solidity::Coverage => 1.0,
                Solidity::Count => 0.0,
            };
            self.put(stage, cell, first);
            return;
        }
        for &cell in stage.tessellation.boundary() {
            if self.enter(stage, cell) {
                let value = match stage.rules.solidity {
                    Solidity::Coverage => surface_light(stage, cell, &self.cells[cell as usize]) as f32,
                    Solidity::Count => 0.0,
                };
                self.put(stage, cell, value);
            }
        }
    }

    /// Makes a cell known to the frame. Whether it may be on the way to something in view and is not open yet.
    #[inline]
    fn enter<T: Tessellation + ?Sized>(&mut self, stage: &Stage<'_, T>, cell: u32) -> bool {
        if bit(&self.known, cell as usize) {
            return !bit(&self.closed, cell as usize);
        }
        set(&mut self.known, cell);
        let bounds = stage.tessellation.cell_bounds(cell);
        let Place::Crossing(crossed) = stage.sight.place(&bounds) else {
            set(&mut self.closed, cell);
            return false;
        };
        self.know(stage, cell, crossed, &bounds);
        true
    }

    /// Fills in what a cell's neighbours and its content ask for.
    #[inline]
    fn know<T: Tessellation + ?Sized>(
        &mut self,
        stage: &Stage<'_, T>,
        cell: u32,
        crossed: u16,
        bounds: &Aabb,
    ) {
        let content = stage.tessellation.content();
        let mut known = Cell { crossed, to: if content.is_empty(cell) { 0 } else { ALL }, ..Cell::UNKNOWN };
        if stage.rules.solidity == Solidity::Coverage {
            let center = stage.tessellation.center(cell);
            let direction = stage.sight.direction(center);
            let area = stage.tessellation.projected_area(cell, direction);
            known.direction = direction.as_vec3();
            known.area = area as f32;
            known.nearness = nearness(&stage.sight, center, area);
        }
        self.cells[cell as usize] = known;
        if stage.rules.solidity == Solidity::Coverage {
            self.open(stage, cell, bounds);
            // What holds nothing costs nothing.
            self.cells[cell as usize].worth = self.best_side(cell).map_or(1.0, |(_, worth)| worth);
        }
    }

    /// Puts a cell into the front, or again with another value.
    #[inline]
    fn put<T: ?Sized>(&mut self, stage: &Stage<'_, T>, cell: u32, value: f32) {
        let known = &mut self.cells[cell as usize];
        if known.value == value {
            return;
        }
        self.reached += u64::from(known.value.is_nan());
        known.value = value;
        let solidity = match stage.rules.solidity {
            Solidity::Coverage => 1.0 - chance(value) * known.worth,
            Solidity::Count => value,
        };
        self.front.push(solidity, cell);
    }

    /// Takes the least solid cell out of the front.
    #[inline]
    pub(crate) fn next(&mut self) -> Option<u32> {
        while let Some(cell) = self.front.pop() {
            // What was finished otherwise may have been put in again meanwhile, by its neighbours.
            if !bit(&self.closed, cell as usize) || self.has_content(cell) {
                return Some(cell);
            }
        }
        None
    }

    /// Goes on with a cell out of the front: through it when it comes first, then through its layers, as long as no other cell has better.
    #[inline]
    pub(crate) fn step<T: Tessellation + ?Sized>(&mut self, stage: &Stage<'_, T>, cell: u32) -> Projected {
        if !bit(&self.closed, cell as usize) {
            self.go_through(stage, cell);
        }
        self.open_late(stage, cell);
        while let Some((side, worth)) = self.best_side(cell) {
            let solidity = match stage.rules.solidity {
                Solidity::Coverage => 1.0 - chance(self.cells[cell as usize].value) * worth,
                // As in the paper, all that a cell holds at once.
                Solidity::Count => 0.0,
            };
            if self.front.least().is_some_and(|least| least < solidity) {
                self.front.push(solidity, cell);
                break;
            }
            if self.project(stage, cell, side, false) == Projected::Cut {
                return Projected::Cut;
            }
        }
        Projected::Whole
    }

    /// Puts a cell back into the front.
    pub(crate) fn put_back(&mut self, cell: u32) {
        self.front.push(0.0, cell);
    }

    /// Takes a cell out of the frame: nothing goes through it.
    pub(crate) fn shut(&mut self, cell: u32) {
        self.cells[cell as usize].to = 0;
        set(&mut self.closed, cell);
    }

    /// Whether a cell holds what is not projected yet.
    pub(crate) fn has_content(&self, cell: u32) -> bool {
        let known = &self.cells[cell as usize];
        known.from < known.to
    }

    /// Projects all that is left in a cell whatever the budget, and goes through it, if it was not shut and neither was done yet.
    pub(crate) fn finish<T: Tessellation + ?Sized>(&mut self, stage: &Stage<'_, T>, cell: u32) {
        self.open_late(stage, cell);
        while let Some((side, _)) = self.best_side(cell) {
            self.project(stage, cell, side, true);
        }
        self.settle(stage, true);
        if !bit(&self.closed, cell as usize) {
            self.go_through(stage, cell);
        }
    }

    /// Hands the solidity of a cell on to those neighbours that lines of sight may enter from it, and puts them into the front.
    #[inline]
    fn go_through<T: Tessellation + ?Sized>(&mut self, stage: &Stage<'_, T>, cell: u32) {
        set(&mut self.closed, cell);
        self.projected += 1;
        let tessellation = stage.tessellation;
        let known = &self.cells[cell as usize];
        let direction = match stage.rules.solidity {
            Solidity::Coverage => known.direction.as_dvec3(),
            Solidity::Count => stage.sight.direction(tessellation.center(cell)),
        };
        let stopped = stopped(tessellation.content().cover(cell), direction);
        let from = From { cell, direction, value: known.value };
        let through = f64::from(known.value) * (1.0 - stopped);
        let mut faces = core::mem::take(&mut self.faces);
        faces.clear();
        let open = |neighbour: u32| !bit(&self.closed, neighbour as usize);
        tessellation.for_each_face(cell, &open, &mut |face| {
            if stage.sight.may_leave(face.point, face.normal) {
                faces.push(*face);
            }
        });
        for face in &faces {
            let neighbour = face.neighbour;
            if !self.enter(stage, neighbour) {
                continue;
            }
            let known = &self.cells[neighbour as usize];
            let value = match stage.rules.solidity {
                Solidity::Coverage => {
                    let (area, direction) = (f64::from(known.area), known.direction.as_dvec3());
                    let more = through * share(area, direction, face.normal, face.area);
                    // What is not a number yet counts as none.
                    (known.value.max(0.0) + more as f32).min(1.0)
                }
                Solidity::Count => {
                    count_solidity(tessellation, &stage.sight, &from, face, tessellation.center(neighbour))
                }
            };
            self.put(stage, neighbour, value);
        }
        self.faces = faces;
    }
}

/// The share of a surface cell's light that comes from outside.
fn surface_light<T: Tessellation + ?Sized>(stage: &Stage<'_, T>, cell: u32, known: &Cell) -> f64 {
    let mut inner = 0.0;
    let (area, direction) = (f64::from(known.area), known.direction.as_dvec3());
    stage.tessellation.for_each_face(cell, &|_| true, &mut |face| {
        inner += share(area, direction, -face.normal, face.area);
    });
    (1.0 - inner).max(0.0)
}
