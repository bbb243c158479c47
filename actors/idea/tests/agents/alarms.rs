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
    // By alarm: its recovery, and what that led to. A rock stays under its wheel until the rover has driven
    // off it, so that it resumes more than once.
    let recovery = |alarm: &str, n: u32| {
        let step = |step: &str| format!("Recovery({step} {alarm} {n} 0)");
        let mut steps = ["stop", "back_up", "turn"].map(step).to_vec();
        steps.push(format!("Resuming({n})"));
        steps
    };
    let nominal = || vec!["Nominal".to_owned()];
    let tilted = recovery("tilt", 0)[..2].to_vec();
    let blind = [
        "Recovery(stop blind 0 0)",
        "Recovery(stop blind 0 1)",
        "Waiting(blind 0)",
        "Resuming(0)",
    ];
    let expected = [
        // Roll, alone.
        [
            nominal(),
            recovery("roll", 0),
            recovery("roll", 1),
            nominal(),
        ]
        .concat(),
        // Roll and tilt at once: the roll goes first.
        [recovery("roll", 0), recovery("roll", 1), nominal()].concat(),
        // A roll while the rover backs up from a tilt: the recovery begins anew, for the roll.
        [tilted, recovery("roll", 0), recovery("roll", 1)].concat(),
        [recovery("tilt", 2), nominal()].concat(),
        // No answers: the stop's is lost, too, and the rover stops again.
        [blind.map(str::to_owned).to_vec(), nominal()].concat(),
        // The hard limit.
        vec!["Safe".to_owned()],
    ]
    .concat();
    assert_eq!(steps, expected);
}
