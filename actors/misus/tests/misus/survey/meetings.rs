//! Goals for two rovers at one time: done by both, or by neither.

use super::runs::{Ran, Run};

/// Two rovers, and nothing to do but one goal that needs both.
const MEET: &str = r#"
until = "0.4sol"
survey = { rocks = 0, squares = 0 }
team.rovers = 2
goal = [
    { name = "meet", observation = "panoramic-image", east_m = 6.0, weight = 20.0, rovers = 2 },
    { name = "alone", observation = "panoramic-image", north_m = 4.0, weight = 3.0 },
]
"#;

fn ran(more: &str, crashes: &[(&str, f64, Option<f64>)]) -> Ran {
    let text = format!("{MEET}{more}");
    let run = Run {
        text: &text,
        crashes,
        ..Run::default()
    };
    let ran = run.run();
    ran.assert_sound(more);
    assert_eq!(ran.figure("goals_total"), 2.0, "{more}");
    // Whatever happens, nobody does its half alone.
    assert_eq!(ran.figure("half_goals"), 0.0, "{more}");
    ran
}

#[test]
fn two_rovers_meet_and_the_goal_counts_once() {
    for more in ["", "links.default.loss = 0.5"] {
        let ran = ran(more, &[]);
        assert_eq!(ran.figure("goals_achieved"), 2.0, "{more}");
        assert_eq!(ran.figure("score"), 23.0, "{more}");
    }
}

#[test]
fn who_waits_in_vain_goes_on_with_something_else() {
    let lost = ran("", &[("rover_02", 0.9, None)]);
    assert!(lost.figure("score") <= 3.0);
    let deaf = ran("links.\"rover_01-rover_02\".outage = true", &[]);
    assert_eq!(deaf.figure("score"), 3.0);
}
