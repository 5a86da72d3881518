//! Tours through a region of places: to its far ends, on short ways that keep away from walls.

use super::floor_map::{COLUMN, FloorMap};
use super::places::{NO_PLACE, Places, Region};
use crate::walk::{CameraKey, through};
use glam::DVec3;
use std::collections::HashMap;

/// Maximum number of places that a tour leads to, including its start.
const MOST_STOPS: usize = 10;
/// Least length in metres of the way to another stop.
const LEAST_WAY: f64 = 4.0;
/// Length of a tour in metres after which no stop is added.
const LENGTH: f64 = 120.0;
/// Greatest distance in metres between two keys.
const SPACING: f64 = 2.5;
/// Distance in metres along the tour from the eye to the point that the camera looks at.
const LOOK_AHEAD: f64 = 3.0;
/// Cost of a step to a place, by the place's distance from the border of the region, in places. The last cost
/// holds for all greater distances.
const COSTS: [u32; 4] = [6, 4, 3, 2];
/// Number of nearby places from which a stop is chosen.
const NEAREST: usize = 60;
/// Maximum number of steps that one straight part of the way replaces.
const STRAIGHT: usize = 60;
/// Greatest difference in metres between the eye's height on a straight part of the way and its usual height
/// above the floor.
const UNEVEN: f32 = 0.3;

/// Makes the camera keys of a tour through a region, relative to the scene's origin. Empty for a region that
/// is too small for a tour.
pub(super) fn keys(map: &FloorMap, places: &Places, region: &Region) -> Vec<CameraKey> {
    let local = LocalPlaces::new(map, places, region);
    let ways = local.tour();
    let eyes: Vec<DVec3> =
        ways.iter().flat_map(|way| local.straightened(way)).map(|at| local.eye(at)).collect();
    through(&eyes, SPACING, LOOK_AHEAD)
}

/// Places of a region, numbered from 0, with their neighbours.
struct LocalPlaces<'a> {
    map: &'a FloorMap,
    places: &'a Places,
    region: &'a Region,
    /// Local number of each place, by its number in the map.
    numbers: HashMap<u32, u32>,
    /// For each place, its four neighbours; [`NO_PLACE`] where there is none.
    beside: Vec<[u32; 4]>,
    /// For each place, its distance from the border in places, up to 3.
    distances: Vec<u8>,
}

impl<'a> LocalPlaces<'a> {
    fn new(map: &'a FloorMap, places: &'a Places, region: &'a Region) -> Self {
        let numbers: HashMap<u32, u32> = region.places.iter().copied().zip(0..).collect();
        let number = |place: Option<u32>| place.and_then(|place| numbers.get(&place).copied());
        let beside: Vec<[u32; 4]> = region
            .places
            .iter()
            .map(|&place| {
                [0, 1, 2, 3].map(|direction| number(places.next(map, place, direction)).unwrap_or(NO_PLACE))
            })
            .collect();
        let mut distances = vec![u8::MAX; beside.len()];
        let is_border = |at: &usize| beside[*at].contains(&NO_PLACE);
        let mut now: Vec<usize> = (0..beside.len()).filter(is_border).collect();
        for distance in 0..COSTS.len() as u8 {
            let mut next = Vec::new();
            for at in now {
                if distances[at] > distance {
                    distances[at] = distance;
                    next.extend(beside[at].iter().filter(|&&to| to != NO_PLACE).map(|&to| to as usize));
                }
            }
            now = next;
        }
        distances.iter_mut().for_each(|distance| *distance = (*distance).min(COSTS.len() as u8 - 1));
        Self { map, places, region, numbers, beside, distances }
    }

    /// Returns the position of the eye at a place.
    fn eye(&self, at: u32) -> DVec3 {
        let place = self.region.places[at as usize];
        self.places.point(self.map, place, self.places.eye_height(place))
    }

    /// Returns for each place the cost of the cheapest way from any of the places `from`, and the place
    /// before it on that way.
    fn ways(&self, from: &[u32]) -> (Vec<u32>, Vec<u32>) {
        let mut costs = vec![u32::MAX; self.beside.len()];
        let mut before = vec![NO_PLACE; self.beside.len()];
        // Queues of places by the cost of the way, modulo a number greater than any step's cost.
        let mut queues: [Vec<u32>; 8] = Default::default();
        from.iter().for_each(|&at| costs[at as usize] = 0);
        queues[0] = from.to_vec();
        let (mut cost, mut waiting) = (0_u32, from.len());
        while waiting > 0 {
            for at in std::mem::take(&mut queues[cost as usize % 8]) {
                waiting -= 1;
                if costs[at as usize] != cost {
                    continue;
                }
                for &to in self.beside[at as usize].iter().filter(|&&to| to != NO_PLACE) {
                    let then = cost + COSTS[self.distances[to as usize] as usize];
                    if then < costs[to as usize] {
                        (costs[to as usize], before[to as usize]) = (then, at);
                        queues[then as usize % 8].push(to);
                        waiting += 1;
                    }
                }
            }
            cost += 1;
        }
        (costs, before)
    }

    /// Returns the place with the greatest cost.
    fn farthest(costs: &[u32]) -> (u32, u32) {
        let mut found = (0, 0);
        for (at, &cost) in costs.iter().enumerate() {
            if cost != u32::MAX && cost > found.1 {
                found = (at as u32, cost);
            }
        }
        found
    }

    /// Returns the place farthest from the border among the nearest places around `at`, since the camera
    /// should not look around in a corner.
    fn inwards(&self, at: u32) -> u32 {
        let mut near = vec![at];
        let mut done = 0;
        while let Some(&at) = near.get(done).filter(|_| near.len() < NEAREST) {
            done += 1;
            for &to in self.beside[at as usize].iter().filter(|&&to| to != NO_PLACE) {
                if !near.contains(&to) {
                    near.push(to);
                }
            }
        }
        // If several places are equally far from the border, the first of `near`, the nearest to `at`, wins.
        near.into_iter().rev().max_by_key(|&at| self.distances[at as usize]).unwrap_or(at)
    }

    /// Returns the ways from each stop of a tour to the next. The stops are the far ends of the region.
    fn tour(&self) -> Vec<Vec<u32>> {
        let least = (LEAST_WAY / COLUMN) as u32 * COSTS[COSTS.len() - 1];
        let start = self.inwards(Self::farthest(&self.ways(&[0]).0).0);
        let mut stops = vec![start];
        while stops.len() < MOST_STOPS {
            let (farthest, cost) = Self::farthest(&self.ways(&stops).0);
            let stop = self.inwards(farthest);
            if cost < least || stops.contains(&stop) {
                break;
            }
            stops.push(stop);
        }
        let (mut ways, mut steps) = (Vec::new(), 0);
        let mut left = stops.split_off(1);
        let mut at = start;
        while !left.is_empty() && f64::from(steps) * COLUMN < LENGTH {
            let (costs, before) = self.ways(&[at]);
            let nearest =
                (0..left.len()).min_by_key(|&index| costs[left[index] as usize]).unwrap_or_default();
            let to = left.swap_remove(nearest);
            let mut part = vec![to];
            while let Some(&last) = part.last()
                && before[last as usize] != NO_PLACE
            {
                part.push(before[last as usize]);
            }
            steps += part.len() as u32;
            part.reverse();
            ways.push(part);
            at = to;
        }
        ways
    }

    /// Returns the places of a way where it turns. Between two of them one can walk straight.
    fn straightened(&self, way: &[u32]) -> Vec<u32> {
        let mut kept: Vec<u32> = way.first().copied().into_iter().collect();
        let mut at = 0;
        while at + 1 < way.len() {
            let last = (at + STRAIGHT).min(way.len() - 1);
            at = (at + 1..=last).rev().find(|&to| self.is_straight(way[at], way[to])).unwrap_or(at + 1);
            kept.push(way[at]);
        }
        kept
    }

    /// Returns whether one can walk straight from one place to another, with the eye near its usual height.
    fn is_straight(&self, from: u32, to: u32) -> bool {
        let [from, to] = [from, to].map(|at| self.region.places[at as usize]);
        let [start, end] = [from, to].map(|place| self.places.column(self.map, place));
        let [low, high] = [from, to].map(|place| self.places.eye_height(place));
        let length = (0..2).map(|axis| (end[axis] - start[axis]).abs()).max().unwrap_or_default();
        // The line is checked in steps of half a column, so it stays within half a column of the checked
        // places.
        let (mut place, mut column) = (from, start);
        for step in 1..=2 * length {
            let part = step as f64 / (2 * length) as f64;
            let next = [0, 1]
                .map(|axis| (start[axis] as f64 + (end[axis] - start[axis]) as f64 * part).round() as i64);
            if next != column {
                let beside = self.places.beside(self.map, place, [next[0] - column[0], next[1] - column[1]]);
                let Some(beside) = beside.filter(|beside| self.numbers.contains_key(beside)) else {
                    return false;
                };
                (place, column) = (beside, next);
            }
            let height = low + (high - low) * part as f32;
            if (self.places.eye_height(place) - height).abs() > UNEVEN {
                return false;
            }
        }
        place == to
    }
}
