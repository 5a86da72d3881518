//! A view in words, for logs and overlays: what the camera of a clip matrix is, as a person would say it.

use super::{Eye, View};
use alloc::format;
use alloc::string::String;
use core::fmt;
use glam::{DMat4, DVec3};

impl fmt::Display for View {
    /// Writes the camera that the clip matrix stands for: the eye, and the directions ahead and up in the
    /// world; the field of view in width and height; the distances of the near and far planes; the depth
    /// convention; and layers and clip planes if any are set. Distances are measured from the eye or, for
    /// parallel views, along the view direction from the origin of the matrix. Numbers are rounded to four
    /// digits, at most three of them after the point. "left-handed" is written if the directions right, up
    /// and ahead of the picture are left-handed axes. That is correct in a world of left-handed axes; in a
    /// right-handed world, the picture is mirrored.
    ///
    /// ```
    /// use visibility_core::{glam::DVec3, Pose, View};
    /// let pose = Pose::look_at(DVec3::new(1.0, 2.0, 1.7), DVec3::new(9.0, 2.0, 1.7), DVec3::Z);
    /// let view = View::perspective(pose, 60f64.to_radians(), 16.0 / 9.0, 0.1, f64::INFINITY)?;
    /// assert_eq!(
    ///     view.to_string(),
    ///     "eye (1, 2, 1.7), looks along (1, 0, 0) with (0, 0, 1) up, field of view 91.49 x 60 degrees, \
    ///      near 0.1, no far plane, depth ReversedInfinite"
    /// );
    /// # Ok::<(), visibility_core::view::ViewError>(())
    /// ```
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(edges) = Edges::new(self) else {
            return write!(f, "a view whose matrix cannot be inverted");
        };
        // The directions up and right are found from the middles of the picture's edges, since the caller's
        // matrix may have any form.
        let up = (edges.top - edges.bottom).normalize_or(DVec3::Z);
        let right = (edges.right - edges.left).normalize_or(DVec3::X);
        let (ahead, planes) = match self.eye(DVec3::ZERO) {
            Eye::Point(eye) => {
                let local = eye - self.origin;
                let row = self.clip_from_local.row(3).truncate();
                let ahead = row.normalize_or_zero();
                // Angle between opposite edges of the picture as seen from the eye, projected along the other
                // pair of edges: also right for an off-centre window.
                let angle = |a: DVec3, b: DVec3, along: DVec3| {
                    let [a, b] = [a - local, b - local].map(|ray| ray.reject_from_normalized(along));
                    short(a.angle_between(b).to_degrees())
                };
                let wide = angle(edges.left, edges.right, up);
                let high = angle(edges.bottom, edges.top, right);
                write!(f, "eye {}, looks along {} with {} up, ", point(eye), point(ahead), point(up))?;
                write!(f, "field of view {wide} x {high} degrees")?;
                (ahead, edges.distances(local, ahead))
            }
            Eye::Direction(ahead) => {
                let wide = short((edges.right - edges.left).length());
                let high = short((edges.top - edges.bottom).length());
                write!(f, "parallel view at {}, looks along {} ", point(self.origin), point(ahead))?;
                write!(f, "with {} up, {wide} x {high}", point(up))?;
                (ahead, edges.distances(DVec3::ZERO, ahead))
            }
        };
        write!(f, ", near {}, ", short(planes[0]))?;
        match self.depth.is_infinite() {
            true => write!(f, "no far plane")?,
            false => write!(f, "far {}", short(planes[1]))?,
        }
        write!(f, ", depth {:?}", self.depth)?;
        if right.cross(up).dot(ahead) > 0.0 {
            write!(f, ", left-handed")?;
        }
        if self.layers != u32::MAX {
            write!(f, ", layers {:#x}", self.layers)?;
        }
        if self.clip_count > 0 {
            write!(f, ", {} clip planes", self.clip_count)?;
        }
        Ok(())
    }
}

/// Five points that describe a view's frustum: the middles of the picture's four edges on the near plane, and
/// the middle of the far plane. In metres in scene axes, relative to the view's origin.
struct Edges {
    /// Middle of the picture's left edge, as a point of the near plane. The next three fields are those of
    /// its other edges.
    left: DVec3,
    right: DVec3,
    bottom: DVec3,
    top: DVec3,
    /// Middle of the far plane. Not finite if there is none.
    far: DVec3,
}

impl Edges {
    /// Returns the points of the edges of a view's picture. `None` for a clip matrix without an inverse.
    fn new(view: &View) -> Option<Self> {
        let local_from_clip: DMat4 = view.clip_from_local.inverse();
        let near = view.depth.at_near();
        let far = if view.depth.is_reversed() { 0.0 } else { 1.0 };
        let at = |x: f64, y: f64, z: f64| local_from_clip.project_point3(DVec3::new(x, y, z));
        let edges = Self {
            left: at(-1.0, 0.0, near),
            right: at(1.0, 0.0, near),
            bottom: at(0.0, -1.0, near),
            top: at(0.0, 1.0, near),
            far: at(0.0, 0.0, far),
        };
        [edges.left, edges.right, edges.bottom, edges.top].iter().all(|p| p.is_finite()).then_some(edges)
    }

    /// Returns the distances of the near and far planes from a point along a unit direction.
    fn distances(&self, from: DVec3, ahead: DVec3) -> [f64; 2] {
        [(self.left - from).dot(ahead), (self.far - from).dot(ahead)]
    }
}

/// Returns a number rounded to four digits, at most three of them after the point, without trailing zeros.
/// Magnitudes from 10,000 on keep all digits before the point; magnitudes below a thousandth have two digits
/// and an exponent.
fn short(x: f64) -> String {
    let decimals = match x.abs() {
        size if size < 10.0 => 3,
        size if size < 100.0 => 2,
        size if size < 1000.0 => 1,
        _ => 0,
    };
    // Three decimals cannot show a near plane of less than a millimetre, so an exponent is written.
    let text = if x.abs() < 1e-3 && x != 0.0 { format!("{x:.1e}") } else { format!("{x:.decimals$}") };
    match text.contains('.') && !text.contains('e') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text,
    }
}

/// Returns a point as three numbers in parentheses. Numbers as small as rounding leaves are written as zero.
fn point(p: DVec3) -> String {
    let size = p.abs().max_element();
    let number = |x: f64| short(if x.abs() <= size * 1e-6 { 0.0 } else { x });
    format!("({}, {}, {})", number(p.x), number(p.y), number(p.z))
}
