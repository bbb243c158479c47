//! Tests of whether paired differences are none, and what becomes of many such tests at once.

use super::Blocks;

/// How often chance alone would bring the mean of the blocks' means as far from `expected`:
/// Student's test (*The Probable Error of a Mean*, 1908), two-sided, with a block as what varies.
/// Of blocks of one run each that is the paired t-test. Not a number with fewer than two blocks;
/// where all blocks say the same it is 1 or 0.
///
/// ```
/// use farside_experiments::stats::{Blocks, paired::student};
/// let differences = Blocks::from(&[1.1, 0.9, 1.3, 0.7]);
/// assert!(student(&differences, 0.0) < 0.01 && student(&differences, 1.0) > 0.99);
/// assert!(student(&Blocks::from(&[1.0]), 0.0).is_nan());
/// ```
pub fn student(differences: &Blocks, expected: f64) -> f64 {
    let means = differences.means();
    let n = means.len() as f64;
    if means.len() < 2 {
        return f64::NAN;
    }
    let mean = means.iter().sum::<f64>() / n;
    let squares: f64 = means.iter().map(|one| (one - mean) * (one - mean)).sum();
    let away = mean - expected;
    let error = libm::sqrt(squares / (n - 1.0) / n);
    // Equal values have a mean that may be off by a rounding.
    let rounding = 1e-12
        * means
            .iter()
            .map(|one| one.abs())
            .fold(expected.abs(), f64::max);
    if error <= rounding {
        return if away.abs() <= rounding { 1.0 } else { 0.0 };
    }
    two_sided(away / error, n - 1.0)
}

/// The share of Student's distribution with so many degrees of freedom beyond `t` on both sides.
fn two_sided(t: f64, freedom: f64) -> f64 {
    let x = freedom / (freedom + t * t);
    incomplete_beta(x, 0.5 * freedom, 0.5)
}

/// The regularised incomplete beta function I_x(a, b), by Lentz's continued fraction (Press and
/// others, *Numerical Recipes*, section 6.4).
fn incomplete_beta(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    let log_front = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b)
        + a * libm::log(x)
        + b * libm::log1p(-x);
    let front = libm::exp(log_front);
    // The fraction converges fast on this side of the mean only.
    if x < (a + 1.0) / (a + b + 2.0) {
        front * beta_fraction(x, a, b) / a
    } else {
        1.0 - front * beta_fraction(1.0 - x, b, a) / b
    }
}

fn beta_fraction(x: f64, a: f64, b: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let apart = |value: f64| if value.abs() < TINY { TINY } else { value };
    let mut c = 1.0;
    let mut d = 1.0 / apart(1.0 - (a + b) * x / (a + 1.0));
    let mut fraction = d;
    // With a million degrees of freedom some thousand steps are needed.
    for step in 1..100_000 {
        let m = f64::from(step);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut change = 1.0;
        for term in [even, odd] {
            d = 1.0 / apart(1.0 + term * d);
            c = apart(1.0 + term / c);
            change = c * d;
            fraction *= change;
        }
        if (change - 1.0).abs() < 1e-15 {
            break;
        }
    }
    fraction
}

/// What each p is worth when all are looked at together (Holm, *A Simple Sequentially Rejective
/// Multiple Test Procedure*, 1979): of a family in which nothing differs, any of these is at most
/// 0.05 in one family of twenty, however the tests hang together. One that is not a number is left
/// out of the family, and stays so.
///
/// ```
/// use farside_experiments::stats::paired::holm;
/// assert_eq!(holm(&[0.01, 0.5, 0.02]), [0.03, 0.5, 0.04]);
/// ```
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).filter(|at| !p[*at].is_nan()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    let mut adjusted = vec![f64::NAN; p.len()];
    let mut least = 0.0f64;
    for (rank, at) in order.iter().enumerate() {
        let left = (order.len() - rank) as f64;
        least = least.max((left * p[*at]).min(1.0));
        adjusted[*at] = least;
    }
    adjusted
}
