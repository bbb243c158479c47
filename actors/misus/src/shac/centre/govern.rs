//! What a centre in office does: it hands goals out, prolongs leases, joins pairs, and takes goals
//! back.

use farside::SimTime;
use thiserror::Error;

use super::{Auction, Centre, CentreWrite};
use crate::shac::definition::Chooser;
use crate::shac::messages::Output;
use crate::shac::record::{GoalRecord, Holder, Refusal, Standing};
use crate::shac::values::{GoalKey, Grant, Reason};

/// A goal that somebody may get.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Vacancy {
    /// Which. Of a joint goal, the half with the smaller name.
    pub goal: GoalKey,
    /// The other half of a joint goal.
    pub partner: Option<GoalKey>,
    /// The rovers that do not refuse it and whose lease would be long enough, ascending. A joint goal has at least
    /// two.
    pub candidates: Vec<u32>,
}

/// A decision that the protocol does not let a central planner make.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum AssignError {
    /// It is not the centre now.
    #[error("the centre has no mandate at {now}")]
    NotInOffice {
        /// When.
        now: SimTime,
    },
    /// Nobody may get the goal now.
    #[error("goal {goal:?} is not vacant")]
    NotVacant {
        /// Which.
        goal: GoalKey,
    },
    /// Too few or too many rovers, one twice, or one that refuses the goal.
    #[error("goal {goal:?} for {actual:?}: expected {expected} of {candidates:?}")]
    NotCandidates {
        /// Which.
        goal: GoalKey,
        /// Who was chosen.
        actual: Vec<u32>,
        /// How many have to be chosen.
        expected: usize,
        /// Among whom.
        candidates: Vec<u32>,
    },
    /// The protocol, or how far the goal is, does not allow it to be taken back.
    #[error("goal {goal:?} cannot be taken back")]
    NotRevocable {
        /// Which.
        goal: GoalKey,
    },
}

/// What is to be done with a goal that somebody has.
enum Step {
    End(Option<Refusal>),
    Cancel,
    Confirm(GoalKey),
    Prolong(SimTime),
}

impl Centre {
    /// Goals that somebody may get, in the order of their names.
    pub fn vacancies(&self, now: SimTime) -> Vec<Vacancy> {
        let records = self.durable.table.values();
        records
            .filter_map(|record| self.vacancy(now, record))
            .collect()
    }

    fn vacancy(&self, now: SimTime, record: &GoalRecord) -> Option<Vacancy> {
        if !self.is_in_office(now) || !self.is_settled(now) || !self.is_pooled(record) {
            return None;
        }
        let goal = record.wish.goal.key;
        let partner = record.wish.goal.partner;
        let other = match partner {
            None => None,
            Some(partner) => {
                let other = self.durable.table.get(&partner)?;
                let is_pair = other.wish.goal.partner == Some(goal) && goal < partner;
                if !is_pair || !self.is_pooled(other) {
                    return None;
                }
                Some(other)
            }
        };
        let mut candidates = self.candidates(now, record, other);
        let halves = [Some(record), other];
        let durations = halves
            .iter()
            .flatten()
            .map(|half| half.wish.goal.parameters.duration);
        let lasts = durations.max().unwrap_or_default() + self.settings.guard;
        candidates.retain(|&rover| self.lease_end(now, rover) >= now.saturating_add(lasts));
        let vacancy = Vacancy {
            goal,
            partner,
            candidates,
        };
        (vacancy.candidates.len() >= vacancy.places()).then_some(vacancy)
    }

    fn is_pooled(&self, record: &GoalRecord) -> bool {
        record.standing(&self.durable.outcomes) == Standing::Pooled
    }

    /// The end of a lease that a rover gets now. Of who has been silent for a quarter of a lease, it counts from
    /// The end of a lease that a rover gets now. Of who has been silent for a quarter of a lease, it counts from
    /// when it was last heard: all goals of a rover that is lost are back after a lease and a quarter, whenever it
    /// got them, and it gets no others when that is too soon for them.
    fn lease_end(&self, now: SimTime, rover: u32) -> SimTime {
        let heard = self.rovers[rover as usize].heard.unwrap_or(self.started);
        let is_silent = self.settings.protocol.lease.is_some_and(|lease| {
            now.since(heard) > farside::SimDuration::from_nanos(lease.as_nanos() / 4)
        });
        let from = match is_silent {
            true => heard,
            false => now,
        };
        self.settings.lease_end(from)
    }

    /// The rovers that do not refuse a goal, or either half of a joint goal.
    fn candidates(
        &self,
        now: SimTime,
        record: &GoalRecord,
        other: Option<&GoalRecord>,
    ) -> Vec<u32> {
        let sol = self.settings.sol_of(now);
        let refuses = |record: &GoalRecord, rover: u32| {
            let refusals = record.refusals.iter();
            let mut his = refusals.filter(|refusal| refusal.rover == rover);
            let capacity = self.rovers[rover as usize].capacity;
            let holds = |known: &Refusal| known.sol == sol && known.capacity >= capacity;
            self.settings.rules.refusals_hold && his.any(holds)
        };
        let rovers = 0..self.settings.rovers;
        let records = [Some(record), other];
        rovers
            .filter(|&rover| {
                !records
                    .iter()
                    .flatten()
                    .any(|record| refuses(record, rover))
            })
            .collect()
    }

    /// After a refusal: whether with it all have refused, and whether that was once too often.
    pub(super) fn count_round(&mut self, now: SimTime, record: &mut GoalRecord) {
        let partner = record.wish.goal.partner;
        let other = partner.and_then(|partner| self.durable.table.get(&partner));
        let needed = 1 + usize::from(partner.is_some());
        let is_left = self.candidates(now, record, other).len() < needed;
        if !is_left || !self.is_in_office(now) {
            return;
        }
        record.rounds += 1;
        let limit = self.settings.protocol.give_up_after;
        if limit.is_some_and(|limit| record.rounds >= limit) {
            record.given_up = Some(Reason::RefusedByAll);
        }
    }

    /// Grants a goal to a rover, or both halves of a joint goal to two, in the order of goal and partner.
    ///
    /// # Errors
    /// When this centre has no mandate, the goal is not vacant, or these are not so many of its
    /// candidates.
    pub fn assign(
        &mut self,
        now: SimTime,
        goal: GoalKey,
        rovers: &[u32],
    ) -> Result<Output<CentreWrite>, AssignError> {
        if !self.is_in_office(now) {
            return Err(AssignError::NotInOffice { now });
        }
        let record = self.durable.table.get(&goal);
        let vacancy = record.and_then(|record| self.vacancy(now, record));
        let vacancy = vacancy.ok_or(AssignError::NotVacant { goal })?;
        let places = vacancy.places();
        let are_candidates = rovers
            .iter()
            .all(|rover| vacancy.candidates.contains(rover));
        let is_twice = places == 2 && rovers.first() == rovers.last();
        if rovers.len() != places || !are_candidates || is_twice {
            return Err(AssignError::NotCandidates {
                goal,
                actual: rovers.to_vec(),
                expected: places,
                candidates: vacancy.candidates,
            });
        }
        let mut out = Output::default();
        self.grant(now, &vacancy, rovers, &mut out);
        self.finish(now, &mut out);
        Ok(out)
    }

    fn grant(
        &mut self,
        now: SimTime,
        vacancy: &Vacancy,
        rovers: &[u32],
        out: &mut Output<CentreWrite>,
    ) {
        let goals = [Some(vacancy.goal), vacancy.partner];
        let records = goals
            .iter()
            .flatten()
            .filter_map(|goal| self.durable.table.get(goal));
        let records: Vec<GoalRecord> = records.cloned().collect();
        let epoch = records.iter().map(|record| record.grant.epoch).max();
        let grant = Grant {
            term: self.durable.office.term,
            epoch: epoch.unwrap_or(0) + 1,
        };
        // Those who do a goal together have it for equally long, or one would be left alone.
        let lease_ends = rovers.iter().map(|&rover| self.lease_end(now, rover));
        let lease_end = lease_ends.min().unwrap_or(now);
        self.auctions.remove(&vacancy.goal);
        for (mut record, &rover) in records.into_iter().zip(rovers) {
            record.grant = grant;
            record.holder = Some(Holder {
                rover,
                lease_end,
                acknowledged: false,
                started: false,
                confirmed: record.wish.goal.partner.is_some() && !self.settings.rules.bind_pairs,
                cancelling: false,
            });
            self.keep(now, record, out);
        }
    }

    /// Begins to take a goal back that has not started, as far as is known.
    ///
    /// # Errors
    /// When this centre has no mandate, or the goal is not owned, is half of a joint goal, has
    /// started, or the protocol does not let planners take goals back.
    pub fn revoke(
        &mut self,
        now: SimTime,
        goal: GoalKey,
    ) -> Result<Output<CentreWrite>, AssignError> {
        if !self.is_in_office(now) {
            return Err(AssignError::NotInOffice { now });
        }
        let record = self.durable.table.get(&goal);
        let owned = record.and_then(|record| record.holder.map(|holder| (record, holder)));
        let revocable = owned.filter(|(record, holder)| {
            let is_single = record.wish.goal.partner.is_none();
            self.settings.protocol.revocable && is_single && !holder.started
        });
        let (record, mut holder) = revocable.ok_or(AssignError::NotRevocable { goal })?;
        let mut record = record.clone();
        holder.cancelling = true;
        record.holder = self.settings.rules.revoke_safely.then_some(holder);
        let mut out = Output::default();
        self.keep(now, record, &mut out);
        self.finish(now, &mut out);
        Ok(out)
    }

    /// Declares a goal that nobody has unachievable.
    ///
    /// # Errors
    /// When this centre has no mandate, or the goal is not pooled.
    pub fn declare(
        &mut self,
        now: SimTime,
        goal: GoalKey,
        reason: Reason,
    ) -> Result<Output<CentreWrite>, AssignError> {
        if !self.is_in_office(now) {
            return Err(AssignError::NotInOffice { now });
        }
        let record = self.durable.table.get(&goal);
        let record = record.filter(|record| self.is_pooled(record) && self.is_settled(now));
        let mut record = record.ok_or(AssignError::NotVacant { goal })?.clone();
        record.given_up = Some(reason);
        let mut out = Output::default();
        self.keep(now, record, &mut out);
        self.finish(now, &mut out);
        Ok(out)
    }

    /// Does what is due.
    pub(super) fn govern(&mut self, now: SimTime, out: &mut Output<CentreWrite>) {
        if !self.is_in_office(now) {
            return;
        }
        let records = self.durable.table.iter();
        let steps = records.filter_map(|(&goal, record)| {
            let step = record
                .holder
                .and_then(|holder| self.step(now, record, &holder));
            step.map(|step| (goal, step))
        });
        let steps: Vec<(GoalKey, Step)> = steps.collect();
        for (goal, step) in steps {
            self.take_step(now, goal, &step, out);
        }
        match self.settings.protocol.chooser {
            Chooser::Planner => {}
            Chooser::BestBid => self.auction(now, out),
            Chooser::LeastLoaded => {
                for vacancy in self.vacancies(now) {
                    let rovers = self.least_loaded(&vacancy);
                    self.grant(now, &vacancy, &rovers, out);
                }
            }
        }
    }

    fn step(&self, now: SimTime, record: &GoalRecord, holder: &Holder) -> Option<Step> {
        let revoked_from = holder.lease_end.saturating_add(self.settings.guard);
        let is_over = self.settings.reassigns() && now >= revoked_from;
        let is_mine = record.grant.term == self.durable.office.term;
        if is_over && (is_mine || self.is_settled(now)) {
            let refusal = Refusal {
                rover: holder.rover,
                sol: self.settings.sol_of(now),
                capacity: self.rovers[holder.rover as usize].capacity,
            };
            return Some(Step::End(Some(refusal)));
        }
        if holder.cancelling {
            return None;
        }
        let partner = record.wish.goal.partner;
        let other = partner.and_then(|partner| self.durable.table.get(&partner));
        let other = other.filter(|other| other.grant == record.grant);
        let is_dropped = match partner {
            None => record.wish.withdrawn,
            // Half of a joint goal that may start at any time is never taken back; an earlier centre
            // may have confirmed what this one does not know to be confirmed.
            Some(_) if holder.confirmed || !is_mine && !self.has_all_reports() => false,
            Some(_) => {
                let is_alone = other.is_none_or(|other| other.holder.is_none());
                let is_withdrawn = other.is_some_and(|other| other.wish.withdrawn);
                is_alone || is_withdrawn || record.wish.withdrawn
            }
        };
        if is_dropped {
            return Some(if self.settings.rules.revoke_safely {
                Step::Cancel
            } else {
                Step::End(None)
            });
        }
        if let Some(other) = other {
            let theirs = other
                .holder
                .filter(|theirs| theirs.acknowledged && !theirs.cancelling);
            let are_bound = theirs.is_some() && holder.acknowledged && !holder.confirmed;
            return are_bound.then_some(Step::Confirm(other.wish.goal.key));
        }
        self.longer(holder).map(Step::Prolong)
    }

    /// The end to which a lease is to be prolonged: a whole lease after its owner was last heard.
    fn longer(&self, holder: &Holder) -> Option<SimTime> {
        let lease = self.settings.protocol.lease?;
        let heard = self.rovers[holder.rover as usize].heard?;
        let end = heard + lease;
        let is_worth =
            end.since(holder.lease_end) > farside::SimDuration::from_nanos(lease.as_nanos() / 4);
        (self.settings.protocol.renewed && holder.acknowledged && is_worth).then_some(end)
    }

    fn take_step(
        &mut self,
        now: SimTime,
        goal: GoalKey,
        step: &Step,
        out: &mut Output<CentreWrite>,
    ) {
        let Some(mut record) = self.durable.table.get(&goal).cloned() else {
            return;
        };
        let Some(holder) = &mut record.holder else {
            return;
        };
        match *step {
            Step::Cancel => holder.cancelling = true,
            Step::Prolong(end) => holder.lease_end = end,
            Step::Confirm(partner) => {
                let other = self.durable.table.get(&partner);
                // An earlier step of this call may have taken the other half back.
                let is_bound = other.and_then(|other| other.holder);
                if is_bound.is_none_or(|theirs| theirs.cancelling) {
                    return;
                }
                holder.confirmed = true;
            }
            Step::End(refusal) => {
                record.holder = None;
                if let Some(refusal) = refusal {
                    record.refuse(refusal);
                    self.count_round(now, &mut record);
                }
            }
        }
        self.keep(now, record, out);
    }

    /// The candidates that own the fewest goals; of several, those with the least numbers.
    fn least_loaded(&self, vacancy: &Vacancy) -> Vec<u32> {
        let load = |rover: u32| {
            let holders = self
                .durable
                .table
                .values()
                .filter_map(|record| record.holder);
            holders.filter(|holder| holder.rover == rover).count()
        };
        let mut order: Vec<(usize, u32)> = vacancy
            .candidates
            .iter()
            .map(|&rover| (load(rover), rover))
            .collect();
        order.sort_unstable();
        order
            .iter()
            .map(|(_, rover)| *rover)
            .take(vacancy.places())
            .collect()
    }
}

/// The market.
impl Centre {
    /// Opens an auction for each vacancy, and ends those whose bids are there, or whose time is over.
    fn auction(&mut self, now: SimTime, out: &mut Output<CentreWrite>) {
        for vacancy in self.vacancies(now) {
            match self.auctions.get(&vacancy.goal) {
                None => self.open(now, &vacancy),
                Some(auction) => {
                    let all = auction.bids.iter().all(|(_, bid)| bid.is_some());
                    if all || now >= auction.until {
                        self.sell(now, &vacancy, out);
                    }
                }
            }
        }
        let is_open = |goal: &GoalKey| {
            let record = self.durable.table.get(goal);
            record.is_some_and(|record| self.is_pooled(record))
        };
        let over: Vec<GoalKey> = self
            .auctions
            .keys()
            .filter(|goal| !is_open(goal))
            .copied()
            .collect();
        for goal in over {
            self.auctions.remove(&goal);
        }
    }

    fn open(&mut self, now: SimTime, vacancy: &Vacancy) {
        let bids_for = self.settings.protocol.bids_for;
        let auction = Auction {
            until: now + bids_for.unwrap_or(self.settings.resend_first),
            bids: vacancy
                .candidates
                .iter()
                .map(|&rover| (rover, None))
                .collect(),
        };
        self.auctions.insert(vacancy.goal, auction);
        for &rover in &vacancy.candidates {
            self.peers[rover as usize].contact.poke(&self.settings, now);
        }
    }

    pub(super) fn take_bid(
        &mut self,
        now: SimTime,
        goal: GoalKey,
        (rover, score): (u32, Option<f64>),
        capacity: u32,
        out: &mut Output<CentreWrite>,
    ) {
        let auction = self.auctions.get_mut(&goal);
        let bid = auction.and_then(|auction| {
            let mut bids = auction.bids.iter_mut();
            bids.find(|(bidder, bid)| *bidder == rover && bid.is_none())
        });
        let Some(bid) = bid else {
            return;
        };
        bid.1 = Some(score);
        if score.is_none() {
            self.note(now, goal, rover, capacity, out);
        }
    }

    /// Notes that a rover does not want a goal.
    fn note(
        &mut self,
        now: SimTime,
        goal: GoalKey,
        rover: u32,
        capacity: u32,
        out: &mut Output<CentreWrite>,
    ) {
        if let Some(mut record) = self.durable.table.get(&goal).cloned() {
            let sol = self.settings.sol_of(now);
            record.refuse(Refusal {
                rover,
                sol,
                capacity,
            });
            self.count_round(now, &mut record);
            self.keep(now, record, out);
        }
    }

    /// The highest bids get the goal. Who did not answer at all is not asked again at once.
    fn sell(&mut self, now: SimTime, vacancy: &Vacancy, out: &mut Output<CentreWrite>) {
        let Some(auction) = self.auctions.remove(&vacancy.goal) else {
            return;
        };
        let bids = auction.bids.iter();
        let scored = bids.filter_map(|&(rover, bid)| bid.flatten().map(|score| (score, rover)));
        let mut scored: Vec<(f64, u32)> = scored
            .filter(|(_, rover)| vacancy.candidates.contains(rover))
            .collect();
        scored.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let best: Vec<u32> = scored
            .iter()
            .map(|(_, rover)| *rover)
            .take(vacancy.places())
            .collect();
        if best.len() == vacancy.places() {
            return self.grant(now, vacancy, &best, out);
        }
        for (rover, bid) in auction.bids {
            if bid.is_none() {
                let capacity = self.rovers[rover as usize].capacity;
                self.note(now, vacancy.goal, rover, capacity, out);
            }
        }
    }
}

impl Vacancy {
    /// How many rovers it takes.
    pub fn places(&self) -> usize {
        1 + usize::from(self.partner.is_some())
    }
}
