//! Which story laid the field: a posterior over stories from classes, places and sizes of rocks.
//!
//! A story's marginal likelihood is the mean of its likelihood over parameters that are drawn from
//! their prior. The draws have addresses ([`RandomKey`]), so all rovers draw the same.
//!
//! Learnt classes have no names that a story could know. The likelihood of a draw is therefore averaged
//! over all ways of matching learnt classes and the story's, one to one, all equally likely. With
//! the shares `r_ik` of learnt class `k` in rock `i`, a matching `π` has the likelihood
//! `Π_k exp(Σ_i r_ik log p(π(k) | place of i))`; the sum over all matchings is a permanent, and is found
//! exactly, over subsets. The best assignment alone would prefer stories that have many good ones.

use farside::random::RandomKey;
use farside_worlds::Rock;
use farside_worlds::geology::{Evidence, Story, StoryKind};
use nalgebra::Point2;

use crate::analysis::learned::Learned;

/// The most learnt classes that are told apart; rarer ones are left out.
const MAX_CLASSES: usize = 8;

/// The least probability that a story gives to a class anywhere: stories are simpler than ground.
const LEAST_PROBABILITY: f64 = 0.01;

/// How stories are weighed.
#[derive(Clone, Debug, PartialEq)]
pub struct StorySettings {
    /// The stories, all equally probable at first.
    pub kinds: Vec<StoryKind>,
    /// How many parameters are drawn for each, at least 1.
    pub draws: usize,
    /// The side of the square field \[m\], over 0.
    pub side_m: f64,
    /// What is drawn by.
    pub seed: u64,
}

impl Default for StorySettings {
    fn default() -> StorySettings {
        StorySettings {
            kinds: StoryKind::ALL[..4].to_vec(),
            draws: 400,
            side_m: 100.0,
            seed: 0,
        }
    }
}

/// Draws of stories, kept by the number of classes they are for.
#[derive(Clone, Debug)]
pub struct Stories {
    settings: StorySettings,
    /// By number of classes: all draws of the first story, of the second, ...
    drawn: Vec<Vec<Story>>,
}

/// What is believed of stories, and what that leads to expect of rocks.
#[derive(Clone, Debug, PartialEq)]
pub struct StoryBelief {
    kinds: Vec<StoryKind>,
    probabilities: Vec<f64>,
    classes: usize,
    /// For each rock and story the probability of each learnt class.
    expected: Vec<f64>,
}

impl Stories {
    /// Stories to weigh.
    pub fn new(settings: StorySettings) -> Stories {
        Stories {
            settings,
            drawn: vec![Vec::new(); MAX_CLASSES + 1],
        }
    }

    /// Draws the stories of a number of classes, if that was not done before.
    fn draw(&mut self, classes: usize) {
        if !self.drawn[classes].is_empty() {
            return;
        }
        let key = RandomKey::new(self.settings.seed).text("stories");
        for &kind in &self.settings.kinds {
            let key = key.text(kind.name()).number(classes as u64);
            for draw in 0..self.settings.draws.max(1) {
                let mut stream = key.number(draw as u64).stream();
                let story = Story::draw(kind, classes, self.settings.side_m, &mut stream);
                self.drawn[classes].push(story);
            }
        }
    }

    /// Weighs the stories by what was learnt. Only rocks with a spectrum speak.
    pub fn weigh(&mut self, learned: &Learned) -> StoryBelief {
        let kept = commonest(learned);
        let classes = kept.len();
        self.draw(classes);
        let rocks = &learned.rocks;
        let places: Vec<Rock> = (0..rocks.len())
            .map(|index| {
                let [east, north] = rocks.position_m(index);
                Rock {
                    position_m: Point2::new(east, north),
                    diameter_m: rocks.diameters_m()[index].max(0.01),
                }
            })
            .collect();
        let mut shares = vec![0.0; rocks.len() * classes];
        for (index, out) in shares.chunks_exact_mut(classes).enumerate() {
            if rocks.has_spectrum(index) {
                let all = learned.probabilities(index);
                for (out, &class) in out.iter_mut().zip(&kept) {
                    *out = all[class];
                }
            }
        }
        let field = Field {
            sizes: Evidence::new(&places, classes, &vec![1.0; shares.len()]),
            places,
            shares,
            classes,
        };
        belief(&self.settings, &self.drawn[classes], &field)
    }
}

/// The learnt classes of the largest shares, at most as many as are told apart, ascending.
fn commonest(learned: &Learned) -> Vec<usize> {
    let weights = learned.fit.mixture.weights();
    let mut classes: Vec<usize> = (0..weights.len()).collect();
    classes.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]));
    classes.truncate(MAX_CLASSES);
    classes.sort_unstable();
    classes
}

/// Rocks as stories see them.
struct Field {
    places: Vec<Rock>,
    shares: Vec<f64>,
    classes: usize,
    /// Evidence that tells nothing but sizes: of any class with certainty.
    sizes: Evidence,
}

fn belief(settings: &StorySettings, drawn: &[Story], field: &Field) -> StoryBelief {
    let (classes, rocks) = (field.classes, field.places.len());
    let stories = settings.kinds.len();
    let mut expected = vec![0.0; rocks * stories * classes];
    let mut evidence = Vec::with_capacity(stories);
    let mut probabilities = vec![0.0; rocks * classes];
    for (story, draws) in drawn.chunks_exact(settings.draws.max(1)).enumerate() {
        let mut weighed: Vec<(f64, Vec<f64>)> = Vec::with_capacity(draws.len());
        for draw in draws {
            fill_probabilities(draw, field, &mut probabilities);
            let matched = Matching::of(field, &probabilities);
            let log = matched.log_mean + draw.log_likelihood(&field.sizes);
            weighed.push((log, matched.classes));
        }
        let largest = weighed
            .iter()
            .map(|w| w.0)
            .fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = weighed.iter().map(|w| libm::exp(w.0 - largest)).sum();
        evidence.push(largest + libm::log(total / draws.len() as f64));
        for (draw, (log, matched)) in draws.iter().zip(&weighed) {
            let weight = libm::exp(log - largest) / total;
            if weight < 1.0e-3 {
                continue;
            }
            fill_probabilities(draw, field, &mut probabilities);
            for (rock, places) in probabilities.chunks_exact(classes).enumerate() {
                let at = (rock * stories + story) * classes;
                for learnt in 0..classes {
                    let by_class = &matched[learnt * classes..(learnt + 1) * classes];
                    let p: f64 = by_class.iter().zip(places).map(|(m, p)| m * p).sum();
                    expected[at + learnt] += weight * p;
                }
            }
        }
    }
    let largest = evidence.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = evidence
        .iter()
        .map(|log| libm::exp(log - largest))
        .collect();
    let total: f64 = weights.iter().sum();
    StoryBelief {
        kinds: settings.kinds.clone(),
        probabilities: weights.iter().map(|weight| weight / total).collect(),
        classes,
        expected,
    }
}

/// The probability of each of the story's classes for each rock.
fn fill_probabilities(story: &Story, field: &Field, out: &mut [f64]) {
    for (rock, out) in field.places.iter().zip(out.chunks_exact_mut(field.classes)) {
        story.class_probabilities(rock.position_m, rock.diameter_m, out);
        for p in out {
            *p = LEAST_PROBABILITY / field.classes as f64 + (1.0 - LEAST_PROBABILITY) * *p;
        }
    }
}

/// All ways to match learnt classes and those of a story.
struct Matching {
    /// The logarithm of the mean likelihood over all matchings.
    log_mean: f64,
    /// How probable it is that a learnt class is each of the story's, learnt class by learnt class.
    classes: Vec<f64>,
}

impl Matching {
    fn of(field: &Field, probabilities: &[f64]) -> Matching {
        let n = field.classes;
        let mut logs = vec![0.0; n * n];
        let rocks = field
            .shares
            .chunks_exact(n)
            .zip(probabilities.chunks_exact(n));
        for (shares, places) in rocks {
            if shares.iter().all(|&share| share == 0.0) {
                continue;
            }
            for (class, &p) in places.iter().enumerate() {
                let log = libm::log(p);
                for (learnt, share) in shares.iter().enumerate() {
                    logs[learnt * n + class] += share * log;
                }
            }
        }
        let mut shift = 0.0;
        for row in logs.chunks_exact_mut(n) {
            let largest = row.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            shift += largest;
            // What is less likely by e^80 in one class is as good as impossible, and a product of
            // all classes stays a number.
            row.iter_mut()
                .for_each(|log| *log = libm::exp((*log - largest).max(-80.0)));
        }
        // Sums over the matchings of the first learnt classes to each subset of the story's, and
        // of the last ones.
        let first = subsets(n, |learnt, class| logs[learnt * n + class]);
        let last = subsets(n, |learnt, class| logs[(n - 1 - learnt) * n + class]);
        let all = first[(1 << n) - 1];
        let mut classes = vec![0.0; n * n];
        for (subset, before) in first.iter().enumerate() {
            let learnt = subset.count_ones() as usize;
            for class in (0..n).filter(|class| learnt < n && subset & (1 << class) == 0) {
                let others = !(subset | (1 << class)) & ((1 << n) - 1);
                classes[learnt * n + class] +=
                    before * logs[learnt * n + class] * last[others] / all;
            }
        }
        let ways: f64 = (1..=n).map(|i| i as f64).product();
        Matching {
            log_mean: shift + libm::log(all / ways),
            classes,
        }
    }
}

/// For each subset of `n` classes the sum over all matchings of the first rows to it.
fn subsets(n: usize, entry: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let mut sums = vec![0.0; 1 << n];
    sums[0] = 1.0;
    for subset in 1usize..1 << n {
        let row = subset.count_ones() as usize - 1;
        let within = (0..n).filter(|class| subset & (1 << class) != 0);
        sums[subset] = within
            .map(|c| sums[subset & !(1 << c)] * entry(row, c))
            .sum();
    }
    sums
}

impl StoryBelief {
    /// The stories.
    pub fn kinds(&self) -> &[StoryKind] {
        &self.kinds
    }

    /// How probable each is; they sum to 1.
    pub fn probabilities(&self) -> &[f64] {
        &self.probabilities
    }

    /// The logarithm of the probability of a story, at least that of 1e-6; 0 is best. For metrics.
    pub fn log_score(&self, truth: StoryKind) -> f64 {
        let at = self.kinds.iter().position(|&kind| kind == truth);
        libm::log(at.map_or(0.0, |at| self.probabilities[at]).max(1.0e-6))
    }

    /// What the class of a rock would tell of the story \[nat\]: the mutual information of both.
    ///
    /// # Panics
    /// When there is no such rock.
    pub fn information(&self, rock: usize) -> f64 {
        let stories = self.kinds.len();
        let at = rock * stories * self.classes;
        let expected = &self.expected[at..at + stories * self.classes];
        let mut mean = vec![0.0; self.classes];
        let mut within = 0.0;
        for (&p, classes) in self
            .probabilities
            .iter()
            .zip(expected.chunks_exact(self.classes))
        {
            let total: f64 = classes.iter().sum();
            for (mean, class) in mean.iter_mut().zip(classes) {
                *mean += p * class / total;
            }
            within += p * entropy(classes.iter().map(|class| class / total));
        }
        (entropy(mean.into_iter()) - within).max(0.0)
    }
}

fn entropy(probabilities: impl Iterator<Item = f64>) -> f64 {
    probabilities
        .map(|p| if p > 0.0 { -p * libm::log(p) } else { 0.0 })
        .sum()
}
