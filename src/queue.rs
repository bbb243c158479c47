//! The event queue: small keys here, payloads elsewhere. The earliest events stand sorted, the next
//! in a quaternary heap, and where very many wait, the later ones in buckets; the events of the
//! present instant pass through a FIFO and touch none of these.

mod far;

use std::cmp::Ordering;
use std::collections::VecDeque;

use dary_heap::QuaternaryHeap;

use crate::ids::EntityId;
use crate::key::{Bound, EventKey};
use crate::time::SimTime;

use far::Far;

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
    #[inline(always)]
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

    #[inline(always)]
    pub(crate) fn time(&self) -> SimTime {
        self.time
    }

    #[inline(always)]
    pub(crate) fn step(&self) -> u32 {
        (self.rest >> 32) as u32
    }

    #[inline(always)]
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
            step: self.step(),
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

/// So many are sorted at most: a bucket of later events is taken whole.
const SORTED: usize = 512;

/// For so many events at a time is fetched what they need: as many as a processor waits for at once.
pub(crate) const BATCH: usize = 16;

/// So many batches of the earliest events are known, if there are so many events: one for each thing
/// that is fetched, and one that is handled.
const KNOWN: usize = 3 * BATCH;

/// A heap of more than this is spread over buckets. A smaller one lies in the first cache.
const HEAP: usize = 96;

/// Events yet to be handled, by key.
pub(crate) struct Queue {
    /// The earliest of the events in time, latest first.
    near: Vec<Entry>,
    /// None has a lesser key than any in `near`.
    heap: QuaternaryHeap<Entry>,
    /// At its horizon or later; the others in time come before it.
    far: Far,
    /// The size at which the heap is spread.
    spread_at: usize,
    /// The rest of the present step, in key order.
    present: VecDeque<Entry>,
    /// The next step of the present instant, in order of arrival.
    next: Vec<Entry>,
    /// Time and step of the last event taken.
    now: Option<Bound>,
}

impl Default for Queue {
    fn default() -> Self {
        Queue {
            near: Vec::new(),
            heap: QuaternaryHeap::default(),
            far: Far::default(),
            spread_at: HEAP,
            present: VecDeque::new(),
            next: Vec::new(),
            now: None,
        }
    }
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

    /// Fetches where an entry will be put, if that is far ahead.
    #[inline(always)]
    pub(crate) fn fetch(&self, entry: &Entry) {
        self.far.fetch(entry);
    }

    #[inline(always)]
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
        if entry.time.as_nanos() >= self.far.horizon_ns() {
            self.far.push(entry);
            return;
        }
        let is_later = match self.near.first() {
            Some(latest) => {
                latest.before(&entry) && (self.near.len() >= NEAR || !self.heap.is_empty())
            }
            None => !self.heap.is_empty(),
        };
        if is_later {
            self.heap.push(entry);
            if self.heap.len() > self.spread_at {
                self.spread_heap();
            }
            return;
        }
        // Mostly among the earliest, where walking is faster than halving.
        let walked = self.near.len().saturating_sub(NEAR);
        if walked > 0 && self.near[walked].before(&entry) {
            let at = self.near[..walked].partition_point(|other| entry.before(other));
            self.near.insert(at, entry);
        } else {
            self.insert_near(entry);
        }
        if self.near.len() > NEAR && self.far.is_empty() {
            self.heap.push(self.near.remove(0));
        } else if self.near.len() > SORTED {
            self.heap.extend(self.near.drain(..SORTED / 2));
        }
    }

    /// Puts an entry among the last of `near`. They are moved as they are passed: where the walk ends
    /// no processor can guess, and moving them afterwards would be one guess more.
    #[inline(always)]
    fn insert_near(&mut self, entry: Entry) {
        self.near.push(entry);
        let last = self.near.len() - 1;
        let near = &mut self.near[..=last];
        let mut at = last;
        while let Some(next) = at.checked_sub(1) {
            if !near[next].before(&entry) {
                break;
            }
            near[at] = near[next];
            at = next;
        }
        near[at] = entry;
    }

    /// Moves what comes later than `near` from the heap to buckets.
    #[cold]
    fn spread_heap(&mut self) {
        let after = self.near.first().map(|latest| latest.time.as_nanos());
        if let Some(horizon_ns) = after.and_then(|time_ns| time_ns.checked_add(1))
            && self.far.is_empty()
        {
            self.far.begin(horizon_ns);
            for entry in std::mem::take(&mut self.heap) {
                if entry.time.as_nanos() >= horizon_ns {
                    self.far.push(entry);
                } else {
                    self.heap.push(entry);
                }
            }
            self.far.end_if_empty();
        }
        // Where so many come at one time, this is not to be tried at each.
        self.spread_at = HEAP.max(2 * self.heap.len());
    }

    /// The earliest event that is not of the present instant's later steps.
    #[inline]
    fn timed(&mut self) -> Option<&Entry> {
        if self.near.is_empty() {
            self.refill();
        }
        self.near.last()
    }

    /// Adds the next of the later events to `near`.
    #[inline(never)]
    fn refill(&mut self) {
        let known = self.near.len();
        if !self.heap.is_empty() {
            // From the heap they come in order: the earliest first, which belongs at the end.
            self.near
                .extend((0..NEAR / 2).map_while(|_| self.heap.pop()));
            self.near[known..].reverse();
        } else if !self.far.is_empty() {
            self.far.take_next(&mut self.near);
            // Greatest entry first is least key first, which belongs at the end.
            self.near[known..].sort_unstable();
        }
        // What was known comes earlier.
        self.near.rotate_left(known);
    }

    /// Sees to it that [`Queue::batch`] knows some events, if there are any.
    pub(crate) fn look_ahead(&mut self) {
        while self.near.len() < KNOWN && !(self.heap.is_empty() && self.far.is_empty()) {
            self.refill();
        }
    }

    /// Of the next events of later instants the batch of this number, the last first.
    pub(crate) fn batch(&self, number: usize) -> &[Entry] {
        let end = self.near.len().saturating_sub(number * BATCH);
        &self.near[end.saturating_sub(BATCH)..end]
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

    /// The key of the next event, for who goes from one to the next.
    pub(crate) fn peek_key(&mut self) -> Option<EventKey> {
        let next = self.next.iter().max().copied();
        let near = self.present.front().copied().into_iter().chain(next);
        let timed = self.timed().copied();
        // The greatest entry is the least key.
        near.chain(timed).max().map(|entry| entry.key())
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
        self.heap.retain(|entry| keep(entry));
        self.far.retain(&mut keep);
        self.present.retain(|entry| keep(entry));
        self.next.retain(|entry| keep(entry));
    }

    /// Everything left, in key order.
    pub(crate) fn drain_sorted(&mut self) -> Vec<Entry> {
        let mut rest: Vec<Entry> = self.far.drain().chain(self.heap.drain()).collect();
        rest.append(&mut self.near);
        rest.extend(self.present.drain(..));
        rest.append(&mut self.next);
        rest.sort_unstable_by(|a, b| b.cmp(a));
        rest
    }
}

#[cfg(test)]
mod tests;
