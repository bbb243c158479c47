//! A crash, and what outlives it. Demonstrates in particular durable memory: a counter that is kept
//! in it goes on after a restart, one that is kept in the actor's state begins anew; timers of the
//! life before are void, and what arrives meanwhile is lost as `crashed`.
//!
//! ```text
//!   ┌────────┐ Command ┌────────────────────────────┐
//!   │ ground │────────▶│ rover: state    (volatile) │   ✝ 25 s … 45 s
//!   └────────┘  1 s    │        progress (durable)  │
//!     each 10 s        └────────────────────────────┘
//! ```
//!
//! `cargo run --example crash_and_restart`

use std::sync::{Arc, Mutex};

use farside::prelude::*;
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
struct Command {
    number: u32,
}

#[derive(Serialize, Deserialize)]
struct Next;

struct GroundStation {
    sent: u32,
}

impl Actor for GroundStation {
    type Accepts = (Next,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(10), Next);
        Ok(())
    }
}

impl Handler<Next> for GroundStation {
    fn handle(&mut self, _next: Next, ctx: &mut Context<'_, Self>) -> Outcome {
        let rover = ctx.lookup::<Rover>("rover")?;
        self.sent += 1;
        ctx.send(rover, Command { number: self.sent });
        if self.sent < 6 {
            ctx.timer(SimDuration::from_secs(10), Next);
        }
        Ok(())
    }
}

/// What the rover keeps in its flash memory: the numbers of the commands it has carried out.
#[derive(Default)]
struct Progress(Vec<u32>);

struct Rover {
    since_start: u32,
    seen: Arc<Mutex<Vec<Life>>>,
}

/// After each command: how often the rover was restarted, how many commands it knows of in its
/// state, and which in its durable memory.
#[derive(Clone, Debug, PartialEq)]
struct Life {
    incarnation: u32,
    since_start: u32,
    durable: Vec<u32>,
}

impl Actor for Rover {
    type Accepts = (Command,);
}

impl Handler<Command> for Rover {
    fn handle(&mut self, command: Command, ctx: &mut Context<'_, Self>) -> Outcome {
        self.since_start += 1;
        ctx.durable::<Progress>().0.push(command.number);
        let life = Life {
            incarnation: ctx.incarnation(),
            since_start: self.since_start,
            durable: ctx.durable::<Progress>().0.clone(),
        };
        self.seen.lock().expect("nobody panics").push(life);
        Ok(())
    }
}

fn main() {
    let seen = Arc::<Mutex<Vec<Life>>>::default();
    let mut sim = Simulation::new(1);
    let (earth, moon) = (sim.host("earth"), sim.host("moon"));
    sim.actor(earth, "ground", |_name| GroundStation { sent: 0 });
    let to_rover = seen.clone();
    // Called at the start, and again at the restart.
    sim.actor(moon, "rover", move |_name| Rover {
        since_start: 0,
        seen: to_rover.clone(),
    });
    let second = FixedDelay::new(SimDuration::from_secs(1));
    sim.link(earth, moon, "earth-moon", second);
    // All actors of the host, of which there is one here.
    sim.crash_host_at(SimTime::from_secs(25), moon);
    sim.restart_host_at(SimTime::from_secs(45), moon);

    let report = sim.run(Executor::Inline).expect("the simulation can start");
    let seen = seen.lock().expect("the run is over");
    for life in seen.iter() {
        println!("{life:?}");
    }
    // Commands 3 and 4 found nobody.
    assert_eq!(report.counts.lost_by_reason["crashed"], 2);
    let last = Life {
        incarnation: 1,
        since_start: 2,
        durable: vec![1, 2, 5, 6],
    };
    assert_eq!(seen.last(), Some(&last));
}
