//! The keys of a scenario's `[network.max_plus]` table. Every reading of the paper that its text
//! leaves open is a key.

use std::ops::RangeInclusive;

use farside::SimDuration;
use farside_actors::processor::Speed;
use farside_actors::system::settings::{one_of, such_that};
use farside_actors::{settings, units};
use serde::{Deserialize, Serialize};

use super::processor::{self, PAPER_SPEED};

/// Payoffs travel in single precision: what would overflow there is refused.
const WEIGHTS: RangeInclusive<f64> = 0.0..=1e9;

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

/// Which paths "cause a robot to backtrack", and so pay [`MaxPlusConfig::backtrack_penalty`]
/// (section 3.4).
#[derive(Deserialize, Serialize, Clone, Copy, Debug, PartialEq, Eq, Default)]
#[serde(rename_all = "snake_case")]
pub enum Backtrack {
    /// Those whose first vertex is the one that the rover has just left.
    #[default]
    FirstStep,
    /// Those whose first edge leads back, by more than a right angle from the way that the rover
    /// has come.
    Direction,
    /// All, once for each step that leads away from the rover's goal.
    EachStepAway,
}

settings! {
    /// The `[network.max_plus]` table: what only the policy `max-plus` reads.
    ///
    /// ```
    /// use farside_network::NetworkConfig;
    /// let network: NetworkConfig = toml::from_str("max_plus.damping = 0.7")?;
    /// assert_eq!((network.max_plus.damping, network.max_plus.max_iterations), (0.7, 100));
    /// # Ok::<(), toml::de::Error>(())
    /// ```
    pub struct MaxPlusConfig {
        /// The most iterations of max-plus in a cycle, each a round of messages between all
        /// neighbours (the paper says 100, and its tables come nearest with 5: see the study
        /// `network/readings`).
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 4.
        pub max_iterations: u32 = 100;
        /// How fast each node computes: pairs of candidate paths a second, `"paper"` or
        /// `"unlimited"`. The optimisation uses what is ready in its time.
        pub processor: Speed [with = "processor"] = PAPER_SPEED,
            such_that("more than 0/s", Speed::to_string, |speed: &Speed| *speed != Speed::PerS(0));
        /// How long an iteration takes at least, whatever there is to compute: what it costs to
        /// bring the messages of all pairs from process to process, and to wait for the slowest.
        /// The paper's 500 ms end the optimisation, or 100 iterations; it does not say how many
        /// there were.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 4,
        /// "100 iterations of the message passing protocol, or 500ms".
        pub iteration_time: SimDuration [with = "units::duration"];
        /// Damped max-plus: the share of the old vector in a new one, in [0, 1); the rest is as
        /// computed. 0 is the paper's. Cohen, Galiki and Zivan (*Governing convergence of Max-sum
        /// on DCOPs through damping and splitting*, 2020) find 0.7 to 0.9 good where max-plus
        /// oscillates.
        ///
        /// Source: Cohen, Galiki and Zivan, *Governing convergence of Max-sum on DCOPs through
        /// damping and splitting*, 2020.
        pub damping: f64,
            0.0..1.0;
        /// Anytime max-plus: a node whose optimisation has not converged when its time is over
        /// takes the best of all iterations' assignments instead of the last. It judges by what it
        /// knows: its own rovers' payoffs, alone, with each other, and with the paths that its
        /// neighbours announce beside their vectors. After Vlassis, Elhorst and Kok (2004), who
        /// judge along a spanning tree of the whole network.
        ///
        /// Source: Vlassis, Elhorst and Kok, *Anytime algorithms for multiagent decision making
        /// using coordination graphs*, 2004.
        pub anytime: bool;
        /// Outsourcing: a node with more to compute than its processor can do in the time has radio
        /// neighbours with less of it compute for it: they make max-plus vectors to their own
        /// rovers from what it sends instead of them. Does nothing where processors take no time.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 5
        /// (iii).
        pub outsourcing: bool;
        /// Congestion in payoffs: how many edges of a detour a rover takes rather than a path that
        /// leads into a node's part of the roadmap with one rover more on each vertex; in [0, 1e9],
        /// 0 is the paper's.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 5
        /// (iii).
        pub congestion_weight: f64,
            WEIGHTS;
        /// How far ahead crowds are known: the share in [0, 1) that a node's neighbours have in
        /// what it says of its crowding. With 0 what its own rovers are is all, which neighbours
        /// know anyway.
        pub congestion_spread: f64,
            0.0..1.0;
        /// C, the estimate of the longest path, in diameters of the roadmap.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 3.4.
        pub longest_path_factor: f64 = 20.0,
            WEIGHTS;
        /// Which paths lead back.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 3.4.
        pub backtrack: Backtrack,
            one_of(&["first_step", "direction", "each_step_away"]);
        /// What a path loses that leads back; with `each_step_away` for each such step.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 3.4.
        pub backtrack_penalty: f64 = 40.0,
            WEIGHTS;
        /// What a path gains that leads to where the rover's path of the cycle before led: how much
        /// better another one must be for a rover to change its mind. The paper says nothing of it.
        pub keep_bonus: f64,
            WEIGHTS;
        /// The payoff of the zero path; 0 is the paper's.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 3.4.
        pub zero_payoff: f64,
            -1e9..=1e9;
        /// Whether a path to a leaf holds the leaf after its end, as the zero path holds its
        /// vertex. By default it claims nothing then: where the rover goes on is another cycle's
        /// decision.
        pub leaf_paths_hold: bool;
        /// What it costs a rover that stands on a leaf of the local neighbourhood graph to wait
        /// there. Below `backtrack_penalty`, rovers that face each other wait for ever; near C,
        /// none ever waits in a pocket for another to pass, and two of them go round in circles. A
        /// very high one leaves only the zero path to wait by.
        pub leaf_wait_penalty: f64 = 45.0,
            WEIGHTS;
        /// The payoff of a collision in the cycle to come is minus this many C.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 3.4.
        pub collision_penalty_factor: f64 = 10.0,
            WEIGHTS;
        /// Payoffs get noise from [0, this), new in each cycle.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 3.4.
        pub noise: f64 = 0.1,
            WEIGHTS;
        /// Max-plus has converged when no value changes by more than this.
        pub convergence: f64 = 1e-3,
            WEIGHTS;
        /// Who wins a vertex.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 3.5.
        pub priority: Priority,
            one_of(&["longest_wait", "lowest_id"]);
        /// Whether a rover may follow one that leaves, in the same cycle (section 3.5).
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 3.5.
        pub acceleration: bool = true;
        /// Whether it may follow one that itself follows. The paper's implementation ignores this.
        ///
        /// Source: Luna, Oyama and Bekris, *Network-Guided Multi-Robot Path Planning*, section 3.5.
        pub acceleration_chains: bool;
        /// Entry gates: an entry's owner lets a rover in only while its neighbourhood is not too
        /// full.
        pub entry_gates: bool;
        /// The share of the vertices of the owner's local neighbourhood graph up to which gates are
        /// open, from 0 to 1.
        pub entry_gate_occupancy: f64 = 0.15,
            0.0..=1.0;
        /// Wait-for probes, which confirm deadlocks and name the rovers in them.
        pub deadlock_probes: bool;
        /// A rover that has come no nearer to its goal for so many cycles waits, as probes see it;
        /// at least 1. So often a probe is sent for it.
        pub probe_after: u32 = 6,
            1..;
        /// Local resolution of confirmed deadlocks: one of the rovers goes aside. Sends probes too.
        pub junction_resolution: bool;
        /// For how many cycles it stays aside, not counting the way there.
        pub aside_hold: u32 = 8;
    }
}
