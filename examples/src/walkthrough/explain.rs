//! Explanation, frame by frame, of why one object is drawn or not.

use super::World;
use std::fmt::Write;
use visibility_core::{Pipeline, VisibleSet};

/// Returns the index of an object by its index or name. Of several objects with the name, the first counts. A
/// number below the number of objects is always an index. `None` if there is no such object.
pub fn find(world: &World, wanted: &str) -> Option<u32> {
    let by_name = || world.source.objects.iter().position(|object| object.name == *wanted);
    let place =
        wanted.parse().ok().filter(|&place: &usize| place < world.source.objects.len()).or_else(by_name)?;
    u32::try_from(place).ok()
}

/// Returns lines of text that say what happened to an object in each run of frames: visible, or removed by a
/// stage. `object` is an index.
pub fn explain(world: &World, pipeline: &mut Pipeline, object: u32) -> String {
    pipeline.set_explaining(true);
    let id = world.scene.ids().nth(object as usize);
    let mut visible = VisibleSet::new();
    let mut runs: Vec<(usize, String)> = Vec::new();
    for (frame, view) in world.views.iter().enumerate() {
        pipeline.cull(&world.scene, view, &mut visible);
        let fate = id.map_or_else(String::new, |id| pipeline.explain(id).to_string());
        if runs.last().is_none_or(|(_, last)| *last != fate) {
            runs.push((frame, fate));
        }
    }
    pipeline.set_explaining(false);
    let ends =
        runs.iter().skip(1).map(|(start, _)| start - 1).chain([world.views.len() - 1]).collect::<Vec<_>>();
    runs.iter().zip(ends).fold(String::new(), |mut text, ((start, fate), end)| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  frames {start:4} to {end:4}: {fate}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{built_in, walkthrough::cullers};

    #[test]
    fn every_frame_of_the_walk_is_accounted_for() {
        let world = World::new(built_in("office").unwrap(), (64, 36), Some(20)).unwrap();
        let mut pipeline = cullers::parse("frustum", &world).unwrap().remove(0).1;
        let first = find(&world, "slab").unwrap();
        assert_eq!(
            (first, find(&world, "7"), find(&world, "no such thing")),
            (0, Some(7), None),
            "objects by name and by number, and an unknown one"
        );
        let text = explain(&world, &mut pipeline, 778);
        assert!(text.starts_with("  frames    0 to") && text.trim_end().contains("to   19:"), "{text}");
        assert!(text.contains("removed by frustum") || text.contains("visible"), "{text}");
    }
}
