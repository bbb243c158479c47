//! Rounds of readings that are ranked or random, at equal numbers.

use std::error::Error;

use farside::random::RandomKey;
use farside_misus::analysis::features::SpectralBasis;
use farside_misus::analysis::learned::Learned;
use farside_misus::analysis::library::ReferenceLibrary;
use farside_misus::analysis::mixture::FitSettings;
use farside_misus::analysis::objective::{MineralGauge, Objective, Stories, StorySettings, regret};
use farside_misus::analysis::prioritise::{PrioritiserSettings, rank};
use farside_misus::analysis::reading::Row;
use farside_misus::analysis::scores::adjusted_rand_index;
use farside_worlds::RockField;
use farside_worlds::spectra::{MINERALS, wavelength_grid_nm};

use super::field::{NOISE, row, spectral, textural, truth};

/// How many spectra there are before the first round, in each round, and how many rounds.
const BEFORE: usize = 6;
const IN_A_ROUND: usize = 3;
const ROUNDS: usize = 10;

/// What is to be found out, and so what is measured; more is better of each.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Aim {
    /// The adjusted Rand index of all rocks.
    Distribution,
    /// The regret of the rock named, negative.
    Mineral,
    /// The log score of the true story.
    Process,
}

/// Whose spectrum comes next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Choice {
    Ranked,
    Random,
}

/// What all fields are read with.
pub(crate) struct Lab {
    basis: SpectralBasis,
    gauges: Vec<MineralGauge>,
    stories: Stories,
    pub(crate) settings: PrioritiserSettings,
}

impl Lab {
    pub(crate) fn new() -> Result<Lab, Box<dyn Error>> {
        let library = ReferenceLibrary::mixed(&wavelength_grid_nm(), 300);
        let basis = library.basis()?;
        // Hematite is a trace in most classes.
        let minerals = 0..MINERALS.len() - 1;
        let gauges = minerals.map(|mineral| library.gauge(&basis, mineral));
        Ok(Lab {
            gauges: gauges.collect::<Result<_, _>>()?,
            basis,
            stories: Stories::new(StorySettings {
                draws: 60,
                ..StorySettings::default()
            }),
            settings: PrioritiserSettings::default(),
        })
    }

    /// The mean over the rounds of what is measured.
    pub(crate) fn mean(
        &mut self,
        field: &RockField,
        aim: Aim,
        choice: Choice,
    ) -> Result<f64, Box<dyn Error>> {
        let key = RandomKey::new(field.settings().seed).text("rounds");
        let rocks = field.rocks().len();
        let mut order: Vec<usize> = (0..rocks).collect();
        key.text("order").stream().shuffle(&mut order);
        // What a rock's spectrum is does not depend on when it is read.
        let read = |rock: usize| {
            let mut stream = key.text("spectrum").number(rock as u64).stream();
            spectral(field, &self.basis, rock, NOISE, &mut stream)
        };
        let mut stream = key.text("images").stream();
        let mut rows: Vec<Row> = (0..rocks)
            .map(|rock| {
                let image = textural(field, rock, 10.0 * NOISE, &mut stream);
                row(field, rock, rock, None, Some(image))
            })
            .collect();
        let add = |rows: &mut Vec<Row>, rock: usize| {
            rows.push(row(field, rows.len(), rock, Some(read(rock)), None));
        };
        for &rock in &order[..BEFORE] {
            add(&mut rows, rock);
        }
        let mut next = BEFORE;
        let mut sum = 0.0;
        let seed = field.settings().seed as usize;
        let mineral = seed % self.gauges.len();
        let mut learned = Learned::from_rows(&rows, &FitSettings::default())?;
        for _ in 0..ROUNDS {
            let belief = match (aim, choice) {
                (Aim::Process, Choice::Ranked) => Some(self.stories.weigh(&learned)),
                _ => None,
            };
            let objective = match (aim, &belief) {
                (Aim::Mineral, _) => Objective::Mineral(&self.gauges[mineral]),
                (_, Some(belief)) => Objective::Process(belief),
                _ => Objective::Distribution,
            };
            let chosen: Vec<usize> = match choice {
                Choice::Random => order[next..next + IN_A_ROUND].to_vec(),
                Choice::Ranked => rank(&learned, objective, &self.settings, IN_A_ROUND)
                    .iter()
                    .map(|pick| pick.index)
                    .collect(),
            };
            next += IN_A_ROUND;
            for rock in chosen {
                add(&mut rows, rock);
            }
            learned = Learned::from_rows(&rows, &FitSettings::default())?;
            sum += match aim {
                Aim::Distribution => adjusted_rand_index(&learned.hard_classes(), &truth(field)),
                Aim::Mineral => {
                    let fraction = |rock| field.truth().rock(rock).fractions[mineral];
                    let fractions: Vec<f64> = (0..rocks).map(fraction).collect();
                    -regret(&fractions, self.gauges[mineral].richest(&learned.rocks))
                }
                Aim::Process => self.stories.weigh(&learned).log_score(field.story()),
            };
        }
        Ok(sum / ROUNDS as f64)
    }
}

/// The mean difference of pairs, and how many of its standard errors it is.
pub(crate) fn paired(a: &[f64], b: &[f64]) -> (f64, f64) {
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    let count = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / count;
    let squares: f64 = differences.iter().map(|d| (d - mean) * (d - mean)).sum();
    let standard_error = (squares / (count - 1.0) / count).sqrt();
    (mean, mean / standard_error)
}
