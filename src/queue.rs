//! The event queue: small keys in a binary heap, payloads elsewhere, and a sorted FIFO for the
//! events of the present instant, which never touch the heap.

use std::cmp::Ordering;
use std::collections::VecDeque;

use std::collections::BinaryHeap;

use crate::key::{Bound, EntityId, EventKey};
use crate::time::SimTime;

/// An event's key and the slot of its payload: half a cache line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Entry {
    /// Time, step and tie in one number: what nearly always decides, in one comparison.
    head: u128,
    count: u64,
    source: EntityId,
    pub(crate) slot: u32,
}

impl Entry {
    pub(crate) fn new(key: EventKey, slot: u32) -> Self {
        let head = u128::from(key.time.as_nanos()) << 64
            | u128::from(key.step) << 32
            | u128::from(key.tie);
        Entry {
            head,
            count: key.count,
            source: key.source,
            slot,
        }
    }

    pub(crate) fn key(&self) -> EventKey {
        let Bound { time, step } = self.bound();
        EventKey {
            time,
            step,
            tie: self.head as u32,
            source: self.source,
            count: self.count,
        }
    }

    #[inline]
    fn bound(&self) -> Bound {
        let time = SimTime::from_nanos((self.head >> 64) as u64);
        Bound {
            time,
            step: (self.head >> 32) as u32,
        }
    }

    /// True if this entry's key comes first.
    #[inline]
    fn before(&self, other: &Self) -> bool {
        if self.head != other.head {
            return self.head < other.head;
        }
        (self.source, self.count) < (other.source, other.count)
    }
}

impl Ord for Entry {
    /// Reversed key order: the heap keeps its greatest entry on top, and we want the least key.
    fn cmp(&self, other: &Self) -> Ordering {
        (other.head, other.source, other.count).cmp(&(self.head, self.source, self.count))
    }
}

// The operators are what the heap calls; keys are unique, so one comparison answers each.
impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }

    #[inline]
    fn lt(&self, other: &Self) -> bool {
        other.before(self)
    }

    #[inline]
    fn le(&self, other: &Self) -> bool {
        !self.before(other)
    }

    #[inline]
    fn gt(&self, other: &Self) -> bool {
        self.before(other)
    }

    #[inline]
    fn ge(&self, other: &Self) -> bool {
        !other.before(self)
    }
}

/// Events yet to be handled, by key.
#[derive(Default)]
pub(crate) struct Queue {
    heap: BinaryHeap<Entry>,
    /// The heap's top was taken and is still in place. Most events cause another, which then
    /// replaces it: one way down the heap instead of a way down and two ways up.
    stale_top: bool,
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
        } else if std::mem::take(&mut self.stale_top)
            && let Some(mut top) = self.heap.peek_mut()
        {
            *top = entry;
        } else {
            self.heap.push(entry);
        }
    }

    /// Time and step of the next event.
    pub(crate) fn peek(&mut self) -> Option<Bound> {
        self.drop_stale_top();
        let near = self.present.front().or(self.next.first()).map(Entry::bound);
        let far = self.heap.peek().map(Entry::bound);
        match (near, far) {
            (Some(near), Some(far)) => Some(near.min(far)),
            (near, far) => near.or(far),
        }
    }

    /// Takes the event with the least key, if it comes before `bound`.
    pub(crate) fn pop_before(&mut self, bound: Bound) -> Option<Entry> {
        self.drop_stale_top();
        if self.present.is_empty() && !self.next.is_empty() {
            self.advance_step();
        }
        let entry = match (self.present.front(), self.heap.peek()) {
            // Reversed order: the greater entry has the lesser key.
            (Some(near), far) if near.bound() < bound && far.is_none_or(|far| near > far) => {
                self.present.pop_front()?
            }
            (_, Some(far)) if far.bound() < bound => {
                self.stale_top = true;
                *far
            }
            _ => return None,
        };
        self.now = Some(entry.bound());
        Some(entry)
    }

    #[inline]
    fn drop_stale_top(&mut self) {
        if std::mem::take(&mut self.stale_top) {
            self.heap.pop();
        }
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
        self.drop_stale_top();
        self.heap.retain(|entry| keep(entry));
        self.present.retain(|entry| keep(entry));
        self.next.retain(|entry| keep(entry));
    }

    /// Everything left, in key order.
    pub(crate) fn drain_sorted(&mut self) -> Vec<Entry> {
        self.drop_stale_top();
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
                        let step = if delay == 0 { popped.bound().step + 1 } else { 0 };
                        queue.push(entry(popped.bound().time.as_nanos() + delay, step, source, count));
                    }
                }
            }
            prop_assert_eq!(taken, count);
        }
    }
}
