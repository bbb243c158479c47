//! A run that goes on until it is killed: demonstrates in particular that its log can be read all
//! the same. Prints a line once a chunk is on the disk.
//!
//! `cargo run -p farside-logs --example endless -- /tmp/endless.mcap`, then `kill -9`, then
//! `farside info /tmp/endless.mcap`.

use farside::prelude::*;
use farside_logs::{LogOptions, LogWriter};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
struct Tick {
    count: u64,
}

struct Clock;

impl Actor for Clock {
    type Accepts = (Tick,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_millis(1), Tick { count: 1 });
        Ok(())
    }
}

impl Handler<Tick> for Clock {
    fn handle(&mut self, tick: Tick, ctx: &mut Context<'_, Self>) -> Outcome {
        if tick.count.is_multiple_of(100_000) {
            println!("{}", tick.count);
        }
        ctx.timer(
            SimDuration::from_millis(1),
            Tick {
                count: tick.count + 1,
            },
        );
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args()
        .nth(1)
        .ok_or("say where to write the log")?;
    let mut sim = Simulation::new(1);
    let host = sim.host("moon");
    sim.actor(host, "clock", |_| Clock);
    sim.observe(LogWriter::create(path, LogOptions::default())?);
    let report = sim.run(Executor::Inline)?;
    println!("{}", report.end.detail());
    Ok(())
}
