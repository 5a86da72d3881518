//! Backface culling: what turns its back on the eye is hidden, if it is drawn from one side only.
//!
//! - [`facing`] decides for one triangle, with a bound on rounding.
//! - A [`NormalCone`] decides for a cluster of triangles at once, from an eye, along a direction, or from
//!   every eye of a viewcell. It is conservative: where not all triangles surely face away, it leaves them.
//! - [`cluster_mesh`] cuts a mesh into clusters whose triangles face alike.
//! - [`Cones`] tests many cones 64 at a time, [`ConeTree`] puts cones over cones, [`BackfaceCuller`] is a
//!   [`Culler`](crate::Culler).
//!
//! # Sources
//! - Shirman and Abi-Ezzi, "The Cone of Normals Technique for Fast Processing of Curved Patches", 1993: a
//!   cone with an apex behind all planes decides for eyes at any distance.
//! - Kumar, Manocha, Garrett and Lin, "Hierarchical Back-Face Computation", 1996: a hierarchy of clusters of
//!   like normals.
//! - Johannsen and Carter, "Clustered backface culling", 1998: clusters of meshes.
//!
//! Cones here are elliptic rather than circular: the normals of pipes, rounded edges and frames lie along
//! arcs, and a circle around an arc is mostly empty. A test costs three products of a row and a vector
//! instead of one, and no square root.
//!
//! # The answer and its limits
//! An eye sees only backs if it is behind the planes of all triangles. The cone lies within that set of eyes,
//! so the answer *back* is certain; eyes outside the cone are undecided. What is drawn from both sides
//! (leaves, glass, cut-away walls) must have no cone. Transforms that mirror turn triangles inside out: see
//! [`NormalCone::transformed`].
//!
//! All computation is in a fixed order, so that answers are the same on all processors.

mod cluster;
mod cone;
mod cones;
mod cones64;
mod culler;
mod facing;
mod fit;
mod split_eye;

pub use cluster::{Cluster, MAX_CLUSTER, MIN_CLUSTER, MeshError, cluster_mesh};
pub use cone::NormalCone;
pub use cones::{ConeTree, Cones};
pub(crate) use cones64::Cones64;
pub use culler::BackfaceCuller;
pub use facing::{Facing, facing};
pub(crate) use split_eye::{SplitEye, inside};
