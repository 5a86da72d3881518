//! Placements: the transform of an object that has a local box or an occluder mesh. The object's bounds and
//! the position of its mesh both follow from it.

use crate::Aabb;
use alloc::vec::Vec;
use glam::Affine3A;

/// The transform of an object, and the box that it places.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    /// Index of the placed object.
    index: u32,
    /// Box of the object in its local coordinates. `None` if the object's bounds are given in scene
    /// coordinates.
    pub(super) local: Option<Aabb>,
    /// Maps local coordinates, those of `local` and of a mesh given by the caller, to scene coordinates.
    pub(super) transform: Affine3A,
}

/// What an object's box was before it was enlarged by rounding errors, to hold the object's mesh or
/// triangles.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct GivenBox {
    /// The local box. `None` if that was not enlarged.
    pub(super) local: Option<Aabb>,
    /// The bounds in scene coordinates. `None` if these were not enlarged, or only together with the local
    /// box.
    pub(super) bounds: Option<Aabb>,
}

/// The occluder mesh of an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlacedMesh {
    /// Index of the mesh in [`Meshes`](super::meshes::Meshes), valid as long as the object has the mesh.
    pub(super) index: u32,
    pub(super) origin: MeshOrigin,
    /// Whether the mesh lies within the object's bounds. A mesh that reaches out of them hides nothing.
    pub(super) is_inside: bool,
}

/// Where an object's occluder mesh comes from, which decides by which transform it is placed.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum MeshOrigin {
    /// The caller gave the mesh. The object's transform places it.
    Given,
    /// The mesh was made from [`SharedTriangles`](super::SharedTriangles). It is placed by the transform of
    /// the triangles, and removed with the triangles.
    Placed,
    /// The mesh was made from the object's triangles in scene coordinates. It has no transform and is removed
    /// with the triangles.
    InScene,
}

/// The placements of a scene, with constant-time look-up by object index.
#[derive(Clone, Debug, Default)]
pub(super) struct Placements {
    /// Indexed by object index: the object's position in `dense`, `NONE` if the object has no placement.
    /// Shorter than the index range, and empty until an object first gets a placement.
    rows: Vec<u32>,
    dense: Vec<Placement>,
    /// Occluder mesh of each object, indexed by object index: `None` for an object without one. Shorter than
    /// the index range, and empty until an object first gets a mesh.
    meshes: Vec<Option<PlacedMesh>>,
}

const NONE: u32 = u32::MAX;

impl Placements {
    pub(super) fn is_empty(&self) -> bool {
        self.dense.is_empty() && self.meshes.is_empty()
    }

    pub(super) fn mesh(&self, index: u32) -> Option<PlacedMesh> {
        *self.meshes.get(index as usize)?
    }

    /// Sets the mesh of an object, or removes it for `None`.
    pub(super) fn set_mesh(&mut self, index: u32, mesh: Option<PlacedMesh>) {
        let i = index as usize;
        if mesh.is_some() && self.meshes.len() <= i {
            self.meshes.resize(i + 1, None);
        }
        if let Some(place) = self.meshes.get_mut(i) {
            *place = mesh;
        }
    }

    pub(super) fn get(&self, index: u32) -> Option<&Placement> {
        self.dense.get(*self.rows.get(index as usize)? as usize)
    }

    pub(super) fn get_mut(&mut self, index: u32) -> Option<&mut Placement> {
        self.dense.get_mut(*self.rows.get(index as usize)? as usize)
    }

    /// Returns the placement of an object. If the object has none, it is given one without a box, whose
    /// transform is the identity.
    pub(super) fn get_or_insert(&mut self, index: u32) -> &mut Placement {
        let i = index as usize;
        if self.rows.len() <= i {
            self.rows.resize(i + 1, NONE);
        }
        if self.rows[i] == NONE {
            self.rows[i] = self.dense.len() as u32;
            self.dense.push(Placement { index, local: None, transform: Affine3A::IDENTITY });
        }
        &mut self.dense[self.rows[i] as usize]
    }

    /// Removes the placement of an object, if it has one.
    pub(super) fn remove(&mut self, index: u32) {
        let Some(row) = self.rows.get_mut(index as usize) else { return };
        let row = core::mem::replace(row, NONE) as usize;
        if row >= self.dense.len() {
            return;
        }
        self.dense.swap_remove(row);
        if let Some(moved) = self.dense.get(row) {
            self.rows[moved.index as usize] = row as u32;
        }
    }

    /// Returns the number of bytes in use, without reserved capacity.
    pub(super) fn memory(&self) -> usize {
        size_of_val(&self.rows[..]) + size_of_val(&self.dense[..]) + size_of_val(&self.meshes[..])
    }
}
