//! What of a study has no effect: values of a factor with which runs are the same to the last event,
//! and entries of the scenario for which every run ends too soon. Both draw flat lines that read as
//! robust.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::Summary;
use crate::study::results::{Manifest, Results, RunOutcome};

/// Values of a factor that give the same runs: whatever the other factors are, runs with the same
/// seed are the same, event by event, and report the same.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SameValues {
    /// The factor's name.
    pub factor: String,
    /// The values, as people write them.
    pub values: Vec<String>,
    /// Whether they are all that the factor has, so that it changes nothing at all.
    pub all: bool,
}

impl SameValues {
    /// A sentence.
    ///
    /// ```
    /// use farside_experiments::study::summary::effect::SameValues;
    /// let values = ["0", "0.5"].map(str::to_owned).to_vec();
    /// let same = SameValues { factor: "damping".to_owned(), values, all: true };
    /// assert_eq!(
    ///     same.sentence(),
    ///     "damping changes nothing: with each of its values (0, 0.5) runs of one seed are the \
    ///      same, event by event"
    /// );
    /// ```
    pub fn sentence(&self) -> String {
        let (factor, values) = (&self.factor, self.values.join(", "));
        match self.all {
            true => format!(
                "{factor} changes nothing: with each of its values ({values}) runs of one seed \
                 are the same, event by event"
            ),
            false => format!(
                "{factor} makes no difference between {values}: runs of one seed are the same, \
                 event by event"
            ),
        }
    }
}

/// What has no effect, a sentence each: values that change nothing, and what no run of a cell
/// reached.
pub fn notices(manifest: &Manifest, summary: &Summary) -> Vec<String> {
    let same = summary.same_values.iter().map(SameValues::sentence);
    let entries = summary.cells.iter().flat_map(|c| c.never_reached.keys());
    let entries: BTreeSet<&String> = entries.collect();
    let never = entries.into_iter().map(|entry| {
        let (mut runs, mut of, mut whole) = (0, 0, Vec::new());
        for cell in &summary.cells {
            let missed = cell.never_reached.get(entry).copied().unwrap_or(0);
            (runs, of) = (runs + missed, of + cell.n);
            if missed == cell.n && missed > 0 {
                whole.push(cell.cell);
            }
        }
        if runs == of {
            return format!("{entry} was never reached: each run ended before");
        }
        let cells = match whole.as_slice() {
            [] => String::new(),
            [cell] => format!(", among them all of cell {}", named(manifest, *cell)),
            whole => {
                let mut names: Vec<String> = whole.iter().map(usize::to_string).collect();
                if names.len() > MAX_CELLS {
                    names.truncate(MAX_CELLS);
                    names.push("...".to_owned());
                }
                format!(", among them all of cells {}", names.join(", "))
            }
        };
        format!("{entry} was not reached in {runs} of {of} runs, which ended before{cells}")
    });
    same.chain(never).collect()
}

/// The most cells that a sentence lists.
const MAX_CELLS: usize = 12;

fn named(manifest: &Manifest, cell: usize) -> String {
    let factors = manifest.factors.iter().zip(&manifest.cells[cell].texts);
    let values: Vec<String> = factors
        .map(|(factor, text)| format!("{} = {text}", factor.name))
        .collect();
    match values.is_empty() {
        true => cell.to_string(),
        false => format!("{cell} ({})", values.join(", ")),
    }
}

/// The values of each factor with which runs are the same. Of cells that differ in one factor alone,
/// only those count that have runs of the same seeds.
pub(super) fn same_values(results: &Results) -> Vec<SameValues> {
    let manifest = &results.manifest;
    let runs: Vec<BTreeMap<u64, &RunOutcome>> = (0..manifest.cells.len())
        .map(|cell| {
            let runs = results.of_cell(cell).iter();
            runs.map(|run| (run.seed, &run.outcome)).collect()
        })
        .collect();
    let factors = manifest.factors.iter().enumerate();
    factors
        .flat_map(|(at, factor)| {
            let classes = classes(manifest, at, &runs);
            let levels: usize = classes.iter().map(Vec::len).sum();
            let several = classes.into_iter().filter(|class| class.len() > 1);
            let same = several.map(move |values| SameValues {
                factor: factor.name.clone(),
                all: values.len() == levels,
                values: values.into_iter().map(str::to_owned).collect(),
            });
            same.collect::<Vec<_>>()
        })
        .collect()
}

/// The values of a factor, those together that give the same runs wherever both were run.
fn classes<'a>(
    manifest: &'a Manifest,
    factor: usize,
    runs: &[BTreeMap<u64, &RunOutcome>],
) -> Vec<Vec<&'a str>> {
    // Cells that differ in this factor alone.
    let mut groups: BTreeMap<Vec<&str>, Vec<(usize, &'a str)>> = BTreeMap::new();
    let mut levels: Vec<&'a str> = Vec::new();
    for (cell, about) in manifest.cells.iter().enumerate() {
        let mut others: Vec<&str> = about.texts.iter().map(String::as_str).collect();
        let Some(level) = about.texts.get(factor) else {
            continue;
        };
        others[factor] = "";
        if !levels.contains(&level.as_str()) {
            levels.push(level);
        }
        groups.entry(others).or_default().push((cell, level));
    }
    let are_same = |a: &str, b: &str| {
        let mut any = false;
        for group in groups.values() {
            let of = |level: &str| group.iter().find(|(_, known)| *known == level);
            let (Some((a, _)), Some((b, _))) = (of(a), of(b)) else {
                continue;
            };
            if !same_runs(&runs[*a], &runs[*b]) {
                return false;
            }
            any = true;
        }
        any
    };
    let mut classes: Vec<Vec<&'a str>> = Vec::new();
    for level in levels {
        let known = classes
            .iter_mut()
            .find(|class| class.iter().all(|other| are_same(other, level)));
        match known {
            Some(class) => class.push(level),
            None => classes.push(vec![level]),
        }
    }
    classes
}

/// Whether all runs of seeds that both have are the same, and there is one that ended well.
fn same_runs(a: &BTreeMap<u64, &RunOutcome>, b: &BTreeMap<u64, &RunOutcome>) -> bool {
    let shared = a.iter().filter_map(|(seed, a)| Some((*a, *b.get(seed)?)));
    let mut any = false;
    for (a, b) in shared {
        let (RunOutcome::Done { .. }, RunOutcome::Done { .. }) = (a, b) else {
            return false;
        };
        if !same_run(a, b) {
            return false;
        }
        any = true;
    }
    any
}

/// Whether two runs are the same but for what they never reached.
fn same_run(a: &RunOutcome, b: &RunOutcome) -> bool {
    let bare = |outcome: &RunOutcome| {
        let mut outcome = outcome.clone();
        if let RunOutcome::Done { never_reached, .. } = &mut outcome {
            never_reached.clear();
        }
        outcome
    };
    // Digests differ nearly always, and cost little.
    let digest = |outcome: &RunOutcome| match outcome {
        RunOutcome::Done { digest, .. } => digest.clone(),
        RunOutcome::Failed { .. } => String::new(),
    };
    digest(a) == digest(b) && bare(a) == bare(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::fabricated;
    use crate::study::summary::summarise;

    fn grid() -> Results {
        let factors = vec![fabricated::latency(), fabricated::loss()];
        fabricated::study("grid", factors, 6)
    }

    /// Makes the runs of the cells with one value of a factor those of the cells with another.
    fn make_same(results: &mut Results, factor: usize, value: &str, like: &str) {
        let manifest = results.manifest.clone();
        let twin = |cell: usize| {
            let mut texts = manifest.cells[cell].texts.clone();
            (texts[factor] == value).then(|| {
                texts[factor] = like.to_owned();
                let found = manifest.cells.iter().position(|other| other.texts == texts);
                found.unwrap()
            })
        };
        let known = results.runs.clone();
        for run in &mut results.runs {
            if let Some(twin) = twin(run.cell) {
                let same = known
                    .iter()
                    .find(|other| (other.cell, other.seed) == (twin, run.seed));
                run.outcome = same.unwrap().outcome.clone();
            }
        }
    }

    #[test]
    fn values_that_change_nothing_are_found_whatever_the_other_factors_are() {
        let mut results = grid();
        assert_eq!(same_values(&results), []);
        let (name, texts): (String, Vec<String>) = {
            let manifest = &results.manifest;
            let mut texts: Vec<String> = Vec::new();
            for cell in &manifest.cells {
                if !texts.contains(&cell.texts[1]) {
                    texts.push(cell.texts[1].clone());
                }
            }
            (manifest.factors[1].name.clone(), texts)
        };
        make_same(&mut results, 1, &texts[1], &texts[0]);
        let same = |values: &[String], all| SameValues {
            factor: name.clone(),
            values: values.to_vec(),
            all,
        };
        assert_eq!(same_values(&results), [same(&texts[..2], false)]);
        for text in &texts[2..] {
            make_same(&mut results, 1, text, &texts[0]);
        }
        assert_eq!(same_values(&results), [same(&texts, true)]);
        // One run that reports something else is a difference, though its digest is the same.
        if let RunOutcome::Done { metrics, .. } = &mut results.runs[0].outcome {
            metrics.insert("collisions".to_owned(), 1.into());
        }
        assert_eq!(same_values(&results), [same(&texts[1..], false)]);
    }

    #[test]
    fn what_no_run_reached_is_told_with_its_cells() {
        let mut results = grid();
        for run in results.runs.iter_mut().filter(|run| run.cell == 2) {
            if let RunOutcome::Done { never_reached, .. } = &mut run.outcome {
                never_reached.push("degrade.0".to_owned());
            }
        }
        let told = |results: &Results| notices(&results.manifest, &summarise(results));
        let [one] = &told(&results)[..] else {
            panic!("one notice: {:?}", told(&results));
        };
        assert!(one.starts_with("degrade.0 was not reached in "), "{one}");
        assert!(one.contains("all of cell 2 ("), "{one}");
        for run in &mut results.runs {
            if let RunOutcome::Done { never_reached, .. } = &mut run.outcome {
                never_reached.clear();
                never_reached.push("degrade.0".to_owned());
            }
        }
        assert_eq!(
            told(&results),
            ["degrade.0 was never reached: each run ended before"]
        );
    }
}
