//! Puts a survey together: on each rover its hardware, its scientist and its planner, at the site of the centre
//! the centre and the scientist who closes the loop, links between all hosts, and monitors.

use std::sync::{Arc, Mutex};

use farside::random::RandomKey;
use farside::{HostId, SimDuration, Simulation};
use farside_actors::field::Place;
use farside_actors::rover::{RoverSpec, add_hardware};
use farside_actors::system::{Files, SetupError};
use farside_actors::wiring::{Wire, Wiring};
use nalgebra::Point3;

use super::centre::SurveyCentre;
use super::explorer::Explorer;
use super::monitor::{Course, SurveyMonitor};
use super::scenario::{LANDER, SurveyScenario};
use super::science::{FieldScientist, LeadScientist};
use super::shared::{SCIENTIST, Shared};
use super::wishes::OwnWishes;
use crate::assemble::{blame, names, start};
use crate::monitor::{Monitor, Tally};
use crate::shac::{Party, Settings};
use crate::site::{Instruments, SharedSite, Site};
use crate::tools::Tools;

/// The name of the processor that planners have on each host.
const PROCESSOR: &str = "planner";

/// How high the lander's antenna is over the ground \[m\].
const ANTENNA_M: f64 = 1.5;

/// What a survey is put together from.
pub(super) struct Parts<'a> {
    pub(super) scenario: &'a SurveyScenario,
    pub(super) place: &'a Place,
    pub(super) settings: Arc<Settings>,
    /// The run's seed.
    pub(super) seed: u64,
    pub(super) until: SimDuration,
}

/// A survey in a simulation.
pub(super) struct Survey {
    pub(super) shared: Arc<Shared>,
    /// What was learnt, and what hardware did.
    pub(super) team: Arc<Mutex<Tally>>,
    /// What became of goals and plans.
    pub(super) course: Arc<Mutex<Course>>,
}

/// What all actors carry.
fn shared(parts: &Parts<'_>) -> Result<Shared, SetupError> {
    let scenario = parts.scenario;
    let rovers = names(&scenario.team);
    let catalogue = parts.place.field.rocks().to_vec();
    let place_m = |rock: u32| {
        let rock = catalogue.get(rock as usize)?;
        Some([rock.position_m.x, rock.position_m.y])
    };
    let own = OwnWishes::new(&scenario.goals, &scenario.combinations, place_m);
    let starts = (0..scenario.team.rovers).map(|rover| start(rover, scenario.team.rovers));
    let lease = scenario.rover.lease;
    let site: SharedSite = Arc::new(Site {
        config: scenario.learn.clone(),
        sectors: Site::sectors(&catalogue, rovers.len()),
        catalogue,
        rovers,
        side_m: parts.place.field.settings().side_m,
        tools: Tools::new(parts.place, &scenario.learn)?,
        sky: parts.place.sky,
        starts_s: parts.place.starts_s,
        instruments: Instruments::of(&scenario.rover),
        renew_every: (!lease.is_zero()).then(|| SimDuration::from_nanos(lease.as_nanos() / 3)),
    });
    Ok(Shared {
        site,
        rover: scenario.rover.clone(),
        survey: scenario.survey.clone(),
        planner: scenario.planner.clone(),
        objective: scenario.objective.clone(),
        execution: scenario.execution.clone(),
        own,
        starts_m: starts.map(|at| [at.east_m, at.north_m]).collect(),
        names: scenario.parties(&parts.settings),
        settings: parts.settings.clone(),
        key: RandomKey::new(parts.seed),
    })
}

/// The protocol's settings of a scenario.
pub(super) fn settings(
    scenario: &SurveyScenario,
    files: &mut Files,
) -> Result<Arc<Settings>, SetupError> {
    scenario.settings(files)
}

/// Declares hosts, actors and links.
pub(super) fn assemble(
    sim: &mut Simulation,
    parts: &Parts<'_>,
    wire: &mut Wire<'_>,
) -> Result<Survey, SetupError> {
    let shared = Arc::new(shared(parts)?);
    let mut hosts: Vec<(HostId, String)> = Vec::new();
    for name in &shared.site.rovers {
        hosts.push((sim.host(name), name.clone()));
    }
    if shared.site_of_centre() as usize == hosts.len() {
        hosts.push((sim.host(LANDER), LANDER.to_owned()));
    }
    let links = wire(sim, &wiring(parts, &shared, &hosts))?;
    for (site, (host, host_name)) in (0..).zip(&hosts) {
        let processor = format!("{host_name}/{PROCESSOR}");
        let parties = [Party::Owner(site), Party::Centre(site)];
        for (party, name) in parties
            .iter()
            .filter_map(|one| shared.names.get_key_value(one))
        {
            let shared = shared.clone();
            match *party {
                Party::Owner(_) => {
                    let explorer = links.processor(sim, &processor, |sim, processor| {
                        sim.actor(*host, name, move |_| {
                            Explorer::new(shared.clone(), site, processor.clone())
                        })
                    });
                    let spec = RoverSpec {
                        number: site,
                        name: host_name.clone(),
                        config: parts.scenario.rover.clone(),
                        site: parts.place.site(),
                        start: start(site, parts.scenario.team.rovers),
                        seed: parts.seed,
                        until: parts.until,
                    };
                    add_hardware(sim, *host, spec, explorer).map_err(blame)?;
                }
                Party::Centre(_) => {
                    links.processor(sim, &processor, |sim, processor| {
                        sim.actor(*host, name, move |_| {
                            SurveyCentre::new(shared.clone(), site, processor.clone())
                        })
                    });
                }
            }
        }
        let is_first = site == shared.site_of_centre();
        let may_lead = shared.settings.candidates.contains(&site) && !is_first;
        if (site as usize) < shared.site.rovers.len() {
            let shared = shared.clone();
            if may_lead {
                sim.actor(*host, host_name, move |_| {
                    LeadScientist::new(shared.clone(), site)
                });
            } else {
                sim.actor(*host, host_name, move |_| {
                    FieldScientist::new(shared.clone(), site)
                });
            }
        }
        if is_first {
            let shared = shared.clone();
            sim.actor(*host, SCIENTIST, move |_| {
                LeadScientist::new(shared.clone(), site)
            });
        }
    }
    let (monitor, team) = Monitor::new(shared.site.clone());
    sim.observe(monitor);
    let (monitor, course) = SurveyMonitor::new(shared.clone());
    sim.observe(monitor);
    Ok(Survey {
        shared,
        team,
        course,
    })
}

fn wiring(parts: &Parts<'_>, shared: &Shared, hosts: &[(HostId, String)]) -> Wiring {
    let field = &parts.place.field;
    let mut wiring = Wiring::default();
    wiring.terrain(Arc::new(field.terrain().clone()));
    for (number, (host, name)) in hosts.iter().enumerate() {
        let (mast_m, [east_m, north_m]) = match shared.starts_m.get(number) {
            Some(start_m) => (parts.scenario.rover.mast_m, *start_m),
            None => (ANTENNA_M, [0.0; 2]),
        };
        let height_m = field.ground_m(east_m, north_m) + mast_m;
        wiring.place(name, Point3::new(east_m, north_m, height_m));
        wiring.processor(name, PROCESSOR, parts.scenario.survey.processor);
        for (other, other_name) in &hosts[number + 1..] {
            wiring.both_ways((*host, name), (*other, other_name));
        }
    }
    wiring
}
