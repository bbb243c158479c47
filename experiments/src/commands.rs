//! The commands, one file each, and what they share: errors and output.

pub(crate) mod builtin;
mod came;
pub(crate) mod cat;
pub(crate) mod check;
mod describe;
pub(crate) mod diff;
pub(crate) mod draw;
pub(crate) mod explain;
pub(crate) mod fork;
pub(crate) mod info;
mod interrupt;
mod kinds;
mod logged;
mod output;
pub(crate) mod plan;
pub(crate) mod plot;
pub(crate) mod problem;
mod progress;
pub(crate) mod recover;
pub(crate) mod replay;
pub(crate) mod report;
pub(crate) mod reproduce;
pub(crate) mod run;
pub(crate) mod shrink;
pub(crate) mod study;
mod table;
pub(crate) mod ties;
pub(crate) mod verify;
pub(crate) mod view;
pub(crate) mod why;

use std::io::Write;
use std::path::PathBuf;

use std::process::ExitCode;

use farside::BuildError;
use farside_logs::{LogError, is_hidden};
use serde::Serialize;
use thiserror::Error;

use crate::scenario::ScenarioError;
use crate::study::{StoreError, StudyError};

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Exit {
    Done = 0,
    Different = 1,
    Wrong = 2,
    Failed = 3,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        ExitCode::from(exit as u8)
    }
}

/// Why a command could not do its work.
#[derive(Debug, Error)]
pub(crate) enum CommandError {
    /// The scenario.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A study.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A results folder.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A log that is read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A log whose run cannot be executed again.
    #[error("{}: cannot be run again: {reason}", .path.display())]
    NotRepeatable { path: PathBuf, reason: String },
    /// A log of whose run there is no picture.
    #[error("{}: cannot be drawn: {reason}", .path.display())]
    NotDrawn { path: PathBuf, reason: String },
    /// The simulation could not start.
    #[error("the run could not start: {0}")]
    Build(#[from] BuildError),
    /// Something that another command takes.
    #[error("{given}: is {found}, and {wanted} is expected here\n  {advice}")]
    OtherKind {
        given: String,
        found: &'static str,
        wanted: &'static str,
        advice: String,
    },
    /// A figure that is not to be had as this kind of file.
    #[error(transparent)]
    Export(#[from] crate::export::ExportError),
    /// A run that cannot be made small.
    #[error(transparent)]
    Shrink(#[from] crate::shrink::ShrinkError),
    /// A file of planning, or what a planner made of it.
    #[error(transparent)]
    Plan(#[from] plan::PlanError),
    /// Arguments that do not go together.
    #[error("{0}")]
    Arguments(String),
    /// Ctrl-C before there was an answer.
    #[error("interrupted: {0}")]
    Interrupted(String),
    /// Two things that a command writes would be one file.
    #[error("{}: is written to by this command twice: it is also {other}", .out.display())]
    TwoOutputs { out: PathBuf, other: String },
    /// A file that is there already, and is something else than what would be written.
    #[error("{}: is there already and is no {what}: it is not replaced", .path.display())]
    InTheWay { path: PathBuf, what: &'static str },
    /// A file that cannot be written.
    #[error("{}: cannot write it: {source}", .path.display())]
    Write {
        path: PathBuf,
        source: std::io::Error,
    },
    /// Standard output.
    #[error("cannot write to standard output: {0}")]
    Output(#[source] std::io::Error),
    /// A result that is no JSON.
    #[error("cannot write the result as JSON: {0}")]
    Json(#[from] serde_json::Error),
}

impl CommandError {
    /// The exit code it deserves.
    pub(crate) fn exit(&self) -> Exit {
        match self {
            CommandError::Study(StudyError::CellFails { .. } | StudyError::Workers(_)) => {
                Exit::Failed
            }
            CommandError::Study(StudyError::Store(error)) | CommandError::Store(error)
                if error.is_of_output() =>
            {
                Exit::Failed
            }
            CommandError::Log(error) if error.is_of_output() => Exit::Failed,
            CommandError::Plan(plan::PlanError::Planner { .. }) => Exit::Failed,
            CommandError::Shrink(error) if error.is_of_output() => Exit::Failed,
            CommandError::Plan(_)
            | CommandError::Shrink(_)
            | CommandError::Study(_)
            | CommandError::Store(_)
            | CommandError::Scenario(_)
            | CommandError::Log(_)
            | CommandError::NotRepeatable { .. }
            | CommandError::NotDrawn { .. }
            | CommandError::InTheWay { .. }
            | CommandError::TwoOutputs { .. }
            | CommandError::OtherKind { .. }
            | CommandError::Export(_)
            | CommandError::Arguments(_) => Exit::Wrong,
            // Names come from scenarios.
            CommandError::Build(
                BuildError::BadName { .. }
                | BuildError::ReservedName { .. }
                | BuildError::DuplicateName { .. },
            ) => Exit::Wrong,
            CommandError::Build(_)
            | CommandError::Interrupted(_)
            | CommandError::Write { .. }
            | CommandError::Output(_)
            | CommandError::Json(_) => Exit::Failed,
        }
    }
}

pub(crate) fn print_bytes(bytes: &[u8]) -> Result<(), CommandError> {
    let written = Printed.write_all(bytes).and_then(|()| Printed.flush());
    written.map_err(CommandError::Output)
}

/// Standard output, for what is printed as it is read.
pub(crate) struct Printed;

impl Write for Printed {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        #[cfg(test)]
        if kept::keep(bytes) {
            return Ok(bytes.len());
        }
        std::io::stdout().lock().write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        std::io::stdout().lock().flush()
    }
}

/// Prints a text, and a newline if it has none at its end; see [`shown`].
pub(crate) fn print(text: impl ToString) -> Result<(), CommandError> {
    print_lines(shown(&text.to_string()))
}

/// Prints a document that programs read, JSON or TOML: escapes are those of its strings.
pub(crate) fn print_document(text: &str) -> Result<(), CommandError> {
    print_lines(obeyed_by_no_terminal(text, &|letter| {
        format!("\\u{:04x}", u32::from(letter))
    }))
}

fn print_lines(mut text: String) -> Result<(), CommandError> {
    if !text.ends_with('\n') {
        text.push('\n');
    }
    print_bytes(text.as_bytes())
}

/// Prints one JSON document.
pub(crate) fn print_json(value: &impl Serialize) -> Result<(), CommandError> {
    print_document(&serde_json::to_string_pretty(value)?)
}

/// Says something on standard error. If that is gone, the exit code still tells.
pub(crate) fn complain(text: impl ToString) {
    let text = shown(&text.to_string());
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// A text for people, as all that is printed or said is shown: names in it may be anybody's, and what
/// a terminal would obey is escaped.
pub(crate) fn shown(text: &str) -> String {
    obeyed_by_no_terminal(text, &|letter| letter.escape_default().to_string())
}

/// A text of several lines in which what a terminal would obey is escaped, except for the ends of
/// lines and tabs.
fn obeyed_by_no_terminal(text: &str, escape: &dyn Fn(char) -> String) -> String {
    let obeyed = |letter: char| !matches!(letter, '\n' | '\t') && is_hidden(letter);
    if !text.chars().any(obeyed) {
        return text.to_owned();
    }
    let mut out = String::with_capacity(text.len() + 16);
    for letter in text.chars() {
        match obeyed(letter) {
            true => out.push_str(&escape(letter)),
            false => out.push(letter),
        }
    }
    out
}

/// What commands print while tests keep it.
#[cfg(test)]
pub(crate) mod kept {
    use std::cell::RefCell;

    thread_local! {
        static PRINTED: RefCell<Option<Vec<u8>>> = const { RefCell::new(None) };
    }

    /// Keeps what is printed on this thread, if somebody asked for it.
    pub(super) fn keep(bytes: &[u8]) -> bool {
        PRINTED.with_borrow_mut(|printed| match printed {
            Some(printed) => {
                printed.extend_from_slice(bytes);
                true
            }
            None => false,
        })
    }

    /// What `work` prints on this thread, which goes nowhere else.
    pub(crate) fn printed<T>(work: impl FnOnce() -> T) -> (T, Vec<u8>) {
        PRINTED.set(Some(Vec::new()));
        let done = work();
        (done, PRINTED.take().unwrap_or_default())
    }
}
