//! Tests of visible discs by rays. An independent oracle finds each disc that a ray between two neighbouring
//! tangents meets first.

use std::collections::BTreeSet;
#[cfg(feature = "papers")]
use visibility_2d::discs::KineticZone;
use visibility_2d::discs::{Disc, DiscError, DiscView, DiscZone, Discs};
use visibility_testing::allocations::ALLOCATIONS;
use visibility_testing::{Random, judged, told_enough};

/// Discs whose nearest point is in range by less than the rounding of the square of their distance, and one
/// that contains the eye.
#[test]
fn wide_discs_are_in_range_up_to_rounding() {
    for (center, radius, range) in [
        ([-972.9409525764271, -231.05822383259726], 1000.0, 0.001),
        ([-9.995421919562533, 0.3025568870953727], 10.0, 1e-9),
        ([-9.163241953850894, -4.004621942853887], 10.0, 1e-4),
        ([46.320986221312836, 18.82727374010763], 50.0, 1e-3),
        ([1.59e-162, 1.59e-162], 0.0, 2.5e-162),
        ([-0.23160333342556502, -0.04720229315975793], 0.23636446546249962, 0.0),
        ([-0.23160333342556502, -0.04720229315975793], 0.23636446546249962, f64::NAN),
    ] {
        let discs = Discs::new(&[Disc { center, radius }]).unwrap();
        let mut seen = Vec::new();
        DiscZone::new().look(&discs, &DiscView::new([0.0; 2]).with_range(range), &mut seen);
        assert_eq!(seen, [0], "a disc of {radius} around {center:?}, up to {range}");
    }
}

/// Squares of these coordinates have four digits left. The second disc is seen beside the first.
#[test]
fn discs_whose_squares_underflow_hide_nothing() {
    let discs = [
        Disc { center: [1.5072654543702114e-160, 6.845440245415757e-161], radius: 1.1566059434494078e-160 },
        Disc { center: [1.6796258133116618e-160, 4.3203741866883384e-160], radius: 1e-164 },
    ];
    let (discs, mut seen) = (Discs::new(&discs).unwrap(), Vec::new());
    DiscZone::new().look(&discs, &DiscView::new([0.0; 2]), &mut seen);
    seen.sort_unstable();
    assert_eq!(seen, [0, 1], "both are seen");
}

/// Returns the first disc that a ray meets and its distance, by testing all discs.
fn first(discs: &[Disc], eye: [f64; 2], angle: f64) -> Option<(usize, f64)> {
    let (sin, cos) = angle.sin_cos();
    let mut best: Option<(usize, f64)> = None;
    for (index, disc) in discs.iter().enumerate() {
        let (x, y) = (disc.center[0] - eye[0], disc.center[1] - eye[1]);
        let (ahead, aside) = (x * cos + y * sin, x * sin - y * cos);
        if aside.abs() >= disc.radius || ahead <= 0.0 || x.hypot(y) <= disc.radius {
            continue;
        }
        let at = ahead - (disc.radius * disc.radius - aside * aside).sqrt();
        if best.is_none_or(|(_, nearest)| at < nearest) {
            best = Some((index, at));
        }
    }
    best
}

/// Returns the discs seen between neighbouring tangents that are at least `width` apart in angle.
fn oracle(discs: &[Disc], eye: [f64; 2], width: f64) -> BTreeSet<u32> {
    let mut angles = Vec::new();
    for disc in discs {
        let (x, y) = (disc.center[0] - eye[0], disc.center[1] - eye[1]);
        let distance = x.hypot(y);
        if distance > disc.radius {
            let (middle, half) = (y.atan2(x), (disc.radius / distance).asin());
            angles.extend([middle - half, middle + half].map(|a| a.rem_euclid(std::f64::consts::TAU)));
        }
    }
    // If discs overlap, the nearest disc also changes at crossings of their circles.
    for (i, a) in discs.iter().enumerate() {
        for b in &discs[..i] {
            let (dx, dy) = (b.center[0] - a.center[0], b.center[1] - a.center[1]);
            let d = dx.hypot(dy);
            if d < a.radius + b.radius && d > (a.radius - b.radius).abs() {
                let along = (d * d + a.radius * a.radius - b.radius * b.radius) / (2.0 * d);
                let half = (a.radius * a.radius - along * along).max(0.0).sqrt();
                for side in [-1.0, 1.0] {
                    let x = a.center[0] + (dx * along - side * dy * half) / d - eye[0];
                    let y = a.center[1] + (dy * along + side * dx * half) / d - eye[1];
                    angles.push(y.atan2(x).rem_euclid(std::f64::consts::TAU));
                }
            }
        }
    }
    angles.sort_by(f64::total_cmp);
    let mut seen = BTreeSet::new();
    for i in 0..angles.len() {
        let next = if i + 1 < angles.len() { angles[i + 1] } else { angles[0] + std::f64::consts::TAU };
        if next - angles[i] > width {
            seen.extend(first(discs, eye, 0.5 * (angles[i] + next)).map(|(index, _)| index as u32));
        }
    }
    seen
}

/// Makes discs with random positions and sizes, disjoint unless `overlapping`.
fn forest(random: &mut Random, count: usize, overlapping: bool) -> Vec<Disc> {
    let mut discs: Vec<Disc> = Vec::new();
    let size = (count as f64).sqrt() * [1.2, 3.0, 8.0][random.below(3)];
    for _ in 0..count {
        let center = [random.fine_range(0.0, size), random.fine_range(0.0, size)];
        let radius = random.fine_range(0.05, 1.0);
        let apart = |disc: &Disc| {
            (disc.center[0] - center[0]).hypot(disc.center[1] - center[1]) > disc.radius + radius
        };
        if overlapping || discs.iter().all(apart) {
            discs.push(Disc { center, radius });
        }
    }
    discs
}

#[test]
fn the_zone_of_disjoint_discs_is_what_rays_meet_first() {
    let mut random = Random(1);
    let (mut zone, mut seen, mut reported) = (DiscZone::new(), Vec::new(), 0);
    for round in 0..600 {
        let count = 1 + random.below(120);
        let discs = forest(&mut random, count, false);
        let made = Discs::new(&discs).unwrap();
        let eye = [random.fine_range(-2.0, 14.0), random.fine_range(-2.0, 14.0)];
        zone.look(&made, &DiscView::new(eye), &mut seen);
        let zone: BTreeSet<u32> = seen.iter().copied().collect();
        assert_eq!(zone.len(), seen.len(), "each disc once");
        // A disc around the eye is reported, although no ray meets it from outside.
        let around = |i: &u32| {
            let disc = &discs[*i as usize];
            (disc.center[0] - eye[0]).hypot(disc.center[1] - eye[1]) <= disc.radius
        };
        let wide = oracle(&discs, eye, 1e-9);
        let narrow = oracle(&discs, eye, 1e-14);
        assert!(wide.is_subset(&zone), "round {round}: {:?} not reported", wide.difference(&zone));
        let zone: BTreeSet<u32> = zone.into_iter().filter(|i| !around(i)).collect();
        assert!(zone.is_subset(&narrow), "round {round}: {:?} not seen", zone.difference(&narrow));
        reported += zone.len();
    }
    assert!(reported > 3_000, "{reported}");
}

#[test]
fn overlapping_discs_never_hide_what_is_seen() {
    let mut random = Random(2);
    let (mut zone, mut seen, mut hidden) = (DiscZone::new(), Vec::new(), 0);
    for round in 0..2_500 {
        let count = 1 + random.below(40);
        let discs = forest(&mut random, count, true);
        let made = Discs::new(&discs).unwrap();
        let eye = [random.fine_range(-2.0, 12.0), random.fine_range(-2.0, 12.0)];
        zone.look(&made, &DiscView::new(eye), &mut seen);
        let set: BTreeSet<u32> = seen.iter().copied().collect();
        let wide = oracle(&discs, eye, 1e-9);
        assert!(wide.is_subset(&set), "round {round}: {:?} not reported", wide.difference(&set));
        hidden += discs.len() - set.len();
    }
    assert!(hidden > 2_000, "{hidden}");
}

#[test]
fn a_ball_sees_what_any_of_its_eyes_sees() {
    let mut random = Random(3);
    let (mut zone, mut seen, mut hidden) = (DiscZone::new(), Vec::new(), 0);
    for round in 0..300 {
        let overlapping = random.below(3) == 0;
        let discs = forest(&mut random, 80, overlapping);
        let made = Discs::new(&discs).unwrap();
        let eye = [random.fine_range(0.0, 12.0), random.fine_range(0.0, 12.0)];
        let ball = random.fine_range(0.01, 0.3);
        zone.look(&made, &DiscView::new(eye).with_ball(ball), &mut seen);
        let set: BTreeSet<u32> = seen.iter().copied().collect();
        for _ in 0..4 {
            let angle = random.fine_range(0.0, 7.0);
            let by = ball * random.fine_unit();
            let moved = [eye[0] + by * angle.cos(), eye[1] + by * angle.sin()];
            let wide = oracle(&discs, moved, 1e-9);
            assert!(wide.is_subset(&set), "round {round}: {:?} not reported", wide.difference(&set));
        }
        hidden += discs.len() - set.len();
    }
    judged(1200);
    told_enough(hidden > 3_000, format_args!("{hidden}"));
}

/// Walks among random discs in steps of random length. In each frame, the updated zone must equal the zone
/// computed from scratch, and contain all discs that the oracle sees.
#[cfg(feature = "papers")]
fn walk(worlds: usize, frames: usize) {
    let mut random = Random(10);
    let (mut zone, mut exact) = (DiscZone::new(), Vec::new());
    let (mut steps, mut ended, mut rebuilt, mut quiet) = (0, 0, 0, 0);
    for world in 0..worlds {
        let count = 1 + random.below(150);
        let discs = forest(&mut random, count, world % 10 == 9);
        let made = Discs::new(&discs).unwrap();
        let mut kept = KineticZone::new(&made, random.fine_range(0.1, 4.0));
        let mut eye = [random.fine_range(-2.0, 14.0), random.fine_range(-2.0, 14.0)];
        let (mut turn, step) = (random.fine_range(0.0, 7.0), random.fine_range(0.001, 0.2));
        for frame in 0..frames {
            turn += random.fine_range(-0.3, 0.3);
            eye = [eye[0] + step * turn.cos(), eye[1] + step * turn.sin()];
            if !(-4.0..18.0).contains(&eye[0]) || !(-4.0..18.0).contains(&eye[1]) {
                // The eye jumps to a random position.
                eye = [random.fine_range(0.0, 12.0), random.fine_range(0.0, 12.0)];
            }
            let seen = kept.move_to(eye);
            let set: BTreeSet<u32> = seen.iter().copied().collect();
            assert_eq!(set.len(), seen.len(), "each disc once");
            zone.look(&made, &DiscView::new(eye), &mut exact);
            assert_eq!(set, exact.iter().copied().collect(), "world {world}, frame {frame}, eye {eye:?}");
            if frame % 8 == 0 {
                let wide = oracle(&discs, eye, 1e-9);
                assert!(wide.is_subset(&set), "world {world}: {:?} not reported", wide.difference(&set));
            }
            let work = kept.work();
            (steps, ended) = (steps + work.steps, ended + work.ended);
            rebuilt += usize::from(work.rebuilt);
            quiet += usize::from(work.ended == 0 && !work.rebuilt);
        }
    }
    judged((worlds * frames) as u64);
    told_enough(
        steps > 100 * worlds && 10 * quiet > worlds * frames && 2 * rebuilt < worlds * frames,
        format_args!("{steps} steps, {quiet} quiet and {rebuilt} rebuilt frames in {worlds} worlds"),
    );
}

#[cfg(feature = "papers")]
#[test]
fn the_kept_zone_is_the_exact_zone_along_walks() {
    walk(80, 120);
}

#[cfg(feature = "papers")]
#[test]
fn the_kept_zone_of_odd_input_is_that_from_scratch() {
    let at = |x: f64, radius: f64| Disc { center: [x, 0.0], radius };
    let (mut zone, mut exact) = (DiscZone::new(), Vec::new());
    let touching = [at(5.0, 1.0), at(7.0, 1.0), at(0.0, 0.5)];
    let point = [at(5.0, 1.0), at(-3.0, 0.0)];
    let grid: Vec<Disc> = (0..81)
        .map(|i| [f64::from(i % 9), f64::from(i / 9)])
        .map(|center| Disc { center, radius: 0.25 })
        .collect();
    let far = [at(1e50, 1e49), at(-1e50, 1.0), at(1e-30, 1e-31)];
    for discs in [&touching[..], &point, &grid, &far, &[]] {
        let made = Discs::new(discs).unwrap();
        for reach in [f64::NAN, -1.0, 0.0, 1e-300, 1.0, f64::INFINITY] {
            let mut kept = KineticZone::new(&made, reach);
            let walk = (0..60).map(|k| [0.125 * f64::from(k) - 2.0, 0.5]);
            let through = (0..60).map(|k| [0.125 * f64::from(k) - 2.0, 0.0]);
            let odd = [[f64::NAN, 0.0], [f64::INFINITY, 1.0], [1e200, 0.0], [1e50, 0.0], [0.0, 0.0]];
            for eye in walk.chain(through).chain(odd) {
                let mut seen = kept.move_to(eye).to_vec();
                zone.look(&made, &DiscView::new(eye), &mut exact);
                seen.sort_unstable();
                exact.sort_unstable();
                assert_eq!(seen, exact, "{reach} {eye:?}");
            }
        }
    }
}

#[test]
fn warm_looks_allocate_nothing() {
    let discs = forest(&mut Random(7), 400, false);
    let made = Discs::new(&discs).unwrap();
    let (mut zone, mut seen) = (DiscZone::new(), Vec::new());
    #[cfg(feature = "papers")]
    let mut kept = KineticZone::new(&made, 1.0);
    let mut looks = || {
        let before = ALLOCATIONS.get();
        for eye in (0..50).map(|k| [0.4 * f64::from(k), 5.0]) {
            zone.look(&made, &DiscView::new(eye), &mut seen);
            #[cfg(feature = "papers")]
            kept.move_to(eye);
        }
        ALLOCATIONS.get() - before
    };
    assert!(looks() > 0, "allocations are counted");
    assert_eq!(looks(), 0, "allocations in warm looks");
}

#[test]
fn sectors_and_ranges_leave_out_the_rest_only() {
    let mut random = Random(4);
    let (mut zone, mut all, mut some) = (DiscZone::new(), Vec::new(), Vec::new());
    for round in 0..300 {
        let discs = forest(&mut random, 100, false);
        let made = Discs::new(&discs).unwrap();
        let eye = [random.fine_range(0.0, 12.0), random.fine_range(0.0, 12.0)];
        // Sectors of any width up to a full turn.
        let pi = std::f64::consts::PI;
        let half = [random.fine_range(0.01, 3.0), random.fine_range(3.0, pi), pi][round % 3];
        let middle = random.fine_range(-3.0, 3.0);
        let ends = [middle - half, middle + half].map(|a| [a.cos(), a.sin()]);
        // Where sine and cosine round a full turn up, the sector is about a single direction.
        let [p, q] = [ends[0][0] * ends[1][1], ends[0][1] * ends[1][0]];
        let errors = ends[0][0].mul_add(ends[1][1], -p) - ends[0][1].mul_add(ends[1][0], -q);
        if half == pi && p - q + errors >= 0.0 {
            continue;
        }
        let range = random.fine_range(0.5, 12.0);
        zone.look(&made, &DiscView::new(eye), &mut all);
        zone.look(&made, &DiscView::new(eye).with_sector(ends[0], ends[1]).with_range(range), &mut some);
        assert!(some.iter().all(|i| all.contains(i)), "round {round}");
        for sample in 0..200 {
            let angle = middle - half + 2.0 * half * (f64::from(sample) + 0.5) / 200.0;
            let Some((index, distance)) = first(&discs, eye, angle) else { continue };
            let is_near = |by: f64| distance < range + by;
            let is_in = some.contains(&(index as u32));
            assert!(is_in || !is_near(-1e-9), "round {round}: {index} at {distance} of {range}");
        }
        let nearest = |i: &u32| {
            let d = &discs[*i as usize];
            (d.center[0] - eye[0]).hypot(d.center[1] - eye[1]) - d.radius
        };
        assert!(some.iter().all(|i| nearest(i) <= range + 1e-9), "round {round}");
    }
}

#[test]
fn odd_input_has_defined_answers() {
    let good = Disc { center: [1.0, 2.0], radius: 0.5 };
    for bad in [
        Disc { center: [f64::NAN, 0.0], ..good },
        Disc { center: [0.0, f64::INFINITY], ..good },
        Disc { radius: -1.0, ..good },
        Disc { radius: f64::NAN, ..good },
        Disc { center: [1e300, 0.0], ..good },
    ] {
        assert_eq!(
            Discs::new(&[good, bad]).err(),
            Some(DiscError::Disc { index: 1 }),
            "the index of {bad:?}"
        );
    }
    let (mut zone, mut seen) = (DiscZone::new(), Vec::new());
    let none = Discs::new(&[]).unwrap();
    zone.look(&none, &DiscView::new([0.0, 0.0]), &mut seen);
    assert!(none.is_empty() && seen.is_empty(), "no discs, none seen");
    // Discs that coincide, are concentric, touch, or have radius 0.
    let at = |x: f64, radius: f64| Disc { center: [x, 0.0], radius };
    let odd = [at(5.0, 1.0), at(5.0, 1.0), at(5.0, 0.5), at(7.0, 1.0), at(20.0, 0.0), at(-3.0, 0.0)];
    let discs = Discs::new(&odd).unwrap();
    zone.look(&discs, &DiscView::new([0.0, 0.0]), &mut seen);
    assert!(seen.contains(&0) && seen.contains(&1) && seen.contains(&5), "{seen:?}");
    // Eyes inside a disc, at its centre, on its circle, and at a disc of radius 0.
    for eye in [[5.2, 0.0], [5.0, 0.0], [4.0, 0.0], [-3.0, 0.0]] {
        zone.look(&discs, &DiscView::new(eye), &mut seen);
        assert!(!seen.is_empty(), "{eye:?}");
    }
    for eye in [[f64::NAN, 0.0], [f64::INFINITY, 0.0], [1e200, 1.0]] {
        zone.look(&discs, &DiscView::new(eye), &mut seen);
        assert_eq!(seen.len(), odd.len(), "from {eye:?}: all discs");
    }
    for view in [
        DiscView::new([0.0; 2]).with_ball(f64::NAN),
        DiscView::new([0.0; 2]).with_ball(f64::INFINITY),
        DiscView::new([0.0; 2]).with_range(f64::NAN),
        DiscView::new([0.0; 2]).with_sector([0.0; 2], [f64::NAN, 1.0]),
    ] {
        zone.look(&discs, &view, &mut seen);
    }
}

/// Grid with a list of discs per square, for rays that walk from square to square.
struct Grid {
    side: f64,
    count: usize,
    squares: Vec<Vec<u32>>,
}

impl Grid {
    /// Makes a forest of disjoint discs, with its grid of `count` by `count` squares with sides of `side`
    /// metres.
    fn forest(random: &mut Random, discs: usize, radius: f64, count: usize, side: f64) -> (Self, Vec<Disc>) {
        let mut grid = Self { side, count, squares: vec![Vec::new(); count * count] };
        let mut forest: Vec<Disc> = Vec::with_capacity(discs);
        let size = count as f64 * side;
        while forest.len() < discs {
            let center = [random.fine_range(0.0, size), random.fine_range(0.0, size)];
            let radius = radius * random.fine_range(0.7, 1.3);
            let [x, y] = center.map(|x| (x / side) as usize);
            let near = (x.max(1) - 1..(x + 2).min(count))
                .flat_map(|x| (y.max(1) - 1..(y + 2).min(count)).map(move |y| x * count + y));
            let is_free = near.flat_map(|square| &grid.squares[square]).all(|&other| {
                let other: Disc = forest[other as usize];
                (other.center[0] - center[0]).hypot(other.center[1] - center[1]) > other.radius + radius
            });
            if is_free {
                grid.squares[x * count + y].push(forest.len() as u32);
                forest.push(Disc { center, radius });
            }
        }
        (grid, forest)
    }

    /// Returns the first disc that a ray meets. Discs may reach at most `side` beyond their squares.
    fn first(&self, forest: &[Disc], eye: [f64; 2], angle: f64) -> Option<u32> {
        let (sin, cos) = angle.sin_cos();
        let (mut best, mut distance) = (None, f64::INFINITY);
        let mut at = 0.0;
        // Squares around points at every half side contain all discs that the ray meets up to there.
        while at < distance + self.side {
            let [x, y] = [eye[0] + cos * at, eye[1] + sin * at].map(|x| (x / self.side).floor());
            let size = self.count as f64;
            if x < -1.0 || y < -1.0 || x > size || y > size {
                break;
            }
            for (dx, dy) in (0..9).map(|i| (f64::from(i / 3 - 1), f64::from(i % 3 - 1))) {
                let (x, y) = (x + dx, y + dy);
                if x < 0.0 || y < 0.0 || x >= size || y >= size {
                    continue;
                }
                for &index in &self.squares[x as usize * self.count + y as usize] {
                    let disc = forest[index as usize];
                    let (x, y) = (disc.center[0] - eye[0], disc.center[1] - eye[1]);
                    let (ahead, aside) = (x * cos + y * sin, x * sin - y * cos);
                    if aside.abs() < disc.radius && ahead > 0.0 && x.hypot(y) > disc.radius {
                        let meets = ahead - (disc.radius * disc.radius - aside * aside).sqrt();
                        if meets < distance {
                            (best, distance) = (Some(index), meets);
                        }
                    }
                }
            }
            at += 0.5 * self.side;
        }
        best
    }
}

/// Casts rays from eyes and from balls of eyes in a forest. Returns the number of hidden discs.
fn cast(count: usize, squares: usize, radii: &[f64], eyes: usize, rays: usize) {
    for &radius in radii {
        let mut random = Random(9);
        let (grid, forest) = Grid::forest(&mut random, count, radius, squares, 4.5);
        let discs = Discs::new(&forest).unwrap();
        let (mut zone, mut seen, mut set) = (DiscZone::new(), Vec::new(), vec![false; count]);
        let mut total = 0;
        for _ in 0..eyes {
            let size = 4.5 * squares as f64;
            let eye = [random.fine_range(0.0, size), random.fine_range(0.0, size)];
            let ball = [0.0, 0.0, 0.05, 0.2][random.below(4)];
            zone.look(&discs, &DiscView::new(eye).with_ball(ball), &mut seen);
            total += seen.len();
            seen.iter().for_each(|&index| set[index as usize] = true);
            for _ in 0..rays {
                let (turn, by) = (random.fine_range(0.0, 7.0), ball * random.fine_unit());
                let from = [eye[0] + by * turn.cos(), eye[1] + by * turn.sin()];
                let found = grid.first(&forest, from, random.fine_range(0.0, 7.0));
                assert!(found.is_none_or(|index| set[index as usize]), "{radius} {eye:?} {from:?} {found:?}");
            }
            seen.iter().for_each(|&index| set[index as usize] = false);
        }
        println!("radius {radius}: {:.1} of {count} discs seen on average", total as f64 / eyes as f64);
        assert!(total < eyes * count / 2, "radius {radius}: {total} of {count} discs from {eyes} eyes");
    }
}

#[test]
fn rays_in_a_forest_meet_discs_of_the_zone_first() {
    cast(4_000, 60, &[1.5, 0.3], 20, 100);
}

#[test]
#[ignore = "ten million rays among 835,089 discs"]
fn rays_in_a_forest_meet_discs_of_the_zone_first_long() {
    cast(835_089, 914, &[1.5, 0.6, 0.3, 0.05], 2_500, 1_000);
}
