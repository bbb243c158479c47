//! What becomes of requests and of tables when a node is replaced (`network.failover_after`). That
//! backups admit to vertices safely is the affair of [`failover`](crate::failover); here it is that
//! no reserved path is lost, and none is left that nobody settles.
//!
//! **A path counts once its rover has taken it.** Where nodes may be replaced, the first node of a
//! way does not confirm it by itself: it proposes it to the rover ([`Itinerary`]), which keeps it
//! durably, unless a fencing token of its own is higher than the rank that one of the path's
//! vertices was reserved at. A backup opens a region only when all rovers have answered at its
//! rank, and they answer with the paths that they have taken. So the table that it makes of their
//! accounts has just those paths through the region that count, or ever will, of all that lower
//! ranks entered, in the order of the old table.
//!
//! **All else is asked for again.** Whoever has entered a part and passed it on to the region keeps
//! it until it is settled, and passes it on once more when the region is replaced. It comes to the
//! first node again, which says what became of the request: taken, or not. The first nodes of
//! requests that are under way begin them anew, because what they wait for may have been lost with
//! the region. Whoever hears of a later attempt passes on that the earlier one has failed: nobody
//! else may be left to do so. A path that passes a region twice fails if the region was replaced
//! between the two.

use farside_worlds::NodeId;

use super::{Desk, Origin, Registry, owners, place_of};
use crate::failover::messages::Account;
use crate::reservation::messages::{
    Item, Itinerary, ItineraryAnswer, ReservationRequest, Reserve, Settle, Verdict,
};
use crate::reservation::table::Visit;

/// What a registry keeps in case nodes are replaced.
#[derive(Debug, Default)]
pub(crate) struct RegionFailover {
    /// Ways that rovers are asked to take, and when they are asked again [ns].
    proposals: Vec<(Reserve, u64)>,
    /// Parts entered here and passed on, of requests that are not settled.
    open: Vec<Reserve>,
    /// Requests whose ways were taken.
    taken: Vec<ReservationRequest>,
    /// When the region was taken over [ns]; 0 if it was not.
    since: u64,
}

impl RegionFailover {
    pub(crate) fn next_due(&self) -> Option<u64> {
        self.proposals.iter().map(|(_, due)| *due).min()
    }

    /// A part of a path is passed on.
    pub(crate) fn pass(&mut self, reserve: &Reserve) {
        let known = |r: &Reserve| r.request == reserve.request && r.at == reserve.at;
        if !self.open.iter().any(known) {
            self.open.push(reserve.clone());
        }
    }

    /// What became of a request has come to place `at` of its route: up to there nothing is open any
    /// more. What is beyond waits until it has come there too, also in the same region.
    fn close(&mut self, desk: &Desk<'_>, request: &ReservationRequest, at: u32) {
        let place = |open: &Reserve| place_of(desk, &open.path, open.at as usize + 1);
        self.open
            .retain(|open| open.request != *request || place(open) > at);
    }

    pub(crate) fn is_proposed(&self, request: &ReservationRequest) -> bool {
        self.proposals.iter().any(|(r, _)| r.request == *request)
    }

    /// Whether who answered for the region before may have chosen a path for an attempt that began
    /// then. A second one must not be: it would pass for the first. The attempt is begun anew, if
    /// it has to be.
    pub(crate) fn is_stale(&self, attempt_began: u64) -> bool {
        attempt_began < self.since
    }

    fn take(&mut self, request: ReservationRequest) {
        if !self.taken.contains(&request) {
            self.taken.push(request);
        }
    }
}

impl Registry {
    /// What became of a request has come to place `at` of its route.
    pub(crate) fn note_settled(
        &mut self,
        desk: &Desk<'_>,
        request: &ReservationRequest,
        verdict: Verdict,
        at: u32,
    ) {
        self.failover.close(desk, request, at);
        if verdict == Verdict::Confirmed {
            self.failover.take(*request);
        }
    }

    /// Whether a path that is to be reserved was taken already: then that is said again, to whom it
    /// was lost on.
    pub(crate) fn is_taken(&mut self, desk: &Desk<'_>, reserve: &Reserve) -> bool {
        if !self.failover.taken.contains(&reserve.request) {
            return false;
        }
        self.table.confirm(&reserve.request);
        let confirmed = Settle {
            request: reserve.request,
            verdict: Verdict::Confirmed,
            route: owners(desk, &reserve.path),
            at: place_of(desk, &reserve.path, reserve.at as usize),
        };
        self.forward(confirmed);
        true
    }

    /// Whether a path that passes this region more than once has lost a later part, which was entered before
    /// the region was replaced: the rover would be told that all of it was reserved at the new rank.
    pub(crate) fn has_lost_part(&self, desk: &Desk<'_>, reserve: &Reserve) -> bool {
        let later = reserve.path.iter().skip(reserve.at as usize + 1);
        let mut mine = later.filter(|visit| desk.site.sensors.owner(visit.vertex) == desk.region);
        mine.any(|visit| {
            !self
                .table
                .has(&reserve.request, std::slice::from_ref(visit))
        })
    }

    /// Earlier attempts than this one have failed. Whoever was to say so may have been replaced before,
    /// and then nobody else tells those from whom the paths came, which this attempt need not pass.
    pub(crate) fn release_earlier(&mut self, desk: &Desk<'_>, request: &ReservationRequest) {
        let open = std::mem::take(&mut self.failover.open).into_iter();
        let (earlier, others) = open.partition(|open| open.request.is_before(request));
        self.failover.open = others;
        let earlier: Vec<Reserve> = earlier;
        for reserve in earlier {
            self.release(desk, &reserve, reserve.at as usize + 1);
        }
    }

    /// All of a path is entered, tentatively: its rover is asked to take it.
    pub(crate) fn propose(&mut self, reserve: Reserve) {
        self.failover.proposals.push((reserve, 0));
    }

    /// What rovers are to be asked now, by `node`, which answers for this region.
    pub(crate) fn proposals_due(&mut self, desk: &Desk<'_>, node: NodeId) -> Vec<Itinerary> {
        let again = desk.now + desk.site.timing.cycle.as_nanos();
        let all = self.failover.proposals.iter_mut();
        let due = all.filter(|(_, due)| *due <= desk.now);
        due.map(|(reserve, due)| {
            *due = again;
            Itinerary {
                node,
                path: reserve.clone().into_path(),
                replaced: reserve.replaced.clone(),
            }
        })
        .collect()
    }

    /// A rover has taken its path, or will not.
    pub(crate) fn answered(&mut self, desk: &Desk<'_>, answer: ItineraryAnswer) {
        let proposals = &mut self.failover.proposals;
        let Some(at) = proposals
            .iter()
            .position(|(r, _)| r.request == answer.request)
        else {
            return;
        };
        let (reserve, _) = proposals.remove(at);
        if answer.taken {
            self.confirm(desk, &reserve);
            return;
        }
        self.release(desk, &reserve, 0);
        // Somebody is being replaced. The next attempt is not for now.
        let request = reserve.request;
        if let Some(applicant) = self.applicants.iter_mut().find(|a| a.is_on(&request)) {
            let attempt = request.attempt + 1;
            applicant.request = None;
            let pause = desk.site.timing.cycle.as_nanos();
            applicant.again = Some((ReservationRequest { attempt, ..request }, desk.now + pause));
        }
    }

    /// Another one answers for `region` than before.
    pub(crate) fn renew(&mut self, desk: &Desk<'_>, region: NodeId) {
        if let Some(line) = self.lines.get_mut(&region) {
            line.renew();
        }
        let to_region =
            |r: &&Reserve| desk.site.sensors.owner(r.path[r.at as usize].vertex) == region;
        let lost: Vec<Reserve> = self
            .failover
            .open
            .iter()
            .filter(to_region)
            .cloned()
            .collect();
        for reserve in lost {
            self.post(region, Item::Reserve(reserve));
        }
        for at in 0..self.applicants.len() {
            let Some((request, _)) = self.applicants[at].request else {
                continue;
            };
            if !self.failover.is_proposed(&request) {
                let attempt = request.attempt + 1;
                self.begin(desk, at, ReservationRequest { attempt, ..request });
            }
        }
    }

    /// The registry of a region that is taken over, from what rovers say.
    pub(crate) fn succeed(desk: &Desk<'_>, accounts: &[Account]) -> Registry {
        let mut registry = Registry::default();
        registry.open_empty(desk);
        registry.failover.since = desk.now;
        for account in accounts {
            registry.enter_account(desk, account);
        }
        let site = desk.site;
        for (entry, queue) in &site.queues {
            if site.sensors.owner(*entry) != desk.region {
                continue;
            }
            let has_way = |a: &&Account| !a.paths.is_empty() || a.whereabouts.step > 0;
            let of = |rover| move |a: &&Account| a.whereabouts.rover == rover;
            let found = |&rover| accounts.iter().find(of(rover)).filter(has_way);
            let served: Vec<&Account> = queue.iter().map_while(found).collect();
            let entries = served.iter().filter_map(|a| a.paths.first());
            let last_entry = entries.map(|path| path.visits[0].start).max();
            registry.seek(Origin::Queue {
                entry: *entry,
                served: served.len(),
                last_entry: last_entry.unwrap_or(0),
            });
        }
        registry
    }

    /// Enters what is left of a rover's ways, and where it stands.
    fn enter_account(&mut self, desk: &Desk<'_>, account: &Account) {
        let (site, fact) = (desk.site, &account.whereabouts);
        let own = |v| site.sensors.owner(v) == desk.region;
        let (mut from, mut last) = (None, None);
        for path in &account.paths {
            self.failover.take(path.request);
            for (step, timed) in (path.first_step..).zip(&path.visits) {
                let comes = fact.moving_to.is_some();
                let is_over = step < fact.step || step == fact.step && comes;
                if own(timed.vertex) && !is_over {
                    let visit = Visit {
                        request: path.request,
                        step,
                        from,
                        start: timed.start,
                        end: timed.end,
                        confirmed: true,
                        granted: step <= fact.step + u32::from(comes),
                    };
                    self.table.enter(timed.vertex, visit);
                }
                (from, last) = (Some(timed.vertex), Some((timed.vertex, step)));
            }
        }
        if !site.stay_at_target {
            return;
        }
        let stands = fact.vertex.map(|vertex| (vertex, fact.step));
        let Some((vertex, step)) = last.or(stands).filter(|&(vertex, _)| own(vertex)) else {
            return;
        };
        if last.is_none() {
            self.table.stand(vertex, fact.rover, step);
        }
        if site.missions[fact.rover.0 as usize].1 != vertex {
            let rover = fact.rover;
            self.seek(Origin::Stand {
                rover,
                vertex,
                step,
            });
        }
    }
}
