//! The kernels of the crate, compiled for several instruction sets, one of which is chosen at run time: 64
//! cones against an eye, and 64 boxes against a least size.
//!
//! This is the only module with `unsafe` code, in the macro that calls functions compiled for instructions
//! which the rest of the program does not assume. Core finds out which instruction sets the processor has
//! ([`Simd`](visibility_core::simd::Simd)).

use crate::backface::{Cones64, SplitEye, inside_cones};
use crate::lod::{SizeTest, small_boxes};
use visibility_core::scene::Boxes64;

visibility_core::mask_kernels! {
    /// Returns a mask of the lanes whose cone certainly contains the eye, so that the eye sees only back
    /// faces of the cone's triangles; bit i stands for lane i. Undecided cones count as not containing the
    /// eye.
    inside_cones = inside_cones, (cones: &Cones64, eye: &SplitEye);
    /// Returns a mask of the lanes whose box certainly has less than the least number of pixels of `test`;
    /// bit i stands for lane i.
    small_boxes = small_boxes, (boxes: &Boxes64, test: &SizeTest);
}
