//! Quantiles and the empirical distribution.

use super::finite_sorted;

/// The value below which a share `q` of the values lies, interpolated between neighbours as numpy
/// and R do unless told otherwise (definition 7 of Hyndman and Fan, *Sample Quantiles in
/// Statistical Packages*, 1996). `sorted` is least first; not a number if it is empty.
///
/// ```
/// use farside_experiments::stats::distribution::quantile;
/// assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.5), 2.0);
/// assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.75), 3.0);
/// assert!(quantile(&[], 0.5).is_nan());
/// ```
pub fn quantile(sorted: &[f64], q: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    let at = q.clamp(0.0, 1.0) * last as f64;
    let below = at.floor() as usize;
    let above = (below + 1).min(last);
    let (low, high) = (sorted[below], sorted[above]);
    // Equal neighbours need no arithmetic, which could leave the range by a rounding.
    if low == high {
        return low;
    }
    (low + (high - low) * (at - below as f64)).clamp(low, high)
}

/// The empirical distribution of some values: the share of them at or below each.
///
/// ```
/// use farside_experiments::stats::distribution::Ecdf;
/// let ages = Ecdf::new(&[2.0, 1.0, 1.0, 8.0]);
/// assert_eq!(ages.at(1.0), 0.5);
/// assert_eq!(ages.quantile(0.5), 1.5);
/// assert_eq!(ages.steps().next(), Some((1.0, 0.5)));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Ecdf {
    sorted: Vec<f64>,
}

impl Ecdf {
    /// Of the finite ones of `values`.
    pub fn new(values: &[f64]) -> Self {
        Ecdf {
            sorted: finite_sorted(values),
        }
    }

    /// How many values there are.
    pub fn len(&self) -> usize {
        self.sorted.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.sorted.is_empty()
    }

    /// The share of values at or below `x`; 0 if there are none.
    pub fn at(&self, x: f64) -> f64 {
        let below = self.sorted.partition_point(|value| *value <= x);
        below as f64 / self.len().max(1) as f64
    }

    /// See [`quantile`].
    pub fn quantile(&self, q: f64) -> f64 {
        quantile(&self.sorted, q)
    }

    /// Each different value, with the share of values at or below it.
    pub fn steps(&self) -> impl Iterator<Item = (f64, f64)> {
        let n = self.len();
        let last_of_its_kind =
            move |at: &usize| at + 1 == n || self.sorted[*at] != self.sorted[at + 1];
        let steps = (0..n).filter(last_of_its_kind);
        steps.map(move |at| (self.sorted[at], (at + 1) as f64 / n as f64))
    }
}
