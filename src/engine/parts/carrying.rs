//! Messages and links: a link is shown a message, and what it decides becomes events; an actor
//! tells a link something.

use std::any::Any;
use std::cell::Cell;
use std::num::NonZeroU64;

use super::{Effect, Parts};
use crate::carrier::{Carriage, Parcel, Verdict, Verdicts};
use crate::engine::{CellState, Class, Head, Parked, Pending, Sealed, Side};
use crate::fault::FaultCause;
use crate::ids::{EntityId, KindIndex};
use crate::key::EventKey;
use crate::queue::Entry;
use crate::time::{SimDuration, SimTime};
use crate::topology::Kind;

impl Parts {
    /// Lets `link` decide the fate of a message, now; `held` if it held it before. Returns what the
    /// sender is charged at once, in joules: what an own link asks for.
    pub(crate) fn carry(
        &mut self,
        link: EntityId,
        head: Head,
        letter: Sealed,
        held: Option<Side>,
    ) -> f64 {
        self.carrying = Some(link);
        let topology = self.topology.clone();
        let Some(kind) = head.kind().map(|kind| topology.kind(kind)) else {
            return 0.0;
        };
        let parcel = Parcel {
            topology: &topology,
            now: self.key.time,
            sent: head.sent(self.key),
            link,
            sender: head.sender,
            receiver: head.receiver,
            kind,
            ordinal: head.ordinal,
            repeat: head.repeat(),
            copy: head.copy(),
            token: held.map(|held| held.token),
            match_key: head.match_key(),
            letter: &*letter.0,
            size: Cell::new(None),
        };
        let mut verdicts = std::mem::take(&mut self.verdicts);
        let cell = &mut self.links[topology.place(link).local as usize];
        if let Some(held) = held.filter(|held| held.parked) {
            cell.parked.remove(&held.token);
        }
        cell.carrier.carry(&parcel, &mut verdicts);
        let mut count = cell.count;
        self.execute(link, &mut count, head, letter, kind, &verdicts);
        for (token, delay) in verdicts.wakes.drain(..) {
            self.wake(link, &mut count, token, delay);
        }
        self.links[topology.place(link).local as usize].count = count;
        let charge_j = std::mem::take(&mut verdicts.charge_j);
        let charge_receiver_j = std::mem::take(&mut verdicts.charge_receiver_j);
        verdicts.list.clear();
        self.verdicts = verdicts;
        if self.fault.is_none() {
            self.carrying = None;
        }
        if charge_receiver_j != 0.0 {
            let charge = Carriage {
                receive_j: charge_receiver_j,
                ..Carriage::default()
            };
            self.charge_later(link, head.receiver, charge);
        }
        // Only while its sender is at hand can a message's cost be charged at once, and whether it
        // is must not hang on how hosts are dealt to engines.
        if charge_j == 0.0 || held.is_none() && !self.is_shared(link) {
            return charge_j;
        }
        let charge = Carriage {
            energy_j: charge_j,
            ..Carriage::default()
        };
        self.charge_later(link, head.sender, charge);
        0.0
    }

    /// Brings forward a message that its link parked, unless it is shown sooner anyway.
    fn wake(&mut self, link: EntityId, count: &mut u64, token: u64, delay: SimDuration) {
        let local = self.topology.place(link).local as usize;
        let at = self.key.time + delay;
        let Some(parked) = self.links[local].parked.get(&token).copied() else {
            return;
        };
        if parked.latest.is_some_and(|latest| latest <= at) {
            return;
        }
        let key = self.later_key(link, count, delay);
        let slot = match parked.latest {
            None => {
                self.queue.push(Entry::new(key, parked.slot));
                parked.slot
            }
            Some(_) => {
                let (head, letter, side) = self.store.take_ahead(parked.slot);
                let slot = self.insert(key, head, letter);
                self.store.set_side(slot, side.unwrap_or_default());
                slot
            }
        };
        let latest = Some(at);
        self.links[local]
            .parked
            .insert(token, Parked { slot, latest });
        self.shed_voids();
    }

    /// Keeps a message that its link may wake.
    fn park(
        &mut self,
        link: EntityId,
        count: &mut u64,
        latest: Option<SimDuration>,
        (head, letter, side): (Head, Sealed, Side),
    ) {
        let mut head = head;
        (head.class, head.has_side) = (Class::Held, true);
        let slot = self.store.insert(head, Some(letter));
        self.store.set_side(slot, side);
        if let Some(after) = latest {
            let key = self.later_key(link, count, after);
            self.queue.push(Entry::new(key, slot));
        }
        let latest = latest.map(|after| self.key.time + after);
        let cell = &mut self.links[self.topology.place(link).local as usize];
        let before = cell.parked.insert(side.token, Parked { slot, latest });
        assert!(
            before.is_none(),
            "a link parks two messages under one token"
        );
    }

    pub(super) fn is_shared(&self, link: EntityId) -> bool {
        self.topology
            .links
            .get(&link)
            .is_some_and(|link| link.shared)
    }

    fn charge_later(&mut self, link: EntityId, whom: EntityId, charge: Carriage) {
        let topology = self.topology.clone();
        let min_delay = topology.links.get(&link).map(|link| link.min_delay);
        let cell = &mut self.links[topology.place(link).local as usize];
        let mut count = cell.count;
        let key = self.later_key(link, &mut count, min_delay.unwrap_or(SimDuration::ZERO));
        self.links[topology.place(link).local as usize].count = count;
        let pending = Pending {
            head: Head::of_entity(Class::Charge, whom),
            letter: None,
            side: Some(Side {
                carriage: Some(charge),
                ..Side::default()
            }),
        };
        self.schedule_with(topology.place(whom).engine, key, pending);
    }

    /// Asks for a change of a link on behalf of an actor.
    pub(crate) fn ask_change(
        &mut self,
        state: &mut CellState,
        me: EntityId,
        link: EntityId,
        letter: Sealed,
    ) {
        let (mine, its) = (self.topology.place(me), self.topology.place(link));
        if self.fault.is_some() {
            return;
        }
        if mine.host != its.host && !self.is_shared(link) {
            return self.raise(FaultCause::NoRoute {
                from: self.topology.host_name(me).to_owned(),
                to: self.topology.host_name(link).to_owned(),
                receiver: self.topology.name(link).to_owned(),
                kind: "a change".to_owned(),
            });
        }
        let kind = self.topology.links.get(&link).map(|link| link.change_kind);
        let flow = state.next_in_flow(link, kind.unwrap_or(KindIndex::MAX), None);
        let mut head = Head::of_entity(Class::Tell, me);
        head.receiver = link;
        let head = head.caused(self.key, KindIndex::MAX, flow.0).of_kind(kind);
        let key = self.later_key(me, &mut state.count, SimDuration::ZERO);
        self.schedule(its.engine, key, head, Some(letter));
    }

    /// Gives a link a change.
    pub(crate) fn tell(&mut self, link: EntityId, change: Box<dyn Any + Send>, now: SimTime) {
        let local = self.topology.place(link).local as usize;
        self.links[local].carrier.change(change, now);
    }

    /// Turns a link's verdicts into events, the last copy with the letter itself.
    fn execute(
        &mut self,
        link: EntityId,
        count: &mut u64,
        head: Head,
        letter: Sealed,
        kind: &Kind,
        verdicts: &Verdicts,
    ) {
        let mut letter = Some(letter);
        // Of the messages that a link decides about, only those that it held have a side.
        let held = head.has_side;
        // Only a hand-over is an event of its own between the cause and this, unless it was held.
        let handed_over = head.cause().filter(|cause| *cause != self.key && !held);
        let handed_over = handed_over.and_then(|_| NonZeroU64::new(self.key.count));
        let scheduled_by = held.then_some(self.key);
        for (copy, verdict) in verdicts.list.iter().enumerate() {
            let last = copy + 1 == verdicts.list.len();
            let Some(own) = (if last {
                letter.take()
            } else {
                self.copy_of(letter.as_ref(), kind)
            }) else {
                return;
            };
            let mut head = head.as_copy(head.copy() + copy as u32);
            head.handed_over = handed_over;
            if let Err(cause) = self.obey(link, count, *verdict, (head, own, kind), scheduled_by) {
                return self.raise(cause);
            }
        }
        if verdicts.list.is_empty() {
            self.raise(FaultCause::NoFate {
                link: self.topology.name(link).to_owned(),
                kind: kind.name().to_owned(),
                sender: self.topology.name(head.sender).to_owned(),
            });
        }
    }

    /// Does to one copy what the link decided.
    #[inline(always)]
    fn obey(
        &mut self,
        link: EntityId,
        count: &mut u64,
        verdict: Verdict,
        (mut head, letter, kind): (Head, Sealed, &Kind),
        scheduled_by: Option<EventKey>,
    ) -> Result<(), FaultCause> {
        let side = |carriage: Option<Carriage>| {
            (carriage.is_some() || scheduled_by.is_some()).then_some(Side {
                carriage,
                scheduled_by,
                ..Side::default()
            })
        };
        let (class, engine, after, side) = match verdict {
            Verdict::Deliver { after, carriage } => {
                self.check_delay(link, after)?;
                let engine = self.topology.place(head.receiver).engine;
                (Class::Message, engine, after, side(carriage))
            }
            Verdict::Hold { after, token } => {
                let side = Side {
                    scheduled_by,
                    token,
                    ..Side::default()
                };
                (Class::Held, self.index, after, Some(side))
            }
            Verdict::Park {
                latest,
                token,
                copy,
            } => {
                head = head.as_copy(copy.unwrap_or(head.copy()));
                let side = Side {
                    scheduled_by,
                    token,
                    parked: true,
                    ..Side::default()
                };
                self.park(link, count, latest, (head, letter, side));
                return Ok(());
            }
            Verdict::Lose {
                after,
                reason,
                carriage,
            } => {
                head.reason = self.topology.intern(reason);
                if after.is_zero() {
                    self.lose(head, &letter, kind, side(carriage));
                    return Ok(());
                }
                (Class::LateLoss, self.index, after, side(carriage))
            }
        };
        let key = self.later_key(link, count, after);
        head.class = class;
        let pending = Pending {
            head,
            letter: Some(letter),
            side,
        };
        self.schedule_with(engine, key, pending);
        Ok(())
    }

    /// A further copy of a message, through its encoding.
    fn copy_of(&mut self, letter: Option<&Sealed>, kind: &Kind) -> Option<Sealed> {
        let letter = letter?;
        let mut bytes = Vec::new();
        let encoded = letter
            .0
            .encode(kind.schema(), &mut bytes)
            .map_err(|error| error.to_string());
        let copy = encoded.and_then(|()| {
            letter
                .0
                .decode(kind.schema(), &bytes)
                .map_err(|error| error.to_string())
        });
        match copy {
            Ok(copy) => Some(copy),
            Err(error) => {
                self.raise(FaultCause::Encoding {
                    kind: kind.name().to_owned(),
                    error,
                });
                None
            }
        }
    }

    fn check_delay(&self, link: EntityId, actual: SimDuration) -> Result<(), FaultCause> {
        let declared = self
            .topology
            .links
            .get(&link)
            .map_or(SimDuration::ZERO, |link| link.min_delay);
        if actual >= declared || !self.topology.check_min_delay {
            return Ok(());
        }
        // A delay that would pass the clock's end stops there. Nothing happens at that instant, so
        // nobody hears of it too soon.
        if self.key.time + actual == SimTime::MAX {
            return Ok(());
        }
        let link = self.topology.name(link).to_owned();
        Err(FaultCause::UndercutsMinDelay {
            link,
            declared,
            actual,
        })
    }

    fn lose(&mut self, head: Head, letter: &Sealed, kind: &Kind, side: Option<Side>) {
        let start = self.effect_bytes.len();
        if self.topology.recording()
            && let Err(error) = letter.0.encode(kind.schema(), &mut self.effect_bytes)
        {
            let (kind, error) = (kind.name().to_owned(), error.to_string());
            return self.raise(FaultCause::Encoding { kind, error });
        }
        self.effects.push(Effect::Lost {
            head,
            body: start..self.effect_bytes.len(),
            side: side.map(Box::new),
        });
    }
}
