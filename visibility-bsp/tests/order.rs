//! Depth order from random eyes, checked by rays against the fragments.

use crate::shapes;

use shapes::{hit, polygons};
use visibility_bsp::{BspTree, TraversalStack};
use visibility_core::{glam::DVec3, view::Eye};
use visibility_testing::{Random, judged, told_enough};

/// Replaces `out` by the vertices of all fragments in the order of the walk, each with the ordinal number of
/// its node. `eye` and vertices are in the tree's coordinates.
fn visited(tree: &BspTree, eye: Eye, stack: &mut TraversalStack, out: &mut Vec<(usize, Vec<DVec3>)>) {
    out.clear();
    let mut node = 0;
    tree.front_to_back(eye, stack, |fragments| {
        out.extend(fragments.map(|fragment| (node, fragment.vertices().to_vec())));
        node += 1;
    });
}

/// Asserts along `rays` random rays from `eye` through fragments, all in the tree's coordinates, that a
/// nearer fragment does not come after a farther one of another node. Returns the number of pairs compared.
fn check(random: &mut Random, fragments: &[(usize, Vec<DVec3>)], eye: Eye, rays: usize) -> usize {
    let mut pairs = 0;
    let mut hits = Vec::new();
    for _ in 0..rays {
        let (_, polygon) = &fragments[random.below(fragments.len())];
        let [s, t] = [random.fine_range(0.0, 1.0), random.fine_range(0.0, 1.0)];
        let k = 1 + random.below(polygon.len() - 2);
        let target = polygon[0] + (polygon[k] - polygon[0]) * s + (polygon[k + 1] - polygon[k]) * (s * t);
        let (start, direction) = match eye {
            Eye::Point(eye) => (eye, target - eye),
            Eye::Direction(direction) => (target - direction * 100.0, direction),
        };
        hits.clear();
        hits.extend(fragments.iter().filter_map(|(node, f)| Some((hit(start, direction, f)?, *node))));
        for (i, &(t, node)) in hits.iter().enumerate() {
            for &(later_t, later) in &hits[i + 1..] {
                // `later` comes later in the list, so it must not be nearer by more than rounding.
                let allowed = 1e-7 * t.max(1.0);
                assert!(later_t > t - allowed || later == node, "{later_t} after {t}, from {eye:?}");
                pairs += 1;
            }
        }
    }
    pairs
}

fn eye(random: &mut Random, polygons: &[Vec<DVec3>]) -> Eye {
    let polygon = &polygons[random.below(polygons.len())];
    Eye::Point(match random.below(6) {
        0 => shapes::grid_point(random, 9.0),
        1 => polygon[0],
        2 => polygon[0] + (polygon[1] - polygon[0]) * random.fine_range(0.0, 1.0),
        // The eye is in the polygon's plane, inside the polygon or outside it.
        3 => {
            let [s, t] = [random.fine_range(-2.0, 2.0), random.fine_range(-2.0, 2.0)];
            polygon[0] + (polygon[1] - polygon[0]) * s + (polygon[2] - polygon[0]) * t
        }
        4 => return Eye::Direction(random.fine_vector(1.0).normalize()),
        _ => random.fine_vector(12.0),
    })
}

fn eyes(scenes: usize, of_each: usize) {
    let mut random = Random(1);
    let (mut stack, mut list, mut pairs) = (TraversalStack::new(), Vec::new(), 0);
    for scene in 0..scenes {
        let polygons = polygons(&mut random, 4 + scene % 40);
        let tree = BspTree::build((0..).zip(polygons.iter().map(|p| &p[..]))).unwrap();
        for _ in 0..of_each {
            let eye = eye(&mut random, &polygons);
            visited(&tree, eye, &mut stack, &mut list);
            assert_eq!(list.len(), tree.fragment_count(), "from {eye:?}: fragments visited");
            pairs += check(&mut random, &list, eye, 2);
        }
    }
    judged(pairs as u64);
    told_enough(pairs > scenes * of_each, format_args!("pairs of fragments along rays: {pairs}"));
}

#[test]
fn the_order_is_that_of_depth_from_any_eye() {
    eyes(400, 50);
}

#[test]
fn owners_that_come_and_go_leave_the_order_right() {
    let mut random = Random(2);
    let (mut stack, mut list) = (TraversalStack::new(), Vec::new());
    for _ in 0..40 {
        let polygons = polygons(&mut random, 40);
        let mut tree = BspTree::build((0..20).zip(polygons.iter().map(|p| &p[..]))).unwrap();
        let (nodes, fragments) = (tree.node_count(), tree.fragment_count());
        let mut there: Vec<usize> = (0..20).collect();
        for _ in 0..60 {
            let owner = random.below(40);
            if let Some(at) = there.iter().position(|&o| o == owner) {
                there.swap_remove(at);
                assert!(tree.remove(owner as u32), "owner {owner} was there");
                assert!(!tree.remove(owner as u32), "owner {owner} is removed once");
            } else {
                there.push(owner);
                assert_eq!(
                    tree.insert(owner as u32, [&polygons[owner][..]]),
                    Ok(1),
                    "owner {owner} is inserted"
                );
            }
            assert!(tree.node_count() < 2 * tree.fragment_count().max(1), "planes that divide nothing stay");
            let eye = eye(&mut random, &polygons);
            visited(&tree, eye, &mut stack, &mut list);
            assert_eq!(list.len(), tree.fragment_count(), "from {eye:?}: fragments visited");
            if !list.is_empty() {
                check(&mut random, &list, eye, 4);
            }
            for &owner in &there {
                let mut area = 0.0;
                tree.for_each_fragment(owner as u32, |f| {
                    area += area_of(f.vertices());
                    let bounds = tree.bounds();
                    assert!(
                        f.vertices().iter().all(|v| bounds.contains_point(v.as_vec3())),
                        "a fragment of owner {owner} is outside the tree's bounds"
                    );
                });
                assert!((area - area_of(&polygons[owner])).abs() < 1e-9, "parts of {owner} are missing");
            }
        }
        // Inserting and then removing further owners leaves the tree as it was.
        let mut tree = BspTree::build((0..20).zip(polygons.iter().map(|p| &p[..]))).unwrap();
        for owner in 20..40 {
            tree.insert(owner, [&polygons[owner as usize][..]]).unwrap();
        }
        (20..40).for_each(|owner| assert!(tree.remove(owner), "guest {owner} was there"));
        assert_eq!(
            (tree.node_count(), tree.fragment_count()),
            (nodes, fragments),
            "nodes and fragments after guests have left"
        );
        (0..20).for_each(|owner| assert!(tree.remove(owner), "owner {owner} was there"));
        assert!(
            tree.is_empty() && tree.node_count() == 0 && tree.depth() == 0,
            "a tree without owners is empty"
        );
    }
}

fn area_of(polygon: &[DVec3]) -> f64 {
    let sum: DVec3 =
        (2..polygon.len()).map(|i| (polygon[i - 1] - polygon[0]).cross(polygon[i] - polygon[0])).sum();
    sum.length() * 0.5
}
