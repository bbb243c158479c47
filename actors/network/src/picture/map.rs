//! The map at an instant: ground, roadmap in the colours of its nodes (the paper's figure 1),
//! rovers, and who stands in whose way.

mod labels;
mod legend;

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

use farside::SimDuration;
use farside_actors::invariants::Place;
use farside_worlds::{NodeId, VertexId};
use maud::{Markup, html};

use super::colouring;
use super::{Drawn, Surroundings, counted};
use crate::tracks::Sighting;
use crate::waits::{Waits, nearer};
use farside_actors::figure::svg::{Px, over_lines, path};
use farside_actors::figure::{Figure, relief};

/// The middle length of an edge, in pixels; a map too large for that is drawn smaller.
const EDGE: f64 = 34.0;
/// The longest side of a map, in pixels.
const LONGEST: f64 = 2400.0;
/// Above the map: title and a line below it.
const TOP: f64 = 64.0;
const SIDE: f64 = 16.0;
/// Right of the map: the legend.
const LEGEND: f64 = 268.0;

/// What is drawn where.
struct Sheet<'a> {
    run: &'a Drawn,
    colours: Vec<usize>,
    /// The north-western corner \[m\].
    corner_m: [f64; 2],
    px_per_m: f64,
    width: f64,
    height: f64,
    /// The radius of a rover, in pixels.
    rover: f64,
}

pub(super) fn figure(run: &Drawn, at_ns: u64, coordination: bool) -> Figure {
    let rovers = run.tracks.at(at_ns);
    let waits = run.waits(&rovers);
    let sheet = Sheet::new(run);
    let at = SimDuration::from_nanos(at_ns);
    let count = |counted: fn(&&Sighting) -> bool| rovers.iter().filter(counted).count();
    let on_map = count(|rover| rover.place != Place::Away);
    let (queued, gone) = (count(|r| r.is_queued()), count(|r| r.is_gone()));
    let circled: usize = waits.circles.iter().map(Vec::len).sum();
    let title = format!("{}, seed {}, at {at}", run.scenario, run.seed);
    let cycle = at_ns / run.site.cycle.as_nanos();
    let mut says =
        format!("Cycle {cycle}. {on_map} rovers on the map, {queued} in queues, {gone} gone.");
    if circled > 0 {
        let behind = waits.behind.len();
        says.push_str(&format!(
            " {circled} wait for each other in {}, {behind} wait behind them.",
            counted(waits.circles.len(), "circle")
        ));
        says.push_str(&run.shortest_circle(&waits, &rovers));
    }
    if !waits.locked.is_empty() {
        let locked = counted(waits.locked.len(), "rover");
        says.push_str(&format!(" {locked} can never move again."));
    }
    let coordination = coordination && run.site.coordinates;
    let pairs = coordination.then(|| sheet.coordination(&rovers));
    let mut labels = labels::Labels::new(sheet.obstacles(&rovers));
    let height = sheet.height.max(legend::HEIGHT);
    let body = html! {
        text class="title" x=(Px(SIDE)) y="28" { (title) }
        text class="tick" x=(Px(SIDE)) y="50" { (says) }
        (sheet.ground())
        (sheet.radio())
        (sheet.roads())
        (sheet.ends(&rovers))
        @if let Some(pairs) = &pairs { path class="coordination" d=(pairs) {} }
        (sheet.posts())
        (sheet.arrows(&rovers, &waits))
        @for sighting in &rovers { (sheet.rover(sighting, &waits)) }
        (sheet.queues(&rovers, &mut labels))
        (sheet.names(&mut labels))
        (legend::legend(&sheet, (SIDE + sheet.width + 24.0, TOP + 10.0), coordination))
    };
    Figure {
        file: "map.svg".to_owned(),
        title: format!("Map of {title}"),
        description: says,
        width: sheet.width + 2.0 * SIDE + LEGEND,
        height: height + TOP + SIDE,
        body,
        facet: String::new(),
        style: super::STYLE,
    }
}

impl<'a> Sheet<'a> {
    fn new(run: &'a Drawn) -> Self {
        let roadmap = &run.site.roadmap;
        let mut lengths_m: Vec<f64> = roadmap
            .edges()
            .iter()
            .map(|&(u, v)| (roadmap.position_m(v) - roadmap.position_m(u)).norm())
            .collect();
        lengths_m.sort_by(f64::total_cmp);
        let middle_m = lengths_m.get(lengths_m.len() / 2).copied().unwrap_or(1.0);
        let vertices = roadmap.vertices().map(|v| roadmap.position_m(v));
        let posts = run
            .site
            .sensors
            .nodes()
            .map(|n| run.site.sensors.position_m(n));
        let mut all: Vec<[f64; 2]> = vertices.chain(posts).map(|p| [p.x, p.y]).collect();
        if let Surroundings::Walls { middles_m, .. } = &run.site.ground {
            all.extend(middles_m);
        }
        let range = |axis: usize| {
            let values = all.iter().map(|p| p[axis]);
            let low = values.clone().fold(f64::INFINITY, f64::min);
            (
                low - middle_m,
                values.fold(f64::NEG_INFINITY, f64::max) + middle_m,
            )
        };
        let ((west, east), (south, north)) = (range(0), range(1));
        let longest_m = (east - west).max(north - south);
        let px_per_m = (EDGE / middle_m).min(LONGEST / longest_m);
        Sheet {
            colours: colouring::colours(roadmap, &run.site.sensors),
            corner_m: [west, north],
            px_per_m,
            width: (east - west) * px_per_m,
            height: (north - south) * px_per_m,
            rover: (0.27 * middle_m * px_per_m).clamp(3.0, 9.5),
            run,
        }
    }

    fn px(&self, [x_m, y_m]: [f64; 2]) -> (f64, f64) {
        let [west, north] = self.corner_m;
        (
            SIDE + (x_m - west) * self.px_per_m,
            TOP + (north - y_m) * self.px_per_m,
        )
    }

    fn at(&self, v: VertexId) -> (f64, f64) {
        let at = self.run.site.roadmap.position_m(v);
        self.px([at.x, at.y])
    }

    fn colour(&self, node: NodeId) -> usize {
        self.colours[node.0 as usize]
    }

    /// Contours or walls.
    fn ground(&self) -> Markup {
        let inside = |&(x, y): &(f64, f64)| {
            let (x, y) = (x - SIDE, y - TOP);
            (0.0..=self.width).contains(&x) && (0.0..=self.height).contains(&y)
        };
        match &self.run.site.ground {
            Surroundings::Unknown => html! {},
            Surroundings::Walls { middles_m, cell_m } => {
                let side = cell_m * self.px_per_m;
                let mut data = String::new();
                for middle in middles_m {
                    let (x, y) = self.px(*middle);
                    let (x, y) = (x - side / 2.0, y - side / 2.0);
                    let corners = [(x, y), (x + side, y), (x + side, y + side), (x, y + side)];
                    data.push_str(&path(corners));
                    data.push('Z');
                }
                html! { path class="wall" d=(data) {} }
            }
            Surroundings::Heights(terrain) => {
                relief::draw(terrain, self.px_per_m, |at_m| self.px(at_m), inside)
            }
        }
    }

    /// Lines between nodes that hear each other.
    fn radio(&self) -> Markup {
        let sensors = &self.run.site.sensors;
        let at = |n: NodeId| {
            let at = sensors.position_m(n);
            self.px([at.x, at.y])
        };
        let mut data = String::new();
        for a in sensors.nodes() {
            for &b in sensors.neighbors(a).iter().filter(|b| a < **b) {
                data.push_str(&path([at(a), at(b)]));
            }
        }
        html! { path class="radio" d=(data) {} }
    }

    /// Each edge in the colours of its ends' owners, half and half.
    fn roads(&self) -> Markup {
        let (roadmap, sensors) = (&self.run.site.roadmap, &self.run.site.sensors);
        let mut roads = vec![String::new(); sensors.len()];
        for &(u, v) in roadmap.edges() {
            let (a, b) = (self.at(u), self.at(v));
            let middle = ((a.0 + b.0) / 2.0, (a.1 + b.1) / 2.0);
            let (of_u, of_v) = (sensors.owner(u), sensors.owner(v));
            if of_u == of_v {
                roads[of_u.0 as usize].push_str(&path([a, b]));
            } else {
                roads[of_u.0 as usize].push_str(&path([a, middle]));
                roads[of_v.0 as usize].push_str(&path([middle, b]));
            }
        }
        html! {
            @for node in sensors.nodes() {
                g class={ "n" (self.colour(node)) } {
                    title { "node " (node.0 + 1) }
                    path class="road" d=(roads[node.0 as usize]) {}
                    @for v in sensors.owned(node) {
                        @let (x, y) = self.at(*v);
                        @let (class, says) = match sensors.covers(*v) {
                            true => ("vertex", ""),
                            false => ("vertex gap", ", in a gap"),
                        };
                        circle class=(class) cx=(Px(x)) cy=(Px(y)) r="3.2" {
                            title { "vertex " (v.0) ", node " (node.0 + 1) (says) }
                        }
                    }
                }
            }
        }
    }

    /// Entries and exits, and how many wait at each entry.
    fn ends(&self, rovers: &[Sighting]) -> Markup {
        let entries: BTreeSet<VertexId> = rovers.iter().map(|sighting| sighting.entry).collect();
        let exits: BTreeSet<VertexId> = rovers.iter().map(|sighting| sighting.goal).collect();
        let (from, to) = ends_of(&self.run.site.ground);
        html! {
            @for v in &entries {
                @let at = self.at(*v);
                path class="entry" d=(entry_mark(at)) { title { (from) " " (v.0) } }
            }
            @for v in &exits {
                @let at = self.at(*v);
                path class="exit" d=(exit_mark(at)) { title { (to) " " (v.0) } }
            }
        }
    }

    /// How many wait at each entry.
    fn queues(&self, rovers: &[Sighting], labels: &mut labels::Labels) -> Markup {
        let mut queues = BTreeMap::<VertexId, usize>::new();
        for sighting in rovers.iter().filter(|sighting| sighting.is_queued()) {
            *queues.entry(sighting.entry).or_default() += 1;
        }
        html! {
            @for (v, queue) in &queues {
                @let text = format!("+{queue}");
                @let at = labels.place(self.at(*v), 8.0, &text);
                g {
                    title { (queue) " in the queue of entry " (v.0) }
                    (over_lines("queue", at, "middle", &text))
                }
            }
        }
    }

    /// What names and numbers are not to lie on: rovers, entries, exits, nodes.
    fn obstacles(&self, rovers: &[Sighting]) -> Vec<labels::Rect> {
        let ends = rovers
            .iter()
            .flat_map(|sighting| [sighting.entry, sighting.goal]);
        let ends: BTreeSet<VertexId> = ends.collect();
        let ends = ends
            .into_iter()
            .map(|v| labels::Rect::around(self.at(v), 7.0));
        let discs = rovers.iter().filter_map(|sighting| self.place(sighting));
        let discs = discs.map(|at| labels::Rect::around(at, self.rover));
        let sensors = &self.run.site.sensors;
        let posts = sensors.nodes().map(|node| {
            let at = sensors.position_m(node);
            labels::Rect::around(self.px([at.x, at.y]), 6.5)
        });
        ends.chain(discs).chain(posts).collect()
    }

    fn posts(&self) -> Markup {
        let sensors = &self.run.site.sensors;
        html! {
            @for node in sensors.nodes() {
                @let at = sensors.position_m(node);
                @let (x, y) = self.px([at.x, at.y]);
                @let side = [(x, y - 6.5), (x + 6.5, y), (x, y + 6.5), (x - 6.5, y)];
                g class={ "n" (self.colour(node)) } {
                    path class="post" d={ (path(side)) "Z" } {}
                }
            }
        }
    }

    /// The names of nodes, above all else and where they cover nothing that matters.
    fn names(&self, labels: &mut labels::Labels) -> Markup {
        let sensors = &self.run.site.sensors;
        html! {
            @for node in sensors.nodes() {
                @let at = sensors.position_m(node);
                @let name = format!("N{}", node.0 + 1);
                @let at = labels.place(self.px([at.x, at.y]), 7.5, &name);
                g class={ "n" (self.colour(node)) } {
                    (over_lines("post-name", at, "middle", &name))
                }
            }
        }
    }

    /// Lines between the rovers of the coordination graph (section 3.2).
    fn coordination(&self, rovers: &[Sighting]) -> String {
        let places: Vec<_> = rovers
            .iter()
            .filter_map(|r| Some((r, self.place(r)?)))
            .collect();
        let mut data = String::new();
        for (at, (a, from)) in places.iter().enumerate() {
            for (b, to) in &places[at + 1..] {
                if let (Some(u), Some(v)) = (a.place.claim(), b.place.claim())
                    && coordinated(&self.run.site.sensors, u, v)
                {
                    data.push_str(&path([*from, *to]));
                }
            }
        }
        data
    }

    /// Where a rover is, if it is on the map.
    fn place(&self, sighting: &Sighting) -> Option<(f64, f64)> {
        match sighting.place {
            Place::Away => None,
            Place::At(v) => Some(self.at(v)),
            Place::Between(u, v) => {
                let (a, b, share) = (self.at(u), self.at(v), sighting.share);
                Some((a.0 + (b.0 - a.0) * share, a.1 + (b.1 - a.1) * share))
            }
        }
    }

    fn rover(&self, sighting: &Sighting, waits: &Waits) -> Markup {
        let Some((x, y)) = self.place(sighting) else {
            return html! {};
        };
        let roadmap = &self.run.site.roadmap;
        let next = match sighting.place {
            Place::Between(_, to) => Some(to),
            Place::At(here) => nearer(roadmap, here, sighting.goal).next(),
            Place::Away => None,
        };
        let (state, says) = match waits.on.get(&sighting.rover) {
            Some(on) if waits.in_circle(sighting.rover) => {
                (" circle", waits_for(on, "in a circle"))
            }
            Some(on) if waits.behind.contains(&sighting.rover) => {
                (" behind", waits_for(on, "behind a circle"))
            }
            Some(on) => (" waits", waits_for(on, "for now")),
            None => ("", String::new()),
        };
        let number = (sighting.rover + 1).to_string();
        let r = self.rover;
        let to = ends_of(&self.run.site.ground).1;
        html! {
            g {
                title { "rover " (number) " to " (to) " " (sighting.goal.0) (says) }
                @if let Some(next) = next {
                    path class={ "rover" (state) } d=(nose((x, y), self.at(next), r)) {}
                }
                circle class={ "rover disc" (state) } cx=(Px(x)) cy=(Px(y)) r=(Px(r)) {}
                @if r > 6.0 {
                    @let size = if number.len() > 2 { r } else { 1.15 * r };
                    text class={ "number" (state) } x=(Px(x)) y=(Px(y + 0.36 * size))
                        style={ "font-size:" (Px(size)) "px" } text-anchor="middle" { (number) }
                }
            }
        }
    }

    /// From those that wait in a circle, or behind one, to those they wait for.
    fn arrows(&self, rovers: &[Sighting], waits: &Waits) -> Markup {
        let place = |rover: &u32| {
            let sighting = rovers.iter().find(|sighting| sighting.rover == *rover)?;
            self.place(sighting)
        };
        let mut arrows = Vec::new();
        for (rover, on) in &waits.on {
            let circle = waits.circles.iter().find(|circle| circle.contains(rover));
            if circle.is_none() && !waits.behind.contains(rover) {
                continue;
            }
            for holder in on {
                let within = circle.is_some_and(|circle| circle.contains(holder));
                if let (Some(from), Some(to)) = (place(rover), place(holder)) {
                    arrows.push((within, from, to));
                }
            }
        }
        // Those of circles lie above.
        arrows.sort_by_key(|arrow| arrow.0);
        html! {
            @for (within, from, to) in arrows {
                (arrow(from, to, self.rover, if within { "" } else { " behind" }))
            }
        }
    }
}

/// Whether rovers that hold these vertices share an edge of the coordination graph: their owners
/// are the same node or neighbours.
pub(crate) fn coordinated(
    sensors: &farside_worlds::SensorNetwork,
    u: VertexId,
    v: VertexId,
) -> bool {
    let (a, b) = (sensors.owner(u), sensors.owner(v));
    a == b || sensors.are_neighbors(a, b)
}

fn waits_for(on: &[u32], how: &str) -> String {
    let names: Vec<String> = on.iter().map(|rover| (rover + 1).to_string()).collect();
    format!(", waits {how}, for {}", names.join(" and "))
}

/// A pointer out of a disc, towards a place.
fn nose((x, y): (f64, f64), to: (f64, f64), r: f64) -> String {
    let Some((dx, dy)) = direction((x, y), to) else {
        return String::new();
    };
    let (tip, wide) = (1.65 * r, 0.62 * r);
    let base = |side: f64| (x + dx * r * 0.75 - dy * side, y + dy * r * 0.75 + dx * side);
    let data = path([base(wide), (x + dx * tip, y + dy * tip), base(-wide)]);
    format!("{data}Z")
}

/// An arrow beside the line between two discs, so that one there and one back are two.
fn arrow(from: (f64, f64), to: (f64, f64), r: f64, class: &str) -> Markup {
    let Some((dx, dy)) = direction(from, to) else {
        return html! {};
    };
    let aside = 0.55 * r;
    let shift =
        |(x, y): (f64, f64), along: f64| (x + dx * along - dy * aside, y + dy * along + dx * aside);
    let (start, tip) = (shift(from, 0.7 * r), shift(to, -0.9 * r));
    let back = |side: f64| (tip.0 - dx * 8.0 - dy * side, tip.1 - dy * 8.0 + dx * side);
    html! {
        path class={ "wait" (class) } d=(path([start, (tip.0 - dx * 6.0, tip.1 - dy * 6.0)])) {}
        path class={ "head" (class) } d={ (path([back(4.5), tip, back(-4.5)])) "Z" } {}
    }
}

fn direction(from: (f64, f64), to: (f64, f64)) -> Option<(f64, f64)> {
    let (x, y) = (to.0 - from.0, to.1 - from.1);
    let length = (x * x + y * y).sqrt();
    (length > 0.0).then(|| (x / length, y / length))
}

fn entry_mark((x, y): (f64, f64)) -> String {
    let corners = [(-7.0, -7.0), (7.0, -7.0), (7.0, 7.0), (-7.0, 7.0)];
    format!("{}Z", path(corners.map(|(dx, dy)| (x + dx, y + dy))))
}

fn exit_mark((x, y): (f64, f64)) -> String {
    let corner = |i: u32| {
        let angle = f64::from(i) * PI / 3.0;
        (x + 5.5 * libm::cos(angle), y + 5.5 * libm::sin(angle))
    };
    format!("{}Z", path((0..6).map(corner)))
}

/// What the ends of a rover's way are called: on a map of cells it stands at the one from the
/// start, and stays at the other.
fn ends_of(ground: &Surroundings) -> (&'static str, &'static str) {
    match ground {
        Surroundings::Walls { .. } => ("start", "goal"),
        Surroundings::Heights(_) | Surroundings::Unknown => ("entry", "exit"),
    }
}
