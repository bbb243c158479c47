//! Local resolution on maps where rovers stay: who stands in another's way steps aside for a while.

use farside_worlds::VertexId;

use super::{Aim, Applicant, Desk, Origin, Registry};
use crate::network::assemble::Site;
use crate::network::reservation::messages::{Item, Settle, Verdict, Walk, Yield};

impl Registry {
    /// Asks those of this node's rovers that stand on a path to step aside, and passes that on.
    pub(super) fn make_way(&mut self, desk: &Desk<'_>, request: Yield) {
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
    pub(super) fn return_later(&mut self, desk: &Desk<'_>, walk: &Walk) {
        if !desk.site.stays {
            return;
        }
        let goal = desk.site.missions[walk.rover.0 as usize].1;
        for &vertex in desk.site.sensors.owned(desk.home) {
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
}

/// Where to step aside to from `from`: the nearest vertex off `path` at which a rover is heard, or
/// after failures the next nearest.
pub(super) fn aside(site: &Site, from: VertexId, path: &[VertexId], failures: u32) -> VertexId {
    let roadmap = &site.roadmap;
    let off = |v: &VertexId| {
        let is_place = site.sensors.covers(*v) && roadmap.is_reachable(from, *v);
        is_place && *v != from && !path.contains(v)
    };
    let mut places: Vec<VertexId> = roadmap.vertices().filter(off).collect();
    places.sort_by_key(|&v| (roadmap.distance(from, v), v));
    let at = failures as usize % places.len().clamp(1, 64);
    places.get(at).copied().unwrap_or(from)
}

/// How many cycles after it has come there a rover that has stepped aside goes on.
const RETURN_AFTER: u64 = 10;
