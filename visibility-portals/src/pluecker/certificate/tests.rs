//! Certificates are compared with exact arithmetic: rounding, signs and failed eliminations never produce a
//! false proof.

use super::*;
use alloc::vec::Vec;
use visibility_testing::Random;

/// Returns a random integer from 0 to 2^`bits` - 1. `bits` is at most 96.
fn integer(random: &mut Random, bits: u32) -> i128 {
    (i128::from(random.bits()) << 32 | i128::from(random.bits() & 0xffff_ffff)) >> (96 - bits)
}

/// Returns the double-double number nearest to `v`.
fn nearest(v: i128) -> DoubleDouble {
    let hi = v as f64;
    DoubleDouble { hi, lo: (v - hi as i128) as f64 }
}

fn exact(a: DoubleDouble) -> i128 {
    a.hi as i128 + a.lo as i128
}

fn row(normal: i128, least: f64) -> Row<1> {
    Row { normal: [nearest(normal)], error: 0.0, least }
}

/// Returns four multipliers, four integer normals and a remainder. The products of multiplier and normal have
/// more digits than a double-double keeps. The last product cancels the sum of the others up to the
/// remainder, which is exact.
fn cancelling(random: &mut Random) -> ([DoubleDouble; 4], [i128; 4], i128) {
    let l: [i128; 3] = core::array::from_fn(|_| integer(random, 66) | 1 << 65);
    let h: [i128; 3] = core::array::from_fn(|_| integer(random, 50) | 1);
    let sum: i128 = l.iter().zip(&h).map(|(l, h)| l * h).sum();
    let last = nearest(sum);
    ([nearest(l[0]), nearest(l[1]), nearest(l[2]), last], [h[0], h[1], h[2], -1], sum - exact(last))
}

#[test]
fn what_rounding_leaves_of_sums_that_cancel_is_no_proof() {
    let (mut random, mut tempting) = (Random(1), [0; 2]);
    for _ in 0..100_000 {
        let (l, h, rest) = cancelling(&mut random);
        let multipliers = [l[0], l[1], l[2], l[3], DoubleDouble::from(1.0)];
        let add = |sum: DoubleDouble, i: usize| sum.plus(l[i].times(nearest(h[i])));
        let rounded = exact((0..4).fold(DoubleDouble::ZERO, add));
        let near = rest.abs() as f64;
        // The remainder of the normals, with a least value that it can just reach: this is no contradiction.
        let rows = |least| [row(h[0], 0.0), row(h[1], 0.0), row(h[2], 0.0), row(-1, 0.0), row(0, least)];
        assert!(!proves(&rows(near), &[1.0], &multipliers), "{l:?} {h:?}");
        tempting[0] += u32::from(rounded.abs() < rest.abs());
        // The multipliers are a proof if the least value allows for their rounding, by 2^28 = 2^-90 of 2^118.
        assert!(proves(&rows(near + 2f64.powi(28)), &[1.0], &multipliers), "{l:?} {h:?}");
        // The least values, instead of the normals, now cancel up to the remainder, which stands against one
        // normal.
        let least = |i: usize| row(0, h[i] as f64);
        let rows = |normal| [least(0), least(1), least(2), least(3), row(normal, 0.0)];
        assert!(!proves(&rows(rest.abs()), &[1.0], &multipliers), "{l:?} {h:?}");
        tempting[1] += u32::from(rounded > rest.abs());
    }
    // Counts how often plain evaluation would have accepted a false proof.
    assert!(tempting.iter().all(|&count| count > 1000), "{tempting:?}");
}

#[test]
fn what_is_not_known_of_the_normals_is_no_proof() {
    // 1 <= 0 x for an x of at most 1 in absolute value, where the coefficient 0 may be off by `error`.
    let zero = |error| [Row { normal: [DoubleDouble::ZERO], error, least: 1.0 }];
    assert!(proves(&zero(0.5), &[1.0], &[DoubleDouble::from(1.0)]), "the error is less than what is missing");
    assert!(
        !proves(&zero(1.0), &[1.0], &[DoubleDouble::from(1.0)]),
        "the error is as large as what is missing"
    );
    assert!(
        !proves(&zero(0.5), &[2.0], &[DoubleDouble::from(1.0)]),
        "with x up to 2, the error is as large as what is missing"
    );
}

#[test]
fn negative_multipliers_and_what_is_no_number_prove_nothing() {
    let one = DoubleDouble::from(1.0);
    // x >= 1 and x >= 0: a negative multiplier would derive 0 >= 1.
    let rows = [row(1, 1.0), row(1, 0.0)];
    for bad in [one.negated(), DoubleDouble { hi: 1.0, lo: -2.0 }, DoubleDouble::from(f64::NAN)] {
        assert!(!proves(&rows, &[5.0], &[one, bad]), "{bad:?}");
    }
    let contradiction = [row(1, 1.0), row(-1, 0.0)];
    assert!(proves(&contradiction, &[5.0], &[one, one]), "x at least 1 and at most 0");
    for bad in [f64::NAN, f64::INFINITY] {
        assert!(!proves(&contradiction, &[bad], &[one, DoubleDouble::from(0.5)]), "a bound of {bad} on x");
        assert!(!proves(&[row(1, bad), row(-1, 0.0)], &[5.0], &[one, one]), "a row with {bad}");
        assert!(
            !proves(&contradiction, &[5.0], &[DoubleDouble::from(bad), DoubleDouble::from(bad)]),
            "multipliers of {bad}"
        );
    }
}

/// Returns normals and least values of 2 to [`MAX_ROWS`] constraints that one integer point
/// satisfies, most of them with equality. The normals have small integers, so that many cancel, and include
/// opposite pairs that differ in the last digits.
fn through_a_point<const K: usize>(random: &mut Random) -> (Vec<[i64; K]>, Vec<i64>) {
    let point: [i64; K] = core::array::from_fn(|_| i64::from(random.between(-9, 9)));
    let count = 2 + random.bits() as usize % (MAX_ROWS - 1);
    let fine = [0, 20, 34][random.bits() as usize % 3];
    let mut normals: Vec<[i64; K]> = Vec::new();
    while normals.len() < count {
        let normal: [i64; K] = core::array::from_fn(|_| i64::from(random.between(-2, 2)) << fine);
        normals.push(normal);
        if normals.len() < count && random.bits().is_multiple_of(2) {
            normals.push(normal.map(|h| -h + i64::from(random.between(-1, 1))));
        }
    }
    let through = |normal: &[i64; K]| normal.iter().zip(&point).map(|(h, x)| h * x).sum::<i64>();
    let least =
        normals.iter().map(|normal| through(normal) - i64::from(random.bits().is_multiple_of(8))).collect();
    (normals, least)
}

fn rows_of<const K: usize>((normals, least): &(Vec<[i64; K]>, Vec<i64>)) -> Vec<Row<K>> {
    let row = |(normal, &least): (&[i64; K], &i64)| Row {
        normal: normal.map(|h| DoubleDouble::from(h as f64)),
        error: 0.0,
        least: least as f64,
    };
    normals.iter().zip(least).map(row).collect()
}

fn never_refuted<const K: usize>(random: &mut Random) {
    let mut refuted = 0;
    for _ in 0..30_000 {
        let mut all = through_a_point::<K>(random);
        let rows = rows_of(&all);
        assert!(find(&rows, &[9.0; K]).is_none(), "{all:?}");
        // One more constraint, whose normal is the opposite of the sum of the others, contradicts them by a
        // half.
        if all.0.len() < MAX_ROWS.min(K + 1) {
            let mut opposite = [0; K];
            all.0.iter().for_each(|n| opposite.iter_mut().zip(n).for_each(|(sum, h)| *sum -= h));
            let least = -all.1.iter().sum::<i64>();
            all.0.push(opposite);
            all.1.push(least);
            let mut rows = rows_of(&all);
            rows[0].least += 0.5;
            refuted += u32::from(find(&rows, &[9.0; K]).is_some());
        }
    }
    assert!(refuted > 1000, "{K}: {refuted}");
}

#[test]
fn what_has_a_point_is_never_refuted() {
    let mut random = Random(2);
    never_refuted::<2>(&mut random);
    never_refuted::<3>(&mut random);
    never_refuted::<5>(&mut random);
    never_refuted::<6>(&mut random);
}
