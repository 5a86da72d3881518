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
        save_animation(path, std::slice::from_ref(self), 0)
    }

    /// Returns a picture half as wide and half as high, in which each pixel is the mean of four. A last odd
    /// row or column is left out.
    #[must_use]
    pub fn halved(&self) -> Self {
        let mut half = Self::new(self.width / 2, self.height / 2, [0; 3]);
        for y in 0..half.height {
            for x in 0..half.width {
                let at = |dx: u32, dy: u32| {
                    let (x, y) = ((2 * x + dx) as usize, (2 * y + dy) as usize);
                    self.pixels[y * self.width as usize + x].map(u16::from)
                };
                let [a, b, c, d] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
                let mean = std::array::from_fn(|i| ((a[i] + b[i] + c[i] + d[i] + 2) / 4) as u8);
                half.set(x.into(), y.into(), mean);
            }
        }
        half
    }

    /// Returns this picture with another below it. What is to the right of the narrower of the two has the
    /// color `ground`.
    #[must_use]
    pub fn above(&self, below: &Self, ground: Color) -> Self {
        let mut both = Self::new(self.width.max(below.width), self.height + below.height, ground);
        for (picture, top) in [(self, 0), (below, i64::from(self.height))] {
            for (row, pixels) in (top..).zip(picture.pixels.chunks(picture.width.max(1) as usize)) {
                (0..).zip(pixels).for_each(|(column, &color)| both.set(column, row, color));
            }
        }
        both
    }

    /// Returns this picture with another to the right of it. What is below the lower of the two has the color
    /// `ground`.
    #[must_use]
    pub fn beside(&self, right: &Self, ground: Color) -> Self {
        let mut both = Self::new(self.width + right.width, self.height.max(right.height), ground);
        for (picture, left) in [(self, 0), (right, i64::from(self.width))] {
            for (row, pixels) in (0..).zip(picture.pixels.chunks(picture.width.max(1) as usize)) {
                (left..).zip(pixels).for_each(|(column, &color)| both.set(column, row, color));
            }
        }
        both
    }
}

/// Writes pictures of one size as a PNG [file](write_with), replacing a file of that name: an animation that
/// repeats without end, in which each picture is shown for a time in milliseconds. A viewer without animation
/// shows the first. Returns a message with the path if that fails, also if there is no picture.
///
/// A pixel that is as in the picture before is written as transparent: most pixels of a map are, and the file
/// is then a third as large.
pub fn save_animation(path: &Path, pictures: &[Canvas], milliseconds: u16) -> Result<(), String> {
    let first = pictures.first().ok_or_else(|| format!("{}: there are no pictures", path.display()))?;
    write_with(path, |out| {
        let mut encoder = png::Encoder::new(out, first.width, first.height);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        // Neighbouring pixels are of one color, or of two that have nothing in common.
        encoder.set_filter(png::Filter::NoFilter);
        if pictures.len() > 1 {
            encoder.set_animated(pictures.len() as u32, 0)?;
            encoder.set_frame_delay(milliseconds, 1000)?;
            encoder.set_blend_op(png::BlendOp::Over)?;
        }
        let mut writer = encoder.write_header()?;
        let mut before: &[Color] = &[];
        for picture in pictures {
            let pixels: Vec<[u8; 4]> = (0..)
                .zip(&picture.pixels)
                .map(
                    |(at, color @ &[r, g, b])| {
                        if before.get(at) == Some(color) { [0; 4] } else { [r, g, b, 255] }
                    },
                )
                .collect();
            writer.write_image_data(pixels.as_flattened())?;
            before = &picture.pixels;
        }
        writer.finish()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_animation_has_all_pictures_and_plain_readers_see_the_first() {
        let path = std::env::temp_dir().join(format!("visibility-animation-{}.png", std::process::id()));
        let colors = [[255, 0, 0], [0, 255, 0], [0, 0, 255]];
        let pictures = colors.map(|color| Canvas::new(5, 3, color).beside(&Canvas::new(2, 1, color), [9; 3]));
        save_animation(&path, &pictures, 40).unwrap();
        let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let control = *reader.info().animation_control().unwrap();
        assert_eq!((control.num_frames, control.num_plays), (3, 0), "pictures, and without end");
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        for color in colors {
            reader.next_frame(&mut pixels).unwrap();
            let at = |column: usize, row: usize| &pixels[4 * (7 * row + column)..][..4];
            let [r, g, b] = color;
            assert_eq!(at(6, 0), [r, g, b, 255], "the right picture");
            // The ground below the right picture never changes, and is written once.
            let below = if color == colors[0] { [9, 9, 9, 255] } else { [0; 4] };
            assert_eq!(at(6, 1), below, "what is below the right picture");
        }
        std::fs::remove_file(&path).unwrap();
        assert!(save_animation(&path, &[], 40).is_err(), "no pictures");
    }

    #[test]
    fn a_picture_above_another_keeps_both() {
        let both = Canvas::new(2, 1, [1; 3]).above(&Canvas::new(1, 2, [2; 3]), [9; 3]);
        assert_eq!((both.width, both.height), (2, 3), "size");
        assert_eq!(both.pixels, [[1; 3], [1; 3], [2; 3], [9; 3], [2; 3], [9; 3]], "rows from above");
    }

    #[test]
    fn a_halved_picture_has_the_means_of_squares() {
        let mut canvas = Canvas::new(5, 2, [0; 3]);
        canvas.rectangle(2, 0, 1, 2, [200, 100, 1]);
        let half = canvas.halved();
        assert_eq!((half.width, half.height), (2, 1), "size");
        assert_eq!(half.pixels, [[0; 3], [100, 50, 1]], "means, rounded to nearest");
    }
}
