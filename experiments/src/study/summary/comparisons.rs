//! Cells against each other, where a publication says that one is more than another, or as much.

use serde::Serialize;

use super::figures::{number_difference, rate_difference, rate_test};
use super::series::{self, ALPHA, DifferencePoint};
use super::values::Kind;
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
    /// The interval reaches to both sides, or there is none.
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
pub(super) fn compare(results: &Results, kinds: &[(String, Kind)]) -> Vec<ComparisonSummary> {
    let mut all = Vec::new();
    let cells = results.manifest.cells.len();
    for (index, table) in results.manifest.published.iter().enumerate() {
        let kind = kinds.iter().find(|(name, _)| *name == table.metric);
        let kind = kind.map_or(Kind::Absent, |(_, kind)| *kind);
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
    kind: Kind,
    cells: (usize, usize),
    claim: &Comparison,
) -> Judged {
    let bounds = Bounds::new(claim, table.scale);
    let name = &table.metric;
    let difference = match kind {
        Kind::Series => return judge_curve(results, name, cells, claim, bounds),
        Kind::Rate => rate_difference(&rate_test(results, cells, name)),
        Kind::Number => number_difference(results, cells, name),
        // Refused when the study is planned; a folder of other making has no verdict.
        Kind::List | Kind::Text | Kind::Absent => Difference::new(0, Estimate::unknown(f64::NAN)),
    };
    Judged {
        verdict: bounds.judge(&difference.estimate()),
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
        .map(|point| bounds.judge(&point.difference.estimate()))
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
            || Difference::new(0, Estimate::unknown(f64::NAN)),
            |worst| worst.difference.clone(),
        ),
        at: worst.map(|worst| (worst.index, points.len())),
        verdict,
    }
}
