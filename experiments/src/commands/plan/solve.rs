//! `farside plan solve`: a plan for a problem, or why there is none.

use std::path::PathBuf;
use std::sync::Arc;

use clap::ValueEnum;
use farside_planning::checker;
use farside_planning::explain::{self, Explanation, Outcome, Request};
use farside_planning::model::Problem;
use farside_planning::plan::Plan;
use farside_planning::search::schedule::LoadError;
use farside_planning::search::{Answer, Both, Forward, Planner, Repair, Settings};
use serde::Serialize;

use super::files::{PlanError, Task};
use crate::commands::output::{self, Format};
use crate::commands::table::{Group, grouped, table};
use crate::commands::{CommandError, Exit, print, print_json};

/// Operations for each goal and fact, unless the user says how many.
const OPERATIONS: u64 = 100_000;

/// The most tokens of a plan that are printed.
const MOST_TOKENS: usize = 40;

const AFTER: &str = "\
An operation is a look at a time, a value, a token or a rule: the same problem takes as many on any
machine, and gives the same plan.

Exit codes:
  0  a plan was found
  1  there is none, or none was found: --explain says why
  2  a file is not what it should be
  3  the plan cannot be written";

#[derive(clap::Args)]
#[command(
    after_help = AFTER,
    override_usage = "farside plan solve [OPTIONS] MODEL PROBLEM\n       \
                      farside plan solve [OPTIONS] FILE.sch"
)]
pub(super) struct Args {
    /// The model and its problem; or a project in ProGen/max's format, which is both
    #[arg(value_name = "FILE", num_args = 1..=2, required = true)]
    files: Vec<PathBuf>,
    /// Who plans: `forward` searches completely, and proves what it says if the operations suffice;
    /// `repair` puts right what is wrong, and finds good plans of large problems; `both` gives
    /// forward a quarter of the operations, and the rest to repair if nothing is proven by then
    #[arg(long, value_name = "PLANNER", default_value = "both")]
    planner: Who,
    /// How many operations it may take; 100,000 for each goal and fact unless given. Explaining may
    /// take as many again
    #[arg(long, value_name = "N")]
    ops: Option<u64>,
    /// From which the random choices of repair follow
    #[arg(long, value_name = "N", default_value = "1")]
    seed: u64,
    /// Where to write the plan
    #[arg(long, value_name = "PLAN.json")]
    out: Option<PathBuf>,
    /// Say why there is no plan, or why goals are left out: which tokens, rules and lines, and which
    /// goals to drop
    #[arg(long)]
    explain: bool,
    /// Print JSON; it explains a missing plan in any case
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Who {
    Both,
    Forward,
    Repair,
}

/// What `plan solve --json` prints.
#[derive(Serialize)]
struct Document<'a> {
    /// Which planner found the plan, or looked for it.
    planner: &'a str,
    /// True if there is a plan, false if it is proven that there is none, else null.
    feasible: Option<bool>,
    /// Whether the answer is proven: that no plan is better, or that there is none.
    proven: bool,
    makespan: Option<i64>,
    score: Option<f64>,
    operations: u64,
    budget: u64,
    seed: u64,
    achieved: Vec<&'a str>,
    left_out: Vec<&'a str>,
    out: Option<String>,
    explanation: Option<&'a Explanation>,
    /// By goal that is left out, if asked for.
    explanations: &'a [Explanation],
}

/// What came of it.
struct Solved {
    planner: String,
    plan: Option<Plan>,
    proven: bool,
    operations: u64,
    explanation: Option<Explanation>,
    explanations: Vec<Explanation>,
}

pub(super) fn run(args: &Args) -> Result<Exit, CommandError> {
    let task = match args.files.as_slice() {
        [project] if super::files::is_project(project) => Task::read(project, None)?,
        [model, problem] if !super::files::is_project(model) => Task::read(model, Some(problem))?,
        [project, _] => {
            let message = format!(
                "{}: is a project, which needs no problem: `farside plan solve {0}`",
                project.display()
            );
            return Err(CommandError::Arguments(message));
        }
        _ => {
            let message = "expected MODEL PROBLEM, or FILE.sch".to_owned();
            return Err(CommandError::Arguments(message));
        }
    };
    task.warn();
    // Before the search, which may take long.
    let outputs = args.out.as_slice();
    output::spare(&task.files, outputs)?;
    if let Some(out) = &args.out {
        output::may_write(out, plan_beginning().as_bytes(), Format::Plan, &task.files)?;
    }
    let settings = Settings {
        operations: args.ops.unwrap_or_else(|| usual_operations(&task.problem)),
        seed: args.seed,
    };
    let solved = solve(args, &task, settings)?;
    let out = match (&args.out, &solved.plan) {
        (Some(out), Some(plan)) => {
            let text = plan.to_json();
            output::write_whole(out, text.as_bytes(), Format::Plan, &task.files)?;
            Some(out.display().to_string())
        }
        _ => None,
    };
    if args.json {
        print_document(args, &solved, settings, out)?;
    } else {
        print(in_words(args, &task.problem, &solved, settings, out))?;
    }
    Ok(match solved.plan {
        Some(_) => Exit::Done,
        None => Exit::Different,
    })
}

/// How all plans that are written begin.
fn plan_beginning() -> String {
    Plan::default().to_json()
}

/// A number that is worth waiting for, by the size of the problem.
fn usual_operations(problem: &Problem) -> u64 {
    let activities = problem.goals.len() + problem.facts.len();
    OPERATIONS * activities.max(1) as u64
}

fn solve(args: &Args, task: &Task, settings: Settings) -> Result<Solved, CommandError> {
    let planner: &dyn Planner = match args.planner {
        Who::Both => &Both::default(),
        Who::Forward => &Forward,
        Who::Repair => &Repair::default(),
    };
    let mut solved = match planner.solve(&task.model, &task.problem, settings) {
        Ok(answer) => solved(planner, answer),
        Err(error) => unloaded(planner, &error),
    };
    let asked = args.explain || args.json;
    match &solved.plan {
        Some(plan) => {
            let violations = checker::check(&task.model, &task.problem, plan);
            if let Some(first) = violations.first() {
                return Err(CommandError::Plan(PlanError::Planner {
                    planner: plan.planner.clone(),
                    first: first.to_string(),
                }));
            }
            if args.explain {
                solved.explanations = left_out(task, plan, settings);
            }
        }
        None if asked => {
            let request = Request {
                operations: settings.operations,
                seed: settings.seed,
                is_proven: solved.proven,
            };
            let told = explain::missing_plan(&task.model, &task.problem, request);
            solved.proven |= told.proven && told.outcome != Outcome::Possible;
            solved.operations += told.operations;
            solved.explanation = Some(told);
        }
        None => {}
    }
    Ok(solved)
}

fn solved(planner: &dyn Planner, answer: Answer) -> Solved {
    let by = answer.plan.as_ref().map(|plan| plan.planner.clone());
    Solved {
        planner: by.unwrap_or_else(|| planner.name().to_owned()),
        proven: answer.proven,
        operations: answer.operations,
        plan: answer.plan,
        explanation: None,
        explanations: Vec::new(),
    }
}

/// What is the case cannot be, or a goal cannot be of itself.
fn unloaded(planner: &dyn Planner, error: &LoadError) -> Solved {
    Solved {
        planner: planner.name().to_owned(),
        plan: None,
        // The explanation says whether facts with other times are excluded.
        proven: !matches!(error, LoadError::Fact { .. }),
        operations: 0,
        explanation: None,
        explanations: Vec::new(),
    }
}

/// Why goals are left out, each with its part of the operations.
fn left_out(task: &Task, plan: &Plan, settings: Settings) -> Vec<Explanation> {
    let goals = &task.problem.goals;
    let names = |name: &str| goals.iter().position(|goal| goal.name == name);
    let mut achieved = vec![false; goals.len()];
    for one in &plan.achieved {
        if let Some(goal) = names(&one.goal) {
            achieved[goal] = true;
        }
    }
    let missing: Vec<usize> = plan
        .left_out
        .iter()
        .filter_map(|at| names(&at.goal))
        .collect();
    let request = Request {
        operations: settings.operations / missing.len().max(1) as u64,
        seed: settings.seed,
        is_proven: false,
    };
    let explained = missing.into_iter().map(|goal| {
        let (model, problem) = (Arc::clone(&task.model), Arc::clone(&task.problem));
        explain::left_out(&model, &problem, &achieved, goal, request)
    });
    explained.collect()
}

fn print_document(
    args: &Args,
    solved: &Solved,
    settings: Settings,
    out: Option<String>,
) -> Result<(), CommandError> {
    let plan = solved.plan.as_ref();
    let achieved = plan.map(|plan| plan.achieved.iter().map(|at| at.goal.as_str()).collect());
    let left_out = plan.map(|plan| plan.left_out.iter().map(|at| at.goal.as_str()).collect());
    print_json(&Document {
        planner: &solved.planner,
        feasible: match (plan.is_some(), solved.proven) {
            (true, _) => Some(true),
            (false, true) => Some(false),
            (false, false) => None,
        },
        proven: solved.proven,
        makespan: plan.map(|plan| plan.makespan),
        score: plan.map(|plan| plan.score),
        operations: solved.operations,
        budget: settings.operations,
        seed: args.seed,
        achieved: achieved.unwrap_or_default(),
        left_out: left_out.unwrap_or_default(),
        out,
        explanation: solved.explanation.as_ref(),
        explanations: &solved.explanations,
    })
}

fn in_words(
    args: &Args,
    problem: &Problem,
    solved: &Solved,
    settings: Settings,
    out: Option<String>,
) -> String {
    let budget = grouped(settings.operations);
    let Some(plan) = &solved.plan else {
        return match &solved.explanation {
            Some(told) => told.to_string(),
            None if solved.proven => {
                "There is no plan: that is proven. --explain says why.".to_owned()
            }
            None => format!(
                "No plan was found within {budget} operations; that there is none is not proven. \
                 --explain says what stands in the way, --ops gives it more."
            ),
        };
    };
    let weighted = problem.goals.iter().any(|goal| goal.weight.is_some());
    let mut lines = vec![(
        "planner".to_owned(),
        match (solved.proven, weighted) {
            (true, _) => format!("{}: no plan is shorter, as is proven", solved.planner),
            (false, true) => format!("{}: the best plan that was found", solved.planner),
            (false, false) => format!("{}: the shortest plan that was found", solved.planner),
        },
    )];
    let mut line = |label: &str, text: String| lines.push((label.to_owned(), text));
    line("makespan", plan.makespan.to_string());
    if weighted {
        line("score", plan.score.to_string());
    }
    let (achieved, all) = (plan.achieved.len(), problem.goals.len());
    line("goals", format!("{achieved} of {all} achieved"));
    for left_out in &plan.left_out {
        line(
            "  left out",
            format!("{}: {}", left_out.goal, left_out.reason),
        );
    }
    line(
        "operations",
        format!("{} of {budget}", grouped(solved.operations)),
    );
    line("tokens", plan.tokens.len().to_string());
    if let Some(out) = out {
        line("plan", out);
    }
    let mut text = table(&[Group {
        title: "plan",
        lines,
    }]);
    text += &tokens(plan);
    if args.explain {
        for told in &solved.explanations {
            text += &format!("\n{told}");
        }
    }
    text
}

/// The tokens of a plan, a line each.
fn tokens(plan: &Plan) -> String {
    let width = plan.horizon.to_string().len().max(5);
    let mut text = format!("\n  {:>width$}  {:>width$}  token\n", "start", "end");
    for token in plan.tokens.iter().take(MOST_TOKENS) {
        let (start, end, says) = (token.start, token.end, token.says());
        let on = &token.timeline;
        text += &format!("  {start:>width$}  {end:>width$}  {says} on {on}\n");
    }
    if let Some(more) = plan.tokens.len().checked_sub(MOST_TOKENS + 1) {
        text += &format!("  and {} more: --out writes them all\n", more + 1);
    }
    text
}
