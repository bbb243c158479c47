//! The hardware of a rover that drives freely, for every system that has one: it takes commands,
//! one at a time for each part, and reports each one's end.
//!
//! A rover stands on a [`RockField`] under a [`Sky`]. Its hardware is one actor,
//! [`RoverHardware`], on the rover's host. It decides nothing: a controller, any actor that handles
//! [`CommandReport`] and [`RoverState`], sends it [`RoverCommand`]s.

mod actor;
mod body;
mod command;
mod faults;
mod hardware;
mod instruments;
mod landmarks;
mod memory;
mod model;
mod power;
mod record;

use std::sync::Arc;

use farside::{Address, Handler, HostId, SimDuration, Simulation};
use farside_worlds::{RockField, Sky};

pub use actor::RoverHardware;
pub use command::{
    Aim, Command, CommandEnd, CommandReport, Failure, Obstacle, Part, PoseEstimate, Reading,
    Refusal, RenewLease, RoverCommand, RoverQuery, RoverState, Running, StopCause, View,
};
pub use faults::{FaultBegins, FaultConfig, FaultEnds, FaultKind, FaultRates, PlannedFault};
pub use model::{InstrumentKind, InstrumentModel, RoverConfig, RoverModel, ViewModel};
pub use power::RoverEnergy;
pub use record::{RoverFigures, RoverIncident, RoverPose, RoverResources, RoverTally};

/// Where rovers are: shared by all of a run.
#[derive(Clone, Debug)]
pub struct RoverSite {
    /// The ground.
    pub ground: Arc<RockField>,
    /// The sky over it.
    pub sky: Sky,
    /// The sky's time at the start of the run \[s since a local solar midnight\].
    pub starts_s: f64,
}

/// Where a rover stands at the start, which it knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoverStart {
    /// To the east \[m\].
    pub east_m: f64,
    /// To the north \[m\].
    pub north_m: f64,
    /// The heading \[rad, counted from east to north\].
    pub yaw_rad: f64,
}

/// A rover that is to be: see [`add_hardware`].
#[derive(Clone, Debug)]
pub struct RoverSpec {
    /// Its number in the team, from 0: the upper half of the ids of its readings.
    pub number: u32,
    /// Its host's name: its draws and its faults go by it.
    pub name: String,
    /// What it is.
    pub config: RoverConfig,
    /// Where it is.
    pub site: RoverSite,
    /// Where it stands at the start.
    pub start: RoverStart,
    /// The run's seed.
    pub seed: u64,
    /// The end of the run: until then there are faults by chance.
    pub until: SimDuration,
    /// Where its figures go, for the run's results.
    pub tally: RoverTally,
}

/// Adds a rover's hardware to its host, as an actor `{name}/hardware`, with its faults. It reports to
/// `controller`, which is declared before and finds it by [`hardware_name`].
pub fn add_hardware<C>(
    sim: &mut Simulation,
    host: HostId,
    spec: RoverSpec,
    controller: Address<C>,
) -> Address<RoverHardware>
where
    C: Handler<CommandReport> + Handler<RoverState>,
{
    actor::add(
        sim,
        host,
        spec,
        controller.recipient(),
        controller.recipient(),
    )
}

/// The name of the actor that is a rover's hardware.
///
/// ```
/// assert_eq!(farside_actors::rover::hardware_name("rover_01"), "rover_01/hardware");
/// ```
pub fn hardware_name(rover: &str) -> String {
    format!("{rover}/hardware")
}

#[cfg(test)]
mod tests;
