//! Lists of entities in bevy's sort order.

use bevy_ecs::entity::{Entity, EntityGeneration};

/// Collects entities and sorts them. Entities of the first generation, which most are, are sorted by one bit
/// per entity index, in one or two nanoseconds each. All others are sorted by comparison.
#[derive(Default, Debug)]
pub(crate) struct EntitySorter {
    /// One bit per entity index, set for a collected entity of the first generation.
    bits: Vec<u64>,
    others: Vec<Entity>,
    /// Number of entities in `bits`.
    count: usize,
}

impl EntitySorter {
    /// Adds an entity, which must not be in the collection yet.
    #[inline]
    pub(crate) fn push(&mut self, entity: Entity) {
        if entity.generation() != EntityGeneration::FIRST {
            self.others.push(entity);
            return;
        }
        self.push_first(entity.index_u32());
    }

    /// Adds the entity of the first generation with this index, which must not be in the collection yet.
    #[inline]
    pub(crate) fn push_first(&mut self, index: u32) {
        let index = index as usize;
        if self.bits.len() <= index / 64 {
            self.bits.resize(index / 64 + 1, 0);
        }
        self.bits[index / 64] |= 1 << (index % 64);
        self.count += 1;
    }

    /// Replaces the content of `list` with the sorted entities, and empties the collection.
    pub(crate) fn take(&mut self, list: &mut Vec<Entity>) {
        list.clear();
        list.reserve(self.count + self.others.len());
        let mut push = |word: usize, bit: u32| list.extend(Entity::from_raw_u32(word as u32 * 64 + bit));
        // bevy defines whether entities with greater indices come first.
        if is_descending() {
            for (word, bits) in self.bits.iter_mut().enumerate().rev() {
                let mut rest = core::mem::take(bits);
                while rest != 0 {
                    let bit = 63 - rest.leading_zeros();
                    push(word, bit);
                    rest ^= 1 << bit;
                }
            }
        } else {
            for (word, bits) in self.bits.iter_mut().enumerate() {
                let mut rest = core::mem::take(bits);
                while rest != 0 {
                    push(word, rest.trailing_zeros());
                    rest &= rest - 1;
                }
            }
        }
        self.count = 0;
        // Entities of later generations sort after those of the first.
        self.others.sort_unstable();
        list.append(&mut self.others);
    }
}

/// Returns whether entities with greater indices sort first within a generation.
fn is_descending() -> bool {
    Entity::from_raw_u32(0) > Entity::from_raw_u32(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_ecs::world::World;

    #[test]
    fn entities_come_in_bevys_order() {
        let mut world = World::new();
        let mut entities: Vec<Entity> = (0..500).map(|_| world.spawn_empty().id()).collect();
        for _ in 0..3 {
            let freed: Vec<Entity> = entities.split_off(350);
            freed.into_iter().for_each(|entity| assert!(world.despawn(entity), "{entity} was there"));
            world.flush();
            entities.extend((0..150).map(|_| world.spawn_empty().id()));
        }
        let mut sorter = EntitySorter::default();
        let mut list = Vec::new();
        for step in [1, 3] {
            let mut some: Vec<Entity> = entities.iter().copied().step_by(step).collect();
            some.iter().for_each(|&entity| sorter.push(entity));
            some.sort();
            sorter.take(&mut list);
            assert_eq!(list, some, "every {step}th entity, sorted as bevy sorts");
        }
        assert!(
            entities.iter().any(|entity| entity.generation() != EntityGeneration::FIRST),
            "entities that took the place of others"
        );
    }
}
