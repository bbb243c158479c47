//! Items that reach a neighbouring node exactly once, over links that are late, lose and repeat:
//! each is numbered, repeated until it is acknowledged, and taken once. Order is not kept; nothing
//! here needs it. All of it is durable, so that a crash is no more than a delay.

use std::collections::{BTreeMap, BTreeSet};

use super::messages::{Item, Numbered};

/// The first guess of a round trip \[ns\].
const FIRST_ROUND_TRIP: u64 = 200_000_000;
/// An item is never repeated sooner than this after the last time \[ns\].
const LEAST_PATIENCE: u64 = 40_000_000;

#[derive(Debug)]
struct Pending {
    item: Item,
    /// When it is to be sent, again or for the first time [ns].
    due: u64,
    sent: u32,
}

/// One direction to, and one from, a neighbour.
#[derive(Debug, Default)]
pub(crate) struct Line {
    next: u64,
    pending: BTreeMap<u64, Pending>,
    /// All below were taken.
    taken: u64,
    /// Taken beyond that.
    beyond: BTreeSet<u64>,
    /// The neighbour is owed a receipt, for a message that it sent then [ns].
    owes: Option<u64>,
    /// Smoothed round trip \[ns\].
    round_trip: Option<u64>,
}

/// What acknowledges: all below `taken`, and these.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Receipt {
    pub(crate) taken: u64,
    pub(crate) beyond: Vec<u64>,
    /// When the message was sent that this answers, by the clock of its sender [ns].
    pub(crate) echo: Option<u64>,
}

impl Line {
    pub(crate) fn post(&mut self, item: Item) {
        let pending = Pending {
            item,
            due: 0,
            sent: 0,
        };
        self.pending.insert(self.next, pending);
        self.next += 1;
    }

    /// The measured round trip; a guess before the first answer \[ns\].
    pub(crate) fn round_trip(&self) -> u64 {
        self.round_trip.unwrap_or(FIRST_ROUND_TRIP)
    }

    pub(crate) fn is_measured(&self) -> bool {
        self.round_trip.is_some()
    }

    /// What is to be sent now: items that are new or overdue, and a receipt. None if nothing is
    /// due.
    pub(crate) fn due(&mut self, now: u64) -> Option<(Receipt, Vec<Numbered>)> {
        let patience = (2 * self.round_trip()).max(LEAST_PATIENCE);
        let mut items = Vec::new();
        let mut has_part = false;
        for (&number, pending) in &mut self.pending {
            if pending.due > now {
                continue;
            }
            // Parts of the roadmap are long: one in a message, the others in the next.
            if matches!(pending.item, Item::Roadmap(_)) && std::mem::replace(&mut has_part, true) {
                continue;
            }
            // Each time it waits longer, up to four times as long.
            pending.due = now + (patience << pending.sent.min(2));
            pending.sent += 1;
            let item = pending.item.clone();
            items.push(Numbered { number, item });
        }
        let echo = self.owes.take();
        if items.is_empty() && echo.is_none() {
            return None;
        }
        let receipt = Receipt {
            taken: self.taken,
            beyond: self.beyond.iter().copied().collect(),
            echo,
        };
        Some((receipt, items))
    }

    /// When an item is to be repeated, if any is on its way.
    pub(crate) fn next_due(&self) -> Option<u64> {
        self.pending.values().map(|p| p.due).min()
    }

    /// After a crash nobody knows what was on its way: all is repeated.
    pub(crate) fn restart(&mut self) {
        for pending in self.pending.values_mut() {
            pending.due = 0;
        }
    }

    /// One of the ends is replaced: numbers begin anew, and what was not acknowledged is said
    /// again, to whom that may have been news before.
    pub(crate) fn renew(&mut self) {
        let pending = std::mem::take(&mut self.pending);
        *self = Line::default();
        for item in pending.into_values().map(|pending| pending.item) {
            self.post(item);
        }
    }

    /// Takes what is to be said off the line: who is at its other end is here.
    pub(crate) fn hand_over(&mut self) -> Vec<Item> {
        let pending = std::mem::take(&mut self.pending);
        pending.into_values().map(|pending| pending.item).collect()
    }

    /// A receipt has come. What it echoes says how long a round trip takes, however often things
    /// were repeated.
    pub(crate) fn acknowledged(&mut self, receipt: &Receipt, now: u64) {
        if let Some(sent) = receipt.echo {
            let sample = now.saturating_sub(sent);
            let smoothed = self.round_trip.map_or(sample, |old| (7 * old + sample) / 8);
            self.round_trip = Some(smoothed);
        }
        let done = |number: u64| number < receipt.taken || receipt.beyond.contains(&number);
        self.pending.retain(|&number, _| !done(number));
    }

    /// Takes an item of a message sent at `sent`, unless it was taken before.
    pub(crate) fn take(&mut self, sent: u64, numbered: Numbered) -> Option<Item> {
        self.owes = Some(sent);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ids::RoverId;
    use crate::reservation::messages::{ReservationRequest, Settle, Verdict};
    use proptest::prelude::*;

    fn item(attempt: u32) -> Item {
        let request = ReservationRequest {
            rover: RoverId(0),
            attempt,
            since: 0,
        };
        Item::Settle(Settle {
            request,
            verdict: Verdict::Confirmed,
            route: Vec::new(),
            at: 0,
        })
    }

    type Flight = (u64, bool, u64, Receipt, Vec<Numbered>);

    proptest! {
        /// Over a line that delays, reorders, loses and repeats, and with ends that crash, each
        /// item is taken once.
        #[test]
        fn each_item_is_taken_once(
            fates in proptest::collection::vec((0u64..400, 0u8..4), 1..200),
            posts in proptest::collection::vec(0u64..3_000, 1..20),
            crash in 0u64..4_000,
        ) {
            const MS: u64 = 1_000_000;
            let (mut a, mut b) = (Line::default(), Line::default());
            let mut air: Vec<Flight> = Vec::new();
            let mut taken = Vec::new();
            let mut sent = 0;
            for now in (0..40_000u64).map(|ms| ms * MS) {
                for (i, _) in (0..).zip(&posts).filter(|(_, at)| **at * MS == now) {
                    a.post(item(i));
                }
                if now == crash * MS {
                    a.restart();
                    b.restart();
                }
                let (here, rest): (Vec<_>, Vec<_>) = air.into_iter().partition(|f| f.0 <= now);
                air = rest;
                for (_, to_b, at, receipt, items) in here {
                    let line = if to_b { &mut b } else { &mut a };
                    line.acknowledged(&receipt, now);
                    for numbered in items {
                        taken.extend(line.take(at, numbered));
                    }
                }
                for (line, to_b) in [(&mut a, true), (&mut b, false)] {
                    if let Some((receipt, items)) = line.due(now) {
                        // Every fourth fate is a loss, another one a repetition, at least at first.
                        let (delay, fate) = fates[sent % fates.len()];
                        sent += 1;
                        let lost = fate == 0 && sent < 16;
                        let copies = usize::from(!lost) + usize::from(fate == 1);
                        for copy in 0..copies as u64 {
                            let at = now + (delay + 7 * copy) * MS;
                            air.push((at, to_b, now, receipt.clone(), items.clone()));
                        }
                    }
                }
            }
            let number = |item: &Item| match item {
                Item::Settle(settle) => settle.request.attempt,
                _ => u32::MAX,
            };
            let mut numbers: Vec<u32> = taken.iter().map(number).collect();
            numbers.sort_unstable();
            prop_assert_eq!(numbers, (0..posts.len() as u32).collect::<Vec<_>>());
            prop_assert_eq!(a.next_due(), None);
        }
    }

    #[test]
    fn a_round_trip_is_measured_however_often_things_are_repeated() {
        let (mut a, mut b) = (Line::default(), Line::default());
        a.post(item(0));
        let first = a.due(0).unwrap();
        // The first is lost; a repetition gets through after 3 s.
        let wait = a.next_due().unwrap();
        assert!(a.due(wait - 1).is_none());
        let (_, items) = a.due(wait).unwrap();
        assert_eq!(items, first.1);
        let arrives = wait + 3_000_000_000;
        for numbered in items {
            b.take(wait, numbered);
        }
        let (receipt, _) = b.due(arrives).unwrap();
        a.acknowledged(&receipt, arrives + 3_000_000_000);
        assert_eq!(a.round_trip(), 6_000_000_000);
        assert_eq!(a.next_due(), None);
    }
}
