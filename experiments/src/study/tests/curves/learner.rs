//! A system whose metric is a curve: what a planner's reward is after each of its steps.

use std::sync::{Arc, Mutex};

use farside::prelude::*;
use serde::{Deserialize, Serialize};

use farside_actors::system::{
    Assembly, Better, Metric, Results, Section, Series, SeriesIndex, Settings, Setup, SetupError,
    System,
};

use crate::registry::Registry;

#[derive(Serialize, Deserialize)]
struct Step;

struct Planner {
    /// How much each step after the tenth brings.
    gain: f64,
    /// What the problem brings, whoever plans.
    problem: f64,
    steps: u32,
    rewards: Arc<Mutex<Vec<Option<f64>>>>,
}

impl Actor for Planner {
    type Accepts = (Step,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(1), Step);
        Ok(())
    }
}

impl Handler<Step> for Planner {
    fn handle(&mut self, _step: Step, ctx: &mut Context<'_, Self>) -> Outcome {
        // Planners draw from streams of their own: they share the problem, and no luck.
        let planner = if self.gain > 0.0 { "search" } else { "greedy" };
        let chance = ctx.random(planner).normal(0.0, 0.3);
        let mut rewards = self.rewards.lock().expect("nobody panics with it");
        let step = rewards.len() as f64;
        rewards.push(Some(
            self.problem + self.gain * (step - 10.0).max(0.0) + chance,
        ));
        if rewards.len() < self.steps as usize {
            ctx.timer(SimDuration::from_secs(1), Step);
        }
        Ok(())
    }
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Learner {
    gain: f64,
    steps: u32,
    /// Runs with an even seed make a step less.
    uneven: bool,
}

impl Default for Learner {
    fn default() -> Self {
        let (gain, steps, uneven) = (0.0, 30, false);
        Learner {
            gain,
            steps,
            uneven,
        }
    }
}

#[derive(Serialize, Deserialize)]
struct Scenario {
    #[serde(default)]
    learner: Learner,
}

struct LearnerSystem;

impl System for LearnerSystem {
    fn name(&self) -> &str {
        "learner"
    }

    fn about(&self) -> &str {
        "a planner whose reward grows with its steps"
    }

    fn sections(&self) -> Vec<Section> {
        vec![Section::named("learner")]
    }

    fn metrics(&self) -> &[Metric] {
        const STEP: SeriesIndex = SeriesIndex::new("planning step", "");
        const REWARD: Metric = Metric::series("reward", "reward", "", STEP, Better::Higher);
        &[REWARD]
    }

    fn parse(
        &self,
        sections: toml::Deserializer<'_>,
    ) -> Result<Box<dyn Settings>, toml::de::Error> {
        Ok(Box::new(Scenario::deserialize(sections)?))
    }
}

impl Settings for Scenario {
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error> {
        toml::Table::try_from(self)
    }

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
        let problem = farside::random::RandomKey::new(setup.problem_seed)
            .stream()
            .normal(5.0, 2.0);
        let fewer = u32::from(self.learner.uneven && setup.run_seed.is_multiple_of(2));
        let (gain, steps) = (self.learner.gain, self.learner.steps - fewer);
        let rewards = Arc::new(Mutex::new(Vec::new()));
        let written = rewards.clone();
        let host = setup.sim.host("planner");
        setup.sim.actor(host, "planner", move |_| Planner {
            gain,
            problem,
            steps,
            rewards: written.clone(),
        });
        Ok(Assembly::new(move |_: &Report| {
            let values = rewards.lock().expect("the run is over").clone();
            let index = (0..values.len()).map(|step| step as f64).collect();
            let last = values.last().copied().flatten();
            let series = Series::new(index, values).expect("as many values, and indices that rise");
            let mut results = Results::default();
            results.metrics.insert("reward".to_owned(), series.into());
            results.metrics.insert("last".to_owned(), last.into());
            results.metrics.insert("problem".to_owned(), problem.into());
            results
        }))
    }
}

pub(super) fn registry() -> Registry {
    Registry::empty().with(LearnerSystem)
}
