//! Rovers that drive freely, without a system around them: three that stand idle for ten sols, and one
//! that is driven and asked for its state twice a second for a day. Shows in particular how a
//! controller talks to a rover's hardware, and what an event of it costs.
//!
//! `cargo run --release -p farside-actors --example rover_sols`

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside_actors::rover::{
    Command, CommandEnd, CommandReport, RoverCommand, RoverConfig, RoverHardware, RoverPose,
    RoverQuery, RoverResources, RoverSite, RoverSpec, RoverStart, RoverState, add_hardware,
    hardware_name,
};
use farside_worlds::{RockField, RockFieldSettings, Sky};
use serde::{Deserialize, Serialize};

/// A sol, to the second.
const SOL: SimDuration = SimDuration::from_secs(88_775);

/// Drives to and fro, and asks for the state each half second; or if `period` is zero, sits still.
struct Controller {
    rover: String,
    period: SimDuration,
    asked: u32,
    drives: u32,
}

/// Timer: ask again.
#[derive(Serialize, Deserialize)]
struct Tick;

impl Actor for Controller {
    type Accepts = (Tick, CommandReport, RoverState);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        if !self.period.is_zero() {
            ctx.timer(self.period, Tick);
        }
        Ok(())
    }
}

impl Handler<Tick> for Controller {
    fn handle(&mut self, _tick: Tick, ctx: &mut Context<'_, Self>) -> Outcome {
        let hardware = ctx.lookup::<RoverHardware>(&hardware_name(&self.rover))?;
        self.asked += 1;
        ctx.send(hardware, RoverQuery { id: self.asked });
        if self.asked.is_multiple_of(1200) {
            self.drives += 1;
            let east_m = f64::from(self.drives % 5);
            let command = Command::Drive {
                east_m,
                north_m: 0.0,
            };
            ctx.send(
                hardware,
                RoverCommand {
                    id: self.drives,
                    command,
                },
            );
        }
        ctx.timer(self.period, Tick);
        Ok(())
    }
}

impl Handler<CommandReport> for Controller {
    fn handle(&mut self, _report: CommandReport, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

impl Handler<RoverState> for Controller {
    fn handle(&mut self, state: RoverState, _ctx: &mut Context<'_, Self>) -> Outcome {
        assert!(state.battery_j <= state.battery_capacity_j);
        Ok(())
    }
}

/// What samples and reports of all rovers say, by the number of the actor that each came from.
#[derive(Default)]
struct Seen {
    resources: BTreeMap<usize, RoverResources>,
    poses: BTreeMap<usize, RoverPose>,
    reports: u32,
    done: u32,
}

/// What was seen, when a run is over.
type Shared = Arc<Mutex<Seen>>;

/// Watches a run.
struct Watch(Shared);

impl Observer for Watch {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: true,
            checkpoints: false,
        }
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let Some(kind) = record.kind else {
            return Ok(Flow::Continue);
        };
        let failed = |error: farside::encoding::DecodeError| ObserverError(error.to_string());
        let mut seen = self
            .0
            .lock()
            .unwrap_or_else(|poisoned| poisoned.into_inner());
        let (rover, schema) = (record.sender.index(), kind.schema());
        match (record.class, kind.name()) {
            (RecordClass::Sample, "RoverResources") => {
                let resources: RoverResources = schema.decode(record.body).map_err(failed)?;
                let energy = &resources.energy;
                assert!(energy.imbalance_j().abs() < 1e-9 * energy.total_j());
                seen.resources.insert(rover, resources);
            }
            (RecordClass::Sample, "RoverPose") => {
                let pose = schema.decode(record.body).map_err(failed)?;
                seen.poses.insert(rover, pose);
            }
            (RecordClass::Delivered, "CommandReport") => {
                let report: CommandReport = schema.decode(record.body).map_err(failed)?;
                seen.reports += 1;
                seen.done += u32::from(report.end == CommandEnd::Done);
            }
            _ => {}
        }
        Ok(Flow::Continue)
    }
}

/// Runs so many rovers of a model for so long; returns what was seen and the count of events.
fn run(
    model: &str,
    rovers: u32,
    period: SimDuration,
    until: SimDuration,
) -> Result<(Shared, u64), Box<dyn std::error::Error>> {
    let site = RoverSite {
        ground: Arc::new(RockField::generate(&RockFieldSettings::default())?),
        sky: Sky::new(-14.6, 270.0, 0.5)?,
        starts_s: 0.0,
    };
    let mut sim = Simulation::new(1);
    let seen = Shared::default();
    sim.observe(Watch(seen.clone()));
    for number in 1..=rovers {
        let rover = format!("rover_{number:02}");
        let host = sim.host(&rover);
        let name = rover.clone();
        let controller = sim.actor(host, &format!("{rover}/controller"), move |_| Controller {
            rover: name.clone(),
            period,
            asked: 0,
            drives: 0,
        });
        let spec = RoverSpec {
            number,
            name: rover,
            config: RoverConfig::named(model)?,
            site: site.clone(),
            start: RoverStart {
                east_m: f64::from(number),
                north_m: 0.0,
                yaw_rad: 0.0,
            },
            seed: 1,
            until,
        };
        add_hardware(&mut sim, host, spec, controller)?;
    }
    sim.stop_at(SimTime::ZERO + until, "long enough");
    let report = sim.run(Executor::Inline)?;
    Ok((seen, report.counts.events))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (seen, events) = run("mer", 3, SimDuration::ZERO, SOL * 10)?;
    println!("three idle rovers, ten sols: {events} events");
    let seen = seen.lock().map_err(|error| error.to_string())?;
    for resources in seen.resources.values() {
        let energy = resources.energy;
        println!(
            "  {:.0} Wh of sunlight: {:.0} used, {:.0} not taken, {:.0} lost in charging",
            energy.solar_j / 3600.0,
            energy.used_j() / 3600.0,
            energy.not_taken_j / 3600.0,
            energy.charge_loss_j / 3600.0,
        );
    }
    let (seen, events) = run("k9", 1, SimDuration::from_millis(500), SOL)?;
    let seen = seen.lock().map_err(|error| error.to_string())?;
    let driven_m: f64 = seen.poses.values().map(|pose| pose.driven_m).sum();
    println!(
        "one rover at 2 Hz, a sol: {events} events, {driven_m:.1} m driven, {} of {} commands done",
        seen.done, seen.reports
    );
    for resources in seen.resources.values() {
        println!("  its bay is at {:.1} degC", resources.bay_c);
    }
    assert!(seen.reports > 100);
    Ok(())
}
