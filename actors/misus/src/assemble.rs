//! Puts a team together: on each rover its scientist and its hardware, links between all of them, and
//! a monitor.

use std::sync::{Arc, Mutex};

use farside::{Address, HostId, SimDuration, Simulation};
use farside_actors::rover::{RoverConfig, RoverError, RoverSpec, RoverStart, add_hardware};
use farside_actors::system::SetupError;
use farside_actors::wiring::{Wire, Wiring};
use nalgebra::Point3;

use crate::config::{LearnConfig, TeamConfig};
use crate::monitor::{Monitor, Tally};
use crate::scientist::Scientist;
use crate::site::{Instruments, SharedSite, Site};
use crate::tools::Tools;
use farside_actors::field::Place;

/// The distance between rovers at the start \[m\].
const APART_M: f64 = 2.0;

/// What a team is put together from.
pub(crate) struct Parts<'a> {
    pub(crate) place: &'a Place,
    pub(crate) team: &'a TeamConfig,
    pub(crate) rover: &'a RoverConfig,
    pub(crate) learn: &'a LearnConfig,
    /// The run's seed.
    pub(crate) seed: u64,
    pub(crate) until: SimDuration,
}

/// A team in a simulation.
pub(crate) struct Team {
    pub(crate) site: SharedSite,
    pub(crate) tally: Arc<Mutex<Tally>>,
}

/// The names of a team's rovers: `rover_01` and so on.
pub(crate) fn names(team: &TeamConfig) -> Vec<String> {
    (1..=team.rovers).map(|n| format!("rover_{n:02}")).collect()
}

/// Where a rover stands at the start: on a ring round the middle, facing outwards.
pub(crate) fn start(number: u32, rovers: u32) -> RoverStart {
    let turn = (f64::from(number) + 0.5) / f64::from(rovers);
    let yaw_rad = std::f64::consts::TAU * turn;
    let ring_m = APART_M * f64::from(rovers) / std::f64::consts::TAU;
    let wrapped = match yaw_rad > std::f64::consts::PI {
        true => yaw_rad - std::f64::consts::TAU,
        false => yaw_rad,
    };
    RoverStart {
        east_m: ring_m * libm::cos(yaw_rad),
        north_m: ring_m * libm::sin(yaw_rad),
        yaw_rad: wrapped,
    }
}

/// Which key of the scenario a rover that cannot be is of.
pub(crate) fn blame(error: RoverError) -> SetupError {
    match error {
        RoverError::Settings(error) => error,
        RoverError::OutsideTerrain { .. } => SetupError::value("team.rovers", error),
        RoverError::NotFinite { .. } => SetupError::value("rover", error),
    }
}

/// Declares hosts, actors and links.
pub(crate) fn assemble(
    sim: &mut Simulation,
    parts: &Parts<'_>,
    wire: &mut Wire<'_>,
) -> Result<Team, SetupError> {
    let rovers = names(parts.team);
    let field = &parts.place.field;
    let catalogue = field.rocks().to_vec();
    let lease = parts.rover.lease;
    let site = Arc::new(Site {
        config: parts.learn.clone(),
        sectors: Site::sectors(&catalogue, rovers.len()),
        catalogue,
        rovers,
        side_m: field.settings().side_m,
        tools: Tools::new(parts.place, parts.learn)?,
        sky: parts.place.sky,
        starts_s: parts.place.starts_s,
        instruments: Instruments::of(parts.rover),
        renew_every: (!lease.is_zero()).then(|| SimDuration::from_nanos(lease.as_nanos() / 3)),
    });
    let hosts: Vec<HostId> = site.rovers.iter().map(|name| sim.host(name)).collect();
    let mut wiring = Wiring::default();
    for (number, (host, name)) in (0..).zip(hosts.iter().zip(&site.rovers)) {
        let shared = site.clone();
        let scientist: Address<Scientist> =
            sim.actor(*host, name, move |_| Scientist::new(shared.clone(), number));
        let start = start(number, parts.team.rovers);
        let spec = RoverSpec {
            number,
            name: name.clone(),
            config: parts.rover.clone(),
            site: parts.place.site(),
            start,
            seed: parts.seed,
            until: parts.until,
        };
        add_hardware(sim, *host, spec, scientist).map_err(blame)?;
        let height_m = field.ground_m(start.east_m, start.north_m);
        let antenna_m = height_m + parts.rover.mast_m;
        wiring.place(name, Point3::new(start.east_m, start.north_m, antenna_m));
    }
    wiring.terrain(Arc::new(field.terrain().clone()));
    for (from, from_name) in hosts.iter().zip(&site.rovers) {
        for (to, to_name) in hosts.iter().zip(&site.rovers) {
            if from != to {
                wiring.link((*from, from_name), (*to, to_name));
            }
        }
    }
    wire(sim, &wiring)?;
    let (monitor, tally) = Monitor::new(site.clone());
    sim.observe(monitor);
    Ok(Team { site, tally })
}
