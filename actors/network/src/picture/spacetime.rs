//! The time-space diagram: who was where along a line of vertices, and when.

mod incidents;

use std::collections::BTreeMap;

use farside::SimDuration;
use farside_actors::invariants::Place;
use farside_worlds::VertexId;
use maud::{Markup, html};

use super::{Drawn, PictureError, VertexLine, colouring, corridor, counted};
use crate::tracks::Mark;
use crate::waits::{Waits, nearer};
use farside_actors::figure::Figure;
use farside_actors::figure::scale::{Scale, text_width, thinned};
use farside_actors::figure::svg::{Area, Px, over_lines, path};

/// A stand longer than this many cycles is a wait: a rover that moves in each cycle stands for most
/// of one.
const WAIT: f64 = 1.25;

/// Which way along the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Heading {
    Up,
    Down,
    /// Onto the line or off it.
    Across,
}

impl Heading {
    fn class(self) -> &'static str {
        match self {
            Heading::Up => "up",
            Heading::Down => "down",
            Heading::Across => "across",
        }
    }

    fn between(from: usize, to: usize) -> Heading {
        if to > from {
            Heading::Up
        } else {
            Heading::Down
        }
    }
}

/// A rover at one place of the line, or from one to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece {
    pub(super) from_ns: u64,
    pub(super) to_ns: u64,
    pub(super) from: usize,
    pub(super) to: usize,
    /// Where it moves; where it stands, where it wants to go.
    pub(super) way: Heading,
}

/// A rover on the line, from when it comes to when it leaves.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LineVisit {
    pub(super) rover: u32,
    pub(super) pieces: Vec<Piece>,
}

impl LineVisit {
    fn span_ns(&self) -> (u64, u64) {
        let first = self.pieces.first().map_or(0, |piece| piece.from_ns);
        (first, self.pieces.last().map_or(0, |piece| piece.to_ns))
    }
}

/// The visits of all rovers to a line, by rover and time, up to `until_ns`.
pub(super) fn visits(run: &Drawn, line: &[VertexId], until_ns: u64) -> Vec<LineVisit> {
    let place: BTreeMap<VertexId, usize> = line.iter().copied().zip(0..).collect();
    let mut visits = Vec::new();
    for (rover, marks) in run.tracks.rovers() {
        let mut visit = LineVisit {
            rover,
            pieces: Vec::new(),
        };
        for (at, mark) in marks.iter().enumerate() {
            if mark.time_ns > until_ns {
                break;
            }
            let end_ns = marks.get(at + 1).map_or(until_ns, |next| next.time_ns);
            let on_line = |v: VertexId| place.get(&v).copied();
            let here = mark.place.vertex().and_then(on_line);
            let there = mark.place.claim().and_then(on_line);
            let piece = |from: usize, to: usize, way| Piece {
                from_ns: mark.time_ns,
                to_ns: end_ns.min(until_ns),
                from,
                to,
                way,
            };
            match (here, mark.place, there) {
                (Some(here), Place::At(_), _) => {
                    visit
                        .pieces
                        .push(piece(here, here, wanted(run, mark, &place, here)));
                }
                (Some(here), Place::Between(..), Some(to)) if here.abs_diff(to) == 1 => {
                    visit
                        .pieces
                        .push(piece(here, to, Heading::between(here, to)));
                }
                // Off the line, or to it: a visit begins when the rover has come.
                _ if !visit.pieces.is_empty() => {
                    let pieces = std::mem::take(&mut visit.pieces);
                    visits.push(LineVisit { rover, pieces });
                }
                _ => {}
            }
        }
        if !visit.pieces.is_empty() {
            visits.push(visit);
        }
    }
    visits
}

/// Which way a rover that stands on the line wants to go.
fn wanted(run: &Drawn, mark: &Mark, place: &BTreeMap<VertexId, usize>, here: usize) -> Heading {
    let Some(vertex) = mark.place.vertex() else {
        return Heading::Across;
    };
    let nearer = nearer(&run.site.roadmap, vertex, mark.goal);
    let mut along = nearer.filter_map(|next| place.get(&next).copied());
    let next = along.find(|next| next.abs_diff(here) == 1);
    next.map_or(Heading::Across, |next| Heading::between(here, next))
}

/// The diagram and what it is drawn from.
struct Diagram<'a> {
    run: &'a Drawn,
    line: &'a [VertexId],
    waits: &'a Waits,
    area: Area,
    cycles: Scale,
    seconds: Scale,
    cycle_ns: f64,
    from_ns: u64,
    to_ns: u64,
}

pub(super) fn figure(
    run: &Drawn,
    line: &VertexLine,
    from_ns: u64,
    to_ns: u64,
) -> Result<Figure, PictureError> {
    let roadmap = &run.site.roadmap;
    let rovers = run.tracks.at(to_ns);
    let waits = run.waits(&rovers);
    let cycle_ns = run.site.cycle.as_nanos();
    let line = match line {
        VertexLine::Auto => {
            corridor::busiest(roadmap, &run.tracks, &rovers, &waits, cycle_ns, to_ns)?
        }
        VertexLine::Through(vertices) => corridor::through(roadmap, vertices)?,
    };
    let mut visits = visits(run, &line, to_ns);
    visits.retain(|visit| visit.span_ns().1 > from_ns);
    let cycle_ns = cycle_ns as f64;
    let (first, last) = (from_ns as f64 / cycle_ns, to_ns as f64 / cycle_ns);
    let row = (520.0 / line.len() as f64).clamp(16.0, 34.0);
    let area = Area {
        left: 86.0,
        top: 124.0,
        width: (13.0 * (last - first)).clamp(640.0, 1400.0),
        height: row * line.len().saturating_sub(1).max(1) as f64,
    };
    let mut diagram = Diagram {
        run,
        line: &line,
        waits: &waits,
        area,
        cycles: Scale::between(first, last),
        seconds: Scale::between(from_ns as f64 / 1e9, to_ns as f64 / 1e9),
        cycle_ns,
        from_ns,
        to_ns,
    };
    let incidents = diagram.incidents(&visits);
    diagram.area.top += diagram.incident_room(&incidents);
    let area = diagram.area;
    let locked = locked(run, &line, &waits, to_ns);
    let (title, says) = (diagram.title(), diagram.says(&visits, locked));
    let body = html! {
        text class="title" x="16" y="28" { (title) }
        text class="tick" x="16" y="50" { (says) }
        (diagram.legend())
        (diagram.shaded(&incidents))
        (diagram.frame())
        (diagram.closing(locked))
        @for visit in &visits { (diagram.visit(visit)) }
        (diagram.names(&visits))
        (diagram.named(&incidents, &visits))
    };
    Ok(Figure {
        file: "corridor.svg".to_owned(),
        title,
        description: says,
        width: area.left + area.width + 210.0,
        height: area.top
            + area.height
            + if diagram.counts_seconds() {
                66.0
            } else {
                106.0
            },
        body,
        facet: String::new(),
        style: super::STYLE,
    })
}

/// When the last rover came to stand as it does in a circle on the line, and stood there to the
/// end.
fn locked(run: &Drawn, line: &[VertexId], waits: &Waits, to_ns: u64) -> Option<u64> {
    let rovers = run.tracks.at(to_ns);
    let on_line = |rover: &u32| {
        let sighting = rovers.iter().find(|sighting| sighting.rover == *rover);
        sighting
            .and_then(|sighting| sighting.place.claim())
            .is_some_and(|v| line.contains(&v))
    };
    let circles = waits
        .circles
        .iter()
        .filter(|circle| circle.iter().filter(|r| on_line(r)).count() > 1);
    circles
        .map(|circle| corridor::closed_ns(&run.tracks, &rovers, circle, to_ns))
        .min()
}

impl Diagram<'_> {
    fn title(&self) -> String {
        let (first, last) = (self.line[0].0, self.line[self.line.len() - 1].0);
        let (scenario, seed) = (&self.run.scenario, self.run.seed);
        format!("{scenario}, seed {seed}: the line from vertex {first} to vertex {last}")
    }

    fn says(&self, visits: &[LineVisit], locked: Option<u64>) -> String {
        let mut rovers: Vec<u32> = visits.iter().map(|visit| visit.rover).collect();
        rovers.sort_unstable();
        rovers.dedup();
        let (from, to) = [self.from_ns, self.to_ns]
            .map(SimDuration::from_nanos)
            .into();
        let mut says = format!(
            "{} on it between {from} and {to}.",
            counted(rovers.len(), "rover")
        );
        if let Some(ns) = locked {
            let cycle = libm::floor(ns as f64 / self.cycle_ns);
            let time = self.or_seconds(ns);
            says.push_str(&format!(
                " From cycle {cycle}{time} on rovers on it wait for each other in a circle."
            ));
        }
        let rovers = self.run.tracks.at(self.to_ns);
        says.push_str(&self.run.shortest_circle(self.waits, &rovers));
        says
    }

    fn x(&self, ns: u64) -> f64 {
        let ns = ns.clamp(self.from_ns, self.to_ns);
        self.area.x(self.cycles.place(ns as f64 / self.cycle_ns))
    }

    /// The first vertex is at the bottom.
    fn y(&self, place: usize) -> f64 {
        let last = self.line.len().saturating_sub(1).max(1);
        self.area.y(place as f64 / last as f64)
    }

    fn legend(&self) -> Markup {
        let (first, last) = (self.line[0].0, self.line[self.line.len() - 1].0);
        let entries = [
            ("up", format!("towards vertex {last}")),
            ("down", format!("towards vertex {first}")),
            ("across", "onto the line, or off it".to_owned()),
        ];
        let entries = entries.map(|(class, says)| (class, format!("{says}: drives, waits")));
        let widths = entries.iter().scan(16.0, |x, (_, says)| {
            let here = *x;
            *x += 74.0 + text_width(says, 13.0);
            Some(here)
        });
        html! {
            @for (x, (class, says)) in widths.zip(&entries) {
                g class=(class) {
                    path class="pass" d=(path([(x, 76.0), (x + 16.0, 68.0)])) {}
                    path class="stand" d=(path([(x + 20.0, 72.0), (x + 44.0, 72.0)])) {}
                }
                text x=(Px(x + 50.0)) y="76.5" { (says) }
            }
        }
    }

    fn frame(&self) -> Markup {
        let sensors = &self.run.site.sensors;
        let colours = colouring::colours(&self.run.site.roadmap, sensors);
        let (left, right, bottom) = (self.area.left, self.area.x(1.0), self.area.y(0.0));
        let half = self.half_row();
        html! {
            @for (place, v) in self.line.iter().enumerate() {
                @let y = self.y(place);
                @let owner = sensors.owner(*v);
                @let (top, low) = ((y - half).max(self.area.top), (y + half).min(bottom));
                path class="inner" d=(path([(left, y), (right, y)])) {}
                text class="tick" x=(Px(left - 16.0)) y=(Px(y + 4.5)) text-anchor="end" { (v.0) }
                rect class={ "vertex n" (colours[owner.0 as usize]) } x=(Px(left - 10.0)) y=(Px(top))
                    width="6" height=(Px(low - top)) {
                    title { "vertex " (v.0) " is of node " (owner.0 + 1) }
                }
            }
            text class="label" x="16" y=(Px(self.area.top - 14.0)) { "vertex" }
            path class="axis" d=(path([(left, bottom), (right, bottom)])) {}
            @if self.counts_seconds() {
                (self.times(bottom, &self.seconds, 10.0, "time (s); a planning cycle lasts 1 s"))
            } @else {
                (self.times(bottom, &self.cycles, self.whole_cycles(), ""))
                text class="label" x=(Px(right + 28.0)) y=(Px(bottom + 20.0)) { "planning cycle" }
                path class="axis" d=(path([(left, bottom + 40.0), (right, bottom + 40.0)])) {}
                (self.times(bottom + 40.0, &self.seconds, 10.0, ""))
                text class="label" x=(Px(right + 28.0)) y=(Px(bottom + 60.0)) { "time (s)" }
            }
        }
    }

    /// Marks of an axis at a height, and below them what they count.
    fn times(&self, y: f64, scale: &Scale, count: f64, counted: &str) -> Markup {
        html! {
            @for tick in thinned(&scale.ticks(count), self.area.width, 13.0) {
                @let x = self.area.x(tick.at);
                path class="axis" d=(path([(x, y), (x, y + 5.0)])) {}
                text class="tick" x=(Px(x)) y=(Px(y + 20.0)) text-anchor="middle" { (tick.text) }
            }
            @if !counted.is_empty() {
                text class="label" x=(Px(self.area.x(0.5))) y=(Px(y + 42.0)) text-anchor="middle" {
                    (counted)
                }
            }
        }
    }

    /// About how many cycles are marked: none between two.
    fn whole_cycles(&self) -> f64 {
        ((self.to_ns - self.from_ns) as f64 / self.cycle_ns).clamp(1.0, 10.0)
    }

    /// Cycles last a second each: one axis is both.
    fn counts_seconds(&self) -> bool {
        self.run.site.cycle == SimDuration::from_secs(1)
    }

    /// The time beside a cycle, where the one does not say the other.
    fn or_seconds(&self, ns: u64) -> String {
        match self.counts_seconds() {
            true => String::new(),
            false => format!(" ({:.1} s)", ns as f64 / 1e9),
        }
    }

    /// Half the height between two vertices.
    fn half_row(&self) -> f64 {
        self.area.height / self.line.len().saturating_sub(1).max(1) as f64 / 2.0
    }

    /// When the circle closed.
    fn closing(&self, locked: Option<u64>) -> Markup {
        let Some(ns) = locked.filter(|ns| *ns >= self.from_ns) else {
            return html! {};
        };
        let (x, top, bottom) = (self.x(ns), self.area.top - 8.0, self.area.y(0.0));
        let cycle = libm::floor(ns as f64 / self.cycle_ns);
        // Near the right end it would run out of the figure.
        let late = x > self.area.x(0.75);
        html! {
            rect class="locked" x=(Px(x)) y=(Px(top)) width=(Px(self.area.x(1.0) - x))
                height=(Px(bottom - top)) {}
            path class="closes" d=(path([(x, top), (x, bottom)])) {}
            text class="red" x=(Px(if late { x - 4.0 } else { x + 4.0 })) y=(Px(top - 3.0))
                text-anchor=(if late { "end" } else { "start" }) {
                "cycle " (cycle) (self.or_seconds(ns)) ": the circle closes"
            }
        }
    }

    /// A rover's line: thin where it drives, a bar where it waits.
    fn visit(&self, visit: &LineVisit) -> Markup {
        let waits = |piece: &Piece| {
            let cycles = (piece.to_ns - piece.from_ns) as f64 / self.cycle_ns;
            piece.from == piece.to && cycles > WAIT
        };
        let shown = visit
            .pieces
            .iter()
            .filter(|piece| piece.to_ns > self.from_ns);
        let pieces: Vec<&Piece> = shown.collect();
        let mut drives: Vec<(Heading, Vec<(f64, f64)>)> = Vec::new();
        let mut last = None;
        for piece in &pieces {
            let start = (self.x(piece.from_ns), self.y(piece.from));
            if waits(piece) {
                last = Some((self.x(piece.to_ns), start.1));
            } else if piece.from == piece.to {
                // A short stand is a part of the way: the line goes from coming to coming.
                last = last.or(Some(start));
            } else {
                let from = last.unwrap_or(start);
                let to = (self.x(piece.to_ns), self.y(piece.to));
                match drives.last_mut() {
                    Some((way, points)) if *way == piece.way && points.last() == Some(&from) => {
                        points.push(to);
                    }
                    _ => drives.push((piece.way, vec![from, to])),
                }
                last = Some(to);
            }
        }
        // Who only crosses the line has neither: a dot.
        let crosses = drives.is_empty() && !pieces.iter().any(|piece| waits(piece));
        let dot = pieces.first().filter(|_| crosses);
        html! {
            g {
                title { "rover " (visit.rover + 1) }
                @if let Some(piece) = dot {
                    circle class="dot across" cx=(Px(self.x(piece.from_ns)))
                        cy=(Px(self.y(piece.from))) r="2.5" {}
                }
                @for (way, points) in &drives {
                    path class={ "pass " (way.class()) } d=(path(points.iter().copied())) {}
                }
                @for piece in pieces.iter().filter(|piece| waits(piece)) {
                    @let y = self.y(piece.from);
                    path class={ "stand " (piece.way.class()) }
                        d=(path([(self.x(piece.from_ns), y), (self.x(piece.to_ns), y)])) {}
                }
            }
        }
    }

    /// Numbers: at the right end for those that are there at the end, else where a line begins, if
    /// there is room.
    fn names(&self, visits: &[LineVisit]) -> Markup {
        let mut taken: Vec<[f64; 4]> = Vec::new();
        let mut names = Vec::new();
        let mut at_end = Vec::new();
        for visit in visits {
            let (Some(first), Some(last)) = (visit.pieces.first(), visit.pieces.last()) else {
                continue;
            };
            if last.to_ns == self.to_ns {
                at_end.push((self.y(last.to) + 4.0, visit.rover));
            }
            let text = (visit.rover + 1).to_string();
            let (width, x) = (1.1 * text_width(&text, 12.0), self.x(first.from_ns));
            let up = self.y(first.from) - 5.0;
            let down = self.y(first.from) + 14.0;
            let box_at = |y: f64| [x, y - 10.0, x + width + 3.0, y + 1.0];
            let free = |y: &&f64| {
                let [left, top, right, bottom] = box_at(**y);
                let apart =
                    |b: &[f64; 4]| right < b[0] || b[2] < left || bottom < b[1] || b[3] < top;
                // Below the line the axis has its numbers.
                let within = right <= self.area.x(1.0) && bottom <= self.area.y(0.0) + 2.0;
                within && taken.iter().all(apart)
            };
            if let Some(y) = [up, down].iter().find(free).copied() {
                taken.push(box_at(y));
                names.push((x, y, visit.rover));
            }
        }
        // Several rovers may be on their way to one vertex.
        at_end.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut least = f64::NEG_INFINITY;
        for (y, _) in &mut at_end {
            *y = y.max(least);
            least = *y + 15.0;
        }
        let right = self.area.x(1.0) + 8.0;
        html! {
            @for (x, y, rover) in names {
                (over_lines("who", (x, y), "start", &self.name(rover, false)))
            }
            @for (y, rover) in at_end {
                text class=(self.end_class(rover)) x=(Px(right)) y=(Px(y)) {
                    (self.name(rover, true))
                }
            }
        }
    }

    fn end_class(&self, rover: u32) -> &'static str {
        if self.waits.in_circle(rover) {
            "at-end red"
        } else if self.waits.behind.contains(&rover) {
            "at-end amber"
        } else {
            "at-end"
        }
    }

    fn name(&self, rover: u32, at_end: bool) -> String {
        let number = rover + 1;
        let on = self.waits.on.get(&rover).filter(|_| at_end);
        on.map_or(number.to_string(), |on| {
            let names: Vec<String> = on.iter().map(|rover| (rover + 1).to_string()).collect();
            format!("{number} waits for {}", names.join(" and "))
        })
    }
}
