//! Messages that are followed while they are under way: in fragments, several at a time, each
//! acknowledged or sent again.
//!
//! A link without these keys decides all of a message when it is sent. Where a later message may be
//! transmitted before an earlier one is repeated, that cannot be: each transmission is then decided
//! when it begins, and in between the messages are parked ([`Verdicts::park`]). A message costs as
//! many events as it has transmissions, and two more, however many wait.
//!
//! The sender transmits, as soon as the transmitter is free: what is due to be sent again, first
//! due first; else the next fragment of the message that it has begun; else the next message of the
//! line. New ones need room in the window: less than `window` sequence numbers from the first on
//! that is neither acknowledged nor given up. Nobody's timer ends while the answer is on its way.

mod ack;
mod steps;
mod table;

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};
use std::sync::Arc;

use farside::carrier::{Carriage, Parcel, Verdicts};
use farside::{SimDuration, SimTime};

use super::transmit::{Path, Transmitter};
use super::{DUPLICATE, EXPIRED, QUEUE_FULL, Timeline};
use ack::Acks;
use table::{Message, Table};

/// A message, or a fragment of one, that may have to be sent again.
#[derive(Clone, Copy, Debug)]
struct Frame {
    message: u32,
    fragment: u32,
    attempts: u32,
    /// Whether the receiver has it.
    arrived: bool,
    /// When the sender is done with it, once that is known.
    closed: Option<SimTime>,
}

/// A message's place in the order in which messages were begun.
#[derive(Clone, Copy, Debug)]
struct Place {
    message: u32,
    /// When it need not be waited for any more, once that is known.
    ready: Option<SimTime>,
    /// Whether nothing arrives.
    lost: bool,
}

/// Both ends of a link whose messages are followed.
#[derive(Clone, Debug, Default)]
pub(super) struct Pipeline {
    messages: Table,
    /// Messages that are not begun, as they came; those that have gone meanwhile too.
    line: VecDeque<u32>,
    /// What waits in it.
    waiting: u64,
    waiting_bytes: u64,
    /// The message that is begun and has fragments that are not.
    current: Option<u32>,
    /// Frames by sequence number, from `base` on.
    frames: VecDeque<Frame>,
    base: u64,
    /// When which frames are sent again, unless they are closed by then.
    due: BinaryHeap<Reverse<(SimTime, u64)>>,
    /// Frames that are due and wait for the transmitter.
    urgent: VecDeque<u64>,
    /// Messages that were begun and have not been let out, in order.
    order: VecDeque<Place>,
    order_base: u64,
    /// The latest arrival that was let out in order.
    let_out: SimTime,
    /// Messages that are let out in this instant, in order, until they have been looked at.
    leaving: VecDeque<u32>,
    acks: Acks,
}

/// What is to be transmitted next.
#[derive(Clone, Copy, Debug)]
enum Turn {
    Again(u64),
    New(u32),
}

/// One look at one message.
struct Look<'a, 'p> {
    parcel: &'a Parcel<'p>,
    at: u32,
    now: SimTime,
    /// Nothing arrives sooner from now.
    least: SimDuration,
    verdicts: &'a mut Verdicts,
}

impl Pipeline {
    /// What follows the messages of a link whose answers come back over a link with this timeline.
    pub(super) fn new(back: Option<Arc<Timeline>>) -> Self {
        Pipeline {
            acks: Acks::new(back),
            ..Pipeline::default()
        }
    }

    /// Decides what becomes of a message now.
    pub(super) fn carry(&mut self, tx: &mut Transmitter, parcel: &Parcel<'_>, out: &mut Verdicts) {
        let now = parcel.now();
        let least = tx.min_delay();
        let look = |at, verdicts| Look {
            parcel,
            at,
            now,
            least,
            verdicts,
        };
        self.slide(now);
        if let Some(token) = parcel.token() {
            return self.look(tx, look(token as u32, out));
        }
        let copies = tx.copies(parcel);
        for copy in 0..copies {
            let Some(at) = self.accept(tx, parcel, (copy, copies)) else {
                let carriage = Carriage {
                    queue: now.since(parcel.sent()),
                    ..Carriage::default()
                };
                out.lose_as(SimDuration::ZERO, QUEUE_FULL, carriage);
                continue;
            };
            if copies > 1 {
                // Each in a look of its own: one copy may get several verdicts.
                out.park(None, u64::from(at));
                continue;
            }
            return self.look(tx, look(at, out));
        }
        for at in self.line.iter().rev().take(copies as usize) {
            out.wake(SimDuration::ZERO, u64::from(*at));
        }
    }

    /// Takes one copy of a message into the line, if there is room.
    fn accept(
        &mut self,
        tx: &Transmitter,
        parcel: &Parcel<'_>,
        (copy, copies): (u32, u32),
    ) -> Option<u32> {
        let now = parcel.now();
        let params = tx.timeline().at(now);
        let mut message = Message::new(params, parcel, (copy, copies));
        message.expires = tx.expires(parcel);
        let bytes = message.bytes.saturating_add(params.overhead);
        let idle = self.waiting == 0 && tx.free_at() <= now && self.next().is_none();
        let begins = || {
            let piece = message.piece(0);
            let opening = tx.opening_for(parcel, piece, now, &Path::default());
            self.frames.len() < params.window as usize && opening.is_ok_and(|at| at <= now)
        };
        if !(idle && begins())
            && let Some(limit) = params.queue
            && !limit.allows(self.waiting + 1, self.waiting_bytes.saturating_add(bytes))
        {
            return None;
        }
        message.waiting_bytes = bytes;
        self.waiting += 1;
        self.waiting_bytes = self.waiting_bytes.saturating_add(bytes);
        let at = self.messages.put(message);
        self.line.push_back(at);
        Some(at)
    }

    /// Forgets frames that the sender is done with, from the first on, and finds those that are
    /// due.
    fn slide(&mut self, now: SimTime) {
        while let Some(frame) = self.frames.front()
            && frame.closed.is_some_and(|closed| closed <= now)
        {
            self.frames.pop_front();
            self.base += 1;
        }
        while let Some(Reverse((at, number))) = self.due.peek().copied()
            && (at <= now || self.is_closed(number))
        {
            self.due.pop();
            if !self.is_closed(number) {
                self.urgent.push_back(number);
            }
        }
        while let Some(number) = self.urgent.front()
            && self.is_closed(*number)
        {
            self.urgent.pop_front();
        }
    }

    fn frame(&mut self, number: u64) -> &mut Frame {
        &mut self.frames[(number - self.base) as usize]
    }

    fn is_closed(&self, number: u64) -> bool {
        let at = number.checked_sub(self.base);
        let frame = at.and_then(|at| self.frames.get(at as usize));
        frame.is_none_or(|frame| frame.closed.is_some())
    }

    /// What comes next, and when there is room for it in the window, if that is known.
    fn next(&self) -> Option<Turn> {
        if let Some(number) = self.urgent.iter().find(|number| !self.is_closed(**number)) {
            return Some(Turn::Again(*number));
        }
        let new = self.current.or_else(|| {
            let mut line = self.line.iter().copied();
            line.find(|at| !self.messages[*at].gone)
        });
        new.map(Turn::New)
    }

    /// Whose turn is next, and from when on, as far as is known.
    fn turn(&self, tx: &Transmitter, now: SimTime) -> Option<(u32, SimTime)> {
        let (at, room) = match self.next()? {
            Turn::Again(number) => (self.frames[(number - self.base) as usize].message, now),
            Turn::New(at) => (at, self.room(tx, now)?),
        };
        let from = room.max(tx.free_at()).max(self.messages[at].not_before);
        Some((at, from))
    }

    /// From when on there is room in the window, if that is known.
    fn room(&self, tx: &Transmitter, now: SimTime) -> Option<SimTime> {
        let window = tx.timeline().at(now).window as usize;
        match self.frames.front() {
            Some(first) if self.frames.len() >= window => first.closed,
            _ => Some(now),
        }
    }

    /// Does what there is to do for one message, and says what becomes of it.
    fn look(&mut self, tx: &mut Transmitter, mut look: Look<'_, '_>) {
        // What is kept of a message that was let out expires in a look of its own, as the copy that it is.
        let mut stays = !self.let_out_if_ready(&mut look)
            && (self.messages[look.at].is_another() || !self.expire(&mut look));
        // What is kept of a message that was let out is looked at for itself.
        while stays && tx.free_at() <= look.now && !self.messages[look.at].is_another() {
            match self.turn(tx, look.now) {
                Some((at, from)) if at == look.at && from <= look.now => {}
                _ => break,
            }
            stays = self.transmit(tx, &mut look);
            self.slide(look.now);
        }
        let own = self.arrange(tx, &mut look, stays);
        if stays {
            let message = &self.messages[look.at];
            let expires = message.expires.filter(|_| !message.is_settled());
            let leaves = message.let_out.filter(|_| !message.told).map(|_| look.now);
            let latest = own.into_iter().chain(expires).chain(leaves).min();
            let latest = latest.map(|at| at.since(look.now));
            match self.messages[look.at].take_another() {
                Some(copy) => look.verdicts.park_another(latest, u64::from(look.at), copy),
                None => look.verdicts.park(latest, u64::from(look.at)),
            }
        }
    }

    /// Sees to it that whoever is next, and whoever is due next, is looked at then. When that is
    /// the message in hand, says when.
    fn arrange(
        &mut self,
        tx: &Transmitter,
        look: &mut Look<'_, '_>,
        stays: bool,
    ) -> Option<SimTime> {
        self.slide(look.now);
        while let Some(first) = self.line.front().copied()
            && self.messages[first].gone
        {
            self.line.pop_front();
            self.messages.free(first);
        }
        let turn = self.turn(tx, look.now);
        let due = self.due.peek().map(|Reverse((at, number))| {
            let frame = &self.frames[(number - self.base) as usize];
            (frame.message, *at)
        });
        let mut own = None;
        for (at, when) in [turn, due].into_iter().flatten() {
            let when = when.max(look.now);
            if at == look.at && stays {
                own = Some(own.map_or(when, |own: SimTime| own.min(when)));
            } else {
                look.verdicts.wake(when.since(look.now), u64::from(at));
            }
        }
        own
    }

    /// Drops the message in hand if it has waited for too long; true if it is done with.
    fn expire(&mut self, look: &mut Look<'_, '_>) -> bool {
        let message = &self.messages[look.at];
        let expired = message.expires.is_some_and(|at| at <= look.now);
        expired && !message.is_settled() && self.give_up(look, EXPIRED)
    }

    /// Transmits no more of the message in hand, for this reason; true if it is done with, and has
    /// not arrived and waits there for its turn.
    fn give_up(&mut self, look: &mut Look<'_, '_>, reason: &'static str) -> bool {
        self.drop_frames(look.at, look.now);
        let message = &self.messages[look.at];
        if message.missing == 0 && !message.told {
            return false;
        }
        let reason = if message.told { DUPLICATE } else { reason };
        let carriage = message.carriage_until(look.now);
        let known = look.now + message.propagation;
        self.lose(look, reason, look.now, known, carriage);
        true
    }

    /// Closes all frames of a message that are still to be sent again.
    fn drop_frames(&mut self, at: u32, now: SimTime) {
        let message = &mut self.messages[at];
        message.open = 0;
        let (first, begun) = (message.first_frame, u64::from(message.begun));
        if self.current == Some(at) {
            self.current = None;
        }
        for number in first.max(self.base)..(first + begun).max(self.base) {
            let index = (number - self.base) as usize;
            if let Some(frame) = self.frames.get_mut(index)
                && frame.message == at
            {
                frame.closed.get_or_insert(now);
            }
        }
    }

    /// Ends a message: lost at `at`, and not waited for any more after `known`.
    fn lose(
        &mut self,
        look: &mut Look<'_, '_>,
        reason: &'static str,
        at: SimTime,
        known: SimTime,
        carriage: Carriage,
    ) {
        look.verdicts.lose_as(at.since(look.now), reason, carriage);
        let message = self.messages[look.at];
        if !message.told {
            // What of it arrived was received in vain.
            look.verdicts.charge_receiver(message.receive_j);
        }
        if self.current == Some(look.at) {
            self.current = None;
        }
        if message.begun == 0 {
            self.leave_line(look.at);
            self.messages[look.at].gone = true;
            return;
        }
        if let Some(place) = message.place {
            self.settle(place, known, true, look);
        }
        self.messages.free(look.at);
    }

    fn leave_line(&mut self, at: u32) {
        self.waiting -= 1;
        self.waiting_bytes -= self.messages[at].waiting_bytes;
    }
}
