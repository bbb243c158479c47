//! IDEA as scenarios see it: `[world]`, `[rover]`, `[agents]`, `[mission_agent]`, `[system_agent]`, `[deliberation]`,
//! `[relay]`, `[goals]` and `[[goal]]`.

use std::sync::PoisonError;

use farside::Report;
use farside_actors::field::{FieldConfig, Place, story};
use farside_actors::figure::Figure;
use farside_actors::rover::RoverConfig;
use farside_actors::system::settings::Table;
use farside_actors::system::{
    Account, Assembly, Builtin, Entries, Invariant, Metric, PictureError, PictureInfo,
    PictureRequest, Recording, Removable, Section, Settings, Setup, SetupError, System,
};
use serde::Deserialize;

use crate::assemble::{Minds, Parts, assemble, goals, names, text_file};
use crate::config::{
    AgentConfig, AgentsConfig, DeliberationConfig, GoalConfig, GoalsConfig, IdeaScenario,
    RelayConfig,
};
use crate::scene::IdeaScene;
use crate::{builtin, metrics, picture};

/// Plan-based executives that control K9 rovers.
pub struct IdeaSystem;

impl System for IdeaSystem {
    fn name(&self) -> &str {
        "idea"
    }

    fn about(&self) -> &str {
        "agents that plan within a fixed latency control a K9 rover, which takes images and recovers \
         from dangerous states"
    }

    fn sections(&self) -> Vec<Section> {
        [
            FieldConfig::sections("world"),
            RoverConfig::sections("rover"),
            AgentsConfig::sections("agents"),
            AgentConfig::sections("mission_agent"),
            AgentConfig::sections("system_agent"),
            DeliberationConfig::sections("deliberation"),
            RelayConfig::sections("relay"),
            GoalsConfig::sections("goals"),
            GoalConfig::sections("goal"),
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
        Ok(Box::new(IdeaScenario::deserialize(sections)?))
    }
}

/// What must never happen, or should not.
const INVARIANTS: [Invariant; 7] = [
    Invariant::new(
        "abort",
        "aborted_cycles>0",
        "a cycle took too many operations",
    )
    .lasting(),
    Invariant::new("faulty", "faulty_agents>0", "an agent was found faulty").lasting(),
    Invariant::new("given_up", "goals_given_up>0", "a goal was given up").lasting(),
    Invariant::new(
        "late_response",
        "max_response_lambda>=2",
        "news waited for two latencies or longer until its answer left",
    )
    .lasting(),
    Invariant::new(
        "lease",
        "driving_without_lease_s>0",
        "a rover drove after its lease had ended",
    )
    .lasting(),
    Invariant::new("repeated_goal", "goals_repeated>0", "a goal was done twice").lasting(),
    Invariant::new(
        "unfinished",
        "complete=false",
        "not all goals were achieved",
    ),
];

impl Settings for IdeaScenario {
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error> {
        toml::Table::try_from(self)
    }

    fn check(&self) -> Result<(), SetupError> {
        self.world.check("world")?;
        story(&self.world)?;
        self.rover.check("rover")?;
        let names = names(self);
        let rovers: Vec<&str> = names.iter().map(|names| names.rover.as_str()).collect();
        self.rover.check_rovers("rover", &rovers)?;
        self.agents.check("agents")?;
        self.mission_agent.check("mission_agent")?;
        self.system_agent.check("system_agent")?;
        self.deliberation.check("deliberation")?;
        self.relay.check("relay")?;
        self.goals.check("goals")?;
        for (index, goal) in self.goal.iter().enumerate() {
            goal.check(&format!("goal.{index}"))?;
        }
        goals(self, &names, 0).map(drop)
    }

    fn removable(&self) -> Vec<Removable> {
        let counted = |what, key: &str| Removable::new(what, key, Entries::Counted);
        vec![
            counted("rovers", "agents.rovers"),
            Removable::new("goals", "goal", Entries::Listed),
            counted("goals by chance", "goals.count"),
            Removable::new("faults of rovers", "rover.fault", Entries::Listed),
        ]
    }

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
        let Some(until) = setup.until else {
            let message = "missing: agents go on planning, so a run needs an end";
            return Err(SetupError::value("until", message));
        };
        let place = Place::of(&self.world, setup)?;
        let minds = Minds::read(self, setup)?;
        let goals = goals(self, &names(self), setup.problem_seed)?;
        let scene = IdeaScene::new(place.field.clone(), names(self), &goals);
        let table = match &self.relay.table {
            None => None,
            Some(name) => Some(text_file(setup, name, "relay.table")?),
        };
        let parts = Parts {
            scenario: self,
            place: &place,
            minds,
            table,
            goals,
            seed: setup.run_seed,
            until,
        };
        let team = setup.wired(|sim, wire| assemble(sim, &parts, wire))?;
        let watched = team.tally.clone();
        let watch = move |invariant: &str| {
            let tally = watched.lock().unwrap_or_else(PoisonError::into_inner);
            match invariant {
                "given_up" => tally.given_up > 0,
                "repeated_goal" => tally.done.values().any(|times| *times > 1),
                "abort" => tally.agents.iter().any(|agent| agent.aborted > 0),
                "faulty" => tally.agents.iter().any(|agent| agent.faulty > 0),
                _ => false,
            }
        };
        let assembly = Assembly::new(move |report: &Report| {
            let mut tally = team.tally.lock().unwrap_or_else(PoisonError::into_inner);
            metrics::results(&team.watched, &mut tally, report.end_time)
        });
        let assembly = assembly.with_scene(scene).with_watch(watch);
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
