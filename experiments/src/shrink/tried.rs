//! What was tried and what came of it, kept in a file: a search that is started again does not try it again.
//!
//! The first line says of which search it is; each other line is a scenario, by a hash of its text, and its
//! verdict. A last line that was cut off is as if it had not been written.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;
use xxhash_rust::xxh3::xxh3_128;

use super::trial::Verdict;

/// The longest file of verdicts that is read [byte].
const MAX_BYTES: u64 = 1 << 30;

/// Which search verdicts are of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Search {
    /// The version of the program.
    pub(super) farside: String,
    /// What must never happen, and is to.
    pub(super) violates: String,
    /// A hash of the scenario that it begins with.
    pub(super) scenario: String,
}

#[derive(Serialize, Deserialize)]
struct Line {
    scenario: String,
    verdict: Verdict,
}

/// What is wrong with a file of verdicts.
#[derive(Debug, Error)]
pub enum TriedError {
    /// It cannot be read or written.
    #[error("{}: {source}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It is something else, or of another search.
    #[error("{}: holds what was tried for {found}, not for {expected}: remove it, or name another with --state", .path.display())]
    Other {
        /// The file.
        path: PathBuf,
        /// What it is of.
        found: String,
        /// What this search is.
        expected: String,
    },
}

impl TriedError {
    /// Whether it could not be written.
    pub(crate) fn is_of_output(&self) -> bool {
        matches!(self, TriedError::Io { .. })
    }
}

/// Verdicts by scenario.
pub(super) struct Verdicts {
    path: PathBuf,
    file: File,
    known: BTreeMap<u128, Verdict>,
    /// Those that were there at the start.
    before: BTreeSet<u128>,
}

/// What a scenario is known by.
pub(super) fn key(text: &str) -> u128 {
    xxh3_128(text.as_bytes())
}

/// A key as it is written.
pub(super) fn written(key: u128) -> String {
    format!("{key:032x}")
}

impl Verdicts {
    /// Opens the file of a search, or begins one.
    pub(super) fn open(path: &Path, search: &Search) -> Result<Verdicts, TriedError> {
        let io = |source| TriedError::Io {
            path: path.to_owned(),
            source,
        };
        let text = match std::fs::metadata(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(io(error)),
            Ok(found) if !found.is_file() || found.len() > MAX_BYTES => {
                return Err(io(io::ErrorKind::InvalidData.into()));
            }
            Ok(_) => std::fs::read_to_string(path).map_err(io)?,
        };
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        let mut lines = text[..whole].lines();
        let mut known = BTreeMap::new();
        if let Some(first) = lines.next() {
            let found: Option<Search> = serde_json::from_str(first).ok();
            if found.as_ref() != Some(search) {
                let named = |of: &Search| format!("{} of scenario {}", of.violates, of.scenario);
                return Err(TriedError::Other {
                    path: path.to_owned(),
                    found: found.as_ref().map_or("something else".to_owned(), |found| {
                        match found.farside == search.farside {
                            true => named(found),
                            false => format!("{} by {}", named(found), found.farside),
                        }
                    }),
                    expected: named(search),
                });
            }
            for line in lines {
                let line: Option<Line> = serde_json::from_str(line).ok();
                let key = |line: &Line| u128::from_str_radix(&line.scenario, 16).ok();
                if let Some((key, line)) = line.and_then(|line| Some((key(&line)?, line))) {
                    known.insert(key, line.verdict);
                }
            }
        } else if !text.is_empty() {
            return Err(TriedError::Other {
                path: path.to_owned(),
                found: "something else".to_owned(),
                expected: search.violates.clone(),
            });
        }
        let mut options = OpenOptions::new();
        let mut file = options.append(true).create(true).open(path).map_err(io)?;
        file.set_len(whole as u64).map_err(io)?;
        if whole == 0 {
            write_line(&mut file, search).map_err(io)?;
        }
        Ok(Verdicts {
            path: path.to_owned(),
            file,
            before: known.keys().copied().collect(),
            known,
        })
    }

    pub(super) fn get(&self, key: u128) -> Option<&Verdict> {
        self.known.get(&key)
    }

    /// Whether a verdict was there at the start.
    pub(super) fn is_known_before(&self, key: u128) -> bool {
        self.before.contains(&key)
    }

    /// How many were there at the start.
    pub(super) fn known_before(&self) -> usize {
        self.before.len()
    }

    /// Keeps a verdict.
    pub(super) fn keep(&mut self, key: u128, verdict: Verdict) -> Result<(), TriedError> {
        let line = Line {
            scenario: written(key),
            verdict,
        };
        let kept = write_line(&mut self.file, &line).map_err(|source| TriedError::Io {
            path: self.path.clone(),
            source,
        });
        self.known.insert(key, line.verdict);
        kept
    }
}

/// Writes a line at once, so that none is cut by an interrupt.
fn write_line(file: &mut File, value: &impl Serialize) -> io::Result<()> {
    let mut line = serde_json::to_vec(value)?;
    line.push(b'\n');
    file.write_all(&line)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn search(violates: &str) -> Search {
        Search {
            farside: "1".to_owned(),
            violates: violates.to_owned(),
            scenario: written(7),
        }
    }

    #[test]
    fn verdicts_are_there_again_and_a_line_that_was_cut_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tried");
        let violates = Verdict::Violates {
            end_ns: 5,
            idle: vec![3],
        };
        let mut verdicts = Verdicts::open(&path, &search("x")).unwrap();
        verdicts.keep(1, violates.clone()).unwrap();
        verdicts.keep(2, Verdict::Holds).unwrap();
        verdicts.keep(3, Verdict::Impossible).unwrap();
        drop(verdicts);
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, &text[..text.len() - 5]).unwrap();
        let mut verdicts = Verdicts::open(&path, &search("x")).unwrap();
        assert_eq!((verdicts.get(1), verdicts.get(3)), (Some(&violates), None));
        assert_eq!(
            (verdicts.get(2), verdicts.known_before()),
            (Some(&Verdict::Holds), 2)
        );
        verdicts.keep(3, Verdict::Holds).unwrap();
        drop(verdicts);
        let verdicts = Verdicts::open(&path, &search("x")).unwrap();
        assert_eq!(
            (verdicts.get(3), verdicts.known_before()),
            (Some(&Verdict::Holds), 3)
        );
    }

    #[test]
    fn what_is_of_another_search_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tried");
        drop(Verdicts::open(&path, &search("x")).unwrap());
        let error = Verdicts::open(&path, &search("y"))
            .err()
            .unwrap()
            .to_string();
        assert!(
            error.contains("was tried for x of scenario 0000"),
            "{error}"
        );
        for text in ["something\nelse\n", "something else"] {
            std::fs::write(&path, text).unwrap();
            assert!(Verdicts::open(&path, &search("x")).is_err());
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
    }
}
