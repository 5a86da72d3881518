//! Clusters of instances: which parts of the visible objects a view can see, for engines that draw meshes as
//! meshlets of some 64 triangles.
//!
//! A [`ClusterMesh`] holds the boxes and normal cones of the clusters of one mesh, in mesh coordinates and in
//! a hierarchy of fan-out 64. All instances of the mesh share it. For each instance, a [`ClusterView`]
//! transforms the view, not the clusters: planes and eye are taken into mesh coordinates once, with bounds on
//! all rounding. One walk then tests blocks of 64 clusters against planes, cones and, optionally, an
//! [`OcclusionMap`](visibility_core::OcclusionMap).
//!
//! Nothing visible is dropped under any affine transform: rotated, scaled unevenly, sheared or mirrored, and
//! however far from the origin. Where rounding cannot decide, the cluster is listed. All clusters of an
//! instance are listed if its transform is flat or not finite.
//!
//! # Source
//! Haar and Aaltonen, "GPU-Driven Rendering Pipelines", 2015: clusters of 64 triangles, culled by frustum,
//! normal cone and depth pyramid. Kapoulkine's meshoptimizer makes such clusters.

mod culler;
mod local_view;
mod mesh;
#[cfg(test)]
mod tests;

pub use culler::{ClusterInstance, ClusterView, VisibleCluster};
pub use mesh::ClusterMesh;
