//! A rover's side of the protocol: what it is offered, holds, starts and gives back.

mod durable;
mod error;
mod receive;
mod send;

use std::collections::BTreeMap;
use std::sync::Arc;

use farside::SimTime;

use super::contact::Contact;
use super::definition::{Parameter, Role, Stage};
use super::messages::{Acknowledged, GoalAck, GoalRelease, Held, HoldingState, Message, Output};
use super::outcomes::Outcome;
use super::settings::Settings;
use super::values::{
    GoalKey, Grant, Parameters, Party, Reason, Revision, SharedGoal, Term, Version,
};
pub use durable::{Closing, Holding, OwnerDurable, OwnerWrite, Promise};
pub use error::OwnerError;

/// A rover's side of the protocol. See [the module](super) for an example.
#[derive(Clone, Debug)]
pub struct Owner {
    settings: Arc<Settings>,
    rover: u32,
    durable: OwnerDurable,
    /// What the planner has not decided. A crash forgets it, and the centre repeats it.
    offers: BTreeMap<GoalKey, Offer>,
    calls: BTreeMap<GoalKey, BidCall>,
    parties: Vec<Party>,
    peers: Vec<Peer>,
    /// The last status of each rover.
    team: Vec<Option<TeamStatus>>,
    /// Ends of holdings that the centre of the present term has taken.
    taken: BTreeMap<GoalKey, Grant>,
    /// When candidates are told the status again.
    heartbeat: SimTime,
    /// Whether the status has changed since its version was written.
    is_changed: bool,
}

/// What an owner knows of another party.
#[derive(Clone, Debug)]
struct Peer {
    contact: Contact,
    /// The latest version of this rover's status that it has.
    has_status: Option<Version>,
}

/// A goal that the centre wants this rover to do; the planner has to decide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offer {
    /// The goal.
    pub goal: SharedGoal,
    /// Which edition of it.
    pub revision: Revision,
    /// Under which grant.
    pub grant: Grant,
    /// When the right to start it ends.
    pub lease_end: SimTime,
    /// The term of the centre that offers it.
    pub by: Term,
}

/// A goal for which bids are asked; the planner has to say what it would add to its score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BidCall {
    /// The goal.
    pub goal: SharedGoal,
    /// Which edition of it.
    pub revision: Revision,
    /// When bids are compared.
    pub until: SimTime,
    /// The term of the centre that asks.
    pub by: Term,
}

/// What another rover has told of itself last.
#[derive(Clone, Debug, PartialEq)]
pub struct TeamStatus {
    /// Which status it was.
    pub version: Version,
    /// What the rover held.
    pub holdings: Vec<Held>,
}

/// What a call of a planner comes to.
type Decided = Result<Output<OwnerWrite>, OwnerError>;

impl Owner {
    /// Starts the owner on a rover, with what is left of an earlier one in durable memory.
    pub fn start(
        settings: Arc<Settings>,
        rover: u32,
        durable: OwnerDurable,
        now: SimTime,
    ) -> (Owner, Output<OwnerWrite>) {
        let parties = settings.parties();
        let peer = || Peer {
            contact: Contact::new(&settings, now),
            has_status: None,
        };
        let peers = parties.iter().map(|_| peer()).collect();
        let mut owner = Owner {
            rover,
            offers: BTreeMap::new(),
            calls: BTreeMap::new(),
            peers,
            team: vec![None; settings.rovers as usize],
            taken: BTreeMap::new(),
            heartbeat: now + settings.status_every,
            is_changed: false,
            parties,
            settings,
            durable,
        };
        let mut out = Output::default();
        let version = Version {
            incarnation: owner.durable.version.incarnation + 1,
            sequence: owner.durable.version.sequence + 1,
        };
        // Whatever it refused before, it is in another situation now.
        let capacity = owner.durable.capacity + 1;
        owner.write(OwnerWrite::Status { version, capacity }, &mut out);
        owner.finish(now, &mut out);
        (owner, out)
    }

    /// What is written.
    pub fn durable(&self) -> &OwnerDurable {
        &self.durable
    }

    /// Goals that wait for [`Owner::accept`] or [`Owner::refuse`].
    pub fn offers(&self) -> impl Iterator<Item = &Offer> {
        self.offers.values()
    }

    /// Goals that wait for [`Owner::bid`].
    pub fn calls(&self) -> impl Iterator<Item = &BidCall> {
        self.calls.values()
    }

    /// What another rover has told of itself last, which may be long ago.
    pub fn told_by(&self, rover: u32) -> Option<&TeamStatus> {
        self.team.get(rover as usize).and_then(Option::as_ref)
    }

    /// Whether the rover may start a goal now, and if not, why.
    ///
    /// # Errors
    /// When it is not held, has started, is achieved, does not end within its lease, or is half of a
    /// joint goal whose other half nobody is known to be bound to.
    pub fn may_begin(&self, now: SimTime, goal: GoalKey) -> Result<(), OwnerError> {
        let rules = &self.settings.rules;
        let holding = self.holding(goal)?;
        if holding.started.is_some() {
            let started = true;
            return Err(OwnerError::Started { goal, started });
        }
        let (ends, lease_end) = (now + holding.goal.parameters.duration, holding.lease_end);
        if ends > lease_end && rules.start_in_lease {
            return Err(OwnerError::LeaseTooShort {
                goal,
                ends,
                lease_end,
            });
        }
        if holding.goal.partner.is_some() && !holding.confirmed && rules.bind_pairs {
            return Err(OwnerError::Unconfirmed { goal });
        }
        if self.durable.outcomes.achieved(goal) && rules.drop_achieved {
            return Err(OwnerError::Achieved { goal });
        }
        Ok(())
    }

    fn holding(&self, goal: GoalKey) -> Result<&Holding, OwnerError> {
        let holding = self.durable.held.get(&goal);
        holding.ok_or(OwnerError::NotHeld { goal })
    }

    /// Takes an offered goal.
    ///
    /// # Errors
    /// When it is not offered, or no longer.
    pub fn accept(&mut self, now: SimTime, goal: GoalKey) -> Decided {
        let offer = self.offer(now, goal)?;
        let mut out = Output::default();
        self.offers.remove(&goal);
        let holding = Holding {
            goal: offer.goal,
            revision: offer.revision,
            grant: offer.grant,
            lease_end: offer.lease_end,
            confirmed: false,
            started: None,
        };
        self.write(OwnerWrite::Held(holding), &mut out);
        self.is_changed = true;
        self.tell_holding(now, goal, &mut out);
        self.finish(now, &mut out);
        Ok(out)
    }

    /// Does not take an offered goal.
    ///
    /// # Errors
    /// When it is not offered, or no longer.
    pub fn refuse(&mut self, now: SimTime, goal: GoalKey, reason: Reason) -> Decided {
        let offer = self.offer(now, goal)?;
        let mut out = Output::default();
        self.offers.remove(&goal);
        self.close(goal, offer.grant, HoldingState::Refused, reason, &mut out);
        self.tell_holding(now, goal, &mut out);
        self.finish(now, &mut out);
        Ok(out)
    }

    fn offer(&self, now: SimTime, goal: GoalKey) -> Result<Offer, OwnerError> {
        let offer = self.offers.get(&goal);
        let offer = offer.filter(|offer| now < offer.lease_end);
        offer.copied().ok_or(OwnerError::NotOffered { goal, now })
    }

    /// Says what a goal would add to the rover's score; none if it does not want it.
    ///
    /// # Errors
    /// When nobody asks for a bid, or no longer.
    pub fn bid(&mut self, now: SimTime, goal: GoalKey, score: Option<f64>) -> Decided {
        let call = self.calls.remove(&goal);
        let call = call.ok_or(OwnerError::NotOffered { goal, now })?;
        let mut out = Output::default();
        let what = Acknowledged::Bid {
            goal,
            revision: call.revision,
            score: score.filter(|score| score.is_finite()),
            capacity: self.durable.capacity,
        };
        let centre = Party::Centre(call.by.centre);
        self.reply(
            now,
            centre,
            Message::Ack(GoalAck {
                from: self.me(),
                what,
            }),
            &mut out,
        );
        self.finish(now, &mut out);
        Ok(out)
    }

    /// Gives a goal back, for good: it comes again under another grant only.
    ///
    /// # Errors
    /// When it is not held, has started, or is half of a joint goal.
    pub fn release(&mut self, now: SimTime, goal: GoalKey, reason: Reason) -> Decided {
        let holding = *self.holding(goal)?;
        if holding.started.is_some() && self.settings.rules.release_binds {
            let started = true;
            return Err(OwnerError::Started { goal, started });
        }
        if holding.goal.partner.is_some() && self.settings.rules.bind_pairs {
            return Err(OwnerError::Bound { goal });
        }
        let mut out = Output::default();
        let state = HoldingState::Released;
        self.close(goal, holding.grant, state, reason, &mut out);
        if let Some(held) = self.durable.present(goal) {
            let release = Message::Release(GoalRelease {
                from: self.me(),
                held,
            });
            self.reply(now, self.centre(), release, &mut out);
        }
        self.finish(now, &mut out);
        Ok(out)
    }

    /// Starts a goal. The activity may begin once what this returns is written.
    ///
    /// # Errors
    /// As [`Owner::may_begin`].
    pub fn begin(&mut self, now: SimTime, goal: GoalKey) -> Decided {
        self.may_begin(now, goal)?;
        let mut holding = *self.holding(goal)?;
        let mut out = Output::default();
        holding.started = Some(now);
        self.write(OwnerWrite::Held(holding), &mut out);
        self.is_changed = true;
        self.finish(now, &mut out);
        Ok(out)
    }

    /// A started goal is done.
    ///
    /// # Errors
    /// When it is not held, or has not started.
    pub fn done(&mut self, now: SimTime, goal: GoalKey) -> Decided {
        let holding = *self.started(goal)?;
        let mut out = Output::default();
        let outcome = Outcome {
            rover: self.rover,
            ordinal: self.durable.outcomes.through(self.rover) + 1,
            goal,
            partner: holding.goal.partner,
            grant: holding.grant,
            at: now,
            duplicate: self.durable.outcomes.achieved(goal),
        };
        self.write(OwnerWrite::Outcome(outcome), &mut out);
        let closing = Closing {
            goal,
            grant: holding.grant,
            state: HoldingState::Done,
            reason: None,
            capacity: self.durable.capacity,
            outcome: Some(outcome),
        };
        self.write(OwnerWrite::Closed(closing), &mut out);
        self.is_changed = true;
        self.finish(now, &mut out);
        Ok(out)
    }

    /// A goal that has started, or half of a joint goal, cannot be done after all.
    ///
    /// # Errors
    /// When it is not held, or could be released.
    pub fn failed(&mut self, now: SimTime, goal: GoalKey, reason: Reason) -> Decided {
        let holding = *self.holding(goal)?;
        if holding.started.is_none() && holding.goal.partner.is_none() {
            let started = false;
            return Err(OwnerError::Started { goal, started });
        }
        let mut out = Output::default();
        let state = HoldingState::Failed;
        self.close(goal, holding.grant, state, reason, &mut out);
        self.finish(now, &mut out);
        Ok(out)
    }

    fn started(&self, goal: GoalKey) -> Result<&Holding, OwnerError> {
        let holding = self.holding(goal)?;
        let started = holding.started.is_some();
        let found = started.then_some(holding);
        found.ok_or(OwnerError::Started { goal, started })
    }

    /// Sets a parameter of a goal that the rover holds, and tells everyone.
    ///
    /// # Errors
    /// When the goal is not held, or the activity does not let owners set this at this stage.
    pub fn set(
        &mut self,
        now: SimTime,
        goal: GoalKey,
        parameter: Parameter,
        to: &Parameters,
    ) -> Decided {
        let mut holding = *self.holding(goal)?;
        let stage = match holding.started {
            None => Stage::Owned,
            Some(_) => Stage::Started,
        };
        if !self
            .settings
            .activity
            .may_set(Role::Owner, parameter, stage)
        {
            return Err(OwnerError::NotPermitted { parameter, stage });
        }
        let mut out = Output::default();
        holding.goal.parameters.take(parameter, to);
        if holding.goal != self.holding(goal)?.goal {
            self.write(OwnerWrite::Held(holding), &mut out);
            self.is_changed = true;
        }
        self.finish(now, &mut out);
        Ok(out)
    }

    /// The rover may be able now to do what it has refused.
    pub fn capacity_changed(&mut self, now: SimTime) -> Output<OwnerWrite> {
        let mut out = Output::default();
        let capacity = self.durable.capacity + 1;
        let version = self.durable.version;
        self.write(OwnerWrite::Status { version, capacity }, &mut out);
        self.is_changed = true;
        self.finish(now, &mut out);
        out
    }

    /// Time has passed: at the instant of [`Owner::wake`], or at any other.
    pub fn tick(&mut self, now: SimTime) -> Output<OwnerWrite> {
        let mut out = Output::default();
        if now >= self.heartbeat {
            self.heartbeat = now + self.settings.status_every;
            for index in self.settings.rovers as usize..self.parties.len() {
                self.peers[index].has_status = None;
                self.peers[index].contact.poke(&self.settings, now);
            }
        }
        self.finish(now, &mut out);
        out
    }

    /// When [`Owner::tick`] has to be called at the latest.
    pub fn wake(&self, now: SimTime) -> SimTime {
        let ends = self.durable.held.values();
        let ends = ends.filter(|holding| holding.started.is_none());
        let ends = ends.map(|holding| holding.lease_end);
        let offers = self.offers.values().map(|offer| offer.lease_end);
        let due = self.peers.iter().filter_map(|peer| peer.contact.due);
        let due = due.filter_map(|due| self.settings.windows.next_open(due.max(now)));
        let later = ends.chain(offers).filter(|&at| at > now);
        let all = later.chain(due);
        all.min()
            .map_or(self.heartbeat, |first| first.min(self.heartbeat))
    }
}

/// What all calls end with.
impl Owner {
    fn write(&mut self, write: OwnerWrite, out: &mut Output<OwnerWrite>) {
        self.durable.apply(&write);
        if self.settings.rules.write_first || !matches!(write, OwnerWrite::Held(_)) {
            out.writes.push(write);
        }
    }

    fn close(
        &mut self,
        goal: GoalKey,
        grant: Grant,
        state: HoldingState,
        reason: Reason,
        out: &mut Output<OwnerWrite>,
    ) {
        let closing = Closing {
            goal,
            grant,
            state,
            reason: Some(reason),
            capacity: self.durable.capacity,
            // Who is told that another rover has done it can know it for itself at once.
            outcome: match state {
                HoldingState::Superseded => self.durable.outcomes.of(goal).next().copied(),
                _ => None,
            },
        };
        self.write(OwnerWrite::Closed(closing), out);
        self.is_changed = true;
    }

    /// The centre that the rover supports.
    fn centre(&self) -> Party {
        let Term { number, centre } = self.durable.promise.term;
        Party::Centre(if number == 0 {
            self.settings.candidates[0]
        } else {
            centre
        })
    }

    /// Sends something at once, if anything may be sent. If not, who asked asks again.
    fn reply(&self, now: SimTime, to: Party, message: Message, out: &mut Output<OwnerWrite>) {
        if self.settings.windows.is_open(now) {
            out.sends.push((to, message));
        }
    }

    /// Tells the centre what the rover has of a goal.
    fn tell_holding(&self, now: SimTime, goal: GoalKey, out: &mut Output<OwnerWrite>) {
        if let Some(held) = self.durable.present(goal) {
            let what = Acknowledged::Holding(held);
            self.reply(
                now,
                self.centre(),
                Message::Ack(GoalAck {
                    from: self.me(),
                    what,
                }),
                out,
            );
        }
    }

    fn finish(&mut self, now: SimTime, out: &mut Output<OwnerWrite>) {
        self.expire(now, out);
        if std::mem::take(&mut self.is_changed) {
            let mut version = self.durable.version;
            version.sequence += 1;
            let capacity = self.durable.capacity;
            self.write(OwnerWrite::Status { version, capacity }, out);
            self.poke_all(now);
        }
        if self.settings.windows.is_open(now) {
            for index in 0..self.peers.len() {
                self.flush(now, index, out);
            }
        }
    }

    fn me(&self) -> Party {
        Party::Owner(self.rover)
    }

    fn poke_all(&mut self, now: SimTime) {
        for peer in &mut self.peers {
            peer.contact.poke(&self.settings, now);
        }
    }

    /// Ends what has ended: leases that were not used, offers that nobody decided on, and goals that
    /// others have achieved.
    fn expire(&mut self, now: SimTime, out: &mut Output<OwnerWrite>) {
        self.offers.retain(|_, offer| now < offer.lease_end);
        self.calls.retain(|_, call| now < call.until);
        let rules = self.settings.rules;
        let unstarted = self
            .durable
            .held
            .values()
            .filter(|holding| holding.started.is_none());
        let ended: Vec<(Holding, HoldingState, Reason)> = unstarted
            .filter_map(|holding| {
                if rules.drop_achieved && self.durable.outcomes.achieved(holding.goal.key) {
                    Some((*holding, HoldingState::Superseded, Reason::Achieved))
                } else if rules.start_in_lease && now >= holding.lease_end {
                    Some((*holding, HoldingState::Lapsed, Reason::LeaseEnded))
                } else {
                    None
                }
            })
            .collect();
        for (holding, state, reason) in ended {
            self.close(holding.goal.key, holding.grant, state, reason, out);
        }
    }
}
