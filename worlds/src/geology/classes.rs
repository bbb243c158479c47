//! Classes of rock: what a rock of a class is made of and looks like, in distribution.

use farside::random::Stream;

use super::GeologyError;
use crate::spectra::{GRAIN_UM, MINERALS};

/// How many statistics describe the texture of a rock's picture.
pub const TEXTURE: usize = 4;

/// Their names, in order: statistics of the grey-level co-occurrence matrix of neighbouring pixels
/// (R. Haralick and others, *Textural features for image classification*, 1973).
///
/// Contrast is the mean squared difference as a share of the largest (0 to 1), energy the sum of
/// squared entries (0 to 1), correlation that of neighbours (-1 to 1). Anisotropy compares the
/// contrast of the four directions: largest less smallest over their sum (0 to 1).
pub const TEXTURE_NAMES: [&str; TEXTURE] = ["contrast", "energy", "correlation", "anisotropy"];

/// The least and the largest value of each.
const TEXTURE_RANGES: [[f64; 2]; TEXTURE] = [[0.0, 1.0], [0.0, 1.0], [-1.0, 1.0], [0.0, 1.0]];

/// How far the fractions of a class may be from 1 in sum.
pub const FRACTION_SUM_TOLERANCE: f64 = 1e-6;

/// The most classes of a field.
pub const MAX_CLASSES: usize = 64;

/// The scatter of the logarithm of grain sizes within a class: half or twice the median is rare.
const GRAIN_SCATTER: f64 = 0.25;

/// The standard deviation of the share of a surface under dust.
const DUST_SCATTER: f64 = 0.05;

/// A kind of rock: what its rocks are made of and look like, in distribution.
///
/// ```
/// use farside_worlds::RockClass;
/// let dunite = RockClass::builtin("dunite")?;
/// assert!(dunite.fractions[0] > 0.8); // olivine
/// let error = RockClass::builtin("dunit").unwrap_err();
/// assert!(error.to_string().contains("did you mean \"dunite\""));
/// # Ok::<(), farside_worlds::GeologyError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct RockClass {
    /// Its name.
    pub name: String,
    /// The fraction of each of the field's minerals by volume, in their order; each 0 to 1, they sum
    /// to 1.
    pub fractions: Vec<f64>,
    /// The standard deviation of the logarithm of each fraction before they are divided by their
    /// sum; 0 to 1. A mineral that the class has none of, no rock of it has.
    pub scatter: f64,
    /// The median size of its grains \[um, 5 to 5000\]; their logarithm scatters by 0.25.
    pub grain_um: f64,
    /// The mean share of a rock's surface that dust covers, 0 to 1; it scatters by 0.05.
    pub dust: f64,
    /// The mean of each statistic of texture, within its range.
    pub texture: [f64; TEXTURE],
    /// The standard deviation of each statistic of texture, 0 to 1.
    pub texture_scatter: [f64; TEXTURE],
}

/// What is drawn of one rock besides its fractions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RockSample {
    /// The size of its grains \[um\].
    pub grain_um: f64,
    /// The share of its surface under dust, 0 to 1.
    pub dust: f64,
    /// Each statistic of its texture.
    pub texture: [f64; TEXTURE],
}

/// A built-in class: name, fractions, grain size, dust, texture.
type Row = (
    &'static str,
    [f64; MINERALS.len()],
    f64,
    f64,
    [f64; TEXTURE],
);

/// The built-in classes: rocks that are known from Mars. Minerals are rounded from their sources;
/// grain sizes, dust and textures are estimates, from how the rocks are described.
const BUILTIN: [Row; 8] = [
    // Adirondack-class basalt of Gusev crater (H. McSween and others, JGR 111, 2006).
    (
        "olivine_basalt",
        [0.25, 0.12, 0.20, 0.41, 0.02],
        120.0,
        0.15,
        [0.22, 0.10, 0.70, 0.08],
    ),
    // Chassigny (A. Treiman and others, Meteoritics & Planetary Science 42, 2007).
    (
        "dunite",
        [0.88, 0.06, 0.03, 0.02, 0.01],
        300.0,
        0.10,
        [0.15, 0.18, 0.60, 0.05],
    ),
    // Allan Hills 84001 (D. Mittlefehldt, Meteoritics 29, 1994).
    (
        "orthopyroxenite",
        [0.03, 0.92, 0.02, 0.02, 0.01],
        400.0,
        0.10,
        [0.30, 0.09, 0.45, 0.06],
    ),
    // Nakhla (A. Treiman, Chemie der Erde 65, 2005).
    (
        "clinopyroxenite",
        [0.12, 0.03, 0.77, 0.07, 0.01],
        250.0,
        0.10,
        [0.26, 0.08, 0.40, 0.15],
    ),
    // Feldspathic rocks of the southern highlands (J. Carter and F. Poulet, Nature Geoscience 6, 2013).
    (
        "anorthosite",
        [0.02, 0.04, 0.03, 0.90, 0.01],
        300.0,
        0.15,
        [0.10, 0.30, 0.75, 0.05],
    ),
    // Shergotty (E. Stolper and H. McSween, Geochimica et Cosmochimica Acta 43, 1979).
    (
        "shergottite",
        [0.03, 0.36, 0.34, 0.26, 0.01],
        200.0,
        0.12,
        [0.18, 0.14, 0.55, 0.22],
    ),
    // The Burns formation of Meridiani Planum (B. Clark and others, EPSL 240, 2005), its salts left out.
    (
        "hematite_outcrop",
        [0.05, 0.05, 0.15, 0.55, 0.20],
        80.0,
        0.20,
        [0.14, 0.20, 0.65, 0.45],
    ),
    // Noritic clasts of Northwest Africa 7034 (A. Santos and others, GCA 157, 2015).
    (
        "norite",
        [0.02, 0.44, 0.06, 0.47, 0.01],
        350.0,
        0.12,
        [0.24, 0.12, 0.50, 0.10],
    ),
];

/// The scatter of fractions in the built-in classes.
const FRACTION_SCATTER: f64 = 0.12;

/// The scatter of textures in the built-in classes.
const TEXTURE_SCATTER: [f64; TEXTURE] = [0.03, 0.025, 0.06, 0.03];

impl RockClass {
    /// The names of the built-in classes.
    pub fn builtin_names() -> impl ExactSizeIterator<Item = &'static str> {
        BUILTIN.iter().map(|row| row.0)
    }

    /// The built-in class of this name; its fractions are of [`MINERALS`].
    ///
    /// # Errors
    /// When there is none.
    pub fn builtin(name: &str) -> Result<RockClass, GeologyError> {
        let Some((name, fractions, grain_um, dust, texture)) =
            BUILTIN.iter().find(|row| row.0 == name)
        else {
            return Err(GeologyError::unknown_class(
                name,
                RockClass::builtin_names(),
            ));
        };
        Ok(RockClass {
            name: (*name).to_owned(),
            fractions: fractions.to_vec(),
            scatter: FRACTION_SCATTER,
            grain_um: *grain_um,
            dust: *dust,
            texture: *texture,
            texture_scatter: TEXTURE_SCATTER,
        })
    }

    /// A class for rocks whose minerals and spectra are measured: its fractions are a mean over
    /// samples. The texture is that of a built-in class, chosen by the number `like`.
    pub(crate) fn measured(name: String, fractions: Vec<f64>, like: usize) -> RockClass {
        let (_, _, grain_um, dust, texture) = BUILTIN[like % BUILTIN.len()];
        RockClass {
            name,
            fractions,
            scatter: 0.0,
            grain_um,
            dust,
            texture,
            texture_scatter: TEXTURE_SCATTER,
        }
    }

    /// Whether it can be drawn from, for a field of these many minerals.
    ///
    /// # Errors
    /// When fractions are missing, not finite, outside 0 to 1 or do not sum to 1 within
    /// [`FRACTION_SUM_TOLERANCE`], or another figure is outside its range.
    pub fn check(&self, minerals: usize) -> Result<(), GeologyError> {
        let class = || self.name.clone();
        if self.fractions.len() != minerals {
            return Err(GeologyError::FractionCount {
                class: class(),
                actual: self.fractions.len(),
                expected: minerals,
            });
        }
        let within = |setting, [least, most]: [f64; 2], actual: f64| {
            // Written so that a NaN fails.
            if actual >= least && actual <= most {
                return Ok(());
            }
            Err(GeologyError::ClassSetting {
                class: self.name.clone(),
                setting,
                least,
                most,
                actual,
            })
        };
        for fraction in &self.fractions {
            within("fractions", [0.0, 1.0], *fraction)?;
        }
        let sum: f64 = self.fractions.iter().sum();
        if (sum - 1.0).abs() > FRACTION_SUM_TOLERANCE {
            return Err(GeologyError::FractionSum {
                class: class(),
                sum,
            });
        }
        within("scatter", [0.0, 1.0], self.scatter)?;
        within("grain_um", GRAIN_UM, self.grain_um)?;
        within("dust", [0.0, 1.0], self.dust)?;
        for (place, setting) in TEXTURE_NAMES.into_iter().enumerate() {
            within(setting, TEXTURE_RANGES[place], self.texture[place])?;
            within("texture_scatter", [0.0, 1.0], self.texture_scatter[place])?;
        }
        Ok(())
    }

    /// Draws the fractions of a rock of this class, and appends them; they sum to 1.
    pub fn draw_fractions(&self, stream: &mut Stream, fractions: &mut Vec<f64>) {
        let from = fractions.len();
        for mean in &self.fractions {
            fractions.push(mean * libm::exp(stream.normal(0.0, self.scatter)));
        }
        let sum: f64 = fractions[from..].iter().sum();
        for fraction in &mut fractions[from..] {
            *fraction /= sum;
        }
    }

    /// Draws the rest of a rock of this class. What would leave its range stands at its end.
    pub fn draw(&self, stream: &mut Stream) -> RockSample {
        let grain_um = self.grain_um * libm::exp(stream.normal(0.0, GRAIN_SCATTER));
        let dust = stream.normal(self.dust, DUST_SCATTER);
        let mut texture = self.texture;
        for ((value, scatter), [least, most]) in texture
            .iter_mut()
            .zip(self.texture_scatter)
            .zip(TEXTURE_RANGES)
        {
            *value = stream.normal(*value, scatter).clamp(least, most);
        }
        RockSample {
            grain_um: grain_um.clamp(GRAIN_UM[0], GRAIN_UM[1]),
            dust: dust.clamp(0.0, 1.0),
            texture,
        }
    }
}
