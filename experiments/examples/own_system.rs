//! A binary with a system of its own behind the `farside` command line: demonstrates in particular
//! settings read from a scenario, links built by name, results taken from committed records, and
//! the registry.
//!
//! ```text
//!   base ──base-rover──▶ rover        ping, each interval
//!        ◀─rover-base───              pong
//! ```
//!
//! ```sh
//! cat > ping.toml <<END
//! system = "ping"
//! ping.count = 100
//! links.default = { latency = "1.3s", loss = 0.1 }
//! END
//! cargo run -p farside-experiments --example own_system -- run ping.toml
//! cargo run -p farside-experiments --example own_system -- verify run.mcap
//! ```

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass};
use farside_actors::settings;
use farside_actors::system::settings::{Table, over};
use farside_actors::system::{
    Assembly, Goal, Results, Section, Settings, Setup, SetupError, System,
};
use farside_actors::units;
use farside_actors::wiring::Wiring;
use farside_experiments::cli;
use farside_experiments::registry::Registry;
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
struct Ping {
    number: u32,
}

#[derive(Serialize, Deserialize)]
struct Pong {
    number: u32,
}

#[derive(Serialize, Deserialize)]
struct Interval;

struct Rover;

impl Actor for Rover {
    type Accepts = (Ping,);
}

impl Handler<Ping> for Rover {
    fn handle(&mut self, ping: Ping, ctx: &mut Context<'_, Self>) -> Outcome {
        let base = ctx.lookup::<Base>("base")?;
        ctx.send(
            base,
            Pong {
                number: ping.number,
            },
        );
        Ok(())
    }
}

struct Base {
    settings: PingSettings,
    sent: u32,
}

impl Actor for Base {
    type Accepts = (Interval, Pong);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(self.settings.interval, Interval);
        Ok(())
    }
}

impl Handler<Interval> for Base {
    fn handle(&mut self, _interval: Interval, ctx: &mut Context<'_, Self>) -> Outcome {
        let rover = ctx.lookup::<Rover>("rover")?;
        ctx.send(rover, Ping { number: self.sent });
        self.sent += 1;
        if self.sent < self.settings.count {
            ctx.timer(self.settings.interval, Interval);
        }
        Ok(())
    }
}

impl Handler<Pong> for Base {
    fn handle(&mut self, pong: Pong, _ctx: &mut Context<'_, Self>) -> Outcome {
        if pong.number >= self.sent {
            return Err(HandlerError::new("an answer to what was never asked"));
        }
        Ok(())
    }
}

// ANCHOR: observer
/// Counts what came back, from the committed records.
struct Pongs(Arc<AtomicU32>);

impl Observer for Pongs {
    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let is_pong = record.kind.is_some_and(|kind| kind.name() == "Pong");
        if is_pong && record.class == RecordClass::Delivered {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
        Ok(Flow::Continue)
    }
}
// ANCHOR_END: observer

// ANCHOR: settings
settings! {
    /// The `[ping]` table: how many pings, and how often.
    struct PingSettings {
        /// How many pings are sent.
        count: u32 = 10, 1..;
        /// The time between two of them.
        interval: SimDuration [with = "units::duration"] = SimDuration::from_secs(1),
            over(SimDuration::ZERO);
    }
}
// ANCHOR_END: settings

// ANCHOR: system
#[derive(Clone, Debug, Serialize, Deserialize)]
struct PingScenario {
    #[serde(default)]
    ping: PingSettings,
}

struct PingSystem;

impl System for PingSystem {
    fn name(&self) -> &str {
        "ping"
    }

    fn about(&self) -> &str {
        "a base that pings a rover"
    }

    fn sections(&self) -> Vec<Section> {
        PingSettings::sections("ping")
    }

    fn parse(
        &self,
        sections: toml::Deserializer<'_>,
    ) -> Result<Box<dyn Settings>, toml::de::Error> {
        Ok(Box::new(PingScenario::deserialize(sections)?))
    }
}
// ANCHOR_END: system

// ANCHOR: assemble
impl Settings for PingScenario {
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error> {
        toml::Table::try_from(self)
    }

    fn check(&self) -> Result<(), SetupError> {
        self.ping.check("ping")
    }

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
        let settings = self.ping.clone();
        let count = settings.count;
        let (base, rover) = (setup.sim.host("base"), setup.sim.host("rover"));
        setup.sim.actor(base, "base", move |_| Base {
            settings: settings.clone(),
            sent: 0,
        });
        setup.sim.actor(rover, "rover", |_| Rover);
        let mut wiring = Wiring::default();
        wiring.both_ways((base, "base"), (rover, "rover"));
        setup.link(&wiring)?;
        let pongs = Arc::new(AtomicU32::new(0));
        setup.sim.observe(Pongs(pongs.clone()));
        // What fills the progress bar; without it, the virtual time does.
        let watched = pongs.clone();
        let goal = Goal {
            what: "pings answered",
            of: u64::from(count),
            done: Box::new(move || u64::from(watched.load(Ordering::Relaxed))),
        };
        let conclude = move |_: &Report| {
            let answered = pongs.load(Ordering::Relaxed);
            let mut results = Results::default();
            results
                .metrics
                .insert("answered".to_owned(), answered.into());
            results.line("pings answered", format!("{answered} of {count}"));
            if answered == 0 {
                results.violations.push("no ping was answered".to_owned());
            }
            results
        };
        Ok(Assembly::new(conclude).with_goal(goal))
    }
}
// ANCHOR_END: assemble

// ANCHOR: main
fn main() -> ExitCode {
    cli::main(Registry::builtin().with(PingSystem))
}
// ANCHOR_END: main
