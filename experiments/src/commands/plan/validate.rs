//! `farside plan validate`: whether a plan is valid, and if not, all that is wrong.

use std::path::{Path, PathBuf};

use farside_planning::checker::{self, MAX_VIOLATIONS};
use serde_json::json;

use super::files::{self, Task};
use crate::commands::{CommandError, Exit, output, print, print_json};

const AFTER: &str = "\
Exit codes:
  0  the plan is valid
  1  it is not
  2  a file is not what it should be";

#[derive(clap::Args)]
#[command(
    after_help = AFTER,
    override_usage = "farside plan validate [OPTIONS] MODEL PROBLEM PLAN.json\n       \
                      farside plan validate [OPTIONS] FILE.sch PLAN.json"
)]
pub(super) struct Args {
    /// The model, its problem and the plan; or a project and the plan
    #[arg(value_name = "FILE", num_args = 2..=3, required = true)]
    files: Vec<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> Result<Exit, CommandError> {
    output::spare(&args.files, &[])?;
    let (task, plan): (Task, &Path) = match args.files.as_slice() {
        [project, plan] if files::is_project(project) => (Task::read(project, None)?, plan),
        [model, problem, plan] if !files::is_project(model) => {
            (Task::read(model, Some(problem))?, plan)
        }
        _ => {
            let message = "expected MODEL PROBLEM PLAN.json, or FILE.sch PLAN.json";
            return Err(CommandError::Arguments(message.to_owned()));
        }
    };
    let read = files::read_plan(plan)?;
    let violations = checker::check(&task.model, &task.problem, &read);
    if args.json {
        print_json(&json!({ "valid": violations.is_empty(), "violations": violations }))?;
    } else {
        let mut text = String::new();
        for violation in &violations {
            text += &format!("{violation}\n");
        }
        let plan = plan.display();
        text += &match violations.len() {
            0 => format!(
                "{plan}: valid: {} tokens, {} goals achieved, makespan {}, score {}",
                read.tokens.len(),
                read.achieved.len(),
                read.makespan,
                read.score
            ),
            1 => format!("{plan}: not valid: 1 violation"),
            MAX_VIOLATIONS => format!("{plan}: not valid: {MAX_VIOLATIONS} violations or more"),
            count => format!("{plan}: not valid: {count} violations"),
        };
        print(text)?;
    }
    Ok(match violations.is_empty() {
        true => Exit::Done,
        false => Exit::Different,
    })
}
