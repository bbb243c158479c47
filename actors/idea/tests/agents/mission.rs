//! A mission agent that orders goals, above the system agent.

use crate::scenario::Run;

pub(crate) const K9: &str = include_str!("../../scenarios/k9.toml");

#[test]
fn all_goals_are_achieved_in_the_order_that_deliberation_finds() {
    let run = Run::of(K9, 1, |_| ());
    if std::env::var("SHOW").is_ok() {
        run.print();
    }
    assert_eq!(run.figure("goals_achieved"), 6.0);
    assert!(run.figure("alarms") >= 2.0 && run.figure("recoveries") >= 2.0);
    assert!(run.figure("max_response_lambda") < 2.0);
    assert_eq!(run.figure("faulty_agents"), 0.0);
    assert_eq!(run.figure("goals_repeated"), 0.0);
    assert!(
        run.results.violations.is_empty(),
        "{:?}",
        run.results.violations
    );
}
