//! What a centre does with what it is told.

use farside::SimTime;

use super::{Centre, CentreWrite, Told};
use crate::shac::definition::{Parameter, Role, Stage};
use crate::shac::messages::{
    Acknowledged, Closed, GoalAck, GoalDigest, GoalStatus, Held, HoldingState, Message, Output,
};
use crate::shac::outcomes::Outcome;
use crate::shac::record::{GoalRecord, Holder, Refusal};
use crate::shac::values::{GoalKey, Party};

impl Centre {
    /// Takes a message. From who takes no part, it is ignored.
    pub fn receive(&mut self, now: SimTime, message: &Message) -> Output<CentreWrite> {
        let mut out = Output::default();
        let from = message.from();
        let Some(index) = self.settings.index(from) else {
            return out;
        };
        self.peers[index].contact.hear(&self.settings, now);
        match (message, from) {
            (Message::Status(status), Party::Owner(rover)) => {
                self.on_status(now, rover, status, &mut out);
            }
            (Message::Release(release), Party::Owner(rover)) => {
                self.learn_all(now, rover, &[release.held], &mut out);
            }
            (Message::Ack(ack), _) => self.on_ack(now, index, &ack.what, &mut out),
            (Message::Digest(digest), _) => self.on_digest(now, index, digest, &mut out),
            (Message::Outcome(message), _) => {
                for &outcome in &message.outcomes {
                    self.learn_outcome(now, outcome, &mut out);
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
                    &mut out,
                );
            }
            (Message::Status(_) | Message::Release(_), Party::Centre(_))
            | (Message::Assign(_) | Message::Cancel(_), _) => {}
        }
        self.finish(now, &mut out);
        out
    }

    fn on_status(
        &mut self,
        now: SimTime,
        rover: u32,
        status: &GoalStatus,
        out: &mut Output<CentreWrite>,
    ) {
        let known = &mut self.rovers[rover as usize];
        let is_old = known.version.is_some_and(|known| status.version < known);
        if !is_old || !self.settings.rules.highest_status {
            known.version = Some(status.version);
            known.capacity = status.capacity;
            known.heard = Some(now);
        }
        let version = known.version.unwrap_or(status.version);
        self.hear_report(rover, status.term);
        let what = Acknowledged::Status(version);
        let to = Party::Owner(rover);
        self.reply(
            now,
            to,
            Message::Ack(GoalAck {
                from: self.me(),
                what,
            }),
            out,
        );
        self.learn_all(now, rover, &status.holdings, out);
    }

    fn on_ack(
        &mut self,
        now: SimTime,
        index: usize,
        what: &Acknowledged,
        out: &mut Output<CentreWrite>,
    ) {
        match (what, self.parties[index]) {
            (Acknowledged::Holding(held), Party::Owner(rover)) => {
                self.learn_all(now, rover, &[*held], out);
            }
            (
                &Acknowledged::Bid {
                    goal,
                    revision,
                    score,
                    capacity,
                },
                Party::Owner(rover),
            ) => {
                let known = self.durable.table.get(&goal);
                if known.is_some_and(|record| record.wish.revision == revision) {
                    self.take_bid(now, goal, (rover, score), capacity, out);
                }
            }
            (Acknowledged::Outcomes(have), _) => self.peers[index].contact.has(have),
            (Acknowledged::Records(version), Party::Centre(_)) => {
                let has = &mut self.peers[index].has_records;
                *has = (*has).max(*version);
            }
            _ => {}
        }
    }

    fn on_digest(
        &mut self,
        now: SimTime,
        index: usize,
        digest: &GoalDigest,
        out: &mut Output<CentreWrite>,
    ) {
        let from = self.parties[index];
        let contact = &mut self.peers[index].contact;
        contact.has(&digest.have);
        contact.told(&self.settings, now, digest.asks);
        if let Party::Owner(rover) = from {
            self.learn_all(now, rover, &digest.holdings, out);
        }
        self.hear_of_office(now, from, digest, out);
        for theirs in &digest.records {
            self.join(now, theirs, out);
        }
        if !digest.records.is_empty() {
            let what = Acknowledged::Records(digest.version);
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
        if digest.asks {
            let answer = self.digest(now, index, false);
            self.reply(now, from, Message::Digest(answer), out);
        }
    }

    /// Joins another centre's record of a goal with this one's.
    fn join(&mut self, now: SimTime, theirs: &GoalRecord, out: &mut Output<CentreWrite>) {
        let key = theirs.wish.goal.key;
        let known = self.durable.table.get(&key);
        let mut record = known.unwrap_or(theirs).clone();
        record.join(theirs, self.settings.rules.withdrawn_for_good);
        self.keep(now, record, out);
        self.meet_stranger(now, key, out);
    }

    /// Takes what owners have told of a goal before this centre knew of it.
    pub(super) fn meet_stranger(
        &mut self,
        now: SimTime,
        goal: GoalKey,
        out: &mut Output<CentreWrite>,
    ) {
        for (rover, held) in self.strangers.remove(&goal).unwrap_or_default() {
            self.learn(now, rover, &held, out);
        }
    }

    pub(super) fn learn_outcome(
        &mut self,
        now: SimTime,
        outcome: Outcome,
        out: &mut Output<CentreWrite>,
    ) {
        let is_known = self.durable.outcomes.contains(&outcome);
        if outcome.rover >= self.settings.rovers || is_known {
            return;
        }
        self.write(CentreWrite::Outcome(outcome), out);
        for peer in &mut self.peers {
            peer.contact.poke(&self.settings, now);
        }
    }

    /// Takes what an owner says of goals, and acknowledges what has ended.
    fn learn_all(&mut self, now: SimTime, rover: u32, all: &[Held], out: &mut Output<CentreWrite>) {
        let mut ends = Vec::new();
        for held in all {
            let is_known = self.learn(now, rover, held, out);
            if is_known && !held.state.is_open() {
                let (goal, grant) = (held.goal, held.grant);
                ends.push(Closed { goal, grant });
            }
        }
        if !ends.is_empty() && self.is_in_office(now) {
            let by = self.durable.office.term;
            let what = Acknowledged::Ends { by, ends };
            let to = Party::Owner(rover);
            self.reply(
                now,
                to,
                Message::Ack(GoalAck {
                    from: self.me(),
                    what,
                }),
                out,
            );
        }
    }

    /// Takes what an owner says of a goal. Whether there is a record of it. What is said may be old: of
    /// each grant, everything goes one way, so that nothing old undoes anything.
    fn learn(
        &mut self,
        now: SimTime,
        rover: u32,
        held: &Held,
        out: &mut Output<CentreWrite>,
    ) -> bool {
        if let Some(outcome) = held.outcome {
            self.learn_outcome(now, outcome, out);
        }
        let Some(before) = self.durable.table.get(&held.goal) else {
            let strangers = self.strangers.entry(held.goal).or_default();
            strangers.retain(|(other, _)| *other != rover);
            strangers.push((rover, *held));
            return false;
        };
        let mut record = before.clone();
        let is_present = !self.settings.rules.present_epoch_only || held.grant == record.grant;
        let is_his = record.holder.is_some_and(|holder| holder.rover == rover);
        let is_news = if held.grant > record.grant {
            record.grant = held.grant;
            record.holder = held.state.is_open().then(|| holder_of(rover, held));
            true
        } else {
            is_present && (is_his || !self.settings.rules.present_epoch_only)
        };
        if !is_news {
            return true;
        }
        if held.state.is_open() {
            if is_present && is_his {
                let told = holder_of(rover, held);
                record.holder = record.holder.map(|holder| holder.joined(&told));
            }
            self.take_parameters(&mut record, held);
            let told = Told {
                grant: held.grant,
                lease_end: held.lease_end,
                confirmed: held.confirmed,
                revision: held.revision,
            };
            self.rovers[rover as usize].told.insert(held.goal, told);
        } else {
            record.holder = None;
            self.note_refusal(now, &mut record, rover, held);
        }
        self.keep(now, record, out);
        true
    }

    fn take_parameters(&self, record: &mut GoalRecord, held: &Held) {
        let stage = match held.state {
            HoldingState::Started => Stage::Started,
            _ => Stage::Owned,
        };
        let mut told = record.wish.goal.parameters;
        told.scheduled = held.scheduled;
        told.duration = held.duration;
        told.memory_bits = held.memory_bits;
        for parameter in Parameter::ALL {
            if self
                .settings
                .activity
                .may_set(Role::Owner, parameter, stage)
            {
                record.wish.goal.parameters.take(parameter, &told);
            }
        }
    }

    /// A rover has given a goal back or never took it: it is not asked again at once.
    fn note_refusal(&mut self, now: SimTime, record: &mut GoalRecord, rover: u32, held: &Held) {
        use HoldingState::{Failed, Refused, Released};
        if !matches!(held.state, Refused | Released | Failed) {
            return;
        }
        let sol = self.settings.sol_of(now);
        let capacity = held.capacity;
        record.refuse(Refusal {
            rover,
            sol,
            capacity,
        });
        self.count_round(now, record);
    }
}

fn holder_of(rover: u32, held: &Held) -> Holder {
    Holder {
        rover,
        lease_end: held.lease_end,
        acknowledged: true,
        started: held.state == HoldingState::Started,
        confirmed: held.confirmed,
        cancelling: false,
    }
}
