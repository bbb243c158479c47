//! Plans problems that were exported, and prints a line of JSON for each: what the rovers' planner with
//! goal interdependencies and the large-neighbourhood search find, with their plans.
//!
//!     cargo run --release -p farside-misus --example solve_problem -- FILE... [--operations N]

use std::error::Error;

use farside::random::RandomKey;
use farside_misus::planner::casper::PlannerConfig;
use farside_misus::planner::chain::Chain;
use farside_misus::planner::instance::Instance;
use farside_misus::planner::lns::{LnsConfig, plan};
use farside_misus::planner::plan::{score, violations};
use farside_misus::planner::problem::Problem;
use farside_misus::planner::rounds;

fn main() -> Result<(), Box<dyn Error>> {
    let mut config = LnsConfig::default();
    let mut files = Vec::new();
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--operations" => {
                let number = words
                    .next()
                    .ok_or("--operations: expected a number after it")?;
                config.operations = number.parse()?;
            }
            _ => files.push(word),
        }
    }
    for file in files {
        let text = std::fs::read_to_string(&file).map_err(|error| format!("{file}: {error}"))?;
        let problem = Problem::from_json(&text).map_err(|error| format!("{file}: {error}"))?;
        let instance = Instance::new(&problem)?;
        let key = RandomKey::new(1);
        let idgs = rounds::run(&problem, &instance, &PlannerConfig::default(), key)?.plan;
        let found = plan(&instance, &config, key)?;
        let chains: Vec<&Chain> = found.chains.iter().collect();
        let lns = rounds::team_plan(&problem, &instance, &chains);
        for plan in [&idgs, &lns] {
            if let Some(violation) = violations(&problem, plan).first() {
                return Err(format!("{file}: {violation}").into());
            }
        }
        let line = serde_json::json!({
            "file": file,
            "digest": problem.digest(),
            "idgs": { "score": score(&problem, &idgs), "plan": idgs.rovers },
            "lns": { "score": score(&problem, &lns), "plan": lns.rovers },
        });
        println!("{line}");
    }
    Ok(())
}
