//! Welded triangles: what joins without a seam covers a pixel together, whatever else is there.
//!
//! The rule for meshes of any form (see [`mesh`](crate::mesh)) gives a pixel up where any contour of the mesh comes near, also one that lies
//! far behind the triangles that fill it, and takes the farthest of all that meet it for its depth. And meshes that are joined edge to edge, as
//! walls are that were cut into objects, are strangers to each other. So each tile remembers the triangles that meet it; and where all else leaves a
//! box undecided, those that are before the box in the pixel, from whichever mesh, are joined along the edges that they share.
//! If what hangs together has no edge left over that comes near the pixel, it covers the pixel.
//!
//! # Why it is sound
//! Take any set of triangles, turned to run the same way round on the screen. Let edges of two that have the same ends and run in opposite
//! directions cancel, one against one, and call what is left the contour. It winds round a point as often as triangles of the set cover that
//! (see [`shape`](crate::shape)). If it comes nowhere near a pixel, that number is the same at all points of the pixel; and if one triangle
//! has a point there, it is not zero. So each point of the pixel is covered by a triangle of the set; and those were chosen to be before the box
//! wherever they meet the pixel. Which triangles are remembered, chosen or joined decides what is found, never whether it is right.
//!
//! # The error bound
//! The argument is about the triangles themselves, not about their computed corners: edges cancel because they are the same edge. So corners have
//! names. Vertices of meshes that are not moved are named by their coordinates, others by their mesh and number, cuts at the near plane by the
//! edge that is cut. A contour edge is off by less than the slack of its mesh, by which pixels are widened; the `f64` arithmetic of the comparison is
//! off by `16u` of the greatest coordinate, half of what the slack has for roundings (32 units, doubled). The point that is asked for lies within a
//! triangle by the slack, and so in the triangle itself. Depth is that of the plane or of the farthest corner, both lowered by their errors.

use crate::fusion::{Behind, Piece};
use crate::tiles::{SIDE, Surface};
use alloc::vec::Vec;
use visibility_core::glam::Vec3;

/// Triangles that are remembered in tiles, all together: twelve bytes each time. Some 700,000 triangles on a small picture need most of it.
const LINKS: usize = 1 << 20;

/// Triangles of a tile that are looked at for one pixel.
const STEPS: usize = 8192;

/// Triangles that are joined at a time.
const JOINED: usize = 128;

/// Edges that wait for their like.
const OPEN: usize = 128;

/// Corners of a triangle, or of what the near plane leaves of it.
const CORNERS: usize = 4;

/// Meshes are left out beyond this, in pixels.
const MOST_SLACK: f32 = 0.25;

/// What tells a corner from all others: a place, or a number.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Name([u32; 4]);

impl Name {
    /// Of a vertex that is drawn where it is.
    #[inline(always)]
    pub(crate) fn of_place(p: &Vec3) -> Self {
        Self([0, p.x.to_bits(), p.y.to_bits(), p.z.to_bits()])
    }

    /// Of a vertex of one mesh; meshes count from 1.
    #[inline(always)]
    pub(crate) fn of_vertex(mesh: u32, vertex: u32) -> Self {
        Self([mesh, vertex, vertex, 0])
    }

    /// Of the cut through an edge of one mesh. Its ends differ, so that this is no vertex.
    #[inline(always)]
    pub(crate) fn of_cut(mesh: u32, a: u32, b: u32) -> Self {
        Self([mesh, a.min(b), a.max(b), 0])
    }
}

/// A corner on the screen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    /// In pixels.
    pub(crate) at: [f64; 2],
    /// Nearness, rounded away.
    pub(crate) far: f32,
    pub(crate) name: Name,
}

/// What is remembered of a triangle.
#[derive(Clone, Copy, Debug)]
struct Patch {
    /// In the order in which all run round.
    corners: [u32; CORNERS],
    count: u32,
    /// How far a corner may be off, in pixels.
    slack: f32,
    /// Nearness that all of it has at least.
    floor: f32,
    surface: Surface,
}

/// A triangle that meets a tile, and the next one.
#[derive(Clone, Copy, Debug)]
struct Link {
    patch: u32,
    next: u32,
    /// More or less the greatest nearness of it.
    ceiling: f32,
}

/// All that is remembered.
#[derive(Clone, Debug, Default)]
pub(crate) struct Weld {
    corners: Vec<Corner>,
    patches: Vec<Patch>,
    /// The first is none.
    links: Vec<Link>,
    /// By tile, the first and the last link.
    chains: Vec<[u32; 2]>,
    columns: usize,
    /// The number of the last mesh.
    mesh: u32,
}

impl Weld {
    pub(crate) fn new(columns: usize, rows: usize) -> Self {
        Self { chains: alloc::vec![[0; 2]; columns * rows], columns, ..Self::default() }
    }

    /// Forgets all.
    pub(crate) fn clear(&mut self) {
        // What was never filled is clean.
        if !self.links.is_empty() {
            self.chains.fill([0; 2]);
        }
        self.corners.clear();
        self.patches.clear();
        self.links.clear();
        self.mesh = 0;
    }

    /// Whether no more is remembered in this frame.
    #[inline(always)]
    pub(crate) fn is_full(&self) -> bool {
        self.links.len() + self.chains.len() > LINKS
    }

    /// A number for a mesh.
    pub(crate) fn begin_mesh(&mut self) -> u32 {
        self.mesh += 1;
        self.mesh
    }

    /// How many corners are remembered.
    pub(crate) fn count(&self) -> u32 {
        self.corners.len() as u32
    }

    /// Remembers a corner; the number stands for it in this frame.
    #[inline(always)]
    pub(crate) fn push(&mut self, corner: Corner) -> u32 {
        self.corners.push(corner);
        (self.corners.len() - 1) as u32
    }

    /// Remembers a triangle, or what is left of one, for those tiles that it meets where `whole`, the least nearness of each, leaves anything of it to
    /// be seen. Its corners come by number, in either order, and may be off by `slack` pixels, with room for the arithmetic here. The plane of its
    /// nearness is already moved by its error, and may be none.
    #[inline(always)]
    pub(crate) fn add(&mut self, piece: &[u32], slack: f32, plane: [f64; 3], size: [f64; 2], whole: &[f32]) {
        let count = piece.len().min(CORNERS);
        if count < 3 || self.is_full() {
            return;
        }
        let (mut corners, mut at) = ([0; CORNERS], [[0.0; 2]; CORNERS]);
        let (mut floor, mut ceiling) = (f32::INFINITY, f32::NEG_INFINITY);
        for (i, &number) in piece[..count].iter().enumerate() {
            let Some(corner) = self.corners.get(number as usize) else { return };
            (corners[i], at[i]) = (number, corner.at);
            floor = floor.min(corner.far);
            ceiling = ceiling.max(corner.far);
        }
        // As for meshes, the way round has to be sure.
        let (mut area, mut certain) = (0.0, 0.0);
        for i in 1..count - 1 {
            let ([ax, ay], [bx, by]) = (less(at[i], at[0]), less(at[i + 1], at[0]));
            area += ax * by - ay * bx;
            certain += ax.abs() + ay.abs() + bx.abs() + by.abs() + f64::from(slack);
        }
        // Neither NaN nor infinity gets past this.
        if !(slack <= MOST_SLACK
            && area.abs() > 2.0 * f64::from(slack) * certain
            && area.abs() < f64::INFINITY)
        {
            return;
        }
        if area < 0.0 {
            corners[..count].reverse();
        }
        ceiling += 1e-6 * ceiling.abs();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for &[x, y] in &at[..count] {
            low = [low[0].min(x), low[1].min(y)];
            high = [high[0].max(x), high[1].max(y)];
        }
        let rows = self.chains.len() / self.columns;
        let (Some([x0, x1]), Some([y0, y1])) = (
            tiles_between(low[0], high[0], size[0], self.columns),
            tiles_between(low[1], high[1], size[1], rows),
        ) else {
            return;
        };
        let patch = self.patches.len() as u32;
        let mut any = false;
        for row in y0..y1 {
            let [x0, x1] = if x1 - x0 > 1 && y1 - y0 > 1 {
                let top = (row * SIDE) as f64;
                let [left, right] = span(&at[..count], top - 1.0, top + SIDE as f64 + 1.0);
                tiles_between(left, right, size[0], self.columns).unwrap_or([0, 0])
            } else {
                [x0, x1]
            };
            for column in x0..x1 {
                let tile = row * self.columns + column;
                if !(whole[tile] > ceiling) {
                    self.link(tile, patch, ceiling);
                    any = true;
                }
            }
        }
        if any {
            let surface = Surface::of_plane(plane, size);
            self.patches.push(Patch { corners, count: count as u32, slack, floor, surface });
        }
    }

    #[inline(always)]
    fn link(&mut self, tile: usize, patch: u32, ceiling: f32) {
        if self.links.is_empty() {
            self.links.push(Link { patch: 0, next: 0, ceiling: 0.0 });
        }
        let own = self.links.len() as u32;
        self.links.push(Link { patch, next: 0, ceiling });
        let [first, last] = &mut self.chains[tile];
        // What comes first stays first: it is what is nearest, mostly.
        if *first == 0 {
            *first = own;
        } else if let Some(link) = self.links.get_mut(*last as usize) {
            link.next = own;
        }
        *last = own;
    }

    /// Whether triangles that join cover a pixel of a tile, before what is `behind`.
    #[inline(always)]
    pub(crate) fn covers(&self, tile: usize, pixel: [usize; 2], behind: &mut impl Behind) -> bool {
        let mut next = self.chains[tile][0];
        if next == 0 {
            return false;
        }
        let pixel = pixel.map(|side| side as f64);
        let limit = behind.nearness(pixel.map(|side| side + 0.5));
        let mut joined: Option<Joined> = None;
        let mut steps = 0;
        while let Some(link) = self.links.get(next as usize)
            && next != 0
            && steps < STEPS
        {
            next = link.next;
            steps += 1;
            // What is farther than the box is of no use.
            if f64::from(link.ceiling) > limit
                && let Some(patch) = self.patches.get(link.patch as usize)
                && let Some(seen) = self.look_at(patch, pixel)
                && is_before(patch, pixel, behind)
            {
                if seen.all {
                    return true;
                }
                let own = joined.get_or_insert_with(Joined::new);
                if own.count == JOINED {
                    if own.covers() {
                        return true;
                    }
                    *own = Joined::new();
                }
                own.add(patch, &seen, &self.corners);
            }
        }
        joined.is_some_and(|joined| joined.covers())
    }

    /// The next lower nearness below `limit` that a triangle has throughout a pixel of a tile; `None` if there is none.
    pub(crate) fn next_below(&self, tile: usize, pixel: [usize; 2], limit: f64) -> Option<f64> {
        let pixel = pixel.map(|side| side as f64);
        let mut best = None;
        let mut next = self.chains[tile][0];
        while let Some(link) = self.links.get(next as usize)
            && next != 0
        {
            next = link.next;
            if let Some(patch) = self.patches.get(link.patch as usize)
                && self.look_at(patch, pixel).is_some()
            {
                let nearness = least(patch, pixel);
                if nearness < limit && best.is_none_or(|best| nearness > best) {
                    best = Some(nearness);
                }
            }
        }
        best
    }

    /// How a triangle meets a pixel; `None` if it misses it.
    #[inline(always)]
    fn look_at(&self, patch: &Patch, pixel: [f64; 2]) -> Option<Seen> {
        let mut seen = Seen { all: true, probed: true, edges: 0 };
        let slack = f64::from(patch.slack);
        let reach = 0.5 + slack;
        let count = patch.count as usize;
        let mut at = [[0.0; 2]; CORNERS];
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for i in 0..count {
            at[i] = less(self.corners.get(patch.corners[i] as usize)?.at, [pixel[0] + 0.5, pixel[1] + 0.5]);
            low = [low[0].min(at[i][0]), low[1].min(at[i][1])];
            high = [high[0].max(at[i][0]), high[1].max(at[i][1])];
        }
        if low[0] > reach || low[1] > reach || high[0] < -reach || high[1] < -reach {
            return None;
        }
        for i in 0..count {
            let (a, b) = (at[i], at[if i + 1 < count { i + 1 } else { 0 }]);
            // Towards the inner side.
            let normal = [a[1] - b[1], b[0] - a[0]];
            let middle = -(normal[0] * a[0] + normal[1] * a[1]);
            let size = normal[0].abs() + normal[1].abs();
            let far = size * reach;
            if middle < -far {
                return None;
            }
            let probe = middle + normal[0] * PROBE[0] + normal[1] * PROBE[1];
            // Written so that a NaN is neither inside nor away.
            seen.probed &= probe > size * slack;
            let inside = middle > far;
            seen.all &= inside;
            let beside = a[0].min(b[0]) > reach
                || a[0].max(b[0]) < -reach
                || a[1].min(b[1]) > reach
                || a[1].max(b[1]) < -reach;
            if !(inside || beside) {
                seen.edges |= 1 << i;
            }
        }
        Some(seen)
    }
}

/// A point of the pixel from its middle, where no edge goes through because things are drawn in line.
const PROBE: [f64; 2] = [0.0173, -0.0291];

/// How a triangle meets a pixel.
struct Seen {
    /// All of the pixel is inside it.
    all: bool,
    /// The point that is asked for is.
    probed: bool,
    /// The edges that come near the pixel, a bit each.
    edges: u32,
}

/// Whether a triangle is before all of what is behind, where it meets the pixel.
#[inline(always)]
fn is_before(patch: &Patch, pixel: [f64; 2], behind: &mut impl Behind) -> bool {
    behind.is_behind(&patch.surface, pixel, &Piece::WHOLE)
        || behind.is_behind(&Surface::flat(patch.floor), pixel, &Piece::WHOLE)
}

/// The nearness that a triangle has at least where it meets a pixel.
fn least(patch: &Patch, pixel: [f64; 2]) -> f64 {
    let mut least = f64::INFINITY;
    for corner in Piece::WHOLE.corners(pixel) {
        least = least.min(patch.surface.at(corner));
    }
    least.max(f64::from(patch.floor))
}

#[inline(always)]
fn less(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// First and end tile between two coordinates, with a pixel to spare; `None` if these are off the buffer.
#[inline(always)]
fn tiles_between(low: f64, high: f64, size: f64, tiles: usize) -> Option<[usize; 2]> {
    if !(high >= -1.0 && low <= size + 1.0) {
        return None;
    }
    // Casts saturate.
    let [first, last] = [low - 1.0, high + 1.0].map(|x| (x * (1.0 / SIDE as f64)) as usize);
    (first < tiles).then_some([first, (last + 1).min(tiles)])
}

/// The columns between which a convex polygon lies in a range of rows, more or less.
#[inline(always)]
fn span(at: &[[f64; 2]], top: f64, bottom: f64) -> [f64; 2] {
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    let Some(mut a) = at.last().copied() else { return [left, right] };
    for &b in at {
        let (upper, lower) = if a[1] < b[1] { (a, b) } else { (b, a) };
        if upper[1] <= bottom && lower[1] >= top {
            let slope = (lower[0] - upper[0]) / (lower[1] - upper[1]);
            let x = |y: f64| {
                let x = upper[0] + (y - upper[1]) * slope;
                // A NaN is taken for the end.
                if x.is_nan() { upper[0] } else { x }
            };
            let p = if top > upper[1] { x(top) } else { upper[0] };
            let q = if bottom < lower[1] { x(bottom) } else { lower[0] };
            (left, right) = (left.min(p).min(q), right.max(p).max(q));
        }
        a = b;
    }
    [left, right]
}

/// An edge of a triangle that is being joined.
#[derive(Clone, Copy)]
struct Open {
    /// The column where it begins.
    start: f64,
    ends: [u32; 2],
    own: u8,
}

/// Triangles that are being joined.
struct Joined {
    /// By triangle, one that stands for those that it hangs together with, and in the end the first of them.
    parent: [u8; JOINED],
    /// By triangle that is the first, whether its like cover the point that is asked for.
    probed: [bool; JOINED],
    count: usize,
    /// Edges that found no partner yet.
    open: [Open; OPEN],
    waiting: usize,
    /// Triangles one of whose edges had no room to wait.
    lost: [bool; JOINED],
}

impl Joined {
    fn new() -> Self {
        Self {
            parent: [0; JOINED],
            probed: [false; JOINED],
            count: 0,
            open: [Open { start: 0.0, ends: [0; 2], own: 0 }; OPEN],
            waiting: 0,
            lost: [false; JOINED],
        }
    }

    fn root(&self, mut i: usize) -> usize {
        // A parent is never after its child.
        while usize::from(self.parent[i]) < i {
            i = usize::from(self.parent[i]);
        }
        i
    }

    /// Joins a triangle to those that it shares an edge with, each edge with one other.
    fn add(&mut self, patch: &Patch, seen: &Seen, corners: &[Corner]) {
        let own = self.count;
        self.count += 1;
        self.parent[own] = own as u8;
        self.probed[own] = seen.probed;
        let count = patch.count as usize;
        for i in 0..count {
            if seen.edges >> i & 1 == 0 {
                continue;
            }
            let (a, b) = (patch.corners[i], patch.corners[if i + 1 < count { i + 1 } else { 0 }]);
            let (Some(from), Some(to)) = (corners.get(a as usize), corners.get(b as usize)) else { continue };
            let mut partner = None;
            for k in (0..self.waiting).rev() {
                let other = &self.open[k];
                if other.start == to.at[0] && is_same(other.ends, [b, a], corners) {
                    partner = Some(k);
                    break;
                }
            }
            if let Some(k) = partner {
                let (p, q) = (self.root(usize::from(self.open[k].own)), self.root(own));
                let (first, last) = if p < q { (p, q) } else { (q, p) };
                self.parent[last] = first as u8;
                self.probed[first] |= self.probed[last];
                self.lost[first] |= self.lost[last];
                self.waiting -= 1;
                self.open[k] = self.open[self.waiting];
            } else if self.waiting < OPEN {
                self.open[self.waiting] = Open { start: from.at[0], ends: [a, b], own: own as u8 };
                self.waiting += 1;
            } else {
                let root = self.root(own);
                self.lost[root] = true;
            }
        }
    }

    /// Whether some that hang together have no edge left, and cover the point that is asked for.
    fn covers(&self) -> bool {
        let mut bare = self.lost;
        for open in &self.open[..self.waiting] {
            bare[self.root(usize::from(open.own))] = true;
        }
        for i in 0..self.count {
            if usize::from(self.parent[i]) == i && self.probed[i] && !bare[i] {
                return true;
            }
        }
        false
    }
}

/// Whether two edges have the same ends.
fn is_same(a: [u32; 2], b: [u32; 2], corners: &[Corner]) -> bool {
    for i in 0..2 {
        let same = a[i] == b[i]
            || match (corners.get(a[i] as usize), corners.get(b[i] as usize)) {
                (Some(a), Some(b)) => a.name == b.name,
                _ => false,
            };
        if !same {
            return false;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Coverage;
    use crate::canvas::Cells;
    use crate::lens::Lens;
    use crate::mesh::{self, Setup};
    use crate::random::random;
    use crate::solid::Parts;
    use crate::tiles::Tiles;
    use crate::twice::{on_screen, product, sum};
    use std::vec::Vec;
    use visibility_core::glam::{Affine3A, DVec3};
    use visibility_core::{OccluderMesh, Pose, View};

    /// What is remembered of triangles seen from far off the origin, many of them through the near plane: vertices are where they ought to
    /// be, and cuts on their edges, but for the slack.
    #[test]
    fn corners_are_off_by_less_than_the_slack() {
        let mut random = random(9);
        let mut tiles = Tiles::new(192, 128);
        let (mut setup, mut cells) = (Setup::default(), Cells::new(&tiles));
        let mut seen = [0; 2];
        for trial in 0..20_000 {
            let far = 10f64.powf(random(0.0, 9.0));
            let eye = DVec3::from_array([0; 3].map(|_| far * random(-1.0, 1.0)));
            let forward = DVec3::from_array([0; 3].map(|_| random(-1.0, 1.0)));
            let pose = Pose::look_at(eye, eye + forward, DVec3::Z);
            let view = View::perspective(pose, random(0.3, 2.0), 1.5, 0.01, f64::INFINITY).unwrap();
            // By its matrix alone, the eye is not known so well, the less the farther it is from the origin.
            let matrix = view.clip_from(DVec3::ZERO);
            let view = View::from_clip_from_world(matrix, view.depth()).unwrap();
            let lens = Lens::new(&view, DVec3::ZERO, [192, 128], [192, 128]);
            let reach = (far * 1e-6).max(1.0) * 10f64.powf(random(-1.0, 2.0));
            let positions = [0; 3]
                .map(|_| (eye + reach * DVec3::from_array([0; 3].map(|_| random(-1.0, 1.0)))).as_vec3());
            let Ok(mesh) = OccluderMesh::from_indexed(&positions, &[[0, 1, 2]]) else { continue };
            let mesh = mesh.with_two_sided(true);
            let Some((placed, facing)) = crate::hzb::place(&lens, mesh.bounds(), &Affine3A::IDENTITY) else {
                continue;
            };
            let parts = Parts::of(&mesh, false);
            tiles.clear(true);
            if trial % 2 == 0 {
                let corners: Vec<_> =
                    mesh.positions().iter().map(|p| placed.at(p.to_array().map(f64::from))).collect();
                mesh::remember_solid(&parts, &corners, |_| true, &placed, &lens, &mut tiles);
            } else {
                let (setup, cells) = (&mut setup, &mut cells);
                mesh::draw(&parts, &placed, &lens, facing, Coverage::Conservative, setup, cells, &mut tiles);
            }
            // Where its corners ought to be.
            let exact = [0, 1, 2].map(|i: usize| {
                let p = mesh.positions()[i].to_array().map(f64::from);
                on_screen([0, 1, 3].map(|row| matrix.row(row)), p, [192.0, 128.0])
            });
            let at = |p: [[f64; 2]; 3]| [p[0][0] / p[2][0], p[1][0] / p[2][0]];
            let Weld { corners, patches, mesh: number, .. } = &tiles.weld;
            for patch in patches {
                let slack = f64::from(patch.slack);
                for corner in patch.corners[..patch.count as usize].iter().map(|&i| corners[i as usize]) {
                    for i in 0..3 {
                        if corner.name == Name::of_vertex(*number, i as u32) {
                            let [x, y] = less(corner.at, at(exact[i]));
                            seen[0] += 1;
                            assert!(x.abs().max(y.abs()) < slack, "{trial}: {x} {y} {slack}");
                        }
                        let j = (i + 1) % 3;
                        if corner.name == Name::of_cut(*number, i as u32, j as u32) {
                            seen[1] += 1;
                            let off = distance(corner.at, exact[i], exact[j]);
                            assert!(off < slack, "{trial}: {off} {slack}");
                        }
                    }
                }
            }
        }
        assert!(seen[0] > 5_000 && seen[1] > 5_000, "{seen:?}");
    }

    /// However corners are moved within the slack, what is said of a triangle and a pixel holds.
    #[test]
    fn what_is_seen_holds_within_the_slack() {
        let mut random = random(11);
        let pixel = [20.0, 12.0];
        let size = [64.0, 32.0];
        let name = Name([0; 4]);
        let mut found = [0; 4];
        for _ in 0..20_000 {
            let mut weld = Weld::new(8, 4);
            let reach = 10f64.powf(random(0.0, 1.5));
            for _ in 0..3 {
                let at = pixel.map(|side| side + random(-reach, reach));
                weld.push(Corner { at, far: 1.0, name });
            }
            let slack = random(0.0, 0.2) as f32;
            weld.add(&[0, 1, 2], slack, [0.0, 0.0, 1.0], size, &[0.0; 32]);
            let Some(patch) = weld.patches.first() else { continue };
            let seen = weld.look_at(patch, pixel);
            for _ in 0..20 {
                // To the ends of the slack, mostly.
                let mut moved = patch.corners.map(|i| weld.corners[i as usize].at);
                for side in moved.as_flattened_mut() {
                    *side +=
                        (f64::from(slack) * random(-3.0, 3.0)).clamp(-f64::from(slack), f64::from(slack));
                }
                let value = |i: usize, [x, y]: [f64; 2]| {
                    let ([ax, ay], [bx, by]) = (moved[i], moved[(i + 1) % 3]);
                    (bx - ax) * (y - ay) - (by - ay) * (x - ax)
                };
                let inside = |p: [f64; 2]| (0..3).all(|i| value(i, p) > 0.0);
                let Some(seen) = &seen else {
                    found[0] += 1;
                    assert!(!Piece::WHOLE.corners(pixel).any(inside));
                    continue;
                };
                if seen.all {
                    found[1] += 1;
                    assert!(Piece::WHOLE.corners(pixel).all(inside));
                }
                if seen.probed {
                    found[2] += 1;
                    assert!(inside([pixel[0] + 0.5 + PROBE[0], pixel[1] + 0.5 + PROBE[1]]));
                }
                for i in 0..3 {
                    let (a, b) = (moved[i], moved[(i + 1) % 3]);
                    if seen.edges >> i & 1 == 0 {
                        found[3] += 1;
                        for step in 0..=32 {
                            let share = f64::from(step) / 32.0;
                            let [x, y] = [0, 1].map(|k| a[k] + (b[k] - a[k]) * share - pixel[k]);
                            assert!(!(0.0..=1.0).contains(&x) || !(0.0..=1.0).contains(&y));
                        }
                    }
                }
            }
        }
        assert!(found.iter().all(|&found| found > 10_000), "{found:?}");
    }

    /// How far a place on the screen is from the line through two points.
    fn distance([x, y]: [f64; 2], a: [[f64; 2]; 3], b: [[f64; 2]; 3]) -> f64 {
        let times = |p: [f64; 2], q: [f64; 2]| sum(product(p, q[0]), product(p, q[1]));
        let minor = |i: usize, j: usize| sum(times(a[i], b[j]), times(a[j], b[i]).map(|value| -value));
        let (p, q, r) = (minor(1, 2), minor(2, 0), minor(0, 1));
        let value = sum(sum(product(p, x), product(q, y)), r);
        value[0].abs() / p[0].hypot(q[0])
    }
}
