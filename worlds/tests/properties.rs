//! Properties of roadmaps and sensor networks, held against slow and simple reckonings of the same.

use std::sync::LazyLock;

use farside_worlds::{NodeId, Roadmap, RoadmapError, SensorNetwork, VertexId};
use nalgebra::Point2;
use proptest::prelude::*;

static MAPS: LazyLock<Vec<Roadmap>> = LazyLock::new(|| {
    Roadmap::builtin_names()
        .iter()
        .map(|name| Roadmap::builtin(name).unwrap())
        .collect()
});

/// A connected part of a grid: a random tree over all points, and each other grid edge by chance.
fn grid_map() -> impl Strategy<Value = Roadmap> {
    (1u32..7, 1u32..7).prop_flat_map(|(columns, rows)| {
        let edges = (columns * rows * 2) as usize;
        let order = Just((0..edges).collect::<Vec<_>>()).prop_shuffle();
        let kept = prop::collection::vec(prop::bool::weighted(0.3), edges);
        let boundary =
            prop::collection::btree_set(0..columns * rows, 1..=4.min(columns * rows) as usize);
        (Just((columns, rows)), order, kept, boundary).prop_map(
            |((columns, rows), order, kept, boundary)| {
                let n = columns * rows;
                let positions =
                    (0..n).map(|v| Point2::new(f64::from(v % columns), f64::from(v / columns)));
                let mut part: Vec<u32> = (0..n).collect();
                let mut edges = Vec::new();
                for index in order {
                    let u = (index / 2) as u32;
                    let east = index % 2 == 0;
                    let inside = if east {
                        u % columns + 1 < columns
                    } else {
                        u / columns + 1 < rows
                    };
                    if !inside {
                        continue;
                    }
                    let v = if east { u + 1 } else { u + columns };
                    let (from, to) = (part[v as usize], part[u as usize]);
                    if from != to || kept[index] {
                        edges.push((VertexId(v), VertexId(u)));
                    }
                    part.iter_mut()
                        .filter(|p| **p == from)
                        .for_each(|p| *p = to);
                }
                let boundary = boundary.into_iter().map(VertexId).collect();
                Roadmap::new("grid", positions.collect(), edges, boundary).unwrap()
            },
        )
    })
}

/// Hops between all pairs after Floyd and Warshall.
fn floyd_warshall(map: &Roadmap) -> Vec<Vec<u32>> {
    let n = map.len();
    let mut hops = vec![vec![u32::MAX / 4; n]; n];
    for (v, row) in hops.iter_mut().enumerate() {
        row[v] = 0;
    }
    for &(u, v) in map.edges() {
        hops[u.0 as usize][v.0 as usize] = 1;
        hops[v.0 as usize][u.0 as usize] = 1;
    }
    for k in 0..n {
        for i in 0..n {
            for j in 0..n {
                hops[i][j] = hops[i][j].min(hops[i][k] + hops[k][j]);
            }
        }
    }
    hops
}

fn check_distances(map: &Roadmap) {
    let expected = floyd_warshall(map);
    for u in map.vertices() {
        for v in map.vertices() {
            assert_eq!(map.distance(u, v), expected[u.0 as usize][v.0 as usize]);
        }
    }
    assert_eq!(
        map.diameter(),
        expected.iter().flatten().copied().max().unwrap()
    );
}

/// All shortest paths from `u` to `v`, in order of their vertices.
fn all_shortest(map: &Roadmap, u: VertexId, v: VertexId) -> Vec<Vec<VertexId>> {
    if u == v {
        return vec![vec![u]];
    }
    let nearer = map
        .neighbors(u)
        .iter()
        .filter(|&&w| map.distance(w, v) < map.distance(u, v));
    let tails = nearer.flat_map(|&w| all_shortest(map, w, v));
    tails.map(|tail| [vec![u], tail].concat()).collect()
}

/// Whether two segments between whole points have a point in common that is not an end of both:
/// in whole numbers, so without rounding.
fn cross(a: (i64, i64), b: (i64, i64), c: (i64, i64), d: (i64, i64)) -> bool {
    let turn = |p: (i64, i64), q: (i64, i64), r: (i64, i64)| {
        ((q.0 - p.0) * (r.1 - p.1) - (q.1 - p.1) * (r.0 - p.0)).signum()
    };
    let on = |p: (i64, i64), q: (i64, i64), r: (i64, i64)| {
        turn(p, q, r) == 0
            && (p.0.min(q.0)..=p.0.max(q.0)).contains(&r.0)
            && (p.1.min(q.1)..=p.1.max(q.1)).contains(&r.1)
    };
    let proper = turn(a, b, c) * turn(a, b, d) < 0 && turn(c, d, a) * turn(c, d, b) < 0;
    // An end of one inside the other, not at its end.
    let inside = |p, q, r| r != p && r != q && on(p, q, r);
    proper || inside(a, b, c) || inside(a, b, d) || inside(c, d, a) || inside(c, d, b)
}

fn check_network(map: &Roadmap, network: &SensorNetwork) {
    let square = |x: f64| x * x;
    let far = |p: Point2<f64>, q: Point2<f64>| square(p.x - q.x) + square(p.y - q.y);
    let limit = network.radius_m() * network.radius_m();
    for v in map.vertices() {
        let to_node = |n: &NodeId| far(map.position_m(v), network.position_m(*n));
        let nearest = network
            .nodes()
            .min_by(|a, b| to_node(a).total_cmp(&to_node(b)))
            .unwrap();
        assert_eq!(network.owner(v), nearest);
        assert!(network.owned(nearest).contains(&v));
        assert!(to_node(&nearest) <= limit, "vertex {} is not covered", v.0);
    }
    assert_eq!(
        network
            .nodes()
            .map(|n| network.owned(n).len())
            .sum::<usize>(),
        map.len()
    );
    for a in network.nodes() {
        assert!(!network.owned(a).is_empty(), "node {} is idle", a.0);
        for b in network.nodes() {
            let near = a != b && far(network.position_m(a), network.position_m(b)) <= limit;
            assert_eq!(network.are_neighbors(a, b), near);
        }
    }
    for &(u, v) in map.edges() {
        let (a, b) = (network.owner(u), network.owner(v));
        assert!(
            a == b || network.are_neighbors(a, b),
            "edge {} - {}",
            u.0,
            v.0
        );
    }
    let mut reached = vec![NodeId(0)];
    let mut next = 0;
    while let Some(&node) = reached.get(next) {
        let new = network
            .neighbors(node)
            .iter()
            .filter(|n| !reached.contains(n));
        reached.extend(new.copied().collect::<Vec<_>>());
        next += 1;
    }
    assert_eq!(reached.len(), network.len(), "the network falls apart");
}

#[test]
fn distances_of_the_built_in_maps() {
    MAPS.iter().for_each(check_distances);
}

#[test]
fn the_first_hundred_seeds_place_on_both_maps() {
    for map in MAPS.iter() {
        for nodes in [14, 21, 28] {
            let radius_m = SensorNetwork::default_radius_m(map, nodes);
            for seed in 0..100 {
                let network = SensorNetwork::place(map, nodes, radius_m, seed).unwrap();
                assert_eq!(network.len(), nodes);
                check_network(map, &network);
            }
        }
    }
}

#[test]
fn seeds_give_different_networks() {
    let place = |seed| SensorNetwork::place(&MAPS[0], 28, 150.0, seed).unwrap();
    assert_eq!(place(1), place(1));
    assert_ne!(place(1), place(2));
}

proptest! {
    #[test]
    fn distances_of_any_map(map in grid_map()) {
        check_distances(&map);
    }

    #[test]
    fn paths_are_the_first_of_the_shortest(map in grid_map(), ends in any::<(u32, u32)>()) {
        let n = map.len() as u32;
        let (u, v) = (VertexId(ends.0 % n), VertexId(ends.1 % n));
        let expected = all_shortest(&map, u, v).into_iter().min().unwrap();
        prop_assert_eq!(map.shortest_path(u, v), expected);
    }

    #[test]
    fn files_read_back_equal(map in grid_map(), heights in prop::collection::vec(-1e6..1e6, 36)) {
        let heights_m = heights[..map.len()].to_vec();
        let map = map.with_heights_m(heights_m).unwrap();
        prop_assert_eq!(Roadmap::from_toml(&map.to_toml()).unwrap(), map);
    }

    #[test]
    fn crossings_are_found(
        points in prop::collection::btree_set((0i64..12, 0i64..12), 4..10),
        order in Just((0..9usize).collect::<Vec<_>>()).prop_shuffle(),
    ) {
        let points: Vec<(i64, i64)> = points.into_iter().collect();
        let order: Vec<usize> = order.into_iter().filter(|&v| v < points.len()).collect();
        // One path through all points, so that it is connected.
        let edges: Vec<(usize, usize)> = order.windows(2).map(|step| (step[0], step[1])).collect();
        let crossing = edges.iter().enumerate().any(|(i, e)| {
            edges[i + 1..].iter().any(|f| cross(points[e.0], points[e.1], points[f.0], points[f.1]))
        });
        let positions = points.iter().map(|&(x, y)| Point2::new(x as f64, y as f64)).collect();
        let ids = edges.iter().map(|&(u, v)| (VertexId(u as u32), VertexId(v as u32))).collect();
        match Roadmap::new("path", positions, ids, vec![VertexId(0)]) {
            Ok(_) => prop_assert!(!crossing),
            Err(RoadmapError::Crossing { first, second }) => {
                let at = |v: VertexId| points[v.0 as usize];
                let named = cross(at(first.0), at(first.1), at(second.0), at(second.1));
                prop_assert!(named, "{:?} and {:?} do not cross", first, second);
            }
            Err(other) => prop_assert!(false, "{other}"),
        }
    }

    #[test]
    fn any_placement_keeps_its_promises(
        dense in any::<bool>(),
        nodes in 1usize..60,
        seed in any::<u64>(),
        share in 0.5f64..2.0,
    ) {
        let map = &MAPS[usize::from(!dense)];
        let radius_m = share * SensorNetwork::default_radius_m(map, nodes);
        // A radius that is too small may fail, and must not lie.
        match SensorNetwork::place(map, nodes, radius_m, seed) {
            Ok(network) => check_network(map, &network),
            Err(error) => prop_assert!(share < 0.9, "{error}"),
        }
    }

    #[test]
    fn networks_over_any_map(map in grid_map(), nodes in 1usize..12, seed in any::<u64>()) {
        let nodes = nodes.min(map.len());
        let radius_m = 2.0 * SensorNetwork::default_radius_m(&map, nodes);
        if let Ok(network) = SensorNetwork::place(&map, nodes, radius_m, seed) {
            check_network(&map, &network);
        }
    }

    #[test]
    fn any_bytes_are_a_map_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = Roadmap::from_toml(&String::from_utf8_lossy(&bytes)).map_err(|e| e.to_string());
    }

    #[test]
    fn any_damage_is_a_map_or_an_error(
        map in grid_map(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), "[-0-9e.,\\[\\]a-z=]{0,3}"), 1..4),
    ) {
        let mut text = map.to_toml();
        for (index, patch) in damage {
            let at = index.index(text.len());
            text.replace_range(at..at + 1, &patch);
        }
        let _ = Roadmap::from_toml(&text).map_err(|e| e.to_string());
    }
}
