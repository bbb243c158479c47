//! Links: when a message arrives, how often, or why it does not.
//!
//! A [`Link`] joins two hosts, one way. It is a chain of stages, each a few lines in [`stage`]:
//! is the link out, how many copies are there, is this copy lost, how long does it take. Which
//! link has which parameters is the affair of [`LinksConfig`], and when they change, of
//! [`Degrade`]; both are what scenario files hold, and [`LinkBuilder`] turns them into links.
//!
//! Every draw is addressed by the message's identity, so what happens to one message leaves the
//! next alone, and raising a loss rate loses the same messages and more.
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

mod config;
mod params;
pub mod stage;

use farside::carrier::{Carrier, Parcel, Verdicts};
use farside::{SimDuration, SimTime};

pub use config::{Degrade, LinkBuilder, LinkConfigError, LinksConfig};
pub use params::{JitterShape, LinkChange, LinkOverrides, LinkParams};

/// Why a link loses a message by chance.
pub const LOSS: &str = "loss";
/// Why a link that is out loses every message.
pub const OUTAGE: &str = "outage";

/// A link with latency, jitter, random loss, duplication and outages. See the module's front page.
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
    params: LinkParams,
    /// The least delay of all parameters this link will ever have.
    min_delay: SimDuration,
}

impl Link {
    /// A link whose parameters stay as they are.
    pub fn new(params: LinkParams) -> Self {
        Link {
            min_delay: params.min_delay(),
            params,
        }
    }

    /// Declares that the link may be given these parameters during the run: [`Carrier::min_delay`]
    /// allows for them. A change that was not declared is held to the delays that were.
    pub fn may_become(mut self, params: &LinkParams) -> Self {
        self.min_delay = self.min_delay.min(params.min_delay());
        self
    }

    /// The present parameters.
    pub fn params(&self) -> &LinkParams {
        &self.params
    }
}

impl Carrier for Link {
    type Change = LinkChange;

    fn min_delay(&self) -> SimDuration {
        self.min_delay
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        if self.params.outage {
            verdicts.lose(OUTAGE);
            return;
        }
        for copy in 0..stage::copies(&self.params, parcel) {
            if stage::is_lost(&self.params, parcel, copy) {
                verdicts.lose(LOSS);
            } else {
                let delay = stage::delay(&self.params, parcel, copy);
                // Only a change that nobody declared can be faster than what the run counts on.
                verdicts.deliver(delay.max(self.min_delay));
            }
        }
    }

    fn change(&mut self, change: LinkChange, _now: SimTime) {
        self.params = change.into();
    }
}

#[cfg(test)]
mod tests;
