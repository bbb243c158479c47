//! What a rover makes of the readings that it knows: classes of rock, and what it thinks of each rock
//! of the catalogue. A function of the readings alone, so that rovers that know the same think the
//! same.

use farside_actors::system::SetupError;
use farside_worlds::spectra::SpectralLibrary;

use crate::analysis::features::SpectralBasis;
use crate::analysis::mixture::{Fit, FitSettings, Table, fit};
use crate::analysis::reading::Row;
use crate::analysis::rocks::{COLUMNS, POSITION_AT, Rocks};
use crate::analysis::scores::{hard, posterior_entropy};
use crate::messages::{Learned, RockLabel};
use crate::place::Place;
use crate::site::Site;

/// The basis of spectra that all rovers carry: of the scenario's library, or of the built-in one.
pub(crate) fn basis(place: &Place) -> Result<SpectralBasis, SetupError> {
    let builtin;
    let library = match &place.library {
        Some(library) => library.as_ref(),
        None => {
            builtin = SpectralLibrary::builtin();
            &builtin
        }
    };
    let spectra: Vec<&[f64]> = library.samples().map(|sample| sample.reflectance).collect();
    let basis = SpectralBasis::new(library.wavelengths_nm(), &spectra);
    basis.map_err(|error| SetupError::value("world.spectra", error))
}

/// What was learnt of some readings.
pub(crate) struct Lesson {
    /// The rocks that were read.
    pub(crate) rocks: Rocks,
    /// Their classes.
    pub(crate) fit: Fit,
    /// The probability of each class for each rock of the catalogue, rock by rock.
    pub(crate) all: Vec<f64>,
}

impl Lesson {
    /// Learns from readings in the order of their ids; none if there are none.
    pub(crate) fn of<'a>(site: &Site, rows: impl Iterator<Item = &'a Row>) -> Option<Lesson> {
        let rocks = Rocks::pool(rows);
        let settings = FitSettings {
            max_classes: site.config.max_classes as usize,
            ..FitSettings::default()
        };
        // Settings are in their ranges: the one error left is that there are no rocks.
        let fit = fit(rocks.table(), &settings).ok()?;
        let all = fit.mixture.responsibilities(&whole_field(site, &rocks)).ok()?;
        Some(Lesson { rocks, fit, all })
    }

    /// What a rover records of it.
    pub(crate) fn learned(&self, readings: usize) -> Learned {
        let classes = self.fit.mixture.classes();
        let read = &self.fit.responsibilities;
        let labels = hard(&self.all, classes);
        let field = self.all.chunks_exact(classes).zip(labels).enumerate();
        let label = |(rock, (row, class)): (usize, (&[f64], usize))| {
            let at = self.rocks.index_of(rock as u32);
            RockLabel {
                class: class as u32,
                confidence: row[class] as f32,
                image: at.is_some_and(|at| self.rocks.has_image(at)),
                spectrum: at.is_some_and(|at| self.rocks.has_spectrum(at)),
            }
        };
        let rocks: Vec<RockLabel> = field.map(label).collect();
        let share = |class| {
            let of_class = self.all.iter().skip(class).step_by(classes);
            of_class.sum::<f64>() / rocks.len().max(1) as f64
        };
        let spectra = (0..self.rocks.len()).filter(|at| self.rocks.has_spectrum(*at));
        Learned {
            readings: readings as u32,
            rocks_read: self.rocks.len() as u32,
            rocks_with_spectrum: spectra.count() as u32,
            classes: classes as u32,
            log_likelihood: self.fit.chosen.log_likelihood,
            objective: self.fit.chosen.objective,
            posterior_entropy: posterior_entropy(read, classes),
            proportions: (0..classes).map(share).collect(),
            rocks,
        }
    }
}

/// The features of every rock of the catalogue: of those that nobody has read, their place alone.
fn whole_field(site: &Site, rocks: &Rocks) -> Table {
    let mut table = Table::new(COLUMNS, 2);
    for (number, rock) in (0..).zip(&site.catalogue) {
        match rocks.index_of(number) {
            Some(at) => table.push(rocks.table().row(at), rocks.table().noise(at)),
            None => {
                let (mut values, mut noise) = ([0.0; COLUMNS], [f64::INFINITY; COLUMNS]);
                let place_m = [rock.position_m.x, rock.position_m.y];
                values[POSITION_AT..].copy_from_slice(&place_m);
                noise[POSITION_AT..].fill(0.0);
                table.push(&values, &noise);
            }
        }
    }
    table
}
