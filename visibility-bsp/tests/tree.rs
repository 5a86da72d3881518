//! Contents of trees: fragments that add up to their polygons, shared nodes, and adversarial input.

use crate::shapes::{box_faces, polygons};
use std::collections::HashSet;
use visibility_bsp::{BspError, BspTree, Fragments, Subtree, TraversalStack, TreeVisitor};
use visibility_core::{Aabb, glam::DVec3, view::Eye};
use visibility_testing::Random;
use visibility_testing::allocations::{LIVE, PEAK};

fn build(polygons: &[Vec<DVec3>]) -> BspTree {
    BspTree::build((0..).zip(polygons.iter().map(|p| &p[..]))).unwrap()
}

#[test]
fn fragments_add_up_to_their_polygons_and_keep_their_orientation() {
    let mut random = Random(3);
    for _ in 0..100 {
        let polygons = polygons(&mut random, 60);
        let tree = build(&polygons);
        for (owner, polygon) in polygons.iter().enumerate() {
            let area = |v: &[DVec3]| -> DVec3 {
                (2..v.len()).map(|i| (v[i - 1] - v[0]).cross(v[i] - v[0])).sum::<DVec3>()
            };
            let mut sum = DVec3::ZERO;
            tree.for_each_fragment(owner as u32, |fragment| {
                sum += area(fragment.vertices());
                assert!(
                    fragment.plane().normal.dot(area(polygon)) > 0.0 || area(polygon).length() < 1e-9,
                    "polygon {owner}: a fragment faces the other way"
                );
            });
            assert!((sum - area(polygon)).length() < 1e-9, "polygon {owner}");
        }
    }
}

#[test]
fn polygons_in_one_plane_share_a_node_and_are_not_cut_by_each_other() {
    // A floor of tiles, half of them turned over, some overlapping.
    let tile = |x: f64, y: f64| {
        let mut tile: Vec<_> = [(0.0, 0.0), (1.5, 0.0), (1.5, 1.0), (0.0, 1.0)]
            .map(|(u, v)| DVec3::new(x + u, y + v, 7.0))
            .into();
        if (x + y) % 2.0 == 0.0 {
            tile.reverse();
        }
        tile
    };
    let tiles: Vec<_> = (0..10).map(|i| tile(f64::from(i % 4), f64::from(i / 4))).collect();
    let tree = build(&tiles);
    assert_eq!(
        (tree.node_count(), tree.fragment_count(), tree.depth()),
        (1, 10, 1),
        "nodes, fragments and levels of a floor"
    );
    // The same floor, rotated and scaled so that no coordinate is exact.
    let turn = |v: DVec3| DVec3::new(v.x * 0.6 - v.z * 0.8, v.y, v.x * 0.8 + v.z * 0.6) * 0.1;
    let turned: Vec<Vec<_>> = tiles.iter().map(|tile| tile.iter().map(|&v| turn(v)).collect()).collect();
    assert_eq!(build(&turned).node_count(), 1, "a turned floor is one node");
}

#[test]
fn a_shared_edge_is_cut_in_the_same_points_to_the_last_bit() {
    let mut random = Random(4);
    let mut cut = 0;
    for _ in 0..500 {
        // Two triangles with a common edge, and a large triangle that cuts both.
        let [a, b, c, d] = core::array::from_fn(|_| random.fine_vector(8.0));
        let middle = (a + b) * 0.5;
        let knife = vec![middle, middle + random.fine_vector(1000.0), middle + random.fine_vector(1000.0)];
        let mut tree = build(&[knife]);
        tree.insert(1, [&[a, b, c][..]]).unwrap();
        tree.insert(2, [&[b, a, d][..]]).unwrap();
        let corners: HashSet<[u64; 3]> = [a, b, c, d].map(bits).into();
        let points = |owner| {
            let mut points = HashSet::new();
            tree.for_each_fragment(owner, |f| {
                points.extend(f.vertices().iter().filter(|&&p| on_segment(p, a, b)).map(|&p| bits(p)));
            });
            points
        };
        // The plane of the first triangle may cut the second, but not on their common edge.
        let (one, two) = (points(1), points(2));
        assert_eq!(one, two, "points at which the two triangles are cut");
        cut += one.difference(&corners).count();
    }
    assert!(cut > 30, "{cut}");
}

fn bits(p: DVec3) -> [u64; 3] {
    p.to_array().map(f64::to_bits)
}

fn on_segment(p: DVec3, a: DVec3, b: DVec3) -> bool {
    let (ab, ap) = (b - a, p - a);
    let t = ap.dot(ab) / ab.length_squared();
    (-1e-9..=1.0 + 1e-9).contains(&t) && (ap - ab * t).length() < 1e-9
}

#[test]
fn walks_enter_only_what_they_want() {
    struct Counting(usize, Aabb);
    impl TreeVisitor for Counting {
        fn enter(&mut self, subtree: &Subtree, levels: u32) -> Option<u32> {
            let outside =
                self.1.classify_aabb(subtree.bounds()) == visibility_core::geometry::Containment::Outside;
            (!outside).then_some(levels + 1)
        }
        fn visit(&mut self, fragments: Fragments<'_>, levels: u32) {
            assert!(levels > 0, "the root is entered before its fragments are visited");
            self.0 += fragments.count();
        }
    }
    let mut random = Random(6);
    let polygons: Vec<Vec<_>> = (0..3000)
        .map(|_| {
            let center = random.fine_vector(100.0);
            (0..3).map(|_| center + random.fine_vector(1.0)).collect()
        })
        .collect();
    let tree = build(&polygons);
    let mut stack = TraversalStack::new();
    let mut all = Counting(0, tree.bounds());
    tree.walk(Eye::Point(DVec3::ZERO), &mut stack, &mut all);
    assert_eq!(all.0, tree.fragment_count(), "fragments visited from the middle");
    let corner = Aabb::from_arrays([0.0; 3], [30.0; 3]);
    let mut some = Counting(0, corner);
    tree.walk(Eye::Point(DVec3::ZERO), &mut stack, &mut some);
    let inside = polygons.iter().filter(|p| p.iter().all(|v| corner.contains_point(v.as_vec3()))).count();
    assert!(some.0 >= inside && some.0 < all.0 / 10, "{} of {}, {inside} inside", some.0, all.0);
}

#[test]
fn few_planes_cut_much() {
    // Boxes on a grid: planes of their faces would cut all others, planes between them cut none.
    let boxes = (0..400).map(|i| {
        let corner = DVec3::new(f64::from(i % 20), f64::from(i / 20), 0.0) * 10.0;
        box_faces(corner, corner + DVec3::new(6.0, 7.0, 3.0 + f64::from(i % 7)))
    });
    let faces: Vec<_> = boxes.flatten().collect();
    let tree = build(&faces);
    assert!(tree.fragment_count() < faces.len() * 5 / 4, "{}", tree.fragment_count());
    assert!(tree.depth() < 40, "{}", tree.depth());
}

#[test]
fn hostile_polygons_are_left_out_or_survive() {
    let bad = [f64::NAN, f64::INFINITY, -f64::INFINITY];
    for value in bad {
        let polygon = [DVec3::ZERO, DVec3::X, DVec3::new(0.0, 1.0, value)];
        assert!(!BspTree::accepts(&polygon), "{polygon:?} is accepted");
        assert!(build(&[polygon.into()]).is_empty(), "{polygon:?} is in the tree");
    }
    for degenerate in
        [vec![], vec![DVec3::ZERO; 2], vec![DVec3::ONE; 9], vec![DVec3::ZERO, DVec3::ONE, DVec3::splat(0.5)]]
    {
        assert!(!BspTree::accepts(&degenerate), "{degenerate:?} is accepted");
    }
    let mut random = Random(7);
    let values = [0.0, -0.0, 1.0, -1.0, 1e-30, 1e30, -1e30, 3.4e38, 5e-324, 1e150, -1e300];
    let mut stack = TraversalStack::new();
    for _ in 0..300 {
        let value = |random: &mut Random| values[random.below(values.len())];
        let polygons: Vec<Vec<DVec3>> = (0..20)
            .map(|_| {
                (0..3 + random.below(3))
                    .map(|_| DVec3::from_array([(); 3].map(|()| value(&mut random))))
                    .collect()
            })
            .collect();
        let mut tree = build(&polygons);
        let mut count = 0;
        let eye = DVec3::from_array([(); 3].map(|()| value(&mut random)));
        tree.front_to_back(Eye::Point(eye), &mut stack, |f| count += f.count());
        assert_eq!(count, tree.fragment_count(), "from {eye}: fragments visited of {polygons:?}");
        tree.front_to_back(Eye::Point(DVec3::NAN), &mut stack, |_| ());
        tree.front_to_back(Eye::Direction(DVec3::NAN), &mut stack, |_| ());
        tree.insert(5, polygons.iter().map(|p| &p[..])).unwrap();
        tree.remove(5);
    }
}

#[test]
fn polygons_that_cut_each_other_without_end_are_refused() {
    // Three sets of mutually perpendicular slats: every plane cuts all slats of the other two sets.
    let n = 40;
    let mut polygons = Vec::new();
    for axis in 0..3 {
        for i in 0..n {
            let at = f64::from(i) - 0.013 * f64::from(axis);
            // The slats are slightly skewed, so that no two share a plane.
            let skew = 1e-4 * f64::from(i);
            let [u, v, w] = [axis, (axis + 1) % 3, (axis + 2) % 3].map(|a| DVec3::AXES[a as usize]);
            let corner = |s: f64, t: f64| u * (at + skew * s) + v * (s * 50.0) + w * (t * 50.0);
            polygons.push(vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
        }
    }
    // At worst there are 3 n^3 fragments. The tree is accepted up to 256 cuts per polygon, and refused
    // beyond.
    let tree = BspTree::build((0..).zip(polygons.iter().map(|p| &p[..])));
    match tree {
        Ok(tree) => assert!(
            tree.fragment_count() < 256 * polygons.len() + 4096,
            "{} fragments of {} polygons",
            tree.fragment_count(),
            polygons.len()
        ),
        Err(BspError::TooManyFragments { polygons: count, limit }) => {
            assert!(
                count == polygons.len() && limit > count,
                "refused at {limit} fragments of {count} polygons"
            )
        }
        Err(other) => panic!("{other}"),
    }
}

#[test]
fn memory_does_not_grow_with_the_numbers_of_owners() {
    PEAK.set(LIVE.get());
    let before = LIVE.get();
    let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let mut tree = BspTree::build([(u32::MAX, triangle), (3, triangle)]).unwrap();
    tree.insert(u32::MAX - 1, [triangle]).unwrap();
    let most = PEAK.get() - before;
    assert!(most < 100_000, "{most} bytes for three triangles");
    for owner in [u32::MAX, u32::MAX - 1, 3] {
        let mut count = 0;
        tree.for_each_fragment(owner, |fragment| count += usize::from(fragment.owner() == owner));
        assert_eq!(count, 1, "fragments of owner {owner}");
        assert!(tree.remove(owner), "owner {owner} was there");
    }
    assert!(tree.is_empty(), "all owners are removed");
}

/// Bundles of strips across a row of planes. Between two planes, an axis-aligned plane divides them, which
/// cuts one of them: some bundles are refused just there.
#[test]
fn polygons_that_are_refused_leave_no_node() {
    let mut random = Random(9);
    let square =
        |x: f64| [(0.0, 0.0), (99.0, 0.0), (99.0, 99.0), (0.0, 99.0)].map(|(y, z)| DVec3::new(x, y, z));
    let mut tree = BspTree::build((0..700).map(|i| (0, square(f64::from(i))))).unwrap();
    let nodes = tree.node_count();
    let mut refused = 0;
    for number in 0..120 {
        let strip = |[from, to]: [[f64; 2]; 2], end: f64| {
            [(-1.0, from), (end, from), (end, to), (-1.0, to)].map(|(x, [y, z])| DVec3::new(x, y, z))
        };
        let mut strips = vec![strip([[0.0, 0.0], [91.0, 91.0]], 701.0)];
        for _ in 0..16 {
            let from = [random.fine_range(0.0, 90.0), random.fine_range(0.0, 90.0)];
            let to = [from[0] + random.fine_range(0.1, 1.0), from[1] + random.fine_range(-1.0, 1.0)];
            strips.push(strip([from, to], random.fine_range(500.0, 701.0)));
        }
        match tree.insert(1, &strips) {
            Ok(_) => assert!(tree.remove(1), "bundle {number} is in the tree"),
            Err(_) => refused += 1,
        }
        assert_eq!(tree.node_count(), nodes, "nodes after bundle {number}");
    }
    assert!(refused > 100, "bundles refused: {refused}");
}
