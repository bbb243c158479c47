//! Local resolution of a confirmed deadlock: one rover of the ring goes aside, so that the others
//! pass. Push and rotate (De Wilde, ter Mors and Witteveen, *Push and Rotate*, 2014) in the small,
//! at a branch that the others do not need.
//!
//! The node of the ring's lowest rover looks in its local neighbourhood graph for the nearest free
//! vertex off the others' ways and sends its rover there; rovers that stand on the way, off the
//! others' ways too, are pushed ahead. If there is no such place it hands the ring to the node of
//! the next rover, one hop away, and so on once round. What is sent are orders to plan by: the
//! rover's only paths are then the one aside, at no penalty for going back, and the zero path.
//! Vertices are asked for and granted as ever, so that no collision can come of it, nor of two
//! nodes that judge differently; a lost or late order is one that nobody follows.
//!
//! Two resolutions would push each other's rovers about. A node that has sent or heard orders does
//! not begin another while they hold, and for a random time longer.

use std::collections::VecDeque;

use farside::MatchKey;
use farside::prelude::*;
use farside_worlds::VertexId;

use super::MaxPlusPolicy;
use crate::ids::RoverId;
use crate::max_plus::aids::messages::{Aside, Resolve, Waiting};
use crate::max_plus::candidates::{CandidatePath, Destination};
use crate::max_plus::lng::LocalGraph;
use crate::node::Node;
use crate::node::base::Base;
use crate::safety::{OccupancyTable, Occupant};

/// The orders a node knows of. Lost in a crash.
#[derive(Default)]
pub(super) struct Resolution {
    orders: Vec<Aside>,
    /// Until this cycle it begins no resolution.
    quiet_until: u32,
}

impl Resolution {
    /// The order that holds for a rover.
    fn order(&self, rover: RoverId, cycle: u32) -> Option<&Aside> {
        let holds = |order: &&Aside| order.rover == rover && cycle <= order.until;
        self.orders.iter().find(holds)
    }

    fn take(&mut self, order: Aside, cycle: u32) {
        // An order that is over still says why a rover is where it is.
        let stale = |old: &Aside| old.until + 50 < cycle || old.rover == order.rover;
        self.orders.retain(|old| !stale(old));
        self.quiet_until = self.quiet_until.max(order.until);
        self.orders.push(order);
    }
}

/// Where each rover goes so that the one at `from` gets off the ways that others `need`: its own
/// path first, then those of the rovers that it pushes. `holder` says who holds a vertex. `None` if
/// no place in the graph is free for it.
pub(super) fn make_way(
    graph: &LocalGraph,
    from: VertexId,
    need: impl Fn(VertexId) -> bool,
    holder: impl Fn(VertexId) -> Option<RoverId>,
) -> Option<Vec<(RoverId, Vec<VertexId>)>> {
    let mut came: Vec<(VertexId, usize)> = vec![(from, 0)];
    let mut queue = VecDeque::from([0]);
    let end = 'search: loop {
        let at = queue.pop_front()?;
        for next in graph.neighbors(came[at].0) {
            let held = holder(next).is_some();
            // Who stands where others have to pass is not pushed: it is one of those others.
            if came.iter().any(|(v, _)| *v == next) || held && need(next) {
                continue;
            }
            came.push((next, at));
            if !held && !need(next) {
                break 'search came.len() - 1;
            }
            queue.push_back(came.len() - 1);
        }
    };
    let mut way = vec![came[end].0];
    let mut at = end;
    while at != 0 {
        at = came[at].1;
        way.push(came[at].0);
    }
    way.reverse();
    // Each goes to where the next one stood, the last to the free place.
    let stand: Vec<_> = (0..way.len())
        .filter(|&i| holder(way[i]).is_some())
        .collect();
    let ends = stand.iter().skip(1).copied().chain([way.len() - 1]);
    let order = |(&i, end): (&usize, usize)| Some((holder(way[i])?, way[i..=end].to_vec()));
    stand.iter().zip(ends).map(order).collect()
}

impl MaxPlusPolicy {
    /// Sends a rover of a confirmed ring aside, or hands the ring on. `tried` members had no place
    /// to go; the next is one of this node's.
    pub(super) fn resolve(
        &mut self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        ring: Vec<Waiting>,
        tried: u32,
    ) {
        let mut tried = tried as usize;
        while let Some(member) = ring.get(tried).copied() {
            if !base.owns(member.vertex) {
                if let Some(at) = base.neighbor(base.site.sensors.owner(member.vertex)) {
                    let (node, cycle, tried) = (base.id, base.cycle, tried as u32);
                    let message = Resolve {
                        node,
                        cycle,
                        ring,
                        tried,
                    };
                    ctx.send_keyed(
                        base.neighbors[at].address,
                        MatchKey::new(cycle, tried),
                        message,
                    );
                }
                return;
            }
            if base.cycle < self.resolution.quiet_until {
                return;
            }
            let held = ctx
                .durable::<OccupancyTable>()
                .occupant(member.vertex)
                .copied();
            if held.is_none_or(|held| held.rover != member.rover) {
                return;
            }
            if let Some(ways) = self.ways_aside(base, ctx, &ring, tried) {
                return self.order(base, ctx, ways);
            }
            tried += 1;
        }
    }

    fn ways_aside(
        &self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        ring: &[Waiting],
        aside: usize,
    ) -> Option<Vec<(RoverId, Vec<VertexId>)>> {
        let roadmap = &base.site.roadmap;
        let others = ring.iter().enumerate().filter(|&(i, _)| i != aside);
        let needed: Vec<_> = others
            .flat_map(|(_, other)| roadmap.shortest_path(other.vertex, other.goal))
            .collect();
        let occupancy = ctx.durable::<OccupancyTable>();
        let holder = |v| {
            if base.owns(v) {
                return occupancy.occupant(v).map(|held| held.rover);
            }
            let mut theirs = base.neighbors.iter().flat_map(|n| &n.holdings);
            theirs.find(|h| h.vertex == v).map(|h| h.rover)
        };
        make_way(
            &self.graph,
            ring[aside].vertex,
            |v| needed.contains(&v),
            holder,
        )
    }

    /// Tells the owners of all vertices on the ways: all are in the local neighbourhood graph.
    fn order(
        &mut self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        ways: Vec<(RoverId, Vec<VertexId>)>,
    ) {
        let (node, cycle) = (base.id, base.cycle);
        let hold = base.site.config.max_plus.aside_hold;
        let longest = ways.iter().map(|(_, way)| way.len() as u32).max();
        let until = cycle + longest.unwrap_or(0) + hold;
        for (rover, path) in ways {
            let order = Aside {
                node,
                cycle,
                rover,
                path,
                until,
            };
            for neighbor in &base.neighbors {
                let owns = |v: &VertexId| base.site.sensors.owner(*v) == neighbor.id;
                if order.path.iter().any(owns) {
                    let key = MatchKey::new(cycle, rover.0);
                    ctx.send_keyed(neighbor.address, key, order.clone());
                }
            }
            self.resolution.take(order, cycle);
        }
        let mut draws = ctx.random_at("back_off", u64::from(cycle)).stream();
        let longer = draws.uniform_in(0.0, f64::from(hold + 1));
        self.resolution.quiet_until = until + longer as u32;
    }

    /// Whether the last order known for a rover led to `here`, over or not.
    pub(super) fn was_sent(&self, rover: RoverId, here: VertexId) -> bool {
        let led = |order: &Aside| order.rover == rover && order.path.contains(&here);
        self.resolution.orders.iter().any(led)
    }

    /// The paths of a rover that was sent aside: on to its place, or, there, to wait; and the zero
    /// path. `None` if it has no order, or is not where the order leads.
    pub(super) fn path_aside(
        &self,
        base: &Base,
        here: VertexId,
        held: &Occupant,
        occupied: impl Fn(VertexId) -> bool,
    ) -> Option<Vec<CandidatePath>> {
        let order = self.resolution.order(held.rover, base.cycle)?;
        let at = order.path.iter().position(|&v| v == here)?;
        let mut vertices = order.path[at..].to_vec();
        if vertices.get(1).is_some_and(|&next| occupied(next)) {
            vertices.insert(0, here);
        }
        let path = |destination, vertices, payoff| CandidatePath {
            destination,
            vertices,
            payoff,
        };
        let worth = base.site.payoffs.longest as f32;
        let stay = path(Destination::Stay, vec![here], 0.0);
        Some(vec![path(Destination::Leaf, vertices, worth), stay])
    }
}

impl MaxPlusPolicy {
    fn take_resolve(&mut self, base: &Base, ctx: &mut Context<'_, Node>, message: Resolve) {
        if base.site.config.max_plus.junction_resolution {
            self.resolve(base, ctx, message.ring, message.tried);
        }
    }
}

impl Handler<Resolve> for Node {
    fn handle(&mut self, message: Resolve, ctx: &mut Context<'_, Node>) -> Outcome {
        if let Some((policy, base)) = self.max_plus() {
            policy.take_resolve(base, ctx, message);
        }
        Ok(())
    }
}

impl MaxPlusPolicy {
    fn take_order(&mut self, base: &Base, _ctx: &mut Context<'_, Node>, order: Aside) {
        let known = base.is_rover(order.rover);
        if base.site.config.max_plus.junction_resolution && known && order.until >= base.cycle {
            self.resolution.take(order, base.cycle);
        }
    }
}

impl Handler<Aside> for Node {
    fn handle(&mut self, order: Aside, ctx: &mut Context<'_, Node>) -> Outcome {
        if let Some((policy, base)) = self.max_plus() {
            policy.take_order(base, ctx, order);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{grid, v};
    use proptest::prelude::*;

    /// 0 1 2 3 4 in a row, 5 to 9 above; of the rungs only 1-6, above only 6-7.
    fn line_with_a_branch() -> LocalGraph {
        let missing = [(0, 5), (2, 7), (3, 8), (4, 9), (5, 6), (7, 8), (8, 9)];
        let kept: Vec<_> = (0..8).map(v).filter(|u| *u != v(5)).collect();
        // The map must be connected, the graph need not be the whole of it.
        let map = grid(5, 2, &missing[..3]);
        let graph = LocalGraph::over(&map, kept);
        assert!(graph.neighbors(v(2)).eq([v(1), v(3)]));
        graph
    }

    #[test]
    fn a_rover_backs_to_the_nearest_branch() {
        let row = |u: VertexId| u.0 < 5;
        let holder = |u: VertexId| {
            [(2, 0), (3, 1)]
                .iter()
                .find(|h| h.0 == u.0)
                .map(|h| RoverId(h.1))
        };
        let ways = make_way(&line_with_a_branch(), v(2), row, holder);
        assert_eq!(ways, Some(vec![(RoverId(0), vec![v(2), v(1), v(6)])]));
    }

    #[test]
    fn who_stands_in_the_branch_is_pushed_and_who_stands_in_the_way_is_not() {
        let row = |u: VertexId| u.0 < 5;
        let graph = line_with_a_branch();
        let held = |places: &'static [(u32, u32)]| {
            move |u: VertexId| places.iter().find(|h| h.0 == u.0).map(|h| RoverId(h.1))
        };
        let ways = make_way(&graph, v(2), row, held(&[(2, 0), (3, 1), (6, 2)]));
        let expected = vec![
            (RoverId(0), vec![v(2), v(1), v(6)]),
            (RoverId(2), vec![v(6), v(7)]),
        ];
        assert_eq!(ways, Some(expected));
        assert_eq!(
            make_way(&graph, v(2), row, held(&[(2, 0), (3, 1), (1, 2)])),
            None
        );
        assert_eq!(
            make_way(&graph, v(2), row, held(&[(2, 0), (6, 2), (7, 3)])),
            None
        );
    }

    proptest! {
        /// Whatever stands where: each goes to a place of its own off the others' ways, along
        /// edges, and nobody is pushed who is not asked.
        #[test]
        fn ways_aside_end_at_places_of_their_own(
            cuts in prop::collection::vec((0..20u32, 0..2u32), 0..6),
            standing in prop::collection::vec(any::<bool>(), 20),
            needed in prop::collection::vec(any::<bool>(), 20),
            from in 0..20u32,
        ) {
            // Cutting both edges of a corner would take the map apart: rungs only.
            let rungs = cuts.iter().map(|(i, _)| (*i, i + 5));
            let rungs: Vec<_> = rungs.filter(|(i, _)| i % 5 != 0).collect();
            let map = grid(5, 4, &rungs);
            let graph = LocalGraph::over(&map, map.vertices().collect());
            let need = |u: VertexId| needed[u.0 as usize];
            let is_held = |u: VertexId| u.0 == from || standing[u.0 as usize];
            let holder = |u: VertexId| is_held(u).then_some(RoverId(u.0));
            let Some(ways) = make_way(&graph, v(from), need, holder) else {
                // Only if no free place off the ways can be reached.
                let mut reached = vec![v(from)];
                let mut at = 0;
                while at < reached.len() {
                    for &next in map.neighbors(reached[at]) {
                        let blocked = holder(next).is_some() && need(next);
                        if !blocked && !reached.contains(&next) {
                            prop_assert!(holder(next).is_some() || need(next));
                            reached.push(next);
                        }
                    }
                    at += 1;
                }
                return Ok(());
            };
            prop_assert_eq!(ways[0].0, RoverId(from));
            let mut places = Vec::new();
            for (rover, way) in &ways {
                prop_assert_eq!(way[0], v(rover.0), "it stands there");
                prop_assert!(way.windows(2).all(|s| map.are_adjacent(s[0], s[1])));
                let end = *way.last().unwrap();
                prop_assert!(!need(end) && !places.contains(&end));
                places.push(end);
                let moved = |u: VertexId| ways.iter().any(|(r, _)| r.0 == u.0);
                prop_assert!(way.iter().all(|&u| holder(u).is_none() || moved(u)));
            }
        }
    }
}
