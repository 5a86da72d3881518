//! Draw ranges, and the other data that the scene stores for levels of detail.

use core::num::NonZeroU32;

/// The distances from the eye at which an object is drawn, in metres, and how it fades there. Distance is
/// that of the nearest point of the object's bounds, 0 for an eye inside them; the end of an object with an
/// [HLOD parent](crate::Scene::set_hlod_parent) is measured from the bounds of the parent.
///
/// Ranges alone do not join two levels of detail of one thing: where their bounds differ, the near level may
/// be beyond its end while the far level, whose bounds are nearer, is not yet at its begin, and neither is
/// drawn. Make the far level the HLOD parent of the near one.
///
/// ```
/// use visibility_core::scene::DrawRange;
/// let lamp = DrawRange { end: 100.0, margin: 20.0, ..DrawRange::ALWAYS };
/// assert_eq!([80.0, 90.0, 100.0].map(|distance| lamp.opacity(distance)), [1.0, 0.5, 0.0]);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct DrawRange {
    /// Least distance at which the object is drawn, in metres, inclusive; finite and not negative.
    pub begin: f32,
    /// Greatest distance at which the object is drawn, in metres, inclusive; at least `begin`, or infinite.
    pub end: f32,
    /// Length in metres, inside the range, over which the object fades in from `begin` on and out up to
    /// `end`; finite and not negative, 0 for no fading. A range from 0 does not fade in. An object that
    /// [fades](Self::fades) hides nothing.
    pub margin: f32,
}

impl DrawRange {
    /// The range of an object that is drawn at every distance: the default.
    pub const ALWAYS: Self = Self { begin: 0.0, end: f32::INFINITY, margin: 0.0 };

    /// Returns the opacity of an object at a distance in metres: 1 within the range, 0 outside of it and for
    /// NaN. Within `margin` of `end`, and of `begin` unless that is 0, the opacity falls to 0 there. Without
    /// a `margin`, draw each object that a `ContributionCuller` of `visibility-frame` leaves in the set
    /// opaque: its hysteresis keeps objects for a while beyond the ends of their ranges, and they hide others
    /// there.
    pub fn opacity(&self, distance: f32) -> f32 {
        if !(distance >= self.begin && distance <= self.end) {
            return 0.0;
        }
        let ramp = |depth: f32| if depth < self.margin { depth / self.margin } else { 1.0 };
        let fade_in = if self.begin > 0.0 { ramp(distance - self.begin) } else { 1.0 };
        fade_in.min(ramp(self.end - distance))
    }

    /// Returns whether an object with this range is transparent at some distance at which it is drawn: it has
    /// a `margin`, and an end or a begin to fade at. Such an object [hides
    /// nothing](crate::Scene::can_occlude) at any distance.
    pub fn fades(&self) -> bool {
        self.margin > 0.0 && (self.begin > 0.0 || self.end < f32::INFINITY)
    }

    pub(crate) fn is_valid(&self) -> bool {
        let is_length = |number: f32| (0.0..f32::INFINITY).contains(&number);
        is_length(self.begin) && is_length(self.margin) && self.end >= self.begin
    }
}

impl Default for DrawRange {
    fn default() -> Self {
        Self::ALWAYS
    }
}

/// Index of an object plus one; `None` for no object.
pub(crate) type Link = Option<NonZeroU32>;

/// Details of an object that has a draw range, an HLOD parent or children. The children of a parent are a
/// doubly linked list.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Detail {
    pub(crate) range: DrawRange,
    pub(crate) parent: Link,
    pub(super) first_child: Link,
    pub(super) next: Link,
    pub(super) previous: Link,
}

impl Detail {
    /// Details of an object without a draw range, an HLOD parent or children.
    pub(crate) const NONE: Self =
        Self { range: DrawRange::ALWAYS, parent: None, first_child: None, next: None, previous: None };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_transparent_at_some_distance_fades() {
        let range = |begin: f32, end: f32, margin: f32| DrawRange { begin, end, margin };
        for (begin, end, margin, fades) in [
            (0.0, f32::INFINITY, 5.0, false),
            (0.0, f32::INFINITY, 0.0, false),
            (0.0, 100.0, 5.0, true),
            (9.0, f32::INFINITY, 5.0, true),
            (9.0, 100.0, 5.0, true),
            (9.0, 100.0, 0.0, false),
            (0.0, 100.0, 0.0, false),
        ] {
            let range = range(begin, end, margin);
            assert_eq!(range.fades(), fades, "{range:?}");
            let is_transparent = (0..4000).map(|step| step as f32 * 0.05).any(|distance| {
                let is_drawn = distance >= begin && distance <= end;
                is_drawn && range.opacity(distance) < 1.0
            });
            assert_eq!(is_transparent, fades, "{range:?} is transparent at some distance");
        }
    }

    #[test]
    fn ranges_hold_their_ends() {
        let range = DrawRange { begin: 10.0, end: 20.0, margin: 0.0 };
        assert_eq!(
            [10f32.next_down(), 10.0, 20.0, 20f32.next_up(), f32::NAN].map(|at| range.opacity(at)),
            [0.0, 1.0, 1.0, 0.0, 0.0],
            "a range holds both of its ends"
        );
        let point = DrawRange { begin: 3.0, end: 3.0, margin: 0.0 };
        assert_eq!(point.opacity(3.0), 1.0, "a range of one distance");
        let fading = DrawRange { margin: 2.0, ..range };
        assert_eq!(
            [10.0, 11.0, 12.0, 15.0, 18.0, 19.0, 20.0].map(|at| fading.opacity(at)),
            [0.0, 0.5, 1.0, 1.0, 1.0, 0.5, 0.0],
            "opacity falls to both ends"
        );
        let near = DrawRange { begin: 0.0, ..fading };
        assert_eq!([0.0, 1.0].map(|at| near.opacity(at)), [1.0; 2], "a range from 0 does not fade in");
    }

    #[test]
    fn ranges_are_of_lengths_in_order() {
        let range = |begin: f32, end: f32, margin: f32| DrawRange { begin, end, margin }.is_valid();
        assert!(range(0.0, 0.0, 0.0) && range(3.0, 3.0, 1.0) && range(3.0, f32::INFINITY, 1.0), "ranges");
        for (begin, end, margin) in [
            (-1.0, 5.0, 0.0),
            (f32::INFINITY, f32::INFINITY, 0.0),
            (f32::NAN, 5.0, 0.0),
            (3.0, 2.0, 0.0),
            (3.0, f32::NAN, 0.0),
            (3.0, 5.0, -1.0),
            (3.0, 5.0, f32::INFINITY),
        ] {
            assert!(!range(begin, end, margin), "from {begin} to {end}, margin {margin}");
        }
    }
}
