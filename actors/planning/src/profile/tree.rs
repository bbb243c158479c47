//! A balanced search tree whose every subtree knows a sum of its entries.
//!
//! It is A. Andersson's (*Balanced Search Trees Made Simple*, 1993): no path is longer than twice
//! the logarithm of how many entries there are, whatever the order of edits.

use std::cell::Cell;

/// What a tree holds.
pub(super) trait Entry: Copy {
    /// Where it stands among others.
    type Key: Ord + Copy;
    /// What a subtree knows of its entries.
    type Sum: Copy + 'static;
    /// Of no entry.
    const EMPTY: &'static Self::Sum;

    /// Where it stands.
    fn key(&self) -> Self::Key;
    /// The sum of what is left of it, itself, and what is right of it.
    fn sum(&self, left: &Self::Sum, right: &Self::Sum) -> Self::Sum;
    /// Takes in another one of the same key.
    fn merge(&mut self, other: &Self);
    /// Whether it says nothing, and need not be kept.
    fn is_void(&self) -> bool;
}

/// No node.
pub(super) const NONE: u32 = u32::MAX;

const LEFT: usize = 0;
const RIGHT: usize = 1;

#[derive(Clone)]
struct Node<E: Entry> {
    entry: E,
    sum: E::Sum,
    children: [u32; 2],
    /// 1 at a leaf; a left child's is one less, a right child's at most as large.
    level: u8,
}

/// Entries in the order of their keys.
#[derive(Clone)]
pub(super) struct Tree<E: Entry> {
    nodes: Vec<Node<E>>,
    free: Vec<u32>,
    root: u32,
    looked_at: Cell<u64>,
}

impl<E: Entry> Default for Tree<E> {
    fn default() -> Self {
        Tree {
            nodes: Vec::new(),
            free: Vec::new(),
            root: NONE,
            looked_at: Cell::new(0),
        }
    }
}

impl<E: Entry> Tree<E> {
    /// How many nodes edits and queries looked at.
    pub(super) fn looked_at(&self) -> u64 {
        self.looked_at.get()
    }

    /// The node that all others are below of; [`NONE`] without entries.
    pub(super) fn root(&self) -> u32 {
        self.root
    }

    /// The entry of a node, with what is left and right of it. It is counted as a look.
    pub(super) fn look(&self, node: u32) -> (&E, u32, u32) {
        self.looked_at.set(self.looked_at.get() + 1);
        let node = &self.nodes[node as usize];
        (&node.entry, node.children[LEFT], node.children[RIGHT])
    }

    /// The sum of a node and all below it.
    pub(super) fn sum(&self, node: u32) -> &E::Sum {
        match node {
            NONE => E::EMPTY,
            node => &self.nodes[node as usize].sum,
        }
    }

    /// All entries in their order.
    pub(super) fn entries(&self) -> impl Iterator<Item = &E> {
        let mut path = Vec::new();
        let mut next = self.root;
        std::iter::from_fn(move || {
            while next != NONE {
                path.push(next);
                next = self.nodes[next as usize].children[LEFT];
            }
            let node = &self.nodes[path.pop()? as usize];
            next = node.children[RIGHT];
            Some(&node.entry)
        })
    }

    /// Takes an entry in, or merges it with that of its key; what is void then is taken out.
    pub(super) fn put(&mut self, entry: E) {
        let mut is_void = false;
        self.root = self.put_below(self.root, entry, &mut is_void);
        if is_void {
            self.remove(entry.key());
        }
    }

    /// Takes an entry out, if there is one of this key.
    pub(super) fn remove(&mut self, key: E::Key) {
        self.root = self.remove_below(self.root, key);
    }

    fn put_below(&mut self, at: u32, entry: E, is_void: &mut bool) -> u32 {
        if at == NONE {
            return self.new_leaf(entry);
        }
        let (key, [left, right]) = self.keyed(at);
        match entry.key().cmp(&key) {
            std::cmp::Ordering::Equal => {
                let own = &mut self.nodes[at as usize].entry;
                own.merge(&entry);
                *is_void = own.is_void();
                self.add_up(at);
                return at;
            }
            std::cmp::Ordering::Less => {
                let child = self.put_below(left, entry, is_void);
                self.nodes[at as usize].children[LEFT] = child;
            }
            std::cmp::Ordering::Greater => {
                let child = self.put_below(right, entry, is_void);
                self.nodes[at as usize].children[RIGHT] = child;
            }
        }
        self.add_up(at);
        let at = self.skew(at);
        self.split(at)
    }

    fn remove_below(&mut self, at: u32, key: E::Key) -> u32 {
        if at == NONE {
            return NONE;
        }
        let (own, [left, right]) = self.keyed(at);
        match key.cmp(&own) {
            std::cmp::Ordering::Less => {
                let child = self.remove_below(left, key);
                self.nodes[at as usize].children[LEFT] = child;
            }
            std::cmp::Ordering::Greater => {
                let child = self.remove_below(right, key);
                self.nodes[at as usize].children[RIGHT] = child;
            }
            std::cmp::Ordering::Equal if left == NONE && right == NONE => {
                self.free.push(at);
                return NONE;
            }
            // A neighbour, which is lower, takes its place.
            std::cmp::Ordering::Equal => {
                let side = if left == NONE { RIGHT } else { LEFT };
                let child = self.nodes[at as usize].children[side];
                let entry = self.outermost(child, 1 - side);
                let child = self.remove_below(child, entry.key());
                let node = &mut self.nodes[at as usize];
                node.entry = entry;
                node.children[side] = child;
            }
        }
        self.add_up(at);
        self.lower(at)
    }

    /// Balances a node, one of whose children may have lost a level.
    fn lower(&mut self, at: u32) -> u32 {
        let [left, right] = self.nodes[at as usize].children;
        let most = self.level(left).min(self.level(right)) + 1;
        if most < self.level(at) {
            self.nodes[at as usize].level = most;
            if most < self.level(right) {
                self.nodes[right as usize].level = most;
            }
        }
        let at = self.skew(at);
        if let Some(right) = self.child(at, RIGHT) {
            let right = self.skew(right);
            self.nodes[at as usize].children[RIGHT] = right;
            if let Some(outer) = self.child(right, RIGHT) {
                let outer = self.skew(outer);
                self.nodes[right as usize].children[RIGHT] = outer;
                self.add_up(right);
            }
            self.add_up(at);
        }
        let at = self.split(at);
        if let Some(right) = self.child(at, RIGHT) {
            let right = self.split(right);
            self.nodes[at as usize].children[RIGHT] = right;
            self.add_up(at);
        }
        at
    }

    /// Turns a left child of the same level to the right.
    fn skew(&mut self, at: u32) -> u32 {
        match self.child(at, LEFT) {
            Some(left) if self.level(left) == self.level(at) => self.turn(at, left, RIGHT),
            _ => at,
        }
    }

    /// Turns two right children of the same level to the left.
    fn split(&mut self, at: u32) -> u32 {
        let Some(right) = self.child(at, RIGHT) else {
            return at;
        };
        match self.child(right, RIGHT) {
            Some(outer) if self.level(outer) == self.level(at) => {
                self.nodes[right as usize].level += 1;
                self.turn(at, right, LEFT)
            }
            _ => at,
        }
    }

    /// Puts a node below one of its children, on a side.
    fn turn(&mut self, at: u32, child: u32, side: usize) -> u32 {
        let inner = self.nodes[child as usize].children[side];
        self.nodes[at as usize].children[1 - side] = inner;
        self.nodes[child as usize].children[side] = at;
        self.add_up(at);
        self.add_up(child);
        child
    }

    fn add_up(&mut self, at: u32) {
        let node = &self.nodes[at as usize];
        let [left, right] = node.children;
        let sum = node.entry.sum(self.sum(left), self.sum(right));
        self.nodes[at as usize].sum = sum;
    }

    fn new_leaf(&mut self, entry: E) -> u32 {
        let node = Node {
            entry,
            sum: entry.sum(E::EMPTY, E::EMPTY),
            children: [NONE; 2],
            level: 1,
        };
        if let Some(place) = self.free.pop() {
            self.nodes[place as usize] = node;
            return place;
        }
        self.nodes.push(node);
        self.nodes.len() as u32 - 1
    }

    fn keyed(&self, at: u32) -> (E::Key, [u32; 2]) {
        self.looked_at.set(self.looked_at.get() + 1);
        let node = &self.nodes[at as usize];
        (node.entry.key(), node.children)
    }

    fn child(&self, at: u32, side: usize) -> Option<u32> {
        let child = self.nodes[at as usize].children[side];
        (child != NONE).then_some(child)
    }

    fn level(&self, at: u32) -> u8 {
        match at {
            NONE => 0,
            at => self.nodes[at as usize].level,
        }
    }

    /// The last entry on a side.
    fn outermost(&self, mut at: u32, side: usize) -> E {
        loop {
            let (entry, left, right) = self.look(at);
            match [left, right][side] {
                NONE => return *entry,
                child => at = child,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;

    /// A number by a key, of which a part of the tree knows the sum, in an order that shows.
    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Numbered(u8, i64);

    impl Entry for Numbered {
        type Key = u8;
        /// How many entries, and what they add up to, each times one more than the last one's.
        type Sum = (i64, i64, i64);
        const EMPTY: &'static (i64, i64, i64) = &(0, 0, 0);

        fn key(&self) -> u8 {
            self.0
        }

        fn sum(&self, left: &Self::Sum, right: &Self::Sum) -> Self::Sum {
            let many = left.0 + 1 + right.0;
            let total = left.1 + self.1 + right.1;
            let before = left.0 + 1;
            let weighted = left.2 + before * self.1 + right.2 + before * right.1;
            (many, total, weighted)
        }

        fn merge(&mut self, other: &Self) {
            self.1 += other.1;
        }

        fn is_void(&self) -> bool {
            self.1 == 0
        }
    }

    impl Tree<Numbered> {
        /// Whether levels are as they must be, below a node.
        fn is_balanced(&self, at: u32) -> bool {
            if at == NONE {
                return true;
            }
            let [left, right] = self.nodes[at as usize].children;
            let outer = self
                .child(at, RIGHT)
                .map_or(NONE, |right| self.nodes[right as usize].children[RIGHT]);
            self.level(left) + 1 == self.level(at)
                && self.level(right) <= self.level(at)
                && self.level(right) + 1 >= self.level(at)
                && self.level(outer) < self.level(at)
                && self.is_balanced(left)
                && self.is_balanced(right)
        }
    }

    proptest! {
        /// It holds what was put in and not taken out, in order and in balance, and the sum of it.
        #[test]
        fn it_is_an_ordered_map(edits in prop::collection::vec((0..40u8, -1..3i64), 0..200)) {
            let mut tree = Tree::default();
            let mut expected: BTreeMap<u8, i64> = BTreeMap::new();
            for (key, number) in edits {
                // Numbers above 0 are put in, others take it all out, one way or the other.
                let old = expected.get(&key).copied();
                match number {
                    0 => {
                        tree.remove(key);
                        expected.remove(&key);
                    }
                    -1 => if let Some(old) = old {
                        tree.put(Numbered(key, -old));
                        expected.remove(&key);
                    },
                    _ => {
                        tree.put(Numbered(key, number));
                        *expected.entry(key).or_default() += number;
                    }
                }
                let entries = expected.iter().map(|(key, number)| Numbered(*key, *number));
                prop_assert!(tree.entries().copied().eq(entries));
                prop_assert!(tree.is_balanced(tree.root()));
                let weighted = (1..).zip(expected.values()).map(|(at, number)| at * number);
                let sum = (expected.len() as i64, expected.values().sum(), weighted.sum());
                prop_assert_eq!(*tree.sum(tree.root()), sum);
                prop_assert!(tree.nodes.len() - tree.free.len() == expected.len());
            }
        }
    }
}
