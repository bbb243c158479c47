//! What is kept for the vertices of one region with the `complete` policy, all of it durable, and
//! who seeks a path from where. A node keeps a registry for itself, and one for each region that it
//! takes over. Pure: items go to `lines`, grants to the caller. What is done with items is in
//! [`requests`], what becomes of it when a node is replaced in [`failover`]; how rovers that stay
//! on a map get out of each other's way in [`joint`] and [`displacement`].

mod displacement;
mod failover;
mod joint;
mod requests;

use std::collections::{BTreeMap, BTreeSet};

use farside_worlds::{NodeId, VertexId};

use super::messages::{Clear, Item, Probe, ReservationRequest, Reserve};
use super::relay::Line;
use super::routes::{ClearRoute, clear_route, routes};
use super::table::{ReservationTable, Visit};
use crate::failover::rank::Replacement;
use crate::ids::RoverId;
use crate::mapf::safe_intervals::{FOREVER, Label, SearchSpace, TimedVisit};
use crate::shared::Shared;
use displacement::{Aside, Claims};
use failover::RegionFailover;
use joint::JointResolution;

/// A rover, or a queue of rovers, for which a path is sought.
#[derive(Debug)]
struct Applicant {
    origin: Origin,
    aim: Aim,
    /// The request under way, and when its attempt began.
    request: Option<(ReservationRequest, u64)>,
    /// The next attempt, and when it begins.
    again: Option<(ReservationRequest, u64)>,
    /// Attempts that found no path at all.
    in_vain: u32,
    /// Along which nodes it was last asked, and between which vertices.
    routes: Option<(Ends, Vec<Vec<NodeId>>)>,
    /// The same of the path past no other rover's start or goal, if there is one.
    clear: Option<(Ends, Option<ClearRoute>)>,
}

/// From where, and to where.
type Ends = (VertexId, VertexId);

/// What a request asks for, along its routes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Question {
    /// A path as things stand.
    Plain,
    /// What the path would be if nobody stood still for ever.
    Wish,
    /// A path as things stand, past no start and no goal of any other rover.
    Clear,
}

impl Applicant {
    fn is_on(&self, request: &ReservationRequest) -> bool {
        self.request.is_some_and(|(mine, _)| mine == *request)
    }
}

/// Where a path is to lead.
#[derive(Debug)]
enum Aim {
    /// To the rover's goal.
    Goal,
    /// Out of another's way.
    Aside(Aside),
}

/// Where a path begins.
#[derive(Clone, Copy, Debug)]
enum Origin {
    /// At an entry; the rovers of its queue follow each other.
    Queue {
        entry: VertexId,
        /// How many have a path.
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
    request: ReservationRequest,
    heard: u32,
    probes: u32,
    first_step: u32,
    wishful: bool,
    priority: (u64, RoverId),
    route: Vec<NodeId>,
    best: Option<(u64, Vec<TimedVisit>)>,
    decided: bool,
    /// When it decides on what it has.
    deadline: u64,
}

/// All that is kept for the vertices of one node.
#[derive(Debug, Default)]
pub(crate) struct Registry {
    is_open: bool,
    pub(crate) table: ReservationTable,
    pub(crate) lines: BTreeMap<NodeId, Line>,
    applicants: Vec<Applicant>,
    offers: BTreeMap<RoverId, Offers>,
    /// What is kept free for those who asked others to make room.
    claims: Claims,
    /// Ways that wait for younger requests to be settled.
    parked: Vec<Reserve>,
    /// How long a request takes from its first probe to its confirmation, smoothed [ns].
    request_time: u64,
    failover: RegionFailover,
    joint: JointResolution,
    /// Of neighbouring regions on to which more leads than a probe hands on: see `requests`.
    parts: BTreeMap<NodeId, BTreeMap<VertexId, VertexId>>,
}

/// For whose vertices something is done, and when.
pub(crate) struct Desk<'a> {
    pub(crate) site: &'a Shared,
    /// The node whose vertices are meant; another one may answer for them.
    pub(crate) region: NodeId,
    pub(crate) now: u64,
    /// The rank that answers for each region, with `network.failover_after`; else none.
    pub(crate) ranks: &'a [u32],
}

impl Desk<'_> {
    fn may_be_replaced(&self) -> bool {
        !self.ranks.is_empty()
    }

    /// The rank that answers for this region, unless it does itself.
    fn replacement(&self) -> Option<Replacement> {
        let (region, rank) = (self.region, *self.ranks.get(self.region.0 as usize)?);
        (rank > 0).then_some(Replacement { region, rank })
    }
}

impl Registry {
    /// Makes a new registry ready; in one that has survived a crash, all that was on its way is
    /// repeated.
    pub(crate) fn open(&mut self, desk: &Desk<'_>) {
        if self.is_open {
            for line in self.lines.values_mut() {
                line.restart();
            }
            return;
        }
        self.open_empty(desk);
        let own = |v: &VertexId| desk.site.sensors.owner(*v) == desk.region;
        let queues = desk.site.queues.iter().map(|(entry, _)| *entry);
        for entry in queues.filter(own) {
            self.seek(Origin::Queue {
                entry,
                served: 0,
                last_entry: 0,
            });
        }
        self.preload(desk);
        if desk.site.schedule.is_some() {
            return;
        }
        let standing = desk.site.standing().filter(|(_, vertex)| own(vertex));
        for (rover, vertex) in standing {
            self.table.stand(vertex, rover, 1);
            if desk.site.missions[rover.0 as usize].1 != vertex {
                self.seek(Origin::Stand {
                    rover,
                    vertex,
                    step: 1,
                });
            }
        }
    }

    fn open_empty(&mut self, desk: &Desk<'_>) {
        let sensors = &desk.site.sensors;
        self.is_open = true;
        self.table.open(sensors.owned(desk.region));
        for &neighbor in sensors.neighbors(desk.region) {
            self.lines.insert(neighbor, Line::default());
        }
    }

    /// Enters what was planned before the start.
    fn preload(&mut self, desk: &Desk<'_>) {
        let schedule = desk.site.schedule.iter().flat_map(|s| &s.visits);
        for &(rover, ref path) in schedule {
            let request = ReservationRequest {
                rover,
                attempt: 0,
                since: 0,
            };
            for (i, timed) in path.iter().enumerate() {
                if desk.site.sensors.owner(timed.vertex) != desk.region {
                    continue;
                }
                let visit = Visit {
                    request,
                    step: i as u32 + 1,
                    from: i.checked_sub(1).map(|before| path[before].vertex),
                    start: timed.start,
                    end: timed.end,
                    confirmed: true,
                    // Who stands on the map has its first vertex already.
                    granted: i == 0 && desk.site.stay_at_target,
                };
                self.table.enter(timed.vertex, visit);
            }
        }
    }

    /// The time that it takes to learn that a vertex is free and to grant it [ns].
    fn headway(&self) -> u64 {
        let measured = self.lines.values().filter(|line| line.is_measured());
        let (sum, count) = measured.fold((0, 0), |(sum, n), line| (sum + line.round_trip(), n + 1));
        let mean: Option<u64> = sum.checked_div(count);
        mean.map_or(FIRST_HEADWAY, |headway| headway.max(1))
    }

    fn seek(&mut self, origin: Origin) {
        self.applicants.push(Applicant {
            origin,
            aim: Aim::Goal,
            request: None,
            again: None,
            in_vain: 0,
            routes: None,
            clear: None,
        });
    }

    /// Begins a request for each applicant that has none under way.
    pub(crate) fn apply(&mut self, desk: &Desk<'_>) {
        for at in 0..self.applicants.len() {
            let applicant = &self.applicants[at];
            if applicant.request.is_some() {
                continue;
            }
            let rover = match applicant.origin {
                Origin::Queue { entry, served, .. } => desk.site.queue(entry).get(served).copied(),
                Origin::Stand { rover, .. } => Some(rover),
                Origin::Done => None,
            };
            let first = |rover| ReservationRequest {
                rover,
                attempt: 1,
                since: desk.now,
            };
            match (applicant.again, rover) {
                (Some((request, due)), _) if due <= desk.now => self.begin(desk, at, request),
                (None, Some(rover)) => self.begin(desk, at, first(rover)),
                _ => {}
            }
        }
    }

    fn begin(&mut self, desk: &Desk<'_>, at: usize, request: ReservationRequest) {
        let applicant = &mut self.applicants[at];
        if self.joint.holds() {
            (applicant.request, applicant.again) = (None, Some((request, desk.now)));
            return;
        }
        applicant.request = Some((request, desk.now));
        applicant.again = None;
        let mut goal = desk.site.missions[request.rover.0 as usize].1;
        let soon = desk.now + self.request_time;
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
                let step_time = desk.site.longest_step.as_nanos();
                let came = self
                    .table
                    .standing(vertex)
                    .map_or(0, |visit| visit.start + step_time);
                let label = Label {
                    vertex,
                    start: soon.max(came),
                    ready: soon.max(came),
                    until: FOREVER,
                    parent: None,
                };
                if let Some(elsewhere) = self.step_aside(desk, at, request, label) {
                    match elsewhere {
                        Some(place) => goal = place,
                        None => return,
                    }
                }
                (vec![label], vertex, step)
            }
            Origin::Done => return,
        };
        let question = self.question(desk, at, (entry, goal));
        let routes = self.routes_of(desk, at, question, (entry, goal));
        let priority = match &self.applicants[at].aim {
            Aim::Aside(aside) => aside.priority,
            Aim::Goal => request.age(),
        };
        let probes = routes.len() as u32;
        for (route, exits) in routes {
            let probe = Probe {
                request,
                probes,
                started: desk.now,
                route,
                at: 0,
                goal,
                first_step,
                wishful: question == Question::Wish,
                frontier: (0..labels.len() as u32).collect(),
                labels: labels.clone(),
            };
            self.probe(desk, probe, priority, exits);
        }
    }

    /// What an attempt asks for. Where rovers stay, every second time that there was no path as
    /// things stand it asks for another one: for one that is clear of all others' starts and goals,
    /// which in a well-formed instance all have; else for one on which others make room. If the
    /// instance is not well-formed, a joint resolution comes first, where there can be one.
    fn question(&mut self, desk: &Desk<'_>, at: usize, ends: Ends) -> Question {
        let in_vain = self.applicants[at].in_vain;
        let is_plain = !desk.site.stay_at_target || in_vain.is_multiple_of(2);
        if is_plain || self.joint.is_due(desk) {
            return Question::Plain;
        }
        let turn = desk.site.is_well_formed || in_vain % 4 == 1;
        match turn && self.clear_route(desk, at, ends).is_some() {
            true => Question::Clear,
            false => Question::Wish,
        }
    }

    /// The path of an applicant past no start and no goal of any other rover.
    fn clear_route(&mut self, desk: &Desk<'_>, at: usize, ends: Ends) -> Option<&ClearRoute> {
        let applicant = &mut self.applicants[at];
        if applicant.clear.as_ref().is_none_or(|(of, _)| *of != ends) {
            let Origin::Stand { rover, .. } = applicant.origin else {
                return None;
            };
            let site = desk.site;
            let others: BTreeSet<VertexId> = site
                .team()
                .filter(|(other, _)| *other != rover)
                .flat_map(|(_, (start, goal))| [start, goal])
                .collect();
            let avoided = |v| others.contains(&v);
            let route = clear_route(&site.roadmap, &site.sensors, ends, avoided);
            applicant.clear = Some((ends, route));
        }
        applicant.clear.as_ref()?.1.as_ref()
    }

    /// The routes of an attempt; of one that follows a path, where it leaves each node. They depend
    /// on the roadmap alone, and are kept until they are asked for between other vertices.
    fn routes_of(
        &mut self,
        desk: &Desk<'_>,
        at: usize,
        question: Question,
        ends: Ends,
    ) -> Vec<(Vec<NodeId>, Vec<VertexId>)> {
        if question == Question::Clear {
            let clear = self.clear_route(desk, at, ends).cloned();
            return clear.into_iter().map(|c| (c.nodes, c.exits)).collect();
        }
        let site = desk.site;
        let known = &mut self.applicants[at].routes;
        if known.as_ref().is_none_or(|(of, _)| *of != ends) {
            let count = site.config.complete.routes;
            *known = Some((ends, routes(&site.roadmap, &site.sensors, ends, count)));
        }
        let routes = known.iter().flat_map(|(_, routes)| routes);
        routes.map(|route| (route.clone(), Vec::new())).collect()
    }

    fn search<T>(&self, desk: &Desk<'_>, with: impl FnOnce(&SearchSpace<'_>) -> T) -> T {
        self.search_in(desk, &|v| self.table.busy(v), with)
    }

    fn search_in<T>(
        &self,
        desk: &Desk<'_>,
        busy: &dyn Fn(VertexId) -> Option<Vec<(u64, u64)>>,
        with: impl FnOnce(&SearchSpace<'_>) -> T,
    ) -> T {
        let ground = SearchSpace {
            roadmap: &desk.site.roadmap,
            headway: self.headway(),
            travel: &|u, v| desk.site.planned_step(u, v).as_nanos(),
            busy,
            covers: &|v| desk.site.sensors.covers(v),
        };
        with(&ground)
    }

    pub(crate) fn take(&mut self, desk: &Desk<'_>, item: Item) {
        match item {
            Item::Probe(probe) => {
                let priority = probe.request.age();
                self.probe(desk, probe, priority, Vec::new());
            }
            Item::Wish(wish) => self.probe(desk, wish.probe, wish.priority, Vec::new()),
            Item::Clear(Clear { probe, exits }) => {
                let priority = probe.request.age();
                self.probe(desk, probe, priority, exits);
            }
            Item::Reserve(reserve) => self.reserve(desk, reserve),
            Item::Settle(settle) => self.settle(desk, settle),
            Item::Displace(request) => self.displace(desk, request),
            Item::Joint(item) => self.take_joint(desk, item),
            // Taken before: see `Atlas::receive`.
            Item::Roadmap(_) => {}
        }
    }

    pub(crate) fn post(&mut self, to: NodeId, item: Item) {
        if let Some(line) = self.lines.get_mut(&to) {
            line.post(item);
        }
    }

    /// The rover of this request has its path: the next one of the queue is served.
    fn served(&mut self, desk: &Desk<'_>, reserve: &Reserve) {
        let current = |a: &Applicant| a.is_on(&reserve.request);
        let Some(at) = self.applicants.iter().position(current) else {
            return;
        };
        let applicant = &mut self.applicants[at];
        let took = desk.now
            - applicant
                .request
                .take()
                .map_or(desk.now, |(_, started)| started);
        applicant.in_vain = 0;
        applicant.origin = match applicant.origin {
            Origin::Queue { entry, served, .. } => Origin::Queue {
                entry,
                served: served + 1,
                last_entry: reserve.path[0].start,
            },
            Origin::Stand { .. } | Origin::Done => Origin::Done,
        };
        self.request_time = match self.request_time {
            0 => took,
            old => (3 * old + took) / 4,
        };
        self.apply(desk);
    }

    /// Whether vertices may be granted now.
    pub(crate) fn may_grant(&self) -> bool {
        !self.joint.stops_grants()
    }

    /// When something is to be done without being told; of lines, only those that may be used.
    pub(crate) fn next_due(&self, may_use: impl Fn(NodeId) -> bool) -> Option<u64> {
        let lines = self.lines.iter().filter(|(to, _)| may_use(**to));
        let lines = lines.filter_map(|(_, line)| line.next_due());
        let proposals = self.failover.next_due();
        let open = self
            .offers
            .values()
            .filter(|o| !o.decided && o.best.is_some());
        let lines = lines.chain(open.map(|o| o.deadline)).chain(proposals);
        lines.chain(self.joint.next_due()).min()
    }
}

/// The gap before anything was measured [ns].
const FIRST_HEADWAY: u64 = 10_000_000;

/// The owners of the vertices of a path, in order, without repeats in a row.
fn owners(desk: &Desk<'_>, path: &[TimedVisit]) -> Vec<NodeId> {
    let mut owners: Vec<NodeId> = path
        .iter()
        .map(|visit| desk.site.sensors.owner(visit.vertex))
        .collect();
    owners.dedup();
    owners
}

/// The place in a path's [`owners`] of who owns this visit.
fn place_of(desk: &Desk<'_>, path: &[TimedVisit], visit: usize) -> u32 {
    owners(desk, &path[..=visit]).len() as u32 - 1
}
