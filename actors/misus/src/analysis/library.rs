//! What rovers bring along: spectra of minerals and mixtures whose fractions are known.
//!
//! The features of spectra and the gauges of minerals are made from it. It knows minerals and light,
//! and nothing of the field.

use farside::random::RandomKey;
use farside_worlds::spectra::{MINERALS, SpectralLibrary, SpectralModel};

use super::features::{FeatureError, SpectralBasis};
use super::objective::{GaugeError, MineralGauge};

/// Spectra and the fractions of minerals in each.
///
/// ```
/// use farside_misus::analysis::library::ReferenceLibrary;
/// use farside_worlds::spectra::wavelength_grid_nm;
/// let library = ReferenceLibrary::mixed(&wavelength_grid_nm(), 100);
/// let basis = library.basis()?;
/// let gauge = library.gauge(&basis, 0)?;
/// let (spectrum, fractions) = library.sample(3);
/// let features = basis.features(spectrum, 0.0)?.features.map(f64::from);
/// assert!((gauge.estimate(&features, 0.0).fraction - fractions[0]).abs() < 0.3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceLibrary {
    minerals: Vec<String>,
    wavelengths_nm: Vec<f64>,
    spectra: Vec<Vec<f64>>,
    fractions: Vec<Vec<f64>>,
}

impl ReferenceLibrary {
    /// Mixtures of the minerals that are built in, of many fractions, grain sizes and covers of dust,
    /// in these bands \[nm\]. The same on all rovers.
    pub fn mixed(wavelengths_nm: &[f64], samples: usize) -> ReferenceLibrary {
        let model = SpectralModel::new(wavelengths_nm);
        let mut stream = RandomKey::new(0).text("reference library").stream();
        let (mut spectra, mut all_fractions) = (Vec::new(), Vec::new());
        for _ in 0..samples {
            // Squares of exponentials: most mixtures have one or two minerals that dominate.
            let mut fractions = [(); MINERALS.len()].map(|()| {
                let share = stream.exponential(1.0);
                share * share
            });
            // Hematite tints much more than its volume, and no rock is made of it.
            fractions[MINERALS.len() - 1] *= 0.2;
            let total: f64 = fractions.iter().sum();
            fractions.iter_mut().for_each(|fraction| *fraction /= total);
            let grain_um = libm::exp(stream.uniform_in(libm::log(50.0), libm::log(500.0)));
            let mut spectrum = vec![0.0; wavelengths_nm.len()];
            model.reflectance_into(
                &fractions,
                grain_um,
                stream.uniform_in(0.0, 0.3),
                &mut spectrum,
            );
            spectra.push(spectrum);
            all_fractions.push(fractions.to_vec());
        }
        ReferenceLibrary {
            minerals: MINERALS.map(str::to_owned).to_vec(),
            wavelengths_nm: wavelengths_nm.to_vec(),
            spectra,
            fractions: all_fractions,
        }
    }

    /// The samples of a measured library.
    pub fn measured(library: &SpectralLibrary) -> ReferenceLibrary {
        ReferenceLibrary {
            minerals: library.minerals().to_vec(),
            wavelengths_nm: library.wavelengths_nm().to_vec(),
            spectra: library.samples().map(|s| s.reflectance.to_vec()).collect(),
            fractions: library.samples().map(|s| s.fractions.to_vec()).collect(),
        }
    }

    /// The minerals whose fractions are known.
    pub fn minerals(&self) -> &[String] {
        &self.minerals
    }

    /// The reflectance of a sample in each band, and the fraction of each mineral.
    ///
    /// # Panics
    /// When there is no such sample.
    pub fn sample(&self, sample: usize) -> (&[f64], &[f64]) {
        (&self.spectra[sample], &self.fractions[sample])
    }

    /// The features that its spectra lead to.
    ///
    /// # Errors
    /// When there are too few samples or bands, or one has no features.
    pub fn basis(&self) -> Result<SpectralBasis, FeatureError> {
        SpectralBasis::new(&self.wavelengths_nm, &self.spectra)
    }

    /// A gauge of one of its minerals, by its place among them.
    ///
    /// # Errors
    /// When there are too few samples.
    ///
    /// # Panics
    /// When there is no such mineral.
    pub fn gauge(&self, basis: &SpectralBasis, mineral: usize) -> Result<MineralGauge, GaugeError> {
        let fractions: Vec<f64> = self.fractions.iter().map(|all| all[mineral]).collect();
        MineralGauge::new(basis, &self.spectra, &fractions)
    }
}
