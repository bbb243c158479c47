//! The problem that is exported is the one that is planned, and what is proved of it is told to its runs.

use farside::random::RandomKey;
use farside_actors::system::System;
use farside_misus::PlanningSystem;
use farside_misus::planner::casper::PlannerConfig;
use farside_misus::planner::instance::Instance;
use farside_misus::planner::problem::Problem;
use farside_misus::planner::rounds::run;

use super::scenario::Run;
use super::synchronised::assert_equal;

#[test]
fn what_is_exported_is_what_is_planned() {
    assert!(PlanningSystem.problem().is_some());
    for (text, problem) in [("", 7), ("problem = { rocks_most = 12, joint = 0.4 }", 8)] {
        let scenario = Run {
            text,
            problem,
            seed: 3,
            ..Run::default()
        };
        let exported = Problem::from_json(&scenario.exported()).unwrap();
        let instance = Instance::new(&exported).unwrap();
        let config = PlannerConfig::default();
        let rounds = run(&exported, &instance, &config, RandomKey::new(3)).unwrap();
        assert_equal(&scenario.run(), &rounds);
    }
}

#[test]
fn a_proven_bound_is_told_to_the_runs_of_its_problem() {
    let scenario = Run {
        text: "problem = { rocks_most = 12, bounds = \"b.csv\" }",
        ..Run::default()
    };
    let digest = Problem::from_json(&scenario.exported()).unwrap().digest();
    let table = |digest: &str| format!("digest,bound,optimal\n{digest},2000,false\n");
    let with = |table: &str| {
        Run {
            files: &[("b.csv", table)],
            ..scenario
        }
        .tried(Some(farside::SimDuration::from_secs(7200)))
    };
    let known = with(&table(&digest)).unwrap();
    assert_eq!(known.figure("score_bound"), 2000.0);
    let gap = 1.0 - known.figure("score") / 2000.0;
    assert_eq!(known.figure("score_gap"), gap);
    let unknown = with(&table(&"0".repeat(32))).unwrap();
    assert!(unknown.results.metrics["score_bound"].is_null());
    assert!(unknown.results.metrics["score_gap"].is_null());
    let wrong = with("digest,bound\nx,1\n").err().unwrap();
    assert!(
        wrong.starts_with("problem.bounds: b.csv: line 2: digest"),
        "{wrong}"
    );
}
