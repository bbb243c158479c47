//! Reads any bytes as a project in ProGen/max's format. Whatever the bytes, there is an error that
//! names a line of the file, or a problem whose goals and orders name what is there.
#![no_main]

use farside_planning::sch::{self, SchError};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match sch::read("x.sch", bytes) {
        Ok((model, problem)) => {
            let parameters = model.resources.len() + 1;
            assert_eq!(model.predicates[0].parameters.len(), parameters);
            assert!(problem.horizon >= 0);
            let goals = problem.goals.len();
            assert!(problem.goals.iter().all(|goal| goal.pattern.arguments.len() == parameters));
            assert!(problem.orders.iter().all(|order| order.from < goals && order.to < goals));
        }
        Err(error) => {
            let lines = bytes.iter().filter(|byte| **byte == b'\n').count() + 1;
            match error {
                SchError::Line { line, .. } => assert!((1..=lines).contains(&line), "{error}"),
                SchError::TooLarge { .. } => {}
            }
        }
    }
});
