//! Plans of random situations, judged by the checker of plans, which shares no code with planners, and by the
//! Sun's power minute by minute.

use farside_actors::rover::RoverConfig;
use farside_worlds::Sky;
use proptest::prelude::*;

use super::posing::Cut;
use super::*;
use crate::planner::plan::{PlanViolation, Stop, TeamPlan, violations};
use crate::survey::execution::ExecutionConfig;

const STARTS_S: f64 = 7.0 * 3600.0;
const SIDE_M: f64 = 80.0;
const SUN_LEAST_RAD: f64 = 0.1;

fn sky() -> Sky {
    Sky::new(-14.6, 270.0, 0.5).unwrap()
}

fn outlook(mode: PlanMode) -> Outlook {
    let rover = RoverConfig::default();
    let config = ExecutionConfig::default();
    let diameters_m = std::iter::repeat_n(0.6, 90);
    Outlook::new(
        Means::new(&rover, &config, 0.45, SIDE_M, diameters_m),
        Forecast::new(sky(), STARTS_S, &rover, SUN_LEAST_RAD, config.sun_share),
        PlannerConfig::default(),
        mode,
        RandomKey::new(5),
    )
}

fn key(number: u32) -> GoalKey {
    GoalKey::Numbered(number)
}

fn goal(number: u32, position_m: [f64; 2], duration_ms: i64) -> OwnGoal {
    OwnGoal {
        key: key(number),
        position_m,
        duration_ms,
        power_w: 20.0,
        memory_bits: 8_000_000,
        mandatory: false,
        window_ms: [0, i64::MAX],
        requires: Vec::new(),
    }
}

/// A rover in the middle of the field, with goals around it.
fn situation(goals: Vec<OwnGoal>, now_ms: i64) -> Known {
    let weights = goals.iter().map(|goal| match goal.key {
        GoalKey::Numbered(number) => (goal.key, 1.0 + f64::from(number % 5)),
        GoalKey::Observation(_) => (goal.key, 1.0),
    });
    Known {
        now_ms,
        position_m: [0.0; 2],
        battery_j: 1.6e6,
        clean: 1.0,
        memory_bits: 0,
        memory_size_bits: 2_048_000_000,
        fixed: Vec::new(),
        worth: Worth {
            weights: weights.collect(),
            combinations: vec![ListedCombination {
                goals: vec![key(0), key(1)],
                weight: 3.0,
            }],
        },
        goals,
        held: BTreeSet::new(),
        achieved: BTreeSet::new(),
        communicated: BTreeSet::new(),
        has_gained: false,
    }
}

prop_compose! {
    fn goals()(
        all in prop::collection::vec(
            ([-35.0..35.0f64, -35.0..35.0f64], 1..120i64, any::<bool>(), 0..80_000_000i64), 0..14,
        ),
    ) -> Vec<OwnGoal> {
        let one = |(number, (place_m, minutes, is_windowed, opens_ms)): (u32, _)| {
            let mut goal = goal(number, place_m, minutes * 60_000);
            if is_windowed {
                goal.window_ms = [opens_ms, opens_ms + 20_000_000];
            }
            if number % 4 == 3 {
                goal.requires = vec![key(number - 1)];
            }
            goal
        };
        (0..).zip(all).map(one).collect()
    }
}

prop_compose! {
    fn known()(
        goals in goals(),
        now_ms in 0..60_000_000i64,
        battery_j in 0.2e6..2.0e6f64,
        clean in 0.3..1.0f64,
        stored in 0..=256_000_000i64,
        size in 2_000_000..256_000_000i64,
        runs in prop::option::of((0..3_600_000i64, [-30.0..30.0f64, -30.0..30.0f64])),
        is_told in any::<bool>(),
    ) -> Known {
        let mut known = situation(goals, now_ms);
        known.battery_j = battery_j;
        known.clean = clean;
        known.memory_size_bits = 8 * size;
        known.memory_bits = 8 * stored.min(size);
        if is_told {
            known.communicated.insert(0);
        }
        if let Some((left_ms, position_m)) = runs {
            let piece = |activity, starts_ms, ends_ms, power_w| Piece {
                activity, position_m, starts_ms, ends_ms, power_w,
                adds_bits: 0, sends_bits: 0, battery_j: 0.0, memory_bits: 0,
            };
            let ends_ms = now_ms + left_ms + 1;
            known.fixed = vec![
                piece(Activity::Drive(key(99)), now_ms - 5_000, ends_ms, 115.0),
                piece(Activity::Goal(key(99)), ends_ms, ends_ms + 1_320_000, 20.0),
            ];
        }
        known
    }
}

/// What is wrong with what of a plan is not fixed, by the checker.
fn wrong(outlook: &mut Outlook, known: &Known, plan: &Plan) -> Vec<PlanViolation> {
    let means = outlook.means.clone();
    let posed = pose(&means, &mut outlook.forecast, known, &Cut::default()).unwrap();
    let Some(mut posed) = posed else {
        assert_eq!(plan.goals().count(), posing::fixed_goals(known).count());
        return Vec::new();
    };
    for (duty, sol) in posed.problem.activities.iter_mut().zip(&posed.duties) {
        // Planners prefer the first half of it.
        let until_s = means.communicates_s[1];
        duty.window_ms[1] = outlook.forecast.time_ms(*sol, until_s);
    }
    let free = plan.pieces.iter().skip(known.fixed.len());
    let stop = |piece: &Piece| {
        let sol = outlook.forecast.sol_at(piece.starts_ms);
        let task = match piece.activity {
            Activity::Goal(key) => {
                let number = posed.keys.iter().position(|at| *at == key).unwrap();
                posed.problem.goals[number].name.clone()
            }
            Activity::Communication(sol) => format!("communication {sol}"),
            Activity::Drive(_) | Activity::Sleep => return None,
        };
        Some(Stop {
            task,
            sol: posed.sols.iter().position(|at| *at == sol).unwrap(),
            start_ms: piece.starts_ms,
        })
    };
    let stops = free.filter_map(stop).collect();
    let team = TeamPlan {
        rovers: vec![stops, Vec::new()],
    };
    violations(&posed.problem, &team)
}

/// What is wrong with a plan's goals and memory by what is known, whatever problem was made of it.
fn contradicts(known: &Known, plan: &Plan) -> Option<String> {
    let mut stored_bits = known.memory_bits;
    let mut done = known.achieved.clone();
    for (number, piece) in plan.pieces.iter().enumerate() {
        let wrong = |what: &str| Some(format!("{what}: {piece:?}"));
        let goal = match piece.activity {
            Activity::Goal(key) => known.goals.iter().find(|goal| goal.key == key),
            _ => None,
        };
        if number < known.fixed.len() {
            done.extend(posing::fixed_goals(known));
        } else if let Some(goal) = goal {
            let [opens_ms, closes_ms] = goal.window_ms;
            stored_bits += goal.memory_bits;
            if piece.ends_ms - piece.starts_ms != goal.duration_ms {
                return wrong("duration");
            }
            if piece.starts_ms < opens_ms || piece.ends_ms > closes_ms {
                return wrong("window");
            }
            if piece.position_m != goal.position_m {
                return wrong("place");
            }
            if !goal.requires.iter().all(|key| done.contains(key)) || !done.insert(goal.key) {
                return wrong("order");
            }
        }
        if let Activity::Communication(_) = piece.activity {
            stored_bits -= piece.sends_bits.min(stored_bits);
        }
        if stored_bits > known.memory_size_bits || stored_bits != piece.memory_bits {
            return wrong("memory");
        }
    }
    None
}

/// The least charge by a plan, minute by minute, with the sunlight that it counts on.
fn least_j(outlook: &mut Outlook, known: &Known, plan: &Plan) -> f64 {
    let rover = RoverConfig::default();
    let share = ExecutionConfig::default().sun_share;
    let end_ms = plan.pieces.iter().map(|piece| piece.ends_ms).max();
    let (mut stored_j, mut least_j) = (known.battery_j, known.battery_j);
    let mut at_ms = known.now_ms;
    while at_ms < end_ms.unwrap_or(at_ms) {
        let middle_ms = at_ms + 30_000;
        let sky_s = STARTS_S + middle_ms as f64 * 1e-3;
        let dust = libm::pow(
            1.0 - rover.dust_per_sol,
            middle_ms as f64 * 1e-3 / 88_775.244,
        );
        let array_w = rover.array_m2 * rover.array_efficiency * dust * sky().power_w_m2(sky_s);
        let is_light = sky().elevation_deg(sky_s) >= SUN_LEAST_RAD.to_degrees();
        let body_w = if is_light {
            rover.awake_power_w
        } else {
            rover.sleep_power_w
        };
        let runs = |piece: &&Piece| (piece.starts_ms..piece.ends_ms).contains(&middle_ms);
        let load_w: f64 = plan
            .pieces
            .iter()
            .filter(runs)
            .map(|piece| piece.power_w)
            .sum();
        let warm_w = (rover.night_power_w - array_w).max(0.0);
        let net_w = share * known.clean * array_w - body_w - warm_w - load_w;
        let part = if net_w > 0.0 {
            rover.charge_efficiency
        } else {
            1.0
        };
        stored_j = (stored_j + 60.0 * part * net_w).clamp(0.0, rover.battery_j);
        least_j = least_j.min(stored_j);
        at_ms += 60_000;
    }
    let _ = outlook;
    least_j
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever a rover knows, its plan can be carried out, keeps its reserve, and leaves alone what runs and
    /// what is committed; planned again with nothing new, it is the same.
    #[test]
    fn plans_can_be_carried_out(known in known(), is_batch in any::<bool>()) {
        let mode = if is_batch { PlanMode::Batch } else { PlanMode::Continuous };
        let mut outlook = outlook(mode);
        let plan = outlook.plan(&known, None, 1).unwrap();
        for (fixed, piece) in known.fixed.iter().zip(&plan.pieces) {
            let same = (piece.activity, piece.starts_ms, piece.ends_ms);
            prop_assert_eq!((fixed.activity, fixed.starts_ms, fixed.ends_ms), same);
        }
        for violation in wrong(&mut outlook, &known, &plan) {
            // A communication for which there is no time is told to be missed.
            let is_missed = matches!(&violation, PlanViolation::Missing { .. })
                && !plan.missed.is_empty();
            prop_assert!(is_missed, "{violation}");
        }
        prop_assert_eq!(contradicts(&known, &plan), None);
        for pair in plan.pieces.windows(2) {
            prop_assert!(pair[0].ends_ms <= pair[1].starts_ms, "{pair:?}");
        }
        for piece in &plan.pieces {
            prop_assert!(piece.battery_j >= plan.reserve_j - 1.0, "{piece:?}");
            prop_assert!((0..=known.memory_size_bits).contains(&piece.memory_bits));
        }
        // A minute's worth of the largest load may be told to the wrong minute, a few times.
        let least_j = least_j(&mut outlook, &known, &plan);
        prop_assert!(least_j >= plan.reserve_j - 25_000.0, "{least_j} of {}", plan.reserve_j);
        if !is_batch {
            let again = outlook.plan(&known, Some(&plan), 2).unwrap();
            prop_assert_eq!(&again.pieces, &plan.pieces);
            prop_assert_eq!(again.moved_from(&plan, known.now_ms), 0);
        }
    }
}

#[test]
fn a_goal_that_is_worth_less_than_nothing_with_another_is_declined() {
    let goals = vec![goal(0, [3.0, 0.0], 600_000), goal(1, [4.0, 0.0], 600_000)];
    let mut known = situation(goals, 0);
    known.worth.combinations[0].weight = -30.0;
    let mut outlook = outlook(PlanMode::Continuous);
    let plan = outlook.plan(&known, None, 1).unwrap();
    assert_eq!(plan.goals().count(), 1);
    assert_eq!(plan.left_out.len(), 1);
    assert_eq!(plan.left_out[0].1, Reason::Worth);
    // What another rover holds counts like what one's own plan has.
    known.goals.truncate(1);
    known.held.insert(key(1));
    let plan = outlook.plan(&known, None, 2).unwrap();
    assert_eq!((plan.goals().count(), plan.score), (0, 2.0));
    known.worth.combinations[0].weight = 30.0;
    let plan = outlook.plan(&known, Some(&plan), 3).unwrap();
    assert_eq!((plan.goals().count(), plan.score), (1, 33.0));
}

#[test]
fn a_mandatory_goal_is_planned_first_and_one_without_room_is_named() {
    let mut goals: Vec<OwnGoal> = (0..8)
        .map(|number| goal(number, [10.0, f64::from(number)], 3 * 3_600_000))
        .collect();
    goals[6].mandatory = true;
    let mut known = situation(goals, 0);
    known.worth.weights.insert(key(6), -5.0);
    let mut outlook = outlook(PlanMode::Continuous);
    let plan = outlook.plan(&known, None, 1).unwrap();
    assert!(plan.goals().any(|goal| goal == key(6)));
    assert!(plan.goals().count() < 8 && plan.left_out.len() + plan.shed.len() > 0);
    // It is there after a resumption, too, though the plan before had it not.
    known.goals[0].mandatory = true;
    let plan = outlook.plan(&known, Some(&plan), 2).unwrap();
    assert!(
        [0, 6]
            .iter()
            .all(|number| plan.goals().any(|goal| goal == key(*number)))
    );
    known.goals[6].window_ms = [0, 3_600_000];
    let plan = outlook.plan(&known, Some(&plan), 3).unwrap();
    assert!(plan.left_out.contains(&(key(6), Reason::Time)));
}

#[test]
fn with_a_low_battery_the_day_begins_when_the_sun_has_given_enough() {
    let goals = (0..3).map(|number| goal(number, [8.0, f64::from(number)], 600_000));
    let mut known = situation(goals.collect(), 0);
    let mut outlook = outlook(PlanMode::Continuous);
    let early = outlook.plan(&known, None, 1).unwrap();
    known.battery_j = 0.905e6;
    let late = outlook.plan(&known, None, 2).unwrap();
    let first = |plan: &Plan| plan.pieces[0].starts_ms;
    assert!(
        first(&early) == 0 && first(&late) >= 3_600_000,
        "{}",
        first(&late)
    );
    assert_eq!(late.goals().count(), 3);
    // An array that yields nothing leaves nothing but the communications.
    known.clean = 0.0;
    let dark = outlook.plan(&known, None, 3).unwrap();
    assert_eq!(dark.goals().count(), 0);
    assert!(
        dark.pieces
            .iter()
            .any(|at| at.activity == Activity::Communication(0))
    );
    assert!(
        dark.left_out
            .iter()
            .all(|(_, reason)| *reason == Reason::Power)
    );
}
