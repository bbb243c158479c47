//! Which nodes a request passes: a few different ways from one vertex to another, each as the
//! owners of the vertices on it. Known from the roadmap alone; who is where when is found on the
//! request.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

use farside_worlds::{DistancesTo, NodeId, Roadmap, SensorNetwork, VertexId};

/// Up to `count` different sequences of owners, each of which has a path from `from` to `to`
/// through its vertices in that order; the shortest way first. Each further one is a shortest way
/// where edges already used cost more.
pub(crate) fn routes(
    roadmap: &Roadmap,
    sensors: &SensorNetwork,
    (from, to): (VertexId, VertexId),
    count: u32,
) -> Vec<Vec<NodeId>> {
    let mut found = Vec::<Vec<NodeId>>::new();
    let mut cost = vec![PLAIN; roadmap.len()];
    let left = roadmap.distances_to(to);
    let mut paths = Vec::<Vec<VertexId>>::new();
    let mut most = PLAIN * left.from(from);
    for _ in 0..count.saturating_mul(3) {
        let path = cheapest(roadmap, &cost, (from, to), &left, most);
        for v in &path {
            cost[v.0 as usize] += PLAIN / 2;
        }
        let mut owners: Vec<NodeId> = path.iter().map(|&v| sensors.owner(v)).collect();
        owners.dedup();
        if !found.contains(&owners) {
            found.push(owners);
        }
        if found.len() >= count as usize {
            break;
        }
        // The next way costs no more than any of those that are known.
        paths.push(path);
        let price = |path: &Vec<VertexId>| path[1..].iter().map(|v| cost[v.0 as usize]).sum();
        most = paths.iter().map(price).min().unwrap_or(u32::MAX);
    }
    found
}

/// A route that follows one path: its nodes, and the vertex at which the path leaves each of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ClearRoute {
    pub(crate) nodes: Vec<NodeId>,
    pub(crate) exits: Vec<VertexId>,
}

/// The route of a shortest path from the first vertex to the second on which no other vertex is
/// one of `avoided`; none if there is no such path.
pub(crate) fn clear_route(
    roadmap: &Roadmap,
    sensors: &SensorNetwork,
    (from, to): (VertexId, VertexId),
    avoided: impl Fn(VertexId) -> bool,
) -> Option<ClearRoute> {
    let mut before = vec![None; roadmap.len()];
    before[from.0 as usize] = Some(from);
    let mut open = VecDeque::from([from]);
    while let Some(here) = open.pop_front() {
        if here == to {
            break;
        }
        for &next in roadmap.neighbors(here) {
            let slot = &mut before[next.0 as usize];
            if slot.is_none() && (next == to || !avoided(next)) {
                *slot = Some(here);
                open.push_back(next);
            }
        }
    }
    let mut path = vec![to];
    while path[path.len() - 1] != from {
        path.push(before[path[path.len() - 1].0 as usize]?);
    }
    let (mut nodes, mut exits) = (Vec::new(), Vec::new());
    for vertex in path.into_iter().rev() {
        let owner = sensors.owner(vertex);
        match exits.last_mut() {
            Some(exit) if nodes.last() == Some(&owner) => *exit = vertex,
            _ => {
                nodes.push(owner);
                exits.push(vertex);
            }
        }
    }
    Some(ClearRoute { nodes, exits })
}

/// What a vertex costs that no path uses yet.
const PLAIN: u32 = 16;

/// A cheapest path, both ends included, which costs at most `most`. The roadmap is connected.
///
/// What cannot be on such a path, because it is too far from its end, is passed over. That changes
/// nothing about which path is found: whoever comes first to a vertex of a cheapest path is on one
/// too.
fn cheapest(
    roadmap: &Roadmap,
    cost: &[u32],
    (from, to): (VertexId, VertexId),
    left: &DistancesTo<'_>,
    most: u32,
) -> Vec<VertexId> {
    let mut best = vec![u32::MAX; roadmap.len()];
    let mut before = vec![from; roadmap.len()];
    let mut queue = BinaryHeap::from([Reverse((0, from))]);
    best[from.0 as usize] = 0;
    while let Some(Reverse((spent, u))) = queue.pop() {
        if u == to {
            break;
        }
        if spent > best[u.0 as usize] {
            continue;
        }
        for &v in roadmap.neighbors(u) {
            let total = spent + cost[v.0 as usize];
            if total < best[v.0 as usize] && total + PLAIN * left.from(v) <= most {
                best[v.0 as usize] = total;
                before[v.0 as usize] = u;
                queue.push(Reverse((total, v)));
            }
        }
    }
    let mut path = vec![to];
    while path[path.len() - 1] != from {
        path.push(before[path[path.len() - 1].0 as usize]);
    }
    path.reverse();
    path
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{grid, v};

    #[test]
    fn routes_differ_and_lead_from_owner_to_owner() {
        let map = grid(9, 9, &[]);
        let radius_m = SensorNetwork::default_radius_m(&map, 9);
        let sensors = SensorNetwork::place(&map, 9, radius_m, 1).unwrap();
        let all = routes(&map, &sensors, (v(0), v(80)), 4);
        assert_eq!(all.len(), 4);
        for (i, route) in all.iter().enumerate() {
            assert_eq!(route[0], sensors.owner(v(0)));
            assert_eq!(route.last(), Some(&sensors.owner(v(80))));
            assert!(route.windows(2).all(|w| sensors.are_neighbors(w[0], w[1])));
            assert!(!all[..i].contains(route));
        }
    }

    #[test]
    fn passing_over_what_is_too_far_changes_no_way() {
        let map = grid(9, 7, &[(10, 11), (20, 29), (31, 40), (41, 42)]);
        let mut draws = farside::random::RandomKey::new(3).stream();
        for round in 0..200 {
            let mut draw = |below: u64| draws.below(below) as u32;
            let cost: Vec<u32> = (0..63).map(|_| PLAIN + PLAIN / 2 * draw(4)).collect();
            let ends = (v(draw(63)), v(draw(63)));
            let left = map.distances_to(ends.1);
            let path = cheapest(&map, &cost, ends, &left, u32::MAX / 2);
            let price: u32 = path[1..].iter().map(|v| cost[v.0 as usize]).sum();
            for slack in [0, 7] {
                let found = cheapest(&map, &cost, ends, &left, price + slack);
                assert_eq!(found, path, "round {round}");
            }
        }
    }

    #[test]
    fn a_clear_route_goes_round_what_is_avoided() {
        // 0 1 2 / 3 4 5 / 6 7 8
        let map = grid(3, 3, &[]);
        let sensors = SensorNetwork::place(&map, 3, 60.0, 1).unwrap();
        let round =
            |avoided: &[u32]| clear_route(&map, &sensors, (v(0), v(2)), |u| avoided.contains(&u.0));
        let straight = round(&[]).unwrap();
        assert_eq!(straight.exits.last(), Some(&v(2)));
        let detour = round(&[1, 4]).unwrap();
        let owners = [0, 3, 6, 7, 8, 5, 2].map(|u| (sensors.owner(v(u)), v(u)));
        for (node, exit) in detour.nodes.iter().zip(&detour.exits) {
            assert!(owners.contains(&(*node, *exit)), "{detour:?}");
        }
        assert!(
            detour
                .nodes
                .windows(2)
                .all(|w| sensors.are_neighbors(w[0], w[1]))
        );
        assert_eq!(round(&[1, 4, 7]), None);
        // The ends themselves do not count.
        assert_eq!(round(&[0, 2]), Some(straight));
    }

    #[test]
    fn a_single_way_is_found_once() {
        let map = grid(6, 1, &[]);
        let sensors = SensorNetwork::place(&map, 2, 60.0, 1).unwrap();
        assert_eq!(routes(&map, &sensors, (v(0), v(5)), 5).len(), 1);
        let same = routes(&map, &sensors, (v(3), v(3)), 5);
        assert_eq!(same, [vec![sensors.owner(v(3))]]);
    }
}
