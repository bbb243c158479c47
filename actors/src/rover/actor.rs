//! The actor: hands messages to the hardware and its answers to the controller. What it knows of
//! the rover is durable, because metal does not forget.

use std::sync::Arc;

use farside::prelude::*;

use super::RoverSpec;
use super::command::{CommandReport, RenewLease, RoverCommand, RoverQuery, RoverState};
use super::faults::{self, FaultBegins, FaultEnds, PlannedFault};

/// A rover's hardware: see [`add_hardware`](super::add_hardware).
pub struct RoverHardware {
    spec: Arc<RoverSpec>,
    faults: Arc<[PlannedFault]>,
    reports: Recipient<CommandReport>,
    states: Recipient<RoverState>,
}

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

impl Actor for RoverHardware {
    type Accepts = (RoverCommand, RoverQuery, RenewLease, FaultBegins, FaultEnds);
}

impl Handler<RoverCommand> for RoverHardware {
    fn handle(&mut self, _command: RoverCommand, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

impl Handler<RoverQuery> for RoverHardware {
    fn handle(&mut self, _query: RoverQuery, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

impl Handler<RenewLease> for RoverHardware {
    fn handle(&mut self, _renew: RenewLease, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

impl Handler<FaultBegins> for RoverHardware {
    fn handle(&mut self, _fault: FaultBegins, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

impl Handler<FaultEnds> for RoverHardware {
    fn handle(&mut self, _fault: FaultEnds, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}
