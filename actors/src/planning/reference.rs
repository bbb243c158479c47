//! The centralised reference: revised prioritised planning (Cap, Vokrinek and Kleiner, *Complete
//! decentralized method for on-line multi-robot trajectory planning in well-formed
//! infrastructures*, 2015, and arXiv 1409.2399), each rover by safe intervals.

use super::order::Order;
use super::plan::{Outcome, Plan, Trip};
use super::problem::{Problem, Rules};
use super::table::Table;
use super::{sipp, space_time};

/// Plans one rover after the other, each round those before it, so that it is sure of a way.
///
/// With [`Rules::Queues`] a rover waits in its queue for as long as need be. Nobody can be without
/// a way: when all planned before it have left the roadmap it is empty, and the queue's
/// predecessor has entered by then. So there are no failures.
///
/// With [`Rules::OnMap`] each rover keeps clear of the places where those planned after it still
/// stand, and those keep clear of where it stays. On well-formed problems
/// ([`Problem::ill_formed`] is empty) that leaves a way to everybody: to wait until all before have
/// arrived, and to drive round all entries and goals. On others failures are named; a rover that
/// fails stands at its entry for ever, and has a trip that ends there.
///
/// ```
/// use farside_actors::planning::{Mission, Order, Problem, Rules, reference};
/// use farside_worlds::{Roadmap, VertexId as V};
/// let text = "name = 'line'\nboundary = [0, 2]\npositions_m = [[0, 0], [5, 0], [9, 0]]\n\
///             edges = [[0, 1], [1, 2]]";
/// let map = Roadmap::from_toml(text)?;
/// let missions = [(0, 2), (2, 0)].map(|(a, b)| Mission::new(V(a), V(b)));
/// let problem = Problem::new(&map, missions.to_vec(), Rules::Queues)?;
/// let outcome = reference(&problem, &Order::QueuePosition);
/// // The second enters behind the first, which is at that end in cycle 2 and then gone.
/// assert_eq!(outcome.plan.trips[1].as_ref().map(|trip| trip.entered), Some(3));
/// assert_eq!(outcome.plan.metrics(&problem).makespan, 5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn reference(problem: &Problem<'_>, order: &Order) -> Outcome {
    // Every order counts: a better sum of costs may be yet to come.
    order.best(problem, |_| false, |order| in_order(problem, order))
}

fn in_order(problem: &Problem<'_>, order: &[usize]) -> Outcome {
    let (map, rules) = (problem.roadmap(), problem.rules());
    let missions = problem.missions();
    let mut table = Table::new(map, missions.len(), rules);
    let stand = |rover: usize| Trip {
        entered: 0,
        vertices: vec![missions[rover].entry],
    };
    if rules == Rules::OnMap {
        for rover in 0..missions.len() {
            table.insert(rover, stand(rover));
        }
    }
    let mut failures = Vec::new();
    for &rover in order {
        table.remove(rover);
        let mission = missions[rover];
        let predecessor = problem.predecessor(rover).and_then(|p| table.trip(p));
        let ready = predecessor.map_or(0, |trip| trip.entered + 1);
        match sipp::search(map, &table, rules, mission, ready) {
            Some(trip) => table.insert(rover, trip),
            None => {
                // The same question again, of the search that can say who is in the way.
                let start = (mission.entry, 0);
                let again = space_time::search(map, &table, rules, rover, start, mission.goal);
                failures.push(again.expect_err("both searches are exact"));
                table.insert(rover, stand(rover));
            }
        }
    }
    Outcome {
        plan: Plan {
            trips: table.into_trips(),
        },
        failures,
        tries: 1,
    }
}
