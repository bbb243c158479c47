//! The command line: arguments, exit codes, and who handles what.

use std::io::{IsTerminal, Write};
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::prelude::*;

use crate::commands::{
    CommandError, Exit, builtin, check, complain, diff, draw, explain, info, recover, report,
    reproduce, run, study, verify,
};
use crate::registry::Registry;

const EXIT_CODES: &str = "\
Exit codes:
  0  done; for verify, diff and reproduce: the same
  1  the answer is \"different\" or \"violated\"
  2  the input is wrong
  3  the run failed or was interrupted; what was logged until then is readable";

const EXAMPLES: &str = "\
Examples:
  farside run                                        50 rovers cross a crater; writes run.mcap
  farside run --set links.default.loss=30% --json    the same over worse links, for programs
  farside verify run.mcap                            run it again, compare every message
  farside diff run.mcap worse.mcap                   the first message that differs, and why
  farside study degradation/loss --seeds 5           how the team fares as messages are lost
  farside reproduce results/degradation/loss --cell loss=30% --seed 3
                                                     one run of it again, with its log";

/// What happens to my team of rovers when the network goes bad, and why?
///
/// A deterministic simulator for teams of planetary rovers over bad links: the same scenario and
/// seed give the same run, bit for bit, and every message is logged with its fate.
#[derive(Parser)]
#[command(name = "farside", version, after_help = format!("{EXAMPLES}\n\n{EXIT_CODES}"))]
struct Cli {
    /// Say more on stderr about what is done; twice for more (or set FARSIDE_LOG)
    #[arg(short, long, action = clap::ArgAction::Count, global = true, display_order = 100)]
    verbose: u8,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run a scenario and log every message
    Run(run::Args),
    /// Read a scenario, check it, and print it with all defaults filled in
    Check(check::Args),
    /// List the scenarios that are built in
    Scenarios(builtin::Args),
    /// Say what a key of scenarios or a metric is, or list them all
    Explain(explain::Args),
    /// Say what is in a log
    Info(info::Args),
    /// Run a log's scenario again and compare every message
    Verify(verify::Args),
    /// Compare two logs: which messages differ, which one first, and what caused it
    Diff(diff::Args),
    /// Draw a picture of a run, from its log
    Draw(draw::Args),
    /// Run a scenario in many cells and with many seeds; go on where an earlier start ended
    Study(study::Args),
    /// List the studies that are built in
    Studies(builtin::Args),
    /// Run one run of a study again, log every message, and compare with its record
    Reproduce(reproduce::Args),
    /// Write up a study: a page with plots, and tables for other programs
    Report(report::Args),
    /// Save what can be saved of a cut or damaged log
    Recover(recover::Args),
    /// Print completions for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

/// The command line of a binary that knows these systems.
pub fn main(registry: Registry) -> ExitCode {
    // On wrong usage clap prints what is wrong and exits with 2, as we do.
    let cli = Cli::parse();
    say_on_stderr(cli.verbose);
    match dispatch(cli.command, &registry) {
        Ok(exit) => exit.into(),
        // Whoever reads our output has read enough: nothing is wrong.
        Err(CommandError::Output(error)) if error.kind() == std::io::ErrorKind::BrokenPipe => {
            Exit::Done.into()
        }
        Err(error) => {
            let red = std::io::stderr().is_terminal();
            let label = if red {
                "\x1b[1;31merror\x1b[0m"
            } else {
                "error"
            };
            let _ = write!(std::io::stderr(), "{label}: ");
            complain(&error);
            error.exit().into()
        }
    }
}

fn dispatch(command: Command, registry: &Registry) -> Result<Exit, CommandError> {
    match command {
        Command::Run(args) => run::run(&args, registry),
        Command::Check(args) => check::run(&args, registry),
        Command::Scenarios(args) => builtin::scenarios(&args, registry),
        Command::Explain(args) => explain::run(&args, registry),
        Command::Info(args) => info::run(&args),
        Command::Verify(args) => verify::run(&args, registry),
        Command::Diff(args) => diff::run(&args),
        Command::Draw(args) => draw::run(&args, registry),
        Command::Study(args) => study::run(&args, registry),
        Command::Studies(args) => builtin::studies(&args, registry),
        Command::Reproduce(args) => reproduce::run(&args, registry),
        Command::Report(args) => report::run(&args),
        Command::Recover(args) => recover::run(&args),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "farside", &mut script);
            crate::commands::print_bytes(&script)?;
            Ok(Exit::Done)
        }
    }
}

/// Sends diagnostics to stderr: warnings, or what `-v` or `FARSIDE_LOG` ask for.
fn say_on_stderr(verbose: u8) {
    let level = match verbose {
        0 => LevelFilter::WARN,
        1 => LevelFilter::INFO,
        2 => LevelFilter::DEBUG,
        _ => LevelFilter::TRACE,
    };
    let from_environment = std::env::var("FARSIDE_LOG").ok();
    let targets = from_environment.and_then(|text| match text.parse::<Targets>() {
        Ok(targets) => Some(targets),
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "FARSIDE_LOG={text}: {error}; ignored");
            None
        }
    });
    let targets = targets.unwrap_or_else(|| {
        // Only what is ours: libraries below have much to say.
        [
            "farside",
            "farside_worlds",
            "farside_logs",
            "farside_actors",
            "farside_experiments",
        ]
        .into_iter()
        .fold(Targets::new(), |targets, ours| {
            targets.with_target(ours, level)
        })
    });
    let layer = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .without_time();
    tracing_subscriber::registry()
        .with(layer)
        .with(targets)
        .init();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
