//! The field at an instant: rocks by what they are, and by what a rover thinks they are, with what was
//! read of them, where rovers are and where they believe to be.

use farside::SimDuration;
use farside_actors::figure::Figure;
use farside_actors::figure::ground::{Ground, LegendRow, legend, legend_rows};
use farside_actors::figure::svg::{Px, shortened};
use farside_worlds::RockField;
use maud::{Markup, html};

use super::classes::{COLOURS, matched, shape};
use super::history::History;
use super::in_sols;
use crate::messages::FieldModel;

/// The side of a panel, in pixels.
const PANEL: f64 = 560.0;
/// Above the panels: title, a line below it, and what each panel shows.
const TOP: f64 = 96.0;
const SIDE: f64 = 16.0;
/// Between the panels.
const GAP: f64 = 24.0;
/// Right of the panels: the legend.
const LEGEND: f64 = 250.0;
/// The least radius of a rock, in pixels: smaller ones would have no shape.
const LEAST: f64 = 4.0;

/// A square of ground in the figure.
struct Panel<'a> {
    field: &'a RockField,
    history: &'a History,
    ground: Ground<'a>,
}

/// The picture of a field at a time, as the rover of this number thinks it is.
pub(super) fn figure(history: &History, field: &RockField, rover: usize, at_ns: u64) -> Figure {
    let model = history.model(rover, at_ns);
    let name = &history.names[rover];
    let side_m = field.settings().side_m;
    let panel = |left| Panel {
        field,
        history,
        ground: Ground {
            terrain: field.terrain(),
            corner_m: [-0.5 * side_m; 2],
            side_m,
            left,
            top: TOP,
            side: PANEL,
        },
    };
    let (truth, thought) = (panel(SIDE), panel(SIDE + PANEL + GAP));
    let at = in_sols(SimDuration::from_nanos(at_ns));
    let title = format!("{}, seed {}, at {at}", history.scenario, history.seed);
    let says = says(history, field, model, name, at_ns);
    let colours = model.map(|model| matched(model, field));
    let right = SIDE + 2.0 * PANEL + GAP + 20.0;
    let body = html! {
        text class="title" x=(Px(SIDE)) y="28" { (title) }
        text class="tick" x=(Px(SIDE)) y="50" { (says) }
        text class="facet" x=(Px(truth.ground.left)) y=(Px(TOP - 12.0)) { "What the rocks are" }
        text class="facet" x=(Px(thought.ground.left)) y=(Px(TOP - 12.0)) { "What " (name) " thinks they are" }
        (truth.ground.draw())
        (truth.true_rocks())
        (truth.tracks(at_ns))
        (thought.ground.draw())
        (thought.learned_rocks(model, colours.as_deref()))
        (thought.readings(model))
        (thought.tracks(at_ns))
        (legend(&explained(field, right), (right, TOP + 10.0)))
    };
    Figure {
        file: "field.svg".to_owned(),
        title: format!("Field of {title}"),
        description: says,
        width: right + LEGEND,
        height: TOP + PANEL + SIDE,
        body,
        facet: String::new(),
        style: &super::STYLE,
    }
}

/// The figure in a sentence or two.
fn says(
    history: &History,
    field: &RockField,
    model: Option<&FieldModel>,
    name: &str,
    at_ns: u64,
) -> String {
    let story = field.story().name();
    let rocks = field.rocks().len();
    let faults = history.faults_until(at_ns);
    let faults = match faults {
        0 => String::new(),
        1 => " One fault so far.".to_owned(),
        more => format!(" {more} faults so far."),
    };
    match model {
        None => format!("{rocks} rocks ({story}). {name} has learnt nothing yet.{faults}"),
        Some(model) => format!(
            "{rocks} rocks of {} classes ({story}). {name} knows {} readings of {} rocks and tells {} \
             classes apart.{faults}",
            field.classes().len(),
            model.readings,
            model.rocks_read,
            model.classes
        ),
    }
}

impl Panel<'_> {
    /// Where a rock is in the figure, and how large.
    fn rock(&self, rock: usize) -> ((f64, f64), f64) {
        let one = self.field.rocks()[rock];
        let radius = 0.5 * one.diameter_m * self.ground.px_per_m();
        (self.ground.px(one.position_m.into()), radius.max(LEAST))
    }

    fn true_rocks(&self) -> Markup {
        let classes = self.field.classes();
        html! {
            @for (rock, class) in self.field.truth().classes().iter().enumerate() {
                @let (at, radius) = self.rock(rock);
                @let class = usize::from(*class);
                @let name = classes.get(class).map_or("", |class| class.name.as_str());
                g class={ "n" (class % COLOURS) } {
                    path class="rock" d=(shape(class, at, radius)) {
                        title { "rock " (rock) ": " (name) }
                    }
                }
            }
        }
    }

    /// Rocks by learnt class: the surer, the fuller; those that nobody has read are hollow.
    fn learned_rocks(&self, model: Option<&FieldModel>, colours: Option<&[usize]>) -> Markup {
        let label = |rock: usize| model.map(|model| model.rocks[rock]);
        html! {
            @for rock in 0..self.field.rocks().len() {
                @let (at, radius) = self.rock(rock);
                @if let (Some(label), Some(colours)) = (label(rock), colours) {
                    @let colour = colours[label.class as usize];
                    @let percent = libm::round(100.0 * f64::from(label.confidence));
                    @let is_read = label.image || label.spectrum;
                    @let fill = if is_read { "rock" } else { "rock unread" };
                    g class={ "n" (colour % COLOURS) } {
                        path class=(fill) d=(shape(colour, at, radius))
                            fill-opacity=(Px(f64::from(label.confidence))) {
                            title { "rock " (rock) ": class " (label.class) ", " (percent) " %" }
                        }
                    }
                } @else {
                    path class="rock unread" d=(shape(0, at, radius)) {}
                }
            }
        }
    }

    /// A dot where a spectrum is known, a ring where an image is.
    fn readings(&self, model: Option<&FieldModel>) -> Markup {
        let rocks = model.map_or(&[][..], |model| &model.rocks);
        html! {
            @for (rock, label) in rocks.iter().enumerate() {
                @let ((x, y), radius) = self.rock(rock);
                @if label.image {
                    circle class="image" cx=(Px(x)) cy=(Px(y)) r=(Px(radius + 2.5)) {}
                }
                @if label.spectrum { circle class="spectrum" cx=(Px(x)) cy=(Px(y)) r="2" {} }
            }
        }
    }

    /// Where rovers were, in truth and as they believed, and where they are.
    fn tracks(&self, at_ns: u64) -> Markup {
        html! {
            @for (rover, name) in self.history.names.iter().enumerate() {
                (self.ground.track(name, self.history.until(rover, at_ns)))
            }
        }
    }
}

/// The rows of the legend, for a legend at this x.
fn explained(field: &RockField, x: f64) -> Vec<LegendRow> {
    let mut rows: Vec<LegendRow> = Vec::new();
    for (class, one) in field.classes().iter().enumerate() {
        let rock = html! {
            g class={ "n" (class % COLOURS) } {
                path class="rock" d=(shape(class, (x + 12.0, 0.0), 7.0)) {}
            }
        };
        rows.push((rock, shortened(&one.name, 26)));
    }
    let hollow = html! { path class="rock unread" d=(shape(0, (x + 12.0, 0.0), 7.0)) {} };
    let faint = html! {
        g class="n0" { path class="rock" d=(shape(0, (x + 12.0, 0.0), 7.0)) fill-opacity="0.4" {} }
    };
    rows.extend([
        (faint, "less sure".to_owned()),
        (hollow, "not read: by its place alone".to_owned()),
        (
            html! { circle class="spectrum" cx=(Px(x + 12.0)) cy="0" r="2" {} },
            "spectrum known".to_owned(),
        ),
        (
            html! { circle class="image" cx=(Px(x + 12.0)) cy="0" r="7" {} },
            "image known".to_owned(),
        ),
    ]);
    rows.extend(legend_rows(field.terrain(), x));
    rows
}
