//! The network that is chosen out of the ground's graph: a tree to the gates, loops and spurs.

use std::collections::{BTreeSet, VecDeque};

use farside::random::Stream;
use nalgebra::Point2;

use super::ground::SafeGround;

/// Pairs of vertices tried for one loop.
const LOOP_TRIES: usize = 240;

/// The least edges that a loop's two ends are apart before it is closed.
const LOOP_LEAST: usize = 9;

/// The vertices that closing a loop may add.
const LOOP_ADDS: std::ops::RangeInclusive<usize> = 1..=9;

/// What each vertex that a loop adds counts against it.
const LOOP_COST: f64 = 12.0;

/// The most vertices of a spur.
const SPUR_MOST: usize = 6;

/// How much dearer a step next to the network is, so that paths keep apart.
const CROWDING: f64 = 3.0;

/// The most edges at a vertex.
const MOST_JOINED: usize = 4;

/// The vertices and edges chosen so far.
pub(super) struct Network<'a> {
    ground: &'a SafeGround,
    stream: Stream,
    chosen: Vec<bool>,
    joined: Vec<Vec<usize>>,
    /// The middles of the loops so far.
    loops_m: Vec<Point2<f64>>,
}

impl<'a> Network<'a> {
    pub(super) fn new(ground: &'a SafeGround, stream: Stream) -> Self {
        let n = ground.positions_m.len();
        let (chosen, joined) = (vec![false; n], vec![Vec::new(); n]);
        Network {
            ground,
            stream,
            chosen,
            joined,
            loops_m: Vec::new(),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.chosen.iter().filter(|&&yes| yes).count()
    }

    /// Joins all gates to a place near the middle, in random order, each by the cheapest path to
    /// what there is.
    pub(super) fn join_gates(&mut self) -> Result<(), &'static str> {
        let nowhere = "there is no safe ground inside the rim";
        if self.ground.gates == 0 {
            return Err(nowhere);
        }
        let from_middle = |v: usize| self.ground.positions_m[v].coords.norm();
        let mut inner: Vec<usize> = (self.ground.gates..self.chosen.len()).collect();
        inner.sort_by(|&a, &b| from_middle(a).total_cmp(&from_middle(b)));
        let start = inner
            .into_iter()
            .find(|&v| self.cheapest(0, |w| w == v).is_some());
        self.chosen[start.ok_or(nowhere)?] = true;
        let mut gates: Vec<usize> = (0..self.ground.gates).collect();
        self.stream.shuffle(&mut gates);
        for gate in gates {
            let path = self
                .path_to_network(gate)
                .ok_or("a gate cannot be reached")?;
            self.add(&path);
        }
        Ok(())
    }

    /// Adds a path that closes a loop, of several tried the best: long before it is closed, far
    /// from other loops.
    pub(super) fn add_loop(&mut self) -> Result<(), &'static str> {
        let members: Vec<usize> = (self.ground.gates..self.chosen.len())
            .filter(|&v| self.chosen[v] && self.joined[v].len() < MOST_JOINED)
            .collect();
        let mut best: Option<(f64, Vec<usize>)> = None;
        for _ in 0..LOOP_TRIES {
            let &from = self
                .stream
                .choose(&members)
                .ok_or("there is no place for a loop")?;
            let around = self.hops_from(from);
            let far: Vec<usize> = members
                .iter()
                .copied()
                .filter(|&v| around[v] >= LOOP_LEAST)
                .filter(|&v| self.apart_m(from, v) <= 8.0 * self.ground.spacing_m)
                .collect();
            let Some(&to) = self.stream.choose(&far) else {
                continue;
            };
            let Some(path) = self.cheapest(from, |v| v == to) else {
                continue;
            };
            if !LOOP_ADDS.contains(&(path.len() - 2)) {
                continue;
            }
            let score = self.loop_score(&path, around[to]);
            if best.as_ref().is_none_or(|(least, _)| score > *least) {
                best = Some((score, path));
            }
        }
        let (_, path) = best.ok_or("there is no place for a loop")?;
        self.loops_m.push(nalgebra::center(
            &self.ground.positions_m[path[0]],
            &self.ground.positions_m[path[path.len() - 1]],
        ));
        self.add(&path);
        Ok(())
    }

    fn loop_score(&self, path: &[usize], hops: usize) -> f64 {
        let ends = [path[0], path[path.len() - 1]].map(|v| self.ground.positions_m[v]);
        let middle = nalgebra::center(&ends[0], &ends[1]);
        let nearest_m = self
            .loops_m
            .iter()
            .map(|p| (p - middle).norm())
            .fold(150.0, f64::min);
        nearest_m + 2.0 * hops.min(30) as f64 - LOOP_COST * path.len() as f64
    }

    /// Adds spurs into the widest gaps until there are so many vertices.
    pub(super) fn fill(&mut self, vertices: usize) -> Result<(), &'static str> {
        if self.len() > vertices {
            return Err("the paths to the gates and the loops alone have more vertices");
        }
        while self.len() < vertices {
            let gap_m = |v: usize| {
                let members = (0..self.chosen.len()).filter(|&w| self.chosen[w]);
                members
                    .map(|w| self.apart_m(v, w))
                    .fold(f64::INFINITY, f64::min)
            };
            let mut gaps: Vec<(f64, usize)> = (self.ground.gates..self.chosen.len())
                .filter(|&v| !self.chosen[v])
                .map(|v| (gap_m(v), v))
                .collect();
            gaps.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            let path = gaps.iter().find_map(|&(_, v)| self.spur_to(v));
            let mut path = path.ok_or("the safe ground is full")?;
            // From the network outwards, as far as vertices are left.
            path.reverse();
            path.truncate(vertices - self.len() + 1);
            self.add(&path);
        }
        Ok(())
    }

    /// Positions and edges, gates first, the others in breadth-first order from gate 0.
    pub(super) fn finish(self, gates: usize) -> (Vec<Point2<f64>>, Vec<(usize, usize)>) {
        let mut order: Vec<usize> = (0..gates.min(self.ground.gates)).collect();
        let mut number = vec![usize::MAX; self.chosen.len()];
        for (i, &gate) in order.iter().enumerate() {
            number[gate] = i;
        }
        let mut queue: VecDeque<usize> = order.iter().copied().collect();
        while let Some(u) = queue.pop_front() {
            for &v in &self.joined[u] {
                if number[v] == usize::MAX {
                    number[v] = order.len();
                    order.push(v);
                    queue.push_back(v);
                }
            }
        }
        let mut edges = BTreeSet::new();
        for &u in &order {
            for &v in &self.joined[u] {
                edges.insert((number[u].min(number[v]), number[u].max(number[v])));
            }
        }
        let positions_m = order.iter().map(|&v| self.ground.positions_m[v]).collect();
        (positions_m, edges.into_iter().collect())
    }

    fn apart_m(&self, u: usize, v: usize) -> f64 {
        (self.ground.positions_m[u] - self.ground.positions_m[v]).norm()
    }

    fn add(&mut self, path: &[usize]) {
        for &v in path {
            self.chosen[v] = true;
        }
        for step in path.windows(2) {
            self.joined[step[0]].push(step[1]);
            self.joined[step[1]].push(step[0]);
        }
    }

    /// The cheapest path from a place outside the network to a vertex of it that is no gate and has
    /// room for another edge.
    fn path_to_network(&self, from: usize) -> Option<Vec<usize>> {
        self.cheapest(from, |v| {
            self.chosen[v] && v >= self.ground.gates && self.joined[v].len() < MOST_JOINED
        })
    }

    /// The cheapest path from a place outside the network to a vertex of it that is no dead end, if
    /// that is not long.
    fn spur_to(&self, from: usize) -> Option<Vec<usize>> {
        let path = self.cheapest(from, |v| {
            self.chosen[v] && (2..MOST_JOINED).contains(&self.joined[v].len())
        });
        path.filter(|path| path.len() <= SPUR_MOST + 1)
    }

    /// The cheapest path over unchosen places from `from` to one where `ends` holds (Dijkstra).
    fn cheapest(&self, from: usize, ends: impl Fn(usize) -> bool) -> Option<Vec<usize>> {
        let n = self.chosen.len();
        let (mut cost, mut before) = (vec![f64::INFINITY; n], vec![usize::MAX; n]);
        let mut done = vec![false; n];
        cost[from] = 0.0;
        loop {
            let open = (0..n).filter(|&v| !done[v] && cost[v].is_finite());
            let u = open.min_by(|&a, &b| cost[a].total_cmp(&cost[b]))?;
            if u != from && ends(u) {
                let mut path = vec![u];
                while path[path.len() - 1] != from {
                    path.push(before[path[path.len() - 1]]);
                }
                path.reverse();
                return Some(path);
            }
            done[u] = true;
            if u != from && (self.chosen[u] || u < self.ground.gates) {
                continue;
            }
            for &(v, step) in &self.ground.links[u] {
                let dearer = if self.is_crowded(v) { CROWDING } else { 1.0 };
                if cost[u] + step * dearer < cost[v] {
                    cost[v] = cost[u] + step * dearer;
                    before[v] = u;
                }
            }
        }
    }

    /// Whether an unchosen place is beside the network.
    fn is_crowded(&self, v: usize) -> bool {
        !self.chosen[v] && self.ground.links[v].iter().any(|&(w, _)| self.chosen[w])
    }

    /// Edges of the network from `from` to every place; `usize::MAX` outside it.
    fn hops_from(&self, from: usize) -> Vec<usize> {
        let mut hops = vec![usize::MAX; self.chosen.len()];
        hops[from] = 0;
        let mut queue = VecDeque::from([from]);
        while let Some(u) = queue.pop_front() {
            for &v in &self.joined[u] {
                if hops[v] == usize::MAX {
                    hops[v] = hops[u] + 1;
                    queue.push_back(v);
                }
            }
        }
        hops
    }
}
