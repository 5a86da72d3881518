//! Small engine that uses only the public functions of the library: moving instances of few meshes, two eyes,
//! four shadow cascades, levels of detail, draw lists and streaming. Each method is one step of a frame.

use crate::streaming_cache::Cache;
use glam::{Affine3A, DVec3, Quat, Vec3};
use visibility_core::{Aabb, FrustumCuller, ObjectId, OccluderMesh, Pipeline, Pose, Scene, View, VisibleSet};
use visibility_frame::casters::{CasterCuller, Light};
use visibility_frame::draw_list::{DrawIndexedIndirect, DrawList};
use visibility_frame::lod::{ContributionCuller, LodSelector};
use visibility_hzb::{Hzb, HzbCuller};

/// Number of instances.
const INSTANCES: usize = 50_000;
/// Number of instances that move in each frame; the rest stand still.
pub const MOVING: usize = 48_700;
/// Number of meshes that the instances share.
const MESHES: usize = 200;
/// Number of opaque meshes, whose instances occlude. They are the first ones.
const OCCLUDER_MESHES: usize = 40;
/// Number of levels of detail of a mesh.
const LEVELS: usize = 3;
/// Sizes on screen in pixels at which the level of detail changes.
const LEVEL_SIZES: [f32; LEVELS - 1] = [120.0, 30.0];
/// Height of the picture in pixels.
const PICTURE_HEIGHT: f64 = 1080.0;
/// Least height on screen in pixels of an object that is drawn.
const LEAST_PIXELS: f64 = 1.0;
/// Distance between the two eyes in metres.
const EYE_DISTANCE: f64 = 0.064;
/// Boundaries of the shadow cascades: distances from the eye in metres.
const CASCADES: [f64; 5] = [0.1, 12.0, 40.0, 120.0, 400.0];
/// Budget of one call of [`Scene::maintain`], in blocks of objects.
const MAINTENANCE: usize = 64;
/// Duration of a frame in seconds.
const FRAME: f32 = 1.0 / 60.0;

/// Movement of an instance: it turns on the spot and circles around a centre.
#[derive(Clone, Copy)]
struct Mover {
    id: ObjectId,
    center: Vec3,
    /// Radius of the circle in metres; 0 for an instance that stands still.
    radius: f32,
    /// Angular speed in radians per frame.
    speed: f32,
    phase: f32,
}

impl Mover {
    /// Returns the transform from mesh to scene coordinates in a frame.
    fn transform(&self, frame: usize) -> Affine3A {
        let angle = self.phase + self.speed * frame as f32;
        let at = self.center + Vec3::new(angle.cos(), angle.sin(), 0.0) * self.radius;
        Affine3A::from_rotation_translation(Quat::from_rotation_z(angle), at)
    }
}

/// View of one camera or cascade with the cullers and the result that belong to it.
struct Camera {
    view: View,
    pipeline: Pipeline,
    visible: VisibleSet,
}

impl Camera {
    fn new(pipeline: Pipeline) -> Self {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).expect("a valid camera");
        Self { view, pipeline, visible: VisibleSet::new() }
    }

    fn cull(&mut self, scene: &Scene) {
        self.pipeline.cull(scene, &self.view, &mut self.visible);
    }
}

/// The engine's world, and all state that it keeps between frames.
pub struct Engine {
    scene: Scene,
    movers: Vec<Mover>,
    /// Mesh of each instance, by object index.
    meshes: Vec<u32>,
    /// Transforms of this frame, as columns of 3x4 matrices, the layout of another math library.
    transforms: Vec<(ObjectId, [f32; 12])>,
    eyes: [Camera; 2],
    cascades: [Camera; 4],
    /// Objects that at least one eye sees, with the objects that appeared and vanished since the last frame.
    visible: VisibleSet,
    lods: LodSelector,
    /// Level of detail of each visible instance, by object index.
    levels: Vec<u8>,
    draws: DrawList,
    shadow_draws: [DrawList; 4],
    commands: Vec<DrawIndexedIndirect>,
    /// One bit per object index: whether the object is visible. For the GPU.
    bits: Vec<u32>,
    cache: Cache,
    frame: usize,
}

/// Counts of one frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// Number of instances that at least one eye sees.
    pub visible: usize,
    /// Number of indirect draw calls of the picture.
    pub draws: usize,
    /// Number of instances drawn into shadow maps, summed over the cascades.
    pub casters: usize,
    /// Number of instances that the streaming cache holds.
    pub loads: u64,
}

impl Engine {
    /// Builds the world: instances on a grid with streets between them. Each mesh is a box of its own size.
    ///
    /// # Errors
    /// Any error of the library; none is expected.
    pub fn new() -> Result<Self, Box<dyn std::error::Error>> {
        let mut scene = Scene::new();
        let sizes: Vec<Vec3> = (0..MESHES)
            .map(|mesh| Vec3::new(0.4 + 0.02 * (mesh % 37) as f32, 0.4 + 0.03 * (mesh % 23) as f32, 1.0))
            .map(|half| if half.x < 0.6 { half * 3.0 } else { half })
            .collect();
        let local = |mesh: usize| Aabb::new(-sizes[mesh], sizes[mesh]);
        let occluders = (0..OCCLUDER_MESHES)
            .map(|mesh| OccluderMesh::cuboid(&local(mesh)).map(|mesh| scene.add_mesh(mesh)))
            .collect::<Result<Vec<_>, _>>()?;
        let side = INSTANCES.isqrt() + 1;
        let mut movers = Vec::with_capacity(INSTANCES);
        let mut meshes = Vec::with_capacity(INSTANCES);
        let ids = scene.insert_batch((0..INSTANCES).map(|_| Aabb::EMPTY));
        for (i, id) in ids.into_iter().enumerate() {
            let (mesh, moves) = (i * 7 % MESHES, i < MOVING);
            let at = |cell: usize| (cell as f32 - side as f32 / 2.0) * 5.0;
            let mover = Mover {
                id,
                center: Vec3::new(at(i % side), at(i / side), sizes[mesh].z),
                radius: if moves { 0.5 + 0.1 * (i % 13) as f32 } else { 0.0 },
                speed: if moves { 0.01 + 0.001 * (i % 31) as f32 } else { 0.0 },
                phase: i as f32,
            };
            scene.set_local_bounds(id, local(mesh))?;
            if let Some(&occluder) = occluders.get(mesh) {
                scene.set_mesh(id, occluder, mover.transform(0))?;
                scene.set_occluder(id, true)?;
            } else {
                scene.set_transform(id, mover.transform(0))?;
            }
            meshes.push(mesh as u32);
            movers.push(mover);
        }
        scene.rebuild();
        let eye = || -> Result<_, Box<dyn std::error::Error>> {
            let contribution = ContributionCuller::new(PICTURE_HEIGHT, LEAST_PIXELS);
            let occlusion = HzbCuller::new(Hzb::new(320, 192)?);
            Ok(Camera::new(Pipeline::new().with(FrustumCuller::new()).with(contribution).with(occlusion)))
        };
        let sun = Light::Directional { toward_light: DVec3::new(0.4, 0.3, 1.0) };
        let cascade = || -> Result<_, Box<dyn std::error::Error>> {
            Ok(Camera::new(Pipeline::new().with(CasterCuller::new(sun)?)))
        };
        Ok(Self {
            eyes: [eye()?, eye()?],
            cascades: [cascade()?, cascade()?, cascade()?, cascade()?],
            visible: VisibleSet::new().with_changes(),
            lods: LodSelector::new(PICTURE_HEIGHT),
            levels: vec![0; scene.index_limit()],
            draws: DrawList::new(),
            shadow_draws: Default::default(),
            commands: Vec::with_capacity(MESHES * LEVELS),
            bits: vec![0; scene.index_limit().div_ceil(32)],
            cache: Cache::new(60),
            transforms: Vec::with_capacity(MOVING),
            movers,
            meshes,
            scene,
            frame: 0,
        })
    }

    /// Computes this frame's transforms and cameras, which is the engine's own work before it calls the
    /// library.
    pub fn simulate(&mut self) {
        self.frame += 1;
        self.transforms.clear();
        for mover in &self.movers[..MOVING] {
            self.transforms.push((mover.id, mover.transform(self.frame).to_cols_array()));
        }
        let angle = self.frame as f64 * 0.004;
        let middle = DVec3::new(150.0 * angle.cos(), 150.0 * angle.sin(), 3.0);
        let ahead = DVec3::new(-angle.sin(), angle.cos(), -0.02);
        let view = |at: DVec3, near: f64, far: f64| {
            View::perspective(Pose::look_at(at, at + ahead, DVec3::Z), 1.0, 16.0 / 9.0, near, far)
                .expect("a valid camera")
        };
        let right = ahead.cross(DVec3::Z).normalize() * (EYE_DISTANCE / 2.0);
        for (camera, at) in self.eyes.iter_mut().zip([middle - right, middle + right]) {
            camera.view = view(at, CASCADES[0], f64::INFINITY);
        }
        for (camera, ends) in self.cascades.iter_mut().zip(CASCADES.windows(2)) {
            camera.view = view(middle, ends[0], ends[1]);
        }
    }

    /// Moves boxes and occluders of all moving instances.
    ///
    /// # Errors
    /// Any error of the library; none is expected.
    pub fn move_instances(&mut self) -> Result<(), Box<dyn std::error::Error>> {
        Ok(self.scene.set_transforms_batch(&self.transforms)?)
    }

    /// Lets the scene tighten its hierarchy, within the budget of a frame.
    pub fn maintain(&mut self) {
        self.scene.maintain(MAINTENANCE);
    }

    /// Culls for both eyes, and unites their visible sets.
    pub fn cull_eyes(&mut self) {
        self.eyes.iter_mut().for_each(|eye| eye.cull(&self.scene));
        self.visible.clear(&self.scene);
        self.eyes.iter().for_each(|eye| self.visible.union(&self.scene, &eye.visible));
        self.visible.finish(&self.scene);
    }

    /// Chooses levels of detail from the left eye.
    pub fn select_levels(&mut self) {
        let Self { lods, scene, eyes, visible, levels, .. } = self;
        lods.select(scene, &eyes[0].view, visible, FRAME, |_| &LEVEL_SIZES);
        for &(id, lod) in lods.selected() {
            levels[id.index()] = lod.level;
        }
    }

    /// Groups the visible instances by mesh and level into indirect draw commands.
    pub fn list_draws(&mut self) {
        let (meshes, levels) = (&self.meshes, &self.levels);
        let key = |id: ObjectId| meshes[id.index()] * LEVELS as u32 + u32::from(levels[id.index()]);
        self.draws.group(self.visible.iter(&self.scene), key);
        self.commands.clear();
        self.commands.extend(self.draws.commands(|key| DrawIndexedIndirect {
            index_count: 36 << (2 * (LEVELS as u32 - 1 - key % LEVELS as u32)),
            first_index: key * 4096,
            ..Default::default()
        }));
    }

    /// Finds and groups the casters whose shadows reach each cascade.
    pub fn cull_cascades(&mut self) {
        for (cascade, draws) in self.cascades.iter_mut().zip(&mut self.shadow_draws) {
            cascade.cull(&self.scene);
            draws.group(cascade.visible.iter(&self.scene), |id| self.meshes[id.index()]);
        }
    }

    /// Writes one bit per object for the GPU.
    ///
    /// # Errors
    /// Any error of the library; none is expected.
    pub fn write_bits(&mut self) -> Result<(), Box<dyn std::error::Error>> {
        Ok(self.visible.write_bits(&self.scene, &mut self.bits)?)
    }

    /// Loads objects that appeared, and unloads objects that have been hidden for a second.
    pub fn stream(&mut self) {
        self.cache.update(&self.scene, &self.visible);
    }

    /// Returns the counts of the last frame.
    pub fn counts(&self) -> Counts {
        Counts {
            visible: self.visible.count(&self.scene),
            draws: self.commands.len(),
            casters: self.shadow_draws.iter().map(|draws| draws.instances().len()).sum(),
            loads: self.cache.traffic().loads,
        }
    }

    /// Returns the engine's scene, for tests.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Returns the objects that at least one eye saw in the last frame, for tests.
    pub fn visible(&self) -> &VisibleSet {
        &self.visible
    }
}
