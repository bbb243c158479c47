//! The event queue: small keys in a quaternary heap, payloads elsewhere, and a sorted FIFO for the
//! events of the present instant, which never touch the heap.

use std::cmp::Ordering;
use std::collections::VecDeque;

use dary_heap::QuaternaryHeap;

use crate::key::{Bound, EntityId, EventKey};
use crate::time::SimTime;

/// An event's key and the slot of its payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Entry {
    time: SimTime,
    count: u64,
    step: u32,
    tie: u32,
    source: EntityId,
    pub(crate) slot: u32,
}

impl Entry {
    pub(crate) fn new(key: EventKey, slot: u32) -> Self {
        Entry {
            time: key.time,
            count: key.count,
            step: key.step,
            tie: key.tie,
            source: key.source,
            slot,
        }
    }

    pub(crate) fn key(&self) -> EventKey {
        EventKey {
            time: self.time,
            step: self.step,
            tie: self.tie,
            source: self.source,
            count: self.count,
        }
    }

    fn bound(&self) -> Bound {
        Bound {
            time: self.time,
            step: self.step,
        }
    }
}

impl Ord for Entry {
    /// Reversed key order: the heap keeps its greatest entry on top, and we want the least key.
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .time
            .cmp(&self.time)
            .then_with(|| other.step.cmp(&self.step))
            .then_with(|| other.tie.cmp(&self.tie))
            .then_with(|| other.source.cmp(&self.source))
            .then_with(|| other.count.cmp(&self.count))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Events yet to be handled, by key.
#[derive(Default)]
pub(crate) struct Queue {
    heap: QuaternaryHeap<Entry>,
    /// The rest of the present step, in key order.
    present: VecDeque<Entry>,
    /// The next step of the present instant, in order of arrival.
    next: Vec<Entry>,
    /// Time and step of the last event taken.
    now: Option<Bound>,
}

impl Queue {
    pub(crate) fn push(&mut self, entry: Entry) {
        let next_step = self.now.map(|now| Bound {
            time: now.time,
            step: now.step + 1,
        });
        // Once the next step stands in `present`, sorted, late arrivals go through the heap.
        let sorted = self.present.front().map(Entry::bound) == next_step;
        if next_step == Some(entry.bound()) && !sorted {
            self.next.push(entry);
        } else {
            self.heap.push(entry);
        }
    }

    /// Time and step of the next event.
    pub(crate) fn peek(&self) -> Option<Bound> {
        let near = self.present.front().or(self.next.first()).map(Entry::bound);
        let far = self.heap.peek().map(Entry::bound);
        match (near, far) {
            (Some(near), Some(far)) => Some(near.min(far)),
            (near, far) => near.or(far),
        }
    }

    /// Takes the event with the least key, if it comes before `bound`.
    pub(crate) fn pop_before(&mut self, bound: Bound) -> Option<Entry> {
        if self.present.is_empty() && !self.next.is_empty() {
            self.advance_step();
        }
        let from_heap = match (self.present.front(), self.heap.peek()) {
            (None, None) => return None,
            (Some(near), Some(far)) => far > near, // reversed order: `far` has the lesser key
            (None, Some(_)) => true,
            (Some(_), None) => false,
        };
        let head = if from_heap {
            self.heap.peek()
        } else {
            self.present.front()
        };
        if head.is_none_or(|entry| entry.bound() >= bound) {
            return None;
        }
        let entry = if from_heap {
            self.heap.pop()
        } else {
            self.present.pop_front()
        }?;
        self.now = Some(entry.bound());
        Some(entry)
    }

    /// Moves the next step of this instant to the front, unless the heap still has events of the
    /// step before: those may send more of them.
    fn advance_step(&mut self) {
        let step = self.next[0].bound();
        if self.heap.peek().is_some_and(|top| top.bound() < step) {
            return;
        }
        // Greatest entry first is least key first.
        self.next.sort_unstable_by(|a, b| b.cmp(a));
        self.present.extend(self.next.drain(..));
    }

    /// Keeps the entries that `keep` accepts; for shedding cancelled timers.
    pub(crate) fn retain(&mut self, mut keep: impl FnMut(&Entry) -> bool) {
        self.heap.retain(|entry| keep(entry));
        self.present.retain(|entry| keep(entry));
        self.next.retain(|entry| keep(entry));
    }

    /// Everything left, in key order.
    pub(crate) fn drain_sorted(&mut self) -> Vec<Entry> {
        let mut rest: Vec<Entry> = self.heap.drain().collect();
        rest.extend(self.present.drain(..));
        rest.append(&mut self.next);
        rest.sort_unstable_by(|a, b| b.cmp(a));
        rest
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn entry(time: u64, step: u32, source: u32, count: u64) -> Entry {
        let key = EventKey {
            time: SimTime::from_nanos(time),
            step,
            tie: 0,
            source: EntityId(source),
            count,
        };
        Entry::new(key, 0)
    }

    proptest! {
        /// Whatever handlers push, at this instant or later, and wherever a window ends, events
        /// come out in key order and none is lost.
        #[test]
        fn pops_in_key_order(
            start in prop::collection::vec((0u64..4, 0u32..5), 1..20),
            pushes in prop::collection::vec((0u64..3, 0u32..5), 0..200),
            windows in any::<bool>(),
        ) {
            let mut queue = Queue::default();
            let mut count = 0;
            for (time, source) in start {
                count += 1;
                queue.push(entry(time, 0, source, count));
            }
            let mut pushes = pushes.into_iter();
            let mut last: Option<EventKey> = None;
            let mut taken = 0;
            while let Some(head) = queue.peek() {
                let bound = match windows {
                    true => Bound { time: head.time, step: head.step + 1 },
                    false => Bound::NEVER,
                };
                while let Some(popped) = queue.pop_before(bound) {
                    prop_assert!(popped.bound() < bound);
                    prop_assert!(last.is_none_or(|last| last < popped.key()));
                    last = Some(popped.key());
                    taken += 1;
                    if let Some((delay, source)) = pushes.next() {
                        count += 1;
                        let step = if delay == 0 { popped.step + 1 } else { 0 };
                        queue.push(entry(popped.time.as_nanos() + delay, step, source, count));
                    }
                }
            }
            prop_assert_eq!(taken, count);
        }
    }
}
