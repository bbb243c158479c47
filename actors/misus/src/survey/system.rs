//! The closed loop as scenarios see it.

use std::sync::PoisonError;

use farside::Report;
use farside_actors::field::{FieldConfig, Place};
use farside_actors::figure::Figure;
use farside_actors::rover::RoverConfig;
use farside_actors::system::settings::Table;
use farside_actors::system::{
    Account, Assembly, Builtin, Entries, Invariant, Metric, PictureError, PictureInfo,
    PictureRequest, Recording, Removable, Section, Settings, Setup, SetupError, System,
};
use serde::Deserialize;

use super::assemble::{Parts, assemble, settings};
use super::config::SurveyConfig;
use super::execution::ExecutionConfig;
use super::scenario::SurveyScenario;
use super::wishes::{CombinationConfig, GoalConfig};
use super::{builtin, metrics, picture};
use crate::config::{LearnConfig, TeamConfig};
use crate::planner::casper::PlannerConfig;
use crate::planner::objective::ObjectiveConfig;
use crate::scene::MisusScene;

/// MISUS as a whole: rovers that plan, execute, learn and plan again.
///
/// ```
/// use farside_actors::system::System;
/// use farside_misus::SurveySystem;
/// assert_eq!(SurveySystem.name(), "misus-survey");
/// let tables: Vec<String> = SurveySystem.sections().into_iter().map(|one| one.name).collect();
/// assert!(["survey", "execution", "goal"].iter().all(|name| tables.contains(&name.to_string())));
/// ```
pub struct SurveySystem;

impl System for SurveySystem {
    fn name(&self) -> &str {
        "misus-survey"
    }

    fn about(&self) -> &str {
        "rovers learn which rocks there are, and plan, share out and carry out what to look at next"
    }

    fn sections(&self) -> Vec<Section> {
        [
            FieldConfig::sections("world"),
            TeamConfig::sections("team"),
            RoverConfig::sections("rover"),
            LearnConfig::sections("learn"),
            PlannerConfig::sections("planner"),
            ObjectiveConfig::sections("objective"),
            ExecutionConfig::sections("execution"),
            SurveyConfig::sections("survey"),
            GoalConfig::sections("goal"),
            CombinationConfig::sections("combination"),
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

    fn parse(
        &self,
        sections: toml::Deserializer<'_>,
    ) -> Result<Box<dyn Settings>, toml::de::Error> {
        Ok(Box::new(SurveyScenario::deserialize(sections)?))
    }
}

/// What must never happen, or should not.
const INVARIANTS: [Invariant; 6] = [
    Invariant::new(
        "failed_activity",
        "activities_failed>0",
        "an activity failed",
    )
    .lasting(),
    Invariant::new(
        "lost_goal",
        "lost_goals>0",
        "the centre in office does not know a goal",
    ),
    Invariant::new(
        "missed_communication",
        "missed_comm>0",
        "a rover missed a daily communication",
    )
    .lasting(),
    Invariant::new(
        "plan",
        "plan_violations>0",
        "a plan could not be carried out so",
    )
    .lasting(),
    Invariant::new(
        "sharing",
        "sharing_violations>0",
        "a rule of sharing was broken",
    )
    .lasting(),
    Invariant::new("unfinished", "complete=false", "not all goals are achieved"),
];

impl Settings for SurveyScenario {
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error> {
        toml::Table::try_from(self)
    }

    fn check(&self) -> Result<(), SetupError> {
        self.check_all()
    }

    fn removable(&self) -> Vec<Removable> {
        let listed = |what, key: &str| Removable::new(what, key, Entries::Listed);
        vec![
            Removable::new("rovers", "team.rovers", Entries::Counted),
            listed("combinations of goals", "combination"),
            listed("goals", "goal"),
            listed("faults of rovers", "rover.fault"),
        ]
    }

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
        let Some(until) = setup.until else {
            let message = "missing: rovers go on sol after sol, so a run needs an end";
            return Err(SetupError::value("until", message));
        };
        self.check_until(until)?;
        let place = Place::of(&self.world, setup)?;
        let parts = Parts {
            scenario: self,
            place: &place,
            settings: settings(self, setup.files)?,
            seed: setup.run_seed,
            until,
        };
        let survey = setup.wired(|sim, wire| assemble(sim, &parts, wire))?;
        let course = survey.course.clone();
        let watch = move |invariant: &str| {
            let course = course.lock().unwrap_or_else(PoisonError::into_inner);
            match invariant {
                "plan" => course.tally.plan_violations > 0,
                "sharing" => course.tally.sharing_violations > 0,
                _ => false,
            }
        };
        let (field, rovers) = (place.field.clone(), survey.shared.site.rovers.clone());
        let assembly = Assembly::new(move |report: &Report| {
            metrics::results(&survey, &field, report.end_time)
        });
        let assembly = assembly.with_watch(watch);
        let assembly = assembly.with_scene(MisusScene::new(place.field.clone(), rovers));
        let faults = self.rover.faults.iter().enumerate();
        Ok(faults.fold(assembly, |assembly, (index, fault)| {
            assembly.with_planned(format!("rover.fault.{index}"), fault.at)
        }))
    }

    fn account(
        &self,
        actor: &str,
        run: &dyn Recording,
        until_ns: Option<u64>,
        setup: &mut Setup<'_>,
    ) -> Result<Option<Account>, PictureError> {
        picture::account::account(self, actor, run, until_ns, setup)
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
