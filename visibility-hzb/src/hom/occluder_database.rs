//! The occluder database: the objects of a scene that are worth drawing as occluders, found once when the
//! scene is loaded.
//!
//! Objects are chosen by the three criteria of Zhang, Manocha, Hudson and Hoff ("Visibility Culling using
//! Hierarchical Occlusion Maps", 1997). Small objects hide little. Objects close to a larger occluder, such
//! as a clock on a wall, hide little that the larger one does not. Objects of many triangles cost much to
//! draw. Leaving out an occluder is always conservative, so none of these criteria needs to be exact.

use alloc::vec::Vec;
use visibility_core::glam::Vec3;
use visibility_core::{
    Aabb, ObjectId, Scene,
    scene::SceneError,
    walk::{BoxHierarchy, Child, SceneHierarchy},
};

/// Criteria by which an [`OccluderDatabase`] leaves out objects.
///
/// ```
/// use visibility_hzb::OccluderCriteria;
/// let criteria = OccluderCriteria { min_size: 1.0, ..OccluderCriteria::default() };
/// assert_eq!(criteria.max_triangles, 1024);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct OccluderCriteria {
    /// Minimum size in metres: the side of a square. An object is left out if the area that it shows along
    /// the x, y and z axis is less than that of the square for every axis. 0 leaves out none but objects of
    /// NaN area.
    pub min_size: f32,
    /// Maximum number of triangles of an occluder. An object with more is left out.
    pub max_triangles: usize,
    /// Fraction, 0 to 1, of an object that larger occluders must back for the object to be left out as
    /// redundant. It is measured by lines through the object along the three axes, as the fraction of lines
    /// that meet a larger occluder at most an eighth of the object's longest side away. Above 1, no object
    /// is redundant.
    pub redundancy: f32,
}

impl Default for OccluderCriteria {
    /// Returns a minimum size of 0.25 m, at most 1024 triangles, and a redundancy of 0.75.
    fn default() -> Self {
        Self { min_size: 0.25, max_triangles: 1024, redundancy: 0.75 }
    }
}

/// Objects of a scene that are worth drawing as occluders, and the flagged occluders that are not.
///
/// The database stores ids. Objects that are moved, added or removed later do not change it.
///
/// ```
/// use visibility_core::{glam::Affine3A, Aabb, Object, OccluderMesh, Scene};
/// use visibility_hzb::{OccluderCriteria, OccluderDatabase};
/// let mut scene = Scene::new();
/// let wall = Aabb::from_arrays([0.0, 0.0, 0.0], [8.0, 0.2, 3.0]);
/// let clock = Aabb::from_arrays([4.0, 0.2, 2.0], [4.4, 0.24, 2.4]); // on the wall
/// for bounds in [wall, clock] {
///     let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
///     let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds)?);
///     scene.set_mesh(id, mesh, Affine3A::IDENTITY)?;
/// }
/// let database = OccluderDatabase::new(&scene, &OccluderCriteria::default());
/// assert_eq!(database.occluders().len(), 1);
/// assert_eq!(database.redundant(), 1);
/// database.apply(&mut scene)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct OccluderDatabase {
    /// Objects that satisfy all criteria, to be drawn as occluders, in ascending order of id.
    occluders: Vec<ObjectId>,
    /// Objects that are flagged as occluders and have a mesh, but were rejected by the criteria, in no
    /// particular order.
    others: Vec<ObjectId>,
    /// Number of objects in `others` that were rejected because they are smaller than
    /// [`OccluderCriteria::min_size`].
    small: usize,
    /// Number of objects in `others` that were rejected because they have more triangles than
    /// [`OccluderCriteria::max_triangles`].
    complex: usize,
    /// Number of objects in `others` that were rejected because larger occluders lie close to them; see
    /// [`OccluderCriteria::redundancy`].
    redundant: usize,
}

/// Number of rows and of columns of test lines through an object: `GRID * GRID` lines along each axis.
const GRID: usize = 4;
/// Limits on the occluders that are examined as backing (close behind or in front) of one object. Element 0:
/// the number of nearby occluders at which the search stops. Element 1: the maximum number of the found
/// occluders that are tested against the test lines through the object; the largest are taken.
const NEIGHBOURS: [usize; 2] = [1024, 32];

impl OccluderDatabase {
    /// Classifies all objects of `scene` that are flagged as occluders and have a mesh. Other objects are
    /// ignored. Takes about a microsecond for each triangle near other occluders, so call it while loading.
    /// Where thousands of occluders lie within one another, the time grows with the square of their number.
    pub fn new(scene: &Scene, criteria: &OccluderCriteria) -> Self {
        let mut new = Self::default();
        let mut sized = Vec::new();
        for id in scene.ids() {
            let Some((mesh, _)) =
                scene.occluder(id).filter(|_| scene.object(id).is_ok_and(|object| object.occluder))
            else {
                continue;
            };
            let area = area(scene, id);
            // The negated comparison rejects objects of NaN area.
            if !(area >= criteria.min_size * criteria.min_size) {
                new.small += 1;
            } else if mesh.triangles().len() > criteria.max_triangles {
                new.complex += 1;
            } else {
                sized.push((area, id));
                continue;
            }
            new.others.push(id);
        }
        sized.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        // Larger objects are tested first, so that of two objects that back each other the larger one stays.
        let mut rank = alloc::vec![u32::MAX; scene.index_limit()];
        for (place, &(_, id)) in sized.iter().enumerate() {
            if backed_share(scene, id, &rank) >= criteria.redundancy {
                new.redundant += 1;
                new.others.push(id);
            } else {
                rank[id.index()] = place as u32;
                new.occluders.push(id);
            }
        }
        new.occluders.sort_unstable();
        new
    }

    /// Returns the accepted occluders in ascending order of id. Empty if the scene has none.
    pub fn occluders(&self) -> &[ObjectId] {
        &self.occluders
    }

    /// Returns the number of objects that were left out because they are smaller than
    /// [`OccluderCriteria::min_size`].
    pub fn small(&self) -> usize {
        self.small
    }

    /// Returns the number of objects that were left out because they have more triangles than
    /// [`OccluderCriteria::max_triangles`].
    pub fn complex(&self) -> usize {
        self.complex
    }

    /// Returns the number of objects that were left out because larger occluders close behind or in front of
    /// them make them redundant; see [`OccluderCriteria::redundancy`].
    pub fn redundant(&self) -> usize {
        self.redundant
    }

    /// Clears the occluder flag of all objects of `scene` that were left out.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if a left-out object is not, or no longer, in `scene`. Flags that were
    /// cleared before the error stay cleared.
    pub fn apply(&self, scene: &mut Scene) -> Result<(), SceneError> {
        self.others.iter().try_for_each(|&id| scene.set_occluder(id, false))
    }
}

/// Returns the triangles of an occluder in scene coordinates. Empty if the object has no mesh.
fn triangles(scene: &Scene, id: ObjectId) -> impl Iterator<Item = [Vec3; 3]> + '_ {
    let placed = scene.occluder(id).into_iter();
    placed.flat_map(|(mesh, transform)| {
        let corner = |i: u32| transform.transform_point3(mesh.positions()[i as usize]);
        mesh.triangles().iter().map(move |t| t.map(corner))
    })
}

/// Returns the largest of the three areas, in square metres, that an occluder shows along the x, y and z
/// axis: half the summed projections of its triangles for a closed mesh, all of them for an open one, and
/// never more than the face of its bounds. 0 if the object has no mesh.
fn area(scene: &Scene, id: ObjectId) -> f32 {
    let (Ok(bounds), Some((mesh, _))) = (scene.bounds(id), scene.occluder(id)) else { return 0.0 };
    let mut shown = Vec3::ZERO;
    for [a, b, c] in triangles(scene, id) {
        shown += (b - a).cross(c - a).abs() * 0.5;
    }
    // A closed mesh shows either its front or its back.
    let shown = if mesh.is_closed() { shown * 0.5 } else { shown };
    shown.min(faces(&bounds)).max_element()
}

/// Returns the areas, in square metres, of the faces of a box that are perpendicular to the x, y and z axis.
fn faces(bounds: &Aabb) -> Vec3 {
    let extent = bounds.max - bounds.min;
    Vec3::new(extent.y * extent.z, extent.z * extent.x, extent.x * extent.y)
}

/// Returns the fraction, 0 to 1, of an object that larger occluders back: the fraction of lines through the
/// object that meet a larger occluder, averaged over the three axes with the areas of the object's bounds
/// across each axis as weights. `rank` gives, by object index, the position of an accepted occluder in
/// descending order of area, and `u32::MAX` for all other objects. NaN if the object's bounds have no area; 0
/// if the object is not in the scene.
fn backed_share(scene: &Scene, id: ObjectId, rank: &[u32]) -> f32 {
    let Ok(bounds) = scene.bounds(id) else { return 0.0 };
    let near = (bounds.max - bounds.min).max_element() / 8.0;
    let reach = Aabb::new(bounds.min - near, bounds.max + near);
    let neighbours = neighbours(scene, id, &reach, rank);
    let weights = faces(&bounds);
    let mut share = 0.0;
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut met = 0u32;
        for i in 0..GRID * GRID {
            let at = |axis: usize, step: usize| {
                let part = (step as f32 + 0.5) / GRID as f32;
                bounds.min[axis] + (bounds.max[axis] - bounds.min[axis]) * part
            };
            let line = Line { axes: [u, v, axis], at: [at(u, i % GRID), at(v, i / GRID)], reach: &reach };
            let meets = |&other: &ObjectId| triangles(scene, other).any(|t| line.meets(&t));
            met += u32::from(neighbours.iter().any(meets));
        }
        share += weights[axis] * met as f32 / (GRID * GRID) as f32;
    }
    share / weights.element_sum()
}

/// Returns the largest accepted occluders whose bounds meet the box `reach` (scene coordinates), in
/// descending order of area, without object `id`. Touching boxes meet. `rank` gives, by object index, the
/// position of an accepted occluder in descending order of area, and `u32::MAX` for other objects.
/// [`NEIGHBOURS`] limits the search and the result.
fn neighbours(scene: &Scene, id: ObjectId, reach: &Aabb, rank: &[u32]) -> Vec<ObjectId> {
    let (mut found, mut nodes) = (Vec::new(), Vec::new());
    let mut next = Some(None);
    while let Some(node) = next {
        SceneHierarchy.for_each_child(scene, node, &mut |child, bounds| {
            let apart = bounds.min.cmpgt(reach.max) | bounds.max.cmplt(reach.min);
            match child {
                _ if apart.any() => {}
                Child::Node(below) => nodes.push(below),
                Child::Object(other) if other != id && rank[other.index()] != u32::MAX => found.push(other),
                Child::Object(_) => {}
            }
        });
        next = if found.len() < NEIGHBOURS[0] { nodes.pop().map(Some) } else { None };
    }
    found.sort_unstable_by_key(|other| rank[other.index()]);
    found.truncate(NEIGHBOURS[1]);
    found
}

/// A test line parallel to one of the axes, in metres in scene coordinates, limited to the extent of a box on
/// that axis.
struct Line<'a> {
    /// Axis indices (0, 1, 2 for x, y, z): the two axes across the line, then the axis along the line.
    axes: [usize; 3],
    /// Coordinates of the line on the two axes across it, in metres.
    at: [f32; 2],
    /// Box, in scene coordinates, that bounds the line along its axis. Only the box's extent on that axis is
    /// used.
    reach: &'a Aabb,
}

impl Line<'_> {
    /// Returns whether the line meets the triangle `[a, b, c]` within `reach`. A touched edge or corner
    /// counts. False if the triangle is parallel to the line.
    fn meets(&self, [a, b, c]: &[Vec3; 3]) -> bool {
        let [u, v, w] = self.axes;
        let turn = |p: &Vec3, q: &Vec3| {
            (p[u] - self.at[0]) * (q[v] - self.at[1]) - (p[v] - self.at[1]) * (q[u] - self.at[0])
        };
        let [x, y, z] = [turn(b, c), turn(c, a), turn(a, b)];
        let sum = x + y + z;
        let inside = (x >= 0.0 && y >= 0.0 && z >= 0.0) || (x <= 0.0 && y <= 0.0 && z <= 0.0);
        let height = (a[w] * x + b[w] * y + c[w] * z) / sum;
        inside && height >= self.reach.min[w] && height <= self.reach.max[w]
    }
}
