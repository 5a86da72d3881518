//! Visible objects grouped by mesh, material or level of detail, with the command that draws each group at
//! once.
//!
//! Small keys are sorted by counting (Knuth, "Sorting and Searching", 1973, section 5.2): one pass counts the
//! objects of each key, one sums the counts up, one writes each object to the place of its key.

use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::ObjectId;

/// The arguments of one indexed indirect draw call, laid out as `VkDrawIndexedIndirectCommand`,
/// `D3D12_DRAW_INDEXED_ARGUMENTS`, OpenGL's `DrawElementsIndirectCommand` and wgpu's
/// `DrawIndexedIndirectArgs`: 20 bytes. With the feature `bytemuck` it is `Pod`.
///
/// ```
/// use visibility_frame::draw_list::DrawIndexedIndirect;
/// let cube = DrawIndexedIndirect { index_count: 36, instance_count: 1, ..Default::default() };
/// assert_eq!(size_of_val(&cube), 20);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::Pod, bytemuck::Zeroable))]
#[repr(C)]
pub struct DrawIndexedIndirect {
    /// Number of indices of the mesh.
    pub index_count: u32,
    /// Number of instances to draw.
    pub instance_count: u32,
    /// Position of the mesh's first index in the index buffer.
    pub first_index: u32,
    /// Number added to each index of the mesh before the vertex is read.
    pub base_vertex: i32,
    /// Position of the first instance in [`DrawList::instances`].
    pub first_instance: u32,
}

/// The objects of a [`DrawList`] that have one key: a range of [`DrawList::instances`].
///
/// ```
/// use visibility_frame::draw_list::DrawGroup;
/// assert_eq!(DrawGroup { key: 7, first: 3, count: 2 }.range(), 3..5);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::Pod, bytemuck::Zeroable))]
#[repr(C)]
pub struct DrawGroup {
    /// The key that the caller gave to the objects.
    pub key: u32,
    /// Position of the first object in [`DrawList::instances`].
    pub first: u32,
    /// Number of objects, at least 1.
    pub count: u32,
}

impl DrawGroup {
    /// Returns the positions of the objects in [`DrawList::instances`].
    pub const fn range(self) -> Range<usize> {
        self.first as usize..self.first as usize + self.count as usize
    }
}

/// Visible objects grouped by a key of the caller: a mesh, a material, a level of detail, or several of them
/// in one number.
///
/// The list owns its memory: kept from frame to frame, it allocates nothing once it has held the largest
/// frame.
///
/// ```
/// use visibility_frame::draw_list::{DrawIndexedIndirect, DrawList};
/// use visibility_core::{Aabb, Scene, VisibleSet};
/// let mut scene = Scene::new();
/// scene.insert_batch((0..4).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 0.5; 3])));
/// let mut visible = VisibleSet::new();
/// visible.finish(&scene); // or Pipeline::cull
/// let meshes = [1, 0, 1, 1]; // by object index
/// let mut list = DrawList::new();
/// // Each frame:
/// list.group(visible.iter(&scene), |id| meshes[id.index()]);
/// assert_eq!(list.instances(), [1, 0, 2, 3]);
/// let index_counts = [36, 600]; // by mesh
/// let commands: Vec<_> = list
///     .commands(|mesh| DrawIndexedIndirect {
///         index_count: index_counts[mesh as usize],
///         ..Default::default()
///     })
///     .collect();
/// assert_eq!((commands[1].first_instance, commands[1].instance_count), (1, 3));
/// ```
#[derive(Clone, Debug, Default)]
pub struct DrawList {
    groups: Vec<DrawGroup>,
    instances: Vec<u32>,
    /// Scratch: the key of each object in the upper half and the object's index in the lower, in the order
    /// given.
    keyed: Vec<u64>,
    /// Scratch with one of two meanings. If objects are counted by key, indexed by key: first the number of
    /// objects with the key, then the position in `instances` of the next object with the key. If objects are
    /// sorted by comparison: the index of each object, in the order given.
    places: Vec<u32>,
}

impl DrawList {
    /// Creates an empty list.
    pub const fn new() -> Self {
        Self { groups: Vec::new(), instances: Vec::new(), keyed: Vec::new(), places: Vec::new() }
    }

    /// Replaces the content of the list with the objects `ids`, such as those of
    /// [`VisibleSet::iter`](visibility_core::VisibleSet::iter), in groups of equal `key`. Groups are in the
    /// order of their keys, objects of a group in the order of `ids`.
    ///
    /// Takes a few nanoseconds per object if the greatest key is less than about four times the number of
    /// objects; otherwise the objects are sorted by comparison.
    pub fn group(&mut self, ids: impl IntoIterator<Item = ObjectId>, mut key: impl FnMut(ObjectId) -> u32) {
        let Self { groups, instances, keyed, places } = self;
        groups.clear();
        instances.clear();
        keyed.clear();
        let mut greatest = 0;
        ids.into_iter().for_each(|id| {
            let key = key(id);
            greatest = greatest.max(key);
            keyed.push(u64::from(key) << 32 | id.index() as u64);
        });
        // A counting sort by a key much greater than the number of objects would take a large table of
        // counts.
        if greatest as usize / 4 > keyed.len() + 64 {
            // Each word sorted has a key and a position in `ids` instead of an object index, so that objects
            // of a group keep their order.
            places.clear();
            places.extend(keyed.iter().map(|&keyed| keyed as u32));
            for (keyed, position) in keyed.iter_mut().zip(0..) {
                *keyed = *keyed >> 32 << 32 | position;
            }
            keyed.sort_unstable();
            for &keyed in &*keyed {
                let key = (keyed >> 32) as u32;
                match groups.last_mut() {
                    Some(group) if group.key == key => group.count += 1,
                    _ => groups.push(DrawGroup { key, first: instances.len() as u32, count: 1 }),
                }
                instances.push(places[keyed as u32 as usize]);
            }
            return;
        }
        places.clear();
        // Otherwise a counting sort, in the order of `ids` within each key.
        places.resize(greatest as usize + 1, 0);
        for &keyed in &*keyed {
            places[(keyed >> 32) as usize] += 1;
        }
        let mut first = 0;
        for (key, place) in (0..).zip(&mut *places) {
            let count = core::mem::replace(place, first);
            if count > 0 {
                groups.push(DrawGroup { key, first, count });
                first += count;
            }
        }
        instances.resize(keyed.len(), 0);
        for &keyed in &*keyed {
            let place = &mut places[(keyed >> 32) as usize];
            instances[*place as usize] = keyed as u32;
            *place += 1;
        }
    }

    /// Returns the groups by ascending key. No group is empty.
    pub fn groups(&self) -> &[DrawGroup] {
        &self.groups
    }

    /// Returns the [index](ObjectId::index) of each object, group after group: the buffer in which a shader
    /// looks up the object of an instance.
    pub fn instances(&self) -> &[u32] {
        &self.instances
    }

    /// Iterates over the commands that draw the groups, in their order. `mesh` returns, for a key, the
    /// command that draws the mesh; `instance_count` and `first_instance` in what it returns are replaced by
    /// those of the group.
    pub fn commands(
        &self,
        mut mesh: impl FnMut(u32) -> DrawIndexedIndirect,
    ) -> impl ExactSizeIterator<Item = DrawIndexedIndirect> {
        self.groups.iter().map(move |group| DrawIndexedIndirect {
            instance_count: group.count,
            first_instance: group.first,
            ..mesh(group.key)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::{Aabb, Scene};

    /// Small keys are counted and great ones sorted: groups are the same, and none is empty.
    #[test]
    fn groups_are_of_the_keys_that_objects_have() {
        let mut scene = Scene::new();
        let ids = scene.insert_batch((0..9).map(|_| Aabb::from_arrays([0.0; 3], [1.0; 3])));
        for far in [7, 900_000] {
            let mut list = DrawList::new();
            list.group(ids.iter().copied(), |id| [far, 2, 4][id.index() % 3]);
            let groups: Vec<_> =
                list.groups().iter().map(|group| (group.key, group.first, group.count)).collect();
            assert_eq!(groups, [(2, 0, 3), (4, 3, 3), (far, 6, 3)], "groups with the key {far}");
            assert_eq!(list.instances(), [1, 4, 7, 2, 5, 8, 0, 3, 6], "objects with the key {far}");
        }
    }
}
