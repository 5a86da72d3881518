//! Colors of the maps that programs draw, so that a color means the same in all of them.

use super::canvas::Color;

/// Color of the background.
pub const PAPER: Color = [250, 250, 247];
/// Color of text and outlines.
pub(crate) const INK: Color = [40, 40, 40];
/// Color of objects that are hidden and not reported.
pub(crate) const HIDDEN: Color = [205, 207, 210];
/// Color of objects that are reported and not known to be visible.
pub(crate) const REPORTED: Color = [244, 190, 92];
/// Color of objects that are visible and reported.
pub(crate) const VISIBLE: Color = [74, 152, 96];
/// Color of objects that are visible and not reported.
pub(crate) const LOST: Color = [214, 32, 44];
/// Color of the viewcell, or of a camera's view frustum.
pub(crate) const VIEW: Color = [32, 84, 190];
