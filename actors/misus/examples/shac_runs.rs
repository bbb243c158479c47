//! Random runs of the protocol of shared goals: loss from 0 to 0.9, repeated and reordered messages,
//! partitions, crashes of anyone at any event, elections. After each event everything is checked
//! that has to hold; the first violation is printed with its scenario, and ends the program.
//!
//!     cargo run --release -p farside-misus --example shac_runs -- [RUNS] [FIRST_SEED] [WITHOUT_RULE]
//!
//! With the name of a rule (a field of `Rules`) that rule is broken, and all kinds of violations are
//! counted, each with the first seed that shows it.
//!
//! With `SHAC_TELL=1` every message and every write is printed.

#[path = "support/sharing.rs"]
#[allow(dead_code, unused_imports, reason = "tests use the rest")]
mod sharing;

use std::collections::BTreeMap;
use std::error::Error;

use farside_misus::shac::Rules;
use sharing::{Scenario, Tally, World, without};

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let runs: u64 = words.next().map_or(Ok(10_000), |word| word.parse())?;
    let first: u64 = words.next().map_or(Ok(0), |word| word.parse())?;
    if let Some(rule) = words.next() {
        let rules = without(&rule).ok_or_else(|| format!("no rule {rule:?}"))?;
        let mut kinds: BTreeMap<&str, (u32, u64)> = BTreeMap::new();
        for seed in first..first + runs {
            if let Err(violation) = World::new(Scenario::random(seed), rules).run() {
                kinds.entry(violation.what).or_insert((0, seed)).0 += 1;
            }
        }
        println!("without {rule}, of {runs} runs: {kinds:?} (how many, first seed)");
        return Ok(());
    }
    let mut sum = Tally::default();
    for seed in first..first + runs {
        let scenario = Scenario::random(seed);
        let tally = World::new(scenario.clone(), Rules::ALL).run();
        sum += tally.map_err(|violation| format!("{violation:?}\n{scenario:#?}"))?;
    }
    println!("{runs} runs: {sum:#?}");
    Ok(())
}
