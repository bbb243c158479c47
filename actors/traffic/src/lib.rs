//! Open-loop traffic: hosts that send messages of an exact size on a schedule, to see what links
//! make of them. It knows no rover, no terrain and no protocol: nobody answers, nobody repeats.
//!
//! ```text
//!   rover_1 ──rover_1-relay──▶ relay ──relay-earth──▶ earth      via = ["relay"]
//!   rover_2 ──rover_2-earth──────────────────────────▶ earth
//! ```
//!
//! What is sent, and when, depends on the seed and the schedule alone, never on what arrives. So
//! runs whose links differ send the same messages with the same identities, and what happens to
//! each can be compared message by message: raising a loss rate loses the same ones and more.
//!
//! ```
//! use farside::{Executor, FixedDelay, SimDuration, Simulation};
//! use farside_actors::wiring::Links;
//! use farside_traffic::{TrafficConfig, assemble};
//!
//! let config: TrafficConfig = toml::from_str("
//!     hosts = ['rover', 'base']
//!     [[flow]]
//!     from = 'rover'
//!     to = 'base'
//!     period = '1s'
//!     size = '200B'
//!     stop = '60s'
//! ")?;
//! let mut sim = Simulation::new(1);
//! let delay = FixedDelay::new(SimDuration::from_millis(250));
//! let traffic = assemble(&mut sim, &config, 1, &mut |sim, wiring| {
//!     Ok(Links::carried(sim, wiring, |_, _| delay.clone()))
//! })?;
//! let report = sim.run(Executor::Inline)?;
//! let metrics = traffic.metrics(report.end_time);
//! assert_eq!((metrics.sent, metrics.delivered), (60, 60));
//! assert_eq!(metrics.delay_mean_s, Some(0.25));
//! // On average half a period older than on arrival.
//! assert_eq!(metrics.age_of_information_mean_s, Some(0.75));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod account;
mod assemble;
mod builtin;
mod config;
mod message;
mod metrics;
mod monitor;
mod route;
mod station;
mod system;

pub use assemble::{Traffic, assemble};
pub use config::{Arrivals, FlowConfig, GroupConfig, TrafficConfig, TrafficError};
pub use message::Datagram;
pub use metrics::{FlowMetrics, TrafficMetrics};
pub use route::{Flow, TrafficPlan};
pub use system::TrafficSystem;

#[cfg(test)]
mod tests;
