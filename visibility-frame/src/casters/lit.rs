//! Lights and what they reach: the objects in the range and cone of a light, and the lights that may light
//! something in a view.

use super::hull::{HullPlanes, push_cone};
use super::{Light, LightError, cone_tangent, reach};
use crate::queries::{Both, SceneQuery, SphereRegion};
use alloc::vec::Vec;
use visibility_core::frustum::ConvexVolume;
use visibility_core::geometry::Sphere;
use visibility_core::glam::{DVec2, DVec3};
use visibility_core::walk::unculled_blocks;
use visibility_core::{CullStats, ObjectId, Scene, View, simd::Simd};

impl SceneQuery<'_> {
    /// Replaces the content of `found` with the objects that `light` may reach, in the order of the
    /// hierarchy: those whose bounds touch its range and, for a spot light, a pyramid with eight sides around
    /// its cone. Directional light reaches every object on the query's layers. Shadows are not considered.
    /// Returns the work counters.
    ///
    /// # Errors
    /// [`LightError`] if a direction, position, range or angle of the light is invalid. `found` is then
    /// empty.
    ///
    /// ```
    /// use visibility_core::{glam::DVec3, Aabb, Scene};
    /// use visibility_frame::{casters::Light, queries::SceneQuery};
    /// let mut scene = Scene::new();
    /// let boxes = [1.0, 9.0].map(|x| Aabb::from_arrays([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]));
    /// let ids = scene.insert_batch(boxes);
    /// let lamp = Light::Point { position: DVec3::ZERO, range: 5.0 };
    /// let mut lit = Vec::new();
    /// SceneQuery::new(&scene).lit_by(&lamp, &mut lit)?;
    /// assert_eq!(lit, [ids[0]]);
    /// # Ok::<(), visibility_frame::casters::LightError>(())
    /// ```
    pub fn lit_by(&self, light: &Light, found: &mut Vec<ObjectId>) -> Result<CullStats, LightError> {
        found.clear();
        light.check()?;
        let origin = self.scene().origin();
        Ok(match *light {
            Light::Directional { .. } => self.in_convex(&ConvexVolume::new(Simd::best(), &[]), found),
            Light::Point { position, range } => {
                self.in_sphere(&Sphere::from_world(position, range, origin), found)
            }
            Light::Spot { position, direction, range, .. } => {
                let mut planes = HullPlanes::new();
                if let Some(tangent) = cone_tangent(light) {
                    let apex = position - origin;
                    push_cone(&mut planes, apex, direction, tangent, cone_reach(self.scene(), apex, range));
                }
                let cone = ConvexVolume::new(Simd::best(), &planes);
                let ball = SphereRegion::new(&Sphere::from_world(position, range, origin));
                self.collect(&Both(ball, cone), found)
            }
        })
    }
}

/// Returns the greatest absolute coordinate, on each axis, for which the planes of a cone must be valid. The
/// ball of a finite range is enough: bounds that touch ball and cone have a point there, and no plane can be
/// farther from their farthest corner than from that point. An infinite range takes all bounds of the scene.
fn cone_reach(scene: &Scene, apex: DVec3, range: f64) -> DVec3 {
    if range.is_finite() {
        return apex.abs() + 2.0 * range;
    }
    unculled_blocks(scene).fold(reach(scene), |reach, block| {
        let hull = block.boxes().hull();
        reach.max(hull.min.abs().max(hull.max.abs()).as_dvec3())
    })
}

/// Replaces the content of `found` with the indices of the lights that may light something in a view, in
/// ascending order: directional lights, and lights whose range or cone is not outside any single plane of the
/// view. A light that is invalid, such as one with a NaN, is found. No light that reaches a point in view is
/// missed.
///
/// Takes time in proportion to the number of lights. For thousands of lights, keep their bounds as objects of
/// a [`Scene`] of their own and cull that.
///
/// ```
/// use visibility_core::{glam::DVec3, Pose, View};
/// use visibility_frame::casters::{Light, lights_in_view};
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY)?;
/// let lamps = [9.0, -9.0].map(|x| Light::Point { position: DVec3::new(x, 0.0, 0.0), range: 5.0 });
/// let mut found = Vec::new();
/// lights_in_view(&lamps, &view, &mut found);
/// assert_eq!(found, [0]);
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
pub fn lights_in_view(lights: &[Light], view: &View, found: &mut Vec<usize>) {
    found.clear();
    let planes = view.planes(view.origin());
    found.extend((0..).zip(lights).filter_map(|(index, light)| {
        let (position, range) = match *light {
            _ if light.check().is_err() => return Some(index),
            Light::Directional { .. } => return Some(index),
            Light::Point { position, range } | Light::Spot { position, range, .. } => (position, range),
        };
        let p = position - view.origin();
        let cone = Cone::of(light);
        let is_outside = planes.as_slice().iter().any(|view_plane| {
            let plane = &view_plane.plane;
            // The margins of `ViewPlanes::contains`; they include the rounding of `p`.
            let error = 4.0 * plane.error_bound(p.abs()) + view_plane.error;
            let share = cone.as_ref().map_or(1.0, |cone| cone.support(plane.normal));
            // An infinite range times 0 would be NaN.
            let support = if share > 0.0 { range * share * (1.0 + SLACK) } else { 0.0 };
            plane.signed_distance(p) < -(support + error)
        });
        (!is_outside).then_some(index)
    }));
}

/// Slack for the rounding of unit vectors and of elementary functions, relative to the range of a light: far
/// more than the 2^-48 that these sum up to, far less than a light's own precision.
const SLACK: f64 = 1e-9;

/// The cone of a spot light: unit axis, sine and cosine of the half angle.
struct Cone {
    axis: DVec3,
    sine: f64,
    cosine: f64,
}

impl Cone {
    /// Returns the cone of a spot light. `None` for other lights, and if the cone is not convex.
    fn of(light: &Light) -> Option<Self> {
        let Light::Spot { direction, .. } = *light else { return None };
        let tangent = cone_tangent(light)?;
        let axis = (direction / direction.abs().max_element()).try_normalize()?;
        let cosine = 1.0 / DVec2::new(1.0, tangent).length();
        Some(Self { axis, sine: tangent * cosine, cosine })
    }

    /// Returns the greatest signed distance along the unit vector `normal` of a point of the cone, cut by the
    /// ball of radius 1 around its apex, from that apex; never too small. 0 if the apex is farthest.
    fn support(&self, normal: DVec3) -> f64 {
        let (along, across) = (normal.dot(self.axis), normal.cross(self.axis).length());
        // With `t` between normal and axis and half angle `h`: 1 if t <= h, otherwise cos(t - h).
        if along >= self.cosine { 1.0 } else { (along * self.cosine + across * self.sine + SLACK).max(0.0) }
    }
}
