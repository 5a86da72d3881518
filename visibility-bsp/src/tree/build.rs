//! Sorting of polygons into a tree. One procedure serves new trees, growing trees, and leaves that receive
//! their first polygons.

use super::bsp_tree::{BspError, BspTree};
use super::build_scratch::{Builder, Piece, Source, Task};
use super::node::{EMPTY, NONE, Node, is_leaf};
use super::splitter;
use super::store::Record;
use super::subtree::Subtree;
use visibility_core::{
    Aabb,
    geometry::{Plane, PolygonSide, SidePlane},
    glam::DVec3,
};

/// Number of cuts that each inserted polygon adds to the limit of 4,096 cuts beyond which building fails.
const GROWTH: usize = 256;

impl BspTree {
    /// Builds a tree of polygons in `f64` coordinates of any unit, each given with its owner number. Polygons
    /// are two-sided: walks of the tree find them whichever side the eye sees.
    ///
    /// Polygons must be convex and flat, up to rounding, with their vertices in boundary order. A polygon
    /// that is not [accepted](Self::accepts) is left out. Takes some microseconds per polygon.
    ///
    /// # Errors
    /// [`BspError::TooManyFragments`] if building makes more than 4,096 cuts plus 256 for each polygon.
    pub fn build<P: AsRef<[DVec3]>>(polygons: impl IntoIterator<Item = (u32, P)>) -> Result<Self, BspError> {
        let mut tree = Self::new();
        tree.sort_in(polygons)?;
        let Self { nodes, store, .. } = &mut tree;
        store.pack(nodes.iter_mut().map(|node| &mut node.first));
        tree.nodes.shrink_to_fit();
        tree.subtrees.shrink_to_fit();
        tree.builder = Builder::default();
        Ok(tree)
    }

    /// Tests whether a polygon can be inserted: at least three vertices, all finite, that span an area. False
    /// for any other polygon. The vertices may be in any space and unit.
    pub fn accepts(polygon: &[DVec3]) -> bool {
        Plane::from_polygon(polygon).is_some()
    }

    /// Sorts polygons, given with their owner numbers and in the tree's coordinates, into the present tree.
    /// Returns the number of accepted polygons. On an error, a part of them has been inserted.
    pub(super) fn sort_in<P: AsRef<[DVec3]>>(
        &mut self,
        polygons: impl IntoIterator<Item = (u32, P)>,
    ) -> Result<usize, BspError> {
        let mut builder = core::mem::take(&mut self.builder);
        builder.sources.clear();
        builder.pieces.clear();
        let mut magnitude = if self.is_empty() { DVec3::ZERO } else { self.magnitude };
        for (number, (owner, polygon)) in (0..).zip(polygons) {
            let vertices = polygon.as_ref();
            let Some(plane) = Plane::from_polygon(vertices) else { continue };
            magnitude = vertices.iter().fold(magnitude, |most, v| most.max(v.abs()));
            builder.pieces.push(Piece {
                source: builder.sources.len() as u32,
                start: self.store.alloc(vertices),
                len: vertices.len() as u32,
                bounds: Aabb::around(vertices.iter().copied()),
            });
            builder.sources.push(Source { owner, number, plane });
        }
        self.raise_magnitude(magnitude);
        let count = builder.sources.len();
        let result = self.run(&mut builder);
        self.builder = builder;
        result.map(|()| count)
    }

    /// Raises the bound on the magnitude of coordinates to at least `magnitude`, given for each axis, and
    /// widens the margins of all planes accordingly. Does nothing if the bound is at least `magnitude` on all
    /// axes already. Otherwise, in a tree with polygons, the bound at least doubles on each axis on which it
    /// grows, so that planes are seldom computed anew.
    fn raise_magnitude(&mut self, magnitude: DVec3) {
        let grows = magnitude.cmpgt(self.magnitude);
        if self.is_empty() {
            self.set_magnitude(magnitude);
        } else if grows.any() {
            let doubled = magnitude.max(self.magnitude * 2.0);
            self.set_magnitude(DVec3::select(grows, doubled, self.magnitude));
        }
    }

    /// Sets the bound on the magnitude of coordinates, by axis, and the margins of all planes accordingly.
    /// All polygons in the tree must be within it.
    pub(super) fn set_magnitude(&mut self, magnitude: DVec3) {
        self.magnitude = magnitude;
        for node in &mut self.nodes {
            node.plane = SidePlane::new(node.plane.plane, self.magnitude);
        }
    }

    /// Sorts `builder.pieces` into the tree until all of them are in nodes. On an error, the remaining pieces
    /// are freed.
    fn run(&mut self, builder: &mut Builder) -> Result<(), BspError> {
        let limit = 4096 + GROWTH * builder.sources.len();
        let mut cuts = 0;
        builder.tasks.clear();
        builder.tasks.push(Task { begin: 0, parent: NONE, side: 0, level: 0 });
        while let Some(task) = builder.tasks.pop() {
            if builder.pieces.len() == task.begin {
                continue;
            }
            let child = *self.child_mut(task);
            let node = if is_leaf(child) {
                let node = self.divide_leaf(builder, task);
                *self.child_mut(task) = node;
                node
            } else {
                classify(self, builder, task.begin, &self.nodes[child as usize].plane);
                child
            };
            self.most_levels = self.most_levels.max(task.level + 1);
            cuts += self.distribute(builder, task, node);
            if cuts > limit {
                for piece in builder.pieces.drain(..) {
                    self.store.free_range(piece.start, piece.len);
                }
                // A new axis-aligned plane has no fragment whose removal would close its node.
                self.close(node);
                return Err(BspError::TooManyFragments { polygons: builder.sources.len(), limit });
            }
        }
        Ok(())
    }

    /// Returns a reference to the link to the child that the pieces of `task` are to be sorted into: the
    /// child of node `task.parent` on side `task.side`, or the root of the tree without a parent. The link is
    /// the index of a node, or [`EMPTY`] for a leaf; [`is_leaf`] tells them apart.
    fn child_mut(&mut self, task: Task) -> &mut u32 {
        if task.parent == NONE {
            &mut self.root
        } else {
            &mut self.nodes[task.parent as usize].children[usize::from(task.side)]
        }
    }

    /// Makes a node in place of the leaf that the pieces of `task` have reached, and writes the side of each
    /// piece to `builder.sides`. Returns the node's index.
    fn divide_leaf(&mut self, builder: &mut Builder, task: Task) -> u32 {
        let set = &builder.pieces[task.begin..];
        // An axis-aligned plane is used if it splits well: it cuts less than half as many pieces as are on
        // either side. So some are on each side, and both sets are smaller, or there would be no end.
        let mut chosen = None;
        if let Some(plane) = splitter::box_plane(set) {
            let plane = SidePlane::new(plane, self.magnitude);
            classify(self, builder, task.begin, &plane);
            let count = |side| builder.sides.iter().filter(|&&s| s == side).count();
            let (front, back, across) =
                (count(PolygonSide::Front), count(PolygonSide::Back), count(PolygonSide::Across));
            if across * 2 < front.min(back) {
                chosen = Some(plane);
            }
        }
        let plane = chosen.unwrap_or_else(|| {
            let set = &builder.pieces[task.begin..];
            let best = splitter::polygon(
                set,
                &builder.sources,
                |piece| self.store.vertices_at(piece.start, piece.len),
                self.magnitude,
            );
            let source = set[best].source;
            let plane = SidePlane::new(builder.sources[source as usize].plane, self.magnitude);
            classify(self, builder, task.begin, &plane);
            // A polygon lies in its own plane, however its vertices are rounded.
            builder.sides[best] = PolygonSide::On;
            plane
        });
        let node = Node { plane, children: [EMPTY; 2], first: NONE, parent: task.parent };
        match self.free_nodes.pop() {
            Some(id) => {
                self.nodes[id as usize] = node;
                self.subtrees[id as usize] = Subtree::NOTHING;
                id
            }
            None => {
                self.nodes.push(node);
                self.subtrees.push(Subtree::NOTHING);
                self.nodes.len() as u32 - 1
            }
        }
    }

    /// Distributes the pieces of a task by their sides of the plane of node `node`, as listed in
    /// `builder.sides`. Pieces in the plane become fragments of the node. Pieces in front and pieces behind
    /// make two new tasks, one for each child. Pieces across the plane are cut. Returns the number of cut
    /// pieces.
    fn distribute(&mut self, builder: &mut Builder, Task { begin, level, .. }: Task, node: u32) -> usize {
        let Builder { sources, pieces, tasks, sides, front, back, cut, .. } = builder;
        let plane = self.nodes[node as usize].plane;
        front.clear();
        back.clear();
        let mut cuts = 0;
        for (piece, side) in pieces.drain(begin..).zip(sides.iter()) {
            match side {
                PolygonSide::Front => front.push(piece),
                PolygonSide::Back => back.push(piece),
                PolygonSide::On => self.attach(&piece, &sources[piece.source as usize], node),
                PolygonSide::Across => {
                    // Both halves are stored anew, the cut piece is freed. A half of fewer than three corners
                    // has no area.
                    let [whole, ahead, behind] = &mut *cut;
                    whole.clear();
                    whole.extend_from_slice(self.store.vertices_at(piece.start, piece.len));
                    crate::polygon_cut::cut(whole, &plane, ahead, behind);
                    self.store.free_range(piece.start, piece.len);
                    for (half, list) in [(&*ahead, &mut *front), (&*behind, &mut *back)] {
                        if half.len() >= 3 {
                            let (start, bounds) =
                                (self.store.alloc(half), Aabb::around(half.iter().copied()));
                            list.push(Piece { start, len: half.len() as u32, bounds, ..piece });
                        }
                    }
                    cuts += 1;
                }
            }
        }
        // Pieces behind first: the task on top of the stack, the front, has its pieces at the end.
        tasks.push(Task { begin, parent: node, side: 0, level: level + 1 });
        pieces.extend_from_slice(back);
        tasks.push(Task { begin: pieces.len(), parent: node, side: 1, level: level + 1 });
        pieces.extend_from_slice(front);
        cuts
    }

    /// Stores a piece of the polygon `source` as a fragment in the plane of node `node`, and extends the
    /// bounds of the node and its ancestors.
    fn attach(&mut self, piece: &Piece, source: &Source, node: u32) {
        let target = &mut self.nodes[node as usize];
        let record = Record {
            owner: source.owner,
            polygon: source.number,
            start: piece.start,
            len: piece.len,
            node,
            next: NONE,
            previous: NONE,
            next_of_owner: NONE,
            same_way: source.plane.normal.dot(target.plane.plane.normal) >= 0.0,
        };
        target.first = self.store.add(record, target.first);
        self.grow(node, &Subtree::of(piece.bounds, source.owner));
    }
}

/// Replaces `builder.sides` by the side of `plane` (in the tree's coordinates) on which each piece of
/// `builder.pieces[begin..]` lies, in order.
fn classify(tree: &BspTree, builder: &mut Builder, begin: usize, plane: &SidePlane) {
    builder.sides.clear();
    for piece in &builder.pieces[begin..] {
        builder.sides.push(plane.side_of_polygon(tree.store.vertices_at(piece.start, piece.len)));
    }
}
