//! There is a plan whatever happens.

use super::*;
use crate::models::plant::{Chances, Plant};

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

/// Both models have a plan in each cycle, and decide alike.
fn all_runs(runs: u64, ticks: i64) {
    for seed in 0..runs {
        let mut thorough = Plant::new(temporal(system()), system(), Chances::WILD, seed);
        let mut lighter = Plant::new(temporal(light()), light(), Chances::WILD, seed);
        for tick in 0..ticks {
            for (name, plant) in [("thorough", &mut thorough), ("light", &mut lighter)] {
                if let Err(why) = plant.step(tick) {
                    panic!("seed {seed}, tick {tick}, {name}: {why}");
                }
            }
            let [one, other] = [&thorough, &lighter].map(|plant| plant.service.started());
            assert_eq!(one, other, "seed {seed}, tick {tick}");
            let [one, other] = [&thorough, &lighter].map(|plant| plant.service.ended());
            assert_eq!(one, other, "seed {seed}, tick {tick}");
        }
        assert_eq!(thorough.service.counters().backtracks, 0, "seed {seed}");
        assert!(lighter.service.counters().backtracks > 0, "seed {seed}");
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
