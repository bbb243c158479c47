//! Reads any bytes as a plan for a small project. Whatever the bytes, there is an error to print, or
//! a plan that is written as it was read, checked and drawn.
#![no_main]

use std::sync::OnceLock;

use farside_planning::checker::{MAX_VIOLATIONS, check};
use farside_planning::draw;
use farside_planning::model::{Model, Problem};
use farside_planning::plan::Plan;
use farside_planning::sch;
use libfuzzer_sys::fuzz_target;

const PSP2: &str = include_str!("../../actors/planning/models/psp2.sch");

fn project() -> &'static (Model, Problem) {
    static PROJECT: OnceLock<(Model, Problem)> = OnceLock::new();
    PROJECT.get_or_init(|| sch::read("psp2.sch", PSP2.as_bytes()).expect("it is one"))
}

fuzz_target!(|bytes: &[u8]| {
    match Plan::from_json(bytes) {
        Ok(plan) => {
            let text = plan.to_json();
            assert_eq!(Plan::from_json(text.as_bytes()).as_ref(), Ok(&plan));
            let (model, problem) = project();
            let violations = check(model, problem, &plan);
            assert!(violations.len() <= MAX_VIOLATIONS);
            assert!(violations.iter().all(|one| !one.to_string().is_empty()));
            assert!(draw::svg(&plan).is_ok_and(|svg| svg.ends_with("</svg>\n")));
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
