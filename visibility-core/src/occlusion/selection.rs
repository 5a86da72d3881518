//! Which occluders are worth their cost from where the eye is.

use crate::{
    Aabb, ObjectId, OccluderMesh, Scene,
    view::{Eye, ViewPlanes},
};
use alloc::vec::Vec;
use core::cmp::Ordering;
use glam::{Affine3A, Vec3};

/// How occluders are chosen each frame.
///
/// ```
/// use visibility_core::occlusion::Selection;
/// assert_eq!(Selection::default(), Selection::SolidAngle);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Selection {
    /// Those among the candidates that fill most of the view: by `-A (N . V) / |D|^2`, area facing the eye
    /// over squared distance (Coorg and Teller, "Real-Time Occlusion Culling for Models with Large
    /// Occluders", 1997), nearest first.
    #[default]
    SolidAngle,
    /// First those that were visible in the frame before, since what hides now most likely hid then, and as
    /// far as the budget lasts the others; both by solid angle.
    LastVisible,
    /// The nearest, whatever their size (Zhang, Manocha, Hudson and Hoff, "Visibility Culling using
    /// Hierarchical Occlusion Maps", 1997): for small budgets, and for maps whose estimate of depth
    /// suffers from occluders far away.
    Nearest,
    /// Each occluder as it is found visible on the way from front to back (Greene, Kass and Miller,
    /// "Hierarchical Z-Buffer Visibility", 1993): nothing hidden is ever added, and all that could be is,
    /// up to the budget.
    Interleaved,
    /// In the order of the set that the stage before left, as far as the budget lasts: prioritized-layered
    /// projection, say, as the one who knows what is most likely seen (Klosowski and Silva, "The
    /// Prioritized-Layered Projection Algorithm for Visible Set Estimation", 2000, section 6, extension
    /// 1). A set without an order is in that of the hierarchy.
    Ordered,
}

/// How much of the sky an occluder covers, in steradians, at best.
pub(super) fn solid_angle(mesh: &OccluderMesh, transform: &Affine3A, eye: &Eye) -> f32 {
    let center = transform.transform_point3(mesh.bounds().center());
    let (direction, distance_squared) = match eye {
        Eye::Point(eye) => {
            let d = eye.as_vec3() - center;
            // No nearer than its own size: the formula is for occluders that are small from where they are
            // seen.
            let size = mesh.bounds().half_extent().length_squared().max(f32::MIN_POSITIVE);
            (d.normalize_or_zero(), d.length_squared().max(size))
        }
        Eye::Direction(along) => (-along.as_vec3(), 1.0),
    };
    // The areas are those of the untransformed mesh: turn the direction back instead, and scale by how areas
    // scale.
    let inverse = transform.matrix3.inverse();
    let scale = transform.matrix3.determinant().abs();
    let turned: Vec3 = (inverse * glam::Vec3A::from(direction)).into();
    let area = mesh.area_towards(turned) * scale;
    if area.is_finite() { area / distance_squared } else { 0.0 }
}

/// An occluder that may be chosen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) id: ObjectId,
    pub(super) angle: f32,
    pub(super) distance: f32,
    /// Grows with the distance of its nearest point.
    pub(super) gap: f32,
    /// In triangles.
    pub(super) cost: usize,
    /// Whether it is to be preferred.
    pub(super) seen: bool,
}

impl Candidate {
    pub(super) fn new(
        scene: &Scene,
        id: ObjectId,
        eye: &Eye,
        clip_planes: &ViewPlanes,
        cost: impl FnOnce(&OccluderMesh) -> usize,
    ) -> Option<Self> {
        let (mesh, transform) =
            scene.occluder(id).filter(|(mesh, transform)| mesh.is_inside(clip_planes, transform))?;
        let bounds = scene.bounds(id).ok()?;
        let center = bounds.center().as_dvec3();
        let distance = match eye {
            Eye::Point(eye) => center.distance_squared(*eye),
            Eye::Direction(along) => center.dot(*along),
        };
        let angle = solid_angle(mesh, transform, eye);
        Some(Self {
            id,
            angle,
            distance: distance as f32,
            gap: distance_key(eye, &bounds),
            cost: cost(mesh),
            seen: false,
        })
    }
}

/// Keeps those that were seen and then those that cover most, or the nearest, within a budget of triangles,
/// nearest first. One that does not fit is passed over, since a smaller one behind it may.
pub(super) fn choose(candidates: &mut Vec<Candidate>, budget: usize, nearest: bool) {
    candidates.retain(|candidate| candidate.angle > 0.0);
    let best_first = |a: &Candidate, b: &Candidate| {
        let by_gap = if nearest { a.gap.total_cmp(&b.gap) } else { Ordering::Equal };
        let by_angle = b.angle.total_cmp(&a.angle);
        b.seen.cmp(&a.seen).then(by_gap).then(by_angle).then(a.id.cmp(&b.id))
    };
    let mut left = budget;
    let taken = take(candidates, &mut left, &best_first);
    candidates.truncate(taken);
    candidates.sort_unstable_by(|a, b| {
        a.gap.total_cmp(&b.gap).then(a.distance.total_cmp(&b.distance)).then(a.id.cmp(&b.id))
    });
}

/// So few are put in order at once.
const FEW: usize = 16;

/// Moves to the front those that fit into what is left of a budget, taken one after another in an order;
/// returns how many. Those that surely all fit, or surely none, are not put in order: most of a large scene's
/// occluders are on one side or the other.
fn take(
    candidates: &mut [Candidate],
    left: &mut usize,
    order: &impl Fn(&Candidate, &Candidate) -> Ordering,
) -> usize {
    let (mut all, mut least) = (0usize, usize::MAX);
    for candidate in candidates.iter() {
        all = all.saturating_add(candidate.cost);
        least = least.min(candidate.cost);
    }
    if all <= *left {
        *left -= all;
        return candidates.len();
    }
    if least > *left {
        return 0;
    }
    if candidates.len() <= FEW {
        candidates.sort_unstable_by(order);
        let mut taken = 0;
        for i in 0..candidates.len() {
            if candidates[i].cost <= *left {
                *left -= candidates[i].cost;
                candidates.swap(taken, i);
                taken += 1;
            }
        }
        return taken;
    }
    let middle = candidates.len() / 2;
    candidates.select_nth_unstable_by(middle, order);
    let (first, second) = candidates.split_at_mut(middle);
    let taken = take(first, left, order);
    let more = take(second, left, order);
    for i in 0..more {
        candidates.swap(taken + i, middle + i);
    }
    taken + more
}

/// Grows with the distance of a box from the eye. Only an order: rounding does no harm.
pub(super) fn distance_key(eye: &Eye, bounds: &Aabb) -> f32 {
    match eye {
        Eye::Point(eye) => {
            let eye = eye.as_vec3();
            eye.clamp(bounds.min, bounds.max.max(bounds.min)).distance_squared(eye)
        }
        Eye::Direction(along) => {
            let along = along.as_vec3();
            let nearest = glam::Vec3::select(along.cmpge(glam::Vec3::ZERO), bounds.min, bounds.max);
            nearest.dot(along)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn those_are_chosen_that_fit_one_after_another() {
        let mut state = 1u32;
        let mut random = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % below
        };
        let mut passed_over = 0;
        for trial in 0..2_000 {
            let mut candidates: Vec<Candidate> = (0..random(120))
                .map(|index| Candidate {
                    id: ObjectId { index, generation: 0 },
                    angle: random(20) as f32 * 0.1,
                    distance: random(9) as f32,
                    gap: random(9) as f32,
                    cost: random(if trial % 3 == 0 { 3 } else { 40 }) as usize,
                    seen: random(4) == 0,
                })
                .collect();
            let (budget, nearest) = (random(1_500) as usize, random(2) == 0);
            let mut ordered = candidates.clone();
            ordered.sort_by(|a, b| {
                let by_gap = if nearest { a.gap.total_cmp(&b.gap) } else { Ordering::Equal };
                (b.seen.cmp(&a.seen)).then(by_gap).then(b.angle.total_cmp(&a.angle)).then(a.id.cmp(&b.id))
            });
            let (mut left, mut expected, mut refused) = (budget, Vec::new(), false);
            for candidate in ordered.iter().filter(|candidate| candidate.angle > 0.0) {
                if candidate.cost <= left {
                    left -= candidate.cost;
                    expected.push((candidate.gap, candidate.distance, candidate.id));
                    passed_over += usize::from(refused);
                } else {
                    refused = true;
                }
            }
            expected.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
            choose(&mut candidates, budget, nearest);
            let chosen: Vec<_> = candidates.iter().map(|c| (c.gap, c.distance, c.id)).collect();
            assert_eq!(chosen, expected, "{trial}: budget {budget}");
        }
        assert!(passed_over > 1_000, "{passed_over}");
    }
}
