//! Linear programs in few variables, with answers that are proofs.
//!
//! [`Solver`] finds a point in the intersection of half-spaces, or the best one, by the randomized
//! incremental algorithm (Raimund Seidel, "Small-Dimensional Linear Programming and Convex Hulls Made Easy",
//! 1991), in time linear in the half-spaces. It computes in `f64` and trusts none of it. A point is checked
//! against all half-spaces. That there is none is only said with a [`Certificate`]: a few multipliers whose
//! contradiction survives all rounding (Farkas' lemma). What can be proved neither way is
//! [`Feasible::Maybe`].

mod certificate;
mod seidel;

pub(crate) use certificate::{MOST, Row, find};
pub(crate) use seidel::{BOX, Levels, Stop};

use visibility_core::geometry::DoubleDouble;

/// The points `x` with `normal . x + offset >= 0`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct HalfSpace<const D: usize> {
    /// Points inwards; of any length.
    pub normal: [f64; D],
    /// Value of the left side at the origin.
    pub offset: f64,
}

/// A proof that half-spaces and a box have no point in common: multipliers `l_i >= 0` for a few of the
/// half-spaces such that `sum l_i (normal_i . x + offset_i) < 0` for all points `x` of the box.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Certificate {
    constraints: [u32; MOST],
    multipliers: [DoubleDouble; MOST],
    count: usize,
}

impl Certificate {
    pub(crate) fn new(multipliers: impl IntoIterator<Item = (u32, DoubleDouble)>) -> Self {
        let mut new = Self { constraints: [0; MOST], multipliers: [DoubleDouble::ZERO; MOST], count: 0 };
        for (constraint, multiplier) in multipliers.into_iter().filter(|(_, l)| l.hi > 0.0).take(MOST) {
            new.constraints[new.count] = constraint;
            new.multipliers[new.count] = multiplier;
            new.count += 1;
        }
        new
    }

    pub(crate) fn renumbered(mut self, number: impl Fn(u32) -> u32) -> Self {
        self.constraints[..self.count].iter_mut().for_each(|constraint| *constraint = number(*constraint));
        self
    }

    /// The half-spaces that contradict each other, by index, each with its multiplier: the exact sum of two
    /// numbers.
    pub fn multipliers(&self) -> impl Iterator<Item = (usize, [f64; 2])> + '_ {
        let pairs = self.constraints.iter().zip(&self.multipliers).take(self.count);
        pairs.map(|(&constraint, l)| (constraint as usize, [l.hi, l.lo]))
    }
}

/// Whether half-spaces have a point in common.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Feasible<const D: usize> {
    /// A point that certainly satisfies every half-space.
    Yes([f64; D]),
    /// No point does, certainly.
    No(Certificate),
    /// What they have in common, if anything, is too thin for rounding to tell; or a number is not finite.
    Maybe,
}

/// The point of half-spaces at which an objective is greatest.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Greatest<const D: usize> {
    /// The point, up to rounding: it may be outside of half-spaces by about 1e-12 of its size.
    At([f64; D]),
    /// There is certainly no point at all.
    Infeasible(Certificate),
    /// There is no point, or next to none; or a number is not finite.
    Unknown,
}

/// Solves linear programs in `D` variables, from 1 to 6. Allocates nothing once it has seen the largest
/// program.
///
/// ```
/// use visibility_portals::lp::{Feasible, Greatest, HalfSpace, Solver};
/// // Above the diagonal, and not above 3.
/// let mut sides = vec![
///     HalfSpace { normal: [-1.0, 1.0], offset: 0.0 },
///     HalfSpace { normal: [0.0, -1.0], offset: 3.0 },
/// ];
/// let mut solver = Solver::new();
/// assert_eq!(solver.greatest(&sides, [1.0, 0.0], 1e3), Greatest::At([3.0, 3.0]));
/// // And to the right of 4: the first two, added to this, leave nothing.
/// sides.push(HalfSpace { normal: [1.0, 0.0], offset: -4.0 });
/// let Feasible::No(certificate) = solver.feasible(&sides, 1e3) else { panic!() };
/// assert_eq!(certificate.multipliers().count(), 3);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Solver<const D: usize> {
    levels: Levels,
}

/// How far inside of all half-spaces a point is looked for, relative to the size of their coefficients, and
/// the random order in which they are taken; one try after another. A point well inside is easily proved;
/// where many half-spaces are nearly parallel, another order may lose fewer digits.
const TRIES: [(f64, u64); 5] = [(1e-9, 0), (0.0, 0), (1e-7, 1), (1e-10, 2), (0.0, 3)];

impl<const D: usize> Solver<D> {
    /// A solver that has seen no program.
    pub fn new() -> Self {
        Self::default()
    }

    /// Whether half-spaces have a point in common in the box of the points with no coordinate beyond `bound`
    /// in size.
    pub fn feasible(&mut self, constraints: &[HalfSpace<D>], bound: f64) -> Feasible<D> {
        if !is_finite(constraints, bound) {
            return Feasible::Maybe;
        }
        for (inside, seed) in TRIES {
            self.levels.seed = seed;
            let drawn_in = |i: usize| {
                let half = &constraints[i];
                let size = half.normal.iter().fold(half.offset.abs(), |size, a| size.max(a.abs()));
                (half.normal, half.offset - inside * size)
            };
            match self.levels.solve(constraints.len(), drawn_in, [0.0; D], [bound; D]) {
                Ok(x) if is_inside(constraints, bound, &x) => return Feasible::Yes(x),
                Err(Stop::Conflict) => {
                    if let Some(certificate) = self.certificate(constraints, bound) {
                        return Feasible::No(certificate);
                    }
                }
                _ => {}
            }
        }
        Feasible::Maybe
    }

    /// The point at which `objective . x` is greatest, of the half-spaces and of the box of the points with
    /// no coordinate beyond `bound` in size. If there are several, one of them.
    pub fn greatest(&mut self, constraints: &[HalfSpace<D>], objective: [f64; D], bound: f64) -> Greatest<D> {
        if !is_finite(constraints, bound) || objective.iter().any(|o| !o.is_finite()) {
            return Greatest::Unknown;
        }
        let constraint = |i: usize| (constraints[i].normal, constraints[i].offset);
        self.levels.seed = 0;
        match self.levels.solve(constraints.len(), constraint, objective, [bound; D]) {
            Ok(x) => Greatest::At(x),
            // A conflict may be half-spaces that touch; there may be others that contradict each other.
            Err(stop) => {
                let certificate =
                    (stop == Stop::Conflict).then(|| self.certificate(constraints, bound)).flatten();
                match certificate.map_or_else(|| self.feasible(constraints, bound), Feasible::No) {
                    Feasible::No(certificate) => Greatest::Infeasible(certificate),
                    _ => Greatest::Unknown,
                }
            }
        }
    }

    /// The proof that the half-spaces come upon last contradict each other, if they do.
    fn certificate(&self, constraints: &[HalfSpace<D>], bound: f64) -> Option<Certificate> {
        let mut rows = [Row { normal: [DoubleDouble::ZERO; D], error: 0.0, least: -bound }; MOST];
        let conflict = self.levels.conflict();
        for (row, &tag) in rows.iter_mut().zip(conflict) {
            if tag >= BOX {
                let side = tag - BOX;
                row.normal[side as usize / 2] =
                    DoubleDouble::from(if side.is_multiple_of(2) { -1.0 } else { 1.0 });
            } else {
                let half = &constraints[tag as usize];
                *row = Row { normal: half.normal.map(DoubleDouble::from), error: 0.0, least: -half.offset };
            }
        }
        let multipliers = find(&rows[..conflict.len()], &[bound; D])?;
        // What the sides of the box add, the box pays for in any case.
        let pairs = conflict.iter().copied().zip(multipliers);
        Some(Certificate::new(pairs.filter(|(tag, _)| *tag < BOX)))
    }
}

fn is_finite<const D: usize>(constraints: &[HalfSpace<D>], bound: f64) -> bool {
    let finite = |half: &HalfSpace<D>| half.offset.is_finite() && half.normal.iter().all(|a| a.is_finite());
    (0.0..f64::INFINITY).contains(&bound)
        && constraints.len() < BOX as usize
        && constraints.iter().all(finite)
}

/// Whether a point is certainly in the box and in all half-spaces.
fn is_inside<const D: usize>(constraints: &[HalfSpace<D>], bound: f64, x: &[f64; D]) -> bool {
    x.iter().all(|x| x.abs() <= bound)
        && constraints.iter().all(|half| {
            // In f64, the sum of up to seven numbers is wrong by less than 2^-49 of the sum of their sizes,
            // which itself is.
            let (mut sum, mut size) = (half.offset, half.offset.abs());
            for (a, x) in half.normal.iter().zip(x) {
                sum += a * x;
                size += (a * x).abs();
            }
            if sum >= size * (16.0 * f64::EPSILON) && sum > 1e-290 || size == 0.0 {
                return true;
            }
            // Touching points of round numbers are often exact in numbers of twice the length.
            let (mut sum, mut size) = (DoubleDouble::from(half.offset), half.offset.abs());
            for (&a, &x) in half.normal.iter().zip(x) {
                let term = DoubleDouble::product(a, x);
                sum = sum.plus(term);
                size += term.hi.abs();
            }
            sum.hi >= size * (16.0 * DoubleDouble::ERROR) + 1e-290
        })
}
