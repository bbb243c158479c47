//! Looking further than now.

use super::*;

/// A gate that, once taken, leads where nothing follows; another that lets the plan go on.
const GATES: &str = "
(Define_Model gates :profile executive)
(Define_Object_Class Agent :state_variables ((State Way_SV) (State Wall_SV)))
(Define_Type Status (ok failed TIMEOUT PREEMPTED))
(Define_Predicate Wait ())
(Define_Predicate Go ())
(Define_Predicate Left (-> (Status ?status)))
(Define_Predicate Right (-> (Status ?status)))
(Define_Predicate Open ())
(Define_Predicate Shut ())
(Define_Member_Values (Agent Way_SV) (Wait Go Left Right) :default (Wait ()))
(Define_Member_Values (Agent Wall_SV) (Open Shut) :default (Open ()))
(Define_Compatibility (SINGLE ((Agent Way_SV) ((Go ())))) :duration_bounds [1 1]
 :compatibility_spec
 (OR
  (meets (SINGLE ((Agent Way_SV) ((Left (-> ?l))))))
  (meets (SINGLE ((Agent Way_SV) ((Right (-> ?r))))))))
(Define_Compatibility (SINGLE ((Agent Way_SV) ((Left)))) :duration_bounds [1 3])
(Define_Compatibility (SINGLE ((Agent Way_SV) ((Right)))) :duration_bounds [1 3])
(Define_Compatibility
 (SINGLE ((Agent Way_SV) ((Left (-> ENDS)))))
 :compatibility_spec
 (ends :condition (SINGLE ((Agent Wall_SV) ((Shut ()))))))
(Define_Search_Control :leave_unbound (Left) (Right))
";

/// What the agent says at the tick after it went, where the left way comes to nothing if it ends so.
fn way(ends: &str, horizon: Ticks, guess: bool) -> (String, ServiceCounters) {
    let model = read(&GATES.replace("ENDS", ends));
    let options = TemporalOptions {
        guess,
        ..TemporalOptions::default()
    };
    let mut service = Temporal::new(model.clone(), options).expect("the model fits");
    service.advance(0);
    assert_eq!(service.solve(horizon, BUDGET), Outcome::Decided);
    service.advance(1);
    let go = { model.predicates.iter() }.position(|at| at.name == "Go");
    let go = go.expect("there is one");
    service
        .insert_goal(0, go, &[])
        .expect("it can wait no more");
    assert_eq!(service.solve(1, BUDGET), Outcome::Decided);
    service.advance(2);
    assert_eq!(service.solve(horizon, BUDGET), Outcome::Decided);
    let says = service.present(0).expect("it says something");
    (
        model.predicates[says.predicate].name.clone(),
        service.counters(),
    )
}

/// Without a status the left way times out after three ticks, where nothing follows.
#[test]
fn a_dead_end_ahead_makes_the_search_choose_another_way_now() {
    assert_eq!(way("TIMEOUT", 1, false).0, "Left");
    assert_eq!(way("TIMEOUT", 3, false).0, "Left");
    let (way, counters) = way("TIMEOUT", 4, false);
    assert_eq!(way, "Right");
    assert!(counters.backtracks > 0);
}

/// A guess is the first value that rules name and that lets the plan go on.
#[test]
fn a_guess_that_leads_nowhere_is_another_one() {
    // That the left way fails is guessed first, since a rule names it; then that it is well.
    assert_eq!(way("failed", 4, true).0, "Left");
    // Left alone, it times out; guessed, it ends before.
    assert_eq!(way("TIMEOUT", 4, true).0, "Left");
}

/// If nothing lets the plan go on, it is decided for now.
#[test]
fn without_a_way_on_it_is_decided_for_now() {
    let text = GATES.replace("ENDS", "TIMEOUT").replace(
        "  (meets (SINGLE ((Agent Way_SV) ((Right (-> ?r))))))))",
        "  ))",
    );
    let model = read(&text);
    let mut service = Temporal::new(model, TemporalOptions::default()).expect("the model fits");
    service.advance(0);
    assert_eq!(service.solve(9, BUDGET), Outcome::Decided);
    service.advance(1);
    service.insert_goal(0, 1, &[]).expect("it can wait no more");
    for tick in 1..4 {
        service.advance(tick);
        assert_eq!(service.solve(9, BUDGET), Outcome::Decided, "at {tick}");
    }
}
