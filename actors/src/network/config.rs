//! The settings of the network-guided system: the keys of a scenario's `[world]`, `[team]` and
//! `[network]` tables, with their defaults. Every reading of the paper that its text leaves open
//! is a key here.

use farside::SimDuration;
use farside_worlds::{Endpoints, Roadmap, SensorError, SensorNetwork};
use serde::{Deserialize, Serialize};

use super::processor::Processor;
use super::timing;
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
    /// A built-in roadmap's name (`crater-dense`, `crater-sparse`, `rubble-32-32-10`), or the path of a
    /// TOML file or of a MovingAI `.map`.
    pub roadmap: String,
    /// How long the side of a cell of a MovingAI map is, in metres.
    #[serde(rename = "cell", with = "units::length_m")]
    pub cell_m: f64,
    /// A MovingAI `.scen` file with the starts and goals of rovers that stand on the map from the
    /// start and stay at their goals. A built-in map of cells has its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tasks: Option<String>,
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
            cell_m: 10.0,
            tasks: None,
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
    /// How many rovers, all waiting at their entries at the start; at least 1. Where the world has
    /// tasks, they do the first ones.
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
    /// A baseline that knows everything and never fails: revised prioritised planning, in the order of
    /// the queues ([`crate::planning::reference`]).
    Reference,
    /// A baseline that knows everything and fails often: prioritised planning in space and time
    /// ([`crate::planning::prioritised`]). A rover without a way never enters.
    Prioritised,
    /// A baseline that knows everything: the best plan of all, by a search over all rovers at once
    /// ([`crate::planning::coupled`]). For small teams.
    Coupled,
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
    /// The length of a planning cycle: at most one move of each rover. `None`, which is `"auto"` in
    /// a scenario, is as long as its parts take over the slowest link, at least 1 s: see
    /// [`super::Timing`]. The next three the same.
    #[serde(with = "timing::auto")]
    pub cycle: Option<SimDuration>,
    /// How long each exchange of step 1, 3 and 5 may take, and the rovers' beacons before them.
    #[serde(with = "timing::auto")]
    pub exchange: Option<SimDuration>,
    /// The cycle's time for max-plus (the paper: 500 ms).
    #[serde(with = "timing::auto")]
    pub optimisation: Option<SimDuration>,
    /// The most iterations of max-plus in a cycle (the paper: 100).
    pub max_iterations: u32,
    /// How fast each node computes: pairs of candidate paths a second, `"paper"` or `"unlimited"`.
    /// The optimisation uses what is ready in its time.
    pub processor: Processor,
    /// Damped max-plus: the share of the old vector in a new one, in [0, 1); the rest is as computed.
    /// 0 is the paper's. Cohen, Galiki and Zivan (*Governing convergence of Max-sum on DCOPs
    /// through damping and splitting*, 2020) find 0.7 to 0.9 good where max-plus oscillates.
    pub damping: f64,
    /// Anytime max-plus: a node whose optimisation has not converged when its time is over takes the
    /// best of all iterations' assignments instead of the last. It judges by what it knows: its own
    /// rovers' payoffs, alone, with each other, and with the paths that its neighbours announce
    /// beside their vectors. After Vlassis, Elhorst and Kok (2004), who judge along a spanning
    /// tree of the whole network.
    pub anytime: bool,
    /// How long a node waits for its neighbours' vectors before it goes on with the last it has.
    #[serde(with = "timing::auto")]
    pub iteration_timeout: Option<SimDuration>,
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
    /// `coupled`: the most nodes that the search may expand.
    pub max_expansions: u64,
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
            cycle: None,
            exchange: None,
            optimisation: None,
            max_iterations: 100,
            processor: Processor::PAPER,
            damping: 0.0,
            anytime: false,
            iteration_timeout: None,
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
            max_expansions: 1_000_000,
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
    /// Checks ranges. Whether the phases fit into a cycle is for [`NetworkConfig::timing`] to say.
    ///
    /// # Errors
    /// When a duration or window is zero where it may not be, or a weight is negative or no number.
    pub fn check(&self) -> Result<(), ConfigError> {
        for (key, duration) in [
            ("cycle", self.cycle),
            ("exchange", self.exchange),
            ("iteration_timeout", self.iteration_timeout),
            ("traverse", Some(self.traverse)),
        ] {
            let actual = duration.map_or_else(|| "auto".to_owned(), |d| d.to_string());
            let lasts = duration.is_none_or(|d| !d.is_zero());
            check(key, lasts, actual, "longer than zero")?;
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
        let damps = (0.0..1.0).contains(&self.damping);
        check("damping", damps, self.damping.to_string(), "in [0, 1)")?;
        let computes = self.processor != Processor::PairsPerS(0);
        let actual = self.processor.to_string();
        check("processor", computes, actual, "more than 0/s")?;
        for (key, window) in [
            ("probe_after", self.probe_after),
            ("routes", self.routes),
            ("passive_window", self.passive_window),
            ("active_window", self.active_window),
            ("cycle_limit", self.cycle_limit),
        ] {
            check(key, window > 0, window.to_string(), "at least 1")?;
        }
        Ok(())
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
            cycle: Some(SimDuration::from_secs(1)),
            optimisation: Some(SimDuration::from_millis(800)),
            ..NetworkConfig::default()
        };
        let timing = network.timing(SimDuration::from_millis(5));
        assert!(matches!(timing, Err(ConfigError::Schedule { .. })));
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
