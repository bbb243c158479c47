//! Items that reach a neighbouring node exactly once, over links that are late, lose and repeat: each
//! is numbered, repeated until it is acknowledged, and taken once. Order is not kept; nothing here
//! needs it. All of it is durable, so that a crash is no more than a delay.

use std::collections::{BTreeMap, BTreeSet};

use super::messages::{Item, Numbered};

/// The first guess of a round trip \[ns\].
const FIRST_ROUND_TRIP: u64 = 200_000_000;
/// An item is never repeated sooner than this after the last time \[ns\].
const LEAST_PATIENCE: u64 = 40_000_000;

#[derive(Debug)]
struct Pending {
    item: Item,
    first_sent: u64,
    repeat_at: u64,
    repeats: u32,
}

/// One direction to, and one from, a neighbour.
#[derive(Debug)]
pub(super) struct Line {
    next: u64,
    pending: BTreeMap<u64, Pending>,
    /// All below were taken.
    taken: u64,
    /// Taken beyond that.
    beyond: BTreeSet<u64>,
    /// The neighbour is owed an acknowledgement.
    owes: bool,
    /// Smoothed round trip \[ns\].
    round_trip: Option<u64>,
}

impl Default for Line {
    fn default() -> Self {
        Line {
            next: 0,
            pending: BTreeMap::new(),
            taken: 0,
            beyond: BTreeSet::new(),
            owes: false,
            round_trip: None,
        }
    }
}

/// What acknowledges: all below `taken`, and these.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Receipt {
    pub(super) taken: u64,
    pub(super) beyond: Vec<u64>,
}

impl Line {
    pub(super) fn post(&mut self, item: Item) {
        let pending = Pending {
            item,
            first_sent: 0,
            repeat_at: 0,
            repeats: 0,
        };
        self.pending.insert(self.next, pending);
        self.next += 1;
    }

    /// The measured round trip; a guess before the first answer \[ns\].
    pub(super) fn round_trip(&self) -> u64 {
        self.round_trip.unwrap_or(FIRST_ROUND_TRIP)
    }

    pub(super) fn is_measured(&self) -> bool {
        self.round_trip.is_some()
    }

    /// What is to be sent now: items that are new or overdue, and a receipt. None if nothing is due.
    pub(super) fn due(&mut self, now: u64) -> Option<(Receipt, Vec<Numbered>)> {
        let patience = (2 * self.round_trip()).max(LEAST_PATIENCE);
        let mut items = Vec::new();
        for (&number, pending) in &mut self.pending {
            if pending.repeat_at > now {
                continue;
            }
            if pending.first_sent == 0 {
                pending.first_sent = now.max(1);
            } else {
                pending.repeats += 1;
            }
            // Each time it waits longer, up to eight times as long.
            let factor = 1u64 << pending.repeats.min(3);
            pending.repeat_at = now + patience * factor;
            let item = pending.item.clone();
            items.push(Numbered { number, item });
        }
        if items.is_empty() && !self.owes {
            return None;
        }
        self.owes = false;
        let receipt = Receipt {
            taken: self.taken,
            beyond: self.beyond.iter().copied().collect(),
        };
        Some((receipt, items))
    }

    /// When an item is to be repeated, if any is on its way.
    pub(super) fn next_due(&self) -> Option<u64> {
        self.pending.values().map(|p| p.repeat_at).min()
    }

    /// After a crash nobody knows what was on its way: all is repeated.
    pub(super) fn restart(&mut self) {
        for pending in self.pending.values_mut() {
            pending.repeat_at = 0;
            pending.repeats += 1;
        }
    }

    pub(super) fn acknowledged(&mut self, receipt: &Receipt, now: u64) {
        let done = |number: u64| number < receipt.taken || receipt.beyond.contains(&number);
        for (&number, pending) in &self.pending {
            // An item that was repeated does not say which of its copies is answered.
            if done(number) && pending.repeats == 0 && pending.first_sent > 0 {
                let sample = now.saturating_sub(pending.first_sent);
                let smoothed = self.round_trip.map_or(sample, |old| (7 * old + sample) / 8);
                self.round_trip = Some(smoothed);
            } else if done(number) && self.round_trip.is_none() {
                // Better than no measurement: on slow links every first item is repeated.
                self.round_trip = Some(now.saturating_sub(pending.first_sent));
            }
        }
        self.pending.retain(|&number, _| !done(number));
    }

    /// Takes an item, unless it was taken before.
    pub(super) fn take(&mut self, numbered: Numbered) -> Option<Item> {
        self.owes = true;
        let Numbered { number, item } = numbered;
        if number < self.taken || !self.beyond.insert(number) {
            return None;
        }
        while self.beyond.remove(&self.taken) {
            self.taken += 1;
        }
        Some(item)
    }
}
