//! Command-line entries of the hierarchical z-buffer, with settings for its resolution, its rule of pixel
//! coverage and the price of hiding an object.

use super::known::{Known, Made};
use crate::arguments::parse_size;
use crate::level_occluders;
use crate::walkthrough::World;
use std::path::Path;
use std::sync::Arc;
use visibility_hzb::{Coverage, Hzb, HzbCuller};
use visibility_occluders::LevelSettings;

pub(super) const KNOWN: &[Known] = &[
    Known {
        name: "hzb",
        what: "boxes behind the scene's own opaque triangles are hidden, by a z-buffer of 512x288 pixels or hzb:WxH",
        dials: &["1024x576", "512x288", "256x144", "128x72"],
        make: |dial, world| made(dial, world, Coverage::Conservative),
    },
    Known {
        name: "hzb-sampled",
        what: "as hzb, but a pixel counts as covered if its centre is: hides what shows only between centres",
        dials: &["512x288", "256x144"],
        make: |dial, world| made(dial, world, Coverage::Sampled),
    },
    Known {
        name: "hzb-level",
        what: "as hzb, drawing the level as a whole: its opaque triangles welded and joined into polygons beforehand, \
               or read from the file of `hzb-level:FILE`, written by the program `occluders`",
        dials: &["512x288"],
        make: |dial, world| {
            let file = dial.filter(|dial| parse_size::<usize>(dial).is_err());
            let hzb = map(dial.filter(|_| file.is_none()), world)?;
            let level = match file {
                Some(file) => level_occluders::read(Path::new(file), world)?,
                None => world.check_copies().and_then(|()| {
                    level_occluders::make(world, LevelSettings::default()).map_err(|error| error.to_string())
                })?,
            };
            Ok(Box::new(HzbCuller::new(hzb.with_level(Arc::new(level), world.origin()))))
        },
    },
    Known {
        name: "hzb-price",
        what: "as hzb, drawing at most so many triangles of occluders to hide an object: hzb-price:8, by default 24",
        dials: &["64", "8", "2"],
        make: |dial, world| {
            let refused = || format!("its dial is a number of triangles, not `{}`", dial.unwrap_or_default());
            let price = dial.and_then(|dial| dial.parse().ok()).ok_or_else(refused)?;
            Ok(Box::new(HzbCuller::new(map(None, world)?).with_price(price)))
        },
    },
];

/// Makes a z-buffer whose setting (dial) is its size in pixels, such as `256x144`; without a setting, the
/// size is 512 x 288. Text that is no size, or a size that the z-buffer cannot have, is an error.
fn map(dial: Option<&str>, world: &World) -> Result<Hzb, String> {
    let [width, height] = dial.map_or(Ok([512, 288]), parse_size)?;
    Ok(Hzb::new(width, height).map_err(|error| error.to_string())?.with_simd(world.simd))
}

fn made(dial: Option<&str>, world: &World, coverage: Coverage) -> Made {
    Ok(Box::new(HzbCuller::new(map(dial, world)?.with_coverage(coverage))))
}
