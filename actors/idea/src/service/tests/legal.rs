//! That what is decided is legal, by a checker that shares nothing with who decides.

use proptest::prelude::*;

use super::equal::calm;
use super::random::{Stimuli, shapes};
use super::*;
use crate::models;
use crate::models::plant::{Chances, Plant};
use crate::service::legal::Trace;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn what_is_decided_on_random_models_is_legal(shape in shapes(), seed in any::<u64>()) {
        let model = read(&shape.text());
        let mut service = Temporal::new(model.clone(), TemporalOptions::default()).expect("it fits");
        let mut stimuli = Stimuli::new(&model, seed);
        let mut trace = Trace::new(model);
        for tick in 0..80 {
            service.advance(tick);
            let events = stimuli.next(&service);
            for event in calm(&service, events) {
                let _ = event.post(&mut service);
            }
            if service.solve(1, 1_000_000) != Outcome::Decided {
                break;
            }
            trace.note(&service);
            service.forget(tick);
        }
        let violations = trace.violations(&service);
        prop_assert!(violations.is_empty(), "{}", violations[0]);
    }
}

#[test]
fn what_the_k9_does_is_legal() {
    let system = models::system();
    for seed in 0..4 {
        let service = Compiled::new(system.model.clone()).expect("the model fits");
        let mut plant = Plant::new(service, system, Chances::WILD, seed);
        let mut trace = Trace::new(system.model.clone());
        for tick in 0..600 {
            plant.step(tick).expect("there always is a plan");
            trace.note(&plant.service);
        }
        let violations = trace.violations(&plant.service);
        assert!(violations.is_empty(), "seed {seed}: {}", violations[0]);
    }
}

/// A trace that is not legal is told from one that is.
#[test]
fn a_rule_that_is_broken_is_named() {
    let model = read(TEXT);
    let strict = read(&TEXT.replace(":duration_bounds [3 5]", ":duration_bounds [4 5]"));
    let mut service = Temporal::new(model, TemporalOptions::default()).expect("the model fits");
    let mut trace = Trace::new(strict);
    let ok = { service.model().symbols.iter() }.position(|at| at == "ok");
    let ok = ok.expect("there is one") as Value;
    let drive = { service.model().predicates.iter() }.position(|at| at.name == "Drive");
    for tick in 0..6 {
        service.advance(tick);
        match tick {
            1 => service
                .insert_goal(1, drive.expect("there is one"), &[7])
                .expect("it can start"),
            2 => {
                let contract = service.present(1).expect("it drives").contract;
                service
                    .bind(contract, &[Some(ok)], true)
                    .expect("it is active");
            }
            _ => {}
        }
        assert_eq!(service.solve(1, BUDGET), Outcome::Decided);
        trace.note(&service);
    }
    let violations = trace.violations(&service);
    assert_eq!(violations.len(), 1);
    assert!(
        violations[0].to_string().contains("agent.ddl:27:1"),
        "{}",
        violations[0]
    );
}
