//! A model that lacks one of its rules is noticed: by what is proved of it, by a case, or at random.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::*;
use crate::models::plant::Chances;

/// Where each compatibility of a text begins and ends.
fn compatibilities(text: &str) -> Vec<(usize, usize)> {
    let starts = text
        .match_indices("\n(Define_Compatibility")
        .map(|(at, _)| at + 1);
    starts
        .map(|start| {
            let mut depth = 0;
            let end = text[start..].find(|one| {
                depth += match one {
                    '(' => 1,
                    ')' => -1,
                    _ => 0,
                };
                depth == 0
            });
            (start, start + end.expect("it ends") + 1)
        })
        .collect()
}

/// What notices that a model is not as it should be.
fn noticed(text: &str) -> Option<&'static str> {
    let read = read_model("mutant.ddl", text, &Options::default());
    if !read.findings.is_empty() {
        return Some("a proof");
    }
    let mutant = Planned {
        system: System::of(Arc::new(read.value.expect("there are no findings"))),
        technology: Technology::Temporal,
    };
    let cases = alarms::CASES.iter().chain(goals::CASES);
    for &(name, case) in cases {
        if catch_unwind(AssertUnwindSafe(|| case(&mutant))).is_err() {
            return Some(name);
        }
    }
    let run = || random::run(&mutant, Chances::WILD, 1, 5_000);
    catch_unwind(AssertUnwindSafe(run))
        .err()
        .map(|_| "a random run")
}

/// Takes each rule out of a model in turn.
fn check(text: &str) {
    let all = compatibilities(text);
    assert!(all.len() > 30);
    let unnoticed = all.into_iter().filter_map(|(start, end)| {
        let mutant = text[..start].to_owned() + &text[end..];
        noticed(&mutant).is_none().then(|| &text[start..end])
    });
    assert_eq!(unnoticed.collect::<Vec<&str>>(), [""; 0]);
}

#[test]
fn a_model_without_one_of_its_rules_is_noticed() {
    check(SYSTEM);
}

#[test]
#[ignore = "as long again as the thorough model"]
fn a_light_model_without_one_of_its_rules_is_noticed() {
    check(LIGHT);
}
