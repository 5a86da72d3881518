//! One program for the tests of all files here: it compiles and runs in less time than many.
#![allow(missing_docs)]

mod box_limit;
mod clip_planes;
mod common;
mod instances;
mod pictures;
mod rays;
mod surfaces;
mod ties;
