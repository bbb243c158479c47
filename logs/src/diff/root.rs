//! Which of what differs at the starts of two runs may be behind a root: what the walk back from a
//! difference ends at.

use farside::record::RecordClass;
use farside::ruling::{MessageId, MessageNumber, RULED};

use super::RootKind;
use super::scenario::Input;
use crate::log::LoggedRecord;

/// What decides about single messages.
const RULINGS: [&str; 3] = ["lose", "deliver", "postpone"];

/// What links are made of, and what they draw with.
const OF_LINKS: [&str; 9] = [
    "links",
    "radios",
    "contacts",
    "world",
    "rover",
    "team",
    "seed",
    "code version",
    "file",
];

/// What is no setting of an actor.
const NOT_OF_ACTORS: [&str; 9] = [
    "crash", "lose", "deliver", "postpone", "links", "radios", "contacts", "log", "until",
];

/// What runs do not depend on.
const WITHOUT_EFFECT: [&str; 2] = ["description", "log"];

/// Everything that a run depends on in which two logs differ.
#[derive(Default)]
pub(super) struct Starts {
    pub(super) inputs: Vec<Input>,
    /// Whether there are topics that are not compared, by which causes may come unseen.
    pub(super) has_unseen: bool,
}

/// The table, or the list, that a key is in.
fn table(input: &Input) -> &str {
    input.key.split(['.', '[']).next().unwrap_or_default()
}

impl Starts {
    /// Adds the files that the runs read, of what differs beside the messages.
    pub(super) fn add_files(&mut self, beside: &[String]) {
        let files = beside.iter().filter(|line| line.starts_with("attachment "));
        self.inputs.extend(files.map(|line| Input {
            key: "file".to_owned(),
            values: [Some(line.clone()), None],
        }));
    }

    /// Those that fit a root; all, if there is none that fits.
    pub(super) fn fitting(
        &self,
        kind: RootKind,
        class: RecordClass,
        both: [Option<&LoggedRecord>; 2],
    ) -> Vec<String> {
        let mut found = self.rulings_of(both);
        let is_ruled = !found.is_empty();
        let within = |tables: &[&str], input: &Input| tables.contains(&table(input));
        let fits = |input: &Input| match (kind, class) {
            _ if within(&WITHOUT_EFFECT, input) => false,
            (RootKind::Verdict, _) if is_ruled => false,
            (RootKind::Verdict, _) => within(&OF_LINKS, input),
            (RootKind::Event, RecordClass::Crash | RecordClass::Restart) => {
                within(&["crash", "fork"], input)
            }
            (RootKind::Event, RecordClass::Change) => {
                within(&["degrade", "fork", "links", "radios", "contacts"], input)
            }
            (RootKind::End, _) => within(&["until"], input),
            (RootKind::Actor, _) if table(input) == "degrade" => self.slows(input),
            (RootKind::Actor | RootKind::Event, _) => !within(&NOT_OF_ACTORS, input),
        };
        found.extend(
            self.inputs
                .iter()
                .filter(|input| fits(input))
                .map(Input::to_string),
        );
        if found.is_empty() {
            found.extend(self.inputs.iter().map(Input::to_string));
        }
        found
    }

    /// Whether a degradation is of processors: of the others actors learn by messages only.
    fn slows(&self, input: &Input) -> bool {
        let entry = |input: &Input| input.key.split_once(']').map(|(entry, _)| entry.to_owned());
        let slow = |input: &&Input| {
            input.key.ends_with("].processors") || input.key.ends_with("].slowdown")
        };
        let mut slow = self.inputs.iter().filter(slow);
        slow.any(|slow| entry(slow) == entry(input))
    }

    /// Whether what differs may have decided otherwise about a message by itself, and not only by what came
    /// before it.
    pub(super) fn may_decide(&self) -> bool {
        self.inputs
            .iter()
            .any(|input| OF_LINKS.contains(&table(input)))
    }

    /// Whether one of the scenarios rules what becomes of a message.
    pub(super) fn rule(&self, both: [Option<&LoggedRecord>; 2]) -> bool {
        let ruled = |record: &LoggedRecord| record.reason == RULED;
        both.into_iter().flatten().any(ruled) || !self.rulings_of(both).is_empty()
    }

    /// The keys that rule what becomes of a message.
    fn rulings_of(&self, both: [Option<&LoggedRecord>; 2]) -> Vec<String> {
        let names_it = |input: &&Input| {
            let is_ruling = RULINGS.contains(&table(input)) && input.key.ends_with("].message");
            let ids = || {
                let texts = input.values.iter().flatten();
                texts.filter_map(|text| text.trim_matches(['"', '\'']).parse::<MessageId>().ok())
            };
            let records = || both.into_iter().flatten();
            is_ruling && ids().any(|id| records().any(|record| is_named(&id, record)))
        };
        let named = self.inputs.iter().filter(names_it);
        named.map(Input::to_string).collect()
    }
}

/// Whether an identity is that of a message. A log does not tell repeats of a key apart.
fn is_named(id: &MessageId, record: &LoggedRecord) -> bool {
    let number = match id.number {
        MessageNumber::Ordinal(ordinal) => ordinal == record.ordinal,
        MessageNumber::Key { key, .. } => record.match_key == Some(key),
    };
    number
        && id.copy == record.copy
        && (&id.sender, &id.receiver, &id.kind) == (&record.sender, &record.receiver, &record.kind)
}
