//! Hardware queries over a card that answers late, out of order, several times or never, under a camera and a
//! scene that sometimes stand still: what they hide, a map of all occluders of the frame hides too.

use super::view_from;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::occlusion::{HardwareQueries, LateAnswers, Occlusion, QueryDevice};
use visibility_core::{
    Aabb, Culler, FrustumCuller, Object, ObjectId, OccluderMesh, OcclusionCuller, OcclusionMap, Scene, View,
    VisibleSet,
};
use visibility_testing::{PlainMap, Random, judged, told_enough};

/// A simulated graphics card whose queries see what has been drawn when they are asked.
struct UnreliableCard {
    map: PlainMap,
    view: View,
    origin: DVec3,
    random: Random,
    /// Answers under way: the number of looks until they arrive, the query, and the samples that passed.
    under_way: Vec<(usize, u64, u32)>,
}

impl QueryDevice for UnreliableCard {
    fn ask(&mut self, query: u64, boxes: &[Aabb]) {
        self.map.flush();
        let passed = boxes.iter().any(|bounds| self.map.test(bounds) != Occlusion::Hidden);
        // One answer in eight is lost, one in eight comes twice.
        for _ in 0..self.random.pick(&[0, 1, 1, 1, 1, 1, 1, 2]) {
            let at = self.random.below(self.under_way.len() + 1);
            self.under_way.insert(at, (self.random.below(6), query, u32::from(passed)));
        }
    }

    fn answers(&mut self, each: &mut dyn FnMut(u64, u32)) {
        self.under_way.retain_mut(|(left, query, passed)| {
            let is_there = *left == 0;
            *left = left.saturating_sub(1);
            if is_there {
                each(*query, *passed);
            }
            !is_there
        });
        self.map.begin(&self.view, self.origin);
    }

    fn draw(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        self.map.add(occluder, transform);
    }
}

fn put_wall(random: &mut Random, scene: &mut Scene, id: ObjectId) {
    let middle = random.vec3(-7.0, 7.0);
    let half = random.pick(&[Vec3::new(0.2, 4.0, 4.0), Vec3::new(4.0, 0.2, 4.0), Vec3::splat(1.5)]);
    let bounds = Aabb::new(middle - half, middle + half);
    scene.set_bounds(id, bounds).unwrap();
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
    scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
    scene.remove_mesh(mesh).unwrap();
}

/// Culls `frames` frames and returns how many objects were hidden.
fn run(seed: u64, frames: usize) -> usize {
    let mut random = Random(seed);
    let mut scene = Scene::new();
    let things: Vec<ObjectId> = (0..120)
        .map(|_| {
            let middle = random.vec3(-14.0, 14.0);
            scene.insert(Aabb::new(middle - 0.2, middle + 0.2))
        })
        .collect();
    let walls: Vec<ObjectId> = (0..8)
        .map(|_| {
            let id =
                scene.insert(Object { occluder: true, ..Object::new(Aabb::from_arrays([0.0; 3], [1.0; 3])) });
            put_wall(&mut random, &mut scene, id);
            id
        })
        .collect();
    let mut eye = random.vector(12.0);
    let mut view = view_from(eye, DVec3::ZERO);
    let card = UnreliableCard {
        map: PlainMap::new(96, 60),
        view,
        origin: DVec3::ZERO,
        random: Random(seed + 1),
        under_way: Vec::new(),
    };
    let mut culler = OcclusionCuller::new(HardwareQueries::new(card, LateAnswers::Visible));
    let (mut truth, mut set, mut hidden) = (PlainMap::new(96, 60), VisibleSet::new(), 0);
    // Number of frames left in which the card draws another view than the culler culls for.
    let mut frozen = 0;
    for frame in 0..frames {
        match random.below(40) {
            0 => eye = random.vector(12.0),
            1 => eye += random.vector(0.05),
            2 => put_wall(&mut random, &mut scene, walls[frame % walls.len()]),
            3 => scene.set_occluder(walls[frame % walls.len()], random.one_in(2)).unwrap(),
            4 => {
                let middle = random.vec3(-14.0, 14.0);
                scene
                    .set_bounds(things[frame % things.len()], Aabb::new(middle - 0.2, middle + 0.2))
                    .unwrap();
            }
            5 => scene.set_origin(random.vector(1.0)).unwrap(),
            6 => scene.rebuild(),
            7 if frozen == 0 => frozen = random.below(6) + 1,
            _ => {}
        }
        view = view_from(eye, DVec3::ZERO);
        let drawn = if frozen > 1 { view_from(random.vector(12.0), DVec3::ZERO) } else { view };
        if frozen > 0 {
            culler.draws_other_view();
            frozen -= 1;
        }
        (culler.map_mut().device_mut().view, culler.map_mut().device_mut().origin) = (drawn, scene.origin());
        // Some frames are looked at ahead once or twice.
        let looks = [0, 0, 1, 2][random.below(4)];
        for look in 0..=looks {
            set.fill(&scene, &view);
            FrustumCuller::new().cull(&scene, &view, &mut set);
            if look < looks {
                culler.look_ahead(&scene, &view, &mut set, look);
            }
        }
        let in_view: Vec<ObjectId> = scene.ids().filter(|&id| set.contains(&scene, id)).collect();
        culler.cull(&scene, &view, &mut set);
        truth.begin(&view, scene.origin());
        for &id in &walls {
            if let Some((mesh, transform)) = scene.occluder(id) {
                truth.add(mesh, &transform);
            }
        }
        truth.flush();
        for id in in_view.into_iter().filter(|&id| !set.contains(&scene, id)) {
            let bounds = scene.bounds(id).unwrap();
            assert_eq!(truth.test(&bounds), Occlusion::Hidden, "seed {seed}, frame {frame}: {id} is seen");
            hidden += 1;
        }
    }
    hidden
}

#[test]
fn what_an_unreliable_card_hides_is_hidden() {
    let hidden: usize = (0..2).map(|seed| run(2 * seed, 600)).sum();
    judged(hidden as u64);
    told_enough(hidden > 50, format_args!("{hidden} hidden objects are no test"));
}
