//! The hierarchical z-buffer.

use super::{Known, no_dial};
use visibility_hzb::{Hzb, HzbCuller};

pub(super) const KNOWN: &[Known] = &[Known {
    name: "hzb",
    what: "boxes behind the scene's own opaque triangles are hidden, by a z-buffer of 512x288 pixels",
    dials: &[],
    make: |dial, _| {
        no_dial(dial)?;
        let map = Hzb::new(512, 288).map_err(|error| error.to_string())?;
        Ok(Box::new(HzbCuller::new(map)))
    },
}];
