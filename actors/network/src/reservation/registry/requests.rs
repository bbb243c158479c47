//! How requests proceed: what a node does with a probe, a path to be reserved, and the news of what
//! became of it.

use std::collections::{BTreeMap, BTreeSet};

use farside_worlds::{NodeId, VertexId};

use super::{Aim, Desk, Offers, Origin, Question, Registry, owners, place_of};
use crate::ids::RoverId;
use crate::mapf::safe_intervals::{FOREVER, Label, TimedVisit, prune, way_to};
use crate::reservation::messages::{
    Clear, Displace, Item, Probe, ReservationRequest, Reserve, Settle, Verdict, Wish,
};
use crate::reservation::table::{Clash, Visit};

/// The most labels that a probe hands on from one node to the next, so that messages stay small.
const MAX_FRONTIER: usize = 24;

impl Registry {
    /// Works out where the rover could be in this node's part, and hands that on.
    ///
    /// A wish is in the name of a request that began with `priority`. Along a clear path `exits`
    /// are where it leaves each node of the route; else there are none.
    pub(crate) fn probe(
        &mut self,
        desk: &Desk<'_>,
        mut probe: Probe,
        priority: (u64, RoverId),
        exits: Vec<VertexId>,
    ) {
        let (mut labels, open) = (std::mem::take(&mut probe.labels), &probe.frontier);
        if probe.wishful {
            let busy = |v| self.busy_for_priority(v, priority);
            self.search_in(desk, &busy, |ground| ground.expand(&mut labels, open));
        } else {
            self.search(desk, |ground| ground.expand(&mut labels, open));
        }
        let Some(&next) = probe.route.get(probe.at as usize + 1) else {
            self.offer(desk, &probe, &labels, priority);
            return;
        };
        let site = desk.site;
        let borders = |label: &Label| {
            let onward = site.roadmap.neighbors(label.vertex);
            site.sensors.owner(label.vertex) == desk.region
                && onward.iter().any(|&v| site.sensors.owner(v) == next)
        };
        let has_gaps = !site.sensors.gaps().is_empty();
        let mut frontier = frontier(&labels, has_gaps, borders);
        if frontier.len() >= MAX_FRONTIER {
            let parts = self
                .parts
                .entry(next)
                .or_insert_with(|| parts_of(desk, next));
            keep_one_for_each_part(desk, parts, &labels, &mut frontier);
        }
        if let Some(exit) = exits.get(probe.at as usize) {
            keep_exit(&labels, *exit, &mut frontier);
        }
        probe.frontier = prune(&mut labels, &frontier);
        probe.labels = labels;
        probe.at += 1;
        let item = match probe.wishful {
            true => Item::Wish(Wish { probe, priority }),
            false if !exits.is_empty() => Item::Clear(Clear { probe, exits }),
            false => Item::Probe(probe),
        };
        self.post(next, item);
    }

    /// A probe has come to the owner of its goal.
    pub(crate) fn offer(
        &mut self,
        desk: &Desk<'_>,
        probe: &Probe,
        mut labels: &[Label],
        priority: (u64, RoverId),
    ) {
        if self.failover.is_stale(probe.started) {
            return;
        }
        let rover = probe.request.rover;
        // Of a rover's requests, and of their attempts, only the last counts.
        let age = |request: &ReservationRequest| Some((request.since, request.attempt));
        let known = self.offers.get(&rover).and_then(|o| age(&o.request));
        if known > age(&probe.request) {
            return;
        }
        if known < age(&probe.request) {
            let offers = Offers {
                request: probe.request,
                heard: 0,
                probes: probe.probes,
                first_step: probe.first_step,
                wishful: probe.wishful,
                priority,
                route: probe.route.clone(),
                best: None,
                decided: false,
                // Other routes may be much slower, or lead past a node that is down.
                deadline: desk.now + 2 * (desk.now - probe.started) + self.headway(),
            };
            self.offers.insert(rover, offers);
        }
        let headway = self.headway();
        let Some(offers) = self.offers.get_mut(&rover) else {
            return;
        };
        offers.heard += 1;
        // Who stays needs the goal for ever, and leaves it to who has asked for it before.
        let stay_at_target = desk.site.stay_at_target;
        if !offers.wishful
            && self
                .claims
                .is_claimed(probe.goal, offers.priority, desk.now)
        {
            labels = &[];
        }
        let arrivals = (0..).zip(labels).filter(|(_, label)| {
            label.vertex == probe.goal && (!stay_at_target || label.until == FOREVER)
        });
        if let Some((at, label)) = arrivals.min_by_key(|(_, label)| label.ready)
            && offers
                .best
                .as_ref()
                .is_none_or(|(ready, _)| label.ready < *ready)
        {
            let leaves = label.ready.saturating_add(headway).min(label.until);
            let end = if stay_at_target { FOREVER } else { leaves };
            let covers = |v| desk.site.sensors.covers(v);
            offers.best = Some((label.ready, way_to(labels, at, end, covers)));
        }
        if offers.heard >= offers.probes {
            self.decide(desk, rover);
        }
    }

    /// Decides what has waited for long enough.
    pub(crate) fn decide_overdue(&mut self, desk: &Desk<'_>) {
        let overdue = |o: &Offers| !o.decided && o.deadline <= desk.now && o.best.is_some();
        let rovers = self
            .offers
            .iter()
            .filter(|(_, o)| overdue(o))
            .map(|(&r, _)| r);
        for rover in rovers.collect::<Vec<_>>() {
            self.decide(desk, rover);
        }
    }

    pub(crate) fn decide(&mut self, desk: &Desk<'_>, rover: RoverId) {
        let Some(offers) = self.offers.get_mut(&rover).filter(|o| !o.decided) else {
            return;
        };
        offers.decided = true;
        let (request, first_step, priority) = (offers.request, offers.first_step, offers.priority);
        match offers.best.take() {
            Some((_, path)) if offers.wishful => {
                let route = owners(desk, &path);
                let ask = Displace {
                    request,
                    priority,
                    path: path.iter().map(|visit| visit.vertex).collect(),
                    at: route.len() as u32 - 1,
                    route,
                };
                self.displace(desk, ask);
            }
            Some((_, path)) => {
                let at = path.len() as u32 - 1;
                let reserve = Reserve {
                    request,
                    first_step,
                    path,
                    at,
                    replaced: Vec::new(),
                };
                self.reserve(desk, reserve);
            }
            None => {
                let route = offers.route.clone();
                let settle = Settle {
                    request,
                    verdict: Verdict::NoPath,
                    at: route.len() as u32 - 1,
                    route,
                };
                self.fail(desk, settle);
            }
        }
    }

    /// Enters this region's part of a path, from the back.
    pub(crate) fn reserve(&mut self, desk: &Desk<'_>, mut reserve: Reserve) {
        if desk.may_be_replaced() && self.is_taken(desk, &reserve) {
            return;
        }
        self.table.strike_earlier(&reserve.request);
        self.release_earlier(desk, &reserve.request);
        self.claims.give_up(reserve.request.rover);
        let hi = reserve.at as usize;
        let mine = |visit: &TimedVisit| desk.site.sensors.owner(visit.vertex) == desk.region;
        let part = reserve.path[..=hi]
            .iter()
            .rev()
            .take_while(|visit| mine(visit))
            .count();
        let lo = hi + 1 - part;
        let request = reserve.request;
        if lo == 0 && desk.may_be_replaced() {
            if self.failover.is_proposed(&request) {
                return;
            }
            // Given up meanwhile, because somebody was replaced.
            if !self.applicants.iter().any(|a| a.is_on(&request)) {
                self.release(desk, &reserve, lo);
                return;
            }
        }
        if desk.may_be_replaced() && self.has_lost_part(desk, &reserve) {
            self.refuse(desk, &reserve, lo);
            return;
        }
        // A rover that stands on the map has its first vertex already.
        let stands = lo == 0 && desk.site.stay_at_target;
        let first = lo + usize::from(stands);
        // What was passed on to a region that is replaced may come a second time.
        let again = desk.may_be_replaced() && self.table.has(&request, &reserve.path[first..=hi]);
        match self.table.check(&request, &reserve.path[first..=hi]) {
            _ if again => {}
            Ok(()) => self.enter(&reserve, first, hi),
            Err(Clash::Younger) => {
                self.parked.push(reserve);
                return;
            }
            Err(Clash::Firm) => {
                self.refuse(desk, &reserve, lo);
                return;
            }
        }
        reserve.replaced.extend(desk.replacement());
        if lo > 0 {
            reserve.at = lo as u32 - 1;
            if desk.may_be_replaced() {
                self.failover.pass(&reserve);
            }
            let to = desk.site.sensors.owner(reserve.path[lo - 1].vertex);
            self.post(to, Item::Reserve(reserve));
        } else if desk.may_be_replaced() {
            self.propose(reserve);
        } else {
            self.confirm(desk, &reserve);
        }
    }

    /// Enters visits `first` to `last` of a path, tentatively.
    fn enter(&mut self, reserve: &Reserve, first: usize, last: usize) {
        for i in first..=last {
            let TimedVisit { vertex, start, end } = reserve.path[i];
            let visit = Visit {
                request: reserve.request,
                step: reserve.first_step + i as u32,
                from: i.checked_sub(1).map(|before| reserve.path[before].vertex),
                start,
                end,
                confirmed: false,
                granted: false,
            };
            self.table.enter(vertex, visit);
        }
    }

    /// The whole path is entered: from here on it holds.
    pub(crate) fn confirm(&mut self, desk: &Desk<'_>, reserve: &Reserve) {
        self.settled(desk, &reserve.request, Verdict::Confirmed, 0);
        if desk.site.stay_at_target {
            let TimedVisit { vertex, end, .. } = reserve.path[0];
            self.table.leave_by(vertex, end);
        }
        self.served(desk, reserve);
        self.return_later(desk, &reserve.request);
        let settle = Settle {
            request: reserve.request,
            verdict: Verdict::Confirmed,
            route: owners(desk, &reserve.path),
            at: 0,
        };
        self.forward(settle);
        self.unpark(desk);
    }

    /// What this region has of a request holds, or is struck out: that has come to place `at` of its
    /// route.
    fn settled(
        &mut self,
        desk: &Desk<'_>,
        request: &ReservationRequest,
        verdict: Verdict,
        at: u32,
    ) {
        match verdict {
            Verdict::Confirmed => self.table.confirm(request),
            _ => self.table.strike(request),
        }
        if desk.may_be_replaced() {
            self.note_settled(desk, request, verdict, at);
        }
    }

    /// Strikes out all of a path that was entered, from visit `lo` on.
    pub(crate) fn release(&mut self, desk: &Desk<'_>, reserve: &Reserve, lo: usize) {
        let at = place_of(desk, &reserve.path, lo);
        let released = Settle {
            request: reserve.request,
            verdict: Verdict::Released,
            route: owners(desk, &reserve.path),
            at,
        };
        self.forward(released);
        // A route may pass this region twice.
        self.settled(desk, &reserve.request, Verdict::Released, at);
        self.unpark(desk);
    }

    /// The first part of the path, from visit `lo` on, cannot be entered.
    pub(crate) fn refuse(&mut self, desk: &Desk<'_>, reserve: &Reserve, lo: usize) {
        self.release(desk, reserve, lo);
        let failed = Settle {
            request: reserve.request,
            verdict: Verdict::Failed,
            route: owners(desk, &reserve.path),
            at: place_of(desk, &reserve.path, lo),
        };
        self.fail(desk, failed);
    }

    pub(crate) fn forward(&mut self, settle: Settle) {
        let at = settle.at + 1;
        if let Some(&to) = settle.route.get(at as usize) {
            self.post(to, Item::Settle(Settle { at, ..settle }));
        }
    }

    /// Tells the node that began; if that is this one, it begins again.
    pub(crate) fn fail(&mut self, desk: &Desk<'_>, settle: Settle) {
        if let Some(at) = settle.at.checked_sub(1) {
            let to = settle.route[at as usize];
            self.post(to, Item::Settle(Settle { at, ..settle }));
            return;
        }
        let request = settle.request;
        let Some(at) = self.applicants.iter().position(|a| a.is_on(&request)) else {
            return;
        };
        let attempt = request.attempt + 1;
        let next = ReservationRequest { attempt, ..request };
        // Where it failed at once, at this node, it would fail in the same way again.
        let began = self.applicants[at].request.map(|(_, began)| began);
        if settle.verdict == Verdict::Failed && began != Some(desk.now) {
            self.begin(desk, at, next);
            return;
        }
        // Nothing leads there as things stand: other rovers have to go first.
        let applicant = &mut self.applicants[at];
        applicant.request = None;
        let pause = desk.site.timing.cycle.as_nanos() << applicant.in_vain.min(1);
        applicant.in_vain += 1;
        applicant.again = Some((next, desk.now + pause));
        // Where a clear path is known there is nobody to wait for.
        let Origin::Stand { rover, vertex, .. } = applicant.origin else {
            return;
        };
        let goal = desk.site.missions[rover.0 as usize].1;
        let to_goal = matches!(applicant.aim, Aim::Goal);
        if to_goal && self.question(desk, at, (vertex, goal)) == Question::Clear {
            self.begin(desk, at, next);
        } else {
            self.ask_for_joint_plan(desk);
        }
    }

    pub(crate) fn settle(&mut self, desk: &Desk<'_>, settle: Settle) {
        let (request, verdict, at) = (settle.request, settle.verdict, settle.at);
        match verdict {
            Verdict::Failed | Verdict::NoPath => return self.fail(desk, settle),
            Verdict::Confirmed => {
                self.settled(desk, &request, verdict, at);
                self.return_later(desk, &request);
            }
            Verdict::Released => self.settled(desk, &request, verdict, at),
        }
        self.forward(settle);
        self.unpark(desk);
    }

    /// Something was settled: who waited for it may go on.
    pub(crate) fn unpark(&mut self, desk: &Desk<'_>) {
        for reserve in std::mem::take(&mut self.parked) {
            self.reserve(desk, reserve);
        }
    }
}

/// The labels from which to go on: the earliest of each vertex and interval, not too many, and
/// always one of those that can be kept up for ever; with gaps all of these, since what lies within
/// one need not lead out of it.
fn frontier(labels: &[Label], has_gaps: bool, borders: impl Fn(&Label) -> bool) -> Vec<u32> {
    let mut best = BTreeMap::<(VertexId, u64), (u64, u32)>::new();
    for (at, label) in (0..).zip(labels).filter(|(_, label)| borders(label)) {
        let found = best
            .entry((label.vertex, label.until))
            .or_insert((label.ready, at));
        *found = (*found).min((label.ready, at));
    }
    let mut all: Vec<(u64, u32)> = best.into_values().collect();
    all.sort_unstable();
    if has_gaps {
        let ends = |&(_, at): &(u64, u32)| labels[at as usize].until != FOREVER;
        let lasting = all.iter().filter(|found| !ends(found)).count();
        all.sort_by_key(ends);
        all.truncate(lasting.max(MAX_FRONTIER));
        return all.into_iter().map(|(_, at)| at).collect();
    }
    let last = all
        .iter()
        .position(|&(_, at)| labels[at as usize].until == FOREVER);
    if let Some(last) = last.filter(|&last| last >= MAX_FRONTIER) {
        all.swap(MAX_FRONTIER - 1, last);
    }
    all.truncate(MAX_FRONTIER);
    all.into_iter().map(|(_, at)| at).collect()
}

/// For each vertex at which the next region borders on this one, the part of that region in which
/// it lies, as the lowest vertex of that part. What lies in one part does not lead to another
/// without leaving the region.
fn parts_of(desk: &Desk<'_>, next: NodeId) -> BTreeMap<VertexId, VertexId> {
    let site = desk.site;
    let mut part_of = BTreeMap::new();
    for &first in site.sensors.owned(next) {
        let mut open = vec![first];
        while let Some(here) = open.pop() {
            if site.sensors.owner(here) == next && !part_of.contains_key(&here) {
                part_of.insert(here, first);
                open.extend(site.roadmap.neighbors(here));
            }
        }
    }
    let is_beside = |v: &VertexId| {
        let mut beside = site.roadmap.neighbors(*v).iter();
        beside.any(|&u| site.sensors.owner(u) == desk.region)
    };
    part_of.retain(|v, _| is_beside(v));
    part_of
}

/// Makes sure that the frontier has a label that can be kept up for ever at the border of each part
/// of the next region, if there is one. Of a long border only the nearest vertices were kept.
fn keep_one_for_each_part(
    desk: &Desk<'_>,
    part_of: &BTreeMap<VertexId, VertexId>,
    labels: &[Label],
    frontier: &mut Vec<u32>,
) {
    let lasts = |label: &Label| {
        label.until == FOREVER && desk.site.sensors.owner(label.vertex) == desk.region
    };
    let mut earliest = BTreeMap::<VertexId, (u64, u32)>::new();
    let mut kept = BTreeSet::new();
    for (at, label) in (0..).zip(labels).filter(|(_, label)| lasts(label)) {
        for beside in desk.site.roadmap.neighbors(label.vertex) {
            let Some(&part) = part_of.get(beside) else {
                continue;
            };
            let found = earliest.entry(part).or_insert((label.ready, at));
            *found = (*found).min((label.ready, at));
            if frontier.contains(&at) {
                kept.insert(part);
            }
        }
    }
    earliest.retain(|part, _| !kept.contains(part));
    let missing: BTreeSet<u32> = earliest.into_values().map(|(_, at)| at).collect();
    frontier.extend(missing);
}

/// Makes sure that the frontier has the earliest label at `exit` that can be kept up for ever.
fn keep_exit(labels: &[Label], exit: VertexId, frontier: &mut Vec<u32>) {
    let lasts = |label: &Label| label.vertex == exit && label.until == FOREVER;
    let lasting = (0..).zip(labels).filter(|(_, label)| lasts(label));
    let Some((at, _)) = lasting.min_by_key(|(at, label)| (label.ready, *at)) else {
        return;
    };
    if !frontier.contains(&at) {
        frontier.push(at);
    }
}
