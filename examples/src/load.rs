//! Scene files, loaded by extension, with the JSON description that lies beside a VSCN file.
//!
//! A VSCN file holds only triangles. The JSON file with the same stem gives names, the up axis, which objects
//! are glass or doors, and the camera walks. Without the JSON file the scene still loads, with z up and
//! without walks.

#[cfg(feature = "maps")]
use crate::bsp_file;
use crate::description::Description;
use crate::error::SourceError;
use crate::gltf_file::{MOST_OBJECTS, MOST_TRIANGLES};
use crate::ordinary_file;
use crate::pieces::divide;
use crate::reading::Reading;
use crate::recipes::{built_in_by_object, known_recipes};
use crate::source::{Bounds, SceneSource, SourceObject, collected};
use crate::{gltf_file, vscn, walk};
use glam::{DQuat, DVec3, Vec3};
use std::io::BufReader;
use std::path::Path;

/// Makes the scene that a user names: a recipe with or without sizes (`office:7,24`), the path of a scene
/// file, or `cars5:FILE` for [`cars5`] with that file.
///
/// A name without an extension counts as a recipe even if there is a file of that name.
///
/// # Errors
///
/// Returns the errors of [`built_in`](crate::built_in), [`load()`] or [`cars5`].
pub fn open(name: &str) -> Result<SceneSource, SourceError> {
    open_as(name, &Reading::default())
}

/// Makes the scene that a user names, like [`open`]. `reading` sets the unit and the up axis of a scene file,
/// and the pieces that objects are divided into.
///
/// # Errors
///
/// Returns the errors of [`open`].
pub fn open_as(name: &str, reading: &Reading) -> Result<SceneSource, SourceError> {
    match file_of(name) {
        Some(path) if reading.pieces.is_none() => load_as(path, reading),
        _ => collected(|each| open_by_object(name, reading, &mut |_, object| each(object))),
    }
}

/// Returns whether a scene that a user names is no file, so that no [`Reading`] applies to it.
pub fn is_made(name: &str) -> bool {
    file_of(name).is_none()
}

/// Returns the path of the scene file that a user names. `None` for a recipe, and for `cars5:FILE`.
fn file_of(name: &str) -> Option<&Path> {
    let before_sizes = |text: &str| text.split(':').next().unwrap_or_default().to_owned();
    let is_recipe = |known: String| before_sizes(&known) == before_sizes(name);
    let is_made = name.starts_with("cars5:") || known_recipes().any(is_recipe);
    (!is_made && Path::new(name).extension().is_some()).then(|| Path::new(name))
}

/// Returns whether a file is glTF, by its extension.
fn is_gltf(path: &Path) -> bool {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    matches!(extension.as_deref(), Some("gltf" | "glb"))
}

/// Makes the same scene as [`open_as`], object by object. Passes each object with the scene's origin to
/// `each` as soon as it is made or read, and returns the scene without objects. For recipes and VSCN files,
/// one object at a time is in memory; glTF files are read as a whole before their first object is passed on.
///
/// # Errors
///
/// Returns the errors of [`open`]. Some objects may have been passed on before.
pub fn open_by_object(
    name: &str,
    reading: &Reading,
    each: &mut dyn FnMut(DVec3, SourceObject),
) -> Result<SceneSource, SourceError> {
    let mut divided = |origin: DVec3, object: SourceObject| match reading.pieces {
        Some(most) => divide(object, most, &mut |piece| each(origin, piece)),
        None => each(origin, object),
    };
    let each: &mut dyn FnMut(DVec3, SourceObject) = &mut divided;
    let mut at_zero = |object| each(DVec3::ZERO, object);
    if let Some(car) = name.strip_prefix("cars5:") {
        cars5_by_object(Path::new(car), &mut at_zero)
    } else if let Some(path) = file_of(name) {
        load_by_object(path, reading, each)
    } else {
        built_in_by_object(name, &mut at_zero)
    }
}

/// Reads a scene from a `.vscn` (with its `.json` if that exists), `.gltf` or `.glb` file, and with the
/// feature `maps` from a `.bsp` file. The case of the extension does not matter.
///
/// # Errors
///
/// Returns [`SourceError::UnknownFormat`] for any other extension, [`SourceError::Io`] when a file cannot be
/// read, and [`SourceError::Content`] when its content is invalid or the JSON's counts differ from the
/// file's.
pub fn load(path: &Path) -> Result<SceneSource, SourceError> {
    load_as(path, &Reading::default())
}

/// Reads a scene from a file, like [`load`]. `reading` sets the unit and the up axis.
///
/// # Errors
///
/// Returns the errors of [`load`].
pub fn load_as(path: &Path, reading: &Reading) -> Result<SceneSource, SourceError> {
    if is_gltf(path) {
        return load_gltf(path, reading);
    }
    collected(|each| load_by_object(path, reading, &mut |_, object| each(object)))
}

fn load_gltf(path: &Path, reading: &Reading) -> Result<SceneSource, SourceError> {
    let bytes = ordinary_file::read(path).map_err(|cause| SourceError::io(path, cause))?;
    let mut scene = gltf_file::parse_as(&bytes, path, reading)?;
    if scene.triangle_count() == 0 {
        let notes = scene.notes.join("; ");
        let problem = format!("it has no triangles, so nothing is seen or hidden ({notes})");
        return Err(SourceError::content(path, "document", problem.replace(" ()", "")));
    }
    scene.objects.iter_mut().for_each(|object| object.one_sided &= !reading.two_sided);
    Ok(scene)
}

fn load_by_object(
    path: &Path,
    reading: &Reading,
    each: &mut dyn FnMut(DVec3, SourceObject),
) -> Result<SceneSource, SourceError> {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("vscn") => load_vscn(path, reading, &mut |object| each(DVec3::ZERO, object)),
        _ if is_gltf(path) => {
            let mut scene = load_gltf(path, reading)?;
            for object in std::mem::take(&mut scene.objects) {
                each(scene.origin, object);
            }
            Ok(scene)
        }
        #[cfg(feature = "maps")]
        Some("bsp") => {
            let bytes = ordinary_file::read(path).map_err(|cause| SourceError::io(path, cause))?;
            bsp_file::parse(&bytes, path, reading, &mut |object| each(DVec3::ZERO, object))
        }
        _ => Err(SourceError::UnknownFormat { file: path.to_path_buf() }),
    }
}

/// Reads the car of a VSCN file and its JSON, and makes a scene of one copy of the car per placement in the
/// JSON. The walks are those of the JSON.
///
/// A copy is rotated about y by the placement's yaw and then translated by (x, 0, z). The names of its
/// objects are prefixed with the index of the copy.
///
/// # Errors
///
/// Returns [`SourceError::Io`] when one of the two files cannot be read, and [`SourceError::Content`] when
/// its content is invalid, the JSON has no placements, or all copies together have more than 2^25 triangles
/// or 2^22 objects.
pub fn cars5(path: &Path) -> Result<SceneSource, SourceError> {
    collected(|each| cars5_by_object(path, each))
}

fn cars5_by_object(path: &Path, each: &mut dyn FnMut(SourceObject)) -> Result<SceneSource, SourceError> {
    let description = Description::load(&path.with_extension("json"))?;
    if description.cars5_placements.is_empty() {
        return Err(SourceError::content(
            &path.with_extension("json"),
            "cars5_placements_x_z_yawdeg",
            "the car has no placements",
        ));
    }
    let car = collected(|each| assemble(path, &description, each))?;
    let copies = description.cars5_placements.len();
    let is_over = |each: usize, most| each.saturating_mul(copies) > most;
    if is_over(car.triangle_count(), MOST_TRIANGLES) || is_over(car.objects.len(), MOST_OBJECTS) {
        return Err(SourceError::content(
            &path.with_extension("json"),
            "cars5_placements_x_z_yawdeg",
            format!("with it, the scene has more than {MOST_OBJECTS} objects, or {MOST_TRIANGLES} triangles"),
        ));
    }
    for (number, [x, z, yaw]) in description.cars5_placements.iter().enumerate() {
        let turn = DQuat::from_rotation_y(yaw.to_radians());
        let place = |p: Vec3| (turn * p.as_dvec3() + DVec3::new(*x, 0.0, *z)).as_vec3();
        let copies = car.objects.iter().map(|part| SourceObject {
            name: format!("car{number}/{}", part.name).into(),
            triangles: part.triangles.iter().map(|t| t.map(place)).collect::<Vec<_>>().into(),
            ..part.clone()
        });
        copies.for_each(&mut *each);
    }
    Ok(SceneSource { name: format!("{}5", car.name), objects: Vec::new(), ..car })
}

/// Loads a VSCN file with the JSON description beside it. A missing description is no error.
fn load_vscn(
    path: &Path,
    reading: &Reading,
    each: &mut dyn FnMut(SourceObject),
) -> Result<SceneSource, SourceError> {
    let beside = path.with_extension("json");
    // Only a missing file counts as no description; a file that exists and cannot be read is an error.
    let description = match Description::load(&beside) {
        Err(SourceError::Io { cause, .. }) if cause.kind() == std::io::ErrorKind::NotFound => {
            Description::default()
        }
        other => other?,
    };
    let unit = reading.metres();
    let scaled = |p: Vec3| (p.as_dvec3() * unit).as_vec3();
    let mut scene = assemble(path, &description, &mut |mut object| {
        if unit != 1.0 {
            object.edit_triangles(|triangles| {
                triangles.as_flattened_mut().iter_mut().for_each(|p| *p = scaled(*p));
            });
        }
        each(object);
    })?;
    scene.up = reading.up.unwrap_or(scene.up);
    scene.near *= unit as f32;
    scene.walks.iter_mut().for_each(|walk| walk.map(|point| point * unit));
    Ok(scene)
}

/// Makes the scene of a VSCN file and a description, and passes its objects on. Absent keys get defaults: z
/// up, a near plane derived from the bounds, and no walks. Returns an error when the file is invalid or its
/// counts differ from the description's.
fn assemble(
    path: &Path,
    description: &Description,
    each: &mut dyn FnMut(SourceObject),
) -> Result<SceneSource, SourceError> {
    let failed = |cause| SourceError::io(path, cause);
    let file = ordinary_file::open(path).map_err(failed)?;
    let size = file.metadata().map_err(failed)?.len();
    let (mut bounds, mut index, mut triangle_count) = (Bounds::default(), 0, 0);
    let objects = vscn::read(BufReader::new(file), size, path, &mut |triangles| {
        triangle_count += triangles.len();
        let object = object(description, index, triangles);
        index += 1;
        bounds.add(&object);
        each(object);
    })?;
    check_counts(path, description, objects, triangle_count)?;
    let bounds = bounds.corners();
    let name = description.name.clone().unwrap_or_else(|| crate::source::stem(path));
    let near = description.near.unwrap_or(walk::made_up_near(bounds));
    let mut scene = SceneSource::new(name, description.up.unwrap_or(Vec3::Z), near);
    scene.walks = description.walks.clone();
    Ok(scene)
}

/// Returns an error when the description's counts differ from the scene file's. Such a description belongs to
/// another file, and its names and transparency would be assigned to the wrong objects.
fn check_counts(
    path: &Path,
    description: &Description,
    objects: usize,
    triangles: usize,
) -> Result<(), SourceError> {
    let counts = [
        ("objects", description.objects, objects),
        ("triangles", description.triangles, triangles),
        (
            "object_names",
            (!description.object_names.is_empty()).then_some(description.object_names.len() as u64),
            objects,
        ),
    ];
    for (key, claimed, found) in counts {
        if let Some(claimed) = claimed
            && claimed != found as u64
        {
            return Err(SourceError::content(
                &path.with_extension("json"),
                key,
                format!("it says {claimed}, the scene file has {found}"),
            ));
        }
    }
    Ok(())
}

/// Makes the object of the given index. It is opaque unless the description counts it as glass or a
/// billboard.
fn object(description: &Description, index: usize, triangles: Vec<[Vec3; 3]>) -> SourceObject {
    let name = description.object_names.get(index).cloned().unwrap_or_else(|| format!("object {index}"));
    let glass = description.first_transparent_object.is_some_and(|first| index as u64 >= first);
    let billboard =
        description.alpha_tested_name_prefixes.iter().any(|prefix| name.starts_with(prefix.as_str()));
    let door = description.door_name_contains.as_ref().is_some_and(|part| name.contains(part.as_str()));
    let see_through = glass || billboard;
    SourceObject { opaque: !see_through, see_through, door, ..SourceObject::new(name, triangles) }
}
