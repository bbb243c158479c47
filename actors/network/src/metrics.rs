//! What a run of the network-guided system amounts to, in numbers: the paper's metrics (section 4)
//! and what they leave out.

mod catalogue;

use std::sync::OnceLock;

use farside_worlds::VertexId;
use serde::Serialize;

use farside_actors::invariants::{Collision, WaitCycle};
use farside_actors::system::{Metric, with_about};

/// What runs can be measured by, each with what its field says.
pub(crate) fn all() -> &'static [Metric] {
    static ALL: OnceLock<Vec<Metric>> = OnceLock::new();
    ALL.get_or_init(|| {
        let about = |field: &str| NetworkMetrics::about(field).or_else(|| Costs::about(field));
        with_about(&catalogue::ALL, about)
    })
}

/// How a run ended.
#[derive(Serialize, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It was ended from outside, as by `until`.
    #[default]
    Unfinished,
    /// All rovers that have a way arrived.
    Arrived,
    /// Some rover could not arrive any more, and nothing moved or came nearer any more.
    Deadlock,
    /// Nothing moved or came nearer for so long that the run was ended, which proves nothing.
    NoProgress,
    /// After `network.cycle_limit` cycles.
    CycleLimit,
}

/// Whether a team came to a deadlock: whether it is certain that it would never have arrived.
///
/// It is, when the run ended, if a rover that had not arrived stood among others so that each
/// vertex beside any of them was held by one of them; or was down, and was not to be restarted; or
/// had no plan, of a policy that plans before the start. A vertex is granted only when it is free,
/// and no message, repetition or timer frees one of theirs.
#[derive(Serialize, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum Deadlock {
    /// That is not certain.
    #[default]
    None,
    /// It is.
    Passive,
}

/// What a team did that was ended for want of progress, without being certain not to arrive.
#[derive(Serialize, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum NoProgress {
    /// It was not.
    #[default]
    None,
    /// It stood: no rover moved or entered for `network.deadlock_window`.
    Standing,
    /// Rovers moved, and came no nearer to their goals for `network.livelock_window`: what the
    /// network-guided paper calls an active deadlock.
    Moving,
}

farside_actors::documented! {
    /// The result of a run. Means are over the rovers that arrived, and 0 if none did.
    ///
    /// ```
    /// use farside_network::{Deadlock, NetworkMetrics};
    /// let metrics = NetworkMetrics::default();
    /// assert_eq!((metrics.arrived, metrics.deadlock), (0, Deadlock::None));
    /// ```
    #[derive(Serialize, Clone, Debug, Default, PartialEq)]
    pub struct NetworkMetrics {
        /// Rovers in the team.
        pub rovers: u32,
        /// Rovers that reached their goals; where they stay there: that stand there at the end.
        pub arrived: u32,
        /// Rovers that gaps in the coverage leave without a way; they never enter.
        pub refused: u32,
        /// Who they are, and why.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub refused_missions: Vec<String>,
        /// Every rover reached its goal.
        pub completed: bool,
        /// How the run ended.
        pub outcome: Outcome,
        /// The team came to a deadlock that is certain, see `deadlock`.
        pub deadlocked: bool,
        /// It came to a deadlock, or was ended for want of progress: what the network-guided paper
        /// counts as deadlocks, passive and active ones.
        ///
        /// Source: the network-guided paper, section 4.
        pub stuck: bool,
        /// When each rover reached its goal, in seconds of virtual time, rover by rover; none for
        /// those that had not when the run ended.
        pub arrival_s: Vec<Option<f64>>,
        /// What links charged all rovers for what they transmitted, each until the last change that
        /// it recorded \[J\]; 0 unless links have a `tx_power`.
        pub transmit_energy_j: f64,
        /// Times a rover claimed a vertex that another one had, or took an edge against another.
        pub collisions: u32,
        /// The first of them: when, who, where.
        pub collided: Vec<Collision<VertexId>>,
        /// Whether the team came to a deadlock.
        pub deadlock: Deadlock,
        /// The rovers that can never move again, for a team that came to a deadlock: of those that
        /// stand each has only others of them beside it. Empty if the deadlock has another reason.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub locked_rovers: Vec<String>,
        /// What the team did, if the run was ended for want of progress.
        pub no_progress: NoProgress,
        /// For how many cycles it then had made none; 0 otherwise.
        pub no_progress_cycles: u32,
        /// Cycles in which at least one rover was kept from a vertex that its path entered.
        pub interventions: u32,
        /// The same as a share of all cycles.
        ///
        /// Source: the network-guided paper, section 4.
        pub intervention_rate: f64,
        /// Steps from entry to goal over the shortest path's length (the paper's path ratio; stops
        /// are steps). Gamed by whatever holds rovers back before they enter: see `time_ratio`.
        ///
        /// Source: the network-guided paper, section 4.
        pub path_ratio: f64,
        /// Cycles from the start of the run to the goal over the shortest path's length. In
        /// continuous motion: the time of the arrival over the least time from entry to goal for a
        /// rover that is alone, stands at both, and never stops between. At least 1 either way.
        pub time_ratio: f64,
        /// Cycles from entry to goal.
        pub mean_steps: f64,
        /// Cycles from entry to goal, summed over the rovers that arrived: the paper's total
        /// solution length (Figure 5), if all did.
        ///
        /// Source: the network-guided paper, Figure 5.
        pub total_steps: u64,
        /// Cycles between entry and goal in which the rover did not set out.
        pub mean_stops: f64,
        /// Cycles in the queue at the entry, which are neither steps nor stops.
        pub mean_queued: f64,
        /// Moves back to the vertex just left.
        pub mean_backtracks: f64,
        /// Cycles until the last rover arrived, or the run ended.
        pub cycles: u32,
        /// Messages that links were given, lost ones included and copies not, for each rover of the
        /// team in each cycle.
        pub messages_per_rover_cycle: f64,
        /// The encoded size of the same, headers not included \[B\].
        pub bytes_per_rover_cycle: f64,
        /// Max-plus iterations of a node that plans for rovers, in a cycle.
        pub max_plus_iterations: f64,
        /// Pairs of candidate paths that a node's processor was given to look at in a cycle, in the
        /// mean of all nodes, also of those that had no rovers.
        pub pairs_per_cycle: f64,
        /// The same of the node that was given most in each cycle, in the mean of the cycles.
        pub peak_load: f64,
        /// How uneven loads were: `peak_load` over `pairs_per_cycle`, 1 if all nodes were given the
        /// same; 0 if nothing was computed.
        pub load_imbalance: f64,
        /// The share of all pairs that the busiest node of the run was given.
        pub busiest_share: f64,
        /// Of the optimisations in which a node had rovers to plan for, the share in which its
        /// processor was still at work when the time was over.
        pub late_optimisations: f64,
        /// Of what had to be computed in an iteration of max-plus, the share that was handed over
        /// to neighbours; 0 without `network.max_plus.outsourcing`.
        pub outsourced: f64,
        /// Circles of rovers that wait for each other which nodes' probes confirmed, as nodes knew
        /// them then; they may dissolve, and are no proof of a `deadlock`. 0 unless
        /// `network.max_plus.deadlock_probes` sends any.
        pub confirmed_deadlocks: u32,
        /// The last of them: each rover waits for the next, the last for the first.
        pub last_confirmed: Option<String>,
        /// Nodes that the `coupled` policy's search expanded before the start.
        pub plan_expansions: u64,
        /// When the last node knew the roadmap, where nodes are given it over the network \[s\];
        /// none if some never did.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub roadmap_known_s: Option<f64>,
        /// Times a neighbour took over the vertices of a node that had fallen silent.
        pub failovers: u32,
        /// Which node was replaced by which, and in which cycle, in order.
        pub failed_over: Vec<String>,
        /// Why the run was ended with rovers out: how many, and where the first of them stands; who
        /// waits for whom in the shortest of `wait_cycles`, or what makes a deadlock certain, or
        /// how many rovers move in vain.
        pub deadlock_reason: Option<String>,
        /// The circles of rovers that wait for each other when a team came to a deadlock, or was
        /// ended for want of progress: no rover on one can come nearer to its goal before the next
        /// one moves, but where there is no deadlock one may still go aside. The shortest first.
        /// Pictures of the run name the same.
        pub wait_cycles: Vec<WaitCycle<VertexId>>,
        /// What published solvers are compared by; only where rovers stay at their goals.
        #[serde(flatten)]
        pub costs: Option<Costs>,
    }
}

farside_actors::documented! {
    /// The costs of a solution as the literature on multi-agent path-finding has them (Stern et
    /// al., *Multi-agent pathfinding*, SoCS 2019), in time steps, each a planning cycle.
    ///
    /// A rover's cost is the step at which it comes to its goal for the last time, to the nearest,
    /// so that the milliseconds a message takes are no step; 0 if it never leaves it. Each move is
    /// a step at least, also one that was granted ahead of its time. Rovers that wait need not wait
    /// for whole steps: only with `network.grants_ahead = 0` is none ever ahead of the steps of its
    /// plan.
    ///
    /// ```
    /// use farside_network::Costs;
    /// let costs = Costs::new(&[(Some(3), 3), (Some(6), 5)]);
    /// assert_eq!((costs.sum_of_costs, costs.sum_of_costs_bound), (Some(9), 8));
    /// assert_eq!((costs.makespan, costs.makespan_bound), (Some(6), 5));
    /// assert_eq!(costs.suboptimality, Some(1.125));
    /// assert_eq!(Costs::new(&[(None, 3)]).sum_of_costs, None);
    /// ```
    #[derive(Serialize, Clone, Copy, Debug, Default, PartialEq)]
    pub struct Costs {
        /// The sum of all rovers' costs; none unless all stand at their goals at the end.
        ///
        /// Source: Stern et al., *Multi-agent pathfinding*, SoCS 2019.
        pub sum_of_costs: Option<u64>,
        /// No solution's sum is less: the edges of all rovers' shortest paths. A `.scen` file's
        /// lengths are others, because they have diagonal steps.
        pub sum_of_costs_bound: u64,
        /// The largest cost; none unless all stand at their goals at the end.
        ///
        /// Source: Stern et al., *Multi-agent pathfinding*, SoCS 2019.
        pub makespan: Option<u32>,
        /// No solution's makespan is less: the edges of the longest of the shortest paths.
        pub makespan_bound: u32,
        /// The sum over its bound, which is at least the sum over the best one: what papers print.
        /// None where there is no sum, or nobody has anywhere to go.
        ///
        /// Source: Stern et al., *Multi-agent pathfinding*, SoCS 2019.
        pub suboptimality: Option<f64>,
    }
}

impl Costs {
    /// Of rovers' costs, none for those that do not stand at their goals, and shortest paths'
    /// edges.
    pub fn new(rovers: &[(Option<u32>, u32)]) -> Costs {
        let shortest = rovers.iter().map(|&(_, edges)| edges);
        let sum_of_costs_bound: u64 = shortest.clone().map(u64::from).sum();
        let all: Option<Vec<u32>> = rovers.iter().map(|&(cost, _)| cost).collect();
        let sum_of_costs = all
            .as_ref()
            .map(|all| all.iter().copied().map(u64::from).sum());
        let moves = sum_of_costs.filter(|_| sum_of_costs_bound > 0);
        Costs {
            sum_of_costs,
            sum_of_costs_bound,
            makespan: all.map(|all| all.into_iter().max().unwrap_or(0)),
            makespan_bound: shortest.max().unwrap_or(0),
            suboptimality: moves.map(|sum: u64| sum as f64 / sum_of_costs_bound as f64),
        }
    }
}
