//! A scene source made into what cullers work on: a [`Scene`], and a [`View`] for every frame.

use super::prepared::Prepared;
use crate::source::SourceCells;
use crate::{SceneSource, SourceError, frames};
use glam::DVec3;
use visibility_core::{
    Aabb, Object, ObjectId, Pose, Scene, View, cells::CellId, occlusion::Preparation, pvs::Viewcells,
    view::ViewError,
};

/// A scene ready to be walked through.
pub struct World {
    /// Where it came from: names, triangles, axes.
    pub source: SceneSource,
    /// The culler's scene. Object `i` of the source has index `i`.
    pub scene: Scene,
    /// The views of all frames, all walks one after another.
    pub views: Vec<View>,
    /// The pose behind each view, and which walk it is on, for pictures.
    pub poses: Vec<(Pose, usize)>,
    /// Width and height of the picture that the views are for.
    pub size: (u32, u32),
    /// What cullers need made of it.
    pub prepared: Prepared,
}

impl World {
    /// Fills a scene and makes a view of every key of the walks, or of `count` frames spread evenly over
    /// them.
    pub fn new(source: SceneSource, size: (u32, u32), count: Option<usize>) -> Result<Self, WorldError> {
        let keys = source.walks.iter().map(|walk| walk.keys.len()).sum();
        let frames = frames(&source.walks, count.unwrap_or(keys));
        if frames.is_empty() {
            return Err(WorldError::NoFrames);
        }
        let aspect = f64::from(size.0) / f64::from(size.1);
        let mut views = Vec::with_capacity(frames.len());
        let mut poses = Vec::with_capacity(frames.len());
        for (number, frame) in frames.iter().enumerate() {
            let walk = &source.walks[frame.walk];
            let pose = Pose::look_at(frame.camera.eye, frame.camera.target, walk.up.as_dvec3());
            let fov_y = f64::from(walk.fov_y_degrees).to_radians();
            let view = View::perspective(pose, fov_y, aspect, f64::from(source.near), f64::INFINITY)
                .map_err(|error| WorldError::View { frame: number, error })?;
            views.push(view);
            poses.push((pose, frame.walk));
        }

        Ok(Self::with_views(source, DVec3::ZERO, views, poses, size))
    }

    /// The same with views made elsewhere, and an origin that the objects are relative to; `poses` may be
    /// empty where nothing is drawn.
    ///
    /// # Panics
    /// If the origin is not finite, or the cells are not those of their graph.
    pub fn with_views(
        mut source: SceneSource,
        origin: DVec3,
        views: Vec<View>,
        poses: Vec<(Pose, usize)>,
        size: (u32, u32),
    ) -> Self {
        let mut scene = Scene::new();
        scene.set_origin(origin).expect("a finite origin");
        let ids = scene.insert_batch(source.objects.iter().map(|object| Object {
            cost: u32::try_from(object.triangles.len()).unwrap_or(u32::MAX),
            occluder: object.opaque,
            ..Object::new(Aabb::from_points(object.triangles.iter().flatten().copied()))
        }));
        let mut given = source.cells.as_mut();
        while let Some(cells) = given {
            let pairs = deep_enough(&scene, cells, objects_in_cells(&scene, &ids, &cells.viewcells));
            cells.graph.set_objects(pairs).expect("the cells are those of the graph");
            given = cells.with_doorways.as_deref_mut();
        }
        for (id, object) in ids.into_iter().zip(&source.objects) {
            scene.set_triangles(id, object.triangles.as_slice()).expect("the object was just inserted");
        }
        // Scenes are drawn with both faces, and files are not to be trusted with the order of corners.
        scene.prepare_occluders(&Preparation { two_sided: true, ..Preparation::default() });
        Self { source, scene, views, poses, size, prepared: Prepared::default() }
    }

    /// The objects as the item buffer takes them: index and triangles, in order.
    pub fn items(&self) -> impl Iterator<Item = (u32, &[[glam::Vec3; 3]])> + Clone {
        (0..).zip(self.source.objects.iter().map(|object| object.triangles.as_slice()))
    }

    /// The cells and portals that the scene comes with, and the objects in each cell.
    ///
    /// # Errors
    /// Says so if there are none.
    pub fn cells(&self) -> Result<&SourceCells, String> {
        self.source.cells.as_ref().ok_or_else(|| "this scene has no cells and portals".to_owned())
    }

    /// The same, with cells for doorways where they are known: what is looked through from one point.
    ///
    /// # Errors
    /// Says so if there are none.
    pub fn cells_to_look_through(&self) -> Result<&SourceCells, String> {
        self.cells().map(|cells| cells.with_doorways.as_deref().unwrap_or(cells))
    }

    /// The point that everything is relative to.
    pub fn origin(&self) -> DVec3 {
        self.scene.origin()
    }
}

/// Each object with every cell that its box meets, touching included: a wall between two rooms is in both.
pub fn objects_in_cells(scene: &Scene, ids: &[ObjectId], viewcells: &Viewcells) -> Vec<(CellId, ObjectId)> {
    let mut pairs = Vec::new();
    for &id in ids {
        let Ok(bounds) = scene.bounds(id) else { continue };
        let [min, max] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3() + scene.origin());
        // Cells are made from coordinates of more digits than boxes have.
        let slack = 1e-6 * min.abs().max(max.abs()).max_element();
        let (middle, half) = ((min + max) * 0.5, (max - min) * 0.5 + slack);
        for (number, cell) in (0..).zip(viewcells.cells()) {
            let meets = cell.min.cmple(middle + half).all()
                && (middle - half).cmple(cell.max).all()
                && cell.planes.iter().all(|p| p.signed_distance(middle) + p.normal.abs().dot(half) >= 0.0);
            if meets {
                pairs.push((CellId(number), id));
            }
        }
    }
    pairs
}

/// Of objects in cells, grouped by object, those pairs in which the object reaches as far into the cell as
/// the source says; all pairs of an object that reaches so far into none.
fn deep_enough(
    scene: &Scene,
    cells: &SourceCells,
    pairs: Vec<(CellId, ObjectId)>,
) -> Vec<(CellId, ObjectId)> {
    let reaches = |&(cell, id): &(CellId, ObjectId)| {
        let cell = &cells.viewcells.cells()[cell.index()];
        scene.bounds(id).is_ok_and(|bounds| {
            let [min, max] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3() + scene.origin());
            (cell.min + cells.depth).cmple(max).all() && min.cmple(cell.max - cells.depth).all()
        })
    };
    let groups = pairs.chunk_by(|a, b| a.1 == b.1);
    groups
        .flat_map(|group| {
            let some = group.iter().any(reaches);
            group.iter().copied().filter(move |pair| !some || reaches(pair))
        })
        .collect()
}

/// Why a scene cannot be walked through.
#[derive(Debug)]
pub enum WorldError {
    /// The scene has no camera walk, or no frames were asked for.
    NoFrames,
    /// A frame's camera cannot be used.
    View {
        /// Which frame.
        frame: usize,
        /// What is wrong with it.
        error: ViewError,
    },
    /// The scene cannot be had.
    Source(SourceError),
}

impl std::fmt::Display for WorldError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoFrames => write!(f, "there is no frame to walk through: no walk, or none asked for"),
            Self::View { frame, error } => write!(f, "the camera of frame {frame}: {error}"),
            Self::Source(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for WorldError {}

impl From<SourceError> for WorldError {
    fn from(error: SourceError) -> Self {
        Self::Source(error)
    }
}
