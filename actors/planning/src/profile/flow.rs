//! The best choice among things that need each other: a closure of most weight.
//!
//! J.-C. Picard, *Maximal Closure of a Graph and Applications to Combinatorial Problems* (1976):
//! it is a minimum cut. The flow is found by E. Dinic's algorithm (1970).

/// No arc.
const NONE: u32 = u32::MAX;

/// More than all weights together; twice of it still is a number.
const ANY: i64 = 1 << 62;

/// A network of flow; kept for its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Flow {
    /// By node: its first arc.
    first: Vec<u32>,
    arcs: Vec<Arc>,
    /// By node: how many arcs it is from the source; 0 if it is not reached.
    level: Vec<u32>,
    /// By node: the arc that is to be tried next.
    current: Vec<u32>,
    queue: Vec<u32>,
    path: Vec<u32>,
    looked_at: u64,
}

/// An arc; its opposite is beside it.
#[derive(Clone, Copy, Debug)]
struct Arc {
    to: u32,
    room: i64,
    next: u32,
}

impl Flow {
    /// How many arcs were looked at.
    pub(super) fn looked_at(&self) -> u64 {
        self.looked_at
    }

    /// Chooses among things with weights, of which the first of each pair in `needs` can be chosen
    /// only with the second one: the greatest sum of weights, with the fewest things that have it.
    /// `chosen` says of each thing whether it is among them.
    pub(super) fn closure(
        &mut self,
        weights: &[i64],
        needs: &[(u32, u32)],
        chosen: &mut Vec<bool>,
    ) -> i64 {
        let (source, sink) = (weights.len() as u32, weights.len() as u32 + 1);
        self.arcs.clear();
        self.first.clear();
        self.first.resize(weights.len() + 2, NONE);
        let mut all = 0;
        for (thing, &weight) in (0..).zip(weights) {
            if weight > 0 {
                all += weight;
                self.add(source, thing, weight);
            } else if weight < 0 {
                self.add(thing, sink, -weight);
            }
        }
        for &(one, needed) in needs {
            self.add(one, needed, ANY);
        }
        let mut cut = 0;
        while self.find_levels(source, sink) {
            self.current.clone_from(&self.first);
            while let Some(more) = self.augment(source, sink) {
                cut += more;
            }
        }
        chosen.clear();
        chosen.extend(self.level[..weights.len()].iter().map(|level| *level > 0));
        all - cut
    }

    fn add(&mut self, from: u32, to: u32, room: i64) {
        for (from, to, room) in [(from, to, room), (to, from, 0)] {
            let arc = self.arcs.len() as u32;
            let next = std::mem::replace(&mut self.first[from as usize], arc);
            self.arcs.push(Arc { to, room, next });
        }
    }

    /// How far each node is from the source, by arcs with room; whether the sink is reached.
    fn find_levels(&mut self, source: u32, sink: u32) -> bool {
        self.level.clear();
        self.level.resize(self.first.len(), 0);
        self.queue.clear();
        self.level[source as usize] = 1;
        self.queue.push(source);
        let mut at = 0;
        while let Some(&node) = self.queue.get(at) {
            at += 1;
            let mut next = self.first[node as usize];
            while next != NONE {
                self.looked_at += 1;
                let arc = self.arcs[next as usize];
                if arc.room > 0 && self.level[arc.to as usize] == 0 {
                    self.level[arc.to as usize] = self.level[node as usize] + 1;
                    self.queue.push(arc.to);
                }
                next = arc.next;
            }
        }
        self.level[sink as usize] > 0
    }

    /// Sends as much as one more path takes, each arc of which leads one level on.
    fn augment(&mut self, source: u32, sink: u32) -> Option<i64> {
        self.path.clear();
        let mut node = source;
        while node != sink {
            let next = self.current[node as usize];
            if next == NONE {
                // A dead end: the arc that led here is not tried again.
                let arc = self.path.pop()?;
                node = self.arcs[arc as usize ^ 1].to;
                self.current[node as usize] = self.arcs[arc as usize].next;
                continue;
            }
            self.looked_at += 1;
            let arc = self.arcs[next as usize];
            if arc.room > 0 && self.level[arc.to as usize] == self.level[node as usize] + 1 {
                self.path.push(next);
                node = arc.to;
            } else {
                self.current[node as usize] = arc.next;
            }
        }
        let rooms = self.path.iter().map(|arc| self.arcs[*arc as usize].room);
        let more = rooms.min()?;
        for &arc in &self.path {
            self.arcs[arc as usize].room -= more;
            self.arcs[arc as usize ^ 1].room += more;
        }
        Some(more)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]

        /// No set that holds what its members need weighs more, and none that weighs as much has
        /// fewer members.
        #[test]
        fn a_closure_is_the_best_of_all_sets(
            weights in prop::collection::vec(-5..6i64, 0..9),
            needs in prop::collection::vec((0..8u32, 0..8u32), 0..14),
        ) {
            let many = weights.len() as u32;
            let needs: Vec<_> = needs.into_iter().filter(|(a, b)| *a.max(b) < many).collect();
            let (mut flow, mut chosen) = (Flow::default(), Vec::new());
            let found = flow.closure(&weights, &needs, &mut chosen);
            let holds = |set: u32| needs.iter().all(|(a, b)| set >> a & 1 == 0 || set >> b & 1 == 1);
            let weight = |set: u32| -> i64 {
                (0..many).filter(|at| set >> at & 1 == 1).map(|at| weights[at as usize]).sum()
            };
            let sets = (0..1u32 << many).filter(|set| holds(*set));
            let best = sets.map(|set| (weight(set), std::cmp::Reverse(set.count_ones()))).max();
            let set = (0..many).filter(|at| chosen[*at as usize]).fold(0, |set, at| set | 1 << at);
            prop_assert!(holds(set));
            prop_assert_eq!(Some((found, std::cmp::Reverse(set.count_ones()))), best);
            prop_assert_eq!(weight(set), found);
        }
    }
}
