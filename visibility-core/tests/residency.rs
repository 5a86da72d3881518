//! Tests of `Residency`: it never drops what may be visible, keeps to its budget and its limit, and loads and
//! drops in the order of urgency. Tests of the sets of a box that `PvsCuller` gives it.

use std::collections::BTreeMap;
use visibility_core::bits::Bits;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{
    HiddenSets, Pvs, PvsCuller, PvsTargets, Residency, ScenePvs, Transfer, Viewcell, Viewcells,
};
use visibility_core::{Aabb, Object, ObjectId, Scene};
use visibility_testing::Random;

/// Hidden objects by the whole number of the least x of a box. Unknown for other numbers.
#[derive(Default)]
struct Given(BTreeMap<i64, Vec<ObjectId>>);

impl HiddenSets for Given {
    fn write_hidden(&mut self, scene: &Scene, _: &[u32], min: DVec3, _: DVec3, hidden: &mut Bits) -> bool {
        let Some(ids) = self.0.get(&(min.x as i64)) else { return false };
        hidden.reset(scene.index_limit());
        ids.iter().for_each(|id| _ = hidden.insert(id.index()));
        true
    }
}

/// Layers of one view, which shows all.
const ALL: [u32; 1] = [u32::MAX];

fn place(x: f64) -> [DVec3; 2] {
    [DVec3::X * x, DVec3::X * x + 0.5]
}

fn objects(transfers: &[Transfer]) -> Vec<ObjectId> {
    transfers.iter().map(|transfer| transfer.object).collect()
}

/// Returns a scene of slabs, the first at x = 10 and each of the others 10 m farther than the one before: the
/// nearer, the more important, from places below x = 9.
fn slabs(count: usize) -> (Scene, Vec<ObjectId>) {
    let mut scene = Scene::new();
    let at = |i: usize| 10.0 * (i + 1) as f32;
    let ids = scene.insert_batch((0..count).map(|i| Aabb::from_arrays([at(i), 0.0, 0.0], [at(i) + 1.0; 3])));
    (scene, ids)
}

#[test]
fn random_updates_keep_to_budget_and_limit_and_never_drop_what_may_be_visible() {
    let mut random = Random(3);
    let (mut dropped, mut spared, mut late, mut idle) = (0, 0, 0, 0);
    for round in 0..40 {
        let (mut scene, mut ids) = slabs(60);
        let sizes: Vec<u64> = ids.iter().map(|_| 1 + random.below(50) as u64).collect();
        let limit = 300 + random.below(600) as u64;
        let mut residency = Residency::new(limit);
        let mut memory: BTreeMap<ObjectId, u64> = BTreeMap::new();
        let (mut granted, mut loaded) = (0, 0);
        for update in 0..60 {
            if random.below(10) == 0 {
                scene.remove(ids.swap_remove(random.below(ids.len()))).unwrap();
            }
            let mut sets = Given::default();
            for x in 0..4 {
                if random.below(4) > 0 {
                    let share = 1 + random.below(5);
                    sets.0.insert(x, ids.iter().copied().filter(|_| random.below(6) >= share).collect());
                }
            }
            let places: Vec<_> = (0..1 + random.below(4)).map(|x| place(x as f64)).collect();
            let budget = random.below(120) as u64;
            granted += budget;
            residency.update(&scene, &mut sets, &ALL, &places, |id| sizes[id.index()], budget);
            let case = format!("round {round}, update {update}");
            let visible = |id: ObjectId| sets.0.get(&0).is_none_or(|hidden| !hidden.contains(&id));
            for drop in residency.drops() {
                let is_removed = !scene.contains(drop.object);
                assert!(is_removed || !visible(drop.object), "{case}: {} may be visible", drop.object);
                assert_eq!(memory.remove(&drop.object), Some(drop.bytes), "{case}: {}", drop.object);
                dropped += usize::from(!is_removed);
            }
            for load in residency.loads() {
                assert_eq!(load.bytes, sizes[load.object.index()], "{case}: {}", load.object);
                assert_eq!(memory.insert(load.object, load.bytes), None, "{case}: {} twice", load.object);
                loaded += load.bytes;
            }
            let is_idle = residency.loads().is_empty();
            let needless = residency.drops().iter().find(|drop| is_idle && scene.contains(drop.object));
            assert_eq!(needless, None, "{case}: dropped for no load");
            idle += usize::from(is_idle && budget > 0);
            assert_eq!(residency.bytes(), memory.values().sum(), "{case}: bytes in memory");
            assert!(residency.bytes() <= limit, "{case}: the limit is {limit}");
            assert!(loaded < granted + 50, "{case}: {loaded} bytes loaded of {granted}");
            assert!(ids.iter().all(|id| residency.contains(*id) == memory.contains_key(id)), "{case}");
            let all = ids.iter().filter(|&&id| visible(id)).all(|id| memory.contains_key(id));
            assert_eq!(residency.is_complete(), all, "{case}: all that may be visible is in memory");
            spared += memory.keys().filter(|&&id| !visible(id)).count();
            late += usize::from(!sets.0.contains_key(&0));
        }
    }
    assert!(dropped > 500 && spared > 5000 && late > 300, "{dropped} dropped, {spared} spared, {late} late");
    assert!(idle > 100, "{idle} updates without loads that had a budget");
}

#[test]
fn loads_come_by_place_and_then_by_importance() {
    let (mut scene, ids) = slabs(6);
    // On the other side, as near as the fifth, and smaller.
    let behind = scene.insert(Aabb::from_arrays([-60.0, 0.0, 0.0], [-50.0, 10.0, 10.0]));
    let mut sets = Given::default();
    sets.0.insert(0, vec![ids[0], ids[1], ids[2], ids[5]]);
    sets.0.insert(1, vec![ids[0], ids[3], ids[4], ids[5], behind]);
    let mut residency = Residency::new(100);
    let mut update = |budget| {
        residency.update(&scene, &mut sets, &ALL, &[place(0.0), place(1.0)], |_| 10, budget);
        (objects(residency.loads()), residency.is_complete())
    };
    assert_eq!(update(0), (vec![], false), "no budget");
    assert_eq!(update(5), (vec![ids[3]], false), "the largest that is seen now, 5 bytes over the budget");
    assert_eq!(update(5), (vec![], false), "the debt is paid");
    assert_eq!(update(25), (vec![ids[4], behind, ids[1]], true), "then the others, and what is seen next");
    assert_eq!(update(10), (vec![ids[2]], true), "5 bytes of debt, and 5 over");
    assert_eq!(update(100), (vec![], true), "what is hidden from both places stays out");
}

#[test]
fn what_is_hidden_from_all_places_is_dropped_first_and_what_may_be_visible_never() {
    let (mut scene, ids) = slabs(7);
    let mut sets = Given::default();
    sets.0.insert(0, vec![]);
    let mut residency = Residency::new(40);
    residency.update(&scene, &mut sets, &ALL, &[place(0.0)], |_| 10, 1000);
    assert_eq!(objects(residency.loads()), ids[..4], "as many as there is room for");
    assert!(residency.drops().is_empty() && !residency.is_complete(), "all may be visible");
    // Now only 4, 5 and 6 are seen; 3 will be.
    sets.0.insert(0, ids[..4].to_vec());
    sets.0.insert(1, [&ids[..3], &ids[4..]].concat());
    let places = [place(0.0), place(1.0)];
    residency.update(&scene, &mut sets, &ALL, &places, |_| 10, 20);
    assert_eq!(objects(residency.loads()), [ids[4], ids[5]], "as many as the budget allows");
    assert_eq!(objects(residency.drops()), [ids[2], ids[1]], "the least important of what is not needed");
    // Not known yet what is seen from the first place: anything may be.
    let now = sets.0.remove(&0);
    residency.update(&scene, &mut sets, &ALL, &places, |_| 10, 1000);
    assert_eq!((residency.loads(), residency.drops()), (&[][..], &[][..]), "there is no room without drops");
    // Known now, but not what is seen next: what is needed now is loaded at the cost of anything else.
    sets.0 = now.map(|now| (0, now)).into_iter().collect();
    residency.update(&scene, &mut sets, &ALL, &places, |_| 10, 1000);
    assert_eq!(objects(residency.drops()), [ids[3]], "all may be needed next: the least important goes");
    assert_eq!((objects(residency.loads()), residency.is_complete()), (vec![ids[6]], true), "all seen now");
    // What is seen next is loaded, but drops nothing that may be needed at an unknown place before: 0, which
    // is hidden from the other places.
    sets.0.insert(2, [&ids[..1], &ids[3..]].concat());
    let later = [place(0.0), place(1.0), place(2.0)];
    residency.update(&scene, &mut sets, &ALL, &later, |_| 10, 1000);
    assert_eq!((residency.loads(), residency.drops()), (&[][..], &[][..]), "1 and 2 find no room");
    scene.remove(ids[0]).unwrap();
    residency.update(&scene, &mut sets, &ALL, &[], |_| 10, 1000);
    assert_eq!(objects(residency.drops()), [ids[0]], "removed objects are dropped without places too");
    residency.update(&scene, &mut sets, &ALL, &later, |_| 10, 1000);
    assert_eq!(objects(residency.loads()), [ids[1]], "there is room for one");
    sets.0.insert(1, ids.clone());
    residency.update(&scene, &mut sets, &ALL, &later, |_| 10, 1000);
    assert_eq!((residency.loads(), residency.drops()), (&[][..], &[][..]), "2 is not needed sooner than 1");
}

#[test]
fn objects_that_are_never_culled_or_do_not_fit_hold_up_nothing() {
    let (mut scene, ids) = slabs(3);
    let never =
        scene.insert(Object { never_cull: true, ..Object::new(Aabb::from_arrays([90.0; 3], [91.0; 3])) });
    let mut sets = Given::default();
    sets.0.insert(0, vec![ids[1], never]);
    let mut residency = Residency::new(50);
    let size = |id: ObjectId| if id == ids[0] { 51 } else { 10 };
    residency.update(&scene, &mut sets, &ALL, &[place(0.0)], size, 1000);
    assert_eq!(objects(residency.loads()), [ids[2], never], "the first is larger than the limit");
    assert!(!residency.is_complete(), "the first is missing");
    let mut residency = Residency::new(u64::MAX);
    residency.update(&scene, &mut sets, &ALL, &[place(0.0)], |_| u64::MAX, u64::MAX);
    assert_eq!((residency.loads().len(), residency.bytes()), (1, u64::MAX), "no overflow");
    residency.update(&scene, &mut sets, &ALL, &[place(0.0)], |_| 1, u64::MAX);
    assert_eq!(residency.loads(), [], "the memory is full");
}

#[test]
fn an_object_that_finds_no_room_costs_nothing_and_holds_up_no_other() {
    let (scene, ids) = slabs(12);
    // From place 0 the first two are seen, from place 1 all but these and the last one. The second is large.
    let mut sets = Given::default();
    sets.0.insert(0, ids[2..].to_vec());
    sets.0.insert(1, vec![ids[0], ids[1], ids[11]]);
    let mut residency = Residency::new(100);
    let mut update = |sets: &mut Given, large| {
        let size = |id: ObjectId| if id == ids[1] { large } else { 10 };
        residency.update(&scene, sets, &ALL, &[place(0.0), place(1.0)], size, 1000);
        (objects(residency.loads()), objects(residency.drops()), residency.is_complete())
    };
    let (mut loads, drops, is_complete) = update(&mut sets, 101);
    loads.sort_unstable_by_key(|id| id.index());
    assert_eq!(loads, [&ids[..1], &ids[2..11]].concat(), "all but the one that is larger than the memory");
    assert!(drops.is_empty() && !is_complete, "one is missing");
    assert_eq!(update(&mut sets, 95), (vec![], vec![], false), "90 bytes may go, and 95 are needed");
    // Now the last one is seen, too, after the large one.
    sets.0.insert(0, ids[2..11].to_vec());
    assert_eq!(update(&mut sets, 95), (vec![ids[11]], vec![ids[10]], false), "10 bytes go for 10");
    let (loads, drops, is_complete) = update(&mut sets, 80);
    assert_eq!((loads, drops.len(), is_complete), (vec![ids[1]], 8, true), "80 bytes go for 80");
    assert!(drops.iter().all(|id| ids[2..10].contains(id)), "those needed later go: {drops:?}");
    let mut residency = Residency::new(50);
    let size = |id: ObjectId| if id == ids[0] { 51 } else { 50 };
    residency.update(&scene, &mut sets, &ALL, &[place(0.0)], size, 1000);
    assert_eq!(objects(residency.loads()), [ids[1]], "what is as large as the memory fits");
    let mut alike = Scene::new();
    let ids = alike.insert_batch([Aabb::from_arrays([9.0; 3], [10.0; 3]); 9]);
    let mut residency = Residency::new(50);
    residency.update(&alike, &mut Given::default(), &ALL, &[place(0.0)], |_| 10, 1000);
    assert_eq!(objects(residency.loads()), ids[..5], "equal ones come by index");
}

/// Returns a scene of 40 objects far from a grid of 4 x 4 viewcells of 2 m, whose rows are random.
fn baked(random: &mut Random) -> (Scene, ScenePvs, Vec<Vec<u32>>) {
    let mut scene = Scene::new();
    let wall =
        scene.insert(Object { occluder: true, ..Object::new(Aabb::from_arrays([99.0; 3], [100.0; 3])) });
    let far = |i: usize| Aabb::from_arrays([50.0, i as f32, 0.0], [51.0, i as f32 + 0.5, 1.0]);
    let mut ids = scene.insert_batch((0..39).map(far));
    ids.insert(0, wall);
    let cells = (0..16).map(|i| {
        let min = DVec3::new(f64::from(i % 4), f64::from(i / 4), 0.0) * 2.0;
        Viewcell::from_box(min, min + 2.0)
    });
    let rows: Vec<Vec<u32>> = (0..16).map(|_| (0..40).filter(|_| random.below(8) == 0).collect()).collect();
    let pvs = Pvs::new(PvsTargets::Objects, 40, &rows, |_| []).unwrap();
    let sets = ScenePvs::new(&scene, pvs, Viewcells::new(cells), ids.iter().copied().zip(0..));
    let sets = sets.with_occluders(&scene, [wall]);
    (scene, sets, rows)
}

#[test]
fn a_baked_set_hides_from_a_box_what_no_viewcell_in_it_sees() {
    let mut random = Random(8);
    let (mut answers, mut none) = (0, 0);
    for round in 0..200 {
        let (scene, sets, rows) = baked(&mut random);
        let mut culler = PvsCuller::new(&sets);
        let min = DVec3::new(random.unit(), random.unit(), random.unit()) * DVec3::new(9.0, 9.0, 2.2) - 0.3;
        let size = DVec3::new(random.unit(), random.unit(), 0.2 * random.unit()) * 3.0;
        let max = min + size;
        let mut hidden = Bits::EMPTY;
        let is_known = culler.write_hidden(&scene, &ALL, min, max, &mut hidden);
        let is_inside = min.cmpge(DVec3::ZERO).all() && max.cmple(DVec3::new(8.0, 8.0, 2.0)).all();
        assert_eq!(is_known, is_inside, "round {round}: from {min} to {max}");
        if !is_known {
            none += 1;
            continue;
        }
        answers += 1;
        let [low, high] = [min, max].map(|corner| (corner * 0.5).to_array().map(|x| x as usize));
        let cells = (low[1]..=high[1]).flat_map(|y| (low[0]..=high[0]).map(move |x| 4 * y + x));
        let seen: Vec<u32> = cells.flat_map(|cell| rows[cell].iter().copied()).collect();
        for id in scene.ids() {
            let expected = !seen.contains(&(id.index() as u32));
            assert_eq!(hidden.contains(id.index()), expected, "round {round}: {id} from {min} to {max}");
        }
    }
    assert!(answers > 40 && none > 40, "{answers} answers, {none} boxes without one");
}

#[test]
fn a_baked_set_knows_nothing_after_its_occluder_has_changed_or_for_improper_boxes() {
    let (mut scene, sets, _) = baked(&mut Random(1));
    let mut culler = PvsCuller::new(&sets);
    let mut hidden = Bits::EMPTY;
    let [min, max] = [DVec3::ONE, DVec3::splat(1.5)];
    assert!(culler.write_hidden(&scene, &ALL, min, max, &mut hidden), "a box in a viewcell");
    let some = hidden.iter().find(|&index| index > 0).expect("objects are hidden");
    for [min, max] in [[max, min], [DVec3::NAN, max], [min, DVec3::INFINITY], [min, DVec3::splat(3.0)]] {
        assert!(!culler.write_hidden(&scene, &ALL, min, max, &mut hidden), "from {min} to {max}");
    }
    let id = scene.id_at(some).unwrap();
    scene.set_bounds(id, Aabb::from_arrays([60.0; 3], [61.0; 3])).unwrap();
    assert!(culler.write_hidden(&scene, &ALL, min, max, &mut hidden), "an object moved");
    assert!(!hidden.contains(some) && hidden.count() > 0, "what moved may be visible");
    let other = hidden.iter().find(|&index| index > 0).expect("another object is hidden");
    assert!(
        !PvsCuller::new(&sets).write_hidden(&scene.clone(), &ALL, min, max, &mut hidden),
        "another scene"
    );
    scene.set_bounds(scene.id_at(0).unwrap(), Aabb::from_arrays([98.0; 3], [99.0; 3])).unwrap();
    assert!(!culler.write_hidden(&scene, &ALL, min, max, &mut hidden), "an occluder moved, {other}");
}

#[test]
fn a_point_is_a_box_and_one_without_end_is_none() {
    let mut scene = Scene::new();
    let far = scene.insert(Aabb::from_arrays([90.0; 3], [91.0; 3]));
    let pvs = Pvs::new(PvsTargets::Objects, 1, &[vec![]; 1], |_| []).unwrap();
    let everywhere = Viewcell::from_box(DVec3::NEG_INFINITY, DVec3::INFINITY);
    let sets = ScenePvs::new(&scene, pvs, Viewcells::new([everywhere]), [(far, 0)]);
    let mut culler = PvsCuller::new(&sets);
    let mut seen = |min, max| seen_from(&scene, &mut culler, [min, max]);
    assert_eq!(seen(DVec3::ONE, DVec3::ONE), Some(vec![]), "a point");
    assert_eq!(seen(DVec3::ONE, DVec3::new(1.0, 2.0, 1.0)), Some(vec![]), "a line");
    for axis in 0..3 {
        let mut end = DVec3::ONE;
        end[axis] = f64::INFINITY;
        assert_eq!(seen(DVec3::ONE, end), None, "without an end along axis {axis}");
        assert_eq!(seen(-end, DVec3::ONE), None, "without a beginning along axis {axis}");
        assert_eq!(seen(end, DVec3::INFINITY), None, "beyond everything along axis {axis}");
    }
}

#[test]
fn a_baked_set_knows_nothing_if_an_occluder_may_be_absent() {
    let (mut scene, _, _) = baked(&mut Random(1));
    let wall = scene.id_at(0).unwrap();
    scene.set_layers(wall, 0).unwrap();
    let pvs = Pvs::new(PvsTargets::Objects, 1, &[vec![]; 1], |_| []).unwrap();
    let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
    let sets = ScenePvs::new(&scene, pvs, Viewcells::new([cell]), [(scene.id_at(1).unwrap(), 0)]);
    let is_known = |sets: &ScenePvs| {
        PvsCuller::new(sets).write_hidden(&scene, &ALL, DVec3::ZERO, DVec3::ONE, &mut Bits::new(0))
    };
    assert!(is_known(&sets), "no occluder");
    assert!(!is_known(&sets.with_occluders(&scene, [wall])), "an occluder that no view shows");
}

#[test]
fn what_is_behind_a_wall_is_needed_if_any_view_does_not_draw_the_wall() {
    let (mut scene, _, _) = baked(&mut Random(1));
    let [wall, behind, other] = [0, 1, 2].map(|index| scene.id_at(index).unwrap());
    for (id, layers) in [(wall, 4), (behind, 1), (other, 8)] {
        scene.set_layers(id, layers).unwrap();
    }
    let pvs = Pvs::new(PvsTargets::Objects, 1, &[vec![]; 1], |_| []).unwrap();
    let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
    let sets = ScenePvs::new(&scene, pvs, Viewcells::new([cell]), [(behind, 0)]);
    let sets = sets.with_occluders(&scene, [wall]);
    let mut culler = PvsCuller::new(&sets);
    for (layers, is_known, needed) in [
        (&[5][..], true, [true, false, false]),
        (&[5, 13], true, [true, false, true]),
        (&[4], true, [true, false, false]),
        (&[1], false, [false, true, false]),
        (&[5, 1], false, [true, true, false]),
        (&[4, 1], false, [true, true, false]),
        (&[0], false, [false; 3]),
        (&[], true, [false; 3]),
    ] {
        let known = culler.write_hidden(&scene, layers, DVec3::ZERO, DVec3::ONE, &mut Bits::new(0));
        assert_eq!(known, is_known, "views of the layers {layers:?}: the answer is known");
        let mut residency = Residency::new(u64::MAX);
        residency.update(&scene, &mut culler, layers, &[[DVec3::ZERO, DVec3::ONE]], |_| 1, u64::MAX);
        let loaded = [wall, behind, other].map(|id| residency.contains(id));
        assert_eq!(loaded, needed, "views of the layers {layers:?}: wall, behind it, on another layer");
    }
}

#[test]
fn a_box_sees_what_a_viewcell_in_its_middle_sees() {
    let mut scene = Scene::new();
    let far = scene.insert(Aabb::from_arrays([90.0; 3], [91.0; 3]));
    let rows: Vec<Vec<u32>> = (0..27).map(|i| if i == 13 { vec![0] } else { vec![] }).collect();
    // A plane that cuts nothing off: such viewcells are tested at the sides of the box.
    for planes in [vec![], vec![Plane::new(DVec3::X, 9.0)]] {
        let cells = (0..27).map(|i| {
            let min = DVec3::new(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9));
            Viewcell { planes: planes.clone(), ..Viewcell::from_box(min, min + 1.0) }
        });
        let pvs = Pvs::new(PvsTargets::Objects, 1, &rows, |_| []).unwrap();
        let sets = ScenePvs::new(&scene, pvs, Viewcells::new(cells), [(far, 0)]);
        let mut culler = PvsCuller::new(&sets);
        let mut seen = |min: f64, max: f64| {
            seen_from(&scene, &mut culler, [min, max].map(DVec3::splat)).map(|seen| seen.len())
        };
        assert_eq!(seen(0.1, 0.9), Some(0), "a corner, {planes:?}");
        assert_eq!(seen(0.5, 2.5), Some(1), "around the middle, {planes:?}");
    }
}

#[test]
fn what_reaches_into_the_box_is_not_hidden_in_a_gap_between_viewcells() {
    // Viewcells around a gap of 2 m. Neither sees the object in the gap.
    let mut scene = Scene::new();
    let inside = scene.insert(Aabb::from_arrays([0.9; 3], [1.1; 3]));
    let beside = scene.insert(Aabb::from_arrays([9.0; 3], [9.1; 3]));
    let sides = (0..6).map(|i| {
        let (mut min, mut max) = (DVec3::splat(-1.0), DVec3::splat(3.0));
        if i < 3 {
            max[i] = 0.5
        } else {
            min[i - 3] = 1.5
        }
        Viewcell::from_box(min, max)
    });
    let pvs = Pvs::new(PvsTargets::Objects, 2, &vec![Vec::<u32>::new(); 6], |_| []).unwrap();
    let sets = ScenePvs::new(&scene, pvs, Viewcells::new(sides), [(inside, 0), (beside, 1)]);
    let mut hidden = Bits::EMPTY;
    assert!(
        PvsCuller::new(&sets).write_hidden(&scene, &ALL, DVec3::ZERO, DVec3::splat(2.0), &mut hidden),
        "sides"
    );
    assert_eq!(
        [inside, beside].map(|id| hidden.contains(id.index())),
        [false, true],
        "in the gap, and beside"
    );
}

/// Returns a set in which viewcell `i` sees the object of index `i` alone, and the scene: its origin is
/// `origin`, and the objects are some 100 m from it.
fn one_object_each(cells: Viewcells, origin: DVec3) -> (Scene, ScenePvs) {
    let mut scene = Scene::new();
    scene.set_origin(origin).unwrap();
    let count = cells.cells().len();
    let far = |i: usize| Aabb::from_arrays([100.0, i as f32, 0.0], [101.0, i as f32, 1.0]);
    let ids = scene.insert_batch((0..count).map(far));
    let rows: Vec<[u32; 1]> = (0..count as u32).map(|i| [i]).collect();
    let pvs = Pvs::new(PvsTargets::Objects, count, &rows, |_| []).unwrap();
    let sets = ScenePvs::new(&scene, pvs, cells, ids.into_iter().zip(0..));
    (scene, sets)
}

/// Returns the indices of the objects that are seen from a box. `None` if the answer is not known.
fn seen_from(scene: &Scene, culler: &mut PvsCuller<&ScenePvs>, [min, max]: [DVec3; 2]) -> Option<Vec<usize>> {
    let mut hidden = Bits::EMPTY;
    let is_known = culler.write_hidden(scene, &ALL, min, max, &mut hidden);
    is_known.then(|| scene.ids().map(|id| id.index()).filter(|index| !hidden.contains(*index)).collect())
}

/// Origins of scenes, in metres.
const ORIGINS: [DVec3; 3] = [DVec3::ZERO, DVec3::splat(1e6), DVec3::new(-1e6, 3.1e6, -0.1)];

#[test]
fn an_object_is_in_the_box_up_to_the_step_beside_it() {
    for origin in ORIGINS {
        let mut scene = Scene::new();
        scene.set_origin(origin).unwrap();
        let one = 1.0f32;
        let places = [(one.next_down(), true), (one, true), (one.next_up().next_up(), false)];
        let mut expected = Vec::new();
        for (axis, (near, is_inside)) in (0..3).flat_map(|axis| places.map(|place| (axis, place))) {
            // Beyond the greater side, beyond the lesser side, and around the box on the other axes.
            let (mut min, mut max) = ([-5.0; 3], [5.0; 3]);
            (min[axis], max[axis]) = (near, 2.0);
            expected.push((scene.insert(Aabb::from_arrays(min, max)), is_inside));
            (min[axis], max[axis]) = (-2.0, -near);
            expected.push((scene.insert(Aabb::from_arrays(min, max)), is_inside));
        }
        let pvs = Pvs::new(PvsTargets::Objects, expected.len(), &[vec![]; 1], |_| []).unwrap();
        let cells = Viewcells::new([Viewcell::from_box(origin - 9.0, origin + 9.0)]);
        let sets = ScenePvs::new(&scene, pvs, cells, expected.iter().map(|&(id, _)| id).zip(0..));
        let mut hidden = Bits::EMPTY;
        let [min, max] = [origin - 1.0, origin + 1.0];
        assert!(PvsCuller::new(&sets).write_hidden(&scene, &ALL, min, max, &mut hidden), "origin {origin}");
        for (id, is_inside) in expected {
            let bounds = scene.bounds(id).unwrap();
            assert_eq!(hidden.contains(id.index()), !is_inside, "origin {origin}: {id} with {bounds:?}");
        }
    }
}

#[test]
fn viewcells_with_planes_are_reached_and_cover_up_to_their_planes() {
    let mut random = Random(5);
    for origin in ORIGINS {
        // Two prisms of a cube of 2 m, and the same cube without the second.
        let normal = DVec3::new(3.0, 4.0, 0.5);
        let plane = Plane::new(normal, -normal.dot(origin + 1.0));
        let half = |plane| Viewcell { planes: vec![plane], ..Viewcell::from_box(origin, origin + 2.0) };
        let halves = [half(plane), half(plane.flipped())];
        let (scene, both) = one_object_each(Viewcells::new(halves.clone()), origin);
        let (other, first) = one_object_each(Viewcells::new(halves.into_iter().take(1)), origin);
        let (mut both, mut first) = (PvsCuller::new(&both), PvsCuller::new(&first));
        let mut counts = [0; 3];
        for _ in 0..300 {
            let mut point = || DVec3::new(random.unit(), random.unit(), random.unit()) * 2.0;
            let [a, b] = [(); 2].map(|_| origin + point());
            let sides = [a.min(b), a.max(b)];
            // Distances of the two extreme corners, in the direction of the normal, whose length is 5.
            let [low, high] = sides.map(|corner| normal.dot(corner - origin - 1.0));
            let case = format!("from {} to {}", sides[0], sides[1]);
            let expected = match () {
                () if low > 1e-6 => [Some(vec![0]), Some(vec![0])],
                () if high < -1e-6 => [Some(vec![1]), None],
                () if low < -1e-6 && high > 1e-6 => [Some(vec![0, 1]), None],
                () => continue,
            };
            counts[expected[0].as_ref().map_or(0, |seen| seen.iter().sum::<usize>() + seen.len() - 1)] += 1;
            let answers = [seen_from(&scene, &mut both, sides), seen_from(&other, &mut first, sides)];
            assert_eq!(answers, expected, "{case}");
        }
        assert!(counts[0] > 20 && counts[1] > 20 && counts[2] > 20, "{counts:?} boxes of each kind");
    }
}

#[test]
fn what_is_nearer_than_the_misplacement_of_viewcells_is_touched_and_leaves_no_gap() {
    for origin in ORIGINS {
        let slab = |from: f64, to: f64| {
            Viewcell::from_box(origin + DVec3::X * from, origin + DVec3::new(to, 2.0, 2.0))
        };
        let of = |second: f64| {
            let cells = [slab(0.0, 1.0), slab(second, 2.0)];
            one_object_each(Viewcells::of_divided_box(cells, origin, origin + 2.0, 0.01), origin)
        };
        let seen = |(scene, sets): &(Scene, ScenePvs), from: f64, to: f64| {
            let sides = [DVec3::new(from, 0.5, 0.5), DVec3::new(to, 1.5, 1.5)].map(|corner| origin + corner);
            seen_from(scene, &mut PvsCuller::new(sets), sides)
        };
        let joined = of(1.0);
        assert_eq!(seen(&joined, 0.2, 0.989), Some(vec![0]), "{origin}: farther from the second");
        assert_eq!(seen(&joined, 0.2, 0.991), Some(vec![0, 1]), "{origin}: nearer to the second");
        assert_eq!(seen(&of(1.019), 0.2, 1.8), Some(vec![0, 1]), "{origin}: a gap of less than .02");
        assert_eq!(seen(&of(1.021), 0.2, 1.8), None, "{origin}: a gap of more than .02");
    }
}

#[test]
fn a_box_over_thousands_of_viewcells_of_a_grid_is_covered() {
    let cells = (0..16 * 16 * 16).map(|i| {
        let min = DVec3::new(f64::from(i % 16), f64::from(i / 16 % 16), f64::from(i / 256));
        Viewcell::from_box(min, min + 1.0)
    });
    let (scene, sets) = one_object_each(Viewcells::new(cells), DVec3::ZERO);
    let mut culler = PvsCuller::new(&sets);
    let mut seen = |min: f64, max: f64| {
        seen_from(&scene, &mut culler, [DVec3::splat(min), DVec3::splat(max)]).map(|seen| seen.len())
    };
    assert_eq!(seen(0.0, 16.0), Some(4096), "a box over all");
    assert_eq!(seen(-0.1, 15.5), None, "a box that reaches out");
    assert_eq!(seen(0.5, 14.5), Some(15 * 15 * 15), "a smaller box");
}

#[test]
fn a_set_that_is_replaced_and_boxes_in_turn_have_their_own_answers() {
    let cells = |first: f64| {
        let cells = [first, 3.0 - first].map(|x| DVec3::X * x);
        Viewcells::new(cells.map(|min| Viewcell::from_box(min, min + DVec3::new(1.5, 2.0, 2.0))))
    };
    let (scene, sets) = one_object_each(cells(0.0), DVec3::ZERO);
    // The same viewcells and objects, and what the first one saw is seen by the second.
    let pvs = Pvs::new(PvsTargets::Objects, 2, &[[1], [0]], |_| []).unwrap();
    let other = ScenePvs::new(&scene, pvs, cells(0.0), scene.ids().zip(0..));
    let mut culler = PvsCuller::new(&sets);
    let places = [0.5, 3.5].map(|x| [DVec3::new(x, 0.5, 0.5), DVec3::new(x + 0.1, 1.0, 1.0)]);
    let outside = [DVec3::splat(1.0), DVec3::splat(1.6)];
    for expected in [[0, 1], [1, 0]] {
        // The last place of the set before, whose viewcells are the same.
        assert_eq!(seen_from(&scene, &mut culler, places[1]), Some(vec![expected[1]]), "a new set");
        for _ in 0..2 {
            for (place, seen) in places.into_iter().zip(expected) {
                assert_eq!(seen_from(&scene, &mut culler, place), Some(vec![seen]), "{place:?}");
                assert_eq!(seen_from(&scene, &mut culler, outside), None, "partly outside");
                assert_eq!(seen_from(&scene, &mut culler, place), Some(vec![seen]), "{place:?} again");
            }
        }
        *culler.shared_mut() = &other;
    }
}

#[test]
fn a_crafted_order_of_sizes_asks_each_size_a_few_times() {
    let (scene, ids) = slabs(400);
    let mut sets = Given::default();
    let mut free = Residency::new(u64::MAX);
    free.update(&scene, &mut sets, &ALL, &[place(0.0)], |_| 1, u64::MAX);
    let order = objects(free.loads());
    assert_eq!(order.len(), ids.len(), "all are needed");
    // Every other object is a byte larger than the room that is left when its turn comes, and fits into the
    // room that is left at all earlier turns. The objects between take a byte each.
    let limit = ids.len() as u64;
    let mut sizes = vec![1; scene.index_limit()];
    (0..).zip(&order).filter(|(i, _)| i % 2 == 0).for_each(|(i, id)| sizes[id.index()] = limit - i / 2 + 1);
    let mut residency = Residency::new(limit);
    let mut calls = 0;
    let size = |id: ObjectId| {
        calls += 1;
        sizes[id.index()]
    };
    residency.update(&scene, &mut sets, &ALL, &[place(0.0)], size, u64::MAX);
    let small: Vec<ObjectId> = order.iter().copied().skip(1).step_by(2).collect();
    assert_eq!(objects(residency.loads()), small, "the objects of a byte");
    assert!(calls <= ids.len(), "{calls} sizes of {} objects", ids.len());
}
