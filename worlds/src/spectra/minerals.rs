//! What the built-in minerals absorb, band by band.
//!
//! Where bands lie: R. Burns, *Mineralogical Applications of Crystal Field Theory* (2nd ed., 1993,
//! chapter 5); E. Cloutis and M. Gaffey, *Pyroxene spectroscopy revisited* (JGR 96, 1991); J. Adams,
//! *Visible and near-infrared diffuse reflectance spectra of pyroxenes* (JGR 79, 1974); R. Morris and
//! others, *Spectral and other physicochemical properties of submicron powders of hematite* (JGR 90,
//! 1985). Their widths: H. Clenet and others, *A new systematic approach using the Modified Gaussian
//! Model* (Icarus 213, 2011). Their strengths are estimates, set so that pure minerals in grains of
//! some 100 um have the depths of the built-in library's samples.

/// The built-in minerals, in the order of fractions.
pub const MINERALS: [&str; 5] = [
    "olivine",
    "orthopyroxene",
    "clinopyroxene",
    "plagioclase",
    "hematite",
];

/// What one mineral absorbs.
pub(super) struct Mineral {
    /// Its absorption between the bands at 1 um \[1/mm\].
    base_per_mm: f64,
    /// How steeply that grows towards short waves: the power of the wave number.
    slope: f64,
    bands: &'static [Band],
    /// The size of its grains as a share of those of the rock. Hematite on Mars is fine: it tints
    /// far more than its volume.
    pub(super) grain_share: f64,
}

/// An absorption band: a Gaussian in energy.
struct Band {
    center_um: f64,
    /// Its full width at half its height.
    width_um: f64,
    peak_per_mm: f64,
}

const fn band(center_um: f64, width_um: f64, peak_per_mm: f64) -> Band {
    Band {
        center_um,
        width_um,
        peak_per_mm,
    }
}

/// Each of [`MINERALS`].
pub(super) const ABSORPTION: [Mineral; MINERALS.len()] = [
    Mineral {
        base_per_mm: 0.12,
        slope: 3.0,
        bands: &[
            band(0.88, 0.20, 1.6),
            band(1.05, 0.24, 3.2),
            band(1.23, 0.40, 2.4),
        ],
        grain_share: 1.0,
    },
    Mineral {
        base_per_mm: 0.30,
        slope: 3.0,
        bands: &[band(0.915, 0.19, 9.0), band(1.86, 0.50, 6.0)],
        grain_share: 1.0,
    },
    Mineral {
        base_per_mm: 0.30,
        slope: 3.0,
        bands: &[band(1.01, 0.25, 6.5), band(2.25, 0.55, 5.0)],
        grain_share: 1.0,
    },
    Mineral {
        base_per_mm: 0.10,
        slope: 2.0,
        bands: &[band(1.25, 0.42, 0.5)],
        grain_share: 1.0,
    },
    Mineral {
        base_per_mm: 30.0,
        slope: 0.5,
        // The edge of the charge transfer in the ultraviolet reaches into the first bands.
        bands: &[
            band(0.44, 0.14, 1200.0),
            band(0.53, 0.13, 900.0),
            band(0.86, 0.17, 60.0),
        ],
        grain_share: 0.1,
    },
];

impl Mineral {
    /// What it absorbs at a wavelength \[1/mm\].
    pub(super) fn absorption_per_mm(&self, wavelength_um: f64) -> f64 {
        let bands = self.bands.iter().map(|band| band.at(wavelength_um));
        self.base_per_mm * libm::pow(wavelength_um, -self.slope) + bands.sum::<f64>()
    }
}

impl Band {
    fn at(&self, wavelength_um: f64) -> f64 {
        let half_um = 0.5 * self.width_um;
        let width = 1.0 / (self.center_um - half_um) - 1.0 / (self.center_um + half_um);
        let off = (1.0 / wavelength_um - 1.0 / self.center_um) / width;
        self.peak_per_mm * libm::exp(-4.0 * std::f64::consts::LN_2 * off * off)
    }
}
