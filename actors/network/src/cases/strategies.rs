//! `proptest` strategies for all that a run of the network-guided system is made of: roadmaps,
//! sensor networks over them, teams, links and their degradations, crashes, and whole [`Case`]s.
//!
//! Everything is made of small whole numbers and short lists, so that a failing case shrinks: to
//! few vertices, few rovers and nodes, links without faults, nobody who crashes.
//!
//! ```
//! # #[cfg(feature = "proptest")] {
//! use farside::Executor;
//! use farside_network::cases::strategies::{Bounds, cases};
//! use proptest::prelude::*;
//!
//! proptest!(ProptestConfig::with_cases(8), |(case in cases(Bounds::default()))| {
//!     let (metrics, _) = case.run(Executor::Inline).unwrap();
//!     prop_assert_eq!(metrics.collisions, 0);
//! });
//! # }
//! ```

use farside::{SimDuration, Simulation};
use farside_worlds::{Endpoints, Roadmap, SensorNetwork, VertexId};
use nalgebra::Point2;
use proptest::prelude::*;

use super::case::{Case, Downtime};
use crate::{Gaps, Policy, TeamConfig, WorldConfig};
use farside_actors::link::{Degrade, Degraded, LinkOverrides, LinkParams};

/// How large and how bad cases may be.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    /// The most vertices of a roadmap; at least 4.
    pub vertices: usize,
    /// The most sensor nodes; at least 1.
    pub nodes: u32,
    /// The most rovers; at least 1.
    pub rovers: u32,
    /// The most that a link loses, in percent.
    pub loss_percent: u32,
    /// The longest latency; at least 100 ms. Jitter comes to nearly as much.
    pub latency: SimDuration,
    /// The most degradations.
    pub degradations: usize,
    /// The most crashes.
    pub crashes: usize,
    /// The last instant at which links degrade, or actors crash; at least 1 s.
    pub until: SimDuration,
}

impl Default for Bounds {
    fn default() -> Self {
        Bounds {
            vertices: 20,
            nodes: 5,
            rovers: 8,
            loss_percent: 100,
            latency: SimDuration::from_secs(3),
            degradations: 3,
            crashes: 5,
            until: SimDuration::from_secs(40),
        }
    }
}

/// The distance between neighbouring vertices \[m\].
const SPACING_M: f64 = 10.0;

/// Roadmaps of 2 to `vertices` vertices: nearly trees, with a loop here and there, or grids of
/// which edges are cut out. The outermost vertices are the boundary. They shrink to two vertices
/// and an edge.
pub fn roadmaps(vertices: usize) -> impl Strategy<Value = Roadmap> {
    prop_oneof![grown(vertices), cut_grids(vertices)]
}

/// Grown cell by cell on a square lattice: each draw names a vertex there is and a direction. Where
/// that cell is free it becomes a vertex, where it is not the two are joined.
fn grown(vertices: usize) -> impl Strategy<Value = Roadmap> {
    let draw = (any::<prop::sample::Index>(), 0..4usize);
    prop::collection::vec(draw, 1..vertices.max(2) * 5 / 4).prop_map(move |draws| {
        let mut cells = vec![(0i32, 0i32)];
        let mut edges = Vec::new();
        for (from, towards) in draws {
            let from = from.index(cells.len());
            let (x, y) = cells[from];
            let (dx, dy) = [(1, 0), (0, 1), (-1, 0), (0, -1)][towards];
            let cell = (x + dx, y + dy);
            let to = match cells.iter().position(|known| *known == cell) {
                Some(to) => to,
                None if cells.len() >= vertices.max(2) => continue,
                None => {
                    cells.push(cell);
                    cells.len() - 1
                }
            };
            let edge = (from.min(to) as u32, from.max(to) as u32);
            if !edges.contains(&edge) {
                edges.push(edge);
            }
        }
        on_lattice("grown", &cells, &edges).expect("it grew without a gap")
    })
}

/// Grids of up to 6 columns without some of their edges, as long as they hang together.
fn cut_grids(vertices: usize) -> impl Strategy<Value = Roadmap> {
    let most = vertices.max(4) as u32;
    let size =
        (2..=6.min(most / 2)).prop_flat_map(move |columns| (Just(columns), 2..=most / columns));
    (size, any::<u64>()).prop_map(|((columns, rows), cuts)| cut_grid(columns, rows, cuts))
}

/// A grid of at least 2 x 1 vertices, row by row, without those of its edges that `cuts` has a bit
/// for, as far as it hangs together without them: trees, loops, corridors.
///
/// # Panics
/// When there are fewer vertices, or more than a roadmap may have.
pub fn cut_grid(columns: u32, rows: u32, cuts: u64) -> Roadmap {
    let count = columns * rows;
    let cells: Vec<(i32, i32)> = (0..count)
        .map(|i| ((i % columns) as i32, (i / columns) as i32))
        .collect();
    let right = (0..count)
        .filter(|i| (i + 1) % columns != 0)
        .map(|i| (i, i + 1));
    let up = (0..count - columns).map(|i| (i, i + columns));
    let mut edges: Vec<(u32, u32)> = right.chain(up).collect();
    for (bit, edge) in edges.clone().into_iter().enumerate() {
        if cuts >> (bit % 64) & 1 == 1 {
            let fewer: Vec<_> = edges.iter().copied().filter(|&e| e != edge).collect();
            if on_lattice("grid", &cells, &fewer).is_some() {
                edges = fewer;
            }
        }
    }
    on_lattice("grid", &cells, &edges).expect("the whole grid hangs together")
}

/// The roadmap of these cells; none if it falls apart. A cell next to a free one is on the
/// boundary.
fn on_lattice(name: &str, cells: &[(i32, i32)], edges: &[(u32, u32)]) -> Option<Roadmap> {
    let place =
        |&(x, y): &(i32, i32)| Point2::new(f64::from(x) * SPACING_M, f64::from(y) * SPACING_M);
    let is_rim = |&(x, y): &(i32, i32)| {
        let around = [(x + 1, y), (x, y + 1), (x - 1, y), (x, y - 1)];
        around.iter().any(|cell| !cells.contains(cell))
    };
    let edges = edges.iter().map(|&(u, v)| (VertexId(u), VertexId(v)));
    let boundary = (0..).zip(cells).filter(|(_, cell)| is_rim(cell));
    let boundary = boundary.map(|(v, _)| VertexId(v)).collect();
    let places = cells.iter().map(place).collect();
    Roadmap::new(name, places, edges.collect(), boundary).ok()
}

/// Worlds over a roadmap of this strategy: up to so many nodes, with a radius that is as short as
/// can be or reaches everywhere, and any division of the boundary. They shrink to one node.
pub fn worlds(
    roadmaps: impl Strategy<Value = Roadmap>,
    nodes: u32,
) -> impl Strategy<Value = WorldConfig> {
    let endpoints = prop_oneof![
        Just(Endpoints::Alternating),
        Just(Endpoints::AnyToAny),
        Just(Endpoints::WestToEast)
    ];
    let short = prop_oneof![Just(500u32), 15..40u32];
    (roadmaps, 1..=nodes, short, endpoints, 0..100u64).prop_map(
        |(map, nodes, radius_m, endpoints, seed)| {
            let (nodes, radius_m) = feasible(&map, nodes as usize, radius_m, seed);
            WorldConfig {
                roadmap: (&map).into(),
                nodes: nodes as u32,
                radius_m: Some(f64::from(radius_m)),
                endpoints,
                placement_seed: Some(seed),
                ..WorldConfig::default()
            }
        },
    )
}

/// So many nodes, or as many as the map has room for, and a radius from this one on at which they
/// can be placed.
fn feasible(map: &Roadmap, nodes: usize, radius_m: u32, seed: u64) -> (usize, u32) {
    for nodes in (1..=nodes.min(map.len())).rev() {
        let radii = std::iter::successors(Some(radius_m), |r| Some(r + r / 2));
        for radius_m in radii.take_while(|&r| r < 2000) {
            if SensorNetwork::place(map, nodes, f64::from(radius_m), seed).is_ok() {
                return (nodes, radius_m);
            }
        }
    }
    unreachable!("one node that reaches everywhere can be placed anywhere")
}

/// Teams of 1 to so many rovers.
pub fn teams(rovers: u32) -> impl Strategy<Value = TeamConfig> {
    (1..=rovers).prop_map(TeamConfig::of)
}

/// Links that are late, jitter, lose and repeat, within the bounds. They shrink to 5 ms and no
/// fault.
pub fn links(bounds: &Bounds) -> impl Strategy<Value = LinkParams> + use<> {
    let latest = bounds.latency.as_nanos() / 1_000_000;
    let latency = prop_oneof![Just(5u64), 1..100u64, 100..=latest.max(100)];
    let most = bounds.loss_percent.min(100);
    let loss = prop_oneof![Just(0u32), 0..=most / 2, most / 2..=most];
    let duplicate = prop_oneof![Just(0u32), 0..50u32];
    let jitter = prop_oneof![Just(0u64), 0..100u64];
    (latency, jitter, loss, duplicate).prop_map(|(latency_ms, jitter, loss, duplicate)| {
        LinkParams {
            latency: SimDuration::from_millis(latency_ms),
            jitter: SimDuration::from_millis(latency_ms * jitter / 100),
            loss: percent(loss),
            duplicate: percent(duplicate),
            ..LinkParams::default()
        }
    })
}

fn percent(percent: u32) -> f64 {
    f64::from(percent) / 100.0
}

/// Degradations within the bounds, up to 10 s long: outages, losses, late links; of all links, or
/// of those from or to rovers.
pub fn degradations(bounds: &Bounds) -> impl Strategy<Value = Vec<Degrade>> + use<> {
    let over = prop_oneof![
        Just(LinkOverrides {
            outage: Some(true),
            ..LinkOverrides::default()
        }),
        (1..100u32).prop_map(|loss| LinkOverrides {
            loss: Some(percent(loss)),
            ..LinkOverrides::default()
        }),
        (1..2000u64).prop_map(|latency| LinkOverrides {
            latency: Some(SimDuration::from_millis(latency)),
            ..LinkOverrides::default()
        }),
    ];
    let links = prop_oneof![Just("*"), Just("rover_*-*"), Just("*-rover_*")];
    let degrade =
        (instant(bounds), 1..100u64, links, over).prop_map(|(at, tenths, links, over)| Degrade {
            at,
            until: Some(at + SimDuration::from_millis(100 * tenths)),
            what: Degraded::Links {
                pattern: links.to_owned(),
                over: Box::new(over),
            },
        });
    prop::collection::vec(degrade, 0..=bounds.degradations)
}

/// An instant up to `bounds.until`, off the planning cycle's own.
fn instant(bounds: &Bounds) -> impl Strategy<Value = SimDuration> + use<> {
    let seconds = bounds.until.as_nanos() / 1_000_000_000;
    (0..seconds.max(1), 0..10u64)
        .prop_map(|(second, tenth)| SimDuration::from_millis(1000 * second + 97 * tenth + 3))
}

/// Crashes of nodes and rovers within the bounds; each comes back within 8 s. As (who, when, how
/// long): whom a number means is known when the team is.
fn crashes(
    bounds: &Bounds,
) -> impl Strategy<Value = Vec<(prop::sample::Index, SimDuration, SimDuration)>> + use<> {
    let down = (1..80u64).prop_map(|tenths| SimDuration::from_millis(100 * tenths));
    let crash = (any::<prop::sample::Index>(), instant(bounds), down);
    prop::collection::vec(crash, 0..=bounds.crashes)
}

/// Whole cases within the bounds, of the default policy and settings.
pub fn cases(bounds: Bounds) -> impl Strategy<Value = Case> {
    let world = worlds(roadmaps(bounds.vertices), bounds.nodes);
    let team = teams(bounds.rovers);
    let bad = (links(&bounds), degradations(&bounds), crashes(&bounds));
    (world, team, 1..1000u64, bad).prop_map(|(world, team, seed, (link, degrade, crashes))| {
        let nodes = world.nodes as usize;
        let actors = nodes + team.rovers as usize;
        let name = |who: prop::sample::Index| match who.index(actors) {
            node if node < nodes => format!("node_{:02}", node + 1),
            rover => format!("rover_{:02}", rover - nodes + 1),
        };
        let crash = crashes.into_iter().map(|(who, at, down)| Downtime {
            actor: name(who),
            at,
            restart_after: Some(down),
        });
        Case {
            seed,
            world,
            team,
            link,
            degrade,
            crash: crash.collect(),
            ..Case::default()
        }
    })
}

/// The same with nodes that reach rovers less far, so that up to two thirds of the vertices are
/// gaps, closed or crossed; at least half of the rovers keep a way. They shrink to no gaps.
///
/// # Panics
/// The strategy, when `gaps` is [`Gaps::Refuse`].
pub fn cases_with_gaps(bounds: Bounds, gaps: Gaps) -> impl Strategy<Value = Case> {
    assert!(gaps != Gaps::Refuse, "then there are none");
    (cases(bounds), 0..=66u32).prop_map(move |(mut case, uncovered)| {
        case.world.gaps = gaps;
        if gaps == Gaps::Cross {
            case.network.policy = Policy::Complete;
        }
        let map = case.roadmap().expect("it is written out");
        let sensors = case.world.place(&map, case.seed).expect("it was feasible");
        let reach_m = |v| (sensors.position_m(sensors.owner(v)) - map.position_m(v)).norm();
        let mut reaches_m: Vec<f64> = map.vertices().map(reach_m).collect();
        reaches_m.sort_by(f64::total_cmp);
        let first = map.len() - 1 - map.len() * uncovered as usize / 100;
        for reach_m in &reaches_m[first.min(map.len() - 1)..] {
            // Whole metres are easier to read, and none is farther than the last.
            case.world.coverage_m = Some(libm::ceil(*reach_m).max(1.0));
            let system = case.assemble(&mut Simulation::new(case.seed));
            let refused = system.map(|system| system.refused().len() as u32);
            if refused.is_ok_and(|refused| 2 * refused <= case.team.rovers) {
                break;
            }
        }
        case
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use farside::Executor;
    use proptest::strategy::ValueTree;
    use proptest::test_runner::TestRunner;

    /// Simplifies for as long as `keeps` holds.
    fn shrunk<T>(strategy: impl Strategy<Value = T>, keeps: impl Fn(&T) -> bool) -> T {
        let mut runner = TestRunner::deterministic();
        let new = || strategy.new_tree(&mut runner).expect("a value");
        let mut tree = std::iter::repeat_with(new)
            .find(|tree| keeps(&tree.current()))
            .expect("there is one");
        while tree.simplify() {
            while !keeps(&tree.current()) {
                if !tree.complicate() {
                    return tree.current();
                }
            }
        }
        tree.current()
    }

    #[test]
    fn what_fails_anyway_shrinks_to_nearly_nothing() {
        let case = shrunk(cases(Bounds::default()), |_| true);
        let map = case.roadmap().unwrap();
        assert_eq!((map.len(), case.world.nodes, case.team.rovers), (2, 1, 1));
        assert_eq!(case.link, LinkParams::default());
        assert!(case.degrade.is_empty() && case.crash.is_empty());
        let text = case.to_string();
        assert!(text.lines().count() <= 12, "{text}");
    }

    #[test]
    fn what_needs_a_fault_keeps_only_that() {
        let case = shrunk(cases(Bounds::default()), |case| {
            case.link.loss > 0.2 && case.team.rovers >= 3
        });
        assert_eq!((case.link.loss, case.team.rovers), (0.21, 3));
        assert_eq!(case.link.duplicate, 0.0);
        assert!(case.crash.is_empty());
    }

    proptest! {
        #[test]
        fn maps_are_within_their_size(map in roadmaps(12)) {
            prop_assert!((2..=12).contains(&map.len()));
            prop_assert!(map.boundary().len() >= 2);
        }

        #[test]
        fn every_case_can_run(case in cases(Bounds { rovers: 3, ..Bounds::default() })) {
            let mut case = case;
            case.network.cycle_limit = 3;
            let (_, report) = case.run(Executor::Inline).expect("it makes sense");
            prop_assert_eq!(report.end.name(), "stopped");
        }
    }
}
