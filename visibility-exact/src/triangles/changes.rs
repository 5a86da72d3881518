//! Triangles of a scene that follow the scene's changes. Objects that have not changed keep the indices of
//! their triangles, vertices, edges and convex polygons, so that lines of sight and proofs made before still
//! name the same triangles.

use super::log::Change;
use super::welding::{Welding, edge_key, vertex_key};
use super::{Piece, SceneTriangles, TargetObject, TriangleFacts, greatest, is_left_open, target_box};
use crate::triangle_tree::TriangleTree;
use alloc::collections::BTreeSet;
use alloc::{boxed::Box, vec, vec::Vec};
use visibility_core::Scene;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::level_version::level_object;
use visibility_core::scene::Changes;
use visibility_core::stamp::Stamp;

impl SceneTriangles {
    /// Takes in all changes of the scene since the triangles were collected or last synchronised. Returns
    /// whether something changed that visibility depends on.
    ///
    /// Objects that were inserted since are listed after the others, or in place of the removed object whose
    /// index they have. Verdicts and proofs found before are of the earlier state, as positions in the list
    /// of objects; [`DynamicCell`](crate::DynamicCell) brings its verdicts up to date. All triangles are
    /// collected anew if the changes are [not known](Changes::Everything).
    ///
    /// With n the number of triangles of all objects that have changed since the triangles were collected, at
    /// most about a quarter of all, and m the number of all: time is O(n log n), plus O(log m) for each
    /// triangle that changes, plus O(k log k) for each edge of such a triangle, with k the number of
    /// triangles at the edge. The first call after a change takes O(m) once. Memory is reused while an object
    /// has no more triangles than it ever had. An object that has more gets room for at least twice as many
    /// as before.
    pub fn sync(&mut self, scene: &Scene) -> bool {
        let mut cursor = self.cursor;
        let changed: BTreeSet<usize> = match cursor.follow(scene) {
            Changes::Objects(ids) => ids.iter().map(|id| id.index()).collect(),
            Changes::Everything => {
                *self = Self::new(scene);
                return true;
            }
        };
        self.cursor = cursor;
        if changed.is_empty() {
            return false;
        }
        let mut welding = self.welding.take().unwrap_or_else(|| Box::new(self.new_welding()));
        let (mut log, mut broken) = (Vec::new(), BTreeSet::new());
        for index in changed {
            log.extend(self.sync_object(scene, index, &mut welding, &mut broken));
        }
        self.clean_lists(&mut welding);
        let is_changed = !log.is_empty();
        if is_changed {
            self.log.serial += 1;
            let places: BTreeSet<u32> = log.iter().map(|change| change.place).collect();
            let occluders = places.iter().flat_map(|&place| {
                let object = &self.objects[place as usize];
                (object.first..object.end).filter(|&t| self.occludes[t as usize])
            });
            let mut unmerged: Vec<u32> = occluders.collect();
            welding.added.retain(|&t| !places.contains(&self.object_of[t as usize]));
            welding.added.extend_from_slice(&unmerged);
            // Polygons that have lost a triangle are joined anew from the remaining ones.
            for number in broken {
                let piece = &mut self.pieces[number as usize];
                let triangles = core::mem::replace(piece, Piece::empty(self.log.serial)).triangles;
                let left = triangles.iter().copied().filter(|&t| self.piece_of[t as usize] == number);
                unmerged.extend(left);
                welding.free_pieces.push(number);
            }
            for &t in &unmerged {
                self.piece_of[t as usize] = u32::MAX;
            }
            let is_one_sided = |t: u32| self.fronts[t as usize].is_some();
            if welding.added.len() > 1024 + self.tree.first_count() / 4 {
                let all = 0..self.corners.len() as u32;
                let occluders = all.filter(|&t| self.occludes[t as usize]).collect();
                self.tree = TriangleTree::new(&self.corners, occluders, is_one_sided);
                welding.added.clear();
            } else {
                self.tree.set_added(&self.corners, &welding.added, is_one_sided);
            }
            self.welding = Some(welding);
            self.merge(unmerged);
            self.log.push(log, self.objects.len());
        } else {
            self.welding = Some(welding);
        }
        is_changed
    }

    /// Returns the numbers of vertices and edges by what they are equal to, before the first change.
    fn new_welding(&self) -> Welding {
        let limit = self.objects.iter().map(|object| object.id.index() + 1).max().unwrap_or(0);
        let mut place_of = vec![u32::MAX; limit];
        for (object, place) in self.objects.iter().zip(0..) {
            place_of[object.id.index()] = place;
        }
        // Vertices and edges are numbered by the ranks of their keys.
        let numbers = self.vertices.as_flattened();
        let mut vertices = vec![[0; 3]; numbers.iter().map(|&v| v as usize + 1).max().unwrap_or(0)];
        let mut edges = vec![[0; 2]; self.edge_count()];
        for (t, corners) in self.corners.iter().enumerate() {
            for k in 0..3 {
                vertices[self.vertices[t][k] as usize] = vertex_key(corners[k]);
                edges[self.edges[t][k] as usize] = edge_key(self.vertices[t], k);
            }
        }
        Welding::new(place_of, vertices, edges)
    }

    /// Takes in the present state of the object with index `index` in the scene. Adds to `broken` the
    /// polygons that it had a part in. Returns the change, or `None` if nothing has changed that visibility
    /// depends on.
    fn sync_object(
        &mut self,
        scene: &Scene,
        index: usize,
        welding: &mut Welding,
        broken: &mut BTreeSet<u32>,
    ) -> Option<Change> {
        let id = scene.id_at(index);
        let present = id.and_then(|id| Some((id, level_object(scene, id)?.0, scene.triangles(id).ok()?)));
        let known = welding.place_of.get(index).copied().filter(|&place| place != u32::MAX);
        let (mut facts, mut now) = (Vec::new(), None);
        if let Some((id, object, triangles)) = present {
            let is_open = is_left_open(&object, triangles);
            let used = triangles.iter().filter(|_| !is_open);
            facts.extend(used.map(|triangle| TriangleFacts::new(&object, triangle)));
            let occludes = facts.iter().any(|facts| facts.occludes);
            let [min, max] = target_box(scene, id, triangles);
            now = Some(TargetObject {
                id,
                min,
                max,
                layers: if occludes { object.layers } else { 0 },
                first: 0,
                end: 0,
                room_end: 0,
                is_open,
                is_removed: false,
            });
        }
        let place = match (known, &now) {
            (Some(place), _) => place as usize,
            (None, None) => return None,
            (None, Some(now)) => {
                let removed = TargetObject { layers: 0, is_open: true, is_removed: true, ..now.clone() };
                self.objects.push(removed);
                if welding.place_of.len() <= index {
                    welding.place_of.resize(index + 1, u32::MAX);
                }
                welding.place_of[index] = self.objects.len() as u32 - 1;
                self.objects.len() - 1
            }
        };
        let was = self.objects[place].clone();
        let now = now.unwrap_or(TargetObject { layers: 0, is_open: true, is_removed: true, ..was.clone() });
        // Lines of sight do not depend on layers, so an object that has changed its layers alone is the same.
        self.count_layers(was.layers, now.layers);
        self.objects[place].layers = now.layers;
        if self.is_same(&was, &now, &facts) {
            return None;
        }
        let mut occluded = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        for t in was.first..was.end {
            if self.occludes(t) {
                let [min, max] = occluded;
                let corners = self.corners(t);
                occluded =
                    [corners.iter().fold(min, |a, &b| a.min(b)), corners.iter().fold(max, |a, &b| a.max(b))];
                broken.insert(self.piece_of(t));
            }
            self.clear_triangle(t, welding);
        }
        let count = facts.len() as u32;
        let (mut first, mut room_end) = (was.first, was.room_end);
        if count > room_end - first {
            // At least twice the former room: an object that grows step by step leaves no more behind than it
            // has.
            let room = count.max(2 * (room_end - first));
            first = self.corners.len() as u32;
            room_end = first + room;
            self.add_room(place as u32, room_end as usize);
        }
        for (facts, t) in facts.into_iter().zip(first..) {
            self.set_triangle(t, facts, welding);
        }
        self.objects[place] = TargetObject { first, end: first + count, room_end, ..now };
        Some(Change { place: place as u32, was: occluded })
    }

    /// Counts an occluder on the layers `now` in place of one on the layers `was`; 0 stands for none.
    fn count_layers(&mut self, was: u32, now: u32) {
        if now != 0 {
            *self.layers.entry(now).or_default() += 1;
        }
        if let Some(count) = self.layers.get_mut(&was) {
            *count -= 1;
            if *count == 0 {
                self.layers.remove(&was);
            }
        }
    }

    /// Returns whether an object with these triangles is, for visibility, what it was. Another object at the
    /// index of a removed one is not, even where it looks the same: verdicts name the id of their object.
    fn is_same(&self, was: &TargetObject, now: &TargetObject, facts: &[TriangleFacts]) -> bool {
        let range = was.first as usize..was.end as usize;
        (was.id, was.is_open, was.is_removed) == (now.id, now.is_open, now.is_removed)
            && (was.is_removed || (was.min, was.max) == (now.min, now.max))
            && range.len() == facts.len()
            && range.zip(facts).all(|(t, facts)| {
                self.corners[t] == facts.corners
                    && self.occludes[t] == facts.occludes
                    && self.fronts[t] == facts.front
            })
    }

    /// Adds unused triangles of the object at `place`, up to the index `end`.
    fn add_room(&mut self, place: u32, end: usize) {
        self.corners.resize(end, [Vec3::ZERO; 3]);
        self.vertices.resize(end, [0; 3]);
        self.object_of.resize(end, place);
        self.occludes.resize(end, false);
        self.fronts.resize(end, None);
        self.areas.resize(end, 0.0);
        self.edges.resize(end, [0; 3]);
        self.piece_of.resize(end, u32::MAX);
    }

    /// Takes triangle `t` away: its index is unused until the next [`set_triangle`](Self::set_triangle). The
    /// lists of its edges still have it until the next [`clean_lists`](Self::clean_lists).
    fn clear_triangle(&mut self, t: u32, welding: &mut Welding) {
        let at = t as usize;
        if core::mem::take(&mut self.occludes[at]) {
            welding.stale_edges.extend(self.edges[at]);
            self.tree.remove(t);
            self.piece_of[at] = u32::MAX;
        }
        for k in 0..3 {
            welding.edges.release(edge_key(self.vertices[at], k));
            welding.vertices.release(vertex_key(self.corners[at][k]));
        }
        (self.areas[at], self.fronts[at]) = (0.0, None);
    }

    fn set_triangle(&mut self, t: u32, facts: TriangleFacts, welding: &mut Welding) {
        let at = t as usize;
        self.magnitude = greatest(self.magnitude, &facts.corners);
        self.vertices[at] = facts.corners.map(|corner| welding.vertices.take(vertex_key(corner)));
        self.edges[at] = core::array::from_fn(|k| welding.edges.take(edge_key(self.vertices[at], k)));
        (self.corners[at], self.occludes[at]) = (facts.corners, facts.occludes);
        (self.areas[at], self.fronts[at]) = (facts.area, facts.front);
        if facts.occludes {
            for edge in self.edges[at] {
                self.list(edge, welding).push(t);
            }
        }
    }

    /// Removes triangles that were taken away from the lists of their edges, and repetitions of those that
    /// have come back to an edge. Each list is read once, however many of its triangles have changed.
    fn clean_lists(&self, welding: &mut Welding) {
        let mut edges = core::mem::take(&mut welding.stale_edges);
        edges.sort_unstable();
        edges.dedup();
        for &edge in &edges {
            let list = self.list(edge, welding);
            list.sort_unstable();
            list.dedup();
            list.retain(|&t| {
                #[cfg(test)]
                visibility_testing::step();
                self.occludes(t) && self.edges(t).contains(&edge)
            });
        }
        edges.clear();
        welding.stale_edges = edges;
    }

    /// Returns the list of the occluding triangles at an edge, to be changed.
    fn list<'a>(&self, edge: u32, welding: &'a mut Welding) -> &'a mut Vec<u32> {
        welding.lists.entry(edge).or_insert_with(|| {
            let ends = (self.edge_starts.get(edge as usize), self.edge_starts.get(edge as usize + 1));
            let (Some(&start), Some(&end)) = ends else { return Vec::new() };
            self.edge_triangles.get(start as usize..end as usize).unwrap_or_default().to_vec()
        })
    }

    /// Returns the stamp of the present state.
    pub(crate) fn stamp(&self) -> Stamp {
        self.log.stamp
    }

    /// Returns the number of the present state: how often something has changed.
    pub(crate) fn serial(&self) -> u64 {
        self.log.serial
    }

    /// Returns whether a convex polygon is another one than in the state with number `serial`.
    pub(crate) fn is_piece_newer(&self, number: u32, serial: u64) -> bool {
        self.pieces.get(number as usize).is_none_or(|piece| piece.made > serial)
    }

    /// Returns the changes since the state with the stamp `since`, oldest first. An object may have several.
    /// `None` if that state is of other triangles, or of too long ago.
    pub(crate) fn changes_since(&self, since: Stamp) -> Option<impl Iterator<Item = &Change>> {
        let entries = &self.log.entries;
        let from = if since == self.log.stamp {
            Some(entries.len())
        } else {
            entries.iter().rposition(|(before, _)| *before == since)
        };
        from.map(|from| entries.range(from..).flat_map(|(_, changes)| changes.iter()))
    }
}
