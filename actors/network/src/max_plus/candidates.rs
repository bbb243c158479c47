//! Candidate paths (*network-guided*, section 3.3): to every leaf of the local neighbourhood graph,
//! to the goal if it lies in it, and the zero path.

use farside_worlds::VertexId;
use serde::{Deserialize, Serialize};

use crate::max_plus::lng::LocalGraph;

/// Where a candidate path leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Destination {
    /// The rover's goal, where it leaves the roadmap: the path's end is free afterwards.
    Goal,
    /// A leaf of the local neighbourhood graph. The path claims nothing after its end, unless the
    /// rover is there already: then it waits, and holds its vertex.
    Leaf,
    /// The zero path: the rover stays, and holds its vertex for ever.
    Stay,
}

/// A path that a rover may be assigned, with its unary payoff.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CandidatePath {
    /// Where it leads.
    pub destination: Destination,
    /// Where the rover is at the end of cycle 0, 1, 2, ... of the path; entry 0 is where it is
    /// now. Two equal entries at the start are a wait. The zero path has one entry.
    pub vertices: Vec<VertexId>,
    /// The unary payoff, noise and penalty included.
    pub payoff: f32,
}

impl CandidatePath {
    /// The path's length in cycles, waits included.
    pub fn length(&self) -> u32 {
        self.vertices.len() as u32 - 1
    }

    /// What the path does first.
    pub fn first_step(&self) -> FirstStep {
        match (
            self.vertices.first(),
            self.vertices.get(1),
            self.vertices.get(2),
        ) {
            (Some(here), Some(next), _) if here != next => FirstStep::Move(*next),
            (Some(_), Some(_), Some(then)) => FirstStep::Follow(*then),
            _ => FirstStep::Stay,
        }
    }

    /// The first vertex other than the one the path starts at.
    pub(crate) fn next_vertex(&self) -> Option<VertexId> {
        match self.first_step() {
            FirstStep::Move(v) | FirstStep::Follow(v) => Some(v),
            FirstStep::Stay => None,
        }
    }
}

/// What a path does in the cycle to come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FirstStep {
    /// It stays.
    Stay,
    /// It moves to this vertex.
    Move(VertexId),
    /// It waits, then moves to this vertex, which is occupied now: it may accelerate
    /// (section 3.5).
    Follow(VertexId),
}

/// The candidates of a rover at `from`: first the goal, then the leaves, ascending, last the zero
/// path, which is always there. Payoffs are zero; [`super::payoff`] fills them.
///
/// A rover on a leaf has a path of length 0 to it: a pocket to let others pass from. Without it the
/// zero path, worth so much less than any other, would be the only way to wait, and two rovers that
/// meet at a pocket would drive each other into it and out of it for ever.
///
/// A path whose first vertex is `occupied` begins with a wait, so that no path enters an occupied
/// vertex in the cycle to come (the rule that makes stopping safe, section 3.5).
pub(crate) fn candidates(
    graph: &LocalGraph,
    from: VertexId,
    goal: VertexId,
    occupied: impl Fn(VertexId) -> bool,
) -> Vec<CandidatePath> {
    let path = |destination, to| {
        let mut vertices = graph.path(from, to)?;
        if vertices.get(1).is_some_and(|&first| occupied(first)) {
            vertices.insert(0, from);
        }
        let payoff = 0.0;
        Some(CandidatePath {
            destination,
            vertices,
            payoff,
        })
    };
    let goal_path = path(Destination::Goal, goal).filter(|_| goal != from);
    let leaves = graph.leaves(from).filter(|&leaf| leaf != goal);
    let leaf_paths = leaves.filter_map(|leaf| path(Destination::Leaf, leaf));
    let stay = CandidatePath {
        destination: Destination::Stay,
        vertices: vec![from],
        payoff: 0.0,
    };
    goal_path
        .into_iter()
        .chain(leaf_paths)
        .chain([stay])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{grid, v};
    use farside_worlds::Roadmap;

    /// The lengths of all simple paths from `from`, by their last vertex, by plain enumeration.
    fn shortest_by_enumeration(map: &Roadmap, inside: &[VertexId], from: VertexId) -> Vec<u32> {
        fn walk(map: &Roadmap, inside: &[VertexId], path: &mut Vec<VertexId>, best: &mut [u32]) {
            let here = *path.last().unwrap();
            let length = path.len() as u32 - 1;
            best[here.0 as usize] = best[here.0 as usize].min(length);
            for &next in map.neighbors(here) {
                if inside.contains(&next) && !path.contains(&next) {
                    path.push(next);
                    walk(map, inside, path, best);
                    path.pop();
                }
            }
        }
        let mut best = vec![u32::MAX; map.len()];
        walk(map, inside, &mut vec![from], &mut best);
        best
    }

    #[test]
    fn candidates_agree_with_exhaustive_enumeration() {
        let map = grid(4, 3, &[(1, 2), (5, 9), (6, 7)]);
        for skipped in 0..map.len() as u32 {
            let inside: Vec<_> = map.vertices().filter(|&u| u != v(skipped)).collect();
            let graph = LocalGraph::over(&map, inside.clone());
            for &from in &inside {
                let best = shortest_by_enumeration(&map, &inside, from);
                let goal = inside[(from.0 as usize * 5 + 3) % inside.len()];
                let found = candidates(&graph, from, goal, |_| false);
                let expected: Vec<_> = graph.leaves(from).filter(|&l| l != goal).collect();
                let ends: Vec<_> = found
                    .iter()
                    .filter(|path| path.destination == Destination::Leaf)
                    .map(|path| *path.vertices.last().unwrap())
                    .collect();
                assert_eq!(ends, expected);
                for path in &found {
                    let end = *path.vertices.last().unwrap();
                    assert_eq!(path.length(), best[end.0 as usize]);
                    assert!(
                        path.vertices
                            .windows(2)
                            .all(|s| map.are_adjacent(s[0], s[1]))
                    );
                }
                let reachable = best[goal.0 as usize] != u32::MAX && goal != from;
                let first_is_goal = found[0].destination == Destination::Goal;
                assert_eq!(first_is_goal, reachable);
                assert_eq!(found.last().unwrap().destination, Destination::Stay);
            }
        }
    }

    #[test]
    fn an_occupied_first_vertex_costs_one_wait() {
        let map = grid(4, 1, &[]);
        let graph = LocalGraph::over(&map, map.vertices().collect());
        let found = candidates(&graph, v(1), v(3), |u| u == v(2));
        assert_eq!(found[0].vertices, [v(1), v(1), v(2), v(3)]);
        assert_eq!(found[0].first_step(), FirstStep::Follow(v(2)));
        assert_eq!(found[1].first_step(), FirstStep::Move(v(0)));
        assert_eq!(found[2].first_step(), FirstStep::Stay);
        assert_eq!((found.len(), found[0].length()), (3, 3));
    }
}
