//! The `farside` command, with the systems that are built in.

use std::process::ExitCode;

use farside_experiments::{cli, system::Registry};

fn main() -> ExitCode {
    cli::main(Registry::builtin())
}
