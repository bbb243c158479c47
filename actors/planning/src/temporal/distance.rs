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
    is_target: bool,
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
        let mut greatest = [0; 2];
        for (found, [a, b]) in greatest.iter_mut().zip([[from, to], [to, from]]) {
            self.greatest(network, a, &[b], Ticks::MAX, |_, most| *found = most);
        }
        Span::new(-greatest[1], greatest[0])
    }

    /// For each of the targets that is at most `most` ticks after `from` in all schedules: calls
    /// `found` with its place among the targets and the greatest difference from `from` to it.
    ///
    /// # Panics
    ///
    /// If one of the points is not in the network.
    pub fn greatest<O: Clone>(
        &mut self,
        network: &Network<O>,
        from: Point,
        targets: &[Point],
        most: Ticks,
        mut found: impl FnMut(usize, Ticks),
    ) {
        let earliest = |point: Point| network.bounds(point).min;
        let start = earliest(from);
        let Some(first) = targets.iter().map(|target| earliest(*target)).min() else {
            return;
        };
        let most = most.clamp(-2 * FURTHEST, 2 * FURTHEST);
        // A path's length with potentials is its own, with where it starts, without where it ends.
        self.search(network, from, targets, most + start - first);
        for (place, target) in targets.iter().enumerate() {
            // Through the origin leads what the bounds say.
            let mut greatest = network.bounds(*target).max - start;
            let seen = self.seen(target.index() as u32);
            if seen.done {
                greatest = greatest.min(seen.length + earliest(*target) - start);
            }
            if greatest <= most {
                found(place, greatest);
            }
        }
    }

    /// How much was looked at since this was made.
    pub fn work(&self) -> Work {
        self.work
    }

    /// Goes through the points up to a length, until all targets are done.
    fn search<O: Clone>(
        &mut self,
        network: &Network<O>,
        from: Point,
        targets: &[Point],
        limit: Ticks,
    ) {
        self.pass += 1;
        self.heap.clear();
        self.seen
            .resize(network.nodes.places().max(self.seen.len()), Seen::default());
        let mut missing = 0;
        for target in targets {
            let seen = self.seen(target.index() as u32);
            missing += u32::from(!seen.is_target);
            seen.is_target = true;
        }
        self.offer(from.index() as u32, 0);
        while let Some(Reverse((length, point))) = self.heap.pop() {
            let seen = self.seen(point);
            if seen.done {
                continue;
            }
            if length > limit {
                return;
            }
            seen.done = true;
            missing -= u32::from(seen.is_target);
            self.work.points += 1;
            if missing == 0 {
                return;
            }
            // What leads through the origin is known from the bounds.
            if point == network.origin.index() as u32 && point != from.index() as u32 {
                continue;
            }
            let here = network.node(point).value[EARLIEST];
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
                is_target: false,
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

        /// Differences and greatest distances are those of all paths, in whatever order they are
        /// asked for.
        #[test]
        fn distances_are_those_of_all_paths(
            constraints in prop::collection::vec((0..8usize, 0..8usize, span()), 0..20),
            bounds in prop::collection::vec(-30..60i64, 8),
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
                distances.greatest(&network, points[a], &points, bounds[a], |place, greatest| {
                    found[place] = Some(greatest);
                });
                let within = expected[a].iter().map(|most| Some(*most).filter(|most| *most <= bounds[a]));
                prop_assert_eq!(found, within.collect::<Vec<_>>());
            }
        }
    }

    /// In a long chain, the search ends when all that is asked for is known.
    #[test]
    fn a_search_ends_with_the_last_target() {
        for length in [100, 10_000] {
            let mut network = Network::new(Span::new(0, 1_000_000));
            let chain: Vec<Point> = (0..length).map(|_| network.add_point()).collect();
            for pair in chain.windows(2) {
                let gap = Span::new(5, 10);
                network.constrain(pair[0], pair[1], gap, ()).unwrap();
            }
            let middle = length / 2;
            let mut distances = Distances::new();
            let targets = &chain[middle - 3..=middle];
            let mut found = Vec::new();
            distances.greatest(&network, chain[middle], targets, 0, |_, most| {
                found.push(most)
            });
            assert_eq!(found, [-15, -10, -5, 0]);
            let Work { points, .. } = distances.work();
            assert!(points <= 4, "{points} points of {length}");
        }
    }
}
