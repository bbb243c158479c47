//! A system that does next to nothing, and fails where and when it is told to.

use std::path::PathBuf;

use farside::prelude::*;
use farside_actors::system::{
    Assembly, Builtin, Results, Section, Settings, Setup, SetupError, System,
};
use farside_actors::units;
use serde::{Deserialize, Serialize};

use crate::registry::Registry;
use crate::study::{Study, StudyError, StudyPlan};

/// A folder with the toy's scenario in it.
pub(super) struct Toy(tempfile::TempDir);

impl Toy {
    pub(super) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("toy.toml"), "system = 'toy'\n").unwrap();
        Toy(folder)
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}

/// A study of the toy; more keys follow.
pub(super) fn study(more: &str) -> String {
    format!("question = 'x?'\nscenario = 'toy.toml'\nmetrics = ['value', 'list']\n{more}")
}

pub(super) fn plan(toy: &Toy, text: &str) -> StudyPlan {
    plan_with(toy, text, None).unwrap_or_else(|error| panic!("{error}"))
}

pub(super) fn plan_with(
    toy: &Toy,
    text: &str,
    seeds: Option<u64>,
) -> Result<StudyPlan, StudyError> {
    let folder = toy.0.path().to_owned();
    Study::parse("x.toml", text.to_owned(), folder)?.plan(&[], seeds, &registry())
}

pub(super) fn registry() -> Registry {
    Registry::empty().with(ToySystem)
}

struct ToySystem;

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct ToySettings {
    level: f64,
    #[serde(with = "units::duration")]
    delay: SimDuration,
    /// Where a run with one of the seeds fails.
    fails: String,
    fail_seeds: Vec<u64>,
    /// The only level that fails, unless it is 0.
    fail_level: f64,
}

impl Default for ToySettings {
    fn default() -> Self {
        ToySettings {
            level: 1.0,
            delay: SimDuration::from_secs(1),
            fails: "nowhere".to_owned(),
            fail_seeds: Vec::new(),
            fail_level: 0.0,
        }
    }
}

#[derive(Serialize, Deserialize)]
struct ToyScenario {
    #[serde(default)]
    toy: ToySettings,
}

impl System for ToySystem {
    fn name(&self) -> &str {
        "toy"
    }

    fn about(&self) -> &str {
        "an alarm that rings once"
    }

    fn sections(&self) -> Vec<Section> {
        vec![Section::named("toy")]
    }

    fn scenarios(&self) -> &[Builtin] {
        &[Builtin {
            name: "toy/plain",
            text: "system = 'toy'",
        }]
    }

    fn parse(
        &self,
        sections: toml::Deserializer<'_>,
    ) -> Result<Box<dyn Settings>, toml::de::Error> {
        Ok(Box::new(ToyScenario::deserialize(sections)?))
    }
}

#[derive(Serialize, Deserialize)]
struct Ring;

struct Alarm {
    delay: SimDuration,
    panics: Option<String>,
}

impl Actor for Alarm {
    type Accepts = (Ring,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(self.delay, Ring);
        Ok(())
    }
}

impl Handler<Ring> for Alarm {
    fn handle(&mut self, _: Ring, _: &mut Context<'_, Self>) -> Outcome {
        match &self.panics {
            Some(text) => panic!("{text}"),
            None => Ok(()),
        }
    }
}

impl Settings for ToyScenario {
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error> {
        toml::Table::try_from(self)
    }

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
        let ToySettings {
            level,
            delay,
            ref fails,
            ref fail_seeds,
            fail_level,
        } = self.toy;
        if level < 0.0 {
            return Err(SetupError::value("toy.level", "expected no less than 0"));
        }
        let seed = setup.run_seed;
        let hit = fail_seeds.contains(&seed) && (fail_level == 0.0 || fail_level == level);
        let text = format!("no luck with seed {seed}");
        let fails = |place: &str| (hit && fails == place).then(|| text.clone());
        if let Some(text) = fails("settings") {
            return Err(SetupError::value("toy.fails", text));
        }
        if let Some(text) = fails("assemble") {
            panic!("{text}");
        }
        let panics = fails("handler");
        let host = setup.sim.host("alarm");
        setup.sim.actor(host, "alarm", move |_| Alarm {
            delay,
            panics: panics.clone(),
        });
        let at_last = fails("conclude");
        Ok(Assembly::new(move |_: &Report| {
            if let Some(text) = at_last {
                panic!("{text}");
            }
            let mut results = Results::default();
            let value = level * (seed * 37 % 11) as f64;
            results.metrics.insert("value".to_owned(), value.into());
            let list = vec![Some(0.1 + value), None];
            results.metrics.insert("list".to_owned(), list.into());
            let table = serde_json::json!({ "x": 1 });
            results.metrics.insert("table".to_owned(), table);
            results
        }))
    }
}
