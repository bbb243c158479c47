//! Joint resolution on maps where rovers stay: one node plans for all, from where they will stand.
//!
//! Where a rover finds no path though nothing forbids that there is one, rovers would have to move
//! that have nowhere to go themselves, maybe several, maybe there and back. Who of them goes where
//! is a question about all of them at once. So it is asked of one node, the **root** of a tree of
//! nodes that all of them know from the roadmap:
//!
//! 1. *Ask.* The node whose request found no path tells the root, from parent to parent.
//! 2. *Hold.* The root tells all. From then on a node begins no request. When none that it began is
//!    under way any more and its children have said the same, it says so to its parent. When the
//!    root knows it of all, no part of a path will be entered any more, anywhere.
//! 3. *Tell.* The root asks all. From then on a node grants nothing. It answers when each visit in
//!    its table is confirmed: with all of them, and which are granted.
//! 4. *Plan.* A rover goes on to the last vertex that it was granted; and where it would stop on a
//!    vertex that another one, going on so far, is to come to after it, one vertex further. From
//!    these stops the root plans ([`lacam`](fn@crate::mapf::lacam)) how all come to their goals. It
//!    sends each node all stops, and the visits to its vertices. They take the place of all that
//!    was reserved beyond the stops. If there is no plan, or none is found, the root says that
//!    instead, and what was reserved holds.
//!
//! A node that has the plan may grant what one has that does not have it yet: that one grants
//! nothing. And what was granted before is what the plan begins with. So there is no instant at
//! which anybody acts on two plans. All come to their stops: a visit up to there waits only for
//! visits up to stops, that were to begin before. And a visit of the plan waits only for these and
//! for visits of the plan that are to begin before.
//!
//! **What it guarantees.** Together with the argument of [`reservation`](crate::reservation): if
//! all rovers can get to their goals at all, they do, as long as the search finds it. Where it has
//! no limit it is complete. Its limit is [`FIRST_STATES`] at first, and twice as much each time.
//! Meanwhile, and where it is certain that there is no plan, rovers make room for each other as
//! `displacement` has it.
//!
//! Neither with `network.failover_after`, where a rover may refuse a path, and a plan with it; nor
//! where gaps have to be crossed; nor on well-formed instances, which do not need it.

mod plan;

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use farside_worlds::{NodeId, SensorNetwork};

use super::displacement::Claims;
use super::{Desk, Registry};
use crate::ids::RoverId;
use crate::mapf::{CoupledError, LacamConfig};
use crate::reservation::messages::{Item, Joint, JointStep, PlannedVisit, Reserved, ReservedVisit};
use crate::reservation::table::Visit;
use plan::{JointPlan, joint_plan};

/// What a registry keeps of joint resolutions.
#[derive(Debug, Default)]
pub(crate) struct JointResolution {
    branch: Option<Branch>,
    /// The last one that it heard of, from 1.
    round: u32,
    phase: Phase,
    /// Which children have said what this phase waits for.
    heard: BTreeSet<NodeId>,
    gathered: Reserved,
    /// It has asked since the last one.
    asked: bool,
    /// There was one that found no plan: until there is one, others have to make room.
    failed: u32,
    /// There is no plan, ever.
    is_hopeless: bool,
    /// There was one: all have their ways.
    is_planned: bool,
    /// The next one has begun, before it was heard what became of this one.
    next_round: Option<u32>,
    /// At the root: when the next may begin [ns].
    not_before: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    /// None is under way.
    #[default]
    Idle,
    /// Requests that are under way come to their ends.
    Ending,
    /// They have.
    Ended,
    /// Visits that are entered are confirmed or struck out.
    Settling,
    /// They are.
    Settled,
}

/// A region's place in the tree: the breadth-first tree from the lowest region of all that are
/// connected with it.
#[derive(Debug)]
struct Branch {
    parent: Option<NodeId>,
    /// Each with all regions below it, itself included.
    children: Vec<(NodeId, BTreeSet<NodeId>)>,
}

impl Branch {
    fn of(sensors: &SensorNetwork, region: NodeId) -> Branch {
        let root = reached(sensors, region).into_keys().min().unwrap_or(region);
        let parents = reached(sensors, root);
        let mut below = BTreeMap::<NodeId, BTreeSet<NodeId>>::new();
        for &node in parents.keys() {
            let up = |n: &NodeId| parents[n].filter(|_| *n != region);
            let way: Vec<NodeId> = std::iter::successors(Some(node), up).collect();
            // From the node up to this region: the last but one is the child that leads there.
            if let [.., child, here] = way[..]
                && here == region
            {
                below.entry(child).or_default().insert(node);
            }
        }
        Branch {
            parent: parents[&region],
            children: below.into_iter().collect(),
        }
    }
}

/// All regions that are connected with `from`, each with the one before it on the way.
fn reached(sensors: &SensorNetwork, from: NodeId) -> BTreeMap<NodeId, Option<NodeId>> {
    let mut before = BTreeMap::from([(from, None)]);
    let mut open = VecDeque::from([from]);
    while let Some(here) = open.pop_front() {
        for &next in sensors.neighbors(here) {
            before.entry(next).or_insert_with(|| {
                open.push_back(next);
                Some(here)
            });
        }
    }
    before
}

impl JointResolution {
    /// One is under way: nothing else is begun.
    pub(crate) fn holds(&self) -> bool {
        self.phase != Phase::Idle
    }

    /// Nothing is granted, because the plan begins with what is.
    pub(crate) fn stops_grants(&self) -> bool {
        matches!(self.phase, Phase::Settling | Phase::Settled)
    }

    /// Whether one may help. Until one was tried nobody is asked to make room.
    pub(crate) fn is_due(&self, desk: &Desk<'_>) -> bool {
        is_possible(desk) && self.failed == 0 && !self.is_hopeless
    }

    /// At the root, when the next one begins.
    pub(crate) fn next_due(&self) -> Option<u64> {
        let is_root = self.branch.as_ref().is_some_and(|b| b.parent.is_none());
        let waits = is_root && self.asked && self.phase == Phase::Idle && !self.is_hopeless;
        waits.then_some(self.not_before)
    }

    fn begin_phase(&mut self, phase: Phase) {
        self.phase = phase;
        self.heard.clear();
    }

    fn has_heard_all(&self) -> bool {
        let children = self.branch.iter().flat_map(|branch| &branch.children);
        children.clone().count() == self.heard.len()
    }
}

fn is_possible(desk: &Desk<'_>) -> bool {
    desk.site.stay_at_target
        && !desk.site.is_well_formed
        && !desk.may_be_replaced()
        && desk.site.sensors.gaps().is_empty()
}

impl Registry {
    /// A request found no path: all rovers together may find some.
    pub(crate) fn ask_for_joint_plan(&mut self, desk: &Desk<'_>) {
        let joint = &mut self.joint;
        if !is_possible(desk) || joint.is_hopeless || joint.is_planned || joint.holds() {
            return;
        }
        let branch = &mut joint.branch;
        let branch = branch.get_or_insert_with(|| Branch::of(&desk.site.sensors, desk.region));
        let parent = branch.parent;
        if std::mem::replace(&mut joint.asked, true) {
            return;
        }
        if let Some(parent) = parent {
            self.say(desk, parent, JointStep::Ask);
        }
    }

    pub(crate) fn take_joint(&mut self, desk: &Desk<'_>, item: Joint) {
        let Joint { from, round, step } = item;
        let joint = &mut self.joint;
        if matches!(step, JointStep::Hold) && round > joint.round {
            // What is said later may come sooner.
            joint.next_round = Some(round);
            return self.hold_next(desk);
        }
        if matches!(step, JointStep::Ask) {
            return self.ask_for_joint_plan(desk);
        }
        if round != joint.round {
            return;
        }
        match step {
            JointStep::Held => {
                joint.heard.insert(from);
            }
            JointStep::Tell => self.tell(desk),
            JointStep::Told(reserved) => {
                joint.heard.insert(from);
                joint.gathered.visits.extend(reserved.visits);
            }
            JointStep::Plan { stops, visits } => self.take_plan(desk, JointPlan { stops, visits }),
            JointStep::GoOn { is_hopeless } => self.go_on(desk, is_hopeless),
            JointStep::Ask | JointStep::Hold => {}
        }
    }

    /// Does what the state of this region allows: begins, says that it is ready, plans.
    pub(crate) fn resolve_jointly(&mut self, desk: &Desk<'_>) {
        if self.joint.next_due().is_some_and(|due| due <= desk.now) {
            self.joint.round += 1;
            self.hold(desk);
        }
        let parent = self.joint.branch.as_ref().and_then(|branch| branch.parent);
        if self.joint.phase == Phase::Ending
            && self.joint.has_heard_all()
            && self.applicants.iter().all(|a| a.request.is_none())
        {
            self.joint.begin_phase(Phase::Ended);
            match parent {
                Some(parent) => self.say(desk, parent, JointStep::Held),
                None => self.tell(desk),
            }
        }
        if self.joint.phase == Phase::Settling
            && self.joint.has_heard_all()
            && self.table.is_settled()
        {
            self.joint.begin_phase(Phase::Settled);
            let mut gathered = std::mem::take(&mut self.joint.gathered);
            gathered.visits.extend(self.table.all());
            match parent {
                Some(parent) => self.say(desk, parent, JointStep::Told(gathered)),
                None => self.plan_jointly(desk, &gathered.visits),
            }
        }
    }

    fn hold_next(&mut self, desk: &Desk<'_>) {
        if !self.joint.holds()
            && let Some(round) = self.joint.next_round.take()
        {
            self.joint.round = round;
            self.hold(desk);
        }
    }

    fn hold(&mut self, desk: &Desk<'_>) {
        let branch = &mut self.joint.branch;
        branch.get_or_insert_with(|| Branch::of(&desk.site.sensors, desk.region));
        self.joint.asked = false;
        self.joint.begin_phase(Phase::Ending);
        self.say_below(desk, &JointStep::Hold);
    }

    fn tell(&mut self, desk: &Desk<'_>) {
        self.joint.gathered = Reserved::default();
        self.joint.begin_phase(Phase::Settling);
        self.say_below(desk, &JointStep::Tell);
    }

    /// At the root: plans, and tells all.
    fn plan_jointly(&mut self, desk: &Desk<'_>, reserved: &[ReservedVisit]) {
        let limit = FIRST_STATES / desk.site.missions.len().max(1) as u64;
        let limits = LacamConfig {
            max_expansions: limit << self.joint.failed.min(MOST_DOUBLINGS),
            seed: u64::from(self.joint.round),
            ..LacamConfig::default()
        };
        match joint_plan(desk, reserved, self.headway(), limits) {
            Ok(plan) => self.take_plan(desk, plan),
            Err(error) => {
                let pause = (PAUSE << self.joint.failed.min(8)) * desk.site.timing.cycle.as_nanos();
                self.joint.not_before = desk.now + pause;
                let is_hopeless = matches!(error, CoupledError::Unsolvable { .. });
                self.go_on(desk, is_hopeless);
            }
        }
    }

    /// Enters what is planned for this region; all have their ways then.
    fn take_plan(&mut self, desk: &Desk<'_>, plan: JointPlan) {
        let JointPlan { stops, visits } = plan;
        self.joint.begin_phase(Phase::Idle);
        let last: BTreeMap<RoverId, u32> = stops.iter().map(|s| (s.rover, s.step)).collect();
        self.table.strike_beyond(&last);
        let owner = |planned: &PlannedVisit| desk.site.sensors.owner(planned.visit.vertex);
        for planned in visits
            .iter()
            .filter(|planned| owner(planned) == desk.region)
        {
            let timed = planned.visit;
            if planned.from.is_none() {
                self.table.leave_by(timed.vertex, timed.end);
                continue;
            }
            let visit = Visit {
                request: planned.request,
                step: planned.step,
                from: planned.from,
                start: timed.start,
                end: timed.end,
                confirmed: true,
                granted: false,
            };
            self.table.enter(timed.vertex, visit);
        }
        self.applicants.clear();
        self.claims = Claims::default();
        let children = self.joint.branch.iter().flat_map(|b| &b.children);
        let parts: Vec<_> = children
            .map(|(child, below)| {
                let part = visits
                    .iter()
                    .filter(|planned| below.contains(&owner(planned)));
                (*child, part.cloned().collect())
            })
            .collect();
        for (child, visits) in parts {
            let stops = stops.clone();
            self.say(desk, child, JointStep::Plan { stops, visits });
        }
        self.joint.is_planned = true;
    }

    /// There is no plan: all go on as before.
    fn go_on(&mut self, desk: &Desk<'_>, is_hopeless: bool) {
        self.joint.begin_phase(Phase::Idle);
        self.joint.failed += 1;
        self.joint.is_hopeless = is_hopeless;
        self.say_below(desk, &JointStep::GoOn { is_hopeless });
        self.hold_next(desk);
    }

    fn say_below(&mut self, desk: &Desk<'_>, step: &JointStep) {
        let children = self.joint.branch.iter().flat_map(|b| &b.children);
        for child in children.map(|(child, _)| *child).collect::<Vec<_>>() {
            self.say(desk, child, step.clone());
        }
    }

    fn say(&mut self, desk: &Desk<'_>, to: NodeId, step: JointStep) {
        let item = Joint {
            from: desk.region,
            round: self.joint.round,
            step,
        };
        self.post(to, Item::Joint(item));
    }
}

/// How many expansions the first search has, times the rovers of the team: 10,000 for 200.
const FIRST_STATES: u64 = 2_000_000;

/// How often that is doubled.
const MOST_DOUBLINGS: u32 = 4;

/// How many cycles pass before another one, at first.
const PAUSE: u64 = 20;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::grid;

    #[test]
    fn all_regions_are_on_one_tree() {
        let map = grid(9, 9, &[]);
        let radius_m = SensorNetwork::default_radius_m(&map, 9);
        let sensors = SensorNetwork::place(&map, 9, radius_m, 1).unwrap();
        let mut roots = 0;
        for region in sensors.nodes() {
            let branch = Branch::of(&sensors, region);
            let below: usize = branch.children.iter().map(|(_, below)| below.len()).sum();
            assert!(branch.parent.is_some() || below == 8);
            roots += u32::from(branch.parent.is_none());
            for (child, below) in &branch.children {
                assert_eq!(Branch::of(&sensors, *child).parent, Some(region));
                let deeper = Branch::of(&sensors, *child).children;
                let deeper: usize = deeper.iter().map(|(_, below)| below.len()).sum();
                assert_eq!(below.len(), deeper + 1);
            }
        }
        assert_eq!(roots, 1);
    }
}
