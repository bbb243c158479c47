//! What a recorded run says of a survey: plans, activities, resources, places, crashes, who heard whom, and what was
//! written of goals.

use std::collections::{BTreeMap, BTreeSet};

use farside::encoding::{DecodeError, Schema, SchemaError};
use farside::record::RecordClass;
use farside_actors::figure::ground::Moment;
use farside_actors::rover::{FaultBegins, RoverPose, RoverResources, hardware_name};
use farside_actors::system::{PictureError, Recorded, Recording};
use serde::de::DeserializeOwned;

use crate::shac::{CentreWrite, GoalAck, GoalAssign, GoalDigest, GoalStatus, OwnerWrite, Party};
use crate::sharing::Names;
use crate::survey::messages::{
    ActivityBegan, ActivityEnd, ActivityEnded, GoalList, PlanMade, PlannedActivity,
};
use crate::survey::shared::SCIENTIST;

/// An activity that was begun.
#[derive(Clone, Debug)]
pub(super) struct Carried {
    /// As it was planned when it began.
    pub(super) planned: PlannedActivity,
    pub(super) began_ns: u64,
    /// When and how it ended; none if that was not recorded.
    pub(super) ended: Option<(u64, ActivityEnd)>,
}

/// What a rover has at an instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Level {
    pub(super) time_ns: u64,
    pub(super) battery_j: f64,
    pub(super) memory_bits: f64,
}

/// What is known of a rover, each in order of time.
#[derive(Debug, Default)]
pub(super) struct RoverHistory {
    pub(super) plans: Vec<(u64, PlanMade)>,
    pub(super) carried: Vec<Carried>,
    pub(super) levels: Vec<Level>,
    pub(super) moments: Vec<Moment>,
    /// How far the wheels went \[m\].
    pub(super) driven_m: Vec<(u64, f64)>,
    pub(super) faults: Vec<(u64, String)>,
    /// When a message of a centre came to it.
    pub(super) hears_ns: Vec<u64>,
    /// When a status of it came to a centre.
    pub(super) heard_ns: Vec<u64>,
    pub(super) outages: Outages,
}

/// When a host was down: when one of its actors was.
#[derive(Debug, Default)]
pub(super) struct Outages {
    down: BTreeSet<String>,
    /// From when to when; none is to the end.
    pub(super) spans_ns: Vec<(u64, Option<u64>)>,
}

/// What was said of goals.
#[derive(Debug)]
pub(super) enum News {
    List(GoalList),
    Owner(usize, OwnerWrite),
    Centre(u32, CentreWrite),
}

/// Who takes part, by the names of actors.
pub(super) struct Cast {
    rovers: Vec<String>,
    roles: BTreeMap<String, Role>,
}

#[derive(Clone, Copy, Debug)]
enum Role {
    Planner(usize),
    Centre(u32),
    Hardware(usize),
    FieldScientist(usize),
    LeadScientist,
}

impl Cast {
    /// Of a team, whose parties have these names.
    pub(super) fn new(rovers: Vec<String>, parties: &Names) -> Cast {
        let of_party = parties.iter().map(|(party, name)| match *party {
            Party::Owner(rover) => (name.clone(), Role::Planner(rover as usize)),
            Party::Centre(site) => (name.clone(), Role::Centre(site)),
        });
        let mut roles: BTreeMap<String, Role> = of_party.collect();
        for (rover, name) in rovers.iter().enumerate() {
            roles.insert(hardware_name(name), Role::Hardware(rover));
            roles.insert(name.clone(), Role::FieldScientist(rover));
        }
        roles.insert(SCIENTIST.to_owned(), Role::LeadScientist);
        Cast { rovers, roles }
    }
}

/// What is known of a survey.
pub(super) struct History {
    pub(super) scenario: String,
    pub(super) seed: u64,
    pub(super) names: Vec<String>,
    pub(super) rovers: Vec<RoverHistory>,
    /// Of centres, by their site.
    pub(super) centres: BTreeMap<u32, Outages>,
    /// In order of time \[ns\].
    pub(super) news: Vec<(u64, News)>,
    pub(super) end_ns: u64,
    /// Whether the recording ends before the run.
    pub(super) is_cut: bool,
}

/// How what is read is decoded, by kind.
struct Schemas(BTreeMap<&'static str, Schema>);

impl Schemas {
    fn new() -> Result<Schemas, SchemaError> {
        Ok(Schemas(BTreeMap::from([
            ("PlanMade", Schema::of::<PlanMade>()?),
            ("ActivityBegan", Schema::of::<ActivityBegan>()?),
            ("ActivityEnded", Schema::of::<ActivityEnded>()?),
            ("OwnerWrite", Schema::of::<OwnerWrite>()?),
            ("CentreWrite", Schema::of::<CentreWrite>()?),
            ("GoalList", Schema::of::<GoalList>()?),
            ("RoverPose", Schema::of::<RoverPose>()?),
            ("RoverResources", Schema::of::<RoverResources>()?),
            ("FaultBegins", Schema::of::<FaultBegins>()?),
            ("GoalAssign", Schema::of::<GoalAssign>()?),
            ("GoalAck", Schema::of::<GoalAck>()?),
            ("GoalStatus", Schema::of::<GoalStatus>()?),
            ("GoalDigest", Schema::of::<GoalDigest>()?),
        ])))
    }

    fn decode<T: DeserializeOwned>(&self, record: &Recorded<'_>) -> Result<T, DecodeError> {
        self.0[record.kind].decode(record.body)
    }
}

impl History {
    /// Reads it from a recorded run.
    pub(super) fn read(run: &dyn Recording, cast: Cast) -> Result<History, PictureError> {
        let schemas = Schemas::new().map_err(|error| {
            PictureError::NotDrawn(format!("its samples cannot be read: {error}"))
        })?;
        let mut history = History {
            scenario: run.scenario().to_owned(),
            seed: run.seeds().run,
            rovers: cast
                .rovers
                .iter()
                .map(|_| RoverHistory::default())
                .collect(),
            names: cast.rovers,
            centres: BTreeMap::new(),
            news: Vec::new(),
            end_ns: 0,
            is_cut: false,
        };
        let ending = run.for_each(&mut |record| {
            history.end_ns = history.end_ns.max(record.time_ns);
            let Some(role) = cast.roles.get(record.actor) else {
                return Ok(());
            };
            history.note(*role, record, &schemas).map_err(|error| {
                let (actor, kind) = (record.actor, record.kind);
                PictureError::Unreadable(format!("a {kind} of {actor} cannot be read: {error}"))
            })
        })?;
        history.is_cut = ending.time_ns.is_none();
        history.end_ns = ending.time_ns.unwrap_or(history.end_ns);
        Ok(history)
    }

    fn note(
        &mut self,
        role: Role,
        record: &Recorded<'_>,
        schemas: &Schemas,
    ) -> Result<(), DecodeError> {
        match record.class {
            RecordClass::Crash | RecordClass::Restart => {
                let outages = match role {
                    Role::Planner(rover) | Role::Hardware(rover) | Role::FieldScientist(rover) => {
                        &mut self.rovers[rover].outages
                    }
                    Role::Centre(site) => self.centres.entry(site).or_default(),
                    Role::LeadScientist => return Ok(()),
                };
                outages.note(record);
                Ok(())
            }
            RecordClass::Sample => self.sample(role, record, schemas),
            RecordClass::Delivered => self.delivered(role, record, schemas),
            RecordClass::Told => {
                if let (Role::Hardware(rover), "FaultBegins") = (role, record.kind) {
                    let fault: FaultBegins = schemas.decode(record)?;
                    let name = fault.kind.name().to_owned();
                    self.rovers[rover].faults.push((record.time_ns, name));
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn sample(
        &mut self,
        role: Role,
        record: &Recorded<'_>,
        schemas: &Schemas,
    ) -> Result<(), DecodeError> {
        let time_ns = record.time_ns;
        match (role, record.kind) {
            (Role::Planner(rover), "PlanMade") => {
                let plan = schemas.decode(record)?;
                self.rovers[rover].plans.push((time_ns, plan));
            }
            (Role::Planner(rover), "ActivityBegan") => {
                let began: ActivityBegan = schemas.decode(record)?;
                self.rovers[rover].carried.push(Carried {
                    planned: began.planned,
                    began_ns: time_ns,
                    ended: None,
                });
            }
            (Role::Planner(rover), "ActivityEnded") => {
                let ended: ActivityEnded = schemas.decode(record)?;
                self.rovers[rover].end(time_ns, &ended);
            }
            (Role::Planner(rover), "OwnerWrite") => {
                let write = schemas.decode(record)?;
                self.news.push((time_ns, News::Owner(rover, write)));
            }
            (Role::Centre(site), "CentreWrite") => {
                let write = schemas.decode(record)?;
                self.news.push((time_ns, News::Centre(site, write)));
            }
            (Role::LeadScientist, "GoalList") => {
                self.news
                    .push((time_ns, News::List(schemas.decode(record)?)));
            }
            (Role::Hardware(rover), "RoverPose") => {
                let pose: RoverPose = schemas.decode(record)?;
                let rover = &mut self.rovers[rover];
                rover.moments.push(Moment::new(time_ns, &pose));
                rover.driven_m.push((time_ns, pose.driven_m));
            }
            (Role::Hardware(rover), "RoverResources") => {
                let resources: RoverResources = schemas.decode(record)?;
                self.rovers[rover].levels.push(Level {
                    time_ns,
                    battery_j: resources.energy.stored_j,
                    memory_bits: 8.0 * resources.memory_used_bytes as f64,
                });
            }
            _ => {}
        }
        Ok(())
    }

    /// Who heard whom.
    fn delivered(
        &mut self,
        role: Role,
        record: &Recorded<'_>,
        schemas: &Schemas,
    ) -> Result<(), DecodeError> {
        let from = match record.kind {
            "GoalAssign" => schemas.decode::<GoalAssign>(record)?.from,
            "GoalAck" => schemas.decode::<GoalAck>(record)?.from,
            "GoalStatus" => schemas.decode::<GoalStatus>(record)?.from,
            "GoalDigest" => schemas.decode::<GoalDigest>(record)?.from,
            _ => return Ok(()),
        };
        match (role, from) {
            (Role::Planner(rover), Party::Centre(_)) => {
                self.rovers[rover].hears_ns.push(record.time_ns);
            }
            (Role::Centre(_), Party::Owner(rover)) => {
                if let Some(rover) = self.rovers.get_mut(rover as usize) {
                    rover.heard_ns.push(record.time_ns);
                }
            }
            _ => {}
        }
        Ok(())
    }
}

impl RoverHistory {
    /// What was begun has ended. What is broken off before its begin was noted is noted with both.
    fn end(&mut self, time_ns: u64, ended: &ActivityEnded) {
        let open = self
            .carried
            .last_mut()
            .filter(|last| last.ended.is_none() && last.planned.activity == ended.planned.activity);
        match open {
            Some(last) => last.ended = Some((time_ns, ended.end)),
            None => self.carried.push(Carried {
                planned: ended.planned,
                began_ns: ended.began.as_nanos().min(time_ns),
                ended: Some((time_ns, ended.end)),
            }),
        }
    }

    /// When what was begun had ended, at the latest at `to_ns`. What a crash cut off had ended with it.
    pub(super) fn ended_ns(&self, carried: &Carried, to_ns: u64) -> u64 {
        let crashes = self.outages.spans_ns.iter().map(|(down_ns, _)| *down_ns);
        let crash = crashes.filter(|down_ns| *down_ns >= carried.began_ns).min();
        let ended = carried.ended.map(|(ended_ns, _)| ended_ns);
        ended.or(crash).unwrap_or(to_ns)
    }

    /// The plan that is in force at a time; none while it is down.
    pub(super) fn plan_at(&self, at_ns: u64) -> Option<&(u64, PlanMade)> {
        if self.outages.within((at_ns, at_ns + 1)).next().is_some() {
            return None;
        }
        let made = self.plans.partition_point(|(time_ns, _)| *time_ns <= at_ns);
        made.checked_sub(1).map(|last| &self.plans[last])
    }

    /// What it has at a time, as last recorded.
    pub(super) fn level_at(&self, at_ns: u64) -> Option<Level> {
        let until = self.levels.partition_point(|level| level.time_ns <= at_ns);
        until.checked_sub(1).map(|last| self.levels[last])
    }
}

impl Outages {
    fn note(&mut self, record: &Recorded<'_>) {
        let was_down = !self.down.is_empty();
        if record.class == RecordClass::Crash {
            self.down.insert(record.actor.to_owned());
        } else {
            self.down.remove(record.actor);
        }
        match (was_down, self.down.is_empty()) {
            (false, false) => self.spans_ns.push((record.time_ns, None)),
            (true, true) => {
                if let Some((_, to_ns)) = self.spans_ns.last_mut() {
                    *to_ns = Some(record.time_ns);
                }
            }
            _ => {}
        }
    }

    /// Those that have to do with a span of time, cut to it.
    pub(super) fn within(&self, (from_ns, to_ns): (u64, u64)) -> impl Iterator<Item = (u64, u64)> {
        self.spans_ns.iter().filter_map(move |(down_ns, up_ns)| {
            let (down_ns, up_ns) = ((*down_ns).max(from_ns), up_ns.unwrap_or(to_ns).min(to_ns));
            (down_ns < up_ns).then_some((down_ns, up_ns))
        })
    }
}
