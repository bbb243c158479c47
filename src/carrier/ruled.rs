//! What rulings make of what a link has decided ([`crate::ruling`]).

use super::{Carriage, Parcel, Verdict, Verdicts};
use crate::ids::{EntityId, KindIndex};
use crate::ruling::{MessageNumber, MessageOf, RULED, Rule, Ruling, RulingEnd, Rulings};
use crate::time::SimDuration;

/// The rulings on the message of a parcel, in the order in which they were declared.
fn on<'a>(rulings: &'a Rulings, parcel: &Parcel<'_>) -> Vec<&'a Rule> {
    let ends: (EntityId, EntityId, KindIndex) = (parcel.sender, parcel.receiver, parcel.kind_index);
    let message = move |number| MessageOf {
        sender: ends.0,
        receiver: ends.1,
        kind: ends.2,
        number,
    };
    let by_ordinal = message(MessageNumber::Ordinal(parcel.ordinal));
    let repeat = parcel.repeat;
    let key = parcel.match_key;
    let by_key = key.map(|key| message(MessageNumber::Key { key, repeat }));
    rulings.on([Some(by_ordinal), by_key].into_iter().flatten())
}

/// Whether a copy of the message is to arrive that its link would lose.
#[cold]
pub(super) fn spares(rulings: &Rulings, parcel: &Parcel<'_>, copy: u32) -> bool {
    let is_to = |rule: &&&Rule| rule.copy == copy && matches!(rule.ruling, Ruling::Deliver { .. });
    let rules = on(rulings, parcel);
    let rule = rules.iter().find(is_to);
    if let Some(rule) = rule {
        rule.met(RulingEnd::Applied);
    }
    rule.is_some()
}

impl Verdicts {
    /// Changes what a link has decided of a message as rulings on it say.
    #[cold]
    pub(crate) fn rule(&mut self, rulings: &Rulings, parcel: &Parcel<'_>, min_delay: SimDuration) {
        let rules = on(rulings, parcel);
        for (at, rule) in rules.iter().enumerate() {
            let Some(place) = rule.copy.checked_sub(parcel.copy) else {
                continue;
            };
            let Some(verdict) = self.list.get_mut(place as usize) else {
                continue;
            };
            let Some(ruled) = over(rule.ruling, *verdict, min_delay) else {
                continue;
            };
            rule.met(match ruled == *verdict {
                true => RulingEnd::WithoutEffect,
                false => RulingEnd::Applied,
            });
            *verdict = ruled;
            for before in &rules[..at] {
                if before.copy == rule.copy && contradict(before.ruling, rule.ruling) {
                    before.met(RulingEnd::Overruled);
                }
            }
        }
    }
}

/// Whether one loses what the other delivers.
fn contradict(one: Ruling, other: Ruling) -> bool {
    matches!(
        (one, other),
        (Ruling::Lose, Ruling::Deliver { .. }) | (Ruling::Deliver { .. }, Ruling::Lose)
    )
}

/// What a ruling makes of a verdict; none of one that is not the last.
fn over(ruling: Ruling, verdict: Verdict, min_delay: SimDuration) -> Option<Verdict> {
    let late = |carriage: Option<Carriage>, by: SimDuration| {
        carriage.map(|carriage| Carriage {
            queue: carriage.queue + by,
            ..carriage
        })
    };
    match (ruling, verdict) {
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
