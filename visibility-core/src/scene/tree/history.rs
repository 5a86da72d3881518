//! Contents of nodes at earlier layouts, for results of frames whose ids are listed only after the scene has
//! changed.
//!
//! A result holds one mask per node; the ids that its bits stand for are those of the layout at culling. A
//! node is copied before its first change after such a layout: an undo log. Each result holds a clone of its
//! layout's token, so the log knows which copies some result may still read.

use crate::ObjectId;
use crate::scene::FAN_OUT;
use alloc::collections::VecDeque;
use alloc::vec::Vec;

/// Token of a state of the tree. Each result that was finished at that state (see [`History`]) holds a clone
/// of the token, so the reference count tells whether such a result is left.
#[cfg(target_has_atomic = "ptr")]
pub(crate) type Token = alloc::sync::Arc<u64>;

/// Processors without atomic counters have no tokens. There, a set lists its objects as soon as it is
/// finished.
#[cfg(not(target_has_atomic = "ptr"))]
pub(crate) type Token = core::convert::Infallible;

/// The undo log of a tree's nodes, for *results*: sets that were [finished](crate::VisibleSet::is_finished)
/// and have no list of their objects yet. A result still reads the nodes as they were when it was finished.
#[derive(Debug, Default)]
pub(crate) struct History {
    /// Token of the tree's present state; the value in it is the number of the state.
    #[cfg(target_has_atomic = "ptr")]
    present: Token,
    /// Tokens of earlier states, oldest first, that results may hold.
    #[cfg(target_has_atomic = "ptr")]
    earlier: Vec<Token>,
    /// Token that no result holds, kept for the next state.
    #[cfg(target_has_atomic = "ptr")]
    spare: Option<Token>,
    /// Copies of nodes, oldest first.
    copies: VecDeque<Copied>,
    /// Number of copies that were dropped from the front of `copies` so far.
    dropped: u64,
    /// For each node: the number of its newest copy, where 1 is the first copy ever made. 0 for a node that
    /// was never copied, as for nodes beyond the end of the list. A copy with a number up to `dropped` is
    /// gone.
    newest: Vec<u64>,
}

/// Content of a node at an earlier state of the scene.
#[derive(Debug)]
struct Copied {
    /// Number of the state that the content belongs to: the newest of `History::earlier` when the copy was
    /// made.
    state: u64,
    /// Number of the node's previous copy: what `newest` held for the node before this copy was made.
    older: u64,
    level: u8,
    ids: [ObjectId; FAN_OUT],
}

impl Clone for History {
    /// Returns an empty log: results belong to the original scene, not to its clone.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl History {
    /// Returns the copy with the given number, counted as in `newest`. `None` for 0, or if the copy was
    /// dropped.
    fn numbered(&self, number: u64) -> Option<&Copied> {
        self.copies.get(self.place(number)?)
    }

    /// Returns the place in `copies` of the copy with the given number. `None` for 0, or if the copy was
    /// dropped.
    fn place(&self, number: u64) -> Option<usize> {
        usize::try_from(number.checked_sub(self.dropped + 1)?).ok()
    }

    fn newest(&self, node: usize) -> u64 {
        self.newest.get(node).copied().unwrap_or(0)
    }

    /// Returns the number of bytes in use, without reserved capacity.
    pub(super) fn memory(&self) -> usize {
        self.copies.len() * size_of::<Copied>() + size_of_val(&self.newest[..])
    }
}

#[cfg(target_has_atomic = "ptr")]
impl History {
    /// Returns a token for a result of the present state. As long as the token lives, [`at`](Self::at)
    /// returns the content of nodes at that state. `None` on processors without atomic counts.
    pub(super) fn token(&self) -> Option<Token> {
        Some(self.present.clone())
    }

    /// Returns whether a result may be left that still reads the nodes as they are now or were at an earlier
    /// state, so that a node must be [copied](Self::copy) before it is changed.
    #[inline]
    pub(super) fn is_needed(&self) -> bool {
        !self.earlier.is_empty() || Token::strong_count(&self.present) > 1
    }

    /// Copies the content of a node before it is changed. Copies nothing if the present content was copied
    /// before, or if no result is left to read it. `nodes` is the number of nodes of the tree.
    #[cold]
    pub(super) fn copy(&mut self, node: usize, nodes: usize, level: u8, ids: &[ObjectId; FAN_OUT]) {
        if Token::strong_count(&self.present) > 1 {
            self.begin_state();
        }
        let Some(state) = self.earlier.last().map(|token| **token) else { return };
        let older = self.newest(node);
        if self.numbered(older).is_some_and(|copy| copy.state == state) {
            return;
        }
        if self.earlier.iter().all(|token| Token::strong_count(token) == 1) {
            return self.forget();
        }
        if self.newest.len() < nodes {
            self.newest.resize(nodes, 0);
        }
        if self.copies.capacity() == 0 {
            // Reserves what most frames need. Growing step by step, a scene in which little changes would
            // allocate now and then for many frames.
            self.copies.reserve(64.max(nodes / 8));
        }
        self.copies.push_back(Copied { state, older, level, ids: *ids });
        self.newest[node] = self.dropped + self.copies.len() as u64;
    }

    /// Returns the level and the ids of a node as they were at the state of a token. `None` if the node has
    /// not changed since, or without a token.
    pub(super) fn at(&self, node: usize, token: Option<&Token>) -> Option<(u8, &[ObjectId; FAN_OUT])> {
        let state = **token?;
        let (mut number, mut content) = (self.newest(node), None);
        while let Some(copy) = self.numbered(number).filter(|copy| copy.state >= state) {
            content = Some((copy.level, &copy.ids));
            number = copy.older;
        }
        content
    }

    /// Begins a new state of the tree, because results hold the token of the present one. Drops copies that
    /// are older than all states with results; if many are left, also all others that no result reads.
    fn begin_state(&mut self) {
        let Self { earlier, spare, copies, .. } = self;
        earlier.retain_mut(|token| {
            let is_held = Token::strong_count(token) > 1;
            if !is_held {
                *spare = Some(token.clone());
            }
            is_held
        });
        let next = *self.present + 1;
        let oldest = earlier.first().map_or(*self.present, |token| **token);
        while copies.front().is_some_and(|copy| copy.state < oldest) {
            copies.pop_front();
            self.dropped += 1;
        }
        // A held token reads one copy of a node at most, so more copies than these are of states between.
        if copies.len() > (earlier.len() + 1) * self.newest.len() {
            self.drop_unread();
        }
        let Self { earlier, spare, .. } = self;
        let fresh = match spare.take() {
            Some(mut token) => match Token::get_mut(&mut token) {
                Some(number) => {
                    *number = next;
                    token
                }
                None => Token::new(next),
            },
            None => Token::new(next),
        };
        earlier.push(core::mem::replace(&mut self.present, fresh));
    }

    /// Drops the copies that no token of an earlier state reads. Time is that of sorting the copies.
    fn drop_unread(&mut self) {
        let mut read = Vec::new();
        for node in 0..self.newest.len() {
            let mut number = core::mem::take(&mut self.newest[node]);
            while let Some(place) = self.place(number) {
                let Copied { state, older, .. } = self.copies[place];
                // A token reads the oldest copy of its state or a later one.
                let before = self.place(older).map(|place| self.copies[place].state);
                let until = self.earlier.partition_point(|token| **token <= state);
                if until > 0 && before < Some(*self.earlier[until - 1]) {
                    read.push((place, node));
                }
                number = older;
            }
        }
        read.sort_unstable();
        let mut copies: Vec<Option<Copied>> = self.copies.drain(..).map(Some).collect();
        self.dropped += copies.len() as u64;
        for (place, node) in read {
            let Some(copy) = copies[place].take() else { continue };
            self.copies.push_back(Copied { older: self.newest[node], ..copy });
            self.newest[node] = self.dropped + self.copies.len() as u64;
        }
    }

    /// Drops all copies and earlier states. To be called when no result is left that could read them.
    fn forget(&mut self) {
        self.dropped += self.copies.len() as u64;
        self.copies.clear();
        self.spare = self.earlier.pop();
        self.earlier.clear();
    }
}

#[cfg(not(target_has_atomic = "ptr"))]
impl History {
    pub(super) fn token(&self) -> Option<Token> {
        None
    }

    pub(super) fn is_needed(&self) -> bool {
        false
    }

    pub(super) fn copy(&mut self, _node: usize, _nodes: usize, _level: u8, _ids: &[ObjectId; FAN_OUT]) {}

    pub(super) fn at(&self, _node: usize, _token: Option<&Token>) -> Option<(u8, &[ObjectId; FAN_OUT])> {
        None
    }
}

#[cfg(test)]
#[cfg(target_has_atomic = "ptr")]
mod tests {
    use super::*;
    use visibility_testing::Random;

    const NODES: usize = 7;

    /// Content of a node: its level and its ids.
    type Content = (u8, [ObjectId; FAN_OUT]);

    fn content(number: u32) -> Content {
        (number as u8, core::array::from_fn(|lane| ObjectId { index: number, generation: lane as u32 }))
    }

    /// Changes nodes at random while results of earlier states come and go, and asserts that each result
    /// reads the nodes as they were when its token was taken. The log holds no more copies than the results
    /// can read, up to a factor.
    #[test]
    fn results_read_nodes_as_they_were() {
        for seed in 0..40 {
            let mut rng = Random(seed);
            let (hold, changes) = (rng.pick(&[0, 1, 3, 12]), rng.pick(&[1, 5, 60]));
            let (mut log, mut results) = (History::default(), Vec::new());
            let mut nodes: [Content; NODES] = core::array::from_fn(|node| content(node as u32));
            for number in 0..1500u32 {
                if rng.one_in(changes) {
                    let token = log.token().expect("the processor has atomic counts");
                    results.push((token, nodes));
                }
                while results.len() > hold {
                    results.swap_remove(rng.below(results.len()));
                }
                let node = rng.below(NODES);
                if log.is_needed() {
                    let (level, ids) = &nodes[node];
                    log.copy(node, NODES, *level, ids);
                } else {
                    assert!(results.is_empty(), "seed {seed}, change {number}: results are left to read");
                }
                nodes[node] = content(number + 100);
                for (token, then) in &results {
                    for (node, (level, ids)) in then.iter().enumerate() {
                        let (now_level, now_ids) = &nodes[node];
                        assert_eq!(
                            log.at(node, Some(token)).unwrap_or((*now_level, now_ids)),
                            (*level, ids),
                            "seed {seed}, change {number}: node {node} at the state of {token}"
                        );
                    }
                }
                assert_eq!(log.at(node, None), None, "without a token, nodes are as they are now");
                let most = (hold + 3) * NODES * 2;
                assert!(log.copies.len() <= most, "seed {seed}: {} copies of {most}", log.copies.len());
            }
            let is_long = hold > 0 && hold < 12;
            assert!(!is_long || log.dropped > 0, "seed {seed}: no copy was dropped");
        }
    }

    #[test]
    fn nothing_is_copied_without_results() {
        let mut log = History::default();
        let (level, ids) = content(1);
        assert!(!log.is_needed(), "no result was made");
        log.copy(0, NODES, level, &ids);
        let token = log.token();
        assert!(log.is_needed() && log.copies.is_empty(), "a result of the present state may be read");
        log.copy(0, NODES, level, &ids);
        log.copy(0, NODES, level, &ids);
        assert_eq!(log.copies.len(), 1, "a node is copied once for a state");
        assert_eq!(
            log.memory(),
            size_of::<Copied>() + NODES * size_of::<u64>(),
            "a copy and a list of nodes"
        );
        drop(token);
        log.copy(1, NODES, level, &ids);
        assert!(log.copies.is_empty() && !log.is_needed(), "without results, the copies are dropped");
    }
}
