//! Serialisation by `serde`, with the checks of the settings' own methods: `visibility-core` has the macros.

use crate::{Budget, Fineness, Solidity};

visibility_core::__serde_variants!(Budget as "Budget" { Objects(usize), Cost(u64) });
visibility_core::__serde_variants!(Solidity as "Solidity" { Coverage, Count });
visibility_core::__serde_record!(settings Fineness as "Fineness" |f| {
    vertices: usize = f.vertices,
    halvings: u32 = f.halvings,
} => Fineness { vertices, halvings });
