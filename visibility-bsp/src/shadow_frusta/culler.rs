//! The culler that tests boxes against the shadow frusta of the eye's region.

use super::bake::ShadowFrusta;
use crate::clip_projection::ClipProjection;
use crate::occluders::{Chosen, Selector};
use crate::shadow::Shadows;
use crate::view_volume::ViewVolume;
use alloc::sync::Arc;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::{
    Aabb, Accuracy, CullStats, Culler, OccluderMesh, OcclusionCuller, OcclusionMap, Scene, View, VisibleSet,
    occlusion::Occlusion, view::Eye,
};

/// Occlusion map made of the shadow frusta of one frame.
#[derive(Clone, Debug)]
struct Frusta {
    /// Projection of the present frame's view.
    projection: ClipProjection,
    /// Shadows of the polygons used in the present frame.
    shadows: Shadows,
}

/// Culls boxes that are inside the shadow of a single occluder, using the occluders chosen in advance for the
/// region that contains the eye. Shadows of several occluders do not fuse. Conservative: a box for which
/// rounding leaves the answer open stays visible.
///
/// Put it after the frustum culler. A test costs time proportional to the number of polygons in use.
///
/// ```
/// use visibility_bsp::{Occluders, ShadowFrusta, ShadowFrustaCuller};
/// use visibility_core::{FrustumCuller, Pipeline, Scene};
/// let mut scene = Scene::new();
/// // insert objects, give them triangles, flag the opaque ones, then:
/// scene.prepare_occluders(&Default::default());
/// let frusta = ShadowFrusta::new(&scene, Occluders::new(&scene), 64, 16);
/// let pipeline = Pipeline::new().with(FrustumCuller::new()).with(ShadowFrustaCuller::new(frusta.into()));
/// # let _ = pipeline;
/// ```
#[derive(Clone, Debug)]
pub struct ShadowFrustaCuller {
    /// Polygons chosen in advance for each region of eye positions.
    frusta: Arc<ShadowFrusta>,
    /// Selects the usable polygons, and tracks which objects have changed since the polygons were made.
    selector: Selector,
    /// Driver that tests the scene's hierarchy of boxes against the shadow frusta.
    inner: OcclusionCuller<Frusta>,
}

impl ShadowFrustaCuller {
    /// Creates the culler of one view. `frusta` can be shared by the cullers of all views.
    pub fn new(frusta: Arc<ShadowFrusta>) -> Self {
        let map = Frusta { projection: ClipProjection::BLIND, shadows: Shadows::default() };
        let inner = OcclusionCuller::new(map).with_price(0);
        Self { frusta, selector: Selector::default(), inner }
    }

    /// Replaces the polygons and regions. Takes effect in the next frame.
    pub fn set_frusta(&mut self, frusta: Arc<ShadowFrusta>) {
        self.frusta = frusta;
    }

    /// Returns the number of polygons whose shadow frusta the last frame used; 0 before the first frame.
    pub fn frusta(&self) -> usize {
        self.inner.map().shadows.list.len()
    }
}

impl Culler for ShadowFrustaCuller {
    fn name(&self) -> &str {
        "shadow-frusta"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn hides_behind_objects(&self) -> bool {
        true
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let occluders = &self.frusta.occluders;
        self.selector.follow(occluders, scene);
        let projection = ClipProjection::new(view, scene.origin());
        self.selector.chosen.clear();
        // A parallel view has no eye position and so no region. The polygons with the largest projected area
        // are chosen instead.
        match projection.eye {
            Eye::Point(eye) => {
                let chosen = self.frusta.chosen_at(eye).iter();
                self.selector.chosen.extend(chosen.map(|&polygon| Chosen { polygon, bound: 0.0 }));
            }
            Eye::Direction(_) => {
                self.selector.choose(occluders, &projection.eye, false, None, self.frusta.most)
            }
        }
        let volume = ViewVolume::new(view, scene, 0.0);
        self.selector.keep_usable(occluders, scene, view, &projection, visible, &volume);
        let map = self.inner.map_mut();
        map.shadows.clear();
        for chosen in &self.selector.chosen {
            map.shadows.cast(&projection, &occluders.occluder_polygon(chosen.polygon));
        }
        self.inner.cull(scene, view, visible)
    }

    fn reset(&mut self) {
        self.selector.reset();
        self.inner.reset();
    }
}

impl OcclusionMap for Frusta {
    fn name(&self) -> &str {
        "shadow-frusta"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        // The shadows were cast before, in `cull`.
        self.projection = ClipProjection::new(view, origin);
    }

    fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}

    fn flush(&mut self) {}

    fn test(&self, bounds: &Aabb) -> Occlusion {
        if !bounds.is_finite() {
            return Occlusion::Visible;
        }
        let cone = self.projection.cone(bounds).filter(|_| self.projection.is_beyond_near(bounds));
        let Some(cone) = cone else { return Occlusion::Partial };
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let mut all = Occlusion::Visible;
        for shadow in &self.shadows.list {
            match shadow.back.side(min, max) {
                // The whole box is behind the polygon: it is hidden if inside all edges, and untouched if
                // outside one.
                -1 => {
                    let mut inside = true;
                    let mut outside = false;
                    for edge in self.shadows.edges_of(shadow) {
                        let (least, greatest) = cone.span(edge.line.n);
                        let slack = edge.line.slack + cone.slack;
                        inside &= least > slack;
                        outside |= greatest < -slack;
                        if outside {
                            break;
                        }
                    }
                    if inside {
                        return Occlusion::Hidden;
                    }
                    if !outside {
                        all = Occlusion::Partial;
                    }
                }
                // The whole box is in front of the polygon, which cannot hide it.
                1 => {}
                _ => all = Occlusion::Partial,
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip_projection::{Direction, Line};
    use crate::shadow::{BackPlane, Shadow, ShadowEdge};

    /// A shadow behind z = 2 and on the side x > 0 of one edge. Either the plane of the edge is off, or the
    /// directions of boxes are.
    #[test]
    fn boxes_are_in_a_shadow_or_beside_it_only_beyond_the_slack_of_its_edges() {
        for (slack, row_error) in [(0.01, 0.0), (0.0, 5e-8)] {
            let projection = ClipProjection::along_z(0.0, 0.0, 0.0, row_error);
            let direction = Direction { v: [0.0, 0.0, 1.0], error: 0.0, size: 1.0 };
            let line = Line { n: [1.0, 0.0, 0.0], slack };
            let mut shadows = Shadows::default();
            shadows.edges.push(ShadowEdge { line, ends: [DVec3::ZERO; 2], directions: [direction; 2] });
            let back = BackPlane { normal: DVec3::NEG_Z, offset: 2.0 };
            shadows.list.push(Shadow { edges: 0..1, corners: 0..0, back });
            let frusta = Frusta { projection, shadows };
            // Both errors for a box in z = 3, where the directions are divided by 3.
            let total = 3.0 * slack + 3.125 * row_error;
            for (share, decided) in [(1.02, true), (0.98, false), (0.45, false)] {
                for (side, answer) in [(1.0, Occlusion::Hidden), (-1.0, Occlusion::Visible)] {
                    let ends = [side * share * total, side * 4.0 * total].map(|x| x as f32);
                    let at = |low: f32, high: f32| {
                        let (left, right) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
                        frusta.test(&Aabb::from_arrays([left, -0.1, low], [right, 0.1, high]))
                    };
                    let expected = if decided { answer } else { Occlusion::Partial };
                    assert_eq!(at(3.0, 3.0), expected, "{share} of {total}, side {side}");
                    assert_eq!(at(1.0, 1.5), Occlusion::Visible, "{share} of {total}, before the plane");
                    assert_eq!(at(1.9, 2.1), Occlusion::Partial, "{share} of {total}, across the plane");
                }
            }
        }
    }
}
