//! Maps of cells and portals for tests: grids of rooms with random windows, and chains of portals around a
//! known line.

use super::stabs::Random;
use visibility_core::glam::{DQuat, DVec3};
use visibility_core::{
    cells::{CellGraph, CellId},
    geometry::{ConvexPolygon, Plane},
};

/// Makes a grid of `size` by `size` by `floors` cubic rooms with a side of 64 units. A wall between two rooms
/// has a random window, or is open all over, or (a quarter of the walls) has no opening. Room (x, y, z) is
/// cell (z * size + y) * size + x.
pub fn rooms(size: u32, floors: u32, seed: u64) -> CellGraph {
    let mut random = Random(seed);
    let at = |x: u32, y: u32, z: u32| CellId((z * size + y) * size + x);
    let mut portals = Vec::new();
    for z in 0..floors {
        for y in 0..size {
            for x in 0..size {
                let corner = DVec3::new(x.into(), y.into(), z.into()) * 64.0;
                for (axis, next) in [(0, [x + 1, y, z]), (1, [x, y + 1, z]), (2, [x, y, z + 1])] {
                    if next[0] < size
                        && next[1] < size
                        && next[2] < floors
                        && let Some(polygon) = window(corner, axis, &mut random)
                    {
                        portals.push((polygon, [at(x, y, z), at(next[0], next[1], next[2])]));
                    }
                }
            }
        }
    }
    // Every portal joins cells of the grid and has a valid polygon, so the graph is never refused.
    CellGraph::new((size * size * floors) as usize, portals).unwrap_or_default()
}

/// Makes a random opening in the wall at the far side, along `axis`, of the room whose minimum corner is
/// `corner`. `None` for a wall without an opening.
fn window(corner: DVec3, axis: usize, random: &mut Random) -> Option<ConvexPolygon> {
    let [n, u, v] = [0, 1, 2].map(|i| DVec3::AXES[(axis + i) % 3]);
    let wall = corner + n * 64.0;
    match random.below(8) {
        0 | 1 => None,
        2 => ConvexPolygon::new(
            [[0.0, 0.0], [64.0, 0.0], [64.0, 64.0], [0.0, 64.0]].map(|[a, b]| wall + u * a + v * b),
        )
        .ok(),
        3 | 4 => {
            let (a, b) = (random.between(0.0, 40.0), random.between(0.0, 40.0));
            let (c, d) = (random.between(a + 2.0, 64.0), random.between(b + 2.0, 64.0));
            ConvexPolygon::new([[a, b], [c, b], [c, d], [a, d]].map(|[a, b]| wall + u * a + v * b)).ok()
        }
        _ => {
            let corners = 3 + random.below(6);
            let (turn, a, b) = (random.unit(), random.between(4.0, 31.0), random.between(4.0, 31.0));
            let middle = wall + u * random.between(a, 64.0 - a) + v * random.between(b, 64.0 - b);
            let vertices = (0..corners).map(|i| {
                let angle = (i as f64 + turn) / corners as f64 * core::f64::consts::TAU;
                middle + u * (a * angle.cos()) + v * (b * angle.sin())
            });
            ConvexPolygon::new(vertices).ok()
        }
    }
}

/// Returns a map with every vertex rotated by `rotation` about the origin and then translated by `shift`.
pub fn turned(graph: &CellGraph, rotation: DQuat, shift: DVec3) -> CellGraph {
    mapped(graph, |v| rotation * v + shift)
}

/// Returns a map with each vertex replaced by `map` of the vertex. Portals that are no longer valid polygons
/// are left out.
pub fn mapped(graph: &CellGraph, map: impl Fn(DVec3) -> DVec3) -> CellGraph {
    let portals = graph.portals().iter().filter_map(|portal| {
        let polygon = ConvexPolygon::new(portal.polygon().vertices().iter().map(|&v| map(v))).ok()?;
        Some((polygon, portal.cells()))
    });
    CellGraph::new(graph.cell_count(), portals).unwrap_or_default()
}

/// Returns a map with all coordinates rounded to `decimals` decimals, as map compilers write them. Portals
/// that become invalid polygons are left out.
pub fn rounded(graph: &CellGraph, decimals: i32) -> CellGraph {
    let scale = 10f64.powi(decimals);
    mapped(graph, |v| (v * scale).round() / scale)
}

/// Row of cells joined by portals, with a line that passes through all portals at a known clearance.
pub struct Planted {
    /// Graph in which portal `i` joins the cells `i` and `i + 1`. Fewer portals than asked for are left when
    /// a polygon is refused.
    pub graph: CellGraph,
    /// Point that the line passes through, and its unit direction, in the map's units.
    pub line: (DVec3, DVec3),
}

/// Minimum distance along the line from one portal of a chain to the next. Where hinged portals meet the line
/// much closer together, rounding would decide which portal comes first.
const LEAST_GAP: f64 = 1e-9;

/// Makes a chain of `count` portals around a random line. Each portal has some edges at exactly `clearance`
/// from the line and the other edges farther away; some portals share an edge line with the portal before.
/// Position, orientation and the direction of normals are random.
pub fn planted(count: usize, clearance: f64, random: &mut Random) -> Planted {
    let direction = random.direction();
    let place = DVec3::new(random.between(-3e3, 3e3), random.between(-3e3, 3e3), random.between(-3e3, 3e3));
    let side = direction.any_orthonormal_vector();
    let other = direction.cross(side);
    let (mut at, mut portals) = (0.0, Vec::new());
    let mut before: Option<(DVec3, DVec3)> = None;
    while portals.len() < count {
        // Each wall is a plane parallel to the line, as its unit normal and distance from the line. Every
        // edge of the portal lies in a wall, so the edge has the wall's distance from the line.
        let corners = 3 + random.below(4);
        let turn = random.unit();
        let mut walls: Vec<(DVec3, f64)> = (0..corners)
            .map(|i| {
                let angle =
                    (i as f64 + turn + random.between(-0.2, 0.2)) / corners as f64 * core::f64::consts::TAU;
                let distance = if random.below(2) == 0 {
                    clearance
                } else {
                    clearance * (random.unit() * (300.0 / clearance).ln()).exp()
                };
                (side * angle.cos() + other * angle.sin(), distance)
            })
            .collect();
        let mut normal = loop {
            let normal = random.direction();
            if normal.dot(direction) > 0.02 {
                break normal;
            }
        };
        let mut through = place
            + direction * (at + [1e-7, 1e-3, 0.1, 10.0, 300.0][random.below(5)] * (random.unit() + 0.1));
        // Half of the portals are rotated about an edge of the previous portal that is at the clearance from
        // the line.
        if let Some((last, wall)) = before.filter(|_| random.below(2) == 0) {
            let axis = last.cross(wall).normalize_or_zero();
            let edge = on_edge_of(last, place + direction * at, wall, clearance).unwrap_or(through);
            let angle = random.between(1e-3, 1.2);
            for turn in [angle, -angle] {
                let turned = DQuat::from_axis_angle(axis, turn) * last;
                let crossing = turned.dot(edge - place) / turned.dot(direction);
                if turned.dot(direction) > 0.02 && crossing > at {
                    (normal, through) = (turned, edge);
                    walls[0] = (wall, clearance);
                }
            }
        }
        let next_at = normal.dot(through - place) / normal.dot(direction);
        if !portals.is_empty() && next_at < at + LEAST_GAP {
            continue;
        }
        let plane = Plane::through(through, normal);
        if let Some(polygon) = prism_cut(&plane, place + direction * next_at, &walls) {
            let tight = walls.iter().find(|(_, distance)| *distance == clearance);
            before = tight.map(|&(wall, _)| (normal, wall));
            at = next_at;
            portals.push(polygon);
        }
    }
    let cells = (0..count as u32).map(|i| [CellId(i), CellId(i + 1)]);
    let portals = portals.into_iter().zip(cells).map(|(polygon, cells)| {
        if polygon.area() > 0.0 && polygon.vertices().len() % 2 == 0 {
            // Half of the portals have the opposite winding, with their cells swapped.
            let turned =
                ConvexPolygon::new(polygon.vertices().iter().rev().copied()).unwrap_or(polygon.clone());
            (turned, [cells[1], cells[0]])
        } else {
            (polygon, cells)
        }
    });
    let graph = CellGraph::new(count + 1, portals.collect::<Vec<_>>()).unwrap_or_default();
    Planted { graph, line: (place, direction) }
}

/// Returns the point nearest to `through` in the plane with the unit normal `normal` through `through` that
/// lies at `distance` from `through` along the unit vector `wall`. `None` if `normal` and `wall` are
/// parallel.
fn on_edge_of(normal: DVec3, through: DVec3, wall: DVec3, distance: f64) -> Option<DVec3> {
    // Direction in the portal's plane in which the distance along `wall` grows fastest.
    let toward = (wall - normal * normal.dot(wall)).try_normalize()?;
    Some(through + toward * (distance / toward.dot(wall)))
}

/// Returns the intersection of a plane with the prism between walls along a line, counter-clockwise around
/// the plane's normal. `walls` are unit normals and distances from the line, `middle` the point where the
/// line meets the plane. `None` when the intersection is empty or degenerate.
fn prism_cut(plane: &Plane, middle: DVec3, walls: &[(DVec3, f64)]) -> Option<ConvexPolygon> {
    let u = plane.normal.any_orthonormal_vector();
    let v = plane.normal.cross(u);
    let far = 2e3;
    let square = [[-far, -far], [far, -far], [far, far], [-far, far]].map(|[a, b]| middle + u * a + v * b);
    let (mut polygon, mut next) = (ConvexPolygon::new(square).ok()?, ConvexPolygon::default());
    for &(wall, distance) in walls {
        polygon.clip(&Plane::new(-wall, wall.dot(middle) + distance), &mut next);
        core::mem::swap(&mut polygon, &mut next);
    }
    (!polygon.is_empty() && polygon.plane()?.normal.dot(plane.normal) > 0.9).then_some(polygon)
}
