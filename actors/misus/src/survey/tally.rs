//! What is known of a survey from outside: what parties of the protocol have written, which lists there were, and
//! what planners recorded.

use std::collections::{BTreeMap, BTreeSet};

use super::messages::{
    Activity, ActivityBegan, ActivityEnd, ActivityEnded, GoalList, LoopMade, PlanMade,
};
use crate::shac::{CentreDurable, CentreWrite, GoalKey, HoldingState, OwnerDurable, OwnerWrite};

/// How many violations are told in words; the others are only counted.
const VIOLATIONS_TOLD: usize = 50;

/// What is known of a survey.
#[derive(Debug, Default)]
pub(super) struct SurveyTally {
    /// By rover.
    pub(super) rovers: Vec<RoverTally>,
    /// By site.
    pub(super) centres: BTreeMap<u32, CentreTally>,
    /// All editions of the goal list, in order.
    pub(super) lists: Vec<GoalList>,
    /// By the site of who closed the loop.
    loops: BTreeMap<u32, u32>,
    /// The goals that were achieved, and how often.
    pub(super) achieved: BTreeMap<GoalKey, u32>,
    /// The other half of each goal for two rovers, by half.
    pub(super) partners: BTreeMap<GoalKey, GoalKey>,
    /// The combinations that were achieved as a whole.
    combined: BTreeSet<Vec<GoalKey>>,
    pub(super) score: f64,
    pub(super) reassigned: u64,
    pub(super) central_operations: u64,
    /// What must never happen and did, in words, and how often.
    pub(super) violations: Vec<String>,
    pub(super) plan_violations: u64,
    pub(super) sharing_violations: u64,
}

/// What is known of a rover.
#[derive(Debug, Default)]
pub(super) struct RoverTally {
    pub(super) owner: OwnerDurable,
    /// Whether its planner has crashed, and not started again.
    pub(super) is_down: bool,
    pub(super) plans: u32,
    pub(super) replans: u32,
    pub(super) moved: u64,
    pub(super) operations: u64,
    /// How often it refused or gave back a goal.
    pub(super) shed: u64,
    /// What runs, as its planner has it.
    pub(super) running: Option<ActivityBegan>,
    /// The sols whose communication it has made.
    pub(super) communicated: BTreeSet<u32>,
    pub(super) failed: u64,
    /// How far the wheels went \[m\].
    pub(super) driven_m: f64,
}

/// What is known of a centre.
#[derive(Debug, Default)]
pub(super) struct CentreTally {
    pub(super) durable: CentreDurable,
    /// The edition of the list that it has.
    pub(super) edition: u64,
}

impl SurveyTally {
    pub(super) fn new(rovers: usize) -> SurveyTally {
        SurveyTally {
            rovers: (0..rovers).map(|_| RoverTally::default()).collect(),
            ..SurveyTally::default()
        }
    }

    /// There is a new list.
    pub(super) fn listed(&mut self, list: GoalList) {
        let halves = list
            .goals
            .iter()
            .filter_map(|goal| Some((goal.key, goal.partner?)));
        self.partners.extend(halves);
        self.lists.push(list);
    }

    /// Goals, of those for two rovers one half.
    fn whole(&self, goals: impl Iterator<Item = GoalKey>) -> BTreeSet<GoalKey> {
        let first = |goal: GoalKey| {
            self.partners
                .get(&goal)
                .map_or(goal, |other| goal.min(*other))
        };
        goals.map(first).collect()
    }

    /// How many goals were achieved: those for two rovers when both halves were.
    pub(super) fn goals_achieved(&self) -> u32 {
        self.whole(self.achieved.keys().copied()).len() as u32 - self.half_goals()
    }

    /// How many goals for two rovers only one has done.
    pub(super) fn half_goals(&self) -> u32 {
        let halves = self
            .achieved
            .keys()
            .filter_map(|goal| self.partners.get(goal));
        halves
            .filter(|other| !self.achieved.contains_key(other))
            .count() as u32
    }

    /// The list of an edition.
    pub(super) fn list(&self, edition: u64) -> Option<&GoalList> {
        let at = self
            .lists
            .iter()
            .rposition(|list| list.edition == edition)?;
        Some(&self.lists[at])
    }

    pub(super) fn blame_plan(&mut self, what: String) {
        self.plan_violations += 1;
        self.tell(what);
    }

    pub(super) fn blame_sharing(&mut self, what: String) {
        self.sharing_violations += 1;
        self.tell(what);
    }

    fn tell(&mut self, what: String) {
        if self.violations.len() < VIOLATIONS_TOLD {
            self.violations.push(what);
        }
    }

    /// A rover has made a plan.
    pub(super) fn plan(&mut self, rover: usize, plan: &PlanMade) {
        let tally = &mut self.rovers[rover];
        tally.plans += 1;
        tally.replans += u32::from(tally.plans > 1);
        tally.operations += plan.operations;
        tally.moved += u64::from(plan.moved);
    }

    /// A rover's activity has ended.
    pub(super) fn ended(&mut self, rover: usize, ended: &ActivityEnded) {
        let tally = &mut self.rovers[rover];
        tally.running = None;
        match (ended.planned.activity, ended.end) {
            (Activity::Communication(sol), ActivityEnd::Done) => {
                tally.communicated.insert(sol);
            }
            (_, ActivityEnd::Done) => {}
            _ => tally.failed += 1,
        }
    }

    /// A rover's owner has written something.
    pub(super) fn owner_wrote(&mut self, rover: usize, write: &OwnerWrite) {
        use HoldingState::{Refused, Released};
        let tally = &mut self.rovers[rover];
        tally.owner.apply(write);
        match write {
            OwnerWrite::Closed(closing) if matches!(closing.state, Refused | Released) => {
                tally.shed += 1;
            }
            OwnerWrite::Outcome(outcome) if outcome.rover as usize == rover => {
                self.achieve(outcome.goal);
            }
            _ => {}
        }
    }

    /// A goal was achieved. It counts once, as the last list had it that had it, and so does each combination
    /// that is whole with it.
    fn achieve(&mut self, goal: GoalKey) {
        let times = self.achieved.entry(goal).or_default();
        *times += 1;
        if *times > 1 {
            return;
        }
        let mut lists = self.lists.iter().rev();
        let weight = lists.find_map(|list| {
            let goal = list.goals.iter().find(|one| one.key == goal)?;
            Some(goal.weight)
        });
        self.score += weight.unwrap_or(0.0);
        let Some(list) = self.lists.last() else {
            return;
        };
        for one in list
            .combinations
            .iter()
            .filter(|one| one.goals.contains(&goal))
        {
            let is_whole = one.goals.iter().all(|key| self.achieved.contains_key(key));
            if is_whole && self.combined.insert(one.goals.clone()) {
                self.score += one.weight;
            }
        }
    }

    /// A centre has written something.
    pub(super) fn centre_wrote(&mut self, site: u32, write: &CentreWrite) {
        let tally = self.centres.entry(site).or_default();
        if let CentreWrite::Goal(record) = write {
            let before = tally.durable.table.get(&record.wish.goal.key);
            let is_again = before.is_some_and(|before| {
                before.grant.epoch > 0 && record.grant > before.grant && record.holder.is_some()
            });
            // Other centres write the same when they are told.
            self.reassigned += u64::from(is_again && record.grant.term.centre == site);
        }
        tally.durable.apply(write);
    }

    /// The centre that was elected last; the first one where nobody ever was.
    pub(super) fn in_office(&self) -> Option<&CentreTally> {
        self.centres
            .values()
            .max_by_key(|one| one.durable.office.elected)
    }

    /// The list was looked at again.
    pub(super) fn looped(&mut self, site: u32, made: LoopMade) {
        self.loops.insert(site, made.loops);
    }

    /// How often the loop was closed.
    pub(super) fn loops(&self) -> u32 {
        self.loops.values().sum()
    }

    /// A goal that nobody knows of any more: the centre in office has been told of it and has no record of it,
    /// or takes it for a rover's that has nothing of it.
    pub(super) fn lost_goals(&self) -> Vec<GoalKey> {
        let Some(centre) = self.in_office() else {
            return Vec::new();
        };
        let table = &centre.durable.table;
        let listed = self
            .list(centre.edition)
            .map_or(&[][..], |list| &list.goals);
        let unknown = listed.iter().map(|goal| goal.key);
        let unknown = unknown
            .filter(|goal| !table.contains_key(goal) && !centre.durable.outcomes.achieved(*goal));
        let forgotten = table.iter().filter_map(|(&goal, record)| {
            let holder = record.holder.filter(|holder| holder.acknowledged)?;
            let owner = &self.rovers.get(holder.rover as usize)?.owner;
            let is_known = owner.held.contains_key(&goal) || owner.closed.contains_key(&goal);
            (!is_known && !owner.outcomes.achieved(goal)).then_some(goal)
        });
        unknown.chain(forgotten).collect()
    }

    /// Goals that the centre in office takes for those of a rover that is down.
    pub(super) fn orphaned(&self) -> u32 {
        let Some(centre) = self.in_office() else {
            return 0;
        };
        let is_orphan = |goal: &&GoalKey| {
            let record = &centre.durable.table[*goal];
            let holder = record
                .holder
                .filter(|_| !centre.durable.outcomes.achieved(**goal));
            holder.is_some_and(|holder| self.rovers[holder.rover as usize].is_down)
        };
        centre.durable.table.keys().filter(is_orphan).count() as u32
    }

    /// Goals that the centre in office has given up, withdrawn ones not among them.
    pub(super) fn given_up(&self) -> u32 {
        let Some(centre) = self.in_office() else {
            return 0;
        };
        let records = centre.durable.table.values();
        let given_up = records.filter(|record| {
            let is_achieved = centre.durable.outcomes.achieved(record.wish.goal.key);
            record.given_up.is_some() && !record.wish.withdrawn && !is_achieved
        });
        given_up.count() as u32
    }

    /// What all planners looked at.
    pub(super) fn operations(&self) -> u64 {
        let rovers = self.rovers.iter().map(|rover| rover.operations);
        rovers.sum::<u64>() + self.central_operations
    }

    /// All goals that were ever listed.
    pub(super) fn wished(&self) -> BTreeSet<GoalKey> {
        let goals = self.lists.iter().flat_map(|list| &list.goals);
        self.whole(goals.map(|goal| goal.key))
    }
}
