//! Division of regions with many edges into pieces: a wide floor with a hundred corners would otherwise cost
//! as much to draw from each of its rooms.

use crate::faces::Faces;
use crate::outlines::{outline, straighten};
use crate::regions::{Member, Region, Regions};
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// Divides regions whose outlines have more than `max_edges` edges, not counting vertices on straight lines.
/// A region is halved by the middles of its faces, along the axis in which the middles extend farthest. A
/// region of one face stays whole.
pub(crate) fn divide_regions(regions: &mut Regions, faces: &Faces, max_edges: usize) {
    let mut waiting: Vec<Region> = core::mem::take(&mut regions.regions);
    waiting.reverse();
    while let Some(mut region) = waiting.pop() {
        let [first, end] = region.members.map(|index| index as usize);
        if end - first < 2 || edge_count(faces, regions, &region) <= max_edges {
            regions.regions.push(region);
            continue;
        }
        let middle = |member: &Member| {
            let corners = faces.corners_of(&faces.faces[member.face as usize]);
            corners.iter().fold(DVec3::ZERO, |sum, &v| sum + faces.at(v)) / corners.len() as f64
        };
        let members = &mut regions.members[first..end];
        let mut placed: Vec<(DVec3, Member)> =
            members.iter().map(|member| (middle(member), *member)).collect();
        let low = placed.iter().map(|(at, _)| *at).fold(DVec3::INFINITY, DVec3::min);
        let high = placed.iter().map(|(at, _)| *at).fold(DVec3::NEG_INFINITY, DVec3::max);
        let (axis, half) = ((high - low).max_position(), placed.len() / 2);
        placed.select_nth_unstable_by(half, |(a, of_a), (b, of_b)| {
            a[axis].total_cmp(&b[axis]).then(of_a.face.cmp(&of_b.face))
        });
        for (member, (_, sorted)) in members.iter_mut().zip(placed) {
            *member = sorted;
        }
        for range in [[first, first + half], [first + half, end]] {
            region.measure(faces, &regions.members[range[0]..range[1]]);
            waiting.push(Region { members: range.map(|index| index as u32), ..region.clone() });
        }
    }
}

/// Returns the number of edges of a region's outline. Successive edges on one straight line count as one.
fn edge_count(faces: &Faces, regions: &Regions, region: &Region) -> usize {
    let mut outline = [outline(faces, regions, region)];
    straighten(&faces.vertices, &mut outline);
    outline[0].len()
}
