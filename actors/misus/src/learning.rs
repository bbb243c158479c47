//! What a rover makes of the readings that it knows: classes of rock, and what it thinks of each rock
//! of the catalogue. A function of the readings alone, so that rovers that know the same think the
//! same.

use farside_worlds::geology::StoryKind;

use crate::analysis::learned::Learned;
use crate::analysis::mixture::{Fit, FitSettings};
use crate::analysis::objective::{Objective as Analysed, Stories, StoryBelief, StorySettings};
use crate::analysis::prioritise::{PrioritiserSettings, rank};
use crate::analysis::reading::{Origin, Reading, ReadingId, Row};
use crate::analysis::rocks::Rocks;
use crate::config::Objective;
use crate::messages::{FieldModel, RockLabel, StoryProbability};
use crate::site::Site;

/// How sure the catalogue is of where a rock lies \[m\].
const CATALOGUE_SD_M: f32 = 0.1;

/// Stories to weigh, for a field of this side \[m\].
pub(crate) fn stories(side_m: f64) -> Stories {
    Stories::new(StorySettings {
        side_m,
        ..StorySettings::default()
    })
}

/// What was learnt of some readings.
pub(crate) struct Lesson {
    /// Of the rocks that were read.
    read: Learned,
    /// Of all rocks of the catalogue, in the order of their numbers: of those that nobody has read,
    /// from their place alone.
    whole: Learned,
    story: StoryBelief,
}

impl Lesson {
    /// Learns from readings in the order of their ids; none if there are none.
    pub(crate) fn of<'a>(
        site: &Site,
        stories: &mut Stories,
        rows: impl Iterator<Item = &'a Row> + Clone,
    ) -> Option<Lesson> {
        let settings = FitSettings {
            max_classes: site.config.max_classes as usize,
            ..FitSettings::default()
        };
        // Settings are in their ranges: the one error left is that there are no rocks.
        let read = Learned::from_rows(rows.clone(), &settings).ok()?;
        let unread = unread(site, |rock| read.rocks.index_of(rock).is_some());
        let known: Vec<&Row> = rows.collect();
        let rocks = Rocks::pool(known.into_iter().chain(&unread));
        let responsibilities = read.fit.mixture.responsibilities(rocks.table()).ok()?;
        let fit = Fit {
            responsibilities,
            ..read.fit.clone()
        };
        let whole = Learned { rocks, fit };
        let story = stories.weigh(&whole);
        Some(Lesson { read, whole, story })
    }

    /// What is thought of all rocks of the catalogue.
    pub(crate) fn learned(&self) -> &Learned {
        &self.whole
    }

    /// What the team wants to find out.
    pub(crate) fn objective<'a>(&'a self, site: &'a Site) -> Analysed<'a> {
        match (site.config.objective, &site.tools.gauge) {
            (Objective::Mineral, Some(gauge)) => Analysed::Mineral(gauge),
            (Objective::Process, _) => Analysed::Process(&self.story),
            // A mineral that the library does not know is refused before the run.
            (Objective::Distribution | Objective::Mineral, _) => Analysed::Distribution,
        }
    }

    /// Of some rocks the one whose spectrum is worth most; none if all have a good one.
    pub(crate) fn most_wanted(&self, site: &Site, of: &[u32]) -> Option<u32> {
        let settings = PrioritiserSettings::default();
        let all = self.whole.rocks.len();
        let picks = rank(&self.whole, self.objective(site), &settings, all);
        let rocks = picks
            .iter()
            .map(|pick| self.whole.rocks.numbers()[pick.index]);
        rocks.into_iter().find(|rock| of.contains(rock))
    }

    /// What a rover records of it.
    pub(crate) fn model(&self, site: &Site, readings: usize, stops: u32) -> FieldModel {
        let classes = self.whole.classes();
        let rocks: Vec<RockLabel> = (0..self.whole.rocks.len())
            .map(|rock| self.label(rock))
            .collect();
        let share = |class| {
            let of_class = self.whole.fit.responsibilities.iter().skip(class);
            of_class.step_by(classes).sum::<f64>() / rocks.len().max(1) as f64
        };
        let spectra = (0..self.read.rocks.len()).filter(|at| self.read.rocks.has_spectrum(*at));
        let richest = site.tools.gauge.as_ref();
        let richest = richest.and_then(|gauge| gauge.richest(&self.whole.rocks));
        FieldModel {
            stops,
            readings: readings as u32,
            rocks_read: self.read.rocks.len() as u32,
            rocks_with_spectrum: spectra.count() as u32,
            classes: classes as u32,
            log_likelihood: self.read.fit.chosen.log_likelihood,
            objective: self.read.fit.chosen.objective,
            posterior_entropy: self.read.posterior_entropy(),
            proportions: (0..classes).map(share).collect(),
            rocks,
            richest: richest.map(|at| self.whole.rocks.numbers()[at]),
            stories: probabilities(&self.story),
        }
    }

    /// What is thought of a rock of the catalogue.
    fn label(&self, rock: usize) -> RockLabel {
        let probabilities = self.whole.probabilities(rock);
        let best = |best: usize, class: usize| match probabilities[class] > probabilities[best] {
            true => class,
            false => best,
        };
        let class = (1..probabilities.len()).fold(0, best);
        RockLabel {
            class: class as u32,
            confidence: probabilities[class] as f32,
            image: self.whole.rocks.has_image(rock),
            spectrum: self.whole.rocks.has_spectrum(rock),
        }
    }
}

fn probabilities(story: &StoryBelief) -> Vec<StoryProbability> {
    let all = story.kinds().iter().zip(story.probabilities());
    let one = |(kind, &probability): (&StoryKind, &f64)| StoryProbability {
        story: kind.name().to_owned(),
        probability,
    };
    all.map(one).collect()
}

/// What is thought of all rocks before anybody has read one: nothing but where they lie. None if there are no
/// rocks.
pub(crate) fn first_guess(site: &Site) -> Option<Learned> {
    let settings = FitSettings {
        max_classes: 1,
        ..FitSettings::default()
    };
    Learned::from_rows(&unread(site, |_| false), &settings).ok()
}

/// What the catalogue alone says of rocks that nobody has read.
fn unread(site: &Site, is_read: impl Fn(u32) -> bool) -> Vec<Row> {
    let rocks = (0..).zip(&site.catalogue);
    let unread = rocks.filter(|(number, _)| !is_read(*number));
    let row = |(number, rock): (u32, &farside_worlds::rock_field::FieldRock)| Row {
        id: ReadingId {
            // Nobody's: these rows are never exchanged.
            origin: Origin {
                rover: u32::MAX,
                incarnation: 0,
            },
            ordinal: number,
        },
        version: 1,
        reading: Reading {
            rock: number,
            position_m: [rock.position_m.x as f32, rock.position_m.y as f32],
            position_sd_m: CATALOGUE_SD_M,
            diameter_m: rock.diameter_m as f32,
            ..Reading::default()
        },
    };
    unread.map(row).collect()
}
