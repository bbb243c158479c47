//! What a run of the network-guided system amounts to, in numbers: the paper's metrics (section 4)
//! and what they leave out.

use farside_worlds::VertexId;
use serde::Serialize;

use crate::invariants::{Collision, WaitCycle};

/// How a team came to a standstill.
#[derive(Serialize, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum Deadlock {
    /// It did not.
    #[default]
    None,
    /// No rover moved or entered for `network.passive_window` cycles.
    Passive,
    /// Rovers moved, and came no nearer to their goals for `network.active_window` cycles.
    Active,
}

/// The result of a run. Means are over the rovers that arrived, and 0 if none did.
///
/// ```
/// use farside_actors::network::{Deadlock, NetworkMetrics};
/// let metrics = NetworkMetrics::default();
/// assert_eq!((metrics.arrived, metrics.deadlock), (0, Deadlock::None));
/// ```
#[derive(Serialize, Clone, Debug, Default, PartialEq)]
pub struct NetworkMetrics {
    /// Rovers in the team.
    pub rovers: u32,
    /// Rovers that reached their goals.
    pub arrived: u32,
    /// Every rover reached its goal.
    pub completed: bool,
    /// The team came to a standstill, see `deadlock`.
    pub deadlocked: bool,
    /// When each rover reached its goal, in seconds of virtual time, rover by rover; none for those
    /// that had not when the run ended.
    pub arrival_s: Vec<Option<f64>>,
    /// What links charged all rovers for what they transmitted, each until the last change that it
    /// recorded \[J\]; 0 unless links have a `tx_power`.
    pub transmit_energy_j: f64,
    /// Times a rover claimed a vertex that another one had, or took an edge against another.
    pub collisions: u32,
    /// The first of them: when, who, where.
    pub collided: Vec<Collision<VertexId>>,
    /// How the team came to a standstill, if it did.
    pub deadlock: Deadlock,
    /// Cycles in which at least one rover was kept from a vertex that its path entered.
    pub interventions: u32,
    /// The same as a share of all cycles.
    pub intervention_rate: f64,
    /// Steps from entry to goal over the shortest path's length (the paper's path ratio; stops are
    /// steps). Gamed by whatever holds rovers back before they enter: see `time_ratio`.
    pub path_ratio: f64,
    /// Cycles from the start of the run to the goal over the shortest path's length.
    pub time_ratio: f64,
    /// Cycles from entry to goal.
    pub mean_steps: f64,
    /// Cycles from entry to goal, summed over the rovers that arrived: the paper's total solution
    /// length (Figure 5), if all did.
    pub total_steps: u64,
    /// Cycles between entry and goal in which the rover did not set out.
    pub mean_stops: f64,
    /// Moves back to the vertex just left.
    pub mean_backtracks: f64,
    /// Cycles until the last rover arrived, or the run ended.
    pub cycles: u32,
    /// Messages that links were given, lost ones included and copies not, for each rover of the team
    /// in each cycle.
    pub messages_per_rover_cycle: f64,
    /// The encoded size of the same, headers not included \[B\].
    pub bytes_per_rover_cycle: f64,
    /// Max-plus iterations of a node that plans for rovers, in a cycle.
    pub max_plus_iterations: f64,
    /// Pairs of candidate paths that a node's processor was given to look at in a cycle, in the mean of
    /// all nodes, also of those that had no rovers.
    pub pairs_per_cycle: f64,
    /// The same of the node that was given most in each cycle, in the mean of the cycles.
    pub peak_load: f64,
    /// How uneven loads were: `peak_load` over `pairs_per_cycle`, 1 if all nodes were given the same; 0
    /// if nothing was computed.
    pub load_imbalance: f64,
    /// The share of all pairs that the busiest node of the run was given.
    pub busiest_share: f64,
    /// Of the optimisations in which a node had rovers to plan for, the share in which its processor was
    /// still at work when the time was over.
    pub late_optimisations: f64,
    /// Of what had to be computed in an iteration of max-plus, the share that was handed over to
    /// neighbours; 0 without `network.outsourcing`.
    pub outsourced: f64,
    /// Deadlocks that nodes' probes confirmed; 0 unless `network.deadlock_probes` sends any.
    pub confirmed_deadlocks: u32,
    /// The last of them: each rover waits for the next, the last for the first.
    pub last_confirmed: Option<String>,
    /// Nodes that the `coupled` policy's search expanded before the start.
    pub plan_expansions: u64,
    /// When the last node knew the roadmap, where nodes are given it over the network \[s\]; none if
    /// some never did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roadmap_known_s: Option<f64>,
    /// Times a neighbour took over the vertices of a node that had fallen silent.
    pub takeovers: u32,
    /// Which node was replaced by which, and in which cycle, in order.
    pub taken_over: Vec<String>,
    /// Why rovers are still out, for a team that came to a standstill: how many, and where the
    /// first of them stands; who waits for whom in the shortest of `wait_cycles`, or how many rovers
    /// move in vain.
    pub standstill: Option<String>,
    /// The circles of rovers that wait for each other when a team of the `paper` policy came to a
    /// standstill: each for the one on the next vertex of its shortest way. The shortest first.
    pub wait_cycles: Vec<WaitCycle<VertexId>>,
}
