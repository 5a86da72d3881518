//! The device that answers occlusion queries: the engine's graphics API.

use crate::Aabb;
use crate::occlusion::OccluderMesh;
use glam::Affine3A;

/// Hardware occlusion queries, implemented by the engine over its graphics API.
///
/// ```
/// use visibility_core::{occlusion::QueryDevice, Aabb};
/// /// A device that never answers.
/// struct Silent;
/// impl QueryDevice for Silent {
///     fn ask(&mut self, _query: u64, _boxes: &[Aabb]) {}
///     fn answers(&mut self, _each: &mut dyn FnMut(u64, u32)) {}
/// }
/// ```
pub trait QueryDevice {
    /// Issues the query with number `query`: how many samples of the boxes pass the depth test against what
    /// has been drawn this frame? There is at least one box. Boxes are relative to the scene's origin and
    /// never reach the near plane. A sample that several of the boxes pass may count once or several times.
    fn ask(&mut self, query: u64, boxes: &[Aabb]);

    /// Calls `each` for every answer that has arrived since the last call, with the number of the query and
    /// the number of samples that passed (0: all boxes are hidden). A device that only knows whether any
    /// sample passed reports `u32::MAX` if one did.
    fn answers(&mut self, each: &mut dyn FnMut(u64, u32));

    /// Draws an occluder into the depth buffer. `transform` takes mesh coordinates to scene-relative
    /// coordinates. The default does nothing, for engines that draw their occluders themselves before
    /// culling.
    fn draw(&mut self, _occluder: &OccluderMesh, _transform: &Affine3A) {}
}
