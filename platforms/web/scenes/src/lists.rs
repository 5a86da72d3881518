//! Lists of a scene's numbers, and the functions by which JavaScript reads them.

use crate::source::SceneSource;
use std::cell::RefCell;
use visibility_portals::SceneCells;

/// Scene as lists of numbers. JavaScript refers to a list by its index, from 0, in the order of the fields.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct Lists {
    /// Number of triangles of each object.
    pub triangle_counts: Vec<u32>,
    /// Triangles of all objects: 9 coordinates each.
    pub triangles: Vec<f32>,
    /// Number of keys of each walk.
    pub key_counts: Vec<u32>,
    /// Keys of all walks: eye and target, 6 coordinates each.
    pub keys: Vec<f64>,
    /// Near plane distance, then the vertical field of view of each walk in radians.
    pub lenses: Vec<f64>,
    /// Minimum and maximum corner of each cell; empty for a scene without cells.
    pub cells: Vec<f64>,
    /// The two cells that each portal joins.
    pub portal_cells: Vec<u32>,
    /// Number of vertices of each portal.
    pub portal_vertex_counts: Vec<u32>,
    /// Vertices of all portals: 3 coordinates each.
    pub portal_vertices: Vec<f64>,
    /// Tolerance for positions of cells and portals, in metres; empty for a scene without cells.
    pub tolerance: Vec<f64>,
}

impl Lists {
    /// Lists a scene. If it has cells for doorways, the cells with doorways are listed.
    pub fn new(scene: &SceneSource) -> Self {
        let mut lists = Self { lenses: vec![f64::from(scene.near)], ..Self::default() };
        for object in &scene.objects {
            lists.triangle_counts.push(object.triangles.len() as u32);
            lists.triangles.extend(object.triangles.iter().flatten().flat_map(|corner| corner.to_array()));
        }
        for walk in &scene.walks {
            lists.key_counts.push(walk.keys.len() as u32);
            lists
                .keys
                .extend(walk.keys.iter().flat_map(|key| [key.eye, key.target]).flat_map(|p| p.to_array()));
            lists.lenses.push(f64::from(walk.fov_y_degrees).to_radians());
        }
        let Some(cells) = &scene.cells else { return lists };
        let cells = cells.with_doorways.as_deref().unwrap_or(cells);
        lists.tolerance.push(SceneCells::usual_tolerance(&cells.viewcells));
        for cell in cells.viewcells.cells() {
            lists.cells.extend([cell.min, cell.max].iter().flat_map(|corner| corner.to_array()));
        }
        for portal in cells.graph.portals() {
            let vertices = portal.polygon().vertices();
            lists.portal_cells.extend(portal.cells().map(|cell| cell.0));
            lists.portal_vertex_counts.push(vertices.len() as u32);
            lists.portal_vertices.extend(vertices.iter().flat_map(|vertex| vertex.to_array()));
        }
        lists
    }

    /// Returns the pointer to a list's numbers, and their count.
    fn numbers(&self, list: u32) -> (*const u8, usize) {
        fn of<T>(list: &[T]) -> (*const u8, usize) {
            (list.as_ptr().cast(), list.len())
        }
        match list {
            0 => of(&self.triangle_counts),
            1 => of(&self.triangles),
            2 => of(&self.key_counts),
            3 => of(&self.keys),
            4 => of(&self.lenses),
            5 => of(&self.cells),
            6 => of(&self.portal_cells),
            7 => of(&self.portal_vertex_counts),
            8 => of(&self.portal_vertices),
            9 => of(&self.tolerance),
            _ => of::<u8>(&[]),
        }
    }
}

thread_local! {
    static LISTS: RefCell<Lists> = RefCell::default();
}

/// Makes a scene: 0 the city of furnished houses, of `a` by `b` blocks; 1 the office, of `a` floors with `b`
/// rooms on each side; 2 London, of `a` by `b` blocks. Returns whether there is such a scene.
#[unsafe(no_mangle)]
pub extern "C" fn scenes_make(scene: u32, a: u32, b: u32) -> bool {
    let name = ["plpcity", "office", "london"].get(scene as usize);
    let made = name.and_then(|name| crate::built_in(&format!("{name}:{a},{b}")).ok());
    LISTS.set(made.as_ref().map(Lists::new).unwrap_or_default());
    made.is_some()
}

/// Returns the address of the first number of a list.
#[unsafe(no_mangle)]
pub extern "C" fn scenes_numbers(list: u32) -> *const u8 {
    LISTS.with_borrow(|lists| lists.numbers(list).0)
}

/// Returns the number of numbers in a list.
#[unsafe(no_mangle)]
pub extern "C" fn scenes_length(list: u32) -> usize {
    LISTS.with_borrow(|lists| lists.numbers(list).1)
}
