//! The clock of a planning cycle: how long each part lasts, where a scenario does not say.

use farside::SimDuration;

use super::config::{ConfigError, NetworkConfig, Policy};
use farside_actors::link::transmission_time;

/// How long the parts of a planning cycle last, the same for all nodes.
///
/// What [`NetworkConfig`] leaves open follows, for the policy `max-plus`, from the slowest link's
/// latency L and from S(n), how long n bytes are on the air at the lowest bit rate (no time without
/// rates), so that what is sent in a part is there when the next begins. The paper's messages take
/// no time; up to 10 ms these are its values, and ours, and those of the other policy always:
///
/// | part | lasts | because |
/// |---|---|---|
/// | `exchange` | 1.5 L + S(700) + 20 ms, at least 50 ms | one message, and some jitter |
/// | `iteration_timeout` | 2 (L + S(600)), at least 20 ms | one message each way |
/// | `optimisation` | 10 (L + S(600)), at least 500 ms | max-plus needs about ten iterations, each L + S |
/// | `cycle` | 4 `exchange` + `optimisation` + `traverse` + 5 (L + S(64)) + 50 ms, at least 1 s | grant, LEAVING, its report, the follower's grant and its drive come after the decision |
///
/// The sizes are those of common messages of 50 rovers and 28 nodes: candidate paths, vectors,
/// grants. Larger ones take longer, and are used if they come in time.
///
/// Rates are those of links that two hosts have to themselves. Who shares a radio has to say how
/// long its parts last.
///
/// ```
/// use farside::SimDuration;
/// use farside_network::NetworkConfig;
/// let network = NetworkConfig::default();
/// let fast = network.timing(SimDuration::from_millis(5), None)?;
/// assert_eq!(fast.cycle, SimDuration::from_secs(1));
/// assert_eq!(fast.exchange, SimDuration::from_millis(50));
/// let slow = network.timing(SimDuration::from_secs(1), None)?;
/// assert_eq!(slow.exchange, SimDuration::from_millis(1520));
/// assert_eq!(slow.cycle, SimDuration::from_millis(21_330));
/// let narrow = network.timing(SimDuration::ZERO, Some(2_000))?;
/// assert_eq!(narrow.exchange, SimDuration::from_millis(2820));
/// assert_eq!(narrow.optimisation, SimDuration::from_secs(24));
/// # Ok::<(), farside_network::ConfigError>(())
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
    /// The lowest bit rate of all links \[bit/s\]; none if messages of any size take no time.
    pub rate_bit_per_s: Option<u64>,
}

/// The size of a common message \[B\] with candidate paths.
const PATHS_BYTES: u64 = 700;
/// The same with vectors of one of the first iterations, in which most of them change.
const VECTORS_BYTES: u64 = 600;
/// The same of a grant, a beacon, a departure.
const GRANT_BYTES: u64 = 64;
/// The same of a request of the `complete` policy.
const WALK_BYTES: u64 = 500;

/// How long `bytes` are on the air; no time without a rate.
fn sending(bytes: u64, rate_bit_per_s: Option<u64>) -> SimDuration {
    rate_bit_per_s.map_or(SimDuration::ZERO, |rate| transmission_time(bytes, rate))
}

impl Timing {
    /// When in a cycle vertices are granted.
    pub(crate) fn decided_after(&self) -> SimDuration {
        self.exchange * 4 + self.optimisation
    }

    /// How long `bytes` are on the air, on the slowest link.
    pub(crate) fn sending(&self, bytes: u64) -> SimDuration {
        sending(bytes, self.rate_bit_per_s)
    }
}

impl NetworkConfig {
    /// By how many cycles the windows of a deadlock are longer over links of this latency and rate.
    /// The phases of the policy `max-plus` stretch, and with them its cycles; of other policies
    /// cycles do not, while a request is some tens of messages, one after the other, and some of
    /// them twice. And a node that fails is replaced only when it has been silent for long enough.
    pub(crate) fn patience(&self, latency: SimDuration, timing: &Timing) -> u32 {
        const MESSAGES: u64 = 150;
        let silence = self.failover_after.unwrap_or(0).min(u32::MAX / 4);
        if self.policy == Policy::MaxPlus {
            return silence;
        }
        let message = latency + timing.sending(WALK_BYTES);
        let cycles = (message * MESSAGES).as_nanos() / timing.cycle.as_nanos().max(1);
        let cycles = u32::try_from(cycles).unwrap_or(u32::MAX / 4);
        cycles.min(u32::MAX / 4) + silence
    }

    /// How long the parts of a cycle last where the slowest link takes `latency`, and that with the
    /// lowest rate, if any has one, transmits `rate_bit_per_s`.
    ///
    /// # Errors
    /// When the phases of a cycle are longer than `network.cycle`.
    pub fn timing(
        &self,
        latency: SimDuration,
        rate_bit_per_s: Option<u64>,
    ) -> Result<Timing, ConfigError> {
        let at_least = |ms, needed: SimDuration| needed.max(SimDuration::from_millis(ms));
        let sending = |bytes| sending(bytes, rate_bit_per_s);
        let half = SimDuration::from_nanos(latency.as_nanos() / 2);
        let exchange = latency + half + sending(PATHS_BYTES) + SimDuration::from_millis(20);
        if self.policy != Policy::MaxPlus {
            // No phases: a cycle is what a move takes, however slow links are.
            let cycle = self.cycle.unwrap_or(SimDuration::from_secs(1));
            return Ok(Timing {
                cycle: cycle.max(self.traverse),
                exchange,
                optimisation: SimDuration::ZERO,
                iteration_timeout: latency * 2,
                rate_bit_per_s,
            });
        }
        let iteration = latency + sending(VECTORS_BYTES);
        let mut timing = Timing {
            cycle: SimDuration::ZERO,
            exchange: self.exchange.unwrap_or(at_least(50, exchange)),
            optimisation: self.optimisation.unwrap_or(at_least(500, iteration * 10)),
            iteration_timeout: self
                .iteration_timeout
                .unwrap_or(at_least(20, iteration * 2)),
            rate_bit_per_s,
        };
        let after =
            self.traverse + (latency + sending(GRANT_BYTES)) * 5 + SimDuration::from_millis(50);
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_is_set_stays_and_the_cycle_follows() {
        let network: NetworkConfig =
            toml::from_str("exchange = 'auto'\noptimisation = '1500ms'\niteration_timeout = '7ms'")
                .unwrap();
        let timing = network.timing(SimDuration::from_millis(5), None).unwrap();
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
        fn the_phases_fit(
            latency_ns in 0..20_000_000_000u64, traverse_ms in 1..5_000u64,
            rate in prop::option::of(500..10_000_000u64),
        ) {
            let (latency, traverse) =
                (SimDuration::from_nanos(latency_ns), SimDuration::from_millis(traverse_ms));
            let network = NetworkConfig { traverse, ..NetworkConfig::default() };
            let timing = network.timing(latency, rate).unwrap();
            let (paths, vectors) = (timing.sending(PATHS_BYTES), timing.sending(VECTORS_BYTES));
            prop_assert!(timing.exchange > latency + paths);
            prop_assert!(timing.iteration_timeout > latency + vectors);
            prop_assert!(timing.optimisation >= (latency + vectors) * 10);
            let told = (latency + timing.sending(GRANT_BYTES)) * 4;
            let moved = timing.decided_after() + told + traverse;
            prop_assert!(timing.cycle > moved);
            let longer = network.timing(latency + SimDuration::from_millis(1), rate).unwrap();
            prop_assert!(longer.cycle >= timing.cycle);
            let slower = network.timing(latency, rate.map(|rate| rate / 2)).unwrap();
            prop_assert!(slower.cycle >= timing.cycle);
        }
    }
}
