//! One step of a whole team: priority inheritance with backtracking (Okumura, Machida, Defago and
//! Tamura, *Priority inheritance with backtracking for iterative multi-agent path finding*, AIJ
//! 310, 2022), with the pull that lets two rovers change places in a corridor (Okumura, *Improving
//! LaCAM for scalable eventually optimal multi-agent pathfinding*, IJCAI 2023, section 5).
//!
//! Rings may not turn here ([the model](super::super#the-model)), so a rover does not follow a
//! chain that ends at its own vertex, as none swaps.

use farside::random::Stream;
use farside_worlds::roadmap::DistancesTo;
use farside_worlds::{Roadmap, VertexId};

/// No rover.
const NOBODY: u32 = u32::MAX;
/// Not decided.
const OPEN: VertexId = VertexId(u32::MAX);

/// What a step is made with, kept from one to the next so that nothing is allocated anew.
pub(super) struct Stepper<'a> {
    map: &'a Roadmap,
    goals: &'a [VertexId],
    left: &'a [DistancesTo<'a>],
    /// Who is at each vertex before the step, and after it as far as is decided.
    now: Vec<u32>,
    next: Vec<u32>,
    from: Vec<VertexId>,
    to: Vec<VertexId>,
}

impl<'a> Stepper<'a> {
    /// For rovers with these goals, and the distances to them.
    pub(super) fn new(
        map: &'a Roadmap,
        goals: &'a [VertexId],
        left: &'a [DistancesTo<'a>],
    ) -> Self {
        Stepper {
            map,
            goals,
            left,
            now: vec![NOBODY; map.len()],
            next: vec![NOBODY; map.len()],
            from: Vec::new(),
            to: Vec::new(),
        }
    }

    /// Where all rovers can be one step after `from`, with these rovers at these vertices, the
    /// others as they wish, those first that come first in `order`. None if there is no such step,
    /// or none is found.
    pub(super) fn step(
        &mut self,
        from: &[VertexId],
        fixed: &[(u32, VertexId)],
        order: &[u32],
        draws: &mut Stream,
    ) -> Option<Vec<VertexId>> {
        self.from.clear();
        self.from.extend_from_slice(from);
        self.to.clear();
        self.to.resize(from.len(), OPEN);
        for (rover, at) in (0..).zip(from) {
            self.now[at.0 as usize] = rover;
        }
        let is_made = self.fix(fixed) && self.decide_all(order, draws);
        for (at, to) in from.iter().zip(&self.to) {
            self.now[at.0 as usize] = NOBODY;
            if *to != OPEN {
                self.next[to.0 as usize] = NOBODY;
            }
        }
        is_made.then(|| self.to.clone())
    }

    /// Whether these moves can be made together.
    fn fix(&mut self, fixed: &[(u32, VertexId)]) -> bool {
        fixed.iter().all(|&(rover, to)| {
            let is_free = self.taken_by(to) == NOBODY && !self.closes_ring(rover, to);
            if is_free {
                self.take(rover, to);
            }
            is_free
        })
    }

    fn decide_all(&mut self, order: &[u32], draws: &mut Stream) -> bool {
        let mut all = order.iter();
        all.all(|&rover| self.to[rover as usize] != OPEN || self.decide(rover, draws))
    }

    /// Gives a rover its next vertex, and all whom it moves theirs. If it has none but its own, it
    /// stays there, and the answer is no.
    fn decide(&mut self, rover: u32, draws: &mut Stream) -> bool {
        let here = self.from[rover as usize];
        let mut wishes: Vec<(u32, u64, VertexId)> = self
            .map
            .neighbors(here)
            .iter()
            .map(|&v| (self.left(rover, v), draws.next_u64(), v))
            .collect();
        wishes.push((self.left(rover, here), draws.next_u64(), here));
        wishes.sort_unstable();
        let pulled = self.whom_to_pull(rover, wishes[0].2);
        if pulled.is_some() {
            wishes.reverse();
        }
        for (place, &(.., to)) in wishes.iter().enumerate() {
            if self.taken_by(to) != NOBODY || self.closes_ring(rover, to) {
                continue;
            }
            self.take(rover, to);
            let ahead = self.now[to.0 as usize];
            let inherits = ahead != NOBODY && ahead != rover && self.to[ahead as usize] == OPEN;
            if inherits && !self.decide(ahead, draws) {
                continue;
            }
            if let Some(other) = pulled.filter(|_| place == 0)
                && self.to[other as usize] == OPEN
                && self.taken_by(here) == NOBODY
                && !self.closes_ring(other, here)
            {
                self.take(other, here);
            }
            return true;
        }
        self.take(rover, here);
        false
    }

    fn left(&self, rover: u32, at: VertexId) -> u32 {
        self.left[rover as usize].from(at)
    }

    fn taken_by(&self, at: VertexId) -> u32 {
        self.next[at.0 as usize]
    }

    fn take(&mut self, rover: u32, to: VertexId) {
        self.next[to.0 as usize] = rover;
        self.to[rover as usize] = to;
    }

    /// Whether a chain of rovers, each of which is decided to go where the next one leaves, leads
    /// from `to` back to where the rover stands.
    fn closes_ring(&self, rover: u32, to: VertexId) -> bool {
        let here = self.from[rover as usize];
        let mut at = to;
        while at != here {
            let ahead = self.now[at.0 as usize];
            if ahead == NOBODY {
                return false;
            }
            let next = self.to[ahead as usize];
            if next == OPEN || next == at {
                return false;
            }
            at = next;
        }
        to != here
    }

    /// The rover with which this one has to change places and can, if there is one: the one in its
    /// way, or one that would be after its next step.
    fn whom_to_pull(&self, rover: u32, wish: VertexId) -> Option<u32> {
        let here = self.from[rover as usize];
        if wish == here {
            return None;
        }
        let ahead = self.now[wish.0 as usize];
        if ahead != NOBODY
            && self.to[ahead as usize] == OPEN
            && self.must_swap((rover, here), (ahead, wish))
            && self.can_swap(here, wish)
        {
            return Some(ahead);
        }
        let beside = self.map.neighbors(here).iter();
        let mut behind = beside.map(|v| (self.now[v.0 as usize], *v));
        let found = behind.find(|&(other, at)| {
            other != NOBODY
                && at != wish
                && self.must_swap((other, here), (rover, wish))
                && self.can_swap(wish, here)
        });
        found.map(|(other, _)| other)
    }

    /// The only way on from `at` for who comes from `before`: the number of ways, and the last of
    /// them. A dead end in which a rover stands at its goal is none.
    fn ways_on(&self, at: VertexId, before: VertexId) -> (usize, Option<VertexId>) {
        let leads_on = |v: VertexId| {
            let who = self.now[v.0 as usize];
            let is_home = who != NOBODY && self.goals[who as usize] == v;
            v != before && !(is_home && self.map.neighbors(v).len() == 1)
        };
        let mut count = 0;
        let mut last = None;
        for &v in self.map.neighbors(at) {
            if leads_on(v) {
                count += 1;
                last = Some(v);
            }
        }
        (count, last)
    }

    /// Whether one rover, driving the other before it, cannot pass it before it has come to where
    /// it wants to go, while the other wants to go the other way.
    fn must_swap(&self, pusher: (u32, VertexId), driven: (u32, VertexId)) -> bool {
        let ((pusher, mut behind), (driven, mut front)) = (pusher, driven);
        while self.left(pusher, front) < self.left(pusher, behind) {
            let (count, only) = self.ways_on(front, behind);
            match only {
                Some(on) if count == 1 => (behind, front) = (front, on),
                Some(_) => return false,
                None => break,
            }
        }
        let wants_back = self.left(driven, behind) < self.left(driven, front);
        let is_there = self.left(pusher, behind) == 0;
        wants_back && (is_there || self.left(pusher, front) < self.left(pusher, behind))
    }

    /// Whether a rover that backs away from `front` to `back`, with the other behind it, comes to a
    /// place where one can pass.
    fn can_swap(&self, back: VertexId, front: VertexId) -> bool {
        let (mut behind, mut at) = (front, back);
        while at != front {
            let (count, only) = self.ways_on(at, behind);
            match only {
                Some(on) if count == 1 => (behind, at) = (at, on),
                Some(_) => return true,
                None => return false,
            }
        }
        false
    }
}
