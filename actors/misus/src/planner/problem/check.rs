//! What is wrong with a problem, and what its names stand for.

use std::collections::BTreeMap;

use farside::suggest;
use thiserror::Error;

use super::{Activity, FORMAT, Goal, Problem, Rover};

/// The most goals, rovers, sols of a rover, and activities.
const MOST: usize = 1_000;
/// The longest time \[ms\], some 27 hours: no sol and no activity is longer.
const LONGEST_MS: i64 = 100_000_000;
/// The latest time \[ms\], some 30 years.
const LATEST_MS: i64 = 1_000_000_000_000;
/// The highest power \[mW\].
const HIGHEST_MW: i64 = 10_000_000;
/// The most energy of a sol \[uJ\]: of the highest power for the longest time.
const MOST_ENERGY_UJ: i64 = LONGEST_MS * HIGHEST_MW;
/// The most memory \[bit\].
const MOST_BITS: i64 = 1_000_000_000_000;

/// A problem that cannot be.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ProblemError {
    /// The text is no JSON, or not of the fields of a problem.
    #[error("line {line}, column {column}: {message}")]
    Json {
        /// The line, from 1.
        line: usize,
        /// The column, from 1.
        column: usize,
        /// What is wrong.
        message: String,
    },
    /// Another version of the format.
    #[error("format {found:?}: this program reads {FORMAT:?}")]
    Format {
        /// The version of the file.
        found: String,
    },
    /// Two of a kind with one name, or one without.
    #[error("{what} {name:?}: expected a name that no other {what} has")]
    Name {
        /// What has the name.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A name that nothing has.
    #[error("{what}: unknown {kind} {name:?}{}", .nearest.as_ref().map_or(String::new(), |near| format!("; did you mean {near:?}?")))]
    Unknown {
        /// Who uses the name.
        what: String,
        /// What it should name.
        kind: &'static str,
        /// The name.
        name: String,
        /// A name that is much like it.
        nearest: Option<String>,
    },
    /// A value that is out of its range, or no number.
    #[error("{what}: {key} is {found}, expected {expected}")]
    Value {
        /// What has the value.
        what: String,
        /// The value's key.
        key: &'static str,
        /// The value.
        found: String,
        /// What is expected.
        expected: String,
    },
    /// A place outside the terrain.
    #[error("{what}: at ({:.1} m, {:.1} m), expected within {half_m:.1} m of the middle", .position_m[0], .position_m[1])]
    Outside {
        /// What is there.
        what: String,
        /// Where, east and north \[m\].
        position_m: [f64; 2],
        /// Half of the side of the terrain \[m\].
        half_m: f64,
    },
    /// Goals each of which requires the next, the last the first.
    #[error("goals that require each other in a circle: {}", .goals.join(", "))]
    Circle {
        /// The goals of the circle.
        goals: Vec<String>,
    },
}

impl ProblemError {
    pub(super) fn json(error: &serde_json::Error) -> ProblemError {
        // The library's message ends with the place, which is told apart here.
        let message = error.to_string();
        let message = message.split(" at line ").next().unwrap_or_default();
        ProblemError::Json {
            line: error.line(),
            column: error.column(),
            message: message.to_owned(),
        }
    }
}

/// What the names of a problem stand for: numbers of goals and rovers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Resolved {
    /// By combination: its goals, in ascending order.
    pub combinations: Vec<Vec<usize>>,
    /// By goal: the goals that it requires, in ascending order.
    pub requires: Vec<Vec<usize>>,
    /// By activity: its rover.
    pub activity_rovers: Vec<usize>,
}

pub(super) fn resolve(problem: &Problem) -> Result<Resolved, ProblemError> {
    let what = || format!("problem {:?}", problem.name);
    number(what(), "side_m", problem.side_m)?;
    within(what(), "side_m", problem.side_m, 1.0, 1e6)?;
    for (key, value) in [
        ("drive_per_m", problem.objective.drive_per_m),
        ("energy_per_kj", problem.objective.energy_per_kj),
        ("busy_per_h", problem.objective.busy_per_h),
    ] {
        number(what(), key, value)?;
        within(what(), key, value, 0.0, 1e6)?;
    }
    for (key, count) in [
        ("rovers", problem.rovers.len()),
        ("goals", problem.goals.len()),
        ("activities", problem.activities.len()),
        ("combinations", problem.combinations.len() / 10),
    ] {
        within(what(), key, count, 0, MOST)?;
    }
    within(what(), "rovers", problem.rovers.len(), 1, MOST)?;
    let rovers = names("rover", problem.rovers.iter().map(|rover| &rover.name))?;
    let goals = names("goal", problem.goals.iter().map(|goal| &goal.name))?;
    names("activity", problem.activities.iter().map(|at| &at.name))?;
    for rover in &problem.rovers {
        check_rover(problem, rover)?;
    }
    let mut resolved = Resolved::default();
    for goal in &problem.goals {
        check_goal(problem, goal)?;
        let what = format!("goal {:?}", goal.name);
        let requires = find_all(&what, "goal", &goal.requires, &goals)?;
        resolved.requires.push(requires);
    }
    refuse_circles(problem, &resolved.requires)?;
    for (goal, requires) in problem.goals.iter().zip(&resolved.requires) {
        let optional = requires
            .iter()
            .find(|other| !problem.goals[**other].mandatory);
        if let Some(&other) = optional.filter(|_| goal.mandatory) {
            return Err(ProblemError::Value {
                what: format!("goal {:?}", problem.goals[other].name),
                key: "mandatory",
                found: "false".to_owned(),
                expected: format!("true: {:?}, which is mandatory, requires it", goal.name),
            });
        }
    }
    for combination in &problem.combinations {
        let what = format!("combination <{}>", combination.goals.join(", "));
        let members = find_all(&what, "goal", &combination.goals, &goals)?;
        number(what.clone(), "weight", combination.weight)?;
        within(what, "goals", members.len(), 2, MOST)?;
        resolved.combinations.push(members);
    }
    for activity in &problem.activities {
        let what = format!("activity {:?}", activity.name);
        let rover = find(&what, "rover", &activity.rover, &rovers)?;
        check_activity(what, activity, &problem.rovers[rover])?;
        resolved.activity_rovers.push(rover);
    }
    Ok(resolved)
}

fn check_rover(problem: &Problem, rover: &Rover) -> Result<(), ProblemError> {
    let what = || format!("rover {:?}", rover.name);
    inside(what(), rover.position_m, problem.side_m)?;
    within(what(), "speed_mm_s", rover.speed_mm_s, 1, 1_000_000)?;
    within(what(), "drive_mw", rover.drive_mw, 0, HIGHEST_MW)?;
    within(what(), "memory_bits", rover.memory_bits, 0, MOST_BITS)?;
    within(
        what(),
        "stored_bits",
        rover.stored_bits,
        0,
        rover.memory_bits,
    )?;
    within(what(), "sols", rover.sols.len(), 1, MOST)?;
    let mut before_ms = 0;
    for sol in &rover.sols {
        within(what(), "opens_ms", sol.opens_ms, before_ms, LATEST_MS)?;
        let latest_ms = sol.opens_ms + LONGEST_MS;
        within(what(), "closes_ms", sol.closes_ms, sol.opens_ms, latest_ms)?;
        within(what(), "energy_uj", sol.energy_uj, 0, MOST_ENERGY_UJ)?;
        before_ms = sol.closes_ms;
    }
    Ok(())
}

fn check_goal(problem: &Problem, goal: &Goal) -> Result<(), ProblemError> {
    let what = || format!("goal {:?}", goal.name);
    inside(what(), goal.position_m, problem.side_m)?;
    number(what(), "weight", goal.weight)?;
    within(what(), "duration_ms", goal.duration_ms, 0, LONGEST_MS)?;
    within(what(), "power_mw", goal.power_mw, 0, HIGHEST_MW)?;
    within(what(), "memory_bits", goal.memory_bits, 0, MOST_BITS)?;
    within(what(), "rovers", goal.rovers, 1, 2)?;
    if let Some(window) = goal.window_ms {
        check_window(what(), window, goal.duration_ms)?;
    }
    if goal.rovers > 1 && (goal.mandatory || !goal.requires.is_empty()) {
        return Err(ProblemError::Value {
            what: what(),
            key: "rovers",
            found: goal.rovers.to_string(),
            expected: "1 of a goal that is mandatory or requires others".to_owned(),
        });
    }
    Ok(())
}

fn check_activity(what: String, activity: &Activity, rover: &Rover) -> Result<(), ProblemError> {
    within(what.clone(), "sol", activity.sol, 0, rover.sols.len() - 1)?;
    let duration_ms = activity.duration_ms;
    within(what.clone(), "duration_ms", duration_ms, 0, LONGEST_MS)?;
    within(what.clone(), "power_mw", activity.power_mw, 0, HIGHEST_MW)?;
    within(
        what.clone(),
        "sends_bits",
        activity.sends_bits,
        0,
        MOST_BITS,
    )?;
    let sol = rover.sols[activity.sol];
    let window_ms = [
        activity.window_ms[0].max(sol.opens_ms),
        activity.window_ms[1].min(sol.closes_ms),
    ];
    check_window(what, window_ms, duration_ms)
}

/// Refuses a window that never opens, or not for long enough.
fn check_window(what: String, window_ms: [i64; 2], duration_ms: i64) -> Result<(), ProblemError> {
    let [opens_ms, closes_ms] = window_ms;
    if opens_ms >= 0 && closes_ms <= LATEST_MS && closes_ms - opens_ms >= duration_ms {
        return Ok(());
    }
    Err(ProblemError::Value {
        what,
        key: "window_ms",
        found: format!("{opens_ms} to {closes_ms} within its sol"),
        expected: format!("times from 0 to {LATEST_MS} that are at least {duration_ms} apart"),
    })
}

fn number(what: String, key: &'static str, value: f64) -> Result<(), ProblemError> {
    match value.is_finite() && value.abs() <= 1e9 {
        true => Ok(()),
        false => Err(ProblemError::Value {
            what,
            key,
            found: value.to_string(),
            expected: "a number from -1e9 to 1e9".to_owned(),
        }),
    }
}

fn within<T: PartialOrd + std::fmt::Display>(
    what: String,
    key: &'static str,
    value: T,
    least: T,
    most: T,
) -> Result<(), ProblemError> {
    match value >= least && value <= most {
        true => Ok(()),
        false => Err(ProblemError::Value {
            what,
            key,
            found: value.to_string(),
            expected: format!("{least} to {most}"),
        }),
    }
}

fn inside(what: String, position_m: [f64; 2], side_m: f64) -> Result<(), ProblemError> {
    let half_m = side_m / 2.0;
    // Not "any outside": what is no number is outside, too.
    match position_m.iter().all(|at| at.abs() <= half_m) {
        true => Ok(()),
        false => Err(ProblemError::Outside {
            what,
            position_m,
            half_m,
        }),
    }
}

fn names<'a>(
    what: &'static str,
    all: impl Iterator<Item = &'a String>,
) -> Result<BTreeMap<&'a str, usize>, ProblemError> {
    let mut names = BTreeMap::new();
    for (number, name) in all.enumerate() {
        if name.is_empty() || names.insert(name.as_str(), number).is_some() {
            let name = name.clone();
            return Err(ProblemError::Name { what, name });
        }
    }
    Ok(names)
}

fn find(
    what: &str,
    kind: &'static str,
    name: &str,
    names: &BTreeMap<&str, usize>,
) -> Result<usize, ProblemError> {
    names
        .get(name)
        .copied()
        .ok_or_else(|| ProblemError::Unknown {
            what: what.to_owned(),
            kind,
            name: name.to_owned(),
            nearest: suggest::nearest(name, names.keys().copied()),
        })
}

/// All of these names, each once, in ascending order.
fn find_all(
    what: &str,
    kind: &'static str,
    wanted: &[String],
    names: &BTreeMap<&str, usize>,
) -> Result<Vec<usize>, ProblemError> {
    let found = wanted.iter().map(|name| find(what, kind, name, names));
    let mut found: Vec<usize> = found.collect::<Result<_, _>>()?;
    found.sort_unstable();
    found.dedup();
    Ok(found)
}

fn refuse_circles(problem: &Problem, requires: &[Vec<usize>]) -> Result<(), ProblemError> {
    // A goal is done when all that it requires is; what never gets done is in a circle or needs one.
    let mut done = vec![false; requires.len()];
    loop {
        let mut changed = false;
        for goal in 0..requires.len() {
            if !done[goal] && requires[goal].iter().all(|&other| done[other]) {
                (done[goal], changed) = (true, true);
            }
        }
        if !changed {
            break;
        }
    }
    let Some(first) = done.iter().position(|done| !done) else {
        return Ok(());
    };
    // Each goal that is not done requires one that is not, so this walk comes back to itself.
    let mut walk = vec![first];
    loop {
        let last = walk[walk.len() - 1];
        let next = requires[last].iter().find(|&&other| !done[other]);
        let next = *next.expect("it would be done otherwise");
        if let Some(start) = walk.iter().position(|&goal| goal == next) {
            let names = walk[start..]
                .iter()
                .map(|&goal| problem.goals[goal].name.clone());
            return Err(ProblemError::Circle {
                goals: names.collect(),
            });
        }
        walk.push(next);
    }
}
