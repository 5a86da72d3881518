//! Groups of modules that need each other in a circle, so that none of them can be read or changed alone.

use crate::module_tree::ModuleTree;
use std::path::Path;

/// The groups of a crate, each as the names of its files below the crate's `src` and the files that they need
/// in the group.
///
/// # Errors
/// The first file that cannot be read or parsed, and why.
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

/// The strongly connected components of more than one node, each sorted: nodes that reach each other.
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
        assert!(circles(&[vec![1, 2], vec![2], vec![]]).is_empty());
        assert_eq!(circles(&[vec![1], vec![2], vec![1], vec![0]]), [[1, 2]]);
    }

    #[test]
    fn this_crate_has_none() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/main.rs");
        assert_eq!(cycles(&root), Ok(Vec::new()));
    }
}
