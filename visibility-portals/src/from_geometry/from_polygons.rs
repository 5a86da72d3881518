//! Cells from polygons in any position, by a BSP tree along the planes of the polygons.
//!
//! This work is based on: Henry Fuchs, Zvi Kedem and Bruce Naylor, "On Visible Surface Generation by A Priori
//! Tree Structures", 1980, for the auto-partition; Seth Teller, "Visibility Computations in Densely Occluded
//! Polyhedral Environments", 1992, for preferring the planes with the largest covered fraction. A region in
//! which polygons cover no plane sufficiently is not split. Polygons left inside such a region occlude
//! nothing.

use super::bsp_portals::{Bsp, Child, Node, NodeCover, renumber_leaves};
use super::subdivision::{GeometryError, Subdivision, checked, checked_extent};
use super::subtract_polygons::{Lengths, area, width};
use crate::clip_polygon::clip_into;
use alloc::collections::{BTreeMap, VecDeque};
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{
    cells::{CellGraph, CellId},
    geometry::{ConvexPolygon, Plane},
    pvs::Viewcells,
};

/// Rule that decides which regions of the BSP tree are solid. Solid regions do not become cells.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum SolidRule<'a> {
    /// No region is solid. The inside of a wall becomes a cell that no camera enters.
    Nothing,
    /// Regions are solid if no chain of portals joins them to the region of any of these points (world
    /// space). If none of the points lies in a region, no region is solid.
    Unreached(&'a [DVec3]),
    /// Regions bounded by back sides of polygons and by no front side are solid, if no chain of portals joins
    /// them to other regions. A polygon's vertices run counter-clockwise as seen from its front.
    Backs,
}

/// Settings of [`from_polygons`]. Lengths are in world units.
#[derive(Clone, Copy, PartialEq, Debug)]
#[must_use]
pub struct PolygonSettings<'a> {
    tolerance: Option<f64>,
    origin: DVec3,
    min_share: f64,
    min_area: Option<f64>,
    margin: f64,
    max_cells: usize,
    solid: SolidRule<'a>,
    one_sided: &'a [bool],
}

impl Default for PolygonSettings<'_> {
    fn default() -> Self {
        Self {
            tolerance: None,
            origin: DVec3::ZERO,
            min_share: 0.25,
            min_area: None,
            margin: 1.0,
            max_cells: 1 << 14,
            solid: SolidRule::Nothing,
            one_sided: &[],
        }
    }
}

impl<'a> PolygonSettings<'a> {
    /// Sets the distance that a line must keep from all polygons to be certain to pass: narrower gaps are
    /// closed. `None`, the default: 2^-20 of the greatest absolute coordinate relative to the
    /// [origin](Self::with_origin), well above the rounding of `f32`, and at least 2^-36 of the greatest
    /// absolute coordinate in the world, which is above that of `f64`.
    pub fn with_tolerance(self, tolerance: impl Into<Option<f64>>) -> Self {
        Self { tolerance: tolerance.into(), ..self }
    }

    /// Sets the point in the world relative to which the polygons were given in `f32`, such as
    /// [`Scene::origin`](visibility_core::Scene::origin). The default tolerance depends on it. The zero point
    /// of the world by default. A point that is not finite is an error.
    pub fn with_origin(self, origin: DVec3) -> Self {
        Self { origin, ..self }
    }

    /// Sets the minimum covered fraction, from 0 to 1, for a split: the region is split along a plane if
    /// polygons cover at least this fraction of the plane's section of the region. A covered area of at least
    /// 1/512 of the square of the longest side of the bounding box also suffices, since even large walls
    /// cover a small fraction of a large region. 0.25 by default.
    pub fn with_min_share(self, min_share: f64) -> Self {
        Self { min_share, ..self }
    }

    /// Sets the minimum total area, in square world units, of the polygons that lie in a plane and in a
    /// region. If the total is less, the region is not split along that plane, whatever its covered fraction.
    /// `None`, the default: 2^-13 of the square of the longest side of the bounding box.
    pub fn with_min_area(self, min_area: impl Into<Option<f64>>) -> Self {
        Self { min_area: min_area.into(), ..self }
    }

    /// Sets the distance, in world units, by which the outermost cells extend beyond the bounds of all
    /// polygons. 1 by default.
    pub fn with_margin(self, margin: f64) -> Self {
        Self { margin, ..self }
    }

    /// Sets the maximum number of leaf regions, solid ones included. Regions are split breadth first until
    /// this number is reached. 16,384 by default.
    pub fn with_max_cells(self, max_cells: usize) -> Self {
        Self { max_cells, ..self }
    }

    /// Sets the rule that decides which regions are solid. [`SolidRule::Nothing`] by default.
    pub fn with_solid(self, solid: SolidRule<'a>) -> Self {
        Self { solid, ..self }
    }

    /// Sets for each polygon whether it is drawn from its front alone, so that lines from behind pass it.
    /// Polygons beyond the end block from both sides. Portals have no direction, so that regions from which
    /// lines pass polygons from behind, and all regions that portals join to these, do not become cells: from
    /// there everything is visible. The inside of a wall is such a region. Empty by default.
    pub fn with_one_sided(self, one_sided: &'a [bool]) -> Self {
        Self { one_sided, ..self }
    }
}

/// Maximum number of planes that are compared as split planes of one region: those with the greatest covered
/// area in the region.
const CANDIDATES: usize = 12;

/// An input polygon, or the part of one inside the region of a node, in world space.
#[derive(Clone, Debug)]
struct Fragment {
    vertices: Vec<DVec3>,
    /// Index of the fragment's plane in the list of distinct planes that [`fragments`] returns.
    plane: u32,
    area: f64,
    /// Whether the polygon blocks lines from its front alone, so that lines from behind pass it.
    one_sided: bool,
}

/// Divides space along opaque polygons in world space. Gaps, duplicates, T-junctions and polygons that
/// intersect one another are allowed. Takes time proportional to the number of pairs of a region and a
/// polygon that reaches into it. Without vertices the result is empty.
///
/// ```
/// use visibility_core::{geometry::ConvexPolygon, glam::DVec3};
/// use visibility_portals::from_geometry::{from_polygons, PolygonSettings};
/// // A wall across the world with a gap in it.
/// let corner = |[y, z]: [f64; 2]| DVec3::new(0.0, y, z);
/// let wall = |[a, b]: [f64; 2]| ConvexPolygon::new([[a, 0.0], [b, 0.0], [b, 3.0], [a, 3.0]].map(corner));
/// let soup = [wall([0.0, 4.0])?, wall([5.0, 9.0])?];
/// let halves = from_polygons(&soup, &PolygonSettings::default())?;
/// let open: f64 = halves.graph.portals().iter().map(|portal| portal.polygon().area()).sum();
/// assert_eq!(halves.graph.cell_count(), 2);
/// assert!((open - (11.0 * 5.0 - 8.0 * 3.0)).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`GeometryError::Coordinate`] with the index of the polygon, [`GeometryError::Setting`] with the name of
/// the setting (also for coordinates beyond 1e100), or [`GeometryError::Graph`].
pub fn from_polygons(
    polygons: &[ConvexPolygon],
    settings: &PolygonSettings,
) -> Result<Subdivision, GeometryError> {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (index, polygon) in polygons.iter().enumerate() {
        for &v in polygon.vertices() {
            if !v.is_finite() {
                return Err(GeometryError::Coordinate { index });
            }
            (min, max) = (min.min(v), max.max(v));
        }
    }
    if !min.cmple(max).all() {
        return Ok(Subdivision::default());
    }
    // The tolerance must exceed the roundings of coordinates this large, or planes of one wall would differ.
    let margin = checked("the margin", settings.margin)?;
    (min, max) = (min - margin, max + margin);
    let extent = min.abs().max(max.abs()).max_element();
    checked_extent(extent)?;
    if !settings.origin.is_finite() {
        return Err(GeometryError::Setting { what: "the origin", value: settings.origin.length() });
    }
    let least_tolerance = Lengths::least_tolerance(extent);
    let tolerance = settings.tolerance.unwrap_or_else(|| {
        let [low, high] = [min, max].map(|corner| (corner - settings.origin).abs());
        least_tolerance.max(low.max(high).max_element() / f64::from(1 << 20))
    });
    if checked("the tolerance", tolerance)? < least_tolerance {
        return Err(GeometryError::Setting { what: "the tolerance", value: tolerance });
    }
    let side = (max - min).max_element();
    let limits = Limits {
        lengths: Lengths::new(tolerance, extent),
        share: checked("the least share", settings.min_share)?,
        area: checked("the least area", settings.min_area.unwrap_or(side * side / 8192.0))?,
        large: side * side / 512.0,
        leaves: settings.max_cells.clamp(1, CellGraph::LIMIT),
    };
    let (fragments, planes) = fragments(polygons, settings.one_sided, &limits.lengths);
    let bsp = build(fragments, &planes, min, max, &limits);
    let (leaves, portals) = bsp.portals(&limits.lengths);

    // Regions that count as the inside of solids are no cells.
    let solid = match settings.solid {
        SolidRule::Nothing => alloc::vec![false; leaves.len()],
        SolidRule::Backs => {
            // Air between two signs has backs alone as well, but is open to other air.
            let others = (0..).zip(&leaves).filter(|(_, leaf)| leaf.backs == 0.0 || leaf.fronts > 0.0);
            let open = others.map(|(leaf, _)| leaf);
            reached(leaves.len(), &portals, open).into_iter().map(|reached| !reached).collect()
        }
        SolidRule::Unreached(points) => {
            let bodies = Viewcells::new(leaves.iter().map(|leaf| leaf.body.clone()));
            let starts = points.iter().filter_map(|&p| bodies.locate(p)).map(|cell| cell.0);
            // Without a start in any region, no region is solid.
            let reached = reached(leaves.len(), &portals, starts);
            let any = reached.contains(&true);
            reached.into_iter().map(|reached| any && !reached).collect()
        }
    };
    // Regions from which sight passes a one-sided face from behind, and all that portals join to them.
    let leaking = (0..leaves.len() as u32).filter(|&leaf| leaves[leaf as usize].leaks);
    let leaking = reached(leaves.len(), &portals, leaking);
    // A leaf that no polygon piece bounds is thinner than the rounding, and is no cell.
    let keep: Vec<bool> = leaves
        .iter()
        .zip(solid.iter().zip(&leaking))
        .map(|(leaf, (&solid, &leaking))| !solid && !leaking && leaf.body.min.cmple(leaf.body.max).all())
        .collect();
    let (count, portals) = renumber_leaves(portals, &keep);
    let graph = CellGraph::new(count, portals)?;
    let kept = || leaves.iter().zip(&keep).filter(|(_, keep)| **keep).map(|(leaf, _)| leaf);
    let outside = (0..).zip(kept()).filter(|(_, leaf)| leaf.outside).map(|(i, _)| CellId(i)).collect();
    let bodies = kept().map(|leaf| leaf.body.clone());
    let viewcells = Viewcells::of_divided_box(bodies, min, max, limits.lengths.misplacement);
    Ok(Subdivision { graph, viewcells, outside })
}

/// The [`PolygonSettings`], with lengths in world units and areas in square world units, and the maximum
/// number of leaf regions, with all defaults resolved.
struct Limits {
    lengths: Lengths,
    share: f64,
    area: f64,
    large: f64,
    leaves: usize,
}

/// Returns the input polygons wider than `lengths.sliver`, largest first, and the distinct planes that
/// `Fragment::plane` indexes. Nearly equal planes become one, and so do planes of opposite orientation.
fn fragments(
    polygons: &[ConvexPolygon],
    one_sided: &[bool],
    lengths: &Lengths,
) -> (Vec<Fragment>, Vec<Plane>) {
    let mut order: Vec<(f64, usize)> = polygons.iter().map(ConvexPolygon::area).zip(0..).collect();
    // Largest first, since the planes of large polygons are the most accurate.
    order.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let (mut fragments, mut planes): (Vec<Fragment>, Vec<Plane>) = (Vec::new(), Vec::new());
    let mut near: BTreeMap<[i64; 4], Vec<u32>> = BTreeMap::new();
    for (area, index) in order {
        let vertices = polygons[index].vertices();
        let Some(plane) = polygons[index].plane() else { continue };
        if width(vertices, plane.normal) <= lengths.sliver {
            continue;
        }
        // Opposite orientations are one plane: turned so that the greatest component of the normal is
        // positive.
        let n = plane.normal;
        let greatest = (0..3).fold(0, |best, i| if n[i].abs() > n[best].abs() + 1e-6 { i } else { best });
        let faces_front = n[greatest] > 0.0;
        let plane = if faces_front { plane } else { plane.flipped() };
        let n = plane.normal * 256.0;
        let key = [n.x, n.y, n.z, plane.offset / (16.0 * lengths.plane)]
            .map(|x| (x + 0.5) as i64 - i64::from(x < -0.5));
        let same = near.entry(key).or_default();
        let lies_in = |&group: &u32| {
            vertices.iter().all(|&v| planes[group as usize].signed_distance(v).abs() <= lengths.plane * 0.5)
        };
        let plane = match same.iter().copied().find(|group| lies_in(group)) {
            Some(group) => group,
            None => {
                same.push(planes.len() as u32);
                planes.push(plane);
                planes.len() as u32 - 1
            }
        };
        let one_sided = one_sided.get(index).copied().unwrap_or(false);
        fragments.push(Fragment { vertices: vertices.to_vec(), plane, area, one_sided });
    }
    (fragments, planes)
}

fn build(fragments: Vec<Fragment>, planes: &[Plane], min: DVec3, max: DVec3, limits: &Limits) -> Bsp {
    let mut bsp = Bsp { nodes: Vec::new(), leaves: 0, min, max };
    // Breadth first, so that a limit on leaves leaves out the details of all parts alike.
    let mut waiting = VecDeque::from([(None, fragments)]);
    while let Some((parent, fragments)) = waiting.pop_front() {
        let may_split = bsp.leaves + waiting.len() + 1 < limits.leaves;
        let plane = may_split.then(|| best_plane(&bsp, parent, &fragments, planes, limits)).flatten();
        let child = match plane {
            None => {
                bsp.leaves += 1;
                Child::Leaf(bsp.leaves as u32 - 1)
            }
            Some(plane) => {
                let number = bsp.nodes.len() as u32;
                let (covers, front, back) = divide_fragments(fragments, &plane, &limits.lengths);
                let child = Child::Node(number);
                bsp.nodes.push(Node { plane, parent, front: child, back: child, covers });
                waiting.extend([(Some((number, true)), front), (Some((number, false)), back)]);
                child
            }
        };
        if let Some((above, is_front)) = parent {
            let above: &mut Node = &mut bsp.nodes[above as usize];
            *(if is_front { &mut above.front } else { &mut above.back }) = child;
        }
    }
    bsp
}

/// Returns the plane along which to split a region. `parent` names the region: the index of a node, and
/// whether the region is its child in front of the node's plane (true) or behind (false); `None` is the whole
/// box. The plane with the greatest score is chosen. The score of a plane is the fraction of its section of
/// the region that polygons cover, less the fraction of polygons that it cuts, plus a bonus for balance.
/// `None` if no plane is covered enough.
fn best_plane(
    bsp: &Bsp,
    parent: Option<(u32, bool)>,
    fragments: &[Fragment],
    planes: &[Plane],
    limits: &Limits,
) -> Option<Plane> {
    let mut areas: Vec<(u32, f64)> = fragments.iter().map(|f| (f.plane, f.area)).collect();
    areas.sort_unstable_by_key(|&(plane, _)| plane);
    let mut sums: Vec<(u32, f64)> = areas
        .chunk_by(|a, b| a.0 == b.0)
        .map(|group| (group[0].0, group.iter().map(|(_, area)| area).sum()))
        .collect();
    sums.retain(|&(_, area)| area >= limits.area);
    sums.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let mut best: Option<(f64, Plane)> = None;
    for &(group, covered) in sums.iter().take(CANDIDATES) {
        let plane = planes[group as usize];
        let section = bsp.section(&plane, parent, &limits.lengths);
        let share = (covered / area(&section, plane.normal)).min(1.0);
        // An empty section means that the polygons lie beside the region by less than the tolerance.
        if section.is_empty() || share < limits.share && covered < limits.large {
            continue;
        }
        let (mut front, mut back) = (0, 0);
        for fragment in fragments {
            let distances = || fragment.vertices.iter().map(|&v| plane.signed_distance(v));
            front += usize::from(distances().any(|d| d > limits.lengths.plane));
            back += usize::from(distances().any(|d| d < -limits.lengths.plane));
        }
        let total = fragments.len().max(1) as f64;
        let splits = (front + back).saturating_sub(fragments.len()) as f64 / total;
        let score = share + 0.25 * front.min(back) as f64 / total - splits;
        if best.is_none_or(|(most, _)| score > most) {
            best = Some((score, plane));
        }
    }
    best.map(|(_, plane)| plane)
}

/// Distributes the fragments of a region to its two children. Returns the polygons in `plane`, the fragments
/// in front of `plane`, and the fragments behind. Fragments that cross the plane are cut.
fn divide_fragments(
    fragments: Vec<Fragment>,
    plane: &Plane,
    lengths: &Lengths,
) -> (Vec<NodeCover>, Vec<Fragment>, Vec<Fragment>) {
    let (mut covers, mut front, mut back) = (Vec::new(), Vec::new(), Vec::new());
    for fragment in fragments {
        let distances = || fragment.vertices.iter().map(|&v| plane.signed_distance(v));
        let is_ahead = distances().any(|d| d > lengths.plane);
        let is_behind = distances().any(|d| d < -lengths.plane);
        match (is_ahead, is_behind) {
            (false, false) => {
                let faces_front = fragment.normal().dot(plane.normal) >= 0.0;
                let Fragment { vertices, one_sided, .. } = fragment;
                covers.push(NodeCover { vertices, faces_front, one_sided });
            }
            (true, false) => front.push(fragment),
            (false, true) => back.push(fragment),
            (true, true) => {
                for (side, out) in [(*plane, &mut front), (plane.flipped(), &mut back)] {
                    let mut vertices = Vec::new();
                    clip_into(&fragment.vertices, &side, lengths.merge, &mut vertices);
                    if !vertices.is_empty() {
                        let mut part = Fragment { vertices, ..fragment.clone() };
                        part.area = area(&part.vertices, part.normal().normalize_or_zero());
                        out.push(part);
                    }
                }
            }
        }
    }
    (covers, front, back)
}

impl Fragment {
    /// Returns a vector of twice the polygon's area, along the normal around which the vertices run
    /// counter-clockwise.
    fn normal(&self) -> DVec3 {
        let v = &self.vertices;
        v.windows(2).fold(DVec3::ZERO, |sum, pair| sum + (pair[0] - v[0]).cross(pair[1] - v[0]))
    }
}

/// Returns, by leaf index, `true` if the leaf is one of `starts`, or a chain of portals joins it to one.
fn reached(
    leaves: usize,
    portals: &[super::bsp_portals::LeafPortal],
    starts: impl Iterator<Item = u32>,
) -> Vec<bool> {
    let mut reached = alloc::vec![false; leaves];
    let mut queue: Vec<u32> = starts.collect();
    if queue.is_empty() {
        return reached;
    }
    let mut next = alloc::vec![Vec::new(); leaves];
    for &(_, [a, b]) in portals {
        next[a as usize].push(b);
        next[b as usize].push(a);
    }
    while let Some(leaf) = queue.pop() {
        if !core::mem::replace(&mut reached[leaf as usize], true) {
            queue.extend(&next[leaf as usize]);
        }
    }
    reached
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use visibility_testing::Random;

    /// Returns the rectangle at `at` of an axis, with ranges of the next axis and of the one after.
    fn rectangle(axis: usize, at: f64, u: [f64; 2], v: [f64; 2]) -> ConvexPolygon {
        let corner = |[a, b]: [f64; 2]| {
            let mut p = DVec3::splat(at);
            (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (a, b);
            p
        };
        ConvexPolygon::new([[u[0], v[0]], [u[1], v[0]], [u[1], v[1]], [u[0], v[1]]].map(corner)).unwrap()
    }

    /// A polygon too narrow to divide space, which reaches from one corner of a box to the other.
    fn diagonal(min: [f64; 3], max: [f64; 3]) -> ConvexPolygon {
        let [min, max] = [min, max].map(DVec3::from);
        let beside = (max - min).normalize().any_orthonormal_vector() * 1e-6;
        ConvexPolygon::new([min, max, (min + max) * 0.5 + beside]).unwrap()
    }

    /// Returns the cells of polygons with a margin of 0 and a tolerance of 1 mm.
    fn cells(polygons: &[ConvexPolygon], settings: PolygonSettings<'_>) -> usize {
        let settings = settings.with_margin(0.0).with_tolerance(1e-3);
        from_polygons(polygons, &settings).unwrap().graph.cell_count()
    }

    /// Each unit face between two cells of a lattice is in a portal between them, unless a polygon covers it;
    /// then it is in none, but where portals were merged across it.
    #[test]
    fn portals_are_what_polygons_leave_open_of_the_faces_of_cells() {
        let (mut random, mut open, mut covered, mut wrong) = (Random(1), 0, 0, 0);
        for case in 0..40 {
            let whole = |random: &mut Random| {
                let low = random.between(0, 4);
                [low, random.between(low + 1, 5)].map(f64::from)
            };
            let count = 2 + random.below(10);
            let rectangles: Vec<(usize, f64, [f64; 2], [f64; 2])> = (0..count)
                .map(|_| {
                    (random.below(3), f64::from(random.between(0, 5)), whole(&mut random), whole(&mut random))
                })
                .collect();
            let mut soup: Vec<ConvexPolygon> =
                rectangles.iter().map(|&(axis, at, u, v)| rectangle(axis, at, u, v)).collect();
            soup.push(diagonal([0.0; 3], [5.0; 3]));
            let settings = PolygonSettings::default().with_margin(1.0).with_tolerance(1e-3);
            let settings = settings.with_min_share(random.pick(&[0.0, 0.3])).with_min_area(0.0);
            let found = from_polygons(&soup, &settings).unwrap();
            let box_ends = found.viewcells.divided_box();
            assert_eq!(
                box_ends,
                Some([DVec3::splat(-1.0), DVec3::splat(6.0)]),
                "case {case}: the divided box"
            );
            let owner = |p: DVec3| CellId(found.viewcells.locate(p).unwrap().0);
            let is_covered = |axis: usize, p: DVec3| {
                let (u, v) = (p[(axis + 1) % 3], p[(axis + 2) % 3]);
                let holds = |range: [f64; 2], x: f64| range[0] < x && x < range[1];
                rectangles
                    .iter()
                    .any(|&(of, at, us, vs)| of == axis && at == p[axis] && holds(us, u) && holds(vs, v))
            };
            let (range, mut all) = (-1..6, Vec::new());
            for (x, y) in range.clone().flat_map(|x| range.clone().map(move |y| (x, y))) {
                all.extend(range.clone().map(|z| DVec3::from([x, y, z].map(f64::from)) + 0.5));
            }
            for p in all {
                for axis in 0..3 {
                    let (face, next) = (p + DVec3::AXES[axis] * 0.5, p + DVec3::AXES[axis]);
                    if next[axis] > 6.0 {
                        continue;
                    }
                    let ends = [owner(p), owner(next)];
                    let is_on = |portal: &&visibility_core::cells::Portal| {
                        let vertices = portal.polygon().vertices();
                        let normal = portal.plane().normal;
                        let sides = (0..vertices.len()).map(|i| {
                            let (a, b) = (vertices[i], vertices[(i + 1) % vertices.len()]);
                            normal.cross(b - a).normalize_or_zero().dot(face - a)
                        });
                        portal.plane().signed_distance(face).abs() < 1e-6 && sides.fold(1.0, f64::min) > -1e-3
                    };
                    let on: Vec<_> = found.graph.portals().iter().filter(is_on).collect();
                    let is_between = |portal: &visibility_core::cells::Portal| {
                        let sense = portal.plane().normal[axis] > 0.0;
                        portal.cells() == if sense { ends } else { [ends[1], ends[0]] }
                    };
                    let has = on.iter().any(|portal| is_between(portal));
                    if ends[0] == ends[1] {
                        assert!(on.is_empty(), "case {case}: a portal within a cell at {face}");
                    } else if is_covered(axis, face) {
                        covered += 1;
                        wrong += u32::from(has);
                    } else {
                        open += 1;
                        assert!(has, "case {case}: no portal from {ends:?} at {face}: {rectangles:?}");
                    }
                }
            }
        }
        assert!(open > 3000 && covered > 1000, "{open} open faces, {covered} covered");
        assert!(wrong < covered / 5, "{wrong} of {covered} covered faces are open");
    }

    #[test]
    fn planes_divide_what_polygons_cover_enough_of() {
        // A box 64 m long: 1/512 of the square of its side is 8 m2.
        let divided = |section: f64, wall: [f64; 2], share: f64, area: f64| {
            let soup = [
                diagonal([0.0; 3], [64.0, section, section]),
                rectangle(0, 32.0, [0.0, wall[0]], [0.0, wall[1]]),
            ];
            cells(&soup, PolygonSettings::default().with_min_share(share).with_min_area(area)) == 2
        };
        assert!(divided(2.0, [1.0, 1.0], 0.25, 0.0), "a wall of the least share");
        assert!(!divided(2.0, [1.0, 1.0], 0.26, 0.0), "a wall of less than the least share");
        assert!(divided(2.0, [1.0, 1.0], 0.25, 1.0), "a wall of the least area");
        assert!(!divided(2.0, [1.0, 1.0], 0.25, 1.01), "a wall of less than the least area");
        assert!(divided(8.0, [4.0, 2.0], 2.0, 0.0), "a wall of 8 m2, whatever its share");
        assert!(!divided(8.0, [3.9, 2.0], 2.0, 0.0), "a wall of less than 8 m2 and a small share");
        // Walls that overlap cover no more than all of a section.
        let mut thrice = vec![rectangle(0, 32.0, [0.0, 1.0], [0.0, 1.0]); 3];
        thrice.push(diagonal([0.0; 3], [64.0, 1.0, 1.0]));
        let settings = PolygonSettings::default().with_min_area(0.0);
        assert_eq!(cells(&thrice, settings.with_min_share(1.1)), 1, "a share of more than all");
        assert_eq!(cells(&thrice, settings.with_min_share(1.0)), 2, "a share of all");
    }

    /// Returns the six faces of a cube of 4 m, outwards or inwards.
    fn cube(inwards: bool) -> Vec<ConvexPolygon> {
        let mut faces = Vec::new();
        for (axis, at) in (0..3).flat_map(|axis| [(axis, 0.0), (axis, 4.0)]) {
            let face = rectangle(axis, at, [0.0, 4.0], [0.0, 4.0]);
            let mut vertices = face.vertices().to_vec();
            if (at > 0.0) == inwards {
                vertices.reverse();
            }
            faces.push(ConvexPolygon::new(vertices).unwrap());
        }
        faces
    }

    #[test]
    fn solid_and_leaking_regions_are_no_cells() {
        let count = |polygons: &[ConvexPolygon], solid: SolidRule<'_>, margin: f64| {
            let settings = PolygonSettings::default().with_solid(solid).with_margin(margin);
            from_polygons(polygons, &settings.with_tolerance(1e-3)).unwrap().graph.cell_count()
        };
        let [block, room] = [cube(false), cube(true)];
        let [within, around, away] = [2.0, -0.5, 50.0].map(|x| [DVec3::splat(x)]);
        assert_eq!(count(&block, SolidRule::Nothing, 1.0), 7, "around a block and within");
        assert_eq!(count(&block, SolidRule::Backs, 1.0), 6, "around a block");
        assert_eq!(count(&room, SolidRule::Backs, 1.0), 7, "within a room, and what is joined around it");
        for (points, expected) in [(&within, 1), (&around, 6), (&away, 7)] {
            assert_eq!(count(&block, SolidRule::Unreached(points), 1.0), expected, "reached from {points:?}");
        }
        // Half of a room is bounded by the back of a wall across it, and by fronts.
        let mut divided = room;
        divided.push(rectangle(0, 2.0, [0.0, 4.0], [0.0, 4.0]));
        assert_eq!(count(&divided, SolidRule::Backs, 0.0), 2, "halves of a room");
        // Regions without polygons are not solid.
        let narrow = [diagonal([0.0; 3], [4.0; 3])];
        assert_eq!(count(&narrow, SolidRule::Backs, 1.0), 1, "a box with nothing in it");
    }

    #[test]
    fn the_limit_of_cells_holds_and_the_best_plane_divides_first() {
        let wall = |x: f64, width: f64| rectangle(0, x, [0.0, width], [0.0, 4.0]);
        let soup = [diagonal([0.0; 3], [10.0, 4.0, 4.0]), wall(2.0, 4.0), wall(5.0, 4.0), wall(9.0, 3.0)];
        let settings = PolygonSettings::default().with_margin(0.0).with_tolerance(1e-3);
        for limit in 1..6 {
            let found = from_polygons(&soup, &settings.with_max_cells(limit)).unwrap();
            assert_eq!(found.graph.cell_count(), limit.min(4), "a limit of {limit}");
            if limit == 2 {
                let mut ends: Vec<f64> =
                    found.viewcells.cells().iter().map(|cell| (cell.max.x * 1e6).round() / 1e6).collect();
                ends.sort_unstable_by(f64::total_cmp);
                assert_eq!(ends, [5.0, 10.0], "the plane with walls on both sides");
            }
        }
    }

    #[test]
    fn the_default_tolerance_is_of_coordinates_from_the_origin() {
        let misplacement = |min: f64, max: f64, origin: f64| {
            let soup = [rectangle(0, 1.0, [min, max], [-1.0, 1.0])];
            let settings =
                PolygonSettings::default().with_margin(0.0).with_origin(DVec3::new(1.0, origin, 0.0));
            from_polygons(&soup, &settings).unwrap().viewcells.misplacement()
        };
        let [fine, rounding] = [20, 40].map(|bits| 1.0 / (1u64 << bits) as f64);
        for (min, max, origin, relative, extent) in [
            (-1000.0, 10.0, 0.0, 1000.0, 1000.0),
            (-10.0, 1000.0, 0.0, 1000.0, 1000.0),
            (-10.0, 1000.0, 900.0, 910.0, 1000.0),
            (1e6, 1e6 + 10.0, 1e6, 0.0, 1e6 + 10.0),
            (-1e6 - 10.0, -1e6, -1e6, 0.0, 1e6 + 10.0),
        ] {
            let tolerance = f64::max(relative * fine, extent * rounding * 16.0);
            let expected = 0.5 * tolerance + 4.0 * extent * rounding;
            let found = misplacement(min, max, origin);
            assert!(
                (found / expected - 1.0).abs() < 1e-9,
                "{min} to {max}, {origin}: {found}, not {expected}"
            );
        }
    }

    #[test]
    fn settings_at_their_limits() {
        let soup = [rectangle(0, 1.0, [0.0, 1024.0], [0.0, 1.0])];
        let settings = PolygonSettings::default().with_margin(0.0);
        let least = 1024.0 / (1u64 << 36) as f64;
        assert!(from_polygons(&soup, &settings.with_tolerance(least)).is_ok(), "the least tolerance");
        let error = Err(GeometryError::Setting { what: "the tolerance", value: least.next_down() });
        assert_eq!(from_polygons(&soup, &settings.with_tolerance(least.next_down())), error, "less than it");
        for (min, max) in [(-1e77, 0.0), (0.0, 1e77)] {
            let soup = [rectangle(0, 0.0, [min, max], [0.0, 1e70])];
            let error = Err(GeometryError::Setting { what: "the greatest coordinate", value: 1e77 });
            assert_eq!(from_polygons(&soup, &settings), error, "from {min} to {max}");
        }
        let margin = from_polygons(&soup, &settings.with_margin(2.0)).unwrap().viewcells.divided_box();
        let expected = [DVec3::new(-1.0, -2.0, -2.0), DVec3::new(3.0, 1026.0, 3.0)];
        assert_eq!(margin, Some(expected), "the box with a margin of 2 m");
    }

    /// Polygons up to a quarter of the tolerance off a plane are in it, as are those that face the other way.
    #[test]
    fn polygons_near_one_plane_share_it() {
        let lengths = Lengths::new(0.1, 10.0);
        let base = rectangle(0, 1.0, [0.0, 9.0], [0.0, 9.0]);
        let planes = |other: ConvexPolygon| fragments(&[base.clone(), other], &[], &lengths).1.len();
        for (off, count) in [(0.024, 1), (0.026, 2), (-0.024, 1), (-0.026, 2)] {
            let flat = rectangle(0, 1.0 + off, [0.0, 3.0], [0.0, 3.0]);
            let mut turned = flat.vertices().to_vec();
            assert_eq!(planes(flat), count, "a polygon {off} m off");
            turned.reverse();
            assert_eq!(
                planes(ConvexPolygon::new(turned.iter().copied()).unwrap()),
                count,
                "turned, {off} m off"
            );
        }
        // A sliver as wide as a quarter of the tolerance covers nothing, a wider strip does.
        for (width, count) in [(0.024, 1), (0.026, 2)] {
            let strip = rectangle(1, 2.0, [0.0, width], [0.0, 3.0]);
            assert_eq!(
                fragments(&[base.clone(), strip], &[], &lengths).0.len(),
                count,
                "a strip {width} m wide"
            );
        }
    }

    /// Parts of polygons go to the sides that they reach by more than half of the tolerance, and cover the
    /// plane where they reach neither.
    #[test]
    fn fragments_go_to_the_sides_that_they_reach() {
        let lengths = Lengths::new(0.1, 10.0);
        let plane = Plane::new(DVec3::X, -1.0);
        let counts = |x: [f64; 2]| {
            let vertices =
                [[x[0], 0.0], [x[1], 0.0], [x[1], 4.0], [x[0], 4.0]].map(|[x, y]| DVec3::new(x, y, y * 0.5));
            let fragment = Fragment { vertices: vertices.to_vec(), plane: 0, area: 1.0, one_sided: false };
            let (covers, front, back) = divide_fragments(vec![fragment], &plane, &lengths);
            [covers.len(), front.len(), back.len()]
        };
        for (x, expected) in [
            ([0.96, 1.04], [1, 0, 0]),
            ([0.96, 1.06], [0, 1, 0]),
            ([0.94, 1.04], [0, 0, 1]),
            ([0.94, 1.06], [0, 1, 1]),
            ([0.0, 4.0], [0, 1, 1]),
            ([1.0, 4.0], [0, 1, 0]),
            ([-4.0, 1.0], [0, 0, 1]),
        ] {
            assert_eq!(counts(x), expected, "a fragment from {} to {}", x[0], x[1]);
        }
        let fragment = Fragment {
            vertices: rectangle(2, 0.0, [0.0, 4.0], [0.0, 2.0]).vertices().to_vec(),
            plane: 0,
            area: 8.0,
            one_sided: true,
        };
        let (_, front, back) = divide_fragments(vec![fragment], &plane, &lengths);
        assert_eq!((front[0].area, back[0].area), (6.0, 2.0), "areas of the parts");
        assert!(front[0].one_sided && back[0].one_sided, "parts of a one-sided polygon");
    }
}
