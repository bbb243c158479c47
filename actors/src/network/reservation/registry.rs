//! What a node keeps for the `complete` policy, all of it durable, and how walks proceed: what is done
//! with each item that comes in. Pure but for the books: items go to `lines`, grants to the caller.

use std::collections::BTreeMap;

use farside_worlds::{NodeId, Roadmap, VertexId};

use super::atlas::Atlas;
use super::book::{Book, Clash, Visit};
use super::messages::{Item, Probe, Reserve, Settle, Verdict, Walk, Yield};
use super::relay::Line;
use super::routes::routes;
use crate::network::assemble::Site;
use crate::network::messages::RoverId;
use crate::planning::safe_intervals::{FOREVER, Ground, Label, TimedVisit, prune, way_to};

/// The most labels that a probe hands on from one node to the next, so that messages stay small.
const MAX_FRONTIER: usize = 24;

/// A rover, or a queue of rovers, for which a way is sought.
#[derive(Debug)]
struct Applicant {
    origin: Origin,
    aim: Aim,
    /// The walk under way, and when its attempt began.
    walk: Option<(Walk, u64)>,
    /// The next attempt, and when it begins.
    again: Option<(Walk, u64)>,
    /// Attempts that found no way at all.
    in_vain: u32,
}

/// Where a way is to lead.
#[derive(Debug)]
enum Aim {
    /// To the rover's goal.
    Goal,
    /// Off this path, out of another's way.
    Aside(Vec<VertexId>),
}

/// Where a way begins.
#[derive(Clone, Copy, Debug)]
enum Origin {
    /// At an entry; the rovers of its queue follow each other.
    Queue {
        entry: VertexId,
        /// How many have a way.
        served: usize,
        /// When the last of these is planned to come in.
        last_entry: u64,
    },
    /// Where a rover stands, that came there with `step`.
    Stand {
        rover: RoverId,
        vertex: VertexId,
        step: u32,
    },
    /// Nowhere: there is nothing left to seek.
    Done,
}

/// What the owner of a goal has heard of the probes of one attempt.
#[derive(Debug)]
struct Offers {
    walk: Walk,
    heard: u32,
    probes: u32,
    first_step: u32,
    wishful: bool,
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
    /// What the node was given of the roadmap.
    pub(super) atlas: Atlas,
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
            let own = |v: &VertexId| sensors.owner(*v) == desk.node;
            let queues = desk.site.queues.iter().map(|(entry, _)| *entry);
            for entry in queues.filter(own) {
                self.seek(Origin::Queue {
                    entry,
                    served: 0,
                    last_entry: 0,
                });
            }
            self.preload(desk);
            self.publish_roadmap(desk);
            let standing = desk.site.standing().filter(|(_, vertex)| own(vertex));
            for (rover, vertex) in standing {
                if desk.site.schedule.is_some() {
                    continue;
                }
                self.book.stand(vertex, rover, 1);
                if desk.site.missions[rover.0 as usize].1 != vertex {
                    self.seek(Origin::Stand {
                        rover,
                        vertex,
                        step: 1,
                    });
                }
            }
        } else {
            for line in self.lines.values_mut() {
                line.restart();
            }
        }
    }

    /// Enters what was planned before the start.
    fn preload(&mut self, desk: &Desk<'_>) {
        let schedule = desk.site.schedule.iter().flat_map(|s| &s.visits);
        for (rover, way) in (0..).map(RoverId).zip(schedule) {
            let walk = Walk {
                rover,
                attempt: 0,
                since: 0,
            };
            for (i, timed) in way.iter().enumerate() {
                if desk.site.sensors.owner(timed.vertex) != desk.node {
                    continue;
                }
                let visit = Visit {
                    walk,
                    step: i as u32 + 1,
                    from: i.checked_sub(1).map(|before| way[before].vertex),
                    start: timed.start,
                    end: timed.end,
                    confirmed: true,
                    // Who stands on the map has its first vertex already.
                    granted: i == 0 && desk.site.stays,
                };
                self.book.enter(timed.vertex, visit);
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

    fn seek(&mut self, origin: Origin) {
        self.applicants.push(Applicant {
            origin,
            aim: Aim::Goal,
            walk: None,
            again: None,
            in_vain: 0,
        });
    }

    /// Begins a walk for each applicant that has none under way.
    pub(super) fn apply(&mut self, desk: &Desk<'_>) {
        for at in 0..self.applicants.len() {
            let applicant = &self.applicants[at];
            if applicant.walk.is_some() {
                continue;
            }
            let rover = match applicant.origin {
                Origin::Queue { entry, served, .. } => desk.site.queue(entry).get(served).copied(),
                Origin::Stand { rover, .. } => Some(rover),
                Origin::Done => None,
            };
            let first = |rover| Walk {
                rover,
                attempt: 1,
                since: desk.now,
            };
            match (applicant.again, rover) {
                (Some((walk, due)), _) if due <= desk.now => self.begin(desk, at, walk),
                (None, Some(rover)) => self.begin(desk, at, first(rover)),
                _ => {}
            }
        }
    }

    fn begin(&mut self, desk: &Desk<'_>, at: usize, walk: Walk) {
        let applicant = &mut self.applicants[at];
        applicant.walk = Some((walk, desk.now));
        applicant.again = None;
        let in_vain = applicant.in_vain;
        let mut goal = desk.site.missions[walk.rover.0 as usize].1;
        let soon = desk.now + self.walk_time;
        let (labels, entry, first_step) = match applicant.origin {
            Origin::Queue {
                entry, last_entry, ..
            } => {
                let dwell = desk.site.timing.cycle.as_nanos();
                let earliest = soon.max(last_entry + 1);
                let labels = self.search(desk, |ground| ground.enter(entry, earliest, dwell));
                (labels, entry, 1)
            }
            Origin::Stand { vertex, step, .. } => {
                if let Aim::Aside(path) = &applicant.aim {
                    goal = aside(&desk.site.roadmap, vertex, path, in_vain);
                }
                let cycle = desk.site.timing.cycle.as_nanos();
                let came = self
                    .book
                    .standing(vertex)
                    .map_or(0, |visit| visit.start + cycle);
                let label = Label {
                    vertex,
                    start: soon.max(came),
                    ready: soon.max(came),
                    until: FOREVER,
                    parent: None,
                };
                (vec![label], vertex, step)
            }
            Origin::Done => return,
        };
        let site = desk.site;
        // Every second time that there is no way it asks what the way would be without those who
        // stand still.
        let wishful = site.stays && in_vain % 2 == 1;
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
                first_step,
                wishful,
                frontier: (0..labels.len() as u32).collect(),
                labels: labels.clone(),
            };
            self.probe(desk, probe);
        }
    }

    fn search<T>(&self, desk: &Desk<'_>, with: impl FnOnce(&Ground<'_>) -> T) -> T {
        self.search_in(desk, &|v| self.book.busy(v), with)
    }

    fn search_in<T>(
        &self,
        desk: &Desk<'_>,
        busy: &dyn Fn(VertexId) -> Option<Vec<(u64, u64)>>,
        with: impl FnOnce(&Ground<'_>) -> T,
    ) -> T {
        let ground = Ground {
            roadmap: &desk.site.roadmap,
            gap: self.gap(),
            travel: &|u, v| desk.site.planned_step(u, v).as_nanos(),
            busy,
        };
        with(&ground)
    }

    pub(super) fn take(&mut self, desk: &Desk<'_>, item: Item) {
        match item {
            Item::Probe(probe) => self.probe(desk, probe),
            Item::Reserve(reserve) => self.reserve(desk, reserve),
            Item::Settle(settle) => self.settle(desk, settle),
            Item::Yield(request) => self.make_way(desk, request),
            // Taken before: see `receive`.
            Item::Roadmap(_) => {}
        }
    }

    pub(super) fn post(&mut self, to: NodeId, item: Item) {
        if let Some(line) = self.lines.get_mut(&to) {
            line.post(item);
        }
    }

    /// Works out where the rover could be in this node's part, and hands that on.
    fn probe(&mut self, desk: &Desk<'_>, mut probe: Probe) {
        let (mut labels, open) = (std::mem::take(&mut probe.labels), &probe.frontier);
        if probe.wishful {
            let busy = |v| self.book.busy_for_now(v);
            self.search_in(desk, &busy, |ground| ground.expand(&mut labels, open));
        } else {
            self.search(desk, |ground| ground.expand(&mut labels, open));
        }
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
                wishful: probe.wishful,
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
        // Who stays needs the goal for ever.
        let stays = desk.site.stays;
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
            Some((_, way)) if offers.wishful => {
                let route = owners(desk, &way);
                let request = Yield {
                    walk,
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
        // A rover that stands on the map has its first vertex already.
        let stands = lo == 0 && desk.site.stays;
        let first = lo + usize::from(stands);
        match self.book.check(&reserve.walk, &reserve.way[first..=hi]) {
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
        for i in first..=hi {
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
        if stands {
            let TimedVisit { vertex, end, .. } = reserve.way[0];
            self.book.leave_by(vertex, end);
        }
        self.served(desk, &reserve);
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
        let Some(at) = self.applicants.iter().position(current) else {
            return;
        };
        let attempt = walk.attempt + 1;
        let next = Walk { attempt, ..walk };
        if settle.verdict == Verdict::Failed {
            self.begin(desk, at, next);
            return;
        }
        // Nothing leads there as things stand: other rovers have to go first.
        let applicant = &mut self.applicants[at];
        applicant.walk = None;
        let pause = desk.site.timing.cycle.as_nanos() << applicant.in_vain.min(3);
        applicant.in_vain += 1;
        applicant.again = Some((next, desk.now + pause));
    }

    fn settle(&mut self, desk: &Desk<'_>, settle: Settle) {
        match settle.verdict {
            Verdict::Failed | Verdict::NoWay => return self.fail(desk, settle),
            Verdict::Confirmed => {
                self.book.confirm(&settle.walk);
                self.return_later(desk, &settle.walk);
            }
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
        let current = |a: &Applicant| a.walk.is_some_and(|(mine, _)| mine == reserve.walk);
        let Some(at) = self.applicants.iter().position(current) else {
            return;
        };
        let applicant = &mut self.applicants[at];
        let took = desk.now
            - applicant
                .walk
                .take()
                .map_or(desk.now, |(_, started)| started);
        applicant.in_vain = 0;
        applicant.origin = match applicant.origin {
            Origin::Queue { entry, served, .. } => Origin::Queue {
                entry,
                served: served + 1,
                last_entry: reserve.way[0].start,
            },
            Origin::Stand { .. } | Origin::Done => Origin::Done,
        };
        self.walk_time = match self.walk_time {
            0 => took,
            old => (3 * old + took) / 4,
        };
        self.apply(desk);
    }

    /// Asks those of this node's rovers that stand on a path to step aside, and passes that on.
    fn make_way(&mut self, desk: &Desk<'_>, request: Yield) {
        for &vertex in &request.path {
            let Some(visit) = self.book.standing(vertex) else {
                continue;
            };
            let (rover, step) = (visit.walk.rover, visit.step);
            if rover == request.walk.rover {
                continue;
            }
            let seeks = |a: &&mut Applicant| matches!(a.origin, Origin::Stand { rover: r, .. } if r == rover);
            // One that is itself on its way out of the way, or about to be, is left alone.
            if let Some(applicant) = self.applicants.iter_mut().find(seeks) {
                if applicant.walk.is_none() && matches!(applicant.aim, Aim::Goal) {
                    applicant.aim = Aim::Aside(request.path.clone());
                }
                continue;
            }
            self.seek(Origin::Stand {
                rover,
                vertex,
                step,
            });
            if let Some(applicant) = self.applicants.last_mut() {
                applicant.aim = Aim::Aside(request.path.clone());
            }
        }
        let (walk, route) = (request.walk, request.route.clone());
        match request.at.checked_sub(1) {
            Some(at) => {
                let to = route[at as usize];
                self.post(to, Item::Yield(Yield { at, ..request }));
            }
            None => self.fail(
                desk,
                Settle {
                    walk,
                    verdict: Verdict::NoWay,
                    route,
                    at: 0,
                },
            ),
        }
    }

    /// A rover that has stepped aside goes on to its goal, once the other one has had the time to
    /// pass.
    fn return_later(&mut self, desk: &Desk<'_>, walk: &Walk) {
        if !desk.site.stays {
            return;
        }
        let goal = desk.site.missions[walk.rover.0 as usize].1;
        for &vertex in desk.site.sensors.owned(desk.node) {
            let Some(visit) = self.book.standing(vertex) else {
                continue;
            };
            if visit.walk != *walk || vertex == goal {
                continue;
            }
            let (rover, step) = (walk.rover, visit.step);
            let due = visit.start + RETURN_AFTER * desk.site.timing.cycle.as_nanos();
            self.seek(Origin::Stand {
                rover,
                vertex,
                step,
            });
            let first = Walk {
                rover,
                attempt: walk.attempt + 1,
                since: due,
            };
            if let Some(applicant) = self.applicants.last_mut() {
                applicant.again = Some((first, due));
            }
            return;
        }
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

/// Where to step aside to from `from`: the nearest vertex off `path`, or after failures the next
/// nearest.
fn aside(roadmap: &Roadmap, from: VertexId, path: &[VertexId], failures: u32) -> VertexId {
    let off = |v: &VertexId| *v != from && !path.contains(v);
    let mut places: Vec<VertexId> = roadmap.vertices().filter(off).collect();
    places.sort_by_key(|&v| (roadmap.distance(from, v), v));
    let at = failures as usize % places.len().clamp(1, 64);
    places.get(at).copied().unwrap_or(from)
}

/// How many cycles after it has come there a rover that has stepped aside goes on.
const RETURN_AFTER: u64 = 20;

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
