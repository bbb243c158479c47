//! What a scenario says: `[problem]`, `[planner]`, `[objective]`, `[lns]`, `[rounds]`.

use farside::SimDuration;
use farside_actors::processor::Speed;
use farside_actors::system::SetupError;
use farside_actors::system::settings::{Table, over};
use farside_actors::{settings, units};
use serde::{Deserialize, Serialize};

use crate::planner::casper::PlannerConfig;
use crate::planner::lns::LnsConfig;
use crate::planner::objective::ObjectiveConfig;
use crate::planner::problem::ProblemConfig;

settings! {
    /// The `[rounds]` table: when planners make their steps, and how they wait for each other.
    pub struct RoundsConfig {
        /// The time from the beginning of an optimisation step to that of the next.
        pub every: SimDuration [with = "units::duration"] = SimDuration::from_secs(60),
            over(SimDuration::ZERO);
        /// Whether all wait for all after each step, and ask again for what was lost: the paper's
        /// evaluation. Planners that do not wait go on with what they last heard.
        pub synchronised: bool = true;
        /// How fast the processor of each host is: what planners look at, in operations.
        pub processor: Speed = Speed::PerS(20_000);
    }
}

/// The tables that a scenario has.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct PlanningScenario {
    pub(super) problem: ProblemConfig,
    pub(super) planner: PlannerConfig,
    pub(super) objective: ObjectiveConfig,
    pub(super) lns: LnsConfig,
    pub(super) rounds: RoundsConfig,
}

impl PlanningScenario {
    pub(super) fn check_all(&self) -> Result<(), SetupError> {
        self.problem.check("problem")?;
        self.planner.check("planner")?;
        self.objective.check("objective")?;
        self.lns.check("lns")?;
        self.rounds.check("rounds")
    }
}
