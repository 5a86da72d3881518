//! Colors of the maps that programs draw, so that a color means the same in all of them.

use super::canvas::Color;

/// Background.
pub(crate) const PAPER: Color = [250, 250, 247];
/// Text and outlines.
pub(crate) const INK: Color = [40, 40, 40];
/// Objects that are hidden, and not reported.
pub(crate) const HIDDEN: Color = [205, 207, 210];
/// Objects that are reported, and not known to be visible.
pub(crate) const REPORTED: Color = [244, 190, 92];
/// Objects that are visible, and reported.
pub(crate) const VISIBLE: Color = [74, 152, 96];
/// Objects that are visible, and not reported.
pub(crate) const LOST: Color = [214, 32, 44];
/// The viewcell, or the volume of sight of a camera.
pub(crate) const VIEW: Color = [32, 84, 190];
