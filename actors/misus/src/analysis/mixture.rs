//! Classes of rock as a mixture of Gaussians with diagonal covariances, learnt by expectation
//! maximisation.
//!
//! # The model
//!
//! A rock `i` has features `x_id`, each measured with a known noise variance `s_id`; a missing one
//! has infinite noise and drops out. It belongs to class `k` with probability `w_k`, and then feature `d`
//! is normal with mean `m_kd` and variance `v_kd + s_id`. The position's density counts with an
//! exponent, the *position weight* `λ`: scaling a column does nothing to a model whose variances are
//! free, the exponent says how much a place tells of a class. So the log-likelihood is
//!
//! ```text
//! L = Σ_i log Σ_k w_k Π_d N(x_id; m_kd, v_kd + s_id)^(λ_d)        λ_d = λ for positions, else 1
//! ```
//!
//! # The objective
//!
//! What is maximised at a given number of classes is the *penalised log-likelihood*
//!
//! ```text
//! F = L - ν Σ_kd λ_d KL(N(0, t_d) || N(0, v_kd)) + α Σ_k log w_k
//! ```
//!
//! with `KL = (t/v - 1 - log(t/v)) / 2`. The second term shrinks every class's variance towards the
//! *tied* one `t_d`, as though each class had `ν` more rocks of that spread: with few rocks in a class
//! it is nearly tied, with many it is its own. `t_d` is a parameter too, maximised like the others:
//! the harmonic mean of the `v_kd`. The third term (Dirichlet, `α + 1`) keeps classes from being
//! empty. Variances have floors, a share of the column's own variance, so singular data have finite
//! densities. `F` never falls within a run of expectation maximisation. It is the metric
//! `log_likelihood` that is reported without the penalties, so that models compare.
//!
//! Noise enters as in J. Bovy, D. Hogg and S. Roweis, "Extreme deconvolution", Annals of Applied
//! Statistics 5 (2011), for diagonal covariances.
//!
//! # The number of classes
//!
//! The number with the least Bayesian information criterion `-2 L + p log n` is taken, `n` rocks and `p`
//! effective parameters: variances count as far as they are free of the tied ones
//! ([`Mixture::parameters`]).

mod em;
mod select;
mod starts;
#[cfg(test)]
mod tests;

pub use select::{Candidate, Fit, fit};

/// `log(2 π)`.
const LOG_2PI: f64 = 1.837_877_066_409_345_5;

/// Numbers of rows and columns, row by row, with the noise of each.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    columns: usize,
    position_columns: usize,
    values: Vec<f64>,
    noise: Vec<f64>,
}

impl Table {
    /// An empty table. The last `position_columns` of its columns are a position.
    ///
    /// # Panics
    /// When it has no columns, or fewer than position columns.
    pub fn new(columns: usize, position_columns: usize) -> Table {
        assert!(columns > 0 && position_columns <= columns, "columns");
        Table {
            columns,
            position_columns,
            values: Vec::new(),
            noise: Vec::new(),
        }
    }

    /// Adds a row: values, and the variance of the noise of each; infinite where a value is missing.
    ///
    /// # Panics
    /// When lengths are wrong, a value that is not missing is not finite, or a variance is below 0.
    pub fn push(&mut self, values: &[f64], noise: &[f64]) {
        assert!(
            values.len() == self.columns && noise.len() == self.columns,
            "columns"
        );
        for (&value, &noise) in values.iter().zip(noise) {
            assert!(
                noise >= 0.0 && (noise.is_infinite() || value.is_finite()),
                "finite values"
            );
            // A missing value is multiplied by zero, so it must be a number.
            self.values
                .push(if noise.is_finite() { value } else { 0.0 });
            self.noise.push(noise);
        }
    }

    /// How many rows there are.
    pub fn len(&self) -> usize {
        self.values.len() / self.columns
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// How many columns there are.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Where the position begins among the columns.
    pub fn position_at(&self) -> usize {
        self.columns - self.position_columns
    }

    /// The values of a row; 0 where one is missing.
    pub fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.columns..(row + 1) * self.columns]
    }

    /// The variances of the noise of a row; infinite where a value is missing.
    pub fn noise(&self, row: usize) -> &[f64] {
        &self.noise[row * self.columns..(row + 1) * self.columns]
    }

    /// Mean and variance of a column over the rows that have it; `None` if none has.
    pub fn moments(&self, column: usize) -> Option<(f64, f64)> {
        let present = || {
            (0..self.len())
                .filter(|&row| self.noise(row)[column].is_finite())
                .map(|row| self.row(row)[column])
        };
        let count = present().count() as f64;
        if count == 0.0 {
            return None;
        }
        let mean = present().sum::<f64>() / count;
        let variance = present().map(|x| (x - mean) * (x - mean)).sum::<f64>() / count;
        Some((mean, variance))
    }
}

/// How a mixture is learnt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitSettings {
    /// The exponent of a position's density, 0 to 1.
    pub position_weight: f64,
    /// How many rocks of the tied variance each class has besides its own, over 0.
    pub shrinkage: f64,
    /// How many rocks each class weighs besides its own, 0 or more.
    pub weight_prior: f64,
    /// The least standard deviation of a class, as a share of the column's over all rocks; over 0.
    pub least_spread: f64,
    /// The fewest classes, at least 1.
    pub min_classes: usize,
    /// The most classes.
    pub max_classes: usize,
    /// From how many starting points each number of classes is tried, at least 1.
    pub starts: usize,
    /// The most steps of a run.
    pub max_steps: usize,
    /// A run ends when a step adds less than this to the objective for each rock.
    pub tolerance: f64,
}

impl Default for FitSettings {
    fn default() -> FitSettings {
        FitSettings {
            position_weight: 0.5,
            shrinkage: 10.0,
            weight_prior: 0.5,
            least_spread: 0.2,
            min_classes: 1,
            max_classes: 10,
            starts: 10,
            max_steps: 300,
            tolerance: 1.0e-8,
        }
    }
}

/// Why a mixture cannot be learnt.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MixtureError {
    /// There is nothing to learn from.
    #[error("there are no rocks to learn from")]
    NoRocks,
    /// A setting is out of its range.
    #[error("{setting} must be {expected}; it is {actual}")]
    Setting {
        /// Its name.
        setting: &'static str,
        /// Its range.
        expected: &'static str,
        /// Its value.
        actual: f64,
    },
    /// The table has other columns than the model.
    #[error("the table has {actual} columns, must have {expected} as the mixture")]
    Columns {
        /// The mixture's.
        expected: usize,
        /// The table's.
        actual: usize,
    },
}

/// Classes: their shares, means and variances.
#[derive(Clone, Debug, PartialEq)]
pub struct Mixture {
    pub(in crate::analysis) columns: usize,
    pub(in crate::analysis) position_at: usize,
    pub(in crate::analysis) position_weight: f64,
    pub(in crate::analysis) shrinkage: f64,
    pub(in crate::analysis) weights: Vec<f64>,
    pub(in crate::analysis) means: Vec<f64>,
    pub(in crate::analysis) variances: Vec<f64>,
    pub(in crate::analysis) tied: Vec<f64>,
}

impl Mixture {
    /// How many classes there are.
    pub fn classes(&self) -> usize {
        self.weights.len()
    }

    /// The share of each class; they sum to 1.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The mean of each column in a class.
    pub fn mean(&self, class: usize) -> &[f64] {
        &self.means[class * self.columns..(class + 1) * self.columns]
    }

    /// The variance of each column in a class.
    pub fn variance(&self, class: usize) -> &[f64] {
        &self.variances[class * self.columns..(class + 1) * self.columns]
    }

    /// The exponent of a position's density.
    pub fn position_weight(&self) -> f64 {
        self.position_weight
    }

    /// How many parameters count: shares, means, tied variances, and the classes' own variances as
    /// far as `rocks` rocks free them from the tied ones. A position's count by its weight.
    pub fn parameters(&self, rocks: usize) -> f64 {
        let classes = self.classes() as f64;
        let features = self.position_at as f64;
        let position = (self.columns - self.position_at) as f64;
        let columns = features + self.position_weight * position;
        let rocks_of_class = rocks as f64 / classes;
        let free = rocks_of_class / (rocks_of_class + self.shrinkage);
        (classes - 1.0) + columns * (classes + 1.0 + (classes - 1.0) * free)
    }

    /// `log w_k + Σ_d λ_d log N(x_d)` of one row for each class into `out`.
    fn joint(&self, values: &[f64], noise: &[f64], out: &mut [f64]) {
        for (class, out) in out.iter_mut().enumerate() {
            let at = class * self.columns;
            let means = &self.means[at..at + self.columns];
            let variances = &self.variances[at..at + self.columns];
            let (features, position) = (0..self.position_at, self.position_at..self.columns);
            let mut density = libm::log(self.weights[class]);
            density += log_density(values, noise, means, variances, features);
            if self.position_weight > 0.0 && !position.is_empty() {
                let log = log_density(values, noise, means, variances, position);
                density += self.position_weight * log;
            }
            *out = density;
        }
    }

    fn same_columns(&self, table: &Table) -> Result<(), MixtureError> {
        match table.columns() == self.columns {
            true => Ok(()),
            false => Err(MixtureError::Columns {
                expected: self.columns,
                actual: table.columns(),
            }),
        }
    }

    /// The log-likelihood `L` of all rows.
    ///
    /// # Errors
    /// When the table has other columns.
    pub fn log_likelihood(&self, table: &Table) -> Result<f64, MixtureError> {
        self.same_columns(table)?;
        let mut joint = vec![0.0; self.classes()];
        let mut sum = 0.0;
        for row in 0..table.len() {
            self.joint(table.row(row), table.noise(row), &mut joint);
            sum += normalise(&mut joint);
        }
        Ok(sum)
    }

    /// The probability of each class for each row, row by row; each row's sum to 1.
    ///
    /// # Errors
    /// When the table has other columns.
    pub fn responsibilities(&self, table: &Table) -> Result<Vec<f64>, MixtureError> {
        self.same_columns(table)?;
        let mut all = vec![0.0; self.classes() * table.len()];
        for (row, out) in all.chunks_exact_mut(self.classes()).enumerate() {
            self.joint(table.row(row), table.noise(row), out);
            normalise(out);
        }
        Ok(all)
    }
}

/// The log-density of the columns of a range that are there.
#[inline]
fn log_density(
    values: &[f64],
    noise: &[f64],
    means: &[f64],
    variances: &[f64],
    range: std::ops::Range<usize>,
) -> f64 {
    let (mut distance, mut log) = (0.0, 0.0);
    let (mut product, mut count) = (1.0, 0u32);
    for d in range {
        if noise[d] == f64::INFINITY {
            continue;
        }
        let variance = variances[d] + noise[d];
        let difference = values[d] - means[d];
        distance += difference * difference / variance;
        // One logarithm for several variances, as many as cannot leave the range of numbers.
        product *= variance;
        count += 1;
        if !(1.0e-150..1.0e150).contains(&product) {
            log += libm::log(product);
            product = 1.0;
        }
    }
    -0.5 * (f64::from(count) * LOG_2PI + log + libm::log(product) + distance)
}

/// Turns logarithms into probabilities that sum to 1, and returns the logarithm of their sum.
#[inline]
fn normalise(joint: &mut [f64]) -> f64 {
    let largest = joint.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut sum = 0.0;
    for value in joint.iter_mut() {
        *value = libm::exp(*value - largest);
        sum += *value;
    }
    for value in joint.iter_mut() {
        *value /= sum;
    }
    largest + libm::log(sum)
}
