//! Comparison of prioritized-layered projection with the exact answer, as in its paper: triangles as
//! primitives, frustum and backface culling on, budgets in fractions of all triangles, and sorting by
//! distance as the baseline (Klosowski and Silva, "The Prioritized-Layered Projection Algorithm for Visible
//! Set Estimation", 2000, section 5).

pub mod conservative;
mod coverage;
mod picture;
mod plot;
mod triangles;

pub use coverage::{BUDGETS, Coverage, Found, Method, coverage};
pub use picture::right_and_wrong;
pub use plot::plot;
pub use triangles::{Seen, TriangleWorld};
