//! What a recorded run says of its rovers: where they were and believed to be, what they had, which
//! faults came, and what they learnt.

use farside::encoding::{DecodeError, Schema};
use farside::record::RecordClass;
use farside_actors::figure::ground::Moment;
use farside_actors::rover::{FaultBegins, RoverPose, RoverResources, hardware_name};
use farside_actors::system::{PictureError, Recorded, Recording};

use crate::chart::nothing;
use crate::messages::FieldModel;

/// What a rover has at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Level {
    pub(super) time_ns: u64,
    pub(super) battery_j: f64,
    pub(super) solar_w: f64,
    pub(super) load_w: f64,
    pub(super) memory_bytes: f64,
}

/// A fault that began.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    pub(super) time_ns: u64,
    pub(super) rover: usize,
    pub(super) name: String,
}

/// What is known of all rovers, each in order of time.
pub(super) struct History {
    pub(super) scenario: String,
    pub(super) seed: u64,
    pub(super) names: Vec<String>,
    moments: Vec<Vec<Moment>>,
    /// What rovers had, apart from where they were.
    levels: Vec<Vec<Level>>,
    models: Vec<Vec<(u64, FieldModel)>>,
    faults: Vec<Fault>,
    pub(super) end_ns: u64,
}

/// The schemas of what is read.
struct Schemas {
    pose: Schema,
    resources: Schema,
    model: Schema,
    fault: Schema,
}

impl Schemas {
    fn new() -> Result<Schemas, PictureError> {
        let unusable = |error: farside::encoding::SchemaError| {
            PictureError::NotDrawn(format!("its samples cannot be read: {error}"))
        };
        Ok(Schemas {
            pose: Schema::of::<RoverPose>().map_err(unusable)?,
            resources: Schema::of::<RoverResources>().map_err(unusable)?,
            model: Schema::of::<FieldModel>().map_err(unusable)?,
            fault: Schema::of::<FaultBegins>().map_err(unusable)?,
        })
    }
}

impl History {
    /// Reads it from a recorded run of these rovers.
    pub(super) fn read(run: &dyn Recording, names: Vec<String>) -> Result<History, PictureError> {
        let schemas = Schemas::new()?;
        let count = names.len();
        let hardware: Vec<String> = names.iter().map(|name| hardware_name(name)).collect();
        let mut history = History {
            scenario: run.scenario().to_owned(),
            seed: run.seeds().run,
            names,
            moments: vec![Vec::new(); count],
            levels: vec![Vec::new(); count],
            models: vec![Vec::new(); count],
            faults: Vec::new(),
            end_ns: 0,
        };
        let ending = run.for_each(&mut |record| {
            history.end_ns = history.end_ns.max(record.time_ns);
            let unreadable = |error: DecodeError| {
                let (actor, kind) = (record.actor, record.kind);
                PictureError::Unreadable(format!("a {kind} of {actor} cannot be read: {error}"))
            };
            let of_hardware = hardware.iter().position(|name| name == record.actor);
            if let Some(rover) = of_hardware {
                return history
                    .hardware(rover, record, &schemas)
                    .map_err(unreadable);
            }
            let scientist = history.names.iter().position(|name| name == record.actor);
            if let (Some(rover), RecordClass::Sample, "FieldModel") =
                (scientist, record.class, record.kind)
            {
                let model = schemas.model.decode(record.body).map_err(unreadable)?;
                history.models[rover].push((record.time_ns, model));
            }
            Ok(())
        })?;
        if history.moments.iter().all(Vec::is_empty) {
            return Err(nothing(run, "no states of rovers", "RoverPose"));
        }
        history.end_ns = ending.time_ns.unwrap_or(history.end_ns);
        Ok(history)
    }

    fn hardware(
        &mut self,
        rover: usize,
        record: &Recorded<'_>,
        schemas: &Schemas,
    ) -> Result<(), DecodeError> {
        let time_ns = record.time_ns;
        match (record.class, record.kind) {
            (RecordClass::Sample, "RoverPose") => {
                let pose: RoverPose = schemas.pose.decode(record.body)?;
                self.moments[rover].push(Moment::new(time_ns, &pose));
            }
            (RecordClass::Sample, "RoverResources") => {
                let resources: RoverResources = schemas.resources.decode(record.body)?;
                self.levels[rover].push(Level {
                    time_ns,
                    battery_j: resources.energy.stored_j,
                    solar_w: resources.solar_w,
                    load_w: resources.load_w,
                    memory_bytes: resources.memory_used_bytes as f64,
                });
            }
            (RecordClass::Told, "FaultBegins") => {
                let fault: FaultBegins = schemas.fault.decode(record.body)?;
                let name = fault.kind.name().to_owned();
                self.faults.push(Fault {
                    time_ns,
                    rover,
                    name,
                });
            }
            _ => {}
        }
        Ok(())
    }

    /// A rover's moments up to a time.
    pub(super) fn until(&self, rover: usize, at_ns: u64) -> &[Moment] {
        Moment::until(&self.moments[rover], at_ns)
    }

    /// What a rover had in a time span.
    pub(super) fn levels(&self, rover: usize, from_ns: u64, to_ns: u64) -> &[Level] {
        let all = &self.levels[rover];
        let from = all.partition_point(|level| level.time_ns < from_ns);
        &all[from..all.partition_point(|level| level.time_ns <= to_ns)]
    }

    /// What a rover had learnt by a time.
    pub(super) fn model(&self, rover: usize, at_ns: u64) -> Option<&FieldModel> {
        let all = &self.models[rover];
        let before = all.partition_point(|(time_ns, _)| *time_ns <= at_ns);
        before.checked_sub(1).map(|last| &all[last].1)
    }

    /// How many faults had begun by a time.
    pub(super) fn faults_until(&self, at_ns: u64) -> usize {
        self.faults
            .iter()
            .filter(|fault| fault.time_ns <= at_ns)
            .count()
    }

    /// The faults of a rover in a time span.
    pub(super) fn faults_of(&self, rover: usize, from_ns: u64, to_ns: u64) -> Vec<&Fault> {
        let within =
            |fault: &&Fault| fault.rover == rover && (from_ns..=to_ns).contains(&fault.time_ns);
        self.faults.iter().filter(within).collect()
    }
}
