//! What the rocks of a field are made of: class, fractions, grains, dust, spectrum and texture.

use farside::random::{RandomKey, Stream};

use super::palette::Palette;
use super::settings::FieldSpectra;
use crate::geology::{RockSample, Story, TEXTURE};
use crate::rocks::Rock;
use crate::spectra::{MINERALS, SpectralLibrary, SpectralModel, wavelength_grid_nm};

/// The share of the ground that dust covers, where spectra are mixed.
const GROUND_DUST: f64 = 0.5;

/// The size of the ground's grains \[um\]: sand.
const GROUND_GRAIN_UM: f64 = 80.0;

/// The texture of the ground: smooth, alike, without direction.
pub(super) const GROUND_TEXTURE: [f64; TEXTURE] = [0.05, 0.35, 0.85, 0.03];

/// The composition of all rocks, rock by rock.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Composition {
    pub(super) class: Vec<u16>,
    /// With a library, the sample of each rock.
    pub(super) sample: Vec<u32>,
    /// Fractions of all minerals; with a library those of the samples are used instead.
    pub(super) fractions: Vec<f64>,
    pub(super) looks: Vec<RockSample>,
    pub(super) wavelengths_nm: Vec<f64>,
    /// All bands; with a library those of the samples are used instead.
    pub(super) reflectance: Vec<f64>,
    pub(super) ground_reflectance: Vec<f64>,
}

impl Composition {
    pub(super) fn draw(
        spectra: &FieldSpectra,
        palette: &Palette,
        story: &Story,
        rocks: &[Rock],
        key: RandomKey,
    ) -> Composition {
        let mut composition = Composition {
            class: Vec::with_capacity(rocks.len()),
            sample: Vec::new(),
            fractions: Vec::new(),
            looks: Vec::with_capacity(rocks.len()),
            wavelengths_nm: match spectra {
                FieldSpectra::Mixed => wavelength_grid_nm(),
                FieldSpectra::Library(library) => library.wavelengths_nm().to_vec(),
            },
            reflectance: Vec::new(),
            ground_reflectance: Vec::new(),
        };
        let mut shares = vec![0.0; palette.classes.len()];
        for (rock, number) in rocks.iter().zip(0..) {
            let mut stream = key.text("rock").number(number).stream();
            story.class_probabilities(rock.position_m, rock.diameter_m, &mut shares);
            let class = drawn(&shares, &mut stream);
            composition.class.push(class as u16);
            composition
                .looks
                .push(palette.classes[class].draw(&mut stream));
            if let Some(&sample) = palette.samples.get(class).and_then(|of| stream.choose(of)) {
                composition.sample.push(sample);
            } else {
                let fractions = &mut composition.fractions;
                palette.classes[class].draw_fractions(&mut stream, fractions);
            }
        }
        match spectra {
            FieldSpectra::Mixed => composition.mix(palette),
            FieldSpectra::Library(library) => {
                composition.ground_reflectance = mean_of_samples(palette, library);
            }
        }
        composition
    }

    /// Computes the spectra. The ground is sand of all classes alike, under dust.
    fn mix(&mut self, palette: &Palette) {
        let bands = self.wavelengths_nm.len();
        let model = SpectralModel::new(&self.wavelengths_nm);
        self.reflectance = vec![0.0; self.looks.len() * bands];
        let fractions = self.fractions.chunks_exact(MINERALS.len());
        let spectra = self.reflectance.chunks_exact_mut(bands);
        for ((fractions, look), out) in fractions.zip(&self.looks).zip(spectra) {
            model.reflectance_into(fractions, look.grain_um, look.dust, out);
        }
        let mut ground = [0.0; MINERALS.len()];
        for class in &palette.classes {
            for (mean, fraction) in ground.iter_mut().zip(&class.fractions) {
                *mean += fraction / palette.classes.len() as f64;
            }
        }
        self.ground_reflectance = vec![0.0; bands];
        model.reflectance_into(
            &ground,
            GROUND_GRAIN_UM,
            GROUND_DUST,
            &mut self.ground_reflectance,
        );
    }
}

/// One of the indices, with these probabilities.
fn drawn(shares: &[f64], stream: &mut Stream) -> usize {
    let mut left = stream.uniform();
    let found = shares.iter().position(|share| {
        left -= share;
        left < 0.0
    });
    found.unwrap_or(shares.len() - 1)
}

/// The ground where spectra are measured: what the rocks weather to, all classes alike.
fn mean_of_samples(palette: &Palette, library: &SpectralLibrary) -> Vec<f64> {
    let mut mean = vec![0.0; library.wavelengths_nm().len()];
    for samples in &palette.samples {
        let weight = 1.0 / (palette.samples.len() * samples.len()) as f64;
        for &sample in samples {
            for (mean, value) in mean
                .iter_mut()
                .zip(library.sample(sample as usize).reflectance)
            {
                *mean += weight * value;
            }
        }
    }
    mean
}
