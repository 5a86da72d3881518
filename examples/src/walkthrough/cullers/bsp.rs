//! Object space: BSP trees, occlusion trees, shadow frusta, large occluders.

use super::Known;

pub(super) const KNOWN: &[Known] = &[];
