//! Fields of rocks and readings of them, for measurements of the data analysis.

use farside::random::{RandomKey, Stream};
use farside_misus::analysis::features::SpectralBasis;
use farside_misus::analysis::reading::{Reading, ReadingId, Row, Spectral, Textural};
use farside_worlds::{
    FieldClasses, FieldRocks, RockClass, RockField, RockFieldSettings, StoryKind,
};

/// The noise of close readings: of a reflectance as a share of itself, and of textures.
pub(crate) const NOISE: f64 = 0.01;

/// The classes that stretched fields are made of: kinds that are far apart, so that it is their shape
/// that makes them hard.
const STRETCHED: [&str; 4] = [
    "dunite",
    "orthopyroxenite",
    "clinopyroxenite",
    "anorthosite",
];

/// Field `seed` of a measurement: 90 rocks of 4 classes, laid out by the four stories in turn. Those
/// whose number divides by 5 are stretched: classes vary four times as much in composition, and in one
/// statistic of texture.
pub(crate) fn field(seed: u64, rocks: usize) -> RockField {
    let stretched = || {
        let mut classes: Vec<RockClass> = STRETCHED
            .iter()
            .map(|name| RockClass::builtin(name).expect("it is built in"))
            .collect();
        for (i, class) in classes.iter_mut().enumerate() {
            class.scatter = (4.0 * class.scatter).min(1.0);
            class.texture_scatter[i % 4] *= 4.0;
        }
        classes
    };
    let classes = match seed % 5 {
        0 => FieldClasses::Custom(stretched()),
        _ => FieldClasses::Count(4),
    };
    RockField::generate(&RockFieldSettings {
        seed,
        story: StoryKind::ALL[(seed % 4) as usize],
        classes,
        rocks: FieldRocks::Exactly(rocks),
        ..RockFieldSettings::default()
    })
    .expect("the settings are in range")
}

/// What a close spectrum of a rock says, with noise of this share of each reflectance.
pub(crate) fn spectral(
    field: &RockField,
    basis: &SpectralBasis,
    rock: usize,
    noise: f64,
    stream: &mut Stream,
) -> Spectral {
    let exact = field.reflectance(rock);
    let read: Vec<f64> = exact
        .iter()
        .map(|&value| value * (1.0 + stream.normal(0.0, noise)))
        .collect();
    let mean = exact.iter().sum::<f64>() / exact.len() as f64;
    basis
        .features(&read, noise * mean)
        .expect("rocks reflect light")
}

/// What an image of a rock says.
pub(crate) fn textural(
    field: &RockField,
    rock: usize,
    noise: f64,
    stream: &mut Stream,
) -> Textural {
    let features = field.texture(rock);
    Textural {
        features: features.map(|value| (value + stream.normal(0.0, noise)) as f32),
        noise_sd: noise as f32,
    }
}

/// A reading of a rock that says where it is, and what it is told to.
pub(crate) fn row(
    field: &RockField,
    ordinal: usize,
    rock: usize,
    spectral: Option<Spectral>,
    textural: Option<Textural>,
) -> Row {
    let place = field.rocks()[rock];
    Row {
        id: ReadingId {
            ordinal: ordinal as u32,
            ..ReadingId::default()
        },
        version: 1,
        reading: Reading {
            rock: rock as u32,
            position_m: [place.position_m.x as f32, place.position_m.y as f32],
            position_sd_m: 0.1,
            diameter_m: place.diameter_m as f32,
            spectral,
            textural,
        },
    }
}

/// A spectrum and an image of each rock, from near.
pub(crate) fn survey(field: &RockField, basis: &SpectralBasis, noise: f64) -> Vec<Row> {
    let mut stream = RandomKey::new(field.settings().seed)
        .text("survey")
        .stream();
    (0..field.rocks().len())
        .map(|rock| {
            let spectral = spectral(field, basis, rock, noise, &mut stream);
            let textural = textural(field, rock, noise, &mut stream);
            row(field, rock, rock, Some(spectral), Some(textural))
        })
        .collect()
}

/// The true class of each rock.
pub(crate) fn truth(field: &RockField) -> Vec<usize> {
    field
        .truth()
        .classes()
        .iter()
        .map(|&class| usize::from(class))
        .collect()
}
