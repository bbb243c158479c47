//! Actors of one's own, logged to MCAP by a program that uses the libraries alone: demonstrates in
//! particular messages, handlers, timers, links, and the log writer. The guide's chapter "Your own
//! actor" walks through it.
//!
//! ```text
//!   base ──earth-moon──▶ rover_1      Ask, each minute
//!        ◀─moon-earth───              Odometry
//! ```
//!
//! `cargo run -p farside-experiments --example own_actor -- own.mcap`

use farside::prelude::*;
use farside_logs::{LogOptions, LogWriter};
use serde::{Deserialize, Serialize};

// ANCHOR: messages
#[derive(Serialize, Deserialize)]
struct Ask;

#[derive(Serialize, Deserialize)]
struct Odometry {
    distance_m: f64,
}
// ANCHOR_END: messages

// ANCHOR: rover
struct Rover {
    base: Address<Base>,
}

impl Actor for Rover {
    type Accepts = (Ask,);
}

impl Handler<Ask> for Rover {
    fn handle(&mut self, _ask: Ask, ctx: &mut Context<'_, Self>) -> Outcome {
        // 5 cm/s since the start, measured with a wheel that slips.
        let slip = ctx.random("wheel_slip").normal(1.0, 0.01);
        let distance_m = 0.05 * slip * ctx.now().as_secs_f64();
        ctx.send(self.base, Odometry { distance_m });
        Ok(())
    }
}
// ANCHOR_END: rover

// ANCHOR: base
#[derive(Serialize, Deserialize)]
struct Minute;

struct Base {
    answers: u32,
}

impl Actor for Base {
    type Accepts = (Minute, Odometry);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(60), Minute);
        Ok(())
    }
}

impl Handler<Minute> for Base {
    fn handle(&mut self, _minute: Minute, ctx: &mut Context<'_, Self>) -> Outcome {
        let rover = ctx.lookup::<Rover>("rover_1")?;
        ctx.send(rover, Ask);
        ctx.timer(SimDuration::from_secs(60), Minute);
        Ok(())
    }
}

impl Handler<Odometry> for Base {
    fn handle(&mut self, odometry: Odometry, ctx: &mut Context<'_, Self>) -> Outcome {
        if odometry.distance_m < 0.0 {
            return Err(HandlerError::new("the rover has driven less than nothing"));
        }
        self.answers += 1;
        if self.answers == 3 {
            ctx.stop("three answers are enough");
        }
        Ok(())
    }
}
// ANCHOR_END: base

// ANCHOR: assemble
fn assemble() -> Simulation {
    let mut sim = Simulation::new(7);
    let (earth, moon) = (sim.host("earth"), sim.host("moon"));
    let base = sim.actor(earth, "base", |_name| Base { answers: 0 });
    sim.actor(moon, "rover_1", move |_name| Rover { base });
    let one_way = FixedDelay::new(SimDuration::from_millis(1300));
    sim.link(earth, moon, "earth-moon", one_way.clone());
    sim.link(moon, earth, "moon-earth", one_way);
    sim
}
// ANCHOR_END: assemble

// ANCHOR: log
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args()
        .nth(1)
        .ok_or("say where to write the log")?;
    let mut sim = assemble();
    let unlogged = assemble().run(Executor::Inline)?;
    sim.observe(LogWriter::create(&path, LogOptions::default())?);
    let report = sim.run(Executor::Inline)?;
    // What observes a run does not change it.
    assert_eq!(report.digest, unlogged.digest);
    println!(
        "{} after {} messages",
        report.end.detail(),
        report.counts.delivered
    );
    Ok(())
}
// ANCHOR_END: log
