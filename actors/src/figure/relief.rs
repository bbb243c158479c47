//! The shape of the ground as contour lines.

use std::collections::BTreeMap;

use farside_worlds::HeightField;
use maud::{Markup, html};

use super::svg::path;

/// The most lines' heights that are drawn.
const MOST_LEVELS: f64 = 40.0;

/// Contour lines of a terrain, a path of class `relief` for each height, `relief low` below 0.
///
/// `px` places a point (x, y) \[m\] in the figure, `px_per_m` is its scale, and nothing is drawn that
/// is not `inside`, in pixels.
///
/// ```
/// use farside_actors::figure::relief;
/// use farside_worlds::HeightField;
/// use nalgebra::Point2;
/// let slope_m = (0..400).map(|i| f64::from(i % 20)).collect();
/// let terrain = HeightField::new(Point2::origin(), 1.0, 20, slope_m)?;
/// let drawn = relief::draw(&terrain, 10.0, |[x, y]| (10.0 * x, 10.0 * y), |_| true);
/// assert!(drawn.into_string().contains("class=\"relief\""));
/// # Ok::<(), farside_worlds::TerrainError>(())
/// ```
pub fn draw(
    terrain: &HeightField,
    px_per_m: f64,
    px: impl Fn([f64; 2]) -> (f64, f64),
    inside: impl Fn(&(f64, f64)) -> bool,
) -> Markup {
    let (low_m, high_m) = heights_m(terrain);
    let step_m = contour_step_m(terrain);
    let first = libm::ceil(low_m / step_m);
    let levels = libm::floor(high_m / step_m) - first;
    // Finer than two pixels nobody sees.
    let stride = (2.0 / (terrain.resolution_m() * px_per_m)).max(2.0) as usize;
    html! {
        @for level in 0..=levels.clamp(0.0, MOST_LEVELS) as u32 {
            @let height_m = (first + f64::from(level)) * step_m;
            @let class = if height_m < 0.0 { "relief low" } else { "relief" };
            @let lines = contours(terrain, height_m, stride);
            @let lines = lines.iter().map(|line| line.iter().map(|p| px(*p)));
            @let data: String = lines.map(|line| parts(line, &inside)).collect();
            @if !data.is_empty() {
                path class=(class) d=(data) { title { (height_m) " m" } }
            }
        }
    }
}

/// The height from contour to contour \[m\].
pub fn contour_step_m(terrain: &HeightField) -> f64 {
    let (low_m, high_m) = heights_m(terrain);
    step((high_m - low_m) / 12.0)
}

/// The parts of a line that are inside, as a path's data.
fn parts(line: impl Iterator<Item = (f64, f64)>, inside: impl Fn(&(f64, f64)) -> bool) -> String {
    let (mut data, mut part) = (String::new(), Vec::new());
    for point in line {
        if inside(&point) {
            part.push(point);
        } else if !part.is_empty() {
            data.push_str(&path(part.drain(..)));
        }
    }
    data.push_str(&path(part));
    data
}

/// The lowest and the highest ground \[m\].
fn heights_m(terrain: &HeightField) -> (f64, f64) {
    let heights_m = terrain.heights_m().iter().copied();
    let low_m = heights_m.clone().fold(f64::INFINITY, f64::min);
    (low_m, heights_m.fold(f64::NEG_INFINITY, f64::max))
}

/// 1, 2 or 5 times a power of ten, at least `rough`; 1 if that is not over 0.
pub fn step(rough: f64) -> f64 {
    if rough <= 0.0 || !rough.is_finite() {
        return 1.0;
    }
    let power = libm::pow(10.0, libm::floor(libm::log10(rough)));
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
    steps
        .into_iter()
        .find(|step| *step >= rough)
        .unwrap_or(10.0 * power)
}

/// A place on the edge of a cell: the sample it begins at, and whether it goes north.
type Crossing = (usize, usize, bool);

/// The lines at one height \[m\], each a chain of points (x, y) \[m\], found by marching over
/// squares of `stride` samples. Closed lines end where they begin.
fn contours(terrain: &HeightField, height_m: f64, stride: usize) -> Vec<Vec<[f64; 2]>> {
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
