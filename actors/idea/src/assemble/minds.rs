//! What agents plan with: models, by their names or from files, and the technology over each.

use std::sync::{Arc, Mutex};

use farside::SimDuration;
use farside_actors::system::{Setup, SetupError};
use farside_planning::language::{Options, read_model};
use farside_planning::model::Model;

use super::goals::Goals;
use crate::agent::Mind;
use crate::config::{AgentConfig, DeliberationConfig, IdeaScenario, Technology};
use crate::deliberate::Settings;
use crate::deliberator::SharedDeliberator;
use crate::mission::MissionPlanner;
use crate::models::{self, Mission};
use crate::service::PlanService;
use crate::service::compiled::Compiled;
use crate::service::propositional::Propositional;
use crate::service::temporal::{MergeScan, Propagation, Temporal, TemporalOptions};

/// The longest file of a model or a table \[byte\].
const MAX_TEXT_BYTES: u64 = 1 << 20;

/// Which agent of a row it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// The one that orders goals.
    Mission,
    /// One that hands goals on.
    Between,
    /// The one that commands the rover.
    System,
}

impl Role {
    /// What an agent is by its place in a row of so many.
    pub(crate) fn of(layer: usize, layers: usize) -> Role {
        match layer {
            last if last + 1 == layers => Role::System,
            0 => Role::Mission,
            _ => Role::Between,
        }
    }

    /// The scenario's table.
    pub(crate) fn table(self) -> &'static str {
        match self {
            Role::Mission | Role::Between => "mission_agent",
            Role::System => "system_agent",
        }
    }

    /// The timeline on which it is given goals.
    pub(crate) fn incoming(self) -> &'static str {
        match self {
            Role::Mission => "Ground_SV",
            Role::Between | Role::System => "Goal_SV",
        }
    }
}

/// The models of a scenario.
pub(crate) struct Minds {
    mission: (Arc<Model>, AgentConfig),
    between: (Arc<Model>, AgentConfig),
    system: (Arc<Model>, AgentConfig),
    deliberation: DeliberationConfig,
}

impl Minds {
    /// Reads the models that a scenario names.
    pub(crate) fn read(
        scenario: &IdeaScenario,
        setup: &mut Setup<'_>,
    ) -> Result<Minds, SetupError> {
        let mission = model(
            &scenario.mission_agent,
            "mission_agent",
            "k9-mission",
            setup,
        )?;
        let system = model(&scenario.system_agent, "system_agent", "k9-system", setup)?;
        service(&mission, &scenario.mission_agent, "mission_agent")?;
        service(&system, &scenario.system_agent, "system_agent")?;
        Ok(Minds {
            mission: (mission, scenario.mission_agent.clone()),
            between: (models::forward().clone(), scenario.mission_agent.clone()),
            system: (system, scenario.system_agent.clone()),
            deliberation: scenario.deliberation.clone(),
        })
    }

    fn mind(&self, role: Role) -> &(Arc<Model>, AgentConfig) {
        match role {
            Role::Mission => &self.mission,
            Role::Between => &self.between,
            Role::System => &self.system,
        }
    }

    /// The model of an agent.
    pub(crate) fn model(&self, role: Role) -> &Arc<Model> {
        &self.mind(role).0
    }

    /// What makes an agent's mind, for each of its lives.
    pub(crate) fn of(&self, role: Role, goals: &Goals) -> Arc<dyn Fn() -> Mind + Send + Sync> {
        let (model, config) = self.mind(role).clone();
        let deliberation = self.deliberation.clone();
        let (latency, start_dm, table) = (config.latency, goals.start_dm, role.table());
        let mission = (role == Role::Mission).then(|| Mission::of(model.clone()));
        Arc::new(move || {
            let planner = mission.clone().map(|mission| -> SharedDeliberator {
                let settings = settings(&deliberation, latency);
                let attempts = deliberation.attempts;
                Arc::new(Mutex::new(MissionPlanner::new(
                    mission, settings, attempts, start_dm,
                )))
            });
            Mind {
                service: service(&model, &config, table).expect("it was checked"),
                deliberator: planner,
            }
        })
    }
}

/// How goals are ordered.
fn settings(config: &DeliberationConfig, latency: SimDuration) -> Settings {
    let usual = Settings::default();
    let ticks_per_m = 1.0 / (config.speed_m_per_s * latency.as_secs_f64());
    let ticks_per_m = libm::ceil(ticks_per_m).max(1.0);
    Settings {
        ticks_per_m: ticks_per_m as i64,
        drive_energy: libm::round(100_000.0 * config.drive_per_m / ticks_per_m) as i64,
        reserve: libm::round(100_000.0 * config.reserve) as i64,
        few: config.few as usize,
        operations: config.budget,
        ..usual
    }
}

/// A model that is built in, or a file.
fn model(
    config: &AgentConfig,
    table: &str,
    usual: &str,
    setup: &mut Setup<'_>,
) -> Result<Arc<Model>, SetupError> {
    let name = config.model.as_deref().unwrap_or(usual);
    if let Some(model) = models::named(name) {
        return Ok(model);
    }
    let wrong = |message: String| SetupError::value(&format!("{table}.model"), message);
    if !name.ends_with(".ddl") {
        let hint = farside::suggest::nearest(name, models::NAMES.into_iter());
        let hint = farside::suggest::did_you_mean(hint.as_deref());
        let known = models::NAMES.join(", ");
        let message = format!("{name:?}: expected {known}, or a file called *.ddl{hint}");
        return Err(wrong(message));
    }
    let text = text_file(setup, name, &format!("{table}.model"))?;
    let read = read_model(name, &text, &Options::default()).ok();
    let model = read.map_err(|findings| wrong(findings.to_string()))?;
    Ok(Arc::new(model))
}

/// A text that a key of the scenario names.
pub(crate) fn text_file(
    setup: &mut Setup<'_>,
    name: &str,
    key: &str,
) -> Result<String, SetupError> {
    let wrong = |message: String| SetupError::value(key, message);
    let bytes = setup.files.read(name, MAX_TEXT_BYTES).map_err(wrong)?;
    let text = String::from_utf8(bytes);
    text.map_err(|error| wrong(format!("{name}: {error}")))
}

/// The technology that a scenario names, over a model.
///
/// # Errors
/// When the technology cannot hold the model, or a key is not for it.
fn service(
    model: &Arc<Model>,
    config: &AgentConfig,
    table: &str,
) -> Result<Box<dyn PlanService>, SetupError> {
    let wrong = |key: &str, message: String| SetupError::value(&format!("{table}.{key}"), message);
    let technology = |error: String| wrong("technology", error);
    if config.technology != Technology::Temporal {
        let keys = [
            ("horizon", config.horizon > 1),
            ("guess", config.guess),
            ("propagates_all", config.propagates_all),
            ("searches_all", config.searches_all),
        ];
        if let Some((key, _)) = keys.into_iter().find(|(_, is_set)| *is_set) {
            let message = "only the technology \"temporal\" does that".to_owned();
            return Err(wrong(key, message));
        }
    }
    Ok(match config.technology {
        Technology::Temporal => {
            let options = TemporalOptions {
                deletes: config.deletes,
                guess: config.guess,
                merge_scan: match config.searches_all {
                    false => MergeScan::Near,
                    true => MergeScan::All,
                },
                propagation: match config.propagates_all {
                    false => Propagation::Incremental,
                    true => Propagation::Full,
                },
            };
            let service = Temporal::new(model.clone(), options);
            Box::new(service.map_err(|error| technology(error.to_string()))?)
        }
        Technology::Propositional => {
            let service = Propositional::new(model.clone());
            Box::new(service.map_err(|error| technology(error.to_string()))?)
        }
        Technology::Compiled => {
            let service = Compiled::new(model.clone());
            Box::new(service.map_err(|error| technology(error.to_string()))?)
        }
    })
}
