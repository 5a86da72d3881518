//! London recipe: a 2.5-D city of terraces of prisms along the edges of blocks on warped streets, with a few
//! towers in the centre.
//!
//! The city stands in for the city model of the paper on virtual occluders. It has many simple buildings of a
//! few storeys; a person in the street sees the nearest rows and the towers above the rows.

use super::limits::Limits;
use super::mesh::{Mesh, Parts};
use super::random::Random;
use super::scene::{Route, scene};
use crate::error::SourceError;
use crate::source::SceneSource;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// Seed of the city's random numbers. Another seed gives another city.
const SEED: u64 = 2;

/// Size of a block along x and y, in metres, before the warp.
const BLOCK: DVec2 = DVec2::new(80.0, 60.0);
/// Width of a street, in metres, before the warp.
const STREET: f64 = 12.0;
/// Distance from one block to the next along x and y, in metres: a block and a street.
const PITCH: DVec2 = DVec2::new(BLOCK.x + STREET, BLOCK.y + STREET);

/// Height of a storey of a building, in metres.
const STOREY: f64 = 3.0;
/// Chance, as a fraction, that a lot at the very centre of the city is a tower.
const TOWER_CHANCE: f64 = 0.04;
/// Distance from the centre, in metres, at which the chance of a tower has fallen to 1/e of [`TOWER_CHANCE`].
const TOWER_REACH: f64 = 600.0;
/// Chance, as a fraction, that a lot stays empty.
const GAP_CHANCE: f64 = 0.03;

/// Estimated triangles of one block, for the bound on the size of the scene.
const TRIANGLES_PER_BLOCK: u64 = 250;

/// Makes the city of `blocks_x` by `blocks_y` blocks, each with about 25 buildings. The objects go to
/// `parts`, and the scene is returned without them.
///
/// 12 by 12 blocks are 3,674 objects with 35,588 triangles; 101 by 101 blocks make the full city of 249,851
/// buildings.
///
/// # Errors
///
/// Returns [`SourceError::Recipe`] when a size is 0 or the scene would have more triangles than recipes may
/// make.
pub(super) fn london(blocks_x: u32, blocks_y: u32, parts: Parts<'_>) -> Result<SceneSource, SourceError> {
    let limits = Limits::new(format!("london:{blocks_x},{blocks_y}"));
    limits.at_least_one("blocks along x", blocks_x)?;
    limits.at_least_one("blocks along y", blocks_y)?;
    limits.triangles(u64::from(blocks_x) * u64::from(blocks_y), TRIANGLES_PER_BLOCK)?;

    let mut city = City {
        random: Random::new(SEED),
        centre: DVec2::new(f64::from(blocks_x), f64::from(blocks_y)) * PITCH / 2.0,
        parts,
    };
    for block_x in 0..blocks_x {
        for block_y in 0..blocks_y {
            city.block(DVec2::new(f64::from(block_x), f64::from(block_y)) * PITCH);
        }
    }
    for block_x in 0..blocks_x {
        for block_y in 0..blocks_y {
            let corner = DVec2::new(f64::from(block_x), f64::from(block_y)) * PITCH;
            city.parts.add("ground", ground(corner));
        }
    }
    Ok(scene("london", 0.2, &ROUTES))
}

/// Returns the position `p`, in metres on the plan, displaced by sums of sine waves that bend the street
/// grid. Every corner of a building is displaced by this function.
fn warp(p: DVec2) -> DVec2 {
    let wave = |way: f64, length: f64| way / length * TAU;
    let x = p.x + 25.0 * wave(p.y, 400.0).sin() + 12.0 * wave(p.x + p.y, 173.0).sin();
    let y = p.y + 25.0 * wave(p.x, 470.0).sin() + 12.0 * wave(p.x - p.y, 211.0).cos();
    DVec2::new(x, y)
}

/// Makes the ground quadrilateral under a block and under the streets to its south and west. `block` is the
/// block's minimum corner before the warp, in metres.
fn ground(block: DVec2) -> Mesh {
    let low = block - STREET;
    let high = low + PITCH;
    let corners = rectangle(low, high).map(|p| -> DVec3 { warp(p).extend(0.0) });
    let mut mesh = Mesh::new();
    mesh.quad(corners);
    mesh
}

/// Returns the corners of an axis-aligned rectangle, counter-clockwise from its minimum corner `low`.
fn rectangle(low: DVec2, high: DVec2) -> [DVec2; 4] {
    [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]
}

/// Side of a block, in the order in which the sides are built. The rows of houses on the south and north
/// sides include the block's corners; the rows on the west and east sides lie between those two rows.
#[derive(Debug, Clone, Copy)]
enum Side {
    South,
    North,
    West,
    East,
}

impl Side {
    /// Returns the plan of a lot along this side of the block whose minimum corner is `block`,
    /// counter-clockwise, in metres before the warp. `from` and `to` are coordinates along the side; `depth`
    /// is the lot's extent from the edge of the block inwards.
    fn lot(self, block: DVec2, [from, to]: [f64; 2], depth: f64) -> [DVec2; 4] {
        let end = block + BLOCK;
        match self {
            Side::South => rectangle(DVec2::new(from, block.y), DVec2::new(to, block.y + depth)),
            Side::North => rectangle(DVec2::new(from, end.y - depth), DVec2::new(to, end.y)),
            Side::West => rectangle(DVec2::new(block.x, from), DVec2::new(block.x + depth, to)),
            Side::East => rectangle(DVec2::new(end.x - depth, from), DVec2::new(end.x, to)),
        }
    }
}

/// City under construction: the random numbers, the centre of the block grid in metres, and the receiver of
/// the objects.
struct City<'a> {
    random: Random,
    centre: DVec2,
    parts: Parts<'a>,
}

impl City<'_> {
    /// Adds a prism over the warped `plan` from the ground up to `height` metres, as one object. The plan is
    /// counter-clockwise, in metres before the warp.
    fn building(&mut self, plan: [DVec2; 4], height: f64) {
        let mut mesh = Mesh::new();
        mesh.prism(&plan.map(warp), 0.0, height);
        let name = format!("b{}", self.parts.count());
        self.parts.add(name, mesh);
    }

    /// Adds a block's buildings: terraces along its four sides and zero to three sheds in the court. `block`
    /// is the minimum corner before the warp, in metres.
    fn block(&mut self, block: DVec2) {
        let end = block + BLOCK;
        let depth = self.random.between(10.0, 14.0);
        let wide = [block.x, end.x];
        let between_rows = [block.y + depth, end.y - depth];
        self.terrace(Side::South, block, wide, depth);
        self.terrace(Side::North, block, wide, depth);
        self.terrace(Side::West, block, between_rows, depth);
        self.terrace(Side::East, block, between_rows, depth);
        for _ in 0..self.random.below(4) {
            self.shed(block);
        }
    }

    /// Adds adjacent lots with one building each along one side of a block. `start` and `end` are coordinates
    /// along the side, and `depth` the row's extent inwards, in metres before the warp. Some lots stay empty.
    fn terrace(&mut self, side: Side, block: DVec2, [start, end]: [f64; 2], depth: f64) {
        /// Minimum length of the rest of a terrace, in metres. A shorter rest is added to the lot before it.
        const NARROWEST: f64 = 4.0;
        /// Maximum length, in metres, of the rest at the end of a terrace that stays open; a longer rest gets
        /// another lot.
        const SLACK: f64 = 3.0;
        let mut from = start;
        while from < end - SLACK {
            let width = self.random.between(6.0, 14.0);
            let mut to = (from + width).min(end);
            if end - to < NARROWEST {
                to = end;
            }
            // The square makes low houses more frequent than high ones.
            let storeys = 2 + (4.0 * self.random.unit().powi(2)) as u32;
            let mut height = STOREY * f64::from(storeys) + self.random.between(0.0, 1.5);
            let lot_depth = depth - self.random.between(0.0, 3.0);
            let from_centre = (block - self.centre).length();
            if self.random.unit() < TOWER_CHANCE * (-from_centre / TOWER_REACH).exp() {
                height = self.random.between(40.0, 150.0);
            }
            if self.random.unit() >= GAP_CHANCE {
                self.building(side.lot(block, [from, to], lot_depth), height);
            }
            from = to;
        }
    }

    /// Adds a one-storey building with a crooked plan at a random position in the court of the block whose
    /// minimum corner is `block`.
    fn shed(&mut self, block: DVec2) {
        let end = block + BLOCK;
        let x = self.random.between(block.x + 18.0, end.x - 26.0);
        let y = self.random.between(block.y + 18.0, end.y - 24.0);
        let width = self.random.between(3.0, 7.0);
        let plan = [
            DVec2::new(x, y),
            DVec2::new(x + width, y),
            DVec2::new(x + 5.0, y + 5.0),
            DVec2::new(x, y + 4.0),
        ];
        self.building(plan, STOREY);
    }
}

/// Camera walks through the city, made for 12 by 12 blocks.
const ROUTES: [Route; 3] = [
    Route {
        name: "high street, west to centre",
        fov_y_degrees: 60.0,
        keys: 64,
        look_ahead: 20.0,
        waypoints: &[
            [20.8, 420.2],
            [21.0, 416.8],
            [30.7, 406.3],
            [28.5, 387.2],
            [17.3, 374.1],
            [2.1, 366.9],
            [-9.6, 374.9],
            [-9.3, 417.6],
            [7.9, 436.3],
            [29.2, 444.0],
            [127.0, 438.7],
            [174.1, 444.1],
            [183.3, 447.9],
            [206.4, 448.5],
            [286.0, 411.3],
            [337.2, 391.3],
            [358.4, 392.1],
            [398.7, 415.2],
            [433.6, 424.1],
            [476.0, 428.6],
            [520.5, 428.5],
            [551.1, 433.5],
            [548.5, 424.2],
            [548.6, 451.5],
            [569.7, 510.6],
            [583.1, 519.4],
            [637.7, 510.2],
            [703.1, 514.2],
            [717.1, 507.5],
            [741.7, 507.3],
            [793.9, 484.9],
            [812.6, 470.4],
            [812.5, 470.9],
            [821.8, 456.9],
        ],
    },
    Route {
        name: "north to the towers",
        fov_y_degrees: 65.0,
        keys: 56,
        look_ahead: 20.0,
        waypoints: &[
            [559.8, 24.5],
            [565.7, 32.9],
            [566.4, 32.8],
            [568.6, 53.5],
            [566.5, 74.0],
            [566.9, 74.1],
            [563.0, 92.1],
            [562.9, 91.8],
            [559.5, 128.6],
            [559.5, 154.5],
            [565.6, 177.0],
            [565.4, 198.7],
            [561.1, 208.3],
            [530.2, 246.9],
            [528.0, 254.8],
            [520.7, 263.3],
            [513.5, 281.2],
            [511.1, 318.6],
            [517.4, 341.5],
            [540.4, 384.4],
            [540.3, 384.3],
            [544.1, 388.0],
            [549.0, 413.3],
            [547.2, 423.1],
            [549.0, 452.9],
            [568.6, 508.1],
            [577.9, 517.8],
            [590.3, 518.7],
            [630.8, 511.6],
            [631.3, 510.1],
            [640.2, 507.0],
        ],
    },
    Route {
        name: "back streets",
        fov_y_degrees: 65.0,
        keys: 56,
        look_ahead: 12.0,
        waypoints: &[
            [196.2, 200.8],
            [190.8, 206.3],
            [189.0, 227.2],
            [192.8, 233.1],
            [204.0, 232.5],
            [215.1, 228.4],
            [241.0, 206.7],
            [250.9, 207.5],
            [252.0, 249.3],
            [255.5, 261.4],
            [256.9, 295.1],
            [246.8, 327.0],
            [250.7, 332.5],
            [294.1, 336.4],
            [297.4, 338.1],
            [334.3, 339.6],
            [333.5, 340.3],
            [351.6, 340.8],
            [357.4, 346.6],
            [364.5, 360.9],
            [368.6, 374.6],
            [367.2, 407.3],
            [369.3, 422.4],
            [382.2, 459.2],
            [382.0, 463.8],
            [387.4, 471.8],
            [393.5, 500.0],
            [393.5, 523.6],
            [386.4, 549.5],
            [393.0, 551.4],
            [394.3, 555.6],
            [424.7, 551.5],
            [447.2, 551.6],
            [460.2, 560.5],
        ],
    },
];
