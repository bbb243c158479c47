//! Explanations beside a brute force over all sets of goals, and on the models of the crate.

use std::sync::Arc;

use proptest::prelude::*;

use super::*;
use crate::checker;
use crate::language::{Options, read_model, read_problem};
use crate::sch;
use crate::search::{Forward, Planner, Settings};
use crate::temporal::Span;

const REQUEST: Request = Request {
    operations: 1_000_000,
    seed: 1,
    is_proven: false,
};

fn read(model: &str, problem: &str) -> (Arc<Model>, Arc<Problem>) {
    let model = read_model("m.ddl", model, &Options::default()).ok();
    let model = model.unwrap_or_else(|findings| panic!("{findings}"));
    let problem = read_problem("p.ddl", problem, &model, &Options::default()).ok();
    let problem = problem.unwrap_or_else(|findings| panic!("{findings}"));
    (Arc::new(model), Arc::new(problem))
}

/// An arm that does one thing at a time: by its timeline, or by a resource of one unit.
fn arm(by_resource: bool) -> &'static str {
    match by_resource {
        false => {
            "(Define_Object_Class Rover :state_variables ((Unary Arm_SV)))
             (Define_Type Minutes [0 100])
             (Define_Predicate Dig ((Minutes ?ticks)))
             (Define_Member_Values (Rover Arm_SV) (Dig))
             (Define_Compatibility (SINGLE ((Rover Arm_SV) ((Dig (?ticks)))))
              :duration_bounds [?ticks ?ticks])"
        }
        true => {
            "(Define_Object_Class Rover :state_variables ((Free Arm_SV)))
             (Define_Type Minutes [0 100])
             (Define_Predicate Dig ((Minutes ?ticks)))
             (Define_Member_Values (Rover Arm_SV) (Dig))
             (Define_Resource (Rover arm) :kind unary)
             (Define_Compatibility (SINGLE ((Rover Arm_SV) ((Dig (?ticks)))))
              :duration_bounds [?ticks ?ticks] :uses ((Rover arm) 1))"
        }
    }
}

/// A piece of work: how long it lasts, when it starts earliest and latest.
type Work = (i64, i64, i64);

fn digging(works: &[Work]) -> String {
    let mut text = "(Define_Problem day :horizon [0 100])\n".to_owned();
    for (place, (ticks, from, to)) in works.iter().enumerate() {
        // Different lengths, so that no token does for two goals.
        text += &format!(
            "(Goal g{place} (SINGLE ((Rover Arm_SV) ((Dig ({ticks}))))) :start [{from} {to}] \
             :mandatory)\n"
        );
    }
    text
}

/// Whether there is an order in which all can be done: each as early as it can be.
fn can_be(works: &mut Vec<Work>, from: i64) -> bool {
    if works.is_empty() {
        return true;
    }
    for place in 0..works.len() {
        let (ticks, earliest, latest) = works.remove(place);
        let start = earliest.max(from);
        let can = start <= latest && start + ticks <= 100 && can_be(works, start + ticks);
        works.insert(place, (ticks, earliest, latest));
        if can {
            return true;
        }
    }
    false
}

/// The size of the largest sets that can be, by trying all.
fn most(works: &[Work]) -> usize {
    let sets = 0_u32..1 << works.len();
    let sizes = sets.map(|set| {
        let members = works.iter().enumerate();
        let members = members.filter(|at| set >> at.0 & 1 == 1).map(|at| *at.1);
        let mut some: Vec<Work> = members.collect();
        match can_be(&mut some, 0) {
            true => some.len(),
            false => 0,
        }
    });
    sizes.max().unwrap_or(0)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// What is to be dropped is as few as a brute force says, and the rest can be.
    #[test]
    fn as_few_goals_are_dropped_as_must_be(
        drawn in prop::collection::vec((1_i64..12, 0_i64..30, 0_i64..10), 2..6),
        by_resource: bool,
    ) {
        let works: Vec<Work> = drawn
            .iter()
            .enumerate()
            .map(|(place, &(ticks, from, room))| (ticks * 6 + place as i64, from, from + room))
            .collect();
        let (model, problem) = read(arm(by_resource), &digging(&works));
        let told = missing_plan(&model, &problem, REQUEST);
        let fewest = works.len() - most(&works);
        if fewest == 0 {
            prop_assert_eq!(told.outcome, Outcome::Possible);
            return Ok(());
        }
        prop_assert_eq!(told.outcome, Outcome::Goals);
        prop_assert!(told.proven);
        prop_assert_eq!(told.smallest, Some(Smallest::Proven), "{}", told);
        prop_assert_eq!(told.goals.len(), fewest, "{}", told);
        let is_kept = |at: &(usize, &Work)| !told.goals.contains(&format!("g{}", at.0));
        let kept = works.iter().enumerate().filter(is_kept).map(|at| *at.1);
        prop_assert!(can_be(&mut kept.collect(), 0));
        prop_assert!(!told.reasons.is_empty());
        if by_resource {
            // Those that cannot all be are as few as can be.
            let place = |goal: &ToldGoal| works[goal.name[1..].parse::<usize>().expect("a place")];
            let core: Vec<Work> = told.together.iter().map(place).collect();
            prop_assert!(core.len() > 1);
            prop_assert_eq!(most(&core), core.len() - 1);
        }
    }
}

/// Solves a problem without some goals, and holds the plan to be valid.
fn solves_without(model: &Arc<Model>, problem: &Arc<Problem>, dropped: &[String]) {
    let kept = problem
        .goals
        .iter()
        .map(|goal| !dropped.contains(&goal.name));
    let less = Arc::new(sets::only(problem, &kept.collect::<Vec<bool>>()));
    let settings = Settings {
        operations: 2_000_000,
        seed: 1,
    };
    let answer = Forward.solve(model, &less, settings).expect("it loads");
    let plan = answer.plan.expect("there is a plan");
    let violations = checker::check(model, &less, &plan);
    assert!(violations.is_empty(), "{violations:#?}");
}

#[test]
fn a_battery_that_is_too_small_is_named_with_those_who_drain_it() {
    let model = "(Define_Object_Class Rover :state_variables ((Free Arm_SV)))
        (Define_Type Size [0 100])
        (Define_Predicate Dig ((Size ?energy)))
        (Define_Member_Values (Rover Arm_SV) (Dig))
        (Define_Resource (Rover battery) :kind depletable :limits [5 20] :initial 15)
        (Define_Compatibility (SINGLE ((Rover Arm_SV) ((Dig (?energy)))))
         :duration_bounds [1 1]
         :consumes ((Rover battery) ?energy))";
    let problem = "(Define_Problem day :horizon [0 100])
        (Goal one (SINGLE ((Rover Arm_SV) ((Dig (4))))) :mandatory)
        (Goal two (SINGLE ((Rover Arm_SV) ((Dig (5))))) :mandatory)
        (Goal three (SINGLE ((Rover Arm_SV) ((Dig (3))))) :mandatory)";
    let (model, problem) = read(model, problem);
    let told = missing_plan(&model, &problem, REQUEST);
    assert_eq!((told.proven, told.only_way), (true, true), "{told}");
    assert_eq!(
        (&told.goals[..], told.smallest),
        (&["three".to_owned()][..], Some(Smallest::Proven))
    );
    assert_eq!(told.together.len(), 3);
    let [over_use] = told.reasons.as_slice() else {
        panic!("{told}")
    };
    assert_eq!(
        over_use.message,
        "battery falls 2 below its least level 5 at tick 0"
    );
    assert_eq!(
        (over_use.kind, over_use.amount),
        (ReasonKind::OverUse, Some(2))
    );
    assert_eq!(over_use.times, Some((0, None)));
    let parts = over_use
        .parts
        .iter()
        .map(|part| (part.message.as_str(), part.amount));
    let drains = [
        ("one takes 4", Some(4)),
        ("two takes 5", Some(5)),
        ("three takes 3", Some(3)),
    ];
    assert_eq!(parts.collect::<Vec<_>>(), drains);
    assert!(
        over_use
            .parts
            .iter()
            .all(|part| part.place.starts_with("m.ddl:8:")),
        "{told}"
    );
    assert!(
        over_use.places().contains(&"p.ddl:4:9"),
        "{:?}",
        over_use.places()
    );
}

#[test]
fn a_sol_that_is_too_full_is_mended() {
    let (model, problem) = read(
        include_str!("../../models/rover.ddl"),
        include_str!("../../models/rover-too-much.ddl"),
    );
    let told = missing_plan(&model, &problem, REQUEST);
    assert_eq!(
        (told.outcome, told.goals.len()),
        (Outcome::Goals, 1),
        "{told}"
    );
    solves_without(&model, &problem, &told.goals);
    let places: Vec<&str> = told.reasons.iter().flat_map(Reason::places).collect();
    assert!(
        places.iter().any(|place| place.starts_with("m.ddl:")),
        "{told}"
    );
    let json = serde_json::to_value(&told).expect("it is JSON");
    assert_eq!(json["goals"][0], told.goals[0].as_str());
}

/// Each of the generated projects of 10 activities that has no schedule is explained, by goals
/// without which it has one.
#[test]
fn projects_without_a_schedule_are_explained() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/models/rcpsp_max");
    let answers = std::fs::read_to_string(format!("{folder}/answers.csv")).expect("it is there");
    let mut explained = 0;
    for line in answers.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        if fields[1] != "10" || fields[2] == "1" {
            continue;
        }
        let bytes = std::fs::read(format!("{folder}/{}", fields[0])).expect("it is there");
        let (model, problem) = sch::read(fields[0], &bytes).expect("a project");
        let (model, problem) = (Arc::new(model), Arc::new(problem));
        let told = missing_plan(&model, &problem, REQUEST);
        assert!(told.proven, "{told}");
        assert_eq!(told.smallest, Some(Smallest::Proven), "{told}");
        let times = told
            .reasons
            .iter()
            .filter(|at| at.kind == ReasonKind::Times);
        assert!(times.clone().count() > 0, "{told}");
        for reason in times {
            assert!(reason.places().len() > 1, "{told}");
        }
        solves_without(&model, &problem, &told.goals);
        explained += 1;
    }
    assert_eq!(explained, 8);
}

#[test]
fn what_is_the_case_is_told_apart_from_what_is_wanted() {
    let problem = "(Define_Problem day :horizon [0 100])
        (Fact (SINGLE ((Rover Arm_SV) ((Dig (20))))) :start 0)
        (Fact (SINGLE ((Rover Arm_SV) ((Dig (30))))) :start 10)
        (Goal g (SINGLE ((Rover Arm_SV) ((Dig (5))))) :mandatory)";
    let (model, problem) = read(arm(false), problem);
    let told = missing_plan(&model, &problem, REQUEST);
    assert_eq!(
        (told.outcome, told.proven),
        (Outcome::Facts, true),
        "{told}"
    );
    assert!(told.goals.is_empty());
    let places = told.reasons[0].places();
    assert!(
        places.contains(&"p.ddl:2:10") || places.contains(&"p.ddl:2:9"),
        "{places:?}"
    );
    assert!(
        told.to_string().starts_with("What is the case cannot be"),
        "{told}"
    );
}

#[test]
fn a_goal_that_cannot_be_of_itself_is_the_one_to_drop() {
    let problem = "(Define_Problem day :horizon [0 100])
        (Goal ok (SINGLE ((Rover Arm_SV) ((Dig (20))))) :mandatory)
        (Goal late (SINGLE ((Rover Arm_SV) ((Dig (20))))) :mandatory)";
    let (model, mut problem) = read(arm(false), problem);
    // A reading of the text would refuse it.
    let late = &mut Arc::get_mut(&mut problem)
        .expect("nobody else has it")
        .goals[1];
    (late.start, late.finish) = (Span::new(90, 95), Span::new(0, 80));
    let told = missing_plan(&model, &problem, REQUEST);
    assert_eq!(told.goals, ["late"], "{told}");
    assert!(told.proven && told.only_way);
    assert_eq!(told.smallest, Some(Smallest::Proven));
    let told = left_out(&model, &problem, &[true, false], 1, REQUEST);
    assert!(told.proven && told.goals.is_empty(), "{told}");
    assert_eq!(told.together[0].name, "late");
}

#[test]
fn a_goal_that_is_left_out_names_what_it_would_cost() {
    let problem = "(Define_Problem day :horizon [0 100])
        (Goal much (SINGLE ((Rover Arm_SV) ((Dig (20))))) :start [0 10] :weight 9)
        (Goal more (SINGLE ((Rover Arm_SV) ((Dig (21))))) :start [40 50] :weight 9)
        (Goal little (SINGLE ((Rover Arm_SV) ((Dig (22))))) :start [5 9] :weight 1)";
    let (model, problem) = read(arm(false), problem);
    let told = left_out(&model, &problem, &[true, true, false], 2, REQUEST);
    assert_eq!(told.goals, ["much"], "{told}");
    assert_eq!(
        told.goal.as_ref().map(|goal| goal.name.as_str()),
        Some("little")
    );
    assert_eq!(told.smallest, Some(Smallest::Proven));
    let text = told.to_string();
    assert!(text.contains("there is a plan with little"), "{text}");
}

#[test]
fn without_operations_nothing_is_said_that_is_not_known() {
    let works = [(40, 0, 5), (41, 0, 5), (42, 0, 5)];
    let (model, problem) = read(arm(true), &digging(&works));
    for operations in [0, 1, 10, 100, 1_000] {
        let request = Request {
            operations,
            ..REQUEST
        };
        let told = missing_plan(&model, &problem, request);
        assert!(
            told.outcome != Outcome::Facts && told.outcome != Outcome::Possible,
            "{told}"
        );
        match told.smallest {
            Some(Smallest::Found) | None => {}
            _ => assert_eq!(told.goals.len(), 2, "{told}"),
        }
        assert!(told.smallest.is_some() != told.goals.is_empty());
    }
}

/// What can be is never said to be proven impossible, however few operations there are.
#[test]
fn what_can_be_is_never_called_impossible() {
    let works = [
        (10, 0, 60),
        (11, 0, 60),
        (12, 0, 60),
        (13, 0, 60),
        (14, 0, 60),
    ];
    let (model, problem) = read(arm(true), &digging(&works));
    for operations in [1, 20, 50, 100, 200, 400, 800] {
        let request = Request {
            operations,
            ..REQUEST
        };
        let told = missing_plan(&model, &problem, request);
        assert!(
            !told.proven && told.smallest != Some(Smallest::Proven),
            "{told}"
        );
    }
}

/// The same request, the same words.
#[test]
fn explanations_are_the_same_each_time() {
    let works = [(40, 0, 5), (41, 0, 5), (42, 0, 5), (10, 0, 90)];
    let (model, problem) = read(arm(true), &digging(&works));
    let [one, other] = [0, 1].map(|_| missing_plan(&model, &problem, REQUEST));
    assert_eq!(one, other);
}

/// What has no plan may have one with more goals, if one of those produces what others consume.
#[test]
fn a_goal_that_helps_others_is_kept_for_them() {
    let model = "(Define_Object_Class Rover :state_variables ((Free Arm_SV)))
        (Define_Predicate Dig ())
        (Define_Predicate Charge ())
        (Define_Member_Values (Rover Arm_SV) (Dig Charge))
        (Define_Resource (Rover battery) :kind depletable :limits [0 20] :initial 10)
        (Define_Compatibility (SINGLE ((Rover Arm_SV) ((Dig ()))))
         :duration_bounds [1 1] :consumes ((Rover battery) 8))
        (Define_Compatibility (SINGLE ((Rover Arm_SV) ((Charge ()))))
         :duration_bounds [1 1] :produces ((Rover battery) 8))";
    let mut problem = "(Define_Problem day :horizon [0 100])\n".to_owned();
    for name in ["a", "b", "c", "d"] {
        problem += &format!("(Goal {name} (SINGLE ((Rover Arm_SV) ((Dig ())))) :mandatory)\n");
    }
    problem += "(Goal charge (SINGLE ((Rover Arm_SV) ((Charge ())))) :mandatory)\n";
    let (model, problem) = read(model, &problem);
    let told = missing_plan(&model, &problem, REQUEST);
    assert_eq!(told.goals.len(), 2, "{told}");
    assert!(!told.goals.contains(&"charge".to_owned()), "{told}");
    assert_eq!(told.smallest, Some(Smallest::Proven), "{told}");
    solves_without(&model, &problem, &told.goals);
}
