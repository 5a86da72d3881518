//! Numbers of a finished bake, as text for people and as JSON: objects found, gaps, and the time of each
//! method.

use super::level::Level;
use serde::Serialize;
use visibility_bake::{BakedSet, CellSandwich, MethodTimes};

/// Results of a bake in numbers.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Name of the scene.
    pub scene: String,
    /// Number of objects.
    pub objects: usize,
    /// Number of viewcells that are done with each stage: group sweep, own sweep, rays, proofs of boxes,
    /// proofs of triangles. A skipped stage counts as done. 0 if shards were assembled.
    pub stages: [usize; 5],
    /// Number of viewcells left without a search because too many triangles of instances would have to be
    /// copied. 0 if shards were assembled.
    pub too_large: usize,
    /// Number of finished viewcells in which the time limit cut a stage short. 0 if shards were assembled.
    pub cut: usize,
    /// Number of cameras of the walks.
    pub cameras: usize,
    /// Number of cameras inside a viewcell. For a camera outside all viewcells, everything counts as visible.
    pub cameras_inside: usize,
    /// Duration of the bake in seconds, without loading the scene.
    pub seconds: f64,
    /// Seconds by method, summed over all threads. 0 if shards were assembled.
    pub methods: Seconds,
    /// Whether the bake finished all viewcells.
    pub complete: bool,
    /// Triangles neither seen nor proven hidden, as a share of the reported triangles, both summed over all
    /// viewcells.
    pub gap: f64,
    /// Version of the level, in hexadecimal digits. A game whose scene has only boxes passes it to the loader
    /// of the file.
    pub version: String,
    /// Gap that was asked for: the greatest share of the reported triangles neither seen nor proven hidden.
    pub asked_gap: f64,
    /// Number of viewcells whose gap exceeds the one asked for.
    pub viewcells_over_gap: usize,
    /// Size in bytes of the file that a game loads, viewcells included.
    pub bytes: usize,
    /// Memory in bytes of the visible sets in a game, without the viewcells.
    pub memory: usize,
    /// Size in bytes of the visible sets as plain bits, one for each pair of a viewcell and an object.
    pub plain_bytes: usize,
    /// Results of each viewcell.
    pub viewcells: Vec<Cell>,
}

/// Seconds by method.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Seconds {
    /// Seconds of sweeps by extended projections.
    pub sweep: f64,
    /// Seconds of the rays.
    pub rays: f64,
    /// Seconds of the search for proofs, failed searches included.
    pub proofs: f64,
}

impl From<&MethodTimes> for Seconds {
    fn from(times: &MethodTimes) -> Self {
        let [sweep, rays, proofs] = [times.sweep, times.rays, times.proofs].map(|time| time.as_secs_f64());
        Self { sweep, rays, proofs }
    }
}

/// Results of one viewcell.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// Box of the viewcell in metres: minimum x, y, z, maximum x, y, z.
    pub cell: [f64; 6],
    /// Number of objects that a line of sight reaches.
    pub seen: usize,
    /// Number of objects neither seen nor proven hidden. They count as visible.
    pub open: usize,
    /// Number of objects that the sweep found hidden.
    pub swept: u32,
    /// Number of objects with a proof that they are hidden.
    pub proven: u32,
    /// Number of rays plus number of nodes of the search for proofs.
    pub steps: u64,
    /// Seconds that each method took. 0 if the viewcell comes from a shard.
    pub seconds: Seconds,
    /// Number of triangles of the reported objects, seen or open.
    pub triangles: f64,
    /// Open triangles (neither seen nor proven hidden) as a share of the reported triangles.
    pub gap: f64,
}

impl Report {
    /// Makes the report of a bake. `times` has the times of each viewcell, or is empty if they are unknown.
    /// `seconds` is the time of the whole bake. `complete` tells whether the bake finished all viewcells.
    pub fn new(
        level: &Level,
        cells: &[CellSandwich],
        times: &[MethodTimes],
        set: &BakedSet,
        seconds: f64,
        complete: bool,
    ) -> Self {
        let mut sums = [0.0; 2];
        let by_method = times.iter().map(Seconds::from).chain(std::iter::repeat(Seconds::default()));
        let viewcells = level.viewcells.cells().iter().zip(cells).zip(by_method);
        let viewcells = viewcells.map(|((cell, found), seconds)| {
            let costs = [cost(level, &found.open), cost(level, &found.seen)];
            sums = [sums[0] + costs[0], sums[1] + costs[1]];
            let ([a, b, c], [d, e, f]) = (cell.min.to_array(), cell.max.to_array());
            Cell {
                cell: [a, b, c, d, e, f],
                seen: found.seen.len(),
                open: found.open.len(),
                swept: found.swept,
                proven: found.proven,
                steps: found.steps,
                seconds,
                triangles: costs[0] + costs[1],
                gap: gap(costs),
            }
        });
        let viewcells: Vec<Cell> = viewcells.collect();
        let (asked_gap, [cameras, cameras_inside]) = (level.gap(), level.cameras());
        Self {
            version: format!("{:016x}", set.version()),
            asked_gap,
            viewcells_over_gap: viewcells.iter().filter(|cell| cell.gap > asked_gap).count(),
            scene: level.name.clone(),
            objects: level.object_count(),
            stages: [0; 5],
            too_large: 0,
            cut: 0,
            cameras,
            cameras_inside,
            seconds,
            methods: Seconds::from(&times.iter().sum()),
            complete,
            gap: gap(sums),
            bytes: set.to_bytes().len(),
            memory: set.set_bytes(),
            plain_bytes: cells.len() * level.object_count().div_ceil(8),
            viewcells,
        }
    }

    /// Returns the report as a few lines of text.
    pub fn text(&self) -> String {
        let mean = |of: fn(&Cell) -> f64| {
            self.viewcells.iter().map(of).sum::<f64>() / self.viewcells.len().max(1) as f64
        };
        let worst = self.viewcells.iter().max_by(|a, b| a.gap.total_cmp(&b.gap));
        let mut text = format!(
            "{}: {} viewcells of {} objects in {:.1} s{}\n\
             a viewcell sees {:.1} objects for certain, {:.1} are open, {:.1} swept away, {:.1} proven hidden\n\
             {:.0} triangles reported in the mean, {:.0} at most\n\
             gap {:.2} % of the triangles; a file of {} bytes, {:.0} % of plain bits\n",
            self.scene,
            self.viewcells.len(),
            self.objects,
            self.seconds,
            if self.complete { "" } else { ", not finished: what was not worked on counts as visible" },
            mean(|cell| cell.seen as f64),
            mean(|cell| cell.open as f64),
            mean(|cell| f64::from(cell.swept)),
            mean(|cell| f64::from(cell.proven)),
            mean(|cell| cell.triangles),
            self.viewcells.iter().fold(0.0, |most: f64, cell| most.max(cell.triangles)),
            self.gap * 100.0,
            self.bytes,
            100.0 * self.bytes as f64 / self.plain_bytes.max(1) as f64,
        );
        if self.cameras > 0 {
            let (inside, all) = (self.cameras_inside, self.cameras);
            let then = if inside < all {
                "; the others see everything: --cameras, --from or --over cover more"
            } else {
                ""
            };
            text += &format!("{inside} of {all} cameras are inside viewcells{then}\n");
        }
        let Seconds { sweep, rays, proofs } = self.methods;
        if sweep + rays + proofs > 0.0 {
            text +=
                &format!("seconds of all threads: sweep {sweep:.1}, rays {rays:.1}, proofs {proofs:.1}\n");
        }
        if self.stages != [0; 5] {
            let [groups, swept, seen, boxes, triangles] = self.stages;
            text += &format!(
                "viewcells done with: {groups} sweep of their group, {swept} sweep of their own, {seen} rays, \
                 {boxes} proofs of boxes, {triangles} of triangles\n"
            );
        }
        if self.too_large > 0 {
            text += &format!(
                "{} viewcells are swept alone: too many triangles of instances are left to be copied for rays \
                 and proofs\n",
                self.too_large
            );
        }
        if let Some(worst) = worst.filter(|worst| worst.gap > 0.0) {
            let [a, b, c, d, e, f] = worst.cell;
            text += &format!("worst: {:.1} % from {a},{b},{c} to {d},{e},{f}\n", worst.gap * 100.0);
        }
        if self.viewcells_over_gap > 0 {
            let then = if self.complete && self.cut > 0 {
                "the time cut searches short: more --time closes more"
            } else if self.complete {
                "all methods are through: smaller viewcells (--size) close more, and more --time nothing"
            } else if self.stages[4] + self.too_large < self.viewcells.len() {
                "the time was over: the same command goes on"
            } else {
                "more is hidden from smaller viewcells (--size)"
            };
            text += &format!(
                "{} of {} viewcells miss the gap of {:.2} %; what is open there counts as visible; {then}\n",
                self.viewcells_over_gap,
                self.viewcells.len(),
                self.asked_gap * 100.0,
            );
        }
        text + &format!("version of the level: {}\n", self.version)
    }
}

/// Returns the total number of triangles of the objects with these indices.
fn cost(level: &Level, objects: &[u32]) -> f64 {
    objects.iter().filter_map(|&index| level.cost(index)).map(f64::from).sum()
}

/// Returns the share of open triangles in all reported triangles, open or seen. 0 if none is open.
fn gap([open, seen]: [f64; 2]) -> f64 {
    if open > 0.0 { open / (open + seen) } else { 0.0 }
}
