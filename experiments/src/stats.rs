//! Statistics of studies: what a few dozen runs say about a team, and how sure one may be of it.
//!
//! Intervals are at 95 %. Everything here is a pure function: bootstraps draw from streams that
//! [`farside::random::RandomKey`] addresses, so that the same values under the same key give the
//! same interval, whatever their order and whichever cell was summed up before. Values that are no
//! finite numbers are left out; what cannot be known is an interval without ends, see
//! [`Estimate::unknown`].
//!
//! | to learn | read |
//! |---|---|
//! | how wide a mean's interval is, and a difference's | [`bootstrap`] |
//! | what runs that share a problem are worth | [`Blocks`] |
//! | whether paired runs differ, and many such questions at once | [`paired`] |
//! | what "no collision in 300 runs" is worth | [`rates`] |
//! | when rovers arrive, if some never do | [`survival`] |
//! | quantiles and their definition | [`distribution`] |
//! | whether figures grow linearly | [`mod@line`] |

mod blocks;
pub mod bootstrap;
pub mod distribution;
pub mod line;
mod normal;
pub mod paired;
pub mod rates;
pub mod survival;

pub use blocks::Blocks;

#[cfg(test)]
mod tests;

/// The quantile of the standard normal distribution that leaves 2.5 % above: intervals here reach
/// from minus to plus this many standard errors, where they are built from standard errors.
pub const Z_95: f64 = 1.959_963_984_540_054;

/// A figure that was estimated from some runs, and the interval that should hold the true one:
/// of many such intervals 95 in 100 do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The figure; not a number if there was nothing to estimate it from.
    pub value: f64,
    /// The lower end, never above `value`.
    pub low: f64,
    /// The upper end, never below `value`.
    pub high: f64,
}

impl Estimate {
    /// A figure of which no interval can be given: it has no ends.
    ///
    /// ```
    /// use farside_experiments::stats::Estimate;
    /// assert!(Estimate::unknown(3.0).width().is_infinite());
    /// ```
    pub fn unknown(value: f64) -> Self {
        Estimate {
            value,
            low: f64::NEG_INFINITY,
            high: f64::INFINITY,
        }
    }

    /// The distance between the ends: infinite if unknown.
    pub fn width(&self) -> f64 {
        self.high - self.low
    }

    /// Whether the interval has ends.
    pub fn is_known(&self) -> bool {
        self.value.is_finite() && self.low.is_finite() && self.high.is_finite()
    }
}

/// The finite ones of `values`, least first.
fn finite_sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted: Vec<f64> = values
        .iter()
        .copied()
        .filter(|value| value.is_finite())
        .collect();
    sorted.sort_by(f64::total_cmp);
    sorted
}
