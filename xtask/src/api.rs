//! Listings of the public items of all published crates, stored in `docs/api`.

use crate::crates::{package_name, published_crates};
use crate::public_items::public_items;
use std::collections::BTreeSet;
use std::path::Path;

/// Compares the public items of each published crate with the stored listing, prints the lines that differ
/// and returns their number. With `write` stores the listings instead and returns 0.
///
/// # Errors
///
/// Returns the first file that cannot be read, parsed or written, and why. A missing listing counts as empty.
pub(crate) fn check(root: &Path, write: bool) -> Result<usize, String> {
    let mut count = 0;
    for folder in published_crates(root)? {
        let package = package_name(&folder);
        let lines = public_items(&folder.join("src/lib.rs"), &package.replace('-', "_"))?;
        let path = root.join("docs/api").join(format!("{package}.txt"));
        if write {
            let text: String = lines.iter().flat_map(|line| [line, "\n"]).collect();
            std::fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))?;
            continue;
        }
        let stored = std::fs::read_to_string(&path).unwrap_or_default();
        let differing = differences(&stored.lines().map(str::to_owned).collect(), &lines);
        differing.iter().for_each(|line| println!("{line}"));
        count += differing.len();
    }
    if count > 0 {
        println!("public items differ from docs/api; if that is meant: cargo run -p xtask -- api --write");
    }
    Ok(count)
}

/// Returns the lines that only one of two listings has, sorted, each behind `- ` (stored) or `+ ` (now).
fn differences(stored: &BTreeSet<String>, now: &BTreeSet<String>) -> Vec<String> {
    let side = |line| if stored.contains(line) { "-" } else { "+" };
    stored.symmetric_difference(now).map(|line| format!("{} {line}", side(line))).collect()
}
