//! Contact plans as other programs write them, and links whose keys have no effect.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use farside::record::{Flow, Observer, ObserverError, Record, RecordClass};
use farside::{Executor, SimDuration};
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

/// A contact: when it begins and ends \[s\], its light time \[s\], and the bytes that fit through
/// it.
type Told = (u64, u64, u64, Option<u64>);

fn contacts(assembled: &Assembled, from: &str, to: &str) -> Vec<Told> {
    let contacts = assembled.contacts.as_ref().expect("it has a plan");
    let windows = contacts.windows(from, to).expect("the plan names both");
    let told = windows.iter().map(|window| {
        let seconds = |nanos: u64| nanos / 1_000_000_000;
        let [start, end] = [window.start, window.end].map(|at| seconds(at.as_nanos()));
        (
            start,
            end,
            seconds(window.owlt.as_nanos()),
            window.volume_bytes(),
        )
    });
    told.collect()
}

/// Each plan, its contacts from `a` to `b`, and what the only remark on it begins with, if there
/// is one.
const PLANS: [(&str, Told, &str); 10] = [
    ("combined.rc", (0, 60, 1, Some(60_000)), ""),
    (
        "hypothetical.ionrc",
        (0, 60, 1, Some(60_000)),
        "line 2: the contact is hypothetical: it is passed over",
    ),
    ("announce.ionrc", (0, 60, 1, Some(60_000)), ""),
    (
        "range-ends-early.ionrc",
        (30, 200, 3, Some(170_000)),
        "line 2: no range covers the contact from 1 to 2 from 100s on: its light time stays",
    ),
    ("no-owlt.json", (0, 60, 0, Some(60_000)), ""),
    ("rate-0.json", (0, 60, 1, None), ""),
    (
        "overlap-same-rate.json",
        (0, 90, 1, Some(90_000)),
        "line 1: the contact overlaps that of line 1: they are one",
    ),
    (
        "empty-contact.json",
        (0, 60, 1, Some(60_000)),
        "line 1: the contact ends as it begins: it is passed over",
    ),
    (
        "confidence.ionrc",
        (0, 60, 1, Some(6_000_000)),
        "line 2: confidence 0.1 is not used: the contact takes place",
    ),
    ("bom.ionrc", (0, 60, 1, Some(60_000)), ""),
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
    let both = (0, 60, 1, Some(60_000));
    assert_eq!(contacts(&without, "b", "a"), [both]);
    let start = "contacts: range-missing.ionrc: line 3: no range covers the contact from 1 to 2";
    let remarks = &without.remarks;
    assert!(
        remarks.len() == 1 && remarks[0].starts_with(start),
        "{remarks:?}"
    );
    let with = by_plan(file, "range = '2s'").expect("all contacts have a light time");
    let given = (0, 60, 2, Some(60_000));
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

/// What is said of one of the scenarios, which is assembled.
fn remarks(file: &str) -> Vec<String> {
    let text = std::fs::read_to_string(folder().join(file)).expect("the file is there");
    assembled(text).expect("it is a scenario").remarks
}

#[test]
fn what_a_contact_has_its_own_of_is_said_to_have_no_effect() {
    let said = remarks("degrade-on-contact.toml");
    for key in ["latency", "rate"] {
        let what = format!("links: {key} has no effect in contacts that have their own");
        assert!(said.contains(&what), "{key}: {said:?}");
    }
    let idle = by_plan("bom.ionrc", "range = '2s'").expect("it is a plan");
    let what = "contacts.range has no effect: every contact has a light time of its own";
    assert_eq!(idle.remarks, [what]);
}

#[test]
fn a_packet_that_comes_in_the_millisecond_of_an_opportunity_misses_it() {
    let text = std::fs::read_to_string(folder().join("mahimahi-tie.toml")).expect("it is there");
    let mut assembled = assembled(text).expect("it is a scenario");
    let delays = Arc::new(Mutex::new(Vec::new()));
    assembled.sim.observe(Delays(delays.clone()));
    assembled.sim.run(Executor::Inline).expect("it runs");
    let delays = delays.lock().expect("nobody panicked");
    assert!(delays.len() >= 200);
    let wrong = delays.iter().find(|delay| delay.as_nanos() != 21_000_000);
    assert_eq!(wrong, None);
}

/// The delays of all messages over links.
struct Delays(Arc<Mutex<Vec<SimDuration>>>);

impl Observer for Delays {
    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        if record.class == RecordClass::Delivered && record.link.is_some() {
            let mut delays = self.0.lock().expect("nobody panicked");
            delays.push(record.time().since(record.sent));
        }
        Ok(Flow::Continue)
    }
}
