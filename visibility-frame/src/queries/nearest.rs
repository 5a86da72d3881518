//! The objects nearest to a point (Roussopoulos, Kelley and Vincent, "Nearest Neighbor Queries", 1995: nodes
//! nearest first, down to the distance of the k-th object found so far).

use super::{SceneQuery, take_least};
use alloc::{collections::BinaryHeap, vec::Vec};
use core::cmp::Ordering;
use visibility_core::ObjectId;
use visibility_core::glam::Vec3;
use visibility_core::scene::{Boxes64, FAN_OUT, lanes};
use visibility_core::walk::{BoxHierarchy, Child, SceneHierarchy};

/// An object and its squared distance from a point. Neighbours are ordered by distance, neighbours at equal
/// distances by id.
///
/// ```
/// use visibility_core::{glam::Vec3, Aabb, Scene};
/// use visibility_frame::queries::SceneQuery;
/// let mut scene = Scene::new();
/// scene.insert(Aabb::from_arrays([3.0, 0.0, 0.0], [4.0, 1.0, 1.0]));
/// let mut nearest = Vec::new();
/// SceneQuery::new(&scene).nearest(Vec3::ZERO, 1, &mut nearest);
/// assert_eq!(nearest[0].distance_squared, 9.0);
/// ```
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Neighbor {
    /// Object that was found.
    pub id: ObjectId,
    /// Squared distance in square metres from the point to the nearest point of the object's bounds: 0 if
    /// the point is in the bounds, and for improper bounds. The relative rounding error is below 2^-50.
    pub distance_squared: f64,
}

impl Ord for Neighbor {
    fn cmp(&self, other: &Self) -> Ordering {
        self.distance_squared.total_cmp(&other.distance_squared).then(self.id.cmp(&other.id))
    }
}

impl PartialOrd for Neighbor {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Neighbor {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Neighbor {}

impl SceneQuery<'_> {
    /// Replaces the content of `nearest` with the `count` objects whose bounds are nearest to `point`,
    /// nearest first; all objects if there are fewer. `point` is relative to the scene's origin. Of objects
    /// at equal computed distances, those with the least ids are taken. On an axis with a NaN coordinate of
    /// `point`, all distances count as 0.
    ///
    /// Takes time in proportion to the number of nodes nearer than the last object found, and `log count`
    /// time for each object tested in them.
    pub fn nearest(&self, point: Vec3, count: usize, nearest: &mut Vec<Neighbor>) {
        nearest.clear();
        if count == 0 {
            return;
        }
        nearest.reserve(count.min(self.scene.len()));
        let mut heap = BinaryHeap::from(core::mem::take(nearest));
        self.for_each_unculled(|boxes, ids, mask, improper| {
            let squares = squared_distances(point, boxes);
            for lane in lanes(mask) {
                let distance_squared = if improper >> lane & 1 != 0 { 0.0 } else { squares[lane] };
                offer(&mut heap, count, Neighbor { id: ids[lane], distance_squared });
            }
        });
        self.nearest_below(None, point, count, &mut heap);
        *nearest = heap.into_sorted_vec();
    }

    fn nearest_below(&self, node: Option<usize>, point: Vec3, count: usize, heap: &mut BinaryHeap<Neighbor>) {
        SceneHierarchy.for_each_block(self.scene, node, |block| {
            let squares = squared_distances(point, block.boxes());
            if let Some((leaf, ids)) = block.leaf() {
                for lane in lanes(self.scene.lanes_on_layers(leaf, self.layers)) {
                    offer(heap, count, Neighbor { id: ids[lane], distance_squared: squares[lane] });
                }
                return;
            }
            let mut rest = block.occupied();
            while let Some(lane) = take_least(&squares, &mut rest) {
                if heap.len() >= count
                    && heap.peek().is_some_and(|worst| squares[lane] > worst.distance_squared)
                {
                    return;
                }
                if let Child::Node(child) = block.child(lane) {
                    self.nearest_below(Some(child), point, count, heap);
                }
            }
        });
    }
}

/// Adds a candidate to the heap of the best candidates, the worst of which is on top. Keeps the best `count`,
/// which is not 0.
fn offer(heap: &mut BinaryHeap<Neighbor>, count: usize, candidate: Neighbor) {
    if heap.len() < count {
        heap.push(candidate);
    } else if let Some(mut worst) = heap.peek_mut()
        && candidate < *worst
    {
        *worst = candidate;
    }
}

/// Returns the squared distances of a point from 64 boxes. Computed in `f64`, where squares of differences of
/// `f32` numbers neither overflow nor underflow. Every step is monotone: the distance of a box is never less
/// than the distance of a box that contains it. A NaN gap counts as 0.
fn squared_distances(point: Vec3, boxes: &Boxes64) -> [f64; FAN_OUT] {
    let mut sums = [0.0; FAN_OUT];
    for axis in 0..3 {
        let p = f64::from(point[axis]);
        let (min, max) = (&boxes.coordinates()[axis], &boxes.coordinates()[axis + 3]);
        for ((sum, &min), &max) in sums.iter_mut().zip(min).zip(max) {
            let (below, above) = (f64::from(min) - p, p - f64::from(max));
            let gap = if below > above { below } else { above };
            let gap = if gap > 0.0 { gap } else { 0.0 };
            *sum += gap * gap;
        }
    }
    sums
}
