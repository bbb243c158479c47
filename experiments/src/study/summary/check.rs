//! A study against results of an earlier one, run by run with the same seeds: what became better,
//! what worse. For continuous integration, where what is compared is two versions of a code.

use std::collections::{BTreeMap, BTreeSet};

use farside::random::RandomKey;
use serde::Serialize;

use super::figures::{in_blocks, paired};
use super::values::{ValueKind, kind_of, value_of};
use super::{Difference, SURE_FROM};
use crate::stats::bootstrap;
use crate::stats::paired::{holm, student};
use crate::study::results::{DeclaredBetter, Manifest, Results, RunOutcome, RunRecord};
use farside_actors::system::Series;

/// A metric has changed in a cell if chance alone brings so great a difference, in any cell and any
/// metric of the study, this often at most.
const LEVEL: f64 = 0.05;

/// What became of a metric in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// As before, as far as can be told.
    Same,
    /// Better.
    Better,
    /// Worse.
    Worse,
    /// Otherwise, and neither way is better.
    Changed,
    /// Not the same, and of too few runs to be sure of anything.
    Unsure,
}

/// A metric in a cell, now and before.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Checked {
    /// The cell, by its place in the new study.
    pub cell: usize,
    /// Its values, as people write them.
    pub texts: Vec<String>,
    /// The metric; `failed runs` and `violations` besides those of the study.
    pub metric: String,
    /// What it was, over the seeds that both have.
    pub before: f64,
    /// What it is.
    pub now: f64,
    /// How much more it is now, with the same seeds.
    pub difference: Difference,
    /// How often chance alone would bring as great a difference, with all of the study's
    /// comparisons together (Student's test of the paired differences, adjusted by Holm).
    pub p: f64,
    /// What that comes to.
    pub verdict: Verdict,
}

/// A study against earlier results.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Each metric in each cell that both have.
    pub checked: Vec<Checked>,
    /// What could not be compared, for people.
    pub notes: Vec<String>,
}

impl Check {
    /// How many comparisons came to this verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        let checked = self.checked.iter();
        checked.filter(|one| one.verdict == verdict).count()
    }

    /// Whether any metric got worse.
    pub fn is_worse(&self) -> bool {
        self.count(Verdict::Worse) > 0
    }
}

/// Compares `now` with `before`. Cells are found by their factors' values, runs by their seeds. Of
/// lists the median of each run is compared, what never happened counted as at the run's end; of
/// curves the mean over the indices that both runs have; of words, how many runs say another.
///
/// ```
/// # use farside_experiments::study::results::*;
/// # use serde_json::json;
/// # let metric = Metric { name: "ratio".into(), label: "ratio".into(), unit: "".into(),
/// #     index: None, kind: None, better: Some(DeclaredBetter::Lower) };
/// # let manifest = Manifest { format: FORMAT, code_version: "1".into(), study: "doc".into(),
/// #     question: "?".into(), scenario: "s".into(), scenario_text: "".into(),
/// #     files: Default::default(), factors: vec![], metrics: vec![metric],
/// #     baseline: None, cells: vec![Cell { values: vec![], texts: vec![], sets: vec![] }],
/// #     seeds: (0..8).collect(), block: 1, stop: None, published: vec![], report: Default::default() };
/// # let study = |more: f64| Results { manifest: manifest.clone(), runs: (0..8).map(|seed: u64|
/// #     RunRecord { cell: 0, seed, outcome: RunOutcome::Done {
/// #     end: "completed".into(), end_detail: "".into(), digest: "".into(), sim_time_s: 9.0,
/// #     timed_out: false, events: 1, messages: MessageCounts::default(),
/// #     metrics: json!({"ratio": seed as f64 + more}).as_object().unwrap().clone(),
/// #     violations: vec![], never_reached: vec![] } }).collect() };
/// # let (before, now) = (study(0.0), study(0.5));
/// use farside_experiments::study::summary::check::{Verdict, check};
/// // The metric is better the lower it is, and 0.5 more with each seed.
/// let check = check(&now, &before)?;
/// let ratio = check.checked.iter().find(|one| one.metric == "ratio").expect("it is compared");
/// assert_eq!((ratio.verdict, ratio.difference.mean), (Verdict::Worse, 0.5));
/// # Ok::<(), String>(())
/// ```
///
/// # Errors
/// With what does not fit together: another scenario, other factors, no cell or no seed in common.
pub fn check(now: &Results, before: &Results) -> Result<Check, String> {
    let mut notes = fitting(&now.manifest, &before.manifest)?;
    let mut all = Vec::new();
    for (cell, about) in now.manifest.cells.iter().enumerate() {
        let same = |other: &&crate::study::results::Cell| other.texts == about.texts;
        let cells = &before.manifest.cells;
        let Some(then) = cells.iter().position(|other| same(&other)) else {
            notes.push(format!("cell {cell} ({}) is new", about.texts.join(", ")));
            continue;
        };
        let pairs = pairs(now.of_cell(cell), before.of_cell(then));
        if pairs.is_empty() {
            notes.push(format!("cell {cell} has no run with a seed of before"));
            continue;
        }
        let compared = |name: &str, better, values: BTreeMap<u64, (f64, f64)>| {
            let of_cell = (cell, about.texts.clone());
            of_metric(&now.manifest, of_cell, (name, better), values)
        };
        for (name, count) in COUNTS {
            let of_run = |(now, before): &(&RunRecord, &RunRecord)| (count(now), count(before));
            let values = pairs.iter().map(|(seed, pair)| (*seed, of_run(pair)));
            all.push(compared(
                name,
                Some(DeclaredBetter::Lower),
                values.collect(),
            ));
        }
        for metric in &now.manifest.metrics {
            let kinds = [now, before].map(|results| kind_of(results, &metric.name));
            let values: BTreeMap<u64, (f64, f64)> = pairs
                .iter()
                .filter_map(|(seed, (now, before))| {
                    let pair = figures(now, before, &metric.name, kinds[0])?;
                    Some((*seed, pair))
                })
                .collect();
            match (kinds[0] == kinds[1], values.is_empty()) {
                (true, false) => all.push(compared(&metric.name, metric.better, values)),
                (true, true) => {}
                (false, _) => notes.push(format!("{}: was of another kind", metric.name)),
            }
        }
    }
    if all.is_empty() {
        return Err("they have no run in common: expected the same cells and seeds".to_owned());
    }
    judge(&mut all);
    notes.dedup();
    Ok(Check {
        checked: all.into_iter().map(|(checked, _)| checked).collect(),
        notes,
    })
}

/// What no study need name, and must not become more.
type Count = fn(&RunRecord) -> f64;

const COUNTS: [(&str, Count); 2] = [
    ("failed runs", |run| match &run.outcome {
        RunOutcome::Failed { .. } => 1.0,
        RunOutcome::Done { .. } => 0.0,
    }),
    ("violations", |run| match &run.outcome {
        RunOutcome::Failed { .. } => 0.0,
        RunOutcome::Done { violations, .. } => violations.len() as f64,
    }),
];

/// Refuses what cannot be compared, and says what differs.
pub(crate) fn fitting(now: &Manifest, before: &Manifest) -> Result<Vec<String>, String> {
    let mut notes = Vec::new();
    if now.scenario != before.scenario {
        let (now, before) = (&now.scenario, &before.scenario);
        return Err(format!(
            "they are of the scenario {before:?}, and this study of {now:?}"
        ));
    }
    let names = |manifest: &Manifest| -> Vec<String> {
        let factors = manifest.factors.iter();
        factors.map(|factor| factor.name.clone()).collect()
    };
    if names(now) != names(before) {
        let told = |manifest: &Manifest| names(manifest).join(", ");
        return Err(format!(
            "they vary {}, and this study {}",
            told(before),
            told(now)
        ));
    }
    let seeds = |manifest: &Manifest| manifest.seeds.iter().copied().collect::<BTreeSet<u64>>();
    let shared = seeds(now).intersection(&seeds(before)).count();
    if shared == 0 {
        let range = |manifest: &Manifest| {
            let seeds = seeds(manifest);
            let ends = seeds.first().zip(seeds.last());
            ends.map_or_else(String::new, |(first, last)| format!("{first} to {last}"))
        };
        return Err(format!(
            "they have the seeds {}, and this study {}: expected some in common",
            range(before),
            range(now)
        ));
    }
    let most = now.seeds.len().max(before.seeds.len());
    if shared < most {
        notes.push(format!(
            "only the {shared} seeds that both have are compared"
        ));
    }
    if now.scenario_text != before.scenario_text {
        notes.push("the scenario's settings have changed".to_owned());
    }
    let known = |name: &str| before.metrics.iter().any(|metric| metric.name == name);
    let new = now.metrics.iter().filter(|metric| !known(&metric.name));
    notes.extend(new.map(|metric| format!("{}: was not measured before", metric.name)));
    Ok(notes)
}

/// The runs of one cell now and before, by seed.
fn pairs<'a>(
    now: &'a [RunRecord],
    before: &'a [RunRecord],
) -> BTreeMap<u64, (&'a RunRecord, &'a RunRecord)> {
    let by_seed = |runs: &'a [RunRecord]| -> BTreeMap<u64, &'a RunRecord> {
        runs.iter().map(|run| (run.seed, run)).collect()
    };
    paired(&by_seed(now), &by_seed(before))
}

/// What the two runs say of a metric, as numbers that can be compared; none if one says nothing.
fn figures(now: &RunRecord, before: &RunRecord, name: &str, kind: ValueKind) -> Option<(f64, f64)> {
    let values = [now, before].map(|run| value_of(&run.outcome, name));
    let [Some(a), Some(b)] = &values else {
        return None;
    };
    match kind {
        ValueKind::Number => Some((a.as_f64()?, b.as_f64()?)),
        ValueKind::Rate => {
            let number = |yes: bool| f64::from(u8::from(yes));
            Some((number(a.as_bool()?), number(b.as_bool()?)))
        }
        ValueKind::List => Some((median(now, a.as_array()?)?, median(before, b.as_array()?)?)),
        ValueKind::Series => {
            let (a, b) = (Series::from_json(a).ok()?, Series::from_json(b).ok()?);
            let index = a.index().iter();
            let both: Vec<(f64, f64)> = index
                .filter_map(|index| Some((a.at(*index)?, b.at(*index)?)))
                .collect();
            let count = both.len() as f64;
            let mean = |sum: f64| (count > 0.0).then(|| sum / count);
            let sums = both
                .iter()
                .fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
            Some((mean(sums.0)?, mean(sums.1)?))
        }
        ValueKind::Text => Some((f64::from(u8::from(a != b)), 0.0)),
        ValueKind::Absent => None,
    }
}

/// The middle of a run's list, what never happened counted as at its end.
fn median(run: &RunRecord, values: &[serde_json::Value]) -> Option<f64> {
    let RunOutcome::Done { sim_time_s, .. } = run.outcome else {
        return None;
    };
    let numbers = values
        .iter()
        .map(|value| value.as_f64().unwrap_or(sim_time_s));
    let mut numbers: Vec<f64> = numbers.collect();
    numbers.sort_by(f64::total_cmp);
    let middle = numbers.len() / 2;
    match numbers.len() {
        0 => None,
        odd if odd % 2 == 1 => Some(numbers[middle]),
        _ => Some(0.5 * (numbers[middle - 1] + numbers[middle])),
    }
}

/// A comparison that is not judged yet, and which way is better.
type Open = (Checked, Option<DeclaredBetter>);

fn of_metric(
    manifest: &Manifest,
    (cell, texts): (usize, Vec<String>),
    (name, better): (&str, Option<DeclaredBetter>),
    values: BTreeMap<u64, (f64, f64)>,
) -> Open {
    let n = values.len();
    let mean = |side: fn(&(f64, f64)) -> f64| values.values().map(side).sum::<f64>() / n as f64;
    let (now, before) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let blocks = in_blocks(manifest, values);
    let key = RandomKey::new(0).text("check").text(name);
    let key = key.text(&texts.join("\n"));
    let estimate = bootstrap::paired_difference(&blocks, key);
    let p = student(&bootstrap::differences(&blocks), 0.0);
    let checked = Checked {
        cell,
        texts,
        metric: name.to_owned(),
        before,
        now,
        difference: Difference::new(n, blocks.len(), estimate),
        p,
        verdict: Verdict::Same,
    };
    (checked, better)
}

/// Judges all comparisons together. One that would be a change by itself may be chance among many;
/// what must never happen needs no second look.
fn judge(all: &mut [Open]) {
    let p: Vec<f64> = all.iter().map(|(checked, _)| checked.p).collect();
    let adjusted = holm(&p);
    for ((checked, better), p) in all.iter_mut().zip(adjusted) {
        checked.p = p;
        let difference = &checked.difference;
        let more = difference.mean > 0.0;
        let is_count = COUNTS.iter().any(|(name, _)| *name == checked.metric);
        checked.verdict = if checked.now == checked.before && difference.mean == 0.0 {
            Verdict::Same
        } else if is_count {
            if more {
                Verdict::Worse
            } else {
                Verdict::Better
            }
        } else if difference.blocks < SURE_FROM {
            Verdict::Unsure
        } else if p > LEVEL || difference.ci_low <= 0.0 && difference.ci_high >= 0.0 {
            Verdict::Same
        } else {
            match better {
                None => Verdict::Changed,
                Some(better) if more == (*better == DeclaredBetter::Higher) => Verdict::Better,
                Some(_) => Verdict::Worse,
            }
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::fabricated::{self, latency, loss};

    fn results() -> Results {
        let mut results = fabricated::study("check", vec![loss()], 12);
        for metric in &mut results.manifest.metrics {
            metric.better = match metric.name.as_str() {
                "completed" => Some(DeclaredBetter::Higher),
                "time_ratio" | "collisions" | "arrival_s" => Some(DeclaredBetter::Lower),
                _ => None,
            };
        }
        results
    }

    /// Changes what the runs of a cell say of a metric.
    fn change(results: &mut Results, cell: usize, name: &str, by: impl Fn(f64) -> f64) {
        for run in results.runs.iter_mut().filter(|run| run.cell == cell) {
            if let RunOutcome::Done { metrics, .. } = &mut run.outcome {
                let number = metrics[name].as_f64().unwrap();
                metrics.insert(name.to_owned(), by(number).into());
            }
        }
    }

    fn verdicts(check: &Check) -> Vec<(usize, &str, Verdict)> {
        let changed = check
            .checked
            .iter()
            .filter(|one| one.verdict != Verdict::Same);
        changed
            .map(|one| (one.cell, one.metric.as_str(), one.verdict))
            .collect()
    }

    #[test]
    fn the_same_runs_are_the_same() {
        let check = check(&results(), &results()).unwrap();
        assert_eq!(verdicts(&check), []);
        assert!(check.checked.len() > 20 && check.notes.is_empty());
        assert!(!check.is_worse());
    }

    #[test]
    fn a_change_is_worse_or_better_by_the_metrics_own_way() {
        let before = results();
        let mut now = results();
        change(&mut now, 1, "time_ratio", |ratio| ratio * 1.2);
        change(&mut now, 2, "time_ratio", |ratio| ratio * 0.8);
        change(&mut now, 3, "intervention_rate", |rate| rate + 0.1);
        let found = check(&now, &before).unwrap();
        assert_eq!(
            verdicts(&found),
            [
                (1, "time_ratio", Verdict::Worse),
                (2, "time_ratio", Verdict::Better),
                (3, "intervention_rate", Verdict::Changed),
            ]
        );
        assert!(found.is_worse());
        let back = check(&before, &now).unwrap();
        assert_eq!(back.count(Verdict::Worse), 1);
        assert!(
            back.checked
                .iter()
                .any(|one| (one.cell, one.verdict) == (2, Verdict::Worse))
        );
    }

    #[test]
    fn noise_about_nothing_is_no_change() {
        let before = results();
        let mut now = results();
        // As much up as down, by seed.
        for run in &mut now.runs {
            let sign = if run.seed % 2 == 0 { 1.0 } else { -1.0 };
            if let RunOutcome::Done { metrics, .. } = &mut run.outcome {
                let ratio = metrics["time_ratio"].as_f64().unwrap();
                metrics.insert("time_ratio".to_owned(), (ratio + 0.1 * sign).into());
            }
        }
        assert_eq!(verdicts(&check(&now, &before).unwrap()), []);
    }

    #[test]
    fn what_must_never_happen_is_worse_however_few_the_runs() {
        let mut before = results();
        before.runs.retain(|run| run.seed <= 2);
        let mut now = before.clone();
        let done = now.runs.iter_mut().find_map(|run| match &mut run.outcome {
            RunOutcome::Done { violations, .. } => Some(violations),
            RunOutcome::Failed { .. } => None,
        });
        done.unwrap().push("two rovers collided".to_owned());
        change(&mut now, 4, "time_ratio", |ratio| ratio * 2.0);
        let found = check(&now, &before).unwrap();
        let verdicts = verdicts(&found);
        assert!(
            verdicts.contains(&(0, "violations", Verdict::Worse)),
            "{verdicts:?}"
        );
        assert!(
            verdicts.contains(&(4, "time_ratio", Verdict::Unsure)),
            "{verdicts:?}"
        );
    }

    #[test]
    fn what_does_not_fit_together_is_said() {
        let before = results();
        let refused = |change: fn(&mut Results)| {
            let mut now = results();
            change(&mut now);
            check(&now, &before).unwrap_err()
        };
        let other = refused(|now| now.manifest.scenario = "network/rubble".to_owned());
        assert!(
            other.contains("of the scenario \"network/crater-dense\""),
            "{other}"
        );
        let factors = refused(|now| *now = fabricated::study("x", vec![latency()], 3));
        assert_eq!(factors, "they vary loss, and this study latency");
        let seeds = refused(|now| now.manifest.seeds = vec![100, 101]);
        assert!(seeds.starts_with("they have the seeds 1 to 12, and this study 100 to 101"));
        let mut fewer = results();
        fewer.manifest.seeds.truncate(8);
        fewer.runs.retain(|run| run.seed <= 8);
        let found = check(&fewer, &before).unwrap();
        assert_eq!(
            found.notes,
            ["only the 8 seeds that both have are compared"]
        );
    }
}
