//! What a node keeps for the `complete` policy, all of it durable, and how walks proceed: what is done
//! with each item that comes in. Pure but for the books: items go to `lines`, grants to the caller.

use std::collections::BTreeMap;

use farside_worlds::{NodeId, VertexId};

use super::book::{Book, Clash, Visit};
use super::messages::{Item, Probe, Reserve, Settle, Verdict, Walk};
use super::relay::Line;
use super::routes::routes;
use crate::network::assemble::Site;
use crate::network::messages::RoverId;
use crate::planning::safe_intervals::{FOREVER, Ground, Label, TimedVisit, prune, way_to};

/// The most labels that a probe hands on from one node to the next, so that messages stay small.
const MAX_FRONTIER: usize = 24;

/// A rover that wants to be let in, the first of its queue.
#[derive(Debug)]
struct Applicant {
    entry: VertexId,
    /// How many of its queue have a way.
    served: usize,
    /// The walk under way, and when its attempt began.
    walk: Option<(Walk, u64)>,
    /// When the last one before is planned to come in.
    last_entry: u64,
}

/// What the owner of a goal has heard of the probes of one attempt.
#[derive(Debug)]
struct Offers {
    walk: Walk,
    heard: u32,
    probes: u32,
    first_step: u32,
    route: Vec<NodeId>,
    best: Option<(u64, Vec<TimedVisit>)>,
    decided: bool,
    /// When it decides on what it has.
    deadline: u64,
}

/// All that a node keeps.
#[derive(Debug, Default)]
pub(crate) struct Registry {
    pub(super) book: Book,
    pub(super) lines: BTreeMap<NodeId, Line>,
    applicants: Vec<Applicant>,
    offers: BTreeMap<RoverId, Offers>,
    /// Ways that wait for younger walks to be settled.
    parked: Vec<Reserve>,
    /// How long a walk takes from its first probe to its confirmation, smoothed [ns].
    walk_time: u64,
}

/// Who acts, and when.
pub(super) struct Desk<'a> {
    pub(super) site: &'a Site,
    pub(super) node: NodeId,
    pub(super) now: u64,
}

impl Registry {
    /// Makes a new registry ready; leaves one that has survived a crash as it is.
    pub(super) fn open(&mut self, desk: &Desk<'_>) {
        let sensors = &desk.site.sensors;
        self.book.open(sensors.owned(desk.node));
        if self.lines.is_empty() {
            for &neighbor in sensors.neighbors(desk.node) {
                self.lines.insert(neighbor, Line::default());
            }
            let own = |entry: &VertexId| sensors.owner(*entry) == desk.node;
            let queues = desk.site.queues.iter().map(|(entry, _)| *entry);
            self.applicants = queues
                .filter(own)
                .map(|entry| Applicant {
                    entry,
                    served: 0,
                    walk: None,
                    last_entry: 0,
                })
                .collect();
        } else {
            for line in self.lines.values_mut() {
                line.restart();
            }
        }
    }

    /// The time that it takes to learn that a vertex is free and to grant it [ns].
    fn gap(&self) -> u64 {
        let measured = self.lines.values().filter(|line| line.is_measured());
        let (sum, count) = measured.fold((0, 0), |(sum, n), line| (sum + line.round_trip(), n + 1));
        let mean: Option<u64> = sum.checked_div(count);
        mean.map_or(FIRST_GAP, |gap| gap.max(1))
    }

    /// Begins a walk for the first rover of each own queue that has none.
    pub(super) fn apply(&mut self, desk: &Desk<'_>) {
        for at in 0..self.applicants.len() {
            if self.applicants[at].walk.is_some() {
                continue;
            }
            let entry = self.applicants[at].entry;
            let queue = desk.site.queue(entry);
            if let Some(&rover) = queue.get(self.applicants[at].served) {
                let walk = Walk {
                    rover,
                    attempt: 1,
                    since: desk.now,
                };
                self.begin(desk, at, walk);
            }
        }
    }

    fn begin(&mut self, desk: &Desk<'_>, at: usize, walk: Walk) {
        let applicant = &mut self.applicants[at];
        applicant.walk = Some((walk, desk.now));
        let (entry, last_entry) = (applicant.entry, applicant.last_entry);
        let goal = desk.site.missions[walk.rover.0 as usize].1;
        let earliest = (desk.now + self.walk_time).max(last_entry + 1);
        let dwell = desk.site.config.cycle.as_nanos();
        let labels = self.search(desk, |ground| ground.enter(entry, earliest, dwell));
        let site = desk.site;
        let routes = routes(
            &site.roadmap,
            &site.sensors,
            (entry, goal),
            site.config.routes,
        );
        let probes = routes.len() as u32;
        for route in routes {
            let probe = Probe {
                walk,
                probes,
                started: desk.now,
                route,
                at: 0,
                goal,
                first_step: 1,
                frontier: (0..labels.len() as u32).collect(),
                labels: labels.clone(),
            };
            self.probe(desk, probe);
        }
    }

    fn search<T>(&self, desk: &Desk<'_>, with: impl FnOnce(&Ground<'_>) -> T) -> T {
        let ground = Ground {
            roadmap: &desk.site.roadmap,
            gap: self.gap(),
            travel: &|_, _| desk.site.config.cycle.as_nanos(),
            busy: &|v| self.book.busy(v),
        };
        with(&ground)
    }

    pub(super) fn take(&mut self, desk: &Desk<'_>, item: Item) {
        match item {
            Item::Probe(probe) => self.probe(desk, probe),
            Item::Reserve(reserve) => self.reserve(desk, reserve),
            Item::Settle(settle) => self.settle(desk, settle),
        }
    }

    fn post(&mut self, to: NodeId, item: Item) {
        if let Some(line) = self.lines.get_mut(&to) {
            line.post(item);
        }
    }

    /// Works out where the rover could be in this node's part, and hands that on.
    fn probe(&mut self, desk: &Desk<'_>, mut probe: Probe) {
        let (mut labels, open) = (std::mem::take(&mut probe.labels), &probe.frontier);
        self.search(desk, |ground| ground.expand(&mut labels, open));
        let Some(&next) = probe.route.get(probe.at as usize + 1) else {
            self.offer(desk, &probe, &labels);
            return;
        };
        let site = desk.site;
        let borders = |label: &Label| {
            let onward = site.roadmap.neighbors(label.vertex);
            site.sensors.owner(label.vertex) == desk.node
                && onward.iter().any(|&v| site.sensors.owner(v) == next)
        };
        let frontier = frontier(&labels, borders);
        probe.frontier = prune(&mut labels, &frontier);
        probe.labels = labels;
        probe.at += 1;
        self.post(next, Item::Probe(probe));
    }

    /// A probe has come to the owner of its goal.
    fn offer(&mut self, desk: &Desk<'_>, probe: &Probe, labels: &[Label]) {
        let rover = probe.walk.rover;
        let known = self.offers.get(&rover).map_or(0, |o| o.walk.attempt);
        if known > probe.walk.attempt {
            return;
        }
        if known < probe.walk.attempt {
            let offers = Offers {
                walk: probe.walk,
                heard: 0,
                probes: probe.probes,
                first_step: probe.first_step,
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
        let arrivals = (0..)
            .zip(labels)
            .filter(|(_, label)| label.vertex == probe.goal);
        if let Some((at, label)) = arrivals.min_by_key(|(_, label)| label.ready)
            && offers
                .best
                .as_ref()
                .is_none_or(|(ready, _)| label.ready < *ready)
        {
            let end = label.ready.saturating_add(gap).min(label.until);
            offers.best = Some((label.ready, way_to(labels, at, end)));
        }
        if offers.heard >= offers.probes {
            self.decide(desk, rover);
        }
    }

    /// Decides what has waited for long enough.
    pub(super) fn decide_overdue(&mut self, desk: &Desk<'_>) {
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

    fn decide(&mut self, desk: &Desk<'_>, rover: RoverId) {
        let Some(offers) = self.offers.get_mut(&rover).filter(|o| !o.decided) else {
            return;
        };
        offers.decided = true;
        let (walk, first_step) = (offers.walk, offers.first_step);
        match offers.best.take() {
            Some((_, way)) => {
                let at = way.len() as u32 - 1;
                let reserve = Reserve {
                    walk,
                    first_step,
                    way,
                    at,
                };
                self.reserve(desk, reserve);
            }
            None => {
                let route = offers.route.clone();
                let at = route.len() as u32 - 1;
                self.fail(
                    desk,
                    Settle {
                        walk,
                        verdict: Verdict::Failed,
                        route,
                        at,
                    },
                );
            }
        }
    }

    /// Enters this node's part of a way, from the back.
    fn reserve(&mut self, desk: &Desk<'_>, mut reserve: Reserve) {
        self.book.strike_earlier(&reserve.walk);
        let hi = reserve.at as usize;
        let mine = |visit: &TimedVisit| desk.site.sensors.owner(visit.vertex) == desk.node;
        let part = reserve.way[..=hi]
            .iter()
            .rev()
            .take_while(|visit| mine(visit))
            .count();
        let lo = hi + 1 - part;
        match self.book.check(&reserve.walk, &reserve.way[lo..=hi]) {
            Ok(()) => {}
            Err(Clash::Younger) => {
                self.parked.push(reserve);
                return;
            }
            Err(Clash::Firm) => {
                self.refuse(desk, &reserve, lo);
                return;
            }
        }
        for i in lo..=hi {
            let TimedVisit { vertex, start, end } = reserve.way[i];
            let visit = Visit {
                walk: reserve.walk,
                step: reserve.first_step + i as u32,
                from: i.checked_sub(1).map(|before| reserve.way[before].vertex),
                start,
                end,
                confirmed: lo == 0,
                granted: false,
            };
            self.book.enter(vertex, visit);
        }
        if lo > 0 {
            reserve.at = lo as u32 - 1;
            let to = desk.site.sensors.owner(reserve.way[lo - 1].vertex);
            self.post(to, Item::Reserve(reserve));
            return;
        }
        // The whole way is entered: from here on it holds.
        self.book.confirm(&reserve.walk);
        self.served(desk, &reserve);
        let settle = Settle {
            walk: reserve.walk,
            verdict: Verdict::Confirmed,
            route: owners(desk, &reserve.way),
            at: 0,
        };
        self.forward(settle);
        self.unpark(desk);
    }

    /// The first part of the way, from visit `lo` on, cannot be entered.
    fn refuse(&mut self, desk: &Desk<'_>, reserve: &Reserve, lo: usize) {
        let route = owners(desk, &reserve.way);
        let at = owners(desk, &reserve.way[..=lo]).len() as u32 - 1;
        let walk = reserve.walk;
        let released = Settle {
            walk,
            verdict: Verdict::Released,
            route: route.clone(),
            at,
        };
        self.forward(released);
        // A route may pass this node twice.
        self.book.strike(&walk);
        self.unpark(desk);
        self.fail(
            desk,
            Settle {
                walk,
                verdict: Verdict::Failed,
                route,
                at,
            },
        );
    }

    fn forward(&mut self, settle: Settle) {
        let at = settle.at + 1;
        if let Some(&to) = settle.route.get(at as usize) {
            self.post(to, Item::Settle(Settle { at, ..settle }));
        }
    }

    /// Tells the node that began; if that is this one, it begins again.
    fn fail(&mut self, desk: &Desk<'_>, settle: Settle) {
        if let Some(at) = settle.at.checked_sub(1) {
            let to = settle.route[at as usize];
            self.post(to, Item::Settle(Settle { at, ..settle }));
            return;
        }
        let walk = settle.walk;
        let current = |a: &Applicant| a.walk.is_some_and(|(mine, _)| mine == walk);
        if let Some(at) = self.applicants.iter().position(current) {
            let attempt = walk.attempt + 1;
            self.begin(desk, at, Walk { attempt, ..walk });
        }
    }

    fn settle(&mut self, desk: &Desk<'_>, settle: Settle) {
        match settle.verdict {
            Verdict::Failed => return self.fail(desk, settle),
            Verdict::Confirmed => self.book.confirm(&settle.walk),
            Verdict::Released => self.book.strike(&settle.walk),
        }
        self.forward(settle);
        self.unpark(desk);
    }

    /// Something was settled: who waited for it may go on.
    fn unpark(&mut self, desk: &Desk<'_>) {
        for reserve in std::mem::take(&mut self.parked) {
            self.reserve(desk, reserve);
        }
    }

    /// The rover of this walk has its way: the next one of the queue is served.
    fn served(&mut self, desk: &Desk<'_>, reserve: &Reserve) {
        let current = |a: &&mut Applicant| a.walk.is_some_and(|(mine, _)| mine == reserve.walk);
        if let Some(applicant) = self.applicants.iter_mut().find(current) {
            let started = applicant
                .walk
                .take()
                .map_or(desk.now, |(_, started)| started);
            applicant.served += 1;
            applicant.last_entry = reserve.way[0].start;
            let took = desk.now - started;
            self.walk_time = if self.walk_time == 0 {
                took
            } else {
                (3 * self.walk_time + took) / 4
            };
        }
        self.apply(desk);
    }

    /// When something is to be done without being told.
    pub(super) fn next_due(&self) -> Option<u64> {
        let lines = self.lines.values().filter_map(Line::next_due);
        let open = self
            .offers
            .values()
            .filter(|o| !o.decided && o.best.is_some());
        lines.chain(open.map(|o| o.deadline)).min()
    }
}

/// The gap before anything was measured [ns].
const FIRST_GAP: u64 = 10_000_000;

/// The owners of the vertices of a way, in order, without repeats in a row.
fn owners(desk: &Desk<'_>, way: &[TimedVisit]) -> Vec<NodeId> {
    let mut owners: Vec<NodeId> = way
        .iter()
        .map(|visit| desk.site.sensors.owner(visit.vertex))
        .collect();
    owners.dedup();
    owners
}

/// The labels from which to go on: the earliest of each vertex and interval, not too many, and always
/// one of those that can be kept up for ever.
fn frontier(labels: &[Label], borders: impl Fn(&Label) -> bool) -> Vec<u32> {
    let mut best = BTreeMap::<(VertexId, u64), (u64, u32)>::new();
    for (at, label) in (0..).zip(labels).filter(|(_, label)| borders(label)) {
        let found = best
            .entry((label.vertex, label.until))
            .or_insert((label.ready, at));
        *found = (*found).min((label.ready, at));
    }
    let mut all: Vec<(u64, u32)> = best.into_values().collect();
    all.sort_unstable();
    let last = all
        .iter()
        .position(|&(_, at)| labels[at as usize].until == FOREVER);
    if let Some(last) = last.filter(|&last| last >= MAX_FRONTIER) {
        all.swap(MAX_FRONTIER - 1, last);
    }
    all.truncate(MAX_FRONTIER);
    all.into_iter().map(|(_, at)| at).collect()
}
