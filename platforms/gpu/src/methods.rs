//! Culling methods that the program, its window and the figures compare.

use crate::{CardQueries, Delay, TwoPhaseCuller, Viewer};
use std::error::Error;
use std::time::Instant;
use visibility_core::occlusion::{HardwareQueries, LateAnswers};
use visibility_core::{Culler, FrustumCuller, OcclusionCuller, Pipeline, View, VisibleSet};
use visibility_hzb::{Hzb, HzbCuller};

/// Method of culling and drawing a frame.
#[derive(Debug)]
pub struct Method {
    /// Description of the method, for people.
    pub name: &'static str,
    /// Cullers of the method, and where they run.
    pub culling: Culling,
}

/// Cullers of a [`Method`].
#[derive(Debug)]
pub enum Culling {
    /// No culling: all objects are drawn.
    None,
    /// Culling on the processor.
    Pipeline(Pipeline),
    /// Culling on the processor, with answers of the card's occlusion queries.
    Queries(Box<OcclusionCuller<HardwareQueries<CardQueries>>>),
    /// Culling on the card of the objects that a pipeline leaves.
    TwoPhase(Pipeline, Box<TwoPhaseCuller>),
}

impl Method {
    /// Creates all methods, for a viewer's scene and target.
    pub fn all(viewer: &Viewer) -> Vec<Self> {
        let Viewer { gpu, world, meshes, painter, target, .. } = viewer;
        let frustum = || Pipeline::new().with(FrustumCuller::new());
        let z_buffer = || frustum().with(HzbCuller::new(Hzb::default()));
        let queries = |late| {
            let card = CardQueries::new(gpu, painter, Delay::Frames(1));
            Culling::Queries(Box::new(OcclusionCuller::new(HardwareQueries::new(card, late)).with_price(0)))
        };
        let two_phase = |pipeline| {
            let culler = TwoPhaseCuller::new(gpu, &world.scene, meshes, painter, target);
            Culling::TwoPhase(pipeline, Box::new(culler))
        };
        [
            ("all objects", Culling::None),
            ("frustum", Culling::Pipeline(frustum())),
            ("z-buffer on the processor", Culling::Pipeline(z_buffer())),
            ("queries, late answers visible", queries(LateAnswers::Visible)),
            ("queries, late answers trusted", queries(LateAnswers::Trusted { frames: 4 })),
            ("two phases on the card", two_phase(frustum())),
            ("z-buffer, then two phases", two_phase(z_buffer())),
        ]
        .into_iter()
        .map(|(name, culling)| Self { name, culling })
        .collect()
    }

    /// Culls and draws one view into the viewer's target. Returns the time of culling on the processor in
    /// milliseconds. `visible` is replaced by the objects that the cullers on the processor leave.
    ///
    /// # Errors
    /// None is expected.
    pub fn frame(
        &mut self,
        viewer: &mut Viewer,
        view: &View,
        visible: &mut VisibleSet,
    ) -> Result<f64, Box<dyn Error>> {
        let start = Instant::now();
        let elapsed = || start.elapsed().as_secs_f64() * 1e3;
        let scene = &viewer.world.scene;
        match &mut self.culling {
            Culling::None => {
                visible.clear(scene);
                visible.fill(scene, view);
                visible.finish(scene);
            }
            Culling::Pipeline(pipeline) | Culling::TwoPhase(pipeline, _) => {
                pipeline.cull(scene, view, visible);
            }
            Culling::Queries(culler) => {
                visible.fill(scene, view);
                FrustumCuller::new().cull(scene, view, visible);
                culler.cull(scene, view, visible);
                visible.finish(scene);
            }
        }
        let cull_ms = elapsed();
        if let Culling::TwoPhase(_, culler) = &mut self.culling {
            viewer.look(view);
            let Viewer { gpu, target, meshes, painter, world, .. } = &*viewer;
            culler.draw(gpu, target, meshes, painter, &world.scene, visible)?;
            return Ok(cull_ms);
        }
        viewer.draw(view, visible.ids(&viewer.world.scene));
        if let Culling::Queries(culler) = &mut self.culling {
            culler.map_mut().device_mut().submit(&viewer.target);
        }
        Ok(cull_ms)
    }
}
