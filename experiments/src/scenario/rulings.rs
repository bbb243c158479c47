//! The `[[lose]]`, `[[deliver]]` and `[[postpone]]` entries of a scenario: what becomes of single messages,
//! whatever links decide.

use farside::ruling::{MessageId, Ruling, RulingEnd};
use farside::{Report, SimDuration, Simulation};
use farside_actors::{settings, units};

use super::Shared;

settings! {
    /// A `[[lose]]` entry: a message that is lost, whatever its link decides.
    pub struct Lose {
        /// The message: its sender, its receiver, its kind, and its number in that flow or the
        /// protocol's key, as in `node_03,rover_07,Grant,12`.
        pub message: String;
    }
}

settings! {
    /// A `[[deliver]]` entry: a message that arrives, whatever its link decides.
    pub struct Deliver {
        /// The message, as in `node_03,rover_07,Grant,12`.
        pub message: String;
        /// How long after it would have been lost it arrives, where not chance loses it but an
        /// outage or the like.
        pub after: SimDuration [with = "units::duration"] = SimDuration::ZERO;
    }
}

settings! {
    /// A `[[postpone]]` entry: a message that arrives later than its link decides.
    pub struct Postpone {
        /// The message, as in `node_03,rover_07,Grant,12`.
        pub message: String;
        /// How much later.
        pub by: SimDuration [with = "units::duration"] = SimDuration::ZERO;
    }
}

/// An entry: its key, the message as it is written there, and what becomes of it.
struct Entry<'a> {
    key: String,
    message: &'a str,
    ruling: Ruling,
}

fn entries(shared: &Shared) -> Vec<Entry<'_>> {
    let entry = |what: &str, index: usize, message, ruling| Entry {
        key: format!("{what}.{index}"),
        message,
        ruling,
    };
    let lose = shared.lose.iter().enumerate();
    let lose = lose.map(|(at, one)| entry("lose", at, &one.message, Ruling::Lose));
    let deliver = shared.deliver.iter().enumerate();
    let deliver = deliver.map(|(at, one)| {
        let after = one.after;
        entry("deliver", at, &one.message, Ruling::Deliver { after })
    });
    let postpone = shared.postpone.iter().enumerate();
    let postpone =
        postpone.map(|(at, one)| entry("postpone", at, &one.message, Ruling::Delay(one.by)));
    lose.chain(deliver).chain(postpone).collect()
}

/// What is wrong with an entry: the keys from the top, and what was found and expected.
pub(super) struct Mistake {
    pub(super) key: Vec<String>,
    pub(super) message: String,
}

/// Finds what can be found without knowing the actors.
pub(super) fn check(shared: &Shared) -> Result<(), Mistake> {
    for entry in entries(shared) {
        let mistake = |last: &str, message: String| Mistake {
            key: entry
                .key
                .split('.')
                .chain([last])
                .map(str::to_owned)
                .collect(),
            message,
        };
        let parsed: Result<MessageId, _> = entry.message.parse();
        parsed.map_err(|error| mistake("message", error.to_string()))?;
        if entry.ruling == Ruling::Delay(SimDuration::ZERO) {
            let message = "0s: expected a time over zero".to_owned();
            return Err(mistake("by", message));
        }
    }
    Ok(())
}

/// Declares all rulings.
pub(super) fn declare(shared: &Shared, sim: &mut Simulation) {
    for entry in entries(shared) {
        if let Ok(message) = entry.message.parse() {
            sim.rule(message, entry.ruling);
        }
    }
}

/// What a reader of the results has to know: which entries met no message, and which changed nothing.
pub(crate) fn remarks(shared: &Shared, report: &Report) -> Vec<String> {
    let ends = entries(shared).into_iter().zip(&report.rulings);
    let remark = |(entry, end): (Entry<'_>, &RulingEnd)| {
        let Entry { key, message, .. } = entry;
        match end {
            RulingEnd::Applied => None,
            RulingEnd::NeverMet => Some(format!("{key}: no link carried {message}")),
            RulingEnd::WithoutEffect => Some(format!(
                "{key} has no effect: that became of {message} anyway"
            )),
            RulingEnd::Overruled => Some(format!(
                "{key} is overruled: another entry says that {message} arrives, whatever it calls it"
            )),
        }
    };
    ends.filter_map(remark).collect()
}
