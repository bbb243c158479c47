//! What becomes of goals that nobody wants, and who meets whom.

use super::*;
use crate::planner::problem::{Problem, ProblemConfig, generate};

fn problem(joint_share: f64) -> Problem {
    let config = ProblemConfig {
        joint_share,
        ..ProblemConfig::default()
    };
    generate(&config, 6).unwrap()
}

fn central(instance: &Instance, offers: u32) -> Central {
    let config = PlannerConfig {
        offers,
        ..PlannerConfig::default()
    };
    let mut central = Central::new(instance, &config);
    central.assign_all(instance);
    central
}

fn owner(central: &Central, goal: usize) -> Option<usize> {
    match central.state(goal) {
        State::Assigned(assignment) => assignment.rovers.first().copied(),
        _ => None,
    }
}

#[test]
fn a_goal_goes_round_until_all_have_refused_it_and_then_to_the_pool() {
    let instance = Instance::new(&problem(0.0)).unwrap();
    let mut central = central(&instance, 2);
    let mut asked = vec![owner(&central, 4).unwrap()];
    while let Some(next) = central.shed(&instance, 4, asked[asked.len() - 1]) {
        asked.extend(next.rovers);
    }
    asked.sort_unstable();
    assert_eq!(asked, [0, 1, 2]);
    assert_eq!(central.state(4), &State::Pooled);
    // A rover that does not have it has nothing to shed.
    assert_eq!(central.shed(&instance, 4, 0), None);

    assert_eq!(central.offer_pool(&instance).len(), 1);
    for _ in 0..3 {
        let rover = owner(&central, 4).unwrap();
        central.shed(&instance, 4, rover);
    }
    assert_eq!(central.offer_pool(&instance), []);
    let reason = Reason::Refused { offers: 2 };
    assert_eq!(central.deleted().collect::<Vec<_>>(), [(4, reason)]);
    assert_eq!(reason.to_string(), "all rovers have refused it, 2 times");
}

#[test]
fn a_shed_goal_goes_to_the_nearest_of_those_that_are_left() {
    let instance = Instance::new(&problem(0.0)).unwrap();
    let mut central = central(&instance, 2);
    let first = owner(&central, 7).unwrap();
    let tours = central.tours.clone();
    let others = (0..3).filter(|rover| *rover != first);
    let nearest = others.min_by_key(|rover| tours.away_mm(&instance, 7, *rover));
    let next = central.shed(&instance, 7, first).unwrap();
    assert_eq!(Some(next.rovers[0]), nearest);
}

#[test]
fn what_nobody_can_do_is_deleted_with_all_that_requires_it() {
    let mut problem = problem(0.0);
    problem.goals[2].duration_ms = 20_000_000;
    problem.goals[0].requires = vec![problem.goals[2].name.clone()];
    problem.goals[4].window_ms = Some([20_000_000, 80_000_000]);
    let instance = Instance::new(&problem).unwrap();
    let deleted: Vec<_> = central(&instance, 2).deleted().collect();
    let no_time = |duration_ms| Reason::NoTime { duration_ms };
    let expected = [
        (0, Reason::Requires { required: 2 }),
        (2, no_time(20_000_000)),
        (4, no_time(2_700_000)),
    ];
    assert_eq!(deleted, expected);
}

#[test]
fn tours_are_even_and_shorter_than_goals_dealt_out_in_turn() {
    let instance = Instance::new(&problem(0.0)).unwrap();
    let central = central(&instance, 2);
    let mut work_ms = [0; 3];
    for goal in 0..instance.goals() {
        work_ms[owner(&central, goal).unwrap()] += instance.task(goal).duration_ms;
    }
    let even_ms = work_ms.iter().sum::<i64>() as f64 / 3.0;
    assert!(
        work_ms.iter().all(|ms| (*ms as f64) < 1.1 * even_ms + 1e4),
        "{work_ms:?}"
    );
    let mut dealt = Tours::new(&instance);
    for goal in 0..instance.goals() {
        dealt.append(goal, goal / 3 % 3);
    }
    assert!(2 * central.tours.length_mm(&instance) < dealt.length_mm(&instance));
}

#[test]
fn two_rovers_are_appointed_for_a_time_at_which_both_are_free() {
    let problem = problem(1.0);
    let instance = Instance::new(&problem).unwrap();
    let central = central(&instance, 2);
    let mut meetings = Vec::new();
    for goal in 0..instance.goals() {
        let State::Assigned(assignment) = central.state(goal) else {
            continue;
        };
        if let Some(start_ms) = assignment.start_ms {
            assert_eq!(assignment.rovers.len(), 2);
            assert_ne!(assignment.rovers[0], assignment.rovers[1]);
            meetings.push((goal, start_ms, assignment.rovers.clone()));
        }
    }
    assert!(meetings.len() >= 4, "{meetings:?}");
    for (at, (goal, start_ms, rovers)) in meetings.iter().enumerate() {
        for (other, other_ms, others) in &meetings[..at] {
            for &rover in rovers.iter().filter(|rover| others.contains(rover)) {
                let drive_ms = instance.drive_ms(rover, *goal, *other);
                let (first, second, task) = match start_ms < other_ms {
                    true => (start_ms, other_ms, goal),
                    false => (other_ms, start_ms, other),
                };
                assert!(first + instance.task(*task).duration_ms + drive_ms <= *second);
            }
        }
    }
}

#[test]
fn a_goal_for_two_needs_two() {
    let config = ProblemConfig {
        rovers: 1,
        joint_share: 1.0,
        ..ProblemConfig::default()
    };
    let instance = Instance::new(&generate(&config, 6).unwrap()).unwrap();
    let reason = Reason::Rovers {
        needed: 2,
        rovers: 1,
    };
    assert!(
        central(&instance, 2)
            .deleted()
            .all(|(_, found)| found == reason)
    );
    assert_eq!(
        central(&instance, 2).deleted().count(),
        instance.goals() / 3
    );
}

/// Both may shed a goal for two in one round: neither is asked again at once.
#[test]
fn a_goal_that_both_shed_goes_to_neither() {
    let instance = Instance::new(&problem(1.0)).unwrap();
    let mut central = central(&instance, 2);
    let goal = (0..instance.goals())
        .find(|&goal| matches!(central.state(goal), State::Assigned(at) if at.rovers.len() == 2));
    let goal = goal.expect("some are assigned");
    let State::Assigned(first) = central.state(goal).clone() else {
        panic!("it is assigned");
    };
    assert_eq!(central.shed_by(&instance, goal, &first.rovers), None);
    assert_eq!(central.state(goal), &State::Pooled);
    assert_eq!(central.shed_by(&instance, goal, &first.rovers), None);
}
