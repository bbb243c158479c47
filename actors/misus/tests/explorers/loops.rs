//! The whole loop: what rovers do in it, whatever happens.

use crate::diary::{Run, told};

#[test]
fn rovers_plan_drive_observe_and_plan_anew() {
    let hours = std::env::var("HOURS")
        .ok()
        .and_then(|at| at.parse().ok())
        .unwrap_or(12);
    let text = std::env::var("TEXT")
        .ok()
        .map(|at| std::fs::read_to_string(at).unwrap())
        .unwrap_or_default();
    let crashes: &[(&str, u64, u64)] = match std::env::var("CRASH") {
        Ok(_) => &[("rover_02", 18_000, 25_000), ("rover_01", 20_000, 20_060)],
        _ => &[],
    };
    let ran = Run {
        hours,
        text: &text,
        crashes,
        ..Run::default()
    }
    .run();
    println!("{}", told(&ran.diary, ""));
    println!("{:?} {:?}", ran.report.end, ran.results.violations);
    println!(
        "{}",
        serde_json::to_string_pretty(&ran.results.metrics).unwrap_or_default()
    );
}
