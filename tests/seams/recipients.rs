//! Receivers looked up by what they accept: a planner of one's own takes the place of ours.

use farside::End;
use farside::prelude::*;
use serde::{Deserialize, Serialize};

use super::agreed;

#[derive(Serialize, Deserialize)]
struct Request {
    goals: u32,
}

#[derive(Serialize, Deserialize)]
struct Answer {
    by: String,
}

/// Knows a planner by name, and nothing else of it.
struct Rover;

impl Actor for Rover {
    type Accepts = (Answer,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let planner = ctx.recipient::<Request>("planner")?;
        ctx.send(planner, Request { goals: 3 });
        Ok(())
    }
}

impl Handler<Answer> for Rover {
    fn handle(&mut self, answer: Answer, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.stop(answer.by);
        Ok(())
    }
}

macro_rules! planner {
    ($name:ident, $($accepted:ty),*) => {
        struct $name;

        impl Actor for $name {
            type Accepts = ($($accepted,)*);
        }

        impl Handler<Request> for $name {
            fn handle(&mut self, _: Request, ctx: &mut Context<'_, Self>) -> Outcome {
                let rover = ctx.recipient::<Answer>("rover")?;
                ctx.send(rover, Answer { by: stringify!($name).to_owned() });
                Ok(())
            }
        }
    };
}

planner!(Ours, Request);
planner!(Theirs, Request);

/// Accepts answers, and no requests.
struct NoPlanner;

impl Actor for NoPlanner {
    type Accepts = (Answer,);
}

impl Handler<Answer> for NoPlanner {
    fn handle(&mut self, _: Answer, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

fn team<A: Actor>(name: &'static str, planner: fn() -> A) -> Simulation {
    let mut sim = Simulation::new(1);
    let (mars, earth) = (sim.host("mars"), sim.host("earth"));
    sim.actor(mars, "rover", |_| Rover);
    sim.actor(earth, name, move |_| planner());
    sim.heavy(earth);
    let delay = || FixedDelay::new(SimDuration::from_secs(600));
    sim.link(mars, earth, "mars-earth", delay());
    sim.link(earth, mars, "earth-mars", delay());
    sim
}

fn end_of(report: Report) -> String {
    match report.end {
        End::Stopped { reason, .. } => reason,
        End::Fault(fault) => fault.cause.to_string(),
        end => panic!("{end:?}"),
    }
}

#[test]
fn any_type_that_accepts_a_message_takes_the_place() {
    assert_eq!(end_of(agreed(|| team("planner", || Ours))), "Ours");
    assert_eq!(end_of(agreed(|| team("planner", || Theirs))), "Theirs");
}

#[test]
fn who_does_not_accept_it_is_named_with_what_it_accepts() {
    let wrong = end_of(agreed(|| team("planner", || NoPlanner)));
    assert!(wrong.starts_with("planner is a "), "{wrong}");
    assert!(
        wrong.contains("Request; it accepts ") && wrong.ends_with("Answer"),
        "{wrong}"
    );
    let unknown = end_of(agreed(|| team("planer", || Ours)));
    assert_eq!(
        unknown,
        "no actor is called \"planner\"; did you mean \"planer\"?"
    );
}
