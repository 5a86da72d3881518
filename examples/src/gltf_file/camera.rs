//! The perspective cameras of a glTF document.

use crate::json::list;
use crate::walk::{CameraKey, Walk};
use glam::DMat4;
use serde_json::Value;

/// Perspective camera of a node.
pub(super) struct Camera {
    /// Index of the node.
    pub node: usize,
    name: String,
    /// Vertical field of view in radians.
    fov_y: f64,
    /// Distance of the near plane in the unit of the file. `None` if it is not positive.
    pub near: Option<f64>,
}

impl Camera {
    /// Returns the perspective cameras of a document's nodes. Each node comes with its index.
    pub(super) fn all(root: &Value, nodes: &[(usize, Value)]) -> Vec<Self> {
        let cameras = list(root, "cameras");
        let of_node = |&(node, ref value): &(usize, Value)| {
            let camera = cameras.get(value.get("camera")?.as_u64()? as usize)?;
            let perspective = camera.get("perspective")?;
            let named = |value: &Value| value.get("name").and_then(Value::as_str).map(str::to_owned);
            let near = perspective.get("znear").and_then(Value::as_f64);
            Some(Self {
                node,
                name: named(value).or(named(camera)).unwrap_or_else(|| format!("camera of node {node}")),
                fov_y: perspective.get("yfov")?.as_f64()?,
                near: near.filter(|&near| near as f32 > 0.0 && near.is_finite()),
            })
        };
        nodes.iter().filter_map(of_node).collect()
    }

    /// Returns a walk of one key that stands still at the camera. `world` is the transform of its node.
    /// `None` if its field of view or its position is unusable.
    pub(super) fn walk(&self, world: &DMat4) -> Option<Walk> {
        let fov_y_degrees = self.fov_y.to_degrees() as f32;
        let (eye, ahead) = (world.w_axis.truncate(), -world.z_axis.truncate().try_normalize()?);
        let up = world.y_axis.truncate().try_normalize()?.as_vec3();
        let is_usable = fov_y_degrees > 0.0 && fov_y_degrees < 180.0 && eye.is_finite();
        let key = CameraKey { eye, target: eye + ahead * eye.abs().max_element().max(1.0) };
        is_usable.then(|| Walk { name: self.name.clone(), fov_y_degrees, up, keys: vec![key] })
    }
}
