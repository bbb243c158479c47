//! One step of a message that is followed: a piece of it is transmitted, and what comes of that.

use std::cmp::Reverse;

use farside::{SimDuration, SimTime};

use super::super::stage::Draws;
use super::super::transmit::{Attempt, Path, Transmitter};
use super::super::{DUPLICATE, LinkParams};
use super::ack::Answer;
use super::{Frame, Look, Pipeline, Place, Turn};

impl Pipeline {
    /// Transmits the next piece of the message in hand; false if the message is done with.
    pub(super) fn transmit(&mut self, tx: &mut Transmitter, look: &mut Look<'_, '_>) -> bool {
        let Some(turn) = self.next() else {
            return true;
        };
        let message = &self.messages[look.at];
        let (fragment, attempts) = match turn {
            Turn::Again(number) => {
                let frame = &self.frames[(number - self.base) as usize];
                (frame.fragment, frame.attempts)
            }
            Turn::New(_) => (message.begun, 0),
        };
        let piece = message.piece(fragment);
        let path = Path::default();
        match tx.opening_for(look.parcel, piece, look.now, &path) {
            Ok(open) if open > look.now => {
                self.messages[look.at].not_before = open;
                return true;
            }
            Ok(_) => {}
            Err(reason) => return !self.give_up(look, reason),
        }
        let draws = Draws {
            attempt: attempts,
            copy: message.copy,
            fragment,
        };
        let attempt = tx.attempt_piece(look.parcel, draws, piece, look.now, &path);
        tx.busy_until(attempt.end);
        self.messages[look.at].transmitted(&attempt);
        look.verdicts.charge(attempt.energy_j);
        if let Turn::New(at) = turn {
            self.begin(at, tx.timeline().at(look.now));
        }
        let retries = self.messages[look.at].retries;
        if retries == 0 {
            return self.sent_once(look, &attempt);
        }
        let last = attempts >= retries;
        let answer = self.acks.answer(tx, look.parcel, draws, &attempt);
        let number = match turn {
            Turn::Again(number) => {
                while self.urgent.pop_front().is_some_and(|first| first != number) {}
                number
            }
            Turn::New(at) => {
                self.frames.push_back(Frame {
                    message: at,
                    fragment,
                    attempts: 0,
                    arrived: false,
                    closed: None,
                });
                self.messages[at].open += 1;
                self.base + self.frames.len() as u64 - 1
            }
        };
        self.answered(look, number, &attempt, &answer, last)
    }

    /// Takes note that one more piece of a message is begun.
    fn begin(&mut self, at: u32, params: &LinkParams) {
        if self.messages[at].begun == 0 {
            self.leave_line(at);
            let first = self.line.pop_front();
            debug_assert_eq!(first, Some(at), "those that went are forgotten before");
            let place = self.order_base + self.order.len() as u64;
            let message = &mut self.messages[at];
            message.first_frame = self.base + self.frames.len() as u64;
            message.retries = params.retries;
            if params.fifo {
                message.place = Some(place);
                self.order.push_back(Place {
                    message: at,
                    ready: None,
                    lost: false,
                });
            }
        }
        let message = &mut self.messages[at];
        message.begun += 1;
        let more = message.begun < message.fragments;
        self.current = more.then_some(at);
    }

    /// What becomes of a message whose pieces nobody acknowledges.
    fn sent_once(&mut self, look: &mut Look<'_, '_>, attempt: &Attempt) -> bool {
        let message = &mut self.messages[look.at];
        match attempt.failed {
            None => message.arrived(attempt),
            Some(reason) => {
                message.failed.get_or_insert(reason);
            }
        }
        message.arrival = message.arrival.max(attempt.at);
        if message.begun < message.fragments {
            return true;
        }
        let Some(reason) = message.failed else {
            return self.complete(look);
        };
        // Before the last is there, nobody knows.
        let at = message.arrival;
        let carriage = message.carriage(at);
        self.lose(look, reason, at, at.max(attempt.at), carriage);
        false
    }

    /// What becomes of a message when one of its pieces was transmitted and perhaps acknowledged.
    fn answered(
        &mut self,
        look: &mut Look<'_, '_>,
        number: u64,
        attempt: &Attempt,
        answer: &Answer,
        last: bool,
    ) -> bool {
        let frame = self.frame(number);
        frame.attempts += 1;
        let is_new = attempt.failed.is_none() && !frame.arrived;
        frame.arrived |= is_new;
        let arrived = frame.arrived;
        frame.closed = match answer.at {
            Some(at) => Some(at),
            None => last.then_some(answer.given_up),
        };
        let closed = frame.closed.is_some();
        if !closed {
            self.due.push(Reverse((answer.given_up, number)));
        }
        let message = &mut self.messages[look.at];
        message.open -= u32::from(closed);
        message.energy_j += answer.energy_j;
        look.verdicts.charge(answer.energy_j);
        if attempt.failed.is_none() {
            let receive_j = attempt.receive_j + answer.receive_j;
            match message.told {
                true => look.verdicts.charge_receiver(receive_j),
                false => message.receive_j += receive_j,
            }
        }
        if is_new {
            message.arrived(attempt);
            message.arrival = message.arrival.max(attempt.at);
        }
        if closed && !arrived {
            let reason = attempt.failed.unwrap_or(DUPLICATE);
            self.drop_frames(look.at, look.now);
            let carriage = self.messages[look.at].carriage(attempt.at);
            // The receiver learns it as it would learn anything.
            let known = answer.given_up + answer.way;
            self.lose(look, reason, attempt.at, known, carriage);
            return false;
        }
        let message = &self.messages[look.at];
        if is_new && message.missing == 0 {
            return self.complete(look);
        }
        if message.told && message.open == 0 {
            let carriage = message.carriage(attempt.at);
            self.lose(look, DUPLICATE, attempt.at, attempt.at, carriage);
            return false;
        }
        true
    }

    /// All of the message in hand has arrived, or will have: it is let out, now or in its turn.
    /// False if it is done with.
    fn complete(&mut self, look: &mut Look<'_, '_>) -> bool {
        let message = &self.messages[look.at];
        let arrival = message.arrival;
        match message.place {
            None => {
                self.messages[look.at].let_out = Some(arrival);
                self.leaving.push_front(look.at);
            }
            Some(place) => self.settle(place, arrival, false, look),
        }
        !self.let_out_if_ready(look)
    }

    /// Nobody waits for the message at this place any more after `ready`: lets out all that can be.
    pub(super) fn settle(
        &mut self,
        place: u64,
        ready: SimTime,
        lost: bool,
        look: &mut Look<'_, '_>,
    ) {
        let Some(index) = place.checked_sub(self.order_base) else {
            return;
        };
        let Some(entry) = self.order.get_mut(index as usize) else {
            return;
        };
        (entry.ready, entry.lost) = (Some(ready), lost);
        while let Some(first) = self.order.front().copied()
            && let Some(ready) = first.ready
        {
            self.order.pop_front();
            self.order_base += 1;
            self.let_out = self.let_out.max(ready);
            if first.lost {
                continue;
            }
            self.messages[first.message].let_out = Some(self.let_out);
            self.messages[first.message].place = None;
            self.leaving.push_back(first.message);
            if first.message != look.at {
                look.verdicts
                    .wake(SimDuration::ZERO, u64::from(first.message));
            }
        }
    }

    /// Delivers the message in hand if it may be; true if it is done with.
    pub(super) fn let_out_if_ready(&mut self, look: &mut Look<'_, '_>) -> bool {
        let message = &mut self.messages[look.at];
        let Some(at) = message.let_out.filter(|_| !message.told) else {
            return false;
        };
        if self.leaving.front() != Some(&look.at) {
            // Those before it are looked at in this same instant.
            return false;
        }
        self.leaving.pop_front();
        // That nothing is waited for any more, the receiver learns as it would learn anything.
        let at = at.max(look.now + look.least);
        let mut carriage = message.carriage(at);
        carriage.receive_j = message.receive_j;
        look.verdicts.deliver_as(at.since(look.now), carriage);
        if message.open == 0 {
            self.messages.free(look.at);
            return true;
        }
        message.keep();
        false
    }
}
