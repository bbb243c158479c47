//! Which sets of tasks need no luck: well-formed instances.

use super::{Roadmap, VertexId};

/// A task that keeps an instance from being well-formed: every path from its start to its goal
/// leads over the start or goal of another task.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Blocked {
    /// Which task, from 0.
    pub task: usize,
    /// The tasks whose start or goal stands in the way first, sorted: one of these must be elsewhere
    /// before anything is gained. At least one.
    pub by: Vec<usize>,
}

/// The tasks that keep an instance from being **well-formed**: those whose goal cannot be reached
/// from their start while the starts and goals of all other tasks are avoided. None if the
/// instance is well-formed.
///
/// On well-formed instances revised prioritised planning finds paths for all, in any order of the
/// rovers, each of which may wait at its start until the way is free for good: nobody who waits at
/// a start or stays at a goal is ever in the way (Cap, Novak, Kleiner and Selecky, *Prioritized
/// planning algorithms for trajectory coordination of multiple mobile robots*, IEEE T-ASE 12(3),
/// 2015, arXiv 1409.2399).
///
/// A path's own ends count, too: a task that ends where another begins is blocked, and so is that
/// other one.
///
/// ```
/// use farside_worlds::{Blocked, Roadmap, VertexId, well_formed};
/// use nalgebra::Point2;
/// // 0 - 1 - 2, and 3 beside 1.
/// let at = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (1.0, 1.0)].map(|(x, y)| Point2::new(x, y));
/// let v = VertexId;
/// let edges = vec![(v(0), v(1)), (v(1), v(2)), (v(1), v(3))];
/// let map = Roadmap::new("tee", at.to_vec(), edges, vec![v(0)])?;
/// assert_eq!(well_formed(&map, &[(v(0), v(2)), (v(3), v(3))]), []);
/// // The second rover stays in the first one's way.
/// let stay = [(v(0), v(2)), (v(3), v(1))];
/// assert_eq!(well_formed(&map, &stay), [Blocked { task: 0, by: vec![1] }]);
/// # Ok::<(), farside_worlds::RoadmapError>(())
/// ```
///
/// # Panics
/// When a task begins or ends at a vertex that is not in the roadmap: a bug in the caller.
pub fn well_formed(roadmap: &Roadmap, tasks: &[(VertexId, VertexId)]) -> Vec<Blocked> {
    let mut ends = vec![Vec::new(); roadmap.len()];
    for (task, &(start, goal)) in tasks.iter().enumerate() {
        ends[start.0 as usize].push(task);
        if goal != start {
            ends[goal.0 as usize].push(task);
        }
    }
    let mut search = Search {
        roadmap,
        ends,
        reached: vec![usize::MAX; roadmap.len()],
    };
    let all = tasks.iter().enumerate();
    all.filter_map(|(task, &(start, goal))| search.blocked(task, start, goal))
        .collect()
}

struct Search<'a> {
    roadmap: &'a Roadmap,
    /// The tasks that begin or end at each vertex, sorted.
    ends: Vec<Vec<usize>>,
    /// The last task for which the vertex was looked at.
    reached: Vec<usize>,
}

impl Search<'_> {
    fn blocked(&mut self, task: usize, start: VertexId, goal: VertexId) -> Option<Blocked> {
        let mut by = Vec::new();
        let mut stack = vec![start];
        self.reached[start.0 as usize] = task;
        while let Some(here) = stack.pop() {
            let others = self.ends[here.0 as usize].iter().copied();
            let before = by.len();
            by.extend(others.filter(|other| *other != task));
            if by.len() > before {
                continue;
            }
            if here == goal {
                return None;
            }
            for &next in self.roadmap.neighbors(here) {
                let last = &mut self.reached[next.0 as usize];
                if *last != task {
                    *last = task;
                    stack.push(next);
                }
            }
        }
        by.sort_unstable();
        by.dedup();
        Some(Blocked { task, by })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;
    use proptest::prelude::*;

    use super::*;

    fn line(vertices: u32) -> Roadmap {
        let positions_m = (0..vertices)
            .map(|i| Point2::new(f64::from(i), 0.0))
            .collect();
        let edges = (1..vertices)
            .map(|i| (VertexId(i - 1), VertexId(i)))
            .collect();
        Roadmap::new("line", positions_m, edges, vec![VertexId(0)]).unwrap()
    }

    fn tasks(pairs: &[(u32, u32)]) -> Vec<(VertexId, VertexId)> {
        let task = |&(start, goal)| (VertexId(start), VertexId(goal));
        pairs.iter().map(task).collect()
    }

    #[test]
    fn who_is_met_first_is_named() {
        let map = line(7);
        let blocked = |pairs: &[(u32, u32)]| well_formed(&map, &tasks(pairs));
        let is = |task, by: &[usize]| Blocked {
            task,
            by: by.to_vec(),
        };
        assert_eq!(blocked(&[]), []);
        assert_eq!(blocked(&[(0, 2), (4, 3), (5, 6)]), []);
        // 1 and 2 both stand between, but 2 cannot matter before 1 does.
        assert_eq!(blocked(&[(0, 6), (2, 2), (4, 5)]), [is(0, &[1])]);
        // From both sides.
        assert_eq!(blocked(&[(3, 6), (2, 2), (4, 4)]), [is(0, &[1, 2])]);
        // One ends where the other begins; they cannot even change places in turn.
        assert_eq!(blocked(&[(0, 3), (3, 5)]), [is(0, &[1]), is(1, &[0])]);
        // Who stays is in nobody's way but those who must pass.
        assert_eq!(blocked(&[(3, 3), (0, 1)]), []);
    }

    /// Whether some simple path from `here` to `goal` avoids what is forbidden, by trying them all.
    fn some_path(map: &Roadmap, here: VertexId, goal: VertexId, used: &mut Vec<VertexId>) -> bool {
        if used.contains(&here) {
            return false;
        }
        if here == goal {
            return true;
        }
        used.push(here);
        let found = map
            .neighbors(here)
            .iter()
            .any(|&next| some_path(map, next, goal, used));
        used.pop();
        found
    }

    proptest! {
        /// Against every simple path on grids of at most 3 by 4 cells with walls.
        #[test]
        fn agrees_with_trying_every_path(
            width in 1u32..=4,
            height in 1u32..=3,
            seed: u64,
            picks in prop::collection::vec((0usize..12, 0usize..12), 1..5),
        ) {
            let grid = crate::GridMap::random(width, height, 0.25, seed).unwrap();
            let world = crate::GridWorld::new("tiny.map", &grid, 1.0, &[]).unwrap();
            let map = world.roadmap();
            let vertex = |pick: usize| VertexId((pick % map.len()) as u32);
            let tasks: Vec<_> = picks.iter().map(|&(a, b)| (vertex(a), vertex(b))).collect();
            let found: Vec<usize> = well_formed(map, &tasks).iter().map(|b| b.task).collect();
            let expected: Vec<usize> = (0..tasks.len())
                .filter(|&task| {
                    let mut others: Vec<VertexId> = tasks
                        .iter()
                        .enumerate()
                        .filter(|(other, _)| *other != task)
                        .flat_map(|(_, &(start, goal))| [start, goal])
                        .collect();
                    let (start, goal) = tasks[task];
                    // Vertices that may not be used pass for used ones; the goal itself, too.
                    others.contains(&goal) || !some_path(map, start, goal, &mut others)
                })
                .collect();
            prop_assert_eq!(found, expected);
        }

        /// Moving one of those named away is needed: without the others, nothing changes.
        #[test]
        fn those_named_block_by_themselves(
            seed: u64,
            picks in prop::collection::vec((0usize..25, 0usize..25), 2..8),
        ) {
            let grid = crate::GridMap::random(5, 5, 0.2, seed).unwrap();
            let world = crate::GridWorld::new("tiny.map", &grid, 1.0, &[]).unwrap();
            let map = world.roadmap();
            let vertex = |pick: usize| VertexId((pick % map.len()) as u32);
            let tasks: Vec<_> = picks.iter().map(|&(a, b)| (vertex(a), vertex(b))).collect();
            for blocked in well_formed(map, &tasks) {
                let mut few = vec![tasks[blocked.task]];
                few.extend(blocked.by.iter().map(|&other| tasks[other]));
                let verdict = well_formed(map, &few);
                prop_assert_eq!(verdict.first().map(|b| b.task), Some(0));
                prop_assert_eq!(verdict[0].by.len(), blocked.by.len());
            }
        }
    }
}
