//! Crossings: ways through vertices at which a rover cannot be reached, and so never waits.
//!
//! A crossing is like one edge from the last covered vertex to the next: all its visits begin at
//! the instant S at which the rover sets out into it. A vertex that it comes to after driving for d
//! it claims from S to S + d, where it goes on at once; so S has to lie in [f, u - d] for a safe
//! interval [f, u] of each. A label within a crossing holds what is left of that: the first S
//! (`start`), d as `ready` - `start`, and the last S as `until` - d. Thus a crossing can be
//! searched vertex by vertex, and handed from one part of the roadmap to the next in the middle.
//!
//! Of two labels at one such vertex the one is as good as the other in all that follows if it can
//! be there at all of its times, with no longer a drive: for each of these times its S is as late,
//! and visits have to begin after others have ended.

use std::collections::BTreeMap;

use farside_worlds::VertexId;

use super::{FOREVER, Label};

/// How a search goes on from a label.
pub(super) struct Course {
    /// The earliest time to set out: along the next edge, or into the crossing.
    earliest: u64,
    /// How long the rover has then driven since, when it comes to the label's vertex.
    driven: u64,
    until: u64,
}

impl Course {
    pub(super) fn of(from: &Label, is_covered: bool) -> Course {
        let (earliest, driven) = match is_covered {
            true => (from.ready, 0),
            false => (from.start, from.ready - from.start),
        };
        Course {
            earliest,
            driven,
            until: from.until,
        }
    }

    /// The earliest time to set out towards a vertex that is safe from `safe_from` on; none if that
    /// is too late.
    pub(super) fn sets_out(&self, safe_from: u64) -> Option<u64> {
        let start = safe_from.max(self.earliest);
        let leaves = start.checked_add(self.driven)?;
        (leaves <= self.until).then_some(start)
    }

    /// The label at `to`, which is `travel` away and safe from and until `safe`.
    pub(super) fn label(
        &self,
        to: VertexId,
        travel: u64,
        safe: (u64, u64),
        is_covered: bool,
    ) -> Option<Label> {
        let start = self.sets_out(safe.0)?;
        let ready = start.checked_add(self.driven)?.checked_add(travel)?;
        let until = match is_covered {
            true => safe.1,
            false => safe.1.min(self.until.saturating_add(travel)),
        };
        (ready <= safe.1).then_some(Label {
            vertex: to,
            start,
            ready,
            until,
            parent: None,
        })
    }
}

/// Whether the crossing that the label at `at` is part of has come by `v` already.
pub(super) fn passes(
    labels: &[Label],
    at: u32,
    v: VertexId,
    covers: impl Fn(VertexId) -> bool,
) -> bool {
    let mut next = Some(at);
    while let Some(label) = next.map(|at| labels[at as usize]) {
        if label.vertex == v {
            return true;
        }
        // Where it set out.
        next = label.parent.filter(|_| !covers(label.vertex));
    }
    false
}

/// The labels that are worth going on from.
pub(super) struct Best<'a> {
    covers: &'a dyn Fn(VertexId) -> bool,
    /// Where a rover may wait: when it is there first.
    waiting: Earliest,
    /// Where it may not: those of which none is as good as another.
    passing: BTreeMap<VertexId, Vec<Label>>,
}

impl<'a> Best<'a> {
    pub(super) fn new(vertices: usize, covers: &'a dyn Fn(VertexId) -> bool) -> Self {
        Best {
            covers,
            waiting: Earliest::new(vertices),
            passing: BTreeMap::new(),
        }
    }

    /// Takes a label to begin with.
    pub(super) fn insert(&mut self, label: &Label) {
        if (self.covers)(label.vertex) {
            *self.waiting.of(label.vertex, label.until) = label.ready;
        } else {
            self.improves(label);
        }
    }

    /// Whether nothing better was found in the meantime.
    pub(super) fn has(&mut self, label: &Label) -> bool {
        if (self.covers)(label.vertex) {
            return *self.waiting.of(label.vertex, label.until) == label.ready;
        }
        let known = self.passing.get(&label.vertex);
        known.is_some_and(|known| known.contains(label))
    }

    /// Takes a label, if nothing known is as good.
    pub(super) fn improves(&mut self, label: &Label) -> bool {
        if (self.covers)(label.vertex) {
            let known = self.waiting.of(label.vertex, label.until);
            let is_better = label.ready < *known;
            *known = label.ready.min(*known);
            return is_better;
        }
        let known = self.passing.entry(label.vertex).or_default();
        if known.iter().any(|other| is_as_good(other, label)) {
            return false;
        }
        known.retain(|other| !is_as_good(label, other));
        known.push(*label);
        true
    }
}

/// The earliest time known for each vertex and safe interval, by the interval's end.
struct Earliest {
    /// By vertex, the place in `known` of its last interval met; [`Earliest::NONE`] if none was.
    last: Vec<u32>,
    /// (end of the interval, earliest time, place of the vertex's interval met before).
    known: Vec<(u64, u64, u32)>,
}

impl Earliest {
    const NONE: u32 = u32::MAX;

    fn new(vertices: usize) -> Self {
        Earliest {
            last: vec![Self::NONE; vertices],
            known: Vec::new(),
        }
    }

    /// [`FOREVER`] at first.
    fn of(&mut self, vertex: VertexId, until: u64) -> &mut u64 {
        let last = &mut self.last[vertex.0 as usize];
        let mut at = *last;
        while at != Self::NONE && self.known[at as usize].0 != until {
            at = self.known[at as usize].2;
        }
        if at == Self::NONE {
            at = self.known.len() as u32;
            self.known.push((until, FOREVER, *last));
            *last = at;
        }
        &mut self.known[at as usize].1
    }
}

/// Whether `a` can do all that `b` can, within a crossing.
fn is_as_good(a: &Label, b: &Label) -> bool {
    let driven = |label: &Label| label.ready - label.start;
    a.ready <= b.ready && a.until >= b.until && driven(a) <= driven(b)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Busy, STEP, brute_force, busy};
    use super::super::{SearchSpace, TimedVisit, prune, way_to};
    use super::*;
    use crate::testing::{grid, v};
    use farside_worlds::Roadmap;
    use proptest::prelude::*;

    /// A grid of 3 x 3 with two edges missing; from 0 to 8, which are covered.
    fn map() -> Roadmap {
        grid(3, 3, &[(3, 4), (5, 8)])
    }

    /// Which vertices are covered, by a bit for each that is not.
    fn covered(gaps: u32) -> impl Fn(VertexId) -> bool + Clone {
        move |u: VertexId| u == v(0) || u == v(8) || gaps >> u.0 & 1 == 0
    }

    fn earliest(labels: &[Label]) -> Option<(u32, u64)> {
        let there = (0..).zip(labels).filter(|(_, label)| label.vertex == v(8));
        let best = there.min_by_key(|(_, label)| label.ready);
        best.map(|(at, label)| (at, label.ready))
    }

    fn assert_drivable(map: &Roadmap, busy: &Busy, way: &[TimedVisit], gaps: u32) {
        let covers = covered(gaps);
        // When the rover sets out along the edge to each visit.
        let mut sets_out = way[0].start;
        for (i, pair) in way.windows(2).enumerate() {
            assert!(map.are_adjacent(pair[0].vertex, pair[1].vertex));
            assert!(
                !way[..=i]
                    .iter()
                    .any(|visit| { visit.vertex == pair[1].vertex && visit.end >= pair[1].start })
            );
            if covers(pair[0].vertex) {
                assert_eq!(pair[1].start, pair[0].end);
                assert!(pair[0].end - sets_out >= STEP);
            } else {
                // It does not wait, and all of the crossing began together.
                assert_eq!(pair[1].start, pair[0].start);
                assert_eq!(pair[0].end - sets_out, STEP);
            }
            sets_out = pair[0].end;
        }
        for visit in way {
            for &(s, e) in &busy[visit.vertex.0 as usize] {
                assert!(visit.end < s || visit.start > e, "{visit:?} meets {s}, {e}");
            }
        }
    }

    proptest! {
        /// The search finds the earliest arrival over all crossings, and a way that can be driven.
        #[test]
        fn the_earliest_way_through_gaps_is_found(busy in busy(9), gaps in any::<u32>()) {
            let (map, covers) = (map(), covered(gaps));
            let look = |u: VertexId| Some(busy[u.0 as usize].clone());
            let travel = |_, _| STEP;
            let ground = SearchSpace {
                roadmap: &map,
                headway: 1,
                travel: &travel,
                busy: &look,
                covers: &covers,
            };
            let mut labels = ground.enter(v(0), 0, STEP);
            let open: Vec<u32> = (0..labels.len() as u32).collect();
            ground.expand(&mut labels, &open);
            let found = earliest(&labels);
            let expected = brute_force(&map, &busy, &covers, v(0), v(8));
            prop_assert_eq!(found.map(|(_, ready)| ready), expected);
            if let Some((at, ready)) = found {
                let way = way_to(&labels, at, ready, &covers);
                prop_assert_eq!(way[0].vertex, v(0));
                assert_drivable(&map, &busy, &way, gaps);
            }
        }

        /// A search that is handed to and fro between two parts of the roadmap finds no less, also
        /// where a gap lies across their border.
        #[test]
        fn a_crossing_is_handed_on(busy in busy(9), gaps in any::<u32>(), parts in any::<u32>()) {
            let (map, covers) = (map(), covered(gaps));
            let mut labels = Vec::new();
            for round in 0..9 {
                let is_mine = |u: VertexId| parts >> u.0 & 1 == round % 2;
                let look = |u: VertexId| is_mine(u).then(|| busy[u.0 as usize].clone());
                let travel = |_, _| STEP;
                let ground = SearchSpace {
                roadmap: &map,
                headway: 1,
                travel: &travel,
                busy: &look,
                covers: &covers,
            };
                if round < 2 && is_mine(v(0)) {
                    labels.extend(ground.enter(v(0), 0, STEP));
                }
                let open: Vec<u32> = (0..labels.len() as u32).collect();
                ground.expand(&mut labels, &open);
                // Repetitions would double the labels each time.
                let mut first = Best::new(map.len(), &covers);
                let better = (0..).zip(&labels).filter(|(_, label)| first.improves(label));
                let wanted: Vec<u32> = better.map(|(at, _)| at).collect();
                prune(&mut labels, &wanted);
            }
            let found = earliest(&labels);
            let expected = brute_force(&map, &busy, &covers, v(0), v(8));
            prop_assert_eq!(found.map(|(_, ready)| ready), expected);
            if let Some((at, ready)) = found {
                assert_drivable(&map, &busy, &way_to(&labels, at, ready, &covers), gaps);
            }
        }
    }

    /// A node that is handed a label within a crossing does not know where the crossing began but
    /// by its labels.
    #[test]
    fn a_crossing_does_not_lead_back_to_where_it_began() {
        let map = grid(2, 1, &[]);
        let covers = |u: VertexId| u != v(1);
        let look = |_| Some(Vec::new());
        let ground = SearchSpace {
            roadmap: &map,
            headway: 1,
            travel: &|_, _| STEP,
            busy: &look,
            covers: &covers,
        };
        let mut labels = ground.enter(v(0), 0, STEP);
        ground.expand(&mut labels, &[0]);
        let places: Vec<VertexId> = labels.iter().map(|label| label.vertex).collect();
        assert_eq!(places, [v(0), v(1)]);
        ground.expand(&mut labels, &[1]);
        assert_eq!(labels.len(), 2);
    }

    #[test]
    fn one_sets_out_late_enough_for_the_last_vertex() {
        let map = grid(4, 1, &[]);
        // Vertex 3, beyond the gap, is busy until 50: all of the crossing waits for that, before
        // it.
        let look = |u: VertexId| Some(if u == v(3) { vec![(0, 50)] } else { Vec::new() });
        let covers = |u: VertexId| u != v(1) && u != v(2);
        let ground = SearchSpace {
            roadmap: &map,
            headway: 1,
            travel: &|_, _| STEP,
            busy: &look,
            covers: &covers,
        };
        let mut labels = ground.enter(v(0), 0, STEP);
        ground.expand(&mut labels, &[0]);
        let last = labels.iter().position(|l| l.vertex == v(3)).unwrap();
        let way = way_to(&labels, last as u32, 100, covers);
        let spans: Vec<_> = way.iter().map(|visit| (visit.start, visit.end)).collect();
        assert_eq!(spans, [(41, 51), (51, 61), (51, 71), (51, 100)]);
    }
}
