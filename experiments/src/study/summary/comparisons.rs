//! Cells against each other, where a publication says that one is more than another, or as much.

use serde::Serialize;

use super::figures::{number_difference, rate_test};
use super::series::{self, ALPHA, DifferencePoint};
use super::values::ValueKind;
use super::{Difference, Estimate};
use crate::stats::{bootstrap, paired};
use crate::study::results::{Claim, Comparison, Published, Results};

/// What the runs say of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The whole interval is where the claim says; of a curve, each index's is.
    Holds,
    /// The whole interval is where the claim says that it is not. Of a curve, some index's is, and
    /// Student's p against the broken bound is small, too, when all indices are looked at (Holm).
    DoesNotHold,
    /// The interval reaches to both sides, there is none, or it is of too few blocks to be sure of
    /// ([`super::SURE_FROM`]).
    Undecided,
}

impl Verdict {
    /// The verdict in words.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Holds => "holds",
            Verdict::DoesNotHold => "does not hold",
            Verdict::Undecided => "undecided",
        }
    }
}

/// A cell against another, in the publication's unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparisonSummary {
    /// Which of [`crate::study::results::Manifest::published`].
    pub table: usize,
    /// Its title.
    pub title: String,
    /// The metric.
    pub metric: String,
    /// The unit, empty for none.
    pub unit: String,
    /// The cell that is said to be more.
    pub cell: usize,
    /// The cell that it is compared with.
    pub other: usize,
    /// In the publication's words, if it gives any.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub quote: String,
    /// From which index on it is claimed, if the metric is a curve.
    pub from_index: Option<f64>,
    /// The least difference that is claimed.
    pub by_at_least: Option<f64>,
    /// The greatest difference that is claimed.
    pub by_at_most: Option<f64>,
    /// The greatest difference to either side that is claimed.
    pub equal_within: Option<f64>,
    /// How many seeds both cells have; of a curve, at [`ComparisonSummary::index`].
    pub n: usize,
    /// Of a curve, the index whose interval speaks most against the claim: the figures are its.
    pub index: Option<f64>,
    /// Of a curve, over how many indices it is claimed.
    pub indices: Option<usize>,
    /// The mean difference: the cell less the other.
    pub difference: f64,
    /// The lower end of its interval.
    pub ci_low: f64,
    /// The upper end.
    pub ci_high: f64,
    /// What that says of the claim.
    pub verdict: Verdict,
}

/// Where a claim says that a difference is.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    low: f64,
    high: f64,
    /// A difference at the lower bound is not enough: more is claimed, not as much.
    is_open: bool,
}

impl Bounds {
    /// In the metric's own unit.
    fn new(claim: &Comparison, scale: f64) -> Self {
        if let Some(within) = claim.equal_within {
            let (low, high) = (-within / scale, within / scale);
            let is_open = false;
            return Bounds { low, high, is_open };
        }
        Bounds {
            low: claim.by_at_least.unwrap_or(0.0) / scale,
            high: claim.by_at_most.unwrap_or(f64::INFINITY) / scale,
            is_open: claim.by_at_least.is_none(),
        }
    }

    fn verdict(&self, difference: &Difference) -> Verdict {
        if difference.has_blocks_enough() {
            self.judge(&difference.estimate())
        } else {
            Verdict::Undecided
        }
    }

    fn judge(&self, difference: &Estimate) -> Verdict {
        if !difference.is_known() {
            return Verdict::Undecided;
        }
        let (low, high) = (difference.low, difference.high);
        let enough = low > self.low || !self.is_open && low == self.low;
        let too_little = high < self.low || self.is_open && high == self.low;
        if enough && high <= self.high {
            Verdict::Holds
        } else if too_little || low > self.high {
            Verdict::DoesNotHold
        } else {
            Verdict::Undecided
        }
    }

    /// How far the interval is inside; the less, the more it speaks against the claim.
    fn room(&self, difference: &Estimate) -> f64 {
        (difference.low - self.low).min(self.high - difference.high)
    }

    /// The bound that a difference is beyond, or nearest to.
    fn broken(&self, value: f64) -> f64 {
        if value - self.low < self.high - value {
            self.low
        } else {
            self.high
        }
    }
}

/// All comparisons that were published, in the order of tables.
pub(super) fn compare(results: &Results, kinds: &[(String, ValueKind)]) -> Vec<ComparisonSummary> {
    let mut all = Vec::new();
    let cells = results.manifest.cells.len();
    for (index, table) in results.manifest.published.iter().enumerate() {
        let kind = kinds.iter().find(|(name, _)| *name == table.metric);
        let kind = kind.map_or(ValueKind::Absent, |(_, kind)| *kind);
        for figure in &table.figures {
            let Claim::Exceeds(claim) = &figure.claim else {
                continue;
            };
            // A manifest may be of anyone's making: cells that are not there are passed over.
            let pairs = figure.cells.iter().zip(&claim.others);
            for (here, there) in pairs.filter(|(a, b)| **a < cells && **b < cells) {
                let judged = judge(results, table, kind, (*here, *there), claim);
                all.push(summary((index, table), claim, &figure.quote, judged));
            }
        }
    }
    all
}

/// What the runs say of two cells, in the metric's unit.
struct Judged {
    cells: (usize, usize),
    difference: Difference,
    /// Of a curve, the index that the difference is at, and how many indices were looked at.
    at: Option<(f64, usize)>,
    verdict: Verdict,
}

fn summary(
    (index, table): (usize, &Published),
    claim: &Comparison,
    quote: &str,
    judged: Judged,
) -> ComparisonSummary {
    let Difference {
        n,
        mean,
        ci_low,
        ci_high,
        ..
    } = judged.difference;
    ComparisonSummary {
        table: index,
        title: table.title.clone(),
        metric: table.metric.clone(),
        unit: table.unit.clone(),
        cell: judged.cells.0,
        other: judged.cells.1,
        quote: quote.to_owned(),
        from_index: claim.from_index,
        by_at_least: claim.by_at_least,
        by_at_most: claim.by_at_most,
        equal_within: claim.equal_within,
        n,
        index: judged.at.map(|(index, _)| index),
        indices: judged.at.map(|(_, indices)| indices),
        difference: table.scale * mean,
        ci_low: table.scale * ci_low,
        ci_high: table.scale * ci_high,
        verdict: judged.verdict,
    }
}

fn judge(
    results: &Results,
    table: &Published,
    kind: ValueKind,
    cells: (usize, usize),
    claim: &Comparison,
) -> Judged {
    let bounds = Bounds::new(claim, table.scale);
    let name = &table.metric;
    let difference = match kind {
        ValueKind::Series => return judge_curve(results, name, cells, claim, bounds),
        ValueKind::Rate => rate_test(results, cells, name).1,
        ValueKind::Number => number_difference(results, cells, name),
        // Refused when the study is planned; a folder of other making has no verdict.
        ValueKind::List | ValueKind::Text | ValueKind::Absent => {
            Difference::new(0, 0, Estimate::unknown(f64::NAN))
        }
    };
    Judged {
        verdict: bounds.verdict(&difference),
        cells,
        difference,
        at: None,
    }
}

/// A claim for all indices from one on. It holds if it does at each of them: that needs no
/// correction for their number, since one that does not hold is enough against it. That one of many
/// does not hold may be chance, and is corrected for.
fn judge_curve(
    results: &Results,
    name: &str,
    cells: (usize, usize),
    claim: &Comparison,
    bounds: Bounds,
) -> Judged {
    let from = claim.from_index.unwrap_or(f64::NEG_INFINITY);
    let points = series::difference(results, cells, name).points;
    let points: Vec<DifferencePoint> = points
        .into_iter()
        .filter(|point| point.index >= from)
        .collect();
    let verdicts: Vec<Verdict> = points
        .iter()
        .map(|point| bounds.verdict(&point.difference))
        .collect();
    let pairs = series::pairs(results, cells, name).into_iter();
    let pairs = pairs.filter(|pairs| pairs.index >= from);
    let p: Vec<f64> = pairs
        .zip(&verdicts)
        .map(|(pairs, verdict)| {
            let differences = bootstrap::differences(&pairs.blocks);
            let means = differences.means();
            let mean = means.iter().sum::<f64>() / means.len() as f64;
            match verdict {
                Verdict::DoesNotHold => paired::student(&differences, bounds.broken(mean)),
                _ => 1.0,
            }
        })
        .collect();
    let mut adjusted = verdicts.iter().zip(paired::holm(&p));
    let verdict = if adjusted.any(|(one, p)| *one == Verdict::DoesNotHold && p <= ALPHA) {
        Verdict::DoesNotHold
    } else if !points.is_empty() && verdicts.iter().all(|one| *one == Verdict::Holds) {
        Verdict::Holds
    } else {
        Verdict::Undecided
    };
    let room = |point: &DifferencePoint| bounds.room(&point.difference.estimate());
    let worst = points.iter().min_by(|a, b| room(a).total_cmp(&room(b)));
    Judged {
        cells,
        difference: worst.map_or_else(
            || Difference::new(0, 0, Estimate::unknown(f64::NAN)),
            |worst| worst.difference.clone(),
        ),
        at: worst.map(|worst| (worst.index, points.len())),
        verdict,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::fabricated::{self, loss, with_curves};
    use crate::study::results::{PublishedFigure, RunOutcome};
    use crate::study::summary::{MetricSummary, summarise};

    fn claim(least: Option<f64>, most: Option<f64>, within: Option<f64>) -> Comparison {
        Comparison {
            others: vec![0],
            from_index: None,
            by_at_least: least,
            by_at_most: most,
            equal_within: within,
        }
    }

    #[test]
    fn an_interval_is_inside_outside_or_neither() {
        use Verdict::{DoesNotHold, Holds, Undecided};
        let more = claim(None, None, None);
        let between = claim(Some(10.0), Some(30.0), None);
        let equal = claim(None, None, Some(20.0));
        for (claim, ends, verdict) in [
            (&more, (0.1, 0.5), Holds),
            (&more, (0.0, 0.5), Undecided),
            (&more, (-0.5, 0.0), DoesNotHold),
            (&more, (0.0, 0.0), DoesNotHold),
            (&more, (f64::NEG_INFINITY, f64::INFINITY), Undecided),
            (&between, (0.1, 0.3), Holds),
            (&between, (0.05, 0.1), Undecided),
            (&between, (0.01, 0.09), DoesNotHold),
            (&between, (0.2, 0.4), Undecided),
            (&between, (0.31, 0.4), DoesNotHold),
            (&equal, (-0.2, 0.2), Holds),
            (&equal, (0.1, 0.3), Undecided),
            (&equal, (0.21, 0.3), DoesNotHold),
            (&equal, (-0.3, -0.21), DoesNotHold),
        ] {
            let (low, high) = ends;
            let value = if low == high { low } else { (low + high) / 2.0 };
            // In percent, as it was published.
            let bounds = Bounds::new(claim, 100.0);
            let found = bounds.judge(&Estimate { value, low, high });
            assert_eq!(found, verdict, "{claim:?} {ends:?}");
        }
    }

    /// Against the baseline, a comparison is the difference that the cell's summary has.
    #[test]
    fn one_difference_is_one_figure() {
        let mut results = fabricated::study("one", vec![loss()], 20);
        results = with_curves(results, 6);
        let figure = |cell: usize, other: usize| PublishedFigure {
            cells: vec![cell],
            claim: Claim::Exceeds(Comparison {
                others: vec![other],
                ..claim(None, None, None)
            }),
            quote: String::new(),
        };
        let table = |metric: &str| Published {
            metric: metric.to_owned(),
            title: "T".to_owned(),
            source: "S".to_owned(),
            unit: String::new(),
            scale: 1.0,
            rows: None,
            figures: vec![figure(4, 0), figure(0, 4), figure(4, 3)],
            note: String::new(),
            why: String::new(),
        };
        results.manifest.published = ["time_ratio", "completed", "reward"].map(table).to_vec();
        let summary = summarise(&results);
        let metrics = &summary.cells[4].metrics;
        let named = |name: &str| metrics.iter().find(|one| one.name == name).unwrap();
        let MetricSummary::Number(ratio) = &named("time_ratio").summary else {
            panic!("no number")
        };
        let MetricSummary::Rate(completed) = &named("completed").summary else {
            panic!("no rate")
        };
        let own = [&ratio.difference, &completed.difference];
        for (own, all) in own.into_iter().zip(summary.comparisons.chunks(3)) {
            let own = own.as_ref().unwrap();
            let [there, back, _] = all else {
                panic!("not three")
            };
            assert_eq!((there.difference, there.ci_low), (own.mean, own.ci_low));
            assert!((there.difference + back.difference).abs() < 1e-12);
        }
        let verdicts: Vec<Verdict> = summary.comparisons.iter().map(|one| one.verdict).collect();
        use Verdict::{DoesNotHold, Holds, Undecided};
        assert_eq!(verdicts[..2], [Holds, DoesNotHold]);
        // Before the half nothing differs; past it the claim that the worse one is more is wrong.
        assert_eq!(verdicts[6..8], [DoesNotHold, Undecided]);
    }

    /// Of many indices some differ by chance. Holm's correction keeps that from counting against a
    /// claim.
    #[test]
    fn chance_at_one_of_many_indices_is_nothing_against_a_claim() {
        let mut results = with_curves(fabricated::study("one", vec![loss()], 20), 80);
        // In the first half all cells are alike but for chance.
        for run in &mut results.runs {
            let RunOutcome::Done { metrics, .. } = &mut run.outcome else {
                continue;
            };
            for part in ["index", "values"] {
                let list = metrics["reward"][part].as_array_mut().unwrap();
                list.truncate(40);
            }
        }
        let claim = claim(None, None, None);
        let bounds = Bounds::new(&claim, 1.0);
        let mut by_chance = 0;
        for cells in [
            (1, 0),
            (2, 0),
            (3, 0),
            (4, 0),
            (0, 1),
            (0, 2),
            (0, 3),
            (0, 4),
        ] {
            let points = series::difference(&results, cells, "reward").points;
            let alone = points.iter().map(|point| bounds.verdict(&point.difference));
            by_chance += alone.filter(|one| *one == Verdict::DoesNotHold).count();
            let judged = judge_curve(&results, "reward", cells, &claim, bounds);
            assert_eq!(judged.verdict, Verdict::Undecided, "{cells:?}");
        }
        assert!(
            by_chance > 0,
            "no index differs by chance: nothing is shown"
        );
    }
}
