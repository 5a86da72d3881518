//! Numbers on and next to the borders of pixels, with exact integer ranks, with which an oracle compares
//! them.

/// Difference between the [ranks](End::rank) of two successive integers.
pub const UNIT: i64 = 12;

/// Multiple of 1/4, or one of the two floating-point numbers next to it, for tests at borders, such as those
/// of pixels at integers. `rank` tells exactly, in integers, on which side of a border the number lies: the
/// integer k has rank [`UNIT`] k, a multiple q of 1/4 has rank [`UNIT`] q, and its neighbours have one rank
/// less and one more.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct End<T> {
    /// The number itself, in pixels for example.
    pub value: T,
    /// Exact position of the number: two numbers of one list compare like their ranks.
    pub rank: i64,
}

/// Returns all multiples of a quarter from `first` to `last`, both included, each with the floating-point
/// numbers just before and after it, in ascending order.
///
/// ```
/// use visibility_testing::{UNIT, ends};
/// let all = ends(-1, 1);
/// assert!(all.len() == 27 && all.is_sorted_by(|a, b| a.value < b.value && a.rank < b.rank));
/// assert!(all.iter().all(|end| (end.value < 1.0) == (end.rank < UNIT)));
/// ```
pub fn ends(first: i32, last: i32) -> Vec<End<f64>> {
    around(first, last, |quarters| f64::from(quarters) / 4.0, |x| [x.next_down(), x, x.next_up()])
}

/// Returns the same numbers as [`ends`], in single precision.
pub fn ends_f32(first: i16, last: i16) -> Vec<End<f32>> {
    let quarter = |quarters: i32| (f64::from(quarters) / 4.0) as f32;
    around(first.into(), last.into(), quarter, |x| [x.next_down(), x, x.next_up()])
}

fn around<T: Copy>(
    first: i32,
    last: i32,
    quarter: impl Fn(i32) -> T,
    three: impl Fn(T) -> [T; 3],
) -> Vec<End<T>> {
    let quarters = 4 * first..=4 * last;
    let ranks = quarters.map(|q| (quarter(q), 3 * i64::from(q)));
    ranks
        .flat_map(|(x, rank)| three(x).into_iter().zip(rank - 1..).map(|(value, rank)| End { value, rank }))
        .collect()
}
