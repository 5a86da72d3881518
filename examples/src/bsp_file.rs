//! Levels of Quake, Quake 2 and Half-Life (`.bsp`) as scenes, by the crate qbsp. z is up.
//!
//! The polygons that the level's BSP tree lists in a leaf are an object, since the game draws by leaf as
//! well. Liquids, panes and sky are objects of their own and hide nothing. Models of the level that are not
//! the world, such as doors and lifts, may move or be invisible, so each is visible from everywhere and hides
//! nothing. Textures, lights and the level's own visible sets are not read.
//!
//! qbsp asserts that the sizes in a file agree, and takes memory for counts that it did not check. So the
//! sizes are checked before it reads, and it is given no more of the file than they span. Format: Half-Life's
//! and Quake 2's differ from "Quake Specifications 3.4" in what qbsp calls variable values.

use crate::error::SourceError;
use crate::reading::Reading;
use crate::source::{Bounds, Hint, SceneSource, SourceObject, stem};
use crate::walk;
use glam::{DVec3, Vec3};
use qbsp::data::texture::{BspTexInfo, BspTextureHeader};
use qbsp::data::util::UBspValue;
use qbsp::data::{BspEdge, BspFace, BspLeaf, BspModel, BspPlane, LumpDirectory, LumpEntry};
use qbsp::reader::{BspByteReader, BspParseContext, BspValue};
use qbsp::{BspFormat, BspParseError, read_lump};
use std::collections::BTreeMap;
use std::path::Path;

/// Unit of the games in metres: an inch.
const INCH: f64 = 0.0254;

/// Offset in bytes of the flags of a texture info of Quake 2.
const FLAGS_AT: usize = 32;
/// Flag of Quake 2 for sky.
const SKY: u32 = 0x4;
/// Flags of Quake 2 for liquids that move, for panes of two strengths, and for textures with holes, which
/// later engines and the remastered game added.
const SEE_THROUGH: u32 = 0x8 | 0x10 | 0x20 | 0x0200_0000;
/// Flags of Quake 2 for surfaces that are not drawn, and for those that only guide the map compiler.
const UNDRAWN: u32 = 0x80 | 0x100 | 0x200;

/// List of a level, and what is wrong with it.
type Wrong = (&'static str, String);

/// How a polygon is drawn.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Surface {
    Wall,
    SeeThrough,
    Sky,
}

/// Lists of a level, as far as they say where its polygons are.
struct Level {
    planes: Vec<BspPlane>,
    vertices: Vec<qbsp::glam::Vec3>,
    edges: Vec<BspEdge>,
    /// Edges of the faces in order, by number; negative where the edge is passed backwards.
    face_edges: Vec<i32>,
    faces: Vec<BspFace>,
    leaves: Vec<BspLeaf>,
    /// Numbers of the faces of the leaves.
    leaf_faces: Vec<UBspValue>,
    models: Vec<BspModel>,
    /// How faces are drawn, by their texture info. `None` for a texture info whose faces are not drawn.
    surfaces: Vec<Option<Surface>>,
}

/// Reads a level, passes its objects on, and returns the scene without them.
///
/// # Errors
///
/// Returns [`SourceError::Content`] for a file of another game or version, with sizes or numbers that
/// contradict each other, or without polygons.
pub(crate) fn parse(
    bytes: &[u8],
    path: &Path,
    reading: &Reading,
    each: &mut dyn FnMut(SourceObject),
) -> Result<SceneSource, SourceError> {
    let wrong = |(place, problem): Wrong| SourceError::content(path, place, problem);
    let level = Level::read(bytes).map_err(wrong)?;
    let unit = reading.unit.unwrap_or(INCH);
    let mut bounds = Bounds::default();
    let mut pass = |name: String, surface: Surface, triangles: Vec<[Vec3; 3]>, is_mover: bool| {
        let mut object = SourceObject::new(name, triangles);
        object.opaque = surface == Surface::Wall;
        object.see_through = surface == Surface::SeeThrough;
        object.one_sided = !object.see_through && !reading.two_sided;
        if is_mover {
            object.take(Hint::Mover);
        }
        bounds.add(&object);
        each(object);
    };
    let mut count = 0;
    for (index, leaf_of) in level.leaves_of_models().map_err(wrong)?.into_iter().enumerate() {
        let mut objects: BTreeMap<(usize, Surface), Vec<[Vec3; 3]>> = BTreeMap::new();
        for (face, leaf) in leaf_of {
            let (Some(surface), corners) = level.polygon(face, unit).map_err(wrong)? else { continue };
            let triangles = objects.entry((leaf, surface)).or_default();
            triangles.extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
        }
        for ((leaf, surface), triangles) in objects {
            let kind = ["", " see-through", " sky"][surface as usize];
            let name = if index == 0 { format!("leaf {leaf}{kind}") } else { format!("model {index}{kind}") };
            count += triangles.len();
            pass(name, surface, triangles, index > 0);
        }
    }
    if count == 0 {
        return Err(wrong(("faces", "it has no polygons, so nothing is seen or hidden".into())));
    }
    Ok(SceneSource::new(stem(path), reading.up.unwrap_or(Vec3::Z), walk::made_up_near(bounds.corners())))
}

impl Level {
    /// Reads the lists. The error names the list and what is wrong with it.
    fn read(bytes: &[u8]) -> Result<Self, Wrong> {
        let of = |place| move |error: BspParseError| (place, error.root().to_string());
        let no_context = BspParseContext::default();
        let mut reader = BspByteReader::new(bytes, &no_context);
        let format: BspFormat = reader.read().map_err(|error: BspParseError| {
            let problem =
                "only levels of Quake, Quake 2 and Half-Life are read; for Quake 3, see docs/formats.md";
            ("header", format!("{}: {problem}", error.root()))
        })?;
        let context = &BspParseContext { format };
        let lists = if format.is_quake2() { 19 } else { 15 };
        let directory = bytes.get(reader.pos()..).and_then(|rest| rest.get(..8 * lists));
        let directory = directory.ok_or(("header", "it ends within its header".to_owned()))?;
        let number = |bytes: &[u8; 4]| u32::from_le_bytes(*bytes) as usize;
        let mut end = 0;
        for [from, length] in directory.as_chunks::<4>().0.as_chunks::<2>().0 {
            end = end.max(number(from).saturating_add(number(length)));
        }
        if end > bytes.len() || u32::try_from(end).is_err() {
            return Err(("header", format!("it tells of {end} bytes, and has {}", bytes.len())));
        }
        // What follows the last list is an extension that is not needed.
        let bytes = &bytes[..end.max(reader.pos() + directory.len())];
        let mut reader = BspByteReader::new(bytes, context).with_pos(reader.pos());
        let directory: LumpDirectory = reader.read().map_err(of("header"))?;
        let infos: Vec<BspTexInfo> = list(bytes, directory.tex_info, "texture infos", context)?;
        // qbsp drops the flags that it does not know.
        let flags = directory.tex_info.get(bytes).map_err(of("texture infos"))?;
        let size = BspTexInfo::bsp_struct_size(context).max(1);
        let flags = flags.chunks(size).map(|info| {
            info.get(FLAGS_AT..).and_then(<[u8]>::first_chunk).map_or(0, |flags| u32::from_le_bytes(*flags))
        });
        let textures = match *directory.textures {
            Some(entry) => texture_names(entry.get(bytes).map_err(of("textures"))?, context),
            None => Vec::new(),
        };
        Ok(Self {
            planes: list(bytes, directory.planes, "planes", context)?,
            vertices: list(bytes, directory.vertices, "vertices", context)?,
            edges: list(bytes, directory.edges, "edges", context)?,
            face_edges: list(bytes, directory.surf_edges, "edges of faces", context)?,
            faces: list(bytes, directory.faces, "faces", context)?,
            leaves: list(bytes, directory.leaves, "leaves", context)?,
            leaf_faces: list(bytes, directory.mark_surfaces, "faces of leaves", context)?,
            models: list(bytes, directory.models, "models", context)?,
            surfaces: infos.iter().zip(flags).map(|(info, flags)| surface(info, flags, &textures)).collect(),
        })
    }

    /// Returns the faces of each model, each with the first leaf that lists it. Faces of other models than
    /// the first, and those in no leaf, have leaf 0, which is what is outside of the level.
    fn leaves_of_models(&self) -> Result<Vec<BTreeMap<usize, usize>>, Wrong> {
        // Each list is divided among those that refer to it, so that a forged file costs no more than its
        // size.
        let check = |place, parts: u64, all: usize| {
            let problem = || format!("they refer to {parts} of {all}");
            if parts > all as u64 { Err((place, problem())) } else { Ok(()) }
        };
        check(
            "leaves",
            self.leaves.iter().map(|leaf| u64::from(leaf.face_num.0)).sum(),
            self.leaf_faces.len(),
        )?;
        check("models", self.models.iter().map(|model| u64::from(model.num_faces)).sum(), self.faces.len())?;
        check(
            "faces",
            self.faces.iter().map(|face| u64::from(face.num_edges.0)).sum(),
            self.face_edges.len(),
        )?;
        let mut leaf_of = BTreeMap::new();
        for (index, leaf) in self.leaves.iter().enumerate() {
            let faces = part(&self.leaf_faces, leaf.face_idx.0, leaf.face_num.0);
            for face in faces.ok_or_else(|| ("leaves", format!("leaf {index} has unknown faces")))? {
                leaf_of.entry(face.0 as usize).or_insert(index);
            }
        }
        let faces_of = |(index, model): (usize, &BspModel)| {
            let (first, count) = (model.first_face as usize, model.num_faces as usize);
            let faces = part(&self.faces, model.first_face, model.num_faces);
            faces.ok_or_else(|| ("models", format!("model {index} has unknown faces")))?;
            let leaf = |face: &usize| if index == 0 { leaf_of.get(face).copied() } else { None };
            Ok((first..first + count).map(|face| (face, leaf(&face).unwrap_or(0))).collect())
        };
        self.models.iter().enumerate().map(faces_of).collect()
    }

    /// Returns how a face is drawn, and its corners in metres, counter-clockwise as seen from the front.
    fn polygon(&self, face: usize, unit: f64) -> Result<(Option<Surface>, Vec<Vec3>), Wrong> {
        let unknown = |what: &str| ("faces", format!("face {face} has an unknown {what}"));
        let face = self.faces.get(face).ok_or_else(|| unknown("number"))?;
        let edges =
            part(&self.face_edges, face.first_edge, face.num_edges.0).ok_or_else(|| unknown("edge"))?;
        let corner = |&edge: &i32| {
            let ends = self.edges.get(edge.unsigned_abs() as usize)?;
            let vertex = self.vertices.get(if edge < 0 { ends.b.0 } else { ends.a.0 } as usize)?;
            Some(DVec3::from_array(vertex.to_array().map(f64::from)) * unit)
        };
        let corners: Option<Vec<DVec3>> = edges.iter().map(corner).collect();
        let mut corners = corners.ok_or_else(|| unknown("edge or vertex"))?;
        let plane = self.planes.get(face.plane_idx.0 as usize).ok_or_else(|| unknown("plane"))?;
        let front = DVec3::from_array(plane.normal.to_array().map(f64::from));
        let front = if face.plane_side.0 != 0 { -front } else { front };
        let areas = corners.windows(2).map(|pair| (pair[0] - corners[0]).cross(pair[1] - corners[0]));
        if areas.sum::<DVec3>().dot(front) < 0.0 {
            corners.reverse();
        }
        let surface = self.surfaces.get(face.texture_info_idx.0 as usize);
        let surface = surface.ok_or_else(|| unknown("texture"))?;
        Ok((*surface, corners.into_iter().map(|corner| corner.as_vec3()).collect()))
    }
}

/// Reads a list of a file whose directory was checked.
fn list<T: BspValue>(
    bytes: &[u8],
    entry: LumpEntry,
    name: &'static str,
    context: &BspParseContext,
) -> Result<Vec<T>, Wrong> {
    let size = T::bsp_struct_size(context).max(1);
    if !(entry.len as usize).is_multiple_of(size) {
        return Err((name, format!("{} bytes are no whole number of items of {size}", entry.len)));
    }
    read_lump(bytes, entry, name, context).map_err(|error| (name, error.root().to_string()))
}

/// Returns `count` items from `first` on. `None` if there are fewer.
fn part<T>(items: &[T], first: u32, count: u32) -> Option<&[T]> {
    items.get(first as usize..)?.get(..count as usize)
}

/// Returns the names of the textures, empty for those without one, as far as their list can be read.
fn texture_names(bytes: &[u8], context: &BspParseContext) -> Vec<String> {
    let mut reader = BspByteReader::new(bytes, context);
    let count = reader.read::<u32>().unwrap_or(0);
    let offsets = (0..count).map_while(|_| reader.read::<i32>().ok());
    let offsets: Vec<_> = offsets.map(|offset| usize::try_from(offset).unwrap_or(bytes.len())).collect();
    let header = |at: usize| BspByteReader::new(bytes, context).with_pos(at).read::<BspTextureHeader>();
    offsets.into_iter().map(|at| header(at).map_or(String::new(), |header| header.name.to_string())).collect()
}

/// Returns how faces of a texture are drawn: by `flags` in Quake 2, by the texture's name in the other games.
fn surface(info: &BspTexInfo, flags: u32, textures: &[String]) -> Option<Surface> {
    if let Some(own) = &info.extra_info.0 {
        // Quake 2 names the texture in place.
        let is_cut_out = own.name.as_str().starts_with('{');
        return if flags & UNDRAWN != 0 {
            None
        } else if flags & SKY != 0 {
            Some(Surface::Sky)
        } else if flags & SEE_THROUGH != 0 || is_cut_out {
            Some(Surface::SeeThrough)
        } else {
            Some(Surface::Wall)
        };
    }
    let name = info.texture_idx.0.and_then(|index| textures.get(index as usize)).map_or("", String::as_str);
    // Liquids begin with `*`, in Half-Life also with `!`; textures with holes with `{`. What has no name that
    // can be read may be one of these.
    Some(if name.is_empty() || name.starts_with(['*', '!', '{']) {
        Surface::SeeThrough
    } else if name.to_ascii_lowercase().starts_with("sky") {
        Surface::Sky
    } else {
        Surface::Wall
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    /// Writes a level of a floor of 64 x 64 units whose corners are listed clockwise or counter-clockwise,
    /// with water below it, sky above it and a door, each a square of its own.
    fn level(version: u32, is_clockwise: bool) -> Vec<u8> {
        let is_quake2 = version == 38;
        let int = |numbers: &[i32]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
        let short = |numbers: &[u16]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
        let float = |numbers: &[f32]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
        let name = |text: &str, size: usize| {
            let mut bytes = text.as_bytes().to_vec();
            bytes.resize(size, 0);
            bytes
        };
        let corners = [[0.0, 0.0], [64.0, 0.0], [64.0, 64.0], [0.0, 64.0]];
        let squares = [0.0, -8.0, 128.0, 32.0].map(|z| corners.map(|[x, y]| [x, y, z]));
        let vertices = float(squares.as_flattened().as_flattened());
        // Edge 0 is unused, since it has no backward form.
        let mut edges = short(&[0, 0]);
        let (mut face_edges, mut faces) = (Vec::new(), Vec::new());
        for square in 0..4_i32 {
            let at = |k: i32| (4 * square + k % 4) as u16;
            edges.extend((0..4).flat_map(|k| short(&[at(k), at(k + 1)])));
            let forward = (1..5).map(|k| 4 * square + k);
            let listed: Vec<i32> =
                if is_clockwise { forward.rev().map(|k| -k).collect() } else { forward.collect() };
            face_edges.extend(int(&listed));
            // The sky is seen from below.
            faces.extend(short(&[0, u16::from(square == 2)]));
            faces.extend(int(&[4 * square]));
            faces.extend([short(&[4, square as u16]), vec![0; 4], int(&[-1])].concat());
        }
        let names = ["floor", "*water", "sky1", "door"];
        let infos: Vec<u8> = (0..4)
            .flat_map(|k| {
                let flags = [0, 0x10, 0x4, 0][k];
                let own = [int(&[flags, 0]), name(names[k], 32), int(&[-1])].concat();
                [float(&[0.0; 8]), if is_quake2 { own } else { int(&[k as i32, 0]) }].concat()
            })
            .collect();
        let headers = (0..4).flat_map(|k| [name(names[k], 16), int(&[16, 16, 0, 0, 0, 0])].concat());
        let textures = [int(&[4, 20, 60, 100, 140]), headers.collect()].concat();
        // The solid leaf, and one with the three faces of the world.
        let leaf = |first: u16, count: u16| {
            let after = if is_quake2 { short(&[0, 0]) } else { vec![0; 4] };
            [
                if is_quake2 { int(&[1, 0]) } else { int(&[-2, -1]) },
                short(&[0; 6]),
                short(&[first, count]),
                after,
            ]
            .concat()
        };
        let leaves = [leaf(0, 0), leaf(0, 3)].concat();
        let model = |first: i32, count: i32| {
            let nodes = if is_quake2 { int(&[0]) } else { int(&[0; 5]) };
            [float(&[0.0; 9]), nodes, int(&[first, count])].concat()
        };
        let models = [model(0, 3), model(3, 1)].concat();
        let planes = [float(&[0.0, 0.0, 1.0, 0.0]), int(&[2])].concat();
        let leaf_faces = short(&[0, 1, 2]);
        let no = Vec::new;
        let lists = if is_quake2 {
            vec![
                no(),
                planes,
                vertices,
                no(),
                no(),
                infos,
                faces,
                no(),
                leaves,
                leaf_faces,
                no(),
                edges,
                face_edges,
                no(),
                no(),
                no(),
                no(),
                no(),
                models,
            ]
        } else {
            vec![
                no(),
                planes,
                textures,
                vertices,
                no(),
                no(),
                infos,
                faces,
                no(),
                no(),
                leaves,
                leaf_faces,
                edges,
                face_edges,
                models,
            ]
        };
        let mut order: Vec<usize> = (0..lists.len()).collect();
        if is_quake2 {
            // Models are the fourteenth list, and stand last in the file.
            order.swap(13, 18);
        }
        let mut file = if is_quake2 { b"IBSP".to_vec() } else { no() };
        file.extend(version.to_le_bytes());
        let mut at = file.len() + 8 * lists.len();
        let mut entries = vec![[0; 2]; lists.len()];
        for (list, &entry) in lists.iter().zip(&order) {
            entries[entry] = [at as i32, list.len() as i32];
            at += list.len();
        }
        file.extend(int(entries.as_flattened()));
        file.extend(lists.concat());
        file
    }

    fn read(bytes: &[u8], reading: &Reading) -> Result<(SceneSource, Vec<SourceObject>), SourceError> {
        let mut objects = Vec::new();
        let scene = parse(bytes, Path::new("e1m1.bsp"), reading, &mut |object| objects.push(object))?;
        Ok((scene, objects))
    }

    #[test]
    fn levels_of_three_games_have_the_same_objects() {
        for (version, is_clockwise) in [(29, true), (30, true), (38, true), (29, false), (38, false)] {
            let case = format!("version {version}, clockwise: {is_clockwise}");
            let (scene, objects) = read(&level(version, is_clockwise), &Reading::default()).unwrap();
            assert_eq!((scene.name.as_str(), scene.up), ("e1m1", Vec3::Z), "name and up axis, {case}");
            let of = |object: &SourceObject| {
                let hides = (object.opaque, object.see_through, object.one_sided, object.never_cull);
                (object.name.to_string(), object.triangles.len(), hides)
            };
            let expected = [
                ("leaf 1".into(), 2, (true, false, true, false)),
                ("leaf 1 see-through".into(), 2, (false, true, false, false)),
                ("leaf 1 sky".into(), 2, (false, false, true, false)),
                ("model 1".into(), 2, (false, false, true, true)),
            ];
            assert_eq!(objects.iter().map(of).collect::<Vec<_>>(), expected, "objects, {case}");
            for (object, up) in objects.iter().zip([1.0, 1.0, -1.0, 1.0]) {
                for [a, b, c] in object.triangles.view() {
                    let normal = (b - a).cross(c - a).normalize();
                    assert!((normal.z - up).abs() < 1e-6, "{}: front towards {normal}, {case}", object.name);
                }
            }
            let (low, high) = objects[0].bounds().unwrap();
            assert_eq!((low, high), (Vec3::ZERO, Vec3::new(1.6256, 1.6256, 0.0)), "64 inches, {case}");
        }
        let metres = Reading { unit: Some(2.0), two_sided: true, ..Reading::default() };
        let (_, objects) = read(&level(29, true), &metres).unwrap();
        assert_eq!(objects[0].bounds().unwrap().1.x, 128.0, "units of two metres");
        assert!(!objects[0].one_sided, "drawn from both sides, as told");
    }

    #[test]
    fn textures_with_holes_hide_nothing() {
        let mut level = level(38, true);
        let infos = u32::from_le_bytes(*level[8 + 8 * 5..].first_chunk().unwrap()) as usize;
        level[infos + 32 + 3] = 0x02; // the flag 0x0200_0000 of the floor
        let (_, objects) = read(&level, &Reading::default()).unwrap();
        let kinds: Vec<_> = objects.iter().map(|object| (object.name.to_string(), object.opaque)).collect();
        // The floor is in one object with the water.
        let expected = [("leaf 1 see-through", false), ("leaf 1 sky", false), ("model 1", false)]
            .map(|(a, b)| (a.into(), b));
        assert_eq!(kinds, expected, "objects and whether they hide");
        assert_eq!(objects[0].triangles.len(), 4, "triangles of the floor and the water");
    }

    #[test]
    fn what_is_wrong_is_told_with_its_list() {
        let quake3 = [&b"IBSP"[..], &46_u32.to_le_bytes(), &[0; 200]].concat();
        let mut odd = level(29, true);
        odd[4 + 8 * 3 + 4] += 1; // the size of the vertices
        let mut faces = level(29, true);
        let models = u32::from_le_bytes(*faces[4 + 8 * 14..].first_chunk().unwrap()) as usize;
        faces[models + 60] = 200; // the number of faces of the first model
        for (bytes, part) in [
            (&b"xyz"[..], "header"),
            (&quake3, "docs/formats.md"),
            (&level(29, true)[..60], "ends within its header"),
            (&level(38, true)[..400], "it tells of"),
            (&odd, "vertices: 193 bytes"),
            (&faces, "models: they refer to 201 of 4"),
        ] {
            let error = read(bytes, &Reading::default()).unwrap_err().to_string();
            assert!(error.contains(part), "{part}: {error}");
        }
    }

    #[test]
    fn damaged_levels_are_refused_or_read_without_a_panic() {
        for version in [29, 30, 38] {
            let whole = level(version, true);
            for end in 0..whole.len() {
                assert!(read(&whole[..end], &Reading::default()).is_err(), "version {version} cut at {end}");
            }
            let mut refused = 0;
            for at in 0..whole.len() {
                for byte in [0, 1, 0x7f, 0x80, 0xff, whole[at] ^ 0x10] {
                    let mut damaged = whole.clone();
                    damaged[at] = byte;
                    refused += usize::from(read(&damaged, &Reading::default()).is_err());
                }
            }
            let random = &mut Random(1);
            for _ in 0..20_000 {
                let mut damaged = whole.clone();
                for _ in 0..4 {
                    let at = random.below(damaged.len());
                    damaged[at] = random.below(256) as u8;
                }
                refused += usize::from(read(&damaged, &Reading::default()).is_err());
            }
            assert!(refused > 1000, "version {version}: {refused} damaged levels refused");
        }
    }
}
