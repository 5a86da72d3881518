//! Office recipe: floors of furnished rooms on both sides of a corridor, joined by a stair, with exact cells
//! and portals.
//!
//! The building stands in for Soda Hall in the papers on architectural cells and portals. The cells are boxes
//! and the portals rectangles that lie exactly in the openings, so portal cullers can be tested without a
//! cell finder. Walls have thickness, so cullers are offered a second graph that has a cell for each doorway,
//! too.

use super::limits::Limits;
use super::mesh::{Mesh, Parts};
use super::random::Random;
use super::rooms::{Floor, RoomKind, furnish};
use super::scene::{Route, scene};
use super::walls::{Opening, Wall};
use crate::error::SourceError;
use crate::source::{SceneSource, SourceCells};
use crate::walk::Walk;
use glam::DVec3;
use visibility_core::{
    cells::{CellGraph, CellId},
    pvs::{Viewcell, Viewcells},
};

/// Seed of the building's random numbers. Another seed gives other doors and furniture.
const SEED: u64 = 5;

/// Extent of a room along the corridor, in metres.
const ROOM_WIDTH: f64 = 4.0;
/// Extent of a room away from the corridor, in metres.
const ROOM_DEPTH: f64 = 5.0;
/// Width of the corridor, in metres.
const CORRIDOR: f64 = 3.0;
/// Height of a room from floor to ceiling, in metres.
const HEIGHT: f64 = 3.2;
/// Thickness of the slab below each floor, in metres.
const SLAB: f64 = 0.3;
/// Height from one floor to the next, in metres.
const STOREY: f64 = HEIGHT + SLAB;
/// Coordinates y of the southern and the northern facade, in metres.
const FACADES: [f64; 2] = [-ROOM_DEPTH, CORRIDOR + ROOM_DEPTH];
/// Minimum corner (x, y) of the stair shaft, in metres. The shaft is west of the corridor.
const STAIR_LOW: [f64; 2] = [-4.0, -1.5];
/// Maximum corner (x, y) of the stair shaft, in metres.
const STAIR_HIGH: [f64; 2] = [0.0, 4.5];

/// Height of a door above its floor, in metres.
const DOOR_HEAD: f64 = 2.1;
/// Width of a door to the corridor, in metres.
const DOOR_WIDTH: f64 = 0.9;
/// Interval of doors between neighbouring rooms: a room whose index is a positive multiple of this number has
/// a door to its western neighbour.
const JOINED_EVERY: u32 = 4;

/// Thickness of the end walls of a floor and of the shaft's walls, in metres.
const END_WALL: f64 = 0.2;
/// Thickness of the corridor's walls and of the walls between rooms, in metres.
const CORRIDOR_WALL: f64 = 0.12;
/// Least depth, in metres, that an object must reach into a cell to belong to the cell. Walls stand across
/// the boundaries of cells, half on either side. Every other object reaches at least this far into its cells.
const REACH: f64 = 0.01;
/// Thickness of the facades, in metres.
const FACADE: f64 = 0.25;

/// Estimated triangles of two rooms on opposite sides of a corridor, for the bound on the size of the scene.
const TRIANGLES_PER_PAIR_OF_ROOMS: u64 = 3_000;

/// Axis-aligned box of free space in the building: a corridor, a room, or the part of the stair shaft on one
/// floor. World space, in metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// Name of the cell: `corridorF`, `stairF` or `roomF_S_R` with the floor F, the side S (0 south, 1
    /// north) and the index R of the room from the west.
    pub name: String,
    /// Minimum corner of the cell in world space, in metres.
    pub min: DVec3,
    /// Maximum corner of the cell in world space, in metres.
    pub max: DVec3,
}

/// Rectangular opening between two cells, in world space.
#[derive(Debug, Clone, PartialEq)]
pub struct Portal {
    /// Indices into [`Office::cells`] of the two cells that the opening joins.
    pub cells: [usize; 2],
    /// Corners of the rectangle in order around it, in metres. The direction of rotation is arbitrary.
    pub quad: [DVec3; 4],
    /// True for an opening between the corridor and a room, where a door leaf would be. False for openings
    /// between rooms, to the stair and in the shaft.
    pub door: bool,
    /// Thickness in metres of the wall that the opening is cut through; half of the wall is on either side
    /// of `quad`. 0 for the openings between floors in the stair shaft.
    pub depth: f64,
}

/// Office scene, with exact cells and portals beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct Office {
    /// Objects and walks, and the cells and portals in the form that cullers take.
    pub scene: SceneSource,
    /// Cells, floor by floor: the corridor, the stair, the southern rooms from west to east, and the
    /// northern rooms.
    pub cells: Vec<Cell>,
    /// Openings between pairs of the cells, each listed once.
    pub portals: Vec<Portal>,
}

/// Makes an office building of `floors` floors with `rooms` rooms on either side of each corridor.
///
/// 2 floors of 16 rooms a side are 779 objects with 89,664 triangles; 7 floors of 24 rooms a side are 468,960
/// triangles.
///
/// # Errors
///
/// Returns [`SourceError::Recipe`] when a size is 0 or the scene would have more triangles than recipes may
/// make.
pub fn office(floors: u32, rooms: u32) -> Result<Office, SourceError> {
    let mut objects = Vec::new();
    let mut office = building(floors, rooms, Parts::new(&mut |name, mesh| objects.push(mesh.named(name))))?;
    office.scene.objects = objects;
    Ok(office)
}

/// Makes an office building as [`office`] does. The objects go to `parts`, and the scene is without them.
pub(super) fn building(floors: u32, rooms: u32, parts: Parts<'_>) -> Result<Office, SourceError> {
    let limits = Limits::new(format!("office:{floors},{rooms}"));
    limits.at_least_one("floors", floors)?;
    limits.at_least_one("rooms", rooms)?;
    limits.triangles(u64::from(floors) * u64::from(rooms), TRIANGLES_PER_PAIR_OF_ROOMS)?;

    let mut building = Building {
        random: Random::new(SEED),
        length: f64::from(rooms) * ROOM_WIDTH,
        floors,
        rooms,
        parts,
        cells: Vec::new(),
        portals: Vec::new(),
    };
    for floor in 0..floors {
        building.floor(floor);
    }
    let mut scene = scene("office", 0.1, &ROUTES);
    if floors > 1 {
        scene.walks.push(upstairs());
    }
    let deep = source_cells(&building.cells, &building.portals, true)?;
    let mut cells = source_cells(&building.cells, &building.portals, false)?;
    cells.with_doorways = Some(Box::new(deep));
    scene.cells = Some(cells);
    Ok(Office { scene, cells: building.cells, portals: building.portals })
}

/// Converts cells and portals into a cell graph for cullers. The normal of each portal points into the second
/// of its cells. When `deep`, the graph has a cell for each doorway as well.
///
/// A doorway is as deep as its wall, and an oblique view through it shows much less than through a hole in an
/// infinitely thin wall. With `deep`, a doorway is therefore a cell between two portals. The other cells
/// still reach to the middles of the walls, so that a near plane inside a wall is still in a cell. Where such
/// a cell overlaps a doorway, the doorway's cell wins because doorway cells have lower indices.
///
/// Returns an error when the graph refuses a portal, for instance one with too few distinct corners.
fn source_cells(cells: &[Cell], portals: &[Portal], deep: bool) -> Result<SourceCells, SourceError> {
    let refused = |error: &dyn std::fmt::Display| SourceError::recipe("office", error.to_string());
    let doorways = portals.iter().filter(|portal| deep && portal.depth > 0.0).count();
    let mut bodies = Vec::with_capacity(doorways + cells.len());
    let mut names = Vec::with_capacity(doorways + cells.len());
    let mut openings = Vec::with_capacity(doorways + portals.len());
    let center = |cell: usize| (cells[cell].min + cells[cell].max) * 0.5;
    for portal in portals {
        let mut quad = portal.quad;
        let [first, second] = portal.cells;
        let area = |quad: &[DVec3; 4]| (quad[1] - quad[0]).cross(quad[2] - quad[0]);
        if area(&quad).dot(center(second) - quad[0]) < 0.0 {
            quad.reverse();
        }
        let ends = portal.cells.map(|cell| CellId((doorways + cell) as u32));
        if !deep {
            openings.push((quad, ends));
            continue;
        }
        if portal.depth == 0.0 {
            // The opening in the shaft is inset by half the thickness of the walls around it.
            let inset = DVec3::new(END_WALL, END_WALL, 0.0) * 0.5;
            let (min, max) = (quad.into_iter().reduce(DVec3::min), quad.into_iter().reduce(DVec3::max));
            let (min, max) = (min.unwrap_or(quad[0]) + inset, max.unwrap_or(quad[0]) - inset);
            openings.push((quad.map(|corner| corner.max(min).min(max)), ends));
            continue;
        }
        let half = area(&quad).normalize() * (portal.depth * 0.5);
        let doorway = CellId(bodies.len() as u32);
        openings.push((quad.map(|corner| corner - half), [ends[0], doorway]));
        openings.push((quad.map(|corner| corner + half), [doorway, ends[1]]));
        let corners = || quad.into_iter().flat_map(|corner| [corner - half, corner + half]);
        let (min, max) = (corners().reduce(DVec3::min), corners().reduce(DVec3::max));
        bodies.push(Viewcell::from_box(min.unwrap_or(quad[0]), max.unwrap_or(quad[0])));
        names.push(format!("doorway {} - {}", cells[first].name, cells[second].name));
    }
    for cell in cells {
        bodies.push(Viewcell::from_box(cell.min, cell.max));
        names.push(cell.name.clone());
    }
    let graph = CellGraph::from_vertices(bodies.len(), openings).map_err(|error| refused(&error))?;
    Ok(SourceCells { graph, viewcells: Viewcells::new(bodies), names, depth: REACH, with_doorways: None })
}

/// Building under construction: its sizes, its random numbers, the receiver of its objects, and the cells and
/// portals made so far.
struct Building<'a> {
    random: Random,
    /// Length of the corridors along x, in metres.
    length: f64,
    floors: u32,
    rooms: u32,
    parts: Parts<'a>,
    cells: Vec<Cell>,
    portals: Vec<Portal>,
}

/// Describes a wall of thickness `thickness` from the floor at height `z` up to the ceiling, in metres.
fn wall(from: [f64; 2], to: [f64; 2], z: f64, thickness: f64) -> Wall {
    Wall { from, to, foot: z, top: z + HEIGHT, thickness }
}

/// Returns an upright rectangle as high as a door, from one point to another on the floor at height `z`, in
/// metres: the two lower corners first.
fn doorway(from: [f64; 2], to: [f64; 2], z: f64) -> [DVec3; 4] {
    let corner = |[x, y]: [f64; 2], z: f64| DVec3::new(x, y, z);
    [corner(from, z), corner(to, z), corner(to, z + DOOR_HEAD), corner(from, z + DOOR_HEAD)]
}

impl Building<'_> {
    /// Adds one floor: its slab, corridor, stair, end walls, rooms and ceiling, with their cells and portals.
    /// `floor` is the index from the ground floor up.
    fn floor(&mut self, floor: u32) {
        let z = f64::from(floor) * STOREY;
        let [south, north] = FACADES;
        let corridor = self.cells.len();
        self.cells.push(Cell {
            name: format!("corridor{floor}"),
            min: DVec3::new(0.0, 0.0, z),
            max: DVec3::new(self.length, CORRIDOR, z + HEIGHT),
        });
        let slab = Mesh::from_cuboid([0.0, south, z - SLAB], [self.length, north, z]);
        self.parts.add("slab", slab);

        self.stair(floor, z, corridor);
        self.end_walls(z);
        for side in 0..2 {
            for room in 0..self.rooms {
                self.room(floor, side, room, z, corridor);
            }
        }
        let top = z + HEIGHT;
        let ceiling = Mesh::from_cuboid([0.0, south, top - 0.02], [self.length, north, top]);
        self.parts.add("ceiling", ceiling);
    }

    /// Adds the part of the stair shaft on one floor, with a portal to the corridor and, above the ground
    /// floor, a portal to the part below. `z` is the height of the floor in metres, `corridor` the index of
    /// the corridor's cell.
    fn stair(&mut self, floor: u32, z: f64, corridor: usize) {
        /// Number of steps of the stair on one floor.
        const STEPS: u32 = 10;
        /// Depth of a step of the stair along x, in metres.
        const TREAD: f64 = 0.3;
        /// Height of a step of the stair, in metres.
        const RISER: f64 = 0.35;
        let [west, south] = STAIR_LOW;
        let [east, north] = STAIR_HIGH;
        let stair = self.cells.len();
        // Below another floor, the shaft's cell reaches up through the slab.
        let top = if floor + 1 < self.floors { STOREY } else { HEIGHT };
        self.cells.push(Cell {
            name: format!("stair{floor}"),
            min: DVec3::new(west, south, z),
            max: DVec3::new(east, north, z + top),
        });
        self.portals.push(Portal {
            cells: [corridor, stair],
            quad: doorway([east, 1.0], [east, 2.0], z),
            door: false,
            depth: END_WALL,
        });
        if floor > 0 {
            let cells_per_floor = 2 + 2 * self.rooms as usize;
            self.portals.push(Portal {
                cells: [stair, stair - cells_per_floor],
                quad: [
                    DVec3::new(west, south, z),
                    DVec3::new(east, south, z),
                    DVec3::new(east, north, z),
                    DVec3::new(west, north, z),
                ],
                door: false,
                depth: 0.0,
            });
        }
        let walls =
            [([west, south], [west, north]), ([west, south], [east, south]), ([west, north], [east, north])];
        for (from, to) in walls {
            let wall = Wall { top: z + STOREY, ..wall(from, to, z, END_WALL) };
            self.parts.add("stairwall", wall.build(&[]));
        }
        for step in 0..STEPS {
            let step = f64::from(step);
            let x = west + TREAD * step;
            let mesh =
                Mesh::from_cuboid([x, 3.0, z + RISER * step], [x + TREAD, 4.4, z + RISER * (step + 1.0)]);
            self.parts.add("step", mesh);
        }
    }

    /// Adds the two end walls of a floor at height `z`: the western wall with a doorway to the stair, and the
    /// eastern wall with a window to the corridor.
    fn end_walls(&mut self, z: f64) {
        let [south, north] = FACADES;
        let ends =
            [(0.0, Opening::new(6.0, 7.0, 0.0, DOOR_HEAD)), (self.length, Opening::new(5.6, 7.4, 0.9, 2.2))];
        for (x, opening) in ends {
            let wall = wall([x, south], [x, north], z, END_WALL);
            self.parts.add("endwall", wall.build(&[opening]));
        }
    }

    /// Adds a room on the southern (`side` 0) or northern (`side` 1) side of the corridor, with its door,
    /// window, western wall and furniture. `room` is the index from the west, `z` the height of the floor in
    /// metres, `corridor` the index of the corridor's cell.
    fn room(&mut self, floor: u32, side: usize, room: u32, z: f64, corridor: usize) {
        let inner = [0.0, CORRIDOR][side];
        let outer = FACADES[side];
        let (south, north) = (f64::min(inner, outer), f64::max(inner, outer));
        let west = ROOM_WIDTH * f64::from(room);
        let east = west + ROOM_WIDTH;
        let tag = format!("room{floor}_{side}_{room}");
        let cell = self.cells.len();
        self.cells.push(Cell {
            name: tag.clone(),
            min: DVec3::new(west, south, z),
            max: DVec3::new(east, north, z + HEIGHT),
        });

        let door = self.random.between(0.5, 2.5);
        let opening = Opening::new(door, door + DOOR_WIDTH, 0.0, DOOR_HEAD);
        let corridor_wall = wall([west, inner], [east, inner], z, CORRIDOR_WALL);
        self.parts.add("wall", corridor_wall.build(&[opening]));
        let hinge = west + door;
        self.portals.push(Portal {
            cells: [corridor, cell],
            quad: doorway([hinge, inner], [hinge + DOOR_WIDTH, inner], z),
            door: true,
            depth: CORRIDOR_WALL,
        });

        let facade = wall([west, outer], [east, outer], z, FACADE);
        let window = Opening::new(1.1, 2.9, 0.9, 2.2);
        self.parts.add("facade", facade.build(&[window]));
        if room > 0 {
            self.party_wall(room, [west, south, north, z], cell);
        }

        let kind = if self.random.unit() < 0.75 { RoomKind::Office } else { RoomKind::Living };
        /// Least distance of furniture from the room's boundary, in metres.
        const OFF_WALL: f64 = 0.15;
        let area =
            Floor { low: [west + OFF_WALL, south + OFF_WALL], high: [east - OFF_WALL, north - OFF_WALL], z };
        furnish(&mut self.random, kind, &area, &tag, &mut self.parts);
    }

    /// Adds the wall between a room and its western neighbour; every fourth room gets a doorway in this wall.
    /// `x` is the wall's coordinate, `south` and `north` are its ends and `z` its foot, in metres; `cell` is
    /// the index of the room's cell.
    fn party_wall(&mut self, room: u32, [x, south, north, z]: [f64; 4], cell: usize) {
        /// Southern edge of the doorway, in metres from the southern end of the wall.
        const FROM: f64 = 1.8;
        /// Northern edge of the doorway, in metres from the southern end of the wall.
        const TO: f64 = 2.8;
        let wall = wall([x, south], [x, north], z, CORRIDOR_WALL);
        let joined = room.is_multiple_of(JOINED_EVERY);
        let opening = Opening::new(FROM, TO, 0.0, DOOR_HEAD);
        let openings: &[Opening] = if joined { &[opening] } else { &[] };
        self.parts.add("part", wall.build(openings));
        if joined {
            self.portals.push(Portal {
                cells: [cell - 1, cell],
                quad: doorway([x, south + FROM], [x, south + TO], z),
                door: false,
                depth: CORRIDOR_WALL,
            });
        }
    }
}

/// Camera walks on the ground floor, made for 16 rooms a side.
const ROUTES: [Route; 2] = [
    Route {
        name: "corridor",
        fov_y_degrees: 65.0,
        keys: 40,
        look_ahead: 4.0,
        waypoints: &[[1.2, 1.5], [62.8, 1.5]],
    },
    Route {
        name: "corridor, rooms 3-4 (connected), corridor, opposite room",
        fov_y_degrees: 75.0,
        keys: 48,
        look_ahead: 1.5,
        waypoints: &[
            [10.08, 1.48],
            [13.45, 1.47],
            [14.46, 0.48],
            [14.42, -0.3],
            [12.99, -0.35],
            [12.82, -1.35],
            [13.45, -2.98],
            [13.97, -3.54],
            [13.3, -2.63],
            [12.83, -1.44],
            [12.96, -0.38],
            [14.34, -0.29],
            [15.34, 1.01],
            [17.47, 1.02],
            [18.07, 0.47],
            [18.17, -0.05],
            [16.94, -0.69],
            [16.92, -3.23],
            [16.93, -0.84],
            [17.12, -0.57],
            [18.04, -0.35],
            [18.4, 0.59],
            [19.38, 1.47],
            [29.32, 1.47],
            [30.44, 2.51],
            [30.61, 3.1],
            [29.98, 3.93],
            [29.98, 5.62],
        ],
    },
];

/// Returns the walk on the first floor above the ground floor, for buildings that have such a floor.
fn upstairs() -> Walk {
    UPSTAIRS.walk(|_, _| STOREY)
}

/// Route of the walk on the first floor above the ground floor, for 16 rooms a side.
const UPSTAIRS: Route = Route {
    name: "upper floor, into rooms",
    fov_y_degrees: 70.0,
    keys: 40,
    look_ahead: 2.0,
    waypoints: &[
        [59.92, 1.47],
        [30.8, 1.48],
        [30.01, 0.86],
        [28.9, -1.02],
        [28.94, -3.25],
        [28.89, -1.06],
        [30.47, 1.32],
        [33.49, 1.32],
        [34.34, 0.63],
        [34.49, -0.13],
        [33.0, -0.43],
        [33.01, -2.27],
        [33.93, -3.6],
    ],
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_come_as_cullers_take_them() {
        let office = office(2, 4).unwrap();
        let cells = office.scene.cells.unwrap();
        assert_eq!((cells.graph.cell_count(), cells.graph.portals().len()), (20, 19), "cells and portals");
        assert_eq!((cells.viewcells.cells().len(), cells.names.len()), (20, 20), "bodies and names of cells");
        cells.graph.validate(1e-9).expect("portals that can bound convex cells");
        cells
            .graph
            .validate_bodies(cells.viewcells.cells(), 1e-9)
            .expect("portals on the boundaries of their cells, normals into the second");
        // All portals except the opening in the stair shaft are doorways in walls; the opening in the shaft
        // has no depth.
        let deep = cells.with_doorways.unwrap();
        assert_eq!(
            (deep.graph.cell_count(), deep.graph.portals().len()),
            (20 + 18, 2 * 18 + 1),
            "cells and portals, with doorways as cells"
        );
        assert_eq!(
            (deep.viewcells.cells().len(), deep.names.len()),
            (38, 38),
            "bodies and names, with doorways"
        );
        deep.graph.validate(1e-9).expect("portals that can bound convex cells");
        // The bodies of the rooms reach to the middles of the walls, while the portals lie in the walls'
        // faces.
        let bodies = deep.viewcells.cells();
        deep.graph.validate_bodies(bodies, END_WALL * 0.5 + 1e-9).expect("portals in the sides of walls");
    }
}
