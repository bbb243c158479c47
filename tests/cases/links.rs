//! Contact plans as other programs write them, and links whose keys have no effect.

use std::path::{Path, PathBuf};

use farside_actors::system::Files;
use farside_experiments::registry::Registry;
use farside_experiments::scenario::{Assembled, Scenario, ScenarioError};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("cases/links")
}

fn assembled(text: String) -> Result<Assembled, ScenarioError> {
    let files = Files::on_disk(folder());
    let registry = Registry::builtin();
    Scenario::parse("case.toml", text, &[], &registry, files)?.assemble()
}

/// A second of traffic from `a` to `b` by a plan, and with these keys of `[contacts]`.
fn by_plan(file: &str, keys: &str) -> Result<Assembled, ScenarioError> {
    assembled(format!(
        "system = 'traffic'\nuntil = '400s'\n\
         contacts = {{ file = '{file}', nodes = {{ 1 = 'a', 2 = 'b' }}, {keys} }}\n\
         [traffic]\nhosts = ['a', 'b']\nflow = [{{ from = 'a', to = 'b', size = '1kB', period = '1s' }}]\n\
         [links.default]\nstore_and_forward = true\n"
    ))
}

/// A contact: when it begins and ends \[s\], its light time \[s\], and the bytes that fit through it.
type Told = (f64, f64, f64, Option<u64>);

fn contacts(assembled: &Assembled, from: &str, to: &str) -> Vec<Told> {
    let contacts = assembled.contacts.as_ref().expect("it has a plan");
    let windows = contacts.windows(from, to).expect("the plan names both");
    let told = windows.iter().map(|window| {
        let [start, end] = [window.start, window.end].map(|at| at.as_secs_f64());
        (start, end, window.owlt.as_secs_f64(), window.volume_bytes())
    });
    told.collect()
}

/// Each plan, its contacts from `a` to `b`, and what the only remark on it begins with, if there
/// is one.
const PLANS: [(&str, Told, &str); 10] = [
    ("combined.rc", (0.0, 60.0, 1.0, Some(60_000)), ""),
    (
        "hypothetical.ionrc",
        (0.0, 60.0, 1.0, Some(60_000)),
        "line 2: the contact is hypothetical: it is passed over",
    ),
    ("announce.ionrc", (0.0, 60.0, 1.0, Some(60_000)), ""),
    (
        "range-ends-early.ionrc",
        (30.0, 200.0, 3.0, Some(170_000)),
        "line 2: no range covers the contact from 1 to 2 from 100s on: its light time stays",
    ),
    ("no-owlt.json", (0.0, 60.0, 0.0, Some(60_000)), ""),
    ("rate-0.json", (0.0, 60.0, 1.0, None), ""),
    (
        "overlap-same-rate.json",
        (0.0, 90.0, 1.0, Some(90_000)),
        "line 1: the contact overlaps that of line 1: they are one",
    ),
    (
        "empty-contact.json",
        (0.0, 60.0, 1.0, Some(60_000)),
        "line 1: the contact ends as it begins: it is passed over",
    ),
    (
        "confidence.ionrc",
        (0.0, 60.0, 1.0, Some(6_000_000)),
        "line 2: confidence 0.1 is not used: the contact takes place",
    ),
    ("bom.ionrc", (0.0, 60.0, 1.0, Some(60_000)), ""),
];

#[test]
fn plans_are_read_as_the_programs_read_them_that_they_are_for() {
    for (file, told, remark) in PLANS {
        let assembled = by_plan(file, "").unwrap_or_else(|error| panic!("{file}: {error}"));
        assert_eq!(contacts(&assembled, "a", "b"), [told], "{file}");
        let expected = format!("contacts: {file}: {remark}");
        let remarks = &assembled.remarks;
        let said = match remark {
            "" => remarks.is_empty(),
            _ => remarks.len() == 1 && remarks[0].starts_with(&expected),
        };
        assert!(said, "{file}: {remarks:?}");
    }
}

#[test]
fn a_contact_without_a_range_is_passed_over_or_has_the_one_that_the_scenario_gives() {
    let file = "range-missing.ionrc";
    let without = by_plan(file, "").expect("the other contact has a range");
    assert_eq!(contacts(&without, "a", "b"), []);
    let both = (0.0, 60.0, 1.0, Some(60_000));
    assert_eq!(contacts(&without, "b", "a"), [both]);
    let start = "contacts: range-missing.ionrc: line 3: no range covers the contact from 1 to 2";
    let remarks = &without.remarks;
    assert!(
        remarks.len() == 1 && remarks[0].starts_with(start),
        "{remarks:?}"
    );
    let with = by_plan(file, "range = '2s'").expect("all contacts have a light time");
    let given = (0.0, 60.0, 2.0, Some(60_000));
    assert_eq!(contacts(&with, "a", "b"), [given]);
    assert_eq!(contacts(&with, "b", "a"), [both]);
    assert_eq!(with.remarks, [""; 0]);
    let hdtn = by_plan("no-owlt.json", "range = '2s'").expect("it is a plan");
    assert_eq!(contacts(&hdtn, "a", "b"), [given]);
}

#[test]
fn dates_beside_times_from_nowhere_are_named_as_the_cause() {
    let error = by_plan("mixed-times.ionrc", "").err();
    let error = error.expect("nobody knows when +0 is").to_string();
    assert!(
        error.contains("line 1: times such as +0 beside dates: expected an `@` line with a date"),
        "{error}"
    );
}
