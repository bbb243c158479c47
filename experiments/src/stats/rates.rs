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
