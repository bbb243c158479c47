//! Wait-for probes: who waits for whom in a ring, found with messages of one hop (after Chandy,
//! Misra and Haas, *Distributed Deadlock Detection*, 1983, for a single resource each).
//!
//! A rover that has come no nearer to its goal for `network.max_plus.probe_after` cycles waits for
//! whoever holds the vertex that comes first on its shortest way there. Its node sends a probe to
//! the owner of that vertex, which adds the occupant, if that one waits too, and passes the probe
//! on. The one that comes back to its initiator confirms a deadlock, and names it. Every rover
//! waits for at most one, so that a ring is entered by many but closed only by its members; of
//! these the one with the lowest number finds it, and the others' probes are dropped.
//!
//! "No nearer" and not "standing still", because most teams of the policy `max-plus` do not freeze:
//! rovers push each other to and fro. A node knows it of each rover that it or its neighbours held.
//! While a probe is under way rovers may move: at latencies of several cycles it may name a
//! ring whose members did not all wait at the same time.

use farside::MatchKey;
use farside::prelude::*;
use farside_worlds::{Roadmap, VertexId};

use super::MaxPlusPolicy;
use crate::ids::RoverId;
use crate::max_plus::aids::messages::{WaitProbe, Waiting};
use crate::node::Node;
use crate::node::base::Base;
use crate::safety::OccupancyTable;

/// What a node remembers of rovers' ways to their goals, and of deadlocks. Lost in a crash.
#[derive(Default)]
pub(super) struct Probes {
    /// For each rover the least distance at which it was seen, and the cycle in which that was new.
    nearest: Vec<Option<(u32, u32)>>,
    /// Deadlocks confirmed in this cycle that were not the last named before.
    pub(super) confirmed: u32,
    /// The last deadlock that this node confirmed, from its lowest rover on.
    pub(super) named: Vec<RoverId>,
}

impl Probes {
    /// A rover was seen at this distance from its goal.
    fn see(&mut self, rover: RoverId, distance: u32, cycle: u32) {
        let at = rover.0 as usize;
        if self.nearest.len() <= at {
            self.nearest.resize(at + 1, None);
        }
        let nearest = &mut self.nearest[at];
        if nearest.is_none_or(|(least, _)| distance < least) {
            *nearest = Some((distance, cycle));
        }
    }

    /// For how many cycles it has come no nearer.
    fn kept(&self, rover: RoverId, cycle: u32) -> u32 {
        let nearest = self.nearest.get(rover.0 as usize).copied().flatten();
        nearest.map_or(0, |(_, since)| cycle.saturating_sub(since))
    }
}

/// What becomes of a probe at a vertex.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Fate {
    /// It ends: nobody waits there, or the ring is another's to find.
    Ends,
    /// It has come back.
    Returns,
    /// It goes on, with one more member.
    GoesOn,
}

/// What becomes of a probe that has come by `members` when the vertex it asks for is held by
/// `occupant`, none if that one does not wait.
pub(super) fn fate(members: &[Waiting], occupant: Option<&Waiting>) -> Fate {
    let (Some(first), Some(next)) = (members.first(), occupant) else {
        return Fate::Ends;
    };
    if (next.rover, next.vertex) == (first.rover, first.vertex) {
        Fate::Returns
    } else if next.rover <= first.rover || members.iter().any(|m| m.rover == next.rover) {
        Fate::Ends
    } else {
        Fate::GoesOn
    }
}

/// The vertex that comes first on the shortest way from `here` to `goal`, another vertex; of
/// several the lowest.
pub(super) fn wanted(roadmap: &Roadmap, here: VertexId, goal: VertexId) -> Option<VertexId> {
    let left = roadmap.distance(here, goal);
    let nearer = |w: &VertexId| roadmap.distance(*w, goal) < left;
    roadmap.neighbors(here).iter().copied().find(nearer)
}

impl MaxPlusPolicy {
    pub(super) fn probes_are_on(&self, base: &Base) -> bool {
        base.site.config.max_plus.deadlock_probes || base.site.config.max_plus.junction_resolution
    }

    /// Once a cycle, when neighbours have told who is where: looks for rovers that wait, and asks.
    pub(super) fn probe(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        if !self.probes_are_on(base) {
            return;
        }
        let (site, cycle) = (base.site.clone(), base.cycle);
        let own = ctx.durable::<OccupancyTable>().holdings();
        let theirs = base.neighbors.iter().flat_map(|n| &n.holdings);
        for holding in own.iter().chain(theirs) {
            if let Some(goal) = holding.goal {
                let distance = site.roadmap.distance(holding.vertex, goal);
                self.probes.see(holding.rover, distance, cycle);
            }
        }
        let after = site.config.max_plus.probe_after;
        for holding in own {
            let due = self.probes.kept(holding.rover, cycle).is_multiple_of(after);
            if let Some(waiting) = self.waiting(base, ctx, holding.vertex).filter(|_| due) {
                self.pass_probe_on(base, ctx, vec![waiting]);
            }
        }
    }

    /// Who waits at an own vertex for another.
    fn waiting(
        &self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        vertex: VertexId,
    ) -> Option<Waiting> {
        let held = *ctx.durable::<OccupancyTable>().occupant(vertex)?;
        let goal = held.goal.filter(|&goal| held.arrived && goal != vertex)?;
        let kept = self.probes.kept(held.rover, base.cycle);
        (kept >= base.site.config.max_plus.probe_after).then_some(Waiting {
            rover: held.rover,
            vertex,
            goal,
        })
    }

    /// Asks for the occupant of the vertex that the last member wants: here if it is the node's
    /// own, else its owner, a neighbour.
    fn pass_probe_on(
        &mut self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        mut members: Vec<Waiting>,
    ) {
        let site = base.site.clone();
        while let Some(last) = members.last()
            && let Some(vertex) = wanted(&site.roadmap, last.vertex, last.goal)
        {
            if !base.owns(vertex) {
                if let Some(at) = base.neighbor(site.sensors.owner(vertex)) {
                    let (node, cycle) = (base.id, base.cycle);
                    let key = MatchKey::new(cycle, members[0].rover.0);
                    let probe = WaitProbe {
                        node,
                        cycle,
                        vertex,
                        members,
                    };
                    ctx.send_keyed(base.neighbors[at].address, key, probe);
                }
                return;
            }
            let occupant = self.waiting(base, ctx, vertex);
            match fate(&members, occupant.as_ref()) {
                Fate::Ends => return,
                Fate::Returns => return self.confirm(base, ctx, members),
                Fate::GoesOn => members.extend(occupant),
            }
        }
    }

    /// A probe of this node has come back.
    fn confirm(&mut self, base: &Base, ctx: &mut Context<'_, Node>, members: Vec<Waiting>) {
        let named: Vec<_> = members.iter().map(|m| m.rover).collect();
        if named != self.probes.named {
            self.probes.confirmed += 1;
            self.probes.named = named;
        }
        if base.site.config.max_plus.junction_resolution {
            self.resolve(base, ctx, members, 0);
        }
    }
}

impl MaxPlusPolicy {
    fn take_probe(&mut self, base: &Base, ctx: &mut Context<'_, Node>, probe: WaitProbe) {
        if !base.owns(probe.vertex) || !self.probes_are_on(base) {
            return;
        }
        let occupant = self.waiting(base, ctx, probe.vertex);
        let mut members = probe.members;
        match fate(&members, occupant.as_ref()) {
            Fate::Ends => {}
            Fate::Returns => self.confirm(base, ctx, members),
            Fate::GoesOn => {
                members.extend(occupant);
                self.pass_probe_on(base, ctx, members);
            }
        }
    }
}

impl Handler<WaitProbe> for Node {
    fn handle(&mut self, probe: WaitProbe, ctx: &mut Context<'_, Node>) -> Outcome {
        if let Some((policy, base)) = self.max_plus() {
            policy.take_probe(base, ctx, probe);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{grid, v};
    use proptest::prelude::*;
    use std::collections::{BTreeSet, VecDeque};

    fn waiting(rover: usize) -> Waiting {
        let vertex = v(rover as u32);
        let rover = RoverId(rover as u32);
        let goal = v(u32::MAX);
        Waiting {
            rover,
            vertex,
            goal,
        }
    }

    /// The rings that probes find where rover i, at vertex i, waits for `next[i]`. Delivery is in
    /// the order of sending, or the reverse.
    fn rings_by_probes(next: &[Option<usize>], last_first: bool) -> Vec<Vec<usize>> {
        let mut under_way: VecDeque<_> = (0..next.len()).map(|i| vec![waiting(i)]).collect();
        let mut found = Vec::new();
        loop {
            let probe = match last_first {
                true => under_way.pop_back(),
                false => under_way.pop_front(),
            };
            let Some(mut members) = probe else {
                return found;
            };
            let last = members[members.len() - 1].rover.0 as usize;
            // Who waits for nobody is not known to wait at all.
            let asked = next[last].map(|n| (n, waiting(n)));
            let occupant = asked.filter(|(n, _)| next[*n].is_some()).map(|(_, w)| w);
            match fate(&members, occupant.as_ref()) {
                Fate::Ends => {}
                Fate::Returns => found.push(members.iter().map(|m| m.rover.0 as usize).collect()),
                Fate::GoesOn => {
                    members.extend(occupant);
                    under_way.push_back(members);
                }
            }
        }
    }

    /// The rings by walking: who comes back to itself is in one.
    fn rings_by_walking(next: &[Option<usize>]) -> BTreeSet<Vec<usize>> {
        let ring = |start: usize| {
            let request = std::iter::successors(Some(start), |&i| next[i]);
            let request: Vec<_> = request.take(next.len() + 1).collect();
            let back = request.iter().skip(1).position(|&i| i == start)?;
            let mut ring = request[..=back].to_vec();
            let least = (0..ring.len()).min_by_key(|&i| ring[i]).unwrap_or(0);
            ring.rotate_left(least);
            Some(ring)
        };
        (0..next.len()).filter_map(ring).collect()
    }

    proptest! {
        #[test]
        fn probes_find_every_ring_once_and_nothing_else(
            draws in prop::collection::vec(prop::option::weighted(0.9, 0..40usize), 1..25),
            last_first in any::<bool>(),
        ) {
            let n = draws.len();
            // A rover does not wait for itself.
            let next = |(i, d): (usize, &Option<usize>)| d.map(|d| d % n).filter(|&d| d != i);
            let next: Vec<_> = draws.iter().enumerate().map(next).collect();
            let found = rings_by_probes(&next, last_first);
            let distinct: BTreeSet<_> = found.iter().cloned().collect();
            prop_assert_eq!(distinct.len(), found.len());
            prop_assert_eq!(distinct, rings_by_walking(&next));
        }
    }

    #[test]
    fn an_initiator_that_moved_on_is_not_found_where_it_is_now() {
        let mut moved = waiting(0);
        moved.vertex = v(9);
        assert_eq!(fate(&[waiting(0), waiting(1)], Some(&moved)), Fate::Ends);
    }

    #[test]
    fn to_and_fro_is_no_progress() {
        let mut probes = Probes::default();
        for (cycle, distance) in [(0, 5), (1, 4), (2, 5), (3, 4), (4, 5)] {
            probes.see(RoverId(1), distance, cycle);
        }
        assert_eq!(
            (probes.kept(RoverId(1), 4), probes.kept(RoverId(0), 4)),
            (3, 0)
        );
        probes.see(RoverId(1), 3, 5);
        assert_eq!(probes.kept(RoverId(1), 5), 0);
    }

    #[test]
    fn the_wanted_vertex_is_nearer_to_the_goal() {
        let map = grid(3, 2, &[(0, 1)]);
        assert_eq!(wanted(&map, v(0), v(1)), Some(v(3)));
        assert_eq!(wanted(&map, v(1), v(1)), None);
    }
}
