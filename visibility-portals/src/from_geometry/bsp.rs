//! Cells from any polygons, by a BSP tree along their planes.
//!
//! This work is based on: Henry Fuchs, Zvi Kedem and Bruce Naylor, "On Visible Surface Generation by A Priori
//! Tree Structures", 1980, for the auto-partition; Seth Teller, "Visibility Computations in Densely Occluded
//! Polyhedral Environments", 1992, for preferring the planes of which polygons cover most. A region in which
//! no plane is covered enough is not divided; polygons left within it hide nothing.

use super::leaves::{Bsp, Child, Node, numbered};
use super::subdivision::{GeometryError, Subdivision, checked};
use super::subtract::{Lengths, area, width};
use crate::clip_polygon::clip_into;
use alloc::collections::{BTreeMap, VecDeque};
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{
    cells::{CellGraph, CellId},
    geometry::{ConvexPolygon, Plane},
    pvs::Viewcells,
};

/// Which regions are solid, and so no cells.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Solid<'a> {
    /// None. The inside of a wall is a cell that nobody enters.
    Nothing,
    /// Those that cannot be reached through portals from any of these points. None, if none of the points is
    /// in a region.
    Unreached(&'a [DVec3]),
    /// Those bounded by backs of polygons and by no fronts. A polygon's vertices run counter-clockwise as
    /// seen from its front.
    Backs,
}

/// Settings of [`from_polygons`].
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PolygonSettings<'a> {
    /// The distance, in world units, that a line must keep from all polygons to be certain to pass. `None`:
    /// 2^-20 of the greatest coordinate, well above the rounding of `f32`.
    pub tolerance: Option<f64>,
    /// The least share of the section of a region, from 0 to 1, that polygons must cover for the region to
    /// be split there. An area of 1/512 of the square of the longest side of the whole will do as well:
    /// of a large region even large walls cover little.
    pub least_share: f64,
    /// The least area that polygons must cover in any case. `None`: 2^-13 of the square of the longest side
    /// of the whole.
    pub least_area: Option<f64>,
    /// The distance by which the outermost cells reach beyond the polygons.
    pub margin: f64,
    /// The most regions. Splitting stops there.
    pub most_cells: usize,
    /// Which regions are solid.
    pub solid: Solid<'a>,
}

impl Default for PolygonSettings<'_> {
    fn default() -> Self {
        Self {
            tolerance: None,
            least_share: 0.25,
            least_area: None,
            margin: 1.0,
            most_cells: 1 << 14,
            solid: Solid::Nothing,
        }
    }
}

/// The number of planes that are compared closely for a split: those with most area.
const CANDIDATES: usize = 12;

/// A polygon, or a part that splits have left of one.
#[derive(Clone, Debug)]
struct Fragment {
    vertices: Vec<DVec3>,
    /// Index of its plane among the distinct planes.
    plane: u32,
    area: f64,
}

/// Divides space along opaque polygons of any kind: gaps, duplicates, T-junctions and polygons that pass
/// through one another are allowed. Time is about that of regions times the polygons that reach into them.
///
/// # Errors
/// [`GeometryError`], with the index of the polygon or the name of the setting.
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
/// [`GeometryError`].
pub fn from_polygons(
    polygons: &[ConvexPolygon],
    settings: &PolygonSettings,
) -> Result<Subdivision, GeometryError> {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (index, polygon) in polygons.iter().enumerate() {
        for &v in polygon.vertices() {
            if !v.is_finite() {
                return Err(GeometryError::NonFinite { index });
            }
            (min, max) = (min.min(v), max.max(v));
        }
    }
    if !min.cmple(max).all() {
        return Ok(Subdivision::default());
    }
    let margin = checked("the margin", settings.margin)?;
    (min, max) = (min - margin, max + margin);
    let extent = min.abs().max(max.abs()).max_element();
    if extent > 1e100 {
        // Areas and volumes of it would be no numbers.
        return Err(GeometryError::Setting { what: "the greatest coordinate", value: extent });
    }
    let tolerance = match settings.tolerance {
        Some(tolerance) => checked("the tolerance", tolerance)?,
        None => extent / f64::from(1 << 20),
    };
    if tolerance < Lengths::least_tolerance(extent) {
        return Err(GeometryError::Setting { what: "the tolerance", value: tolerance });
    }
    let side = (max - min).max_element();
    let limits = Limits {
        lengths: Lengths::new(tolerance, extent),
        share: checked("the least share", settings.least_share)?,
        area: checked("the least area", settings.least_area.unwrap_or(side * side / 8192.0))?,
        large: side * side / 512.0,
        leaves: settings.most_cells.clamp(1, CellGraph::LIMIT),
    };
    let (fragments, planes) = fragments(polygons, &limits.lengths);
    let bsp = build(fragments, &planes, min, max, &limits);
    let (leaves, portals) = bsp.portals(&limits.lengths);

    let solid = match settings.solid {
        Solid::Nothing => alloc::vec![false; leaves.len()],
        Solid::Backs => leaves.iter().map(|leaf| leaf.backs > 0.0 && leaf.fronts == 0.0).collect(),
        Solid::Unreached(points) => {
            let bodies = Viewcells::new(leaves.iter().map(|leaf| leaf.body.clone()));
            let starts = points.iter().filter_map(|&p| bodies.locate(p)).map(|cell| cell.0);
            unreached(leaves.len(), &portals, starts)
        }
    };
    // A leaf that nothing bounds is thinner than rounding.
    let keep: Vec<bool> = leaves
        .iter()
        .zip(&solid)
        .map(|(leaf, &solid)| !solid && leaf.body.min.cmple(leaf.body.max).all())
        .collect();
    let (count, portals) = numbered(portals, &keep);
    let graph = CellGraph::new(count, portals)?;
    let kept = || leaves.iter().zip(&keep).filter(|(_, keep)| **keep).map(|(leaf, _)| leaf);
    let outside = (0..).zip(kept()).filter(|(_, leaf)| leaf.outside).map(|(i, _)| CellId(i)).collect();
    Ok(Subdivision { graph, viewcells: kept().map(|leaf| leaf.body.clone()).collect(), outside })
}

/// The settings as lengths, areas and counts.
struct Limits {
    lengths: Lengths,
    share: f64,
    area: f64,
    large: f64,
    leaves: usize,
}

/// The polygons that cover anything, and their planes. Planes that are nearly equal, or each other turned
/// over, become one.
fn fragments(polygons: &[ConvexPolygon], lengths: &Lengths) -> (Vec<Fragment>, Vec<Plane>) {
    let mut order: Vec<(f64, usize)> = polygons.iter().map(ConvexPolygon::area).zip(0..).collect();
    // The largest first: their planes are the most certain.
    order.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let (mut fragments, mut planes): (Vec<Fragment>, Vec<Plane>) = (Vec::new(), Vec::new());
    let mut near: BTreeMap<[i64; 4], Vec<u32>> = BTreeMap::new();
    for (area, index) in order {
        let vertices = polygons[index].vertices();
        let Some(plane) = polygons[index].plane() else { continue };
        if width(vertices, plane.normal) <= lengths.sliver {
            continue;
        }
        // Planes that look both ways are the same: turned so that the greatest component is positive.
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
        fragments.push(Fragment { vertices: vertices.to_vec(), plane, area });
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
                let (covers, front, back) = divide(fragments, &plane, &limits.lengths);
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

/// The plane to split a region along: the one of which polygons cover the greatest share, less for polygons
/// that it cuts, more for balance. `None` if none is covered enough.
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
        // Where nothing of the plane is left, polygons lie beside the region by less than the tolerance.
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

/// The polygons in a plane, in front of it, and behind it.
#[allow(clippy::type_complexity)]
fn divide(
    fragments: Vec<Fragment>,
    plane: &Plane,
    lengths: &Lengths,
) -> (Vec<(Vec<DVec3>, bool)>, Vec<Fragment>, Vec<Fragment>) {
    let (mut covers, mut front, mut back) = (Vec::new(), Vec::new(), Vec::new());
    for fragment in fragments {
        let distances = || fragment.vertices.iter().map(|&v| plane.signed_distance(v));
        let is_ahead = distances().any(|d| d > lengths.plane);
        let is_behind = distances().any(|d| d < -lengths.plane);
        match (is_ahead, is_behind) {
            (false, false) => {
                let normal = fragment.normal();
                covers.push((fragment.vertices, normal.dot(plane.normal) >= 0.0));
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
    /// Twice the area, along the normal around which the vertices run counter-clockwise.
    fn normal(&self) -> DVec3 {
        let v = &self.vertices;
        v.windows(2).fold(DVec3::ZERO, |sum, pair| sum + (pair[0] - v[0]).cross(pair[1] - v[0]))
    }
}

/// The regions that no chain of portals joins to one of `starts`. None, if there are no starts.
fn unreached(
    leaves: usize,
    portals: &[super::leaves::LeafPortal],
    starts: impl Iterator<Item = u32>,
) -> Vec<bool> {
    let mut unreached = alloc::vec![true; leaves];
    let mut queue: Vec<u32> = starts.collect();
    if queue.is_empty() {
        return alloc::vec![false; leaves];
    }
    let mut next = alloc::vec![Vec::new(); leaves];
    for &(_, [a, b]) in portals {
        next[a as usize].push(b);
        next[b as usize].push(a);
    }
    while let Some(leaf) = queue.pop() {
        if core::mem::replace(&mut unreached[leaf as usize], false) {
            queue.extend(&next[leaf as usize]);
        }
    }
    unreached
}
