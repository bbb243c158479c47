//! How much of a mineral is in a rock, from its spectrum.
//!
//! A gauge is fitted once to a library of samples whose fractions are known: a polynomial of the second
//! degree in the spectral features, by ridge regression. What it does not explain of the library is
//! its error, to which the noise of a reading is added.

use crate::analysis::features::{FeatureError, SpectralBasis};
use crate::analysis::reading::SPECTRAL;
use crate::analysis::rocks::Rocks;

/// How many terms the polynomial has: 1, the features, and their products.
const TERMS: usize = 1 + SPECTRAL + SPECTRAL * (SPECTRAL + 1) / 2;

/// What is added to the diagonal of the normal equations, as a share of the number of samples.
const RIDGE: f64 = 1.0e-6;

/// Why a gauge cannot be fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GaugeError {
    /// A spectrum has no features.
    #[error("sample {sample}: {error}")]
    Spectrum {
        /// Its place in the library, from 0.
        sample: usize,
        /// What is wrong with it.
        error: FeatureError,
    },
    /// A fraction is none.
    #[error("sample {sample} has the fraction {actual}, must be within 0 and 1")]
    Fraction {
        /// Its place in the library, from 0.
        sample: usize,
        /// What it is.
        actual: f64,
    },
    /// There are not as many fractions as spectra, or too few of both.
    #[error("{spectra} spectra and {fractions} fractions, must be equal and at least {expected}")]
    Samples {
        /// How many are needed.
        expected: usize,
        /// How many spectra there are.
        spectra: usize,
        /// How many fractions there are.
        fractions: usize,
    },
}

/// A fraction of a mineral, estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The estimate, 0 to 1.
    pub fraction: f64,
    /// Its standard deviation.
    pub sd: f64,
}

/// Estimates the fraction of one mineral from spectral features.
///
/// ```
/// use farside_misus::analysis::features::SpectralBasis;
/// use farside_misus::analysis::objective::MineralGauge;
/// let wavelengths_nm: Vec<f64> = (0..50).map(|i| 450.0 + 40.0 * f64::from(i)).collect();
/// let band = |x: f64, at: f64| (-((x - at) / 120.0) * ((x - at) / 120.0)).exp();
/// let spectrum = |share: f64| -> Vec<f64> {
///     let absorbed = |x| share * band(x, 1000.0) + (1.0 - share) * band(x, 2000.0);
///     wavelengths_nm.iter().map(|&x| 0.4 * (1.0 - 0.5 * absorbed(x))).collect()
/// };
/// let fractions: Vec<f64> = (0..40).map(|i| f64::from(i) / 39.0).collect();
/// let library: Vec<Vec<f64>> = fractions.iter().map(|&share| spectrum(share)).collect();
/// let basis = SpectralBasis::new(&wavelengths_nm, &library)?;
/// let gauge = MineralGauge::new(&basis, &library, &fractions)?;
/// let features = basis.features(&spectrum(0.3), 0.0)?;
/// let estimate = gauge.estimate(&features.features.map(f64::from), 0.0);
/// assert!((estimate.fraction - 0.3).abs() < 0.05);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MineralGauge {
    coefficients: [f64; TERMS],
    error_sd: f64,
    /// Mean and standard deviation of the fraction in the library: what to expect unseen.
    prior: Estimate,
}

impl MineralGauge {
    /// Fits a gauge to the spectra of a library and the fraction of the mineral in each.
    ///
    /// # Errors
    /// When there are too few samples, or one has no features or no fraction.
    pub fn new<S: AsRef<[f64]>>(
        basis: &SpectralBasis,
        library: &[S],
        fractions: &[f64],
    ) -> Result<MineralGauge, GaugeError> {
        if library.len() != fractions.len() || library.len() <= TERMS {
            return Err(GaugeError::Samples {
                expected: TERMS + 1,
                spectra: library.len(),
                fractions: fractions.len(),
            });
        }
        let mut rows = Vec::with_capacity(library.len());
        for (sample, (spectrum, &actual)) in library.iter().zip(fractions).enumerate() {
            if !(0.0..=1.0).contains(&actual) {
                return Err(GaugeError::Fraction { sample, actual });
            }
            let spectral = basis
                .features(spectrum.as_ref(), 0.0)
                .map_err(|error| GaugeError::Spectrum { sample, error })?;
            rows.push(terms(&spectral.features.map(f64::from)));
        }
        let count = rows.len() as f64;
        let coefficients = ridge(&rows, fractions);
        let errors = rows.iter().zip(fractions).map(|(row, fraction)| {
            let error = dot(row, &coefficients) - fraction;
            error * error
        });
        let error_sd = (errors.sum::<f64>() / (count - TERMS as f64)).sqrt();
        let mean = fractions.iter().sum::<f64>() / count;
        let squares = fractions.iter().map(|f| (f - mean) * (f - mean));
        Ok(MineralGauge {
            coefficients,
            error_sd,
            prior: Estimate {
                fraction: mean,
                sd: (squares.sum::<f64>() / count).sqrt(),
            },
        })
    }

    /// The fraction in a rock with these features, whose noise has this standard deviation.
    pub fn estimate(&self, features: &[f64; SPECTRAL], noise_sd: f64) -> Estimate {
        let fraction = dot(&terms(features), &self.coefficients);
        let mut variance = self.error_sd * self.error_sd;
        for column in 0..SPECTRAL {
            // The slope in one feature, as a difference over a small step.
            let mut moved = *features;
            moved[column] += 1.0e-4;
            let slope = (dot(&terms(&moved), &self.coefficients) - fraction) / 1.0e-4;
            variance += slope * slope * noise_sd * noise_sd;
        }
        Estimate {
            fraction: fraction.clamp(0.0, 1.0),
            sd: variance.sqrt(),
        }
    }

    /// What to expect of a rock that nobody has read.
    pub fn prior(&self) -> Estimate {
        self.prior
    }

    /// The estimate of each rock by its spectrum; `None` where there is none.
    pub fn estimates(&self, rocks: &Rocks) -> Vec<Option<Estimate>> {
        let estimate = |index| {
            rocks.has_spectrum(index).then(|| {
                let mut features = [0.0; SPECTRAL];
                features.copy_from_slice(&rocks.table().row(index)[..SPECTRAL]);
                self.estimate(&features, rocks.table().noise(index)[0].sqrt())
            })
        };
        (0..rocks.len()).map(estimate).collect()
    }

    /// The place among the rocks of the one that is thought to be the richest, as far as spectra say:
    /// an estimate counts by its precision, the rest is what the library leads to expect. `None` if
    /// no rock has a spectrum.
    pub fn richest(&self, rocks: &Rocks) -> Option<usize> {
        let estimates = self.estimates(rocks);
        let believed = estimates
            .iter()
            .enumerate()
            .filter_map(|(index, estimate)| {
                estimate.map(|estimate| (self.believed(estimate).fraction, index))
            });
        let richest = believed.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        richest.map(|(_, index)| index)
    }

    /// An estimate together with what the library leads to expect.
    pub fn believed(&self, estimate: Estimate) -> Estimate {
        let (prior, sd) = (self.prior, self.prior.sd.max(1.0e-6));
        let trust = sd * sd / (sd * sd + estimate.sd * estimate.sd);
        Estimate {
            fraction: prior.fraction + trust * (estimate.fraction - prior.fraction),
            sd: sd * (1.0 - trust).sqrt(),
        }
    }
}

/// By how much the true fraction of the rock named falls short of the best of all; `None` named counts
/// as a rock without the mineral. For metrics.
///
/// ```
/// use farside_misus::analysis::objective::regret;
/// assert_eq!(regret(&[0.1, 0.5, 0.25], Some(2)), 0.25);
/// assert_eq!(regret(&[0.1, 0.5, 0.25], None), 0.5);
/// ```
///
/// # Panics
/// When there is no such rock.
pub fn regret(true_fractions: &[f64], named: Option<usize>) -> f64 {
    let best = true_fractions.iter().copied().fold(0.0, f64::max);
    best - named.map_or(0.0, |rock| true_fractions[rock])
}

fn terms(x: &[f64; SPECTRAL]) -> [f64; TERMS] {
    let mut terms = [1.0; TERMS];
    terms[1..=SPECTRAL].copy_from_slice(x);
    let mut at = SPECTRAL + 1;
    for i in 0..SPECTRAL {
        for j in 0..=i {
            terms[at] = x[i] * x[j];
            at += 1;
        }
    }
    terms
}

fn dot(a: &[f64; TERMS], b: &[f64; TERMS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The coefficients with the least sum of squares, by Cholesky's decomposition.
fn ridge(rows: &[[f64; TERMS]], values: &[f64]) -> [f64; TERMS] {
    let mut normal = [[0.0; TERMS]; TERMS];
    let mut right = [0.0; TERMS];
    for (row, value) in rows.iter().zip(values) {
        for i in 0..TERMS {
            right[i] += row[i] * value;
            for j in 0..=i {
                normal[i][j] += row[i] * row[j];
            }
        }
    }
    for (i, row) in normal.iter_mut().enumerate() {
        row[i] += RIDGE * rows.len() as f64;
    }
    for i in 0..TERMS {
        for j in 0..=i {
            let before: f64 = (0..j).map(|k| normal[i][k] * normal[j][k]).sum();
            let rest = normal[i][j] - before;
            normal[i][j] = if i == j {
                rest.sqrt()
            } else {
                rest / normal[j][j]
            };
        }
    }
    for i in 0..TERMS {
        let before: f64 = (0..i).map(|k| normal[i][k] * right[k]).sum();
        right[i] = (right[i] - before) / normal[i][i];
    }
    for i in (0..TERMS).rev() {
        let after: f64 = (i + 1..TERMS).map(|k| normal[k][i] * right[k]).sum();
        right[i] = (right[i] - after) / normal[i][i];
    }
    right
}
