//! What speaks for and against stories: places, sizes and classes of rocks.

use nalgebra::Point2;

use super::Story;
use crate::rocks::Rock;

/// Rocks that speak for and against stories, each with the share that each class has in the belief
/// about it.
///
/// ```
/// use farside::random::RandomKey;
/// use farside_worlds::geology::Evidence;
/// use farside_worlds::{Rock, Story, StoryKind};
/// use nalgebra::Point2;
/// // Ten rocks in a row from west to east, the western five of one class, the others of the other.
/// let rock = |i: u32| Rock { position_m: Point2::new(8.0 * f64::from(i) - 36.0, 0.0), diameter_m: 0.5 };
/// let rocks: Vec<Rock> = (0..10).map(rock).collect();
/// let shares: Vec<f64> = (0..10).flat_map(|i| if i < 5 { [1.0, 0.0] } else { [0.0, 1.0] }).collect();
/// let evidence = Evidence::new(&rocks, 2, &shares);
/// let mut stream = RandomKey::new(7).stream();
/// let mut mean = |kind| {
///     let draws = (0..2000).map(|_| Story::draw(kind, 2, 100.0, &mut stream));
///     let likelihoods = draws.map(|story| libm::exp(story.log_likelihood(&evidence)));
///     likelihoods.sum::<f64>() / 2000.0
/// };
/// assert!(mean(StoryKind::Strata) > mean(StoryKind::Uniform));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Evidence {
    rocks: Vec<Rock>,
    classes: usize,
    shares: Vec<f64>,
    /// The normal score of each rock's diameter.
    scores: Vec<f64>,
}

impl Evidence {
    /// These rocks, with the shares of each class in the belief about each of them: rock by rock, all
    /// classes.
    ///
    /// # Panics
    /// When there are not as many shares as rocks times classes.
    pub fn new(rocks: &[Rock], classes: usize, shares: &[f64]) -> Evidence {
        assert_eq!(
            shares.len(),
            rocks.len() * classes,
            "a share for each rock and class"
        );
        let mut by_size: Vec<usize> = (0..rocks.len()).collect();
        by_size.sort_by(|&a, &b| rocks[a].diameter_m.total_cmp(&rocks[b].diameter_m));
        let mut scores = vec![0.0; rocks.len()];
        for (rank, &rock) in by_size.iter().enumerate() {
            // Blom's formula for the mean of a normal order statistic.
            let share = (rank as f64 + 0.625) / (rocks.len() as f64 + 0.25);
            scores[rock] = normal_quantile(share);
        }
        Evidence {
            rocks: rocks.to_vec(),
            classes,
            shares: shares.to_vec(),
            scores,
        }
    }
}

impl Story {
    /// How likely the story makes the classes and sizes of these rocks, given their places: the
    /// natural logarithm of a density. Sizes count by their ranks. Always finite.
    ///
    /// # Panics
    /// When the evidence is of another number of classes.
    pub fn log_likelihood(&self, evidence: &Evidence) -> f64 {
        assert_eq!(
            evidence.classes,
            self.classes(),
            "the classes of story and evidence"
        );
        let mut probabilities = vec![0.0; self.classes()];
        let mut sum = 0.0;
        for (rock, shares) in evidence
            .rocks
            .iter()
            .zip(evidence.shares.chunks_exact(evidence.classes))
        {
            self.class_probabilities(rock.position_m, rock.diameter_m, &mut probabilities);
            let seen: f64 = probabilities
                .iter()
                .zip(shares)
                .map(|(p, share)| p * share)
                .sum();
            // A class that cannot be here speaks against the story, however strongly, not forever.
            sum += libm::log(seen.max(1e-12));
        }
        sum + self.log_likelihood_of_sizes(evidence)
    }

    /// The density of the sizes' normal scores, given the trend, over their standard normal density.
    fn log_likelihood_of_sizes(&self, evidence: &Evidence) -> f64 {
        let correlation = self.size_correlation();
        if correlation == 0.0 {
            return 0.0;
        }
        let trends = self.standard_size_trends(evidence.rocks.iter().map(|rock| rock.position_m));
        let rest = 1.0 - correlation * correlation;
        let terms = trends.iter().zip(&evidence.scores).map(|(trend, score)| {
            let off = score - correlation * trend;
            0.5 * (score * score - off * off / rest - libm::log(rest))
        });
        terms.sum()
    }

    /// The trend of sizes at each place, with mean 0 and variance 1 over these places; all 0 where
    /// there is none.
    pub(crate) fn standard_size_trends(
        &self,
        positions_m: impl Iterator<Item = Point2<f64>>,
    ) -> Vec<f64> {
        let mut trends: Vec<f64> = positions_m
            .map(|position_m| self.size_trend(position_m))
            .collect();
        standardize(&mut trends);
        trends
    }
}

/// Brings values to mean 0 and variance 1; equal ones to 0.
fn standardize(values: &mut [f64]) {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares = values.iter().map(|value| (value - mean) * (value - mean));
    let deviation = libm::sqrt(squares.sum::<f64>() / count);
    let scale = if deviation > 1e-12 {
        1.0 / deviation
    } else {
        0.0
    };
    for value in values {
        *value = (*value - mean) * scale;
    }
}

/// The standard normal variable below which lies this share \[over 0, under 1\], to three digits (M.
/// Abramowitz and I. Stegun, *Handbook of Mathematical Functions*, 26.2.23).
fn normal_quantile(share: f64) -> f64 {
    let tail = share.min(1.0 - share);
    let t = libm::sqrt(-2.0 * libm::log(tail));
    let above = 2.515_517 + t * (0.802_853 + t * 0.010_328);
    let below = 1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308));
    let size = t - above / below;
    if share < 0.5 { -size } else { size }
}
