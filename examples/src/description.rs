//! JSON descriptions of scene files: up axis, near plane, object names, transparency, camera walks and
//! reference counts.
//!
//! Every key is optional, since scenes need different ones. A key of the wrong type is an error that names
//! the key by its path, such as `cameras[1].keys[3].eye`. Unknown keys are ignored.

use crate::error::SourceError;
use crate::json;
use crate::ordinary_file;
use crate::walk::{CameraKey, Walk};
use glam::{DVec3, Vec3};
use serde_json::Value;
use std::path::Path;

/// Contents of the JSON file that lies beside a scene file. An absent or null key is `None` or an empty list.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Description {
    /// Name of the scene, or `None` to use the file's name.
    pub name: Option<String>,
    /// Unit vector of the coordinate axis that points up, or `None` to use z.
    pub up: Option<Vec3>,
    /// Distance of the near plane in scene units, positive and finite, chosen for the walks. `None` to
    /// derive it from the scene's bounds.
    pub near: Option<f32>,
    /// Number of objects that the scene file must have. `None` if any number will do.
    pub objects: Option<u64>,
    /// Number of triangles, over all objects, that the scene file must have. `None` if any number will do.
    pub triangles: Option<u64>,
    /// Minimum corner of the scene's bounds in scene units, or `None` if not stated.
    pub bounds_min: Option<[f64; 3]>,
    /// Maximum corner of the scene's bounds in scene units, or `None` if not stated.
    pub bounds_max: Option<[f64; 3]>,
    /// Names of the objects, by object index. Empty when the objects have no names.
    pub object_names: Vec<String>,
    /// Index of the first transparent object; all objects from this index on are glass. `None` if no object
    /// is glass.
    pub first_transparent_object: Option<u64>,
    /// Name prefixes of cut-out billboards: an object whose name begins with one of these prefixes is
    /// alpha-tested.
    pub alpha_tested_name_prefixes: Vec<String>,
    /// Text that the name of every door contains, and of no other object. `None` if there are no doors.
    pub door_name_contains: Option<String>,
    /// Placements of the copies of a car: x and z in scene units, then the yaw about y in degrees.
    pub cars5_placements: Vec<[f64; 3]>,
    /// Camera walks, each with at least one key; empty if not stated.
    pub walks: Vec<Walk>,
    /// Reference counts, one entry per walk in the order of the file; empty if not stated.
    pub reference: Vec<ReferenceCounts>,
}

/// Reference counts of one walk, one number per key of the walk. The counts are taken from a 640 by 360 item
/// buffer with every object drawn opaque and all doors closed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReferenceCounts {
    /// Name of the walk that the counts belong to.
    pub walk: String,
    /// Number of objects with a triangle at least partly inside the frustum, per key.
    pub objects_in_frustum: Vec<u64>,
    /// Number of objects with at least one visible pixel, per key.
    pub objects_visible: Vec<u64>,
    /// Number of triangles with at least one visible pixel, per key.
    pub triangles_visible: Vec<u64>,
}

impl Description {
    /// Reads a description from a JSON file.
    ///
    /// # Errors
    ///
    /// Returns [`SourceError::Io`] when the file cannot be read or is no ordinary file, such as a pipe,
    /// and the errors of [`parse`](Self::parse).
    pub fn load(path: &Path) -> Result<Self, SourceError> {
        let bytes = ordinary_file::read(path).map_err(|cause| SourceError::io(path, cause))?;
        Self::parse(&bytes, path)
    }

    /// Reads a description from the bytes of a JSON file. `path` appears in error messages only.
    ///
    /// # Errors
    ///
    /// Returns [`SourceError::Content`] with the path of the key when the text is not JSON, the root is not
    /// an object, a key is given twice, or a known key has a wrong type or an unusable value.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, SourceError> {
        let root = json::parse(bytes).map_err(|error| {
            let place = format!("line {}, column {}", error.line(), error.column());
            SourceError::content(path, place, error.to_string())
        })?;
        let root = Item { value: &root, place: String::new(), path };
        if !root.value.is_object() {
            return Err(root.wrong("an object"));
        }
        Self::read(&root)
    }

    /// Reads all known keys of the root object, and returns an error for the first value of a wrong type.
    fn read(root: &Item<'_>) -> Result<Self, SourceError> {
        Ok(Self {
            name: root.optional("name", Item::text)?,
            up: root.optional("up_axis", up_axis)?,
            near: root.optional("near", near)?,
            objects: root.optional("objects", Item::count)?,
            triangles: root.optional("triangles", Item::count)?,
            bounds_min: root.optional("bbox_min", Item::numbers)?,
            bounds_max: root.optional("bbox_max", Item::numbers)?,
            object_names: root.list("object_names", Item::text)?,
            first_transparent_object: root.optional("first_transparent_object", Item::count)?,
            alpha_tested_name_prefixes: root.list("alpha_tested_name_prefixes", Item::text)?,
            door_name_contains: root.optional("door_name_contains", Item::text)?,
            cars5_placements: root.list("cars5_placements_x_z_yawdeg", Item::numbers)?,
            walks: root.list("cameras", walk)?,
            reference: root.list("reference_640x360", reference)?,
        })
    }
}

/// Reads an up axis as a unit vector from `"x"`, `"y"` or `"z"`; any other value is an error.
fn up_axis(item: &Item<'_>) -> Result<Vec3, SourceError> {
    match item.text()?.as_str() {
        "x" => Ok(Vec3::X),
        "y" => Ok(Vec3::Y),
        "z" => Ok(Vec3::Z),
        _ => Err(item.wrong("one of the axes \"x\", \"y\", \"z\"")),
    }
}

/// Reads a near-plane distance in scene units. Returns an error unless it is positive and finite as an f32.
fn near(item: &Item<'_>) -> Result<f32, SourceError> {
    let near = item.number()? as f32;
    if near > 0.0 && near.is_finite() { Ok(near) } else { Err(item.wrong("a positive distance")) }
}

/// Reads a camera walk. Returns an error unless the field of view lies strictly between 0 and 180 degrees,
/// the up direction is not zero, and there is at least one key.
fn walk(item: &Item<'_>) -> Result<Walk, SourceError> {
    let fov = item.required("fov_y_deg")?;
    let fov_y_degrees = fov.number()? as f32;
    if !(fov_y_degrees > 0.0 && fov_y_degrees < 180.0) {
        return Err(fov.wrong("an angle between 0 and 180 degrees"));
    }
    let up = item.required("up")?;
    let direction = DVec3::from_array(up.numbers()?)
        .try_normalize()
        .ok_or_else(|| up.wrong("a direction that is not zero"))?;
    let keys = item.required("keys")?;
    let keys = keys.each(key)?;
    if keys.is_empty() {
        return Err(item.required("keys")?.wrong("at least one key"));
    }
    Ok(Walk {
        name: item.optional("name", Item::text)?.unwrap_or_default(),
        fov_y_degrees,
        up: direction.as_vec3(),
        keys,
    })
}

/// Reads a camera key, eye and target in scene units. An error if both are equal.
fn key(item: &Item<'_>) -> Result<CameraKey, SourceError> {
    let eye = DVec3::from_array(item.required("eye")?.numbers()?);
    let target = DVec3::from_array(item.required("target")?.numbers()?);
    if eye == target {
        return Err(item.wrong("an eye and a target that differ"));
    }
    Ok(CameraKey { eye, target })
}

/// Reads the reference counts of one walk. Lists of counts that are absent are empty; a missing walk name
/// (`path`) is an error.
fn reference(item: &Item<'_>) -> Result<ReferenceCounts, SourceError> {
    Ok(ReferenceCounts {
        walk: item.required("path")?.text()?,
        objects_in_frustum: item.list("per_key_in_frustum_objs", Item::count)?,
        objects_visible: item.list("per_key_visible_objs", Item::count)?,
        triangles_visible: item.list("per_key_visible_tris", Item::count)?,
    })
}

/// JSON value with its key path in the file, for error messages. `place` is empty for the root.
struct Item<'a> {
    value: &'a Value,
    place: String,
    path: &'a Path,
}

impl<'a> Item<'a> {
    /// Makes the error that `expected` was expected here, with the value found and its key path.
    fn wrong(&self, expected: &str) -> SourceError {
        let found = match self.value {
            Value::Null => "null".to_owned(),
            Value::Bool(value) => value.to_string(),
            Value::Number(value) => value.to_string(),
            Value::String(_) => "a string".to_owned(),
            Value::Array(items) => format!("a list of {}", items.len()),
            Value::Object(_) => "an object".to_owned(),
        };
        let place = if self.place.is_empty() { "top level" } else { &self.place };
        SourceError::content(self.path, place, format!("expected {expected}, found {found}"))
    }

    /// Returns the value under a key of this object. `None` when the key is absent, its value is null, or
    /// this value is not an object.
    fn member(&self, key: &str) -> Option<Item<'a>> {
        let value = self.value.get(key).filter(|value| !value.is_null())?;
        let place = if self.place.is_empty() { key.to_owned() } else { format!("{}.{key}", self.place) };
        Some(Item { value, place, path: self.path })
    }

    /// Returns the value under a key, or an error when the key is absent or null.
    fn required(&self, key: &str) -> Result<Item<'a>, SourceError> {
        self.member(key).ok_or_else(|| self.wrong(&format!("an object with the key `{key}`")))
    }

    /// Reads the value under a key with `read`, and passes the error of `read` on. `Ok(None)` when the key is
    /// absent or null.
    fn optional<T>(
        &self,
        key: &str,
        read: impl Fn(&Item<'a>) -> Result<T, SourceError>,
    ) -> Result<Option<T>, SourceError> {
        self.member(key).map(|item| read(&item)).transpose()
    }

    /// Reads each element of the list under a key with `read`. An absent or null key gives an empty list; the
    /// first error of an element is returned.
    fn list<T>(
        &self,
        key: &str,
        read: impl Fn(&Item<'a>) -> Result<T, SourceError>,
    ) -> Result<Vec<T>, SourceError> {
        self.member(key).map_or_else(|| Ok(Vec::new()), |item| item.each(read))
    }

    /// Reads each element of this list with `read`. Returns the first error of an element, or an error if
    /// this value is not a list.
    fn each<T>(&self, read: impl Fn(&Item<'a>) -> Result<T, SourceError>) -> Result<Vec<T>, SourceError> {
        let items = self.value.as_array().ok_or_else(|| self.wrong("a list"))?;
        let read_one = |(index, value)| {
            read(&Item { value, place: format!("{}[{index}]", self.place), path: self.path })
        };
        items.iter().enumerate().map(read_one).collect()
    }

    /// Returns the value as text, or an error that names its key path if it is not a JSON string.
    fn text(&self) -> Result<String, SourceError> {
        self.value.as_str().map(str::to_owned).ok_or_else(|| self.wrong("a string"))
    }

    /// Returns the value as a whole number of 0 or more, or an error that names its key path.
    fn count(&self) -> Result<u64, SourceError> {
        self.value.as_u64().ok_or_else(|| self.wrong("a whole number that is not negative"))
    }

    /// Returns the value as a finite number, or an error that names its key path.
    fn number(&self) -> Result<f64, SourceError> {
        self.value.as_f64().ok_or_else(|| self.wrong("a number"))
    }

    /// Returns the value as a list of exactly three numbers, or an error that names its key path.
    fn numbers(&self) -> Result<[f64; 3], SourceError> {
        self.each(Item::number)?.try_into().map_err(|_| self.wrong("a list of 3 numbers"))
    }
}

/// Reads the camera walks of a JSON description, for use with any scene.
///
/// # Errors
///
/// Returns the errors of [`Description::load`], and [`SourceError::Content`] when the description has no
/// walks.
pub fn load_walks(path: &std::path::Path) -> Result<Vec<Walk>, SourceError> {
    let description = Description::load(path)?;
    if description.walks.is_empty() {
        return Err(SourceError::content(path, "cameras", "there are no walks"));
    }
    Ok(description.walks)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Description, SourceError> {
        Description::parse(text.as_bytes(), Path::new("test.json"))
    }

    /// Valid description that tests alter: one walk with one key, and reference counts for it.
    const GOOD: &str = r#"{"name": "n", "up_axis": "y", "near": 0.2, "first_transparent_object": null, "cameras":
        [{"name": "w", "fov_y_deg": 60, "up": [0, 2, 0], "keys": [{"eye": [1, 2, 3.5], "target": [0, 0, 0]}]}],
        "reference_640x360": [{"path": "w", "per_key_visible_objs": [3]}]}"#;

    #[test]
    fn a_description_is_read() {
        let read = parse(GOOD).expect("good");
        assert_eq!(read.up, Some(Vec3::Y), "the axis up");
        assert_eq!(read.near, Some(0.2), "the near plane");
        assert_eq!(read.first_transparent_object, None, "no object is said to be transparent");
        assert_eq!(read.walks[0].up, Vec3::Y, "the walk's axis up");
        assert_eq!(read.walks[0].keys[0].eye, DVec3::new(1.0, 2.0, 3.5), "the first eye");
        assert_eq!(read.reference[0].objects_visible, [3], "objects visible in the reference");
        assert_eq!(parse("{}").expect("empty"), Description::default(), "an empty description");
    }

    #[test]
    fn errors_name_the_key() {
        let wrong = [
            ("[1]", "top level"),
            (r#"{"near": "x"}"#, "near"),
            (r#"{"near": -1}"#, "near"),
            (r#"{"up_axis": "w"}"#, "up_axis"),
            (r#"{"objects": -3}"#, "objects"),
            (r#"{"object_names": ["a", 7]}"#, "object_names[1]"),
            (r#"{"cameras": [{}]}"#, "cameras[0]"),
            (r#"{"cameras": [{"fov_y_deg": 180}]}"#, "cameras[0].fov_y_deg"),
            (r#"{"bbox_min": [1, 2]}"#, "bbox_min"),
            (&GOOD.replace("3.5]", "null]"), "cameras[0].keys[0].eye[2]"),
            (&GOOD.replace("[0, 2, 0]", "[0, 0, 0]"), "cameras[0].up"),
            (&GOOD.replace("[0, 0, 0]", "[1, 2, 3.5]"), "cameras[0].keys[0]"),
            (r#"{"near": 1e999}"#, "line 1"),
            (r#"{"near": 1, "near": 2}"#, "line 1"),
            ("{", "line 1"),
        ];
        for (text, place) in wrong {
            let message = parse(text).expect_err(text).to_string();
            let expected = format!("test.json: {place}");
            assert!(message.starts_with(&expected), "{text}: {message}");
        }
    }

    #[test]
    fn deep_nesting_is_an_error() {
        assert!(parse(&"[".repeat(1_000_000)).is_err(), "a million nested lists");
        assert!(parse(&"{\"a\":".repeat(1_000_000)).is_err(), "a million nested objects");
    }

    proptest::proptest! {
        #[test]
        fn mutated_descriptions_are_read_or_refused(
            changes in proptest::collection::vec((0..GOOD.len(), proptest::num::u8::ANY), 1..6),
        ) {
            let mut bytes = GOOD.as_bytes().to_vec();
            for (at, value) in changes {
                bytes[at] = value;
            }
            if let Ok(read) = Description::parse(&bytes, Path::new("test.json")) {
                for walk in &read.walks {
                    let is_whole = !walk.keys.is_empty() && walk.up.is_normalized();
                    assert!(is_whole, "a walk has keys, and an axis of unit length: {walk:?}");
                }
            }
        }
    }
}
