//! The goals of each rover, as the scenario gives them or by chance, in the words of the first agent.

use std::sync::Arc;

use farside::Pattern;
use farside::random::RandomKey;
use farside::suggest::{did_you_mean, nearest};
use farside_actors::system::SetupError;

use super::{Names, start};
use crate::config::{CAMERAS, GoalConfig, IdeaScenario};
use crate::ground::Order;
use crate::register::RegisterValue;

/// The goals of a rover.
#[derive(Clone, Debug)]
pub(crate) struct Goals {
    /// How many are wanted until the end.
    pub(crate) wanted: usize,
    pub(crate) orders: Vec<Order>,
    /// What the ground says when it wants nothing.
    pub(crate) nothing: Arc<str>,
    /// Where the rover starts \[dm\].
    pub(crate) start_dm: [i64; 2],
    /// What and where they are, for who shows them.
    pub(crate) places: Vec<GoalPlace>,
}

/// A goal, for who shows it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GoalPlace {
    /// Its number among those of its rover, from 1.
    pub(crate) number: i64,
    pub(crate) name: String,
    /// East, north \[m\].
    pub(crate) place_m: [f64; 2],
    /// What the system agent calls it.
    pub(crate) words: String,
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
        if goal.recalled.is_some() && scenario.agents.layers == 1 {
            let message = "the system agent alone takes goals one after the other, and cannot be asked to \
                           forget one: expected agents.layers above 1";
            return Err(SetupError::value(
                &format!("goal.{index}.recalled"),
                message,
            ));
        }
        if !CAMERAS.contains(&goal.camera.as_str()) {
            let hint = did_you_mean(nearest(&goal.camera, CAMERAS.into_iter()).as_deref());
            let known = CAMERAS.join(", ");
            let message = format!("{:?}: expected one of {known}{hint}", goal.camera);
            return Err(SetupError::value(&format!("goal.{index}.camera"), message));
        }
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

/// Goals as the first agent's model has them. What is to be sent first comes first; of what is sent at
/// one time, what the scenario has first.
fn in_words(scenario: &IdeaScenario, rover: u32, goals: Vec<GoalConfig>) -> Goals {
    let is_ordered = scenario.agents.layers > 1;
    let from = start(rover, scenario.agents.rovers);
    let number = |value: f64| RegisterValue::Number(libm::round(value) as i64);
    let (mut orders, mut places) = (Vec::new(), Vec::new());
    for (index, goal) in (1..).zip(&goals) {
        let mut image = vec![
            number(10.0 * (from.east_m + goal.east_m)),
            number(10.0 * (from.north_m + goal.north_m)),
            number(goal.pan_rad.to_degrees()),
            number(goal.tilt_rad.to_degrees()),
            RegisterValue::Symbol(goal.camera.as_str().into()),
        ];
        places.push(GoalPlace {
            number: index,
            name: match goal.name.as_str() {
                "" => format!("goal {index}"),
                name => name.to_owned(),
            },
            place_m: [from.east_m + goal.east_m, from.north_m + goal.north_m],
            words: in_one("ImageAt", &image),
        });
        if is_ordered {
            image.insert(0, RegisterValue::Number(index));
        }
        if let Some(at) = goal.recalled.filter(|_| is_ordered) {
            orders.push(Order {
                at,
                procedure: "Recall".into(),
                inputs: image.clone(),
            });
        }
        if is_ordered {
            image.push(RegisterValue::Number(goal.weight.into()));
        }
        orders.push(Order {
            at: goal.at,
            procedure: if is_ordered { "Request" } else { "ImageAt" }.into(),
            inputs: image,
        });
    }
    orders.sort_by_key(|order| order.at);
    Goals {
        wanted: goals.iter().filter(|goal| goal.recalled.is_none()).count(),
        orders,
        nothing: if is_ordered { "Quiet" } else { "NoGoal" }.into(),
        start_dm: [from.east_m, from.north_m].map(|m| libm::round(10.0 * m) as i64),
        places,
    }
}

/// A procedure with its inputs as [`crate::wording::words`] has them.
fn in_one(procedure: &str, inputs: &[RegisterValue]) -> String {
    let inputs: Vec<String> = inputs
        .iter()
        .map(|value| match value {
            RegisterValue::Truth(truth) => truth.to_string(),
            RegisterValue::Number(number) => number.to_string(),
            RegisterValue::Symbol(name) => name.to_string(),
        })
        .collect();
    format!("{procedure}({})", inputs.join(" "))
}
