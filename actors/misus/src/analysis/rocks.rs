//! What is known of each rock, pooled from all of its readings.
//!
//! Readings are weighted by their precision, the inverse of their noise's variance. What no reading
//! of a rock says is missing: its noise is infinite.

use std::collections::BTreeMap;

use super::mixture::Table;
use super::reading::{Row, SPECTRAL, TEXTURAL};

/// How many features a rock has: of its spectrum, of its texture, and its position.
pub const COLUMNS: usize = SPECTRAL + TEXTURAL + 2;

/// Where texture begins among the features.
pub const TEXTURE_AT: usize = SPECTRAL;

/// Where position begins among the features.
pub const POSITION_AT: usize = SPECTRAL + TEXTURAL;

/// The least standard deviation that a reading can claim, as a share of the feature's unit: a
/// reading without noise would silence all others.
const LEAST_SD: f64 = 1.0e-4;

/// All rocks that somebody has read, in the order of their numbers.
///
/// ```
/// use farside_misus::analysis::reading::{Reading, ReadingId, Row, Textural};
/// use farside_misus::analysis::rocks::{Rocks, TEXTURE_AT};
/// let row = |ordinal, value, noise_sd| Row {
///     id: ReadingId { ordinal, ..ReadingId::default() },
///     version: 1,
///     reading: Reading {
///         rock: 3,
///         textural: Some(Textural { features: [value; 4], noise_sd }),
///         ..Reading::default()
///     },
/// };
/// // From afar, and from near, where noise is a third.
/// let rocks = Rocks::pool(&[row(0, 0.5, 0.3), row(1, 0.6, 0.1)]);
/// let value = rocks.table().row(0)[TEXTURE_AT];
/// assert!((value - 0.59).abs() < 1e-6);
/// assert!(!rocks.has_spectrum(0));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Rocks {
    numbers: Vec<u32>,
    diameters_m: Vec<f64>,
    readings: Vec<u32>,
    table: Table,
}

/// Sums over the readings of a rock.
#[derive(Clone, Debug)]
struct Sums {
    weighted: [f64; COLUMNS],
    precision: [f64; COLUMNS],
    diameter_m: f64,
    readings: u32,
}

impl Sums {
    fn add(&mut self, at: usize, features: &[f32], noise_sd: f32) {
        let sd = f64::from(noise_sd).max(LEAST_SD);
        let precision = 1.0 / (sd * sd);
        for (i, &value) in features.iter().enumerate() {
            self.weighted[at + i] += precision * f64::from(value);
            self.precision[at + i] += precision;
        }
    }
}

impl Rocks {
    /// Pools readings. Which order they come in decides the last bits of sums: pass them in the
    /// order of their ids.
    pub fn pool<'a>(rows: impl IntoIterator<Item = &'a Row>) -> Rocks {
        let mut sums: BTreeMap<u32, Sums> = BTreeMap::new();
        for Row { reading, .. } in rows {
            let rock = sums.entry(reading.rock).or_insert_with(|| Sums {
                weighted: [0.0; COLUMNS],
                precision: [0.0; COLUMNS],
                diameter_m: 0.0,
                readings: 0,
            });
            rock.readings += 1;
            rock.diameter_m += f64::from(reading.diameter_m);
            rock.add(POSITION_AT, &reading.position_m, reading.position_sd_m);
            if let Some(spectral) = &reading.spectral {
                rock.add(0, &spectral.features, spectral.noise_sd);
            }
            if let Some(textural) = &reading.textural {
                rock.add(TEXTURE_AT, &textural.features, textural.noise_sd);
            }
        }
        let mut table = Table::new(COLUMNS, 2);
        for rock in sums.values() {
            let mut values = [0.0; COLUMNS];
            let mut noise = [f64::INFINITY; COLUMNS];
            for column in 0..COLUMNS {
                if rock.precision[column] > 0.0 {
                    values[column] = rock.weighted[column] / rock.precision[column];
                    noise[column] = 1.0 / rock.precision[column];
                }
            }
            table.push(&values, &noise);
        }
        let mean_m = |rock: &Sums| rock.diameter_m / f64::from(rock.readings);
        Rocks {
            numbers: sums.keys().copied().collect(),
            diameters_m: sums.values().map(mean_m).collect(),
            readings: sums.values().map(|rock| rock.readings).collect(),
            table,
        }
    }

    /// How many rocks somebody has read.
    pub fn len(&self) -> usize {
        self.numbers.len()
    }

    /// Whether nobody has read a rock.
    pub fn is_empty(&self) -> bool {
        self.numbers.is_empty()
    }

    /// The rocks' numbers in the team's catalogue, ascending.
    pub fn numbers(&self) -> &[u32] {
        &self.numbers
    }

    /// Where a rock stands among these, if somebody has read it.
    pub fn index_of(&self, number: u32) -> Option<usize> {
        self.numbers.binary_search(&number).ok()
    }

    /// Their features, [`COLUMNS`] each; the last two are the position.
    pub fn table(&self) -> &Table {
        &self.table
    }

    /// How large each looks \[m\], the mean of its readings.
    pub fn diameters_m(&self) -> &[f64] {
        &self.diameters_m
    }

    /// How many readings of each there are.
    pub fn readings(&self) -> &[u32] {
        &self.readings
    }

    /// Where a rock is thought to be \[m\].
    pub fn position_m(&self, index: usize) -> [f64; 2] {
        let row = self.table.row(index);
        [row[POSITION_AT], row[POSITION_AT + 1]]
    }

    /// Whether there is a spectrum of a rock.
    pub fn has_spectrum(&self, index: usize) -> bool {
        self.table.noise(index)[0].is_finite()
    }

    /// Whether there is an image of a rock.
    pub fn has_image(&self, index: usize) -> bool {
        self.table.noise(index)[TEXTURE_AT].is_finite()
    }
}
