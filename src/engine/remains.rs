//! What is left of a run when it is over: messages still on their way, and what users brought in.
//! All of it is dropped before the end is reported, so that a panic meanwhile is a fault as well.

use super::{Class, Head, InFlight, Pending, Side};
use crate::fault::{Fault, FaultCause};
use crate::guard::{dropped, guarded};
use crate::ids::EntityId;
use crate::key::EventKey;
use crate::time::SimTime;
use crate::topology::Topology;

/// Something panicked while it was dropped, or could not be written down before.
struct Panicked {
    /// Messages come first, in the order of their next events, then actors and links by rank: which
    /// panic is named must not hang on how hosts are dealt to engines.
    order: (EventKey, u32),
    entity: EntityId,
    message: Option<String>,
    cause: Box<FaultCause>,
}

/// What is left of a run when it is over.
#[derive(Default)]
pub(crate) struct Remains {
    pub(crate) in_flight: Vec<InFlight>,
    panicked: Vec<Panicked>,
}

impl Remains {
    /// Drops something that an actor or link had.
    pub(crate) fn drop_of<T>(&mut self, topology: &Topology, entity: EntityId, value: T) {
        if let Err(cause) = dropped(value) {
            let count = self.panicked.len() as u64;
            self.panicked.push(Panicked {
                order: (topology.key(SimTime::MAX, u32::MAX, entity, count), 0),
                entity,
                message: None,
                cause,
            });
        }
    }

    /// Takes a message still on its way, which its next event would have delivered, lost or handed
    /// over; other events leave nothing. `until` leaves out what events at or after that key sent: a
    /// fault undid them.
    pub(crate) fn take(
        &mut self,
        topology: &Topology,
        key: EventKey,
        mut pending: Pending,
        until: Option<EventKey>,
    ) {
        let head = pending.head;
        let letter = pending.letter.take();
        let side = pending.side.as_ref().filter(|_| head.has_side);
        let key = head.key_in_flight(topology, key, side);
        if head.in_flight(topology, pending.side.as_ref(), until) {
            let mut body = Vec::new();
            if let (Some(letter), Some(kind), true) = (&letter, head.kind(), topology.recording()) {
                let kind = topology.kind(kind);
                let encoded = match guarded(|| letter.0.encode(kind.schema(), &mut body)) {
                    Ok(encoded) => encoded.map_err(|error| {
                        let (kind, error) = (kind.name().to_owned(), error.to_string());
                        Box::new(FaultCause::Encoding { kind, error })
                    }),
                    Err(cause) => Err(cause),
                };
                if let Err(cause) = encoded {
                    // It is on its way all the same, and recorded empty.
                    body.clear();
                    self.panicked.push(Panicked {
                        order: (key, head.copy()),
                        entity: head.receiver,
                        message: head.message(topology),
                        cause,
                    });
                }
            }
            self.in_flight.push((key, head.left_over(), body));
        }
        if let Err(cause) = dropped(letter) {
            self.panicked.push(Panicked {
                order: (key, head.copy()),
                entity: head.receiver,
                message: head.message(topology),
                cause,
            });
        }
    }

    /// The fault with which the run ends at `time` after all, if something panicked.
    pub(crate) fn fault(&mut self, topology: &Topology, time: SimTime) -> Option<Box<Fault>> {
        let panicked = std::mem::take(&mut self.panicked);
        let first = panicked.into_iter().min_by_key(|panicked| panicked.order)?;
        Some(Box::new(Fault {
            key: topology.key(time, u32::MAX, first.entity, 0),
            time,
            actor: topology.name(first.entity).to_owned(),
            message: first.message,
            cause: *first.cause,
        }))
    }
}

impl Head {
    /// The key by which a message in flight is known: that of its next event, unless its link has
    /// parked it. Until when it would have been left there may hang on what a fault undid.
    pub(crate) fn key_in_flight(
        &self,
        topology: &Topology,
        next: EventKey,
        side: Option<&Side>,
    ) -> EventKey {
        match (side.filter(|side| side.parked), self.link()) {
            (Some(side), Some(link)) => topology.key(SimTime::MAX, 0, link, side.token),
            _ => next,
        }
    }

    /// True for a message that was sent before `until`, which a fault left of the run.
    pub(super) fn in_flight(
        &self,
        topology: &Topology,
        side: Option<&Side>,
        until: Option<EventKey>,
    ) -> bool {
        let side = side.filter(|_| self.has_side);
        let by = || self.scheduled_by(topology, side);
        let undone = until.is_some_and(|until| by().is_none_or(|by| by >= until));
        let message = matches!(
            self.class,
            Class::Message | Class::HandOver | Class::Held | Class::LateLoss
        );
        message && !undone
    }
}
