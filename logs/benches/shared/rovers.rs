//! A run to be logged: 20 rovers that report to a base 50 times a second.

use farside::prelude::*;
use farside::record::Observer;
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
struct Pose {
    number: u32,
    x_m: f64,
    y_m: f64,
    heading_rad: f64,
    battery: f32,
    goal: Option<(f64, f64)>,
    status: String,
}

#[derive(Serialize, Deserialize)]
struct Due;

struct Base;

impl Actor for Base {
    type Accepts = (Pose,);
}

impl Handler<Pose> for Base {
    fn handle(&mut self, _pose: Pose, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

struct Rover {
    base: Address<Base>,
    number: u32,
}

impl Actor for Rover {
    type Accepts = (Due,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_millis(20), Due);
        Ok(())
    }
}

impl Handler<Due> for Rover {
    fn handle(&mut self, _due: Due, ctx: &mut Context<'_, Self>) -> Outcome {
        self.number += 1;
        let number = self.number;
        let noise = ctx.random("noise");
        let pose = Pose {
            number,
            x_m: f64::from(number) * 0.02 + noise.normal(0.0, 0.1),
            y_m: noise.normal(0.0, 0.1),
            heading_rad: noise.normal(0.0, 1.0),
            battery: 1.0 / (1.0 + number as f32 * 1e-5),
            goal: Some((10.0, 20.0)),
            status: "driving to the next waypoint".to_owned(),
        };
        ctx.send(self.base, pose);
        ctx.timer(SimDuration::from_millis(20), Due);
        Ok(())
    }
}

/// Simulates so many seconds with a seed, and tells the observers.
pub(crate) fn simulate<O: Observer + 'static>(
    observers: impl IntoIterator<Item = O>,
    seed: u64,
    seconds: u64,
) -> Report {
    let mut sim = Simulation::new(seed);
    let earth = sim.host("earth");
    let base = sim.actor(earth, "base", |_| Base);
    for rover in 0..20 {
        let host = sim.host(&format!("host_{rover:02}"));
        sim.actor(host, &format!("rover_{rover:02}"), move |_| Rover {
            base,
            number: 0,
        });
        let delay = FixedDelay::new(SimDuration::from_millis(5 + rover));
        sim.link(host, earth, &format!("radio_{rover:02}"), delay);
    }
    sim.stop_at(
        SimTime::ZERO + SimDuration::from_secs(seconds),
        "long enough",
    );
    for observer in observers {
        sim.observe(observer);
    }
    sim.run(Executor::Inline).unwrap()
}
