//! The guide: from a first program to baked sets, with one chapter per module. Its pictures are in the folder
//! `docs` of the repository, so they show only if this documentation was built in a checkout.

/// Returns the Markdown definition of a link to the picture `$name` in the folder `docs` of the checkout. A
/// chapter has a definition of its own, which works where its file is read directly. The definition returned
/// here is put before the chapter's text, since Markdown takes the first of two.
macro_rules! picture {
    ($name:literal) => {
        concat!("[", $name, "]: file://", env!("CARGO_MANIFEST_DIR"), "/../docs/", $name)
    };
}

#[doc = include_str!("../guide/first_engine.md")]
#[cfg(all(feature = "hzb", feature = "measure"))]
pub mod first_engine {}

#[doc = picture!("guide/office-portals.png")]
#[doc = picture!("guide/london-horizon.png")]
#[doc = picture!("guide/plpcity-plp.png")]
#[doc = include_str!("../guide/which_culler.md")]
pub mod which_culler {}

#[doc = picture!("guide/office-cells.png")]
#[doc = include_str!("../guide/portals.md")]
#[cfg(all(feature = "portals", feature = "std"))]
pub mod portals {}

#[doc = include_str!("../guide/baking.md")]
#[cfg(feature = "bake")]
pub mod baking {}

#[doc = include_str!("../guide/large_worlds.md")]
pub mod large_worlds {}

#[doc = include_str!("../guide/shadows.md")]
pub mod shadows {}

#[doc = include_str!("../guide/moving.md")]
pub mod moving {}

#[doc = include_str!("../guide/levels_of_detail.md")]
#[cfg(feature = "plp")]
pub mod levels_of_detail {}

#[doc = picture!("region-london-20m.svg")]
#[doc = picture!("guide/plpcity-missed-by-rays.png")]
#[doc = include_str!("../guide/regions.md")]
#[cfg(all(feature = "two_d", feature = "region"))]
pub mod regions {}

#[doc = include_str!("../guide/c_library.md")]
pub mod c_library {}

#[doc = include_str!("../guide/bevy.md")]
pub mod bevy {}

#[doc = include_str!("../guide/web.md")]
pub mod web {}

#[doc = include_str!("../guide/gpu.md")]
pub mod gpu {}

#[doc = include_str!("../guide/accuracy.md")]
pub mod accuracy {}

#[doc = picture!("tradeoff-plpcity.svg")]
#[doc = include_str!("../guide/tradeoff.md")]
pub mod tradeoff {}

#[doc = include_str!("../guide/conventions.md")]
#[cfg(all(feature = "serde", feature = "mint", feature = "tracing", feature = "bake"))]
pub mod conventions {}

#[doc = include_str!("../guide/wrong_picture.md")]
#[cfg(feature = "hzb")]
pub mod wrong_picture {}
