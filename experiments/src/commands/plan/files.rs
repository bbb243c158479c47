//! The files of planning, read: models and problems with what they include, projects in `.sch`,
//! plans.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use farside_planning::draw::DrawError;
use farside_planning::language::{self, Disk, Finding, Findings, Options, Severity};
use farside_planning::model::{Model, Problem};
use farside_planning::plan::{self, Plan};
use farside_planning::sch::{self, SchError};
use thiserror::Error;

use crate::commands::CommandError;

/// The most bytes of a model or a problem that are read.
const MAX_TEXT_BYTES: usize = 16 << 20;

/// Why a file is not what a command of planning takes.
#[derive(Debug, Error)]
pub(crate) enum PlanError {
    /// It cannot be read.
    #[error("{}: cannot read it: {source}", .path.display())]
    Read {
        path: PathBuf,
        source: std::io::Error,
    },
    /// It is too large.
    #[error("{}: it has more than {most_bytes} bytes, which are the most that are read", .path.display())]
    TooLarge { path: PathBuf, most_bytes: usize },
    /// It is no text.
    #[error("{}:{line}: byte {byte} of the line is no text in UTF-8", .path.display())]
    NoText {
        path: PathBuf,
        line: usize,
        byte: usize,
    },
    /// A model or a problem in which something is wrong.
    #[error("{}: this is no {what}:\n{}{}", .path.display(), Findings(.findings.clone()), more(*.omitted))]
    Findings {
        path: PathBuf,
        what: &'static str,
        findings: Vec<Finding>,
        omitted: usize,
    },
    /// A text that has no normal form.
    #[error("{}: its lists are not well formed:\n{source}", .path.display())]
    NoForm { path: PathBuf, source: Findings },
    /// No project.
    #[error("{}: {source}", .path.display())]
    Sch { path: PathBuf, source: SchError },
    /// No plan.
    #[error("{}: {source}", .path.display())]
    Plan {
        path: PathBuf,
        source: plan::PlanError,
    },
    /// A plan that cannot be drawn.
    #[error("{}: {source}", .path.display())]
    Draw { path: PathBuf, source: DrawError },
    /// A plan that a planner made and that is none.
    #[error(
        "the planner {planner} made a plan that is not valid, which is a mistake in Farside: {first}"
    )]
    Planner { planner: String, first: String },
}

/// What is left out of a list.
pub(super) fn more(omitted: usize) -> String {
    match omitted {
        0 => String::new(),
        _ => format!("\nand {omitted} more"),
    }
}

/// Reads a file of at most so many bytes.
pub(super) fn read(path: &Path, most_bytes: usize) -> Result<Vec<u8>, CommandError> {
    let failed = |source| PlanError::Read {
        path: path.to_owned(),
        source,
    };
    let file = std::fs::File::open(path).map_err(failed)?;
    let mut bytes = Vec::new();
    // One more than is allowed, and it is too large.
    let mut limited = file.take(most_bytes as u64 + 1);
    limited.read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() > most_bytes {
        let path = path.to_owned();
        return Err(PlanError::TooLarge { path, most_bytes }.into());
    }
    Ok(bytes)
}

/// Reads a text of the language.
pub(super) fn read_text(path: &Path) -> Result<String, CommandError> {
    let bytes = read(path, MAX_TEXT_BYTES)?;
    String::from_utf8(bytes).map_err(|error| {
        let valid = error.utf8_error().valid_up_to();
        let before = &error.as_bytes()[..valid];
        let start = before.iter().rposition(|&byte| byte == b'\n');
        let error = PlanError::NoText {
            path: path.to_owned(),
            line: 1 + before.iter().filter(|&&byte| byte == b'\n').count(),
            byte: 1 + valid - start.map_or(0, |start| start + 1),
        };
        error.into()
    })
}

/// What a file is called in findings and plans.
pub(super) fn name(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// How texts are read: with the files on disk that they include.
pub(super) fn options(strict: bool) -> Options<'static> {
    Options {
        strict,
        include: Some(&Disk),
        ..Options::default()
    }
}

/// Whether a file is a project of the family RCPSP/max, by its ending.
pub(super) fn is_project(path: &Path) -> bool {
    let ending = path.extension();
    ending.is_some_and(|ending| ending.eq_ignore_ascii_case("sch"))
}

/// A model and a problem of it, and the files that say it.
pub(super) struct Task {
    pub(super) model: Arc<Model>,
    pub(super) problem: Arc<Problem>,
    /// All that was read, included files among it.
    pub(super) files: Vec<PathBuf>,
    /// What is odd.
    pub(super) warnings: Vec<Finding>,
}

impl Task {
    /// Reads a model and a problem, or a project, which is both.
    pub(super) fn read(model: &Path, problem: Option<&Path>) -> Result<Task, CommandError> {
        let Some(problem) = problem else {
            return Task::project(model);
        };
        let options = options(false);
        let read = language::read_model(&name(model), &read_text(model)?, &options);
        let refused = |path: &Path, what, findings, omitted| PlanError::Findings {
            path: path.to_owned(),
            what,
            findings,
            omitted,
        };
        let mut warnings = read.findings.clone();
        let Some(of) = read.value else {
            return Err(refused(model, "model", read.findings, read.omitted).into());
        };
        let text = read_text(problem)?;
        let read = language::read_problem(&name(problem), &text, &of, &options);
        warnings.extend(read.findings.iter().cloned());
        let Some(problem_read) = read.value else {
            return Err(refused(problem, "problem", read.findings, read.omitted).into());
        };
        let files = of.files.iter().chain(&problem_read.files);
        Ok(Task {
            files: files.map(PathBuf::from).collect(),
            model: Arc::new(of),
            problem: Arc::new(problem_read),
            warnings,
        })
    }

    fn project(path: &Path) -> Result<Task, CommandError> {
        let bytes = read(path, sch::MAX_FILE_BYTES)?;
        let read = sch::read(&name(path), &bytes);
        let (model, problem) = read.map_err(|source| PlanError::Sch {
            path: path.to_owned(),
            source,
        })?;
        Ok(Task {
            model: Arc::new(model),
            problem: Arc::new(problem),
            files: vec![path.to_owned()],
            warnings: Vec::new(),
        })
    }

    /// Says on stderr what is odd.
    pub(super) fn warn(&self) {
        for warning in &self.warnings {
            crate::commands::complain(warning);
        }
    }
}

/// Reads a plan.
pub(super) fn read_plan(path: &Path) -> Result<Plan, CommandError> {
    let bytes = read(path, plan::MAX_FILE_BYTES)?;
    let plan = Plan::from_json(&bytes).map_err(|source| PlanError::Plan {
        path: path.to_owned(),
        source,
    })?;
    Ok(plan)
}

/// How many of the findings are errors and warnings, in words.
pub(super) fn counted(findings: &[Finding], omitted: usize) -> String {
    let errors = findings
        .iter()
        .filter(|one| one.severity == Severity::Error)
        .count();
    let plural = |count: usize, what: &str| match count {
        1 => format!("1 {what}"),
        _ => format!("{count} {what}s"),
    };
    let (errors, warnings) = (errors, findings.len() - errors);
    let mut text = match (errors, warnings) {
        (0, 0) => "nothing to complain of".to_owned(),
        (0, warnings) => plural(warnings, "warning"),
        (errors, 0) => plural(errors, "error"),
        (errors, warnings) => format!(
            "{}, {}",
            plural(errors, "error"),
            plural(warnings, "warning")
        ),
    };
    if omitted > 0 {
        text += &format!(", and {omitted} more findings");
    }
    text
}
