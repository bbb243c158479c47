//! Safe-interval path planning (Phillips and Likhachev 2011) in whole cycles: the fastest way of one
//! rover round all that is reserved. A state is a vertex and one of the gaps between its
//! reservations: within a gap whoever comes first can do all that whoever comes later can, so
//! that the earliest arrival in each is all there is to know.
//!
//! Swaps and rotations fit in because they concern a single instant: a rover that leaves at the
//! very end of its gap for the very beginning of the next. If that one move is barred there is no
//! later one between the same two gaps.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use farside_worlds::{Roadmap, VertexId};

use super::plan::Trip;
use super::problem::{Mission, Rules};
use super::table::{FOREVER, Table};

/// The gaps of all vertices, numbered through.
struct Gaps<'a> {
    table: &'a Table,
    /// The number of each vertex's first gap, and of one more at the end.
    first: Vec<usize>,
}

impl Gaps<'_> {
    fn new<'a>(roadmap: &Roadmap, table: &'a Table) -> Gaps<'a> {
        let mut first = Vec::with_capacity(roadmap.len() + 1);
        let mut count = 0;
        for vertex in roadmap.vertices() {
            first.push(count);
            count += table.stays(vertex).len() + 1;
        }
        first.push(count);
        Gaps { table, first }
    }

    fn count(&self) -> usize {
        self.first[self.first.len() - 1]
    }

    /// The gap's cycles, from the first to before the second; empty between close followers.
    fn span(&self, vertex: VertexId, gap: usize) -> (u32, u32) {
        let stays = self.table.stays(vertex);
        let start = gap.checked_sub(1).map_or(0, |before| stays[before].until);
        (start, stays.get(gap).map_or(FOREVER, |stay| stay.from))
    }

    /// The gaps of `vertex` that may hold a cycle from `cycle` on.
    fn from(&self, vertex: VertexId, cycle: u32) -> std::ops::RangeInclusive<usize> {
        let stays = self.table.stays(vertex);
        stays.partition_point(|stay| stay.from <= cycle)..=stays.len()
    }

    fn id(&self, vertex: VertexId, gap: usize) -> usize {
        self.first[vertex.0 as usize] + gap
    }
}

/// What is known of a state.
#[derive(Clone, Copy)]
struct Reached {
    cycle: u32,
    parent: Option<usize>,
    vertex: VertexId,
}

/// The way that arrives first, of a rover that enters at its entry in `ready` or any later cycle
/// (with [`Rules::OnMap`]: stands there in cycle 0). None if there is none: never with
/// [`Rules::Queues`], unless somebody stays on the map for ever.
///
/// It enters as late as the rest of its way allows, so that it waits in its queue, where it is in
/// nobody's way, and not at its entry.
pub(crate) fn search(
    roadmap: &Roadmap,
    table: &Table,
    rules: Rules,
    Mission { entry, goal }: Mission,
    ready: u32,
) -> Option<Trip> {
    let gaps = Gaps::new(roadmap, table);
    let left = roadmap.distances_to(goal);
    let mut reached: Vec<Option<Reached>> = vec![None; gaps.count()];
    let mut open = BinaryHeap::new();
    let reach =
        |reached: &mut Vec<Option<Reached>>, open: &mut BinaryHeap<_>, gap, new: Reached| {
            let id = gaps.id(new.vertex, gap);
            if reached[id].is_none_or(|old| new.cycle < old.cycle) {
                reached[id] = Some(new);
                let bound = new.cycle + left.from(new.vertex);
                // Equal bounds: whoever has come furthest, then by number.
                open.push((Reverse(bound), new.cycle, Reverse((id, gap))));
            }
        };
    for gap in gaps.from(entry, ready) {
        let (start, end) = gaps.span(entry, gap);
        let cycle = start.max(ready);
        if cycle < end && (rules == Rules::Queues || cycle == 0) {
            let (vertex, parent) = (entry, None);
            let state = Reached {
                cycle,
                parent,
                vertex,
            };
            reach(&mut reached, &mut open, gap, state);
        }
    }
    while let Some((_, cycle, Reverse((id, gap)))) = open.pop() {
        let state = reached[id].expect("what is open was reached");
        if cycle > state.cycle {
            continue;
        }
        let here = state.vertex;
        let leave = gaps.span(here, gap).1;
        if here == goal && (rules == Rules::Queues || leave == FOREVER) {
            return Some(trip(&reached, id, rules));
        }
        for &to in roadmap.neighbors(here) {
            for next in gaps.from(to, cycle + 1) {
                let (start, end) = gaps.span(to, next);
                if start > leave {
                    break;
                }
                let arrival = start.max(cycle + 1);
                let instant = arrival == leave && arrival == start;
                let barred = || instant && table.closes_ring(here, to, arrival).is_some();
                if arrival < end && arrival <= leave && !barred() {
                    let state = Reached {
                        cycle: arrival,
                        parent: Some(id),
                        vertex: to,
                    };
                    reach(&mut reached, &mut open, next, state);
                }
            }
        }
    }
    None
}

/// The way to a state: whoever comes to a vertex too early for the next waits there.
fn trip(reached: &[Option<Reached>], last: usize, rules: Rules) -> Trip {
    let mut stops = Vec::new();
    let mut next = Some(last);
    while let Some(state) = next.and_then(|id| reached[id]) {
        stops.push((state.vertex, state.cycle));
        next = state.parent;
    }
    stops.reverse();
    let mut trip = Trip {
        entered: stops[0].1,
        vertices: Vec::new(),
    };
    for pair in stops.windows(2) {
        let stay = pair[1].1 - pair[0].1;
        trip.vertices.extend((0..stay).map(|_| pair[0].0));
    }
    let (goal, arrival) = stops[stops.len() - 1];
    trip.vertices.push(goal);
    if rules == Rules::Queues && stops.len() > 1 {
        // The queue is the better place to wait.
        let waits = stops[1].1 - 1 - trip.entered;
        trip.entered += waits;
        trip.vertices.drain(..waits as usize);
    }
    debug_assert_eq!(trip.last_cycle(), arrival);
    trip
}
