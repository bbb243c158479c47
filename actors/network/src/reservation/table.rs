//! The visits planned at a node's vertices, in order. Pure: what is in the table, and what may be
//! entered; who is admitted when is the affair of `admit`.

use std::collections::BTreeMap;

use farside_worlds::VertexId;

use super::messages::{ReservationRequest, ReservedVisit};
use crate::ids::RoverId;
use crate::mapf::safe_intervals::{FOREVER, TimedVisit};

/// A planned visit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Visit {
    pub(crate) request: ReservationRequest,
    /// The step with which the rover comes.
    pub(crate) step: u32,
    /// Where it comes from; none from an entry queue.
    pub(crate) from: Option<VertexId>,
    pub(crate) start: u64,
    pub(crate) end: u64,
    /// The whole path is reserved.
    pub(crate) confirmed: bool,
    /// The vertex was given to the rover: nothing may come before.
    pub(crate) granted: bool,
}

/// Why visits cannot be entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Clash {
    /// Something in the way will stay.
    Firm,
    /// All that is in the way may yet be struck out, and is younger: it is worth waiting.
    Younger,
}

#[derive(Debug, Default)]
pub(crate) struct ReservationTable {
    /// The vertices, ascending, each with its visits in order.
    pages: Vec<(VertexId, Vec<Visit>)>,
    /// From the first vertex to the last: the page of each, [`NO_PAGE`] for those of others.
    places: Vec<u32>,
}

const NO_PAGE: u32 = u32::MAX;

impl ReservationTable {
    /// An empty page for each vertex; a table that has pages stays as it is.
    pub(crate) fn open(&mut self, owned: &[VertexId]) {
        if self.pages.is_empty() {
            self.pages = owned.iter().map(|&v| (v, Vec::new())).collect();
            let first = owned.first().map_or(0, |v| v.0);
            for (page, v) in (0..).zip(owned) {
                self.places.resize((v.0 - first) as usize, NO_PAGE);
                self.places.push(page);
            }
        }
    }

    fn page(&self, v: VertexId) -> Option<usize> {
        let first = self.pages.first()?.0;
        let place = self.places.get(v.0.checked_sub(first.0)? as usize)?;
        (*place != NO_PAGE).then_some(*place as usize)
    }

    /// The visits at `v` as (start, end); none if it is not in the table.
    pub(crate) fn busy(&self, v: VertexId) -> Option<Vec<(u64, u64)>> {
        let visits = &self.pages[self.page(v)?].1;
        Some(
            visits
                .iter()
                .map(|visit| (visit.start, visit.end))
                .collect(),
        )
    }

    /// Enters a rover that stands at `v`, for ever as far as is known.
    pub(crate) fn stand(&mut self, v: VertexId, rover: RoverId, step: u32) {
        let request = ReservationRequest {
            rover,
            attempt: 0,
            since: 0,
        };
        let visit = Visit {
            request,
            step,
            from: None,
            start: 0,
            end: FOREVER,
            confirmed: true,
            granted: true,
        };
        self.enter(v, visit);
    }

    /// Who stands, or will stand, at `v` for ever, as far as is known.
    pub(crate) fn standing(&self, v: VertexId) -> Option<&Visit> {
        let last = self.pages[self.page(v)?].1.last()?;
        (last.end == FOREVER && last.confirmed).then_some(last)
    }

    /// All visits.
    pub(crate) fn all(&self) -> impl Iterator<Item = ReservedVisit> + '_ {
        let all = self.pages.iter();
        let all = all.flat_map(|(v, visits)| visits.iter().map(|visit| (*v, visit)));
        all.map(|(vertex, visit)| ReservedVisit {
            rover: visit.request.rover,
            step: visit.step,
            visit: TimedVisit {
                vertex,
                start: visit.start,
                end: visit.end,
            },
            granted: visit.granted,
        })
    }

    /// Strikes out each rover's visits after this step.
    pub(crate) fn strike_beyond(&mut self, last: &BTreeMap<RoverId, u32>) {
        self.retain(|visit| {
            last.get(&visit.request.rover)
                .is_none_or(|&step| visit.step <= step)
        });
    }

    /// Whether all visits are confirmed.
    pub(crate) fn is_settled(&self) -> bool {
        let mut visits = self.pages.iter().flat_map(|page| &page.1);
        visits.all(|visit| visit.confirmed)
    }

    /// The rover that stands at `v` for ever will leave it after all.
    pub(crate) fn leave_by(&mut self, v: VertexId, end: u64) {
        let Some(page) = self.page(v) else { return };
        if let Some(last) = self.pages[page].1.last_mut() {
            last.end = end;
        }
    }

    /// Whether `visits` (with their vertices) may all be entered: apart in time from all others,
    /// and after those that were granted.
    pub(crate) fn check(
        &self,
        request: &ReservationRequest,
        visits: &[TimedVisit],
    ) -> Result<(), Clash> {
        let mut result = Ok(());
        for new in visits {
            let Some(page) = self.page(new.vertex) else {
                return Err(Clash::Firm);
            };
            for old in &self.pages[page].1 {
                let apart = old.end < new.start || new.end < old.start;
                if apart && !(old.granted && new.start < old.start) {
                    continue;
                }
                if old.confirmed || old.request.is_older_than(request) {
                    return Err(Clash::Firm);
                }
                result = Err(Clash::Younger);
            }
        }
        result
    }

    /// Whether `request` has entered these visits.
    pub(crate) fn has(&self, request: &ReservationRequest, visits: &[TimedVisit]) -> bool {
        let entered = |new: &TimedVisit| {
            let page = self.page(new.vertex).map(|page| &self.pages[page].1);
            let same = |old: &Visit| old.request == *request && old.start == new.start;
            page.is_some_and(|visits| visits.iter().any(same))
        };
        !visits.is_empty() && visits.iter().all(entered)
    }

    /// Enters a visit that was checked.
    pub(crate) fn enter(&mut self, v: VertexId, visit: Visit) {
        let Some(page) = self.page(v) else { return };
        let visits = &mut self.pages[page].1;
        let at = visits.partition_point(|old| old.start < visit.start);
        visits.insert(at, visit);
    }

    /// The whole path is reserved.
    pub(crate) fn confirm(&mut self, request: &ReservationRequest) {
        for visit in self.of(request) {
            visit.confirmed = true;
        }
    }

    fn of(&mut self, request: &ReservationRequest) -> impl Iterator<Item = &mut Visit> {
        let request = *request;
        let all = self.pages.iter_mut().flat_map(|page| &mut page.1);
        all.filter(move |visit| visit.request == request)
    }

    /// Strikes out what `request` has entered.
    pub(crate) fn strike(&mut self, request: &ReservationRequest) {
        self.retain(|visit| visit.request != *request);
    }

    /// Strikes out what earlier attempts have entered: they have failed, if there is a later one.
    pub(crate) fn strike_earlier(&mut self, request: &ReservationRequest) {
        self.retain(|visit| visit.confirmed || !visit.request.is_before(request));
    }

    fn retain(&mut self, keep: impl Fn(&Visit) -> bool) {
        for (_, visits) in &mut self.pages {
            visits.retain(&keep);
        }
    }

    /// The rover to which `v` was granted has gone on.
    pub(crate) fn departed(&mut self, v: VertexId) {
        let Some(page) = self.page(v) else { return };
        let visits = &mut self.pages[page].1;
        if visits.first().is_some_and(|visit| visit.granted) {
            visits.remove(0);
        }
    }

    /// The first visit of each vertex, where it may be granted.
    pub(crate) fn heads(&mut self) -> impl Iterator<Item = (VertexId, &mut Visit)> {
        let firsts = self.pages.iter_mut().filter_map(|(v, visits)| {
            let first = visits.first_mut()?;
            Some((*v, first))
        });
        firsts.filter(|(_, visit)| visit.confirmed && !visit.granted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::v;

    fn request(rover: u32, since: u64) -> ReservationRequest {
        ReservationRequest {
            rover: RoverId(rover),
            attempt: 1,
            since,
        }
    }

    fn table() -> ReservationTable {
        let mut table = ReservationTable::default();
        table.open(&[v(1), v(4)]);
        table
    }

    fn visit(request: ReservationRequest, start: u64, end: u64) -> Visit {
        Visit {
            request,
            step: 3,
            from: None,
            start,
            end,
            confirmed: false,
            granted: false,
        }
    }

    fn timed(vertex: u32, start: u64, end: u64) -> TimedVisit {
        TimedVisit {
            vertex: v(vertex),
            start,
            end,
        }
    }

    #[test]
    fn visits_lie_apart_and_after_what_was_granted() {
        let mut table = table();
        let (young, old) = (request(7, 50), request(2, 10));
        table.enter(v(4), visit(young, 100, 200));
        let check = |start, end| table.check(&old, &[timed(4, start, end)]);
        assert_eq!(check(10, 99), Ok(()));
        assert_eq!(check(201, FOREVER), Ok(()));
        for (start, end) in [(10, 100), (150, 160), (200, 300), (50, FOREVER)] {
            assert_eq!(check(start, end), Err(Clash::Younger), "{start}, {end}");
        }
        assert_eq!(
            table.check(&request(9, 60), &[timed(4, 150, 160)]),
            Err(Clash::Firm)
        );
        table.confirm(&young);
        assert_eq!(table.check(&old, &[timed(4, 150, 160)]), Err(Clash::Firm));
        for (_, head) in table.heads() {
            head.granted = true;
        }
        assert_eq!(table.check(&old, &[timed(4, 10, 99)]), Err(Clash::Firm));
        assert_eq!(table.check(&old, &[timed(4, 300, 301)]), Ok(()));
        assert_eq!(
            table.check(&old, &[timed(2, 300, 301)]),
            Err(Clash::Firm),
            "not in this table"
        );
    }

    #[test]
    fn only_the_first_visit_may_be_granted_and_only_once_it_is_confirmed() {
        let mut table = table();
        let (first, second) = (request(1, 0), request(2, 0));
        table.enter(v(1), visit(second, 20, 30));
        table.enter(v(1), visit(first, 10, 15));
        table.confirm(&second);
        assert_eq!(table.heads().count(), 0, "the first is not confirmed");
        table.confirm(&first);
        let (at, head) = table.heads().next().unwrap();
        assert_eq!((at, head.request), (v(1), first));
        table.departed(v(1));
        assert_eq!(
            table.heads().next().unwrap().1.request,
            first,
            "it was never granted"
        );
        table.heads().next().unwrap().1.granted = true;
        table.departed(v(1));
        assert_eq!(table.heads().next().unwrap().1.request, second);
    }

    #[test]
    fn a_failed_attempt_leaves_nothing_behind() {
        let mut table = table();
        let first = request(1, 5);
        table.enter(v(1), visit(first, 10, 15));
        table.enter(v(4), visit(request(3, 9), 10, 15));
        table.strike_earlier(&ReservationRequest {
            attempt: 2,
            ..first
        });
        assert_eq!(table.busy(v(1)), Some(Vec::new()));
        assert_eq!(table.busy(v(4)).unwrap().len(), 1);
        table.strike(&request(3, 9));
        assert_eq!(table.busy(v(4)), Some(Vec::new()));
    }
}
