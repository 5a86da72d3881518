//! Sorting polygons into a tree: the same for a new tree, for one that grows, and for a leaf that gets its
//! first polygons.

use super::bsp_tree::{BspError, BspTree};
use super::builder::{Builder, Piece, Source, Task};
use super::node::{EMPTY, NONE, Node, SOLID, bounds_of, is_leaf};
use super::splitter;
use super::store::Record;
use super::subtree::Subtree;
use visibility_core::{
    geometry::{Plane, PolygonSide, SidePlane},
    glam::DVec3,
};

/// Fragments that may come of each polygon, on average, before a tree is given up.
const GROWTH: usize = 256;

impl BspTree {
    /// The tree of some polygons, each with its owner. Both faces of a polygon count; there is no inside.
    ///
    /// Polygons must be convex and flat, up to rounding, with their vertices in order. One that is not finite
    /// or has no area is [left out](Self::accepts).
    ///
    /// # Errors
    /// [`BspError::TooManyFragments`].
    pub fn build<P: AsRef<[DVec3]>>(polygons: impl IntoIterator<Item = (u32, P)>) -> Result<Self, BspError> {
        Self::build_with(EMPTY, polygons)
    }

    /// The tree of the boundary of solids: closed, every polygon counter-clockwise as seen from outside. What
    /// is behind it is [solid](super::Leaf::Solid).
    ///
    /// # Errors
    /// [`BspError::TooManyFragments`].
    pub fn build_solid<P: AsRef<[DVec3]>>(
        polygons: impl IntoIterator<Item = (u32, P)>,
    ) -> Result<Self, BspError> {
        Self::build_with(SOLID, polygons)
    }

    fn build_with<P: AsRef<[DVec3]>>(
        behind: u32,
        polygons: impl IntoIterator<Item = (u32, P)>,
    ) -> Result<Self, BspError> {
        let mut tree = Self { behind, ..Self::new() };
        tree.sort_in(polygons)?;
        let Self { nodes, store, .. } = &mut tree;
        store.pack(nodes.iter_mut().map(|node| &mut node.first));
        tree.nodes.shrink_to_fit();
        tree.subtrees.shrink_to_fit();
        tree.builder = Builder::default();
        Ok(tree)
    }

    /// Whether a polygon can be in a tree: all its vertices are finite, and they span an area.
    pub fn accepts(polygon: &[DVec3]) -> bool {
        plane_of(polygon).is_some()
    }

    /// Sorts polygons into what is there.
    pub(super) fn sort_in<P: AsRef<[DVec3]>>(
        &mut self,
        polygons: impl IntoIterator<Item = (u32, P)>,
    ) -> Result<usize, BspError> {
        let mut builder = core::mem::take(&mut self.builder);
        builder.sources.clear();
        builder.pieces.clear();
        let mut magnitude = self.magnitude;
        for (number, (owner, polygon)) in (0..).zip(polygons) {
            let vertices = polygon.as_ref();
            let Some(plane) = plane_of(vertices) else { continue };
            magnitude = vertices.iter().fold(magnitude, |most, v| most.max(v.abs()));
            builder.pieces.push(Piece {
                source: builder.sources.len() as u32,
                start: self.store.keep(vertices),
                len: vertices.len() as u32,
                bounds: bounds_of(vertices),
            });
            builder.sources.push(Source { owner, number, plane });
        }
        self.reach(magnitude);
        let count = builder.sources.len();
        let result = self.run(&mut builder);
        self.builder = builder;
        result.map(|()| count)
    }

    /// Widens the margins of all planes for greater coordinates; by powers of two, so that it happens rarely.
    fn reach(&mut self, magnitude: DVec3) {
        if magnitude.cmple(self.magnitude).all() {
            return;
        }
        self.magnitude = if self.is_empty() { magnitude } else { magnitude.max(self.magnitude * 2.0) };
        for node in &mut self.nodes {
            node.plane = SidePlane::new(node.plane.plane, self.magnitude);
        }
    }

    fn run(&mut self, builder: &mut Builder) -> Result<(), BspError> {
        let limit = 4096 + GROWTH * builder.sources.len();
        let mut cuts = 0;
        builder.tasks.clear();
        builder.tasks.push(Task { begin: 0, parent: NONE, side: 0, level: 0 });
        while let Some(task) = builder.tasks.pop() {
            if builder.pieces.len() == task.begin {
                continue;
            }
            let child = self.child(task);
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
                    self.store.give_back(piece.start, piece.len);
                }
                return Err(BspError::TooManyFragments { polygons: builder.sources.len(), limit });
            }
        }
        Ok(())
    }

    fn child(&self, task: Task) -> u32 {
        if task.parent == NONE {
            self.root
        } else {
            self.nodes[task.parent as usize].children[usize::from(task.side)]
        }
    }

    fn child_mut(&mut self, task: Task) -> &mut u32 {
        if task.parent == NONE {
            &mut self.root
        } else {
            &mut self.nodes[task.parent as usize].children[usize::from(task.side)]
        }
    }

    /// Makes a node out of a leaf that pieces have come to, and tells the side of each of them.
    fn divide_leaf(&mut self, builder: &mut Builder, task: Task) -> u32 {
        let set = &builder.pieces[task.begin..];
        // A plane of the box, if one divides well; it must leave less on each side than there was, and
        // something on both, so that every leaf is beside a polygon which says what the leaf is.
        let mut chosen = None;
        if let Some(plane) = splitter::box_plane(set) {
            let plane = SidePlane::new(plane, self.magnitude);
            classify(self, builder, task.begin, &plane);
            let count = |side| builder.sides.iter().filter(|&&s| s == side).count();
            let (front, back, across) =
                (count(PolygonSide::Front), count(PolygonSide::Back), count(PolygonSide::Across));
            if front > 0 && back > 0 && across * 2 < front.min(back) {
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
        let node = Node { plane, children: [self.behind, EMPTY], first: NONE, parent: task.parent };
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

    /// Moves the pieces of a task to a node and to both sides of it, as `builder.sides` says. Returns how
    /// many were cut.
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
                    let [whole, ahead, behind] = &mut *cut;
                    whole.clear();
                    whole.extend_from_slice(self.store.vertices_at(piece.start, piece.len));
                    crate::polygon_cut::cut(whole, &plane, ahead, behind);
                    self.store.give_back(piece.start, piece.len);
                    for (half, list) in [(&*ahead, &mut *front), (&*behind, &mut *back)] {
                        if half.len() >= 3 {
                            let (start, bounds) = (self.store.keep(half), bounds_of(half));
                            list.push(Piece { start, len: half.len() as u32, bounds, ..piece });
                        }
                    }
                    cuts += 1;
                }
            }
        }
        tasks.push(Task { begin, parent: node, side: 0, level: level + 1 });
        pieces.extend_from_slice(back);
        tasks.push(Task { begin: pieces.len(), parent: node, side: 1, level: level + 1 });
        pieces.extend_from_slice(front);
        cuts
    }

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

/// Tells the side of each of the topmost pieces.
fn classify(tree: &BspTree, builder: &mut Builder, begin: usize, plane: &SidePlane) {
    builder.sides.clear();
    for piece in &builder.pieces[begin..] {
        builder.sides.push(plane.side_of_polygon(tree.store.vertices_at(piece.start, piece.len)));
    }
}

/// The plane of a polygon, from all its vertices; `None` if there is none.
fn plane_of(vertices: &[DVec3]) -> Option<Plane> {
    if vertices.len() < 3 || !vertices.iter().all(|v| v.is_finite()) {
        return None;
    }
    let normal = match vertices {
        [a, b, c] => (b - a).cross(c - a),
        _ => (2..vertices.len())
            .map(|i| (vertices[i - 1] - vertices[0]).cross(vertices[i] - vertices[0]))
            .fold(DVec3::ZERO, |sum, area| sum + area),
    };
    let plane = Plane::through(vertices[0], normal.try_normalize()?);
    plane.offset.is_finite().then_some(plane)
}
