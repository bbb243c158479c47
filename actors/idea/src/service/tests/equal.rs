//! That technologies decide alike: on random models and on a rover's, whatever happens.

use proptest::prelude::*;

use super::random::{Event, Stimuli, shapes};
use super::*;
use crate::models;
use crate::models::plant::{Chances, Plant};

/// The model of a rover's executive.
pub(super) const ROVER: &str = include_str!("../../../../planning/models/executive.ddl");

/// Without the goals that come while a rover recovers, or may begin to: nobody lets it drive then.
pub(super) fn calm(service: &dyn PlanService, mut events: Vec<Event>) -> Vec<Event> {
    let timelines = &service.model().timelines;
    let monitor = timelines
        .iter()
        .position(|at| at.name == "MotionMonitor_SV");
    let Some(monitor) = monitor.and_then(|at| service.present(at)) else {
        return events;
    };
    let nominal = service.model().predicates[monitor.predicate].name == "Nominal";
    let answers =
        |event: &Event| matches!(event, Event::Status(_, outputs, _) if outputs.len() > 1);
    if !nominal || events.iter().any(answers) {
        events.retain(|event| !matches!(event, Event::Goal(..)));
    }
    events
}

/// The model of the K9's system agent.
pub(super) const K9: &str = include_str!("../../../models/k9-system.ddl");

/// Runs technologies side by side, and gives how many cycles all decided.
pub(super) fn side_by_side(
    services: &mut [Box<dyn PlanService>],
    seed: u64,
    ticks: Ticks,
) -> Result<Ticks, TestCaseError> {
    let mut stimuli = Stimuli::new(services[0].model(), seed);
    for tick in 0..ticks {
        let events = match tick {
            0 => Vec::new(),
            _ => stimuli.next(&*services[0]),
        };
        let events = calm(&*services[0], events);
        let (first, others) = services.split_first_mut().expect("there is one");
        first.advance(tick);
        let mut posted = Vec::new();
        for event in &events {
            posted.push(event.post(&mut **first));
        }
        let outcome = first.solve(1, 1_000_000);
        for other in others.iter_mut() {
            other.advance(tick);
            for (event, posted) in events.iter().zip(&posted) {
                prop_assert_eq!(&event.post(&mut **other), posted, "{:?} at {}", event, tick);
            }
            let same = other.solve(1, 1_000_000);
            let alike = std::mem::discriminant(&same) == std::mem::discriminant(&outcome);
            prop_assert!(alike, "{:?} and {:?} at {}", outcome, same, tick);
            prop_assert_eq!(
                other.started(),
                first.started(),
                "at {}: {:?}",
                tick,
                events
            );
            prop_assert_eq!(other.ended(), first.ended(), "at {}: {:?}", tick, events);
            prop_assert_eq!(other.snapshot(), first.snapshot(), "at {}", tick);
            other.forget(tick);
        }
        first.forget(tick);
        if outcome != Outcome::Decided {
            return Ok(tick);
        }
    }
    Ok(ticks)
}

/// A technology of each kind.
fn all(model: &Arc<Model>) -> Vec<Box<dyn PlanService>> {
    let temporal = |deletes| {
        let options = TemporalOptions {
            deletes,
            ..TemporalOptions::default()
        };
        let service = Temporal::new(model.clone(), options).expect("the model fits");
        Box::new(service) as Box<dyn PlanService>
    };
    let propositional = Propositional::new(model.clone()).expect("the model fits");
    let compiled = Compiled::new(model.clone()).expect("the model fits");
    vec![
        temporal(true),
        temporal(false),
        Box::new(propositional),
        Box::new(compiled),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn technologies_decide_alike_on_random_models(shape in shapes(), seed in any::<u64>()) {
        let mut services = all(&read(&shape.text()));
        let decided = side_by_side(&mut services, seed, 120)?;
        prop_assert!(decided == 120 || shape.may_fail());
        let backtracks: Vec<u64> = services.iter().map(|at| at.counters().backtracks).collect();
        prop_assert_eq!(backtracks[0], backtracks[1]);
        prop_assert_eq!(backtracks[0], backtracks[2]);
        prop_assert_eq!(backtracks[0], backtracks[3]);
    }
}

#[test]
fn technologies_decide_alike_on_a_rovers_models() {
    for (text, least) in [(ROVER, 600), (K9, 600)] {
        let model = read(text);
        let mut decided = 0;
        for seed in 0..20 {
            let run = side_by_side(&mut all(&model), seed, 300);
            decided += run.unwrap_or_else(|failed| panic!("seed {seed}: {failed}"));
        }
        assert!(decided >= least, "{decided} cycles were decided");
    }
}

/// What a plant's service decides at a tick.
fn step<S: PlanService>(plant: &mut Plant<S>, tick: Ticks) -> (Vec<Started>, Vec<Ended>) {
    plant.step(tick).expect("there always is a plan");
    let service = &plant.service;
    (service.started().to_vec(), service.ended().to_vec())
}

/// Alarms, time-outs, polls and statuses that are late or lost, goals that are taken back.
#[test]
fn technologies_decide_alike_on_the_k9_whatever_happens() {
    let system = models::system();
    let model = || system.model.clone();
    for seed in 0..3 {
        let temporal = Temporal::new(model(), TemporalOptions::default());
        let temporal = temporal.expect("the model fits");
        let propositional = Propositional::new(model()).expect("the model fits");
        let compiled = Compiled::new(model()).expect("the model fits");
        let mut temporal = Plant::new(temporal, system, Chances::WILD, seed);
        let mut propositional = Plant::new(propositional, system, Chances::WILD, seed);
        let mut compiled = Plant::new(compiled, system, Chances::WILD, seed);
        for tick in 0..3_000 {
            let decided = step(&mut temporal, tick);
            assert_eq!(
                step(&mut propositional, tick),
                decided,
                "seed {seed}, tick {tick}"
            );
            assert_eq!(
                step(&mut compiled, tick),
                decided,
                "seed {seed}, tick {tick}"
            );
        }
        assert!(temporal.stale > 0, "seed {seed}: no status was late");
        assert!(compiled.service.size().transitions > 100);
    }
}

/// What ties times or numbers together only the temporal technology holds; the others say where it is.
#[test]
fn what_a_model_has_that_is_no_proposition_is_named() {
    let model = models::mission().model.clone();
    assert!(Temporal::new(model.clone(), TemporalOptions::default()).is_ok());
    let named = "k9-mission.ddl:";
    let refused = Propositional::new(model.clone()).err();
    let refused = refused.expect("a plan's horizon is reckoned from its start");
    let compiled = Compiled::new(model)
        .err()
        .expect("nor the table")
        .to_string();
    for said in [refused.to_string(), compiled] {
        assert!(
            said.contains(named) && said.contains("(Planning)"),
            "{said}"
        );
        assert!(
            said.contains("only the temporal technology holds this"),
            "{said}"
        );
    }
}

/// What is read in place is what the database decides, whatever is posted.
#[test]
fn what_is_read_from_a_table_in_place_is_what_the_database_decides() {
    let model = read(K9);
    let mut table = Compiled::new(model.clone()).expect("the model fits");
    for seed in 0..12 {
        let temporal = Temporal::new(model.clone(), TemporalOptions::default());
        let mut temporal = temporal.expect("the model fits");
        table = table.restarted().expect("the model fits");
        let mut stimuli = Stimuli::new(&model, seed % 4);
        for tick in 0..300 {
            let events = match tick {
                0 => Vec::new(),
                _ => calm(&temporal, stimuli.next(&temporal)),
            };
            temporal.advance(tick);
            table.advance(tick);
            for event in &events {
                assert_eq!(event.post(&mut temporal), event.post(&mut table));
            }
            let outcome = temporal.solve(1, 1_000_000);
            let same = table.decide(1, 1_000_000);
            assert_eq!(
                std::mem::discriminant(&outcome),
                std::mem::discriminant(&same)
            );
            let started = table.each_started().map(|at| Started {
                contract: at.contract,
                predicate: at.predicate,
                parameters: at.parameters.iter().collect(),
            });
            assert_eq!(started.collect::<Vec<_>>(), temporal.started(), "at {tick}");
            let ended = table.each_ended().map(|at| Ended {
                contract: at.contract,
                predicate: at.predicate,
                start: at.start,
                finish: tick,
                parameters: at.parameters.iter().collect(),
            });
            assert_eq!(ended.collect::<Vec<_>>(), temporal.ended(), "at {tick}");
            temporal.forget(tick);
            if outcome != Outcome::Decided {
                break;
            }
        }
    }
    // The later runs meet what the first ones met, and are decided by the table.
    assert!(table.size().interpreted < 10);
}
