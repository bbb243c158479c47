//! What the spectrum of each rock is worth, and the best rocks one after the other.
//!
//! For the distribution of classes the value of a rock is
//!
//! ```text
//! q = (H / (2 ln K) + 1 / (1 + Σ κ)) (1/2 + Σ_k p_k / sqrt(1 + N_k))
//! ```
//!
//! with the probabilities `p_k` of its class, their entropy `H`, the number of classes `K`, the number
//! `N_k` of rocks of each class measured or chosen, and `κ` a Gaussian kernel on what is cheap to know,
//! texture and position, summed over rocks measured or chosen. The first factor says how little is
//! known of the rock, the second how rare its kind is. The `p_k` of a rock without a spectrum are
//! those of measured ones like it, weighted by `κ`.
//!
//! For a mineral it is the expected improvement on the richest rock measured, less where rocks like
//! it were chosen before; for the process the
//! information of the rock's class about the story, times novelty (`1 / (1 + Σ κ)`).

use farside::random::RandomKey;

use super::PrioritiserSettings;
use crate::analysis::learned::Learned;
use crate::analysis::objective::{MineralGauge, Objective, StoryBelief};
use crate::analysis::rocks::{POSITION_AT, TEXTURE_AT};
use crate::analysis::scores::hard;

/// A rock that was chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Its place among the rocks.
    pub index: usize,
    /// What its spectrum is worth once those chosen before it are had, over 0.
    pub value: f64,
    /// Its most probable class.
    pub class: usize,
}

/// How much of the field's own shares of classes is in what is expected of a rock.
const PRIOR_WEIGHT: f64 = 0.1;

/// How many rocks as the library leads to expect are in what is expected of a class.
const PRIOR_ROCKS: f64 = 0.5;

/// The best rocks without a good spectrum, at most `count`, the best first. Each is the best after
/// those before it are had.
///
/// ```
/// use farside_misus::analysis::learned::Learned;
/// use farside_misus::analysis::mixture::FitSettings;
/// use farside_misus::analysis::objective::Objective;
/// use farside_misus::analysis::prioritise::{PrioritiserSettings, rank};
/// use farside_misus::analysis::reading::{Reading, ReadingId, Row};
/// // Rocks of which only places are known: two side by side, one far away.
/// let rows = [0.0, 1.0, 60.0].map(|east| Row {
///     id: ReadingId { ordinal: east as u32, ..ReadingId::default() },
///     version: 1,
///     reading: Reading { rock: east as u32, position_m: [east, 0.0], ..Reading::default() },
/// });
/// let learned = Learned::from_rows(&rows, &FitSettings::default())?;
/// let picks = rank(&learned, Objective::Distribution, &PrioritiserSettings::default(), 3);
/// let order: Vec<usize> = picks.iter().map(|pick| pick.index).collect();
/// assert_eq!(order, [0, 2, 1]); // the second of the pair says little once the first is had
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn rank(
    learned: &Learned,
    objective: Objective,
    settings: &PrioritiserSettings,
    count: usize,
) -> Vec<Pick> {
    let mut state = State::of(learned, settings);
    let gains = Gains::of(&state, learned, objective);
    let mut picks: Vec<Pick> = Vec::new();
    let mut is_open: Vec<bool> = (0..learned.rocks.len())
        .map(|index| !settings.is_measured(learned, index))
        .collect();
    while picks.len() < count {
        let open = (0..is_open.len()).filter(|&index| is_open[index]);
        let values = open.map(|index| (gains.value(&state, index), index));
        let best = values.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let Some((value, index)) = best else { break };
        is_open[index] = false;
        picks.push(Pick {
            index,
            value: value.max(1.0e-6),
            class: hard(state.probabilities(index), state.classes)[0],
        });
        state.have(index);
    }
    picks
}

/// What each rock is worth for the distribution of classes, before anything is chosen.
pub(super) fn first_values(learned: &Learned, settings: &PrioritiserSettings) -> Vec<f64> {
    let state = State::of(learned, settings);
    let all = 0..learned.rocks.len();
    all.map(|index| state.distribution(index)).collect()
}

/// What is known, and what is chosen so far.
struct State {
    classes: usize,
    rocks: usize,
    /// `κ` of each pair of rocks.
    kernel: Vec<f64>,
    /// How far each rock's spectrum is known, 0 to 1.
    known: Vec<f64>,
    /// `Σ κ` for each rock.
    covered: Vec<f64>,
    /// `p_k` for each rock.
    probabilities: Vec<f64>,
    /// `N_k`.
    counts: Vec<f64>,
}

impl State {
    fn of(learned: &Learned, settings: &PrioritiserSettings) -> State {
        let (rocks, classes) = (learned.rocks.len(), learned.classes());
        let kernel = kernel(learned, settings);
        let good = settings.good_spectrum_sd * settings.good_spectrum_sd;
        let known: Vec<f64> = (0..rocks)
            .map(|index| {
                let noise = learned.rocks.table().noise(index)[0];
                (good / noise.max(good)).min(1.0)
            })
            .collect();
        let mut state = State {
            classes,
            rocks,
            kernel,
            known,
            covered: vec![0.0; rocks],
            probabilities: vec![0.0; rocks * classes],
            counts: vec![0.0; classes],
        };
        for index in 0..rocks {
            let row = &state.kernel[index * rocks..(index + 1) * rocks];
            let weights = || {
                row.iter()
                    .zip(&state.known)
                    .map(|(kappa, known)| kappa * known)
            };
            state.covered[index] = weights().sum();
            let out = &mut state.probabilities[index * classes..(index + 1) * classes];
            let own = learned.probabilities(index);
            let known = state.known[index];
            let shares = learned.fit.mixture.weights();
            let mut total = PRIOR_WEIGHT;
            for (out, share) in out.iter_mut().zip(shares) {
                *out = PRIOR_WEIGHT * share;
            }
            for (other, weight) in weights().enumerate() {
                total += weight;
                for (out, p) in out.iter_mut().zip(learned.probabilities(other)) {
                    *out += weight * p;
                }
            }
            for ((out, own), count) in out.iter_mut().zip(own).zip(&mut state.counts) {
                *out = known * own + (1.0 - known) * *out / total;
                *count += known * own;
            }
        }
        state
    }

    fn probabilities(&self, index: usize) -> &[f64] {
        &self.probabilities[index * self.classes..(index + 1) * self.classes]
    }

    /// The spectrum of a rock will be had.
    fn have(&mut self, index: usize) {
        let more = 1.0 - self.known[index];
        self.known[index] = 1.0;
        let row = &self.kernel[index * self.rocks..(index + 1) * self.rocks];
        for (covered, kappa) in self.covered.iter_mut().zip(row) {
            *covered += more * kappa;
        }
        let at = index * self.classes;
        for (class, count) in self.counts.iter_mut().enumerate() {
            *count += more * self.probabilities[at + class];
        }
    }

    fn novelty(&self, index: usize) -> f64 {
        1.0 / (1.0 + self.covered[index])
    }

    /// `q`.
    fn distribution(&self, index: usize) -> f64 {
        let p = self.probabilities(index);
        let doubt = match self.classes {
            1 => 0.0,
            classes => entropy(p) / (2.0 * libm::log(classes as f64)),
        };
        let rare = p
            .iter()
            .zip(&self.counts)
            .map(|(p, count)| p / (1.0 + count).sqrt());
        (doubt + self.novelty(index)) * (0.5 + rare.sum::<f64>())
    }
}

fn entropy(p: &[f64]) -> f64 {
    p.iter()
        .map(|&p| if p > 0.0 { -p * libm::log(p) } else { 0.0 })
        .sum()
}

/// `κ` of each pair of rocks; what one of both lacks does not count.
fn kernel(learned: &Learned, settings: &PrioritiserSettings) -> Vec<f64> {
    let table = learned.rocks.table();
    let rocks = table.len();
    let scale: Vec<f64> = (TEXTURE_AT..table.columns())
        .map(|column| {
            if column >= POSITION_AT {
                return 1.0 / settings.position_kernel_m;
            }
            let variance = table.moments(column).map_or(0.0, |(_, variance)| variance);
            // Columns of one thing share its weight, however many they are.
            let columns = (POSITION_AT - TEXTURE_AT) as f64;
            1.0 / (settings.texture_kernel * (columns * variance).sqrt().max(1.0e-9))
        })
        .collect();
    let mut kernel = vec![1.0; rocks * rocks];
    for a in 0..rocks {
        for b in 0..a {
            let mut distance = 0.0;
            for (column, scale) in (TEXTURE_AT..).zip(&scale) {
                if table.noise(a)[column].is_finite() && table.noise(b)[column].is_finite() {
                    let difference = (table.row(a)[column] - table.row(b)[column]) * scale;
                    distance += difference * difference;
                }
            }
            let kappa = libm::exp(-0.5 * distance);
            kernel[a * rocks + b] = kappa;
            kernel[b * rocks + a] = kappa;
        }
    }
    kernel
}

/// What a rock is worth besides what [`State`] knows.
enum Gains<'a> {
    Distribution,
    /// The expected improvement of each rock, and how far rocks like it were known at first.
    Mineral(Vec<f64>, Vec<f64>),
    Process(&'a StoryBelief),
}

impl<'a> Gains<'a> {
    fn of(state: &State, learned: &Learned, objective: Objective<'a>) -> Gains<'a> {
        match objective {
            Objective::Distribution => Gains::Distribution,
            Objective::Mineral(gauge) => {
                Gains::Mineral(improvements(state, learned, gauge), state.covered.clone())
            }
            Objective::Process(belief) => Gains::Process(belief),
        }
    }

    fn value(&self, state: &State, index: usize) -> f64 {
        match self {
            Gains::Distribution => state.distribution(index),
            // Those chosen already may turn out to be the richest: of rocks like them fewer are needed.
            Gains::Mineral(improvements, covered) => {
                improvements[index] * (1.0 + covered[index]) / (1.0 + state.covered[index])
            }
            Gains::Process(belief) => belief.information(index) * state.novelty(index),
        }
    }
}

/// By which share equally good rocks may differ, so that one of them comes first.
const TIE: f64 = 1.0e-3;

/// How many rocks like it the class of a rock counts for, in what is expected of it.
const CLASS_ROCKS: f64 = 0.5;

/// The expected improvement of each rock on the richest one: `E max(0, f - best)` (D. Jones, M. Schonlau
/// and W. Welch, "Efficient global optimization", Journal of Global Optimization 13, 1998). What is
/// expected of a rock comes from its class and from rocks like it: the mean of the estimates of both,
/// weighted by the probability of the class and by `κ`. The less is known of rocks like it, the
/// wider the fraction may lie, so a rock in a part of the field that nobody knows is worth a look.
fn improvements(state: &State, learned: &Learned, gauge: &MineralGauge) -> Vec<f64> {
    let estimates: Vec<Option<f64>> = gauge
        .estimates(&learned.rocks)
        .into_iter()
        .map(|estimate| estimate.map(|estimate| gauge.believed(estimate).fraction))
        .collect();
    let best = estimates.iter().flatten().copied().fold(0.0, f64::max);
    let of_classes = class_estimates(learned, gauge, &estimates);
    let expected = |index: usize| {
        let (mut weight, mut mean, mut square) = (CLASS_ROCKS, 0.0, 0.0);
        for (p, [class_mean, class_sd]) in learned.probabilities(index).iter().zip(&of_classes) {
            mean += CLASS_ROCKS * p * class_mean;
            square += CLASS_ROCKS * p * (class_mean * class_mean + class_sd * class_sd);
        }
        let row = &state.kernel[index * state.rocks..(index + 1) * state.rocks];
        for (kappa, estimate) in row.iter().zip(&estimates) {
            if let Some(estimate) = estimate {
                weight += kappa;
                mean += kappa * estimate;
                square += kappa * estimate * estimate;
            }
        }
        mean /= weight;
        let spread = (square / weight - mean * mean).max(0.0);
        let sd = (spread + gauge.prior().sd * gauge.prior().sd / (1.0 + weight * weight)).sqrt();
        // Of equally good ones any, but all rovers the same: the first few would lie side by side.
        let any = RandomKey::new(u64::from(learned.rocks.numbers()[index])).text("any");
        improvement(mean, sd, best) * (1.0 + TIE * any.uniform())
    };
    (0..learned.rocks.len()).map(expected).collect()
}

/// Mean and standard deviation of the fraction in rocks of each class, by its rocks' estimates.
fn class_estimates(
    learned: &Learned,
    gauge: &MineralGauge,
    estimates: &[Option<f64>],
) -> Vec<[f64; 2]> {
    let prior = gauge.prior();
    let of_class = |class: usize| {
        let shares = || {
            let known = estimates.iter().enumerate();
            known.filter_map(|(index, e)| e.map(|e| (learned.probabilities(index)[class], e)))
        };
        let total: f64 = PRIOR_ROCKS + shares().map(|(share, _)| share).sum::<f64>();
        let sum: f64 = shares().map(|(share, estimate)| share * estimate).sum();
        let mean = (PRIOR_ROCKS * prior.fraction + sum) / total;
        let square = |x: f64| (x - mean) * (x - mean);
        let spread = shares().map(|(share, estimate)| share * square(estimate));
        let expected = PRIOR_ROCKS * (prior.sd * prior.sd + square(prior.fraction));
        [mean, ((expected + spread.sum::<f64>()) / total).sqrt()]
    };
    (0..learned.classes()).map(of_class).collect()
}

/// `E max(0, f - best)` of a normal `f`.
fn improvement(mean: f64, sd: f64, best: f64) -> f64 {
    let sd = sd.max(1.0e-6);
    let z = (mean - best) / sd;
    let density = libm::exp(-0.5 * z * z) / (2.0 * std::f64::consts::PI).sqrt();
    let below = 0.5 * libm::erfc(-z / std::f64::consts::SQRT_2);
    sd * (z * below + density)
}
