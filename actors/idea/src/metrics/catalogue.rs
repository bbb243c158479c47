//! What runs of IDEA can be measured by.

use farside_actors::system::Better::{Higher, Lower, Neither};
use farside_actors::system::Metric;
use farside_actors::system::MetricKind::{Number, Rate, Series};
use farside_actors::system::SeriesIndex;

/// The index of curves over the time of the run.
const TIME: SeriesIndex = SeriesIndex {
    label: "time",
    unit: "s",
    lengths_differ: true,
};

/// Sorted by name.
pub(crate) const ALL: [Metric; 27] = [
    Metric::new("aborted_cycles", "aborted cycles", "", Number, Lower),
    Metric::new("achieved_after_s", "time until the last goal is achieved", "s", Number, Lower),
    Metric::new("alarms", "alarms", "", Number, Neither),
    Metric::new("backtracks", "decisions taken back", "", Number, Lower),
    Metric::new("busy_by_time", "busy share of the processor by time", "", Series(TIME), Lower)
        .about("The share of each bin of time in which the first system agent's processor was busy with cycles.")
        .source("IDEA paper, Figure 6"),
    Metric::new("busy_share", "busy share of the processor", "", Number, Lower),
    Metric::new("busy_share_deliberating", "busy share while deliberating", "", Number, Lower),
    Metric::new("complete", "all goals achieved", "", Rate, Higher),
    Metric::new("cycle_by_time", "longest cycle by time", "s", Series(TIME), Lower)
        .about("The longest cycle of the first system agent in each bin of time.")
        .source("IDEA paper, Figure 7"),
    Metric::new("cycles", "cycles", "", Number, Neither),
    Metric::new("database_tokens", "tokens in the plan database", "", Number, Lower),
    Metric::new("deliberation_operations", "operations of deliberation", "", Number, Lower),
    Metric::new("driving_without_lease_s", "driving without a lease", "s", Number, Lower),
    Metric::new("faulty_agents", "faulty agents", "", Number, Lower),
    Metric::new("goals_achieved", "goals achieved", "", Number, Higher),
    Metric::new("goals_given_up", "goals given up", "", Number, Lower),
    Metric::new("goals_repeated", "goals done more than once", "", Number, Lower),
    Metric::new("goals_total", "goals", "", Number, Neither),
    Metric::new("max_cycle_lambda", "longest cycle, in latencies", "", Number, Lower),
    Metric::new("max_cycle_operations", "operations of the dearest cycle", "", Number, Lower),
    Metric::new("max_response_lambda", "longest response, in latencies", "", Number, Lower),
    Metric::new("mean_decisions", "decisions a cycle", "", Number, Neither),
    Metric::new("operations", "operations of cycles", "", Number, Lower),
    Metric::new("operations_by_time", "operations of the dearest cycle by time", "", Series(TIME), Lower)
        .about("The most operations that a cycle of the first system agent took in each bin of time."),
    Metric::new("recoveries", "recoveries", "", Number, Neither),
    Metric::new("stale_statuses", "stale statuses", "", Number, Lower),
    Metric::new("tokens_by_time", "tokens in the plan database by time", "", Series(TIME), Lower)
        .about("The most tokens in the first system agent's plan database in each bin of time."),
];
