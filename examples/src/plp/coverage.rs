//! How many of the visible triangles a budget buys.

use super::{Seen, TriangleWorld};
use std::ops::Deref;
use visibility_core::{FrustumCuller, Pipeline, View, VisibleSet};
use visibility_measure::{ItemBuffer, MeasureError};
use visibility_plp::{Budget, PlpCuller, Solidity, Tessellation};

/// The paper's budgets, as shares of all triangles.
pub const BUDGETS: [f64; 4] = [0.01, 0.02, 0.05, 0.1];

/// Something that puts the triangles of a frame in order of importance.
pub struct Method<'a> {
    /// What it is called.
    pub name: String,
    order: Box<Order<'a>>,
}

/// From a view and what is seen in it, triangles by falling importance.
type Order<'a> = dyn FnMut(&View, &Seen) -> Vec<u32> + 'a;

impl<'a> Method<'a> {
    /// Nearest centroid first.
    pub fn centroid(world: &'a TriangleWorld) -> Self {
        let order = move |view: &View, seen: &Seen| world.by_distance(view, &seen.candidates);
        Self { name: "centroid sorting".to_owned(), order: Box::new(order) }
    }

    /// The triangles of a view in order.
    pub fn order(&mut self, view: &View, seen: &Seen) -> Vec<u32> {
        (self.order)(view, seen)
    }

    /// The best there is: visible triangles alone.
    pub fn perfect() -> Self {
        let order = |_: &View, seen: &Seen| seen.visible.iter().map(|&(triangle, _)| triangle).collect();
        Self { name: "perfect knowledge".to_owned(), order: Box::new(order) }
    }

    /// Prioritized-layered projection.
    pub fn plp<S>(name: &str, world: &'a TriangleWorld, tessellation: S, solidity: Solidity) -> Self
    where
        S: Deref<Target: Tessellation> + Send + 'static,
    {
        let most = share(world, BUDGETS[BUDGETS.len() - 1]);
        let culler =
            PlpCuller::new(tessellation, Budget::Objects(most)).with_solidity(solidity).with_one_sided(true);
        let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
        let mut visible = VisibleSet::new();
        let order = move |view: &View, _: &Seen| {
            pipeline.cull(&world.scene, view, &mut visible);
            visible.iter(&world.scene).map(|id| id.index() as u32).collect()
        };
        Self { name: name.to_owned(), order: Box::new(order) }
    }
}

/// That share of a world's triangles, rounded down.
pub(super) fn share(world: &TriangleWorld, budget: f64) -> usize {
    (world.triangles.len() as f64 * budget) as usize
}

/// What one method finds at one budget.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// For each frame, how many of the visible triangles are projected.
    pub visible: Vec<u32>,
    /// For each frame, the share of pixels that are wrong.
    pub wrong: Vec<f64>,
}

/// What methods find on a walk.
pub struct Coverage {
    /// Visible triangles of each frame.
    pub exact: Vec<u32>,
    /// Names of the methods.
    pub names: Vec<String>,
    /// For each method, what it finds at each of [`BUDGETS`].
    pub found: Vec<[Found; BUDGETS.len()]>,
}

impl Coverage {
    /// The visible coverage ratio: visible triangles projected over visible triangles, averaged over frames.
    pub fn ratio(&self, method: usize, budget: usize) -> f64 {
        let found = &self.found[method][budget];
        let ratio = |(&found, &exact): (&u32, &u32)| f64::from(found) / f64::from(exact.max(1));
        let ratios = found.visible.iter().zip(&self.exact).filter(|(_, exact)| **exact > 0).map(ratio);
        let (sum, count) = ratios.fold((0.0, 0), |(sum, count), ratio| (sum + ratio, count + 1));
        sum / f64::from(count.max(1))
    }

    /// Visible triangles not projected, all frames together.
    pub fn missed(&self, method: usize, budget: usize) -> u64 {
        let found = &self.found[method][budget];
        found.visible.iter().zip(&self.exact).map(|(found, exact)| u64::from(exact - found)).sum()
    }

    /// The greatest share of wrong pixels in any frame.
    pub fn worst(&self, method: usize, budget: usize) -> f64 {
        self.found[method][budget].wrong.iter().copied().fold(0.0, f64::max)
    }
}

/// Runs methods over all frames of a world, in pictures of that width and height.
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
    // By triangle, its place in the order of projection.
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
                        // What is before all else in a pixel is missed there, whatever else is drawn.
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
