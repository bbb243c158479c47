//! What a cell says of a metric, kind by kind.

use std::collections::BTreeMap;

use farside::random::RandomKey;

use super::values::{number_of, observations, value_of};
use super::{
    Difference, ListSummary, McNemarSummary, MetricSummary, NumberSummary, OverallSummary,
    RateSummary, SHARES, baseline,
};
use crate::stats::distribution::Ecdf;
use crate::stats::survival::kaplan_meier;
use crate::stats::{Blocks, bootstrap, rates};
use crate::study::results::{Manifest, Results, RunRecord};

/// The address of the draws for a metric in a cell. By names, so that a study with one more cell or
/// metric keeps the intervals of all others.
pub(super) fn key(results: &Results, cell: usize, metric: &str) -> RandomKey {
    let base = RandomKey::new(0).text("bootstrap").text(metric);
    base.text(&name_of(results, cell))
}

/// The address of the draws for how a cell differs from another.
pub(super) fn difference_key(
    results: &Results,
    (here, there): (usize, usize),
    metric: &str,
) -> RandomKey {
    let key = key(results, here, metric).text("difference");
    // One difference is one figure, wherever it is told of.
    if baseline(results) == Some(there) {
        key
    } else {
        key.text(&name_of(results, there))
    }
}

fn name_of(results: &Results, cell: usize) -> String {
    let texts = results.manifest.cells.get(cell).map(|cell| &cell.texts);
    let factors = results.manifest.factors.iter().map(|factor| &factor.name);
    let name: Vec<String> = factors
        .zip(texts.into_iter().flatten())
        .map(|(factor, text)| format!("{factor}={text}"))
        .collect();
    name.join("\n")
}

/// What runs say, by block of their seeds. What belongs to no seed of the study is left out.
pub(super) fn in_blocks<T>(manifest: &Manifest, by_seed: BTreeMap<u64, T>) -> Vec<Vec<T>> {
    if manifest.block <= 1 {
        return by_seed.into_values().map(|value| vec![value]).collect();
    }
    let places = manifest.seeds.iter().enumerate();
    let places: BTreeMap<u64, usize> = places.map(|(place, seed)| (*seed, place)).collect();
    let mut blocks: BTreeMap<usize, Vec<T>> = BTreeMap::new();
    for (seed, value) in by_seed {
        if let Some(place) = places.get(&seed) {
            blocks
                .entry(place / manifest.block)
                .or_default()
                .push(value);
        }
    }
    blocks.into_values().collect()
}

/// The numbers of some runs, by seed.
fn numbers(runs: &[RunRecord], name: &str) -> BTreeMap<u64, f64> {
    let numbers = runs
        .iter()
        .map(|run| Some((run.seed, number_of(run, name)?)));
    numbers.flatten().collect()
}

/// The truth values of some runs, by seed.
fn truths(runs: &[RunRecord], name: &str) -> BTreeMap<u64, bool> {
    let truths = runs
        .iter()
        .map(|run| Some((run.seed, value_of(&run.outcome, name)?.as_bool()?)));
    truths.flatten().collect()
}

/// What two cells say with the same seed.
pub(super) fn paired<T: Copy>(
    here: &BTreeMap<u64, T>,
    there: &BTreeMap<u64, T>,
) -> BTreeMap<u64, (T, T)> {
    let pairs = here
        .iter()
        .map(|(seed, value)| Some((*seed, (*value, *there.get(seed)?))));
    pairs.flatten().collect()
}

/// The baseline to compare `cell` with.
pub(super) fn other(results: &Results, cell: usize) -> Option<usize> {
    baseline(results).filter(|baseline| *baseline != cell)
}

/// How much more a number is in one cell than in another.
pub(super) fn number_difference(
    results: &Results,
    (here, there): (usize, usize),
    name: &str,
) -> Difference {
    let [a, b] = [here, there].map(|cell| numbers(results.of_cell(cell), name));
    let pairs = paired(&a, &b);
    let n = pairs.len();
    let pairs = in_blocks(&results.manifest, pairs);
    let key = difference_key(results, (here, there), name);
    Difference::new(n, pairs.len(), bootstrap::paired_difference(&pairs, key))
}

/// McNemar's test of one cell against another, and how much more often something is true.
pub(super) fn rate_test(
    results: &Results,
    (here, there): (usize, usize),
    name: &str,
) -> (rates::McNemar, Difference) {
    let [a, b] = [here, there].map(|cell| truths(results.of_cell(cell), name));
    let blocks = in_blocks(&results.manifest, paired(&a, &b));
    let test = rates::mcnemar_in_blocks(&blocks);
    let estimate = rates::paired_rate_difference(&test);
    let difference = Difference::new(test.pairs(), blocks.len(), estimate);
    (test, difference)
}

pub(super) fn number_summary(results: &Results, cell: usize, name: &str) -> NumberSummary {
    let here = numbers(results.of_cell(cell), name);
    let difference = other(results, cell);
    let difference = difference.map(|there| number_difference(results, (cell, there), name));
    let values: Vec<f64> = here.values().copied().collect();
    let blocks = in_blocks(&results.manifest, here);
    let (mean, iqm) = bootstrap::mean_and_interquartile_mean(blocks, key(results, cell, name));
    NumberSummary {
        n: values.len(),
        mean: mean.value,
        ci_low: mean.low,
        ci_high: mean.high,
        iqm: iqm.value,
        iqm_low: iqm.low,
        iqm_high: iqm.high,
        // Of NaN and a number, the functions return the number.
        min: values.iter().copied().fold(f64::NAN, f64::min),
        max: values.iter().copied().fold(f64::NAN, f64::max),
        difference,
    }
}

pub(super) fn rate_summary(results: &Results, cell: usize, name: &str) -> RateSummary {
    let here = truths(results.of_cell(cell), name);
    let (n, happened) = (here.len(), here.values().filter(|yes| **yes).count());
    let rate = rates::wilson_in_blocks(&in_blocks(&results.manifest, here));
    let tested = other(results, cell).map(|there| rate_test(results, (cell, there), name));
    let (test, difference) = tested.unzip();
    RateSummary {
        n,
        happened,
        mean: rate.value,
        ci_low: rate.low,
        ci_high: rate.high,
        difference,
        mcnemar: test.map(|test| McNemarSummary {
            only_here: test.only_first,
            only_baseline: test.only_second,
            p: test.p,
        }),
    }
}

pub(super) fn list_summary(results: &Results, cell: usize, name: &str) -> ListSummary {
    let observations = observations(results, cell, name);
    let runs = results.of_cell(cell);
    let curve = kaplan_meier(&observations);
    let happened = observations.iter().filter(|one| one.happened).count();
    let never = observations.iter().filter(|one| one.time.is_infinite());
    let never = never.count();
    let median = curve.median();
    let all_happened = happened == observations.len();
    let times: Vec<f64> = observations.iter().map(|one| one.time).collect();
    let ecdf = Ecdf::new(if all_happened { &times } else { &[] });
    let quantile = |share: f64| {
        if all_happened {
            ecdf.quantile(share)
        } else {
            curve.quantile(share)
        }
    };
    ListSummary {
        n: runs
            .iter()
            .filter(|run| value_of(&run.outcome, name).is_some_and(|value| value.is_array()))
            .count(),
        values: observations.len(),
        happened,
        censored: observations.len() - happened - never,
        never,
        median: median.value,
        median_low: median.low,
        median_high: median.high,
        quantiles: SHARES
            .iter()
            .map(|share| (format!("p{:02.0}", share * 100.0), quantile(*share)))
            .collect(),
    }
}

pub(super) fn text_summary(runs: &[RunRecord], name: &str) -> MetricSummary {
    let mut counts = BTreeMap::new();
    for value in runs.iter().filter_map(|run| value_of(&run.outcome, name)) {
        let word = value
            .as_str()
            .map_or_else(|| value.to_string(), str::to_owned);
        *counts.entry(word).or_default() += 1;
    }
    MetricSummary::Text {
        n: counts.values().sum(),
        counts,
    }
}

pub(super) fn overall(results: &Results, name: &str) -> OverallSummary {
    let cells = 0..results.manifest.cells.len();
    let values: Vec<Blocks> = cells
        .map(|cell| {
            let numbers = numbers(results.of_cell(cell), name);
            in_blocks(&results.manifest, numbers).into()
        })
        .collect();
    let key = RandomKey::new(0).text("stratified").text(name);
    let overall = bootstrap::stratified(&values, key);
    let (mean, iqm) = (overall.mean, overall.interquartile_mean);
    OverallSummary {
        mean: mean.value,
        ci_low: mean.low,
        ci_high: mean.high,
        iqm: iqm.value,
        iqm_low: iqm.low,
        iqm_high: iqm.high,
    }
}
