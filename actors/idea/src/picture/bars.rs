//! A timeline as a row of bars: one for each thing that it said, and one for many where they are too thin
//! to be seen apart.

use std::collections::BTreeMap;

use farside_actors::figure::scale::text_width;
use farside_actors::figure::svg::{Px, over_lines, path, shortened};
use maud::{Markup, html};

use super::clock;
use super::history::{Lane, Said};

/// How high a bar is, in pixels.
pub(super) const HEIGHT: f64 = 22.0;
/// How many colours and hatchings there are.
const FAMILIES: usize = 7;
/// What is thinner than this is drawn with its neighbours.
const THIN: f64 = 3.0;
/// If they are nearer than this.
const NEAR: f64 = 6.0;
/// The size of what is written on bars.
const TEXT: f64 = 12.0;
/// The room left and right of a text.
const BESIDE: f64 = 5.0;
/// The fewest letters that are left of a predicate.
const LEAST: usize = 5;

/// The lines of hatchings of 8 by 8 pixels. The first kind has none.
const HATCHINGS: [&str; FAMILIES] = [
    "",
    "M-2 2L2 -2M0 8L8 0M6 10L10 6",
    "M4 3.2V4.8",
    "M-2 6L2 10M0 0L8 8M6 -2L10 2",
    "M4 0V8",
    "M0 8L8 0M0 0L8 8",
    "M0 4H8",
];

/// What hatchings are defined by; once in a figure.
pub(super) fn hatchings() -> Markup {
    html! {
        defs {
            @for (family, lines) in HATCHINGS.iter().enumerate().skip(1) {
                pattern id={ "hatch-" (family) } class={ "s" (family) } width="8" height="8"
                    patternUnits="userSpaceOnUse" {
                    path class="hatching" d=(lines) {}
                }
            }
        }
    }
}

/// The time along the bars.
#[derive(Clone, Copy, Debug)]
pub(super) struct Along {
    pub(super) from_ns: u64,
    pub(super) to_ns: u64,
    /// The x of both, in pixels.
    pub(super) left: f64,
    pub(super) right: f64,
}

impl Along {
    /// Where a time is; the nearest end, if it is outside.
    pub(super) fn x(&self, time_ns: u64) -> f64 {
        let since = time_ns.clamp(self.from_ns, self.to_ns) - self.from_ns;
        let share = since as f64 / (self.to_ns - self.from_ns) as f64;
        self.left + share * (self.right - self.left)
    }

    /// Whether a time is within.
    pub(super) fn has(&self, time_ns: u64) -> bool {
        (self.from_ns..=self.to_ns).contains(&time_ns)
    }
}

/// What is drawn as one bar.
#[derive(Debug)]
struct Piece<'a> {
    from: f64,
    to: f64,
    said: Vec<&'a Said>,
    is_quiet: bool,
}

/// The bars of a lane. What it says when nothing is asked of it is only drawn where it is not thin.
fn pieces<'a>(lane: &'a Lane, along: &Along) -> Vec<Piece<'a>> {
    let mut pieces: Vec<Piece<'_>> = Vec::new();
    let mut busy: Option<usize> = None;
    for said in &lane.said {
        let to_ns = said.to_ns.unwrap_or(along.to_ns);
        if to_ns <= along.from_ns || said.from_ns >= along.to_ns || to_ns == said.from_ns {
            continue;
        }
        let (from, to) = (along.x(said.from_ns), along.x(to_ns));
        let is_quiet = lane.quiet.iter().any(|quiet| quiet == said.predicate());
        if is_quiet && to - from < THIN {
            // Nothing is asked of it all the same.
            let before = pieces
                .last_mut()
                .filter(|last| last.is_quiet && last.to >= from);
            if let Some(before) = before {
                before.to = to;
            }
            continue;
        }
        let last = busy.filter(|_| !is_quiet).map(|at| &mut pieces[at]);
        if let Some(last) = last.filter(|last| {
            let is_thin = |from: f64, to: f64| to - from < THIN;
            let are_thin =
                is_thin(from, to) && (last.said.len() > 1 || is_thin(last.from, last.to));
            are_thin && from - last.to < NEAR
        }) {
            last.to = to;
            last.said.push(said);
            continue;
        }
        if !is_quiet {
            busy = Some(pieces.len());
        }
        pieces.push(Piece {
            from,
            to,
            said: vec![said],
            is_quiet,
        });
    }
    pieces
}

/// Whether some bars of a lane stand for many.
pub(super) fn has_many(lane: &Lane, along: &Along) -> bool {
    pieces(lane, along).iter().any(|piece| piece.said.len() > 1)
}

/// A lane, its upper edge at `y`: its bars, and what is written on them.
pub(super) fn draw(lane: &Lane, along: &Along, y: f64) -> (Markup, Markup) {
    let pieces = pieces(lane, along);
    let middle = y + 0.5 * HEIGHT;
    let baseline = path([(along.left, middle), (along.right, middle)]);
    let (quiet, busy): (Vec<&Piece<'_>>, Vec<_>) = pieces.iter().partition(|piece| piece.is_quiet);
    let bars = html! {
        path class="nothing-said" d=(baseline) {}
        @for piece in quiet.into_iter().chain(busy) { (bar(lane, piece, y)) }
    };
    // Up to where something is written.
    let mut written = along.left;
    let texts = html! {
        @for (at, piece) in pieces.iter().enumerate() {
            @let next = pieces[at + 1..].iter().find(|piece| !piece.is_quiet);
            @let next = next.map_or(along.right, |piece| piece.from);
            @if let Some((x, text)) = label(piece, written, next) {
                @let class = if piece.is_quiet { "on-bar soft" } else { "on-bar" };
                ({
                    written = x + text_width(&text, TEXT) + BESIDE;
                    over_lines(class, (x, middle + 4.2), "start", &text)
                })
            }
        }
    };
    (bars, texts)
}

/// The colour and the hatching of a predicate of a lane.
fn family(lane: &Lane, predicate: &str) -> usize {
    let at = lane.predicates.iter().position(|one| one == predicate);
    at.unwrap_or(0) % FAMILIES
}

fn bar(lane: &Lane, piece: &Piece<'_>, y: f64) -> Markup {
    let width = (piece.to - piece.from).max(2.0);
    let (x, y, width, height) = (Px(piece.from), Px(y), Px(width), Px(HEIGHT));
    if piece.is_quiet {
        return html! {
            rect class="quiet" x=(x) y=(y) width=(width) height=(height) {
                title { (in_full(piece.said[0])) }
            }
        };
    }
    if piece.said.len() > 1 {
        let (most, says) = counted(piece);
        return html! {
            rect class="paper" x=(x) y=(y) width=(width) height=(height) {}
            rect class={ "many s" (family(lane, &most)) } x=(x) y=(y) width=(width)
                height=(height) { title { (says) } }
        };
    }
    let family = family(lane, piece.said[0].predicate());
    html! {
        g class={ "s" (family) } {
            title { (in_full(piece.said[0])) }
            rect class="said" x=(x) y=(y) width=(width) height=(height) {}
            @if family > 0 {
                rect x=(x) y=(y) width=(width) height=(height) fill={ "url(#hatch-" (family) ")" } {}
            }
        }
    }
}

/// What is said, from when to when, and what came of it.
fn in_full(said: &Said) -> String {
    let from = clock(said.from_ns);
    let until = match said.to_ns {
        Some(to_ns) => format!("to {}", clock(to_ns)),
        None => "to the end".to_owned(),
    };
    let outputs = match said.outputs.as_slice() {
        [] => String::new(),
        outputs => format!(", then {}", outputs.join(" ")),
    };
    format!("{} from {from} {until}{outputs}", said.says)
}

/// What is said most often in a bar for many, and all in words.
fn counted(piece: &Piece<'_>) -> (String, String) {
    let mut counts = BTreeMap::<&str, usize>::new();
    for said in &piece.said {
        *counts.entry(said.predicate()).or_default() += 1;
    }
    let most = counts.iter().max_by_key(|(_, count)| **count);
    let most = most.map_or("", |(predicate, _)| predicate).to_owned();
    let each: Vec<String> = counts
        .iter()
        .map(|(predicate, count)| format!("{count} x {predicate}"))
        .collect();
    let [first, .., last] = piece.said.as_slice() else {
        return (most, each.join(", "));
    };
    let until = last.to_ns.map_or("the end".to_owned(), clock);
    let says = format!(
        "{} from {} to {until}",
        each.join(", "),
        clock(first.from_ns)
    );
    (most, says)
}

/// What is written on a bar or behind it, and where, with nothing before `after` and up to `next`.
fn label(piece: &Piece<'_>, after: f64, next: f64) -> Option<(f64, String)> {
    let fits = |text: &str, from: f64, to: f64| from + text_width(text, TEXT) + BESIDE <= to;
    let inside = (piece.from + BESIDE).max(after);
    if piece.said.len() > 1 {
        let (most, _) = counted(piece);
        let count = piece.said.len();
        let texts = [format!("{count} x {most}"), format!("{count} x")];
        return texts
            .into_iter()
            .find(|text| fits(text, inside, piece.to))
            .map(|text| (inside, text));
    }
    let said = piece.said[0];
    let (says, predicate) = (said.says.as_str(), said.predicate());
    if fits(says, inside, piece.to) {
        return Some((inside, says.to_owned()));
    }
    if piece.is_quiet {
        return None;
    }
    let behind = (piece.to + BESIDE).max(after);
    for text in [says, predicate] {
        if fits(text, behind, next) {
            return Some((behind, text.to_owned()));
        }
        if fits(predicate, inside, piece.to) {
            return Some((inside, predicate.to_owned()));
        }
    }
    let letters = predicate.chars().count();
    (LEAST..letters)
        .rev()
        .map(|most| shortened(predicate, most))
        .find(|text| fits(text, inside, piece.to))
        .map(|text| (inside, text))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    fn lane(said: &[(u64, u64, &str)]) -> Lane {
        let said = said.iter().map(|(from_s, to_s, says)| Said {
            from_ns: from_s * SECOND,
            to_ns: Some(to_s * SECOND),
            says: (*says).to_owned(),
            outputs: Vec::new(),
        });
        Lane {
            name: "Fans_SV".to_owned(),
            quiet: vec!["Still".to_owned()],
            predicates: vec!["Drive".to_owned(), "Turn".to_owned()],
            is_polled: false,
            said: said.collect(),
        }
    }

    fn along(to_s: u64, right: f64) -> Along {
        Along {
            from_ns: 0,
            to_ns: to_s * SECOND,
            left: 0.0,
            right,
        }
    }

    #[test]
    fn what_is_too_thin_is_drawn_as_one() {
        let all: Vec<(u64, u64, &str)> = (0..50)
            .flat_map(|at| {
                [
                    (10 * at, 10 * at + 2, "Turn(1)"),
                    (10 * at + 2, 10 * at + 10, "Still"),
                ]
            })
            .collect();
        let lane = lane(&all);
        // A pixel is five seconds: turns of less than one, two apart.
        let found = pieces(&lane, &along(500, 100.0));
        let many: Vec<usize> = found.iter().map(|piece| piece.said.len()).collect();
        assert_eq!(many, [50]);
        assert!(has_many(&lane, &along(500, 100.0)));
        let (bars, _) = draw(&lane, &along(500, 100.0), 0.0);
        let drawn = bars.into_string();
        assert!(drawn.contains("50 x Turn from 0:00 to 8:12"), "{drawn}");
        // A pixel is a second: each apart.
        let found = pieces(&lane, &along(100, 100.0));
        assert!(found.iter().all(|piece| piece.said.len() == 1));
        assert_eq!(found.iter().filter(|piece| !piece.is_quiet).count(), 10);
    }

    #[test]
    fn labels_are_as_long_as_there_is_room_and_never_over_each_other() {
        let lane = lane(&[
            (0, 60, "Drive(1 2)"),
            (60, 64, "Turn(30)"),
            (64, 100, "Still"),
        ]);
        let (_, texts) = draw(&lane, &along(100, 200.0), 0.0);
        let drawn = texts.into_string();
        // Inside of a wide bar, behind a thin one.
        assert!(
            drawn.contains(">Drive(1 2)</text>") && drawn.contains(">Turn(30)</text>"),
            "{drawn}"
        );
        assert!(!drawn.contains(">Still</text>"), "{drawn}");
        let escaped = self::lane(&[(0, 100, "Say(<&)")]);
        let (bars, texts) = draw(&escaped, &along(100, 200.0), 0.0);
        let drawn = bars.into_string() + &texts.into_string();
        assert!(
            drawn.contains("Say(&lt;&amp;)") && !drawn.contains("(<&"),
            "{drawn}"
        );
    }
}
