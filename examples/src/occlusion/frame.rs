//! One frame as an engine would have it: occluders found in view, put in order and drawn; boxes tested
//! through the hierarchy.

use super::visc::Visc;
use glam::{Affine3A, DVec3};
use std::time::{Duration, Instant};
use visibility_core::{
    Aabb, Accuracy, Culler, FrustumCuller, Object, OccluderMesh, OcclusionCuller, OcclusionMap, Scene, View,
    VisibleSet,
    occlusion::{MeshError, Occlusion, Occlusion64},
    scene::Boxes64,
    view::Eye,
};
use visibility_hzb::{Coverage, Hzb, SizeError};

/// A map that has been filled by hand: to the culler that tests against it, it is finished.
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

/// The occluders and boxes of a file, ready to be culled frame after frame.
pub struct Stage {
    /// The occluders, for finding those in view.
    occluders: Scene,
    meshes: Vec<OccluderMesh>,
    in_view: VisibleSet,
    order: Vec<u64>,
    frustum: FrustumCuller,
    boxes: Scene,
    culler: OcclusionCuller<Filled>,
    visible: VisibleSet,
}

/// How long a frame took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Times {
    /// Finding and ordering occluders, and drawing them.
    pub raster: Duration,
    /// Testing boxes.
    pub query: Duration,
}

impl Stage {
    /// Takes every twelve triangles as one occluder. Shuffled, since no
    /// engine has its occluders in the order of a view that it does not know yet.
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
            culler: OcclusionCuller::new(map),
            visible: VisibleSet::new(),
        })
    }

    /// Culls one frame.
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

    /// Orders the occluders in view by the distance of their nearest points.
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
                // Any order is right; this one puts near ones first where depth is not negative.
                Eye::Direction(along) => bounds.center().dot(along.as_vec3()).max(0.0),
            };
            self.order.push(u64::from(distance.to_bits()) << 32 | id.index() as u64);
        });
        self.order.sort_unstable();
    }

    /// Whether each box was found visible in the last frame.
    pub fn answer(&self) -> Vec<bool> {
        let mut answer = vec![false; self.boxes.len()];
        for id in self.visible.iter(&self.boxes) {
            answer[id.index()] = true;
        }
        answer
    }

    /// The buffer as the last frame left it.
    pub fn map(&self) -> &Hzb {
        &self.culler.map().0
    }
}

/// Why a stage cannot be set up.
#[derive(Debug)]
pub enum StageError {
    /// Twelve triangles are no occluder.
    Mesh(MeshError),
    /// The buffer cannot have this size.
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

/// The same shuffle every time (Fisher and Yates; SplitMix64).
fn shuffle<T>(items: &mut [T]) {
    let mut state = 1u64;
    for i in (1..items.len()).rev() {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        items.swap(i, ((z ^ z >> 31) % (i as u64 + 1)) as usize);
    }
}
