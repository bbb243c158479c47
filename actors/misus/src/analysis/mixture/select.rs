//! The number of classes, and the best of several starts for each.

use super::em::{Run, floors};
use super::starts::{Scales, seeded, split};
use super::{FitSettings, Mixture, MixtureError, Table};

/// How many steps a start is given before only the best go on.
const SHORT_STEPS: usize = 12;

/// How many of the starts go on.
const FINALISTS: usize = 3;

/// What a number of classes amounts to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// How many classes.
    pub classes: usize,
    /// The log-likelihood `L`.
    pub log_likelihood: f64,
    /// The penalised log-likelihood `F`, which was maximised.
    pub objective: f64,
    /// The Bayesian information criterion; less is better.
    pub bic: f64,
}

/// A learnt mixture, and what it was chosen from.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// The classes.
    pub mixture: Mixture,
    /// The probability of each class for each row, row by row.
    pub responsibilities: Vec<f64>,
    /// What the chosen number of classes amounts to.
    pub chosen: Candidate,
    /// What each number that was tried amounts to, ascending.
    pub tried: Vec<Candidate>,
}

/// Learns a mixture: for each number of classes the best of several starts, then the number with
/// the least criterion. Equal tables give bit-equal mixtures.
///
/// At most as many classes as rows are tried, and no more once the criterion has risen three times
/// in a row.
///
/// ```
/// use farside_misus::analysis::mixture::{FitSettings, Table, fit};
/// let mut table = Table::new(2, 0);
/// for i in 0..20 {
///     let shift = if i < 10 { 0.0 } else { 5.0 };
///     table.push(&[shift + 0.1 * f64::from(i * i % 7), shift - 0.1 * f64::from(i % 5)], &[0.0; 2]);
/// }
/// let fit = fit(&table, &FitSettings::default())?;
/// assert_eq!(fit.mixture.classes(), 2);
/// let first = fit.responsibilities[0] > 0.5;
/// let last = fit.responsibilities[2 * 19] > 0.5;
/// assert_ne!(first, last);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the table is empty, or a setting is out of its range.
pub fn fit(table: &Table, settings: &FitSettings) -> Result<Fit, MixtureError> {
    check(settings)?;
    if table.is_empty() {
        return Err(MixtureError::NoRocks);
    }
    let floors = floors(table, settings);
    let scales = Scales::of(table, &floors);
    let most = settings.max_classes.min(table.len());
    let least = settings.min_classes.min(most);
    let mut tried: Vec<Candidate> = Vec::new();
    let mut best: Option<(Candidate, Mixture, Vec<f64>)> = None;
    let mut fewer: Option<(Mixture, Vec<f64>)> = None;
    for classes in least..=most {
        let starts = starts(table, settings, &scales, classes, fewer.as_ref());
        let (candidate, mixture, shares) = best_of(table, settings, &floors, classes, starts);
        tried.push(candidate);
        let is_better = best.as_ref().is_none_or(|(b, ..)| candidate.bic < b.bic);
        if is_better {
            best = Some((candidate, mixture.clone(), shares.clone()));
        }
        fewer = Some((mixture, shares));
        let chosen = best.as_ref().map_or(classes, |(b, ..)| b.classes);
        if classes >= chosen + 3 {
            break;
        }
    }
    let (chosen, mixture, responsibilities) = best.ok_or(MixtureError::NoRocks)?;
    Ok(Fit {
        mixture,
        responsibilities,
        chosen,
        tried,
    })
}

fn check(settings: &FitSettings) -> Result<(), MixtureError> {
    let over_0 = |x: f64| x.is_finite() && x > 0.0;
    let at_least_0 = |x: f64| x.is_finite() && x >= 0.0;
    let FitSettings {
        position_weight,
        shrinkage,
        weight_prior,
        least_spread,
        tolerance,
        ..
    } = *settings;
    let (fewest, most) = (settings.min_classes, settings.max_classes);
    let rules = [
        (
            "position_weight",
            "within 0 and 1",
            position_weight,
            (0.0..=1.0).contains(&position_weight),
        ),
        (
            "shrinkage",
            "finite and over 0",
            shrinkage,
            over_0(shrinkage),
        ),
        (
            "weight_prior",
            "finite and at least 0",
            weight_prior,
            at_least_0(weight_prior),
        ),
        (
            "least_spread",
            "finite and over 0",
            least_spread,
            over_0(least_spread),
        ),
        (
            "tolerance",
            "finite and at least 0",
            tolerance,
            at_least_0(tolerance),
        ),
        ("min_classes", "at least 1", fewest as f64, fewest >= 1),
        (
            "max_classes",
            "at least min_classes",
            most as f64,
            most >= fewest,
        ),
        (
            "starts",
            "at least 1",
            settings.starts as f64,
            settings.starts >= 1,
        ),
    ];
    match rules.into_iter().find(|rule| !rule.3) {
        None => Ok(()),
        Some((setting, expected, actual, _)) => Err(MixtureError::Setting {
            setting,
            expected,
            actual,
        }),
    }
}

/// The responsibilities that runs begin with.
fn starts(
    table: &Table,
    settings: &FitSettings,
    scales: &Scales,
    classes: usize,
    fewer: Option<&(Mixture, Vec<f64>)>,
) -> Vec<Vec<f64>> {
    if classes == 1 {
        return vec![vec![1.0; table.len()]];
    }
    let seeds = 0..settings.starts;
    let mut starts: Vec<Vec<f64>> = seeds
        .map(|start| seeded(table, scales, classes, start))
        .collect();
    if let Some((mixture, shares)) = fewer {
        for class in 0..mixture.classes() {
            let ratio = |d: usize| mixture.variance(class)[d] / mixture.tied[d];
            let widest = (0..table.columns()).max_by(|&a, &b| ratio(a).total_cmp(&ratio(b)));
            if let Some(column) = widest {
                let mean = mixture.mean(class)[column];
                starts.push(split(table, shares, classes, class, column, mean));
            }
        }
    }
    starts
}

/// All starts for a few steps, the best of them to the end, the best of these.
fn best_of(
    table: &Table,
    settings: &FitSettings,
    floors: &[f64],
    classes: usize,
    starts: Vec<Vec<f64>>,
) -> (Candidate, Mixture, Vec<f64>) {
    let mut runs: Vec<(f64, Run)> = starts
        .into_iter()
        .map(|shares| {
            let mut run = Run::new(table, settings, floors, classes, shares);
            let (_, objective) = run.climb(SHORT_STEPS);
            (objective, run)
        })
        .collect();
    // A stable sort: of equal ones the first, on every rover.
    runs.sort_by(|a, b| b.0.total_cmp(&a.0));
    runs.truncate(FINALISTS);
    let ended = runs.into_iter().map(|(_, mut run)| {
        let (log_likelihood, objective) = run.climb(settings.max_steps);
        (log_likelihood, objective, run)
    });
    let best = ended.reduce(|best, next| if next.1 > best.1 { next } else { best });
    let (log_likelihood, objective, run) = best.expect("at least one start");
    let parameters = run.mixture.parameters(table.len());
    let candidate = Candidate {
        classes,
        log_likelihood,
        objective,
        bic: -2.0 * log_likelihood + parameters * libm::log(table.len() as f64),
    };
    (candidate, run.mixture, run.shares)
}
