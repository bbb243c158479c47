//! Comparing a log with a re-execution of its run, record by record, as it goes on.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use farside::record::{Checkpoint, Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{Kind, Report, RunInfo, SimTime};
use serde::Serialize;

use crate::LogError;
use crate::envelope::seconds;
use crate::envelope::{CheckpointRef, Encoder, RecordRef};
use crate::fields::{self, Encoded, FieldDiff, Rules};
use crate::log::{Log, Records, Step};
use crate::schema::Types;
use crate::topics::Topics;

/// The first record in which a log and a re-execution differ.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Mismatch {
    /// The virtual time of the record, in seconds.
    pub time_s: f64,
    /// The same in nanoseconds.
    pub time_ns: u64,
    /// Its topic.
    pub topic: String,
    /// Who sent the message, or whom the event happened to.
    pub sender: String,
    /// Who the message is for.
    pub receiver: String,
    /// The message's place in its flow.
    pub ordinal: u64,
    /// The field that differs, as in `body.pose.x`.
    pub field: String,
    /// Its value in the log.
    pub logged: String,
    /// Its value in the re-execution.
    pub rerun: String,
    /// Why only bytes were compared, where more was wanted; empty otherwise.
    pub why: String,
}

/// What came of comparing a log with a re-execution.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "result", rename_all = "snake_case")]
pub enum VerifyOutcome {
    /// Every record, every checkpoint and the end are the same.
    Same {
        /// How many records of the log were compared.
        records: u64,
        /// How many checkpoints were compared.
        checkpoints: u64,
        /// The digest of both.
        digest: String,
    },
    /// The log is a prefix of a run, and the same as the re-execution as far as it goes.
    Prefix {
        /// How many records of the log were compared.
        records: u64,
        /// How many checkpoints were compared.
        checkpoints: u64,
        /// The virtual time of the log's last record, in seconds.
        last_s: Option<f64>,
        /// The same in nanoseconds.
        last_ns: Option<u64>,
        /// The virtual time of the log's last checkpoint, in seconds: up to there filtered topics
        /// agree too.
        last_checkpoint_s: Option<f64>,
        /// What the log lacks.
        missing: String,
    },
    /// They differ, here first.
    Different {
        /// How many records before this one are the same.
        records: u64,
        /// The first difference.
        first: Box<Mismatch>,
    },
}

/// An observer that compares the run it watches with a log, record by record, and asks the run to
/// stop where they differ or where the log ends.
///
/// ```no_run
/// use farside::{Executor, Simulation};
/// use farside_logs::{Verifier, VerifyOutcome};
///
/// let verifier = Verifier::open("run.mcap")?;
/// let handle = verifier.handle();
/// let mut sim = Simulation::new(7); // built as it was for the log
/// sim.observe(verifier);
/// sim.run(Executor::Inline)?;
/// match handle.outcome()? {
///     VerifyOutcome::Same { records, .. } => println!("all {records} records are the same"),
///     VerifyOutcome::Prefix { missing, .. } => println!("the same as far as it goes: {missing}"),
///     VerifyOutcome::Different { first, .. } => println!("{} differs", first.field),
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Verifier {
    path: PathBuf,
    log: Log,
    records: Records,
    /// What the log goes on with, if it was looked at and not yet compared.
    peeked: Option<Step>,
    encoder: Option<Encoder>,
    envelope: Vec<u8>,
    /// The records since the last checkpoint, to name the one that a packed hash points at.
    window: Vec<Compared>,
    /// A difference, and its place in the window; a filtered record before it may differ too.
    candidate: Option<(usize, Mismatch)>,
    /// A checkpoint of the log that came where the re-execution has another record.
    early_checkpoint: Option<Vec<u8>>,
    compared: u64,
    checkpoints: u64,
    last_ns: Option<u64>,
    last_checkpoint_ns: Option<u64>,
    /// Where the comparison ends and the run goes on, if it is not compared as a whole.
    compared_until: Option<SimTime>,
    done: bool,
    outcome: Shared,
}

type Shared = Arc<Mutex<Option<Result<VerifyOutcome, LogError>>>>;

/// What is remembered of a record of the re-execution.
#[derive(Clone, Copy)]
struct Compared {
    flow: usize,
    time_ns: u64,
    ordinal: u64,
}

/// Gives the outcome of a [`Verifier`] once the run is over.
#[derive(Clone)]
pub struct VerifyHandle {
    path: PathBuf,
    outcome: Shared,
}

impl VerifyHandle {
    /// The outcome. Can be taken once.
    ///
    /// # Errors
    /// If the log could not be read to its end, or the run is not over.
    pub fn outcome(&self) -> Result<VerifyOutcome, LogError> {
        let mut outcome = self.outcome.lock().unwrap_or_else(PoisonError::into_inner);
        outcome.take().unwrap_or_else(|| {
            Err(LogError::Unfinished {
                path: self.path.clone(),
            })
        })
    }
}

impl Verifier {
    /// A verifier against the log at `path`.
    pub fn open(path: impl AsRef<Path>) -> Result<Verifier, LogError> {
        let log = Log::open(path)?;
        Ok(Verifier {
            path: log.path().to_owned(),
            records: log.records()?,
            log,
            peeked: None,
            encoder: None,
            envelope: Vec::new(),
            window: Vec::new(),
            candidate: None,
            early_checkpoint: None,
            compared: 0,
            checkpoints: 0,
            last_ns: None,
            last_checkpoint_ns: None,
            compared_until: None,
            done: false,
            outcome: Shared::default(),
        })
    }

    /// A verifier against what the log at `path` has before `until`; from then on the run goes on and is not
    /// compared. The outcome of a run that is the same so far is [`VerifyOutcome::Prefix`].
    pub fn open_until(path: impl AsRef<Path>, until: SimTime) -> Result<Verifier, LogError> {
        let mut verifier = Verifier::open(path)?;
        verifier.compared_until = Some(until);
        Ok(verifier)
    }

    /// The log: seed, scenario and attachments, from which the run can be built again.
    pub fn log(&self) -> &Log {
        &self.log
    }

    /// A handle to the outcome, to keep when the verifier is given to a simulation.
    pub fn handle(&self) -> VerifyHandle {
        VerifyHandle {
            path: self.path.clone(),
            outcome: self.outcome.clone(),
        }
    }

    fn decide(&mut self, outcome: Result<VerifyOutcome, LogError>) {
        self.done = true;
        let mut held = self.outcome.lock().unwrap_or_else(PoisonError::into_inner);
        held.get_or_insert(outcome);
    }

    fn different(&mut self, first: Mismatch) {
        let records = self.compared;
        self.decide(Ok(VerifyOutcome::Different {
            records,
            first: Box::new(first),
        }));
    }

    fn prefix(&mut self, missing: String) {
        self.decide(Ok(VerifyOutcome::Prefix {
            records: self.compared,
            checkpoints: self.checkpoints,
            last_s: self.last_ns.map(seconds),
            last_ns: self.last_ns,
            last_checkpoint_s: self.last_checkpoint_ns.map(seconds),
            missing,
        }));
    }

    /// What the log goes on with; state samples are never compared.
    fn peek(&mut self) -> Result<Step, LogError> {
        if let Some(step) = self.peeked {
            return Ok(step);
        }
        let mut step = self.records.step()?;
        while step == Step::Sample {
            step = self.records.step()?;
        }
        self.peeked = Some(step);
        Ok(step)
    }

    /// Why the log, which is at its end, is no whole run; `None` if it is one.
    fn missing(&self) -> Option<String> {
        let ending = self.records.ending();
        match ending.text("end") {
            // Where an interrupted run ends depends on the clock on the wall.
            Some("interrupted" | "observer_failed") if ending.cut.is_none() => {
                Some("the run was interrupted".to_owned())
            }
            _ => ending.missing(),
        }
    }

    fn compare(&mut self, record: &Record<'_>) -> Result<(), LogError> {
        let Some(encoder) = &mut self.encoder else {
            return Ok(());
        };
        let index = encoder.flow(record);
        let seen = Compared {
            flow: index,
            time_ns: record.key.time.as_nanos(),
            ordinal: record.ordinal,
        };
        self.window.push(seen);
        if encoder.flows[index].excluded || self.candidate.is_some() {
            return Ok(());
        }
        self.envelope.clear();
        encoder.encode(index, record, &mut self.envelope);
        match self.peek()? {
            Step::Record => {
                let message = self.records.message()?;
                if message.data == self.envelope {
                    self.peeked = None;
                    self.compared += 1;
                    if record.class != RecordClass::InFlight {
                        self.last_ns = Some(seen.time_ns);
                    }
                    return Ok(());
                }
                let logged_class = self.records.record()?.0.class;
                if logged_class == RecordClass::InFlight && record.class != logged_class {
                    return self.log_is_in_flight(seen);
                }
                let mismatch = self.mismatch(seen, record)?;
                self.candidate = Some((self.window.len() - 1, mismatch));
            }
            Step::End => match self.missing() {
                Some(missing) => self.prefix(missing),
                None => {
                    let diff = FieldDiff::new("presence", "the log is over", "a further record");
                    let mismatch = self.at(seen, diff);
                    self.different(mismatch);
                }
            },
            Step::Checkpoint | Step::Sample => {
                // The last checkpoint of a run that was interrupted, or one that comes too early.
                self.early_checkpoint = Some(self.records.message()?.data.to_vec());
                self.peeked = None;
                let over = self.peek()? == Step::End;
                if let Some(missing) = self.missing().filter(|_| over) {
                    self.prefix(missing);
                    return Ok(());
                }
                let diff = FieldDiff::new("presence", "a checkpoint", "a further record");
                let mismatch = self.at(seen, diff);
                self.candidate = Some((self.window.len() - 1, mismatch));
            }
        }
        Ok(())
    }

    /// The log's run was over here, and the re-execution goes on.
    fn log_is_in_flight(&mut self, seen: Compared) -> Result<(), LogError> {
        while self.peek()? != Step::End {
            self.peeked = None;
        }
        match self.missing() {
            Some(missing) => self.prefix(missing),
            None => {
                let diff = FieldDiff::new("presence", "the run was over", "a further record");
                let mismatch = self.at(seen, diff);
                self.different(mismatch);
            }
        }
        Ok(())
    }

    fn at(&self, seen: Compared, diff: FieldDiff) -> Mismatch {
        let flow = self
            .encoder
            .as_ref()
            .map(|encoder| &encoder.flows[seen.flow]);
        let text = |text: Option<&String>| text.cloned().unwrap_or_default();
        Mismatch {
            time_s: seconds(seen.time_ns),
            time_ns: seen.time_ns,
            topic: text(flow.map(|flow| &flow.topic)),
            sender: text(flow.map(|flow| &flow.sender)),
            receiver: text(flow.map(|flow| &flow.receiver)),
            ordinal: seen.ordinal,
            field: diff.field,
            logged: diff.a,
            rerun: diff.b,
            why: diff.why.unwrap_or_default(),
        }
    }

    /// Names the difference between the log's record and the one in [`Verifier::envelope`].
    fn mismatch(&self, seen: Compared, record: &Record<'_>) -> Result<Mismatch, LogError> {
        let (logged, message) = self.records.record()?;
        let diff = RecordRef::read(&self.envelope).and_then(|rerun| {
            let types = kind_types(record.kind.map(|kind| &**kind));
            let bodies = || {
                let a = Encoded::body(logged.body, fields::schema(message.channel));
                let b = Encoded::of(rerun.body, &types);
                fields::protobuf("body", &a, &b, &Rules::default())
            };
            fields::envelopes(&logged, &rerun)
                .or_else(bodies)
                .or_else(|| fields::causes(&logged, &rerun))
        });
        let diff = diff.unwrap_or_else(|| fields::raw("record", message.data, &self.envelope));
        Ok(self.at(seen, diff))
    }

    fn compare_checkpoint(&mut self, checkpoint: &Checkpoint<'_>) -> Result<(), LogError> {
        if self.candidate.is_none() {
            match self.peek()? {
                Step::Checkpoint => {
                    let logged = self.records.checkpoint()?;
                    if logged.digest == checkpoint.digest.to_string() {
                        self.last_checkpoint_ns = Some(logged.time_ns);
                        self.checkpoints += 1;
                        self.peeked = None;
                        self.window.clear();
                        return Ok(());
                    }
                }
                Step::End => {
                    if let Some(missing) = self.missing() {
                        self.prefix(missing);
                        return Ok(());
                    }
                }
                Step::Record | Step::Sample => {
                    let (logged, message) = self.records.record()?;
                    let mismatch = Mismatch {
                        time_s: seconds(logged.key.time_ns),
                        time_ns: logged.key.time_ns,
                        topic: message.channel.topic.clone(),
                        sender: logged.sender.to_owned(),
                        receiver: logged.receiver.to_owned(),
                        ordinal: logged.ordinal,
                        field: "presence".to_owned(),
                        logged: "a further record".to_owned(),
                        rerun: "a checkpoint".to_owned(),
                        why: String::new(),
                    };
                    self.candidate = Some((self.window.len(), mismatch));
                }
            }
        }
        self.narrow(checkpoint)
    }

    /// Finds the first record since the last checkpoint whose hash differs: it may be one that
    /// was filtered, and then it comes before what was found so far.
    fn narrow(&mut self, checkpoint: &Checkpoint<'_>) -> Result<(), LogError> {
        let mut held = self.early_checkpoint.take();
        while held.is_none() && matches!(self.peek()?, Step::Record | Step::Sample) {
            self.peeked = None;
        }
        if held.is_none() && self.peek()? == Step::Checkpoint {
            held = Some(self.records.message()?.data.to_vec());
        }
        let mut earliest = None;
        if let Some(logged) = held.as_deref().and_then(CheckpointRef::read) {
            let differs = |(at, hash): (usize, &u32)| {
                let other = logged.hash(at);
                (other != Some(*hash)).then_some((at, other, *hash))
            };
            earliest = checkpoint.hashes.iter().enumerate().find_map(differs);
        }
        let mismatch = match (self.candidate.take(), earliest) {
            (Some((_, mismatch)), None) => mismatch,
            (Some((at, mismatch)), Some((hash_at, ..))) if at <= hash_at => mismatch,
            (_, Some((at, logged, rerun))) => {
                let hash =
                    |hash: Option<u32>| hash.map_or("nothing".to_owned(), |h| format!("{h:08x}"));
                let diff = FieldDiff::new("digest", hash(logged), hash(Some(rerun)));
                let seen = self.window.get(at).copied().or(self.window.last().copied());
                let seen = seen.unwrap_or(Compared {
                    flow: 0,
                    time_ns: 0,
                    ordinal: 0,
                });
                self.at(seen, diff)
            }
            (None, None) => Mismatch {
                time_s: seconds(checkpoint.key.time.as_nanos()),
                time_ns: checkpoint.key.time.as_nanos(),
                field: "digest".to_owned(),
                logged: "another digest at this checkpoint".to_owned(),
                rerun: checkpoint.digest.to_string(),
                ..Mismatch::default()
            },
        };
        self.different(mismatch);
        Ok(())
    }

    fn compare_end(&mut self, report: &Report) -> Result<(), LogError> {
        if let Some((_, mismatch)) = self.candidate.take() {
            self.different(mismatch);
            return Ok(());
        }
        let further = self.peek()? != Step::End;
        while self.peek()? != Step::End {
            self.peeked = None;
        }
        if let Some(missing) = self.missing() {
            self.prefix(missing);
            return Ok(());
        }
        let ending = self.records.ending();
        let rerun = [
            ("digest", report.digest.to_string()),
            ("end", report.end.name().to_owned()),
            ("end_detail", report.end.detail()),
            ("end_time_ns", report.end_time.as_nanos().to_string()),
        ];
        let mut differing = rerun.into_iter().filter_map(|(field, rerun)| {
            let logged = ending.text(field).unwrap_or_default();
            (logged != rerun).then(|| FieldDiff::new(field, logged, rerun))
        });
        let mut found = differing.next();
        if further && found.is_none() {
            found = Some(FieldDiff::new(
                "presence",
                "a further record",
                "the run is over",
            ));
        }
        match found {
            None => {
                let digest = report.digest.to_string();
                self.decide(Ok(VerifyOutcome::Same {
                    records: self.compared,
                    checkpoints: self.checkpoints,
                    digest,
                }));
            }
            Some(diff) => self.different(Mismatch {
                time_s: seconds(report.end_time.as_nanos()),
                time_ns: report.end_time.as_nanos(),
                field: diff.field,
                logged: diff.a,
                rerun: diff.b,
                ..Mismatch::default()
            }),
        }
        Ok(())
    }

    /// Keeps what went wrong for the handle, and ends the run.
    fn settle(&mut self, result: Result<(), LogError>) -> Result<(), ObserverError> {
        result.map_err(|error| {
            let text = error.to_string();
            self.decide(Err(error));
            ObserverError(text)
        })
    }
}

/// The messages of a kind's schema.
pub(crate) fn kind_types(kind: Option<&Kind>) -> Result<Types, String> {
    let kind = kind.ok_or("the record has no body")?;
    Types::read(
        &kind.schema().file_descriptor_set(),
        &kind.schema().full_name(),
    )
}

impl Observer for Verifier {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: false,
            checkpoints: true,
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        let head = self.log.head();
        let tie = |seed: Option<u64>| seed.map_or("none".to_owned(), |seed| seed.to_string());
        let differing = [
            ("seed", head.seed.to_string(), run.seed.to_string()),
            ("tie_seed", tie(head.tie_seed), tie(run.tie_seed)),
        ];
        let (globs, format) = (head.exclude.clone(), head.format.clone());
        for (field, logged, rerun) in differing {
            if logged != rerun && !self.done {
                self.different(Mismatch {
                    field: field.to_owned(),
                    logged,
                    rerun,
                    ..Mismatch::default()
                });
            }
        }
        match Topics::new(&globs) {
            Ok(exclude) => {
                let encoder = Encoder::new(run.clone(), exclude);
                self.encoder = Some(encoder.of_format(&format));
                Ok(())
            }
            Err(error) => self.settle(Err(error)),
        }
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let is_over = self
            .compared_until
            .is_some_and(|until| record.time() >= until);
        if is_over && !self.done {
            match self.candidate.take() {
                Some((_, mismatch)) => self.different(mismatch),
                None => self.prefix("it is compared up to here".to_owned()),
            }
        }
        match self.done {
            true if is_over => return Ok(Flow::Continue),
            true => return Ok(Flow::Stop("the comparison with the log is over".to_owned())),
            false => {}
        }
        let compared = self.compare(record);
        self.settle(compared).map(|()| Flow::Continue)
    }

    fn checkpoint(&mut self, checkpoint: &Checkpoint<'_>) -> Result<(), ObserverError> {
        if self.done {
            return Ok(());
        }
        let compared = self.compare_checkpoint(checkpoint);
        self.settle(compared)
    }

    fn end(&mut self, report: &Report) -> Result<(), ObserverError> {
        if self.done {
            return Ok(());
        }
        let compared = self.compare_end(report);
        self.settle(compared)
    }
}
