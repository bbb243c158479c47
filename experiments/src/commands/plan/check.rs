//! `farside plan check`: what is wrong or odd with a model, or with a problem of it.

use std::path::{Path, PathBuf};

use farside_planning::language::{self, Finding, Read, Severity};
use serde_json::json;

use super::files::{self, Task};
use crate::commands::{CommandError, Exit, output, print, print_json};

const AFTER: &str = "\
Exit codes:
  0  nothing is wrong; there may be warnings
  1  something is wrong
  2  a file cannot be read";

#[derive(clap::Args)]
#[command(after_help = AFTER)]
pub(super) struct Args {
    /// The model, or a project in ProGen/max's format (.sch)
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// A problem of the model
    #[arg(value_name = "PROBLEM")]
    problem: Option<PathBuf>,
    /// Refuse what is allowed only for the sake of texts printed in papers
    #[arg(long)]
    strict: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> Result<Exit, CommandError> {
    let inputs: Vec<PathBuf> = [Some(&args.model), args.problem.as_ref()]
        .into_iter()
        .flatten()
        .cloned()
        .collect();
    output::spare(&inputs, &[])?;
    if files::is_project(&args.model) {
        let task = Task::read(&args.model, None)?;
        let goals = task.problem.goals.len();
        return tell(args, &args.model, &[], 0, &format!("{goals} activities"));
    }
    let options = files::options(args.strict);
    let text = files::read_text(&args.model)?;
    let model = language::read_model(&files::name(&args.model), &text, &options);
    let (Some(problem), Some(of)) = (&args.problem, &model.value) else {
        return finish(args, &args.model, &model);
    };
    let text = files::read_text(problem)?;
    let mut read = language::read_problem(&files::name(problem), &text, of, &options);
    read.findings.splice(..0, model.findings.iter().cloned());
    read.omitted += model.omitted;
    finish(args, problem, &read)
}

fn finish<T>(args: &Args, path: &Path, read: &Read<T>) -> Result<Exit, CommandError> {
    let counted = files::counted(&read.findings, read.omitted);
    tell(args, path, &read.findings, read.omitted, &counted)
}

fn tell(
    args: &Args,
    path: &Path,
    findings: &[Finding],
    omitted: usize,
    counted: &str,
) -> Result<Exit, CommandError> {
    let is_wrong = findings.iter().any(|one| one.severity == Severity::Error);
    if args.json {
        let list: Vec<_> = findings.iter().map(as_json).collect();
        print_json(&json!({ "valid": !is_wrong, "findings": list, "omitted": omitted }))?;
    } else {
        let mut text = String::new();
        for finding in findings {
            text += &format!("{finding}\n");
        }
        text += &format!("{}: {counted}", path.display());
        print(text)?;
    }
    Ok(match is_wrong {
        true => Exit::Different,
        false => Exit::Done,
    })
}

fn as_json(finding: &Finding) -> serde_json::Value {
    json!({
        "severity": match finding.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        },
        "file": finding.file,
        "line": finding.position.line,
        "column": finding.position.column,
        "expected": finding.expected,
        "found": finding.found,
        "nearest": finding.nearest,
    })
}
