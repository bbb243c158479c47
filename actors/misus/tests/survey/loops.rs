//! The loop turns, with and without trouble.

use farside::prelude::*;

use crate::survey::Run;

/// Noon of the first sol, from the start of the run at 7 in the morning \[h\].
const NOON_H: f64 = 5.0;

#[test]
fn the_loop_turns_and_executors_agree() {
    let inline = Run::default().run();
    inline.assert_sound("healthy");
    assert!(inline.figure("loops") >= 3.0);
    assert!(inline.figure("goals_achieved") >= 20.0);
    assert_eq!(inline.figure("duplicated"), 0.0);
    assert_eq!(inline.figure("missed_comm"), 0.0);
    let kameo = Run {
        executor: Executor::Kameo { threads: 2 },
        ..Run::default()
    };
    assert_eq!(kameo.run().report.digest, inline.report.digest);
}

#[test]
fn goals_of_a_lost_rover_are_assigned_again_or_given_up() {
    let crash = Run {
        text: "until = \"1sol\"",
        crashes: &[("rover_02", NOON_H, None)],
        ..Run::default()
    };
    let ran = crash.run();
    ran.assert_sound("rover_02 lost");
    assert!(ran.figure("reassigned") > 0.0);
    assert_eq!(ran.figure("orphaned"), 0.0);
}

#[test]
fn a_rover_that_nobody_hears_goes_on_with_its_own_goals() {
    let silent = Run {
        text: "until = \"1sol\"\nlinks.\"rover_01-*\".outage = true",
        ..Run::default()
    };
    let ran = silent.run();
    ran.assert_sound("rover_01 silent");
    assert!(ran.figure("goals_achieved") > 0.0);
}

#[test]
fn loss_and_a_centre_that_is_out_cost_no_goal() {
    for (text, crashes) in [
        ("links.default.loss = 0.6\nuntil = \"1sol\"", &[][..]),
        (
            "links.default.loss = 0.9\nsurvey.contact = 0.3\nuntil = \"1sol\"",
            &[],
        ),
        ("", &[("lander", NOON_H, Some(NOON_H + 20.0))]),
        (
            "survey.election = \"30min\"",
            &[("lander", NOON_H, Some(NOON_H + 20.0))],
        ),
    ] {
        let run = Run {
            text,
            crashes,
            ..Run::default()
        };
        run.run().assert_sound(text);
    }
}
