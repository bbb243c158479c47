//! Planners over links as scenarios see them: `[problem]`, `[planner]`, `[objective]`, `[lns]`, `[rounds]`.

use farside::Report;
use farside_actors::figure::Figure;
use farside_actors::system::settings::Table;
use farside_actors::system::{
    Account, Assembly, Builtin, Entries, Invariant, Metric, PictureError, PictureInfo,
    PictureRequest, Recording, Removable, Section, Seeds, Settings, Setup, SetupError, System,
};
use serde::Deserialize;

use super::assemble::assemble;
use super::config::{PlanningScenario, RoundsConfig};
use super::shared::{problem, shared};
use super::{builtin, metrics, picture};
use crate::planner::casper::PlannerConfig;
use crate::planner::lns::LnsConfig;
use crate::planner::objective::ObjectiveConfig;
use crate::planner::problem::ProblemConfig;

/// The planners of MISUS over links: the paper's evaluation, and what becomes of it on bad links.
///
/// ```
/// use farside_actors::system::System;
/// use farside_misus::PlanningSystem;
/// assert_eq!(PlanningSystem.name(), "misus-planning");
/// let tables: Vec<String> = PlanningSystem.sections().into_iter().map(|one| one.name).collect();
/// assert_eq!(tables, ["problem", "planner", "objective", "lns", "rounds"]);
/// ```
pub struct PlanningSystem;

impl System for PlanningSystem {
    fn name(&self) -> &str {
        "misus-planning"
    }

    fn about(&self) -> &str {
        "planners of a team of rovers share out observations, and exchange their plans over links"
    }

    fn sections(&self) -> Vec<Section> {
        [
            ProblemConfig::sections("problem"),
            PlannerConfig::sections("planner"),
            ObjectiveConfig::sections("objective"),
            LnsConfig::sections("lns"),
            RoundsConfig::sections("rounds"),
        ]
        .concat()
    }

    fn metrics(&self) -> &[Metric] {
        metrics::all()
    }

    fn invariants(&self) -> &[Invariant] {
        &INVARIANTS
    }

    fn scenarios(&self) -> &[Builtin] {
        &builtin::SCENARIOS
    }

    fn studies(&self) -> &[Builtin] {
        &builtin::STUDIES
    }

    fn pictures(&self) -> &[PictureInfo] {
        &picture::ALL
    }

    fn problem(&self) -> Option<&str> {
        Some("rovers, observations, what these are worth alone and together, as JSON")
    }

    fn parse(
        &self,
        sections: toml::Deserializer<'_>,
    ) -> Result<Box<dyn Settings>, toml::de::Error> {
        Ok(Box::new(PlanningScenario::deserialize(sections)?))
    }
}

/// What must never happen, or should not.
const INVARIANTS: [Invariant; 2] = [
    Invariant::new(
        "plan",
        "plan_violations>0",
        "the team's plan cannot be carried out so",
    ),
    Invariant::new(
        "unfinished",
        "complete=false",
        "the plan does not achieve all goals",
    ),
];

impl Settings for PlanningScenario {
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error> {
        toml::Table::try_from(self)
    }

    fn check(&self) -> Result<(), SetupError> {
        self.check_all()
    }

    fn problem(&self, setup: &mut Setup<'_>) -> Result<Option<String>, SetupError> {
        Ok(Some(problem(self, setup.problem_seed)?.to_json()))
    }

    fn removable(&self) -> Vec<Removable> {
        vec![
            Removable::new("rovers", "problem.rovers", Entries::Counted),
            Removable::new("rocks", "problem.rocks_most", Entries::Counted),
        ]
    }

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
        if setup.until.is_none() {
            let message = "missing: planners that wait for each other need an end";
            return Err(SetupError::value("until", message));
        }
        let seeds = Seeds {
            run: setup.run_seed,
            problem: setup.problem_seed,
        };
        let shared = shared(self, seeds, setup.files)?;
        let team = setup.wired(|sim, wire| assemble(sim, shared, wire))?;
        let name = team.shared.problem.name.clone();
        let goals = team.shared.instance.goals();
        let assembly = Assembly::new(move |_: &Report| metrics::results(&team));
        Ok(assembly.with_notes(vec![format!("problem: {name}, {goals} goals")]))
    }

    fn account(
        &self,
        actor: &str,
        run: &dyn Recording,
        until_ns: Option<u64>,
        setup: &mut Setup<'_>,
    ) -> Result<Option<Account>, PictureError> {
        let seeds = Seeds {
            run: setup.run_seed,
            problem: setup.problem_seed,
        };
        let shared = shared(self, seeds, setup.files)?;
        picture::account::account(&shared.rovers, actor, run, until_ns)
    }

    fn draw(
        &self,
        picture: &str,
        run: &dyn Recording,
        request: &PictureRequest,
        setup: &mut Setup<'_>,
    ) -> Result<Figure, PictureError> {
        picture::draw(self, picture, run, request, setup)
    }
}
