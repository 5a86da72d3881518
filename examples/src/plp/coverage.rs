//! Visible coverage ratio: how many of the visible triangles each method finds with a budget of triangles.

use super::{Seen, TriangleWorld};
use std::ops::Deref;
use visibility_core::{FrustumCuller, Pipeline, View, VisibleSet};
use visibility_measure::{ItemBuffer, MeasureError};
use visibility_plp::{Budget, PlpCuller, Solidity, Tessellation};

/// Budgets of the paper, as fractions of the number of all triangles, ascending.
pub const BUDGETS: [f64; 4] = [0.01, 0.02, 0.05, 0.1];

/// Method that orders the triangles of a frame by importance.
pub struct Method<'a> {
    /// Name of the method in tables and plots.
    pub name: String,
    order: Box<Order<'a>>,
}

/// Function that returns the indices of triangles by falling importance, for a view and the triangles seen in
/// it.
type Order<'a> = dyn FnMut(&View, &Seen) -> Vec<u32> + 'a;

impl<'a> Method<'a> {
    /// Creates the method that orders the candidates of a view by the distance of their centroids, nearest
    /// first.
    pub fn centroid(world: &'a TriangleWorld) -> Self {
        let order = move |view: &View, seen: &Seen| world.by_distance(view, &seen.candidates);
        Self { name: "centroid sorting".to_owned(), order: Box::new(order) }
    }

    /// Returns the indices of a view's triangles, most important first. Triangles that the method drops are
    /// left out.
    pub fn order(&mut self, view: &View, seen: &Seen) -> Vec<u32> {
        (self.order)(view, seen)
    }

    /// Creates the ideal method, which knows the visible triangles and returns only those.
    pub fn perfect() -> Self {
        let order = |_: &View, seen: &Seen| seen.visible.iter().map(|&(triangle, _)| triangle).collect();
        Self { name: "perfect knowledge".to_owned(), order: Box::new(order) }
    }

    /// Creates the method that projects by prioritized layers, up to the largest of [`BUDGETS`].
    /// `tessellation` must have been made of the world's scene; `name` is the name in tables and plots.
    pub fn plp<S>(name: &str, world: &'a TriangleWorld, tessellation: S, solidity: Solidity) -> Self
    where
        S: Deref<Target: Tessellation> + Send + Sync + 'static,
    {
        let most = share(world, BUDGETS[BUDGETS.len() - 1]);
        let culler =
            PlpCuller::new(tessellation, Budget::Objects(most)).with_solidity(solidity).with_one_sided();
        let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
        let mut visible = VisibleSet::new();
        let order = move |view: &View, _: &Seen| {
            pipeline.cull(&world.scene, view, &mut visible);
            visible.iter(&world.scene).map(|id| id.index() as u32).collect()
        };
        Self { name: name.to_owned(), order: Box::new(order) }
    }
}

/// Returns a fraction `budget` of the number of a world's triangles, rounded down.
pub(super) fn share(world: &TriangleWorld, budget: f64) -> usize {
    (world.triangles.len() as f64 * budget) as usize
}

/// Frame-by-frame results of one method at one budget.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// Number of visible triangles that are drawn within the budget, for each frame.
    pub visible: Vec<u32>,
    /// Fraction of the picture's pixels that are wrong, from 0 to 1, for each frame.
    pub wrong: Vec<f64>,
}

/// Results of several methods over the frames of a world. The indices `method` and `budget` of its functions
/// are those of `found`.
pub struct Coverage {
    /// Exact number of visible triangles of each frame.
    pub exact: Vec<u32>,
    /// Names of the methods, in the order in which the methods were given.
    pub names: Vec<String>,
    /// Results of each method, in the order of `names`, at each budget of [`BUDGETS`].
    pub found: Vec<[Found; BUDGETS.len()]>,
}

impl Coverage {
    /// Returns the visible coverage ratio from 0 to 1: drawn visible triangles over visible triangles,
    /// averaged over the frames that have visible triangles. 0 without such frames. `budget` is an index into
    /// [`BUDGETS`].
    pub fn ratio(&self, method: usize, budget: usize) -> f64 {
        let found = &self.found[method][budget];
        let ratio = |(&found, &exact): (&u32, &u32)| f64::from(found) / f64::from(exact.max(1));
        let ratios = found.visible.iter().zip(&self.exact).filter(|(_, exact)| **exact > 0).map(ratio);
        let (sum, count) = ratios.fold((0.0, 0), |(sum, count), ratio| (sum + ratio, count + 1));
        sum / f64::from(count.max(1))
    }

    /// Returns the number of visible triangles that are not drawn, summed over all frames. `budget` is an
    /// index into [`BUDGETS`].
    pub fn missed(&self, method: usize, budget: usize) -> u64 {
        let found = &self.found[method][budget];
        found.visible.iter().zip(&self.exact).map(|(found, exact)| u64::from(exact - found)).sum()
    }

    /// Returns the largest fraction of wrong pixels in any frame, from 0 to 1. `budget` is an index into
    /// [`BUDGETS`].
    pub fn worst(&self, method: usize, budget: usize) -> f64 {
        self.found[method][budget].wrong.iter().copied().fold(0.0, f64::max)
    }
}

/// Runs methods over all frames of a world, judged by pictures of `size` (width and height in pixels).
/// `progress` is called after each frame.
///
/// # Errors
///
/// Returns [`MeasureError`] when the item buffer cannot have this size or the world has too many triangles.
pub fn coverage(
    world: &TriangleWorld,
    methods: &mut [Method<'_>],
    size: [u32; 2],
    progress: impl Fn(),
) -> Result<Coverage, MeasureError> {
    let mut buffer = ItemBuffer::new(size[0], size[1])?;
    let names = methods.iter().map(|method| method.name.clone()).collect();
    let mut coverage =
        Coverage { exact: Vec::new(), names, found: methods.iter().map(|_| Default::default()).collect() };
    // Rank of each triangle in the method's order; `u32::MAX` for triangles that the method drops.
    let mut places = vec![u32::MAX; world.triangles.len()];
    for view in &world.views {
        let seen = world.see(view, &mut buffer)?;
        coverage.exact.push(seen.visible.len() as u32);
        for (method, found) in methods.iter_mut().zip(&mut coverage.found) {
            let order = (method.order)(view, &seen);
            for (place, &triangle) in (0..).zip(&order) {
                places[triangle as usize] = place;
            }
            for (&budget, found) in BUDGETS.iter().zip(found) {
                let budget = share(world, budget) as u32;
                let (mut count, mut wrong) = (0, 0u32);
                for &(triangle, pixels) in &seen.visible {
                    if places[triangle as usize] < budget {
                        count += 1;
                    } else {
                        // A pixel of a visible triangle that is not drawn is wrong, whatever else is drawn
                        // there.
                        wrong += pixels;
                    }
                }
                found.visible.push(count);
                found.wrong.push(f64::from(wrong) / f64::from(seen.pixels));
            }
            for triangle in order {
                places[triangle as usize] = u32::MAX;
            }
        }
        progress();
    }
    Ok(coverage)
}
