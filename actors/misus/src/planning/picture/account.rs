//! What a planner did in a run and whom it waited for, from the steps that it recorded and what reached it.

use std::collections::BTreeMap;

use farside::encoding::{DecodeError, Schema, SchemaError};
use farside::record::RecordClass;
use farside_actors::system::{Account, Doing, Phase, PictureError, Recorded, Recording};

use crate::planning::messages::{CentralRound, PlanHeld, PlanSettled, PlannerStep};
use crate::planning::shared::CENTRE;

/// The account of a rover's planner, or of the centre's, up to a time; none if it is neither.
pub(in crate::planning) fn account(
    rovers: &[String],
    actor: &str,
    run: &dyn Recording,
    until_ns: Option<u64>,
) -> Result<Option<Account>, PictureError> {
    let rover = rovers.iter().position(|rover| rover == actor);
    if rover.is_none() && actor != CENTRE {
        return Ok(None);
    }
    let schemas = Schemas::new().map_err(|error| {
        PictureError::NotDrawn(format!("what planners say cannot be read: {error}"))
    })?;
    let mut planner = Planner::new(rovers, rover);
    let ending = run.for_each(&mut |record| {
        planner.end_ns = planner.end_ns.max(record.time_ns);
        if record.actor != actor || until_ns.is_some_and(|until_ns| record.time_ns > until_ns) {
            return Ok(());
        }
        planner.meet(record, &schemas).map_err(|error| {
            let (actor, kind) = (record.actor, record.kind);
            PictureError::Unreadable(format!("a {kind} of {actor} cannot be read: {error}"))
        })
    })?;
    let end_ns = ending.time_ns.unwrap_or(planner.end_ns);
    let until_ns = until_ns.map_or(end_ns, |until| until.min(end_ns));
    Ok(Some(planner.account(until_ns)))
}

/// The schemas of what is read.
struct Schemas {
    step: Schema,
    held: Schema,
    settled: Schema,
    round: Schema,
}

impl Schemas {
    fn new() -> Result<Schemas, SchemaError> {
        Ok(Schemas {
            step: Schema::of::<PlannerStep>()?,
            held: Schema::of::<PlanHeld>()?,
            settled: Schema::of::<PlanSettled>()?,
            round: Schema::of::<CentralRound>()?,
        })
    }
}

/// A planner, as far as its run is read.
struct Planner<'r> {
    rovers: &'r [String],
    /// None for the centre's.
    rover: Option<usize>,
    account: Account,
    at_ns: u64,
    /// When the step in hand began.
    began_ns: Option<u64>,
    /// How many steps it has made.
    steps: u32,
    /// By rover, how many steps it is known to have made.
    heard: BTreeMap<u32, u32>,
    assigned: bool,
    is_settled: bool,
    outages: Vec<(u64, Option<u64>)>,
    end_ns: u64,
}

impl<'r> Planner<'r> {
    fn new(rovers: &'r [String], rover: Option<usize>) -> Self {
        Planner {
            rovers,
            rover,
            account: Account::default(),
            at_ns: 0,
            began_ns: None,
            steps: 0,
            heard: BTreeMap::new(),
            assigned: false,
            is_settled: false,
            outages: Vec::new(),
            end_ns: 0,
        }
    }

    fn meet(&mut self, record: &Recorded<'_>, schemas: &Schemas) -> Result<(), DecodeError> {
        let time_ns = record.time_ns;
        match (record.class, record.kind) {
            (RecordClass::Timer, "StepBegins") => {
                self.waits(time_ns);
                self.began_ns = Some(time_ns);
            }
            (RecordClass::Sample, "PlannerStep") => {
                let step: PlannerStep = schemas.step.decode(record.body)?;
                self.made(&step, time_ns);
            }
            (RecordClass::Sample, "PlanSettled") => {
                let settled: PlanSettled = schemas.settled.decode(record.body)?;
                self.waits(time_ns);
                self.is_settled = true;
                let text = format!(
                    "has its plan, {} tasks; {} goals for two rovers left it",
                    settled.plan.len(),
                    settled.withdrawn
                );
                self.push((time_ns, time_ns), Doing::Done, text, Vec::new());
            }
            (RecordClass::Sample, "CentralRound") => {
                let round: CentralRound = schemas.round.decode(record.body)?;
                self.waits(time_ns);
                let text = format!(
                    "has assigned goals in round {}: {} to another rover than before, {} in the pool, {} given up",
                    round.round,
                    round.reassigned,
                    round.pooled.len(),
                    round.deleted.len()
                );
                // Until it is heard of again, that is how it stands.
                self.push((time_ns, time_ns + 1), Doing::Active, text, Vec::new());
                self.at_ns = time_ns + 1;
            }
            (RecordClass::Delivered, "PlanHeld") => {
                let held: PlanHeld = schemas.held.decode(record.body)?;
                self.waits(time_ns);
                let known = self.heard.entry(held.rover).or_default();
                *known = (*known).max(held.steps);
            }
            (RecordClass::Delivered, "GoalsAssigned") => {
                self.waits(time_ns);
                self.assigned = true;
            }
            (RecordClass::Crash, _) => self.outages.push((time_ns, None)),
            (RecordClass::Restart, _) => {
                if let Some((_, end)) = self.outages.last_mut() {
                    end.get_or_insert(time_ns);
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// A step is made.
    fn made(&mut self, step: &PlannerStep, time_ns: u64) {
        let from_ns = self.began_ns.take().unwrap_or(self.at_ns).max(self.at_ns);
        self.steps = step.steps;
        let shed = match step.shed {
            0 => String::new(),
            shed => format!(", and sheds {shed}"),
        };
        let text = format!(
            "makes step {}: plans {} tasks in {} iterations{shed}",
            step.steps,
            step.plan.len(),
            step.iterations
        );
        // A step without a processor takes no time, and is told all the same.
        let until_ns = time_ns.max(from_ns + 1);
        self.push((from_ns, until_ns), Doing::Active, text, Vec::new());
        self.at_ns = until_ns;
    }

    /// Nothing was in hand up to a time: whom it waited for hangs on what it had heard by then.
    fn waits(&mut self, until_ns: u64) {
        if self.began_ns.is_some() || until_ns <= self.at_ns {
            return;
        }
        let from_ns = std::mem::replace(&mut self.at_ns, until_ns);
        let behind = (0..).zip(self.rovers).filter(|(rover, _)| {
            let is_self = self.rover == Some(*rover as usize);
            !is_self && self.heard.get(rover).copied().unwrap_or(0) < self.steps
        });
        let behind: Vec<String> = behind.map(|(_, name)| name.clone()).collect();
        let (doing, text, waits_for) = match (self.rover, self.assigned) {
            _ if self.is_settled => (Doing::Done, "has its plan".to_owned(), Vec::new()),
            (None, _) => (
                Doing::Waiting,
                "waits for what rovers say of their plans".to_owned(),
                Vec::new(),
            ),
            (Some(_), false) => (
                Doing::Waiting,
                "waits for goals".to_owned(),
                vec![CENTRE.to_owned()],
            ),
            (Some(_), true) if behind.is_empty() => (
                Doing::Waiting,
                format!("waits for its next step, after {}", self.steps),
                vec![CENTRE.to_owned()],
            ),
            (Some(_), true) => (
                Doing::Waiting,
                format!("waits for the plans of others at step {}", self.steps),
                behind,
            ),
        };
        self.push((from_ns, until_ns), doing, text, waits_for);
    }

    fn push(
        &mut self,
        (from_ns, until_ns): (u64, u64),
        doing: Doing,
        text: String,
        waits_for: Vec<String>,
    ) {
        self.account.push(Phase {
            from_ns,
            until_ns,
            doing,
            text,
            waits_for,
        });
    }

    fn account(mut self, until_ns: u64) -> Account {
        if let Some(from_ns) = self.began_ns.take() {
            let text = format!("is at step {}", self.steps + 1);
            self.push(
                (from_ns.max(self.at_ns), until_ns),
                Doing::Active,
                text,
                Vec::new(),
            );
            self.at_ns = until_ns;
        }
        self.waits(until_ns);
        self.account.with_outages(self.outages, until_ns)
    }
}
