//! Camera walks for scenes without cameras, at eye height above floors where a person can stand.
//!
//! `floor_map.rs` finds the floors, and `places.rs` the connected regions where one can stand. Tours
//! (`tour.rs`) lead through the largest regions, and through rooms that are entered from outdoors. A scene
//! without any such region, such as a statue, gets a walk on a ring around it. The same scene always gets the
//! same walks.

mod floor_map;
mod places;
mod tour;

use crate::walk::{CameraKey, Walk};
use crate::{SceneSource, SourceObject};
use floor_map::{COLUMN, FloorMap, GroundAxes};
use glam::{DVec2, DVec3, Vec3};
use places::{Places, Region};

/// Maximum number of walks through regions with a ceiling, and through regions without.
const MOST_WALKS: [usize; 2] = [3, 1];
/// Least area in square metres of a region with a ceiling that gets a walk, and of a region without.
const LEAST_AREA: [f64; 2] = [4.0, 25.0];
/// Least area of a region that gets a walk, as a share of the largest region's area. Rooms entered from
/// outdoors are compared with the largest such room.
const LEAST_SHARE: f64 = 0.05;
/// Least size in metres on the ground of a scene that is a landscape or a town rather than an object. If it
/// has no floor to stand on, its file is taken to omit the ground, and level ground is added.
const PLACE: f64 = 30.0;
/// Vertical field of view of all walks, in degrees.
const FOV: f32 = 60.0;
/// Near plane distance in metres of walks at eye height.
const NEAR: f32 = 0.05;
/// Number of keys of the walk around a scene.
const RING_KEYS: usize = 48;

/// Walks made up for a scene, and a suitable near plane distance.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MadeUpWalks {
    /// Walks in world space. Empty for a scene without finite points.
    pub walks: Vec<Walk>,
    /// Greatest near plane distance in metres that suits the walks.
    pub near: f32,
    /// Points of floors where one can stand, with the free height above, as in [`SceneSource::floors`].
    pub floors: Vec<(DVec3, f64)>,
}

impl MadeUpWalks {
    /// Makes walks for a scene. `visit` passes on the scene's objects; it is called up to three times, and
    /// must pass on the same objects each time. Only the up axis and the origin of `scene` are used, not its
    /// objects. Takes time proportional to the triangles, and at most some seconds and 300 MB for the map.
    /// The map covers at most 256 m on each side around the middle of the objects, and less if the scene has
    /// very many floors.
    pub fn new(scene: &SceneSource, mut visit: impl FnMut(&mut dyn FnMut(&SourceObject))) -> Self {
        let axes = GroundAxes::new(scene.up);
        let mut bounds = crate::source::Bounds::default();
        // For each object, its centre and its least height.
        let mut stands: Vec<(DVec2, f64)> = Vec::new();
        visit(&mut |object| {
            bounds.add(object);
            if let Some((low, high)) = object.bounds() {
                let (low, high) = axes.sorted(low.as_dvec3(), high.as_dvec3());
                stands.push(((low.truncate() + high.truncate()) * 0.5, low.z));
            }
        });
        let Some((low, high)) = bounds.corners() else { return Self::default() };
        let (low, high) = axes.sorted(low.as_dvec3(), high.as_dvec3());
        let middle = DVec2::new(median(&stands, |(at, _)| at.x), median(&stands, |(at, _)| at.y));
        let mut map = FloorMap::new(axes, low.truncate(), high.truncate(), middle);
        visit(&mut |object| map.add(object));
        let mut found = Self::standing(scene, &map);
        if found.walks.is_empty() && (high - low).truncate().max_element() > PLACE {
            map.add_ground(median(&stands, |(_, height)| *height));
            found = Self::standing(scene, &map);
        }
        if found.walks.is_empty() {
            let (low, high) = (axes.point(low), axes.point(high));
            found.walks = vec![around(low.min(high), low.max(high), scene.up)];
            found.near = f32::INFINITY;
        }
        found.walks.iter_mut().for_each(|walk| walk.translate(scene.origin));
        found
    }

    /// Makes walks through the largest regions of a map, relative to the scene's origin.
    fn standing(scene: &SceneSource, map: &FloorMap) -> Self {
        let places = Places::new(map);
        let regions = places.regions(map);
        let area = |region: &Region| region.places.len() as f64 * COLUMN * COLUMN;
        let greatest = regions.iter().map(area).fold(0.0, f64::max);
        let open = regions.iter().filter(|region| !region.is_covered && !region.is_roof);
        let mut rooms: Vec<Region> = open.flat_map(|region| places.rooms(map, region)).collect();
        rooms.sort_by_key(|room| std::cmp::Reverse(room.places.len()));
        let least_room = LEAST_AREA[0].max(LEAST_SHARE * rooms.first().map_or(0.0, area));
        let mut made = Self { near: NEAR, ..Self::default() };
        for (is_open, name) in ["indoors", "outdoors"].into_iter().enumerate() {
            let least = LEAST_AREA[is_open].max(LEAST_SHARE * greatest);
            let chosen = regions.iter().filter(|region| area(region) >= least && !region.is_roof);
            let chosen = chosen.chain(rooms.iter().filter(|room| area(room) >= least_room));
            let chosen = chosen.filter(|region| usize::from(!region.is_covered) == is_open);
            for region in chosen.take(MOST_WALKS[is_open]) {
                let keys = tour::keys(map, &places, region);
                if keys.is_empty() {
                    continue;
                }
                made.walks.push(Walk { name: name.to_owned(), fov_y_degrees: FOV, up: scene.up, keys });
            }
        }
        let least = LEAST_AREA[0].max(LEAST_SHARE * greatest);
        for region in regions.iter().filter(|region| area(region) >= least && !region.is_roof) {
            let even = region.places.iter().filter(|&&place| places.is_even(map, place));
            made.floors.extend(even.map(|&place| {
                let [floor, ceiling] = places.heights(place);
                (places.point(map, place, floor) + scene.origin, f64::from(ceiling - floor))
            }));
        }
        if made.walks.is_empty() { Self::default() } else { made }
    }

    /// Returns the number of walks of each kind as text, such as "3 indoors, 1 around".
    pub fn counts(&self) -> String {
        let mut kinds: Vec<(&str, usize)> = Vec::new();
        for walk in &self.walks {
            match kinds.iter_mut().find(|(name, _)| *name == walk.name) {
                Some((_, count)) => *count += 1,
                None => kinds.push((&walk.name, 1)),
            }
        }
        kinds.iter().map(|(name, count)| format!("{count} {name}")).collect::<Vec<_>>().join(", ")
    }
}

impl SceneSource {
    /// Adds made-up walks to the scene if it has none, with a note to the user that describes them.
    #[must_use]
    pub fn with_walks(mut self) -> Self {
        if self.walks.is_empty() {
            let made = MadeUpWalks::new(&self, |each| self.objects.iter().for_each(each));
            self.take_walks(made);
        }
        self
    }

    /// Replaces the scene's walks by made-up ones, and adds a note to the user that describes them.
    pub fn take_walks(&mut self, made: MadeUpWalks) {
        let counts = made.counts();
        let none = "there is nothing to walk around: the scene has no triangle";
        self.notes.push(if counts.is_empty() {
            none.to_owned()
        } else {
            format!("walks are made up: {counts}")
        });
        self.near = self.near.min(made.near);
        (self.walks, self.floors) = (made.walks, made.floors);
    }
}

/// Makes a walk on a ring around a scene. `low` and `high` are the corners of the scene's bounds.
fn around(low: DVec3, high: DVec3, up: Vec3) -> Walk {
    let centre = (low + high) * 0.5;
    // The minimum radius keeps the eye away from a scene that is a single point.
    let radius = ((high - low).length() * 0.5).max(1e-3);
    let direction = up.as_dvec3();
    let side = direction.any_orthonormal_vector();
    let other = direction.cross(side);
    let keys = (0..RING_KEYS).map(|i| {
        let angle = i as f64 * std::f64::consts::TAU / (RING_KEYS - 1) as f64;
        let around = side * angle.cos() + other * angle.sin();
        CameraKey { eye: centre + (around * 1.6 + direction * 0.6) * radius, target: centre }
    });
    Walk { name: "around".to_owned(), fov_y_degrees: FOV, up, keys: keys.collect() }
}

/// Returns the median of `value` over some items. 0 without items.
fn median<T>(items: &[T], value: impl Fn(&T) -> f64) -> f64 {
    let mut values: Vec<f64> = items.iter().map(value).collect();
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
