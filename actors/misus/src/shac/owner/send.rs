//! What an owner sends to whom: what the other is not known to have.

use farside::SimTime;

use super::{Closing, Owner, OwnerWrite};
use crate::shac::messages::{GoalDigest, GoalOutcome, GoalStatus, Held, Message, Output};
use crate::shac::outcomes::{OUTCOMES_PER_MESSAGE, Outcome};
use crate::shac::values::Party;

impl Owner {
    /// Sends a party what it is not known to have, if it is time.
    pub(super) fn flush(&mut self, now: SimTime, index: usize, out: &mut Output<OwnerWrite>) {
        let to = self.parties[index];
        if to == self.me() {
            self.peers[index].contact.due = None;
            return;
        }
        if self.peers[index].contact.due.is_none_or(|due| due > now) {
            return;
        }
        let before = out.sends.len();
        let asks = !self.peers[index].contact.has_met;
        if asks || std::mem::take(&mut self.peers[index].contact.owes_digest) {
            out.sends
                .push((to, Message::Digest(self.digest(index, asks))));
        }
        let lacks_status = self.peers[index].has_status != Some(self.durable.version);
        if lacks_status || to == self.centre() && self.untaken().next().is_some() {
            out.sends.push((to, Message::Status(self.status())));
        }
        let has = &self.peers[index].contact.has;
        let mine_only = !self.settings.rules.pass_outcomes_on;
        let missing = self.durable.outcomes.beyond(has);
        let missing = missing
            .filter(|outcome| !mine_only || outcome.rover == self.rover && to == self.centre());
        let outcomes: Vec<Outcome> = missing.take(OUTCOMES_PER_MESSAGE).copied().collect();
        if !outcomes.is_empty() {
            out.sends.push((
                to,
                Message::Outcome(GoalOutcome {
                    from: self.me(),
                    outcomes,
                }),
            ));
        }
        let contact = &mut self.peers[index].contact;
        if out.sends.len() == before {
            contact.due = None;
        } else {
            contact.sent(&self.settings, now);
        }
    }

    /// Ends of holdings that the centre has not taken.
    fn untaken(&self) -> impl Iterator<Item = &Closing> {
        let closed = self.durable.closed.values();
        closed.filter(|closing| {
            let taken = self.taken.get(&closing.goal);
            taken != Some(&closing.grant)
        })
    }

    fn status(&self) -> GoalStatus {
        let held = self.durable.held.values();
        let held = held.map(|holding| self.durable.of_holding(holding));
        let mut holdings: Vec<Held> = held.chain(self.untaken().map(Closing::held)).collect();
        holdings.sort_unstable_by_key(|held| held.goal);
        GoalStatus {
            from: self.me(),
            version: self.durable.version,
            term: self.durable.promise.term,
            capacity: self.durable.capacity,
            holdings,
        }
    }

    pub(super) fn digest(&self, index: usize, asks: bool) -> GoalDigest {
        let status = match self.parties[index] {
            Party::Owner(rover) => self.told_by(rover).map(|told| told.version),
            Party::Centre(_) => None,
        };
        GoalDigest {
            from: self.me(),
            term: self.durable.promise.term,
            until: self.durable.promise.until,
            asks,
            have: self.durable.outcomes.have(self.settings.rovers),
            status,
            seeks: None,
            renounces: None,
            supports: None,
            holdings: Vec::new(),
            records: Vec::new(),
            version: self.durable.version,
        }
    }
}
