//! Planners that decide at random, and hardware that does what it is told.

use farside::SimTime;
use farside_misus::shac::{
    GoalKey, Holding, Outcome, Output, Owner, OwnerError, OwnerWrite, Parameter, Party, Reason,
};

use super::checks::Violation;
use super::scenario::{CALMS, HEALS};
use super::world::{Seat, World};

type Decided = Result<Output<OwnerWrite>, OwnerError>;

impl World {
    /// The planner of a party looks at what it may decide.
    pub(crate) fn plan(&mut self, party: usize) -> Result<(), Violation> {
        match self.parties[party] {
            Party::Owner(_) => self.plan_rover(party),
            Party::Centre(_) => {
                self.plan_team(party);
                Ok(())
            }
        }
    }

    fn owner(&mut self, party: usize) -> Option<&mut Owner> {
        match &mut self.seats[party] {
            Seat::Owner(owner, _) => owner.as_mut(),
            Seat::Centre(..) => None,
        }
    }

    /// Decides by a call, and carries out what comes of it. Whether the protocol allowed it.
    fn decide(&mut self, party: usize, call: impl FnOnce(&mut Owner, SimTime) -> Decided) -> bool {
        let clock = self.clock(party);
        let decided = self.owner(party).map(|owner| call(owner, clock));
        let is_allowed = matches!(decided, Some(Ok(_)));
        if let Some(Ok(out)) = decided {
            self.owner_out(party, out);
        }
        is_allowed
    }

    fn plan_rover(&mut self, party: usize) -> Result<(), Violation> {
        let Some(owner) = self.owner(party) else {
            return Ok(());
        };
        let offers: Vec<GoalKey> = owner.offers().map(|offer| offer.goal.key).collect();
        let calls: Vec<GoalKey> = owner.calls().map(|call| call.goal.key).collect();
        let held: Vec<Holding> = owner.durable().held.values().copied().collect();
        let is_calm = self.now >= CALMS;
        for (number, goal) in (0..).zip(offers) {
            let draw = self.draw("offer", number);
            if is_calm || draw < 0.25 {
                self.decide(party, |owner, now| owner.refuse(now, goal, Reason::Time));
            } else if draw < 0.9 {
                self.decide(party, |owner, now| owner.accept(now, goal));
            }
        }
        for (number, goal) in (0..).zip(calls) {
            let draw = self.draw("bid", number);
            let score = (draw < 0.6 && !is_calm).then_some(draw);
            self.decide(party, |owner, now| owner.bid(now, goal, score));
        }
        for (number, holding) in (0..).zip(held) {
            let draw = self.draw("held", number);
            self.pursue(party, &holding, draw)?;
        }
        if self.draw("capacity", party as u64) < 0.01 && self.now < HEALS {
            self.decide(party, |owner, now| Ok(owner.capacity_changed(now)));
        }
        Ok(())
    }

    fn pursue(&mut self, party: usize, holding: &Holding, draw: f64) -> Result<(), Violation> {
        let goal = holding.goal.key;
        if holding.started.is_some() {
            self.look_at_hardware(party, holding, draw);
            // What only a rover without the fourth rule gets away with.
            if draw < 0.01 {
                self.decide(party, |owner, now| owner.release(now, goal, Reason::Power));
            }
            return Ok(());
        }
        let is_calm = self.now >= CALMS;
        let zeal = self.scenario.zeal;
        if draw < zeal || is_calm {
            self.start(party, goal)?;
        } else if draw < zeal + 0.06 {
            self.decide(party, |owner, now| owner.release(now, goal, Reason::Power));
        } else if draw < zeal + 0.065 {
            self.decide(party, |owner, now| {
                owner.failed(now, goal, Reason::Hardware)
            });
        } else if draw < zeal + 0.2 {
            let mut parameters = holding.goal.parameters;
            parameters.scheduled = Some(self.now);
            self.decide(party, |owner, now| {
                owner.set(now, goal, Parameter::Scheduled, &parameters)
            });
        }
        Ok(())
    }

    /// Starts a goal, if the protocol allows it. The hardware moves only if the owner is still up
    /// when the start is written.
    fn start(&mut self, party: usize, goal: GoalKey) -> Result<(), Violation> {
        let clock = self.clock(party);
        let Some(Ok(())) = self.owner(party).map(|owner| owner.may_begin(clock, goal)) else {
            if self.now >= CALMS {
                self.decide(party, |owner, now| owner.release(now, goal, Reason::Time));
            }
            return Ok(());
        };
        self.check_start(party, goal)?;
        self.tally.starts += 1;
        self.decide(party, |owner, now| owner.begin(now, goal));
        if let Some(owner) = self.owner(party)
            && let Some(holding) = owner.durable().held.get(&goal).copied()
            && holding.started.is_some()
        {
            let ends = self.now + holding.goal.parameters.duration;
            self.hardware[party].insert(goal, ends);
        }
        Ok(())
    }

    /// A started goal is done when the hardware has done it; after a crash nobody else knows.
    fn look_at_hardware(&mut self, party: usize, holding: &Holding, draw: f64) {
        let goal = holding.goal.key;
        let ends = self.hardware[party].get(&goal).copied();
        if ends.is_some_and(|ends| ends > self.now) {
            return;
        }
        self.hardware[party].remove(&goal);
        if ends.is_none() || draw < 0.05 {
            self.decide(party, |owner, now| {
                owner.failed(now, goal, Reason::Hardware)
            });
            return;
        }
        let clock = self.clock(party);
        let out = self.owner(party).map(|owner| owner.done(clock, goal));
        if let Some(Ok(out)) = out {
            let outcome: Option<Outcome> = out.writes.iter().find_map(|write| match write {
                OwnerWrite::Outcome(outcome) => Some(*outcome),
                _ => None,
            });
            self.done.extend(outcome);
            self.owner_out(party, out);
        }
    }

    fn plan_team(&mut self, party: usize) {
        let clock = self.clock(party);
        let (take_back, give_up) = (
            self.draw("revoke", 0) < 0.02,
            self.draw("declare", 0) < 0.002,
        );
        let hand_out = self.draw("assign", 0) < 0.8 && self.now < CALMS;
        let (order, which) = (self.draw("order", 0), self.draw("which", 0));
        let Seat::Centre(Some(centre), _) = &mut self.seats[party] else {
            return;
        };
        let mut outputs = Vec::new();
        let vacancies = centre.vacancies(clock);
        if hand_out && centre.settings().protocol.chooser == farside_misus::shac::Chooser::Planner {
            for vacancy in &vacancies {
                let candidates = &vacancy.candidates;
                let first = (order * candidates.len() as f64) as usize;
                let chosen = candidates.iter().cycle().skip(first).take(vacancy.places());
                let rovers: Vec<u32> = chosen.copied().collect();
                outputs.extend(centre.assign(clock, vacancy.goal, &rovers));
            }
        }
        let goals: Vec<GoalKey> = centre.standings().map(|(goal, _)| goal).collect();
        let goal = goals.get((which * goals.len() as f64) as usize);
        if let Some(&goal) = goal {
            if take_back {
                outputs.extend(centre.revoke(clock, goal));
            }
            if give_up {
                outputs.extend(centre.declare(clock, goal, Reason::Path));
            }
        }
        let mut all = farside_misus::shac::Output::default();
        for out in outputs {
            all.writes.extend(out.writes);
            all.sends.extend(out.sends);
        }
        self.centre_out(party, all);
    }
}
