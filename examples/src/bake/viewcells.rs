//! Viewcells of a bake: where the users of a scene can be.

use super::failure::Failure;
use crate::region::cells;
use crate::source::Corners;
use crate::{Reading, SceneSource, load_as};
use clap::Args;
use glam::{DVec3, Vec3};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use visibility_bake::{CameraRange, Grid, GridError, TiledScene};
use visibility_core::Scene;
use visibility_core::pvs::{Viewcell, Viewcells};

/// Least and greatest eye height in metres of a standing person.
const STANDING: [f64; 2] = [1.0, 2.0];

/// Places of the viewcells.
#[derive(Args, Clone, PartialEq, Debug)]
pub struct Places {
    /// Places of the viewcells: `stand` for the boxes of a grid above all floors where one can stand, 1 to 2
    /// m high, up to opaque objects; `walks` for the boxes that the scene's walks pass through, up to opaque
    /// objects; `free` for these boxes and all that a walking camera reaches from the walks (or from --from)
    /// without passing through opaque objects; `grid` for all boxes over the scene, or over --over; `graph`
    /// for the scene's own cells; or a file (.glb, .gltf, .vscn) of walkable triangles, such as a navigation
    /// mesh, for the boxes above them. By default `grid` with --over, `free` with --from, `walks` for a scene
    /// with cameras, else `stand`. An eye outside all viewcells sees everything.
    #[arg(long, value_name = "PLACES|FILE")]
    pub cells: Option<Placement>,

    /// Size of a viewcell in metres: two sizes on the ground, in the order of the axes, and the height along
    /// the up axis.
    #[arg(long, value_name = "WIDTH,DEPTH,HEIGHT", value_parser = size, default_value = "4,4,2")]
    pub size: [f64; 3],

    /// Box to fill with viewcells; with `free`, a box that viewcells must not leave.
    #[arg(long, value_name = "MINX,MINY,MINZ,MAXX,MAXY,MAXZ", value_parser = corners,
        allow_hyphen_values = true)]
    pub over: Option<[f64; 6]>,

    /// Point where a camera can be, from which `free` starts instead of the walks. May be given several
    /// times.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub from: Vec<[f64; 3]>,

    /// Least and greatest height of a walking camera above the floor below it, in metres, falls and jumps
    /// included. For `free` and files of walkable triangles.
    #[arg(long, value_name = "LOW,HIGH", value_parser = heights, default_value = "1,3",
        allow_hyphen_values = true)]
    pub heights: [f64; 2],

    /// Let the camera fly: `free` then has no height limit.
    #[arg(long, conflicts_with = "heights")]
    pub fly: bool,

    /// Least distance in metres between the camera and opaque objects, for `free` and `walks`.
    #[arg(long, value_name = "METRES", default_value_t = 0.25)]
    pub radius: f64,
}

impl Default for Places {
    /// The places if the command line names none.
    fn default() -> Self {
        Self {
            cells: None,
            size: [4.0, 4.0, 2.0],
            over: None,
            from: Vec::new(),
            heights: [1.0, 3.0],
            fly: false,
            radius: 0.25,
        }
    }
}

/// Method of placing viewcells.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Placement {
    /// Viewcells fill the free space that a camera reaches from the scene's walks, and lie along the walks.
    Free,
    /// Viewcells lie above the floors where one can stand.
    Stand,
    /// Viewcells lie along the scene's walks.
    Walks,
    /// Viewcells fill a box, as a grid.
    Grid,
    /// Viewcells are the scene's own cells.
    Graph,
    /// Viewcells lie above the triangles of a file.
    Above(PathBuf),
}

impl FromStr for Placement {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "free" => Ok(Self::Free),
            "stand" => Ok(Self::Stand),
            "walks" => Ok(Self::Walks),
            "grid" => Ok(Self::Grid),
            "graph" => Ok(Self::Graph),
            file if Path::new(file).extension().is_some() => Ok(Self::Above(file.into())),
            other => Err(format!("`{other}` is none of stand, walks, free, grid and graph, and no file")),
        }
    }
}

/// Reads the size of a viewcell in metres.
fn size(text: &str) -> Result<[f64; 3], String> {
    cells::parse_size(text)
}

/// Reads the coordinates of a point.
fn point(text: &str) -> Result<[f64; 3], String> {
    cells::numbers(text)
}

/// Reads the least and the greatest corner of a box.
fn corners(text: &str) -> Result<[f64; 6], String> {
    let corners: [f64; 6] = cells::numbers(text)?;
    let is_inverted = (0..3).any(|axis| corners[axis] > corners[axis + 3]);
    if is_inverted { Err("a maximum is less than its minimum".to_owned()) } else { Ok(corners) }
}

/// Reads the least and the greatest height of a camera.
fn heights(text: &str) -> Result<[f64; 2], String> {
    let [low, high] = cells::numbers(text)?;
    if low <= high { Ok([low, high]) } else { Err("the greatest height is less than the least".to_owned()) }
}

/// Source of a scene's solid triangles, which bound the free space.
pub enum Solids<'a> {
    /// A scene in memory.
    Scene(&'a Scene),
    /// A level in a file.
    Level(&'a TiledScene<'a>),
}

impl Solids<'_> {
    /// Calls `seek` with a scene of the objects that touch the box from `min` to `max`, or with a scene of
    /// all objects.
    fn seek(
        &self,
        (min, max): (DVec3, DVec3),
        seek: impl FnOnce(&Scene) -> Result<Vec<Viewcell>, GridError>,
    ) -> Result<Vec<Viewcell>, Failure> {
        let found = match self {
            Self::Scene(scene) => seek(scene),
            Self::Level(level) => level.with_scene_around(min, max, seek)?,
        };
        found.map_err(|error| explain(&error).into())
    }
}

/// Adds a note to the scene that viewcells are only placed around a few still cameras, such as those of a
/// glTF file, if the user has not chosen other places.
pub(super) fn note_still_cameras(source: &mut SceneSource, places: &Places) {
    let is_still = !source.walks.is_empty() && source.walks.iter().all(|walk| walk.keys.len() == 1);
    if is_still && places.cells.is_none() && places.over.is_none() && places.from.is_empty() {
        let note =
            "viewcells are around the cameras alone: --cells free adds all that can be reached from there";
        source.notes.push(note.to_owned());
    }
}

/// Makes the viewcells of a scene, and gives up with an error once `stop` returns true. `reading` tells how
/// to read the scene file and a file of walkable triangles. `bounds` contains all objects, relative to the
/// scene's origin; `None` without objects.
///
/// # Errors
///
/// [`Failure`] for no or too many viewcells, a file that cannot be read, or too little memory.
pub fn make(
    places: &Places,
    reading: &Reading,
    source: &SceneSource,
    bounds: Option<Corners>,
    solids: &Solids<'_>,
    stop: fn() -> bool,
) -> Result<Vec<Viewcell>, Failure> {
    let text = |error: GridError| explain(&error);
    let double = |point: Vec3| point.as_dvec3();
    let (low, high) = bounds
        .map_or((DVec3::ZERO, DVec3::ZERO), |(a, b)| (double(a) + source.origin, double(b) + source.origin));
    let size = cells::on_axes(places.size, source.up);
    let over = places.over.map(|[a, b, c, d, e, f]| (DVec3::new(a, b, c), DVec3::new(d, e, f)));
    let placement = match &places.cells {
        Some(placement) => placement.clone(),
        None if over.is_some() => Placement::Grid,
        None if !places.from.is_empty() => Placement::Free,
        None if source.floors.is_empty() => Placement::Walks,
        None => Placement::Stand,
    };
    // The grid is aligned so that the first eye is in the middle of its viewcell. A viewcell that reached
    // down to the ground would see along the ground, under all objects that stand there.
    let mut eyes = source.walks.iter().flat_map(|walk| &walk.keys).map(|key| key.eye);
    let corner = match (&placement, over) {
        (Placement::Grid, Some((min, _))) => min,
        _ => eyes.next().map_or(low, |first| first - size * 0.5),
    };
    let grid = Grid::new(corner, size).map_err(text)?.with_stop(stop);
    let camera = CameraRange {
        radius: places.radius,
        heights: (!places.fly).then_some(places.heights),
        up: double(source.up),
    };
    let along = |eyes: Vec<Vec<DVec3>>| {
        let (min, max) = eyes
            .iter()
            .flatten()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), &eye| (a.min(eye), b.max(eye)));
        let margin = size * 2.0 + places.radius;
        let walks = eyes.iter().map(Vec::as_slice);
        solids.seek((min - margin, max + margin), |scene| grid.along_free(scene, walks, &camera))
    };
    let walks = || {
        let walks = source.walks.iter();
        along(walks.map(|walk| walk.keys.iter().map(|key| key.eye).collect()).collect())
    };
    let found = match placement {
        Placement::Walks => walks()?,
        Placement::Stand => {
            along(source.floors.iter().map(|&floor| eyes_above(floor, places, source.up)).collect())?
        }
        Placement::Free => {
            let (from, mut all): (Vec<DVec3>, _) = if places.from.is_empty() {
                let eyes = source.walks.iter().flat_map(|walk| &walk.keys).map(|key| key.eye);
                (eyes.collect(), walks()?)
            } else {
                (places.from.iter().copied().map(DVec3::from_array).collect(), Vec::new())
            };
            let (min, max) = over.unwrap_or((low, high));
            let margin = size * 2.0 + places.radius + places.heights[0].abs().max(places.heights[1].abs());
            let reached = solids
                .seek((min - margin, max + margin), |scene| grid.free(scene, &from, &camera, min, max))?;
            let known = Viewcells::new(all.iter().cloned());
            let is_new = |cell: &Viewcell| {
                let mut is_within = false;
                known.for_each_touching(cell.min, cell.max, |id| {
                    let other = &known.cells()[id.index()];
                    is_within |= other.min.cmple(cell.min).all() && cell.max.cmple(other.max).all();
                });
                !is_within
            };
            all.extend(reached.into_iter().filter(is_new));
            all
        }
        Placement::Grid => {
            let (min, max) = over.unwrap_or((low, high));
            grid.over(min, max).map_err(text)?
        }
        Placement::Graph => source
            .cells
            .as_ref()
            .ok_or_else(|| "the scene has no cells: take another value of --cells".to_owned())?
            .viewcells
            .cells()
            .to_vec(),
        Placement::Above(file) => {
            let walkable = load_as(&file, reading).map_err(|error| error.to_string())?;
            let triangles = walkable.objects.iter().flat_map(|object| object.triangles.view());
            let triangles: Vec<[DVec3; 3]> =
                triangles.map(|corners| corners.map(|p| double(p) + walkable.origin)).collect();
            grid.above(&triangles, &camera).map_err(text)?
        }
    };
    if found.is_empty() {
        let message = "there are no viewcells: say with --cells or --over where they should be";
        return Err(message.to_owned().into());
    }
    Ok(found)
}

/// Returns a message for a person, with advice if the time was too short.
fn explain(error: &GridError) -> String {
    match error {
        GridError::Stopped => {
            format!("{error}: larger ones (--size), or fewer places (--over, --cells walks), take less")
        }
        _ => error.to_string(),
    }
}

/// Returns the ends of the vertical segment where an eye can be above a floor, given a floor point and the
/// free height above it.
fn eyes_above((floor, free): (DVec3, f64), places: &Places, up: Vec3) -> Vec<DVec3> {
    let highest = free - places.radius;
    STANDING.map(|height| floor + up.as_dvec3() * height.min(highest)).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_places_are_those_without_arguments() {
        #[derive(clap::Parser)]
        struct Only {
            #[command(flatten)]
            places: Places,
        }
        let Only { places } = clap::Parser::parse_from([""]);
        assert_eq!(places, Places::default(), "places without arguments and by default");
    }
}
