//! Tests of the prefetch against small steps along the path, each of which looks at all viewcells.

use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Prefetch, Pvs, PvsTargets, ScenePvs, Viewcell, ViewcellId, Viewcells};
use visibility_core::{Aabb, ObjectId, Scene};
use visibility_testing::Random;

const OBJECTS: usize = 90;

/// Returns a scene, and random rows for viewcells of 2 metres that fill most of a cube of 12 metres, some of
/// them cut by a plane. Two objects share each target but the last, and some objects are never hidden.
fn random_sets(random: &mut Random) -> (Scene, ScenePvs, Vec<Vec<u32>>) {
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..OBJECTS).map(|_| Aabb::from_arrays([0.0; 3], [1.0; 3])));
    let mut cells = Vec::new();
    for i in 0..216 {
        let corner = DVec3::new(f64::from(i % 6), f64::from(i / 6 % 6), f64::from(i / 36)) * 2.0;
        let mut cell = Viewcell::from_box(corner, corner + 2.0);
        match random.below(10) {
            0 => continue,
            1 => {
                let normal = random.vector(3.0);
                cell.planes.push(Plane::new(normal, -normal.dot(corner + 1.0) + random.unit()));
            }
            _ => {}
        }
        cells.push(cell);
    }
    // Objects are seen from few viewcells, so that they appear all along a path.
    let rows: Vec<Vec<u32>> =
        cells.iter().map(|_| (0..50).filter(|_| random.below(12) == 0).collect()).collect();
    let pvs = Pvs::new(PvsTargets::Objects, 50, &rows, |id| id.0.checked_sub(1).map(ViewcellId)).unwrap();
    let pairs = ids.iter().take(80).flat_map(|&id| {
        let target = id.index() as u32 / 2;
        // Every seventh object has two targets.
        let second = id.index().is_multiple_of(7).then_some((id, target + 9));
        [(id, target)].into_iter().chain(second)
    });
    let sets = ScenePvs::new(&scene, pvs, Viewcells::new(cells), pairs);
    (scene, sets, rows)
}

/// Returns whether a cube about a point, of a half side of `reach`, touches a viewcell, which may be larger
/// by `slack` metres.
fn touches(cell: &Viewcell, at: DVec3, reach: f64, slack: f64) -> bool {
    let reach = reach + slack;
    let in_box = (at - cell.min + reach).min_element() >= 0.0 && (cell.max - at + reach).min_element() >= 0.0;
    in_box
        && cell.planes.iter().all(|plane| {
            let corner = at + plane.normal.signum() * reach;
            plane.normal.dot(corner) + plane.offset >= 0.0
        })
}

/// Returns whether some viewcell that the cube touches sees an object.
fn is_seen(sets: &ScenePvs, rows: &[Vec<u32>], id: ObjectId, at: DVec3, reach: f64, slack: f64) -> bool {
    let target = id.index() as u32 / 2;
    let second = id.index().is_multiple_of(7).then_some(target + 9);
    sets.viewcells().cells().iter().zip(rows).any(|(cell, row)| {
        let is_listed = row.contains(&target) || second.is_some_and(|second| row.contains(&second));
        is_listed && touches(cell, at, reach, slack)
    })
}

#[test]
fn objects_are_listed_when_steps_along_the_path_first_see_them() {
    const STEPS: u32 = 300;
    let mut random = Random(77);
    let mut prefetch = Prefetch::new();
    let (mut listed, mut uncovered) = (0, 0);
    for round in 0..30 {
        let (scene, sets, rows) = random_sets(&mut random);
        let eye = random.vector(6.0) + 6.0;
        // Random paths, paths along an axis, and paths along boundaries of viewcells.
        let (eye, velocity) = match round % 3 {
            0 => (eye, random.vector(4.0)),
            1 => (eye, DVec3::Y * 3.0),
            _ => (eye.round(), DVec3::X * -2.0),
        };
        let (reach, seconds) = ([0.0, 0.3][round % 2], 2.5);
        let found = prefetch.search(&sets, eye, velocity, reach, seconds).to_vec();
        let covered = prefetch.covered_seconds();
        assert!(found.is_sorted_by_key(|arrival| arrival.seconds), "arrivals are sorted by time");
        listed += found.len();
        let step = seconds / f64::from(STEPS);
        let times: Vec<f64> = (0..=STEPS).map(|i| f64::from(i) * step).collect();
        for id in scene.ids() {
            let arrival = found.iter().find(|arrival| arrival.object == id);
            if id.index() >= 80 {
                assert_eq!(arrival, None, "no target, so never hidden");
                continue;
            }
            let is_seen = |time, slack| is_seen(&sets, &rows, id, eye + velocity * time, reach, slack);
            let first = times.iter().copied().find(|&time| is_seen(time, 0.0));
            match (arrival, first) {
                (None, None | Some(0.0)) => {}
                (None, Some(first)) => panic!("{id} is seen at {first}, but not listed"),
                (Some(arrival), first) => {
                    let time = arrival.seconds;
                    assert!(first.is_none_or(|first| time <= first + 1e-12), "{id} late: {time}, {first:?}");
                    // A viewcell reached at that time sees the object, and none reached before does.
                    assert!(is_seen(time, 1e-9), "{id} is not seen at {time}");
                    assert!(!is_seen((time - 1e-6).max(0.0), 0.0), "{id} is seen before {time}");
                }
            }
        }
        let is_inside = |&time: &f64| {
            let at = eye + velocity * time;
            sets.viewcells().cells().iter().any(|cell| touches(cell, at, 0.0, 1e-9))
        };
        let leaves = times.iter().copied().find(|time| !is_inside(time));
        match leaves {
            // The small steps may miss a gap that the path only grazes.
            None => assert!(covered > 0.0, "round {round}: the path stays inside, but no second is covered"),
            Some(leaves) => assert!(
                covered <= leaves && (leaves == 0.0 || covered > 0.0),
                "round {round}: the path leaves at {leaves} s, but {covered} s are covered"
            ),
        }
        if let Some(last) = times.iter().copied().take_while(is_inside).last().filter(|&last| covered < last)
        {
            let gap = eye + velocity * (covered + 1e-6);
            let is_gap = !sets.viewcells().cells().iter().any(|cell| touches(cell, gap, 0.0, 0.0));
            assert!(is_gap, "no gap at {covered}, inside up to {last}");
        }
        uncovered += usize::from(covered < seconds);
    }
    assert!(listed > 300 && uncovered > 5 && uncovered < 30, "{listed} {uncovered}");
}

#[test]
fn numbers_that_make_no_sense_find_nothing() {
    let (_, sets, _) = random_sets(&mut Random(3));
    let mut prefetch = Prefetch::new();
    let (eye, velocity) = (DVec3::splat(6.0), DVec3::X);
    assert!(
        !prefetch.search(&sets, eye, velocity, 0.1, 3.0).is_empty(),
        "numbers that make sense find something"
    );
    for wrong in [f64::NAN, f64::INFINITY, -1.0] {
        assert!(prefetch.search(&sets, eye, velocity, wrong, 3.0).is_empty(), "a reach of {wrong}");
        assert_eq!(prefetch.covered_seconds(), 0.0, "seconds covered with a reach of {wrong}");
        assert!(prefetch.search(&sets, eye, velocity, 0.1, wrong).is_empty(), "{wrong} seconds");
        assert_eq!(prefetch.covered_seconds(), 0.0, "seconds covered of {wrong}");
        assert!(
            prefetch.search(&sets, eye, velocity * (wrong - 1.0) * f64::MAX, 0.1, 3.0).is_empty(),
            "a velocity that is not finite"
        );
        assert_eq!(prefetch.covered_seconds(), 0.0, "seconds covered by a search that failed");
    }
    assert!(prefetch.search(&sets, DVec3::NAN, velocity, 0.1, 3.0).is_empty(), "an eye that is NaN");
    assert_eq!(prefetch.covered_seconds(), 0.0, "seconds covered from an eye that is NaN");
    assert!(
        prefetch.search(&sets, eye, DVec3::ZERO, 0.1, 3.0).is_empty(),
        "an eye that stands finds nothing new"
    );
    assert_eq!(prefetch.covered_seconds(), 3.0, "an eye that stands stays where it is");
}

#[test]
fn a_path_along_a_slanted_face_reaches_the_viewcell_wherever_rounding_may_say_so() {
    let mut random = Random(5);
    let mut scene = Scene::new();
    let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
    let mut prefetch = Prefetch::new();
    let mut reached = 0;
    for _ in 0..1000 {
        let [normal, other, middle] = [3.0, 3.0, 90.0].map(|size| random.vector(size));
        let along = normal.cross(other);
        let start = middle - along;
        let mut cell = Viewcell::from_box(middle - 0.5, middle + 0.5);
        cell.planes.push(Plane::through(middle, normal));
        let pvs = Pvs::new(PvsTargets::Objects, 1, &[vec![0]], |_| []).unwrap();
        let sets = ScenePvs::new(&scene, pvs, Viewcells::new([cell.clone()]), [(id, 0)]);
        let found = prefetch.search(&sets, start, along, 0.0, 2.0).first().map(|arrival| arrival.seconds);
        let mut times = (0..=200).map(|i| f64::from(i) / 100.0);
        let first = times.find(|&time| cell.contains(start + along * time));
        // Leaves out paths that begin within the viewcell's box: the object may be visible at once.
        if let Some(first) = first.filter(|_| along.abs().max_element() > 0.6) {
            assert!(found.is_some_and(|found| found <= first), "{found:?}, {first}");
            reached += 1;
        }
    }
    assert!(reached > 300, "{reached}");
}

#[test]
fn a_viewcell_without_end_begins_where_it_begins() {
    let mut scene = Scene::new();
    let ids = [5.0, 15.0].map(|x| scene.insert(Aabb::from_arrays([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0])));
    let pvs = Pvs::new(PvsTargets::Objects, 2, &[vec![0], vec![0, 1]], |_| []).unwrap();
    let cells = [[-f64::INFINITY, 10.0], [10.0, f64::INFINITY]]
        .map(|[from, to]| Viewcell::from_box(DVec3::new(from, -5.0, -5.0), DVec3::new(to, 5.0, 5.0)));
    let sets = ScenePvs::new(&scene, pvs, Viewcells::new(cells), ids.into_iter().zip(0..));
    let mut prefetch = Prefetch::new();
    let ahead = prefetch.search(&sets, DVec3::new(6.0, 0.0, 0.0), DVec3::X * 2.0, 0.0, 10.0);
    assert_eq!((ahead.len(), ahead.first().map(|arrival| arrival.object)), (1, Some(ids[1])), "{ahead:?}");
    assert!((ahead[0].seconds - 2.0).abs() < 1e-9, "{ahead:?}: 4 m at 2 m/s");
    assert_eq!(prefetch.covered_seconds(), 10.0, "the second viewcell has no end");
}

/// Compares the prefetch with the viewcells that the culler reads: those of a divided box are misplaced, and
/// far from the origin along y the rounding of x counts as that of y.
#[test]
fn a_viewcell_that_the_culler_takes_for_reached_is_listed_by_then() {
    let mut scene = Scene::new();
    let ids = [5.0, 15.0].map(|x| scene.insert(Aabb::from_arrays([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0])));
    for (y, misplacement, early) in [(0.0, 0.25, 0.25), (1e9, 0.0, 7e-6), (-1e9, 1e-5, 1.7e-5)] {
        let corner = |x: f64, side: f64| DVec3::new(x, y + side, side);
        let rooms = [0.0, 10.0].map(|x| Viewcell::from_box(corner(x, -5.0), corner(x + 10.0, 5.0)));
        let cells = Viewcells::of_divided_box(rooms, corner(0.0, -5.0), corner(20.0, 5.0), misplacement);
        let pvs = Pvs::new(PvsTargets::Objects, 2, &[vec![0], vec![0, 1]], |_| []).unwrap();
        let sets = ScenePvs::new(&scene, pvs, cells, ids.into_iter().zip(0..));
        let mut prefetch = Prefetch::new();
        let ahead = prefetch.search(&sets, corner(6.0, 0.0), DVec3::X * 2.0, 0.0, 10.0);
        assert_eq!(
            (ahead.len(), ahead.first().map(|arrival| arrival.object)),
            (1, Some(ids[1])),
            "{ahead:?}"
        );
        let listed = 6.0 + ahead[0].seconds * 2.0;
        let mut reached = Vec::new();
        let mut is_reached = |x: f64| {
            sets.viewcells().reached(&[DVec3::ZERO], corner(x, 0.0), 0.0, &mut reached)
                && reached.contains(&ViewcellId(1))
        };
        assert!(
            is_reached(10.0 - early) && !is_reached(10.0 - 1.1 * early),
            "{y}: {early} m before the room"
        );
        assert!(listed <= 10.0 - early && listed > 10.0 - 2.0 * early, "{y}: listed at {listed}");
    }
}
