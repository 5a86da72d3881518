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

/// Returns a random direction (p, q) whose length h is whole.
fn whole_direction(random: &mut Random, bits: usize) -> [i64; 3] {
    let [m, n] = [0; 2].map(|_| random.magnitude(bits));
    let (p, q) = (m * m - n * n, 2 * m * n);
    let (p, q) = if random.one_in(2) { (q, p) } else { (p, q) };
    [if random.one_in(2) { -p } else { p }, if random.one_in(2) { -q } else { q }, m * m + n * n]
}

/// Returns the disc of radius `m` h that touches the ray in the direction (p, q) at `k` h, at the ray's left
/// for a `side` of 1, at its right for -1.
fn touching([p, q, h]: [i64; 3], k: i64, m: i64, side: i64) -> Disc {
    let center = [k * p - side * m * q, k * q + side * m * p].map(|x| x as f64);
    Disc { center, radius: (m * h) as f64 }
}

/// A disc reaches over a ray by one unit: it is seen beyond what covers all up to the ray, and within the
/// sector that begins at the ray. Discs that stay behind the ray are not.
#[test]
fn discs_that_reach_over_a_ray_by_a_unit_are_seen() {
    let mut random = Random(21);
    let mut hidden = 0;
    for round in 0..4_000 {
        let ray = whole_direction(&mut random, 11);
        let (side, far) = (if random.one_in(2) { 1 } else { -1 }, random.magnitude(26));
        let over = |disc: Disc| Disc { radius: disc.radius + 1.0, ..disc };
        // The farther disc is narrow, or as wide as it can be; the nearer one covers more on the other side.
        let narrow = touching(ray, far, 1 + far / (2 << random.below(8)), side);
        let wide = touching(ray, 1 + far / (2 << random.below(16)), far, side);
        let near = 1 + far / (4 << random.below(16));
        let cover = touching(ray, near, far, side);
        let ball = f64::from(random.between(0, 1));
        let cover = Disc { radius: cover.radius + ball, ..cover };
        let view = DiscView::new([0.0; 2]).with_ball(ball);
        assert!(look(&[cover, over(narrow)], &view).contains(&1), "round {round}: {cover:?} {narrow:?}");
        let inner = Disc { radius: narrow.radius * (1.0 - 1e-6), ..narrow };
        hidden += usize::from(!look(&[cover, inner], &view).contains(&1));
        // The sector on the other side of the ray, up to a quarter turn.
        let [p, q, _] = ray.map(|x| x as f64);
        let (right, left) = if side < 0 { ([p, q], [-q, p]) } else { ([q, -p], [p, q]) };
        let view = DiscView::new([0.0; 2]).with_sector(right, left);
        for disc in [over(wide), over(narrow)] {
            assert!(look(&[disc], &view).contains(&0), "round {round}: {disc:?} in {right:?} to {left:?}");
        }
        assert!(look(&[inner], &view).is_empty(), "round {round}: {inner:?} in {right:?} to {left:?}");
        // A point on the ray itself is the corner of a node whose other points are outside of the sector.
        let short = whole_direction(&mut random, 6);
        let [p, q, _] = short.map(|x| x as f64);
        let (right, left) = if side < 0 { ([p, q], [-q, p]) } else { ([q, -p], [p, q]) };
        let (view, k) = (DiscView::new([0.0; 2]).with_sector(right, left), random.magnitude(9));
        let points = (0..20).map(|m| Disc { radius: 0.0, ..touching(short, k, m, side) });
        let points: Vec<Disc> = points.collect();
        assert_eq!(look(&points, &view), [0], "round {round}: a point on the ray {short:?}");
    }
    assert!(hidden > 2_000, "{hidden}");
}

/// Discs whose nearest point is at just the range; an eye in a ball that is inside of a disc by half a unit;
/// and discs in a row, of which the first hides the others.
#[test]
fn ranges_and_balls_end_where_whole_numbers_say() {
    let mut random = Random(22);
    for round in 0..4_000 {
        let [p, q, h] = whole_direction(&mut random, 26);
        let center = [p as f64, q as f64];
        let radius = (h - h / (1 << random.below(40)).min(h)) as f64;
        let range = h as f64 - radius;
        let view = DiscView::new([0.0; 2]);
        let disc = Disc { center, radius };
        assert_eq!(look(&[disc], &view.with_range(range)), [0], "round {round}: {disc:?} up to {range}");
        if radius < h as f64 {
            let less = range * (1.0 - 1e-6) - radius * 1e-6;
            assert!(look(&[disc], &view.with_range(less)).is_empty(), "round {round}: {disc:?}, {less}");
        }
        // The sum of the ball and a radius above 2^52 is rounded to the distance, if that is even.
        let [m, n] = [0; 2].map(|_| (1 << 25) + random.below(1 << 25) as i64);
        let (center, radius) = ([(m * m - n * n) as f64, (2 * m * n) as f64], (m * m + n * n) as f64);
        let (around, ball) = (Disc { center, radius: radius - 1_048_576.0 }, 1_048_576.5);
        let behind = Disc { center: center.map(|x| 3.0 * x), radius: 1.0 };
        let seen = look(&[around, behind], &view.with_ball(ball));
        assert_eq!(seen, [0, 1], "round {round}: behind {around:?}, which contains eyes");
    }
    let row: Vec<Disc> =
        (0..40).map(|i| Disc { center: [f64::from(40 - i) * 3.0, 0.5], radius: 1.0 }).collect();
    assert_eq!(look(&row, &DiscView::new([0.0; 2])), [39], "the nearest of a row");
    let view = DiscView::new([0.0; 2]);
    let disc = Disc { center: [3.0, 0.0], radius: 1.0 };
    for (range, expected) in [(2.0, &[0][..]), (1.9, &[]), (-5.0, &[]), (f64::NAN, &[])] {
        assert_eq!(look(&[disc], &view.with_range(range)), expected, "a range of {range}");
    }
    for ball in [-5.0, f64::NAN] {
        assert_eq!(look(&row, &view.with_ball(ball)), [39], "a ball of {ball}");
    }
    for far in [view.with_ball(1e200), DiscView::new([1e200, 0.0]), DiscView::new([0.0, f64::NAN])] {
        assert_eq!(look(&row, &far).len(), 40, "all discs from {far:?}");
    }
    for zero in [view.with_sector([0.0; 2], [1.0, 0.0]), view.with_sector([1.0, 0.0], [0.0; 2])] {
        assert_eq!(look(&row, &zero), [39], "a sector with a zero vector");
    }
}

/// The tangents of this disc are off by half a turn, so it counts as around the eye.
#[test]
fn an_eye_almost_on_a_circle_sees_the_disc() {
    let disc = Disc { center: [1.0, 0.0], radius: 1.0 - f64::EPSILON };
    let view = DiscView::new([0.0; 2]).with_sector([1.0, -0.1], [1.0, 0.1]);
    assert_eq!(look(&[disc], &view), [0], "the disc in front of the eye");
}

/// A disc inside another one, nearer than what that one hides with its solid part.
#[test]
fn solid_parts_hide_only_what_is_behind_them() {
    let discs = [Disc { center: [5.0, 0.0], radius: 2.0 }, Disc { center: [4.75, 0.0], radius: 0.1 }];
    assert_eq!(look(&discs, &DiscView::new([0.0; 2])), [0, 1], "the outer disc and the inner one");
}

/// Solid radii leave out other discs by exact arithmetic, and no more than rounding beside; discs that touch
/// are not disjoint.
#[test]
fn solid_radii_are_the_distances_of_other_discs() {
    let mut random = Random(23);
    let square = |x: f64| ((x * 4096.0) as i128).pow(2);
    for round in 0..500 {
        let [p, q, h] = whole_direction(&mut random, 14);
        let at = |k: i64| [(k * p) as f64, (k * q) as f64];
        // Two discs that touch or overlap, in two leaves: half of the discs is on either side of them.
        let first = 1 + random.below(h.min(1 << 23) as usize) as i64;
        let more = [0, random.magnitude(20)][random.below(2)];
        let mut discs = alloc::vec![Disc { center: [0.0; 2], radius: first as f64 }];
        discs.push(Disc { center: at(1), radius: (h - first + more) as f64 });
        let apart = 8 * (1 + more / h);
        discs.extend((1..32).flat_map(|k| [k, -k]).map(|k| Disc { center: at(k * apart), radius: 1.0 }));
        let made = Discs::new(&discs).unwrap();
        let solid = |of: u32| made.solid_radii[made.indices.iter().position(|&i| i == of).unwrap()];
        let expected = (h as f64 - discs[1].radius).max(0.0);
        let is_less = |of: u32| solid(of) < discs[of as usize].radius || discs[of as usize].radius == 0.0;
        assert!(is_less(0) && is_less(1), "round {round}: discs that touch each other");
        assert!(solid(0) >= expected - 2e-12 * h as f64, "round {round}: {} of {expected}", solid(0));
        let reach = solid(0) + discs[1].radius;
        assert!(solid(0) == 0.0 || square(reach) < square(h as f64), "round {round}: {reach} of {h}");
        assert_eq!(solid(63), 1.0, "round {round}: the last disc, which is alone");
    }
    let disjoint = |discs: &[Disc]| Discs::new(discs).unwrap().are_disjoint;
    let disc = |x: f64, radius: f64| Disc { center: [x, 0.0], radius };
    assert!(disjoint(&[disc(0.0, 1.0), disc(3.0, 1.0)]), "discs apart");
    assert!(!disjoint(&[disc(0.0, 1.0), disc(2.0, 1.0)]), "discs that touch");
    assert!(!disjoint(&[disc(0.0, 0.0)]), "a point");
    let bad = [disc(1e151, 1.0), disc(0.0, -1.0), disc(0.0, 1e151), disc(f64::NAN, 1.0)];
    assert!(bad.iter().all(|&disc| Discs::new(&[disc]).is_err()), "discs without a place or a radius");
}

/// Bounds of a node contain its discs by exact arithmetic, and are as wide as the discs up to rounding. They
/// are finite, however far discs are.
#[test]
fn nodes_contain_their_discs() {
    let mut random = Random(24);
    let node = |disc: Disc| Discs::new(&[disc]).unwrap().levels[0][0];
    // All numbers are multiples of 2^-30.
    let exact = |x: f64| (x * 2f64.powi(40)) as i128;
    for round in 0..4_000 {
        // Discs that `f32` holds exactly, and others; near the eye, and so far that differences round.
        let (bits, far) = ([23, 50][round % 2], [1.0, 2f64.powi(43)][round / 2 % 2]);
        let mut number = |bits| random.magnitude(bits) as f64 / f64::from(1 << 30);
        let disc = Disc { center: [far * number(bits), -far * number(bits)], radius: far * number(bits) };
        let eye = [number(50), -number(50)];
        let around = node(disc).around(eye);
        for (axis, sign) in [(0, -1.0), (1, -1.0), (0, 1.0), (1, 1.0)] {
            let bound = sign * around[axis + if sign > 0.0 { 2 } else { 0 }];
            let [center, at] = [disc.center[axis], eye[axis]].map(|x| sign * x);
            let end = exact(center) - exact(at) + exact(disc.radius);
            let size = center.abs() + at.abs() + disc.radius;
            assert!(exact(bound) >= end, "round {round}: {bound} of {disc:?} from {eye:?}");
            assert!(exact(bound) <= end + exact(size * 3e-7) + 1, "round {round}: {bound} of {disc:?}");
        }
    }
    for x in [1.0, 1.0 + 1e-12, -1.0 - 1e-12, 0.1, -0.1, 1e149, -1e149, 1e-300, -1e-300, 0.0] {
        let node = node(Disc { center: [x, 0.0], radius: x.abs() });
        let wide = [node.min[0], node.max[0], node.radius].map(f64::from);
        assert!(wide[0] <= x && wide[1] >= x && wide[2] >= x.abs(), "{wide:?} around {x}");
        let is_next = |bound: f32, inwards: f32| {
            f64::from(bound) == x || (f64::from(inwards) - x).signum() != (f64::from(bound) - x).signum()
        };
        assert!(is_next(node.min[0], node.min[0].next_up()), "{wide:?} is close to {x}");
        assert!(is_next(node.max[0], node.max[0].next_down()), "{wide:?} is close to {x}");
    }
    for eye in [[0.0; 2], [-1e150, 1e150]] {
        let around = node(Disc { center: [1e150, -1e150], radius: 1e150 }).around(eye);
        assert!(around.iter().all(|x| x.abs() <= 1e300), "{around:?}");
    }
}

/// Discs so near to each other that the square of their distance underflows, in front of a distant eye; and
/// an eye that moves beyond a reach whose square underflows.
#[cfg(feature = "papers")]
#[test]
fn zones_keep_nothing_where_squares_underflow() {
    for scale in [1e-140, 1e-147, 1e-150] {
        let near = 1e-306 / scale;
        let discs = [(0.0, 1.0), (1.5, 0.1), (-1.5, 0.1)]
            .map(|(y, radius)| Disc { center: [0.0, y * near], radius: radius * near });
        let made = Discs::new(&discs).unwrap();
        let mut kept = super::KineticZone::new(&made, scale);
        for step in 0..1600 {
            let turn = 2.5e-3 * f64::from(step);
            let eye = [scale * turn.cos(), scale * turn.sin()];
            let mut seen = kept.move_to(eye).to_vec();
            seen.sort_unstable();
            assert_eq!(seen, look(&discs, &DiscView::new(eye)), "scale {scale}, step {step}");
        }
    }
    // The least scale at which a disc has a span.
    let made = Discs::new(&[Disc { center: [6e-154, 0.0], radius: 1e-154 }]).unwrap();
    for (reach, is_kept) in [(1e-162, false), (1e-153, true)] {
        let mut kept = super::KineticZone::new(&made, reach);
        kept.move_to([0.0; 2]);
        kept.move_to([1.4e-162, 0.0]);
        assert_eq!(!kept.work().rebuilt, is_kept, "a move of 1.4e-162 with a reach of {reach}");
    }
}

/// A disc thinner than rounding, in a gap beside one that hides a third: the third comes into view.
#[cfg(feature = "papers")]
#[test]
fn zones_see_past_discs_thinner_than_rounding() {
    let discs = [([5.0, 0.0], 1.0), ([0.0, 10.0], 1e-17), ([30.0, 0.0], 1.0)]
        .map(|(center, radius)| Disc { center, radius });
    let made = Discs::new(&discs).unwrap();
    for y in [1.9, -1.9] {
        let mut kept = super::KineticZone::new(&made, 2.0);
        kept.move_to([0.0; 2]);
        let mut seen = kept.move_to([0.0, y]).to_vec();
        seen.sort_unstable();
        assert_eq!(seen, [0, 1, 2], "from y = {y}");
    }
}

/// Segments at an eye on a line that touches two discs, by whole numbers, are ended; a little before they are
/// kept.
#[cfg(feature = "papers")]
#[test]
fn segments_end_on_lines_that_touch_two_discs() {
    let mut random = Random(25);
    let [mut ended, mut kept_before] = [0; 2];
    for round in 0..4_000 {
        let ray = whole_direction(&mut random, 8);
        let [p, q, _] = ray.map(|x| x as f64);
        let mut side = || if random.one_in(2) { 1 } else { -1 };
        let sides = [side(), side()];
        let near = touching(ray, 100, 1 + random.below(40) as i64, sides[0]);
        let far = touching(ray, 300, 1 + random.below(40) as i64, sides[1]);
        let made = Discs::new(&[near, far]).unwrap();
        let mut zone = super::KineticZone::new(&made, 1e9);
        // A few of 100 steps aside.
        let aside = random.fine_range(0.1, 5.0) * f64::from(random.pick(&[-1, 1]));
        let at = |share: f64| [-q * aside * share, p * aside * share];
        zone.move_to(at(1.0));
        zone.move_to(at(0.5));
        kept_before += usize::from(zone.work().ended == 0);
        zone.move_to(at(1e-3));
        let seen = look(&[near, far], &DiscView::new([0.0; 2]));
        let mut moved = zone.move_to([0.0; 2]).to_vec();
        moved.sort_unstable();
        assert_eq!(moved, seen, "round {round}: {near:?} and {far:?}");
        assert!(zone.work().ended > 0, "round {round}: {near:?} and {far:?}, {aside} aside");
        ended += 1;
    }
    assert!(kept_before > ended * 9 / 10, "{kept_before} of {ended} are kept until close to the line");
}

/// Discs of many sizes, from an eye that moves up to the reach and beyond: what is kept is what is seen.
#[cfg(feature = "papers")]
#[test]
fn zones_of_discs_of_many_sizes_are_those_from_scratch() {
    let mut random = Random(26);
    let (mut quiet, mut moves) = (0, 0);
    for world in 0..300 {
        let mut discs: Vec<Disc> = Vec::new();
        // In half of the worlds, the first eye sees the first disc from the direction 0 on, or up to it.
        let mut eye = [0; 2].map(|_| random.fine_range(-2.0, 14.0));
        if world % 2 == 0 {
            eye = [0.0, 6.0];
            let [far, radius] = [0; 2].map(|_| f64::from(random.between(1, 3)));
            discs.push(Disc { center: [far, 6.0 + radius * random.pick(&[-1.0, 1.0])], radius });
        }
        for _ in 0..40 {
            let radius = 10f64.powf(random.fine_range(-2.0, 0.5));
            let disc = Disc { center: [0; 2].map(|_| random.fine_range(0.0, 12.0)), radius };
            let is_apart = |other: &Disc| {
                let [x, y] = [0, 1].map(|k| other.center[k] - disc.center[k]);
                x.hypot(y) > other.radius + radius
            };
            if discs.len() < 2 + world % 9 && discs.iter().all(is_apart) {
                discs.push(disc);
            }
        }
        let made = Discs::new(&discs).unwrap();
        let reach = random.fine_range(0.1, 6.0);
        let mut kept = super::KineticZone::new(&made, reach);
        kept.move_to(eye);
        for step in 0..30 {
            let (turn, length) =
                (random.fine_range(0.0, 7.0), reach * random.pick(&[0.02, 0.1, 0.5, 0.9, 1.1]));
            let to = [eye[0] + length * turn.cos(), eye[1] + length * turn.sin()];
            eye = if to.iter().all(|x| (-6.0..18.0).contains(x)) { to } else { [-2.0, random.unit() * 12.0] };
            let mut seen = kept.move_to(eye).to_vec();
            seen.sort_unstable();
            assert_eq!(
                seen,
                look(&discs, &DiscView::new(eye)),
                "world {world}, step {step}: {eye:?}, {discs:?}"
            );
            quiet += usize::from(kept.work().ended == 0 && !kept.work().rebuilt);
            moves += 1;
        }
    }
    assert!(quiet * 20 > moves, "{quiet} of {moves} moves end nothing");
}

/// The least power of a point with respect to a node is no more than that of any of its discs, and not
/// nothing away from them. Compared in whole numbers.
#[test]
fn least_powers_are_bounds() {
    let mut random = Random(25);
    for round in 0..2_000 {
        let mut number = || random.between(-1000, 1000);
        let discs = [0; 3].map(|_| [number(), number(), number().abs()]);
        let disc =
            |[x, y, radius]: [i32; 3]| Disc { center: [x, y].map(f64::from), radius: f64::from(radius) };
        let node = Discs::new(&discs.map(disc)).unwrap().levels[0][0];
        let at = [number(), number()];
        let least = node.least_power(at.map(f64::from));
        let widest = discs.iter().map(|disc| disc[2]).max().unwrap();
        for [x, y, radius] in discs {
            let power = (x - at[0]).pow(2) + (y - at[1]).pow(2) - radius.pow(2);
            assert!(least <= f64::from(power), "round {round}: {least} of {discs:?} at {at:?}");
        }
        let away = [0, 1].map(|axis| {
            let ends = discs.map(|disc| disc[axis]);
            (ends.iter().min().unwrap() - at[axis]).max(at[axis] - ends.iter().max().unwrap()).max(0)
        });
        let expected = away[0].pow(2) + away[1].pow(2) - widest.pow(2);
        assert_eq!(least, f64::from(expected), "round {round}: {discs:?} at {at:?}");
    }
}
