//! From a spectrum to a few numbers in which rocks of one class lie together.
//!
//! 1. Smooth over neighbouring bands: noise has no width, absorption bands have.
//! 2. Divide by the continuum, the upper convex hull over wavelength, and take `1 - c`: how much is
//!    absorbed where. Brightness and slope, which dust and light make, are gone.
//! 3. Normalise to unit length: grain size makes all bands deeper or shallower together.
//! 4. Project on the first principal components of a *library* of spectra. The library is the
//!    same for all rovers and never holds what they measure, so equal spectra have equal features
//!    on all rovers and at all times.

mod principal;

use super::reading::{SPECTRAL, Spectral};

/// Weights of neighbouring bands in smoothing, from the middle outwards; they sum to 1 with both
/// sides counted (a Gaussian of a standard deviation of 1.5 bands).
const SMOOTHING: [f64; 4] = [0.267_9, 0.214_5, 0.110_1, 0.041_45];

/// The least length of `1 - c` that is normalised: a spectrum without absorption has no direction.
const LEAST_ABSORPTION: f64 = 1.0e-6;

/// Why there is no basis, or no features.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FeatureError {
    /// Wavelengths are no grid.
    #[error("wavelength {index} is {actual} nm, must be finite and over {before} nm")]
    Wavelength {
        /// Its place, from 0.
        index: usize,
        /// The one before it, or 0 \[nm\].
        before: f64,
        /// What it is \[nm\].
        actual: f64,
    },
    /// Too few bands or spectra for as many components.
    #[error("the library has {actual} {what}, must have at least {expected}")]
    TooFew {
        /// `bands` or `spectra`.
        what: &'static str,
        /// How many are needed.
        expected: usize,
        /// How many there are.
        actual: usize,
    },
    /// A spectrum has another number of bands than the instrument.
    #[error("the spectrum has {actual} bands, must have {expected}")]
    Bands {
        /// The number of wavelengths.
        expected: usize,
        /// The number of reflectances.
        actual: usize,
    },
    /// A reflectance is none.
    #[error("the reflectance at {wavelength_nm} nm is {actual}, must be finite")]
    Reflectance {
        /// Where \[nm\].
        wavelength_nm: f64,
        /// What it is.
        actual: f64,
    },
    /// All values of a spectrum are 0 or below: nothing was reflected.
    #[error("the spectrum has no reflectance over 0")]
    Dark,
}

/// The library's principal components on an instrument's wavelengths.
///
/// ```
/// use farside_misus::analysis::features::SpectralBasis;
/// let wavelengths_nm: Vec<f64> = (0..50).map(|i| 450.0 + 40.0 * f64::from(i)).collect();
/// // Rocks that absorb round 1000 and 2000 nm, in different shares.
/// let spectrum = |a: f64, b: f64| -> Vec<f64> {
///     let band = |x: f64, at: f64| (-((x - at) / 120.0) * ((x - at) / 120.0)).exp();
///     wavelengths_nm.iter().map(|&x| 0.4 * (1.0 - a * band(x, 1000.0) - b * band(x, 2000.0))).collect()
/// };
/// let library: Vec<Vec<f64>> = (0..9).map(|i| spectrum(0.05 * f64::from(i), 0.4)).collect();
/// let basis = SpectralBasis::new(&wavelengths_nm, &library)?;
/// let coarse = basis.features(&spectrum(0.1, 0.3), 0.001)?;
/// let fine = basis.features(&spectrum(0.05, 0.15), 0.001)?;
/// let other = basis.features(&spectrum(0.3, 0.1), 0.001)?;
/// let apart = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>();
/// assert!(apart(&coarse.features, &fine.features) < 0.1);
/// assert!(apart(&coarse.features, &other.features) > 0.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralBasis {
    wavelengths_nm: Vec<f64>,
    /// The mean of the library's absorptions, a value for each band.
    mean: Vec<f64>,
    /// The components, one after the other.
    components: Vec<f64>,
}

impl SpectralBasis {
    /// The basis of a library: reflectances of each spectrum, one for each wavelength \[nm\].
    ///
    /// # Errors
    /// When wavelengths do not ascend, a spectrum has another length or values that are not finite,
    /// or there are fewer spectra or bands than [`SPECTRAL`] and one more.
    pub fn new<S: AsRef<[f64]>>(
        wavelengths_nm: &[f64],
        library: &[S],
    ) -> Result<SpectralBasis, FeatureError> {
        let mut before = 0.0;
        for (index, &actual) in wavelengths_nm.iter().enumerate() {
            if !(actual.is_finite() && actual > before) {
                return Err(FeatureError::Wavelength {
                    index,
                    before,
                    actual,
                });
            }
            before = actual;
        }
        for (what, actual) in [("bands", wavelengths_nm.len()), ("spectra", library.len())] {
            if actual < SPECTRAL + 1 {
                return Err(FeatureError::TooFew {
                    what,
                    expected: SPECTRAL + 1,
                    actual,
                });
            }
        }
        let bands = wavelengths_nm.len();
        let mut rows = Vec::with_capacity(library.len() * bands);
        for spectrum in library {
            rows.extend(absorption(wavelengths_nm, spectrum.as_ref())?.values);
        }
        let mut mean = vec![0.0; bands];
        for row in rows.chunks_exact(bands) {
            for (mean, value) in mean.iter_mut().zip(row) {
                *mean += value / library.len() as f64;
            }
        }
        let components = principal::components(&rows, &mean, SPECTRAL);
        Ok(SpectralBasis {
            wavelengths_nm: wavelengths_nm.to_vec(),
            mean,
            components,
        })
    }

    /// The instrument's wavelengths \[nm\].
    pub fn wavelengths_nm(&self) -> &[f64] {
        &self.wavelengths_nm
    }

    /// The features of a spectrum whose reflectances have this standard deviation of noise.
    ///
    /// # Errors
    /// When it has another number of bands, values that are not finite, or none over 0.
    pub fn features(&self, reflectance: &[f64], noise_sd: f64) -> Result<Spectral, FeatureError> {
        let absorption = absorption(&self.wavelengths_nm, reflectance)?;
        let mut features = [0.0; SPECTRAL];
        let components = self.components.chunks_exact(self.mean.len());
        for (feature, component) in features.iter_mut().zip(components) {
            let values = absorption.values.iter().zip(&self.mean).zip(component);
            *feature = values
                .map(|((value, mean), c)| (value - mean) * c)
                .sum::<f64>() as f32;
        }
        Ok(Spectral {
            features,
            noise_sd: (noise_sd * absorption.noise_gain) as f32,
        })
    }
}

/// What a spectrum absorbs, of unit length.
struct Absorption {
    values: Vec<f64>,
    /// By how much noise of reflectance is larger in a direction of these values.
    noise_gain: f64,
}

fn absorption(wavelengths_nm: &[f64], reflectance: &[f64]) -> Result<Absorption, FeatureError> {
    if reflectance.len() != wavelengths_nm.len() {
        return Err(FeatureError::Bands {
            expected: wavelengths_nm.len(),
            actual: reflectance.len(),
        });
    }
    let mut bands = wavelengths_nm.iter().zip(reflectance);
    if let Some((&wavelength_nm, &actual)) = bands.find(|(_, value)| !value.is_finite()) {
        return Err(FeatureError::Reflectance {
            wavelength_nm,
            actual,
        });
    }
    let smooth = smoothed(reflectance);
    let mut values = continuum(wavelengths_nm, &smooth);
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    if !(mean > 0.0 && values.iter().all(|&c| c > 0.0)) {
        return Err(FeatureError::Dark);
    }
    for (value, smooth) in values.iter_mut().zip(&smooth) {
        *value = 1.0 - smooth / *value;
    }
    let length = values.iter().map(|value| value * value).sum::<f64>().sqrt();
    let scale = 1.0 / length.max(LEAST_ABSORPTION);
    values.iter_mut().for_each(|value| *value *= scale);
    // Noise of single bands loses in smoothing; a component is smooth, so it sees what is left of
    // the noise at low frequencies, which is all of it.
    let noise_gain = scale / mean;
    Ok(Absorption { values, noise_gain })
}

/// A weighted mean of neighbouring bands; at the ends of those that there are.
fn smoothed(values: &[f64]) -> Vec<f64> {
    let reach = SMOOTHING.len() - 1;
    let smooth = |at: usize| {
        let range = at.saturating_sub(reach)..=(at + reach).min(values.len() - 1);
        let (mut sum, mut weight) = (0.0, 0.0);
        for i in range {
            let w = SMOOTHING[i.abs_diff(at)];
            sum += w * values[i];
            weight += w;
        }
        sum / weight
    };
    (0..values.len()).map(smooth).collect()
}

/// The upper convex hull of the points, at each of their abscissae.
fn continuum(x: &[f64], y: &[f64]) -> Vec<f64> {
    let mut hull: Vec<usize> = Vec::with_capacity(x.len());
    for i in 0..x.len() {
        while let [.., a, b] = hull[..] {
            let below = (y[b] - y[a]) * (x[i] - x[a]) <= (y[i] - y[a]) * (x[b] - x[a]);
            if !below {
                break;
            }
            hull.pop();
        }
        hull.push(i);
    }
    let mut out = vec![0.0; x.len()];
    for pair in hull.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let slope = (y[b] - y[a]) / (x[b] - x[a]);
        for i in a..=b {
            out[i] = y[a] + slope * (x[i] - x[a]);
        }
    }
    if let [only] = hull[..] {
        out[only] = y[only];
    }
    out
}
