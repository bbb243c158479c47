//! Goals: expanded into commands, suspended by alarms, driven again, ended in every way.

use super::rover::Rover;
use super::*;

cases! {
    a_goal_is_a_drive_then_the_mast_then_an_image,
    a_command_that_fails_or_times_out_ends_the_goal,
    an_alarm_suspends_the_goal_and_it_is_driven_again_once,
    a_step_of_a_goal_that_is_done_as_an_alarm_comes_is_done_again,
    a_goal_that_comes_while_a_rover_recovers_waits_for_the_nominal_state,
    a_safe_rover_ends_its_goal_and_refuses_others,
    a_goal_that_is_taken_back_or_replaced_stops_what_it_did,
    a_goal_whose_time_is_over_ends_with_what_it_did,
    the_fan_is_set_in_the_cycle_of_the_reading,
}

/// A rover that drives to a goal.
fn driving(system: &Planned) -> Rover {
    let mut rover = Rover::new(system);
    rover.goal();
    rover.cycle();
    assert_eq!(rover.says(system.timelines.location), "DriveTo 100 -50");
    rover.cycles(3);
    rover
}

/// From the stop of a recovery to the nominal state.
fn recover(rover: &mut Rover) {
    (rover.pitch, rover.roll) = (Some(0), Some(0));
    (0..3).for_each(|_| rover.ok());
    rover.cycles(12);
    assert_eq!(rover.monitor(), "Nominal");
}

fn a_goal_is_a_drive_then_the_mast_then_an_image(system: &Planned) {
    let (at, ok) = (system.timelines, system.statuses.ok);
    let mut rover = driving(system);
    rover.ok();
    assert_eq!(rover.says(at.location), "Still");
    assert_eq!(rover.says(at.pan_tilt), "Point 30 -10");
    rover.status(at.pan_tilt, ok);
    rover.cycle();
    assert_eq!(rover.says(at.camera), "TakeImage hawk_eye");
    assert_eq!(rover.says(at.goal), "ImageAt 100 -50 30 -10 hawk_eye");
    rover.status(at.camera, ok);
    rover.cycle();
    assert_eq!(rover.says(at.goal), "NoGoal");
    assert_eq!(rover.goal_status(), Some(ok));
}

fn a_command_that_fails_or_times_out_ends_the_goal(system: &Planned) {
    let (at, ok) = (system.timelines, system.statuses.ok);
    let of = [(at.location, 1_200), (at.pan_tilt, 40), (at.camera, 40)];
    for (done, (timeline, limit)) in of.into_iter().enumerate() {
        let reach = || {
            let mut rover = Rover::new(system);
            rover.goal();
            rover.cycle();
            for (timeline, _) in &of[..done] {
                rover.status(*timeline, ok);
                rover.cycle();
            }
            rover
        };
        let mut rover = reach();
        rover.status(timeline, system.statuses.failed);
        rover.cycle();
        assert_eq!(rover.goal_status(), Some(system.statuses.failed));
        let mut rover = reach();
        rover.cycles(limit);
        assert_eq!(rover.goal_status(), Some(system.statuses.timeout));
        assert_eq!(rover.says(at.goal), "NoGoal");
    }
}

fn an_alarm_suspends_the_goal_and_it_is_driven_again_once(system: &Planned) {
    let at = system.timelines;
    let mut rover = driving(system);
    rover.pitch = Some(30);
    rover.cycle();
    assert_eq!(rover.says(at.location), "Stop");
    assert_eq!(rover.says(at.goal), "ImageAt 100 -50 30 -10 hawk_eye");
    let drive =
        { rover.service.ended().iter() }.find(|at| at.predicate == system.predicates.drive_to);
    let drive = drive.expect("the drive ended");
    assert_eq!(drive.parameters[2], Some(system.statuses.preempted));
    recover(&mut rover);
    assert_eq!(rover.says(at.location), "DriveTo 100 -50");
    let contract = rover.present(at.location).contract;
    rover.cycles(10);
    assert_eq!(rover.present(at.location).contract, contract);
}

/// The wheels, the mast and the camera: what each was told to do is told again after the recovery,
/// from the drive on.
fn a_step_of_a_goal_that_is_done_as_an_alarm_comes_is_done_again(system: &Planned) {
    let (at, ok) = (system.timelines, system.statuses.ok);
    for steps in 0..2 {
        let mut rover = driving(system);
        if steps == 1 {
            rover.ok();
        }
        rover.status([at.location, at.pan_tilt][steps], ok);
        rover.roll = Some(30);
        rover.cycle();
        assert_eq!(rover.says(at.location), "Stop");
        assert_eq!(rover.says(at.camera), "Shut");
        assert_eq!(rover.says(at.pan_tilt), "Rest");
        recover(&mut rover);
        assert_eq!(rover.says(at.location), "DriveTo 100 -50");
    }
    // An image that is taken is taken.
    let mut rover = driving(system);
    rover.ok();
    rover.status(at.pan_tilt, ok);
    rover.cycle();
    rover.status(at.camera, ok);
    rover.roll = Some(30);
    rover.cycle();
    assert_eq!(rover.goal_status(), Some(ok));
    recover(&mut rover);
    assert_eq!(rover.says(at.location), "Still");
}

fn a_goal_that_comes_while_a_rover_recovers_waits_for_the_nominal_state(system: &Planned) {
    let at = system.timelines;
    for early in 0..16 {
        let mut rover = Rover::new(system);
        rover.pitch = Some(30);
        if early == 0 {
            rover.goal();
        }
        rover.cycle();
        rover.pitch = Some(0);
        for step in 1..16 {
            if step == early {
                rover.goal();
            }
            assert!(!rover.says(at.location).starts_with("DriveTo"));
            match step {
                1..4 => rover.ok(),
                _ => rover.cycle(),
            }
        }
        assert_eq!(rover.monitor(), "Nominal");
        assert_eq!(rover.says(at.location), "DriveTo 100 -50", "{early}");
    }
}

fn a_safe_rover_ends_its_goal_and_refuses_others(system: &Planned) {
    let (at, failed) = (system.timelines, Some(system.statuses.failed));
    let mut rover = driving(system);
    rover.pitch = Some(50);
    rover.cycle();
    assert_eq!(
        (rover.monitor().as_str(), rover.goal_status()),
        ("Safe", failed)
    );
    assert_eq!(rover.says(at.location), "Still");
    rover.pitch = Some(0);
    rover.goal();
    rover.cycle();
    assert_eq!(rover.says(at.completion), "Refused");
    rover.cycle();
    assert_eq!(rover.goal_status(), failed);
    assert_eq!(rover.says(at.goal), "NoGoal");
    // A goal of the very cycle.
    let mut rover = Rover::new(system);
    rover.goal();
    rover.pitch = Some(50);
    rover.cycle();
    rover.cycle();
    assert_eq!(
        (rover.monitor().as_str(), rover.goal_status()),
        ("Safe", failed)
    );
}

fn a_goal_that_is_taken_back_or_replaced_stops_what_it_did(system: &Planned) {
    let at = system.timelines;
    let mut rover = driving(system);
    rover.service.advance(rover.tick + 1);
    let contract = rover.present(at.goal).contract;
    rover.service.cancel(contract).expect("it can end");
    rover.cycle();
    assert_eq!(rover.says(at.goal), "NoGoal");
    assert_eq!(rover.says(at.location), "Still");
    let mut rover = driving(system);
    rover.service.advance(rover.tick + 1);
    let other = rover.service.insert_goal(
        at.goal,
        system.predicates.image_at,
        &[7, 8, 0, 0, camera(system)],
    );
    other.expect("a goal can take the place of another");
    rover.cycle();
    assert_eq!(rover.says(at.location), "DriveTo 7 8");
}

fn camera(system: &Planned) -> i64 {
    let symbols = &system.model.symbols;
    symbols
        .iter()
        .position(|at| at == "wide_eye")
        .expect("there is one") as i64
}

/// A goal's own time counts on while a rover recovers, and its commands end with it.
fn a_goal_whose_time_is_over_ends_with_what_it_did(system: &Planned) {
    let at = system.timelines;
    let mut rover = Rover::new(system);
    rover.goal();
    rover.cycle();
    let accepted = rover.tick;
    while rover.says(at.goal) != "NoGoal" {
        // Each drive but the last is cut short by an alarm.
        if rover.present(at.location).start == rover.tick - 1_000 {
            rover.pitch = Some(30);
            rover.cycle();
            recover(&mut rover);
        } else {
            rover.cycle();
        }
    }
    assert_eq!(rover.tick - accepted, 3_600);
    assert_eq!(rover.goal_status(), Some(system.statuses.timeout));
    assert_eq!(rover.says(at.location), "Still");
}

fn the_fan_is_set_in_the_cycle_of_the_reading(system: &Planned) {
    let mut rover = Rover::new(system);
    rover.temperature = Some(46);
    rover.cycle();
    assert_eq!(rover.says(system.timelines.fans), "DeviceSetFanState True");
    rover.temperature = Some(45);
    rover.cycles(20);
    assert_eq!(rover.says(system.timelines.fans), "FansUnchanged");
    rover.cycle();
    assert_eq!(rover.says(system.timelines.fans), "DeviceSetFanState False");
}
