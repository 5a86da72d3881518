//! The same safe code compiled for several instruction sets, chosen at run time.
//!
//! As in `visibility-core`: one body in plain loops, compiled once for the instruction set that the program is built for and, on x86-64
//! with
//! `std`, again for AVX2 and AVX-512. Rust neither reorders nor fuses floating-point operations, so all give the same bits. This is the
//! only
//! module with `unsafe` code: calls of functions compiled for instructions that the program at large does not assume.

use crate::canvas::Cells;
use crate::cuboid::Made;
use crate::hom::{Boundary, Opacity, Region};
use crate::lens::{Lens, Placed};
use crate::mesh::Setup;
use crate::pyramid::{Pyramid, Rectangle};
use crate::query::{Boxes, Footprints, Lens32, Query, WIDTH};
use crate::shape::{Coverage, Extent, Shape};
use crate::solid::{Parts, Scratch};
use crate::tiles::Tiles;
use visibility_core::glam::Affine3A;
use visibility_core::{Aabb, Occlusion64};

/// Which instructions to use. Answers are the same on all.
///
/// ```
/// use visibility_hzb::Simd;
/// assert!(Simd::available().any(|simd| simd == Simd::best()));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Simd(Path);

/// Values beyond `Portable` are made by [`Simd::available`] alone, after it has asked the processor: that is what makes the calls below
/// sound.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Path {
    Portable,
    #[cfg(all(target_arch = "x86_64", feature = "std"))]
    Avx2,
    #[cfg(all(target_arch = "x86_64", feature = "std"))]
    Avx512,
}

impl Simd {
    /// Whatever the program was built for: SSE2, NEON, wasm SIMD or scalar.
    pub const PORTABLE: Self = Self(Path::Portable);

    /// The paths that this processor can run, from the narrowest to the widest.
    pub fn available() -> impl Iterator<Item = Self> {
        #[cfg(all(target_arch = "x86_64", feature = "std"))]
        let bits = std::is_x86_feature_detected!("avx2")
            && std::is_x86_feature_detected!("bmi1")
            && std::is_x86_feature_detected!("bmi2")
            && std::is_x86_feature_detected!("popcnt")
            && std::is_x86_feature_detected!("lzcnt");
        #[cfg(all(target_arch = "x86_64", feature = "std"))]
        let wide = [
            bits.then_some(Self(Path::Avx2)),
            (bits
                && std::is_x86_feature_detected!("avx512f")
                && std::is_x86_feature_detected!("avx512bw")
                && std::is_x86_feature_detected!("avx512dq")
                && std::is_x86_feature_detected!("avx512vl"))
            .then_some(Self(Path::Avx512)),
        ];
        #[cfg(not(all(target_arch = "x86_64", feature = "std")))]
        let wide = [None; 0];
        core::iter::once(Self::PORTABLE).chain(wide.into_iter().flatten())
    }

    /// The widest path that this processor can run.
    pub fn best() -> Self {
        Self::available().last().unwrap_or(Self::PORTABLE)
    }
}

/// Declares a method of [`Simd`] that runs a function compiled for each path.
macro_rules! compiled {
    ($($name:ident / $avx2:ident / $avx512:ident = $body:path, ($($argument:ident: $type:ty),*) -> $result:ty;)*) => {
        impl Simd {
            $(
                #[allow(unsafe_code, clippy::too_many_arguments)]
                pub(crate) fn $name(self, $($argument: $type),*) -> $result {
                    match self.0 {
                        Path::Portable => $body($($argument),*),
                        // SAFETY: a value with this path exists only where the processor was found to have AVX2.
                        #[cfg(all(target_arch = "x86_64", feature = "std"))]
                        Path::Avx2 => unsafe { $avx2($($argument),*) },
                        // SAFETY: a value with this path exists only where the processor was found to have these extensions.
                        #[cfg(all(target_arch = "x86_64", feature = "std"))]
                        Path::Avx512 => unsafe { $avx512($($argument),*) },
                    }
                }
            )*
        }
        $(
            #[cfg(all(target_arch = "x86_64", feature = "std"))]
            #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
            #[allow(clippy::too_many_arguments)]
            fn $avx2($($argument: $type),*) -> $result {
                $body($($argument),*)
            }

            #[cfg(all(target_arch = "x86_64", feature = "std"))]
            #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,bmi1,bmi2,popcnt,lzcnt")]
            #[allow(clippy::too_many_arguments)]
            fn $avx512($($argument: $type),*) -> $result {
                $body($($argument),*)
            }
        )*
    };
}

compiled! {
    cuboid / cuboid_avx2 / cuboid_avx512 = crate::hzb::make_box,
        (bounds: &Aabb, transform: &Affine3A, lens: &Lens, extent: Option<&Extent>, coverage: Coverage, shape: &mut Shape) -> Made;
    footprints / footprints_avx2 / footprints_avx512 = crate::query::footprints,
        (lens: &Lens32, boxes: &[[f32; WIDTH]; 6], out: &mut Footprints<WIDTH>) -> ();
    mesh / mesh_avx2 / mesh_avx512 = crate::mesh::draw,
        (mesh: &Parts, placed: &Placed, lens: &Lens, facing: f64, coverage: Coverage, setup: &mut Setup, cells: &mut Cells, tiles: &mut Tiles) -> f32;
    still_seen / still_seen_avx2 / still_seen_avx512 = crate::fill::still_seen,
        (tiles: &Tiles, rectangle: &Rectangle, nearness: f32) -> bool;
    not_hidden_coarsely / not_hidden_coarsely_avx2 / not_hidden_coarsely_avx512 = crate::hzb::not_hidden_coarsely,
        (pyramid: &Pyramid, tiles: &Tiles, boxes: &Footprints<WIDTH>, count: usize) -> u32;
    may_be_seen / may_be_seen_avx2 / may_be_seen_avx512 = crate::hzb::may_be_seen,
        (tiles: &Tiles, seen: &Footprints<WIDTH>, i: usize) -> bool;
    box_seen / box_seen_avx2 / box_seen_avx512 = crate::hzb::box_seen,
        (lens: &Lens32, tiles: &Tiles, sides: [f32; 6]) -> bool;
    solid / solid_avx2 / solid_avx512 = crate::solid::make,
        (mesh: &Parts, placed: &Placed, lens: &Lens, facing: f64, coverage: Coverage, convex: bool, scratch: &mut Scratch, shape: &mut Shape) -> Made;
    fill / fill_avx2 / fill_avx512 = crate::fill::fill, (shape: &Shape, tiles: &mut Tiles) -> bool;
    update_maps / update_maps_avx2 / update_maps_avx512 = crate::hom::update,
        (opacity: &mut Opacity, boundary: &mut Boundary, tiles: &Tiles, region: &Region) -> ();
    test / test_avx2 / test_avx512 = crate::query::test, (query: &Query, boxes: &Boxes, candidates: u64) -> Occlusion64;
}
