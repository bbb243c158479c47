//! The settings of the network-guided system: the keys of a scenario's `[network]` table, with
//! their defaults. Every reading of the paper that its text leaves open is a key here. `[world]`
//! is in `world`; `[team]` is shared by systems.

mod auto;
mod world;

use farside::SimDuration;
use farside_actors::system::settings::{
    Table, Where, Within, if_set, in_unit, one_of, over, such_that,
};
use farside_actors::{settings, units};
use serde::{Deserialize, Serialize};

use crate::max_plus::config::MaxPlusConfig;
use crate::reservation::config::CompleteConfig;

pub use farside_actors::team::TeamConfig;
pub use world::{Gaps, RoadmapSource, WorldConfig};

/// Who decides which rover asks for which vertex.
#[derive(Deserialize, Serialize, Clone, Copy, Debug, PartialEq, Eq, Default)]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// The paper's: candidate paths, payoffs, max-plus. Its old name is `paper`.
    #[default]
    #[serde(rename = "max-plus", alias = "paper")]
    MaxPlus,
    /// The reservation request: no rover enters before its whole way is reserved. See
    /// [`reservation`](super::reservation).
    Complete,
    /// A baseline that knows everything and never fails: revised prioritised planning, in the order
    /// of the queues ([`crate::mapf::reference`]).
    Reference,
    /// A baseline that knows everything and fails often: prioritised planning in space and time
    /// ([`crate::mapf::prioritised`]). A rover without a way never enters.
    Prioritised,
    /// A baseline that knows everything: the best plan of all, by a search over all rovers at once
    /// ([`crate::mapf::coupled`]). For small teams, and only in cycles.
    Coupled,
    /// A baseline that knows everything, for maps where rovers stay at their goals: a plan however
    /// crowded the map is ([`crate::mapf::lacam`]). Only in cycles.
    Lacam,
}

/// How rovers move along edges.
#[derive(Deserialize, Serialize, Clone, Copy, Debug, PartialEq, Eq, Default)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// As in the paper: each edge takes [`NetworkConfig::traverse`], whatever its length, and at
    /// most one is driven in a cycle.
    #[default]
    Cycles,
    /// An edge takes as long as its length needs, with [`NetworkConfig::speed`] and
    /// [`NetworkConfig::acceleration_limit`]. With the policy `complete` a rover that holds the
    /// grant for the vertex after next does not stop between; with `max-plus` a cycle has to be
    /// long enough for the longest edge.
    Continuous,
}

settings! {
    /// The `[network]` table: the algorithm and its protocol.
    ///
    /// A cycle's schedule: after one `exchange` nodes tell their neighbours who is where (step 1),
    /// after two they send candidate paths (steps 2 and 3), after three max-plus begins (step 4);
    /// when `optimisation` is over paths are assigned and sent (step 5), and one `exchange` later
    /// vertices are granted (step 6). Messages that come later than that are still used: vectors as
    /// long as the optimisation lasts, requests whenever they come.
    ///
    /// ```
    /// use farside_network::NetworkConfig;
    /// let network = NetworkConfig::default();
    /// assert_eq!(network.max_plus.max_iterations, 100);
    /// assert!(network.check().is_ok());
    /// ```
    pub struct NetworkConfig {
        /// Who decides which rover asks for which vertex.
        pub policy: Policy = Policy::MaxPlus,
            one_of(&["max-plus", "complete", "reference", "prioritised", "coupled", "lacam"]);
        /// What only the policy `max-plus` reads.
        pub max_plus: MaxPlusConfig, Within;
        /// What only the policy `complete` reads.
        pub complete: CompleteConfig, Within;
        /// The length of a planning cycle: at most one move of each rover. `None`, which is
        /// `"auto"` in a scenario, is as long as its parts take over the slowest link, at least 1
        /// s: see [`Timing`](crate::Timing). The next three the same.
        pub cycle: Option<SimDuration> [with = "auto"],
            if_set(over(SimDuration::ZERO));
        /// How long each exchange of step 1, 3 and 5 may take, and the rovers' beacons before them.
        pub exchange: Option<SimDuration> [with = "auto"],
            if_set(over(SimDuration::ZERO));
        /// The cycle's time for max-plus (the paper: 500 ms).
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 4.
        pub optimisation: Option<SimDuration> [with = "auto"];
        /// How long a node waits for its neighbours' vectors before it goes on with the last it
        /// has.
        pub iteration_timeout: Option<SimDuration> [with = "auto"],
            if_set(over(SimDuration::ZERO));
        /// How long a rover takes along an edge, with `motion = "cycles"`.
        pub traverse: SimDuration [with = "units::duration"] = SimDuration::from_millis(200),
            over(SimDuration::ZERO);
        /// Whether an edge takes time by its length.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 5
        /// (ii).
        pub motion: Motion,
            one_of(&["cycles", "continuous"]);
        /// The highest speed of continuous motion \[m/s\], in (0, 1000]. By default 4 m/s, what the
        /// rovers are asked for that are to carry people on the Moon: an edge of 16 m, the median
        /// of the built-in dense roadmap, then takes 8 s from rest to rest.
        pub speed: f64 [with = "units::speed_m_per_s"] = 4.0,
            up_to_a_thousand("more than 0 m/s, at most 1000 m/s");
        /// The highest acceleration of continuous motion, and the highest deceleration \[m/s2\], in
        /// (0, 1000]. By default 1 m/s2: about what wheels on loose ground can pass on in the
        /// Moon's gravity of 1.6 m/s2.
        pub acceleration_limit: f64 [with = "units::acceleration_m_per_s2"] = 1.0,
            up_to_a_thousand("more than 0 m/s2, at most 1000 m/s2");
        /// How wrong a rover's estimate of its own position is, as the standard deviation along its
        /// way \[m\], in [0, 100]; 0 is the paper's. A rover says that it has left a vertex only
        /// when it is off it by `location_clearance`, though its estimate were three times this
        /// wrong; and that it has come to one only when a fix of its position was good enough, for
        /// which it stops.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 5
        /// (ii).
        pub location_sigma_m as "location_sigma": f64 [with = "units::length_m"],
            in_unit("m", 0.0..=100.0);
        /// How far from a vertex a rover is off it \[m\], in [0.1, 100]; and how wrong a fix may be
        /// for it to know that it is there. By default 2 m, the length of a rover: with half of
        /// that on either side two of them do not touch.
        pub location_clearance_m as "location_clearance": f64 [with = "units::length_m"] = 2.0,
            in_unit("m", 0.1..=100.0);
        /// How long a fix takes, where locations are uncertain. One that is not good enough is
        /// repeated.
        pub location_fix: SimDuration [with = "units::duration"] = SimDuration::from_millis(100),
            over(SimDuration::ZERO);
        /// The node, such as `node_01`, that alone knows the roadmap at the start and gives it to
        /// the others over the network, in parts. Nodes plan and admit only once they know all of
        /// it. Absent, all do.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 5
        /// (i).
        pub roadmap_from: Option<String> [skip_serializing_if = "Option::is_none"];
        /// `complete`: how many cycles before its planned time a vertex may be granted. In
        /// continuous motion, how many times what the longest edge takes, if that is more.
        pub grants_ahead: u32 = 2;
        /// `coupled`: the most nodes that the search may expand.
        pub max_expansions: u64 = 1_000_000;
        /// `max-plus`, `complete`: a node that was not heard for so many cycles, at least 1, is
        /// replaced by a neighbour, for the rest of the run. Without it (the default) its vertices
        /// stay closed until it is back.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 5
        /// (iv).
        pub failover_after: Option<u32> [skip_serializing_if = "Option::is_none"],
            if_set(1..);
        /// A run ends when no rover has moved or entered for so many cycles: as a deadlock if that
        /// is certain, else for want of progress. Here and below so many cycles are meant in which
        /// all messages come through; others count with the square of the share that is delivered,
        /// a hundredth at least. Cycles in which somebody is down who will be restarted, or before
        /// a planned change of links or processors, do not count.
        pub deadlock_window: u32 = 20,
            1..;
        /// And when the sum of what all rovers have left to drive has not become less than ever
        /// before for so many cycles, though rovers move.
        pub livelock_window: u32 = 300,
            1..;
        /// The run ends after so many cycles, arrived or not.
        pub cycle_limit: u32 = 5000,
            1..;
        /// Breaks the safety protocol, to show that the monitor notices.
        pub sabotage: Sabotage [skip_serializing_if = "Sabotage::is_none"],
            such_that(
                "the name of a rule to break, with a probability from 0 to 1",
                |sabotage: &Sabotage| format!("{sabotage:?}"),
                Sabotage::is_possible,
            );
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
    /// Owners grant an occupied vertex with this probability (the policy `max-plus` only).
    GrantOccupied(f64),
    /// Rovers move on without a grant, at each cycle with this probability.
    MoveUnbidden(f64),
    /// A vertex is free as soon as its occupant was sent the grant for the next one, where it
    /// should count as occupied until its occupant is heard to leave.
    FreeOnGrant,
    /// Rovers obey nodes that are replaced.
    #[serde(alias = "ignore_fences")]
    IgnoreFencing,
    /// Backups take the vertices that they take over as free.
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
    #[error("{key}: {message}")]
    Value {
        /// The dotted key.
        key: String,
        /// What it is, and what it may be.
        message: String,
    },
    /// A key for policies whose nodes decide as they go.
    #[error("{key} is for the policies max-plus and complete; leave it out")]
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
    /// When a value is out of its range, or the policy does not know a key that is given.
    pub fn check(&self) -> Result<(), ConfigError> {
        Table::check(self, "network").map_err(|error| {
            let (key, message) = error.into_parts();
            let key = key.join(".");
            ConfigError::Value { key, message }
        })?;
        if self.failover_after.is_some()
            && !matches!(self.policy, Policy::MaxPlus | Policy::Complete)
        {
            let key = "network.failover_after";
            return Err(ConfigError::Planned { key });
        }
        Ok(())
    }
}

/// The rule of a speed or an acceleration.
fn up_to_a_thousand(expected: &'static str) -> Where<f64> {
    such_that(expected, f64::to_string, |value: &f64| {
        *value > 0.0 && *value <= 1e3
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
            max_plus: MaxPlusConfig {
                noise: f64::NAN,
                ..MaxPlusConfig::default()
            },
            ..NetworkConfig::default()
        };
        let text = network.check().unwrap_err().to_string();
        assert_eq!(
            text,
            "network.max_plus.noise: NaN: expected 0 to 1000000000"
        );
    }
}
