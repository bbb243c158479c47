//! Ping over a link that loses messages. Demonstrates in particular a request that is sent again
//! after a timeout, answers that come late and are told apart by number, and draws that belong to
//! the message: the run is the same each time, on any machine.
//!
//! ```text
//!   host base              host rover
//!   ┌──────┐  base-rover   ┌───────┐
//!   │ base │──── Ping ────▶│ rover │      each way 1.3 s, one message in four is lost
//!   │      │◀─── Pong ─────│       │
//!   └──────┘  rover-base   └───────┘
//! ```
//!
//! `cargo run --example ping`

use farside::carrier::NoChange;
use farside::prelude::*;
use farside::{Carrier, Parcel, Verdicts};
use serde::{Deserialize, Serialize};

/// How many pings are to be answered.
const PINGS: u32 = 20;

/// How long the base waits for an answer: the way there and back, and some more.
const TIMEOUT: SimDuration = SimDuration::from_secs(3);

#[derive(Serialize, Deserialize)]
struct Ping {
    number: u32,
}

#[derive(Serialize, Deserialize)]
struct Pong {
    number: u32,
}

/// The base's timer: no answer yet.
#[derive(Serialize, Deserialize)]
struct Timeout;

struct Rover;

impl Actor for Rover {
    type Accepts = (Ping,);
}

impl Handler<Ping> for Rover {
    fn handle(&mut self, ping: Ping, ctx: &mut Context<'_, Self>) -> Outcome {
        let base = ctx.lookup::<Base>("base")?;
        let Ping { number } = ping;
        ctx.send(base, Pong { number });
        Ok(())
    }
}

#[derive(Default)]
struct Base {
    number: u32,
    repeats: u32,
    timer: Option<TimerId>,
}

impl Base {
    fn ask(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let rover = ctx.lookup::<Rover>("rover")?;
        let number = self.number;
        ctx.send(rover, Ping { number });
        self.timer = Some(ctx.timer(TIMEOUT, Timeout));
        Ok(())
    }
}

impl Actor for Base {
    type Accepts = (Pong, Timeout);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.ask(ctx)
    }
}

impl Handler<Timeout> for Base {
    fn handle(&mut self, _timeout: Timeout, ctx: &mut Context<'_, Self>) -> Outcome {
        self.repeats += 1;
        self.ask(ctx)
    }
}

impl Handler<Pong> for Base {
    fn handle(&mut self, pong: Pong, ctx: &mut Context<'_, Self>) -> Outcome {
        if pong.number != self.number {
            return Ok(());
        }
        if let Some(timer) = self.timer.take() {
            ctx.cancel(timer);
        }
        self.number += 1;
        if self.number == PINGS {
            ctx.stop(format!(
                "{PINGS} pings answered, {} sent again",
                self.repeats
            ));
            return Ok(());
        }
        self.ask(ctx)
    }
}

/// Loses one message in four. Whether this one is lost is drawn by its identity: what happens to
/// other messages, or how often somebody else draws, changes nothing.
struct Lossy;

impl Carrier for Lossy {
    type Change = NoChange;

    fn min_delay(&self) -> SimDuration {
        SimDuration::from_millis(1_300)
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        if parcel.random(1, 0, 0).uniform() < 0.25 {
            verdicts.lose("loss");
        } else {
            verdicts.deliver(self.min_delay());
        }
    }

    fn change(&mut self, _change: NoChange, _now: SimTime) {}
}

fn run(seed: u64) -> Report {
    let mut sim = Simulation::new(seed);
    let (base, rover) = (sim.host("base"), sim.host("rover"));
    sim.actor(base, "base", |_name| Base::default());
    sim.actor(rover, "rover", |_name| Rover);
    sim.link(base, rover, "base-rover", Lossy);
    sim.link(rover, base, "rover-base", Lossy);
    sim.run(Executor::Inline).expect("the simulation can start")
}

fn main() {
    let report = run(7);
    println!("{} after {}", report.end.detail(), report.end_time);
    println!(
        "{} of {} messages were lost",
        report.counts.lost, report.counts.sent
    );
    assert_eq!(report.end.name(), "stopped");
    assert!(report.counts.lost > 0);
    // Every ping that was answered arrived, and so did its answer.
    assert!(report.counts.delivered >= 2 * u64::from(PINGS));
    // The same seed is the same run; another seed is another.
    assert_eq!(run(7), report);
    assert_ne!(run(8).digest, report.digest);
}
