//! The clock of a planning cycle: how long each part lasts, where a scenario does not say.

use farside::SimDuration;
use serde::de::{Error, Visitor};
use serde::{Deserializer, Serializer};

use super::config::{ConfigError, NetworkConfig, Policy};
use crate::units::parse_duration;

/// How long the parts of a planning cycle last, the same for all nodes.
///
/// What [`NetworkConfig`] leaves open follows, for the paper's policy, from the slowest link's latency L, so that what is
/// sent in a part is there when the next begins. The paper's messages take no time; up to 10 ms these
/// are its values, and ours, and those of the other policy always:
///
/// | part | lasts | because |
/// |---|---|---|
/// | `exchange` | 1.5 L + 20 ms, at least 50 ms | one message, and some jitter |
/// | `iteration_timeout` | 2 L, at least 20 ms | one message each way |
/// | `optimisation` | 10 L, at least 500 ms | max-plus needs about ten iterations, each L |
/// | `cycle` | 4 `exchange` + `optimisation` + `traverse` + 5 L + 50 ms, at least 1 s | grant, LEAVING, its report, the follower's grant and its drive come after the decision |
///
/// ```
/// use farside::SimDuration;
/// use farside_actors::network::NetworkConfig;
/// let network = NetworkConfig::default();
/// let fast = network.timing(SimDuration::from_millis(5))?;
/// assert_eq!((fast.cycle, fast.exchange), (SimDuration::from_secs(1), SimDuration::from_millis(50)));
/// let slow = network.timing(SimDuration::from_secs(1))?;
/// assert_eq!(slow.exchange, SimDuration::from_millis(1520));
/// assert_eq!(slow.cycle, SimDuration::from_millis(21_330));
/// # Ok::<(), farside_actors::network::ConfigError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// A planning cycle: at most one move of each rover.
    pub cycle: SimDuration,
    /// Each exchange of step 1, 3 and 5, and the beacons before them.
    pub exchange: SimDuration,
    /// Max-plus.
    pub optimisation: SimDuration,
    /// How long a node waits for its neighbours' vectors.
    pub iteration_timeout: SimDuration,
}

impl Timing {
    /// When in a cycle vertices are granted.
    pub(crate) fn decided_after(&self) -> SimDuration {
        self.exchange * 4 + self.optimisation
    }
}

impl NetworkConfig {
    /// By how many cycles the windows of a standstill are longer over links of this latency. The phases
    /// of the paper's policy stretch, and with them its cycles; of other policies cycles do not, while
    /// a walk is some tens of messages, one after the other, and some of them twice. And a node that fails
    /// is replaced only when it has been silent for long enough.
    pub(crate) fn patience(&self, latency: SimDuration, timing: &Timing) -> u32 {
        const MESSAGES: u64 = 150;
        let silence = self.takeover_after.unwrap_or(0).min(u32::MAX / 4);
        if self.policy == Policy::Paper {
            return silence;
        }
        let cycles = (latency * MESSAGES).as_nanos() / timing.cycle.as_nanos().max(1);
        u32::try_from(cycles)
            .unwrap_or(u32::MAX / 4)
            .min(u32::MAX / 4)
            + silence
    }

    /// How long the parts of a cycle last where the slowest link takes `latency`.
    ///
    /// # Errors
    /// When the phases of a cycle are longer than `network.cycle`.
    pub fn timing(&self, latency: SimDuration) -> Result<Timing, ConfigError> {
        let at_least = |ms, needed: SimDuration| needed.max(SimDuration::from_millis(ms));
        let half = SimDuration::from_nanos(latency.as_nanos() / 2);
        let exchange = latency + half + SimDuration::from_millis(20);
        if self.policy != Policy::Paper {
            // No phases: a cycle is what a move takes, however slow links are.
            let cycle = self.cycle.unwrap_or(SimDuration::from_secs(1));
            return Ok(Timing {
                cycle: cycle.max(self.traverse),
                exchange,
                optimisation: SimDuration::ZERO,
                iteration_timeout: latency * 2,
            });
        }
        let mut timing = Timing {
            cycle: SimDuration::ZERO,
            exchange: self.exchange.unwrap_or(at_least(50, exchange)),
            optimisation: self.optimisation.unwrap_or(at_least(500, latency * 10)),
            iteration_timeout: self.iteration_timeout.unwrap_or(at_least(20, latency * 2)),
        };
        let after = self.traverse + latency * 5 + SimDuration::from_millis(50);
        let cycle = timing.decided_after() + after;
        timing.cycle = self.cycle.unwrap_or(at_least(1000, cycle));
        if timing.decided_after() >= timing.cycle {
            return Err(ConfigError::Schedule {
                cycle: timing.cycle,
                exchange: timing.exchange,
                optimisation: timing.optimisation,
            });
        }
        Ok(timing)
    }
}

/// Durations of scenarios that may be `"auto"`: for serde's `with`.
pub(super) mod auto {
    use super::*;

    pub(in crate::network) fn serialize<S: Serializer>(
        duration: &Option<SimDuration>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        match duration {
            Some(duration) => to.collect_str(duration),
            None => to.serialize_str("auto"),
        }
    }

    pub(in crate::network) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Option<SimDuration>, D::Error> {
        from.deserialize_any(AutoOr)
    }

    struct AutoOr;

    impl Visitor<'_> for AutoOr {
        type Value = Option<SimDuration>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("a duration such as \"250ms\", or \"auto\"")
        }

        fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
            if text.trim() == "auto" {
                return Ok(None);
            }
            parse_duration(text).map(Some).map_err(E::custom)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_is_set_stays_and_the_cycle_follows() {
        let network: NetworkConfig =
            toml::from_str("exchange = 'auto'\noptimisation = '1500ms'\niteration_timeout = '7ms'")
                .unwrap();
        let timing = network.timing(SimDuration::from_millis(5)).unwrap();
        assert_eq!(timing.iteration_timeout, SimDuration::from_millis(7));
        assert_eq!(timing.optimisation, SimDuration::from_millis(1500));
        assert_eq!(timing.cycle, SimDuration::from_millis(1975));
        let text = toml::to_string(&network).unwrap();
        assert!(text.contains("cycle = \"auto\"") && text.contains("optimisation = \"1.5s\""));
        assert_eq!(toml::from_str::<NetworkConfig>(&text).unwrap(), network);
        let error = toml::from_str::<NetworkConfig>("cycle = 3").unwrap_err();
        assert!(error.message().contains("or \"auto\""), "{error}");
    }

    proptest! {
        /// A message of each phase is there before the next, and who follows has moved before the
        /// next cycle's beacons.
        #[test]
        fn the_phases_fit(latency_ns in 0..20_000_000_000u64, traverse_ms in 1..5_000u64) {
            let (latency, traverse) =
                (SimDuration::from_nanos(latency_ns), SimDuration::from_millis(traverse_ms));
            let network = NetworkConfig { traverse, ..NetworkConfig::default() };
            let timing = network.timing(latency).unwrap();
            prop_assert!(timing.exchange > latency);
            prop_assert!(timing.iteration_timeout > latency);
            prop_assert!(timing.optimisation >= latency * 10);
            let moved = timing.decided_after() + latency * 4 + traverse;
            prop_assert!(timing.cycle > moved);
            let longer = network.timing(latency + SimDuration::from_millis(1)).unwrap();
            prop_assert!(longer.cycle >= timing.cycle);
        }
    }
}
