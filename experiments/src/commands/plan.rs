//! `farside plan`: models and problems of planning are checked, written in their normal form and
//! solved, and plans are validated and drawn. Without a simulator: `farside-planning` does it all.

mod check;
mod draw;
mod files;
mod format;
mod solve;
mod validate;

use super::{CommandError, Exit};

pub(crate) use files::PlanError;

#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Read a model, or a problem of it, and say what is wrong or odd, with line and column
    Check(check::Args),
    /// Print a model or a problem in its normal form
    Format(format::Args),
    /// Find a plan, the shortest or the one that is worth most; or say why there is none
    Solve(solve::Args),
    /// Say whether a plan is valid, by a checker that shares no code with the planners
    Validate(validate::Args),
    /// Draw a plan as a Gantt chart with the levels of resources
    Draw(draw::Args),
}

pub(crate) fn run(args: &Args) -> Result<Exit, CommandError> {
    match &args.command {
        Command::Check(args) => check::run(args),
        Command::Format(args) => format::run(args),
        Command::Solve(args) => solve::run(args),
        Command::Validate(args) => validate::run(args),
        Command::Draw(args) => draw::run(args),
    }
}
