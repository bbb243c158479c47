//! What becomes of walks and of books when a node is replaced (`network.takeover_after`). That deputies
//! admit to vertices safely is the affair of [`takeover`](crate::failover); here it is that no
//! reserved way is lost, and none is left that nobody settles.
//!
//! **A way counts once its rover has taken it.** Where nodes may be replaced, the first node of a way does
//! not confirm it by itself: it proposes it to the rover ([`Itinerary`]), which keeps it durably,
//! unless a fence of its own is higher than the rank that one of the way's vertices was reserved at.
//! A deputy opens a home only when all rovers have answered at its rank, and they answer with the ways
//! that they have taken. So the book that it makes of their accounts has just those ways through the
//! home that count, or ever will, of all that lower ranks entered, in the order of the old book.
//!
//! **All else is asked for again.** Whoever has entered a part and passed it on to the home keeps it until
//! it is settled, and passes it on once more when the home is replaced. It comes to the first node again,
//! which says what became of the walk: taken, or not. The first nodes of walks that are under way begin
//! them anew, because what they wait for may have been lost with the home.

use farside_worlds::NodeId;

use super::{Desk, Origin, Registry, owners};
use crate::failover::messages::Account;
use crate::reservation::book::Visit;
use crate::reservation::messages::{
    Item, Itinerary, ItineraryAnswer, Reserve, Settle, Verdict, Walk,
};

/// What a registry keeps in case nodes are replaced.
#[derive(Debug, Default)]
pub(crate) struct Succession {
    /// Ways that rovers are asked to take, and when they are asked again [ns].
    proposals: Vec<(Reserve, u64)>,
    /// Parts entered here and passed on, of walks that are not settled.
    open: Vec<Reserve>,
    /// Walks whose ways were taken.
    taken: Vec<Walk>,
    /// When the home was taken over [ns]; 0 if it was not.
    since: u64,
}

impl Succession {
    pub(crate) fn next_due(&self) -> Option<u64> {
        self.proposals.iter().map(|(_, due)| *due).min()
    }

    /// A part of a way is passed on.
    pub(crate) fn pass(&mut self, reserve: &Reserve) {
        let known = |r: &Reserve| r.walk == reserve.walk && r.at == reserve.at;
        if !self.open.iter().any(known) {
            self.open.push(reserve.clone());
        }
    }

    /// What is open of these walks is so no more.
    pub(crate) fn close(&mut self, walks: impl Fn(&Walk) -> bool) {
        self.open.retain(|reserve| !walks(&reserve.walk));
    }

    pub(crate) fn is_proposed(&self, walk: &Walk) -> bool {
        self.proposals.iter().any(|(r, _)| r.walk == *walk)
    }

    /// Whether who answered for the home before may have chosen a way for an attempt that began then. A
    /// second one must not be: it would pass for the first. The attempt is begun anew, if it has to be.
    pub(crate) fn is_stale(&self, attempt_began: u64) -> bool {
        attempt_began < self.since
    }

    pub(crate) fn take(&mut self, walk: Walk) {
        if !self.taken.contains(&walk) {
            self.taken.push(walk);
        }
    }
}

impl Registry {
    /// Whether a way that is to be reserved was taken already: then that is said again, to whom it was
    /// lost on.
    pub(crate) fn is_taken(&mut self, desk: &Desk<'_>, reserve: &Reserve) -> bool {
        if !self.succession.taken.contains(&reserve.walk) {
            return false;
        }
        self.book.confirm(&reserve.walk);
        let confirmed = Settle {
            walk: reserve.walk,
            verdict: Verdict::Confirmed,
            route: owners(desk, &reserve.way),
            at: owners(desk, &reserve.way[..=reserve.at as usize]).len() as u32 - 1,
        };
        self.forward(confirmed);
        true
    }

    /// All of a way is entered, tentatively: its rover is asked to take it.
    pub(crate) fn propose(&mut self, reserve: Reserve) {
        self.succession.proposals.push((reserve, 0));
    }

    /// What rovers are to be asked now, by `node`, which answers for this home.
    pub(crate) fn proposals_due(&mut self, desk: &Desk<'_>, node: NodeId) -> Vec<Itinerary> {
        let again = desk.now + desk.site.timing.cycle.as_nanos();
        let all = self.succession.proposals.iter_mut();
        let due = all.filter(|(_, due)| *due <= desk.now);
        due.map(|(reserve, due)| {
            *due = again;
            Itinerary {
                node,
                way: reserve.clone().into_way(),
                replaced: reserve.replaced.clone(),
            }
        })
        .collect()
    }

    /// A rover has taken its way, or will not.
    pub(crate) fn answered(&mut self, desk: &Desk<'_>, answer: ItineraryAnswer) {
        let proposals = &mut self.succession.proposals;
        let Some(at) = proposals.iter().position(|(r, _)| r.walk == answer.walk) else {
            return;
        };
        let (reserve, _) = proposals.remove(at);
        if answer.taken {
            self.confirm(desk, &reserve);
            return;
        }
        self.release(desk, &reserve, 0);
        // Somebody is being replaced. The next attempt is not for now.
        let walk = reserve.walk;
        if let Some(applicant) = self.applicants.iter_mut().find(|a| a.is_on(&walk)) {
            let attempt = walk.attempt + 1;
            applicant.walk = None;
            let pause = desk.site.timing.cycle.as_nanos();
            applicant.again = Some((Walk { attempt, ..walk }, desk.now + pause));
        }
    }

    /// Another one answers for `home` than before.
    pub(crate) fn renew(&mut self, desk: &Desk<'_>, home: NodeId) {
        if let Some(line) = self.lines.get_mut(&home) {
            line.renew();
        }
        let to_home = |r: &&Reserve| desk.site.sensors.owner(r.way[r.at as usize].vertex) == home;
        let lost: Vec<Reserve> = self
            .succession
            .open
            .iter()
            .filter(to_home)
            .cloned()
            .collect();
        for reserve in lost {
            self.post(home, Item::Reserve(reserve));
        }
        for at in 0..self.applicants.len() {
            let Some((walk, _)) = self.applicants[at].walk else {
                continue;
            };
            if !self.succession.is_proposed(&walk) {
                let attempt = walk.attempt + 1;
                self.begin(desk, at, Walk { attempt, ..walk });
            }
        }
    }

    /// The registry of a home that is taken over, from what rovers say.
    pub(crate) fn succeed(desk: &Desk<'_>, accounts: &[Account]) -> Registry {
        let mut registry = Registry::default();
        registry.open_empty(desk);
        registry.succession.since = desk.now;
        for account in accounts {
            registry.enter_account(desk, account);
        }
        let site = desk.site;
        for (entry, queue) in &site.queues {
            if site.sensors.owner(*entry) != desk.home {
                continue;
            }
            let has_way = |a: &&Account| !a.ways.is_empty() || a.whereabouts.step > 0;
            let of = |rover| move |a: &&Account| a.whereabouts.rover == rover;
            let found = |&rover| accounts.iter().find(of(rover)).filter(has_way);
            let served: Vec<&Account> = queue.iter().map_while(found).collect();
            let entries = served.iter().filter_map(|a| a.ways.first());
            let last_entry = entries.map(|way| way.visits[0].start).max();
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
        let own = |v| site.sensors.owner(v) == desk.home;
        let (mut from, mut last) = (None, None);
        for way in &account.ways {
            self.succession.take(way.walk);
            for (step, timed) in (way.first_step..).zip(&way.visits) {
                let comes = fact.moving_to.is_some();
                let is_over = step < fact.step || step == fact.step && comes;
                if own(timed.vertex) && !is_over {
                    let visit = Visit {
                        walk: way.walk,
                        step,
                        from,
                        start: timed.start,
                        end: timed.end,
                        confirmed: true,
                        granted: step <= fact.step + u32::from(comes),
                    };
                    self.book.enter(timed.vertex, visit);
                }
                (from, last) = (Some(timed.vertex), Some((timed.vertex, step)));
            }
        }
        if !site.stays {
            return;
        }
        let stands = fact.vertex.map(|vertex| (vertex, fact.step));
        let Some((vertex, step)) = last.or(stands).filter(|&(vertex, _)| own(vertex)) else {
            return;
        };
        if last.is_none() {
            self.book.stand(vertex, fact.rover, step);
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
