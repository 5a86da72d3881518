//! Scene type that recipes and file readers produce: named objects as plain triangles, and camera walks.
//!
//! Recipes, VSCN files and glTF files all produce this type, so a program is written once for all sources.
//! Triangles are not indexed: a triangle soup is the simplest form from which to fill the cullers' scene.
//! Objects with the same mesh share its triangles, each with a transform of its own.

use crate::error::SourceError;
use crate::object_name::ObjectName;
use crate::walk::Walk;
use glam::{DAffine3, DVec3, Vec3};
use std::fmt;
use std::str::FromStr;
use visibility_core::scene::SharedTriangles;
use visibility_core::{Aabb, Object, cells::CellGraph, pvs::Viewcells};

/// Scene with its camera walks, in metres. Walks and cells are in world space, and objects relative to
/// [`origin`](Self::origin).
#[derive(Debug, Clone, PartialEq)]
pub struct SceneSource {
    /// Name of the scene: from the file's description, or else the recipe's name or the file name without
    /// extension.
    pub name: String,
    /// Unit vector in world space that points up.
    pub up: Vec3,
    /// Near plane distance in metres, chosen for the walks.
    pub near: f32,
    /// Point in world space that the coordinates of objects are relative to: zero, except for a file whose
    /// content is far from its own origin.
    pub origin: DVec3,
    /// Messages to the user about parts of the file that were not read, or not read as one may expect.
    pub notes: Vec<String>,
    /// Objects, in the order of the file or recipe. The index of an object is its identity.
    pub objects: Vec<SourceObject>,
    /// Camera walks. Empty for a file without walks, until [`with_walks`](Self::with_walks) makes some up.
    pub walks: Vec<Walk>,
    /// Points in world space on floors where one can stand, half a metre apart, each with the free height
    /// above it in metres. Empty unless the walks were made up and lead along floors.
    pub floors: Vec<(DVec3, f64)>,
    /// Cells and portals of the scene. `None` for sources without them, such as most files.
    pub cells: Option<SourceCells>,
}

/// Cells and portals of a scene. Cell `i` of the graph has viewcell `i` and name `i`.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceCells {
    /// Graph of the cells and the portals that join them. The lists of the objects in each cell are filled
    /// in later, when a scene is made of the source.
    pub graph: CellGraph,
    /// Convex bodies of the cells in world space, by cell index.
    pub viewcells: Viewcells,
    /// Names of the cells, by cell index.
    pub names: Vec<String>,
    /// Least depth in metres that an object must reach into a cell to be listed there. An object that only
    /// touches a cell through a wall on the cell's boundary is hidden from the cell by that wall. An object
    /// that reaches this depth in no cell is listed in every cell that it touches.
    pub depth: f64,
    /// Second graph of the scene with an additional cell for each doorway, as deep as the doorway's wall.
    /// Portal culling from a point culls much more with this graph. `None` when the depths of doorways are
    /// unknown, and in the second graph itself.
    pub with_doorways: Option<Box<SourceCells>>,
}

/// Returns the least distance, in metres, from portal edges at which a line counts as passing for baked
/// visible sets: the larger of 2^-26 of the cells' extent, about a micrometre in a building, and 2^-32 of the
/// largest coordinate.
pub fn clearance(cells: &Viewcells) -> f64 {
    let (min, max) = cells.cells().iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), cell| {
        (min.min(cell.min), max.max(cell.max))
    });
    let (extent, farthest) = ((max - min).max_element(), min.abs().max(max.abs()).max_element());
    (extent * 2.0f64.powi(-26)).max(farthest * 2.0f64.powi(-32))
}

/// Object of a scene: the triangles that are culled and drawn as a whole.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceObject {
    /// Name in the source; not necessarily unique.
    pub name: ObjectName,
    /// Triangles relative to the scene's origin, in metres, which other objects may share. For an object that
    /// moves, in its rest pose. Vertices from files are kept unchanged, NaN and infinities included.
    pub triangles: SharedTriangles,
    /// Whether the object may serve as an occluder. False for glass and cut-out billboards, which can be
    /// hidden but must never hide other objects, and for objects that a hint excludes.
    pub opaque: bool,
    /// Whether things behind the object are visible through it, as through glass and cut-out billboards.
    pub see_through: bool,
    /// Whether the triangles are drawn only from their front. From behind they are invisible, and hide
    /// nothing.
    pub one_sided: bool,
    /// Whether a transform has made surfaces flat that are drawn only from their front, so that either of
    /// their sides may be drawn. They hide nothing, whatever a hint says.
    pub flattened: bool,
    /// Whether the object is a door leaf. The walks of some scenes pass through closed doors, so a program
    /// may leave doors out. Reference counts of a scene are taken with every door closed and drawn.
    pub door: bool,
    /// Whether the object is visible from everywhere, such as one that moves without known bounds.
    pub never_cull: bool,
    /// Bounds of the object throughout all animations, relative to the scene's origin. `None` if no animation
    /// moves it.
    pub motion: Option<Box<Corners>>,
}

/// Numbers of triangles of a scene by kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Surfaces {
    /// Number of triangles that occlude.
    pub opaque: usize,
    /// Number of see-through triangles.
    pub see_through: usize,
    /// Number of triangles, opaque or see-through, that are drawn only from their front.
    pub one_sided: usize,
}

impl std::fmt::Display for Surfaces {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { opaque, see_through, one_sided } = self;
        write!(f, "{opaque} opaque, {see_through} see-through, {one_sided} one-sided")
    }
}

/// Hint of a level's author on the use of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hint {
    /// The object occludes, although its material is see-through.
    Occluder,
    /// The object hides nothing.
    Detail,
    /// The object is the leaf of a door: it hides nothing in a bake, since the door may be open.
    Door,
    /// The object moves: it hides nothing in a bake, and is visible from everywhere.
    Mover,
    /// The object is visible from everywhere.
    NeverCull,
}

impl FromStr for Hint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "occluder" => Ok(Self::Occluder),
            "detail" => Ok(Self::Detail),
            "door" => Ok(Self::Door),
            "mover" => Ok(Self::Mover),
            "never-cull" => Ok(Self::NeverCull),
            _ => Err(format!("`{text}` is none of occluder, detail, door, mover and never-cull")),
        }
    }
}

impl fmt::Display for Hint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Occluder => "occluder",
            Self::Detail => "detail",
            Self::Door => "door",
            Self::Mover => "mover",
            Self::NeverCull => "never-cull",
        })
    }
}

/// Beginning of the note that a scene's walks are the cameras of its file.
pub(crate) const CAMERAS_OF_FILE: &str = "walks are the cameras of the file";

/// Axis-aligned box as its minimum and maximum corner, in metres.
pub type Corners = (Vec3, Vec3);

impl SourceObject {
    /// Creates an opaque object that is drawn from both sides and not a door, from its world-space triangles.
    pub fn new(name: impl Into<ObjectName>, triangles: impl Into<SharedTriangles>) -> Self {
        Self {
            name: name.into(),
            triangles: triangles.into(),
            opaque: true,
            see_through: false,
            one_sided: false,
            flattened: false,
            door: false,
            never_cull: false,
            motion: None,
        }
    }

    /// Returns whether the object may be a wall of cells, plans and servers, which is always where its
    /// triangles are: it is opaque, no door, and nothing moves it.
    pub fn is_wall(&self) -> bool {
        self.opaque && !self.door && !self.never_cull && self.motion.is_none()
    }

    /// Returns the object in the form of the cullers' scene. A door occludes here.
    pub fn object(&self) -> Object {
        Object {
            cost: u32::try_from(self.triangles.len()).unwrap_or(u32::MAX),
            occluder: self.opaque,
            never_cull: self.never_cull,
            see_through: self.see_through,
            one_sided: self.one_sided,
            ..Object::new(self.all_bounds())
        }
    }

    /// Returns the box around the triangles and all places that animations move them to.
    fn all_bounds(&self) -> Aabb {
        let bounds = self.triangles.bounds();
        match self.motion.as_deref() {
            Some(&(low, high)) => Aabb::from_points([bounds.min, bounds.max, low, high]),
            None => bounds,
        }
    }

    /// Returns the triangles for the cullers' scene: none for an object that moves, since it may be anywhere
    /// within its bounds.
    pub fn fixed_triangles(&self) -> SharedTriangles {
        if self.motion.is_some() { [].into() } else { self.triangles.clone() }
    }

    /// Moves all triangles of the object by `shift` metres.
    fn move_by(&mut self, shift: DVec3) {
        if let (_, Some(transform)) = self.triangles.view().mesh() {
            self.triangles = self.triangles.placed(DAffine3::from_translation(shift) * transform);
            return;
        }
        let move_by = |point: &mut Vec3| *point = (point.as_dvec3() + shift).as_vec3();
        self.edit_triangles(|triangles| triangles.as_flattened_mut().iter_mut().for_each(move_by));
    }

    /// Changes the triangles. The object then has a copy of its own instead of shared triangles.
    pub fn edit_triangles(&mut self, change: impl FnOnce(&mut Vec<[Vec3; 3]>)) {
        let mut triangles = self.triangles.view().to_vec();
        change(&mut triangles);
        self.triangles = triangles.into();
    }

    /// Applies a hint. An object that animations move, or that is flattened, hides nothing, whatever the
    /// hint.
    pub fn take(&mut self, hint: Hint) {
        match hint {
            Hint::Occluder if self.flattened => {}
            Hint::Occluder => (self.opaque, self.see_through) = (self.motion.is_none(), false),
            Hint::Detail => self.opaque = false,
            Hint::Door => self.door = true,
            Hint::Mover => (self.opaque, self.never_cull) = (false, true),
            Hint::NeverCull => self.never_cull = true,
        }
    }

    /// Applies, in order, the hints whose text the object's name contains. Sets `is_named` for each hint
    /// applied.
    pub fn take_all(&mut self, hints: &[(Hint, String)], is_named: &mut [bool]) {
        for ((hint, part), is_named) in hints.iter().zip(is_named) {
            if self.name.to_string().contains(part) {
                self.take(*hint);
                *is_named = true;
            }
        }
    }

    /// Returns the box around the finite coordinates. `None` when one of the axes has no finite coordinate,
    /// as for an object without triangles.
    pub fn bounds(&self) -> Option<Corners> {
        Bounds::from_iter([self]).corners()
    }
}

/// Checks that each hint applies to an object.
///
/// # Errors
///
/// Returns a message for the first hint that applies to no object.
pub fn check_hints(hints: &[(Hint, String)], is_named: &[bool]) -> Result<(), String> {
    match hints.iter().zip(is_named).find(|&(_, is_named)| !is_named) {
        Some(((_, part), _)) => Err(format!("no name of an object contains `{part}`")),
        None => Ok(()),
    }
}

/// Reads a hint, and the text in the names of its objects, such as mover=Lift.
///
/// # Errors
///
/// Returns a message if the text has another form.
pub fn parse_hint(text: &str) -> Result<(Hint, String), String> {
    let (hint, part) = text.split_once('=').ok_or("a hint is HINT=TEXT, as in mover=Lift")?;
    Ok((hint.parse()?, part.to_owned()))
}

impl SceneSource {
    /// Returns the name of the axis nearest to the up direction, regardless of sign: `x`, `y` or `z`.
    pub fn up_axis(&self) -> &'static str {
        ["x", "y", "z"][self.up.abs().max_position()]
    }

    /// Creates a scene without objects, walks and cells, and with its origin at that of world space.
    pub fn new(name: impl Into<String>, up: Vec3, near: f32) -> Self {
        Self {
            name: name.into(),
            up,
            near,
            origin: DVec3::ZERO,
            notes: Vec::new(),
            objects: Vec::new(),
            walks: Vec::new(),
            floors: Vec::new(),
            cells: None,
        }
    }

    /// Returns a copy of the scene without its objects and cells.
    #[must_use]
    pub fn without_objects(&self) -> Self {
        Self {
            name: self.name.clone(),
            notes: self.notes.clone(),
            walks: self.walks.clone(),
            floors: self.floors.clone(),
            objects: Vec::new(),
            cells: None,
            ..*self
        }
    }

    /// Removes the walks, and the note that they come from the file.
    pub fn drop_walks(&mut self) {
        self.walks.clear();
        self.notes.retain(|note| !note.starts_with(CAMERAS_OF_FILE));
    }

    /// Appends the objects of another scene. They keep their positions in world space.
    pub fn append(&mut self, other: SceneSource) {
        let shift = other.origin - self.origin;
        self.objects.extend(other.objects.into_iter().map(|mut object| {
            if shift != DVec3::ZERO {
                object.move_by(shift);
                if let Some((low, high)) = object.motion.as_deref_mut() {
                    let bounds = Aabb::from_world(low.as_dvec3(), high.as_dvec3(), -shift);
                    (*low, *high) = (bounds.min, bounds.max);
                }
            }
            object
        }));
    }

    /// Counts the triangles of all objects by kind.
    pub fn surfaces(&self) -> Surfaces {
        let mut all = Surfaces::default();
        for object in &self.objects {
            let triangles = object.triangles.len();
            *(if object.see_through { &mut all.see_through } else { &mut all.opaque }) += triangles;
            all.one_sided += if object.one_sided { triangles } else { 0 };
        }
        all
    }

    /// Returns the number of triangles of all objects together.
    pub fn triangle_count(&self) -> usize {
        self.objects.iter().map(|o| o.triangles.len()).sum()
    }

    /// Checks the number of triangles for a method that copies the triangles of every instance.
    ///
    /// # Errors
    ///
    /// Returns a message with the number of triangles, if it is more than 2^25.
    pub fn check_copies(&self) -> Result<(), String> {
        const MOST: usize = 1 << 25;
        let all = self.triangle_count();
        let refused = || {
            format!(
                "it copies the triangles of each instance of a mesh, {all} in all, and takes at most {MOST}, \
                 unlike frustum, contribution, hzb, view-cdt and the judge"
            )
        };
        if all > MOST { Err(refused()) } else { Ok(()) }
    }

    /// Returns the number of objects that are instances of a mesh with a transform, and the number of
    /// distinct meshes, each of which is stored once.
    pub fn instances(&self) -> [usize; 2] {
        let placed = self.objects.iter().map(|object| object.triangles.view().mesh());
        let mut meshes: Vec<_> =
            placed.filter(|(_, transform)| transform.is_some()).map(|(mesh, _)| mesh.as_ptr()).collect();
        let objects = meshes.len();
        meshes.sort_unstable();
        meshes.dedup();
        [objects, meshes.len()]
    }

    /// Returns the box around the finite coordinates of all objects. `None` when one of the axes has no
    /// finite coordinate. Visits the vertices of objects with a coordinate that is not finite.
    pub fn bounds(&self) -> Option<Corners> {
        Bounds::from_iter(&self.objects).corners()
    }
}

/// Makes a scene by `make`, which passes the objects on, and puts these objects into the scene that `make`
/// returns.
pub(crate) fn collected(
    make: impl FnOnce(&mut dyn FnMut(SourceObject)) -> Result<SceneSource, SourceError>,
) -> Result<SceneSource, SourceError> {
    let mut objects = Vec::new();
    let scene = make(&mut |object| objects.push(object))?;
    Ok(SceneSource { objects, ..scene })
}

/// Box around the finite coordinates of objects that are added one by one. NaN and infinite coordinates are
/// skipped individually, since a camera needs a usable box even if a file holds a NaN.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Default for Bounds {
    fn default() -> Self {
        Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY }
    }
}

impl Bounds {
    /// Extends the box by the finite coordinates of an object. For an instance, it extends the box by the
    /// image of the mesh's box.
    pub fn add(&mut self, object: &SourceObject) {
        let bounds = object.triangles.view().known_bounds();
        if let Some(bounds) = bounds.filter(Aabb::is_finite) {
            (self.low, self.high) = (self.low.min(bounds.min), self.high.max(bounds.max));
            return;
        }
        for point in object.triangles.iter().flatten() {
            self.low = self.low.min(Vec3::select(point.is_finite_mask(), point, Vec3::INFINITY));
            self.high = self.high.max(Vec3::select(point.is_finite_mask(), point, Vec3::NEG_INFINITY));
        }
    }

    /// Returns the corners of the box. `None` when one of the axes has no finite coordinate.
    pub fn corners(&self) -> Option<Corners> {
        self.low.cmple(self.high).all().then_some((self.low, self.high))
    }
}

impl<'a> FromIterator<&'a SourceObject> for Bounds {
    fn from_iter<T: IntoIterator<Item = &'a SourceObject>>(objects: T) -> Self {
        let mut bounds = Self::default();
        objects.into_iter().for_each(|object| bounds.add(object));
        bounds
    }
}

/// Returns the file name without its extension; empty when the path has no file name.
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
        assert_eq!(low, Vec3::new(-1.0, 2.0, 3.0), "the lower corner, by axis");
        assert_eq!(high, Vec3::new(1.0, 5.0, 4.0), "the upper corner, by axis");
        let nothing = SourceObject::new("none", vec![[Vec3::NAN; 3]]);
        assert_eq!(nothing.bounds(), None, "nothing is finite");
    }

    #[test]
    fn hints_are_written_as_they_are_read() {
        for hint in [Hint::Occluder, Hint::Detail, Hint::Door, Hint::Mover, Hint::NeverCull] {
            assert_eq!(hint.to_string().parse(), Ok(hint), "the hint from its text");
        }
    }
}
