//! What a scenario says of a survey, and whether it can be so.

mod mandatory;
mod own_goals;

use std::sync::Arc;

use farside::suggest;
use farside_actors::field::{FieldConfig, story};
use farside_actors::rover::RoverConfig;
use farside_actors::system::settings::Table;
use farside_actors::system::{Files, SetupError};
use serde::{Deserialize, Serialize};

use super::config::SurveyConfig;
use super::costs::Cost;
use super::execution::ExecutionConfig;
use super::wishes::{CombinationConfig, GoalConfig};
use crate::analysis::goals::Observation;
use crate::assemble::names;
use crate::config::{LearnConfig, TeamConfig};
use crate::planner::casper::{Choice, PlannerConfig};
use crate::planner::objective::ObjectiveConfig;
use crate::shac::{
    Calendar, CalendarError, Chooser, Definitions, Party, Protocol, Reassign, Settings,
    SettingsError,
};
use crate::sharing::Names;

/// The longest file of protocols \[byte\].
const FILE_BYTES: u64 = 1_000_000;

/// What the centre's host and its actor are called, if it is no rover's.
pub(super) const LANDER: &str = "lander";

/// The tables that a scenario has.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SurveyScenario {
    pub(super) world: FieldConfig,
    pub(super) team: TeamConfig,
    pub(super) rover: RoverConfig,
    pub(super) learn: LearnConfig,
    pub(super) planner: PlannerConfig,
    pub(super) objective: ObjectiveConfig,
    pub(super) execution: ExecutionConfig,
    pub(super) survey: SurveyConfig,
    #[serde(rename = "goal", skip_serializing_if = "Vec::is_empty")]
    pub(super) goals: Vec<GoalConfig>,
    #[serde(rename = "combination", skip_serializing_if = "Vec::is_empty")]
    pub(super) combinations: Vec<CombinationConfig>,
}

impl SurveyScenario {
    /// Checks all but what needs a file or the field.
    pub(super) fn check_all(&self) -> Result<(), SetupError> {
        self.world.check("world")?;
        story(&self.world)?;
        self.team.check("team")?;
        self.rover.check("rover")?;
        let rovers = names(&self.team);
        let rovers: Vec<&str> = rovers.iter().map(String::as_str).collect();
        self.rover.check_rovers("rover", &rovers)?;
        self.learn.check("learn")?;
        self.planner.check("planner")?;
        self.planner_choice()?;
        self.objective.check("objective")?;
        self.execution.check_together("execution")?;
        self.survey.check("survey")?;
        self.site()?;
        self.windows()?;
        if self.survey.protocol_file.is_none() {
            self.settings_with(&Definitions::builtin())?;
        }
        for (at, goal) in self.goals.iter().enumerate() {
            goal.check(&format!("goal.{at}"))?;
        }
        for (at, one) in self.combinations.iter().enumerate() {
            one.check(&format!("combination.{at}"))?;
        }
        own_goals::check(self)?;
        mandatory::check(self, None)
    }

    /// Checks what only a run with an end can be checked for.
    pub(super) fn check_until(&self, until: farside::SimDuration) -> Result<(), SetupError> {
        mandatory::check(self, Some(until))
    }

    /// The planner of the whole team needs to know what nobody in a survey does.
    fn planner_choice(&self) -> Result<(), SetupError> {
        if self.planner.choice != Choice::Lns {
            return Ok(());
        }
        let message = "\"lns\" plans for all rovers at once with all batteries and memories known, which the \
                       centre of a survey does not know: expected \"idgs\", \"simple-reward\" or \"random\"";
        Err(SetupError::value("planner.choice", message))
    }

    /// The number of the centre's site.
    fn site(&self) -> Result<u32, SetupError> {
        let rovers = names(&self.team);
        let central = self.survey.central.as_str();
        if central == LANDER {
            return Ok(self.team.rovers);
        }
        let at = rovers.iter().position(|rover| rover == central);
        at.map(|at| at as u32).ok_or_else(|| {
            let hosts = rovers.iter().map(String::as_str).chain([LANDER]);
            let hint = suggest::did_you_mean(suggest::nearest(central, hosts).as_deref());
            let message = format!("{central:?} is no host: expected {LANDER:?} or a rover{hint}");
            SetupError::value("survey.central", message)
        })
    }

    fn windows(&self) -> Result<Calendar, SetupError> {
        let SurveyConfig {
            contact,
            contact_every,
            ..
        } = self.survey;
        if contact >= 1.0 {
            return Ok(Calendar::always());
        }
        let length = contact_every.as_nanos() as f64 * contact;
        let length = farside::SimDuration::from_nanos(length as u64);
        let windows = Calendar::repeated(farside::SimTime::ZERO, length, contact_every);
        windows.map_err(|error| match error {
            CalendarError::NeverOpen { .. } => {
                let message = format!("{contact}: the windows never open, expected over 0");
                SetupError::value("survey.contact", message)
            }
            error => SetupError::value("survey.contact_every", error),
        })
    }

    /// The protocol's settings, with a file of protocols if there is one.
    pub(super) fn settings(&self, files: &mut Files) -> Result<Arc<Settings>, SetupError> {
        let mut definitions = Definitions::builtin();
        if let Some(file) = &self.survey.protocol_file {
            let wrong = |message: String| SetupError::value("survey.protocol_file", message);
            let bytes = files.read(file, FILE_BYTES).map_err(wrong)?;
            let text = String::from_utf8(bytes);
            let text = text.map_err(|error| wrong(format!("{file}: {error}")))?;
            let read = definitions.read(file, &text);
            read.map_err(|error| wrong(error.to_string()))?;
        }
        self.settings_with(&definitions).map(Arc::new)
    }

    fn settings_with(&self, definitions: &Definitions) -> Result<Settings, SetupError> {
        let site = self.site()?;
        let rovers = (0..self.team.rovers).filter(|rover| *rover != site);
        let mut candidates = vec![site];
        candidates.extend(rovers.filter(|_| self.survey.election.is_some()));
        let settings = Settings::new("assign-and-release", self.team.rovers, &candidates);
        let mut settings = settings.map_err(|error| SetupError::value("survey", error))?;
        let protocol = definitions.protocol(&self.survey.protocol);
        let protocol = protocol.map_err(|error| SetupError::value("survey.protocol", error))?;
        settings.protocol = self.protocol(protocol)?;
        settings.election = self.survey.election;
        settings.windows = self.windows()?;
        settings.check().map_err(|error| {
            let key = match &error {
                SettingsError::TooShort { key, .. } => format!("survey.{key}"),
                _ => "survey".to_owned(),
            };
            SetupError::value(&key, error)
        })?;
        self.check_lease(&settings)?;
        self.check_chooser(&settings)?;
        Ok(settings)
    }

    /// A protocol with what the scenario says otherwise.
    fn protocol(&self, named: &Protocol) -> Result<Protocol, SetupError> {
        let mut protocol = named.clone();
        if self.survey.lease.is_some() {
            protocol.lease = self.survey.lease;
            protocol.renewed = true;
        }
        protocol.reassign = self.survey.reassign.unwrap_or(protocol.reassign);
        if protocol.reassign == Reassign::Lease && protocol.lease.is_none() {
            let name = &self.survey.protocol;
            let message = format!(
                "\"lease\": protocol {name:?} has no lease, expected a key `lease` or another protocol"
            );
            return Err(SetupError::value("survey.reassign", message));
        }
        let offers = Some(self.planner.offers);
        protocol.give_up_after = protocol.give_up_after.or(offers);
        Ok(protocol)
    }

    /// Who meets whom and when is decided by the centre's planner alone.
    fn check_chooser(&self, settings: &Settings) -> Result<(), SetupError> {
        let joint = self.goals.iter().position(|goal| goal.rovers > 1);
        match joint {
            Some(at) if settings.protocol.chooser != Chooser::Planner => {
                let (name, protocol) = (&self.goals[at].name, &self.survey.protocol);
                let message = format!(
                    "goal {name:?} needs 2 rovers, whom the centre's planner appoints: expected a protocol other \
                     than {protocol:?}, with chooser = \"planner\""
                );
                Err(SetupError::value(&format!("goal.{at}.rovers"), message))
            }
            _ => Ok(()),
        }
    }

    /// Whether every observation fits into a lease, so that it can be begun.
    fn check_lease(&self, settings: &Settings) -> Result<(), SetupError> {
        let Some(lease) = settings.protocol.lease else {
            return Ok(());
        };
        let all = [
            Observation::PanoramicImage,
            Observation::PanoramicSpectrum,
            Observation::PointImage,
            Observation::PointSpectrum,
        ];
        let costs = all.iter().filter_map(|one| Cost::of(*one, &self.rover));
        let longest = costs.map(|cost| cost.duration).max().unwrap_or_default();
        let least = longest + settings.guard;
        if lease > least {
            return Ok(());
        }
        let message = format!("{lease}: expected over {least}, an observation takes {longest}");
        Err(SetupError::value("survey.lease", message))
    }

    /// The actors of the protocol's parties.
    pub(super) fn parties(&self, settings: &Settings) -> Names {
        let name = |party: Party| match party {
            Party::Owner(rover) => format!("planner_{:02}", rover + 1),
            Party::Centre(site) if site == settings.candidates[0] => "centre".to_owned(),
            Party::Centre(site) => format!("centre_{:02}", site + 1),
        };
        let parties = settings.parties().into_iter();
        Arc::new(parties.map(|party| (party, name(party))).collect())
    }
}
