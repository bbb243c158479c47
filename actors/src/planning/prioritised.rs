//! Prioritised planning in space-time, the classic scheme and one of the paper's baselines: one
//! rover after the other takes the fastest way round those planned before it (Erdmann and
//! Lozano-Perez 1987), in a given order or in orders drawn at random (Bennewitz, Burgard and Thrun
//! 2002). It is incomplete: a rover starts when its turn comes, whoever may come its way.

use super::order::Order;
use super::plan::{Failure, Outcome, Plan, Trip};
use super::problem::{Problem, Rules};
use super::space_time;
use super::table::Table;

/// Plans one rover after the other, each round those before it. With several orders to try it stops
/// at the first in which all find a way.
///
/// With [`Rules::Queues`] a rover enters in the first cycle in which nobody planned before it is at
/// its entry, its predecessors among them; it may not wait outside for a clear way. With
/// [`Rules::OnMap`] it starts in cycle 0, where somebody planned before it may already be driving
/// through. A rover that finds no way is named as a failure, has no trip, and is in nobody's way:
/// the others are planned as if it were not there.
///
/// ```
/// use farside_actors::planning::{Mission, Order, Problem, Rules, prioritised};
/// use farside_worlds::{Roadmap, VertexId as V};
/// // A corridor: whoever is planned second meets the first head-on.
/// let text = "name = 'line'\nboundary = [0, 2]\npositions_m = [[0, 0], [5, 0], [9, 0]]\n\
///             edges = [[0, 1], [1, 2]]";
/// let map = Roadmap::from_toml(text)?;
/// let missions = [(0, 2), (2, 0)].map(|(a, b)| Mission::new(V(a), V(b)));
/// let problem = Problem::new(&map, missions.to_vec(), Rules::Queues)?;
/// let outcome = prioritised(&problem, &Order::QueuePosition);
/// assert_eq!((outcome.failures[0].rover, &*outcome.failures[0].blockers), (1, &[0][..]));
/// assert_eq!(outcome.plan.metrics(&problem).arrived, 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn prioritised(problem: &Problem<'_>, order: &Order) -> Outcome {
    let enough = |outcome: &Outcome| outcome.failures.is_empty();
    order.best(problem, enough, |order| in_order(problem, order))
}

fn in_order(problem: &Problem<'_>, order: &[usize]) -> Outcome {
    let rovers = problem.missions().len();
    let mut table = Table::new(problem.roadmap(), rovers, problem.rules());
    let mut failures = Vec::new();
    for &rover in order {
        match plan_one(problem, &table, rover) {
            Ok(trip) => table.insert(rover, trip),
            Err(failure) => failures.push(failure),
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

fn plan_one(problem: &Problem<'_>, table: &Table, rover: usize) -> Result<Trip, Failure> {
    let mission = problem.missions()[rover];
    // A predecessor has taken the first cycle in which it found the entry free, so that the next one
    // comes after it.
    let mut start = 0;
    while let Some(stay) = table.stay_at(mission.entry, start) {
        if problem.rules() == Rules::OnMap {
            let (blockers, cycle) = (vec![stay.rover], start);
            return Err(Failure {
                rover,
                blockers,
                cycle,
            });
        }
        start = stay.until;
    }
    let (map, rules) = (problem.roadmap(), problem.rules());
    space_time::search(
        map,
        table,
        rules,
        rover,
        (mission.entry, start),
        mission.goal,
    )
}
