//! Which indices the curves of a cell have: the same in all its runs.

use std::collections::BTreeMap;

use serde_json::Value;

use super::results::{Manifest, Metric, RunRecord};
use super::summary::values::value_of;
use farside_actors::system::Series;

/// The longest curve of each metric in each cell so far, with the seed of its run.
#[derive(Default)]
pub(super) struct Lengths(BTreeMap<(String, usize), (u64, Series)>);

impl Lengths {
    /// Takes a run into account.
    ///
    /// # Errors
    /// In words, when it reports what is no curve under the name of one, or a curve over other
    /// indices than another run of its cell. Where lengths may differ, one must begin as the other
    /// does.
    pub(super) fn check(&mut self, manifest: &Manifest, run: &RunRecord) -> Result<(), String> {
        for metric in &manifest.metrics {
            let value = value_of(&run.outcome, &metric.name);
            let key = (metric.name.clone(), run.cell);
            let other = self.0.get(&key);
            let Some(value) = value.filter(|value| value.is_object() || other.is_some()) else {
                continue;
            };
            let series = series(&value);
            let series = series.map_err(|error| {
                let place = place(manifest, run, metric);
                format!("{place}: no curve: {error}")
            })?;
            let longest = match other {
                None => true,
                Some((seed, other)) => {
                    let agreed = agree(metric, &series, other);
                    agreed.map_err(|difference| {
                        let place = place(manifest, run, metric);
                        format!("{place}: {difference} with seed {seed}\n  {EXPECTED}")
                    })?;
                    series.index().len() > other.index().len()
                }
            };
            if longest {
                self.0.insert(key, (run.seed, series));
            }
        }
        Ok(())
    }
}

const EXPECTED: &str = "expected the same indices in all runs of a cell; that runs may end earlier \
                        than others is said by the system that makes them (lengths_differ), or in \
                        the study: metrics = [{ name = ..., index = { lengths_differ = true } }]";

fn series(value: &Value) -> Result<Series, String> {
    Series::from_json(value)
}

/// Whether two curves may be of one cell.
fn agree(metric: &Metric, here: &Series, there: &Series) -> Result<(), String> {
    let (here, there) = (here.index(), there.index());
    let apart = here.iter().zip(there).find(|(a, b)| a != b);
    if let Some((here, there)) = apart {
        return Err(format!("the index {here} is here where {there} is"));
    }
    let may_differ = metric
        .index
        .as_ref()
        .is_some_and(|index| index.lengths_differ);
    if here.len() != there.len() && !may_differ {
        let (here, there) = (told(here), told(there));
        return Err(format!("{here} here, {there}"));
    }
    Ok(())
}

fn told(index: &[f64]) -> String {
    match index {
        [] => "no index".to_owned(),
        [only] => format!("1 index, {only},"),
        [first, .., last] => format!("{} indices, from {first} to {last},", index.len()),
    }
}

fn place(manifest: &Manifest, run: &RunRecord, metric: &Metric) -> String {
    let (cell, seed, name) = (run.cell, run.seed, &metric.name);
    let factors = manifest.factors.iter();
    let texts = manifest.cells.get(cell).map(|cell| cell.texts.as_slice());
    let values = factors.zip(texts.unwrap_or_default());
    let values: Vec<String> = values
        .map(|(factor, text)| format!("{} = {text}", factor.name))
        .collect();
    let values = values.join(", ");
    format!("metric {name} of cell {cell} ({values}), seed {seed}")
}
