//! What runs of the system can be measured by.

use farside_actors::system::Better::{Higher, Lower, Neither};
use farside_actors::system::Metric;
use farside_actors::system::MetricKind::{Number, Rate, Sample, Word};

/// Sorted by name.
pub(crate) const ALL: [Metric; 43] = [
    Metric::new("arrival_s", "time to the goal", "s", Sample, Lower),
    Metric::new("arrived", "rovers at their goals", "rovers", Number, Higher),
    Metric::new(
        "blocked_tasks",
        "tasks without such a way",
        "tasks",
        Number,
        Neither,
    )
    .about(
        "Tasks whose rover has no way that passes no other rover's start or goal; only where rovers \
         stay at their goals.",
    ),
    Metric::new(
        "busiest_share",
        "share of the busiest node in what all computed",
        "",
        Number,
        Neither,
    ),
    Metric::new(
        "bytes_per_rover_cycle",
        "bytes per rover and cycle",
        "B",
        Number,
        Lower,
    ),
    Metric::new("collisions", "collisions", "", Number, Lower),
    Metric::new("completed", "all rovers at their goals", "", Rate, Higher),
    Metric::new(
        "confirmed_deadlocks",
        "circles of waits that probes confirmed",
        "",
        Number,
        Neither,
    ),
    Metric::new("cycles", "planning cycles", "cycles", Number, Lower),
    Metric::new("deadlock", "deadlock", "", Word, Neither),
    Metric::new("deadlocked", "deadlock, proved", "", Rate, Lower),
    Metric::new("failovers", "failovers", "", Number, Neither),
    Metric::new(
        "intervention_rate",
        "cycles with an intervention",
        "",
        Number,
        Lower,
    ),
    Metric::new("interventions", "interventions", "cycles", Number, Lower),
    Metric::new(
        "late_optimisations",
        "optimisations that were not done in time",
        "",
        Number,
        Lower,
    ),
    Metric::new(
        "load_imbalance",
        "busiest node's load over the mean",
        "",
        Number,
        Lower,
    ),
    Metric::new("makespan", "makespan", "steps", Number, Lower),
    Metric::new(
        "makespan_bound",
        "longest shortest path",
        "steps",
        Number,
        Neither,
    ),
    Metric::new(
        "max_plus_iterations",
        "max-plus iterations per cycle",
        "",
        Number,
        Neither,
    ),
    Metric::new("mean_backtracks", "moves back per rover", "", Number, Lower),
    Metric::new(
        "mean_queued",
        "cycles in the queue per rover",
        "cycles",
        Number,
        Lower,
    ),
    Metric::new("mean_steps", "steps per rover", "", Number, Lower),
    Metric::new("mean_stops", "stops per rover", "", Number, Lower),
    Metric::new(
        "messages_per_rover_cycle",
        "messages per rover and cycle",
        "messages",
        Number,
        Lower,
    ),
    Metric::new("no_progress", "no progress", "", Word, Neither),
    Metric::new(
        "no_progress_cycles",
        "cycles without progress that ended the run",
        "cycles",
        Number,
        Neither,
    ),
    Metric::new("outcome", "how the run ended", "", Word, Neither),
    Metric::new(
        "outsourced",
        "share of the work that was handed over",
        "",
        Number,
        Neither,
    ),
    Metric::new(
        "pairs_per_cycle",
        "pairs of paths per node and cycle",
        "pairs",
        Number,
        Neither,
    ),
    Metric::new(
        "path_ratio",
        "steps of those that arrived over the shortest path",
        "",
        Number,
        Lower,
    ),
    Metric::new(
        "peak_load",
        "pairs of paths per cycle at the busiest node",
        "pairs",
        Number,
        Neither,
    ),
    Metric::new(
        "plan_expansions",
        "nodes of the search expanded",
        "",
        Number,
        Neither,
    ),
    Metric::new("refused", "rovers without a way", "rovers", Number, Lower),
    Metric::new(
        "roadmap_known_s",
        "time until all nodes know the roadmap",
        "s",
        Number,
        Neither,
    ),
    Metric::new("rovers", "rovers", "rovers", Number, Neither),
    Metric::new("stuck", "deadlock or no progress", "", Rate, Lower),
    Metric::new(
        "suboptimality",
        "sum of costs over its bound",
        "",
        Number,
        Lower,
    ),
    Metric::new("sum_of_costs", "sum of costs", "steps", Number, Lower),
    Metric::new(
        "sum_of_costs_bound",
        "sum of shortest paths",
        "steps",
        Number,
        Neither,
    ),
    Metric::new(
        "time_ratio",
        "time of those that arrived over the shortest path",
        "",
        Number,
        Lower,
    ),
    Metric::new(
        "total_steps",
        "steps of all rovers that arrived, together",
        "steps",
        Number,
        Lower,
    ),
    Metric::new(
        "transmit_energy_j",
        "energy of the rovers' transmissions",
        "J",
        Number,
        Lower,
    ),
    Metric::new(
        "well_formed",
        "there is a way for every rover, in any order",
        "",
        Rate,
        Neither,
    )
    .about(
        "Whether each rover has a way that passes no other rover's start or goal; only where rovers \
         stay at their goals.",
    )
    .source("Cap, Vokrinek and Kleiner, *Complete decentralized method for on-line multi-robot \
             trajectory planning in well-formed infrastructures*, ICAPS 2015."),
];
