//! Goals that arrive from outside the run. Demonstrates in particular [`Simulation::tell_at`]: what
//! nobody in the simulation decides (a goal at noon, a fault that is injected) is a control event,
//! recorded like any other and part of the digest.
//!
//! ```text
//!   @control ··· Goal, Stuck ···▶ ┌───────┐  rover-base   ┌──────┐
//!                                 │ rover │─── Report ───▶│ base │
//!                                 └───────┘    10 min     └──────┘
//! ```
//!
//! `cargo run --example told_goals`

use std::sync::{Arc, Mutex};

use farside::prelude::*;
use serde::{Deserialize, Serialize};

/// Drive there.
#[derive(Serialize, Deserialize)]
struct Goal {
    east_m: f64,
}

/// An injected fault: from now on the wheels do not turn.
#[derive(Serialize, Deserialize)]
struct Stuck;

/// What the rover has to say about a goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Report {
    east_m: f64,
    reached: bool,
}

#[derive(Default)]
struct Rover {
    east_m: f64,
    stuck: bool,
}

impl Actor for Rover {
    type Accepts = (Goal, Stuck);
}

impl Handler<Goal> for Rover {
    fn handle(&mut self, goal: Goal, ctx: &mut Context<'_, Self>) -> Outcome {
        if !self.stuck {
            self.east_m = goal.east_m;
        }
        let report = Report {
            east_m: self.east_m,
            reached: !self.stuck,
        };
        let base = ctx.recipient::<Report>("base")?;
        ctx.send(base, report);
        Ok(())
    }
}

impl Handler<Stuck> for Rover {
    fn handle(&mut self, _stuck: Stuck, _ctx: &mut Context<'_, Self>) -> Outcome {
        self.stuck = true;
        Ok(())
    }
}

struct Base {
    heard: Arc<Mutex<Vec<Report>>>,
}

impl Actor for Base {
    type Accepts = (Report,);
}

impl Handler<Report> for Base {
    fn handle(&mut self, report: Report, _ctx: &mut Context<'_, Self>) -> Outcome {
        self.heard.lock().expect("nobody panics").push(report);
        Ok(())
    }
}

fn main() {
    let noon = SimTime::from_secs(12 * 3_600);
    let heard = Arc::<Mutex<Vec<Report>>>::default();
    let mut sim = Simulation::new(1);
    let (mars, earth) = (sim.host("mars"), sim.host("earth"));
    let rover = sim.actor(mars, "rover", |_name| Rover::default());
    let to_base = heard.clone();
    sim.actor(earth, "base", move |_name| Base {
        heard: to_base.clone(),
    });
    let ten_minutes = FixedDelay::new(SimDuration::from_secs(600));
    sim.link(mars, earth, "rover-base", ten_minutes);

    sim.tell_at(noon, rover, Goal { east_m: 100.0 });
    sim.tell_at(noon + SimDuration::from_secs(60), rover, Stuck);
    // By name, as scenarios give it: a name that nobody has is an error here, with the nearest.
    let evening = noon + SimDuration::from_secs(6 * 3_600);
    sim.tell_named_at(evening, "rover", Goal { east_m: 200.0 })
        .expect("there is a rover");
    let unknown = sim.tell_named_at(evening, "rovr", Stuck).unwrap_err();
    assert_eq!(
        unknown.to_string(),
        "no actor is called \"rovr\"; did you mean \"rover\"?"
    );

    let report = sim.run(Executor::Inline).expect("the simulation can start");
    let heard = heard.lock().expect("the run is over");
    for Report { east_m, reached } in heard.iter() {
        println!(
            "{east_m} m east, {}",
            if *reached { "reached" } else { "not reached" }
        );
    }
    let expected = [(100.0, true), (100.0, false)];
    let expected = expected.map(|(east_m, reached)| Report { east_m, reached });
    assert_eq!(*heard, expected);
    assert_eq!(report.end_time, evening + SimDuration::from_secs(600));
}
