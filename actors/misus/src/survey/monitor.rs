//! The monitor: keeps what all of a survey recorded of themselves, and watches what must hold. It sees committed
//! records only, and never an actor.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{RunInfo, SimDuration, SimTime};
use farside_actors::rover::{RoverPose, hardware_name};

use super::messages::{GoalListHeld, GoalsShared, PlanMade};
use super::shared::Shared;
use super::tally::SurveyTally;
use crate::shac::{CentreWrite, OwnerWrite, Party};

/// How often the course of a survey is noted.
pub(super) const STEP: SimDuration = SimDuration::from_secs(3600);

/// What a survey had come to at an instant.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Point {
    pub(super) score: f64,
    pub(super) goals: u32,
    pub(super) operations: u64,
    pub(super) driven_m: f64,
}

/// What an actor is.
#[derive(Clone, Copy)]
enum Role {
    Other,
    /// Who closes the loop while the centre is at this site.
    Scientist(u32),
    Planner(usize),
    Centre(u32),
    Hardware(usize),
}

/// All that came of a survey.
#[derive(Default)]
pub(super) struct Course {
    pub(super) tally: SurveyTally,
    /// At the end of each [`STEP`].
    pub(super) points: Vec<Point>,
}

/// Watches a run.
pub(super) struct SurveyMonitor {
    shared: Arc<Shared>,
    course: Arc<Mutex<Course>>,
    roles: Vec<Role>,
}

impl Course {
    /// Notes the course up to an instant.
    pub(super) fn note(&mut self, now: SimTime) {
        while (self.points.len() as u64 + 1) * STEP.as_nanos() <= now.as_nanos() {
            let rovers = self.tally.rovers.iter();
            let point = Point {
                score: self.tally.score,
                goals: self.tally.goals_achieved(),
                operations: self.tally.operations(),
                driven_m: rovers.map(|rover| rover.driven_m).sum(),
            };
            self.points.push(point);
        }
    }
}

impl SurveyMonitor {
    /// A monitor, and what it will write to.
    pub(super) fn new(shared: Arc<Shared>) -> (SurveyMonitor, Arc<Mutex<Course>>) {
        let course = Arc::new(Mutex::new(Course {
            tally: SurveyTally::new(shared.site.rovers.len()),
            ..Course::default()
        }));
        let monitor = SurveyMonitor {
            shared,
            course: course.clone(),
            roles: Vec::new(),
        };
        (monitor, course)
    }

    /// What each name stands for.
    fn all_roles(&self) -> BTreeMap<String, Role> {
        let parties = self.shared.names.iter().map(|(party, name)| match party {
            Party::Owner(rover) => (name.clone(), Role::Planner(*rover as usize)),
            Party::Centre(site) => (name.clone(), Role::Centre(*site)),
        });
        let hardware = self.shared.site.rovers.iter().enumerate();
        let hardware = hardware.map(|(at, rover)| (hardware_name(rover), Role::Hardware(at)));
        let leads = self.shared.settings.candidates.iter();
        let leads = leads.map(|site| {
            (
                self.shared.lead_at(*site).to_owned(),
                Role::Scientist(*site),
            )
        });
        parties.chain(hardware).chain(leads).collect()
    }

    fn sample(
        &self,
        course: &mut Course,
        role: Role,
        record: &Record<'_>,
        kind: &farside::Kind,
    ) -> Result<(), farside::encoding::DecodeError> {
        let (now, body) = (record.time(), record.body);
        let tally = &mut course.tally;
        match (role, kind.name()) {
            (Role::Planner(rover), "OwnerWrite") => {
                let write: OwnerWrite = kind.schema().decode(body)?;
                tally.check_owner(rover, now, &write);
                tally.owner_wrote(rover, &write);
            }
            (Role::Planner(rover), "PlanMade") => {
                let plan: PlanMade = kind.schema().decode(body)?;
                tally.check_plan(rover, &plan, self.shared.rover.speed_m_per_s);
                tally.plan(rover, &plan);
            }
            (Role::Planner(rover), "ActivityBegan") => {
                let began = kind.schema().decode(body)?;
                tally.check_begin(rover, now, &began);
                tally.rovers[rover].running = Some(began);
            }
            (Role::Planner(rover), "ActivityEnded") => {
                let ended = kind.schema().decode(body)?;
                tally.check_end(rover, now, &ended);
                tally.ended(rover, &ended);
            }
            (Role::Centre(site), "CentreWrite") => {
                let write: CentreWrite = kind.schema().decode(body)?;
                tally.check_centre(site, now, &write);
                tally.centre_wrote(site, &write);
            }
            (Role::Centre(_), "GoalsShared") => {
                let shared: GoalsShared = kind.schema().decode(body)?;
                tally.central_operations += shared.operations;
            }
            (Role::Scientist(_), "GoalList") => tally.listed(kind.schema().decode(body)?),
            (Role::Scientist(site), "LoopMade") => tally.looped(site, kind.schema().decode(body)?),
            (Role::Hardware(rover), "RoverPose") => {
                let pose: RoverPose = kind.schema().decode(body)?;
                tally.rovers[rover].driven_m = pose.driven_m;
            }
            _ => {}
        }
        Ok(())
    }
}

impl Observer for SurveyMonitor {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: true,
            checkpoints: false,
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        let all = self.all_roles();
        let role = |name: &str| all.get(name).copied().unwrap_or(Role::Other);
        self.roles = run.entities.iter().map(|one| role(&one.name)).collect();
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let failed = |error: farside::encoding::DecodeError| ObserverError(error.to_string());
        let mut course = self.course.lock().unwrap_or_else(PoisonError::into_inner);
        course.note(record.time());
        // Nobody in the run sends a crash.
        let actor = match record.class {
            RecordClass::Crash | RecordClass::Restart => record.receiver,
            _ => record.sender,
        };
        let role = self.roles[actor.index()];
        match (record.class, role, record.kind) {
            (RecordClass::Crash, Role::Planner(rover), _) => {
                course.tally.rovers[rover].is_down = true;
                course.tally.rovers[rover].running = None;
            }
            (RecordClass::Restart, Role::Planner(rover), _) => {
                course.tally.rovers[rover].is_down = false;
            }
            (RecordClass::Sample, role, Some(kind)) => {
                self.sample(&mut course, role, record, kind)
                    .map_err(failed)?;
            }
            (class, Role::Centre(site), Some(kind))
                if class.is_fate() && kind.name() == "GoalListHeld" =>
            {
                let held: GoalListHeld = kind.schema().decode(record.body).map_err(failed)?;
                let centre = course.tally.centres.entry(site).or_default();
                centre.edition = centre.edition.max(held.edition);
            }
            _ => {}
        }
        Ok(Flow::Continue)
    }
}
