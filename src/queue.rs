//! The event queue: small keys here, payloads elsewhere. The earliest events stand sorted, the
//! others in a quaternary heap; the events of the present instant pass through a FIFO and touch
//! neither.

use std::cmp::Ordering;
use std::collections::VecDeque;

use dary_heap::QuaternaryHeap;

use crate::ids::EntityId;
use crate::key::{Bound, EventKey};
use crate::time::SimTime;

/// An event's key and the slot of its payload: half a cache line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Entry {
    time: SimTime,
    /// Step and tie in one number.
    rest: u64,
    count: u64,
    source: EntityId,
    pub(crate) slot: u32,
}

impl Entry {
    pub(crate) fn new(key: EventKey, slot: u32) -> Self {
        let rest = u64::from(key.step) << 32 | u64::from(key.tie);
        Entry {
            time: key.time,
            rest,
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
            tie: self.rest as u32,
            source: self.source,
            count: self.count,
        }
    }

    #[inline]
    fn bound(&self) -> Bound {
        Bound {
            time: self.time,
            step: (self.rest >> 32) as u32,
        }
    }

    /// True if this entry's key comes first. The time nearly always decides.
    #[inline]
    fn before(&self, other: &Self) -> bool {
        if self.time != other.time {
            return self.time < other.time;
        }
        (self.rest, self.source, self.count) < (other.rest, other.source, other.count)
    }
}

impl Ord for Entry {
    /// Reversed key order: the heap keeps its greatest entry on top, and we want the least key.
    fn cmp(&self, other: &Self) -> Ordering {
        (other.time, other.rest, other.source, other.count).cmp(&(
            self.time,
            self.rest,
            self.source,
            self.count,
        ))
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

/// How many of the earliest events are kept sorted. A line of cache holds two; inserting among so
/// few costs less than a way through a heap.
const NEAR: usize = 48;

/// Events yet to be handled, by key.
#[derive(Default)]
pub(crate) struct Queue {
    /// The earliest of the events in time, latest first.
    near: Vec<Entry>,
    /// The others: none has a lesser key than any in `near`.
    far: QuaternaryHeap<Entry>,
    /// The rest of the present step, in key order.
    present: VecDeque<Entry>,
    /// The next step of the present instant, in order of arrival.
    next: Vec<Entry>,
    /// Time and step of the last event taken.
    now: Option<Bound>,
}

impl Queue {
    #[inline(always)]
    pub(crate) fn push(&mut self, entry: Entry) {
        if self.belongs_to_next_step(&entry) {
            self.next.push(entry);
        } else {
            self.push_timed(entry);
        }
    }

    #[inline]
    fn belongs_to_next_step(&self, entry: &Entry) -> bool {
        let Some(now) = self.now else { return false };
        let next_step = Bound {
            time: now.time,
            step: now.step + 1,
        };
        // Once the next step stands in `present`, sorted, late arrivals take the other way.
        entry.bound() == next_step && self.present.front().map(Entry::bound) != Some(next_step)
    }

    #[inline]
    fn push_timed(&mut self, entry: Entry) {
        let is_far = match self.near.first() {
            Some(latest) => {
                latest.before(&entry) && (self.near.len() >= NEAR || !self.far.is_empty())
            }
            None => !self.far.is_empty(),
        };
        if is_far {
            self.far.push(entry);
            return;
        }
        // Among so few, walking from the earliest is faster than halving.
        let mut at = self.near.len();
        while at > 0 && self.near[at - 1].before(&entry) {
            at -= 1;
        }
        self.near.insert(at, entry);
        if self.near.len() > NEAR {
            self.far.push(self.near.remove(0));
        }
    }

    /// The earliest event that is not of the present instant's later steps.
    #[inline]
    fn timed(&mut self) -> Option<&Entry> {
        if self.near.is_empty() && !self.far.is_empty() {
            // From the heap they come in order: the earliest first, which belongs at the end.
            self.near
                .extend((0..NEAR / 2).map_while(|_| self.far.pop()));
            self.near.reverse();
        }
        self.near.last()
    }

    /// Time and step of the next event.
    pub(crate) fn peek(&mut self) -> Option<Bound> {
        let near = self.present.front().or(self.next.first()).map(Entry::bound);
        let timed = self.timed().map(Entry::bound);
        match (near, timed) {
            (Some(near), Some(timed)) => Some(near.min(timed)),
            (near, timed) => near.or(timed),
        }
    }

    /// Takes the event with the least key, if it comes before `bound`.
    #[inline(always)]
    pub(crate) fn pop_before(&mut self, bound: Bound) -> Option<Entry> {
        if self.present.is_empty() && !self.next.is_empty() {
            self.advance_step();
        }
        let timed = self.timed().copied();
        let entry = match (self.present.front(), timed) {
            (Some(step), timed)
                if step.bound() < bound && timed.is_none_or(|timed| step.before(&timed)) =>
            {
                self.present.pop_front()?
            }
            (_, Some(timed)) if timed.bound() < bound => self.near.pop()?,
            _ => return None,
        };
        self.now = Some(entry.bound());
        Some(entry)
    }

    /// Moves the next step of this instant to the front, unless events of the step before are still
    /// to come: those may send more of them.
    fn advance_step(&mut self) {
        let step = self.next[0].bound();
        if self.timed().is_some_and(|earliest| earliest.bound() < step) {
            return;
        }
        // Greatest entry first is least key first.
        self.next.sort_unstable_by(|a, b| b.cmp(a));
        self.present.extend(self.next.drain(..));
    }

    /// Keeps the entries that `keep` accepts; for shedding cancelled timers.
    pub(crate) fn retain(&mut self, mut keep: impl FnMut(&Entry) -> bool) {
        self.near.retain(|entry| keep(entry));
        self.far.retain(|entry| keep(entry));
        self.present.retain(|entry| keep(entry));
        self.next.retain(|entry| keep(entry));
    }

    /// Everything left, in key order.
    pub(crate) fn drain_sorted(&mut self) -> Vec<Entry> {
        let mut rest: Vec<Entry> = self.far.drain().collect();
        rest.append(&mut self.near);
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
            start in prop::collection::vec((0u64..4, 0u32..5), 1..120),
            pushes in prop::collection::vec((0u64..90, 0u32..5), 0..400),
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
                        // One in three at once, the others near and far.
                        let delay = delay.saturating_sub(30);
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
