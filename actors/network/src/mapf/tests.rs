//! All planners against the checker, the brute-force oracles, and one another.

use farside_worlds::VertexId;
use proptest::prelude::*;

use super::plan::{Trip, visits};
use super::safe_intervals::TimedVisit;
use super::single::{self, Entry};
use super::table::StayTable;
use super::testing::{brute_force, case, first_arrival, walks};
use super::*;
use crate::testing::{grid, v};

fn orders(seed: u64) -> [Order; 3] {
    let tries = 3;
    [
        Order::QueuePosition,
        Order::ShortestFirst,
        Order::Random { tries, seed },
    ]
}

/// A problem in which `mission` comes after `others`, and the table of what these reserve.
fn amid<'a>(
    map: &'a farside_worlds::Roadmap,
    rules: Rules,
    others: &[Trip],
    mission: Mission,
) -> (Problem<'a>, StayTable) {
    let ends = |trip: &Trip| Mission::new(trip.vertices[0], trip.end());
    let missions = others.iter().map(ends).chain([mission]).collect();
    let problem = Problem::new(map, missions, rules).unwrap();
    let mut table = StayTable::new(map, others.len() + 1);
    for (rover, trip) in others.iter().enumerate() {
        table.insert(rover, visits(trip, rules));
    }
    (problem, table)
}

/// A way in cycles as a trip.
fn as_trip(way: Vec<TimedVisit>) -> Trip {
    let table = Timetable {
        ways: vec![way],
        ..Timetable::default()
    };
    table.in_cycles().plan.trips.remove(0).unwrap()
}

/// A trip among others, as a plan, must pass the checker.
fn check(
    problem_rules: Rules,
    map: &farside_worlds::Roadmap,
    mission: Mission,
    trip: &Trip,
    others: &[Trip],
) -> Result<(), TestCaseError> {
    let mut trips = others.to_vec();
    trips.push(trip.clone());
    let mut missions: Vec<Mission> = others
        .iter()
        .map(|t| Mission::new(t.vertices[0], t.end()))
        .collect();
    missions.push(mission);
    // Whoever comes first stands first in its queue: nobody asked these in which order they came.
    let mut sorted: Vec<usize> = (0..trips.len()).collect();
    sorted.sort_by_key(|&i| trips[i].entered);
    let missions: Vec<Mission> = sorted.iter().map(|&i| missions[i]).collect();
    let plan = Plan {
        trips: sorted.iter().map(|&i| Some(trips[i].clone())).collect(),
    };
    let problem = Problem::new(map, missions, problem_rules)
        .map_err(|e| TestCaseError::fail(e.to_string()))?;
    prop_assert_eq!(plan.conflicts(&problem), vec![]);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 400,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn safe_intervals_are_as_fast_as_can_be(
        case in case(5, 4, 1),
        seeds in prop::collection::vec(any::<u64>(), 0..8),
        ready in 0..4u32,
    ) {
        let (map, rules) = (case.roadmap(), case.rules);
        let mission = case.missions()[0];
        let mut others = walks(&map, rules, &seeds);
        if rules == Rules::StayAtTarget {
            others.retain(|trip| trip.vertices[0] != mission.entry && trip.end() != mission.goal);
        }
        let ready = if rules == Rules::DisappearAtTarget { ready } else { 0 };
        let (problem, table) = amid(&map, rules, &others, mission);
        let may_wait = rules == Rules::DisappearAtTarget;
        let expected = first_arrival(&map, &others, rules, mission, ready, may_wait);
        let entry = Entry::From(u64::from(ready));
        let found = single::search(&problem, &Pace::CYCLES, &table, others.len(), entry);
        let found = found.ok().map(as_trip);
        prop_assert_eq!(found.as_ref().map(Trip::last_cycle), expected);
        if let Some(trip) = found {
            prop_assert!(trip.entered >= ready);
            check(rules, &map, mission, &trip, &others)?;
        }
    }

    #[test]
    fn who_may_not_wait_outside_is_as_fast_as_can_be(
        case in case(5, 4, 1),
        seeds in prop::collection::vec(any::<u64>(), 0..8),
    ) {
        let (map, rules) = (case.roadmap(), case.rules);
        let mission = case.missions()[0];
        let mut others = walks(&map, rules, &seeds);
        if rules == Rules::StayAtTarget {
            others.retain(|trip| trip.vertices[0] != mission.entry && trip.end() != mission.goal);
        }
        let (problem, table) = amid(&map, rules, &others, mission);
        let occupied = |cycle: &u32| table.occupant(mission.entry, u64::from(*cycle)).is_some();
        let ready = match rules {
            Rules::DisappearAtTarget => (0..).find(|cycle| !occupied(cycle)).unwrap(),
            Rules::StayAtTarget => 0,
        };
        let expected = first_arrival(&map, &others, rules, mission, ready, false);
        let rover = others.len();
        match single::search(&problem, &Pace::CYCLES, &table, rover, Entry::AtOnce) {
            Ok(way) => {
                let trip = as_trip(way);
                prop_assert_eq!(Some(trip.last_cycle()), expected);
                prop_assert_eq!(trip.entered, ready);
                check(rules, &map, mission, &trip, &others)?;
            }
            Err(failure) => {
                prop_assert_eq!(None, expected);
                prop_assert!(!failure.blockers.is_empty());
                // Without those who are named in the end, somebody else may yet be in the way; but
                // without anybody there is a way.
                prop_assert!(failure.blockers.iter().all(|&rover| rover < others.len()));
            }
        }
    }

    /// With edges of all lengths: what is planned can be driven, and where rovers leave all arrive.
    #[test]
    fn plans_in_time_can_be_driven(
        case in case(6, 5, 12),
        seed in any::<u64>(),
        lengths in prop::collection::vec(1u64..40, 16),
        (enter, headway) in (0u64..20, 1u64..6),
    ) {
        let map = case.roadmap();
        let problem = Problem::new(&map, case.missions(), case.rules).unwrap();
        let travel = |a: VertexId, b: VertexId| lengths[(a.0 + b.0) as usize % lengths.len()];
        let pace = Pace { travel: &travel, enter, headway };
        for order in orders(seed) {
            let table = reference_in_time(&problem, &pace, &order);
            if problem.ill_formed().is_empty() {
                prop_assert_eq!(&table.failures, &vec![]);
            }
            prop_assert_eq!(table.errors(&problem, &pace), vec![]);
            let table = prioritised_in_time(&problem, &pace, &order);
            prop_assert_eq!(table.errors(&problem, &pace), vec![]);
            for failure in &table.failures {
                prop_assert!(table.ways[failure.rover].is_empty());
                prop_assert!(!failure.blockers.is_empty());
            }
        }
    }

    #[test]
    fn the_reference_never_fails_where_rovers_leave(case in case(6, 5, 12), seed in any::<u64>()) {
        let map = case.roadmap();
        let problem = Problem::new(&map, case.missions(), case.rules).unwrap();
        for order in orders(seed) {
            let outcome = reference(&problem, &order);
            prop_assert_eq!(outcome.plan.conflicts(&problem), vec![]);
            if problem.ill_formed().is_empty() {
                prop_assert_eq!(&outcome.failures, &vec![]);
            }
            let rovers = problem.missions().len();
            for rover in 0..rovers {
                let failed = outcome.failures.iter().any(|failure| failure.rover == rover);
                // A rover that has no need to move arrives where it stands.
                prop_assert!(outcome.plan.trips[rover].is_some());
                prop_assert_eq!(outcome.plan.arrives(&problem, rover), !failed);
            }
        }
    }

    #[test]
    fn prioritised_planning_names_whom_it_does_not_serve(
        case in case(6, 5, 12), seed in any::<u64>(),
    ) {
        let map = case.roadmap();
        let problem = Problem::new(&map, case.missions(), case.rules).unwrap();
        for order in orders(seed) {
            let outcome = prioritised(&problem, &order);
            prop_assert_eq!(outcome.plan.conflicts(&problem), vec![]);
            let arrived = outcome.plan.metrics(&problem).arrived;
            prop_assert_eq!(arrived + outcome.failures.len(), problem.missions().len());
            for failure in &outcome.failures {
                prop_assert!(outcome.plan.trips[failure.rover].is_none());
                prop_assert!(!failure.blockers.is_empty());
                for &blocker in &failure.blockers {
                    prop_assert!(outcome.plan.trips[blocker].is_some());
                }
            }
        }
    }

    #[test]
    fn orders_keep_the_queues(case in case(3, 2, 10), seed in any::<u64>()) {
        let map = case.roadmap();
        let problem = Problem::new(&map, case.missions(), case.rules).unwrap();
        for order in orders(seed) {
            for order in order.orders(&problem) {
                let place = |rover| order.iter().position(|&r| r == rover);
                for rover in 0..problem.missions().len() {
                    prop_assert!(place(rover).is_some());
                    let before = problem.predecessor(rover);
                    prop_assert!(before.is_none_or(|before| place(before) < place(rover)));
                }
                prop_assert_eq!(order.len(), problem.missions().len());
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 300,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn no_plan_is_better_than_the_coupled_one(case in case(3, 2, 3)) {
        let map = case.roadmap();
        let problem = Problem::new(&map, case.missions(), case.rules).unwrap();
        for objective in [Objective::SumOfCosts, Objective::Makespan] {
            let expected = brute_force(&problem, objective == Objective::Makespan);
            for independence in [false, true] {
                let config = CoupledConfig { objective, independence, ..CoupledConfig::default() };
                match coupled(&problem, &config) {
                    Ok(found) => {
                        prop_assert_eq!(Some(found.cost), expected);
                        prop_assert_eq!(found.plan.conflicts(&problem), vec![]);
                        let metrics = found.plan.metrics(&problem);
                        prop_assert_eq!(metrics.arrived, problem.missions().len());
                    }
                    Err(error) => {
                        let unsolvable = matches!(error, CoupledError::Unsolvable { .. });
                        prop_assert!(unsolvable);
                        prop_assert_eq!(None, expected);
                    }
                }
            }
        }
    }

    #[test]
    fn the_reference_is_no_better_than_the_coupled_plan(
        case in case(4, 3, 4), seed in any::<u64>(),
    ) {
        let map = case.roadmap();
        let problem = Problem::new(&map, case.missions(), Rules::DisappearAtTarget);
        let Ok(problem) = problem else { return Ok(()) };
        let best = coupled(&problem, &CoupledConfig::default()).unwrap();
        for order in orders(seed) {
            let sum = reference(&problem, &order).plan.metrics(&problem).sum_of_costs;
            prop_assert!(best.cost <= sum);
        }
    }
}

#[test]
fn a_full_ring_cannot_turn_and_one_with_a_gap_can() {
    let map = grid(2, 2, &[]);
    // 0 1 2 3
    let turn = [(0, 1), (1, 3), (3, 2), (2, 0)].map(|(a, b)| Mission::new(v(a), v(b)));
    let config = CoupledConfig::default();
    let full = Problem::new(&map, turn.to_vec(), Rules::StayAtTarget).unwrap();
    let error = coupled(&full, &config).unwrap_err();
    assert!(matches!(error, CoupledError::Unsolvable { .. }), "{error}");
    assert_eq!(brute_force(&full, false), None);
    let gap = Problem::new(&map, turn[..3].to_vec(), Rules::StayAtTarget).unwrap();
    assert_eq!(coupled(&gap, &config).unwrap().cost, 3);
    // Out of queues each enters when it likes.
    let queued = Problem::new(&map, turn.to_vec(), Rules::DisappearAtTarget).unwrap();
    assert_eq!(
        brute_force(&queued, false),
        Some(coupled(&queued, &config).unwrap().cost)
    );
}

#[test]
fn whoever_stands_at_its_goal_may_have_to_give_way_first() {
    // 0 1 2 in a row, with a siding 4 at 1. Rover 0 stands at its goal 1, in the way of rover 1.
    let mut text = "name = 'tee'\nboundary = [0]\n".to_owned();
    text += "positions_m = [[0, 0], [5, 0], [9, 0], [5, 5]]\nedges = [[0, 1], [1, 2], [1, 3]]";
    let map = farside_worlds::Roadmap::from_toml(&text).unwrap();
    let missions = vec![Mission::new(v(1), v(1)), Mission::new(v(0), v(2))];
    let problem = Problem::new(&map, missions, Rules::StayAtTarget).unwrap();
    let best = coupled(&problem, &CoupledConfig::default()).unwrap();
    // It leaves in cycle 1, is passed, and is back in cycle 2 or 3; the other needs 2 at best.
    assert_eq!(best.cost, brute_force(&problem, false).unwrap());
    assert_eq!(best.cost, 4);
    assert_eq!(best.groups, [vec![0, 1]]);
    assert_eq!(problem.ill_formed(), [1]);
    let outcome = reference(&problem, &Order::QueuePosition);
    assert_eq!(outcome.failures.len(), 1);
    assert_eq!(
        (outcome.failures[0].rover, &*outcome.failures[0].blockers),
        (1, &[0][..])
    );
    // The other way round the classic scheme lets the first pass: it does not ask who stands there.
    let outcome = prioritised(&problem, &Order::QueuePosition);
    assert_eq!(outcome.failures[0].rover, 1);
}

#[test]
fn the_limit_holds() {
    let map = grid(5, 4, &[]);
    let missions = [(0, 19), (19, 0), (4, 15), (15, 4)].map(|(a, b)| Mission::new(v(a), v(b)));
    let problem = Problem::new(&map, missions.to_vec(), Rules::DisappearAtTarget).unwrap();
    let config = |max_expansions| CoupledConfig {
        max_expansions,
        independence: false,
        ..CoupledConfig::default()
    };
    let all = coupled(&problem, &config(1_000_000)).unwrap();
    let error = coupled(&problem, &config(all.expansions - 1)).unwrap_err();
    let expansions = all.expansions - 1;
    assert_eq!(error, CoupledError::Exhausted { expansions });
    assert_eq!(coupled(&problem, &config(all.expansions)).unwrap(), all);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Where the exact search finds a plan, so does the other, and where there is none it says so;
    /// its plan is sound and costs no less.
    #[test]
    fn the_plan_for_crowds_is_there_when_there_is_one(case in case(4, 3, 4)) {
        prop_assume!(case.rules == Rules::StayAtTarget);
        let map = case.roadmap();
        let problem = Problem::new(&map, case.missions(), case.rules).unwrap();
        // Enough to try every step from every state that so few rovers can be in.
        let limits = LacamConfig { max_expansions: 20_000_000, ..LacamConfig::default() };
        let found = lacam(&problem, &limits);
        match coupled(&problem, &CoupledConfig::default()) {
            Ok(best) => {
                let plan = found.unwrap().plan;
                prop_assert_eq!(plan.conflicts(&problem), []);
                let metrics = plan.metrics(&problem);
                prop_assert_eq!(metrics.arrived, problem.missions().len());
                prop_assert!(metrics.sum_of_costs >= best.cost);
            }
            Err(CoupledError::Unsolvable { .. }) => {
                let unsolvable = matches!(found, Err(CoupledError::Unsolvable { .. }));
                prop_assert!(unsolvable, "{:?}", found);
            }
            Err(CoupledError::Exhausted { .. }) => {}
        }
    }

    /// Searched to the end, no plan has a smaller sum of steps that are not rest at goals.
    #[test]
    fn the_search_comes_to_the_best_plan(case in case(3, 2, 3)) {
        prop_assume!(case.rules == Rules::StayAtTarget);
        let map = case.roadmap();
        let problem = Problem::new(&map, case.missions(), case.rules).unwrap();
        let limits = LacamConfig {
            further_expansions: u64::MAX / 2,
            improvements: 0,
            ..LacamConfig::default()
        };
        let loss = |plan: &Plan| -> usize {
            let loss = |(trip, mission): (&Option<Trip>, &Mission)| {
                let steps = trip.as_ref().unwrap().vertices.windows(2);
                steps.filter(|step| step.iter().any(|v| *v != mission.goal)).count()
            };
            plan.trips.iter().zip(problem.missions()).map(loss).sum()
        };
        if let Ok(found) = lacam(&problem, &limits) {
            prop_assert_eq!(loss(&found.plan) as u64, testing::least_loss(&problem));
        }
    }
}
