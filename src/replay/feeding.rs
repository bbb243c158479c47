//! What a replay makes of the records of its run.

use super::compare::{FlowKey, Seen, Side};
use super::report::OutputClass;
use super::{Recorded, Replay, ReplayError};
use crate::engine::{Action, Class, Head, Sealed, Unseal};
use crate::guard::guarded;
use crate::ids::{EntityId, KindIndex};
use crate::key::{Bound, EventKey};
use crate::record::RecordClass;

impl Replay {
    /// Takes the next record, in the order of the run.
    ///
    /// # Errors
    /// When it cannot be replayed.
    pub fn feed(&mut self, record: &Recorded<'_>) -> Result<(), ReplayError> {
        let count = self.topology.info.entities.len();
        let link = record.link.unwrap_or(record.sender);
        let entities = [record.sender, record.receiver, record.key.source, link];
        if let Some(found) = entities.iter().find(|entity| entity.index() >= count) {
            let found = found.index();
            return Err(ReplayError::UnknownEntity { found, count });
        }
        if record.class == RecordClass::Sample {
            self.meet(OutputClass::Sample, record);
            return Ok(());
        }
        if record.class == RecordClass::InFlight {
            return self.feed_in_flight(record);
        }
        if record.key < self.last {
            let (time, last) = (record.key.time, self.last.time);
            return Err(ReplayError::Order { time, last });
        }
        self.last = record.key;
        self.advance(Bound {
            time: record.key.time,
            step: record.key.step,
        });
        if self.fault.is_some() {
            return Ok(());
        }
        self.note_charges(record);
        if self.is_live(record.receiver) {
            self.happen(record)?;
        }
        match record.class {
            RecordClass::Stop => {
                let why = String::from_utf8_lossy(record.body).into_owned();
                self.recorded_stop = Some((record.key, record.sender, why));
            }
            RecordClass::Delivered | RecordClass::Lost if record.copy == 0 => {
                self.meet(OutputClass::Message, record);
            }
            RecordClass::Change => self.meet(OutputClass::Change, record),
            _ => {}
        }
        Ok(())
    }

    fn feed_in_flight(&mut self, record: &Recorded<'_>) -> Result<(), ReplayError> {
        let is_own = self.is_live(record.sender) && record.link.is_none();
        // What it cost is not recorded: nothing, if its link took nothing for the one before.
        let is_free = record.link.is_none_or(|link| self.free[link.index()]);
        self.charged |= !is_free && self.is_near(record.sender);
        let is_first = |(first, ..): &(EventKey, Head, Sealed)| record.key < *first;
        if self.is_live(record.receiver)
            && !is_own
            && self.in_flight.as_ref().is_none_or(is_first)
            && let Ok((head, letter)) = self.message(record)
        {
            self.in_flight = Some((record.key, head, letter));
        }
        if record.copy == 0 {
            self.meet(OutputClass::Message, record);
        }
        Ok(())
    }

    /// An output as it is recorded.
    fn meet(&mut self, class: OutputClass, record: &Recorded<'_>) {
        if !self.is_live(record.sender) {
            return;
        }
        let key = FlowKey {
            class,
            actor: record.sender,
            receiver: record.receiver,
            kind: self.comparer.kind_named(record.kind),
        };
        let seen = Seen {
            ordinal: record.ordinal,
            time: record.sent,
            cause: record.cause.unwrap_or(record.key),
            match_key: record.match_key,
            body: record.body,
        };
        self.comparer.meet(Side::Recorded, key, seen);
    }

    /// What a link charged for a message that came to a living host, or went from there.
    fn note_charges(&mut self, record: &Recorded<'_>) {
        let Some(carriage) = record.carriage else {
            // A link that does not say how it carried may have charged all the same.
            self.charged |= record.link.is_some() && self.is_near(record.sender);
            return;
        };
        if let Some(link) = record.link {
            self.free[link.index()] = carriage.energy_j == 0.0;
        }
        let reached = match record.class {
            RecordClass::Delivered => true,
            RecordClass::Lost => record.reason == "crashed",
            _ => false,
        };
        // A message that arrives takes its own charge with it.
        let takes_it = self.is_live(record.receiver) && record.class == RecordClass::Delivered;
        if reached && !takes_it && carriage.receive_j != 0.0 && self.is_near(record.receiver) {
            self.insert_charge(record.key, record.receiver, 0.0, carriage.receive_j);
        }
        self.charged |= carriage.energy_j != 0.0 && self.is_near(record.sender)
            || carriage.receive_j != 0.0 && self.is_near(record.receiver);
    }

    /// What happens to a living actor.
    fn happen(&mut self, record: &Recorded<'_>) -> Result<(), ReplayError> {
        let (class, key, actor) = (record.class, record.key, record.receiver);
        if matches!(
            class,
            RecordClass::Start
                | RecordClass::Delivered
                | RecordClass::Timer
                | RecordClass::Restart
                | RecordClass::Told
        ) {
            self.comparer.step(Side::Recorded, key.time);
        }
        self.exchange_constructors(key);
        match class {
            // It is sent again.
            RecordClass::Delivered if self.is_live(record.sender) && record.link.is_none() => {}
            RecordClass::Delivered => {
                let (head, letter) = self.message(record)?;
                let carriage = record.carriage.filter(|carriage| carriage.receive_j != 0.0);
                self.inputs += 1;
                self.insert(key, head, Some(letter), carriage);
            }
            RecordClass::Crash => self.control(key, actor, Action::Crash),
            RecordClass::Restart => self.control(key, actor, Action::Restart),
            RecordClass::Told => {
                let (head, letter) = self.message(record)?;
                let kind = head.kind().unwrap_or_default();
                self.control(key, actor, Action::Tell(kind, letter));
            }
            _ => {}
        }
        Ok(())
    }

    fn control(&mut self, key: EventKey, actor: EntityId, action: Action) {
        self.inputs += 1;
        if let Err(fault) = self.engine.control(key, actor, action, &mut self.comparer) {
            self.fault = Some(fault);
        }
        self.take_stop();
    }

    /// Gives actors the constructors that they have from events up to this one on.
    fn exchange_constructors(&mut self, key: EventKey) {
        while let Some((from, ..)) = self.rebuilds.front()
            && *from <= key
            && let Some((_, actor, factory)) = self.rebuilds.pop_front()
        {
            self.engine.exchange_constructor(actor, factory);
        }
    }

    /// A recorded message, for its receiver.
    fn message(&self, record: &Recorded<'_>) -> Result<(Head, Sealed), ReplayError> {
        let actor = || self.topology.name(record.receiver).to_owned();
        let found = self.accepted(record.receiver).find_map(|accepted| {
            let kind = self.topology.kind_of_type.get(&accepted.kind.type_id)?;
            let is_it = self.topology.kind(*kind).name() == record.kind;
            let unseal = accepted.unseal.downcast_ref::<Unseal>()?;
            is_it.then_some((*kind, *unseal))
        });
        let Some((kind, unseal)) = found else {
            let accepts = self.accepts(record.receiver).into_iter();
            return Err(ReplayError::NotAccepted {
                actor: actor(),
                kind: record.kind.to_owned(),
                accepts: accepts.map(str::to_owned).collect(),
            });
        };
        let schema = self.topology.kind(kind).schema();
        let read = guarded(|| unseal(schema, record.body));
        let error = match read {
            Ok(Ok(letter)) => return Ok((self.head(record, kind), letter)),
            Ok(Err(error)) => error.to_string(),
            Err(cause) => cause.to_string(),
        };
        Err(ReplayError::Body {
            actor: actor(),
            kind: record.kind.to_owned(),
            time: record.key.time,
            error,
        })
    }

    fn head(&self, record: &Recorded<'_>, kind: KindIndex) -> Head {
        let mut head = Head::of_entity(Class::Message, record.sender);
        head.receiver = record.receiver;
        if let Some(link) = record.link {
            head = head.through(link);
        }
        head = match record.cause {
            Some(cause) => head.caused(cause, kind, record.ordinal),
            None => head.of_kind(Some(kind)),
        };
        head.ordinal = record.ordinal;
        match record.match_key {
            Some(key) => head.keyed(key, 0).as_copy(record.copy),
            None => head.as_copy(record.copy),
        }
    }
}
