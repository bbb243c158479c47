//! What all planners carry: the problem, how they plan, and who there is.

use farside::random::RandomKey;
use farside_actors::system::SetupError;

use super::config::{PlanningScenario, RoundsConfig};
use crate::planner::casper::{Casper, PlannerConfig, Unmet};
use crate::planner::instance::Instance;
use crate::planner::lns::LnsConfig;
use crate::planner::problem::{Problem, generate};

/// The name of the centre's host and of its planner.
pub(super) const CENTRE: &str = "centre";

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
}

/// What planners carry in a run with these seeds.
pub(super) fn shared(
    scenario: &PlanningScenario,
    problem_seed: u64,
    run_seed: u64,
) -> Result<Shared, SetupError> {
    let wrong = |error| SetupError::value("problem", error);
    let problem = generate(&scenario.problem, problem_seed).map_err(wrong)?;
    let instance = Instance::new(&problem).map_err(wrong)?;
    let key = RandomKey::new(run_seed);
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
    })
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
