//! Each command, done and stopped.

use std::f64::consts::{FRAC_PI_2, PI};

use super::*;

fn assert_near(actual: f64, expected: f64, within: f64) {
    assert!(
        (actual - expected).abs() <= within,
        "{actual}, not {expected}"
    );
}

#[test]
fn a_drive_takes_its_time_and_ends_at_its_place() {
    let mut bench = Bench::exact();
    // A quarter turn at 180 s a turn, then 5 m at 5 cm/s.
    let (lasts_s, report) = bench.done(drive(0.0, 5.0));
    assert_eq!(report.end, CommandEnd::Done);
    assert_eq!(report.part, Some(Part::Wheels));
    assert_near(lasts_s, 45.0 + 100.0, 1.0);
    assert_near(report.pose.north_m, 5.0, 1e-9);
    assert_near(report.pose.east_m, 0.0, 1e-9);
    assert_near(report.pose.yaw_rad, FRAC_PI_2, 1e-9);
    assert_near(bench.hardware.pose().driven_m, 5.0, 1e-9);
    assert_near(bench.error_m(), 0.0, 1e-9);
    assert_near(bench.energy().wheels_j, 145.0 * 100.0, 0.5);
}

#[test]
fn a_drive_to_where_it_is_is_done_at_once() {
    let mut bench = Bench::exact();
    assert_eq!(bench.answer(drive(0.0, 0.0)), Some(CommandEnd::Done));
    assert_eq!(
        bench.answer(Command::Turn { yaw_rad: 0.0 }),
        Some(CommandEnd::Done)
    );
    let back = Command::BackUp { distance_m: 0.0 };
    assert_eq!(bench.answer(back), Some(CommandEnd::Done));
}

#[test]
fn it_turns_the_shorter_way_and_backs_up_straight() {
    let mut bench = Bench::exact();
    let (lasts_s, report) = bench.done(Command::Turn { yaw_rad: 1.5 * PI });
    assert_near(lasts_s, 45.0, 1.0);
    assert_near(report.pose.yaw_rad, -FRAC_PI_2, 1e-9);
    let (lasts_s, report) = bench.done(Command::BackUp { distance_m: 2.5 });
    assert_near(lasts_s, 50.0, 1.0);
    assert_near(report.pose.north_m, 2.5, 1e-9);
}

#[test]
fn a_drive_is_stopped_where_it_is() {
    let mut bench = Bench::exact();
    let drives = bench.give(drive(5.0, 0.0));
    bench.pass(30.0);
    let state = bench.state();
    assert_near(state.pose.east_m, 1.5, 1e-9);
    let part = Part::Wheels;
    assert_eq!(state.running, [Running { part, id: drives }]);
    let stops = bench.give(STOP);
    let ended: Vec<_> = bench
        .reports()
        .into_iter()
        .map(|report| (report.id, report.end))
        .collect();
    assert_eq!(ended, [(drives, stopped()), (stops, CommandEnd::Done)]);
    bench.pass(100.0);
    assert_near(bench.state().pose.east_m, 1.5, 1e-9);
    assert_near(bench.hardware.pose().driven_m, 1.5, 1e-9);
}

#[test]
fn stop_ends_what_runs_on_one_part_or_on_all_in_one_event() {
    let mut bench = Bench::exact();
    let drives = bench.give(drive(5.0, 0.0));
    let looks = bench.give(angles(1.0, 0.0));
    let sends = bench.give(Command::Transmit {
        to: "base".to_owned(),
        size_bytes: 1_000_000,
    });
    bench.pass(10.0);
    let part = Some(Part::Mast);
    bench.give(Command::Stop { part });
    let reports = bench.reports();
    assert_eq!((reports[0].id, &reports[0].end), (looks, &stopped()));
    assert_eq!(reports.len(), 2);
    // A third of a circle a 40 s.
    assert_near(bench.state().pan_rad, 10.0 / 120.0 * 2.0 * PI, 1e-9);
    bench.give(STOP);
    let ids: Vec<u32> = bench.reports().iter().map(|report| report.id).collect();
    assert_eq!(ids[..2], [drives, sends]);
    assert!(bench.state().running.is_empty());
    let load_w = bench.state().load_w;
    assert_near(load_w, 22.0, 1e-9);
}

#[test]
fn it_sleeps_and_wakes() {
    let mut bench = Bench::exact();
    let duration = SimDuration::from_secs(100);
    let (lasts_s, report) = bench.done(Command::Sleep { duration });
    assert_near(lasts_s, 100.0, 0.0);
    assert_eq!(
        (report.part, report.end),
        (Some(Part::Body), CommandEnd::Done)
    );
    assert_near(bench.energy().body_j, 300.0, 1e-9);
    bench.give(Command::Sleep { duration });
    assert!(bench.state().asleep);
    bench.pass(1.0);
    bench.give(STOP);
    assert!(!bench.state().asleep);
}

#[test]
fn it_heats() {
    let mut bench = Bench::exact();
    let duration = SimDuration::from_secs(100);
    bench.done(Command::Heat { duration });
    assert_near(bench.energy().heater_j, 2200.0, 1e-6);
}

#[test]
fn readings_fill_the_memory_and_transmitting_empties_it() {
    let mut bench = Bench::exact();
    bench.done(down());
    let (lasts_s, report) = bench.done(image(View::Point));
    assert_near(lasts_s, 60.0, 0.0);
    assert_eq!(report.readings.len(), 1);
    let reading = &report.readings[0];
    assert_eq!((reading.id, reading.texture.len()), (3 << 32, 4));
    assert!(reading.spectrum.is_empty() && reading.noise >= 0.02);
    assert_eq!(bench.state().memory_used_bytes, 1_000_000);
    let (_, report) = bench.done(spectrum(View::Point));
    assert_eq!(report.readings[0].id, (3 << 32) + 1);
    assert_eq!(report.readings[0].spectrum.len(), 101);
    let to = "base".to_owned();
    // 1 MB at 128 kbit/s.
    let size_bytes = 1_000_000;
    let (lasts_s, _) = bench.done(Command::Transmit {
        to: to.clone(),
        size_bytes,
    });
    assert_near(lasts_s, 62.5, 1.0);
    assert_eq!(bench.state().memory_used_bytes, 250_000);
    // Stopped half way, half is sent.
    bench.give(Command::Transmit {
        to,
        size_bytes: 160_000,
    });
    bench.pass(5.0);
    bench.give(STOP);
    assert_eq!(bench.state().memory_used_bytes, 170_000);
}

#[test]
fn a_reading_that_is_stopped_leaves_nothing() {
    let mut bench = Bench::exact();
    bench.done(down());
    bench.give(image(View::Point));
    bench.pass(59.0);
    bench.give(STOP);
    let reports = bench.reports();
    assert!(reports[0].readings.is_empty() && reports[0].end == stopped());
    assert_eq!(bench.state().memory_used_bytes, 0);
}

#[test]
fn an_instrument_on_the_body_looks_where_it_faces() {
    let config = RoverConfig::named("k9").expect("a model");
    let mut spec = spec(level_field(1), config);
    spec.start.yaw_rad = FRAC_PI_2;
    let mut bench = Bench::new(spec);
    for (camera, is_north) in [("haz_front", true), ("haz_rear", false)] {
        let camera = camera.to_owned();
        let view = View::Point;
        let (_, report) = bench.done(Command::Image { camera, view });
        let reading = &report.readings[0];
        assert_eq!(reading.north_m > 0.0, is_north, "{reading:?}");
        assert_near(reading.north_m.abs(), reading.range_m, 0.2);
        assert_near(reading.east_m, 0.0, 0.1);
    }
}

/// A rock of a field that nothing else is near, and a place two metres to the west of it.
fn lonely_rock(field: &RockField) -> (u32, [f64; 2]) {
    let is_lonely = |place: &nalgebra::Point2<f64>| {
        let inside = place.x.abs() < 40.0 && place.y.abs() < 40.0;
        inside && field.near(*place, 3.0).count() == 1
    };
    let mut rocks = (0..).zip(field.rocks());
    let found = rocks.find(|(_, rock)| is_lonely(&rock.position_m) && rock.diameter_m < 0.9);
    let (number, rock) = found.expect("a rock by itself");
    (number, [rock.position_m.x - 2.0, rock.position_m.y])
}

#[test]
fn a_point_reading_is_of_what_the_mast_points_at() {
    let field = level_field(40);
    let (rock, [east_m, north_m]) = lonely_rock(&field);
    let clean = field.reflectance(rock as usize).to_vec();
    let ground = field.ground_reflectance().to_vec();
    let mut spec = spec(field, exact());
    (spec.start.east_m, spec.start.north_m) = (east_m, north_m);
    let mut bench = Bench::new(spec);
    bench.done(at(east_m + 2.0, north_m));
    let (_, report) = bench.done(spectrum(View::Point));
    let reading = &report.readings[0];
    assert_eq!(reading.rock, Some(rock));
    assert_near(reading.east_m, east_m + 2.0, 0.15);
    let distance = |from: &[f64]| -> f64 {
        let squares = from
            .iter()
            .zip(&reading.spectrum)
            .map(|(a, b)| (a - b) * (a - b));
        libm::sqrt(squares.sum::<f64>() / from.len() as f64)
    };
    assert!(
        distance(&clean) < 2.0 * reading.noise,
        "{}",
        distance(&clean)
    );
    // Beside it there is ground.
    bench.done(at(east_m + 2.0, north_m + 2.0));
    let (_, report) = bench.done(spectrum(View::Point));
    assert_eq!(report.readings[0].rock, None);
    let reading = &report.readings[0];
    let squares = ground
        .iter()
        .zip(&reading.spectrum)
        .map(|(a, b)| (a - b) * (a - b));
    assert!(libm::sqrt(squares.sum::<f64>() / ground.len() as f64) < 2.0 * reading.noise);
}

#[test]
fn a_rover_that_does_not_know_where_it_is_points_past_a_rock() {
    let field = level_field(40);
    let (rock, [east_m, north_m]) = lonely_rock(&field);
    for (slip, is_hit) in [(0.0, true), (0.9, false)] {
        let mut spec = spec(field.clone(), exact());
        (spec.start.east_m, spec.start.north_m) = (east_m, north_m);
        let mut bench = Bench::new(spec);
        bench.done(Command::Turn { yaw_rad: FRAC_PI_2 });
        bench.fails(FaultKind::Slip, "", slip);
        bench.done(drive(east_m, north_m + 1.5));
        bench.done(at(east_m + 2.0, north_m));
        let (_, report) = bench.done(image(View::Point));
        assert_eq!(report.readings[0].rock == Some(rock), is_hit, "slip {slip}");
    }
}

#[test]
fn from_afar_the_beam_takes_in_what_is_beside_it() {
    let field = level_field(40);
    let (rock, [east_m, north_m]) = lonely_rock(&field);
    let clean = field.reflectance(rock as usize).to_vec();
    let mut config = exact();
    let point = config.instruments[1].point.as_mut();
    let point = point.expect("it reads points");
    // 12 cm wide at the rock, and 1.4 m from afar.
    (point.noise, point.beam_rad) = (0.0, 0.06);
    let off_at = |behind_m: f64| {
        let mut spec = spec(field.clone(), config.clone());
        (spec.start.east_m, spec.start.north_m) = (east_m - behind_m, north_m);
        let mut bench = Bench::new(spec);
        bench.done(at(east_m + 2.0, north_m));
        let (_, report) = bench.done(spectrum(View::Point));
        let differences = clean.iter().zip(&report.readings[0].spectrum);
        differences.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let [near, far] = [off_at(0.0), off_at(22.0)];
    assert!(near < 1e-9 && far > 0.01, "{near} {far}");
}

#[test]
fn noise_grows_with_range_and_a_panorama_is_coarse() {
    let field = level_field(90);
    let mut spec = spec(field, exact());
    (spec.start.east_m, spec.start.north_m) = (5.0, 5.0);
    let mut bench = Bench::new(spec);
    bench.done(down());
    let (_, near) = bench.done(image(View::Point));
    bench.done(angles(0.0, -0.1));
    let (_, far) = bench.done(image(View::Point));
    let [near, far] = [near, far].map(|report| report.readings[0].clone());
    assert!(far.range_m > 2.0 * near.range_m && far.noise > 1.5 * near.noise);
    let (_, all) = bench.done(image(View::Panorama));
    assert!(all.readings.len() > 5, "{}", all.readings.len());
    let mut rocks: Vec<_> = all.readings.iter().map(|reading| reading.rock).collect();
    rocks.dedup();
    assert_eq!(rocks.len(), all.readings.len());
    for reading in &all.readings {
        assert!(reading.rock.is_some() && reading.noise >= 0.08 && reading.range_m < 62.0);
        assert!(reading.texture.iter().all(|value| value.is_finite()));
    }
}

#[test]
fn the_estimate_strays_with_distance_and_an_image_brings_it_back() {
    let field = level_field(90);
    let mut config = RoverConfig::named("mer").expect("a model");
    config.lease = SimDuration::ZERO;
    config.battery_j = 1e9;
    config.memory_bytes = 1_000_000_000;
    let mut bench = Bench::new(spec(field, config));
    bench.done(image(View::Panorama));
    let mut errors_m = vec![0.0];
    for (east_m, north_m) in [(4.0, 1.0), (9.0, 0.0), (14.0, 2.0), (19.0, 0.0)] {
        bench.done(drive(east_m, north_m));
        errors_m.push(bench.error_m());
    }
    let before_m = *errors_m.last().unwrap();
    assert!(errors_m[1] > 0.02 && before_m > errors_m[1], "{errors_m:?}");
    let sigma_m = bench.state().pose.position_sigma_m;
    assert!(sigma_m > errors_m[1]);
    let (_, report) = bench.done(image(View::Panorama));
    let after_m = bench.error_m();
    assert!(after_m < 0.3 * before_m, "{after_m} after {before_m}");
    assert!(report.pose.position_sigma_m < 0.3 * sigma_m);
    let placed = |one: &RoverIncident| matches!(one, RoverIncident::Placed { .. });
    assert_eq!(bench.count(placed), 1);
    let placed = |incident: &RoverIncident| matches!(incident, RoverIncident::Placed { .. });
    assert!(bench.incidents().iter().any(placed));
}

#[test]
fn a_boulder_blocks_the_way() {
    let field = level_field(60);
    let least_m = field.settings().boulder_least_m;
    let boulders = field
        .rocks()
        .iter()
        .filter(|rock| rock.diameter_m > least_m);
    let is_clear = |rock: &&farside_worlds::FieldRock| {
        let west = nalgebra::Point2::new(rock.position_m.x - 3.0, rock.position_m.y);
        rock.position_m.x.abs() < 40.0 && field.near(west, 2.5).next().is_none()
    };
    let boulder = *boulders.clone().find(is_clear).expect("a boulder");
    let place_m = boulder.position_m;
    let mut spec = spec(field, exact());
    (spec.start.east_m, spec.start.north_m) = (place_m.x - 3.0, place_m.y);
    let mut bench = Bench::new(spec);
    let (_, report) = bench.done(drive(place_m.x + 3.0, place_m.y));
    let by = Obstacle::Boulder;
    let reason = Failure::Blocked { by };
    assert_eq!(report.end, CommandEnd::Failed { reason });
    // In front of it, and it can leave.
    let gap_m = place_m.x - report.pose.east_m;
    assert!(
        gap_m > 0.3 * boulder.diameter_m && gap_m < boulder.diameter_m + 1.0,
        "{gap_m}"
    );
    let (_, report) = bench.done(Command::BackUp { distance_m: 1.0 });
    assert_eq!(report.end, CommandEnd::Done);
}

#[test]
fn slopes_tilt_it_slow_it_and_cost_power() {
    let settings = RockFieldSettings {
        hills: 6,
        hill_height_m: 6.0,
        rocks: FieldRocks::Exactly(1),
        ..RockFieldSettings::default()
    };
    let field = RockField::generate(&settings).expect("within its ranges");
    let mut config = exact();
    config.slope_slowdown = 2.0;
    config.battery_j = 1e9;
    let mut bench = Bench::new(spec(field, config));
    let (lasts_s, report) = bench.done(drive(12.0, 9.0));
    assert_eq!(report.end, CommandEnd::Done);
    let level_s = 15.0 / 0.05 + libm::atan2(9.0, 12.0) / (2.0 * PI) * 180.0;
    assert!(
        lasts_s > level_s + 1.0,
        "{lasts_s} s, and {level_s} s on level ground"
    );
    let energy_j = bench.energy().wheels_j;
    assert!(energy_j > 100.0 * lasts_s - 200.0);
    let tilted = bench.out.iter().filter_map(|output| match output {
        Output::Pose(pose) => Some(pose.pitch_rad.abs() + pose.roll_rad.abs()),
        _ => None,
    });
    assert!(tilted.fold(0.0, f64::max) > 0.01);
}
