//! Bounds of animated nodes over the whole of every clip.
//!
//! The time of a clip is cut at all keys, and further into steps. During a step, each node's transform is
//! known up to an error: the translation stays in a box, and rotation and scale move a point by at most a
//! fraction of its distance from the node. Errors are carried up the hierarchy ([`ErrorMap::after`]). So the
//! box at the middle of a step, enlarged by the error, contains every point at every time of the step. Bounds
//! are never too small. Shorter steps make them tighter.

use super::buffers::Buffers;
use super::document::{LocalTransform, unit};
use super::nodes::Nodes;
use crate::error::SourceError;
use glam::{DMat3, DMat4, DQuat, DVec3, DVec4, Vec3, Vec4};
use gltf::animation::{Interpolation, Property};
use std::collections::BTreeMap;
use std::ops::Range;

/// Box in `f64`, as its minimum and maximum corner.
pub(super) type Box64 = (DVec3, DVec3);

/// Empty box, which contains no point.
pub(super) const EMPTY: Box64 = (DVec3::INFINITY, DVec3::NEG_INFINITY);

/// Returns the box around two boxes.
pub(super) fn union(a: Box64, b: Box64) -> Box64 {
    (a.0.min(b.0), a.1.max(b.1))
}

/// Returns the box around points.
pub(super) fn around(points: impl IntoIterator<Item = DVec3>) -> Box64 {
    points.into_iter().fold(EMPTY, |bounds, point| union(bounds, (point, point)))
}

/// Returns the corners of a box.
pub(super) fn corners((low, high): Box64) -> [DVec3; 8] {
    std::array::from_fn(|i| DVec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low))
}

/// Number of steps of a clip, if it has few keys. Between two keys there are at least one and at most
/// [`MOST_STEPS`] steps.
const STEPS: usize = 512;
/// Maximum number of steps from one key to the next.
const MOST_STEPS: usize = 16;
/// Maximum amount of work: the number of node transforms and boxes, summed over all steps of all clips.
const MOST_WORK: usize = 1 << 24;
/// Relative difference between poses in `f32` and in `f64`, as a fraction of a point's distance from a node:
/// sixteen roundings of 2^-24 for each node in a chain of about ten. A node that turns moves what is below it
/// by this fraction of the distance from the turning node, however near the node below is, and whether a clip
/// turns it or it is turned at rest.
const ROUNDING: f64 = 1e-5;
/// Greatest absolute dot product of two keys' unit quaternions whose rotations count as half a turn apart.
/// Which of the two arcs between them is shorter then depends on the rounding of a renderer in `f32`: the sum
/// of four products of numbers up to 1, each rounded a few times by 2^-24.
const HALF_TURN: f64 = 1e-5;

/// Animations of a document.
pub(super) struct Motion {
    clips: Vec<Clip>,
    /// Whether a clip moves the node or one of its ancestors, by node index.
    is_moved: Vec<bool>,
    /// Least and greatest weight of each morph target over all clips, by node index. From 0 to 1 at least for
    /// a target that no clip changes. Empty for a node without a channel of weights.
    weights: Vec<Vec<[f64; 2]>>,
}

/// Channels of translation, rotation and scale, by node index.
type Channels = BTreeMap<usize, [Option<Channel>; 3]>;

/// Clip: one animation of a document.
struct Clip {
    /// Channels of translation, rotation and scale, by node index. Nodes without a channel are absent.
    channels: Channels,
    /// Nodes that the clip moves, directly or through an ancestor, as positions in [`Nodes::order`].
    /// Ascending and disjoint.
    moved: Vec<Range<usize>>,
    /// Times of all keys in seconds, ascending and distinct.
    times: Vec<f64>,
}

/// Values of one property (translation, rotation or scale) over time. Kept as they are in the file, since
/// many channels may have the same long list of keys.
struct Channel {
    /// Times of the keys in seconds.
    times: Vec<f32>,
    /// Value at each key; of a cubic spline the tangent before it, the value, and the tangent after it.
    /// Vectors of three have a fourth component of 0.
    values: Vec<Vec4>,
    interpolation: Interpolation,
}

/// Value of a key. A cubic spline also has tangents before and after the key.
struct Key {
    before: DVec4,
    value: DVec4,
    after: DVec4,
}

/// Part of a moving object: a box that is fixed to a node.
pub(super) struct MovedBox {
    /// Index of the object in the list of moving objects.
    pub mover: usize,
    /// Index of the node.
    pub node: usize,
    /// Matrix from the box's space to the node's space.
    pub to_node: DMat4,
    pub bounds: Box64,
}

/// Nodes that a clip moves, parents before children, and the boxes that are fixed to them.
type MovedPart<'a> = (&'a [usize], &'a [MovedBox]);

impl Motion {
    /// Reads the clips of a document. Ignores channels whose values all equal the rest pose.
    ///
    /// # Errors
    ///
    /// Returns the errors of reading the accessors.
    pub(super) fn new(
        document: &gltf::Document,
        transforms: &[LocalTransform],
        nodes: &Nodes,
        buffers: &Buffers<'_>,
    ) -> Result<Self, SourceError> {
        let count = transforms.len();
        let (is_moved, weights) = (vec![false; count], vec![Vec::new(); count]);
        let mut motion = Self { clips: Vec::new(), is_moved, weights };
        let targets = |mesh: gltf::Mesh<'_>| {
            mesh.primitives().map(|primitive| primitive.morph_targets().count()).max().unwrap_or(0)
        };
        let targets: Vec<usize> = document.meshes().map(targets).collect();
        for animation in document.animations() {
            let mut channels = Channels::new();
            for channel in animation.channels() {
                let (node, sampler) = (channel.target().node().index(), channel.sampler());
                let property = channel.target().property();
                if property == Property::MorphTargetWeights {
                    let targets = channel.target().node().mesh().map_or(0, |mesh| targets[mesh.index()]);
                    motion.take_weights(node, targets, &sampler, buffers)?;
                    continue;
                }
                let (read, at) = (Channel::read(&sampler, property, buffers)?, place(property));
                if read.is_moving(&transforms[node], property) {
                    channels.entry(node).or_default()[at] = Some(read);
                }
            }
            motion.push(channels, nodes);
        }
        // A channel has values of all targets of a mesh, also of those that it does not change.
        for [low, high] in motion.weights.iter_mut().flatten().filter(|[low, high]| low >= high) {
            (*low, *high) = (low.min(0.0), high.max(1.0));
        }
        Ok(motion)
    }

    /// Appends a clip, unless it moves no node.
    fn push(&mut self, channels: Channels, nodes: &Nodes) {
        if channels.is_empty() {
            return;
        }
        let mut moved: Vec<Range<usize>> =
            channels.keys().map(|&node| nodes.subtrees[node].clone()).collect();
        moved.sort_unstable_by_key(|range| range.start);
        // Two subtrees that share a node are nested: the subtree that begins later lies in the other.
        moved.dedup_by(|later, earlier| later.start < earlier.end);
        for range in &moved {
            // If an earlier clip moves the first node, it moves all nodes of the range.
            if !self.is_moved[nodes.order[range.start]] {
                nodes.order[range.clone()].iter().for_each(|&node| self.is_moved[node] = true);
            }
        }
        let times = channels.values().flatten().flatten().flat_map(|channel| &channel.times);
        let mut times: Vec<f64> = times.map(|&time| f64::from(time)).collect();
        times.sort_unstable_by(f64::total_cmp);
        times.dedup();
        times.shrink_to_fit();
        self.clips.push(Clip { channels, moved, times });
    }

    /// Extends the range of the weights of a node's morph targets by the values of a channel.
    fn take_weights(
        &mut self,
        node: usize,
        targets: usize,
        sampler: &gltf::animation::Sampler<'_>,
        buffers: &Buffers<'_>,
    ) -> Result<(), SourceError> {
        if targets == 0 {
            return Ok(());
        }
        buffers.charge(targets, || format!("node {node}"))?;
        let times = times(sampler, buffers)?;
        let values: Vec<f64> =
            buffers.vectors::<1>(&sampler.output())?.iter().map(|[value]| f64::from(*value)).collect();
        let ranges = &mut self.weights[node];
        ranges.resize(targets, [f64::INFINITY, f64::NEG_INFINITY]);
        let mut take = |target: usize, value: f64| {
            ranges[target] = [ranges[target][0].min(value), ranges[target][1].max(value)];
        };
        if sampler.interpolation() != Interpolation::CubicSpline {
            values.iter().enumerate().for_each(|(i, &value)| take(i % targets, value));
            return Ok(());
        }
        for (key, of_key) in values.chunks_exact(3 * targets).enumerate() {
            // A cubic spline segment lies within the hull of its Bezier points, which are the values, and the
            // values plus or minus a third of the tangent times the length of the segment.
            let step = |other: usize| match (times.get(key), times.get(other)) {
                (Some(a), Some(b)) => f64::from(*b) - f64::from(*a),
                _ => 0.0,
            };
            let (before, after) = (step(key.wrapping_sub(1)), step(key + 1));
            for target in 0..targets {
                let [arriving, value, leaving] = [0, 1, 2].map(|part| of_key[part * targets + target]);
                take(target, value);
                take(target, value + arriving * before / 3.0);
                take(target, value + leaving * after / 3.0);
            }
        }
        Ok(())
    }

    /// Returns whether a clip moves a node or one of its ancestors.
    pub(super) fn moves(&self, node: usize) -> bool {
        self.is_moved[node]
    }

    /// Returns the least and greatest weight of each morph target of a node over all clips, from 0 to 1 at
    /// least for a target that no clip changes. Empty if no clip has a channel of the node's weights.
    pub(super) fn weights(&self, node: usize) -> &[[f64; 2]] {
        &self.weights[node]
    }

    /// Enlarges the world-space bounds of each moving object to contain its boxes at rest and at all times of
    /// all clips. `boxes` are sorted by the positions of their nodes in [`Nodes::order`]. Returns false if
    /// this exceeds [`MOST_WORK`]; the bounds then hold the boxes at rest alone.
    pub(super) fn enclose(
        &self,
        transforms: &[LocalTransform],
        nodes: &Nodes,
        boxes: &[MovedBox],
        bounds: &mut [(usize, Box64)],
    ) -> bool {
        if boxes.is_empty() {
            return true;
        }
        let root = ErrorMap::exact(nodes.root);
        let mut worlds: Vec<ErrorMap> = vec![root; transforms.len()];
        let place = |node: usize, local: &ErrorMap, worlds: &mut [ErrorMap]| {
            worlds[node] = nodes.parents[node].map_or(root, |parent| worlds[parent]).after(local);
        };
        let place_at_rest = |node: usize, worlds: &mut [ErrorMap]| {
            place(node, &ErrorMap::rounded(transforms[node].matrix()), worlds);
        };
        nodes.order.iter().for_each(|&node| place_at_rest(node, &mut worlds));
        let mut enlarge = |moved: &MovedBox, worlds: &[ErrorMap]| {
            let map = worlds[moved.node].after(&ErrorMap::exact(moved.to_node));
            let bounds = &mut bounds[moved.mover].1;
            *bounds = union(*bounds, map.image(moved.bounds));
        };
        boxes.iter().for_each(|moved| enlarge(moved, &worlds));
        // The boxes at the nodes of a range of the order.
        let boxes_at = |range: &Range<usize>| {
            let before = |end: usize| boxes.partition_point(|moved| nodes.subtrees[moved.node].start < end);
            &boxes[before(range.start)..before(range.end)]
        };
        // Subtrees without boxes move nothing visible.
        let moved: Vec<Vec<MovedPart<'_>>> = self
            .clips
            .iter()
            .map(|clip| {
                let parts = clip.moved.iter().map(|range| (&nodes.order[range.clone()], boxes_at(range)));
                parts.filter(|(_, boxes)| !boxes.is_empty()).collect()
            })
            .collect();
        let work = |(clip, moved): (&Clip, &Vec<MovedPart<'_>>)| {
            let steps = clip.times.len().saturating_mul(clip.steps());
            steps.saturating_mul(moved.iter().map(|(nodes, boxes)| nodes.len() + boxes.len()).sum())
        };
        let work = self.clips.iter().zip(&moved).map(work).fold(0, usize::saturating_add);
        if work > MOST_WORK {
            return false;
        }
        for (clip, moved) in self.clips.iter().zip(&moved) {
            for (from, to) in clip.spans() {
                for &(below, boxes) in moved {
                    for &node in below {
                        place(node, &clip.local(node, &transforms[node], from, to), &mut worlds);
                    }
                    boxes.iter().for_each(|moved| enlarge(moved, &worlds));
                }
            }
            // Back to rest for the next clip, parents before children.
            let nodes_moved = moved.iter().flat_map(|(below, _)| below.iter());
            nodes_moved.for_each(|&node| place_at_rest(node, &mut worlds));
        }
        true
    }
}

/// Reads the times of a sampler's keys in seconds. Returns an error for an accessor without a buffer view
/// that has the time 0 more than once, since times must increase. Thus the size of the file bounds the
/// number of keys of a sampler.
fn times(sampler: &gltf::animation::Sampler<'_>, buffers: &Buffers<'_>) -> Result<Vec<f32>, SourceError> {
    let input = sampler.input();
    let changed = input.sparse().map_or(0, |sparse| sparse.count());
    if input.view().is_none() && input.count() > changed.saturating_add(1) {
        return Err(buffers.wrong(&input, "the times of its keys must increase"));
    }
    Ok(buffers.vectors::<1>(&input)?.into_iter().map(|[time]| time).collect())
}

/// Returns the index of a property among the channels of a node.
fn place(property: Property) -> usize {
    match property {
        Property::Translation => 0,
        Property::Rotation => 1,
        Property::Scale | Property::MorphTargetWeights => 2,
    }
}

impl Clip {
    /// Returns the number of steps from one key to the next.
    fn steps(&self) -> usize {
        (STEPS / self.times.len().max(1)).clamp(1, MOST_STEPS)
    }

    /// Returns the first and last time of each step of the clip, and finally a step of no length at the
    /// clip's last time.
    fn spans(&self) -> impl Iterator<Item = (f64, f64)> {
        let steps = self.steps();
        let within = self.times.windows(2).flat_map(move |pair| {
            let at = move |i: usize| pair[0] + (pair[1] - pair[0]) * (i as f64 / steps as f64);
            (0..steps).map(move |i| (at(i), at(i + 1)))
        });
        within.chain(self.times.last().map(|&last| (last, last)))
    }

    /// Returns the map from a node's space to its parent's, with bounds on its error during a step.
    fn local(&self, node: usize, at_rest: &LocalTransform, from: f64, to: f64) -> ErrorMap {
        let Some([moved, turned, scaled]) = self.channels.get(&node) else {
            return ErrorMap::rounded(at_rest.matrix());
        };
        let (scale, rotation, translation) = at_rest.parts();
        let range = |channel: &Option<Channel>, rest: DVec3| {
            channel.as_ref().map_or((rest, DVec3::ZERO), |channel| channel.vector(from, to))
        };
        let (translation, beside) = range(moved, translation);
        let (scale, wider) = range(scaled, scale);
        let (rotation, angle) = turned.as_ref().map_or((rotation, 0.0), |channel| channel.rotation(from, to));
        // With rotations R and R', scales S and S': |R S p - R' S' p| <= |R (S - S') p| + |(R - R') S' p|. A
        // rotation by an angle moves a unit vector by at most twice the sine of half the angle.
        let turn = 2.0 * (angle.min(std::f64::consts::PI) * 0.5).sin();
        let growing = wider.max_element() + turn * scale.abs().max_element();
        let pose = ErrorMap::rounded(DMat4::from_scale_rotation_translation(scale, rotation, translation));
        ErrorMap { fixed: beside, growing: pose.growing + growing, ..pose }
    }
}

impl Channel {
    /// Reads the keys of a sampler of translation, rotation or scale. If there are more times than values or
    /// the reverse, the surplus is ignored.
    fn read(
        sampler: &gltf::animation::Sampler<'_>,
        property: Property,
        buffers: &Buffers<'_>,
    ) -> Result<Self, SourceError> {
        let mut times = times(sampler, buffers)?;
        let mut values: Vec<Vec4> = if property == Property::Rotation {
            buffers.vectors::<4>(&sampler.output())?.into_iter().map(Vec4::from_array).collect()
        } else {
            let vectors = buffers.vectors::<3>(&sampler.output())?;
            vectors.into_iter().map(|vector| Vec3::from_array(vector).extend(0.0)).collect()
        };
        let interpolation = sampler.interpolation();
        let values_of_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        times.truncate(values.len() / values_of_key);
        values.truncate(times.len() * values_of_key);
        times.shrink_to_fit();
        values.shrink_to_fit();
        Ok(Self { times, values, interpolation })
    }

    /// Returns the key at an index, which must be below the number of times.
    fn key(&self, index: usize) -> Key {
        if self.interpolation == Interpolation::CubicSpline {
            let [before, value, after] = [0, 1, 2].map(|part| self.values[3 * index + part].as_dvec4());
            Key { before, value, after }
        } else {
            Key { before: DVec4::ZERO, value: self.values[index].as_dvec4(), after: DVec4::ZERO }
        }
    }

    /// Returns the time of the key at an index, which must be below the number of times.
    fn time(&self, index: usize) -> f64 {
        f64::from(self.times[index])
    }

    /// Returns the index of the first key after a time, the number of keys if there is none.
    fn next(&self, time: f64) -> usize {
        self.times.partition_point(|&key| f64::from(key) <= time)
    }

    /// Returns whether a value or a tangent differs from the rest pose. Values are compared in `f32`, the
    /// precision of the buffers.
    fn is_moving(&self, at_rest: &LocalTransform, property: Property) -> bool {
        let (scale, rotation, translation) = at_rest.parts();
        let differs = |value: DVec4| match property {
            Property::Rotation => {
                // 1 - |dot| is about half the squared sine of half the angle between the rotations.
                let dot = unit(DQuat::from_vec4(value)).dot(rotation);
                1.0 - dot.abs() > 1e-13
            }
            Property::Translation => value.truncate().as_vec3() != translation.as_vec3(),
            _ => value.truncate().as_vec3() != scale.as_vec3(),
        };
        let bends = |key: &Key| key.before != DVec4::ZERO || key.after != DVec4::ZERO;
        (0..self.times.len()).map(|index| self.key(index)).any(|key| differs(key.value) || bends(&key))
    }

    /// Returns the control points of the channel's curve during a step, which must not span a key, and their
    /// number: 1 if the value is constant. The curve lies within their hull.
    fn hull(&self, from: f64, to: f64) -> ([DVec4; 4], usize) {
        let next = self.next((from + to) * 0.5);
        let key = next.saturating_sub(1);
        let value = self.key(key).value;
        if next == 0 || next == self.times.len() || self.interpolation == Interpolation::Step {
            return ([value; 4], 1);
        }
        let (start, length) = (self.time(key), self.time(next) - self.time(key));
        let part = |time: f64| ((time - start) / length).clamp(0.0, 1.0);
        let (u, v) = (part(from), part(to));
        let (a, b) = (self.key(key), self.key(next));
        if self.interpolation == Interpolation::Linear {
            return ([a.value.lerp(b.value, u), a.value.lerp(b.value, v), DVec4::ZERO, DVec4::ZERO], 2);
        }
        // The Hermite spline in Bezier form, cut to the step by its polar form.
        let third = length / 3.0;
        let points = [a.value, a.value + a.after * third, b.value - b.before * third, b.value];
        let polar = |u: [f64; 3]| {
            let mut p = points;
            for (round, &u) in u.iter().enumerate() {
                for i in 0..3 - round {
                    p[i] = p[i].lerp(p[i + 1], u);
                }
            }
            p[0]
        };
        ([polar([u, u, u]), polar([u, u, v]), polar([u, v, v]), polar([v, v, v])], 4)
    }

    /// Returns the middle of a vector's values during a step, and the greatest deviation from it along each
    /// axis.
    fn vector(&self, from: f64, to: f64) -> (DVec3, DVec3) {
        let (points, count) = self.hull(from, to);
        let (low, high) = around(points[..count].iter().map(|point| point.truncate()));
        ((low + high) * 0.5, (high - low) * 0.5)
    }

    /// Returns a rotation, and the greatest angle in radians between it and the channel's rotations during a
    /// step.
    fn rotation(&self, from: f64, to: f64) -> (DQuat, f64) {
        let middle = (from + to) * 0.5;
        let next = self.next(middle);
        if self.interpolation == Interpolation::Linear && 0 < next && next < self.times.len() {
            // Slerp takes the shorter arc. The angle between unit quaternions is half the angle between the
            // rotations.
            let [a, b] = [next - 1, next].map(|key| unit(DQuat::from_vec4(self.key(key).value)));
            let length = self.time(next) - self.time(next - 1);
            let part = |time: f64| ((time - self.time(next - 1)) / length).clamp(0.0, 1.0);
            if a.dot(b).abs() < HALF_TURN {
                // The rotations of both arcs are equally far from those of the keys.
                let turn = 2.0 * (-HALF_TURN).acos();
                let (after_a, before_b) = (part(to), 1.0 - part(from));
                return if after_a < before_b { (a, turn * after_a) } else { (b, turn * before_b) };
            }
            let b = if a.dot(b) < 0.0 { -b } else { b };
            let half = a.dot(b).min(1.0).acos() * (part(to) - part(from)).abs();
            return (unit(a.slerp(b, part(middle))), half);
        }
        let (points, count) = self.hull(from, to);
        let points = &points[..count];
        let centre = points.iter().sum::<DVec4>() / count as f64;
        let radius = points.iter().map(|point| point.distance(centre)).fold(0.0, f64::max);
        // All quaternions in a ball that does not contain 0 lie in the cone that touches the ball.
        let angle = if radius < centre.length() {
            2.0 * (radius / centre.length()).asin()
        } else {
            std::f64::consts::PI
        };
        (unit(DQuat::from_vec4(centre)), angle)
    }
}

/// Affine map with bounds on its error. The image of a point p differs from `matrix * p` by at most `fixed`
/// along each axis, plus `growing * |p|`.
#[derive(Clone, Copy)]
struct ErrorMap {
    matrix: DMat4,
    /// Upper bound on the length of a unit vector's image under the linear part of `matrix`.
    norm: f64,
    fixed: DVec3,
    growing: f64,
}

impl ErrorMap {
    /// Returns the map of a matrix, with zero error.
    fn exact(matrix: DMat4) -> Self {
        Self { norm: norm(&matrix), matrix, fixed: DVec3::ZERO, growing: 0.0 }
    }

    /// Returns the map of a matrix whose linear part a renderer rounds to `f32`.
    fn rounded(matrix: DMat4) -> Self {
        let exact = Self::exact(matrix);
        Self { growing: ROUNDING * exact.norm, ..exact }
    }

    /// Returns the map that applies `inner` and then this map. For the bound on its error, with q = inner(p):
    /// |q| <= (norm + growing) |p| + |translation| + |fixed|, all of inner.
    fn after(&self, inner: &Self) -> Self {
        let matrix = self.matrix * inner.matrix;
        let parts = DMat3::from_mat4(self.matrix);
        let absolute = DMat3::from_cols(parts.x_axis.abs(), parts.y_axis.abs(), parts.z_axis.abs());
        let reach = inner.matrix.w_axis.truncate().length() + inner.fixed.length();
        Self {
            norm: norm(&matrix),
            matrix,
            fixed: absolute * inner.fixed + self.fixed + self.growing * reach,
            growing: self.norm * inner.growing + self.growing * (inner.norm + inner.growing),
        }
    }

    /// Returns a box that contains the images of all points of a box, enlarged by the rounding of `f32`.
    fn image(&self, bounds: Box64) -> Box64 {
        let corners = corners(bounds);
        let reach = corners.iter().map(|corner| corner.length()).fold(0.0, f64::max);
        let (low, high) = around(corners.map(|corner| self.matrix.transform_point3(corner)));
        let rounding = ROUNDING * (self.norm * reach + (high - low).length());
        let error = self.fixed + self.growing * reach + rounding;
        (low - error, high + error)
    }
}

/// Returns an upper bound on the length of a unit vector's image: the root of the greatest absolute row sum
/// of the matrix times its transpose (Gershgorin). Exact for a rotation with a uniform scale.
fn norm(matrix: &DMat4) -> f64 {
    let part = DMat3::from_mat4(*matrix);
    let product = part.transpose() * part;
    let rows = [0, 1, 2].map(|row| product.row(row).abs().element_sum());
    rows.into_iter().fold(0.0, f64::max).sqrt()
}
