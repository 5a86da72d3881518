//! The binary space partition of a set of polygons.
//!
//! Every node divides its region of space by a plane and holds the parts of polygons that lie in that plane;
//! what is in front of it goes to one child, what is behind to the other, and what crosses is cut. Seen from
//! any point, the near side comes before the node's own polygons and these before the far side: an exact
//! order of depth, cycles or not, at the cost of walking the tree (Fuchs, Kedem and Naylor, "On Visible
//! Surface Generation by A Priori Tree Structures", 1980).

mod bsp_tree;
mod build;
mod builder;
mod fragments;
mod locate;
mod node;
mod order;
mod splitter;
mod store;
mod subtree;
mod update;

pub use bsp_tree::{BspError, BspTree, Leaf};
pub use fragments::{Fragment, Fragments};
pub use order::{Order, Walk};
pub use subtree::Subtree;
