//! Picture in memory with pixels, lines, discs and small text, saved as PNG.

use crate::output_file::write_with;
use font8x8::legacy::BASIC_LEGACY;
use std::path::Path;

/// Color as red, green and blue, 0 to 255 each.
pub type Color = [u8; 3];

/// Picture of RGB pixels. Coordinates are pixels from the upper left corner, x to the right and y down.
pub struct Canvas {
    /// Width of the picture, in pixels.
    pub width: u32,
    /// Height of the picture, in pixels.
    pub height: u32,
    pixels: Vec<Color>,
}

/// Side of a character, in pixels.
pub const LETTER: i64 = 8;

impl Canvas {
    /// Creates a picture of `width` by `height` pixels filled with one color.
    pub fn new(width: u32, height: u32, color: Color) -> Self {
        Self { width, height, pixels: vec![color; width as usize * height as usize] }
    }

    /// Sets the color of a pixel. Pixels outside the picture are ignored.
    pub fn set(&mut self, x: i64, y: i64, color: Color) {
        if (0..i64::from(self.width)).contains(&x) && (0..i64::from(self.height)).contains(&y) {
            self.pixels[y as usize * self.width as usize + x as usize] = color;
        }
    }

    /// Draws a line two pixels wide between two points in pixels, clipped to the picture.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], color: Color) {
        let Some((from, to)) = self.clip(from, to) else { return };
        let steps = (to[0] - from[0]).abs().max((to[1] - from[1]).abs()).ceil().max(1.0);
        for i in 0..=steps as i64 {
            let part = i as f64 / steps;
            let x = (from[0] + (to[0] - from[0]) * part).floor() as i64;
            let y = (from[1] + (to[1] - from[1]) * part).floor() as i64;
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                self.set(x + dx, y + dy, color);
            }
        }
    }

    /// Returns the part of a segment inside the picture, by the test of Liang and Barsky; `None` if the
    /// segment is outside. Clipping bounds the work for lines that end far outside.
    fn clip(&self, from: [f64; 2], to: [f64; 2]) -> Option<([f64; 2], [f64; 2])> {
        let (mut enter, mut leave) = (0.0f64, 1.0f64);
        for (axis, size) in [(0, self.width), (1, self.height)] {
            let step = to[axis] - from[axis];
            for (toward, distance) in [(-step, from[axis]), (step, f64::from(size) - from[axis])] {
                if toward > 0.0 {
                    leave = leave.min(distance / toward);
                } else if toward < 0.0 {
                    enter = enter.max(distance / toward);
                } else if distance < 0.0 {
                    return None;
                }
            }
        }
        let at = |part: f64| [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * part);
        (enter <= leave).then(|| (at(enter), at(leave)))
    }

    /// Draws a filled disc, or with `hollow` a ring 2.5 pixels thick. `center` and `radius` are pixels.
    pub fn disc(&mut self, center: [f64; 2], radius: f64, hollow: bool, color: Color) {
        let reach = radius.ceil() as i64 + 1;
        let (cx, cy) = (center[0].floor() as i64, center[1].floor() as i64);
        for y in -reach..=reach {
            for x in -reach..=reach {
                let distance = ((x * x + y * y) as f64).sqrt();
                if distance <= radius && (!hollow || distance > radius - 2.5) {
                    self.set(cx + x, cy + y, color);
                }
            }
        }
    }

    /// Fills a rectangle whose upper left pixel is (`x`, `y`). Parts outside the picture are ignored.
    pub fn rectangle(&mut self, x: i64, y: i64, width: i64, height: i64, color: Color) {
        for y in y..y + height {
            for x in x..x + width {
                self.set(x, y, color);
            }
        }
    }

    /// Draws a line of text with its upper left corner at (`x`, `y`). Characters other than ASCII become
    /// question marks.
    pub fn text(&mut self, x: i64, y: i64, text: &str, color: Color) {
        for (position, letter) in text.chars().enumerate() {
            let glyph = BASIC_LEGACY.get(letter as usize).unwrap_or(&BASIC_LEGACY['?' as usize]);
            for (row, bits) in glyph.iter().enumerate() {
                for column in 0..LETTER {
                    if bits >> column & 1 != 0 {
                        self.set(x + position as i64 * LETTER + column, y + row as i64, color);
                    }
                }
            }
        }
    }

    /// Draws a row of colored squares from (`x`, `y`), each followed by a text with its meaning.
    pub fn legend(&mut self, x: i64, y: i64, entries: &[(Color, &str)], ink: Color) {
        let mut x = x;
        for &(color, meaning) in entries {
            self.rectangle(x, y, 16, 16, color);
            self.text(x + 22, y + 4, meaning, ink);
            x += 22 + (meaning.len() as i64 + 3) * LETTER;
        }
    }

    /// Writes the picture as a PNG [file](write_with), replacing a file of that name. Returns a message with
    /// the path if that fails.
    pub fn save(&self, path: &Path) -> Result<(), String> {
        write_with(path, |out| {
            let mut encoder = png::Encoder::new(out, self.width, self.height);
            encoder.set_color(png::ColorType::Rgb);
            encoder.set_depth(png::BitDepth::Eight);
            let mut writer = encoder.write_header()?;
            writer.write_image_data(self.pixels.as_flattened())?;
            writer.finish()
        })
    }
}
