//! Plans: where each rover is in each cycle, and what that costs.

use farside_worlds::VertexId;
use serde::Serialize;

use super::problem::{Problem, Rules};
use super::safe_intervals::{FOREVER, TimedVisit};

/// One rover's way through space and time.
///
/// ```
/// use farside_network::mapf::Trip;
/// use farside_worlds::VertexId as V;
/// let trip = Trip { entered: 3, vertices: vec![V(7), V(7), V(8)] };
/// assert_eq!(trip.at(4), Some(V(7)));
/// assert_eq!((trip.at(2), trip.at(6), trip.last_cycle()), (None, None, 5));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Trip {
    /// The cycle in which it is at its entry for the first time.
    pub entered: u32,
    /// Where it is in that cycle and each one after it, to its goal; never empty. What waits is
    /// there twice.
    pub vertices: Vec<VertexId>,
}

impl Trip {
    /// Where it is in `cycle`, between entry and arrival.
    pub fn at(&self, cycle: u32) -> Option<VertexId> {
        let since = cycle.checked_sub(self.entered)?;
        self.vertices.get(since as usize).copied()
    }

    /// The cycle in which it comes to the end of its way.
    pub fn last_cycle(&self) -> u32 {
        self.entered + self.vertices.len() as u32 - 1
    }

    /// The vertex at which its way ends.
    pub fn end(&self) -> VertexId {
        *self.vertices.last().expect("a trip is never empty")
    }
}

/// A plan for a team: a trip for each rover, or none for a rover that found no way. Such a rover is
/// not on the roadmap at all, as far as the plan goes.
///
/// ```
/// use farside_network::mapf::{Mission, Plan, Problem, Rules, Trip};
/// use farside_worlds::{Roadmap, VertexId};
/// let map = Roadmap::builtin("crater-sparse")?;
/// let way = map.shortest_path(map.boundary()[0], map.boundary()[1]);
/// let mission = Mission::new(way[0], *way.last().expect("it has an end"));
/// let problem = Problem::new(&map, vec![mission], Rules::DisappearAtTarget)?;
/// let plan = Plan { trips: vec![Some(Trip { entered: 0, vertices: way })] };
/// assert_eq!(plan.conflicts(&problem), []);
/// assert_eq!(plan.metrics(&problem).time_ratio, 1.0);
/// assert_eq!(plan.visits(&problem)[0][1].start, 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Plan {
    /// By rover.
    pub trips: Vec<Option<Trip>>,
}

/// What a plan amounts to. Sums and means are over the rovers that arrive, and 0 if none does.
///
/// ```
/// assert_eq!(farside_network::mapf::PlanMetrics::default().makespan, 0);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PlanMetrics {
    /// Rovers that reach their goals.
    pub arrived: usize,
    /// The sum of the cycles in which rovers arrive, counted from 0: time in queues included.
    pub sum_of_costs: u64,
    /// The cycle in which the last one arrives.
    pub makespan: u32,
    /// Mean of cycles from the start to the goal over the shortest path's length, as
    /// [`NetworkMetrics::time_ratio`](crate::NetworkMetrics::time_ratio).
    pub time_ratio: f64,
    /// Mean of cycles from the entry to the goal over the shortest path's length, as
    /// [`NetworkMetrics::path_ratio`](crate::NetworkMetrics::path_ratio).
    pub path_ratio: f64,
}

/// A rover that found no way.
///
/// ```
/// use farside_network::mapf::Failure;
/// let failure = Failure { rover: 3, blockers: vec![1], at: 17 };
/// assert_eq!(failure.to_string(), "rover 3 finds no way: rover 1 bars it at 17");
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Failure {
    /// Its number.
    pub rover: usize,
    /// Who stands or drives in its way when nothing is left to it, sorted.
    pub blockers: Vec<usize>,
    /// When that is, in ticks of the plan (cycles, if it is in cycles): the last instant at which
    /// it could still be anywhere; or at which somebody moves, if that is before.
    pub at: u64,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let list: Vec<String> = self.blockers.iter().map(usize::to_string).collect();
        let (noun, verb) = match list.len() {
            1 => ("rover", "bars"),
            _ => ("rovers", "bar"),
        };
        let (rover, at, list) = (self.rover, self.at, list.join(", "));
        write!(
            f,
            "rover {rover} finds no way: {noun} {list} {verb} it at {at}"
        )
    }
}

/// What a planner came to: a plan, and who is not served by it.
///
/// ```
/// use farside_network::mapf::Outcome;
/// assert!(Outcome::default().failures.is_empty());
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Outcome {
    /// Free of conflicts, whether it is complete or not.
    pub plan: Plan,
    /// Rovers that do not reach their goals in it, in the order in which they were planned.
    pub failures: Vec<Failure>,
    /// How many orders were tried.
    pub tries: u32,
}

impl Plan {
    /// Whether `rover` reaches its goal.
    pub fn arrives(&self, problem: &Problem<'_>, rover: usize) -> bool {
        let goal = problem.missions()[rover].goal;
        self.trips[rover]
            .as_ref()
            .is_some_and(|trip| trip.end() == goal)
    }

    /// The plan as a timetable in cycles: each rover's stays, one after the other; empty for a
    /// rover without a trip. The last stay has no end with [`Rules::StayAtTarget`], and one cycle
    /// with [`Rules::DisappearAtTarget`].
    pub fn visits(&self, problem: &Problem<'_>) -> Vec<Vec<TimedVisit>> {
        let visits = |trip: &Option<Trip>| {
            let trip = trip.as_ref();
            trip.map_or_else(Vec::new, |trip| visits(trip, problem.rules()))
        };
        self.trips.iter().map(visits).collect()
    }

    /// What the plan amounts to.
    pub fn metrics(&self, problem: &Problem<'_>) -> PlanMetrics {
        let mut metrics = PlanMetrics::default();
        for (rover, trip) in self.trips.iter().enumerate() {
            let Some(trip) = trip.as_ref().filter(|_| self.arrives(problem, rover)) else {
                continue;
            };
            let shortest = f64::from(problem.shortest(rover).max(1));
            let arrival = trip.last_cycle();
            metrics.arrived += 1;
            metrics.sum_of_costs += u64::from(arrival);
            metrics.makespan = metrics.makespan.max(arrival);
            metrics.time_ratio += f64::from(arrival) / shortest;
            metrics.path_ratio += f64::from(arrival - trip.entered) / shortest;
        }
        let count = metrics.arrived.max(1) as f64;
        metrics.time_ratio /= count;
        metrics.path_ratio /= count;
        metrics
    }
}

/// The stays of a trip.
pub(crate) fn visits(trip: &Trip, rules: Rules) -> Vec<TimedVisit> {
    let mut visits = Vec::<TimedVisit>::new();
    for (cycle, &vertex) in (u64::from(trip.entered)..).zip(&trip.vertices) {
        match visits.last_mut() {
            Some(last) if last.vertex == vertex => last.end = cycle + 1,
            _ => visits.push(TimedVisit {
                vertex,
                start: cycle,
                end: cycle + 1,
            }),
        }
    }
    if rules == Rules::StayAtTarget
        && let Some(last) = visits.last_mut()
    {
        last.end = FOREVER;
    }
    visits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mapf::Mission;
    use crate::testing::{grid, v};

    #[test]
    fn a_timetable_joins_waits_and_ends_as_the_rules_say() {
        let map = grid(4, 1, &[]);
        let trip = Trip {
            entered: 2,
            vertices: [0, 0, 1, 2, 2, 2, 1].map(v).to_vec(),
        };
        let plan = Plan {
            trips: vec![Some(trip), None],
        };
        let missions = vec![Mission::new(v(0), v(1)), Mission::new(v(3), v(2))];
        let stays = |rules| {
            let problem = Problem::new(&map, missions.clone(), rules).unwrap();
            let visits = plan.visits(&problem);
            assert!(visits[1].is_empty());
            visits[0]
                .iter()
                .map(|s| (s.vertex.0, s.start, s.end))
                .collect::<Vec<_>>()
        };
        let mut expected = vec![(0, 2, 4), (1, 4, 5), (2, 5, 8), (1, 8, 9)];
        assert_eq!(stays(Rules::DisappearAtTarget), expected);
        expected[3].2 = FOREVER;
        assert_eq!(stays(Rules::StayAtTarget), expected);
    }

    #[test]
    fn time_counts_from_the_start_and_the_path_from_the_entry() {
        let map = grid(3, 1, &[]);
        let missions = vec![Mission::new(v(0), v(2)), Mission::new(v(2), v(0))];
        let problem = Problem::new(&map, missions, Rules::DisappearAtTarget).unwrap();
        let trip = |entered, way: &[u32]| {
            let vertices = way.iter().copied().map(v).collect();
            Some(Trip { entered, vertices })
        };
        let plan = Plan {
            trips: vec![trip(0, &[0, 1, 2]), trip(3, &[2, 1, 1, 0])],
        };
        let metrics = plan.metrics(&problem);
        assert_eq!(
            (metrics.arrived, metrics.sum_of_costs, metrics.makespan),
            (2, 8, 6)
        );
        assert_eq!((metrics.time_ratio, metrics.path_ratio), (2.0, 1.25));
    }
}
