//! `OnlineCells`: viewcells between which movers may see each other, by sets that an `OnlinePvs` makes.

use crate::OnlinePvs;
use alloc::vec::Vec;
use visibility_core::bits::Bits;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_core::stamp::Stamp;
use visibility_core::who_sees::{Reach, SightCells};
use visibility_core::{Aabb, Object, ObjectId, Scene};

/// Viewcells that are objects of a scene, so that each set of an [`OnlinePvs`] tells which of the viewcells
/// are hidden. With it, [`WhoSees`](visibility_core::who_sees::WhoSees) finds which movers see each other
/// while walls appear, move and vanish.
///
/// Each mover is given by its [`Reach`], the region in which it may be. While the reach is not wholly in the
/// viewcells, the mover counts as seen by all movers. While no box of the `OnlinePvs` holds the whole reach,
/// the mover counts as seeing all movers. So call [`step`](OnlinePvs::step) with the middles of the reaches,
/// make the [margin](OnlinePvs::with_margin) at least half of the largest extent of a reach, and the boxes
/// more than two margins wide. Sets hold for all view directions, so movers at one place share them.
///
/// ```
/// use visibility_core::glam::{Affine3A, DVec3};
/// use visibility_core::pvs::{Viewcell, Viewcells};
/// use visibility_core::who_sees::{Reach, WhoSees};
/// use visibility_core::{Aabb, Object, OccluderMesh, Scene};
/// use visibility_region::{OnlineCells, OnlinePvs};
/// let wall = Aabb::from_arrays([5.0, -9.0, -9.0], [5.2, 9.0, 9.0]);
/// let mut scene = Scene::new();
/// let id = scene.insert(Object { occluder: true, ..Object::new(wall) });
/// let mesh = scene.add_mesh(OccluderMesh::cuboid(&wall)?);
/// scene.set_mesh(id, mesh, Affine3A::IDENTITY)?;
/// let cell = |x: i32, y: i32| {
///     let min = DVec3::new(f64::from(2 * x), f64::from(2 * y), 0.0);
///     Viewcell::from_box(min, min + DVec3::splat(2.0))
/// };
/// let cells = (0..10).flat_map(|x| (-1..1).map(move |y| cell(x, y)));
/// let cells = OnlineCells::new(&mut scene, Viewcells::new(cells));
/// // Bodies 1.8 m high, which may be anywhere within .01 s at 6 m/s: reaches of less than 2 m.
/// let mut online = OnlinePvs::new(DVec3::splat(2.5), DVec3::new(4.0, 4.0, 2.5))?.with_margin(1.0);
/// // Each tick: the movers, and as much work as there is time for.
/// let at = |x: f64| Reach::new(DVec3::new(x, 0.0, 0.1), DVec3::new(x + 0.5, 0.5, 1.9)).within(0.01, 6.0);
/// let movers = [at(1.0), at(16.0)];
/// let places = movers.map(|mover| (mover.min + mover.max) * 0.5);
/// while online.step(&scene, &places, 1000).is_some() {}
/// let mut who = WhoSees::new();
/// who.look(&mut cells.with(&scene, &mut online), &movers, &movers);
/// assert!(!who.sees(0, 1) && who.sees(0, 0));
/// scene.remove(id)?;
/// who.look(&mut cells.with(&scene, &mut online), &movers, &movers);
/// assert!(who.sees(0, 1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct OnlineCells {
    viewcells: Viewcells,
    /// Object that represents each viewcell, in the order of the viewcells.
    objects: Vec<ObjectId>,
    stamp: Stamp,
}

impl OnlineCells {
    /// Adds an object to the scene for the box of each viewcell. The objects hide nothing and are on no
    /// layer, so no view shows them.
    pub fn new(scene: &mut Scene, viewcells: Viewcells) -> Self {
        let origin = scene.origin();
        let object = |cell: &Viewcell| Object { layers: 0, ..Object::new(bounds(cell, origin)) };
        let objects = scene.insert_batch(viewcells.cells().iter().map(object));
        Self { viewcells, objects, stamp: Stamp::new() }
    }

    /// Returns the objects that represent the viewcells, in their order. After the scene's origin has moved,
    /// they need new bounds, as all objects do.
    pub fn objects(&self) -> &[ObjectId] {
        &self.objects
    }

    /// Returns these viewcells as the level in which [`WhoSees`](visibility_core::who_sees::WhoSees) looks,
    /// with the sets that `online` has made for `scene`. All movers see one another if an object that
    /// represents a viewcell is not in the scene, or has other bounds there.
    pub fn with<'a>(&'a self, scene: &'a Scene, online: &'a mut OnlinePvs) -> impl SightCells + 'a {
        let mut objects = self.viewcells.cells().iter().zip(&self.objects);
        let origin = scene.origin();
        let is_current = objects.all(|(cell, &id)| scene.bounds(id) == Ok(bounds(cell, origin)));
        CellsNow { cells: self, scene, online, is_current }
    }
}

/// Returns the bounds of the object that represents a viewcell, relative to the scene's origin.
fn bounds(cell: &Viewcell, origin: DVec3) -> Aabb {
    Aabb::from_world(cell.min, cell.max, origin)
}

/// [`OnlineCells`] combined with a scene and its sets.
struct CellsNow<'a> {
    cells: &'a OnlineCells,
    scene: &'a Scene,
    online: &'a mut OnlinePvs,
    is_current: bool,
}

impl SightCells for CellsNow<'_> {
    fn cell_count(&self) -> usize {
        self.cells.objects.len()
    }

    fn stamp(&self) -> Stamp {
        self.cells.stamp
    }

    fn cells_of(&mut self, reach: &Reach, cells: &mut Vec<u32>) -> bool {
        let [low, high] = reach.bounds();
        self.cells.viewcells.cover(low, high, cells)
    }

    fn seen_from(&mut self, reach: &Reach, seen: &mut Bits) -> bool {
        let [low, high] = reach.bounds();
        if !self.is_current {
            return false;
        }
        let Some(hidden) = self.online.hidden_from(self.scene, low, high) else { return false };
        for (cell, object) in self.cells.objects.iter().enumerate() {
            if !hidden.contains(object.index()) {
                seen.insert(cell);
            }
        }
        true
    }
}
