//! The binary, and what its output is read with.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

pub(crate) fn farside(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_farside"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the binary runs")
}

pub(crate) fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("output is UTF-8")
}

/// Runs a small scenario; more arguments follow.
pub(crate) const SMALL: [&str; 5] = ["run", "--set", "team.rovers=5", "--until", "10s"];

pub(crate) fn small<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&SMALL, more].concat()
}

pub(crate) fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).expect("stdout is one JSON document")
}

/// Says why a test, or a part of one, does nothing here; past the capture of what tests print.
pub(crate) fn skip(what: &str, why: &str) {
    let _ = writeln!(std::io::stderr(), "{what}: not tried: {why}");
}
