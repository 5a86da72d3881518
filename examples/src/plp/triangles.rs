//! World whose objects are single triangles, and the exact answer for its views.

use crate::walkthrough::World;
use visibility_core::{
    Aabb, Object, ObjectId, Scene, View, geometry::Containment, scene::Triangle, view::Eye,
};
use visibility_measure::{DrawnObject, ItemBuffer, MeasureError};

/// World in which every triangle is an object, with the views of the world that it was made from.
pub struct TriangleWorld {
    /// Name of the world that the triangles come from.
    pub name: String,
    /// Triangles relative to the scene's origin, in the order of the original world's objects.
    pub triangles: Vec<Triangle>,
    /// For each triangle, whether things behind it are visible through it.
    pub see_through: Vec<bool>,
    /// Scene with one object per triangle; triangle `i` has index `i`.
    pub scene: Scene,
    /// Object ids of the triangles, by triangle index.
    pub ids: Vec<ObjectId>,
    /// Views of all frames.
    pub views: Vec<View>,
}

/// Triangles that one view sees, and all triangles that face the eye in its frustum.
pub struct Seen {
    /// Visible triangles as (triangle index, number of pixels), by ascending index.
    pub visible: Vec<(u32, u32)>,
    /// Number of all pixels of the picture, with or without a visible triangle.
    pub pixels: u32,
    /// Indices, ascending, of the triangles that face the eye and whose bounds meet the view frustum.
    pub candidates: Vec<u32>,
}

impl TriangleWorld {
    /// Makes every triangle of a world an object of its own. The scene has the origin of the world's.
    pub fn new(world: &World) -> Self {
        let triangles: Vec<Triangle> =
            world.source.objects.iter().flat_map(|object| object.triangles.view()).collect();
        let objects = world.source.objects.iter();
        let see_through =
            objects.flat_map(|object| object.triangles.iter().map(|_| object.see_through)).collect();
        let mut scene = Scene::new();
        scene.set_origin(world.origin()).expect("the world's origin is finite");
        let ids = scene.insert_batch(triangles.iter().map(|t| Object::new(Aabb::from_points(*t))));
        for (&id, triangle) in ids.iter().zip(&triangles) {
            scene.set_triangles(id, [*triangle]).expect("the object was just inserted");
        }
        let (name, views) = (world.source.name.clone(), world.views.clone());
        Self { name, triangles, see_through, scene, ids, views }
    }

    /// Computes the exact answer for a view when only triangles that face the eye are drawn. `buffer` is
    /// overwritten.
    ///
    /// # Errors
    ///
    /// Returns [`MeasureError`] when the world has too many triangles to number.
    pub fn see(&self, view: &View, buffer: &mut ItemBuffer) -> Result<Seen, MeasureError> {
        let origin = self.scene.origin();
        let (eye, planes) = (view.eye(origin), view.planes(origin));
        let in_view = |triangle: &Triangle| {
            let bounds = Aabb::from_points(*triangle);
            planes.as_slice().iter().all(|p| p.plane.classify_aabb(&bounds) != Containment::Outside)
        };
        let is_candidate = |&i: &u32| {
            let triangle = &self.triangles[i as usize];
            faces(triangle, &eye) && in_view(triangle)
        };
        let candidates: Vec<u32> = (0..self.triangles.len() as u32).filter(is_candidate).collect();
        let seen = buffer.draw(view, origin, candidates.iter().map(|&i| self.item(i)))?;
        // Each object is one triangle. If triangles tie in a pixel, the one shown in the picture counts.
        let pixels = seen.triangle_pixels().iter();
        let visible = pixels.map(|&(drawn, pixels)| (candidates[drawn as usize], pixels)).collect();
        Ok(Seen { visible, pixels: buffer.width() * buffer.height(), candidates })
    }

    /// Returns a triangle in the form that the item buffer takes. Its key is its index.
    pub fn item(&self, index: u32) -> DrawnObject<'_> {
        let triangle = std::slice::from_ref(&self.triangles[index as usize]);
        let see_through = self.see_through[index as usize];
        DrawnObject { see_through, ..DrawnObject::from((index, triangle)) }
    }

    /// Returns the triangles `candidates` sorted by the distance of their centroids from the eye, nearest
    /// first, ties by index. In a parallel view the distance is along the view direction.
    pub fn by_distance(&self, view: &View, candidates: &[u32]) -> Vec<u32> {
        let eye = view.eye(self.scene.origin());
        let distance = |i: u32| {
            let [a, b, c] = self.triangles[i as usize].map(|p| p.as_dvec3());
            match eye {
                Eye::Point(eye) => ((a + b + c) / 3.0).distance_squared(eye),
                Eye::Direction(along) => (a + b + c).dot(along),
            }
        };
        let mut order: Vec<(f64, u32)> = candidates.iter().map(|&i| (distance(i), i)).collect();
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order.into_iter().map(|(_, i)| i).collect()
    }
}

/// Tests whether the front (counter-clockwise) side of a triangle faces the eye. False for an edge-on or
/// degenerate triangle.
fn faces(triangle: &Triangle, eye: &Eye) -> bool {
    let [a, b, c] = triangle.map(|p| p.as_dvec3());
    let normal = (b - a).cross(c - a);
    match eye {
        Eye::Point(eye) => normal.dot(*eye - a) > 0.0,
        Eye::Direction(along) => normal.dot(*along) < 0.0,
    }
}
