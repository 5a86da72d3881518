//! The exact culler never hides a visible object by memory of an earlier scene (contract 4): scenes are
//! swapped, mixed, cloned, changed, reverted and dropped while the culler keeps its prepared triangles.

use std::sync::Arc;
use visibility_core::{Accuracy, CullStats, Culler, Scene, View, VisibleSet};
use visibility_exact::{Effort, ExactCuller, ExactSettings, SceneTriangles};
use visibility_testing::swapped::{AroundEye, Swapped, hold_against_fresh};
use visibility_testing::{Random, judged, told_enough};

/// The exact culler, and whether it is the reference, which always gets triangles collected from the present
/// scene.
struct Exact(AroundEye<ExactCuller>, bool);

fn culler(triangles: &Arc<SceneTriangles>) -> AroundEye<ExactCuller> {
    let settings = ExactSettings::new(Effort::Exact(1e-3)).with_rays(2000).with_aimed_rays(10);
    AroundEye(ExactCuller::new(triangles.clone(), settings))
}

impl Culler for Exact {
    fn name(&self) -> &str {
        "exact"
    }

    fn accuracy(&self) -> Accuracy {
        self.0.accuracy()
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        self.0.cull(scene, view, visible)
    }
}

struct Kind;

impl Swapped for Kind {
    type Culler = Exact;
    type Source = Arc<SceneTriangles>;

    fn derive(&self, scene: &Scene, _: &mut Random) -> Self::Source {
        Arc::new(SceneTriangles::new(scene))
    }

    fn make(&self, source: &Self::Source) -> Exact {
        Exact(culler(source), false)
    }

    fn give(&self, culler: &mut Exact, source: &Self::Source, scene: &Scene) {
        let present;
        let source = if culler.1 {
            present = Arc::new(SceneTriangles::new(scene));
            &present
        } else {
            source
        };
        culler.0 = self::culler(source);
    }

    fn truth(&self, source: &Self::Source) -> Exact {
        Exact(culler(source), true)
    }
}

#[test]
fn triangles_of_a_scene() {
    let hidden = hold_against_fresh(&Kind, 0, 60);
    judged(hidden as u64);
    told_enough(hidden > 60, format_args!("{hidden} objects hidden are no test"));
}
