//! The settings of the network-guided system: the keys of a scenario's `[network]` table, with their
//! defaults. Every reading of the paper that its text leaves open is a key here. `[world]` and
//! `[team]` are in `world`.

mod auto;
mod world;

use farside::SimDuration;
use serde::{Deserialize, Serialize};

use crate::max_plus::processor::Processor;
use farside_actors::units;

pub use world::{Gaps, RoadmapSource, TeamConfig, WorldConfig};

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
    /// the queues ([`crate::mapf::reference`]).
    Reference,
    /// A baseline that knows everything and fails often: prioritised planning in space and time
    /// ([`crate::mapf::prioritised`]). A rover without a way never enters.
    Prioritised,
    /// A baseline that knows everything: the best plan of all, by a search over all rovers at once
    /// ([`crate::mapf::coupled`]). For small teams, and only in cycles.
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

/// How rovers move along edges.
#[derive(Deserialize, Serialize, Clone, Copy, Debug, PartialEq, Eq, Default)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// As in the paper: each edge takes [`NetworkConfig::traverse`], whatever its length, and at most one is
    /// driven in a cycle.
    #[default]
    Cycles,
    /// An edge takes as long as its length needs, with [`NetworkConfig::speed`] and
    /// [`NetworkConfig::acceleration_limit`]. With the policy `complete` a rover that holds the grant for
    /// the vertex after next does not stop between; with `paper` a cycle has to be long enough for
    /// the longest edge.
    Continuous,
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
/// use farside_network::NetworkConfig;
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
    /// [`Timing`](crate::Timing). The next three the same.
    #[serde(with = "auto")]
    pub cycle: Option<SimDuration>,
    /// How long each exchange of step 1, 3 and 5 may take, and the rovers' beacons before them.
    #[serde(with = "auto")]
    pub exchange: Option<SimDuration>,
    /// The cycle's time for max-plus (the paper: 500 ms).
    #[serde(with = "auto")]
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
    /// Outsourcing: a node with more to compute than its processor can do in the time has radio
    /// neighbours with less of it compute for it: they make max-plus vectors to their own rovers from what
    /// it sends instead of them. Does nothing where processors take no time.
    pub outsourcing: bool,
    /// Congestion in payoffs: how many edges of a detour a rover takes rather than a path that leads into
    /// a node's part of the roadmap with one rover more on each vertex; in [0, 1e9], 0 is the paper's.
    pub congestion_weight: f64,
    /// How far ahead crowds are known: the share in [0, 1) that a node's neighbours have in what it says of
    /// its crowding. With 0 what its own rovers are is all, which neighbours know anyway.
    pub congestion_spread: f64,
    /// How long a node waits for its neighbours' vectors before it goes on with the last it has.
    #[serde(with = "auto")]
    pub iteration_timeout: Option<SimDuration>,
    /// How long a rover takes along an edge, with `motion = "cycles"`.
    #[serde(with = "units::duration")]
    pub traverse: SimDuration,
    /// Whether an edge takes time by its length.
    pub motion: Motion,
    /// The highest speed of continuous motion \[m/s\], in (0, 1000]. By default 4 m/s, what the rovers are
    /// asked for that are to carry people on the Moon: an edge of 16 m, the median of the built-in
    /// dense roadmap, then takes 8 s from rest to rest.
    #[serde(with = "units::speed_m_per_s")]
    pub speed: f64,
    /// The highest acceleration of continuous motion, and the highest deceleration \[m/s2\], in
    /// (0, 1000]. By default 1 m/s2: about what wheels on loose ground can pass on in the Moon's
    /// gravity of 1.6 m/s2.
    #[serde(with = "units::acceleration_m_per_s2")]
    pub acceleration_limit: f64,
    /// How wrong a rover's estimate of its own position is, as the standard deviation along its way
    /// \[m\], in [0, 100]; 0 is the paper's. A rover says that it has left a vertex only when it is off it
    /// by `location_clearance`, though its estimate were three times this wrong; and that it has come
    /// to one only when a fix of its position was good enough, for which it stops.
    #[serde(rename = "location_sigma", with = "units::length_m")]
    pub location_sigma_m: f64,
    /// How far from a vertex a rover is off it \[m\], in [0.1, 100]; and how wrong a fix may be for it to
    /// know that it is there. By default 2 m, the length of a rover: with half of that on either
    /// side two of them do not touch.
    #[serde(rename = "location_clearance", with = "units::length_m")]
    pub location_clearance_m: f64,
    /// How long a fix takes, where locations are uncertain. One that is not good enough is repeated.
    #[serde(with = "units::duration")]
    pub location_fix: SimDuration,
    /// The node, such as `node_01`, that alone knows the roadmap at the start and gives it to the others over
    /// the network, in parts. Nodes plan and admit only once they know all of it. Absent, all do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roadmap_from: Option<String>,
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
    /// `complete`: how many cycles before its planned time a vertex may be granted. In continuous
    /// motion, how many times what the longest edge takes, if that is more.
    pub grants_ahead: u32,
    /// `coupled`: the most nodes that the search may expand.
    pub max_expansions: u64,
    /// `paper`, `complete`: a node that was not heard for so many cycles, at least 1, is replaced by a
    /// neighbour, for the rest of the run. Without it (the default) its vertices stay closed until it
    /// is back.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub takeover_after: Option<u32>,
    /// Passive deadlock: no move and no entry for so many cycles.
    pub passive_window: u32,
    /// Active deadlock: no new minimum of the sum of remaining distances for so many cycles.
    pub active_window: u32,
    /// The run ends after so many cycles, arrived or not.
    pub cycle_limit: u32,
    /// Breaks the safety protocol, to show that the monitor notices.
    #[serde(skip_serializing_if = "Sabotage::is_none")]
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
            outsourcing: false,
            congestion_weight: 0.0,
            congestion_spread: 0.0,
            iteration_timeout: None,
            traverse: SimDuration::from_millis(200),
            motion: Motion::default(),
            speed: 4.0,
            acceleration_limit: 1.0,
            location_sigma_m: 0.0,
            roadmap_from: None,
            location_clearance_m: 2.0,
            location_fix: SimDuration::from_millis(100),
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
            deadlock_probes: false,
            probe_after: 6,
            junction_resolution: false,
            aside_hold: 8,
            routes: 8,
            grants_ahead: 2,
            max_expansions: 1_000_000,
            takeover_after: None,
            passive_window: 20,
            active_window: 300,
            cycle_limit: 5000,
            sabotage: Sabotage::default(),
        }
    }
}

/// A deliberate fault in the safety protocol, for tests of what watches over it.
///
/// ```
/// use farside_network::{NetworkConfig, Sabotage};
/// let network: NetworkConfig = toml::from_str("sabotage = 'free_on_grant'")?;
/// assert_eq!(network.sabotage, Sabotage::FreeOnGrant);
/// let network: NetworkConfig = toml::from_str("sabotage = { grant_occupied = 0.05 }")?;
/// assert_eq!(network.sabotage, Sabotage::GrantOccupied(0.05));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Deserialize, Serialize, Clone, Copy, Debug, Default, PartialEq)]
#[serde(rename_all = "snake_case")]
pub enum Sabotage {
    /// None: the protocol as it is.
    #[default]
    None,
    /// Owners grant an occupied vertex with this probability (the `paper` policy only).
    GrantOccupied(f64),
    /// Rovers move on without a grant, at each cycle with this probability.
    MoveUnbidden(f64),
    /// A vertex is free as soon as its occupant was sent the grant for the next one, where it
    /// should count as occupied until its occupant is heard to leave.
    FreeOnGrant,
    /// Rovers obey nodes that are replaced.
    IgnoreFences,
    /// Deputies take the vertices that they take over as free.
    ForgetAccounts,
}

impl Sabotage {
    fn is_none(&self) -> bool {
        *self == Sabotage::None
    }

    fn is_possible(&self) -> bool {
        match self {
            Sabotage::GrantOccupied(p) | Sabotage::MoveUnbidden(p) => (0.0..=1.0).contains(p),
            _ => true,
        }
    }
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
    /// A key for policies whose nodes decide as they go.
    #[error("network.{key} is for the policies paper and complete; leave it out")]
    Planned {
        /// The key.
        key: &'static str,
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
            ("location_fix", Some(self.location_fix)),
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
            ("congestion_weight", self.congestion_weight),
        ] {
            // Payoffs travel in single precision: what would overflow there is refused here.
            let fits = (0.0..=1e9).contains(&weight);
            check(key, fits, weight.to_string(), "in [0, 1e9]")?;
        }
        let share = self.entry_gate_occupancy;
        let fits = (0.0..=1.0).contains(&share);
        check("entry_gate_occupancy", fits, share.to_string(), "in [0, 1]")?;
        for (key, share) in [
            ("damping", self.damping),
            ("congestion_spread", self.congestion_spread),
        ] {
            let fits = (0.0..1.0).contains(&share);
            check(key, fits, share.to_string(), "in [0, 1)")?;
        }
        let computes = self.processor != Processor::PairsPerS(0);
        let actual = self.processor.to_string();
        check("processor", computes, actual, "more than 0/s")?;
        if let Some(cycles) = self.takeover_after {
            let key = "takeover_after";
            check(key, cycles > 0, cycles.to_string(), "at least 1")?;
            if !matches!(self.policy, Policy::Paper | Policy::Complete) {
                return Err(ConfigError::Planned { key });
            }
        }
        for (key, window) in [
            ("probe_after", self.probe_after),
            ("routes", self.routes),
            ("passive_window", self.passive_window),
            ("active_window", self.active_window),
            ("cycle_limit", self.cycle_limit),
        ] {
            check(key, window > 0, window.to_string(), "at least 1")?;
        }
        self.check_rovers()
    }

    /// The ranges of what rovers do.
    fn check_rovers(&self) -> Result<(), ConfigError> {
        let sabotage = format!("{:?}", self.sabotage);
        check(
            "sabotage",
            self.sabotage.is_possible(),
            sabotage,
            "a probability in [0, 1]",
        )?;
        let sigma_m = self.location_sigma_m;
        let fits = (0.0..=100.0).contains(&sigma_m);
        check(
            "location_sigma",
            fits,
            format!("{sigma_m} m"),
            "in [0, 100] m",
        )?;
        let clear_m = self.location_clearance_m;
        let fits = (0.1..=100.0).contains(&clear_m);
        check(
            "location_clearance",
            fits,
            format!("{clear_m} m"),
            "in [0.1, 100] m",
        )?;
        for (key, limit) in [
            ("speed", self.speed),
            ("acceleration_limit", self.acceleration_limit),
        ] {
            let fits = limit > 0.0 && limit <= 1e3;
            check(key, fits, limit.to_string(), "in (0, 1000]")?;
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
        let timing = network.timing(SimDuration::from_millis(5), None);
        assert!(matches!(timing, Err(ConfigError::Schedule { .. })));
    }

    #[test]
    fn a_key_that_is_gone_is_unknown() {
        let error = toml::from_str::<NetworkConfig>("corridor_tokens = true").unwrap_err();
        assert!(
            error
                .message()
                .starts_with("unknown field `corridor_tokens`"),
            "{error}"
        );
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
