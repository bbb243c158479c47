//! Energy and memory are conserved and within their bounds, whatever is commanded and whatever
//! breaks; and a battery does what one that is stepped by the second does.

use farside_worlds::sky::SOL_S;
use proptest::prelude::*;

use super::super::power::{CONSUMERS, Power};
use super::*;

#[derive(Clone, Debug)]
enum Deed {
    Give(Command),
    Fail(FaultKind, &'static str, f64),
    /// A fault ends, of those that began.
    Mend(u32),
    /// Links charge \[J\].
    Charge(f64),
    Restart,
}

fn command() -> impl Strategy<Value = Command> {
    let metre = || prop_oneof![8 => -20.0..20.0f64, 1 => Just(f64::NAN), 1 => -1e4..1e4f64];
    let name = prop_oneof![Just("pancam"), Just("mini_tes"), Just("pen")];
    let view = prop_oneof![Just(View::Point), Just(View::Panorama)];
    let instrument = (name, view, any::<bool>());
    let lasts = (0u64..20_000).prop_map(SimDuration::from_secs);
    prop_oneof![
        4 => (metre(), metre()).prop_map(|(east_m, north_m)| drive(east_m, north_m)),
        1 => (-7.0..7.0f64).prop_map(|yaw_rad| Command::Turn { yaw_rad }),
        1 => (-1.0..5.0f64).prop_map(|distance_m| Command::BackUp { distance_m }),
        1 => Just(STOP),
        1 => any::<bool>().prop_map(|on| Command::Fans { on }),
        1 => Just(Command::Stop { part: Some(Part::Wheels) }),
        1 => (metre(), metre()).prop_map(|(east_m, north_m)| at(east_m, north_m)),
        2 => (-4.0..4.0f64, -1.5..1.0f64).prop_map(|(pan, tilt)| angles(pan, tilt)),
        4 => instrument.prop_map(|(name, view, is_image)| match is_image {
            true => Command::Image { camera: name.to_owned(), view },
            false => Command::Spectrum { spectrometer: name.to_owned(), view },
        }),
        1 => (0u64..20_000_000).prop_map(|size_bytes| {
            Command::Transmit { to: "base".to_owned(), size_bytes }
        }),
        1 => lasts.clone().prop_map(|duration| Command::Heat { duration }),
        1 => lasts.prop_map(|duration| Command::Sleep { duration }),
    ]
}

fn deed() -> impl Strategy<Value = Deed> {
    let kind = prop::sample::select(FaultKind::ALL.to_vec());
    let part = vec![
        "",
        "wheels",
        "mast",
        "pancam",
        "mini_tes",
        "front",
        "rear-left",
    ];
    let part = prop::sample::select(part);
    let fault = (kind, part, 0.0..1.0f64).prop_map(|(kind, part, share)| {
        let amount = match kind {
            FaultKind::EndsLate => 1.0 + 10.0 * share,
            FaultKind::EndsEarly => 0.01 + 0.99 * share,
            FaultKind::ExtraPower => 300.0 * share,
            FaultKind::BlockedPath => 0.01 + 3.0 * share,
            FaultKind::BayHeat => 300.0 * share,
            _ => 0.95 * share,
        };
        Deed::Fail(kind, part, amount)
    });
    prop_oneof![
        12 => command().prop_map(Deed::Give),
        4 => fault,
        2 => (0u32..10).prop_map(Deed::Mend),
        1 => (0.0..3e4f64).prop_map(Deed::Charge),
        1 => Just(Deed::Restart),
    ]
}

/// What must hold after everything.
fn check(bench: &mut Bench) -> Result<(), TestCaseError> {
    let resources = bench.hardware.resources();
    let energy = resources.energy;
    prop_assert!(
        energy.imbalance_j().abs() <= 1e-9 * energy.total_j(),
        "{:?}",
        energy
    );
    let state = bench.state();
    prop_assert!(state.battery_j >= 0.0 && state.battery_j <= state.battery_capacity_j);
    prop_assert!(state.memory_used_bytes <= state.memory_size_bytes);
    let held = resources.stored_bytes - resources.sent_bytes - resources.lost_bytes;
    prop_assert_eq!(held, state.memory_used_bytes);
    // Below the cutoff only in a brown-out, and then nothing runs.
    let cutoff_j = 0.15 * state.battery_capacity_j;
    prop_assert!(state.brown_out || state.battery_j >= cutoff_j - 1e-3);
    prop_assert!(!state.brown_out || (state.load_w == 0.0 && state.running.is_empty()));
    let incidents = bench.incidents();
    let unsupplied = |one: &RoverIncident| matches!(one, RoverIncident::Unsupplied { .. });
    prop_assert_eq!(energy.unsupplied_j > 0.0, incidents.iter().any(unsupplied));
    // Between two brown-outs the battery recovers.
    let mut browned = false;
    for one in &incidents {
        match one {
            RoverIncident::BrownOut { .. } => prop_assert!(!std::mem::replace(&mut browned, true)),
            RoverIncident::Recovered => prop_assert!(std::mem::replace(&mut browned, false)),
            _ => {}
        }
    }
    prop_assert_eq!(browned, state.brown_out);
    let pose = bench.hardware.pose();
    prop_assert!(
        error_m(&pose).is_finite() && pose.roll_rad.abs() < 1.5 && pose.pitch_rad.abs() < 1.5
    );
    // The air's coldest, and what all power at once could heat.
    prop_assert!(
        (-77.0..2500.0).contains(&resources.bay_c),
        "{} °C",
        resources.bay_c
    );
    prop_assert!(!resources.fans_run || (state.fans_on && !state.asleep && !state.brown_out));
    let mut parts: Vec<_> = state.running.iter().map(|running| &running.part).collect();
    let running = parts.len();
    parts.dedup();
    prop_assert_eq!(parts.len(), running);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn nothing_is_ever_out_of_bounds_or_lost(
        deeds in prop::collection::vec((deed(), 0.0..4000.0f64), 1..60),
        battery_j in prop_oneof![Just(1e5), Just(2e6)],
        seed in 0u64..1000,
        lease_s in prop_oneof![Just(0u64), Just(900)],
    ) {
        let mut config = RoverConfig::named("mer").expect("a model");
        config.battery_j = battery_j;
        config.memory_bytes = 20_000_000;
        config.bay.fan_conductance_w_per_k = 0.5;
        config.lease = SimDuration::from_secs(lease_s);
        let spec = RoverSpec { seed, ..spec(level_field(40), config) };
        let mut bench = Bench::new(spec);
        let (mut links_j, mut given, mut refused) = (0.0, 0u32, 0u32);
        for (deed, wait_s) in deeds {
            bench.now_s += wait_s;
            let now = bench.now();
            match deed {
                Deed::Restart => bench.hardware.restart(now, links_j, &[], &mut bench.out),
                Deed::Charge(energy_j) => {
                    links_j += energy_j;
                    bench.hardware.wake(now, links_j, &mut bench.out);
                }
                other => {
                    bench.hardware.wake(now, links_j, &mut bench.out);
                    match other {
                        Deed::Give(command) => {
                            given += 1;
                            bench.give(command);
                        }
                        Deed::Fail(kind, part, amount) => {
                            bench.fails(kind, part, amount);
                        }
                        Deed::Mend(number) => bench.mended(100 + number),
                        Deed::Restart | Deed::Charge(_) => {}
                    }
                }
            }
            refused += bench.reports().len() as u32;
            check(&mut bench)?;
        }
        prop_assert!(refused <= 2 * given);
    }

    /// Who asks for the state, and how often, changes nothing.
    #[test]
    fn asking_changes_nothing(
        commands in prop::collection::vec((command(), 0.0..2000.0f64), 1..20),
        asks_s in 1.0..500.0f64,
    ) {
        let run = |asks_s: Option<f64>| {
            let mut config = RoverConfig::named("mer").expect("a model");
            (config.battery_j, config.lease) = (1e9, SimDuration::ZERO);
            let mut bench = Bench::new(spec(level_field(20), config));
            for (command, wait_s) in &commands {
                let end_s = bench.now_s + wait_s;
                while let Some(asks_s) = asks_s.filter(|asks_s| bench.now_s + asks_s < end_s) {
                    bench.pass(asks_s);
                    bench.state();
                }
                bench.now_s = end_s;
                bench.pass(0.0);
                bench.give(command.clone());
            }
            let energy = bench.energy();
            (bench.reports(), energy)
        };
        let ((quiet, energy), (asked, again)) = (run(None), run(Some(asks_s)));
        // By their texts: what is no number is unlike itself.
        prop_assert_eq!(format!("{quiet:?}"), format!("{asked:?}"));
        prop_assert!((energy.stored_j - again.stored_j).abs() < 1e-9 * energy.total_j());
        prop_assert!((energy.wheels_j - again.wheels_j).abs() < 1e-9 * energy.total_j());
    }

    /// Under loads that change, against a battery that is stepped by the second.
    #[test]
    fn a_battery_does_what_small_steps_do(
        loads in prop::collection::vec((0.0..300.0f64, 100u64..9000), 1..20),
        clean in 0.0..1.0f64,
        charge in 0.2..1.0f64,
    ) {
        let mut config = exact();
        (config.charge, config.battery_j) = (charge, 4e5);
        let site = spec(level_field(1), exact()).site;
        let mut power = Power::new(&config, &site);
        power.set_clean(clean);
        let (mut stored_j, mut now_s, capacity_j) = (charge * 4e5, 0u64, 4e5);
        for (load_w, lasts_s) in loads {
            let mut loads_w = [0.0; CONSUMERS];
            loads_w[0] = load_w;
            power.set_loads(loads_w);
            power.advance(SimTime::from_secs(now_s + lasts_s));
            for second in now_s..now_s + lasts_s {
                let at_s = second as f64 + 0.5;
                let dust = libm::pow(1.0 - 0.0028, at_s / SOL_S);
                let sun_w_m2 = site.sky.power_w_m2(site.starts_s + at_s);
                let array_w = 1.3 * 0.2 * dust * sun_w_m2;
                let night_w = (6.0 - array_w).max(0.0);
                let net_j = clean * array_w - night_w - load_w;
                stored_j += if net_j > 0.0 { 0.95 * net_j } else { net_j };
                stored_j = f64::clamp(stored_j, 0.0, capacity_j);
            }
            now_s += lasts_s;
            // The Sun is taken every five minutes and straight between.
            let off_j = (power.stored_j() - stored_j).abs();
            prop_assert!(off_j < 2e-3 * capacity_j, "{} and {stored_j}", power.stored_j());
        }
    }

    /// The level is reached when it is said to be, and not before.
    #[test]
    fn a_crossing_is_where_it_is_found(
        load_w in 1.0..400.0f64,
        charge in 0.16..1.0f64,
        looks_s in prop::collection::vec(1u64..3000, 0..10),
    ) {
        let mut config = exact();
        (config.charge, config.battery_j) = (charge, 1e6);
        let mut power = Power::new(&config, &spec(level_field(1), exact()).site);
        let mut loads_w = [0.0; CONSUMERS];
        loads_w[0] = load_w;
        power.set_loads(loads_w);
        let (at, is_crossed) = power.next_crossing();
        let mut now_s = 0;
        for look_s in looks_s {
            now_s += look_s;
            let now = SimTime::from_secs(now_s).min(at);
            power.advance(now);
            prop_assert!(power.stored_j() >= 0.15e6 - 1e-6);
            // Looking changes nothing but the last digits.
            let (again, _) = power.next_crossing();
            let off_ns = again.as_nanos().abs_diff(at.as_nanos());
            prop_assert!(!is_crossed || off_ns < 1_000_000, "{at} and {again}");
        }
        power.advance(at);
        let off_j = power.stored_j() - 0.15e6;
        prop_assert!(is_crossed == (off_j.abs() < 1e-4), "{off_j} J at {at}");
        if is_crossed {
            power.cut_off(true);
            let (recovered, is_over) = power.next_crossing();
            power.advance(recovered);
            prop_assert!(is_over && (power.stored_j() - 0.25e6).abs() < 1e-4);
        }
    }
}
