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
    /// is drawn this frame? There is at least one box. Boxes are relative to the scene's origin and never
    /// reach the near plane. A sample that several of the boxes pass may count once or several times.
    ///
    /// Answers hide nothing visible if the device keeps to these rules:
    ///
    /// - *When*: the culler asks while it culls, before the frame is drawn. Put the query in a queue, and run
    ///   it against the depth buffer of this frame, with the camera of this frame, after the objects that
    ///   this cull or look ahead has left are drawn. The depth buffer of the frame before holds objects that
    ///   this frame may not draw. The camera is that of the view that the culler has culled for, unless a
    ///   pipeline is [frozen](crate::Pipeline::freeze): it then ignores the answers.
    /// - *Depth test*: equal depth passes (`LESS_EQUAL`; with reversed depth `GREATER_EQUAL`), since an
    ///   object may lie on the surface of its box, and would hide itself. Boxes write neither depth nor
    ///   colour, and no face is culled by its direction.
    /// - *Margins*: the card rounds the depths of a box and of the object in it differently, so draw boxes
    ///   slightly nearer. Draw them half a pixel larger on each side, since a box that covers the middle of
    ///   no pixel passes with no sample. The boxes given have neither margin: they are those of the objects
    ///   and nodes, bit for bit, and the margins depend on projection, depth format and resolution.
    /// - *Content*: what is in the depth buffer is drawn in the frame in which the answer is used, too. Call
    ///   [`HardwareQueries::invalidate`](super::HardwareQueries::invalidate) when it differs.
    ///
    /// `platforms/gpu` of the repository has such a device, over wgpu.
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
