//! Contour lines.

use std::collections::BTreeMap;

use farside_worlds::HeightField;

/// A place on the edge of a cell: the sample it begins at, and whether it goes north.
type Crossing = (usize, usize, bool);

/// The lines at one height \[m\], each a chain of points (x, y) \[m\], found by marching over
/// squares of `stride` samples. Closed lines end where they begin.
pub(super) fn contours(terrain: &HeightField, height_m: f64, stride: usize) -> Vec<Vec<[f64; 2]>> {
    let (columns, rows) = (terrain.columns() / stride, terrain.rows() / stride);
    let heights_m = terrain.heights_m();
    // A level that a sample is exactly on would be met twice.
    let level_m = height_m + 1e-9;
    let at = |c: usize, r: usize| heights_m[r * stride * terrain.columns() + c * stride];
    let place = |&(c, r, north): &Crossing| {
        let (c2, r2) = if north { (c, r + 1) } else { (c + 1, r) };
        let (a, b) = (at(c, r), at(c2, r2));
        let share = (level_m - a) / (b - a);
        let from = terrain.sample_position_m(c * stride, r * stride);
        let to = terrain.sample_position_m(c2 * stride, r2 * stride);
        [
            from.x + (to.x - from.x) * share,
            from.y + (to.y - from.y) * share,
        ]
    };
    let mut joined = BTreeMap::<Crossing, Vec<Crossing>>::new();
    for r in 0..rows.saturating_sub(1) {
        for c in 0..columns.saturating_sub(1) {
            let corners = [(c, r), (c + 1, r), (c + 1, r + 1), (c, r + 1)];
            let high = corners.map(|(c, r)| at(c, r) > level_m);
            let sides = [
                (c, r, false),
                (c + 1, r, true),
                (c, r + 1, false),
                (c, r, true),
            ];
            let met: Vec<Crossing> = (0..4)
                .filter(|side| high[*side] != high[(*side + 1) % 4])
                .map(|side| sides[side])
                .collect();
            // Of a saddle's four crossings, those of the south and the east belong together.
            for pair in met.chunks_exact(2) {
                joined.entry(pair[0]).or_default().push(pair[1]);
                joined.entry(pair[1]).or_default().push(pair[0]);
            }
        }
    }
    let chains = chains(joined);
    let places = |chain: Vec<Crossing>| chain.iter().map(place).collect();
    chains.into_iter().map(places).collect()
}

/// The chains of a graph in which nothing has more than two neighbours; open ones first.
fn chains(mut joined: BTreeMap<Crossing, Vec<Crossing>>) -> Vec<Vec<Crossing>> {
    let mut chains = Vec::new();
    let ends: Vec<Crossing> = joined
        .iter()
        .filter(|(_, next)| next.len() == 1)
        .map(|(end, _)| *end)
        .collect();
    let mut follow = |start: Crossing| {
        let mut chain = vec![start];
        let mut here = start;
        while let Some(next) = joined.get_mut(&here).and_then(Vec::pop) {
            if let Some(back) = joined.get_mut(&next)
                && let Some(at) = back.iter().position(|other| *other == here)
            {
                back.remove(at);
            }
            chain.push(next);
            here = next;
        }
        if chain.len() > 1 {
            chains.push(chain);
        }
        joined.retain(|_, next| !next.is_empty());
        joined.keys().next().copied()
    };
    let mut rest = None;
    for end in ends {
        rest = follow(end);
    }
    let mut start = rest.or_else(|| follow((usize::MAX, 0, false)));
    while let Some(next) = start {
        start = follow(next);
    }
    chains
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;

    #[test]
    fn a_cone_has_circles() {
        let side = 41;
        let height = |i: usize| {
            let (x, y) = ((i % side) as f64 - 20.0, (i / side) as f64 - 20.0);
            (x * x + y * y).sqrt()
        };
        let heights_m = (0..side * side).map(height).collect();
        let cone = HeightField::new(Point2::new(-20.0, -20.0), 1.0, side, heights_m).unwrap();
        for radius_m in [3.0, 7.5, 15.0] {
            let found = contours(&cone, radius_m, 1);
            assert_eq!(found.len(), 1, "{radius_m}");
            let line = &found[0];
            assert_eq!(line.first(), line.last());
            for [x, y] in line {
                assert!(
                    ((x * x + y * y).sqrt() - radius_m).abs() < 0.2,
                    "{radius_m}: {x}, {y}"
                );
            }
            let length_m: f64 = line
                .windows(2)
                .map(|p| {
                    let (x, y) = (p[1][0] - p[0][0], p[1][1] - p[0][1]);
                    (x * x + y * y).sqrt()
                })
                .sum();
            let circle_m = 2.0 * std::f64::consts::PI * radius_m;
            assert!(
                (length_m / circle_m - 1.0).abs() < 0.02,
                "{radius_m}: {length_m}"
            );
        }
        // What leaves the field is open: four arcs in its corners.
        let arcs = contours(&cone, 22.0, 1);
        assert_eq!(arcs.len(), 4);
        assert!(arcs.iter().all(|arc| arc.first() != arc.last()));
        assert!(contours(&cone, 50.0, 1).is_empty());
    }
}
