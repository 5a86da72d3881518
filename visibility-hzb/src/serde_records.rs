//! Serialisation by `serde`, with the checks of the settings' own methods: `visibility-core` has the macros.

use crate::Coverage;

visibility_core::__serde_variants!(Coverage as "Coverage" { Conservative, Sampled });
