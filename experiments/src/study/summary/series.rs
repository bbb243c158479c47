//! Curves of a cell, index by index, and from where on they differ from the baseline's.

use std::collections::BTreeMap;

use serde::Serialize;

use super::figures::{difference_key, in_blocks, key, other, paired};
use super::values::curves;
use super::{Difference, Estimate};
use crate::stats::{bootstrap, paired as tests};
use crate::study::results::Results;
use farside_actors::system::Series;

/// The largest p, adjusted, at which a difference is told of.
pub const ALPHA: f64 = 0.05;

/// What the runs of a cell say of a curve.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SeriesSummary {
    /// How many runs report a curve.
    pub n: usize,
    /// The mean at each index.
    pub points: Vec<SeriesPoint>,
    /// How much more it is than in the baseline, with the same seeds. None in the baseline itself.
    pub difference: Option<SeriesDifference>,
}

/// The mean of curves at an index.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SeriesPoint {
    /// The index.
    pub index: f64,
    /// How many runs have a value there.
    pub n: usize,
    /// Their mean.
    pub mean: f64,
    /// The lower end of its interval.
    pub ci_low: f64,
    /// The upper end.
    pub ci_high: f64,
}

/// How a cell's curves differ from those of another cell: here minus there, over the seeds that
/// both have, at the indices that both have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SeriesDifference {
    /// The difference at each index.
    pub points: Vec<DifferencePoint>,
    /// The family of tests that Holm's method holds together: how many indices of this curve,
    /// against this one other cell, have a p.
    pub family: usize,
    /// The index from which on to the last the difference holds: each interval leaves out 0 on the
    /// same side, each p, adjusted, is at most [`ALPHA`], and there are [`super::SURE_FROM`]
    /// blocks. None if it does not hold at the last index.
    pub holds_from: Option<f64>,
    /// Whether it is more than in the other cell from there on, or less.
    pub is_more: Option<bool>,
}

/// How curves differ at an index.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DifferencePoint {
    /// The index.
    pub index: f64,
    /// The difference, with the interval for this index alone.
    #[serde(flatten)]
    pub difference: Difference,
    /// Student's p over the blocks, for this index alone.
    pub p: f64,
    /// The same for all indices together, by Holm.
    pub p_holm: f64,
}

impl SeriesPoint {
    /// The mean with its interval.
    pub fn estimate(&self) -> Estimate {
        Estimate {
            value: self.mean,
            low: self.ci_low,
            high: self.ci_high,
        }
    }
}

/// Sums up a cell's curves.
pub(super) fn series_summary(results: &Results, cell: usize, name: &str) -> SeriesSummary {
    let here = curves(results, cell, name);
    // The same draws at each index: a band is then as smooth as its curves.
    let key = key(results, cell, name);
    let points = indices(here.values()).into_iter().map(|index| {
        let values = at(&here, index);
        let n = values.len();
        let mean = bootstrap::mean(in_blocks(&results.manifest, values), key);
        SeriesPoint {
            index,
            n,
            mean: mean.value,
            ci_low: mean.low,
            ci_high: mean.high,
        }
    });
    SeriesSummary {
        n: here.len(),
        points: points.collect(),
        difference: other(results, cell).map(|there| difference(results, (cell, there), name)),
    }
}

/// How the curves of one cell differ from those of another.
pub(super) fn difference(
    results: &Results,
    (here, there): (usize, usize),
    name: &str,
) -> SeriesDifference {
    let key = difference_key(results, (here, there), name);
    let pairs = pairs(results, (here, there), name).into_iter();
    let points = pairs.map(|Pairs { index, blocks }| {
        let n = blocks.iter().map(Vec::len).sum();
        let p = tests::student(&bootstrap::differences(&blocks), 0.0);
        DifferencePoint {
            index,
            difference: Difference::new(
                n,
                blocks.len(),
                bootstrap::paired_difference(&blocks, key),
            ),
            p,
            p_holm: f64::NAN,
        }
    });
    let mut points: Vec<DifferencePoint> = points.collect();
    let all: Vec<f64> = points.iter().map(|point| point.p).collect();
    for (point, p_holm) in points.iter_mut().zip(tests::holm(&all)) {
        point.p_holm = p_holm;
    }
    let side = |point: &DifferencePoint| {
        let Difference {
            ci_low, ci_high, ..
        } = point.difference;
        let apart = point.difference.has_blocks_enough()
            && point.p_holm <= ALPHA
            && (ci_low > 0.0 || ci_high < 0.0);
        apart.then_some(ci_low > 0.0)
    };
    let is_more = points.last().and_then(side);
    let held = points.iter().rev();
    let held = held.take_while(|point| is_more.is_some() && side(point) == is_more);
    SeriesDifference {
        family: all.iter().filter(|p| !p.is_nan()).count(),
        holds_from: held.last().map(|point| point.index),
        is_more,
        points,
    }
}

/// What two cells say with the same seeds at an index.
pub(super) struct Pairs {
    pub(super) index: f64,
    /// Here and there, by block.
    pub(super) blocks: Vec<Vec<(f64, f64)>>,
}

/// The pairs of two cells at each index at which there are any.
pub(super) fn pairs(results: &Results, (here, there): (usize, usize), name: &str) -> Vec<Pairs> {
    let [here, there] = [here, there].map(|cell| curves(results, cell, name));
    let all = indices(here.values()).into_iter();
    let pairs = all.map(|index| Pairs {
        index,
        blocks: in_blocks(
            &results.manifest,
            paired(&at(&here, index), &at(&there, index)),
        ),
    });
    pairs.filter(|pairs| !pairs.blocks.is_empty()).collect()
}

/// The values of curves at an index, by seed.
fn at(curves: &BTreeMap<u64, Series>, index: f64) -> BTreeMap<u64, f64> {
    let values = curves.iter();
    let values = values.filter_map(|(seed, series)| Some((*seed, series.at(index)?)));
    values.collect()
}

/// All indices of some curves, least first.
fn indices<'a>(curves: impl Iterator<Item = &'a Series>) -> Vec<f64> {
    let mut all: Vec<f64> = Vec::new();
    for series in curves {
        if !all.starts_with(series.index()) {
            all.extend(series.index());
            all.sort_by(f64::total_cmp);
            all.dedup();
        }
    }
    all
}
