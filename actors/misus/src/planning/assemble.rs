//! Puts planners together: the centre and each rover on a host of its own, links between all of them, and a
//! monitor.

use std::sync::{Arc, Mutex};

use farside::{HostId, Simulation};
use farside_actors::system::SetupError;
use farside_actors::wiring::{Wire, Wiring};
use nalgebra::Point3;

use super::centre::CentralPlanner;
use super::monitor::{Monitor, Tally};
use super::rover::RoverPlanner;
use super::shared::{CENTRE, Shared};

/// The name of the processor that a planner has on its host.
const PROCESSOR: &str = "planner";

/// How high antennas are over the ground \[m\].
const ANTENNA_M: f64 = 1.0;

/// Planners in a simulation.
pub(super) struct Team {
    pub(super) shared: Arc<Shared>,
    pub(super) tally: Arc<Mutex<Tally>>,
}

/// Declares hosts, actors and links.
pub(super) fn assemble(
    sim: &mut Simulation,
    shared: Shared,
    wire: &mut Wire<'_>,
) -> Result<Team, SetupError> {
    let shared = Arc::new(shared);
    let names = [CENTRE].into_iter();
    let names: Vec<&str> = names
        .chain(shared.rovers.iter().map(String::as_str))
        .collect();
    let hosts: Vec<HostId> = names.iter().map(|name| sim.host(name)).collect();
    let places_m = [[0.0; 2]].into_iter();
    let places_m = places_m.chain(shared.problem.rovers.iter().map(|rover| rover.position_m));
    let mut wiring = Wiring::default();
    for ((number, name), [east_m, north_m]) in names.iter().enumerate().zip(places_m) {
        wiring.place(name, Point3::new(east_m, north_m, ANTENNA_M));
        wiring.processor(name, PROCESSOR, shared.rounds.processor);
        for other in number + 1..names.len() {
            wiring.both_ways((hosts[number], name), (hosts[other], names[other]));
        }
    }
    let links = wire(sim, &wiring)?;
    for ((number, name), host) in names.iter().enumerate().zip(hosts) {
        let shared = shared.clone();
        let processor = format!("{name}/{PROCESSOR}");
        match number.checked_sub(1) {
            None => {
                links.processor(sim, &processor, |sim, processor| {
                    sim.actor(host, name, move |_| {
                        CentralPlanner::new(shared.clone(), processor.clone())
                    })
                });
            }
            Some(rover) => {
                links.processor(sim, &processor, |sim, processor| {
                    sim.actor(host, name, move |_| {
                        RoverPlanner::new(shared.clone(), rover, processor.clone())
                    })
                });
            }
        }
    }
    let (monitor, tally) = Monitor::new(shared.clone());
    sim.observe(monitor);
    Ok(Team { shared, tally })
}
