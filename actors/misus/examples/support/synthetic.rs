//! Fields of rocks for measurements: four classes of minerals in beds, their spectra and textures.

use farside::random::{RandomKey, Stream};
use farside_misus::analysis::features::SpectralBasis;
use farside_misus::analysis::reading::{Reading, ReadingId, Row, Textural};

/// Bands of minerals: centre [nm], width [nm], depth.
const MINERALS: [&[(f64, f64, f64)]; 5] = [
    &[
        (860.0, 90.0, 0.25),
        (1050.0, 140.0, 0.6),
        (1250.0, 120.0, 0.3),
    ],
    &[(920.0, 80.0, 0.6), (1870.0, 180.0, 0.45)],
    &[(1020.0, 90.0, 0.5), (2220.0, 200.0, 0.45)],
    &[(1250.0, 120.0, 0.25)],
    &[(530.0, 60.0, 0.6), (860.0, 80.0, 0.4)],
];

pub struct Field {
    pub class: Vec<usize>,
    pub fractions: Vec<[f64; 5]>,
    pub position: Vec<[f64; 2]>,
    pub spectra: Vec<Vec<f64>>,
    pub texture: Vec<[f64; 4]>,
}

pub fn wavelengths() -> Vec<f64> {
    (0..101).map(|i| 450.0 + 20.0 * f64::from(i)).collect()
}

fn dirichlet(stream: &mut Stream, sharp: f64) -> [f64; 5] {
    let mut f = [0.0; 5].map(|_: f64| libm::pow(stream.exponential(1.0), sharp));
    let sum: f64 = f.iter().sum();
    f.iter_mut().for_each(|x| *x /= sum);
    f
}

pub fn spectrum(fractions: &[f64; 5], grain: f64, dust: f64) -> Vec<f64> {
    wavelengths()
        .iter()
        .map(|&x| {
            let mut r = 0.0;
            for (m, bands) in MINERALS.iter().enumerate() {
                for &(at, width, depth) in *bands {
                    let z = (x - at) / width;
                    r += fractions[m] * depth * libm::exp(-0.5 * z * z);
                }
            }
            let rock = 0.35 * libm::exp(-grain * r);
            let red = 0.1 + 0.25 * (1.0 - libm::exp(-(x - 400.0) / 300.0));
            (1.0 - dust) * rock + dust * red
        })
        .collect()
}

pub fn basis() -> SpectralBasis {
    let mut stream = RandomKey::new(0).text("library").stream();
    let library: Vec<Vec<f64>> = (0..300)
        .map(|_| {
            let f = dirichlet(&mut stream, 1.5);
            spectrum(&f, stream.uniform_in(0.5, 2.0), stream.uniform_in(0.0, 0.3))
        })
        .collect();
    SpectralBasis::new(&wavelengths(), &library).unwrap()
}

pub fn field(seed: u64, rocks: usize, classes: usize, stretched: bool) -> Field {
    let mut s = RandomKey::new(seed).text("field").stream();
    let mut centres: Vec<[f64; 5]> = Vec::new();
    while centres.len() < classes {
        let c = dirichlet(&mut s, 1.5);
        let far = |o: &[f64; 5]| o.iter().zip(&c).map(|(a, b)| (a - b).abs()).sum::<f64>() > 0.7;
        if centres.iter().all(far) {
            centres.push(c);
        }
    }
    let textures: Vec<[f64; 4]> = (0..classes)
        .map(|_| [0.0; 4].map(|_: f64| s.uniform()))
        .collect();
    let along: Vec<usize> = (0..classes).map(|_| s.below(5) as usize).collect();
    let angle = s.uniform_in(0.0, std::f64::consts::PI);
    let mut field = Field {
        class: vec![],
        fractions: vec![],
        position: vec![],
        spectra: vec![],
        texture: vec![],
    };
    for _ in 0..rocks {
        let p = [s.uniform_in(-50.0, 50.0), s.uniform_in(-50.0, 50.0)];
        let u = p[0] * libm::cos(angle) + p[1] * libm::sin(angle) + 8.0 * s.normal(0.0, 1.0);
        let mut class =
            (((u / 140.0 + 0.5) * classes as f64) as isize).clamp(0, classes as isize - 1) as usize;
        if s.chance(0.15) {
            class = s.below(classes as u64) as usize;
        }
        let mut f = centres[class].map(|x| x * libm::exp(s.normal(0.0, 0.15)));
        if stretched {
            f[along[class]] += 0.5 * s.uniform();
        }
        let sum: f64 = f.iter().sum();
        f.iter_mut().for_each(|x| *x /= sum);
        let grain = libm::exp(s.normal(0.0, 0.3));
        let dust = s.uniform_in(0.0, 0.3);
        field.spectra.push(spectrum(&f, grain, dust));
        field
            .texture
            .push(textures[class].map(|t| t + s.normal(0.0, 0.15)));
        field.class.push(class);
        field.fractions.push(f);
        field.position.push(p);
    }
    field
}

pub fn read(field: &Field, basis: &SpectralBasis, rock: usize, noise: f64, s: &mut Stream) -> Row {
    let r: Vec<f64> = field.spectra[rock]
        .iter()
        .map(|x| x * (1.0 + s.normal(0.0, noise)))
        .collect();
    let mean = r.iter().sum::<f64>() / r.len() as f64;
    let [x, y] = field.position[rock];
    Row {
        id: ReadingId {
            ordinal: rock as u32,
            ..ReadingId::default()
        },
        version: 1,
        reading: Reading {
            rock: rock as u32,
            position_m: [x as f32, y as f32],
            position_sd_m: 0.1,
            diameter_m: 0.3,
            spectral: Some(basis.features(&r, noise * mean).unwrap()),
            textural: Some(Textural {
                features: field.texture[rock].map(|t| (t + s.normal(0.0, noise)) as f32),
                noise_sd: noise as f32,
            }),
        },
    }
}
