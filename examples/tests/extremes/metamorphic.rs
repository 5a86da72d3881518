//! Metamorphic tests: a culler must give the same answer if the world is scaled by a power of two, rotated by
//! a right angle, mirrored, or its objects are reordered. Each new coordinate and matrix element is exact, so
//! the picture does not change by a bit. Answers may differ only where sums are rounded in another order, or
//! where a culler's choices depend on the order of the objects.

use super::strategies::{Case, World, random, world};
use super::{cases, entries, parse, shown};
use glam::{DMat3, DMat4, DVec3};
use std::collections::BTreeMap;
use visibility_core::{
    Accuracy, View, VisibleSet,
    cells::CellGraph,
    pvs::{Viewcell, Viewcells},
};
use visibility_examples::source::SourceCells;
use visibility_testing::Random;

/// Change of a world that leaves every picture unchanged: a linear map, and with `shuffle` a random order of
/// the objects.
struct Change {
    name: &'static str,
    /// Linear map of the world: a power of two times a signed permutation of the axes.
    map: DMat3,
    shuffle: bool,
}

fn changes() -> Vec<Change> {
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
    let change = |name, map, shuffle| Change { name, map, shuffle };
    vec![
        change("larger", DMat3::from_diagonal(DVec3::splat(1024.0)), false),
        change("smaller", DMat3::from_diagonal(DVec3::splat(1.0 / 4096.0)), false),
        change("turned about z", DMat3::from_cols(y, -x, z), false),
        change("turned about x", DMat3::from_cols(x, z, -y), false),
        change("mirrored", DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), false),
        change("shuffled", DMat3::IDENTITY, true),
    ]
}

/// Returns the percentage of answers that a change may alter.
fn allowed(change: &Change, entry: &str, accuracy: Accuracy) -> u64 {
    let scaled = change.map.determinant().abs() != 1.0;
    match accuracy {
        // Scaling by a power of two changes no rounding.
        _ if scaled => 0,
        // Frustum culling decides by boxes and planes alone, so order and rounding of other sums do not
        // matter.
        _ if entry == "frustum" => 0,
        // An approximate culler may spend its budget on the other of two equal objects.
        Accuracy::Approximate => 8,
        // A limit on occluders may choose another one of several equal occluders; other differences come from
        // rounding.
        _ => 3,
    }
}

/// Returns the changed world with its origin at zero, and for each new object index the old index.
fn changed(old: &World, change: &Change, rng: &mut Random) -> (World, Vec<usize>) {
    let mut order: Vec<usize> = (0..old.source.objects.len()).collect();
    if change.shuffle {
        (1..order.len()).rev().for_each(|i| order.swap(i, rng.below(i + 1)));
    }
    let mut objects: Vec<_> = order.iter().map(|&index| old.source.objects[index].clone()).collect();
    for object in &mut objects {
        object.edit_triangles(|triangles| {
            for point in triangles.as_flattened_mut() {
                *point = (change.map * point.as_dvec3()).as_vec3();
            }
        });
    }
    let back = DMat4::from_mat3(change.map.inverse());
    let views = old.views.iter().map(|view| {
        let matrix = view.clip_from(old.origin()) * back;
        View::from_clip_from_world(matrix.to_cols_array(), view.depth()).expect("no worse than the old one")
    });
    let cells = old.source.cells.as_ref().map(|cells| changed_cells(cells, change, old.origin()));
    (world(objects, cells, DVec3::ZERO, views.collect()), order)
}

/// Returns the cells and portals after the change, relative to the new origin at zero.
fn changed_cells(old: &SourceCells, change: &Change, origin: DVec3) -> SourceCells {
    let place = |p: DVec3| change.map * (p - origin);
    let portals = old.graph.portals().iter().map(|portal| {
        let mut corners: Vec<_> = portal.polygon().vertices().iter().map(|&p| place(p)).collect();
        if change.map.determinant() < 0.0 {
            corners.reverse();
        }
        (corners, portal.cells())
    });
    let rooms = old.viewcells.cells().iter().map(|cell| {
        let ends = [cell.min, cell.max].map(place);
        Viewcell::from_box(ends[0].min(ends[1]), ends[0].max(ends[1]))
    });
    SourceCells {
        graph: CellGraph::from_vertices(old.graph.cell_count(), portals).expect("no worse than the old ones"),
        viewcells: Viewcells::new(rooms),
        ..old.clone()
    }
}

/// Returns the world of a case relative to an origin at zero. `None` if a nonzero coordinate is outside 1e-15
/// to 1e15 in magnitude or not finite, since a change could then overflow or underflow.
fn plain(case: Case) -> Option<World> {
    let points = || case.world.source.objects.iter().flat_map(|o| &o.triangles).flatten();
    let sizes = points().flat_map(|p| p.to_array()).filter(|&x| x != 0.0).map(f32::abs);
    if !sizes.into_iter().all(|size| (1e-15..1e15).contains(&size)) {
        return None;
    }
    let identity = Change { name: "", map: DMat3::IDENTITY, shuffle: false };
    Some(changed(&case.world, &identity, &mut Random(0)).0)
}

/// Returns the accuracy that a culler promises and, for each view and object, whether it reports the object.
/// `None` if the culler does not suit the world.
fn answers(entry: &str, world: &World) -> Option<(Accuracy, Vec<Vec<bool>>)> {
    let mut pipeline = parse(entry, world).ok()?.remove(0).1;
    let mut visible = VisibleSet::new();
    let answers = world.views.iter().map(|view| shown(world, &mut pipeline, view, &mut visible)).collect();
    Some((pipeline.accuracy(), answers))
}

#[test]
fn what_looks_the_same_is_culled_the_same() {
    let entries = entries();
    // For each pair of a change and a culler: number of differing answers, number of all answers, and the
    // percentage that may differ.
    let mut differing: BTreeMap<(&str, &str), [u64; 3]> = BTreeMap::new();
    let mut tried = 0;
    for world in (0..).map(|seed| random(&mut Random(seed))).filter_map(plain).take(cases(20) as usize) {
        tried += 1;
        let old: Vec<_> = entries.iter().map(|entry| answers(entry, &world)).collect();
        for change in changes() {
            let (new, order) = changed(&world, &change, &mut Random(tried));
            for (entry, old) in entries.iter().zip(&old) {
                let (Some((accuracy, old)), Some((_, new))) = (old, answers(entry, &new)) else { continue };
                let [others, all, most] = differing.entry((change.name, entry)).or_default();
                *most = allowed(&change, entry, *accuracy);
                for (old, new) in old.iter().zip(&new) {
                    *others +=
                        order.iter().zip(new).filter(|&(&index, &seen)| old[index] != seen).count() as u64;
                    *all += new.len() as u64;
                }
            }
        }
    }
    let mut wrong = Vec::new();
    for ((change, entry), [others, all, most]) in differing {
        println!("{entry}, {change}: {others} of {all} answers differ");
        if others * 100 > all * most {
            wrong.push(format!("{entry}, {change}: {others} of {all}"));
        }
    }
    assert!(wrong.is_empty(), "too many answers differ:\n{}", wrong.join("\n"));
}
