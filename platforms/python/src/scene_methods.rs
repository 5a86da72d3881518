//! What Python sees of scenes: the methods of `Scene`.

use crate::arrays::{self, BOXES, LIST, POINTS_3D};
use crate::baked::{self, BakedSet};
use crate::cells::Cells;
use crate::cullers::Stage;
use crate::error::refused;
use crate::scene::{Scene, ids_array};
use crate::view::View;
use crate::{measure, region};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, VisibleSet, scene};
use visibility_occluders::{LevelOccluders, LevelSettings};

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (*, origin=[0.0; 3], two_sided=false), text_signature = "(*, origin=(0, 0, 0), two_sided=False)")]
    fn new(origin: [f64; 3], two_sided: bool) -> PyResult<Self> {
        let mut scene = scene::Scene::new();
        scene.set_origin(DVec3::from_array(origin)).map_err(|error| refused("origin", error))?;
        Ok(Self { scene, two_sided, level: None, kept: Mutex::default() })
    }

    fn __len__(&self) -> usize {
        self.scene.len()
    }

    fn __repr__(&self) -> String {
        format!("Scene({} objects)", self.scene.len())
    }

    /// Adds boxes, (n, 2, 3) float64: least and greatest corner. Returns their numbers, uint32 (n,).
    ///
    /// solid: each box is the object itself, and hides what is behind it. Otherwise it only contains an
    /// object of unknown shape, which hides nothing. A box with NaN or with corners in the wrong order is
    /// always visible.
    #[pyo3(signature = (boxes, *, solid=true))]
    fn add_boxes<'py>(
        &mut self,
        py: Python<'py>,
        boxes: &Bound<'py, PyAny>,
        solid: bool,
    ) -> PyResult<Bound<'py, PyArray1<u32>>> {
        let boxes = arrays::floats("boxes", boxes, BOXES)?;
        let boxes = boxes.groups::<6>();
        let ids = py.detach(|| {
            if !solid {
                let bounds: Vec<Aabb> = boxes.iter().map(|&corners| self.bounds_of(corners)).collect();
                let ids = self.scene.insert_batch(bounds);
                self.boxes_changed();
                return Ok(ids);
            }
            let mut ids = Vec::with_capacity(boxes.len());
            for &corners in boxes {
                let (triangles, hides) = self.box_triangles(corners).unzip();
                ids.push(self.insert(self.bounds_of(corners), triangles, hides == Some(true), None)?);
            }
            Ok::<_, PyErr>(ids)
        })?;
        Ok(ids_array(py, ids))
    }

    /// Adds an object of triangles: positions (n, 3) float64 and indices (m, 3) of uint32, int32 or int64,
    /// counter-clockwise as seen from outside. Returns its number. occluder: whether it hides what is behind
    /// it; choose False for glass and leaves. two_sided: whether its triangles show and hide from behind as
    /// well; None for what the scene says.
    #[pyo3(signature = (positions, triangles, *, occluder=true, two_sided=None))]
    fn add_mesh(
        &mut self,
        py: Python<'_>,
        positions: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        occluder: bool,
        two_sided: Option<bool>,
    ) -> PyResult<u32> {
        let positions = arrays::floats("positions", positions, POINTS_3D)?;
        let indices = arrays::indices("triangles", triangles, POINTS_3D)?;
        let (positions, indices) = (positions.groups::<3>(), indices.groups::<3>());
        if let Some(row) = positions.iter().position(|point| point.iter().any(|number| !number.is_finite())) {
            return Err(refused("positions", format!("row {row} is not finite")));
        }
        let id = py.detach(|| {
            let corner = |index: u32| positions.get(index as usize).map(|&point| self.relative(point));
            let mut made = Vec::with_capacity(indices.len());
            for (row, &triangle) in indices.iter().enumerate() {
                let [Some(a), Some(b), Some(c)] = triangle.map(corner) else {
                    let what = format!("row {row} has an index beyond the {} positions", positions.len());
                    return Err(refused("triangles", what));
                };
                made.push([a, b, c]);
            }
            // The box contains the triangles as given, and as rounded.
            let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            for point in indices.as_flattened().iter().filter_map(|&index| positions.get(index as usize)) {
                (min, max) = (min.min(DVec3::from_array(*point)), max.max(DVec3::from_array(*point)));
            }
            if made.is_empty() {
                return Err(refused("triangles", "there are none"));
            }
            self.insert(Aabb::from_world(min, max, self.scene.origin()), Some(made), occluder, two_sided)
        })?;
        Ok(id.index() as u32)
    }

    /// Moves objects that have no triangles, which were added with solid=False, to new boxes: ids (n,) and
    /// boxes (n, 2, 3) float64. All are moved or none.
    fn move_boxes(
        &mut self,
        py: Python<'_>,
        ids: &Bound<'_, PyAny>,
        boxes: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let ids = arrays::indices("ids", ids, LIST)?;
        let boxes = arrays::floats("boxes", boxes, BOXES)?;
        let (ids, boxes) = (ids.numbers(), boxes.groups::<6>());
        if ids.len() != boxes.len() {
            return Err(refused(
                "boxes",
                format!("expected ({}, 2, 3), as ids, got ({}, 2, 3)", ids.len(), boxes.len()),
            ));
        }
        py.detach(|| {
            let mut moved = Vec::with_capacity(ids.len());
            for (&index, &corners) in ids.iter().zip(boxes) {
                let id = self.scene.id_at(index as usize);
                let id = id.ok_or_else(|| refused("ids", format!("no object has the number {index}")))?;
                if !self.scene.triangles(id).is_ok_and(|triangles| triangles.is_empty()) {
                    return Err(refused(
                        "ids",
                        format!("object {index} has triangles, which stay where they are"),
                    ));
                }
                moved.push((id, self.bounds_of(corners)));
            }
            self.scene.set_bounds_batch(&moved).map_err(|error| refused("ids", error))?;
            self.scene.maintain(256);
            self.boxes_changed();
            Ok(())
        })
    }

    /// The boxes of all objects as kept, (n, 2, 3) float64: they contain what was given.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let mut corners = Vec::with_capacity(self.scene.len());
        for bounds in self.scene.ids().filter_map(|id| self.scene.bounds(id).ok()) {
            let world = |corner: Vec3| (corner.as_dvec3() + self.scene.origin()).to_array();
            corners.push([world(bounds.min), world(bounds.max)]);
        }
        PyArray1::from_slice(py, corners.as_flattened().as_flattened()).reshape([corners.len(), 2, 3])
    }

    /// Joins the triangles of all occluders to few large polygons, with which cull hides more where walls are
    /// made of many objects. They are dropped when another occluder is added. Returns how many polygons there
    /// are.
    fn join_occluders(&mut self, py: Python<'_>) -> PyResult<usize> {
        let scene = &self.scene;
        let level = py
            .detach(|| LevelOccluders::of_scene(scene, |_| true, LevelSettings::default()))
            .map_err(|error| refused("scene", error))?;
        let polygons = level.report().polygons;
        self.level = Some(Arc::new(level));
        self.forget_occluders();
        Ok(polygons)
    }

    /// Makes cells and portals of the triangles of the occluders: space is divided along large walls, and
    /// every gap between triangles becomes an open portal, unless it is narrower than 2^-20 of the greatest
    /// coordinate relative to the origin, or 2^-36 of that in the world. For cull, in buildings.
    ///
    /// max_cells: more regions are not divided. What is added later does not count. There are no cells, and
    /// they hide nothing, where all space sees the backs of triangles, as in a scene that is not two_sided
    /// with walls that are open behind. Takes from milliseconds to minutes.
    #[pyo3(signature = (*, max_cells=16384))]
    fn make_cells(&self, py: Python<'_>, max_cells: usize) -> PyResult<Cells> {
        Cells::of_scene(&self.scene, py, max_cells)
    }

    /// Numbers of the objects that a camera may see, ascending: uint32 (k,). With mask=True, bool (n,).
    ///
    /// Objects outside of the view are left out, and those that occlusion proves to be behind others. No
    /// visible object is ever left out. occlusion: one or several, applied in turn:
    ///
    /// - "z_buffer", or True: a software z-buffer, for scenes of any kind.
    /// - "horizon": upright solids, walls and hills, for cities and terrain near the ground, with z up.
    /// - "horizon_y": the same with y up.
    /// - "occlusion_tree": a tree of the shadows of the largest polygons.
    /// - Cells: what is seen through open portals of a building.
    ///
    /// False or an empty list: none. None, as without the argument: True.
    #[pyo3(
        signature = (view, *, occlusion=None, mask=false),
        text_signature = "($self, view, *, occlusion=True, mask=False)"
    )]
    fn cull<'py>(
        &self,
        py: Python<'py>,
        view: &View,
        occlusion: Option<&Bound<'py, PyAny>>,
        mask: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let stages = Stage::list(occlusion)?;
        let visible = py.detach(|| {
            let kept = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
            let mut pipeline = kept().take(&stages, &self.scene, self.level.as_ref());
            let mut visible = VisibleSet::new();
            pipeline.cull(&self.scene, &view.view, &mut visible);
            kept().keep(stages, pipeline);
            visible
        });
        if mask {
            return Ok(PyArray1::from_vec(py, self.mask(visible.iter(&self.scene))).into_any());
        }
        Ok(ids_array(py, visible.iter(&self.scene)).into_any())
    }

    /// Numbers of the objects that may be seen from somewhere in a box, ascending: uint32 (k,).
    ///
    /// region: (2, 3) float64, least and greatest corner. Objects are left out that occluders hide from every
    /// point of the box. No object that is visible from a point of the box is left out. Quick; see
    /// prove_from_region for the exact answer.
    fn seen_from_region<'py>(
        &self,
        py: Python<'py>,
        region: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<u32>>> {
        region::seen(self, py, region)
    }

    /// What is seen from a box, with proof: numbers of objects seen, uint32 (k,); numbers of objects hidden;
    /// of those left undecided, which count as visible; and for each object seen a line of sight, (k, 2, 3)
    /// float64, from the box to the object.
    ///
    /// region: (2, 3) float64. clearance: in metres; what is seen only through gaps narrower than 12
    /// clearances, or at grazing angles, may count as hidden. 0 for none, which takes longer and leaves more
    /// undecided. Hidden is proven for the triangles as rounded to single precision. Objects without
    /// triangles are judged by their boxes.
    #[pyo3(signature = (region, *, clearance=1e-4))]
    fn prove_from_region<'py>(
        &self,
        py: Python<'py>,
        region: &Bound<'py, PyAny>,
        clearance: f64,
    ) -> PyResult<region::Verdicts<'py>> {
        region::prove(self, py, region, clearance)
    }

    /// Finds for each of many boxes the objects that may be seen from it, with proofs where that is needed.
    ///
    /// cells: (n, 2, 3) float64, boxes that may touch; see grid_cells. clearance: in metres, as of
    /// prove_from_region. gap: a proof is tried until at most this share of what counts as visible is
    /// undecided.
    #[pyo3(signature = (cells, *, clearance=1e-4, gap=0.02))]
    fn bake(&self, py: Python<'_>, cells: &Bound<'_, PyAny>, clearance: f64, gap: f64) -> PyResult<BakedSet> {
        BakedSet::of_scene(self, py, cells, clearance, gap)
    }

    /// Boxes of a size that together cover a box, for bake: (n, 2, 3) float64. region: (2, 3); size: three
    /// lengths in metres. The boxes are those of a grid through 0.
    #[staticmethod]
    fn grid_cells(
        py: Python<'_>,
        region: [[f64; 3]; 2],
        size: [f64; 3],
    ) -> PyResult<Bound<'_, PyArray3<f64>>> {
        baked::grid_cells(py, region, size)
    }

    /// Which object each pixel shows, -1 for none: int64 (height, width), the picture's top row first.
    ///
    /// size: width and height in pixels. Every triangle of every object is drawn; objects without triangles
    /// are not. Takes long: this judges cullers and makes pictures.
    #[pyo3(signature = (view, size=(640, 360)))]
    fn item_buffer<'py>(
        &self,
        py: Python<'py>,
        view: &View,
        size: (u32, u32),
    ) -> PyResult<Bound<'py, PyArray2<i64>>> {
        measure::item_buffer(self, py, view, size)
    }

    /// Compares a set of objects, ids (k,), with what pixels show. Returns the numbers of objects that a
    /// pixel shows though they are not in the set, uint32, and how many objects of the set no pixel shows.
    ///
    /// size: width and height in pixels. No culler of this package leaves anything for the first. The second
    /// counts objects that show between pixels as well.
    #[pyo3(signature = (view, ids, size=(640, 360)))]
    fn compare<'py>(
        &self,
        py: Python<'py>,
        view: &View,
        ids: &Bound<'py, PyAny>,
        size: (u32, u32),
    ) -> PyResult<(Bound<'py, PyArray1<u32>>, u32)> {
        measure::compare(self, py, view, ids, size)
    }
}
