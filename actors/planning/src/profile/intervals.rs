//! Intervals of time, asked for those that hold a tick or share one with a span.

use super::tree::{Entry, NONE, Tree};
use crate::Ticks;
use crate::temporal::Span;

/// From a tick to another one, both included, with a number that says whose it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Interval {
    pub(super) first: Ticks,
    pub(super) last: Ticks,
    pub(super) of: u32,
}

impl Entry for Interval {
    type Key = (Ticks, u32);
    /// The last tick of all.
    type Sum = Ticks;
    const EMPTY: &'static Ticks = &Ticks::MIN;

    fn key(&self) -> (Ticks, u32) {
        (self.first, self.of)
    }

    fn sum(&self, left: &Ticks, right: &Ticks) -> Ticks {
        self.last.max(*left).max(*right)
    }

    fn merge(&mut self, other: &Interval) {
        self.last = other.last;
    }

    fn is_void(&self) -> bool {
        false
    }
}

impl Tree<Interval> {
    /// Whose intervals share a tick with a span, in the order of their first ticks.
    pub(super) fn overlapping(&self, span: Span, found: &mut Vec<u32>) {
        self.overlapping_below(self.root(), span, found);
    }

    fn overlapping_below(&self, at: u32, span: Span, found: &mut Vec<u32>) {
        if at == NONE || *self.sum(at) < span.min {
            return;
        }
        let (interval, left, right) = self.look(at);
        self.overlapping_below(left, span, found);
        if interval.first <= span.max {
            if interval.last >= span.min {
                found.push(interval.of);
            }
            self.overlapping_below(right, span, found);
        }
    }
}
