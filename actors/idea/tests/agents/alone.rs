//! The system agent alone, as it was tested on the rover.

use crate::scenario::Run;

const ALONE: &str = include_str!("../../scenarios/k9-alone.toml");

#[test]
fn goals_are_achieved_and_alarms_recovered() {
    let run = Run::of(ALONE, 1, |_| ());
    if std::env::var("SHOW").is_ok() {
        run.print();
    }
    assert_eq!(run.figure("goals_achieved"), 4.0);
    assert!(run.figure("alarms") >= 2.0 && run.figure("recoveries") >= 2.0);
    assert!(run.figure("max_response_lambda") < 2.0);
    assert_eq!(run.figure("faulty_agents"), 0.0);
    assert_eq!(run.figure("driving_without_lease_s"), 0.0);
    assert!(
        run.results.violations.is_empty(),
        "{:?}",
        run.results.violations
    );
}
