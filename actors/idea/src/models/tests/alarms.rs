//! Alarms and recoveries: each row of the table that `docs/src/idea.md` has.

use super::rover::Rover;
use super::*;
use farside_planning::model::Value;

cases! {
    a_rover_that_stays_blind_is_safe_after_three_resumptions,
    what_is_not_measured_is_asked_again,
    an_alarm_stops_a_nominal_rover_and_the_graver_one_counts,
    a_recovery_goes_on_through_lesser_alarms_and_begins_anew_at_graver_ones,
    each_alarm_has_a_sequence_of_its_own,
    a_step_is_tried_twice_and_then_the_rover_is_safe,
    a_rover_resumes_three_times_and_then_is_safe,
    a_safe_rover_stays_so_until_an_operator_lets_it_go,
    a_hard_limit_makes_a_rover_safe_from_any_state,
    a_step_that_is_done_in_an_alarms_cycle_proceeds,
    polls_without_answers_make_a_rover_blind_and_it_waits,
    two_polls_without_answers_are_no_alarm_if_the_third_has_one,
    graver_alarms_end_the_wait_of_a_blind_rover_and_of_one_without_power,
}

const STEPS: [&str; 3] = ["stop", "back_up", "turn"];
const TILT: Value = 30;
const ROLL: Value = 30;
const HARD: Value = 46;

/// A rover in a step of the recovery from an alarm, after `n` resumptions, whose alarm is over.
fn in_recovery(system: &Planned, alarm: &str, n: usize, step: usize) -> Rover {
    let mut rover = if n == 0 {
        Rover::new(system)
    } else {
        let mut rover = in_recovery(system, alarm, n - 1, 2);
        rover.ok();
        assert_eq!(rover.monitor(), format!("Resuming {}", n - 1));
        rover
    };
    match alarm {
        "tilt" => rover.pitch = Some(TILT),
        _ => rover.roll = Some(-ROLL),
    }
    rover.cycle();
    (rover.pitch, rover.roll) = (Some(0), Some(0));
    for _ in 0..step {
        rover.ok();
    }
    let step = STEPS[step];
    assert_eq!(rover.monitor(), format!("Recovery {step} {alarm} {n} 0"));
    rover
}

fn resuming(system: &Planned, n: usize) -> Rover {
    let mut rover = in_recovery(system, "roll", n, 2);
    rover.ok();
    assert_eq!(rover.monitor(), format!("Resuming {n}"));
    rover
}

fn safe(system: &Planned) -> Rover {
    let mut rover = Rover::new(system);
    rover.pitch = Some(HARD);
    rover.cycle();
    assert_eq!(rover.monitor(), "Safe");
    rover.pitch = Some(0);
    rover
}

/// What a rover does in the cycle of an alarm.
fn after(mut rover: Rover, pitch: Value, roll: Value) -> String {
    (rover.pitch, rover.roll) = (Some(pitch), Some(roll));
    rover.cycle();
    rover.monitor()
}

fn an_alarm_stops_a_nominal_rover_and_the_graver_one_counts(system: &Planned) {
    let new = || Rover::new(system);
    assert_eq!(after(new(), TILT, 0), "Recovery stop tilt 0 0");
    assert_eq!(after(new(), -TILT, 0), "Recovery stop tilt 0 0");
    assert_eq!(after(new(), 0, ROLL), "Recovery stop roll 0 0");
    assert_eq!(after(new(), TILT, ROLL), "Recovery stop roll 0 0");
    assert_eq!(after(new(), 25, 20), "Nominal");
    assert_eq!(after(new(), 26, 20), "Recovery stop tilt 0 0");
    assert_eq!(after(new(), 25, 21), "Recovery stop roll 0 0");
}

fn a_recovery_goes_on_through_lesser_alarms_and_begins_anew_at_graver_ones(system: &Planned) {
    for n in 0..=3 {
        for (at, step) in STEPS.iter().enumerate() {
            let tilted = || in_recovery(system, "tilt", n, at);
            assert_eq!(
                after(tilted(), TILT, 0),
                format!("Recovery {step} tilt {n} 0")
            );
            assert_eq!(
                after(tilted(), 0, ROLL),
                format!("Recovery stop roll {n} 0")
            );
            assert_eq!(
                after(tilted(), TILT, ROLL),
                format!("Recovery stop roll {n} 0")
            );
            let rolled = || in_recovery(system, "roll", n, at);
            assert_eq!(
                after(rolled(), TILT, 0),
                format!("Recovery {step} roll {n} 0")
            );
            assert_eq!(
                after(rolled(), 0, ROLL),
                format!("Recovery {step} roll {n} 0")
            );
        }
    }
}

fn each_alarm_has_a_sequence_of_its_own(system: &Planned) {
    for (alarm, commands) in [
        ("tilt", ["Stop", "BackUp 10", "TurnInPlace 30"]),
        ("roll", ["Stop", "BackUp 5", "TurnInPlace -45"]),
    ] {
        for (step, command) in commands.into_iter().enumerate() {
            let rover = in_recovery(system, alarm, 0, step);
            assert_eq!(rover.says(system.timelines.location), command);
        }
        let mut rover = in_recovery(system, alarm, 0, 2);
        rover.ok();
        assert_eq!(rover.monitor(), "Resuming 0");
        assert_eq!(rover.says(system.timelines.location), "Still");
        rover.cycles(11);
        assert_eq!(rover.monitor(), "Resuming 0");
        rover.cycle();
        assert_eq!(rover.monitor(), "Nominal");
    }
}

fn a_step_is_tried_twice_and_then_the_rover_is_safe(system: &Planned) {
    let limits = [6, 60, 60];
    for alarm in ["tilt", "roll"] {
        for (at, step) in STEPS.iter().enumerate() {
            for times_out in [false, true] {
                let fail = |rover: &mut Rover| match times_out {
                    false => rover.wheels(system.statuses.failed),
                    true => rover.cycles(limits[at]),
                };
                let mut rover = in_recovery(system, alarm, 1, at);
                fail(&mut rover);
                assert_eq!(rover.monitor(), format!("Recovery {step} {alarm} 1 1"));
                let mut again = in_recovery(system, alarm, 1, at);
                fail(&mut again);
                again.ok();
                assert_ne!(again.monitor(), "Safe");
                fail(&mut rover);
                assert_eq!(rover.monitor(), "Safe");
                assert_eq!(rover.says(system.timelines.location), "Still");
            }
        }
    }
}

fn a_rover_resumes_three_times_and_then_is_safe(system: &Planned) {
    for n in 0..=3 {
        for (pitch, roll, alarm) in [(TILT, 0, "tilt"), (0, ROLL, "roll"), (TILT, ROLL, "roll")] {
            let expected = match n {
                3 => "Safe".to_owned(),
                n => format!("Recovery stop {alarm} {} 0", n + 1),
            };
            assert_eq!(after(resuming(system, n), pitch, roll), expected);
            // In the last cycle of the resumption, too.
            let mut rover = resuming(system, n);
            rover.cycles(11);
            assert_eq!(after(rover, pitch, roll), expected);
        }
        let mut rover = resuming(system, n);
        rover.cycles(12);
        assert_eq!(rover.monitor(), "Nominal");
    }
}

fn a_safe_rover_stays_so_until_an_operator_lets_it_go(system: &Planned) {
    assert_eq!(after(safe(system), TILT, ROLL), "Safe");
    assert_eq!(after(safe(system), 0, HARD), "Safe");
    let mut rover = safe(system);
    rover.cycles(1_000);
    assert_eq!(rover.monitor(), "Safe");
    rover.service.advance(rover.tick + 1);
    let (at, says) = (system.timelines.monitor, system.predicates.nominal);
    rover
        .service
        .insert_goal(at, says, &[])
        .expect("an operator can");
    rover.cycle();
    assert_eq!(rover.monitor(), "Nominal");
}

fn a_hard_limit_makes_a_rover_safe_from_any_state(system: &Planned) {
    for (pitch, roll) in [
        (HARD, 0),
        (-HARD, 0),
        (0, HARD),
        (HARD, ROLL),
        (TILT, -HARD),
    ] {
        assert_eq!(after(Rover::new(system), pitch, roll), "Safe");
        for alarm in ["tilt", "roll"] {
            for step in 0..3 {
                assert_eq!(
                    after(in_recovery(system, alarm, 0, step), pitch, roll),
                    "Safe"
                );
                // And as the step is done or has failed.
                for status in [system.statuses.ok, system.statuses.failed] {
                    let mut rover = in_recovery(system, alarm, 0, step);
                    rover.status(system.timelines.location, status);
                    assert_eq!(after(rover, pitch, roll), "Safe");
                }
            }
        }
        assert_eq!(after(resuming(system, 1), pitch, roll), "Safe");
    }
}

fn a_step_that_is_done_in_an_alarms_cycle_proceeds(system: &Planned) {
    for alarm in ["tilt", "roll"] {
        for step in 0..3 {
            for (pitch, roll) in [(TILT, 0), (0, ROLL), (TILT, ROLL)] {
                let mut rover = in_recovery(system, alarm, 1, step);
                rover.status(system.timelines.location, system.statuses.ok);
                let next = match step {
                    2 => "Resuming 1".to_owned(),
                    step => format!("Recovery {} {alarm} 1 0", STEPS[step + 1]),
                };
                assert_eq!(after(rover, pitch, roll), next);
            }
        }
    }
}

fn polls_without_answers_make_a_rover_blind_and_it_waits(system: &Planned) {
    // Three polls of two ticks each.
    for pitch in [true, false] {
        let mut rover = Rover::new(system);
        if pitch {
            rover.pitch = None
        } else {
            rover.roll = None
        }
        let asked = rover.tick;
        while rover.monitor() == "Nominal" {
            rover.cycle();
        }
        assert_eq!(
            (rover.monitor().as_str(), rover.tick - asked),
            ("Recovery stop blind 0 0", 6)
        );
        rover.ok();
        assert_eq!(rover.monitor(), "Waiting blind 0");
        rover.cycles(20);
        assert_eq!(rover.monitor(), "Resuming 0");
        // Two more in vain, and it waits again; with answers it goes on.
        rover.cycles(2);
        assert_eq!(rover.monitor(), "Recovery stop blind 1 0");
        rover.ok();
        (rover.pitch, rover.roll) = (Some(0), Some(0));
        rover.cycles(32);
        assert_eq!(rover.monitor(), "Nominal");
    }
}

fn two_polls_without_answers_are_no_alarm_if_the_third_has_one(system: &Planned) {
    let mut rover = Rover::new(system);
    for _ in 0..20 {
        rover.pitch = None;
        rover.cycles(4);
        rover.pitch = Some(0);
        rover.cycle();
        assert_eq!(rover.monitor(), "Nominal");
    }
}

fn graver_alarms_end_the_wait_of_a_blind_rover_and_of_one_without_power(system: &Planned) {
    let waiting = |alarm: &str| {
        let mut rover = Rover::new(system);
        match alarm {
            "blind" => rover.roll = None,
            _ => rover.power = Some(10),
        }
        while rover.monitor() == "Nominal" {
            rover.cycle();
        }
        rover.ok();
        assert_eq!(rover.monitor(), format!("Waiting {alarm} 0"));
        rover
    };
    for alarm in ["blind", "power"] {
        assert_eq!(after(waiting(alarm), TILT, 0), "Recovery stop tilt 0 0");
        assert_eq!(after(waiting(alarm), 0, ROLL), "Recovery stop roll 0 0");
        assert_eq!(after(waiting(alarm), HARD, 0), "Safe");
    }
    let mut rover = waiting("power");
    rover.roll = None;
    rover.cycles(6);
    assert_eq!(rover.monitor(), "Recovery stop blind 0 0");
    // Power that stays low: three resumptions, then safe.
    let mut rover = waiting("power");
    let mut said = Vec::new();
    while rover.monitor() != "Safe" {
        if said.last() != Some(&rover.monitor()) {
            said.push(rover.monitor());
        }
        match rover.monitor().starts_with("Recovery") {
            true => rover.ok(),
            false => rover.cycle(),
        }
    }
    let expected = [
        "Waiting power 0",
        "Resuming 0",
        "Recovery stop power 1 0",
        "Waiting power 1",
        "Resuming 1",
        "Recovery stop power 2 0",
        "Waiting power 2",
        "Resuming 2",
        "Recovery stop power 3 0",
        "Waiting power 3",
        "Resuming 3",
    ];
    assert_eq!(said, expected);
}

fn a_rover_that_stays_blind_is_safe_after_three_resumptions(system: &Planned) {
    let mut rover = Rover::new(system);
    rover.roll = None;
    let mut said = Vec::new();
    while rover.monitor() != "Safe" {
        if said.last() != Some(&rover.monitor()) {
            said.push(rover.monitor());
        }
        match rover.monitor().starts_with("Recovery") {
            true => rover.ok(),
            false => rover.cycle(),
        }
    }
    assert_eq!(said.last().map(String::as_str), Some("Resuming 3"));
    assert_eq!(said.len(), 1 + 4 * 3);
}

/// A poll of temperature or power that nobody answers ends, and another one asks again.
fn what_is_not_measured_is_asked_again(system: &Planned) {
    let mut rover = Rover::new(system);
    (rover.temperature, rover.power) = (None, None);
    rover.cycles(25);
    for timeline in [system.timelines.temperature, system.timelines.power] {
        assert!(rover.present(timeline).start > rover.tick - 2);
        assert!(rover.present(timeline).contract.number > 10);
    }
    assert_eq!(rover.monitor(), "Nominal");
}
