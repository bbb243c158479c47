//! A frame's way through its link's line and its channel: wait, contend, be on the air, arrive
//! or try again.

use farside::carrier::{Carriage, Parcel, Verdicts};
use farside::{SimDuration, SimTime};

use super::channel::Transmission;
use super::{Access, BACKOFF, COLLISION, Frame, Phase, Radio};
use crate::link::{Attempt, EXPIRED, QUEUE_FULL, difference};

/// How often a frame looks whether it is its turn, before it waits to be woken instead. Fewer would
/// do; what a frame looks at is part of a run's digest, and built-in runs have lines in which one
/// looks a hundred times.
const MAX_LOOKS: u32 = 255;

impl Radio {
    /// Takes the copies of a message into its link's line.
    pub(super) fn accept(&mut self, parcel: &Parcel<'_>, directed: u32, verdicts: &mut Verdicts) {
        let now = parcel.now();
        let path = self.path(parcel, directed, now);
        let transmitter = &self.directed[directed as usize].transmitter;
        let bytes = transmitter.bytes(parcel);
        let airtime = transmitter.airtime(parcel, now, &path);
        for copy in 0..transmitter.copies(parcel) {
            if self.is_full(directed, bytes, now) {
                verdicts.lose(QUEUE_FULL);
                continue;
            }
            let at = self.frame(Frame {
                directed,
                from: self.directed[directed as usize].from,
                copy,
                bytes,
                airtime,
                offset: self.directed[directed as usize].airtime,
                ..Frame::default()
            });
            let link = &mut self.directed[directed as usize];
            link.airtime = link.airtime + airtime;
            link.line.push_back(at);
            link.line_bytes += bytes;
            self.resume(parcel, at, verdicts);
        }
    }

    /// Whether there is no room for so many bytes behind those that wait: by the link's own
    /// `queue`, or if it has none, by the radio's.
    fn is_full(&self, directed: u32, bytes: u64, now: SimTime) -> bool {
        let link = &self.directed[directed as usize];
        if link.line.is_empty() {
            return false;
        }
        // Only the first can be on the air.
        let first = &self.frames[link.line[0] as usize];
        let on_air = usize::from(first.phase == Phase::OnAir);
        let messages = (link.line.len() - on_air) as u64 + 1;
        match link.transmitter.timeline().at(now).queue {
            None => messages > u64::from(self.config.queue),
            Some(limit) => {
                let sent = if on_air > 0 { first.bytes } else { 0 };
                !limit.allows(messages, link.line_bytes - sent + bytes)
            }
        }
    }

    /// Keeps a frame; returns where.
    fn frame(&mut self, frame: Frame) -> u32 {
        match self.free.pop() {
            Some(at) => {
                self.frames[at as usize] = frame;
                at
            }
            None => {
                self.frames.push(frame);
                self.frames.len() as u32 - 1
            }
        }
    }

    /// Looks at a frame again.
    pub(super) fn resume(&mut self, parcel: &Parcel<'_>, at: u32, verdicts: &mut Verdicts) {
        #[cfg(test)]
        super::LOOKS.with(|looks| looks.set(looks.get() + 1));
        let frame = self.frames[at as usize];
        match frame.phase {
            Phase::InLine => {
                let first = self.directed[frame.directed as usize].line[0];
                if first == at {
                    self.frames[at as usize].phase = Phase::Contending;
                    self.contend(parcel, at, verdicts);
                } else if let Some(next) = self.turn_of(at, first, parcel.now()) {
                    self.frames[at as usize].looks += 1;
                    self.hold_until(parcel.now(), next, at, verdicts);
                } else {
                    verdicts.park(None, u64::from(at));
                }
            }
            Phase::Contending => self.contend(parcel, at, verdicts),
            Phase::OnAir => self.leave_air(parcel, at, verdicts),
        }
    }

    /// The soonest that a frame can have its turn behind the `first` of its line: when all ahead of
    /// it have been on the air, or airtimes change. Nothing where that tells too little, because
    /// contacts or a trace decide, or told too little often enough: who is first wakes the next.
    fn turn_of(&self, at: u32, first: u32, now: SimTime) -> Option<SimTime> {
        let (frame, first) = (&self.frames[at as usize], &self.frames[first as usize]);
        let ahead = match first.phase {
            // It is off the air at `next`.
            Phase::OnAir => frame.offset - first.offset - first.airtime,
            _ => frame.offset - first.offset,
        };
        let transmitter = &self.directed[frame.directed as usize].transmitter;
        let steady_until = transmitter.steady_until(now);
        if steady_until <= now || frame.looks >= MAX_LOOKS {
            return None;
        }
        Some((first.next + ahead).min(steady_until.max(first.next)))
    }

    fn hold_until(&mut self, now: SimTime, next: SimTime, at: u32, verdicts: &mut Verdicts) {
        self.frames[at as usize].next = next;
        verdicts.hold(next.since(now), u64::from(at));
    }

    /// Transmits if the link is open and the channel free, or waits for that.
    fn contend(&mut self, parcel: &Parcel<'_>, at: u32, verdicts: &mut Verdicts) {
        let now = parcel.now();
        let directed = self.frames[at as usize].directed;
        let path = self.path(parcel, directed, now);
        let link = &self.directed[directed as usize];
        let expires = link.transmitter.expires(parcel);
        let opening = match expires.filter(|at| *at <= now) {
            Some(_) => Err(EXPIRED),
            None => link.transmitter.opening(parcel, now, &path),
        };
        let free = link.free;
        let next = match opening {
            Ok(_) if free > now => Some(free),
            Err(reason) if reason == EXPIRED || free <= now => {
                let carriage = self.carriage(parcel, at, now);
                verdicts.lose_as(SimDuration::ZERO, reason, carriage);
                return self.done(at, verdicts);
            }
            Err(_) => Some(free),
            Ok(open) if open > now => Some(open),
            Ok(_) => self.wait_for(parcel, at, now),
        };
        match next {
            Some(next) => {
                let next = expires.map_or(next, |expires| next.min(expires));
                self.hold_until(now, next, at, verdicts);
            }
            None => self.transmit(parcel, at, verdicts),
        }
    }

    /// Until when a frame must wait before it may ask again, if it must.
    fn wait_for(&mut self, parcel: &Parcel<'_>, at: u32, now: SimTime) -> Option<SimTime> {
        let frame = self.frames[at as usize];
        let channel = &self.channels[self.directed[frame.directed as usize].channel as usize];
        // A station transmits one frame at a time.
        let own = channel.busy_until(now, |other| other.from == frame.from);
        match self.config.access {
            Access::FullDuplex => None,
            Access::Scheduled => {
                let busy = channel.busy_until(now, |_| true);
                let turned = channel
                    .last_use()
                    .filter(|(_, station)| *station != frame.from)
                    .map(|(end, _)| end + self.config.turnaround)
                    .filter(|free| *free > now);
                busy.or(turned)
            }
            Access::Aloha if own.is_some() => own,
            Access::Aloha if self.config.slotted => {
                let over = now.as_nanos() % self.config.slot.as_nanos();
                (over != 0).then(|| now + (self.config.slot - SimDuration::from_nanos(over)))
            }
            Access::Aloha => None,
            Access::Csma => {
                let busy = channel.busy_until(now, |other| self.hears(frame.from, other, now))?;
                Some(busy + self.back_off(parcel, at))
            }
        }
    }

    /// A random wait: a number of slots below the window, which doubles with each failure.
    fn back_off(&mut self, parcel: &Parcel<'_>, at: u32) -> SimDuration {
        let frame = &mut self.frames[at as usize];
        let doubled = u64::from(self.config.window) << frame.attempts.min(32);
        let window = doubled.min(u64::from(self.config.window_max));
        let draw = parcel.random(BACKOFF, frame.waits, frame.copy);
        frame.waits += 1;
        self.config.slot * draw.stream().below(window)
    }

    fn transmit(&mut self, parcel: &Parcel<'_>, at: u32, verdicts: &mut Verdicts) {
        let now = parcel.now();
        let frame = self.frames[at as usize];
        let path = self.path(parcel, frame.directed, now);
        let link = &mut self.directed[frame.directed as usize];
        let number = (frame.attempts, frame.copy);
        let attempt = link.transmitter.attempt(parcel, number, now, &path);
        let new = Transmission {
            frame: at,
            from: link.from,
            to: link.to,
            start: now,
            end: attempt.end,
            spoiled: false,
        };
        let channel = link.channel as usize;
        // Taken out, so that the rest of the radio can be asked meanwhile.
        let mut air = std::mem::take(&mut self.channels[channel]);
        air.begin(new, |victim, other| self.spoils(victim, other, now));
        self.channels[channel] = air;
        let frame = &mut self.frames[at as usize];
        frame.phase = Phase::OnAir;
        frame.start = now;
        frame.first_start.get_or_insert(now);
        frame.attempts += 1;
        frame.energy_j += attempt.energy_j;
        frame.attempt = Some(attempt);
        verdicts.charge(attempt.energy_j);
        self.hold_until(now, attempt.end, at, verdicts);
    }

    /// A transmission has ended: it got through, is tried again, or is lost.
    fn leave_air(&mut self, parcel: &Parcel<'_>, at: u32, verdicts: &mut Verdicts) {
        let now = parcel.now();
        let frame = self.frames[at as usize];
        let link = &mut self.directed[frame.directed as usize];
        let spoiled = self.channels[link.channel as usize].end(at);
        let Some(attempt) = frame.attempt else {
            unreachable!("a frame on the air is an attempt");
        };
        let failed = if spoiled {
            Some(COLLISION)
        } else {
            attempt.failed
        };
        let Some(reason) = failed else {
            let arrival = link.transmitter.in_order(parcel, attempt.at);
            if link.transmitter.timeline().at(frame.start).retries > 0 {
                // It stops and waits, as it would if there were no answer.
                link.free = attempt.answered();
            }
            self.arrive(parcel, at, &attempt, arrival, verdicts);
            return self.done(at, verdicts);
        };
        let params = link.transmitter.timeline().at(frame.start);
        if frame.attempts <= params.retries {
            let timeout = frame.start + params.timeout.unwrap_or_default();
            let given_up = timeout.max(attempt.answered());
            self.frames[at as usize].phase = Phase::Contending;
            let next = given_up + self.retry_wait(parcel, at);
            return self.hold_until(now, next, at, verdicts);
        }
        let carriage = self.carriage(parcel, at, now);
        // What is corrupt is noticed where it arrives; a collision, where it happens.
        let after = if spoiled {
            SimDuration::ZERO
        } else {
            attempt.at.since(now)
        };
        verdicts.lose_as(after, reason, carriage);
        self.done(at, verdicts);
    }

    /// What the frame's delay is made of so far.
    fn carriage(&self, parcel: &Parcel<'_>, at: u32, now: SimTime) -> Carriage {
        let frame = &self.frames[at as usize];
        let on_air = |since: SimTime| {
            let end = frame.attempt.map_or(now, |attempt| attempt.end);
            end.since(since)
        };
        match frame.first_start {
            None => Carriage {
                queue: now.since(parcel.sent()),
                ..Carriage::default()
            },
            Some(first) => Carriage {
                queue: first.since(parcel.sent()),
                retries: frame.start.since(first),
                serialization: on_air(frame.start),
                attempts: frame.attempts,
                energy_j: frame.energy_j,
                ..Carriage::default()
            },
        }
    }

    fn arrive(
        &self,
        parcel: &Parcel<'_>,
        at: u32,
        attempt: &Attempt,
        arrival: SimTime,
        verdicts: &mut Verdicts,
    ) {
        let now = parcel.now();
        let link = &self.directed[self.frames[at as usize].directed as usize];
        // Only a change that nobody declared can be faster than what the run counts on.
        let way = arrival.since(now).max(link.transmitter.min_delay());
        let mut carriage = self.carriage(parcel, at, now);
        carriage.propagation = attempt.propagation;
        carriage.receive_j = attempt.receive_j;
        carriage.jitter_ns = difference(way, attempt.propagation);
        verdicts.deliver_as(way, carriage);
    }

    /// Forgets a frame that came first in its line, and wakes the next if it is parked.
    fn done(&mut self, at: u32, verdicts: &mut Verdicts) {
        let directed = self.frames[at as usize].directed;
        let link = &mut self.directed[directed as usize];
        let first = link.line.pop_front();
        link.line_bytes -= self.frames[at as usize].bytes;
        debug_assert_eq!(first, Some(at), "only the first of a line is sent");
        if let Some(next) = link.line.front() {
            verdicts.wake(SimDuration::ZERO, u64::from(*next));
        }
        self.free.push(at);
    }

    /// How much longer than the timeout a station waits before it tries again: where transmissions
    /// meet by chance, the same two must not meet again.
    fn retry_wait(&mut self, parcel: &Parcel<'_>, at: u32) -> SimDuration {
        match self.config.access {
            Access::FullDuplex | Access::Scheduled => SimDuration::ZERO,
            Access::Aloha | Access::Csma => self.back_off(parcel, at),
        }
    }
}
