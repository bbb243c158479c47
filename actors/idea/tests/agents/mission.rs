//! A mission agent that orders goals, above the system agent.

use farside::prelude::*;

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

/// TREX (trex2 #13) executed a goal that was taken back while its planner deliberated: here a cancel
/// wins over a plan in the making, and over what is being done.
#[test]
fn a_goal_that_is_taken_back_is_not_done() {
    for recalled in ["2s", "8s", "30s", "100s", "200s"] {
        let with = format!("name = \"hollow\"\nrecalled = \"{recalled}\"");
        let slow = K9
            .replace("name = \"hollow\"", &with)
            .replace("1M/s", "3k/s");
        let run = Run::of(&slow, 1, |_| ());
        assert_eq!(run.figure("goals_total"), 5.0);
        assert_eq!(run.figure("goals_achieved"), 5.0, "recalled at {recalled}");
        assert_eq!(run.figure("goals_repeated"), 0.0);
        let goals = run.of_timeline("system", "Goal_SV");
        let recalled_s: u64 = recalled
            .trim_end_matches('s')
            .parse()
            .expect("it is a number");
        let known = SimTime::ZERO + SimDuration::from_secs(recalled_s + 3);
        let late = goals
            .iter()
            .find(|(at, says)| *at > known && says.starts_with("ImageAt(30 -60"));
        assert_eq!(late, None, "recalled at {recalled}");
    }
}

/// PlanSys2 (#119) lets an action overrun its time: here it ends with `TIMEOUT`, what does it is
/// stopped, and a goal that fails too often is given up with the reason.
#[test]
fn a_drive_that_never_ends_is_ended() {
    let fault = "[[rover.fault]]\nat = \"30s\"\nkind = \"never-ends\"\npart = \"wheels\"\n\n";
    let text = K9.replace("[mission_agent]", &format!("{fault}[mission_agent]"));
    let text = text.replace("until = \"1h\"", "until = \"12h\"");
    let run = Run::of(&text, 1, |_| ());
    assert!(
        run.figure("goals_given_up") >= 1.0,
        "{:?}",
        run.results.summary
    );
    let ends = run.figure("goals_given_up") + run.figure("goals_achieved");
    assert_eq!(ends, run.figure("goals_total"));
    assert_eq!(run.figure("driving_without_lease_s"), 0.0);
}
