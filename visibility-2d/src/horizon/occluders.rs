//! Upright solids of a scene, made in advance and synchronized with the scene.

use super::extract::{Solid, Solids};
use super::frame::UpAxis;
use super::outline::Post;
use super::terrain::Terrain;
use alloc::vec::Vec;
use visibility_core::glam::Affine3A;
use visibility_core::scene::{Changes, SceneCursor};
use visibility_core::{ObjectId, OccluderMesh, Scene};

/// Quantile of the areas of the upright faces of all solids. [`MIN_FACE`] is a fraction of the area at this
/// quantile.
const USUAL: f64 = 0.95;

/// Least area of a solid's upright face, as a fraction of the area at the quantile [`USUAL`]. Smaller solids
/// are left out: furniture hides next to nothing compared with walls.
const MIN_FACE: f64 = 1.0 / 8.0;

/// Convex solids of a scene's occluders, made in advance from the occluder meshes, for
/// [`HorizonCuller`](super::HorizonCuller). Shared by the cullers of all views.
///
/// Solids are closed convex meshes or convex parts of meshes, of at most 32 vertices each, and upright prisms
/// of at most 32 sides that are open at the bottom, such as the houses of city models. Convex meshes and
/// parts with more vertices hide nothing. In other meshes, chains of upright panels are walls; a panel is two
/// triangles whose corners lie over two points of the plan. Triangles that face up and join at edges are
/// ground, which may belong to many objects; its hills occlude. All other triangles hide nothing. An occluder
/// that has changed since the last [`sync`](Self::sync) hides nothing until the next one. Ground that has
/// changed hides nothing until all occluders are made again.
///
/// ```
/// use visibility_2d::horizon::{HorizonOccluders, UpAxis};
/// use visibility_core::{glam::Affine3A, Aabb, Object, OccluderMesh, Scene};
/// let bounds = Aabb::from_arrays([0.0; 3], [10.0, 8.0, 6.0]);
/// let mut scene = Scene::new();
/// let house = scene.insert(Object { occluder: true, ..Object::new(bounds) });
/// let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds)?);
/// scene.set_mesh(house, mesh, Affine3A::IDENTITY)?;
/// let occluders = HorizonOccluders::new(&scene, UpAxis::Z);
/// assert_eq!(occluders.solid_count(), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct HorizonOccluders {
    up: UpAxis,
    cursor: SceneCursor,
    solids: Solids,
    /// For each object of the scene, by its index, the range of its solids in the list of `solids`: start,
    /// and exclusive end. Empty for an object without solids.
    ranges: Vec<[u32; 2]>,
    /// Number of solids in use. All others in `solids` are from the time before their object changed.
    used: usize,
    terrain: Terrain,
}

impl HorizonOccluders {
    /// Makes the solids of all objects of `scene` that are flagged as occluders and have a mesh. Solids much
    /// smaller than the large ones of the scene are left out, such as furniture among walls. Takes time
    /// proportional to the triangles of all occluders: about a microsecond for a house, and as much for each
    /// upward triangle that may be ground. A long triangle of ground also takes time for each square of the
    /// ground's grid in its bounds, and memory for each square that it meets.
    pub fn new(scene: &Scene, up: UpAxis) -> Self {
        let mut occluders = Self {
            up,
            cursor: SceneCursor::START,
            solids: Solids::default(),
            ranges: Vec::new(),
            used: 0,
            terrain: Terrain::default(),
        };
        occluders.sync(scene);
        occluders
    }

    /// Updates the solids from the changes of `scene` since the last call, in time proportional to the
    /// changed occluders. For another scene, or if the scene's change log is too short, all solids are made
    /// again.
    pub fn sync(&mut self, scene: &Scene) {
        match self.cursor.follow(scene) {
            Changes::Objects(changed) => {
                for &id in changed {
                    self.terrain.lose(id.index());
                    self.take(scene, id);
                }
                // Old solids are removed when there are more of them than solids in use.
                if self.solids.solids.len() > 2 * self.used + 64 {
                    self.drop_former();
                }
            }
            Changes::Everything => self.make_all(scene),
        }
    }

    fn make_all(&mut self, scene: &Scene) {
        self.solids.clear();
        self.solids.least_face = 0.0;
        self.ranges.clear();
        self.used = 0;
        for id in scene.ids() {
            self.take(scene, id);
        }
        let mut faces: Vec<f64> = self.solids.solids.iter().map(|solid| solid.face).collect();
        if !faces.is_empty() {
            let place = (faces.len() as f64 * USUAL) as usize;
            let (_, usual, _) = faces.select_nth_unstable_by(place, f64::total_cmp);
            self.solids.least_face = MIN_FACE * *usual;
            self.drop_former();
        }
        self.terrain = Terrain::new(scene, self.up);
    }

    /// Removes old solids, and solids whose upright face is smaller than `least_face`.
    fn drop_former(&mut self) {
        let least_face = self.solids.least_face;
        let all = core::mem::replace(&mut self.solids, Solids { least_face, ..Solids::default() });
        self.used = 0;
        for range in &mut self.ranges {
            let begin = self.solids.solids.len() as u32;
            for solid in &all.solids[range[0] as usize..range[1] as usize] {
                if solid.face < least_face {
                    continue;
                }
                self.used += 1;
                let first = self.solids.posts.len() as u32;
                self.solids.posts.extend_from_slice(all.posts(solid));
                self.solids.solids.push(Solid { first, ..*solid });
            }
            *range = [begin, self.solids.solids.len() as u32];
        }
    }

    /// Replaces the solids of one object.
    fn take(&mut self, scene: &Scene, id: ObjectId) {
        if self.ranges.len() <= id.index() {
            self.ranges.resize(id.index() + 1, [0, 0]);
        }
        let [first, end] = self.ranges[id.index()];
        self.used -= (end - first) as usize;
        let begin = self.solids.solids.len();
        // The object may have been removed. A new object with its index is in the list of changes itself.
        if let Some(id) = scene.id_at(id.index())
            && let Some((mesh, ref transform)) = scene.occluder(id)
        {
            self.solids.add_mesh(mesh, transform, self.up, true);
        }
        self.ranges[id.index()] = [begin as u32, self.solids.solids.len() as u32];
        self.used += self.solids.solids.len() - begin;
    }

    /// Returns the axis that points up.
    pub fn up(&self) -> UpAxis {
        self.up
    }

    /// Returns the number of solids, a wall counting as one.
    pub fn solid_count(&self) -> usize {
        self.used
    }

    /// Returns the ground (connected triangles that face up) that may occlude.
    pub(crate) fn terrain(&self) -> &Terrain {
        &self.terrain
    }

    /// Returns the changes of `scene` since the last [`sync`](Self::sync).
    pub(crate) fn missed<'a>(&self, scene: &'a Scene) -> Changes<'a> {
        self.cursor.peek(scene)
    }

    /// Returns the solids of an object as of the last [`sync`](Self::sync), each with its posts.
    pub(crate) fn solids_of(&self, id: ObjectId) -> impl Iterator<Item = (&Solid, &[Post])> {
        let [first, end] = self.ranges.get(id.index()).copied().unwrap_or([0, 0]);
        let solids = self.solids.solids.get(first as usize..end as usize).unwrap_or(&[]);
        solids.iter().map(|solid| (solid, self.solids.posts(solid)))
    }
}

/// Replaces `scratch` by the solids of one mesh under a transform.
pub(crate) fn solids_of_mesh(scratch: &mut Solids, mesh: &OccluderMesh, transform: &Affine3A, up: UpAxis) {
    scratch.clear();
    scratch.add_mesh(mesh, transform, up, true);
}
