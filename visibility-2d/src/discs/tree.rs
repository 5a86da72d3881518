//! Hierarchy of discs on the plan: halved at the median of the longer axis, with leaves of 16 discs and nodes
//! of 8 children.

use super::{MAX_NUMBER, ROUNDING};
use crate::median_order::{LEAF, put_in_order};
use alloc::vec::Vec;
use core::fmt;
use smallvec::SmallVec;

/// Greatest number of children of an inner node of the tree of discs.
pub(crate) const FAN: usize = 8;

/// Maximum number of discs that may overlap a given disc, and of nodes searched for them. Beyond either, the
/// disc hides nothing.
const MAX_OVERLAPPING: usize = 8192;
const MAX_NODES: usize = 8192;

/// Disc on the plan: a trunk, a pillar, a silo.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Disc {
    /// Position of the centre in metres.
    pub center: [f64; 2],
    /// Radius in metres, 0 or greater. A disc of radius 0 is a point, which hides nothing.
    pub radius: f64,
}

impl Disc {
    /// Returns whether the coordinates and the radius are numbers that [`Discs::new`] takes.
    pub(crate) fn is_valid(&self) -> bool {
        self.center.iter().all(|x| x.abs() <= MAX_NUMBER) && (0.0..=MAX_NUMBER).contains(&self.radius)
    }
}

/// Reason why discs are invalid.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum DiscError {
    /// A coordinate or the radius is NaN or infinite or beyond 1e150, or the radius is negative.
    Disc {
        /// Index of the first invalid disc.
        index: usize,
    },
    /// There are more than 2^27 discs.
    TooMany,
}

impl fmt::Display for DiscError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Disc { index } => {
                write!(f, "disc {index} is not finite, too far away, or of negative radius")
            }
            Self::TooMany => write!(f, "there are more than 2^27 discs"),
        }
    }
}

impl core::error::Error for DiscError {}

/// Bounds of the centres of a node's discs, and their largest radius, in `f32`, rounded outwards.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub(crate) min: [f32; 2],
    pub(crate) max: [f32; 2],
    pub(crate) radius: f32,
}

impl Node {
    const EMPTY: Self = Self { min: [f32::INFINITY; 2], max: [f32::NEG_INFINITY; 2], radius: 0.0 };

    fn union(self, other: &Self) -> Self {
        Self {
            min: [self.min[0].min(other.min[0]), self.min[1].min(other.min[1])],
            max: [self.max[0].max(other.max[0]), self.max[1].max(other.max[1])],
            radius: self.radius.max(other.radius),
        }
    }

    fn of(discs: &[Disc]) -> Self {
        discs.iter().fold(Self::EMPTY, |node, disc| {
            let [x, y] = disc.center;
            node.union(&Self { min: [down(x), down(y)], max: [up(x), up(y)], radius: up(disc.radius) })
        })
    }

    /// Returns the bounds of the node's discs relative to a point, rounded outwards: least x and y, greatest
    /// x and y, clamped to -1e300 to 1e300.
    pub(crate) fn around(&self, [x, y]: [f64; 2]) -> [f64; 4] {
        let radius = f64::from(self.radius);
        // Three roundings err by at most `u (|away| + radius)` each, where `u` is half of `EPSILON`. So
        // bounds are moved outwards by four times this error. They may be infinite, since discs lie within
        // 4e150.
        let by = |away: f64| (radius + 2.0 * f64::EPSILON * (away.abs() + radius)).min(f64::MAX);
        let low = |bound: f32, at: f64| {
            let away = f64::from(bound) - at;
            (away - by(away)).max(-1e300)
        };
        let high = |bound: f32, at: f64| {
            let away = f64::from(bound) - at;
            (away + by(away)).min(1e300)
        };
        [low(self.min[0], x), low(self.min[1], y), high(self.max[0], x), high(self.max[1], y)]
    }

    /// Returns the distances along x and y from a point to the bounds of the centres. 0 inside.
    fn away(&self, point: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| {
            (f64::from(self.min[axis]) - point[axis]).max(point[axis] - f64::from(self.max[axis])).max(0.0)
        })
    }

    /// Returns whether a disc of the node may overlap or touch `disc`.
    fn may_overlap(&self, disc: &Disc) -> bool {
        let ([dx, dy], reach) = (self.away(disc.center), f64::from(self.radius) + disc.radius);
        dx * dx + dy * dy <= reach * reach * (1.0 + 10.0 * ROUNDING)
    }

    /// Returns a lower bound on the power (squared distance minus squared radius) of a point with respect to
    /// any of the node's discs.
    pub(crate) fn least_power(&self, point: [f64; 2]) -> f64 {
        let [dx, dy] = self.away(point);
        dx * dx + dy * dy - f64::from(self.radius) * f64::from(self.radius)
    }
}

fn down(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) > x { near.next_down() } else { near }
}

fn up(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) < x { near.next_up() } else { near }
}

/// Set of discs on the plan, prepared for visibility queries. Immutable, and shared by all eyes.
///
/// Uses about 40 bytes per disc. Preparation takes `n log n` time, wherever the discs are.
///
/// ```
/// use visibility_2d::discs::{Disc, Discs};
/// let discs = Discs::new(&[Disc { center: [3.0, 4.0], radius: 0.3 }])?;
/// assert_eq!(discs.len(), 1);
/// # Ok::<(), visibility_2d::discs::DiscError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Discs {
    /// All discs, in the order of a space-filling curve.
    pub(crate) discs: Vec<Disc>,
    /// For each of `discs`, its index in the list that the caller gave.
    pub(crate) indices: Vec<u32>,
    /// Radius in metres of the part of each disc, around its centre, that no other disc overlaps. Only this
    /// part occludes.
    pub(crate) solid_radii: Vec<f64>,
    /// True if no two discs touch and none has radius 0.
    pub(crate) are_disjoint: bool,
    /// Nodes of each level, leaves first. Empty without discs.
    pub(crate) levels: Vec<Vec<Node>>,
}

impl Discs {
    /// Prepares discs, which may overlap. Only the part of a disc that no other disc overlaps occludes. A
    /// disc that thousands of others overlap does not occlude at all.
    ///
    /// # Errors
    /// [`DiscError::Disc`] if a coordinate or a radius is NaN, infinite or beyond 1e150, or a radius is
    /// negative. [`DiscError::TooMany`] for more than 2^27 discs.
    pub fn new(discs: &[Disc]) -> Result<Self, DiscError> {
        if discs.len() > 1 << 27 {
            return Err(DiscError::TooMany);
        }
        if let Some(index) = discs.iter().position(|disc| !disc.is_valid()) {
            return Err(DiscError::Disc { index });
        }
        let mut order: Vec<([f64; 2], u32)> = (0..).zip(discs).map(|(i, disc)| (disc.center, i)).collect();
        // Along a space-filling curve, so that neighbours on the plan share leaves and nodes.
        put_in_order(&mut order);
        let indices: Vec<u32> = order.iter().map(|&(_, index)| index).collect();
        let discs: Vec<Disc> = indices.iter().map(|&index| discs[index as usize]).collect();
        let mut levels: Vec<Vec<Node>> = Vec::new();
        if !discs.is_empty() {
            levels.push(discs.chunks(LEAF).map(Node::of).collect());
            while let Some(below) = levels.last().filter(|level| level.len() > 1) {
                let join = |nodes: &[Node]| nodes.iter().fold(Node::EMPTY, |all, node| all.union(node));
                let above = below.chunks(FAN).map(join).collect();
                levels.push(above);
            }
        }
        let mut made = Self { discs, indices, solid_radii: Vec::new(), are_disjoint: false, levels };
        // Only the part of a disc that no other disc overlaps occludes.
        made.solid_radii = (0..made.len()).map(|index| made.solid_radius(index)).collect();
        made.are_disjoint = made
            .discs
            .iter()
            .zip(&made.solid_radii)
            .all(|(disc, &solid)| solid > 0.0 && solid == disc.radius);
        Ok(made)
    }

    /// Returns the number of discs.
    pub fn len(&self) -> usize {
        self.discs.len()
    }

    /// Returns whether there are no discs.
    pub fn is_empty(&self) -> bool {
        self.discs.is_empty()
    }

    /// Returns the radius in metres of the part of a disc, around its centre, that no other disc overlaps. 0
    /// if too many discs would have to be tested.
    fn solid_radius(&self, index: usize) -> f64 {
        let disc = &self.discs[index];
        let mut solid = disc.radius;
        let mut stack: SmallVec<[(usize, usize); 64]> = SmallVec::new();
        stack.push((self.levels.len() - 1, 0));
        let (mut nodes, mut overlapping) = (0, 0);
        while let Some((level, node)) = stack.pop() {
            nodes += 1;
            if solid == 0.0 || nodes > MAX_NODES || overlapping > MAX_OVERLAPPING {
                return 0.0;
            }
            if level > 0 {
                let below = (node * FAN..).zip(self.levels[level - 1].iter().skip(node * FAN).take(FAN));
                stack.extend(below.filter(|(_, n)| n.may_overlap(disc)).map(|(child, _)| (level - 1, child)));
                continue;
            }
            for (at, other) in (node * LEAF..).zip(self.discs.iter().skip(node * LEAF).take(LEAF)) {
                let (dx, dy) = (disc.center[0] - other.center[0], disc.center[1] - other.center[1]);
                // Discs that touch up to rounding count as overlapping.
                if at != index {
                    let distance = visibility_core::geometry::sqrt(dx * dx + dy * dy) * (1.0 - ROUNDING);
                    let left = distance - other.radius;
                    overlapping += usize::from(left < disc.radius);
                    solid = solid.min(left.max(0.0));
                }
            }
        }
        solid
    }
}
