//! A link of one's own: a relay satellite that is above the horizon for ten minutes of each two
//! hours. Demonstrates in particular [`Carrier`]: a link sees who sends what size to whom and when,
//! and gives each copy a fate; here it stores what comes too early, and loses what its memory does
//! not hold.
//!
//! ```text
//!   ┌───────┐ Sample  ┌─────────── relay ───────────┐   ┌──────┐
//!   │ rover │────────▶│ 64 bytes wait for a contact │──▶│ base │
//!   └───────┘ 20 min  └─────────────────────────────┘   └──────┘
//! ```
//!
//! `cargo run --example own_link`

use farside::carrier::{Carriage, NoChange};
use farside::prelude::*;
use farside::{Carrier, Parcel, Verdicts};
use serde::{Deserialize, Serialize};

const PERIOD: SimDuration = SimDuration::from_secs(2 * 3_600);
const CONTACT: SimDuration = SimDuration::from_secs(600);
const WAY: SimDuration = SimDuration::from_secs(2);

/// Visible at the start of each period.
struct Relay {
    memory_bytes: u64,
    /// What waits for the contact that begins at this time.
    waiting: (SimTime, u64),
}

impl Carrier for Relay {
    type Change = NoChange;

    /// Nothing arrives sooner than this, ever. It decides how far hosts may run ahead of each
    /// other, and is checked.
    fn min_delay(&self) -> SimDuration {
        WAY
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        let now_ns = parcel.now().as_nanos();
        let into_period = SimDuration::from_nanos(now_ns % PERIOD.as_nanos());
        if into_period < CONTACT {
            return verdicts.deliver(WAY);
        }
        let queue = PERIOD - into_period;
        let opens = parcel.now() + queue;
        if self.waiting.0 != opens {
            self.waiting = (opens, 0);
        }
        self.waiting.1 += parcel.size_bytes();
        if self.waiting.1 > self.memory_bytes {
            return verdicts.lose("memory_full");
        }
        // The parts of the delay are for the log: they explain it.
        let carriage = Carriage {
            queue,
            propagation: WAY,
            attempts: 1,
            ..Carriage::default()
        };
        verdicts.deliver_as(carriage.total(), carriage);
    }

    fn change(&mut self, _change: NoChange, _now: SimTime) {}
}

#[derive(Serialize, Deserialize)]
struct Sample {
    bytes: Vec<u8>,
}

#[derive(Serialize, Deserialize)]
struct Next;

struct Rover;

impl Rover {
    fn measure(ctx: &mut Context<'_, Self>) -> Outcome {
        let base = ctx.lookup::<Base>("base")?;
        ctx.send(base, Sample { bytes: vec![0; 14] });
        ctx.timer(SimDuration::from_secs(1_200), Next);
        Ok(())
    }
}

impl Actor for Rover {
    type Accepts = (Next,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        Rover::measure(ctx)
    }
}

impl Handler<Next> for Rover {
    fn handle(&mut self, _next: Next, ctx: &mut Context<'_, Self>) -> Outcome {
        Rover::measure(ctx)
    }
}

struct Base;

impl Actor for Base {
    type Accepts = (Sample,);
}

impl Handler<Sample> for Base {
    fn handle(&mut self, _sample: Sample, ctx: &mut Context<'_, Self>) -> Outcome {
        let into_period = ctx.now().as_nanos() % PERIOD.as_nanos();
        assert_eq!(
            into_period,
            WAY.as_nanos(),
            "samples arrive as a contact begins"
        );
        Ok(())
    }
}

fn main() {
    let mut sim = Simulation::new(1);
    let (rover, base) = (sim.host("rover"), sim.host("base"));
    sim.actor(rover, "rover", |_name| Rover);
    sim.actor(base, "base", |_name| Base);
    let relay = Relay {
        memory_bytes: 64,
        waiting: (SimTime::ZERO, 0),
    };
    sim.link(rover, base, "relay", relay);
    sim.stop_at(SimTime::from_secs(24 * 3_600), "a day");
    let report = sim.run(Executor::Inline).expect("the simulation can start");
    println!("{:?}", report.counts);
    // Six samples in each period: one during the contact; of the five that have to wait, at 16
    // bytes each, four fit.
    assert_eq!((report.counts.sent, report.counts.lost), (72, 12));
    assert_eq!(report.counts.lost_by_reason["memory_full"], 12);
    // The last four wait for a contact that the run does not see.
    assert_eq!((report.counts.delivered, report.counts.in_flight), (56, 4));
}
