//! How far points can be apart: bounds on differences that constraints imply together.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::{EARLIEST, FURTHEST, LATEST, NONE, Network, Point, Span, Work};
use crate::Ticks;

/// Finds how far points can be apart in a network; kept for its memory.
///
/// It is E. Dijkstra's search from a point. The earliest times are its potentials (as in D. B.
/// Johnson's *Efficient Algorithms for Shortest Paths in Sparse Networks*, 1977), so that it goes
/// through points in order and ends when all that is asked for is known.
///
/// ```
/// use farside_planning::temporal::{Distances, Network, Span};
/// let mut network = Network::new(Span::new(0, 1_000));
/// let [start, end, next] = [(); 3].map(|()| network.add_point());
/// network.constrain(start, end, Span::new(30, 40), ()).unwrap();
/// network.constrain(end, next, Span::new(0, 5), ()).unwrap();
/// let mut distances = Distances::new();
/// assert_eq!(distances.difference(&network, start, next), Span::new(30, 45));
/// // Their bounds alone would not say so.
/// assert_eq!(network.bounds(start), Span::new(0, 970));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Distances {
    heap: BinaryHeap<Reverse<(Ticks, u32)>>,
    /// By point: what the current search knows of it.
    seen: Vec<Seen>,
    /// The number of the current search.
    pass: u64,
    work: Work,
}

#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    pass: u64,
    /// The length of the best path, with potentials.
    length: Ticks,
    done: bool,
}

impl Distances {
    /// Without memory yet.
    pub fn new() -> Self {
        Distances::default()
    }

    /// Within which `to - from` lies in all schedules; each value of it is of some schedule.
    ///
    /// # Panics
    ///
    /// If one of the points is not in the network.
    pub fn difference<O: Clone>(&mut self, network: &Network<O>, from: Point, to: Point) -> Span {
        let mut greatest = |from: Point, to: Point| {
            // Through the origin leads what the bounds say.
            let mut greatest = network.bounds(to).max - network.bounds(from).min;
            let limit = 4 * FURTHEST;
            self.search(network, from, limit, |point, distance| {
                let is_there = point == to.index() as u32;
                if is_there {
                    greatest = greatest.min(distance);
                }
                !is_there
            });
            greatest
        };
        let (most, back) = (greatest(from, to), greatest(to, from));
        Span::new(-back, most)
    }

    /// For each point that is by constraints at most `most` ticks after `from` in all schedules,
    /// and whose earliest time is not before `not_before`: calls `found` with it and the greatest
    /// difference from `from` to it, as far as constraints say so. What bounds say alone is left
    /// out.
    ///
    /// It looks at the points, and their constraints, that are near enough to lead there.
    ///
    /// # Panics
    ///
    /// If the point is not in the network.
    pub fn reach<O: Clone>(
        &mut self,
        network: &Network<O>,
        from: Point,
        most: Ticks,
        not_before: Ticks,
        mut found: impl FnMut(Point, Ticks),
    ) {
        let most = most.clamp(-2 * FURTHEST, 2 * FURTHEST);
        let not_before = not_before.clamp(-FURTHEST, FURTHEST);
        // A path's length with potentials is its own, with where it starts, without where it ends.
        let limit = most + network.bounds(from).min - not_before;
        self.search(network, from, limit, |point, distance| {
            if distance <= most
                && network.node(point).value[EARLIEST] >= not_before
                && let Some(point) = network.nodes.id_at(point as usize)
            {
                found(point, distance);
            }
            true
        });
    }

    /// How much was looked at since this was made.
    pub fn work(&self) -> Work {
        self.work
    }

    /// Goes through the points by the lengths of paths to them, up to a limit, as long as `goes_on`
    /// says so of a point and its distance.
    fn search<O: Clone>(
        &mut self,
        network: &Network<O>,
        from: Point,
        limit: Ticks,
        mut goes_on: impl FnMut(u32, Ticks) -> bool,
    ) {
        self.pass += 1;
        self.heap.clear();
        let places = network.nodes.places().max(self.seen.len());
        self.seen.resize(places, Seen::default());
        let start = network.bounds(from).min;
        self.offer(from.index() as u32, 0);
        while let Some(Reverse((length, point))) = self.heap.pop() {
            let seen = self.seen(point);
            if seen.done {
                continue;
            }
            seen.done = true;
            self.work.points += 1;
            let here = network.node(point).value[EARLIEST];
            if length > limit || !goes_on(point, length + here - start) {
                return;
            }
            // What leads through the origin is known from the bounds.
            if point == network.origin.index() as u32 && point != from.index() as u32 {
                continue;
            }
            let mut next = network.node(point).first[LATEST];
            while next != NONE {
                self.work.inequalities += 1;
                let inequality = &network.halves[next as usize];
                let there = network.node(inequality.from).value[EARLIEST];
                let slack = here - there - inequality.gap;
                if slack <= limit - length {
                    self.offer(inequality.from, length + slack);
                }
                next = inequality.next[LATEST];
            }
        }
    }

    fn offer(&mut self, point: u32, length: Ticks) {
        let seen = self.seen(point);
        if !seen.done && length < seen.length {
            seen.length = length;
            self.heap.push(Reverse((length, point)));
        }
    }

    fn seen(&mut self, point: u32) -> &mut Seen {
        let pass = self.pass;
        let seen = &mut self.seen[point as usize];
        if seen.pass != pass {
            *seen = Seen {
                pass,
                length: Ticks::MAX,
                done: false,
            };
        }
        seen
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const HORIZON: Span = Span::new(-20, 100);

    /// The shortest paths between all points, through the horizon too.
    fn all_pairs(network: &Network<()>, points: &[Point]) -> Vec<Vec<Ticks>> {
        let many = points.len();
        let mut distance = vec![vec![Ticks::MAX / 4; many]; many];
        let place = |point: Point| points.iter().position(|other| *other == point).unwrap();
        let origin = place(network.origin());
        distance[origin].fill(HORIZON.max);
        for (at, from) in distance.iter_mut().enumerate() {
            from[origin] = -HORIZON.min;
            from[at] = 0;
        }
        for (_, from, to, span) in network.all_constraints() {
            let (from, to) = (place(from), place(to));
            if span.max < Ticks::MAX {
                distance[from][to] = distance[from][to].min(span.max);
            }
            if span.min > Ticks::MIN {
                distance[to][from] = distance[to][from].min(-span.min);
            }
        }
        for through in 0..many {
            for a in 0..many {
                for b in 0..many {
                    let longer = distance[a][through] + distance[through][b];
                    distance[a][b] = distance[a][b].min(longer);
                }
            }
        }
        distance
    }

    fn span() -> impl Strategy<Value = Span> {
        prop_oneof![
            (-20..30i64).prop_map(Span::at_least),
            (-20..30i64).prop_map(Span::at_most),
            (-20..30i64, 0..20i64).prop_map(|(min, more)| Span::new(min, min + more)),
            Just(Span::ALL),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1_000))]

        /// Differences and what is reached are those of all paths, in whatever order they are
        /// asked for.
        #[test]
        fn distances_are_those_of_all_paths(
            constraints in prop::collection::vec((0..8usize, 0..8usize, span()), 0..20),
            bounds in prop::collection::vec((-30..60i64, -30..60i64), 8),
        ) {
            let mut network = Network::new(HORIZON);
            let mut points = vec![network.origin()];
            points.extend((1..8).map(|_| network.add_point()));
            for (from, to, span) in constraints {
                // Refused, it changes nothing.
                let _ = network.constrain(points[from], points[to], span, ());
            }
            let expected = all_pairs(&network, &points);
            let mut distances = Distances::new();
            for a in 0..points.len() {
                for b in 0..points.len() {
                    let difference = distances.difference(&network, points[a], points[b]);
                    prop_assert_eq!(difference, Span::new(-expected[b][a], expected[a][b]));
                }
                let mut found = vec![None; points.len()];
                let (most, not_before) = bounds[a];
                distances.reach(&network, points[a], most, not_before, |point, distance| {
                    found[points.iter().position(|other| *other == point).unwrap()] = Some(distance);
                });
                for (b, found) in found.into_iter().enumerate() {
                    let is_near = expected[a][b] <= most
                        && network.bounds(points[b]).min >= not_before;
                    let by_bounds = network.bounds(points[b]).max - network.bounds(points[a]).min;
                    match found {
                        Some(distance) => {
                            prop_assert!(is_near && distance >= expected[a][b]);
                            prop_assert_eq!(distance.min(by_bounds), expected[a][b]);
                        }
                        None => prop_assert!(!is_near || expected[a][b] == by_bounds),
                    }
                }
            }
        }
    }

    /// In a long plan whose tasks have some slack, the search stays near.
    #[test]
    fn a_search_ends_where_nothing_is_near_enough() {
        for length in [100, 10_000] {
            let mut network = Network::new(Span::new(0, 1_000_000));
            let chain: Vec<Point> = (0..length).map(|_| network.add_point()).collect();
            for (place, pair) in chain.windows(2).enumerate() {
                let gap = Span::new(5, 20);
                network.constrain(pair[0], pair[1], gap, ()).unwrap();
                // Every tenth one waits.
                if place % 10 == 9 {
                    let start = Span::at_least(8 * place as Ticks);
                    network
                        .constrain(network.origin(), pair[1], start, ())
                        .unwrap();
                }
            }
            let middle = length / 2 + 5;
            let mut distances = Distances::new();
            let not_before = network.bounds(chain[middle - 3]).min;
            let mut found = Vec::new();
            distances.reach(&network, chain[middle], 0, not_before, |_, most| {
                found.push(most)
            });
            assert_eq!(found, [0, -5, -10, -15]);
            let Work { points, .. } = distances.work();
            assert!(points <= 20, "{points} points of {length}");
            let difference = distances.difference(&network, chain[middle], chain[middle + 2]);
            assert_eq!(difference, Span::new(10, 40));
        }
    }
}
