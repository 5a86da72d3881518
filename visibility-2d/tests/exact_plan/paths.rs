//! Shortest paths against the brute force of `path_oracle.rs`.

use super::path_oracle::shortest;
use super::{UNIT, grid_walls, plan_of};
use visibility_2d::cdt::{Opacity, Plan, PlanError, ShortestPath, VisibilityGraph, Wall};
use visibility_testing::{Random, judged, told_enough};

/// Compares the paths of plans, each made of a seed and the greatest number of walls.
fn compare(plans: impl Iterator<Item = (u64, usize)>) {
    let mut path = ShortestPath::new();
    let (mut bent, mut straight, mut none) = (0, 0, 0);
    for (seed, most) in plans {
        let mut random = Random(seed);
        // Every fourth plan is small and full of walls, so that many parts of it are closed.
        let is_dense = seed % 4 == 0;
        let size = if is_dense { 3 } else { random.between(2, 7) };
        let count = if is_dense { 2 * most } else { random.below(most) };
        let walls = grid_walls(&mut random, count, size);
        let mut plan = plan_of(&walls);
        // In two plans of three, most walls are one-way. They stop paths as opaque ones do.
        for wall in 0..if seed % 3 == 0 { 0 } else { walls.len() as u32 } {
            plan.set_opacity(wall, random.pick(&[Opacity::OneWay, Opacity::OneWay, Opacity::Opaque]))
                .unwrap();
        }
        let [low, high] = plan.bounds().map(|corner| corner.map(|x| (x * UNIT) as i32));
        let graph = VisibilityGraph::new(&plan).unwrap();
        let units: Vec<_> =
            walls.iter().map(|w| w.map(|p| p.map(|x| i128::from(x) * UNIT as i128))).collect();
        for _ in 0..6 {
            // Points at vertices, on walls, and anywhere.
            let step = random.pick(&[1, 2, 4]);
            let [a, b] = [0, 1].map(|_| [0, 1].map(|k| random.between(low[k], high[k]) / step * step));
            let [p, q] = [a, b].map(|point| point.map(|x| f64::from(x) / UNIT));
            graph.find_path(&plan, p, q, &mut path).unwrap();
            let expected = shortest(&units, a.map(i128::from), b.map(i128::from)).map(|length| length / UNIT);
            let text = format!("seed {seed}: from {p:?} to {q:?}: {path:?}");
            match (path.length(), expected) {
                (Some(length), Some(expected)) => {
                    assert!((length - expected).abs() < 1e-7, "{length} against {expected}, {text}");
                    assert_eq!((path.points()[0], *path.points().last().unwrap()), (p, q), "ends, {text}");
                    let legs = path.points().windows(2);
                    let sum: f64 = legs.map(|w| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1])).sum();
                    assert!((sum - length).abs() < 1e-9, "sum of legs {sum}, {text}");
                    *(if path.points().len() > 2 { &mut bent } else { &mut straight }) += 1;
                }
                (None, None) => {
                    assert!(path.points().is_empty(), "points of no path, {text}");
                    none += 1;
                }
                (length, expected) => panic!("{length:?} against {expected:?}, {text}"),
            }
        }
    }
    judged((bent + straight + none) as u64);
    told_enough(
        bent > 200 && straight > 200 && none > 10,
        format_args!("{bent} bent, {straight} straight, {none} without a path"),
    );
}

#[test]
fn paths_are_as_short_as_brute_force_says() {
    // In the last plan, one-way walls that touch bar the straight path.
    compare((0..250).map(|seed| (seed, 16)).chain([(2869, 30)]));
}

#[test]
fn a_door_opens_the_way() {
    // A room of 4 by 4 with a door in its right side.
    let corners = [[4.0, 1.5], [4.0, 0.0], [0.0, 0.0], [0.0, 4.0], [4.0, 4.0], [4.0, 2.5]];
    let mut walls: Vec<_> = corners.windows(2).map(|pair| Wall::new(pair[0], pair[1])).collect();
    let door = walls.len() as u32;
    walls.push(Wall::new([4.0, 2.5], [4.0, 1.5]));
    let mut plan = Plan::new(&walls).unwrap();
    let graph = VisibilityGraph::new(&plan).unwrap();
    let mut path = ShortestPath::new();
    graph.find_path(&plan, [2.0, 2.0], [5.0, 2.0], &mut path).unwrap();
    assert_eq!(path.length(), None, "a closed door");
    for opacity in [Opacity::OneWay, Opacity::Clear] {
        plan.set_opacity(door, opacity).unwrap();
        let stale = graph.find_path(&plan, [2.0, 2.0], [5.0, 2.0], &mut path);
        assert_eq!(stale, Err(PlanError::VisibilityGraph), "the graph of the closed door");
        let graph = VisibilityGraph::new(&plan).unwrap();
        graph.find_path(&plan, [2.0, 2.0], [5.0, 2.0], &mut path).unwrap();
        let expected = (opacity == Opacity::Clear).then_some(3.0);
        assert_eq!(path.length(), expected, "through a door that is {opacity:?}");
    }
    let graph = VisibilityGraph::new(&plan).unwrap();
    graph.find_path(&plan, [3.0, 3.5], [4.5, 3.5], &mut path).unwrap();
    assert_eq!(path.points(), [[3.0, 3.5], [4.0, 2.5], [4.5, 3.5]], "around the door post");
    // Legs of the inner and the outer face of each corner, by hand: the inside has the posts alone.
    assert_eq!(graph.corner_count(), 6, "two posts and the four outer corners");
    let legs = |number: u32| graph.legs(number).iter().map(|&to| graph.corner(&plan, to).unwrap());
    let post = (0..6).find(|&number| graph.corner(&plan, number) == Some([4.0, 2.5])).unwrap();
    let mut of_post: Vec<_> = legs(post).collect();
    of_post.sort_by(|a, b| a[1].total_cmp(&b[1]));
    assert_eq!(of_post[..2], [[4.0, 1.5], [4.0, 4.0]], "legs of a post");
}

/// Two one-way walls end in the origin. Lines of sight pass the origin on one side in one direction, and on
/// the other side in the other. A path passes neither wall, and leads around an end.
#[test]
fn one_way_walls_that_touch_are_a_barrier() {
    let ends = [[0.0, 1.0], [0.0, -1.0]];
    let walls = ends.map(|end| Wall::new([0.0, 0.0], end).with_opacity(Opacity::OneWay));
    let plan = Plan::new(&walls).unwrap();
    let graph = VisibilityGraph::new(&plan).unwrap();
    let mut path = ShortestPath::new();
    for (from, to) in [([-1.0, 0.0], [1.0, 0.0]), ([1.0, 0.0], [-1.0, 0.0])] {
        graph.find_path(&plan, from, to, &mut path).unwrap();
        let length = path.length().unwrap();
        assert!((length - 8f64.sqrt()).abs() < 1e-12, "{length} from {from:?}: {path:?}");
    }
}

#[test]
fn legs_are_those_of_a_taut_string() {
    let square = |x: f64, y: f64| {
        let corners = [[x, y], [x + 1.0, y], [x + 1.0, y + 1.0], [x, y + 1.0]];
        (0..4).map(move |i| Wall::new(corners[i], corners[(i + 1) % 4]))
    };
    // Two convex obstacles have their sides and four common tangents, wherever they are.
    for (x, y) in [(3.0, 0.0), (3.0, 5.0), (2.0, 0.5), (0.5, -4.0), (1.5, 1.5)] {
        let plan = Plan::new(&square(0.0, 0.0).chain(square(x, y)).collect::<Vec<_>>()).unwrap();
        let graph = VisibilityGraph::new(&plan).unwrap();
        let counts = (graph.corner_count(), graph.leg_count());
        assert_eq!(counts, (8, 8 + 4), "corners and legs of two squares, one at {x}, {y}");
    }
}

#[test]
fn bad_points_are_errors_and_leave_no_path() {
    let plan = Plan::from_walls(&[Wall::new([0.0, 0.0], [1.0, 0.0])], 1.0).unwrap();
    let graph = VisibilityGraph::new(&plan).unwrap();
    let mut path = ShortestPath::new();
    for (from, to) in
        [([f64::NAN, 0.0], [0.5, 0.5]), ([0.5, 0.5], [0.0, f64::INFINITY]), ([9.0, 9.0], [0.5, 0.5])]
    {
        graph.find_path(&plan, [0.5, -0.5], [0.5, 0.5], &mut path).unwrap();
        assert!(path.length().is_some(), "a path around the wall");
        assert!(graph.find_path(&plan, from, to, &mut path).is_err(), "from {from:?} to {to:?}");
        assert!(path.length().is_none() && path.points().is_empty(), "no path from {from:?} to {to:?}");
    }
    let other = plan_of(&[]);
    assert_eq!(
        graph.find_path(&other, [0.0; 2], [0.0; 2], &mut path),
        Err(PlanError::VisibilityGraph),
        "a graph of another plan"
    );
    assert!(graph.legs(99).is_empty() && graph.corner(&other, 0).is_none(), "corners of no plan");
}
