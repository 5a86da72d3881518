//! Lights that cast shadows, and their validation.

use core::fmt;
use visibility_core::glam::DVec3;

/// A shadow-casting light, in world coordinates and metres. Its position is not relative to
/// [`Scene::origin`](visibility_core::Scene::origin), which the culler subtracts in `f64`.
///
/// ```
/// use visibility_core::glam::DVec3;
/// use visibility_frame::casters::{CasterCuller, Light, LightError};
/// let sun = Light::Directional { toward_light: DVec3::new(0.3, 0.2, 1.0) };
/// assert!(CasterCuller::new(sun).is_ok());
/// let nowhere = Light::Directional { toward_light: DVec3::ZERO };
/// assert_eq!(CasterCuller::new(nowhere).err(), Some(LightError::Direction));
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Light {
    /// Parallel light, such as the sun.
    Directional {
        /// Direction from lit points towards the light, in world space. Any finite length but zero.
        toward_light: DVec3,
    },
    /// Light in all directions from one point.
    Point {
        /// Position of the light in world space.
        position: DVec3,
        /// Distance from the light in metres, more than 0, beyond which nothing is lit and nothing casts a
        /// shadow. May be infinite.
        range: f64,
    },
    /// Light from one point within a cone.
    Spot {
        /// Position of the light, the apex of the cone, in world space.
        position: DVec3,
        /// Axis of the cone, pointing away from the light. Any finite length but zero.
        direction: DVec3,
        /// Angle in radians between the axis and the side of the cone, more than 0 and at most pi. From pi/2
        /// on, the cone is not convex and is not used for culling.
        half_angle: f64,
        /// Distance from the light in metres, more than 0, beyond which nothing is lit and nothing casts a
        /// shadow. May be infinite.
        range: f64,
    },
}

impl Light {
    pub(super) fn check(&self) -> Result<(), LightError> {
        let direction = |v: DVec3| {
            if v.is_finite() && v != DVec3::ZERO { Ok(()) } else { Err(LightError::Direction) }
        };
        let place = |position: DVec3, range: f64| {
            if !position.is_finite() {
                Err(LightError::Position)
            } else if range > 0.0 {
                Ok(())
            } else {
                Err(LightError::Range { range })
            }
        };
        match *self {
            Self::Directional { toward_light } => direction(toward_light),
            Self::Point { position, range } => place(position, range),
            Self::Spot { position, direction: axis, half_angle, range } => {
                direction(axis)?;
                place(position, range)?;
                if half_angle > 0.0 && half_angle <= core::f64::consts::PI {
                    Ok(())
                } else {
                    Err(LightError::HalfAngle { half_angle })
                }
            }
        }
    }
}

/// The reason why a light is refused.
///
/// ```
/// use visibility_core::glam::DVec3;
/// use visibility_frame::casters::{CasterCuller, Light};
/// let dark = Light::Point { position: DVec3::ZERO, range: 0.0 };
/// assert_eq!(CasterCuller::new(dark).unwrap_err().to_string(), "the range of a light cannot be 0");
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum LightError {
    /// The direction of a directional light or spot light is zero, NaN or infinite.
    Direction,
    /// The position of a point light or spot light is NaN or infinite.
    Position,
    /// The range of a point light or spot light is zero, negative or NaN.
    Range {
        /// The refused range, in metres.
        range: f64,
    },
    /// The half angle of a spot light is NaN, zero, negative or more than pi radians.
    HalfAngle {
        /// The refused half angle, in radians.
        half_angle: f64,
    },
}

impl fmt::Display for LightError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Direction => write!(f, "the direction of a light is not finite or has no length"),
            Self::Position => write!(f, "the position of a light is not finite"),
            Self::Range { range } => write!(f, "the range of a light cannot be {range}"),
            Self::HalfAngle { half_angle } => write!(f, "the half angle of a light cannot be {half_angle}"),
        }
    }
}

impl core::error::Error for LightError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_are_refused_by_what_is_wrong_with_them() {
        let sun = |toward_light: DVec3| Light::Directional { toward_light }.check();
        assert_eq!(sun(DVec3::X * 1e-300), Ok(()), "a short direction");
        for direction in [DVec3::ZERO, DVec3::NAN, DVec3::X * f64::INFINITY] {
            assert_eq!(sun(direction), Err(LightError::Direction), "{direction}");
        }
        let lamp = |x: f64, range: f64| Light::Point { position: DVec3::X * x, range }.check();
        assert_eq!([lamp(0.0, 1e-300), lamp(1.0, f64::INFINITY)], [Ok(()); 2], "any range");
        assert_eq!(lamp(f64::NAN, 1.0), Err(LightError::Position), "no position");
        for range in [0.0, -1.0] {
            assert_eq!(lamp(1.0, range), Err(LightError::Range { range }), "no range");
        }
        assert!(matches!(lamp(1.0, f64::NAN), Err(LightError::Range { .. })), "a range of NaN");
        let spot = |half_angle: f64| {
            let (position, direction) = (DVec3::ZERO, DVec3::X);
            Light::Spot { position, direction, half_angle, range: 1.0 }.check().is_ok()
        };
        let pi = core::f64::consts::PI;
        let found = [1e-9, pi, pi.next_up(), 0.0, -1.0, f64::NAN].map(spot);
        assert_eq!(found, [true, true, false, false, false, false], "by half angle");
    }
}
