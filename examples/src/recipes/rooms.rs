//! Furnished rooms: the positions of the furniture in living rooms, kitchens, bedrooms and offices.

use super::furniture as piece;
use super::mesh::{Mesh, Parts, Pose};
use super::random::Random;
use glam::DVec3;

/// Use of a room, which decides the furniture that is put into it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RoomKind {
    Living,
    Kitchen,
    Bedroom,
    Office,
}

/// Rectangle of floor to furnish: minimum corner, maximum corner and height, in metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Floor {
    pub(crate) low: [f64; 2],
    pub(crate) high: [f64; 2],
    pub(crate) z: f64,
}

/// Number of quarter turns after which a piece of furniture faces +y: none, since furniture is modelled so.
const NORTH: u8 = 0;
/// Number of counter-clockwise quarter turns after which a piece of furniture faces -x.
const WEST: u8 = 1;
/// Number of counter-clockwise quarter turns after which a piece of furniture faces -y.
const SOUTH: u8 = 2;
/// Number of counter-clockwise quarter turns after which a piece of furniture faces +x.
const EAST: u8 = 3;

/// Adds the furniture of a room of the given kind to `parts`. Object names are `tag`, a slash, and the name
/// of the piece. Pieces of a fixed size may stand out of a floor that is too small.
pub(crate) fn furnish(random: &mut Random, kind: RoomKind, floor: &Floor, tag: &str, parts: &mut Parts<'_>) {
    let mut room = Room { floor, tag, parts };
    match kind {
        RoomKind::Living => room.living(random),
        RoomKind::Kitchen => room.kitchen(),
        RoomKind::Bedroom => room.bedroom(random),
        RoomKind::Office => room.office(random),
    }
}

/// Room being furnished, with the prefix of its object names and the receiver of the objects.
struct Room<'a, 'b> {
    floor: &'a Floor,
    tag: &'a str,
    parts: &'a mut Parts<'b>,
}

impl Room<'_, '_> {
    /// Adds a piece of furniture at (`x`, `y`) metres on the floor, turned counter-clockwise by `facing`
    /// quarter turns.
    fn put(&mut self, name: &str, mesh: Mesh, x: f64, y: f64, facing: u8) {
        let pose = Pose::quarters(facing, DVec3::new(x, y, self.floor.z));
        self.parts.add(format!("{}/{name}", self.tag), mesh.placed(&pose));
    }

    /// Returns the centre (x, y) of the floor, in metres.
    fn centre(&self) -> (f64, f64) {
        let Floor { low, high, .. } = self.floor;
        ((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0)
    }

    /// Adds a dining table centred at (`x`, `y`) metres, with two chairs on its southern and two on its
    /// northern side.
    fn dining_group(&mut self, x: f64, y: f64) {
        self.put("table", piece::dining_table(), x, y, NORTH);
        let seats = [(-0.4, -0.65, NORTH), (0.4, -0.65, NORTH), (-0.4, 0.65, SOUTH), (0.4, 0.65, SOUTH)];
        for (right, forward, facing) in seats {
            self.put("chair", piece::chair(), x + right, y + forward, facing);
        }
    }

    /// Adds two shelves side by side along the western edge of the floor. Their centres are `off_wall` metres
    /// from that edge.
    fn shelves(&mut self, random: &mut Random, off_wall: f64) {
        let (_, cy) = self.centre();
        let x = self.floor.low[0] + off_wall;
        self.put("shelf", piece::shelf(random), x, cy, EAST);
        self.put("shelf", piece::shelf(random), x, cy + 1.0, EAST);
    }

    fn living(&mut self, random: &mut Random) {
        let (cx, _) = self.centre();
        let Floor { low, high, .. } = *self.floor;
        self.put("sofa", piece::sofa(), cx, low[1] + 0.8, NORTH);
        self.put("coffee", piece::coffee_table(), cx, low[1] + 1.9, NORTH);
        self.dining_group(cx, high[1] - 1.5);
        self.shelves(random, 0.35);
        self.put("lamp", piece::lamp(), high[0] - 0.4, low[1] + 2.6, NORTH);
        let plant = piece::plant(random);
        self.put("plant", plant, high[0] - 0.4, high[1] - 0.4, NORTH);
    }

    fn kitchen(&mut self) {
        const UNITS: usize = 4;
        const UNIT_STEP: f64 = 0.62;
        let (cx, _) = self.centre();
        let Floor { low, high, .. } = *self.floor;
        let (x, y) = (low[0] + 0.6, low[1] + 0.45);
        for unit in 0..UNITS {
            let x = x + UNIT_STEP * unit as f64;
            self.put("unit", piece::cupboard(0.6, 0.9), x, y, NORTH);
        }
        let fridge = piece::cupboard(0.6, 1.9);
        self.put("fridge", fridge, x + UNIT_STEP * UNITS as f64, y, NORTH);
        self.dining_group(cx, high[1] - 1.3);
    }

    fn bedroom(&mut self, random: &mut Random) {
        let (cx, _) = self.centre();
        let Floor { low, high, .. } = *self.floor;
        self.put("bed", piece::bed(), cx, low[1] + 1.2, NORTH);
        let wardrobe = piece::cupboard(1.2, 2.1);
        self.put("wardrobe", wardrobe, high[0] - 0.5, high[1] - 1.0, WEST);
        self.put("lamp", piece::lamp(), cx - 1.0, low[1] + 0.4, NORTH);
        self.put("chair", piece::chair(), low[0] + 0.5, high[1] - 0.6, SOUTH);
        let plant = piece::plant(random);
        self.put("plant", plant, low[0] + 0.4, low[1] + 0.4, NORTH);
    }

    fn office(&mut self, random: &mut Random) {
        let (cx, _) = self.centre();
        let Floor { low, high, .. } = *self.floor;
        self.put("desk", piece::desk(), cx, high[1] - 0.9, SOUTH);
        self.put("computer", piece::computer(), cx, high[1] - 0.9, SOUTH);
        self.put("chair", piece::chair(), cx, high[1] - 1.7, NORTH);
        self.put("chair", piece::chair(), cx + 0.9, low[1] + 1.0, SOUTH);
        self.shelves(random, 0.3);
        self.put("lamp", piece::lamp(), high[0] - 0.35, high[1] - 0.4, NORTH);
        let plant = piece::plant(random);
        self.put("plant", plant, high[0] - 0.4, low[1] + 1.4, NORTH);
    }
}
