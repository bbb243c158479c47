//! A system with a curve, for the seams of studies: a planner climbs, one step a second, and from
//! its tenth step on the clever one climbs faster. It is its own `farside` command.

use farside::prelude::*;
use farside_actors::prelude::*;
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

#[derive(Serialize, Deserialize)]
struct Step;

/// The settings, how high the hill is, and the heights so far, in metres.
struct Climber(Climb, f64, Gathered<f64>);

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

impl OwnTable for Climb {
    const NAME: &'static str = "climb";
    const ABOUT: &'static str = "a planner climbs a hill";
    const METRICS: &'static [Metric] = &[Metric::series(
        "height",
        "height reached",
        "m",
        SeriesIndex::new("step", ""),
        Better::Higher,
    )];

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
        let hill = farside::random::RandomKey::new(setup.problem_seed).text("hill");
        let hill_m = hill.stream().normal(5.0, 2.0);
        let heights_m = Gathered::default();
        let (climb, of_actor) = (self.clone(), heights_m.clone());
        let host = setup.sim.host("hill");
        setup.sim.actor(host, "climber", move |_| {
            Climber(climb.clone(), hill_m, of_actor.clone())
        });
        Ok(Assembly::new(move |_| {
            Results::default().metric("height", Series::counted(heights_m.take()))
        }))
    }
}

fn main() -> std::process::ExitCode {
    cli::main(Registry::empty().with(Climb::system()))
}
