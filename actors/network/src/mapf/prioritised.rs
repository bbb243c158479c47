//! Prioritised planning in space-time, the classic scheme and one of the paper's baselines: one
//! rover after the other takes the fastest way round those planned before it (Erdmann and
//! Lozano-Perez 1987), in a given order or in orders drawn at random (Bennewitz, Burgard and Thrun
//! 2002). It is incomplete: a rover starts when its turn comes, whoever may come its way.

use super::order::Order;
use super::plan::Outcome;
use super::problem::Problem;
use super::single::{self, Entry};
use super::table::StayTable;
use super::timetable::{Pace, Timetable};

/// Plans one rover after the other, each round those before it. With several orders to try it stops
/// at the first in which all find a way.
///
/// With [`Rules::DisappearAtTarget`](super::Rules::DisappearAtTarget) a rover enters in the first
/// cycle in which nobody planned before it is at its entry, its predecessors among them; it may not
/// wait outside for a clear way. With [`Rules::StayAtTarget`](super::Rules::StayAtTarget) it starts
/// in cycle 0, where somebody planned before it may already be driving through. A rover that finds
/// no way is named as a failure, has no trip, and is in nobody's way: the others are planned as if
/// it were not there.
///
/// ```
/// use farside_network::mapf::{Mission, Order, Problem, Rules, prioritised};
/// use farside_worlds::{Roadmap, VertexId as V};
/// // A corridor: whoever is planned second meets the first head-on.
/// let text = "name = 'line'\nboundary = [0, 2]\npositions_m = [[0, 0], [5, 0], [9, 0]]\n\
///             edges = [[0, 1], [1, 2]]";
/// let map = Roadmap::from_toml(text)?;
/// let missions = [(0, 2), (2, 0)].map(|(a, b)| Mission::new(V(a), V(b)));
/// let problem = Problem::new(&map, missions.to_vec(), Rules::DisappearAtTarget)?;
/// let outcome = prioritised(&problem, &Order::QueuePosition);
/// assert_eq!((outcome.failures[0].rover, &*outcome.failures[0].blockers), (1, &[0][..]));
/// assert_eq!(outcome.plan.metrics(&problem).arrived, 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn prioritised(problem: &Problem<'_>, order: &Order) -> Outcome {
    prioritised_in_time(problem, &Pace::CYCLES, order).in_cycles()
}

/// The same for rovers that take their time, see [`Pace`].
///
/// ```
/// use farside_network::mapf::{Mission, Order, Pace, Problem, Rules, prioritised_in_time};
/// use farside_worlds::{Roadmap, VertexId as V};
/// let text = "name = 'line'\nboundary = [0, 2]\npositions_m = [[0, 0], [5, 0], [9, 0]]\n\
///             edges = [[0, 1], [1, 2]]";
/// let map = Roadmap::from_toml(text)?;
/// let missions = [(0, 2), (0, 2)].map(|(a, b)| Mission::new(V(a), V(b)));
/// let problem = Problem::new(&map, missions.to_vec(), Rules::DisappearAtTarget)?;
/// let pace = Pace { travel: &|_, _| 9, enter: 2, headway: 1 };
/// let table = prioritised_in_time(&problem, &pace, &Order::QueuePosition);
/// // The first leaves the entry at 2; the second comes in as soon as that is known.
/// assert_eq!(table.ways[1][0].start, 3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn prioritised_in_time(problem: &Problem<'_>, pace: &Pace<'_>, order: &Order) -> Timetable {
    let enough = |table: &Timetable| table.failures.is_empty();
    order.best(problem, pace, enough, |order| {
        in_order(problem, pace, order)
    })
}

fn in_order(problem: &Problem<'_>, pace: &Pace<'_>, order: &[usize]) -> Timetable {
    let mut table = StayTable::new(problem.roadmap(), problem.missions().len());
    let mut failures = Vec::new();
    for &rover in order {
        // A predecessor has taken the first interval in which it found the entry free, so that the
        // next one comes after it.
        match single::search(problem, pace, &table, rover, Entry::AtOnce) {
            Ok(way) => table.insert(rover, way),
            Err(failure) => failures.push(failure),
        }
    }
    Timetable {
        ways: table.into_ways(),
        failures,
        tries: 1,
    }
}
