//! Rulings: what becomes of single messages, decided before the run, whatever their links decide. A fork of
//! a run asks with them what a loss has brought down, or what a message that was lost would have changed.

use std::fmt;
use std::str::FromStr;
use std::sync::atomic::{AtomicU8, Ordering};

use thiserror::Error;

use crate::carrier::{Carriage, Parcel, Verdict, Verdicts};
use crate::fault::LookupError;
use crate::ids::{EntityId, KindIndex, MatchKey};
use crate::time::SimDuration;
use crate::topology::{EntityRole, FixedMap, RunInfo};

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
    /// It arrives. Its link is asked to lose it to no chance ([`Parcel::is_spared`]); if it loses it all the same,
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
}

/// The rulings of a run.
pub(crate) struct Rulings {
    /// Places in `rules` by the flow and the number in it.
    by_message: FixedMap<Flow, Vec<u32>>,
    rules: Vec<Rule>,
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Flow {
    sender: EntityId,
    receiver: EntityId,
    kind: KindIndex,
    number: MessageNumber,
}

struct Rule {
    copy: u32,
    ruling: Ruling,
    end: AtomicU8,
}

impl Rulings {
    /// Finds what the names of messages stand for.
    pub(crate) fn new(
        declared: &[(MessageId, Ruling)],
        info: &RunInfo,
    ) -> Result<Rulings, LookupError> {
        let mut rulings = Rulings {
            by_message: FixedMap::default(),
            rules: Vec::new(),
        };
        for (id, ruling) in declared {
            let flow = Flow {
                sender: actor(info, &id.sender)?,
                receiver: actor(info, &id.receiver)?,
                kind: kind(info, &id.kind)?,
                number: id.number,
            };
            let place = rulings.rules.len() as u32;
            rulings.by_message.entry(flow).or_default().push(place);
            rulings.rules.push(Rule {
                copy: id.copy,
                ruling: *ruling,
                end: AtomicU8::new(RulingEnd::NeverMet as u8),
            });
        }
        Ok(rulings)
    }

    /// What came of each, in the order in which they were declared.
    pub(crate) fn ends(&self) -> Vec<RulingEnd> {
        let end = |rule: &Rule| match rule.end.load(Ordering::Relaxed) {
            0 => RulingEnd::NeverMet,
            1 => RulingEnd::WithoutEffect,
            _ => RulingEnd::Applied,
        };
        self.rules.iter().map(end).collect()
    }

    fn of(&self, parcel: &Parcel<'_>) -> impl Iterator<Item = &Rule> {
        let flow = |number| Flow {
            sender: parcel.sender,
            receiver: parcel.receiver,
            kind: parcel.kind_index,
            number,
        };
        let by_ordinal = Some(flow(MessageNumber::Ordinal(parcel.ordinal)));
        let repeat = parcel.repeat;
        let by_key = parcel
            .match_key
            .map(|key| flow(MessageNumber::Key { key, repeat }));
        let flows = by_ordinal.into_iter().chain(by_key);
        let places = flows.flat_map(|flow| self.by_message.get(&flow).into_iter().flatten());
        places.map(|place| &self.rules[*place as usize])
    }

    /// Whether a copy of the message is to arrive that its link would lose.
    #[cold]
    pub(crate) fn spares(&self, parcel: &Parcel<'_>, copy: u32) -> bool {
        let is_to =
            |rule: &&Rule| rule.copy == copy && matches!(rule.ruling, Ruling::Deliver { .. });
        let rule = self.of(parcel).find(is_to);
        if let Some(rule) = rule {
            let applied = RulingEnd::Applied as u8;
            rule.end.fetch_max(applied, Ordering::Relaxed);
        }
        rule.is_some()
    }

    /// Changes what a link has decided of a message.
    #[cold]
    pub(crate) fn apply(
        &self,
        parcel: &Parcel<'_>,
        verdicts: &mut Verdicts,
        min_delay: SimDuration,
    ) {
        for rule in self.of(parcel) {
            let Some(place) = rule.copy.checked_sub(parcel.copy) else {
                continue;
            };
            let Some(verdict) = verdicts.list.get_mut(place as usize) else {
                continue;
            };
            let Some(ruled) = rule.ruling.over(*verdict, min_delay) else {
                continue;
            };
            let end = match ruled == *verdict {
                true => RulingEnd::WithoutEffect,
                false => RulingEnd::Applied,
            };
            rule.end.fetch_max(end as u8, Ordering::Relaxed);
            *verdict = ruled;
        }
    }
}

impl Ruling {
    /// What the ruling makes of a verdict; none of one that is not the last.
    fn over(self, verdict: Verdict, min_delay: SimDuration) -> Option<Verdict> {
        let late = |carriage: Option<Carriage>, by: SimDuration| {
            carriage.map(|carriage| Carriage {
                queue: carriage.queue + by,
                ..carriage
            })
        };
        match (self, verdict) {
            (_, Verdict::Hold { .. } | Verdict::Park { .. }) => None,
            (Ruling::Lose, Verdict::Deliver { after, carriage }) => Some(Verdict::Lose {
                after,
                reason: RULED,
                carriage,
            }),
            (
                Ruling::Deliver { after: wait },
                Verdict::Lose {
                    after, carriage, ..
                },
            ) => {
                let arrives = (after + wait).max(min_delay);
                Some(Verdict::Deliver {
                    after: arrives,
                    carriage: late(carriage, arrives - after),
                })
            }
            (Ruling::Delay(by), Verdict::Deliver { after, carriage }) => Some(Verdict::Deliver {
                after: after + by,
                carriage: late(carriage, by),
            }),
            (Ruling::Lose | Ruling::Delay(_), lost @ Verdict::Lose { .. }) => Some(lost),
            (Ruling::Deliver { .. }, arrives @ Verdict::Deliver { .. }) => Some(arrives),
        }
    }
}

fn actor(info: &RunInfo, name: &str) -> Result<EntityId, LookupError> {
    let entity = info.entity(name);
    let is_actor = |entity: &EntityId| info.entities[entity.index()].role == EntityRole::Actor;
    entity.filter(is_actor).ok_or_else(|| {
        let actors = info.entities.iter();
        let actors = actors.filter(|entity| entity.role == EntityRole::Actor);
        LookupError::unknown(name, actors.map(|entity| entity.name.as_str()))
    })
}

fn kind(info: &RunInfo, name: &str) -> Result<KindIndex, LookupError> {
    let names = || info.kinds.iter().map(|kind| kind.name());
    let found = names().position(|known| known == name);
    found
        .map(|at| at as KindIndex)
        .ok_or_else(|| LookupError::unknown_kind(name, names()))
}

#[cfg(test)]
mod tests;
