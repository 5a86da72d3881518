//! The JSON facts beside a scene file: up axis, near plane, names, transparency, camera walks and reference
//! counts.
//!
//! Every key is optional, since each scene has its own; a key of the wrong type is an error that names it by
//! its path, such as `cameras[1].keys[3].eye`. Keys that are not known here are ignored.

use crate::error::SourceError;
use crate::walk::{CameraKey, Walk};
use glam::{DVec3, Vec3};
use serde_json::Value;
use std::path::Path;

/// The facts beside a scene file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Description {
    /// The name of the scene.
    pub name: Option<String>,
    /// The axis that points up.
    pub up: Option<Vec3>,
    /// A near-plane distance that suits the walks.
    pub near: Option<f32>,
    /// The number of objects, to check the scene file against.
    pub objects: Option<u64>,
    /// The number of triangles, to check the scene file against.
    pub triangles: Option<u64>,
    /// The smallest corner of the box around the scene.
    pub bounds_min: Option<[f64; 3]>,
    /// The largest corner of the box around the scene.
    pub bounds_max: Option<[f64; 3]>,
    /// Names of the objects, in their order.
    pub object_names: Vec<String>,
    /// Objects from this one on are glass.
    pub first_transparent_object: Option<u64>,
    /// Objects whose name begins with one of these are cut-out billboards.
    pub alpha_tested_name_prefixes: Vec<String>,
    /// Objects whose name holds this are doors.
    pub door_name_contains: Option<String>,
    /// Where the five cars stand: x, z and yaw in degrees.
    pub cars5_placements: Vec<[f64; 3]>,
    /// The camera walks.
    pub walks: Vec<Walk>,
    /// What is in the frustum and what is visible, one entry a walk.
    pub reference: Vec<ReferenceCounts>,
}

/// For each key of a walk, what a 640 by 360 item buffer shows with every object drawn and opaque, doors
/// closed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReferenceCounts {
    /// The name of the walk.
    pub walk: String,
    /// Objects whose triangles are partly in the frustum.
    pub objects_in_frustum: Vec<u64>,
    /// Objects of which at least one pixel shows.
    pub objects_visible: Vec<u64>,
    /// Triangles of which at least one pixel shows.
    pub triangles_visible: Vec<u64>,
}

impl Description {
    /// Reads a description from a file.
    pub fn load(path: &Path) -> Result<Self, SourceError> {
        let bytes = std::fs::read(path).map_err(|cause| SourceError::io(path, cause))?;
        Self::parse(&bytes, path)
    }

    /// Reads a description from bytes; the path is for messages only.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, SourceError> {
        let root: Value = serde_json::from_slice(bytes).map_err(|error| {
            let place = format!("line {}, column {}", error.line(), error.column());
            SourceError::content(path, place, error.to_string())
        })?;
        let root = Item { value: &root, place: String::new(), path };
        if !root.value.is_object() {
            return Err(root.wrong("an object"));
        }
        Self::read(&root)
    }

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

fn up_axis(item: &Item<'_>) -> Result<Vec3, SourceError> {
    match item.text()?.as_str() {
        "x" => Ok(Vec3::X),
        "y" => Ok(Vec3::Y),
        "z" => Ok(Vec3::Z),
        _ => Err(item.wrong("one of the axes \"x\", \"y\", \"z\"")),
    }
}

fn near(item: &Item<'_>) -> Result<f32, SourceError> {
    let near = item.number()? as f32;
    if near > 0.0 && near.is_finite() { Ok(near) } else { Err(item.wrong("a positive distance")) }
}

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

fn key(item: &Item<'_>) -> Result<CameraKey, SourceError> {
    let eye = DVec3::from_array(item.required("eye")?.numbers()?);
    let target = DVec3::from_array(item.required("target")?.numbers()?);
    if eye == target {
        return Err(item.wrong("an eye and a target that differ"));
    }
    Ok(CameraKey { eye, target })
}

fn reference(item: &Item<'_>) -> Result<ReferenceCounts, SourceError> {
    Ok(ReferenceCounts {
        walk: item.required("path")?.text()?,
        objects_in_frustum: item.list("per_key_in_frustum_objs", Item::count)?,
        objects_visible: item.list("per_key_visible_objs", Item::count)?,
        triangles_visible: item.list("per_key_visible_tris", Item::count)?,
    })
}

/// A JSON value that knows where it stands, for messages.
struct Item<'a> {
    value: &'a Value,
    place: String,
    path: &'a Path,
}

impl<'a> Item<'a> {
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

    /// The value under a key; a null counts as absent.
    fn member(&self, key: &str) -> Option<Item<'a>> {
        let value = self.value.get(key).filter(|value| !value.is_null())?;
        let place = if self.place.is_empty() { key.to_owned() } else { format!("{}.{key}", self.place) };
        Some(Item { value, place, path: self.path })
    }

    fn required(&self, key: &str) -> Result<Item<'a>, SourceError> {
        self.member(key).ok_or_else(|| self.wrong(&format!("an object with the key `{key}`")))
    }

    fn optional<T>(
        &self,
        key: &str,
        read: impl Fn(&Item<'a>) -> Result<T, SourceError>,
    ) -> Result<Option<T>, SourceError> {
        self.member(key).map(|item| read(&item)).transpose()
    }

    /// The list under a key; an absent one is empty.
    fn list<T>(
        &self,
        key: &str,
        read: impl Fn(&Item<'a>) -> Result<T, SourceError>,
    ) -> Result<Vec<T>, SourceError> {
        self.member(key).map_or_else(|| Ok(Vec::new()), |item| item.each(read))
    }

    fn each<T>(&self, read: impl Fn(&Item<'a>) -> Result<T, SourceError>) -> Result<Vec<T>, SourceError> {
        let items = self.value.as_array().ok_or_else(|| self.wrong("a list"))?;
        let read_one = |(index, value)| {
            read(&Item { value, place: format!("{}[{index}]", self.place), path: self.path })
        };
        items.iter().enumerate().map(read_one).collect()
    }

    fn text(&self) -> Result<String, SourceError> {
        self.value.as_str().map(str::to_owned).ok_or_else(|| self.wrong("a string"))
    }

    fn count(&self) -> Result<u64, SourceError> {
        self.value.as_u64().ok_or_else(|| self.wrong("a whole number that is not negative"))
    }

    fn number(&self) -> Result<f64, SourceError> {
        self.value.as_f64().ok_or_else(|| self.wrong("a number"))
    }

    fn numbers(&self) -> Result<[f64; 3], SourceError> {
        self.each(Item::number)?.try_into().map_err(|_| self.wrong("a list of 3 numbers"))
    }
}

/// Reads the walks of a JSON description, for use with any scene.
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

    const GOOD: &str = r#"{"name": "n", "up_axis": "y", "near": 0.2, "first_transparent_object": null, "cameras":
        [{"name": "w", "fov_y_deg": 60, "up": [0, 2, 0], "keys": [{"eye": [1, 2, 3.5], "target": [0, 0, 0]}]}],
        "reference_640x360": [{"path": "w", "per_key_visible_objs": [3]}]}"#;

    #[test]
    fn a_description_is_read() {
        let read = parse(GOOD).expect("good");
        assert_eq!(read.up, Some(Vec3::Y));
        assert_eq!(read.near, Some(0.2));
        assert_eq!(read.first_transparent_object, None);
        assert_eq!(read.walks[0].up, Vec3::Y);
        assert_eq!(read.walks[0].keys[0].eye, DVec3::new(1.0, 2.0, 3.5));
        assert_eq!(read.reference[0].objects_visible, [3]);
        assert_eq!(parse("{}").expect("empty"), Description::default());
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
        assert!(parse(&"[".repeat(1_000_000)).is_err());
        assert!(parse(&"{\"a\":".repeat(1_000_000)).is_err());
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
                assert!(read.walks.iter().all(|walk| !walk.keys.is_empty() && walk.up.is_normalized()));
            }
        }
    }
}
