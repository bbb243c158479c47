//! Our figures beside those that others published.
//!
//! A published figure has no interval, so the question is put the other way round: is it one that
//! our interval allows? Of twenty figures that are the same in truth, about one is not, by chance.

use serde::Serialize;

use super::CellSummary;
use crate::stats::line::{Line, least_squares};
use crate::study::results::{Claim, Manifest, Published, PublishedFigure};

/// A figure of ours beside a published one, both in the publication's unit. As JSON, what cannot be
/// known is `null`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Beside {
    /// Which of [`Manifest::published`].
    pub table: usize,
    /// Its title.
    pub title: String,
    /// The metric.
    pub metric: String,
    /// The unit, empty for none.
    pub unit: String,
    /// What was published.
    pub published: Claim,
    /// In the publication's words, if it was not in a table.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub quote: String,
    /// How many of our runs say anything.
    pub n: usize,
    /// Our figure: the mean, the rate, or the median of lists.
    pub estimate: f64,
    /// The lower end of its interval.
    pub ci_low: f64,
    /// The upper end.
    pub ci_high: f64,
    /// Ours less theirs. None beside a bound that ours keeps; else from the bound on.
    pub difference: Option<f64>,
    /// Our interval holds the published figure, or reaches into what a bound allows. None if we
    /// have no interval.
    pub inside: Option<bool>,
}

/// A line through cells that a publication calls linear, in the publication's unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LineSummary {
    /// Which of [`Manifest::published`].
    pub table: usize,
    /// Its title.
    pub title: String,
    /// The metric.
    pub metric: String,
    /// The factor along which it should be linear.
    pub factor: String,
    /// What the cells share, as `nodes 14`; empty if they share nothing.
    pub of: String,
    /// In the publication's words, if it gives any.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub quote: String,
    /// The cells, by place in the manifest, that have a figure.
    pub cells: Vec<usize>,
    /// By how much the figure grows with the factor.
    pub slope: f64,
    /// The figure where the factor is 0.
    pub intercept: f64,
    /// The coefficient of determination.
    pub r_squared: f64,
    /// How far the cell that is farthest from the line is off it, as a share of the greatest
    /// figure.
    pub farthest: f64,
}

impl LineSummary {
    /// The line itself.
    pub fn line(&self) -> Line {
        Line {
            slope: self.slope,
            intercept: self.intercept,
            r_squared: self.r_squared,
        }
    }
}

/// Sets what was published beside each cell's figures, and gives the lines.
pub(super) fn set_beside(manifest: &Manifest, cells: &mut [CellSummary]) -> Vec<LineSummary> {
    let mut lines = Vec::new();
    for (index, table) in manifest.published.iter().enumerate() {
        for figure in &table.figures {
            if let Claim::Linear(factor) = &figure.claim {
                lines.extend(lines_of(manifest, cells, index, figure, factor));
                continue;
            }
            // Of two cells, not of one: see [`super::comparisons`].
            if let Claim::Exceeds(_) = figure.claim {
                continue;
            }
            // A manifest may be of anyone's making: cells that are not there are passed over.
            for cell in &figure.cells {
                if let Some(cell) = cells.get_mut(*cell) {
                    let beside = beside(index, table, figure, cell);
                    cell.published.push(beside);
                }
            }
        }
    }
    lines
}

fn beside(index: usize, table: &Published, figure: &PublishedFigure, cell: &CellSummary) -> Beside {
    let named = cell.metrics.iter().find(|one| one.name == table.metric);
    let estimate = named.and_then(|named| named.summary.estimate());
    let [value, low, high] = match estimate {
        Some(one) => [one.value, one.low, one.high].map(|end| table.scale * end),
        None => [f64::NAN; 3],
    };
    let (difference, within) = match figure.claim {
        Claim::Value(theirs) | Claim::About(theirs) => {
            (Some(value - theirs), low <= theirs && theirs <= high)
        }
        Claim::Below(bound) => (Some(value - bound).filter(|over| *over >= 0.0), low < bound),
        Claim::Above(bound) => (
            Some(value - bound).filter(|over| *over <= 0.0),
            high > bound,
        ),
        Claim::Linear(_) | Claim::Exceeds(_) => (None, false),
    };
    let known = low.is_finite() && high.is_finite();
    Beside {
        table: index,
        title: table.title.clone(),
        metric: table.metric.clone(),
        unit: table.unit.clone(),
        published: figure.claim.clone(),
        quote: figure.quote.clone(),
        n: named.map_or(0, |named| named.summary.n()),
        estimate: value,
        ci_low: low,
        ci_high: high,
        difference: difference.filter(|difference| difference.is_finite()),
        inside: known.then_some(within),
    }
}

/// Cells that differ in one factor alone.
struct Group<'a> {
    /// The values of the others.
    others: Vec<&'a str>,
    /// The cell, where it is along the factor, and its figure.
    points: Vec<(usize, f64, f64)>,
}

/// A line through the cells of a figure for each combination of the other factors' values.
fn lines_of(
    manifest: &Manifest,
    cells: &[CellSummary],
    index: usize,
    figure: &PublishedFigure,
    factor: &str,
) -> Vec<LineSummary> {
    let table = &manifest.published[index];
    let mut factors = manifest.factors.iter();
    let Some(along) = factors.position(|one| one.name == factor) else {
        return Vec::new();
    };
    let groups = groups(table, cells, &figure.cells, (along, factor));
    let line_of = |group: &Group<'_>| {
        let points: Vec<(f64, f64)> = group.points.iter().map(|(_, x, y)| (*x, *y)).collect();
        let line = least_squares(&points).filter(|_| points.len() > 2)?;
        let greatest = points.iter().map(|(_, y)| y.abs()).fold(0.0, f64::max);
        let off = points.iter().map(|(x, y)| (y - line.at(*x)).abs());
        Some(LineSummary {
            table: index,
            title: table.title.clone(),
            metric: table.metric.clone(),
            factor: factor.to_owned(),
            of: name_of(manifest, &groups, group, along),
            quote: figure.quote.clone(),
            cells: group.points.iter().map(|(cell, ..)| *cell).collect(),
            slope: line.slope,
            intercept: line.intercept,
            r_squared: line.r_squared,
            farthest: off.fold(0.0, f64::max) / greatest,
        })
    };
    groups.iter().filter_map(line_of).collect()
}

/// The cells that have a figure, in groups, in the order of the cells.
fn groups<'a>(
    table: &Published,
    cells: &'a [CellSummary],
    of: &[usize],
    (along, factor): (usize, &str),
) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    for cell in of.iter().filter_map(|cell| cells.get(*cell)) {
        let named = cell.metrics.iter().find(|one| one.name == table.metric);
        let estimate = named.and_then(|named| named.summary.estimate());
        let x = cell.factors.get(factor).and_then(|value| value.as_f64());
        let Some((x, estimate)) = x.zip(estimate) else {
            continue;
        };
        let point = (cell.cell, x, table.scale * estimate.value);
        let texts = cell.texts.iter().enumerate();
        let others = texts.filter(|(at, _)| *at != along);
        let others: Vec<&str> = others.map(|(_, text)| text.as_str()).collect();
        match groups.iter_mut().find(|group| group.others == others) {
            Some(group) => group.points.push(point),
            None => groups.push(Group {
                others,
                points: vec![point],
            }),
        }
    }
    groups
}

/// What tells a group from the others: a value that all share says nothing.
fn name_of(manifest: &Manifest, all: &[Group<'_>], group: &Group<'_>, along: usize) -> String {
    let factors = manifest.factors.iter().enumerate();
    let labels = factors.filter(|(at, _)| *at != along);
    let labels = labels.map(|(_, factor)| &factor.label);
    let named = labels.zip(&group.others).enumerate();
    let telling = named.filter(|(at, (_, text))| {
        let differs = |other: &Group<'_>| other.others.get(*at) != Some(text);
        all.iter().any(differs)
    });
    let parts: Vec<String> = telling
        .map(|(_, (label, text))| format!("{label} {text}"))
        .collect();
    parts.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::fabricated::{self, latency, loss};
    use crate::study::results::Results;
    use crate::study::summary::{MetricSummary, summarise};

    /// Five latencies by five losses, with figures beside one metric.
    fn with(metric: &str, scale: f64, figures: Vec<(Vec<usize>, Claim)>) -> Results {
        let mut results = fabricated::study("beside", vec![latency(), loss()], 12);
        let figure = |(cells, claim)| PublishedFigure {
            cells,
            claim,
            quote: String::new(),
        };
        results.manifest.published = vec![Published {
            metric: metric.to_owned(),
            title: "Table 1".to_owned(),
            source: "somebody".to_owned(),
            unit: "%".to_owned(),
            scale,
            rows: None,
            figures: figures.into_iter().map(figure).collect(),
            note: String::new(),
            why: String::new(),
        }];
        results
    }

    /// Cell 7 of a study in which these are claimed of it.
    fn claimed(claim: Claim) -> Beside {
        let results = with("time_ratio", 100.0, vec![(vec![7], claim)]);
        let summary = summarise(&results);
        let others = summary.cells.iter().filter(|cell| cell.cell != 7);
        assert!(others.flat_map(|cell| &cell.published).next().is_none());
        let MetricSummary::Number(ours) = &summary.cells[7].metrics[1].summary else {
            panic!("no number")
        };
        let [one] = summary.cells[7].published.as_slice() else {
            panic!("not one")
        };
        assert_eq!(
            (one.estimate, one.ci_low, one.ci_high, one.n),
            (
                100.0 * ours.mean,
                100.0 * ours.ci_low,
                100.0 * ours.ci_high,
                ours.n
            )
        );
        one.clone()
    }

    #[test]
    fn a_figure_is_inside_if_our_interval_holds_it() {
        let ours = claimed(Claim::Value(0.0));
        let (low, value, high) = (ours.ci_low, ours.estimate, ours.ci_high);
        assert!(low < value && value < high);
        assert_eq!((ours.inside, ours.difference), (Some(false), Some(value)));
        for (theirs, inside) in [
            (low, true),
            (low - 0.1, false),
            (high, true),
            (high + 0.1, false),
        ] {
            for claim in [Claim::Value(theirs), Claim::About(theirs)] {
                let one = claimed(claim);
                assert_eq!(
                    (one.inside, one.difference),
                    (Some(inside), Some(value - theirs))
                );
            }
        }
        // A bound is kept by the figure, allowed by the interval, or broken.
        for (claim, inside, difference) in [
            (Claim::Below(value + 0.1), true, None),
            (Claim::Below(low + 0.01), true, Some(value - low - 0.01)),
            (Claim::Below(low), false, Some(value - low)),
            (Claim::Above(value - 0.1), true, None),
            (Claim::Above(high - 0.01), true, Some(value - high + 0.01)),
            (Claim::Above(high), false, Some(value - high)),
        ] {
            let one = claimed(claim.clone());
            assert_eq!(one.inside, Some(inside), "{claim:?}");
            match (one.difference, difference) {
                (Some(one), Some(other)) => assert!((one - other).abs() < 1e-9, "{claim:?}"),
                (one, other) => assert_eq!(one, other, "{claim:?}"),
            }
        }
    }

    #[test]
    fn what_cannot_be_compared_says_so() {
        let everywhere = (0..25).collect();
        let mut results = with("time_ratio", 1.0, vec![(everywhere, Claim::Value(2.0))]);
        results.manifest.published[0].figures[0].cells.push(99);
        results
            .runs
            .retain(|run| run.cell > 1 || run.cell == 1 && run.seed == 1);
        let summary = summarise(&results);
        assert!(summary.cells.iter().all(|cell| cell.published.len() == 1));
        // No run, one run, many.
        let [none, one, many] = [0, 1, 2].map(|cell: usize| &summary.cells[cell].published[0]);
        assert_eq!((none.n, none.inside, none.difference), (0, None, None));
        assert_eq!((one.n, one.inside), (1, None));
        assert!(one.difference.is_some() && many.inside.is_some());
        let json = serde_json::to_value(none).unwrap();
        assert!(
            json["estimate"].is_null() && json["published"]["value"] == 2.0,
            "{json}"
        );
        let words = with("deadlock", 1.0, vec![(vec![3], Claim::Value(2.0))]);
        assert_eq!(summarise(&words).cells[3].published[0].inside, None);
    }

    #[test]
    fn lines_go_through_cells_that_differ_in_one_factor() {
        let linear = |name: &str| Claim::Linear(name.to_owned());
        let all: Vec<usize> = (0..25).collect();
        let results = with("time_ratio", 100.0, vec![(all, linear("latency"))]);
        let summary = summarise(&results);
        assert_eq!(summary.lines.len(), 5);
        let line = &summary.lines[2];
        assert_eq!(
            (line.of.as_str(), line.cells.as_slice()),
            ("message loss 30%", &[2, 7, 12, 17, 22][..])
        );
        let mean = |cell: usize| match &summary.cells[cell].metrics[1].summary {
            MetricSummary::Number(number) => 100.0 * number.mean,
            other => panic!("{other:?}"),
        };
        let points: Vec<(f64, f64)> = line
            .cells
            .iter()
            .zip([0.005, 0.1, 0.25, 0.6, 1.3])
            .map(|(c, x)| (x, mean(*c)))
            .collect();
        let expected = least_squares(&points).unwrap();
        assert_eq!(line.line(), expected);
        let off = points
            .iter()
            .map(|(x, y)| (y - expected.at(*x)).abs())
            .fold(0.0, f64::max);
        assert!(off > 0.0 && (line.farthest - off / mean(22)).abs() < 1e-12);
        // Two cells make no line, and a name that all share is left out.
        let one = with(
            "time_ratio",
            1.0,
            vec![
                (vec![0, 5, 10], linear("latency")),
                (vec![0, 1], linear("loss")),
            ],
        );
        let lines = summarise(&one).lines;
        assert_eq!((lines.len(), lines[0].of.as_str()), (1, ""));
    }
}
