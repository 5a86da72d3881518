//! World to cull: a scene source converted to a [`Scene`], with a [`View`] for every frame.

use super::prepared::Prepared;
use crate::eprintln;
use crate::pvs::built;
use crate::source::{SourceCells, SourceObject};
use crate::{SceneSource, SourceError, frames};
use glam::{DVec3, Vec3};
use std::borrow::Cow;
use std::sync::OnceLock;
use std::time::Instant;
use visibility_core::{
    ObjectId, Pose, Scene, View, cells::CellId, occlusion::Preparation, pvs::Viewcells, simd::Simd,
    view::ViewError,
};
use visibility_measure::{DrawnObject, SampledVisibility};

/// Scene and views that cullers work on, with the source that they came from.
pub struct World {
    /// Source that the scene was made from, with names, triangles and axes.
    pub source: SceneSource,
    /// Scene for the cullers. Object `i` of the source has index `i`.
    pub scene: Scene,
    /// Views of all frames, walk after walk.
    pub views: Vec<View>,
    /// Camera pose of each frame and the index of its walk, for pictures. Empty if nothing is drawn.
    pub poses: Vec<(Pose, usize)>,
    /// Width and height in pixels of the picture that the views render.
    pub size: (u32, u32),
    /// Cache of the data that cullers precompute from the world.
    pub prepared: Prepared,
    /// Instruction set that cullers made for the world use, for tests: answers are the same with all. The
    /// widest of the processor for a new world.
    pub simd: Simd,
    /// Whether [`cells`](Self::cells) makes cells from the opaque triangles if the scene has none. False for
    /// a new world.
    pub makes_cells: bool,
    /// Whether [`cells`](Self::cells) prints nothing. False for a new world.
    pub is_quiet: bool,
    /// Cells made from the opaque triangles, or the reason why there are none. Empty until first asked for.
    made_cells: OnceLock<Result<SourceCells, String>>,
}

impl World {
    /// Creates a world with a view for every key of the walks, or for `count` frames spread evenly over the
    /// walks. `size` is the width and height of the picture in pixels.
    ///
    /// # Errors
    ///
    /// Returns [`WorldError::NoFrames`] when there are no frames, and [`WorldError::View`] when the camera of
    /// a frame is invalid.
    pub fn new(source: SceneSource, size: (u32, u32), count: Option<usize>) -> Result<Self, WorldError> {
        let keys = source.walks.iter().map(|walk| walk.keys.len()).sum();
        let frames = frames(&source.walks, count.unwrap_or(keys));
        if frames.is_empty() {
            return Err(WorldError::NoFrames);
        }
        let mut views = Vec::with_capacity(frames.len());
        let mut poses = Vec::with_capacity(frames.len());
        for (number, frame) in frames.iter().enumerate() {
            let walk = &source.walks[frame.walk];
            let (pose, view) = walk
                .view(frame.camera, source.near, size)
                .map_err(|error| WorldError::View { frame: number, error })?;
            views.push(view);
            poses.push((pose, frame.walk));
        }

        Ok(Self::with_views(source, views, poses, size))
    }

    /// Creates a world with given views, in world space. `poses` may be empty if nothing is drawn.
    ///
    /// # Panics
    ///
    /// Panics if the source's origin is not finite, or its cells do not match their graph.
    pub fn with_views(
        mut source: SceneSource,
        views: Vec<View>,
        poses: Vec<(Pose, usize)>,
        size: (u32, u32),
    ) -> Self {
        let mut scene = Scene::new();
        scene.set_origin(source.origin).expect("a finite origin");
        let ids = scene.insert_batch(source.objects.iter().map(SourceObject::object));
        let mut given = source.cells.as_mut();
        while let Some(cells) = given {
            let pairs = deep_enough(&scene, cells, objects_in_cells(&scene, &ids, &cells.viewcells));
            cells.graph.set_objects(pairs).expect("the cells are those of the graph");
            given = cells.with_doorways.as_deref_mut();
        }
        for (id, object) in ids.into_iter().zip(&source.objects) {
            scene.set_triangles(id, object.fixed_triangles()).expect("the object was just inserted");
        }
        // Built-in scenes and VSCN files are drawn from both sides and may have any winding, so their
        // occluders are two-sided.
        scene.prepare_occluders(&Preparation::default().with_two_sided(true));
        let (prepared, made_cells) = (Prepared::default(), OnceLock::new());
        let simd = Simd::best();
        let (makes_cells, is_quiet) = (false, false);
        Self { source, scene, views, poses, size, prepared, simd, makes_cells, is_quiet, made_cells }
    }

    /// Returns the objects in the form that the item buffer takes, by ascending index, which is their key.
    pub fn items(&self) -> impl Iterator<Item = DrawnObject<'_>> + Clone {
        (0..).zip(&self.source.objects).map(|(key, object)| DrawnObject {
            see_through: object.see_through,
            one_sided: object.one_sided,
            ..DrawnObject::from((key, object.triangles.view()))
        })
    }

    /// Returns an error if there are too many triangles for a method that copies the triangles of every
    /// instance.
    ///
    /// # Errors
    ///
    /// Returns a message with the number of triangles, if it is more than 2^25.
    pub fn check_copies(&self) -> Result<(), String> {
        self.source.check_copies()
    }

    /// Returns the scene for a judge that draws the triangles of the scene: objects that move have their
    /// triangles at rest, as in [`items`](Self::items). For cullers they have none.
    pub fn scene_at_rest(&self) -> Cow<'_, Scene> {
        let mut scene = Cow::Borrowed(&self.scene);
        for (id, object) in self.scene.ids().zip(&self.source.objects) {
            if object.motion.is_some() {
                let set = scene.to_mut().set_triangles(id, object.triangles.clone());
                set.expect("the object is in the scene");
            }
        }
        scene
    }

    /// Returns the object's index and the triangle for a triangle number of an item buffer that drew
    /// [`items`](Self::items), or some of them. `None` for an unknown number.
    pub fn drawn_triangle(&self, drawn: &SampledVisibility, item: u32) -> Option<(u32, [Vec3; 3])> {
        let object = drawn.objects()[drawn.object_of(item)?];
        let triangles = self.source.objects.get(object.key as usize)?.triangles.view();
        Some((object.key, triangles.get((item - object.first_triangle) as usize)?))
    }

    /// Returns the cells and portals of the scene, with the objects in each cell. If the scene has no cells
    /// and [`makes_cells`](Self::makes_cells) is true, the first call makes cells from its opaque triangles,
    /// and reports the result and the time on standard error. In these cells, gaps between triangles narrower
    /// than the [default tolerance](visibility_portals::from_geometry::PolygonSettings::with_tolerance) count
    /// as closed.
    ///
    /// # Errors
    ///
    /// Returns a message if the scene has no cells, and cells cannot or must not be made.
    pub fn cells(&self) -> Result<&SourceCells, String> {
        if let Some(cells) = &self.source.cells {
            return Ok(cells);
        }
        if !self.makes_cells {
            return Err("this scene has no cells and portals".to_owned());
        }
        self.made_cells.get_or_init(|| self.make_cells()).as_ref().map_err(Clone::clone)
    }

    /// Makes cells from the opaque triangles of the scene, and lists the objects in each. Prints a line
    /// before and a line after on standard error, and a warning if most cameras of the walks stand in the
    /// open.
    fn make_cells(&self) -> Result<SourceCells, String> {
        let name = &self.source.name;
        if !self.is_quiet {
            eprintln!("{name} brings no cells: making cells and portals from its opaque triangles ...");
        }
        let start = Instant::now();
        let mut cells = built::cells(&self.source, built::Origin::Polygons)?;
        let ids: Vec<ObjectId> = self.scene.ids().collect();
        let pairs = objects_in_cells(&self.scene, &ids, &cells.viewcells);
        cells.graph.set_objects(pairs).map_err(|error| error.to_string())?;
        if self.is_quiet {
            return Ok(cells);
        }
        eprintln!(
            "{name}: {} cells and {} portals made in {:.2} s",
            cells.graph.cell_count(),
            cells.graph.portals().len(),
            start.elapsed().as_secs_f64()
        );
        let eyes = || self.source.walks.iter().flat_map(|walk| &walk.keys).map(|key| key.eye);
        let is_open = |&eye: &DVec3| {
            let cell = cells.viewcells.locate(eye);
            cell.is_none_or(|cell| cells.names[cell.index()].ends_with("outside"))
        };
        let (open, all) = (eyes().filter(is_open).count(), eyes().count());
        if 2 * open > all {
            eprintln!(
                "{name}: {open} of {all} cameras stand in the open, where cells hide little; \
                 --cullers hzb,horizon,view-cdt compares what suits such scenes better"
            );
        }
        Ok(cells)
    }

    /// Returns the cells and portals for culling from a point: with an additional cell per doorway if
    /// doorways are known, otherwise those of [`cells`](Self::cells).
    ///
    /// # Errors
    ///
    /// Returns a message if the scene has no cells.
    pub fn cells_to_look_through(&self) -> Result<&SourceCells, String> {
        self.cells().map(|cells| cells.with_doorways.as_deref().unwrap_or(cells))
    }

    /// Returns the scene's origin in world space, to which scene coordinates are relative.
    pub fn origin(&self) -> DVec3 {
        self.scene.origin()
    }
}

/// Returns all pairs of a cell and an object whose bounds meet or touch the cell. A wall between two rooms is
/// in both. Pairs are grouped by object.
pub fn objects_in_cells(scene: &Scene, ids: &[ObjectId], viewcells: &Viewcells) -> Vec<(CellId, ObjectId)> {
    let mut pairs = Vec::new();
    for &id in ids {
        let Ok(bounds) = scene.bounds(id) else { continue };
        let [min, max] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3() + scene.origin());
        // Tolerance, because cells have f64 coordinates while bounds are rounded to f32, relative to the
        // origin.
        let [near, far] = [bounds.min.abs().max(bounds.max.abs()).as_dvec3(), min.abs().max(max.abs())];
        let slack = 1e-6 * near.max_element() + 16.0 * f64::EPSILON * far.max_element();
        viewcells.for_each_touching(min - slack, max + slack, |cell| pairs.push((CellId(cell.0), id)));
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
    /// There are no frames: the scene has no camera walk, or zero frames were asked for.
    NoFrames,
    /// The camera of a frame is invalid.
    View {
        /// Index of the frame among all frames of the walks.
        frame: usize,
        /// Reason why the camera gives no valid view.
        error: ViewError,
    },
    /// The source could not be made or read.
    Source(SourceError),
}

impl std::fmt::Display for WorldError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoFrames => write!(
                f,
                "there is no frame to walk through: no walk, nothing to walk around, or no frame asked for"
            ),
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
