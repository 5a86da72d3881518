//! One frame of an engine: finds the occluders in view, sorts and draws them into a z-buffer, and tests boxes
//! against it through the hierarchy.

use super::scene_file::Visc;
use glam::{Affine3A, DVec3};
use std::time::{Duration, Instant};
use visibility_core::random::Random;
use visibility_core::{
    Aabb, Accuracy, Culler, FrustumCuller, Object, OccluderMesh, OcclusionCuller, OcclusionMap, Scene, View,
    VisibleSet,
    occlusion::{MeshError, Occlusion, Occlusion64},
    scene::Boxes64,
    view::Eye,
};
use visibility_hzb::{Coverage, Hzb, SizeError};

/// Occlusion map that is filled from outside the culler. Its `begin`, `add` and `flush` do nothing, so a
/// culler only tests against the map.
#[derive(Clone, Debug)]
struct Filled(Hzb);

impl OcclusionMap for Filled {
    fn name(&self) -> &str {
        self.0.name()
    }
    fn accuracy(&self) -> Accuracy {
        self.0.accuracy()
    }
    fn begin(&mut self, _: &View, _: DVec3) {}
    fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}
    fn flush(&mut self) {}
    fn test(&self, bounds: &Aabb) -> Occlusion {
        self.0.test(bounds)
    }
    fn test_64(&self, boxes: &Boxes64, candidates: u64) -> Occlusion64 {
        self.0.test_64(boxes, candidates)
    }
}

/// Occluders and boxes of a VISC file, with all state kept between frames.
pub struct Stage {
    /// Scene of the occluders, to find those in view. Object `i` is `meshes[i]`.
    occluders: Scene,
    /// Occluder meshes in scene-relative space (which here equals world space), shuffled.
    meshes: Vec<OccluderMesh>,
    /// Objects of `occluders` in the view frustum of the last frame.
    in_view: VisibleSet,
    /// Sort keys of the occluders in view, nearest first: the bits of the squared distance above the index
    /// into `meshes`.
    order: Vec<u64>,
    frustum: FrustumCuller,
    boxes: Scene,
    culler: OcclusionCuller<Filled>,
    visible: VisibleSet,
}

/// Wall-clock times of the two halves of one frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Times {
    /// Time to find, sort and draw the occluders.
    pub raster: Duration,
    /// Time to test the boxes.
    pub query: Duration,
}

impl Stage {
    /// Creates a stage whose occluders are the file's triangles, twelve to an occluder. `size` is the
    /// z-buffer's width and height in pixels.
    ///
    /// The occluders are shuffled, because the order in a file may suit its views, while an engine's order
    /// does not.
    ///
    /// # Errors
    ///
    /// Returns [`StageError`] when twelve triangles do not make an occluder, or the z-buffer cannot have this
    /// size.
    pub fn new(visc: &Visc, size: [usize; 2], coverage: Coverage) -> Result<Self, StageError> {
        let mut meshes = Vec::new();
        for triangles in visc.triangles.chunks(12) {
            meshes.push(OccluderMesh::from_triangles(triangles)?);
        }
        shuffle(&mut meshes);
        let mut occluders = Scene::new();
        occluders.insert_batch(meshes.iter().map(|mesh| Object::new(*mesh.bounds())));
        occluders.rebuild();
        let mut boxes = Scene::new();
        boxes.insert_batch(visc.boxes.iter().map(|b| Object { occluder: false, ..Object::new(*b) }));
        boxes.rebuild();
        let map = Filled(Hzb::new(size[0], size[1])?.with_coverage(coverage));
        Ok(Self {
            occluders,
            meshes,
            in_view: VisibleSet::new(),
            order: Vec::new(),
            frustum: FrustumCuller::new(),
            boxes,
            culler: OcclusionCuller::new(map).with_price(0),
            visible: VisibleSet::new(),
        })
    }

    /// Culls the boxes for one view, and returns the times of the frame. The answer is available from
    /// [`answer`](Self::answer) until the next frame.
    pub fn run(&mut self, view: &View) -> Times {
        let start = Instant::now();
        self.in_view.fill(&self.occluders, view);
        self.frustum.cull(&self.occluders, view, &mut self.in_view);
        self.sort(view);
        let hzb = &mut self.culler.map_mut().0;
        hzb.begin(view, self.occluders.origin());
        for key in &self.order {
            hzb.add(&self.meshes[*key as u32 as usize], &Affine3A::IDENTITY);
        }
        hzb.flush();
        let drawn = Instant::now();
        self.visible.fill(&self.boxes, view);
        self.culler.cull(&self.boxes, view, &mut self.visible);
        Times { raster: drawn - start, query: drawn.elapsed() }
    }

    /// Sorts the occluders in view by the distance of the nearest point of their bounds from the eye.
    fn sort(&mut self, view: &View) {
        let eye = view.eye(self.occluders.origin());
        self.order.clear();
        self.in_view.iter(&self.occluders).for_each(|id| {
            let bounds = self.meshes[id.index()].bounds();
            let distance = match eye {
                Eye::Point(eye) => {
                    let eye = eye.as_vec3();
                    eye.clamp(bounds.min, bounds.max).distance_squared(eye)
                }
                // Any order gives correct answers. In a parallel view, this key sorts front to back among
                // occluders with positive depth.
                Eye::Direction(along) => bounds.center().dot(along.as_vec3()).max(0.0),
            };
            self.order.push(u64::from(distance.to_bits()) << 32 | id.index() as u64);
        });
        self.order.sort_unstable();
    }

    /// Returns for each box, by its index in the file, whether it was found visible in the last frame. False
    /// for all boxes before the first frame.
    pub fn answer(&self) -> Vec<bool> {
        let mut answer = vec![false; self.boxes.len()];
        for id in self.visible.iter(&self.boxes) {
            answer[id.index()] = true;
        }
        answer
    }

    /// Returns the z-buffer with the occluders of the last frame in it. Empty before the first frame.
    pub fn map(&self) -> &Hzb {
        &self.culler.map().0
    }
}

/// Reason why a stage cannot be created.
#[derive(Debug)]
pub enum StageError {
    /// Twelve triangles that do not make an occluder.
    Mesh(MeshError),
    /// Width or height that the z-buffer cannot have.
    Size(SizeError),
}

impl std::fmt::Display for StageError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Mesh(error) => error.fmt(f),
            Self::Size(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for StageError {}

impl From<MeshError> for StageError {
    fn from(error: MeshError) -> Self {
        Self::Mesh(error)
    }
}

impl From<SizeError> for StageError {
    fn from(error: SizeError) -> Self {
        Self::Size(error)
    }
}

/// Shuffles a slice into an order that depends only on its length (Fisher and Yates).
fn shuffle<T>(items: &mut [T]) {
    let mut random = Random(1);
    for i in (1..items.len()).rev() {
        items.swap(i, random.below(i + 1));
    }
}
