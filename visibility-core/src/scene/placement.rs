//! Where objects with a local box or an occluder mesh are: one transform for each, from which the object's
//! bounds and the place of its mesh both follow.

use super::MeshId;
use crate::Aabb;
use alloc::vec::Vec;
use glam::Affine3A;

/// The transform of an object, and what it places.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    /// Index of the object.
    index: u32,
    /// Box of the object in its local coordinates. `None` if the object's bounds are given in scene
    /// coordinates.
    pub(super) local: Option<Aabb>,
    pub(super) mesh: Option<PlacedMesh>,
    /// Maps local coordinates, those of `local` and of a mesh that was given, to scene coordinates.
    pub(super) transform: Affine3A,
}

/// The occluder mesh of an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlacedMesh {
    pub(super) id: MeshId,
    /// Whether the mesh was made from the object's triangles, and is dropped with them.
    pub(super) is_prepared: bool,
    /// Whether the mesh is in scene coordinates, so that the object's transform does not place it.
    pub(super) in_scene: bool,
    /// Whether the mesh lies within the object's bounds. It hides nothing otherwise.
    pub(super) is_inside: bool,
}

/// The placements of a scene, with constant-time look-up by object index.
#[derive(Clone, Debug, Default)]
pub(super) struct Placements {
    /// Indexed by object index: the object's position in `dense`, `NONE` if the object has no placement.
    /// Shorter than the index range, and empty until an object first gets a placement.
    rows: Vec<u32>,
    dense: Vec<Placement>,
}

const NONE: u32 = u32::MAX;

impl Placements {
    pub(super) fn is_empty(&self) -> bool {
        self.dense.is_empty()
    }

    pub(super) fn get(&self, index: u32) -> Option<&Placement> {
        self.dense.get(*self.rows.get(index as usize)? as usize)
    }

    pub(super) fn get_mut(&mut self, index: u32) -> Option<&mut Placement> {
        self.dense.get_mut(*self.rows.get(index as usize)? as usize)
    }

    /// Returns the placement of an object; a new one, without box and mesh and with the identity as its
    /// transform, if the object has none.
    pub(super) fn get_or_insert(&mut self, index: u32) -> &mut Placement {
        let i = index as usize;
        if self.rows.len() <= i {
            self.rows.resize(i + 1, NONE);
        }
        if self.rows[i] == NONE {
            self.rows[i] = self.dense.len() as u32;
            self.dense.push(Placement { index, local: None, mesh: None, transform: Affine3A::IDENTITY });
        }
        &mut self.dense[self.rows[i] as usize]
    }

    /// Removes the placement of an object and returns it. `None` if the object has none.
    pub(super) fn remove(&mut self, index: u32) -> Option<Placement> {
        let row = core::mem::replace(self.rows.get_mut(index as usize)?, NONE) as usize;
        if row >= self.dense.len() {
            return None;
        }
        let removed = self.dense.swap_remove(row);
        if let Some(moved) = self.dense.get(row) {
            self.rows[moved.index as usize] = row as u32;
        }
        Some(removed)
    }

    /// Returns the number of bytes in use, without reserved capacity.
    pub(super) fn memory(&self) -> usize {
        size_of_val(&self.rows[..]) + size_of_val(&self.dense[..])
    }
}
