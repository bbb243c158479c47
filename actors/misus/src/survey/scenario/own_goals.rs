//! Whether goals and combinations of one's own can be: what is wrong with which, and what was expected.

use std::collections::BTreeMap;

use farside::{SimDuration, suggest};
use farside_actors::system::SetupError;

use super::SurveyScenario;
use crate::shac::GoalKey;
use crate::survey::costs::Cost;
use crate::survey::wishes::{ChangeConfig, GoalConfig, key_of};

/// Checks all of them, one by one and together.
pub(super) fn check(scenario: &SurveyScenario) -> Result<(), SetupError> {
    let goals = &scenario.goals;
    let mut keys: BTreeMap<GoalKey, &str> = BTreeMap::new();
    for (at, goal) in goals.iter().enumerate() {
        check_goal(scenario, at, goal)?;
        if goals[..at].iter().any(|other| other.name == goal.name) {
            let message = format!("{:?}: expected each name once", goal.name);
            return Err(wrong(at, "name", message));
        }
        if let Some(other) = keys.insert(key_of(at, goal), &goal.name) {
            let message = format!("{other:?} is the same observation of the same rock");
            return Err(wrong(at, "rock", message));
        }
    }
    check_requirements(goals)?;
    check_joint(scenario)?;
    for (at, one) in scenario.combinations.iter().enumerate() {
        let key = |key: &str| format!("combination.{at}.{key}");
        for name in &one.goals {
            known(goals, name).map_err(|message| SetupError::value(&key("goals"), message))?;
        }
        let mut different = one.goals.clone();
        different.sort_unstable();
        different.dedup();
        if different.len() < 2 || different.len() < one.goals.len() {
            let message = format!("{:?}: expected two different goals or more", one.goals);
            return Err(SetupError::value(&key("goals"), message));
        }
        finite(&key("weight"), one.weight)?;
        let times = (one.added, one.withdrawn, one.changes.as_slice());
        check_times(&format!("combination.{at}"), times)?;
    }
    Ok(())
}

pub(super) fn wrong(goal: usize, key: &str, message: impl ToString) -> SetupError {
    SetupError::value(&format!("goal.{goal}.{key}"), message)
}

/// The place of a goal by its name, or what is said if there is none.
fn known(goals: &[GoalConfig], name: &str) -> Result<usize, String> {
    let at = goals.iter().position(|goal| goal.name == name);
    at.ok_or_else(|| {
        let names = goals.iter().map(|goal| goal.name.as_str());
        let hint = suggest::did_you_mean(suggest::nearest(name, names).as_deref());
        format!("no goal {name:?}{hint}")
    })
}

fn finite(key: &str, weight: f64) -> Result<(), SetupError> {
    match weight.is_finite() {
        true => Ok(()),
        false => Err(SetupError::value(
            key,
            format!("{weight}: expected a finite number"),
        )),
    }
}

fn check_goal(scenario: &SurveyScenario, at: usize, goal: &GoalConfig) -> Result<(), SetupError> {
    let Some(cost) = Cost::of(goal.observation, &scenario.rover) else {
        let message = format!(
            "no instrument of the rovers can do it for goal {:?}",
            goal.name
        );
        return Err(wrong(at, "observation", message));
    };
    finite(&format!("goal.{at}.weight"), goal.weight)?;
    let rocks = scenario.world.rocks;
    if let Some(rock) = goal.rock.filter(|rock| *rock >= rocks) {
        let message = format!(
            "{rock} of goal {:?}: the field has {rocks} rocks, from 0",
            goal.name
        );
        return Err(wrong(at, "rock", message));
    }
    let half_m = 0.5 * scenario.world.side_m;
    for (key, place_m) in [("east_m", goal.east_m), ("north_m", goal.north_m)] {
        if place_m.is_nan() || place_m.abs() > half_m {
            let message = format!(
                "{place_m} m of goal {:?}: outside the terrain, expected within {half_m} m of the middle",
                goal.name
            );
            return Err(wrong(at, key, message));
        }
    }
    let times = (goal.added, goal.withdrawn, goal.changes.as_slice());
    check_times(&format!("goal.{at}"), times)?;
    let opens = goal.opens.unwrap_or_default();
    match goal.closes {
        Some(closes) if closes <= opens => {
            let message = format!("{closes}: the window never opens, expected over {opens}");
            Err(wrong(at, "closes", message))
        }
        Some(closes) if closes < opens + cost.duration => {
            let duration = cost.duration;
            let message = format!("{closes}: the observation takes {duration} from {opens}");
            Err(wrong(at, "closes", message))
        }
        _ => Ok(()),
    }
}

/// Changes come in order, after the goal and before it goes.
fn check_times(
    table: &str,
    (added, withdrawn, changes): (SimDuration, Option<SimDuration>, &[ChangeConfig]),
) -> Result<(), SetupError> {
    let mut before = added;
    for (at, change) in changes.iter().enumerate() {
        let key = format!("{table}.change.{at}");
        finite(&format!("{key}.weight"), change.weight)?;
        if change.at <= before {
            let message = format!("{}: expected after {before}", change.at);
            return Err(SetupError::value(&format!("{key}.at"), message));
        }
        before = change.at;
    }
    match withdrawn {
        Some(withdrawn) if withdrawn <= before => {
            let message = format!("{withdrawn}: expected after {before}");
            Err(SetupError::value(&format!("{table}.withdrawn"), message))
        }
        _ => Ok(()),
    }
}

/// Every name is known, and no goal requires itself, over however many others.
fn check_requirements(goals: &[GoalConfig]) -> Result<(), SetupError> {
    let mut requires: Vec<Vec<usize>> = Vec::new();
    for (at, goal) in goals.iter().enumerate() {
        let others = goal.requires.iter().map(|name| known(goals, name));
        let others: Result<Vec<usize>, String> = others.collect();
        requires.push(others.map_err(|message| wrong(at, "requires", message))?);
    }
    for at in 0..goals.len() {
        let mut path = vec![at];
        if leads_back(&requires, &mut path, &mut vec![false; goals.len()]) {
            let names: Vec<&str> = path.iter().map(|at| goals[*at].name.as_str()).collect();
            let message = format!(
                "goals that require each other in a circle: {}",
                names.join(", ")
            );
            return Err(wrong(at, "requires", message));
        }
    }
    Ok(())
}

/// Goals for two rovers: what cannot be asked of them.
fn check_joint(scenario: &SurveyScenario) -> Result<(), SetupError> {
    let goals = &scenario.goals;
    let is_joint = |name: &String| {
        goals
            .iter()
            .any(|goal| goal.name == *name && goal.rovers > 1)
    };
    for (at, goal) in goals.iter().enumerate() {
        let name = &goal.name;
        if let Some(other) = goal.requires.iter().find(|other| is_joint(other)) {
            let message =
                format!("{other:?} of goal {name:?}: a goal for two rovers is no single rover's");
            return Err(wrong(at, "requires", message));
        }
        if goal.rovers == 1 {
            continue;
        }
        if goal.rovers > scenario.team.rovers {
            let rovers = scenario.team.rovers;
            let message = format!("goal {name:?} needs 2 rovers, and there is {rovers}");
            return Err(wrong(at, "rovers", message));
        }
        if goal.mandatory {
            let message =
                format!("goal {name:?} needs 2 rovers, and neither can answer for the other");
            return Err(wrong(at, "mandatory", message));
        }
        if !goal.requires.is_empty() {
            let message = format!("goal {name:?} needs 2 rovers, and a goal is required of one");
            return Err(wrong(at, "requires", message));
        }
    }
    Ok(())
}

/// Whether a way leads from the first goal of a path, beyond its last, back to the first; the path is that way
/// then.
fn leads_back(requires: &[Vec<usize>], path: &mut Vec<usize>, seen: &mut [bool]) -> bool {
    let last = path[path.len() - 1];
    for &next in &requires[last] {
        if next == path[0] {
            return true;
        }
        if std::mem::replace(&mut seen[next], true) {
            continue;
        }
        path.push(next);
        if leads_back(requires, path, seen) {
            return true;
        }
        path.pop();
    }
    false
}
