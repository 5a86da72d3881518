//! Unit tests of trees of few polygons, whose answers are known from whole numbers.

use super::bsp_tree::{BspError, BspTree};
use super::build_scratch::{Piece, Source};
use super::node::{EMPTY, NONE};
use super::splitter;
use super::subtree::Subtree;
use super::traversal::TraversalStack;
use alloc::vec::Vec;
use std::vec;
use visibility_core::{
    Aabb,
    geometry::{Plane, PolygonSide, SidePlane},
    glam::{DVec3, Vec3},
    view::Eye,
};
use visibility_testing::Random;

/// A rectangle across an axis with whole coordinates: the axis, and its minimum and maximum corners.
#[derive(Clone, Copy, Debug)]
struct Tile {
    axis: usize,
    low: [i64; 3],
    high: [i64; 3],
}

impl Tile {
    fn random(random: &mut Random, reach: i32) -> Self {
        let axis = random.below(3);
        let low = [(); 3].map(|()| i64::from(random.between(-reach, reach)));
        let size = [(); 3].map(|()| i64::from(random.between(1, reach)));
        let high = [0, 1, 2].map(|i| if i == axis { low[i] } else { low[i] + size[i] });
        Self { axis, low, high }
    }

    /// Returns the corners in boundary order.
    fn corners(&self) -> [DVec3; 4] {
        let [u, v] = [(self.axis + 1) % 3, (self.axis + 2) % 3];
        [[false, false], [true, false], [true, true], [false, true]].map(|[s, t]| {
            let mut corner = self.low;
            corner[u] = if s { self.high[u] } else { self.low[u] };
            corner[v] = if t { self.high[v] } else { self.low[v] };
            DVec3::from_array(corner.map(|x| x as f64))
        })
    }

    /// Returns the tile of a fragment's vertices. All cuts are at whole coordinates.
    fn of(vertices: &[DVec3]) -> Self {
        let (min, max) = vertices
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), &v| (min.min(v), max.max(v)));
        assert!(min.fract() == DVec3::ZERO && max.fract() == DVec3::ZERO, "a cut off the grid: {vertices:?}");
        let [low, high] = [min, max].map(|p| p.to_array().map(|x| x as i64));
        let axis = (0..3).find(|&i| low[i] == high[i]).expect("a fragment across an axis");
        Self { axis, low, high }
    }

    /// Tests whether the sight from `eye` to the middle of some unit square of `other` goes through the
    /// inside of this tile, and before it reaches `other`. Coordinates are doubled, and all of it is exact.
    fn hides(&self, other: &Self, eye: &SightStart) -> bool {
        let [u, v] = [(other.axis + 1) % 3, (other.axis + 2) % 3];
        (other.low[u]..other.high[u]).any(|s| {
            (other.low[v]..other.high[v]).any(|t| {
                let mut point = [2 * other.low[other.axis]; 3];
                (point[u], point[v]) = (2 * s + 1, 2 * t + 1);
                // Points of the line of sight are `point + k way` for k from 0 on.
                let way = match eye {
                    SightStart::Point(eye) => [0, 1, 2].map(|i| 2 * eye[i] - point[i]),
                    SightStart::Direction(along) => along.map(|x| -1000 * x),
                };
                let (over, to_plane) = (way[self.axis], 2 * self.low[self.axis] - point[self.axis]);
                // The sight meets the tile's plane at `to_plane / over`, between 0 and 1.
                let (over, to_plane) = (over * over.signum(), to_plane * over.signum());
                0 < to_plane
                    && to_plane < over
                    && (0..3).filter(|&i| i != self.axis).all(|i| {
                        let at = point[i] * over + to_plane * way[i];
                        2 * self.low[i] * over < at && at < 2 * self.high[i] * over
                    })
            })
        })
    }
}

/// An eye with whole coordinates, or the direction of parallel sight.
#[derive(Clone, Copy, Debug)]
enum SightStart {
    Point([i64; 3]),
    Direction([i64; 3]),
}

impl SightStart {
    fn eye(&self) -> Eye {
        let vector = |v: &[i64; 3]| DVec3::from_array(v.map(|x| x as f64));
        match self {
            Self::Point(eye) => Eye::Point(vector(eye)),
            Self::Direction(along) => Eye::Direction(vector(along)),
        }
    }
}

/// Asserts what holds of every tree: links, bounds and owners of subtrees, sides of fragments, margins, and
/// that no node without fragments divides nothing.
fn check(tree: &BspTree, what: &str) {
    let (mut open, mut reached, mut fragments) = (vec![(tree.root, NONE)], 0, 0);
    let mut deepest_first = Vec::new();
    while let Some((id, parent)) = open.pop() {
        if id == EMPTY {
            continue;
        }
        reached += 1;
        let node = &tree.nodes[id as usize];
        assert_eq!(node.parent, parent, "{what}: parent of node {id}");
        assert_eq!(
            node.plane,
            SidePlane::new(node.plane.plane, tree.magnitude),
            "{what}: margin of the plane of node {id}"
        );
        assert!(
            node.first != NONE || node.children.iter().all(|&child| child != EMPTY),
            "{what}: node {id} divides nothing"
        );
        deepest_first.push(id);
        open.extend(node.children.map(|child| (child, id)));
    }
    assert_eq!(reached, tree.node_count(), "{what}: nodes in use");
    assert!(tree.free_nodes.iter().all(|&id| tree.nodes[id as usize].parent == id), "{what}: free nodes");
    deepest_first.reverse();
    for id in deepest_first {
        let node = &tree.nodes[id as usize];
        let mut subtree = Subtree::NOTHING;
        for child in node.children.into_iter().filter(|&child| child != EMPTY) {
            subtree = subtree.union(&tree.subtrees[child as usize]);
        }
        let (mut fragment, mut before) = (node.first, NONE);
        while fragment != NONE {
            let record = tree.store.record(fragment);
            assert_eq!((record.node, record.previous), (id, before), "{what}: links of fragment {fragment}");
            let vertices = tree.store.vertices(record);
            assert!(vertices.iter().all(|v| v.abs().cmple(tree.magnitude).all()), "{what}: magnitude");
            subtree = subtree.union(&Subtree::of(Aabb::around(vertices.iter().copied()), record.owner));
            // Fragments are in the plane of their node, and on one side of those above.
            assert_eq!(node.plane.side_of_polygon(vertices), PolygonSide::On, "{what}: a fragment of {id}");
            let (mut child, mut above) = (id, node.parent);
            while above != NONE {
                let Some(side) = tree.nodes[above as usize].children.iter().position(|&c| c == child) else {
                    panic!("{what}: node {child} is no child of {above}");
                };
                let expected = [PolygonSide::Back, PolygonSide::Front][side];
                let found = tree.nodes[above as usize].plane.side_of_polygon(vertices);
                assert_eq!(found, expected, "{what}: a fragment of {id} beside the plane of {above}");
                (child, above) = (above, tree.nodes[above as usize].parent);
            }
            fragments += 1;
            (fragment, before) = (record.next, fragment);
        }
        assert_eq!(tree.subtrees[id as usize], subtree, "{what}: subtree of node {id}");
    }
    assert_eq!(fragments, tree.fragment_count(), "{what}: fragments in nodes");
    assert!(tree.depth() <= tree.most_levels as usize, "{what}: levels");
}

/// Returns the fragments in the order of a walk, each with the number of its node.
fn walked(tree: &BspTree, eye: Eye) -> Vec<(usize, Tile)> {
    let (mut found, mut node) = (Vec::new(), 0);
    tree.front_to_back(eye, &mut TraversalStack::new(), |fragments| {
        found.extend(fragments.map(|fragment| (node, Tile::of(fragment.vertices()))));
        node += 1;
    });
    found
}

fn area(tile: &Tile) -> i64 {
    (0..3).filter(|&i| i != tile.axis).map(|i| tile.high[i] - tile.low[i]).product()
}

#[test]
fn tiles_come_in_the_exact_order_of_sight_while_owners_come_and_go() {
    let mut random = Random(21);
    let (mut hiding, mut cut) = (0, 0);
    for scene in 0..60 {
        let tiles: Vec<Tile> = (0..24).map(|_| Tile::random(&mut random, 4)).collect();
        let owner_of = |number: usize| number as u32 / 2;
        let count = random.below(25);
        let first = (0..count).map(|number| (owner_of(number), tiles[number].corners()));
        let mut tree = BspTree::build(first).unwrap();
        let mut there: Vec<bool> = (0..12).map(|owner| 2 * owner + 1 < count).collect();
        if count % 2 == 1 {
            assert!(tree.remove(owner_of(count)), "scene {scene}: half an owner is removed");
        }
        for step in 0..12 {
            let what = &*std::format!("scene {scene}, step {step}");
            check(&tree, what);
            let mut all = 0;
            for (number, &is) in there.iter().enumerate() {
                let mut areas = [0; 2];
                tree.for_each_fragment(number as u32, |fragment| {
                    areas[fragment.polygon() as usize % 2] += area(&Tile::of(fragment.vertices()));
                    all += 1;
                });
                let expected = [0, 1].map(|k| if is { area(&tiles[2 * number + k]) } else { 0 });
                // Polygons of a build are numbered on; there are two for each owner.
                assert_eq!(areas, expected, "{what}: areas of owner {number}");
            }
            assert_eq!(all, tree.fragment_count(), "{what}: fragments of all owners");
            let place = [(); 3].map(|()| i64::from(random.between(-6, 6)));
            let eye = match random.below(3) {
                0 if place != [0; 3] => SightStart::Direction(place),
                _ => SightStart::Point(place),
            };
            let found = walked(&tree, eye.eye());
            assert_eq!(found.len(), tree.fragment_count(), "{what}: fragments from {eye:?}");
            cut += found.len() - 2 * there.iter().filter(|&&is| is).count();
            for (number, (node, early)) in found.iter().enumerate() {
                for (other, late) in &found[number + 1..] {
                    let is_hidden = node != other && late.hides(early, &eye);
                    assert!(!is_hidden, "{what}: {late:?} comes after {early:?}, from {eye:?}");
                    hiding += usize::from(early.hides(late, &eye));
                }
            }
            let owner = random.below(12);
            there[owner] = !there[owner];
            if there[owner] {
                let two = [0, 1].map(|k| tiles[2 * owner + k].corners());
                assert_eq!(tree.insert(owner as u32, two), Ok(2), "{what}: owner {owner} comes");
            } else {
                assert!(tree.remove(owner as u32), "{what}: owner {owner} goes");
                assert!(!tree.remove(owner as u32), "{what}: owner {owner} is gone");
            }
        }
        (0..12).for_each(|owner| assert_eq!(tree.remove(owner), there[owner as usize], "owner {owner}"));
        assert!(tree.is_empty() && tree.root == EMPTY, "scene {scene}: a tree without owners");
        assert_eq!((tree.depth(), tree.bounds()), (0, Aabb::EMPTY), "scene {scene}: an empty tree");
    }
    assert!(hiding > 3_000 && cut > 1_000, "{hiding} fragments hide others, {cut} cuts");
}

/// Returns a square across the x axis at `x`, of 2 m.
fn square(x: f64) -> [DVec3; 4] {
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(y, z)| DVec3::new(x, y, z))
}

#[test]
fn the_bound_on_coordinates_at_least_doubles_on_the_axes_on_which_it_grows() {
    let mut tree = BspTree::new();
    for (x, expected) in [
        // An empty tree has the bound of its polygons, however great it was before.
        (-100.0, [100.0, 1.0, 1.0]),
        (100.0, [100.0, 1.0, 1.0]),
        (-101.0, [200.0, 1.0, 1.0]),
        (150.0, [200.0, 1.0, 1.0]),
        (900.0, [900.0, 1.0, 1.0]),
    ] {
        tree.insert(1, [square(x)]).unwrap();
        assert_eq!(tree.magnitude(), DVec3::from_array(expected), "after a square at {x}");
        check(&tree, "growing");
    }
    // Squares at -101, 100, 150 and 900 are in front of each other, as inserted; that at -100 is behind them.
    assert_eq!(tree.depth(), 4, "levels of five squares");
    tree.insert(2, [square(3.0).map(|v| v * DVec3::new(1.0, 3.0, 1.0))]).unwrap();
    assert_eq!(tree.magnitude(), DVec3::new(900.0, 3.0, 1.0), "a square that is higher");
    tree.remove(1);
    assert_eq!(tree.magnitude(), DVec3::new(900.0, 3.0, 1.0), "while a polygon is left");
    tree.remove(2);
    tree.insert(3, [square(2.0)]).unwrap();
    assert_eq!(tree.magnitude(), DVec3::new(2.0, 1.0, 1.0), "a tree that was empty");
}

/// A strip along the x axis that `cuts` squares cut. The squares are inserted one by one, in an order that
/// makes a balanced tree without other planes.
#[test]
fn polygons_are_cut_up_to_the_limit_and_no_more() {
    let squares = 4096 + 256 + 1;
    let mut tree = BspTree::new();
    let mut halves = vec![(0, squares)];
    while let Some((from, to)) = halves.pop() {
        let middle = (from + to) / 2;
        tree.insert(0, [square(f64::from(middle))]).unwrap();
        halves.extend([(from, middle), (middle + 1, to)].into_iter().filter(|(from, to)| from < to));
    }
    let (nodes, magnitude) = (tree.node_count(), tree.magnitude());
    let strip = |end: f64| [(-1.0, 0.0), (end, 0.0), (end, 0.5)].map(|(x, y)| DVec3::new(x, y, 0.25));
    let end = f64::from(squares);
    assert_eq!(tree.insert(7, [strip(end - 1.5)]), Ok(1), "as many cuts as the limit");
    assert_eq!(tree.fragment_count(), squares as usize + squares as usize, "fragments");
    assert!(tree.remove(7), "the strip was there");
    // The second is so long that the bound on coordinates grows, and is as before when it has been refused.
    for end in [end - 0.5, 4.0 * end] {
        let error = BspError::TooManyFragments { polygons: 1, limit: squares as usize - 1 };
        assert_eq!(tree.insert(7, [strip(end)]), Err(error), "a cut more than the limit");
        assert_eq!(tree.magnitude(), magnitude, "bound on coordinates");
        assert_eq!((tree.node_count(), tree.fragment_count()), (nodes, squares as usize), "what is left");
    }
    assert!(!tree.remove(7), "the strip is not in the tree");
}

#[test]
fn polygons_face_as_they_did_whichever_way_their_plane_faces() {
    let turned = |x| {
        let mut corners = square(x);
        corners.reverse();
        corners
    };
    let tree = BspTree::build([(1, square(5.0)), (2, turned(5.0)), (3, square(5.0))]).unwrap();
    assert_eq!(tree.node_count(), 1, "one plane");
    for (owner, normal) in [(1, DVec3::X), (2, DVec3::NEG_X), (3, DVec3::X)] {
        let mut found = Vec::new();
        tree.for_each_fragment(owner, |fragment| found.push(fragment.plane()));
        assert_eq!(found, [Plane::new(normal, -5.0 * normal.x)], "plane of owner {owner}");
    }
}

#[test]
fn owners_beyond_those_that_are_stored_count_as_several() {
    let bounds = Aabb::from_arrays([0.0; 3], [1.0; 3]);
    for (owner, is) in
        [(0, Some(0)), (u32::MAX - 2, Some(u32::MAX - 2)), (u32::MAX - 1, None), (u32::MAX, None)]
    {
        let one = Subtree::of(bounds, owner);
        assert_eq!(one.owner(), is, "of owner {owner}");
        assert_eq!(Subtree::NOTHING.union(&one).owner(), is, "of owner {owner} alone");
        assert_eq!(one.union(&one).owner(), is, "of owner {owner} twice");
        assert_eq!(one.union(&Subtree::of(bounds, 5)).owner(), None, "of owners {owner} and 5");
    }
    assert_eq!(Subtree::NOTHING.owner(), None, "of nothing");
}

/// Returns pieces with the given bounds, as whole numbers that are rounded outwards.
fn pieces(boxes: &[[[i32; 3]; 2]]) -> Vec<Piece> {
    let piece = |(source, &[low, high]): (usize, &[[i32; 3]; 2])| {
        let [low, high] = [low, high].map(|p| Vec3::from_array(p.map(|x| x as f32)));
        Piece { source: source as u32, start: 0, len: 0, bounds: Aabb::new(low, high) }
    };
    boxes.iter().enumerate().map(piece).collect()
}

/// Returns what it costs to divide boxes by the plane at `at` across `axis`, and whether both sides get one.
fn cost(boxes: &[[[i32; 3]; 2]], axis: usize, at: i32) -> (i32, bool) {
    let front = boxes.iter().filter(|[low, _]| low[axis] >= at).count() as i32;
    let back = boxes.iter().filter(|[low, high]| high[axis] <= at && low[axis] < at).count() as i32;
    let across = boxes.len() as i32 - front - back;
    (6 * across + (front - back).abs(), front > 0 && back > 0)
}

#[test]
fn boxes_are_divided_by_the_side_that_costs_least() {
    let mut random = Random(22);
    let (mut divided, mut left) = (0, 0);
    for round in 0..3000 {
        // With up to 12 boxes or more than 96, not all sides and boxes are looked at.
        let boxes: Vec<[[i32; 3]; 2]> = (0..13 + round % 9)
            .map(|_| {
                let low = [(); 3].map(|()| random.between(-9, 9));
                let size = [[1 + round as i32 % 4, 1 + round as i32 % 7, 3], [40; 3]][round % 5 / 4];
                [low, [0, 1, 2].map(|i| low[i] + random.between(0, size[i]))]
            })
            .collect();
        let count = boxes.len();
        let sides = (0..12).flat_map(|k| {
            let [low, high] = boxes[k * count / 12];
            (0..3).flat_map(move |axis| [low[axis], high[axis]].map(|at| (axis, at)))
        });
        let costs = sides.map(|(axis, at)| cost(&boxes, axis, at)).filter(|(_, both)| *both);
        let least = costs.map(|(cost, _)| cost).min().filter(|&cost| cost < count as i32);
        let found = splitter::box_plane(&pieces(&boxes)).map(|plane| {
            let axis = plane.normal.max_position();
            assert_eq!(plane.normal, DVec3::AXES[axis], "round {round}: a plane across an axis");
            cost(&boxes, axis, -plane.offset.round() as i32).0
        });
        assert_eq!(found, least, "round {round}: cost of dividing {boxes:?}");
        if found.is_some() { divided += 1 } else { left += 1 }
    }
    assert!(divided > 500 && left > 100, "{divided} divided, {left} not");
    let row = |count| (0..count).map(|x| [[x, 0, 0], [x + 1, 1, 1]]).collect::<Vec<_>>();
    assert_eq!(splitter::box_plane(&pieces(&row(12))), None, "12 boxes are divided by their own planes");
    assert!(splitter::box_plane(&pieces(&row(13))).is_some(), "13 boxes are divided by a side");
    // 3,000 boxes in a row, of which 12 are tried: the middle one of these divides them best.
    let middle = splitter::box_plane(&pieces(&row(3000))).map(|plane| -plane.offset.round());
    assert_eq!(middle, Some(1500.0), "the middle of a row");
}

#[test]
fn polygons_are_divided_by_the_plane_that_costs_least() {
    let mut random = Random(23);
    let mut chosen = 0;
    for round in 0..1000 {
        let count = 2 + round % 24;
        let tiles: Vec<Tile> = (0..count).map(|_| Tile::random(&mut random, 5)).collect();
        let boxes: Vec<_> = tiles.iter().map(|t| [t.low, t.high].map(|p| p.map(|x| x as i32))).collect();
        let corners: Vec<[DVec3; 4]> = tiles.iter().map(Tile::corners).collect();
        let plane = |number: usize| Plane::from_polygon(&corners[number]).unwrap();
        let sources: Vec<Source> =
            (0..count).map(|number| Source { owner: 0, number: 0, plane: plane(number) }).collect();
        let best = splitter::polygon(
            &pieces(&boxes),
            &sources,
            |piece| &corners[piece.source as usize],
            DVec3::splat(10.0),
        );
        let cost_of = |number: usize| {
            let Tile { axis, low, .. } = tiles[number];
            let on = tiles.iter().filter(|t| t.axis == axis && t.low[axis] == low[axis]).count() as i32;
            let back = tiles.iter().filter(|t| t.high[axis] <= low[axis]).count() as i32 - on;
            let front = tiles.iter().filter(|t| t.low[axis] >= low[axis]).count() as i32 - on;
            6 * (count as i32 - on - back - front) + (front - back).abs()
        };
        let tried = count.min(10);
        let least = (0..tried).map(|k| cost_of(k * count / tried)).min();
        assert_eq!(Some(cost_of(best)), least, "round {round}: cost of {tiles:?}");
        chosen += usize::from(best > 0);
    }
    assert!(chosen > 300, "polygons chosen that are not the first: {chosen}");
}

/// A tree of a cut by an oblique plane: the cut points of an edge are off by up to the bound, and by more
/// than nothing.
#[test]
fn cut_points_are_within_the_bound_of_their_edge() {
    let mut random = Random(24);
    let mut worst = 0.0f64;
    for round in 0..2000 {
        let whole =
            |random: &mut Random| DVec3::from_array([(); 3].map(|()| random.range(-1e6, 1e6).round()));
        let [a, b, c] = [(); 3].map(|()| whole(&mut random));
        let cutting = [(); 3].map(|()| whole(&mut random));
        let mut tree = BspTree::new();
        tree.insert(1, [cutting]).unwrap();
        tree.insert(2, [[a, b, c]]).unwrap();
        let error = tree.cut_error();
        tree.for_each_fragment(2, |fragment| {
            for &v in fragment.vertices() {
                // The distance from the nearest edge, from products of whole numbers in units of 2^-32.
                let fine = |p: DVec3| p.to_array().map(|x| (x * 4294967296.0) as i128);
                let distance = |[p, q]: [DVec3; 2]| {
                    let along = (q - p).to_array().map(|x| x as i128);
                    let [fine_v, fine_p] = [v, p].map(fine);
                    let off = [0, 1, 2].map(|i| fine_v[i] - fine_p[i]);
                    let cross = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| along[i] * off[j] - along[j] * off[i]);
                    DVec3::from_array(cross.map(|x| x as f64 / 4294967296.0)).length() / (q - p).length()
                };
                let off = [[a, b], [b, c], [c, a]].map(distance).into_iter().fold(f64::INFINITY, f64::min);
                assert!(off <= error, "round {round}: {off} beside the edge, {error} allowed");
                worst = worst.max(off / error);
            }
        });
    }
    std::println!("cut points are off by up to {worst} of the bound");
    assert!(worst > 0.01, "cut points are off by up to {worst} of the bound");
}
