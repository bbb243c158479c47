//! Who waits for whom, and who waits in a circle.

use std::collections::{BTreeSet, VecDeque};
use std::fmt;

use serde::Serialize;

/// Which agents wait for which others, by their numbers from 0. An agent waits for all whom it has
/// an edge to: it goes on when none of them is in its way.
///
/// ```
/// use farside_actors::invariants::WaitGraph;
/// let mut waits = WaitGraph::new(4);
/// waits.add(0, 2);
/// waits.add(2, 3);
/// waits.add(3, 2);
/// assert_eq!(waits.cycles(), [[2, 3]]);
/// let names = ["rover_01", "rover_02", "rover_04", "rover_17"];
/// let cycle = &waits.named_cycles(|rover| (names[rover].to_owned(), Some(rover + 10)))[0];
/// let text = "rover_04 at 12 waits for rover_17 at 13, which waits for rover_04";
/// assert_eq!(cycle.to_string(), text);
/// waits.remove(3, 2);
/// assert!(waits.cycles().is_empty());
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WaitGraph {
    waits: Vec<BTreeSet<usize>>,
}

impl WaitGraph {
    /// So many agents, none of which waits.
    pub fn new(agents: usize) -> Self {
        WaitGraph {
            waits: vec![BTreeSet::new(); agents],
        }
    }

    /// How many agents there are.
    pub fn agents(&self) -> usize {
        self.waits.len()
    }

    /// One more agent; returns its number.
    pub fn add_agent(&mut self) -> usize {
        self.waits.push(BTreeSet::new());
        self.waits.len() - 1
    }

    /// `agent` waits for `other` too. An agent may wait for itself.
    ///
    /// # Panics
    /// When there is no such agent: a bug in the caller, here and below.
    pub fn add(&mut self, agent: usize, other: usize) {
        assert!(other < self.waits.len(), "there is no agent {other}");
        self.waits[agent].insert(other);
    }

    /// `agent` no longer waits for `other`.
    pub fn remove(&mut self, agent: usize, other: usize) {
        self.waits[agent].remove(&other);
    }

    /// `agent` waits for nobody.
    pub fn clear(&mut self, agent: usize) {
        self.waits[agent].clear();
    }

    /// For whom `agent` waits, ascending.
    pub fn waits_for(&self, agent: usize) -> impl Iterator<Item = usize> + '_ {
        self.waits[agent].iter().copied()
    }

    /// The sets of agents of which each waits, in one step or several, for each other and for
    /// itself: the strongly connected components that hold a cycle. Each ascending; the smallest
    /// set first, of equals the one with the lowest numbers.
    pub fn knots(&self) -> Vec<Vec<usize>> {
        let mut knots = Search::new(self).components();
        knots.retain(|knot| knot.len() > 1 || self.waits[knot[0]].contains(&knot[0]));
        for knot in &mut knots {
            knot.sort_unstable();
        }
        knots.sort_by(|a, b| (a.len(), a).cmp(&(b.len(), b)));
        knots
    }

    /// A cycle of each knot, each agent followed by one that it waits for: the shortest, of several
    /// the one with the lowest numbers, from its lowest number on. The shortest cycle first.
    ///
    /// Where nobody waits for more than one other, these are all cycles there are.
    pub fn cycles(&self) -> Vec<Vec<usize>> {
        let mut inside = vec![usize::MAX; self.waits.len()];
        let knots = self.knots();
        for (number, knot) in knots.iter().enumerate() {
            for &agent in knot {
                inside[agent] = number;
            }
        }
        let in_knots = knots.iter().enumerate();
        let mut cycles: Vec<Vec<usize>> = in_knots
            .map(|(number, knot)| self.shortest(knot, |agent| inside[agent] == number))
            .collect();
        cycles.sort_by(|a, b| (a.len(), a).cmp(&(b.len(), b)));
        cycles
    }

    /// The cycles with agents' names and places, as `agent` has them.
    pub fn named_cycles<V>(
        &self,
        agent: impl Fn(usize) -> (String, Option<V>),
    ) -> Vec<WaitCycle<V>> {
        let waiter = |number: usize| {
            let (agent, at) = agent(number);
            Waiter { agent, at }
        };
        let named = |cycle: Vec<usize>| WaitCycle(cycle.into_iter().map(waiter).collect());
        self.cycles().into_iter().map(named).collect()
    }

    /// The shortest cycle of a knot, see [`WaitGraph::cycles`].
    fn shortest(&self, knot: &[usize], is_inside: impl Fn(usize) -> bool) -> Vec<usize> {
        let mut best = Vec::new();
        // In a ring there is but one, and it may be long.
        let only = |agent: usize| {
            self.waits_for(agent)
                .filter(|&other| is_inside(other))
                .count()
                == 1
        };
        let starts = if knot.iter().all(|&agent| only(agent)) {
            1
        } else {
            knot.len()
        };
        let mut before = vec![None; self.waits.len()];
        for &start in &knot[..starts] {
            for &agent in knot {
                before[agent] = None;
            }
            let cycle = self.through(start, &mut before, |other| {
                is_inside(other) && other > start
            });
            if !cycle.is_empty() && (best.is_empty() || cycle.len() < best.len()) {
                best = cycle;
            }
        }
        best
    }

    /// The shortest cycle through `start` and otherwise only agents that `may` be on it; empty if
    /// there is none. Searched breadth first, low numbers first: of the shortest, the lowest.
    fn through(
        &self,
        start: usize,
        before: &mut [Option<usize>],
        may: impl Fn(usize) -> bool,
    ) -> Vec<usize> {
        let mut queue = VecDeque::from([start]);
        while let Some(agent) = queue.pop_front() {
            for other in self.waits_for(agent) {
                if other == start {
                    let back = std::iter::successors(Some(agent), |&agent| before[agent]);
                    let mut cycle: Vec<usize> = back.collect();
                    cycle.reverse();
                    return cycle;
                }
                if may(other) && before[other].is_none() {
                    before[other] = Some(agent);
                    queue.push_back(other);
                }
            }
        }
        Vec::new()
    }
}

/// Tarjan's search for strongly connected components (*Depth-first search and linear graph
/// algorithms*, 1972), with a stack of its own: teams are large and threads' stacks are not.
struct Search<'a> {
    graph: &'a WaitGraph,
    /// The order in which agents were met.
    met: Vec<Option<usize>>,
    /// The earliest agent on the stack that each is known to lead to.
    lowest: Vec<usize>,
    on_stack: Vec<bool>,
    stack: Vec<usize>,
    found: Vec<Vec<usize>>,
    count: usize,
}

impl<'a> Search<'a> {
    fn new(graph: &'a WaitGraph) -> Self {
        let agents = graph.agents();
        Search {
            graph,
            met: vec![None; agents],
            lowest: vec![0; agents],
            on_stack: vec![false; agents],
            stack: Vec::new(),
            found: Vec::new(),
            count: 0,
        }
    }

    fn components(mut self) -> Vec<Vec<usize>> {
        for root in 0..self.graph.agents() {
            if self.met[root].is_none() {
                self.search(root);
            }
        }
        self.found
    }

    fn meet(&mut self, agent: usize) {
        self.met[agent] = Some(self.count);
        self.lowest[agent] = self.count;
        self.count += 1;
        self.stack.push(agent);
        self.on_stack[agent] = true;
    }

    fn search(&mut self, root: usize) {
        let graph = self.graph;
        self.meet(root);
        let mut path = vec![(root, graph.waits[root].iter())];
        while let Some((agent, rest)) = path.last_mut() {
            let agent = *agent;
            match rest.next() {
                Some(&other) => match self.met[other] {
                    None => {
                        self.meet(other);
                        path.push((other, graph.waits[other].iter()));
                    }
                    Some(met) if self.on_stack[other] => {
                        self.lowest[agent] = self.lowest[agent].min(met);
                    }
                    Some(_) => {}
                },
                None => {
                    path.pop();
                    if let Some(&(parent, _)) = path.last() {
                        self.lowest[parent] = self.lowest[parent].min(self.lowest[agent]);
                    }
                    self.close(agent);
                }
            }
        }
    }

    /// All below `agent` has been seen: if it leads to nobody earlier, a component is complete.
    fn close(&mut self, agent: usize) {
        if self.met[agent] != Some(self.lowest[agent]) {
            return;
        }
        let at = self.stack.iter().rposition(|&other| other == agent);
        let component = self.stack.split_off(at.unwrap_or(0));
        for &member in &component {
            self.on_stack[member] = false;
        }
        self.found.push(component);
    }
}

/// An agent that waits, and where it is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Waiter<V> {
    /// Its name.
    pub agent: String,
    /// The vertex it stands at, or is bound for.
    pub at: Option<V>,
}

/// Agents of which each waits for the next, and the last for the first.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct WaitCycle<V>(pub Vec<Waiter<V>>);

impl<V: fmt::Display> fmt::Display for WaitCycle<V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, Waiter { agent, at: place }) in self.0.iter().enumerate() {
            f.write_str(match at {
                0 => "",
                1 => " waits for ",
                _ => ", which waits for ",
            })?;
            f.write_str(agent)?;
            if let Some(place) = place {
                write!(f, " at {place}")?;
            }
        }
        match self.0.as_slice() {
            [] => Ok(()),
            [_] => f.write_str(" waits for itself"),
            [first, ..] => write!(f, ", which waits for {}", first.agent),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn graph(agents: usize, edges: &[(usize, usize)]) -> WaitGraph {
        let mut graph = WaitGraph::new(agents);
        for &(a, b) in edges {
            graph.add(a, b);
        }
        graph
    }

    #[test]
    fn cycles_are_named_in_a_sentence() {
        let named = |cycle: &[usize]| {
            let waiter = |&i: &usize| Waiter {
                agent: format!("r{i}"),
                at: (i != 7).then_some(i * 10),
            };
            WaitCycle(cycle.iter().map(waiter).collect()).to_string()
        };
        assert_eq!(named(&[3]), "r3 at 30 waits for itself");
        let three = "r1 at 10 waits for r7, which waits for r2 at 20, which waits for r1";
        assert_eq!(named(&[1, 7, 2]), three);
    }

    #[test]
    fn a_ring_of_thousands_is_found_at_once() {
        let count = 20_000;
        let mut ring = WaitGraph::new(count);
        for i in 0..count {
            ring.add(i, (i + 1) % count);
        }
        let cycles = ring.cycles();
        assert_eq!((cycles.len(), cycles[0].len()), (1, count));
        ring.remove(count - 1, 0);
        assert!(ring.cycles().is_empty());
    }

    /// All simple cycles, each from its lowest number on.
    fn all_cycles(graph: &WaitGraph) -> Vec<Vec<usize>> {
        fn extend(graph: &WaitGraph, path: &mut Vec<usize>, found: &mut Vec<Vec<usize>>) {
            for next in graph.waits_for(path[path.len() - 1]) {
                if next == path[0] {
                    found.push(path.clone());
                } else if next > path[0] && !path.contains(&next) {
                    path.push(next);
                    extend(graph, path, found);
                    path.pop();
                }
            }
        }
        let mut found = Vec::new();
        for start in 0..graph.agents() {
            extend(graph, &mut vec![start], &mut found);
        }
        found
    }

    /// Who waits for whom in one step or several.
    fn reach(graph: &WaitGraph) -> Vec<Vec<bool>> {
        let n = graph.agents();
        let row = |a| (0..n).map(|b| graph.waits_for(a).any(|x| x == b)).collect();
        let mut reach: Vec<Vec<bool>> = (0..n).map(row).collect();
        for via in 0..n {
            for a in 0..n {
                for b in 0..n {
                    reach[a][b] |= reach[a][via] && reach[via][b];
                }
            }
        }
        reach
    }

    proptest! {
        #[test]
        fn knots_and_cycles_are_those_of_brute_force(
            agents in 1..7usize,
            edges in prop::collection::vec((0..7usize, 0..7usize), 0..14),
        ) {
            let edges: Vec<_> = edges.iter().map(|&(a, b)| (a % agents, b % agents)).collect();
            let graph = graph(agents, &edges);
            let reach = reach(&graph);
            let together = |a: usize, b: usize| reach[a][b] && reach[b][a];
            let mut knots: Vec<Vec<usize>> = Vec::new();
            for a in (0..agents).filter(|&a| reach[a][a]) {
                if !knots.iter().any(|knot| knot.contains(&a)) {
                    knots.push((0..agents).filter(|&b| together(a, b)).collect());
                }
            }
            knots.sort_by_key(|knot| (knot.len(), knot.clone()));
            prop_assert_eq!(&graph.knots(), &knots);
            let all = all_cycles(&graph);
            let best = |knot: &Vec<usize>| {
                let inside = all.iter().filter(|cycle| knot.contains(&cycle[0]));
                inside.min_by_key(|cycle| (cycle.len(), (*cycle).clone())).cloned().unwrap()
            };
            let mut cycles: Vec<Vec<usize>> = knots.iter().map(best).collect();
            cycles.sort_by_key(|cycle| (cycle.len(), cycle.clone()));
            prop_assert_eq!(graph.cycles(), cycles);
        }

        #[test]
        fn where_nobody_waits_for_two_all_cycles_are_found(
            next in prop::collection::vec(prop::option::of(0..12usize), 1..12),
        ) {
            let count = next.len();
            let edges = next.iter().enumerate().filter_map(|(a, b)| Some((a, (*b)?)));
            let edges: Vec<_> = edges.filter(|&(_, b)| b < count).collect();
            let graph = graph(count, &edges);
            let mut all = all_cycles(&graph);
            all.sort_by_key(|cycle| (cycle.len(), cycle.clone()));
            prop_assert_eq!(graph.cycles(), all);
        }
    }
}
