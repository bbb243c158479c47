//! The whole loop: what rovers do in it, whatever happens.

use crate::diary::{Run, told};

#[test]
fn rovers_plan_drive_observe_and_plan_anew() {
    let ran = Run::default().run();
    println!("{}", told(&ran.diary, "planner_01"));
    println!("{:?} {:?}", ran.report.end, ran.results.violations);
    println!(
        "{}",
        serde_json::to_string_pretty(&ran.results.metrics).unwrap_or_default()
    );
}
