//! Command-line entries of the triangulated image, with a setting for the number of its vertices.

use super::known::{Known, Made};
use visibility_2d::view_cdt::ViewCdt;
use visibility_core::OcclusionCuller;

pub(super) const KNOWN: &[Known] = &[Known {
    name: "view-cdt",
    what: "boxes behind the outlines of occluders are hidden, by a triangulation of the image of up to 3072 \
               vertices or view-cdt:N",
    dials: &["3072", "768", "192"],
    make: |dial, _| made(dial),
}];

/// Makes the culler of a map, whose setting (dial) is a number of vertices; other text is an error.
fn made(dial: Option<&str>) -> Made {
    let map = ViewCdt::new();
    let map = match dial {
        None => map,
        Some(dial) => {
            map.with_vertices(dial.parse().map_err(|_| format!("`{dial}` is no number of vertices"))?)
        }
    };
    Ok(Box::new(OcclusionCuller::new(map)))
}
