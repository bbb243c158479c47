//! The settings of the network-guided system: the keys of a scenario's `[world]`, `[team]` and
//! `[network]` tables, with their defaults. Every reading of the paper that its text leaves open
//! is a key here.

use farside::SimDuration;
use farside_worlds::{Endpoints, Roadmap, SensorError, SensorNetwork};
use serde::{Deserialize, Serialize};

use crate::units;

/// Where rovers drive: the roadmap and the sensor nodes over it.
///
/// ```
/// use farside_actors::network::WorldConfig;
/// let world = WorldConfig::default();
/// assert_eq!((world.roadmap.as_str(), world.nodes), ("crater-dense", 28));
/// ```
#[derive(Deserialize, Serialize, Clone, Debug, PartialEq)]
#[serde(deny_unknown_fields, default, rename_all = "snake_case")]
pub struct WorldConfig {
    /// A built-in roadmap's name (`crater-dense`, `crater-sparse`), or the path of a TOML file.
    pub roadmap: String,
    /// How many sensor nodes; at least 1.
    pub nodes: u32,
    /// The radio radius of each, in metres; by default one that nearly every placement can do with.
    #[serde(
        rename = "radius",
        with = "units::length_m::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub radius_m: Option<f64>,
    /// Which boundary vertices are entries, and which exits.
    pub endpoints: Endpoints,
    /// The seed of the nodes' places; by default the run's seed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub placement_seed: Option<u64>,
}

impl Default for WorldConfig {
    fn default() -> Self {
        WorldConfig {
            roadmap: "crater-dense".to_owned(),
            nodes: 28,
            radius_m: None,
            endpoints: Endpoints::default(),
            placement_seed: None,
        }
    }
}

impl WorldConfig {
    /// Places the nodes over `roadmap`, which is the one that [`WorldConfig::roadmap`] names.
    ///
    /// # Errors
    /// When no network with these settings is consistent with the roadmap.
    pub fn place(&self, roadmap: &Roadmap, run_seed: u64) -> Result<SensorNetwork, SensorError> {
        let nodes = self.nodes as usize;
        let default = || SensorNetwork::default_radius_m(roadmap, nodes.max(1));
        let radius_m = self.radius_m.unwrap_or_else(default);
        let seed = self.placement_seed.unwrap_or(run_seed);
        SensorNetwork::place(roadmap, nodes, radius_m, seed)
    }
}

/// Who drives.
///
/// ```
/// assert_eq!(farside_actors::network::TeamConfig::default().rovers, 50);
/// ```
#[derive(Deserialize, Serialize, Clone, Debug, PartialEq)]
#[serde(deny_unknown_fields, default, rename_all = "snake_case")]
pub struct TeamConfig {
    /// How many rovers, all waiting at their entries at the start; at least 1.
    pub rovers: u32,
}

impl Default for TeamConfig {
    fn default() -> Self {
        TeamConfig { rovers: 50 }
    }
}

/// Who decides which rover asks for which vertex.
#[derive(Deserialize, Serialize, Clone, Copy, Debug, PartialEq, Eq, Default)]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// The paper's: candidate paths, payoffs, max-plus.
    #[default]
    Paper,
    /// The reservation walk: no rover enters before its whole way is reserved. See
    /// [`reservation`](super::reservation).
    Complete,
}

/// Who wins a vertex that several rovers' paths enter in the same cycle. The paper: "a priority has
/// to be used" (section 3.5).
#[derive(Deserialize, Serialize, Clone, Copy, Debug, PartialEq, Eq, Default)]
#[serde(rename_all = "snake_case")]
pub enum Priority {
    /// The one that has stood still for longest, of equals the lowest number.
    #[default]
    LongestWait,
    /// The lowest number.
    LowestId,
}

/// The algorithm and its protocol.
///
/// A cycle's schedule: after one `exchange` nodes tell their neighbours who is where (step 1), after
/// two they send candidate paths (steps 2 and 3), after three max-plus begins (step 4); when
/// `optimisation` is over paths are assigned and sent (step 5), and one `exchange` later vertices
/// are granted (step 6). Messages that come later than that are still used: vectors as long as
/// the optimisation lasts, requests whenever they come.
///
/// ```
/// use farside_actors::network::NetworkConfig;
/// let network = NetworkConfig::default();
/// assert_eq!(network.max_iterations, 100);
/// assert!(network.check().is_ok());
/// ```
#[derive(Deserialize, Serialize, Clone, Debug, PartialEq)]
#[serde(deny_unknown_fields, default, rename_all = "snake_case")]
pub struct NetworkConfig {
    /// Who decides which rover asks for which vertex.
    pub policy: Policy,
    /// The length of a planning cycle: at most one move of each rover.
    #[serde(with = "units::duration")]
    pub cycle: SimDuration,
    /// How long each exchange of step 1, 3 and 5 may take, and the rovers' beacons before them.
    #[serde(with = "units::duration")]
    pub exchange: SimDuration,
    /// The cycle's time for max-plus (the paper: 500 ms).
    #[serde(with = "units::duration")]
    pub optimisation: SimDuration,
    /// The most iterations of max-plus in a cycle (the paper: 100).
    pub max_iterations: u32,
    /// How long a node waits for its neighbours' vectors before it goes on with the last it has.
    #[serde(with = "units::duration")]
    pub iteration_timeout: SimDuration,
    /// How long a rover takes along an edge.
    #[serde(with = "units::duration")]
    pub traverse: SimDuration,
    /// C, the estimate of the longest path, in diameters of the roadmap.
    pub longest_path_factor: f64,
    /// What a path loses that leads back to the vertex just left.
    pub backtrack_penalty: f64,
    /// What it costs a rover that stands on a leaf of the local neighbourhood graph to wait there.
    /// Below `backtrack_penalty`, rovers that face each other wait for ever; near C, none
    /// ever waits in a pocket for another to pass, and two of them go round in circles. A very
    /// high one leaves only the zero path to wait by.
    pub leaf_wait_penalty: f64,
    /// The payoff of a collision in the cycle to come is minus this many C.
    pub collision_penalty_factor: f64,
    /// Payoffs get noise from [0, this), new in each cycle.
    pub noise: f64,
    /// Max-plus has converged when no value changes by more than this.
    pub convergence: f64,
    /// Who wins a vertex.
    pub priority: Priority,
    /// Whether a rover may follow one that leaves, in the same cycle (section 3.5).
    pub acceleration: bool,
    /// Whether it may follow one that itself follows. The paper's implementation ignores this.
    pub acceleration_chains: bool,
    /// Entry gates: an entry's owner lets a rover in only while its neighbourhood is not too full.
    pub entry_gates: bool,
    /// The share of the vertices of the owner's local neighbourhood graph up to which gates are
    /// open, from 0 to 1.
    pub entry_gate_occupancy: f64,
    /// Corridor tokens: chains of at least two vertices in which no two rovers can pass each other
    /// are entered in one direction at a time. They take part in each cycle's exchanges: with links slower than
    /// those, traffic in corridors waits for the news.
    pub corridor_tokens: bool,
    /// Wait-for probes, which confirm deadlocks and name the rovers in them.
    pub deadlock_probes: bool,
    /// A rover that has come no nearer to its goal for so many cycles waits, as probes see it; at
    /// least 1. So often a probe is sent for it.
    pub probe_after: u32,
    /// Local resolution of confirmed deadlocks: one of the rovers goes aside. Sends probes too.
    pub junction_resolution: bool,
    /// For how many cycles it stays aside, not counting the way there.
    pub aside_hold: u32,
    /// `complete`: along how many routes a walk looks for a way; at least 1.
    pub routes: u32,
    /// `complete`: how many cycles before its planned time a vertex may be granted.
    pub grants_ahead: u32,
    /// Passive deadlock: no move and no entry for so many cycles.
    pub passive_window: u32,
    /// Active deadlock: no new minimum of the sum of remaining distances for so many cycles.
    pub active_window: u32,
    /// The run ends after so many cycles, arrived or not.
    pub cycle_limit: u32,
    /// Breaks the safety protocol, to show that the monitor notices.
    #[doc(hidden)]
    #[serde(skip)]
    pub sabotage: Sabotage,
}

impl Default for NetworkConfig {
    fn default() -> Self {
        NetworkConfig {
            policy: Policy::Paper,
            cycle: SimDuration::from_secs(1),
            exchange: SimDuration::from_millis(50),
            optimisation: SimDuration::from_millis(500),
            max_iterations: 100,
            iteration_timeout: SimDuration::from_millis(20),
            traverse: SimDuration::from_millis(200),
            longest_path_factor: 20.0,
            backtrack_penalty: 40.0,
            leaf_wait_penalty: 45.0,
            collision_penalty_factor: 10.0,
            noise: 0.1,
            convergence: 1e-3,
            priority: Priority::default(),
            acceleration: true,
            acceleration_chains: false,
            entry_gates: false,
            entry_gate_occupancy: 0.15,
            corridor_tokens: false,
            deadlock_probes: false,
            probe_after: 6,
            junction_resolution: false,
            aside_hold: 8,
            routes: 8,
            grants_ahead: 2,
            passive_window: 20,
            active_window: 300,
            cycle_limit: 5000,
            sabotage: Sabotage::default(),
        }
    }
}

/// A deliberate fault in the safety protocol.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Sabotage {
    /// None: the protocol as it is.
    #[default]
    None,
    /// Owners grant an occupied vertex with this probability.
    GrantOccupied(f64),
    /// Rovers move on without a grant, at each cycle with this probability.
    MoveUnbidden(f64),
}

/// A setting that makes no sense.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// A value is out of its range.
    #[error("network.{key} is {actual}, must be {expected}")]
    Range {
        /// The key.
        key: &'static str,
        /// What it is.
        actual: String,
        /// What it may be.
        expected: &'static str,
    },
    /// The phases do not fit into a cycle.
    #[error(
        "a cycle of {cycle} is too short: four exchanges of {exchange} and an optimisation of \
         {optimisation} leave no time to move"
    )]
    Schedule {
        /// `network.cycle`.
        cycle: SimDuration,
        /// `network.exchange`.
        exchange: SimDuration,
        /// `network.optimisation`.
        optimisation: SimDuration,
    },
}

impl NetworkConfig {
    /// Checks ranges, and that the phases fit into a cycle.
    ///
    /// # Errors
    /// When a duration or window is zero where it may not be, a weight is negative or no number, or
    /// the phases of a cycle are longer than the cycle.
    pub fn check(&self) -> Result<(), ConfigError> {
        for (key, duration) in [
            ("cycle", self.cycle),
            ("exchange", self.exchange),
            ("iteration_timeout", self.iteration_timeout),
            ("traverse", self.traverse),
        ] {
            let actual = duration.to_string();
            check(key, !duration.is_zero(), actual, "longer than zero")?;
        }
        for (key, weight) in [
            ("longest_path_factor", self.longest_path_factor),
            ("backtrack_penalty", self.backtrack_penalty),
            ("leaf_wait_penalty", self.leaf_wait_penalty),
            ("collision_penalty_factor", self.collision_penalty_factor),
            ("noise", self.noise),
            ("convergence", self.convergence),
        ] {
            // Payoffs travel in single precision: what would overflow there is refused here.
            let fits = (0.0..=1e9).contains(&weight);
            check(key, fits, weight.to_string(), "in [0, 1e9]")?;
        }
        let share = self.entry_gate_occupancy;
        let fits = (0.0..=1.0).contains(&share);
        check("entry_gate_occupancy", fits, share.to_string(), "in [0, 1]")?;
        for (key, window) in [
            ("probe_after", self.probe_after),
            ("routes", self.routes),
            ("passive_window", self.passive_window),
            ("active_window", self.active_window),
            ("cycle_limit", self.cycle_limit),
        ] {
            check(key, window > 0, window.to_string(), "at least 1")?;
        }
        if self.decided_after() >= self.cycle {
            return Err(ConfigError::Schedule {
                cycle: self.cycle,
                exchange: self.exchange,
                optimisation: self.optimisation,
            });
        }
        Ok(())
    }

    /// When in a cycle vertices are granted.
    pub(crate) fn decided_after(&self) -> SimDuration {
        self.exchange * 4 + self.optimisation
    }
}

fn check(
    key: &'static str,
    fits: bool,
    actual: String,
    expected: &'static str,
) -> Result<(), ConfigError> {
    if fits {
        return Ok(());
    }
    Err(ConfigError::Range {
        key,
        actual,
        expected,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_that_do_not_fit_are_refused() {
        let network = NetworkConfig {
            optimisation: SimDuration::from_millis(800),
            ..NetworkConfig::default()
        };
        assert!(matches!(network.check(), Err(ConfigError::Schedule { .. })));
    }

    #[test]
    fn an_error_names_the_key_and_the_value() {
        let network = NetworkConfig {
            noise: f64::NAN,
            ..NetworkConfig::default()
        };
        let text = network.check().unwrap_err().to_string();
        assert_eq!(text, "network.noise is NaN, must be in [0, 1e9]");
    }
}
