//! Writes the problem of a seed as JSON, for other programs to solve.
//!
//!     cargo run --release -p farside-misus --example export_problem -- --seed N [--rocks R]

use std::error::Error;

use farside_misus::planner::problem::{ProblemConfig, generate};

fn main() -> Result<(), Box<dyn Error>> {
    let mut config = ProblemConfig::default();
    let mut seed = 1;
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let number = words
            .next()
            .ok_or(format!("{word}: expected a number after it"))?;
        match word.as_str() {
            "--seed" => seed = number.parse()?,
            "--rocks" => {
                config.rocks_least = number.parse()?;
                config.rocks_most = config.rocks_least;
            }
            _ => return Err(format!("{word}: expected --seed or --rocks").into()),
        }
    }
    println!("{}", generate(&config, seed)?.to_json());
    Ok(())
}
