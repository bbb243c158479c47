//! The goals of each rover, as the scenario gives them or by chance, in the words of the first agent.

use std::sync::Arc;

use farside::Pattern;
use farside::SimDuration;
use farside::random::RandomKey;
use farside_actors::system::SetupError;

use super::{Names, start};
use crate::config::{CAMERAS, GoalConfig, IdeaScenario};
use crate::ground::Order;
use crate::register::RegisterValue;

/// The goals of a rover.
#[derive(Clone, Debug)]
pub(crate) struct Goals {
    pub(crate) orders: Vec<Order>,
    /// What the ground says when it wants nothing.
    pub(crate) nothing: Arc<str>,
}

/// The goals of all rovers.
///
/// # Errors
/// When a goal is no rover's.
pub(crate) fn goals(
    scenario: &IdeaScenario,
    names: &[Names],
    problem_seed: u64,
) -> Result<Vec<Goals>, SetupError> {
    let mut of_rover: Vec<Vec<GoalConfig>> = vec![Vec::new(); names.len()];
    for (index, goal) in scenario.goal.iter().enumerate() {
        let wrong = |message: String| SetupError::value(&format!("goal.{index}.rover"), message);
        let pattern = Pattern::over_names(&goal.rover).map_err(|error| wrong(error.to_string()))?;
        let mut is_somebodys = false;
        for (rover, names) in names.iter().enumerate() {
            if pattern.matches(&names.rover) {
                is_somebodys = true;
                of_rover[rover].push(goal.clone());
            }
        }
        if !is_somebodys {
            let all: Vec<&str> = names.iter().map(|names| names.rover.as_str()).collect();
            let message = format!("{:?} matches no rover of {}", goal.rover, all.join(", "));
            return Err(wrong(message));
        }
    }
    if scenario.goal.is_empty() {
        for (rover, goals) in (0..).zip(&mut of_rover) {
            *goals = by_chance(scenario, problem_seed, rover);
        }
    }
    let each = (0..).zip(of_rover);
    Ok(each
        .map(|(rover, goals)| in_words(scenario, rover, goals))
        .collect())
}

/// Goals around where a rover starts.
fn by_chance(scenario: &IdeaScenario, problem_seed: u64, rover: u32) -> Vec<GoalConfig> {
    let key = RandomKey::new(problem_seed)
        .text("goals")
        .number(rover.into());
    let mut draws = key.stream();
    let each = (1..=scenario.goals.count).map(|number| {
        let radius_m = scenario.goals.within_m * libm::sqrt(draws.uniform());
        let direction = draws.uniform_in(-std::f64::consts::PI, std::f64::consts::PI);
        GoalConfig {
            name: format!("goal_{number:02}"),
            east_m: radius_m * libm::cos(direction),
            north_m: radius_m * libm::sin(direction),
            pan_rad: draws.uniform_in(-1.5, 1.5),
            tilt_rad: draws.uniform_in(-0.5, 0.2),
            camera: CAMERAS[draws.below(2) as usize].to_owned(),
            ..GoalConfig::default()
        }
    });
    each.collect()
}

/// Goals as the first agent's model has them.
fn in_words(scenario: &IdeaScenario, rover: u32, goals: Vec<GoalConfig>) -> Goals {
    let from = start(rover, scenario.agents.rovers);
    let mut latest = SimDuration::ZERO;
    let orders = goals.iter().map(|goal| {
        latest = latest.max(goal.at);
        let number = |value: f64| RegisterValue::Number(libm::round(value) as i64);
        let east_dm = 10.0 * (from.east_m + goal.east_m);
        let north_dm = 10.0 * (from.north_m + goal.north_m);
        Order {
            at: latest,
            procedure: "ImageAt".into(),
            inputs: vec![
                number(east_dm),
                number(north_dm),
                number(goal.pan_rad.to_degrees()),
                number(goal.tilt_rad.to_degrees()),
                RegisterValue::Symbol(goal.camera.as_str().into()),
            ],
        }
    });
    Goals {
        orders: orders.collect(),
        nothing: "NoGoal".into(),
    }
}
