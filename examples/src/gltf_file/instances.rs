//! Copies of a node's mesh by the extension `EXT_mesh_gpu_instancing`.

use super::buffers::Buffers;
use super::document::unit;
use crate::error::SourceError;
use glam::{DMat4, DQuat, DVec3};
use serde_json::Value;
use std::path::Path;

/// Returns an upper bound on the number of copies of a node's mesh without reading their transforms: the
/// greatest element count of the extension's attributes, also of attributes that place no copy. 1 for a node
/// without the extension or without attributes.
pub(super) fn instance_count(node: &gltf::Node<'_>, document: &gltf::Document) -> usize {
    let Some(extension) = node.extension_value("EXT_mesh_gpu_instancing") else { return 1 };
    let attributes = extension.get("attributes").and_then(Value::as_object).into_iter().flatten();
    let accessors = attributes.filter_map(|(name, _)| accessor_of(extension, name, document)?.ok());
    accessors.map(|accessor| accessor.count()).max().unwrap_or(1)
}

/// Returns the accessor of an instance attribute, `None` if the extension has no such attribute. `Err` if the
/// attribute is no index of an accessor.
fn accessor_of<'a>(
    extension: &Value,
    name: &str,
    document: &'a gltf::Document,
) -> Option<Result<gltf::Accessor<'a>, ()>> {
    let index =
        extension.get("attributes")?.get(name)?.as_u64().and_then(|index| usize::try_from(index).ok());
    Some(index.and_then(|index| document.accessors().nth(index)).ok_or(()))
}

/// Copies of a node's mesh, with their transforms.
pub(super) struct Instances {
    translations: Option<Vec<[f32; 3]>>,
    rotations: Option<Vec<[f32; 4]>>,
    scales: Option<Vec<[f32; 3]>>,
    /// Number of copies. 1 for a node without the extension or without attributes.
    pub count: usize,
}

impl Instances {
    /// Reads the copies of a node's mesh. A node without the extension, or without attributes of it, has one
    /// copy, with the identity transform.
    ///
    /// # Errors
    ///
    /// Returns [`SourceError::Content`] when an accessor cannot be read, or the accessors differ in their
    /// numbers of elements.
    pub(super) fn read(
        node: &gltf::Node<'_>,
        document: &gltf::Document,
        buffers: &Buffers<'_>,
        path: &Path,
    ) -> Result<Self, SourceError> {
        let Some(extension) = node.extension_value("EXT_mesh_gpu_instancing") else {
            return Ok(Self { translations: None, rotations: None, scales: None, count: 1 });
        };
        let wrong = |problem: String| SourceError::content(path, format!("node {}", node.index()), problem);
        let accessor = |name: &str| {
            let found = accessor_of(extension, name, document).transpose();
            found.map_err(|()| wrong(format!("{name} of its instances is no accessor")))
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
        let count = instance_count(node, document);
        if counts.into_iter().flatten().any(|other| other != count) {
            return Err(wrong("the attributes of its instances differ in number".into()));
        }
        Ok(Self { translations, rotations, scales, count })
    }

    /// Returns the matrix from mesh space to the node's space for the copy at an index, which must be below
    /// [`count`](Self::count).
    pub(super) fn matrix(&self, copy: usize) -> DMat4 {
        let vector = |list: &Option<Vec<[f32; 3]>>, default| {
            list.as_ref().map_or(default, |list| DVec3::from_array(list[copy].map(f64::from)))
        };
        let rotation = self.rotations.as_ref();
        let rotation = rotation.map_or(DQuat::IDENTITY, |list| DQuat::from_array(list[copy].map(f64::from)));
        DMat4::from_scale_rotation_translation(
            vector(&self.scales, DVec3::ONE),
            unit(rotation),
            vector(&self.translations, DVec3::ZERO),
        )
    }
}
