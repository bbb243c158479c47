//! Bootstraps: intervals for means without a belief about how values are spread.
//!
//! Within one cell the intervals are BCa, bias-corrected and accelerated (Efron, *Better Bootstrap
//! Confidence Intervals*, 1987): the plain percentile interval is too short on the long side of
//! skewed values, and times and losses of a team on bad links are skewed. Over several cells they
//! are percentile intervals of a stratified bootstrap, which redraws the seeds within each cell,
//! as rliable does (Agarwal and others, *Deep Reinforcement Learning at the Edge of the
//! Statistical Precipice*, 2021).
//!
//! What is drawn are blocks ([`Blocks`]): the runs that share a problem together, or each run
//! alone.
//!
//! With a handful of blocks any bootstrap is too sure of itself: no value beyond those that were
//! seen is ever drawn. Take 30 blocks a cell.

use farside::random::RandomKey;

use super::blocks::Pool;
use super::distribution::quantile;
use super::{Blocks, Estimate, normal};

/// How often values are drawn anew. The ends of an interval then err by some 6 % of the standard
/// error of what is estimated: less than what a table shows.
pub const RESAMPLES: usize = 2000;

/// A figure of some values that are sorted, least first.
pub(super) type Statistic = fn(&[f64]) -> f64;

/// The mean, with its BCa interval.
///
/// Of one block the interval is unknown; of equal values it is that value, and nobody can tell
/// from them how rare another one is.
///
/// ```
/// use farside::random::RandomKey;
/// use farside_experiments::stats::bootstrap::mean;
/// let key = RandomKey::new(0).text("time_ratio").text("loss=0.3");
/// let estimate = mean(&[1.2, 1.9, 1.4, 1.1, 3.0, 1.3], key);
/// assert!((estimate.value - 1.65).abs() < 1e-12);
/// assert!(estimate.low > 1.1 && estimate.high < 3.0);
/// ```
pub fn mean(values: impl Into<Blocks>, key: RandomKey) -> Estimate {
    let [mean] = bca(&values.into(), key, [mean_of]);
    mean
}

/// The mean and the interquartile mean, that of the middle half, each with its BCa interval, from
/// the same draws. The interquartile mean leaves out the lowest and the highest quarter, ⌊n/4⌋
/// values each, as rliable and scipy's `trim_mean` do: one bad run in thirty does not move it.
///
/// ```
/// use farside::random::RandomKey;
/// use farside_experiments::stats::bootstrap::mean_and_interquartile_mean;
/// let times = [1.0, 2.0, 3.0, 94.0];
/// let (mean, middle) = mean_and_interquartile_mean(&times, RandomKey::new(0));
/// assert_eq!((mean.value, middle.value), (25.0, 2.5));
/// ```
pub fn mean_and_interquartile_mean(
    values: impl Into<Blocks>,
    key: RandomKey,
) -> (Estimate, Estimate) {
    let [mean, middle] = bca(&values.into(), key, [mean_of, interquartile_mean_of]);
    (mean, middle)
}

/// The mean of `here - there` over runs that are paired by seed, in their blocks, with its BCa
/// interval. Blocks of pairs are drawn, so that what a seed does to both sides drops out: of equal
/// sides it is exactly 0.
///
/// ```
/// use farside::random::RandomKey;
/// use farside_experiments::stats::bootstrap::paired_difference;
/// // Seeds differ by tens, the two cells by one.
/// let pairs = [(11.0, 10.0), (21.5, 20.0), (30.5, 30.0), (41.0, 40.0)].map(|pair| vec![pair]);
/// let difference = paired_difference(&pairs, RandomKey::new(0));
/// assert_eq!(difference.value, 1.0);
/// assert!(difference.low > 0.0);
/// ```
pub fn paired_difference(pairs: &[Vec<(f64, f64)>], key: RandomKey) -> Estimate {
    mean(differences(pairs), key)
}

/// What is here less what is there, in blocks.
pub fn differences(pairs: &[Vec<(f64, f64)>]) -> Blocks {
    let of_block =
        |block: &Vec<(f64, f64)>| block.iter().map(|(here, there)| here - there).collect();
    let blocks: Vec<Vec<f64>> = pairs.iter().map(of_block).collect();
    blocks.into()
}

/// What several cells say together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overall {
    /// The mean of the cells' means: each cell counts the same, however many of its runs failed.
    pub mean: Estimate,
    /// The mean of the middle half of all values.
    pub interquartile_mean: Estimate,
}

/// The means over several cells, with percentile intervals of a bootstrap that draws within each
/// cell. Cells without values are left out.
///
/// ```
/// use farside::random::RandomKey;
/// use farside_experiments::stats::bootstrap::stratified;
/// // Two cells far apart: that is no reason to be unsure of their mean.
/// let cells = [[1.0, 1.1, 0.9], [100.0, 100.1, 99.9]].map(|cell| (&cell).into());
/// let overall = stratified(&cells, RandomKey::new(0));
/// assert!((overall.mean.value - 50.5).abs() < 1e-12);
/// assert!(overall.mean.width() < 0.2);
/// ```
pub fn stratified(cells: &[Blocks], key: RandomKey) -> Overall {
    let cells: Vec<&Blocks> = cells.iter().filter(|cell| cell.count() > 0).collect();
    let pool = Pool::new(&cells);
    let mean_of_cell = |blocks: &Vec<Vec<usize>>| {
        let places = blocks.iter().flatten();
        let mut values: Vec<f64> = places.map(|place| pool.sorted[*place]).collect();
        values.sort_by(f64::total_cmp);
        mean_of(&values)
    };
    let means: Vec<f64> = pool.places.iter().map(mean_of_cell).collect();
    let (mean, middle) = (mean_of(&means), interquartile_mean_of(&pool.sorted));
    if cells.iter().all(|cell| cell.count() < 2) {
        return Overall {
            mean: Estimate::unknown(mean),
            interquartile_mean: Estimate::unknown(middle),
        };
    }
    let mut stream = key.stream();
    let mut drawn = vec![0u32; pool.sorted.len()];
    let mut values = Vec::with_capacity(pool.sorted.len());
    let mut replicates = [const { Vec::new() }; 2];
    for _ in 0..RESAMPLES {
        drawn.fill(0);
        let sum_of_means: f64 = (0..cells.len())
            .map(|cell| pool.draw(cell, &mut stream, &mut drawn))
            .sum();
        replicates[0].push(sum_of_means / cells.len() as f64);
        expand(&pool.sorted, &drawn, &mut values);
        replicates[1].push(interquartile_mean_of(&values));
    }
    let percentile = |value: f64, mut replicates: Vec<f64>| {
        replicates.sort_by(f64::total_cmp);
        interval(value, &replicates, 0.025, 0.975)
    };
    let [means, middles] = replicates;
    Overall {
        mean: percentile(mean, means),
        interquartile_mean: percentile(middle, middles),
    }
}

/// BCa intervals of several statistics, from the same draws.
fn bca<const N: usize>(
    blocks: &Blocks,
    key: RandomKey,
    statistics: [Statistic; N],
) -> [Estimate; N] {
    let pool = Pool::new(&[blocks]);
    let sorted = &pool.sorted;
    if blocks.count() < 2 {
        return statistics.map(|statistic| Estimate::unknown(statistic(sorted)));
    }
    let (least, greatest) = (sorted[0], sorted[sorted.len() - 1]);
    // Differences that are equal in truth differ by roundings.
    if greatest - least <= 1e-13 * least.abs().max(greatest.abs()) {
        let (value, low, high) = (least, least, least);
        return [Estimate { value, low, high }; N];
    }
    let mut replicates = replicates(&pool, key, &statistics).into_iter();
    statistics.map(|statistic| bca_interval(&pool, statistic, replicates.next().as_deref()))
}

/// What each statistic says of each redrawn sample, least first.
pub(super) fn replicates<const N: usize>(
    pool: &Pool,
    key: RandomKey,
    statistics: &[Statistic; N],
) -> [Vec<f64>; N] {
    let mut stream = key.stream();
    let mut drawn = vec![0u32; pool.sorted.len()];
    let mut resample = Vec::with_capacity(pool.sorted.len());
    let mut replicates = [const { Vec::new() }; N];
    for _ in 0..RESAMPLES {
        drawn.fill(0);
        pool.draw(0, &mut stream, &mut drawn);
        expand(&pool.sorted, &drawn, &mut resample);
        for (statistic, replicates) in statistics.iter().zip(&mut replicates) {
            replicates.push(statistic(&resample));
        }
    }
    for replicates in &mut replicates {
        replicates.sort_by(f64::total_cmp);
    }
    replicates
}

fn bca_interval(pool: &Pool, statistic: Statistic, replicates: Option<&[f64]>) -> Estimate {
    let replicates = replicates.unwrap_or_default();
    let sorted = &pool.sorted;
    let value = statistic(sorted);
    // Replicates that equal the estimate but for rounding are half below it.
    let near = 1e-12 * (sorted[sorted.len() - 1] - sorted[0]);
    let below = replicates.partition_point(|replicate| *replicate < value - near);
    let up_to = replicates.partition_point(|replicate| *replicate <= value + near);
    let bias = normal::quantile((below + up_to) as f64 / (2 * replicates.len()) as f64);
    let acceleration = acceleration(pool, statistic);
    let corrected = |z: f64| {
        let z = bias + z;
        let share = normal::cumulative(bias + z / (1.0 - acceleration * z));
        // So lopsided that nothing can be corrected: the percentile it is.
        share.is_finite().then_some(share)
    };
    let low = corrected(-super::Z_95).unwrap_or(0.025);
    let high = corrected(super::Z_95).unwrap_or(0.975);
    interval(value, replicates, low.min(high), low.max(high))
}

/// How fast the spread of the estimate changes with what is estimated, from leaving out each block
/// in turn.
fn acceleration(pool: &Pool, statistic: Statistic) -> f64 {
    let mut rest = Vec::with_capacity(pool.sorted.len());
    let left_out: Vec<f64> = pool.places[0]
        .iter()
        .map(|out| {
            rest.clear();
            let mut from = 0;
            for place in out {
                rest.extend_from_slice(&pool.sorted[from..*place]);
                from = place + 1;
            }
            rest.extend_from_slice(&pool.sorted[from..]);
            statistic(&rest)
        })
        .collect();
    let centre = mean_of(&left_out);
    let (mut squares, mut cubes) = (0.0, 0.0);
    for value in left_out {
        let away = centre - value;
        squares += away * away;
        cubes += away * away * away;
    }
    if squares > 0.0 {
        cubes / (6.0 * squares * libm::sqrt(squares))
    } else {
        0.0
    }
}

/// The interval between two shares of sorted replicates. It is widened to hold the estimate, which
/// takes values of which nearly all are equal.
fn interval(value: f64, replicates: &[f64], low: f64, high: f64) -> Estimate {
    Estimate {
        value,
        low: quantile(replicates, low).min(value),
        high: quantile(replicates, high).max(value),
    }
}

/// Each value as often as it was drawn, so sorted as `sorted` is.
fn expand(sorted: &[f64], drawn: &[u32], values: &mut Vec<f64>) {
    values.clear();
    for (value, times) in sorted.iter().zip(drawn) {
        values.extend(std::iter::repeat_n(*value, *times as usize));
    }
}

pub(super) fn mean_of(values: &[f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    values.iter().sum::<f64>() / values.len() as f64
}

fn interquartile_mean_of(sorted: &[f64]) -> f64 {
    let cut = sorted.len() / 4;
    mean_of(&sorted[cut..sorted.len() - cut])
}
