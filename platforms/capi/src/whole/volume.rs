//! Convex volumes in world space, read from arrays.

use crate::error::Error;
use crate::view::plane;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};

/// Convex volume in world space: a cell of a building, or a viewcell of a baked set.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct vis_volume {
    /// Minimum corner of a box around the volume: x, y, z.
    pub min: [f64; 3],
    /// Maximum corner of the box.
    pub max: [f64; 3],
    /// Index, among all planes, of the first plane that cuts a part off the box.
    pub first_plane: u32,
    /// Number of planes; 0 if the volume is the whole box.
    pub plane_count: u32,
}

/// Returns the elements `first..first + count`. An error names the item that refers to missing elements.
pub(crate) fn range<'a, T>(
    all: &'a [T],
    first: u32,
    count: u32,
    what: &str,
    of: usize,
) -> Result<&'a [T], Error> {
    let (first, count) = (first as usize, count as usize);
    all.get(first..).and_then(|rest| rest.get(..count)).ok_or_else(|| {
        Error::argument(format_args!(
            "{what} {of} needs elements {first} to {first} + {count} of {}",
            all.len()
        ))
    })
}

/// Makes viewcells from arrays of volumes and of their planes.
pub(crate) fn volumes(volumes: &[vis_volume], planes: &[[f64; 4]]) -> Result<Viewcells, Error> {
    let made = volumes.iter().enumerate().map(|(index, volume)| {
        let planes = range(planes, volume.first_plane, volume.plane_count, "volume", index)?;
        let [min, max] = [volume.min, volume.max].map(DVec3::from_array);
        Ok(Viewcell { min, max, planes: planes.iter().map(plane).collect() })
    });
    Ok(Viewcells::new(made.collect::<Result<Vec<_>, Error>>()?))
}
