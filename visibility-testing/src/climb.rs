//! A search for wrong answers that climbs towards them: an input that a culler hides is changed, one number
//! at a time, so that less and less hides it, and bisected onto the border at which the culler begins to show
//! it.
//!
//! Random inputs come within a millionth of a border once in a million trials. A climb ends beside the border
//! each time: at two inputs that differ in one number by one unit, of which the culler hides one.

use crate::Random;

/// An input of a culler whose numbers are integers, with an exact oracle.
pub trait ClimbInput: Clone {
    /// Returns the numbers that a climb changes.
    fn numbers(&mut self) -> &mut [i64];

    /// Returns by how much the input is hidden, as the oracle says: any measure that falls towards the
    /// border. At most 0 if and only if the input is certainly seen. `None` if the input is no valid one.
    fn clearance(&self) -> Option<f64>;

    /// Returns the input without one of its parts, such as a triangle. `None` from the last part on.
    fn without(&self, _part: usize) -> Option<Self> {
        None
    }
}

/// A finished climb.
#[derive(Clone, Debug)]
pub struct Climb<I> {
    /// The hidden input with the least clearance, or a hidden input that is seen: of as few parts, and
    /// numbers of as few digits, as the culler is wrong about.
    pub input: I,
    /// Clearance of `input`. At most 0 if the culler is wrong.
    pub least: f64,
    /// Number of hidden inputs that the oracle has judged.
    pub judged: u64,
}

/// Changes `input` in up to `steps` steps, each of which lowers its clearance and keeps it hidden. A step
/// moves one number by up to 2^22 units. If the moved input is shown, the step is bisected until the inputs
/// on both sides of the border differ by one unit. Ends early at a hidden input that is seen. `None` if
/// `input` is not hidden, or not valid.
pub fn climb<I: ClimbInput>(
    mut input: I,
    random: &mut Random,
    steps: usize,
    mut is_hidden: impl FnMut(&I) -> bool,
) -> Option<Climb<I>> {
    let least = input.clearance()?;
    if !is_hidden(&input) {
        return None;
    }
    let mut best = Climb { input: input.clone(), least, judged: 1 };
    for _ in 0..steps {
        if best.least <= 0.0 {
            break;
        }
        let at = random.below(input.numbers().len());
        let by = random.magnitude(22);
        let start = best.input.clone().numbers()[at];
        let (mut hidden, mut shown) = (start, if random.one_in(2) { start + by } else { start - by });
        input = best.input.clone();
        input.numbers()[at] = shown;
        if input.clearance().is_none_or(|clearance| clearance >= best.least) {
            continue;
        }
        // The first round asks about the whole step, later ones about the middle between both ends.
        let mut ask = shown;
        loop {
            input.numbers()[at] = ask;
            match input.clearance() {
                Some(clearance) if is_hidden(&input) => {
                    best.judged += 1;
                    hidden = ask;
                    if clearance < best.least {
                        (best.input, best.least) = (input.clone(), clearance);
                    }
                }
                _ => shown = ask,
            }
            ask = hidden + (shown - hidden) / 2;
            if ask == hidden || hidden == shown || best.least <= 0.0 {
                break;
            }
        }
    }
    if best.least <= 0.0 {
        best.input = simplified(best.input, |input| {
            best.judged += 1;
            input.clearance().is_some_and(|clearance| clearance <= 0.0) && is_hidden(input)
        });
        best.least = best.input.clearance()?;
    }
    Some(best)
}

/// Leaves out parts of an input and makes its numbers rounder, as long as it `fails`.
fn simplified<I: ClimbInput>(mut input: I, mut fails: impl FnMut(&I) -> bool) -> I {
    loop {
        let mut is_simpler = false;
        let mut part = 0;
        while let Some(less) = input.without(part) {
            if fails(&less) {
                (input, is_simpler) = (less, true);
            } else {
                part += 1;
            }
        }
        for at in 0..input.numbers().len() {
            let number = input.numbers()[at];
            let rounder = (0..19).rev().map(|digits| number - number % 10i64.pow(digits));
            for rounder in rounder.take_while(|&rounder| rounder != number) {
                let mut other = input.clone();
                other.numbers()[at] = rounder;
                if fails(&other) {
                    (input, is_simpler) = (other, true);
                    break;
                }
            }
        }
        if !is_simpler {
            return input;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A number that is seen from 1000 on.
    #[derive(Clone, Debug)]
    struct Number([i64; 1]);

    impl ClimbInput for Number {
        fn numbers(&mut self) -> &mut [i64] {
            &mut self.0
        }

        fn clearance(&self) -> Option<f64> {
            Some((1000 - self.0[0]) as f64)
        }
    }

    #[test]
    fn a_climb_ends_at_the_border_and_finds_an_error_of_one_unit() {
        let climb = |border: i64| climb(Number([-70_000]), &mut Random(1), 100, |input| input.0[0] < border);
        assert_eq!(climb(1000).map(|end| end.least), Some(1.0), "the last hidden number is 999");
        assert_eq!(climb(300).map(|end| end.least), Some(701.0), "a margin of 700 keeps its distance");
        assert_eq!(climb(1001).map(|end| end.least), Some(0.0), "1000 is hidden, and seen");
        assert!(climb(-80_000).is_none(), "an input that is shown is no start");
    }

    /// Heights of slabs, of which those from 700 on are seen, and an eye.
    #[derive(Clone, PartialEq, Debug)]
    struct Slabs(Vec<i64>);

    impl ClimbInput for Slabs {
        fn numbers(&mut self) -> &mut [i64] {
            &mut self.0
        }

        fn clearance(&self) -> Option<f64> {
            self.0.iter().map(|height| (700 - height) as f64).min_by(f64::total_cmp)
        }

        fn without(&self, part: usize) -> Option<Self> {
            let mut less = self.clone();
            (part < self.0.len()).then(|| less.0.remove(part))?;
            Some(less)
        }
    }

    #[test]
    fn what_a_climb_finds_is_made_as_simple_as_it_stays_wrong() {
        let start = Slabs(vec![-123_456, 3, 98_765]);
        let end = climb(start.clone(), &mut Random(1), 100, |_| true).expect("hidden");
        assert_eq!(end.input, Slabs(vec![90_000]), "the slab that is seen, by its first digit");
        assert!(end.least <= 0.0, "seen: {}", end.least);
        let end = climb(start, &mut Random(1), 100, |slabs| slabs.0.contains(&3)).expect("hidden");
        assert_eq!(end.input, Slabs(vec![3, 90_000]), "without the 3 the culler is right");
    }
}
