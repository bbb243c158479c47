//! Links: when a message arrives, how often, or why it does not.
//!
//! A [`Link`] joins two hosts, one way. What it does with a message is decided by a [`Transmitter`]
//! from a [`Timeline`] of [`LinkParams`]; which link has which is the affair of [`LinksConfig`],
//! and when they change, of [`Degrade`]; both are what scenario files hold, and
//! [`LinkBuilder`](crate::wiring::LinkBuilder) turns them into links.
//!
//! # What happens to a message
//!
//! 1. It arrives at the link. By `duplicate` it is one copy or two, each on its own from here.
//! 2. It waits until those before it are done with, and, with `store_and_forward`, until the link
//!    can transmit it as a whole. If more than `queue` would wait, it is lost: `queue_full`. If it
//!    would wait for longer than its `lifetime`: `expired`.
//! 3. It is transmitted: `8 (L + overhead) / rate`, or at a `trace`'s opportunities. In an `outage`
//!    or without a contact it is lost before or cut short (`outage`, `no_contact`). With an `mtu`,
//!    a longer one goes in fragments, and all that is said here of a message from here on is true
//!    of each of them: it waits for a contact by itself, and is lost and repeated by itself. The
//!    message is there when all are, and lost when one is.
//! 4. It may be lost when its last bit has left, by `loss` or by a `burst`.
//! 5. It is on its way for the latency and the jitter, or held back by `reorder`. It may arrive
//!    `corrupt`.
//! 6. With `retries`, a sender that has no answer after `timeout` goes back to 3, with new luck.
//!
//! Without the keys of the next section, all this is decided when the message is sent, by what
//! holds at the instant of each step: a message that is sent now and transmitted in six minutes
//! meets the outage that begins in five.
//!
//! # Who waits for whom
//!
//! By default `retries` are stop and wait: those behind a message wait until it is answered or
//! given up. An answer takes the latency, no airtime, and is never lost. A link carries one message
//! each `T + 2 latency`, where T is what a transmission takes.
//!
//! With a `window` of W, W messages or fragments may be under way, counted from the first on that
//! is neither answered nor given up: selective repeat, which carries `min(1 / T, W / (T + 2
//! latency))` where nothing is lost. What is due again goes before what is new. `in_order`, which
//! is `fifo`, lets nothing out at the receiver before what was sent earlier.
//!
//! Where there is a `window`, an `ack` or an `mtu`, answers are messages of `ack` bytes over the
//! link back, by what that link is told (degradations included, changes of a fork not): its rate,
//! its loss, bursts and bit errors, its outages and contacts, its powers. They wait for each other
//! in the order of transmission, not for that link's messages, nor those for them, because the link
//! back is another host's. `ack_rate` and `ack_loss` replace its rate and all that loses. Whose
//! answer is lost sends again; the receiver drops what it has, so that a message arrives once. What
//! the sender keeps of it until then is a copy of its own in the log, and ends as lost with the
//! reason `duplicate`.
//!
//! Nobody's timer ends while the answer is on its way: a `timeout` only lengthens the wait.
//!
//! # The keys of `[links.default]`, `[links.PATTERN]` and `[[degrade]]`
//!
//! All but a latency of 5 ms is off by default. `"off"` turns off what is `off`, `none` or
//! `unlimited` in this table (not `preset`), false a bool, 0 what has 0 there; a `window` of 1 is
//! off. `queue = 0` is a queue of no messages. What each key is, the fields of [`LinkParams`] say,
//! and `farside explain links.default`.
//!
//! | key | alias | unit | default |
//! |---|---|---|---|
//! | `preset` | | [`Preset`] | none |
//! | `latency` | `delay` | duration | 5 ms |
//! | `jitter` | | duration | 0 |
//! | `jitter_shape` | `distribution` | [`JitterShape`] | `"uniform"` |
//! | `jitter_correlation` | | fraction | 0 |
//! | `min_delay` | | duration | where the jitter ends |
//! | `fifo` | `in_order` | bool | false |
//! | `loss` | | fraction | 0 |
//! | `burst` | `gemodel`, `loss_gemodel`, `loss_state` | [`Burst`] | off |
//! | `duplicate` | | fraction | 0 |
//! | `reorder` | | fraction | 0 |
//! | `reorder_by` | | duration | the latency |
//! | `corrupt` | | fraction | 0 |
//! | `ber` | | fraction | 0 |
//! | `rate` | | data rate | unlimited |
//! | `overhead` | | data size | 0 |
//! | `queue` | `limit` | messages or data size | unlimited |
//! | `trace` | | [`Trace`]: a file, a built-in name, milliseconds | off |
//! | `contacts` | | [`Contacts`] | the scenario's plan |
//! | `store_and_forward` | | bool | false |
//! | `lifetime` | | duration | unlimited |
//! | `mtu` | | data size | unlimited |
//! | `fragment_header` | | data size | 0 |
//! | `retries` | | number | 0 |
//! | `window` | | number | 1 |
//! | `ack` | | data size | 0 |
//! | `ack_rate` | | data rate | that of the link back |
//! | `ack_loss` | | fraction | that of the link back |
//! | `timeout` | | duration | what an answer takes, and never below |
//! | `radio` | | name of one of [`crate::radio`] | none |
//! | `tx_power` | | power | 0 |
//! | `rx_power` | | power | 0 |
//! | `outage` | | bool | false |
//!
//! Sources: tc-netem(8) for names and for what users expect of them, with these differences: its
//! `reorder` sends those at once and delays the others, which is the same gap without a least
//! delay; its `limit` counts the message that is being sent too; its recipe for correlated jitter
//! shrinks the variance. CCSDS 211.0-B (Proximity-1), whose COP-P is go-back-n with a window of up
//! to 127 and acknowledges by 16 bits in a frame, and RFC 5326 (LTP), for windows and answers; RFC
//! 791 for fragments. The pages of each type for the rest. Rates that change during a transmission
//! do not change it; outages and contacts cut it.
//!
//! # Randomness
//!
//! Every draw is addressed by the message's identity, so what happens to one message leaves the
//! next alone, and raising a loss rate loses the same messages and more. A burst's are addressed by
//! the slot of time. Of attempts each has its own.
//!
//! ```
//! use farside_actors::link::{Link, LinkParams};
//! use farside::{Carrier, SimDuration};
//!
//! let params = LinkParams {
//!     latency: SimDuration::from_millis(1300),
//!     jitter: SimDuration::from_millis(20),
//!     loss: 0.02,
//!     ..LinkParams::default()
//! };
//! assert_eq!(Link::new(params).min_delay(), SimDuration::from_millis(1280));
//! ```

mod burst;
mod change;
mod config;
mod contacts;
mod form;
mod idle;
mod jitter;
mod params;
mod pipeline;
mod preset;
mod queue;
mod redraw;
mod stage;
mod timeline;
mod trace;
mod transmit;

use std::sync::Arc;

use farside::carrier::{Carriage, Carrier, Parcel, Verdicts};
use farside::{SimDuration, SimTime};

use pipeline::Pipeline;
use stage::{Draws, Purpose};

pub use burst::Burst;
pub use change::LinkChange;
pub use config::{Degrade, Degraded, LinkConfigError, LinksConfig};
pub use contacts::{Contact, Contacts, Window};
pub(crate) use idle::remarks_of_links;
pub use jitter::JitterShape;
pub use params::{LinkOverrides, LinkParams};
pub use preset::Preset;
pub use queue::QueueLimit;
pub use redraw::{Drawn, Transmitted};
pub use stage::packet_error_rate;
pub use timeline::Timeline;
pub use trace::Trace;
pub(crate) use transmit::difference;
pub use transmit::{Attempt, Path, Sent, Transmitter};

/// Why a link loses a message by chance.
pub const LOSS: &str = "loss";
/// Why a link loses a message while its channel is bad.
pub const BURST: &str = "burst";
/// Why a link that is out loses every message.
pub const OUTAGE: &str = "outage";
/// Why a link loses a message outside its contacts.
pub const NO_CONTACT: &str = "no_contact";
/// Why a link loses a message when too many wait.
pub const QUEUE_FULL: &str = "queue_full";
/// Why a link drops a message that waited for longer than its lifetime.
pub const EXPIRED: &str = "expired";
/// Why a message is dropped that has arrived before: its acknowledgement was lost.
pub const DUPLICATE: &str = "duplicate";
/// Why a message is dropped where it arrives.
pub const CORRUPT: &str = "corrupt";

/// How long so many bytes are on the air: `8 bytes / rate`, rounded up to whole nanoseconds, so
/// that no link is faster than its rate.
///
/// ```
/// use farside_actors::link::transmission_time;
/// assert_eq!(transmission_time(1500, 12_000_000).as_nanos(), 1_000_000);
/// assert_eq!(transmission_time(1, 3).as_nanos(), 2_666_666_667);
/// ```
pub fn transmission_time(bytes: u64, rate_bit_per_s: u64) -> SimDuration {
    let bit_ns = u128::from(bytes) * 8 * 1_000_000_000;
    let nanos = bit_ns.div_ceil(u128::from(rate_bit_per_s.max(1)));
    SimDuration::from_nanos(u64::try_from(nanos).unwrap_or(u64::MAX))
}

/// A link of one host to another, one way, for nobody else. See the module's front page.
///
/// ```
/// use farside::prelude::*;
/// use farside_actors::link::{Link, LinkParams};
/// use serde::{Deserialize, Serialize};
///
/// #[derive(Serialize, Deserialize)]
/// struct Ping;
///
/// struct Sink;
/// impl Actor for Sink {
///     type Accepts = (Ping,);
/// }
/// impl Handler<Ping> for Sink {
///     fn handle(&mut self, _ping: Ping, _ctx: &mut Context<'_, Self>) -> Outcome {
///         Ok(())
///     }
/// }
///
/// struct Source(Address<Sink>);
/// impl Actor for Source {
///     type Accepts = ();
///     fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
///         for _ in 0..1000 {
///             ctx.send(self.0, Ping);
///         }
///         Ok(())
///     }
/// }
///
/// let mut sim = Simulation::new(1);
/// let (a, b) = (sim.host("a"), sim.host("b"));
/// let sink = sim.actor(b, "sink", |_| Sink);
/// sim.actor(a, "source", move |_| Source(sink));
/// sim.link(a, b, "a-b", Link::new(LinkParams { loss: 0.3, ..LinkParams::default() }));
/// let counts = sim.run(Executor::Inline).unwrap().counts;
/// assert_eq!(counts.delivered + counts.lost, 1000);
/// assert!((250..350).contains(&counts.lost));
/// ```
#[derive(Clone, Debug)]
pub struct Link {
    transmitter: Transmitter,
    /// Which parameters held when last asked, and until when.
    index: usize,
    until: SimTime,
    /// The link that answers come back over, if it is known.
    back: Option<Arc<Timeline>>,
    /// Messages that are followed, if ever any were.
    pipeline: Option<Box<Pipeline>>,
}

impl Link {
    /// A link with these parameters, or with a [`Timeline`] of them.
    pub fn new(timeline: impl Into<Arc<Timeline>>) -> Self {
        let transmitter = Transmitter::new(timeline);
        Link {
            until: transmitter.timeline().end_of(0).unwrap_or(SimTime::MAX),
            index: 0,
            transmitter,
            back: None,
            pipeline: None,
        }
    }

    /// Says what the link has over which acknowledgements come back. Unless it is said, that is a
    /// link like this one.
    #[must_use]
    pub fn answered_over(mut self, back: impl Into<Arc<Timeline>>) -> Self {
        self.back = Some(back.into());
        self
    }

    /// Declares that the link may be given these parameters during the run: [`Carrier::min_delay`]
    /// allows for them. A change that was not declared is held to the delays that were.
    #[must_use]
    pub fn may_become(mut self, params: &LinkParams) -> Self {
        self.transmitter.allow_delay(params.min_delay());
        self
    }

    /// The parameters at `at`.
    pub fn params(&self, at: SimTime) -> &LinkParams {
        self.transmitter.timeline().at(at)
    }

    /// Finds the parameters that hold now.
    fn turn_to(&mut self, now: SimTime) {
        let timeline = self.transmitter.timeline();
        self.index = timeline.index(now);
        self.until = timeline.end_of(self.index).unwrap_or(SimTime::MAX);
    }

    /// What most links are, decided without more than it takes: no size, no allocation.
    fn carry_plainly(&self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        let span = &self.transmitter.timeline().spans[self.index];
        let params = &span.params;
        for copy in 0..stage::copies(params, parcel) {
            let draws = Draws::first(copy);
            if draws.happens(parcel, Purpose::Loss, params.loss) && !parcel.is_spared(copy) {
                verdicts.lose(LOSS);
            } else {
                let way = stage::way(params, params.latency, span.floor, parcel, draws);
                // Only a change that nobody declared can be faster than what the run counts on.
                let way = way.max(self.transmitter.min_delay());
                let carriage = Carriage {
                    propagation: params.latency,
                    jitter_ns: difference(way, params.latency),
                    attempts: 1,
                    ..Carriage::default()
                };
                verdicts.deliver_as(way, carriage);
            }
        }
    }
}

impl Carrier for Link {
    type Change = LinkChange;

    fn min_delay(&self) -> SimDuration {
        self.transmitter.min_delay()
    }

    fn rate_bit_per_s(&self) -> Option<u64> {
        self.transmitter.timeline().fastest_bit_per_s()
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        let now = parcel.now();
        if now >= self.until {
            self.turn_to(now);
        }
        if parcel.token().is_some() || self.transmitter.timeline().is_followed() {
            let back = &self.back;
            let new = || Box::new(Pipeline::new(back.clone()));
            let pipeline = self.pipeline.get_or_insert_with(new);
            return pipeline.carry(&mut self.transmitter, parcel, verdicts);
        }
        let span = &self.transmitter.timeline().spans[self.index];
        if span.plain && self.transmitter.free_at() <= now {
            if span.params.outage {
                return verdicts.lose(OUTAGE);
            }
            return self.carry_plainly(parcel, verdicts);
        }
        for copy in 0..self.transmitter.copies(parcel) {
            let sent = self.transmitter.send(parcel, copy, now, &Path::default());
            sent.tell(now, verdicts);
        }
    }

    fn change(&mut self, change: LinkChange, now: SimTime) {
        self.transmitter.change(&change, now);
        self.turn_to(now);
    }
}

#[cfg(test)]
mod tests;
