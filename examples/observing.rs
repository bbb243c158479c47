//! Watching a run. Demonstrates in particular [`Observer`]: it is shown committed records in order,
//! message bodies and state samples among them, may ask the run to stop, and changes nothing else.
//!
//! ```text
//!   ┌───────┐ Odometry ┌──────┐
//!   │ rover │─────────▶│ base │
//!   └───┬───┘  500 ms  └──────┘
//!       └─ sample: Battery ─ ─ ─▶ Monitor (outside the run): stops it below 20 J
//! ```
//!
//! `cargo run --example observing`

use std::sync::{Arc, Mutex};

use farside::encoding::Schema;
use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
struct Odometry {
    distance_m: f64,
}

#[derive(Serialize, Deserialize)]
struct Minute;

/// A state sample: for who watches, and no part of the run.
#[derive(Serialize, Deserialize)]
struct Battery {
    charge_j: f64,
}

struct Rover {
    distance_m: f64,
    charge_j: f64,
}

impl Actor for Rover {
    type Accepts = (Minute,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(60), Minute);
        Ok(())
    }
}

impl Handler<Minute> for Rover {
    fn handle(&mut self, _minute: Minute, ctx: &mut Context<'_, Self>) -> Outcome {
        self.distance_m += 3.0;
        self.charge_j -= 10.0;
        let charge_j = self.charge_j;
        ctx.sample(&Battery { charge_j });
        let base = ctx.lookup::<Base>("base")?;
        let distance_m = self.distance_m;
        ctx.send(base, Odometry { distance_m });
        ctx.timer(SimDuration::from_secs(60), Minute);
        Ok(())
    }
}

struct Base;

impl Actor for Base {
    type Accepts = (Odometry,);
}

impl Handler<Odometry> for Base {
    fn handle(&mut self, _odometry: Odometry, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

/// Adds up what the base has heard, and stops the run when the battery is low.
struct Monitor {
    battery: Schema,
    odometry: Schema,
    heard_m: Arc<Mutex<f64>>,
}

impl Observer for Monitor {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: true,
            checkpoints: false,
        }
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let kind = record.kind.map_or("", |kind| kind.name());
        let wrong = |error: farside::encoding::DecodeError| ObserverError(error.to_string());
        match (record.class, kind) {
            (RecordClass::Delivered, "Odometry") => {
                let odometry: Odometry = self.odometry.decode(record.body).map_err(wrong)?;
                *self.heard_m.lock().expect("nobody panics") = odometry.distance_m;
            }
            (RecordClass::Sample, "Battery") => {
                let battery: Battery = self.battery.decode(record.body).map_err(wrong)?;
                if battery.charge_j < 20.0 {
                    return Ok(Flow::Stop("the battery is low".to_owned()));
                }
            }
            _ => {}
        }
        Ok(Flow::Continue)
    }
}

fn team() -> Simulation {
    let mut sim = Simulation::new(1);
    let (moon, earth) = (sim.host("moon"), sim.host("earth"));
    sim.actor(moon, "rover", |_name| Rover {
        distance_m: 0.0,
        charge_j: 100.0,
    });
    sim.actor(earth, "base", |_name| Base);
    let link = FixedDelay::new(SimDuration::from_millis(500));
    sim.link(moon, earth, "moon-earth", link);
    sim
}

/// The team, watched: how the run ended, and what the base had heard by then.
fn watched(executor: Executor) -> (Report, f64) {
    let heard_m = Arc::<Mutex<f64>>::default();
    let mut sim = team();
    sim.observe(Monitor {
        battery: Schema::of::<Battery>().expect("it can be described"),
        odometry: Schema::of::<Odometry>().expect("it can be described"),
        heard_m: heard_m.clone(),
    });
    let report = sim.run(executor).expect("the simulation can start");
    let heard_m = *heard_m.lock().expect("the run is over");
    (report, heard_m)
}

fn main() {
    let (report, heard_m) = watched(Executor::Inline);
    println!(
        "{} at {}, {heard_m} m heard of",
        report.end.detail(),
        report.end_time
    );
    // Below 20 J after nine minutes; a stop takes one look-ahead, by when the last report is there
    // or not: whoever asks, the run ends before anything that happens at that instant.
    assert_eq!(
        report.end_time,
        SimTime::from_secs(540) + SimDuration::from_millis(500)
    );
    assert_eq!(heard_m, 24.0);
    assert_eq!(
        watched(Executor::Kameo { threads: 2 }),
        (report.clone(), heard_m)
    );

    // Unwatched and stopped at the same instant, the same happens: the digest is that of the run,
    // not of who looks on. Only who asked for the stop differs.
    let mut unwatched = team();
    unwatched.stop_at(report.end_time, "the battery is low");
    let unwatched = unwatched
        .run(Executor::Inline)
        .expect("the simulation can start");
    assert_eq!(unwatched.counts, report.counts);
}
