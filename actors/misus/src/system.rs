//! MISUS as scenarios see it: `[world]`, `[team]`, `[rover]`, `[learn]`.

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

use crate::assemble::{Parts, assemble, names};
use crate::config::{LearnConfig, TeamConfig};
use crate::scenario::MisusScenario;
use crate::scene::MisusScene;
use crate::{builtin, metrics, picture};

/// The multi-rover integrated science understanding system.
pub struct MisusSystem;

impl System for MisusSystem {
    fn name(&self) -> &str {
        "misus"
    }

    fn about(&self) -> &str {
        "rovers read rocks, exchange what they read, and learn which classes of rock there are"
    }

    fn sections(&self) -> Vec<Section> {
        [
            FieldConfig::sections("world"),
            TeamConfig::sections("team"),
            RoverConfig::sections("rover"),
            LearnConfig::sections("learn"),
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
        Ok(Box::new(MisusScenario::deserialize(sections)?))
    }
}

/// What should not happen.
const INVARIANTS: [Invariant; 2] = [
    Invariant::new("brown_out", "brown_outs>0", "a rover's battery was empty").lasting(),
    Invariant::new("hardware", "faults>0", "a rover's hardware had a fault").lasting(),
];

impl Settings for MisusScenario {
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error> {
        toml::Table::try_from(self)
    }

    fn check(&self) -> Result<(), SetupError> {
        self.world.check("world")?;
        story(&self.world)?;
        self.team.check("team")?;
        self.rover.check("rover")?;
        let rovers = names(&self.team);
        let rovers: Vec<&str> = rovers.iter().map(String::as_str).collect();
        self.rover.check_rovers("rover", &rovers)?;
        self.learn.check("learn")
    }

    fn removable(&self) -> Vec<Removable> {
        vec![
            Removable::new("rovers", "team.rovers", Entries::Counted),
            Removable::new("faults of rovers", "rover.fault", Entries::Listed),
        ]
    }

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
        let Some(until) = setup.until else {
            let message = "missing: rovers go on sol after sol, so a run needs an end";
            return Err(SetupError::value("until", message));
        };
        let place = Place::of(&self.world, setup)?;
        let parts = Parts {
            place: &place,
            team: &self.team,
            rover: &self.rover,
            learn: &self.learn,
            seed: setup.run_seed,
            until,
        };
        let team = setup.wired(|sim, wire| assemble(sim, &parts, wire))?;
        let field = place.field.clone();
        let team_names = team.site.rovers.clone();
        let assembly = Assembly::new(move |report: &Report| {
            let metrics = metrics::of(&team.tally, &team.site.config, &field, report.end_time);
            metrics::results(metrics)
        });
        let scene = MisusScene::new(place.field.clone(), team_names);
        let assembly = assembly.with_scene(scene);
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
        _setup: &mut Setup<'_>,
    ) -> Result<Option<Account>, PictureError> {
        picture::account::account(&names(&self.team), actor, run, until_ns)
    }

    fn draw(
        &self,
        picture: &str,
        run: &dyn Recording,
        request: &PictureRequest,
        setup: &mut Setup<'_>,
    ) -> Result<Figure, PictureError> {
        let tables = (&self.world, &self.team, &self.rover);
        picture::draw(tables, picture, run, request, setup)
    }
}
