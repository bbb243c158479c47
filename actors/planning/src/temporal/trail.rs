//! What edits changed, so that they can be undone: all since a push, or one that was refused.

use super::{
    Constraint, EARLIEST, Edge, Half, Inequality, LATEST, NONE, Network, ORIGIN, Point, Side, Span,
};
use crate::Ticks;

/// A change, with what was there before.
#[derive(Clone, Copy, Debug)]
pub(super) enum Change {
    PointAdded(Point),
    /// Its node is the last of those that were removed.
    PointRemoved(Point),
    Added(Constraint),
    /// What it was is the last of what was retracted.
    Removed(Constraint),
    Span(Constraint, Span),
    Linked(Half),
    Unlinked(Half),
    Gap(Half, Ticks),
    Value {
        side: Side,
        point: u32,
        value: Ticks,
        by: Option<Half>,
    },
}

/// A constraint that was taken away, as it was when its inequalities had left their lists.
#[derive(Clone, Debug)]
pub(super) struct Retracted<O> {
    pub(super) edge: Edge,
    pub(super) halves: [Inequality; 2],
    pub(super) owner: O,
}

impl<O: Clone> Network<O> {
    /// From here on changes are kept, until [`pop`](Self::pop) undoes them.
    pub fn push(&mut self) {
        self.levels.push(self.trail.len());
    }

    /// Undoes all changes since the last [`push`](Self::push) that was not undone, in a time that
    /// follows their number. Without one, nothing happens.
    ///
    /// ```
    /// use farside_planning::temporal::{Network, Span};
    /// let mut network = Network::new(Span::new(0, 100));
    /// let point = network.add_point();
    /// network.push();
    /// network.constrain(network.origin(), point, Span::exactly(7), ()).unwrap();
    /// assert_eq!(network.bounds(point), Span::exactly(7));
    /// network.pop();
    /// assert_eq!((network.bounds(point), network.constraints()), (Span::new(0, 100), 0));
    /// ```
    pub fn pop(&mut self) {
        if let Some(start) = self.levels.pop() {
            self.undo_to(start);
        }
    }

    /// Keeps the changes since the last [`push`](Self::push), as if that had not been.
    pub fn commit(&mut self) {
        self.levels.pop();
        if self.levels.is_empty() {
            self.trail.clear();
            self.retracted.clear();
            self.removed_points.clear();
        }
    }

    /// How many pushes are neither undone nor committed.
    pub fn depth(&self) -> usize {
        self.levels.len()
    }

    /// Remembers a change that cannot be refused.
    pub(super) fn note(&mut self, change: Change) {
        if !self.levels.is_empty() {
            self.trail.push(change);
        }
    }

    /// An edit is done: without a push nobody will undo it.
    pub(super) fn settle(&mut self, start: usize) {
        if self.levels.is_empty() {
            self.trail.truncate(start);
        }
    }

    pub(super) fn undo_to(&mut self, start: usize) {
        while self.trail.len() > start {
            match self.trail.pop() {
                Some(change) => self.undo(change),
                None => return,
            }
        }
    }

    fn undo(&mut self, change: Change) {
        match change {
            Change::PointAdded(point) => drop(self.nodes.undo_insert(point)),
            Change::PointRemoved(point) => {
                let node = self.removed_points.pop().expect("kept with its change");
                self.nodes.undo_remove(point, node);
            }
            Change::Added(constraint) => {
                self.edges.undo_insert(constraint);
                self.owners.truncate(self.edges.places());
                self.halves.truncate(2 * self.edges.places());
            }
            Change::Removed(constraint) => {
                let Retracted {
                    edge,
                    halves,
                    owner,
                } = self.retracted.pop().expect("kept with its change");
                let place = constraint.index();
                self.edges.undo_remove(constraint, edge);
                self.halves[2 * place..2 * place + 2].copy_from_slice(&halves);
                self.owners[place] = owner;
            }
            Change::Span(constraint, span) => {
                if let Some(edge) = self.edges.get_mut(constraint) {
                    edge.span = span;
                }
            }
            Change::Linked(half) => {
                self.unlink(half);
                self.halves[half as usize].gap = Ticks::MIN;
            }
            Change::Unlinked(half) => self.link_again(half),
            Change::Gap(half, gap) => self.halves[half as usize].gap = gap,
            Change::Value {
                side,
                point,
                value,
                by,
            } => {
                self.changed.add(point);
                let node = self.node_mut(point);
                node.value[side] = value;
                node.by[side] = by;
            }
        }
    }

    /// Puts an inequality first in its points' lists. The origin has none: it does not move, and
    /// passes nothing on.
    pub(super) fn link(&mut self, half: Half) {
        for side in [EARLIEST, LATEST] {
            let source = self.halves[half as usize].source(side);
            if source == ORIGIN {
                continue;
            }
            let first = std::mem::replace(&mut self.node_mut(source).first[side], half);
            let inequality = &mut self.halves[half as usize];
            (inequality.next[side], inequality.before[side]) = (first, NONE);
            if first != NONE {
                self.halves[first as usize].before[side] = half;
            }
        }
    }

    /// Takes an inequality out of its points' lists. It keeps its neighbours, and its gap.
    pub(super) fn unlink(&mut self, half: Half) {
        for side in [EARLIEST, LATEST] {
            let Inequality { next, before, .. } = self.halves[half as usize];
            let source = self.halves[half as usize].source(side);
            if source == ORIGIN {
                continue;
            }
            self.join(side, source, before[side], next[side]);
        }
    }

    /// Undoes the last [`unlink`](Self::unlink): its neighbours are as they were.
    fn link_again(&mut self, half: Half) {
        for side in [EARLIEST, LATEST] {
            let Inequality { next, before, .. } = self.halves[half as usize];
            let source = self.halves[half as usize].source(side);
            if source == ORIGIN {
                continue;
            }
            match before[side] {
                NONE => self.node_mut(source).first[side] = half,
                before => self.halves[before as usize].next[side] = half,
            }
            if next[side] != NONE {
                self.halves[next[side] as usize].before[side] = half;
            }
        }
    }

    /// Makes two neighbours of each other, in a list of a point.
    fn join(&mut self, side: Side, point: u32, before: u32, next: u32) {
        match before {
            NONE => self.node_mut(point).first[side] = next,
            before => self.halves[before as usize].next[side] = next,
        }
        if next != NONE {
            self.halves[next as usize].before[side] = before;
        }
    }
}
