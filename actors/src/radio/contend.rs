//! A frame's way through its station's line and its channel: wait, contend, be on the air, arrive
//! or try again.

use farside::carrier::{Carriage, Parcel, Verdicts};
use farside::{SimDuration, SimTime};

use super::channel::Transmission;
use super::{Access, BACKOFF, COLLISION, Frame, Hop, Phase, QUEUE_FULL, Radio};

impl<H: Hop> Radio<H> {
    /// Takes a message into its station's line.
    pub(super) fn accept(&mut self, parcel: &Parcel<'_>, directed: u32, verdicts: &mut Verdicts) {
        let from = self.directed[directed as usize].from;
        let line = &self.places[from as usize].line;
        if line.len() >= self.config.queue as usize {
            return verdicts.lose(QUEUE_FULL);
        }
        let frame = Frame {
            directed,
            from,
            ..Frame::default()
        };
        let at = match self.free.pop() {
            Some(at) => {
                self.frames[at as usize] = frame;
                at
            }
            None => {
                self.frames.push(frame);
                self.frames.len() as u32 - 1
            }
        };
        self.places[from as usize].line.push_back(at);
        self.resume(parcel, at, verdicts);
    }

    /// Looks at a frame again.
    pub(super) fn resume(&mut self, parcel: &Parcel<'_>, at: u32, verdicts: &mut Verdicts) {
        let frame = self.frames[at as usize];
        match frame.phase {
            Phase::InLine => {
                let line = &self.places[frame.from as usize].line;
                let place = line.iter().position(|known| *known == at).unwrap_or(0);
                if place == 0 {
                    self.frames[at as usize].phase = Phase::Contending;
                    self.contend(parcel, at, verdicts);
                } else {
                    // Nothing changes for this one before something happens to the one ahead.
                    let ahead = self.frames[line[place - 1] as usize].next;
                    self.hold_until(parcel.now(), ahead, at, verdicts);
                }
            }
            Phase::Contending => self.contend(parcel, at, verdicts),
            Phase::OnAir => self.leave_air(parcel, at, verdicts),
        }
    }

    fn hold_until(&mut self, now: SimTime, next: SimTime, at: u32, verdicts: &mut Verdicts) {
        self.frames[at as usize].next = next;
        verdicts.hold(next.since(now), u64::from(at));
    }

    /// Transmits if the channel may be used, or waits for it.
    fn contend(&mut self, parcel: &Parcel<'_>, at: u32, verdicts: &mut Verdicts) {
        let now = parcel.now();
        match self.wait_for(parcel, at, now) {
            Some(next) => self.hold_until(now, next, at, verdicts),
            None => self.transmit(parcel, at, verdicts),
        }
    }

    /// Until when a frame must wait before it may ask again, if it must.
    fn wait_for(&mut self, parcel: &Parcel<'_>, at: u32, now: SimTime) -> Option<SimTime> {
        let frame = self.frames[at as usize];
        let channel = &self.channels[self.directed[frame.directed as usize].channel as usize];
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
        let draw = parcel.random(BACKOFF, frame.waits, parcel.copy());
        frame.waits += 1;
        self.config.slot * draw.stream().below(window)
    }

    fn transmit(&mut self, parcel: &Parcel<'_>, at: u32, verdicts: &mut Verdicts) {
        let now = parcel.now();
        let directed = self.frames[at as usize].directed;
        let link = &mut self.directed[directed as usize];
        let airtime = link.hop.airtime(parcel, now);
        let energy_j = link.hop.energy_j(airtime, now);
        let (from, to, channel) = (link.from, link.to, link.channel as usize);
        let new = Transmission {
            frame: at,
            from,
            to,
            start: now,
            end: now + airtime,
            spoiled: false,
        };
        // Taken out, so that the rest of the radio can be asked meanwhile.
        let mut air = std::mem::take(&mut self.channels[channel]);
        air.begin(new, |victim, other| self.spoils(victim, other, now));
        self.channels[channel] = air;
        let frame = &mut self.frames[at as usize];
        frame.phase = Phase::OnAir;
        frame.start = now;
        frame.first_start.get_or_insert(now);
        frame.attempts += 1;
        frame.energy_j += energy_j;
        verdicts.charge(energy_j);
        self.hold_until(now, new.end, at, verdicts);
    }

    /// A transmission has ended: it got through, is tried again, or is lost.
    fn leave_air(&mut self, parcel: &Parcel<'_>, at: u32, verdicts: &mut Verdicts) {
        let now = parcel.now();
        let frame = self.frames[at as usize];
        let channel = self.directed[frame.directed as usize].channel as usize;
        let spoiled = self.channels[channel].end(at);
        let attempt = frame.attempts - 1;
        let mut way = self.way(parcel, frame.directed, now);
        way.blocked = self.fades(parcel, attempt, &way);
        let hop = &mut self.directed[frame.directed as usize].hop;
        let through = match spoiled {
            true => Err(COLLISION),
            false => hop.attempt(parcel, attempt, (frame.start, now), &way),
        };
        let mut carriage = Carriage {
            queue: frame
                .first_start
                .map_or(SimDuration::ZERO, |start| start.since(parcel.sent())),
            retries: frame
                .first_start
                .map_or(SimDuration::ZERO, |start| frame.start.since(start)),
            serialization: now.since(frame.start),
            attempts: frame.attempts,
            energy_j: frame.energy_j,
            ..Carriage::default()
        };
        match through {
            Ok((propagation, jitter_ns)) => {
                carriage.propagation = propagation;
                carriage.jitter_ns = jitter_ns;
                let way = Carriage {
                    propagation,
                    jitter_ns,
                    ..Carriage::default()
                };
                verdicts.deliver_as(way.total(), carriage);
            }
            Err(reason) => {
                let (retries, timeout) = hop.retries(parcel, now);
                if frame.attempts <= retries {
                    self.frames[at as usize].phase = Phase::Contending;
                    let next = now + timeout + self.retry_wait(parcel, at);
                    return self.hold_until(now, next, at, verdicts);
                }
                verdicts.lose_as(SimDuration::ZERO, reason, carriage);
            }
        }
        self.places[frame.from as usize].line.pop_front();
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
