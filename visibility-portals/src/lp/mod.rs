//! Linear programs in few variables, with answers that are proofs.
//!
//! [`Solver`] finds a point in the intersection of half-spaces, or the point where an objective is greatest.
//! It uses the randomized incremental algorithm (Raimund Seidel, "Small-Dimensional Linear Programming and
//! Convex Hulls Made Easy", 1991), in time linear in the number of half-spaces. The algorithm computes in
//! `f64`, and its results are verified afterwards. A point is checked against all half-spaces. Infeasibility
//! is reported only with a [`Certificate`]: a few multipliers whose contradiction survives all rounding
//! (Farkas' lemma). A program that can be proved neither way is [`Feasible::Undecided`].

mod certificate;
mod seidel;

pub(crate) use certificate::{MAX_ROWS, Row, find};
pub(crate) use seidel::{BOX, SeidelSolver, Stop};

use visibility_core::geometry::DoubleDouble;

/// The half-space of the points `x` with `normal . x + offset >= 0`, in `D` dimensions.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct HalfSpace<const D: usize> {
    /// Normal that points into the half-space; of any length.
    pub normal: [f64; D],
    /// Constant term of `normal . x + offset`: positive if the origin lies inside the half-space, negative
    /// if outside.
    pub offset: f64,
}

/// A proof that half-spaces and a box have no point in common. It holds multipliers `l_i >= 0` for a few of
/// the half-spaces `normal_i . x + offset_i >= 0`, such that `sum l_i (normal_i . x + offset_i) < 0` for all
/// points `x` of the box.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Certificate {
    constraints: [u32; MAX_ROWS],
    multipliers: [DoubleDouble; MAX_ROWS],
    count: usize,
}

impl Certificate {
    pub(crate) fn new(multipliers: impl IntoIterator<Item = (u32, DoubleDouble)>) -> Self {
        let mut new =
            Self { constraints: [0; MAX_ROWS], multipliers: [DoubleDouble::ZERO; MAX_ROWS], count: 0 };
        for (constraint, multiplier) in multipliers.into_iter().filter(|(_, l)| l.hi > 0.0).take(MAX_ROWS) {
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

    /// Returns the indices of the contradicting half-spaces, each with its multiplier: two numbers whose
    /// exact sum is the multiplier, the larger first.
    pub fn multipliers(&self) -> impl Iterator<Item = (usize, [f64; 2])> + '_ {
        let pairs = self.constraints.iter().zip(&self.multipliers).take(self.count);
        pairs.map(|(&constraint, l)| (constraint as usize, [l.hi, l.lo]))
    }
}

/// Answer to whether half-spaces have a point in common.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Feasible<const D: usize> {
    /// A point that certainly lies in every half-space and in the box given to [`Solver::feasible`].
    Yes([f64; D]),
    /// Certainly no point of the box given to [`Solver::feasible`] lies in every half-space. Proved by the
    /// certificate.
    No(Certificate),
    /// Undecided: the intersection is empty or too thin for the rounding, or an input is not finite.
    Undecided,
}

/// Answer to a maximization: the point of an intersection of half-spaces at which an objective is greatest.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Greatest<const D: usize> {
    /// The maximizing point, up to rounding: the point may lie outside some half-spaces, by about 1e-12 of
    /// its greatest coordinate.
    At([f64; D]),
    /// Certainly no point lies in all half-spaces and in the box given to [`Solver::greatest`]. Proved by the
    /// certificate.
    Infeasible(Certificate),
    /// Undecided: the intersection is empty or too thin for the rounding, or an input is not finite.
    Undecided,
}

/// Solver of linear programs in `D` variables: finds a point common to half-spaces, or the common point at
/// which an objective is greatest. `D` must be 1 to 6; for any other `D` every answer is `Undecided`. Holds
/// scratch memory, and allocates only for a program with more half-spaces than any before.
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
    seidel: SeidelSolver,
}

/// Attempts of [`Solver::feasible`], in order. Element 0: the distance by which each half-space is shrunk, as
/// a fraction of its greatest coefficient. Element 1: the seed of the random order. A point well inside is
/// easily proved. Where many half-spaces are nearly parallel, another order may lose fewer digits.
const TRIES: [(f64, u64); 5] = [(1e-9, 0), (0.0, 0), (1e-7, 1), (1e-10, 2), (0.0, 3)];

impl<const D: usize> Solver<D> {
    /// Returns a solver without allocated memory.
    pub fn new() -> Self {
        Self::default()
    }

    /// Tests whether half-spaces have a common point in the box of the points whose coordinates are at most
    /// `bound` in absolute value. [`Feasible::Undecided`] if undecided, or if an input is not finite or
    /// `bound` is negative.
    pub fn feasible(&mut self, constraints: &[HalfSpace<D>], bound: f64) -> Feasible<D> {
        if !is_finite(constraints, bound) {
            return Feasible::Undecided;
        }
        for (inside, seed) in TRIES {
            self.seidel.seed = seed;
            let drawn_in = |i: usize| {
                let half = &constraints[i];
                let size = half.normal.iter().fold(half.offset.abs(), |size, a| size.max(a.abs()));
                (half.normal, half.offset - inside * size)
            };
            match self.seidel.solve(constraints.len(), drawn_in, [0.0; D], [bound; D]) {
                Ok(x) if is_inside(constraints, bound, &x) => return Feasible::Yes(x),
                Err(Stop::Conflict) => {
                    if let Some(certificate) = self.certificate(constraints, bound) {
                        return Feasible::No(certificate);
                    }
                }
                _ => {}
            }
        }
        Feasible::Undecided
    }

    /// Returns the point at which `objective . x` is greatest among the points in all half-spaces and in the
    /// box of coordinates of at most `bound` in absolute value. If several points are equally good, one of
    /// them. Linear in the number of half-spaces.
    pub fn greatest(&mut self, constraints: &[HalfSpace<D>], objective: [f64; D], bound: f64) -> Greatest<D> {
        if !is_finite(constraints, bound) || objective.iter().any(|o| !o.is_finite()) {
            return Greatest::Undecided;
        }
        let constraint = |i: usize| (constraints[i].normal, constraints[i].offset);
        self.seidel.seed = 0;
        match self.seidel.solve(constraints.len(), constraint, objective, [bound; D]) {
            Ok(x) => Greatest::At(x),
            // A conflict may be half-spaces that only touch, while other half-spaces contradict each other.
            Err(stop) => {
                let certificate =
                    (stop == Stop::Conflict).then(|| self.certificate(constraints, bound)).flatten();
                match certificate.map_or_else(|| self.feasible(constraints, bound), Feasible::No) {
                    Feasible::No(certificate) => Greatest::Infeasible(certificate),
                    _ => Greatest::Undecided,
                }
            }
        }
    }

    /// Returns a certificate that the half-spaces which the last run of `seidel` found to contradict each
    /// other (its conflict) have no common point in the box of coordinates of at most `bound` in absolute
    /// value. `None` if no proof is found.
    fn certificate(&self, constraints: &[HalfSpace<D>], bound: f64) -> Option<Certificate> {
        let mut rows = [Row { normal: [DoubleDouble::ZERO; D], error: 0.0, least: -bound }; MAX_ROWS];
        let conflict = self.seidel.conflict();
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
        // The multipliers of box sides are left out: the definition of a certificate includes the box.
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

/// Tests whether the point `x` is certainly in all half-spaces and in the box of coordinates of at most
/// `bound` in absolute value. `false` if undecided.
fn is_inside<const D: usize>(constraints: &[HalfSpace<D>], bound: f64, x: &[f64; D]) -> bool {
    x.iter().all(|x| x.abs() <= bound)
        && constraints.iter().all(|half| {
            // In f64, the sum of up to seven numbers is off by less than 2^-49 of the sum of their absolute
            // values; the computed size has a relative error of the same order.
            let (mut sum, mut size) = (half.offset, half.offset.abs());
            for (a, x) in half.normal.iter().zip(x) {
                sum += a * x;
                size += (a * x).abs();
            }
            if sum >= size * (16.0 * f64::EPSILON) && sum > 1e-290 || size == 0.0 {
                return true;
            }
            // Points of round numbers that lie exactly on a boundary are often exact in double-double
            // numbers.
            let (mut sum, mut size) = (DoubleDouble::from(half.offset), half.offset.abs());
            for (&a, &x) in half.normal.iter().zip(x) {
                let term = DoubleDouble::product(a, x);
                sum = sum.plus(term);
                size += term.hi.abs();
            }
            sum.hi >= size * (16.0 * DoubleDouble::ERROR) + 1e-290
        })
}
