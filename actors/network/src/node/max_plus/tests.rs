//! A deadlock made by hand, from the links up: two rovers head-on, with one branch beside the line.

use std::sync::Arc;

use farside::prelude::*;
use farside_worlds::{Endpoints, Roadmap};
use nalgebra::Point2;

use crate::testing::{assembled, v};
use crate::{
    Deadlock, MaxPlusConfig, NetworkConfig, NetworkMetrics, NoProgress, TeamConfig, WorldConfig,
};

/// 0 to 8 in a row, 10 m apart, and the branch 9 beside 2.
fn line_with_a_branch() -> Roadmap {
    let mut places: Vec<_> = (0..9)
        .map(|i| Point2::new(10.0 * f64::from(i), 0.0))
        .collect();
    places.push(Point2::new(20.0, 10.0));
    let mut edges: Vec<_> = (0..8).map(|i| (v(i), v(i + 1))).collect();
    edges.push((v(2), v(9)));
    Roadmap::new("line", places, edges, vec![v(0), v(8)]).unwrap()
}

/// Two rovers from the two ends, whose nodes have no time to agree on anything; `None` if this seed
/// sends both the same way.
fn head_on(seed: u64, network: &NetworkConfig) -> Option<NetworkMetrics> {
    let world = WorldConfig {
        nodes: 3,
        radius_m: Some(60.0),
        endpoints: Endpoints::AnyToAny,
        ..WorldConfig::default()
    };
    let roadmap = Arc::new(line_with_a_branch());
    let sensors = Arc::new(world.place(&roadmap, seed).ok()?);
    let network = NetworkConfig {
        max_plus: MaxPlusConfig {
            max_iterations: 0,
            ..network.max_plus.clone()
        },
        cycle_limit: 400,
        ..network.clone()
    };
    let team = TeamConfig::of(2);
    let (sim, system) = assembled(seed, &world, roadmap, sensors, &team, &network);
    if system.missions()[0].0 == system.missions()[1].0 {
        return None;
    }
    let report = sim.run(Executor::Inline).unwrap();
    assert_eq!(report.end.name(), "stopped");
    Some(system.metrics())
}

#[test]
fn two_rovers_head_on_are_named_and_one_goes_aside() {
    let mut met = 0;
    for seed in 1..=24 {
        let on = |deadlock_probes, junction_resolution| NetworkConfig {
            max_plus: MaxPlusConfig {
                deadlock_probes,
                junction_resolution,
                ..MaxPlusConfig::default()
            },
            ..NetworkConfig::default()
        };
        let Some(off) = head_on(seed, &on(true, false)) else {
            continue;
        };
        met += 1;
        // They wait in a circle, and have room to back out: nothing proves that they never will.
        assert_eq!(
            (off.deadlock, off.no_progress),
            (Deadlock::None, NoProgress::Standing)
        );
        assert_eq!(off.wait_cycles.len(), 1);
        assert!(off.confirmed_deadlocks > 0);
        assert_eq!(off.last_confirmed.as_deref(), Some("rover_01 > rover_02"));
        assert_eq!(
            head_on(seed, &on(false, false))
                .unwrap()
                .confirmed_deadlocks,
            0
        );
        let resolved = head_on(seed, &on(false, true)).unwrap();
        assert_eq!((resolved.arrived, resolved.collisions), (2, 0));
        assert!(resolved.confirmed_deadlocks > 0 && resolved.mean_backtracks > 0.0);
    }
    assert!(met >= 3, "{met} seeds made them meet");
}
