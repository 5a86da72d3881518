//! One program for the tests of all files here: it compiles and runs in less time than many.
#![allow(missing_docs)]

mod edits;
mod forged_bytes;
mod free_space;
mod level_files;
mod sandwiches;
