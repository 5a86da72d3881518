//! Unseen regions, hiding places and guards against sample points and segments, which share no code with the
//! plan, and against answers by hand.

use visibility_2d::cdt::{Guards, Opacity, Plan, PlanError, PlanView, UnseenRegion, Visibility, Wall};
use visibility_testing::Random;

type Point = [f64; 2];

fn side(a: Point, b: Point, p: Point) -> f64 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

/// Returns whether no wall crosses the segment between two points. `None` if the segment passes a wall's end
/// so closely that rounding may decide.
fn sees(plan: &Plan, a: Point, b: Point) -> Option<bool> {
    let mut is_clear = true;
    let mut is_sure = true;
    for wall in plan.walls().iter().filter(|wall| wall.opacity == Opacity::Opaque) {
        let sides = wall.ends.map(|p| side(a, b, p));
        let others = [a, b].map(|p| side(wall.ends[0], wall.ends[1], p));
        let (crosses, may_cross) = (
            sides[0] * sides[1] < 0.0 && others[0] * others[1] < 0.0,
            sides.iter().chain(&others).any(|x| x.abs() < 1e-7),
        );
        is_clear &= !crosses || may_cross;
        is_sure &= !may_cross;
    }
    // A wall that surely crosses decides, whatever the others do.
    if is_clear && !is_sure { None } else { Some(is_clear) }
}

/// Makes walls inside a closed square: on a grid, where they touch, cross at halves of it and overlap, or
/// anywhere if the square is odd.
fn random_plan(random: &mut Random, most: usize) -> Plan {
    let size = random.between(3, 8);
    let far = f64::from(size);
    let corners = [[0.0, 0.0], [far, 0.0], [far, far], [0.0, far]];
    let mut walls: Vec<_> = (0..4).map(|i| Wall::new(corners[i], corners[(i + 1) % 4])).collect();
    for _ in 0..random.below(most) {
        if size % 2 == 1 {
            let [x, y] = [0, 1].map(|_| random.range(0.1, far - 0.1));
            let mut to = |x: f64| (x + random.range(-2.0, 2.0)).clamp(0.1, far - 0.1);
            walls.push(Wall::new([x, y], [to(x), to(y)]));
            continue;
        }
        let [x, y] = [0, 1].map(|_| random.between(0, size));
        let (dx, dy) = random.pick(&[(1, 0), (0, 1), (1, 1), (1, -1), (2, 2), (0, 2)]);
        let opacity = random.pick(&[Opacity::Opaque, Opacity::Opaque, Opacity::Opaque, Opacity::Clear]);
        let [from, to] = [[x, y], [x + dx, y + dy]].map(|p| p.map(f64::from));
        walls.push(Wall::new(from, to).with_opacity(opacity));
    }
    Plan::new(&walls).unwrap()
}

/// Returns a point of the grid, of its halves, or anywhere inside a plan.
fn random_eye(random: &mut Random, plan: &Plan) -> Point {
    let [low, high] = plan.bounds();
    let step = random.pick(&[0.0, 0.5, 1.0]);
    [0, 1].map(|k| {
        let x = random.range(low[k], high[k]);
        if step > 0.0 { ((x / step).round() * step).clamp(low[k], high[k]) } else { x }
    })
}

#[test]
fn what_is_left_is_what_no_eye_sees() {
    let mut view = Visibility::new();
    let (mut seen_count, mut left_count) = (0, 0);
    for seed in 0..400 {
        let mut random = Random(seed);
        let plan = random_plan(&mut random, 24);
        let [low, high] = plan.bounds();
        let start = random_eye(&mut random, &plan);
        let whole = UnseenRegion::reachable(&plan, &[start]).unwrap();
        let mut left = whole.clone();
        let mut eyes = Vec::new();
        for index in 0..random.between(1, 5) {
            let eye = random_eye(&mut random, &plan);
            left.look(&plan, eye).unwrap();
            eyes.push(eye);
            // The first eye, if all is reachable, sees what the visibility polygon holds.
            if index == 0 && (whole.area() - (high[0] - low[0]) * (high[1] - low[1])).abs() < 1e-9 {
                plan.look(&PlanView::new(eye), &mut view).unwrap();
                let sum = left.area() + view.area();
                assert!((sum - whole.area()).abs() < 1e-9 * sum, "seed {seed}: areas from {eye:?}");
            }
        }
        let shoelace = |corners: &Vec<Point>| {
            let after = corners.iter().cycle().skip(1);
            corners.iter().zip(after).map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum::<f64>()
        };
        let sum: f64 = left.polygons().map(|corners| shoelace(&corners)).sum();
        assert!((sum - left.area()).abs() < 1e-9 * whole.area(), "seed {seed}: area {sum} of polygons");
        for _ in 0..60 {
            let p = [0, 1].map(|k| random.fine_range(low[k], high[k]));
            if !whole.contains(&plan, p).unwrap() {
                assert!(!left.contains(&plan, p).unwrap(), "seed {seed}: {p:?} is not in the region");
                continue;
            }
            let sights: Vec<_> = eyes.iter().map(|&eye| exact_sees(&plan, eye, p)).collect();
            let is_left = left.contains(&plan, p).unwrap();
            if sights.contains(&Some(true)) {
                seen_count += 1;
                assert!(!is_left, "seed {seed}: {p:?} is seen from one of {eyes:?}");
            } else if sights.iter().all(|sight| *sight == Some(false)) {
                left_count += 1;
                assert!(is_left, "seed {seed}: {p:?} is hidden from {eyes:?}");
            }
        }
    }
    assert!(seen_count > 3000 && left_count > 2000, "{seen_count} seen, {left_count} left");
}

/// Returns whether an eye that may be on a wall or a vertex sees a point in general position. Such an eye
/// sees both sides of its walls, so walls through it do not count.
fn exact_sees(plan: &Plan, eye: Point, p: Point) -> Option<bool> {
    let mut answer = Some(true);
    for wall in plan.walls().iter().filter(|wall| wall.opacity == Opacity::Opaque) {
        let [a, b] = wall.ends;
        // Eyes on walls are on the grid or its halves, where these products are exact.
        let is_on = side(a, b, eye) == 0.0
            && (a[0] - eye[0]) * (b[0] - eye[0]) + (a[1] - eye[1]) * (b[1] - eye[1]) <= 0.0;
        if is_on {
            continue;
        }
        let (sides, others) = ([a, b].map(|q| side(eye, p, q)), [eye, p].map(|q| side(a, b, q)));
        if sides.iter().chain(&others).all(|x| x.abs() > 1e-7) {
            if sides[0] * sides[1] < 0.0 && others[0] * others[1] < 0.0 {
                return Some(false);
            }
        } else if !(others[0] * others[1] > 0.0 || sides[0] * sides[1] > 1e-7) {
            answer = None;
        }
    }
    answer
}

#[test]
fn guards_cover_and_no_point_sees_two_witnesses() {
    let (mut guard_count, mut witness_count, mut pairs) = (0, 0, 0);
    for seed in 0..150 {
        let mut random = Random(seed);
        let plan = random_plan(&mut random, 30);
        let start = random_eye(&mut random, &plan);
        let region = UnseenRegion::reachable(&plan, &[start]).unwrap();
        let guards = Guards::new(&plan, &[start]).unwrap();
        let (positions, witnesses) = (guards.positions(), guards.witnesses());
        assert!(guards.uncovered().is_empty(), "seed {seed}: not covered from {start:?}");
        assert!((1..=positions.len()).contains(&witnesses.len()), "seed {seed}: {guards:?}");
        guard_count += positions.len();
        witness_count += witnesses.len();
        for &p in positions.iter().chain(witnesses) {
            assert!(region.contains(&plan, p).unwrap(), "seed {seed}: {p:?} is not in the region");
            // Walls of the grid, whose crossings are not rounded.
            let is_on_wall = plan.walls().iter().any(|wall| {
                let [a, b] = wall.ends;
                let is_on_line = side(a, b, p) == 0.0 && a.iter().all(|x| x.fract() == 0.0);
                wall.opacity == Opacity::Opaque
                    && is_on_line
                    && (a[0] - p[0]) * (b[0] - p[0]) + (a[1] - p[1]) * (b[1] - p[1]) <= 0.0
            });
            assert!(!is_on_wall, "seed {seed}: {p:?} is on a wall");
        }
        let [low, high] = plan.bounds();
        for _ in 0..100 {
            let p = [0, 1].map(|k| random.fine_range(low[k], high[k]));
            if region.contains(&plan, p).unwrap() {
                let is_seen = positions.iter().any(|&guard| sees(&plan, guard, p) != Some(false));
                assert!(is_seen, "seed {seed}: no guard of {positions:?} sees {p:?}");
            }
            let seen: Vec<_> = witnesses.iter().filter(|&&w| sees(&plan, p, w) == Some(true)).collect();
            assert!(seen.len() < 2, "seed {seed}: {p:?} sees two witnesses, {seen:?}");
            pairs += usize::from(witnesses.len() > 1 && seen.len() == 1);
        }
        // No guard is needless: without it, something is left.
        for without in 0..positions.len() {
            let mut left = region.clone();
            for (_, &guard) in positions.iter().enumerate().filter(|(index, _)| *index != without) {
                left.look(&plan, guard).unwrap();
            }
            assert!(!left.is_empty(), "seed {seed}: guard {without} of {positions:?} is needless");
        }
    }
    assert!(
        guard_count > witness_count && witness_count > 200 && pairs > 300,
        "{witness_count} of {guard_count}, {pairs}"
    );
}

/// Makes the outline of a comb with its back at the top and teeth that end in tips, far apart.
fn comb(teeth: i32) -> Plan {
    let mut outline = Vec::new();
    for tooth in 0..teeth {
        let x = f64::from(10 * tooth);
        outline.extend([[x, 10.0], [x + 1.0, 0.0], [x + 2.0, 10.0]]);
    }
    let far = f64::from(10 * teeth - 8);
    outline.extend([[far, 11.0], [0.0, 11.0]]);
    let after = outline.iter().cycle().skip(1);
    Plan::new(&outline.iter().zip(after).map(|(&a, &b)| Wall::new(a, b)).collect::<Vec<_>>()).unwrap()
}

#[test]
fn each_tooth_of_a_comb_needs_a_guard() {
    for teeth in 2..8 {
        let guards = Guards::new(&comb(teeth), &[[1.0, 5.0]]).unwrap();
        assert!(guards.uncovered().is_empty(), "{teeth} teeth are covered");
        assert_eq!(guards.witnesses().len(), teeth as usize, "witnesses of {teeth} teeth");
        assert_eq!(guards.positions().len(), teeth as usize, "guards of {teeth} teeth");
    }
}

#[test]
fn one_way_walls_part_no_witnesses() {
    // From the room on the left, lines of sight lead into both rooms on the right, and not back.
    let corners = [[0.0, 0.0], [8.0, 0.0], [8.0, 4.0], [0.0, 4.0]];
    let mut walls: Vec<_> = (0..4).map(|i| Wall::new(corners[i], corners[(i + 1) % 4])).collect();
    walls.push(Wall::new([4.0, 2.0], [8.0, 2.0]));
    walls.push(Wall::new([4.0, 0.0], [4.0, 4.0]).with_opacity(Opacity::OneWay));
    let plan = Plan::new(&walls).unwrap();
    let starts = [[1.0, 1.0], [7.0, 1.0], [7.0, 3.0]];
    let mut region = UnseenRegion::reachable(&plan, &starts).unwrap();
    assert_eq!(region.area(), 32.0, "three rooms");
    region.look(&plan, [1.0, 2.0]).unwrap();
    assert!(region.is_empty(), "a guard on the left sees all three");
    assert_eq!(Guards::new(&plan, &starts).unwrap().witnesses().len(), 1, "one guard is enough");
    let right = UnseenRegion::reachable(&plan, &starts[1..2]).unwrap();
    assert_eq!(right.area(), 8.0, "movers pass no one-way wall");
}

/// Halls with niches, of one-way walls into which lines of sight lead from outside: the middle of a wall,
/// rounded to a point outside, may see more of a hall than any place inside.
#[test]
fn guards_stand_inside_of_one_way_walls() {
    let mut count = 0;
    for seed in 0..150 {
        let mut random = Random(seed);
        let mut chain = |side: f64| -> Vec<Point> {
            let depth = |i: i32| if i % 2 == 0 { [1.0, 6.0] } else { [0.1, 1.0] };
            let at = |i: i32| [f64::from(i), side * random.range(depth(i)[0], depth(i)[1])];
            (0..9).map(at).collect()
        };
        let (above, below) = (chain(1.0), chain(-1.0));
        let corners: Vec<Point> = above.into_iter().chain(below.into_iter().rev()).collect();
        let after = corners.iter().cycle().skip(1);
        let walls = corners.iter().zip(after).map(|(&a, &b)| Wall::new(a, b).with_opacity(Opacity::OneWay));
        let plan = Plan::from_walls(&walls.collect::<Vec<_>>(), 2.0).unwrap();
        let region = UnseenRegion::reachable(&plan, &[[4.0, 0.0]]).unwrap();
        let guards = Guards::new(&plan, &[[4.0, 0.0]]).unwrap();
        for &guard in guards.positions() {
            assert!(region.contains(&plan, guard).unwrap(), "seed {seed}: {guard:?} is outside");
            count += 1;
        }
    }
    assert!(count > 200, "{count} guards");
}

/// Makes a ring of corridors around a block: a square of 12 with a square of 4 in its middle.
fn ring() -> Plan {
    let square = |low: f64, high: f64| {
        let corners = [[low, low], [high, low], [high, high], [low, high]];
        (0..4).map(move |i| Wall::new(corners[i], corners[(i + 1) % 4]))
    };
    Plan::new(&square(0.0, 12.0).chain(square(4.0, 8.0)).collect::<Vec<_>>()).unwrap()
}

#[test]
fn places_are_connected_parts() {
    let plan = ring();
    let mut left = UnseenRegion::reachable(&plan, &[[1.0, 1.0]]).unwrap();
    assert_eq!(left.hiding_places(&plan).unwrap().len(), 1, "the ring");
    // From the left corridor's middle: hidden is all that is behind the block, in one part.
    left.look(&plan, [2.0, 6.0]).unwrap();
    let places = left.hiding_places(&plan).unwrap();
    assert_eq!(places.len(), 1, "behind the block");
    // The sides of the shadow rise by 1 a metre from (4, 4) and (4, 8) on: a trapezium 4 and 20 high that is
    // cut at y = 0 and y = 12, less the block.
    assert!((left.area() - (4.0 + 12.0) / 2.0 * 4.0 - 4.0 * 12.0 + 16.0).abs() < 1e-9, "{}", left.area());
    // An eye in the middle of the right corridor leaves a part above and a part below the block.
    left.look(&plan, [10.0, 6.0]).unwrap();
    let places = left.hiding_places(&plan).unwrap();
    assert_eq!(places.len(), 2, "above and below the block");
    let at = |point: Point| places.at(&plan, &left, point).unwrap();
    let (below, above) = (at([6.0, 3.5]), at([6.0, 8.5]));
    assert!(below.is_some() && above.is_some() && below != above, "{below:?} {above:?}");
    assert_eq!(at([5.0, 3.5]), below, "both below");
    assert_eq!(at([6.0, 1.0]), None, "seen by both eyes");
    // Each is a triangle 4 wide and 2 high.
    assert!(places.areas().iter().all(|area| (area - 4.0).abs() < 1e-9), "{:?}", places.areas());
    assert_eq!(places.of_polygons().len(), left.polygons().count(), "a place for each polygon");
}

#[test]
fn shadows_across_one_edge_are_places_of_their_own() {
    // Two screens throw shadows across a line on the ground, which is one edge of the triangulation.
    let corners = [[-10.0, -5.0], [10.0, -5.0], [10.0, 15.0], [-10.0, 15.0]];
    let mut walls: Vec<_> = (0..4).map(|i| Wall::new(corners[i], corners[(i + 1) % 4])).collect();
    walls.push(Wall::new([-3.0, 0.0], [-1.0, 0.0]));
    walls.push(Wall::new([1.0, 0.0], [3.0, 0.0]));
    walls.push(Wall::new([-10.0, 5.0], [10.0, 5.0]).with_opacity(Opacity::Clear));
    let plan = Plan::new(&walls).unwrap();
    let mut left = UnseenRegion::reachable(&plan, &[[0.0, 0.0]]).unwrap();
    left.look(&plan, [0.0, -4.0]).unwrap();
    let places = left.hiding_places(&plan).unwrap();
    let at = |x: f64, y: f64| places.at(&plan, &left, [x, y]).unwrap();
    assert_eq!(places.len(), 2, "a place behind each screen");
    assert_eq!(
        (at(-3.0, 4.0), at(3.0, 4.0)),
        (at(-4.0, 6.0), at(4.0, 6.0)),
        "each is one on both sides of the line"
    );
    assert!(at(-3.0, 4.0).is_some() && at(-3.0, 4.0) != at(3.0, 4.0), "the shadows are apart");
}

#[test]
fn an_evader_escapes_around_a_ring_and_is_caught_between_two_watchers() {
    let plan = ring();
    let region = UnseenRegion::reachable(&plan, &[[1.0, 1.0]]).unwrap();
    // Moves watchers from posts to posts, and returns where the evader may be in the end.
    let chase = |watches: &[&[Point]]| {
        let mut evader = region.clone();
        watches[0].iter().for_each(|&eye| evader.look(&plan, eye).unwrap());
        for eyes in &watches[1..] {
            let mut now = region.clone();
            for &eye in *eyes {
                evader.look(&plan, eye).unwrap();
                now.look(&plan, eye).unwrap();
            }
            now.spread_from(&plan, &evader).unwrap();
            evader = now;
        }
        evader
    };
    // A watcher in a corner of the ring sees two corridors, and the evader keeps to the other two.
    let [a, b, c, d] = [[2.0, 2.0], [10.0, 2.0], [10.0, 10.0], [2.0, 10.0]];
    let escaped = chase(&[&[a], &[b], &[c], &[d], &[a]]);
    assert!(escaped.contains(&plan, [11.0, 11.0]).unwrap(), "one watcher catches nobody");
    // With one watcher in a corner, and another who goes around to it.
    let caught = chase(&[&[a, c]]);
    assert!(caught.is_empty(), "two opposite corners see all");
    let kept = chase(&[&[[2.0, 6.0]], &[[2.0, 6.0], [6.0, 10.0]], &[[2.0, 6.0], [10.0, 10.0]]]);
    // The watcher at the left keeps the evader from the left corridor. The one at (10, 10) sees the top and
    // the right corridor, and what is left is below the block only: the top was cleared before.
    assert!(!kept.is_empty(), "the lower corridor is not searched yet");
    assert!(!kept.contains(&plan, [6.0, 8.5]).unwrap(), "nobody comes back to the top");
    assert!(kept.contains(&plan, [6.0, 3.0]).unwrap(), "the lower corridor holds the evader");
    let end = chase(&[&[[2.0, 6.0]], &[[2.0, 6.0], [10.0, 10.0]], &[[2.0, 6.0], [10.0, 2.0]]]);
    assert!(!end.contains(&plan, [6.0, 3.0]).unwrap(), "the lower corridor is searched");
}

#[test]
fn other_plans_and_bad_points_are_errors() {
    let mut plan = ring();
    assert_eq!(UnseenRegion::reachable(&plan, &[]).err(), Some(PlanError::Region), "no start");
    assert_eq!(Guards::new(&plan, &[[99.0, 0.0]]).err(), Some(PlanError::Region), "a start outside");
    let nan = UnseenRegion::reachable(&plan, &[[1.0, 1.0], [f64::NAN, 0.0]]);
    assert!(matches!(nan, Err(PlanError::Coordinate { index: 1, .. })), "a start that is no point");
    let mut region = UnseenRegion::reachable(&plan, &[[1.0, 1.0]]).unwrap();
    assert!(region.look(&plan, [0.0, f64::INFINITY]).is_err(), "an eye that is no point");
    assert_eq!(region.area(), 128.0, "nothing is lost by an error");
    let places = region.hiding_places(&plan).unwrap();
    plan.set_opacity(0, Opacity::Clear).unwrap();
    assert_eq!(region.look(&plan, [1.0, 1.0]), Err(PlanError::VisibilityGraph), "a wall has become clear");
    let errors = (region.contains(&plan, [1.0, 1.0]).is_err(), region.hiding_places(&plan).is_err());
    assert_eq!(errors, (true, true), "questions to the region of other opacities");
    let all = UnseenRegion::reachable(&plan, &[[1.0, 1.0]]).unwrap();
    let errors =
        (all.clone().spread_from(&plan, &region).is_err(), places.at(&plan, &region, [1.0, 1.0]).is_err());
    assert_eq!(errors, (true, true), "questions that take the region of other opacities");
    let of_other = places.at(&plan, &all, [1.0, 1.0]);
    assert_eq!(of_other, Err(PlanError::VisibilityGraph), "places of another region");
}

/// Places are of one content of one region: later looks make them void, and a copy of the region does not.
#[test]
fn places_of_a_region_that_has_changed_are_an_error() {
    let plan = ring();
    let mut left = UnseenRegion::reachable(&plan, &[[1.0, 1.0]]).unwrap();
    left.look(&plan, [2.0, 6.0]).unwrap();
    let (before, places) = (left.clone(), left.hiding_places(&plan).unwrap());
    let at = |region: &UnseenRegion| places.at(&plan, region, [6.0, 8.5]);
    assert_eq!((at(&left), at(&before)), (Ok(Some(0)), Ok(Some(0))), "the region and a copy");
    left.look(&plan, [10.0, 6.0]).unwrap();
    assert_eq!(at(&left), Err(PlanError::VisibilityGraph), "after another look");
    let mut spread = before.clone();
    spread.spread_from(&plan, &left).unwrap();
    assert_eq!(at(&spread), Err(PlanError::VisibilityGraph), "after a spread");
    assert_eq!(at(&before), Ok(Some(0)), "the copy that has not changed");
}
