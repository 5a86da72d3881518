//! Cells and portals of buildings, with doors.

use crate::arrays::{self, Axis, BOXES, LIST, POINTS_3D};
use crate::error::refused;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::sync::{Arc, RwLock, RwLockReadGuard, RwLockWriteGuard};
use visibility_core::Scene;
use visibility_core::bake::Bake;
use visibility_core::cells::{CellGraph, CellId, PortalId};
use visibility_core::geometry::{ConvexPolygon, Plane};
use visibility_core::glam::DVec3;
use visibility_core::level_version::level_object;
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_portals::from_geometry::{PolygonSettings, from_polygons};
use visibility_portals::{BakerSettings, CellBaker, Passage, SceneCells, prt};

/// Cells of a building and the portals between them, for Scene.cull: it hides what cannot be seen through
/// open portals. Elsewhere the borders of the cells must be opaque.
///
/// boxes: (n, 2, 3) float64, a box for each cell. portals: list of m arrays (k, 3) float64, the corners of
/// convex polygons in order around them. joins: (m, 2) of uint32, int32 or int64, the two cells of each
/// portal. planes: for cells that are no boxes, a list of n arrays (k, 4) float64 of planes a, b, c, d, which
/// keep of its box what has a x + b y + c z + d >= 0. tolerance: in metres, how far portals and boxes may be
/// misplaced. All portals are open at first.
#[pyclass(module = "visibility", frozen)]
pub(crate) struct Cells {
    cells: Arc<RwLock<SceneCells>>,
}

fn failed<G>(_: G) -> PyErr {
    PyRuntimeError::new_err("an earlier call with these cells failed inside: make them anew")
}

impl Cells {
    fn of(cells: SceneCells) -> Self {
        Self { cells: Arc::new(RwLock::new(cells)) }
    }

    /// Returns a shared handle to the cells, for a pipeline.
    pub(crate) fn shared(&self) -> Arc<RwLock<SceneCells>> {
        self.cells.clone()
    }

    fn read(&self) -> PyResult<RwLockReadGuard<'_, SceneCells>> {
        self.cells.read().map_err(failed)
    }

    /// Waits without the interpreter's lock: a culling thread may hold the cells.
    fn write<R: Send>(
        &self,
        py: Python<'_>,
        change: impl FnOnce(RwLockWriteGuard<'_, SceneCells>) -> PyResult<R> + Send,
    ) -> PyResult<R> {
        py.detach(|| change(self.cells.write().map_err(failed)?))
    }

    /// Makes cells of the triangles of a scene's occluders.
    pub(crate) fn of_scene(scene: &Scene, py: Python<'_>, max_cells: usize) -> PyResult<Self> {
        py.detach(|| {
            let (mut polygons, mut one_sided) = (Vec::new(), Vec::new());
            for id in scene.ids() {
                let object = level_object(scene, id).map(|(object, _)| object);
                let Some(object) = object.filter(|object| object.occluder) else { continue };
                for corners in scene.triangles(id).unwrap_or_default().iter() {
                    // In `f64`: what nearly cancels in `f32` would close a gap that cullers see through.
                    let world = corners.map(|corner| scene.origin() + corner.as_dvec3());
                    // A triangle without area covers nothing.
                    let Ok(polygon) = ConvexPolygon::new(world) else { continue };
                    polygons.push(polygon);
                    one_sided.push(object.one_sided);
                }
            }
            let settings = PolygonSettings::default().with_max_cells(max_cells).with_one_sided(&one_sided);
            let settings = settings.with_origin(scene.origin());
            let made = from_polygons(&polygons, &settings).map_err(|error| refused("scene", error))?;
            made.into_scene_cells().map(Self::of).map_err(|error| refused("scene", error))
        })
    }
}

/// Accepts planes for each of `count` cells.
fn planes_of(value: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<Vec<Plane>>> {
    let mut all = Vec::with_capacity(count);
    for item in value.try_iter()? {
        let planes = arrays::floats("planes", &item?, &[Axis::Any("k"), Axis::Is(4)])?;
        let plane = |&[a, b, c, d]: &[f64; 4]| Plane::new(DVec3::new(a, b, c), d);
        all.push(planes.groups::<4>().iter().map(plane).collect());
    }
    if all.len() != count {
        return Err(refused("planes", format!("expected {count} arrays, as boxes, got {}", all.len())));
    }
    Ok(all)
}

/// Number of cells, corners of portals, and the two cells of each.
type Portals<'py> = (usize, Vec<Bound<'py, PyArray2<f64>>>, Bound<'py, PyArray2<u32>>);

/// Makes arrays of the corners of portals.
fn corners_of<'py>(graph: &CellGraph, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
    let corners = graph.portals().iter().map(|portal| {
        let corners: Vec<[f64; 3]> = portal.polygon().vertices().iter().map(|v| v.to_array()).collect();
        PyArray1::from_slice(py, corners.as_flattened()).reshape([corners.len(), 3])
    });
    corners.collect()
}

/// Makes an array of the two cells of each portal.
fn joins_of<'py>(graph: &CellGraph, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
    let joins: Vec<[u32; 2]> =
        graph.portals().iter().map(|portal| portal.cells().map(|cell| cell.0)).collect();
    PyArray1::from_slice(py, joins.as_flattened()).reshape([joins.len(), 2])
}

#[pymethods]
impl Cells {
    #[new]
    #[pyo3(signature = (boxes, portals, joins, *, planes=None, tolerance=1e-6))]
    fn new(
        boxes: &Bound<'_, PyAny>,
        portals: &Bound<'_, PyAny>,
        joins: &Bound<'_, PyAny>,
        planes: Option<&Bound<'_, PyAny>>,
        tolerance: f64,
    ) -> PyResult<Self> {
        let boxes = arrays::floats("boxes", boxes, BOXES)?;
        let boxes = boxes.groups::<6>();
        let mut planes = match planes {
            Some(planes) => planes_of(planes, boxes.len())?.into_iter(),
            None => Vec::new().into_iter(),
        };
        let volume = |&[a, b, c, d, e, f]: &[f64; 6]| Viewcell {
            min: DVec3::new(a, b, c),
            max: DVec3::new(d, e, f),
            planes: planes.next().unwrap_or_default(),
        };
        let volumes: Vec<Viewcell> = boxes.iter().map(volume).collect();
        let joins = arrays::indices("joins", joins, &[Axis::Any("m"), Axis::Is(2)])?;
        let mut made = Vec::new();
        for (item, cells) in portals.try_iter()?.zip(joins.groups::<2>()) {
            let corners = arrays::floats("portals", &item?, POINTS_3D)?;
            let corners: Vec<DVec3> = corners.groups::<3>().iter().map(|&corner| corner.into()).collect();
            made.push((corners, cells.map(CellId)));
        }
        let (count, expected) = (portals.len()?, joins.groups::<2>().len());
        if count != expected {
            return Err(refused("joins", format!("expected ({count}, 2), as portals, got ({expected}, 2)")));
        }
        let graph =
            CellGraph::from_vertices(volumes.len(), made).map_err(|error| refused("portals", error))?;
        let cells = SceneCells::new(graph, Viewcells::new(volumes), tolerance)
            .map_err(|error| refused("boxes", error))?;
        Ok(Self::of(cells))
    }

    /// Reads a map compiler's portal file, .prt of the Quake family: the number of cells, the portals and the
    /// joins, as for Cells, in the unit of the map. The file does not say where the cells are: give their
    /// boxes, and planes where they are no boxes.
    #[staticmethod]
    fn read_prt<'py>(py: Python<'py>, text: &str) -> PyResult<Portals<'py>> {
        let graph = prt::read(text).map_err(|error| refused("text", error))?.graph;
        Ok((graph.cell_count(), corners_of(&graph, py)?, joins_of(&graph, py)?))
    }

    /// Number of cells.
    fn __len__(&self) -> PyResult<usize> {
        Ok(self.read()?.graph().cell_count())
    }

    fn __repr__(&self) -> PyResult<String> {
        let cells = self.read()?;
        Ok(format!("Cells({} cells, {} portals)", cells.graph().cell_count(), cells.graph().portals().len()))
    }

    /// Corners of each portal, a list of m arrays (k, 3) float64, counter-clockwise as seen from its second
    /// cell.
    #[getter]
    fn portals<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        corners_of(self.read()?.graph(), py)
    }

    /// The two cells of each portal: uint32 (m, 2).
    #[getter]
    fn joins<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        joins_of(self.read()?.graph(), py)
    }

    /// In which cell each point is, -1 for none: int64 (n,) for points (n, 3) float64.
    fn locate<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let points = arrays::floats("points", points, POINTS_3D)?;
        let points = points.groups::<3>();
        let found = py.detach(|| {
            let cells = self.read()?;
            let cell = |&point: &[f64; 3]| {
                cells.viewcells().locate(point.into()).map_or(-1, |cell| i64::from(cell.0))
            };
            Ok::<_, PyErr>(points.iter().map(cell).collect::<Vec<i64>>())
        })?;
        Ok(PyArray1::from_vec(py, found))
    }

    /// Opens or closes a portal, such as a door.
    fn set_open(&self, py: Python<'_>, portal: u32, open: bool) -> PyResult<()> {
        self.write(py, |mut cells| {
            cells.set_open(PortalId(portal), open).map_err(|error| refused("portal", error))
        })
    }

    /// Sets in which directions an open portal is seen through: "both", "forward", from the first of its
    /// cells into the second, or "backward".
    fn set_passage(&self, py: Python<'_>, portal: u32, passage: &str) -> PyResult<()> {
        let passage = match passage {
            "both" => Passage::BothWays,
            "forward" => Passage::Forward,
            "backward" => Passage::Backward,
            other => return Err(refused("passage", format!("{other:?} is not both, forward or backward"))),
        };
        self.write(py, |mut cells| {
            cells.set_passage(PortalId(portal), passage).map_err(|error| refused("portal", error))
        })
    }

    /// Whether each cell may see another from anywhere inside, through the portals that are open now: bool
    /// (n,) for the numbers of cells a and b, (n,) each. True where undecided.
    fn sees<'py>(
        &self,
        py: Python<'py>,
        a: &Bound<'py, PyAny>,
        b: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let (a, b) = (arrays::indices("a", a, LIST)?, arrays::indices("b", b, LIST)?);
        let (a, b) = (a.numbers(), b.numbers());
        if a.len() != b.len() {
            return Err(refused("b", format!("expected ({},), as a, got ({},)", a.len(), b.len())));
        }
        let seen = py.detach(|| {
            let cells = self.read()?;
            let count = cells.graph().cell_count();
            for (name, numbers) in [("a", a), ("b", b)] {
                if let Some(cell) = numbers.iter().find(|&&cell| cell as usize >= count) {
                    return Err(refused(name, format!("{cell} is beyond the {count} cells")));
                }
            }
            let pairs = a.iter().zip(b).map(|(&from, &to)| cells.can_see_now(CellId(from), CellId(to)));
            Ok(pairs.collect::<Vec<bool>>())
        })?;
        Ok(PyArray1::from_vec(py, seen))
    }

    /// Finds which cells may see which from anywhere inside with all portals open, and limits cull and sees
    /// to that from now on. Takes from milliseconds to minutes.
    fn bake(&self, py: Python<'_>) -> PyResult<()> {
        py.detach(|| {
            let graph = self.read()?.graph().clone();
            let baker = CellBaker::new(&graph, BakerSettings::default());
            let outcome = Bake::new(baker.map_err(|error| refused("cells", error))?).run();
            let pvs = outcome.matrix.to_pvs(&graph).map_err(|error| refused("cells", error))?;
            let mut cells = self.cells.write().map_err(failed)?;
            *cells = cells.clone().with_pvs(pvs).map_err(|error| refused("cells", error))?;
            Ok(())
        })
    }
}
