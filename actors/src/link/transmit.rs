//! The core of a link: one transmitter, one way, and what becomes of what it sends.
//!
//! A [`Transmitter`] knows a [`Timeline`] of parameters and what it was asked to send so far. Ask
//! it for a whole message ([`Transmitter::send`]: queue, attempts, answers) or, where something
//! else decides when the channel is free, for one transmission at a time
//! ([`Transmitter::attempt`]).

mod outcome;

use std::sync::Arc;

use farside::carrier::{Carriage, Parcel};
use farside::random::name_hash;
use farside::{SimDuration, SimTime};

use super::burst::KnownState;
use super::queue::{Backlog, WaitsFor};
use super::stage::{self, Draws, Piece, Purpose};
use super::timeline::Timeline;
use super::trace::{self, Opportunity, Trace};
use super::{
    BURST, CORRUPT, EXPIRED, LOSS, LinkChange, LinkParams, QUEUE_FULL, jitter, packet_error_rate,
};

pub(crate) use outcome::difference;
pub use outcome::{Attempt, Path, Sent};

/// The sending end of a link: a [`Timeline`] of parameters, and what it was asked to send so far.
///
/// Ask it for a whole message ([`Transmitter::send`]: queue, attempts, answers) or, where something
/// else decides when the channel is free and who collides, for one transmission at a time
/// ([`Transmitter::opening`], [`Transmitter::attempt`], [`Transmitter::in_order`]). What the
/// geometry adds comes in a [`Path`].
///
/// ```
/// use std::collections::BTreeMap;
/// use farside::carrier::{Carrier, NoChange, Parcel, Verdicts};
/// use farside::{SimDuration, SimTime};
/// use farside_actors::link::{LinkParams, Path, Transmitter};
///
/// /// One channel for both directions: while one side sends, the other waits.
/// struct HalfDuplex {
///     sides: BTreeMap<String, Transmitter>,
///     free: SimTime,
///     distance_m: f64,
/// }
///
/// impl Carrier for HalfDuplex {
///     type Change = NoChange;
///
///     fn min_delay(&self) -> SimDuration {
///         self.sides.values().map(Transmitter::min_delay).min().unwrap_or_default()
///     }
///
///     fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
///         let propagation = SimDuration::from_secs_f64(self.distance_m / 299_792_458.0);
///         let path = Path { propagation, ..Path::default() };
///         let Some(side) = self.sides.get_mut(parcel.sender_host()) else {
///             return verdicts.lose("range");
///         };
///         for copy in 0..side.copies(parcel) {
///             let sent = side.send(parcel, copy, self.free, &path);
///             self.free = side.free_at();
///             sent.tell(parcel.now(), verdicts);
///         }
///     }
///
///     fn change(&mut self, _change: NoChange, _now: SimTime) {}
/// }
///
/// let radio: LinkParams = toml::from_str("rate = '128kbit/s'\nlatency = '1ms'")?;
/// let side = |name: &str| (name.to_owned(), Transmitter::new(radio.clone()));
/// let sides = ["base", "rover"].map(side).into();
/// let channel = HalfDuplex { sides, free: SimTime::ZERO, distance_m: 3e5 };
/// assert_eq!(channel.min_delay(), SimDuration::from_millis(1));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Transmitter {
    timeline: Arc<Timeline>,
    /// Tells its slots' draws from those of others behind one shared link.
    lane: Option<u64>,
    /// The least delay that was declared.
    floor: SimDuration,
    /// When the last message it took is done with.
    free: SimTime,
    waiting: Backlog,
    /// The last state of the correlated jitter.
    deviate: Option<f64>,
    /// The latest arrival so far.
    arrived: SimTime,
    /// Where the walk through the burst chain may stop, and for which span that holds.
    known: Option<(usize, KnownState)>,
    /// What is left of the last opportunity of a trace, and in which span.
    opportunity: Option<(usize, Opportunity)>,
}

impl Transmitter {
    /// A transmitter that has sent nothing yet.
    pub fn new(timeline: impl Into<Arc<Timeline>>) -> Self {
        let timeline = timeline.into();
        Transmitter {
            lane: None,
            floor: timeline.min_delay(),
            timeline,
            free: SimTime::ZERO,
            waiting: Backlog::default(),
            deviate: None,
            arrived: SimTime::ZERO,
            known: None,
            opportunity: None,
        }
    }

    /// A transmitter of the link called `name`, one of several behind a shared link that contends
    /// for the air before each transmission. It delivers no sooner than the way takes.
    pub fn behind_shared(name: &str, timeline: impl Into<Arc<Timeline>>) -> Self {
        let mut transmitter = Transmitter::new(timeline).in_lane(name);
        transmitter.floor = transmitter.timeline.least_way();
        transmitter
    }

    /// The parameters it has and will have.
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// The least delay of anything it delivers.
    pub fn min_delay(&self) -> SimDuration {
        self.floor
    }

    /// Declares a smaller least delay: parameters may come that the timeline does not know.
    pub fn allow_delay(&mut self, least: SimDuration) {
        self.floor = self.floor.min(least);
    }

    /// The same for the link called `name`, one of several behind a shared link: what it draws by
    /// time is its own.
    #[must_use]
    pub fn in_lane(mut self, name: &str) -> Self {
        self.lane = Some(name_hash(name));
        self
    }

    /// Takes a change, unless the timeline has it already.
    pub fn change(&mut self, change: &LinkChange, now: SimTime) {
        // Only who writes changes by hand can write one that is none.
        if let (false, Ok(over)) = (change.is_planned(), change.overrides()) {
            self.replace_from(now, &over);
        }
    }

    /// Replaces some parameters from `from` on. The least delay stays as declared.
    pub fn replace_from(&mut self, from: SimTime, over: &super::LinkOverrides) {
        Arc::make_mut(&mut self.timeline).replace_from(from, over);
        // Spans have other numbers now, and other chains.
        self.known = None;
        self.opportunity = None;
    }

    /// It transmits something until then.
    pub(super) fn busy_until(&mut self, end: SimTime) {
        self.free = self.free.max(end);
    }

    /// When it has sent all it was given.
    pub fn free_at(&self) -> SimTime {
        self.free
    }

    /// The bytes of the message with the link's overhead.
    pub fn bytes(&self, parcel: &Parcel<'_>) -> u64 {
        Piece::Whole.bytes(self.timeline.at(parcel.now()), parcel)
    }

    /// Until when messages of one size have one airtime, as far as is known at `now`: `now` itself
    /// where contacts, a trace or an outage decide.
    pub fn steady_until(&self, now: SimTime) -> SimTime {
        let index = self.timeline.index(now);
        let params = &self.timeline.spans[index].params;
        if params.contacts.is_some() || params.trace.is_some() || params.outage {
            return now;
        }
        self.timeline.end_of(index).unwrap_or(SimTime::MAX)
    }

    /// How many copies of the message set out, by the parameters of its arrival at the link: one
    /// where it is lost at once.
    pub fn copies(&self, parcel: &Parcel<'_>) -> u32 {
        let params = self.timeline.at(parcel.now());
        match params.outage && !params.store_and_forward {
            true => 1,
            false => stage::copies(params, parcel),
        }
    }

    /// How long the message is on the air if it begins at `start`.
    pub fn airtime(&self, parcel: &Parcel<'_>, start: SimTime, path: &Path) -> SimDuration {
        self.air(parcel, Piece::Whole, start, path).0
    }

    fn air(
        &self,
        parcel: &Parcel<'_>,
        piece: Piece,
        start: SimTime,
        path: &Path,
    ) -> (SimDuration, Option<Opportunity>) {
        let index = self.timeline.index(start);
        let params = &self.timeline.spans[index].params;
        let own = self.timeline.window(start).and_then(|window| window.rate);
        let trace = params.trace.as_ref().and_then(Trace::capacity);
        if let (None, Some(trace)) = (own, trace) {
            let used = self.opportunity.filter(|(span, _)| *span == index);
            let bytes = piece.bytes(params, parcel);
            let used = used.map(|(_, used)| used);
            let (end, rest) = trace::delivered(trace, (parcel.sent(), start), bytes, used);
            return (end.since(start), Some(rest));
        }
        let link = own.or(params.rate);
        let airtime = match link.into_iter().chain(path.rate).min() {
            Some(rate) => super::transmission_time(piece.bytes(params, parcel), rate),
            None => SimDuration::ZERO,
        };
        (airtime, None)
    }

    /// When the message is dropped if its transmission has not begun.
    pub(crate) fn expires(&self, parcel: &Parcel<'_>) -> Option<SimTime> {
        let lifetime = self.timeline.at(parcel.now()).lifetime;
        lifetime.map(|lifetime| parcel.sent() + lifetime)
    }

    /// Sends one copy of a message, no sooner than `from`, behind those it sends already.
    pub fn send(&mut self, parcel: &Parcel<'_>, copy: u32, from: SimTime, path: &Path) -> Sent {
        let now = parcel.now();
        let deviate = self.step_jitter(parcel, Draws::first(copy));
        let ready = now.max(from).max(self.free);
        let start = self.opening(parcel, ready, path);
        let first = start.unwrap_or(ready);
        let expires = self.expires(parcel).filter(|at| *at <= first);
        let waits = match expires {
            Some(at) => (WaitsFor::Expiry, at.max(now)),
            None => (WaitsFor::Transmission, first),
        };
        if let Some(refused) = self.enqueue(parcel, waits) {
            return refused;
        }
        let carriage = Carriage {
            queue: waits.1.since(parcel.sent()),
            ..Carriage::default()
        };
        if waits.0 == WaitsFor::Expiry {
            return Sent {
                at: waits.1,
                lost: Some(EXPIRED),
                carriage,
            };
        }
        match start {
            Ok(_) => self.attempts(parcel, copy, first, path, deviate, carriage),
            Err(reason) => {
                self.free = first;
                Sent {
                    at: first,
                    lost: Some(reason),
                    carriage,
                }
            }
        }
    }

    /// Transmits until it gets through or there are no retries left.
    fn attempts(
        &mut self,
        parcel: &Parcel<'_>,
        copy: u32,
        first: SimTime,
        path: &Path,
        deviate: Option<f64>,
        mut carriage: Carriage,
    ) -> Sent {
        let retries = self.timeline.at(first).retries;
        let mut start = first;
        let mut number = 0;
        loop {
            let draws = Draws {
                attempt: number,
                ..Draws::first(copy)
            };
            let mut attempt = self.transmit(parcel, draws, Piece::Whole, start, path, deviate);
            carriage.attempts += u32::from(attempt.sent);
            carriage.energy_j += attempt.energy_j;
            let timeout = self.timeline.at(start).timeout.unwrap_or_default();
            let gives_up = (start + timeout).max(attempt.answered());
            if attempt.failed.is_some()
                && number < retries
                && let Ok(next) = self.opening(parcel, gives_up, path)
            {
                let expires = self.expires(parcel).filter(|at| *at <= next);
                let Some(expires) = expires else {
                    number += 1;
                    start = next;
                    continue;
                };
                attempt.failed = Some(EXPIRED);
                attempt.at = attempt.at.max(expires);
            }
            self.free = match (retries, attempt.failed) {
                (0, _) => attempt.end,
                (_, None) => attempt.answered(),
                (_, Some(_)) => gives_up,
            };
            if attempt.failed.is_none() {
                attempt.at = self.in_order(parcel, attempt.at);
            }
            return Sent {
                at: attempt.at,
                lost: attempt.failed,
                carriage: Carriage {
                    queue: carriage.queue,
                    retries: start.since(first),
                    attempts: carriage.attempts,
                    energy_j: carriage.energy_j,
                    ..attempt.parts()
                },
            };
        }
    }

    /// One transmission of one copy that begins at `start`, whatever else the transmitter does: for
    /// a shared medium, which knows when the channel is free and who collides. Attempts have draws
    /// of their own; an own queue, answers and retries are up to the caller, and so is
    /// [`Transmitter::in_order`].
    pub fn attempt(
        &mut self,
        parcel: &Parcel<'_>,
        (attempt, copy): (u32, u32),
        start: SimTime,
        path: &Path,
    ) -> Attempt {
        let draws = Draws {
            attempt,
            ..Draws::first(copy)
        };
        self.attempt_piece(parcel, draws, Piece::Whole, start, path)
    }

    /// The same for a piece of a message.
    pub(super) fn attempt_piece(
        &mut self,
        parcel: &Parcel<'_>,
        draws: Draws,
        piece: Piece,
        start: SimTime,
        path: &Path,
    ) -> Attempt {
        let deviate = match draws.attempt {
            0 => self.step_jitter(parcel, draws),
            _ => self.deviate,
        };
        self.transmit(parcel, draws, piece, start, path, deviate)
    }

    fn transmit(
        &mut self,
        parcel: &Parcel<'_>,
        draws: Draws,
        piece: Piece,
        start: SimTime,
        path: &Path,
        deviate: Option<f64>,
    ) -> Attempt {
        let index = self.timeline.index(start);
        let timeline = self.timeline.clone();
        let span = &timeline.spans[index];
        let params = &span.params;
        let light = timeline.window(start).and_then(|window| window.owlt);
        let latency = light.unwrap_or(params.latency);
        let propagation = latency + path.propagation;
        let mut attempt = Attempt {
            start,
            end: start,
            at: start,
            propagation: SimDuration::ZERO,
            failed: None,
            sent: false,
            energy_j: 0.0,
            receive_j: 0.0,
            answer: propagation,
        };
        if let Some(closed) = timeline.closed(start) {
            attempt.failed = Some(closed.reason);
            return attempt;
        }
        let (airtime, rest) = self.air(parcel, piece, start, path);
        self.opportunity = rest.map(|rest| (index, rest));
        let cut = timeline.cut(start, start + airtime);
        attempt.sent = true;
        attempt.end = cut.map_or(start + airtime, |(at, _)| at);
        attempt.at = attempt.end;
        attempt.energy_j = params.tx_power_w * attempt.end.since(start).as_secs_f64();
        attempt.failed = match cut {
            Some((_, reason)) => Some(reason),
            None => {
                let lost = self.lost_on_air(parcel, draws, index, start, path);
                lost.filter(|_| !parcel.is_spared(draws.copy))
            }
        };
        if attempt.failed.is_some() {
            return attempt;
        }
        let floor = match light {
            Some(light) => params.least_way(light),
            None => span.floor,
        };
        let way = way(params, latency, floor, parcel, draws, deviate) + path.propagation;
        attempt.propagation = propagation;
        // Only a change that nobody declared can be faster than what the run counts on.
        attempt.at = (attempt.end + way).max(parcel.now() + self.floor);
        if is_corrupt(params, parcel, draws, piece) && !parcel.is_spared(draws.copy) {
            attempt.failed = Some(CORRUPT);
        } else {
            attempt.receive_j = params.rx_power_w * airtime.as_secs_f64();
        }
        attempt
    }

    /// Why a transmission that was on the air to its end does not get through.
    fn lost_on_air(
        &mut self,
        parcel: &Parcel<'_>,
        draws: Draws,
        index: usize,
        start: SimTime,
        path: &Path,
    ) -> Option<&'static str> {
        let params = &self.timeline.spans[index].params;
        if draws.happens(parcel, Purpose::Loss, params.loss) {
            return Some(LOSS);
        }
        if let Some(burst) = &params.burst {
            let known = self.known.filter(|(span, _)| *span == index);
            let mut known = known.map(|(_, known)| known);
            let lane = self.lane;
            let slot = |slot| {
                let key = parcel.random_at(Purpose::BurstSlot as u64, slot);
                lane.map_or(key, |lane| key.number(lane)).uniform()
            };
            let loss = burst.chain().loss_at(start, &mut known, slot);
            self.known = known.map(|known| (index, known));
            if draws.happens(parcel, Purpose::Burst, loss) {
                return Some(BURST);
            }
        }
        draws
            .happens(parcel, Purpose::Path, path.loss)
            .then_some(path.reason)
    }

    /// An arrival, not before those of earlier messages if the link keeps their order.
    pub fn in_order(&mut self, parcel: &Parcel<'_>, at: SimTime) -> SimTime {
        let at = match self.timeline.at(parcel.now()).fifo {
            true => at.max(self.arrived),
            false => at,
        };
        self.arrived = self.arrived.max(at);
        at
    }

    /// The first instant from `ready` on at which the message can be transmitted as a whole; or at
    /// once, if it does not wait for that.
    ///
    /// # Errors
    /// With the reason, if no such instant comes.
    pub fn opening(
        &self,
        parcel: &Parcel<'_>,
        ready: SimTime,
        path: &Path,
    ) -> Result<SimTime, &'static str> {
        self.opening_for(parcel, Piece::Whole, ready, path)
    }

    /// The same for a piece of a message.
    pub(super) fn opening_for(
        &self,
        parcel: &Parcel<'_>,
        piece: Piece,
        ready: SimTime,
        path: &Path,
    ) -> Result<SimTime, &'static str> {
        let timeline = &self.timeline;
        let mut at = ready;
        let mut tries = 0;
        let mut looked = usize::MAX;
        loop {
            let index = timeline.index(at);
            if !timeline.spans[index].params.store_and_forward {
                return Ok(at);
            }
            tries = if index == looked { tries + 1 } else { 0 };
            looked = index;
            let (next, reason) = match timeline.closed(at) {
                Some(closed) => (closed.until, closed.reason),
                None => match timeline.cut(at, at + self.air(parcel, piece, at, path).0) {
                    None => return Ok(at),
                    Some((cut, reason)) => (Some(cut), reason),
                },
            };
            let next = match tries > timeline.patience(index) {
                true => timeline.end_of(index),
                false => next,
            };
            // Nothing later than the last instant, and nothing earlier than this one.
            at = next.filter(|next| *next > at).ok_or(reason)?;
        }
    }

    /// Puts a message into the queue until it has waited enough, or refuses it.
    fn enqueue(&mut self, parcel: &Parcel<'_>, waits: (WaitsFor, SimTime)) -> Option<Sent> {
        let now = parcel.now();
        let params = self.timeline.at(now);
        self.waiting.begin_until(now);
        if waits.1 <= now {
            return None;
        }
        let own = Piece::Whole.bytes(params, parcel);
        if !self.waiting.push(waits, own, params.queue) {
            let queue = now.since(parcel.sent());
            return Some(Sent {
                at: now,
                lost: Some(QUEUE_FULL),
                carriage: Carriage {
                    queue,
                    ..Carriage::default()
                },
            });
        }
        None
    }

    /// The next state of the correlated jitter: one step for each copy, whatever becomes of it, so
    /// that losses leave the jitter of other messages alone.
    fn step_jitter(&mut self, parcel: &Parcel<'_>, draws: Draws) -> Option<f64> {
        let correlation = self.timeline.at(parcel.now()).jitter_correlation;
        if correlation > 0.0 {
            let key = draws.key(parcel, Purpose::Jitter);
            let fresh = key.stream().normal(0.0, 1.0);
            self.deviate = Some(jitter::next_normal(self.deviate, correlation, fresh));
        }
        self.deviate
    }
}

/// How long a copy is on its way, without the path's own propagation.
fn way(
    params: &LinkParams,
    latency: SimDuration,
    floor: SimDuration,
    parcel: &Parcel<'_>,
    draws: Draws,
    deviate: Option<f64>,
) -> SimDuration {
    let way = match deviate {
        Some(z) if params.jitter_correlation > 0.0 => {
            let deviation = params.jitter_shape.of_normal(z);
            jitter::shifted(latency, params.jitter, deviation).max(floor)
        }
        _ => stage::way(params, latency, floor, parcel, draws),
    };
    match draws.happens(parcel, Purpose::Reorder, params.reorder) {
        true => way + params.reorder_by.unwrap_or(latency),
        false => way,
    }
}

/// Whether a copy arrives with wrong bits.
fn is_corrupt(params: &LinkParams, parcel: &Parcel<'_>, draws: Draws, piece: Piece) -> bool {
    let wrong = match params.ber {
        0.0 => 0.0,
        ber => packet_error_rate(ber, piece.bytes(params, parcel)),
    };
    draws.happens(parcel, Purpose::Corrupt, params.corrupt)
        || draws.happens(parcel, Purpose::BitErrors, wrong)
}
