//! Worlds that resemble a game's map: terraces of large abutting panels with T-joints, parapets, decals in
//! the planes of panels, splinters, and triangles much larger than a room, on grids of several widths or
//! none. The check accepts every proof that the search finds.

use crate::common::{Triangle, check, few_rays, prepared};
use visibility_core::glam::{DQuat, DVec3};
use visibility_core::pvs::Viewcell;
use visibility_exact::{Effort, ExactCuller, ExactSettings};
use visibility_testing::{Random, judged, told_enough};

/// Triangles of a map. Coordinates are multiples of `grid` metres before `turn` is applied; with a `grid` of
/// 0 they are not rounded.
struct Map {
    random: Random,
    grid: f64,
    turn: DQuat,
    objects: Vec<Vec<Triangle>>,
}

impl Map {
    fn range(&mut self, from: f64, to: f64) -> f64 {
        self.random.fine_range(from, to)
    }

    /// Adds a polygon as a fan of triangles around a random corner. Each triangle is an object of its own.
    fn polygon(&mut self, corners: &[DVec3]) {
        let first = self.random.below(corners.len());
        let at = |k: usize| {
            let corner = corners[(first + k) % corners.len()];
            let snapped = if self.grid > 0.0 { (corner / self.grid).round() * self.grid } else { corner };
            (self.turn * snapped).as_vec3()
        };
        let fan: Vec<Triangle> = (1..corners.len() - 1).map(|k| [at(0), at(k), at(k + 1)]).collect();
        self.objects.extend(fan.into_iter().map(|t| vec![t]));
    }

    /// Adds a strip of panels between two lines along z; `a` and `b` are the lines' x and y. Panels end at
    /// the z in `places`. Some have a further corner, where neighbours meet in a T-joint.
    fn strip(&mut self, [a, b]: [[f64; 2]; 2], places: &[f64]) {
        for pair in places.windows(2) {
            let at = |line: [f64; 2], z: f64| DVec3::new(line[0], line[1], z);
            let [from, to] = [pair[0], pair[1]];
            match self.random.below(4) {
                0 => {
                    let middle = self.range(from, to);
                    self.polygon(&[at(a, from), at(a, middle), at(a, to), at(b, to), at(b, from)]);
                }
                1 => {
                    let middle = self.range(from, to);
                    self.polygon(&[at(a, from), at(b, middle), at(b, from)]);
                    self.polygon(&[at(a, from), at(a, to), at(b, to), at(b, middle)]);
                }
                2 => self.polygon(&[at(a, from), at(a, to), at(b, to)]),
                _ => self.polygon(&[at(a, from), at(a, to), at(b, to), at(b, from)]),
            }
        }
    }
}

/// Makes a viewcell, and a terrace beside and above it: floors that rise with the distance, each with a
/// parapet.
fn map(number: u64) -> (Viewcell, Vec<Vec<Triangle>>) {
    let mut random = Random(number + 1);
    let grid = [1.0, 0.5, 0.0, 0.125][number as usize % 4];
    let turn = match number % 3 {
        2 => DQuat::from_rotation_y(random.fine_range(-0.5, 0.5)),
        _ => DQuat::IDENTITY,
    };
    let mut map = Map { random, grid, turn, objects: Vec::new() };
    let mut places: Vec<f64> = (0..4).map(|_| map.range(-9.0, 9.0)).collect();
    places.sort_by(f64::total_cmp);
    let (mut x, mut y) = (8.0, 2.0);
    for _ in 0..2 {
        let (depth, rise, parapet) = (map.range(1.0, 3.0), map.range(1.0, 3.0), map.range(0.5, 2.0));
        map.strip([[x, y], [x, y + rise]], &places);
        y += rise;
        map.strip([[x, y], [x, y + parapet]], &places);
        map.strip([[x, y], [x + depth, y]], &places);
        x += depth;
    }
    map.strip([[x, y], [x, y + 2.0]], &places);
    let (y, z) = (map.range(1.0, 5.0), map.range(-5.0, 5.0));
    map.polygon(&[DVec3::new(8.0, y, z), DVec3::new(8.0, y + 1.0, z), DVec3::new(8.0, y, z + 2.0)]);
    map.polygon(&[DVec3::new(6.0, y, z), DVec3::new(6.0, y + 0.001, z), DVec3::new(6.0, y, z + 20.0)]);
    if number.is_multiple_of(2) {
        let far = map.range(100.0, 1000.0);
        map.polygon(&[DVec3::new(-far, 0.0, -far), DVec3::new(far, 0.0, -far), DVec3::new(0.0, 0.0, far)]);
    }
    let size = DVec3::new(map.range(0.5, 2.0), map.range(0.2, 1.0), map.range(0.5, 2.0));
    let min = DVec3::new(map.range(-9.0, 0.0), map.range(0.5, 2.0), map.range(-9.0, 9.0));
    let min = if grid > 0.0 { (min / grid).round() * grid } else { min };
    (Viewcell::from_box(min, min + size), map.objects)
}

/// Decides maps. Returns the numbers of objects seen, hidden and open, and the number of proofs.
fn decide(maps: std::ops::Range<u64>, c: f64) -> [usize; 4] {
    let mut counts = [0; 4];
    for number in maps {
        let (cell, objects) = map(number);
        let triangles = prepared(&objects);
        let settings = few_rays(ExactSettings::new(Effort::Exact(c)));
        let found = ExactCuller::new(triangles.clone(), settings).verdicts(&cell);
        for (sum, count) in counts.iter_mut().zip(found.counts()) {
            *sum += count;
        }
        counts[3] += check(&objects, &triangles, &found);
    }
    counts
}

#[test]
fn proofs_in_maps_hold() {
    for c in [1e-4, 1e-2] {
        let counts = decide(0..60, c);
        judged(counts[..3].iter().sum::<usize>() as u64);
        told_enough(counts[0] > 500 && counts[1] > 300 && counts[3] > 300, format_args!("{counts:?}"));
    }
}

/// Returns a wall, a sill on it and a wall on the sill, as objects, and a viewcell. The surface that hides
/// the triangle behind has a strip that leaves the surface's plane and ends at a corner of the triangle.
fn wall_and_sill() -> (Vec<Vec<[DVec3; 3]>>, [DVec3; 2]) {
    let objects: [&[[[f64; 3]; 3]]; 4] = [
        &[
            [[8.0, 4.0, -6.0], [8.0, 4.0, -8.0], [8.0, 0.0, -6.0]],
            [[8.0, 0.5, -4.0], [8.0, 4.0, -6.0], [8.0, 0.0, -6.0]],
            [[8.0, 0.5, -4.0], [8.0, 6.0, -4.0], [8.0, 4.0, -6.0]],
        ],
        &[
            [[-12.0, 8.0, 8.0], [-12.0, 8.0, 6.0], [-12.0, 8.5, 9.8]],
            [[-12.0, 8.0, 6.0], [-12.0, 6.0, 4.0], [-12.0, 8.0, 4.0]],
            [[-12.0, 8.0, 11.0], [-12.0, 8.0, 8.0], [-12.0, 8.5, 9.8]],
        ],
        &[[[-13.0, 8.0, 6.0], [-13.0, 8.5, 9.7], [-13.0, 8.0, 4.0]]],
        &[[[-13.0, 8.0, 6.0], [-12.0, 8.0, 6.0], [-12.0, 8.0, 8.0]]],
    ];
    let objects = objects.map(|object| object.iter().map(|t| t.map(DVec3::from_array)).collect());
    (objects.to_vec(), [DVec3::new(15.0, 1.0, -10.0), DVec3::new(17.0, 1.5, -8.0)])
}

/// Decides objects of triangles from a viewcell's box. Returns the number of proofs, and the numbers of
/// objects seen, hidden and open.
fn decide_from([a, b]: [DVec3; 2], objects: &[Vec<Triangle>]) -> (usize, [usize; 3]) {
    let triangles = prepared(objects);
    let settings = few_rays(ExactSettings::new(Effort::Exact(1e-4)));
    let found =
        ExactCuller::new(triangles.clone(), settings).verdicts(&Viewcell::from_box(a.min(b), a.max(b)));
    (check(objects, &triangles, &found), found.counts())
}

#[test]
fn a_strip_out_of_plane_is_apart_from_whichever_end_it_is_looked_at() {
    let (objects, cell) = wall_and_sill();
    let objects: Vec<Vec<Triangle>> =
        objects.iter().map(|object| object.iter().map(|t| t.map(DVec3::as_vec3)).collect()).collect();
    assert_eq!(decide_from(cell, &objects), (1, [3, 1, 0]), "one target: counts of its verdicts");
}

/// Returns a variation of [`wall_and_sill`] and its viewcell. All corners and the viewcell are moved by small
/// steps, where coinciding corners stay together. Then axes are exchanged and mirrored, and all is scaled and
/// moved. Objects, triangles and their corners are shuffled.
fn like_wall_and_sill(random: &mut Random) -> ([DVec3; 2], Vec<Vec<Triangle>>) {
    let (mut objects, cell) = wall_and_sill();
    let step = random.pick(&[0.0, 0.001, 0.02, 0.1]);
    let steps = |random: &mut Random, most: i32, step: f64| {
        DVec3::from_array(core::array::from_fn(|_| f64::from(random.between(-most, most)) * step))
    };
    let mut corners: Vec<DVec3> = objects.iter().flatten().flatten().copied().collect();
    corners.sort_by_key(|v| v.to_array().map(|x| (x * 10.0) as i32));
    corners.dedup();
    let moves: Vec<DVec3> = corners.iter().map(|_| steps(random, 2, step)).collect();
    let cell_move = steps(random, 4, 0.25);
    let (first, is_odd) = (random.below(3), random.one_in(2));
    let mirror = DVec3::from_array(core::array::from_fn(|_| random.pick(&[1.0, -1.0])));
    let scale = random.pick(&[0.5, 1.0, 2.0, 1.7]);
    let shift = random.pick(&[0.0, 1.0, 50.3]) * steps(random, 4, 0.5);
    let place = |v: DVec3| {
        let (j, k) = ((first + 1) % 3, (first + 2) % 3);
        let [j, k] = if is_odd { [k, j] } else { [j, k] };
        DVec3::new(v[first], v[j], v[k]) * mirror * scale + shift
    };
    for corner in objects.iter_mut().flatten().flatten() {
        let at = corners.iter().position(|v| v == corner).unwrap();
        *corner = place(*corner + moves[at]);
    }
    for triangles in &mut objects {
        for t in triangles.iter_mut() {
            shuffle(t, random);
        }
        shuffle(triangles, random);
    }
    shuffle(&mut objects, random);
    let objects =
        objects.iter().map(|object| object.iter().map(|t| t.map(DVec3::as_vec3)).collect()).collect();
    (cell.map(|v| place(v + cell_move)), objects)
}

fn shuffle<T>(list: &mut [T], random: &mut Random) {
    for last in (1..list.len()).rev() {
        list.swap(last, random.below(last + 1));
    }
}

#[test]
fn strips_out_of_plane_are_apart_in_worlds_like_that() {
    let mut random = Random(11);
    let (mut proofs, mut hidden) = (0, 0);
    for _ in 0..1000 {
        let (cell, objects) = like_wall_and_sill(&mut random);
        let (found, counts) = decide_from(cell, &objects);
        (proofs, hidden) = (proofs + found, hidden + counts[1]);
    }
    assert!(proofs > 200 && hidden > 200, "{proofs} proofs, {hidden} hidden");
}
