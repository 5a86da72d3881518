//! What every scene source yields: named objects as plain triangles, and camera walks through them.
//!
//! Recipes, VSCN files and glTF files all end here, so a program is written once for all of them. Nothing is
//! indexed or shared: a triangle soup is what the cullers' scene is filled from, and the simplest thing to
//! get right.

use crate::walk::Walk;
use glam::{DVec3, Vec3};
use visibility_core::{cells::CellGraph, pvs::Viewcells};

/// A scene with its camera walks.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneSource {
    /// The recipe or file stem.
    pub name: String,
    /// The unit axis that points to the sky.
    pub up: Vec3,
    /// A near-plane distance that suits the walks, in metres.
    pub near: f32,
    /// The objects, in the order of the file or recipe: their index is their identity.
    pub objects: Vec<SourceObject>,
    /// The camera walks; a loader makes one up when the scene brings none, so this is empty only for an
    /// empty scene.
    pub walks: Vec<Walk>,
    /// The cells and portals that the scene comes with; most come with none.
    pub cells: Option<SourceCells>,
}

/// The cells and portals of a scene. Cell `i` of the graph is viewcell `i`.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceCells {
    /// Which cells are joined by which portals. Its objects are filled in when a scene is made of the
    /// source.
    pub graph: CellGraph,
    /// Where the cells are.
    pub viewcells: Viewcells,
    /// Their names.
    pub names: Vec<String>,
    /// How far an object reaches into the cells that it is in, at least, in metres. Where walls stand across
    /// the boundaries of cells, one that only touches a cell is hidden from it by the wall there; an object
    /// that reaches so far into none is in all that it touches.
    pub depth: f64,
    /// The same with a cell for each doorway, as deep as its wall, where that is known: what is seen through
    /// portals from one point is much tighter then.
    pub with_doorways: Option<Box<SourceCells>>,
}

/// How far cells and portals may be off: about a tenth of a micrometre in a building, and what rounding does
/// far from the origin.
pub fn tolerance(cells: &Viewcells) -> f64 {
    let (extent, farthest) = size(cells);
    // Powers of two: answers do not change when a scene is scaled by one.
    extent * 2.0f64.powi(-30) + farthest * 2.0f64.powi(-49)
}

/// How clear of the edges of portals a line must pass for sets that are baked to count it: about a micrometre
/// in a building.
pub fn clearance(cells: &Viewcells) -> f64 {
    let (extent, farthest) = size(cells);
    (extent * 2.0f64.powi(-26)).max(farthest * 2.0f64.powi(-32))
}

/// The greatest side of the box around all cells, and their greatest coordinate.
fn size(cells: &Viewcells) -> (f64, f64) {
    let (min, max) = cells.cells().iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), cell| {
        (min.min(cell.min), max.max(cell.max))
    });
    ((max - min).max_element(), min.abs().max(max.abs()).max_element())
}

/// One object of a scene: what is culled as a whole.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceObject {
    /// The name in the source; not unique.
    pub name: String,
    /// World-space triangles. Vertices of files are kept as they are, NaN and infinities included.
    pub triangles: Vec<[Vec3; 3]>,
    /// False for glass and cut-out billboards, which can be hidden but must never hide anything.
    pub opaque: bool,
    /// True for a door leaf: the walks of some scenes pass through closed doors, so a program may want to
    /// open (leave out) these. Reference counts that come with a scene are taken with every door closed and
    /// drawn.
    pub door: bool,
}

/// An axis-aligned box as (smallest, largest) corner.
pub type Corners = (Vec3, Vec3);

impl SourceObject {
    /// An opaque object that is no door.
    pub fn new(name: impl Into<String>, triangles: Vec<[Vec3; 3]>) -> Self {
        Self { name: name.into(), triangles, opaque: true, door: false }
    }

    /// The box around the finite coordinates, or `None` when an axis has none.
    pub fn bounds(&self) -> Option<Corners> {
        bounds_of(self.triangles.iter().flatten())
    }
}

impl SceneSource {
    /// Triangles of all objects together.
    pub fn triangle_count(&self) -> usize {
        self.objects.iter().map(|o| o.triangles.len()).sum()
    }

    /// The box around the finite coordinates of all objects, or `None` when an axis has none.
    pub fn bounds(&self) -> Option<Corners> {
        bounds_of(self.objects.iter().flat_map(|o| o.triangles.iter().flatten()))
    }
}

/// Non-finite coordinates are skipped one by one: a camera or a picture needs a usable box even when a file
/// holds a NaN.
fn bounds_of<'a>(points: impl Iterator<Item = &'a Vec3>) -> Option<Corners> {
    let mut low = Vec3::INFINITY;
    let mut high = Vec3::NEG_INFINITY;
    for point in points {
        low = low.min(Vec3::select(point.is_finite_mask(), *point, Vec3::INFINITY));
        high = high.max(Vec3::select(point.is_finite_mask(), *point, Vec3::NEG_INFINITY));
    }
    low.cmple(high).all().then_some((low, high))
}

/// The file name without its extension.
pub(crate) fn stem(path: &std::path::Path) -> String {
    path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_skip_what_is_not_finite() {
        let triangle =
            [Vec3::new(1.0, f32::NAN, 3.0), Vec3::new(-1.0, 2.0, f32::INFINITY), Vec3::new(0.0, 5.0, 4.0)];
        let object = SourceObject::new("odd", vec![triangle]);
        let (low, high) = object.bounds().expect("each axis has finite values");
        assert_eq!(low, Vec3::new(-1.0, 2.0, 3.0));
        assert_eq!(high, Vec3::new(1.0, 5.0, 4.0));
        let nothing = SourceObject::new("none", vec![[Vec3::NAN; 3]]);
        assert_eq!(nothing.bounds(), None);
    }
}
