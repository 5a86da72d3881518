//! Shadow casters: objects whose shadow may reach a view, though they themselves may be outside it.
//!
//! A shadow that falls on a point of the view is cast by something on the segment from that point to the
//! light. So all casters meet the convex hull of the view's volume and the light; for the sun, the volume
//! swept towards it. What lies outside a plane of that hull need not be drawn into the shadow map. (Williams,
//! "Casting Curved Shadows on Curved Surfaces", 1978, draws casters from the light; that those needed lie in
//! the hull of view and light is folklore of the shadow volume literature, e.g. Bittner, Mattausch,
//! Silvennoinen and Wimmer, "Shadow Caster Culling for Efficient Shadow Mapping", 2011, who go on to cull
//! those whose receivers are hidden.)

mod hull;
mod light;

pub use light::{Light, LightError};

use crate::frustum::ConvexVolume;
use crate::view::{MAX_PLANES, ViewPlane};
use crate::{Aabb, Accuracy, CullStats, Culler, Scene, View, VisibleSet, float, geometry::Plane, simd::Simd};
use glam::DVec3;
use hull::{HullPlanes, Source, push_ball, push_cone, push_hull};

/// Removes objects whose shadow from one light can reach no point that a view shows. Conservative with
/// respect to these: none whose shadow may come into view is removed, though one that is itself in view may
/// be.
///
/// It is the first stage of the pipeline that finds what to draw into the light's shadow map: a
/// [`FrustumCuller`](crate::FrustumCuller) has no place there, for casters may be outside the view. The view
/// is the camera's, or one shadow cascade's part of it; candidates are the objects on its layers, so give it,
/// by [`View::with_layers`], those of what casts shadows.
///
/// For lights with a range, also what is farther from the light is removed; for spot lights what is outside
/// the cone, taken as a pyramid with eight sides. With [receivers](Self::with_receivers), also what shadows
/// none of them.
///
/// # Cost
/// A walk of the hierarchy as the [`FrustumCuller`](crate::FrustumCuller)'s, against 8 to 12 planes in place
/// of 6; a second walk of what is left for spot lights and for receivers; 5 ns for each object that is left
/// of a light with a range. Among 100 thousand objects, where the frustum of a camera takes 7 us, the sun
/// takes 8 to 13 and a lamp 8 to 11.
///
/// ```
/// use visibility_core::{
///     casters::{CasterCuller, Light}, glam::DVec3, Aabb, Pipeline, Pose, Scene, View, VisibleSet,
/// };
/// let mut scene = Scene::new();
/// // Behind the camera and above it, between the sun at its back and what it sees:
/// let tower = scene.insert(Aabb::from_arrays([-9.0, -1.0, 0.0], [-7.0, 1.0, 30.0]));
/// // As far behind, but low.
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
    /// Of the half angle of a spot light, if its cone is convex.
    tangent: Option<f64>,
    receivers: Option<Aabb>,
}

impl CasterCuller {
    /// For shadows from one light.
    ///
    /// # Errors
    /// [`LightError`] says what is wrong with the light.
    pub fn new(light: Light) -> Result<Self, LightError> {
        let mut this = Self { simd: Simd::best(), light, tangent: None, receivers: None };
        this.set_light(light)?;
        Ok(this)
    }

    /// The same with the given instructions, for tests and comparisons.
    pub fn with_simd(self, simd: Simd) -> Self {
        Self { simd, ..self }
    }

    /// The same, wanting only shadows on receivers within a box relative to the scene's origin: the bounds of
    /// all that receives shadows, or of what the view shows of it. It matters most where the view has no
    /// end and the sun is low. A box that is not finite bounds nothing.
    pub fn with_receivers(self, receivers: Aabb) -> Self {
        Self { receivers: receivers.is_finite().then_some(receivers), ..self }
    }

    /// The light whose shadows are wanted.
    pub fn light(&self) -> Light {
        self.light
    }

    /// Says where the light is now.
    ///
    /// # Errors
    /// [`LightError`] says what is wrong with the light; the one before stays.
    pub fn set_light(&mut self, light: Light) -> Result<(), LightError> {
        light.check()?;
        self.light = light;
        self.tangent = match light {
            // Just before the right angle the tangent is finite but tells nothing.
            Light::Spot { half_angle, .. } => Some(float::tan(half_angle))
                .filter(|&tangent| half_angle < core::f64::consts::FRAC_PI_2 && tangent < 1e9),
            _ => None,
        };
        Ok(())
    }

    /// The planes that casters are inside of, for points with coordinates of at most `reach`.
    fn planes(&self, scene: &Scene, view: &View, reach: DVec3) -> HullPlanes {
        let mut planes = HullPlanes::new();
        let source = match self.light {
            Light::Directional { toward_light } => {
                Source::Direction(toward_light / toward_light.abs().max_element())
            }
            Light::Point { position, .. } | Light::Spot { position, .. } => {
                Source::Point(position - scene.origin())
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
        push_hull(&mut planes, view.planes(scene.origin()).with_slots(), source, reach);
        if let Some(receivers) = self.receivers {
            push_hull(&mut planes, (0..).zip(&sides(&receivers)), source, reach);
        }
        planes
    }

    /// The range of the light, if it has one.
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
        // At least once, so that the set is brought to the layout of the scene and counted.
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

/// A bound on the coordinates of everything that can be culled.
fn reach(scene: &Scene) -> DVec3 {
    scene.culled_bounds().map_or(DVec3::ZERO, |all| all.min.abs().max(all.max.abs()).as_dvec3())
}

/// The planes of a box, which are exact.
fn sides(bounds: &Aabb) -> [ViewPlane; 6] {
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    core::array::from_fn(|i| {
        let axis = [DVec3::X, DVec3::Y, DVec3::Z][i / 2];
        let plane = if i % 2 == 0 { Plane::new(axis, -min[i / 2]) } else { Plane::new(-axis, max[i / 2]) };
        ViewPlane { plane, error: 0.0 }
    })
}

/// Whether a box may come within `range` of the light: true unless it surely does not.
///
/// The light is off by half an epsilon of its own size on each axis, and so is each difference; a square
/// doubles what is relative and sums add as much again. The slack of 16 epsilon of each, where all are
/// positive, is several times that. Overflow is infinite on the left only if the box is that far.
fn is_within(bounds: &Aabb, light: DVec3, range: f64) -> bool {
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let slack = light.abs() * (4.0 * f64::EPSILON);
    let gap = ((min - light).max(light - max) - slack).max(DVec3::ZERO);
    let range = range * (1.0 + 16.0 * f64::EPSILON);
    // Dividing first, so that neither squares nor ranges leave the range of `f64`.
    let gap = gap / range;
    let beyond = gap.x * gap.x + gap.y * gap.y + gap.z * gap.z > 1.0 + 16.0 * f64::EPSILON;
    !beyond
}
