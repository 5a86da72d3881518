//! Tests with inputs at which margins, wrap-around or limits on work decide.

use super::gaps::Gaps;
use super::{Disc, DiscView, DiscZone, Discs};
use crate::median_order::LEAF;
use alloc::vec::Vec;
use core::cmp::Ordering;
use visibility_testing::Random;

/// Returns the discs seen in a view, ascending.
fn look(discs: &[Disc], view: &DiscView) -> Vec<u32> {
    let mut seen = Vec::new();
    DiscZone::new().look(&Discs::new(discs).unwrap(), view, &mut seen);
    seen.sort_unstable();
    seen
}

#[test]
fn a_disc_thinner_than_rounding_hides_nothing_beside_it() {
    let wall = Disc { center: [-5.0, 0.0], radius: 1.0 };
    for (center, radius) in [
        ([0.9998779222360098, 0.015625], 9.021663419577131e-19),
        ([134201342.99987791, 2097152.0], 1.2108671669563533e-10),
    ] {
        let far = Disc { center: [-5.0 * center[0], 0.0], ..wall };
        assert_eq!(
            look(&[Disc { center, radius }, far], &DiscView::new([0.0; 2])),
            [0, 1],
            "the disc thinner than rounding, and the wall behind"
        );
    }
}

#[test]
fn a_cut_closes_nothing_outside_its_bounds() {
    let mut random = Random(7);
    let mut gaps = Gaps::new();
    for _ in 0..200_000 {
        // Intervals are about twice as wide as the error, so that rounding may swap the moved ends.
        let error = random.fine_range(8.0, 9.0) * f64::EPSILON;
        let (before, width) = (random.fine_range(0.0, 4.0) * error, random.fine_range(0.0, 4.0) * error);
        // The interval is anywhere, or across direction 0, where the number of the last end is more precise
        // than that of the first.
        let anywhere = random.fine_range(0.0, 3.99);
        let over = (4.0 - before, if width > before { width - before } else { 4.0 - (before - width) });
        let (first, last) = [(anywhere, anywhere + width), over][random.below(2)];
        gaps.begin(None);
        gaps.cut(first, last, error);
        let (opposite, aside) = ((first + 2.0) % 4.0, (first + 0.1) % 4.0);
        for at in [opposite, aside] {
            assert!(gaps.any(at, at + 1e-9, 1e-15), "{first} {last} {error}");
        }
    }
}

#[test]
fn an_interval_moved_outwards_goes_on_beyond_the_seam() {
    let mut gaps = Gaps::new();
    gaps.begin(Some((3.5, 4.0)));
    assert!(
        gaps.any(1e-16, 0.1, 1e-15) && !gaps.any(1e-14, 0.1, 1e-15),
        "a sector that begins before the seam"
    );
    gaps.begin(Some((0.0, 0.5)));
    let last = 4.0f64.next_down();
    assert!(
        gaps.any(3.9, last, 1e-14) && !gaps.any(3.9, last - 1e-13, 1e-14),
        "a sector that begins after the seam"
    );
}

#[test]
fn a_disc_that_touches_the_sector_is_reported_in_all_quarters() {
    let turned = |[x, y]: [f64; 2], quarters: u32| (0..quarters).fold([x, y], |[x, y], _| [-y, x]);
    for quarters in 0..4 {
        // Discs whose tangents are the ends of the sector.
        for y in [1.0, -1.0] {
            let disc = Disc { center: turned([5.0, y], quarters), radius: 1.0 };
            let (right, left) = if y > 0.0 { ([1.0, -1.0], [1.0, 0.0]) } else { ([1.0, 0.0], [1.0, 1.0]) };
            let view = DiscView::new([0.0; 2]).with_sector(turned(right, quarters), turned(left, quarters));
            assert_eq!(look(&[disc], &view), [0], "{quarters} {y}");
        }
    }
}

#[test]
fn a_sector_takes_vectors_of_any_length() {
    let discs = [[5.0, 0.0], [0.0, 5.0]].map(|center| Disc { center, radius: 1.0 });
    for length in [f64::from_bits(1), 1e-310, 1e-200, 1.0, 1e200, 1e308, f64::MAX] {
        let view = DiscView::new([0.0; 2]);
        assert_eq!(look(&discs, &view.with_sector([length, -length], [length, length])), [0], "{length}");
        assert_eq!(look(&discs, &view.with_sector([length, length], [length, -length])), [1], "{length}");
        assert_eq!(look(&discs, &view.with_sector([length, 0.0], [length, 0.0])), [0u32; 0], "{length}");
        for bad in [f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
            assert_eq!(
                look(&discs, &view.with_sector([bad, 0.0], [length, length])),
                [0, 1],
                "a sector from {bad}"
            );
            assert_eq!(
                look(&discs, &view.with_sector([length, 0.0], [length, bad])),
                [0, 1],
                "a sector up to {bad}"
            );
        }
    }
}

/// Returns how `b` is turned against `a`, by products with their rounding errors.
fn turn(a: [f64; 2], b: [f64; 2]) -> Ordering {
    let (first, second) = (a[0] * b[1], a[1] * b[0]);
    let errors = a[0].mul_add(b[1], -first) - a[1].mul_add(b[0], -second);
    ((first - second) + errors).partial_cmp(&0.0).unwrap()
}

/// A sector whose left end is clockwise of its right end by less than the numbers of directions tell apart is
/// nearly a full turn. One whose left end is counter-clockwise by as little is about a single direction.
#[test]
fn sectors_of_nearly_a_full_turn_see_all_around() {
    // Discs in all directions, each of which overlaps its neighbours.
    let at = |i: u32| f64::from(i) / 64.0 * core::f64::consts::TAU;
    let discs: Vec<Disc> =
        (0..64).map(|i| Disc { center: [9.0 * at(i).cos(), 9.0 * at(i).sin()], radius: 0.5 }).collect();
    let all: Vec<u32> = (0..64).collect();
    let sees = |right, left| look(&discs, &DiscView::new([0.0; 2]).with_sector(right, left));
    let [right, left] =
        [[1.9352096327442483, 0.012295526590495815], [1.142419737955464, 0.007258465454008533]];
    assert_eq!(sees(right, left), all, "a sector whose ends have numbers in the wrong order");
    let mut random = Random(9);
    let mut counts = [0; 3];
    for round in 0..3_000 {
        // Ends in any direction, or close to an axis.
        let middle = random.fine_range(-3.2, 3.2) * random.pick(&[1.0, 1e-9, 1e-16]);
        let middle = middle + f64::from(random.between(-2, 2)) * core::f64::consts::FRAC_PI_2;
        let half = core::f64::consts::PI;
        let [right, left] = [middle - half, middle + half].map(|a| [a.cos(), a.sin()]);
        let [right, left] = [right, left].map(|v| {
            let length = random.pick(&[1.0, 3.0, 0.7]);
            v.map(|x| x * length)
        });
        // Some ends are in the same direction. Powers of two change the lengths alone.
        let left = if random.one_in(6) { right } else { left };
        let [p, q] = [0; 2].map(|_| 2f64.powi(random.pick(&[0, 1, -930, 900])));
        let seen = sees(right.map(|x| x * p), left.map(|x| x * q));
        let turned = turn(right, left);
        counts[(turned as i8 + 1) as usize] += 1;
        let is_right = match turned {
            Ordering::Less => seen == all,
            Ordering::Equal => seen.is_empty(),
            Ordering::Greater => (1..4).contains(&seen.len()),
        };
        assert!(is_right, "round {round}: {} discs seen from {right:?} to {left:?}", seen.len());
    }
    assert!(counts.iter().all(|&count| count > 100), "{counts:?}");
}

/// Vectors of which one component underflows beside the other: the sector is not decided, and the view sees
/// all.
#[test]
fn a_sector_whose_ends_are_too_thin_to_compare_sees_all() {
    let discs = [[5.0, 0.0], [0.0, 5.0]].map(|center| Disc { center, radius: 1.0 });
    let look = |right, left| look(&discs, &DiscView::new([0.0; 2]).with_sector(right, left));
    let thin = [1.0, 1e-320];
    assert_eq!(look([1.0, 1e-310], thin), [0, 1], "two directions close to an axis");
    assert_eq!(look(thin, thin), [0u32; 0], "the same vector twice");
    // Scaled to size 1, the first vector's component would be 0.
    for [right, left] in [[[1e150, 1e-200], [1e150, 0.0]], [[1e200, 5e-150], [1e200, 0.0]]] {
        assert_eq!(look(right, left), [0, 1], "nearly a full turn from {right:?} to {left:?}");
    }
    for [right, left] in [[[1.0, 0.0], [2.0, 0.0]], [[0.0, 3.0], [0.0, 1.0]], [[-1.0, -1.0], [-5.0, -5.0]]] {
        assert_eq!(look(right, left), [0u32; 0], "two lengths of {right:?}");
    }
}

#[test]
fn a_disc_far_from_the_origin_is_found_to_its_tangent() {
    let far = f64::from(1 << 30);
    // The first disc is seen 4.8e-8 to the left of the direction +y, the others only to its right. There is
    // more than one leaf, so that the bounds of leaves are tested too.
    let discs: Vec<Disc> = (0..40)
        .map(|i| Disc { center: [far + 10.0 * f64::from(i), 1.0 + 10.0 * f64::from(i)], radius: 0.3 })
        .collect();
    let eye = [far - 2_516_582.0 / 8_388_608.0, 0.0];
    let view = DiscView::new(eye).with_sector([-1e-8, 1.0], [-1.0, 0.0]);
    assert_eq!(look(&discs, &view), [0], "the disc at the sector's edge");
}

#[test]
fn an_outlier_leaves_the_tree_tight() {
    let mut random = Random(8);
    for outlier in [1e9, 1e150] {
        let mut discs: Vec<Disc> = (0..4096)
            .map(|_| [random.fine_range(0.0, 64.0), random.fine_range(0.0, 64.0)])
            .map(|center| Disc { center, radius: 0.3 })
            .collect();
        discs.push(Disc { center: [outlier, 0.0], radius: 0.3 });
        let made = Discs::new(&discs).unwrap();
        let is_wide = |centers: &&[Disc]| {
            let extent = |axis: usize| {
                let all = || centers.iter().map(|disc| disc.center[axis]);
                all().fold(f64::MIN, f64::max) - all().fold(f64::MAX, f64::min)
            };
            extent(0) > 16.0 || extent(1) > 16.0
        };
        // At most one leaf is wide: the one with the outlier.
        assert!(made.discs.chunks(LEAF).filter(is_wide).count() <= 1, "{outlier}");
    }
}

#[test]
fn a_disc_in_a_pile_hides_nothing_and_others_hide() {
    let pile = (0..20_000).map(|i| Disc { center: [1e-7 * f64::from(i), 0.0], radius: 1.0 });
    let beside = [Disc { center: [1.2, 0.0], radius: 0.5 }, Disc { center: [9.0, 0.0], radius: 0.5 }];
    let discs: Vec<Disc> = beside.into_iter().chain(pile).collect();
    let made = Discs::new(&discs).unwrap();
    let solid = |of: u32| made.solid_radii[made.indices.iter().position(|&i| i == of).unwrap()];
    // The first disc overlaps more discs than are searched.
    assert_eq!(
        [solid(0), solid(1), solid(2), solid(10_000)],
        [0.0, 0.5, 0.0, 0.0],
        "solid radii of discs in the pile and beside it"
    );
}
