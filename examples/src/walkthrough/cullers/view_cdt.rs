//! Entries of the triangulated image, with a dial for the number of its vertices, and its other settings.

use super::known::{Known, Made};
use visibility_2d::view_cdt::{DepthOrder, PartlyHidden, ViewCdt};
use visibility_core::OcclusionCuller;

pub(super) const KNOWN: &[Known] = &[
    Known {
        name: "view-cdt",
        what: "boxes behind the outlines of occluders are hidden, by a triangulation of the image of up to 3072 \
               vertices or view-cdt:N",
        dials: &["3072", "768", "192"],
        make: |dial, _| made(dial, ViewCdt::new()),
    },
    Known {
        name: "view-cdt-whole",
        what: "as view-cdt, without occluders that are partly hidden",
        dials: &["3072"],
        make: |dial, _| made(dial, ViewCdt::new().with_partly_hidden(PartlyHidden::LeftOut)),
    },
    Known {
        name: "view-cdt-cells",
        what: "as view-cdt, with depth by cells of doubling distance instead of planes, without occluders that \
               are in several",
        dials: &["3072"],
        make: |dial, _| made(dial, ViewCdt::new().with_order(DepthOrder::Cells { incident: false })),
    },
    Known {
        name: "view-cdt-incident",
        what: "as view-cdt-cells, with planes of depth for occluders that are in several cells",
        dials: &["3072"],
        make: |dial, _| made(dial, ViewCdt::new().with_order(DepthOrder::Cells { incident: true })),
    },
];

/// Makes the culler of a map, whose dial is a number of vertices; other text is an error.
fn made(dial: Option<&str>, map: ViewCdt) -> Made {
    let map = match dial {
        None => map,
        Some(dial) => {
            map.with_vertices(dial.parse().map_err(|_| format!("`{dial}` is no number of vertices"))?)
        }
    };
    Ok(Box::new(OcclusionCuller::new(map)))
}
