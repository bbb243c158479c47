//! Each reason for which a command is refused.

use super::*;

fn out_of_range(refusal: &Refusal) -> &str {
    match refusal {
        Refusal::OutOfRange { what, .. } => what,
        other => panic!("not out of range: {other:?}"),
    }
}

#[test]
fn a_part_never_runs_two_commands() {
    let mut bench = Bench::exact();
    let drives = bench.give(drive(5.0, 0.0));
    let wheels = Refusal::Busy {
        part: Part::Wheels,
        by: drives,
    };
    assert_eq!(bench.refusal(drive(1.0, 0.0)), wheels);
    assert_eq!(bench.refusal(Command::Turn { yaw_rad: 1.0 }), wheels);
    assert_eq!(bench.refusal(Command::BackUp { distance_m: 1.0 }), wheels);
    // A reading needs standing wheels and mast.
    assert_eq!(bench.refusal(image(View::Panorama)), wheels);
    let duration = SimDuration::from_secs(1);
    assert_eq!(bench.refusal(Command::Sleep { duration }), wheels);
    bench.give(STOP);
    bench.done(down());
    let reads = bench.give(image(View::Point));
    let name = "pancam".to_owned();
    let part = Part::Instrument { name };
    let camera = Refusal::Busy { part, by: reads };
    assert_eq!(bench.refusal(image(View::Point)), camera);
    assert_eq!(bench.refusal(drive(1.0, 0.0)), camera);
    assert_eq!(bench.refusal(angles(1.0, 0.0)), camera);
    assert_eq!(bench.refusal(spectrum(View::Point)), camera);
    let heats = bench.give(Command::Heat { duration });
    let part = Part::Heater;
    assert_eq!(
        bench.refusal(Command::Heat { duration }),
        Refusal::Busy { part, by: heats }
    );
    let transmit = |size_bytes| Command::Transmit {
        to: String::new(),
        size_bytes,
    };
    let sends = bench.give(transmit(100_000));
    let part = Part::Radio;
    assert_eq!(
        bench.refusal(transmit(1)),
        Refusal::Busy { part, by: sends }
    );
}

#[test]
fn values_out_of_range_are_named() {
    let mut bench = Bench::exact();
    for bad in [f64::NAN, f64::INFINITY, -1e9, 1e9] {
        assert_eq!(out_of_range(&bench.refusal(drive(bad, 0.0))), "east_m");
        assert_eq!(out_of_range(&bench.refusal(drive(0.0, bad))), "north_m");
        assert_eq!(out_of_range(&bench.refusal(at(0.0, bad))), "north_m");
        assert_eq!(out_of_range(&bench.refusal(angles(bad, 0.0))), "pan_rad");
        assert_eq!(out_of_range(&bench.refusal(angles(0.0, bad))), "tilt_rad");
        assert_eq!(
            out_of_range(&bench.refusal(Command::Turn { yaw_rad: bad })),
            "yaw_rad"
        );
        let back = Command::BackUp { distance_m: bad };
        assert_eq!(out_of_range(&bench.refusal(back)), "distance_m");
    }
    for duration in [SimDuration::ZERO, SimDuration::MAX] {
        let refused = [Command::Heat { duration }, Command::Sleep { duration }];
        for command in refused {
            assert_eq!(out_of_range(&bench.refusal(command)), "duration");
        }
    }
    for size_bytes in [0, u64::MAX] {
        let to = String::new();
        let refused = bench.refusal(Command::Transmit { to, size_bytes });
        assert_eq!(out_of_range(&refused), "size_bytes");
    }
    // Where one stands there is nothing to point at within the mast's range.
    assert_eq!(out_of_range(&bench.refusal(at(0.01, 0.0))), "tilt_rad");
}

#[test]
fn parts_that_it_has_not_are_named() {
    let mut bench = Bench::exact();
    let camera = "pancan".to_owned();
    let refused = bench.refusal(Command::Image {
        camera,
        view: View::Point,
    });
    let nearest = Some("pancam".to_owned());
    let found = "pancan".to_owned();
    assert_eq!(refused, Refusal::NoSuchPart { found, nearest });
    let name = "mini_tse".to_owned();
    let part = Some(Part::Instrument { name });
    let refused = bench.refusal(Command::Stop { part });
    assert!(matches!(refused, Refusal::NoSuchPart { nearest: Some(n), .. } if n == "mini_tes"));
    // A camera takes no spectrum.
    let spectrometer = "pancam".to_owned();
    let refused = bench.refusal(Command::Spectrum {
        spectrometer,
        view: View::Point,
    });
    assert!(matches!(refused, Refusal::Unable { .. }));
}

#[test]
fn nothing_is_in_view_of_the_sky() {
    let mut bench = Bench::exact();
    bench.done(angles(0.0, 0.5));
    assert_eq!(bench.refusal(image(View::Point)), Refusal::NothingInView);
}

#[test]
fn it_needs_room_in_memory() {
    let mut config = exact();
    config.memory_bytes = 1_200_000;
    let mut bench = Bench::new(spec(level_field(1), config));
    bench.done(down());
    bench.done(image(View::Point));
    let refused = bench.refusal(image(View::Point));
    let (needed_bytes, free_bytes) = (1_000_000, 200_000);
    assert_eq!(
        refused,
        Refusal::NotEnoughMemory {
            needed_bytes,
            free_bytes
        }
    );
}

#[test]
fn it_needs_energy() {
    let mut config = exact();
    config.battery_j = 1e5;
    config.charge = 0.2;
    let mut bench = Bench::new(spec(level_field(1), config));
    match bench.refusal(drive(40.0, 0.0)) {
        Refusal::NotEnoughEnergy {
            needed_j,
            available_j,
        } => {
            assert_eq!(needed_j, 40.0 / 0.05 * 100.0);
            assert!((available_j - 5000.0).abs() < 1e-6);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn asleep_it_does_nothing() {
    let mut bench = Bench::exact();
    let duration = SimDuration::from_secs(1000);
    bench.give(Command::Sleep { duration });
    let commands = [
        drive(1.0, 0.0),
        down(),
        image(View::Panorama),
        Command::Heat { duration },
        Command::Sleep { duration },
    ];
    for command in commands {
        assert_eq!(bench.refusal(command), Refusal::Asleep);
    }
    bench.give(Command::Stop {
        part: Some(Part::Body),
    });
    assert_eq!(bench.answer(drive(1.0, 0.0)), None);
}
