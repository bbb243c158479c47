//! Which sets of tasks need no luck: well-formed instances.

use std::collections::VecDeque;

use super::Roadmap;
use crate::ids::VertexId;

/// A task that keeps an instance from being well-formed: every path from its start to its goal
/// leads over the start or goal of another task.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Blocked {
    /// Which task, from 0.
    pub task: usize,
    /// Of a path that leads over as few starts and goals of others as any: these vertices in order
    /// from the start, each with the task that begins or ends there (twice, if two do). At least
    /// one. If these tasks were elsewhere, this one would not be blocked.
    pub over: Vec<(VertexId, usize)>,
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
/// let over = vec![(v(1), 1)];
/// assert_eq!(well_formed(&map, &stay), [Blocked { task: 0, over }]);
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
    let search = Search { roadmap, ends };
    let all = tasks.iter().enumerate();
    all.filter_map(|(task, &(start, goal))| search.blocked(task, start, goal))
        .collect()
}

struct Search<'a> {
    roadmap: &'a Roadmap,
    /// The tasks that begin or end at each vertex, sorted.
    ends: Vec<Vec<usize>>,
}

impl Search<'_> {
    /// The other tasks that begin or end at `v`.
    fn others(&self, task: usize, v: VertexId) -> impl Iterator<Item = usize> {
        let all = self.ends[v.0 as usize].iter().copied();
        all.filter(move |other| *other != task)
    }

    fn blocked(&self, task: usize, start: VertexId, goal: VertexId) -> Option<Blocked> {
        // A path over fewest ends of others: their vertices cost 1, all else costs nothing, so that
        // a queue with two ends keeps the order. Searched from the goal, to be read from the start.
        let taken = |v| self.others(task, v).next().is_some();
        let mut next: Vec<Option<VertexId>> = vec![None; self.roadmap.len()];
        let mut done = vec![false; self.roadmap.len()];
        let mut queue = VecDeque::from([(goal, goal)]);
        while let Some((here, towards)) = queue.pop_front() {
            if std::mem::replace(&mut done[here.0 as usize], true) {
                continue;
            }
            next[here.0 as usize] = Some(towards);
            if here == start {
                break;
            }
            for &beside in self.roadmap.neighbors(here) {
                match taken(beside) {
                    _ if done[beside.0 as usize] => {}
                    true => queue.push_back((beside, here)),
                    false => queue.push_front((beside, here)),
                }
            }
        }
        let mut over = Vec::new();
        let mut here = start;
        loop {
            over.extend(self.others(task, here).map(|other| (here, other)));
            if here == goal {
                break;
            }
            here = next[here.0 as usize].expect("a roadmap is connected");
        }
        (!over.is_empty()).then_some(Blocked { task, over })
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
    fn those_in_the_way_are_named_in_order() {
        let map = line(7);
        let blocked = |pairs: &[(u32, u32)]| well_formed(&map, &tasks(pairs));
        let is = |task, over: &[(u32, usize)]| {
            let over = over.iter().map(|&(v, task)| (VertexId(v), task)).collect();
            Blocked { task, over }
        };
        assert_eq!(blocked(&[]), []);
        assert_eq!(blocked(&[(0, 2), (4, 3), (5, 6)]), []);
        assert_eq!(
            blocked(&[(0, 6), (2, 2), (5, 4)]),
            [is(0, &[(2, 1), (4, 2), (5, 2)])]
        );
        // One ends where the other begins.
        assert_eq!(
            blocked(&[(0, 3), (3, 5)]),
            [is(0, &[(3, 1)]), is(1, &[(3, 0)])]
        );
        // Two in one place.
        assert_eq!(
            blocked(&[(0, 2), (1, 3), (4, 1)])[0],
            is(0, &[(1, 1), (1, 2)])
        );
        // Who stays is in nobody's way but those who must pass.
        assert_eq!(blocked(&[(3, 3), (0, 1)]), []);
    }

    /// The fewest vertices of `taken` on any simple path from `here` to `goal`, by trying them all.
    fn fewest(
        map: &Roadmap,
        here: VertexId,
        goal: VertexId,
        taken: &[VertexId],
        used: &mut Vec<VertexId>,
    ) -> Option<usize> {
        if used.contains(&here) {
            return None;
        }
        let own = usize::from(taken.contains(&here));
        if here == goal {
            return Some(own);
        }
        used.push(here);
        let rest = map
            .neighbors(here)
            .iter()
            .filter_map(|&next| fewest(map, next, goal, taken, used))
            .min();
        used.pop();
        rest.map(|rest| rest + own)
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
            let found = well_formed(map, &tasks);
            for (task, &(start, goal)) in tasks.iter().enumerate() {
                let taken: Vec<VertexId> = tasks
                    .iter()
                    .enumerate()
                    .filter(|(other, _)| *other != task)
                    .flat_map(|(_, &(start, goal))| [start, goal])
                    .collect();
                let expected = fewest(map, start, goal, &taken, &mut Vec::new()).unwrap();
                let blocked = found.iter().find(|blocked| blocked.task == task);
                let mut over = blocked.map_or_else(Vec::new, |blocked| blocked.over.clone());
                for &(v, other) in &over {
                    let (start, goal) = tasks[other];
                    prop_assert!(other != task && (v == start || v == goal));
                }
                // Without those named, nothing is in the way.
                let mut fewer = vec![tasks[task]];
                let named = |other: &usize| over.iter().any(|(_, named)| named == other);
                let others = (0..tasks.len()).filter(|other| *other != task && !named(other));
                fewer.extend(others.map(|other| tasks[other]));
                let verdict = well_formed(map, &fewer);
                prop_assert!(verdict.iter().all(|blocked| blocked.task != 0));
                over.dedup_by_key(|(v, _)| *v);
                prop_assert_eq!(over.len(), expected);
            }
        }
    }
}
