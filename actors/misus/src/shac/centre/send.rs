//! What a centre sends to whom: what the other is not known to have.

use farside::SimTime;

use super::{Centre, CentreWrite, Told};
use crate::shac::messages::{
    AssignTerms, GoalAssign, GoalCancel, GoalDigest, GoalOutcome, Message, Output,
};
use crate::shac::outcomes::{OUTCOMES_PER_MESSAGE, Outcome};
use crate::shac::record::{GoalRecord, Holder};
use crate::shac::values::{GoalKey, Party, Version};

/// How many records a message to another centre holds at most.
const RECORDS_PER_MESSAGE: usize = 16;

impl Centre {
    /// Sends a party what it is not known to have, if it is time.
    pub(super) fn flush(&mut self, now: SimTime, index: usize, out: &mut Output<CentreWrite>) {
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
        let owes = std::mem::take(&mut self.peers[index].contact.owes_digest);
        if asks || owes || self.wants_support(index) || self.has_records_for(index) {
            let digest = self.digest(now, index, asks);
            out.sends.push((to, Message::Digest(digest)));
        }
        if self.settings.rules.pass_outcomes_on {
            let missing = self.durable.outcomes.beyond(&self.peers[index].contact.has);
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
        }
        if let Party::Owner(rover) = to
            && self.is_in_office(now)
        {
            self.assign_to(now, rover, out);
            self.offer_to(now, rover, out);
        }
        let contact = &mut self.peers[index].contact;
        if out.sends.len() == before {
            contact.due = None;
        } else {
            contact.sent(&self.settings, now);
        }
    }

    /// Grants, changes of leases and cancellations that a rover has not acknowledged.
    fn assign_to(&self, now: SimTime, rover: u32, out: &mut Output<CentreWrite>) {
        let by = self.durable.office.term;
        let told = &self.rovers[rover as usize].told;
        for (&goal, record) in &self.durable.table {
            let holder = record.holder.filter(|holder| holder.rover == rover);
            let Some(holder) = holder else {
                continue;
            };
            let message = if holder.cancelling {
                if holder.started {
                    continue;
                }
                let grant = record.grant;
                Message::Cancel(GoalCancel {
                    from: self.me(),
                    by,
                    goal,
                    grant,
                })
            } else {
                let is_over = now >= holder.lease_end || self.durable.outcomes.achieved(goal);
                if is_over || told.get(&goal) == Some(&to_tell(record, &holder)) {
                    continue;
                }
                Message::Assign(self.assignment(
                    record,
                    AssignTerms::Lease {
                        end: holder.lease_end,
                        confirmed: holder.confirmed,
                    },
                ))
            };
            out.sends.push((Party::Owner(rover), message));
        }
    }

    /// Goals for which a rover is asked to bid.
    fn offer_to(&self, now: SimTime, rover: u32, out: &mut Output<CentreWrite>) {
        for (goal, auction) in &self.auctions {
            let until = auction.until;
            let is_asked = auction.bids.contains(&(rover, None));
            if let Some(record) = self.durable.table.get(goal)
                && is_asked
                && now < until
            {
                let assign = self.assignment(record, AssignTerms::Offer { until });
                out.sends
                    .push((Party::Owner(rover), Message::Assign(assign)));
            }
        }
    }

    fn assignment(&self, record: &GoalRecord, terms: AssignTerms) -> GoalAssign {
        GoalAssign {
            from: self.me(),
            by: self.durable.office.term,
            goal: record.wish.goal,
            revision: record.wish.revision,
            grant: record.grant,
            terms,
        }
    }

    /// Whether a rover has not promised what it is asked for.
    fn wants_support(&self, index: usize) -> bool {
        let rover = self.rovers.get(index);
        let asks = self.seeks.zip(rover);
        asks.is_some_and(|(seeks, rover)| rover.promised < seeks.until)
    }

    fn has_records_for(&self, index: usize) -> bool {
        let is_centre = index >= self.rovers.len();
        is_centre && self.peers[index].has_records < self.version()
    }

    fn version(&self) -> Version {
        Version {
            incarnation: self.durable.incarnation,
            sequence: self.changes,
        }
    }

    pub(super) fn digest(&self, now: SimTime, index: usize, asks: bool) -> GoalDigest {
        let seeks = self.seeks.filter(|_| self.wants_support(index));
        let (records, version) = match self.parties[index] {
            Party::Owner(_) => (Vec::new(), self.version()),
            Party::Centre(_) => self.records_for(index),
        };
        GoalDigest {
            from: self.me(),
            term: self.term_to_tell(),
            until: self.mandate(now),
            asks,
            have: self.durable.outcomes.have(self.settings.rovers),
            status: self.rovers.get(index).and_then(|rover| rover.version),
            seeks,
            renounces: self.renounced,
            supports: None,
            holdings: Vec::new(),
            records,
            version,
        }
    }

    /// The records that another centre lacks, the longest unchanged first, and up to which change they
    /// are.
    fn records_for(&self, index: usize) -> (Vec<GoalRecord>, Version) {
        let mut version = self.version();
        let has = self.peers[index].has_records;
        let after = if has.incarnation == version.incarnation {
            has.sequence
        } else {
            0
        };
        let changed = self.changed.iter().filter(|(_, at)| **at > after);
        let mut changed: Vec<(u32, GoalKey)> = changed.map(|(&goal, &at)| (at, goal)).collect();
        changed.sort_unstable();
        if changed.len() > RECORDS_PER_MESSAGE {
            changed.truncate(RECORDS_PER_MESSAGE);
            version.sequence = changed.last().map_or(0, |(at, _)| *at);
        }
        let records = changed
            .iter()
            .filter_map(|(_, goal)| self.durable.table.get(goal));
        (records.cloned().collect(), version)
    }
}

/// What a holder has to have acknowledged.
fn to_tell(record: &GoalRecord, holder: &Holder) -> Told {
    Told {
        grant: record.grant,
        lease_end: holder.lease_end,
        confirmed: holder.confirmed,
        revision: record.wish.revision,
    }
}
