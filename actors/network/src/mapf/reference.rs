//! The centralised reference: revised prioritised planning (Cap, Vokrinek and Kleiner, *Complete
//! decentralized method for on-line multi-robot trajectory planning in well-formed
//! infrastructures*, 2015, and arXiv 1409.2399), each rover by safe intervals.

use super::order::Order;
use super::plan::Outcome;
use super::problem::{Problem, Rules};
use super::safe_intervals::{FOREVER, TimedVisit};
use super::single::{self, Entry};
use super::table::StayTable;
use super::timetable::{Pace, Timetable};

/// Plans one rover after the other, each round those before it, so that it is sure of a way.
///
/// With [`Rules::DisappearAtTarget`] a rover waits in its queue for as long as need be. Nobody can
/// be without a way: when all planned before it have left the roadmap it is empty, and the queue's
/// predecessor has entered by then. So there are no failures.
///
/// With [`Rules::StayAtTarget`] each rover keeps clear of the places where those planned after it
/// still stand, and those keep clear of where it stays. On well-formed problems
/// ([`Problem::ill_formed`] is empty) that leaves a way to everybody: to wait until all before have
/// arrived, and to drive round all entries and goals. On others failures are named; a rover that
/// fails stands at its entry for ever, and has a trip that ends there.
///
/// ```
/// use farside_network::mapf::{Mission, Order, Problem, Rules, reference};
/// use farside_worlds::{Roadmap, VertexId as V};
/// let text = "name = 'line'\nboundary = [0, 2]\npositions_m = [[0, 0], [5, 0], [9, 0]]\n\
///             edges = [[0, 1], [1, 2]]";
/// let map = Roadmap::from_toml(text)?;
/// let missions = [(0, 2), (2, 0)].map(|(a, b)| Mission::new(V(a), V(b)));
/// let problem = Problem::new(&map, missions.to_vec(), Rules::DisappearAtTarget)?;
/// let outcome = reference(&problem, &Order::QueuePosition);
/// // The second enters behind the first, which is at that end in cycle 2 and then gone.
/// assert_eq!(outcome.plan.trips[1].as_ref().map(|trip| trip.entered), Some(3));
/// assert_eq!(outcome.plan.metrics(&problem).makespan, 5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn reference(problem: &Problem<'_>, order: &Order) -> Outcome {
    reference_in_time(problem, &Pace::CYCLES, order).in_cycles()
}

/// The same for rovers that take their time, see [`Pace`].
///
/// ```
/// use farside_network::mapf::{Mission, Order, Pace, Problem, Rules, reference_in_time};
/// use farside_worlds::{Roadmap, VertexId as V};
/// let text = "name = 'line'\nboundary = [0, 2]\npositions_m = [[0, 0], [5, 0], [9, 0]]\n\
///             edges = [[0, 1], [1, 2]]";
/// let map = Roadmap::from_toml(text)?;
/// let missions = [(0, 2), (2, 0)].map(|(a, b)| Mission::new(V(a), V(b)));
/// let problem = Problem::new(&map, missions.to_vec(), Rules::DisappearAtTarget)?;
/// let pace = Pace { travel: &|a, b| if a.0 + b.0 == 1 { 5 } else { 4 }, enter: 2, headway: 1 };
/// let table = reference_in_time(&problem, &pace, &Order::QueuePosition);
/// assert_eq!(table.errors(&problem, &pace), []);
/// // The first is at its goal at 2 + 5 + 4, gone at 12, and known to be gone at 13.
/// assert_eq!(table.ways[0][2].end, 12);
/// assert_eq!(table.ways[1][0].start, 13);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn reference_in_time(problem: &Problem<'_>, pace: &Pace<'_>, order: &Order) -> Timetable {
    // Every order counts: a better sum of costs may be yet to come.
    order.best(
        problem,
        pace,
        |_| false,
        |order| in_order(problem, pace, order),
    )
}

fn in_order(problem: &Problem<'_>, pace: &Pace<'_>, order: &[usize]) -> Timetable {
    let missions = problem.missions();
    let mut table = StayTable::new(problem.roadmap(), missions.len());
    let stand = |rover: usize| {
        vec![TimedVisit {
            vertex: missions[rover].entry,
            start: 0,
            end: FOREVER,
        }]
    };
    if problem.rules() == Rules::StayAtTarget {
        for rover in 0..missions.len() {
            table.insert(rover, stand(rover));
        }
    }
    let mut failures = Vec::new();
    for &rover in order {
        table.remove(rover);
        let predecessor = problem
            .predecessor(rover)
            .and_then(|p| table.way(p).first());
        let ready = predecessor.map_or(0, |visit| visit.start + 1);
        match single::search(problem, pace, &table, rover, Entry::From(ready)) {
            Ok(way) => table.insert(rover, way),
            Err(failure) => {
                failures.push(failure);
                table.insert(rover, stand(rover));
            }
        }
    }
    Timetable {
        ways: table.into_ways(),
        failures,
        tries: 1,
    }
}
