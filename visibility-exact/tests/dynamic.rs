//! Verdicts that are kept while occluders move, are taken away and put up, against queries from the start,
//! the check of proofs, and segments in exact arithmetic.

use crate::common::grid::{FINE, misses_triangle, on_grid, start_of_segment, triangle_on_grid};
use crate::common::{Triangle, clearance, cuboid, faces, is_clear};
use std::cell::Cell;
use std::sync::Arc;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Object, ObjectId, Scene};
use visibility_exact::{
    DynamicCell, Effort, ExactCuller, ExactSettings, SceneTriangles, UpdateStats, Verdict,
};
use visibility_testing::{Random, judged, told_enough};

/// A scene of a test: the triangles of its objects by index, none for removed objects, and whether they
/// occlude.
struct World {
    scene: Scene,
    objects: Vec<Vec<Triangle>>,
    occludes: Vec<bool>,
}

impl World {
    fn insert(&mut self, triangles: Vec<Triangle>, occluder: bool) {
        let bounds = Aabb::from_points(triangles.iter().flatten().copied());
        let id = self.scene.insert(Object { occluder, ..Object::new(bounds) });
        self.scene.set_triangles(id, triangles.clone()).unwrap();
        if self.objects.len() <= id.index() {
            self.objects.resize(id.index() + 1, Vec::new());
            self.occludes.resize(id.index() + 1, false);
        }
        (self.objects[id.index()], self.occludes[id.index()]) = (triangles, occluder);
    }

    fn remove(&mut self, id: ObjectId) {
        self.scene.remove(id).unwrap();
        self.objects[id.index()].clear();
    }

    fn reshape(&mut self, id: ObjectId, triangles: Vec<Triangle>) {
        let bounds = Aabb::from_points(triangles.iter().flatten().copied());
        self.scene.set_bounds(id, bounds).unwrap();
        self.scene.set_triangles(id, triangles.clone()).unwrap();
        self.objects[id.index()] = triangles;
    }

    /// Returns the triangles of the objects that occlude, with no triangles for the others.
    fn occluders(&self) -> Vec<Vec<Triangle>> {
        let all = self.objects.iter().zip(&self.occludes);
        all.map(|(triangles, &occludes)| if occludes { triangles.clone() } else { Vec::new() }).collect()
    }
}

/// The viewcell is at x from -3 to -2, and targets of one triangle are at x from 13 to 15.
fn target(random: &mut Random) -> Vec<Triangle> {
    loop {
        let mut int = |a: i32, b: i32| f64::from(random.between(a, b));
        let t: [DVec3; 3] = core::array::from_fn(|_| DVec3::new(int(13, 15), int(1, 10), int(1, 10)));
        if (t[1] - t[0]).cross(t[2] - t[0]).length() > 1.0 {
            return vec![t.map(DVec3::as_vec3)];
        }
    }
}

/// A box or a plate with integer coordinates, at x from 0 to 12. Plates are straight or slanted.
fn occluder(random: &mut Random) -> Vec<Triangle> {
    let mut int = |a: i32, b: i32| f64::from(random.between(a, b));
    let size = if int(0, 2) == 0.0 {
        DVec3::new(int(1, 2), int(6, 14), int(6, 14))
    } else {
        DVec3::new(int(1, 3), int(1, 8), int(1, 8))
    };
    let min = DVec3::new(int(0, 10), int(-4, 9), int(-4, 9));
    let max = (min + size).min(DVec3::new(12.0, 40.0, 40.0));
    let slant = |v: Vec3| v + Vec3::X * ((v.y + v.z) * 0.25).round();
    match int(0, 3) as u32 {
        0 => cuboid(min, max),
        1 => faces(min, max)
            .swap_remove(1)
            .into_iter()
            .map(|t| t.map(|v| slant(v).clamp(Vec3::splat(-40.0), Vec3::new(13.0, 40.0, 40.0))))
            .collect(),
        _ => faces(min, max).swap_remove([0, 0, 2, 4][int(0, 3) as usize]),
    }
}

fn world(random: &mut Random) -> (Viewcell, World) {
    let mut int = |a: i32, b: i32| f64::from(random.between(a, b));
    let cell = Viewcell::from_box(DVec3::new(-3.0, 3.0, 4.0), DVec3::new(-2.0, int(4, 6), int(5, 7)));
    let mut world = World { scene: Scene::new(), objects: Vec::new(), occludes: Vec::new() };
    for _ in 0..4 + random.below(4) {
        let occludes = random.one_in(2);
        world.insert(target(random), occludes);
    }
    for _ in 0..8 + random.below(12) {
        world.insert(occluder(random), true);
    }
    (cell, world)
}

/// Changes an object: takes it away, puts up another, moves it by whole metres, makes it stop or begin to
/// occlude, or opens slits of up to 3 mm beside it.
fn edit(random: &mut Random, world: &mut World, taken: &mut Vec<(Vec<Triangle>, bool)>) {
    let ids: Vec<ObjectId> = world.scene.ids().collect();
    let id = random.pick(&ids);
    let index = id.index();
    match random.below(8) {
        0..=2 if ids.len() > 5 => {
            taken.push((world.objects[index].clone(), world.occludes[index]));
            world.remove(id);
        }
        3..=4 if !taken.is_empty() => {
            let (triangles, occludes) = taken.swap_remove(random.below(taken.len()));
            world.insert(triangles, occludes);
        }
        5 => {
            // The grid of the oracle has 4096 steps to the metre. Targets keep whole coordinates.
            let is_target = world.objects[index][0][0].x >= 13.0;
            let (most, step) = if is_target || random.one_in(2) { (3, 1.0) } else { (12, 4096.0) };
            let mut int = || random.between(-most, most) as f32 / step;
            let by = Vec3::new(0.0, int(), int());
            let moved = world.objects[index].iter().map(|t| t.map(|v| v + by)).collect();
            world.reshape(id, moved);
        }
        6 => {
            let is_target = world.objects[index][0][0].x >= 13.0;
            let other = if is_target { target(random) } else { occluder(random) };
            world.reshape(id, other);
        }
        7 => {
            world.occludes[index] = !world.occludes[index];
            world.scene.set_occluder(id, world.occludes[index]).unwrap();
        }
        _ => {
            let occludes = !random.one_in(4);
            world.insert(occluder(random), occludes);
        }
    }
}

fn settings(c: f64) -> ExactSettings {
    ExactSettings::new(Effort::Exact(c)).with_rays(200).with_aimed_rays(10)
}

/// Number of segments, of `shots` shot from the viewcell at points inside the triangles of an object, that
/// keep more than `allowed` metres from the triangles of all other objects that occlude.
fn passing(
    random: &mut Random,
    world: &World,
    cell: &Viewcell,
    index: usize,
    shots: usize,
    allowed: f64,
) -> usize {
    let occluders = world.occluders();
    let others = occluders.iter().enumerate().filter(|(other, _)| *other != index);
    let others: Vec<Triangle> = others.flat_map(|(_, triangles)| triangles).copied().collect();
    let exact: Vec<_> = others.iter().map(triangle_on_grid).collect();
    let own: Vec<_> = occluders[index].iter().map(triangle_on_grid).collect();
    let mut count = 0;
    // Points inside triangles with whole coordinates are on the grid.
    let is_whole = world.objects[index].iter().flatten().all(|v| v.fract() == Vec3::ZERO);
    for shot in 0..if is_whole { shots } else { 0 } {
        let at = random.below(world.objects[index].len());
        let target = world.objects[index][at].map(Vec3::as_dvec3);
        let parts = [random.between(1, 2047), random.between(1, 2047)];
        let parts = [parts[0], parts[1], 4096 - parts[0] - parts[1]];
        let to = (0..3).map(|k| target[k] * f64::from(parts[k])).sum::<DVec3>() / FINE;
        let edge_of = (shot % 2 == 0 && !others.is_empty()).then(|| random.pick(&others));
        let from = start_of_segment(random, cell, to, edge_of);
        if !(from.cmpge(cell.min).all() && from.cmple(cell.max).all()) {
            continue;
        }
        let (p, q) = (on_grid(from), on_grid(to));
        let is_free = exact.iter().all(|t| misses_triangle(p, q, t));
        // Other triangles of the same object may be in the way.
        let is_first = own.iter().enumerate().all(|(k, t)| k == at || misses_triangle(p, q, t));
        if is_free && is_first && clearance(&occluders, index, from, to) > allowed {
            count += 1;
        }
    }
    count
}

/// Sums over all updates of a test.
#[derive(Default, Debug)]
struct Sums {
    /// Objects by kept verdict (seen, hidden, open) and by that of a query from the start.
    pairs: [[usize; 3]; 3],
    unproven: usize,
    mended: usize,
    blocked: usize,
    searched: usize,
    objects: usize,
    proofs: usize,
}

fn number(verdict: Verdict) -> usize {
    match verdict {
        Verdict::Seen(_) => 0,
        Verdict::Hidden | Verdict::Hardly(_) => 1,
        Verdict::Open => 2,
    }
}

/// Holds the verdicts of a viewcell against the scene as it is.
fn hold(
    world: &World,
    triangles: &SceneTriangles,
    kept: &DynamicCell,
    c: f64,
    random: &mut Random,
    sums: &mut Sums,
    what: &str,
) {
    for proof in kept.proofs() {
        proof.check(triangles).unwrap_or_else(|error| panic!("{what}: {error}"));
        sums.proofs += 1;
    }
    let occluders = world.occluders();
    let fresh_triangles = Arc::new(SceneTriangles::new(&world.scene));
    let fresh = ExactCuller::new(fresh_triangles.clone(), settings(c)).verdicts(kept.viewcell());
    let mut kept_verdicts: Vec<(ObjectId, Verdict)> = kept.iter().collect();
    kept_verdicts.sort_by_key(|(id, _)| id.index());
    assert!(kept_verdicts.iter().map(|(id, _)| *id).eq(world.scene.ids()), "{what}: all objects, once each");
    for ((id, verdict), (_, fresh)) in kept_verdicts.into_iter().zip(fresh.iter(&fresh_triangles)) {
        sums.pairs[number(verdict)][number(fresh)] += 1;
        sums.objects += 1;
        match verdict {
            Verdict::Seen(witness) => {
                assert!(is_clear(&occluders, id.index(), &witness), "{what}: {id} is seen along {witness:?}")
            }
            Verdict::Hidden => {
                let passing = passing(random, world, kept.viewcell(), id.index(), 30, 6.0 * c);
                assert_eq!(passing, 0, "{what}: segments to {id}, which is hidden");
            }
            _ => {}
        }
        let witness = match (verdict, fresh) {
            (Verdict::Seen(witness), Verdict::Hidden) | (Verdict::Hidden, Verdict::Seen(witness)) => witness,
            _ => continue,
        };
        let near = clearance(&occluders, id.index(), witness.from, witness.to);
        assert!(c > 0.0 && near <= 6.0 * c, "{what}: {id} is {verdict:?}, and {fresh:?} from the start");
    }
}

fn add(sums: &mut Sums, stats: UpdateStats) {
    sums.unproven += stats.unproven;
    sums.mended += stats.mended;
    sums.blocked += stats.blocked;
    sums.searched += stats.searched;
}

/// Changes random worlds step by step, one to three changes between updates.
fn sequences(worlds: std::ops::Range<u64>, edits: usize, c: f64) -> Sums {
    let mut sums = Sums::default();
    for number in worlds {
        let mut random = Random(number);
        let (cell, mut world) = world(&mut random);
        let mut triangles = SceneTriangles::new(&world.scene);
        let mut kept = DynamicCell::new(cell, settings(c));
        kept.update(&triangles, &|| false);
        let mut taken = Vec::new();
        for step in 0..edits {
            for _ in 0..1 + random.below(3) {
                edit(&mut random, &mut world, &mut taken);
                // Some changes are taken in one by one, others together.
                if random.one_in(2) {
                    triangles.sync(&world.scene);
                }
            }
            triangles.sync(&world.scene);
            add(&mut sums, kept.update(&triangles, &|| false));
            hold(
                &world,
                &triangles,
                &kept,
                c,
                &mut random,
                &mut sums,
                &format!("c {c}, world {number}, step {step}"),
            );
        }
    }
    sums
}

#[test]
fn verdicts_after_changes_are_those_of_the_present_scene() {
    for (c, worlds) in [(1e-4, 16), (0.0, 5)] {
        let sums = sequences(0..worlds, 10, c);
        judged(sums.objects as u64);
        let [seen, hidden, open] = sums.pairs.map(|row| row.iter().sum::<usize>());
        told_enough(
            seen > 200 && hidden > 200 && open * 12 < sums.objects,
            format_args!("c {c}: all verdicts occur: {sums:?}"),
        );
        told_enough(
            sums.unproven > 15 && sums.mended > 5 && sums.blocked > 8,
            format_args!("c {c}: all occur: {sums:?}"),
        );
        told_enough(
            sums.searched * 2 < sums.objects,
            format_args!("c {c}: most verdicts are kept: {sums:?}"),
        );
    }
}

/// A stopped update leaves objects open, and none wrong. Later updates decide them, also without a change.
#[test]
fn stopped_updates_hide_nothing_that_is_seen() {
    let (mut stopped, mut pending) = (0, 0);
    for number in 0..20 {
        let mut random = Random(number);
        let (cell, mut world) = world(&mut random);
        let mut triangles = SceneTriangles::new(&world.scene);
        let mut kept = DynamicCell::new(cell, settings(0.0));
        kept.update(&triangles, &|| false);
        let mut taken = Vec::new();
        for step in 0..6 {
            edit(&mut random, &mut world, &mut taken);
            triangles.sync(&world.scene);
            let (left, is_last) = (Cell::new(random.below(40)), step == 5);
            let stats = kept.update(&triangles, &|| {
                left.set(left.get().saturating_sub(1));
                left.get() == 0 && !is_last
            });
            stopped += usize::from(stats.pending > 0);
            pending += stats.pending;
            let mut sums = Sums::default();
            hold(
                &world,
                &triangles,
                &kept,
                0.0,
                &mut random,
                &mut sums,
                &format!("world {number}, step {step}"),
            );
        }
        let stats = kept.update(&triangles, &|| false);
        assert_eq!((stats.pending, stats.changed), (0, 0), "world {number}: nothing is left");
        let mut all = DynamicCell::new(kept.viewcell().clone(), settings(0.0));
        all.update(&triangles, &|| false);
        let [open, open_from_the_start] = [&kept, &all].map(|cell| cell.counts()[2]);
        assert!(
            open <= open_from_the_start + 1,
            "world {number}: {open} open, {open_from_the_start} from the start"
        );
    }
    assert!(stopped > 20 && pending > stopped, "{stopped} updates were stopped, with {pending} objects left");
}

/// Verdicts are not taken over from other triangles: of a clone that has changed otherwise, of another scene,
/// or of a state whose changes are forgotten.
#[test]
fn verdicts_of_other_triangles_are_found_anew() {
    let mut random = Random(3);
    let (cell, mut world) = world(&mut random);
    let mut triangles = SceneTriangles::new(&world.scene);
    let mut kept = DynamicCell::new(cell, settings(0.0));
    assert!(kept.update(&triangles, &|| false).searched > 0, "the first update searches all");
    assert_eq!(kept.update(&triangles, &|| false), UpdateStats::default(), "nothing has changed");
    let mut hold_now = |world: &World, triangles: &SceneTriangles, kept: &DynamicCell, what: &str| {
        hold(world, triangles, kept, 0.0, &mut random, &mut Sums::default(), what);
    };
    // A clone goes another way.
    let before = triangles.clone();
    let wall = world.scene.ids().last().unwrap();
    let shape = world.objects[wall.index()].clone();
    world.remove(wall);
    assert!(triangles.sync(&world.scene) && !triangles.sync(&world.scene), "one change, taken in once");
    let stats = kept.update(&triangles, &|| false);
    assert_eq!(stats.changed, 1, "one object has changed");
    hold_now(&world, &triangles, &kept, "without the wall");
    let mut other = before.clone();
    world.insert(shape, true);
    other.sync(&world.scene);
    let stats = kept.update(&other, &|| false);
    assert!(stats.changed == 0 && stats.searched == world.scene.len(), "a clone that has changed: {stats:?}");
    hold_now(&world, &other, &kept, "the clone");
    // Too many changes between two updates.
    let all: Vec<ObjectId> = world.scene.ids().collect();
    for step in 0..1500 {
        let id = all[step % all.len()];
        let up = if (step / all.len()).is_multiple_of(2) { Vec3::Y } else { -Vec3::Y };
        let moved = world.objects[id.index()].iter().map(|t| t.map(|v| v + up)).collect();
        world.reshape(id, moved);
        other.sync(&world.scene);
    }
    let stats = kept.update(&other, &|| false);
    assert!(stats.changed == 0 && stats.searched == world.scene.len(), "forgotten changes: {stats:?}");
    hold_now(&world, &other, &kept, "after 1500 changes");
    // A change that visibility does not depend on.
    world.scene.set_cost(all[0], 7).unwrap();
    assert!(!other.sync(&world.scene) && other.is_current(&world.scene), "costs do not matter");
    assert_eq!(kept.update(&other, &|| false), UpdateStats::default(), "costs do not matter");
    // Another origin.
    world.scene.set_origin(DVec3::X).unwrap();
    assert!(other.sync(&world.scene) && other.is_current(&world.scene), "all triangles are collected anew");
    assert_eq!(kept.update(&other, &|| false).searched, world.scene.len(), "all verdicts are found anew");
}

/// Number of doors, of `doors` with two leaves before a plate, behind which the plate is hidden once they are
/// open by 14 mm. Each is shut, opened twice, and shut again. The slit is upright or slanted.
fn hidden_behind_open_doors(doors: usize, clearance: f64) -> usize {
    let mut random = Random(5);
    let settings = ExactSettings::new(Effort::Exact(clearance)).with_rays(0).with_aimed_rays(0);
    let mut hidden = 0;
    for number in 0..doors {
        let slant = if number % 2 == 0 { 0.0 } else { random.fine_range(-0.5, 0.5) };
        let leaf = |from: f64, to: f64| {
            let [a, b] = [DVec3::new(5.0, from, -20.0), DVec3::new(5.0, to, 20.0)];
            let slanted = |v: Vec3| v + Vec3::Y * v.z * slant as f32;
            faces(a, b).swap_remove(0).into_iter().map(|t| t.map(slanted)).collect::<Vec<_>>()
        };
        let mut world = World { scene: Scene::new(), objects: Vec::new(), occludes: Vec::new() };
        let min = DVec3::new(9.0, random.fine_range(-0.5, 0.5), random.fine_range(-0.5, 0.5));
        world.insert(faces(min, min + DVec3::new(0.0, 0.8, 0.8)).swap_remove(0), false);
        world.insert(leaf(-40.0, 0.5), true);
        world.insert(leaf(0.5, 40.0), true);
        let mut triangles = SceneTriangles::new(&world.scene);
        let mut kept = DynamicCell::new(Viewcell::from_box(DVec3::ZERO, DVec3::ONE), settings);
        let door = world.scene.id_at(2).unwrap();
        for gap in [0.0, 14e-3, 0.0, 14e-3, 3.0, 0.0] {
            world.reshape(door, leaf(0.5 + gap, 40.0));
            triangles.sync(&world.scene);
            kept.update(&triangles, &|| false);
            let (_, plate) = kept.iter().next().unwrap();
            let what = format!("door {number}, open by {gap} m: {plate:?}");
            assert!(gap > 0.0 || plate == Verdict::Hidden, "{what}");
            assert!(gap < 1.0 || matches!(plate, Verdict::Seen(_)), "{what}");
            hidden += usize::from(gap > 0.0 && plate == Verdict::Hidden);
        }
    }
    hidden
}

/// A line of sight through the middle of an open door keeps 7 mm from both leaves. So the plate is never
/// hidden with a clearance of 1 mm. With 10 mm it often is, so a wrong clearance would show.
#[test]
fn doors_that_open_by_more_than_twelve_clearances_hide_nothing() {
    assert_eq!(hidden_behind_open_doors(20, 1e-3), 0, "times hidden with a clearance of 1 mm");
    let hidden = hidden_behind_open_doors(20, 1e-2);
    assert!(hidden > 5, "{hidden} of 40 times with a clearance of 10 mm");
}
