//! Settings of a bake.

/// Settings of a [`SandwichBaker`](crate::SandwichBaker).
///
/// ```
/// let settings = visibility_bake::SandwichSettings { gap: 0.0, ..Default::default() };
/// assert_eq!(settings.clearance, 1e-4);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SandwichSettings {
    /// Greatest share of open objects in the [cost](visibility_core::Object::cost) of all reported objects of
    /// a viewcell, from 0 to 1, at which its proofs end. 0 asks for a proof of every object that is not seen,
    /// 1 for none. NaN and numbers below 0 count as 0.
    pub gap: f64,
    /// Distance in metres that a line of sight must keep from all occluders for an object to count as
    /// visible, up to a factor of six. 0 gives a conservative bake, see
    /// [`Effort::Exact`](visibility_exact::Effort::Exact).
    pub clearance: f64,
    /// Number of rays aimed at each object before any proof is tried. 64 times as many are cast in all
    /// directions.
    pub rays: u32,
}

impl Default for SandwichSettings {
    /// A gap of 5 %, a clearance of a tenth of a millimetre, 200 rays at each object.
    fn default() -> Self {
        Self { gap: 0.05, clearance: 1e-4, rays: 200 }
    }
}
