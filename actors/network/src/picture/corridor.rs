//! Corridors: chains of vertices where rovers cannot pass each other.

use std::collections::BTreeSet;

use farside_actors::invariants::Place;
use farside_worlds::{Roadmap, VertexId};

use super::PictureError;
use crate::tracks::{Sighting, Tracks};
use crate::waits::Waits;

/// Every corridor of a roadmap: a maximal chain of vertices with two neighbours each, and the
/// vertices at its ends, which are junctions or dead ends. A chain that begins and ends at one
/// junction, or has no junction at all, has its first vertex once. Sorted, each from the end with
/// the lower number.
pub(crate) fn corridors(roadmap: &Roadmap) -> Vec<Vec<VertexId>> {
    let inner = |v: VertexId| roadmap.neighbors(v).len() == 2;
    let mut done = BTreeSet::new();
    let mut found = Vec::new();
    for start in roadmap.vertices().filter(|v| inner(*v)) {
        if done.contains(&start) {
            continue;
        }
        let [left, right] = [0, 1].map(|side| walk(roadmap, start, roadmap.neighbors(start)[side]));
        let mut chain: Vec<VertexId> = left.iter().rev().copied().collect();
        chain.push(start);
        // Round a ring both walks see the same vertices.
        if left.last() != Some(&start) {
            chain.extend(right);
        }
        if chain.len() > 2 && chain.first() == chain.last() {
            chain.pop();
        }
        if chain.last() < chain.first() {
            chain.reverse();
        }
        done.extend(chain.iter().copied().filter(|v| inner(*v)));
        found.push(chain);
    }
    found.sort_unstable();
    found
}

/// From `start` by `next` on to the first vertex that is no part of a chain, or to `start` again.
fn walk(roadmap: &Roadmap, start: VertexId, next: VertexId) -> Vec<VertexId> {
    let (mut before, mut here) = (start, next);
    let mut way = vec![here];
    while here != start
        && let [a, b] = *roadmap.neighbors(here)
    {
        (before, here) = (here, if a == before { b } else { a });
        way.push(here);
    }
    way
}

/// The line through some vertices: of one, its corridor; between several, the shortest ways.
pub(crate) fn through(
    roadmap: &Roadmap,
    vertices: &[VertexId],
) -> Result<Vec<VertexId>, PictureError> {
    let known = roadmap.len() as u32;
    if let Some(unknown) = vertices.iter().find(|v| v.0 >= known) {
        return Err(PictureError::UnknownVertex {
            vertex: unknown.0,
            roadmap: roadmap.name().to_owned(),
            last: known - 1,
        });
    }
    if let [vertex] = vertices {
        let all = corridors(roadmap);
        let inside = |line: &&Vec<VertexId>| line.contains(vertex);
        let junction = roadmap.neighbors(*vertex).len() != 2;
        return match all.iter().find(inside).filter(|_| !junction) {
            Some(line) => Ok(line.clone()),
            None => Err(PictureError::NotInCorridor {
                vertex: vertex.0,
                neighbors: roadmap.neighbors(*vertex).len(),
            }),
        };
    }
    let mut line: Vec<VertexId> = vertices.first().copied().into_iter().collect();
    for pair in vertices.windows(2) {
        line.extend(roadmap.shortest_path(pair[0], pair[1]).into_iter().skip(1));
    }
    let mut seen = BTreeSet::new();
    match line.iter().find(|v| !seen.insert(**v)) {
        Some(twice) => Err(PictureError::Twice { vertex: twice.0 }),
        None => Ok(line),
    }
}

/// The line on which rovers stand in each other's way: the corridor with the most rovers that wait
/// in a circle at `until_ns`; without two of those in one, the way round the first circle; without
/// circles, the corridor where rovers have stood still for longest.
pub(crate) fn busiest(
    roadmap: &Roadmap,
    tracks: &Tracks,
    rovers: &[Sighting],
    waits: &Waits,
    cycle_ns: u64,
    until_ns: u64,
) -> Result<Vec<VertexId>, PictureError> {
    let stood_ns = standing_ns(roadmap, tracks, cycle_ns, until_ns);
    let circled = |v: VertexId| {
        let here = |sighting: &&Sighting| {
            sighting.place.claim() == Some(v) && waits.in_circle(sighting.rover)
        };
        rovers.iter().find(here).is_some()
    };
    let score = |line: &[VertexId]| {
        let met = line.iter().filter(|v| circled(**v)).count();
        let stood_ns: u64 = line.iter().map(|v| stood_ns[v.0 as usize]).sum();
        (if met > 1 { met } else { 0 }, stood_ns)
    };
    let scored = corridors(roadmap)
        .into_iter()
        .map(|line| (score(&line), line));
    // Of equals the first: `max_by` would take the last.
    let best = scored.rev().max_by(|a, b| a.0.cmp(&b.0));
    match (best, waits.circles.first()) {
        (Some(((met, _), line)), circle) if met > 0 || circle.is_none() => Ok(line),
        (_, Some(circle)) => Ok(round(roadmap, rovers, waits, circle)),
        (_, None) => Err(PictureError::NoCorridor {
            roadmap: roadmap.name().to_owned(),
        }),
    }
}

/// The vertices that the rovers of a circle hold, in order; of two that face each other, with those
/// that stand in line behind them, and a vertex more on both sides.
fn round(roadmap: &Roadmap, rovers: &[Sighting], waits: &Waits, circle: &[u32]) -> Vec<VertexId> {
    let place = |rover: u32| {
        rovers
            .iter()
            .find(|sighting| sighting.rover == rover)?
            .place
            .claim()
    };
    let order = waits.round(circle);
    let mut line: Vec<VertexId> = order.iter().filter_map(|rover| place(*rover)).collect();
    if let [a, b] = order[..] {
        for last in [b, a] {
            let mut last = Some(last);
            while let Some(rover) = last {
                let follows = |other: &&u32| {
                    waits.on[*other].contains(&rover)
                        && place(**other).is_some_and(|v| !line.contains(&v))
                };
                last = waits.behind.iter().find(follows).copied();
                line.extend(last.and_then(place));
            }
            let end = line[line.len() - 1];
            let beyond = roadmap.neighbors(end).iter().find(|v| !line.contains(v));
            line.extend(beyond);
            line.reverse();
        }
    }
    line
}

/// For how long rovers have stood at each vertex, beyond the cycle that any step takes.
fn standing_ns(roadmap: &Roadmap, tracks: &Tracks, cycle_ns: u64, until_ns: u64) -> Vec<u64> {
    let mut stood_ns = vec![0; roadmap.len()];
    for (_, marks) in tracks.rovers() {
        for (at, mark) in marks.iter().enumerate() {
            let end_ns = marks.get(at + 1).map_or(until_ns, |next| next.time_ns);
            let ns = end_ns.min(until_ns).saturating_sub(mark.time_ns);
            if let Place::At(v) = mark.place
                && v != mark.goal
            {
                stood_ns[v.0 as usize] += ns.saturating_sub(cycle_ns);
            }
        }
    }
    stood_ns
}

/// Since when the rovers of a circle stand as they do.
pub(crate) fn closed_ns(
    tracks: &Tracks,
    rovers: &[Sighting],
    circle: &[u32],
    until_ns: u64,
) -> u64 {
    let since = |sighting: &Sighting| {
        let (_, marks) = tracks
            .rovers()
            .find(|(rover, _)| *rover == sighting.rover)?;
        let last = marks.iter().rfind(|mark| mark.time_ns <= until_ns)?;
        Some(last.time_ns)
    };
    let members = rovers.iter().filter(|sighting| {
        circle.contains(&sighting.rover) && matches!(sighting.place, Place::At(_))
    });
    members.filter_map(since).max().unwrap_or(until_ns)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use nalgebra::Point2;
    use proptest::prelude::*;

    use super::*;

    /// A part of a grid of 5 by 4: the edges that are kept, as far as they hang together with the
    /// first one's end.
    fn maze(kept: &[bool]) -> Option<Roadmap> {
        let (width, height) = (5u32, 4u32);
        let mut edges = Vec::new();
        for v in 0..width * height {
            if v % width + 1 < width {
                edges.push((v, v + 1));
            }
            if v / width + 1 < height {
                edges.push((v, v + width));
            }
        }
        let mut edges: Vec<_> = edges
            .into_iter()
            .zip(kept)
            .filter(|e| *e.1)
            .map(|e| e.0)
            .collect();
        let mut part = BTreeSet::from([edges.first()?.0]);
        for _ in 0..edges.len() {
            for (a, b) in &edges {
                if part.contains(a) || part.contains(b) {
                    part.extend([*a, *b]);
                }
            }
        }
        edges.retain(|(a, _)| part.contains(a));
        let number: BTreeMap<u32, VertexId> =
            part.iter().copied().zip((0..).map(VertexId)).collect();
        let place = |v: &u32| Point2::new(f64::from(v % width), f64::from(v / width));
        let places = part.iter().map(place).collect();
        let edges = edges.iter().map(|(a, b)| (number[a], number[b])).collect();
        Some(Roadmap::new("maze", places, edges, vec![VertexId(0)]).unwrap())
    }

    /// The chains' inner vertices, by joining neighbours until nothing changes.
    fn chains(map: &Roadmap) -> BTreeSet<Vec<VertexId>> {
        let inner: Vec<VertexId> = map
            .vertices()
            .filter(|v| map.neighbors(*v).len() == 2)
            .collect();
        let mut label: BTreeMap<VertexId, VertexId> = inner.iter().map(|v| (*v, *v)).collect();
        for _ in 0..inner.len() {
            for &(u, v) in map.edges() {
                if let (Some(&a), Some(&b)) = (label.get(&u), label.get(&v)) {
                    label.insert(u, a.min(b));
                    label.insert(v, a.min(b));
                }
            }
        }
        let of = |root: &VertexId| {
            inner
                .iter()
                .copied()
                .filter(|v| label[v] == *root)
                .collect()
        };
        label.values().map(of).collect()
    }

    proptest! {
        #[test]
        fn corridors_are_the_chains_between_junctions(
            kept in prop::collection::vec(any::<bool>(), 31),
        ) {
            let Some(map) = maze(&kept) else { return Ok(()); };
            let found = corridors(&map);
            let inner = |v: &VertexId| map.neighbors(*v).len() == 2;
            let insides: BTreeSet<Vec<VertexId>> = found.iter().map(|line| {
                let mut inside: Vec<VertexId> = line.iter().copied().filter(inner).collect();
                inside.sort_unstable();
                inside
            }).collect();
            prop_assert_eq!(&insides, &chains(&map));
            prop_assert_eq!(insides.len(), found.len());
            for line in &found {
                let is_line = line.windows(2).all(|step| map.are_adjacent(step[0], step[1]));
                prop_assert!(is_line, "{line:?}");
                prop_assert_eq!(line.iter().collect::<BTreeSet<_>>().len(), line.len());
                // All but the ends are inner; ends are not, unless the line is closed.
                let (first, last) = (&line[0], &line[line.len() - 1]);
                prop_assert!(line[1..line.len() - 1].iter().all(inner));
                let closed = map.are_adjacent(*first, *last) && line.len() > 2;
                prop_assert!(closed || !inner(first) && !inner(last), "{line:?}");
                let inside = line.iter().find(|v| inner(v)).unwrap();
                prop_assert_eq!(&through(&map, &[*inside]).unwrap(), line);
            }
        }
    }
}
