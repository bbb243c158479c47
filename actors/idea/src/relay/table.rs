//! The table of a relay: which procedure is which command, or which readings, in which units. It is
//! read from TOML and checked against the model whose registers the relay serves.

mod entry;

use std::collections::BTreeMap;
use std::sync::Arc;

use farside_actors::rover::RoverModel;
use farside_planning::model::{Model, PredicateId, TimelineId, TypeId, Values};
use serde::Deserialize;
use thiserror::Error;
use toml::Spanned;

use super::action::{Action, Name, Output};
use crate::wording::{self, WordingError};

/// Why a relay's table cannot be.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RelayError {
    /// It is no TOML, or has keys that no table has.
    #[error("{0}")]
    Syntax(#[from] toml::de::Error),
    /// An entry does not fit the model or the rover.
    #[error("{}{key}: {problem}", on_line(*line))]
    Entry {
        /// The line on which the procedure's entry begins; 0 if it stands in no text.
        line: usize,
        /// Which key, as `procedure.DriveTo.with.east`.
        key: String,
        /// What is wrong with it.
        problem: RelayProblem,
    },
    /// A procedure that a register can be loaded with is not in the table.
    #[error("{register} can say {procedure}, and no entry of the relay's table does")]
    Missing {
        /// The register.
        register: String,
        /// The procedure.
        procedure: String,
    },
    /// The model has no such timeline.
    #[error("{found:?} is no timeline of the model{}", suggestion(nearest))]
    Register {
        /// The name that was given.
        found: String,
        /// The nearest that there is, if any comes near.
        nearest: Option<String>,
    },
}

/// What is wrong with an entry of a relay's table.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RelayProblem {
    /// There is nothing of that name.
    #[error("{found:?} is no {what}{}", suggestion(nearest))]
    Unknown {
        /// What it would have to be.
        what: &'static str,
        /// The name that was given.
        found: String,
        /// The nearest that there is, if any comes near.
        nearest: Option<String>,
    },
    /// More or fewer of them than the model has.
    #[error("expected {expected} {what}, as the model has, found {actual}")]
    Count {
        /// `inputs` or `outputs`.
        what: &'static str,
        /// How many the model has.
        expected: usize,
        /// How many the entry uses.
        actual: usize,
    },
    /// Something else than what is there.
    #[error("expected {expected}, found {actual}")]
    Expected {
        /// What is to be there.
        expected: String,
        /// What is there.
        actual: String,
    },
}

fn on_line(line: usize) -> String {
    match line {
        0 => String::new(),
        line => format!("line {line}: "),
    }
}

fn suggestion(nearest: &Option<String>) -> String {
    farside::suggest::did_you_mean(nearest.as_deref())
}

impl RelayProblem {
    /// A name that is none of those that there are.
    fn unknown<'a>(
        what: &'static str,
        found: &str,
        names: impl Iterator<Item = &'a str>,
    ) -> RelayProblem {
        RelayProblem::Unknown {
            what,
            nearest: farside::suggest::nearest(found, names),
            found: found.to_owned(),
        }
    }

    fn expected(expected: impl Into<String>, actual: impl Into<String>) -> RelayProblem {
        RelayProblem::Expected {
            expected: expected.into(),
            actual: actual.into(),
        }
    }
}

/// A table as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TableText {
    #[serde(default)]
    ends: Ends,
    procedure: BTreeMap<String, Spanned<EntryText>>,
}

/// What statuses say of how a command ended: symbols of the model.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Ends {
    pub(super) done: Arc<str>,
    pub(super) failed: Arc<str>,
    pub(super) stopped: Arc<str>,
    pub(super) refused: Arc<str>,
}

impl Default for Ends {
    fn default() -> Self {
        let failed: Arc<str> = "failed".into();
        Ends {
            done: "ok".into(),
            failed: failed.clone(),
            stopped: failed.clone(),
            refused: failed,
        }
    }
}

/// A procedure's entry as it is written: one of `idle`, `command` and `outputs`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EntryText {
    #[serde(default)]
    idle: bool,
    command: Option<String>,
    #[serde(default)]
    with: toml::Table,
    status: Option<String>,
    #[serde(default)]
    outputs: toml::Table,
}

/// What a relay does for a procedure.
#[derive(Clone, Debug)]
pub(super) enum Entry {
    /// Nothing, until the register says something else.
    Idle,
    /// A command. How it ended is said in the output at a place among the outputs, if there is one.
    Command {
        action: Action,
        status: Option<usize>,
        /// How many outputs there are.
        outputs: usize,
    },
    /// A look at the rover's state: by place among the outputs what is said in it.
    Poll(Vec<Option<Output>>),
}

/// A register that a relay serves.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RelayRegister {
    /// Its name: that of the model's timeline.
    pub name: Arc<str>,
    /// The timeline.
    pub timeline: TimelineId,
}

/// A relay's table, checked against its model: see [`Relay`](super::Relay).
#[derive(Clone, Debug)]
pub struct RelayTable {
    pub(super) model: Arc<Model>,
    pub(super) ends: Ends,
    registers: Vec<RelayRegister>,
    /// By predicate.
    entries: Vec<Option<Entry>>,
}

impl RelayTable {
    /// Reads a table for the registers of these timelines of a model.
    ///
    /// # Errors
    ///
    /// If it is no such table; if it names a procedure, a parameter, a command, a reading or a unit
    /// that there is not, with the nearest that there is; if inputs are left over, outputs
    /// missing, or types or units do not fit; if a register can say what the table does not know.
    pub fn new(
        text: &str,
        model: Arc<Model>,
        timelines: &[&str],
    ) -> Result<RelayTable, RelayError> {
        let file: TableText = toml::from_str(text)?;
        let registers = timelines.iter().map(|name| register(&model, name));
        let registers = registers.collect::<Result<Vec<_>, _>>()?;
        let mut entries = vec![None; model.predicates.len()];
        for (name, entry) in &file.procedure {
            let line = text[..entry.span().start].matches('\n').count() + 1;
            let at = |key: &str, problem| RelayError::Entry {
                line,
                key: match key {
                    "" => format!("procedure.{name}"),
                    key => format!("procedure.{name}.{key}"),
                },
                problem,
            };
            let names = || model.predicates.iter().map(|one| one.name.as_str());
            let Some(predicate) = names().position(|one| one == name) else {
                let problem = RelayProblem::unknown("procedure of the model", name, names());
                return Err(at("", problem));
            };
            let read = entry::read(entry.get_ref(), &model, predicate, &file.ends);
            entries[predicate] = Some(read.map_err(|(key, problem)| at(&key, problem))?);
        }
        let table = RelayTable {
            model,
            ends: file.ends,
            registers,
            entries,
        };
        table.check_coverage()?;
        Ok(table)
    }

    fn check_coverage(&self) -> Result<(), RelayError> {
        for register in &self.registers {
            let mut says = self.model.timelines[register.timeline].predicates.iter();
            if let Some(predicate) = says.find(|&&one| self.entries[one].is_none()) {
                return Err(RelayError::Missing {
                    register: register.name.to_string(),
                    procedure: self.model.predicates[*predicate].name.clone(),
                });
            }
        }
        Ok(())
    }

    /// The registers, in the order in which they were named: a relay counts them so.
    pub fn registers(&self) -> &[RelayRegister] {
        &self.registers
    }

    /// Checks that a rover has every instrument that a command can name.
    ///
    /// # Errors
    ///
    /// If one is missing; the error has the nearest that there is.
    pub fn check_rover(&self, rover: &RoverModel) -> Result<(), RelayError> {
        let has = || rover.instruments.iter().map(|one| one.name.as_str());
        for (procedure, entry) in self.model.predicates.iter().zip(&self.entries) {
            let Some(Entry::Command { action, .. }) = entry else {
                continue;
            };
            let names = match action.instrument() {
                None => continue,
                Some(Name::Fixed(name)) => vec![name.to_string()],
                Some(Name::Input(place)) => self.symbols(procedure.parameters[place].of),
            };
            if let Some(name) = names.iter().find(|name| has().all(|one| one != **name)) {
                return Err(RelayError::Entry {
                    line: 0,
                    key: format!("procedure.{}", procedure.name),
                    problem: RelayProblem::unknown("instrument of the rover", name, has()),
                });
            }
        }
        Ok(())
    }

    /// The names of the symbols of a type.
    fn symbols(&self, of: TypeId) -> Vec<String> {
        let Values::Symbols(symbols) = &self.model.types[of].values else {
            return Vec::new();
        };
        let places = symbols.iter().filter_map(|&one| usize::try_from(one).ok());
        places
            .filter_map(|at| self.model.symbols.get(at).cloned())
            .collect()
    }

    /// What a register says when it is loaded with a procedure.
    pub(super) fn entry(
        &self,
        register: usize,
        procedure: &str,
    ) -> Result<(PredicateId, &Entry), WordingError> {
        let timeline = self.registers[register].timeline;
        let predicate = wording::procedure(&self.model, timeline, procedure)?;
        let entry = self
            .of(predicate)
            .expect("the table was checked to cover its registers");
        Ok((predicate, entry))
    }

    /// What is to be done for a procedure.
    pub(super) fn of(&self, predicate: PredicateId) -> Option<&Entry> {
        self.entries[predicate].as_ref()
    }
}

fn register(model: &Model, name: &str) -> Result<RelayRegister, RelayError> {
    let names = || model.timelines.iter().map(|one| one.name.as_str());
    match names().position(|one| one == name) {
        Some(timeline) => Ok(RelayRegister {
            name: name.into(),
            timeline,
        }),
        None => Err(RelayError::Register {
            found: name.to_owned(),
            nearest: farside::suggest::nearest(name, names()),
        }),
    }
}
