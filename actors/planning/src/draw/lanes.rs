//! Timelines: tokens in rows, with what is written on them.

use super::marks::{Sheet, shortened, text_width};
use super::{BAR, BETWEEN, Chart, RIGHT, ROW, WIDTH, is_flexible};
use crate::plan::{PlanTimelineKind, PlanToken};

/// The room left and right of a text in a bar.
const BESIDE: f64 = 5.0;
/// The room for the mark of a goal.
const MARK: f64 = 15.0;

/// A timeline, with its tokens in rows in which none is over another.
pub(super) struct Lane<'a> {
    pub(super) name: &'a str,
    pub(super) rows: Vec<Vec<&'a PlanToken>>,
}

/// The lanes of a plan's timelines, but for free ones that are empty, and then those of tokens whose
/// timelines it does not list.
pub(super) fn of<'a>(chart: &Chart<'a>) -> Vec<Lane<'a>> {
    let plan = chart.plan;
    let listed = plan.timelines.iter().map(|timeline| {
        let is_free = timeline.kind == PlanTimelineKind::Free;
        (timeline.name.as_str(), is_free)
    });
    let mut timelines: Vec<(&str, bool)> = listed.collect();
    for token in &plan.tokens {
        if !timelines.iter().any(|(name, _)| *name == token.timeline) {
            timelines.push((&token.timeline, true));
        }
    }
    let mut lanes = Vec::new();
    for (name, is_free) in timelines {
        let tokens = plan.tokens.iter().filter(|token| token.timeline == name);
        let mut tokens: Vec<&PlanToken> = tokens.collect();
        tokens.sort_by_key(|token| (token.start, token.end, token.id));
        if !tokens.is_empty() || !is_free {
            let rows = packed(chart, tokens, is_free);
            lanes.push(Lane { name, rows });
        }
    }
    lanes
}

/// Puts each token into the first row that is free from its start on. There is at least one row.
/// Those of free timelines have room for what is written behind short bars as well.
fn packed<'a>(
    chart: &Chart<'a>,
    tokens: Vec<&'a PlanToken>,
    is_free: bool,
) -> Vec<Vec<&'a PlanToken>> {
    let mut rows: Vec<Vec<&PlanToken>> = vec![Vec::new()];
    // By row: where it is taken to.
    let mut taken = vec![f64::NEG_INFINITY];
    for token in tokens {
        let [from, to] = bar(chart, token);
        let room = room(chart, token, short(&texts(chart, token)));
        let to = if is_free && to - from < room {
            to + room
        } else {
            to
        };
        let row = match taken.iter().position(|&end| end <= from) {
            Some(row) => row,
            None => {
                rows.push(Vec::new());
                taken.push(0.0);
                rows.len() - 1
            }
        };
        rows[row].push(token);
        taken[row] = to;
    }
    rows
}

/// Where a token's bar begins and ends. What takes no time is seen all the same.
fn bar(chart: &Chart<'_>, token: &PlanToken) -> [f64; 2] {
    let from = chart.x(token.start);
    [from, chart.x(token.end).max(from + 2.0)]
}

/// What can be written on a token, the longer the earlier.
fn texts(chart: &Chart<'_>, token: &PlanToken) -> Vec<String> {
    let (says, predicate) = (token.says(), token.predicate.clone());
    match chart.goals.get(&token.id) {
        Some(goals) => {
            let goals = shortened(&goals.join(", "), 40);
            vec![format!("{goals}: {says}"), goals, predicate]
        }
        None => vec![says, predicate],
    }
}

/// The text that should be there: a goal's name, or else what the token says.
fn short(texts: &[String]) -> &str {
    &texts[texts.len() - 2]
}

/// The room that a token's text takes, with the mark of a goal.
fn room(chart: &Chart<'_>, token: &PlanToken, text: &str) -> f64 {
    mark(chart, token) + text_width(text) + 2.0 * BESIDE
}

fn mark(chart: &Chart<'_>, token: &PlanToken) -> f64 {
    if chart.goals.contains_key(&token.id) {
        MARK
    } else {
        0.0
    }
}

impl Lane<'_> {
    pub(super) fn draw(&self, chart: &Chart<'_>, sheet: &mut Sheet, top: f64) {
        let height = self.rows.len() as f64 * ROW;
        let (left, right) = (chart.left, WIDTH - RIGHT);
        let edge = top + height + BETWEEN / 2.0;
        sheet.line([8.0, edge], [right, edge], "grid");
        sheet.text(
            [left - 10.0, top + BAR / 2.0 + 5.0],
            "end",
            &shortened(self.name, 30),
        );
        for (row, tokens) in self.rows.iter().enumerate() {
            let y = top + row as f64 * ROW;
            for (place, token) in tokens.iter().enumerate() {
                let [from, to] = bar(chart, token);
                let goals = chart.goals.get(&token.id);
                let predicate = chart
                    .predicates
                    .iter()
                    .position(|name| *name == token.predicate);
                let says = tooltip(token, goals);
                let bar = [from, y, to - from, BAR];
                sheet.bar(bar, predicate.unwrap_or(0), goals.is_some(), &says);
                if is_flexible(token) {
                    let ends = [token.start_window[0], token.end_window[1]];
                    // Neighbours can move over each other's times: every other one is lower.
                    let lower = if place % 2 == 0 { 2.5 } else { 6.5 };
                    sheet.extent(ends.map(|time| chart.x(time)), y + BAR + lower, &says);
                }
            }
            for (place, token) in tokens.iter().enumerate() {
                let next = tokens
                    .get(place + 1)
                    .map_or(right, |next| chart.x(next.start));
                label(chart, sheet, token, y, next);
            }
        }
    }
}

/// What a token says when pointed at.
fn tooltip(token: &PlanToken, goals: Option<&Vec<&str>>) -> String {
    let mut says = token.to_string();
    if let Some(goals) = goals {
        says += &format!(", achieves {}", goals.join(", "));
    }
    if is_flexible(token) {
        let ([a, b], [c, d]) = (token.start_window, token.end_window);
        says += &format!(", can start within [{a} {b}] and end within [{c} {d}]");
    }
    says
}

/// Writes what a token is into its bar, or behind it as far as nothing else is there: as much as
/// there is room for.
fn label(chart: &Chart<'_>, sheet: &mut Sheet, token: &PlanToken, y: f64, next: f64) {
    let [from, to] = bar(chart, token);
    let (texts, mark) = (texts(chart, token), mark(chart, token));
    let (inside, behind) = (to - from, next - to);
    let middle = y + BAR / 2.0;
    let mut write = |x: f64, text: &str| {
        if mark > 0.0 {
            sheet.diamond([x + 5.5, middle]);
        }
        sheet.text_over([x + mark, middle + 4.5], text);
    };
    let fits = |text: &&String, room_there: f64| room(chart, token, text) <= room_there;
    let (wanted, predicate) = texts.split_at(texts.len() - 1);
    if let Some(text) = wanted.iter().find(|text| fits(text, inside)) {
        return write(from + BESIDE, text);
    }
    if let Some(text) = texts.iter().find(|text| fits(text, behind)) {
        return write(to + BESIDE, text);
    }
    if let Some(text) = predicate
        .iter()
        .find(|text| mark == 0.0 && fits(text, inside))
    {
        return write(from + BESIDE, text);
    }
    // Names that differ mostly do so at their ends.
    let text = short(&texts);
    let ends = text
        .char_indices()
        .map(|(at, _)| format!("…{}", &text[at..]));
    let end = ends.skip(1).find(|end| room(chart, token, end) <= inside);
    match end.filter(|end| end.chars().count() > 2) {
        Some(end) => write(from + BESIDE, &end),
        None if mark > 0.0 => sheet.diamond([(from + to) / 2.0, middle]),
        None => {}
    }
}
