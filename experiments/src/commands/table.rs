//! The short table at the end of a run: the team, the messages, the clock.

use std::fmt::Write;

use farside::{Counts, Report};

/// A group of lines, each a label and a text.
pub(super) struct Group {
    pub(super) title: &'static str,
    pub(super) lines: Vec<(String, String)>,
}

/// Groups below each other, in three aligned columns.
pub(super) fn table(groups: &[Group]) -> String {
    let labels = groups.iter().flat_map(|group| &group.lines);
    let label_width = labels.map(|(label, _)| label.chars().count()).max();
    let label_width = label_width.unwrap_or(0);
    let title_width = groups
        .iter()
        .map(|group| group.title.len())
        .max()
        .unwrap_or(0);
    let mut out = String::new();
    for group in groups {
        for (index, (label, text)) in group.lines.iter().enumerate() {
            let title = if index == 0 { group.title } else { "" };
            // Writing to a string cannot fail.
            let _ = writeln!(out, "  {title:title_width$}  {label:label_width$}  {text}");
        }
    }
    out
}

pub(super) fn messages(counts: &Counts) -> Group {
    let copies = counts.delivered + counts.lost + counts.in_flight;
    let mut lines = vec![
        ("sent".to_owned(), grouped(counts.sent)),
        ("delivered".to_owned(), grouped(counts.delivered)),
        ("lost".to_owned(), share(counts.lost, copies)),
    ];
    for (reason, count) in &counts.lost_by_reason {
        lines.push((format!("  by {reason}"), grouped(*count)));
    }
    if counts.duplicated > 0 {
        lines.push(("duplicated".to_owned(), grouped(counts.duplicated)));
    }
    lines.push(("under way at the end".to_owned(), grouped(counts.in_flight)));
    Group {
        title: "messages",
        lines,
    }
}

pub(super) fn clock(report: &Report, wall_s: f64) -> Group {
    let sim_s = report.end_time.as_secs_f64();
    let per_wall = |amount: f64| amount / wall_s.max(1e-9);
    Group {
        title: "clock",
        lines: vec![
            ("virtual time".to_owned(), format!("{sim_s:.3}s")),
            (
                "wall time".to_owned(),
                format!("{wall_s:.2}s, {:.0} times real time", per_wall(sim_s)),
            ),
            (
                "events".to_owned(),
                format!(
                    "{}, {} a second",
                    grouped(report.counts.events),
                    grouped(per_wall(report.counts.events as f64) as u64)
                ),
            ),
        ],
    }
}

fn share(part: u64, whole: u64) -> String {
    if whole == 0 {
        return grouped(part);
    }
    let percent = 100.0 * part as f64 / whole as f64;
    format!("{} ({percent:.1} %)", grouped(part))
}

/// The number with commas between thousands.
pub(super) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut out = String::with_capacity(digits.len() * 4 / 3);
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped_and_columns_aligned() {
        assert_eq!(
            [0, 999, 1000, 1_234_567].map(grouped),
            ["0", "999", "1,000", "1,234,567"]
        );
        let line = |label: &str| (label.to_owned(), "x".to_owned());
        let group = Group {
            title: "team",
            lines: vec![line("a"), line("longer")],
        };
        assert_eq!(table(&[group]), "  team  a       x\n        longer  x\n");
    }
}
