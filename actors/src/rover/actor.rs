//! The actor: hands messages to the hardware and its answers to the controller, and tells radios where the rover
//! is. What it knows of the rover is durable, because metal does not forget.

use std::sync::Arc;

use farside::LinkId;
use farside::prelude::*;
use serde::{Deserialize, Serialize};

use super::RoverSpec;
use super::command::{CommandReport, RenewLease, RoverCommand, RoverQuery, RoverState};
use super::faults::{self, FaultBegins, FaultEnds, PlannedFault};
use super::hardware::{Hardware, Output};
use super::record::RoverPose;
use crate::radio::RadioChange;

/// A rover's hardware: see [`add_hardware`](super::add_hardware).
///
/// It outlives crashes of its actor, which are crashes of the computer that drives it: pose,
/// estimate, charge, memory, known rocks and faults are there again after a restart. Commands are
/// not. What ran went on to the end of its step (a leg, a turn, a reading) and no further, readings
/// that were not reported are lost, and nobody is told.
pub struct RoverHardware {
    spec: Arc<RoverSpec>,
    faults: Arc<[PlannedFault]>,
    reports: Recipient<CommandReport>,
    states: Recipient<RoverState>,
    /// When something happens by itself, and the timer for it.
    timer: Option<(SimTime, TimerId)>,
    /// The radios that links of its host go through.
    radios: Vec<LinkId<RadioChange>>,
    /// Where they were last told that it is, east and north \[m\].
    told_m: Option<[f64; 2]>,
}

/// The rover, which a crash leaves as it is.
#[derive(Default)]
struct Metal(Option<Box<Hardware>>);

/// Timer: something happens by itself.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct HardwareWakes;

pub(super) fn add(
    sim: &mut Simulation,
    host: HostId,
    spec: RoverSpec,
    reports: Recipient<CommandReport>,
    states: Recipient<RoverState>,
) -> Address<RoverHardware> {
    let (chosen, rates) = (&spec.config.faults, &spec.config.fault_rates);
    let faults: Arc<[PlannedFault]> =
        faults::plan(chosen, rates, &spec.name, spec.seed, spec.until).into();
    let name = super::hardware_name(&spec.name);
    let spec = Arc::new(spec);
    let planned = faults.clone();
    let address = sim.actor(host, &name, move |_| RoverHardware {
        spec: spec.clone(),
        faults: planned.clone(),
        reports,
        states,
        timer: None,
        radios: Vec::new(),
        told_m: None,
    });
    for fault in faults.iter() {
        sim.tell_at(fault.at, address, fault.begins.clone());
        if let Some(ends) = fault.ends {
            let number = fault.begins.number;
            sim.tell_at(ends, address, FaultEnds { number });
        }
    }
    address
}

impl RoverHardware {
    /// Does something to the hardware, and hands on what comes of it. `act` is given what links have
    /// charged the host so far.
    fn with<T>(
        &mut self,
        ctx: &mut Context<'_, Self>,
        act: impl FnOnce(&mut Hardware, f64, &mut Vec<Output>) -> T,
    ) -> T {
        let links_j = ctx.host_transmit_energy_j() + ctx.host_receive_energy_j();
        let metal = ctx.durable::<Metal>().0.take();
        let new = || Box::new(Hardware::new(self.spec.clone()));
        let mut hardware = metal.unwrap_or_else(new);
        let mut out = Vec::new();
        let result = act(&mut hardware, links_j, &mut out);
        let next = hardware.next();
        ctx.durable::<Metal>().0 = Some(hardware);
        for output in out {
            match output {
                Output::Report(report) => ctx.send(self.reports, report),
                Output::Pose(pose) => {
                    ctx.sample(&pose);
                    self.tell_radios(&pose, ctx);
                }
                Output::Resources(resources) => ctx.sample(&resources),
                Output::Incident(incident) => ctx.sample(&incident),
            }
        }
        self.set_timer(ctx, next);
        result
    }

    /// Radios learn where it is whenever that is recorded and has changed.
    fn tell_radios(&mut self, pose: &RoverPose, ctx: &mut Context<'_, Self>) {
        let place_m = [pose.east_m, pose.north_m];
        if self.radios.is_empty() || self.told_m == Some(place_m) {
            return;
        }
        self.told_m = Some(place_m);
        let at_m = [pose.east_m, pose.north_m, pose.height_m];
        for radio in &self.radios {
            let moves = RadioChange::Moves {
                host: self.spec.name.clone(),
                from_m: at_m,
                to_m: at_m,
                end_ns: ctx.now().as_nanos(),
            };
            ctx.tell_link(*radio, moves);
        }
    }

    fn set_timer(&mut self, ctx: &mut Context<'_, Self>, next: Option<SimTime>) {
        if self.timer.map(|(at, _)| at) == next {
            return;
        }
        if let Some((_, timer)) = self.timer.take() {
            ctx.cancel(timer);
        }
        let now = ctx.now();
        self.timer = next.map(|at| (at, ctx.timer(at.since(now), HardwareWakes)));
    }
}

impl Actor for RoverHardware {
    type Accepts = (
        RoverCommand,
        RoverQuery,
        RenewLease,
        FaultBegins,
        FaultEnds,
        HardwareWakes,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.radios = ctx.links();
        let (now, is_first) = (ctx.now(), ctx.incarnation() == 0);
        let faults = self.faults.clone();
        self.with(ctx, |hardware, links_j, out| match is_first {
            true => hardware.wake(now, links_j, out),
            false => hardware.restart(now, links_j, &faults, out),
        });
        Ok(())
    }
}

impl Handler<RoverCommand> for RoverHardware {
    fn handle(&mut self, command: RoverCommand, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        self.with(ctx, |hardware, links_j, out| {
            hardware.wake(now, links_j, out);
            hardware.command(command, out);
        });
        Ok(())
    }
}

impl Handler<RoverQuery> for RoverHardware {
    fn handle(&mut self, query: RoverQuery, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        let state = self.with(ctx, |hardware, links_j, out| {
            hardware.wake(now, links_j, out);
            hardware.hear();
            hardware.state(query.id)
        });
        ctx.send(self.states, state);
        Ok(())
    }
}

impl Handler<RenewLease> for RoverHardware {
    fn handle(&mut self, _renew: RenewLease, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        self.with(ctx, |hardware, links_j, out| {
            hardware.wake(now, links_j, out);
            hardware.hear();
        });
        Ok(())
    }
}

impl Handler<FaultBegins> for RoverHardware {
    fn handle(&mut self, fault: FaultBegins, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        self.with(ctx, |hardware, links_j, out| {
            hardware.wake(now, links_j, out);
            hardware.fault_begins(fault, out);
        });
        Ok(())
    }
}

impl Handler<FaultEnds> for RoverHardware {
    fn handle(&mut self, fault: FaultEnds, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        self.with(ctx, |hardware, links_j, out| {
            hardware.wake(now, links_j, out);
            hardware.fault_ends(fault.number, out);
        });
        Ok(())
    }
}

impl Handler<HardwareWakes> for RoverHardware {
    fn handle(&mut self, _timer: HardwareWakes, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        self.timer = None;
        self.with(ctx, |hardware, links_j, out| {
            hardware.wake(now, links_j, out)
        });
        Ok(())
    }
}
