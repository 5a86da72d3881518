//! City recipe: furnished houses on a grid of streets, in place of the CITY model of the paper on
//! prioritized-layered projection.
//!
//! Blocks of 4 by 2 lots lie between streets. Each house has two storeys of four furnished rooms, windows, a
//! front door and inner doors without leaves, a gabled roof and a chimney. From the street little of the
//! interiors is visible, and from inside little of the city.

use super::limits::Limits;
use super::mesh::{Mesh, Parts, Pose};
use super::random::Random;
use super::rooms::{Floor, RoomKind, furnish};
use super::scene::{Route, scene};
use super::walls::{Opening, Wall};
use crate::error::SourceError;
use crate::source::SceneSource;
use glam::DVec3;

/// Seed of the city's random numbers. Another seed gives another city.
const SEED: u64 = 1;

/// Size of a block along x and y, in metres.
const BLOCK: [f64; 2] = [64.0, 40.0];
/// Width of a street, in metres.
const STREET: f64 = 12.0;
/// Width of a lot along x, in metres.
const LOT_WIDTH: f64 = 16.0;
/// Number of lots along x in each row of a block.
const LOTS_ALONG: u32 = 4;
/// Distances of the centre lines of the two rows of houses from the southern edge of the block, in metres.
const ROWS: [f64; 2] = [9.5, 30.5];

/// Size of a house along x, in metres.
const WIDTH: f64 = 10.0;
/// Size of a house along y, in metres.
const DEPTH: f64 = 9.0;
/// Height of a room from floor to ceiling, in metres.
const ROOM_HEIGHT: f64 = 2.8;
/// Thickness of the slab below each storey and of the ceiling, in metres.
const SLAB: f64 = 0.2;
/// Number of storeys of a house.
const STOREYS: u32 = 2;
/// Thickness of the outer walls, in metres.
const OUTER_WALL: f64 = 0.25;
/// Thickness of the inner walls, in metres.
const INNER_WALL: f64 = 0.12;
/// Coordinates of the two inner walls that divide a storey into four rooms: x of the wall along y, then y of
/// the wall along x, in metres from the south-western corner of the house.
const CROSS: [f64; 2] = [5.8, 4.5];

/// Number of triangles of one block with its eight houses and its ground.
const TRIANGLES_PER_BLOCK: u64 = 58_056;

/// Makes the city of `blocks_x` by `blocks_y` blocks, each of eight houses. The objects go to `parts`, and
/// the scene is returned without them.
///
/// 2 by 2 blocks are 2,376 objects with 232,224 triangles.
///
/// # Errors
///
/// Returns [`SourceError::Recipe`] when a size is 0 or the scene would have more triangles than recipes may
/// make.
pub(super) fn plpcity(
    blocks_x: u32,
    blocks_y: u32,
    mut parts: Parts<'_>,
) -> Result<SceneSource, SourceError> {
    let limits = Limits::new(format!("plpcity:{blocks_x},{blocks_y}"));
    limits.at_least_one("blocks along x", blocks_x)?;
    limits.at_least_one("blocks along y", blocks_y)?;
    limits.triangles(u64::from(blocks_x) * u64::from(blocks_y), TRIANGLES_PER_BLOCK)?;

    let mut random = Random::new(SEED);
    for block_x in 0..blocks_x {
        for block_y in 0..blocks_y {
            block(&mut random, block_x, block_y, &mut parts);
        }
    }
    for block_x in 0..blocks_x {
        for block_y in 0..blocks_y {
            parts.add("ground", ground(block_x, block_y));
        }
    }
    Ok(scene("plpcity", 0.1, &ROUTES))
}

/// Returns the minimum corner (x, y) of a block, in metres. `block_x` and `block_y` are the indices of the
/// block.
fn corner(block_x: u32, block_y: u32) -> (f64, f64) {
    (f64::from(block_x) * (BLOCK[0] + STREET), f64::from(block_y) * (BLOCK[1] + STREET))
}

/// Makes the slab of ground under a block and the streets around it, from 0.5 m to 0.12 m below the
/// pavement's surface.
fn ground(block_x: u32, block_y: u32) -> Mesh {
    let (x, y) = corner(block_x, block_y);
    let (next_x, next_y) = corner(block_x + 1, block_y + 1);
    Mesh::from_cuboid([x - STREET, y - STREET, -0.5], [next_x, next_y, -0.12])
}

/// Adds the pavement and the eight houses of a block to `parts`. `block_x` and `block_y` are the indices of
/// the block.
fn block(random: &mut Random, block_x: u32, block_y: u32, parts: &mut Parts<'_>) {
    let (x, y) = corner(block_x, block_y);
    let pavement = Mesh::from_cuboid([x, y, -0.1], [x + BLOCK[0], y + BLOCK[1], 0.0]);
    parts.add("pavement", pavement);
    for lot in 0..LOTS_ALONG {
        for (row, middle) in ROWS.into_iter().enumerate() {
            let house_x = x + LOT_WIDTH * (0.5 + f64::from(lot)) + random.between(-1.5, 1.5);
            let house_y = y + middle + random.between(-1.0, 1.0);
            // The second row is rotated by half a turn, so that both rows face a street.
            let facing = if row == 0 { 0 } else { 2 };
            let pose = Pose::quarters(facing, DVec3::new(house_x, house_y, 0.0));
            let tag = format!("b{block_x}_{block_y}h{lot}{row}");
            let mut place = |name: String, mesh: Mesh| {
                let centred = mesh.moved(DVec3::new(-WIDTH / 2.0, -DEPTH / 2.0, 0.0));
                parts.add(format!("{tag}/{name}"), centred.placed(&pose));
            };
            house(random, &mut Parts::new(&mut place));
        }
    }
}

/// Makes a house with its south-western corner at the origin and its front towards -y, in metres.
fn house(random: &mut Random, parts: &mut Parts<'_>) {
    for storey in 0..STOREYS {
        let z = f64::from(storey) * (ROOM_HEIGHT + SLAB);
        walls(storey, z, parts);
        rooms(random, storey, z, parts);
    }
    roof(random, f64::from(STOREYS) * (ROOM_HEIGHT + SLAB), parts);
}

/// Adds to a house the slab of a storey, its four outer walls and its two inner walls. `z` is the height of
/// the storey's floor in metres.
fn walls(storey: u32, z: f64, parts: &mut Parts<'_>) {
    let slab = Mesh::from_cuboid([0.0, 0.0, z - SLAB], [WIDTH, DEPTH, z]);
    parts.add(format!("slab{storey}"), slab);

    let window = |from: f64| Opening::new(from, from + 1.2, 0.9, 2.1);
    let wide_wall = [window(1.5), window(7.3)];
    let deep_wall = [window(1.6), window(6.2)];
    let mut street_front = wide_wall.to_vec();
    if storey == 0 {
        street_front.push(Opening::new(4.6, 5.6, 0.0, 2.1));
    }
    let wall = |from: [f64; 2], to: [f64; 2], thickness: f64| Wall {
        from,
        to,
        foot: z,
        top: z + ROOM_HEIGHT,
        thickness,
    };
    let outer = [
        ('S', [0.0, 0.0], [WIDTH, 0.0], &street_front[..]),
        ('N', [0.0, DEPTH], [WIDTH, DEPTH], &wide_wall),
        ('W', [0.0, 0.0], [0.0, DEPTH], &deep_wall),
        ('E', [WIDTH, 0.0], [WIDTH, DEPTH], &deep_wall),
    ];
    for (side, from, to, openings) in outer {
        let mesh = wall(from, to, OUTER_WALL).build(openings);
        parts.add(format!("wall{storey}{side}"), mesh);
    }

    let inner_door = |from: f64| Opening::new(from, from + 0.9, 0.0, 2.1);
    let across = wall([0.0, CROSS[1]], [WIDTH, CROSS[1]], INNER_WALL);
    parts.add("part", across.build(&[inner_door(1.5), inner_door(7.6)]));
    let along = wall([CROSS[0], 0.0], [CROSS[0], DEPTH], INNER_WALL);
    parts.add("part", along.build(&[inner_door(2.0), inner_door(6.4)]));
}

/// Adds the furniture of the four rooms of a storey whose floor is at height `z` metres.
fn rooms(random: &mut Random, storey: u32, z: f64, parts: &mut Parts<'_>) {
    use RoomKind::{Bedroom, Kitchen, Living, Office};
    let kinds =
        if storey == 0 { [Living, Kitchen, Office, Bedroom] } else { [Bedroom, Bedroom, Office, Bedroom] };
    // Minimum and maximum corners between the walls: south-west, south-east, north-west, north-east.
    let floors = [
        ([0.2, 0.2], [5.7, 4.4]),
        ([5.9, 0.2], [9.8, 4.4]),
        ([0.2, 4.6], [5.7, 8.8]),
        ([5.9, 4.6], [9.8, 8.8]),
    ];
    let tag = format!("f{storey}");
    for (kind, (low, high)) in kinds.into_iter().zip(floors) {
        furnish(random, kind, &Floor { low, high, z }, &tag, parts);
    }
}

/// Adds to a house the ceiling, a gabled roof with eaves and a ridge along x, and a chimney north of the
/// ridge. `z` is the height of the roof's foot in metres.
fn roof(random: &mut Random, z: f64, parts: &mut Parts<'_>) {
    /// Horizontal overhang of the roof beyond the walls, in metres.
    const EAVES: f64 = 0.5;
    /// Side of the chimney's square plan, in metres.
    const CHIMNEY: f64 = 0.7;
    let rise = random.between(2.2, 3.4);
    let ceiling = Mesh::from_cuboid([0.0, 0.0, z - SLAB], [WIDTH, DEPTH, z]);
    parts.add("ceil", ceiling);

    let (west, east) = (-EAVES, WIDTH + EAVES);
    let [south_west, south_east, north_east, north_west] = [
        DVec3::new(west, -EAVES, z),
        DVec3::new(east, -EAVES, z),
        DVec3::new(east, DEPTH + EAVES, z),
        DVec3::new(west, DEPTH + EAVES, z),
    ];
    let ridge_west = DVec3::new(west, DEPTH / 2.0, z + rise);
    let ridge_east = DVec3::new(east, DEPTH / 2.0, z + rise);
    let mut gable = Mesh::new();
    gable.quad([south_west, south_east, ridge_east, ridge_west]);
    gable.triangles.extend([
        [north_east, north_west, ridge_west],
        [north_east, ridge_west, ridge_east],
        [north_west, south_west, ridge_west],
        [south_east, north_east, ridge_east],
    ]);
    parts.add("roof", gable);

    let x = random.between(2.0, 8.0);
    let y = DEPTH / 2.0 + 0.6;
    let chimney = Mesh::from_cuboid([x, y, z], [x + CHIMNEY, y + CHIMNEY, z + rise + 0.8]);
    parts.add("chimney", chimney);
}

/// Camera walks through the city, made for 2 by 2 blocks.
const ROUTES: [Route; 3] = [
    Route {
        name: "streets",
        fov_y_degrees: 60.0,
        keys: 40,
        look_ahead: 8.0,
        waypoints: &[
            [3.1, 87.8],
            [13.4, 87.7],
            [15.5, 85.3],
            [15.5, 77.5],
            [15.7, 75.5],
            [15.7, 58.2],
            [4.3, 46.7],
            [3.2, 45.9],
            [83.8, 45.9],
        ],
    },
    Route {
        name: "through the front door and the four ground-floor rooms of house b0_0h00",
        fov_y_degrees: 75.0,
        keys: 48,
        look_ahead: 1.6,
        waypoints: &[
            [8.4, -3.8],
            [8.4, 4.8],
            [8.2, 6.3],
            [7.8, 7.1],
            [7.6, 8.2],
            [7.0, 8.8],
            [5.4, 9.0],
            [5.3, 10.0],
            [5.6, 10.5],
            [8.0, 11.7],
            [9.5, 11.7],
            [10.4, 12.1],
            [11.3, 12.2],
            [11.9, 11.8],
            [12.2, 11.4],
            [11.9, 11.9],
            [11.3, 12.2],
            [10.5, 12.2],
            [9.6, 11.7],
            [8.0, 11.7],
            [6.4, 10.8],
            [5.7, 10.2],
            [5.4, 9.3],
            [5.8, 8.9],
            [6.9, 8.8],
            [7.4, 8.4],
            [8.0, 7.4],
            [8.4, 7.1],
            [9.4, 7.1],
            [10.8, 6.3],
            [11.9, 6.5],
            [12.2, 7.2],
        ],
    },
    Route {
        name: "front to back gardens",
        fov_y_degrees: 60.0,
        keys: 32,
        look_ahead: 6.0,
        waypoints: &[
            [45.05, 4.47],
            [46.53, 6.12],
            [46.51, 13.14],
            [41.85, 17.85],
            [39.69, 18.18],
            [38.15, 19.72],
            [23.53, 20.03],
            [17.34, 26.15],
            [17.34, 37.33],
            [23.81, 43.83],
        ],
    },
];
