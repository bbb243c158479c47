//! Dangerous attitudes: rocks under wheels, which tilt the rover in truth until it has driven off
//! them, and an inertial unit that says so of itself.

use super::*;

const NEAR_RAD: f64 = 0.02;

fn back_up(distance_m: f64) -> Command {
    Command::BackUp { distance_m }
}

/// Roll and pitch, in truth \[rad\].
fn truth_rad(bench: &Bench) -> [f64; 2] {
    let pose = bench.hardware.pose();
    [pose.roll_rad, pose.pitch_rad]
}

/// Roll and pitch as measured \[rad\].
fn measured_rad(bench: &mut Bench) -> [f64; 2] {
    let pose = bench.state().pose;
    [pose.roll_rad, pose.pitch_rad]
}

fn assert_near(actual: [f64; 2], expected: [f64; 2]) {
    for (actual, expected) in actual.into_iter().zip(expected) {
        assert!((actual - expected).abs() < NEAR_RAD, "{actual} {expected}");
    }
}

/// What a rock of 70 cm, half the base, does to a side.
const HALF_RAD: f64 = 0.4636;

#[test]
fn each_side_tilts_its_own_way() {
    let quarter = libm::atan(0.25);
    for (side, expected) in [
        ("front", [0.0, HALF_RAD]),
        ("rear", [0.0, -HALF_RAD]),
        ("left", [HALF_RAD, 0.0]),
        ("right", [-HALF_RAD, 0.0]),
        ("front-left", [quarter, quarter]),
        ("front-right", [-quarter, quarter]),
        ("rear-left", [quarter, -quarter]),
        ("rear-right", [-quarter, -quarter]),
    ] {
        let mut bench = Bench::exact();
        let fault = bench.fails(FaultKind::RockUnderWheel, side, 0.7);
        assert_near(truth_rad(&bench), expected);
        assert_near(measured_rad(&mut bench), expected);
        bench.mended(fault);
        assert_near(truth_rad(&bench), [0.0; 2]);
        assert_eq!(bench.count(|_| true), 0, "{side}");
    }
}

#[test]
fn a_tilt_lasts_through_backing_up_until_the_rover_has_gone_far_enough() {
    let mut bench = Bench::exact();
    bench.give(drive(5.0, 0.0));
    bench.pass(30.0);
    let fault = bench.fails(FaultKind::RockUnderWheel, "front", 0.7);
    bench.pass(4.0);
    bench.give(STOP);
    // 20 cm of the metre are gone. Neither that, nor backing up by 30 cm, nor turning helps.
    bench.done(back_up(0.3));
    bench.done(Command::Turn { yaw_rad: 1.0 });
    assert_near(truth_rad(&bench), [0.0, HALF_RAD]);
    assert_eq!(bench.count(|_| true), 0);
    // Half a metre more, of a metre: at 5 cm/s, to the instant.
    bench.give(back_up(1.0));
    bench.pass(9.9);
    assert_near(truth_rad(&bench), [0.0, HALF_RAD]);
    bench.pass(0.2);
    assert_near(truth_rad(&bench), [0.0; 2]);
    let incidents = bench.incidents();
    let [
        RoverIncident::OffRock {
            fault: of,
            driven_m,
        },
    ] = incidents.as_slice()
    else {
        panic!("{incidents:?}");
    };
    assert_eq!(*of, fault);
    assert!((driven_m - 2.5).abs() < 1e-8, "{driven_m}");
    // That is a sample of the pose, too.
    let is_level = |output: &Output| match output {
        Output::Pose(pose) => (pose.driven_m - 2.5).abs() < 1e-8 && pose.pitch_rad.abs() < NEAR_RAD,
        _ => false,
    };
    assert!(bench.out.iter().any(is_level));
    // Its end finds nothing left to do.
    bench.mended(fault);
    assert_near(truth_rad(&bench), [0.0; 2]);
}

#[test]
fn a_rock_is_left_at_the_end_of_a_leg_too_and_two_of_them_one_by_one() {
    let mut bench = Bench::exact();
    bench.fails(FaultKind::RockUnderWheel, "left", 0.7);
    assert_eq!(bench.done(drive(0.4, 0.0)).1.end, CommandEnd::Done);
    bench.fails(FaultKind::RockUnderWheel, "left", 0.7);
    assert_near(truth_rad(&bench), [libm::atan(1.0), 0.0]);
    // The first after the metre that is a leg's, the second 40 cm on.
    bench.done(drive(1.0, 0.0));
    assert_near(truth_rad(&bench), [HALF_RAD, 0.0]);
    bench.done(drive(3.0, 0.0));
    assert_near(truth_rad(&bench), [0.0; 2]);
    let off = |one: &RoverIncident| matches!(one, RoverIncident::OffRock { .. });
    assert_eq!(bench.count(off), 2);
}

#[test]
fn wheels_that_never_get_there_leave_no_rock() {
    let mut bench = Bench::exact();
    bench.fails(FaultKind::NeverEnds, "wheels", 0.0);
    bench.fails(FaultKind::RockUnderWheel, "rear", 0.7);
    bench.give(drive(3.0, 0.0));
    bench.pass(3600.0);
    assert_near(truth_rad(&bench), [0.0, -HALF_RAD]);
}

#[test]
fn a_biased_unit_measures_what_is_not_there() {
    let mut bench = Bench::exact();
    let pitch = bench.fails(FaultKind::PitchBias, "", 0.5);
    bench.fails(FaultKind::RollBias, "", -0.25);
    assert_near(measured_rad(&mut bench), [-0.25, 0.5]);
    assert_near(truth_rad(&bench), [0.0; 2]);
    bench.mended(pitch);
    assert_near(measured_rad(&mut bench), [-0.25, 0.0]);
}

#[test]
fn rocks_are_placed_by_scenarios_and_mistakes_in_them_named() {
    use crate::system::settings::Table;
    let config = |text: &str| -> RoverConfig {
        toml::from_str(&format!("[[fault]]\nkind = 'rock-under-wheel'\n{text}")).unwrap()
    };
    let until = SimDuration::from_secs(1);
    let planned = |text: &str| {
        let config = config(text);
        config.check("rover").unwrap();
        let rates = FaultRates::default();
        let begins = super::super::faults::plan(&config.faults, &rates, "rover_01", 1, until);
        let FaultBegins {
            part,
            amount,
            distance_m,
            ..
        } = begins[0].begins.clone();
        (part, amount, distance_m)
    };
    assert_eq!(planned(""), ("front-left".to_owned(), 0.3, 1.0));
    let text = "part = 'rear'\namount = 0.5\ndistance = '80cm'";
    assert_eq!(planned(text), ("rear".to_owned(), 0.5, 0.8));
    let refused = |text: &str| config(text).check("rover").unwrap_err().to_string();
    let error = refused("part = 'rear-lift'");
    assert!(error.ends_with("did you mean \"rear-left\"?"), "{error}");
    let error = refused("distance = '0m'");
    assert!(
        error.starts_with("rover.fault.0.distance: 0 m: expected 0.01 to"),
        "{error}"
    );
    let text = "[[fault]]\nkind = 'dust'\ndistance = '1m'";
    let config: RoverConfig = toml::from_str(text).unwrap();
    let error = config.check("rover").unwrap_err().to_string();
    assert_eq!(
        error,
        "rover.fault.0.distance: 1 m: no driving ends kind = \"dust\""
    );
}
