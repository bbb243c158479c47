//! What the shards of a study have done, and which of them have runs left.

use std::collections::BTreeMap;
use std::path::Path;

use super::error::{StoreError, StudyError};
use super::load;
use super::plan::StudyPlan;
use super::results::Results;
use super::store::{Found, Shard, Store};

impl StudyPlan {
    /// How many shards can have a run each: with a stopping rule they have whole cells.
    pub(crate) fn most_shards(&self) -> usize {
        let cells = self.manifest.cells.len();
        match self.manifest.stop {
            Some(_) => cells,
            None => cells * self.manifest.seeds.len(),
        }
    }
}

/// What shards have done of a study.
pub(crate) struct Merged {
    /// The runs that there are.
    pub(crate) results: Results,
    /// Shards that have runs left, from 1, and how many.
    pub(crate) left: BTreeMap<u32, usize>,
}

impl Merged {
    /// Reads what `shards` shards of the study have done in a folder.
    ///
    /// # Errors
    /// When the folder holds no results or other ones, or they cannot be read.
    pub(crate) fn load(plan: &StudyPlan, folder: &Path, shards: u32) -> Result<Self, StudyError> {
        match Store::look(folder, &plan.manifest)? {
            Found::Same => {}
            Found::Nothing => {
                let path = folder.to_owned();
                return Err(StoreError::NoManifest { path }.into());
            }
            Found::Earlier => {
                let there = load::manifest(folder)?;
                let difference = load::difference(&there, &plan.manifest);
                let message = format!(
                    "{}: the shards have not begun with what is asked here: {difference}\n  run \
                     them again: they go on from what is there",
                    folder.display()
                );
                return Err(StudyError::Argument(message));
            }
        }
        let results = Results::load(folder)?;
        let mut left = BTreeMap::new();
        for (cell, place) in results.missing_runs() {
            let shard = Shard::index_of(&results.manifest, shards, cell, place);
            *left.entry(shard).or_insert(0) += 1;
        }
        Ok(Merged { results, left })
    }
}
