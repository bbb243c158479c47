//! Reads any text as a problem of the rover's model. Whatever it is, there are findings or a
//! problem whose names are those of the model.
#![no_main]

use std::sync::OnceLock;

use farside_planning::language::{Options, Severity, read_model, read_problem};
use farside_planning::model::Model;
use libfuzzer_sys::fuzz_target;

const ROVER: &str = include_str!("../../actors/planning/models/rover.ddl");

static MODEL: OnceLock<Model> = OnceLock::new();

fuzz_target!(|bytes: &[u8]| {
    let options = Options::default();
    let model = MODEL.get_or_init(|| read_model("rover.ddl", ROVER, &options).ok().expect("right"));
    let text = String::from_utf8_lossy(bytes);
    let read = read_problem("problem.ddl", &text, model, &options);
    let is_error = read.findings.iter().any(|finding| finding.severity == Severity::Error);
    assert_eq!(read.value.is_none(), is_error);
    let Some(problem) = read.value else { return };
    for goal in &problem.goals {
        assert!(!goal.start.is_empty() && !goal.finish.is_empty() && !goal.duration.is_empty());
        assert!(goal.weight.is_none_or(f64::is_finite));
        for &timeline in &goal.pattern.timelines {
            assert!(model.timelines[timeline].predicates.contains(&goal.pattern.predicate));
        }
    }
    for combination in &problem.combinations {
        assert!(combination.goals.iter().all(|&goal| goal < problem.goals.len()));
    }
});
