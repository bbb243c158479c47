//! What a recorded run says of its planners: each step of each rover, each round of the centre.

use farside::encoding::{DecodeError, Schema, SchemaError};
use farside::record::RecordClass;
use farside_actors::system::{PictureError, Recording};

use crate::chart::nothing;
use crate::planning::messages::{CentralRound, PlanSettled, PlannerStep};
use crate::planning::monitor::Tally;
use crate::planning::shared::CENTRE;

/// What is known of all planners, each in order of time \[ns\].
pub(super) struct History {
    pub(super) scenario: String,
    pub(super) seed: u64,
    /// By rover.
    pub(super) steps: Vec<Vec<(u64, PlannerStep)>>,
    /// By rover.
    pub(super) settled: Vec<Option<(u64, PlanSettled)>>,
    pub(super) rounds: Vec<(u64, CentralRound)>,
    pub(super) end_ns: u64,
}

impl History {
    /// Reads it from a recorded run of these rovers.
    pub(super) fn read(run: &dyn Recording, rovers: &[String]) -> Result<History, PictureError> {
        let unusable = |error: SchemaError| {
            PictureError::NotDrawn(format!("its samples cannot be read: {error}"))
        };
        let step = Schema::of::<PlannerStep>().map_err(unusable)?;
        let settled = Schema::of::<PlanSettled>().map_err(unusable)?;
        let round = Schema::of::<CentralRound>().map_err(unusable)?;
        let mut history = History {
            scenario: run.scenario().to_owned(),
            seed: run.seeds().run,
            steps: vec![Vec::new(); rovers.len()],
            settled: vec![None; rovers.len()],
            rounds: Vec::new(),
            end_ns: 0,
        };
        let ending = run.for_each(&mut |record| {
            let time_ns = record.time_ns;
            history.end_ns = history.end_ns.max(time_ns);
            if record.class != RecordClass::Sample {
                return Ok(());
            }
            let unreadable = |error: DecodeError| {
                let (actor, kind) = (record.actor, record.kind);
                PictureError::Unreadable(format!("a {kind} of {actor} cannot be read: {error}"))
            };
            let rover = rovers.iter().position(|rover| rover == record.actor);
            match (record.kind, rover) {
                ("PlannerStep", Some(rover)) => {
                    let made = step.decode(record.body).map_err(unreadable)?;
                    history.steps[rover].push((time_ns, made));
                }
                ("PlanSettled", Some(rover)) => {
                    let plan = settled.decode(record.body).map_err(unreadable)?;
                    history.settled[rover] = Some((time_ns, plan));
                }
                ("CentralRound", None) if record.actor == CENTRE => {
                    let made = round.decode(record.body).map_err(unreadable)?;
                    history.rounds.push((time_ns, made));
                }
                _ => {}
            }
            Ok(())
        })?;
        if history.steps.iter().all(Vec::is_empty) {
            return Err(nothing(run, "no steps of planners", "PlannerStep"));
        }
        history.end_ns = ending.time_ns.unwrap_or(history.end_ns);
        Ok(history)
    }

    /// What was known at a time.
    pub(super) fn until(&self, at_ns: u64) -> Tally {
        let steps = self.steps.iter().map(|steps| {
            let until = steps.partition_point(|(time_ns, _)| *time_ns <= at_ns);
            steps[..until]
                .iter()
                .map(|(_, step)| step.clone())
                .collect()
        });
        let settled = self.settled.iter().map(|settled| {
            let settled = settled.as_ref().filter(|(time_ns, _)| *time_ns <= at_ns);
            settled.map(|(_, plan)| plan.clone())
        });
        Tally {
            steps: steps.collect(),
            settled: settled.collect(),
            ..Tally::default()
        }
    }

    /// The centre's last round until a time.
    pub(super) fn round(&self, at_ns: u64) -> Option<&CentralRound> {
        let until = self
            .rounds
            .partition_point(|(time_ns, _)| *time_ns <= at_ns);
        until.checked_sub(1).map(|last| &self.rounds[last].1)
    }

    /// When anything changed until a time, in order, each once.
    pub(super) fn times_ns(&self, at_ns: u64) -> Vec<u64> {
        let steps = self.steps.iter().flatten().map(|(time_ns, _)| *time_ns);
        let settled = self.settled.iter().flatten().map(|(time_ns, _)| *time_ns);
        let rounds = self.rounds.iter().map(|(time_ns, _)| *time_ns);
        let mut times: Vec<u64> = steps.chain(settled).chain(rounds).collect();
        times.retain(|time_ns| *time_ns <= at_ns);
        times.sort_unstable();
        times.dedup();
        times
    }
}
