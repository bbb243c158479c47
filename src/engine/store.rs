//! Where events wait, by slot. Slots are reused, last freed first, while they are still in the cache.

use std::slice::from_ref;

use prefetch_index::prefetch_index;

use super::{Class, Head, Sealed, Side};
use crate::ids::EntityId;

/// An event that waits: what is known of a message and the message itself, in two lines of cache.
/// They are neighbours that many a processor reads together: those of one aligned pair.
#[repr(align(128))]
struct Waiting {
    head: Head,
    letter: Option<Sealed>,
}

/// The events that wait, by slot.
#[derive(Default)]
pub(crate) struct Store {
    waiting: Vec<Waiting>,
    /// What few events have besides, by slot; shorter than the others if no late slot has any.
    sides: Vec<Side>,
    free: Vec<u32>,
    /// How many of the events that wait have no effect any more.
    voids: usize,
}

impl Store {
    /// Puts an event in a free slot. Inlined, so that it is built where it waits.
    #[inline(always)]
    pub(crate) fn insert(&mut self, head: Head, letter: Option<Sealed>) -> u32 {
        let slot = match self.free.pop() {
            Some(slot) => slot,
            None => self.append(),
        };
        let waiting = &mut self.waiting[slot as usize];
        waiting.head = head;
        // A free slot has no letter. To the compiler it may have one, whose drop may panic, for which
        // the new one would be copied about.
        std::mem::forget(std::mem::replace(&mut waiting.letter, letter));
        slot
    }

    /// A new slot.
    #[cold]
    fn append(&mut self) -> u32 {
        let slot = u32::try_from(self.waiting.len()).expect("fewer than 2^32 events wait");
        self.waiting.push(Waiting {
            head: Head::of_entity(Class::Void, EntityId::CONTROL),
            letter: None,
        });
        slot
    }

    /// Adds to an event just inserted, whose head says that it has a side.
    pub(crate) fn set_side(&mut self, slot: u32, side: Side) {
        if self.sides.len() <= slot as usize {
            self.sides.resize(slot as usize + 1, Side::default());
        }
        self.sides[slot as usize] = side;
    }

    /// Takes the event out of its slot, which must hold one. Its side stays there until the slot is
    /// used again.
    #[inline(always)]
    pub(crate) fn take(&mut self, slot: u32) -> (Head, Option<Sealed>) {
        let head = self.take_head(slot);
        (head, self.take_letter(slot))
    }

    /// The first half of [`Store::take`], for who is to have each half in its own place.
    #[inline(always)]
    pub(crate) fn take_head(&mut self, slot: u32) -> Head {
        let head = self.waiting[slot as usize].head;
        self.free.push(slot);
        if head.class == Class::Void {
            self.voids -= 1;
        }
        head
    }

    /// The second half of [`Store::take`].
    #[inline(always)]
    pub(crate) fn take_letter(&mut self, slot: u32) -> Option<Sealed> {
        self.waiting[slot as usize].letter.take()
    }

    /// What an event just taken has besides.
    #[inline]
    pub(crate) fn side(&self, slot: u32, head: &Head) -> Option<Side> {
        head.has_side.then(|| self.sides[slot as usize])
    }

    /// Whose event waits in this slot.
    #[inline(always)]
    pub(crate) fn receiver(&self, slot: u32) -> EntityId {
        self.waiting[slot as usize].head.receiver
    }

    /// Fetches the event in this slot, both of its lines.
    #[inline(always)]
    pub(crate) fn fetch(&self, slot: u32) {
        let waiting = &self.waiting[slot as usize];
        prefetch_index(from_ref(&waiting.head.receiver), 0);
        prefetch_index(from_ref(&waiting.letter), 0);
    }

    /// True if what waits does not fit into a processor's nearest caches.
    #[inline(always)]
    pub(crate) fn is_large(&self) -> bool {
        const LARGE: usize = 4096;
        self.waiting.len() >= LARGE
    }

    /// Completes the head of a message that waits.
    #[inline(always)]
    pub(crate) fn complete(&mut self, slot: u32, receiver: EntityId, ordinal: u64) {
        let head = &mut self.waiting[slot as usize].head;
        (head.receiver, head.ordinal) = (receiver, ordinal);
    }

    /// Cancels the timer in `slot` if `is_it` says that it is the one meant; true if so.
    pub(crate) fn cancel(&mut self, slot: u32, is_it: impl FnOnce(&Head) -> bool) -> bool {
        let Some(Waiting { head, letter }) = self.waiting.get_mut(slot as usize) else {
            return false;
        };
        // A free slot still has its last head, but no letter.
        if letter.is_none() || head.class != Class::Timer || !is_it(head) {
            return false;
        }
        head.class = Class::Void;
        self.voids += 1;
        // Last, since dropping a message may panic.
        *letter = None;
        true
    }

    /// Takes an event out of a slot whose place in the queue stays behind, without effect.
    pub(crate) fn take_ahead(&mut self, slot: u32) -> (Head, Option<Sealed>, Option<Side>) {
        let (head, letter) = self.take(slot);
        self.free.pop();
        self.waiting[slot as usize].head.class = Class::Void;
        self.voids += 1;
        (head, letter, self.side(slot, &head))
    }

    /// True once events without effect are worth shedding: many, and most of what waits.
    pub(crate) fn is_mostly_void(&self) -> bool {
        const WORTH_IT: usize = 1024;
        let waiting = self.waiting.len() - self.free.len();
        self.voids >= WORTH_IT && self.voids * 2 > waiting
    }

    /// True for an event without effect: a cancelled timer, or what came sooner.
    pub(crate) fn is_void(&self, slot: u32) -> bool {
        self.waiting[slot as usize].head.class == Class::Void
    }
}

#[cfg(test)]
mod tests {
    use std::mem::offset_of;

    use super::*;

    /// Every event is written and read once; each further line of cache costs as much again.
    #[test]
    fn an_event_waits_in_two_lines_of_cache_and_both_are_fetched() {
        assert_eq!(size_of::<Waiting>(), 128);
        let fetched = [
            offset_of!(Waiting, letter),
            offset_of!(Waiting, head.receiver),
        ];
        let mut lines = fetched.map(|offset| offset / 64);
        lines.sort_unstable();
        assert_eq!(lines, [0, 1], "{fetched:?}");
    }
}
