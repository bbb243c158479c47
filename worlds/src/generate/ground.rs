//! The survey: places on safe ground, and the safe edges between them that stay planar.

use farside::random::Stream;
use nalgebra::Point2;

use super::{RoadmapSettings, on_centimetres};
use crate::crater::Crater;
use crate::roadmap::segments_meet;

/// Throws in a row that find no room before the ground counts as full.
const VAIN_THROWS: usize = 3000;

/// The longest edge, in spacings.
const LONGEST_EDGE: f64 = 2.1;

/// What a metre costs at the steepest safe slope, over what it costs on the level.
const SLOPE_COST: f64 = 4.0;

/// By how much chance can make an edge dearer, so that paths wind as roads over rough ground do.
const CHANCE_COST: f64 = 2.5;

/// Rounds of straightening.
const STRAIGHTENINGS: usize = 4;

/// A dense planar graph of safe ground.
pub(super) struct SafeGround {
    /// Places on safe ground; the gates come first.
    pub(super) positions_m: Vec<Point2<f64>>,
    /// How many gates there are.
    pub(super) gates: usize,
    /// For each place the places it can be joined to, with the cost.
    pub(super) links: Vec<Vec<(usize, f64)>>,
    /// The least distance between two places \[m\].
    pub(super) spacing_m: f64,
}

impl SafeGround {
    pub(super) fn survey(crater: &Crater, settings: &RoadmapSettings, mut stream: Stream) -> Self {
        let mut positions_m = Vec::new();
        throw_places(crater, settings, &mut positions_m, &mut stream);
        let joined = links(crater, settings, &positions_m, &mut stream);
        let mut order = gates(settings, &positions_m, &joined, &mut stream);
        let gates = order.len();
        let inner: Vec<usize> = (0..positions_m.len())
            .filter(|v| !order.contains(v))
            .collect();
        order.extend(inner);
        let mut number = vec![0; order.len()];
        for (i, &v) in order.iter().enumerate() {
            number[v] = i;
        }
        let renumbered = |v: &usize| {
            joined[*v]
                .iter()
                .map(|&(w, cost)| (number[w], cost))
                .collect()
        };
        let links = order.iter().map(renumbered).collect();
        positions_m = order.iter().map(|&v| positions_m[v]).collect();
        SafeGround {
            positions_m,
            gates,
            links,
            spacing_m: settings.spacing_m,
        }
    }
}

/// Places round the rim, evenly but for chance, of those that can be reached from most others.
/// Fewer than asked for where there is no safe ground.
fn gates(
    settings: &RoadmapSettings,
    positions_m: &[Point2<f64>],
    links: &[Vec<(usize, f64)>],
    stream: &mut Stream,
) -> Vec<usize> {
    let main = largest_part(links);
    let mut found: Vec<usize> = Vec::new();
    for gate in 0..settings.gates {
        let turn = (gate as f64 + stream.uniform_in(-0.3, 0.3)) / settings.gates as f64;
        let angle = (turn * 2.0 - 1.0) * std::f64::consts::PI;
        let (sin, cos) = libm::sincos(angle);
        let ideal = Point2::new(cos, sin) * settings.gate_radius_m;
        let off_m = |&v: &usize| (positions_m[v] - ideal).norm();
        let free = main.iter().copied().filter(|&v| {
            let apart_m = |w: &usize| (positions_m[v] - positions_m[*w]).norm();
            links[v].len() > 1 && found.iter().all(|w| apart_m(w) >= 1.5 * settings.spacing_m)
        });
        found.extend(free.min_by(|a, b| off_m(a).total_cmp(&off_m(b))));
    }
    found
}

/// The largest set of places that can all be reached from one another.
fn largest_part(links: &[Vec<(usize, f64)>]) -> Vec<usize> {
    let mut seen = vec![false; links.len()];
    let mut largest = Vec::new();
    for start in 0..links.len() {
        let (mut part, mut stack) = (Vec::new(), vec![start]);
        while let Some(v) = stack.pop() {
            if !std::mem::replace(&mut seen[v], true) {
                part.push(v);
                stack.extend(links[v].iter().map(|&(w, _)| w));
            }
        }
        if part.len() > largest.len() {
            largest = part;
        }
    }
    largest
}

/// Throws places as far as just beyond the ring of gates until there is no room left.
fn throw_places(
    crater: &Crater,
    settings: &RoadmapSettings,
    positions_m: &mut Vec<Point2<f64>>,
    stream: &mut Stream,
) {
    let reach_m = 1.04 * settings.gate_radius_m;
    let mut vain = 0;
    while vain < VAIN_THROWS {
        vain += 1;
        let x_m = stream.uniform_in(-reach_m, reach_m);
        let y_m = stream.uniform_in(-reach_m, reach_m);
        let place = on_centimetres(Point2::new(x_m, y_m));
        let inside = libm::hypot(x_m, y_m) <= reach_m;
        let apart = || {
            positions_m
                .iter()
                .all(|p| (p - place).norm() >= settings.spacing_m)
        };
        if inside && apart() && crater.is_clear(place, place, settings.margin_m) {
            positions_m.push(place);
            vain = 0;
        }
    }
}

/// Joins places whose circle (with the edge as diameter) holds no other place: the Gabriel graph,
/// which is planar.
fn links(
    crater: &Crater,
    settings: &RoadmapSettings,
    positions_m: &[Point2<f64>],
    stream: &mut Stream,
) -> Vec<Vec<(usize, f64)>> {
    let longest_m = LONGEST_EDGE * settings.spacing_m;
    let mut links = vec![Vec::new(); positions_m.len()];
    for (u, &from) in positions_m.iter().enumerate() {
        for (v, &to) in positions_m.iter().enumerate().skip(u + 1) {
            let length_m = (to - from).norm();
            if length_m > longest_m {
                continue;
            }
            let middle = nalgebra::center(&from, &to);
            let free = |(w, p): (usize, &Point2<f64>)| {
                w == u || w == v || (p - middle).norm_squared() > 0.25 * length_m * length_m
            };
            if positions_m.iter().enumerate().all(free)
                && crater.is_clear(from, to, settings.margin_m)
            {
                let chance = 1.0 + CHANCE_COST * stream.uniform();
                let cost = chance * length_m * roughness(crater, from, to);
                links[u].push((v, cost));
                links[v].push((u, cost));
            }
        }
    }
    links
}

/// The mean cost of a metre on the way, from 1 on the level to [`SLOPE_COST`] at the slope limit.
fn roughness(crater: &Crater, from: Point2<f64>, to: Point2<f64>) -> f64 {
    let limit_rad = crater.settings().slope_limit_rad;
    let samples = 8;
    let sum: f64 = (0..=samples)
        .map(|i| {
            let p = from + (to - from) * (f64::from(i) / f64::from(samples));
            let steep = crater.terrain().slope_rad(p.x, p.y) / limit_rad;
            1.0 + (SLOPE_COST - 1.0) * steep * steep
        })
        .sum();
    sum / f64::from(samples + 1)
}

/// Draws vertices towards the middle of their neighbours, where that stays safe, planar and apart
/// from other vertices: a road bends less than the places it was laid through. Ends stay.
pub(super) fn straighten(
    crater: &Crater,
    settings: &RoadmapSettings,
    positions_m: &mut [Point2<f64>],
    edges: &[(usize, usize)],
) {
    let mut joined = vec![Vec::new(); positions_m.len()];
    for &(u, v) in edges {
        joined[u].push(v);
        joined[v].push(u);
    }
    for _ in 0..STRAIGHTENINGS {
        for vertex in 0..positions_m.len() {
            let around = &joined[vertex];
            if around.len() < 2 {
                continue;
            }
            let sum = around.iter().fold(nalgebra::Vector2::zeros(), |s, &w| {
                s + positions_m[w].coords
            });
            let middle = Point2::from(sum / around.len() as f64);
            let place = on_centimetres(nalgebra::center(&positions_m[vertex], &middle));
            let apart = positions_m.iter().enumerate().all(|(w, p)| {
                let least = if around.contains(&w) { 0.75 } else { 0.95 };
                w == vertex || (p - place).norm() >= least * settings.spacing_m
            });
            let uncrossed = around.iter().all(|&w| {
                edges.iter().all(|&(a, b)| {
                    let touches = [a, b].iter().any(|&end| end == vertex || end == w);
                    touches || !segments_meet(place, positions_m[w], positions_m[a], positions_m[b])
                })
            });
            let clear = |&w: &usize| crater.is_clear(place, positions_m[w], settings.margin_m);
            if apart && uncrossed && around.iter().all(clear) {
                positions_m[vertex] = place;
            }
        }
    }
}
