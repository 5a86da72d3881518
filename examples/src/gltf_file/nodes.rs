//! The nodes of a glTF document: their hierarchy, and their transforms to world space.

use super::document::Document;
use crate::error::SourceError;
use glam::DMat4;
use std::ops::Range;
use std::path::Path;

/// Nodes of a document.
pub(super) struct Nodes {
    /// Matrix from the document's space to world space.
    pub root: DMat4,
    /// Parent of each node, by node index. `None` for a root.
    pub parents: Vec<Option<usize>>,
    /// All nodes, each followed by its descendants.
    pub order: Vec<usize>,
    /// Positions in `order` of each node and its descendants, by node index.
    pub subtrees: Vec<Range<usize>>,
    /// Matrices from each node's space to world space at rest, by node index.
    pub worlds: Vec<DMat4>,
    /// Whether an animation by `KHR_animation_pointer` or an extension that is not read may move the node or
    /// one of its ancestors, by node index.
    pub is_pointed_at: Vec<bool>,
    /// Visible nodes of the scene that the program reads, in the order of the file, parents before children.
    pub placed: Vec<usize>,
}

impl Nodes {
    /// Computes the world transforms of a document's nodes. `root` is the matrix from the document's space to
    /// world space. The scene that is read is the default scene, or else the first scene, or else all nodes.
    /// Counts hidden nodes in `document.unread`.
    ///
    /// # Errors
    ///
    /// Returns [`SourceError::Content`] when nodes do not form trees.
    pub(super) fn new(document: &mut Document, root: DMat4, path: &Path) -> Result<Self, SourceError> {
        let wrong = |node: usize, problem: &str| {
            let problem = format!("{problem}: nodes must form trees");
            SourceError::content(path, format!("node {node}"), problem)
        };
        let twice = |node| wrong(node, "it is reached twice");
        let count = document.gltf.nodes().len();
        let mut parents = vec![None; count];
        for node in document.gltf.nodes() {
            for child in node.children() {
                if parents[child.index()].replace(node.index()).is_some() {
                    return Err(twice(child.index()));
                }
            }
        }
        let children: Vec<Vec<usize>> =
            document.gltf.nodes().map(|node| node.children().map(|child| child.index()).collect()).collect();
        let tops: Vec<usize> = (0..count).filter(|&node| parents[node].is_none()).collect();
        let order = below(&tops, &children, |_| true).map_err(twice)?;
        if order.len() < count {
            let mut is_reached = vec![false; count];
            order.iter().for_each(|&node| is_reached[node] = true);
            let lost = is_reached.iter().position(|is_reached| !is_reached).unwrap_or_default();
            return Err(wrong(lost, "it is reached twice, by itself"));
        }
        let mut subtrees = vec![0..0; count];
        for (place, &node) in order.iter().enumerate().rev() {
            // Descendants come later in the order, so the end of the last child is known.
            subtrees[node] = place..subtrees[node].end.max(place + 1);
            if let Some(parent) = parents[node] {
                subtrees[parent].end = subtrees[parent].end.max(subtrees[node].end);
            }
        }
        let (mut worlds, mut is_pointed_at) = (vec![root; count], document.is_pointed_at.clone());
        for &node in &order {
            let parent = parents[node].map_or(root, |parent| worlds[parent]);
            worlds[node] = parent * document.transforms[node].matrix();
            is_pointed_at[node] |= parents[node].is_some_and(|parent| is_pointed_at[parent]);
        }
        let scene = document.gltf.default_scene().or_else(|| document.gltf.scenes().next());
        let tops = scene.map_or(tops, |scene| scene.nodes().map(|node| node.index()).collect());
        let all = below(&tops, &children, |_| true).map_err(twice)?;
        let is_hidden: Vec<bool> = document
            .gltf
            .nodes()
            .map(|node| {
                let extension = node.extension_value("KHR_node_visibility");
                let visible = extension.and_then(|extension| extension.get("visible")?.as_bool());
                visible == Some(false) && !document.is_shown[node.index()]
            })
            .collect();
        let placed = below(&tops, &children, |node| !is_hidden[node]).unwrap_or_default();
        document.unread.hidden_nodes = all.len() - placed.len();
        Ok(Self { root, parents, order, subtrees, worlds, is_pointed_at, placed })
    }
}

/// Returns the nodes `tops` and all their descendants in the order of the file, each node followed by its
/// descendants.
/// Nodes that are not `kept` are left out with their descendants. Returns the first node that is reached
/// twice as the error. Uses an explicit stack, so any depth is possible.
fn below(tops: &[usize], children: &[Vec<usize>], kept: impl Fn(usize) -> bool) -> Result<Vec<usize>, usize> {
    let mut is_reached = vec![false; children.len()];
    let mut order = Vec::new();
    let mut waiting: Vec<usize> = tops.iter().rev().copied().collect();
    while let Some(node) = waiting.pop() {
        if std::mem::replace(&mut is_reached[node], true) {
            return Err(node);
        }
        if kept(node) {
            order.push(node);
            waiting.extend(children[node].iter().rev());
        }
    }
    Ok(order)
}
