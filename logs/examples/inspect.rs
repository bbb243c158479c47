//! What is in a log, or how two differ: demonstrates in particular that any MCAP file will do.
//!
//! `cargo run -p farside-logs --example inspect -- run.mcap [other.mcap]`

use farside_logs::{DiffOptions, LogError, diff, info};

fn main() -> Result<(), LogError> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    match files.as_slice() {
        [file] => print!("{}", info(file)?),
        [a, b] => print!("{}", diff(a, b, &DiffOptions::default())?),
        _ => println!("say which file, or which two"),
    }
    Ok(())
}
