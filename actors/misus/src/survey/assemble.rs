//! Puts planners together: the centre and each rover on a host of its own, links between all of them, and a
//! monitor.

use std::sync::{Arc, Mutex};

use farside::random::RandomKey;
use farside::{HostId, Simulation};
use farside_actors::system::SetupError;
use farside_actors::wiring::{Wire, Wiring};
use nalgebra::Point3;

use super::centre::CentralPlanner;
use super::config::{PlanningScenario, RoundsConfig};
use super::monitor::{Monitor, Tally};
use super::rover::RoverPlanner;
use crate::planner::casper::{Casper, PlannerConfig, Unmet};
use crate::planner::instance::Instance;
use crate::planner::lns::LnsConfig;
use crate::planner::problem::{Problem, generate};

/// The name of the centre's host and of its planner.
pub(super) const CENTRE: &str = "centre";

/// The name of the processor that a planner has on its host.
const PROCESSOR: &str = "planner";

/// How high antennas are over the ground \[m\].
const ANTENNA_M: f64 = 1.0;

/// What all planners carry.
pub(super) struct Shared {
    pub(super) problem: Problem,
    pub(super) instance: Instance,
    pub(super) planner: PlannerConfig,
    pub(super) lns: LnsConfig,
    pub(super) rounds: RoundsConfig,
    /// The names of the rovers' hosts and planners.
    pub(super) rovers: Vec<String>,
    pub(super) key: RandomKey,
}

/// Planners in a simulation.
pub(super) struct Team {
    pub(super) shared: Arc<Shared>,
    pub(super) tally: Arc<Mutex<Tally>>,
}

/// What planners carry in a run with these seeds.
pub(super) fn shared(
    scenario: &PlanningScenario,
    problem_seed: u64,
    run_seed: u64,
) -> Result<Shared, SetupError> {
    let wrong = |error| SetupError::value("problem", error);
    let problem = generate(&scenario.problem, problem_seed).map_err(wrong)?;
    let instance = Instance::new(&problem).map_err(wrong)?;
    let key = RandomKey::new(run_seed);
    for rover in 0..problem.rovers.len() {
        Casper::new(&instance, rover, &scenario.planner, key)
            .map_err(|unmet| blame(&problem, &unmet))?;
    }
    Ok(Shared {
        rovers: problem.rovers.iter().map(|one| one.name.clone()).collect(),
        planner: scenario.planner.clone(),
        lns: scenario.lns.clone(),
        rounds: scenario.rounds.clone(),
        problem,
        instance,
        key,
    })
}

/// Which key of the scenario keeps a rover from what it has to do in any case.
fn blame(problem: &Problem, unmet: &Unmet) -> SetupError {
    let lacking = unmet.lacking;
    let (key, lacks) = if lacking.energy_uj > 0 {
        let missing_j = lacking.energy_uj as f64 / 1e6;
        ("communication_power", format!("{missing_j} J of energy"))
    } else if lacking.bits > 0 {
        ("communication_size", format!("{} bit", lacking.bits))
    } else {
        let missing_s = lacking.late_ms as f64 / 1e3;
        ("communication", format!("{missing_s} s of time"))
    };
    let rover = &problem.rovers[unmet.rover].name;
    let message = format!(
        "{rover} cannot make its daily communication: it lacks {lacks}, so there is no plan"
    );
    SetupError::value(&format!("problem.{key}"), message)
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
