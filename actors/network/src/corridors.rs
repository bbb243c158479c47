//! Corridors of a roadmap: the chains in which no two rovers can pass each other. Static, and known
//! to all nodes.

use farside_worlds::{Roadmap, SensorNetwork, VertexId};

/// A maximal chain of vertices with two neighbours each, between two ends that have one neighbour
/// or at least three.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Corridor {
    /// One end, the chain in order, the other end: at least three vertices. Of the two orders the
    /// one in which the lowest vertex of the chain is left towards its higher neighbour. The ends
    /// may be one vertex: a loop.
    pub(crate) way: Vec<VertexId>,
}

/// A way through a corridor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direction {
    /// In the order of [`Corridor::way`].
    Forward,
    /// Against it.
    Backward,
}

impl Direction {
    pub(crate) fn other(self) -> Direction {
        match self {
            Direction::Forward => Direction::Backward,
            Direction::Backward => Direction::Forward,
        }
    }

    /// 0 or 1.
    pub(crate) fn index(self) -> usize {
        usize::from(self == Direction::Backward)
    }
}

/// What a move has to do with corridors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Passage {
    /// From an end into the chain of this corridor.
    Enters(usize, Direction),
    /// Anything else.
    Other,
}

impl Corridor {
    /// The chain without its ends; never empty.
    pub(crate) fn chain(&self) -> &[VertexId] {
        &self.way[1..self.way.len() - 1]
    }

    /// Where who goes in `direction` comes out.
    pub(crate) fn exit(&self, direction: Direction) -> VertexId {
        match direction {
            Direction::Forward => self.way[self.way.len() - 1],
            Direction::Backward => self.way[0],
        }
    }

    /// Nodes that own a vertex of the way, each once, in the way's order.
    pub(crate) fn members(&self, sensors: &SensorNetwork) -> Vec<farside_worlds::NodeId> {
        let mut members = Vec::new();
        for &v in &self.way {
            let owner = sensors.owner(v);
            if !members.contains(&owner) {
                members.push(owner);
            }
        }
        members
    }
}

/// All corridors of a roadmap.
#[derive(Debug, Default)]
pub(crate) struct Corridors {
    all: Vec<Corridor>,
    /// For each vertex of a chain its corridor, and its place in the way.
    place: Vec<Option<(usize, usize)>>,
}

impl Corridors {
    /// Those whose chains have at least `shortest` vertices, ordered by the lowest of them. A
    /// roadmap that is one ring has none.
    pub(crate) fn new(roadmap: &Roadmap, shortest: usize) -> Corridors {
        let mut corridors = Corridors {
            all: Vec::new(),
            place: vec![None; roadmap.len()],
        };
        for lowest in roadmap.vertices() {
            let known = corridors.place[lowest.0 as usize].is_some();
            let &[back, ahead] = roadmap.neighbors(lowest) else {
                continue;
            };
            if known {
                continue;
            }
            let Some(mut way) = arm(roadmap, lowest, back) else {
                continue;
            };
            way.reverse();
            way.push(lowest);
            way.extend(arm(roadmap, lowest, ahead).unwrap_or_default());
            if way.len() < shortest + 2 {
                continue;
            }
            let index = corridors.all.len();
            let corridor = Corridor { way };
            for (i, v) in corridor.chain().iter().enumerate() {
                corridors.place[v.0 as usize] = Some((index, i + 1));
            }
            corridors.all.push(corridor);
        }
        corridors
    }

    pub(crate) fn all(&self) -> &[Corridor] {
        &self.all
    }

    /// The corridor in whose chain `at` is, and the direction of a move from there to its neighbour
    /// `to`.
    pub(crate) fn heading(&self, at: VertexId, to: VertexId) -> Option<(usize, Direction)> {
        let (index, place) = self.place[at.0 as usize]?;
        let ahead = self.all[index].way[place + 1] == to;
        let direction = if ahead {
            Direction::Forward
        } else {
            Direction::Backward
        };
        Some((index, direction))
    }

    /// What a move from `from` to its neighbour `to` has to do with corridors.
    pub(crate) fn passage(&self, from: VertexId, to: VertexId) -> Passage {
        let Some((index, at)) = self.place[to.0 as usize] else {
            return Passage::Other;
        };
        let way = &self.all[index].way;
        let direction = if way[at - 1] == from {
            Direction::Forward
        } else {
            Direction::Backward
        };
        match self.place[from.0 as usize] {
            Some(_) => Passage::Other,
            None => Passage::Enters(index, direction),
        }
    }
}

/// From `start`'s neighbour `next` on to the first vertex that does not have two neighbours; `None`
/// if that never comes.
fn arm(roadmap: &Roadmap, start: VertexId, next: VertexId) -> Option<Vec<VertexId>> {
    let (mut before, mut here) = (start, next);
    let mut arm = vec![here];
    while let &[a, b] = roadmap.neighbors(here) {
        (before, here) = (here, if a == before { b } else { a });
        if here == start {
            return None;
        }
        arm.push(here);
    }
    Some(arm)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{grid, v};
    use proptest::prelude::*;

    /// A grid with as many of the edges that `cuts` names left out as keep it connected.
    fn cut_grid(columns: u32, rows: u32, cuts: u64) -> Roadmap {
        let edges = grid(columns, rows, &[]).edges().to_vec();
        let mut missing = Vec::new();
        for (bit, (a, b)) in edges.into_iter().enumerate() {
            if cuts >> (bit % 64) & 1 == 1 {
                missing.push((a.0, b.0));
                if !connected(columns * rows, columns, &missing) {
                    missing.pop();
                }
            }
        }
        grid(columns, rows, &missing)
    }

    fn connected(count: u32, columns: u32, missing: &[(u32, u32)]) -> bool {
        let joined = |a: u32, b: u32| {
            let (a, b) = (a.min(b), a.max(b));
            let beside = b == a + 1 && b % columns != 0 || b == a + columns;
            beside && !missing.contains(&(a, b))
        };
        let mut reached = vec![0];
        let mut at = 0;
        while at < reached.len() {
            let here = reached[at];
            for next in 0..count {
                if joined(here, next) && !reached.contains(&next) {
                    reached.push(next);
                }
            }
            at += 1;
        }
        reached.len() == count as usize
    }

    /// Chains by merging: every two adjacent vertices with two neighbours are of one chain.
    fn chains_by_merging(map: &Roadmap) -> Vec<Vec<VertexId>> {
        let in_chain = |u: &VertexId| map.neighbors(*u).len() == 2;
        let mut label: Vec<u32> = map.vertices().map(|u| u.0).collect();
        for _ in 0..map.len() {
            for &(a, b) in map.edges() {
                if in_chain(&a) && in_chain(&b) {
                    let least = label[a.0 as usize].min(label[b.0 as usize]);
                    label[a.0 as usize] = least;
                    label[b.0 as usize] = least;
                }
            }
        }
        let of = |l: u32| -> Vec<VertexId> {
            let here = |u: &VertexId| label[u.0 as usize] == l && in_chain(u);
            map.vertices().filter(here).collect()
        };
        let chains = map.vertices().map(|l| of(l.0));
        // A ring has no end: nobody waits at one, and everybody may go round.
        let has_end = |chain: &Vec<VertexId>| {
            let ends = |u: &VertexId| map.neighbors(*u).iter().any(|w| !in_chain(w));
            chain.iter().any(ends)
        };
        chains.filter(has_end).collect()
    }

    proptest! {
        #[test]
        fn corridors_are_the_chains_found_by_merging(
            columns in 2..6u32, rows in 2..5u32, cuts in any::<u64>(), shortest in 1..4usize,
        ) {
            let map = cut_grid(columns, rows, cuts);
            let corridors = Corridors::new(&map, shortest);
            let sorted = |corridor: &Corridor| {
                let mut chain = corridor.chain().to_vec();
                chain.sort_unstable();
                chain
            };
            let mut chains = chains_by_merging(&map);
            chains.retain(|chain| chain.len() >= shortest);
            let found: Vec<_> = corridors.all().iter().map(sorted).collect();
            prop_assert_eq!(found, chains);
            for (index, corridor) in corridors.all().iter().enumerate() {
                let way = &corridor.way;
                for end in [way[0], way[way.len() - 1]] {
                    prop_assert!(map.neighbors(end).len() != 2);
                }
                for (i, step) in way.windows(2).enumerate() {
                    prop_assert!(map.are_adjacent(step[0], step[1]));
                    let ahead = match i {
                        0 => Passage::Enters(index, Direction::Forward),
                        _ => Passage::Other,
                    };
                    prop_assert_eq!(corridors.passage(step[0], step[1]), ahead);
                    let back = match i {
                        i if i + 2 == way.len() => Passage::Enters(index, Direction::Backward),
                        _ => Passage::Other,
                    };
                    prop_assert_eq!(corridors.passage(step[1], step[0]), back);
                }
            }
        }
    }

    #[test]
    fn a_ring_has_no_corridor_and_a_line_has_one() {
        assert!(Corridors::new(&grid(2, 2, &[]), 1).all().is_empty());
        let line = Corridors::new(&grid(4, 1, &[]), 1);
        assert_eq!(line.all()[0].way, [v(0), v(1), v(2), v(3)]);
        assert_eq!(line.all()[0].exit(Direction::Backward), v(0));
    }
}
