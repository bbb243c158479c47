//! Whole teams whose nodes fail for good, or are only unheard.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

use farside::carrier::{Carrier, NoChange, Parcel, Verdicts};
use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside_worlds::{NodeId, Roadmap, SensorNetwork, VertexId};
use proptest::prelude::*;

use super::backup_lists;
use crate::safety::messages::RoverState;
use crate::testing::grid;
use crate::{
    Missions, NetworkConfig, NetworkMetrics, Parts, Policy, Sabotage, TeamConfig, WorldConfig,
    assemble_over, missions,
};

/// A link that loses, delays, repeats, and is down between two seconds.
#[derive(Clone, Debug)]
struct Bad {
    loss: f64,
    jitter_ms: u64,
    duplicates: f64,
    outage_s: (u64, u64),
}

const GOOD: Bad = Bad {
    loss: 0.0,
    jitter_ms: 0,
    duplicates: 0.0,
    outage_s: (0, 0),
};

impl Carrier for Bad {
    type Change = NoChange;

    fn min_delay(&self) -> SimDuration {
        SimDuration::from_millis(5)
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        let second = parcel.now().as_nanos() / 1_000_000_000;
        if (self.outage_s.0..self.outage_s.1).contains(&second) {
            return verdicts.lose("outage");
        }
        if parcel.random(0, 0, 0).uniform() < self.loss {
            return verdicts.lose("loss");
        }
        let delay = |copy| {
            let jitter_ns = parcel.random(1, 0, copy).uniform() * self.jitter_ms as f64 * 1e6;
            self.min_delay() + SimDuration::from_nanos(jitter_ns as u64)
        };
        verdicts.deliver(delay(0));
        if parcel.random(2, 0, 0).uniform() < self.duplicates {
            verdicts.deliver(delay(1));
        }
    }

    fn change(&mut self, _change: NoChange, _now: SimTime) {}
}

/// A team and what happens to its nodes.
#[derive(Clone, Debug)]
struct Trial {
    policy: Policy,
    seed: u64,
    rovers: u32,
    nodes: u32,
    /// Columns and rows of a grid; without, the dense crater.
    grid: Option<(u32, u32)>,
    link: Bad,
    /// Nodes that hear no other node, and are not heard by any, between two seconds; rovers they
    /// hear.
    unheard: Vec<(u32, (u64, u64))>,
    /// Who crashes, when, and for how long: nodes by number, then rovers \[ms\].
    crashes: Vec<(u32, u64, Option<u64>)>,
    after: Option<u32>,
    cycle_limit: u32,
    sabotage: Sabotage,
}

const POLICIES: [Policy; 2] = [Policy::MaxPlus, Policy::Complete];

fn crater(policy: Policy, seed: u64) -> Trial {
    Trial {
        policy,
        seed,
        rovers: 25,
        nodes: 28,
        grid: None,
        link: GOOD,
        unheard: Vec::new(),
        crashes: Vec::new(),
        after: Some(3),
        cycle_limit: 400,
        sabotage: Sabotage::None,
    }
}

/// Where rovers were last.
#[derive(Clone, Default)]
struct Places(Arc<Mutex<BTreeMap<u32, Option<VertexId>>>>);

impl Observer for Places {
    fn wants(&self) -> Wants {
        Wants {
            samples: true,
            ..Wants::default()
        }
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        if record.class == RecordClass::Sample
            && let Some(kind) = record.kind.filter(|kind| kind.name() == "RoverState")
        {
            let state = kind.schema().decode::<RoverState>(record.body);
            let fact = state.map_err(|e| ObserverError(e.to_string()))?.whereabouts;
            let place = fact.moving_to.or(fact.vertex);
            self.0.lock().unwrap().insert(fact.rover.0, place);
        }
        Ok(Flow::Continue)
    }
}

fn world(trial: &Trial) -> (WorldConfig, Arc<Roadmap>, Arc<SensorNetwork>) {
    let world = WorldConfig {
        nodes: trial.nodes,
        radius_m: trial.grid.map(|_| 100.0),
        ..WorldConfig::default()
    };
    let map = match trial.grid {
        Some((columns, rows)) => grid(columns, rows, &[]),
        None => Roadmap::builtin(world.roadmap.name()).unwrap(),
    };
    let sensors = world.place(&map, trial.seed).unwrap();
    (world, Arc::new(map), Arc::new(sensors))
}

fn run(trial: &Trial) -> (NetworkMetrics, Report) {
    run_on(trial, Executor::Inline, None, Places::default())
}

fn run_on(
    trial: &Trial,
    executor: Executor,
    stop: Option<SimTime>,
    places: Places,
) -> (NetworkMetrics, Report) {
    let (world, map, sensors) = world(trial);
    let mut sim = Simulation::new(trial.seed);
    let number = |name: &str| {
        name.strip_prefix("node_")
            .and_then(|n| n.parse::<u32>().ok())
    };
    let link = |from: &str, to: &str| {
        let mut link = trial.link.clone();
        if let (Some(from), Some(to)) = (number(from), number(to)) {
            let cut = |&&(node, _): &&(u32, _)| node + 1 == from || node + 1 == to;
            link.outage_s = trial.unheard.iter().find(cut).map_or((0, 0), |cut| cut.1);
        }
        link
    };
    let settings = NetworkConfig {
        policy: trial.policy,
        failover_after: trial.after,
        cycle_limit: trial.cycle_limit,
        // These links do not say how late they may be: what is passed round a failure takes many of
        // them.
        deadlock_window: trial.cycle_limit / 5,
        livelock_window: trial.cycle_limit,
        sabotage: trial.sabotage,
        ..NetworkConfig::default()
    };
    let team = TeamConfig::of(trial.rovers);
    let missions = missions(&world, &map, &team, trial.seed).unwrap();
    let parts = Parts {
        world: &world,
        roadmap: map,
        sensors,
        config: &settings,
        terrain: None,
        only: &[],
    };
    let missions = Missions::Queued(missions);
    let network = assemble_over(&mut sim, &parts, &missions, link).unwrap();
    let names = [network.node_names(), network.rover_names()].concat();
    for &(who, at, back) in &trial.crashes {
        let name = &names[who as usize % names.len()];
        let down = SimTime::ZERO + SimDuration::from_millis(at);
        sim.crash_named_at(down, name).unwrap();
        if let Some(back) = back {
            let up = down + SimDuration::from_millis(back);
            sim.restart_named_at(up, name).unwrap();
        }
    }
    if let Some(time) = stop {
        sim.stop_at(time, "looking");
    }
    sim.observe(places);
    let report = sim.run(executor).unwrap();
    // Rovers wait for nodes without a timer: where all nodes are gone nothing happens any more.
    let gone = trial.crashes.iter().filter(|crash| crash.2.is_none());
    let gone: BTreeSet<usize> = gone.map(|crash| crash.0 as usize % names.len()).collect();
    let no_node_is_left = (0..network.node_names().len()).all(|node| gone.contains(&node));
    let (end, detail) = (report.end.name(), report.end.detail());
    assert!(
        end == "stopped" || no_node_is_left && end == "completed",
        "{end}: {detail}"
    );
    (network.metrics(), report)
}

const CRASH_MS: u64 = 10_007;

/// Nodes with rovers on their vertices when the tenth cycle begins, the most first.
fn busiest(trial: &Trial) -> Vec<NodeId> {
    let places = Places::default();
    let stop = SimTime::ZERO + SimDuration::from_millis(CRASH_MS);
    run_on(trial, Executor::Inline, Some(stop), places.clone());
    let sensors = world(trial).2;
    let on: Vec<NodeId> = places
        .0
        .lock()
        .unwrap()
        .values()
        .flatten()
        .map(|&v| sensors.owner(v))
        .collect();
    let mut nodes: Vec<NodeId> = sensors.nodes().filter(|n| on.contains(n)).collect();
    nodes.sort_by_key(|n| std::cmp::Reverse(on.iter().filter(|o| *o == n).count()));
    nodes
}

fn all_arrive(trial: &Trial, failovers: u32) {
    let (metrics, report) = run(trial);
    let detail = report.end.detail();
    assert_eq!(
        (metrics.arrived, metrics.collisions),
        (trial.rovers, 0),
        "{detail} {:?}",
        metrics.failed_over
    );
    assert_eq!(metrics.failovers, failovers, "{:?}", metrics.failed_over);
    assert_eq!(metrics.failed_over.len(), failovers as usize);
}

/// A node with rovers on its vertices is gone for good: with failover all rovers arrive, and
/// without some never do.
#[test]
fn a_neighbour_takes_over_for_a_node_that_is_gone_for_good() {
    for (policy, seed) in POLICIES
        .iter()
        .flat_map(|&p| (1..=4).map(move |seed| (p, seed)))
    {
        let mut trial = crater(policy, seed);
        let victim = busiest(&trial)[0];
        trial.crashes = vec![(victim.0, CRASH_MS, None)];
        all_arrive(&trial, 1);
        trial.after = None;
        let (metrics, _) = run(&trial);
        assert!(!metrics.completed && metrics.failovers == 0, "seed {seed}");
    }
}

#[test]
fn a_takeover_outlasts_the_loss_of_a_third_of_all_messages() {
    for policy in POLICIES {
        let mut trial = crater(policy, 2);
        trial.rovers = 12;
        let victim = busiest(&trial)[0];
        trial.link.loss = 0.3;
        // Of six messages one is nearly always heard.
        trial.after = Some(8);
        trial.cycle_limit = 2000;
        trial.crashes = vec![(victim.0, CRASH_MS, None)];
        all_arrive(&trial, 1);
    }
}

#[test]
fn two_nodes_far_apart_are_taken_over_by_two() {
    for policy in POLICIES {
        let mut trial = crater(policy, 3);
        let busy = busiest(&trial);
        let (_, map, sensors) = world(&trial);
        let lines = backup_lists(&map, &sensors);
        let first = busy[0];
        let apart = |n: &&NodeId| {
            lines[n.0 as usize]
                .iter()
                .all(|m| *m != first && !sensors.are_neighbors(first, *m))
        };
        let second = *busy.iter().find(apart).expect("a busy node far away");
        trial.crashes = vec![(first.0, CRASH_MS, None), (second.0, CRASH_MS, None)];
        all_arrive(&trial, 2);
    }
}

/// When the backup fails too, the next in the list goes on for both of its regions.
#[test]
fn the_next_in_line_follows_a_backup_that_fails_too() {
    for policy in POLICIES {
        let mut trial = crater(policy, 1);
        let victim = busiest(&trial)[0];
        let (_, map, sensors) = world(&trial);
        let line = backup_lists(&map, &sensors)[victim.0 as usize].clone();
        assert!(line.len() > 2);
        trial.crashes = vec![
            (victim.0, CRASH_MS, None),
            (line[1].0, CRASH_MS + 6000, None),
        ];
        all_arrive(&trial, 3);
    }
}

/// Who comes back, or was only unheard, stays out.
#[test]
fn a_node_that_was_replaced_stays_out() {
    for policy in POLICIES {
        let mut trial = crater(policy, 2);
        let victim = busiest(&trial)[0];
        trial.crashes = vec![(victim.0, CRASH_MS, Some(8_000))];
        all_arrive(&trial, 1);
        trial.crashes.clear();
        trial.unheard = vec![(victim.0, (10, 20))];
        all_arrive(&trial, 1);
    }
}

/// Whichever node fails, and whenever: with the policy `complete` no reserved way is lost.
#[test]
fn whoever_fails_every_way_is_driven_to_its_end() {
    for (node, at) in (0..28).zip([700u64, 5_003, 9_011, 14_002].into_iter().cycle()) {
        let mut trial = crater(Policy::Complete, 5);
        trial.rovers = 60;
        trial.crashes = vec![(node, at, None)];
        all_arrive(&trial, 1);
    }
}

#[test]
fn threads_change_nothing() {
    for policy in POLICIES {
        let mut trial = crater(policy, 4);
        let victim = busiest(&trial)[0];
        trial.link = Bad {
            loss: 0.05,
            jitter_ms: 3,
            ..GOOD
        };
        trial.crashes = vec![(victim.0, CRASH_MS, None)];
        let threads = Executor::Kameo { threads: 2 };
        let threads = run_on(&trial, threads, None, Places::default());
        let inline = run(&trial);
        assert_eq!(inline.0.failovers, 1);
        assert_eq!(threads, inline);
    }
}

#[test]
fn only_nodes_that_decide_as_they_go_are_replaced() {
    let mut network = NetworkConfig {
        failover_after: Some(3),
        ..NetworkConfig::default()
    };
    assert!(network.check().is_ok());
    network.policy = Policy::Complete;
    assert!(network.check().is_ok());
    network.policy = Policy::Reference;
    let text = network.check().unwrap_err().to_string();
    assert_eq!(
        text,
        "network.failover_after is for the policies max-plus and complete; leave it out"
    );
    network.failover_after = Some(0);
    let text = network.check().unwrap_err().to_string();
    assert_eq!(text, "network.failover_after: 0: expected at least 1");
}

/// By brute force: each in line hears all before it, none of those left out does, and the first
/// reaches as many of the owners around as any could.
#[test]
fn a_line_is_a_clique_and_its_first_reaches_the_most() {
    for seed in 1..=5 {
        let (_, map, sensors) = world(&crater(Policy::MaxPlus, seed));
        for (region, line) in sensors.nodes().zip(backup_lists(&map, &sensors)) {
            assert_eq!(line[0], region);
            for m in sensors.nodes() {
                let hears = |n: &&NodeId| sensors.are_neighbors(m, **n);
                let heard = line.iter().filter(hears).count();
                let all = heard == line.len() - 1;
                assert!(all || !line.contains(&m), "{m:?} in {line:?}");
                assert!(heard < line.len(), "it could go on with {m:?}");
            }
            let reach = |m: NodeId| {
                let beside = |&o: &NodeId| {
                    let edge = |e: &&(VertexId, VertexId)| {
                        let ends = (sensors.owner(e.0), sensors.owner(e.1));
                        o != region && (ends == (region, o) || ends == (o, region))
                    };
                    map.edges().iter().find(edge).is_some()
                };
                let near = |&o: &NodeId| o == m || sensors.are_neighbors(o, m);
                sensors.nodes().filter(beside).filter(near).count()
            };
            if let Some(&first) = line.get(1) {
                let best = sensors.neighbors(region).iter().map(|&m| reach(m)).max();
                assert_eq!(Some(reach(first)), best);
            }
        }
    }
}

fn trial() -> impl Strategy<Value = Trial> {
    let size = (1..1000u64, 2..6u32, 2..5u32, 2..7u32, 1..9u32);
    let loss = prop_oneof![Just(0.0), 0.0..0.3, 0.3..0.7];
    let link = (loss, prop_oneof![Just(0u64), 0..1500u64], 0.0..0.3);
    let cut = (0..6u32, (1..25u64, 1..30u64));
    let unheard = prop::collection::vec(cut, 0..3);
    let back = prop_oneof![Just(None), (100..20_000u64).prop_map(Some)];
    let crashes = prop::collection::vec((0..10u32, 500..40_000u64, back), 0..5);
    let rest = (1..5u32, prop::sample::select(&POLICIES));
    (size, link, unheard, crashes, rest).prop_map(|(size, link, unheard, crashes, rest)| {
        let (after, policy) = rest;
        Trial {
            policy,
            seed: size.0,
            grid: Some((size.1, size.2)),
            nodes: size.3.min(size.1 * size.2),
            rovers: size.4,
            link: Bad {
                loss: link.0,
                jitter_ms: link.1,
                duplicates: link.2,
                outage_s: (0, 0),
            },
            unheard: unheard
                .into_iter()
                .map(|(n, (from, lasts))| (n, (from, from + lasts)))
                .collect(),
            crashes,
            after: Some(after),
            cycle_limit: 100,
            sabotage: Sabotage::None,
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 200,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// Nodes crash, for good or not, are cut off from each other while rovers still hear them, and
    /// suspect each other for nothing: nobody collides.
    #[test]
    fn nobody_collides_whoever_takes_over(trial in trial()) {
        let (metrics, report) = run(&trial);
        prop_assert_eq!(metrics.collisions, 0, "{} {:?}", report.end.detail(), metrics.failed_over);
    }
}

/// A team of the crater of which nodes fail for good, or are unheard for a while, in the middle of
/// requests: over links that lose and delay.
fn failures() -> impl Strategy<Value = Trial> {
    // Round a failure messages take many hops: with more loss than this they do get through, in
    // hours.
    let link = (0.0..0.15, 0..600u64, 0.0..0.2);
    let crashes = prop::collection::vec((0..28u32, 300..20_000u64), 1..4);
    let unheard = prop::collection::vec((0..28u32, (1..25u64, 5..30u64)), 0..3);
    (1..1000u64, 10..50u32, link, crashes, unheard).prop_map(
        |(seed, rovers, link, crashes, unheard)| Trial {
            rovers,
            link: Bad {
                loss: link.0,
                jitter_ms: link.1,
                duplicates: link.2,
                outage_s: (0, 0),
            },
            crashes: crashes.into_iter().map(|(n, at)| (n, at, None)).collect(),
            unheard: unheard
                .into_iter()
                .map(|(n, (from, lasts))| (n, (from, from + lasts)))
                .collect(),
            after: Some(8),
            cycle_limit: 5000,
            ..crater(Policy::Complete, seed)
        },
    )
}

/// Whether every region has somebody left to answer for it, and all who are left hear each other by
/// way of others: who failed or was replaced is out.
fn can_go_on(trial: &Trial, metrics: &NetworkMetrics) -> bool {
    let (_, map, sensors) = world(trial);
    let replaced = metrics.failed_over.iter().map(|text| {
        let digits = text.trim_start_matches("node_").chars();
        let number: String = digits.take_while(char::is_ascii_digit).collect();
        NodeId(number.parse::<u32>().unwrap() - 1)
    });
    let mut out: Vec<NodeId> = replaced.collect();
    out.extend(trial.crashes.iter().map(|crash| NodeId(crash.0)));
    let is_left = |n: &NodeId| !out.contains(n);
    let mut heard: Vec<NodeId> = sensors.nodes().find(is_left).into_iter().collect();
    let mut at = 0;
    while let Some(&n) = heard.get(at) {
        let more = sensors.neighbors(n).iter().filter(|m| is_left(m));
        let more: Vec<NodeId> = more.filter(|m| !heard.contains(m)).copied().collect();
        heard.extend(more);
        at += 1;
    }
    let lines = backup_lists(&map, &sensors);
    lines.iter().all(|line| line.iter().any(is_left))
        && heard.len() == sensors.nodes().filter(is_left).count()
}

proptest! {
    // The same cases each time: what holds after ever rarer coincidences is for longer searches
    // than this.
    #![proptest_config(ProptestConfig {
        cases: 32,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(4),
        ..ProptestConfig::default()
    })]

    /// With the policy `complete` no reserved way is lost, and none stays that nobody settles: all
    /// arrive, as long as somebody is left to answer for each vertex.
    #[test]
    fn all_arrive_whoever_fails(trial in failures()) {
        let (metrics, report) = run(&trial);
        prop_assert_eq!(metrics.collisions, 0);
        prop_assert!(
            metrics.arrived == trial.rovers || !can_go_on(&trial, &metrics),
            "{} {:?}", report.end.detail(), metrics.failed_over
        );
    }
}

/// Whether one of many small runs with this fault shows a collision: a node that others do not
/// hear, and rovers do.
fn collides_with(policy: Policy, sabotage: Sabotage) -> bool {
    (1..=200).any(|seed| {
        let trial = Trial {
            rovers: 20,
            nodes: 3,
            grid: Some((5, 4)),
            link: Bad {
                jitter_ms: 700,
                ..GOOD
            },
            unheard: vec![((seed % 3) as u32, (6, 60))],
            cycle_limit: 100,
            sabotage,
            ..crater(policy, seed)
        };
        run(&trial).0.collisions > 0
    })
}

#[test]
fn the_same_runs_without_a_fault_show_none() {
    assert!(
        !POLICIES
            .iter()
            .any(|&policy| collides_with(policy, Sabotage::None))
    );
}

/// The monitor notices if rovers obey a node that is replaced.
#[test]
fn ignoring_fences_is_noticed() {
    assert!(
        POLICIES
            .iter()
            .all(|&policy| collides_with(policy, Sabotage::IgnoreFencing))
    );
}

/// And if a backup opens vertices without asking who is there.
#[test]
fn forgetting_accounts_is_noticed() {
    assert!(
        POLICIES
            .iter()
            .all(|&policy| collides_with(policy, Sabotage::ForgetAccounts))
    );
}

/// A node is unheard for so long that a backup begins to ask for its vertices, and gives them up;
/// but the backup crashes before all have answered. Somebody else takes them.
#[test]
fn a_home_is_not_left_that_was_given_up_to_nobody() {
    let trial = Trial {
        rovers: 10,
        unheard: vec![(7, (10, 19))],
        crashes: vec![(8, 18_001, None)],
        after: Some(8),
        cycle_limit: 5000,
        ..crater(Policy::Complete, 397)
    };
    let (metrics, report) = run(&trial);
    let detail = report.end.detail();
    assert_eq!(metrics.arrived, 10, "{detail} {:?}", metrics.failed_over);
}

/// What a node that is replaced has chosen a way for, its backup chooses none for again.
#[test]
fn no_attempt_gets_two_ways() {
    let trial = Trial {
        rovers: 35,
        link: Bad {
            loss: 0.065_873_696_702_832_34,
            jitter_ms: 502,
            ..GOOD
        },
        unheard: vec![(11, (12, 22)), (21, (2, 7))],
        crashes: vec![(8, 1058, None)],
        after: Some(8),
        cycle_limit: 5000,
        ..crater(Policy::Complete, 815)
    };
    let (metrics, report) = run(&trial);
    let detail = report.end.detail();
    assert_eq!(metrics.arrived, 35, "{detail} {:?}", metrics.failed_over);
}

/// A backup that hears nobody for a while and is replaced does not keep the next in line from its
/// turn.
#[test]
fn a_backup_that_was_replaced_is_passed_over() {
    let trial = Trial {
        rovers: 15,
        link: Bad {
            loss: 0.099_974_423_990_566_64,
            jitter_ms: 153,
            ..GOOD
        },
        unheard: vec![(2, (2, 11))],
        crashes: vec![(24, 9001, None)],
        after: Some(8),
        cycle_limit: 5000,
        ..crater(Policy::Complete, 769)
    };
    let (metrics, report) = run(&trial);
    let detail = report.end.detail();
    assert_eq!(metrics.arrived, 15, "{detail} {:?}", metrics.failed_over);
}

/// An attempt fails with a node that is cut off and replaced. The next one leads past those ahead of
/// that node and not past those behind it: these are told as well that the first one has failed.
#[test]
fn what_a_failed_attempt_entered_is_struck_out_where_the_next_does_not_come() {
    let trial = Trial {
        rovers: 37,
        link: Bad {
            loss: 0.034_094_158_058_455_91,
            jitter_ms: 519,
            duplicates: 0.137_240_452_782_752_8,
            ..GOOD
        },
        unheard: vec![(27, (15, 23))],
        crashes: vec![(18, 3708, None)],
        after: Some(8),
        cycle_limit: 5000,
        ..crater(Policy::Complete, 398)
    };
    let (metrics, report) = run(&trial);
    let detail = report.end.detail();
    assert_eq!(metrics.arrived, 37, "{detail} {:?}", metrics.failed_over);
}

/// A path passes a region twice, which is replaced between the two: what was entered there first is lost,
/// and the rover does not set out on what is left of it.
#[test]
fn no_path_is_taken_that_a_replaced_region_has_half_of() {
    let trial = Trial {
        rovers: 37,
        link: Bad {
            jitter_ms: 343,
            duplicates: 0.057_585_725_835_033_526,
            ..GOOD
        },
        crashes: vec![(9, 1176, None)],
        after: Some(8),
        cycle_limit: 5000,
        ..crater(Policy::Complete, 500)
    };
    let (metrics, report) = run(&trial);
    let detail = report.end.detail();
    assert_eq!(metrics.arrived, 37, "{detail} {:?}", metrics.failed_over);
}

/// A path passes a region twice, and another one between: that one is replaced when the confirmation has
/// come to the first part and not to the second. Those behind are told as well.
#[test]
fn a_confirmation_that_is_lost_between_two_parts_of_a_region_is_said_again() {
    let trial = Trial {
        rovers: 10,
        link: Bad {
            loss: 0.144_798_581_982_081_5,
            jitter_ms: 295,
            ..GOOD
        },
        crashes: vec![(20, 7746, None)],
        after: Some(8),
        cycle_limit: 5000,
        ..crater(Policy::Complete, 989)
    };
    let (metrics, report) = run(&trial);
    let detail = report.end.detail();
    assert_eq!(metrics.arrived, 10, "{detail} {:?}", metrics.failed_over);
}
