//! The [`Culler`] trait that all per-view cullers implement, and the accuracy classes that they state.

use crate::view::ViewRegion;
use crate::{CullStats, Scene, View, VisibleSet, jobs::Jobs};

/// What a culler guarantees about the set of objects that it leaves. The reference is V, the set of objects
/// to which an unobstructed segment runs from the eye inside the view. (The terms are those of Cohen-Or,
/// Chrysanthou, Silva and Durand, "A Survey of Visibility for Walkthrough Applications", 2003.)
///
/// ```
/// use visibility_core::Accuracy;
/// assert_eq!(Accuracy::Conservative.and(Accuracy::Approximate), Accuracy::Approximate);
/// assert_eq!(Accuracy::Conservative.and(Accuracy::Exact), Accuracy::Exact);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum Accuracy {
    /// The set equals V, up to a tolerance that the culler states.
    Exact,
    /// The set contains all of V and maybe more: no visible object is removed.
    Conservative,
    /// The set is contained in V: every object in it is visible, but visible objects may be missing.
    Aggressive,
    /// The set may contain hidden objects and may miss visible ones.
    Approximate,
}

impl Accuracy {
    /// Returns whether no visible object is ever removed, up to the tolerance that exact cullers and bakes
    /// with a clearance state: true for exact and conservative.
    pub const fn never_hides(self) -> bool {
        matches!(self, Self::Exact | Self::Conservative)
    }

    /// Returns whether no object outside V (hidden object) is ever left in the set: true for exact and
    /// aggressive.
    const fn never_shows(self) -> bool {
        matches!(self, Self::Exact | Self::Aggressive)
    }

    /// Returns the accuracy of two cullers in sequence, after which the objects that both keep are left. No
    /// visible object is removed if neither culler removes any. No hidden object is left if at least one of
    /// the cullers leaves none.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        match (self.never_hides() && other.never_hides(), self.never_shows() || other.never_shows()) {
            (true, true) => Self::Exact,
            (true, false) => Self::Conservative,
            (false, true) => Self::Aggressive,
            (false, false) => Self::Approximate,
        }
    }

    /// Returns the accuracy's name in lower case, such as `"conservative"`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Conservative => "conservative",
            Self::Aggressive => "aggressive",
            Self::Approximate => "approximate",
        }
    }
}

impl core::fmt::Display for Accuracy {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.pad(self.name())
    }
}

/// A reason why a culler hides fewer objects than it could: a number of objects that all lack the same thing.
///
/// ```
/// use visibility_core::culler::Lack;
/// let lack = Lack { what: "occluders without a mesh", count: 12 };
/// assert_eq!(lack.to_string(), "occluders without a mesh: 12");
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub struct Lack {
    /// The objects and what they lack, in the plural, such as "occluders without a mesh".
    pub what: &'static str,
    /// Number of objects, at least 1.
    pub count: usize,
}

impl Lack {
    /// Reports occluders of `scene` that cullers cannot use. Calls `each` up to five times: with the number
    /// of occluders without a mesh, of occluders whose mesh reaches out of their bounds, of objects with an
    /// occluder mesh that are not flagged as occluders, of occluders that are [never
    /// culled](crate::Object::is_unculled), and of occluders that [fade](crate::scene::DrawRange::fades).
    /// Numbers that are 0 are not reported. Takes time in proportion to the objects that are never culled and
    /// to a sixtieth of all others.
    pub fn of_occluders(scene: &Scene, each: &mut dyn FnMut(Self)) {
        for (what, count) in [
            ("occluders without a mesh", scene.occluders_without_mesh()),
            ("occluders with a mesh outside their bounds", scene.occluders_outside_bounds()),
            ("objects with an occluder mesh but without the flag of an occluder", scene.unflagged_meshes()),
            ("occluders that are never culled, and hide nothing", scene.unculled_occluders()),
            ("occluders that fade by their draw range, and hide nothing", scene.fading_occluders()),
        ] {
            each_of(what, count, each);
        }
    }

    /// Calls `each` with the number of objects of `scene` if none of them is flagged as an occluder: for
    /// cullers whose only occluders are those of the scene. Takes constant time.
    pub fn of_no_occluder(scene: &Scene, each: &mut dyn FnMut(Self)) {
        if scene.occluder_count() == 0 {
            each_of("objects of which none is flagged as an occluder", scene.len(), each);
        }
    }
}

/// Calls `each` with the lack `what` of `count` objects. Does nothing if `count` is 0.
fn each_of(what: &'static str, count: usize, each: &mut dyn FnMut(Lack)) {
    if count > 0 {
        each(Lack { what, count });
    }
}

impl core::fmt::Display for Lack {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}: {}", self.what, self.count)
    }
}

/// Removes from a set of objects those that a view cannot see.
///
/// A culler owns the scratch memory and the temporal coherence of one view. Stereo, split screen and shadow
/// cascades therefore use several cullers over one `&Scene`, on as many threads as the engine likes. A
/// [`Pipeline`](crate::Pipeline) combines and calls cullers, and fills the set with candidates before the
/// first one. Code that calls `cull` itself must call [`VisibleSet::fill`] before.
///
/// ```
/// use visibility_core::{Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet};
/// /// Hides every other object: a culler in its smallest form.
/// struct Odd;
/// impl Culler for Odd {
///     fn name(&self) -> &str { "odd" }
///     fn accuracy(&self) -> Accuracy { Accuracy::Approximate }
///     fn cull(&mut self, scene: &Scene, _: &View, visible: &mut VisibleSet) -> CullStats {
///         visible.retain(scene, |id, _bounds| id.index() % 2 == 1)
///     }
/// }
/// ```
pub trait Culler {
    /// Returns the culler's name, a word or two, for tables and for
    /// [`Explanation`](crate::pipeline::Explanation).
    fn name(&self) -> &str;

    /// Returns the accuracy that the culler guarantees with its present settings.
    fn accuracy(&self) -> Accuracy;

    /// Removes from `visible`, which holds the candidates, the objects that this culler finds hidden from
    /// `view`. Objects that are never culled stay. Returns counters of the work done; their `visible` is the
    /// number of objects left.
    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats;

    /// Culls like [`cull`](Self::cull), on the threads of a job system. The answer does not depend on the job
    /// system or its number of threads. It may differ from that of [`cull`](Self::cull) within the
    /// [accuracy](Self::accuracy). The default implementation calls [`cull`](Self::cull). A culler that wraps
    /// another passes the job system on.
    fn cull_on(
        &mut self,
        _jobs: &dyn Jobs,
        scene: &Scene,
        view: &View,
        visible: &mut VisibleSet,
    ) -> CullStats {
        self.cull(scene, view, visible)
    }

    /// Removes from `visible` only objects that are hidden from every view of `region`, so that the set is
    /// good for all of them. On the threads of a job system if `jobs` is given. Returns `None`, with
    /// unspecified content of `visible`, if the culler has no such answer, as the default does: a pipeline
    /// then culls for the frame's view alone.
    fn cull_region(
        &mut self,
        _jobs: Option<&dyn Jobs>,
        _scene: &Scene,
        _region: &ViewRegion,
        _visible: &mut VisibleSet,
    ) -> Option<CullStats> {
        None
    }

    /// Returns whether the last answer of [`cull_region`](Self::cull_region) still holds as far as the
    /// culler's own sources go: false if something else than the scene has changed since, such as a door or
    /// an occluder that the culler shares with the engine. True by default. A culler that wraps another must
    /// return the answer of the wrapped culler.
    fn answer_holds(&self) -> bool {
        true
    }

    /// Calls `each` for everything that keeps the culler from hiding objects of `scene` as it could: input
    /// that is missing or of another scene, or an eye that was outside all viewcells or cells in the last
    /// frame. For overlays and logs rather than for every frame; see
    /// [`Pipeline::for_each_lack`](crate::Pipeline::for_each_lack). The default implementation reports
    /// nothing.
    fn for_each_lack(&self, _scene: &Scene, _each: &mut dyn FnMut(Lack)) {}

    /// Returns whether the culler hides objects behind objects of the set. A culler that [follows draw
    /// ranges](Self::follows_draw_ranges) must come before it in a [`Pipeline`](crate::Pipeline), and the
    /// pipeline reports it as a lack otherwise. False by default. A culler that wraps another must return the
    /// answer of the wrapped culler.
    fn hides_behind_objects(&self) -> bool {
        false
    }

    /// Returns whether the culler hides objects outside their [draw ranges](Scene::set_draw_range). If no
    /// culler of a [`Pipeline`](crate::Pipeline) does, the pipeline reports draw ranges as a lack. False by
    /// default. A culler that wraps another must return the answer of the wrapped culler.
    fn follows_draw_ranges(&self) -> bool {
        false
    }

    /// Returns whether the culler hides objects behind always drawn objects without asking whether these are
    /// in the set: behind a level, or by sets or cells made beforehand. If another culler of a
    /// [`Pipeline`](crate::Pipeline) [follows sizes](Self::follows_sizes), in whatever order, objects are
    /// hidden behind others that are not drawn, and the pipeline reports it as a lack. False by default. A
    /// culler that wraps another must return the answer of the wrapped culler.
    fn hides_behind_undrawn(&self) -> bool {
        false
    }

    /// Returns whether the culler, with its present settings, removes objects because they are small in the
    /// picture. False by default. A culler that wraps another must return the answer of the wrapped culler.
    fn follows_sizes(&self) -> bool {
        false
    }

    /// Tells the culler that the engine draws another view than the one it culls for. A
    /// [`Pipeline`](crate::Pipeline) calls it before each frame in which it is
    /// [frozen](crate::Pipeline::freeze), and when that ends. A culler that asks the engine about what is
    /// drawn must forget the answers, also those that have not arrived: they are about the other view. The
    /// default implementation does nothing. A culler that wraps another passes the call on.
    fn draws_other_view(&mut self) {}

    /// Discards all state from earlier frames, as if the culler were new. Never needed for correct results:
    /// camera cuts and other scenes are safe without a reset. The default implementation does nothing, for
    /// cullers that keep no such state.
    fn reset(&mut self) {}
}
