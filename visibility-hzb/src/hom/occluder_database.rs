//! The occluder database: which objects of a scene are worth drawing as occluders, found once when it is
//! loaded.
//!
//! By the three criteria of Zhang, Manocha, Hudson and Hoff ("Visibility Culling using Hierarchical Occlusion
//! Maps", 1997). Small objects hide little. Objects close to a larger occluder, as a clock on a wall, hide
//! little that it does not. Objects of many triangles cost much to draw. Leaving out an occluder is always
//! safe, so none of this needs to be exact.

use alloc::vec::Vec;
use visibility_core::glam::Vec3;
use visibility_core::{
    Aabb, ObjectId, Scene,
    scene::SceneError,
    walk::{BoxHierarchy, Child, SceneHierarchy},
};

/// Which objects an [`OccluderDatabase`] leaves out.
///
/// ```
/// use visibility_hzb::OccluderCriteria;
/// let criteria = OccluderCriteria { least_size: 1.0, ..OccluderCriteria::default() };
/// assert_eq!(criteria.most_triangles, 1024);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct OccluderCriteria {
    /// Side of a square, in units of the scene. Objects whose area, seen along each of the three axes, is
    /// smaller than this square are too small.
    pub least_size: f32,
    /// The most triangles that an occluder may have.
    pub most_triangles: usize,
    /// Objects are redundant if at least this share of them is backed by larger occluders: of lines through
    /// the object along the axes, the share that meets a larger occluder no farther away than an eighth of
    /// the object's longest side. Above 1, no object is redundant.
    pub redundancy: f32,
}

impl Default for OccluderCriteria {
    /// A quarter of a unit, 1024 triangles, three quarters.
    fn default() -> Self {
        Self { least_size: 0.25, most_triangles: 1024, redundancy: 0.75 }
    }
}

/// The objects of a scene that are worth drawing as occluders.
///
/// It is a list of ids: objects that are moved, added or removed later do not change it.
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
    /// Objects worth drawing, ascending.
    occluders: Vec<ObjectId>,
    /// Occluders that were left out.
    others: Vec<ObjectId>,
    /// How many of these are too small.
    small: usize,
    /// How many of these have too many triangles.
    complex: usize,
    /// How many of these are redundant.
    redundant: usize,
}

/// Lines along each axis are cast through a grid of this many points by this many.
const GRID: usize = 4;
/// The most occluders that are looked at for backing one object, and the most of these, the largest, that
/// lines are cast at.
const NEIGHBOURS: [usize; 2] = [1024, 32];

impl OccluderDatabase {
    /// Sorts all objects that are flagged as occluders and have a mesh. Takes about a microsecond for each
    /// triangle near other occluders: for loading time. Where thousands of occluders lie within one another,
    /// each is near all, and the time grows with the square of their number.
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
            // NaN counts as small.
            if !(area >= criteria.least_size * criteria.least_size) {
                new.small += 1;
            } else if mesh.triangles().len() > criteria.most_triangles {
                new.complex += 1;
            } else {
                sized.push((area, id));
                continue;
            }
            new.others.push(id);
        }
        sized.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        // Larger ones first, so that of two that back each other the larger stays.
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

    /// The objects worth drawing, in ascending order.
    pub fn occluders(&self) -> &[ObjectId] {
        &self.occluders
    }

    /// Number of objects left out as too small.
    pub fn small(&self) -> usize {
        self.small
    }

    /// Number of objects left out for their number of triangles.
    pub fn complex(&self) -> usize {
        self.complex
    }

    /// Number of objects left out as backed by larger ones.
    pub fn redundant(&self) -> usize {
        self.redundant
    }

    /// Clears the occluder flag of all objects that were left out.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if one of them is not in the scene, or no longer. Those before it have
    /// lost their flags then.
    pub fn apply(&self, scene: &mut Scene) -> Result<(), SceneError> {
        self.others.iter().try_for_each(|&id| scene.set_occluder(id, false))
    }
}

/// An occluder's triangles in scene coordinates; none if it has no mesh.
fn triangles(scene: &Scene, id: ObjectId) -> impl Iterator<Item = [Vec3; 3]> + '_ {
    let placed = scene.occluder(id).into_iter();
    placed.flat_map(|(mesh, transform)| {
        let corner = |i: u32| transform.transform_point3(mesh.positions()[i as usize]);
        mesh.triangles().iter().map(move |t| t.map(corner))
    })
}

/// The largest area that an occluder shows along an axis: of its triangles, at most the face of its bounds. 0
/// for objects without a mesh.
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

/// Areas of the faces of a box across each axis.
fn faces(bounds: &Aabb) -> Vec3 {
    let extent = bounds.max - bounds.min;
    Vec3::new(extent.y * extent.z, extent.z * extent.x, extent.x * extent.y)
}

/// The share of an object that is backed by larger occluders, those whose `rank` is not `u32::MAX`: of lines
/// through it along each axis, weighted by the area of its face across that axis. NaN if its bounds have no
/// area.
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

/// The largest of the ranked occluders whose bounds meet a box, without `id` itself.
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

/// A line along an axis, within a box.
struct Line<'a> {
    /// The two axes across the line, then the one along it.
    axes: [usize; 3],
    /// Its coordinates on the first two.
    at: [f32; 2],
    /// The part of it that lies in this box counts.
    reach: &'a Aabb,
}

impl Line<'_> {
    /// Whether it meets a triangle.
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
