//! Furniture meshes of the recipes. Each piece has its origin on the floor at the centre of its plan, z up
//! and its front towards +y.
//!
//! All lengths are metres. The number of triangles of each piece is part of the recipes that use the piece,
//! and is stated in its comment.

use super::mesh::{Cylinder, Mesh};
use super::random::Random;
use glam::{DVec2, DVec3};

/// Signs of the (x, y) offsets of the four legs, in the order in which the legs are added to a mesh.
const LEG_SIDES: [(f64, f64); 4] = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)];

/// Adds four upright legs of square cross-section, 48 triangles: leg centres at (±`x`, ±`y`) metres, `half`
/// metres to each side, from the floor at z = 0 up to `height` metres.
fn legs(mesh: &mut Mesh, (x, y): (f64, f64), half: f64, height: f64) {
    for (side_x, side_y) in LEG_SIDES {
        let (cx, cy) = (side_x * x, side_y * y);
        mesh.cuboid([cx - half, cy - half, 0.0], [cx + half, cy + half, height]);
    }
}

/// Describes a cylinder or cone frustum around the z axis. Heights and radii are in metres.
fn on_axis(bottom: f64, top: f64, bottom_radius: f64, top_radius: f64, sides: usize) -> Cylinder {
    Cylinder { centre: DVec2::ZERO, bottom, top, bottom_radius, top_radius, sides }
}

/// Makes a table top on four legs: 60 triangles. `width` is along x, `depth` along y and `height` that of the
/// upper surface, in metres.
pub(crate) fn table(width: f64, depth: f64, height: f64) -> Mesh {
    const TOP: f64 = 0.04;
    let (x, y) = (width / 2.0, depth / 2.0);
    let mut mesh = Mesh::from_cuboid([-x, -y, height - TOP], [x, y, height]);
    legs(&mut mesh, (x - 0.1, y - 0.1), 0.03, height - TOP);
    mesh
}

/// Makes a dining table, 1.4 by 0.8 m and 0.74 m high, with its origin on the floor at its centre: 60
/// triangles.
pub(crate) fn dining_table() -> Mesh {
    table(1.4, 0.8, 0.74)
}

/// Makes the low table in front of a sofa, 1.2 by 0.6 m and 0.45 m high, with its origin on the floor at its
/// centre: 60 triangles.
pub(crate) fn coffee_table() -> Mesh {
    table(1.2, 0.6, 0.45)
}

/// Makes a chair of seat, back and four legs, 0.95 m high, with its origin on the floor and its front towards
/// +y: 72 triangles.
pub(crate) fn chair() -> Mesh {
    const SEAT: f64 = 0.43;
    let mut mesh = Mesh::from_cuboid([-0.22, -0.22, SEAT], [0.22, 0.22, 0.47]);
    mesh.cuboid([-0.22, -0.24, 0.47], [0.22, -0.2, 0.95]);
    legs(&mut mesh, (0.19, 0.19), 0.02, SEAT);
    mesh
}

/// Makes a sofa of base, back, two arms and two cushions, 1.9 m wide, with its origin on the floor and its
/// front towards +y: 72 triangles.
pub(crate) fn sofa() -> Mesh {
    const SEAT: f64 = 0.42;
    let mut mesh = Mesh::from_cuboid([-0.95, -0.45, 0.1], [0.95, 0.45, SEAT]);
    mesh.cuboid([-0.95, -0.45, SEAT], [0.95, -0.2, 0.85]);
    mesh.cuboid([-0.95, -0.45, SEAT], [-0.78, 0.45, 0.62]);
    mesh.cuboid([0.78, -0.45, SEAT], [0.95, 0.45, 0.62]);
    mesh.cuboid([-0.7, -0.2, SEAT], [0.0, 0.4, 0.52]);
    mesh.cuboid([0.0, -0.2, SEAT], [0.7, 0.4, 0.52]);
    mesh
}

/// Makes a bed of frame, mattress, pillow, headboard and four legs, 2 m long, with its origin on the floor
/// and its headboard towards -y: 96 triangles.
pub(crate) fn bed() -> Mesh {
    const FRAME: f64 = 0.2;
    let mut mesh = Mesh::from_cuboid([-0.7, -1.0, FRAME], [0.7, 1.0, 0.35]);
    mesh.cuboid([-0.68, -0.98, 0.35], [0.68, 0.95, 0.55]);
    mesh.cuboid([-0.5, -0.95, 0.55], [0.5, -0.6, 0.65]);
    mesh.cuboid([-0.72, -1.05, 0.0], [0.72, -1.0, 1.0]);
    legs(&mut mesh, (0.65, 0.92), 0.04, FRAME);
    mesh
}

/// Makes a shelf, 1.9 m high, with its origin on the floor and its front towards +y. It has two sides, a
/// back, five boards, and six books of random size on each of the lower four boards: 384 triangles.
pub(crate) fn shelf(random: &mut Random) -> Mesh {
    const BOARDS: usize = 5;
    const BOOKS: usize = 6;
    const BOARD_STEP: f64 = 0.45;
    const BOARD_TOP: f64 = 0.08;
    let mut mesh = Mesh::from_cuboid([-0.45, -0.15, 0.0], [-0.43, 0.15, 1.9]);
    mesh.cuboid([0.43, -0.15, 0.0], [0.45, 0.15, 1.9]);
    mesh.cuboid([-0.45, -0.16, 0.0], [0.45, -0.15, 1.9]);
    for board in 0..BOARDS {
        let z = BOARD_STEP * board as f64;
        mesh.cuboid([-0.43, -0.15, z + 0.05], [0.43, 0.15, z + BOARD_TOP]);
    }
    // The fifth board is the top of the shelf and stays empty.
    for board in 0..BOARDS - 1 {
        let z = BOARD_TOP + BOARD_STEP * board as f64;
        let mut x = -0.42;
        for _ in 0..BOOKS {
            let width = random.between(0.03, 0.12);
            let height = random.between(0.2, 0.34);
            mesh.cuboid([x, -0.13, z], [x + width, 0.08, z + height]);
            x += width + 0.01;
        }
    }
    mesh
}

/// Makes a cupboard of a carcass, two doors and two handles: 60 triangles. `width` is along x, in metres;
/// `height` starts at the floor.
pub(crate) fn cupboard(width: f64, height: f64) -> Mesh {
    let x = width / 2.0;
    let (door_foot, door_top) = (0.05, height - 0.05);
    let (handle_foot, handle_top) = (height / 2.0 - 0.08, height / 2.0 + 0.08);
    let mut mesh = Mesh::from_cuboid([-x, -0.3, 0.0], [x, 0.27, height]);
    mesh.cuboid([-x + 0.01, 0.27, door_foot], [-0.01, 0.29, door_top]);
    mesh.cuboid([0.01, 0.27, door_foot], [x - 0.01, 0.29, door_top]);
    mesh.cuboid([-0.04, 0.29, handle_foot], [-0.02, 0.32, handle_top]);
    mesh.cuboid([0.02, 0.29, handle_foot], [0.04, 0.32, handle_top]);
    mesh
}

/// Makes a standing lamp of foot, pole and shade, 1.65 m high, with its origin on the floor: 104 triangles.
pub(crate) fn lamp() -> Mesh {
    let mut mesh = Mesh::new();
    mesh.cylinder(&on_axis(0.0, 0.04, 0.15, 0.15, 10));
    mesh.cylinder(&on_axis(0.04, 1.4, 0.015, 0.015, 6));
    mesh.cylinder(&on_axis(1.35, 1.65, 0.2, 0.1, 10));
    mesh
}

/// Makes a desk, 1.6 m wide and 0.74 m high, with its origin on the floor. It has a top, two sides, and a
/// block of drawers with three fronts towards +y: 84 triangles.
pub(crate) fn desk() -> Mesh {
    const DRAWERS: usize = 3;
    let mut mesh = Mesh::from_cuboid([-0.8, -0.4, 0.7], [0.8, 0.4, 0.74]);
    mesh.cuboid([-0.8, -0.4, 0.0], [-0.76, 0.4, 0.7]);
    mesh.cuboid([0.76, -0.4, 0.0], [0.8, 0.4, 0.7]);
    mesh.cuboid([0.3, -0.38, 0.1], [0.75, 0.38, 0.68]);
    for drawer in 0..DRAWERS {
        let z = 0.19 * drawer as f64;
        mesh.cuboid([0.32, 0.38, z + 0.12], [0.73, 0.4, z + 0.28]);
    }
    mesh
}

/// Makes a computer of screen, post, foot and keyboard on a desk, and a case on the floor: 60 triangles. Its
/// origin is that of the desk, on the floor.
pub(crate) fn computer() -> Mesh {
    const DESK: f64 = 0.74;
    let mut mesh = Mesh::from_cuboid([-0.27, -0.03, 0.86], [0.27, 0.02, 1.22]);
    mesh.cuboid([-0.03, -0.05, DESK], [0.03, -0.03, 0.95]);
    mesh.cuboid([-0.12, -0.12, DESK], [0.12, 0.06, 0.76]);
    mesh.cuboid([-0.22, 0.12, DESK], [0.22, 0.27, 0.76]);
    mesh.cuboid([0.3, -0.3, 0.0], [0.5, 0.15, 0.45]);
    mesh
}

/// Makes a plant of a pot and forty leaves, one triangle each, with its origin on the floor: 88 triangles.
/// The leaves are random and reach up to about 1 m high.
pub(crate) fn plant(random: &mut Random) -> Mesh {
    const LEAVES: usize = 40;
    const POT_HEIGHT: f64 = 0.35;
    const LEAF_HALF_WIDTH: f64 = 0.05;
    /// Fraction of a leaf's length that is the bare stalk; the leaf's triangle begins there.
    const STALK: f64 = 0.4;
    let mut mesh = Mesh::new();
    mesh.cylinder(&on_axis(0.0, POT_HEIGHT, 0.15, 0.2, 12));
    let root = DVec3::new(0.0, 0.0, POT_HEIGHT);
    for _ in 0..LEAVES {
        let heading = random.angle();
        let rise = random.between(0.3, 1.3);
        let length = random.between(0.3, 0.7);
        let level = DVec2::from_angle(heading);
        let direction = (level * rise.cos()).extend(rise.sin());
        let side = (level.perp() * LEAF_HALF_WIDTH).extend(0.0);
        let base = root + direction * length * STALK;
        mesh.triangles.push([base - side, base + side, root + direction * length]);
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_piece_has_its_count() {
        let random = &mut Random::new(7);
        let counts = [
            (dining_table(), 60),
            (chair(), 72),
            (sofa(), 72),
            (bed(), 96),
            (shelf(random), 384),
            (cupboard(0.6, 0.9), 60),
            (lamp(), 104),
            (desk(), 84),
            (computer(), 60),
            (plant(random), 88),
        ];
        for (i, (mesh, count)) in counts.iter().enumerate() {
            assert_eq!(mesh.triangles.len(), *count, "piece {i}");
        }
    }
}
