//! The occluder meshes of a scene, each in a slot with the number of objects that have it. The generation of
//! a slot distinguishes the ids of meshes that are in the slot one after another.

use super::MeshId;
use crate::OccluderMesh;
use alloc::vec::Vec;

/// The occluder meshes of a scene, in slots. The index of a mesh's id is the index of its slot.
#[derive(Clone, Debug, Default)]
pub(super) struct Meshes {
    slots: Vec<Slot>,
    /// Indices of the slots without a mesh.
    free: Vec<u32>,
}

#[derive(Clone, Debug)]
struct Slot {
    /// Occluder mesh in the slot; `None` in a free slot.
    mesh: Option<OccluderMesh>,
    /// Generation of the present mesh, or of the next one in a free slot.
    generation: u32,
    /// Number of objects that have the mesh.
    users: u32,
    /// True once the mesh was removed: its id names no mesh any more. The mesh is freed with its last user.
    is_removed: bool,
}

impl Meshes {
    /// Stores a mesh. `first_generation` is the generation of the first mesh of each slot.
    pub(super) fn add(&mut self, mesh: OccluderMesh, first_generation: u32) -> MeshId {
        let index = self.free.pop().unwrap_or_else(|| {
            self.slots.push(Slot { mesh: None, generation: first_generation, users: 0, is_removed: false });
            self.slots.len() as u32 - 1
        });
        let slot = &mut self.slots[index as usize];
        slot.mesh = Some(mesh);
        MeshId { index, generation: slot.generation }
    }

    /// Returns the slot of a mesh that is still stored, even if it was removed. `None` if the mesh of this id
    /// was freed.
    fn slot(&self, id: MeshId) -> Option<&Slot> {
        self.slots
            .get(id.index as usize)
            .filter(|slot| slot.mesh.is_some() && slot.generation == id.generation)
    }

    /// Returns the mesh in slot `index`, even if it was removed. `None` in a free slot.
    pub(super) fn at(&self, index: u32) -> Option<&OccluderMesh> {
        self.slots.get(index as usize)?.mesh.as_ref()
    }

    /// Returns the number of objects that have a mesh. `None` for an id that names no mesh, or one that was
    /// removed.
    pub(super) fn users(&self, id: MeshId) -> Option<usize> {
        self.slot(id).filter(|slot| !slot.is_removed).map(|slot| slot.users as usize)
    }

    /// Returns the number of meshes that are stored.
    pub(super) fn count(&self) -> usize {
        self.slots.len() - self.free.len()
    }

    /// Removes a mesh: at once if no object has it, otherwise with its last object. Returns false for an id
    /// that names no mesh.
    pub(super) fn remove(&mut self, id: MeshId) -> bool {
        let is_known = self.users(id).is_some();
        if is_known {
            self.slots[id.index as usize].is_removed = true;
            self.free_unused(id.index);
        }
        is_known
    }

    /// Counts one more object that has the mesh in slot `index`.
    pub(super) fn add_user(&mut self, index: u32) {
        self.slots[index as usize].users += 1;
    }

    /// Counts one object less that has the mesh in slot `index`. Frees a removed mesh with its last object.
    pub(super) fn remove_user(&mut self, index: u32) {
        self.slots[index as usize].users -= 1;
        self.free_unused(index);
    }

    /// Frees slot `index` if its mesh is removed and no object has it any more.
    fn free_unused(&mut self, index: u32) {
        let slot = &mut self.slots[index as usize];
        if slot.is_removed && slot.users == 0 {
            *slot =
                Slot { mesh: None, generation: slot.generation.wrapping_add(1), users: 0, is_removed: false };
            self.free.push(index);
        }
    }
}
