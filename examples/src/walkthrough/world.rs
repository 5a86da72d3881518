//! World to cull: a scene source converted to a [`Scene`], with a [`View`] for every frame.

use super::prepared::Prepared;
use crate::source::SourceCells;
use crate::{SceneSource, SourceError, frames};
use glam::DVec3;
use visibility_core::{
    Aabb, Object, ObjectId, Pose, Scene, View, cells::CellId, occlusion::Preparation, pvs::Viewcells,
    view::ViewError,
};

/// Scene and views that cullers work on, with the source that they came from.
pub struct World {
    /// Source that the scene was made from, with names, triangles and axes.
    pub source: SceneSource,
    /// Scene for the cullers. Object `i` of the source has index `i`.
    pub scene: Scene,
    /// Views of all frames, walk after walk.
    pub views: Vec<View>,
    /// Camera pose of each frame and the index of its walk, for pictures. Empty where nothing is drawn.
    pub poses: Vec<(Pose, usize)>,
    /// Width and height in pixels of the picture that the views are for.
    pub size: (u32, u32),
    /// Cache of the data that cullers precompute from the world.
    pub prepared: Prepared,
}

impl World {
    /// Creates a world with a view for every key of the walks, or for `count` frames spread evenly over the
    /// walks. `size` is the width and height of the picture in pixels.
    ///
    /// # Errors
    ///
    /// Returns [`WorldError::NoFrames`] when there are no frames, and [`WorldError::View`] when the camera of
    /// a frame cannot be used.
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

    /// Creates a world with given views. Objects of the source are relative to `origin`, while cells and
    /// views are in world space. `poses` may be empty where nothing is drawn.
    ///
    /// # Panics
    ///
    /// Panics if `origin` is not finite, or the source's cells do not match their graph.
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
        // Occluders are two-sided: scenes are drawn with both faces, and files may have any winding.
        scene.prepare_occluders(&Preparation { two_sided: true, ..Preparation::default() });
        Self { source, scene, views, poses, size, prepared: Prepared::default() }
    }

    /// Returns the objects in the form that the item buffer takes: index and triangles, by ascending index.
    pub fn items(&self) -> impl Iterator<Item = (u32, &[[glam::Vec3; 3]])> + Clone {
        (0..).zip(self.source.objects.iter().map(|object| object.triangles.as_slice()))
    }

    /// Returns the cells and portals that the scene brings, with the objects in each cell.
    ///
    /// # Errors
    ///
    /// Returns a message if the scene has no cells.
    pub fn cells(&self) -> Result<&SourceCells, String> {
        self.source.cells.as_ref().ok_or_else(|| "this scene has no cells and portals".to_owned())
    }

    /// Returns the cells and portals for culling from a point: those with a cell per doorway where doorways
    /// are known, otherwise those of [`cells`](Self::cells).
    ///
    /// # Errors
    ///
    /// Returns a message if the scene has no cells.
    pub fn cells_to_look_through(&self) -> Result<&SourceCells, String> {
        self.cells().map(|cells| cells.with_doorways.as_deref().unwrap_or(cells))
    }

    /// Returns the world-space point that the scene's coordinates are relative to.
    pub fn origin(&self) -> DVec3 {
        self.scene.origin()
    }
}

/// Returns all pairs of a cell and an object whose bounds meet the cell, touching included: a wall between
/// two rooms is in both. Pairs are grouped by object. The cost is the number of objects times the number of
/// cells.
pub fn objects_in_cells(scene: &Scene, ids: &[ObjectId], viewcells: &Viewcells) -> Vec<(CellId, ObjectId)> {
    let mut pairs = Vec::new();
    for &id in ids {
        let Ok(bounds) = scene.bounds(id) else { continue };
        let [min, max] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3() + scene.origin());
        // Cells are made from coordinates of f64, while bounds have been rounded to f32.
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

/// Filters pairs that are grouped by object: keeps the pairs in which the object reaches at least
/// [`SourceCells::depth`] into the cell. If an object has no such pair, all its pairs are kept.
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

/// Reason why a world cannot be created.
#[derive(Debug)]
pub enum WorldError {
    /// No frames: the scene has no camera walk, or zero frames were asked for.
    NoFrames,
    /// Camera of a frame that cannot be used.
    View {
        /// Index of the frame among all frames of the walks.
        frame: usize,
        /// Reason why the camera gives no valid view.
        error: ViewError,
    },
    /// Source that could not be made or read.
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
