//! Rates: how often something happened, and whether it happened more often there than here.

use super::{Estimate, Z_95};

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
    let happened = happened.min(n);
    let (k, n_f) = (happened as f64, n as f64);
    let rate = k / n_f;
    let z2 = Z_95 * Z_95;
    let centre = (k + z2 / 2.0) / (n_f + z2);
    let half = Z_95 / (n_f + z2) * libm::sqrt(k * (n_f - k) / n_f + z2 / 4.0);
    Estimate {
        value: rate,
        // At the ends the formula gives the rate itself, but for rounding.
        low: if happened == 0 { 0.0 } else { centre - half },
        high: if happened == n { 1.0 } else { centre + half },
    }
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
    /// of the seeds that tell them apart, each speaks for either with probability 1/2.
    pub p: f64,
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
    }
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
/// fails; this is not.
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
    let first = wilson(test.both + test.only_first, n);
    let second = wilson(test.both + test.only_second, n);
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
    let [a, b, c, d] =
        [test.both, test.only_first, test.only_second, test.neither].map(|count| count as f64);
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
