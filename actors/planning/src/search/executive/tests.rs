//! How an executive decides, case by case.

use super::*;
use crate::language::{Options, read_model};

const TEXT: &str = "
(Define_Model agent :profile executive)
(Define_Object_Class Agent
 :state_variables ((Goal Goal_SV) (Executable Drive_SV) (State Mode_SV Log_SV)))
(Define_Type Status (ok TIMEOUT PREEMPTED))
(Define_Predicate NoGoal ())
(Define_Predicate GoTo (-> (Status ?status)))
(Define_Predicate Still ())
(Define_Predicate Drive (-> (Status ?status)))
(Define_Predicate Nominal ())
(Define_Predicate Hold ())
(Define_Predicate Quiet ())
(Define_Predicate Late ())
(Define_Member_Values (Agent Goal_SV) (NoGoal GoTo) :default (NoGoal ()))
(Define_Member_Values (Agent Drive_SV) (Still Drive) :default (Still ()))
(Define_Member_Values (Agent Mode_SV) (Nominal Hold) :default (Nominal ()))
(Define_Member_Values (Agent Log_SV) (Quiet Late) :default (Quiet ()))
(Define_Compatibility (SINGLE ((Agent Drive_SV) ((Drive)))) :duration_bounds [3 5])
(Define_Compatibility (SINGLE ((Agent Log_SV) ((Late ())))) :duration_bounds [1 1])
(Define_Compatibility
 (SINGLE ((Agent Drive_SV) ((Drive (-> TIMEOUT)))))
 :compatibility_spec (meets (SINGLE ((Agent Log_SV) ((Late ()))))))
(Define_Compatibility
 (SINGLE ((Agent Goal_SV) ((GoTo (-> ?status)))))
 :duration_bounds [1 50]
 :compatibility_spec
 (contained_by :condition (SINGLE ((Agent Mode_SV) ((Nominal ()))))))
";

struct Agent(Executive);

const GOAL: usize = 0;
const DRIVE: usize = 1;
const MODE: usize = 2;
const LOG: usize = 3;

impl Agent {
    fn new(text: &str) -> Self {
        let model = read_model("agent.ddl", text, &Options::default()).ok();
        let model = model.unwrap_or_else(|findings| panic!("{findings}"));
        let mut agent = Agent(Executive::new(Arc::new(model)));
        agent.cycle(0);
        agent
    }

    fn cycle(&mut self, tick: Ticks) {
        let verdict = self.0.cycle(tick, 10_000);
        assert!(matches!(verdict, Verdict::Solved), "{verdict:?}");
    }

    fn start(
        &mut self,
        timeline: TimelineId,
        name: &str,
        tick: Ticks,
    ) -> Result<TokenId, Conflict> {
        let predicates = &self.0.database.model().predicates;
        let predicate = predicates.iter().position(|at| at.name == name);
        let predicate = predicate.expect("there is one");
        let outputs = vec![None; predicates[predicate].parameters.len()];
        self.0.start(timeline, predicate, &outputs, tick)
    }

    /// What a timeline says, and since when.
    fn says(&self, timeline: TimelineId) -> (String, Ticks) {
        let token = self.0.present(timeline).expect("it says something");
        let database = &self.0.database;
        let at = database.token(token).expect("it is there");
        let name = database.model().predicates[at.predicate].name.clone();
        (name, database.start(token).min)
    }

    fn status(&self, token: TokenId) -> Option<String> {
        let database = &self.0.database;
        let value = database.value(database.token(token)?.parameters[0])?;
        Some(database.model().symbols[value as usize].clone())
    }

    fn ok(&self) -> Value {
        let symbols = &self.0.database.model().symbols;
        symbols
            .iter()
            .position(|at| at == "ok")
            .expect("there is one") as Value
    }
}

#[test]
fn a_status_binds_at_once_and_ends_as_the_duration_allows() {
    let mut agent = Agent::new(TEXT);
    let drive = agent.start(DRIVE, "Drive", 1).expect("it can start");
    agent.cycle(1);
    let ok = agent.ok();
    agent.0.report(drive, &[ok], true, 2).expect("it can be");
    assert_eq!(agent.status(drive).as_deref(), Some("ok"));
    agent.cycle(2);
    assert_eq!(agent.says(DRIVE), ("Drive".to_owned(), 1));
    agent.cycle(3);
    agent.cycle(4);
    assert_eq!(agent.says(DRIVE), ("Still".to_owned(), 4));
    assert_eq!(agent.says(LOG), ("Quiet".to_owned(), 0));
}

#[test]
fn an_expired_timer_says_so_and_what_follows_comes_in_the_same_cycle() {
    let mut agent = Agent::new(TEXT);
    let drive = agent.start(DRIVE, "Drive", 1).expect("it can start");
    (1..6).for_each(|tick| agent.cycle(tick));
    assert_eq!(agent.status(drive), None);
    agent.cycle(6);
    assert_eq!(agent.status(drive).as_deref(), Some("TIMEOUT"));
    assert_eq!(agent.says(DRIVE), ("Still".to_owned(), 6));
    assert_eq!(agent.says(LOG), ("Late".to_owned(), 6));
}

#[test]
fn a_command_is_preempted_once_its_duration_allows() {
    let mut agent = Agent::new(TEXT);
    let drive = agent.start(DRIVE, "Drive", 1).expect("it can start");
    agent.cycle(1);
    agent.cycle(2);
    let before = format!("{:?}", agent.0.database);
    assert!(agent.start(DRIVE, "Drive", 2).is_err());
    assert_eq!(format!("{:?}", agent.0.database), before);
    agent.cycle(3);
    agent.start(DRIVE, "Drive", 4).expect("the first may end");
    agent.cycle(4);
    assert_eq!(agent.status(drive).as_deref(), Some("PREEMPTED"));
    assert_eq!(agent.says(DRIVE), ("Drive".to_owned(), 4));
}

/// Section 3 of the IDEA paper: a goal holds within a mode, and ends with it.
#[test]
fn a_goal_ends_with_the_mode_that_contains_it() {
    let mut agent = Agent::new(TEXT);
    let goal = agent.start(GOAL, "GoTo", 1).expect("it can start");
    agent.cycle(1);
    agent.cycle(2);
    agent.start(MODE, "Hold", 3).expect("the mode may change");
    agent.cycle(3);
    assert_eq!(agent.says(MODE), ("Hold".to_owned(), 3));
    assert_eq!(agent.says(GOAL), ("NoGoal".to_owned(), 3));
    assert_eq!(agent.status(goal).as_deref(), Some("PREEMPTED"));
}

#[test]
fn without_a_legal_continuation_the_rule_is_named_and_nothing_was_decided() {
    let mut agent = Agent::new(TEXT);
    agent.start(MODE, "Hold", 1).expect("the mode may change");
    agent.cycle(1);
    let goal = agent.start(GOAL, "GoTo", 2).expect("it can start");
    let before = format!("{:?} {:?}", agent.0.database, agent.0.database.open());
    let verdict = agent.0.cycle(2, 10_000);
    let Verdict::Impossible(failure) = verdict else {
        panic!("the goal has no mode that contains it: {verdict:?}");
    };
    let instance = failure
        .instance
        .and_then(|at| agent.0.database.instance(at));
    let instance = instance.expect("a rule asked for it");
    assert_eq!(instance.master, goal);
    let after = format!("{:?} {:?}", agent.0.database, agent.0.database.open());
    assert_eq!(after, before);
}

const POLL: &str = "
(Define_Model poll :profile executive)
(Define_Object_Class Rover :state_variables ((State Tilt_SV Health_SV Mode_SV)))
(Define_Predicate Measure (-> (Number ?tilt) (Boolean ?rcvd)) :timed_out (?rcvd False))
(Define_Predicate Healthy ())
(Define_Predicate Blind ())
(Define_Predicate Nominal ())
(Define_Predicate Hold ())
(Define_Member_Values (Rover Tilt_SV) (Measure) :default (Measure))
(Define_Member_Values (Rover Health_SV) (Healthy Blind) :default (Healthy ()))
(Define_Member_Values (Rover Mode_SV) (Nominal Hold) :initial (Nominal ()))
(Define_Compatibility (SINGLE ((Rover Tilt_SV) ((Measure)))) :duration_bounds [1 2])
(Define_Compatibility
 (SINGLE ((Rover Tilt_SV) ((Measure (-> ?tilt False)))))
 :compatibility_spec (meets (SINGLE ((Rover Health_SV) ((Blind ()))))))
(Define_Compatibility
 (SINGLE ((Rover Tilt_SV) ((Measure))))
 :compatibility_spec
 (OR
  (meets :condition (SINGLE ((Rover Health_SV) ((Blind ())))))
  (meets (SINGLE ((Rover Mode_SV) ((Nominal ())))))))
(Define_Compatibility
 (SINGLE ((Rover Health_SV) ((Blind ()))))
 :duration_bounds [1 1]
 :compatibility_spec (starts (SINGLE ((Rover Mode_SV) ((Hold ()))))))
(Define_Search_Control
 :subgoal_order ((Rover Health_SV) Blind) ((Rover Mode_SV) Hold) ((Rover Mode_SV) Nominal))
";

/// What a model says that outputs are is what they are without a status; and a choice comes with what
/// it may insert, after what its condition asks for.
#[test]
fn a_poll_without_an_answer_says_so_and_a_choice_waits_for_what_it_asks() {
    let mut agent = Agent::new(POLL);
    assert_eq!(agent.says(2), ("Nominal".to_owned(), 0));
    let poll = agent.0.present(0).expect("there is a poll");
    agent.cycle(1);
    assert_eq!(agent.says(0), ("Measure".to_owned(), 0));
    agent.cycle(2);
    let database = &agent.0.database;
    let values: Vec<Option<Value>> = { database.token(poll).expect("it is kept") }
        .parameters
        .iter()
        .map(|&at| database.value(at))
        .collect();
    assert_eq!(values, [None, Some(0)]);
    assert_eq!(agent.says(1), ("Blind".to_owned(), 2));
    assert_eq!(agent.says(2), ("Hold".to_owned(), 2));
    assert_eq!(agent.0.counters().backtracks, 0);
    let poll = agent.0.present(0).expect("there is a poll");
    agent.0.report(poll, &[3, 1], true, 3).expect("it can be");
    agent.cycle(3);
    assert_eq!(agent.says(1), ("Healthy".to_owned(), 3));
    assert_eq!(agent.says(2), ("Nominal".to_owned(), 3));
}
