//! Town recipe: a walled town of the 16th century with rings of gabled, jettied timber houses around a church
//! on a square.
//!
//! The town stands in for the town of the paper on exact from-region visibility. Its detailed houses stand
//! wall to wall along curved streets, where few houses are visible at once.

use super::limits::Limits;
use super::mesh::{Cylinder, Mesh, Parts, Pose};
use super::random::Random;
use super::scene::{Route, scene};
use crate::error::SourceError;
use crate::source::SceneSource;
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Seed of the town's random numbers. Another seed gives another town.
const SEED: u64 = 3;

/// Radius of the market square around the origin, in metres.
const SQUARE_RADIUS: f64 = 28.0;
/// Distance from one ring of houses to the next, in metres.
const RING_STEP: f64 = 26.0;
/// Distances of the centre lines of a ring's two rows of houses from the inner edge of the ring, in metres.
/// The rows stand back to back.
const ROWS: [f64; 2] = [6.0, 16.5];
/// Half of the width of a radial lane, in metres.
const LANE_HALF_WIDTH: f64 = 1.75;

/// Linear coefficient of the upper estimate of the town's triangles: this number per ring.
const TRIANGLES_PER_RING: u64 = 45_000;
/// Quadratic coefficient of the upper estimate of the town's triangles: this number per square of the number
/// of rings.
const TRIANGLES_PER_RING_SQUARED: u64 = 15_000;
/// Number of rings at which the estimate of triangles stops growing. The estimate is then far above the
/// permitted maximum, and its arithmetic cannot overflow.
const MOST_RINGS: u32 = 1_000;

/// Makes the town with `rings` rings of houses. The objects go to `parts`, and the scene is returned without
/// them.
///
/// 3 rings are 698 objects with 190,400 triangles; 8 rings are 1,027,034 triangles.
///
/// # Errors
///
/// Returns [`SourceError::Recipe`] when `rings` is 0 or the scene would have more triangles than recipes may
/// make.
pub(super) fn town(rings: u32, mut parts: Parts<'_>) -> Result<SceneSource, SourceError> {
    let limits = Limits::new(format!("town:{rings}"));
    limits.at_least_one("rings", rings)?;
    let capped = u64::from(rings.min(MOST_RINGS));
    limits.triangles(capped * TRIANGLES_PER_RING + capped * capped * TRIANGLES_PER_RING_SQUARED, 1)?;

    let mut random = Random::new(SEED);
    for ring in 0..rings {
        for row in 0..ROWS.len() {
            row_of_houses(&mut random, ring, row, &mut parts);
        }
    }
    parts.add("church", church());
    town_wall(rings, &mut parts);
    ground(rings, &mut parts);
    Ok(scene("town", 0.1, &ROUTES))
}

/// Returns the inner radius of the ring of houses with index `ring`, in metres. The number of rings as `ring`
/// gives the outer radius of the last ring.
fn ring_radius(ring: u32) -> f64 {
    SQUARE_RADIUS + RING_STEP * f64::from(ring)
}

/// Adds the houses of one row of a ring, side by side around the circle, except where radial lanes cross the
/// row. `ring` counts from the square outwards; `row` is 0 (inner) or 1 (outer).
fn row_of_houses(random: &mut Random, ring: u32, row: usize, parts: &mut Parts<'_>) {
    let radius = ring_radius(ring) + ROWS[row];
    let lanes = f64::from(6 + ring);
    let lane_spacing = TAU * radius / lanes;
    let mut angle = 0.0;
    while angle < TAU - 0.02 {
        let width = random.between(4.5, 8.0);
        let middle = angle + width / radius / 2.0;
        // Position of the house between two lanes, as a fraction from 0 to 1 of their spacing.
        let phase = (middle * lanes / TAU).fract();
        let from_lane = phase.min(1.0 - phase) * lane_spacing;
        if from_lane < LANE_HALF_WIDTH + width / 2.0 {
            angle += 0.3 / radius;
            continue;
        }
        let depth = random.between(8.0, 10.0);
        let house = house(random, width - 0.15, depth);
        let offset = radius + random.between(-0.6, 0.6);
        let at = (DVec2::from_angle(middle) * offset).extend(0.0);
        let pose = Pose::turned(middle + FRAC_PI_2, at);
        parts.add(format!("h{ring}_{row}"), house.placed(&pose));
        angle += width / radius;
    }
}

/// Makes a house with the centre of its plan at the origin: a plain ground floor, one or two jettied storeys
/// of timber framing, and a gabled roof. `width` is along x and `ground_depth` along y, in metres; the front
/// faces -y.
fn house(random: &mut Random, width: f64, ground_depth: f64) -> Mesh {
    /// Growth of the depth from one storey to the next, in metres; half of it overhangs at the front and half
    /// at the back.
    const JETTY: f64 = 0.6;
    let ground_height = random.between(2.4, 3.0);
    let storey_height = random.between(2.3, 2.8);
    let storeys = 1 + random.below(2);
    let half_width = width / 2.0;
    let mut mesh = Mesh::from_cuboid(
        [-half_width, -ground_depth / 2.0, 0.0],
        [half_width, ground_depth / 2.0, ground_height],
    );
    let mut z = ground_height;
    let mut depth = ground_depth;
    for _ in 0..storeys {
        depth += JETTY;
        mesh.cuboid([-half_width, -depth / 2.0, z], [half_width, depth / 2.0, z + storey_height]);
        for side in [-1.0, 1.0] {
            timber_front(&mut mesh, width, [z, z + storey_height], side, depth / 2.0);
        }
        z += storey_height;
    }
    let rise = random.between(0.8, 1.1) * width / 2.0;
    house_roof(&mut mesh, half_width, depth / 2.0, z, rise);
    mesh
}

/// Adds the timber of one wall of a storey: posts, two rails, and the windows between the posts. The wall is
/// at y = `side` * `half_depth` with `side` -1 (front) or 1 (back), and reaches from height `foot` to `top`,
/// in metres.
fn timber_front(mesh: &mut Mesh, width: f64, [foot, top]: [f64; 2], side: f64, half_depth: f64) {
    /// Intended distance between neighbouring posts, in metres; the actual distance divides the width evenly.
    const BAY: f64 = 1.1;
    /// Minimum number of bays of a front; a bay is the space between two neighbouring posts.
    const FEWEST_BAYS: usize = 3;
    /// Height of a horizontal rail at the foot or the top of a storey, in metres.
    const RAIL: f64 = 0.2;
    let y = side * half_depth;
    let half_width = width / 2.0;
    let bays = FEWEST_BAYS.max((width / BAY) as usize);
    let along = |bay: f64| -half_width + width * bay / bays as f64;
    for post in 0..=bays {
        let x = along(post as f64);
        mesh.cuboid([x - 0.09, y - 0.06, foot], [x + 0.09, y + 0.06, top]);
    }
    for (low, high) in [(foot, foot + RAIL), (top - RAIL, top)] {
        mesh.cuboid([-half_width, y - 0.06, low], [half_width, y + 0.06, high]);
    }
    // Panes are centred 4 cm inside the wall's outer face.
    let pane = y - 0.04 * side;
    for bay in 0..bays {
        let x = along(bay as f64 + 0.5);
        mesh.cuboid([x - 0.28, pane - 0.05, foot + 0.9], [x + 0.28, pane + 0.05, foot + 1.9]);
    }
}

/// Adds a gabled roof whose ridge runs along y, and a chimney. `half_width` and `half_depth` are half the
/// sizes of the walls below, `z` is the height of the eaves and `rise` that of the ridge above the eaves, in
/// metres.
fn house_roof(mesh: &mut Mesh, half_width: f64, half_depth: f64, z: f64, rise: f64) {
    /// Horizontal overhang of the roof beyond the walls, in metres.
    const EAVES: f64 = 0.4;
    let (x, y) = (half_width + EAVES, half_depth + EAVES);
    let front_left = DVec3::new(-x, -y, z);
    let front_right = DVec3::new(x, -y, z);
    let back_right = DVec3::new(x, y, z);
    let back_left = DVec3::new(-x, y, z);
    let ridge_front = DVec3::new(0.0, -y, z + rise);
    let ridge_back = DVec3::new(0.0, y, z + rise);
    mesh.quad([front_left, ridge_front, ridge_back, back_left]);
    mesh.quad([front_right, back_right, ridge_back, ridge_front]);
    mesh.triangles.extend([[front_left, front_right, ridge_front], [back_right, back_left, ridge_back]]);
    let x = half_width / 2.0;
    mesh.cuboid([x - 0.3, -0.3, z], [x + 0.3, 0.3, z + rise + 0.7]);
}

/// Makes the church in the middle of the square, in metres: nave, tower, spire and buttresses, with the
/// nave's axis along y.
fn church() -> Mesh {
    /// Height of the nave's eaves above the ground, in metres.
    const EAVES: f64 = 11.0;
    /// Height of the nave's ridge above the ground, in metres.
    const RIDGE: f64 = 19.0;
    /// Height of the church tower without its spire, in metres.
    const TOWER_TOP: f64 = 28.0;
    /// Coordinate y of the nave's southern end, in metres.
    const SOUTH: f64 = -14.0;
    /// Coordinate y of the nave's northern end, in metres.
    const NORTH: f64 = 12.0;
    let mut mesh = Mesh::from_cuboid([-6.0, SOUTH, 0.0], [6.0, NORTH, EAVES]);
    mesh.cuboid([-4.5, -23.0, 0.0], [4.5, SOUTH, TOWER_TOP]);

    let eave = |side: f64, y: f64| DVec3::new(side * 6.5, y, EAVES);
    let ridge = |y: f64| DVec3::new(0.0, y, RIDGE);
    mesh.quad([eave(-1.0, SOUTH), ridge(SOUTH), ridge(NORTH), eave(-1.0, NORTH)]);
    mesh.triangles.extend([
        [eave(1.0, SOUTH), ridge(NORTH), ridge(SOUTH)],
        [eave(1.0, SOUTH), eave(1.0, NORTH), ridge(NORTH)],
    ]);

    mesh.cylinder(&Cylinder {
        centre: DVec2::new(0.0, -18.5),
        bottom: TOWER_TOP,
        top: 46.0,
        bottom_radius: 6.3,
        top_radius: 0.0,
        sides: 4,
    });
    for side in [-6.0, 6.0] {
        for buttress in 0..6 {
            let y = -12.0 + 4.0 * f64::from(buttress);
            mesh.cuboid([side - 0.6, y, 0.0], [side + 0.6, y + 1.0, 8.0]);
        }
    }
    mesh
}

/// Adds the town wall: a regular polygon with a tower at every corner and three open sides as gates.
fn town_wall(rings: u32, parts: &mut Parts<'_>) {
    const GATES: u32 = 3;
    let radius = ring_radius(rings) + 4.0;
    let corners = 6 * (4 + rings);
    let corner = |i: u32| DVec2::from_angle(TAU * f64::from(i) / f64::from(corners)) * radius;
    for i in 0..corners {
        let (from, to) = (corner(i), corner(i + 1));
        // A side with a gate stays open.
        if i % (corners / GATES) != 0 {
            let along = to - from;
            let pose = Pose::turned(along.to_angle(), from.extend(0.0));
            parts.add("wall", wall_side(along.length()).placed(&pose));
        }
        parts.add("tower", wall_tower(from));
    }
}

/// Makes one side of the town wall along x, from the origin to `length` metres, with merlons on its outer
/// edge.
fn wall_side(length: f64) -> Mesh {
    /// Half of the town wall's thickness, in metres.
    const HALF_THICKNESS: f64 = 0.8;
    /// Height of the town wall without its merlons, in metres.
    const WALK: f64 = 6.0;
    let mut mesh = Mesh::from_cuboid([0.0, -HALF_THICKNESS, 0.0], [length, HALF_THICKNESS, WALK]);
    for merlon in 0..(length / 2.0) as u32 {
        let x = f64::from(merlon) * 2.0;
        mesh.cuboid([x, -HALF_THICKNESS, WALK], [x + 1.0, -0.5, WALK + 0.9]);
    }
    mesh
}

/// Makes a round tower with a conical roof around `centre` on the plan.
fn wall_tower(centre: DVec2) -> Mesh {
    let part = |bottom, top, bottom_radius, top_radius| Cylinder {
        centre,
        bottom,
        top,
        bottom_radius,
        top_radius,
        sides: 12,
    };
    let mut mesh = Mesh::new();
    mesh.cylinder(&part(0.0, 9.0, 3.0, 3.0));
    mesh.cylinder(&part(9.0, 13.0, 3.5, 0.0));
    mesh
}

/// Adds level ground at z = 0 in 16 by 16 square tiles, one object each, to 30 m outside the town wall.
fn ground(rings: u32, parts: &mut Parts<'_>) {
    const TILES: u32 = 16;
    let half = ring_radius(rings) + 4.0 + 30.0;
    let tile = 2.0 * half / f64::from(TILES);
    for i in 0..TILES {
        for j in 0..TILES {
            let low = DVec2::new(f64::from(i), f64::from(j)) * tile - half;
            let at = |x: f64, y: f64| DVec3::new(low.x + x * tile, low.y + y * tile, 0.0);
            let mut mesh = Mesh::new();
            mesh.quad([at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)]);
            parts.add("ground", mesh);
        }
    }
}

/// Camera walks through the town, made for three rings.
const ROUTES: [Route; 3] = [
    Route {
        name: "gate to market square",
        fov_y_degrees: 60.0,
        keys: 36,
        look_ahead: 6.0,
        waypoints: &[
            [113.5, 9.0],
            [110.9, 8.7],
            [101.1, -0.9],
            [61.1, -0.9],
            [60.7, -0.4],
            [39.5, -1.0],
            [37.4, -0.1],
            [28.0, 0.0],
            [15.2, 12.7],
            [13.6, 16.1],
            [10.2, 19.8],
        ],
    },
    Route {
        name: "ring street",
        fov_y_degrees: 70.0,
        keys: 48,
        look_ahead: 5.0,
        waypoints: &[
            [19.9, -20.1],
            [14.8, -23.9],
            [15.1, -32.2],
            [24.6, -42.0],
            [31.0, -42.7],
            [38.7, -36.4],
            [37.5, -38.1],
            [26.6, -44.9],
            [23.8, -44.8],
            [18.4, -49.0],
            [11.0, -51.7],
            [-9.6, -51.7],
            [-12.7, -55.6],
            [-13.4, -62.3],
            [-11.7, -64.7],
            [-0.2, -65.5],
            [-10.2, -65.1],
            [-13.3, -63.1],
            [-12.8, -53.3],
            [-24.7, -44.8],
            [-30.6, -42.7],
            [-42.3, -31.0],
            [-49.3, -19.1],
            [-49.0, -16.1],
            [-52.6, -3.1],
            [-54.7, 0.0],
        ],
    },
    Route {
        name: "lanes to the wall",
        fov_y_degrees: 65.0,
        keys: 40,
        look_ahead: 5.0,
        waypoints: &[
            [-20.0, 17.7],
            [-20.1, 9.4],
            [-29.5, 0.2],
            [-42.4, 1.0],
            [-49.4, 6.7],
            [-49.8, 23.9],
            [-66.4, 33.1],
            [-68.2, 36.7],
            [-65.9, 42.8],
            [-58.1, 52.4],
            [-57.9, 57.6],
            [-69.8, 70.7],
            [-75.8, 70.7],
            [-88.8, 58.3],
            [-61.8, 85.3],
            [-62.1, 96.2],
            [-60.2, 100.0],
        ],
    },
];
