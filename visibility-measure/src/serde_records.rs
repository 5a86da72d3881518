//! Serialisation by `serde`, with the checks of the settings' own methods: `visibility-core` has the macros.

use crate::DrawCost;

visibility_core::__serde_record!(settings DrawCost as "DrawCost" |c| {
    object_us: f64 = c.object_us,
    triangle_us: f64 = c.triangle_us,
} => DrawCost { object_us, triangle_us },
    if c.object_us.is_finite() && c.triangle_us.is_finite(), else "a drawing cost is not finite");
