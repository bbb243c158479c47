//! Rates: how often something happened, and whether it happened more often there than here.

use super::{Estimate, Z_95, normal};

/// The rate of something that happened in `happened` of `n` runs. The interval is Wilson's
/// (*Probable Inference, the Law of Succession, and Statistical Inference*, 1927), which says
/// something at 0 and at `n` too: never in 300 runs bounds a rate at about 1.3 %.
///
/// Of no runs nothing is known: the rate is no number and the interval reaches from 0 to 1.
///
/// ```
/// use farside_experiments::stats::rates::wilson;
/// let collisions = wilson(0, 300);
/// assert_eq!((collisions.value, collisions.low), (0.0, 0.0));
/// assert!((collisions.high - 0.0126).abs() < 1e-4);
/// ```
pub fn wilson(happened: usize, n: usize) -> Estimate {
    if n == 0 {
        return Estimate {
            value: f64::NAN,
            low: 0.0,
            high: 1.0,
        };
    }
    wilson_of(happened.min(n) as f64, n as f64)
}

/// Wilson's interval of a count that may be a fraction of one.
fn wilson_of(k: f64, n: f64) -> Estimate {
    let z2 = Z_95 * Z_95;
    let centre = (k + z2 / 2.0) / (n + z2);
    let half = Z_95 / (n + z2) * libm::sqrt(k * (n - k) / n + z2 / 4.0);
    Estimate {
        value: k / n,
        // At the ends the formula gives the rate itself, but for rounding.
        low: if k <= 0.0 { 0.0 } else { centre - half },
        high: if k >= n { 1.0 } else { centre + half },
    }
}

/// The rate over runs in blocks, that share a problem. The interval is Wilson's for as many runs as
/// the blocks are worth: fewer than there are, by the design effect, which is how much more the
/// blocks' rates vary than those of unrelated runs would (Rao and Scott, *A Simple Method for the
/// Analysis of Clustered Binary Data*, 1992), but never fewer than there are blocks. Where all runs
/// say the same nothing tells how they hang together, and a block counts as one.
///
/// ```
/// use farside_experiments::stats::rates::{wilson, wilson_in_blocks};
/// // Ten problems of five runs; a problem is solved by all or by none.
/// let blocks: Vec<Vec<bool>> = (0..10).map(|problem| vec![problem < 4; 5]).collect();
/// let rate = wilson_in_blocks(&blocks);
/// assert_eq!((rate.value, rate.low), (0.4, wilson(4, 10).low));
/// ```
pub fn wilson_in_blocks(blocks: &[Vec<bool>]) -> Estimate {
    let counts = blocks.iter().filter(|block| !block.is_empty());
    let counts: Vec<(f64, f64)> = counts
        .map(|block| {
            let happened = block.iter().filter(|yes| **yes).count();
            (happened as f64, block.len() as f64)
        })
        .collect();
    let n: f64 = counts.iter().map(|(_, n)| n).sum();
    if counts.is_empty() {
        return wilson(0, 0);
    }
    let happened: f64 = counts.iter().map(|(k, _)| k).sum();
    let rate = happened / n;
    let worth = worth(&counts, rate * (1.0 - rate));
    Estimate {
        value: rate,
        ..wilson_of(worth * happened, worth * n)
    }
}

/// The share of runs that runs in blocks are worth: `sums` has the sum and the number of runs of
/// each block, and `variance` is that of one run.
fn worth(sums: &[(f64, f64)], variance: f64) -> f64 {
    let n: f64 = sums.iter().map(|(_, n)| n).sum();
    let m = sums.len() as f64;
    let least = m / n;
    if sums.iter().all(|(_, n)| *n == 1.0) {
        return 1.0;
    }
    if variance <= 0.0 || sums.len() < 2 {
        return least;
    }
    let mean = sums.iter().map(|(sum, _)| sum).sum::<f64>() / n;
    let squares = sums.iter().map(|(sum, n)| {
        let away = sum - mean * n;
        away * away
    });
    let effect = m / (m - 1.0) * squares.sum::<f64>() / (n * variance);
    (1.0 / effect).clamp(least, 1.0)
}

/// What McNemar's test says of two cells whose runs are paired by seed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct McNemar {
    /// Seeds with which it happened in both.
    pub both: usize,
    /// Only in the first.
    pub only_first: usize,
    /// Only in the second.
    pub only_second: usize,
    /// In neither.
    pub neither: usize,
    /// How often chance alone would tell the two apart at least as clearly. Exact and two-sided:
    /// of the seeds that tell them apart, each speaks for either with probability 1/2; of seeds in
    /// blocks, each block does, all its seeds together.
    pub p: f64,
    /// The share of pairs that these pairs are worth, for what those of one block have in common:
    /// 1 if each is alone.
    pub worth: f64,
}

/// Whether it happens more often in one of two cells, by the seeds with which it happened in just
/// one of them (McNemar, *Note on the Sampling Error of the Difference Between Correlated
/// Proportions*, 1947; with the exact binomial distribution). With no such seed, p is 1.
///
/// ```
/// use farside_experiments::stats::rates::mcnemar;
/// // Completed with 8 seeds here but not there, never the other way round.
/// let pairs: Vec<(bool, bool)> = (0..30).map(|seed| (true, seed >= 8)).collect();
/// let test = mcnemar(&pairs);
/// assert_eq!((test.only_first, test.only_second, test.both), (8, 0, 22));
/// assert_eq!(test.p, 2.0 / 256.0);
/// ```
pub fn mcnemar(pairs: &[(bool, bool)]) -> McNemar {
    let count = |wanted: (bool, bool)| pairs.iter().filter(|pair| **pair == wanted).count();
    let (only_first, only_second) = (count((true, false)), count((false, true)));
    McNemar {
        both: count((true, true)),
        only_first,
        only_second,
        neither: count((false, false)),
        p: sign_test(only_first.min(only_second), only_first + only_second),
        worth: 1.0,
    }
}

/// McNemar's test with blocks of pairs that share a problem. The sign of a whole block is what
/// chance decides: the exact randomisation test of the blocks' differences (Fisher, *The Design of
/// Experiments*, 1935, section 21), which with blocks of one pair is McNemar's.
///
/// ```
/// use farside_experiments::stats::rates::{mcnemar, mcnemar_in_blocks};
/// let pairs: Vec<(bool, bool)> = (0..30).map(|seed| (true, seed >= 10)).collect();
/// let blocks: Vec<_> = pairs.chunks(5).map(<[_]>::to_vec).collect();
/// // Ten seeds say so, but only two problems.
/// assert_eq!((mcnemar_in_blocks(&blocks).p, mcnemar(&pairs).p), (0.5, 2.0 / 1024.0));
/// ```
pub fn mcnemar_in_blocks(blocks: &[Vec<(bool, bool)>]) -> McNemar {
    let all: Vec<(bool, bool)> = blocks.iter().flatten().copied().collect();
    let alone = mcnemar(&all);
    if blocks.iter().all(|block| block.len() < 2) {
        return alone;
    }
    let filled = blocks.iter().filter(|block| !block.is_empty());
    let sums: Vec<(f64, f64)> = filled
        .map(|block| {
            let pairs = block.iter();
            let sum: f64 = pairs.map(|(a, b)| f64::from(*a) - f64::from(*b)).sum();
            (sum, block.len() as f64)
        })
        .collect();
    let n = alone.pairs() as f64;
    let apart = (alone.only_first + alone.only_second) as f64 / n;
    let mean = (alone.only_first as f64 - alone.only_second as f64) / n;
    McNemar {
        p: randomisation_test(&sums.iter().map(|(sum, _)| *sum as i64).collect::<Vec<_>>()),
        worth: worth(&sums, apart - mean * mean),
        ..alone
    }
}

/// The most steps of an exact randomisation test; beyond, its normal limit is as good.
const MAX_STEPS: usize = 50_000_000;

/// How often the sum of some whole numbers is as far from 0 if each has either sign by chance.
fn randomisation_test(sums: &[i64]) -> f64 {
    let found = sums.iter().sum::<i64>().unsigned_abs() as usize;
    let sizes = sums.iter().map(|sum| sum.unsigned_abs() as usize);
    let sizes: Vec<usize> = sizes.filter(|size| *size > 0).collect();
    let most: usize = sizes.iter().sum();
    if found == 0 {
        return 1.0;
    }
    if most.saturating_mul(sizes.len()) > MAX_STEPS {
        let squares: f64 = sizes.iter().map(|size| (size * size) as f64).sum();
        return 2.0 * normal::cumulative(-(found as f64) / libm::sqrt(squares));
    }
    // The probability of each sum, which is at `most` if it is 0.
    let mut chances = vec![0.0; 2 * most + 1];
    chances[most] = 1.0;
    let mut reach = 0;
    for size in sizes {
        let mut next = vec![0.0; chances.len()];
        for at in most - reach..=most + reach {
            next[at - size] += 0.5 * chances[at];
            next[at + size] += 0.5 * chances[at];
        }
        chances = next;
        reach += size;
    }
    let beyond = (0..=most - found).chain(most + found..=2 * most);
    beyond.map(|at| chances[at]).sum::<f64>().min(1.0)
}

impl McNemar {
    /// How many seeds both cells have.
    pub fn pairs(&self) -> usize {
        self.both + self.only_first + self.only_second + self.neither
    }
}

/// How much more often it happens in the first cell than in the second, over paired runs. The
/// interval is method 10 of Newcombe (*Improved Confidence Intervals for the Difference Between
/// Binomial Proportions Based on Paired Data*, 1998): from the two Wilson intervals and how the
/// cells go together. A bootstrap would be certain that two cells are alike where neither ever
/// fails; this is not. Of pairs in blocks it is that of as many pairs as they are worth, as with
/// [`wilson_in_blocks`].
///
/// ```
/// use farside_experiments::stats::rates::{mcnemar, paired_rate_difference};
/// let difference = paired_rate_difference(&mcnemar(&[(true, true); 30]));
/// assert_eq!(difference.value, 0.0);
/// assert!((difference.high - 0.1135).abs() < 1e-4);
/// ```
pub fn paired_rate_difference(test: &McNemar) -> Estimate {
    let n = test.pairs();
    if n == 0 {
        return Estimate {
            value: f64::NAN,
            low: -1.0,
            high: 1.0,
        };
    }
    let worth = |count: usize| test.worth * count as f64;
    let first = wilson_of(worth(test.both + test.only_first), worth(n));
    let second = wilson_of(worth(test.both + test.only_second), worth(n));
    let correlation = correlation(test);
    let reach = |a: f64, b: f64| libm::sqrt((a * a - 2.0 * correlation * a * b + b * b).max(0.0));
    let value = (test.only_first as f64 - test.only_second as f64) / n as f64;
    let down = reach(first.value - first.low, second.high - second.value);
    let up = reach(first.high - first.value, second.value - second.low);
    Estimate {
        value,
        low: (value - down).max(-1.0),
        high: (value + up).min(1.0),
    }
}

/// Newcombe's phi, corrected towards 0; 0 where one cell never varies.
fn correlation(test: &McNemar) -> f64 {
    let [a, b, c, d] = [test.both, test.only_first, test.only_second, test.neither]
        .map(|count| test.worth * count as f64);
    let margins = (a + b) * (c + d) * (a + c) * (b + d);
    if margins == 0.0 {
        return 0.0;
    }
    let together = a * d - b * c;
    let corrected = if together > 0.0 {
        (together - (a + b + c + d) / 2.0).max(0.0)
    } else {
        together
    };
    corrected / libm::sqrt(margins)
}

/// Twice the probability of at most `k` heads in `n` throws of a coin, but at most 1.
fn sign_test(k: usize, n: usize) -> f64 {
    if 2 * k >= n {
        return 1.0;
    }
    let n_f = n as f64;
    // Halving is exact down to the least normal number, logarithms are not: they start only where
    // a thousand throws are reached.
    if n < 1000 {
        let mut term = (0..n).fold(1.0, |term, _| term / 2.0);
        let mut sum = term;
        for heads in 1..=k {
            term *= (n - heads + 1) as f64 / heads as f64;
            sum += term;
        }
        return (2.0 * sum).min(1.0);
    }
    let log_choose = |heads: f64| {
        libm::lgamma(n_f + 1.0) - libm::lgamma(heads + 1.0) - libm::lgamma(n_f - heads + 1.0)
    };
    let probability =
        |heads: usize| libm::exp(log_choose(heads as f64) - n_f * std::f64::consts::LN_2);
    (2.0 * (0..=k).map(probability).sum::<f64>()).min(1.0)
}
