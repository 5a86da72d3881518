//! Run of a method on a viewcell, with its answer and its time.

use super::judge::LeftOut;
use super::methods::{Method, Sandwich};
use super::timing::timed;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::{Accuracy, Scene, VisibleSet};

/// Answer of a method for a viewcell, and its time.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Entry of the method on the command line.
    pub method: String,
    /// Accuracy class that the method promises.
    pub accuracy: Accuracy,
    /// Processor time of the thread in seconds, or wall-clock time if the operating system does not provide
    /// it.
    pub seconds: f64,
    /// Indices of the reported objects, ascending, in the order of the file.
    pub reported: Vec<u32>,
    /// Bounds on the true answer. `None` for methods without such bounds.
    pub sandwich: Option<Sandwich>,
    /// Sampled objects that the method left out. Empty until the [judge](super::judge::Judge::decide) has
    /// decided.
    pub left_out: LeftOut,
}

/// Lets a method prepare its data for a scene, by running it on an empty viewcell. Returns the seconds taken.
pub fn prepare(method: &mut dyn Method, scene: &Scene) -> f64 {
    let nowhere = Viewcell::from_box(DVec3::ONE, DVec3::ZERO);
    timed(|| method.cull(scene, &nowhere, &mut VisibleSet::new())).1
}

/// Runs a method on a viewcell.
pub fn run(name: &str, method: &mut dyn Method, scene: &Scene, cell: &Viewcell) -> Trial {
    let mut visible = VisibleSet::new();
    let (_, seconds) = timed(|| method.cull(scene, cell, &mut visible));
    visible.sort_by_index(scene);
    let reported = visible.iter(scene).map(|id| id.index() as u32).collect();
    let sandwich = method.sandwich();
    let left_out = LeftOut::default();
    Trial { method: name.to_owned(), accuracy: method.accuracy(), seconds, reported, sandwich, left_out }
}
