//! Few colours for many nodes: neighbouring territories differ.

use std::collections::BTreeSet;

use farside_worlds::{NodeId, Roadmap, SensorNetwork};

/// How many colours there are for territories; their style classes are `n0` to `n7`.
pub(crate) const COLOURS: usize = 8;

/// The colours where no style sheet is, for dark backgrounds as viewers have them: red, green and
/// blue from 0 to 1. The same hues as in `picture.css`; none is near the red of deadlocks.
pub(crate) const RGB: [[f64; 3]; COLOURS] = [
    [0.31, 0.58, 0.87],
    [0.24, 0.70, 0.44],
    [0.82, 0.65, 0.22],
    [0.64, 0.50, 0.86],
    [0.30, 0.75, 0.78],
    [0.72, 0.56, 0.42],
    [0.66, 0.74, 0.32],
    [0.84, 0.56, 0.74],
];

/// A colour for each node. Nodes whose territories an edge joins get different ones, as long as
/// colours last; among those left, the one that is rarest up to now.
pub(crate) fn colours(roadmap: &Roadmap, sensors: &SensorNetwork) -> Vec<usize> {
    let mut touching = vec![BTreeSet::new(); sensors.len()];
    for &(u, v) in roadmap.edges() {
        let (a, b) = (sensors.owner(u), sensors.owner(v));
        if a != b {
            touching[a.0 as usize].insert(b);
            touching[b.0 as usize].insert(a);
        }
    }
    // Those with the most neighbours first, while there is choice.
    let mut order: Vec<NodeId> = sensors.nodes().collect();
    order.sort_by_key(|node| (usize::MAX - touching[node.0 as usize].len(), *node));
    let mut colours = vec![None; sensors.len()];
    let mut used = [0; COLOURS];
    for node in order {
        let near = &touching[node.0 as usize];
        let clashes = |colour: usize| {
            let same = |other: &&NodeId| colours[other.0 as usize] == Some(colour);
            near.iter().filter(same).count()
        };
        let best = (0..COLOURS).min_by_key(|colour| (clashes(*colour), used[*colour], *colour));
        let colour = best.unwrap_or(0);
        colours[node.0 as usize] = Some(colour);
        used[colour] += 1;
    }
    colours
        .into_iter()
        .map(|colour| colour.unwrap_or(0))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn territories_that_touch_differ() {
        for name in ["crater-dense", "crater-sparse"] {
            let map = Roadmap::builtin(name).unwrap();
            for (nodes, seed) in [(14, 1), (21, 2), (28, 3), (28, 4)] {
                let radius_m = SensorNetwork::default_radius_m(&map, nodes);
                let sensors = SensorNetwork::place(&map, nodes, radius_m, seed).unwrap();
                let colours = colours(&map, &sensors);
                for &(u, v) in map.edges() {
                    let (a, b) = (sensors.owner(u), sensors.owner(v));
                    let differ = colours[a.0 as usize] != colours[b.0 as usize];
                    assert!(a == b || differ, "{name}, {nodes} nodes: {a:?} and {b:?}");
                }
            }
        }
    }
}
