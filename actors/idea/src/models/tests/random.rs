//! There is a plan whatever happens.

use super::*;
use crate::models::plant::{Chances, Plant};
use crate::service::PlanService;

/// Runs a plant, and says what it did.
fn run(system: &System, seed: u64, ticks: i64) -> Plant<Temporal> {
    let mut plant = Plant::new(temporal(system), system, Chances::WILD, seed);
    for tick in 0..ticks {
        if let Err(why) = plant.step(tick) {
            let says = |timeline| plant.service.present(timeline);
            let all: Vec<String> = (0..system.model.timelines.len())
                .filter_map(says)
                .map(|at| {
                    let name = &system.model.predicates[at.predicate].name;
                    std::format!("{name} {:?} since {}", at.parameters, at.start)
                })
                .collect();
            panic!("seed {seed}, tick {tick}: {why}\n{}", all.join("\n"));
        }
    }
    plant
}

#[test]
fn there_is_a_plan_whatever_happens() {
    for seed in 0..20 {
        let plant = run(system(), seed, 5_000);
        println!(
            "{seed} {:?} stale {}",
            plant.service.counters(),
            plant.stale
        );
    }
}
