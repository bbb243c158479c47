//! Rovers that drive freely, without a system around them: three that stand idle for ten sols, and one
//! that is driven and asked for its state twice a second for a day. Shows in particular how a
//! controller talks to a rover's hardware, and what an event of it costs.
//!
//! `cargo run --release -p farside-actors --example rover_sols`

use std::sync::Arc;

use farside::prelude::*;
use farside_actors::rover::{
    Command, CommandReport, RoverCommand, RoverConfig, RoverHardware, RoverQuery, RoverSite,
    RoverSpec, RoverStart, RoverState, RoverTally, add_hardware, hardware_name,
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

/// Runs so many rovers of a model for so long; returns their figures and the count of events.
fn run(
    model: &str,
    rovers: u32,
    period: SimDuration,
    until: SimDuration,
) -> Result<(Vec<RoverTally>, u64), Box<dyn std::error::Error>> {
    let site = RoverSite {
        ground: Arc::new(RockField::generate(&RockFieldSettings::default())?),
        sky: Sky::new(-14.6, 270.0, 0.5)?,
        starts_s: 0.0,
    };
    let mut sim = Simulation::new(1);
    let mut tallies = Vec::new();
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
        let tally = RoverTally::default();
        tallies.push(tally.clone());
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
            tally,
        };
        add_hardware(&mut sim, host, spec, controller)?;
    }
    sim.stop_at(SimTime::ZERO + until, "long enough");
    let report = sim.run(Executor::Inline)?;
    Ok((tallies, report.counts.events))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (tallies, events) = run("mer", 3, SimDuration::ZERO, SOL * 10)?;
    println!("three idle rovers, ten sols: {events} events");
    for tally in &tallies {
        let energy = tally.figures().energy;
        println!(
            "  {:.0} Wh of sunlight: {:.0} used, {:.0} not taken, {:.0} lost in charging",
            energy.solar_j / 3600.0,
            energy.used_j() / 3600.0,
            energy.not_taken_j / 3600.0,
            energy.charge_loss_j / 3600.0,
        );
        assert!(tally.figures().imbalance < 1e-9);
    }
    let (tallies, events) = run("k9", 1, SimDuration::from_millis(500), SOL)?;
    let figures = tallies[0].figures();
    println!(
        "one rover at 2 Hz, a sol: {events} events, {:.1} m driven, {} of {} commands done",
        figures.driven_m, figures.done, figures.commands
    );
    assert!(figures.imbalance < 1e-9 && figures.commands > 100);
    Ok(())
}
