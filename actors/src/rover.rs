//! The hardware of a rover that drives freely, for every system that has one: it takes commands,
//! one at a time for each part, and reports each one's end.
//!
//! A rover stands on a [`RockField`] under a [`Sky`]. Its hardware is one actor,
//! [`RoverHardware`], on the rover's host. It decides nothing: a controller, any actor that handles
//! [`CommandReport`] and [`RoverState`], sends it [`RoverCommand`]s.
//!
//! ```
//! use std::sync::Arc;
//! use farside::prelude::*;
//! use farside_actors::rover::*;
//! use farside_worlds::{RockField, RockFieldSettings, Sky};
//! # use serde::{Deserialize, Serialize};
//!
//! /// Drives two metres, looks around, and is content.
//! struct Controller;
//!
//! # #[derive(Serialize, Deserialize)]
//! # struct Begin;
//! #
//! impl Actor for Controller {
//!     type Accepts = (Begin, CommandReport, RoverState);
//!     fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
//!         ctx.timer(SimDuration::from_secs(1), Begin);
//!         Ok(())
//!     }
//! }
//! impl Handler<Begin> for Controller {
//!     fn handle(&mut self, _: Begin, ctx: &mut Context<'_, Self>) -> Outcome {
//!         let hardware = ctx.lookup::<RoverHardware>(&hardware_name("rover_01"))?;
//!         let command = Command::Drive { east_m: 2.0, north_m: 0.0 };
//!         ctx.send(hardware, RoverCommand { id: 1, command });
//!         Ok(())
//!     }
//! }
//! impl Handler<CommandReport> for Controller {
//!     fn handle(&mut self, report: CommandReport, ctx: &mut Context<'_, Self>) -> Outcome {
//!         assert_eq!(report.end, CommandEnd::Done);
//!         if report.id == 2 {
//!             ctx.stop(format!("{} rocks seen", report.readings.len()));
//!             return Ok(());
//!         }
//!         let hardware = ctx.lookup::<RoverHardware>(&hardware_name("rover_01"))?;
//!         let (camera, view) = ("pancam".to_owned(), View::Panorama);
//!         let command = Command::Image { camera, view };
//!         ctx.send(hardware, RoverCommand { id: 2, command });
//!         Ok(())
//!     }
//! }
//! # impl Handler<RoverState> for Controller {
//! #     fn handle(&mut self, _: RoverState, _: &mut Context<'_, Self>) -> Outcome { Ok(()) }
//! # }
//!
//! let mut config = RoverConfig::named("mer")?;
//! config.lease = SimDuration::ZERO; // this controller is silent for 20 minutes
//! let site = RoverSite {
//!     ground: Arc::new(RockField::generate(&RockFieldSettings::default())?),
//!     sky: Sky::new(-14.6, 270.0, 0.5)?,
//!     starts_s: 36_000.0,
//! };
//! let spec = RoverSpec {
//!     number: 1,
//!     name: "rover_01".to_owned(),
//!     config,
//!     site,
//!     start: RoverStart { east_m: 0.0, north_m: 0.0, yaw_rad: 0.0 },
//!     seed: 1,
//!     until: SimDuration::from_secs(7200),
//! };
//! let mut sim = Simulation::new(1);
//! let host = sim.host("rover_01");
//! let controller = sim.actor(host, "rover_01/controller", |_| Controller);
//! add_hardware(&mut sim, host, spec, controller)?;
//! let report = sim.run(Executor::Inline)?;
//! assert!(report.end.detail().ends_with("rocks seen"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod actor;
mod bay;
mod body;
mod command;
mod faults;
mod hardware;
mod instruments;
mod landmarks;
mod lifts;
mod memory;
mod model;
mod power;
mod record;

use std::sync::Arc;

use farside::{Address, Handler, HostId, SimDuration, Simulation};
use farside_worlds::{RockField, Sky};
use thiserror::Error;

use crate::system::SetupError;
use crate::system::settings::Table;

pub use actor::RoverHardware;
pub use bay::BayModel;
pub use command::{
    Aim, Command, CommandEnd, CommandReport, Failure, Obstacle, Part, PoseEstimate, Reading,
    Refusal, RenewLease, RoverCommand, RoverQuery, RoverState, Running, StopCause, View,
};
pub use faults::{FaultBegins, FaultConfig, FaultEnds, FaultKind, FaultRates, PlannedFault};
pub use model::{InstrumentKind, InstrumentModel, RoverConfig, RoverModel, ViewModel};
pub use power::RoverEnergy;
pub use record::{RoverIncident, RoverPose, RoverResources};

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
}

/// Why a rover cannot be.
#[derive(Debug, Error)]
pub enum RoverError {
    /// Its keys are out of their ranges.
    #[error(transparent)]
    Settings(#[from] SetupError),
    /// It would stand outside its terrain.
    #[error(
        "{name}: starts at ({east_m}, {north_m}) m: expected a place on the terrain, which is \
         {half_m} m to each side of (0, 0)"
    )]
    OutsideTerrain {
        /// The rover.
        name: String,
        /// To the east \[m\].
        east_m: f64,
        /// To the north \[m\].
        north_m: f64,
        /// How far the terrain reaches \[m\].
        half_m: f64,
    },
    /// A number that is none.
    #[error("{name}: {what}: {actual}: expected a finite number")]
    NotFinite {
        /// The rover.
        name: String,
        /// Which number.
        what: &'static str,
        /// What it is.
        actual: f64,
    },
}

impl RoverSpec {
    fn check(&self) -> Result<(), RoverError> {
        self.config.check("rover")?;
        for (what, actual) in [
            ("yaw_rad", self.start.yaw_rad),
            ("starts_s", self.site.starts_s),
        ] {
            if !actual.is_finite() {
                let name = self.name.clone();
                return Err(RoverError::NotFinite { name, what, actual });
            }
        }
        let RoverStart {
            east_m, north_m, ..
        } = self.start;
        let half_m = 0.5 * self.site.ground.settings().side_m;
        if east_m.abs() <= half_m && north_m.abs() <= half_m {
            return Ok(());
        }
        Err(RoverError::OutsideTerrain {
            name: self.name.clone(),
            east_m,
            north_m,
            half_m,
        })
    }
}

/// Adds a rover's hardware to its host, as an actor `{name}/hardware`, with its faults. It reports to
/// `controller`, which is declared before and finds it by [`hardware_name`].
///
/// # Errors
/// When the rover's keys are out of their ranges, or it would stand outside the terrain.
pub fn add_hardware<C>(
    sim: &mut Simulation,
    host: HostId,
    spec: RoverSpec,
    controller: Address<C>,
) -> Result<Address<RoverHardware>, RoverError>
where
    C: Handler<CommandReport> + Handler<RoverState>,
{
    spec.check()?;
    let (reports, states) = (controller.recipient(), controller.recipient());
    Ok(actor::add(sim, host, spec, reports, states))
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
