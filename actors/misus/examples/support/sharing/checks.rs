//! What must hold after each event, told from outside: by what is written and what hardware does.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use farside::SimTime;
use farside_misus::shac::{
    Centre, Closing, GoalKey, Holding, HoldingState, OwnerDurable, Party, Revision, Standing,
    Version,
};

use super::world::{Seat, World};

/// What was violated, and when.
#[derive(Clone, PartialEq)]
pub(crate) struct Violation {
    pub(crate) at: SimTime,
    pub(crate) what: &'static str,
    pub(crate) details: String,
}

impl fmt::Debug for Violation {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(to, "at {}: {}: {}", self.at, self.what, self.details)
    }
}

/// What is remembered from event to event.
pub(crate) struct Checks {
    /// Goals that are wished for, since they were last added.
    wished: BTreeSet<GoalKey>,
    /// The edition of each goal that each party has.
    revisions: Vec<BTreeMap<GoalKey, (Revision, bool)>>,
    /// The version of each rover's status that each owner has, and the owner's incarnation.
    told: BTreeMap<(usize, u32), (u32, Version)>,
    /// How often each rover refused or released a goal with one capacity in one sol, and under which
    /// grant last.
    refused: BTreeMap<(usize, GoalKey, u32, u64), Vec<Closing>>,
}

impl Checks {
    pub(crate) fn new(parties: &[Party]) -> Checks {
        Checks {
            wished: BTreeSet::new(),
            revisions: vec![BTreeMap::new(); parties.len()],
            told: BTreeMap::new(),
            refused: BTreeMap::new(),
        }
    }

    pub(crate) fn added(&mut self, goal: GoalKey) {
        self.wished.insert(goal);
    }
}

impl World {
    pub(crate) fn violated(&self, what: &'static str, details: String) -> Result<(), Violation> {
        Err(Violation {
            at: self.now,
            what,
            details,
        })
    }

    /// Owners, by place: what each has written, or has in mind while it is up.
    fn owners(&self) -> impl Iterator<Item = (usize, &OwnerDurable)> {
        let seats = self.seats.iter().enumerate();
        seats.filter_map(|(party, seat)| match seat {
            Seat::Owner(Some(owner), _) => Some((party, owner.durable())),
            Seat::Owner(None, durable) => Some((party, durable)),
            Seat::Centre(..) => None,
        })
    }

    fn centres(&self) -> impl Iterator<Item = (usize, &Centre)> {
        let seats = self.seats.iter().enumerate();
        seats.filter_map(|(party, seat)| match seat {
            Seat::Centre(Some(centre), _) => Some((party, centre)),
            _ => None,
        })
    }

    /// Whether an owner has an unexpired lease, by its own clock.
    fn has_lease(&self, party: usize, holding: &Holding) -> bool {
        self.clock(party) < holding.lease_end
    }

    /// After each event.
    pub(crate) fn check(&mut self) -> Result<(), Violation> {
        self.check_leases()?;
        self.check_offices()?;
        self.check_hardware()?;
        self.check_writes()?;
        self.check_editions()?;
        self.check_status()?;
        self.check_refusals()
    }

    /// At most one unexpired lease of a goal, and the centre knows whose.
    fn check_leases(&self) -> Result<(), Violation> {
        let mut holders: BTreeMap<GoalKey, usize> = BTreeMap::new();
        for (party, durable) in self.owners() {
            for (&goal, holding) in &durable.held {
                if !self.has_lease(party, holding) {
                    continue;
                }
                if let Some(other) = holders.insert(goal, party) {
                    let details = format!("{goal:?} is held by {other} and {party}");
                    return self.violated("two leases", details);
                }
            }
        }
        for (place, centre) in self.centres() {
            let clock = self.clock(place);
            if !centre.is_in_office(clock) || !centre.is_settled(clock) {
                continue;
            }
            for (goal, party) in &holders {
                let Some(record) = centre.durable().table.get(goal) else {
                    continue;
                };
                let known = record.holder.map(|holder| holder.rover as usize);
                if known != Some(*party) {
                    let details = format!("{goal:?}: {place} thinks {known:?}, held by {party}");
                    return self.violated("a lease that its centre does not know", details);
                }
            }
        }
        Ok(())
    }

    /// At most one centre has the mandate.
    fn check_offices(&self) -> Result<(), Violation> {
        let in_office = self.centres().filter(|(party, centre)| {
            let clock = self.clock(*party);
            centre.is_in_office(clock)
        });
        let in_office: Vec<usize> = in_office.map(|(party, _)| party).collect();
        if in_office.len() > 1 {
            return self.violated("two centres", format!("{in_office:?}"));
        }
        Ok(())
    }

    /// What the hardware does, its owner holds.
    fn check_hardware(&self) -> Result<(), Violation> {
        for (party, durable) in self.owners() {
            for (goal, &ends) in &self.hardware[party] {
                let holding = durable.held.get(goal);
                let is_held = holding.is_some_and(|holding| holding.started.is_some());
                if !is_held && ends > self.now {
                    let details = format!("{party} does {goal:?} and does not hold it");
                    return self.violated("released after the start", details);
                }
            }
        }
        Ok(())
    }

    /// What a machine has in mind is what it has written.
    fn check_writes(&self) -> Result<(), Violation> {
        for (party, seat) in self.seats.iter().enumerate() {
            let is_same = match seat {
                Seat::Owner(Some(owner), durable) => owner.durable() == durable,
                Seat::Centre(Some(centre), durable) => centre.durable() == durable,
                _ => true,
            };
            if !is_same && self.settings.rules.write_first {
                return self.violated("not written", format!("{party}"));
            }
        }
        Ok(())
    }

    /// No goal is forgotten, and editions only grow, so that nothing that was withdrawn comes back.
    fn check_editions(&mut self) -> Result<(), Violation> {
        for (party, seat) in self.seats.iter().enumerate() {
            let Seat::Centre(_, durable) = seat else {
                continue;
            };
            for (&goal, record) in &durable.table {
                let now = (record.wish.revision, record.wish.withdrawn);
                let before = self.checks.revisions[party].insert(goal, now);
                if before.is_some_and(|before| {
                    before.0 > now.0 || before.0 == now.0 && before.1 != now.1
                }) {
                    let details = format!("{goal:?} at {party}: {before:?}, then {now:?}");
                    return self.violated("a goal came back", details);
                }
            }
            if durable.table.len() < self.checks.revisions[party].len()
                && self.settings.rules.write_first
            {
                return self.violated("a goal is forgotten", format!("at {party}"));
            }
        }
        Ok(())
    }

    /// Of each rover the highest status holds.
    fn check_status(&mut self) -> Result<(), Violation> {
        for party in 0..self.scenario.rovers as usize {
            let Seat::Owner(Some(owner), _) = &self.seats[party] else {
                continue;
            };
            let incarnation = owner.durable().version.incarnation;
            for rover in 0..self.scenario.rovers {
                let Some(told) = owner.told_by(rover) else {
                    continue;
                };
                let now = (incarnation, told.version);
                let before = self.checks.told.insert((party, rover), now);
                if before.is_some_and(|before| before.0 == now.0 && before.1 > now.1) {
                    let details = format!("{party} of {rover}: {before:?}, then {now:?}");
                    return self.violated("an old status", details);
                }
            }
        }
        Ok(())
    }

    /// With one centre, no rover is asked again for what it has refused, before something changes.
    fn check_refusals(&mut self) -> Result<(), Violation> {
        use HoldingState::{Failed, Refused, Released};
        if self.scenario.candidates.len() > 1 {
            return Ok(());
        }
        for party in 0..self.scenario.rovers as usize {
            let sol = self.clock(party).as_nanos() / self.settings.sol.as_nanos();
            let Seat::Owner(_, durable) = &self.seats[party] else {
                continue;
            };
            for closing in durable.closed.values() {
                if !matches!(closing.state, Refused | Released | Failed) {
                    continue;
                }
                let key = (party, closing.goal, closing.capacity, sol);
                let all = self.checks.refused.entry(key).or_default();
                if !all.contains(closing) {
                    all.push(*closing);
                }
                // One may be from the sol before, and one refused while a sol began.
                if all.len() > 3 {
                    let details = format!("{all:?}");
                    return self.violated("asked again and again", details);
                }
            }
        }
        Ok(())
    }

    /// Before a start: within the lease, not achieved, not withdrawn, and no half alone.
    pub(crate) fn check_start(&self, party: usize, goal: GoalKey) -> Result<(), Violation> {
        let Seat::Owner(Some(owner), _) = &self.seats[party] else {
            return Ok(());
        };
        let Some(holding) = owner.durable().held.get(&goal) else {
            return self.violated("started without a lease", format!("{goal:?} by {party}"));
        };
        let ends = self.clock(party) + holding.goal.parameters.duration;
        if ends > holding.lease_end {
            let details = format!("{goal:?} by {party} ends at {ends} of {holding:?}");
            return self.violated("started beyond the lease", details);
        }
        if owner.durable().outcomes.achieved(goal) {
            let details = format!("{goal:?} by {party}");
            return self.violated("started what is known to be achieved", details);
        }
        if let Some(partner) = holding.goal.partner {
            let is_bound = self.owners().any(|(other, durable)| {
                let held = durable.held.get(&partner);
                let closed = durable.closed.get(&partner);
                let is_held = held.is_some_and(|held| held.grant == holding.grant);
                // Who has failed was bound. Who dropped it knows that both halves are done already.
                let is_over = closed.is_some_and(|closing| {
                    use HoldingState::{Done, Failed, Superseded};
                    let may = [Done, Failed, Superseded];
                    closing.grant == holding.grant && may.contains(&closing.state)
                });
                other != party && (is_held || is_over)
            });
            if !is_bound {
                return self.violated("half a pair alone", format!("{goal:?} by {party}"));
            }
        }
        Ok(())
    }

    /// When all is healed: outcome sets are equal and whole, and no goal is in somebody's hands.
    pub(crate) fn check_end(&mut self) -> Result<(), Violation> {
        let mut truth = self.done.clone();
        truth.sort_unstable();
        for (party, seat) in self.seats.iter().enumerate() {
            let outcomes = match seat {
                Seat::Owner(_, durable) => &durable.outcomes,
                Seat::Centre(_, durable) => &durable.outcomes,
            };
            let known: Vec<_> = outcomes.iter().copied().collect();
            if known != truth {
                let details = format!("{party} has {known:?}, done was {truth:?}");
                return self.violated("outcomes differ", details);
            }
            let mut goals: Vec<GoalKey> = truth.iter().map(|outcome| outcome.goal).collect();
            goals.dedup();
            let counted = outcomes.goals_achieved();
            if counted.windows(2).any(|two| two[0] >= two[1]) || counted.len() > goals.len() {
                return self.violated("counted twice", format!("{counted:?}"));
            }
            self.tally.achieved = counted.len() as u64;
            self.tally.duplicates = (truth.len() - {
                let mut once: Vec<_> = truth.iter().map(|outcome| outcome.goal).collect();
                once.sort_unstable();
                once.dedup();
                once.len()
            }) as u64;
        }
        let wished = self.checks.wished.clone();
        let centres: Vec<&Centre> = self.centres().map(|(_, centre)| centre).collect();
        let mut standings = Vec::new();
        for &goal in &wished {
            let all: Vec<Option<Standing>> =
                centres.iter().map(|centre| centre.standing(goal)).collect();
            standings.push((goal, all));
        }
        for (goal, all) in standings {
            let is_settled = |standing: &Option<Standing>| {
                standing.is_some_and(|standing| !matches!(standing, Standing::Owned { .. }))
            };
            if !all.iter().all(is_settled) || all.iter().any(|standing| *standing != all[0]) {
                let details = format!("{goal:?} is {all:?}");
                return self.violated("a goal is not settled", details);
            }
            match all[0] {
                Some(Standing::Pooled) => self.tally.pooled += 1,
                Some(Standing::Unachievable(_)) => self.tally.unachievable += 1,
                _ => {}
            }
        }
        Ok(())
    }
}
