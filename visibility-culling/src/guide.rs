//! The guide: from a first program to baked sets, one chapter a module. Pictures are in the folder
//! `docs/guide` of the repository.

#[doc = include_str!("../guide/first_engine.md")]
#[cfg(all(feature = "hzb", feature = "measure"))]
pub mod first_engine {}

#[doc = include_str!("../guide/which_culler.md")]
pub mod which_culler {}

#[doc = include_str!("../guide/portals.md")]
#[cfg(all(feature = "portals", feature = "std"))]
pub mod portals {}

#[doc = include_str!("../guide/baking.md")]
#[cfg(feature = "baked")]
pub mod baking {}

#[doc = include_str!("../guide/large_worlds.md")]
pub mod large_worlds {}

#[doc = include_str!("../guide/shadows.md")]
pub mod shadows {}

#[doc = include_str!("../guide/moving.md")]
pub mod moving {}

#[doc = include_str!("../guide/levels_of_detail.md")]
pub mod levels_of_detail {}

#[doc = include_str!("../guide/regions.md")]
#[cfg(all(feature = "2d", feature = "region"))]
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

#[doc = include_str!("../guide/tradeoff.md")]
pub mod tradeoff {}

#[doc = include_str!("../guide/wrong_picture.md")]
#[cfg(feature = "hzb")]
pub mod wrong_picture {}
