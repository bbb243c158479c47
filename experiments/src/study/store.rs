//! The results folder of a study.
//!
//! `manifest.json` says what is run. `runs.jsonl` holds a line for each run that is done, appended
//! whole as it ends, in the order of the wall clock; a shard writes `runs-1-of-4.jsonl`.
//! `times.jsonl` holds wall times, which differ from machine to machine and are never compared.
//! A process that is killed leaves at most one cut line at the end, which is cut off when the study
//! goes on.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::error::{StoreError, io};
use super::load::{self, MANIFEST};
use super::results::{Manifest, RunRecord};

/// Which part of a study's runs a process does.
///
/// ```
/// use farside_experiments::study::Shard;
/// let shard: Shard = "2/4".parse().unwrap();
/// assert_eq!((shard.index, shard.of), (2, 4));
/// assert!("5/4".parse::<Shard>().is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which one, from 1.
    pub index: u32,
    /// How many there are.
    pub of: u32,
}

impl Shard {
    /// All runs.
    pub const WHOLE: Shard = Shard { index: 1, of: 1 };

    /// Which of `of` shards, from 1, has the run of a cell with the seed at `place`.
    ///
    /// Runs are numbered seed by seed, so that earlier ones keep their numbers when seeds are added,
    /// and any number of shards gets as many runs each, but for one. Each seed begins with another
    /// cell: else, where there are as many shards as cells, one would have all of the slowest.
    /// With a stopping rule whole cells are in a shard, as all runs of a cell decide together.
    pub(super) fn index_of(manifest: &Manifest, of: u32, cell: usize, place: usize) -> u32 {
        let cells = manifest.cells.len();
        let number = match manifest.stop {
            Some(_) => cell,
            None => place * cells + (cell + place) % cells,
        };
        (number % of as usize) as u32 + 1
    }

    /// Whether the run of a cell with the seed at `place` is in this shard.
    pub(super) fn has(self, manifest: &Manifest, cell: usize, place: usize) -> bool {
        Self::index_of(manifest, self.of, cell, place) == self.index
    }

    /// A file's name with the shard in it.
    fn file(self, stem: &str, ending: &str) -> String {
        match self {
            Shard::WHOLE => format!("{stem}{ending}"),
            Shard { index, of } => format!("{stem}-{index}-of-{of}{ending}"),
        }
    }
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text
            .split_once('/')
            .and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match parsed {
            Some((index, of)) if index >= 1 && index <= of => Ok(Shard { index, of }),
            _ => Err("expected which shard of how many, as in 1/4".to_owned()),
        }
    }
}

/// Wall times of a run.
#[derive(Serialize)]
pub(super) struct Times {
    pub(super) cell: usize,
    pub(super) seed: u64,
    pub(super) setup_s: f64,
    pub(super) run_s: f64,
}

/// What a folder holds, seen from a study that wants to write there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// Nothing yet.
    Nothing,
    /// Results of the same study.
    Same,
    /// Results of the same study, with fewer seeds, beside other published figures or
    /// plotted otherwise.
    Earlier,
}

/// A results folder that runs are written to. One process at a time has it, or the shard of it.
pub(super) struct Store {
    runs: (PathBuf, File),
    times: (PathBuf, File),
    /// The operating system lets go of it when the process ends, however it ends.
    _lock: File,
}

impl Store {
    /// Looks at the folder, and leaves it as it is.
    ///
    /// # Errors
    /// When it holds anything else than results of this study.
    pub(super) fn look(folder: &Path, manifest: &Manifest) -> Result<Found, StoreError> {
        let path = folder.join(MANIFEST);
        if !path.exists() {
            match foreign_entry(folder)? {
                None => return Ok(Found::Nothing),
                // Another shard has begun since we looked.
                Some(_) if File::open(&path).is_ok() => {}
                Some(entry) => {
                    return Err(StoreError::Foreign {
                        path: folder.to_owned(),
                        entry,
                    });
                }
            }
        }
        let there = load::manifest(folder)?;
        if there == *manifest {
            return Ok(Found::Same);
        }
        // What others published and how it is plotted decide nothing about the runs, and are often
        // written after them. Nor does which way a metric is better, which older versions did not
        // write.
        let mut metrics = there.metrics.clone();
        for (metric, ours) in metrics.iter_mut().zip(&manifest.metrics) {
            metric.better = ours.better;
        }
        let extended = Manifest {
            seeds: manifest.seeds.clone(),
            published: manifest.published.clone(),
            report: manifest.report.clone(),
            metrics,
            ..there.clone()
        };
        if extended == *manifest && manifest.seeds.starts_with(&there.seeds) {
            return Ok(Found::Earlier);
        }
        Err(StoreError::Other {
            path: folder.to_owned(),
            difference: load::difference(&there, manifest),
        })
    }

    /// Opens the folder, or makes it, for this process alone. Seeds may have been added: the runs
    /// with the earlier ones are kept.
    ///
    /// # Errors
    /// When it holds anything else, when another process has it, or the system refuses.
    pub(super) fn open(
        folder: &Path,
        manifest: &Manifest,
        shard: Shard,
    ) -> Result<(Store, Vec<RunRecord>), StoreError> {
        Self::look(folder, manifest)?;
        std::fs::create_dir_all(folder).map_err(io(folder, "cannot make it"))?;
        let lock = lock(&folder.join(shard.file("lock", "")))?;
        // Only now nobody else changes it.
        if Self::look(folder, manifest)? != Found::Same {
            let text =
                serde_json::to_string_pretty(manifest).map_err(|error| StoreError::Corrupt {
                    path: folder.join(MANIFEST),
                    line: None,
                    message: format!("cannot be written as JSON: {error}"),
                })?;
            replace(&folder.join(MANIFEST), (text + "\n").as_bytes())?;
            // The table of a study with fewer seeds would pass for this one's.
            let _ = std::fs::remove_file(folder.join("results.csv"));
            let _ = std::fs::remove_file(folder.join("values.csv"));
        }
        let runs = folder.join(shard.file("runs", ".jsonl"));
        cut_off_half_a_line(&runs)?;
        let times = folder.join(shard.file("times", ".jsonl"));
        cut_off_half_a_line(&times)?;
        let store = Store {
            runs: appending(runs)?,
            times: appending(times)?,
            _lock: lock,
        };
        let known = load::runs(folder, manifest)?;
        Ok((store, known))
    }

    /// Adds a run.
    ///
    /// # Errors
    /// When the disk is full, or the system refuses for another reason.
    pub(super) fn append(&mut self, record: &RunRecord, times: &Times) -> Result<(), StoreError> {
        append(&mut self.runs, record)?;
        append(&mut self.times, times)
    }
}

fn append((path, file): &mut (PathBuf, File), line: &impl Serialize) -> Result<(), StoreError> {
    let text = serde_json::to_vec(line).map_err(|error| StoreError::Corrupt {
        path: path.clone(),
        line: None,
        message: format!("cannot be written as JSON: {error}"),
    });
    let mut text = text?;
    text.push(b'\n');
    // In one piece: a reader, or who goes on after a kill, sees whole lines but for the last.
    let written = file.write_all(&text).and_then(|()| file.flush());
    written.map_err(io(path, "cannot write to it"))
}

/// The files that this shard of a study writes in its results folder.
pub(crate) fn outputs(folder: &Path, shard: Shard) -> Vec<PathBuf> {
    let own = [("lock", ""), ("runs", ".jsonl"), ("times", ".jsonl")];
    let own = own.map(|(stem, ending)| shard.file(stem, ending));
    let common = [MANIFEST, "results.csv", "values.csv"].map(str::to_owned);
    let names = own.into_iter().chain(common);
    names.map(|name| folder.join(name)).collect()
}

/// The first entry of a folder that no killed process of ours can have left in an empty one.
fn foreign_entry(folder: &Path) -> Result<Option<String>, StoreError> {
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(io(folder, "cannot keep results in it")(error)),
    };
    let mut names = Vec::new();
    for entry in entries {
        let entry = entry.map_err(io(folder, "cannot keep results in it"))?;
        names.push(entry.file_name().to_string_lossy().into_owned());
    }
    names.sort();
    let ours = |name: &String| {
        name == "lock" || name.starts_with("lock-") || name.starts_with(".manifest.json.")
    };
    Ok(names.into_iter().find(|name| !ours(name)))
}

fn lock(path: &Path) -> Result<File, StoreError> {
    let mut options = OpenOptions::new();
    let file = options.create(true).append(true).open(path);
    let file = file.map_err(io(path, "cannot make it"))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(StoreError::Busy {
            path: path.to_owned(),
        }),
        Err(TryLockError::Error(error)) => Err(io(path, "cannot lock it")(error)),
    }
}

/// Writes a file so that it is there whole or not at all.
///
/// # Errors
/// When the system refuses.
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let process = std::process::id();
    // On a folder that machines share, another's process may have the same number.
    for attempt in 0_u32.. {
        let beside = path.with_file_name(format!(".{name}.{process}-{attempt}"));
        let mut file = match File::create_new(&beside) {
            Ok(file) => file,
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => continue,
            Err(error) => return Err(io(&beside, "cannot write it")(error)),
        };
        let written = file.write_all(bytes).and_then(|()| file.flush());
        written.map_err(io(&beside, "cannot write it"))?;
        return std::fs::rename(&beside, path).map_err(io(path, "cannot replace it"));
    }
    unreachable!("there are more names than files")
}

fn appending(path: PathBuf) -> Result<(PathBuf, File), StoreError> {
    let mut options = OpenOptions::new();
    let file = options.create(true).append(true).open(&path);
    let file = file.map_err(io(&path, "cannot open it"))?;
    Ok((path, file))
}

/// Drops what follows the last whole line: a process was killed while it wrote it.
fn cut_off_half_a_line(path: &Path) -> Result<(), StoreError> {
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(io(path, "cannot go on with it")(error)),
    };
    let whole = bytes.iter().rposition(|byte| *byte == b'\n');
    let whole = whole.map_or(0, |at| at + 1);
    if whole == bytes.len() {
        return Ok(());
    }
    let file = OpenOptions::new().write(true).open(path);
    let file = file.map_err(io(path, "cannot open it"))?;
    file.set_len(whole as u64)
        .map_err(io(path, "cannot cut it"))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::super::fabricated;
    use super::{Shard, Store, replace};

    proptest! {
        /// Any number of shards gets as many runs each, but for one, and none is nobody's.
        #[test]
        fn shards_have_as_many_runs(cells in 1_usize..9, seeds in 1_usize..20, of in 1_u32..40) {
            let mut manifest = fabricated::study("s", vec![fabricated::loss()], 1).manifest;
            manifest.cells = vec![manifest.cells[0].clone(); cells];
            let mut counts: BTreeMap<u32, usize> = (1..=of).map(|index| (index, 0)).collect();
            for cell in 0..cells {
                for place in 0..seeds {
                    let index = Shard::index_of(&manifest, of, cell, place);
                    *counts.get_mut(&index).expect("a shard") += 1;
                    let having = (1..=of).filter(|index| {
                        Shard { index: *index, of }.has(&manifest, cell, place)
                    });
                    prop_assert_eq!(having.collect::<Vec<_>>(), [index]);
                }
            }
            let least = counts.values().min();
            let most = counts.values().max();
            prop_assert!(most.zip(least).is_some_and(|(most, least)| most - least <= 1), "{counts:?}");
        }
    }

    /// The shards of a job array all begin at one time, in a folder that is not there.
    #[test]
    fn shards_that_begin_together_share_a_folder() {
        let manifest = fabricated::study("s", vec![fabricated::loss()], 1).manifest;
        for _ in 0..40 {
            let folder = tempfile::tempdir().unwrap();
            let results = folder.path().join("r");
            let open = |index| {
                let opened = Store::open(&results, &manifest, Shard { index, of: 8 });
                opened.map(|_| ()).map_err(|error| error.to_string())
            };
            let opened: Vec<_> = std::thread::scope(|scope| {
                let threads: Vec<_> = (1..=8)
                    .map(|index| scope.spawn(move || open(index)))
                    .collect();
                threads
                    .into_iter()
                    .map(|thread| thread.join().unwrap())
                    .collect()
            });
            assert!(opened.iter().all(Result::is_ok), "{opened:?}");
        }
    }

    /// A process of another machine, with our number, that is about to do the same.
    #[test]
    fn a_file_is_replaced_beside_one_that_another_machine_writes() {
        let folder = tempfile::tempdir().unwrap();
        let theirs = format!(".x.json.{}-0", std::process::id());
        std::fs::write(folder.path().join(&theirs), "half").unwrap();
        replace(&folder.path().join("x.json"), b"whole").unwrap();
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        assert_eq!(
            (read("x.json"), read(&theirs)),
            ("whole".to_owned(), "half".to_owned())
        );
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
