//! The loop turns, with and without trouble.

use farside::prelude::*;

use super::pictures;
use super::runs::Run;

/// Noon of the first sol, from the start of the run at 7 in the morning \[h\].
const NOON_H: f64 = 5.0;

#[test]
fn the_loop_turns_and_executors_agree() {
    let healthy = |executor: Executor| {
        let run = Run {
            text: "until = \"0.42sol\"",
            executor,
            ..Run::default()
        };
        run.run()
    };
    let inline = healthy(Executor::Inline);
    inline.assert_sound("healthy");
    assert!(inline.figure("loops") >= 3.0);
    assert!(inline.figure("goals_achieved") >= 20.0);
    assert_eq!(inline.figure("duplicated"), 0.0);
    assert_eq!(inline.figure("missed_comm"), 0.0);
    let kameo = healthy(Executor::Kameo { threads: 2 });
    assert_eq!(kameo.report.digest, inline.report.digest);
}

#[test]
fn goals_of_a_lost_rover_are_assigned_again_or_given_up() {
    let crash = Run {
        text: "until = \"0.6sol\"",
        crashes: &[("rover_02", NOON_H, None)],
        is_kept: true,
        ..Run::default()
    };
    let ran = crash.run();
    ran.assert_sound("rover_02 lost");
    assert!(ran.figure("reassigned") > 0.0);
    assert_eq!(ran.figure("orphaned"), 0.0);
    pictures::check(&crash, &ran.tape);
}

#[test]
fn goals_that_a_lost_rover_keeps_are_counted() {
    let lost = |more: &str| {
        let text = format!("until = \"10h\"\n{more}");
        let run = Run {
            text: &text,
            crashes: &[("rover_02", 2.0, None)],
            ..Run::default()
        };
        let ran = run.run();
        ran.assert_sound(more);
        ran.figure("orphaned")
    };
    assert_eq!(lost(""), 0.0);
    assert!(lost("survey.reassign = \"never\"") > 0.0);
}

#[test]
fn a_rover_that_nobody_hears_goes_on_with_its_own_goals() {
    let silent = Run {
        text: "until = \"0.42sol\"\nlinks.\"rover_01-*\".outage = true",
        ..Run::default()
    };
    let ran = silent.run();
    ran.assert_sound("rover_01 silent");
    assert!(ran.figure("goals_achieved") > 0.0);
}

#[test]
fn loss_and_a_centre_that_is_out_cost_no_goal() {
    for (text, crashes) in [
        ("links.default.loss = 0.6\nuntil = \"0.42sol\"", &[][..]),
        (
            "links.default.loss = 0.9\nsurvey.contact = 0.3\nuntil = \"0.42sol\"",
            &[],
        ),
        // It is back while it is still light.
        (
            "until = \"0.42sol\"",
            &[("lander", NOON_H - 3.0, Some(NOON_H))],
        ),
        (
            "until = \"0.42sol\"\nsurvey.election = \"30min\"",
            &[("lander", NOON_H - 3.0, Some(NOON_H))],
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

#[test]
fn radios_know_where_rovers_have_driven() {
    let ran = |range: &str| {
        let text = format!(
            "until = \"4h\"\nradios.uhf.range = {range:?}\n\
             links.default = {{ radio = \"uhf\", latency = \"50ms\", loss = 0.0 }}"
        );
        let run = Run {
            text: &text,
            ..Run::default()
        };
        let ran = run.run();
        ran.assert_sound(range);
        ran.report.counts.lost
    };
    // All start around the lander, and drive away.
    assert_eq!(ran("200m"), 0);
    assert!(ran("15m") > 0);
}
