//! Where events wait: what is known of a message in one table, the message itself in another, both
//! by slot. Slots are reused, last freed first, while they are still in the cache.

use super::{Class, Head, Pending, Sealed, Side};

/// The events that wait, by slot.
#[derive(Default)]
pub(crate) struct Store {
    heads: Vec<(Class, Head)>,
    letters: Vec<Option<Sealed>>,
    /// What few events have besides, by slot; shorter than the others if no late slot has any.
    sides: Vec<Side>,
    free: Vec<u32>,
    /// How many of the events that wait have no effect any more.
    voids: usize,
}

impl Store {
    /// Puts an event in a free slot. Inlined, so that it is built where it waits.
    #[inline(always)]
    pub(crate) fn insert(&mut self, class: Class, head: Head, letter: Option<Sealed>) -> u32 {
        if let Some(slot) = self.free.pop() {
            self.heads[slot as usize] = (class, head);
            self.letters[slot as usize] = letter;
            return slot;
        }
        let slot = u32::try_from(self.heads.len()).expect("fewer than 2^32 events wait");
        self.heads.push((class, head));
        self.letters.push(letter);
        slot
    }

    /// Adds to an event just inserted, whose head says that it has a side.
    pub(crate) fn set_side(&mut self, slot: u32, side: Side) {
        if self.sides.len() <= slot as usize {
            self.sides.resize(slot as usize + 1, Side::default());
        }
        self.sides[slot as usize] = side;
    }

    /// Takes the event out of its slot, which must hold one.
    #[inline(always)]
    pub(crate) fn take(&mut self, slot: u32) -> Pending {
        let (class, head) = self.heads[slot as usize];
        self.free.push(slot);
        if class == Class::Void {
            self.voids -= 1;
        }
        Pending {
            class,
            head,
            letter: self.letters[slot as usize].take(),
            side: head.has_side.then(|| self.sides[slot as usize]),
        }
    }

    /// Cancels the timer in `slot` if `is_it` says that it is the one meant; true if so.
    pub(crate) fn cancel(&mut self, slot: u32, is_it: impl FnOnce(&Head) -> bool) -> bool {
        // A free slot still has its last head, but no letter.
        let waits = self.letters.get(slot as usize).is_some_and(Option::is_some);
        let Some((class, head)) = self.heads.get_mut(slot as usize).filter(|_| waits) else {
            return false;
        };
        if *class != Class::Timer || !is_it(head) {
            return false;
        }
        *class = Class::Void;
        self.voids += 1;
        // Last, since dropping a message may panic.
        self.letters[slot as usize] = None;
        true
    }

    /// Takes an event out of a slot whose place in the queue stays behind, without effect.
    pub(crate) fn take_ahead(&mut self, slot: u32) -> Pending {
        let pending = self.take(slot);
        self.free.pop();
        self.heads[slot as usize].0 = Class::Void;
        self.voids += 1;
        pending
    }

    /// True once events without effect are worth shedding: many, and most of what waits.
    pub(crate) fn is_mostly_void(&self) -> bool {
        const WORTH_IT: usize = 1024;
        let waiting = self.heads.len() - self.free.len();
        self.voids >= WORTH_IT && self.voids * 2 > waiting
    }

    /// True for an event without effect: a cancelled timer, or what came sooner.
    pub(crate) fn is_void(&self, slot: u32) -> bool {
        self.heads[slot as usize].0 == Class::Void
    }
}
