//! What cycles cost, counted, and what makes them cost more.

use super::*;
use crate::models;
use crate::models::plant::{Chances, Plant};
use crate::service::temporal::{MergeScan, Propagation};

fn plant(options: TemporalOptions, seed: u64) -> Plant<Temporal> {
    let system = models::system();
    let service = Temporal::new(system.model.clone(), options).expect("the model fits");
    Plant::new(service, system, Chances::WILD, seed)
}

/// Runs so many ticks, and gives the operations of the first and of the last tenth.
fn tenths(plant: &mut Plant<Temporal>, ticks: Ticks) -> [u64; 2] {
    let mut spent = [0; 2];
    for tick in 0..ticks {
        let before = plant.service.counters().operations;
        plant.step(tick).expect("there always is a plan");
        let cost = plant.service.counters().operations - before;
        if tick < ticks / 10 {
            spent[0] += cost;
        } else if tick >= ticks - ticks / 10 {
            spent[1] += cost;
        }
    }
    spent
}

/// A day at 2 Hz.
#[test]
fn a_day_with_deletion_costs_the_same_to_its_end() {
    let mut plant = plant(TemporalOptions::default(), 1);
    let [first, last] = tenths(&mut plant, 172_800);
    assert!(last * 100 <= first * 105, "{first} and {last}");
    assert!(plant.service.counters().tokens <= 30);
}

/// Section 4 of the paper, by its causes: without deletion tokens grow, and cost grows only where
/// the past is revisited.
#[test]
fn without_deletion_cost_grows_where_the_past_is_revisited() {
    let cost = |deletes, merge_scan, propagation| {
        let options = TemporalOptions {
            deletes,
            merge_scan,
            propagation,
            ..TemporalOptions::default()
        };
        let mut plant = plant(options, 2);
        let [first, last] = tenths(&mut plant, 500);
        (last as f64 / first as f64, plant.service.counters().tokens)
    };
    let (flat, tokens) = cost(false, MergeScan::Near, Propagation::Incremental);
    assert!(flat < 1.4 && tokens > 800, "{flat}, {tokens}");
    let (scan, _) = cost(false, MergeScan::All, Propagation::Incremental);
    let (full, _) = cost(false, MergeScan::Near, Propagation::Full);
    let (deleted, _) = cost(true, MergeScan::All, Propagation::Full);
    assert!(
        scan > 1.5 && full > 10.0 && deleted < 2.0,
        "{scan}, {full}, {deleted}"
    );
}

/// Neither deletion nor how much is looked at changes a decision.
#[test]
fn decisions_are_the_same_whatever_is_looked_at() {
    for seed in 0..3 {
        let mut plants: Vec<Plant<Temporal>> = Vec::new();
        for deletes in [true, false] {
            for merge_scan in [MergeScan::Near, MergeScan::All] {
                for propagation in [Propagation::Incremental, Propagation::Full] {
                    let options = TemporalOptions {
                        deletes,
                        merge_scan,
                        propagation,
                        guess: false,
                    };
                    plants.push(plant(options, seed));
                }
            }
        }
        for tick in 0..400 {
            for plant in &mut plants {
                plant.step(tick).expect("there always is a plan");
            }
            for other in &plants[1..] {
                assert_eq!(other.service.started(), plants[0].service.started());
                assert_eq!(other.service.ended(), plants[0].service.ended());
            }
        }
    }
}

/// A horizon costs operations, and, where nothing needs a choice, changes no decision.
#[test]
fn a_longer_horizon_costs_more() {
    let mut spent = Vec::new();
    let mut said = Vec::new();
    for (horizon, guess) in [(1, false), (2, false), (4, false), (8, false), (8, true)] {
        let options = TemporalOptions {
            guess,
            ..TemporalOptions::default()
        };
        let mut service = Temporal::new(read(TEXT), options).expect("the model fits");
        let mut trace = Vec::new();
        for tick in 0..60 {
            service.advance(tick);
            if tick % 9 == 1 {
                let poll = service.present(2).expect("it polls").contract;
                let outputs = [None, Some(tick % 50), Some(1)];
                service.bind(poll, &outputs, true).expect("it is active");
            }
            assert_eq!(service.solve(horizon, BUDGET), Outcome::Decided);
            service.forget(tick);
            trace.extend_from_slice(service.started());
        }
        spent.push(service.counters().operations);
        said.push(trace);
    }
    assert!(said.iter().all(|at| *at == said[0]));
    assert!(
        spent.windows(2).take(3).all(|pair| pair[1] > pair[0]),
        "{spent:?}"
    );
}
