//! Tests of the cullers of `visibility-2d` on every scene: no object that an item buffer of 2560 x 1440 sees
//! is hidden, with any setting.

use crate::shared_scenes::{assert_none_hidden_by, scene};
use visibility_examples::built_in;

const CULLERS: &str = "frustum,horizon:32,horizon,horizon:4096,horizon+hzb,view-cdt,view-cdt:192,hzb,\
    occlusion-tree";

#[test]
fn nothing_visible_is_hidden_in_built_in_scenes() {
    for name in ["plpcity", "london", "town", "forest", "office"] {
        assert_none_hidden_by(CULLERS, built_in(name).unwrap(), 6);
    }
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn nothing_visible_is_hidden_in_reference_scenes() {
    for name in ["denhaag", "alpine1", "oa_dm2"] {
        assert_none_hidden_by(CULLERS, scene(name), 9);
    }
    for name in ["clinic and its pipes", "cars5"] {
        assert_none_hidden_by(CULLERS, scene(name), 6);
    }
}
