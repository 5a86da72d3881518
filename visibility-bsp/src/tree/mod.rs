//! The binary space partition of a set of polygons.
//!
//! Every node divides its convex region of space by a plane and holds the polygon parts (fragments) that lie
//! in that plane. Polygons in front of the plane go to one child and polygons behind to the other; polygons
//! that cross the plane are cut. Seen from any point, the near child comes before the node's own fragments,
//! and these come before the far child. Walking the tree therefore gives an exact depth order, even for
//! polygons that overlap cyclically (Fuchs, Kedem and Naylor, "On Visible Surface Generation by A Priori Tree
//! Structures", 1980).

mod bsp_tree;
mod build;
mod build_scratch;
mod fragments;
mod node;
mod splitter;
mod store;
mod subtree;
#[cfg(test)]
mod tests;
mod traversal;
mod update;

pub use bsp_tree::{BspError, BspTree};
pub use fragments::{Fragment, Fragments};
pub use subtree::Subtree;
pub use traversal::{TraversalStack, TreeVisitor};
