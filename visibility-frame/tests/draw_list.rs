//! Tests of draw lists.

use std::collections::BTreeMap;
use visibility_core::{Aabb, Scene};
use visibility_frame::draw_list::{DrawGroup, DrawIndexedIndirect, DrawList};
use visibility_testing::Random;

/// Tests groups against a map from keys to lists, with few, many, sparse and extreme keys, reusing one draw
/// list.
#[test]
fn draw_lists_group_as_a_map_of_lists_does() {
    let mut rng = Random(7);
    let mut list = DrawList::new();
    assert_eq!((list.groups(), list.instances()), (&[][..], &[][..]), "a new list is empty");
    let mut sparse = 0;
    for round in 0..300 {
        let count = rng.pick(&[0, 1, 2, 50, 3000]);
        let mut scene = Scene::new();
        let mut ids = scene.insert_batch((0..count).map(|_| Aabb::from_arrays([0.0; 3], [1.0; 3])));
        ids.sort_by_key(|id| id.index() * 7919 % 1013);
        let keys = rng.pick(&[1, 2, 60, 1000, 100_000, usize::MAX]);
        let key_of: Vec<u32> = (0..count)
            .map(|_| {
                if keys == usize::MAX {
                    rng.pick(&[0, 5, u32::MAX, u32::MAX - 1])
                } else {
                    rng.below(keys) as u32
                }
            })
            .collect();
        sparse += usize::from(key_of.iter().any(|&key| key as usize > 8 * count + 1000));
        list.group(ids.iter().copied(), |id| key_of[id.index()]);
        let mut expected: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for id in &ids {
            expected.entry(key_of[id.index()]).or_default().push(id.index() as u32);
        }
        let got = list.groups().iter().map(|group| (group.key, list.instances()[group.range()].to_vec()));
        assert!(got.eq(expected.clone()), "round {round}");
        assert_eq!(
            list.instances(),
            expected.values().flatten().copied().collect::<Vec<_>>(),
            "round {round}: indices by group"
        );
        let mesh = |key| DrawIndexedIndirect { index_count: key ^ 3, base_vertex: -5, ..Default::default() };
        assert_eq!(list.commands(mesh).len(), expected.len(), "round {round}: a command for each group");
        for (command, &DrawGroup { key, first, count }) in list.commands(mesh).zip(list.groups()) {
            let whole = DrawIndexedIndirect { first_instance: first, instance_count: count, ..mesh(key) };
            assert_eq!(command, whole, "round {round}: the command of group {key}");
        }
    }
    assert!(sparse > 30, "too easy: {sparse}");
}

#[cfg(feature = "bytemuck")]
#[test]
fn commands_are_plain_data() {
    let command = DrawIndexedIndirect {
        index_count: 1,
        instance_count: 2,
        first_index: 3,
        base_vertex: -1,
        first_instance: 5,
    };
    assert_eq!(
        bytemuck::cast::<_, [u32; 5]>(command),
        [1, 2, 3, u32::MAX, 5],
        "a command is five words in wgpu's order"
    );
    assert_eq!(
        bytemuck::cast::<_, [u32; 3]>(DrawGroup { key: 7, first: 8, count: 9 }),
        [7, 8, 9],
        "a group is three words"
    );
}
