//! Backface culling of one-sided objects and clusters: those of which the eye can see only back faces are
//! hidden.
//!
//! - [`facing`] decides for one triangle, with a bound on rounding.
//! - A [`NormalCone`] decides for a cluster of triangles at once, from an eye or along a direction. It is
//!   conservative: a cluster is back-facing only if all its triangles certainly face away.
//! - [`cluster_mesh`] divides a mesh into clusters of triangles with similar normals.
//! - [`Cones`] tests many cones 64 at a time, and [`BackfaceCuller`] is a
//!   [`Culler`](visibility_core::Culler).
//!
//! # Sources
//! - Shirman and Abi-Ezzi, "The Cone of Normals Technique for Fast Processing of Curved Patches", 1993: a
//!   cone with an apex behind all planes decides for eyes at any distance.
//! - Kumar, Manocha, Garrett and Lin, "Hierarchical Back-Face Computation", 1996: clusters of similar
//!   normals.
//! - Johannsen and Carter, "Clustered backface culling", 1998: clusters of meshes.
//!
//! Cones here are elliptic rather than circular: the normals of pipes, rounded edges and frames lie along
//! arcs, and a circle around an arc is mostly empty. A test costs three dot products instead of one, and no
//! square root.
//!
//! # The answer and its limits
//! An eye sees only back faces if it is behind the planes of all triangles. The cone lies within that set of
//! eyes, so the answer [`Facing::Back`] is certain. Eyes outside the cone are undecided and count as visible.
//! Two-sided geometry (leaves, glass, cut-away walls) must have no cone. Mirroring transforms turn triangles
//! inside out: see [`NormalCone::transformed`].
//!
//! All computation is in a fixed order, so that answers are the same on all processors.

mod cluster;
mod cone_array;
mod cones64;
mod culler;
mod facing;
mod fit;
mod normal_cone;
mod split_eye;

pub use cluster::{Cluster, ClusterError, MAX_CLUSTER, MIN_CLUSTER, cluster_mesh};
pub use cone_array::Cones;
pub(crate) use cones64::{Cones64, inside_cones};
pub use culler::BackfaceCuller;
pub use facing::{Facing, facing};
pub use normal_cone::NormalCone;
pub(crate) use split_eye::SplitEye;
