//! Settings and errors of the cell baker and the object baker, and the preparation of the portals for both.

use crate::directed_portals::{DirectedPortals, Margins};
use core::fmt;
use visibility_core::cells::CellGraph;

/// Version of the baking methods, a part of the fingerprints of saved bakes. It is increased with each change
/// of the methods, so that a bake that earlier methods began is not resumed.
pub(crate) const METHODS: u32 = 1;

/// Settings of [`CellBaker`](crate::CellBaker) and [`ObjectBaker`](crate::ObjectBaker): the clearance of
/// lines, the limit of steps, and the tests used.
#[derive(Clone, Copy, PartialEq, Debug)]
#[must_use]
pub struct BakerSettings {
    pub(crate) clearance: Option<f64>,
    pub(crate) steps_per_cell: u64,
    pub(crate) depth: u32,
    pub(crate) chain_test: ChainTest,
}

/// The tests of portal chains that would make a cell visible.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub enum ChainTest {
    /// Tests by separating planes alone: fast, and the looser of the two.
    #[default]
    Separators,
    /// Chains that separating planes do not exclude are also tested in Pluecker space (six coordinates per
    /// line). Marks the same cells visible as [`Separators`](Self::Separators) or fewer, and takes more time.
    ///
    /// Each rejection is certain: a certificate shows that no line passes the edges of the chain and keeps
    /// the clearance from them. A chain that is kept need not be passable, for two reasons. The half-spaces
    /// of the linear program may have a common point that is no line, since lines form a quadric in Pluecker
    /// space. And the common part of the half-spaces may be too small for `f64` to prove empty.
    Pluecker,
}

impl Default for BakerSettings {
    fn default() -> Self {
        Self { clearance: None, steps_per_cell: u64::MAX, depth: u32::MAX, chain_test: ChainTest::Separators }
    }
}

impl BakerSettings {
    /// Sets the clearance, a distance in world units. Lines of sight that pass a portal edge at a smaller
    /// distance are ignored: a cell that is seen only along such lines may be found hidden. Must be positive,
    /// finite and at least 2^-33 of the greatest absolute coordinate of a portal vertex, so that rounding
    /// cannot decide. `None`, the default, stands for the greater of that least value and 1e-6.
    ///
    /// Portals count as flat. Where vertices are off the plane of their portal, which they may be by up to
    /// [`TOLERANCE`](visibility_core::geometry::ConvexPolygon::TOLERANCE) of its size, lines must keep that
    /// distance more from its edges.
    pub fn with_clearance(self, clearance: impl Into<Option<f64>>) -> Self {
        Self { clearance: clearance.into(), ..self }
    }

    /// Sets the maximum number of portal chains inspected for one viewcell, summed over its portals. Where a
    /// viewcell needs more, all its targets not yet proven hidden count as visible. Unlimited by default.
    pub fn with_steps_per_cell(self, steps_per_cell: u64) -> Self {
        Self { steps_per_cell, ..self }
    }

    /// Sets the maximum number of portals by which a chain is extended beyond its first portal. Everything
    /// that lines through the last portal of such a chain might still reach counts as visible. Smaller depths
    /// take less time. At any depth, no target is hidden that a line of sight reaches. On all maps tried, a
    /// smaller depth shows all targets that a greater one shows. 0 tests no chains: two portals count as
    /// passed by one line wherever their planes allow it. Unlimited by default.
    ///
    /// [`ObjectBaker`](crate::ObjectBaker) ignores the depth.
    pub fn with_depth(self, depth: u32) -> Self {
        Self { depth, ..self }
    }

    /// Sets the tests of portal chains. [`ChainTest::Separators`] by default.
    pub fn with_chain_test(self, chain_test: ChainTest) -> Self {
        Self { chain_test, ..self }
    }

    /// Returns the settings as numbers for the bake's fingerprint: `steps_per_cell`, 1 for the test in
    /// Pluecker space or else 0, and `depth`.
    pub(crate) fn numbers(&self) -> [u64; 3] {
        [self.steps_per_cell, (self.chain_test == ChainTest::Pluecker).into(), self.depth.into()]
    }
}

/// Why [`CellBaker`](crate::CellBaker) or [`ObjectBaker`](crate::ObjectBaker) cannot be made: unsuitable
/// settings, graph or matrix.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum BakeError {
    /// The requested clearance is zero, negative, infinite, NaN or less than `least`.
    Clearance {
        /// Clearance that was requested, in world units.
        clearance: f64,
        /// Smallest clearance that the coordinates allow, in world units: 2^-33 of the greatest absolute
        /// coordinate.
        least: f64,
    },
    /// The graph has more than 65,536 cells or more than 65,536 portals. With more portals, the baker's bit
    /// matrix of ordered pairs of directed portals that a line may pass one after the other would take more
    /// than 2 GiB.
    TooMany {
        /// Number of cells of the graph.
        cells: usize,
        /// Number of portals of the graph.
        portals: usize,
    },
    /// The bake of cells given to [`ObjectBaker`](crate::ObjectBaker) is of another graph, or of another
    /// clearance.
    Cells,
}

impl fmt::Display for BakeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Clearance { clearance, least } => {
                write!(
                    f,
                    "a clearance of {clearance} is less than {least}, the least for coordinates of this size"
                )
            }
            Self::TooMany { cells, portals } => {
                write!(
                    f,
                    "{cells} cells and {portals} portals are more than {MAX_CELLS_OR_PORTALS} of either"
                )
            }
            Self::Cells => write!(f, "the cells were baked of another graph or with another clearance"),
        }
    }
}

impl core::error::Error for BakeError {}

/// Default clearance in world units, if coordinates allow it: a micrometre if the unit is the metre.
const DEFAULT_CLEARANCE: f64 = 1e-6;

/// Maximum number of cells, and of portals, of a bake. With 2^16 portals the matrix of ordered pairs of
/// directed portals takes 2^17 * 2^17 bits = 2 GiB.
const MAX_CELLS_OR_PORTALS: usize = 1 << 16;

/// Checks `settings` against `graph` and returns the portals in both directions, shrunk by part of the
/// clearance (see [`Margins::inset`](crate::directed_portals::Margins::inset)).
///
/// # Errors
/// [`BakeError::TooMany`] if cells or portals exceed [`MAX_CELLS_OR_PORTALS`], [`BakeError::Clearance`] if
/// the clearance is not finite or less than 65,536 times the rounding bound of the coordinates.
pub(crate) fn prepare(graph: &CellGraph, settings: &BakerSettings) -> Result<DirectedPortals, BakeError> {
    let (cells, count) = (graph.cell_count(), graph.portals().len());
    if cells > MAX_CELLS_OR_PORTALS || count > MAX_CELLS_OR_PORTALS {
        return Err(BakeError::TooMany { cells, portals: count });
    }
    let extent = DirectedPortals::extent(graph);
    let least = Margins::noise_of(extent) * 65_536.0;
    let clearance = settings.clearance.unwrap_or(least.max(DEFAULT_CLEARANCE));
    if !(clearance > 0.0 && clearance >= least && clearance.is_finite()) {
        return Err(BakeError::Clearance { clearance, least });
    }
    Ok(DirectedPortals::new(graph, clearance, extent))
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;
    use visibility_core::cells::CellId;
    use visibility_core::geometry::ConvexPolygon;
    use visibility_core::glam::DVec3;

    fn triangle(size: f64) -> ConvexPolygon {
        ConvexPolygon::new([DVec3::ZERO, DVec3::X, DVec3::Y].map(|v| v * size)).unwrap()
    }

    #[test]
    fn clearances_below_the_rounding_are_refused() {
        let graph = CellGraph::new(2, [(triangle(1024.0), [CellId(0), CellId(1)])]).unwrap();
        let least = 1024.0 / (1u64 << 33) as f64;
        let made = |clearance: Option<f64>| {
            let settings = BakerSettings::default().with_clearance(clearance);
            prepare(&graph, &settings).map(|portals| portals.margins.clearance)
        };
        assert_eq!(made(Some(least)), Ok(least), "the least clearance");
        assert_eq!(made(None), Ok(DEFAULT_CLEARANCE), "no clearance, where the default is enough");
        for clearance in [least.next_down(), 0.0, -1.0, f64::INFINITY] {
            assert_eq!(made(Some(clearance)), Err(BakeError::Clearance { clearance, least }), "{clearance}");
        }
        assert!(matches!(made(Some(f64::NAN)), Err(BakeError::Clearance { .. })), "a clearance of NaN");
        let far = CellGraph::new(2, [(triangle(1e6), [CellId(0), CellId(1)])]).unwrap();
        let portals = prepare(&far, &BakerSettings::default()).unwrap();
        assert_eq!(portals.margins.clearance, 1e6 / (1u64 << 33) as f64, "the default far from the origin");
        // Without portals any positive clearance will do, but none of zero.
        let empty = CellGraph::new(1, []).unwrap();
        let made =
            |clearance: f64| prepare(&empty, &BakerSettings::default().with_clearance(clearance)).is_ok();
        assert!(made(1e-300) && !made(0.0), "clearances of a graph without portals");
    }

    #[test]
    fn graphs_of_more_than_65536_cells_or_portals_are_refused() {
        let settings = BakerSettings::default();
        let made = |graph: &CellGraph| prepare(graph, &settings).map(|portals| portals.all.len());
        let limit = MAX_CELLS_OR_PORTALS;
        assert_eq!(made(&CellGraph::new(limit, []).unwrap()), Ok(0), "as many cells as there may be");
        let cells = limit + 1;
        let error = Err(BakeError::TooMany { cells, portals: 0 });
        assert_eq!(made(&CellGraph::new(cells, []).unwrap()), error, "one more cell");
        let portals: Vec<_> = (0..=limit).map(|_| (triangle(1.0), [CellId(0), CellId(1)])).collect();
        let error = Err(BakeError::TooMany { cells: 2, portals: limit + 1 });
        assert_eq!(made(&CellGraph::new(2, portals).unwrap()), error, "one more portal");
    }
}
