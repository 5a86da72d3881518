//! Serialisation by `serde`: each type as a record of plain fields. A value that is read passes the checks of
//! the type's own constructor, so that a file can say nothing that a program cannot.

use crate::cells::{CellId, PortalId};
use crate::geometry::{Plane, Sphere};
use crate::occlusion::Preparation;
use crate::pvs::{Viewcell, ViewcellId};
use crate::scene::{DrawRange, MeshId};
use crate::view::{Depth, Reach, ViewError, Window};
use crate::{Aabb, Object, ObjectId, Pose, View};
use alloc::vec::Vec;
use glam::{DMat4, DVec3, Vec3};

/// Implements `Serialize` and `Deserialize` for a type as a record of fields. For the crates of this family.
///
/// `Type as "Type" |value| { field: FieldType = value.field } => make` names the fields, how each is got from
/// `value: &Type`, and the expression that makes the type of all fields. After `make`, `if condition, else
/// message` refuses values for which `condition` is false, both when written and when read. `try make` is an
/// expression of type `Result`. With `settings` in front, a field that is left out has its default.
#[doc(hidden)]
#[macro_export]
macro_rules! __serde_record {
    (settings $type:ident $($record:tt)*) => {
        $crate::__serde_record!(@parse [#[serde(default)]] [
            impl ::core::default::Default for Record {
                fn default() -> Self {
                    Self::of(&<$type>::default())
                }
            }
        ] $type $($record)*);
    };
    (@parse $default:tt $items:tt $type:ident as $name:literal |$value:ident| $fields:tt => try $make:expr) => {
        $crate::__serde_record!(@impl $default $items $type $name $value $fields ($make) (Ok::<(), &str>(())));
    };
    (@parse $default:tt $items:tt $type:ident as $name:literal |$value:ident| $fields:tt =>
     $make:expr, if $valid:expr, else $message:expr) => {
        $crate::__serde_record!(@impl $default $items $type $name $value $fields (Ok::<_, &str>($make))
            (if $valid { Ok(()) } else { Err($message) }));
    };
    (@parse $default:tt $items:tt $type:ident as $name:literal |$value:ident| $fields:tt => $make:expr) => {
        $crate::__serde_record!(@impl $default $items $type $name $value $fields (Ok::<_, &str>($make))
            (Ok::<(), &str>(())));
    };
    (@impl [$($default:tt)*] [$($items:tt)*] $type:ident $name:literal $value:ident
     { $($field:ident: $kind:ty = $get:expr),* $(,)? } ($make:expr) ($check:expr)) => {
        const _: () = {
            #[derive(::serde::Serialize, ::serde::Deserialize)]
            #[serde(rename = $name, deny_unknown_fields)]
            $($default)*
            struct Record {
                $($field: $kind),*
            }

            impl Record {
                fn of($value: &$type) -> Self {
                    Self { $($field: $get),* }
                }
            }

            $($items)*

            fn check<'a>($value: &$type) -> Result<(), &'a str> {
                let _ = $value;
                $check
            }

            impl ::serde::Serialize for $type {
                fn serialize<S: ::serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                    check(self).map_err(::serde::ser::Error::custom)?;
                    ::serde::Serialize::serialize(&Record::of(self), serializer)
                }
            }

            impl<'de> ::serde::Deserialize<'de> for $type {
                fn deserialize<D: ::serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                    let Record { $($field),* } = ::serde::Deserialize::deserialize(deserializer)?;
                    let made: Self = ($make).map_err(::serde::de::Error::custom)?;
                    check(&made).map_err(::serde::de::Error::custom)?;
                    Ok(made)
                }
            }
        };
    };
    ($type:ident $($record:tt)*) => {
        $crate::__serde_record!(@parse [] [] $type $($record)*);
    };
}

/// Implements `Serialize` and `Deserialize` for an enum by the names of its variants. For the crates of this
/// family.
#[doc(hidden)]
#[macro_export]
macro_rules! __serde_variants {
    ($type:ident as $name:literal { $($variant:ident $(($data:ty))?),* $(,)? }) => {
        const _: () = {
            #[derive(::serde::Serialize, ::serde::Deserialize)]
            #[serde(remote = $name, rename = $name)]
            enum Variants {
                $($variant $(($data))?),*
            }

            impl ::serde::Serialize for $type {
                fn serialize<S: ::serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                    Variants::serialize(self, serializer)
                }
            }

            impl<'de> ::serde::Deserialize<'de> for $type {
                fn deserialize<D: ::serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                    Variants::deserialize(deserializer)
                }
            }
        };
    };
}

/// Implements `Serialize` and `Deserialize` for ids that are a number.
macro_rules! numbers {
    ($($type:ident),*) => {$(
        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_u32(self.0)
            }
        }

        impl<'de> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                u32::deserialize(deserializer).map(Self)
            }
        }
    )*};
}

// A file may name any object, whether or not a scene has it: every scene checks the ids that it is given.
__serde_record!(ObjectId as "ObjectId" |id| { index: u32 = id.index, generation: u32 = id.generation }
    => ObjectId { index, generation });
__serde_record!(MeshId as "MeshId" |id| { index: u32 = id.index, generation: u32 = id.generation }
    => MeshId { index, generation });
numbers!(CellId, PortalId, ViewcellId);

__serde_record!(Aabb as "Aabb" |a| { min: Vec3 = a.min, max: Vec3 = a.max } => Aabb::new(min, max),
    if a.is_proper(), else "a box has a NaN, or a minimum above its maximum");
__serde_record!(Sphere as "Sphere" |s| { center: Vec3 = s.center, radius: f32 = s.radius }
    => Sphere::new(center, radius), if s.is_proper(), else "a sphere has a NaN or a negative radius");
__serde_record!(Plane as "Plane" |p| { normal: DVec3 = p.normal, offset: f64 = p.offset }
    => Plane::new(normal, offset),
    if p.normal.is_finite() && p.offset.is_finite() && p.normal != DVec3::ZERO, else
    "a plane is not finite or has no direction");
__serde_record!(Viewcell as "Viewcell" |c| { min: DVec3 = c.min, max: DVec3 = c.max, planes: Vec<Plane> =
    c.planes.clone() } => Viewcell { min, max, planes },
    if c.min.cmple(c.max).all(), else "a viewcell has a NaN, or a minimum above its maximum");

__serde_record!(Object as "Object" |o| {
    bounds: Aabb = o.bounds, layers: u32 = o.layers, cost: u32 = o.cost, never_cull: bool = o.never_cull,
    occluder: bool = o.occluder, see_through: bool = o.see_through, one_sided: bool = o.one_sided,
} => Object { bounds, layers, cost, never_cull, occluder, see_through, one_sided });
// Formats of text have no infinity, which the end of most ranges is.
__serde_record!(DrawRange as "DrawRange" |r| {
    begin: f32 = r.begin, end: Option<f32> = (r.end < f32::INFINITY).then_some(r.end), margin: f32 = r.margin,
} => DrawRange { begin, end: end.unwrap_or(f32::INFINITY), margin },
    if r.is_valid(), else "a draw range is not a range");

__serde_variants!(Depth as "Depth" {
    NegativeOneToOne, NegativeOneToOneInfinite, ZeroToOne, ZeroToOneInfinite, Reversed, ReversedInfinite
});
__serde_record!(Pose as "Pose" |p| { eye: DVec3 = p.eye, right: DVec3 = p.right, up: DVec3 = p.up, forward:
    DVec3 = p.forward } => Pose { eye, right, up, forward },
    if [p.eye, p.right, p.up, p.forward].iter().all(|v| v.is_finite()), else "a pose is not finite");
__serde_record!(Window as "Window" |w| { left: f64 = w.left, right: f64 = w.right, bottom: f64 = w.bottom, top:
    f64 = w.top } => Window { left, right, bottom, top },
    if w.check().is_ok(), else "a window is empty or not finite");
__serde_record!(Reach as "Reach" |r| { metres: f64 = r.metres(), radians: f64 = r.radians() }
    => Reach::new(metres, radians));
__serde_record!(View as "View" |v| {
    clip_from_local: DMat4 = v.clip_from(v.origin()), origin: DVec3 = v.origin(), depth: Depth = v.depth(),
    layers: u32 = v.layers(), clip_planes: Vec<Plane> = v.clip_planes().to_vec(),
} => try view_of(clip_from_local, origin, depth, layers, &clip_planes));
__serde_record!(settings Preparation as "Preparation" |p| {
    sliver: f32 = p.sliver, min_area: f32 = p.min_area, two_sided: bool = p.two_sided,
} => Preparation::default().with_sliver(sliver).with_min_area(min_area).with_two_sided(two_sided));

/// Returns the view of a record, by the constructors that a program would use.
fn view_of(
    clip_from_local: DMat4,
    origin: DVec3,
    depth: Depth,
    layers: u32,
    clip_planes: &[Plane],
) -> Result<View, ViewError> {
    let view = View::from_clip_from_world(clip_from_local, depth)?.relative_to(origin)?;
    view.with_layers(layers).with_clip_planes(clip_planes)
}
