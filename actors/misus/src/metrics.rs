//! What a run of MISUS amounts to: how well the classes of rocks were learnt, and at what cost.

mod catalogue;

use std::collections::BTreeMap;
use std::sync::{Mutex, OnceLock, PoisonError};

use farside::SimTime;
use farside_actors::rover::{RoverEnergy, RoverPose};
use farside_actors::system::{Metric, Results, Series, with_about};
use farside_worlds::RockField;
use farside_worlds::sky::SOL_S;
use serde::Serialize;

use crate::analysis::objective::regret;
use crate::analysis::scores::{adjusted_rand_index, distribution_error};
use crate::config::LearnConfig;
use crate::messages::FieldModel;
use crate::monitor::{RoverHistory, Tally};

/// What runs can be measured by, each with what its field says.
pub(crate) fn all() -> &'static [Metric] {
    static ALL: OnceLock<Vec<Metric>> = OnceLock::new();
    ALL.get_or_init(|| with_about(&catalogue::ALL, MisusMetrics::about))
}

farside_actors::documented! {
    /// What came of a run.
    #[derive(Clone, Debug, Default, Serialize)]
    pub struct MisusMetrics {
        /// How well the classes that rovers learnt match those that there are: the adjusted Rand index
        /// over all rocks of which some rover took a spectrum, mean over rovers. A rover that knows no
        /// reading of such a rock tells its class from its place.
        pub class_ari: Option<f64>,
        /// The same of the rover for which it is least.
        pub class_ari_least: Option<f64>,
        /// The same as `class_ari` over all rocks of the field, read or not, mean over rovers: how well
        /// a team knows the whole field.
        pub field_ari: Option<f64>,
        /// How many classes rovers tell apart, mean over rovers.
        pub k: Option<f64>,
        /// Whether all rovers tell equally many classes apart.
        pub k_agrees: bool,
        /// How far the learnt shares of the classes are from the true ones over the whole field: the
        /// total variation distance after the best assignment of learnt classes to true ones, mean over
        /// rovers; 0 is perfect.
        pub distribution_error: Option<f64>,
        /// The mean entropy of the class of a rock that was read, mean over rovers \[nat\].
        pub posterior_entropy: Option<f64>,
        /// The log-likelihood of the readings under the learnt classes, mean over rovers.
        pub log_likelihood: Option<f64>,
        /// The objective function, which learning maximises: the penalised log-likelihood, mean over
        /// rovers.
        pub objective: Option<f64>,
        /// Readings that a rover knows at the end, its own and those of others, mean over rovers.
        pub readings: f64,
        /// By how much the rock that rovers name falls short of the richest in the mineral of
        /// `learn.mineral`: the best true fraction less that of the rock named, mean over rovers.
        pub regret: Option<f64>,
        /// The logarithm of how likely rovers think the true story is, at least that of 1e-6, mean over
        /// rovers; 0 is best. None where no story laid the field (`uniform`).
        pub log_score: Option<f64>,
        /// `field_ari` over the course of the tours: its mean over the numbers of rocks that a rover has
        /// been to, from one on. Only with `learn.learn_at_stops`; so are the next two.
        pub field_ari_area: Option<f64>,
        /// `regret` over the course of the tours.
        pub regret_area: Option<f64>,
        /// `log_score` over the course of the tours.
        pub log_score_area: Option<f64>,
        /// Rocks of which some rover took a spectrum.
        pub rocks_read: u32,
        /// Rocks that rovers set out for.
        pub stops: u32,
        /// Messages of the exchange of readings.
        pub exchange_messages: u64,
        /// Their bytes \[byte\].
        pub exchange_bytes: u64,
        /// How far rovers went, all together \[m\].
        pub distance_m: f64,
        /// How far rovers are at the end from where they believe to be, mean over rovers \[m\].
        pub position_error_m: Option<f64>,
        /// What the solar arrays yielded, all together \[Wh\].
        pub solar_wh: f64,
        /// What all parts of all rovers took \[Wh\].
        pub used_wh: f64,
        /// What was lost in charging, or yielded while the battery was full \[Wh\].
        pub unused_wh: f64,
        /// What the batteries hold at the end \[Wh\].
        pub stored_wh: f64,
        /// The greatest share of a rover's energy that was ever not accounted for: rounding, or a
        /// mistake of the simulator.
        pub energy_imbalance: f64,
        /// Faults that rovers had.
        pub faults: u32,
        /// How often a battery was down to the level at which all loads are cut off.
        pub brown_outs: u32,
    }
}

/// The least probability that counts in a score.
const LEAST_PROBABILITY: f64 = 1e-6;

/// All figures of a run.
pub(crate) struct Figures {
    metrics: MisusMetrics,
    over_sols: Series,
    /// How often each kind of fault came.
    faults: Vec<String>,
}

/// What came of a run that ended at `end`.
pub(crate) fn of(
    tally: &Mutex<Tally>,
    learn: &LearnConfig,
    field: &RockField,
    end: SimTime,
) -> Figures {
    let tally = tally.lock().unwrap_or_else(PoisonError::into_inner);
    let mut counts = BTreeMap::<&str, u32>::new();
    for name in tally.rovers.iter().flat_map(|rover| &rover.faults) {
        *counts.entry(name).or_default() += 1;
    }
    let faults = counts.iter().map(|(name, count)| match count {
        1 => (*name).to_owned(),
        _ => format!("{name} ({count})"),
    });
    Figures {
        metrics: figures(&tally, field, learn),
        over_sols: over_sols(&tally, field, end),
        faults: faults.collect(),
    }
}

fn figures(tally: &Tally, field: &RockField, learn: &LearnConfig) -> MisusMetrics {
    let regret_of = |one: &FieldModel| mineral_regret(one, field, &learn.mineral);
    let last: Vec<&FieldModel> = tally.rovers.iter().filter_map(latest).collect();
    let read = read_by_some(&last);
    let aris: Vec<f64> = last.iter().map(|one| ari(one, field, &read)).collect();
    let everywhere = vec![true; read.len()];
    let mean_of = |value: &dyn Fn(&FieldModel) -> f64| mean(last.iter().map(|one| value(one)));
    let errors = last.iter().map(|one| share_error(one, field));
    MisusMetrics {
        class_ari: mean(aris.iter().copied()),
        class_ari_least: aris.iter().copied().min_by(f64::total_cmp),
        field_ari: mean(last.iter().map(|one| ari(one, field, &everywhere))),
        k: mean_of(&|one| f64::from(one.classes)),
        k_agrees: last.windows(2).all(|two| two[0].classes == two[1].classes),
        distribution_error: mean(errors),
        posterior_entropy: mean_of(&|one| one.posterior_entropy),
        log_likelihood: mean_of(&|one| one.log_likelihood),
        objective: mean_of(&|one| one.objective),
        readings: mean_of(&|one| f64::from(one.readings)).unwrap_or(0.0),
        regret: mean(last.iter().filter_map(|one| regret_of(one))),
        log_score: mean(last.iter().filter_map(|one| story_score(one, field))),
        field_ari_area: area(tally, learn, &|one| Some(ari(one, field, &everywhere))),
        regret_area: area(tally, learn, &|one| regret_of(one)),
        log_score_area: area(tally, learn, &|one| story_score(one, field)),
        rocks_read: read.iter().filter(|read| **read).count() as u32,
        stops: tally.rovers.iter().map(|rover| rover.stops).sum(),
        exchange_messages: tally.exchanged,
        exchange_bytes: tally.exchanged_bytes,
        ..hardware(tally)
    }
}

/// What concerns rovers' hardware.
fn hardware(tally: &Tally) -> MisusMetrics {
    const J_PER_WH: f64 = 3600.0;
    let rovers = || tally.rovers.iter();
    let energy_wh = |part: &dyn Fn(&RoverEnergy) -> f64| {
        rovers()
            .map(|rover| part(&rover.resources.energy))
            .sum::<f64>()
            / J_PER_WH
    };
    let error_m = |pose: &RoverPose| {
        let (east_m, north_m) = (
            pose.east_m - pose.estimated_east_m,
            pose.north_m - pose.estimated_north_m,
        );
        libm::hypot(east_m, north_m)
    };
    MisusMetrics {
        distance_m: rovers().map(|rover| rover.distance_m).sum(),
        position_error_m: mean(
            rovers()
                .filter_map(|rover| rover.pose.as_ref())
                .map(error_m),
        ),
        solar_wh: energy_wh(&|energy| energy.solar_j),
        used_wh: energy_wh(&RoverEnergy::used_j),
        unused_wh: energy_wh(&|energy| energy.charge_loss_j + energy.not_taken_j),
        stored_wh: energy_wh(&|energy| energy.stored_j),
        energy_imbalance: rovers().map(|rover| rover.imbalance).fold(0.0, f64::max),
        faults: rovers().map(|rover| rover.faults.len() as u32).sum(),
        brown_outs: rovers().map(|rover| rover.brown_outs).sum(),
        ..MisusMetrics::default()
    }
}

fn latest(rover: &RoverHistory) -> Option<&FieldModel> {
    rover.models.last().map(|(_, model)| model)
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0_u32);
    for value in values {
        sum += value;
        count += 1;
    }
    (count > 0).then(|| sum / f64::from(count))
}

/// Which rocks some rover knows a spectrum of.
fn read_by_some(last: &[&FieldModel]) -> Vec<bool> {
    let rocks = last.first().map_or(0, |one| one.rocks.len());
    let read = |rock: usize| last.iter().any(|one| one.rocks[rock].spectrum);
    (0..rocks).map(read).collect()
}

/// The adjusted Rand index of a rover's classes over some rocks.
fn ari(model: &FieldModel, field: &RockField, over: &[bool]) -> f64 {
    let truth = field.truth();
    let chosen = |rock: &usize| over[*rock];
    let rocks: Vec<usize> = (0..over.len()).filter(chosen).collect();
    let own: Vec<usize> = rocks
        .iter()
        .map(|&rock| model.rocks[rock].class as usize)
        .collect();
    let true_of = |&rock: &usize| usize::from(truth.classes()[rock]);
    let true_classes: Vec<usize> = rocks.iter().map(true_of).collect();
    adjusted_rand_index(&own, &true_classes)
}

/// The mean of a figure over the numbers of rocks that a rover has been to, and over rovers: the area
/// under its curve. None where rovers do not learn at their stops.
fn area(
    tally: &Tally,
    learn: &LearnConfig,
    figure: &dyn Fn(&FieldModel) -> Option<f64>,
) -> Option<f64> {
    if !learn.learn_at_stops {
        return None;
    }
    mean(tally.rovers.iter().filter_map(|rover| {
        let models = || rover.models.iter().map(|(_, model)| model);
        let most = models().map(|model| model.stops).max()?;
        // The last that it thought before it came to the next rock.
        let after = |stops: u32| models().rfind(|model| model.stops == stops);
        mean((1..=most).filter_map(after).filter_map(figure))
    }))
}

/// How a team's knowledge grew: at the end of each sol, the mean over rovers of the adjusted Rand index
/// of all rocks of the field.
fn over_sols(tally: &Tally, field: &RockField, end: SimTime) -> Series {
    let all = vec![true; field.rocks().len()];
    let sols = libm::floor(end.as_secs_f64() / SOL_S) as u32;
    let at = |sol: u32| {
        let until_s = f64::from(sol) * SOL_S;
        let by_then = tally.rovers.iter().filter_map(|rover| {
            let models = rover.models.iter();
            let before = models.take_while(|(at, _)| at.as_secs_f64() <= until_s);
            before.last().map(|(_, model)| model)
        });
        mean(by_then.map(|model| ari(model, field, &all)))
    };
    let index = (1..=sols).map(f64::from).collect();
    Series::new(index, (1..=sols).map(at).collect()).unwrap_or_default()
}

/// The results of a run.
pub(crate) fn results(figures: Figures) -> Results {
    let Figures {
        metrics,
        over_sols,
        faults,
    } = figures;
    let mut results = Results::of(&metrics).metric("field_ari_by_sol", over_sols);
    let figure = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.3}"));
    results.line("rocks with a spectrum", metrics.rocks_read.to_string());
    results.line("classes told apart", figure(metrics.k));
    results.line("adjusted Rand index", figure(metrics.class_ari));
    results.line(
        "error of the distribution",
        figure(metrics.distribution_error),
    );
    results.line(
        "entropy of a rock's class",
        figure(metrics.posterior_entropy),
    );
    results.line("driven", format!("{:.0} m", metrics.distance_m));
    let [solar_wh, used_wh] = [metrics.solar_wh, metrics.used_wh];
    results.line(
        "energy",
        format!("{solar_wh:.0} Wh of sunlight, {used_wh:.0} Wh used"),
    );
    if metrics.brown_outs > 0 {
        results.line("brown-outs", metrics.brown_outs.to_string());
    }
    if !faults.is_empty() {
        results.line("faults", faults.join(", "));
    }
    results
}

/// How far the learnt shares of the classes are from the true ones.
fn share_error(model: &FieldModel, field: &RockField) -> f64 {
    let learnt: Vec<usize> = model
        .rocks
        .iter()
        .map(|label| label.class as usize)
        .collect();
    let truth: Vec<usize> = field
        .truth()
        .classes()
        .iter()
        .map(|class| usize::from(*class))
        .collect();
    distribution_error(&model.proportions, &learnt, &truth)
}

/// By how much the rock that a rover names falls short of the richest in a mineral.
fn mineral_regret(model: &FieldModel, field: &RockField, mineral: &str) -> Option<f64> {
    let at = field.minerals().iter().position(|name| name == mineral)?;
    let rocks = 0..field.rocks().len();
    let fractions: Vec<f64> = rocks
        .map(|rock| field.truth().rock(rock).fractions[at])
        .collect();
    Some(regret(&fractions, model.richest.map(|rock| rock as usize)))
}

/// The logarithm of how likely a rover thinks the true story is.
fn story_score(model: &FieldModel, field: &RockField) -> Option<f64> {
    let truth = field.story().name();
    let story = model.stories.iter().find(|one| one.story == truth)?;
    Some(libm::log(story.probability.max(LEAST_PROBABILITY)))
}
