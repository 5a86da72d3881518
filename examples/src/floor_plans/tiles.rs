//! Walls around the solid cells of a grid of tiles, and which layers of a tile map are walls.

use super::plan_file::PlanFile;
use std::collections::BTreeSet;

/// Parts of names, in lower case, by which a layer counts as walls.
const WALL_NAMES: [&str; 4] = ["wall", "collision", "solid", "block"];

/// Solid cells of a layer, by column and row.
pub(super) type Cells = BTreeSet<(i32, i32)>;

/// Returns, for each layer, whether it has walls: those that `wanted` names (case does not matter), or else
/// those with a name such as "Walls" or "Collisions", or else all.
///
/// # Errors
///
/// Returns a message with the names of all layers if one of `wanted` is not among them.
pub(super) fn chosen(names: &[&str], wanted: &[String]) -> Result<Vec<bool>, String> {
    let is_wanted = |name: &str| wanted.iter().any(|wanted| wanted.eq_ignore_ascii_case(name));
    let is_wall = |name: &str| {
        let name = name.to_lowercase();
        WALL_NAMES.iter().any(|part| name.contains(part))
    };
    if let Some(missing) = wanted.iter().find(|wanted| !names.iter().any(|n| wanted.eq_ignore_ascii_case(n)))
    {
        return Err(format!("no layer is named `{missing}`; the layers are {}", names.join(", ")));
    }
    let by = |is: &dyn Fn(&str) -> bool| names.iter().map(|name| is(name)).collect::<Vec<_>>();
    let chosen = if wanted.is_empty() { by(&is_wall) } else { by(&is_wanted) };
    Ok(if chosen.contains(&true) { chosen } else { by(&|_| true) })
}

/// Adds the sides at which solid cells meet other cells. Sides in a row become one wall. Cells have the given
/// size, and cell (0, 0) begins at `origin`.
pub(super) fn push_outlines(cells: &Cells, origin: [f64; 2], size: [f64; 2], plan: &mut PlanFile) {
    // Sides that cross `axis`, as (line across the axis, place along it).
    for axis in 0..2 {
        let mut sides = BTreeSet::new();
        for &(x, y) in cells {
            let before = [(x.checked_sub(1), Some(y)), (Some(x), y.checked_sub(1))][axis];
            let after = [(x.checked_add(1), Some(y)), (Some(x), y.checked_add(1))][axis];
            let [across, along] = [[x, y], [y, x]][axis].map(i64::from);
            for (neighbour, line) in [(before, across), (after, across + 1)] {
                if !neighbour.0.zip(neighbour.1).is_some_and(|neighbour| cells.contains(&neighbour)) {
                    sides.insert((line, along));
                }
            }
        }
        let mut run: Option<(i64, i64, i64)> = None;
        let mut push = |(line, first, end): (i64, i64, i64)| {
            plan.walls.push([first, end].map(|along| {
                let [x, y] = if axis == 0 { [line, along] } else { [along, line] }.map(|k| k as f64);
                [origin[0] + x * size[0], origin[1] + y * size[1]]
            }));
        };
        for (line, along) in sides {
            run = Some(match run {
                Some((at, first, end)) if at == line && end == along => (at, first, along + 1),
                before => {
                    before.map(&mut push);
                    (line, along, along + 1)
                }
            });
        }
        run.map(&mut push);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outlines(cells: &[(i32, i32)]) -> Vec<[[f64; 2]; 2]> {
        let mut plan = PlanFile::default();
        push_outlines(&cells.iter().copied().collect(), [100.0, 0.0], [2.0, 3.0], &mut plan);
        plan.walls
    }

    #[test]
    fn sides_in_a_row_are_one_wall() {
        let walls = outlines(&[(0, 0), (1, 0), (2, 0), (2, 1)]);
        // The outline of an L has six corners, and so six walls.
        assert_eq!(walls.len(), 6, "walls of an L: {walls:?}");
        assert!(walls.contains(&[[100.0, 0.0], [106.0, 0.0]]), "three cells along the top: {walls:?}");
        assert!(walls.contains(&[[106.0, 0.0], [106.0, 6.0]]), "two cells at the right: {walls:?}");
        assert!(walls.contains(&[[100.0, 3.0], [104.0, 3.0]]), "below the first two: {walls:?}");
    }

    #[test]
    fn cells_at_the_ends_of_numbers_and_cells_that_meet_at_a_corner_have_four_walls_each() {
        assert_eq!(outlines(&[(0, 0), (1, 1)]).len(), 8 - 2, "two walls join at the common corner's lines");
        assert_eq!(outlines(&[(i32::MAX, i32::MIN)]).len(), 4, "walls of a cell at the ends of numbers");
        assert_eq!(outlines(&[]), [[[0.0; 2]; 2]; 0], "no cells");
    }

    #[test]
    fn layers_are_chosen_by_wish_then_by_name_then_all() {
        let names = ["Floor", "Inner Walls", "Sky"];
        let wish = |name: &str| chosen(&names, &[name.to_owned()]);
        assert_eq!(chosen(&names, &[]), Ok(vec![false, true, false]), "by name");
        assert_eq!(wish("floor"), Ok(vec![true, false, false]), "by wish");
        assert!(wish("roof").unwrap_err().contains("Floor, Inner Walls, Sky"), "an unknown layer");
        assert_eq!(chosen(&["A", "B"], &[]), Ok(vec![true, true]), "all, where no name tells");
    }
}
