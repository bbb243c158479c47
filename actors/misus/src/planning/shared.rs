//! What all planners carry: the problem, how they plan, and who there is.

use farside::random::RandomKey;
use farside_actors::system::{Files, Seeds, SetupError};

use super::config::{PlanningScenario, RoundsConfig};
use crate::planner::bounds::Bounds;
use crate::planner::casper::{Casper, PlannerConfig, Unmet};
use crate::planner::instance::Instance;
use crate::planner::lns::LnsConfig;
use crate::planner::problem::{Problem, generate};

/// The name of the centre's host and of its planner.
pub(super) const CENTRE: &str = "centre";

/// The most bytes of a table of bounds that are read.
const BOUNDS_BYTES: u64 = 64 << 20;

/// What all planners carry.
pub(super) struct Shared {
    pub(super) problem: Problem,
    pub(super) instance: Instance,
    pub(super) planner: PlannerConfig,
    pub(super) lns: LnsConfig,
    pub(super) rounds: RoundsConfig,
    /// The names of the rovers' hosts and planners.
    pub(super) rovers: Vec<String>,
    pub(super) key: RandomKey,
    /// What a plan is worth at the most, if that is known.
    pub(super) bound: Option<f64>,
}

/// What planners have to solve in runs with this seed of problems.
pub(super) fn problem(
    scenario: &PlanningScenario,
    problem_seed: u64,
) -> Result<Problem, SetupError> {
    let problem = generate(&scenario.problem, problem_seed);
    let mut problem = problem.map_err(|error| SetupError::value("problem", error))?;
    problem.objective = scenario.objective.clone();
    Ok(problem)
}

/// What planners carry in a run with these seeds.
pub(super) fn shared(
    scenario: &PlanningScenario,
    seeds: Seeds,
    files: &mut Files,
) -> Result<Shared, SetupError> {
    let problem = problem(scenario, seeds.problem)?;
    let bound = bound(&scenario.problem.bounds, &problem, files)
        .map_err(|error| SetupError::value("problem.bounds", error))?;
    let instance = Instance::new(&problem).map_err(|error| SetupError::value("problem", error))?;
    let key = RandomKey::new(seeds.run);
    for rover in 0..problem.rovers.len() {
        Casper::new(&instance, rover, &scenario.planner, key)
            .map_err(|unmet| blame(&problem, &unmet))?;
    }
    Ok(Shared {
        rovers: problem.rovers.iter().map(|one| one.name.clone()).collect(),
        planner: scenario.planner.clone(),
        lns: scenario.lns.clone(),
        rounds: scenario.rounds.clone(),
        problem,
        instance,
        key,
        bound,
    })
}

/// What a plan of a problem is worth at the most, as a table says: that of a file, or the one that is built in.
fn bound(file: &str, problem: &Problem, files: &mut Files) -> Result<Option<f64>, String> {
    let digest = problem.digest();
    if file.is_empty() {
        return Ok(Bounds::builtin().of(&digest));
    }
    let bytes = files.read(file, BOUNDS_BYTES)?;
    let text = String::from_utf8(bytes).map_err(|error| format!("{file}: {error}"))?;
    let bounds = Bounds::parse(&text).map_err(|error| format!("{file}: {error}"))?;
    Ok(bounds.of(&digest))
}

/// Which key of the scenario keeps a rover from what it has to do in any case.
fn blame(problem: &Problem, unmet: &Unmet) -> SetupError {
    let lacking = unmet.lacking;
    let (key, lacks) = if lacking.energy_uj > 0 {
        let missing_j = lacking.energy_uj as f64 / 1e6;
        ("communication_power", format!("{missing_j} J of energy"))
    } else if lacking.bits > 0 {
        ("communication_size", format!("{} bit", lacking.bits))
    } else {
        let missing_s = lacking.late_ms as f64 / 1e3;
        ("communication", format!("{missing_s} s of time"))
    };
    let rover = &problem.rovers[unmet.rover].name;
    let message = format!(
        "{rover} cannot make its daily communication: it lacks {lacks}, so there is no plan"
    );
    SetupError::value(&format!("problem.{key}"), message)
}
