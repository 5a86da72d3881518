//! The judge: which object each pixel really shows.

use crate::arrays::{self, LIST};
use crate::error::refused;
use crate::scene::Scene;
use crate::view::View;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use visibility_measure::{Comparison, DrawnObject, ItemBuffer, NONE};

impl Scene {
    /// Draws all objects with triangles.
    fn draw(&self, view: &View, width: u32, height: u32) -> PyResult<ItemBuffer> {
        let mut buffer = ItemBuffer::new(width, height).map_err(|error| refused("size", error))?;
        let scene = self.scene();
        let objects = scene.ids().filter_map(|id| DrawnObject::of_scene(scene, id, &view.view));
        buffer.draw(&view.view, scene.origin(), objects).map_err(|error| refused("scene", error))?;
        Ok(buffer)
    }
}

/// Returns which object each pixel shows.
pub(crate) fn item_buffer<'py>(
    scene: &Scene,
    py: Python<'py>,
    view: &View,
    size: (u32, u32),
) -> PyResult<Bound<'py, PyArray2<i64>>> {
    let (width, height) = size;
    let items = py.detach(|| {
        let buffer = scene.draw(view, width, height)?;
        let objects = buffer.visible().objects();
        let object = |row, column| match buffer.object_at(column, row).and_then(|object| objects.get(object))
        {
            Some(object) => i64::from(object.key),
            None => -1,
        };
        let rows = (0..height).flat_map(|row| (0..width).map(move |column| (row, column)));
        Ok::<_, PyErr>(rows.map(|(row, column)| object(row, column)).collect::<Vec<i64>>())
    })?;
    PyArray1::from_vec(py, items).reshape([height as usize, width as usize])
}

/// Returns the objects that are not in a set though a pixel shows them, and how many of the set no pixel
/// shows.
pub(crate) fn compare<'py>(
    scene: &Scene,
    py: Python<'py>,
    view: &View,
    ids: &Bound<'py, PyAny>,
    size: (u32, u32),
) -> PyResult<(Bound<'py, PyArray1<u32>>, u32)> {
    let ids = arrays::indices("ids", ids, LIST)?;
    let ids = ids.numbers();
    let comparison = py.detach(|| {
        let mut reported = vec![false; scene.scene().index_limit()];
        for &id in ids {
            let place = reported.get_mut(id as usize);
            *place.ok_or_else(|| refused("ids", format!("no object has the number {id}")))? = true;
        }
        let mut comparison = Comparison::default();
        let buffer = scene.draw(view, size.0, size.1)?;
        let is_reported = |key: u32| reported.get(key as usize).copied().unwrap_or(true);
        buffer.visible().compare(|_, key| is_reported(key), &mut comparison);
        Ok::<_, PyErr>(comparison)
    })?;
    let mut missed: Vec<u32> =
        comparison.false_hidden_keys.iter().copied().filter(|&key| key != NONE).collect();
    missed.sort_unstable();
    Ok((PyArray1::from_vec(py, missed), comparison.false_visible_objects))
}
