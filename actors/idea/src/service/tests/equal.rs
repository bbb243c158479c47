//! That technologies decide alike: on random models and on a rover's, whatever happens.

use proptest::prelude::*;

use super::random::{Event, Stimuli, shapes};
use super::*;

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
    for (text, least) in [(ROVER, 600), (K9, 6_000)] {
        let model = read(text);
        let mut decided = 0;
        for seed in 0..20 {
            let run = side_by_side(&mut all(&model), seed, 300);
            decided += run.unwrap_or_else(|failed| panic!("seed {seed}: {failed}"));
        }
        assert!(decided >= least, "{decided} cycles were decided");
    }
}

/// What the table has met it decides alone, and as its interpreter does.
#[test]
fn a_table_decides_as_its_interpreter_does() {
    let model = read(K9);
    for seed in 0..4 {
        let propositional = Propositional::new(model.clone()).expect("the model fits");
        let compiled = Compiled::new(model.clone()).expect("the model fits");
        let mut services: Vec<Box<dyn PlanService>> =
            vec![Box::new(propositional), Box::new(compiled)];
        let run = side_by_side(&mut services, seed, 3_000);
        run.unwrap_or_else(|failed| panic!("seed {seed}: {failed}"));
    }
}
