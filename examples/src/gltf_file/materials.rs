//! Materials of a glTF file: whether surfaces are see-through, and whether they are drawn from both sides or
//! only from the front.

use crate::json::list;
use gltf::material::AlphaMode;
use serde_json::Value;

/// Factors of material extensions that let light through: extension, key of the factor, and its default
/// value. A material with a factor above 0 is see-through.
pub(super) const TRANSMITTING: [(&str, &str, f64); 4] = [
    ("ADOBE_materials_thin_transparency", "transmissionFactor", 1.0),
    ("KHR_materials_transmission", "transmissionFactor", 0.0),
    ("KHR_materials_diffuse_transmission", "diffuseTransmissionFactor", 0.0),
    ("KHR_materials_volume", "thicknessFactor", 0.0),
];

/// Returns two flags: whether a primitive is see-through, and whether it is drawn only from its front. With
/// several materials (`KHR_materials_variants`), it is see-through if any of them is, and one-sided if all of
/// them are. If some are one-sided and others are not, it counts as see-through, since its back is visible
/// with some and hides nothing with others. With a material for which a renderer may take others from afar
/// (`MSFT_lod`), it counts as see-through and drawn from both sides: these are not looked at.
pub(super) fn surface(primitive: &gltf::Primitive<'_>, document: &gltf::Document) -> (bool, bool) {
    let variants = primitive.extension_value("KHR_materials_variants");
    let mappings = variants.map_or(&[][..], |variants| list(variants, "mappings"));
    let material = |mapping: &Value| {
        let index = usize::try_from(mapping.get("material")?.as_u64()?).ok()?;
        document.materials().nth(index)
    };
    let materials = || mappings.iter().filter_map(material).chain([primitive.material()]);
    if materials().any(|material| material.extension_value("MSFT_lod").is_some()) {
        return (true, false);
    }
    let [one_sided, two_sided] =
        [false, true].map(|sides| materials().all(|material| material.double_sided() == sides));
    let differ = !one_sided && !two_sided;
    (differ || materials().any(|material| is_see_through(&material)), one_sided)
}

/// Returns whether a renderer shows what is behind a surface through it: its alpha mode is blend or mask, or
/// it transmits light.
fn is_see_through(material: &gltf::Material<'_>) -> bool {
    let is_transmitting = |&(extension, key, default): &(&str, &str, f64)| {
        let extension = material.extension_value(extension);
        extension.is_some_and(|values| values.get(key).map_or(Some(default), Value::as_f64) > Some(0.0))
    };
    material.alpha_mode() != AlphaMode::Opaque || TRANSMITTING.iter().any(is_transmitting)
}
