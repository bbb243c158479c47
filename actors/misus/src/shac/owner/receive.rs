//! What an owner does with what it is told.

use farside::SimTime;

use super::{BidCall, Holding, Offer, Owner, OwnerWrite, Promise, TeamStatus};
use crate::shac::definition::{Parameter, Role, Stage};
use crate::shac::messages::{
    Acknowledged, AssignTerms, GoalAck, GoalAssign, GoalCancel, GoalDigest, GoalOutcome,
    GoalStatus, Held, HoldingState, Message, Output, Support,
};
use crate::shac::outcomes::Outcome;
use crate::shac::values::{GoalKey, Grant, Party, Reason, Term};

impl Owner {
    /// Takes a message. From who takes no part, it is ignored.
    pub fn receive(&mut self, now: SimTime, message: &Message) -> Output<OwnerWrite> {
        let mut out = Output::default();
        let from = message.from();
        let Some(index) = self.settings.index(from) else {
            return out;
        };
        self.peers[index].contact.hear(&self.settings, now);
        match message {
            Message::Assign(assign) => self.on_assign(now, index, assign, &mut out),
            Message::Cancel(cancel) => self.on_cancel(now, index, cancel, &mut out),
            Message::Ack(ack) => self.on_ack(index, &ack.what),
            Message::Status(status) => self.on_status(now, from, status, &mut out),
            Message::Outcome(outcome) => self.on_outcome(now, from, outcome, &mut out),
            Message::Digest(digest) => self.on_digest(now, index, digest, &mut out),
            Message::Release(_) => {}
        }
        self.finish(now, &mut out);
        out
    }

    /// Supports another term from now on: what earlier centres offered is void, and the new one is told
    /// all ends of holdings again.
    fn follow(&mut self, term: Term, until: SimTime, out: &mut Output<OwnerWrite>) {
        let until = until.max(self.durable.promise.until);
        self.write(OwnerWrite::Promise(Promise { term, until }), out);
        self.offers.retain(|_, offer| offer.by >= term);
        self.calls.retain(|_, call| call.by >= term);
        self.taken.clear();
        self.is_changed = true;
    }

    /// Whether a centre's term counts. If it is over, the centre is told so.
    fn obeys(
        &mut self,
        now: SimTime,
        index: usize,
        by: Term,
        out: &mut Output<OwnerWrite>,
    ) -> bool {
        let term = self.durable.promise.term;
        if by < term {
            self.peers[index].contact.owes_digest = true;
            self.peers[index].contact.poke(&self.settings, now);
            return false;
        }
        if by > term {
            self.follow(by, SimTime::ZERO, out);
        }
        true
    }

    fn on_assign(
        &mut self,
        now: SimTime,
        index: usize,
        assign: &GoalAssign,
        out: &mut Output<OwnerWrite>,
    ) {
        if !self.obeys(now, index, assign.by, out) {
            return;
        }
        let (key, from) = (assign.goal.key, self.parties[index]);
        if self.durable.outcomes.achieved(key) && self.settings.rules.drop_achieved {
            let outcomes: Vec<Outcome> = self.durable.outcomes.of(key).copied().collect();
            let message = Message::Outcome(GoalOutcome {
                from: self.me(),
                outcomes,
            });
            return self.reply(now, from, message, out);
        }
        match assign.terms {
            AssignTerms::Offer { until } => {
                if !self.durable.held.contains_key(&key) && now < until {
                    let call = BidCall {
                        goal: assign.goal,
                        revision: assign.revision,
                        until,
                        by: assign.by,
                    };
                    self.calls.insert(key, call);
                }
            }
            AssignTerms::Lease { end, confirmed } => {
                self.on_lease(now, assign, end, confirmed, out);
            }
        }
    }

    fn on_lease(
        &mut self,
        now: SimTime,
        assign: &GoalAssign,
        end: SimTime,
        confirmed: bool,
        out: &mut Output<OwnerWrite>,
    ) {
        let key = assign.goal.key;
        if let Some(holding) = self.durable.held.get(&key).copied() {
            if holding.grant == assign.grant {
                self.prolong(holding, assign, end, confirmed, out);
            }
            if holding.grant >= assign.grant || holding.started.is_some() {
                return self.tell_holding(now, key, out);
            }
        }
        let closed = self.durable.closed.get(&key);
        let is_old = closed.is_some_and(|closing| closing.grant >= assign.grant);
        if is_old && self.settings.rules.newer_only {
            return self.tell_holding(now, key, out);
        }
        let offered = self.offers.get(&key);
        if offered.is_some_and(|offer| offer.grant > assign.grant) || now >= end {
            return;
        }
        self.calls.remove(&key);
        let offer = Offer {
            goal: assign.goal,
            revision: assign.revision,
            grant: assign.grant,
            lease_end: end,
            by: assign.by,
        };
        self.offers.insert(key, offer);
    }

    /// The same grant again, perhaps with a later end, a confirmation or other parameters.
    fn prolong(
        &mut self,
        before: Holding,
        assign: &GoalAssign,
        end: SimTime,
        confirmed: bool,
        out: &mut Output<OwnerWrite>,
    ) {
        let mut holding = before;
        holding.lease_end = holding.lease_end.max(end);
        holding.confirmed |= confirmed;
        if assign.revision > holding.revision {
            holding.revision = assign.revision;
            let stage = match holding.started {
                None => Stage::Owned,
                Some(_) => Stage::Started,
            };
            for parameter in Parameter::ALL {
                if self
                    .settings
                    .activity
                    .may_set(Role::Centre, parameter, stage)
                {
                    let told = &assign.goal.parameters;
                    holding.goal.parameters.take(parameter, told);
                }
            }
        }
        if holding != before {
            self.write(OwnerWrite::Held(holding), out);
        }
    }

    fn on_cancel(
        &mut self,
        now: SimTime,
        index: usize,
        cancel: &GoalCancel,
        out: &mut Output<OwnerWrite>,
    ) {
        if !self.obeys(now, index, cancel.by, out) {
            return;
        }
        let (key, grant) = (cancel.goal, cancel.grant);
        let offered = self.offers.get(&key);
        if offered.is_some_and(|offer| offer.grant <= grant) {
            self.offers.remove(&key);
        }
        // What was never accepted is noted as well, so that its assignment is refused when it comes
        // after its cancellation.
        if self.cancels(key, grant) {
            let state = HoldingState::Cancelled;
            self.close(key, grant, state, Reason::Revoked, out);
        }
        self.tell_holding(now, key, out);
    }

    /// Whether a cancellation of this grant ends something.
    fn cancels(&self, key: GoalKey, grant: Grant) -> bool {
        if let Some(holding) = self.durable.held.get(&key) {
            return holding.grant <= grant && holding.started.is_none();
        }
        let closed = self.durable.closed.get(&key);
        closed.is_none_or(|closing| closing.grant < grant)
    }

    fn on_ack(&mut self, index: usize, what: &Acknowledged) {
        let peer = &mut self.peers[index];
        match what {
            Acknowledged::Status(version) => peer.has_status = peer.has_status.max(Some(*version)),
            Acknowledged::Outcomes(have) => peer.contact.has(have),
            Acknowledged::Ends { by, ends } if *by == self.durable.promise.term => {
                for end in ends {
                    let closed = self.durable.closed.get(&end.goal);
                    if closed.is_some_and(|closing| closing.grant == end.grant) {
                        self.taken.insert(end.goal, end.grant);
                    }
                }
            }
            Acknowledged::Ends { .. }
            | Acknowledged::Holding(_)
            | Acknowledged::Bid { .. }
            | Acknowledged::Records(_) => {}
        }
    }

    fn on_status(
        &mut self,
        now: SimTime,
        from: Party,
        status: &GoalStatus,
        out: &mut Output<OwnerWrite>,
    ) {
        let Party::Owner(rover) = from else {
            return;
        };
        let known = &mut self.team[rover as usize];
        let is_newer = known
            .as_ref()
            .is_none_or(|known| status.version > known.version);
        if is_newer || !self.settings.rules.highest_status {
            *known = Some(TeamStatus {
                version: status.version,
                holdings: status.holdings.clone(),
            });
        }
        let version = known.as_ref().map_or(status.version, |known| known.version);
        let what = Acknowledged::Status(version);
        self.reply(
            now,
            from,
            Message::Ack(GoalAck {
                from: self.me(),
                what,
            }),
            out,
        );
    }

    fn on_outcome(
        &mut self,
        now: SimTime,
        from: Party,
        message: &GoalOutcome,
        out: &mut Output<OwnerWrite>,
    ) {
        for &outcome in &message.outcomes {
            self.learn_outcome(now, outcome, out);
        }
        let have = self.durable.outcomes.have(self.settings.rovers);
        let what = Acknowledged::Outcomes(have);
        self.reply(
            now,
            from,
            Message::Ack(GoalAck {
                from: self.me(),
                what,
            }),
            out,
        );
    }

    fn learn_outcome(&mut self, now: SimTime, outcome: Outcome, out: &mut Output<OwnerWrite>) {
        let is_known = self.durable.outcomes.contains(&outcome);
        if outcome.rover >= self.settings.rovers || is_known {
            return;
        }
        self.write(OwnerWrite::Outcome(outcome), out);
        if self.settings.rules.drop_achieved && self.durable.outcomes.achieved(outcome.goal) {
            self.offers.remove(&outcome.goal);
            self.calls.remove(&outcome.goal);
        }
        self.poke_all(now);
    }

    fn on_digest(
        &mut self,
        now: SimTime,
        index: usize,
        digest: &GoalDigest,
        out: &mut Output<OwnerWrite>,
    ) {
        let peer = &mut self.peers[index];
        peer.contact.has(&digest.have);
        if digest.status.is_none_or(|has| has < self.durable.version) {
            // It may have lost what it had acknowledged.
            peer.has_status = digest.status;
        }
        peer.contact.told(&self.settings, now, digest.asks);
        let term = self.durable.promise.term;
        if digest.renounces == Some(term) && self.durable.promise.until > now {
            let until = SimTime::ZERO;
            self.write(OwnerWrite::Promise(Promise { term, until }), out);
        }
        let supports = digest.seeks.and_then(|seeks| self.support(now, seeks, out));
        if digest.asks || digest.seeks.is_some() {
            let mut answer = self.digest(index, false);
            answer.supports = supports;
            if supports.is_some() {
                answer.holdings = self.everything();
            }
            let to = self.parties[index];
            self.reply(now, to, Message::Digest(answer), out);
        }
    }

    /// Promises to support a term, unless another one is promised support.
    fn support(
        &mut self,
        now: SimTime,
        seeks: Support,
        out: &mut Output<OwnerWrite>,
    ) -> Option<Support> {
        let Promise { term, until } = self.durable.promise;
        // A centre that asks for a later term has given up its earlier one.
        let is_its_own = seeks.term.centre == term.centre;
        let is_free = now >= until || is_its_own || !self.settings.rules.mandate;
        if seeks.term > term && is_free {
            self.follow(seeks.term, seeks.until, out);
        } else if seeks.term == term {
            let until = until.max(seeks.until);
            self.write(OwnerWrite::Promise(Promise { term, until }), out);
        } else {
            return None;
        }
        Some(seeks)
    }

    /// All that it has or ever had.
    fn everything(&self) -> Vec<Held> {
        let held = self.durable.held.keys();
        let mut goals: Vec<GoalKey> = held.chain(self.durable.closed.keys()).copied().collect();
        goals.sort_unstable();
        let present = goals.iter().map(|&goal| self.durable.present(goal));
        present.flatten().collect()
    }
}
