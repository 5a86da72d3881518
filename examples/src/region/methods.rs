//! Methods of the program `region` by name. To add a method, implement [`Method`] for its culler and add an
//! entry to [`METHODS`].

use super::planes::PlaneMap;
use crate::walkthrough::World;
use glam::DVec3;
use std::sync::Arc;
use visibility_2d::horizon::UpAxis;
use visibility_2d::virtual_occluders::VirtualOccluderCuller;
use visibility_core::pvs::Viewcell;
use visibility_core::{Culler, ObjectId, RegionCuller, Scene};
use visibility_exact::{Effort, ExactCuller, ExactSettings, SceneTriangles, Verdict};
use visibility_hzb::{Hzb, HzbCuller};
use visibility_region::{
    ConvexBlockersCuller, ExtendedProjectionCuller, SamplingCuller, ShrunkCuller, VolumetricCuller,
};

/// Culler from viewcells whose answers can be drawn.
pub trait Method: RegionCuller {
    /// Returns segments in world space, drawn from above to show how the last answer was found. By default
    /// the lines of sight.
    fn lines(&self) -> Vec<[DVec3; 2]> {
        self.sights().into_iter().map(|(_, line)| line).collect()
    }

    /// Returns the projection planes of a viewcell with their occlusion maps. Empty for methods without
    /// projection planes.
    fn planes(&mut self, _scene: &Scene, _cell: &Viewcell) -> Vec<PlaneMap> {
        Vec::new()
    }

    /// Returns the lines of sight of the last answer in world space, each with the index of the object that
    /// it reaches.
    fn sights(&self) -> Vec<(u32, [DVec3; 2])> {
        Vec::new()
    }

    /// Returns the clearance in metres. The method promises to find objects seen along a line that keeps six
    /// times the clearance from all occluders. 0 for methods without this restriction.
    fn clearance(&self) -> f64 {
        0.0
    }

    /// Sets a function that ends long work on the following viewcells: once `stop` returns true, the method
    /// returns what it has. Methods that are always fast ignore it.
    fn set_stop(&mut self, _stop: Box<dyn Fn() -> bool + Send + Sync>) {}

    /// Returns bounds on the error of the last answer. `None` for methods without such bounds.
    fn sandwich(&self) -> Option<Sandwich> {
        None
    }
}

/// Bounds on the true answer from one method: numbers of objects certainly seen, certainly hidden, and
/// undecided.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Sandwich {
    /// Number of objects that a line of sight reaches.
    pub seen: usize,
    /// Number of objects proven hidden, or proven to be hardly visible.
    pub hidden: usize,
    /// Number of objects neither seen nor proven hidden. They count as visible.
    pub open: usize,
    /// Number of proofs, all of which were checked.
    pub proofs: usize,
    /// Number of proofs that failed the check. Any such proof is an error of the method.
    pub bad_proofs: usize,
}

/// Method that is ready to run, or a message for a person why it cannot be made.
pub type Made = Result<Box<dyn Method>, String>;

/// Method with its entry on the command line.
pub type Named = (String, Box<dyn Method>);

/// Entry of the table of methods.
pub struct Entry {
    /// Name on the command line.
    pub name: &'static str,
    /// Description of the setting after the colon, for help texts. Empty for a method without a setting.
    pub dial: &'static str,
    /// Function that makes the method for a world. Its first argument is the text after the colon, if any.
    /// The error is a message for a person.
    pub make: fn(Option<&str>, &World) -> Made,
}

/// Table of all methods.
pub const METHODS: &[Entry] = &[
    Entry { name: "sweep", dial: "", make: |_, _| Ok(Box::new(ExtendedProjectionCuller::new())) },
    Entry {
        name: "exact",
        dial: "CLEARANCE",
        make: |dial, world| exact(Effort::Exact(dial.map_or(Ok(1e-4), number)?), world),
    },
    Entry {
        name: "share",
        dial: "EPS",
        make: |dial, world| exact(Effort::Share(dial.map_or(Ok(1e-3), number)?), world),
    },
    Entry {
        name: "plan",
        dial: "MOST",
        make: |dial, world| {
            let up = if world.source.up.y.abs() > 0.5 { UpAxis::Y } else { UpAxis::Z };
            let culler = VirtualOccluderCuller::new(up);
            Ok(Box::new(match dial {
                Some(most) => culler.with_max(number(most)?),
                None => culler,
            }))
        },
    },
    Entry { name: "convex", dial: "", make: |_, _| Ok(Box::new(ConvexBlockersCuller::new())) },
    Entry {
        name: "rays",
        dial: "N",
        make: |dial, _| {
            let culler = SamplingCuller::new();
            Ok(Box::new(match dial {
                Some(rays) => culler.with_rays(number(rays)?),
                None => culler,
            }))
        },
    },
    Entry {
        name: "shrink",
        dial: "POINTS",
        make: |dial, _| {
            let points = dial.map_or(Ok(4), number)?;
            let map = Hzb::new(512, 512).map_err(|error| error.to_string())?;
            Ok(Box::new(ShrunkCuller::new(HzbCuller::new(map), points)))
        },
    },
    Entry { name: "volume", dial: "", make: |_, _| Ok(Box::new(VolumetricCuller::new())) },
];

impl Method for ExtendedProjectionCuller {
    fn planes(&mut self, scene: &Scene, cell: &Viewcell) -> Vec<PlaneMap> {
        let mut planes = Vec::new();
        self.for_each_plane(scene, cell, |plane| planes.push(PlaneMap::new(&plane)));
        planes
    }
}

fn exact(effort: Effort, world: &World) -> Made {
    let triangles = Arc::new(SceneTriangles::new(&world.scene));
    Ok(Box::new(ExactCuller::new(triangles, ExactSettings::new(effort))))
}

impl Method for ExactCuller {
    fn sights(&self) -> Vec<(u32, [DVec3; 2])> {
        let verdicts = self.last().into_iter().flat_map(|found| found.iter(self.triangles()));
        let origin = self.triangles().origin();
        let line = |(id, verdict): (ObjectId, Verdict)| match verdict {
            Verdict::Seen(sight) => Some((id.index() as u32, [sight.from + origin, sight.to + origin])),
            _ => None,
        };
        verdicts.filter_map(line).collect()
    }

    fn clearance(&self) -> f64 {
        self.settings().clearance()
    }

    fn set_stop(&mut self, stop: Box<dyn Fn() -> bool + Send + Sync>) {
        self.set_stop(Some(stop));
    }

    fn sandwich(&self) -> Option<Sandwich> {
        let found = self.last()?;
        let [seen, hidden, open] = found.counts();
        // The culler has checked all proofs itself, and counts those that failed.
        let (proofs, bad_proofs) = ((found.proof_count + found.refused) as usize, found.refused as usize);
        Some(Sandwich { seen, hidden, open, proofs, bad_proofs })
    }
}

impl Method for VolumetricCuller {
    fn lines(&self) -> Vec<[DVec3; 2]> {
        self.blockers().iter().flat_map(|&[min, max]| box_edges(min, max)).collect()
    }
}

impl<C: Culler> Method for ShrunkCuller<C> {
    fn lines(&self) -> Vec<[DVec3; 2]> {
        // A small box around each sample point.
        let mark = |&p: &DVec3| box_edges(p - 0.05, p + 0.05);
        self.points().iter().flat_map(mark).collect()
    }
}

impl Method for VirtualOccluderCuller {
    fn lines(&self) -> Vec<[DVec3; 2]> {
        self.occluders().iter().flat_map(|occluder| sides(occluder.corners())).collect()
    }
}

impl Method for ConvexBlockersCuller {
    fn lines(&self) -> Vec<[DVec3; 2]> {
        self.blockers().iter().flat_map(|&[min, max]| box_edges(min, max)).collect()
    }
}

impl Method for SamplingCuller {
    fn sights(&self) -> Vec<(u32, [DVec3; 2])> {
        self.sight_lines().iter().map(|line| (line.id.index() as u32, [line.eye, line.point])).collect()
    }
}

/// Returns the four sides of a rectangle, whose `corners` are given in order around it.
fn sides(corners: [DVec3; 4]) -> impl Iterator<Item = [DVec3; 2]> {
    (0..4).map(move |i| [corners[i], corners[(i + 1) % 4]])
}

/// Returns the twelve edges of a box.
pub fn box_edges(min: DVec3, max: DVec3) -> impl Iterator<Item = [DVec3; 2]> {
    let corner =
        move |i: usize| DVec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), max, min);
    (0..8)
        .flat_map(|i| [1, 2, 4].map(|bit| (i, i | bit)))
        .filter(|(i, j)| i != j)
        .map(move |(i, j)| [corner(i), corner(j)])
}

/// Reads the number after a method's colon. The error is a message for a person.
pub fn number<T: std::str::FromStr<Err: std::fmt::Display>>(text: &str) -> Result<T, String> {
    text.parse().map_err(|error| format!("{text}: {error}"))
}

/// Returns each method with the description of its setting, for help texts.
pub fn known() -> impl Iterator<Item = String> {
    METHODS.iter().map(|entry| match entry.dial {
        "" => entry.name.to_owned(),
        dial => format!("{}[:{dial}]", entry.name),
    })
}

/// Makes the methods of a list separated by commas, such as `sweep,rays:100000`. Each method is returned with
/// its entry in the list.
///
/// # Errors
///
/// Returns a message if a method is unknown, or its setting is invalid.
pub fn parse(list: &str, world: &World) -> Result<Vec<Named>, String> {
    list.split(',')
        .map(|text| {
            let text: String = text.split_whitespace().collect();
            let (name, dial) =
                text.split_once(':').map_or((&text[..], None), |(name, dial)| (name, Some(dial)));
            let entry = METHODS.iter().find(|entry| entry.name == name).ok_or_else(|| {
                format!("there is no method `{name}`, only {}", known().collect::<Vec<_>>().join(", "))
            })?;
            if dial.is_some() && entry.dial.is_empty() {
                return Err(format!("the method `{name}` has no dial"));
            }
            let method = (entry.make)(dial, world).map_err(|error| format!("{text}: {error}"))?;
            Ok((text, method))
        })
        .collect()
}
