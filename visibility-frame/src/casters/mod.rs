//! Shadow casters: objects whose shadow may fall on points of a view, though the objects may be outside the
//! view.
//!
//! A shadow that falls on a point of the view is cast by an object on the segment from that point to the
//! light. So all casters meet the convex hull of the view's volume and the light; for the sun, the volume
//! swept towards it. An object outside a plane of that hull need not be drawn into the shadow map. (Williams,
//! "Casting Curved Shadows on Curved Surfaces", 1978, draws casters from the light. That the needed casters
//! lie in the hull of view and light is folklore of the shadow volume literature, e.g. Bittner, Mattausch,
//! Silvennoinen and Wimmer, "Shadow Caster Culling for Efficient Shadow Mapping", 2011, who go on to cull
//! casters whose receivers are hidden.)

mod hull;
mod light;

pub use light::{Light, LightError};

use hull::{HullPlanes, Source, push_ball, push_cone, push_hull};
use visibility_core::frustum::ConvexVolume;
use visibility_core::geometry::{Plane, tan};
use visibility_core::glam::DVec3;
use visibility_core::view::{MAX_PLANES, ViewPlane};
use visibility_core::{Aabb, Accuracy, CullStats, Culler, Scene, View, VisibleSet, simd::Simd};

/// Removes objects whose shadow from one light cannot fall on any point that a view shows. Conservative for
/// shadows: no object whose shadow may be in view is removed. Objects in view that cast no shadow into view
/// may be removed.
///
/// The culler is the first stage of the pipeline that selects objects for the light's shadow map. A
/// [`FrustumCuller`](visibility_core::FrustumCuller) does not belong in that pipeline, since casters may be
/// outside the view. The view is the camera's, or the part of it that one shadow cascade covers. Candidates
/// are the objects on the view's layers, so the view must include the layers of all casters
/// ([`View::with_layers`]).
///
/// For lights with a range, objects farther from the light are removed too. For spot lights, objects outside
/// the cone are removed, with the cone approximated by a pyramid with eight sides. With
/// [receivers](Self::with_receivers), objects that cast no shadow on the receivers' box are removed.
///
/// # Occlusion from the light
/// A caster that the light cannot see adds nothing to a shadow map, since the surface that hides it is nearer
/// to the light. An [`OcclusionCuller`](visibility_core::OcclusionCuller) with the light's own view removes
/// such casters. The caster culler takes the camera's view, all other stages that of the light, so they are
/// called one after another:
///
/// ```
/// # use visibility_core::{
/// #     glam::{Affine3A, DVec3}, occlusion::Occlusion, view::Window, Aabb, Accuracy, Culler,
/// #     FrustumCuller, OccluderMesh, OcclusionCuller, OcclusionMap, Pose, Scene, View, VisibleSet,
/// # };
/// # use visibility_frame::casters::{CasterCuller, Light};
/// # struct Blank;
/// # impl OcclusionMap for Blank {
/// #     fn name(&self) -> &str { "blank" }
/// #     fn accuracy(&self) -> Accuracy { Accuracy::Conservative }
/// #     fn begin(&mut self, _: &View, _: DVec3) {}
/// #     fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}
/// #     fn flush(&mut self) {}
/// #     fn test(&self, _: &Aabb) -> Occlusion { Occlusion::Partial }
/// # }
/// # let (map, scene, toward_light) = (Blank, Scene::new(), DVec3::new(0.3, 0.2, 1.0));
/// # const CASTERS: u32 = 1;
/// # let camera = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 100.0)?;
/// let mut casters = CasterCuller::new(Light::Directional { toward_light })?;
/// let mut occlusion = OcclusionCuller::new(map);
/// let mut set = VisibleSet::new();
/// // Each frame: `light` is the view that the shadow map is drawn from, on the layers of casters only.
/// let pose = Pose::look_at(toward_light * 200.0, DVec3::ZERO, DVec3::Y);
/// let light = View::orthographic(pose, Window::centered(100.0, 100.0), 0.0, 400.0)?.with_layers(CASTERS);
/// set.fill(&scene, &light);
/// casters.cull(&scene, &camera, &mut set);
/// FrustumCuller::new().cull(&scene, &light, &mut set);
/// occlusion.cull(&scene, &light, &mut set);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// No shadow is lost, because occluders are chosen from the visible set: each occluder is drawn into the
/// shadow map itself, or is hidden by others that are drawn into it. Required are
/// - one set for each shadow map: each cascade, each face of a cube;
/// - a set of shadow casters only, hence a view of the light on the layers of casters;
/// - a light's view that begins before all casters. Casters before its near plane are removed, even if the
///   engine would clamp their depth;
/// - a shadow map of the surfaces nearest to the light. A map of back faces alone loses shadows inside solid
///   occluders.
///
/// # Cost
/// One walk of the hierarchy like that of the [`FrustumCuller`](visibility_core::FrustumCuller), against 8 to
/// 12 planes instead of 6. Spot lights and receivers take a second walk over the remaining objects, and a
/// light with a range takes 5 ns for each remaining object. Among 100 thousand objects, where frustum culling
/// of a camera takes 7 us, the sun takes 8 to 13 us and a lamp 8 to 11 us.
///
/// ```
/// use visibility_core::{glam::DVec3, Aabb, Pipeline, Pose, Scene, View, VisibleSet};
/// use visibility_frame::casters::{CasterCuller, Light};
/// let mut scene = Scene::new();
/// // Behind the camera and above it, between the camera's view and the sun at its back:
/// let tower = scene.insert(Aabb::from_arrays([-9.0, -1.0, 0.0], [-7.0, 1.0, 30.0]));
/// // As far behind the camera, but too low for its shadow to reach the view.
/// let hut = scene.insert(Aabb::from_arrays([-40.0, -1.0, 0.0], [-38.0, 1.0, 3.0]));
/// let pose = Pose::look_at(DVec3::new(0.0, 0.0, 2.0), DVec3::new(9.0, 0.0, 0.0), DVec3::Z);
/// let view = View::perspective(pose, 0.7, 1.0, 0.1, 20.0)?;
/// let sun = Light::Directional { toward_light: DVec3::new(-1.0, 0.0, 1.0) };
/// let mut casters = VisibleSet::new();
/// let mut pipeline = Pipeline::new().with(CasterCuller::new(sun)?);
/// pipeline.cull(&scene, &view, &mut casters);
/// assert!(casters.contains(&scene, tower) && !casters.contains(&scene, hut));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct CasterCuller {
    simd: Simd,
    light: Light,
    /// Tangent of a spot light's half angle. `None` for other lights, and for a half angle of pi/2 or more,
    /// or so close to it that the cone is almost a half-space.
    tangent: Option<f64>,
    /// Box that contains all receivers of shadows, in metres, and the [`Scene::origin`] that it is relative
    /// to. `None` if all shadows in the view count.
    receivers: Option<(Aabb, DVec3)>,
}

impl CasterCuller {
    /// Makes a culler for the shadows of one light, without receivers.
    ///
    /// # Errors
    /// [`LightError`] if a direction, position, range or angle of the light is invalid.
    pub fn new(light: Light) -> Result<Self, LightError> {
        let mut this = Self { simd: Simd::best(), light, tangent: None, receivers: None };
        this.set_light(light)?;
        Ok(this)
    }

    /// Returns the culler with the given SIMD instructions, for tests and comparisons.
    #[must_use]
    pub fn with_simd(self, simd: Simd) -> Self {
        Self { simd, ..self }
    }

    /// Returns the culler restricted to shadows that fall into the box `receivers`, as
    /// [`set_receivers`](Self::set_receivers) does.
    #[must_use]
    pub fn with_receivers(mut self, receivers: Aabb, origin: DVec3) -> Self {
        self.set_receivers(receivers, origin);
        self
    }

    /// Restricts the culler to shadows that fall into the box `receivers`, in metres relative to `origin`,
    /// the [`Scene::origin`] at the time when the box was measured. The box must contain everything that
    /// receives shadows in the view. The restriction helps most if the view has no far plane and the sun is
    /// low. An improper or infinite box removes the restriction. The restriction is ignored while the scene
    /// has another origin.
    pub fn set_receivers(&mut self, receivers: Aabb, origin: DVec3) {
        self.receivers = receivers.is_finite().then_some((receivers, origin));
    }

    /// Returns the light, in world coordinates.
    pub fn light(&self) -> Light {
        self.light
    }

    /// Replaces the light.
    ///
    /// # Errors
    /// [`LightError`] if a direction, position, range or angle of the light is invalid. The previous light
    /// then stays.
    pub fn set_light(&mut self, light: Light) -> Result<(), LightError> {
        light.check()?;
        self.light = light;
        self.tangent = cone_tangent(&light);
        Ok(())
    }

    /// Returns the planes, with inward normals and relative to the scene's origin, of a region that every
    /// caster touches whose shadow can fall into `view`. Their error bounds hold for points whose coordinates
    /// have absolute values of at most `reach`, in metres.
    fn planes(&self, scene: &Scene, view: &View, reach: DVec3) -> HullPlanes {
        let mut planes = HullPlanes::new();
        let source = match self.light {
            Light::Directional { toward_light } => {
                Source::Direction(toward_light / toward_light.abs().max_element())
            }
            Light::Point { position, .. } | Light::Spot { position, .. } => {
                let position = position - scene.origin();
                // The difference of two numbers near the greatest ones overflows.
                if !position.is_finite() {
                    return planes;
                }
                Source::Point(position)
            }
        };
        if let (Light::Spot { direction, .. }, Source::Point(p), Some(tangent)) =
            (self.light, source, self.tangent)
        {
            push_cone(&mut planes, p, direction, tangent, reach);
        }
        if let (Some(range), Source::Point(p)) = (self.range(), source) {
            push_ball(&mut planes, p, range);
        }
        push_hull(&mut planes, view.planes(scene.origin()).by_slot(), source, reach);
        if let Some((receivers, _)) = self.receivers.filter(|&(_, origin)| origin == scene.origin()) {
            push_hull(&mut planes, (0..).zip(&sides(&receivers)), source, reach);
        }
        planes
    }

    /// Returns the range of the light in metres. `None` for directional light or an infinite range.
    fn range(&self) -> Option<f64> {
        match self.light {
            Light::Point { range, .. } | Light::Spot { range, .. } => range.is_finite().then_some(range),
            Light::Directional { .. } => None,
        }
    }
}

impl Culler for CasterCuller {
    fn name(&self) -> &str {
        "casters"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let planes = self.planes(scene, view, reach(scene));
        let mut stats = CullStats::default();
        // At least one pass, even without planes: it brings the set to the layout of the scene and counts it.
        for at_once in planes.chunks(MAX_PLANES).chain(planes.is_empty().then_some(&[][..])) {
            stats += ConvexVolume::new(self.simd, at_once).retain(scene, visible);
        }
        if let (Some(range), Light::Point { position, .. } | Light::Spot { position, .. }) =
            (self.range(), self.light)
        {
            let light = position - scene.origin();
            stats += visible.retain(scene, |_, bounds| is_within(bounds, light, range));
        }
        stats
    }
}

/// Returns the tangent of a spot light's half angle. `None` for other lights, and for a half angle of pi/2 or
/// more, or so close to it that the cone is almost a half-space.
fn cone_tangent(light: &Light) -> Option<f64> {
    let Light::Spot { half_angle, .. } = *light else { return None };
    // Just below pi/2 the tangent is finite but so large that it bounds nothing.
    Some(tan(half_angle)).filter(|&tangent| half_angle < core::f64::consts::FRAC_PI_2 && tangent < 1e9)
}

/// Returns the greatest absolute coordinate, on each axis, of all objects that can be culled, relative to the
/// scene's origin. Zero without such objects.
fn reach(scene: &Scene) -> DVec3 {
    scene.culled_bounds().map_or(DVec3::ZERO, |all| all.min.abs().max(all.max.abs()).as_dvec3())
}

/// Returns the six planes of a box in the order -x, +x, -y, +y, -z, +z, with normals pointing inwards. The
/// planes are exact: their errors are 0.
fn sides(bounds: &Aabb) -> [ViewPlane; 6] {
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    core::array::from_fn(|i| {
        let axis = [DVec3::X, DVec3::Y, DVec3::Z][i / 2];
        let plane = if i % 2 == 0 { Plane::new(axis, -min[i / 2]) } else { Plane::new(-axis, max[i / 2]) };
        ViewPlane { plane, error: 0.0 }
    })
}

/// Tests whether a box may reach within `range` metres of the light, both relative to the scene's origin.
/// Returns false only if the box is certainly farther away.
///
/// Per axis, the light is off by half an epsilon of its own size, and the slack covers that. The gap and its
/// quotient by the range round by 2 epsilon in all, which squares double, and the sums round by 1.5. The
/// range is enlarged by 16 epsilon instead, and by the least normal number. An overflow gives an infinite
/// squared gap only if the box is farther away than the range.
fn is_within(bounds: &Aabb, light: DVec3, range: f64) -> bool {
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let slack = light.abs() * (4.0 * f64::EPSILON);
    let gap = ((min - light).max(light - max) - slack).max(DVec3::ZERO);
    let range = range * (1.0 + 16.0 * f64::EPSILON) + f64::MIN_POSITIVE;
    // Divides first, so that neither squares nor ranges leave the range of `f64`.
    let gap = gap / range;
    let beyond = gap.x * gap.x + gap.y * gap.y + gap.z * gap.z > 1.0;
    !beyond
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::geometry::{DoubleDouble, sqrt};
    use visibility_core::glam::Vec3;
    use visibility_testing::Random;

    #[test]
    fn cones_that_are_almost_half_spaces_count_as_none() {
        let half_pi = core::f64::consts::FRAC_PI_2;
        let tangent = |half_angle: f64| {
            let (position, direction) = (DVec3::ZERO, DVec3::X);
            cone_tangent(&Light::Spot { position, direction, half_angle, range: 1.0 })
        };
        let found =
            [1e-3, half_pi - 1e-8, half_pi - 1e-10, half_pi, 2.0, 3.0].map(|at| tangent(at).is_some());
        assert_eq!(found, [true, true, false, false, false, false], "by half angle");
    }

    #[test]
    fn the_reach_is_that_of_the_farther_side() {
        let mut scene = Scene::new();
        assert_eq!(reach(&scene), DVec3::ZERO, "of no objects");
        scene.insert(Aabb::from_arrays([-3.0, 1.0, -1.0], [1.0, 5.0, 1.0]));
        assert_eq!(reach(&scene), DVec3::new(3.0, 5.0, 1.0), "of a box");
    }

    /// Boxes of one point that the range of a light just reaches, by squares in double-double arithmetic. The
    /// light is the difference of two points of the world, which is rounded.
    #[test]
    fn what_the_range_just_reaches_is_within_it() {
        let (mut random, mut rounded) = (Random(71), 0);
        for round in 0..20_000 {
            let far = 2f64.powi(random.between(0, 24));
            let (position, origin) = (random.fine_vector(far), random.fine_vector(1.0));
            let near = 2f64.powi(random.between(-20, 20));
            let light = position - origin;
            let at = (light + random.vector(near)).as_vec3();
            let [x, y, z] = [0, 1, 2].map(|k| {
                DoubleDouble::difference(position[k], origin[k])
                    .plus(DoubleDouble::from(f64::from(at[k])).negated())
            });
            let exact = x.times(x).plus(y.times(y)).plus(z.times(z));
            let excess = |range: f64| DoubleDouble::product(range, range).plus(exact.negated()).hi;
            let mut range = sqrt(exact.hi).next_down();
            while excess(range) < 0.0 {
                range = range.next_up();
            }
            let bounds = Aabb::new(at, at);
            assert!(
                is_within(&bounds, light, range),
                "{round}: {at} is {range} m from {position} - {origin}"
            );
            rounded += u32::from((at.as_dvec3() - light).length() > range);
            let less = range * (1.0 - 1e-12) - light.abs().max_element() * 1e-14;
            if less > 0.0 {
                assert!(!is_within(&bounds, light, less), "{round}: {at} is farther than {less} m");
            }
        }
        assert!(rounded > 1_000, "{rounded} distances are rounded up");
        let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
        for (light, is) in [(DVec3::splat(0.5), true), (DVec3::X * 3.0, true), (DVec3::X * -2.0, true)] {
            assert_eq!(is_within(&unit, light, 2.0), is, "a cube, from {light}");
        }
        for light in [DVec3::X * 3.01, DVec3::Y * -2.01, DVec3::Z * 3.01] {
            assert!(!is_within(&unit, light, 2.0), "a cube, from {light}");
        }
    }
}
