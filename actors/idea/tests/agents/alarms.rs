//! Alarms of every kind, alone and together.

use crate::scenario::Run;

const ALARMS: &str = include_str!("../../scenarios/k9-alarms.toml");

#[test]
fn every_alarm_is_answered_as_the_table_says() {
    let run = Run::of(ALARMS, 1, |_| ());
    if std::env::var("SHOW").is_ok() {
        run.print();
    }
    let steps = run.of_timeline("system", "MotionMonitor_SV");
    let steps: Vec<&str> = steps.iter().map(|(_, says)| says.as_str()).collect();
    println!("{steps:#?}");
}
