//! Finder of module cycles: groups of modules that depend on each other, so that none of them can be read or
//! changed alone.

use crate::module_tree::ModuleTree;
use std::path::Path;

/// Returns the groups of modules of a crate that depend on each other. Each group is a list of texts, one per
/// module: its file below the crate's `src`, and the files of the group that it uses. `root` is the crate's
/// root file.
///
/// # Errors
///
/// Returns the first file that cannot be read or parsed, and why.
pub(crate) fn cycles(root: &Path) -> Result<Vec<Vec<String>>, String> {
    let tree = ModuleTree::read(root)?;
    let needs: Vec<Vec<usize>> = (0..tree.modules.len()).map(|module| tree.needs(module)).collect();
    let folder = root.parent().unwrap_or(root);
    let name = |module: usize| {
        let file = &tree.modules[module].file;
        file.strip_prefix(folder).unwrap_or(file).display().to_string()
    };
    let describe = |group: Vec<usize>| {
        let line = |&module: &usize| {
            let others = needs[module].iter().filter(|other| group.contains(other));
            format!(
                "{} needs {}",
                name(module),
                others.map(|&other| name(other)).collect::<Vec<_>>().join(", ")
            )
        };
        group.iter().map(line).collect()
    };
    Ok(circles(&needs).into_iter().map(describe).collect())
}

/// Returns the strongly connected components with more than one node: the nodes that reach each other.
/// `needs[i]` are the successors of node i. Each component is sorted. The cost is nodes times edges.
fn circles(needs: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let reached: Vec<Vec<bool>> = (0..needs.len())
        .map(|start| {
            let (mut seen, mut stack) = (vec![false; needs.len()], needs[start].clone());
            while let Some(node) = stack.pop() {
                if !std::mem::replace(&mut seen[node], true) {
                    stack.extend(&needs[node]);
                }
            }
            seen
        })
        .collect();
    let group = |a: usize| (0..needs.len()).filter(|&b| reached[a][b] && reached[b][a]).collect::<Vec<_>>();
    (0..needs.len()).filter_map(|a| Some(group(a)).filter(|group| group.first() == Some(&a))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn circles_are_found_and_chains_are_not() {
        assert!(circles(&[vec![1, 2], vec![2], vec![]]).is_empty(), "a chain of modules");
        assert_eq!(
            circles(&[vec![1], vec![2], vec![1], vec![0]]),
            [[1, 2]],
            "two modules that need each other, with one before"
        );
    }

    #[test]
    fn this_crate_has_none() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/main.rs");
        assert_eq!(cycles(&root), Ok(Vec::new()), "circles of modules in this crate");
    }
}
