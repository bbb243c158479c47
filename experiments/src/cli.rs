//! The command line: arguments, exit codes, and who handles what.

use std::ffi::OsStr;
use std::io::{IsTerminal, Write};
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use tracing_subscriber::field::MakeExt;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::format::debug_fn;
use tracing_subscriber::prelude::*;

use crate::commands::{
    CommandError, Exit, builtin, cat, check, complain, diff, draw, explain, fork, info, plan, plot,
    problem, recover, replay, report, reproduce, run, shown, shrink, study, ties, verify, view,
    why,
};
use crate::registry::Registry;

const EXIT_CODES: &str = "\
Exit codes:
  0  done; for verify, diff, fork, replay, reproduce and ties: the same; for recover: nothing is lost
  1  the answer is \"different\", \"violated\" or \"something is lost\"
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
    /// Print the messages of any MCAP file as JSON lines or as a table
    Cat(cat::Args),
    /// Run a log's scenario again and compare every message
    Verify(verify::Args),
    /// Compare two logs: which messages differ, which one first, and what caused it
    Diff(diff::Args),
    /// Run a log's scenario again with something changed from an instant on, and compare
    Fork(fork::Args),
    /// Say what an actor did in a run, whom it waited for, and what touched it
    Why(why::Args),
    /// Let some actors of a logged run live again, all else as recorded, and compare what they do
    Replay(replay::Args),
    /// Run a scenario with simultaneous events in other orders, and say which conclusions change
    Ties(ties::Args),
    /// Find the smallest part of a failing run that still fails so
    Shrink(shrink::Args),
    /// Draw a picture of a run, from its log
    Draw(draw::Args),
    /// Plot fields of messages over time, of any MCAP file
    Plot(plot::Args),
    /// Write a run as a page for a browser: map, messages, causes and curves, of any MCAP file
    View(view::Args),
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
    /// Write what a scenario's planners have to solve, for other programs
    Problem(problem::Args),
    /// Check, solve, validate and draw problems of planning
    Plan(plan::Args),
    /// Print completions for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

/// The command whose options depend on which systems there are: a picture's name is one.
const DRAW: &str = "draw";

/// The command line of a binary that knows these systems.
pub fn main(registry: Registry) -> ExitCode {
    // On wrong usage clap prints what is wrong and exits with 2, as we do.
    let matches = command_line(&registry).try_get_matches();
    let matches = matches.unwrap_or_else(|error| refuse_arguments(&error));
    let cli = asked_for(&matches, &registry).unwrap_or_else(|error| error.exit());
    say_on_stderr(cli.verbose);
    match dispatch(cli.command, &registry) {
        Ok(exit) => exit.into(),
        // Whoever reads our output has read enough: nothing is wrong.
        Err(CommandError::Output(error)) if error.kind() == std::io::ErrorKind::BrokenPipe => {
            Exit::Done.into()
        }
        Err(error) => {
            let label = if in_colour() {
                "\x1b[1;31merror\x1b[0m"
            } else {
                "error"
            };
            let _ = write!(std::io::stderr(), "{label}: ");
            complain(told_of(&error.to_string(), registry.program()));
            error.exit().into()
        }
    }
}

/// What arguments that clap has understood ask for.
fn asked_for(matches: &clap::ArgMatches, registry: &Registry) -> Result<Cli, clap::Error> {
    let mut cli = Cli::from_arg_matches(matches)?;
    if let (Command::Draw(args), Some(given)) = (&mut cli.command, matches.subcommand_matches(DRAW))
    {
        args.name_picture(given, registry);
    }
    Ok(cli)
}

/// Says what is wrong with the arguments, or what they ask of the command line itself, and exits.
fn refuse_arguments(error: &clap::Error) -> ! {
    let text = error.render().to_string();
    // Arguments are quoted as they are, and those of a script may be anybody's.
    if shown(&text) == text {
        error.exit();
    }
    complain(text.trim_end());
    std::process::exit(error.exit_code())
}

/// The command line, under the name and with the version of the binary.
fn command_line(registry: &Registry) -> clap::Command {
    let mut command =
        Cli::command().mut_subcommand(DRAW, |command| draw::with_pictures(command, registry));
    if registry.scenario(run::DEFAULT_SCENARIO).is_none() {
        // Without the system that the examples are of, they would not run.
        command = command.after_help(EXIT_CODES);
        let first = registry.scenario_names().first().copied();
        command = command.mut_subcommand("run", |run| {
            run.mut_arg("scenario", |scenario| match first {
                Some(first) => scenario.default_value(first),
                None => scenario
                    .default_value(clap::builder::Resettable::Reset)
                    .required(true),
            })
        });
    }
    let name = registry.program();
    if name == command.get_name() {
        return command;
    }
    let version = registry.version();
    // What stands behind the name.
    let version = version.strip_prefix(name).unwrap_or(&version).trim();
    // Clap keeps what is there for the whole program.
    let version: &'static str = Box::leak(version.to_owned().into_boxed_str());
    let command = command.name(name).version(version);
    renamed(command, name)
}

/// The same with another name in place of Farside's in all that help says.
fn renamed(command: clap::Command, name: &'static str) -> clap::Command {
    let own = |text: &clap::builder::StyledStr| told_of(&text.to_string(), name);
    let about = command.get_about().map(own);
    let after = command.get_after_help().map(own);
    let command = command
        .mut_args(|arg| match arg.get_help().map(own) {
            Some(help) => arg.help(help),
            None => arg,
        })
        .mut_subcommands(|below| renamed(below, name));
    let command = match about {
        Some(about) => command.about(about),
        None => command,
    };
    match after {
        Some(after) => command.after_help(after),
        None => command,
    }
}

/// A text whose commands are those of the binary of this name.
fn told_of(text: &str, name: &str) -> String {
    text.replace("`farside ", &format!("`{name} "))
        .replace("  farside ", &format!("  {name} "))
}

/// Whether what is said on stderr is in colour.
fn in_colour() -> bool {
    shows_colour(
        std::io::stderr().is_terminal(),
        std::env::var_os("NO_COLOR").as_deref(),
        std::env::var_os("TERM").as_deref(),
    )
}

/// As <https://no-color.org> has it: on a terminal that can, unless `NO_COLOR` is there and not
/// empty.
fn shows_colour(is_terminal: bool, no_color: Option<&OsStr>, term: Option<&OsStr>) -> bool {
    is_terminal && no_color.is_none_or(OsStr::is_empty) && term.is_none_or(|term| term != "dumb")
}

fn dispatch(command: Command, registry: &Registry) -> Result<Exit, CommandError> {
    match command {
        Command::Run(args) => run::run(&args, registry),
        Command::Check(args) => check::run(&args, registry),
        Command::Scenarios(args) => builtin::scenarios(&args, registry),
        Command::Explain(args) => explain::run(&args, registry),
        Command::Info(args) => info::run(&args, registry),
        Command::Cat(args) => cat::run(&args, registry),
        Command::Verify(args) => verify::run(&args, registry),
        Command::Diff(args) => diff::run(&args, registry),
        Command::Fork(args) => fork::run(&args, registry),
        Command::Why(args) => why::run(&args, registry),
        Command::Replay(args) => replay::run(&args, registry),
        Command::Ties(args) => ties::run(&args, registry),
        Command::Shrink(args) => shrink::run(&args, registry),
        Command::Draw(args) => draw::run(&args, registry),
        Command::Plot(args) => plot::run(&args),
        Command::View(args) => view::run(&args, registry),
        Command::Study(args) => study::run(&args, registry),
        Command::Studies(args) => builtin::studies(&args, registry),
        Command::Reproduce(args) => reproduce::run(&args, registry),
        Command::Report(args) => report::run(&args, registry),
        Command::Recover(args) => recover::run(&args, registry),
        Command::Problem(args) => problem::run(&args, registry),
        Command::Plan(args) => plan::run(&args),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            let name = registry.program();
            clap_complete::generate(shell, &mut command_line(registry), name, &mut script);
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
            complain(format!("FARSIDE_LOG={text}: {error}; ignored"));
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
    // Names in what is said may be anybody's, as in what commands print.
    let fields = debug_fn(|out, field, value| {
        let value = shown(&format!("{value:?}"));
        match field.name() {
            "message" => write!(out, "{value}"),
            name => write!(out, "{name}={value}"),
        }
    });
    let layer = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .fmt_fields(fields.delimited(" "))
        .with_ansi(in_colour())
        // Which module says it is of use to who looks for more than warnings.
        .with_target(verbose > 0)
        .without_time();
    tracing_subscriber::registry()
        .with(layer)
        .with(targets)
        .init();
}

#[cfg(test)]
mod hostile;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
        let cave = Registry::builtin().named("cave", "3.1.4");
        command_line(&cave).debug_assert();
    }

    #[test]
    fn the_table_of_readme_has_every_command() {
        let readme = include_str!("../../README.md");
        let table = readme.split("| command | what it does |").nth(1);
        let table = table.and_then(|rest| rest.split("\n\n").next()).unwrap();
        let named: Vec<&str> = table.split('`').skip(1).step_by(2).collect();
        for command in Cli::command().get_subcommands() {
            let name = command.get_name();
            let is_named = |text: &&str| text.split(' ').next() == Some(name);
            assert!(named.iter().any(is_named), "README's table lacks {name}");
        }
    }

    #[test]
    fn a_binary_of_ones_own_has_its_own_name_and_version() {
        let mut cave = command_line(&Registry::builtin().named("cave", "3.1.4"));
        let version = cave.render_version();
        assert!(version.starts_with("cave 3.1.4 (farside "), "{version}");
        let help = cave.render_long_help().to_string();
        assert!(help.contains("  cave verify run.mcap"), "{help}");
        let mut subcommands = cave.get_subcommands_mut();
        let run = subcommands.find(|one| one.get_name() == "run").unwrap();
        let help = run.render_long_help().to_string();
        assert!(
            help.contains("`cave scenarios`") && !help.contains("farside"),
            "{help}"
        );
    }

    #[test]
    fn colour_is_for_terminals_that_want_it() {
        let some = |text: &'static str| Some(OsStr::new(text));
        assert!(shows_colour(true, None, some("xterm")));
        assert!(shows_colour(true, some(""), None));
        assert!(!shows_colour(true, some("1"), some("xterm")));
        assert!(!shows_colour(true, None, some("dumb")));
        assert!(!shows_colour(false, None, some("xterm")));
    }
}
