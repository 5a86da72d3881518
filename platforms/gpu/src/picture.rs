//! Pictures in files, and pictures of the culled scene from above.

use crate::Viewer;
use glam::{DVec3, DVec4};
use std::error::Error;
use std::path::Path;
use visibility_core::view::{Eye, Window};
use visibility_core::{Pose, View, VisibleSet};

/// Colours of objects from above, with red in the lowest byte: outside of the frustum, and hidden.
const OUTSIDE: u32 = 0xffb4_b4b4;
const HIDDEN: u32 = 0xff50_50e6;
/// Colour of the view's edges and of the eye.
const LINES: [u8; 4] = [0, 60, 200, 255];

impl Viewer {
    /// Writes the picture to a PNG file.
    ///
    /// # Errors
    /// Errors of the device and of the file system.
    pub fn save(&self, path: &Path) -> Result<(), Box<dyn Error>> {
        write(path, self.target.size, &self.target.pixels(&self.gpu)?)
    }

    /// Draws the scene from above in the colours of [`save_from_above`](Self::save_from_above), which tell
    /// culled objects apart. Returns the view from above.
    ///
    /// # Errors
    /// None is expected.
    pub fn draw_from_above(
        &mut self,
        view: &View,
        in_frustum: &VisibleSet,
        visible: &VisibleSet,
    ) -> Result<View, Box<dyn Error>> {
        let own = self.painter.own_colors();
        let scene = &self.world.scene;
        let mut colors = own.clone();
        for id in scene.ids().filter(|&id| !visible.contains(scene, id)) {
            colors[id.index()] = if in_frustum.contains(scene, id) { HIDDEN } else { OUTSIDE };
        }
        let above = self.world.view_from_above(view, self.target.size)?;
        self.painter.set_colors(&self.gpu, &colors);
        self.draw_all(&above);
        self.painter.set_colors(&self.gpu, &own);
        Ok(above)
    }

    /// Writes a picture from above of the surroundings of a view's eye to a PNG file. Objects of `visible`
    /// have their own colours, other objects of `in_frustum` are red, and the rest is grey. A scene with
    /// ceilings is cut open above the eye.
    ///
    /// # Errors
    /// Errors of the device and of the file system.
    pub fn save_from_above(
        &mut self,
        path: &Path,
        view: &View,
        in_frustum: &VisibleSet,
        visible: &VisibleSet,
    ) -> Result<(), Box<dyn Error>> {
        let above = self.draw_from_above(view, in_frustum, visible)?;
        let origin = self.world.scene.origin();
        let mut pixels = self.target.pixels(&self.gpu)?;
        draw_outline(&mut pixels, self.target.size, view, &above, origin);
        write(path, self.target.size, &pixels)
    }
}

impl crate::World {
    /// Makes a view from above of the surroundings of another view's eye.
    fn view_from_above(&self, view: &View, size: [u32; 2]) -> Result<View, Box<dyn Error>> {
        let eye = eye_of(view);
        let [width, height] = size.map(f64::from);
        let (radius, cut) = if self.has_ceilings() { (16.0, 0.3) } else { (90.0, 500.0) };
        let window = Window::centered(radius * width / height, radius);
        let pose = Pose::look_at(eye + DVec3::Z * cut, eye, DVec3::Y);
        Ok(View::orthographic(pose, window, 0.0, 1000.0)?)
    }
}

/// Returns the eye of a perspective view, in world space.
fn eye_of(view: &View) -> DVec3 {
    match view.eye(DVec3::ZERO) {
        Eye::Point(eye) => eye,
        Eye::Direction(_) => DVec3::ZERO,
    }
}

/// Draws the left and right edges of a view into a picture from above.
fn draw_outline(pixels: &mut [[u8; 4]], [width, height]: [u32; 2], view: &View, above: &View, origin: DVec3) {
    let clip = above.clip_from(origin);
    let place = |point: DVec3| {
        let at = clip * (point - origin).extend(1.0);
        let [x, y] = [at.x * 0.5 + 0.5, 0.5 - at.y * 0.5];
        [x * f64::from(width), y * f64::from(height)]
    };
    let eye = eye_of(view);
    let inverse = view.clip_from(eye).inverse();
    for x in [-1.0, 1.0] {
        // Point on the near plane, in the middle of the left or right edge of the picture.
        let on_edge = inverse * DVec4::new(x, 0.0, 1.0, 1.0);
        let mut direction = on_edge.truncate() / on_edge.w;
        direction.z = 0.0;
        let direction = direction.normalize_or_zero();
        for step in 0..20_000 {
            let at = place(eye + direction * (f64::from(step) * 0.02));
            if at[0] < 0.0 || at[1] < 0.0 || at[0] >= f64::from(width) || at[1] >= f64::from(height) {
                break;
            }
            pixels[at[1] as usize * width as usize + at[0] as usize] = LINES;
        }
    }
}

/// Writes pixels, row by row from the top, to a PNG file.
fn write(path: &Path, [width, height]: [u32; 2], pixels: &[[u8; 4]]) -> Result<(), Box<dyn Error>> {
    let file = std::io::BufWriter::new(std::fs::File::create(path)?);
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(bytemuck::cast_slice(pixels))?;
    Ok(())
}
