//! Mistakes that others made, each as a case.

use std::sync::Arc;

use crate::database::*;
use crate::language::{Options, read_model};
use crate::model::End;
use crate::parameters::Operand;

const TEXT: &str = "
(Define_Model lab :profile scheduler)
(Define_Object_Class Lab :state_variables ((Unary Arm_SV) (Free Work_SV)))
(Define_Type Small [0 9])
(Define_Predicate Job ())
(Define_Predicate Child ())
(Define_Predicate Later ())
(Define_Predicate Wait ((Small ?least)))
(Define_Predicate Heat ((Small ?watts)))
(Define_Member_Values (Lab Arm_SV) (Job Child Later Wait))
(Define_Member_Values (Lab Work_SV) (Heat))
(Define_Resource (Lab power) :kind renewable :capacity 4)
(Define_Compatibility (SINGLE ((Lab Arm_SV) ((Child ())))) :duration_bounds [5 5])
(Define_Compatibility (SINGLE ((Lab Arm_SV) ((Wait (?least))))) :duration_bounds [?least inf])
(Define_Compatibility
 (SINGLE ((Lab Arm_SV) ((Job ()))))
 :duration_bounds [2 9]
 :compatibility_spec
 (AND
  (meets (SINGLE ((Lab Arm_SV) ((Child ())))))
  (before (SINGLE ((Lab Arm_SV) ((Later ())))))))
(Define_Compatibility
 (SINGLE ((Lab Work_SV) ((Heat (?watts)))))
 :duration_bounds [10 10]
 :uses ((Lab power) ?watts))
";

const ARM: usize = 0;
const WORK: usize = 1;

struct Lab {
    database: Database,
}

impl Lab {
    fn new() -> Self {
        let model = read_model("lab.ddl", TEXT, &Options::default()).ok();
        let model = model.unwrap_or_else(|findings| panic!("{findings}"));
        Lab {
            database: Database::new(Arc::new(model), Span::new(0, 60)),
        }
    }

    fn insert(&mut self, predicate: &str, parameters: &[Option<Operand>]) -> TokenId {
        let predicates = &self.database.model.predicates;
        let predicate = predicates.iter().position(|at| at.name == predicate);
        let wanted = Wanted {
            predicate: predicate.expect("there is one"),
            timeline: None,
            parameters,
            start: None,
            finish: None,
            cause: Cause::User,
        };
        self.database.insert(wanted).expect("it can be")
    }

    fn place(&mut self, token: TokenId, timeline: usize, after: Option<TokenId>) {
        let slot = Slot { timeline, after };
        self.database
            .activate(token, slot)
            .expect("it can be there");
    }

    /// A relation of the only rule with relations of a job.
    fn relation(&self, job: TokenId, relation: u32) -> (InstanceId, u32) {
        let of_job = |open: &&Open| self.database.instance_at(open.instance).master == job;
        let open = self.database.open().iter().find(of_job);
        (open.expect("something is open").instance, relation)
    }
}

/// plandev #1468.
#[test]
fn two_that_exclude_each_other_do_not_overlap_whichever_is_placed_first() {
    for second_goes_first in [false, true] {
        let mut lab = Lab::new();
        let [one, two] = [(); 2].map(|()| lab.insert("Child", &[]));
        lab.place(one, ARM, None);
        lab.place(two, ARM, if second_goes_first { None } else { Some(one) });
        let [first, second] = if second_goes_first {
            [two, one]
        } else {
            [one, two]
        };
        let database = &mut lab.database;
        assert_eq!(database.start(second).min, 5);
        assert_eq!(database.finish(first).max, 55);
        // Nothing moves the one into the other.
        let early = database.restrict_time(second, End::Start, Span::at_most(4), Owner::Given);
        assert!(early.is_err());
        database.end(first, 20).expect("it can end then");
        assert_eq!(database.start(second).min, 20);
    }
}

/// plandev #1583: whoever asks about a token that is gone gets no answer, and no panic.
#[test]
fn a_plan_is_looked_at_after_an_activity_was_deleted() {
    let mut lab = Lab::new();
    let [one, two] = [(); 2].map(|()| lab.insert("Child", &[]));
    lab.place(one, ARM, None);
    lab.place(two, ARM, Some(one));
    let database = &mut lab.database;
    let late = database.restrict_time(one, End::Start, Span::at_least(52), Owner::Token(one));
    let conflict = late.expect_err("the second has no room");
    let told = (conflict.to_string(), conflict.owners());
    assert!(told.1.contains(&Owner::Sequence {
        first: one,
        second: two
    }));
    let instance = database.at(two).instances()[0];
    database.remove(two);
    assert!(database.token(two).is_none() && database.instance(instance).is_none());
    assert_eq!((conflict.to_string(), conflict.owners()), told);
    assert_eq!(database.on(ARM).collect::<Vec<_>>(), [one]);
    super::check(database);
}

/// plandev #1270 and #1829.
#[test]
fn a_child_of_a_parent_at_the_end_of_the_horizon_is_out_and_asked_again_when_it_moves() {
    let mut lab = Lab::new();
    let job = lab.insert("Job", &[]);
    lab.place(job, ARM, None);
    let (instance, meets) = lab.relation(job, 0);
    let database = &mut lab.database;
    let times = [Time::At(0), database.time(job, End::Finish)];
    let late = database.order_for(job, times, Span::at_least(57), Owner::Decision(0));
    let (_, late) = late.expect("it fits").expect("it is posted");
    let slot = Slot {
        timeline: ARM,
        after: Some(job),
    };
    assert!(database.insert_for(instance, meets, slot, None).is_err());
    // The parent moves: the same child is asked for again, and is in.
    database.take_back_order(job, late);
    let child = database
        .insert_for(instance, meets, slot, None)
        .expect("there is room");
    assert_eq!(database.finish(child).max, 60);
    // And with it the parent cannot move back.
    let times = [Time::At(0), database.time(job, End::Finish)];
    let again = database.order_for(job, times, Span::at_least(57), Owner::Decision(0));
    assert!(again.is_err());
    super::check(database);
}

/// Uses are half open: one that ends when another one begins is no over-use.
#[test]
fn a_use_may_begin_when_another_one_ends() {
    let mut lab = Lab::new();
    let full = Some(Operand::Value(4));
    let [one, two] = [0, 10].map(|start| {
        let heat = lab.insert("Heat", &[full]);
        lab.place(heat, WORK, None);
        let at = Span::exactly(start);
        let said = lab
            .database
            .restrict_time(heat, End::Start, at, Owner::Token(heat));
        said.expect("it can start then");
        heat
    });
    let database = &mut lab.database;
    assert_eq!(database.finish(one), database.start(two));
    assert!(database.levels(0).flexible.first_over_use(0).is_none());
    assert!(database.levels(0).earliest.first_over_use(0).is_none());
}

/// europa #73: what is before has ended a tick earlier.
#[test]
fn a_strict_before_is_not_a_meets() {
    let mut lab = Lab::new();
    let [job, later] = ["Job", "Later"].map(|name| lab.insert(name, &[]));
    lab.place(job, ARM, None);
    lab.place(later, ARM, Some(job));
    let (instance, before) = lab.relation(job, 1);
    let database = &mut lab.database;
    database.end(job, 7).expect("it can end then");
    assert_eq!(database.start(later).min, 7);
    database
        .support(instance, before, later)
        .expect("it comes later");
    assert_eq!(database.start(later).min, 8);
    assert!(!database.meets(job, later));
}

/// Ours: a bound that is a variable was asked once, while it was still open.
#[test]
fn a_bound_of_known_times_holds_when_its_variable_is_known() {
    let mut lab = Lab::new();
    let predicates = &lab.database.model.predicates;
    let predicate = predicates.iter().position(|at| at.name == "Wait");
    let wanted = Wanted {
        predicate: predicate.expect("there is one"),
        timeline: None,
        parameters: &[None],
        start: Some(Time::At(10)),
        finish: Some(Time::At(13)),
        cause: Cause::User,
    };
    let wait = lab.database.insert(wanted).expect("it can be");
    lab.place(wait, ARM, None);
    let owner = Owner::Token(wait);
    let refused = lab.database.bind(wait, 0, 4, owner);
    let bound = matches!(refused, Err(Conflict::Known { is: 3, .. }));
    assert!(bound, "three ticks are not four: {refused:?}");
    assert!(lab.database.bind(wait, 0, 3, owner).is_ok());
}
