//! How warm the bay is, what fans do to it, and what is told of it.

use super::*;

/// A K9, exact, in air that stays at 0 °C, with a battery that lasts.
fn bench() -> Bench {
    let mut config = RoverConfig::named("k9").expect("a model");
    (config.lease, config.record_every) = (SimDuration::ZERO, SimDuration::ZERO);
    (config.battery_j, config.night_power_w) = (1e9, 0.0);
    (config.bay.air_low_k, config.bay.air_high_k) = (273.15, 273.15);
    (config.bay.sigma_k, config.bay.start_k) = (0.0, 273.15);
    Bench::new(spec(level_field(1), config))
}

fn assert_near(actual: f64, expected: f64) {
    assert!((actual - expected).abs() < 1e-9, "{actual}, not {expected}");
}

#[test]
fn what_runs_inside_warms_the_bay_and_what_runs_outside_does_not() {
    // 40 W, of which nine tenths are heat, against 0.6 W/K and 8 kJ/K.
    let after_c = |power_w: f64, lasts_s: f64| {
        0.9 * power_w / 0.6 * (1.0 - libm::exp(-lasts_s * 0.6 / 8000.0))
    };
    let mut idle = bench();
    idle.pass(3600.0);
    assert_near(idle.state().bay_c, after_c(40.0, 3600.0));
    let mut slews = bench();
    slews.give(angles(3.0, 0.0));
    slews.give(drive(20.0, 0.0));
    slews.pass(3600.0);
    assert_near(slews.state().bay_c, idle.state().bay_c);
    let mut heats = bench();
    let duration = SimDuration::from_secs(3600);
    heats.give(Command::Heat { duration });
    heats.pass(3600.0);
    assert_near(heats.state().bay_c, after_c(62.0, 3600.0));
    // Nobody had to look in between.
    let mut looks = bench();
    for _ in 0..7200 {
        looks.pass(0.5);
    }
    assert_near(looks.state().bay_c, idle.state().bay_c);
}

#[test]
fn fans_cool_take_power_and_go_on_until_they_are_told() {
    let mut bench = bench();
    bench.pass(1e6);
    assert_near(bench.state().bay_c, 60.0);
    let (lasts_s, report) = bench.done(Command::Fans { on: true });
    assert_eq!((lasts_s, &report.end), (0.0, &CommandEnd::Done));
    assert_eq!(report.part, Some(Part::Fans));
    let state = bench.state();
    assert!(state.fans_on && state.running.is_empty());
    assert_near(state.load_w, 45.0);
    bench.pass(1e6);
    // 45 W against twice the conductance.
    assert_near(bench.state().bay_c, 0.9 * 45.0 / 1.2);
    assert_near(bench.energy().fans_j, 5e6);
    // A stop leaves them as they are; it is answered, too.
    let part = Some(Part::Fans);
    let stop = Command::Stop { part };
    assert_eq!(bench.answer(stop), Some(CommandEnd::Done));
    assert!(bench.state().fans_on);
    bench.done(Command::Fans { on: false });
    bench.pass(1e6);
    assert_near(bench.state().bay_c, 60.0);
}

#[test]
fn fans_stand_still_asleep_and_in_a_brown_out() {
    let mut bench = bench();
    bench.give(Command::Fans { on: true });
    bench.give(Command::Sleep {
        duration: SimDuration::from_secs(100),
    });
    assert!(bench.state().fans_on && !bench.hardware.resources().fans_run);
    let on = false;
    assert_eq!(bench.refusal(Command::Fans { on }), Refusal::Asleep);
    bench.pass(200.0);
    assert!(bench.hardware.resources().fans_run);
    assert_near(bench.energy().fans_j, 500.0);
    bench.fails(FaultKind::Dust, "", 1.0);
    bench.fails(FaultKind::ExtraPower, "", 1e6);
    bench.pass(1000.0);
    assert!(bench.state().brown_out && !bench.hardware.resources().fans_run);
    assert_eq!(bench.refusal(Command::Fans { on }), Refusal::BrownOut);
}

#[test]
fn fans_that_fail_are_believed_to_run() {
    let mut bench = bench();
    let fault = bench.fails(FaultKind::FansFail, "", 0.0);
    let on = true;
    assert_eq!(
        bench.answer(Command::Fans { on }),
        Some(CommandEnd::Done),
        "it is open loop"
    );
    let resources = bench.hardware.resources();
    assert!(bench.state().fans_on && !resources.fans_run);
    assert_near(resources.load_w, 40.0);
    bench.mended(fault);
    assert!(bench.hardware.resources().fans_run);
}

#[test]
fn heat_of_a_fault_comes_from_no_battery() {
    let mut bench = bench();
    let fault = bench.fails(FaultKind::BayHeat, "", 60.0);
    assert_near(bench.state().load_w, 40.0);
    bench.pass(1e6);
    assert_near(bench.state().bay_c, 60.0 + 100.0);
    bench.mended(fault);
    bench.pass(1e6);
    assert_near(bench.state().bay_c, 60.0);
    let energy = bench.energy();
    assert!(energy.fault_j == 0.0 && energy.imbalance_j().abs() < 1e-9 * energy.total_j());
}

#[test]
fn a_rover_without_fans_says_so() {
    let mut bench = Bench::exact();
    let refusal = bench.refusal(Command::Fans { on: true });
    let (found, nearest) = ("fans".to_owned(), None);
    assert_eq!(refusal, Refusal::NoSuchPart { found, nearest });
}

#[test]
fn sensors_are_as_noisy_as_the_model_says_and_alike_to_all_who_ask() {
    let mut config = RoverConfig::named("k9").expect("a model");
    (config.lease, config.record_every) = (SimDuration::ZERO, SimDuration::ZERO);
    let mut spec = spec(level_field(1), config);
    spec.start.yaw_rad = std::f64::consts::PI;
    let mut bench = Bench::new(spec);
    let (mut compass, mut warmth) = (Vec::new(), Vec::new());
    for _ in 0..2000 {
        bench.pass(0.5);
        let state = bench.state();
        assert_eq!(state, bench.state());
        assert!(state.compass_rad.abs() <= std::f64::consts::PI);
        compass.push(super::super::body::wrapped(
            state.compass_rad - std::f64::consts::PI,
        ));
        warmth.push(state.bay_c - bench.hardware.resources().bay_c);
    }
    for (errors, sigma) in [(compass, 2f64.to_radians()), (warmth, 0.3)] {
        let count = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / count;
        let squares = errors.iter().map(|error| error * error).sum::<f64>();
        assert!(mean.abs() < 0.1 * sigma, "{mean}");
        let ratio = libm::sqrt(squares / count) / sigma;
        assert!((0.93..1.07).contains(&ratio), "{ratio}");
    }
}
