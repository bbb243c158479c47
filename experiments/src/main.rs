//! The `farside` command, with the systems that are built in.

use std::process::ExitCode;

use farside_experiments::{cli, registry::Registry};

fn main() -> ExitCode {
    cli::main(Registry::builtin())
}
