//! How walks proceed: what a node does with a probe, a way to be reserved, and the news of what became
//! of it.

use std::collections::BTreeMap;

use farside_worlds::VertexId;

use super::{Desk, Offers, Registry, owners};
use crate::ids::RoverId;
use crate::mapf::safe_intervals::{FOREVER, Label, TimedVisit, prune, way_to};
use crate::reservation::book::{Clash, Visit};
use crate::reservation::messages::{Item, Probe, Reserve, Settle, Verdict, Walk, Wish, Yield};

/// The most labels that a probe hands on from one node to the next, so that messages stay small.
const MAX_FRONTIER: usize = 24;

impl Registry {
    /// Works out where the rover could be in this node's part, and hands that on.
    ///
    /// A wish is in the name of a walk that began with `elder`.
    pub(crate) fn probe(&mut self, desk: &Desk<'_>, mut probe: Probe, elder: (u64, RoverId)) {
        let (mut labels, open) = (std::mem::take(&mut probe.labels), &probe.frontier);
        if probe.wishful {
            let busy = |v| self.busy_for_elders(v, elder);
            self.search_in(desk, &busy, |ground| ground.expand(&mut labels, open));
        } else {
            self.search(desk, |ground| ground.expand(&mut labels, open));
        }
        let Some(&next) = probe.route.get(probe.at as usize + 1) else {
            self.offer(desk, &probe, &labels, elder);
            return;
        };
        let site = desk.site;
        let borders = |label: &Label| {
            let onward = site.roadmap.neighbors(label.vertex);
            site.sensors.owner(label.vertex) == desk.home
                && onward.iter().any(|&v| site.sensors.owner(v) == next)
        };
        let has_gaps = !site.sensors.gaps().is_empty();
        let frontier = frontier(&labels, has_gaps, borders);
        probe.frontier = prune(&mut labels, &frontier);
        probe.labels = labels;
        probe.at += 1;
        let item = match probe.wishful {
            true => Item::Wish(Wish { probe, elder }),
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
        elder: (u64, RoverId),
    ) {
        if self.succession.is_stale(probe.started) {
            return;
        }
        let rover = probe.walk.rover;
        // Of a rover's walks, and of their attempts, only the last counts.
        let age = |walk: &Walk| Some((walk.since, walk.attempt));
        let known = self.offers.get(&rover).and_then(|o| age(&o.walk));
        if known > age(&probe.walk) {
            return;
        }
        if known < age(&probe.walk) {
            let offers = Offers {
                walk: probe.walk,
                heard: 0,
                probes: probe.probes,
                first_step: probe.first_step,
                wishful: probe.wishful,
                elder,
                route: probe.route.clone(),
                best: None,
                decided: false,
                // Other routes may be much slower, or lead past a node that is down.
                deadline: desk.now + 2 * (desk.now - probe.started) + self.gap(),
            };
            self.offers.insert(rover, offers);
        }
        let gap = self.gap();
        let Some(offers) = self.offers.get_mut(&rover) else {
            return;
        };
        offers.heard += 1;
        // Who stays needs the goal for ever, and leaves it to who has asked for it before.
        let stays = desk.site.stays;
        if !offers.wishful && self.claims.is_claimed(probe.goal, offers.elder, desk.now) {
            labels = &[];
        }
        let arrivals = (0..)
            .zip(labels)
            .filter(|(_, label)| label.vertex == probe.goal && (!stays || label.until == FOREVER));
        if let Some((at, label)) = arrivals.min_by_key(|(_, label)| label.ready)
            && offers
                .best
                .as_ref()
                .is_none_or(|(ready, _)| label.ready < *ready)
        {
            let leaves = label.ready.saturating_add(gap).min(label.until);
            let end = if stays { FOREVER } else { leaves };
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
        let (walk, first_step, elder) = (offers.walk, offers.first_step, offers.elder);
        match offers.best.take() {
            Some((_, way)) if offers.wishful => {
                let route = owners(desk, &way);
                let request = Yield {
                    walk,
                    elder,
                    path: way.iter().map(|visit| visit.vertex).collect(),
                    at: route.len() as u32 - 1,
                    route,
                };
                self.make_way(desk, request);
            }
            Some((_, way)) => {
                let at = way.len() as u32 - 1;
                let reserve = Reserve {
                    walk,
                    first_step,
                    way,
                    at,
                    replaced: Vec::new(),
                };
                self.reserve(desk, reserve);
            }
            None => {
                let route = offers.route.clone();
                let settle = Settle {
                    walk,
                    verdict: Verdict::NoWay,
                    at: route.len() as u32 - 1,
                    route,
                };
                self.fail(desk, settle);
            }
        }
    }

    /// Enters this home's part of a way, from the back.
    pub(crate) fn reserve(&mut self, desk: &Desk<'_>, mut reserve: Reserve) {
        if desk.may_be_replaced() && self.is_taken(desk, &reserve) {
            return;
        }
        self.book.strike_earlier(&reserve.walk);
        self.succession.close(|open| open.is_before(&reserve.walk));
        self.claims.give_up(reserve.walk.rover);
        let hi = reserve.at as usize;
        let mine = |visit: &TimedVisit| desk.site.sensors.owner(visit.vertex) == desk.home;
        let part = reserve.way[..=hi]
            .iter()
            .rev()
            .take_while(|visit| mine(visit))
            .count();
        let lo = hi + 1 - part;
        let walk = reserve.walk;
        if lo == 0 && desk.may_be_replaced() {
            if self.succession.is_proposed(&walk) {
                return;
            }
            // Given up meanwhile, because somebody was replaced.
            if !self.applicants.iter().any(|a| a.is_on(&walk)) {
                self.release(desk, &reserve, lo);
                return;
            }
        }
        // A rover that stands on the map has its first vertex already.
        let stands = lo == 0 && desk.site.stays;
        let first = lo + usize::from(stands);
        // What was passed on to a home that is replaced may come a second time.
        let again = desk.may_be_replaced() && self.book.has(&walk, &reserve.way[first..=hi]);
        match self.book.check(&walk, &reserve.way[first..=hi]) {
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
                self.succession.pass(&reserve);
            }
            let to = desk.site.sensors.owner(reserve.way[lo - 1].vertex);
            self.post(to, Item::Reserve(reserve));
        } else if desk.may_be_replaced() {
            self.propose(reserve);
        } else {
            self.confirm(desk, &reserve);
        }
    }

    /// Enters visits `first` to `last` of a way, tentatively.
    fn enter(&mut self, reserve: &Reserve, first: usize, last: usize) {
        for i in first..=last {
            let TimedVisit { vertex, start, end } = reserve.way[i];
            let visit = Visit {
                walk: reserve.walk,
                step: reserve.first_step + i as u32,
                from: i.checked_sub(1).map(|before| reserve.way[before].vertex),
                start,
                end,
                confirmed: false,
                granted: false,
            };
            self.book.enter(vertex, visit);
        }
    }

    /// The whole way is entered: from here on it holds.
    pub(crate) fn confirm(&mut self, desk: &Desk<'_>, reserve: &Reserve) {
        self.settled(desk, &reserve.walk, Verdict::Confirmed);
        if desk.site.stays {
            let TimedVisit { vertex, end, .. } = reserve.way[0];
            self.book.leave_by(vertex, end);
        }
        self.served(desk, reserve);
        self.return_later(desk, &reserve.walk);
        let settle = Settle {
            walk: reserve.walk,
            verdict: Verdict::Confirmed,
            route: owners(desk, &reserve.way),
            at: 0,
        };
        self.forward(settle);
        self.unpark(desk);
    }

    /// What this home has of a walk holds, or is struck out.
    fn settled(&mut self, desk: &Desk<'_>, walk: &Walk, verdict: Verdict) {
        match verdict {
            Verdict::Confirmed => self.book.confirm(walk),
            _ => self.book.strike(walk),
        }
        if desk.may_be_replaced() {
            self.succession.close(|open| open == walk);
            if verdict == Verdict::Confirmed {
                self.succession.take(*walk);
            }
        }
    }

    /// Strikes out all of a way that was entered, from visit `lo` on.
    pub(crate) fn release(&mut self, desk: &Desk<'_>, reserve: &Reserve, lo: usize) {
        let released = Settle {
            walk: reserve.walk,
            verdict: Verdict::Released,
            route: owners(desk, &reserve.way),
            at: owners(desk, &reserve.way[..=lo]).len() as u32 - 1,
        };
        self.forward(released);
        // A route may pass this home twice.
        self.settled(desk, &reserve.walk, Verdict::Released);
        self.unpark(desk);
    }

    /// The first part of the way, from visit `lo` on, cannot be entered.
    pub(crate) fn refuse(&mut self, desk: &Desk<'_>, reserve: &Reserve, lo: usize) {
        self.release(desk, reserve, lo);
        let failed = Settle {
            walk: reserve.walk,
            verdict: Verdict::Failed,
            route: owners(desk, &reserve.way),
            at: owners(desk, &reserve.way[..=lo]).len() as u32 - 1,
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
        let walk = settle.walk;
        let Some(at) = self.applicants.iter().position(|a| a.is_on(&walk)) else {
            return;
        };
        let attempt = walk.attempt + 1;
        let next = Walk { attempt, ..walk };
        // Where it failed at once, at this node, it would fail in the same way again.
        let began = self.applicants[at].walk.map(|(_, began)| began);
        if settle.verdict == Verdict::Failed && began != Some(desk.now) {
            self.begin(desk, at, next);
            return;
        }
        // Nothing leads there as things stand: other rovers have to go first.
        let applicant = &mut self.applicants[at];
        applicant.walk = None;
        let pause = desk.site.timing.cycle.as_nanos() << applicant.in_vain.min(1);
        applicant.in_vain += 1;
        applicant.again = Some((next, desk.now + pause));
    }

    pub(crate) fn settle(&mut self, desk: &Desk<'_>, settle: Settle) {
        match settle.verdict {
            Verdict::Failed | Verdict::NoWay => return self.fail(desk, settle),
            Verdict::Confirmed => {
                self.settled(desk, &settle.walk, Verdict::Confirmed);
                self.return_later(desk, &settle.walk);
            }
            Verdict::Released => self.settled(desk, &settle.walk, Verdict::Released),
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

/// The labels from which to go on: the earliest of each vertex and interval, not too many, and always
/// one of those that can be kept up for ever; with gaps all of these, since what lies within one need
/// not lead out of it.
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
