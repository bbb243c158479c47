//! The visits planned at a node's vertices, in order. Pure: what is in the book, and what may be
//! entered; who is admitted when is the affair of `admit`.

use farside_worlds::VertexId;

use super::messages::Walk;
use crate::planning::safe_intervals::TimedVisit;

/// A planned visit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Visit {
    pub(super) walk: Walk,
    /// The step with which the rover comes.
    pub(super) step: u32,
    /// Where it comes from; none from an entry queue.
    pub(super) from: Option<VertexId>,
    pub(super) start: u64,
    pub(super) end: u64,
    /// The whole way is reserved.
    pub(super) confirmed: bool,
    /// The vertex was given to the rover: nothing may come before.
    pub(super) granted: bool,
}

/// Why visits cannot be entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Clash {
    /// Something in the way will stay.
    Firm,
    /// All that is in the way may yet be struck out, and is younger: it is worth waiting.
    Younger,
}

#[derive(Debug, Default)]
pub(super) struct Book {
    /// The vertices, ascending, each with its visits in order.
    pages: Vec<(VertexId, Vec<Visit>)>,
}

impl Book {
    /// An empty page for each vertex; a book that has pages stays as it is.
    pub(super) fn open(&mut self, owned: &[VertexId]) {
        if self.pages.is_empty() {
            self.pages = owned.iter().map(|&v| (v, Vec::new())).collect();
        }
    }

    fn page(&self, v: VertexId) -> Option<usize> {
        self.pages.binary_search_by_key(&v, |page| page.0).ok()
    }

    /// The visits at `v` as (start, end); none if it is not in the book.
    pub(super) fn busy(&self, v: VertexId) -> Option<Vec<(u64, u64)>> {
        let visits = &self.pages[self.page(v)?].1;
        Some(
            visits
                .iter()
                .map(|visit| (visit.start, visit.end))
                .collect(),
        )
    }

    /// Whether `visits` (with their vertices) may all be entered: apart in time from all others, and
    /// after those that were granted.
    pub(super) fn check(&self, walk: &Walk, visits: &[TimedVisit]) -> Result<(), Clash> {
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
                if old.confirmed || old.walk.is_older_than(walk) {
                    return Err(Clash::Firm);
                }
                result = Err(Clash::Younger);
            }
        }
        result
    }

    /// Enters a visit that was checked.
    pub(super) fn enter(&mut self, v: VertexId, visit: Visit) {
        let Some(page) = self.page(v) else { return };
        let visits = &mut self.pages[page].1;
        let at = visits.partition_point(|old| old.start < visit.start);
        visits.insert(at, visit);
    }

    /// The whole way is reserved.
    pub(super) fn confirm(&mut self, walk: &Walk) {
        for visit in self.of(walk) {
            visit.confirmed = true;
        }
    }

    fn of(&mut self, walk: &Walk) -> impl Iterator<Item = &mut Visit> {
        let walk = *walk;
        let all = self.pages.iter_mut().flat_map(|page| &mut page.1);
        all.filter(move |visit| visit.walk == walk)
    }

    /// Strikes out what `walk` has entered.
    pub(super) fn strike(&mut self, walk: &Walk) {
        self.retain(|visit| visit.walk != *walk);
    }

    /// Strikes out what earlier attempts have entered: they have failed, if there is a later one.
    pub(super) fn strike_earlier(&mut self, walk: &Walk) {
        self.retain(|visit| {
            let same = visit.walk.rover == walk.rover && visit.walk.since == walk.since;
            !same || visit.confirmed || visit.walk.attempt >= walk.attempt
        });
    }

    fn retain(&mut self, keep: impl Fn(&Visit) -> bool) {
        for (_, visits) in &mut self.pages {
            visits.retain(&keep);
        }
    }

    /// The rover to which `v` was granted has gone on.
    pub(super) fn departed(&mut self, v: VertexId) {
        let Some(page) = self.page(v) else { return };
        let visits = &mut self.pages[page].1;
        if visits.first().is_some_and(|visit| visit.granted) {
            visits.remove(0);
        }
    }

    /// The first visit of each vertex, where it may be granted.
    pub(super) fn heads(&mut self) -> impl Iterator<Item = (VertexId, &mut Visit)> {
        let firsts = self.pages.iter_mut().filter_map(|(v, visits)| {
            let first = visits.first_mut()?;
            Some((*v, first))
        });
        firsts.filter(|(_, visit)| visit.confirmed && !visit.granted)
    }
}
