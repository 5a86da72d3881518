//! The ways of culling that the program, its window and the figures compare.

use crate::{CardQueries, Delay, TwoPhaseCuller, Viewer};
use std::error::Error;
use std::time::Instant;
use visibility_core::occlusion::{HardwareQueries, LateAnswers};
use visibility_core::{Culler, FrustumCuller, OcclusionCuller, Pipeline, View, VisibleSet};
use visibility_hzb::{Hzb, HzbCuller};

/// A way of culling and drawing a frame.
#[derive(Debug)]
pub struct Method {
    /// What the method is, for people.
    pub name: &'static str,
    /// Its cullers.
    pub culling: Culling,
}

/// Cullers of a [`Method`].
#[derive(Debug)]
pub enum Culling {
    /// All objects are drawn.
    None,
    /// On the processor alone.
    Pipeline(Pipeline),
    /// On the processor, with answers of the card.
    Queries(Box<OcclusionCuller<HardwareQueries<CardQueries>>>),
    /// On the card, what a pipeline leaves.
    TwoPhase(Pipeline, Box<TwoPhaseCuller>),
}

impl Method {
    /// Makes all methods, for a viewer's scene and target.
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

    /// Culls and draws one view into the viewer's target. Returns the milliseconds of the processor's
    /// culling. `visible` becomes what the processor's cullers leave.
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
