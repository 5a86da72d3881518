//! Tests of degrees of visibility: which are refused, whom they hide, and the order in which they load.

use std::sync::Arc;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{
    Pvs, PvsCuller, PvsError, PvsTargets, Residency, SampledDegree, SampledDegrees, ScenePvs, Viewcell,
    ViewcellId, Viewcells,
};
use visibility_core::{Aabb, Accuracy, Culler, ObjectId, Pose, Scene, View, VisibleSet};

use SampledDegree::{Hardly, Partly, Unseen, Widely};

/// Degrees of six objects from two rooms, `None` for an object that is hidden.
const DEGREES: [[Option<SampledDegree>; 6]; 2] = [
    [Some(Widely), Some(Partly), Some(Hardly), Some(Unseen), None, Some(Partly)],
    [Some(Unseen), None, Some(Widely), Some(Hardly), Some(Partly), Some(Hardly)],
];

fn set(rows: &[Vec<u32>], count: usize) -> Pvs {
    Pvs::new(PvsTargets::Objects, count, rows, |_| []).unwrap()
}

/// Returns the rows of the objects whose degree is at least `least`; of all that may be seen for `Unseen`.
fn rows(least: SampledDegree) -> Vec<Vec<u32>> {
    let row = |room: &[Option<SampledDegree>; 6]| {
        (0..)
            .zip(room)
            .filter(|(_, degree)| degree.is_some_and(|degree| degree >= least))
            .map(|(i, _)| i)
            .collect()
    };
    DEGREES.iter().map(row).collect()
}

fn at_least() -> [Pvs; 3] {
    [Hardly, Partly, Widely].map(|least| set(&rows(least), 6))
}

/// Returns six objects in a row, at x = 2, 4 and so on, and their sets from rooms before and after x = 0 that
/// all objects are in front of.
fn world() -> (Scene, Vec<ObjectId>, ScenePvs) {
    let mut scene = Scene::new();
    let at = |i: usize| Aabb::from_arrays([20.0 + i as f32, 0.0, 0.0], [20.5 + i as f32, 1.0, 1.0]);
    let ids = scene.insert_batch((0..6).map(at));
    let room = |x: f64| Viewcell::from_box(DVec3::new(x, -9.0, -9.0), DVec3::new(x + 10.0, 9.0, 9.0));
    let pvs = set(&rows(Unseen), 6);
    let degrees = SampledDegrees::new(&pvs, 32, at_least()).unwrap();
    let pairs = ids.iter().copied().zip(0..);
    let mut sets = ScenePvs::new(&scene, pvs, Viewcells::new([room(-10.0), room(0.0)]), pairs);
    sets.set_degrees(degrees).unwrap();
    (scene, ids, sets)
}

/// Returns a view along x from a point of the x axis, whose near plane is `near` metres from it.
fn view(x: f64, near: f64) -> View {
    let eye = DVec3::new(x, 0.5, 0.5);
    View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.0, 1.0, near, 100.0).unwrap()
}

fn culled(culler: &mut PvsCuller<Arc<ScenePvs>>, scene: &Scene, view: &View) -> Vec<usize> {
    let mut visible = VisibleSet::new();
    visible.fill(scene, view);
    culler.cull(scene, view, &mut visible);
    let mut indices: Vec<usize> = visible.iter(scene).map(ObjectId::index).collect();
    indices.sort_unstable();
    indices
}

#[test]
fn degrees_that_do_not_fit_are_refused() {
    let pvs = set(&rows(Unseen), 6);
    let made = |eyes, at_least| SampledDegrees::new(&pvs, eyes, at_least).map(|degrees| degrees.eyes());
    let refused = |made| matches!(made, Err(PvsError::Degrees { .. }));
    assert_eq!(made(7, at_least()), Ok(7), "degrees of the PVS");
    assert!(refused(made(0, at_least())), "no eyes");
    for at in 0..3 {
        let with = |other: Pvs| {
            let mut sets = at_least();
            sets[at] = other;
            sets
        };
        let (few_rows, few_targets) = (vec![vec![]], vec![vec![]; 2]);
        assert!(refused(made(7, with(set(&few_rows, 6)))), "set {at} of one viewcell");
        assert!(refused(made(7, with(set(&few_targets, 5)))), "set {at} of five targets");
        let cells = Pvs::new(PvsTargets::Cells, 6, &[vec![], vec![]], |_| []).unwrap();
        assert!(refused(made(7, with(cells))), "set {at} of cells");
    }
    let (_, _, mut sets) = world();
    let other = set(&[vec![]], 6);
    let none = || [(); 3].map(|()| set(&[vec![]], 6));
    let others = SampledDegrees::new(&other, 1, none()).unwrap();
    assert!(sets.set_degrees(others).is_err(), "degrees of another PVS");
    assert_eq!(sets.degrees().map(SampledDegrees::eyes), Some(32), "the degrees from before");
}

/// A target of a greater degree that lacks a lesser one, as a forged file may list it.
#[test]
fn a_degree_counts_up_to_the_first_set_that_lacks_the_target() {
    let all = || set(&[vec![0, 1], vec![]], 2);
    let degrees = SampledDegrees::new(&all(), 1, [all(), set(&[vec![0], vec![]], 2), all()]).unwrap();
    assert_eq!([0, 1].map(|target| degrees.degree(ViewcellId(0), target)), [Widely, Hardly], "degrees");
}

#[test]
fn solid_angles_are_in_the_class_that_they_do_not_exceed() {
    for degree in [Hardly, Partly] {
        let most = degree.most_shown();
        assert_eq!(SampledDegree::of(most), degree, "the greatest solid angle of {degree:?}");
        assert!(SampledDegree::of(most * 1.001) > degree, "a greater one than those of {degree:?}");
    }
    assert_eq!([0.0, -1.0, 1e-30, f64::NAN].map(SampledDegree::of), [Unseen, Unseen, Hardly, Widely], "ends");
    assert!(SampledDegree::ALL.is_sorted_by(|a, b| a < b && a.most_shown() < b.most_shown()), "order");
}

#[test]
fn a_culler_hides_by_degree_only_if_told_to() {
    let (scene, ids, sets) = world();
    let degrees = sets.degrees().unwrap().clone();
    let sets = Arc::new(sets);
    let seen = |room: usize, least| rows(least)[room].iter().map(|&index| index as usize).collect::<Vec<_>>();
    for (room, x) in [-5.0, 5.0].into_iter().enumerate() {
        for (target, degree) in (0..).zip(DEGREES[room]) {
            let stored = degrees.degree(ViewcellId(room as u32), target);
            assert_eq!(stored, degree.unwrap_or(Unseen), "room {room}, target {target}");
        }
        let mut plain = PvsCuller::new(sets.clone());
        assert_eq!(culled(&mut plain, &scene, &view(x, 0.1)), seen(room, Unseen), "room {room}, as baked");
        assert_eq!(plain.accuracy(), Accuracy::Conservative, "a culler that hides nothing by degree");
        for (id, degree) in ids.iter().zip(DEGREES[room]) {
            assert_eq!(plain.degree(*id), Some(degree.unwrap_or(Unseen)), "room {room}, {id:?}");
        }
        for least in [Hardly, Partly, Widely] {
            let mut culler = PvsCuller::new(sets.clone()).with_least_degree(least);
            assert_eq!(culler.accuracy(), Accuracy::Approximate, "{least:?}");
            let found = culled(&mut culler, &scene, &view(x, 0.1));
            assert_eq!(found, seen(room, least), "room {room}, {least:?} or more");
        }
    }
    // The near plane lies in the other room, so that both rooms count.
    let mut both = PvsCuller::new(sets.clone()).with_least_degree(Partly);
    assert_eq!(culled(&mut both, &scene, &view(-1.0, 1.0)), [0, 1, 2, 4, 5], "from both rooms");
    let union = [Widely, Partly, Widely, Hardly, Partly, Partly].map(Some);
    assert_eq!(ids.iter().map(|&id| both.degree(id)).collect::<Vec<_>>(), union, "degrees from both rooms");
    // Without degrees there is nothing to hide by.
    let (scene, _, bare) = world();
    let pairs = scene.ids().zip(0..).collect::<Vec<_>>();
    let bare = ScenePvs::new(&scene, bare.pvs().clone(), bare.viewcells().clone(), pairs);
    let mut culler = PvsCuller::new(Arc::new(bare)).with_least_degree(Widely);
    assert_eq!(culled(&mut culler, &scene, &view(-5.0, 0.1)), seen(0, Unseen), "sets without degrees");
    assert_eq!(culler.accuracy(), Accuracy::Conservative, "sets without degrees");
}

#[test]
fn degrees_are_unknown_where_the_sets_do_not_answer() {
    let (mut scene, ids, sets) = world();
    let mut reader = PvsCuller::new(Arc::new(sets));
    assert_eq!(reader.degree(ids[0]), None, "before the first frame");
    reader.look(&scene, &view(-5.0, 0.1));
    assert_eq!(reader.degree(ids[3]), Some(Unseen), "the fourth object, looked at");
    reader.look(&scene, &view(500.0, 0.1));
    assert_eq!(reader.degree(ids[3]), None, "from outside of the rooms");
    reader.look(&scene, &view(-5.0, 0.1));
    scene.set_bounds(ids[3], Aabb::from_arrays([18.0, 0.0, 0.0], [19.0, 1.0, 1.0])).unwrap();
    let inserted = scene.insert(Aabb::from_arrays([30.0, 0.0, 0.0], [31.0, 1.0, 1.0]));
    reader.look(&scene, &view(-5.0, 0.1));
    assert_eq!([ids[3], inserted].map(|id| reader.degree(id)), [None; 2], "changed and new objects");
    assert_eq!(reader.degree(ids[2]), Some(Hardly), "an object that stayed");
    let mut strict = reader.clone().with_least_degree(Widely);
    assert_eq!(culled(&mut strict, &scene, &view(-5.0, 0.1)), [0, 3, 6], "changed and new objects stay");
    // Sets without degrees, put under a reader that has read some.
    let (_, _, bare) = world();
    let pairs: Vec<_> = ids.iter().copied().zip(0..).collect();
    let bare = ScenePvs::new(&scene, bare.pvs().clone(), bare.viewcells().clone(), pairs);
    *reader.shared_mut() = Arc::new(bare);
    assert_eq!(reader.degree(ids[2]), None, "other sets, before a frame");
    reader.look(&scene, &view(-5.0, 0.1));
    assert_eq!(reader.degree(ids[2]), None, "other sets, without degrees");
}

/// An object that is in the place, and in no row of the sets, comes first, whatever the degrees of the rest.
#[test]
fn what_is_in_the_place_is_loaded_first() {
    let (mut scene, ids, sets) = world();
    let cup = scene.insert(Aabb::from_arrays([-5.8, 0.2, 0.2], [-5.7, 0.3, 0.3]));
    let pairs: Vec<_> = ids.iter().copied().zip(0..).chain([(cup, 4)]).collect();
    let degrees = sets.degrees().unwrap().clone();
    let mut sets = ScenePvs::new(&scene, sets.pvs().clone(), sets.viewcells().clone(), pairs);
    sets.set_degrees(degrees).unwrap();
    let place = [DVec3::new(-6.0, 0.0, 0.0), DVec3::new(-5.0, 1.0, 1.0)];
    let mut residency = Residency::new(1000);
    residency.update(&scene, &mut PvsCuller::new(&sets), &[u32::MAX], &[place], |_| 10, 1000);
    assert_eq!(residency.loads()[0].object, cup, "{:?}", residency.loads());
}
