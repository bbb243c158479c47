//! Bad links between the mission agent and the system agent.

use crate::scenario::Run;

const REMOTE: &str = include_str!("../../scenarios/k9-remote.toml");

#[test]
fn all_goals_are_achieved_over_a_slow_link_that_loses() {
    let run = Run::of(REMOTE, 1, |_| ());
    assert_eq!(run.figure("goals_achieved"), 4.0);
    assert_eq!(run.figure("goals_repeated"), 0.0);
    assert!(run.figure("max_response_lambda") < 2.0);
}

/// Link loss never ends what the rover is at: it finishes its goal, and then holds `NoGoal`.
#[test]
fn a_goal_that_was_taken_is_finished_though_the_link_is_dead() {
    let dead =
        format!("{REMOTE}\n[[degrade]]\nlinks = \"mission-system\"\nat = \"30s\"\nloss = 1.0\n");
    let run = Run::of(&dead, 1, |_| ());
    assert_eq!(run.figure("goals_achieved"), 1.0);
    let goals = run.of_timeline("system", "Goal_SV");
    let says: Vec<&str> = goals.iter().map(|(_, says)| says.as_str()).collect();
    assert!(says[1].starts_with("ImageAt"), "{says:?}");
    assert_eq!(says[2..], ["NoGoal"]);
}

/// What the rover does once it has taken a goal does not depend on the link to the mission agent.
#[test]
fn recoveries_are_the_same_at_any_loss() {
    let mut before = None;
    for loss in [0.0, 0.5, 0.9, 1.0] {
        let text = format!("{REMOTE}\n[[degrade]]\nlinks = \"*-*\"\nat = \"20s\"\nloss = {loss}\n")
            .replace("*-*", "mission-system");
        let run = Run::of(&text, 1, |_| ());
        let first = run.of_timeline("system", "Goal_SV")[2].0;
        let steps = run.of_timeline("system", "MotionMonitor_SV");
        let steps: Vec<_> = steps.into_iter().filter(|(at, _)| *at <= first).collect();
        assert!(steps.len() > 4, "there was no recovery: {steps:?}");
        let known = before.get_or_insert_with(|| steps.clone());
        assert_eq!(*known, steps, "at a loss of {loss}");
    }
}

/// IDEA.md's protocol: 10 goals, a loss of 0.9 and an outage; all done, none twice.
#[test]
fn ten_goals_come_through_a_link_that_loses_nine_of_ten() {
    let goals: String = (0..10)
        .map(|at| {
            let (east, north) = (3 * (at % 4) - 4, 3 * (at / 4) - 3);
            format!("[[goal]]\neast = \"{east}m\"\nnorth = \"{north}m\"\ntilt = \"-25deg\"\n")
        })
        .collect();
    let head = REMOTE.split("[[goal]]").next().expect("there is a head");
    let head = head
        .replace("loss = 0.1", "loss = 0.9")
        .replace("until = \"2h\"", "until = \"24h\"");
    let outage =
        "[[degrade]]\nlinks = \"*mission*\"\nat = \"5min\"\nuntil = \"20min\"\noutage = true\n";
    let text = format!("{head}{goals}{outage}");
    let seeds = if std::env::var("SEEDS").is_ok() {
        30
    } else {
        3
    };
    for seed in 1..=seeds {
        let run = Run::of(&text, seed, |_| ());
        assert_eq!(run.figure("goals_achieved"), 10.0, "seed {seed}");
        assert_eq!(run.figure("goals_repeated"), 0.0);
    }
}
