//! Figure 5 of the paper, as printed, within a model.

use super::*;
use crate::service::Outcome;
use farside_planning::language::Functions;

/// As printed, without the parenthesis that it lacks.
const FIGURE_5: &str = "(Define_Compatibility
 (SINGLE((Rover_Class TempMeasure_SV)
 ((TempReadCompare(→?state_fan ?temp True))))
 :duration_bounds [*temp_freq* *temp_freq*]
 :parameter_functions
 (new_fan_state(*tempthreshold* ?temp ?state_fan))
 :compatibility_spec
 (AND
 (meets (SINGLE ((Rover_Class Fans_SV)
 ((DeviceSetFanState (?state_fan→))))))))
";

const MODEL: &str = "
(Define_Model figure_5 :profile executive)
(Define_Constant *temp_freq* 4)
(Define_Constant *tempthreshold* 45)
(Define_Object_Class Rover_Class :state_variables ((State TempMeasure_SV Fans_SV)))
(Define_Predicate TempReadCompare (-> (Boolean ?state_fan) (Number ?temp) (Boolean ?temp_rcvd))
 :timed_out (?temp_rcvd False)
 :preempted (?temp_rcvd False))
(Define_Predicate FansUnchanged ())
(Define_Predicate DeviceSetFanState ((Boolean ?on) ->))
(Define_Member_Values (Rover_Class TempMeasure_SV) (TempReadCompare) :default (TempReadCompare))
(Define_Member_Values
 (Rover_Class Fans_SV)
 (FansUnchanged DeviceSetFanState)
 :default (FansUnchanged ()))
(Define_Compatibility
 (SINGLE ((Rover_Class TempMeasure_SV) ((TempReadCompare (-> ?state_fan ?temp ?temp_rcvd)))))
 :duration_bounds [1 *temp_freq*])
(Define_Compatibility
 (SINGLE ((Rover_Class Fans_SV) ((DeviceSetFanState (?on ->)))))
 :duration_bounds [1 1])
";

#[test]
fn the_fan_is_turned_on_in_the_cycle_in_which_the_reading_is_bound() {
    let mut functions = Functions::default();
    functions.register("new_fan_state", 3, |of| Some(i64::from(of[1] > of[0])));
    let text = MODEL.to_owned() + FIGURE_5;
    let strict = Options {
        strict: true,
        functions: functions.clone(),
        ..Options::default()
    };
    assert!(read_model("figure_5.ddl", &text, &strict).value.is_none());
    let options = Options {
        functions,
        ..Options::default()
    };
    let read = read_model("figure_5.ddl", &text, &options);
    let findings: Vec<String> = read.findings.iter().map(ToString::to_string).collect();
    assert_eq!(findings.len(), 1, "{findings:?}");
    assert!(
        findings[0].starts_with("figure_5.ddl:25:2: warning:"),
        "{findings:?}"
    );
    let model = Arc::new(read.value.expect("it is a warning"));
    for (degrees, on) in [(46, 1), (45, 0)] {
        let service = Temporal::new(model.clone(), TemporalOptions::default());
        let mut service = service.expect("all timelines are states");
        for tick in 0..4 {
            service.advance(tick);
            assert_eq!(service.solve(1, 10_000), Outcome::Decided);
        }
        // A reading that comes when its token ends: it is bound, and the fan is set, at tick 4.
        service.advance(4);
        let poll = service.present(0).expect("there is a poll").contract;
        service
            .bind(poll, &[None, Some(degrees), Some(1)], true)
            .expect("it is active");
        assert_eq!(service.solve(1, 10_000), Outcome::Decided);
        let fans = service.present(1).expect("the fans say something");
        assert_eq!(model.predicates[fans.predicate].name, "DeviceSetFanState");
        assert_eq!((fans.start, fans.parameters[0]), (4, Some(on)));
    }
}

/// A model whose author is mistaken says so, and a service refuses what its model does not know.
#[test]
fn mistakes_are_said() {
    let said = |from: &str, to: &str| {
        assert!(SYSTEM.contains(from), "{from}");
        let read = read_model("k9.ddl", &SYSTEM.replacen(from, to, 1), &Options::default());
        read.findings
            .first()
            .map_or_else(String::new, ToString::to_string)
    };
    let cases = [
        (
            "((PitchMeasure))))\n :dur",
            "((PichMeasure))))\n :dur",
            "the nearest is PitchMeasure",
        ),
        (
            "(SINGLE ((Rover Pitch_SV)",
            "(SINGLE ((Rover Pich_SV)",
            "the nearest is Pitch_SV",
        ),
        (
            "(BackUp (*tilt_back_up*",
            "(BackUp (*tilt_backup*",
            "*tilt_backup*",
        ),
        ("(Define_Constant *resumptions* 3)", "", "*resumptions*"),
        (
            "(Define_Constant *stop_timeout* 6)",
            "(Define_Constant *stop_timeout* 0)",
            "[1 *stop_timeout*]",
        ),
        ("(PitchMeasure (0 ->", "(PitchMeasure (7 ->", "Missed"),
        ("?attempt -> PREEMPTED)", "?attempt -> TIMEOUT)", "none for"),
    ];
    for (from, to, expected) in cases {
        let said = said(from, to);
        assert!(said.contains(expected), "{from}: {said}");
    }
    let mut service = temporal(system());
    service.advance(0);
    assert_eq!(service.solve(1, 100_000), Outcome::Decided);
    let (timelines, predicates) = (system().timelines, system().predicates);
    let poll = service
        .present(timelines.pitch)
        .expect("there is one")
        .contract;
    let wrong = service.bind(poll, &[None, Some(500), Some(1)], true);
    let wrong = wrong.expect_err("no angle is so large").to_string();
    assert!(wrong.contains("PitchMeasure: ?pitch: 500"), "{wrong}");
    let unbound = service.insert_goal(timelines.goal, predicates.image_at, &[1, 2]);
    let unbound = unbound.expect_err("a goal has five inputs").to_string();
    assert!(unbound.contains("expected 5 inputs, found 2"), "{unbound}");
    let unknown = service.insert_goal(timelines.goal, predicates.stop, &[]);
    let unknown = unknown.expect_err("it is a command").to_string();
    assert_eq!(unknown, "Goal_SV does not say Stop");
}
