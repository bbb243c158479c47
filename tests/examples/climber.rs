//! A system with a curve, for the seams of studies: a planner climbs, one step a second, and from
//! its tenth step on the clever one climbs faster. It is its own `farside` command.

use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside_actors::settings;
use farside_actors::system::settings::{Table, in_unit};
use farside_actors::system::{
    Assembly, Better, Metric, Results, Section, Series, SeriesIndex, Settings, Setup, SetupError,
    System,
};
use farside_experiments::{cli, registry::Registry};
use serde::{Deserialize, Serialize};

settings! {
    /// The `[climb]` table.
    struct Climb {
        /// How much higher each step after the tenth leads.
        gain: f64, in_unit("m", 0.0..=10.0);
        /// How many steps there are.
        steps: u32 = 20, 1..=1000;
    }
}

#[derive(Clone, Serialize, Deserialize)]
struct Scenario {
    climb: Climb,
}

#[derive(Serialize, Deserialize)]
struct Step;

/// The settings, how high the hill is, and the heights so far, in metres.
struct Climber(Climb, f64, Arc<Mutex<Vec<f64>>>);

impl Actor for Climber {
    type Accepts = (Step,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(1), Step);
        Ok(())
    }
}

impl Handler<Step> for Climber {
    fn handle(&mut self, _: Step, ctx: &mut Context<'_, Self>) -> Outcome {
        let Climber(climb, hill_m, heights_m) = self;
        let mut heights_m = heights_m.lock().expect("nobody panics with it");
        let after_tenth = (heights_m.len() as f64 - 10.0).max(0.0);
        let stream = if climb.gain > 0.0 { "clever" } else { "simple" };
        let chance_m = ctx.random(stream).normal(0.0, 0.2);
        heights_m.push(*hill_m + climb.gain * after_tenth + chance_m);
        if heights_m.len() < climb.steps as usize {
            ctx.timer(SimDuration::from_secs(1), Step);
        }
        Ok(())
    }
}

struct ClimbSystem;

impl System for ClimbSystem {
    fn name(&self) -> &str {
        "climb"
    }

    fn about(&self) -> &str {
        "a planner climbs a hill"
    }

    fn sections(&self) -> Vec<Section> {
        Climb::sections("climb")
    }

    fn metrics(&self) -> &[Metric] {
        const STEP: SeriesIndex = SeriesIndex::new("step", "");
        const ALL: [Metric; 1] = [Metric::series(
            "height",
            "height reached",
            "m",
            STEP,
            Better::Higher,
        )];
        &ALL
    }

    fn parse(&self, keys: toml::Deserializer<'_>) -> Result<Box<dyn Settings>, toml::de::Error> {
        Ok(Box::new(Scenario::deserialize(keys)?))
    }
}

impl Settings for Scenario {
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error> {
        toml::Table::try_from(self)
    }

    fn check(&self) -> Result<(), SetupError> {
        self.climb.check("climb")
    }

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
        let hill = farside::random::RandomKey::new(setup.problem_seed).text("hill");
        let hill_m = hill.stream().normal(5.0, 2.0);
        let heights_m = Arc::new(Mutex::new(Vec::new()));
        let (climb, of_actor, host) = (
            self.climb.clone(),
            heights_m.clone(),
            setup.sim.host("hill"),
        );
        let build = move |_: &str| Climber(climb.clone(), hill_m, of_actor.clone());
        setup.sim.actor(host, "climber", build);
        Ok(Assembly::new(move |_| {
            let heights_m = heights_m.lock().expect("the run is over");
            let index = (0..heights_m.len()).map(|step| step as f64).collect();
            let values = heights_m.iter().copied().map(Some).collect();
            let mut results = Results::default();
            let curve = Series::new(index, values).expect("as many of both, and they rise");
            results.metrics.insert("height".to_owned(), curve.into());
            results
        }))
    }
}

fn main() -> std::process::ExitCode {
    cli::main(Registry::empty().with(ClimbSystem))
}
