//! The monitor: keeps what rovers recorded of themselves, for the results. It sees committed records
//! only, and never an actor.

use std::sync::{Arc, Mutex, PoisonError};

use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{RunInfo, SimTime};
use farside_actors::rover::{FaultBegins, RoverIncident, RoverPose, RoverResources, hardware_name};

use crate::messages::FieldModel;
use crate::site::SharedSite;

/// What is known of a team.
#[derive(Default)]
pub(crate) struct Tally {
    /// By the rover's number.
    pub(crate) rovers: Vec<RoverHistory>,
    /// Exchange messages and their bytes, as they were delivered or lost.
    pub(crate) exchanged: u64,
    pub(crate) exchanged_bytes: u64,
}

/// What is known of a rover.
#[derive(Default)]
pub(crate) struct RoverHistory {
    /// What it learnt, and when, in order.
    pub(crate) models: Vec<(SimTime, FieldModel)>,
    /// Rocks that it set out for.
    pub(crate) stops: u32,
    /// Its hardware's last word of what it has.
    pub(crate) resources: RoverResources,
    /// The greatest share of all energy that was ever not accounted for.
    pub(crate) imbalance: f64,
    /// Its hardware's last word of where it is.
    pub(crate) pose: Option<RoverPose>,
    /// How far it went, as samples have it \[m\].
    pub(crate) distance_m: f64,
    /// The names of its faults, in order.
    pub(crate) faults: Vec<&'static str>,
    pub(crate) brown_outs: u32,
}

impl RoverHistory {
    fn place(&mut self, pose: RoverPose) {
        if let Some(before) = &self.pose {
            let (east_m, north_m) = (pose.east_m - before.east_m, pose.north_m - before.north_m);
            self.distance_m += libm::hypot(east_m, north_m);
        }
        self.pose = Some(pose);
    }

    fn supply(&mut self, resources: RoverResources) {
        let energy = &resources.energy;
        let share = energy.imbalance_j().abs() / energy.total_j();
        self.imbalance = self.imbalance.max(share);
        self.resources = resources;
    }
}

/// Which rover an actor belongs to, and what it is.
#[derive(Clone, Copy)]
enum Role {
    Other,
    Scientist(usize),
    Hardware(usize),
}

/// Watches a run.
pub(crate) struct Monitor {
    site: SharedSite,
    tally: Arc<Mutex<Tally>>,
    roles: Vec<Role>,
}

impl Monitor {
    /// A monitor, and what it will write to.
    pub(crate) fn new(site: SharedSite) -> (Monitor, Arc<Mutex<Tally>>) {
        let rovers = site
            .rovers
            .iter()
            .map(|_| RoverHistory::default())
            .collect();
        let tally = Arc::new(Mutex::new(Tally {
            rovers,
            ..Tally::default()
        }));
        let monitor = Monitor {
            site,
            tally: tally.clone(),
            roles: Vec::new(),
        };
        (monitor, tally)
    }

    fn role(&self, name: &str) -> Role {
        let rovers = || self.site.rovers.iter();
        let scientist = rovers().position(|rover| rover == name);
        let hardware = || rovers().position(|rover| hardware_name(rover) == name);
        match scientist {
            Some(rover) => Role::Scientist(rover),
            None => hardware().map_or(Role::Other, Role::Hardware),
        }
    }
}

impl Observer for Monitor {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: true,
            checkpoints: false,
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        self.roles = run
            .entities
            .iter()
            .map(|one| self.role(&one.name))
            .collect();
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let Some(kind) = record.kind else {
            return Ok(Flow::Continue);
        };
        let failed = |error: farside::encoding::DecodeError| ObserverError(error.to_string());
        // What is told comes from outside.
        let who = match record.class {
            RecordClass::Told => record.receiver,
            _ => record.sender,
        };
        let role = self.roles[who.index()];
        let mut tally = self.tally.lock().unwrap_or_else(PoisonError::into_inner);
        match (record.class, role, kind.name()) {
            (class, Role::Scientist(_), "Statistics") if class.is_fate() => {
                tally.exchanged += 1;
                tally.exchanged_bytes += record.body.len() as u64;
            }
            (RecordClass::Sample, Role::Scientist(rover), "FieldModel") => {
                let model = kind.schema().decode(record.body).map_err(failed)?;
                tally.rovers[rover].models.push((record.time(), model));
            }
            (RecordClass::Sample, Role::Scientist(rover), "Stop") => {
                tally.rovers[rover].stops += 1;
            }
            (RecordClass::Sample, Role::Hardware(rover), "RoverPose") => {
                let pose = kind.schema().decode(record.body).map_err(failed)?;
                tally.rovers[rover].place(pose);
            }
            (RecordClass::Sample, Role::Hardware(rover), "RoverResources") => {
                let resources = kind.schema().decode(record.body).map_err(failed)?;
                tally.rovers[rover].supply(resources);
            }
            (RecordClass::Sample, Role::Hardware(rover), "RoverIncident") => {
                let incident: RoverIncident = kind.schema().decode(record.body).map_err(failed)?;
                if matches!(incident, RoverIncident::BrownOut { .. }) {
                    tally.rovers[rover].brown_outs += 1;
                }
            }
            (RecordClass::Told, Role::Hardware(rover), "FaultBegins") => {
                let fault: FaultBegins = kind.schema().decode(record.body).map_err(failed)?;
                tally.rovers[rover].faults.push(fault.kind.name());
            }
            _ => {}
        }
        Ok(Flow::Continue)
    }
}
