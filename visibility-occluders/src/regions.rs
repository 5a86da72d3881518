//! Planar regions: neighbouring faces in one plane, to be drawn as one polygon.

use crate::faces::{Faces, Side};
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// Least cosine of the angle between the normals of a region and of a face in it. Faces of one plane may be
/// off by more than their rounding only where they are thin.
const LEAST_COSINE: f64 = 0.999;

/// Faces whose vertices all lie within a thin slab.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    /// Range of the region's faces in [`Regions::members`], half-open.
    pub(crate) members: [u32; 2],
    /// Unit normal of the slab.
    pub(crate) normal: DVec3,
    /// Least and greatest coordinate along `normal` of the region's vertices, as computed, in metres.
    pub(crate) extent: [f64; 2],
    /// Sum of the areas of the faces in square metres.
    pub(crate) area: f64,
    /// True if all faces are two-sided, false if none is.
    pub(crate) two_sided: bool,
}

/// A face of a region.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Member {
    /// Index of the face.
    pub(crate) face: u32,
    /// True if the front of the face is the back of the region. Only two-sided faces are turned.
    pub(crate) turned: bool,
}

/// A partition of all faces into regions.
#[derive(Clone, Debug, Default)]
pub(crate) struct Regions {
    /// All regions.
    pub(crate) regions: Vec<Region>,
    /// Faces of all regions.
    pub(crate) members: Vec<Member>,
}

impl Regions {
    /// Joins each face with its neighbours in the same plane: those that share an edge with it, lie within
    /// `flatness` metres of the plane of the region's first face, and look the same way. `sides` are all
    /// sides of the faces, sorted by edge.
    pub(crate) fn find(faces: &Faces, sides: &[Side], flatness: f64) -> Self {
        // For each corner, the first of the sides at the edge that begins at the corner.
        let mut first_of_edge = alloc::vec![0u32; faces.corners.len()];
        let mut at = 0;
        for same in sides.chunk_by(|a, b| a.edge == b.edge) {
            same.iter().for_each(|side| first_of_edge[side.corner as usize] = at);
            at += same.len() as u32;
        }
        let neighbours = |corner: u32| {
            let first = first_of_edge[corner as usize] as usize;
            let edge = sides[first].edge;
            sides[first..].iter().take_while(move |side| side.edge == edge)
        };
        let mut order: Vec<u32> = (0..faces.faces.len() as u32).collect();
        order.sort_by(|&a, &b| {
            faces.faces[b as usize].area.total_cmp(&faces.faces[a as usize].area).then(a.cmp(&b))
        });
        let mut taken = alloc::vec![false; faces.faces.len()];
        let mut found = Self::default();
        for seed in order {
            if core::mem::replace(&mut taken[seed as usize], true) {
                continue;
            }
            let first = found.members.len();
            found.members.push(Member { face: seed, turned: false });
            let mut region = Region {
                members: [first as u32; 2],
                normal: faces.faces[seed as usize].normal,
                extent: [f64::INFINITY, f64::NEG_INFINITY],
                area: 0.0,
                two_sided: faces.faces[seed as usize].two_sided,
            };
            let plane = region.normal.dot(faces.at(faces.corners_of(&faces.faces[seed as usize])[0]));
            let mut next = first;
            while let Some(&member) = found.members.get(next) {
                next += 1;
                let face = &faces.faces[member.face as usize];
                region.area += face.area;
                for &vertex in faces.corners_of(face) {
                    let along = region.normal.dot(faces.at(vertex));
                    region.extent = [region.extent[0].min(along), region.extent[1].max(along)];
                }
                for corner in face.corners[0]..face.corners[1] {
                    let own = neighbours(corner).find(|side| side.corner == corner);
                    let Some(own) = own else { continue };
                    for side in neighbours(corner) {
                        if taken[side.face as usize] {
                            continue;
                        }
                        let Some(turned) = turn(faces, &region, member, own, side) else { continue };
                        let flat = |v: &u32| (region.normal.dot(faces.at(*v)) - plane).abs() <= flatness;
                        if faces.corners_of(&faces.faces[side.face as usize]).iter().all(flat) {
                            taken[side.face as usize] = true;
                            found.members.push(Member { face: side.face, turned });
                        }
                    }
                }
            }
            region.members[1] = found.members.len() as u32;
            found.regions.push(region);
        }
        found
    }
}

/// Returns whether the face of `side` must be turned to continue a region beyond the edge that it shares with
/// the region's face `member` (whose own side of the edge is `own`). `None` if the face cannot continue the
/// region: it looks another way, lies on the same side of the edge, or hides from other sides.
fn turn(faces: &Faces, region: &Region, member: Member, own: &Side, side: &Side) -> Option<bool> {
    let face = &faces.faces[side.face as usize];
    let cosine = face.normal.dot(region.normal);
    let turned = cosine < 0.0;
    // Neighbours run through their edge in opposite directions, once turned.
    let is_opposite = (own.forward != member.turned) != (side.forward != turned);
    (cosine.abs() >= LEAST_COSINE
        && is_opposite
        && face.two_sided == region.two_sided
        && (!turned || face.two_sided))
        .then_some(turned)
}
