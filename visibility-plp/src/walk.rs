//! The walk through the cells of a tessellation that both cullers share: the rendering loop of the paper's figure 4.

use crate::content::bit;
use crate::facing::{Side, Toward};
use crate::sight::{Place, Sight};
use crate::solidity::{From, count_solidity, share, stopped, worth};
use crate::{Face, Front, Solidity, Tessellation};
use alloc::vec::Vec;
use visibility_core::glam::Vec3;
use visibility_core::{Changes, Eye, ObjectId, Scene, VisibleSet};

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

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum State {
    /// In the front, or was, until it was found hidden.
    Waiting,
    /// Projected.
    Done,
    /// Not on the way to anything in view.
    Outside,
}

/// What a frame knows of a cell.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// The frame; what another frame knew is worth nothing.
    frame: u32,
    /// Its newest ticket in the front.
    ticket: u32,
    /// The light that reaches it, or its solidity.
    value: f32,
    worth: f32,
    state: State,
    /// Planes of the view that not all of it is inside of, by bit.
    crossed: u16,
    /// Unit direction of sight to its centre.
    direction: Vec3,
    /// Its area seen along that direction.
    area: f64,
}

impl Cell {
    const UNKNOWN: Self = Self {
        frame: 0,
        ticket: u32::MAX,
        value: 0.0,
        worth: 1.0,
        state: State::Outside,
        crossed: 0,
        direction: Vec3::ZERO,
        area: 0.0,
    };
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

/// How a cell's projection ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Projected {
    Whole,
    /// The budget did not last for all of it.
    Cut,
}

/// The memory of a walk, kept from frame to frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct Walk {
    cells: Vec<Cell>,
    /// By cell, a bit for those that are projected or outside: most faces lead there, and need no more than this.
    closed: Vec<u64>,
    frame: u32,
    pub(crate) front: Front,
    /// By object index.
    taken: Vec<u64>,
    /// What was projected, in order.
    pub(crate) order: Vec<ObjectId>,
    /// What is left of the budget.
    left: u64,
    /// Cells that came to be in the front, and those that were projected.
    pub(crate) reached: u64,
    pub(crate) projected: u64,
    /// Faces of the cell at hand.
    faces: Vec<Face>,
}

fn set(words: &mut [u64], index: u32) {
    words[index as usize / 64] |= 1 << (index % 64);
}

fn clear(words: &mut [u64], index: u32) {
    words[index as usize / 64] &= !(1 << (index % 64));
}

/// More triangles than this are not looked at to find that an object turns its back or lies outside the view.
const FEW: usize = 4;

impl Walk {
    /// Begins a frame: strays are projected, and the cells put into the front from which the walk begins. False if the tessellation is of another
    /// scene, or of one of which too much has changed to tell what is where.
    pub(crate) fn begin<T: Tessellation + ?Sized>(&mut self, stage: &Stage<'_, T>) -> bool {
        let content = stage.tessellation.content();
        self.frame = self.frame.wrapping_add(1);
        if self.frame == 0 || self.cells.len() != content.cell_count() {
            self.cells.clear();
            self.cells.resize(content.cell_count(), Cell::UNKNOWN);
            self.frame = 1;
        }
        self.closed.clear();
        self.closed.resize(content.cell_count().div_ceil(64), 0);
        self.front.clear();
        self.order.clear();
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
                self.taken[id.index() / 64] |= 1 << (id.index() % 64);
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
                let known = &mut self.cells[cell as usize];
                (known.state, known.crossed) = (State::Waiting, u16::MAX);
                known.direction = stage.sight.direction(stage.tessellation.center(cell)).as_vec3();
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

    fn cost<T: ?Sized>(&self, stage: &Stage<'_, T>, id: ObjectId) -> u64 {
        match stage.rules.budget {
            Budget::Objects(_) => 1,
            Budget::Cost(_) => stage.scene.object(id).map_or(0, |object| object.cost.into()),
        }
    }

    /// Makes a cell known to the frame. Whether it may be on the way to something in view and is not projected yet.
    #[inline]
    fn enter<T: Tessellation + ?Sized>(&mut self, stage: &Stage<'_, T>, cell: u32) -> bool {
        let known = &mut self.cells[cell as usize];
        if known.frame == self.frame {
            return known.state == State::Waiting;
        }
        *known = Cell { frame: self.frame, ..Cell::UNKNOWN };
        let Place::Crossing(crossed) = stage.sight.place(&stage.tessellation.cell_bounds(cell)) else {
            set(&mut self.closed, cell);
            return false;
        };
        (known.state, known.crossed) = (State::Waiting, crossed);
        if stage.rules.solidity == Solidity::Coverage {
            let center = stage.tessellation.center(cell);
            let direction = stage.sight.direction(center);
            known.direction = direction.as_vec3();
            known.area = stage.tessellation.projected_area(cell, direction);
            known.worth =
                worth(stage.tessellation.content(), &stage.sight, cell, center, direction, known.area);
        }
        true
    }

    /// Puts a cell into the front, or again with another value.
    #[inline]
    fn put<T: ?Sized>(&mut self, stage: &Stage<'_, T>, cell: u32, value: f32) {
        let known = &mut self.cells[cell as usize];
        if known.ticket != u32::MAX && known.value == value {
            return;
        }
        self.reached += u64::from(known.ticket == u32::MAX);
        known.value = value;
        let solidity = match stage.rules.solidity {
            Solidity::Coverage => 1.0 - value * known.worth,
            Solidity::Count => value,
        };
        known.ticket = self.front.push(solidity, cell);
    }

    /// Takes the least solid cell out of the front.
    #[inline]
    pub(crate) fn next(&mut self) -> Option<u32> {
        while let Some(entry) = self.front.pop() {
            let known = &self.cells[entry.cell as usize];
            if known.ticket == entry.ticket && known.state == State::Waiting {
                return Some(entry.cell);
            }
        }
        None
    }

    /// Puts a cell back into the front as it was.
    pub(crate) fn put_back<T: ?Sized>(&mut self, stage: &Stage<'_, T>, cell: u32) {
        let value = self.cells[cell as usize].value;
        self.cells[cell as usize].ticket = u32::MAX;
        self.reached -= 1;
        self.put(stage, cell, value);
    }

    /// Takes a cell out of the frame: nothing goes through it.
    pub(crate) fn shut(&mut self, cell: u32) {
        self.cells[cell as usize].state = State::Outside;
        set(&mut self.closed, cell);
    }

    /// Whether a cell that was taken out of the front may still be projected.
    pub(crate) fn is_open(&self, cell: u32) -> bool {
        self.cells[cell as usize].state == State::Waiting
    }

    /// Projects what a cell holds, each object once, as far as the budget lasts.
    pub(crate) fn project<T: Tessellation + ?Sized>(
        &mut self,
        stage: &Stage<'_, T>,
        cell: u32,
        unlimited: bool,
    ) -> Projected {
        let content = stage.tessellation.content();
        let crossed = self.cells[cell as usize].crossed;
        let toward = (stage.rules.one_sided && content.count(cell) > 0)
            .then(|| Toward::new(stage.sight.eye, &stage.tessellation.cell_bounds(cell)));
        for index in content.primitives(cell) {
            let index = index as usize;
            let Some(word) = self.taken.get_mut(index / 64) else { continue };
            if *word >> (index % 64) & 1 != 0 {
                continue;
            }
            *word |= 1 << (index % 64);
            let side = toward.as_ref().map_or(Side::Front, |toward| content.facing.side(index, toward));
            if side == Side::Back {
                continue;
            }
            let Some(id) = stage.scene.id_at(index) else { continue };
            // Cheaper than to ask the set.
            if (side == Side::Unknown || crossed != 0) && is_out_of_sight(stage, id, side, crossed) {
                continue;
            }
            if !stage.visible.contains(stage.scene, id) {
                continue;
            }
            if !unlimited {
                let cost = self.cost(stage, id);
                if cost > self.left {
                    self.taken[index / 64] &= !(1 << (index % 64));
                    return Projected::Cut;
                }
                self.left -= cost;
            }
            self.order.push(id);
        }
        self.cells[cell as usize].state = State::Done;
        set(&mut self.closed, cell);
        self.projected += 1;
        Projected::Whole
    }

    /// Hands the solidity of a projected cell on to those neighbours that lines of sight may enter from it, and puts them into the front.
    #[inline]
    pub(crate) fn hand_on<T: Tessellation + ?Sized>(&mut self, stage: &Stage<'_, T>, cell: u32) {
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
        tessellation.for_each_face(cell, &open, &mut |face| faces.push(*face));
        for face in faces.iter().filter(|face| stage.sight.may_leave(face.point, face.normal)) {
            let neighbour = face.neighbour;
            if !self.enter(stage, neighbour) {
                continue;
            }
            let known = &self.cells[neighbour as usize];
            let value = match stage.rules.solidity {
                Solidity::Coverage => {
                    let more =
                        through * share(known.area, known.direction.as_dvec3(), face.normal, face.area);
                    (known.value + more as f32).min(1.0)
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
    let direction = known.direction.as_dvec3();
    stage.tessellation.for_each_face(cell, &|_| true, &mut |face| {
        inner += share(known.area, direction, -face.normal, face.area);
    });
    (1.0 - inner).max(0.0)
}

/// Whether an object of few triangles is surely out of sight.
#[inline]
fn is_out_of_sight<T: ?Sized>(stage: &Stage<'_, T>, id: ObjectId, side: Side, crossed: u16) -> bool {
    let triangles = stage.scene.triangles(id).unwrap_or(&[]);
    if triangles.is_empty() || triangles.len() > FEW {
        return false;
    }
    (side == Side::Unknown && stage.sight.sees_backs(triangles)) || stage.sight.is_outside(triangles, crossed)
}
