//! Stages that remove hidden objects after the frustum, by name or as cells, and the pipelines made of them.

use crate::cells::Cells;
use crate::error::refused;
use pyo3::prelude::*;
use pyo3::types::PyString;
use std::sync::{Arc, RwLock};
use visibility_2d::horizon::{HorizonCuller, HorizonOccluders, UpAxis};
use visibility_bsp::{Occluders, OcclusionTreeCuller};
use visibility_core::scene::SceneCursor;
use visibility_core::{FrustumCuller, Pipeline, Scene};
use visibility_hzb::{Hzb, HzbCuller};
use visibility_occluders::LevelOccluders;
use visibility_portals::{SceneCells, SharedPortalCuller};

/// A stage of a pipeline after the frustum.
#[derive(Clone)]
pub(crate) enum Stage {
    ZBuffer,
    Horizon(UpAxis),
    OcclusionTree,
    Portals(Arc<RwLock<SceneCells>>),
}

impl PartialEq for Stage {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::ZBuffer, Self::ZBuffer) | (Self::OcclusionTree, Self::OcclusionTree) => true,
            (Self::Horizon(own), Self::Horizon(other)) => own == other,
            (Self::Portals(own), Self::Portals(other)) => Arc::ptr_eq(own, other),
            _ => false,
        }
    }
}

impl Stage {
    /// Whether the stage holds occluders as of one revision of the scene.
    fn has_occluders(&self) -> bool {
        matches!(self, Self::Horizon(_) | Self::OcclusionTree)
    }

    /// Accepts a name or cells.
    fn of(value: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(cells) = value.cast::<Cells>() {
            return Ok(Self::Portals(cells.get().shared()));
        }
        let name: Option<String> = value.extract().ok();
        match name.as_deref() {
            Some("z_buffer") => Ok(Self::ZBuffer),
            Some("horizon") => Ok(Self::Horizon(UpAxis::Z)),
            Some("horizon_y") => Ok(Self::Horizon(UpAxis::Y)),
            Some("occlusion_tree") => Ok(Self::OcclusionTree),
            _ => {
                let known = "z_buffer, horizon, horizon_y, occlusion_tree or Cells";
                Err(refused("occlusion", format!("{} is not {known}", value.repr()?)))
            }
        }
    }

    /// Accepts a boolean, a name, cells, or several names and cells.
    pub(crate) fn list(value: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<Self>> {
        let Some(value) = value else { return Ok(vec![Self::ZBuffer]) };
        if let Ok(is_on) = value.extract::<bool>() {
            return Ok(if is_on { vec![Self::ZBuffer] } else { Vec::new() });
        }
        let items = if value.is_instance_of::<PyString>() { None } else { value.try_iter().ok() };
        match items {
            Some(items) => items.map(|item| Self::of(&item?)).collect(),
            None => Ok(vec![Self::of(value)?]),
        }
    }
}

/// Number of pipelines that are kept at most, the last ones.
const MOST_PIPELINES: usize = 64;

/// What culling keeps from call to call: memory, and occluders made of the scene.
#[derive(Default)]
pub(crate) struct Kept {
    /// Pipelines with their stages. Each is taken out while it works.
    pipelines: Vec<(Vec<Stage>, Pipeline)>,
    horizon_of_z: Option<(SceneCursor, Arc<HorizonOccluders>)>,
    horizon_of_y: Option<(SceneCursor, Arc<HorizonOccluders>)>,
    polygons: Option<(SceneCursor, Arc<Occluders>)>,
}

/// Returns occluders that are up to date with a scene: made by `make`, or those kept, brought up to date by
/// `sync`.
fn current<T: Clone>(
    kept: &mut Option<(SceneCursor, Arc<T>)>,
    scene: &Scene,
    make: impl FnOnce() -> T,
    sync: impl FnOnce(&mut T),
) -> Arc<T> {
    let (cursor, occluders) = kept.get_or_insert_with(|| (SceneCursor::at(scene), Arc::new(make())));
    if !cursor.is_current(scene) {
        sync(Arc::make_mut(occluders));
        *cursor = SceneCursor::at(scene);
    }
    Arc::clone(occluders)
}

impl Kept {
    /// Takes out a pipeline of the frustum and these stages, or makes one. `level` are joined occluders for
    /// z-buffers.
    pub(crate) fn take(
        &mut self,
        stages: &[Stage],
        scene: &Scene,
        level: Option<&Arc<LevelOccluders>>,
    ) -> Pipeline {
        if let Some(place) = self.pipelines.iter().position(|(own, _)| own == stages) {
            return self.pipelines.swap_remove(place).1;
        }
        let pipeline = Pipeline::new().with(FrustumCuller::new());
        stages.iter().fold(pipeline, |pipeline, stage| match stage {
            Stage::ZBuffer => {
                let map = match level {
                    Some(level) => Hzb::default().with_level(level.clone(), scene.origin()),
                    None => Hzb::default(),
                };
                pipeline.with(HzbCuller::new(map))
            }
            &Stage::Horizon(up) => {
                let kept = if up == UpAxis::Z { &mut self.horizon_of_z } else { &mut self.horizon_of_y };
                let make = || HorizonOccluders::new(scene, up);
                pipeline.with(HorizonCuller::new(current(kept, scene, make, |made| made.sync(scene))))
            }
            Stage::OcclusionTree => {
                let make = || Occluders::new(scene);
                let polygons = current(&mut self.polygons, scene, make, |made| made.sync(scene));
                pipeline.with(OcclusionTreeCuller::new(polygons))
            }
            Stage::Portals(cells) => pipeline.with(SharedPortalCuller::new(cells.clone())),
        })
    }

    /// Keeps a pipeline for later calls with the same stages.
    pub(crate) fn keep(&mut self, stages: Vec<Stage>, pipeline: Pipeline) {
        if self.pipelines.len() >= MOST_PIPELINES {
            self.pipelines.remove(0);
        }
        self.pipelines.push((stages, pipeline));
    }

    /// Drops what holds occluders of a scene that has changed. The occluders themselves are brought up to
    /// date when they are next asked for.
    pub(crate) fn scene_changed(&mut self) {
        self.pipelines.retain(|(stages, _)| !stages.iter().any(Stage::has_occluders));
    }
}
