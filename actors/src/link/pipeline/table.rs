//! The messages that a link follows, by the token that it knows them by.

use std::ops::{Index, IndexMut};

use farside::carrier::{Carriage, Parcel};
use farside::{SimDuration, SimTime};

use super::super::stage::Piece;
use super::super::transmit::Attempt;
use super::super::{LinkParams, difference};

/// A message that is followed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Message {
    pub(super) copy: u32,
    /// How many copies set out.
    pub(super) copies: u32,
    /// Its size, without anything beside it.
    pub(super) bytes: u64,
    /// What it counts in the line.
    pub(super) waiting_bytes: u64,
    /// The most bytes of it in one piece, and what each piece has beside them.
    mtu: u64,
    header: u64,
    pub(super) fragments: u32,
    /// How many of them were transmitted at least once.
    pub(super) begun: u32,
    /// How many have not arrived.
    pub(super) missing: u32,
    /// How many were begun and may still be transmitted again.
    pub(super) open: u32,
    /// How often each is sent again, by what held when the first was transmitted.
    pub(super) retries: u32,
    /// The sequence number of the first of them.
    pub(super) first_frame: u64,
    pub(super) expires: Option<SimTime>,
    /// It cannot be transmitted sooner.
    pub(super) not_before: SimTime,
    sent: SimTime,
    first_start: Option<SimTime>,
    /// When its last transmission so far ended.
    end: SimTime,
    pub(super) propagation: SimDuration,
    /// On the air with what got through.
    on_air: SimDuration,
    /// On the air with what did not get through, the last time.
    failed_air: SimDuration,
    /// The latest arrival of its pieces.
    pub(super) arrival: SimTime,
    attempts: u32,
    pub(super) energy_j: f64,
    pub(super) receive_j: f64,
    /// Why one of its pieces was lost first, where nobody knows.
    pub(super) failed: Option<&'static str>,
    /// Its place in the order, if it has to wait for its turn to be let out.
    pub(super) place: Option<u64>,
    /// When it may be let out.
    pub(super) let_out: Option<SimTime>,
    /// It was delivered, and is kept until the sender knows.
    pub(super) told: bool,
    /// The number of the copy that it is kept as from now on.
    another: Option<u32>,
    /// It went before it was begun, and its place in the line is still to be forgotten.
    pub(super) gone: bool,
}

impl Message {
    /// A message that has just come.
    pub(super) fn new(
        params: &LinkParams,
        parcel: &Parcel<'_>,
        (copy, copies): (u32, u32),
    ) -> Self {
        let bytes = parcel.size_bytes();
        let mtu = params.mtu.unwrap_or(u64::MAX).max(1);
        let fragments = bytes.div_ceil(mtu).max(1);
        let fragments = u32::try_from(fragments).unwrap_or(u32::MAX);
        Message {
            copy,
            copies,
            bytes,
            waiting_bytes: 0,
            mtu,
            header: if fragments > 1 {
                params.fragment_header
            } else {
                0
            },
            fragments,
            begun: 0,
            missing: fragments,
            open: 0,
            retries: 0,
            first_frame: 0,
            expires: None,
            not_before: SimTime::ZERO,
            sent: parcel.sent(),
            first_start: None,
            end: SimTime::ZERO,
            propagation: SimDuration::ZERO,
            on_air: SimDuration::ZERO,
            failed_air: SimDuration::ZERO,
            arrival: SimTime::ZERO,
            attempts: 0,
            energy_j: 0.0,
            receive_j: 0.0,
            failed: None,
            place: None,
            let_out: None,
            told: false,
            another: None,
            gone: false,
        }
    }

    /// One of its pieces.
    pub(super) fn piece(&self, fragment: u32) -> Piece {
        let before = self.mtu.saturating_mul(u64::from(fragment));
        let own = self.bytes.saturating_sub(before).min(self.mtu);
        Piece::Part(own.saturating_add(self.header))
    }

    /// Whether there is nothing left to transmit.
    pub(super) fn is_settled(&self) -> bool {
        self.begun == self.fragments && self.open == 0
    }

    /// Takes note of a transmission.
    pub(super) fn transmitted(&mut self, attempt: &Attempt) {
        self.first_start.get_or_insert(attempt.start);
        self.attempts += u32::from(attempt.sent);
        self.energy_j += attempt.energy_j;
        self.end = self.end.max(attempt.end);
        self.propagation = attempt.propagation;
        self.failed_air = match attempt.failed {
            Some(_) => attempt.end.since(attempt.start),
            None => SimDuration::ZERO,
        };
    }

    /// Takes note of a piece that the receiver did not have.
    pub(super) fn arrived(&mut self, attempt: &Attempt) {
        self.missing -= 1;
        self.on_air = self.on_air + attempt.end.since(attempt.start);
    }

    /// Keeps it after it was delivered, as a copy of its own, because the sender does not know.
    pub(super) fn keep(&mut self) {
        self.told = true;
        self.another = Some(self.copies + self.copy);
        (self.attempts, self.energy_j, self.receive_j) = (0, 0.0, 0.0);
        (self.on_air, self.failed_air) = (SimDuration::ZERO, SimDuration::ZERO);
    }

    /// Whether it has just become that copy.
    pub(super) fn is_another(&self) -> bool {
        self.another.is_some()
    }

    /// The number of the copy that it has just become.
    pub(super) fn take_another(&mut self) -> Option<u32> {
        self.another.take()
    }

    /// How it was carried, if that ends at `at`.
    pub(super) fn carriage(&self, at: SimTime) -> Carriage {
        let Some(first) = self.first_start else {
            return Carriage {
                queue: at.since(self.sent),
                ..Carriage::default()
            };
        };
        let end = self.end.min(at);
        let serialization = (self.on_air + self.failed_air).min(end.since(first));
        Carriage {
            queue: first.since(self.sent),
            serialization,
            propagation: self.propagation,
            jitter_ns: difference(at.since(end), self.propagation),
            retries: end.since(first) - serialization,
            attempts: self.attempts,
            fragments: if self.fragments > 1 {
                self.fragments
            } else {
                0
            },
            energy_j: self.energy_j,
            receive_j: 0.0,
        }
    }

    /// The same for one that is dropped while it waits.
    pub(super) fn carriage_until(&self, now: SimTime) -> Carriage {
        let mut message = *self;
        message.propagation = SimDuration::ZERO;
        let waited = message.carriage(now);
        let after = SimDuration::from_nanos(waited.jitter_ns.unsigned_abs());
        Carriage {
            retries: waited.retries + after,
            jitter_ns: 0,
            ..waited
        }
    }
}

/// Messages by token. Tokens are used again.
#[derive(Clone, Debug, Default)]
pub(super) struct Table {
    messages: Vec<Message>,
    free: Vec<u32>,
}

impl Table {
    pub(super) fn put(&mut self, message: Message) -> u32 {
        match self.free.pop() {
            Some(at) => {
                self.messages[at as usize] = message;
                at
            }
            None => {
                self.messages.push(message);
                self.messages.len() as u32 - 1
            }
        }
    }

    pub(super) fn free(&mut self, at: u32) {
        self.free.push(at);
    }
}

impl Index<u32> for Table {
    type Output = Message;

    fn index(&self, at: u32) -> &Message {
        &self.messages[at as usize]
    }
}

impl IndexMut<u32> for Table {
    fn index_mut(&mut self, at: u32) -> &mut Message {
        &mut self.messages[at as usize]
    }
}
