//! Draws a built-in roadmap over its crater as an SVG on standard output, each vertex in the colour
//! of the sensor node that owns it, as in Figures 1 and 4 of the network-guided paper.
//!
//! ```text
//! cargo run -p farside-worlds --example draw_world -- crater-dense 28 1 > world.svg
//! ```

use std::fmt::Write;

use farside_worlds::{Crater, CraterSettings, Hazard, NodeId, Roadmap, SensorNetwork};

/// The side of a drawn square of terrain [m].
const SQUARE_M: f64 = 4.0;

/// Far apart from one another and from the ground.
const COLOURS: [&str; 28] = [
    "#e6194b", "#3cb44b", "#ffe119", "#4363d8", "#f58231", "#911eb4", "#46f0f0", "#f032e6",
    "#bcf60c", "#fabebe", "#008080", "#e6beff", "#9a6324", "#fffac8", "#800000", "#aaffc3",
    "#808000", "#ffd8b1", "#000075", "#00c853", "#ff6d00", "#304ffe", "#c51162", "#00b8d4",
    "#aeea00", "#6200ea", "#ffab00", "#3e2723",
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let name = words.next().unwrap_or_else(|| "crater-dense".to_owned());
    let nodes = words.next().map_or(Ok(28), |word| word.parse())?;
    let seed = words.next().map_or(Ok(1), |word| word.parse())?;
    let map = Roadmap::builtin(&name)?;
    let radius_m = SensorNetwork::default_radius_m(&map, nodes);
    let network = SensorNetwork::place(&map, nodes, radius_m, seed)?;
    let crater = Crater::generate(&CraterSettings::default())?;
    let half = crater.settings().half_side_m;
    let mut svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' width='1024' height='1024' \
         viewBox='{} {} {} {}'>\n<g transform='scale(1,-1)'>\n",
        -half,
        -half,
        2.0 * half,
        2.0 * half
    );
    ground(&mut svg, &crater)?;
    roads(&mut svg, &map, &network)?;
    svg.push_str("</g>\n</svg>\n");
    print!("{svg}");
    Ok(())
}

/// Shaded relief, hazards tinted, boulders as dots.
fn ground(svg: &mut String, crater: &Crater) -> std::fmt::Result {
    let half = crater.settings().half_side_m;
    let squares = (2.0 * half / SQUARE_M) as u32;
    for row in 0..squares {
        for column in 0..squares {
            let x_m = -half + (f64::from(column) + 0.5) * SQUARE_M;
            let y_m = -half + (f64::from(row) + 0.5) * SQUARE_M;
            let rise = crater.terrain().gradient(x_m, y_m);
            // Light from the north-west.
            let light = (0.62 + 0.9 * (rise.x - rise.y)).clamp(0.1, 1.0);
            let (red, green, blue) = match crater.hazard(x_m, y_m) {
                Hazard::Steep => (215.0, 130.0, 110.0),
                _ => (190.0, 176.0, 158.0),
            };
            writeln!(
                svg,
                "<rect x='{}' y='{}' width='{SQUARE_M}.1' height='{SQUARE_M}.1' \
                 fill='rgb({:.0},{:.0},{:.0})'/>",
                x_m - SQUARE_M / 2.0,
                y_m - SQUARE_M / 2.0,
                red * light,
                green * light,
                blue * light
            )?;
        }
    }
    let least_m = crater.settings().boulder_least_m;
    for rock in crater
        .rocks()
        .iter()
        .filter(|rock| rock.diameter_m >= least_m)
    {
        let (p, radius_m) = (rock.position_m, 0.5 * rock.diameter_m);
        writeln!(
            svg,
            "<circle cx='{}' cy='{}' r='{radius_m}' fill='#3a3028'/>",
            p.x, p.y
        )?;
    }
    Ok(())
}

fn roads(svg: &mut String, map: &Roadmap, network: &SensorNetwork) -> std::fmt::Result {
    let colour = |n: NodeId| COLOURS[n.0 as usize % COLOURS.len()];
    for &(u, v) in map.edges() {
        let (p, q) = (map.position_m(u), map.position_m(v));
        writeln!(
            svg,
            "<line x1='{}' y1='{}' x2='{}' y2='{}' stroke='#111' stroke-width='1.4'/>",
            p.x, p.y, q.x, q.y
        )?;
    }
    for v in map.vertices() {
        let (p, fill) = (map.position_m(v), colour(network.owner(v)));
        let gate = map.boundary().contains(&v);
        let (radius_m, stroke) = if gate { (5.0, "#fff") } else { (3.4, "#111") };
        writeln!(
            svg,
            "<circle cx='{}' cy='{}' r='{radius_m}' fill='{fill}' stroke='{stroke}'/>",
            p.x, p.y
        )?;
    }
    for n in network.nodes() {
        let (p, fill) = (network.position_m(n), colour(n));
        writeln!(
            svg,
            "<path d='M{} {}l6 10h-12z' fill='{fill}' stroke='#fff' stroke-width='1.5'/>",
            p.x,
            p.y - 5.0
        )?;
    }
    Ok(())
}
