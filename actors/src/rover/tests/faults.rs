//! Each kind of fault, the lease, and what a restart finds.

use super::super::faults::PlannedFault;
use super::*;

fn failed(reason: Failure) -> CommandEnd {
    CommandEnd::Failed { reason }
}

#[test]
fn a_blocked_path_stops_a_drive_in_front_of_it() {
    let mut bench = Bench::exact();
    let drives = bench.give(drive(5.0, 0.0));
    bench.pass(25.0);
    let fault = bench.fails(FaultKind::BlockedPath, "", 1.0);
    bench.pass(60.0);
    let reports = bench.reports();
    let by = Obstacle::Fault;
    assert_eq!(
        (reports[0].id, &reports[0].end),
        (drives, &failed(Failure::Blocked { by }))
    );
    // It was at 1.25 m; the edge lies half a metre ahead.
    let east_m = reports[0].pose.east_m;
    assert!((1.25..=1.75).contains(&east_m), "{east_m}");
    // Round it there is a way.
    for [east_m, north_m] in [[1.0, 3.0], [5.0, 3.0], [5.0, 0.0]] {
        let (_, report) = bench.done(drive(east_m, north_m));
        assert_eq!(report.end, CommandEnd::Done);
    }
    bench.done(drive(5.0, 3.0));
    bench.mended(fault);
    assert_eq!(bench.done(drive(0.0, 0.0)).1.end, CommandEnd::Done);
}

#[test]
fn slip_leads_astray_from_now_on() {
    let mut bench = Bench::exact();
    bench.give(drive(4.0, 0.0));
    bench.pass(30.0);
    bench.fails(FaultKind::Slip, "", 0.5);
    bench.pass(60.0);
    let report = bench.reports().remove(0);
    assert_eq!(report.end, CommandEnd::Done);
    // It believes to be there.
    assert!((report.pose.east_m - 4.0).abs() < 1e-9);
    // Of the 2.5 m that were left it went half.
    let error_m = bench.error_m();
    assert!((error_m - 1.25).abs() < 1e-9, "{error_m}");
}

#[test]
fn commands_end_early_late_or_never() {
    let mut bench = Bench::exact();
    bench.done(down());
    let early = bench.fails(FaultKind::EndsEarly, "pancam", 0.25);
    assert_eq!(bench.done(image(View::Point)).0, 15.0);
    let late = bench.fails(FaultKind::EndsLate, "", 3.0);
    assert_eq!(bench.done(image(View::Point)).0, 45.0);
    assert_eq!(bench.done(drive(0.5, 0.0)).0, 30.0);
    bench.mended(early);
    bench.mended(late);
    assert_eq!(bench.done(image(View::Point)).0, 60.0);
    let never = bench.fails(FaultKind::NeverEnds, "wheels", 0.0);
    let drives = bench.give(drive(1.0, 0.0));
    bench.pass(3600.0);
    assert!(bench.reports().is_empty());
    // What began under it does not end with it.
    bench.mended(never);
    bench.pass(3600.0);
    bench.give(STOP);
    assert_eq!(
        (bench.reports()[0].id, bench.hardware.pose().driven_m),
        (drives, 0.5)
    );
    assert_eq!(bench.done(drive(1.0, 0.0)).1.end, CommandEnd::Done);
}

#[test]
fn extra_power_is_taken_and_counted() {
    let mut bench = Bench::exact();
    let fault = bench.fails(FaultKind::ExtraPower, "", 50.0);
    bench.pass(100.0);
    bench.mended(fault);
    bench.pass(100.0);
    let energy_j = bench.energy().fault_j;
    assert!((energy_j - 5000.0).abs() < 1e-6, "{energy_j}");
}

#[test]
fn dust_takes_its_share_of_the_sunlight() {
    let mut bench = Bench::exact();
    let clean_w = bench.state().solar_w;
    let first = bench.fails(FaultKind::Dust, "", 0.5);
    bench.fails(FaultKind::Dust, "", 0.5);
    assert!(clean_w > 80.0 && (bench.state().solar_w - 0.25 * clean_w).abs() < 1e-9);
    bench.mended(first);
    assert!((bench.state().solar_w - 0.5 * clean_w).abs() < 1e-9);
}

#[test]
fn an_instrument_that_fails_stops_at_once() {
    let mut bench = Bench::exact();
    bench.done(down());
    let takes = bench.give(image(View::Point));
    bench.pass(10.0);
    let fault = bench.fails(FaultKind::InstrumentFails, "pancam", 0.0);
    let reports = bench.reports();
    assert_eq!(
        (reports[0].id, &reports[0].end),
        (takes, &failed(Failure::InstrumentFailed))
    );
    let load_w = bench.state().load_w;
    assert!(
        (load_w - 22.0).abs() < 1e-9,
        "it goes on taking power: {load_w} W"
    );
    assert_eq!(bench.refusal(image(View::Point)), Refusal::InstrumentFailed);
    assert_eq!(bench.done(spectrum(View::Point)).1.end, CommandEnd::Done);
    bench.mended(fault);
    assert_eq!(bench.done(image(View::Point)).1.end, CommandEnd::Done);
}

#[test]
fn an_instrument_that_drifts_measures_too_much() {
    let mean = |bench: &mut Bench| {
        let (_, report) = bench.done(spectrum(View::Point));
        let values = &report.readings[0].spectrum;
        values.iter().sum::<f64>() / values.len() as f64
    };
    let mut bench = Bench::exact();
    bench.done(down());
    let before = mean(&mut bench);
    bench.fails(FaultKind::InstrumentDrifts, "mini_tes", 0.3);
    let drifted = mean(&mut bench);
    assert!((drifted - before - 0.3).abs() < 0.01, "{before} {drifted}");
}

#[test]
fn memory_that_breaks_loses_what_does_not_fit() {
    let mut config = exact();
    config.memory_bytes = 4_000_000;
    let mut bench = Bench::new(spec(level_field(1), config));
    bench.done(down());
    for _ in 0..3 {
        bench.done(image(View::Point));
    }
    let fault = bench.fails(FaultKind::Memory, "", 0.5);
    let lost = RoverIncident::DataLost { bytes: 1_000_000 };
    assert!(bench.incidents().contains(&lost));
    let state = bench.state();
    assert_eq!(
        (state.memory_used_bytes, state.memory_size_bytes),
        (2_000_000, 2_000_000)
    );
    assert!(matches!(
        bench.refusal(image(View::Point)),
        Refusal::NotEnoughMemory { .. }
    ));
    bench.mended(fault);
    // It breaks while a reading is on its way: the reading fails.
    bench.give(image(View::Point));
    bench.fails(FaultKind::Memory, "", 0.5);
    bench.pass(60.0);
    assert_eq!(bench.reports()[0].end, failed(Failure::MemoryFull));
}

#[test]
fn a_stuck_mast_stops_where_it_is() {
    let mut bench = Bench::exact();
    let slews = bench.give(angles(1.0, -0.5));
    bench.pass(6.0);
    let fault = bench.fails(FaultKind::StuckMast, "", 0.0);
    let reports = bench.reports();
    assert_eq!(
        (reports[0].id, &reports[0].end),
        (slews, &failed(Failure::MastStuck))
    );
    let [pan_rad, tilt_rad] = [bench.state().pan_rad, bench.state().tilt_rad];
    assert!((pan_rad - std::f64::consts::PI / 10.0).abs() < 1e-9);
    assert!((tilt_rad + 0.5 * pan_rad).abs() < 1e-9);
    assert_eq!(bench.refusal(down()), Refusal::MastStuck);
    assert_eq!(bench.refusal(image(View::Panorama)), Refusal::MastStuck);
    // What it points at can be read.
    assert_eq!(bench.done(image(View::Point)).1.end, CommandEnd::Done);
    bench.mended(fault);
    let takes = bench.give(image(View::Panorama));
    bench.pass(6.0);
    bench.fails(FaultKind::StuckMast, "", 0.0);
    let reports = bench.reports();
    assert_eq!(
        (reports[0].id, &reports[0].end),
        (takes, &failed(Failure::MastStuck))
    );
}

#[test]
fn a_fault_that_is_told_twice_begins_once() {
    let mut bench = Bench::exact();
    let fault = FaultBegins {
        number: 7,
        kind: FaultKind::ExtraPower,
        part: String::new(),
        amount: 10.0,
        distance_m: 0.0,
    };
    for _ in 0..2 {
        bench.hardware.fault_begins(fault.clone(), &mut bench.out);
    }
    assert!((bench.state().load_w - 32.0).abs() < 1e-9);
}

#[test]
fn a_brown_out_ends_everything_and_passes() {
    let mut config = exact();
    (config.battery_j, config.charge) = (1e5, 0.5);
    let mut bench = Bench::new(spec(level_field(1), config));
    bench.give(drive(5.0, 0.0));
    // 35 kJ are left above the cutoff.
    bench.fails(FaultKind::Dust, "", 1.0);
    bench.fails(FaultKind::ExtraPower, "", 578.0);
    bench.pass(49.0);
    assert!(bench.reports().is_empty());
    bench.pass(2.0);
    let reports = bench.reports();
    assert_eq!(reports[0].end, failed(Failure::BrownOut));
    let ended = vec![reports[0].id];
    assert!(
        bench
            .incidents()
            .contains(&RoverIncident::BrownOut { ended })
    );
    let state = bench.state();
    assert!(state.brown_out && state.load_w == 0.0);
    assert!(
        (state.battery_j - 15_000.0).abs() < 1e-3,
        "{}",
        state.battery_j
    );
    assert_eq!(bench.refusal(drive(1.0, 0.0)), Refusal::BrownOut);
    for number in [100, 101] {
        bench.mended(number);
    }
    bench.pass(1000.0);
    assert!(bench.incidents().contains(&RoverIncident::Recovered));
    assert_eq!(bench.done(drive(1.0, 0.0)).1.end, CommandEnd::Done);
    let browned = |one: &RoverIncident| matches!(one, RoverIncident::BrownOut { .. });
    assert_eq!(bench.count(browned), 1);
}

#[test]
fn without_its_controller_it_stops() {
    let mut config = exact();
    config.lease = SimDuration::from_secs(20);
    let mut bench = Bench::new(spec(level_field(1), config));
    let drives = bench.give(drive(5.0, 0.0));
    let duration = SimDuration::from_secs(500);
    let heats = bench.give(Command::Heat { duration });
    bench.pass(15.0);
    bench.hardware.hear();
    bench.pass(19.0);
    assert!(bench.reports().is_empty());
    bench.pass(30.0);
    let reports = bench.reports();
    let by = StopCause::Lease;
    assert_eq!(
        (reports[0].id, &reports[0].end),
        (drives, &CommandEnd::Stopped { by })
    );
    // 35 s at 5 cm/s, to the instant; the heater goes on.
    assert!((bench.state().pose.east_m - 1.75).abs() < 1e-9);
    let part = Part::Heater;
    assert_eq!(bench.state().running, [Running { part, id: heats }]);
    let ended = vec![drives];
    assert!(
        bench
            .incidents()
            .contains(&RoverIncident::LeaseEnded { ended })
    );
    // Idle, it waits for nothing.
    bench.pass(1000.0);
    let left = |one: &RoverIncident| matches!(one, RoverIncident::LeaseEnded { .. });
    assert_eq!(bench.count(left), 1);
}

#[test]
fn a_restart_finds_what_metal_does_not_forget() {
    let mut bench = Bench::exact();
    bench.done(down());
    bench.done(image(View::Point));
    bench.give(drive(5.0, 0.0));
    bench.pass(30.0);
    let planned = |number: u32, at_s: f64, ends_s: Option<f64>| PlannedFault {
        at: bench.now() + SimDuration::from_secs_f64(at_s),
        ends: ends_s.map(|ends_s| bench.now() + SimDuration::from_secs_f64(ends_s)),
        begins: FaultBegins {
            number,
            kind: FaultKind::ExtraPower,
            part: String::new(),
            amount: 10.0,
            distance_m: 0.0,
        },
    };
    let faults = [
        planned(0, 20.0, Some(50.0)),
        planned(1, 80.0, None),
        planned(2, 200.0, None),
    ];
    bench.now_s += 100.0;
    let now = bench.now();
    bench.hardware.restart(now, 0.0, &faults, &mut bench.out);
    // The leg to 2 m was the last; nobody was told.
    assert!(bench.reports().is_empty());
    let state = bench.state();
    assert!(
        (state.pose.east_m - 2.0).abs() < 1e-9,
        "{}",
        state.pose.east_m
    );
    assert!(state.running.is_empty());
    assert_eq!(state.memory_used_bytes, 1_000_000);
    assert!((state.load_w - 32.0).abs() < 1e-9);
    let energy = bench.energy();
    // 30 s of one fault and 20 s of the other.
    assert!((energy.fault_j - 500.0).abs() < 1e-6, "{}", energy.fault_j);
    assert!(energy.imbalance_j().abs() < 1e-12 * energy.total_j());
    assert_eq!(bench.done(drive(5.0, 0.0)).1.end, CommandEnd::Done);
}

#[test]
fn faults_by_chance_have_their_rate_and_leave_each_other_alone() {
    let until = SimDuration::from_secs_f64(1000.0 * SOL_S);
    let rates = |slip, dust| FaultRates {
        slip,
        dust,
        ..FaultRates::default()
    };
    let plan = |rates: &FaultRates| super::super::faults::plan(&[], rates, "rover_01", 9, until);
    let of = |all: &[PlannedFault], kind| {
        let of_kind = all.iter().filter(|fault| fault.begins.kind == kind);
        of_kind
            .map(|fault| (fault.at, fault.ends))
            .collect::<Vec<_>>()
    };
    let (one, both) = (plan(&rates(2.0, 0.0)), plan(&rates(2.0, 3.0)));
    let slips = of(&one, FaultKind::Slip);
    assert!((1850..2150).contains(&slips.len()), "{}", slips.len());
    assert_eq!(slips, of(&both, FaultKind::Slip));
    assert!((2800..3200).contains(&of(&both, FaultKind::Dust).len()));
    assert!(both.is_sorted_by_key(|fault| (fault.at, fault.begins.number)));
}

#[test]
fn mistakes_in_faults_are_named() {
    use crate::system::settings::Table;
    let refused = |text: &str| {
        let config: RoverConfig = toml::from_str(&format!("[[fault]]\n{text}")).unwrap();
        config.check("rover").unwrap_err().to_string()
    };
    let error = refused("kind = 'stuck-mast'\namount = 1.0");
    assert_eq!(
        error,
        "rover.fault.0.amount: 1: kind = \"stuck-mast\" has no amount"
    );
    let error = refused("kind = 'dust'\namount = 2.0");
    assert!(
        error.starts_with("rover.fault.0.amount: 2: expected 0 to 1"),
        "{error}"
    );
    let error = refused("kind = 'dust'\npart = 'mast'");
    assert_eq!(
        error,
        "rover.fault.0.part: \"mast\": kind = \"dust\" is of no part"
    );
    let error = refused("kind = 'instrument-fails'\npart = 'wheels'");
    assert!(
        error.contains("expected one of pancam, mini_tes"),
        "{error}"
    );
    let error = refused("kind = 'never-ends'\npart = 'panacm'");
    assert!(error.ends_with("did you mean \"pancam\"?"), "{error}");
    assert!(refused("duration = '0s'").contains("duration"));
    assert!(toml::from_str::<RoverConfig>("[[fault]]\nkind = 'dusty'").is_err());
}
