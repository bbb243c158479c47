//! What edits changed, so that they can be undone: all since a push, or one that was refused.

use super::{Constraint, Domain, Edge, Link, NONE, Node, Store, Variable};

/// A change. What was there before lies on the stack of its kind in [`Before`].
#[derive(Clone, Copy, Debug)]
pub(super) enum Change {
    VariableAdded(Variable),
    /// Its node is in [`Before::nodes`].
    VariableRemoved(Variable),
    Posted(Constraint),
    /// Its edge is in [`Before::edges`].
    Retracted(Constraint),
    /// The domain of the variable in a place, which is in [`Before::domains`].
    Domain(u32),
    /// A link whose constraint narrowed its variable for the first time.
    Narrowed(u32),
    /// A link whose constraint no longer narrows its variable, which was started anew.
    Widened(u32),
}

/// What changes took away, in their order.
#[derive(Clone, Debug)]
pub(super) struct Before<O> {
    pub(super) domains: Vec<Domain>,
    nodes: Vec<Node>,
    edges: Vec<(Edge, O)>,
}

impl<O> Default for Before<O> {
    fn default() -> Self {
        Before {
            domains: Vec::new(),
            nodes: Vec::new(),
            edges: Vec::new(),
        }
    }
}

/// Where changes begin that may be undone together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mark {
    trail: usize,
    domains: usize,
    unfinished: bool,
}

/// The links of constraints, in blocks of powers of two.
#[derive(Clone, Debug)]
pub(super) struct Links {
    pub(super) all: Vec<Link>,
    /// By the logarithm of their size: the first free block. The next one of its size is what the
    /// first link of a free block names as its next.
    free: [u32; 33],
}

impl Default for Links {
    fn default() -> Self {
        Links {
            all: Vec::new(),
            free: [NONE; 33],
        }
    }
}

impl Links {
    /// A block of links to be written.
    #[inline]
    pub(super) fn take(&mut self, count: u32) -> u32 {
        let class = class(count);
        let first = self.free[class];
        if first != NONE {
            self.free[class] = self.all[first as usize].next;
            return first;
        }
        let first = self.all.len();
        self.all.resize(first + (1 << class), Link::UNUSED);
        assert!(self.all.len() < NONE as usize, "fewer than 2^32 links");
        first as u32
    }

    #[inline]
    pub(super) fn give_back(&mut self, first: u32, count: u32) {
        let next = std::mem::replace(&mut self.free[class(count)], first);
        self.all[first as usize].next = next;
    }
}

/// The logarithm of the size of the block for so many links: 1 to 2^32 - 1.
fn class(count: u32) -> usize {
    (u32::BITS - (count - 1).leading_zeros()) as usize
}

impl<O: Clone> Store<O> {
    /// From here on changes are kept, until [`pop`](Self::pop) undoes them.
    pub fn push(&mut self) {
        let mark = self.begin();
        self.levels.push(mark);
    }

    /// Undoes all changes since the last [`push`](Self::push) that was not undone, in a time that
    /// follows their number. Without one, nothing happens.
    ///
    /// ```
    /// use farside_planning::parameters::{Domain, Store};
    /// let mut store = Store::new();
    /// let speed = store.add(Domain::of([0, 10, 20]));
    /// store.push();
    /// store.restrict(speed, Domain::exactly(10), "a command")?;
    /// assert_eq!(store.value(speed), Some(10));
    /// store.pop();
    /// assert_eq!(store.domain(speed), &Domain::of([0, 10, 20]));
    /// # Ok::<(), farside_planning::parameters::Refusal<&str>>(())
    /// ```
    pub fn pop(&mut self) {
        if let Some(mark) = self.levels.pop() {
            self.undo_to(mark, true);
        }
    }

    /// Keeps the changes since the last [`push`](Self::push), as if that had not been.
    pub fn commit(&mut self) {
        self.levels.pop();
        if self.levels.is_empty() {
            self.forget_changes();
        }
    }

    /// How many pushes are neither undone nor committed.
    pub fn depth(&self) -> usize {
        self.levels.len()
    }

    /// An edit begins: each domain that it changes is kept once.
    #[inline]
    pub(super) fn begin(&mut self) -> Mark {
        self.edit += 1;
        Mark {
            trail: self.trail.len(),
            domains: self.before.domains.len(),
            unfinished: self.unfinished,
        }
    }

    /// An edit is done: what it changed is told, and without a push nobody will undo it.
    #[inline]
    pub(super) fn settle(&mut self, mark: Mark) {
        if self.before.domains.len() > mark.domains {
            self.tell_since(mark);
        }
        // Without a push nothing was kept of what was removed.
        if self.levels.is_empty() {
            self.trail.clear();
            self.before.domains.clear();
        }
    }

    /// Tells whose domains an edit changed.
    #[inline(never)]
    fn tell_since(&mut self, mark: Mark) {
        let mut kept = mark.domains;
        for at in mark.trail..self.trail.len() {
            if let Change::Domain(place) = self.trail[at] {
                let differs = |node: &Node| node.domain != self.before.domains[kept];
                if self.nodes.at(place as usize).is_some_and(differs) {
                    self.tell(place);
                }
                kept += 1;
            }
        }
    }

    /// Nobody will undo the changes.
    fn forget_changes(&mut self) {
        self.trail.clear();
        self.before.domains.clear();
        self.before.nodes.clear();
        while let Some((edge, _)) = self.before.edges.pop() {
            self.links.give_back(edge.first, edge.count);
        }
    }

    /// Puts a variable on the list of those whose domains changed.
    pub(super) fn tell(&mut self, place: u32) {
        let Some(id) = self.nodes.id_at(place as usize) else {
            return;
        };
        let node = self.node_mut(place);
        if std::mem::replace(&mut node.told, true) {
            return;
        }
        self.changed.push(id);
        // While nobody asks, those that have gone pile up.
        if self.changed.len() > 2 * self.nodes.places() + 64 {
            let mut kept = std::mem::take(&mut self.changed);
            self.take_told(&mut kept);
            for &variable in &kept {
                self.node_mut(variable.index() as u32).told = true;
            }
            self.changed = kept;
        }
    }

    /// Leaves the variables of a list that are still there and to be told, each once.
    pub(super) fn take_told(&mut self, list: &mut Vec<Variable>) {
        list.retain(|&variable| {
            let node = self.nodes.get_mut(variable);
            node.is_some_and(|node| std::mem::take(&mut node.told))
        });
    }

    /// Undoes changes, and tells whose domains that changed if somebody may have seen them.
    pub(super) fn undo_to(&mut self, mark: Mark, tell: bool) {
        self.unfinished = mark.unfinished;
        while self.trail.len() > mark.trail {
            match self.trail.pop() {
                Some(change) => self.undo(change, tell),
                None => return,
            }
        }
    }

    fn undo(&mut self, change: Change, tell: bool) {
        match change {
            Change::VariableAdded(variable) => drop(self.nodes.undo_insert(variable)),
            Change::VariableRemoved(variable) => {
                let node = self.before.nodes.pop().expect("kept with its change");
                self.nodes.undo_remove(
                    variable,
                    Node {
                        told: false,
                        ..node
                    },
                );
                self.tell(variable.index() as u32);
            }
            Change::Posted(constraint) => {
                for link in self.links_of(constraint.index() as u32).rev() {
                    self.unlink(link);
                }
                if let Some(edge) = self.edges.undo_insert(constraint) {
                    self.links.give_back(edge.first, edge.count);
                }
                self.owners.truncate(self.edges.places());
            }
            Change::Retracted(constraint) => {
                let (edge, owner) = self.before.edges.pop().expect("kept with its change");
                self.edges.undo_remove(constraint, edge);
                self.owners[constraint.index()] = owner;
                self.link_again(constraint.index() as u32);
            }
            Change::Domain(place) => {
                let domain = self.before.domains.pop().expect("kept with its change");
                self.node_mut(place).domain = domain;
                if tell {
                    self.tell(place);
                }
            }
            Change::Narrowed(link) => self.links.all[link as usize].narrowed = false,
            Change::Widened(link) => self.links.all[link as usize].narrowed = true,
        }
    }

    /// Takes a variable out for good, or until that is undone.
    #[inline]
    pub(super) fn take_out(&mut self, variable: Variable) {
        let node = self.nodes.remove(variable);
        // Without a push nobody will undo it: it is not an edit that can be refused.
        if !self.levels.is_empty() {
            let mut node = node.expect("the variable is there");
            node.marked = false;
            self.before.nodes.push(node);
            self.trail.push(Change::VariableRemoved(variable));
        }
    }

    /// Takes a constraint away, which is in no list any more.
    #[inline]
    pub(super) fn detach(&mut self, constraint: Constraint) {
        let edge = self.edges.remove(constraint);
        let edge = edge.expect("the constraint is there");
        // Without a push nobody will undo it: it is not an edit that can be refused.
        if self.levels.is_empty() {
            self.links.give_back(edge.first, edge.count);
        } else {
            let owner = self.owners[constraint.index()].clone();
            self.before.edges.push((edge, owner));
            self.trail.push(Change::Retracted(constraint));
        }
    }

    /// Puts a link first in its variable's list.
    #[inline]
    pub(super) fn link(&mut self, link: u32) {
        let variable = self.links.all[link as usize].variable;
        let first = std::mem::replace(&mut self.node_mut(variable).first, link);
        let new = &mut self.links.all[link as usize];
        (new.next, new.before) = (first, NONE);
        if first != NONE {
            self.links.all[first as usize].before = link;
        }
    }

    /// Takes a link out of its variable's list. It keeps its neighbours.
    #[inline]
    pub(super) fn unlink(&mut self, link: u32) {
        let Link { next, before, .. } = self.links.all[link as usize];
        self.join_neighbours(link, next, before);
    }

    /// Says what the neighbours of a link have next and before them.
    #[inline]
    fn join_neighbours(&mut self, link: u32, then: u32, earlier: u32) {
        let Link {
            variable,
            next,
            before,
            ..
        } = self.links.all[link as usize];
        if variable == NONE {
            return;
        }
        match before {
            NONE => self.node_mut(variable).first = then,
            before => self.links.all[before as usize].next = then,
        }
        if next != NONE {
            self.links.all[next as usize].before = earlier;
        }
    }

    /// Undoes the [`unlink`](Self::unlink) of the links of a constraint, from the last to the first:
    /// all neighbours are as they were.
    fn link_again(&mut self, place: u32) {
        for link in self.links_of(place) {
            self.join_neighbours(link, link, link);
        }
    }
}
