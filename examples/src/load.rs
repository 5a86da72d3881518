//! Scene files, loaded by extension, with the JSON description that lies beside a VSCN file.
//!
//! A VSCN file holds only triangles. The JSON of the same stem gives names, the up axis, which objects are
//! glass or doors, and the camera walks. Without the JSON the scene still loads, with z up and walks derived
//! from its bounds.

use crate::description::Description;
use crate::error::SourceError;
use crate::recipes::{built_in, known_recipes};
use crate::source::{SceneSource, SourceObject};
use crate::{gltf_file, vscn, walk};
use glam::{DQuat, DVec3, Vec3};
use std::path::Path;

/// Makes the scene that a user names: a recipe with or without sizes (`office:7,24`), the path of a scene
/// file, or `cars5:FILE`, which is [`cars5`] of that file.
///
/// A name without an extension counts as a recipe even if there is a file of that name.
///
/// # Errors
///
/// Returns the errors of [`built_in`], [`load()`] or [`cars5`].
pub fn open(name: &str) -> Result<SceneSource, SourceError> {
    let before_sizes = |text: &str| text.split(':').next().unwrap_or_default().to_owned();
    let is_recipe = |known: String| before_sizes(&known) == before_sizes(name);
    if let Some(car) = name.strip_prefix("cars5:") {
        cars5(Path::new(car))
    } else if known_recipes().any(is_recipe) || Path::new(name).extension().is_none() {
        built_in(name)
    } else {
        load(Path::new(name))
    }
}

/// Reads a scene from a `.vscn` (with its `.json` if that exists), `.gltf` or `.glb` file. The case of the
/// extension does not matter.
///
/// # Errors
///
/// Returns [`SourceError::UnknownFormat`] for any other extension, [`SourceError::Io`] when a file cannot be
/// read, and [`SourceError::Content`] when its content is invalid or the JSON's counts differ from the
/// file's.
pub fn load(path: &Path) -> Result<SceneSource, SourceError> {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("vscn") => load_vscn(path),
        Some("gltf" | "glb") => gltf_file::parse(&read(path)?, path),
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
/// its content is invalid or the JSON has no placements.
pub fn cars5(path: &Path) -> Result<SceneSource, SourceError> {
    let description = Description::load(&path.with_extension("json"))?;
    if description.cars5_placements.is_empty() {
        return Err(SourceError::content(
            &path.with_extension("json"),
            "cars5_placements_x_z_yawdeg",
            "the car has no placements",
        ));
    }
    let car = assemble(path, &description)?;
    let mut objects = Vec::new();
    for (number, [x, z, yaw]) in description.cars5_placements.iter().enumerate() {
        let turn = DQuat::from_rotation_y(yaw.to_radians());
        let place = |p: Vec3| (turn * p.as_dvec3() + DVec3::new(*x, 0.0, *z)).as_vec3();
        objects.extend(car.objects.iter().map(|part| SourceObject {
            name: format!("car{number}/{}", part.name),
            triangles: part.triangles.iter().map(|t| t.map(place)).collect(),
            ..*part
        }));
    }
    Ok(SceneSource { name: format!("{}5", car.name), objects, ..car })
}

/// Reads all bytes of a file. The error of the file system carries the path.
fn read(path: &Path) -> Result<Vec<u8>, SourceError> {
    std::fs::read(path).map_err(|cause| SourceError::io(path, cause))
}

/// Loads a VSCN file with the JSON description beside it. A missing description is no error.
fn load_vscn(path: &Path) -> Result<SceneSource, SourceError> {
    let beside = path.with_extension("json");
    // Only a missing file counts as no description; a file that exists and cannot be read is an error.
    let description = match Description::load(&beside) {
        Err(SourceError::Io { cause, .. }) if cause.kind() == std::io::ErrorKind::NotFound => {
            Description::default()
        }
        other => other?,
    };
    assemble(path, &description)
}

/// Makes the scene of a VSCN file and a description. Absent facts get defaults: z up, and a near plane and
/// walks derived from the bounds. Returns an error when the file is invalid or its counts differ from the
/// description's.
fn assemble(path: &Path, description: &Description) -> Result<SceneSource, SourceError> {
    let triangles = vscn::parse(&read(path)?, path)?;
    check_counts(path, description, &triangles)?;
    let objects = triangles
        .into_iter()
        .enumerate()
        .map(|(index, triangles)| object(description, index, triangles))
        .collect();
    let mut scene = SceneSource {
        name: description.name.clone().unwrap_or_else(|| crate::source::stem(path)),
        up: description.up.unwrap_or(Vec3::Z),
        near: 0.0,
        objects,
        walks: description.walks.clone(),
        cells: None,
    };
    let bounds = scene.bounds();
    scene.near = description.near.unwrap_or(walk::made_up_near(bounds));
    if scene.walks.is_empty() {
        scene.walks = walk::made_up(bounds, scene.up);
    }
    Ok(scene)
}

/// Returns an error when the description's counts differ from the scene file's. Such a description belongs to
/// another file, and its names and transparency would be assigned to the wrong objects.
fn check_counts(
    path: &Path,
    description: &Description,
    triangles: &[Vec<[Vec3; 3]>],
) -> Result<(), SourceError> {
    let counts = [
        ("objects", description.objects, triangles.len()),
        ("triangles", description.triangles, triangles.iter().map(Vec::len).sum()),
        (
            "object_names",
            (!description.object_names.is_empty()).then_some(description.object_names.len() as u64),
            triangles.len(),
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
    SourceObject { opaque: !glass && !billboard, door, ..SourceObject::new(name, triangles) }
}
