//! Rulings: what becomes of single messages, decided before the run, whatever their links decide. A fork of
//! a run asks with them what a loss has brought down, or what a message that was lost would have changed.

use std::fmt;
use std::str::FromStr;
use std::sync::atomic::{AtomicU8, Ordering};

use hashbrown::HashMap;
use rustc_hash::FxBuildHasher;
use thiserror::Error;

use crate::ids::{EntityId, KindIndex, MatchKey};
use crate::time::SimDuration;

/// Why a message is lost that a ruling loses.
pub const RULED: &str = "ruled";

/// Names one copy of one message of a run, whatever changes elsewhere in the run.
///
/// As text it is `sender,receiver,kind,number`, where the number is the place in that flow, from 0, or the
/// protocol's own key, `cycle.iteration`; `xN` behind a key is the message after N others that had the same key
/// right before, and `+N` is a further copy that the link made.
///
/// ```
/// use farside::ruling::{MessageId, MessageNumber};
/// let id: MessageId = "node_03,rover_07,Grant,12".parse()?;
/// assert_eq!((id.sender.as_str(), id.number), ("node_03", MessageNumber::Ordinal(12)));
/// for text in ["node_03,rover_07,Grant,12", "a,b/c,Bid,3.1", "a,b,Bid,3.1x2+1", "a,b,Odd, kind,0"] {
///     assert_eq!(text.parse::<MessageId>()?.to_string(), text);
/// }
/// let error = "node_03,rover_07,12".parse::<MessageId>().unwrap_err();
/// assert!(error.to_string().contains("expected sender,receiver,kind,number"));
/// # Ok::<(), farside::ruling::MessageIdError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MessageId {
    /// The name of the actor that sends it.
    pub sender: String,
    /// The name of the actor that it is for.
    pub receiver: String,
    /// Its kind: the serde name of its type.
    pub kind: String,
    /// Which of these.
    pub number: MessageNumber,
    /// Which copy; 0 unless the link makes several.
    pub copy: u32,
}

/// Which message of a flow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum MessageNumber {
    /// How many messages of the flow were sent before.
    Ordinal(u64),
    /// The protocol's own identity for the message.
    Key {
        /// The key.
        key: MatchKey,
        /// How many messages with the same key came right before.
        repeat: u32,
    },
}

/// A text that names no message.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "{found:?} names no message: expected sender,receiver,kind,number, as in node_03,rover_07,Grant,12"
)]
pub struct MessageIdError {
    /// The text.
    pub found: String,
}

impl FromStr for MessageId {
    type Err = MessageIdError;

    fn from_str(text: &str) -> Result<Self, MessageIdError> {
        let parsed = || {
            let (sender, rest) = text.split_once(',')?;
            let (receiver, rest) = rest.split_once(',')?;
            let (kind, rest) = rest.rsplit_once(',')?;
            let (number, copy) = match rest.split_once('+') {
                Some((number, copy)) => (number, number_of(copy)?),
                None => (rest, 0),
            };
            let number = match number.split_once('.') {
                None => MessageNumber::Ordinal(number_of(number)?),
                Some((major, rest)) => {
                    let (minor, repeat) = match rest.split_once('x') {
                        Some((minor, repeat)) => (minor, number_of(repeat)?),
                        None => (rest, 0),
                    };
                    let key = MatchKey::new(number_of(major)?, number_of(minor)?);
                    MessageNumber::Key { key, repeat }
                }
            };
            let [sender, receiver, kind] = [sender, receiver, kind].map(str::to_owned);
            Some(MessageId {
                sender,
                receiver,
                kind,
                number,
                copy,
            })
        };
        parsed().ok_or_else(|| MessageIdError {
            found: text.chars().take(200).collect(),
        })
    }
}

/// A number in digits alone: a sign or a space would make two texts of one message.
fn number_of<N: FromStr>(text: &str) -> Option<N> {
    let digits = text.bytes().all(|byte| byte.is_ascii_digit());
    digits.then(|| text.parse().ok()).flatten()
}

impl fmt::Display for MessageId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{},", self.sender, self.receiver, self.kind)?;
        match self.number {
            MessageNumber::Ordinal(ordinal) => write!(f, "{ordinal}")?,
            MessageNumber::Key { key, repeat: 0 } => write!(f, "{key}")?,
            MessageNumber::Key { key, repeat } => write!(f, "{key}x{repeat}")?,
        }
        match self.copy {
            0 => Ok(()),
            copy => write!(f, "+{copy}"),
        }
    }
}

/// What becomes of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ruling {
    /// It is lost when it would have arrived, for the reason [`RULED`].
    Lose,
    /// It arrives. Its link is asked to lose it to no chance ([`Parcel::is_spared`](crate::carrier::Parcel::is_spared)); if it loses it all the same,
    /// it arrives so long after it was lost, and no sooner than its link ever delivers.
    Deliver {
        /// How long after the loss.
        after: SimDuration,
    },
    /// It arrives so much later.
    Delay(SimDuration),
}

/// What came of a ruling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum RulingEnd {
    /// No link carried such a message.
    NeverMet = 0,
    /// The link had decided so anyway.
    WithoutEffect = 1,
    /// It changed what became of the message.
    Applied = 2,
    /// It lost the message, and one that was declared later delivers it all the same; or the other way round.
    Overruled = 3,
}

/// The rulings of a run.
#[derive(Default)]
pub(crate) struct Rulings {
    /// Places in `rules` by the message.
    by_message: HashMap<MessageOf, Vec<u32>, FxBuildHasher>,
    rules: Vec<Rule>,
}

/// A message of a run, its names resolved.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct MessageOf {
    pub(crate) sender: EntityId,
    pub(crate) receiver: EntityId,
    pub(crate) kind: KindIndex,
    pub(crate) number: MessageNumber,
}

/// A ruling on one copy of a message, and what came of it.
pub(crate) struct Rule {
    pub(crate) copy: u32,
    pub(crate) ruling: Ruling,
    end: AtomicU8,
}

impl Rule {
    /// It met its message.
    pub(crate) fn met(&self, end: RulingEnd) {
        self.end.fetch_max(end as u8, Ordering::Relaxed);
    }
}

impl Rulings {
    /// Adds one, behind those that are there.
    pub(crate) fn add(&mut self, message: MessageOf, copy: u32, ruling: Ruling) {
        let place = self.rules.len() as u32;
        self.by_message.entry(message).or_default().push(place);
        self.rules.push(Rule {
            copy,
            ruling,
            end: AtomicU8::new(RulingEnd::NeverMet as u8),
        });
    }

    /// What came of each, in the order in which they were added.
    pub(crate) fn ends(&self) -> Vec<RulingEnd> {
        let end = |rule: &Rule| match rule.end.load(Ordering::Relaxed) {
            0 => RulingEnd::NeverMet,
            1 => RulingEnd::WithoutEffect,
            2 => RulingEnd::Applied,
            _ => RulingEnd::Overruled,
        };
        self.rules.iter().map(end).collect()
    }

    /// Those on a message, whichever of its names they use, in the order in which they were added.
    pub(crate) fn on(&self, names: impl Iterator<Item = MessageOf>) -> Vec<&Rule> {
        let places = names.filter_map(|name| self.by_message.get(&name));
        let mut places: Vec<u32> = places.flatten().copied().collect();
        places.sort_unstable();
        let rule = |place: u32| &self.rules[place as usize];
        places.into_iter().map(rule).collect()
    }
}

#[cfg(test)]
mod tests;
