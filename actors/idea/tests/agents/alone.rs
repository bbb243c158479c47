//! The system agent alone, as it was tested on the rover.

use crate::scenario::Run;

const ALONE: &str = include_str!("../../scenarios/k9-alone.toml");

#[test]
fn goals_are_achieved_and_alarms_recovered() {
    let run = Run::of(ALONE, 1, |_| ());
    if std::env::var("SHOW").is_ok() {
        run.print();
    }
    assert_eq!(run.figure("goals_achieved"), 4.0);
    assert!(run.figure("alarms") >= 2.0 && run.figure("recoveries") >= 2.0);
    assert!(run.figure("max_response_lambda") < 2.0);
    assert_eq!(run.figure("faulty_agents"), 0.0);
    assert_eq!(run.figure("driving_without_lease_s"), 0.0);
    assert!(
        run.results.violations.is_empty(),
        "{:?}",
        run.results.violations
    );
}

/// With a processor on which planning takes no time, everything happens at the same instants.
#[test]
fn the_rover_does_the_same_whatever_technology_plans() {
    let run = |technology: &str| {
        let agent =
            format!("[system_agent]\nprocessor = \"unlimited\"\ntechnology = \"{technology}\"\n");
        let run = Run::of(
            &ALONE.replace("[links.default]", &format!("{agent}\n[links.default]")),
            1,
            |_| (),
        );
        assert_eq!(run.figure("goals_achieved"), 4.0, "{technology}");
        let of = [
            "Goal_SV",
            "Location_SV",
            "PanTilt_SV",
            "Camera_SV",
            "MotionMonitor_SV",
        ];
        of.map(|timeline| run.of_timeline("system", timeline))
    };
    let temporal = run("temporal");
    assert!(temporal.iter().all(|says| says.len() > 4));
    assert_eq!(run("propositional"), temporal);
    assert_eq!(run("compiled"), temporal);
}
