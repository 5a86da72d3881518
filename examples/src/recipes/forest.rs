//! Forest recipe: eight kinds of trees of exactly 1,000 triangles each on hilly terrain, at random positions
//! of even density.
//!
//! The forest stands in for the forests of the papers on extended projections, exact from-region visibility
//! and the visible zone. A single tree occludes little; many trees together do, which exercises occluder
//! fusion.

use super::limits::Limits;
use super::mesh::{Mesh, Parts, Pose, around, circle};
use super::random::Random;
use super::scene::{Route, scene_on};
use crate::error::SourceError;
use crate::source::SceneSource;
use glam::{DVec2, DVec3};

/// Seed of the forest's random numbers. Another seed gives another forest.
const SEED: u64 = 4;
/// Number of distinct tree meshes. Every tree of the forest is a rotated and scaled copy of one of these
/// meshes.
const KINDS: usize = 8;
/// Side of a square terrain tile, in metres.
const TILE: f64 = 20.0;
/// Number of quadrilaterals along each side of a terrain tile.
const TILE_CELLS: usize = 8;

/// Number of triangles of one tree, of whatever kind.
const TRIANGLES_PER_TREE: u64 = 1_000;
/// Number of triangles of one terrain tile: two per quadrilateral.
const TRIANGLES_PER_TILE: u64 = 2 * (TILE_CELLS * TILE_CELLS) as u64;
/// Maximum number of trees. Placing a tree measures its distance to every tree placed before, so the time
/// grows with the square of the number of trees.
const MOST_TREES: u32 = 20_000;

/// Makes a forest of `trees` trees on a square whose side is `side` metres. The objects go to `parts`, and
/// the scene is returned without them.
///
/// 200 trees on 84 m are 216 objects with 202,048 triangles; 1,450 trees on 226 m and 7,750 trees on 523 m
/// have about the same density. The time to place the trees grows with the square of their number.
///
/// # Errors
///
/// Returns [`SourceError::Recipe`] when `trees` is 0 or above 20,000, when `side` is NaN or outside 20 to
/// 100,000 metres (both inclusive), or when the scene would have more triangles than recipes may make.
pub(super) fn forest(trees: u32, side: f64, mut parts: Parts<'_>) -> Result<SceneSource, SourceError> {
    let spec = format!("forest:{trees},{side}");
    let limits = Limits::new(spec.clone());
    limits.at_least_one("trees", trees)?;
    if trees > MOST_TREES {
        return Err(SourceError::recipe(spec, format!("at most {MOST_TREES} trees can be placed")));
    }
    // The negated range check refuses NaN, too.
    if !(TILE..=1e5).contains(&side) {
        return Err(SourceError::recipe(spec, format!("the side must be from {TILE} to 100000 metres")));
    }
    let tiles = (side / TILE) as u32;
    limits
        .triangles(u64::from(trees) * TRIANGLES_PER_TREE + u64::from(tiles).pow(2) * TRIANGLES_PER_TILE, 1)?;

    let mut random = Random::new(SEED);
    let kinds: Vec<Mesh> = (0..KINDS).map(|_| tree(&mut random)).collect();
    let mut placed: Vec<DVec2> = Vec::with_capacity(trees as usize);
    for _ in 0..trees {
        let spot = spot_far_from(&placed, side, &mut random);
        placed.push(spot);
        let kind = &kinds[random.below(KINDS)];
        let size = random.between(0.8, 1.25);
        let heading = random.angle();
        // The root is 0.1 m below the ground, so that no trunk floats above a slope.
        let root = spot.extend(height(spot.x, spot.y) - 0.1);
        let mesh = kind.clone().scaled(size).placed(&Pose::turned(heading, root));
        parts.add("tree", mesh);
    }
    for tile_x in 0..tiles {
        for tile_y in 0..tiles {
            let corner = DVec2::new(f64::from(tile_x), f64::from(tile_y)) * TILE;
            parts.add("terrain", terrain(corner));
        }
    }
    Ok(scene_on("forest", 0.1, &ROUTES, height))
}

/// Returns the height of the ground in metres at the point (`x`, `y`) in metres: the sum of three sine waves,
/// between -10 and 10 m.
fn height(x: f64, y: f64) -> f64 {
    /// Bound on the absolute height of the ground, in metres.
    const AMPLITUDE: f64 = 10.0;
    let hills = (x / 61.0 + 0.3).sin() * (y / 47.0).cos();
    let smaller = (x / 23.0 + 1.0).sin() * (y / 19.0 + 2.0).sin();
    let bumps = ((x + y) / 7.0).sin();
    AMPLITUDE * (0.6 * hills + 0.3 * smaller + 0.1 * bumps)
}

/// Returns the best of six random points in the square from 0 to `side` metres: the candidate whose distance
/// to its nearest point of `placed` is greatest. The first candidate wins when `placed` is empty and on ties.
fn spot_far_from(placed: &[DVec2], side: f64, random: &mut Random) -> DVec2 {
    const CANDIDATES: usize = 6;
    let mut best = DVec2::ZERO;
    let mut best_distance = f64::NEG_INFINITY;
    for _ in 0..CANDIDATES {
        let x = random.unit() * side;
        let y = random.unit() * side;
        let candidate = DVec2::new(x, y);
        let nearest =
            placed.iter().map(|tree| tree.distance_squared(candidate)).fold(f64::INFINITY, f64::min);
        if nearest > best_distance {
            best = candidate;
            best_distance = nearest;
        }
    }
    best
}

/// Makes a tree of random shape with its root at the origin and z up, in metres. It has exactly 1,000
/// triangles: 48 of trunk, 60 of branches and 892 of leaves.
fn tree(random: &mut Random) -> Mesh {
    let tall = random.between(9.0, 14.0);
    let mut mesh = Mesh::new();
    trunk(&mut mesh, tall);
    for branch_number in 0..6 {
        branch(&mut mesh, tall, branch_number, random);
    }
    leaves(&mut mesh, tall, random);
    mesh
}

/// Adds a tapering trunk for a tree of height `tall` metres: three bands of eight sides, 48 triangles.
fn trunk(mesh: &mut Mesh, tall: f64) {
    const SIDES: usize = 8;
    let radii = [0.32, 0.26, 0.18, 0.08];
    let heights = [0.0, tall * 0.25, tall * 0.55, tall * 0.9];
    let ring =
        |i: usize| -> Vec<DVec3> { circle(SIDES).map(|unit| (unit * radii[i]).extend(heights[i])).collect() };
    for i in 0..radii.len() - 1 {
        mesh.band(&ring(i), &ring(i + 1), false);
    }
}

/// Adds a branch of a tree of height `tall` metres: a five-sided cone with a base, 10 triangles, that rises
/// outwards from the trunk. `number` is the branch's index, which determines its heading.
fn branch(mesh: &mut Mesh, tall: f64, number: u32, random: &mut Random) {
    const SIDES: usize = 5;
    /// Radius of a branch at its base, in metres.
    const RADIUS: f64 = 0.09;
    /// Heading between consecutive branches, in radians: nearly the golden angle, so that no branch is above
    /// another.
    const HEADING_STEP: f64 = 2.4;
    let heading = f64::from(number) * HEADING_STEP + random.between(-0.3, 0.3);
    let root = DVec3::new(0.0, 0.0, tall * random.between(0.35, 0.6));
    let length = tall * random.between(0.2, 0.32);
    let direction = (DVec2::from_angle(heading) * 0.8).extend(0.6);
    let tip = root + direction * length;
    let side = direction.cross(DVec3::Z).normalize();
    let other = side.cross(direction).normalize();
    let ring: Vec<_> = circle(SIDES).map(|unit| root + (side * unit.x + other * unit.y) * RADIUS).collect();
    mesh.band(&ring, &[tip; SIDES], true);
    mesh.triangles.extend(around(SIDES).map(|(i, next)| [root, ring[next], ring[i]]));
}

/// Adds the crown of a tree of height `tall` metres: 446 quadrilaterals of random size and orientation inside
/// an ellipsoid, 892 triangles.
fn leaves(mesh: &mut Mesh, tall: f64, random: &mut Random) {
    const LEAVES: usize = 446;
    let crown_radius = tall * 0.28;
    let crown_centre = DVec3::new(0.0, 0.0, tall * 0.68);
    for _ in 0..LEAVES {
        let heading = random.angle();
        let slope = (1.0 - 2.0 * random.unit()).acos();
        // The cube root makes the leaves' density uniform over the volume.
        let radius = crown_radius * random.unit().powf(1.0 / 3.0);
        let level = DVec2::from_angle(heading) * (radius * slope.sin());
        let centre = crown_centre + level.extend(radius * 1.15 * slope.cos());

        let turn = random.angle();
        let size = random.between(0.25, 0.5);
        let along = DVec3::new(turn.cos(), turn.sin(), random.between(-0.4, 0.4)) * size;
        let across_x = -turn.sin() * random.between(0.3, 1.0);
        let across = DVec3::new(across_x, turn.cos(), random.between(0.2, 1.0)) * size;
        mesh.quad([
            centre - along - across,
            centre + along - across,
            centre + along + across,
            centre - along + across,
        ]);
    }
}

/// Makes the terrain tile whose minimum corner is `corner`, in metres. The triangles below the diagonals of
/// all quadrilaterals come first, then the triangles above the diagonals.
fn terrain(corner: DVec2) -> Mesh {
    let cell = TILE / TILE_CELLS as f64;
    let point = |i: usize, j: usize| {
        let p = corner + DVec2::new(i as f64, j as f64) * cell;
        p.extend(height(p.x, p.y))
    };
    let cells = || (0..TILE_CELLS).flat_map(|i| (0..TILE_CELLS).map(move |j| (i, j)));
    let lower = cells().map(|(i, j)| [point(i, j), point(i + 1, j), point(i + 1, j + 1)]);
    let upper = cells().map(|(i, j)| [point(i, j), point(i + 1, j + 1), point(i, j + 1)]);
    Mesh { triangles: lower.chain(upper).collect() }
}

/// Camera walks through the forest, made for a square with a side of 84 m.
const ROUTES: [Route; 3] = [
    Route {
        name: "diagonal walk",
        fov_y_degrees: 60.0,
        keys: 36,
        look_ahead: 6.0,
        waypoints: &[
            [4.4, 4.2],
            [8.6, 4.3],
            [25.8, 21.4],
            [28.1, 25.5],
            [28.8, 27.8],
            [33.8, 33.1],
            [34.8, 35.4],
            [34.6, 37.9],
            [39.7, 43.9],
            [42.7, 45.7],
            [43.1, 45.5],
            [46.4, 48.8],
            [48.1, 49.3],
            [62.3, 63.5],
            [63.7, 64.1],
            [73.2, 73.6],
            [76.0, 76.1],
        ],
    },
    Route {
        name: "counter diagonal",
        fov_y_degrees: 65.0,
        keys: 36,
        look_ahead: 6.0,
        waypoints: &[
            [10.2, 70.1],
            [10.4, 68.0],
            [14.1, 64.3],
            [15.5, 60.4],
            [15.3, 58.0],
            [16.7, 52.9],
            [25.2, 44.4],
            [26.5, 43.9],
            [37.6, 32.8],
            [42.7, 27.2],
            [45.3, 26.7],
            [59.4, 12.7],
            [64.4, 12.6],
            [65.9, 11.4],
            [68.4, 10.8],
            [68.5, 10.9],
            [70.1, 10.3],
        ],
    },
    Route {
        name: "loop in the middle",
        fov_y_degrees: 70.0,
        keys: 48,
        look_ahead: 6.0,
        waypoints: &[
            [40.07, 40.2],
            [39.07, 39.91],
            [34.78, 35.5],
            [34.15, 34.07],
            [26.3, 26.5],
            [24.61, 26.23],
            [21.06, 22.61],
            [20.48, 20.31],
            [20.46, 20.41],
            [25.63, 18.3],
            [26.34, 18.59],
            [41.27, 18.64],
            [42.55, 19.38],
            [59.6, 19.46],
            [61.89, 20.66],
            [64.33, 23.34],
            [64.7, 33.81],
            [63.41, 38.62],
            [63.37, 54.58],
            [58.91, 59.9],
            [59.26, 59.8],
            [53.76, 59.8],
            [52.31, 60.58],
            [48.1, 60.61],
            [46.61, 61.4],
            [38.19, 61.4],
            [35.21, 60.4],
            [24.39, 61.1],
            [20.24, 60.3],
        ],
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tree_has_exactly_a_thousand_triangles() {
        assert_eq!(tree(&mut Random::new(9)).triangles.len(), 1_000, "triangles of a tree");
    }
}
