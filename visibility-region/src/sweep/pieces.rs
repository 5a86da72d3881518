//! Pieces: connected surfaces that face a viewcell, each with its contour.
//!
//! Every triangle that shows one side to the whole cell is turned to face the cell. Two such triangles on one
//! segment that run along it in opposite directions are *paired*: a ray that crosses the segment leaves one
//! and enters the other, so the segment does not bound them. The remaining sides bound the surface: together
//! they are its contour. If a side has several possible partners, it is paired with the one that continues
//! the surface most flatly. So where three triangles meet at an edge, as at the walls between houses of a
//! row, the wall stays unpaired, and the fronts and roofs of the row become one surface.
//!
//! A piece consists of triangles that are paired, directly or through others.
//!
//! From one end of the cell, a convex solid hides what lies behind its front faces, and from the other end,
//! what lies behind its back faces. If the cell is wider than the solid, the hidden region narrows with the
//! distance from the drawn faces, and the back faces start farther away. So both are drawn.

use super::direction::CellBox;
use super::effort::Effort;
use super::facing::facing;
use super::surfaces::{Back, Part, Surfaces};
use alloc::vec::Vec;
use visibility_core::Aabb;
use visibility_core::bits::Bits;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::stamp::Stamp;
use visibility_core::union_find::root;

/// Greatest number of drawn triangles, all of which run along a segment in the same direction, that are
/// paired with triangles of the other direction. The search for the flattest partner takes time proportional
/// to the square of this number. With more triangles, none is paired, and the segment is a part of the
/// contours of all.
const MAX_ON_SEGMENT: usize = 32;

/// The pieces of surfaces that face one viewcell. Those of the viewcells before are kept: a cluster of which
/// each triangle shows the next viewcell the same side has the same pieces there.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pieces {
    /// Facing of each triangle of the clusters in `kept`, by triangle, for the viewcell for which the cluster
    /// was found last: 1 if its front faces the whole cell, -1 if its back occludes and faces the whole cell,
    /// otherwise 0. 0 for triangles of objects that did not occlude in that call.
    facing: Vec<i8>,
    parent: Vec<u32>,
    /// Entries for the triangles that represent pieces. While triangles are paired: the number of triangles
    /// of the piece. Afterwards: the index of the piece.
    count: Vec<u32>,
    /// Clusters whose pieces have been found for the present viewcell.
    found: Bits,
    /// Clusters whose pieces, for this viewcell or an earlier one, are listed in `ranges`.
    kept: Bits,
    /// State of the surfaces that the kept pieces are of.
    stamp: Option<Stamp>,
    /// The box of the present viewcell, if the viewcell is a whole box.
    present: Option<[DVec3; 2]>,
    /// A box that holds the present viewcell: its ends, the facing of triangles towards it, and the clusters
    /// for which that is known. A triangle that shows one side to all of it shows that to the viewcell.
    around: Option<[DVec3; 2]>,
    facing_around: Vec<i8>,
    known_around: Bits,
    ranges: Vec<[u32; 2]>,
    /// Scratch memory for the contours of the present cluster: pairs of a triangle and a segment that bounds
    /// the triangle's piece there, in the order in which they were found.
    bounding: Vec<(u32, u32)>,
    triangles: Vec<u32>,
    contours: Vec<u32>,
    pieces: Vec<Piece>,
    plus: Vec<u32>,
    minus: Vec<u32>,
    /// Greatest number of triangles in a piece.
    max_triangles: u32,
    joins: bool,
}

/// A piece: its bounds, and the ranges, as start and exclusive end, of its triangles and of its contour
/// segments in the lists of [`Pieces`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    pub(crate) bounds: Aabb,
    triangles: [u32; 2],
    contour: [u32; 2],
    /// True if the piece contains triangles of several parts of meshes.
    pub(crate) joins: bool,
}

impl Pieces {
    /// Begins the next viewcell, with the limits for pieces of `effort`. Removes the pieces of the viewcells
    /// before if these are of other surfaces or had other limits, or together have more triangles than all
    /// surfaces.
    pub(crate) fn begin(&mut self, surfaces: &Surfaces, effort: &Effort, cell: &Viewcell) {
        // The box along the axes of a viewcell with planes may reach out of the viewcell's bounds.
        let holds = |[min, max]: [DVec3; 2]| {
            cell.planes.is_empty() && min.cmple(cell.min).all() && cell.max.cmple(max).all()
        };
        let of_same_surfaces = |ends: &[DVec3; 2]| self.stamp == surfaces.stamp && holds(*ends);
        if let Some(last) = self.present.filter(of_same_surfaces) {
            self.around = Some(last);
            self.facing_around.clone_from(&self.facing);
            self.known_around.clone_from(&self.found);
        } else if !self.around.as_ref().is_some_and(of_same_surfaces) {
            self.around = None;
            self.known_around.reset(surfaces.cluster_count());
        }
        self.present = cell.planes.is_empty().then_some([cell.min, cell.max]);
        let is_same = self.stamp == surfaces.stamp
            && (self.max_triangles, self.joins) == (effort.max_triangles, effort.joins);
        if !is_same || self.triangles.len() > surfaces.triangles.len() {
            (self.max_triangles, self.joins) = (effort.max_triangles, effort.joins);
            self.stamp = surfaces.stamp;
            self.triangles.clear();
            self.contours.clear();
            self.pieces.clear();
            self.kept.reset(surfaces.cluster_count());
        }
        self.found.reset(surfaces.cluster_count());
        self.ranges.resize(surfaces.cluster_count(), [0; 2]);
        let count = surfaces.triangles.len();
        self.facing.resize(count, 0);
        self.parent.resize(count, 0);
        self.count.resize(count, 0);
    }

    /// Finds the pieces of a cluster's occluding objects, unless they have been found already. Returns their
    /// indices: pieces of single parts of meshes come first, then, if wanted, pieces that join several parts.
    pub(crate) fn find(
        &mut self,
        surfaces: &Surfaces,
        cluster: usize,
        occluding: &Bits,
        cell: &CellBox,
    ) -> core::ops::Range<u32> {
        if self.found.insert(cluster) {
            let mut is_kept = self.kept.contains(cluster);
            let is_known = self.known_around.contains(cluster);
            let direction = cell.direction(0);
            // The part of the triangles before: its index, whether it occludes, and whether the cell is
            // outside of it. Triangles of a part follow one another.
            let mut part = (u32::MAX, false, false);
            for &triangle in surfaces.triangles_of(cluster) {
                let surface = &surfaces.triangles[triangle as usize];
                if surface.part != part.0 {
                    let Part { owner, bounds } = *surfaces.part(surface);
                    let owner = owner as usize;
                    // An object may have been listed again, in another cluster.
                    let is_present = occluding.contains(owner) && surfaces.cluster_of(owner) == Some(cluster);
                    let bounds = direction.local_box(&bounds);
                    part = (surface.part, is_present, direction.is_outside(&bounds, 4.0 * direction.error));
                }
                let (_, is_present, is_outside) = part;
                let around = if is_known { self.facing_around[triangle as usize] } else { 0 };
                let facing = match (is_present, around) {
                    (false, _) => 0,
                    (true, 0) => cell.facing(surface.corners.map(|p| p.as_dvec3())),
                    (true, around) => around,
                };
                let facing = match surface.back {
                    Back::Transparent => facing.max(0),
                    Back::OfSolid if !is_outside => facing.max(0),
                    _ => facing,
                };
                let kept = core::mem::replace(&mut self.facing[triangle as usize], facing);
                is_kept &= kept == facing;
            }
            if is_kept {
                return self.range(cluster);
            }
            self.kept.insert(cluster);
            let first = self.pieces.len() as u32;
            let joins = self.joins || surfaces.joins_objects(cluster);
            for joins in [false, true].into_iter().take(1 + usize::from(joins)) {
                self.pair(surfaces, cluster, joins);
                self.collect(surfaces, cluster, joins);
            }
            self.ranges[cluster] = [first, self.pieces.len() as u32];
        }
        self.range(cluster)
    }

    /// Returns the indices of the pieces found last for a cluster.
    fn range(&self, cluster: usize) -> core::ops::Range<u32> {
        self.ranges[cluster][0]..self.ranges[cluster][1]
    }

    /// Returns the number of pieces found so far.
    #[cfg(test)]
    pub(crate) fn len(&self) -> usize {
        self.pieces.len()
    }

    pub(crate) fn get(&self, piece: u32) -> &Piece {
        &self.pieces[piece as usize]
    }

    /// Returns the indices of a piece's triangles in its [`Surfaces`].
    pub(crate) fn triangles(&self, piece: &Piece) -> &[u32] {
        &self.triangles[piece.triangles[0] as usize..piece.triangles[1] as usize]
    }

    /// Returns the indices of the segments that bound a piece, in its [`Surfaces`].
    pub(crate) fn contour(&self, piece: &Piece) -> &[u32] {
        &self.contours[piece.contour[0] as usize..piece.contour[1] as usize]
    }

    /// Joins drawn triangles of a cluster into pieces: on each segment, pairs triangles of the same part
    /// whose outlines run along the segment in opposite directions. With `joins`, triangles of different
    /// parts are paired too.
    fn pair(&mut self, surfaces: &Surfaces, cluster: usize, joins: bool) {
        for &triangle in surfaces.triangles_of(cluster) {
            self.parent[triangle as usize] = triangle;
            self.count[triangle as usize] = 1;
        }
        self.bounding.clear();
        let part = |triangle: u32| surfaces.triangles[triangle as usize].part;
        for &segment in surfaces.segments_of(cluster) {
            self.plus.clear();
            self.minus.clear();
            // Sides of drawn triangles on this segment, grouped by the direction in which the triangle's
            // outline, as seen from the cell, runs along the segment.
            for &side in surfaces.sides(segment as usize) {
                let (triangle, forward) = (side / 2, side % 2 == 1);
                match self.facing[triangle as usize] {
                    0 => {}
                    facing if (facing > 0) == forward => self.plus.push(triangle),
                    _ => self.minus.push(triangle),
                }
            }
            // There are too many triangles on this segment to pair them: the segment bounds each of them.
            if self.plus.len().max(self.minus.len()) > MAX_ON_SEGMENT {
                let all = self.plus.iter().chain(&self.minus);
                self.bounding.extend(all.map(|&triangle| (triangle, segment)));
                continue;
            }
            while let Some(first) = self.plus.pop() {
                let fits = |&(_, &other): &(usize, &u32)| joins || part(first) == part(other);
                let partners = self.minus.iter().enumerate().filter(fits);
                // The partner that bends the surface least is chosen, so that pieces stay flat.
                let partner = if self.minus.len() == 1 {
                    partners.map(|(at, _)| at).next()
                } else {
                    let flat = |other: u32| self.flatness(surfaces, first, other);
                    partners.max_by(|a, b| flat(*a.1).total_cmp(&flat(*b.1))).map(|(at, _)| at)
                };
                match partner {
                    Some(at) => {
                        let other = self.minus.swap_remove(at);
                        if !unite(&mut self.parent, &mut self.count, [first, other], self.max_triangles) {
                            self.bounding.extend([(first, segment), (other, segment)]);
                        }
                    }
                    None => self.bounding.push((first, segment)),
                }
            }
            // A side without a partner belongs to the contour of its piece.
            self.bounding.extend(self.minus.iter().map(|&triangle| (triangle, segment)));
        }
    }

    /// Returns the squared cosine, with the sign of the cosine, of the angle between the normals of two drawn
    /// triangles, both turned to face the cell: from -1 for folded back to 1 for coplanar.
    fn flatness(&self, surfaces: &Surfaces, a: u32, b: u32) -> f64 {
        let [m, n] = [a, b].map(|triangle| {
            let [p, q, r] = surfaces.triangles[triangle as usize].corners.map(|p| p.as_dvec3());
            (q - p).cross(r - p) * f64::from(self.facing[triangle as usize])
        });
        let dot = m.dot(n);
        dot * dot.abs() / (m.length_squared() * n.length_squared())
    }

    /// Lists the pieces that [`pair`](Self::pair) has formed. With `joins`, lists only pieces of several
    /// parts.
    fn collect(&mut self, surfaces: &Surfaces, cluster: usize, joins: bool) {
        let (facing, parent, number) = (&self.facing, &mut self.parent, &mut self.count);
        let triangles = surfaces.triangles_of(cluster);
        let drawn = || triangles.iter().copied().filter(|&triangle| facing[triangle as usize] != 0);
        let first_piece = self.pieces.len();
        // A piece is represented by its first triangle, so the representative comes before the others.
        for &triangle in triangles {
            number[triangle as usize] = u32::MAX;
        }
        for triangle in drawn() {
            let root = root(parent, triangle);
            let surface = &surfaces.triangles[triangle as usize];
            if root == triangle {
                number[root as usize] = self.pieces.len() as u32;
                let bounds = Aabb::from_points(surface.corners);
                self.pieces.push(Piece { bounds, triangles: [0; 2], contour: [0; 2], joins: false });
            }
            let piece = &mut self.pieces[number[root as usize] as usize];
            piece.bounds = piece.bounds.union(&Aabb::from_points(surface.corners));
            piece.joins |= surface.part != surfaces.triangles[root as usize].part;
            piece.triangles[1] += 1;
        }
        if joins {
            // Pieces of a single part are listed already.
            let pieces = &mut self.pieces;
            let mut kept = first_piece;
            let mut renumber = alloc::vec![u32::MAX; pieces.len() - first_piece];
            for at in first_piece..pieces.len() {
                if pieces[at].joins {
                    pieces[kept] = pieces[at];
                    renumber[at - first_piece] = kept as u32;
                    kept += 1;
                }
            }
            pieces.truncate(kept);
            for triangle in drawn() {
                let number = &mut number[triangle as usize];
                if *number != u32::MAX {
                    *number = renumber[*number as usize - first_piece];
                }
            }
        }
        // Counting sort by piece: triangles and contour segments are counted, then the starts are summed,
        // then the items are put in place.
        for &(triangle, _) in &self.bounding {
            if let Some(piece) = self.pieces.get_mut(number[root(parent, triangle) as usize] as usize) {
                piece.contour[1] += 1;
            }
        }
        let (mut triangle, mut segment) = (self.triangles.len() as u32, self.contours.len() as u32);
        for piece in &mut self.pieces[first_piece..] {
            let counts = [piece.triangles[1], piece.contour[1]];
            (piece.triangles, piece.contour) = ([triangle; 2], [segment; 2]);
            (triangle, segment) = (triangle + counts[0], segment + counts[1]);
        }
        self.triangles.resize(triangle as usize, 0);
        self.contours.resize(segment as usize, 0);
        for triangle in drawn() {
            if let Some(piece) = self.pieces.get_mut(number[root(parent, triangle) as usize] as usize) {
                self.triangles[piece.triangles[1] as usize] = triangle;
                piece.triangles[1] += 1;
            }
        }
        for &(triangle, segment) in &self.bounding {
            if let Some(piece) = self.pieces.get_mut(number[root(parent, triangle) as usize] as usize) {
                self.contours[piece.contour[1] as usize] = segment;
                piece.contour[1] += 1;
            }
        }
    }
}

/// Joins the pieces of two triangles. Returns false, and does not join them, if they are different pieces
/// with more than `most` triangles in total.
fn unite(parent: &mut [u32], count: &mut [u32], triangles: [u32; 2], most: u32) -> bool {
    let [a, b] = triangles.map(|triangle| root(parent, triangle));
    if a == b {
        return true;
    }
    // A piece is represented by its first triangle.
    let (root, other) = (a.min(b), a.max(b));
    let sum = count[a as usize] + count[b as usize];
    if sum > most {
        return false;
    }
    count[root as usize] = sum;
    parent[other as usize] = root;
    true
}

impl CellBox {
    /// Returns 1 if the front of a triangle, in scene coordinates, faces the whole box, -1 if its back does,
    /// and 0 if its plane cuts the box or nearly does.
    fn facing(&self, corners: [DVec3; 3]) -> i8 {
        let corners = corners.map(|p| self.to_axes(p));
        // Corners may be farther away than the error of the box allows for. Pieces whose corners err by more
        // than 4 times that error are not drawn.
        facing(corners, DVec3::ZERO, self.half(), 4.0 * self.error(), self.is_mirrored())
    }
}

#[cfg(test)]
mod tests {
    use super::super::cell_extent::CellExtent;
    use super::*;
    use alloc::vec;
    use visibility_core::geometry::Plane;
    use visibility_core::glam::{Affine3A, Vec3};
    use visibility_core::{Object, OccluderMesh, Scene, VisibleSet};
    use visibility_testing::Random;

    /// Returns a scene of occluders in scene coordinates.
    fn scene_of(meshes: impl IntoIterator<Item = OccluderMesh>) -> Scene {
        let mut scene = Scene::new();
        for mesh in meshes {
            let id = scene.insert(Object { occluder: true, ..Object::new(*mesh.bounds()) });
            let mesh = scene.add_mesh(mesh);
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        }
        scene
    }

    fn cube(min: [f32; 3], size: f32) -> OccluderMesh {
        OccluderMesh::cuboid(&Aabb::from_arrays(min, min.map(|x| x + size))).unwrap()
    }

    /// Returns the numbers of triangles and contour segments of each piece of a book. Its spine is a segment
    /// that all pages share; so many of them are on either side.
    fn book([right, left]: [usize; 2]) -> Vec<[usize; 2]> {
        let spine = [Vec3::new(5.0, 0.0, -1.0), Vec3::new(5.0, 0.0, 1.0)];
        let page = |i: usize, is_right: bool| {
            let across = if is_right { 1.0 } else { -1.0 };
            let corner = Vec3::new(5.0 + 0.01 * i as f32, across, 0.0);
            if is_right { [spine[0], spine[1], corner] } else { [spine[1], spine[0], corner] }
        };
        let triangles: Vec<_> =
            (0..right).map(|i| page(2 * i, true)).chain((0..left).map(|i| page(2 * i + 1, false))).collect();
        let scene = scene_of(OccluderMesh::from_triangles(&triangles));
        let viewcell = Viewcell::from_box(DVec3::splat(-0.1), DVec3::splat(0.1));
        let bounds = scene.culled_bounds().unwrap();
        let cell =
            CellBox::new(&CellExtent::new(&viewcell, DVec3::ZERO).unwrap(), &bounds, DVec3::AXES).unwrap();
        let (surfaces, mut pieces) = (Surfaces::new(&scene), Pieces::default());
        pieces.begin(&surfaces, &Effort::FULL, &viewcell);
        pieces.find(&surfaces, 0, &crate::solids::occluding(&scene, &VisibleSet::new()), &cell);
        pieces
            .pieces
            .iter()
            .map(|piece| [pieces.triangles(piece).len(), pieces.contour(piece).len()])
            .collect()
    }

    #[test]
    fn a_segment_that_many_triangles_share_bounds_all_of_them() {
        assert_eq!(book([1; 2]), [[2, 4]], "two triangles that share a segment");
        assert_eq!(
            book([MAX_ON_SEGMENT; 2]),
            [[2, 4]; MAX_ON_SEGMENT],
            "as many triangles as a segment may bound"
        );
        let more = MAX_ON_SEGMENT + 1;
        for pages in [[more; 2], [more, 1], [1, more]] {
            let all = pages[0] + pages[1];
            assert_eq!(book(pages), vec![[1, 3]; all], "more triangles than a segment may bound: {pages:?}");
        }
    }

    /// Returns the triangles, the contour and the bounds of each piece of all clusters, and whether it joins
    /// parts. All objects of the scene occlude.
    fn pieces_of(
        pieces: &mut Pieces,
        (scene, surfaces): (&Scene, &Surfaces),
        effort: &Effort,
        viewcell: &Viewcell,
    ) -> Vec<(Vec<u32>, Vec<u32>, Aabb, bool)> {
        let bounds = scene.culled_bounds().unwrap();
        let extent = CellExtent::new(viewcell, DVec3::ZERO).unwrap();
        let cell = CellBox::new(&extent, &bounds, DVec3::AXES).unwrap();
        let occluding = crate::solids::occluding(scene, &VisibleSet::new());
        pieces.begin(surfaces, effort, viewcell);
        let mut all = Vec::new();
        for cluster in 0..surfaces.cluster_count() {
            for at in pieces.find(surfaces, cluster, &occluding, &cell) {
                let Piece { bounds, joins, .. } = *pieces.get(at);
                let (triangles, contour) = (pieces.triangles(pieces.get(at)), pieces.contour(pieces.get(at)));
                all.push((triangles.to_vec(), contour.to_vec(), bounds, joins));
            }
        }
        all
    }

    /// Pieces are kept from viewcell to viewcell. They are found anew for other surfaces, other limits, and
    /// viewcells that are not within a box for which they hold.
    #[test]
    fn pieces_are_those_of_the_present_surfaces_limits_and_viewcell() {
        let cells = [
            [[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]],
            [[-0.5, -0.5, -0.5], [10.5, 0.5, 0.5]],
            [[9.5, -0.5, -0.5], [10.5, 0.5, 0.5]],
            [[9.5, -0.5, -0.5], [10.5, 9.5, 0.5]],
            [[9.5, 8.5, -0.5], [10.5, 9.5, 0.5]],
        ]
        .map(|[min, max]| Viewcell::from_box(DVec3::from(min), DVec3::from(max)));
        // Triangles that face no viewcell, so that there is room for pieces that are kept.
        let corner = |i: usize| Vec3::new(i as f32, (i * i) as f32, -99.0);
        let below: Vec<_> = (1..200).map(|i| [corner(0), corner(i + 1), corner(i)]).collect();
        // The second scene has the facings of the first one, at other places.
        let scenes = [[4.0, 2.0, 2.0], [4.0, 2.25, 2.5], [4.0, 4.0, -9.0]].map(|[x, y, z]| {
            let below = OccluderMesh::from_triangles(&below).unwrap();
            scene_of([cube([x, y, z], 1.0), cube([x + 1.0, y, z], 1.0), below])
        });
        let surfaces = scenes.each_ref().map(Surfaces::new);
        let efforts = [Effort::FULL, Effort { max_triangles: 3, ..Effort::FULL }];
        let (mut random, mut kept, mut found) = (Random(1), Pieces::default(), 0);
        for step in 0..400 {
            // Mostly one of the three changes, or none.
            let mut at = [0; 3];
            at[random.below(3)] = random.below(5);
            let (scene, effort, viewcell) = (at[0] % 3, &efforts[at[1] % 2], &cells[at[2]]);
            let world = (&scenes[scene], &surfaces[scene]);
            let fresh = pieces_of(&mut Pieces::default(), world, effort, viewcell);
            assert_eq!(pieces_of(&mut kept, world, effort, viewcell), fresh, "step {step}: {at:?}");
            found += fresh.len();
        }
        assert!(found > 1000, "{found} pieces");
    }

    /// Of two cubes that touch, three sides of each face the viewcell, and those that are turned away are
    /// pieces too. Pieces have no more triangles than they may have.
    #[test]
    fn pieces_are_as_large_as_they_may_be() {
        let scene = scene_of([cube([4.0, 2.0, 2.0], 1.0), cube([4.0, 3.0, 2.0], 1.0)]);
        let surfaces = Surfaces::new(&scene);
        let viewcell = Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5));
        let sizes = |max_triangles: u32| -> Vec<usize> {
            let effort = Effort { max_triangles, ..Effort::QUICK };
            let pieces = pieces_of(&mut Pieces::default(), (&scene, &surfaces), &effort, &viewcell);
            pieces.iter().map(|piece| piece.0.len()).collect()
        };
        assert_eq!(sizes(256), [6, 6, 6, 6, 12, 10], "fronts and backs of each cube, then of both");
        assert_eq!(sizes(6)[..4], [6; 4], "as many triangles as each cube shows");
        assert!(sizes(5).iter().all(|&size| size < 6), "less than each cube shows");
    }

    /// The backs of a solid occlude if the viewcell is outside of it by more than the errors of both.
    #[test]
    fn backs_of_a_solid_at_the_viewcell_do_not_occlude() {
        let viewcell = Viewcell::from_box(-DVec3::ONE, DVec3::ONE);
        let extent = CellExtent::new(&viewcell, DVec3::ZERO).unwrap();
        let bounds = Aabb::new(Vec3::splat(-1e12), Vec3::splat(1e12));
        let cell = CellBox::new(&extent, &bounds, DVec3::AXES).unwrap();
        // The box around the viewcell is larger by an error.
        for (errors, is_outside) in [(4.9, false), (5.1, true)] {
            let x = 1.0 + (errors * cell.error()) as f32;
            let scene = scene_of([cube([x, -450.0, -450.0], 900.0)]);
            let (surfaces, mut pieces) = (Surfaces::new(&scene), Pieces::default());
            let occluding = crate::solids::occluding(&scene, &VisibleSet::new());
            pieces.begin(&surfaces, &Effort::FULL, &viewcell);
            pieces.find(&surfaces, 0, &occluding, &cell);
            let backs = pieces.facing.iter().filter(|&&facing| facing < 0).count();
            assert_eq!(backs, if is_outside { 10 } else { 0 }, "{errors} errors away");
        }
    }

    /// The back of a triangle occludes only if rays cannot pass through it.
    #[test]
    fn backs_that_rays_pass_do_not_occlude() {
        let away = [Vec3::new(5.0, -1.0, -1.0), Vec3::new(5.0, 1.0, -1.0), Vec3::new(5.0, 0.0, 1.0)];
        let viewcell = Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5));
        for (two_sided, count) in [(false, 0), (true, 1)] {
            let scene =
                scene_of(OccluderMesh::from_triangles(&[away]).map(|mesh| mesh.with_two_sided(two_sided)));
            let surfaces = Surfaces::new(&scene);
            let pieces = pieces_of(&mut Pieces::default(), (&scene, &surfaces), &Effort::FULL, &viewcell);
            assert_eq!(pieces.len(), count, "two-sided: {two_sided}");
        }
    }

    /// The cluster in which an object was listed at first has no pieces any more.
    #[test]
    fn objects_that_are_listed_again_occlude_by_their_present_surfaces() {
        let mut scene = scene_of([cube([4.0, 2.0, 2.0], 1.0)]);
        let mut surfaces = Surfaces::default();
        surfaces.list(&scene, 0);
        surfaces.list(&scene, 0);
        let viewcell = Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5));
        let find = |scene: &Scene| {
            let pieces = pieces_of(&mut Pieces::default(), (scene, &surfaces), &Effort::QUICK, &viewcell);
            pieces.into_iter().flat_map(|piece| piece.0).collect::<Vec<u32>>()
        };
        let all = find(&scene);
        assert!(all.len() == 12 && all.iter().all(|&t| t >= 12), "triangles of pieces: {all:?}");
        // An object that may not be drawn does not occlude, although it is listed.
        let id = scene.ids().next().unwrap();
        scene.set_occluder(id, false).unwrap();
        assert_eq!(find(&scene), [], "triangles of an object that is no occluder any more");
    }

    /// Walks past cubes. One of them occludes in every other viewcell only.
    #[test]
    fn pieces_that_are_kept_are_those_that_would_be_found() {
        let mut scene = Scene::new();
        for i in 0..40u8 {
            let min = Vec3::new(f32::from(2 * (i % 10)), f32::from(1 + 2 * (i / 10)), 0.0);
            let bounds = Aabb::new(min, min + 1.0);
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        }
        let (surfaces, bounds) = (Surfaces::new(&scene), scene.culled_bounds().unwrap());
        let (mut kept, mut found) = (Pieces::default(), [0; 2]);
        for step in 0..50 {
            let middle = DVec3::new(0.4 * f64::from(step), 0.5, 0.5);
            // Every tenth box is wide, and holds the next ones but the last.
            let ahead = if step % 10 == 0 { DVec3::new(3.3, 0.1, 0.1) } else { DVec3::ZERO };
            let viewcell = Viewcell::from_box(middle - 0.3, middle + 0.3 + ahead);
            let cell = CellExtent::new(&viewcell, DVec3::ZERO).unwrap();
            let cell = CellBox::new(&cell, &bounds, DVec3::AXES).unwrap();
            let mut occluding = crate::solids::occluding(&scene, &VisibleSet::new());
            occluding.set(7, step % 2 == 0);
            let mut fresh = Pieces::default();
            let list = |pieces: &mut Pieces, found: &mut usize| {
                pieces.begin(&surfaces, &Effort { max_triangles: 8, ..Effort::QUICK }, &viewcell);
                let before = pieces.len();
                let ranges: Vec<_> = (0..surfaces.cluster_count())
                    .map(|at| pieces.find(&surfaces, at, &occluding, &cell))
                    .collect();
                *found += pieces.len() - before;
                let pieces = &*pieces;
                let each = |at| {
                    let piece = pieces.get(at);
                    (piece.bounds, piece.joins, pieces.triangles(piece), pieces.contour(piece))
                };
                alloc::format!(
                    "{:?}",
                    ranges.into_iter().map(|range| range.map(each).collect()).collect::<Vec<Vec<_>>>()
                )
            };
            let [a, b] = [(&mut kept, 0), (&mut fresh, 1)].map(|(pieces, at)| list(pieces, &mut found[at]));
            assert_eq!(a, b, "pieces of step {step}");
        }
        assert!(4 * found[0] < 3 * found[1], "pieces found, with those that are kept and without: {found:?}");
    }

    /// A viewcell with a plane lies within the box before, but the box along the plane reaches out of it,
    /// below the plane of a wedge's top.
    #[test]
    fn facings_of_a_box_do_not_hold_for_a_viewcell_with_planes() {
        let [a, b, c] = [[-10.0, -0.5], [-20.0, -0.5], [-20.0, -3.0]];
        let corner = |[x, y]: [f32; 2], z: f32| Vec3::new(x, y, z);
        let side = |p, q| {
            [
                [corner(p, -5.0), corner(q, -5.0), corner(q, 5.0)],
                [corner(p, -5.0), corner(q, 5.0), corner(p, 5.0)],
            ]
        };
        let mesh = OccluderMesh::from_triangles(&[side(a, b), side(b, c), side(c, a)].concat()).unwrap();
        let mut scene = Scene::new();
        let id = scene.insert(Object { occluder: true, ..Object::new(*mesh.bounds()) });
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        let surfaces = Surfaces::new(&scene);
        let bounds = Aabb::from_arrays([-50.0; 3], [50.0; 3]);
        let occluding = crate::solids::occluding(&scene, &VisibleSet::new());
        let whole = Viewcell::from_box(DVec3::ZERO, DVec3::new(10.0, 1.0, 0.03));
        let plane = Plane::new(-DVec3::new(0.75f64.sqrt(), 0.5, 0.0), 0.05);
        let part = Viewcell { planes: vec![plane], ..whole.clone() };
        let find = |pieces: &mut Pieces, viewcell: &Viewcell| {
            let extent = CellExtent::new(viewcell, DVec3::ZERO).unwrap();
            let cell = CellBox::new(&extent, &bounds, extent.axes()).unwrap();
            pieces.begin(&surfaces, &Effort::FULL, viewcell);
            (0..surfaces.cluster_count()).for_each(|at| _ = pieces.find(&surfaces, at, &occluding, &cell));
            pieces.facing.clone()
        };
        let (mut kept, mut fresh) = (Pieces::default(), Pieces::default());
        let before = find(&mut kept, &whole);
        let after = find(&mut kept, &part);
        assert_eq!(after, find(&mut fresh, &part), "facings of the viewcell with a plane");
        assert_ne!(after, before, "the top faces the whole box, and not all of the box along the plane");
    }

    /// Triangles that are nearer to the viewcell than four times the error of its box face no side.
    #[test]
    fn triangles_nearer_than_the_error_of_the_box_face_no_side() {
        let viewcell = Viewcell::from_box(-DVec3::ONE, DVec3::ONE);
        let extent = CellExtent::new(&viewcell, DVec3::ZERO).unwrap();
        // Coordinates of a million million metres are off by some centimetres.
        let bounds = Aabb::new(Vec3::splat(-1e12), Vec3::splat(1e12));
        let cell = CellBox::new(&extent, &bounds, DVec3::AXES).unwrap();
        let error = cell.error();
        let facing = |x: f64| {
            let corners = [[x, -500.0, -500.0], [x, 500.0, -500.0], [x, 0.0, 500.0]].map(DVec3::from);
            let [a, b, c] = corners;
            [cell.facing([a, b, c]), cell.facing([a, c, b])]
        };
        assert_eq!(facing(1.0 + 4.0 * error), [0, 0], "four errors of {error} away");
        let far = facing(900.0);
        assert!(far == [-1, 1] || far == [1, -1], "far away: {far:?}");
    }
}
