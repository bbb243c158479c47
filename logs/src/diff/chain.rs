//! Chains of causes: from an event of a log back to a start.

use std::path::Path;

use farside::ruling::MessageId;

use super::Limits;
use super::entry::{Mode, Names};
use super::index::Index;
use crate::LogError;
use crate::channel::ChannelInfo;
use crate::envelope::RecordRef;
use crate::log::{LoggedKey, LoggedRecord};
use crate::messages::find_messages;
use crate::topics::Topics;
use farside::record::RecordClass;

/// Steps back along a chain before it is given up: a bound on damage, far above any real chain.
const CHAIN_LIMIT: u64 = 10_000_000;

/// One step back along a chain.
pub(super) enum Step<'a> {
    /// The event that caused the one before.
    Event(&'a RecordRef<'a>, &'a ChannelInfo),
    /// It is not in the log, and the chain ends.
    Unknown(LoggedKey),
}

/// Follows causes back to a start, in a log that was read to its end.
pub(super) fn walk(
    index: &mut Index<'_>,
    names: &mut Names,
    mut next: Option<LoggedKey>,
    mut visit: impl FnMut(Step<'_>),
) -> Result<(), LogError> {
    let mut steps = 0;
    let mut before = u32::MAX;
    while let Some(key) = next.take() {
        // A cause comes before its effect: a log that says otherwise is damaged.
        let found = index.event(&key.to_ref(), names)?;
        let found = found.filter(|entry| entry.at < before && steps < CHAIN_LIMIT);
        let Some(entry) = found else {
            visit(Step::Unknown(key));
            break;
        };
        before = entry.at;
        let message = index.scanner.message_at(entry.position, entry.channel)?;
        let Some(record) = RecordRef::read(message.data) else {
            break;
        };
        next = record.cause.map(|key| LoggedKey::of(&key));
        steps += 1;
        visit(Step::Event(&record, message.channel));
    }
    Ok(())
}

/// An event that led to a message, or to another such event.
#[derive(Clone, Debug, PartialEq)]
pub struct CausedBy {
    /// The event; without its body.
    pub record: LoggedRecord,
    /// How many events of the same timer, one the cause of the next, come before this one in a row; they
    /// are not listed.
    pub repeats: u64,
}

/// What led to a message.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CauseChain {
    /// The message itself, then what caused it, and so on: nearest first.
    pub events: Vec<CausedBy>,
    /// How many causes are left out behind the last of these.
    pub omitted: u64,
    /// The event at which the chain leaves the log: its topic was not written, or the log is damaged. None if the
    /// chain ends at an event that has no cause: a start, or something planned before the run.
    pub unknown: Option<LoggedKey>,
}

/// What led to a message, back to a start, at most so many events of it; or what a reader should know if the log
/// has no such message.
///
/// ```no_run
/// let id = "node_03,rover_07,Grant,12".parse()?;
/// for event in farside_logs::causes("run.mcap", &id, 50)??.events {
///     println!("{} {}", event.record.key.time_ns, event.record.topic);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// If the log cannot be read.
pub fn causes(
    path: impl AsRef<Path>,
    id: &MessageId,
    most: usize,
) -> Result<Result<CauseChain, String>, LogError> {
    let path = path.as_ref();
    let found = find_messages(path, std::slice::from_ref(id))?;
    let ordinal = match found.into_iter().next() {
        Some(Ok(found)) => found.ordinal,
        Some(Err(missing)) => return Ok(Err(missing)),
        None => return Ok(Ok(CauseChain::default())),
    };
    let (none, mut names) = (Topics::new(&[])?, Names::default());
    let mut index = Index::open(path, Mode::Farside, &none, Limits::default().entries)?;
    let mut message: Option<LoggedRecord> = None;
    while index.advance(&mut names)? {
        let current = index.current().filter(|_| message.is_none());
        let Some(current) = current else { continue };
        let Some(record) = RecordRef::read(current.data) else {
            continue;
        };
        let is_it = record.class.is_fate()
            && (record.ordinal, record.copy) == (ordinal, id.copy)
            && (record.sender, record.receiver, record.kind)
                == (&id.sender, &id.receiver, &id.kind);
        if is_it {
            message = Some(LoggedRecord::bodiless(&record, current.channel));
        }
    }
    let Some(message) = message else {
        return Ok(Err(format!("{id}: the log does not have it twice alike")));
    };
    let cause = message.cause.clone();
    let mut chain = CauseChain::default();
    chain.events.push(CausedBy {
        record: message,
        repeats: 0,
    });
    walk(&mut index, &mut names, cause, |step| match step {
        Step::Unknown(key) => chain.unknown = Some(key),
        Step::Event(record, channel) => {
            let is_timer = |class| class == RecordClass::Timer;
            let last = chain.events.last_mut().filter(|last| {
                let same = last.record.topic == channel.topic;
                same && is_timer(last.record.class) && is_timer(record.class)
            });
            if let Some(last) = last.filter(|_| chain.omitted == 0) {
                last.repeats += 1;
            } else if chain.events.len() < most && chain.omitted == 0 {
                chain.events.push(CausedBy {
                    record: LoggedRecord::bodiless(record, channel),
                    repeats: 0,
                });
            } else {
                chain.omitted += 1;
            }
        }
    })?;
    Ok(Ok(chain))
}
