//! What befell a run while it is drawn: hosts that were down, links and processors that were worse.

use std::collections::BTreeSet;

use farside_actors::figure::scale::text_width;
use farside_actors::figure::svg::{Px, over_lines};
use farside_actors::link::{Degrade, Degraded, LinkChange};
use maud::{Markup, html};

use super::{Diagram, LineVisit};
use crate::ids;

/// The height of a row of names above the diagram.
const ROW: f64 = 18.0;
/// The most rows.
const ROWS: usize = 6;

/// Something that lasts from a time to another.
pub(super) struct Incident {
    from_ns: u64,
    /// At the latest the end of the diagram.
    to_ns: u64,
    says: String,
    what: What,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum What {
    /// Links or processors are worse.
    Worse,
    /// A node is down: this one.
    Node(u32),
    /// A rover is.
    Rover(u32),
}

impl What {
    fn class(self) -> &'static str {
        match self {
            What::Worse => "worse",
            What::Node(_) | What::Rover(_) => "outage",
        }
    }
}

/// What a scenario says of a degradation: `links *: loss 0.3`.
fn told(degrade: &Degrade) -> String {
    match &degrade.what {
        Degraded::Links { pattern, over } => {
            let change = LinkChange::from(&**over);
            let set = change.set().iter();
            let set: Vec<String> = set.map(|(key, value)| format!("{key} {value}")).collect();
            format!("links {pattern}: {}", set.join(", "))
        }
        Degraded::Processors { pattern, slowdown } => {
            format!("processors {pattern}: {} times slower", slowdown.factor())
        }
    }
}

impl Diagram<'_> {
    /// What befell it, by time: degradations, and of hosts those that have to do with the line.
    pub(super) fn incidents(&self, visits: &[LineVisit]) -> Vec<Incident> {
        let within = |from_ns: u64, to_ns: Option<u64>, says: String, what: What| {
            let to_ns = to_ns.unwrap_or(self.to_ns).min(self.to_ns);
            let seen = from_ns <= self.to_ns && to_ns >= self.from_ns;
            seen.then_some(Incident {
                from_ns: from_ns.max(self.from_ns),
                to_ns,
                says,
                what,
            })
        };
        let worse = self.run.degrades.iter().filter_map(|degrade| {
            let until_ns = degrade.until.map(|until| until.as_nanos());
            within(degrade.at.as_nanos(), until_ns, told(degrade), What::Worse)
        });
        let sensors = &self.run.site.sensors;
        let owners: BTreeSet<u32> = self.line.iter().map(|v| sensors.owner(*v).0).collect();
        let rovers: BTreeSet<u32> = visits.iter().map(|visit| visit.rover).collect();
        let (nodes, team) = (sensors.len() as u32, self.run.site.rovers);
        let host = |actor: &str| {
            let node = owners
                .iter()
                .find(|n| ids::name("node", **n, nodes) == actor);
            let rover = || {
                rovers
                    .iter()
                    .find(|r| ids::name("rover", **r, team) == actor)
            };
            node.map(|n| What::Node(*n))
                .or_else(|| rover().map(|r| What::Rover(*r)))
        };
        let down = self.run.tracks.outages.iter().filter_map(|outage| {
            let what = host(&outage.actor)?;
            let says = format!("{} is down", outage.actor);
            within(outage.from_ns, outage.to_ns, says, what)
        });
        let mut all: Vec<Incident> = worse.chain(down).collect();
        all.sort_by_key(|incident| (incident.from_ns, incident.to_ns));
        all
    }

    /// In which row each has its name, so that none lies over another; those beyond the last row
    /// have none.
    fn rows(&self, incidents: &[Incident]) -> Vec<Option<usize>> {
        let mut ends = Vec::<f64>::new();
        let row = |incident: &Incident| {
            let (start, end) = self.span(incident);
            let free = ends.iter().position(|taken| *taken <= start);
            let row = free.unwrap_or(ends.len());
            if row >= ROWS {
                return None;
            }
            if row == ends.len() {
                ends.push(0.0);
            }
            ends[row] = end + 10.0;
            Some(row)
        };
        incidents.iter().map(row).collect()
    }

    /// From where to where an incident and its name reach.
    fn span(&self, incident: &Incident) -> (f64, f64) {
        let (start, end) = (self.x(incident.from_ns), self.x(incident.to_ns));
        let width = 1.1 * text_width(&incident.says, 12.0);
        // Near the right end a name goes back from there.
        let start = start.min(self.area.x(1.0) + 180.0 - width);
        (start, end.max(start + width))
    }

    /// How much room names above the diagram take.
    pub(super) fn incident_room(&self, incidents: &[Incident]) -> f64 {
        let rows = self.rows(incidents).into_iter().flatten().max();
        rows.map_or(0.0, |last| ROW * (last + 1) as f64 + 6.0)
    }

    /// The times, over the part of the line that they concern, under all that is drawn.
    pub(super) fn shaded(&self, incidents: &[Incident]) -> Markup {
        let sensors = &self.run.site.sensors;
        let half = self.half_row();
        let (top, bottom) = (self.area.top, self.area.y(0.0));
        let spans = |incident: &Incident| -> Vec<(f64, f64)> {
            match incident.what {
                What::Worse => vec![(top, bottom)],
                What::Node(node) => {
                    let places = self.line.iter().enumerate();
                    let owned = places.filter(|(_, v)| sensors.owner(**v).0 == node);
                    let rows = owned.map(|(place, _)| {
                        let y = self.y(place);
                        ((y - half).max(top), (y + half).min(bottom))
                    });
                    rows.collect()
                }
                What::Rover(_) => Vec::new(),
            }
        };
        html! {
            @for incident in incidents {
                @let (from, to) = (self.x(incident.from_ns), self.x(incident.to_ns));
                @for (top, bottom) in spans(incident) {
                    rect class=(incident.what.class()) x=(Px(from)) y=(Px(top))
                        width=(Px((to - from).max(1.5))) height=(Px(bottom - top)) {
                        title { (incident.says) }
                    }
                }
            }
        }
    }

    /// Their names above the diagram, each over a bar as long as it lasts; a cross where a rover
    /// crashes on the line.
    pub(super) fn named(&self, incidents: &[Incident], visits: &[LineVisit]) -> Markup {
        let rows = self.rows(incidents);
        let room = self.incident_room(incidents);
        let hidden = rows.iter().filter(|row| row.is_none()).count();
        html! {
            @for (incident, row) in incidents.iter().zip(&rows) {
                @if let Some(row) = row {
                    @let y = self.area.top - 22.0 - room + ROW * (*row + 1) as f64;
                    @let (from, to) = (self.x(incident.from_ns), self.x(incident.to_ns));
                    rect class={ (incident.what.class()) " bar" } x=(Px(from)) y=(Px(y + 2.0))
                        width=(Px((to - from).max(1.5))) height="3" {}
                    text class="who" x=(Px(self.span(incident).0)) y=(Px(y - 1.5)) {
                        (incident.says)
                    }
                }
                @if let What::Rover(rover) = incident.what {
                    @if let Some((x, y)) = self.place_of(visits, rover, incident.from_ns) {
                        path class="crash" d={
                            "M" (Px(x - 5.0)) " " (Px(y - 5.0)) "l10 10M"
                            (Px(x - 5.0)) " " (Px(y + 5.0)) "l10 -10"
                        } { title { (incident.says) } }
                    }
                }
            }
            @if hidden > 0 {
                (over_lines("who", (self.area.x(1.0), self.area.top - 24.0), "end",
                    &format!("and {hidden} more")))
            }
        }
    }

    /// Where a rover on the line is at a time.
    fn place_of(&self, visits: &[LineVisit], rover: u32, ns: u64) -> Option<(f64, f64)> {
        let of_rover = visits.iter().filter(|visit| visit.rover == rover);
        let mut pieces = of_rover.flat_map(|visit| &visit.pieces);
        let piece = pieces.find(|piece| (piece.from_ns..=piece.to_ns).contains(&ns))?;
        let whole = (piece.to_ns - piece.from_ns).max(1) as f64;
        let share = (ns - piece.from_ns) as f64 / whole;
        let (from, to) = (self.y(piece.from), self.y(piece.to));
        Some((self.x(ns), from + (to - from) * share))
    }
}
