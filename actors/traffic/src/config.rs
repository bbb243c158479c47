//! What a scenario says about traffic: hosts and flows.

use farside::SimDuration;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Datagram;
use farside_actors::link::LinkConfigError;
use farside_actors::units;

/// The `[traffic]` table.
///
/// ```
/// use farside_traffic::{Arrivals, TrafficConfig};
/// let text = "
///     hosts = ['earth']
///     groups = [{ prefix = 'rover', count = 3 }]
///     [[flow]]
///     from = 'rover_*'
///     to = 'earth'
///     arrivals = 'poisson'
///     period = '2s'
/// ";
/// let config: TrafficConfig = toml::from_str(text)?;
/// assert_eq!(config.flows[0].arrivals, Arrivals::Poisson);
/// assert_eq!(config.flows[0].size_bytes, 200);
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrafficConfig {
    /// The names of hosts: letters, digits and `_`.
    #[serde(default)]
    pub hosts: Vec<String>,
    /// Hosts by the number.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub groups: Vec<GroupConfig>,
    /// What is sent; at least one.
    #[serde(default, rename = "flow")]
    pub flows: Vec<FlowConfig>,
}

/// Hosts `{prefix}_1` to `{prefix}_{count}`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroupConfig {
    /// What their names begin with.
    pub prefix: String,
    /// How many there are, from 1.
    pub count: u32,
}

/// When a flow sends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Arrivals {
    /// One message each period, the first at the start.
    #[default]
    Periodic,
    /// One message after another, independently of each other: the time between two is
    /// exponential, with the period as its mean.
    Poisson,
    /// Several messages at once each period, the first of them at the start.
    Burst,
}

/// A `[[traffic.flow]]` entry: one flow from each host that `from` matches to each that `to` does,
/// itself excepted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlowConfig {
    /// Who sends: a host, or a glob over hosts.
    pub from: String,
    /// Who is meant: a host, or a glob over hosts.
    pub to: String,
    /// Hosts that pass the messages on, in order. A relay passes each message on once.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub via: Vec<String>,
    /// When messages are sent.
    #[serde(default)]
    pub arrivals: Arrivals,
    /// The time between two messages, or bursts, or its mean; over 0.
    #[serde(with = "units::duration")]
    pub period: SimDuration,
    /// How many messages a burst has; only with `arrivals = "burst"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub burst: Option<u32>,
    /// The encoded size of each message \[byte\], 200 unless given.
    #[serde(
        rename = "size",
        default = "default_size_bytes",
        with = "units::data_size_bytes"
    )]
    pub size_bytes: u64,
    /// When the flow begins.
    #[serde(default, with = "units::duration")]
    pub start: SimDuration,
    /// When it ends: nothing is sent then or later. Without, it lasts as long as the run.
    #[serde(
        default,
        with = "units::duration::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub stop: Option<SimDuration>,
}

fn default_size_bytes() -> u64 {
    200
}

/// The most messages of a burst.
const MAX_BURST: u32 = 100_000;

/// What is wrong with `[traffic]`: which key, and why.
///
/// ```
/// use farside_traffic::{TrafficConfig, TrafficPlan};
/// let text = "hosts = ['a', 'b']\nflow = [{ from = 'a', to = 'c', period = '1s' }]";
/// let error = TrafficPlan::new(&toml::from_str::<TrafficConfig>(text).unwrap()).unwrap_err();
/// assert_eq!(error.key, "flow.0.to");
/// assert!(error.message.starts_with("\"c\" matches no host; did you mean"));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum TrafficError {
    /// A value that cannot be.
    #[error("traffic.{key}: {message}")]
    Value {
        /// The key within `[traffic]`: `flow.0.to`.
        key: String,
        /// What was found and what was expected.
        message: String,
    },
    /// A link cannot be.
    #[error(transparent)]
    Links(#[from] LinkConfigError),
}

impl TrafficError {
    pub(super) fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        TrafficError::Value {
            key: key.into(),
            message: message.into(),
        }
    }
}

impl FlowConfig {
    /// Checks what a flow says of itself; `index` is its place in the file.
    pub(super) fn check(&self, index: usize) -> Result<(), TrafficError> {
        let wrong = |key: &str, message: String| {
            Err(TrafficError::new(format!("flow.{index}.{key}"), message))
        };
        if self.period.is_zero() {
            return wrong("period", "0s: expected a time over zero".to_owned());
        }
        let (least, most) = (Datagram::MIN_SIZE_BYTES, Datagram::MAX_SIZE_BYTES);
        if !(least..=most).contains(&self.size_bytes) {
            let found = units::print_data_size(self.size_bytes);
            return wrong("size", format!("{found}: expected from {least}B to 1MiB"));
        }
        if let Some(stop) = self.stop.filter(|stop| *stop <= self.start) {
            let start = self.start;
            return wrong(
                "stop",
                format!("{stop}: expected a time after the start at {start}"),
            );
        }
        match (self.arrivals, self.burst) {
            (Arrivals::Burst, Some(count)) if (1..=MAX_BURST).contains(&count) => Ok(()),
            (Arrivals::Burst, Some(count)) => {
                wrong("burst", format!("{count}: expected from 1 to {MAX_BURST}"))
            }
            (Arrivals::Burst, None) => wrong(
                "burst",
                "missing: expected how many messages a burst has".to_owned(),
            ),
            (_, Some(_)) => wrong("burst", "only with arrivals = \"burst\"".to_owned()),
            (_, None) => Ok(()),
        }
    }
}
