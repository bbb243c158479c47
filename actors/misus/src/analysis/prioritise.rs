//! From what is known to what to look at next: goals, their weights, and combinations of goals.
//!
//! Every rock that has no good spectrum yet has a value ([`rank`]); the best become goals, one after
//! the other, since each changes what the next is worth. Their weights are these values. For each
//! rock chosen there is a goal for its spectrum and, if there is no good image of it, one for its
//! image; squares of ground with several rocks that lack something have goals for panoramas.
//! Combinations, with the factors of the paper's Table 2 where it has them:
//!
//! | goals | factor | why |
//! |---|---|---|
//! | close image and spectrum of one rock | 1.25 | the paper's B and C |
//! | panoramic image of a square and the spectrum of a rock in it | 2.25 | the paper's A and C: the panorama says how much of the square is like it |
//! | panoramic image and spectrum of one square | 1.75 | both of the same rocks |
//! | spectra of two rocks of one class, far from each other | 0.5 | whether a class is one over the whole field |
//!
//! A goal is named by what is done to what, so the same wish has the same name at all times and on
//! all rovers; [`Prioritiser::revise`] says what has been added, changed and withdrawn.

mod rank;

use super::goals::{Goal, GoalId, Observation, Revision, Target, Wishes};
use super::learned::Learned;
use super::objective::Objective;
use super::rocks::TEXTURE_AT;

pub use rank::{Pick, rank};

/// The factor of a close image and a spectrum of one rock (Table 2, B and C).
const IMAGE_AND_SPECTRUM: f64 = 1.25;
/// The factor of a panoramic image and the spectrum of a rock in it (Table 2, A and C).
const PANORAMA_AND_SPECTRUM: f64 = 2.25;
/// The factor of both panoramas of a square.
const BOTH_PANORAMAS: f64 = 1.75;
/// The factor of the spectra of two rocks of one class, far from each other.
const SAME_CLASS: f64 = 0.5;
/// What a close image is worth beside the spectrum of the same rock.
const IMAGE_SHARE: f64 = 0.5;
/// What a panorama is worth for each rock in it beside a close observation of that rock.
const PANORAMA_SHARE: f64 = 0.15;
/// How many rocks a square needs for a panorama.
const PANORAMA_ROCKS: usize = 2;

/// How goals are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrioritiserSettings {
    /// How many rocks are wished for at a time, at least 1.
    pub rocks: usize,
    /// How many squares are wished for at a time.
    pub squares: usize,
    /// The side of a square \[m\], over 0.
    pub square_m: f64,
    /// Within how many standard deviations of the field's textures rocks are alike; over 0.
    pub texture_kernel: f64,
    /// Within which distance rocks are alike \[m\], over 0.
    pub position_kernel_m: f64,
    /// The noise of a rock's spectral features \[standard deviation\] up to which its spectrum is good.
    pub good_spectrum_sd: f64,
    /// The noise of a rock's textural features \[standard deviation\] up to which its image is good.
    pub good_image_sd: f64,
    /// By which share of itself a weight has to change to be told.
    pub least_change: f64,
}

impl Default for PrioritiserSettings {
    fn default() -> PrioritiserSettings {
        PrioritiserSettings {
            rocks: 12,
            squares: 6,
            square_m: 15.0,
            texture_kernel: 0.5,
            position_kernel_m: 15.0,
            good_spectrum_sd: 0.05,
            good_image_sd: 0.05,
            least_change: 0.1,
        }
    }
}

impl PrioritiserSettings {
    /// Whether the spectrum of a rock is as good as one needs.
    pub(crate) fn is_measured(&self, learned: &Learned, index: usize) -> bool {
        let sd = self.good_spectrum_sd;
        learned.rocks.table().noise(index)[0] <= sd * sd
    }

    /// Whether the image of a rock is as good as one needs.
    fn is_imaged(&self, learned: &Learned, index: usize) -> bool {
        let sd = self.good_image_sd;
        learned.rocks.table().noise(index)[TEXTURE_AT] <= sd * sd
    }
}

/// Keeps what is wished for.
#[derive(Clone, Debug, Default)]
pub struct Prioritiser {
    settings: PrioritiserSettings,
    wishes: Wishes,
}

impl Prioritiser {
    /// Nothing is wished for yet.
    pub fn new(settings: PrioritiserSettings) -> Prioritiser {
        Prioritiser {
            settings,
            wishes: Wishes::default(),
        }
    }

    /// What is wished for now.
    pub fn wishes(&self) -> &Wishes {
        &self.wishes
    }

    /// Wishes anew by what is known now, and says what is different. Two rovers that know the same and
    /// wished the same before wish the same.
    pub fn revise(&mut self, learned: &Learned, objective: Objective) -> Revision {
        let wanted = wanted(learned, objective, &self.settings);
        let revision = self.wishes.revision_to(&wanted, self.settings.least_change);
        self.wishes.apply(&revision);
        revision
    }
}

/// All goals and combinations that what is known leads to.
fn wanted(learned: &Learned, objective: Objective, settings: &PrioritiserSettings) -> Wishes {
    let picks = rank(learned, objective, settings, settings.rocks);
    let mut wishes = Wishes::default();
    for pick in &picks {
        wish_for_rock(&mut wishes, learned, settings, pick);
    }
    pair_classes(&mut wishes, learned, settings, &picks);
    wish_for_squares(&mut wishes, learned, settings, &picks);
    wishes
}

fn add(wishes: &mut Wishes, id: GoalId, position_m: [f64; 2], weight: f64) {
    let goal = Goal {
        id,
        position_m,
        weight,
    };
    wishes.goals.insert(id, goal);
}

fn combine(wishes: &mut Wishes, mut goals: Vec<GoalId>, factor: f64) {
    goals.sort_unstable();
    wishes.combinations.insert(goals, factor);
}

fn at_rock(learned: &Learned, index: usize, observation: Observation) -> GoalId {
    GoalId {
        target: Target::Rock(learned.rocks.numbers()[index]),
        observation,
    }
}

fn wish_for_rock(
    wishes: &mut Wishes,
    learned: &Learned,
    settings: &PrioritiserSettings,
    pick: &Pick,
) {
    let position_m = learned.rocks.position_m(pick.index);
    let spectrum = at_rock(learned, pick.index, Observation::PointSpectrum);
    add(wishes, spectrum, position_m, pick.value);
    if !settings.is_imaged(learned, pick.index) {
        let image = at_rock(learned, pick.index, Observation::PointImage);
        add(wishes, image, position_m, IMAGE_SHARE * pick.value);
        combine(wishes, vec![image, spectrum], IMAGE_AND_SPECTRUM);
    }
}

/// For each class the two best picks that are far from each other.
fn pair_classes(
    wishes: &mut Wishes,
    learned: &Learned,
    settings: &PrioritiserSettings,
    picks: &[Pick],
) {
    for class in 0..learned.classes() {
        let mut of_class = picks.iter().filter(|pick| pick.class == class);
        let Some(first) = of_class.next() else {
            continue;
        };
        let is_far = |pick: &&Pick| {
            let [a, b] = [first, pick].map(|pick| learned.rocks.position_m(pick.index));
            libm::hypot(a[0] - b[0], a[1] - b[1]) > 2.0 * settings.position_kernel_m
        };
        if let Some(second) = of_class.find(is_far) {
            let goals = [first, second]
                .map(|pick| at_rock(learned, pick.index, Observation::PointSpectrum));
            combine(wishes, goals.to_vec(), SAME_CLASS);
        }
    }
}

/// A square of ground and what its rocks lack.
struct Square {
    target: Target,
    /// What its rocks without a good image are worth, and how many they are.
    image: (f64, usize),
    /// The same of spectra.
    spectrum: (f64, usize),
}

fn wish_for_squares(
    wishes: &mut Wishes,
    learned: &Learned,
    settings: &PrioritiserSettings,
    picks: &[Pick],
) {
    let side_m = settings.square_m;
    let square_of = |index: usize| {
        let [column, row] = learned
            .rocks
            .position_m(index)
            .map(|x| (x / side_m).floor() as i32);
        Target::Square(column, row)
    };
    let mut squares: std::collections::BTreeMap<Target, Square> = std::collections::BTreeMap::new();
    let first = rank::first_values(learned, settings);
    for (index, value) in first.into_iter().enumerate() {
        let target = square_of(index);
        let square = squares.entry(target).or_insert(Square {
            target,
            image: (0.0, 0),
            spectrum: (0.0, 0),
        });
        if !settings.is_imaged(learned, index) {
            square.image.0 += value;
            square.image.1 += 1;
        }
        if !learned.rocks.has_spectrum(index) {
            square.spectrum.0 += value;
            square.spectrum.1 += 1;
        }
    }
    let mut squares: Vec<Square> = squares.into_values().collect();
    let worth = |square: &Square| square.image.0 + square.spectrum.0;
    squares.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
    for square in squares.iter().take(settings.squares) {
        let Target::Square(column, row) = square.target else {
            continue;
        };
        let position_m = [column, row].map(|i| (f64::from(i) + 0.5) * side_m);
        let [image, spectrum] =
            [Observation::PanoramicImage, Observation::PanoramicSpectrum].map(|observation| {
                GoalId {
                    target: square.target,
                    observation,
                }
            });
        let lacks = |(_, rocks): (f64, usize)| rocks >= PANORAMA_ROCKS;
        if lacks(square.spectrum) {
            add(
                wishes,
                spectrum,
                position_m,
                PANORAMA_SHARE * square.spectrum.0,
            );
        }
        if lacks(square.image) {
            add(wishes, image, position_m, PANORAMA_SHARE * square.image.0);
            if lacks(square.spectrum) {
                combine(wishes, vec![image, spectrum], BOTH_PANORAMAS);
            }
            // One rock of the square is enough to tie it to.
            if let Some(pick) = picks
                .iter()
                .find(|pick| square_of(pick.index) == square.target)
            {
                let close = at_rock(learned, pick.index, Observation::PointSpectrum);
                combine(wishes, vec![image, close], PANORAMA_AND_SPECTRUM);
            }
        }
    }
}
