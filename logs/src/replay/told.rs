//! What came of a replay, for people and programs: fields for bytes, names for numbers.

use std::collections::BTreeMap;
use std::sync::Arc;

use farside::replay::{Difference, Output, OutputClass, ReplayReport, Step, Tally};
use farside::{Kind, RunInfo};
use serde::Serialize;

use crate::channel::SchemaInfo;
use crate::envelope::seconds;
use crate::fields::{self, Encoded, FieldDiff, Rules};
use crate::schema::Types;
use crate::shown::Seconds;
use crate::verify::kind_types;

/// What bodies are read with.
pub(super) struct Schemas<'a, S> {
    pub(super) info: &'a RunInfo,
    /// Of state samples, by kind.
    pub(super) samples: &'a BTreeMap<String, S>,
}

/// A schema of state samples.
pub(super) trait SampleSchema {
    fn types(&self) -> Result<Types, String>;
}

impl SampleSchema for Arc<SchemaInfo> {
    fn types(&self) -> Result<Types, String> {
        Types::read(&self.data, &self.name)
    }
}

impl SampleSchema for Arc<Kind> {
    fn types(&self) -> Result<Types, String> {
        kind_types(Some(self))
    }
}

impl<S: SampleSchema> Schemas<'_, S> {
    fn of(&self, difference: &Difference) -> Result<Types, String> {
        let kind = &difference.kind;
        match difference.class {
            OutputClass::Message | OutputClass::Change => {
                let mut kinds = self.info.kinds.iter();
                kind_types(kinds.find(|known| known.name() == kind).map(|kind| &**kind))
            }
            OutputClass::Sample => match self.samples.get(kind) {
                Some(schema) => schema.types(),
                None => Err("the log has no samples of this kind".to_owned()),
            },
            OutputClass::Stop | OutputClass::Fault => Err("it is a text".to_owned()),
        }
    }
}

/// One side of an output that differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OutputSide {
    /// When, in nanoseconds: for a message, when it was sent.
    pub time_ns: u64,
    /// Its place in the flow (sender, receiver, kind).
    pub ordinal: u64,
    /// The protocol's own identity for the message, if it gave one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub match_key: Option<String>,
}

/// An event of an actor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReplayedStep {
    /// When, in nanoseconds.
    pub time_ns: u64,
    /// What happened: `delivered`, `timer`, `start`, ...
    pub event: &'static str,
    /// To whom.
    pub actor: String,
    /// Who sent the message; else the actor, or `@control`.
    pub sender: String,
    /// The message's kind; empty where there is none.
    pub kind: String,
    /// The message's place in its flow.
    pub ordinal: u64,
}

/// The first output that is not as recorded.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReplayedOutput {
    /// When, in seconds: the earlier one of the two.
    pub time_s: f64,
    /// The same in nanoseconds.
    pub time_ns: u64,
    /// Whose output it is.
    pub actor: String,
    /// `message`, `change`, `sample`, `stop` or `fault`.
    pub output: &'static str,
    /// The kind of the message, change or sample.
    pub kind: String,
    /// Who the message is for, or the link that is changed.
    pub receiver: String,
    /// The field that differs, as in `body.pose.x`; `presence` if only one of the two is there.
    pub field: String,
    /// What is recorded.
    pub expected: String,
    /// What the replay has.
    pub actual: String,
    /// The recorded output; none if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recorded: Option<OutputSide>,
    /// That of the replay; none if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub replayed: Option<OutputSide>,
    /// The event in which it was made, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub event: Option<ReplayedStep>,
    /// The input that led to that event, where it is known: itself, or what a timer goes back to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cause: Option<ReplayedStep>,
    /// Why only bytes were compared, where more was wanted; empty otherwise.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub why: String,
}

/// How many outputs of one kind are as recorded.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct OutputCount {
    /// `message`, `change`, `sample`, `stop` or `fault`.
    pub output: &'static str,
    /// The kind of the message, change or sample.
    pub kind: String,
    /// As recorded.
    pub same: u64,
    /// At another time, or with another content.
    pub changed: u64,
    /// Recorded only.
    pub missing: u64,
    /// Of the replay only.
    pub extra: u64,
    /// Whose fate is not in the record.
    pub unsettled: u64,
}

/// What came of a replay.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ReplayOutcome {
    /// How many messages and other things came to the actors from the record.
    pub inputs: u64,
    /// Events of the actors in the replay.
    pub steps: u64,
    /// Events of the actors in the record.
    pub recorded_steps: u64,
    /// Instants at which the two have another number of events.
    pub differing_instants: u64,
    /// The first of these, in seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_differing_instant_s: Option<f64>,
    /// All outputs as recorded.
    pub same: u64,
    /// At another time, or with another content.
    pub changed: u64,
    /// Recorded only.
    pub missing: u64,
    /// Of the replay only.
    pub extra: u64,
    /// Of the replay, with a fate that the record ends before: not compared.
    pub unsettled: u64,
    /// The same by kind.
    pub kinds: Vec<OutputCount>,
    /// Outputs that the log does not hold, as `class kind`, and were not compared.
    pub not_compared: Vec<String>,
    /// The first output that differs.
    pub first: Option<ReplayedOutput>,
    /// The fault that the replay ended with, if it did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault: Option<String>,
    /// How far it went, in nanoseconds.
    pub until_ns: u64,
    /// What the log lacks of a whole run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missing_record: Option<String>,
    /// The actors asked for what links charged, which is not known: nothing here counts.
    #[serde(skip)]
    pub needs_charges: bool,
}

impl ReplayOutcome {
    /// How many outputs differ.
    pub fn differing(&self) -> u64 {
        self.changed + self.missing + self.extra
    }

    pub(super) fn of<S: SampleSchema>(report: &ReplayReport, schemas: &Schemas<'_, S>) -> Self {
        let mut kinds: BTreeMap<(OutputClass, &str), Tally> = BTreeMap::new();
        let mut not_compared = Vec::new();
        for kind in &report.kinds {
            if kind.left_out {
                let name = format!("{} {}", kind.class.name(), kind.kind);
                not_compared.push(name.trim_end().to_owned());
                continue;
            }
            let tally = kinds.entry((kind.class, &kind.kind)).or_default();
            tally.same += kind.tally.same;
            tally.changed += kind.tally.changed;
            tally.missing += kind.tally.missing;
            tally.extra += kind.tally.extra;
            tally.unsettled += kind.tally.unsettled;
        }
        not_compared.sort_unstable();
        not_compared.dedup();
        let counted = |((class, kind), tally): (&(OutputClass, &str), &Tally)| OutputCount {
            output: class.name(),
            kind: (*kind).to_owned(),
            same: tally.same,
            changed: tally.changed,
            missing: tally.missing,
            extra: tally.extra,
            unsettled: tally.unsettled,
        };
        let total = report.total();
        let first_instant = report.steps.first.map(|at| seconds(at.as_nanos()));
        ReplayOutcome {
            inputs: report.inputs,
            steps: report.steps.replayed,
            recorded_steps: report.steps.recorded,
            differing_instants: report.steps.differing,
            first_differing_instant_s: first_instant,
            same: total.same,
            changed: total.changed,
            missing: total.missing,
            extra: total.extra,
            unsettled: total.unsettled,
            kinds: kinds.iter().map(counted).collect(),
            not_compared,
            first: report.first.as_ref().map(|first| told(first, schemas)),
            fault: report.fault.clone(),
            until_ns: report.until.as_nanos(),
            missing_record: None,
            needs_charges: report.needs_charges,
        }
    }
}

fn told<S: SampleSchema>(first: &Difference, schemas: &Schemas<'_, S>) -> ReplayedOutput {
    let types = schemas.of(first);
    let field = match (&first.expected, &first.actual) {
        (Some(expected), Some(actual)) => match first.field {
            "sent" => FieldDiff::new("sent", at(expected), at(actual)),
            "match_key" => FieldDiff::new("match_key", key(expected), key(actual)),
            _ => bodies(expected, actual, &types),
        },
        (Some(expected), None) => FieldDiff::new("presence", shown(expected, &types), "nothing"),
        (None, Some(actual)) => FieldDiff::new("presence", "nothing", shown(actual, &types)),
        (None, None) => FieldDiff::new("presence", "nothing", "nothing"),
    };
    let side = |output: &Output| OutputSide {
        time_ns: output.time.as_nanos(),
        ordinal: output.ordinal,
        match_key: output.match_key.map(|key| key.to_string()),
    };
    let time_ns = first.time().as_nanos();
    ReplayedOutput {
        time_s: seconds(time_ns),
        time_ns,
        actor: first.actor.clone(),
        output: first.class.name(),
        kind: first.kind.clone(),
        receiver: first.receiver.clone(),
        field: field.field,
        expected: field.a,
        actual: field.b,
        recorded: first.expected.as_ref().map(side),
        replayed: first.actual.as_ref().map(side),
        event: first.event.as_ref().map(step),
        cause: first.input.as_ref().map(step),
        why: field.why.unwrap_or_default(),
    }
}

fn at(output: &Output) -> String {
    format!("{} s", Seconds(output.time.as_nanos()))
}

fn key(output: &Output) -> String {
    output
        .match_key
        .map_or("absent".to_owned(), |key| key.to_string())
}

fn bodies(expected: &Output, actual: &Output, types: &Result<Types, String>) -> FieldDiff {
    let (Some(a), Some(b)) = (&expected.body, &actual.body) else {
        return FieldDiff::new("body", "one content", "another")
            .because("too much waited to be compared to keep it");
    };
    if let (Err(_), Ok(x), Ok(y)) = (types, std::str::from_utf8(a), std::str::from_utf8(b)) {
        return FieldDiff::texts("text", x, y);
    }
    let (x, y) = (Encoded::of(a, types), Encoded::of(b, types));
    fields::protobuf("body", &x, &y, &Rules::default()).unwrap_or_else(|| fields::raw("body", a, b))
}

fn shown(output: &Output, types: &Result<Types, String>) -> String {
    let Some(body) = &output.body else {
        return format!("one at {}", at(output));
    };
    match Encoded::of(body, types).shown() {
        Some(shown) => shown,
        None => String::from_utf8_lossy(body).chars().take(200).collect(),
    }
}

fn step(step: &Step) -> ReplayedStep {
    ReplayedStep {
        time_ns: step.time.as_nanos(),
        event: step.class.name(),
        actor: step.actor.clone(),
        sender: step.sender.clone(),
        kind: step.kind.clone(),
        ordinal: step.ordinal,
    }
}
