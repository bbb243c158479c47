//! There is a plan whatever happens.

use super::*;
use crate::models::plant::{Chances, Plant};
use crate::service::PlanService;

/// Runs a plant for so many ticks.
pub(super) fn run(system: &System, chances: Chances, seed: u64, ticks: i64) -> Plant<Temporal> {
    let mut plant = Plant::new(temporal(system), system, chances, seed);
    for tick in 0..ticks {
        if let Err(why) = plant.step(tick) {
            let says = |timeline| plant.service.present(timeline);
            let all: Vec<String> = (0..system.model.timelines.len())
                .filter_map(says)
                .map(|at| {
                    let name = &system.model.predicates[at.predicate].name;
                    format!("{name} {:?} since {}", at.parameters, at.start)
                })
                .collect();
            panic!("seed {seed}, tick {tick}: {why}\n{}", all.join("\n"));
        }
    }
    plant
}

fn all_runs(runs: u64, ticks: i64) {
    for seed in 0..runs {
        let thorough = run(system(), Chances::WILD, seed, ticks);
        assert_eq!(thorough.service.counters().backtracks, 0, "seed {seed}");
        run(light(), Chances::WILD, seed, ticks);
    }
}

#[test]
fn there_is_a_plan_whatever_happens() {
    all_runs(20, 5_000);
}

/// The figure of the docs; in a release build half a minute.
#[test]
#[ignore = "ten times as many runs as usual"]
fn there_is_a_plan_whatever_happens_in_200_runs() {
    all_runs(200, 5_000);
}

#[test]
#[ignore = "for a profiler"]
fn calm() {
    run(system(), Chances::CALM, 1, 2_000);
}
