//! Places where a person can stand, and connected regions of such places.
//!
//! A place is a corner where four columns meet. Each of the four has a floor with free height above, and the
//! floors differ in height by at most a step. So everything higher than a step is at least a column's side
//! away from a person at the place, and from the straight way to the next place.

use super::floor_map::{COLUMN, FloorMap};
use glam::DVec3;

/// Least free height in metres above a floor where a person can stand.
const BODY: f32 = 1.7;
/// Eye height in metres above the floor.
const EYE: f32 = 1.6;
/// Greatest height difference in metres between the floors of neighbouring columns.
const STEP: f32 = 0.5;
/// Least depth in metres of solid spans below a place on a roof.
const ROOF: f32 = 2.0;
/// Size limits of a roof: its area is below this share of all non-empty columns, or below [`ROOF_AREA`]
/// square metres.
const ROOF_SHARE: f64 = 0.25;
const ROOF_AREA: f64 = 900.0;
/// Number of places from the open inwards that count as eaves instead of a room although they have a ceiling:
/// 1 m.
const EAVES: usize = 4;
/// Least number of borders of a room per way out of it. A strip along a wall has about one.
const LEAST_BORDERS: usize = 2;
/// Place number that means "no place".
pub(super) const NO_PLACE: u32 = u32::MAX;

/// Floors of a map with free height above, and the places on them. A place has the number of the floor at its
/// least column.
pub(super) struct Places {
    /// For each column, the number of its first floor; at the end, the number of all floors.
    first: Vec<u32>,
    /// For each floor, its height and the height of the ceiling above, in metres.
    heights: Vec<[f32; 2]>,
    /// For each floor, its column.
    columns: Vec<u32>,
    /// For each floor, its place: the corner between its column and the three columns towards greater
    /// coordinates. Holds the heights of floor and ceiling there. `None` where one cannot stand.
    standing: Vec<Option<[f32; 2]>>,
}

/// Region of connected places.
#[derive(Debug)]
pub(super) struct Region {
    /// Numbers of the places, ascending.
    pub places: Vec<u32>,
    /// Whether more than half of the places have a ceiling.
    pub is_covered: bool,
    /// Whether the region is a roof: it has no ceiling, and most of its places are high above something
    /// solid, or it is a small part of the scene that mostly ends at drops.
    pub is_roof: bool,
}

/// Steps from a column to its four neighbours.
const BESIDE: [[i64; 2]; 4] = [[-1, 0], [1, 0], [0, -1], [0, 1]];

impl Places {
    /// Finds all places of a map where a person can stand.
    pub(super) fn new(map: &FloorMap) -> Self {
        let mut all = Self { first: vec![0], heights: Vec::new(), columns: Vec::new(), standing: Vec::new() };
        for column in 0..map.counts[0] * map.counts[1] {
            let spans = map.spans(column);
            for (index, span) in spans.iter().enumerate() {
                let above = &spans[index + 1..];
                let ceiling = above.first().map_or(f32::INFINITY, |above| above.low);
                // All spans above must face away, since some files have a few faces turned the wrong way.
                let is_inside = !above.is_empty() && above.iter().all(|above| above.is_back);
                if span.is_floor && !is_inside && ceiling - span.high >= BODY {
                    all.heights.push([span.high, ceiling]);
                    all.columns.push(column as u32);
                }
            }
            all.first.push(all.heights.len() as u32);
        }
        all.standing = (0..all.heights.len() as u32).map(|floor| all.between(map, floor)).collect();
        all
    }

    /// Returns the heights of floor and ceiling at the place between the column of a floor and the three
    /// columns towards greater coordinates. `None` where one cannot stand.
    fn between(&self, map: &FloorMap, floor: u32) -> Option<[f32; 2]> {
        let mut all = self.heights[floor as usize];
        for step in [[1, 0], [0, 1], [1, 1]] {
            let [low, high] = self.heights[self.beside(map, floor, step)? as usize];
            all = [all[0].max(low), all[1].min(high)];
        }
        (all[1] - all[0] >= BODY).then_some(all)
    }

    /// Returns the floor in the column `step` away that is at most a step higher or lower, with free height
    /// above both floors. The nearest in height if there are several.
    pub(super) fn beside(&self, map: &FloorMap, floor: u32, step: [i64; 2]) -> Option<u32> {
        let column = shifted(map, self.columns[floor as usize] as usize, step)?;
        let [low, high] = self.heights[floor as usize];
        let is_near = |&other: &u32| {
            let [other_low, other_high] = self.heights[other as usize];
            (other_low - low).abs() <= STEP && high.min(other_high) - low.max(other_low) >= BODY
        };
        let difference = |&other: &u32| (self.heights[other as usize][0] - low).abs();
        let found = (self.first[column]..self.first[column + 1]).filter(is_near);
        found.min_by(|a, b| difference(a).total_cmp(&difference(b)))
    }

    /// Returns whether one can stand at the place with this number.
    pub(super) fn is_place(&self, floor: u32) -> bool {
        self.standing[floor as usize].is_some()
    }

    /// Returns the number of all floors.
    pub(super) fn count(&self) -> usize {
        self.heights.len()
    }

    /// Returns the neighbouring place in a direction. `None` unless one can walk there and back.
    pub(super) fn next(&self, map: &FloorMap, place: u32, direction: usize) -> Option<u32> {
        let [x, y] = BESIDE[direction];
        let other = self.beside(map, place, [x, y]).filter(|&other| self.is_place(other))?;
        (self.beside(map, other, [-x, -y]) == Some(place)).then_some(other)
    }

    /// Returns the heights of floor and ceiling at a place.
    pub(super) fn heights(&self, place: u32) -> [f32; 2] {
        self.standing[place as usize].unwrap_or(self.heights[place as usize])
    }

    /// Returns the height of a person's eye at a place.
    pub(super) fn eye_height(&self, place: u32) -> f32 {
        self.heights(place)[0] + EYE
    }

    /// Returns the indices of a place's column along both ground axes.
    pub(super) fn column(&self, map: &FloorMap, place: u32) -> [i64; 2] {
        let (column, width) = (self.columns[place as usize] as usize, map.counts[0]);
        [(column % width) as i64, (column / width) as i64]
    }

    /// Returns whether both indices of a place's column are even.
    pub(super) fn is_even(&self, map: &FloorMap, place: u32) -> bool {
        self.column(map, place).iter().all(|at| at % 2 == 0)
    }

    /// Returns the point at a place with a given height, relative to the scene's origin.
    pub(super) fn point(&self, map: &FloorMap, place: u32, height: f32) -> DVec3 {
        let at = self.column(map, place).map(|at| (at + 1) as f64 * COLUMN);
        map.axes.point(DVec3::new(map.corner.x + at[0], map.corner.y + at[1], height.into()))
    }

    /// Returns the connected regions of a map, the largest first.
    pub(super) fn regions(&self, map: &FloorMap) -> Vec<Region> {
        let occupied = (0..map.counts[0] * map.counts[1]).filter(|&at| !map.spans(at).is_empty()).count();
        let most_roof = (ROOF_SHARE * occupied as f64).max(ROOF_AREA / (COLUMN * COLUMN));
        let mut is_taken = vec![false; self.count()];
        let mut regions = Vec::new();
        for start in 0..self.count() as u32 {
            if !self.is_place(start) || is_taken[start as usize] {
                continue;
            }
            // Number of missing neighbours, and of those at a drop.
            let (mut borders, mut drops) = (0, 0);
            let places = self.connected(map, start, &mut is_taken, |place, direction, next| {
                if next.is_none() {
                    borders += 1;
                    drops += usize::from(self.is_drop(map, place, direction));
                }
                next.is_some()
            });
            let covered = places.iter().filter(|&&place| self.heights(place)[1].is_finite()).count();
            let is_covered = 2 * covered > places.len();
            let is_small = (places.len() as f64) < most_roof;
            let above = places.iter().filter(|&&place| self.is_above_something(map, place)).count();
            let is_roof = !is_covered && (2 * above > places.len() || is_small && 2 * drops > borders);
            regions.push(Region { places, is_covered, is_roof });
        }
        regions.sort_by_key(|region| std::cmp::Reverse(region.places.len()));
        regions
    }

    /// Returns the rooms that are entered from an outdoor region: connected places with a ceiling, more than
    /// [`EAVES`] places away from the open, with few ways out compared to their borders.
    pub(super) fn rooms(&self, map: &FloorMap, region: &Region) -> Vec<Region> {
        let is_open = |place: &u32| self.heights(*place)[1].is_infinite();
        let mut is_outside = vec![false; self.count()];
        let mut edge: Vec<u32> = region.places.iter().copied().filter(is_open).collect();
        for _ in 0..=EAVES {
            edge.iter().for_each(|&place| is_outside[place as usize] = true);
            let beside = |&place: &u32| [0, 1, 2, 3].map(|direction| self.next(map, place, direction));
            edge =
                edge.iter().flat_map(beside).flatten().filter(|&next| !is_outside[next as usize]).collect();
        }
        let is_inside = |place: u32| !is_outside[place as usize];
        let mut is_taken = vec![false; self.count()];
        let mut rooms = Vec::new();
        for &start in &region.places {
            if !is_inside(start) || is_taken[start as usize] {
                continue;
            }
            let (mut borders, mut openings) = (0, 0);
            let places = self.connected(map, start, &mut is_taken, |_, _, next| {
                borders += usize::from(next.is_none());
                openings += usize::from(next.is_some_and(|next| !is_inside(next)));
                next.is_some_and(is_inside)
            });
            if borders > LEAST_BORDERS * openings {
                rooms.push(Region { places, is_covered: true, is_roof: false });
            }
        }
        rooms
    }

    /// Returns the places connected with a place in ascending order, and marks them as taken. `is_within`
    /// gets a place, a direction and the neighbour there, if any, and returns whether to continue to the
    /// neighbour.
    fn connected(
        &self,
        map: &FloorMap,
        start: u32,
        is_taken: &mut [bool],
        mut is_within: impl FnMut(u32, usize, Option<u32>) -> bool,
    ) -> Vec<u32> {
        is_taken[start as usize] = true;
        let (mut places, mut done) = (vec![start], 0);
        while let Some(&place) = places.get(done) {
            done += 1;
            for direction in 0..BESIDE.len() {
                let next = self.next(map, place, direction);
                if is_within(place, direction, next)
                    && let Some(next) = next
                    && !std::mem::replace(&mut is_taken[next as usize], true)
                {
                    places.push(next);
                }
            }
        }
        places.sort_unstable();
        places
    }

    /// Returns whether there is something solid deep below a place.
    fn is_above_something(&self, map: &FloorMap, place: u32) -> bool {
        let spans = map.spans(self.columns[place as usize] as usize);
        spans.first().is_some_and(|lowest| lowest.low < self.heights(place)[0] - ROOF)
    }

    /// Returns whether a place ends at a drop in a direction: there is no wall, and something solid is deep
    /// below, or nothing at all.
    fn is_drop(&self, map: &FloorMap, place: u32, direction: usize) -> bool {
        let floor = self.heights(place)[0];
        let column = self.columns[place as usize] as usize;
        let beside = (0..=3).filter_map(|count| {
            let [x, y] = BESIDE[direction].map(|step| step * count);
            shifted(map, column, [x, y])
        });
        let spans: Vec<_> = beside.flat_map(|column| map.spans(column)).collect();
        let is_wall = spans.iter().any(|span| span.low < floor + BODY && span.high > floor + STEP);
        let is_deep = spans.iter().any(|span| span.low < floor - ROOF);
        !is_wall && (is_deep || spans.iter().all(|span| span.high <= floor + STEP))
    }
}

/// Returns the index of the column some steps from another. `None` outside the map.
fn shifted(map: &FloorMap, column: usize, [x, y]: [i64; 2]) -> Option<usize> {
    let width = map.counts[0];
    let at = [(column % width) as i64 + x, (column / width) as i64 + y];
    let is_within = (0..2).all(|axis| (0..map.counts[axis] as i64).contains(&at[axis]));
    is_within.then(|| at[1] as usize * width + at[0] as usize)
}
