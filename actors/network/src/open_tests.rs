//! The paper's open questions (section 5), on small teams: continuous motion, uncertain locations,
//! roadmaps that nodes are given over the network, balanced loads, gaps in the coverage.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside_actors::link::{Link, LinkParams};
use farside_worlds::{NodeId, Roadmap, SensorNetwork, VertexId};
use nalgebra::Point2;

use super::*;
use crate::baseline::Schedule;
use crate::ids::RoverId;
use crate::safety::messages::{Beacon, RoverState};
use crate::testing::grid;

/// A link of 5 ms that loses some.
fn lossy(loss: f64) -> Link {
    Link::new(LinkParams {
        loss,
        ..LinkParams::default()
    })
}

/// What was seen of a run: rovers' changes, and what they said.
#[derive(Default)]
struct Witnessed {
    changes: Vec<(SimTime, RoverState)>,
    /// When each beacon was sent.
    beacons: Vec<(SimTime, Beacon)>,
    /// How many messages that carry items from node to node arrived.
    relays: u32,
}

struct Witness(Arc<Mutex<Witnessed>>);

impl Observer for Witness {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: true,
            ..Wants::default()
        }
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let Some(kind) = record.kind else {
            return Ok(Flow::Continue);
        };
        let failed = |error: farside::encoding::DecodeError| ObserverError(error.to_string());
        let mut seen = self.0.lock().unwrap();
        if record.class == RecordClass::Sample && kind.name() == "RoverState" {
            let state = kind.schema().decode(record.body).map_err(failed)?;
            seen.changes.push((record.time(), state));
        }
        seen.relays += u32::from(record.class == RecordClass::Delivered && kind.name() == "Relay");
        if record.class == RecordClass::Delivered && kind.name() == "Beacon" {
            let beacon = kind.schema().decode(record.body).map_err(failed)?;
            seen.beacons.push((record.sent, beacon));
        }
        Ok(Flow::Continue)
    }
}

struct Case {
    map: Roadmap,
    rovers: u32,
    loss: f64,
    /// Nodes hear rovers, but not each other.
    are_nodes_deaf: bool,
    coverage_m: Option<f64>,
    gaps: Gaps,
    seed: u64,
    network: NetworkConfig,
}

impl Case {
    fn new(network: NetworkConfig) -> Case {
        Case {
            map: grid(5, 4, &[(6, 7), (12, 13)]),
            rovers: 6,
            loss: 0.0,
            are_nodes_deaf: false,
            coverage_m: None,
            gaps: Gaps::default(),
            seed: 1,
            network,
        }
    }

    fn world(&self) -> (WorldConfig, SensorNetwork) {
        let world = WorldConfig {
            nodes: 4,
            radius_m: Some(60.0),
            coverage_m: self.coverage_m,
            gaps: self.gaps,
            ..WorldConfig::default()
        };
        let sensors = world.place(&self.map, self.seed).unwrap();
        (world, sensors)
    }

    fn run(&self) -> Result<(NetworkMetrics, Report, Witnessed), NetworkError> {
        let (world, sensors) = self.world();
        let mut sim = Simulation::new(self.seed);
        let seen = Arc::new(Mutex::new(Witnessed::default()));
        sim.observe(Witness(seen.clone()));
        let loss = |from: &str, to: &str| {
            let are_nodes = from.starts_with("node") && to.starts_with("node");
            match self.are_nodes_deaf && are_nodes {
                true => 1.0,
                false => self.loss,
            }
        };
        let team = TeamConfig::of(self.rovers);
        let missions = missions(&world, &self.map, &team, self.seed)?;
        let parts = Parts {
            world: &world,
            roadmap: Arc::new(self.map.clone()),
            sensors: Arc::new(sensors),
            config: &self.network,
            terrain: None,
            only: &[],
        };
        let missions = Missions::Queued(missions);
        let network = assemble_over(&mut sim, &parts, &missions, |a, b| lossy(loss(a, b)))?;
        let report = sim.run(Executor::Inline).unwrap();
        assert!(report.fault().is_none(), "{:?}", report.fault());
        let seen = std::mem::take(&mut *seen.lock().unwrap());
        Ok((network.metrics(), report, seen))
    }

    /// Runs until all have arrived, none has met another.
    fn arrives(&self) -> (NetworkMetrics, Witnessed) {
        let (metrics, report, seen) = self.run().unwrap();
        let result = (metrics.arrived, metrics.collisions);
        assert_eq!(result, (self.rovers, 0), "{}", report.end.detail());
        (metrics, seen)
    }
}

/// Each move: from where to where, when it began and ended.
fn moves(seen: &Witnessed) -> Vec<(VertexId, VertexId, SimTime, SimTime)> {
    let mut begun = BTreeMap::new();
    let mut moves = Vec::new();
    for (time, state) in &seen.changes {
        let at = state.whereabouts;
        let (Some(here), rover) = (at.vertex, at.rover) else {
            continue;
        };
        if let Some((from, to, begin)) = begun.remove(&rover) {
            assert_eq!(here, to);
            moves.push((from, to, begin, *time));
        }
        if let Some(to) = at.moving_to {
            begun.insert(rover, (here, to, *time));
        }
    }
    moves
}

mod motion {
    use super::*;

    fn continuous(policy: Policy) -> NetworkConfig {
        NetworkConfig {
            policy,
            motion: Motion::Continuous,
            speed: 2.0,
            acceleration_limit: 1.0,
            cycle: Some(SimDuration::from_secs(8)),
            ..NetworkConfig::default()
        }
    }

    #[test]
    fn edges_take_time_by_length() {
        // Rest to rest over 10 m at 2 m/s and 1 m/s2.
        let stops = SimDuration::from_secs(7).as_nanos();
        for (policy, loss) in [
            (Policy::MaxPlus, 0.0),
            (Policy::Complete, 0.0),
            (Policy::Complete, 0.3),
        ] {
            let mut case = Case::new(continuous(policy));
            case.loss = loss;
            case.rovers = 4;
            let (_, seen) = case.arrives();
            let times: Vec<u64> = moves(&seen)
                .iter()
                .map(|(_, _, begin, end)| end.as_nanos() - begin.as_nanos())
                .collect();
            assert!(times.len() > 10);
            // At full speed all along it takes 5 s.
            assert!(times.iter().all(|t| (5_000_000_000..=stops).contains(t)));
            let rolls = times.iter().any(|&t| t < stops);
            assert_eq!(rolls, policy == Policy::Complete, "{policy:?}: {times:?}");
        }
    }

    #[test]
    fn who_rolls_goes_on_at_once() {
        let (_, seen) = Case::new(continuous(Policy::Complete)).arrives();
        let all = moves(&seen);
        let mut rolled = 0;
        for (from, to, begin, end) in &all {
            let time = end.as_nanos() - begin.as_nanos();
            let starts = all
                .iter()
                .any(|other| other.1 == *from && other.3 == *begin);
            // From rest, and faster than from rest to rest: it does not stop at the end.
            if !starts && time < 7_000_000_000 {
                rolled += 1;
                let next = all.iter().find(|other| other.0 == *to && other.2 == *end);
                assert!(next.is_some(), "nobody leaves {to:?} at {end:?}");
            }
        }
        assert!(rolled > 0);
    }

    #[test]
    fn an_edge_that_takes_too_long_is_named() {
        let mut network = continuous(Policy::MaxPlus);
        network.cycle = Some(SimDuration::from_secs(7));
        let error = Case::new(network).run().err().unwrap();
        assert!(matches!(error, NetworkError::SlowEdge { .. }));
        let text = error.to_string();
        assert!(text.contains("is 10.0 m long and takes 7s"), "{text}");
        assert!(text.contains("leaves after its phases is 6.3s"), "{text}");
        // Where nothing is said, the cycle is long enough.
        let network = NetworkConfig {
            cycle: None,
            ..continuous(Policy::MaxPlus)
        };
        Case::new(network).run().unwrap();
        let mut network = continuous(Policy::Complete);
        (network.cycle, network.deadlock_window) = (Some(SimDuration::from_secs(1)), 7);
        let text = Case::new(network).run().err().unwrap().to_string();
        assert!(text.contains("network.deadlock_window is 7s"), "{text}");
    }

    /// Vertices at these places [m], and nothing but the first and the last to drive between.
    fn alone(policy: Policy, places_m: &[(f64, f64)], edges: &[(u32, u32)]) -> Case {
        let places = places_m.iter().map(|&(x, y)| Point2::new(x, y)).collect();
        let edges = edges.iter().map(|&(a, b)| (VertexId(a), VertexId(b)));
        let boundary = vec![VertexId(0), VertexId(places_m.len() as u32 - 1)];
        let map = Roadmap::new("alone", places, edges.collect(), boundary).unwrap();
        Case {
            map,
            rovers: 1,
            ..Case::new(continuous(policy))
        }
    }

    #[test]
    fn the_time_ratio_is_of_times() {
        let line = [(0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (30.0, 0.0)];
        let case = alone(Policy::Reference, &line, &[(0, 1), (1, 2), (2, 3)]);
        let (metrics, _) = case.arrives();
        // A cycle of 8 s at the entry, and 17 s on the way, without a stop; 17 s is the least. The
        // rest is the grant for the entry.
        let over = metrics.time_ratio * 17.0 - 25.0;
        assert!((0.0..0.1).contains(&over), "{over} s");
        // In cycles it comes in, and takes three steps.
        let mut case = case;
        case.network.motion = Motion::Cycles;
        assert_eq!(case.arrives().0.time_ratio, 4.0 / 3.0);
    }

    #[test]
    fn baselines_plan_by_what_edges_take() {
        // Three short edges, or two long ones by way of vertex 3.
        let places = [
            (0.0, 0.0),
            (10.0, 0.0),
            (20.0, 0.0),
            (15.0, 80.0),
            (30.0, 0.0),
        ];
        let edges = [(0, 1), (1, 2), (2, 4), (0, 3), (3, 4)];
        for policy in [Policy::Reference, Policy::Prioritised] {
            let mut case = alone(policy, &places, &edges);
            let (_, seen) = case.arrives();
            assert_eq!(moves(&seen).len(), 3, "{policy:?}");
            case.network.motion = Motion::Cycles;
            let (_, seen) = case.arrives();
            assert_eq!(moves(&seen).len(), 2, "{policy:?}");
        }
    }

    /// Rovers that roll are ahead of their plan; what keeps one behind it is the way of messages
    /// only.
    #[test]
    fn the_references_plan_in_time_is_driven() {
        for seed in 1..=3 {
            let mut case = Case::new(continuous(Policy::Reference));
            (case.rovers, case.seed) = (10, seed);
            let (driven, _) = case.arrives();
            let (rovers, network) = (case.rovers, &case.network);
            let missions =
                missions(&case.world().0, &case.map, &TeamConfig::of(rovers), seed).unwrap();
            let timing = network.timing(SimDuration::from_millis(5), None).unwrap();
            let missions: Vec<_> = (0..).map(RoverId).zip(missions).collect();
            let plan = Schedule::of(network, &timing, &case.map, &missions, false);
            for ((_, way), arrival_s) in plan.unwrap().unwrap().visits.iter().zip(&driven.arrival_s)
            {
                let planned_s = way[way.len() - 1].end as f64 * 1e-9;
                let late_s = arrival_s.unwrap() - planned_s;
                assert!((-30.0..0.2).contains(&late_s), "{late_s} s");
            }
        }
    }

    #[test]
    fn the_coupled_search_says_that_it_knows_cycles_only() {
        let mut case = Case::new(continuous(Policy::Coupled));
        case.rovers = 2;
        let text = case.run().err().unwrap().to_string();
        assert!(
            text.contains("cannot plan for network.motion \"continuous\""),
            "{text}"
        );
        case.network.motion = Motion::Cycles;
        case.arrives();
    }

    #[test]
    fn the_planner_for_crowds_says_what_it_is_for() {
        let mut case = Case::new(continuous(Policy::Lacam));
        case.rovers = 2;
        let text = case.run().err().unwrap().to_string();
        let motion = "\"lacam\" searches in whole cycles, and so cannot plan for network.motion";
        assert!(text.contains(motion), "{text}");
        case.network.motion = Motion::Cycles;
        let text = case.run().err().unwrap().to_string();
        let rules = "\"lacam\" is for maps where rovers stay at their goals";
        assert!(text.contains(rules), "{text}");
    }
}

mod location {
    use super::*;

    fn uncertain(policy: Policy, sigma_m: f64) -> NetworkConfig {
        NetworkConfig {
            policy,
            location_sigma_m: sigma_m,
            ..NetworkConfig::default()
        }
    }

    /// Nobody says LEAVING before it is off the vertex by the clearance, nor that it has come
    /// before it has; and all arrive all the same.
    #[test]
    fn what_is_said_is_certain() {
        for (policy, sigma_m, loss) in [
            (Policy::MaxPlus, 0.5, 0.0),
            (Policy::Complete, 0.5, 0.0),
            (Policy::Complete, 1.5, 0.3),
        ] {
            let mut case = Case::new(uncertain(policy, sigma_m));
            (case.loss, case.rovers) = (loss, 4);
            let (_, seen) = case.arrives();
            // 200 ms for 10 m.
            let clear_ns = 200_000_000 / 10 * 2;
            let mut leavings = 0;
            for (sent, beacon) in &seen.beacons {
                let said = beacon.whereabouts;
                let is = |state: &RoverState| {
                    let true_ = state.whereabouts;
                    (true_.rover, true_.step) == (said.rover, said.step)
                };
                let began = seen.changes.iter().find(|(_, state)| {
                    is(state) && (said.moving_to.is_none() || state.whereabouts == said)
                });
                let (began, _) = began.expect("it said what was never so");
                assert!(began <= sent);
                if said.moving_to.is_some() {
                    leavings += 1;
                    assert!(sent.as_nanos() - began.as_nanos() >= clear_ns);
                }
            }
            assert!(leavings > 0);
        }
    }

    /// Each fix that is no good costs another one's time.
    #[test]
    fn the_less_is_known_the_longer_it_takes() {
        let time = |sigma_m| {
            let (_, seen) = Case::new(uncertain(Policy::Complete, sigma_m)).arrives();
            let all = moves(&seen);
            let sum: u64 = all.iter().map(|m| m.3.as_nanos() - m.2.as_nanos()).sum();
            sum / all.len() as u64
        };
        assert_eq!(time(0.0), 200_000_000);
        assert_eq!(time(0.01), 300_000_000, "one fix is enough");
        // A fix of 2 m is good with a chance of 0.68: 1.46 of them in the mean.
        let mean = time(2.0);
        assert!((325_000_000..370_000_000).contains(&mean), "{mean}");
    }
}

mod roadmap {
    use super::*;

    #[test]
    fn who_is_given_the_roadmap_waits_for_it_and_all_arrive() {
        for (policy, loss) in [
            (Policy::MaxPlus, 0.0),
            (Policy::MaxPlus, 0.3),
            (Policy::Complete, 0.0),
            (Policy::Complete, 0.3),
        ] {
            let mut case = Case::new(NetworkConfig {
                policy,
                roadmap_from: Some("node_02".to_owned()),
                ..NetworkConfig::default()
            });
            (case.loss, case.rovers) = (loss, 3);
            let (metrics, seen) = case.arrives();
            let known_s = metrics.roadmap_known_s.unwrap();
            assert!(known_s > 0.0 && (loss > 0.0 || known_s < 0.1), "{known_s}");
            case.network.roadmap_from = None;
            let (before, none) = case.arrives();
            assert_eq!(before.roadmap_known_s, None);
            if policy == Policy::MaxPlus {
                assert_eq!(none.relays, 0);
            }
            // Three nodes were given two parts each, by messages like others.
            assert!(seen.relays >= 6);
        }
    }

    /// Nobody comes to a node that does not know the roadmap, if nodes do not hear each other.
    #[test]
    fn who_does_not_know_the_roadmap_admits_nobody() {
        for policy in [Policy::MaxPlus, Policy::Complete] {
            let mut case = Case::new(NetworkConfig {
                policy,
                roadmap_from: Some("node_02".to_owned()),
                ..NetworkConfig::default()
            });
            (case.are_nodes_deaf, case.rovers) = (true, 12);
            let (metrics, _, seen) = case.run().unwrap();
            assert_eq!(metrics.roadmap_known_s, None);
            let (_, sensors) = case.world();
            let places = seen
                .changes
                .iter()
                .filter_map(|(_, s)| s.whereabouts.vertex);
            let owners: BTreeSet<NodeId> = places.map(|v| sensors.owner(v)).collect();
            assert!(owners.iter().all(|&owner| owner == NodeId(1)), "{owners:?}");
        }
    }

    #[test]
    fn a_source_that_is_none_is_refused() {
        let network = NetworkConfig {
            roadmap_from: Some("node_5".to_owned()),
            ..NetworkConfig::default()
        };
        let text = Case::new(network).run().err().unwrap().to_string();
        assert_eq!(
            text,
            "network.roadmap_from is node_5, but there are node_01 to node_04"
        );
    }
}

mod gaps {
    use super::*;

    fn with_gaps(policy: Policy, gaps: Gaps, seed: u64) -> Case {
        let network = NetworkConfig {
            policy,
            ..NetworkConfig::default()
        };
        Case {
            gaps,
            seed,
            ..Case::new(network)
        }
    }

    /// With the least coverage that leaves half of the rovers a way: all of these arrive.
    fn run(case: &mut Case) -> (SensorNetwork, Witnessed) {
        let run = |metres: u32| {
            case.coverage_m = Some(f64::from(metres));
            let found = case.run().ok()?;
            (2 * found.0.refused <= case.rovers).then_some(found)
        };
        let (metrics, report, seen) = (4..60).find_map(run).unwrap();
        let (_, sensors) = case.world();
        let done = (metrics.arrived + metrics.refused, metrics.collisions);
        assert_eq!(done, (case.rovers, 0), "{}", report.end.detail());
        assert_eq!(metrics.completed, metrics.refused == 0);
        assert!(!sensors.gaps().is_empty());
        (sensors, seen)
    }

    /// From setting out into a gap to coming out nobody hears a rover but for LEAVING, and it goes
    /// on as fast as it can.
    #[test]
    fn who_crosses_is_silent_and_does_not_wait() {
        let mut crossings = 0;
        for seed in 1..=12 {
            let mut case = with_gaps(Policy::Complete, Gaps::Cross, seed);
            (case.loss, case.rovers) = (if seed % 2 == 0 { 0.3 } else { 0.0 }, 10);
            let (sensors, seen) = run(&mut case);
            let in_gap = |state: &RoverState| {
                let at = state.whereabouts;
                let ends = [at.vertex, at.moving_to];
                ends.into_iter().flatten().any(|v| !sensors.covers(v))
            };
            for (sent, beacon) in &seen.beacons {
                let said = beacon.whereabouts;
                let mut changes = seen
                    .changes
                    .iter()
                    .filter(|(time, state)| time <= sent && state.whereabouts.rover == said.rover);
                let (since, state) = changes.next_back().unwrap();
                if in_gap(state) {
                    assert!(since == sent && said.vertex.is_some_and(|v| sensors.covers(v)));
                }
            }
            let all = moves(&seen);
            for (_, gap, begin, _) in all.iter().filter(|m| !sensors.covers(m.1)) {
                let cycle = case.network.cycle.unwrap_or(SimDuration::from_secs(1));
                let next = all.iter().find(|m| m.0 == *gap && m.2 == *begin + cycle);
                assert!(next.is_some(), "nobody goes on from {gap:?} at {begin:?}");
                crossings += 1;
            }
        }
        assert!(crossings >= 6, "{crossings}");
    }

    /// Rolling through and uncertain locations make no difference to that.
    #[test]
    fn gaps_are_crossed_in_continuous_motion() {
        let mut crossings = 0;
        for seed in 1..=12 {
            let mut case = with_gaps(Policy::Complete, Gaps::Cross, seed);
            case.network.motion = Motion::Continuous;
            case.network.location_sigma_m = if seed % 3 == 0 { 0.5 } else { 0.0 };
            (case.loss, case.rovers) = (0.2, 10);
            let (sensors, seen) = run(&mut case);
            let all = moves(&seen);
            crossings += all.iter().filter(|m| !sensors.covers(m.1)).count();
        }
        assert!(crossings >= 6, "{crossings}");
    }

    #[test]
    fn closed_gaps_are_never_entered() {
        for policy in [
            Policy::MaxPlus,
            Policy::Complete,
            Policy::Reference,
            Policy::Prioritised,
        ] {
            for seed in 1..=3 {
                let mut case = with_gaps(policy, Gaps::Close, seed);
                case.rovers = 4;
                let (sensors, seen) = run(&mut case);
                assert!(moves(&seen).iter().all(|m| sensors.covers(m.1)));
            }
        }
    }

    #[test]
    fn what_cannot_be_is_refused_and_named() {
        let error = |case: Case| case.run().err().unwrap().to_string();
        let text = error(with_gaps(Policy::MaxPlus, Gaps::Cross, 1));
        assert!(text.contains("network.policy = \"complete\""), "{text}");
        let mut nowhere = with_gaps(Policy::Complete, Gaps::Close, 1);
        nowhere.coverage_m = Some(0.1);
        let text = error(nowhere);
        assert!(text.contains("rover_01 has its entry at vertex"), "{text}");
        let (map, sensors) = (Arc::new(grid(3, 1, &[])), [0.0, 20.0]);
        let posts = sensors.map(|x| nalgebra::Point2::new(x, 0.0)).to_vec();
        let sensors = SensorNetwork::new(&map, posts, 20.0).unwrap();
        let sensors = Arc::new(sensors.with_coverage(&map, 5.0).unwrap());
        let assemble = |gaps, missions: &[(u32, u32)]| {
            let world = WorldConfig {
                gaps,
                ..WorldConfig::default()
            };
            let network = NetworkConfig {
                policy: Policy::Complete,
                ..NetworkConfig::default()
            };
            let v = crate::testing::v;
            let missions = missions.iter().map(|&(a, b)| (v(a), v(b))).collect();
            let parts = Parts {
                world: &world,
                roadmap: map.clone(),
                sensors: sensors.clone(),
                config: &network,
                terrain: None,
                only: &[],
            };
            let (mut sim, missions) = (Simulation::new(1), Missions::Standing(missions));
            let made = assemble_over(&mut sim, &parts, &missions, |_, _| lossy(0.0));
            made.err().map(|error| error.to_string())
        };
        let text = assemble(Gaps::Refuse, &[(0, 2)]).unwrap();
        assert!(text.starts_with("no node covers 1 vertices: 1;"), "{text}");
        let text = assemble(Gaps::Close, &[(0, 2)]).unwrap();
        assert_eq!(text, "rover_01 has no way from vertex 0 to 2 without gaps");
        let text = assemble(Gaps::Cross, &[(0, 2), (2, 1)]).unwrap();
        assert_eq!(text, "rover_02 has its goal at vertex 1, in a gap");
        assert_eq!(assemble(Gaps::Cross, &[(0, 2)]), None);
    }
}
