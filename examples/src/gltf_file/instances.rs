//! Copies of a node's mesh by `EXT_mesh_gpu_instancing`.

use super::buffers::Buffers;
use super::document::unit;
use crate::error::SourceError;
use glam::{DMat4, DQuat, DVec3};
use serde_json::Value;
use std::path::Path;

/// Returns the number of copies of a node's mesh, without reading their places: the greatest number of elements
/// of an attribute, and 1 for a node without the extension.
pub(super) fn instance_count(node: &gltf::Node<'_>, document: &gltf::Document) -> usize {
    let Some(extension) = node.extension_value("EXT_mesh_gpu_instancing") else { return 1 };
    let accessor = |name: &str| {
        let index = extension.get("attributes")?.get(name)?.as_u64()?;
        document.accessors().nth(usize::try_from(index).ok()?)
    };
    let accessors = ["TRANSLATION", "SCALE", "ROTATION"].into_iter().filter_map(accessor);
    accessors.map(|accessor| accessor.count()).max().unwrap_or(0)
}

/// Reads the matrices from the space of a node's mesh to that of the node, one for each copy. `None` for a
/// node without the extension, whose mesh is there once.
///
/// # Errors
///
/// Returns [`SourceError::Content`] when an accessor cannot be read, or they differ in their numbers of
/// elements.
pub(super) fn instances(
    node: &gltf::Node<'_>,
    document: &gltf::Document,
    buffers: &Buffers<'_>,
    path: &Path,
) -> Result<Option<Vec<DMat4>>, SourceError> {
    let Some(extension) = node.extension_value("EXT_mesh_gpu_instancing") else { return Ok(None) };
    let wrong = |problem: String| SourceError::content(path, format!("node {}", node.index()), problem);
    let accessor = |name: &str| {
        let index =
            extension.get("attributes").and_then(|attributes| attributes.get(name)).and_then(Value::as_u64);
        let found = index.map(|index| {
            let accessor = usize::try_from(index).ok().and_then(|index| document.accessors().nth(index));
            accessor.ok_or_else(|| wrong(format!("{name} of its instances is no accessor")))
        });
        found.transpose()
    };
    let vectors = |name| accessor(name)?.map(|accessor| buffers.vectors::<3>(&accessor)).transpose();
    let translations = vectors("TRANSLATION")?;
    let scales = vectors("SCALE")?;
    let rotations = accessor("ROTATION")?.map(|accessor| buffers.vectors::<4>(&accessor)).transpose()?;
    let counts = [
        translations.as_ref().map(Vec::len),
        scales.as_ref().map(Vec::len),
        rotations.as_ref().map(Vec::len),
    ];
    let count = counts.into_iter().flatten().max().unwrap_or(0);
    if counts.into_iter().flatten().any(|other| other != count) {
        return Err(wrong("the attributes of its instances differ in number".into()));
    }
    let vector = |list: &Option<Vec<[f32; 3]>>, i: usize, default| {
        list.as_ref().map_or(default, |list| DVec3::from_array(list[i].map(f64::from)))
    };
    let matrix = |i: usize| {
        let rotation =
            rotations.as_ref().map_or(DQuat::IDENTITY, |list| DQuat::from_array(list[i].map(f64::from)));
        DMat4::from_scale_rotation_translation(
            vector(&scales, i, DVec3::ONE),
            unit(rotation),
            vector(&translations, i, DVec3::ZERO),
        )
    };
    Ok(Some((0..count).map(matrix).collect()))
}
