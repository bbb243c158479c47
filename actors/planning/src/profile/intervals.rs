//! Intervals of time, asked for those that hold a tick.

use super::tree::{Entry, NONE, Tree};
use crate::Ticks;

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
    /// Whose intervals hold a tick, in the order of their first ticks.
    pub(super) fn holding(&self, tick: Ticks, found: &mut Vec<u32>) {
        self.holding_below(self.root(), tick, found);
    }

    fn holding_below(&self, at: u32, tick: Ticks, found: &mut Vec<u32>) {
        if at == NONE || *self.sum(at) < tick {
            return;
        }
        let (interval, left, right) = self.look(at);
        self.holding_below(left, tick, found);
        if interval.first <= tick {
            if interval.last >= tick {
                found.push(interval.of);
            }
            self.holding_below(right, tick, found);
        }
    }
}
