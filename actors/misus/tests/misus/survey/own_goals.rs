//! Goals of one's own: they come, change and go, and a combination may be worth less than nothing.

use super::runs::Run;

/// Nothing but goals of one's own, two of them worth a little more than others, and less together.
const PAIR: &str = r#"
until = "0.4sol"
survey = { rocks = 0, squares = 0 }
team.rovers = 1
goal = [
    { name = "a", observation = "panoramic-image", east_m = 3.0, weight = 12.0 },
    { name = "b", observation = "panoramic-image", north_m = 3.0, weight = 12.0 },
    { name = "c", observation = "panoramic-image", east_m = -3.0, weight = 10.0 },
    { name = "d", observation = "panoramic-image", north_m = -3.0, weight = 10.0 },
    { name = "e", observation = "panoramic-image", east_m = 4.0, north_m = 4.0, weight = 10.0 },
]
combination = [{ goals = ["a", "b"], weight = -30.0 }]
"#;

#[test]
fn of_two_goals_that_are_worth_less_together_idgs_takes_one_and_simple_reward_both() {
    let ran = |choice: &str| {
        let text = format!("{PAIR}\nplanner = {{ choice = {choice:?}, epsilon = 0.0 }}");
        let run = Run {
            text: &text,
            ..Run::default()
        };
        let ran = run.run();
        ran.assert_sound(choice);
        (ran.figure("goals_achieved"), ran.figure("score"))
    };
    assert_eq!(ran("idgs"), (4.0, 42.0));
    assert_eq!(ran("simple-reward"), (5.0, 24.0));
}

#[test]
fn goals_are_added_changed_and_withdrawn() {
    let text = r#"
        until = "0.4sol"
        survey = { rocks = 0, squares = 0 }
        goal = [
            { name = "first", observation = "panoramic-image", east_m = 3.0, withdrawn = "1min" },
            { name = "late", observation = "panoramic-image", north_m = 3.0, added = "2h", weight = 1.0,
              change = [{ at = "2h1min", weight = 4.0 }] },
        ]
    "#;
    let run = Run {
        text,
        ..Run::default()
    };
    let ran = run.run();
    ran.assert_sound("own goals");
    assert_eq!(ran.figure("goals_total"), 2.0);
    assert_eq!(ran.figure("wished_editions"), 4.0);
    assert_eq!(
        ran.figure("score"),
        4.0 + ran.figure("goals_achieved") - 1.0
    );
}

#[test]
fn what_a_drive_costs_by_the_users_objective_is_weighed_against_what_it_is_for() {
    let goals = r#"
        until = "0.4sol"
        survey = { rocks = 0, squares = 0 }
        team.rovers = 1
        goal = [
            { name = "near", observation = "panoramic-image", east_m = 3.0, weight = 10.0 },
            { name = "far", observation = "panoramic-image", east_m = -25.0, weight = 10.0 },
        ]
    "#;
    let achieved = |objective: &str| {
        let text = format!("{goals}\n{objective}");
        let run = Run {
            text: &text,
            ..Run::default()
        };
        let ran = run.run();
        ran.assert_sound(objective);
        ran.figure("goals_achieved")
    };
    assert_eq!(achieved(""), 2.0);
    assert_eq!(achieved("objective.drive_per_m = 1.0"), 1.0);
}
