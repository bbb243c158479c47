//! Messages and links: a link is shown a message, and what it decides becomes events; an actor
//! tells a link something.

use std::any::Any;
use std::cell::Cell;
use std::num::NonZeroU64;

use super::{Effect, Parts};
use crate::carrier::{Carriage, Parcel, Verdict};
use crate::engine::{CellState, Class, Head, Outgoing, Parked, Pending, Sealed, Side};
use crate::fault::FaultCause;
use crate::ids::{EntityId, KindIndex};
use crate::key::EventKey;
use crate::queue::Entry;
use crate::time::{SimDuration, SimTime};

impl Parts {
    /// Lets `link` decide the fate of a message, now; `held` if it held it before. Returns what the
    /// sender is charged at once, in joules: what an own link asks for. The letter is taken.
    ///
    /// Inlined where a message is sent, which no link has held.
    #[inline(always)]
    pub(super) fn carry(
        &mut self,
        link: EntityId,
        head: &mut Head,
        letter: &mut Option<Sealed>,
        held: Option<Side>,
    ) -> f64 {
        self.carrying = Some(link);
        let Parts {
            topology, links, ..
        } = self;
        let (Some(kind), Some(sealed)) = (head.kind(), letter.as_ref()) else {
            return 0.0;
        };
        let local = topology.place(link).local as usize;
        let parcel = Parcel {
            topology,
            now: self.key.time,
            sent: head.sent(self.key),
            link,
            sender: head.sender,
            receiver: head.receiver,
            kind: topology.kind(kind),
            kind_index: kind,
            ordinal: head.ordinal,
            repeat: head.repeat(),
            copy: head.copy(),
            token: held.map(|held| held.token),
            match_key: head.match_key(),
            letter: &*sealed.0,
            size: Cell::new(None),
        };
        let cell = &mut links[local];
        if let Some(held) = held.filter(|held| held.parked) {
            cell.parked.remove(&held.token);
        }
        cell.carrier.carry(&parcel, &mut self.verdicts);
        if let Some(rulings) = &topology.rulings {
            let min_delay = topology.links.get(link).map(|link| link.min_delay);
            let min_delay = min_delay.unwrap_or_default();
            self.verdicts.rule(rulings, &parcel, min_delay);
        }
        let mut count = cell.count;
        self.execute(link, &mut count, head, letter);
        for at in 0..self.verdicts.wakes.len() {
            let (token, delay) = self.verdicts.wakes[at];
            self.wake(link, &mut count, token, delay);
        }
        self.verdicts.wakes.clear();
        self.links[local].count = count;
        let charge_j = std::mem::take(&mut self.verdicts.charge_j);
        let charge_receiver_j = std::mem::take(&mut self.verdicts.charge_receiver_j);
        self.verdicts.list.clear();
        if self.fault.is_none() {
            self.carrying = None;
        }
        if charge_j == 0.0 && charge_receiver_j == 0.0 {
            return 0.0;
        }
        self.charge(link, head, held.is_some(), charge_j, charge_receiver_j)
    }

    /// [`Parts::carry`] for a shared link, or one that held the message.
    pub(crate) fn carry_on(
        &mut self,
        link: EntityId,
        mut head: Head,
        letter: Sealed,
        held: Option<Side>,
    ) -> f64 {
        self.carry(link, &mut head, &mut Some(letter), held)
    }

    /// Charges what a link asks for; returns what the sender is charged at once, in joules.
    #[inline(never)]
    fn charge(
        &mut self,
        link: EntityId,
        head: &Head,
        held: bool,
        charge_j: f64,
        charge_receiver_j: f64,
    ) -> f64 {
        if charge_receiver_j != 0.0 {
            let charge = Carriage {
                receive_j: charge_receiver_j,
                ..Carriage::default()
            };
            self.charge_later(link, head.receiver, charge);
        }
        // Only while its sender is at hand can a message's cost be charged at once, and whether it
        // is must not hang on how hosts are dealt to engines.
        if charge_j == 0.0 || !held && !self.topology.links.is_shared(link) {
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

    fn charge_later(&mut self, link: EntityId, whom: EntityId, charge: Carriage) {
        let min_delay = self.topology.links.get(link).map(|link| link.min_delay);
        let local = self.topology.place(link).local as usize;
        let mut count = self.links[local].count;
        let key = self.later_key(link, &mut count, min_delay.unwrap_or(SimDuration::ZERO));
        self.links[local].count = count;
        let pending = Pending {
            head: Head::of_entity(Class::Charge, whom),
            letter: None,
            side: Some(Side {
                carriage: Some(charge),
                ..Side::default()
            }),
        };
        self.schedule_with(self.topology.place(whom).engine, key, pending);
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
        if mine.host != its.host && !self.topology.links.is_shared(link) {
            return self.raise(FaultCause::NoRoute {
                from: self.topology.host_name(me).to_owned(),
                to: self.topology.host_name(link).to_owned(),
                receiver: self.topology.name(link).to_owned(),
                kind: "a change".to_owned(),
            });
        }
        let kind = self.topology.links.get(link).map(|link| link.change_kind);
        let ordinal = state.next_of_entity(link, kind.unwrap_or(KindIndex::MAX));
        let mut head = Head::of_entity(Class::Tell, me);
        head.receiver = link;
        let head = head.caused(self.key, KindIndex::MAX, ordinal).of_kind(kind);
        let key = self.later_key(me, &mut state.count, SimDuration::ZERO);
        self.schedule(its.engine, key, head, Some(letter));
    }

    /// Gives a link a change.
    pub(crate) fn tell(&mut self, link: EntityId, change: Box<dyn Any + Send>, now: SimTime) {
        let local = self.topology.place(link).local as usize;
        self.links[local].carrier.change(change, now);
    }

    /// Turns a link's verdicts into events, the last copy with the letter itself.
    #[inline(always)]
    fn execute(
        &mut self,
        link: EntityId,
        count: &mut u64,
        head: &mut Head,
        letter: &mut Option<Sealed>,
    ) {
        // Only a hand-over is an event of its own between the cause and this.
        head.handed_over = match head.class {
            Class::HandOver => NonZeroU64::new(self.key.count),
            _ => None,
        };
        // Of the messages that a link decides about, only those that it held have a side.
        let held = head.has_side;
        if let [Verdict::Deliver { after, carriage }] = &self.verdicts.list[..]
            && carriage.is_none()
            && !held
        {
            let after = *after;
            return match self.check_delay(link, after) {
                Ok(()) => self.deliver(link, count, after, head, letter),
                Err(cause) => self.raise(*cause),
            };
        }
        self.execute_all(link, count, head, letter, held.then_some(self.key));
    }

    /// The way of nearly all messages through a link: one copy, of which nothing more is to be known.
    #[inline(always)]
    fn deliver(
        &mut self,
        link: EntityId,
        count: &mut u64,
        after: SimDuration,
        head: &mut Head,
        letter: &mut Option<Sealed>,
    ) {
        let engine = self.topology.place(head.receiver).engine;
        let key = self.later_key(link, count, after);
        head.class = Class::Message;
        if engine == self.index {
            self.insert(key, *head, letter.take());
        } else {
            let (head, letter, side) = (*head, letter.take(), None);
            self.outgoing.push(Outgoing {
                engine,
                key,
                pending: Pending { head, letter, side },
            });
        }
    }

    /// As [`Parts::execute`], for any verdicts.
    #[inline(never)]
    fn execute_all(
        &mut self,
        link: EntityId,
        count: &mut u64,
        head: &Head,
        letter: &mut Option<Sealed>,
        scheduled_by: Option<EventKey>,
    ) {
        let copies = self.verdicts.list.len();
        if let Some(cause) = self.contradiction(link, head, scheduled_by.is_some()) {
            return self.raise(cause);
        }
        for copy in 0..copies {
            let Some(own) = (if copy + 1 == copies {
                letter.take()
            } else {
                self.copy_of(letter.as_ref(), head)
            }) else {
                return;
            };
            let verdict = self.verdicts.list[copy];
            let head = head.as_copy(self.copy_number(head, scheduled_by.is_some(), copy));
            if let Err(cause) = self.obey(link, count, verdict, (head, own), scheduled_by) {
                return self.raise(*cause);
            }
        }
        if copies == 0 {
            let kind = head.kind().map(|kind| self.topology.kind(kind).name());
            self.raise(FaultCause::NoFate {
                link: self.topology.name(link).to_owned(),
                kind: kind.unwrap_or_default().to_owned(),
                sender: self.topology.name(head.sender).to_owned(),
            });
        }
    }

    /// The number of the copy that a verdict is about. Of a held copy all verdicts but those about
    /// further copies, which have numbers of their own, are about itself.
    fn copy_number(&self, head: &Head, held: bool, verdict: usize) -> u32 {
        match self.verdicts.list[verdict] {
            Verdict::Park {
                copy: Some(copy), ..
            } => copy,
            _ if held => head.copy(),
            _ => head.copy() + verdict as u32,
        }
    }

    /// Two verdicts about one copy, if there are any: it would have two fates.
    fn contradiction(&self, link: EntityId, head: &Head, held: bool) -> Option<FaultCause> {
        let list = &self.verdicts.list;
        let own = |verdict: &Verdict| matches!(verdict, Verdict::Park { copy: Some(_), .. });
        if !held && !list.iter().any(own) {
            return None;
        }
        let numbers = 0..list.len();
        let mut numbers: Vec<u32> = numbers
            .map(|verdict| self.copy_number(head, held, verdict))
            .collect();
        numbers.sort_unstable();
        let twice = numbers.windows(2).find(|pair| pair[0] == pair[1])?;
        let kind = head.kind().map(|kind| self.topology.kind(kind).name());
        Some(FaultCause::TwoFates {
            link: self.topology.name(link).to_owned(),
            copy: twice[0],
            kind: kind.unwrap_or_default().to_owned(),
            sender: self.topology.name(head.sender).to_owned(),
        })
    }

    /// That a link gives a copy that it delivers a delay that is the sum of its parts.
    fn check_parts(
        &self,
        link: EntityId,
        head: &Head,
        after: SimDuration,
        carriage: Option<&Carriage>,
    ) -> Result<(), Box<FaultCause>> {
        // Longer ones do not fit into what is told of jitter, and stop at the clock's end.
        const LONGEST: SimDuration = SimDuration::from_nanos(i64::MAX as u64);
        let Some(carriage) = carriage else {
            return Ok(());
        };
        let delay = (self.key.time + after).since(head.sent(self.key));
        let parts = carriage.total();
        if parts == delay || delay > LONGEST {
            return Ok(());
        }
        Err(Box::new(FaultCause::PartsOfDelay {
            link: self.topology.name(link).to_owned(),
            delay,
            parts,
        }))
    }

    /// Does to one copy what the link decided.
    fn obey(
        &mut self,
        link: EntityId,
        count: &mut u64,
        verdict: Verdict,
        (mut head, letter): (Head, Sealed),
        scheduled_by: Option<EventKey>,
    ) -> Result<(), Box<FaultCause>> {
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
                self.check_parts(link, &head, after, carriage.as_ref())?;
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
            Verdict::Park { latest, token, .. } => {
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
                if reason.is_empty() {
                    let kind = head.kind().map(|kind| self.topology.kind(kind).name());
                    return Err(Box::new(FaultCause::NoReason {
                        link: self.topology.name(link).to_owned(),
                        kind: kind.unwrap_or_default().to_owned(),
                        sender: self.topology.name(head.sender).to_owned(),
                    }));
                }
                head.reason = self.topology.intern(reason);
                if after.is_zero() {
                    self.lose(head, &letter, side(carriage));
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
    fn copy_of(&mut self, letter: Option<&Sealed>, head: &Head) -> Option<Sealed> {
        let letter = letter?;
        let kind = self.topology.kind(head.kind()?);
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
                let kind = kind.name().to_owned();
                self.raise(FaultCause::Encoding { kind, error });
                None
            }
        }
    }

    #[inline(always)]
    fn check_delay(&self, link: EntityId, actual: SimDuration) -> Result<(), Box<FaultCause>> {
        let declared = self
            .topology
            .links
            .get(link)
            .map_or(SimDuration::ZERO, |link| link.min_delay);
        if actual >= declared || !self.topology.check_min_delay {
            return Ok(());
        }
        self.undercut(link, declared, actual)
    }

    #[cold]
    fn undercut(
        &self,
        link: EntityId,
        declared: SimDuration,
        actual: SimDuration,
    ) -> Result<(), Box<FaultCause>> {
        // A delay that would pass the clock's end stops there. Nothing happens at that instant, so
        // nobody hears of it too soon.
        if self.key.time + actual == SimTime::MAX {
            return Ok(());
        }
        let link = self.topology.name(link).to_owned();
        Err(Box::new(FaultCause::UndercutsMinDelay {
            link,
            declared,
            actual,
        }))
    }

    fn lose(&mut self, head: Head, letter: &Sealed, side: Option<Side>) {
        let start = self.effect_bytes.len();
        if self.recording
            && let Some(kind) = head.kind().map(|kind| self.topology.kind(kind))
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
