//! Safe-interval path planning (Phillips and Likhachev, 2011) in continuous time, over any part of
//! a roadmap, so that a search can be handed from one part to the next.
//!
//! A rover's way is a list of visits. A **visit** of a vertex begins when the rover sets out
//! towards it, and ends when it sets out towards the next: from then on the vertex is free. Between
//! two visits of one vertex by different rovers there is a gap, the time that it takes to learn of
//! the one and to permit the other. A **safe interval** of a vertex is a time in which a visit may
//! lie.
//!
//! Of two ways into the same safe interval the one that is there first is as good as the other in
//! all that follows, since it may wait. So a search keeps one [`Label`] for each vertex and
//! interval. Swapping along an edge needs no rule of its own: each of the two rovers would have to
//! begin its visit after the other one has ended. Only where there is no gap at all, as in whole
//! cycles, can both happen at one instant.
//!
//! Through vertices that are not covered a rover drives in one go: all its visits of a crossing, up
//! to that of the covered vertex beyond, begin when it sets out into it. How that is searched:
//! `crossing`.

mod crossing;

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use farside_worlds::{Roadmap, VertexId};
use serde::{Deserialize, Serialize};

use crossing::{Best, Course};

/// A time later than all others \[ns\].
pub const FOREVER: u64 = u64::MAX;

/// A way to be at a vertex within one of its safe intervals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Label {
    /// Where.
    pub vertex: VertexId,
    /// The earliest begin of the visit \[ns\].
    pub start: u64,
    /// When the rover then stands there \[ns\].
    pub ready: u64,
    /// When the visit must have ended \[ns\]: the safe interval's end. At a vertex that is not
    /// covered the latest time to pass it, as the crossing goes so far.
    pub until: u64,
    /// The label it comes from, by its place in the same list; none where the way begins.
    pub parent: Option<u32>,
}

/// One visit of a planned way: the rover claims `vertex` from `start` until `end`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TimedVisit {
    /// Where.
    pub vertex: VertexId,
    /// When the rover sets out towards it \[ns\].
    pub start: u64,
    /// When it sets out from it, or leaves the roadmap; [`FOREVER`] if it stays \[ns\].
    pub end: u64,
}

/// The part of a roadmap that a search may enter, and who is there when.
pub struct SearchSpace<'a> {
    /// The roadmap.
    pub roadmap: &'a Roadmap,
    /// The least time between one rover's leaving and the next one's coming \[ns\].
    pub headway: u64,
    /// How long a rover takes from setting out to being ready to set out again \[ns\]; at least 1.
    pub travel: &'a dyn Fn(VertexId, VertexId) -> u64,
    /// The visits planned at a vertex, as (start, end), disjoint and in order; none for a vertex
    /// that the search may not enter.
    pub busy: &'a dyn Fn(VertexId) -> Option<Vec<(u64, u64)>>,
    /// Whether a rover may wait at a vertex; where it may not, it drives through.
    pub covers: &'a dyn Fn(VertexId) -> bool,
}

/// What a search for one place looks for; [`SearchSpace::expand`] looks for nothing and finds all.
pub(super) struct Aim<'a> {
    /// No less than this long is left from a vertex on \[ns\], and no more than an edge's time and
    /// what is left at its end.
    pub(super) left: &'a dyn Fn(VertexId) -> u64,
    /// Whether a label is the end of the search.
    pub(super) is_end: &'a dyn Fn(&Label) -> bool,
    /// Whether there is no setting out from the first vertex to the second at this instant, the
    /// only one at which one safe interval is left for the other. Without a gap rovers can change
    /// places, in twos and in rings, at such an instant and at no other.
    pub(super) is_barred: &'a dyn Fn(VertexId, VertexId, u64) -> bool,
}

/// The safe intervals left by visits `busy`, as (first begin, last end).
///
/// ```
/// use farside_network::mapf::safe_intervals::{FOREVER, safe_intervals};
/// let safe: Vec<_> = safe_intervals(&[(10, 20), (22, 30)], 2).collect();
/// assert_eq!(safe, [(0, 8), (32, FOREVER)]);
/// ```
pub fn safe_intervals(busy: &[(u64, u64)], headway: u64) -> impl Iterator<Item = (u64, u64)> + '_ {
    (0..=busy.len()).filter_map(move |i| {
        let from = if i == 0 {
            0
        } else {
            busy[i - 1].1.saturating_add(headway)
        };
        let to = match busy.get(i) {
            Some((start, _)) => start.saturating_sub(headway),
            None => FOREVER,
        };
        (from < to).then_some((from, to))
    })
}

impl SearchSpace<'_> {
    /// Labels for a rover that comes to `vertex` from outside the roadmap, at `earliest` or later,
    /// and needs `dwell` \[ns\] to come in.
    pub fn enter(&self, vertex: VertexId, earliest: u64, dwell: u64) -> Vec<Label> {
        let busy = (self.busy)(vertex).unwrap_or_default();
        let label = |(from, until): (u64, u64)| {
            let start = from.max(earliest);
            let ready = start.checked_add(dwell)?;
            (ready <= until).then_some(Label {
                vertex,
                start,
                ready,
                until,
                parent: None,
            })
        };
        safe_intervals(&busy, self.headway)
            .filter_map(label)
            .collect()
    }

    /// Expands the labels at `open` (places in `labels`) and all that come of them, earliest first;
    /// appends what is found to `labels`. Labels lead on from any vertex, but only to vertices that
    /// [`SearchSpace::busy`] knows.
    pub fn expand(&self, labels: &mut Vec<Label>, open: &[u32]) {
        let all = Aim {
            left: &|_| 0,
            is_end: &|_| false,
            is_barred: &|_, _, _| false,
        };
        self.search(labels, open, &all);
    }

    /// As [`SearchSpace::expand`], but the most promising label first (A*), and only until one is
    /// the end: its place. No other end is ready sooner.
    pub(super) fn search(
        &self,
        labels: &mut Vec<Label>,
        open: &[u32],
        aim: &Aim<'_>,
    ) -> Option<u32> {
        // Of equals the one that has come furthest, then the one that was found first.
        let rank = |label: &Label, at: u32| {
            let bound = label.ready.saturating_add((aim.left)(label.vertex));
            (Reverse(bound), label.ready, Reverse(at))
        };
        let mut queue = BinaryHeap::new();
        let mut best = Best::new(self.roadmap.len(), self.covers);
        for &at in open {
            let label = labels[at as usize];
            best.insert(&label);
            queue.push(rank(&label, at));
        }
        while let Some((_, _, Reverse(at))) = queue.pop() {
            let from = labels[at as usize];
            if !best.has(&from) {
                continue;
            }
            if (aim.is_end)(&from) {
                return Some(at);
            }
            let in_gap = !(self.covers)(from.vertex);
            let course = Course::of(&from, !in_gap);
            for &to in self.roadmap.neighbors(from.vertex) {
                let Some(busy) = (self.busy)(to) else {
                    continue;
                };
                if in_gap && crossing::passes(labels, at, to, self.covers) {
                    continue;
                }
                let travel = (self.travel)(from.vertex, to);
                let in_time = |safe: &(u64, u64)| course.sets_out(safe.0).is_some();
                for safe in safe_intervals(&busy, self.headway).take_while(in_time) {
                    let parent = Some(at);
                    let label = course.label(to, travel, safe, (self.covers)(to));
                    let Some(label) = label.map(|label| Label { parent, ..label }) else {
                        continue;
                    };
                    let is_only = label.start == safe.0 && label.start == from.until;
                    let barred = is_only && (aim.is_barred)(from.vertex, to, label.start);
                    if !barred && best.improves(&label) {
                        queue.push(rank(&label, labels.len() as u32));
                        labels.push(label);
                    }
                }
            }
        }
        None
    }
}

/// The way that ends with the label at `last`: each visit begins as early as can be, but the first
/// one as late as the second allows, so that a rover that comes from outside waits there and not in
/// the way of others. The last visit ends at `end`. Vertices that `covers` does not say are covered
/// are driven through.
pub fn way_to(
    labels: &[Label],
    last: u32,
    end: u64,
    covers: impl Fn(VertexId) -> bool,
) -> Vec<TimedVisit> {
    let mut way = Vec::new();
    let (mut next, mut end) = (Some(last), end);
    while let Some(at) = next {
        let label = labels[at as usize];
        next = label.parent;
        if !covers(label.vertex) {
            // All visits of a crossing begin together, as late as the one after it allows.
            way.push(TimedVisit {
                vertex: label.vertex,
                start: end,
                end: end + (label.ready - label.start),
            });
            continue;
        }
        let start = match next {
            // Where the way begins and ends at once there is nothing to wait for.
            None if !way.is_empty() => end - (label.ready - label.start),
            _ => label.start,
        };
        way.push(TimedVisit {
            vertex: label.vertex,
            start,
            end,
        });
        end = start;
    }
    way.reverse();
    way
}

/// Keeps only the labels at `wanted` and those they come from; their order stays. Returns where the
/// wanted ones are now.
pub fn prune(labels: &mut Vec<Label>, wanted: &[u32]) -> Vec<u32> {
    let mut place = vec![None; labels.len()];
    for &at in wanted {
        let mut next = Some(at);
        while let Some(at) = next.filter(|&at| place[at as usize].is_none()) {
            place[at as usize] = Some(0);
            next = labels[at as usize].parent;
        }
    }
    let mut kept = Vec::new();
    for (at, slot) in place.iter_mut().enumerate() {
        if slot.is_some() {
            *slot = Some(kept.len() as u32);
            kept.push(labels[at]);
        }
    }
    for label in &mut kept {
        label.parent = label.parent.and_then(|p| place[p as usize]);
    }
    *labels = kept;
    wanted.iter().filter_map(|&at| place[at as usize]).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::testing::{grid, v};
    use proptest::prelude::*;

    pub(super) const STEP: u64 = 10;

    pub(super) type Busy = Vec<Vec<(u64, u64)>>;

    fn ground<'a>(
        roadmap: &'a Roadmap,
        busy: &'a dyn Fn(VertexId) -> Option<Vec<(u64, u64)>>,
    ) -> SearchSpace<'a> {
        SearchSpace {
            roadmap,
            headway: 1,
            travel: &|_, _| STEP,
            busy,
            covers: &|_| true,
        }
    }

    /// The earliest time to be ready at `goal`, by trying every instant: a rover at a vertex waits
    /// one instant or sets out, and may be nowhere within a gap of another's visit. Through
    /// vertices that are not covered it drives without a stop, and claims all of them, and the one
    /// beyond, as it sets out.
    pub(super) fn brute_force(
        roadmap: &Roadmap,
        busy: &Busy,
        covers: &dyn Fn(VertexId) -> bool,
        start: VertexId,
        goal: VertexId,
    ) -> Option<u64> {
        const END: u64 = 400;
        let free = |u: VertexId, at: u64| {
            let visits = &busy[u.0 as usize];
            visits.iter().all(|&(s, e)| at > e || at < s)
        };
        let n = roadmap.len();
        // open[t][u]: how long a rover that claims u at t has been on its way there, at most STEP.
        let mut open = vec![vec![None::<u64>; n]; END as usize + 1];
        for at in 0..END {
            if free(start, at) {
                let zero = &mut open[at as usize][start.0 as usize];
                *zero = (*zero).max(Some(0));
            }
            // Those who set out now have not been on their way for any time: no move leads to
            // another.
            for u in roadmap.vertices() {
                if open[at as usize][u.0 as usize] == Some(STEP) {
                    if u == goal {
                        return Some(at);
                    }
                    let open_to = |w: &&VertexId| covers(**w) && free(**w, at);
                    for &w in roadmap.neighbors(u).iter().filter(open_to) {
                        let slot = &mut open[at as usize][w.0 as usize];
                        *slot = (*slot).max(Some(0));
                    }
                    for through in crossings(roadmap, covers, &[u]) {
                        let drives = |i: usize| at + STEP * i as u64;
                        let is_free = |(i, &w): (usize, &VertexId)| {
                            i == 0 || (at..=drives(i)).all(|t| free(w, t))
                        };
                        let there = drives(through.len() - 1);
                        if there <= END && through.iter().enumerate().all(is_free) {
                            let exit = through[through.len() - 1];
                            open[there as usize][exit.0 as usize] = Some(STEP);
                        }
                    }
                }
            }
            for u in roadmap.vertices().filter(|&u| free(u, at + 1)) {
                let age = open[at as usize][u.0 as usize];
                let slot = &mut open[at as usize + 1][u.0 as usize];
                *slot = (*slot).max(age.map(|age| (age + 1).min(STEP)));
            }
        }
        None
    }

    /// All ways that begin so and lead on through vertices that are not covered to one that is.
    fn crossings(
        roadmap: &Roadmap,
        covers: &dyn Fn(VertexId) -> bool,
        begun: &[VertexId],
    ) -> Vec<Vec<VertexId>> {
        let here = begun[begun.len() - 1];
        let new = roadmap
            .neighbors(here)
            .iter()
            .filter(|w| !begun.contains(w));
        let ways = new.map(|&w| {
            let way = [begun, &[w]].concat();
            match (covers(w), begun.len()) {
                (true, 1) => Vec::new(),
                (true, _) => vec![way],
                (false, _) => crossings(roadmap, covers, &way),
            }
        });
        ways.flatten().collect()
    }

    pub(super) fn busy(n: usize) -> impl Strategy<Value = Busy> {
        let spans = proptest::collection::vec((1u64..40, 0u64..30), 0..4);
        let disjoint = |spans: Vec<(u64, u64)>| {
            let mut at = 0;
            let place = |(wait, length): (u64, u64)| {
                let start = at + wait;
                at = start + length;
                (start, at)
            };
            spans.into_iter().map(place).collect()
        };
        proptest::collection::vec(spans.prop_map(disjoint), n)
    }

    proptest! {
        /// The search finds the earliest arrival, its way keeps clear of all visits, and a search
        /// in two parts finds no less than one that is told to pass through them in that order.
        #[test]
        fn the_earliest_way_is_found(busy in busy(6), goal in 0u32..6) {
            let map = grid(3, 2, &[(1, 4)]);
            let look = |u: VertexId| Some(busy[u.0 as usize].clone());
            let ground = ground(&map, &look);
            let mut labels = ground.enter(v(0), 0, STEP);
            let open: Vec<u32> = (0..labels.len() as u32).collect();
            ground.expand(&mut labels, &open);
            let there = (0..).zip(&labels).filter(|(_, label)| label.vertex == v(goal));
            let best = there.min_by_key(|(_, label)| label.ready);
            let expected = brute_force(&map, &busy, &|_| true, v(0), v(goal));
            prop_assert_eq!(best.map(|(_, label)| label.ready), expected);
            if let Some((at, label)) = best {
                let way = way_to(&labels, at, label.ready, |_| true);
                prop_assert_eq!(way[0].vertex, v(0));
                for pair in way.windows(2) {
                    prop_assert_eq!(pair[0].end, pair[1].start);
                    prop_assert!(pair[0].end - pair[0].start >= STEP);
                    prop_assert!(map.are_adjacent(pair[0].vertex, pair[1].vertex));
                }
                for visit in &way {
                    for &(s, e) in &busy[visit.vertex.0 as usize] {
                        let is_apart = visit.end < s || visit.start > e;
                        prop_assert!(is_apart, "{:?} meets ({}, {})", visit, s, e);
                    }
                }
            }
        }
    }

    #[test]
    fn pruning_keeps_ancestors_only() {
        let map = grid(4, 1, &[]);
        let look = |_| Some(Vec::new());
        let ground = ground(&map, &look);
        let mut labels = ground.enter(v(1), 5, STEP);
        ground.expand(&mut labels, &[0]);
        assert_eq!(labels.len(), 4, "one safe interval each");
        let last = labels.iter().position(|l| l.vertex == v(3)).unwrap() as u32;
        let kept = prune(&mut labels, &[last]);
        assert_eq!(labels.len(), 3);
        let way = way_to(&labels, kept[0], FOREVER, |_| true);
        let places: Vec<_> = way
            .iter()
            .map(|visit| (visit.vertex.0, visit.start))
            .collect();
        assert_eq!(places, [(1, 5), (2, 15), (3, 25)]);
    }
}
