//! What a rover knows of the field: its rocks, pooled, and their classes, learnt.

use super::mixture::{Fit, FitSettings, MixtureError, fit};
use super::reading::Row;
use super::rocks::Rocks;
use super::scores::{hard, posterior_entropy};

/// Rocks and what was learnt of them.
///
/// ```
/// use farside_misus::analysis::learned::Learned;
/// use farside_misus::analysis::mixture::FitSettings;
/// use farside_misus::analysis::reading::{Reading, ReadingId, Row};
/// let rows = [3, 8].map(|rock| Row {
///     id: ReadingId { ordinal: rock, ..ReadingId::default() },
///     version: 1,
///     reading: Reading { rock, ..Reading::default() },
/// });
/// let learned = Learned::from_rows(&rows, &FitSettings::default())?;
/// assert_eq!(learned.classes(), 1);
/// assert_eq!(learned.class_of(8), Some((0, 1.0)));
/// assert_eq!(learned.class_of(5), None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Learned {
    /// The rocks that somebody has read.
    pub rocks: Rocks,
    /// Their classes.
    pub fit: Fit,
}

impl Learned {
    /// Pools readings and learns the classes. Pass rows in the order of their ids, as
    /// [`super::exchange::Exchange::rows`] gives them: rovers with equal rows then have bit-equal
    /// models.
    ///
    /// # Errors
    /// When there are no rows, or a setting is out of its range.
    pub fn from_rows<'a>(
        rows: impl IntoIterator<Item = &'a Row>,
        settings: &FitSettings,
    ) -> Result<Learned, MixtureError> {
        let rocks = Rocks::pool(rows);
        let fit = fit(rocks.table(), settings)?;
        Ok(Learned { rocks, fit })
    }

    /// How many classes were found.
    pub fn classes(&self) -> usize {
        self.fit.mixture.classes()
    }

    /// The probabilities of the classes of a rock by its place among [`Learned::rocks`].
    ///
    /// # Panics
    /// When there is no such rock.
    pub fn probabilities(&self, index: usize) -> &[f64] {
        let classes = self.classes();
        &self.fit.responsibilities[index * classes..(index + 1) * classes]
    }

    /// The most probable class of each rock, in the order of [`Learned::rocks`].
    pub fn hard_classes(&self) -> Vec<usize> {
        hard(&self.fit.responsibilities, self.classes())
    }

    /// The most probable class of a rock by its number in the catalogue, and how probable it is.
    pub fn class_of(&self, number: u32) -> Option<(usize, f64)> {
        let probabilities = self.probabilities(self.rocks.index_of(number)?);
        let class = hard(probabilities, self.classes())[0];
        Some((class, probabilities[class]))
    }

    /// The mean entropy of the rocks' class probabilities \[nat\].
    pub fn posterior_entropy(&self) -> f64 {
        posterior_entropy(&self.fit.responsibilities, self.classes())
    }
}
