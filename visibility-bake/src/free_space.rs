//! Viewcells where a camera can be: a flood of free space from given points, the free space along walks, and
//! boxes above walkable triangles.
//!
//! The flood walks voxels. The diagonal of a voxel is less than the radius that the camera keeps free around
//! itself. A voxel that touches a solid surface therefore contains no position of the camera: each of its
//! points is nearer to that surface than the radius. A path of the camera is in voxels that touch no surface,
//! and it passes from one to the next through their common face: where it passes through an edge or a corner,
//! it touches the voxels beside it too, so they are free as well. A flood of free voxels through faces thus
//! reaches every position that a path of the camera reaches.
//!
//! A box of the grid that crosses a wall holds positions on both sides of it, and in it. What is seen from
//! there would count as visible. So each connected part of the free voxels that are reached in a box has a
//! viewcell of its own: the part's bounding box, grown to the next solid surface.

use crate::grid::{Grid, GridError};
use std::collections::{BTreeSet, HashMap, VecDeque};
use visibility_core::Scene;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::scene::Triangle;

/// How a camera moves, for [`Grid::free`] and [`Grid::above`].
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CameraRange {
    /// Least distance in metres that the camera keeps from every solid surface.
    pub radius: f64,
    /// Least and greatest height in metres of the camera above a surface that is less steep than 60 degrees,
    /// on the vertical line through the camera. `None` for a camera that flies.
    pub heights: Option<[f64; 2]>,
    /// Direction that points up. The axis nearest to it counts.
    pub up: DVec3,
}

impl Default for CameraRange {
    /// A person: a quarter of a metre to every surface, 1 to 3 m above what is below, z up.
    fn default() -> Self {
        Self { radius: 0.25, heights: Some([1.0, 3.0]), up: DVec3::Z }
    }
}

impl CameraRange {
    /// Returns the axis that points up or down, and the range of the camera's coordinate on it, relative to
    /// the surface.
    fn vertical(&self) -> (usize, Option<[f64; 2]>) {
        let up = self.up.abs();
        let axis = (0..2).fold(2, |most, axis| if up[axis] > up[most] { axis } else { most });
        let sign = self.up[axis] >= 0.0;
        (axis, self.heights.map(|[low, high]| if sign { [low, high] } else { [-high, -low] }))
    }
}

/// Most voxels of a viewcell.
const CELL_VOXELS: usize = 1 << 21;

/// Most voxels of a flood: two gigabytes of them.
const ALL_VOXELS: u64 = 1 << 33;

/// Part of the extent of a voxel by which it counts as larger, for rounding.
const SLACK: f64 = 1e-6;

impl Grid {
    /// Returns the viewcells that a camera reaches from some points, those of the points first, then in the
    /// order in which the flood reaches them: boxes of the grid, cut off at solid surfaces that the flood
    /// does not pass within the box. Solid are the triangles of the objects flagged as occluders. The flood
    /// does not leave the box from `min` to `max`. A point where the camera cannot be is replaced by the
    /// nearest place in the same box of the grid where it can be, and ignored if there is none.
    ///
    /// No viewcell is left out that holds a position that the camera can reach in the box without coming
    /// nearer to a solid surface than the [radius](CameraRange::radius) and without leaving the
    /// [heights](CameraRange::heights). Time and memory are in proportion to the volume flooded, divided by
    /// the cube of the radius.
    ///
    /// # Errors
    /// [`GridError::Radius`] if the radius is not positive, or less than about a hundredth of a viewcell;
    /// [`GridError::TooMany`].
    ///
    /// ```
    /// use visibility_bake::{CameraRange, Grid};
    /// use visibility_core::{glam::{DVec3, Vec3}, Aabb, Object, Scene};
    /// // A floor of 12 m, and a wall across it.
    /// let floor = [[0.0, 0.0, 0.0], [12.0, 0.0, 0.0], [12.0, 2.0, 0.0], [0.0, 2.0, 0.0]];
    /// let wall = [[7.0, 0.0, 0.0], [7.0, 2.0, 0.0], [7.0, 2.0, 4.0], [7.0, 0.0, 4.0]];
    /// let mut scene = Scene::new();
    /// for corners in [floor, wall] {
    ///     let [a, b, c, d] = corners.map(Vec3::from_array);
    ///     let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points([a, b, c, d])) });
    ///     scene.set_triangles(id, [[a, b, c], [a, c, d]])?;
    /// }
    /// let grid = Grid::new(DVec3::ZERO, DVec3::new(2.0, 2.0, 2.0))?;
    /// let eye = DVec3::new(1.0, 1.0, 1.7);
    /// let box_of_all = (DVec3::ZERO, DVec3::new(12.0, 2.0, 4.0));
    /// let cells = grid.free(&scene, &[eye], &CameraRange::default(), box_of_all.0, box_of_all.1)?;
    /// // Four along the floor up to the wall, on each of two storeys of viewcells.
    /// assert_eq!(cells.len(), 8);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn free(
        &self,
        scene: &Scene,
        from: &[DVec3],
        camera: &CameraRange,
        min: DVec3,
        max: DVec3,
    ) -> Result<Vec<Viewcell>, GridError> {
        if !min.is_finite() || !max.is_finite() {
            return Err(GridError::TooMany);
        }
        if !min.cmple(max).all() {
            return Ok(Vec::new());
        }
        let mut flood = Flood::new(self, scene, camera, [min, max])?;
        for &point in from {
            if min.cmple(point).all() && point.cmple(max).all() {
                flood.start(point)?;
            }
        }
        flood.run()?;
        let mut all = Vec::new();
        for &place in &flood.found {
            let Some(voxels) = flood.cells.get(&place) else { continue };
            let mut reached = voxels.reached.clone();
            let seeds = 0..flood.counts.iter().product();
            let parts = seeds.filter_map(|seed| take_part(&mut reached, flood.counts, seed));
            flood.add_viewcells(place, parts, &mut all)?;
        }
        Ok(all)
    }

    /// Returns the viewcells that walks in straight lines from point to point pass, those of the first walk
    /// first: boxes of the grid, cut off at solid surfaces that separate the rest of a box from the walks'
    /// parts in it. Solid are the triangles of the objects flagged as occluders. All of a box that is within
    /// the [radius](CameraRange::radius) of the walk's part in it stays, also where the walk passes through
    /// a solid. The heights of the camera do not count, and a radius below a 40th of the longest side of a
    /// box counts as that.
    ///
    /// # Errors
    /// [`GridError::TooMany`].
    ///
    /// ```
    /// use visibility_bake::{CameraRange, Grid};
    /// use visibility_core::{glam::{DVec3, Vec3}, Aabb, Object, Scene};
    /// // A wall across the box of the grid.
    /// let ends = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)];
    /// let [a, b, c, d] = ends.map(|(y, z)| Vec3::new(3.0, y, z));
    /// let mut scene = Scene::new();
    /// let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points([a, b, c, d])) });
    /// scene.set_triangles(id, [[a, b, c], [a, c, d]])?;
    /// let grid = Grid::new(DVec3::ZERO, DVec3::splat(4.0))?;
    /// let cells = grid.along_free(&scene, [&[DVec3::ONE][..]], &CameraRange::default())?;
    /// assert!(cells[0].min == DVec3::ZERO && (2.99..3.0).contains(&cells[0].max.x));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn along_free<'a>(
        &self,
        scene: &Scene,
        walks: impl IntoIterator<Item = &'a [DVec3]>,
        camera: &CameraRange,
    ) -> Result<Vec<Viewcell>, GridError> {
        let least = self.size.max_element() / 40.0;
        let camera = CameraRange { radius: camera.radius.max(least), heights: None, ..*camera };
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let walks: Vec<&[DVec3]> = walks.into_iter().collect();
        for &point in walks.iter().copied().flatten() {
            (min, max) = (min.min(point), max.max(point));
        }
        if walks.iter().all(|walk| walk.is_empty()) {
            return Ok(Vec::new());
        }
        let flood = Flood::new(self, scene, &camera, [min, max])?;
        let fine = Grid::new(self.origin, flood.edge())?;
        // By place of a box, the voxels in it that walks pass.
        let mut passed: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
        let mut places = Vec::new();
        for walk in walks {
            for place in self.passed(walk)? {
                passed.entry(place).or_insert_with(|| {
                    places.push(place);
                    Vec::new()
                });
            }
            for voxel in fine.passed(walk)? {
                let counts = flood.counts.map(|count| count as i64);
                let at = |axis: usize| voxel[axis].rem_euclid(counts[axis]);
                let place = [0, 1, 2].map(|axis| voxel[axis].div_euclid(counts[axis]));
                // A voxel of no such box touches one from outside.
                if let Some(voxels) = passed.get_mut(&place) {
                    voxels.push((at(0) + counts[0] * (at(1) + counts[1] * at(2))) as usize);
                }
            }
        }
        // Number of voxels on each axis within the radius.
        let around = (camera.radius / flood.edge()).ceil().to_array().map(|count| count as usize);
        let mut all = Vec::new();
        for place in places {
            let seeds = &passed[&place];
            if seeds.is_empty() {
                all.push(self.cell(place));
                continue;
            }
            let mut free = flood.voxelize(place).open;
            // Where a walk passes, the camera is.
            seeds.iter().for_each(|&seed| free[seed / 64] |= 1 << (seed % 64));
            let (mut left, mut parts) = (seeds.clone(), Vec::new());
            while let Some(mut part) = left.first().and_then(|&seed| take_part(&mut free, flood.counts, seed))
            {
                let (others, own) = left.into_iter().partition(|&seed| bit(&free, seed));
                let own: Vec<usize> = own;
                own.into_iter().for_each(|seed| part.add(split(seed, flood.counts), around, flood.counts));
                left = others;
                parts.push(part);
            }
            flood.add_viewcells(place, parts, &mut all)?;
        }
        Ok(all)
    }

    /// Returns the viewcells that hold positions of a camera above walkable triangles, such as those of a
    /// navigation mesh, given in world space: at the [heights](CameraRange::heights) above a point of one of
    /// them (0 for a camera that flies). In ascending order of z, y and x. A triangle that is not finite
    /// counts for nothing.
    ///
    /// # Errors
    /// [`GridError::TooMany`].
    ///
    /// ```
    /// use visibility_bake::{CameraRange, Grid};
    /// use visibility_core::glam::DVec3;
    /// let grid = Grid::new(DVec3::ZERO, DVec3::new(4.0, 4.0, 2.0))?;
    /// let floor = [[0.5, 0.5, 0.1], [7.5, 0.5, 0.1], [0.5, 1.5, 0.1]].map(DVec3::from_array);
    /// // Two viewcells on the floor, and two above them.
    /// assert_eq!(grid.above(&[floor], &CameraRange::default())?.len(), 4);
    /// # Ok::<(), visibility_bake::GridError>(())
    /// ```
    pub fn above(&self, walkable: &[[DVec3; 3]], camera: &CameraRange) -> Result<Vec<Viewcell>, GridError> {
        let (up, heights) = camera.vertical();
        let heights = heights.unwrap_or([0.0; 2]);
        let axes = [(up + 1) % 3, (up + 2) % 3];
        let slack = SLACK * self.size.min_element();
        let mut found = BTreeSet::new();
        for triangle in walkable {
            if !triangle.iter().all(|p| p.is_finite()) {
                continue;
            }
            let (min, max) = extent(triangle);
            let (first, last) = (self.place(min - slack)?, self.place(max + slack)?);
            let limits = axes.map(|axis| [first[axis], last[axis]]);
            let columns = limits.map(|[first, last]| last.abs_diff(first) + 1);
            if columns[0].saturating_mul(columns[1]) > Self::LIMIT as u64 {
                return Err(GridError::TooMany);
            }
            let local = triangle.map(|p| p - self.origin);
            let step = axes.map(|axis| self.size[axis]);
            let mut overflows = false;
            for_each_column(local, axes, up, step, limits, slack, |column, [low, high]| {
                let step = self.size[up];
                let first = ((low + heights[0] - slack) / step).floor();
                let last = ((high + heights[1] + slack) / step).floor();
                if !(last - first < Self::LIMIT as f64 && first.abs().max(last.abs()) < 4.5e15) {
                    overflows = true;
                    return;
                }
                for level in first as i64..=last as i64 {
                    let mut place = [0; 3];
                    (place[axes[0]], place[axes[1]], place[up]) = (column[0], column[1], level);
                    let [x, y, z] = place;
                    found.insert([z, y, x]);
                }
            });
            if overflows || found.len() > Self::LIMIT {
                return Err(GridError::TooMany);
            }
        }
        Ok(found.into_iter().map(|[z, y, x]| self.cell([x, y, z])).collect())
    }
}

/// A flood of free voxels, viewcell by viewcell.
struct Flood<'a> {
    grid: &'a Grid,
    camera: CameraRange,
    /// Places in the grid of the first and last viewcell on each axis.
    limits: [[i64; 3]; 2],
    /// Number of voxels of a viewcell on each axis.
    counts: [usize; 3],
    /// Solid triangles relative to the grid's origin, and whether the camera can be above it.
    solids: Vec<([DVec3; 3], bool)>,
    /// Indices of the solid triangles that may touch a column of viewcells.
    columns: HashMap<[i64; 2], Vec<u32>>,
    cells: HashMap<[i64; 3], Voxels>,
    /// Viewcells with voxels to go on from.
    waiting: VecDeque<[i64; 3]>,
    /// Viewcells reached, in order.
    found: Vec<[i64; 3]>,
}

/// The voxels of a viewcell, along x first.
struct Voxels {
    /// A bit for each voxel where the camera can be and that the flood has not reached.
    open: Vec<u64>,
    /// A bit for each voxel that the flood has reached.
    reached: Vec<u64>,
    /// Voxels to go on from, which may be reached by now.
    entered: Vec<u32>,
    is_found: bool,
}

impl<'a> Flood<'a> {
    fn new(
        grid: &'a Grid,
        scene: &Scene,
        camera: &CameraRange,
        [min, max]: [DVec3; 2],
    ) -> Result<Self, GridError> {
        // A voxel's diagonal is a little less than the radius.
        let edge = camera.radius * 0.99 / 3f64.sqrt();
        let counts = (grid.size / edge).ceil();
        if !(camera.radius > 0.0 && counts.element_product() <= CELL_VOXELS as f64) {
            return Err(GridError::Radius);
        }
        let counts = counts.to_array().map(|count| count.max(1.0) as usize);
        let (first, mut last) = (grid.place(min)?, grid.place(max)?);
        for axis in 0..3 {
            // A viewcell that only touches the box from outside is not of it.
            let is_outside = grid.face(axis, last[axis]) == max[axis];
            last[axis] = (last[axis] - i64::from(is_outside)).max(first[axis]);
        }
        let limits = [first, last];
        let (up, heights) = camera.vertical();
        let axes = [(up + 1) % 3, (up + 2) % 3];
        let slack = SLACK * grid.size.min_element();
        let mut solids = Vec::new();
        let mut columns: HashMap<[i64; 2], Vec<u32>> = HashMap::new();
        let mut entries = 0;
        for id in scene.ids().filter(|&id| scene.object(id).is_ok_and(|object| object.occluder)) {
            for triangle in scene.triangles(id).unwrap_or_default() {
                if !triangle.iter().all(|p| p.is_finite()) {
                    continue;
                }
                let local = triangle.map(|p| p.as_dvec3() + (scene.origin() - grid.origin));
                let (low, high) = extent(&local);
                let beyond = |axis: &usize| {
                    let (first, last) = (limits[0][*axis] as f64, limits[1][*axis] as f64 + 1.0);
                    high[*axis] + slack < first * grid.size[*axis]
                        || last * grid.size[*axis] < low[*axis] - slack
                };
                if axes.iter().any(beyond) {
                    continue;
                }
                let limits = axes.map(|axis| {
                    let place = |x: f64| (x / grid.size[axis]).floor();
                    // Places beyond the limits do not matter, so saturated ones do no harm.
                    let first = (place(low[axis] - slack) as i64).max(limits[0][axis]);
                    [first, (place(high[axis] + slack) as i64).min(limits[1][axis])]
                });
                let number = solids.len() as u32;
                solids.push((local, heights.is_some() && is_floor(triangle, up)));
                let step = axes.map(|axis| grid.size[axis]);
                for_each_column(local, axes, up, step, limits, slack, |column, _| {
                    columns.entry(column).or_default().push(number);
                    entries += 1;
                });
                if entries > 16 * Grid::LIMIT || solids.len() >= u32::MAX as usize {
                    return Err(GridError::TooMany);
                }
            }
        }
        Ok(Self {
            grid,
            camera: *camera,
            limits,
            counts,
            solids,
            columns,
            cells: HashMap::new(),
            waiting: VecDeque::new(),
            found: Vec::new(),
        })
    }

    /// Returns the size of a voxel.
    fn edge(&self) -> DVec3 {
        self.grid.size / DVec3::from_array(self.counts.map(|count| count as f64))
    }

    /// Adds the viewcells of the parts of a box, without those that are within another.
    fn add_viewcells(
        &self,
        place: [i64; 3],
        parts: impl IntoIterator<Item = Part>,
        all: &mut Vec<Viewcell>,
    ) -> Result<(), GridError> {
        let mut found: Vec<Viewcell> = Vec::new();
        for part in parts {
            let cell = self.grown(place, &part);
            let is_within = |a: &Viewcell, b: &Viewcell| b.min.cmple(a.min).all() && a.max.cmple(b.max).all();
            if !found.iter().any(|other| is_within(&cell, other)) {
                found.retain(|other| !is_within(other, &cell));
                found.push(cell);
            }
        }
        all.extend(found);
        if all.len() > Grid::LIMIT { Err(GridError::TooMany) } else { Ok(()) }
    }

    /// Returns the box around a part, grown on one side after another to the next solid surface or the side
    /// of the grid's box.
    fn grown(&self, place: [i64; 3], part: &Part) -> Viewcell {
        let whole = self.grid.cell(place);
        let (start, end) = (whole.min - self.grid.origin, whole.max - self.grid.origin);
        let (mut low, mut high, edge) = (start, end, self.edge());
        for axis in 0..3 {
            if part.first[axis] > 0 {
                low[axis] = start[axis] + part.first[axis] as f64 * edge[axis];
            }
            if part.last[axis] + 1 < self.counts[axis] {
                high[axis] = start[axis] + (part.last[axis] + 1) as f64 * edge[axis];
            }
        }
        let (up, _) = self.camera.vertical();
        let near = self.columns.get(&[(up + 1) % 3, (up + 2) % 3].map(|axis| place[axis]));
        // The viewcell ends a little before the surface, or its face would be in the surface. Half of that is
        // for rounding.
        let gap = edge.min_element() * 0.01;
        let slack = gap * 0.5;
        for side in 0..6 {
            let (axis, is_upper) = (side / 2, side % 2 == 1);
            let (from, to) = if is_upper { (high[axis], end[axis]) } else { (start[axis], low[axis]) };
            if from >= to {
                continue;
            }
            let mut limit = if is_upper { to } else { from };
            for &number in near.into_iter().flatten() {
                let (triangle, _) = self.solids[number as usize];
                let (least, most) = extent(&triangle);
                let meets = |k: usize, a: f64, b: f64| least[k] <= b + slack && a - slack <= most[k];
                if !(meets(axis, from, to) && (0..3).all(|k| k == axis || meets(k, low[k], high[k]))) {
                    continue;
                }
                let beyond = (0..3).fold(Polygon::new(triangle), |polygon, k| {
                    let ends = if k == axis { [from, to] } else { [low[k], high[k]] };
                    polygon.clipped(k, [ends[0] - slack, ends[1] + slack])
                });
                if !beyond.is_empty() {
                    let [least, most] = beyond.range(axis);
                    limit = if is_upper { limit.min(least - gap) } else { limit.max(most + gap) };
                }
            }
            if is_upper {
                high[axis] = limit.max(from);
            } else {
                low[axis] = limit.min(to);
            }
        }
        // Sides of the grid's box stay the same to the last bit.
        let (origin, is_start, is_end) = (self.grid.origin, low.cmpeq(start), high.cmpeq(end));
        let min = DVec3::select(is_start, whole.min, origin + low);
        Viewcell::from_box(min, DVec3::select(is_end, whole.max, origin + high))
    }

    /// Enters the free voxel nearest to a point, among those of the point's viewcell.
    fn start(&mut self, point: DVec3) -> Result<(), GridError> {
        let mut place = self.grid.place(point)?;
        (0..3).for_each(|axis| place[axis] = place[axis].min(self.limits[1][axis]));
        let (counts, edge) = (self.counts, self.edge());
        let corner = self.grid.cell(place).min;
        let voxels = self.voxels(place)?;
        let distance = |&voxel: &usize| {
            let at = DVec3::from_array(split(voxel, counts).map(|at| at as f64 + 0.5));
            (corner + at * edge).distance_squared(point)
        };
        let all = 0..counts.iter().product();
        let is_free = |&voxel: &usize| bit(&voxels.open, voxel) || bit(&voxels.reached, voxel);
        let nearest = all.filter(is_free).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        if let Some(voxel) = nearest {
            self.enter(place, [voxel as u32])?;
        }
        Ok(())
    }

    fn run(&mut self) -> Result<(), GridError> {
        while let Some(place) = self.waiting.pop_front() {
            self.spread(place)?;
        }
        Ok(())
    }

    /// Notes voxels of a viewcell to go on from.
    fn enter(&mut self, place: [i64; 3], entered: impl IntoIterator<Item = u32>) -> Result<(), GridError> {
        let voxels = self.voxels(place)?;
        let is_waiting = !voxels.entered.is_empty();
        let open = |voxel: &u32| bit(&voxels.open, *voxel as usize);
        voxels.entered.extend(entered.into_iter().filter(open));
        if !is_waiting && !voxels.entered.is_empty() {
            if !voxels.is_found {
                voxels.is_found = true;
                self.found.push(place);
            }
            self.waiting.push_back(place);
        }
        Ok(())
    }

    /// Floods a viewcell from the voxels entered, and enters its neighbours.
    fn spread(&mut self, place: [i64; 3]) -> Result<(), GridError> {
        let counts = self.counts;
        let Some(voxels) = self.cells.get_mut(&place) else { return Ok(()) };
        let mut beyond: [Vec<u32>; 6] = Default::default();
        let entered = std::mem::take(&mut voxels.entered);
        take_connected(&mut voxels.open, counts, entered, |at, last| {
            let run = join(at, counts)..=join([last, at[1], at[2]], counts);
            run.for_each(|voxel| voxels.reached[voxel / 64] |= 1 << (voxel % 64));
            if at[0] == 0 {
                beyond[0].push(join([counts[0] - 1, at[1], at[2]], counts) as u32);
            }
            if last + 1 == counts[0] {
                beyond[1].push(join([0, at[1], at[2]], counts) as u32);
            }
            for axis in 1..3 {
                let mut add = |side: usize, place: usize| {
                    let mut other = at;
                    other[axis] = place;
                    let first = join(other, counts) as u32;
                    beyond[axis * 2 + side].extend(first..=first + (last - at[0]) as u32);
                };
                if at[axis] == 0 {
                    add(0, counts[axis] - 1);
                }
                if at[axis] + 1 == counts[axis] {
                    add(1, 0);
                }
            }
        });
        for (side, entered) in beyond.into_iter().enumerate() {
            let (axis, mut other) = (side / 2, place);
            other[axis] += if side % 2 == 0 { -1 } else { 1 };
            let is_within = self.limits[0][axis] <= other[axis] && other[axis] <= self.limits[1][axis];
            if is_within && !entered.is_empty() {
                self.enter(other, entered)?;
            }
        }
        Ok(())
    }

    /// Returns the voxels of a viewcell, made when it is first asked for.
    fn voxels(&mut self, place: [i64; 3]) -> Result<&mut Voxels, GridError> {
        let count: usize = self.counts.iter().product();
        if !self.cells.contains_key(&place) {
            if (self.cells.len() as u64 + 1).saturating_mul(count as u64) > ALL_VOXELS
                || self.cells.len() >= Grid::LIMIT
            {
                return Err(GridError::TooMany);
            }
            let voxels = self.voxelize(place);
            self.cells.insert(place, voxels);
        }
        self.cells.get_mut(&place).ok_or(GridError::TooMany)
    }

    /// Finds the voxels of a viewcell where the camera can be.
    fn voxelize(&self, place: [i64; 3]) -> Voxels {
        let count: usize = self.counts.iter().product();
        let (up, heights) = self.camera.vertical();
        let axes = [(up + 1) % 3, (up + 2) % 3];
        let strides = [1, self.counts[0], self.counts[0] * self.counts[1]];
        let size = self.grid.size;
        let edge = self.edge();
        let slack = SLACK * edge.min_element();
        let corner = DVec3::from_array(place.map(|place| place as f64)) * size;
        let mut solid = vec![0u64; count.div_ceil(64)];
        // Voxels at the right height above a surface: all for a camera that flies.
        let mut stood = vec![if heights.is_some() { 0 } else { u64::MAX }; count.div_ceil(64)];
        let step = axes.map(|axis| edge[axis]);
        let limits = axes.map(|axis| [0, self.counts[axis] as i64 - 1]);
        let levels = self.counts[up] as f64 - 1.0;
        let mark = |bits: &mut [u64], column: [i64; 2], first: f64, last: f64| {
            let base = column[0] as usize * strides[axes[0]] + column[1] as usize * strides[axes[1]];
            if first <= levels && last >= 0.0 {
                for level in first.max(0.0) as usize..=last.min(levels) as usize {
                    let voxel = base + level * strides[up];
                    bits[voxel / 64] |= 1 << (voxel % 64);
                }
            }
        };
        let near = self.columns.get(&axes.map(|axis| place[axis]));
        for &number in near.into_iter().flatten() {
            let (triangle, is_floor) = self.solids[number as usize];
            let local = triangle.map(|p| p - corner);
            let (low, high) = extent(&local);
            let meets = |offsets: [f64; 2]| {
                low[up] + offsets[0] <= size[up] + slack && high[up] + offsets[1] >= -slack
            };
            let stands = heights.filter(|&heights| is_floor && meets(heights));
            if !meets([0.0; 2]) && stands.is_none() {
                continue;
            }
            for_each_column(local, axes, up, step, limits, slack, |column, [low, high]| {
                let level = |height: f64| (height / edge[up]).floor();
                mark(&mut solid, column, level(low - slack), level(high + slack));
                if let Some(heights) = stands {
                    mark(
                        &mut stood,
                        column,
                        level(low + heights[0] - slack),
                        level(high + heights[1] + slack),
                    );
                }
            });
        }
        let open = solid.iter().zip(&stood).map(|(solid, stood)| stood & !solid).collect();
        Voxels { open, reached: vec![0; count.div_ceil(64)], entered: Vec::new(), is_found: false }
    }
}

/// The box around connected voxels of a viewcell: the first and last on each axis.
struct Part {
    first: [usize; 3],
    last: [usize; 3],
}

impl Part {
    /// Adds a voxel, and so many around it, as far as they are in the viewcell.
    fn add(&mut self, at: [usize; 3], around: [usize; 3], counts: [usize; 3]) {
        for axis in 0..3 {
            self.first[axis] = self.first[axis].min(at[axis].saturating_sub(around[axis]));
            let last = at[axis].saturating_add(around[axis]).min(counts[axis] - 1);
            self.last[axis] = self.last[axis].max(last);
        }
    }
}

/// Removes the voxels that are connected with one of a set through faces, and returns the box around them.
/// `None` if that voxel is not in the set.
fn take_part(set: &mut [u64], counts: [usize; 3], seed: usize) -> Option<Part> {
    if !bit(set, seed) {
        return None;
    }
    let mut part = Part { first: split(seed, counts), last: split(seed, counts) };
    take_connected(set, counts, vec![seed as u32], |at, last| {
        part.add(at, [0; 3], counts);
        part.add([last, at[1], at[2]], [0; 3], counts);
    });
    Some(part)
}

/// Removes the voxels of a set that are connected through faces with those of a list. Calls `each` with runs
/// of them along x: the place of the first, and the x of the last.
fn take_connected(
    set: &mut [u64],
    counts: [usize; 3],
    mut list: Vec<u32>,
    mut each: impl FnMut([usize; 3], usize),
) {
    let strides = [1, counts[0], counts[0] * counts[1]];
    while let Some(voxel) = list.pop() {
        if !bit(set, voxel as usize) {
            continue;
        }
        let at = split(voxel as usize, counts);
        let row = voxel as usize - at[0];
        let (mut first, mut last) = (at[0], at[0]);
        while first > 0 && bit(set, row + first - 1) {
            first -= 1;
        }
        while last + 1 < counts[0] && bit(set, row + last + 1) {
            last += 1;
        }
        (row + first..=row + last).for_each(|voxel| set[voxel / 64] &= !(1 << (voxel % 64)));
        each([first, at[1], at[2]], last);
        for axis in 1..3 {
            let lower = (at[axis] > 0).then(|| row - strides[axis]);
            let upper = (at[axis] + 1 < counts[axis]).then(|| row + strides[axis]);
            for row in lower.into_iter().chain(upper) {
                let is_start = |&x: &usize| bit(set, row + x) && (x == first || !bit(set, row + x - 1));
                list.extend((first..=last).filter(is_start).map(|x| (row + x) as u32));
            }
        }
    }
}

/// Returns whether a triangle is less steep than 60 degrees. A triangle without area is not.
fn is_floor(triangle: &Triangle, up: usize) -> bool {
    let [a, b, c]: [DVec3; 3] = triangle.map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a);
    normal[up].abs() > 0.5 * normal.length()
}

fn extent(triangle: &[DVec3; 3]) -> (DVec3, DVec3) {
    let [a, b, c] = *triangle;
    (a.min(b).min(c), a.max(b).max(c))
}

fn bit(bits: &[u64], at: usize) -> bool {
    bits[at / 64] >> (at % 64) & 1 == 1
}

/// Returns the place of a voxel on each axis.
fn split(voxel: usize, counts: [usize; 3]) -> [usize; 3] {
    [voxel % counts[0], voxel / counts[0] % counts[1], voxel / counts[0] / counts[1]]
}

/// Returns the number of the voxel at a place.
fn join(at: [usize; 3], counts: [usize; 3]) -> usize {
    at[0] + counts[0] * (at[1] + counts[1] * at[2])
}

/// Calls `each` with the columns of a grid that a triangle touches, and with the least and greatest
/// coordinate of the triangle on the axis `up` in that column. Columns are `step` wide on the two `axes`, the
/// first begins at 0, and each counts as larger by `slack` on all sides. Those outside `limits` (first and
/// last) are left out.
fn for_each_column(
    triangle: [DVec3; 3],
    axes: [usize; 2],
    up: usize,
    step: [f64; 2],
    limits: [[i64; 2]; 2],
    slack: f64,
    mut each: impl FnMut([i64; 2], [f64; 2]),
) {
    let whole = Polygon::new(triangle);
    let range = |polygon: &Polygon, side: usize| {
        let [least, most] = polygon.range(axes[side]);
        let place = |x: f64| (x / step[side]).floor();
        let first = place(least - slack).max(limits[side][0] as f64) as i64;
        first..=place(most + slack).min(limits[side][1] as f64) as i64
    };
    let between = |side: usize, place: i64| {
        [place as f64 * step[side] - slack, (place + 1) as f64 * step[side] + slack]
    };
    for row in range(&whole, 1) {
        let strip = whole.clipped(axes[1], between(1, row));
        if strip.is_empty() {
            continue;
        }
        for column in range(&strip, 0) {
            let piece = strip.clipped(axes[0], between(0, column));
            if !piece.is_empty() {
                each([column, row], piece.range(up));
            }
        }
    }
}

/// Most corners of a [`Polygon`]: three, and half as many again for each of the six sides of a box, which is
/// more than rounding can add.
const CORNERS: usize = 28;

/// A triangle clipped by sides of a box.
struct Polygon {
    corners: [DVec3; CORNERS],
    count: usize,
}

impl Polygon {
    fn new([a, b, c]: [DVec3; 3]) -> Self {
        let mut polygon = Self { corners: [DVec3::ZERO; CORNERS], count: 0 };
        [a, b, c].into_iter().for_each(|corner| polygon.push(corner));
        polygon
    }

    fn push(&mut self, corner: DVec3) {
        if let Some(place) = self.corners.get_mut(self.count) {
            *place = corner;
            self.count += 1;
        }
    }

    fn corners(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns the least and greatest coordinate on an axis.
    fn range(&self, axis: usize) -> [f64; 2] {
        self.corners()
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], p| [low.min(p[axis]), high.max(p[axis])])
    }

    /// Returns the part between two coordinates on an axis.
    fn clipped(&self, axis: usize, [low, high]: [f64; 2]) -> Self {
        self.clipped_by(axis, 1.0, low).clipped_by(axis, -1.0, -high)
    }

    /// Returns the part where the coordinate on an axis, times `sign`, is at least `limit`.
    fn clipped_by(&self, axis: usize, sign: f64, limit: f64) -> Self {
        let inside = |p: DVec3| p[axis] * sign - limit;
        let mut part = Self { corners: [DVec3::ZERO; CORNERS], count: 0 };
        let Some(&last) = self.corners().last() else { return part };
        let (mut p, mut a) = (last, inside(last));
        for &q in self.corners() {
            let b = inside(q);
            if (a < 0.0) != (b < 0.0) {
                part.push(p + (q - p) * (a / (a - b)));
            }
            if b >= 0.0 {
                part.push(q);
            }
            (p, a) = (q, b);
        }
        part
    }
}
