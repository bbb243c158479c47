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

    /// Whether the shard has what is at `place` of a count from 0.
    pub(super) fn has(self, place: usize) -> bool {
        place % self.of as usize == self.index as usize - 1
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
            return match foreign_entry(folder)? {
                None => Ok(Found::Nothing),
                Some(entry) => Err(StoreError::Foreign {
                    path: folder.to_owned(),
                    entry,
                }),
            };
        }
        let there = load::manifest(folder)?;
        if there == *manifest {
            return Ok(Found::Same);
        }
        // What others published and how it is plotted decide nothing about the runs, and are often
        // written after them.
        let extended = Manifest {
            seeds: manifest.seeds.clone(),
            published: manifest.published.clone(),
            report: manifest.report.clone(),
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

/// The first entry of a folder that no killed process of ours can have left in an empty one.
fn foreign_entry(folder: &Path) -> Result<Option<String>, StoreError> {
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(io(folder, "cannot read it")(error)),
    };
    let mut names = Vec::new();
    for entry in entries {
        let entry = entry.map_err(io(folder, "cannot read it"))?;
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
    let beside = path.with_file_name(format!(".{name}.{process}"));
    std::fs::write(&beside, bytes).map_err(io(&beside, "cannot write it"))?;
    std::fs::rename(&beside, path).map_err(io(path, "cannot replace it"))
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
        Err(error) => return Err(io(path, "cannot read it")(error)),
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
