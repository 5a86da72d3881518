//! Floor plans.

use crate::arrays::{self, Axis, POINTS_2D, points_array};
use crate::error::{named, refused};
use crate::unseen::UnseenRegion;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use std::sync::Arc;
use visibility_2d::cdt::{
    self, Guards, Opacity, PlanError, PlanView, RegionVisibility, ShortestPath, Visibility, VisibilityGraph,
    Wall,
};

/// Walls on a plan, triangulated: who sees what among them, exactly.
///
/// walls: (n, 2, 2) float64: n segments, their two ends, x and y in metres. They may cross, touch and
///     overlap.
/// margin: how far the plan extends around the walls, in metres; None for a tenth of their extent.
#[pyclass(module = "visibility", subclass)]
pub(crate) struct Plan {
    plan: Arc<cdt::Plan>,
}

impl Plan {
    /// Looks around from the eye of a view.
    fn look(&self, py: Python<'_>, view: PlanView) -> PyResult<Visibility> {
        let (plan, mut answer) = (self.plan.as_ref(), Visibility::new());
        py.detach(|| plan.look(&view, &mut answer)).map_err(named("eye"))?;
        Ok(answer)
    }

    /// Runs a query on two lists of points of the same length.
    fn pairs<'py, R: Send>(
        &self,
        py: Python<'py>,
        [(name_a, a), (name_b, b)]: [(&'static str, &Bound<'py, PyAny>); 2],
        query: impl Fn(&cdt::Plan, [f64; 2], [f64; 2]) -> Result<R, PlanError> + Sync,
    ) -> PyResult<Vec<R>> {
        let (a, b) = (arrays::floats(name_a, a, POINTS_2D)?, arrays::floats(name_b, b, POINTS_2D)?);
        let (a, b) = (a.groups::<2>(), b.groups::<2>());
        if a.len() != b.len() {
            return Err(refused(
                name_b,
                format!("expected ({}, 2), as {name_a}, got ({}, 2)", a.len(), b.len()),
            ));
        }
        let plan = self.plan.as_ref();
        let found = py.detach(|| {
            a.iter()
                .zip(b)
                .enumerate()
                .map(|(number, (a, b))| query(plan, *a, *b).map_err(|error| (number, error)))
                .collect::<Result<Vec<R>, _>>()
        });
        found.map_err(|(number, error)| {
            let name = if matches!(error, PlanError::Coordinate { index: 0, .. }) { name_a } else { name_b };
            refused(name, format!("row {number}: {error}"))
        })
    }
}

/// Makes a view of the arguments that queries share.
fn view_of(eye: [f64; 2], range: f64, sector: Option<[[f64; 2]; 2]>, through: u32) -> PlanView {
    let view = PlanView::new(eye).with_range(range).with_through(through);
    match sector {
        Some([right, left]) => view.with_sector(right, left),
        None => view,
    }
}

#[pymethods]
impl Plan {
    #[new]
    #[pyo3(signature = (walls, *, margin=None))]
    fn new(py: Python<'_>, walls: &Bound<'_, PyAny>, margin: Option<f64>) -> PyResult<Self> {
        let walls = arrays::floats("walls", walls, &[Axis::Any("n"), Axis::Is(2), Axis::Is(2)])?;
        let ends = walls.groups::<4>();
        let made = py.detach(|| {
            let walls: Vec<Wall> = ends.iter().map(|&[a, b, c, d]| Wall::new([a, b], [c, d])).collect();
            match margin {
                Some(margin) => cdt::Plan::from_walls(&walls, margin),
                None => cdt::Plan::new(&walls),
            }
        });
        Ok(Self { plan: Arc::new(made.map_err(named("walls"))?) })
    }

    fn __len__(&self) -> usize {
        self.plan.walls().len()
    }

    fn __repr__(&self) -> String {
        format!("Plan({} walls)", self.plan.walls().len())
    }

    /// (n, 2, 2) float64: the walls' ends as given, in metres.
    #[getter]
    fn walls<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let ends: Vec<[[f64; 2]; 2]> = self.plan.walls().iter().map(|wall| wall.ends).collect();
        PyArray1::from_slice(py, ends.as_flattened().as_flattened()).reshape([ends.len(), 2, 2])
    }

    /// (2, 2) float64: least and greatest corner of the plan with its margin, in metres.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        points_array(py, &self.plan.bounds())
    }

    /// Lets a wall block sight ("opaque"), let it through ("clear"), or through from its right alone
    /// ("one_way"): doors and windows. Other objects made from the plan keep it as it was.
    fn set_opacity(&mut self, wall: u32, opacity: &str) -> PyResult<()> {
        let opacity = match opacity {
            "opaque" => Opacity::Opaque,
            "clear" => Opacity::Clear,
            "one_way" => Opacity::OneWay,
            other => return Err(refused("opacity", format!("{other:?} is not opaque, clear or one_way"))),
        };
        Arc::make_mut(&mut self.plan).set_opacity(wall, opacity).map_err(named("wall"))
    }

    /// Corners of what an eye sees, counter-clockwise: (k, 2) float64, in metres.
    ///
    /// eye: x and y. range: greatest distance in metres; arcs become chords. sector: two points; the eye sees
    /// from the direction of the first counter-clockwise to that of the second. through: opaque walls that
    /// sight passes. The eye is a corner if it does not see all around.
    #[pyo3(signature = (eye, *, range=f64::INFINITY, sector=None, through=0))]
    fn visibility_polygon<'py>(
        &self,
        py: Python<'py>,
        eye: [f64; 2],
        range: f64,
        sector: Option<[[f64; 2]; 2]>,
        through: u32,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let answer = self.look(py, view_of(eye, range, sector, through))?;
        points_array(py, answer.polygon())
    }

    /// Numbers of the walls that an eye sees: uint32 (k,), ascending. Arguments as of visibility_polygon.
    #[pyo3(signature = (eye, *, range=f64::INFINITY, sector=None, through=0))]
    fn visible_walls<'py>(
        &self,
        py: Python<'py>,
        eye: [f64; 2],
        range: f64,
        sector: Option<[[f64; 2]; 2]>,
        through: u32,
    ) -> PyResult<Bound<'py, PyArray1<u32>>> {
        let answer = self.look(py, view_of(eye, range, sector, through))?;
        let mut walls = answer.walls().to_vec();
        walls.sort_unstable();
        Ok(PyArray1::from_vec(py, walls))
    }

    /// Areas that many eyes see, in square metres: float64 (n,) for eyes (n, 2) float64.
    #[pyo3(signature = (eyes, *, range=f64::INFINITY))]
    fn visible_areas<'py>(
        &self,
        py: Python<'py>,
        eyes: &Bound<'py, PyAny>,
        range: f64,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let eyes = arrays::floats("eyes", eyes, POINTS_2D)?;
        let (plan, eyes) = (self.plan.as_ref(), eyes.groups::<2>());
        let areas = py.detach(|| {
            let mut answer = Visibility::new();
            eyes.iter()
                .enumerate()
                .map(|(row, &eye)| {
                    let looked = plan.look(&PlanView::new(eye).with_range(range), &mut answer);
                    looked.map(|()| answer.area()).map_err(|error| (row, error))
                })
                .collect::<Result<Vec<f64>, _>>()
        });
        let areas = areas.map_err(|(row, error)| refused("eyes", format!("row {row}: {error}")))?;
        Ok(PyArray1::from_vec(py, areas))
    }

    /// Whether the segments from each point of a to that of b meet no opaque wall: bool (n,) for a and b (n,
    /// 2) float64. Exact.
    fn sees<'py>(
        &self,
        py: Python<'py>,
        a: &Bound<'py, PyAny>,
        b: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let found = self.pairs(py, [("a", a), ("b", b)], |plan, a, b| plan.sees(a, b))?;
        Ok(PyArray1::from_vec(py, found))
    }

    /// Where rays from eyes through points first meet a wall, (n, 2) float64, and its number, int64 (n,):
    /// -1 for rays that leave the plan, whose point is on its border. NaN for a ray without a direction.
    #[expect(clippy::type_complexity, reason = "a pair of arrays")]
    fn rays<'py>(
        &self,
        py: Python<'py>,
        eyes: &Bound<'py, PyAny>,
        through: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<i64>>)> {
        let found = self.pairs(py, [("eyes", eyes), ("through", through)], |plan, eye, through| {
            let hit = plan.ray(eye, through)?;
            Ok(hit.map_or(([f64::NAN; 2], -1), |hit| (hit.point, hit.wall.map_or(-1, i64::from))))
        })?;
        let (points, walls): (Vec<[f64; 2]>, Vec<i64>) = py.detach(|| found.into_iter().unzip());
        Ok((points_array(py, &points)?, PyArray1::from_vec(py, walls)))
    }

    /// What can be seen from somewhere in the convex hull of points: numbers of walls uint32 (k,), ascending,
    /// and the triangles of the plan that are seen at least in part, (m, 3, 2) float64, in metres.
    ///
    /// points: (n, 2) float64. Sight from within the region, on its side of walls that cross it, is exact.
    #[expect(clippy::type_complexity, reason = "a pair of arrays")]
    fn seen_from_region<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyArray1<u32>>, Bound<'py, PyArray3<f64>>)> {
        let points = arrays::floats("points", points, POINTS_2D)?;
        let (plan, points) = (self.plan.as_ref(), points.groups::<2>());
        let mut answer = RegionVisibility::new();
        py.detach(|| plan.look_from_region(points, &mut answer)).map_err(named("points"))?;
        let mut walls = answer.walls().to_vec();
        walls.sort_unstable();
        let corners: Vec<[[f64; 2]; 3]> =
            answer.triangles().iter().filter_map(|&triangle| plan.triangle(triangle)).collect();
        let triangles = PyArray1::from_slice(py, corners.as_flattened().as_flattened());
        Ok((PyArray1::from_vec(py, walls), triangles.reshape([corners.len(), 3, 2])?))
    }

    /// Few points that together see all that can be reached from starts: an art gallery's guards.
    ///
    /// Returns guards (g, 2) and witnesses (w, 2), float64: no point off the walls sees two witnesses, so
    /// that at least w guards are needed. starts: (n, 2) float64, a point in each hall.
    #[expect(clippy::type_complexity, reason = "a pair of arrays")]
    fn guards<'py>(
        &self,
        py: Python<'py>,
        starts: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)> {
        let starts = arrays::floats("starts", starts, POINTS_2D)?;
        let (plan, starts) = (self.plan.as_ref(), starts.groups::<2>());
        let guards = py.detach(|| Guards::new(plan, starts)).map_err(named("starts"))?;
        Ok((points_array(py, guards.positions())?, points_array(py, guards.witnesses())?))
    }

    /// All that can be reached from starts, (n, 2) float64, to be looked at from eye after eye.
    fn unseen(&self, py: Python<'_>, starts: &Bound<'_, PyAny>) -> PyResult<UnseenRegion> {
        UnseenRegion::reachable(py, &self.plan, starts)
    }

    /// The shortest path from one point to another around walls: (k, 2) float64, in metres, or None if there
    /// is none.
    fn shortest_path<'py>(
        &self,
        py: Python<'py>,
        start: [f64; 2],
        end: [f64; 2],
    ) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let plan = self.plan.as_ref();
        let mut path = ShortestPath::new();
        py.detach(|| VisibilityGraph::new(plan)?.find_path(plan, start, end, &mut path))
            .map_err(named("start or end"))?;
        path.length().map(|_| points_array(py, path.points())).transpose()
    }
}
