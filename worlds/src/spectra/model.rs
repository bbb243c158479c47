//! The reflectance of rock and dust, computed from minerals, grain size and cover.

use std::f64::consts::FRAC_PI_6;

use super::minerals::{ABSORPTION, MINERALS, Mineral};

/// The least and the largest size of grains that the model takes \[um\]. Below, grains are no longer
/// large beside the wavelength.
pub const GRAIN_UM: [f64; 2] = [5.0, 5_000.0];

/// The refractive index of all minerals: that of pyroxene, about. Hematite's is larger.
const INDEX: f64 = 1.7;

/// The mean way through a grain, as a share of its size (Hapke 1993, Section 6.5).
const WAY: f64 = 0.9;

/// The minerals of the dust: fine, red, and basaltic otherwise (J. Bell and others, *Mineralogic and
/// compositional properties of Martian soil and dust*, JGR 105, 2000). An estimate.
const DUST_FRACTIONS: [f64; MINERALS.len()] = [0.05, 0.10, 0.25, 0.45, 0.15];

/// The size of the aggregates of the dust \[um\].
const DUST_GRAIN_UM: f64 = 25.0;

/// Computes the reflectance of rocks in given bands.
///
/// A grain lets pass what it does not absorb: absorption is a continuum and bands that are Gaussian
/// in energy (J. Sunshine and others, *Deconvolution of mineral absorption bands*, JGR 95, 1990); the
/// share of light that a grain scatters follows Hapke's equivalent slab (*Theory of Reflectance and
/// Emittance Spectroscopy*, 1993, Section 6.5). Grains of several minerals mix by cross-section, and
/// the rock's reflectance is the directional-hemispherical one of a deep layer of them, lit at 30
/// degrees (the same, Equation 10.11, isotropic scatterers). So fine grains are bright with shallow
/// bands, coarse ones dark with saturated bands. Dust covers a share of the surface and mixes
/// linearly.
///
/// ```
/// use farside_worlds::spectra::{SpectralModel, wavelength_grid_nm};
/// let model = SpectralModel::new(&wavelength_grid_nm());
/// let mut dunite = vec![0.0; 101];
/// model.reflectance_into(&[1.0, 0.0, 0.0, 0.0, 0.0], 100.0, 0.0, &mut dunite);
/// let darkest = (20..101).min_by(|&a, &b| dunite[a].total_cmp(&dunite[b])).map(|band| 450 + 20 * band);
/// assert_eq!(darkest, Some(1070)); // the olivine band near 1.05 um
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralModel {
    /// The optical depth of grains of 1 um, band by band, in each all minerals.
    depth_per_um: Vec<[f64; MINERALS.len()]>,
    dust: Vec<f64>,
}

impl SpectralModel {
    /// The model in these bands \[nm, over 0\].
    pub fn new(wavelengths_nm: &[f64]) -> SpectralModel {
        let depth = |mineral: &Mineral, nm: f64| {
            WAY * mineral.grain_share * mineral.absorption_per_mm(nm / 1000.0) / 1000.0
        };
        let depth_per_um = wavelengths_nm
            .iter()
            .map(|&nm| ABSORPTION.each_ref().map(|mineral| depth(mineral, nm)))
            .collect();
        let mut model = SpectralModel {
            depth_per_um,
            dust: vec![0.0; wavelengths_nm.len()],
        };
        let mut dust = vec![0.0; wavelengths_nm.len()];
        model.reflectance_into(&DUST_FRACTIONS, DUST_GRAIN_UM, 0.0, &mut dust);
        model.dust = dust;
        model
    }

    /// The reflectance of a thick layer of dust in each band.
    pub fn dust(&self) -> &[f64] {
        &self.dust
    }

    /// Writes the reflectance \[0 to 1\] of a rock in each band, from the volume fractions of
    /// [`MINERALS`] (summing to 1), the size of its grains \[um, within [`GRAIN_UM`]\] and the share of
    /// its surface under dust \[0 to 1\].
    ///
    /// # Panics
    /// When there is not one fraction for each mineral or not one place in `out` for each band.
    pub fn reflectance_into(&self, fractions: &[f64], grain_um: f64, dust: f64, out: &mut [f64]) {
        assert_eq!(
            fractions.len(),
            MINERALS.len(),
            "one fraction for each mineral"
        );
        assert_eq!(
            out.len(),
            self.depth_per_um.len(),
            "one place for each band"
        );
        // Of two minerals of equal volume, the finer has the larger cross-section.
        let mut sections = [0.0; MINERALS.len()];
        for ((section, fraction), mineral) in sections.iter_mut().zip(fractions).zip(&ABSORPTION) {
            *section = fraction / mineral.grain_share;
        }
        let whole: f64 = sections.iter().sum();
        sections = sections.map(|section| section / whole);
        for ((value, depth_per_um), dusty) in out.iter_mut().zip(&self.depth_per_um).zip(&self.dust)
        {
            let mut scattered = 0.0;
            for (section, depth) in sections.iter().zip(depth_per_um) {
                if *section > 0.0 {
                    scattered += section * scattered_share(depth * grain_um);
                }
            }
            *value = (1.0 - dust) * layer(scattered) + dust * dusty;
        }
    }
}

/// Which share of the light that meets a grain of this optical depth it scatters.
fn scattered_share(depth: f64) -> f64 {
    let normal = (INDEX - 1.0) / (INDEX + 1.0);
    let outside = normal * normal + 0.05;
    let inside = 1.0 - 4.0 / (INDEX * (INDEX + 1.0) * (INDEX + 1.0));
    let passes = libm::exp(-depth);
    outside + (1.0 - outside) * (1.0 - inside) * passes / (1.0 - inside * passes)
}

/// The reflectance of a deep layer of grains that scatter this share.
fn layer(scattered: f64) -> f64 {
    let gamma = libm::sqrt(1.0 - scattered);
    (1.0 - gamma) / (1.0 + 2.0 * gamma * libm::cos(FRAC_PI_6))
}
