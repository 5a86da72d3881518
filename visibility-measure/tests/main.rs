//! All test files here form one program, which compiles and runs faster than many.
#![allow(missing_docs)]

mod box_limit;
mod clip_planes;
mod common;
mod instances;
mod pictures;
mod rays;
mod surfaces;
mod ties;
