//! The planner's problem, made of what a rover knows: itself, and one more that stands for all others and
//! holds what they hold.

use std::collections::{BTreeMap, BTreeSet};

use super::{Forecast, Known, Means, OwnGoal};
use crate::planner::problem::{
    Activity as Duty, Combination, FORMAT, Goal, Problem, ProblemError, Rover, Sol,
};
use crate::shac::{GoalKey, Reason};
use crate::survey::messages::Activity;

/// The shortest rest of a day for which anything is planned \[ms\].
const LEAST_DAY_MS: i64 = 60_000;

/// The most energy that a sol may have in a problem \[J\]: far more than any rover has.
const MOST_J: f64 = 1e9;

/// The latest time that a problem knows \[ms\].
const LATEST_MS: i64 = 1_000_000_000_000;

/// By how much a day is cut, so that a plan keeps its reserve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cut {
    /// How much later the first day begins \[ms\].
    pub delay_ms: i64,
    /// By sol of the run: how much less energy there is \[J\].
    pub energy_j: BTreeMap<u32, f64>,
}

/// A problem, and what its names stand for.
#[derive(Clone, Debug, PartialEq)]
pub struct Posed {
    /// The problem: the rover is its first, and the second stands for all others.
    pub problem: Problem,
    /// What each of its goals is called elsewhere. Own goals come first.
    pub keys: Vec<GoalKey>,
    /// How many of them are the rover's own.
    pub own: usize,
    /// The sol of the run that each sol of the problem is.
    pub sols: Vec<u32>,
    /// The sol of the run of each activity.
    pub duties: Vec<u32>,
    /// Own goals that cannot be planned at all, and why.
    pub impossible: Vec<(GoalKey, Reason)>,
    /// Sols whose communication does not fit any more.
    pub missed: Vec<u32>,
}

/// When and where a rover is ready for what is not fixed, and with what in memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ready {
    /// When \[ms\].
    pub(super) at_ms: i64,
    /// Where \[m\].
    pub position_m: [f64; 2],
    /// What memory holds \[bit\].
    pub memory_bits: i64,
}

impl Ready {
    /// After what is fixed.
    pub(super) fn after(known: &Known) -> Ready {
        let mut ready = Ready {
            at_ms: known.now_ms,
            position_m: known.position_m,
            memory_bits: known.memory_bits,
        };
        for piece in &known.fixed {
            ready.at_ms = ready.at_ms.max(piece.ends_ms);
            ready.position_m = piece.position_m;
            ready.memory_bits += piece.adds_bits;
            ready.memory_bits -= piece.sends_bits.min(ready.memory_bits);
        }
        ready
    }
}

/// Makes the problem of what is not fixed; None if no day is left in which anything could be done.
///
/// # Errors
/// When what is known cannot be planned with: numbers that are none, goals that require each other.
pub fn pose(
    means: &Means,
    forecast: &mut Forecast,
    known: &Known,
    cut: &Cut,
) -> Result<Option<Posed>, ProblemError> {
    let ready = Ready::after(known);
    let days = days(means, forecast, known, &ready, cut);
    if days.is_empty() {
        return Ok(None);
    }
    let mut posed = Posed {
        problem: team(means, known, &ready, &days),
        keys: Vec::new(),
        own: 0,
        sols: days.iter().map(|(sol, _)| *sol).collect(),
        duties: Vec::new(),
        impossible: Vec::new(),
        missed: Vec::new(),
    };
    add_duties(means, forecast, known, &days, &mut posed);
    add_goals(means, known, &ready, &mut posed);
    add_combinations(known, &mut posed);
    posed.problem.resolve()?;
    Ok(Some(posed))
}

/// The days in which something can be done, each with the sol of the run that it is of.
fn days(
    means: &Means,
    forecast: &mut Forecast,
    known: &Known,
    ready: &Ready,
    cut: &Cut,
) -> Vec<(u32, Sol)> {
    let first = forecast.sol_at(known.now_ms);
    let fixed_j: f64 = known
        .fixed
        .iter()
        .map(|at| at.power_w * (at.ends_ms - at.starts_ms.max(known.now_ms)).max(0) as f64 * 1e-3)
        .sum();
    let mut days = Vec::new();
    // What is there above the reserve, and comes in until the next dawn.
    let mut from_ms = known.now_ms;
    let mut has_j = known.battery_j - means.reserve_j - fixed_j;
    let mut delay_ms = cut.delay_ms;
    for sol in first..first + means.horizon {
        let Some([opens_ms, closes_ms]) = forecast.day_ms(sol) else {
            continue;
        };
        let dawn_ms = match forecast.day_ms(sol + 1) {
            Some([opens_ms, _]) => opens_ms,
            None => forecast.time_ms(sol + 1, 0.0),
        };
        has_j += forecast.gain_j(from_ms, dawn_ms, known.clean);
        from_ms = dawn_ms;
        let mut opens_ms = opens_ms.max(ready.at_ms);
        if closes_ms - opens_ms < LEAST_DAY_MS {
            continue;
        }
        opens_ms = (opens_ms + std::mem::take(&mut delay_ms)).min(closes_ms - LEAST_DAY_MS);
        let cut_j = cut.energy_j.get(&sol).copied().unwrap_or(0.0);
        let duty_j = means.radio_power_w * means.communication_ms as f64 * 1e-3;
        let energy_j = (has_j - cut_j).clamp(0.0, MOST_J).max(duty_j);
        let energy_uj = (energy_j * 1e6) as i64;
        days.push((
            sol,
            Sol {
                opens_ms,
                closes_ms,
                energy_uj,
            },
        ));
        // What a sol leaves is not counted on in the next.
        has_j = 0.0;
    }
    days
}

/// A problem of two rovers without goals.
fn team(means: &Means, known: &Known, ready: &Ready, days: &[(u32, Sol)]) -> Problem {
    let rover = |name: &str| Rover {
        name: name.to_owned(),
        position_m: inside(means, ready.position_m),
        speed_mm_s: means.speed_mm_s,
        drive_mw: milliwatts(means.drive_power_w),
        memory_bits: known.memory_size_bits.max(0),
        stored_bits: ready.memory_bits.clamp(0, known.memory_size_bits.max(0)),
        sols: days.iter().map(|(_, sol)| *sol).collect(),
    };
    Problem {
        format: FORMAT.to_owned(),
        name: "outlook".to_owned(),
        side_m: means.side_m,
        rovers: vec![rover("self"), rover("others")],
        goals: Vec::new(),
        combinations: Vec::new(),
        activities: Vec::new(),
        objective: means.objective.clone(),
    }
}

fn add_duties(
    means: &Means,
    forecast: &Forecast,
    known: &Known,
    days: &[(u32, Sol)],
    posed: &mut Posed,
) {
    if means.communication_ms == 0 {
        return;
    }
    let is_fixed = |sol| {
        let mut fixed = known.fixed.iter();
        fixed.any(|at| at.activity == Activity::Communication(sol))
    };
    let first = forecast.sol_at(known.now_ms);
    for sol in first..first + means.horizon {
        if known.communicated.contains(&sol) || is_fixed(sol) {
            continue;
        }
        let window_ms = means.communicates_s.map(|at_s| forecast.time_ms(sol, at_s));
        let day = days.iter().position(|(number, _)| *number == sol);
        let fits = |day: usize, closes_ms: i64| {
            let (opens_ms, day_ms) = (
                window_ms[0].max(days[day].1.opens_ms),
                days[day].1.closes_ms,
            );
            closes_ms.min(day_ms) - opens_ms >= means.communication_ms
        };
        // In the first half of its window, if it can be: what is late then does not make it fail.
        let middle_ms = window_ms[0] + (window_ms[1] - window_ms[0]) / 2;
        let mut closings_ms = [middle_ms, window_ms[1]].into_iter();
        let found = day.and_then(|day| {
            let closes_ms = closings_ms.find(|closes_ms| fits(day, *closes_ms))?;
            Some((day, [window_ms[0], closes_ms]))
        });
        let Some((day, window_ms)) = found else {
            // That of a sol to come is planned when it has come, if its day has light enough.
            if sol == first && window_ms[1] >= 0 {
                posed.missed.push(sol);
            }
            continue;
        };
        posed.problem.activities.push(Duty {
            name: format!("communication {sol}"),
            rover: "self".to_owned(),
            sol: day,
            window_ms: window_ms.map(|at_ms| at_ms.max(0)),
            duration_ms: means.communication_ms,
            power_mw: milliwatts(means.radio_power_w),
            sends_bits: means.sends_bits,
        });
        posed.duties.push(sol);
    }
}

/// Own goals, and those of others that are in combinations with them.
fn add_goals(means: &Means, known: &Known, ready: &Ready, posed: &mut Posed) {
    let fixed: BTreeSet<GoalKey> = fixed_goals(known).collect();
    let is_done = |key: &GoalKey| known.achieved.contains(key) || fixed.contains(key);
    let mut own: Vec<&OwnGoal> = Vec::new();
    for goal in known.goals.iter().filter(|goal| !fixed.contains(&goal.key)) {
        let [opens_ms, closes_ms] = goal.window_ms;
        let lasts_ms = goal.duration_ms;
        if closes_ms.min(LATEST_MS) - opens_ms.max(ready.at_ms) < lasts_ms {
            posed.impossible.push((goal.key, Reason::Time));
        } else {
            own.push(goal);
        }
    }
    // What requires what this rover cannot do first cannot be done either.
    loop {
        let keys: BTreeSet<GoalKey> = own.iter().map(|goal| goal.key).collect();
        let is_open = |goal: &&OwnGoal| {
            let mut requires = goal.requires.iter();
            requires.all(|key| is_done(key) || keys.contains(key))
        };
        let before = own.len();
        let gone = own.iter().filter(|goal| !is_open(goal));
        posed
            .impossible
            .extend(gone.map(|goal| (goal.key, Reason::Time)));
        own.retain(|goal| is_open(goal));
        if own.len() == before {
            break;
        }
    }
    let mandatory = mandatory(&own);
    let names: BTreeMap<GoalKey, String> = (0..)
        .zip(&own)
        .map(|(number, goal)| (goal.key, format!("goal {number}")))
        .collect();
    for goal in &own {
        let requires = goal
            .requires
            .iter()
            .filter_map(|key| names.get(key).cloned());
        let [opens_ms, closes_ms] = goal.window_ms;
        posed.keys.push(goal.key);
        posed.problem.goals.push(Goal {
            name: names[&goal.key].clone(),
            rock: None,
            kind: None,
            position_m: inside(means, goal.position_m),
            duration_ms: goal.duration_ms,
            power_mw: milliwatts(goal.power_w),
            memory_bits: goal.memory_bits,
            weight: known.worth.weights.get(&goal.key).copied().unwrap_or(0.0),
            window_ms: Some([opens_ms.max(0), closes_ms.min(LATEST_MS)]),
            requires: requires.collect(),
            rovers: 1,
            mandatory: mandatory.contains(&goal.key),
        });
    }
    posed.own = own.len();
}

/// Goals that are mandatory, or required by one that is.
fn mandatory(own: &[&OwnGoal]) -> BTreeSet<GoalKey> {
    let chosen = own.iter().filter(|goal| goal.mandatory);
    let mut mandatory: BTreeSet<GoalKey> = chosen.map(|goal| goal.key).collect();
    loop {
        let before = mandatory.len();
        for goal in own {
            if mandatory.contains(&goal.key) {
                mandatory.extend(&goal.requires);
            }
        }
        if mandatory.len() == before {
            return mandatory;
        }
    }
}

/// Combinations that own goals may complete: with each other, and with what is held.
fn add_combinations(known: &Known, posed: &mut Posed) {
    let own: BTreeSet<GoalKey> = posed.keys.iter().copied().collect();
    let fixed: BTreeSet<GoalKey> = fixed_goals(known).collect();
    let is_held = |key: &GoalKey| {
        known.held.contains(key) || known.achieved.contains(key) || fixed.contains(key)
    };
    let mut names: BTreeMap<GoalKey, String> = (0..)
        .zip(&posed.keys)
        .map(|(number, key)| (*key, format!("goal {number}")))
        .collect();
    for at in &known.worth.combinations {
        let may_come = at.goals.iter().all(|key| own.contains(key) || is_held(key));
        if !may_come || !at.goals.iter().any(|key| own.contains(key)) {
            continue;
        }
        for &key in &at.goals {
            if names.contains_key(&key) {
                continue;
            }
            let name = format!("goal {}", posed.keys.len());
            names.insert(key, name.clone());
            posed.keys.push(key);
            posed
                .problem
                .goals
                .push(held(name, &posed.problem.rovers[0]));
        }
        posed.problem.combinations.push(Combination {
            goals: at.goals.iter().map(|key| names[key].clone()).collect(),
            weight: at.weight,
        });
    }
}

/// A goal that others hold: it is there for its combinations.
fn held(name: String, rover: &Rover) -> Goal {
    Goal {
        name,
        rock: None,
        kind: None,
        position_m: rover.position_m,
        duration_ms: 0,
        power_mw: 0,
        memory_bits: 0,
        weight: 0.0,
        window_ms: None,
        requires: Vec::new(),
        rovers: 1,
        mandatory: false,
    }
}

/// The goals among what is fixed.
pub(super) fn fixed_goals(known: &Known) -> impl Iterator<Item = GoalKey> + '_ {
    known.fixed.iter().filter_map(|piece| match piece.activity {
        Activity::Goal(key) => Some(key),
        _ => None,
    })
}

/// A place within the terrain: an estimate may lie a little outside.
fn inside(means: &Means, place_m: [f64; 2]) -> [f64; 2] {
    let half_m = 0.5 * means.side_m;
    place_m.map(|at_m| at_m.clamp(-half_m, half_m))
}

fn milliwatts(power_w: f64) -> i64 {
    libm::ceil(power_w * 1e3) as i64
}
