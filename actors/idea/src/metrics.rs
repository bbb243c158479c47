//! What a run of IDEA amounts to.

mod catalogue;

use std::sync::OnceLock;

use farside::SimTime;
use farside_actors::system::{Metric, Results, Series, with_about};
use serde::Serialize;

use crate::monitor::{AgentTally, Bin, Load, Tally, Watched};

/// What runs can be measured by, each with what its field says.
pub(crate) fn all() -> &'static [Metric] {
    static ALL: OnceLock<Vec<Metric>> = OnceLock::new();
    ALL.get_or_init(|| with_about(&catalogue::ALL, IdeaMetrics::about))
}

farside_actors::documented! {
    /// What came of a run.
    #[derive(Clone, Debug, Default, Serialize)]
    pub struct IdeaMetrics {
        /// Goals that the ground has sent or would have, over all rovers.
        pub goals_total: u32,
        /// Goals that a system agent reported as done.
        pub goals_achieved: u32,
        /// Goals that were done once more after they had been done.
        pub goals_repeated: u32,
        /// Goals that a mission agent gave up.
        pub goals_given_up: u32,
        /// Whether all goals were achieved.
        pub complete: bool,
        /// When the last goal was achieved \[s\].
        pub achieved_after_s: Option<f64>,
        /// Alarms of all kinds.
        pub alarms: u32,
        /// How often a rover went on after an alarm.
        pub recoveries: u32,
        /// The longest that news waited until its answer left, in latencies of the agent: below 2 by
        /// section 2 of the paper.
        pub max_response_lambda: f64,
        /// How often an agent was found faulty.
        pub faulty_agents: u32,
        /// Cycles of all agents.
        pub cycles: u64,
        /// Cycles that were aborted, since they took too many operations.
        pub aborted_cycles: u64,
        /// Decisions of the planner in a cycle, in the mean over all agents.
        pub mean_decisions: f64,
        /// Decisions that were taken back.
        pub backtracks: u64,
        /// Statuses of contracts that were over when they were read.
        pub stale_statuses: u64,
        /// The most tokens in a plan database after a cycle.
        pub database_tokens: u32,
        /// The longest that a cycle took of its latency.
        pub max_cycle_lambda: f64,
        /// The most that a cycle took \[operations\]: divided by a processor's operations a second it is
        /// the least latency that would do.
        pub max_cycle_operations: u64,
        /// What reactive cycles took, over all agents and cycles \[operations\].
        pub operations: u64,
        /// What deliberation took \[operations\].
        pub deliberation_operations: u64,
        /// The share of the time in which a processor was busy with cycles, the greatest of all agents.
        pub busy_share: f64,
        /// The greatest share of a bin of time in which a processor was busy, cycles and deliberation
        /// together, over all agents.
        pub busy_share_deliberating: f64,
        /// For how long rovers drove after their lease had ended: 0 in every run.
        pub driving_without_lease_s: f64,
    }
}

/// What came of a run that ended at `end`.
pub(crate) fn results(watched: &Watched, tally: &mut Tally, end: SimTime) -> Results {
    let metrics = figures(watched, tally, end);
    let mut results = Results::of(&metrics);
    for (agent, of_agent) in watched.agents.iter().zip(&tally.agents) {
        // The system agent of the first rover is the one of Figures 6 and 7.
        if agent.commands {
            results = with_series(results, &of_agent.load);
            break;
        }
    }
    lines(&mut results, &metrics, watched, tally);
    if metrics.driving_without_lease_s > 0.0 {
        let driven_s = metrics.driving_without_lease_s;
        let sentence = format!("a rover drove for {driven_s} s after its lease had ended");
        results.violations.push(sentence);
    }
    if metrics.goals_repeated > 0 {
        let repeated = metrics.goals_repeated;
        results
            .violations
            .push(format!("{repeated} goals were done more than once"));
    }
    results
}

fn figures(watched: &Watched, tally: &mut Tally, end: SimTime) -> IdeaMetrics {
    let driven = tally
        .driving
        .iter_mut()
        .map(|rover| rover.without_lease(end));
    let driving_without_lease_s = driven.map(|time| time.as_secs_f64()).sum();
    let sum = |of: fn(&AgentTally) -> u64| tally.agents.iter().map(of).sum::<u64>();
    let most = |of: &dyn Fn(&AgentTally, f64) -> f64| {
        let agents = tally.agents.iter().zip(&watched.agents);
        let each = agents.map(|(tally, agent)| of(tally, agent.latency.as_nanos() as f64));
        each.fold(0.0, f64::max)
    };
    let cycles = sum(|one| one.cycles);
    let goals_total = watched.goals as u32;
    let goals_achieved = tally.done.len() as u32;
    IdeaMetrics {
        goals_total,
        goals_achieved,
        goals_repeated: tally.done.values().map(|times| times - 1).sum(),
        goals_given_up: tally.given_up,
        complete: goals_achieved == goals_total,
        achieved_after_s: tally.last_done.map(|at| at.as_secs_f64()),
        alarms: sum(|one| one.alarms.into()) as u32,
        recoveries: sum(|one| one.recoveries.into()) as u32,
        max_response_lambda: most(&|one, latency| one.max_response_ns as f64 / latency),
        faulty_agents: sum(|one| one.faulty.into()) as u32,
        cycles,
        aborted_cycles: sum(|one| one.aborted),
        mean_decisions: sum(|one| one.decisions) as f64 / (cycles.max(1)) as f64,
        backtracks: sum(|one| one.backtracks),
        stale_statuses: sum(|one| one.stale),
        database_tokens: tally.agents.iter().map(|one| one.tokens).max().unwrap_or(0),
        max_cycle_lambda: most(&|one, latency| one.max_cost_ns as f64 / latency),
        max_cycle_operations: tally
            .agents
            .iter()
            .map(|one| one.max_operations)
            .max()
            .unwrap_or(0),
        operations: sum(|one| one.operations),
        deliberation_operations: sum(|one| one.deliberation),
        busy_share: most(&|one, latency| one.busy_ns as f64 / (latency * one.cycles.max(1) as f64)),
        busy_share_deliberating: most(&|one, _| {
            let bins = one.load.bins.iter().filter(|bin| bin.cycles > 0);
            let shares = bins.map(|bin| {
                let busy_ns = bin.busy_ns + bin.deliberating_ns;
                busy_ns as f64 / bin.span_ns as f64
            });
            shares.fold(0.0, f64::max)
        }),
        driving_without_lease_s,
    }
}

/// The paper's two figures, and what the plan database holds.
fn with_series(results: Results, load: &Load) -> Results {
    let bin_s = load.bin().as_secs_f64();
    let index: Vec<f64> = (0..load.bins.len()).map(|at| at as f64 * bin_s).collect();
    let series = |of: fn(&Bin) -> f64| {
        let each = load
            .bins
            .iter()
            .map(|bin| (bin.cycles > 0).then(|| of(bin)));
        Series::new(index.clone(), each.collect()).unwrap_or_default()
    };
    results
        .metric(
            "busy_by_time",
            series(|bin| bin.busy_ns as f64 / bin.span_ns as f64),
        )
        .metric("cycle_by_time", series(|bin| bin.longest_ns as f64 / 1e9))
        .metric("operations_by_time", series(|bin| bin.most as f64))
        .metric("tokens_by_time", series(|bin| f64::from(bin.tokens)))
}

fn lines(results: &mut Results, metrics: &IdeaMetrics, watched: &Watched, tally: &Tally) {
    let of = |done: u32, all: u32| format!("{done} of {all}");
    results.line(
        "goals achieved",
        of(metrics.goals_achieved, metrics.goals_total),
    );
    if metrics.alarms > 0 {
        let recovered = format!("{}, recovered {}", metrics.alarms, metrics.recoveries);
        results.line("alarms", recovered);
    }
    results.line(
        "longest response",
        format!("{:.3} latencies", metrics.max_response_lambda),
    );
    let longest = format!("{:.3} latencies", metrics.max_cycle_lambda);
    results.line("longest cycle", longest);
    results.line("busy", format!("{:.1} %", 100.0 * metrics.busy_share));
    if metrics.faulty_agents > 0 {
        results.line("faulty agents", metrics.faulty_agents.to_string());
    }
    for (agent, tally) in watched.agents.iter().zip(&tally.agents) {
        let Some(peak) = tally.load.peaks.first().filter(|_| agent.commands) else {
            continue;
        };
        let (operations, at) = (peak.operations, peak.at.since(SimTime::ZERO));
        let text = format!("{operations} operations at {at}: {}", peak.cause.name());
        results.line(format!("dearest cycle of {}", agent.name), text);
    }
}
