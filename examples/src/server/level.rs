//! Levels of the simulated server: cells for visibility between movers, places to walk between, and triangles
//! that block segments.

use super::ray_tree::RayTree;
use crate::pvs::bake;
use crate::pvs::built::{self, Origin};
use crate::source::clearance;
use crate::{SceneSource, floor_plans, region};
use glam::DVec3;
use std::path::Path;
use visibility_2d::cdt::{Opacity, Plan, PlanCells, Wall};
use visibility_bake::Grid;
use visibility_core::pvs::Viewcells;
use visibility_core::who_sees::{Reach, SightCells, ViewcellMatrix};
use visibility_portals::{BakerSettings, SceneCells};
use visibility_region::ExtendedProjectionCuller;
use visibility_testing::Random;

/// Eye height of a person, and height of a person, in metres.
const EYE: [f64; 2] = [1.6, 1.8];
/// Half the width of a person in metres.
const HALF: f64 = 0.3;
/// Greatest distance along each axis, in metres, from a person's eye to the camera: it leans and bobs.
const LEAN: f64 = 0.15;
/// Maximum number of portal chains tested per cell. Everything not proven hidden by then counts as visible
/// from the cell.
const STEPS: u64 = 20_000;

/// Number of random places that are tried, and the least distance in metres between two accepted places.
const TRIES: usize = 50_000;
const SPACING: f64 = 1.5;

/// A level with places to walk between.
pub struct Level {
    /// Cells that decide visibility between movers.
    pub cells: Box<dyn SightCells>,
    /// Places in world space, at eye height.
    pub places: Vec<DVec3>,
    /// For each place, the places that are reached from it on a straight line.
    pub ways: Vec<Vec<usize>>,
    /// Index of the world axis that points up: 1 or 2.
    up: usize,
    walls: Walls,
}

enum Walls {
    Plan(Box<Plan>),
    Triangles(RayTree),
}

impl Level {
    /// Makes the level of a plan file, with a triangulation of triangles of at most `size` metres. Places
    /// spread from the first point in the file.
    ///
    /// # Errors
    ///
    /// Returns a message if the file cannot be read or has no point, or the plan cannot be made.
    pub fn of_plan(file: &Path, size: f64) -> Result<Self, Box<dyn std::error::Error>> {
        let file = floor_plans::load(file)?;
        let mut walls: Vec<Wall> = file.walls.iter().map(|&[a, b]| Wall::new(a, b)).collect();
        let plan = Plan::new(&walls)?;
        let [low, high] = plan.bounds();
        // A grid of transparent walls limits the size of triangles.
        let clear = |from, to| Wall::new(from, to).with_opacity(Opacity::Clear);
        let lines = |axis: usize| {
            let count = ((high[axis] - low[axis]) / size).ceil() as u32;
            (1..count).map(move |i| low[axis] + size * f64::from(i))
        };
        walls.extend(lines(0).map(|x| clear([x, low[1]], [x, high[1]])));
        walls.extend(lines(1).map(|y| clear([low[0], y], [high[0], y])));
        let &[x, y] = file.eyes.first().ok_or("the plan has no point, at which players could start")?;
        let cells = Box::new(PlanCells::new(Plan::new(&walls)?, [0, 1])?);
        let (places, ways) = (vec![DVec3::new(x, y, EYE[0])], vec![Vec::new()]);
        let mut level = Self { cells, places, ways, up: 2, walls: Walls::Plan(Box::new(plan)) };
        level.grow();
        Ok(level)
    }

    /// Makes the level of a scene. The places lie on its camera walks; a walk of one key is one place. The
    /// cells are those between its portals, or boxes with a side of `boxes` metres.
    ///
    /// # Errors
    ///
    /// Returns a message if the scene has no walks or too many triangles of instances, or the cells cannot be
    /// made.
    pub fn of_scene(source: SceneSource, boxes: Option<f64>) -> Result<Self, Box<dyn std::error::Error>> {
        source.check_copies()?;
        let up = if source.up.y > source.up.z { 1 } else { 2 };
        let (mut places, mut ways) = (Vec::new(), Vec::new());
        for walk in &source.walks {
            let first = places.len();
            if let [only] = &walk.keys[..] {
                places.push(only.eye);
            }
            for pair in walk.keys.windows(2) {
                let steps = pair[0].eye.distance(pair[1].eye).ceil().max(1.0);
                places.extend((0..steps as u32).map(|i| pair[0].eye.lerp(pair[1].eye, f64::from(i) / steps)));
            }
            for place in first..places.len() {
                ways.push(
                    [place.wrapping_sub(1), place + 1]
                        .into_iter()
                        .filter(|&p| first <= p && p < places.len())
                        .collect(),
                );
            }
        }
        if places.is_empty() {
            return Err("the scene has no walks, along which players could walk".into());
        }
        let opaque = source.objects.iter().filter(|object| object.is_wall());
        let triangles = opaque.flat_map(|object| {
            object
                .triangles
                .view()
                .iter()
                .map(|t| t.map(|p| p.as_dvec3() + source.origin))
                .collect::<Vec<_>>()
        });
        let walls = Walls::Triangles(RayTree::new(triangles.collect()));
        let cells = match boxes {
            Some(size) => Box::new(boxes_of(source, &places, size, up)?),
            None => Box::new(portals_of(&source)?),
        };
        let mut level = Self { cells, places, ways, up, walls };
        level.grow();
        Ok(level)
    }

    /// Adds places at random, each a few metres from an earlier place and not too near to any other.
    fn grow(&mut self) {
        let mut random = Random(7);
        for _ in 0..TRIES {
            let from = random.below(self.places.len());
            let mut way = random.vector(6.0);
            way[self.up] = 0.0;
            let to = self.places[from] + way;
            if self.places.iter().any(|place| place.distance_squared(to) < SPACING * SPACING) {
                continue;
            }
            // Checks that a person has room at the new place and on the way to it.
            let side = way.cross(DVec3::AXES[self.up]).normalize_or_zero() * HALF;
            let ahead = way.normalize_or_zero() * HALF;
            let is_free = [DVec3::ZERO, side, -side]
                .iter()
                .all(|&side| self.is_free(self.places[from] + side, to + side + ahead));
            let is_free = is_free && self.is_free(self.places[from], self.places[from] + side);
            let person = self.person(to);
            if is_free && self.is_in_cells(&person) {
                self.ways[from].push(self.places.len());
                self.ways.push(vec![from]);
                self.places.push(to);
            }
        }
    }

    /// Returns whether a mover is in the cells. A mover that is not sees all others and is seen by all.
    fn is_in_cells(&mut self, reach: &Reach) -> bool {
        self.cells.cells_of(reach, &mut Vec::new())
    }

    /// Returns the box of a person at a place. `eye` is the position of the person's eyes.
    pub fn person(&self, eye: DVec3) -> Reach {
        let mut half = DVec3::splat(HALF);
        half[self.up] = 0.0;
        let up = DVec3::AXES[self.up];
        Reach::new(eye - half - up * EYE[0], eye + half + up * (EYE[1] - EYE[0]))
    }

    /// Returns the box of the eyes of a person, from which the person sees. It is smaller than that of the
    /// body, whose reach goes through the floor and so sees what is below.
    pub fn eyes(eye: DVec3) -> Reach {
        Reach::new(eye - LEAN, eye + LEAN)
    }

    /// Returns whether a segment meets no wall or triangle.
    pub fn is_free(&self, from: DVec3, to: DVec3) -> bool {
        match &self.walls {
            Walls::Plan(plan) => plan.sees([from.x, from.y], [to.x, to.y]).unwrap_or(false),
            Walls::Triangles(tree) => tree.is_free(from, to),
        }
    }

    /// Returns a random point of a mover within its reach, such that the step from the middle of the body to
    /// a point of the body, and from there to the result, is unobstructed and ends in the cells: movers do
    /// not leave a building by its windows.
    pub fn point_of(&mut self, reach: &Reach, random: &mut Random) -> DVec3 {
        let middle = (reach.min + reach.max) * 0.5;
        let mut point = middle;
        let unit = DVec3::new(random.unit(), random.unit(), random.unit());
        let body = reach.min + (reach.max - reach.min) * unit;
        let mut is_step = |from, to| self.is_free(from, to) && self.is_in_cells(&Reach::new(to, to));
        if is_step(middle, body) {
            point = body;
        }
        let moved = point + random.direction() * (reach.margin * random.unit().cbrt());
        if is_step(point, moved) { moved } else { point }
    }
}

fn portals_of(source: &SceneSource) -> Result<ViewcellMatrix, Box<dyn std::error::Error>> {
    let origin = if source.cells.is_some() { Origin::Given } else { Origin::Polygons };
    let cells = built::cells(source, origin)?;
    let settings =
        BakerSettings::default().with_clearance(Some(clearance(&cells.viewcells))).with_steps_per_cell(STEPS);
    let pvs = bake(&cells.graph, settings, 0, |_| ())?.outcome.matrix.to_pvs(&cells.graph)?;
    let tolerance = SceneCells::usual_tolerance(&cells.viewcells);
    Ok(ViewcellMatrix::of_portals(&cells.graph, cells.viewcells, &pvs, tolerance)?)
}

fn boxes_of(
    source: SceneSource,
    places: &[DVec3],
    size: f64,
    up: usize,
) -> Result<ViewcellMatrix, Box<dyn std::error::Error>> {
    let room = {
        let mut room = DVec3::splat(6.0);
        room[up] = 2.5;
        room
    };
    let min = places.iter().fold(DVec3::INFINITY, |min, &p| min.min(p)) - room;
    let max = places.iter().fold(DVec3::NEG_INFINITY, |max, &p| max.max(p)) + room;
    let viewcells = Viewcells::new(Grid::new(min, DVec3::splat(size))?.over(min, max)?);
    let world = region::world(source);
    Ok(ViewcellMatrix::of_scene::<ExtendedProjectionCuller>(&world.scene, viewcells))
}
