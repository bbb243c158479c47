//! Project files that are right, and those that are not.

use super::*;
use crate::checker::{Kind, check};
use crate::model::Argument;
use crate::plan::{Achieved, Origin, Plan, PlanToken};
use proptest::prelude::*;

const PSP2: &str = include_str!("../../models/psp2.sch");

/// The shortest schedule of `psp2` that CP-SAT finds: starts of activities 1 to 10.
const PSP2_STARTS: [Ticks; 10] = [0, 4, 4, 14, 9, 24, 28, 13, 36, 36];

/// A plan with these starts of the activities.
fn scheduled(model: &Model, problem: &Problem, starts: &[Ticks]) -> Plan {
    let mut plan = Plan::new(model, problem);
    for (goal, &start) in problem.goals.iter().zip(starts) {
        let value = |argument: &Argument| match *argument {
            Argument::Value(value) => Some(value),
            _ => None,
        };
        let values: Vec<Option<i64>> = goal.pattern.arguments.iter().map(value).collect();
        let effects = model.rules[0].effects.iter().enumerate();
        let effects = effects.map(|(id, effect)| (effect, id, values[id + 1].unwrap()));
        let effects: Vec<_> = effects.filter(|(.., amount)| *amount > 0).collect();
        let id = plan.tokens.len() as u32 + 1;
        let times = [start, start + goal.duration.min];
        let token = PlanToken::new(model, id, (0, 0), &values, times);
        plan.tokens.push(PlanToken {
            origin: Origin::Goal(goal.name.clone()),
            ..token.with_effects(model, &effects)
        });
        plan.achieved.push(Achieved {
            goal: goal.name.clone(),
            token: id,
        });
    }
    plan.makespan = plan.latest_end();
    plan
}

#[test]
fn psp2_has_a_schedule_of_45() {
    let (model, problem) = read("psp2.sch", PSP2.as_bytes()).unwrap();
    assert_eq!((problem.goals.len(), problem.orders.len()), (10, 10));
    assert_eq!(model.resources.len(), 5);
    let plan = scheduled(&model, &problem, &PSP2_STARTS);
    assert_eq!(plan.makespan, 45);
    assert_eq!(check(&model, &problem, &plan), []);
}

#[test]
fn a_start_that_is_shifted_is_told() {
    let (model, problem) = read("psp2.sch", PSP2.as_bytes()).unwrap();
    let mut starts = PSP2_STARTS;
    starts[6] += 1;
    let plan = scheduled(&model, &problem, &starts);
    let violations = check(&model, &problem, &plan);
    let kinds: Vec<Kind> = violations.iter().map(|one| one.kind).collect();
    assert_eq!(kinds, [Kind::Overuse; 4], "{violations:#?}");
    assert_eq!(
        violations[0].to_string(),
        "psp2.sch:26:1: project.resource_1 is at -3 from 36 to 37, below its least level of 0: by \
         token 7 -9, token 10 -4"
    );
    let mut starts = PSP2_STARTS;
    starts[3] -= 1;
    let plan = scheduled(&model, &problem, &starts);
    let violations = check(&model, &problem, &plan);
    assert_eq!(violations[0].kind, Kind::Overuse);
    let mut starts = PSP2_STARTS;
    starts[0] += 1;
    let plan = scheduled(&model, &problem, &starts);
    let violations = check(&model, &problem, &plan);
    let told = "psp2.sch:3:1: the order of goals \"activity_1\" and \"activity_5\" is violated: the \
                start of token 5 Activity(5, 6, 6, 3, 6, 6) on project.activities [9 12] lies 8 \
                ticks after the start of token 1 Activity(1, 4, 3, 7, 7, 2) on \
                project.activities [1 5]";
    let told_too = violations.iter().any(|one| one.to_string() == told);
    assert!(told_too, "{violations:#?}");
}

#[test]
fn the_checker_accepts_what_cp_sat_found() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/models/rcpsp_max/");
    let answers = std::fs::read_to_string(format!("{folder}answers.csv")).unwrap();
    let (mut feasible, mut infeasible) = (0, 0);
    for row in answers.lines().skip(1) {
        let row: Vec<&str> = row.split(',').collect();
        let [file, activities, is_feasible, makespan, starts] = row[..] else {
            panic!("{row:?}");
        };
        let text = std::fs::read(format!("{folder}{file}")).unwrap();
        let (model, problem) = read(file, &text).unwrap();
        assert_eq!(problem.goals.len().to_string(), activities);
        if is_feasible == "0" {
            infeasible += 1;
            continue;
        }
        feasible += 1;
        let starts: Vec<Ticks> = starts
            .split(' ')
            .map(|start| start.parse().unwrap())
            .collect();
        let plan = scheduled(&model, &problem, &starts[1..]);
        assert_eq!(plan.makespan.to_string(), makespan, "{file}");
        assert!(plan.makespan <= problem.horizon);
        assert_eq!(check(&model, &problem, &plan), [], "{file}");
    }
    assert_eq!((feasible, infeasible), (40, 20));
}

/// A project of three activities and what the file says of them: lags from each to each, durations
/// and demands of one resource.
fn text(lags: &[(usize, usize, i64)], durations: [i64; 3], demands: [i64; 3]) -> String {
    let mut text = "3 1 0 0\n".to_owned();
    for id in 0..5 {
        let of_it = lags
            .iter()
            .filter(|(from, to, _)| *from == id && to != from);
        let of_it: Vec<_> = of_it.collect();
        text += &format!("{id} 1 {}", of_it.len());
        of_it
            .iter()
            .for_each(|(_, to, _)| text += &format!(" {to}"));
        of_it
            .iter()
            .for_each(|(.., lag)| text += &format!(" [{lag}]"));
        text += "\n";
    }
    for id in 0..5 {
        let (duration, demand) = match id {
            0 | 4 => (0, 0),
            id => (durations[id - 1], demands[id - 1]),
        };
        text += &format!("{id} 1 {duration} {demand}\n");
    }
    text + "2\n"
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    fn the_problem_is_what_the_file_says(
        lags in proptest::collection::vec((0_usize..5, 0_usize..5, -4_i64..4), 0..4),
        durations in proptest::array::uniform3(0_i64..4),
        demands in proptest::array::uniform3(0_i64..3),
        starts in proptest::array::uniform4(0_i64..5),
    ) {
        let text = text(&lags, durations, demands);
        let (model, mut problem) = read("three.sch", text.as_bytes()).unwrap();
        // All starts are in it: that a horizon is long enough is tried apart.
        problem.horizon = 20;
        let plan = scheduled(&model, &problem, &starts);
        let ends: Vec<Ticks> = (0..3).map(|id| starts[id] + durations[id]).collect();
        let start = |id: usize, end: Ticks| match id {
            0 => 0,
            4 => end,
            id => starts[id - 1],
        };
        let apart = lags.iter().filter(|(from, to, _)| from != to);
        // The end is a goal of its own, or else any time from the last activity's end on will do.
        let has_end = problem.goals.len() == 4;
        let over = ends.iter().copied().max().unwrap();
        let end = if has_end { starts[3] } else { over.max(100) };
        let keeps_lags = apart.clone().all(|&(from, to, lag)| start(to, end) >= start(from, end) + lag);
        let fits = (0..20).all(|now| {
            let at = (0..3).filter(|&id| starts[id] <= now && now < ends[id]);
            at.map(|id| demands[id]).sum::<i64>() <= 2
        });
        let violations = check(&model, &problem, &plan);
        prop_assert_eq!(violations.is_empty(), keeps_lags && fits, "{:?}\n{}", violations, text);
    }

    #[test]
    fn any_bytes_are_a_project_or_an_error(
        place in 0..PSP2.len(),
        with in proptest::collection::vec(any::<u8>(), 0..4),
        until in 0..PSP2.len(),
    ) {
        let mut bytes = PSP2.as_bytes().to_vec();
        bytes.splice(place..(place + 1).max(until.min(place + 9)), with);
        let lines = bytes.iter().filter(|byte| **byte == b'\n').count() + 1;
        if let Err(SchError::Line { line, .. }) = read("x.sch", &bytes) {
            prop_assert!((1..=lines).contains(&line));
        }
        let _ = read("x.sch", &bytes[..until.min(bytes.len())]);
    }
}

#[test]
fn errors_name_the_line_and_what_was_expected() {
    let two = "2 1 0 0\n0 1 1 1 [0]\n1 1 1 2 [4]\n2 1 1 3 [2]\n3 1 0\n0 1 0 0\n1 1 3 2\n2 1 2 1\n\
               3 1 0 0\n2\n";
    assert!(read("two.sch", two.as_bytes()).is_ok());
    let cases = [
        (
            "",
            "",
            "line 1: the file ends here, before the numbers of activities",
        ),
        (
            "2 1 0 0",
            "two 1 0 0",
            "line 1: \"two\" stands where the number of activities should",
        ),
        (
            "2 1 0 0",
            "10001 1",
            "line 1: \"10001\" stands where the number of activities should, 0 to 10000",
        ),
        (
            "2 1 0 0",
            "2 1 3 0",
            "line 1: \"3\" stands where 0, since all resources are renewable",
        ),
        (
            "1 1 1 2 [4]",
            "2 1 1 2 [4]",
            "line 3: \"2\" stands where the activity's number should, 1 to 1",
        ),
        (
            "1 1 1 2 [4]",
            "1 2 1 2 [4]",
            "line 3: \"2\" stands where the activity's only mode should",
        ),
        (
            "1 1 1 2 [4]",
            "1 1 1 1 [4]",
            "line 3: activity 1 is its own successor",
        ),
        (
            "1 1 1 2 [4]",
            "1 1 1 4 [4]",
            "line 3: \"4\" stands where a successor should, 0 to 3",
        ),
        (
            "1 1 1 2 [4]",
            "1 1 1 2",
            "line 3: it ends before the lag of each successor",
        ),
        (
            "1 1 1 2 [4]",
            "1 1 1 2 [4] [5]",
            "line 3: \"[5]\" is more than the line should have",
        ),
        (
            "1 1 1 2 [4]",
            "1 1 1 2 [99999999999]",
            "line 3: \"[99999999999]\" stands where a lag",
        ),
        (
            "1 1 3 2",
            "1 1 -3 2",
            "line 7: \"-3\" stands where the duration should, 0 to 1000000000",
        ),
        ("1 1 3 2", "1 1 3", "line 7: it ends before a demand"),
        (
            "0 1 0 0",
            "0 1 1 0",
            "line 6: \"1\" stands where the duration should, 0 to 0",
        ),
        (
            "\n2\n",
            "\n",
            "line 9: the file ends here, before the capacities",
        ),
        (
            "\n2\n",
            "\n\n2\n3\n",
            "line 12: the project is over before this line",
        ),
    ];
    for (from, to, expected) in cases {
        let text = match from {
            "" => String::new(),
            from => two.replacen(from, to, 1),
        };
        let error = read("two.sch", text.as_bytes()).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}\n{expected}");
    }
    let error = read("x", &[b'\n', 0xff]).unwrap_err().to_string();
    assert_eq!(error, "line 2: it is no text");
    let large = vec![b' '; MAX_FILE_BYTES + 1];
    let actual_bytes = MAX_FILE_BYTES + 1;
    assert_eq!(
        read("x", &large).unwrap_err(),
        SchError::TooLarge { actual_bytes }
    );
}
