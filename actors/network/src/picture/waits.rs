//! Who waits for whom at an instant, and who waits in a circle.

use std::collections::{BTreeMap, BTreeSet};

use farside_actors::invariants::WaitGraph;
use farside_worlds::{Roadmap, VertexId};

use super::tracks::{Place, Seen};

/// The wait-for graph of rovers at an instant. A rover waits if it stands, is not at its goal, and
/// each vertex that would bring it nearer to its goal is held by another rover.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Waits {
    /// Those that wait, and for whom, each list sorted.
    pub(crate) on: BTreeMap<u32, Vec<u32>>,
    /// Rovers that wait for each other: each list is a strongly connected part of the graph, made of
    /// rovers that none can leave on a shortest way before another of them does.
    pub(crate) circles: Vec<Vec<u32>>,
    /// Those that wait, if not in a circle, then for one.
    pub(crate) behind: BTreeSet<u32>,
}

impl Waits {
    pub(crate) fn of(roadmap: &Roadmap, rovers: &[Seen]) -> Waits {
        let holders: BTreeMap<VertexId, u32> = rovers
            .iter()
            .filter_map(|seen| Some((seen.holds()?, seen.rover)))
            .collect();
        let waiting = |seen: &Seen| {
            let Place::At(here) = seen.place else {
                return None;
            };
            let holders: Option<BTreeSet<u32>> = nearer(roadmap, here, seen.goal)
                .map(|next| holders.get(&next).copied())
                .collect();
            let holders: Vec<u32> = holders?.into_iter().collect();
            (!holders.is_empty()).then_some((seen.rover, holders))
        };
        let on: BTreeMap<u32, Vec<u32>> = rovers.iter().filter_map(waiting).collect();
        let stuck = stuck(&on);
        let circles = circles(&on, &stuck);
        let mut behind = stuck;
        for rover in circles.iter().flatten() {
            behind.remove(rover);
        }
        Waits {
            on,
            circles,
            behind,
        }
    }

    pub(crate) fn in_circle(&self, rover: u32) -> bool {
        self.circles.iter().any(|circle| circle.contains(&rover))
    }

    /// One way round a circle, as short as can be, from the lowest number on it on.
    pub(crate) fn round(&self, circle: &[u32]) -> Vec<u32> {
        let cycles = graph(&self.on, |rover| circle.contains(&rover)).cycles();
        numbers(cycles.first().map_or(&[], Vec::as_slice))
    }
}

/// The neighbours of `here` on shortest ways to `goal`.
pub(crate) fn nearer(
    roadmap: &Roadmap,
    here: VertexId,
    goal: VertexId,
) -> impl Iterator<Item = VertexId> {
    let left = roadmap.distance(here, goal);
    let neighbors = roadmap.neighbors(here).iter().copied();
    neighbors.filter(move |next| roadmap.distance(*next, goal) < left)
}

/// Those that wait and go on waiting even if every rover that can move does: one is free as soon as
/// one of those it waits for is.
fn stuck(on: &BTreeMap<u32, Vec<u32>>) -> BTreeSet<u32> {
    let mut stuck: BTreeSet<u32> = on.keys().copied().collect();
    loop {
        let free = |rover: &&u32| on[*rover].iter().any(|holder| !stuck.contains(holder));
        let freed: Vec<u32> = stuck.iter().filter(free).copied().collect();
        if freed.is_empty() {
            return stuck;
        }
        for rover in freed {
            stuck.remove(&rover);
        }
    }
}

/// The strongly connected parts of two and more among the stuck, from the lowest number on.
fn circles(on: &BTreeMap<u32, Vec<u32>>, stuck: &BTreeSet<u32>) -> Vec<Vec<u32>> {
    let knots = graph(on, |rover| stuck.contains(&rover)).knots();
    let mut circles: Vec<_> = knots.iter().map(|knot| numbers(knot)).collect();
    circles.sort_unstable();
    circles
}

/// Who of those `within` waits for whom of them.
fn graph(on: &BTreeMap<u32, Vec<u32>>, within: impl Fn(u32) -> bool) -> WaitGraph {
    let rovers = on
        .iter()
        .flat_map(|(rover, holders)| holders.iter().chain([rover]));
    let mut graph = WaitGraph::new(rovers.max().map_or(0, |last| *last as usize + 1));
    for (&rover, holders) in on.iter().filter(|(rover, _)| within(**rover)) {
        for &holder in holders.iter().filter(|holder| within(**holder)) {
            graph.add(rover as usize, holder as usize);
        }
    }
    graph
}

fn numbers(rovers: &[usize]) -> Vec<u32> {
    rovers.iter().map(|rover| *rover as u32).collect()
}

#[cfg(test)]
mod tests {
    use farside_worlds::Roadmap;
    use nalgebra::Point2;
    use proptest::prelude::*;

    use super::*;

    fn standing(rover: u32, at: u32, goal: u32) -> Seen {
        Seen {
            rover,
            entry: VertexId(0),
            goal: VertexId(goal),
            place: Place::At(VertexId(at)),
        }
    }

    fn line(length: u32) -> Roadmap {
        let at = |i: u32| Point2::new(f64::from(i), 0.0);
        let edges = (1..length).map(|i| (VertexId(i - 1), VertexId(i)));
        let places = (0..length).map(at).collect();
        Roadmap::new("line", places, edges.collect(), vec![VertexId(0)]).unwrap()
    }

    #[test]
    fn two_that_meet_wait_in_a_circle_and_others_behind_them() {
        let map = line(6);
        let team = [
            standing(0, 1, 5),
            standing(1, 2, 5),
            standing(2, 3, 0),
            standing(3, 5, 5),
        ];
        let waits = Waits::of(&map, &team);
        assert_eq!(waits.circles, [vec![1, 2]]);
        assert_eq!(waits.behind, BTreeSet::from([0]));
        assert_eq!(waits.round(&[1, 2]), [1, 2]);
        // One that drives on frees all behind it.
        let mut team = team;
        team[2].place = Place::Between(VertexId(3), VertexId(4), 0.5);
        let waits = Waits::of(&map, &team);
        assert_eq!(waits.on, BTreeMap::from([(0, vec![1])]));
        assert!(waits.circles.is_empty() && waits.behind.is_empty());
    }

    proptest! {
        /// The stuck are the largest set in which each waits for members only: found by trying
        /// every set. Circles are what can reach each other.
        #[test]
        fn stuck_and_circles_by_brute_force(
            lists in prop::collection::vec(prop::collection::btree_set(0u32..7, 0..3), 7),
        ) {
            let on: BTreeMap<u32, Vec<u32>> = (0..)
                .zip(&lists)
                .map(|(rover, list)| (rover, list.iter().copied().filter(|r| *r != rover).collect()))
                .filter(|(_, list): &(u32, Vec<u32>)| !list.is_empty())
                .collect();
            let closed = |set: u32| (0..7).filter(|r| set >> r & 1 == 1).all(|rover| {
                on.get(&rover).is_some_and(|list| list.iter().all(|h| set >> h & 1 == 1))
            });
            let largest = (0u32..128).filter(|set| closed(*set)).fold(0, |all, set| all | set);
            let expected: BTreeSet<u32> = (0..7).filter(|r| largest >> r & 1 == 1).collect();
            let found = stuck(&on);
            prop_assert_eq!(&found, &expected);
            // Reachability by repeated squaring of the relation.
            let mut can = [[false; 7]; 7];
            for (a, list) in on.iter().filter(|(a, _)| found.contains(a)) {
                for b in list.iter().filter(|b| found.contains(b)) {
                    can[*a as usize][*b as usize] = true;
                }
            }
            for via in 0..7 {
                for a in 0..7 {
                    for b in 0..7 {
                        can[a][b] |= can[a][via] && can[via][b];
                    }
                }
            }
            let parts = circles(&on, &found);
            for a in 0..7u32 {
                for b in (0..7u32).filter(|b| *b != a) {
                    let both = can[a as usize][b as usize] && can[b as usize][a as usize];
                    let together = parts.iter().any(|part| part.contains(&a) && part.contains(&b));
                    prop_assert_eq!(both, together);
                }
            }
            for part in &parts {
                let waits = Waits { on: on.clone(), circles: parts.clone(), ..Waits::default() };
                let round = waits.round(part);
                prop_assert!(round.len() > 1 && part.contains(&round[0]));
                prop_assert_eq!(round.iter().min(), round.first());
                for (at, rover) in round.iter().enumerate() {
                    prop_assert!(on[rover].contains(&round[(at + 1) % round.len()]));
                }
            }
        }
    }
}
