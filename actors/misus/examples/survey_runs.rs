//! Runs of the closed loop with and without trouble, as a table: what was achieved, learnt and planned, and
//! whether anything happened that must never happen.
//!
//!     cargo run --release -p farside-misus --example survey_runs -- [SEEDS] [PART OF A NAME]

#[path = "support/survey.rs"]
#[allow(dead_code, reason = "tests use the rest")]
mod survey;

use survey::Run;

const ROVER_1_SILENT: &str = "links.\"rover_01-*\".outage = true";

/// Hosts that crash: when, and when they start again if they do \[h\].
type Crashes = &'static [(&'static str, f64, Option<f64>)];

fn main() {
    let seeds = std::env::args().nth(1).and_then(|word| word.parse().ok());
    let seeds: u64 = seeds.unwrap_or(1);
    let part = std::env::args().nth(2).unwrap_or_default();
    println!(
        "{:<26} {:>4} {:>6} {:>6} {:>5} {:>5} {:>5} {:>9} {:>4} {:>5} {:>5} {:>4} {:>4} {:>4} {:>4}",
        "run",
        "seed",
        "goals",
        "score",
        "loops",
        "ARI",
        "plans",
        "operat.",
        "shed",
        "again",
        "dupl",
        "give",
        "orph",
        "comm",
        "bad"
    );
    let election = "survey.election = \"30min\"";
    let loss = |loss: &str| format!("links.default.loss = {loss}");
    let central_out: Crashes = &[("lander", 5.0, Some(29.66))];
    let rover_2_lost: Crashes = &[("rover_02", 5.0, None)];
    let runs: Vec<(&str, String, Crashes)> = vec![
        ("healthy", String::new(), &[]),
        ("batch", "execution.mode = \"batch\"".to_owned(), &[]),
        ("rover_02 lost at noon", String::new(), rover_2_lost),
        ("rover_01 silent", ROVER_1_SILENT.to_owned(), &[]),
        ("loss 0", loss("0"), &[]),
        ("loss 0.3", loss("0.3"), &[]),
        ("loss 0.6", loss("0.6"), &[]),
        ("loss 0.9", loss("0.9"), &[]),
        ("centre out a sol", String::new(), central_out),
        ("centre out, election", election.to_owned(), central_out),
        (
            "assign-and-release",
            "survey.protocol = \"assign-and-release\"".to_owned(),
            &[],
        ),
        ("market", "survey.protocol = \"market\"".to_owned(), &[]),
        ("contact 0.1", "survey.contact = 0.1".to_owned(), &[]),
        (
            "centre on rover_03",
            "survey.central = \"rover_03\"".to_owned(),
            &[],
        ),
    ];
    for (name, text, crashes) in runs.iter().filter(|run| run.0.contains(&part)) {
        for seed in 1..=seeds {
            let run = Run {
                text,
                seed,
                crashes,
                ..Run::default()
            };
            let ran = run.run();
            let of = |metric: &str| ran.figure(metric);
            println!(
                "{name:<26} {seed:>4} {:>2}/{:<3} {:>6.0} {:>5} {:>5.2} {:>5} {:>9} {:>4} {:>5} {:>5} {:>4} {:>4} {:>4} {:>4}",
                of("goals_achieved"),
                of("goals_total"),
                of("score"),
                of("loops"),
                of("class_ari"),
                of("planned_by_rovers"),
                of("plan_operations"),
                of("shed"),
                of("reassigned"),
                of("duplicated"),
                of("given_up"),
                of("orphaned"),
                of("missed_comm"),
                of("plan_violations") + of("sharing_violations") + of("lost_goals"),
            );
            println!("    plans for: {:?}", ran.causes);
            for violation in ran.results.violations.iter().take(5) {
                println!("    {violation}");
            }
        }
    }
}
