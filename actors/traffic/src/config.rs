//! What a scenario says about traffic: hosts and flows.

use farside::SimDuration;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Datagram;
use farside_actors::link::LinkConfigError;
use farside_actors::system::SetupError;
use farside_actors::system::settings::{Table, Where, Within, if_set, one_of, such_that};
use farside_actors::{settings, units};

settings! {
    /// The `[traffic]` table: hosts, and what they send each other.
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
    pub struct TrafficConfig {
        /// The names of hosts: letters, digits and `_`.
        pub hosts: Vec<String>;
        /// Hosts by the number.
        pub groups: Vec<GroupConfig> [skip_serializing_if = "Vec::is_empty"], Within;
        /// What is sent; at least one.
        pub flows as "flow": Vec<FlowConfig>, Within;
    }
}

settings! {
    /// Hosts `{prefix}_1` to `{prefix}_{count}`.
    pub struct GroupConfig {
        /// What their names begin with.
        pub prefix: String, named("the beginning of names");
        /// How many there are.
        pub count: u32 = 0, 1..;
    }
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

settings! {
    /// A `[[traffic.flow]]` entry: one flow from each host that `from` matches to each that `to`
    /// does, itself excepted.
    pub struct FlowConfig {
        /// Who sends: a host, or a glob over hosts.
        pub from: String, named("a host, or a glob over hosts");
        /// Who is meant: a host, or a glob over hosts.
        pub to: String, named("a host, or a glob over hosts");
        /// Hosts that pass the messages on, in order. A relay passes each message on once.
        pub via: Vec<String> [skip_serializing_if = "Vec::is_empty"];
        /// When messages are sent.
        pub arrivals: Arrivals, one_of(&["periodic", "poisson", "burst"]);
        /// The time between two messages, or bursts, or its mean.
        pub period: SimDuration [with = "units::duration"],
            such_that(
                "a time over zero between two messages",
                |period: &SimDuration| match period.is_zero() {
                    true => "missing, or 0s".to_owned(),
                    false => period.to_string(),
                },
                |period: &SimDuration| !period.is_zero(),
            );
        /// How many messages a burst has; only with `arrivals = "burst"`.
        pub burst: Option<u32> [skip_serializing_if = "Option::is_none"],
            if_set(1..=100_000);
        /// The encoded size of each message \[byte\].
        pub size_bytes as "size": u64 [with = "units::data_size_bytes"] = 200,
            such_that(
                "40B to 1MiB",
                |bytes: &u64| units::print_data_size(*bytes),
                |bytes: &u64| (Datagram::MIN_SIZE_BYTES..=Datagram::MAX_SIZE_BYTES).contains(bytes),
            );
        /// When the flow begins.
        pub start: SimDuration [with = "units::duration"];
        /// When it ends: nothing is sent then or later. Without, it lasts as long as the run.
        pub stop: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"];
    }
}

/// The rule of a name that has to be given.
fn named(what: &'static str) -> Where<String> {
    such_that(what, |_| "missing".to_owned(), |name| !name.is_empty())
}

/// What is wrong with `[traffic]`: which key, and why.
///
/// ```
/// use farside_traffic::{TrafficConfig, TrafficPlan};
/// let text = "hosts = ['a', 'b']\nflow = [{ from = 'a', to = 'c', period = '1s' }]";
/// let error = TrafficPlan::new(&toml::from_str::<TrafficConfig>(text).unwrap()).unwrap_err();
/// let text = error.to_string();
/// assert!(text.starts_with("traffic.flow.0.to: \"c\" matches no host; did you mean"));
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

impl From<SetupError> for TrafficError {
    fn from(error: SetupError) -> Self {
        match error {
            SetupError::Links(error) => error.into(),
            SetupError::Value { key, message } => {
                let key = key.strip_prefix("traffic.").unwrap_or(&key);
                TrafficError::new(key, message)
            }
        }
    }
}

impl TrafficError {
    pub(super) fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        TrafficError::Value {
            key: key.into(),
            message: message.into(),
        }
    }
}

impl TrafficConfig {
    /// Checks what each key has to be, and what it has to be beside the others of its flow.
    ///
    /// # Errors
    /// When a value is out of its range, or does not go with another.
    pub(super) fn check_all(&self) -> Result<(), TrafficError> {
        self.check("traffic")?;
        let mut flows = self.flows.iter().enumerate();
        flows.try_for_each(|(index, flow)| flow.check_together(index))
    }
}

impl FlowConfig {
    /// Checks values beside each other; `index` is the flow's place in the file.
    fn check_together(&self, index: usize) -> Result<(), TrafficError> {
        let wrong = |key: &str, message: String| {
            Err(TrafficError::new(format!("flow.{index}.{key}"), message))
        };
        if let Some(stop) = self.stop.filter(|stop| *stop <= self.start) {
            let start = self.start;
            return wrong(
                "stop",
                format!("{stop}: expected a time after the start at {start}"),
            );
        }
        match (self.arrivals, self.burst) {
            (Arrivals::Burst, None) => wrong(
                "burst",
                "missing: expected how many messages a burst has".to_owned(),
            ),
            (Arrivals::Periodic | Arrivals::Poisson, Some(_)) => {
                wrong("burst", "only with arrivals = \"burst\"".to_owned())
            }
            _ => Ok(()),
        }
    }
}
