//! The inner loops of the crate compiled for several instruction sets, one of which is chosen at run time.
//!
//! As in `visibility-core`, each function has one body in plain loops. It is compiled for the instruction set
//! that the program is built for and, on x86-64 with `std`, again for AVX2 and AVX-512. Rust neither reorders
//! nor fuses floating-point operations, so all versions give the same bits. This is the only module with
//! `unsafe` code: calls of functions compiled for instructions that the program at large does not assume.
//! Core finds out which instruction sets the processor has ([`Simd`]).

use crate::buffer::pyramid::Pyramid;
use crate::buffer::tile_layout::Rectangle;
use crate::buffer::tiles::Tiles;
use crate::coverage::Coverage;
use crate::hom::depth_estimate::DepthBoundary;
use crate::hom::opacity_pyramid::OpacityPyramid;
use crate::hom::tile_range::TileRange;
use crate::lanes::WIDTH;
use crate::level::{
    Candidate, Edges, FillScratch, LevelFrame, LevelScratch, PreparedEdge, PreparedLevel, Seams, TileKeys,
};
use crate::query::BoxQuery;
use crate::query::box_projection::{ProjectedBoxes, ScreenProjection32};
use crate::query::box_query::Boxes;
use crate::raster::contour_raster::ContourTiles;
use crate::raster::mesh_raster::MeshScratch;
use crate::raster::parallax::Parallax;
use crate::setup::convex_shape::ConvexScratch;
use crate::setup::occluder_triangles::OccluderTriangles;
use crate::setup::screen_projection::{ObjectProjection, ScreenProjection};
use crate::setup::screen_shape::{ScreenExtent, ScreenShape, ShapeResult};
use alloc::vec::Vec;
use visibility_core::glam::Affine3A;
#[cfg(all(target_arch = "x86_64", feature = "std"))]
use visibility_core::simd::SimdLevel;
use visibility_core::{Aabb, occlusion::Occlusion64, simd::Simd};

/// Declares the trait [`Kernels`] and implements it for [`Simd`]. Each method runs the version of a function
/// that is compiled for the instruction set of the [`Simd`].
macro_rules! compiled {
    ($(
        $name:ident = $body:path, ($($argument:ident: $type:ty),*) -> $result:ty;
    )*) => {
        /// Functions that are compiled for each instruction set. Each method has the contract of the function
        /// of the same name.
        pub(crate) trait Kernels {
            $(
                #[allow(clippy::too_many_arguments)]
                fn $name(self, $($argument: $type),*) -> $result;
            )*
        }

        impl Kernels for Simd {
            $(
                #[allow(unsafe_code)]
                fn $name(self, $($argument: $type),*) -> $result {
                    #[cfg(all(target_arch = "x86_64", feature = "std"))]
                    #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
                    #[allow(clippy::too_many_arguments)]
                    fn avx2($($argument: $type),*) -> $result {
                        $body($($argument),*)
                    }

                    #[cfg(all(target_arch = "x86_64", feature = "std"))]
                    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
                    #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
                    #[allow(clippy::too_many_arguments)]
                    fn avx512($($argument: $type),*) -> $result {
                        $body($($argument),*)
                    }

                    match self.level() {
                        // SAFETY: a `Simd` of this level exists only where the processor was found to have
                        // all that `avx2` enables.
                        #[cfg(all(target_arch = "x86_64", feature = "std"))]
                        SimdLevel::Avx2 => unsafe { avx2($($argument),*) },
                        // SAFETY: a `Simd` of this level exists only where the processor was found to have
                        // all that `avx512` enables.
                        #[cfg(all(target_arch = "x86_64", feature = "std"))]
                        SimdLevel::Avx512 => unsafe { avx512($($argument),*) },
                        _ => $body($($argument),*),
                    }
                }
            )*
        }
    };
}

compiled! {
    box_shape = crate::setup::box_shape::box_shape, (
        bounds: &Aabb, transform: &Affine3A, projection: &ScreenProjection, extent: Option<&ScreenExtent>,
        coverage: Coverage, shape: &mut ScreenShape
    ) -> ShapeResult;
    convex_shape = crate::setup::convex_shape::convex_shape, (
        mesh: &OccluderTriangles, object: &ObjectProjection, projection: &ScreenProjection, facing: f64,
        coverage: Coverage, convex: bool, scratch: &mut ConvexScratch, shape: &mut ScreenShape
    ) -> ShapeResult;
    draw_mesh = crate::raster::mesh_raster::draw_mesh, (
        mesh: &OccluderTriangles, object: &ObjectProjection, projection: &ScreenProjection, facing: f64,
        coverage: Coverage, parallax: Option<&Parallax>, scratch: &mut MeshScratch,
        contour_tiles: &mut ContourTiles, tiles: &mut Tiles
    ) -> f32;
    find_candidates = crate::level::find_candidates,
        (index: u32, level: &PreparedLevel, frame: &LevelFrame, candidates: &mut Vec<Candidate>) -> usize;
    begin_cluster = crate::level::begin_cluster,
        (level: &PreparedLevel, frame: &LevelFrame, index: usize, scratch: &mut LevelScratch) -> bool;
    finish_edges = Edges::finish, (edges: &mut Edges) -> ();
    find_open_tiles = crate::level::find_open_tiles,
        (keys: &TileKeys, tiles: &Tiles, open: &mut Vec<u32>) -> u32;
    fill = crate::level::fill, (
        edges: &Edges, slack: f32, keys: &TileKeys, coverage: Coverage, scratch: &mut FillScratch,
        seams: &mut Seams, tiles: &mut Tiles
    ) -> bool;
    cover_seams = Seams::cover,
        (seams: &Seams, outline: &[PreparedEdge], first: u32, base: u32, tiles: &mut Tiles) -> bool;
    fill_shape = crate::raster::shape_fill::fill_shape,
        (shape: &ScreenShape, tiles: &mut Tiles) -> bool;
    project_boxes = crate::query::box_projection::project_boxes, (
        projection: &ScreenProjection32, boxes: &[[f32; WIDTH]; 6], out: &mut ProjectedBoxes<WIDTH>
    ) -> ();
    boxes_not_hidden = crate::query::occluder_query::boxes_not_hidden, (
        pyramid: &Pyramid, tiles: &Tiles, boxes: &ProjectedBoxes<WIDTH>, count: usize
    ) -> u32;
    may_be_seen = crate::query::occluder_query::may_be_seen,
        (tiles: &Tiles, boxes: &ProjectedBoxes<WIDTH>, i: usize) -> bool;
    box_may_be_seen = crate::query::occluder_query::box_may_be_seen, (
        projection: &ScreenProjection32, tiles: &Tiles, sides: [f32; 6]
    ) -> bool;
    rectangle_may_be_seen = crate::query::occluder_query::rectangle_may_be_seen,
        (tiles: &Tiles, rectangle: &Rectangle, depth_key: f32) -> bool;
    update_maps = crate::hom::depth_estimate::update_maps, (
        opacity: &mut OpacityPyramid, boundary: &mut DepthBoundary, tiles: &Tiles, range: &TileRange
    ) -> ();
    test_boxes = crate::query::box_query::test_boxes,
        (query: &BoxQuery, boxes: &Boxes, candidates: u64) -> Occlusion64;
}
