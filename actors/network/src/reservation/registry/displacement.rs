//! Local resolution on maps where rovers stay: who stands in another's way steps aside for a while.
//!
//! A rover that finds no path asks what its path would be if nobody stood still, and then those who
//! stand on it to make room. Who began earlier goes first: a rover that is on its way to its goal
//! itself makes room for older requests only, one that stands at its goal for all. It takes the
//! nearest place where it may stay; where all are taken, it asks in turn, in the name of whom it
//! makes room for. What was asked for is **claimed** for a while: nobody younger comes to stay
//! there. So the oldest request's way gets free, and stays free until it is reserved.
//!
//! This is the order of priority inheritance with backtracking (Okumura et al., *Priority
//! inheritance with backtracking for iterative multi-agent path finding*, AIJ 310, 2022), over
//! reserved paths. It guarantees nothing: a rover in a dead end behind another one's goal may still
//! be stuck. So it is what is left where a joint resolution ([`joint`](super::joint)) is not
//! possible or has found no plan; and never on a well-formed instance, where nobody has to make
//! room.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use farside_worlds::{Roadmap, VertexId};

use super::{Aim, Applicant, Desk, Origin, Registry};
use crate::ids::RoverId;
use crate::mapf::safe_intervals::{FOREVER, Label, way_to};
use crate::reservation::messages::{Displace, Item, ReservationRequest, Reserve, Settle, Verdict};

/// Out of whose way.
#[derive(Clone, Debug)]
pub(crate) struct Aside {
    /// What is to be left free.
    path: BTreeSet<VertexId>,
    /// The age of the request for which way is made.
    pub(crate) priority: (u64, RoverId),
    /// Then it is no longer asked for [ns].
    until: u64,
}

/// The vertices that were asked for: by whom, since when, and until when.
#[derive(Debug, Default)]
pub(crate) struct Claims(BTreeMap<VertexId, ((u64, RoverId), u64)>);

impl Claims {
    /// Whether somebody who goes before `who` wants the vertex.
    pub(crate) fn is_claimed(&self, v: VertexId, who: (u64, RoverId), now: u64) -> bool {
        let claim = self.0.get(&v).filter(|(_, until)| *until > now);
        claim.is_some_and(|(by, _)| *by < who)
    }

    /// Claims a vertex, unless somebody who goes before has.
    fn claim(&mut self, v: VertexId, who: (u64, RoverId), now: u64, until: u64) {
        if !self.is_claimed(v, who, now) {
            self.0.insert(v, (who, until));
        }
    }

    /// The rover has its path.
    pub(crate) fn give_up(&mut self, rover: RoverId) {
        self.0.retain(|_, ((_, by), _)| *by != rover);
    }
}

impl Registry {
    /// When and for whom the vertex is taken, as far as who asks would have to put up with it:
    /// those who stand there for ever make room, unless they go before.
    pub(crate) fn busy_for_priority(
        &self,
        v: VertexId,
        asked: (u64, RoverId),
    ) -> Option<Vec<(u64, u64)>> {
        let mut busy = self.table.busy(v)?;
        let firm = |rover| {
            let on_its_way = self.applicants.iter().find(|a| a.is_of(rover));
            on_its_way.is_some_and(|a| a.goes_before(asked))
        };
        if let Some(visit) = self.table.standing(v)
            && !firm(visit.request.rover)
        {
            busy.pop();
        }
        Some(busy)
    }

    /// Asks those of this node's rovers that stand on a path to step aside, and passes that on.
    pub(crate) fn displace(&mut self, desk: &Desk<'_>, ask: Displace) {
        let asked = ask.priority;
        let until = desk.now + CLAIMED_FOR * desk.site.timing.cycle.as_nanos();
        let aside = Aside {
            path: ask.path.iter().copied().collect(),
            priority: ask.priority,
            until,
        };
        for &vertex in &ask.path {
            if desk.site.sensors.owner(vertex) != desk.region {
                continue;
            }
            self.claims.claim(vertex, asked, desk.now, until);
            let Some(visit) = self.table.standing(vertex) else {
                continue;
            };
            let (rover, step) = (visit.request.rover, visit.step);
            if rover == ask.request.rover {
                continue;
            }
            match self.applicants.iter_mut().find(|a| a.is_of(rover)) {
                Some(applicant) => {
                    if applicant.request.is_none() && !applicant.goes_before(asked) {
                        applicant.aim = Aim::Aside(aside.clone());
                    }
                }
                None => {
                    self.seek(Origin::Stand {
                        rover,
                        vertex,
                        step,
                    });
                    if let Some(applicant) = self.applicants.last_mut() {
                        applicant.aim = Aim::Aside(aside.clone());
                    }
                }
            }
        }
        let (request, route) = (ask.request, ask.route.clone());
        match ask.at.checked_sub(1) {
            Some(at) => {
                let to = route[at as usize];
                self.post(to, Item::Displace(Displace { at, ..ask }));
            }
            None => self.fail(
                desk,
                Settle {
                    request,
                    verdict: Verdict::NoPath,
                    route,
                    at: 0,
                },
            ),
        }
    }

    /// Begins an attempt of a rover that may have been asked to step aside, from where it stands.
    /// None if it goes to its goal; where else it is to try to go; nothing more if it has found a
    /// place or need not go.
    pub(crate) fn step_aside(
        &mut self,
        desk: &Desk<'_>,
        at: usize,
        request: ReservationRequest,
        label: Label,
    ) -> Option<Option<VertexId>> {
        let applicant = &mut self.applicants[at];
        let Aim::Aside(aside) = &applicant.aim else {
            return None;
        };
        let Origin::Stand { vertex, step, .. } = applicant.origin else {
            return None;
        };
        if aside.until < desk.now {
            applicant.aim = Aim::Goal;
            if desk.site.missions[request.rover.0 as usize].1 != vertex {
                return None;
            }
            (applicant.origin, applicant.request) = (Origin::Done, None);
            return Some(None);
        }
        let (aside, in_vain) = (aside.clone(), applicant.in_vain);
        let mut labels = vec![label];
        self.search(desk, |ground| ground.expand(&mut labels, &[0]));
        let may_stay = |label: &Label| {
            let place = label.vertex;
            label.until == FOREVER
                && place != vertex
                && desk.site.sensors.covers(place)
                && !aside.path.contains(&place)
                && !self.claims.is_claimed(place, aside.priority, desk.now)
        };
        let places = (0..).zip(&labels).filter(|(_, label)| may_stay(label));
        if let Some((last, _)) = places.min_by_key(|(at, label)| (label.ready, *at)) {
            let path = way_to(&labels, last, FOREVER, |v| desk.site.sensors.covers(v));
            let reserve = Reserve {
                request,
                first_step: step,
                at: path.len() as u32 - 1,
                path,
                replaced: Vec::new(),
            };
            self.reserve(desk, reserve);
            return Some(None);
        }
        // Of its own vertices the node knows that they are taken: others may be free, or are asked
        // for in every second attempt.
        let own = |v: VertexId| desk.site.sensors.owner(v) == desk.region;
        let wishful = in_vain % 2 == 1;
        let is_place = |v| desk.site.sensors.covers(v) && (wishful || !own(v));
        let off = |v: VertexId| is_place(v) && !aside.path.contains(&v);
        let place = near(&desk.site.roadmap, vertex, off, in_vain / 2);
        Some(Some(place))
    }

    /// A rover that has stepped aside goes on to its goal, once the other one has had the time to
    /// pass.
    pub(crate) fn return_later(&mut self, desk: &Desk<'_>, request: &ReservationRequest) {
        if !desk.site.stay_at_target {
            return;
        }
        let goal = desk.site.missions[request.rover.0 as usize].1;
        for &vertex in desk.site.sensors.owned(desk.region) {
            let Some(visit) = self.table.standing(vertex) else {
                continue;
            };
            if visit.request != *request || vertex == goal {
                continue;
            }
            let (rover, step) = (request.rover, visit.step);
            let due = visit.start + RETURN_AFTER * desk.site.timing.cycle.as_nanos();
            self.seek(Origin::Stand {
                rover,
                vertex,
                step,
            });
            let first = ReservationRequest {
                rover,
                attempt: request.attempt + 1,
                since: request.since,
            };
            if let Some(applicant) = self.applicants.last_mut() {
                applicant.again = Some((first, due));
            }
            return;
        }
    }
}

impl Applicant {
    fn is_of(&self, rover: RoverId) -> bool {
        matches!(self.origin, Origin::Stand { rover: mine, .. } if mine == rover)
    }

    /// Whether it need not make room for who asks: it is on its way to its goal, and began before;
    /// or makes room already, for one that did.
    fn goes_before(&self, asked: (u64, RoverId)) -> bool {
        let request = self.request.or(self.again).map(|(request, _)| request);
        match &self.aim {
            Aim::Goal => request.is_some_and(|request| request.age() < asked),
            Aim::Aside(aside) => aside.priority < asked,
        }
    }
}

/// The nearest vertex to `from` that is `off`, or after failures the next nearest; of equally near
/// ones the lowest first. `from` itself if there is none.
fn near(
    roadmap: &Roadmap,
    from: VertexId,
    off: impl Fn(VertexId) -> bool,
    failures: u32,
) -> VertexId {
    let mut places = Vec::new();
    let mut seen = BTreeSet::from([from]);
    let mut level = VecDeque::from([from]);
    while places.len() < MOST_PLACES && !level.is_empty() {
        let beside = level.iter().flat_map(|&v| roadmap.neighbors(v)).copied();
        let mut next: Vec<VertexId> = beside.filter(|v| seen.insert(*v)).collect();
        next.sort_unstable();
        places.extend(next.iter().copied().filter(|&v| off(v)));
        level = next.into();
    }
    places.truncate(MOST_PLACES);
    let at = failures as usize % places.len().max(1);
    places.get(at).copied().unwrap_or(from)
}

/// How many places are tried, one after the other.
const MOST_PLACES: usize = 64;

/// How many cycles after it has come there a rover that has stepped aside goes on.
const RETURN_AFTER: u64 = 10;

/// How many cycles what was asked for is kept free, unless it is asked for again.
const CLAIMED_FOR: u64 = 20;
